"""A planned trip: links, a recorded track or a router's answer, and the speed profile that a driver makes of them."""

from tripwatt.routes.answers import ROUTERS, is_route, read_answer, read_route
from tripwatt.routes.calibrate import calibrate_style, road_work
from tripwatt.routes.departure import Departure, departure_of
from tripwatt.routes.geojson import ROAD_SPEED_M_S, read_geojson
from tripwatt.routes.gpx import read_gpx
from tripwatt.routes.links import (
    LinkRoute,
    join_routes,
    links_of_trip,
    trip_from_links,
)
from tripwatt.routes.listed import route_from_links
from tripwatt.routes.plan import plan_trip
from tripwatt.routes.profile import LinkStyle, link_profile
from tripwatt.routes.table import is_links_table, route_from_table
from tripwatt.routes.tracks import (
    Track,
    needs_speed,
    route_from_track,
    trip_from_track,
)

__all__ = [
    "ROAD_SPEED_M_S",
    "ROUTERS",
    "Departure",
    "LinkRoute",
    "LinkStyle",
    "Track",
    "calibrate_style",
    "departure_of",
    "is_links_table",
    "is_route",
    "join_routes",
    "link_profile",
    "links_of_trip",
    "needs_speed",
    "plan_trip",
    "read_answer",
    "read_geojson",
    "read_gpx",
    "read_route",
    "road_work",
    "route_from_links",
    "route_from_table",
    "route_from_track",
    "trip_from_links",
    "trip_from_track",
]
