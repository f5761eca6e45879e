"""Coverage of intervals together with the width that was needed.

Intervals that contain every trip may be right or far too wide; their coverage alone does not show which. The factor `needed` does:
scaled about their centres by this factor, the intervals would contain exactly their nominal share of the trips. The factor is known
only in hindsight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class Coverage:
    """Intervals of one level compared with measured values.

    Attributes
    ----------
    level : float
        Nominal share of the trips within their interval.
    trips, inside : int
        Number of trips, and number of trips within their interval.
    width : float
        Mean width, in the unit of the bounds.
    needed : float
        Width that was needed divided by `width` [1]: below 1 the intervals were too wide, above 1 too narrow.

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
        """Compare intervals with measured values.

        Parameters
        ----------
        observed, low, high : array_like, shape (trips,)
            Measured values, and the bounds of their intervals.
        level : float
            Nominal coverage, 0 to 1.

        Returns
        -------
        Coverage
            `width` and `needed` are NaN if there are no trips. `needed` is infinite if an interval of zero width would have to grow.
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
        """Mean width at which the intervals contain exactly their nominal share of these trips, in the unit of the bounds."""
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


def clopper_pearson(hits: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact confidence interval of a proportion (Clopper and Pearson 1934).

    Parameters
    ----------
    hits, n : int
        Number of hits, and of trials.
    confidence : float
        Confidence level of the interval.

    Returns
    -------
    tuple of float
        Lower and upper bound; 0 and 1 if there are no trials.

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
    """Statistical power of `n` trips: the probability that the exact interval of their share excludes the nominal level.

    Parameters
    ----------
    n : int
        Number of trips.
    level, truth : float
        Nominal and true coverage, 0 to 1.
    confidence : float
        Confidence level of the interval.

    Returns
    -------
    float
        Probability, near 0 if the trips are too few to show a difference.

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
