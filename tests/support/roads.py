"""Servers that answer as they are told, and answers of routers written after their public formats."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from typing import Any

import httpx

from tripwatt.routes.web import WebClient

START, MIDDLE, END = (47.0, 9.0), (47.0, 9.05), (47.0, 9.10)
"""Latitude and longitude of a straight road to the east: 7.583 km on the sphere in two equal parts."""


def client(answer: Callable[[httpx.Request], httpx.Response] | Any, **more: Any) -> WebClient:
    """A client whose server gives an answer: a document, or what a function makes of the request."""
    handler = answer if callable(answer) else lambda request: httpx.Response(200, json=answer)
    return WebClient(
        "http://router.test/base", transport=httpx.MockTransport(handler), pause=lambda s: None, **more
    )


def body_of(request: httpx.Request) -> Any:
    """The JSON document of a request."""
    return json.loads(request.content)


def encoded(points: list[tuple[float, float]]) -> str:
    """Points as an encoded polyline with six decimals (Google's algorithm)."""
    text, last = "", (0, 0)
    for point in points:
        now = (round(point[0] * 1e6), round(point[1] * 1e6))
        for step in (now[0] - last[0], now[1] - last[1]):
            value = ~(step << 1) if step < 0 else step << 1
            while value >= 0x20:
                text += chr((0x20 | (value & 0x1F)) + 63)
                value >>= 5
            text += chr(value + 63)
        last = now
    return text


VALHALLA_EDGES = [
    {"length": 3.792, "speed": 50, "speed_limit": 50, "road_class": "secondary", "begin_shape_index": 0,
     "end_shape_index": 1, "tunnel": False, "bridge": False, "end_node": {"elapsed_time": 283.0, "traffic_signal": True}},
    {"length": 3.792, "speed": 100, "speed_limit": "unlimited", "road_class": "motorway", "begin_shape_index": 1,
     "end_shape_index": 2, "tunnel": True, "bridge": False, "end_node": {"elapsed_time": 420.0, "traffic_signal": False}},
]  # fmt: skip


def valhalla_answers(**changed: Any) -> dict[str, Any]:
    """The answers of Valhalla for the straight road, by action; a keyword replaces one."""
    return {
        "route": {"trip": {"status": 0, "legs": [{"shape": encoded([START, MIDDLE, END])}]}},
        "trace_attributes": {"edges": VALHALLA_EDGES},
        "height": {"range_height": [[0, 500.0], [3700, 537.0], [5000, 900.0], [7590, 575.8]]},
        "isochrone": {
            "features": [
                {"geometry": {"type": "Polygon", "coordinates": [[[9.1, 47.0], [9.0, 47.1], [8.9, 47.0]]]}}
            ]
        },
    } | changed


def valhalla(**changed: Any) -> Callable[[httpx.Request], httpx.Response]:
    """A Valhalla server for the straight road; a keyword replaces the answer of an action."""
    answers = valhalla_answers(**changed)

    def answer(request: httpx.Request) -> httpx.Response:
        found = answers[request.url.path.rpartition("/")[2]]
        return httpx.Response(400 if "error" in found else 200, json=found)

    return answer


def osrm(*, annotated: bool, turn_s: float = 4.0) -> dict[str, Any]:
    """An answer of OSRM: a road of 3.792 km at 50 km/h in edges of 79 m, a turn, and as much at 100 km/h."""
    n, length = 48, 79.0
    speeds = [50.0 / 3.6] * n + [100.0 / 3.6] * n
    seconds = [round(length / speed, 1) for speed in speeds]
    longitudes = [9.0 + 0.1 * k / (2 * n) for k in range(2 * n + 1)]
    leg: dict[str, Any] = {"distance": 2 * n * length, "duration": round(sum(seconds) + turn_s, 1)}
    if annotated:
        leg["annotation"] = {
            "distance": [length] * (2 * n),
            "duration": seconds,
            "speed": [round(speed, 1) for speed in speeds],
        }
    halves = [seconds[:n], seconds[n:]]
    leg["steps"] = [{"distance": n * length, "duration": sum(half)} for half in halves]
    leg["steps"][0]["duration"] += turn_s
    leg["steps"].append({"distance": 0.0, "duration": 0.0})
    route = {
        "legs": [leg],
        "distance": leg["distance"],
        "duration": leg["duration"],
        "geometry": {"type": "LineString", "coordinates": [[lon, 47.0] for lon in longitudes]},
    }
    return {"code": "Ok", "routes": [route]}


def graphhopper() -> dict[str, Any]:
    """An answer of GraphHopper for the straight road, with heights."""
    points = [[9.0, 47.0, 500.0], [9.05, 47.0, 520.0], [9.1, 47.0, 510.0]]
    details = {
        "time": [[0, 1, 283_000], [1, 2, 137_000]],
        "average_speed": [[0, 1, 50.0], [1, 2, 100.0]],
        "max_speed": [[0, 1, 50.0], [1, 2, None]],
        "road_class": [[0, 1, "secondary"], [1, 2, "motorway"]],
    }
    path = {
        "distance": 7584.0,
        "time": 420_000,
        "points": {"type": "LineString", "coordinates": points},
        "details": details,
    }
    return {"paths": [path]}


def openrouteservice() -> dict[str, Any]:
    """An answer of openrouteservice for the straight road, with heights."""
    steps = [{"distance": 3792.0, "duration": 283.0}, {"distance": 3792.0, "duration": 137.0}]
    return {
        "features": [
            {
                "geometry": {"coordinates": [[9.0, 47.0, 500.0], [9.05, 47.0, 520.0], [9.1, 47.0, 510.0]]},
                "properties": {"segments": [{"distance": 7584.0, "duration": 420.0, "steps": steps}]},
            }
        ]
    }


def mutated(document: Any, count: int, seed: int) -> list[Any]:
    """Copies of a document, each with one value replaced by another that a broken or lying server may give."""
    import random

    rng = random.Random(seed)
    bad = [None, -1.0, 0, 1e300, "x", [], {}, True, [[]], -5, 1e9, {"a": 1}, ""]
    places = list(_places(document))
    copies = []
    for k in range(count):
        copy = json.loads(json.dumps(document))
        for path in rng.sample(places, min(1 + k % 2, len(places))):
            _replace(copy, path, json.loads(json.dumps(rng.choice(bad))), rng)
        copies.append(copy)
    return copies


def _places(value: Any, path: tuple[Any, ...] = ()) -> Any:
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in itertools.islice(inside, 6):
        yield (*path, key)
        yield from _places(entry, (*path, key))


def _replace(document: Any, path: tuple[Any, ...], value: Any, rng: Any) -> None:
    for key in path[:-1]:
        if not isinstance(document, dict | list) or (isinstance(document, dict) and key not in document):
            return
        if isinstance(document, list) and (not isinstance(key, int) or key >= len(document)):
            return
        document = document[key]
    if isinstance(document, dict):
        if rng.random() < 0.2:
            document.pop(path[-1], None)
        else:
            document[path[-1]] = value
    elif isinstance(document, list) and isinstance(path[-1], int) and path[-1] < len(document):
        document[path[-1]] = value
