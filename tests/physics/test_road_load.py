"""Rolling, air drag and grade: by hand, and against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
from tripwatt.trips import STEEPEST_GRADE
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.parts import Tyres

EXACT = {"rel": 1e-12, "abs": 1e-12}


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


class TestGradeByHand:
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
        most = grade_from_elevation(self.time, self.speed, 100.0 + np.where(self.time > 40, sign * 8.0, 0.0))
        assert most == pytest.approx(self.graded(sign * 8.0 * weight(self.piece - 40)), **EXACT)
        more = grade_from_elevation(self.time, self.speed, 100.0 + np.where(self.time > 40, sign * 24.0, 0.0))
        spread = sum(4.0 * weight(self.piece - k) for k in (38, 39, 40, 40, 41, 42))
        assert more == pytest.approx(self.graded(sign * spread), **EXACT)

    @pytest.mark.parametrize("size", [44.0, -300.0, 6000.0])
    def test_two_jumps_that_cancel_are_left_out(self, size: float) -> None:
        def climbs(width: int) -> float:
            height = np.where((self.time > 30) & (self.time <= 30 + width), 300.0 + size, 300.0)
            return float(np.abs(grade_from_elevation(self.time, self.speed, height)).max())

        assert [climbs(width) for width in (1, 5, 19, 24)] == [0.0] * 4

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


def test_air_density_of_the_standard_atmosphere() -> None:
    assert air_density(15.0) == pytest.approx(1.2250, abs=1e-4)
    assert air_density(8.5, 1000.0) == pytest.approx(1.1117, abs=2e-4)  # ICAO Doc 7488 table at 1000 m


STEEPEST = float(np.tan(np.arcsin(STEEPEST_GRADE))) + 1e-9
"""Largest grade, as rise over horizontal distance."""


def climb(grade: np.ndarray, speed: np.ndarray, step_s: np.ndarray | float = 1.0) -> float:
    """Height gained on the road of a grade: its length is the integral of the speed."""
    length = 0.5 * (speed[1:] + speed[:-1]) * step_s
    return float(np.sum(np.sin(np.arctan(grade[1:])) * length))


class TestGrade:
    time = np.arange(0.0, 600.0)
    speed = np.full(600, 15.0)
    climb = 0.03 * 15.0 * time

    def total(self, grade: np.ndarray) -> float:
        return float(np.sum(grade[1:] * 15.0))

    def test_steps_of_a_metre_become_the_slope(self) -> None:
        grade = grade_from_elevation(self.time, self.speed, np.round(500.0 + self.climb))
        assert grade[60:-60] == pytest.approx(0.03, abs=0.004)
        assert self.total(grade) == pytest.approx(self.climb[-1], rel=0.02)

    def test_a_hill_keeps_its_height(self) -> None:
        hill = 40.0 * np.sin(np.pi * self.time / 599.0) ** 2
        grade = grade_from_elevation(self.time, self.speed, hill)
        assert np.sum(np.maximum(grade, 0.0) * 15.0) == pytest.approx(40.0, rel=0.03)
        assert self.total(grade) == pytest.approx(0.0, abs=0.5)

    @pytest.mark.parametrize("jump", [66.0, -120.0, 6000.0])
    def test_a_larger_jump_is_no_climb_and_both_sides_keep_their_slopes(self, jump: float) -> None:
        height = 500.0 + self.climb
        grade = grade_from_elevation(self.time, self.speed, height + np.where(self.time > 300.0, jump, 0.0))
        assert climb(grade, self.speed) == pytest.approx(
            self.climb[-1], abs=0.46
        )  # one sample of 0.45 m is level
        assert np.tan(np.arcsin(0.03)) == pytest.approx(grade[100:200], rel=1e-9)

    def test_a_drift_at_standstill_is_no_hill(self) -> None:
        speed = self.speed.copy()
        speed[200:400] = 0.0
        drift = np.interp(self.time, [0.0, 200.0, 400.0, 599.0], [500.0, 500.0, 504.0, 500.0])
        drift[400:] = 500.0
        grade = grade_from_elevation(self.time, speed, drift)
        assert np.abs(grade).max() < 0.03
        assert climb(grade, speed) == pytest.approx(0.0, abs=1e-6)

    def test_a_drift_at_standstill_that_stays_is_carried_to_the_road_beside_it(self) -> None:
        speed = self.speed.copy()
        speed[200:400] = 0.0
        drift = np.interp(self.time, [200.0, 400.0], [500.0, 520.0])
        grade = grade_from_elevation(self.time, speed, drift)
        assert climb(grade, speed) == pytest.approx(20.0, abs=1e-6)
        assert grade.max() < 0.15

    @pytest.mark.parametrize("height", [np.full(600, np.nan), np.full(600, 582.0)])
    def test_missing_or_constant_or_never_moving_is_flat(self, height: np.ndarray) -> None:
        assert (grade_from_elevation(self.time, self.speed, height) == 0.0).all()
        assert (grade_from_elevation(self.time, np.zeros(600), self.climb) == 0.0).all()

    @settings(max_examples=40, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.integers(2, 300))
    def test_no_noise_makes_an_impossible_road(self, seed, n) -> None:
        rng = np.random.default_rng(seed)
        time = np.cumsum(rng.exponential(2.0, n) + 1e-3)
        grade = grade_from_elevation(time, rng.uniform(0.0, 40.0, n), rng.normal(500.0, 30.0, n))
        assert np.isfinite(grade).all()
        assert np.abs(grade).max() <= STEEPEST


def test_rolling_drag_falls_while_driving_and_with_warm_air(i3: Vehicle) -> None:
    assert i3.tyres is not None
    speed, step = np.full(1800, 15.0), np.full(1800, 1.0)
    cold = rolling_factor(speed, step, -10.0, i3.tyres)
    warm = rolling_factor(speed, step, 25.0, i3.tyres)
    driven = rolling_factor(speed, step, -10.0, i3.tyres, 1.0)
    assert (np.diff(cold) < 0.0).all()
    assert (cold > warm).all()
    assert cold[0] > driven[0]
