"""Each part of a car of round numbers, against arithmetic that is written out here."""

import dataclasses
import math

import numpy as np
import pytest

from tripwatt.physics import battery as battery_module
from tripwatt.physics.battery import (
    battery_current,
    discharge,
    internal_resistance,
    largest_power,
    open_circuit_voltage,
    shift,
)
from tripwatt.physics.cabin import CabinStart, condition_cabin, heat_pump_cop, heat_pump_heat
from tripwatt.physics.departure import cabin_at_departure, warmth_from_cabin
from tripwatt.physics.drivetrain import propulsion, regeneration_acceptance
from tripwatt.physics.relaxation import Relaxation
from tripwatt.physics.road_load import (
    GRADE_WEIGHT,
    aero_drag_force,
    air_density,
    grade_force,
    grade_from_elevation,
    inertia_force,
    rolling_factor,
    rolling_resistance_force,
)
from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.losses import motor_loss
from tripwatt.vehicles.parts import Battery, Climate, Drivetrain, Regeneration, Tyres

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


def pack(**changes: object) -> Battery:
    """100 cells of 3.5 V and 1 mOhm, 100 Ah, that lose no heat."""
    values: dict[str, object] = {
        "capacity_ah": 100.0,
        "cells_in_series": 100.0,
        "ocv_soc": (0.0, 1.0),
        "ocv_v": (3.5, 3.5),
        "resistance_soc": (0.0, 1.0),
        "resistance_ohm": (0.001, 0.001),
        "resistance_temperature_degc": 25.0,
        "resistance_activation_energy_j_mol": 0.0,
        "min_cell_voltage_v": 3.4,
        "max_cell_voltage_v": 3.6,
        "heat_capacity_j_k": 9_000.0,
        "heat_loss_w_k": 0.0,
        "displayed_zero_soc": 0.1,
        "displayed_full_soc": 0.9,
    }
    return Battery(**{**values, **changes})


class TestBattery:
    def test_tables(self) -> None:
        sloped = pack(ocv_v=(3.0, 4.0), resistance_ohm=(0.002, 0.001))
        soc = np.array([0.0, 0.5, 0.75])
        assert open_circuit_voltage(soc, sloped) == pytest.approx([300.0, 350.0, 375.0], **EXACT)
        at_reference = internal_resistance(soc, np.full(3, 25.0), sloped)
        assert at_reference == pytest.approx([0.2, 0.15, 0.125], **EXACT)

    def test_arrhenius(self) -> None:
        """With an activation energy of 1000 K times the gas constant the exponent is 1000 K (1/T - 1/298.15 K)."""
        cold = pack(resistance_activation_energy_j_mol=8_314.462618)
        given = internal_resistance(np.array([0.5]), np.array([0.0]), cold)
        assert given == pytest.approx([0.1 * math.exp(1000.0 / 273.15 - 1000.0 / 298.15)], **EXACT)

    def test_current(self) -> None:
        """(100 V - 10 A 1 Ohm) 10 A are 900 W; without resistance 9 A are; beyond the vertex the root is 0."""
        volts, ohms = np.full(4, 100.0), np.array([1.0, 0.0, 1.0, 1.0])
        power = np.array([900.0, 900.0, 2600.0, -1100.0])
        assert battery_current(power, volts, ohms) == pytest.approx([10.0, 9.0, 52.0, -10.0], **EXACT)

    def test_largest_power(self) -> None:
        volts, ohms = np.full(4, 100.0), np.array([1.0, 1.0, 2.0, 1.0])
        assert largest_power(volts, ohms, 90.0)[:3] == pytest.approx([900.0, 900.0, 450.0], **EXACT)
        assert largest_power(volts, ohms, 0.0)[0] == 50.0 * 50.0
        assert (largest_power(volts, ohms, 110.0) == 0.0).all()

    def test_shift(self) -> None:
        assert shift(7.0, np.array([1.0, 2.0, 3.0])).tolist() == [7.0, 1.0, 2.0]

    def test_discharge_by_hand(self) -> None:
        """345 V 50 A: 50 A for 360 s are 5 Ah of 100; 50² 0.1 W for 360 s warm 9 kJ/K by 10 K."""
        step, power = np.array([0.0, 360.0, 360.0]), np.array([0.0, 17_250.0, -17_750.0])
        run = discharge(pack(), power, step, -10.0, 0.5, 20.0)
        assert run.converged
        assert run.power_w == pytest.approx(power, **EXACT)
        assert run.current_a == pytest.approx([0.0, 50.0, -50.0], **EXACT)
        assert run.terminal_voltage_v == pytest.approx([350.0, 345.0, 355.0], **EXACT)
        assert run.open_circuit_power_w == pytest.approx([0.0, 17_500.0, -17_500.0], **EXACT)
        assert run.soc == pytest.approx([0.5, 0.45, 0.5], **EXACT)
        assert run.temperature_degc == pytest.approx([20.0, 30.0, 40.0], **EXACT)
        assert not run.voltage_floor.any()

    def test_a_pack_that_loses_heat_settles(self) -> None:
        """25 W/K lose 9 kJ/K in 360 s; 250 W keep it 10 K above the air."""
        step, power = np.array([0.0, 360.0]), np.array([0.0, 17_250.0])
        run = discharge(pack(heat_loss_w_k=25.0), power, step, -10.0, 0.5, 20.0)
        assert run.temperature_degc == pytest.approx([20.0, 0.0 + 20.0 * math.exp(-1.0)], **EXACT)

    def test_voltage_floor(self) -> None:
        """At 340 V of 350 V flow 100 A: 34 kW. That is given, more is not."""
        power = np.array([33_000.0, 34_000.0, 40_000.0])
        run = discharge(pack(), power, np.zeros(3), 20.0, 0.5, 20.0)
        assert run.power_w == pytest.approx([33_000.0, 34_000.0, 34_000.0], **EXACT)
        assert run.terminal_voltage_v[1:] == pytest.approx([340.0, 340.0], **EXACT)
        assert run.voltage_floor[[0, 2]].tolist() == [False, True]

    def test_first_guess(self, monkeypatch) -> None:
        """One pass from the guess: 30 kW for 360 s at the voltage of half the way, 341.43 V."""
        monkeypatch.setattr(battery_module, "MOST_PASSES", 1)
        ideal = pack(ocv_v=(3.0, 4.0), resistance_ohm=(0.0, 0.0), min_cell_voltage_v=0.5)
        power, step = np.full(3, 30_000.0), np.array([0.0, 360.0, 360.0])
        with np.errstate(over="ignore"):
            run = discharge(ideal, power, step, 20.0, 0.5, 20.0)
        drawn = 2 * 30_000.0 * 0.001 / 350.0
        halfway = 300.0 + 100.0 * (0.5 - drawn / 2)
        guess = 0.5 - 30.0 / halfway
        volts = np.array([350.0, 350.0, 300.0 + 100.0 * guess])
        assert run.current_a == pytest.approx(30_000.0 / volts, **EXACT)
        assert not run.converged

    def test_passes_settle_where_the_state_repeats(self) -> None:
        """The current of the second interval belongs to the charge after the first."""
        ideal = pack(ocv_v=(3.0, 4.0), min_cell_voltage_v=0.5)
        power, step = np.full(3, 30_000.0), np.array([0.0, 360.0, 360.0])
        run = discharge(ideal, power, step, 20.0, 0.5, 20.0)
        first = (350.0 - math.sqrt(350.0**2 - 0.4 * 30_000.0)) / 0.2
        volts = 300.0 + 100.0 * (0.5 - 0.001 * first)
        second = (volts - math.sqrt(volts**2 - 0.4 * 30_000.0)) / 0.2
        assert run.converged
        assert run.soc == pytest.approx(
            [0.5, 0.5 - 0.001 * first, 0.5 - 0.001 * (first + second)], rel=0, abs=2e-6
        )
        again = discharge(ideal, power, step, 20.0, 0.5, 20.0, guess=run)
        assert again.soc == pytest.approx(
            [0.5, 0.5 - 0.001 * first, 0.5 - 0.001 * (first + second)], rel=0, abs=1e-8
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


class TestRoadLoad:
    def test_forces(self) -> None:
        speed = np.array([0.0, 10.0])
        assert aero_drag_force(speed, 0.6, 1.2) == pytest.approx([0.0, 36.0], **EXACT)
        rolling = rolling_resistance_force(speed, 1000.0, (0.01, 0.001), np.array([0.8, 0.8]))
        assert rolling == pytest.approx([0.0, 1000.0 * 9.80665 * 0.8 * 0.02], **EXACT)
        assert rolling_resistance_force(speed, 1000.0, (0.01, 0.0))[1] == pytest.approx(98.0665, **EXACT)
        climb = grade_force(np.array([0.0, 0.75, -0.75]), 1000.0)
        assert climb == pytest.approx([0.0, 9806.65 * 0.6, -9806.65 * 0.6], **EXACT)
        assert inertia_force(np.array([2.0]), 1000.0, 1.04) == pytest.approx([2080.0], **EXACT)

    def test_air(self) -> None:
        """Pressure falls with (1 - 0.0065 h / 288.15) to the power 5.25588; the gas law gives the density."""
        pressure = 101_325.0 * (1.0 - 6.5 / 288.15) ** (9.80665 / (287.05287 * 0.0065))
        assert air_density(-3.0, 1000.0) == pytest.approx(pressure / (287.05287 * 270.15), **EXACT)
        assert air_density(-3.0) == pytest.approx(101_325.0 / (287.05287 * 270.15), **EXACT)

    def test_rolling_factor(self) -> None:
        """A quarter of 25 m/s warms half way; after one half-life 0.2 has become 0.35. 1 % for each kelvin."""
        tyres = Tyres(20.0, 0.01, 0.4, 100.0, 25.0)
        speed, step = np.array([6.25, 6.25, 100.0]), np.array([0.0, 100.0 * math.log(2.0), 1e6])
        cold = rolling_factor(speed, step, 10.0, tyres, 0.2)
        assert cold == pytest.approx([1.1 * 1.32, 1.1 * 1.26, 1.1], rel=1e-9)
        assert rolling_factor(speed, step, 10.0, tyres)[0] == pytest.approx(1.1 * 1.4, **EXACT)
        hot = rolling_factor(speed, step, 75.0, tyres, 0.2)  # 0.86 % for each kelvin above the reference
        assert hot == pytest.approx([0.527 * 1.32, 0.527 * 1.26, 0.527], rel=1e-9)
        assert rolling_factor(speed, step, 85.0, tyres)[2] == 0.5


def weight(distance: np.ndarray) -> np.ndarray:
    """Triangle of full width 200 m at half height over pieces of 20 m: 10 of them to each side, sum 1."""
    return np.maximum(10.0 - np.abs(distance), 0.0) / 100.0


class TestGrade:
    """At 20 m/s each sample has a piece of road of its own; rise j lies between the samples j and j + 1."""

    time = np.arange(80.0)
    speed = np.full(80, 20.0)
    piece = np.arange(79)

    def graded(self, rise: np.ndarray) -> np.ndarray:
        """Grade of the interval before each sample, of a rise over the 20 m of road."""
        return np.tan(np.arcsin(np.concatenate((rise[:1], rise)) / 20.0))

    def test_weight(self) -> None:
        expected = [*range(1, 11), *range(9, 0, -1)]
        assert pytest.approx(np.array(expected) / 100.0, **EXACT) == GRADE_WEIGHT

    def test_one_step_becomes_a_triangle(self) -> None:
        step = np.where(np.arange(80) > 40, 104.0, 100.0)
        expected = self.graded(4.0 * weight(self.piece - 40))
        assert grade_from_elevation(self.time, self.speed, step) == pytest.approx(expected, **EXACT)
        assert grade_from_elevation(self.time + 7.0, self.speed, step) == pytest.approx(expected, **EXACT)

    def test_a_step_at_the_start_is_mirrored(self) -> None:
        step = np.where(np.arange(80) > 0, 4.0, 0.0)
        expected = self.graded(4.0 * (weight(self.piece) + weight(self.piece + 1)))
        assert grade_from_elevation(self.time, self.speed, step) == pytest.approx(expected, **EXACT)

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_a_jump_is_spread_to_both_sides(self, sign: float) -> None:
        """0.4 of 20 m are 8 m. Of a jump of 24 m the two pieces to each side take 4 m each."""
        most = grade_from_elevation(self.time, self.speed, np.where(self.time > 40, sign * 8.0, 0.0))
        assert most == pytest.approx(self.graded(sign * 8.0 * weight(self.piece - 40)), **EXACT)
        more = grade_from_elevation(self.time, self.speed, np.where(self.time > 40, sign * 24.0, 0.0))
        spread = sum(4.0 * weight(self.piece - k) for k in (38, 39, 40, 40, 41, 42))
        assert more == pytest.approx(self.graded(sign * spread), **EXACT)

    def test_two_jumps_that_cancel_within_400_m_are_left_out(self) -> None:
        def climbs(width: int) -> float:
            height = np.where((self.time > 30) & (self.time <= 30 + width), 44.0, 0.0)
            return float(grade_from_elevation(self.time, self.speed, height).max())

        assert [climbs(width) for width in (1, 5, 19)] == [0.0, 0.0, 0.0]
        assert climbs(20) > 0.1

    def test_a_spike_on_a_slope_leaves_the_slope(self) -> None:
        height = 0.5 * self.time
        height[40:43] += (30.0, 60.0, 31.0)
        even = grade_from_elevation(self.time, self.speed, height)
        assert even == pytest.approx(self.graded(np.full(79, 0.5)), **EXACT)

    def test_a_gap_is_a_straight_line(self) -> None:
        height = np.where(np.arange(80) > 41, 104.0, 100.0)
        height[41] = np.nan  # 102 m
        expected = self.graded(2.0 * (weight(self.piece - 40) + weight(self.piece - 41)))
        assert grade_from_elevation(self.time, self.speed, height) == pytest.approx(expected, **EXACT)

    def test_samples_of_a_piece_are_averaged(self) -> None:
        """At 10 m/s each piece has two samples, at its start and its middle; their mean counts 5 m from the start."""
        time = np.arange(160.0)
        height = np.where(time >= 80.0, 4.0, 0.0)  # from 0 m at 785 m to 4 m at 805 m: 3 m at 800 m
        grade = grade_from_elevation(time, np.full(160, 10.0), height)
        border = np.linspace(0.0, 1590.0, 81)
        raw = np.diff(np.interp(border, [0.0, 785.0, 805.0, 1590.0], [0.0, 0.0, 4.0, 4.0]))
        smooth = np.convolve(np.pad(raw, 9, mode="symmetric"), GRADE_WEIGHT, mode="valid")
        climbed = np.interp(10.0 * time, border, np.concatenate(([0.0], np.cumsum(smooth))))
        assert grade[1:] == pytest.approx(np.tan(np.arcsin(np.diff(climbed) / 10.0)), rel=1e-9, abs=1e-12)

    def test_one_piece_is_enough(self) -> None:
        height = np.array([0.0, 0.3, 1.0])
        assert grade_from_elevation(np.array([0.0, 0.2, 0.5]), np.full(3, 20.0), height) == pytest.approx(
            [math.tan(math.asin(0.1))] * 3, **EXACT
        )

    def test_a_log_that_rises_faster_than_any_street_has_the_grade_of_the_steepest(self) -> None:
        for height in (9.0, -9.0):
            grade = grade_from_elevation(np.array([0.0, 1.0]), np.full(2, 20.0), np.array([0.0, height]))
            assert grade == pytest.approx([math.copysign(math.tan(math.asin(0.4)), height)] * 2, **EXACT)

    def test_distance_is_the_trapezium(self) -> None:
        """From 10 to 30 m/s in 2 s are 40 m: with 1 m for each 20 m the grade is that of a road at 20 m/s."""
        time = np.arange(0.0, 80.0, 2.0)
        speed = np.where(np.arange(40) % 2, 30.0, 10.0)
        even = grade_from_elevation(time, speed, time)
        assert even == pytest.approx([math.tan(math.asin(0.05))] * 40, **EXACT)


def test_relaxation_over_several_blocks() -> None:
    """Halves, then an interval that forgets everything, then halves again; and a sum of exactly 200."""
    half = math.log(2.0)
    given = Relaxation(np.array([half, 500.0, half, half])).solve(8.0, np.array([0.0, 4.0, 0.0, 0.0]))
    assert given == pytest.approx([4.0, 4.0, 2.0, 1.0], **EXACT)
    step = np.array([199.0, 1.0, half])
    kept = 8.0 * math.exp(-200.0)
    assert Relaxation(step[:2]).solve(8.0, np.zeros(2))[-1] == pytest.approx(kept, rel=1e-9)
    assert Relaxation(step).solve(8.0, np.zeros(3))[-1] == pytest.approx(kept / 2.0, rel=1e-9)
    first = Relaxation(np.array([300.0, half])).solve(8.0, np.array([2.0, 0.0]))
    assert first == pytest.approx([2.0, 1.0], **EXACT)


ROOM = Climate(
    air_heat_capacity_j_k=10_000.0,
    interior_heat_capacity_j_k=20_000.0,
    interior_exchange_w_k=100.0,
    shell_w_k=40.0,
    shell_per_speed_w_s_k_m=2.0,
    fresh_air_low_w_k=10.0,
    fresh_air_high_w_k=60.0,
    solar_aperture_m2=2.0,
    solar_share_to_air=0.25,
    occupant_heat_w=100.0,
    heater_max_heat_w=5_000.0,
    heater_efficiency=0.8,
    heat_pump_max_heat_w=2_000.0,
    heat_pump_cop_at_0_degc=3.0,
    heat_pump_cop_per_k=0.1,
    cooler_max_heat_w=3_000.0,
    cooler_cop=2.5,
    blower_low_power_w=50.0,
    blower_high_power_w=250.0,
    control_time_s=10.0 / math.log(2.0),
    setpoint_degc=22.0,
    defrost_power_w=400.0,
    defrost_time_s=25.0,
    defrost_below_degc=3.0,
    sensor_minimum_degc=10.0,
)
"""In a control step of 10 s air and interior store 1000 and 2000 W/K, and the set-point is approached by half."""


def cabin_step(
    air: float, interior: float, outside: float, loss: float, heat: float, sun: float = 800.0
) -> tuple[float, float]:
    """Air and interior after a step with a heat [W]; a quarter of the sun and 100 W of people warm the air."""
    new = (1000.0 * air + loss * outside + 100.0 * interior + 100.0 + 0.25 * sun + heat) / (
        1000.0 + loss + 100.0
    )
    return new, (2000.0 * interior + 100.0 * new + 0.75 * sun) / 2100.0


def wanted_heat(air: float, interior: float, outside: float, loss: float, sun: float = 800.0) -> float:
    """Heat that brings the air half the way to 22 °C."""
    given = 1000.0 * air + loss * outside + 100.0 * interior + 100.0 + 0.25 * sun
    return (1000.0 + loss + 100.0) * (air + 22.0) / 2.0 - given


class TestCabin:
    def run(self, ambient: float, start: CabinStart, seconds: float, speed: float = 5.0):
        time = 100.0 + np.arange(0.0, seconds + 1.0, 10.0)
        return condition_cabin(ROOM, time, np.full(len(time), speed), ambient, start)

    def test_heating_with_all_and_then_with_less(self) -> None:
        """The heat pump gives 70 % at -3 °C with a COP of 2.7, the heater the rest; full demand, full blower."""
        run = self.run(-3.0, CabinStart(7.0, 22.0, 400.0, warmth=0.75), 40.0)
        assert wanted_heat(7.0, 7.0, -3.0, 60.0) == pytest.approx(9_000.0)
        temperatures, powers, air, interior, loss = [7.0], [], 7.0, 7.0, 60.0
        for number in range(4):
            heat = min(wanted_heat(air, interior, -3.0, loss), 5_000.0)
            air, interior = cabin_step(air, interior, -3.0, loss, heat)
            powers.append(1_400.0 / 2.7 + (heat - 1_400.0) / 0.8 + 50.0 + heat / 5_000.0 * 200.0)
            powers[-1] += 0.25 * 400.0 if number < 3 else 0.0  # a quarter of 400 W, 25 s are three steps
            temperatures.append(air)
            loss = 40.0 + 2.0 * 5.0 + 10.0 + heat / 5_000.0 * 50.0
        assert run.power_w == pytest.approx([powers[0], *powers], rel=1e-12)
        assert run.temperature_degc == pytest.approx(temperatures, rel=1e-12)
        assert powers[3] < powers[1]

    @pytest.mark.parametrize(("idle_w", "expected_w"), [(0.0, 0.0), (600.0, 600.0), (60.0, 0.0)])
    def test_a_running_compressor_takes_its_least_power(self, idle_w: float, expected_w: float) -> None:
        """30 °C outside and 22.2 °C inside: some 200 W of cooling at 2.5 are less than 600 W, and more than 60 W."""
        room = dataclasses.replace(ROOM, compressor_idle_w=idle_w)
        time = np.arange(0.0, 11.0, 10.0)
        run = condition_cabin(room, time, np.zeros(2), 30.0, CabinStart(22.0, 22.0, 0.0))
        wanted = wanted_heat(22.0, 22.0, 30.0, 50.0, sun=0.0)
        assert wanted == pytest.approx(-500.0)
        fans = 50.0 + 500.0 / 3_000.0 * 200.0
        assert run.power_w[1] == pytest.approx(max(expected_w, 500.0 / 2.5) + fans, rel=1e-12)
        little = condition_cabin(room, time, np.zeros(2), 22.5, CabinStart(22.0, 22.0, 0.0))
        assert wanted_heat(22.0, 22.0, 22.5, 50.0, sun=0.0) == pytest.approx(-125.0)
        assert little.power_w[1] == pytest.approx(max(idle_w, 125.0 / 2.5) + 50.0 + 125.0 / 3_000.0 * 200.0)
        cool = condition_cabin(room, time, np.zeros(2), 20.2, CabinStart(22.0, 21.9, 0.0))
        assert 50.0 < cool.power_w[1] < 55.0  # 67.5 W of 90 W that air from outside cools alone

    def test_a_heat_that_the_pump_gives_alone(self) -> None:
        """At 12 °C 115 % of 2 kW and a COP of 4.2; no defrosting."""
        run = self.run(12.0, CabinStart(20.0, 22.0, 0.0), 10.0)
        heat = wanted_heat(20.0, 20.0, 12.0, 60.0, sun=0.0)
        assert 0.0 < heat < 2_300.0
        assert run.power_w == pytest.approx([heat / 4.2 + 50.0 + heat / 5_000.0 * 200.0] * 2, rel=1e-12)
        assert run.temperature_degc[-1] == pytest.approx(21.0, rel=1e-12)

    def test_cooling_with_all_and_then_with_less(self) -> None:
        run = self.run(35.0, CabinStart(40.0, 22.0, 400.0), 60.0, speed=0.0)
        temperatures, powers, air, interior, loss = [40.0], [], 40.0, 40.0, 50.0
        for _ in range(6):
            wanted = -wanted_heat(air, interior, 35.0, loss)
            free = min((60.0 - (loss - 40.0)) * (air - 35.0), wanted) if air > 35.0 else 0.0
            cooling = min(wanted - free, 3_000.0)
            air, interior = cabin_step(air, interior, 35.0, loss, -cooling - free)
            fan = min(1.0, (cooling + free) / 3_000.0)
            powers.append(cooling / 2.5 + 50.0 + fan * 200.0)
            temperatures.append(air)
            loss = 50.0 + fan * 50.0
        assert run.power_w == pytest.approx([powers[0], *powers], rel=1e-12)
        assert run.temperature_degc == pytest.approx(temperatures, rel=1e-12)

    def test_cool_air_cools_alone(self) -> None:
        """23 °C in the cabin, 10 °C outside: 50 W/K more air would take 650 W, less is wanted."""
        start = CabinStart(23.0, 22.0, 600.0)
        wanted = -wanted_heat(23.0, 23.0, 10.0, 50.0, sun=1200.0)
        assert 0.0 < wanted < 650.0
        run = self.run(10.0, start, 10.0, speed=0.0)
        assert run.power_w == pytest.approx([50.0 + wanted / 3_000.0 * 200.0] * 2, rel=1e-12)
        assert run.temperature_degc[-1] == pytest.approx(22.5, rel=1e-12)

    def test_modes(self) -> None:
        """Only the blower where the mode forbids the rest; defrosting belongs to heating."""
        assert self.run(-3.0, CabinStart(7.0, 22.0, mode="cool"), 10.0).power_w.tolist() == [50.0, 50.0]
        heat = self.run(35.0, CabinStart(30.0, 22.0, mode="heat"), 10.0)
        assert heat.power_w.tolist() == [50.0, 50.0]
        assert heat.temperature_degc[-1] == pytest.approx(
            cabin_step(30.0, 30.0, 35.0, 60.0, 0.0, sun=600.0)[0], rel=1e-12
        )

    def test_defrosting_below_its_temperature(self) -> None:
        """At 3 °C on half of the cars, at 1 °C on all, at 5 °C on none."""
        start = CabinStart(20.0, 22.0)
        off = dataclasses.replace(ROOM, defrost_power_w=0.0)
        for ambient, share in ((5.0, 0.0), (3.0, 0.5), (1.0, 1.0), (-5.0, 1.0)):
            time = 100.0 + np.arange(0.0, 41.0, 10.0)
            without = condition_cabin(off, time, np.full(len(time), 5.0), ambient, start).power_w
            more = self.run(ambient, start, 40.0).power_w - without
            assert more == pytest.approx([share * 400.0] * 4 + [0.0], abs=1e-9)

    def test_power_is_the_mean_of_an_interval(self) -> None:
        """Samples at 0, 5, 25 and 28 s of steps of 10 s: 5 s of the first, half of it and the next, 3 s of the third."""
        start = CabinStart(7.0, 22.0, 400.0)
        whole = self.run(-3.0, start, 30.0)
        time = np.array([100.0, 105.0, 125.0, 128.0])
        run = condition_cabin(ROOM, time, np.full(4, 5.0), -3.0, start)
        one, two, three = whole.power_w[1:]
        # the last step ends after the trip, so the car is taken to stand for its last 2 s
        assert run.power_w[:2] == pytest.approx([one, one], rel=1e-12)
        assert run.power_w[2] == pytest.approx((5 * one + 10 * two + 5 * run.power_w[3]) / 20, rel=1e-12)
        assert run.power_w[3] == pytest.approx(three, rel=0.01)
        air = whole.temperature_degc
        assert run.temperature_degc[1] == pytest.approx((air[0] + air[1]) / 2, rel=1e-12)

    def test_speed_of_a_step_is_its_distance(self) -> None:
        """From 0 to 20 m/s in 20 s: 5 m/s, then 15 m/s. The shell loses 2 W/K more for each m/s."""
        time, speed = np.array([100.0, 110.0, 120.0]), np.array([0.0, 10.0, 20.0])
        run = condition_cabin(ROOM, time, speed, 40.0, CabinStart(30.0, 22.0, 0.0, mode="heat"))
        first = cabin_step(30.0, 30.0, 40.0, 60.0, 0.0, sun=0.0)
        second = cabin_step(*first, 40.0, 80.0, 0.0, sun=0.0)
        assert run.temperature_degc[-1] == pytest.approx(second[0], rel=1e-12)

    def test_heat_pump(self) -> None:
        """3 % for each kelvin from 7 °C, half as much again at most; COP 3 at 0 °C, at least 1."""
        for ambient, share in ((7.0, 1.0), (17.0, 1.3), (-3.0, 0.7), (30.0, 1.5), (-40.0, 0.0)):
            assert heat_pump_heat(ambient, ROOM) == pytest.approx(share * 2_000.0, rel=1e-12)
        assert heat_pump_cop(5.0, ROOM) == 3.5
        assert heat_pump_cop(-19.0, ROOM) == pytest.approx(1.1)
        assert heat_pump_cop(-30.0, ROOM) == 1.0


class TestDeparture:
    """The i3's cabin sensor shows nothing below 10 °C; its usual set-point is 22 °C."""

    car = load_vehicle("bmw_i3_60ah")

    def test_cabin(self) -> None:
        assert self.car.climate is not None
        assert self.car.climate.sensor_minimum_degc == 10.0
        for logged in (False, True):
            assert cabin_at_departure(self.car, 10.1, 3.0, logged=logged) == 10.1
            assert cabin_at_departure(self.car, None, 3.0, logged=logged) == 3.0
        assert cabin_at_departure(self.car, 10.0, 3.0, logged=True) == 3.0
        assert cabin_at_departure(self.car, 9.0, 15.0, logged=True) == 9.0
        assert cabin_at_departure(self.car, 10.0, 3.0) == 10.0
        assert cabin_at_departure(self.car, -5.0, 3.0) == -5.0

    def test_warmth(self) -> None:
        """The excess over the air outside, over that at the set-point or 5 K; from 10 to 14 °C outside it fades."""
        assert warmth_from_cabin(self.car, 17.0, 22.0, 2.0) == pytest.approx(0.75)
        assert warmth_from_cabin(self.car, 30.0, 22.0, 2.0) == 1.0
        assert warmth_from_cabin(self.car, 10.1, 22.0, 11.9) == 0.0
        assert warmth_from_cabin(self.car, 17.0, None, 2.0) == pytest.approx(
            15.0 / (self.car.climate.setpoint_degc - 2.0)
        )
        assert warmth_from_cabin(self.car, 20.0, 22.0, 14.0) == 0.0
        assert warmth_from_cabin(self.car, 20.0, 22.0, 11.0) == pytest.approx(0.75 * 9.0 / 11.0)
        assert warmth_from_cabin(self.car, 20.0, 22.0, 10.0) == pytest.approx(10.0 / 12.0)
        assert warmth_from_cabin(self.car, 10.0, 22.0, -8.0, logged=True) == 0.0
        assert warmth_from_cabin(self.car, 10.0, 22.0, -8.0) == pytest.approx(18.0 / 30.0)
        assert warmth_from_cabin(self.car, 8.0, 5.0, 5.0) == pytest.approx(3.0 / 5.0)
        assert warmth_from_cabin(self.car, None, 22.0, 2.0) == 0.0
