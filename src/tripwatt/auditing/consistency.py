"""Rules that compare physically related quantities: charge and state of charge, power and acceleration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.auditing.findings import Change, Finding, array, between, blanking, has, whole
from tripwatt.trips import Recorded
from tripwatt.trips.inertia import WRONG_SIGN, apparent_mass
from tripwatt.trips.messages import signal_name
from tripwatt.units import SECONDS_PER_HOUR

SMALLEST_SOC_CHANGE: Final = 0.03
"""Smallest change of the state of charge from which a capacity counts for the car's median."""


OF_ANOTHER_CAR: Final = 2
"""Number of other drives with the same deviating capacity from which another car is assumed, not a fault."""


SOC_JUMP: Final = 0.03


STANDING_M_S: Final = 0.3


@dataclass(frozen=True, slots=True)
class Balance:
    """Charge drawn [Ah] and fall of the state of charge over the same span of a drive.

    `resolution` is the step of the state of charge.
    """

    charge_ah: float
    soc_change: float
    resolution: float

    @property
    def capacity_ah(self) -> float:
        """Capacity of the battery [Ah]: charge over change of state of charge; NaN if the latter is 0."""
        return self.charge_ah / self.soc_change if self.soc_change else float("nan")

    def fits(self, capacity_ah: float, std: float) -> bool:
        """Return whether a battery of a capacity explains the change of state of charge."""
        expected = self.charge_ah / capacity_ah
        # 0.1: usual relative error of the state of charge of a battery management (ageing, temperature,
        # balancing)
        allowed = 0.1 * max(abs(expected), abs(self.soc_change))
        # 0.01: correction of the state of charge that a battery management may make during a drive, beyond
        # two steps of its resolution
        allowed += 2.0 * self.resolution + 0.01
        # 5.0: error of the state of charge that is allowed, in standard deviations of the car's own
        # scatter (near full some displays stand still for kilometres); 5 of them leave one sound drive in
        # a million outside
        return abs(expected - self.soc_change) <= max(allowed, 5.0 * std)


def charge_balance(samples: pd.DataFrame) -> Balance | None:
    """Balance between the first and the last sample with a state of charge; None without states of charge or currents."""
    if not (has(samples, "soc") and has(samples, "current_a")):
        return None
    time, soc, current = (array(samples, c) for c in ("time_s", "soc", "current_a"))
    known = np.flatnonzero(np.isfinite(soc))
    first, last = int(known[0]), int(known[-1])
    number = np.arange(len(samples))
    use = np.isfinite(current) & (number >= first) & (number <= last)
    if use.sum() < 2:
        return None
    charge = float(np.trapezoid(current[use], time[use])) / SECONDS_PER_HOUR
    return Balance(charge, float(soc[first] - soc[last]), soc_resolution(soc[known]))


def soc_resolution(soc: FloatArray) -> float:
    """Median step between values at which the state of charge rests for several samples; 0 if it never rests.

    Examples
    --------
    >>> round(soc_resolution(np.array([0.5, 0.5, 0.5, 0.4925, 0.485, 0.485, 0.485, 0.47, 0.47])), 4)
    0.015
    """
    resting = soc[1:][np.diff(soc) == 0]
    steps = np.abs(np.diff(resting))
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 0.0


def soc_findings(trips: Sequence[Recorded], sound: Sequence[bool]) -> dict[str, list[Finding]]:
    """Find drives whose charge contradicts their state of charge; return the findings by trip id.

    Charge is compared rather than energy: a battery management counts charge, so its ratio to the state of charge is the
    capacity at any level, while energy depends on the level through the voltage. `sound` marks the drives that count for the
    median capacity.
    """
    balances = {t.trip_id: b for t in trips if (b := charge_balance(t.samples)) is not None}
    steps = [b.resolution for b in balances.values() if b.resolution > 0.0]
    if steps:  # a drive too short for one step has no resolution of its own
        usual = float(np.median(steps))
        balances = {k: replace(b, resolution=max(b.resolution, usual)) for k, b in balances.items()}
    capacities = {
        t.trip_id: balances[t.trip_id].capacity_ah
        for t, is_sound in zip(trips, sound, strict=True)
        if is_sound and t.trip_id in balances and abs(balances[t.trip_id].soc_change) >= SMALLEST_SOC_CHANGE
    }
    std, median = 0.0, None
    # 5: smallest number of drives whose median capacity is used
    if len(capacities) >= 5:
        median = float(np.median(list(capacities.values())))
        errors = np.array([b.soc_change - b.charge_ah / median for b in balances.values()])
        # 1.4826: standard deviation of a normal distribution per median absolute deviation
        std = 1.4826 * float(np.median(np.abs(errors - np.median(errors))))
    judged = (
        _soc_finding(t, balances[t.trip_id], capacities, median, std) for t in trips if t.trip_id in balances
    )
    return {finding.trip: [finding] for finding in judged if finding is not None}


def _soc_finding(
    trip: Recorded, balance: Balance, capacities: Mapping[str, float], median: float | None, std: float
) -> Finding | None:
    """Judge the balance of one drive by the capacities of the sound drives; None if nothing is wrong."""
    low, high = 10.0, 1500.0  # Ah, from a light quadricycle's pack to a heavy truck's
    change = (
        f"{balance.charge_ah:.2f} Ah for a change of the state of charge of {100 * balance.soc_change:.1f} %"
    )
    if abs(balance.soc_change) >= 2 * SMALLEST_SOC_CHANGE and not low <= balance.capacity_ah <= high:
        what = f"{change} corresponds to a battery of {balance.capacity_ah:.3g} Ah: check unit and sign of the current"
        return whole(trip.samples, trip.trip_id, what, "set aside")
    if median is None or balance.fits(median, std):
        return None
    stopped = stopped_soc(trip, median, std)
    if stopped is not None:
        return stopped
    agreeing = sum(balance.fits(c, std) for other, c in capacities.items() if other != trip.trip_id)
    what = f"energy contradicts state of charge: {change}; the battery of the other drives, {median:.1f} Ah, gives "
    what += f"{100 * balance.charge_ah / median:.1f} %"
    if agreeing >= OF_ANOTHER_CAR:
        what += f"; {agreeing} other drives agree with this one, so this may be another car"
    return whole(trip.samples, trip.trip_id, what, "noted" if agreeing >= OF_ANOTHER_CAR else "set aside")


def stopped_soc(trip: Recorded, capacity_ah: float, std: float) -> Finding | None:
    """Say that the sensor of the charge stopped, for a trip whose charge balance as a whole does not fit. None if it did not stop.

    The sensor stopped at the last change of the state of charge if the balance up to there fits; then the energy is sound.
    """
    soc = array(trip.samples, "soc")
    known = np.flatnonzero(np.isfinite(soc))
    moved = np.flatnonzero(np.diff(soc[known]) != 0)
    if not len(moved):
        return None
    stop = int(known[moved[-1] + 1])
    before = charge_balance(trip.samples.iloc[: stop + 1])
    if before is None or abs(before.soc_change) < SMALLEST_SOC_CHANGE or not before.fits(capacity_ah, std):
        return None
    what = f"state of charge stays at {soc[stop]:.3f} while the battery delivers current: the sensor stopped"
    return between(trip.samples, trip.trip_id, (stop, -1), what, "noted")


@blanking
def blank_soc_faults(samples: pd.DataFrame, trip_id: str) -> Iterator[Change]:
    """Blank zeros and impossible jumps of the state of charge; report states of charge that are missing for long at an end."""
    time = array(samples, "time_s")
    for name in (name for name in ("soc", "displayed_soc") if has(samples, name)):
        soc = array(samples, name)
        bad = stray_soc(time, soc)
        if bad.any():
            what = f"{signal_name(name)} of {np.nanmin(soc[bad]):g} in {int(bad.sum())} samples is a jump: these values are removed"
            soc = np.where(bad, np.nan, soc)
            yield name, soc, between(samples, trip_id, np.flatnonzero(bad), what, "noted")
        if name == "soc" and np.isfinite(soc).any():
            for finding in missing_soc(time, soc, trip_id):
                yield name, None, finding


def stray_soc(time: FloatArray, soc: FloatArray) -> BoolArray:
    """Mark faulty states of charge, shape (samples,).

    Faulty are zeros beside a jump, and pieces between jumps whose level differs from that of the longest piece.
    """
    stray = np.zeros(len(soc), dtype=bool)
    if np.nanmax(soc) > SOC_JUMP:  # a 0 beside a jump means that the sensor is off, however long it lasts
        zero = soc == 0.0
        beside = np.diff(soc, prepend=soc[:1]), np.diff(soc, append=soc[-1:])
        if bool(np.any(zero & ((np.abs(beside[0]) > SOC_JUMP) | (np.abs(beside[1]) > SOC_JUMP)))):
            stray |= zero
    known = np.flatnonzero(np.isfinite(soc) & ~stray)
    step, seconds = np.diff(soc[known]), np.diff(time[known])
    # 1 / 360: ten times the capacity in an hour: no passenger car charges or discharges faster
    jumps = (np.abs(step) > SOC_JUMP) & (np.abs(step) > seconds / 360.0)
    if not jumps.any():
        return stray
    piece = np.concatenate(([0], np.cumsum(jumps)))
    longest = np.bincount(piece).argmax()
    level = np.median(soc[known][piece == longest])
    away = (piece != longest) & (np.abs(soc[known] - level) > SOC_JUMP)
    stray[known[away]] = True
    return stray


def missing_soc(time: FloatArray, soc: FloatArray, trip_id: str) -> Iterator[Finding]:
    """Find a state of charge that is missing for long at the start or at the end."""
    known = np.flatnonzero(np.isfinite(soc))
    spans = ((0, int(known[0]), "start"), (int(known[-1]), len(soc) - 1, "end"))
    for first, last, where in spans:
        # 10.0: a shorter gap at an end is not reported: logs commonly lack the state of charge of the last
        # second or two
        if time[last] - time[first] > 10.0:
            what = f"state of charge is missing for {time[last] - time[first]:.1f} s at the {where}"
            yield Finding(trip_id, float(time[first]), float(time[last]), what, "noted")


def unit_findings(trip: Recorded) -> list[Finding]:
    """Find speed, current or voltage in a wrong unit or with the wrong sign, by the car's apparent mass."""
    samples = trip.samples
    power = array(samples, "voltage_v") * array(samples, "current_a")
    answer = apparent_mass(array(samples, "time_s"), array(samples, "speed_m_s"), power)
    if answer is None:
        return []
    mass, correlation = answer
    if correlation < WRONG_SIGN:
        what = "the battery charges while the car accelerates: the current has the wrong sign; reverse it"
        return [whole(trip.samples, trip.trip_id, what, "set aside")]
    low, high = 450.0, 8000.0  # kg, a car's mass over its driveline efficiency
    if low <= mass <= high or correlation < 0.5:  # with a weaker correlation the mass is not clear
        return []
    heavy = "speed in m/s read as km/h, or a current in dA or mA read as A"
    guess = heavy if mass > high else "speed in km/h read as m/s, or a current or a voltage that is too small"
    what = (
        f"power and acceleration correspond to a car of {mass:.3g} kg: a unit is wrong, for example {guess}"
    )
    return [whole(trip.samples, trip.trip_id, what, "set aside")]


def offset_findings(trip: Recorded) -> Iterator[Finding]:
    """Find a current with an offset: a power at standstill or an energy that no load and no road explain."""
    energy, samples = trip.observed_energy_wh, trip.samples
    if energy is None:
        return
    if has(samples, "voltage_v") and has(samples, "current_a"):
        power = array(samples, "voltage_v") * array(samples, "current_a")
        standing = (array(samples, "speed_m_s") < STANDING_M_S) & np.isfinite(power)
        # 10: smallest number of samples at standstill for a median
        # 25_000.0: power of a standing car that shows an offset: more than heater, air conditioner and
        # base load together
        if standing.sum() >= 10 and float(np.median(power[standing])) > 25_000.0:
            mean_kw = np.median(power[standing]) / 1000.0
            what = f"the battery gives {mean_kw:.0f} kW while the car stands: the current has an offset"
            yield whole(samples, trip.trip_id, what, "set aside")
            return
    distance_km = trip.distance_m / 1000.0
    if has(samples, "elevation_m"):
        height = array(samples, "elevation_m")
        height = height[np.isfinite(height)]
        # 30.0: margin for errors of a logged height and for the kinetic energy at the start (30 m are
        # worth 88 km/h)
        drop = max(float(height[0] - height[-1]), 0.0) + 30.0
    else:
        # 0.1: descent assumed for a road of unknown elevation: mean of the steepest long roads
        drop = 0.1 * trip.distance_m
    # 3500.0: largest mass of a passenger car
    gained = 3500.0 * 9.81 * drop / SECONDS_PER_HOUR
    if -energy > gained:
        what = (
            f"the battery gains {-energy / max(distance_km, 1e-3):.0f} Wh/km on a road that falls by at most {drop:.0f} m: "
            "the current has an offset or the wrong sign"
        )
        yield whole(samples, trip.trip_id, what, "set aside")
    # 3000.0: largest possible consumption: twice that of a loaded 40 t truck
    # 5.0: on shorter drives preheating may take most of the energy
    elif distance_km >= 5.0 and energy > 3000.0 * distance_km:
        what = f"{energy / distance_km:.0f} Wh/km: the current has an offset or the wrong unit"
        yield whole(samples, trip.trip_id, what, "set aside")


def energy_error_findings(trip: Recorded) -> Iterator[Finding]:
    """Find an energy with a large standard error, as on short trips with a charge in whole percent or a power in whole kW."""
    error, energy = trip.observed_energy_std_wh, trip.observed_energy_wh
    if error is None or energy is None:
        return
    # 0.5: standard error over the energy from which the energy counts as unknown: two standard errors
    # reach 0
    useless = not error < 0.5 * energy
    # 0.25: standard error over the energy above which it is reported; a forecast's own error is smaller
    if useless or error > 0.25 * energy:
        measured = has(trip.samples, "voltage_v") and has(trip.samples, "current_a")
        source = "a coarse or seldom power" if measured else "a counter or the state of charge"
        verdict = "too inaccurate to use" if useless else "inaccurate"
        what = f"energy from {source} is {energy:.0f} Wh with a standard error of {error:.0f} Wh: {verdict}"
        yield whole(trip.samples, trip.trip_id, what, "set aside" if useless else "noted")
