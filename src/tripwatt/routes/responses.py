"""Saved responses of routers (OSRM, Valhalla, openrouteservice, GraphHopper) as links.

Each reader follows the public documentation of one router's JSON; `docs/routes.md` names the pages. All of
them take the first route. What a router expects includes the traffic lights and turns that it counts, so that its times
are travel times with standstill.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, excerpt
from tripwatt.files import file_head
from tripwatt.routes.geojson import track_from_geojson
from tripwatt.routes.gpx import read_gpx
from tripwatt.routes.kml import read_kml
from tripwatt.routes.link_objects import LINK_KEYS, route_from_links
from tripwatt.routes.link_table import is_links_table, route_from_table
from tripwatt.routes.links import FLAT_ROAD, SHORTEST_LINK_M, LinkRoute, first_of
from tripwatt.routes.points import (
    a_list,
    a_number,
    an_object,
    content,
    coordinates,
    haversine_m,
    numbers,
    parse_json,
)
from tripwatt.routes.polyline import decode_polyline
from tripwatt.routes.tracks import Track
from tripwatt.routes.xml_events import root_of
from tripwatt.trips import Flag
from tripwatt.units import M_PER_MILE, M_S_PER_KM_H

M_PER_FOOT: Final = 0.3048
ORS_UNITS_M: Final[Mapping[str, float]] = MappingProxyType({"m": 1.0, "km": 1000.0, "mi": M_PER_MILE})
ZIP: Final = b"PK\x03\x04"
"""First bytes of a ZIP archive."""

ROUTE_SUFFIXES: Final = (".gpx", ".kml", ".kmz", ".json", ".geojson")


@dataclass(slots=True)
class _Pieces:
    """Pieces of a route as they come; pieces without length or time go to the next one that has both."""

    length_m: list[float] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)
    moving_m_s: list[float] = field(default_factory=list)
    left_m: float = 0.0
    left_s: float = 0.0

    def add(self, length_m: float, time_s: float, moving_m_s: float = math.nan) -> None:
        length, time = length_m + self.left_m, time_s + self.left_s
        if length >= SHORTEST_LINK_M and time > 0:
            self.length_m.append(length)
            self.time_s.append(time)
            self.moving_m_s.append(moving_m_s)
            self.left_m = self.left_s = 0.0
        else:
            self.left_m, self.left_s = length, time

    def route(self, where: str, heights: tuple[FloatArray, FloatArray] | None, *flags: Flag) -> LinkRoute:
        if not self.length_m:
            raise InvalidInput.of(
                "no route", where, "no step with a length and a duration", "a route with steps"
            )
        self.length_m[-1] += self.left_m
        self.time_s[-1] += self.left_s
        length = np.array(self.length_m)
        position, height = heights if heights is not None else (None, None)
        if position is not None and position[-1] > 0:
            position = position * (float(length.sum()) / position[-1])
        assumed = flags if heights is not None else (*flags, FLAT_ROAD)
        return LinkRoute(
            length,
            np.array(self.time_s),
            np.full(len(length), np.nan),
            np.array(self.moving_m_s),
            position,
            height,
            assumed,
        )


def _first(value: Any, where: str) -> tuple[dict[str, Any], tuple[Flag, ...]]:
    routes = a_list(value, where, least=1)
    flags = () if len(routes) == 1 else (first_of("routes", len(routes)),)
    return an_object(routes[0], f"{where}[0]"), flags


def _heights(points: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Distances and heights of points (latitude, longitude, height); None where none has a height."""
    if points.shape[1] < 3 or not np.isfinite(points[:, 2]).any():
        return None
    position = np.concatenate(([0.0], np.cumsum(haversine_m(points[:, 0], points[:, 1]))))
    known = np.isfinite(points[:, 2])
    if not position[-1] > 0:
        return None
    # the whole length belongs to the last position, also where the last point has no height
    height = np.interp(position, position[known], points[known, 2])
    return position, height


def route_from_osrm(response: Mapping[str, Any], where: str = "OSRM response") -> LinkRoute:
    """Links of an OSRM route response: its annotations if it has them, else its steps, else its legs.

    An annotation gives the speed between two nodes of the map without turns and lights; what the leg takes longer on
    the whole is shared out in proportion, and the annotated speed is the moving speed.

    Raises
    ------
    InvalidInput
        When it is not one, or OSRM found no route.
    """
    if response.get("code", "Ok") != "Ok":
        raise InvalidInput.of("the router found no route", where, excerpt(response.get("code")), "code Ok")
    route, flags = _first(response.get("routes"), f"{where}, routes")
    pieces = _Pieces()
    for k, entry in enumerate(a_list(route.get("legs"), f"{where}, legs", least=1)):
        place = f"{where}, legs[{k}]"
        leg = an_object(entry, place)
        duration = a_number(leg.get("duration"), f"{place}, duration", least=0.0)
        annotation = leg.get("annotation")
        if isinstance(annotation, dict) and annotation.get("duration") and annotation.get("distance"):
            length = numbers(annotation["distance"], f"{place}, annotation, distance", least=0.0)
            time = numbers(annotation["duration"], f"{place}, annotation, duration", least=0.0)
            if len(length) != len(time):
                raise InvalidInput.of(
                    "annotations of different lengths",
                    place,
                    f"{len(length)} and {len(time)}",
                    "one duration for each distance",
                )
            total = float(time.sum())
            longer = max(duration, total) / (total or math.inf)
            for metres, seconds in zip(length.tolist(), time.tolist(), strict=True):
                pieces.add(
                    metres, seconds * longer, metres / seconds if metres > 0 and seconds > 0 else math.nan
                )
        else:
            _add_steps(pieces, leg.get("steps") or [leg], place, "distance", "duration")
    return pieces.route(where, None, *flags)


def _add_steps(
    pieces: _Pieces,
    steps: Any,
    where: str,
    length_key: str,
    time_key: str,
    *,
    length_scale: float = 1.0,
    time_scale: float = 1.0,
) -> None:
    for k, entry in enumerate(a_list(steps, f"{where}, steps")):
        place = f"{where}, steps[{k}]"
        step = an_object(entry, place)
        pieces.add(
            length_scale * a_number(step.get(length_key), f"{place}, {length_key}", least=0.0),
            time_scale * a_number(step.get(time_key), f"{place}, {time_key}", least=0.0),
        )


def route_from_valhalla(response: Mapping[str, Any], where: str = "Valhalla response") -> LinkRoute:
    """Links of a Valhalla trip: its manoeuvres, with the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When it is not one, or Valhalla found no route.
    """
    trip = an_object(response.get("trip"), f"{where}, trip")
    if trip.get("status", 0) != 0:
        raise InvalidInput.of(
            "the router found no route", where, excerpt(trip.get("status_message"), 80), "status 0"
        )
    units = trip.get("units", "kilometers")
    if units not in ("kilometers", "miles"):
        raise InvalidInput.of("unknown unit", f"{where}, units", excerpt(units, 40), "kilometers or miles")
    metres, height_unit = (1000.0, 1.0) if units == "kilometers" else (M_PER_MILE, M_PER_FOOT)
    pieces, places, heights, driven, complete = _Pieces(), [], [], 0.0, True
    for k, entry in enumerate(a_list(trip.get("legs"), f"{where}, legs", least=1)):
        place = f"{where}, legs[{k}]"
        leg = an_object(entry, place)
        length = 0.0
        for j, item in enumerate(a_list(leg.get("maneuvers"), f"{place}, maneuvers", least=1)):
            spot = f"{place}, maneuvers[{j}]"
            manoeuvre = an_object(item, spot)
            piece = metres * a_number(manoeuvre.get("length"), f"{spot}, length", least=0.0)
            pieces.add(piece, a_number(manoeuvre.get("time"), f"{spot}, time", least=0.0))
            length += piece
        if leg.get("elevation"):
            height = height_unit * numbers(leg["elevation"], f"{place}, elevation")
            # the interval is the last one's only nearly: the heights are spread evenly over the leg
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
    """Links of an openrouteservice response, JSON or GeoJSON: its steps, with the elevation if the response has it.

    Raises
    ------
    InvalidInput
        When it is not one, or an error.
    """
    if "error" in response:
        raise InvalidInput.of("the router found no route", where, excerpt(response["error"], 120), "routes")
    heights = None
    metres = _openrouteservice_unit(response, where)
    if "features" in response:
        feature, flags = _first(response["features"], f"{where}, features")
        route = an_object(feature.get("properties"), f"{where}, properties")
        geometry = an_object(feature.get("geometry"), f"{where}, geometry")
        heights = _heights(coordinates(geometry.get("coordinates"), f"{where}, coordinates"))
    else:
        route, flags = _first(response.get("routes"), f"{where}, routes")
        summary = route.get("summary")
        three = isinstance(summary, dict) and ("ascent" in summary or "descent" in summary)
        if three and isinstance(route.get("geometry"), str):
            heights = _heights(decode_polyline(route["geometry"], f"{where}, geometry", dimensions=3))
    pieces = _Pieces()
    for k, entry in enumerate(a_list(route.get("segments"), f"{where}, segments", least=1)):
        place = f"{where}, segments[{k}]"
        segment = an_object(entry, place)
        steps = segment.get("steps") or [segment]
        _add_steps(pieces, steps, place, "distance", "duration", length_scale=metres)
    return pieces.route(where, heights, *flags)


def _openrouteservice_unit(response: Mapping[str, Any], where: str) -> float:
    """Metres in a unit of length of the response, which repeats the request; metres by default."""
    metadata = response.get("metadata")
    query = metadata.get("query") if isinstance(metadata, dict) else None
    units = query.get("units", "m") if isinstance(query, dict) else "m"
    if not isinstance(units, str) or units.lower() not in ORS_UNITS_M:
        raise InvalidInput.of(
            "unknown unit", f"{where}, metadata, query, units", excerpt(units, 40), ", ".join(ORS_UNITS_M)
        )
    return ORS_UNITS_M[units.lower()]


def route_from_graphhopper(response: Mapping[str, Any], where: str = "GraphHopper response") -> LinkRoute:
    """Links of a GraphHopper response: its path details `time`, else its instructions, with the elevation if it has it.

    Raises
    ------
    InvalidInput
        When it is not one, or an error.
    """
    if "paths" not in response and "message" in response:
        raise InvalidInput.of("the router found no route", where, excerpt(response["message"], 120), "paths")
    path, flags = _first(response.get("paths"), f"{where}, paths")
    points = _graphhopper_points(path, where)
    given = path.get("details")
    details = given if isinstance(given, dict) else {}
    pieces = _Pieces()
    if points is not None and details.get("time"):
        position = np.concatenate(([0.0], np.cumsum(haversine_m(points[:, 0], points[:, 1]))))
        if position[-1] > 0 and path.get("distance") is not None:
            position *= a_number(path["distance"], f"{where}, distance", least=0.0) / position[-1]
        moving = _graphhopper_speeds(details.get("average_speed"), len(points), where)
        for start, end, milliseconds in _intervals(details["time"], len(points), f"{where}, details, time"):
            pieces.add(float(position[end] - position[start]), milliseconds / 1000.0, float(moving[start]))
    else:
        instructions = path.get("instructions") or [path]
        _add_steps(pieces, instructions, where, "distance", "time", time_scale=1e-3)
    return pieces.route(where, None if points is None else _heights(points), *flags)


def _graphhopper_points(path: Mapping[str, Any], where: str) -> FloatArray | None:
    points = path.get("points")
    if points is None:
        return None
    if isinstance(points, str):
        multiplier = a_number(
            path.get("points_encoded_multiplier", 1e5), f"{where}, points_encoded_multiplier", least=1.0
        )
        return _graphhopper_polyline(points, path, multiplier, f"{where}, points")
    return coordinates(an_object(points, f"{where}, points").get("coordinates"), f"{where}, points")


def _graphhopper_polyline(text: str, path: Mapping[str, Any], multiplier: float, where: str) -> FloatArray:
    """Points of an encoded text, with or without heights: whichever fits the length of the path."""
    found = {}
    faults: list[Fault] = []
    for dimensions in (2, 3):
        try:
            points = decode_polyline(text, where, precision=multiplier, dimensions=dimensions)
        except InvalidInput as error:
            faults = faults or list(error.faults)
            continue
        found[dimensions] = points
    if not found:
        raise InvalidInput(faults)
    if len(found) == 1:
        return next(iter(found.values()))
    if path.get("distance") is None:
        # older versions give six numbers with elevation, newer ones always four
        return found[3 if isinstance(path.get("bbox"), list) and len(path["bbox"]) == 6 else 2]
    driven = a_number(path["distance"], f"{where}, distance", least=0.0)
    return min(found.values(), key=lambda p: abs(float(haversine_m(p[:, 0], p[:, 1]).sum()) - driven))


def _intervals(value: Any, points: int, where: str) -> list[tuple[int, int, float]]:
    found = []
    for k, entry in enumerate(a_list(value, where)):
        place = f"{where}[{k}]"
        parts = a_list(entry, place, least=3)
        start, end = (a_number(p, place, least=0.0) for p in parts[:2])
        if not (start == int(start) and end == int(end) and start <= end < points):
            raise InvalidInput.of(
                "point index out of range", place, f"{start:g} to {end:g}", f"0 to {points - 1}, ascending"
            )
        found.append(
            (int(start), int(end), a_number(parts[2] if parts[2] is not None else 0.0, place, least=0.0))
        )
    return found


def _graphhopper_speeds(value: Any, points: int, where: str) -> FloatArray:
    speed = np.full(points, np.nan)
    if value:
        for start, end, kilometres_per_hour in _intervals(value, points, f"{where}, details, average_speed"):
            if kilometres_per_hour > 0:
                speed[start : max(end, start + 1)] = kilometres_per_hour * M_S_PER_KM_H
    return speed


ROUTERS: Final[Mapping[str, Callable[[Mapping[str, Any], str], LinkRoute]]] = MappingProxyType(
    {
        "osrm": route_from_osrm,
        "valhalla": route_from_valhalla,
        "openrouteservice": route_from_openrouteservice,
        "graphhopper": route_from_graphhopper,
    }
)
"""Reader of each router's response."""


def router_of(response: Mapping[str, Any]) -> str | None:
    """Which of `ROUTERS` a response looks like, None for none of them.

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
        When it is not such a response or holds no route that can be driven.

    Examples
    --------
    >>> read_response(b'{"code": "Ok", "routes": [{"legs": [{"distance": 900.0, "duration": 60.0}]}]}').speed_m_s
    array([15.])
    """
    data, name = content(source, where)
    return _route_from(an_object(parse_json(data, name), name), router, name)


def _route_from(response: dict[str, Any], router: str | None, name: str) -> LinkRoute:
    kind = router or router_of(response)
    if kind is None or kind not in ROUTERS:
        got = repr(router) if router else f"an object with {sorted(response)[:6]}"
        raise InvalidInput.of("unknown router", name, got[:120], ", ".join(ROUTERS))
    return ROUTERS[kind](response, f"{name} ({kind})")


def is_route(path: Path | str) -> bool:
    r"""Tell whether a file is to be read as a route, by its name or its beginning.

    Everything but a Parquet file and a CSV table of samples is: its faults are then those of a route.

    Parameters
    ----------
    path : str or Path
        A file.

    Returns
    -------
    bool
        False where the file cannot be read.

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
    """A route in any of the formats: GPX, KML, GeoJSON, a router's response, or links as JSON or CSV. O(bytes).

    The format is recognised from the content. Links are a JSON array of objects, or an object with a key `links`, as
    `route_from_links` reads them, or a CSV table with the same names as columns (`route_from_table`).

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
        When it is none of these, or with the faults that the format's reader finds.

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
    response = an_object(document, name)
    if "links" in response:
        return route_from_links(a_list(response["links"], f"{name}, links"))
    if router_of(response) is None and "type" in response:
        return track_from_geojson(response, name)
    if router_of(response) is None:
        got = f"an object with {sorted(response)[:6]}"
        allowed = f"GPX, KML, GeoJSON, a response of {', '.join(ROUTERS)}, or links with {', '.join(sorted(LINK_KEYS))}"
        raise InvalidInput.of("unknown format", name, got[:120], allowed)
    return _route_from(response, None, name)
