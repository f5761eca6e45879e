"""Model of the drivetrain from the wheel to the direct-current side of the inverter, with limits, losses and regeneration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.vehicles import Drivetrain, Regeneration
from tripwatt.vehicles.losses import TINY, motor_loss


@dataclass(frozen=True, slots=True)
class Propulsion:
    """Powers and limits of the drivetrain along a trace. Arrays have shape (samples,).

    `motor_power_w` [W] is the power on the direct-current side, + discharges. The other powers are never negative:
    `friction_brake_power_w` [W] is braking that becomes heat, `shortfall_power_w` [W] the wheel power that the motor could not
    give, `recovered_wheel_power_w` [W] braking that goes through the motor.
    """

    motor_power_w: FloatArray
    friction_brake_power_w: FloatArray
    shortfall_power_w: FloatArray
    recovered_wheel_power_w: FloatArray
    torque_limited: BoolArray
    power_limited: BoolArray
    over_speed: BoolArray


def regeneration_acceptance(
    soc: FloatArray, temperature_degc: FloatArray, regeneration: Regeneration
) -> FloatArray:
    """Share of the largest braking power that a battery takes, 0 to 1: less if it is nearly full or cold. Shape of `soc`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> rules = load_vehicle("bmw_i3_60ah").regeneration
    >>> regeneration_acceptance(np.array([0.5, 0.5, 1.0]), np.array([20.0, -30.0, 20.0]), rules)
    array([1., 0., 0.])
    """
    full = (regeneration.zero_soc - soc) / (regeneration.zero_soc - regeneration.full_soc)
    cold = (temperature_degc - regeneration.zero_temperature_degc) / (
        regeneration.full_temperature_degc - regeneration.zero_temperature_degc
    )
    return np.asarray(np.maximum(np.minimum(np.minimum(full, cold), 1.0), 0.0), dtype=np.float64)


def with_refused(drive: Propulsion, refused_power_w: FloatArray) -> Propulsion:
    """Move the recovered power that a full battery refuses to the friction brakes. O(samples).

    In a part of each such interval only the friction brakes work; motor and inverter then neither give nor lose power.

    Parameters
    ----------
    drive : Propulsion
        Computed for a battery that takes everything.
    refused_power_w : ndarray, shape (samples,)
        Power at the terminals that the full battery refuses [W].

    Examples
    --------
    >>> power, none = np.array([-8000.0, 5000.0]), np.zeros(2)
    >>> never = np.zeros(2, dtype=bool)
    >>> drive = Propulsion(power, none, none, np.array([9000.0, 0.0]), never, never, never)
    >>> full = with_refused(drive, np.array([6000.0, 0.0]))
    >>> full.motor_power_w, full.friction_brake_power_w
    (array([-2000.,  5000.]), array([6750.,    0.]))
    """
    if not refused_power_w.any():
        return drive
    kept = 1.0 - np.clip(refused_power_w / np.maximum(-drive.motor_power_w, TINY), 0.0, 1.0)
    return replace(
        drive,
        motor_power_w=drive.motor_power_w * kept,
        recovered_wheel_power_w=drive.recovered_wheel_power_w * kept,
        friction_brake_power_w=drive.friction_brake_power_w + drive.recovered_wheel_power_w * (1.0 - kept),
    )


def propulsion(
    wheel_power_w: FloatArray,
    speed_m_s: FloatArray,
    acceptance: FloatArray,
    drivetrain: Drivetrain,
    regeneration: Regeneration,
) -> Propulsion:
    """Convert the wheel power of each interval through gearbox, motor and inverter. Arrays have shape (samples,).

    Braking power goes through the motor up to `fraction`, the torque and power limits, and the fade-out at low
    speed; `acceptance` scales the power limit. If recovery would cost energy, the friction brakes take all braking.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> power, speed = np.array([10_000.0, -10_000.0]), np.array([15.0, 15.0])
    >>> run = propulsion(power, speed, np.ones(2), car.drivetrain, car.regeneration)
    >>> run.motor_power_w[0] > 10_000.0, run.motor_power_w[1] > -10_000.0, run.friction_brake_power_w.round()
    (np.True_, np.True_, array([  0., 500.]))
    """
    speed_rad_s = speed_m_s * (drivetrain.gear_ratio / drivetrain.wheel_radius_m)
    efficiency = drivetrain.gearbox_efficiency
    demand = np.maximum(wheel_power_w, 0.0) / efficiency
    torque_bound = drivetrain.motor_max_torque_nm * speed_rad_s
    shaft = np.minimum(np.minimum(demand, drivetrain.motor_max_power_w), torque_bound)
    short = demand - shaft
    braking = np.maximum(-wheel_power_w, 0.0)
    fade_range = regeneration.full_speed_m_s - regeneration.zero_speed_m_s
    fade = np.minimum(np.maximum((speed_m_s - regeneration.zero_speed_m_s) / fade_range, 0.0), 1.0)
    taken = np.minimum(braking * regeneration.fraction * fade, regeneration.max_power_w * acceptance)
    taken = np.minimum(taken, regeneration.max_torque_nm * speed_rad_s / efficiency)
    shaft -= taken * efficiency
    torque = shaft / np.maximum(speed_rad_s, TINY)  # no power at standstill
    motor_power = shaft + motor_loss(torque, speed_rad_s, drivetrain)
    useless = (taken > 0.0) & (motor_power >= 0.0)
    motor_power[useless] = 0.0
    taken[useless] = 0.0
    limited = short > 1e-9 * demand
    by_torque = limited & (torque_bound < drivetrain.motor_max_power_w)
    return Propulsion(
        motor_power_w=motor_power,
        friction_brake_power_w=braking - taken,
        shortfall_power_w=short * efficiency,
        recovered_wheel_power_w=taken,
        torque_limited=by_torque,
        power_limited=limited & ~by_torque,
        over_speed=speed_rad_s > drivetrain.motor_max_speed_rad_s,
    )
