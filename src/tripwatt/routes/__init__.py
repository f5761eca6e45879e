"""A planned trip: links, a recorded track or a router's answer, and the speed profile that a driver makes of them."""

from tripwatt.routes.calibrate import calibrate_style, road_work
from tripwatt.routes.links import (
    Departure,
    LinkRoute,
    departure_of,
    join_routes,
    links_of_trip,
    route_from_links,
    trip_from_links,
)
from tripwatt.routes.profile import LinkStyle, link_profile

__all__ = [
    "Departure",
    "LinkRoute",
    "LinkStyle",
    "calibrate_style",
    "departure_of",
    "join_routes",
    "link_profile",
    "links_of_trip",
    "road_work",
    "route_from_links",
    "trip_from_links",
]
