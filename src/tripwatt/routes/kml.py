"""Reader of KML texts as tracks: the `gx:Track` of a recording, or the line of a route."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.routes.documents import read_content
from tripwatt.routes.tracks import Track
from tripwatt.routes.xml_events import Line, Point, XmlTracks


def read_kml(source: bytes | str | Path, *, where: str | None = None) -> Track:
    """Read the first recording with at least two points in a KML 2.2 text, else the first such line. O(bytes).

    A recording is a `gx:Track` with `when` and `gx:coord`, a line is a `LineString`. If all altitudes are 0, they count as
    unknown: KML files have 0 for an unknown altitude. A text with a document type declaration is refused.

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    Track
        With times if it is a recording.

    Raises
    ------
    InvalidInput
        When the text is not well-formed, has a document type declaration, or has no valid line or recording.

    Examples
    --------
    >>> text = b"<kml><Placemark><LineString><coordinates>11.5,48.1,500 11.5,48.2,520</coordinates></LineString></Placemark></kml>"
    >>> round(read_kml(text).position_m[-1])
    11120
    """
    data, name = read_content(source, where)
    track = _Kml(name).track(data)
    if (track.elevation_m != 0.0).any():
        return track
    return replace(track, elevation_m=np.full(len(track), np.nan))


class _Kml(XmlTracks):
    root = "kml"
    kinds = ("Track", "LineString")
    texts = ("coordinates", "coord", "when")
    allowed = "a LineString or a gx:Track of two points"

    def handle_start(self, tag: str, _: Mapping[str, str]) -> None:
        if tag in self.kinds:
            self.lines[tag].append(Line())

    def handle_end(self, tag: str, text: str) -> None:
        parent, words = self.path[-1] if self.path else "", text.split()
        if (tag, parent) == ("coordinates", "LineString"):
            self.lines[parent][-1].points += [self.point(word.split(",")) for word in words]
        elif (tag, parent) == ("coord", "Track"):
            self.lines[parent][-1].points.append(self.point(words))
        elif (tag, parent) == ("when", "Track"):
            self.lines[parent][-1].times.append(" ".join(words))

    def point(self, numbers: list[str]) -> Point:
        """The point of a longitude, a latitude and an optional altitude, all as text."""
        where = self.count_point()
        try:
            values = [float(text) for text in numbers]
        except ValueError:
            values = []
        if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
            got = repr(",".join(numbers)[:60])
            allowed = "longitude, latitude and optionally altitude"
            raise InvalidInput.of("not coordinates", where, got, allowed)
        return values[1], values[0], values[2] if len(values) == 3 else math.nan
