"""Coverage of intervals together with the width that was needed.

An interval that holds every trip may be right or far too wide; its coverage alone does not show which. The factor shows it by which
all intervals of a set of trips could have been scaled about their centres to hold exactly their share of these trips. It is known in
hindsight alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class Coverage:
    """Intervals of one level beside what was measured.

    Attributes
    ----------
    level : float
        Share of the trips that the intervals are meant to hold.
    trips, inside : int
        Number of trips, and of those within their interval.
    width : float
        Mean width, in the unit of the bounds.
    needed : float
        Width that was needed over `width` [1]: below 1 the intervals were wider than the trips called for, above 1 too narrow.

    Examples
    --------
    >>> held = Coverage.from_bounds([10.0, 12.0, 9.0, 11.0], [0.0] * 4, [20.0] * 4, 0.5)
    >>> held.inside, held.share, held.width, held.needed_width
    (4, 1.0, 20.0, 2.0)
    """

    level: float
    trips: int
    inside: int
    width: float
    needed: float

    @classmethod
    def from_bounds(
        cls, observed: npt.ArrayLike, low: npt.ArrayLike, high: npt.ArrayLike, level: float
    ) -> Coverage:
        """Compare intervals with what was measured.

        Parameters
        ----------
        observed, low, high : array_like, shape (trips,)
            Measured values, and the bounds of their intervals.
        level : float
            Nominal coverage, 0 to 1.

        Returns
        -------
        Coverage
            NaN widths where there is no trip; an infinite factor where an interval without width would have to grow.
        """
        observed, low, high = (np.asarray(v, dtype=np.float64) for v in (observed, low, high))
        n = len(observed)
        if not n:
            return cls(level, 0, 0, math.nan, math.nan)
        inside = (low <= observed) & (observed <= high)
        distance, half = np.abs(observed - 0.5 * (low + high)), 0.5 * (high - low)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(distance > 0.0, distance / half, 0.0)
        rank = min(max(math.ceil(level * n - 1e-9), 1), n)
        return cls(level, n, int(inside.sum()), float(np.mean(high - low)), float(np.sort(factor)[rank - 1]))

    @property
    def share(self) -> float:
        """Share of the trips within their interval [1]."""
        return self.inside / self.trips if self.trips else math.nan

    @property
    def needed_width(self) -> float:
        """Mean width with which the intervals hold exactly their share of these trips, in the unit of the bounds."""
        return self.needed * self.width

    @property
    def ci95(self) -> tuple[float, float]:
        """Exact 95 % interval of the share (Clopper and Pearson 1934).

        Examples
        --------
        >>> low, high = Coverage(0.9, 10, 9, 1.0, 1.0).ci95
        >>> round(low, 3), round(high, 4)
        (0.555, 0.9975)
        """
        return clopper_pearson(self.inside, self.trips)

    @property
    def holds(self) -> bool:
        """Whether the share differs from the level by no more than chance explains: the level is in `ci95`."""
        low, high = self.ci95
        return low <= self.level <= high


def clopper_pearson(hits: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of a proportion (Clopper and Pearson 1934).

    Parameters
    ----------
    hits, n : int
        Number of hits, and of trials.
    confidence : float
        Of the interval.

    Returns
    -------
    tuple of float
        Lower and upper bound; 0 and 1 without a trial.

    Examples
    --------
    >>> low, high = clopper_pearson(9, 10)
    >>> round(low, 3), round(high, 4)
    (0.555, 0.9975)
    """
    from scipy import stats  # scipy is slow to import

    if not n:
        return 0.0, 1.0
    interval = stats.binomtest(hits, n).proportion_ci(confidence, method="exact")
    return float(interval.low), float(interval.high)


def power(n: int, level: float, truth: float, confidence: float = 0.95) -> float:
    """Probability that `n` trips show a true coverage that differs from its level: that the exact interval of the share excludes the level.

    Parameters
    ----------
    n : int
        Number of trips.
    level, truth : float
        Nominal and true coverage, 0 to 1.
    confidence : float
        Of the interval.

    Returns
    -------
    float
        Near 0 where the trips are too few to show anything.

    Examples
    --------
    >>> round(power(17, 0.9, 0.75), 2), round(power(100, 0.9, 0.75), 2)
    (0.43, 0.98)
    """
    from scipy import stats  # scipy is slow to import

    hits, tail = np.arange(n + 1), 0.5 * (1.0 - confidence)
    low = np.nan_to_num(stats.beta.ppf(tail, hits, n - hits + 1), nan=0.0)
    high = np.nan_to_num(stats.beta.ppf(1.0 - tail, hits + 1, n - hits), nan=1.0)
    return float(stats.binom.pmf(hits, n, truth)[(level < low) | (level > high)].sum())
