"""Loss map of motor and inverter, computed from the values of a drivetrain."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.vehicles.parts import Drivetrain

TINY: Final = float(np.finfo(np.float64).tiny)


def motor_loss(torque_nm: FloatArray, speed_rad_s: FloatArray, drivetrain: Drivetrain) -> FloatArray:
    """Loss of motor and inverter [W] at a torque of either sign; 0 at a torque of 0. Shape of `torque_nm`.

    The loss is a sum of four terms: copper 3/2 R (i_q² + i_d²), iron (k1 ω + k2 ω²) |T|^x, inverter conduction and switching
    u·i + r·i², and a fixed loss of the inverter. T is the torque, ω the speed, R the phase resistance, i the phase current with its
    parts i_q and i_d. With magnets, i_q follows from the torque and i_d from field weakening; drag of the magnets at no torque is
    part of the coast-down. Machines without magnets need a current for their flux: see `_chosen_flux`.

    The map is anchored to the certified consumption of a car by `motor_loss_factor`, which multiplies this sum, or by an
    eddy-current loss `flux_loss_w_s2_rad2` ω², which is added. Without an anchor they are 1 and 0.

    Notes
    -----
    Form and values for the BMW i3 after the TUMFTM repository Efficiency_Models_of_Inverters_for_BMW_i3.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> motor_loss(np.array([0.0, 50.0]), np.array([500.0, 500.0]), car.drivetrain).round()
    array([  0., 853.])
    """
    torque = np.abs(torque_nm)
    # negative below about 20 rad/s, where the fit does not hold
    iron = (drivetrain.iron_loss_linear + drivetrain.iron_loss_quadratic * speed_rad_s) * speed_rad_s
    # a logarithm and an exponential take half the time of a power
    powered = np.exp(drivetrain.iron_loss_torque_exponent * np.log(np.maximum(torque, TINY)))
    iron = np.maximum(iron, 0.0) * powered
    of_machine = _given_flux if drivetrain.machine == "permanent_magnet" else _chosen_flux
    loss = of_machine(torque, speed_rad_s, iron, drivetrain) + drivetrain.inverter_fixed_loss_w
    loss = drivetrain.motor_loss_factor * loss + drivetrain.flux_loss_w_s2_rad2 * speed_rad_s**2
    return np.asarray(np.where(torque > 0.0, loss, 0.0), dtype=np.float64)


def _given_flux(
    torque: FloatArray, speed_rad_s: FloatArray, iron: FloatArray, drivetrain: Drivetrain
) -> FloatArray:
    """Variable loss of a machine with magnets [W]: copper, iron and inverter.

    Above `field_weakening_speed_rad_s` a current along the flux weakens the field.
    """
    q_current = torque / drivetrain.torque_constant_nm_a
    weakening = 1.0 - drivetrain.field_weakening_speed_rad_s / np.maximum(speed_rad_s, 1e-9)
    d_current = drivetrain.characteristic_current_a * np.maximum(weakening, 0.0)
    squared = q_current * q_current + d_current * d_current
    copper = (1.5 * drivetrain.phase_resistance_ohm + drivetrain.inverter_resistance_ohm) * squared
    return copper + drivetrain.inverter_voltage_drop_v * np.sqrt(squared) + iron


def _chosen_flux(
    torque: FloatArray, speed_rad_s: FloatArray, iron: FloatArray, drivetrain: Drivetrain
) -> FloatArray:
    """Variable loss of a machine without magnets [W]: copper, field, iron and inverter, at the flux with the smallest loss.

    At a share ψ of the full flux, the torque T needs a current i_q = T / (k ψ), where k is the torque constant. The loss is A / ψ²
    in the copper and B ψ² in field and iron. The sum is smallest at ψ⁴ = A / B; ψ is at most 1, and at most ω_f / ω because the
    voltage is limited (ω_f is `field_weakening_speed_rad_s`).
    """
    full = torque / drivetrain.torque_constant_nm_a
    copper = (1.5 * drivetrain.phase_resistance_ohm + drivetrain.inverter_resistance_ohm) * full * full
    field = drivetrain.field_loss_w + iron
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        limit = np.minimum(drivetrain.field_weakening_speed_rad_s / speed_rad_s, 1.0)
        squared = np.minimum(np.sqrt(copper / field), limit * limit)
        inverter = drivetrain.inverter_voltage_drop_v * full / np.sqrt(squared)
        return np.asarray(copper / squared + field * squared + inverter)
