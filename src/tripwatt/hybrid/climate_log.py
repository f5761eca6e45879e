"""Climate power as a log has it: heater and air conditioner, where both are logged and plausible."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.auditing.signals import blank_stuck_heater

CLIMATE_COLUMNS: Final = ("heating_power_w", "aircon_power_w")
TOLD_BY: Final = (*CLIMATE_COLUMNS, "requested_heating_power_w")
"""Columns that `logged_climate` reads: the requested power shows whether the heater's signal is stuck."""
LEAST_SHARE: Final = 0.5
"""Share of a segment's time that has to be logged before its mean counts."""


def logged_climate(samples: pd.DataFrame, edges_s: FloatArray) -> FloatArray | None:
    """Mean electric power of heater and air conditioner between edges. O(samples).

    Parameters
    ----------
    samples : DataFrame
        Raw samples with `time_s` on the clock of the edges.
    edges_s : ndarray, shape (segments + 1,)

    Returns
    -------
    ndarray or None, shape (segments,)
        [W]; NaN where a segment was not logged for long enough. None without both columns, or when the heater's signal
        is stuck: one of the two alone is not their sum.

    Examples
    --------
    >>> log = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "heating_power_w": [0.0, 100.0, 300.0], "aircon_power_w": 50.0})
    >>> logged_climate(log, np.array([0.0, 1.0, 2.0, 3.0])).tolist()
    [100.0, 250.0, nan]
    """
    if not all(name in samples and samples[name].notna().any() for name in CLIMATE_COLUMNS):
        return None
    sound = blank_stuck_heater(samples, "")[0]
    heater, cooler = (np.maximum(np.asarray(sound[name], dtype=np.float64), 0.0) for name in CLIMATE_COLUMNS)
    power = heater + cooler
    if not np.isfinite(power).any():
        return None
    time = np.asarray(samples["time_s"], dtype=np.float64)
    step = np.diff(time)
    mean = 0.5 * (power[1:] + power[:-1])
    known = np.isfinite(mean) & (step <= np.diff(edges_s).max())
    seconds = np.concatenate(([0.0], np.cumsum(np.where(known, step, 0.0))))
    energy = np.concatenate(([0.0], np.cumsum(np.where(known, mean * step, 0.0))))
    covered = np.diff(np.interp(edges_s, time, seconds))
    gained = np.diff(np.interp(edges_s, time, energy))
    enough = covered >= LEAST_SHARE * np.diff(edges_s)
    return np.where(enough, gained / np.where(enough, covered, 1.0), np.nan)
