"""GeoJSON texts as tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, excerpt
from tripwatt.routes.links import FASTEST_LINK_M_S
from tripwatt.routes.points import (
    a_list,
    a_number,
    an_object,
    content,
    coordinates,
    parse_json,
    require_on_earth,
)
from tripwatt.routes.tracks import Track, times_of
from tripwatt.trips import Flag
from tripwatt.units import M_S_PER_KM_H

ROAD_SPEED_M_S: Final[Mapping[str, float]] = MappingProxyType(
    {
        road: kilometres_per_hour * M_S_PER_KM_H
        for road, kilometres_per_hour in {
            "motorway": 90.0,
            "motorway_link": 45.0,
            "trunk": 85.0,
            "trunk_link": 40.0,
            "primary": 65.0,
            "primary_link": 30.0,
            "secondary": 55.0,
            "secondary_link": 25.0,
            "tertiary": 40.0,
            "tertiary_link": 20.0,
            "unclassified": 25.0,
            "residential": 25.0,
            "living_street": 10.0,
            "service": 15.0,
        }.items()
    }
)
"""Mean speed [m/s] by OpenStreetMap's class of road where nothing better is known: the values of OSRM's car profile."""

DEEPEST: Final = 64
"""Geometries inside geometries."""


def read_geojson(source: bytes | str | Path, *, where: str | None = None) -> Track:
    """The lines of a GeoJSON text, joined in their order. O(bytes).

    `LineString`, `MultiLineString`, `Feature`, `FeatureCollection` and `GeometryCollection` are read; other geometries
    are left out. Of a feature's properties count `speed_m_s` (mean speed), `highway` (class of road, see
    `ROAD_SPEED_M_S`) and `coordTimes` or `coordinateProperties.times` (ISO 8601, one for each point).

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    Track
        All lines as one.

    Raises
    ------
    InvalidInput
        For a text that is not GeoJSON or has no possible line.

    Examples
    --------
    >>> len(read_geojson(b'{"type": "LineString", "coordinates": [[11.5, 48.1], [11.6, 48.1], [11.7, 48.2]]}'))
    3
    """
    data, name = content(source, where)
    return track_from_geojson(parse_json(data, name), name)


def track_from_geojson(document: Any, where: str) -> Track:
    """As `read_geojson`, from the parsed text."""
    lines: list[tuple[FloatArray, float, list[str]]] = []
    skipped = _collect(an_object(document, where), {}, where, lines, 0)
    if not lines:
        raise InvalidInput.of("no line", where, "no LineString", "a GeoJSON document with a LineString")
    points = np.concatenate([line[0] for line in lines])
    require_on_earth(points[:, 0], points[:, 1], where)
    # the piece that joins two lines has the speed of the second one
    speed = np.concatenate([np.full(len(line[0]), line[1]) for line in lines])[1:]
    time, started_at, flags = times_of([text for line in lines for text in line[2]], where)
    if skipped:
        flags = (*flags, Flag("geometries_skipped", "geometries", float(skipped), "1"))
    return Track(points[:, 0], points[:, 1], points[:, 2], time, speed, started_at, flags)


def _collect(
    node: dict[str, Any],
    properties: dict[str, Any],
    where: str,
    lines: list[tuple[FloatArray, float, list[str]]],
    depth: int,
) -> int:
    """Append the lines below a GeoJSON object; the number of geometries that are no lines."""
    if depth > DEEPEST:
        raise InvalidInput.of("nested too deeply", where, f"{depth} levels", f"at most {DEEPEST}")
    kind = node.get("type")
    if kind in ("FeatureCollection", "GeometryCollection"):
        key = "features" if kind == "FeatureCollection" else "geometries"
        members = a_list(node.get(key), f"{where}, {key}")
        return sum(
            _collect(
                an_object(m, f"{where}, {key}[{k}]"), properties, f"{where}, {key}[{k}]", lines, depth + 1
            )
            for k, m in enumerate(members)
        )
    if kind == "Feature":
        geometry = node.get("geometry")
        if geometry is None:
            return 0
        return _collect(
            an_object(geometry, f"{where}, geometry"),
            an_object(node.get("properties") or {}, f"{where}, properties"),
            where,
            lines,
            depth + 1,
        )
    if kind == "LineString":
        parts = [node.get("coordinates")]
    elif kind == "MultiLineString":
        parts = a_list(node.get("coordinates"), f"{where}, coordinates")
    elif kind in ("Point", "MultiPoint", "Polygon", "MultiPolygon"):
        return 1
    else:
        raise InvalidInput.of("not GeoJSON", f"{where}, type", excerpt(kind), "a GeoJSON type")
    found = [coordinates(part, f"{where}, coordinates") for part in parts]
    texts = _texts(properties, sum(map(len, found)), where)
    speed = _speed(properties, where)
    for points in found:
        lines.append((points, speed, texts[: len(points)]))
        texts = texts[len(points) :]
    return 0


def _texts(properties: dict[str, Any], number: int, where: str) -> list[str]:
    times = properties.get("coordTimes")
    if times is None and isinstance(properties.get("coordinateProperties"), dict):
        times = properties["coordinateProperties"].get("times")
    if times is None:
        return [""] * number
    flat = [
        t for part in a_list(times, f"{where}, times") for t in (part if isinstance(part, list) else [part])
    ]
    if len(flat) != number:
        raise InvalidInput.of(
            "times and points differ in number", where, f"{len(flat)} times", f"{number}, one for each point"
        )
    wrong = next((t for t in flat if not isinstance(t, str | None)), None)
    if wrong is not None:
        raise InvalidInput.of(
            "invalid time", where, excerpt(wrong, 40), "ISO 8601, such as 2026-05-01T08:00:00Z"
        )
    return [t or "" for t in flat]


def _speed(properties: dict[str, Any], where: str) -> float:
    if properties.get("speed_m_s") is not None:
        value = a_number(properties["speed_m_s"], f"{where}, speed_m_s")
        if not 0 < value <= FASTEST_LINK_M_S:
            allowed = f"more than 0, at most {FASTEST_LINK_M_S:g} m/s"
            raise InvalidInput.of("speed out of range", f"{where}, speed_m_s", f"{value:g}", allowed)
        return value
    road = properties.get("highway")
    return ROAD_SPEED_M_S.get(road, math.nan) if isinstance(road, str) else math.nan
