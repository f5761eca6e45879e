"""Points on the earth: distances, and numbers and JSON that come from outside."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, excerpt
from tripwatt.files import read_file

EARTH_RADIUS_M: Final = 6_371_008.8
"""Mean radius of the earth (IUGG, GRS 80)."""

MOST_POINTS: Final = 500_000
"""Points of one route: 139 hours at one a second."""

MOST_BYTES: Final = 64 * 1024 * 1024
"""Size of one file: a GPX point takes about 100 bytes."""


def haversine_m(latitude_deg: npt.ArrayLike, longitude_deg: npt.ArrayLike) -> FloatArray:
    """Distance between each point and the next [m], shape (points - 1,), on the sphere.

    Notes
    -----
    R. W. Sinnott, "Virtues of the Haversine", Sky and Telescope 68 (1984). Against the ellipsoid it is off by up to 0.5 %.

    Examples
    --------
    >>> haversine_m([0.0, 0.0, 1.0], [0.0, 1.0, 1.0]).round(1)
    array([111195.1, 111195.1])
    """
    lat, lon = np.radians(np.asarray(latitude_deg)), np.radians(np.asarray(longitude_deg))
    chord = (
        np.sin(np.diff(lat) / 2.0) ** 2 + np.cos(lat[1:]) * np.cos(lat[:-1]) * np.sin(np.diff(lon) / 2.0) ** 2
    )
    return np.asarray(2.0 * EARTH_RADIUS_M * np.arcsin(np.sqrt(np.clip(chord, 0.0, 1.0))), dtype=np.float64)


def require_on_earth(latitude_deg: FloatArray, longitude_deg: FloatArray, where: str) -> None:
    """Raise `InvalidInput` for coordinates that no place has and for too many of them."""
    if len(latitude_deg) > MOST_POINTS:
        raise InvalidInput.of("too many points", where, f"{len(latitude_deg)}", f"at most {MOST_POINTS}")
    faults = []
    for name, values, limit in (("latitude", latitude_deg, 90.0), ("longitude", longitude_deg, 180.0)):
        bad = np.flatnonzero(~(np.abs(values) <= limit))
        if len(bad):
            more = f" (and {len(bad) - 1} more points)" if len(bad) > 1 else ""
            place = f"{where}, point {bad[0] + 1}, {name}"
            faults.append(
                Fault(
                    "coordinate out of range",
                    place,
                    f"{values[bad[0]]:g}°{more}",
                    f"-{limit:g}° to {limit:g}°",
                )
            )
    if faults:
        raise InvalidInput(faults)


def content(source: bytes | str | Path, where: str | None = None) -> tuple[bytes, str]:
    """Bytes of a source and its name for messages: bytes are the content itself, anything else is a path.

    Raises
    ------
    InvalidInput
        When the file cannot be read or is too large.
    """
    if isinstance(source, bytes):
        data, name = source, where or "route"
        size = len(data)
    else:
        path = Path(source)
        data, name = read_file(path, MOST_BYTES), where or path.name
        size = len(data)
    if size > MOST_BYTES:
        raise InvalidInput.of("file too large", name, f"{size} bytes", f"at most {MOST_BYTES} bytes")
    return data, name


def parse_json(data: bytes, where: str) -> Any:
    """The value of a JSON text, without NaN and infinities.

    Raises
    ------
    InvalidInput
        When it is not JSON.
    """

    def refuse(constant: str) -> float:
        raise ValueError(f"{constant} is no JSON number")

    try:
        return json.loads(data, parse_constant=refuse)
    except RecursionError as error:
        raise InvalidInput.of("not JSON", where, "nested too deeply", "a route") from error
    except ValueError as error:
        raise InvalidInput.of("not JSON", where, str(error)[:120], "a JSON document in UTF-8") from error


def an_object(value: Any, where: str) -> dict[str, Any]:
    """`value` if it is a JSON object, else `InvalidInput`."""
    if not isinstance(value, dict):
        raise InvalidInput.of("not an object", where, _excerpt(value), "a JSON object")
    return value


def a_list(value: Any, where: str, *, least: int = 0) -> list[Any]:
    """`value` if it is a JSON array of at least `least` entries, else `InvalidInput`."""
    if not isinstance(value, list):
        raise InvalidInput.of("not a list", where, _excerpt(value), "a JSON array")
    if len(value) < least:
        raise InvalidInput.of("too few entries", where, f"{len(value)}", f"at least {least}")
    return value


def a_number(value: Any, where: str, *, least: float = -math.inf) -> float:
    """`value` as a float if it is a finite JSON number of at least `least`, else `InvalidInput`."""
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, int | float) else float(value)
    except OverflowError:
        number = math.inf
    if not (math.isfinite(number) and number >= least):
        allowed = "a finite number" if least == -math.inf else f"a finite number, {least:g} or more"
        raise InvalidInput.of("not a number", where, _excerpt(value), allowed)
    return number


def numbers(value: Any, where: str, *, least: float = -math.inf) -> FloatArray:
    """A JSON array of finite numbers as float64, else `InvalidInput`."""
    return np.array(
        [a_number(v, f"{where}[{k}]", least=least) for k, v in enumerate(a_list(value, where))],
        dtype=np.float64,
    )


def coordinates(value: Any, where: str) -> FloatArray:
    """GeoJSON positions as latitude, longitude, height (NaN where missing), shape (points, 3).

    Raises
    ------
    InvalidInput
        When a position is not one.
    """
    positions = a_list(value, where, least=2)
    if len(positions) > MOST_POINTS:
        raise InvalidInput.of("too many points", where, f"{len(positions)}", f"at most {MOST_POINTS}")
    points = np.full((len(positions), 3), np.nan)
    for k, position in enumerate(positions):
        place = f"{where}[{k}]"
        parts = a_list(position, place, least=2)
        points[k, 1], points[k, 0] = a_number(parts[0], place), a_number(parts[1], place)
        if len(parts) > 2 and parts[2] is not None:
            points[k, 2] = a_number(parts[2], place)
    require_on_earth(points[:, 0], points[:, 1], where)
    return points


def _excerpt(value: Any) -> str:
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**18:
        return "a number without end"
    return excerpt(value)
