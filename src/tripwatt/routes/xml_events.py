"""Base of the readers of XML tracks. Document types are refused, so that no entity can be declared; depth and points are bounded."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Final
from xml.parsers import expat

import numpy as np

from tripwatt.errors import InvalidInput
from tripwatt.routes.links import first_of_several
from tripwatt.routes.points import MAX_POINTS
from tripwatt.routes.tracks import Track, parse_times

_MAX_DEPTH: Final = 64
"""Largest depth of elements; a choice, which bounds the memory."""
ROOT_BYTES: Final = 65_536
"""Number of first bytes in which the root of a text has to begin."""

Point = tuple[float, float, float]
"""Latitude, longitude [°] and altitude [m]; the altitude is NaN if unknown."""


class _RootRead(Exception):
    """Ends the parsing as soon as the root is read."""


def _local_name(tag: str) -> str:
    """The name of an element without its prefix.

    Examples
    --------
    >>> _local_name("gx:Track"), _local_name("kml")
    ('Track', 'kml')
    """
    return tag.rpartition(":")[2]


@dataclass(slots=True)
class Line:
    """A line of points, with the texts of their times."""

    points: list[Point] = field(default_factory=list)
    times: list[str] = field(default_factory=list)


class XmlTracks:
    """Parser that collects the lines of an XML text; a subclass defines the elements of its format.

    Parameters
    ----------
    name : str
        Name of the text for messages.
    """

    root: ClassVar[str]
    """Name of the outermost element."""

    kinds: ClassVar[tuple[str, ...]]
    """Elements that are lines; lines of the first kind are preferred."""

    texts: ClassVar[tuple[str, ...]]
    """Elements whose text is read."""

    max_text: ClassVar[float] = math.inf
    """After this many characters of an element's text, further parts of it are left out."""

    allowed: ClassVar[str]
    """Description of a valid text, for messages."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines: dict[str, list[Line]] = {kind: [] for kind in self.kinds}
        self.path: list[str] = []
        self.number = 0
        self._text: list[str] = []
        self._characters = 0

    def handle_start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Handle the start of an element; the last entry of `path` is the element."""

    def handle_end(self, tag: str, text: str) -> None:
        """Handle the end of an element with its text; the last entry of `path` is its parent."""

    def count_point(self) -> str:
        """Count a point and return its place for messages.

        Raises
        ------
        InvalidInput
            When there are more than `MAX_POINTS`.
        """
        self.number += 1
        if self.number > MAX_POINTS:
            got, allowed = f"more than {MAX_POINTS}", f"at most {MAX_POINTS}"
            raise InvalidInput.of("too many points", self.name, got, allowed)
        return f"{self.name}, point {self.number}"

    def track(self, data: bytes) -> Track:
        """Parse a text and return its first line with at least two points, of the first of `kinds` that has one. O(bytes).

        Raises
        ------
        InvalidInput
            When the text is not well-formed, has a document type or another root, is nested too deeply, or has no valid track.
        """
        self._parse(data)
        lines = [line for kind in self.kinds for line in self.lines[kind] if len(line.points) >= 2]
        if not lines:
            raise InvalidInput.of("no track in the file", self.name, f"{self.number} points", self.allowed)
        first, flags = lines[0], first_of_several("tracks and routes", len(lines))
        if first.times and len(first.times) != len(first.points):
            got = f"{len(first.times)} times, {len(first.points)} points"
            raise InvalidInput.of(
                "times and points differ in number", self.name, got, "a time for each point"
            )
        latitude, longitude, height = np.array(first.points, dtype=np.float64).T
        time, started_at, time_flags = parse_times(first.times, self.name)
        unknown = np.full(len(height) - 1, np.nan)
        return Track(latitude, longitude, height, time, unknown, started_at, (*flags, *time_flags))

    def _parse(self, data: bytes) -> None:
        """Parse a text with the handlers of this object; anything but well-formed XML without a document type raises `InvalidInput`."""
        format_name = self.root.upper()

        def refuse(*_: object) -> None:
            allowed = f"{format_name} without a document type declaration"
            raise InvalidInput.of(
                "XML with a document type declaration", self.name, "<!DOCTYPE ...>", allowed
            )

        parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._add_text
        parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
        try:
            parser.Parse(data, True)
        except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two for encodings
            allowed = f"a {format_name} document"
            raise InvalidInput.of("not well-formed XML", self.name, str(error)[:120], allowed) from error

    def _start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Enter an element; another root and too many levels raise `InvalidInput`."""
        tag = _local_name(tag)
        if not self.path and tag != self.root:
            raise InvalidInput.of(f"not {self.root.upper()}", self.name, f"<{tag[:40]}>", f"<{self.root}>")
        self.path.append(tag)
        if len(self.path) > _MAX_DEPTH:
            got, allowed = f"{len(self.path)} levels", f"at most {_MAX_DEPTH}"
            raise InvalidInput.of("XML nested too deeply", self.name, got, allowed)
        self._text, self._characters = [], 0
        self.handle_start(tag, attributes)

    def _add_text(self, text: str) -> None:
        if self.path[-1] in self.texts and self._characters < self.max_text:
            self._text.append(text)
            self._characters += len(text)

    def _end(self, _: str) -> None:
        tag = self.path.pop()
        self.handle_end(tag, "".join(self._text))
        self._text, self._characters = [], 0


def root_name(data: bytes) -> str:
    """Name of the outermost element of an XML text, without its prefix; empty if it cannot be read.

    Examples
    --------
    >>> root_name(b'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document/></kml>')
    'kml'
    """
    roots: list[str] = []

    def start(tag: str, _: Mapping[str, str]) -> None:
        roots.append(_local_name(tag))
        raise _RootRead

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    with contextlib.suppress(_RootRead, expat.ExpatError, ValueError, LookupError):
        parser.Parse(data[:ROOT_BYTES], False)
    return roots[0] if roots else ""
