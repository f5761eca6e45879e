"""The loss map of motor and inverter that the values of a drivetrain describe."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.vehicles.parts import Drivetrain

TINY: Final = float(np.finfo(np.float64).tiny)


def motor_loss(torque_nm: FloatArray, speed_rad_s: FloatArray, drivetrain: Drivetrain) -> FloatArray:
    """Loss of motor and inverter [W] at a torque of either sign; zero without torque. Shape of `torque_nm`.

    The sum of four terms: copper 3/2 R (i_q² + i_d²), iron (k1 ω + k2 ω²) |T|^x, inverter conduction and switching u·i + r·i², and
    what the inverter needs whenever it switches. With magnets i_q follows from the torque and i_d from field weakening, and their drag
    without torque is part of the coast-down. Other machines have no flux without a current: see `_chosen_flux`. `motor_loss_factor`
    on this sum, or an eddy-current loss `flux_loss` ω² beside it, anchor the map to the certified consumption of a car; they are 1 and
    0 without an anchor.

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
    # a logarithm and its exponential cost half of a power
    powered = np.exp(drivetrain.iron_loss_torque_exponent * np.log(np.maximum(torque, TINY)))
    iron = np.maximum(iron, 0.0) * powered
    of_machine = _given_flux if drivetrain.machine == "permanent_magnet" else _chosen_flux
    loss = of_machine(torque, speed_rad_s, iron, drivetrain) + drivetrain.inverter_fixed_loss_w
    loss = drivetrain.motor_loss_factor * loss + drivetrain.flux_loss_w_s2_rad2 * speed_rad_s**2
    return np.asarray(np.where(torque > 0.0, loss, 0.0), dtype=np.float64)


def _given_flux(
    torque: FloatArray, speed_rad_s: FloatArray, iron: FloatArray, drivetrain: Drivetrain
) -> FloatArray:
    """Copper, iron and inverter of a machine with magnets [W]: above a speed a current along the flux weakens the field."""
    q_current = torque / drivetrain.torque_constant_nm_a
    with np.errstate(divide="ignore", over="ignore"):
        weakening = 1.0 - drivetrain.field_weakening_speed_rad_s / speed_rad_s
    d_current = drivetrain.characteristic_current_a * np.maximum(weakening, 0.0)
    squared = q_current * q_current + d_current * d_current
    copper = (1.5 * drivetrain.phase_resistance_ohm + drivetrain.inverter_resistance_ohm) * squared
    return copper + drivetrain.inverter_voltage_drop_v * np.sqrt(squared) + iron


def _chosen_flux(
    torque: FloatArray, speed_rad_s: FloatArray, iron: FloatArray, drivetrain: Drivetrain
) -> FloatArray:
    """Copper, iron and inverter of a machine whose flux the control chooses [W]: induction, or excitation of the rotor.

    At a share ψ of the full flux the torque needs i_q = T / (k ψ), and field and iron lose (P_field + P_iron) ψ². With copper
    A / ψ² and field and iron B ψ² the sum is smallest at ψ⁴ = A / B; ψ is at most 1, and at most ω_f / ω at the limit of the voltage.
    """
    full = torque / drivetrain.torque_constant_nm_a
    copper = (1.5 * drivetrain.phase_resistance_ohm + drivetrain.inverter_resistance_ohm) * full * full
    field = drivetrain.field_loss_w + iron
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        limit = np.minimum(drivetrain.field_weakening_speed_rad_s / speed_rad_s, 1.0)
        squared = np.minimum(np.sqrt(copper / field), limit * limit)
        loss = (
            copper / squared + field * squared + drivetrain.inverter_voltage_drop_v * full / np.sqrt(squared)
        )
    return np.asarray(loss, dtype=np.float64)
