"""Readers of GPX, KML and GeoJSON as tracks. Document types are refused, so that no entity can be declared; depth and points are bounded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final
from xml.parsers import expat

import numpy as np

from tripwatt.arrays import FloatArray, number_in
from tripwatt.errors import InvalidInput, excerpt
from tripwatt.files import shipped_toml
from tripwatt.routes.documents import Node
from tripwatt.routes.links import FASTEST_LINK_M_S, first_of_several
from tripwatt.routes.points import MAX_POINTS, haversine_m
from tripwatt.routes.tracks import TIME_ALLOWED, Track, parse_times
from tripwatt.trips import Flag
from tripwatt.units import M_S_PER_KM_H

_MAX_DEPTH: Final = 64
"""Largest depth of elements and of geometries; a choice, which bounds the memory and is far below the limit of recursion."""

_FORMATS: Final = {
    "gpx": (("trk", "rte"), "a GPX document with a trk or rte of two points"),
    "kml": (("Track", "LineString"), "a LineString or a gx:Track of two points"),
}
"""Outermost element of a format -> its elements that are lines, those of the first name preferred, and a valid text in words."""

_NAMES: Final = "GPX/KML"
"""Name of the formats in messages, in every language."""

_POINT_TAGS: Final = ("trkpt", "rtept")

_JOINED: Final = ("MultiTrack", "MultiGeometry")
"""Elements of KML whose lines are parts of one, as the segments of a GPX track are."""

_Point = tuple[float, float, float]
"""Latitude, longitude [°] and altitude [m]; the altitude is NaN if unknown."""


def track_from_xml(data: bytes, name: str) -> Track:
    """Read the first line with at least two points of a GPX 1.0, GPX 1.1 or KML 2.2 text; its outermost element tells which. O(bytes).

    The line of a GPX text is its first track, with its segments joined, else its first route. The line of a KML text is its first
    recording, a `gx:Track` with `when` and `gx:coord`, or the parts of a `gx:MultiTrack`; else its first `LineString` or `MultiGeometry`; if all its altitudes are 0, they count as
    unknown: KML files have 0 for an unknown altitude.

    Parameters
    ----------
    data : bytes
        The text.
    name : str
        Name of the text for messages.

    Returns
    -------
    Track
        With times if the first and the last point have a time; missing times in between are interpolated.

    Raises
    ------
    InvalidInput
        When the text is not well-formed, has a document type declaration, another outermost element, or no valid line.

    Examples
    --------
    >>> text = b'<gpx><rte><rtept lat="48.1" lon="11.5"/><rtept lat="48.2" lon="11.5"><ele>520</ele></rtept></rte></gpx>'
    >>> round(track_from_xml(text, "route").position_m[-1])
    11120
    """
    reader = _Reader(name)
    reader.parse(data)
    track = reader.track()
    if reader.root == "gpx" or (track.elevation_m != 0.0).any():
        return track
    return replace(track, elevation_m=np.full(len(track), np.nan))


class _Reader:
    """Parser that collects the lines of a text: for each kind of line, the points and the texts of their times."""

    def __init__(self, name: str) -> None:
        self.name, self.root = name, ""
        self.lines: dict[str, list[tuple[list[_Point], list[str]]]] = {}
        self.path: list[str] = []
        self.number = 0
        self.text: list[str] = []
        self.point: dict[str, str] = {}
        self.joins = False

    def parse(self, data: bytes) -> None:
        """Parse a text; anything but well-formed XML without a document type raises `InvalidInput`."""

        def refuse(*_: object) -> None:
            allowed = f"{_NAMES} without a document type declaration"
            raise InvalidInput.of(
                "XML with a document type declaration", self.name, "<!DOCTYPE ...>", allowed
            )

        parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self.text.append
        parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
        try:
            parser.Parse(data, True)
        except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two for encodings
            allowed = f"a {_NAMES} document"
            raise InvalidInput.of("not well-formed XML", self.name, str(error)[:120], allowed) from error

    def track(self) -> Track:
        """The first line with at least two points, of the first kind that has one."""
        lines = [line for kind in self.lines.values() for line in kind if len(line[0]) >= 2]
        if not lines:
            allowed = _FORMATS[self.root][1]
            raise InvalidInput.of("no track in the file", self.name, f"{self.number} points", allowed)
        points, times = lines[0]
        if times and len(times) != len(points):
            got, allowed = f"{len(times)} times, {len(points)} points", "a time for each point"
            raise InvalidInput.of("times and points differ in number", self.name, got, allowed)
        latitude, longitude, height = np.array(points, dtype=np.float64).T
        time, started_at, flags = parse_times(times, self.name, haversine_m(latitude, longitude))
        flags = (*first_of_several("tracks and routes", len(lines)), *flags)
        unknown = np.full(len(height) - 1, np.nan)
        return Track(latitude, longitude, height, time, unknown, started_at, flags)

    def _start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Enter an element; another root and too many levels raise `InvalidInput`."""
        tag = tag.rpartition(":")[2]
        if not self.path:
            if tag not in _FORMATS:
                got, allowed = f"<{tag[:40]}>", f"<{'>, <'.join(_FORMATS)}>"
                raise InvalidInput.of(f"not {_NAMES}", self.name, got, allowed)
            self.root, self.lines = tag, {kind: [] for kind in _FORMATS[tag][0]}
        self.path.append(tag)
        if len(self.path) > _MAX_DEPTH:
            got, allowed = f"{len(self.path)} levels", f"at most {_MAX_DEPTH}"
            raise InvalidInput.of("XML nested too deeply", self.name, got, allowed)
        self.text.clear()
        if tag in _JOINED:
            self.joins = False
        elif tag in self.lines and (self.root == "kml" or len(self.path) == 2):
            if not (self.joins and self.path[-2] in _JOINED):
                self.lines[tag].append(([], []))
            self.joins = True
        elif tag in _POINT_TAGS:
            self.point = {**attributes, "place": self._count_point()}

    def _end(self, _: str) -> None:
        """Leave an element: a point of GPX, a value of one, or the coordinates and times of KML."""
        tag, text = self.path.pop(), "".join(self.text)
        self.text.clear()
        parent = self.path[-1] if self.path else ""
        if tag in _POINT_TAGS and len(self.path) > 1 and self.path[1] in self.lines:
            latitude, longitude = self._number("lat"), self._number("lon")
            has_height = self.point.get("ele", "").lower() not in ("", "nan")
            points, times = self.lines[self.path[1]][-1]
            points.append((latitude, longitude, self._number("ele") if has_height else math.nan))
            times.append(self.point.get("time", ""))
        elif parent in _POINT_TAGS and tag in ("ele", "time"):
            self.point[tag] = text.strip()
        elif self.root == "kml" and parent in self.lines:
            points, times = self.lines[parent][-1]
            if (tag, parent) == ("coordinates", "LineString"):
                points += [self._coordinates(word.split(",")) for word in text.split()]
            elif (tag, parent) == ("coord", "Track"):
                points.append(self._coordinates(text.split()))
            elif (tag, parent) == ("when", "Track"):
                times.append(" ".join(text.split()))

    def _count_point(self) -> str:
        """Count a point and return its place for messages; too many points raise `InvalidInput`."""
        self.number += 1
        if self.number > MAX_POINTS:
            got, allowed = f"more than {MAX_POINTS}", f"at most {MAX_POINTS}"
            raise InvalidInput.of("too many points", self.name, got, allowed)
        return f"{self.name}, point {self.number}"

    def _number(self, key: str) -> float:
        """The finite number of an attribute or an element of a point of GPX; anything else raises `InvalidInput`."""
        text = self.point.get(key, "")
        value = number_in(text)
        if not math.isfinite(value):
            where = f"{self.point['place']}, {key}"
            raise InvalidInput.of("not a number", where, repr(text[:40]), "a finite number")
        return value

    def _coordinates(self, numbers: list[str]) -> _Point:
        """The point of a longitude, a latitude and an optional altitude, all as text."""
        where = self._count_point()
        values = [*map(number_in, numbers)]
        if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
            got = repr(",".join(numbers)[:60])
            allowed = "longitude, latitude and optionally altitude"
            raise InvalidInput.of("not coordinates", where, got, allowed)
        return values[1], values[0], values[2] if len(values) == 3 else math.nan


ROAD_SPEED_M_S: Final[Mapping[str, float]] = {
    road: km_h * M_S_PER_KM_H for road, km_h in shipped_toml("routes/road_speeds.toml").items()
}
"""Mean speed [m/s] by OpenStreetMap's class of road if nothing better is known: the values of OSRM's car profile."""

_Line = tuple[FloatArray, float, list[str]]  # points, speed [m/s], times


def track_from_geojson(document: Node) -> Track:
    """Read the lines of a parsed GeoJSON document, joined in their order.

    `LineString`, `MultiLineString`, `Feature`, `FeatureCollection` and `GeometryCollection` are read; other geometries
    are left out. These properties of a feature are used: `speed_m_s` (mean speed), `highway` (class of road, see
    `ROAD_SPEED_M_S`) and `coordTimes` or `coordinateProperties.times` (ISO 8601, one for each point).

    Raises
    ------
    InvalidInput
        When the document is not GeoJSON or has no valid line.

    Examples
    --------
    >>> line = {"type": "LineString", "coordinates": [[11.5, 48.1], [11.6, 48.1], [11.7, 48.2]]}
    >>> len(track_from_geojson(Node(line, "route")))
    3
    """
    lines: list[_Line] = []
    skipped = _collect_lines(document, Node({}, document.where), lines, 0)
    if not lines:
        allowed = "a GeoJSON document with a LineString"
        raise InvalidInput.of("no line", document.where, "no LineString", allowed)
    points = np.concatenate([line for line, _, _ in lines])
    # the piece that joins two lines has the speed of the second one
    speed = np.concatenate([np.full(len(line), speed_m_s) for line, speed_m_s, _ in lines])[1:]
    texts = [text for _, _, part in lines for text in part]
    time, started_at, flags = parse_times(texts, document.where, haversine_m(points[:, 0], points[:, 1]))
    if skipped:
        flags = (*flags, Flag("geometries_skipped", "geometries", float(skipped), "1"))
    return Track(points[:, 0], points[:, 1], points[:, 2], time, speed, started_at, flags)


def _collect_lines(node: Node, properties: Node, lines: list[_Line], depth: int) -> int:
    """Append all lines within a GeoJSON object to `lines`, and return the number of other geometries."""
    if depth > _MAX_DEPTH:
        raise InvalidInput.of("nested too deeply", node.where, f"{depth} levels", f"at most {_MAX_DEPTH}")
    kind = node["type"].value
    if kind in ("FeatureCollection", "GeometryCollection"):
        members = node["features" if kind == "FeatureCollection" else "geometries"].entries()
        return sum(_collect_lines(member, properties, lines, depth + 1) for member in members)
    if kind == "Feature":
        if node["geometry"].value is None:
            return 0
        feature_properties = Node(node["properties"].value or {}, node["properties"].where)
        return _collect_lines(node["geometry"], feature_properties, lines, depth + 1)
    if kind in ("Point", "MultiPoint", "Polygon", "MultiPolygon"):
        return 1
    if kind not in ("LineString", "MultiLineString"):
        raise InvalidInput.of("not GeoJSON", node["type"].where, excerpt(kind), "a GeoJSON type")
    parts = [node["coordinates"]] if kind == "LineString" else node["coordinates"].entries()
    coordinates = [part.coordinates() for part in parts]
    texts = _time_texts(properties, sum(map(len, coordinates)))
    speed = _mean_speed(properties)
    for points in coordinates:
        lines.append((points, speed, texts[: len(points)]))
        texts = texts[len(points) :]
    return 0


def _time_texts(properties: Node, n_points: int) -> list[str]:
    """The time of each point as text, empty if the point has none."""
    times = properties["coordTimes"]
    if times.value is None and isinstance(properties["coordinateProperties"].value, dict):
        times = properties["coordinateProperties"]["times"]
    if times.value is None:
        return [""] * n_points
    nested = [entry.value if isinstance(entry.value, list) else [entry.value] for entry in times.entries()]
    flat = [text for part in nested for text in part]
    if len(flat) != n_points:
        got, allowed = f"{len(flat)} times", f"{n_points}, one for each point"
        raise InvalidInput.of("times and points differ in number", times.where, got, allowed)
    wrong = next((text for text in flat if not isinstance(text, str | None)), None)
    if wrong is not None:
        raise InvalidInput.of("invalid time", times.where, excerpt(wrong, 40), TIME_ALLOWED)
    return [text or "" for text in flat]


def _mean_speed(properties: Node) -> float:
    """Mean speed of a line [m/s], given or by its class of road; NaN if neither is known."""
    speed, road = properties["speed_m_s"], properties["highway"].value
    if speed.value is None:
        return ROAD_SPEED_M_S.get(road, math.nan) if isinstance(road, str) else math.nan
    value = speed.number()
    if not 0 < value <= FASTEST_LINK_M_S:
        allowed = f"more than 0, at most {FASTEST_LINK_M_S:g} m/s"
        raise InvalidInput.of("speed out of range", speed.where, f"{value:g}", allowed)
    return value
