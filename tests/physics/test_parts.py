"""Each part of the chain against a second opinion: a plain loop, a closed form, a table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.physics.battery import discharge, internal_resistance, open_circuit_voltage
from tripwatt.physics.cabin import HEAT_PUMP_RATING_DEGC, CabinStart, condition_cabin, heat_pump_heat
from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.relaxation import Relaxation
from tripwatt.physics.road_load import air_density, grade_from_elevation, rolling_factor
from tripwatt.physics.simulate import simulate
from tripwatt.trips import STEEPEST_GRADE, Departure
from tripwatt.vehicles import Vehicle, load_vehicle


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200), st.sampled_from([1e-6, 0.1, 3.0, 300.0]))
def test_relaxation_is_the_recursion(seed, n, scale) -> None:
    rng = np.random.default_rng(seed)
    step, target = rng.exponential(scale, n), rng.normal(0.0, 30.0, n)
    state, expected = 5.0, []
    for s, t in zip(step, target, strict=True):
        state = state * np.exp(-s) + t * -np.expm1(-s)
        expected.append(state)
    assert Relaxation(step).solve(5.0, target) == pytest.approx(np.array(expected), abs=1e-9, rel=1e-9)


@pytest.mark.parametrize(("soc", "temperature"), [(0.8, 20.0), (0.3, -15.0), (0.95, 35.0)])
def test_battery_passes_agree_with_a_loop_over_samples(i3: Vehicle, soc: float, temperature: float) -> None:
    battery = i3.battery
    rng = np.random.default_rng(3)
    step = rng.choice([0.1, 1.0, 20.0], size=400)
    step[0] = 0.0
    power = rng.normal(5_000.0, 15_000.0 if temperature > 0.0 else 4_000.0, 400)
    run = discharge(battery, power, step, 5.0, soc, temperature)
    charge, heat_c, full = soc, temperature, max(soc, battery.displayed_full_soc)
    for k in range(400):
        ocv = open_circuit_voltage(np.array([charge]), battery)[0]
        ohm = internal_resistance(np.array([charge]), np.array([heat_c]), battery)[0]
        current = (ocv - np.sqrt(ocv**2 - 4.0 * ohm * power[k])) / (2.0 * ohm)
        hours = step[k] / 3600.0
        if hours > 0.0:  # charge that finds no room is refused
            current = max(current, (charge - full) * battery.capacity_ah / hours)
        charge -= current * hours / battery.capacity_ah
        decay = np.exp(-step[k] * battery.heat_loss_w_k / battery.heat_capacity_j_k)
        heat_c = 5.0 + current**2 * ohm / battery.heat_loss_w_k * (1 - decay) + (heat_c - 5.0) * decay
        assert run.current_a[k] == pytest.approx(current, rel=1e-4, abs=1e-3)
    assert run.converged
    assert run.soc[-1] == pytest.approx(charge, abs=1e-5)
    assert run.temperature_degc[-1] == pytest.approx(heat_c, abs=1e-3)


def test_an_empty_battery_gives_what_the_drive_takes(i3: Vehicle) -> None:
    """Charge below empty is counted; the energy does not fall because the battery has none left."""
    power, step = np.full(1800, 15_000.0), np.ones(1800)
    low, high = (discharge(i3.battery, power, step, 20.0, soc, 20.0) for soc in (0.1, 0.8))
    assert low.soc[-1] < 0.0
    assert low.power_w == pytest.approx(high.power_w)
    empty = low.soc < i3.battery.displayed_zero_soc
    assert np.ptp(low.current_a[empty][1:]) < 0.05 * low.current_a[-1]  # the cells warm a little


def test_cold_and_empty_cells_resist_more(i3: Vehicle) -> None:
    soc = np.array([0.05, 0.5, 0.5])
    cold, warm = (internal_resistance(soc, np.full(3, t), i3.battery) for t in (-10.0, 25.0))
    assert (cold > warm).all()
    assert warm[0] > warm[1]


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

    @pytest.mark.parametrize("jump", [27.5, 45.0, -120.0])
    def test_a_jump_is_spread_and_climbs_as_much(self, jump: float) -> None:
        grade = grade_from_elevation(self.time, self.speed, np.where(self.time > 300.0, jump, 0.0))
        assert climb(grade, self.speed) == pytest.approx(jump, abs=1e-6)
        assert (np.sign(jump) * grade >= 0.0).all()
        assert np.abs(grade).max() <= STEEPEST

    @pytest.mark.parametrize("width_s", [1, 5, 20])
    def test_a_spike_is_no_hill(self, width_s: int) -> None:
        spike = np.where((self.time > 300.0) & (self.time <= 300.0 + width_s), 44.0, 0.0)
        grade = grade_from_elevation(self.time, self.speed, spike)
        assert np.abs(grade).max() < 0.002

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
    def test_missing_or_constant_is_flat(self, height: np.ndarray) -> None:
        assert (grade_from_elevation(self.time, self.speed, height) == 0.0).all()

    def test_gaps_are_bridged(self) -> None:
        height = 500.0 + self.climb
        height[100:200] = np.nan
        assert grade_from_elevation(self.time, self.speed, height)[50:-50] == pytest.approx(0.03, abs=0.004)

    def test_never_moving_is_flat(self) -> None:
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


class TestCabin:
    time = np.arange(0.0, 3601.0)

    def run(self, car: Vehicle, ambient: float, start: CabinStart, speed: float = 0.0):
        assert car.climate is not None
        return condition_cabin(car.climate, self.time, np.full(3601, speed), ambient, start)

    def test_settled_heating_is_the_loss_of_the_cabin(self, i3: Vehicle) -> None:
        c = i3.climate
        assert c is not None
        run = self.run(i3, -5.0, CabinStart(22.0, 22.0, 0.0, warmth=1.0), speed=20.0)
        fan = (run.power_w[-1] - c.blower_low_power_w) / (
            c.heater_max_heat_w / c.heater_efficiency + c.blower_high_power_w - c.blower_low_power_w
        )
        fresh = c.fresh_air_low_w_k + fan * (c.fresh_air_high_w_k - c.fresh_air_low_w_k)
        loss = (c.shell_w_k + 20.0 * c.shell_per_speed_w_s_k_m + fresh) * 27.0 - c.occupant_heat_w
        assert fan * c.heater_max_heat_w == pytest.approx(loss, rel=0.01)
        assert run.temperature_degc[-1] == pytest.approx(22.0, abs=0.05)

    def test_heat_put_in_is_heat_stored_and_lost(self, i3: Vehicle) -> None:
        c = i3.climate
        assert c is not None
        mild = self.run(i3, 12.0, CabinStart(12.0, 22.0, 0.0))
        cold = self.run(i3, -18.0, CabinStart(-18.0, 22.0, 0.0))
        most = c.heater_max_heat_w / c.heater_efficiency + c.blower_high_power_w + c.defrost_power_w
        assert cold.power_w.max() <= most + 1e-9
        assert cold.power_w.sum() > 2.0 * mild.power_w.sum()
        assert (np.diff(cold.temperature_degc[:300:10]) > 0.0).all()

    @pytest.mark.parametrize("ambient", [-20.0, 0.0, 15.0, 25.0, 40.0])
    def test_set_point_is_reached(self, i3: Vehicle, ambient: float) -> None:
        run = self.run(i3, ambient, CabinStart(ambient, 22.0, 200.0))
        assert run.temperature_degc[-1] == pytest.approx(22.0, abs=1.0)

    def test_cool_outside_air_spares_the_compressor(self, i3: Vehicle) -> None:
        c = i3.climate
        assert c is not None
        run = self.run(i3, 15.0, CabinStart(24.0, 22.0, 500.0))
        assert run.power_w[-1] <= c.blower_high_power_w

    def test_heat_pump_takes_less(self, i3: Vehicle) -> None:
        pump = load_vehicle("bmw_i3_60ah", overrides={"climate.heat_pump_max_heat_w": 4000.0})
        start = CabinStart(0.0, 22.0, 0.0)
        assert self.run(pump, 0.0, start).power_w.sum() < 0.75 * self.run(i3, 0.0, start).power_w.sum()

    @given(st.floats(-50.0, 40.0), st.floats(0.0, 20.0))
    def test_heat_pump_is_weaker_in_colder_air(self, ambient: float, colder: float) -> None:
        climate = load_vehicle("nissan_leaf_24").climate
        assert climate is not None
        assert 0.0 <= heat_pump_heat(ambient - colder, climate) <= heat_pump_heat(ambient, climate)
        assert heat_pump_heat(HEAT_PUMP_RATING_DEGC, climate) == climate.heat_pump_max_heat_w > 0.0

    def test_where_the_heat_pump_gives_nothing_the_heater_gives_all(self, i3: Vehicle) -> None:
        pump = load_vehicle("bmw_i3_60ah", overrides={"climate.heat_pump_max_heat_w": 4000.0})
        start = CabinStart(-45.0, 22.0, 0.0)
        cold = [
            condition_cabin(car.climate, np.arange(0.0, 600.0), np.zeros(600), -45.0, start).power_w
            for car in (pump, i3)
            if car.climate is not None
        ]
        assert cold[0] == pytest.approx(cold[1])

    def test_energy_does_not_depend_on_the_samples(self, i3: Vehicle) -> None:
        assert i3.climate is not None
        start = CabinStart(-5.0, 22.0)
        coarse = np.array([0.0, 7.0, 100.0, 101.5, 950.0, 3600.0])
        energy = [
            float(
                np.sum(
                    condition_cabin(i3.climate, t, np.full(len(t), 9.0), -5.0, start).power_w[1:] * np.diff(t)
                )
            )
            for t in (self.time, coarse)
        ]
        assert energy[0] == pytest.approx(energy[1], rel=1e-9)

    def test_off_is_off(self, i3: Vehicle) -> None:
        run = simulate(
            i3,
            self.time,
            np.zeros(3601),
            conditions=DriveConditions(ambient_temperature_degc=-10.0, climate="off"),
        )
        assert run.simulated_energy_wh == pytest.approx(i3.auxiliaries.base_load_w)
        assert np.isnan(run.cabin_temperature_degc).all()


@pytest.mark.parametrize("ambient", [-10.0, 15.0, 35.0])
def test_climate_modes_take_away_heater_or_compressor(i3: Vehicle, ambient: float) -> None:
    time = np.arange(3601.0)
    runs = {
        mode: condition_cabin(
            i3.climate, time, np.full(3601, 15.0), ambient, CabinStart(ambient, 22.0, 0.0, mode=mode)
        )
        for mode in ("auto", "heat", "cool")
    }
    energy = {mode: run.power_w[1:].sum() for mode, run in runs.items()}
    end = {mode: run.temperature_degc[-1] for mode, run in runs.items()}
    if ambient > 30.0:
        np.testing.assert_array_equal(runs["cool"].power_w, runs["auto"].power_w)
        assert energy["heat"] < energy["auto"]
        assert end["heat"] > end["auto"] + 2.0
    else:
        np.testing.assert_array_equal(runs["heat"].power_w, runs["auto"].power_w)
        # only the blower runs
        np.testing.assert_allclose(runs["cool"].power_w, i3.climate.blower_low_power_w)
        assert end["cool"] < end["auto"] - 2.0


def test_an_unknown_climate_mode_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"climate.*one of auto, off, heat, cool"):
        DriveConditions(climate="warm")
    with pytest.raises(InvalidInput, match=r"climate.*one of auto, off, heat, cool"):
        Departure(climate="warm")
