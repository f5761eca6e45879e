"""KML texts as tracks: `gx:Track` of a recording, or the line of a route."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.routes.links import first_of
from tripwatt.routes.points import MOST_POINTS, content
from tripwatt.routes.tracks import Track, times_of
from tripwatt.routes.xml_events import read_events

TEXTS: Final = ("coordinates", "coord", "when")
"""Elements whose text is read."""

Point = tuple[float, float, float]
"""Latitude, longitude [°] and altitude [m], which is NaN where there is none."""


@dataclass(slots=True)
class _Line:
    points: list[Point] = field(default_factory=list)
    times: list[str] = field(default_factory=list)


@dataclass(slots=True)
class _Reading:
    """What is collected while a KML text goes by."""

    name: str
    path: list[str] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    tracks: list[_Line] = field(default_factory=list)
    lines: list[_Line] = field(default_factory=list)
    number: int = 0

    def start(self, tag: str, _: Mapping[str, str]) -> None:
        self.path.append(tag)
        self.text = []
        if tag == "Track":
            self.tracks.append(_Line())
        elif tag == "LineString":
            self.lines.append(_Line())

    def characters(self, text: str) -> None:
        if self.path[-1] in TEXTS:  # outside of the root there is no text
            self.text.append(text)

    def end(self, tag: str) -> None:
        self.path.pop()
        parent, words = self.path[-1] if self.path else "", "".join(self.text).split()
        if (tag, parent) == ("coordinates", "LineString"):
            self.lines[-1].points += [self.point(word.split(",")) for word in words]
        elif (tag, parent) == ("coord", "Track"):
            self.tracks[-1].points.append(self.point(words))
        elif (tag, parent) == ("when", "Track"):
            self.tracks[-1].times.append(" ".join(words))
        self.text = []

    def point(self, numbers: list[str]) -> Point:
        """A point of longitude, latitude and, where it is there, altitude."""
        self.number += 1
        if self.number > MOST_POINTS:
            allowed = f"at most {MOST_POINTS}"
            raise InvalidInput.of("too many points", self.name, f"more than {MOST_POINTS}", allowed)
        try:
            values = [float(text) for text in numbers]
        except ValueError:
            values = []
        if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
            where, got = f"{self.name}, point {self.number}", repr(",".join(numbers)[:60])
            allowed = "longitude, latitude and optionally altitude"
            raise InvalidInput.of("not coordinates", where, got, allowed)
        return values[1], values[0], values[2] if len(values) == 3 else math.nan


def read_kml(source: bytes | str | Path, *, where: str | None = None) -> Track:
    """The first recording of a KML 2.2 text that has two points, else its first line. O(bytes).

    A recording is a `gx:Track` with `when` and `gx:coord`, a line a `LineString`. Altitudes that are all 0 are no
    elevation: KML has them where nothing else is known. XML is read without a document type.

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    Track
        With times for a recording.

    Raises
    ------
    InvalidInput
        For a text that is not well-formed, has a document type, no line, or no possible track.

    Examples
    --------
    >>> text = b"<kml><Placemark><LineString><coordinates>11.5,48.1,500 11.5,48.2,520</coordinates></LineString></Placemark></kml>"
    >>> round(read_kml(text).position_m[-1])
    11120
    """
    data, name = content(source, where)
    reading = _Reading(name)
    read_events(data, name, "kml", on_start=reading.start, on_end=reading.end, on_text=reading.characters)
    found = [line for line in (*reading.tracks, *reading.lines) if len(line.points) >= 2]
    if not found:
        got = f"{reading.number} points"
        raise InvalidInput.of("no track in the file", name, got, "a LineString or a gx:Track of two points")
    chosen = found[0]
    if chosen.times and len(chosen.times) != len(chosen.points):
        got = f"{len(chosen.times)} times, {len(chosen.points)} points"
        raise InvalidInput.of("times and points differ in number", name, got, "a time for each point")
    places = np.array(chosen.points, dtype=np.float64)
    height = places[:, 2]
    if not (height != 0.0).any():
        height = np.full(len(height), np.nan)
    time, started_at, more = times_of(chosen.times, name)
    flags = () if len(found) == 1 else (first_of("tracks and routes", len(found)),)
    unknown = np.full(len(places) - 1, np.nan)
    return Track(places[:, 0], places[:, 1], height, time, unknown, started_at, (*flags, *more))
