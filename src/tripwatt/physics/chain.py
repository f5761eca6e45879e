"""The chain road load -> drivetrain -> auxiliaries -> battery, computed over whole trips at once, for one trip or many.

For one trip, arrays along it have shape (samples,) and single values are numbers. For several trips, arrays have shape
(trips, samples), and single values, those of the car included, are columns of shape (trips, 1). Shorter trips are padded with
intervals of zero length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, changes
from tripwatt.physics.battery import BatteryRun, discharge, first_guess, shift
from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.drivetrain import Propulsion, propulsion, regeneration_acceptance, with_refused
from tripwatt.physics.road_load import (
    aero_drag_force,
    grade_force,
    inertia_force,
    rolling_factor,
    rolling_resistance_force,
    wet_factor,
)
from tripwatt.trips import Flag
from tripwatt.units import SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Vehicle

CAUSE_NAMES: Final = {
    "air": "air drag",
    "rolling": "rolling",
    "climb": "climb",
    "acceleration": "change of speed",
    "friction_brakes": "friction brakes",
    "drivetrain": "drivetrain",
    "base_load": "base load",
    "climate": "climate",
    "shortfall": "not delivered",
}
"""Cause of `CAUSES` -> its name in plots and texts."""

CAUSES: Final = tuple(CAUSE_NAMES)
"""Keys of `Simulation.power_by_cause_w`; `shortfall` is the power that the trace needs beyond the car's limits."""


@dataclass(frozen=True, eq=False, slots=True)
class Trace:
    """One or several drives by intervals. Arrays have shape (..., samples); each interval ends at a sample, the first has no length.

    `beyond` marks the padding after the end of shorter drives; None if there is no padding.
    """

    time_s: FloatArray
    step_s: FloatArray
    mean_speed_m_s: FloatArray
    acceleration_m_s2: FloatArray
    grade: FloatArray
    headwind_m_s: FloatArray | None
    beyond: BoolArray | None = None

    @classmethod
    def from_samples(
        cls,
        time: FloatArray,
        speed: FloatArray,
        grade: FloatArray,
        headwind: FloatArray | None,
        beyond: BoolArray | None = None,
    ) -> Trace:
        """Make intervals from samples; `grade` is already the one of the intervals."""
        step = changes(time)
        mean_speed = speed.copy()
        mean_speed[..., 1:] = 0.5 * (speed[..., 1:] + speed[..., :-1])
        acceleration = np.divide(changes(speed), step, out=np.zeros_like(speed), where=step > 0.0)
        if beyond is not None:
            mean_speed[beyond] = 0.0
        if step.ndim > 1 and (step == step[:1]).all():
            step = step[:1]
        return cls(time, step, mean_speed, acceleration, grade, headwind, beyond)


Flags = tuple[Flag, ...]

# after this array is freed, the C library of this process no longer hands freed memory back to the system: new pages would cost more
# time than the chain
np.empty(3_000_000)


def drive_chain(
    vehicle: Vehicle, trace: Trace, conditions: DriveConditions, climate_power_w: FloatArray
) -> tuple[dict[str, Any], list[Flags]]:
    """Compute road load, drivetrain, auxiliaries and battery, one after the other. O(samples).

    Parameters
    ----------
    vehicle : Vehicle
    trace : Trace
    conditions : DriveConditions
        Its air density has to be set.
    climate_power_w : ndarray, shape (..., samples)
        Electric power of climate control [W].

    Returns
    -------
    dict of str to ndarray
        The arrays of `Simulation` except those of the cabin, shape (..., samples).
    list of tuple of Flag
        The flags of each trip.
    """
    air, rolling, climb, inertia = _forces(vehicle, trace, conditions)
    speed, step = trace.mean_speed_m_s, trace.step_s
    wheel_power = (air + rolling + climb + inertia) * speed
    # the moving load rises with speed and is whole from walking pace, 5 km/h, on; a choice: a noisy speed of a standing car then
    # adds next to nothing
    loads, share = vehicle.auxiliaries, np.minimum(speed * (1.0 / 1.4), 1.0)
    base_load = loads.base_load_w + (1.0 - conditions.on_dynamometer) * loads.moving_load_w * share
    auxiliary = climate_power_w + base_load
    drive, battery = _drive_and_battery(vehicle, trace, wheel_power, auxiliary, conditions)
    lost_wh = _lost_when_full_wh(vehicle, trace, wheel_power, drive, battery)
    shortfall = drive.shortfall_power_w + (drive.motor_power_w + auxiliary - battery.power_w)
    driven = wheel_power + drive.friction_brake_power_w - drive.shortfall_power_w
    by_cause = {
        "air": air * speed,
        "rolling": rolling * speed,
        "climb": climb * speed,
        "acceleration": inertia * speed,
        "friction_brakes": drive.friction_brake_power_w,
        "drivetrain": drive.motor_power_w - driven,
        "base_load": base_load,
        "climate": climate_power_w,
        "shortfall": -shortfall,
    }
    arrays = {
        "time_s": trace.time_s,
        "grade": trace.grade,
        "aero_drag_force_n": air,
        "rolling_resistance_force_n": rolling,
        "grade_force_n": climb,
        "inertia_force_n": inertia,
        "wheel_power_w": wheel_power,
        "motor_power_w": drive.motor_power_w,
        "regen_power_w": np.maximum(-drive.motor_power_w, 0.0),
        "friction_brake_power_w": drive.friction_brake_power_w,
        "auxiliary_power_w": auxiliary,
        "climate_power_w": climate_power_w,
        "battery_power_w": battery.power_w,
        "battery_current_a": battery.current_a,
        "terminal_voltage_v": battery.terminal_voltage_v,
        "battery_temperature_degc": battery.temperature_degc,
        "soc": np.minimum(np.maximum(battery.soc, 0.0), 1.0),
        "battery_loss_w": battery.open_circuit_power_w - battery.power_w,
        "energy_wh": (battery.power_w * (step * WH_PER_J)).cumsum(axis=-1),
        "power_by_cause_w": by_cause,
    }
    return arrays, _flags(vehicle, step, drive, battery, lost_wh)


def energies(
    vehicle: Vehicle, trace: Trace, conditions: DriveConditions, auxiliary_power_w: FloatArray
) -> FloatArray:
    """Compute the energy of drives as `drive_chain`. O(samples).

    The state of the battery is only computed for drives on which it may limit regeneration or charge.

    Parameters
    ----------
    vehicle, trace, conditions
        As for `drive_chain`, of one car.
    auxiliary_power_w : ndarray, shape (samples,)
        Electric power of all auxiliaries [W].

    Returns
    -------
    ndarray, shape (trips, samples)
        Cumulative energy at the terminals [Wh].
    """
    rules, battery, step = vehicle.regeneration, vehicle.battery, trace.step_s
    soc, temperature = np.asarray(conditions.initial_soc), np.asarray(conditions.battery_start_degc)
    wheel_power = sum(_forces(vehicle, trace, conditions)) * trace.mean_speed_m_s
    acceptance = regeneration_acceptance(soc, temperature, rules)
    drive = propulsion(wheel_power, trace.mean_speed_m_s, acceptance, vehicle.drivetrain, rules)
    power = drive.motor_power_w + auxiliary_power_w
    energy_wh = (power * (step * WH_PER_J)).cumsum(axis=-1)
    # charge is at most that at the lowest voltage, discharge at least that at the highest
    low, high = (bound(battery.ocv_v) * battery.cells_in_series for bound in (min, max))
    drawn_as = np.minimum(power * (step / low), power * (step / high)).cumsum(axis=-1)
    capacity_as = battery.capacity_ah * SECONDS_PER_HOUR
    fullest = soc + np.maximum(-drawn_as.min(axis=-1, keepdims=True) / capacity_as, 0.0)
    # losses warm the battery
    coldest = np.minimum(temperature, conditions.ambient_temperature_degc)
    lowest = regeneration_acceptance(fullest, coldest, rules)
    weak = (lowest < 1.0) & (-wheel_power.min(axis=-1, keepdims=True) >= rules.max_power_w * lowest)
    limited = (weak | (fullest > np.maximum(battery.displayed_full_soc, soc)))[:, 0]
    if limited.any():
        _, run = _drive_and_battery(vehicle, trace, wheel_power[limited], auxiliary_power_w, conditions)
        energy_wh[limited] = (run.power_w * (step * WH_PER_J)).cumsum(axis=-1)
    return energy_wh


def _forces(vehicle: Vehicle, trace: Trace, conditions: DriveConditions) -> tuple[FloatArray, ...]:
    """Return the forces of air drag, rolling, climb and inertia at the wheels [N], shape (..., samples)."""
    load, mass, speed = vehicle.road_load, vehicle.body.test_mass_kg, trace.mean_speed_m_s
    mass, density = mass + conditions.payload_mass_kg, conditions.air_density_kg_m3
    ambient, warmth = conditions.ambient_temperature_degc, conditions.initial_warmth
    assert density is not None
    flat = not trace.grade.any()
    cosine = 1.0 if flat else 1.0 / np.sqrt(1.0 + trace.grade * trace.grade)
    constant, linear = load.rolling_coefficients
    cold: FloatArray | float = 1.0
    if vehicle.tyres is not None:
        cold = rolling_factor(speed, trace.step_s, ambient, vehicle.tyres, warmth)
    rolling = rolling_resistance_force(speed, mass, (constant * cold, linear), cosine)
    rolling *= wet_factor(conditions.rain_mm_h)
    aero = aero_drag_force(speed, load.drag_area_m2, density, trace.headwind_m_s)
    climb = trace.grade if flat else grade_force(trace.grade, mass)
    # Mean speed times change of speed is the change of v²/2: kinetic energy adds up exactly over a trip.
    inertia = inertia_force(trace.acceleration_m_s2, mass, vehicle.body.rotating_mass_factor)
    return aero, rolling, climb, inertia


def _drive_and_battery(
    vehicle: Vehicle,
    trace: Trace,
    wheel_power: FloatArray,
    auxiliary: FloatArray,
    conditions: DriveConditions,
) -> tuple[Propulsion, BatteryRun]:
    """Compute drivetrain and battery in passes until the regeneration that the battery accepts has settled in every trip.

    A trip that has settled repeats its last pass while others go on.
    """
    rules, battery, step = vehicle.regeneration, vehicle.battery, trace.step_s
    soc, temperature = conditions.initial_soc, conditions.battery_start_degc
    ambient = conditions.ambient_temperature_degc
    acceptance = np.atleast_1d(regeneration_acceptance(np.asarray(soc), np.asarray(temperature), rules))
    hardest = -wheel_power.min(axis=-1, keepdims=True) * rules.fraction
    guess: tuple[FloatArray, FloatArray] | None = None
    # at most six passes, to bound the time; a choice
    for _ in range(6):
        drive = propulsion(wheel_power, trace.mean_speed_m_s, acceptance, vehicle.drivetrain, rules)
        power = drive.motor_power_w + auxiliary
        guess = first_guess(battery, power, step, soc, temperature) if guess is None else guess
        run = discharge(battery, power, step, ambient, soc, temperature, guess=guess)
        fullest = np.maximum(soc, run.soc.max(axis=-1, keepdims=True))
        coldest = np.minimum(temperature, run.temperature_degc.min(axis=-1, keepdims=True))
        lowest = np.minimum(regeneration_acceptance(fullest, coldest, rules), acceptance)
        if (hardest <= rules.max_power_w * lowest.min(axis=-1, keepdims=True)).all():
            break  # no braking meets the limit
        states = shift(soc, run.soc), shift(temperature, run.temperature_degc)
        accepted = regeneration_acceptance(*states, rules)
        if trace.beyond is not None:
            accepted[trace.beyond] = 1.0
        change = np.abs(accepted - acceptance).max(axis=-1, keepdims=True)
        lowest = np.minimum(accepted, acceptance).min(axis=-1, keepdims=True)
        # passes that agree to a thousandth of the largest braking power have settled
        settled = (change < 1e-3) | (hardest <= rules.max_power_w * lowest)
        if settled.all():
            break
        acceptance = np.where(settled, acceptance, accepted)
        guess = np.where(settled, guess[0], run.soc), np.where(settled, guess[1], run.temperature_degc)
    return with_refused(drive, run.refused_power_w), run


def _lost_when_full_wh(
    vehicle: Vehicle, trace: Trace, wheel_power: FloatArray, drive: Propulsion, run: BatteryRun
) -> FloatArray:
    """Energy that is not recovered because the battery is too full [Wh], shape (..., 1); 0 for a battery with room."""
    rules = vehicle.regeneration
    refuses = run.refused_power_w.any(axis=-1, keepdims=True)
    full = refuses | (run.soc.max(axis=-1, keepdims=True) > rules.full_soc)
    if not full.any():
        return np.zeros(full.shape)
    acceptance = regeneration_acceptance(np.asarray(rules.full_soc), run.temperature_degc, rules)
    roomy = propulsion(wheel_power, trace.mean_speed_m_s, acceptance, vehicle.drivetrain, rules)
    lost = ((drive.motor_power_w - roomy.motor_power_w) * trace.step_s).sum(axis=-1, keepdims=True)
    return np.asarray(np.where(full, lost * WH_PER_J, 0.0))


def _flags(
    vehicle: Vehicle, step: FloatArray, drive: Propulsion, battery: BatteryRun, lost_wh: FloatArray
) -> list[Flags]:
    """Return the flags of each trip: limits of the car that were reached, mostly with the time that they lasted [s].

    `step` is the length of each interval [s].
    """
    window = vehicle.battery
    highest_v = window.max_cell_voltage_v * window.cells_in_series
    lasting = {
        ("motor_torque_limit", "motor"): drive.torque_limited,
        ("motor_power_limit", "motor"): drive.power_limited,
        ("motor_speed_limit", "motor"): drive.over_speed,
        ("battery_voltage_floor", "battery"): battery.voltage_floor,
        ("battery_empty", "battery"): battery.soc < window.displayed_zero_soc,
        ("battery_over_voltage", "battery"): battery.terminal_voltage_v > highest_v,
    }
    flags: list[list[Flag]] = [[] for _ in lost_wh]
    for kind, mask in lasting.items():
        if mask.any():
            seconds = np.atleast_1d((mask * step).sum(axis=-1)).tolist()
            for trip in np.flatnonzero(np.atleast_2d(mask).any(axis=-1)):
                flags[trip].append(Flag(*kind, seconds[trip], "s"))
    for own, lost, converged in zip(flags, lost_wh.ravel(), battery.converged.ravel(), strict=True):
        # flagged from 50 Wh on, some 0.3 km of driving; a choice
        if lost >= 50.0:
            own.append(Flag("battery_full", "battery", float(lost), "wh"))
        if not converged:
            own.append(Flag("battery_not_settled", "battery"))
    return list(map(tuple, flags))
