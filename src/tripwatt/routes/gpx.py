"""Reader of GPX texts as tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tripwatt.errors import InvalidInput
from tripwatt.routes.documents import read_content
from tripwatt.routes.tracks import Track
from tripwatt.routes.xml_events import Line, XmlTracks

_POINT_TAGS: Final = ("trkpt", "rtept")


def read_gpx(source: bytes | str | Path, *, where: str | None = None) -> Track:
    """Read the first track with at least two points in a GPX 1.0 or 1.1 text, else the first such route. O(bytes).

    The segments of a track are joined. A text with a document type declaration is refused, so that no XML entity can be
    declared.

    Parameters
    ----------
    source : bytes, str or path
        The text itself as bytes, or the path of a file.
    where : str, optional
        Name for messages.

    Returns
    -------
    Track
        With times if the first and the last point have a time; missing times in between are interpolated.

    Raises
    ------
    InvalidInput
        When the text is not well-formed, has a document type declaration, or has no valid track.

    Examples
    --------
    >>> text = b'<gpx><rte><rtept lat="48.1" lon="11.5"/><rtept lat="48.2" lon="11.5"><ele>520</ele></rtept></rte></gpx>'
    >>> round(read_gpx(text).position_m[-1])
    11120
    """
    data, name = read_content(source, where)
    return _Gpx(name).track(data)


class _Gpx(XmlTracks):
    root = "gpx"
    kinds = ("trk", "rte")
    texts = ("ele", "time")
    max_text = 100
    allowed = "a GPX document with a trk or rte of two points"

    place = ""
    latitude = longitude = elevation = time = ""

    def handle_start(self, tag: str, attributes: Mapping[str, str]) -> None:
        if tag in self.kinds and len(self.path) == 2:
            self.lines[tag].append(Line())
        elif tag in _POINT_TAGS:
            self.place = self.count_point()
            self.latitude, self.longitude = attributes.get("lat", ""), attributes.get("lon", "")
            self.elevation = self.time = ""

    def handle_end(self, tag: str, text: str) -> None:
        if tag in _POINT_TAGS and len(self.path) > 1 and self.path[1] in self.kinds:
            latitude = _number(self.latitude, f"{self.place}, lat")
            longitude = _number(self.longitude, f"{self.place}, lon")
            has_height = self.elevation.lower() not in ("", "nan")
            height = _number(self.elevation, f"{self.place}, ele") if has_height else math.nan
            line = self.lines[self.path[1]][-1]
            line.points.append((latitude, longitude, height))
            line.times.append(self.time)
        elif tag == "ele" and self.path[-1] in _POINT_TAGS:
            self.elevation = text.strip()
        elif tag == "time" and self.path[-1] in _POINT_TAGS:
            self.time = text.strip()


def _number(text: str, where: str) -> float:
    """The finite number that a text writes; anything else raises `InvalidInput`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInput.of("not a number", where, repr(text[:40]), "a finite number")
    return value
