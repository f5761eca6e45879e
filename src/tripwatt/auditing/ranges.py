"""Rules on single columns: missing columns, impossible values, wrong units recognised by the values, heights that no road has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, distance_driven
from tripwatt.auditing.findings import (
    MEASURED,
    Change,
    Consequence,
    Finding,
    array,
    between,
    blanking,
    has,
    whole,
)
from tripwatt.auditing.signals import MOVING_M_S
from tripwatt.trips import COLUMNS, STEEPEST_GRADE
from tripwatt.trips.coarse_speed import LONGEST_HOLD_S, refresh_time
from tripwatt.trips.elevation import HEIGHT_NOISE_M, heights_of_a_road
from tripwatt.trips.messages import signal_name

STRAY_SHARE: Final = 0.01
"""Largest share of impossible values that counts as dropouts of a sensor; a larger one means that the column is something else."""


HOTTEST_AIR_DEGC: Final = 57.0
"""The highest air temperature on record is 56.7 °C (WMO, Furnace Creek 1913)."""


def missing_columns(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Find columns that are absent or empty. Without speed, or without any measurement of energy, the drive is set aside."""
    lost = [c for c in MEASURED if not has(samples, c)]
    if lost and has(samples, "observed_energy_wh") and has(samples, "speed_m_s"):
        what = "no voltage and current: the energy is that of a counter or of the state of charge"
        yield whole(samples, trip_id, what, "noted")
    elif lost:
        what = f"no values of {', '.join(map(signal_name, lost))}: the energy is not measured"
        yield whole(samples, trip_id, what, "set aside")
    if not has(samples, "elevation_m") and not has(samples, "grade"):
        yield whole(samples, trip_id, "no values of elevation: the road is treated as flat", "noted")
    if not has(samples, "ambient_temperature_degc"):
        what = "no values of outside temperature: climate and air density use default values"
        yield whole(samples, trip_id, what, "noted")


@blanking
def blank_infinite(samples: pd.DataFrame, trip_id: str) -> Iterator[Change]:
    """Blank infinite values, so that later rules meet only finite and missing ones."""
    for name in (name for name in samples.columns if name in COLUMNS):
        values = array(samples, name)
        bad = np.isinf(values)
        if bad.any():
            what = f"{signal_name(name)} is infinite in {int(bad.sum())} samples: these values are removed"
            yield name, np.where(bad, np.nan, values), whole(samples, trip_id, what, "noted")


@blanking
def blank_impossible(samples: pd.DataFrame, trip_id: str) -> Iterator[Change]:
    """Blank every value outside its column's range; set the drive aside if a measured signal has many such values.

    A small negative speed counts as reversing and is made positive.
    """
    for name, column in ((n, c) for n, c in COLUMNS.items() if n != "time_s" and n in samples.columns):
        values = array(samples, name)
        # 10.0: fastest reversing: a negative speed up to this magnitude counts as reversing, a faster one as a
        # fault
        back = (values < 0) & (values >= -10.0)
        if name == "speed_m_s" and back.any():
            what = f"{int(back.sum())} samples of negative speed are treated as reversing"
            values = np.where(back, -values, values)
            yield name, values, between(samples, trip_id, np.flatnonzero(back), what, "noted")
        # 12_000.0: largest possible heating power: cabin heaters of passenger cars have 3 to 7 kW, twin
        # heaters about 10 kW
        highest = min(column.maximum, 12_000.0 if "heating" in name else np.inf)
        bad = (values < column.minimum) | (values > highest)
        if name == "speed_m_s":
            bad |= speed_spikes(array(samples, "time_s"), values)
        if not bad.any():
            continue
        many = float(bad.mean()) > STRAY_SHARE
        guess = guessed_unit(name, values) if many else ""
        low, high = values[bad].min(), values[bad].max()
        extremes = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        what = f"{signal_name(name)} of {extremes} {column.unit} in {int(bad.sum())} samples is impossible"
        what += f": {guess}" if guess else ""
        consequence: Consequence = "set aside" if many and name in MEASURED else "noted"
        blanked = np.full(len(values), np.nan) if guess else np.where(bad, np.nan, values)
        yield name, blanked, between(samples, trip_id, np.flatnonzero(bad), what, consequence)


def speed_spikes(time: FloatArray, speed: FloatArray) -> BoolArray:
    """Mark single samples far above or far below both neighbours, shape (samples,)."""
    spikes = np.zeros(len(speed), dtype=bool)
    if len(speed) > 2:
        up, down = speed[1:-1] - speed[:-2], speed[1:-1] - speed[2:]
        with np.errstate(invalid="ignore"):
            # 8.0: change of speed of a spike: no car gains and loses this much over three samples within 2 s
            apart = (np.minimum(np.abs(up), np.abs(down)) > 8.0) & (up * down > 0)
        spikes[1:-1] = apart & (time[2:] - time[:-2] <= 2.0)
    return spikes


def guessed_unit(name: str, values: FloatArray) -> str:
    """Guess the actual unit of a column with impossible values; return a hint, or an empty text without a guess."""
    middle = float(np.nanmedian(values))
    largest = float(np.nanmax(np.abs(values)))
    if name.endswith("_degc") and 213.0 <= middle <= 343.0:  # -60 to 70 °C
        return "the unit appears to be K; convert it to °C"
    if name == "ambient_temperature_degc" and HOTTEST_AIR_DEGC < middle <= 1.8 * HOTTEST_AIR_DEGC + 32.0:
        return "the unit appears to be °F; convert it to °C"
    if name.endswith("soc") and 1.0 < largest <= 100.0:
        return "the unit appears to be percent; convert it to a fraction"
    if name == "voltage_v" and 9.0 <= middle <= 16.0:
        return "this appears to be the 12 V on-board system; use the voltage of the traction battery"
    if name == "voltage_v" and 30_000.0 <= middle <= 1_200_000.0:
        return "the unit appears to be mV; convert it to V"
    if name == "current_a" and largest > COLUMNS[name].maximum:
        return "the unit appears to be mA; convert it to A"
    if name == "speed_m_s" and largest > COLUMNS[name].maximum:
        return "the unit appears to be km/h; convert it to m/s"
    return ""


@blanking
def blank_fahrenheit(samples: pd.DataFrame, trip_id: str) -> Iterator[Change]:
    """Blank an ambient temperature whose mean is hotter than any on Earth, and so is probably in °F."""
    ambient = array(samples, "ambient_temperature_degc")
    if np.isfinite(ambient).any() and float(np.nanmean(ambient)) > HOTTEST_AIR_DEGC:
        what = f"mean outside temperature of {np.nanmean(ambient):.1f} °C is impossible: the unit appears to be °F; convert it to °C"
        nothing = np.full(len(ambient), np.nan)
        yield "ambient_temperature_degc", nothing, whole(samples, trip_id, what, "noted")


def drop_blank_speed(samples: pd.DataFrame) -> pd.DataFrame:
    """Drop samples without a speed, which cannot be part of a trip; the findings were made when the speed was blanked."""
    known = np.isfinite(array(samples, "speed_m_s"))
    return samples if known.all() else samples[known].reset_index(drop=True)


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
        yield "elevation_m", mended, between(samples, trip_id, known[off], what, "noted")


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
