"""Rules on elevation and ambient temperature, which a trip may lack, and on the time between values of the speed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from tripwatt.arrays import distance_driven
from tripwatt.auditing.findings import Change, Finding, array, between, blanking, has, whole
from tripwatt.auditing.signals import MOVING_M_S
from tripwatt.trips import STEEPEST_GRADE
from tripwatt.trips.coarse_speed import LONGEST_HOLD_S, refresh_time
from tripwatt.trips.elevation import HEIGHT_NOISE_M, heights_of_a_road
from tripwatt.trips.messages import signal_name


@blanking
def mend_heights(samples: pd.DataFrame, trip_id: str) -> Iterator[Change]:
    """Note a height that never changes, and jumps of the height; replace heights that no road can have."""
    time, speed, logged = (array(samples, c) for c in ("time_s", "speed_m_s", "elevation_m"))
    known = np.flatnonzero(np.isfinite(logged) & np.isfinite(speed))
    if len(known) < 2:
        return
    time, height = time[known], logged[known]
    driven = distance_driven(time, speed[known])
    # 2000.0: distance over which no road keeps one height to the last digit
    if np.ptp(height) == 0.0 and driven[-1] > 2000.0:
        what = (
            f"elevation stays at {height[0]:g} m over {driven[-1] / 1000:.1f} km: the road is treated as flat"
        )
        yield "elevation_m", None, whole(samples, trip_id, what, "noted")
    step = np.abs(np.diff(height))
    jumps = np.flatnonzero(step > HEIGHT_NOISE_M + STEEPEST_GRADE * np.diff(driven))
    if len(jumps):
        what = f"elevation jumps {len(jumps)} times, by up to {step[jumps].max():.1f} m"
        finding = Finding(trip_id, float(time[jumps[0]]), float(time[jumps[-1] + 1]), what, "noted")
        yield "elevation_m", None, finding
    sound = heights_of_a_road(time, driven, height)
    off = np.flatnonzero(sound != height)
    if len(off):
        mended = logged.copy()
        mended[known] = sound
        name = signal_name("elevation_m")
        what = f"{name} of {height[off[0]]:g} in {len(off)} samples is a jump: these values are removed"
        yield "elevation_m", mended, between(samples, trip_id, known[off[0]], known[off[-1]], what, "noted")


def ambient_findings(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Find a constant ambient temperature that was probably not measured."""
    if not has(samples, "ambient_temperature_degc"):
        return
    values, time = array(samples, "ambient_temperature_degc"), array(samples, "time_s")
    value = float(np.nanmin(values))
    if value != np.nanmax(values):
        return
    # 3600.0: duration over which a constant temperature is suspicious: sensors resolve 0.5 to 1 °C, and
    # the air changes by more in an hour
    # (-40.0, 85.0, 127.0, 127.5, 215.0): values of a bus message without a sensor: the ends of the usual
    # codings
    if time[-1] - time[0] > 3600.0 or value in (-40.0, 85.0, 127.0, 127.5, 215.0):
        what = f"outside temperature stays at {value:g} °C: it may not be measured"
        yield whole(samples, trip_id, what, "noted")


def coarse_findings(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Find a speed that changes too rarely to show accelerations.

    The drive is set aside if the car may have stopped and started between two values.
    """
    time, speed = array(samples, "time_s"), array(samples, "speed_m_s")
    known = np.isfinite(time) & np.isfinite(speed)
    time, speed = time[known], speed[known]
    gaps = np.diff(time)[np.maximum(speed[1:], speed[:-1]) > MOVING_M_S]
    every = max(float(np.median(gaps)), refresh_time(time, speed)) if len(gaps) else 0.0
    # 5.0: time between speeds [s] from which a finding is made. At this time the simulated energy of TUM
    # trips is off by 1 % in the median and by 3 % in one of ten; at 10 s by 3 % and 6 %
    if every >= 5.0:
        rare = every > LONGEST_HOLD_S
        unknown = "accelerations between are unknown, the simulated energy may be off by several percent"
        what = f"speed is a new value every {every:.1f} s: {'the drive cannot be simulated' if rare else unknown}"
        yield whole(samples, trip_id, what, "set aside" if rare else "noted")
