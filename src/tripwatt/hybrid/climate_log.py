"""Logged power of climate control: the logged total, or heater plus air conditioner if both are logged and plausible."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.auditing.findings import array, has
from tripwatt.auditing.signals import blank_stuck_heater

CLIMATE_COLUMNS: Final = ("heating_power_w", "aircon_power_w")
CLIMATE_IN_ALL: Final = "climate_power_w"
TOLD_BY: Final = (*CLIMATE_COLUMNS, "requested_heating_power_w", CLIMATE_IN_ALL)
"""Columns that `logged_climate` reads; the requested power shows whether the heater's signal is stuck."""


def logged_climate(samples: pd.DataFrame, edges_s: FloatArray) -> FloatArray | None:
    """Mean electric power of heater and air conditioner between edges. O(samples).

    The logged total is preferred to the sum of the two columns.

    Parameters
    ----------
    samples : DataFrame
        Raw samples with `time_s` on the clock of the edges.
    edges_s : ndarray, shape (segments + 1,)

    Returns
    -------
    ndarray or None, shape (segments,)
        Mean power [W]; NaN if a segment was not logged for long enough. Returns None if the log has neither the total nor both
        columns, or if the heater's signal is stuck.

    Examples
    --------
    >>> log = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "heating_power_w": [0.0, 100.0, 300.0], "aircon_power_w": 50.0})
    >>> logged_climate(log, np.array([0.0, 1.0, 2.0, 3.0])).tolist()
    [100.0, 250.0, nan]
    """
    power = _climate_power(samples)
    if power is None or not np.isfinite(power).any():
        return None
    time = np.asarray(samples["time_s"], dtype=np.float64)
    step = np.diff(time)
    mean = 0.5 * (power[1:] + power[:-1])
    known = np.isfinite(mean) & (step <= np.diff(edges_s).max())
    sums = (running_sum(np.where(known, part, 0.0)) for part in (step, mean * step))
    covered, gained = (np.diff(np.interp(edges_s, time, total)) for total in sums)
    # the mean of a segment counts if half of its time is logged; a choice
    enough = covered >= 0.5 * np.diff(edges_s)
    return np.where(enough, gained / np.where(enough, covered, 1.0), np.nan)


def _climate_power(samples: pd.DataFrame) -> FloatArray | None:
    """Power of heater and air conditioner at each sample [W]; None if not logged."""
    if has(samples, CLIMATE_IN_ALL):
        return np.maximum(array(samples, CLIMATE_IN_ALL), 0.0)
    if not all(has(samples, name) for name in CLIMATE_COLUMNS):
        return None
    sound = blank_stuck_heater(samples, "")[0]
    heater, cooler = (np.maximum(array(sound, name), 0.0) for name in CLIMATE_COLUMNS)
    return np.asarray(heater + cooler)
