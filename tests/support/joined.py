"""Routes of links one after the other."""

from collections.abc import Sequence

import numpy as np

from tripwatt.routes.links import FLAT_ROAD, LinkRoute


def join_routes(routes: Sequence[LinkRoute]) -> LinkRoute:
    """Routes one after the other; heights are known only where all of them have heights."""
    starts = np.cumsum([0.0, *(route.distance_m for route in routes[:-1])])
    heights = [
        (start + route.elevation_position_m, route.elevation_m)
        for start, route in zip(starts.tolist(), routes, strict=True)
        if route.elevation_position_m is not None and route.elevation_m is not None
    ]
    position, height = (
        map(np.concatenate, zip(*heights, strict=True)) if len(heights) == len(routes) else (None, None)
    )
    flags = tuple(dict.fromkeys(flag for route in routes for flag in route.flags))
    unknown = [np.full(len(route), np.nan) for route in routes]
    limits = [route.speed_limit_m_s for route in routes]
    return LinkRoute(
        np.concatenate([route.length_m for route in routes]),
        np.concatenate([route.travel_time_s for route in routes]),
        np.concatenate([route.stop_s for route in routes]),
        np.concatenate([route.moving_speed_m_s for route in routes]),
        position,
        height,
        flags if height is not None or FLAT_ROAD in flags else (*flags, FLAT_ROAD),
        None
        if all(limit is None for limit in limits)
        else np.concatenate(
            [other if limit is None else limit for limit, other in zip(limits, unknown, strict=True)]
        ),
        any(route.free_flow for route in routes),
    )
