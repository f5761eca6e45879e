"""Linear recursions without a loop over samples: lumped temperatures relax towards what heats or cools them."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

LONGEST_BLOCK: Final = 200.0
"""Time constants solved at once; exp(200) is far from overflow and sums of one sign lose no digits."""


def relaxation(initial: float, target: FloatArray, step: FloatArray) -> FloatArray:
    """Solve y[k] = y[k-1] e^(-step[k]) + target[k] (1 - e^(-step[k])) for all k at once. O(samples).

    Parameters
    ----------
    initial : float
        State before the first interval.
    target : ndarray, shape (samples,)
        Where the state would settle, constant over the interval that ends at k.
    step : ndarray, shape (samples,)
        Length of each interval in time constants, not negative.

    Examples
    --------
    >>> relaxation(0.0, np.array([1.0, 1.0]), np.array([0.0, np.log(2.0)]))
    array([0. , 0.5])
    """
    elapsed = np.cumsum(step)
    gain = -np.expm1(-step) * target
    if elapsed[-1] < LONGEST_BLOCK:
        growth = np.exp(elapsed)
        return np.asarray((initial + np.cumsum(gain * growth)) / growth, dtype=np.float64)
    result = np.empty_like(target)
    first, state = 0, initial
    while first < len(target):
        before = elapsed[first] - step[first]
        last = int(np.searchsorted(elapsed, before + LONGEST_BLOCK))
        if last <= first:  # one interval longer than a block: what came before is forgotten
            state = float(target[first])
            result[first] = state
            first += 1
            continue
        growth = np.exp(elapsed[first:last] - before)
        result[first:last] = (state + np.cumsum(gain[first:last] * growth)) / growth
        state = float(result[last - 1])
        first = last
    return result
