"""Plans from any kind of route."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tripwatt.routes.links import LinkRoute, links_of_trip, plan_from_links
from tripwatt.routes.places import with_heading
from tripwatt.routes.profile import LinkStyle
from tripwatt.routes.tracks import Track, plan_from_track, route_from_track
from tripwatt.trips import Plan, Trip


def plan_from_route(
    route: LinkRoute | Track,
    *,
    speed_m_s: float | None = None,
    trip_id: str = "route",
    style: LinkStyle | None = None,
    rng: np.random.Generator | None = None,
    step_s: float = 1.0,
) -> Plan:
    """Make a plan from links or a track. O(length / 4 m + samples).

    The log of a drive keeps its own speed; any other track is first converted to links, and links are driven by
    `plan_from_links`.

    Parameters
    ----------
    route : LinkRoute or Track
        A route that `parse_route` returned.
    speed_m_s : float, optional
        Mean speed [m/s] of a track's pieces without time and speed.
    trip_id : str
        Name of the plan.
    style : LinkStyle, optional
        How traffic and driver fill a link; the calibrated style by default.
    rng : numpy.random.Generator, optional
        Draws stops and speeds; without it the same route always gives the same plan.
    step_s : float
        Time between two samples [s].

    Returns
    -------
    Plan
        Speed over time, and elevation if it is known.

    Raises
    ------
    InvalidInput
        As `plan_from_track`, `route_from_track` and `plan_from_links`.

    Examples
    --------
    >>> from tripwatt.routes import parse_route
    >>> line = parse_route(b'{"type": "LineString", "coordinates": [[11.5, 48.1], [11.52, 48.1]]}')
    >>> round(plan_from_route(line, speed_m_s=14.0).duration_s)
    107
    """
    if isinstance(route, Track):
        if route.is_log:
            return plan_from_track(route, trip_id=trip_id, step_s=step_s)
        plan = plan_from_links(
            route_from_track(route, speed_m_s), trip_id=trip_id, style=style, rng=rng, step_s=step_s
        )
        return with_heading(
            plan, route.latitude_deg, route.longitude_deg, route.position_m, float(route.position_m[-1])
        )
    return plan_from_links(route, trip_id=trip_id, style=style, rng=rng, step_s=step_s)


def plan_on_links(trip: Trip, length_m: float) -> Plan:
    """Plan of a recorded trip as if only the mean speeds of links of one length were known.

    Travel times of the links include every standstill; elevation is known only at their ends, stops are unknown.

    Parameters
    ----------
    trip : Trip
        Raw or resampled.
    length_m : float
        Length of a link [m].

    Returns
    -------
    Plan
        With the departure of the trip.

    Raises
    ------
    InvalidInput
        When the car does not move, or moves faster than a link allows.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> trip = synthetic_fleet(1).logs[0]
    >>> plan = plan_on_links(trip, 500.0)
    >>> plan.departure == trip.departure, abs(plan.distance_m / trip.distance_m - 1.0) < 0.01
    (True, True)
    """
    plan = plan_from_links(links_of_trip(trip, length_m), trip_id=trip.trip_id)
    return replace(plan.with_departure(trip.departure), start_s=float(trip.array("time_s")[0]))
