"""Faults of measurements and forecasts that no battery or trip can have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, distance_driven, running_sum
from tripwatt.errors import Fault, or_none, percent
from tripwatt.forecasting.expected import MIN_RESISTANCE, ExpectedTrip
from tripwatt.forecasting.measured import MAX_STRETCH, WHERE, ChargeReading, Columns, measured_energy, speeds
from tripwatt.physics.batch import trip_totals
from tripwatt.physics.battery import internal_resistance, largest_power, open_circuit_voltage
from tripwatt.trips import Trip
from tripwatt.units import GRAVITY_M_S2, SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.relations import PEAK_EFFICIENCY

LATE_S: Final = 60.0
"""Time [s] after the end of a driven speed trace up to which samples may belong to it."""

STEADY_M_S: Final = 2.0
STEADY_S: Final = 120.0
"""A speed is held if it stays within a range of `STEADY_M_S` [m/s] for at least `STEADY_S` [s]."""


def implausible_faults(samples: Columns, drive: ExpectedTrip) -> Iterator[Fault]:
    """Yield every reason why measured samples cannot be those of this car on this trip. O(samples + segments).

    Parameters
    ----------
    samples : mapping of str to ndarray
        Sound samples, timed from the departure.
    drive : ExpectedTrip

    Notes
    -----
    The energy taken from a battery is at most its charge at the highest open-circuit voltage. The charge rises on the way by at most
    the potential energy of the descent; with losses, regenerative braking gives less. The energy over a stretch of road is at least
    that of climb, change of speed and half of the rolling resistance. Less energy indicates, for example, a current of the wrong sign.
    """
    last, planned = float(samples["time_s"][-1]), drive.plan.duration_s
    if drive.plan.link_m is None:
        end = drive.plan.end_s
        most = (planned if end is None else end - drive.plan.start_s) + LATE_S
    else:
        most = np.inf if "speed_m_s" in samples and samples["speed_m_s"].any() else MAX_STRETCH * planned
    if last > most:
        is_trace = drive.plan.link_m is None
        fix = "give the samples of this trip" if is_trace else "give the speed with the samples"
        allowed = f"at most {most:g} s after the departure"
        yield Fault("measured after the trip", f"{WHERE}, time_s", f"{last:g} s", allowed, fix)
    cumulative = measured_energy(samples)
    if cumulative is not None:
        yield from _energy_faults(cumulative, drive)
        yield from _motion_faults(samples, cumulative, drive)
    yield from _charge_faults(samples, drive)


def absurd_energy(vehicle: Vehicle, trips: Sequence[Trip], where: str) -> Iterator[Fault]:
    """Yield a fault if the measured energy of most trips is not one that the car can take on them. O(samples of 100 trips).

    Parameters
    ----------
    vehicle : Vehicle
    trips : sequence of Trip
        Audited trips of one source.
    where : str
        The source, for the message.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> list(absurd_energy(load_vehicle("nissan_leaf_24"), [], "drives"))
    []
    """
    longest = sorted(trips, key=lambda trip: -trip.distance_m)[:100]  # 100: more trips hardly move the median
    totals = or_none(trip_totals, ((vehicle, trip) for trip in longest)) or {}
    pairs = zip(longest, totals.get("energy_wh", ()), strict=False)
    ratios = [(trip.observed_energy_wh or 0.0) / energy_wh for trip, energy_wh in pairs if energy_wh > 0.0]
    # 0.4, 2.5: neither weather nor load nor a wrong car of the same class explains such an energy
    if ratios and not 0.4 <= median(ratios) <= 2.5:
        got = f"{median(ratios):.3g} times the energy of {vehicle.title}"
        fix = "check the units of power and speed, and the car; `implausible` learns the trips as they are"
        yield Fault("implausible energy", where, got, "0.4 to 2.5 times, in most trips", fix)


def contradicts_energy(reading: ChargeReading | None, samples: Columns, wh_per_charge: float) -> bool:
    """Return whether a last reading of the charge cannot be that of the battery, by the energy that was measured since the first one.

    Parameters
    ----------
    reading : ChargeReading or None
        The last reading, with the first one of the same kind.
    samples : mapping of str to ndarray
        Sound samples, timed from the departure.
    wh_per_charge : float
        Energy from an empty to a full battery on the scale of the reading [Wh].
    """
    cumulative = measured_energy(samples)
    if reading is None or reading.first is None or cumulative is None:
        return False
    known = np.isfinite(cumulative)
    times = (reading.first.time_s, reading.time_s)
    taken = float(np.diff(np.interp(times, samples["time_s"][known], cumulative[known]))[0]) / wh_per_charge
    is_empty = reading.value <= 0.0 and reading.first.value <= 0.0 and taken > 0.0
    dropped = reading.first.value - reading.value
    # choices: 5 points for rounding and delay of a display, and 30 %, the energy that an aged battery lacks
    return is_empty or abs(dropped - taken) > 0.05 + 0.3 * max(abs(taken), abs(dropped))


def impossible_faults(energy_wh: float, drive: ExpectedTrip) -> Iterator[Fault]:
    """Yield a fault if a forecast energy breaks a law of physics. O(samples).

    Parameters
    ----------
    energy_wh : float
        Energy of the whole trip at the battery [Wh].
    drive : ExpectedTrip

    Notes
    -----
    Losses and loads take energy. So a drive takes at least the energy gained by climb and change of speed, minus what a tail wind
    gives. If the car lacks power to follow the trip, the energy gained is less, and the least energy is at most 0. A drive takes at
    most what battery and motor give if they run at their limits all the time.
    """
    cause = drive.simulation.by_cause_wh
    gain = cause["climb"] + cause["acceleration"]
    # a load or a wrong mass may change half of the energy of climb and acceleration
    least = gain - 0.5 * abs(gain) + min(cause["air"], 0.0)
    if cause["shortfall"] < 0.0:
        least = min(least, 0.0)
    hours = drive.plan.duration_s / SECONDS_PER_HOUR
    motor_w = drive.vehicle.drivetrain.motor_max_power_w / PEAK_EFFICIENCY[0]
    loads_wh = cause["base_load"] + cause["climate"]
    most = min(_battery_most_w(drive) * hours, motor_w * hours + loads_wh)
    if least - 1.0 <= energy_wh <= most + 1.0:  # the sums of a long trip are rounded
        return
    where = f"{drive.vehicle.name}, {drive.plan.trip_id}"
    allowed = f"{round(least / 1000.0, 2) + 0.0:g} to {most / 1000.0:.3g} kWh on this trip"
    fix = "check the values of the car and the speeds of the trip"
    if cause["shortfall"] < 0.0:
        fix += f": the car lacks {-cause['shortfall'] / 1000.0:.3g} kWh to follow them"
    yield Fault("energy that physics forbids", where, f"{energy_wh / 1000.0:.3g} kWh", allowed, fix)


def _battery_most_w(drive: ExpectedTrip) -> float:
    """Largest power of the battery on the way [W]: that of a full battery at its highest temperature."""
    battery, warmest = drive.vehicle.battery, drive.simulation.battery_temperature_degc.max()
    soc = np.asarray(battery.resistance_soc)
    resistance = internal_resistance(soc, np.full_like(soc, warmest), battery).min()
    floor = battery.min_cell_voltage_v * battery.cells_in_series
    return float(largest_power(open_circuit_voltage(np.ones(1), battery), resistance, floor)[0])


def battery_wh(drive: ExpectedTrip) -> float:
    """Largest energy of the car's battery [Wh]: its charge at the highest open-circuit voltage."""
    battery = drive.vehicle.battery
    return battery.capacity_ah * float(open_circuit_voltage(np.ones(1), battery)[0])


def _energy_faults(cumulative: FloatArray, drive: ExpectedTrip) -> Iterator[Fault]:
    known = cumulative[np.isfinite(cumulative)]
    # a new battery may hold more than its data sheet says
    holds, taken = battery_wh(drive), float(np.ptp(known)) if len(known) else 0.0
    most = 1.15 * holds
    if taken > most:
        got = f"{taken / 1000.0:.1f} kWh from a battery of {holds / 1000.0:.1f} kWh"
        fix = "check the units of voltage_v and current_a"
        yield Fault("more energy than the battery holds", WHERE, got, f"at most {most / 1000.0:.1f} kWh", fix)


def _motion_faults(samples: Columns, cumulative: FloatArray, drive: ExpectedTrip) -> Iterator[Fault]:
    """Yield a fault if the energy is below that of rolling, climb and speed on the road that was driven. O(samples)."""
    known = np.flatnonzero(np.isfinite(cumulative))
    if len(known) < 2:
        return
    time, speed = samples["time_s"], speeds(samples, drive.plan)
    # before a late first sample the road is assumed to be driven as planned
    start_m = float(np.interp(time[0], drive.edges_s, drive.distance_m))
    driven = start_m + distance_driven(time, speed)
    first, last = (int(known[i]) for i in (0, -1))
    taken = float(cumulative[last] - cumulative[first])
    length = float(driven[last] - driven[first])
    # quantiles: starting and stopping do not hide a steady speed
    low, high = np.quantile(speed[first : last + 1], (0.1, 0.9))
    is_steady = float(high - low) <= STEADY_M_S and time[last] - time[first] >= STEADY_S
    # mountain passes fall by 12 % and 1,500 m at most, motorways, on which a speed is held, by 5 %
    fall_m = min((0.05 if is_steady else 0.12) * length, 1500.0)
    if drive.plan.has_road:
        fall_m = 40.0  # error of the difference of two heights; a filled gap of a log jumps by half of this
    ends = (float(driven[first]), float(driven[last])), (float(speed[first]), float(speed[last]))
    least = _min_wh(drive, *ends) - _weight_wh_m(drive) * fall_m
    if taken < least:
        got = f"{taken / 1000.0:.2f} kWh over {length / 1000.0:.1f} km"
        allowed = f"at least {least / 1000.0:.2f} kWh"
        fix = (
            "the current must be positive when the battery discharges: negate it; after charging, forecast the rest as a new "
            "trip; for a descent, give the elevation of the road"
        )
        yield Fault("less energy than the drive takes", WHERE, got, allowed, fix)


def _min_wh(drive: ExpectedTrip, from_to_m: tuple[float, float], speeds_m_s: tuple[float, float]) -> float:
    """Least energy at the terminals [Wh] between two distances along the known road, with the speeds at both."""
    columns, hours = drive.table.columns, drive.table.hours

    def between(cause: str) -> float:
        energy = running_sum(columns[f"{cause}_w"] * hours)
        start, end = np.interp(from_to_m, drive.distance_m, energy)
        return float(end - start)

    inertia = _mass_kg(drive) * drive.vehicle.body.rotating_mass_factor
    kinetic = 0.5 * inertia * (speeds_m_s[1] ** 2 - speeds_m_s[0] ** 2) / SECONDS_PER_HOUR
    return MIN_RESISTANCE * between("rolling") + between("climb") + kinetic


def _mass_kg(drive: ExpectedTrip) -> float:
    return drive.vehicle.body.test_mass_kg + (drive.plan.departure.payload_mass_kg or 0.0)


def _weight_wh_m(drive: ExpectedTrip) -> float:
    """Potential energy of the car per metre of height [Wh/m]."""
    return _mass_kg(drive) * GRAVITY_M_S2 / SECONDS_PER_HOUR


def _charge_faults(samples: Columns, drive: ExpectedTrip) -> Iterator[Fault]:
    further_m = 0.0 if drive.plan.has_road else 500.0  # descent that a road of unknown elevation may have
    planned_wh = _largest_rise(-running_sum(drive.table.columns["climb_w"] * drive.table.hours))
    # 5 points: corrections by the battery management and regenerative braking
    allowed = 0.05 + (planned_wh + _weight_wh_m(drive) * further_m) / battery_wh(drive)
    for name in ("soc", "displayed_soc"):
        values = samples.get(name, np.empty(0))
        rise = _largest_rise(values[np.isfinite(values)])
        if rise > allowed:
            got, most = f"a rise of {percent(rise)} on the way", f"at most {percent(allowed)} on this road"
            fix = "forecast the rest as a new trip after charging, or give the elevation of the road"
            yield Fault("charge rises", f"{WHERE}, {name}", got, most, fix)


def _largest_rise(values: FloatArray) -> float:
    return float(np.max(values - np.minimum.accumulate(values))) if len(values) else 0.0
