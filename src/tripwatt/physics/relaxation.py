"""Linear recursions solved without a loop over samples, such as lumped temperatures that relax towards a target."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, PerTrip

LONGEST_BLOCK: Final = 200.0
"""Length of a block that is solved at once, in time constants; exp(200) is far from overflow and sums of one sign lose no digits."""


class Relaxation:
    """Solver of y[k] = y[k-1] e^(-step[k]) + target[k] (1 - e^(-step[k])) for all k at once.

    Factors that depend only on the steps are computed once, for repeated passes over trips with the same steps.

    Parameters
    ----------
    step : ndarray, shape (..., samples)
        Length of each interval in time constants, not negative.

    Examples
    --------
    >>> Relaxation(np.array([0.0, np.log(2.0)])).solve(0.0, np.array([1.0, 1.0]))
    array([0. , 0.5])
    """

    __slots__ = ("blocks", "gain", "growth", "rows")

    def __init__(self, step: FloatArray) -> None:
        elapsed = step.cumsum(axis=-1)
        self.blocks: list[tuple[int, int]] = []
        self.rows: list[Relaxation] = []
        self.gain = -np.expm1(-step)
        if elapsed[..., -1].max() < LONGEST_BLOCK:
            self.growth = np.exp(elapsed)
            self.gain *= self.growth
            return
        if step.ndim > 1:
            self.rows = [Relaxation(row) for row in step]
            return
        self.growth = np.ones_like(step)
        first = 0
        while first < len(step):
            before = elapsed[first] - step[first]
            last = int(np.searchsorted(elapsed, before + LONGEST_BLOCK))
            if last <= first:  # the interval is longer than a block: earlier states have decayed
                last = first + 1
                self.growth[first] = np.inf
            else:
                self.growth[first:last] = np.exp(elapsed[first:last] - before)
            self.blocks.append((first, last))
            first = last

    def solve(self, initial: PerTrip, target: FloatArray) -> FloatArray:
        """Return the state at the end of each interval, shape of `target`. O(samples).

        Parameters
        ----------
        initial : float or ndarray, shape (trips, 1)
            State before the first interval.
        target : ndarray, shape (samples,) or (trips, samples)
            Value towards which the state relaxes, constant over the interval that ends at the sample.
        """
        if self.rows:
            rows = self.rows * (len(target) // len(self.rows))
            starts = np.broadcast_to(initial, (len(target), 1))[:, 0].tolist()
            return np.stack([row.solve(*pair) for row, *pair in zip(rows, starts, target, strict=True)])
        if not self.blocks:
            return np.asarray(((self.gain * target).cumsum(axis=-1) + initial) / self.growth)
        result = np.empty_like(target)
        state = initial
        for first, last in self.blocks:
            growth = self.growth[first:last]
            if np.isinf(growth[0]):
                result[first] = target[first]
            else:
                gain = self.gain[first:last] * target[first:last]
                result[first:last] = (state + np.cumsum(gain * growth)) / growth
            state = float(result[last - 1])
        return result
