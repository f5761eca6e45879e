"""The cabin and its climate control, and the sun by the words of a weather report."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripwatt.physics.cabin import (
    HEAT_PUMP_RATING_DEGC,
    MIN_SIDE_BY_SIDE,
    UNKNOWN_SUN_W_M2,
    WINTER_SUN,
    CabinStart,
    CabinTask,
    condition_cabins,
    control_steps,
    control_values,
    heat_pump_cop,
    heat_pump_heat,
    irradiance,
)
from tripwatt.physics.conditions import DriveConditions
from tripwatt.physics.simulate import simulate
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.parts import Climate


def condition_cabin(*task):
    return condition_cabins([CabinTask(*task)])[0]


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


class TestCabinByHand:
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


CLEAR = 600.0


def under_cloud(share: float) -> float:
    """Global irradiance under a share of cloud (Kasten and Czeplak 1980)."""
    return CLEAR * (1.0 - 0.75 * share**3.4)


@pytest.mark.parametrize(
    ("report", "expected"),
    [
        ("sunny", CLEAR),
        ("clear sky", CLEAR),
        ("overcast", under_cloud(1.0)),
        ("cloudy", under_cloud(1.0)),
        ("Partly cloudy", 400.0),
        ("slightly cloudy", 400.0),
        ("rainy", 100.0),
        ("snow", 100.0),
        ("light snow, cloudy", 100.0),
        ("fog", 100.0),
        ("sunset", 50.0),
        ("sunrise", 50.0),
        ("dark", 0.0),
        ("night, clear", 0.0),
        ("hail of frogs", UNKNOWN_SUN_W_M2),
        (None, UNKNOWN_SUN_W_M2),
    ],
)
def test_sun_of_a_report(report, expected):
    assert irradiance(report) == pytest.approx(expected)
    winter = expected if report is None else expected * WINTER_SUN
    assert irradiance(report, "winter") == pytest.approx(winter)
    assert irradiance(report, "summer") == pytest.approx(expected)


def test_cabins_side_by_side_are_those_of_each_alone():
    """Drives of 5 to 36 control steps from arctic cold to heat; the arrays of the short ones are padded on the way."""
    number = np.arange(MIN_SIDE_BY_SIDE)
    controls = [
        control_values(ROOM, 2.0 * k - 25.0, CabinStart(10.0, 21.0, 300.0, 0.0, "auto")) for k in number
    ]
    speeds = [np.linspace(0.0, 30.0, 36 - k) for k in number]
    together = control_steps(controls, speeds)
    for own, control, speed in zip(together, controls, speeds, strict=True):
        (alone,) = control_steps([control], [speed])
        for found, expected in zip(own, alone, strict=True):
            assert found == pytest.approx(np.asarray(expected), rel=1e-9, abs=1e-9)
