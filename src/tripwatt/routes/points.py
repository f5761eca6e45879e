"""Points on the earth: distances between them, and checks of their coordinates, and encoded polylines of them."""

from __future__ import annotations

import string
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray, IntArray, running_sum
from tripwatt.errors import Fault, InvalidInput, and_more, raise_faults

EARTH_RADIUS_M: Final = 6_371_008.8
"""Mean radius of the earth (IUGG, GRS 80)."""

MAX_POINTS: Final = 500_000
"""Largest number of points in one route: 139 hours at one point a second."""

_FLEXIBLE: Final = string.ascii_uppercase + string.ascii_lowercase + string.digits + "-_"
"""Characters of a flexible polyline in the order of their values."""


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
    haversine = (
        np.sin(np.diff(lat) / 2.0) ** 2 + np.cos(lat[1:]) * np.cos(lat[:-1]) * np.sin(np.diff(lon) / 2.0) ** 2
    )
    return np.asarray(2.0 * EARTH_RADIUS_M * np.arcsin(np.sqrt(np.clip(haversine, 0.0, 1.0))))


def distances_m(points: FloatArray, total_m: float | None = None) -> FloatArray:
    """Distance of each point from the first one [m], shape (points,).

    Parameters
    ----------
    points : ndarray, shape (points, 2 or more)
        Latitudes and longitudes [°].
    total_m : float, optional
        Length of the whole line, to which the distances are scaled; if all points are the same, the distances stay 0.

    Examples
    --------
    >>> distances_m(np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 4.0]]), 100.0)
    array([  0.,  25., 100.])
    """
    driven = running_sum(haversine_m(points[:, 0], points[:, 1]))
    if total_m is not None and driven[-1] > 0.0:
        driven *= total_m / driven[-1]
    return driven


def heights_along(points: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Distances and heights of points (latitude, longitude, height); None if no point has a height or the line has no length.

    Examples
    --------
    >>> heights_along(np.array([[0.0, 0.0, 5.0], [0.0, 1.0, np.nan]]))[1]
    array([5., 5.])
    """
    position, known = distances_m(points), np.isfinite(points[:, -1])
    if points.shape[1] < 3 or not known.any() or not position[-1] > 0:
        return None
    # all positions are kept, also of points without a height, so that the last one is the whole length
    return position, np.interp(position, position[known], points[known, 2])


def require_few_points(number: int, where: str) -> None:
    """Raise `InvalidInput` if there are more points than `MAX_POINTS`."""
    if number > MAX_POINTS:
        raise InvalidInput.of("too many points", where, f"{number}", f"at most {MAX_POINTS}")


def require_on_earth(latitude_deg: FloatArray, longitude_deg: FloatArray, where: str) -> None:
    """Raise `InvalidInput` if coordinates [°] are out of range or there are too many points."""
    require_few_points(len(latitude_deg), where)
    faults = []
    for name, values, limit in (("latitude", latitude_deg, 90.0), ("longitude", longitude_deg, 180.0)):
        bad = np.flatnonzero(~(np.abs(values) <= limit))
        if len(bad):
            place = f"{where}, point {bad[0] + 1}, {name}"
            got = f"{values[bad[0]]:g}°{and_more(bad, 'point')}"
            faults.append(Fault("coordinate out of range", place, got, f"-{limit:g}° to {limit:g}°"))
    raise_faults(faults)


def decode_polyline(text: str, where: str, *, precision: float = 1e5, dimensions: int = 2) -> FloatArray:
    """Decode an encoded polyline to latitudes, longitudes [°] and heights [m], shape (points, dimensions).

    O(characters), without a loop over them.

    Parameters
    ----------
    text : str
    where : str
        Name of the text for messages.
    precision : float
        Latitudes and longitudes are encoded as whole numbers: degrees times this [1/deg].
    dimensions : int
        2, or 3 if heights are encoded too, in hundredths of a metre.

    Raises
    ------
    InvalidInput
        When the text is not an encoded polyline, or has more than `MAX_POINTS` points.

    Notes
    -----
    The package `polyline` (2.0.4) reads pairs alone, while openrouteservice and GraphHopper encode a height with each point; takes a whole
    number of digits in place of GraphHopper's factor; and accepts malformed text.

    Examples
    --------
    >>> decode_polyline("_p~iF~ps|U_ulLnnqC", "example")
    array([[  38.5 , -120.2 ],
           [  40.7 , -120.95]])
    """
    chunks = np.frombuffer(text.encode("utf-32-le", "surrogatepass"), dtype=np.uint32).astype(np.int64) - 63
    return _points(_numbers(chunks, where), where, [precision, precision, 100.0][:dimensions])


def decode_flexible_polyline(text: str, where: str) -> FloatArray:
    """Decode a flexible polyline of HERE to latitudes, longitudes [°] and heights [m] if it has them, shape (points, 2 or 3).

    Raises
    ------
    InvalidInput
        As `decode_polyline`.

    Notes
    -----
    The format is that of https://github.com/heremaps/flexible-polyline, whose package `flexpolyline` (0.1.0) reads one point after the other.

    Examples
    --------
    >>> decode_flexible_polyline("BFoz5xJ67i1B1B7PzIhaxL7Y", "example")[:2].tolist()
    [[50.10228, 8.69821], [50.10201, 8.69567]]
    """
    numbers = _numbers(np.array([_FLEXIBLE.find(letter) for letter in text], dtype=np.int64), where)
    header = int(numbers[1]) if len(numbers) > 1 and numbers[0] == 1 else 15
    kind, precision, third = header >> 4 & 7, 10.0 ** (header & 15), 10.0 ** (header >> 7 & 15)
    points = _points(numbers[2:], where, [precision, precision, third][: 3 if kind else 2])
    # the third number is an altitude (2) or an elevation (3), or else a storey or something of the user's
    return points[:, : 3 if kind in (2, 3) else 2]


def _numbers(chunks: IntArray, where: str) -> IntArray:
    """The whole numbers of which chunks have five bits each, the lowest first, and a sixth bit for "more follow"."""
    if len(chunks) > 32 * MAX_POINTS:
        raise InvalidInput.of("polyline too long", where, f"{len(chunks)} characters", f"{32 * MAX_POINTS}")
    ends = np.flatnonzero(chunks < 0x20)
    starts = np.concatenate(([0], ends + 1))
    lengths = np.diff(starts, append=len(chunks))  # the last length is that of an unfinished number, else 0
    # a number has ten characters of five bits each at most; a coordinate takes seven
    if ((chunks < 0) | (chunks >= 64)).any() or (lengths > 10).any() or lengths[-1]:
        raise InvalidInput.of("not an encoded polyline", where, f"{len(chunks)} characters")
    place = np.arange(len(chunks)) - np.repeat(starts, lengths)
    return np.add.reduceat((chunks & 0x1F) << (5 * place), starts[:-1])


def _points(numbers: IntArray, where: str, scales: list[float]) -> FloatArray:
    """The points of signed differences of coordinates times `scales`, shape (points, scales)."""
    dimensions = len(scales)
    if len(numbers) % dimensions or len(numbers) < 2 * dimensions:
        allowed = f"{dimensions} for each of at least 2 points"
        raise InvalidInput.of("not an encoded polyline", where, f"{len(numbers)} numbers", allowed)
    signed = np.where(numbers & 1, ~(numbers >> 1), numbers >> 1).astype(np.float64)
    points = np.cumsum(signed.reshape(-1, dimensions), axis=0) / scales
    require_on_earth(points[:, 0], points[:, 1], where)
    return np.asarray(points)
