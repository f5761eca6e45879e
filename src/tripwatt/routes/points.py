"""Points on the earth: distances between them, and checks of their coordinates."""

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
