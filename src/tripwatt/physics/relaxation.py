"""Linear recursions solved without a loop over samples, such as lumped temperatures that relax towards a target."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, PerTrip

LONGEST_BLOCK: Final = 200.0
"""Length of a block that is solved at once, in time constants; exp(200) is far from overflow and sums of one sign lose no digits."""


class Relaxation:
    """Solver of y[k] = y[k-1] e^(-step[k]) + target[k] (1 - e^(-step[k])) for all k at once, or of sums that fade.

    Factors that depend only on the steps are computed once, for repeated passes over trips with the same steps.

    Parameters
    ----------
    step : ndarray, shape (..., samples)
        Length of each interval in time constants, not negative.
    adds : bool
        Whether each value is added in full, in place of the part of a target that is reached.

    Examples
    --------
    >>> Relaxation(np.array([0.0, np.log(2.0)])).solve(0.0, np.array([1.0, 1.0]))
    array([0. , 0.5])
    >>> Relaxation(np.array([0.0, np.log(2.0)]), adds=True).solve(0.0, np.array([1.0, 1.0]))
    array([1. , 1.5])
    """

    __slots__ = ("gain", "growth", "halves")

    def __init__(self, step: FloatArray, *, adds: bool = False) -> None:
        elapsed, n = step.cumsum(axis=-1), step.shape[-1]
        self.halves: tuple[Relaxation, ...] = ()
        if n > 1 and elapsed[..., -1].max() >= LONGEST_BLOCK:
            self.halves = tuple(Relaxation(half, adds=adds) for half in np.split(step, [n // 2], axis=-1))
            return
        # a longer interval leaves nothing of earlier states
        self.growth = np.exp(np.minimum(elapsed, LONGEST_BLOCK))
        self.gain = self.growth if adds else -np.expm1(-step) * self.growth

    def solve(self, initial: PerTrip, target: FloatArray) -> FloatArray:
        """Return the state at the end of each interval, shape of `target`. O(samples).

        Parameters
        ----------
        initial : float or ndarray, shape (trips, 1)
            State before the first interval.
        target : ndarray, shape (samples,) or (trips, samples)
            Value towards which the state relaxes, constant over the interval that ends at the sample.
        """
        if self.halves:
            first, second = self.halves
            early, late = np.split(target, [target.shape[-1] // 2], axis=-1)
            before = first.solve(initial, early)
            return np.concatenate((before, second.solve(before[..., -1:], late)), axis=-1)
        return np.asarray(((self.gain * target).cumsum(axis=-1) + initial) / self.growth)
