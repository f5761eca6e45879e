"""Speed from a coarse log: values that are held over several rows, and values in whole km/h or mph.

Taken as they stand, held and rounded values are steps: accelerations and standstills that the car never had. Two facts are
found in the log itself.

Held values. A car changes its speed all the time, so a change of more than one step of rounding shows when the value was
refreshed. The median time for which a value stood before such a change is the time ``H`` between refreshes. A value that stood
for ``2 H`` or longer was refreshed with the same value until ``H`` before the next one: a standing car, or a steady drive. Only
the refreshed values count. Between them the speed is a monotone cubic (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980, in the
form of SciPy's `PchipInterpolator`): it has no extremes of its own.

Rounded values. With the step ``r``, each value has an error of variance ``r^2 / 12``. The acceleration is taken as a random walk
of intensity ``q``, as in the smoothing spline of Wahba (J. R. Stat. Soc. B 40, 1978):

    minimise  sum (x_i - y_i)^2 / (r^2 / 12)  +  sum (a_i - a_(i-1))^2 / (q d_i)

over the speeds ``x_i``, with ``y_i`` the values of the log, ``a_i`` the accelerations between two of them and ``d_i`` the time
from the middle of one interval to that of the next. It is a system with five diagonals. The solution is then cut to within half a
step of each value.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.trips.energy import resolution

FINE_M_S: Final = 0.15
"""Rounding up to this step [m/s] changes the energy of a drive by less than 0.1 %."""

COARSEST_M_S: Final = 1.0
"""A longer step [m/s] is that of a few values that a log happens to have."""

FEWEST_VALUES: Final = 10
"""A step, or a time between refreshes, of fewer different values is a coincidence."""

SHORTEST_HOLD_S: Final = 0.5
"""Shorter holding disappears in the means over seconds of a simulation."""

JERK_INTENSITY: Final = 0.1
"""Intensity of the random walk of a car's acceleration [m^2/s^5]: the one of 0.03, 0.1, 0.3, 1, 3 and 10 that leaves the least error of
energy on TUM trips in whole km/h and mph every second."""

_ROWS_HELD: Final = 1.5
_SHORTEST_STEP_S: Final = 0.05
_CERTAIN: Final = 1e6


@dataclass(frozen=True, slots=True)
class Rebuilt:
    """A speed without the steps of its logger.

    Attributes
    ----------
    speed_m_s : ndarray, shape (samples,)
        Speed [m/s]; missing where it was missing and not bridged.
    held_s : float
        Usual time between two refreshes of the value [s], 0 where each row is a measurement.
    step_m_s : float
        Step of rounding [m/s], 0 where it is fine.
    """

    speed_m_s: FloatArray
    held_s: float
    step_m_s: float


def rebuild_speed(time_s: FloatArray, speed_m_s: FloatArray, bridged_s: float = 0.0) -> Rebuilt:
    """Rebuild the speed of a coarse log from its measurements; that of a fine log stays as it is. O(samples log(samples)).

    The result is within half a step of rounding of every refreshed value, is 0 where the car stands, and is never negative where
    the log is not. Rows whose time does not increase keep their value.

    Parameters
    ----------
    time_s : ndarray, shape (samples,)
        Time [s].
    speed_m_s : ndarray, shape (samples,)
        Speed as logged [m/s], NaN where it is missing.
    bridged_s : float
        Missing values between two samples that are no more than this apart [s] are bridged by a line. A car that stands at the first
        one stands until the usual step before the second one.

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
    known = np.isfinite(time_s) & np.isfinite(speed_m_s)
    latest = np.maximum.accumulate(np.where(known, time_s, -np.inf))
    rows = np.flatnonzero(known & (latest > np.append(-np.inf, latest)[: len(latest)]))
    time, speed = time_s[rows], speed_m_s[rows]
    held, step = refresh_time(time, speed), _rounding_step(speed)
    rebuilt = speed_m_s
    if held or step:
        rebuilt = speed_m_s.copy()
        rebuilt[rows] = _rebuilt(time, speed, held, step)
    if bridged_s > 0.0 and len(rows) > 1 and not known.all():
        rebuilt = _bridged(time_s, rebuilt, rows, bridged_s, held)
    return Rebuilt(rebuilt, held, step)


def refresh_time(time_s: FloatArray, speed_m_s: FloatArray) -> float:
    """Usual time between two refreshes of the speed of the moving car [s]; 0 where each row is a measurement. O(samples).

    Parameters
    ----------
    time_s : ndarray, shape (samples,)
        Increasing times [s].
    speed_m_s : ndarray, shape (samples,)
        Speed [m/s], without missing values.

    Returns
    -------
    float
        Median time for which a value stood before it changed by more than one step of rounding.

    Examples
    --------
    >>> time = np.arange(0.0, 300.0)
    >>> speed = 12.0 + 8.0 * np.sin(time / 20.0)
    >>> refresh_time(time, speed), refresh_time(time, speed[10 * (np.arange(300) // 10)])
    (0.0, 10.0)
    """
    if len(time_s) < FEWEST_VALUES:
        return 0.0
    starts = _starts(speed_m_s)
    value = speed_m_s[starts]
    moved_on = (np.abs(np.diff(value)) > 1.01 * max(_rounding_step(speed_m_s), FINE_M_S)) & (value[:-1] > 0.0)
    stood = np.diff(time_s[starts])[1:][moved_on[1:]]
    if len(stood) < FEWEST_VALUES:
        return 0.0
    usual = float(np.median(stood))
    row = float(np.median(np.diff(time_s)))
    return usual if usual >= max(_ROWS_HELD * row, SHORTEST_HOLD_S) else 0.0


def _starts(speed: FloatArray) -> IntArray:
    return np.flatnonzero(np.append(True, np.diff(speed) != 0.0))


def _rounding_step(speed: FloatArray) -> float:
    """Step of rounding [m/s]; 0 where it is fine or of too few values."""
    step = resolution(speed)
    coarse = FINE_M_S < step <= COARSEST_M_S and len(np.unique(speed)) >= FEWEST_VALUES
    return step if coarse else 0.0


def _rebuilt(time: FloatArray, speed: FloatArray, held: float, step: float) -> FloatArray:
    at, value = _refreshed(time, speed, held) if held else (time, speed)
    if step:
        value = _smoothed(at, value, step)
    if not held:
        return value
    from scipy.interpolate import PchipInterpolator  # scipy is slow to import

    between = PchipInterpolator(at, value)(np.minimum(time, at[-1]))
    return np.asarray(np.maximum(between, value.min()), dtype=np.float64)  # monotone but for the last digit


def _refreshed(time: FloatArray, speed: FloatArray, held: float) -> tuple[FloatArray, FloatArray]:
    """Times and values of the measurements: each change, and the last refresh of a value that stood for long."""
    starts = _starts(speed)
    rest = np.append(time[starts[1:]], time[-1]) - held
    slack = 0.5 * float(np.median(np.diff(time)))
    rested = rest - time[starts] >= held - slack
    at = np.append(time[starts], rest[rested])
    order = np.argsort(at, kind="stable")
    return at[order], np.append(speed[starts], speed[starts][rested])[order]


def _smoothed(time: FloatArray, speed: FloatArray, step: float) -> FloatArray:
    from scipy.linalg import solveh_banded

    gap = np.maximum(np.diff(time), _SHORTEST_STEP_S)
    first, last = 1.0 / gap[:-1], 1.0 / gap[1:]
    middle = -(first + last)
    weight = step**2 / 12.0 / (0.5 * JERK_INTENSITY * (gap[:-1] + gap[1:]))
    trust = np.where(speed == 0.0, _CERTAIN, 1.0)
    bands = np.zeros((3, len(time)))
    bands[2] = trust
    for shift, part in enumerate((first, middle, last)):
        bands[2, shift : len(time) - 2 + shift] += weight * part**2
    bands[1, 1:-1] += weight * first * middle
    bands[1, 2:] += weight * middle * last
    bands[0, 2:] += weight * first * last
    half = np.where(speed == 0.0, 0.0, 0.5 * step)
    smooth = solveh_banded(bands, trust * speed)
    return np.asarray(np.clip(smooth, speed - half, speed + half), dtype=np.float64)


def _bridged(time: FloatArray, speed: FloatArray, rows: IntArray, longest: float, held: float) -> FloatArray:
    at, value = time[rows], speed[rows]
    usual = max(held, float(np.median(np.diff(at))))
    stands = np.flatnonzero((value[:-1] == 0.0) & (np.diff(at) > 2.0 * usual))
    after = np.clip(np.searchsorted(at, time), 1, len(at))
    apart = np.append(at, np.inf)[after] - at[after - 1]
    apart = np.where(after == len(at), time - at[-1], apart)
    line = np.interp(
        time, np.insert(at, stands + 1, at[stands + 1] - usual), np.insert(value, stands + 1, 0.0)
    )
    return np.where(np.isnan(speed) & (time >= at[0]) & (apart <= longest), line, speed)
