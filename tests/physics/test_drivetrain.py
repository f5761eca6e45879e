"""The motor of a car of round numbers."""

import math

import numpy as np
import pytest

from tripwatt.physics.drivetrain import propulsion, regeneration_acceptance
from tripwatt.vehicles.losses import motor_loss
from tripwatt.vehicles.parts import Drivetrain, Regeneration

EXACT = {"rel": 1e-12, "abs": 1e-12}


WIRE = Drivetrain(
    wheel_radius_m=0.5,
    gear_ratio=10.0,
    gearbox_efficiency=0.8,
    motor_max_torque_nm=100.0,
    motor_max_power_w=30_000.0,
    motor_max_speed_rad_s=800.0,
    torque_constant_nm_a=2.0,
    phase_resistance_ohm=0.02,
    field_weakening_speed_rad_s=400.0,
    characteristic_current_a=100.0,
    iron_loss_linear=-0.01,
    iron_loss_quadratic=0.001,
    iron_loss_torque_exponent=0.5,
    inverter_fixed_loss_w=30.0,
    inverter_voltage_drop_v=1.5,
    inverter_resistance_ohm=0.01,
)
"""The motor turns at 20 rad/s for each m/s."""


BRAKES = Regeneration(
    fraction=0.9,
    max_torque_nm=50.0,
    max_power_w=20_000.0,
    zero_speed_m_s=2.0,
    full_speed_m_s=6.0,
    full_soc=0.9,
    zero_soc=0.95,
    zero_temperature_degc=-20.0,
    full_temperature_degc=0.0,
)


class TestMotor:
    def test_loss(self) -> None:
        """At 500 rad/s 20 % of field weakening: 20 A beside the 32 A of the torque."""
        torque, speed = np.array([64.0, -64.0, 64.0, 64.0, 0.0]), np.array([500.0, 500.0, 5.0, 0.0, 500.0])
        squared = 32.0**2 + 20.0**2
        fast = (
            (0.03 + 0.01) * squared + 1.5 * math.sqrt(squared) + (0.001 * 500.0 - 0.01) * 500.0 * 8.0 + 30.0
        )
        slow = 0.04 * 1024.0 + 1.5 * 32.0 + 30.0
        assert motor_loss(torque, speed, WIRE) == pytest.approx([fast, fast, slow, slow, 0.0], **EXACT)

    def test_acceptance(self) -> None:
        soc = np.array([0.9, 0.92, 0.95, 0.96, 0.5, 0.5, 0.5, 0.92, 0.94])
        degc = np.array([20.0, 20.0, 20.0, 20.0, 0.0, -15.0, -21.0, -15.0, -4.0])
        expected = [1.0, 0.6, 0.0, 0.0, 1.0, 0.25, 0.0, 0.25, 0.2]
        assert regeneration_acceptance(soc, degc, BRAKES) == pytest.approx(expected, rel=1e-9, abs=1e-9)

    def drive(self, wheel: list[float], speed: list[float], acceptance: float = 1.0):
        return propulsion(np.array(wheel), np.array(speed), np.array([acceptance]), WIRE, BRAKES)

    def loss(self, shaft: float, speed: float) -> float:
        turning = 20.0 * speed
        return float(motor_loss(np.array([shaft / turning]), np.array([turning]), WIRE)[0])

    def test_driving(self) -> None:
        """The gearbox gives 80 %: 8 kW need 10; 100 Nm are 30 kW at 15 m/s and 20 kW at 10 m/s."""
        run = self.drive([8_000.0, 32_000.0, 24_000.0, 16_000.0, 0.0], [15.0, 15.0, 10.0, 10.0, 0.0])
        shaft = [10_000.0, 30_000.0, 20_000.0, 20_000.0]
        speeds = [15.0, 15.0, 10.0, 10.0]
        expected = [s + self.loss(s, v) for s, v in zip(shaft, speeds, strict=True)]
        assert run.motor_power_w == pytest.approx([*expected, 0.0], **EXACT)
        assert run.shortfall_power_w == pytest.approx([0.0, 8_000.0, 8_000.0, 0.0, 0.0], rel=1e-12, abs=1e-8)
        assert run.torque_limited.tolist() == [False, False, True, False, False]
        assert run.power_limited.tolist() == [False, True, False, False, False]
        assert (run.friction_brake_power_w == 0.0).all()

    def test_braking(self) -> None:
        """Nine tenths of 10 kW; half of it at 4 m/s; 50 Nm at 6 m/s hold 6 kW at the shaft; 30 W are not worth it."""
        run = self.drive(
            [-10_000.0, -5_000.0, -20_000.0, -20_000.0, -30.0, -5_000.0, -5_000.0],
            [15.0, 4.0, 6.0, 20.0, 15.0, 2.0, 1.0],
        )
        taken = [9_000.0, 2_250.0, 7_500.0, 18_000.0]
        speeds = [15.0, 4.0, 6.0, 20.0]
        expected = [-0.8 * t + self.loss(-0.8 * t, v) for t, v in zip(taken, speeds, strict=True)]
        assert run.motor_power_w == pytest.approx([*expected, 0.0, 0.0, 0.0], **EXACT)
        friction = [1_000.0, 2_750.0, 12_500.0, 2_000.0, 30.0, 5_000.0, 5_000.0]
        assert run.friction_brake_power_w == pytest.approx(friction, rel=1e-12, abs=1e-8)
        assert not run.torque_limited.any()
        assert not run.power_limited.any()
        assert (run.shortfall_power_w == 0.0).all()

    def test_a_battery_that_takes_half(self) -> None:
        run = self.drive([-20_000.0], [20.0], acceptance=0.5)
        assert run.friction_brake_power_w == pytest.approx([10_000.0], **EXACT)
        assert run.motor_power_w == pytest.approx([-8_000.0 + self.loss(-8_000.0, 20.0)], **EXACT)

    def test_over_speed(self) -> None:
        assert self.drive([0.0, 0.0], [40.0, 40.1]).over_speed.tolist() == [False, True]
