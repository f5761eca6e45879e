"""Valhalla as a router: a server by URL, or the library in this process.

Requests and answers follow Valhalla's public API (`route`, `trace_attributes`, `height`, `isochrone`). A road's edges,
with their speeds, classes and signals, come from `trace_attributes` on the line of the route.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any, Final, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.roads.routers.road import KEY_NAME, MAX_ROUTES, Edges, Leg, Road, no_road, require_stops
from tripwatt.routes.carried import CARRIED
from tripwatt.routes.documents import Node
from tripwatt.routes.places import Place
from tripwatt.routes.points import decode_polyline, distances_m
from tripwatt.routes.web import WebClient, as_remote, require_object
from tripwatt.units import M_S_PER_KM_H

T = TypeVar("T")

AskAction = Callable[[str, dict[str, Any]], Any]
"""Function from an action of Valhalla and its request to the answer as a document."""

_HTTP_OK: Final = 200
MAX_EDGES: Final = 200_000
"""A choice that bounds the memory, far above the edges of any road to drive."""
_HEIGHT_EVERY_M: Final = 30.0
"""Distance between the heights along the road [m], as fine as the usual elevation model."""

_LONGEST_VOID_M: Final = 3000.0
_LONGEST_UNKNOWN_END_M: Final = 300.0
"""Longest part of a road without heights, between known heights and at an end [m]. If a part is longer, all heights of the road count as
unknown, and its climb is a variance. Choices."""

_SLOWEST_ALTERNATIVE: Final = 1.6
"""Alternatives that take longer than this many times the fastest road are left out, since they lead over tracks.
A choice."""

AskTile = Callable[[dict[str, Any]], bytes]
"""Function from a request of the action `tile` to the bytes of the answer."""

_NOT_ON_MAP: Final = frozenset({170, 171})
"""Valhalla's error codes for places without a road near them."""

_EDGE_ATTRIBUTES: Final = (
    "shape",
    "edge.length",
    "edge.speed",
    "edge.speed_limit",
    "edge.road_class",
    "edge.begin_shape_index",
    "edge.end_shape_index",
    "edge.tunnel",
    "edge.bridge",
    "edge.use",
    "node.elapsed_time",
    "node.traffic_signal",
)


@dataclass(frozen=True)
class ValhallaRouter:
    """Roads by Valhalla.

    Attributes
    ----------
    ask : callable
        See `AskAction`.
    ask_tile : callable, optional
        See `AskTile`; None if there are no tiles.
    at_once : bool
        Whether `ask` may be called from several threads.
    """

    ask: AskAction
    ask_tile: AskTile | None = None
    at_once: bool = False

    @classmethod
    def from_url(cls, url: str) -> ValhallaRouter:
        """Make a router from the URL of a Valhalla server."""
        return cls.from_client(WebClient(url, "the router", KEY_NAME, "query:api_key"))

    @classmethod
    def from_client(cls, client: WebClient) -> ValhallaRouter:
        """Make a router from a client of a Valhalla server."""

        def tile(request: dict[str, Any]) -> bytes:
            answer = client.request("POST", "/tile", body=request)
            return answer.body if answer.status == _HTTP_OK else b""  # 400 if the map has no roads there

        return cls(lambda action, request: client.post_json(f"/{action}", request), tile, at_once=True)

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """See `Router.roads`. If alternatives are wanted, the shortest is one of them, unless it is the fastest or far slower."""
        require_stops(stops)
        variants: list[dict[str, Any]] = [{}]
        if alternatives:
            variants = [
                {"alternates": min(alternatives, MAX_ROUTES - 2)},
                {"costing_options": {"auto": {"shortest": True}}},
            ]
        trips = self._call_all([partial(self._request_trips, stops, options) for options in variants])
        roads = self._call_all(
            [partial(self._trip_road, trip, stops) for trip in _distinct_trips([*chain.from_iterable(trips)])]
        )
        longest_s = _SLOWEST_ALTERNATIVE * roads[0].duration_s
        return tuple(road for k, road in enumerate(roads) if k == 0 or road.duration_s <= longest_s)

    def outline(self, start: Place, minutes: float) -> tuple[Place, ...]:
        """Return the corners of Valhalla's isochrone, see `Router.outline`."""
        request = {
            "locations": [_location(start)],
            "costing": "auto",
            "contours": [{"time": round(minutes, 2)}],
            "polygons": True,
            "generalize": 100.0,
        }
        answer = self._request("isochrone", request, (start,))
        places = []
        for feature in answer["features"].entries():
            geometry = feature["geometry"]
            rings = geometry["coordinates"].entries(min_count=1)
            is_multiple = geometry["type"].value == "MultiPolygon"
            outer = [polygon.entries(min_count=1)[0] for polygon in rings] if is_multiple else rings[:1]
            places += [Place(*corner) for ring in outer for corner in ring.coordinates()[:, :2].tolist()]
        return tuple(places)

    def tile(self, zoom: int, column: int, row: int) -> bytes:
        """Return a vector tile of the roads (Mapbox Vector Tile 2.1); empty if there are no roads in it, or no tiles at all.

        Features of the layer `edges` have the property `road_class`, from 0 for motorways to 7 for service roads.

        Raises
        ------
        RemoteError
            If the router does not answer.
        """
        return b"" if self.ask_tile is None else self.ask_tile({"tile": {"z": zoom, "x": column, "y": row}})

    def _request_trips(self, stops: Sequence[Place], options: dict[str, Any]) -> list[Node]:
        """Request a route with options; return its trip and those of at most `MAX_ROUTES` alternatives."""
        request = {
            "locations": [_location(place) for place in stops],
            "costing": "auto",
            "directions_type": "none",
            **options,
        }
        answer = self._request("route", request, stops)
        alternates = answer["alternates"]
        entries = answer, *(alternates.entries() if alternates.value else ())[:MAX_ROUTES]
        trips = [entry["trip"] for entry in entries]
        for trip in trips:
            trip.members()
        return trips

    def _trip_road(self, trip: Node, stops: Sequence[Place]) -> Road:
        """Return the road of a trip, after requests for the edges and heights of each leg."""
        legs = []
        with as_remote():
            for leg in trip["legs"].entries(min_count=1):
                shape = leg["shape"].value
                if not isinstance(shape, str):
                    raise InvalidInput.of("no line", leg.where, repr(shape)[:40], "an encoded line")
                points = decode_polyline(shape, leg["shape"].where, precision=1e6)
                calls = [partial(self._edge_document, shape, stops), partial(self._height_document, shape)]
                edge_document, heights = self._call_all(calls)
                edges, covered = _edges(edge_document, shape, points)
                legs.append(Leg(edges, points, _heights(heights, covered)))
        return Road.from_legs(legs, stops)

    def _call_all(self, calls: Sequence[Callable[[], T]]) -> list[T]:
        """Call functions and return their results; requests to a server run at the same time."""
        if not self.at_once or len(calls) == 1:
            return [call() for call in calls]
        with ThreadPoolExecutor(len(calls)) as threads:
            return [future.result() for future in [threads.submit(call) for call in calls]]

    def _edge_document(self, shape: str, stops: Sequence[Place]) -> Node:
        """Request the edges of an encoded line."""
        request = {
            "encoded_polyline": shape,
            "shape_match": "edge_walk",
            "costing": "auto",
            "filters": {"attributes": list(_EDGE_ATTRIBUTES), "action": "include"},
        }
        return self._request("trace_attributes", request, stops)

    def _height_document(self, shape: str) -> Node:
        """Request the heights along an encoded line, one every `_HEIGHT_EVERY_M`."""
        request = {
            "encoded_polyline": shape,
            "shape_format": "polyline6",
            "range": True,
            "resample_distance": _HEIGHT_EVERY_M,
        }
        return Node(self.ask("height", request), "height")

    def _request(self, action: str, request: dict[str, Any], stops: Sequence[Place]) -> Node:
        """Request an action and return the answer.

        Raises
        ------
        InvalidInput
            If a place is outside of the map, or there is no road between the places.
        RemoteError
            If the answer is not valid.
        """
        with as_remote():
            answer = require_object(self.ask(action, request), action)
        if not {"error", "error_code"} & answer.members().keys():
            return answer
        code, got = answer["error_code"].value, str(answer["error"].value)[:120]
        if isinstance(code, int) and code in _NOT_ON_MAP:
            title = " to ".join(place.title for place in stops)
            raise InvalidInput.of("place outside of the map", title, got, "places near a road of the map")
        raise no_road(stops, got)


def _edges(answer: Node, shape: str, points: FloatArray) -> tuple[Edges, FloatArray]:
    """Return the edges of a line, and the ranges of distance [m] in tunnels or on bridges, shape (ranges, 2)."""
    entries = answer["edges"].entries(min_count=1)
    if len(entries) > MAX_EDGES:
        raise InvalidInput.of("too many edges", "trace_attributes", f"{len(entries)}", f"at most {MAX_EDGES}")
    returned_shape = answer["shape"].value
    # for a short leg on one edge, Valhalla may return no part of the edge
    within_edge = entries[-1]["end_shape_index"].value == 0
    # the line of the answer may have a point more than that of the route
    if isinstance(returned_shape, str) and returned_shape != shape and not within_edge:
        points = decode_polyline(returned_shape, answer["shape"].where, precision=1e6)
    begin = _point_indices([entry["begin_shape_index"] for entry in entries], len(points))
    end = _point_indices([entry["end_shape_index"] for entry in entries], len(points))
    if within_edge:
        end = np.array([len(points) - 1])
    if (np.diff(begin) < 0).any() or (end < begin).any() or (begin[1:] != end[:-1]).any():
        raise InvalidInput.of("edges out of order", answer["edges"].where, "", "indices that rise")
    nodes = [Node(entry.members().get("end_node", {}), f"{entry.where}, end_node") for entry in entries]
    elapsed = np.array([node["elapsed_time"].number(minimum=0.0) for node in nodes])
    if (np.diff(elapsed) < 0).any():
        raise InvalidInput.of("time decreases", "trace_attributes, elapsed_time", "", "times that rise")
    boundary_m = distances_m(points)[np.append(begin, end[-1])]
    speed = np.array([M_S_PER_KM_H * entry["speed"].number(minimum=1.0) for entry in entries])
    if within_edge:
        elapsed = np.diff(boundary_m) / speed
    off_ground = [entry["tunnel"].value is True or entry["bridge"].value is True for entry in entries]
    edges = Edges(
        np.diff(boundary_m),
        np.diff(elapsed, prepend=0.0),
        speed,
        np.array([_speed_limit(entry["speed_limit"]) for entry in entries]),
        tuple(str(entry.members().get("road_class", "")) for entry in entries),
        np.array([node["traffic_signal"].value is True for node in nodes]),
        np.array([entry["use"].value in CARRIED for entry in entries]),
    )
    return edges, np.column_stack((boundary_m[:-1], boundary_m[1:]))[off_ground]


def _heights(answer: Node, covered: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return distances and heights, or None if the heights of all or of a long part of the road are unknown.

    Heights inside the ranges `covered` (tunnels and bridges) are left out, so that the road is straight there.
    """
    pairs = answer["range_height"]
    values = pairs.value if isinstance(pairs.value, list) else []
    table = _height_table([pair for pair in values if isinstance(pair, list) and len(pair) == 2], pairs.where)
    position, known = table[:, 0], np.flatnonzero(np.isfinite(table[:, 1]))
    if len(known) < 2:
        return None
    unknown_ends = max(position[known[0]] - position[0], position[-1] - position[known[-1]])
    voids = np.diff(position[known])[np.diff(known) > 1]
    if unknown_ends > _LONGEST_UNKNOWN_END_M or voids.max(initial=0.0) > _LONGEST_VOID_M:
        return None
    table = table[known]
    on_ground = np.ones(len(table), dtype=bool)
    for start, end in covered:
        on_ground &= ~((table[:, 0] > start) & (table[:, 0] < end))
    kept = table[on_ground] if on_ground.sum() >= 2 else table
    return kept[:, 0], kept[:, 1]


def _height_table(pairs: Sequence[list[Any]], where: str) -> FloatArray:
    """Return distance and height of each pair, shape (pairs, 2); an unknown height is NaN."""
    values = Node([value for pair in pairs for value in pair if value is not None], where)
    only_numbers = {type(value) for value in values.value} <= {int, float}
    with as_remote():
        if not only_numbers or not all(-1e12 < value < 1e12 for value in values.value):
            values.numbers()  # raises the fault
        return np.array(pairs, dtype=np.float64).reshape(-1, 2)  # None becomes NaN


def _speed_limit(limit: Node) -> float:
    """Return a speed limit [m/s], or NaN if there is none; Valhalla then writes "unlimited", or nothing."""
    if limit.value is None or isinstance(limit.value, str):
        return math.nan
    speed = M_S_PER_KM_H * limit.number(minimum=0.0)
    return speed if 0.0 < speed < 60.0 else math.nan  # faster limits are errors of the map


def _point_indices(nodes: Sequence[Node], n_points: int) -> IntArray:
    values = np.array([node.number(minimum=0.0) for node in nodes])
    if (values != np.floor(values)).any() or values.max() >= n_points:
        where, got = nodes[0].where, f"{values.max():g}"
        raise InvalidInput.of("point index out of range", where, got, f"0 to {n_points - 1}")
    return values.astype(np.int64)


def _location(place: Place) -> dict[str, Any]:
    return {"lat": place.latitude_deg, "lon": place.longitude_deg}


def _distinct_trips(trips: Sequence[Node]) -> list[Node]:
    """Return the trips whose lines differ, in their order."""
    by_line: dict[str, Node] = {}
    for trip in trips:
        legs = trip["legs"].value
        is_list = isinstance(legs, list)
        shapes = [leg.get("shape") for leg in legs if isinstance(leg, dict)] if is_list else legs
        by_line.setdefault(str(shapes), trip)
    return list(by_line.values())
