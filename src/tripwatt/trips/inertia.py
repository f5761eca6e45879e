"""Check of a log by Newton's second law: the mass at which its power fits its acceleration."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray

MOVING_M_S: Final = 1.0
WRONG_SIGN: Final = -0.3
"""Correlation of power with speed times acceleration below which the current has the wrong sign."""


def apparent_mass(time: FloatArray, speed: FloatArray, power: FloatArray) -> tuple[float, float] | None:
    """Fit battery power over speed times acceleration; return the slope [kg] and the correlation.

    The slope is mass over efficiency, because power = ... + mass x speed x acceleration / efficiency. A speed in a wrong unit
    enters squared, a power in a wrong unit or with a wrong sign linearly, so the slope is then no possible mass of a car. Means
    over bins of a second reduce the noise of the differences.

    Parameters
    ----------
    time, speed, power : ndarray, shape (samples,)
        [s], [m/s] and [W, + discharges]; missing values are left out.

    Returns
    -------
    (float, float) or None
        None if less than two minutes of motion are left, or power or acceleration is constant.

    Examples
    --------
    >>> time = np.arange(0.0, 600.0)
    >>> speed = 15.0 + 5.0 * np.sin(time / 8.0)
    >>> mass, correlation = apparent_mass(time, speed, 1500.0 * speed * np.gradient(speed, time) + 3000.0)
    >>> round(mass, -1), round(correlation, 2)
    (1500.0, 1.0)
    """
    known = np.isfinite(power) & np.isfinite(speed) & np.isfinite(time)
    if known.sum() < 3:
        return None
    time, speed, power = time[known], speed[known], power[known]
    second = np.floor(time - time[0] + 1e-6).astype(np.int64)
    _, index, count = np.unique(second, return_inverse=True, return_counts=True)
    t, v, p = (np.bincount(index, weights=x) / count for x in (time, speed, power))
    span = t[2:] - t[:-2]
    inertia = 0.5 * (v[2:] ** 2 - v[:-2] ** 2) / span
    moving = (v[1:-1] > MOVING_M_S) & (span < 10.0)  # over a longer span the acceleration is unknown
    if float(np.sum(0.5 * span[moving])) < 120.0:  # two minutes of motion
        return None
    x = inertia[moving] - inertia[moving].mean()
    y = p[1:-1][moving] - p[1:-1][moving].mean()
    variance = float(x @ x)
    if variance <= 0.0 or not np.any(y):
        return None
    return float(x @ y) / variance, float(x @ y) / float(np.sqrt(variance * (y @ y)))
