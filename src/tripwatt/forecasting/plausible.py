"""Measurements and forecasts that no battery and no trip can have: they are refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault
from tripwatt.forecasting.expected import ExpectedDrive
from tripwatt.forecasting.measured import MOST_STRETCH, measured_energy
from tripwatt.physics.battery import internal_resistance, largest_power, open_circuit_voltage
from tripwatt.units import GRAVITY_M_S2, SECONDS_PER_HOUR
from tripwatt.vehicles.relations import LEAST_PEAK_EFFICIENCY

CAPACITY_MARGIN: Final = 1.15
"""Largest energy on the way over what the battery of the car holds: a new battery may hold more than its data sheet."""

SOC_MARGIN: Final = 0.05
"""Rise of a state of charge that corrections of a battery management and regenerative braking explain."""

UNKNOWN_DESCENT_M: Final = 500.0
"""Descent that a road of unknown elevation may have [m]."""

LATE_S: Final = 60.0
"""Time [s] after the end of a driven speed trace up to which samples may belong to it."""

MASS_MARGIN: Final = 0.5
"""Share by which a correction that was learned may change the energy of climb and speed: a load, or a wrong mass."""

ROUNDING_WH: Final = 1.0
"""Error of the sums of a long trip."""


def implausible_faults(samples: pd.DataFrame, drive: ExpectedDrive) -> Iterator[Fault]:
    """Every reason why samples measured on the way are not those of this car on this trip. O(samples + segments).

    Parameters
    ----------
    samples : DataFrame
        Sound samples, timed from the departure.
    drive : ExpectedDrive

    Notes
    -----
    The energy out of a battery is at most its charge at the highest open-circuit voltage. Its charge rises on the way by
    at most the potential energy of the descent: with losses, regenerative braking gives less.
    """
    where = "observed samples"
    last, planned = float(samples["time_s"].iloc[-1]), drive.plan.duration_s
    if drive.plan.link_m is None:
        end = drive.plan.end_s
        most = (planned if end is None else end - drive.plan.start_s) + LATE_S
    else:
        most = np.inf if "speed_m_s" in samples and samples["speed_m_s"].any() else MOST_STRETCH * planned
    if last > most:
        fix = (
            "give the speed with the samples"
            if drive.plan.link_m is not None
            else "give the samples of this trip"
        )
        allowed = f"at most {most:g} s after the departure"
        yield Fault("measured after the trip", f"{where}, time_s", f"{last:g} s", allowed, fix)
    yield from _energy_faults(samples, drive, where)
    yield from _charge_faults(samples, drive, where)


def impossible_faults(energy_wh: float, drive: ExpectedDrive) -> Iterator[Fault]:
    """The reason why a forecast energy breaks a law of physics; nothing for one that a car can take. O(samples).

    Parameters
    ----------
    energy_wh : float
        Of the whole trip at the battery [Wh].
    drive : ExpectedDrive

    Notes
    -----
    Losses and loads take energy. So a drive takes at least what its climb and its change of speed gain, less what a tail
    wind gives; where the car lacks power for it, it gains less, but it gives no more than it ends lower or slower. It takes at most
    what battery and motor give at their limits all the time.
    """
    cause = {name: float(energy[-1]) for name, energy in drive.simulation.energy_by_cause_wh.items()}
    gain = cause["climb"] + cause["acceleration"]
    least = gain - MASS_MARGIN * abs(gain) + min(cause["air"], 0.0)
    if cause["shortfall"] < 0.0:
        least = min(least, 0.0)
    hours = drive.plan.duration_s / SECONDS_PER_HOUR
    motor_w = drive.vehicle.drivetrain.motor_max_power_w / LEAST_PEAK_EFFICIENCY
    loads_wh = cause["base_load"] + cause["hvac"]
    most = min(_battery_most_w(drive) * hours, motor_w * hours + loads_wh)
    if least - ROUNDING_WH <= energy_wh <= most + ROUNDING_WH:
        return
    where = f"{drive.vehicle.name}, {drive.plan.trip_id}"
    allowed = f"{round(least / 1000.0, 2) + 0.0:g} to {most / 1000.0:.3g} kWh on this trip"
    fix = "check the values of the car and the speeds of the trip"
    if cause["shortfall"] < 0.0:
        fix += f": the car lacks {-cause['shortfall'] / 1000.0:.3g} kWh to follow them"
    yield Fault("energy that physics forbids", where, f"{energy_wh / 1000.0:.3g} kWh", allowed, fix)


def _battery_most_w(drive: ExpectedDrive) -> float:
    """Largest power of the battery on the way [W]: full, and as warm as it gets."""
    battery, warmest = drive.vehicle.battery, drive.simulation.battery_temperature_degc.max()
    soc = np.asarray(battery.resistance_soc)
    resistance = internal_resistance(soc, np.full_like(soc, warmest), battery).min()
    floor = battery.min_cell_voltage_v * battery.cells_in_series
    return float(largest_power(open_circuit_voltage(np.ones(1), battery), resistance, floor)[0])


def battery_wh(drive: ExpectedDrive) -> float:
    """Energy that the battery of a car holds at most [Wh]: its charge at the highest open-circuit voltage."""
    battery = drive.vehicle.battery
    return battery.capacity_ah * float(open_circuit_voltage(np.ones(1), battery)[0])


def _energy_faults(samples: pd.DataFrame, drive: ExpectedDrive, where: str) -> Iterator[Fault]:
    cumulative = measured_energy(samples)
    known = np.empty(0) if cumulative is None else cumulative[np.isfinite(cumulative)]
    most = CAPACITY_MARGIN * battery_wh(drive)
    if len(known) and float(np.ptp(known)) > most:
        got = (
            f"{float(np.ptp(known)) / 1000.0:.1f} kWh from a battery of {battery_wh(drive) / 1000.0:.1f} kWh"
        )
        fix = "check the units of voltage_v and current_a"
        yield Fault("more energy than the battery holds", where, got, f"at most {most / 1000.0:.1f} kWh", fix)


def _charge_faults(samples: pd.DataFrame, drive: ExpectedDrive, where: str) -> Iterator[Fault]:
    allowed = SOC_MARGIN + _descent_wh(drive) / battery_wh(drive)
    for name in ("soc", "displayed_soc"):
        if name not in samples:
            continue
        values = samples[name].to_numpy(dtype=np.float64)
        values = values[np.isfinite(values)]
        rise = _largest_rise(values)
        if rise > allowed:
            got = f"a rise of {rise:.0%} on the way"
            fix = "forecast the rest as a new trip after charging, or give the elevation of the road"
            yield Fault("charge rises", f"{where}, {name}", got, f"at most {allowed:.0%} on this road", fix)


def _largest_rise(values: FloatArray) -> float:
    return float(np.max(values - np.minimum.accumulate(values))) if len(values) else 0.0


def _descent_wh(drive: ExpectedDrive) -> float:
    """Potential energy of the largest descent of the road [Wh]."""
    if not drive.plan.has_road:
        mass = drive.vehicle.body.test_mass_kg + (drive.plan.departure.payload_mass_kg or 0.0)
        return mass * GRAVITY_M_S2 * UNKNOWN_DESCENT_M / SECONDS_PER_HOUR
    climb = np.cumsum(drive.table.features["climb_w"].to_numpy() * drive.table.hours)
    return _largest_rise(np.concatenate(([0.0], -climb)))
