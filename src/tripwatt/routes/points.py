"""Points on the earth: distances between them, and checks of their coordinates, and encoded polylines of them."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.errors import Fault, InvalidInput, and_more, raise_faults

EARTH_RADIUS_M: Final = 6_371_008.8
"""Mean radius of the earth (IUGG, GRS 80)."""

MAX_POINTS: Final = 500_000
"""Largest number of points in one route: 139 hours at one point a second."""


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
    return np.asarray(
        2.0 * EARTH_RADIUS_M * np.arcsin(np.sqrt(np.clip(haversine, 0.0, 1.0))), dtype=np.float64
    )


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
            got = f"{values[bad[0]]:g}°{and_more(bad, 'points')}"
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
    if len(text) > 32 * MAX_POINTS:
        raise InvalidInput.of("polyline too long", where, f"{len(text)} characters", f"{32 * MAX_POINTS}")
    chunks = np.frombuffer(text.encode("utf-32-le", "surrogatepass"), dtype=np.uint32).astype(np.int64) - 63
    ends = np.flatnonzero(chunks < 0x20)  # the last character of each number lacks the bit for "more follow"
    starts = np.concatenate(([0], ends + 1))
    lengths = np.diff(starts, append=len(chunks))  # the last length is that of an unfinished number, else 0
    # a number has ten characters of five bits each at most; a coordinate takes seven
    if ((chunks < 0) | (chunks >= 64)).any() or (lengths > 10).any():
        raise InvalidInput.of("not an encoded polyline", where, repr(text[:20]), "an encoded polyline")
    if lengths[-1] or len(ends) % dimensions or len(ends) < 2 * dimensions:
        got = f"{len(ends)} numbers{' and a part of one' if lengths[-1] else ''}"
        allowed = f"{dimensions} for each of at least 2 points"
        raise InvalidInput.of("not an encoded polyline", where, got, allowed)
    place = np.arange(len(chunks)) - np.repeat(starts, lengths)
    values = np.add.reduceat((chunks & 0x1F) << (5 * place), starts[:-1])
    numbers = np.where(values & 1, ~(values >> 1), values >> 1)
    scale = np.array([precision, precision, 100.0][:dimensions])
    points = np.cumsum(numbers.astype(np.float64).reshape(-1, dimensions), axis=0) / scale
    require_on_earth(points[:, 0], points[:, 1], where)
    return np.asarray(points)
