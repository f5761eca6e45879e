"""How far to trust what a started trip says of its rest: learned from held-out trips, never more than the process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.forecast.process import Belief, Blocks, ResidualProcess, prior
from tripwatt.trips import FloatArray

FRACTIONS: Final = (0.1, 0.25, 0.5, 0.75, 0.9)
_DRAWS: Final = 500
_QUANTILE: Final = 0.25
EXACT_W2: Final = 1.0
"""Variance of a fully measured block's power: a matter of form."""


@dataclass(frozen=True, eq=False)
class Gain:
    """Share of the process's update of the rest that is taken, by the fraction of the trip that was measured.

    The share minimises the summed relative error of the rest over held-out trips, and is taken as the lower quartile
    of its bootstrap over trips: an update has to show that it helps. It lies between 0 (the departure forecast of the
    rest stands) and 1 (the process is right), and never falls as more is measured.

    Attributes
    ----------
    values : ndarray, shape (len(FRACTIONS),)

    Examples
    --------
    >>> Gain(np.array([0.0, 0.0, 0.5, 1.0, 1.0])).at(0.375)
    0.25
    """

    values: FloatArray

    @classmethod
    def of(
        cls, process: ResidualProcess, trips: Sequence[tuple[Blocks, FloatArray]], energies_wh: FloatArray
    ) -> Gain:
        """Learn from held-out trips. O(trips x blocks^3)."""
        values = [
            _best_share([_rest(process, blocks, left, fraction) for blocks, left in trips], energies_wh)
            for fraction in FRACTIONS
        ]
        return cls(np.maximum.accumulate(np.array(values)))

    def at(self, fraction: float) -> float:
        """Share at a measured fraction of the trip."""
        return float(np.interp(fraction, (0.0, *FRACTIONS), np.concatenate(([0.0], self.values))))

    def applied(self, belief: Belief, rest: FloatArray, fraction: float) -> Belief:
        """The belief with the mean of the rest (weights 0..1 of each block) taken by the share."""
        return Belief(belief.mean_w * (1.0 - rest * (1.0 - self.at(fraction))), belief.covariance_w2)


def _rest(
    process: ResidualProcess, blocks: Blocks, left_w: FloatArray, fraction: float
) -> tuple[float, float]:
    """Energy of the rest beyond the departure forecast [Wh]: as it was, and as the process expects it."""
    share = np.cumsum(blocks.step_s) / blocks.step_s.sum()
    seen = np.flatnonzero(share <= fraction + 1e-9)
    weights = np.eye(len(blocks))[seen]
    belief = prior(process, blocks).given(weights, left_w[seen], np.full(len(seen), EXACT_W2))
    hours = np.where(share > fraction + 1e-9, blocks.step_s / 3600.0, 0.0)
    return float(hours @ left_w), float(hours @ belief.mean_w)


def _best_share(rests: Sequence[tuple[float, float]], energies_wh: FloatArray) -> float:
    """Lower quartile over bootstrap draws of the minimiser of sum |truth - share * expected| / energy.

    The minimiser is a weighted median of the ratios truth / expected, held in 0..1. O(draws x trips).
    """
    truth, expected = np.array(rests).T
    weight = np.abs(expected) / energies_wh
    if weight.sum() <= 0.0:
        return 0.0
    ratio = np.divide(truth, expected, out=np.zeros_like(truth), where=expected != 0.0)
    order = np.argsort(ratio)
    ratio, weight = ratio[order], weight[order]
    n = len(ratio)
    counts = np.random.default_rng(0).multinomial(n, np.full(n, 1.0 / n), size=_DRAWS)
    running = np.cumsum(counts * weight, axis=1)
    middle = np.argmax(running >= 0.5 * running[:, -1:], axis=1)
    return float(np.clip(np.quantile(ratio[middle], _QUANTILE), 0.0, 1.0))
