"""The driver model's numbers from trips that were driven: cut them into links, drive the links, compare the work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.routes.links import links_of_trip
from tripwatt.routes.profile import LinkStyle
from tripwatt.trips import Plan, Trip
from tripwatt.units import GRAVITY_M_S2

LINK_LENGTHS_M: Final = (250.0, 1000.0)

ROLLING_COEFFICIENT: Final = 0.010
DRAG_PER_MASS_1_M: Final = 2.6e-4
ROTATING_MASS_FACTOR: Final = 1.05
DRIVE_EFFICIENCY: Final = 0.85
RECOVERY_EFFICIENCY: Final = 0.7
"""A compact electric car in round figures: c_d A 0.65 m² on 1500 kg in air of 1.2 kg/m³. Only how strongly air drag,
rolling and lost kinetic energy weigh against each other matters here."""

FITTED: Final = {"street_speed_m_s": (2.0, 30.0), "length_exponent": (0.0, 0.8), "comfort": (0.08, 0.8)}
"""What is fitted of a style, and its bounds."""


def road_work(trip: Trip | Plan) -> float:
    """Electric work per mass of a compact electric car over a trip on a flat road [J/kg], braking partly recovered.

    Parameters
    ----------
    trip : Trip or Plan
        With `time_s` and `speed_m_s`.

    Returns
    -------
    float
        Work over the whole trip [J/kg].

    Examples
    --------
    >>> import pandas as pd
    >>> log = pd.DataFrame({"time_s": [0.0, 100.0], "speed_m_s": [10.0, 10.0]})
    >>> round(road_work(Trip.from_samples("t", log)), 1)
    146.0
    """
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    step = np.diff(time)
    mean = 0.5 * (speed[1:] + speed[:-1])
    force = (
        ROLLING_COEFFICIENT * GRAVITY_M_S2
        + DRAG_PER_MASS_1_M * mean**2
        + ROTATING_MASS_FACTOR * np.diff(speed) / step
    )
    power = force * mean
    electric = np.maximum(power, 0.0) / DRIVE_EFFICIENCY + np.minimum(power, 0.0) * RECOVERY_EFFICIENCY
    return float(np.sum(electric * step))


def calibrate_style(
    trips: Sequence[Trip],
    *,
    length_m: Sequence[float] = LINK_LENGTHS_M,
    energy: Callable[[Trip | Plan], float] = road_work,
    style: LinkStyle | None = None,
    max_trips: int = 40,
    max_evaluations: int = 120,
) -> LinkStyle:
    """Find the street speed, its growth with length and the comfort that fit trips best. O(evaluations x samples).

    Each trip is cut into links and driven again from these; the fit minimises the sum over the lengths of the mean
    absolute relative difference of `energy` between both. Nothing but the trips given enters, so that it
    may be called within each fold of an evaluation.

    Parameters
    ----------
    trips : sequence of Trip
        At 1 Hz; of more than `max_trips` every n-th is used.
    length_m : sequence of float
        Lengths of links [m] for which the style is to hold. With only one of them its growth with length is left alone.
    energy : callable
        What is compared, such as the simulated energy of a car; positive.
    style : LinkStyle, optional
        Where the search starts, and the values that are not fitted.
    max_trips : int
        Most trips that are driven in each evaluation.
    max_evaluations : int
        Most evaluations of the sum that is minimised.

    Returns
    -------
    LinkStyle
        The starting style with fitted `street_speed_m_s`, `length_exponent` and `comfort`.

    Raises
    ------
    InvalidInput
        When there is no trip, or one takes no positive energy.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> style = calibrate_style(synthetic_fleet(1).trips, length_m=[500.0], max_evaluations=2)
    >>> style.length_exponent == LinkStyle().length_exponent
    True
    """
    from scipy.optimize import minimize

    start = style or LinkStyle()
    chosen = trips[:: -(-len(trips) // max_trips)] if trips else ()
    if not chosen:
        raise InvalidInput.of("no trips", "trips", "0", "at least one")
    raise_faults(
        Fault("no positive energy", trip.trip_id, f"{energy(trip):g}", "more than 0")
        for trip in chosen
        if not energy(trip) > 0
    )
    names = [name for name in FITTED if len(length_m) > 1 or name != "length_exponent"]
    low, high = np.array([FITTED[name] for name in names]).T
    cases = [(links_of_trip(t, length), t.departure, energy(t)) for t in chosen for length in length_m]

    def loss(x: FloatArray) -> float:
        inside = np.clip(x, low, high)
        trial = _with(start, names, inside)
        off = [abs(energy(r.plan(style=trial).with_departure(d)) / e - 1.0) for r, d, e in cases]
        return float(np.mean(off)) + float(np.sum(np.abs(x - inside)))

    first = np.array([getattr(start, name) for name in names])
    simplex = np.vstack([first, first * (1.0 + 0.25 * np.eye(len(names)))])
    options = {"maxfev": max_evaluations, "initial_simplex": simplex, "xatol": 5e-3, "fatol": 2e-5}
    result = minimize(loss, first, method="Nelder-Mead", options=options)
    return _with(start, names, np.clip(result.x, low, high))


def _with(style: LinkStyle, names: Sequence[str], values: FloatArray) -> LinkStyle:
    given: dict[str, Any] = dict(zip(names, values.tolist(), strict=True))
    return replace(style, **given)
