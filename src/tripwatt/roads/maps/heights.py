"""Heights of places on a map: the terrain around a journey, and the climb of a road as far as these heights show it.

A map has the heights of villages, stations and signs, though it has no heights of roads. Between them the height is a random field whose
differences have the variance ``(scale) ** 2 * (distance / 10 km) ** (2 * GROWTH)``, as net climbs have. Ordinary kriging gives the
expected height beside a road and the covariance of its error (Matheron 1963, Principles of geostatistics); the scale is the one with which
heights that are left out have errors of the stated size (Dubrule 1983, Cross validation of kriging in a unique neighborhood).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Self

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.routes.points import EARTH_RADIUS_M
from tripwatt.routes.terrain import GROWTH, REFERENCE_M, net_climbs
from tripwatt.trips import TERRAINS
from tripwatt.trips.plan import KnownClimb

MIN_HEIGHTS: Final = 10
MAX_HEIGHTS: Final = 400
"""Least number of heights that show the terrain of a region, and the largest number that is compared in pairs. Choices."""

APART_M: Final = 1000.0
"""Places nearer to each other than this count as that far apart when the terrain is chosen: they are one village. A choice."""

BESIDE_M: Final = 100.0
"""Distance between a place whose height is known and the road beside it [m]: a choice."""

NEAREST: Final = 8
"""Heights that are used for each point of a road: a choice, those behind them add little."""

POINT_M: Final = 2000.0
MIN_POINTS: Final = 13
MAX_POINTS: Final = 61
"""Distance between the points of a road at which the climb is estimated [m], and their least and largest numbers. Choices."""


@dataclass(frozen=True, eq=False)
class KnownHeights:
    """Heights of places around a journey.

    Attributes
    ----------
    latitude_deg, longitude_deg, height_m : ndarray, shape (places,)
        Places and their heights above sea level [m].

    Examples
    --------
    >>> at = np.linspace(0.0, 0.2, 40)
    >>> slopes = [KnownHeights(47.0 + at, np.full(40, 9.0), slope * at) for slope in (100.0, 8000.0)]
    >>> [heights.terrain for heights in slopes]
    ['flat', 'mountains']
    >>> climb = slopes[1].climb(np.array([47.0, 47.1]), np.array([9.01, 9.01]), np.array([0.0, 11_000.0]))
    >>> climb.climb_m[-1].round(-1).item(), bool(climb.sd_m[-1] < 60.0)
    (780.0, True)
    """

    latitude_deg: FloatArray
    longitude_deg: FloatArray
    height_m: FloatArray

    @classmethod
    def from_rows(cls, rows: Iterable[tuple[float, float, float]]) -> Self | None:
        """Make the heights of rows of latitude, longitude [°] and height [m]; None if there are too few."""
        table = np.array([*rows], dtype=np.float64).reshape(-1, 3)
        return cls(*table.T) if len(table) >= MIN_HEIGHTS else None

    @cached_property
    def terrain(self) -> str:
        """The kind of terrain whose roads differ in height as the places do.

        Compared is the climb that nine tenths of all pairs of places do not exceed, over 10 km along a line (`tripwatt.routes.terrain`). So
        a few wrong heights on the map do not matter.
        """
        from scipy.spatial.distance import pdist

        some = slice(None, None, 1 + len(self.height_m) // MAX_HEIGHTS)
        apart_m = np.maximum(pdist(self._plane_m(self.latitude_deg, self.longitude_deg)[some]), APART_M)
        over_10_km_m = pdist(self.height_m[some, None]) * (REFERENCE_M / apart_m) ** GROWTH
        most_m = np.log(max(np.quantile(over_10_km_m, 0.9), 1.0))
        usual = {kind: np.log(net_climbs(kind).quantile(0.95, REFERENCE_M)) for kind in TERRAINS[1:]}
        return min(usual, key=lambda kind: float(abs(usual[kind] - most_m)))

    def climb(
        self, latitude_deg: FloatArray, longitude_deg: FloatArray, position_m: FloatArray
    ) -> KnownClimb:
        """Estimate the climb of a road. O(points * (heights near them)² + (heights near them)³).

        Parameters
        ----------
        latitude_deg, longitude_deg : ndarray, shape (vertices,)
            The line of the road.
        position_m : ndarray, shape (vertices,)
            Distance of each vertex from the start [m].

        Returns
        -------
        KnownClimb
            Expected net climb and its error at points along the road.
        """
        length_m = float(position_m[-1])
        count = int(np.clip(length_m / POINT_M, MIN_POINTS, MAX_POINTS))
        at_m = np.linspace(0.0, length_m, count)
        line = (np.interp(at_m, position_m, degrees) for degrees in (latitude_deg, longitude_deg))
        points, places = self._plane_m(*line), self._plane_m(self.latitude_deg, self.longitude_deg)
        near = np.unique(self._tree.query(points, k=NEAREST)[1])
        height, inverse = self.height_m[near], _bordered_inverse(places[near])
        precision = inverse[:-1, :-1]
        left_out = precision @ height / np.diag(precision)
        beside = -_half_variogram(points, places[near])
        weights = np.column_stack((beside, np.ones(count))) @ inverse[:, :-1]
        more, off = weights - weights[0], beside - beside[0]
        error = 2.0 * _half_variogram(points, points[:1])[:, 0] - 2.0 * np.sum(off * more, axis=1)
        error += np.sum(more @ _covariance(places[near]) * more, axis=1)
        sd_m = np.sqrt(np.mean(left_out**2 * np.diag(precision)) * np.maximum(error, 0.0))
        return KnownClimb(at_m, more @ height, sd_m, float(weights[0] @ height))

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(self._plane_m(self.latitude_deg, self.longitude_deg))

    def _plane_m(self, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
        """Places on a plane [m], precise enough to compare distances of some kilometres."""
        east = longitude_deg * np.cos(np.radians(self.latitude_deg[0]))
        return np.asarray(EARTH_RADIUS_M * np.radians(np.column_stack((latitude_deg, east))))


def _half_variogram(one_m: FloatArray, other_m: FloatArray) -> FloatArray:
    """Half of the variance of the difference between heights, for a scale of 1 m over 10 km."""
    from scipy.spatial.distance import cdist

    return np.asarray(0.5 * (cdist(one_m, other_m) / REFERENCE_M) ** (2.0 * GROWTH))


def _covariance(places_m: FloatArray) -> FloatArray:
    """Generalised covariance of the heights of places, each of which differs from that of the road beside it."""
    own = (BESIDE_M / REFERENCE_M) ** (2.0 * GROWTH)
    return np.asarray(own * np.eye(len(places_m)) - _half_variogram(places_m, places_m))


def _bordered_inverse(places_m: FloatArray) -> FloatArray:
    """Inverse of the covariance with the condition that the weights of the heights add up to 1."""
    n = len(places_m)
    bordered = np.ones((n + 1, n + 1))
    bordered[:n, :n], bordered[n, n] = _covariance(places_m), 0.0
    return np.asarray(np.linalg.inv(bordered), dtype=np.float64)
