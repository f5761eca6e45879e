"""Samples that were measured on the way: check them, map them to the plan's clock, average by segment, update the residual power."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, IntArray, distance_driven, running_sum
from tripwatt.auditing.signals import blank_stuck_heater
from tripwatt.errors import InvalidInput, require_type
from tripwatt.forecasting.expected import ExpectedTrip
from tripwatt.hybrid.climate_log import CLIMATE_COLUMNS, CLIMATE_IN_ALL, TOLD_BY, logged_climate
from tripwatt.trips import (
    COLUMNS,
    Plan,
    observed_cumulative_energy,
    raise_faults,
    structure_faults,
    table_of,
    value_faults,
)
from tripwatt.trips.inertia import WRONG_SIGN, apparent_mass
from tripwatt.uncertainty import PowerPrior, ResidualPower, UncertaintyModel
from tripwatt.uncertainty.charge import CAPACITY_SD, FULL, NORMAL_SCALE, ChargeScale
from tripwatt.uncertainty.process import EXACT_W2, ResidualProcess
from tripwatt.uncertainty.residual_power import PowerSum
from tripwatt.uncertainty.scale import T_VARIANCE
from tripwatt.uncertainty.shrinkage import is_off
from tripwatt.units import SECONDS_PER_HOUR

WHERE: Final = "observed samples"
"""Place that messages name for a fault of samples that were measured on the way."""

GAP_S: Final = 15.0
"""Longest gap between two samples that counts as measured [s]."""
SOC_STEP: Final = 0.005
"""Finest resolution that is assumed of a logged state of charge."""
MARK_STEPS: Final = 2.25
"""Steps of the resolution between two readings that are used: two and a half from the middle of the first step, else three."""
MAX_STRETCH: Final = 1.5
"""On a planned route, the power of a segment that took longer than this many times its planned time is not used."""
MIN_COVER: Final = 0.8
"""Share of a segment that has to be measured before its power is used: power changes with every change of speed, so a
part of a segment is a poor estimate of the rest."""
FILL_S: Final = 5.0
LATE_S: Final = 86_400.0
"""Time after the end of a planned route at which its first sample may be, since a car may be late; later times are of another clock."""
DRIVEN_S: Final = "driven_s"
"""Column with the time by the car's own clock; `time_s` is then by the plan's clock."""


@dataclass(frozen=True, slots=True)
class ChargeReading:
    """A state of charge that was read on the way: time [s since departure], value, and whether the display was read.

    `charged` says whether the battery was charged to this value at this time. `first` is the first reading of the same
    kind on this trip.
    """

    time_s: float
    value: float
    displayed: bool
    charged: bool = False
    first: ChargeReading | None = field(default=None, compare=False)


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements of a trip so far.

    Attributes
    ----------
    until_s : float
        Time up to which the trip was measured [s since departure].
    energy_wh, hours : ndarray, shape (segments,)
        Measured energy [Wh] and measured time [h] of each segment; 0 and None if only the state of charge is known.
    anchor : ChargeReading or None
        The last reading of the state of charge.
    """

    until_s: float
    energy_wh: FloatArray | float = 0.0
    hours: FloatArray | None = None
    anchor: ChargeReading | None = None


@dataclass(frozen=True, eq=False)
class SegmentReadings:
    """Measured mean powers of single segments, with independent errors.

    Attributes
    ----------
    seen : ndarray, shape (readings,)
        Indices of the measured segments, ascending.
    power_w : ndarray, shape (readings,)
        Mean power [W].
    variance_w2 : ndarray, shape (readings,)
        Variance of its error [W²].
    """

    seen: IntArray
    power_w: FloatArray
    variance_w2: FloatArray

    def mean_of(self, values: FloatArray) -> FloatArray:
        """Average values of all segments over what each reading covers, shape (readings,)."""
        return values[self.seen]

    def touches(self, n: int) -> BoolArray:
        """Mask of the segments, of n, that any reading covers at least in part."""
        return np.bincount(self.seen, minlength=n) > 0

    def condition(self, prior: PowerPrior, power_w: FloatArray, exact: bool = False) -> ResidualPower:
        """Posterior of the residual power, given values of the readings with their errors or, if exact, with nearly none."""
        return prior.measured(
            self.seen, power_w, np.full(len(power_w), EXACT_W2) if exact else self.variance_w2
        )


@dataclass(frozen=True, eq=False)
class SpanReadings:
    """Mean powers between readings of the state of charge, whose errors share that of the capacity.

    Attributes
    ----------
    weights : ndarray, shape (readings, segments)
        Share of each segment in the time that a reading covers.
    power_w : ndarray, shape (readings,)
        Mean power [W].
    covariance_w2 : ndarray, shape (readings, readings)
        Covariance of their errors [W²].
    """

    weights: FloatArray
    power_w: FloatArray
    covariance_w2: FloatArray

    def mean_of(self, values: FloatArray) -> FloatArray:
        """See `SegmentReadings.mean_of`."""
        return self.weights @ values

    def touches(self, n: int) -> BoolArray:
        """See `SegmentReadings.touches`."""
        return np.asarray((self.weights > 0.0).any(axis=0))

    def condition(self, prior: PowerPrior, power_w: FloatArray, exact: bool = False) -> ResidualPower:
        """See `SegmentReadings.condition`."""
        errors_w2 = EXACT_W2 * np.eye(len(power_w)) if exact else self.covariance_w2
        return prior.averaged(self.weights, power_w, errors_w2)


PowerReadings = SegmentReadings | SpanReadings


Columns = Mapping[str, FloatArray]
"""Samples that were measured on the way: name of the column -> values, shape (samples,)."""


def columns_measured(observed: pd.DataFrame) -> Columns:
    """Known columns of a table of samples, as numbers. O(samples x columns).

    Raises
    ------
    InvalidInput
        If `observed` is not a DataFrame, lacks a column or rows, or has values that are not numeric. Lists every value out of range.
    """
    fix = "for example pandas.DataFrame({'time_s': [0.0, 60.0], 'soc': [0.8, 0.79]})"
    require_type(WHERE, observed, pd.DataFrame, "a DataFrame", fix)
    raise_faults(structure_faults(observed, WHERE, required=("time_s",)))
    known = [name for name in observed.columns if name in (*COLUMNS, "observed_energy_wh")]
    columns = dict(zip(known, observed[known].to_numpy(dtype=np.float64).T, strict=True))
    raise_faults(value_faults(columns, WHERE))
    return columns


def read_measured(
    samples: Columns, drive: ExpectedTrip, process: ResidualProcess, scale: ChargeScale
) -> tuple[Measured, PowerReadings]:
    """Read energy, state of charge and mean powers from samples. O(samples), or O(segments x readings) for a state of charge.

    Raises
    ------
    InvalidInput
        If the samples have neither energy nor a state of charge.
    """
    time = samples["time_s"]
    anchor = last_reading(samples, time)
    cumulative = measured_energy(samples)
    if cumulative is not None:
        until = float(time[np.flatnonzero(np.isfinite(cumulative))[-1]])
        energy, hours = _by_segment(cumulative, time, drive)
        driven_s = np.interp(drive.edges_s, time, samples[DRIVEN_S]) if DRIVEN_S in samples else None
        return Measured(until, energy, hours, anchor), _from_power(energy, hours, drive, process, driven_s)
    if anchor is not None:
        managed = np.isfinite(samples["soc"]).any() if "soc" in samples else False
        shown = scale.displayed(samples["soc"]) if managed else samples["displayed_soc"]
        return Measured(float(time[-1]), anchor=anchor), _from_charge(time, shown, drive, scale)
    where = f"columns {sorted(samples)}"
    raise InvalidInput.of("no measured energy", WHERE, where, "voltage_v and current_a, or soc")


def last_reading(samples: Columns, time: FloatArray) -> ChargeReading | None:
    """Return the last reading of the display, else of the battery management, else None."""
    for name in ("displayed_soc", "soc"):
        known = np.flatnonzero(np.isfinite(samples[name])) if name in samples else np.empty(0, np.int64)
        if len(known):
            ends = ((float(time[at]), float(samples[name][at])) for at in known[[0, -1]])
            first, last = (ChargeReading(*end, displayed=name == "displayed_soc") for end in ends)
            return replace(last, first=first)
    return None


def _edges_to(drive: ExpectedTrip, end_s: float) -> FloatArray:
    """Edges of the segments, the last one no earlier than the last sample."""
    return np.append(drive.edges_s[:-1], max(drive.edges_s[-1], end_s))


def _by_segment(
    cumulative_wh: FloatArray, time_s: FloatArray, drive: ExpectedTrip
) -> tuple[FloatArray, FloatArray]:
    """Measured energy [Wh] and measured time [h] of each segment; gaps longer than `GAP_S` count as unmeasured."""
    known = np.isfinite(cumulative_wh)
    cumulative_wh, time_s = cumulative_wh[known], time_s[known]
    step = np.diff(time_s)
    sound = step <= GAP_S
    edges = _edges_to(drive, float(time_s[-1]))
    seconds = running_sum(np.where(sound, step, 0.0))
    gained = running_sum(np.where(sound, np.diff(cumulative_wh), 0.0))
    covered = np.diff(np.interp(edges, time_s, seconds))
    return np.diff(np.interp(edges, time_s, gained)), covered / SECONDS_PER_HOUR


def _from_power(
    energy_wh: FloatArray,
    hours: FloatArray,
    drive: ExpectedTrip,
    process: ResidualProcess,
    driven_s: FloatArray | None,
) -> SegmentReadings:
    """Mean power of each segment that was measured for long enough.

    `driven_s` is the time at the edges by the car's own clock; None if that is the plan's clock.
    """
    share = np.minimum(hours / drive.table.hours, 1.0)
    counts = share >= MIN_COVER
    if driven_s is not None:
        counts &= np.diff(driven_s) <= MAX_STRETCH * drive.segments.step_s
    seen = np.flatnonzero(counts)
    noise = (process.drive.noise * drive.segments.drive_noise_w[seen]) ** 2
    variance = (1.0 - share[seen]) * noise + EXACT_W2
    return SegmentReadings(seen, energy_wh[seen] / hours[seen], variance)


def _from_charge(
    time_s: FloatArray, shown: FloatArray, drive: ExpectedTrip, scale: ChargeScale
) -> SpanReadings:
    """Mean power between readings of the displayed charge that differ by `MARK_STEPS` of its resolution or more.

    The first reading is the middle of its step. All others are changes, half way between two steps and two samples. A full display
    hides charge, so a first reading that is full does not count. Two spans share the error of the mark between them: two marks have the error of
    a display at arrival, given that at departure.
    """
    known = np.isfinite(shown)
    time_s, shown = time_s[known], shown[known]
    at = np.flatnonzero(np.diff(shown) != 0)
    step = max(float(np.abs(np.diff(shown)[at]).min()), SOC_STEP) if len(at) else SOC_STEP
    first = 0 if shown[0] < FULL else 1
    times_s, levels = (np.concatenate(([v[0]], (v[at] + v[at + 1]) / 2.0))[first:] for v in (time_s, shown))
    marks = [0]
    for k, level in enumerate(levels.tolist()):
        if abs(level - levels[marks[-1]]) >= MARK_STEPS * step:
            marks.append(k)
    if len(marks) < 2:
        return SpanReadings(np.empty((0, len(drive.segments))), np.empty(0), np.empty((0, 0)))
    start_s, end_s = times_s[marks[:-1], None], times_s[marks[1:], None]
    edges, seconds = _edges_to(drive, float(time_s[-1])), end_s - start_s
    inside = np.clip(np.minimum(edges[1:], end_s) - np.maximum(edges[:-1], start_s), 0.0, None)
    hours = seconds[:, 0] / SECONDS_PER_HOUR
    power = -np.diff(levels[marks]) * scale.wh_per_display / hours
    mark_wh = (
        max(step / math.sqrt(12.0), scale.displayed_sd / NORMAL_SCALE / math.sqrt(2.0)) * scale.wh_per_display
    )
    per_mark = mark_wh * np.diff(np.eye(len(marks)), axis=0) / hours[:, None]
    errors_w2 = per_mark @ per_mark.T + CAPACITY_SD**2 * np.outer(power, power)
    return SpanReadings(inside / seconds, power, errors_w2)


def since_departure(observed: Columns, plan: Plan) -> Columns:
    """Convert the times of samples from the clock of a plan to seconds since its departure.

    Raises
    ------
    InvalidInput
        If the samples begin before the trip or after it, or their current has the wrong sign.

    Examples
    --------
    >>> from tripwatt.trips import Plan
    >>> plan = Plan.from_samples(pd.DataFrame({"time_s": [60.0, 61.0], "speed_m_s": [0.0, 1.0]}))
    >>> since_departure({"time_s": np.array([60.0, 61.0]), "soc": np.full(2, 0.5)}, plan)["time_s"].tolist()
    [0.0, 1.0]
    """
    start, given = plan.start_s, observed["time_s"]
    first, last = float(given[0]), float(given[-1])
    if first - start < 0.0:
        allowed = f"{start:g} s or later"
        raise InvalidInput.of("measured before departure", f"{WHERE}, time_s", f"{first:g} s", allowed)
    end = start + plan.duration_s if plan.end_s is None else plan.end_s
    if first > end + (0.0 if plan.link_m is None else LATE_S):
        got, allowed = f"{first:g} to {last:g} s", f"{start:g} to {end:g} s"
        fix = "give times on the clock of the trip"
        raise InvalidInput.of("measured after the trip", f"{WHERE}, time_s", got, allowed, fix)
    samples = {**observed, "time_s": given - start}
    _require_sign(samples, plan)
    return samples


def _require_sign(observed: Columns, plan: Plan) -> None:
    """Raise InvalidInput if the battery would charge while the car accelerates."""
    if not {"voltage_v", "current_a"} <= observed.keys():
        return
    if "speed_m_s" not in observed and plan.link_m is not None:
        return  # the car's speed is unknown
    speed, power_w = speeds(observed, plan), observed["voltage_v"] * observed["current_a"]
    slope = apparent_mass(observed["time_s"], speed, power_w)
    if slope is not None and slope[1] < WRONG_SIGN:
        got = "the battery would charge while the car accelerates"
        allowed, fix = "positive when the battery discharges", "reverse the sign of current_a"
        raise InvalidInput.of("current has the wrong sign", f"{WHERE}, current_a", got, allowed, fix)


def speeds(samples: Columns, plan: Plan) -> FloatArray:
    """Speed at each of the samples, timed from the departure [m/s]: as measured, else as planned."""
    planned = plan.array("time_s"), plan.array("speed_m_s")
    return samples["speed_m_s"] if "speed_m_s" in samples else np.interp(samples["time_s"], *planned)


def along_the_plan(samples: Columns, plan: Plan) -> Columns:
    """Map samples to the clock of the plan: the time at which the plan is where the car was. O(samples).

    A car that is late on a planned route has more of the route to go than its time suggests. While the car stands longer
    than planned, its energy counts and the plan's clock stands still. Samples of a driven trace, and those without a speed, are
    returned unchanged.

    Parameters
    ----------
    samples : mapping of str to ndarray
        Sound samples with times since departure.
    plan : Plan

    Returns
    -------
    mapping of str to ndarray
        `time_s` by the plan's clock, `driven_s` by the car's own clock, and the measured ones among `observed_energy_wh`, `soc`,
        `displayed_soc` and the powers of climate control.
    """
    if plan.link_m is None or "speed_m_s" not in samples:
        return samples
    at = plan.array("time_s") - plan.array("time_s")[0]
    planned_m = distance_driven(at, plan.array("speed_m_s"))
    moves = np.concatenate(([True], np.diff(planned_m) > 0.0))
    time, speed = samples["time_s"], samples["speed_m_s"]
    driven = distance_driven(time, speed) + float(np.interp(time[0], at, planned_m))
    clock = np.interp(driven, planned_m[moves], at[moves])
    states = {name: samples[name] for name in ("soc", "displayed_soc") if name in samples}
    powers = {name: samples[name] for name in (*CLIMATE_COLUMNS, CLIMATE_IN_ALL) if name in samples}
    if powers:
        sound = blank_stuck_heater(table_of(samples), "")[0]  # by the log's own clock
        powers = {name: sound[name].to_numpy(dtype=np.float64) for name in powers}
    energy = measured_energy(samples)
    # keep the last sample of each standstill, and the first sample of all, from which energy is counted
    kept = np.flatnonzero(np.append(np.diff(clock) > 0.0, True))
    if kept[0] != 0:
        clock[kept[0]] += min(1e-3, 0.5 * (clock[kept[1]] - clock[0]) if len(kept) > 1 else 1e-3)
        kept = np.concatenate(([0], kept))
    # if the plan waits and the car did not, fill the time in between: nothing is missing
    wait = np.diff(clock[kept])
    gap = np.maximum.reduceat(np.diff(time), kept[:-1]) if len(kept) > 1 else np.empty(0)
    parts = np.where((wait > FILL_S) & (gap <= GAP_S), np.ceil(wait / FILL_S), 1.0).astype(np.int64)
    first = np.repeat(np.arange(len(parts)), parts)
    within = np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)
    place = np.append(first + within / parts[first], len(parts))
    order = np.arange(len(kept))
    means = {"time_s": clock, DRIVEN_S: time, "observed_energy_wh": energy, **powers}
    columns = {name: np.interp(place, order, v[kept]) for name, v in means.items() if v is not None}
    row = place.astype(np.int64)
    return columns | {name: np.where(place == row, v[kept][row], np.nan) for name, v in states.items()}


def measured_energy(samples: Columns) -> FloatArray | None:
    """Cumulative energy as of `observed_cumulative_energy`, NaN where voltage or current are missing for longer than `GAP_S`."""
    energy = observed_cumulative_energy(samples)
    if energy is None:
        return None
    pair = "voltage_v" in samples and "current_a" in samples
    names = ("voltage_v", "current_a") if pair else ("observed_energy_wh",)
    known = np.isfinite([samples[name] for name in names]).all(axis=0)
    if known.all():
        return energy
    time, at = samples["time_s"], np.flatnonzero(known)
    if not len(at):
        return None
    after = np.searchsorted(at, np.arange(len(time)))
    inside = (after > 0) & (after < len(at))
    before, after = at[np.maximum(after - 1, 0)], at[np.minimum(after, len(at) - 1)]
    bridged = inside & (time[after] - time[before] <= GAP_S)
    return np.where(known | (bridged & pair), energy, np.nan)


@lru_cache(maxsize=8)
def _own_w(drive: ExpectedTrip, corrector_share: float) -> FloatArray:
    """Power of each segment by independent terms of unit variance that are unknown of the car [W], shape (segments, any)."""
    corrector_w = corrector_share * drive.corrector.predict_with_uncertainty(drive.table)[1]
    outside_w = drive.corrector.outside_factor(drive.table) / math.sqrt(T_VARIANCE)
    # smaller terms change no forecast by a tenth of a percent
    left, sizes, _ = np.linalg.svd(np.column_stack([corrector_w, outside_w]), full_matrices=False)
    return np.asarray((left * sizes)[:, sizes > 0.01 * sizes[0]])


def updated_power(
    drive: ExpectedTrip,
    uncertainty: UncertaintyModel,
    samples: Columns,
    measured: Measured,
    readings: PowerReadings,
    sd_factor: float,
) -> tuple[ResidualPower, float]:
    """Posterior of the residual power, and the factor by which its standard deviation is widened for the rest of the trip.

    Climate control is updated separately if the samples have its power in all measured segments. What the corrector does not know of
    the car is the same on the whole trip, so that the rest has it in full, and only the remainder is shrunk. `sd_factor` is that of
    the forecast, in whose units the residual power is. O(segments).
    """
    process, shrinkage = uncertainty.process, uncertainty.shrinkage
    if not len(readings.power_w):  # no segment was measured for long enough
        return process.prior(drive.segments), 1.0
    segments = drive.segments
    prior, own_w = process.prior(segments), _own_w(drive, float(uncertainty.scale.values[3])) / sd_factor
    own_share = np.linalg.norm(segments.hours @ own_w) / prior.sd_wh(segments.hours)[-1]
    left = math.sqrt(max(1.0 - float(own_share) ** 2, 0.0))
    if isinstance(readings, SpanReadings):
        readings = replace(readings, covariance_w2=readings.covariance_w2 / sd_factor**2)
    ahead = drive.edges_s[1:] > measured.until_s + 1e-9
    fraction = min(measured.until_s / float(drive.edges_s[-1]), 1.0)
    residual = readings.power_w - readings.mean_of(drive.power_w)
    told = process.split and any(name in samples for name in TOLD_BY)
    logged = logged_climate(table_of(samples), drive.edges_s) if told else None
    needed = readings.touches(len(segments))
    expected = None if logged is None else drive.climate_w
    if logged is None or expected is None or not np.isfinite(logged[needed]).all():
        joint = readings.condition(prior.with_own(left, own_w), residual)
        return shrinkage.applied("joint", joint, ahead, fraction), shrinkage.sd_factor(False, fraction)
    seen = readings.mean_of(np.nan_to_num(logged - expected))
    climate = readings.condition(process.prior(segments, "climate"), process.limited(seen), exact=True)
    driving = readings.condition(process.prior(segments, "drive").with_own(left, own_w), residual - seen)
    if is_off(logged[needed], segments.step_s[needed]):
        off = PowerSum((climate,), np.where(ahead, -expected, climate.mean_w))
        climate = shrinkage.applied("off", off, ahead, fraction)
    else:
        climate = shrinkage.applied("climate", climate, ahead, fraction)
    driving = shrinkage.applied("drive", driving, ahead, fraction)
    return PowerSum((climate, driving), climate.mean_w + driving.mean_w), shrinkage.sd_factor(True, fraction)
