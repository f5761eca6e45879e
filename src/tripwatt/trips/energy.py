"""Measured energy of a drive: the trapezoid of voltage times current."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.units import WH_PER_J


def observed_cumulative_energy(samples: pd.DataFrame) -> FloatArray | None:
    """Cumulative energy at the battery terminals [Wh], trapezoid of voltage times current.

    Samples in which voltage or current is missing are bridged by the trapezoid between their neighbours. A log that
    has neither may bring a column `observed_energy_wh` of its own, such as one from the state of charge.

    Parameters
    ----------
    samples : DataFrame
        One row per sample: `time_s` [s], and `voltage_v` [V] and `current_a` [A, positive for discharge], or
        `observed_energy_wh` [Wh].

    Returns
    -------
    ndarray, shape (samples,), or None
        Starts at 0; None without a measurement.

    Examples
    --------
    >>> drive = pd.DataFrame({"time_s": [0.0, 36.0, 72.0], "voltage_v": 400.0, "current_a": [10.0, 10.0, 20.0]})
    >>> observed_cumulative_energy(drive)
    array([  0.,  40., 100.])
    """
    if not {"voltage_v", "current_a"} <= set(samples.columns):
        if "observed_energy_wh" not in samples.columns or not len(samples):
            return None
        counted = np.asarray(samples["observed_energy_wh"], dtype=np.float64)
        return np.asarray(counted - counted[np.argmax(np.isfinite(counted))], dtype=np.float64)
    time = np.asarray(samples["time_s"], dtype=np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        power = np.asarray(samples["voltage_v"], dtype=np.float64) * np.asarray(
            samples["current_a"], dtype=np.float64
        )
    known = np.isfinite(power)
    if not known.any():
        return None
    if not known.all():
        power = np.interp(time, time[known], power[known])
    with np.errstate(invalid="ignore", over="ignore"):  # a log may hold anything until it is audited
        energy_j = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time))))
    return np.asarray(energy_j * WH_PER_J, dtype=np.float64)


def observed_energy(samples: pd.DataFrame) -> float | None:
    """Energy at the battery terminals over all samples [Wh], None without voltage and current.

    Parameters
    ----------
    samples : DataFrame
        As for `observed_cumulative_energy`.

    Returns
    -------
    float or None
        Energy taken from the battery [Wh], negative when more was charged than discharged.

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
