"""Elevation that a logger interpolated in time, put where the car was."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, distance_driven

FIX_TOLERANCE_M: Final = 0.016
"""A height interpolated between two fixes and rounded to 0.01 m lies this close to the straight line."""
LEAST_BETWEEN_FIXES_S: Final = 30.0
"""A measured height changes its slope more often than this."""


def elevation_over_distance(time_s: FloatArray, speed_m_s: FloatArray, elevation_m: FloatArray) -> FloatArray:
    """Elevation interpolated over distance between the fixes that a log shows. O(samples x fixes).

    Some logs have a fix of the height every few minutes and straight lines in time between them: a car that waits at a
    light then seems to climb. The fixes are where the lines meet. A height that is no such line is given back as it is.

    Parameters
    ----------
    time_s, speed_m_s, elevation_m : ndarray, shape (samples,)
        Missing elevations (NaN) stay missing; a missing speed counts as standing.

    Returns
    -------
    ndarray, shape (samples,)

    Examples
    --------
    >>> time = np.arange(0.0, 181.0)
    >>> speed = np.where(time < 90.0, 0.0, 10.0)
    >>> elevation_over_distance(time, speed, time / 10.0)[[0, 80, 135, 180]].round(2).tolist()
    [0.0, 0.0, 9.05, 18.0]
    """
    known = np.flatnonzero(np.isfinite(elevation_m))
    if len(known) < 3:
        return elevation_m
    time, height = time_s[known], elevation_m[known]
    fixes = _fixes(time, height, int((time[-1] - time[0]) / LEAST_BETWEEN_FIXES_S))
    if fixes is None:
        return elevation_m
    speed = np.nan_to_num(speed_m_s)
    driven = distance_driven(time_s, speed)[known]
    filled = elevation_m.copy()
    filled[known] = np.interp(driven, driven[fixes], height[fixes])
    return filled


def _fixes(time: FloatArray, height: FloatArray, most: int) -> IntArray | None:
    """Numbers of the samples between which straight lines in time hold (Douglas and Peucker 1973); None for more lines."""
    kept = {0, len(time) - 1}
    spans = [(0, len(time) - 1)]
    while spans:
        if len(kept) - 1 > most:
            return None
        a, b = spans.pop()
        if b - a < 2:
            continue
        part = slice(a, b + 1)
        line = height[a] + (height[b] - height[a]) * (time[part] - time[a]) / (time[b] - time[a])
        off = np.abs(height[part] - line)
        worst = a + int(off.argmax())
        if off[worst - a] > FIX_TOLERANCE_M:
            kept.add(worst)
            spans += [(a, worst), (worst, b)]
    return np.array(sorted(kept), dtype=np.int64)
