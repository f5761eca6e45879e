"""Rules on signals: missing columns, impossible values and wrong units; freezes, filled gaps, sensors that stop, charging, stuck heaters."""

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
    Cut,
    Finding,
    array,
    between,
    blanking,
    has,
    runs,
    whole,
)
from tripwatt.errors import percent
from tripwatt.trips import COLUMNS, STEEPEST_GRADE
from tripwatt.trips.elevation import HEIGHT_NOISE_M, heights_of_a_road
from tripwatt.trips.messages import signal_name
from tripwatt.units import M_S_PER_KM_H

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
    # 3600.0: duration over which a constant temperature is suspicious: sensors resolve 0.5 to 1 °C, and
    # the air changes by more in an hour
    # (-40.0, 85.0, 127.0, 127.5, 215.0): values of a bus message without a sensor: the ends of the usual
    # codings
    if value == np.nanmax(values) and (np.ptp(time) > 3600.0 or value in (-40.0, 85.0, 127.0, 127.5, 215.0)):
        what = f"outside temperature stays at {value:g} °C: it may not be measured"
        yield whole(samples, trip_id, what, "noted")


def coarse_findings(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Find a speed that changes too rarely to show accelerations.

    The drive is set aside if the car may have stopped and started between two values.
    """
    from tripwatt.trips.coarse_speed import LONGEST_HOLD_S, refresh_time  # a forecast does not need it

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


FEWEST_SAMPLES: Final = 10
"""Smallest number of samples of a run that counts: a few samples may coincide by chance."""


MOVING_M_S: Final = 1.0
STANDSTILL_M_S: Final = 0.3


CHARGING_S: Final = 60.0
CHARGING_A: Final = 1.0
"""Least duration and current into the battery of a standing car that show a charger."""


PULSE_W: Final = 3000.0


def resting_steps(values: FloatArray) -> BoolArray:
    """Mark the steps in which a value stays constant, up to the rounding of means; shape (samples - 1,)."""
    with np.errstate(invalid="ignore"):
        # 1e-9: relative difference between means of equal values
        return np.asarray(np.abs(np.diff(values)) <= 1e-9 * (1.0 + np.abs(values[1:])), dtype=bool)


def freeze_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Cut runs in which all measured signals are frozen while the car moves, or for long at an end of the log."""
    time, speed = array(samples, "time_s"), array(samples, "speed_m_s")
    # steps in which speed, voltage and current all stay constant
    steady = np.logical_and.reduce([resting_steps(array(samples, name)) for name in MEASURED])
    # 10.0: duration for which speed, voltage and current of a moving car never all stay constant
    # 5.0: duration of a freeze over the usual rest of the log: with coarse steps, such as whole km/h and
    # whole kW, signals rest often
    shortest = max(10.0, 5.0 * usual_rest_s(time, speed, steady))
    for first, last in runs(steady):
        lasted = time[last] - time[first]
        if last - first < FEWEST_SAMPLES or lasted < shortest:
            continue
        moving = speed[first] > MOVING_M_S
        at_an_end = first == 0 or last == len(samples) - 1
        # 60.0: duration of a freeze at standstill that is removed at an end of a log, where it carries no
        # information
        if moving or (lasted >= 60.0 and at_an_end):
            state = f"at {speed[first] / M_S_PER_KM_H:.0f} km/h" if moving else "at standstill"
            start = 0 if first == 0 else first + 1  # the first sample of a freeze is still a measurement
            yield Cut(start, last + 1, f"every signal frozen for {lasted:.1f} s {state}")


def usual_rest_s(time: FloatArray, speed: FloatArray, steady: BoolArray) -> float:
    """Return the 99th percentile of the time [s] between two changes of the signals of the moving car; 0 if there are too few."""
    changes = np.flatnonzero(~steady)
    if len(changes) < FEWEST_SAMPLES:
        return 0.0
    rests = time[changes[1:]] - time[changes[:-1] + 1]
    moving = speed[changes[1:]] > MOVING_M_S
    return float(np.percentile(rests[moving], 99.0)) if moving.any() else 0.0


def frozen_sensor_findings(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Find a voltage or current that is frozen while the speed changes, and a speed frozen at 0 under high power."""
    time, speed = array(samples, "time_s"), array(samples, "speed_m_s")
    for name in ("voltage_v", "current_a"):
        values = array(samples, name)
        for first, last in runs(resting_steps(values)):
            lasted = time[last] - time[first]
            # 60.0: duration for which voltage or current cannot stay constant while the speed changes by
            # 3 m/s
            is_long = lasted >= 60.0 and last - first >= FEWEST_SAMPLES
            if is_long and np.ptp(speed[first : last + 1]) > 3.0:
                what = f"{signal_name(name)} stays at {values[first]:g} for {lasted:.1f} s while the speed changes"
                # 0.1: largest share of a drive in which the current may be frozen; beyond it the energy is
                # unknown. Voltage varies only by a few percent
                long = name == "current_a" and lasted > 0.1 * (time[-1] - time[0])
                yield between(samples, trip_id, (first, last), what, "set aside" if long else "noted")
    power = array(samples, "voltage_v") * array(samples, "current_a")
    with np.errstate(invalid="ignore"):
        # 20_000.0: power that heater, air conditioner and all other loads of a standing car stay below
        standing = (speed < STANDSTILL_M_S) & (power > 20_000.0)
    for first, last in runs(standing):
        lasted = time[last - 1] - time[first]
        if lasted >= 10.0 and last - first >= FEWEST_SAMPLES:  # a shorter run may be a start
            mean = float(np.mean(power[first:last])) / 1000.0
            what = f"the battery delivers {mean:.1f} kW for {lasted:.1f} s at standstill: the speed is frozen"
            yield between(samples, trip_id, (first, last - 1), what, "set aside")


def filled_gaps(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Find filled gaps: runs in which speed, voltage and current are all straight lines."""
    if len(samples) < FEWEST_SAMPLES + 2 or not all(has(samples, name) for name in MEASURED):
        return
    time = array(samples, "time_s")
    straight = np.ones(len(time) - 2, dtype=bool)
    weight = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    signals = [array(samples, name) for name in MEASURED]
    # 0.0005: deviation from a straight line that rounding explains, as a share of the signal's range in
    # the log
    tolerances = [0.0005 * float(np.nanpercentile(x, 99) - np.nanpercentile(x, 1)) for x in signals]
    for values, tolerance in zip(signals, tolerances, strict=True):
        middle = values[:-2] + weight * (values[2:] - values[:-2])
        with np.errstate(invalid="ignore"):
            straight &= np.abs(values[1:-1] - middle) <= tolerance
    for first, stop in runs(straight):
        last = stop + 1
        lasted = time[last] - time[first]
        # 10.0: duration [s] from which signals that are all straight lines show a filled gap
        is_long = lasted >= 10.0 and stop - first >= FEWEST_SAMPLES
        if is_long and are_lines(time[first : last + 1], [x[first : last + 1] for x in signals], tolerances):
            what = f"speed, voltage and current are straight lines for {lasted:.1f} s: a filled gap"
            yield between(samples, trip_id, (first, last), what, "set aside")


def are_lines(time: FloatArray, signals: list[FloatArray], tolerances: list[float]) -> bool:
    """Return whether all signals are straight lines, at least two of them change, and the car moves.

    Real samples beside a gap may be straight by chance, so a tenth of the run at either end does not count.
    """
    edge = max(len(time) // 10, 1)
    inner = slice(edge, -edge)
    time, signals = time[inner], [x[inner] for x in signals]
    changing = sum(bool(abs(x[-1] - x[0]) > 3.0 * t) for x, t in zip(signals, tolerances, strict=True))
    if changing < 2:  # one ramp beside constant signals is a steady acceleration in a coarse log
        return False
    fraction = (time - time[0]) / (time[-1] - time[0])
    for values, tolerance in zip(signals, tolerances, strict=True):
        chord = values[0] + fraction * (values[-1] - values[0])
        if np.max(np.abs(values - chord)) > 2.0 * tolerance:
            return False
    return bool(max(signals[0][0], signals[0][-1]) > MOVING_M_S)


def sensor_stop_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Cut runs in which a measured signal is missing for too long to be bridged."""
    time = array(samples, "time_s")
    measured = [name for name in MEASURED if has(samples, name)]
    missing = np.isnan(samples[measured].to_numpy(dtype=np.float64)).any(axis=1)
    for first, last in runs(missing):
        lasted = time[min(last, len(time) - 1)] - time[max(first - 1, 0)]
        # 10.0: longest time for which a missing signal is bridged by a straight line, as a gap in time is
        if lasted > 10.0:
            lost = [n for n in measured if not np.isfinite(array(samples, n)[first:last]).all()]
            yield Cut(first, last, f"no values of {', '.join(map(signal_name, lost))} for {lasted:.1f} s")


def charging_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Cut standstills in which a charger fed the battery for more than `CHARGING_S`."""
    time, speed, current = (array(samples, c) for c in ("time_s", "speed_m_s", "current_a"))
    with np.errstate(invalid="ignore"):
        standing, fed = speed < STANDSTILL_M_S, current < -CHARGING_A
    step = np.diff(time, append=time[-1:])
    for first, last in runs(standing):
        inside = fed[first:last]
        seconds = float(np.sum(step[first:last][inside]))
        if seconds > CHARGING_S:
            ampere = -float(np.mean(current[first:last][inside]))
            what = f"charged with {ampere:.1f} A for {seconds:.1f} s at standstill"
            start = 0 if first == 0 else first + 1  # the drive ends with its first standing sample
            stop = last if last == len(time) else last - 1
            yield Cut(start, max(start, stop), what)


@blanking
def blank_stuck_heater(samples: pd.DataFrame, trip_id: str) -> Iterator[Change]:
    """Blank a heater signal that is stuck at one value, or its pulses that no heater can make."""
    time = array(samples, "time_s")
    heaters = ("heating_power_w", "requested_heating_power_w")
    for name in (name for name in heaters if has(samples, name)):
        values = array(samples, name)
        pulses = short_pulses(time, values)
        stuck = stuck_level(samples, values, pulses) if name == "heating_power_w" else None
        if stuck is not None:
            what = f"{signal_name(name)} stays at {stuck[0]:g} W in {percent(stuck[1])} of the samples: all its values are removed"
            yield name, np.full(len(values), np.nan), whole(samples, trip_id, what, "noted")
        elif len(pulses) >= 3:  # fewer may be measurements
            what = f"{signal_name(name)} jumps up and back by more than {PULSE_W:g} W {len(pulses)} times: these values are removed"
            removed = np.concatenate([np.arange(first, last) for first, last in pulses])
            blanked = values.copy()
            blanked[removed] = np.nan
            yield name, blanked, between(samples, trip_id, removed, what, "noted")


def stuck_level(
    samples: pd.DataFrame, values: FloatArray, pulses: list[tuple[int, int]]
) -> tuple[float, float] | None:
    """Return the value [W] at which a heater signal is stuck and its share of the samples; None if the signal works.

    A heater may hold one power for a while, above all its highest. The signal is stuck if the held value differs from the
    requested power, if pulses stand on top of it, or if it lasts very long and is neither 0 nor the highest power.
    """
    known = values[np.isfinite(values)]
    levels, counts = np.unique(known, return_counts=True)
    mode, share = float(levels[counts.argmax()]), float(counts.max() / len(known))
    # 0.9: share of samples with one value from which a heater signal counts as stuck: a working heater
    # follows a controller
    # 50.0: the noise of a heater that is off is below it
    if mode < 50.0 or share < 0.9 or len(known) < FEWEST_SAMPLES:
        return None
    requested = array(samples, "requested_heating_power_w")
    known_request = bool(np.isfinite(requested).any())
    contradicted = known_request and float(np.nanmedian(np.abs(requested - mode))) > 0.5 * mode
    lasts_s = float(samples["time_s"].iloc[-1] - samples["time_s"].iloc[0])
    # 600.0: a heater changes its power in ten minutes, unless it gives its highest
    long = lasts_s >= 600.0 and mode < float(levels[-1])
    return (mode, share) if contradicted or pulses or long else None


def short_pulses(time: FloatArray, values: FloatArray) -> list[tuple[int, int]]:
    """Find short runs more than `PULSE_W` above the samples around them; return first index and one after the last."""
    step = np.diff(values)
    pulses: list[tuple[int, int]] = []
    for edge in np.flatnonzero(step > 0.5 * PULSE_W):
        first = int(edge) + 1
        if pulses and first < pulses[-1][1]:
            continue
        base = values[edge]
        # 3.0: height and duration of a false pulse: a heater's water circuit needs many seconds to take or
        # lose kilowatts
        end = int(np.searchsorted(time, time[first] + 3.0, side="right"))
        low = np.flatnonzero(values[first:end] <= base + 0.25 * PULSE_W)
        if len(low) and np.max(values[first : first + low[0]]) > base + PULSE_W:
            pulses.append((first, first + int(low[0])))
    return pulses
