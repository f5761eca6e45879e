"""Whatever a route came as, the plan of the drive on it."""

from __future__ import annotations

import numpy as np

from tripwatt.routes.links import LinkRoute, plan_from_links
from tripwatt.routes.profile import LinkStyle
from tripwatt.routes.tracks import Track, plan_from_track, route_from_track
from tripwatt.trips import Plan


def plan_from_route(
    route: LinkRoute | Track,
    *,
    speed_m_s: float | None = None,
    trip_id: str = "route",
    style: LinkStyle | None = None,
    rng: np.random.Generator | None = None,
    step_s: float = 1.0,
) -> Plan:
    """A plan from links or a track. O(length / 4 m + samples).

    The log of a drive keeps its own speed; everything else becomes links that a driver drives (`plan_from_links`).

    Parameters
    ----------
    route : LinkRoute or Track
    speed_m_s : float, optional
        Mean speed [m/s] of a track's pieces that know neither time nor speed.
    trip_id : str
    style : LinkStyle, optional
    rng : numpy.random.Generator, optional
        Draws stops and speeds; without it the same route gives the same trip.
    step_s : float
        Time between two samples [s].

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
        route = route_from_track(route, speed_m_s)
    return plan_from_links(route, trip_id=trip_id, style=style, rng=rng, step_s=step_s)
