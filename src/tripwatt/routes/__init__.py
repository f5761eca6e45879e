"""Planned trips from links, recorded tracks or router responses, and the speed over time of a driver on them."""

from tripwatt.routes.link_objects import is_links_table, route_from_links
from tripwatt.routes.links import LinkRoute, links_of_trip, plan_on_links
from tripwatt.routes.profile import LinkStyle, link_profile
from tripwatt.routes.responses import is_route, parse_route
from tripwatt.routes.tracks import Track

__all__ = [
    "LinkRoute",
    "LinkStyle",
    "Track",
    "is_links_table",
    "is_route",
    "link_profile",
    "links_of_trip",
    "parse_route",
    "plan_on_links",
    "route_from_links",
]
