"""Conformal scores: standardised errors of held-out trips, which set the width of every interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tripwatt.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ConformalScores:
    """Absolute standardised errors of held-out trips, ascending.

    Beyond the largest score an interval grows like that of a t distribution with four degrees of freedom.

    Conformal prediction after Vovk, Gammerman and Shafer (2005). The score is the absolute error over its standard deviation, as in
    Papadopoulos et al. (2008).

    Attributes
    ----------
    values : ndarray, shape (trips,)
        Absolute errors over their standard deviations [1].

    Examples
    --------
    >>> scores = ConformalScores.from_errors([-1.0, 0.5, 2.0, 0.1])
    >>> scores.factor(0.4), scores.factor(0.8)
    (0.5, 2.0)
    >>> round(scores.probability(2.0), 3), round(scores.probability(-2.0), 3)
    (0.9, 0.1)
    """

    values: FloatArray

    @classmethod
    def from_errors(cls, standardised: Sequence[float]) -> ConformalScores:
        """Make the scores from signed standardised errors.

        Parameters
        ----------
        standardised : sequence of float
            Errors over their standard deviations [1], at least one.

        Returns
        -------
        ConformalScores
            The absolute values, sorted.
        """
        return cls(np.sort(np.abs(np.asarray(standardised, dtype=np.float64))))

    def with_other_causes(self, share: float) -> ConformalScores:
        """Mix the scores with those of a t distribution, for errors with a cause that no held-out trip has.

        Parameters
        ----------
        share : float
            Share of the variance of the error that has such a cause, 0 to 1.

        Returns
        -------
        ConformalScores
            The same number of scores.

        Examples
        --------
        >>> scores = ConformalScores.from_errors([3.0] * 20)
        >>> scores.with_other_causes(0.0).factor(0.9), round(scores.with_other_causes(0.5).factor(0.9), 2)
        (3.0, 2.38)
        """
        n = len(self.values)
        # 2 is the variance of a t distribution with four degrees of freedom
        usual = t4_half_width(np.arange(1, n + 1) / (n + 1)) / math.sqrt(2.0)
        return ConformalScores(np.sqrt((1.0 - share) * self.values**2 + share * usual**2))

    def factor(self, level: float) -> float:
        """Half width of a central interval of the given level, in standard deviations.

        If trips are exchangeable, and centre and scale come from other trips than the scores, the k-th of n scores covers
        a new trip with a probability of at least k / (n + 1), whatever the distribution. The scores of a fit come from the
        trips of its centre and scale, so this is no guarantee. Levels in between are interpolated.

        Parameters
        ----------
        level : float
            Coverage of the interval, 0 to 1.

        Returns
        -------
        float
            Half width in standard deviations [1]; never falls with the level.
        """
        return float(self.factors(np.array(level)))

    def factors(self, level: FloatArray) -> FloatArray:
        """Compute `factor` for many levels at once.

        Parameters
        ----------
        level : ndarray
            Coverages, 0 to 1.

        Returns
        -------
        ndarray
            Half widths in standard deviations [1], shape of `level`.

        Examples
        --------
        >>> ConformalScores.from_errors([1.0, 0.5, 2.0]).factors(np.array([0.0, 0.5, 0.75])).tolist()
        [0.0, 1.0, 2.0]
        """
        n, rank = len(self.values), level * (len(self.values) + 1)
        within = np.interp(rank, np.arange(n + 1.0), self._from_zero)
        if (rank <= n).all():
            return np.asarray(within)
        beyond = self.values[-1] * t4_half_width(np.minimum(level, 1.0 - 1e-9)) / t4_half_width(n / (n + 1))
        return np.where(rank <= n, within, beyond)

    def probability(self, standardised: float) -> float:
        """Probability that the error is below `standardised` standard deviations: the inverse of `factor`.

        Parameters
        ----------
        standardised : float
            Limit of the error over its standard deviation [1].

        Returns
        -------
        float
            Probability, 0 to 1; 0.5 for a limit of 0.
        """
        return float(self.probabilities(np.array([standardised]))[0])

    def probabilities(self, standardised: FloatArray) -> FloatArray:
        """Compute `probability` for many limits at once.

        Parameters
        ----------
        standardised : ndarray
            Limits of the error over its standard deviation [1].

        Returns
        -------
        ndarray
            Probabilities, shape of `standardised`.

        Examples
        --------
        >>> ConformalScores.from_errors([1.0, 0.5, 2.0]).probabilities(np.array([-np.inf, 0.0, 1.0])).tolist()
        [0.0, 0.5, 0.75]
        """
        n, last = len(self.values), float(self.values[-1])
        size = np.abs(standardised)
        # equal scores make no step backwards
        level = np.interp(size, self._from_zero, np.arange(n + 1.0)) / (n + 1)
        beyond = size > last
        if beyond.any():
            level[beyond] = _t4_level(size[beyond] / last * t4_half_width(n / (n + 1))) if last > 0 else 1.0
        return np.asarray(0.5 + np.copysign(0.5 * level, standardised))

    def errors(self, normal: FloatArray) -> FloatArray:
        """Map values of a standard normal distribution to standardised errors of the same probability.

        Parameters
        ----------
        normal : ndarray
            Values of a standard normal distribution [1].

        Returns
        -------
        ndarray
            Errors over their standard deviation [1], shape of `normal`.

        Examples
        --------
        >>> ConformalScores.from_errors([1.0, 0.5, 2.0]).errors(np.array([-0.6744898, 0.0, 1.1503494])).round(6).tolist()
        [-1.0, 0.0, 2.0]
        """
        from scipy.special import erf

        return np.asarray(np.copysign(self.factors(erf(np.abs(normal) / math.sqrt(2.0))), normal))

    @cached_property
    def _from_zero(self) -> FloatArray:
        return np.concatenate(([0.0], self.values))


def _t4_level(half_width: FloatArray) -> FloatArray:
    """Probability between ``-half_width`` and ``half_width``, for a t distribution with four degrees of freedom; half widths above 0.

    It is ``s (3 - s²) / 2`` with ``s = t / sqrt(t² + 4)``, the integral of the density. `scipy.special` has the same for every
    number of degrees, but its import takes a tenth of the time of a first forecast.
    """
    s = 1.0 / np.sqrt(1.0 + (2.0 / half_width) ** 2)
    return np.asarray(0.5 * s * (3.0 - s**2))


def t4_half_width(level: Any) -> Any:
    """Half width of the central interval of a t distribution with four degrees of freedom: the inverse of `_t4_level`.

    `level` is 0 to less than 1. The cubic in `s` has the root ``2 sin(arcsin(level) / 3)``; Shaw (2006), Sampling Student's t
    distribution.
    """
    s = 2.0 * np.sin(np.arcsin(level) / 3.0)
    return 2.0 * s / np.sqrt(1.0 - s**2)
