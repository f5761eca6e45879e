"""Measured energy of a drive, by the trapezoidal rule from voltage times current, and its standard error.

A logged power has two errors: it is rounded to a step ``r``, and it is unknown between samples. The error of rounding has the
variance ``r^2 / 12`` and is the same while the logged value is the same; with ``w_i`` the weight [s] of sample ``i`` in the trapezoid,

    var_rounding = r^2 / 12 * sum over runs of equal values of (sum of w_i in the run)^2,

which is ``r^2 / 12 * T * tau`` for a drive of the duration ``T`` with ``tau`` the mean time that a value lasts. For a power with the
variance ``s^2`` and the correlation ``exp(-lag / t)``, the trapezoid between two samples ``d`` apart has the error variance

    s^2 (2 t^2 (x - 1 + e) - 2 d t (1 - e) + d^2 (1 + e) / 2),   x = d / t,   e = exp(-x),

and the covariance ``s^2 a a'`` with the error of the next interval, where ``a = t (1 - e) - d (1 + e) / 2`` and ``a'`` is the same
for the next interval. Both are integrals of the correlation. `POWER_TIME_S` is ``t``; ``s^2`` is the variance of the logged power less
that of its rounding.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.units import WH_PER_J

POWER_TIME_S: Final = 4.0
"""Correlation time of a car's battery power: that of the TUM trips falls to 0.75 in 1 s and to 0.25 in 5 s."""

NEGLIGIBLE_SHARE: Final = 0.02
"""Largest standard error over the energy that is neglected: with the 6 % error of a good forecast it widens an interval by a twentieth."""


def observed_cumulative_energy(samples: pd.DataFrame | Mapping[str, FloatArray]) -> FloatArray | None:
    """Cumulative energy at the battery terminals [Wh], by the trapezoidal rule from voltage times current.

    The power of samples without voltage or current is interpolated. A log that lacks one of both columns may have a column
    `observed_energy_wh` instead: a counter of energy, or an energy from the state of charge.

    Parameters
    ----------
    samples : DataFrame or mapping of str to ndarray
        One row per sample: `time_s` [s], and `voltage_v` [V] and `current_a` [A, positive for discharge], or
        `observed_energy_wh` [Wh].

    Returns
    -------
    ndarray, shape (samples,), or None
        Energy, which starts at 0; None without a measurement.

    Examples
    --------
    >>> drive = pd.DataFrame({"time_s": [0.0, 36.0, 72.0], "voltage_v": 400.0, "current_a": [10.0, 10.0, 20.0]})
    >>> observed_cumulative_energy(drive)
    array([  0.,  40., 100.])
    """
    if "voltage_v" not in samples or "current_a" not in samples:
        if "observed_energy_wh" not in samples or not len(samples["observed_energy_wh"]):
            return None
        counted = np.asarray(samples["observed_energy_wh"], dtype=np.float64)
        return np.asarray(counted - counted[np.argmax(np.isfinite(counted))], dtype=np.float64)
    time = np.asarray(samples["time_s"], dtype=np.float64)
    voltage, current = (np.asarray(samples[name], dtype=np.float64) for name in ("voltage_v", "current_a"))
    with np.errstate(invalid="ignore", over="ignore"):  # a log may hold anything until it is audited
        power = voltage * current
        known = np.isfinite(power)
        if not known.any():
            return None
        if not known.all():
            power = np.interp(time, time[known], power[known])
        energy_j = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time))))
    return np.asarray(energy_j * WH_PER_J, dtype=np.float64)


def observed_energy(samples: pd.DataFrame) -> float | None:
    """Energy at the battery terminals over all samples [Wh]; None without a measurement.

    Parameters
    ----------
    samples : DataFrame
        As for `observed_cumulative_energy`.

    Returns
    -------
    float or None
        Energy taken from the battery [Wh], negative if more was charged than discharged.

    Examples
    --------
    >>> drive = pd.DataFrame({"time_s": [0.0, 36.0, 72.0], "voltage_v": 400.0, "current_a": [10.0, 10.0, 20.0]})
    >>> observed_energy(drive)
    100.0
    >>> observed_energy(drive[["time_s"]]) is None
    True
    """
    cumulative = observed_cumulative_energy(samples)
    return None if cumulative is None or not len(cumulative) else float(cumulative[-1])


def observed_energy_std(samples: pd.DataFrame) -> float | None:
    """Standard error of the energy [Wh], due to rounding and the time between samples. O(samples).

    A counter of energy is rounded at both ends: with a step ``r`` of its values, the standard error is ``r / sqrt(6)``.

    Returns
    -------
    float or None
        None without a measurement, or if the error is at most `NEGLIGIBLE_SHARE` of the energy.

    Examples
    --------
    >>> time = np.arange(0.0, 1200.0, 5.0)
    >>> power = 1000.0 * np.round(3.0 + 8.0 * np.sin(time))
    >>> log = pd.DataFrame({"time_s": time, "voltage_v": 400.0, "current_a": power / 400.0})
    >>> round(observed_energy_std(log))
    55
    """
    if not {"time_s", "voltage_v", "current_a"} <= set(samples.columns):
        counted = observed_cumulative_energy(samples)
        if counted is None:
            return None
        std_wh = resolution(counted) / np.sqrt(6.0)
        return float(std_wh) if std_wh > NEGLIGIBLE_SHARE * abs(counted[-1]) else None
    columns = samples[["time_s", "voltage_v", "current_a"]].to_numpy(dtype=np.float64)
    time, voltage, current = columns[np.isfinite(columns).all(axis=1)].T
    with np.errstate(over="ignore", invalid="ignore"):  # a log may hold anything until it is audited
        power = voltage * current
        if len(time) < 2 or not (np.isfinite(power).all() and (np.diff(time) > 0.0).all()):
            return None
        rounding = _rounding_error(power, voltage, current)
        energy_j = float(np.trapezoid(power, time))
        variance = _of_rounding(time, power, rounding)
        variance += _of_sampling(time, max(float(power.var() - np.mean(rounding**2)), 0.0))
    std_j = float(np.sqrt(variance))
    return std_j * WH_PER_J if std_j > NEGLIGIBLE_SHARE * abs(energy_j) else None


def resolution(values: FloatArray) -> float:
    """Step to which values were rounded: the largest number of which all their differences are multiples; 0 if there is none.

    Examples
    --------
    >>> resolution(np.array([3.0, 5.0, 10.0])), resolution(np.array([0.0, 0.25, np.pi])), resolution(np.array([7.0]))
    (1.0, 0.0, 0.0)
    """
    known = np.unique(values[np.isfinite(values)])
    if len(known) < 2:
        return 0.0
    # 1e-7: relative error of values that were converted from another unit
    tolerance = 1e-7 * max(float(np.abs(known).max()), 1e-300)
    gaps = np.diff(known)
    gaps = gaps[gaps > tolerance]
    step = float(gaps.min()) if len(gaps) else 0.0
    while step > 10.0 * tolerance:
        rest = np.abs(gaps - step * np.round(gaps / step))
        rest = rest[rest > tolerance]
        if not len(rest):
            return step
        step = float(rest.min())
    return 0.0


def _rounding_error(power: FloatArray, voltage: FloatArray, current: FloatArray) -> FloatArray:
    """Standard deviation of the rounding of each power [W], from the step of the power or else those of voltage and current."""
    step = resolution(power)
    if step > 0.0:
        return np.full(len(power), step / np.sqrt(12.0))
    steps = voltage * resolution(current), current * resolution(voltage)
    return np.asarray(np.hypot(*steps) / np.sqrt(12.0))


def _of_rounding(time: FloatArray, power: FloatArray, error: FloatArray) -> float:
    """Variance of the energy due to rounding [J^2]."""
    gaps = np.diff(time)
    counts_for = 0.5 * (np.append(gaps, 0.0) + np.append(0.0, gaps))
    starts = np.flatnonzero(np.append(True, np.diff(power) != 0.0))
    return float(np.sum(np.add.reduceat(counts_for * error, starts) ** 2))


def _of_sampling(time: FloatArray, variance_w2: float) -> float:
    """Variance of the energy due to the unknown power between samples [J^2]."""
    gap, t = np.diff(time), POWER_TIME_S
    x = gap / t
    e, rest = np.exp(-x), -np.expm1(-x)
    # a series for small x, for which the difference of large terms would lose its digits
    variances = np.where(
        x > 0.01,
        2.0 * t**2 * (x - rest) - 2.0 * gap * t * rest + 0.5 * gap**2 * (1.0 + e),
        gap**2 * x / 6.0,
    )
    shared = np.where(x > 0.01, t * rest - 0.5 * gap * (1.0 + e), -gap * x**2 / 12.0)
    return variance_w2 * max(float(variances.sum() + 2.0 * np.sum(shared[1:] * shared[:-1])), 0.0)
