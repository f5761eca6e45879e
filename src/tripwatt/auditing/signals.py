"""Rules on what the signals do together: freezes, filled gaps, sensors that stop, charging, and stuck heaters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.auditing.findings import (
    MEASURED,
    Change,
    Cut,
    Finding,
    array,
    between,
    blanking,
    has,
    runs,
    whole,
)
from tripwatt.trips.messages import signal_name
from tripwatt.units import M_S_PER_KM_H

FEWEST_SAMPLES: Final = 10
"""A coincidence of a few samples is none of many: every rule on runs needs at least so many."""

ROUNDING: Final = 1e-9
"""Relative difference between means of equal values."""

MOVING_M_S: Final = 1.0
STANDSTILL_M_S: Final = 0.3

FREEZE_MOVING_S: Final = 10.0
"""Speed, voltage and current of a moving car never keep one value together for so long."""

UNUSUAL: Final = 5.0
"""A logger with coarse steps, such as whole km/h and whole kW, rests often: a freeze is so many times its usual rest."""

FREEZE_STANDING_S: Final = 60.0
"""A parked car may keep all three for a while; a minute of it at the end of a log has no information and is removed."""

FROZEN_SENSOR_S: Final = 60.0
"""Voltage or current cannot keep one value for a minute while the speed changes by `SPEED_CHANGE_M_S`."""

SPEED_CHANGE_M_S: Final = 3.0

FROZEN_SHARE: Final = 0.1
"""A current that is frozen for more of the drive leaves its energy unknown. The voltage varies by a few percent only."""

STANDING_POWER_W: Final = 20_000.0
"""Heater, air conditioner and everything else of a standing car stay below this."""

STANDING_POWER_S: Final = 10.0

SHORTEST_FILL_S: Final = 10.0
"""Two signals of a car are straight lines together for shorter than this [s], unless a gap was filled."""

STRAIGHTNESS: Final = 0.0005
"""Deviation from a straight line that rounding explains, as a share of the signal's range in the log."""

SENSOR_STOP_S: Final = 10.0
"""Up to this time a missing signal is bridged by a straight line, as a gap in time is."""

CHARGING_S: Final = 60.0
CHARGING_A: Final = 1.0
"""Current into the battery of a standing car: nothing but a charger does that, and never for less than a minute."""

STUCK_SHARE: Final = 0.9
"""A heater that is on follows a controller; one value in nine tenths of the samples is a message that stands."""

STUCK_S: Final = 600.0
STUCK_W: Final = 50.0

PULSE_W: Final = 3000.0
PULSE_S: Final = 3.0
"""A heater's water circuit takes many seconds to take or lose kilowatts; shorter pulses are codes, not power."""

FEWEST_PULSES: Final = 3


def _steady(samples: pd.DataFrame) -> BoolArray:
    """Whether each step leaves speed, voltage and current exactly as they were, shape (samples - 1,)."""
    same = np.ones(max(len(samples) - 1, 0), dtype=bool)
    for name in MEASURED:
        same &= resting_steps(array(samples, name))
    return same


def resting_steps(values: FloatArray) -> BoolArray:
    """Whether each step leaves a value as it was, but for the rounding of means; shape (samples - 1,)."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(np.diff(values)) <= ROUNDING * (1.0 + np.abs(values[1:])), dtype=bool)


def freeze_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Runs in which every measured signal stands still although the car moves, or at an end of the log."""
    time, speed = array(samples, "time_s"), array(samples, "speed_m_s")
    steady = _steady(samples)
    shortest = max(FREEZE_MOVING_S, UNUSUAL * usual_rest_s(time, speed, steady))
    for first, last in runs(steady):
        lasted = time[last] - time[first]
        if last - first < FEWEST_SAMPLES or lasted < shortest:
            continue
        moving = speed[first] > MOVING_M_S
        at_an_end = first == 0 or last == len(samples) - 1
        if moving or (lasted >= FREEZE_STANDING_S and at_an_end):
            state = f"at {speed[first] / M_S_PER_KM_H:.0f} km/h" if moving else "at standstill"
            start = 0 if first == 0 else first + 1  # the first sample of a freeze is still a measurement
            yield Cut(start, last + 1, f"every signal frozen for {lasted:.1f} s {state}")


def usual_rest_s(time: FloatArray, speed: FloatArray, steady: BoolArray) -> float:
    """How long [s] the signals of the moving car rest in this log between two changes, its 99th percentile."""
    changes = np.flatnonzero(~steady)
    if len(changes) < FEWEST_SAMPLES:
        return 0.0
    rests = time[changes[1:]] - time[changes[:-1] + 1]
    moving = speed[changes[1:]] > MOVING_M_S
    return float(np.percentile(rests[moving], 99.0)) if moving.any() else 0.0


def frozen_sensor_findings(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """One measured signal that is frozen while the others change."""
    time, speed = array(samples, "time_s"), array(samples, "speed_m_s")
    for name in ("voltage_v", "current_a"):
        values = array(samples, name)
        for first, last in runs(resting_steps(values)):
            lasted = time[last] - time[first]
            if lasted < FROZEN_SENSOR_S or last - first < FEWEST_SAMPLES:
                continue
            if np.ptp(speed[first : last + 1]) > SPEED_CHANGE_M_S:
                what = f"{signal_name(name)} stays at {values[first]:g} for {lasted:.1f} s while the speed changes"
                long = name == "current_a" and lasted > FROZEN_SHARE * (time[-1] - time[0])
                yield between(samples, trip_id, first, last, what, "set aside" if long else "noted")
    power = array(samples, "voltage_v") * array(samples, "current_a")
    with np.errstate(invalid="ignore"):
        standing = (speed < STANDSTILL_M_S) & (power > STANDING_POWER_W)
    for first, last in runs(standing):
        lasted = time[last - 1] - time[first]
        if lasted >= STANDING_POWER_S and last - first >= FEWEST_SAMPLES:
            mean = float(np.mean(power[first:last])) / 1000.0
            what = f"the battery delivers {mean:.1f} kW for {lasted:.1f} s at standstill: the speed is frozen"
            yield between(samples, trip_id, first, last - 1, what, "set aside")


def filled_gaps(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Runs in which speed, voltage and current are straight lines together: a filled gap."""
    if len(samples) < FEWEST_SAMPLES + 2 or not all(has(samples, name) for name in MEASURED):
        return
    time = array(samples, "time_s")
    straight = np.ones(len(time) - 2, dtype=bool)
    weight = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    signals = [array(samples, name) for name in MEASURED]
    tolerances = [STRAIGHTNESS * float(np.nanpercentile(x, 99) - np.nanpercentile(x, 1)) for x in signals]
    for values, tolerance in zip(signals, tolerances, strict=True):
        middle = values[:-2] + weight * (values[2:] - values[:-2])
        with np.errstate(invalid="ignore"):
            straight &= np.abs(values[1:-1] - middle) <= tolerance
    for first, stop in runs(straight):
        last = stop + 1
        lasted = time[last] - time[first]
        if lasted < SHORTEST_FILL_S or stop - first < FEWEST_SAMPLES:
            continue
        if are_lines(time[first : last + 1], [x[first : last + 1] for x in signals], tolerances):
            what = f"speed, voltage and current are straight lines for {lasted:.1f} s: a filled gap"
            yield between(samples, trip_id, first, last, what, "set aside")


def are_lines(time: FloatArray, signals: list[FloatArray], tolerances: list[float]) -> bool:
    """Whether every signal keeps to its chord, two of them really change, and the car is not just standing.

    Real samples beside a gap may be straight by chance, so a tenth of the run at either end does not count.
    """
    edge = max(len(time) // 10, 1)
    inner = slice(edge, -edge)
    time, signals = time[inner], [x[inner] for x in signals]
    changing = sum(bool(abs(x[-1] - x[0]) > 3.0 * t) for x, t in zip(signals, tolerances, strict=True))
    if changing < 2:  # one ramp beside resting signals is a steady pull with a coarse logger
        return False
    fraction = (time - time[0]) / (time[-1] - time[0])
    for values, tolerance in zip(signals, tolerances, strict=True):
        chord = values[0] + fraction * (values[-1] - values[0])
        if np.max(np.abs(values - chord)) > 2.0 * tolerance:
            return False
    return bool(max(signals[0][0], signals[0][-1]) > MOVING_M_S)


def sensor_stop_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Runs in which a measured signal is missing for longer than can be bridged."""
    time = array(samples, "time_s")
    missing = np.zeros(len(samples), dtype=bool)
    measured = [n for n in MEASURED if has(samples, n)]
    for name in measured:
        missing |= ~np.isfinite(array(samples, name))
    for first, last in runs(missing):
        lasted = time[min(last, len(time) - 1)] - time[max(first - 1, 0)]
        if lasted > SENSOR_STOP_S:
            lost = [n for n in measured if not np.isfinite(array(samples, n)[first:last]).all()]
            yield Cut(first, last, f"no values of {', '.join(map(signal_name, lost))} for {lasted:.1f} s")


def charging_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Standstills in which a charger fed the battery for more than a minute."""
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
    """A heater signal that stands at one value, and pulses that no heater can make."""
    time = array(samples, "time_s")
    for name in ("heating_power_w", "requested_heating_power_w"):
        if not has(samples, name):
            continue
        values = array(samples, name)
        pulses = short_pulses(time, values)
        stuck = stuck_level(samples, values, pulses) if name == "heating_power_w" else None
        if stuck is not None:
            what = f"{signal_name(name)} stays at {stuck[0]:g} W in {stuck[1]:.0%} of the samples: all its values are removed"
            yield name, np.full(len(values), np.nan), whole(samples, trip_id, what, "noted")
        elif len(pulses) >= FEWEST_PULSES:
            what = f"{signal_name(name)} jumps up and back by more than {PULSE_W:g} W {len(pulses)} times: these values are removed"
            finding = between(samples, trip_id, pulses[0][0], pulses[-1][1] - 1, what, "noted")
            removed = np.concatenate([np.arange(first, last) for first, last in pulses])
            kept = values.copy()
            kept[removed] = np.nan
            yield name, kept, finding


def stuck_level(
    samples: pd.DataFrame, values: FloatArray, pulses: list[tuple[int, int]]
) -> tuple[float, float] | None:
    """The value [W] that a heater signal stands at and its share of the samples; None for one that works.

    A heater may hold one power for a while, above all its highest. It is stuck when it holds it although other power
    was requested, when pulses stand on top, or for very long while it is neither off nor at its highest.
    """
    known = values[np.isfinite(values)]
    levels, counts = np.unique(known, return_counts=True)
    mode, share = float(levels[counts.argmax()]), float(counts.max() / len(known))
    if mode < STUCK_W or share < STUCK_SHARE or len(known) < FEWEST_SAMPLES:
        return None
    requested = array(samples, "requested_heating_power_w")
    known_request = bool(np.isfinite(requested).any())
    contradicted = known_request and float(np.nanmedian(np.abs(requested - mode))) > 0.5 * mode
    lasts_s = float(samples["time_s"].iloc[-1] - samples["time_s"].iloc[0])
    long = lasts_s >= STUCK_S and mode < float(levels[-1])
    return (mode, share) if contradicted or pulses or long else None


def short_pulses(time: FloatArray, values: FloatArray) -> list[tuple[int, int]]:
    """Short runs that stand more than `PULSE_W` above the samples before and after them."""
    step = np.diff(values)
    pulses: list[tuple[int, int]] = []
    for edge in np.flatnonzero(step > 0.5 * PULSE_W):
        first = int(edge) + 1
        if pulses and first < pulses[-1][1]:
            continue
        base = values[edge]
        end = int(np.searchsorted(time, time[first] + PULSE_S, side="right"))
        low = np.flatnonzero(values[first:end] <= base + 0.25 * PULSE_W)
        if len(low) and np.max(values[first : first + low[0]]) > base + PULSE_W:
            pulses.append((first, first + int(low[0])))
    return pulses
