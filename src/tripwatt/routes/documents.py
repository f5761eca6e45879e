"""Documents from outside: their bytes within a bound, JSON values with their place in the document, and parts that answers of routers share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, excerpt
from tripwatt.files import read_file, strict_json
from tripwatt.routes.points import require_few_points, require_on_earth
from tripwatt.units import M_S_PER_KM_H

MAX_BYTES: Final = 64 * 1024 * 1024
"""Largest size of one file [bytes]: a GPX point takes about 100."""


def read_content(source: bytes | str | Path, where: str | None = None) -> tuple[bytes, str]:
    """The bytes of a source and its name for messages. A source of type bytes is the content itself, any other is a path.

    Raises
    ------
    InvalidInput
        When the file cannot be read or is too large.
    """
    if not isinstance(source, bytes):
        return read_file(source, MAX_BYTES), where or Path(source).name
    name = where or "route"
    if len(source) > MAX_BYTES:
        raise InvalidInput.of("file too large", name, f"{len(source)} bytes", f"at most {MAX_BYTES} bytes")
    return source, name


def parse_json(data: bytes, where: str) -> Any:
    """The value of a JSON text, without NaN and infinities.

    Raises
    ------
    InvalidInput
        When the text is not JSON.
    """
    try:
        return strict_json(data)
    except (RecursionError, ValueError) as error:
        got = "nested too deeply" if isinstance(error, RecursionError) else str(error)[:120]
        raise InvalidInput.of("not JSON", where, got, "a JSON document in UTF-8") from error


@dataclass(frozen=True, slots=True)
class Node:
    """A value of a JSON document with its place, for messages. Each method raises `InvalidInput` if the value is of another type.

    Attributes
    ----------
    value : object
        As `json.loads` returns it; None also for a missing member.
    where : str

    Examples
    --------
    >>> leg = Node({"legs": [{"time": 60}]}, "answer")["legs"].entries(min_count=1)[0]
    >>> leg["time"].number(), leg["time"].where, leg["name"].value
    (60.0, 'answer, legs[0], time', None)
    """

    value: Any
    where: str

    def __getitem__(self, key: str) -> Node:
        return Node(self.members().get(key), f"{self.where}, {key}")

    def members(self) -> dict[str, Any]:
        """The value as the members of a JSON object."""
        if not isinstance(self.value, dict):
            raise InvalidInput.of("not an object", self.where, excerpt(self.value), "a JSON object")
        return self.value

    def entries(self, *, min_count: int = 0) -> list[Node]:
        """The entries of a JSON array that has at least `min_count` entries."""
        if not isinstance(self.value, list):
            raise InvalidInput.of("not a list", self.where, excerpt(self.value), "a JSON array")
        if len(self.value) < min_count:
            got, allowed = f"{len(self.value)}", f"at least {min_count}"
            raise InvalidInput.of("too few entries", self.where, got, allowed)
        return [Node(entry, f"{self.where}[{k}]") for k, entry in enumerate(self.value)]

    def number(self, *, minimum: float = -math.inf) -> float:
        """The value as a float; it has to be a finite JSON number of at least `minimum`."""
        is_number = isinstance(self.value, int | float) and not isinstance(self.value, bool)
        try:
            number = float(self.value) if is_number else math.nan
        except OverflowError:
            number = math.inf
        if not (math.isfinite(number) and number >= minimum):
            allowed = "a finite number" if minimum == -math.inf else f"a finite number, {minimum:g} or more"
            raise InvalidInput.of("not a number", self.where, excerpt(self.value), allowed)
        return number

    def numbers(self, *, minimum: float = -math.inf) -> FloatArray:
        """The numbers of a JSON array, shape (entries,)."""
        return np.array([entry.number(minimum=minimum) for entry in self.entries()], dtype=np.float64)

    def coordinates(self) -> FloatArray:
        """GeoJSON positions as latitude [°], longitude [°] and height [m] (NaN = missing), shape (points, 3)."""
        require_few_points(len(self.value) if isinstance(self.value, list) else 0, self.where)
        positions = self.entries(min_count=2)
        points = np.full((len(positions), 3), np.nan)
        for k, position in enumerate(positions):
            parts = position.entries(min_count=2)
            points[k, 1], points[k, 0] = parts[0].number(), parts[1].number()
            if len(parts) > 2 and parts[2].value is not None:
                points[k, 2] = parts[2].number()
        require_on_earth(points[:, 0], points[:, 1], self.where)
        return points


def steps_of(part: Node, key: str = "steps") -> Sequence[Node]:
    """The steps of a leg, segment or path; the part itself if it has no steps.

    Examples
    --------
    >>> [step.where for step in steps_of(Node({"steps": [{}, {}]}, "leg"))], steps_of(Node({}, "leg"))[0].where
    (['leg, steps[0]', 'leg, steps[1]'], 'leg')
    """
    return part[key].entries() if part[key].value else (part,)


def step_pieces(
    steps: Sequence[Node], length_key: str = "distance", time_key: str = "duration"
) -> FloatArray:
    """Length and time of each step in the units of the answer, and NaN for its unknown speed, shape (steps, 3).

    Examples
    --------
    >>> step_pieces([Node({"distance": 900, "duration": 60.5}, "step")]).tolist()
    [[900.0, 60.5, nan]]
    """
    rows = [
        (step[length_key].number(minimum=0.0), step[time_key].number(minimum=0.0), math.nan) for step in steps
    ]
    return np.array(rows).reshape(-1, 3)


def edge_pieces(leg: Node, *, annotated_speed: bool = False) -> FloatArray:
    """Length, time and speed of each edge from the annotation of an OSRM leg, shape (edges, 3).

    The times of an annotation leave out turns and lights. If the leg takes longer than their sum, these times are scaled
    to the duration of the leg.

    Parameters
    ----------
    leg : Node
    annotated_speed : bool
        Whether to take the annotated speed if there is one. Otherwise the speed is the annotated length over time, NaN if either
        is 0.

    Raises
    ------
    InvalidInput
        When the annotation does not have a length and a time for each edge.
    """
    length = leg["annotation"]["distance"].numbers(minimum=0.0)
    time = leg["annotation"]["duration"].numbers(minimum=0.0)
    node = leg["annotation"]["speed"]
    speed = node.numbers(minimum=0.0) if annotated_speed and node.value is not None else None
    if not 0 < len(time) == len(length) == len(time if speed is None else speed):
        got = f"{len(length)} and {len(time)}"
        raise InvalidInput.of("annotations of different lengths", leg.where, got, "one for each edge")
    if speed is None:
        speed = np.divide(length, time, out=np.full(len(time), np.nan), where=(time > 0) & (length > 0))
    total = float(time.sum())
    scale = max(leg["duration"].number(minimum=0.0) / total, 1.0) if total > 0 else 1.0
    return np.column_stack((length, time * scale, speed))


def intervals(detail: Node, n_points: int) -> list[tuple[int, int, Node]]:
    """First point, last point and value of each entry of a path detail of GraphHopper; empty if the detail is not given.

    Raises
    ------
    InvalidInput
        When the points of an entry are not indices of the path in ascending order.

    Examples
    --------
    >>> intervals(Node([[0, 2, 5.0]], "time"), 3)[0][:2], intervals(Node(None, "time"), 3)
    ((0, 2), [])
    """
    rows = []
    for entry in detail.entries() if detail.value else ():
        start, end, value = entry.entries(min_count=3)[:3]
        first, last = start.number(minimum=0.0), end.number(minimum=0.0)
        if first % 1 or last % 1 or not first <= last < n_points:
            got, allowed = f"{first:g} to {last:g}", f"0 to {n_points - 1}, ascending"
            raise InvalidInput.of("point index out of range", entry.where, got, allowed)
        rows.append((int(first), int(last), value))
    return rows


def speeds_at_points(detail: Node, n_points: int) -> FloatArray:
    """Speed after each point [m/s] from a path detail in km/h; NaN where the speed is unknown or 0.

    Examples
    --------
    >>> speeds_at_points(Node([[0, 2, 36.0], [2, 3, None]], "max_speed"), 4)
    array([10., 10., nan, nan])
    """
    speed = np.full(n_points, np.nan)
    for start, end, value in intervals(detail, n_points):
        if value.value is not None:
            speed[start : max(end, start + 1)] = M_S_PER_KM_H * value.number(minimum=0.0)
    return np.where(speed > 0.0, speed, np.nan)
