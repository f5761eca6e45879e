"""Documents from outside: their bytes within a bound, and JSON values with their place in the document."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, excerpt
from tripwatt.files import read_file, strict_json
from tripwatt.routes.points import require_few_points, require_on_earth

MAX_BYTES: Final = 64 * 1024 * 1024
"""Largest size of one file [bytes]: a GPX point takes about 100."""


def read_content(source: bytes | str | Path, where: str | None = None) -> tuple[bytes, str]:
    """The bytes of a source and its name for messages. A source of type bytes is the content itself, any other is a path.

    Raises
    ------
    InvalidInput
        When the file cannot be read or is too large.
    """
    if isinstance(source, bytes):
        data, name = source, where or "route"
    else:
        path = Path(source)
        data, name = read_file(path, MAX_BYTES), where or path.name
    if len(data) > MAX_BYTES:
        raise InvalidInput.of("file too large", name, f"{len(data)} bytes", f"at most {MAX_BYTES} bytes")
    return data, name


def parse_json(data: bytes, where: str) -> Any:
    """The value of a JSON text, without NaN and infinities.

    Raises
    ------
    InvalidInput
        When the text is not JSON.
    """
    try:
        return strict_json(data)
    except RecursionError as error:
        raise InvalidInput.of("not JSON", where, "nested too deeply", "a route") from error
    except ValueError as error:
        raise InvalidInput.of("not JSON", where, str(error)[:120], "a JSON document in UTF-8") from error


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
            raise InvalidInput.of("not an object", self.where, _json_excerpt(self.value), "a JSON object")
        return self.value

    def entries(self, *, min_count: int = 0) -> list[Node]:
        """The entries of a JSON array that has at least `min_count` entries."""
        if not isinstance(self.value, list):
            raise InvalidInput.of("not a list", self.where, _json_excerpt(self.value), "a JSON array")
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
            raise InvalidInput.of("not a number", self.where, _json_excerpt(self.value), allowed)
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


def _json_excerpt(value: Any) -> str:
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**18:
        return "a number without end"
    return excerpt(value)
