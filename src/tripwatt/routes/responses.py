"""Saved responses of routers (OSRM, Valhalla, openrouteservice, GraphHopper) as links.

Each reader follows the public documentation of one router's JSON; `docs/reference/routes.md` names the pages. All readers
take the first route. The times of a router include the traffic lights and turns that it counts, so they are travel times
with standstill.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, excerpt, raise_faults
from tripwatt.files import file_head
from tripwatt.routes.answers import annotated, intervals, lengths_and_times, speeds_at_points, steps_of
from tripwatt.routes.documents import Node, content, parse_json
from tripwatt.routes.geojson import track_from_geojson
from tripwatt.routes.gpx import read_gpx
from tripwatt.routes.kml import read_kml
from tripwatt.routes.link_objects import LINK_KEYS, route_from_links
from tripwatt.routes.link_table import is_links_table, route_from_table
from tripwatt.routes.links import FLAT_ROAD, SHORTEST_LINK_M, LinkRoute, first_of
from tripwatt.routes.points import distances_m, haversine_m
from tripwatt.routes.polyline import decode_polyline
from tripwatt.routes.tracks import Track
from tripwatt.routes.xml_events import root_of
from tripwatt.trips import Flag
from tripwatt.units import M_PER_FOOT, M_PER_MILE

ORS_UNITS_M: Final[Mapping[str, float]] = {"m": 1.0, "km": 1000.0, "mi": M_PER_MILE}
"""Units of length in which openrouteservice answers."""
ZIP: Final = b"PK\x03\x04"
"""First bytes of a ZIP archive."""

ROUTE_SUFFIXES: Final = (".gpx", ".kml", ".kmz", ".json", ".geojson")


@dataclass(slots=True)
class Pieces:
    """Collector of the pieces of a route; a piece without a length or a time is added to the next one."""

    length_m: list[float] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)
    moving_m_s: list[float] = field(default_factory=list)
    left_m: float = 0.0
    left_s: float = 0.0

    def add(self, length_m: float, time_s: float, moving_m_s: float = math.nan) -> None:
        """Add a piece; `moving_m_s` is the speed on it while nothing stands in the way, NaN = not known."""
        length, time = length_m + self.left_m, time_s + self.left_s
        if length >= SHORTEST_LINK_M and time > 0:
            self.length_m.append(length)
            self.time_s.append(time)
            self.moving_m_s.append(moving_m_s)
            length = time = 0.0
        self.left_m, self.left_s = length, time

    def route(self, where: str, heights: tuple[FloatArray, FloatArray] | None, *flags: Flag) -> LinkRoute:
        """The pieces as links. `heights` are distances and heights; the distances are scaled to the length of the links.

        Raises
        ------
        InvalidInput
            When no piece has a length and a time.
        """
        if not self.length_m:
            got, allowed = "no step with a length and a duration", "a route with steps"
            raise InvalidInput.of("no route", where, got, allowed)
        self.length_m[-1] += self.left_m
        self.time_s[-1] += self.left_s
        length = np.array(self.length_m)
        position, height = heights if heights is not None else (None, None)
        if position is not None and position[-1] > 0:
            position = position * (float(length.sum()) / position[-1])
        assumed = flags if heights is not None else (*flags, FLAT_ROAD)
        unknown = np.full(len(length), np.nan)
        moving = np.array(self.moving_m_s)
        return LinkRoute(length, np.array(self.time_s), unknown, moving, position, height, assumed)


def heights_of(points: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Distances and heights of points (latitude, longitude, height); None if no point has a height or the line has no length.

    Examples
    --------
    >>> heights_of(np.array([[0.0, 0.0, 5.0], [0.0, 1.0, np.nan]]))[1]
    array([5., 5.])
    """
    if points.shape[1] < 3 or not np.isfinite(points[:, 2]).any():
        return None
    position, known = distances_m(points), np.isfinite(points[:, 2])
    if not position[-1] > 0:
        return None
    # all positions are kept, also of points without a height, so that the last one is the whole length
    return position, np.interp(position, position[known], points[known, 2])


def _first(routes: Node) -> tuple[Node, tuple[Flag, ...]]:
    entries = routes.entries(least=1)
    return entries[0], () if len(entries) == 1 else (first_of("routes", len(entries)),)


def _no_route(where: str, got: str, allowed: str) -> InvalidInput:
    return InvalidInput.of("the router found no route", where, got, allowed)


def route_from_osrm(response: Mapping[str, Any], where: str = "OSRM response") -> LinkRoute:
    """Links of an OSRM route response: one for each annotated edge, else for each step, else for each leg.

    An annotation gives the speed between two nodes of the map without turns and lights. If the leg takes longer than all its
    edges, their times are scaled to its duration, and the annotated speed is the moving speed.

    Raises
    ------
    InvalidInput
        When the response is not valid, or OSRM found no route.
    """
    if response.get("code", "Ok") != "Ok":
        raise _no_route(where, excerpt(response.get("code")), "code Ok")
    route, flags = _first(Node(response, where)["routes"])
    pieces = Pieces()
    for leg in route["legs"].entries(least=1):
        leg["duration"].number(least=0.0)
        annotation = leg["annotation"].value
        known = isinstance(annotation, dict) and annotation.get("duration") and annotation.get("distance")
        for piece in annotated(leg) if known else lengths_and_times(steps_of(leg)):
            pieces.add(*piece.tolist())
    return pieces.route(where, None, *flags)


def route_from_valhalla(response: Mapping[str, Any], where: str = "Valhalla response") -> LinkRoute:
    """Links of a Valhalla trip: one for each manoeuvre, with the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When the response is not valid, or Valhalla found no route.
    """
    trip = Node(response, where)["trip"]
    if trip.members().get("status", 0) != 0:
        raise _no_route(where, excerpt(trip["status_message"].value, 80), "status 0")
    units = trip.members().get("units", "kilometers")
    if units not in ("kilometers", "miles"):
        raise InvalidInput.of("unknown unit", f"{where}, units", excerpt(units, 40), "kilometers or miles")
    metres, height_unit = (1000.0, 1.0) if units == "kilometers" else (M_PER_MILE, M_PER_FOOT)
    pieces, places, heights, driven, complete = Pieces(), [], [], 0.0, True
    for leg in trip["legs"].entries(least=1):
        length = 0.0
        for manoeuvre in leg["maneuvers"].entries(least=1):
            piece = metres * manoeuvre["length"].number(least=0.0)
            pieces.add(piece, manoeuvre["time"].number(least=0.0))
            length += piece
        if leg["elevation"].value:
            height = height_unit * leg["elevation"].numbers()
            # the last interval differs a little from the others: the heights are spread evenly over the leg
            places.append(driven + np.linspace(0.0, length, len(height)))
            heights.append(height)
        else:
            complete = False
        driven += length
    known = (np.concatenate(places), np.concatenate(heights)) if complete and places else None
    return pieces.route(where, known)


def route_from_openrouteservice(
    response: Mapping[str, Any], where: str = "openrouteservice response"
) -> LinkRoute:
    """Links of an openrouteservice response in JSON or GeoJSON: one for each step, with the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When the response is not valid, or is an error message.
    """
    if "error" in response:
        raise _no_route(where, excerpt(response["error"], 120), "routes")
    heights = None
    answer = Node(response, where)
    metres = _openrouteservice_unit(response, where)
    if "features" in response:
        feature, flags = _first(answer["features"])
        route = feature["properties"]
        heights = heights_of(feature["geometry"]["coordinates"].coordinates())
    else:
        route, flags = _first(answer["routes"])
        summary, line = route["summary"].value, route["geometry"]
        three = isinstance(summary, dict) and ("ascent" in summary or "descent" in summary)
        if three and isinstance(line.value, str):
            heights = heights_of(decode_polyline(line.value, line.where, dimensions=3))
    pieces = Pieces()
    for segment in route["segments"].entries(least=1):
        for length, time in lengths_and_times(steps_of(segment)).tolist():
            pieces.add(metres * length, time)
    return pieces.route(where, heights, *flags)


def _openrouteservice_unit(response: Mapping[str, Any], where: str) -> float:
    """Metres per unit of length in the response: the unit that the response repeats from the request, by default the metre."""
    metadata = response.get("metadata")
    query = metadata.get("query") if isinstance(metadata, dict) else None
    units = query.get("units", "m") if isinstance(query, dict) else "m"
    if not isinstance(units, str) or units.lower() not in ORS_UNITS_M:
        place = f"{where}, metadata, query, units"
        raise InvalidInput.of("unknown unit", place, excerpt(units, 40), ", ".join(ORS_UNITS_M))
    return ORS_UNITS_M[units.lower()]


def route_from_graphhopper(response: Mapping[str, Any], where: str = "GraphHopper response") -> LinkRoute:
    """Links of a GraphHopper response: one for each entry of the path detail `time`, else for each instruction.

    They have the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When the response is not valid, or is an error message.
    """
    if "paths" not in response and "message" in response:
        raise _no_route(where, excerpt(response["message"], 120), "paths")
    path, flags = _first(Node(response, where)["paths"])
    points = _graphhopper_points(path)
    details = path["details"] if isinstance(path["details"].value, dict) else Node({}, where)
    pieces = Pieces()
    if points is not None and details["time"].value:
        length = path["distance"]
        position = distances_m(points, None if length.value is None else length.number(least=0.0))
        moving = speeds_at_points(details["average_speed"], len(points))
        for start, end, milliseconds in intervals(details["time"], len(points)):
            seconds = 0.0 if milliseconds.value is None else milliseconds.number(least=0.0) / 1000.0
            pieces.add(float(position[end] - position[start]), seconds, float(moving[start]))
    else:
        for metres, time in lengths_and_times(steps_of(path, "instructions"), "time").tolist():
            pieces.add(metres, 1e-3 * time)
    return pieces.route(where, None if points is None else heights_of(points), *flags)


def _graphhopper_points(path: Node) -> FloatArray | None:
    points = path["points"]
    if points.value is None:
        return None
    if not isinstance(points.value, str):
        return points["coordinates"].coordinates()
    multiplier = path["points_encoded_multiplier"]
    precision = 1e5 if multiplier.value is None else multiplier.number(least=1.0)
    return _graphhopper_polyline(points.value, path, precision, points.where)


def _graphhopper_polyline(text: str, path: Node, precision: float, where: str) -> FloatArray:
    """Points of an encoded polyline with or without heights; the decoding that fits the length of the path is returned."""
    lines: dict[int, FloatArray] = {}
    faults: tuple[Fault, ...] = ()
    for dimensions in (2, 3):
        try:
            lines[dimensions] = decode_polyline(text, where, precision=precision, dimensions=dimensions)
        except InvalidInput as error:
            faults = faults or error.faults
    if len(lines) < 2:
        raise_faults(() if lines else faults)
        return next(iter(lines.values()))
    if path["distance"].value is None:
        # older versions give six numbers with elevation, newer ones always four
        box = path["bbox"].value
        return lines[3 if isinstance(box, list) and len(box) == 6 else 2]
    driven = path["distance"].number(least=0.0)
    return min(
        lines.values(), key=lambda line: abs(float(haversine_m(line[:, 0], line[:, 1]).sum()) - driven)
    )


ROUTERS: Final[Mapping[str, Callable[[Mapping[str, Any], str], LinkRoute]]] = {
    "osrm": route_from_osrm,
    "valhalla": route_from_valhalla,
    "openrouteservice": route_from_openrouteservice,
    "graphhopper": route_from_graphhopper,
}
"""Reader of each router's response."""


def router_of(response: Mapping[str, Any]) -> str | None:
    """The name in `ROUTERS` of the router whose response this looks like; None if it looks like none.

    Examples
    --------
    >>> router_of({"code": "Ok", "routes": []}), router_of({"paths": []}), router_of({"type": "LineString"})
    ('osrm', 'graphhopper', None)
    """
    if "trip" in response:
        return "valhalla"
    if "paths" in response:
        return "graphhopper"
    features = response.get("features")
    if isinstance(features, list) and features and isinstance(features[0], dict):
        properties = features[0].get("properties")
        return "openrouteservice" if isinstance(properties, dict) and "segments" in properties else None
    if "code" in response:
        return "osrm"
    routes = response.get("routes")
    if isinstance(routes, list) and routes and isinstance(routes[0], dict):
        return "osrm" if "legs" in routes[0] else "openrouteservice"
    return "openrouteservice" if "error" in response else None


def read_response(
    source: bytes | str | Path, router: str | None = None, *, where: str | None = None
) -> LinkRoute:
    """Read the links of a router's saved response. O(bytes).

    Parameters
    ----------
    source : bytes, str or path
        The JSON text itself as bytes, or the path of a file.
    router : str, optional
        One of `ROUTERS`; recognised from the response when not given.
    where : str, optional
        Name for messages.

    Returns
    -------
    LinkRoute
        The first route of the response.

    Raises
    ------
    InvalidInput
        When the file is not a router's response or holds no route that can be driven.

    Examples
    --------
    >>> read_response(b'{"code": "Ok", "routes": [{"legs": [{"distance": 900.0, "duration": 60.0}]}]}').speed_m_s
    array([15.])
    """
    data, name = content(source, where)
    return _route_from(Node(parse_json(data, name), name).members(), router, name)


def _route_from(response: dict[str, Any], router: str | None, name: str) -> LinkRoute:
    kind = router or router_of(response)
    if kind is None or kind not in ROUTERS:
        got = repr(router) if router else f"an object with {sorted(response)[:6]}"
        raise InvalidInput.of("unknown router", name, got[:120], ", ".join(ROUTERS))
    return ROUTERS[kind](response, f"{name} ({kind})")


def is_route(path: Path | str) -> bool:
    r"""Whether a file is to be read as a route, by its suffix or its beginning.

    True for a file with a suffix of `ROUTE_SUFFIXES`, for a text that begins like XML or JSON, and for a table of links.

    Parameters
    ----------
    path : str or Path
        A file.

    Returns
    -------
    bool
        False if the file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "links.csv")
    ...     _ = file.write_text("length_m,speed_m_s\n500,10\n")
    ...     is_route(file), is_route(folder)
    (True, False)
    """
    path = Path(path)
    if path.suffix.lower() in ROUTE_SUFFIXES:
        return path.is_file()
    if not path.is_file():
        return False
    head = file_head(path)
    return head.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"<", b"{", b"[") or is_links_table(head)


def parse_route(source: bytes | str | Path, *, where: str | None = None) -> LinkRoute | Track:
    """Read a route in any of the formats: GPX, KML, GeoJSON, a router's response, or links as JSON or CSV. O(bytes).

    The format is recognised from the content. Links are a JSON array of the objects that `route_from_links` reads, an object
    with such an array under the key `links`, or a CSV table with the same names as columns (`route_from_table`).

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    LinkRoute or Track
        A track for GPX, KML and GeoJSON, links for everything else.

    Raises
    ------
    InvalidInput
        When the source has none of these formats; else with the faults that the reader of its format finds.

    Examples
    --------
    >>> parse_route(b'[{"length_m": 500, "speed_m_s": 10}]').duration_s
    50.0
    """
    data, name = content(source, where)
    head = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith((b"<", b"\xff\xfe", b"\xfe\xff")):
        return read_kml(data, where=name) if root_of(data) == "kml" else read_gpx(data, where=name)
    if head.startswith(ZIP):
        fix = "unpack it, for example with unzip, and give the file doc.kml"
        raise InvalidInput.of("packed file", name, "a ZIP archive, such as KMZ", "KML", fix)
    if is_links_table(data):
        return route_from_table(data, name)
    document = parse_json(data, name)
    if isinstance(document, list):
        return route_from_links(document)
    response = Node(document, name).members()
    if "links" in response:
        return route_from_links([link.value for link in Node(document, name)["links"].entries()])
    if router_of(response) is None and "type" in response:
        return track_from_geojson(Node(response, name))
    if router_of(response) is None:
        got = f"an object with {sorted(response)[:6]}"
        allowed = f"GPX, KML, GeoJSON, a response of {', '.join(ROUTERS)}, or links with {', '.join(sorted(LINK_KEYS))}"
        raise InvalidInput.of("unknown format", name, got[:120], allowed)
    return _route_from(response, None, name)
