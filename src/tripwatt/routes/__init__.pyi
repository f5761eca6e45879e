from .link_objects import is_links_table, is_route, route_from_links
from .links import LinkRoute, links_of_trip, plan_on_links
from .profile import LinkStyle, link_profile
from .responses import parse_route
from .tracks import Track

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
