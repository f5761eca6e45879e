"""What somebody asks for: a trip to come with what is known at the door, and what was measured since."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.inertia import WRONG_SIGN, apparent_mass
from tripwatt.trips import COLUMNS, Context, Trip, is_sound, raise_faults, structure_faults, table_of

if TYPE_CHECKING:
    from tripwatt.forecasting.forecast import Forecast

MOST_PAYLOAD_KG: Final = 60_000.0
"""As the simulation allows."""


def trip_to_come(
    samples: pd.DataFrame,
    trip_id: str = "trip",
    *,
    displayed_soc: float | None = None,
    ambient_temperature_degc: float | None = None,
    cabin_setpoint_degc: float | None = None,
    cabin_temperature_degc: float | None = None,
    battery_temperature_degc: float | None = None,
    payload_mass_kg: float | None = None,
) -> Trip:
    """A trip from its speed trace and road; what is given here wins over the table's first sample.

    Parameters
    ----------
    samples : DataFrame
        Canonical columns.
    trip_id : str
    displayed_soc : float, optional
        State of charge at departure as the driver sees it, 0 to 1.
    ambient_temperature_degc, cabin_setpoint_degc, cabin_temperature_degc, battery_temperature_degc : float, optional
        At departure [°C].
    payload_mass_kg : float, optional
        Load on top of the car's test mass, which has a driver [kg].

    Raises
    ------
    InvalidInput
        With every value that cannot be one.

    Examples
    --------
    >>> drive = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 1.0, 2.0], "soc": 0.5})
    >>> trip = trip_to_come(drive, displayed_soc=0.8, payload_mass_kg=150.0)
    >>> "soc" in trip, trip.array("displayed_soc")[0].item(), trip.context.payload_mass_kg
    (False, 0.8, 150.0)
    """
    given = {
        "displayed_soc": displayed_soc,
        "ambient_temperature_degc": ambient_temperature_degc,
        "cabin_setpoint_degc": cabin_setpoint_degc,
        "cabin_temperature_degc": cabin_temperature_degc,
        "battery_temperature_degc": battery_temperature_degc,
    }
    known = {name: value for name, value in given.items() if value is not None}
    bounds = {name: (COLUMNS[name].minimum, COLUMNS[name].maximum, COLUMNS[name].unit) for name in known}
    if payload_mass_kg is not None:
        known["payload_mass_kg"] = payload_mass_kg
        bounds["payload_mass_kg"] = (0.0, MOST_PAYLOAD_KG, "kg")
    faults = [
        Fault(
            "value out of range",
            name,
            f"{value:g}",
            "{:g} to {:g} {}".format(*bounds[name]).removesuffix(" 1"),
        )
        for name, value in known.items()
        if not (math.isfinite(value) and bounds[name][0] <= value <= bounds[name][1])
    ]
    if faults:
        raise InvalidInput(faults)
    payload = known.pop("payload_mass_kg", 0.0)
    # the reading of the battery management would win over what the driver says
    left_out = {"soc"} if displayed_soc is not None else set()
    if not is_sound(samples):
        raise_faults(structure_faults(samples, trip_id))
    columns = {n: samples[n].to_numpy(dtype=np.float64) for n in samples.columns if n not in left_out}
    columns |= {name: np.full(len(samples), value) for name, value in known.items()}
    return Trip.from_samples(trip_id, table_of(columns), Context(payload_mass_kg=payload))


def since_departure(observed: pd.DataFrame, trip: Trip) -> pd.DataFrame:
    """Samples measured on the way, on the trip's own clock, with their times since its first sample.

    Raises
    ------
    InvalidInput
        When they begin before the trip or after it, or their current has the wrong sign.

    Examples
    --------
    >>> drive = pd.DataFrame({"time_s": [60.0, 61.0], "speed_m_s": [0.0, 1.0]})
    >>> trip = Trip.from_samples("t", drive)
    >>> since_departure(pd.DataFrame({"time_s": [60.0, 61.0], "soc": [0.5, 0.5]}), trip)["time_s"].tolist()
    [0.0, 1.0]
    """
    start = float(trip.samples["time_s"].iloc[0])
    times = observed["time_s"] - start
    if len(times) and float(times.iloc[0]) < 0.0:
        got, allowed = f"{float(observed['time_s'].iloc[0]):g} s", f"{start:g} s or later, as the trip"
        raise InvalidInput(Fault("measured before departure", "observed samples, time_s", got, allowed))
    if len(times) and trip.context.planned_link_m is None and float(times.iloc[0]) > trip.duration_s:
        first, last = (float(observed["time_s"].iloc[i]) for i in (0, -1))
        got, allowed = f"{first:g} to {last:g} s", f"{start:g} to {start + trip.duration_s:g} s, as the trip"
        fix = "put them on the trip's clock"
        raise InvalidInput(Fault("measured after the trip", "observed samples, time_s", got, allowed, fix))
    _require_sign(observed, trip)
    return observed.assign(time_s=times)


def _require_sign(observed: pd.DataFrame, trip: Trip) -> None:
    """Refuse a current with which the battery would charge while the car accelerates."""
    if not {"voltage_v", "current_a"} <= set(observed.columns):
        return
    time = observed["time_s"].to_numpy(dtype=np.float64)
    own = "speed_m_s" in observed
    if not own and trip.context.planned_link_m is not None:
        return  # nobody knows how fast the car was
    speed = (
        observed["speed_m_s"].to_numpy(dtype=np.float64)
        if own
        else np.interp(time, trip.array("time_s"), trip.array("speed_m_s"))
    )
    power = (observed["voltage_v"] * observed["current_a"]).to_numpy(dtype=np.float64)
    found = apparent_mass(time, speed, power)
    if found is not None and found[1] < WRONG_SIGN:
        got, allowed = "the battery would charge while the car accelerates", "+ where it discharges"
        raise InvalidInput(
            Fault("the current has the wrong sign", "observed samples, current_a", got, allowed, "negate it")
        )


def answer_of(found: Forecast, reserve: float) -> dict[str, Any]:
    """What the command line and the service answer: the forecast, and the chance to arrive with the reserve.

    Parameters
    ----------
    found : Forecast
    reserve : float
        Displayed state of charge to arrive with, 0 to 1.
    """
    answer = found.as_dict()
    answer["p_arrive"][f"{reserve:g}"] = found.p_arrive(reserve)
    return answer
