"""Valhalla as a router: a server by URL, or the library in this process.

Requests and answers follow Valhalla's public API (`route`, `trace_attributes`, `height`, `isochrone`). A road's edges,
with their speeds, classes and signals, come from `trace_attributes` on the line of the route.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any, Final, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.routes.places import Place
from tripwatt.routes.points import a_list, a_number, an_object, haversine_m
from tripwatt.routes.polyline import decode_polyline
from tripwatt.routes.routers.road import MOST_ROUTES, Edges, Road, RoadParts, require_stops
from tripwatt.routes.web import WebClient
from tripwatt.units import M_S_PER_KM_H

Found = TypeVar("Found")

Ask = Callable[[str, dict[str, Any]], Any]
"""Takes an action of Valhalla and its request, gives the answer as a document."""

HTTP_OK: Final = 200
MOST_EDGES: Final = 200_000
HEIGHT_EVERY_M: Final = 30.0
"""Distance of the heights along the road [m], as fine as the usual elevation model."""

SLOWEST_ALTERNATIVE: Final = 1.6
"""Alternatives that take this many times as long as the fastest road lead over tracks that nobody means."""

AskTile = Callable[[dict[str, Any]], bytes]
"""As `Ask` for the action `tile`, whose answer is no document."""

NOT_ON_MAP: Final = frozenset({170, 171})
"""Valhalla's error codes for places without a road near them."""

EDGE_VALUES: Final = (
    "shape",
    "edge.length",
    "edge.speed",
    "edge.speed_limit",
    "edge.road_class",
    "edge.begin_shape_index",
    "edge.end_shape_index",
    "edge.tunnel",
    "edge.bridge",
    "node.elapsed_time",
    "node.traffic_signal",
)


@dataclass(frozen=True)
class ValhallaRouter:
    """Roads by Valhalla.

    Attributes
    ----------
    ask : callable
        See `Ask`.
    name : str
        As messages call it.
    ask_tile : callable, optional
        See `AskTile`; None where there are no tiles.
    at_once : bool
        Whether `ask` may be called from several threads.
    """

    ask: Ask
    name: str = "valhalla"
    ask_tile: AskTile | None = None
    at_once: bool = False

    @classmethod
    def from_url(cls, url: str) -> ValhallaRouter:
        """A Valhalla server."""
        return cls.from_client(WebClient(url, "the router", "TRIPWATT_ROUTER_KEY", "query:api_key"))

    @classmethod
    def from_client(cls, client: WebClient) -> ValhallaRouter:
        """As `from_url`, by what sends the requests."""

        def tile(request: dict[str, Any]) -> bytes:
            answer = client.request("POST", "/tile", body=request)
            return answer.body if answer.status == HTTP_OK else b""  # 400 where the map has no roads

        return cls(
            lambda action, request: client.post_json(f"/{action}", request),
            f"valhalla at {client.host}",
            tile,
            at_once=True,
        )

    def roads(self, stops: Sequence[Place], *, alternatives: int = 0) -> tuple[Road, ...]:
        """See `Router.roads`. The shortest road is one of the alternatives where it differs from the fastest."""
        require_stops(stops)
        asked: list[dict[str, Any]] = [{}]
        if alternatives:
            asked = [
                {"alternates": min(alternatives, MOST_ROUTES - 2)},
                {"costing_options": {"auto": {"shortest": True}}},
            ]
        trips = self._together([partial(self._trips, stops, more) for more in asked])
        roads = self._together(
            [partial(self._road, trip, stops) for trip in _different([*chain.from_iterable(trips)])]
        )
        longest_s = SLOWEST_ALTERNATIVE * roads[0].duration_s
        return tuple(road for k, road in enumerate(roads) if k == 0 or road.duration_s <= longest_s)

    def outline(self, start: Place, minutes: float) -> tuple[Place, ...]:
        """See `Router.outline`: the corners of Valhalla's isochrone."""
        request = {
            "locations": [_location(start)],
            "costing": "auto",
            "contours": [{"time": round(minutes, 2)}],
            "polygons": True,
            "generalize": 100.0,
        }
        answer = self._answer("isochrone", request, (start,))
        places = []
        for k, entry in enumerate(a_list(answer.get("features"), "isochrone, features")):
            geometry = an_object(
                an_object(entry, f"features[{k}]").get("geometry"), f"features[{k}], geometry"
            )
            polygons = geometry.get("coordinates")
            rings = a_list(polygons, "coordinates", least=1)
            if geometry.get("type") == "MultiPolygon":
                rings = [a_list(polygon, "coordinates", least=1)[0] for polygon in rings]
            else:
                rings = rings[:1]
            for ring in rings:
                for corner in a_list(ring, "coordinates"):
                    pair = a_list(corner, "coordinates", least=2)
                    places.append(Place(a_number(pair[1], "coordinates"), a_number(pair[0], "coordinates")))
        return tuple(places)

    def tile(self, zoom: int, column: int, row: int) -> bytes:
        """A vector tile of the roads (Mapbox Vector Tile 2.1); empty where there are none, or no tiles at all.

        Its layer `edges` has the property `road_class`, from 0 for motorways to 7 for service roads.

        Raises
        ------
        RemoteError
            When the router does not answer.
        """
        if self.ask_tile is None:
            return b""
        return self.ask_tile({"tile": {"z": zoom, "x": column, "y": row}})

    def _trips(self, stops: Sequence[Place], more: dict[str, Any]) -> list[dict[str, Any]]:
        request = {
            "locations": [_location(place) for place in stops],
            "costing": "auto",
            "directions_type": "none",
            **more,
        }
        answer = self._answer("route", request, stops)
        others = answer.get("alternates") or []
        found = [answer, *a_list(others, "route, alternates")[:MOST_ROUTES]]
        return [an_object(an_object(entry, "route").get("trip"), "route, trip") for entry in found]

    def _road(self, trip: dict[str, Any], stops: Sequence[Place]) -> Road:
        parts = RoadParts()
        try:
            for k, entry in enumerate(a_list(trip.get("legs"), "route, legs", least=1)):
                leg = an_object(entry, f"route, legs[{k}]")
                shape = leg.get("shape")
                if not isinstance(shape, str):
                    raise InvalidInput.of("no line", f"route, legs[{k}]", repr(shape)[:40], "an encoded line")
                points = decode_polyline(shape, f"route, legs[{k}], shape", precision=1e6)
                asked = [partial(self._edge_document, shape, stops), partial(self._height_document, shape)]
                edge_document, heights = self._together(asked)
                edges, covered = _edges(edge_document, shape, points)
                parts.add(edges, points, _heights(heights, covered))
        except RemoteError:
            raise
        except InvalidInput as error:
            raise RemoteError(error.faults) from error
        return parts.road(stops, self.name)

    def _together(self, calls: Sequence[Callable[[], Found]]) -> list[Found]:
        """What each call gives; a server answers them side by side."""
        if not self.at_once or len(calls) == 1:
            return [call() for call in calls]
        with ThreadPoolExecutor(len(calls)) as threads:
            return [found.result() for found in [threads.submit(call) for call in calls]]

    def _edge_document(self, shape: str, stops: Sequence[Place]) -> dict[str, Any]:
        request = {
            "encoded_polyline": shape,
            "shape_match": "edge_walk",
            "costing": "auto",
            "filters": {"attributes": list(EDGE_VALUES), "action": "include"},
        }
        return self._answer("trace_attributes", request, stops)

    def _height_document(self, shape: str) -> dict[str, Any]:
        request = {
            "encoded_polyline": shape,
            "shape_format": "polyline6",
            "range": True,
            "resample_distance": HEIGHT_EVERY_M,
        }
        return an_object(self.ask("height", request), "height")

    def _answer(self, action: str, request: dict[str, Any], stops: Sequence[Place]) -> dict[str, Any]:
        """The answer of an action.

        Raises
        ------
        InvalidInput
            When there is no road between the places.
        RemoteError
            When the answer is none.
        """
        try:
            answer = an_object(self.ask(action, request), action)
        except RemoteError:
            raise
        except InvalidInput as error:
            raise RemoteError(error.faults) from error
        if "error" not in answer and "error_code" not in answer:
            return answer
        code, got = answer.get("error_code"), str(answer.get("error"))[:120]
        title = " to ".join(place.title for place in stops)
        if isinstance(code, int) and code in NOT_ON_MAP:
            raise InvalidInput.of("place outside of the map", title, got, "places near a road of the map")
        raise InvalidInput.of("no road found", title, got, "places that a road connects")


def _edges(answer: dict[str, Any], shape: str, points: FloatArray) -> tuple[Edges, FloatArray]:
    """Edges of a line, and the ranges of distance [m] under a roof or on a bridge, shape (ranges, 2)."""
    entries = a_list(answer.get("edges"), "trace_attributes, edges", least=1)
    if len(entries) > MOST_EDGES:
        raise InvalidInput.of(
            "too many edges", "trace_attributes", f"{len(entries)}", f"at most {MOST_EDGES}"
        )
    own = answer.get("shape")
    if isinstance(own, str) and own != shape:  # its line may have a point more than that of the route
        points = decode_polyline(own, "trace_attributes, shape", precision=1e6)
    table = _EdgeTable.from_entries(entries, len(points))
    driven = np.concatenate(([0.0], np.cumsum(haversine_m(points[:, 0], points[:, 1]))))
    border = np.append(driven[table.begin], driven[table.end[-1]])
    length = np.diff(border)
    off = table.covered
    ranges = np.column_stack((border[:-1][off], border[1:][off]))
    time = np.diff(table.elapsed_s, prepend=0.0)
    kinds = tuple(table.road_class)
    return Edges(length, time, table.speed_m_s, table.limit_m_s, kinds, table.signal), ranges


def _heights(answer: dict[str, Any], covered: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Distances and heights; None without an elevation model. Tunnels and bridges are straight."""
    pairs = answer.get("range_height")
    if not isinstance(pairs, list) or not pairs:
        return None
    known = [pair for pair in pairs if isinstance(pair, list) and len(pair) == 2 and pair[1] is not None]
    if len(known) < 2:
        return None
    table = np.array([[a_number(v, "height, range_height") for v in pair] for pair in known])
    on_ground = np.ones(len(table), dtype=bool)
    for start, end in covered:
        on_ground &= ~((table[:, 0] > start) & (table[:, 0] < end))
    kept = table[on_ground] if on_ground.sum() >= 2 else table
    return kept[:, 0], kept[:, 1]


@dataclass(frozen=True, eq=False, slots=True)
class _EdgeTable:
    begin: Any
    end: Any
    elapsed_s: FloatArray
    speed_m_s: FloatArray
    limit_m_s: FloatArray
    road_class: list[str]
    signal: Any
    covered: Any

    @classmethod
    def from_entries(cls, entries: list[Any], n_points: int) -> _EdgeTable:
        rows = [an_object(entry, f"edges[{k}]") for k, entry in enumerate(entries)]
        nodes = [an_object(row.get("end_node", {}), f"edges[{k}], end_node") for k, row in enumerate(rows)]
        begin = _indices(rows, "begin_shape_index", n_points)
        end = _indices(rows, "end_shape_index", n_points)
        if (np.diff(begin) < 0).any() or (end < begin).any() or (begin[1:] != end[:-1]).any():
            raise InvalidInput.of("edges out of order", "trace_attributes, edges", "", "indices that rise")
        elapsed = np.array(
            [a_number(n.get("elapsed_time"), f"edges[{k}]", least=0.0) for k, n in enumerate(nodes)]
        )
        if (np.diff(elapsed) < 0).any():
            raise InvalidInput.of("time decreases", "trace_attributes, elapsed_time", "", "times that rise")
        limits = [row.get("speed_limit") for row in rows]
        return cls(
            begin,
            end,
            elapsed,
            np.array(
                [
                    M_S_PER_KM_H * a_number(r.get("speed"), f"edges[{k}], speed", least=1.0)
                    for k, r in enumerate(rows)
                ]
            ),
            np.array([_limit(value, f"edges[{k}], speed_limit") for k, value in enumerate(limits)]),
            [str(row.get("road_class", "")) for row in rows],
            np.array([node.get("traffic_signal") is True for node in nodes]),
            np.array([row.get("tunnel") is True or row.get("bridge") is True for row in rows]),
        )


def _limit(value: Any, where: str) -> float:
    """A speed limit [m/s], NaN where there is none: Valhalla writes "unlimited", or nothing."""
    if value is None or isinstance(value, str):
        return float("nan")
    found = M_S_PER_KM_H * a_number(value, where, least=0.0)
    return found if 0.0 < found < 60.0 else float("nan")


def _indices(rows: list[dict[str, Any]], key: str, n_points: int) -> Any:
    values = np.array([a_number(row.get(key), f"edges[{k}], {key}", least=0.0) for k, row in enumerate(rows)])
    if (values != np.floor(values)).any() or values.max() >= n_points:
        raise InvalidInput.of("point index out of range", key, f"{values.max():g}", f"0 to {n_points - 1}")
    return values.astype(np.int64)


def _location(place: Place) -> dict[str, Any]:
    return {"lat": place.latitude_deg, "lon": place.longitude_deg}


def _different(trips: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Trips whose lines differ, in their order."""
    seen, kept = set(), []
    for trip in trips:
        legs = trip.get("legs")
        shapes = str(
            [leg.get("shape") for leg in legs if isinstance(leg, dict)] if isinstance(legs, list) else legs
        )
        if shapes not in seen:
            seen.add(shapes)
            kept.append(trip)
    return kept
