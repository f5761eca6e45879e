"""What was measured on the way, on the clock of the departure."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.inertia import WRONG_SIGN, apparent_mass
from tripwatt.trips import Plan


def since_departure(observed: pd.DataFrame, plan: Plan) -> pd.DataFrame:
    """Samples measured on the way, on the clock of a plan, with their times since its departure.

    Raises
    ------
    InvalidInput
        When they begin before the trip or after it, or their current has the wrong sign.

    Examples
    --------
    >>> from tripwatt.trips import plan_from_samples
    >>> plan = plan_from_samples(pd.DataFrame({"time_s": [60.0, 61.0], "speed_m_s": [0.0, 1.0]}))
    >>> since_departure(pd.DataFrame({"time_s": [60.0, 61.0], "soc": [0.5, 0.5]}), plan)["time_s"].tolist()
    [0.0, 1.0]
    """
    start = plan.start_s
    times = observed["time_s"] - start
    if len(times) and float(times.iloc[0]) < 0.0:
        got, allowed = f"{float(observed['time_s'].iloc[0]):g} s", f"{start:g} s or later"
        raise InvalidInput(Fault("measured before departure", "observed samples, time_s", got, allowed))
    if len(times) and plan.link_m is None:
        end = start + plan.duration_s if plan.end_s is None else plan.end_s
        first, last = (float(observed["time_s"].iloc[i]) for i in (0, -1))
        if first > end:
            got, allowed = f"{first:g} to {last:g} s", f"{start:g} to {end:g} s"
            fix = "give times on the clock of the trip"
            raise InvalidInput(
                Fault("measured after the trip", "observed samples, time_s", got, allowed, fix)
            )
    found = observed.assign(time_s=times)
    _require_sign(found, plan)
    return found


def _require_sign(observed: pd.DataFrame, plan: Plan) -> None:
    """Refuse a current with which the battery would charge while the car accelerates."""
    if not {"voltage_v", "current_a"} <= set(observed.columns):
        return
    time = observed["time_s"].to_numpy(dtype=np.float64)
    own = "speed_m_s" in observed
    if not own and plan.link_m is not None:
        return  # nobody knows how fast the car was
    speed = (
        observed["speed_m_s"].to_numpy(dtype=np.float64)
        if own
        else np.interp(time, plan.array("time_s"), plan.array("speed_m_s"))
    )
    power = (observed["voltage_v"] * observed["current_a"]).to_numpy(dtype=np.float64)
    found = apparent_mass(time, speed, power)
    if found is not None and found[1] < WRONG_SIGN:
        got, allowed = (
            "the battery would charge while the car accelerates",
            "positive when the battery discharges",
        )
        raise InvalidInput(
            Fault(
                "current has the wrong sign",
                "observed samples, current_a",
                got,
                allowed,
                "reverse the sign of current_a",
            )
        )
