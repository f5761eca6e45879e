"""Tables of samples: measured energy and means over equal steps."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.units import WH_PER_J


def observed_cumulative_energy(samples: pd.DataFrame) -> FloatArray | None:
    """Cumulative energy at the battery terminals [Wh], trapezoid of voltage times current.

    Samples in which voltage or current is missing are bridged by the trapezoid between their neighbours. A log that
    has neither may bring a column `observed_energy_wh` of its own, such as one from the state of charge.

    Returns
    -------
    ndarray, shape (samples,), or None
        Starts at 0; None without a measurement.
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
    """Energy at the battery terminals over all samples [Wh], None without voltage and current."""
    cumulative = observed_cumulative_energy(samples)
    return None if cumulative is None or not len(cumulative) else float(cumulative[-1])


def table_of(columns: Mapping[str, FloatArray]) -> pd.DataFrame:
    """Columns of floats of one length as one array of numbers, much faster than column by column.

    Examples
    --------
    >>> table_of({"time_s": np.arange(2.0), "speed_m_s": np.ones(2)}).shape
    (2, 2)
    """
    names = _names(tuple(columns))
    if not columns:
        return pd.DataFrame(columns=names)
    return pd.DataFrame(np.array(list(columns.values()), dtype=np.float64).T, columns=names)


@lru_cache(maxsize=64)
def _names(columns: tuple[str, ...]) -> pd.Index:
    return pd.Index(columns, dtype=object)  # a string index is slow to look up


def bin_means(
    time: FloatArray, columns: Mapping[str, FloatArray], step_s: float
) -> tuple[int, dict[str, FloatArray]]:
    """Number of bins of `step_s` seconds, and the mean of each column over each; see `resample`. O(samples).

    Parameters
    ----------
    time : ndarray, shape (samples,)
        Increasing times [s] since the first sample; they stand for the column `time_s`.
    """
    bin_index = np.floor(time / step_s + 1e-6).astype(np.int64)
    n_bins = int(bin_index[-1]) + 1
    count = np.bincount(bin_index, minlength=n_bins)
    some_empty = bool((count == 0).any())
    centre = (np.arange(n_bins) + 0.5) * step_s
    means: dict[str, FloatArray] = {}
    for name, values in columns.items():
        values = time if name == "time_s" else values
        known = np.isfinite(values)
        complete = bool(known.all())
        total = np.bincount(
            bin_index, weights=values if complete else np.where(known, values, 0.0), minlength=n_bins
        )
        number = count if complete else np.bincount(bin_index[known], minlength=n_bins)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / number
        if name == "time_s":
            mean = np.where(count > 0, mean, centre)
        elif some_empty and number.any():
            empty = count == 0
            usable = number > 0
            mean[empty] = np.interp(centre[empty], centre[usable], mean[usable])
        means[name] = mean
    return n_bins, means
