"""Where a car usually goes at this hour: the earlier trip whose departure is nearest by time of day."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable
from dataclasses import replace
from typing import Final, Protocol

from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.server.cars.car_file import CarFile
from tripwatt.trips import Departure, Plan, TripSet
from tripwatt.units import SECONDS_PER_HOUR

NEAR_S: Final = 1.5 * SECONDS_PER_HOUR
"""Largest difference by time of day between a departure and that of its usual trip [s]."""

LONGER: Final = 1.1
"""A trip that is longer than the usual one by this factor goes elsewhere."""

_DAY_S: Final = 24.0 * SECONDS_PER_HOUR
_SATURDAY: Final = 5


class HasTrips(Protocol):
    """A car with its trips in its file."""

    name: str
    file: CarFile


def usual_departure(earlier_s: Iterable[float], departure_s: float) -> float | None:
    """Return the earlier departure that is nearest by local time of day. O(departures).

    If there are departures on the same kind of day, only these count: working days are one kind, Saturday and Sunday another.
    If two departures are equally near, the later one is returned.

    Parameters
    ----------
    earlier_s : iterable of float
        Departures of finished trips [s since 1970].
    departure_s : float
        Departure of the trip in question [s since 1970].

    Returns
    -------
    float or None
        None if no earlier departure is within `NEAR_S`.

    Examples
    --------
    >>> monday = 1_700_467_200.0
    >>> usual_departure([monday, monday + 3600.0], monday + 86_400.0 + 900.0) == monday
    True
    """
    near = [(other, away) for other in earlier_s if (away := _away_s(other, departure_s)) <= NEAR_S]
    alike = [pair for pair in near if _is_weekend(pair[0]) == _is_weekend(departure_s)]
    return min(alike or near, key=lambda pair: (pair[1], -pair[0]), default=(None, 0.0))[0]


def usual_plan(car: HasTrips, trip_id: str) -> Plan:
    """Return the plan to drive a trip of a car again: its road and its speeds, without what was known at its departure.

    Parameters
    ----------
    car : Car
        Car with its trips.
    trip_id : str
        Name of one of these trips.

    Returns
    -------
    Plan
        For `need` or `ForecastModel.forecast`.

    Raises
    ------
    InvalidInput
        When the car has no sound trip of this name.
    """
    logs = car.file.logs("trip_id = ?", trip_id)
    trips = audit(TripSet(car.name, logs)).trips if logs else ()
    if not trips:
        raise InvalidInput.of("no such trip", "trip", trip_id[:60], f"a sound trip of the car {car.name}")
    return replace(Plan.from_trip(trips[0]), departure=Departure())


def _away_s(one_s: float, other_s: float) -> float:
    """Return the difference between two times of day [s], over midnight if that is shorter."""
    apart = abs(_time_of_day_s(one_s) - _time_of_day_s(other_s))
    return min(apart, _DAY_S - apart)


def _time_of_day_s(time_s: float) -> float:
    local = dt.datetime.fromtimestamp(time_s)
    return local.hour * SECONDS_PER_HOUR + local.minute * 60.0 + local.second


def _is_weekend(time_s: float) -> bool:
    return dt.datetime.fromtimestamp(time_s).weekday() >= _SATURDAY
