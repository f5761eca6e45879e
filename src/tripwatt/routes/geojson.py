"""Reader of GeoJSON texts as tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, excerpt
from tripwatt.files import shipped_toml
from tripwatt.routes.documents import Node
from tripwatt.routes.links import FASTEST_LINK_M_S
from tripwatt.routes.tracks import TIME_ALLOWED, Track, parse_times
from tripwatt.trips import Flag
from tripwatt.units import M_S_PER_KM_H

ROAD_SPEED_M_S: Final[Mapping[str, float]] = {
    road: km_h * M_S_PER_KM_H for road, km_h in shipped_toml("routes/road_speeds.toml").items()
}
"""Mean speed [m/s] by OpenStreetMap's class of road if nothing better is known: the values of OSRM's car profile."""

_MAX_DEPTH: Final = 64
"""Largest depth of nested geometries; a choice, far below the limit of recursion."""
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
    time, started_at, flags = parse_times([text for _, _, texts in lines for text in texts], document.where)
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
