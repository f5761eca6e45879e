"""GPX texts as tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.routes.links import first_of
from tripwatt.routes.points import MOST_POINTS, content
from tripwatt.routes.tracks import Track, times_of
from tripwatt.routes.xml_events import read_events


@dataclass(slots=True)
class _Reading:
    """What is collected while a GPX text goes by."""

    path: list[str]
    points: dict[str, list[list[tuple[float, float, float, str]]]]  # by kind: tracks or routes
    current: dict[str, str]
    text: str = ""
    number: int = 0


def read_gpx(source: bytes | str | Path, *, where: str | None = None) -> Track:
    """The first track of a GPX 1.0 or 1.1 text that has two points, else its first route. O(bytes).

    The segments of a track are joined. XML is read without a document type, so that no entity can be declared: a
    text that has one is refused.

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    Track
        With times where the first and the last point have one; those in between are interpolated.

    Raises
    ------
    InvalidInput
        For a text that is not well-formed, has a document type, no track, or no possible track.

    Examples
    --------
    >>> text = b'<gpx><rte><rtept lat="48.1" lon="11.5"/><rtept lat="48.2" lon="11.5"><ele>520</ele></rtept></rte></gpx>'
    >>> round(read_gpx(text).position_m[-1])
    11120
    """
    data, name = content(source, where)
    reading = _Reading([], {"trk": [], "rte": []}, {})
    read_events(
        data,
        name,
        "gpx",
        on_start=lambda tag, attributes: _start(reading, tag, attributes, name),
        on_end=lambda tag: _end(reading, name),
        on_text=lambda text: _characters(reading, text),
    )
    candidates = [p for kind in ("trk", "rte") for p in reading.points[kind] if len(p) >= 2]
    if not candidates:
        raise InvalidInput.of(
            "no track", name, "no trk or rte with two points", "a GPX document with a track or a route"
        )
    flags = () if len(candidates) == 1 else (first_of("tracks and routes", len(candidates)),)
    chosen = candidates[0]
    places = np.array([p[:3] for p in chosen], dtype=np.float64)
    time, started_at, more = times_of([p[3] for p in chosen], name)
    unknown = np.full(len(chosen) - 1, np.nan)
    return Track(places[:, 0], places[:, 1], places[:, 2], time, unknown, started_at, (*flags, *more))


def _start(reading: _Reading, tag: str, attributes: Mapping[str, str], name: str) -> None:
    reading.path.append(tag)
    reading.text = ""
    if tag in ("trk", "rte") and len(reading.path) == 2:
        reading.points[tag].append([])
    elif tag in ("trkpt", "rtept"):
        reading.number += 1
        if reading.number > MOST_POINTS:
            raise InvalidInput.of(
                "too many points", name, f"more than {MOST_POINTS}", f"at most {MOST_POINTS}"
            )
        reading.current = {"lat": attributes.get("lat", ""), "lon": attributes.get("lon", "")}


def _characters(reading: _Reading, text: str) -> None:
    if len(reading.text) < 100:
        reading.text += text


def _end(reading: _Reading, name: str) -> None:
    tag = reading.path.pop()
    parent = reading.path[-1] if reading.path else ""
    if tag in ("ele", "time") and parent in ("trkpt", "rtept"):
        reading.current[tag] = reading.text.strip()
    elif tag in ("trkpt", "rtept") and len(reading.path) > 1 and reading.path[1] in reading.points:
        place = f"{name}, point {reading.number}"
        current = reading.current
        latitude, longitude = (
            _number(current["lat"], f"{place}, lat"),
            _number(current["lon"], f"{place}, lon"),
        )
        height = _number(current["ele"], f"{place}, ele") if current.get("ele") else math.nan
        reading.points[reading.path[1]][-1].append((latitude, longitude, height, current.get("time", "")))
    reading.text = ""


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInput.of("not a number", where, repr(text[:40]), "a finite number")
    return value
