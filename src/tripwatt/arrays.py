"""Types of arrays, small functions of arrays and sequences, and linear recursions without a loop over samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Final, TypeVar

import numpy as np
import numpy.typing as npt

Item = TypeVar("Item")
Key = TypeVar("Key")

FloatArray = npt.NDArray[np.float64]
"""Numbers."""

IntArray = npt.NDArray[np.int64]
"""Counts, row numbers and group numbers."""

BoolArray = npt.NDArray[np.bool_]
"""Masks."""

PerTrip = float | FloatArray
"""A number of one trip; for several trips a column of shape (trips, 1), for use with arrays of shape (trips, samples)."""


def running_sum(steps: npt.ArrayLike) -> FloatArray:
    """Cumulative sums of the steps with a 0 before them, shape (steps + 1,).

    Examples
    --------
    >>> running_sum([1.0, 2.0]).tolist()
    [0.0, 1.0, 3.0]
    """
    sums = np.zeros(np.size(steps) + 1)
    np.cumsum(steps, out=sums[1:])
    return sums


def changes(values: FloatArray) -> FloatArray:
    """Change from the value before along the last axis, 0 for the first, shape of `values`.

    Examples
    --------
    >>> changes(np.array([5.0, 6.0, 4.0])).tolist()
    [0.0, 1.0, -2.0]
    """
    since = np.zeros_like(values)
    np.subtract(values[..., 1:], values[..., :-1], out=since[..., 1:])
    return since


def distance_driven(time_s: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Distance [m] driven up to each sample, shape of `time_s`; the speed is linear between two samples.

    Examples
    --------
    >>> distance_driven(np.array([0.0, 2.0, 3.0]), np.array([0.0, 4.0, 4.0])).tolist()
    [0.0, 4.0, 8.0]
    """
    return running_sum(0.5 * (speed_m_s[1:] + speed_m_s[:-1]) * (time_s[1:] - time_s[:-1]))


def eigen(symmetric: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues, ascending, and eigenvectors of a symmetric matrix. O(n^3).

    LAPACK's fast algorithm (divide and conquer) fails on a few large matrices; then the slower QR iteration is used.

    Examples
    --------
    >>> eigen(np.diag([2.0, 1.0]))[0].tolist()
    [1.0, 2.0]
    """
    try:
        values, vectors = np.linalg.eigh(symmetric)
    except np.linalg.LinAlgError:
        from scipy.linalg import eigh  # scipy is slow to import

        values, vectors = eigh(symmetric, driver="ev")
    return np.asarray(values), np.asarray(vectors)


def covariance_factor(covariance: FloatArray) -> FloatArray:
    """Factor `L` of a covariance ``L @ L.T``, shape of the covariance, which may be singular and unsymmetric by rounding. O(n^3).

    Examples
    --------
    >>> covariance_factor(np.diag([4.0, 1.0])) ** 2 @ np.ones(2)
    array([4., 1.])
    """
    values, vectors = eigen(0.5 * (covariance + covariance.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def hold_last(time: FloatArray, values: FloatArray, hold_s: float) -> FloatArray:
    """Values in which a missing value (NaN) is replaced by the last known one, if that is at most `hold_s` old.

    Examples
    --------
    >>> hold_last(np.array([0.0, 5.0, 20.0]), np.array([1.0, np.nan, np.nan]), 10.0)
    array([ 1.,  1., nan])
    """
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    fresh = (last >= 0) & (time - time[np.maximum(last, 0)] <= hold_s)
    return np.where(fresh, values[np.maximum(last, 0)], np.nan)


def number_in(text: str) -> float:
    """The number that a text states, NaN if it states none.

    Examples
    --------
    >>> number_in(" 1.5 "), number_in("1,5")
    (1.5, nan)
    """
    try:
        return float(text)
    except ValueError:
        return math.nan


def by_key(items: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Items grouped by their key: keys in the order of their first item, items in their given order.

    Examples
    --------
    >>> by_key(["one", "two", "three"], len)
    {3: ['one', 'two'], 5: ['three']}
    """
    groups: dict[Key, list[Item]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


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
