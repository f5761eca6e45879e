"""OSRM, GraphHopper and openrouteservice as routers, each by the URL of a server.

Requests and answers follow the public documentation of each API; `docs/howto/journeys.md` names the pages.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.routers.road import KEY_NAME, MAX_ROUTES, Edges, Leg, Road, no_road, require_stops
from tripwatt.routes.carried import carried_pieces, carried_points, ferry_steps
from tripwatt.routes.documents import Node, edge_pieces, intervals, speeds_at_points, step_pieces, steps_of
from tripwatt.routes.places import Place
from tripwatt.routes.points import distances_m
from tripwatt.routes.web import WebClient, as_remote, require_object

_NO_ROUTE_CODES: Final = frozenset({"NoRoute", "NoSegment", "InvalidValue", "InvalidQuery", "TooBig"})
"""Codes of OSRM for places that no road connects, and for places that are not valid."""


def request_osrm(client: WebClient, stops: Sequence[Place], alternatives: int) -> Node:
    """Request the fastest route and other routes of OSRM, and return the routes of the answer."""
    line = ";".join(f"{p.longitude_deg:.6f},{p.latitude_deg:.6f}" for p in stops)
    query = {
        "alternatives": str(alternatives) if alternatives else "false",
        "geometries": "geojson",
        "overview": "full",
        "steps": "true",
        "annotations": "duration,distance,speed",
    }
    answer = require_object(client.get_json(f"/route/v1/driving/{line}", query), "route")
    code = answer["code"].value
    if isinstance(code, str) and code in _NO_ROUTE_CODES:
        raise no_road(stops, str(answer["message"].value or code))
    if code != "Ok":
        raise RemoteError.of("the router failed", client.host, repr(code)[:60], "code Ok")
    return answer["routes"]


def osrm_leg(route: Node) -> Leg:
    """Return a route of OSRM as one leg with the whole line, from its annotations, or from its steps if it has none."""
    tables, carried = [], []
    for leg in route["legs"].entries(min_count=1):
        is_annotated = isinstance(leg["annotation"].value, dict)
        table = edge_pieces(leg, annotated_speed=True) if is_annotated else step_pieces(steps_of(leg))
        tables.append(table)
        carried.append(carried_pieces(leg, table[:, 0]))
    points = route["geometry"]["coordinates"].coordinates()[:, :2]
    return _leg_from_table(np.concatenate(tables), points, np.concatenate(carried))


def request_graphhopper(client: WebClient, stops: Sequence[Place], alternatives: int) -> Node:
    """Request the fastest route and other routes of GraphHopper, and return the routes of the answer."""
    body: dict[str, Any] = {
        "points": [[p.longitude_deg, p.latitude_deg] for p in stops],
        "profile": "car",
        "points_encoded": False,
        "elevation": True,
        "instructions": False,
        "details": ["time", "distance", "average_speed", "max_speed", "road_class", "road_environment"],
    }
    if alternatives:
        body |= {"algorithm": "alternative_route", "alternative_route.max_paths": alternatives + 1}
    answer = require_object(client.post_json("/route", body), "route")
    if "paths" not in answer.members():
        raise no_road(stops, str(answer["message"].value or "no paths"))
    return answer["paths"]


def graphhopper_leg(route: Node) -> Leg:
    """Return a path of GraphHopper as one leg with the whole line."""
    points, details = route["points"]["coordinates"].coordinates(), route["details"]
    n = len(points)
    position = distances_m(points, route["distance"].number(minimum=0.0))
    time = [(start, end, value.number(minimum=0.0)) for start, end, value in intervals(details["time"], n)]
    if not time or any(a[1] != b[0] for a, b in itertools.pairwise(time)):
        where, got = details["time"].where, f"{len(time)}"
        raise InvalidInput.of("incomplete path details", where, got, "one for each edge")
    speed, limit = (speeds_at_points(details[name], n) for name in ("average_speed", "max_speed"))
    kinds = {start: str(kind.value or "") for start, _, kind in intervals(details["road_class"], n)}
    starts = sorted(kinds)
    begin = np.array([start for start, _, _ in time])
    kind_index = np.searchsorted(starts, begin, side="right") - 1
    edges = Edges(
        np.diff(position[np.append(begin, time[-1][1])]),
        np.array([milliseconds / 1000.0 for _, _, milliseconds in time]),
        speed[begin],
        limit[begin],
        tuple(kinds[starts[k]] if k >= 0 else "" for k in kind_index),
        np.zeros(len(begin), dtype=bool),
        carried_points(details, n)[begin],
    )
    return Leg.from_points(edges, points, position)


def request_openrouteservice(client: WebClient, stops: Sequence[Place], alternatives: int) -> Node:
    """Request the fastest route and other routes of openrouteservice, and return the routes of the answer."""
    body: dict[str, Any] = {
        "coordinates": [[p.longitude_deg, p.latitude_deg] for p in stops],
        "elevation": True,
        "units": "m",
        "instructions": True,
        "extra_info": ["waytype"],
    }
    if alternatives:
        body["alternative_routes"] = {"target_count": min(alternatives + 1, 3)}
    answer = require_object(client.post_json("/v2/directions/driving-car/geojson", body), "directions")
    if "error" in answer.members():
        raise no_road(stops, str(answer["error"].value))
    return answer["features"]


def openrouteservice_leg(route: Node) -> Leg:
    """Return a route of openrouteservice as one leg with the whole line."""
    properties = route["properties"]
    steps = [step for part in properties["segments"].entries(min_count=1) for step in steps_of(part)]
    points = route["geometry"]["coordinates"].coordinates()
    return _leg_from_table(step_pieces(steps), points, ferry_steps(properties, steps))


def _leg_from_table(table: FloatArray, points: FloatArray, carried: BoolArray) -> Leg:
    """Make one leg from a table of lengths, times and speeds of edges, shape (edges, 3); points may have heights."""
    table[~(table[:, 2] > 0.0), 2] = np.nan
    edges = Edges.from_speeds(table[:, 0], table[:, 1], table[:, 2], carried)
    return Leg.from_points(edges, points, distances_m(points, float(table[:, 0].sum())))


SERVERS: Final[
    Mapping[str, tuple[str, Callable[[WebClient, Sequence[Place], int], Node], Callable[[Node], Leg]]]
] = {
    "osrm": ("query:api_key", request_osrm, osrm_leg),
    "graphhopper": ("query:key", request_graphhopper, graphhopper_leg),
    "openrouteservice": ("header:Authorization", request_openrouteservice, openrouteservice_leg),
}
"""For each kind of server the place of its key in a request (see `WebClient`), the request for routes, and the reader of a route."""


@dataclass(frozen=True)
class ServerRouter:
    """A router by a server of one of `SERVERS`, without isochrones, and without alternatives for roads through intermediate stops."""

    client: WebClient
    kind: str

    @classmethod
    def from_url(cls, kind: str, url: str) -> Self:
        """Make a router from the kind and the URL of its server."""
        return cls(WebClient(url, "the router", KEY_NAME, SERVERS[kind][0]), kind)

    def outline(self, start: Place, minutes: float) -> tuple[Place, ...]:
        """Return no places, see `Router.outline`."""
        return ()

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """See `Router.roads`."""
        require_stops(stops)
        _, request_routes, read_leg = SERVERS[self.kind]
        most = min(alternatives, MAX_ROUTES - 1) if len(stops) == 2 else 0
        answer = request_routes(self.client, stops, most)
        with as_remote():
            legs = [read_leg(route) for route in answer.entries(min_count=1)[:MAX_ROUTES]]
        return tuple(Road.from_legs([leg], stops) for leg in legs)
