"""The plan of a car's current or next trip, as the fields of a request; kept until the trip has ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tripwatt.errors import InvalidInput, or_none
from tripwatt.routes import links_of_trip, route_from_links
from tripwatt.routes.link_objects import fields_of_route, route_with_elevation
from tripwatt.sources.canonical import canonical_samples
from tripwatt.trips import ASKED, Departure, Plan, Recorded


@dataclass(frozen=True)
class LivePlan:
    """The plan of a trip, as it was given.

    Attributes
    ----------
    request : mapping
        Fields of a request for a forecast: `links` with `elevation`, or `samples`; what is known of the departure; `reserve`.
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
        given = {name: value for name, value in self.request.items() if value is not None}
        try:
            if "samples" in given:
                lists = given["samples"].items()
                columns = {name.removeprefix("bms_"): np.array(values, np.float64) for name, values in lists}
                plan = Plan.from_samples(canonical_samples(columns), "samples")
            else:
                route = route_from_links(given["links"])
                if "elevation" in given:
                    route = route_with_elevation(route, **given["elevation"])
                plan = route.plan()
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            got = f"{type(error).__name__}: {error}"[:200]
            raise InvalidInput.of("no road", "plan", got, "links or samples of a request") from error
        known = ASKED.keys() & given.keys() - {"departs_at"}
        return plan.with_departure(Departure(**{name: given[name] for name in known}))

    @classmethod
    def from_trip(cls, trip: Recorded) -> LivePlan | None:
        """Make a plan from the road of a finished trip; return None if its samples give no road."""
        links = or_none(links_of_trip, trip)
        return None if links is None else cls(fields_of_route(links), usual_trip=trip.trip_id)

    def to_dict(self) -> dict[str, Any]:
        """Convert the plan to plain values.

        Returns
        -------
        dict
            Values for `from_dict`.
        """
        return {"given_s": self.given_s, "departure_s": self.departure_s, "request": self.request}

    @classmethod
    def from_dict(cls, about: Mapping[str, Any]) -> LivePlan:
        """Make a plan from the values of `to_dict`.

        Raises
        ------
        KeyError, TypeError
            When the values are not those of a plan.
        """
        return cls(dict(about["request"]), about["departure_s"], about["given_s"])
