"""The plan of a car's current or next trip: as it was given, until that trip has ended; else the road of a usual trip."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from tripwatt.errors import damage, or_none
from tripwatt.routes import links_of_trip, route_from_links
from tripwatt.routes.link_objects import fields_of_route, route_with_elevation
from tripwatt.sources.canonical import canonical_samples
from tripwatt.trips import ASKED, Departure, Plan, Recorded
from tripwatt.units import SECONDS_PER_DAY, SECONDS_PER_HOUR

NEAR_S: Final = 1.5 * SECONDS_PER_HOUR
"""Largest difference by time of day between a departure and that of its usual trip [s]. A choice."""

LONGER: Final = 1.1
"""A trip that is longer than the usual one by this factor goes elsewhere. A choice: detours are shorter."""


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
    near = [(earlier, away) for earlier in earlier_s if (away := _apart_s(earlier, departure_s)) <= NEAR_S]
    same_kind = [pair for pair in near if _is_weekend(pair[0]) == _is_weekend(departure_s)]
    return min(same_kind or near, key=lambda pair: (pair[1], -pair[0]), default=(None, 0.0))[0]


def _apart_s(one_s: float, other_s: float) -> float:
    """Return the difference between two times of day [s], over midnight if that is shorter."""
    apart = abs(_time_of_day_s(one_s) - _time_of_day_s(other_s))
    return min(apart, SECONDS_PER_DAY - apart)


def _time_of_day_s(time_s: float) -> float:
    local = dt.datetime.fromtimestamp(time_s)
    return local.hour * SECONDS_PER_HOUR + local.minute * 60.0 + local.second


def _is_weekend(time_s: float) -> bool:
    return dt.datetime.fromtimestamp(time_s).weekday() >= 5  # Saturday or Sunday


@dataclass(frozen=True)
class LivePlan:
    """The plan of a trip, as it was given.

    Attributes
    ----------
    request : mapping
        Fields of a request for a forecast: `links` with `elevation`, or `samples`; what is known of the departure; `reserve`.
        And `destination`: where the trip ends, in words.
    departure_s : float or None
        Departure on the plan's clock [s since 1970]; None for the start of the trip.
    given_s : float or None
        Time of the car's latest sample when the plan was given [s since 1970].
    usual_trip : str or None
        Name of the earlier trip whose road this is; None for a plan that was given.

    Examples
    --------
    >>> plan = LivePlan({"links": [{"length_m": 500.0, "speed_m_s": 10.0}], "soc": 0.8})
    >>> plan.road.departure, plan.departure_s is None
    (Departure(soc=0.8), True)
    """

    request: Mapping[str, Any]
    departure_s: float | None = None
    given_s: float | None = None
    usual_trip: str | None = None

    @cached_property
    def road(self) -> Plan:
        """The planned road, with what the request holds of the departure.

        Raises
        ------
        InvalidInput
            When the fields do not describe a road.
        """
        fields = {name: value for name, value in self.request.items() if value is not None}
        with damage("plan", "links or samples of a request", what="no road"):
            if "samples" in fields:
                lists = fields["samples"].items()
                columns = {name.removeprefix("bms_"): np.array(values, np.float64) for name, values in lists}
                plan = Plan.from_samples(canonical_samples(columns), "samples")
            else:
                route = route_from_links(fields["links"])
                if "elevation" in fields:
                    route = route_with_elevation(route, **fields["elevation"])
                plan = replace(route, measured=self.usual_trip is not None).plan()
        names = ASKED.keys() & fields.keys() - {"departs_at"}
        return plan.with_departure(Departure(**{name: fields[name] for name in names}))

    @classmethod
    def from_trip(cls, trip: Recorded) -> LivePlan | None:
        """Make a plan from the road of a finished trip; return None if its samples give no road."""
        links = or_none(links_of_trip, trip)
        return None if links is None else cls(fields_of_route(links), usual_trip=trip.trip_id)
