"""Conformal scores: standardised errors of held-out trips, from which every interval takes its width."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray

TAIL_DF: Final = 4.0
"""Beyond the largest score an interval grows like that of a t distribution with these degrees of freedom."""


@dataclass(frozen=True, eq=False)
class ConformalScores:
    """Absolute standardised errors of held-out trips, ascending.

    The conformal layer of Vovk, Gammerman and Shafer (2005), with the absolute error over the standard deviation as score, as in Papadopoulos et al. (2008).

    Attributes
    ----------
    values : ndarray, shape (trips,)

    Examples
    --------
    >>> scores = ConformalScores.from_errors([-1.0, 0.5, 2.0, 0.1])
    >>> scores.factor(0.4), scores.factor(0.8)
    (0.5, 2.0)
    """

    values: FloatArray

    @classmethod
    def from_errors(cls, standardised: Sequence[float]) -> ConformalScores:
        """From signed standardised errors."""
        return cls(np.sort(np.abs(np.asarray(standardised, dtype=np.float64))))

    def factor(self, level: float) -> float:
        """Half width of a central interval of the given level, in standard deviations.

        The k-th of n scores covers a new trip with probability k / (n + 1), whatever the distribution; levels in
        between are interpolated.
        """
        n = len(self.values)
        rank = level * (n + 1)
        if rank <= n:
            return float(np.interp(rank, np.arange(n + 1), np.concatenate(([0.0], self.values))))
        from scipy.special import stdtrit

        top = stdtrit(TAIL_DF, 0.5 + 0.5 * n / (n + 1))
        return float(self.values[-1] * stdtrit(TAIL_DF, 0.5 + 0.5 * min(level, 1 - 1e-9)) / top)

    def probability(self, standardised: float) -> float:
        """Probability that the error is below `standardised` standard deviations: the inverse of `factor`."""
        n = len(self.values)
        size = abs(standardised)
        if size <= self.values[-1]:
            # scores that repeat make no step backwards
            level = float(np.interp(size, np.concatenate(([0.0], self.values)), np.arange(n + 1))) / (n + 1)
        else:
            from scipy.special import stdtr, stdtrit

            top = stdtrit(TAIL_DF, 0.5 + 0.5 * n / (n + 1))
            level = (
                float(2.0 * stdtr(TAIL_DF, size / self.values[-1] * top) - 1.0)
                if self.values[-1] > 0
                else 1.0
            )
        return 0.5 + 0.5 * level if standardised >= 0 else 0.5 - 0.5 * level
