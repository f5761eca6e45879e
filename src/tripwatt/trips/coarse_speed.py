"""Speed from a coarse log: values that are held over several rows, and values in whole km/h or mph.

Used directly, held and rounded values are steps, with accelerations and standstills that the car never had. The log itself shows
how long values are held and how they are rounded.

Held values. A car changes its speed all the time, so a change of more than one step of rounding shows when the value was
refreshed. The median time for which a value lasted before such a change is the time ``H`` between refreshes. A value that lasted
``2 H`` or longer was refreshed with the same value until ``H`` before the next one, by a standing car or in a steady drive. Only
the refreshed values count. Between them the speed is a monotone cubic without extremes (Fritsch and Carlson, SIAM J. Numer. Anal.
17, 1980, in the form of SciPy's `PchipInterpolator`).

Rounded values. With the step ``r``, each value has an error of variance ``r^2 / 12``. The acceleration is taken as a random walk
of intensity ``q``, as in the smoothing spline of Wahba (J. R. Stat. Soc. B 40, 1978):

    minimise  sum (x_i - y_i)^2 / (r^2 / 12)  +  sum (a_i - a_(i-1))^2 / (q d_i)

over the speeds ``x_i``, with ``y_i`` the values of the log, ``a_i`` the accelerations between two of them and ``d_i`` the time
from the middle of one interval to the middle of the next. The solution of this system with five diagonals is then limited to within
half a step of each value.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.trips.energy import resolution

FINE_M_S: Final = 0.15
"""Largest step of rounding [m/s] that is ignored: it changes the energy of a drive by less than 0.1 %."""


FEWEST: Final = 10
"""Smallest number of different values for a step, and of refreshes for a time between them; fewer may be chance."""


LONGEST_HOLD_S: Final = 30.0
"""Longest time between refreshes [s] that is bridged; in a longer one a car may stop and start again."""


JERK_INTENSITY: Final = 0.1
"""Intensity of the random walk of a car's acceleration [m^2/s^5]: the value among 0.03, 0.1, 0.3, 1, 3 and 10 with the least error of
energy on TUM trips in whole km/h and mph every second."""


@dataclass(frozen=True, slots=True)
class Rebuilt:
    """Speed of a log after held and rounded values are replaced.

    Attributes
    ----------
    speed_m_s : ndarray, shape (samples,)
        Speed [m/s], NaN where it is missing.
    held_s : float
        Usual time between two refreshes of the value [s]; 0 if no held values were replaced.
    step_m_s : float
        Step of rounding [m/s]; 0 if no rounded values were replaced.
    """

    speed_m_s: FloatArray
    held_s: float
    step_m_s: float


def rebuild_speed(time_s: FloatArray, speed_m_s: FloatArray, filled: FloatArray | None = None) -> Rebuilt:
    """Rebuild the speed of a coarse log; return the speed of a fine log unchanged. O(samples log(samples)).

    The result is within half a step of rounding of every refreshed value, 0 while the car stands, and not negative unless
    the log is. Rows whose time does not increase keep their value.

    Parameters
    ----------
    time_s : ndarray, shape (samples,)
        Time [s].
    speed_m_s : ndarray, shape (samples,)
        Speed as logged [m/s], NaN where it is missing.
    filled : ndarray, shape (samples,), optional
        The speed with missing values filled by the last known ones, as far as that is allowed. The result is interpolated
        linearly there, but is 0 if the last known value is 0.

    Returns
    -------
    Rebuilt
        Speed, time between refreshes and step of rounding.

    Examples
    --------
    >>> time = np.arange(0.0, 300.0)
    >>> true = 12.0 + 8.0 * np.sin(time / 20.0)
    >>> rebuilt = rebuild_speed(time, true[5 * (np.arange(300) // 5)])
    >>> rebuilt.held_s, rebuilt.step_m_s, bool(np.abs(rebuilt.speed_m_s - true)[:295].max() < 0.1)
    (5.0, 0.0, True)
    >>> rebuild_speed(time, true).speed_m_s is true
    True
    """
    speed = speed_m_s if filled is None else np.where(filled == 0.0, 0.0, speed_m_s)
    rows = np.flatnonzero(np.isfinite(time_s) & np.isfinite(speed))
    rows = rows[np.diff(np.maximum.accumulate(time_s[rows]), prepend=-np.inf) > 0.0]
    time, logged = time_s[rows], speed[rows]
    held, step = refresh_time(time, logged), _rounding_step(logged)
    held = held if held <= LONGEST_HOLD_S else 0.0
    at, value = _refreshed(time, logged, held) if held else (time, logged)
    # 4.0: longest step between samples [s] for smoothing; in a longer one the speed changes by much more
    # than the rounding
    if step and float(np.median(np.diff(at))) > 4.0:
        step = 0.0
    if held or step:
        value, speed = _smoothed(at, value, step) if step else value, speed.copy()
        speed[rows] = _monotone(at, value, time) if held else value
    if filled is not None and len(rows):
        missing = np.isnan(speed) & np.isfinite(filled)
        speed = np.where(missing, np.interp(time_s, time, speed[rows]), speed)
    return Rebuilt(speed, held, step)


def refresh_time(time_s: FloatArray, speed_m_s: FloatArray) -> float:
    """Return the usual time between two refreshes of the speed of the moving car [s]; 0 if each row is a measurement.

    O(samples log(samples)).

    Parameters
    ----------
    time_s : ndarray, shape (samples,)
        Increasing times [s].
    speed_m_s : ndarray, shape (samples,)
        Speed [m/s], without missing values.

    Returns
    -------
    float
        Median time for which a value lasted before it changed by more than one step of rounding.

    Examples
    --------
    >>> time = np.arange(0.0, 300.0)
    >>> speed = 12.0 + 8.0 * np.sin(time / 20.0)
    >>> refresh_time(time, speed), refresh_time(time, speed[10 * (np.arange(300) // 10)])
    (0.0, 10.0)
    """
    starts = np.flatnonzero(np.diff(speed_m_s, prepend=np.nan) != 0.0)
    value = speed_m_s[starts]
    min_change = 1.01 * max(_rounding_step(speed_m_s), FINE_M_S)
    moved_on = (np.abs(np.diff(value)) > min_change) & (value[:-1] > 0.0)
    stood = np.diff(time_s[starts])[moved_on]
    usual = float(np.median(stood)) if len(stood) >= FEWEST else 0.0
    # 0.5: shortest time between refreshes [s] that counts; a shorter one disappears in the means over a
    # second of a simulation
    # 1.5: a value that lasts one row is no held value
    fresh = usual < 0.5 or usual < 1.5 * float(np.median(np.diff(time_s)))
    return 0.0 if fresh else usual


def _rounding_step(speed: FloatArray) -> float:
    """Return the step of rounding [m/s]; 0 if the step is fine, or the speed has too few different values."""
    step = resolution(speed)
    # 1.0: largest step of rounding [m/s]; a larger one only shows that a log has few different values
    return step if FINE_M_S < step <= 1.0 and len(np.unique(speed)) >= FEWEST else 0.0


def _refreshed(time: FloatArray, speed: FloatArray, held: float) -> tuple[FloatArray, FloatArray]:
    """Return times and values of the measurements: each change, and the last refresh of a value that lasted long."""
    starts = np.flatnonzero(np.diff(speed, prepend=np.nan) != 0.0)
    last = np.append(time[starts[1:]], time[-1]) - held
    rested = last - time[starts] > held - 0.5 * float(np.median(np.diff(time)))
    at = np.append(time[starts], last[rested])
    order = np.argsort(at)
    return at[order], np.append(speed[starts], speed[starts[rested]])[order]


def _monotone(at: FloatArray, value: FloatArray, time: FloatArray) -> FloatArray:
    from scipy.interpolate import PchipInterpolator  # scipy is slow to import

    curve = PchipInterpolator(at, value)(np.minimum(time, at[-1]))
    return np.asarray(np.maximum(curve.round(12), value.min()))  # the last digits are not monotone


def _smoothed(time: FloatArray, speed: FloatArray, step: float) -> FloatArray:
    from scipy.linalg import solveh_banded

    gap = np.maximum(np.diff(time), 0.05)  # a shorter gap would make the system singular
    parts = 1.0 / gap[:-1], -1.0 / gap[:-1] - 1.0 / gap[1:], 1.0 / gap[1:]
    weight = step**2 / 12.0 / (0.5 * JERK_INTENSITY * (gap[:-1] + gap[1:]))
    # 1e6: weight of a standstill over that of a rounded value
    trust = np.where(speed == 0.0, 1e6, 1.0)
    bands = np.vstack((np.zeros((2, len(time))), trust))
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)):
        bands[2 + i - j, j : len(time) - 2 + j] += weight * parts[i] * parts[j]
    half = np.where(speed == 0.0, 0.0, 0.5 * step)
    return np.asarray(np.clip(solveh_banded(bands, trust * speed), speed - half, speed + half))
