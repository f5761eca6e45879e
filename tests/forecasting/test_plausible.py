"""Measurements and forecasts that no battery and no trip can have."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.refusals import refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting.plausible import absurd_energy, battery_wh, impossible_faults
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan
from tripwatt.units import GRAVITY_M_S2


@pytest.fixture(scope="module")
def planned():
    plan = tw.read_route([{"length_m": 54_000.0, "speed_m_s": 15.0}])
    return tw.load_model().forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5))


@pytest.fixture(scope="module")
def downhill():
    links = [{"length_m": 14_000.0, "speed_m_s": 15.0, "start_elevation_m": 1500.0, "end_elevation_m": 400.0}]
    return tw.load_model().forecast(tw.read_route(links), tw.Departure(soc=1.0, ambient_temperature_degc=20))


def observed(seconds: float, **columns) -> pd.DataFrame:
    time = np.arange(seconds)
    return pd.DataFrame({"time_s": time} | {k: np.broadcast_to(v, time.shape) for k, v in columns.items()})


def test_a_battery_holds_its_charge_at_the_highest_voltage(planned) -> None:
    highest = max(planned.drive.vehicle.battery.ocv_v)
    assert battery_wh(planned.drive) == pytest.approx(60.0 * 96 * highest), "60 Ah, 96 cells"


def test_more_energy_than_the_battery_holds_is_refused(planned) -> None:
    most = 1.15 * battery_wh(planned.drive)
    current = most / (1799.0 / 3600.0 * 360.0)
    planned.update(observed(1800, voltage_v=360.0, current_a=0.99 * current))
    with pytest.raises(InvalidInput, match="more energy than the battery holds"):
        planned.update(observed(1800, voltage_v=360.0, current_a=1.01 * current))
    refuses(r"81.0 kWh from a battery of", planned.update, observed(1800, voltage_v=360.0, current_a=450.0))


def test_a_charge_rises_by_the_descent_at_most(planned, downhill) -> None:
    with pytest.raises(
        InvalidInput, match="charge rises: observed samples, soc: got a rise of 40 % on the way"
    ):
        planned.update(observed(1800, soc=np.linspace(0.5, 0.9, 1800)))
    mass = planned.vehicle.body.test_mass_kg
    flat = 0.05 + mass * 9.81 * 500.0 / 3600.0 / battery_wh(planned.drive)
    planned.update(observed(600, soc=np.linspace(0.5, 0.5 + 0.99 * flat, 600)))
    refuses("charge rises", planned.update, observed(600, soc=np.linspace(0.5, 0.5 + 1.01 * flat, 600)))
    fall = 0.05 + mass * 9.81 * 1100.0 / 3600.0 / battery_wh(downhill.drive)
    downhill.update(observed(600, displayed_soc=np.linspace(0.5, 0.5 + 0.97 * fall, 600)))
    with pytest.raises(InvalidInput, match="displayed_soc"):
        downhill.update(observed(600, displayed_soc=np.linspace(0.5, 0.5 + 1.03 * fall, 600)))


def test_samples_end_with_the_trip(planned) -> None:
    assert planned.plan.duration_s == 3600.0
    planned.update(observed(5401, voltage_v=360.0, current_a=10.0))
    with pytest.raises(
        InvalidInput, match=r"got 5401 s; allowed: at most 5400 s .*give the speed with the samples"
    ):
        planned.update(observed(5402, voltage_v=360.0, current_a=10.0))
    late = planned.update(observed(7200, voltage_v=360.0, current_a=10.0, speed_m_s=7.0))
    assert late.energy_wh > 0.0
    time = np.arange(601.0)
    trace = tw.load_model().forecast(
        Plan.from_samples(pd.DataFrame({"time_s": 60.0 + time, "speed_m_s": 10.0}))
    )
    ride = {"voltage_v": 360.0, "current_a": 10.0}
    trace.update(observed(721, **ride).iloc[60:])
    refuses("got 661 s; allowed: at most 660 s", trace.update, observed(722, **ride).iloc[60:])


def test_the_charge_at_arrival_is_one_of_a_battery(downhill) -> None:
    series = downhill.to_frame()
    for name in ("displayed_soc", "displayed_soc_low", "displayed_soc_high"):
        assert series[name].between(0.0, 1.0).all()
    assert downhill.soc_arrival <= 1.0
    assert max(downhill.arrival.interval(0.9)) <= 1.0


def test_no_air_is_hotter_than_on_record() -> None:
    assert tw.Departure(ambient_temperature_degc=57.0).ambient_temperature_degc == 57.0
    refuses("got 70; allowed: -60 to 57 °C", tw.Departure, ambient_temperature_degc=70.0)
    samples = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 10.0, "ambient_temperature_degc": 65.0})
    assert Plan.from_samples(samples).departure.ambient_temperature_degc is None, "a sensor in the sun"
    cool = Plan.from_samples(samples.assign(ambient_temperature_degc=57.0))
    assert cool.departure.ambient_temperature_degc == 57.0


def test_a_forecast_keeps_the_energy(planned, downhill) -> None:
    """A level drive gives nothing back, a descent at most its height, with room for a wrong mass."""
    assert list(impossible_faults(planned.energy_wh, planned.drive)) == []
    assert list(impossible_faults(0.0, planned.drive)) == []
    assert list(impossible_faults(-0.9, planned.drive)) == [], "a sum may be wrong by a watt-hour"
    assert len(list(impossible_faults(-1.1, planned.drive))) == 1
    (below,) = impossible_faults(-50.0, planned.drive)
    assert below.what == "energy that physics forbids"
    assert (below.where, below.got) == ("bmw_i3_60ah, route", "-0.05 kWh")
    assert below.allowed.startswith("0 to ")
    height = downhill.vehicle.body.test_mass_kg * 9.80665 * 1100.0 / 3600.0
    assert list(impossible_faults(-1.4 * height, downhill.drive)) == []
    assert len(list(impossible_faults(-1.6 * height, downhill.drive))) == 1


def test_a_forecast_takes_at_most_what_battery_and_motor_give(planned) -> None:
    """An hour at twice the peak power of the motor, 125 kW, is 250 kWh; this battery gives less than 250 kW."""
    hour = planned.plan.duration_s / 3600.0
    battery = planned.vehicle.battery
    cell = min(battery.resistance_ohm)
    full, floor = max(battery.ocv_v), battery.min_cell_voltage_v
    coldest = 96 * floor * (full - floor) / cell * hour
    assert list(impossible_faults(0.5 * min(coldest, 250e3 * hour), planned.drive)) == []
    assert len(list(impossible_faults(251e3 * hour + 5e3, planned.drive))) == 1


def test_a_car_that_cannot_follow_is_no_forecast_of_the_trip() -> None:
    """Without power it takes nothing to speed up, but gives back what it brakes: a level road would fill the battery."""
    model = tw.load_model()
    car = model.vehicle
    weak = dataclasses.replace(
        car,
        drivetrain=dataclasses.replace(car.drivetrain, motor_max_power_w=300.0),
        auxiliaries=dataclasses.replace(car.auxiliaries, base_load_w=0.0, moving_load_w=0.0),
        road_load=dataclasses.replace(
            car.road_load, coastdown_a_n=0.0, coastdown_b_n_s_m=0.0, coastdown_c_n_s2_m2=0.0
        ),
    )
    speed = np.tile(np.concatenate((np.linspace(0.0, 25.0, 30), np.linspace(25.0, 0.0, 30))), 20)
    plan = Plan.from_samples(pd.DataFrame({"time_s": np.arange(1200.0), "speed_m_s": speed}))
    departure = tw.Departure(soc=0.5, ambient_temperature_degc=20, climate="off")
    with pytest.raises(
        InvalidInput, match=r"energy that physics forbids: .*got -.* the car lacks .* kWh to follow"
    ):
        dataclasses.replace(model, vehicle=weak).forecast(plan, departure)


MODEL = tw.load_model()


DEPARTURE = tw.Departure(soc=0.7, ambient_temperature_degc=20.0)


MASS_KG = MODEL.vehicle.body.test_mass_kg


def forecast(grade: float | None, length_m: float = 18_000.0) -> tw.Forecast:
    link: dict[str, float] = {"length_m": length_m, "speed_m_s": 20.0}
    if grade is not None:
        link |= {"start_elevation_m": 3000.0, "end_elevation_m": 3000.0 + grade * length_m}
    return MODEL.forecast(tw.read_route([link]), DEPARTURE)


def steady(current_a: float, seconds: float, **more: Any) -> pd.DataFrame:
    time = np.arange(0.0, seconds + 1.0)
    return pd.DataFrame(
        {"time_s": time, "voltage_v": 350.0, "current_a": current_a, "speed_m_s": 20.0, **more}
    )


@pytest.mark.parametrize("grade", [None, 0.0, 0.01])
@pytest.mark.parametrize("seconds", [120.0, 300.0, 800.0])
def test_a_current_of_the_wrong_sign_at_a_steady_speed_is_refused(
    grade: float | None, seconds: float
) -> None:
    before = forecast(grade)
    refuses(r"less energy than the drive takes.*negate it", before.update, steady(-40.0, seconds))
    assert before.update(steady(40.0, seconds)).energy_wh > 0.0


def test_a_speed_is_held_after_the_start() -> None:
    """The first twentieth, in which the car speeds up, makes no mountain pass of a motorway."""
    observed = steady(-40.0, 400.0)
    observed["speed_m_s"] = np.minimum(observed["time_s"], 20.0)
    refuses(r"less energy than the drive takes.*negate it", forecast(None).update, observed)


def test_a_measured_energy_is_held_against_the_road_as_well() -> None:
    observed = pd.DataFrame({"time_s": [0.0, 600.0], "speed_m_s": 20.0, "observed_energy_wh": [0.0, -500.0]})
    refuses("less energy than the drive takes", forecast(0.0).update, observed)


@given(grade=st.floats(-0.12, -0.03), efficiency=st.floats(0.3, 0.9), seconds=st.floats(60.0, 600.0))
@settings(max_examples=30, deadline=None)
def test_what_a_known_descent_gives_back_is_taken(grade: float, efficiency: float, seconds: float) -> None:
    """At most the potential energy less rolling and air; the law holds for every descent and every efficiency."""
    force = -MASS_KG * GRAVITY_M_S2 * grade - 150.0 - 0.25 * 20.0**2
    recovered_w = max(0.0, efficiency * force * 20.0)
    before = forecast(grade)
    assert before.update(steady(-recovered_w / 350.0, seconds)).measured_until_s > 0.0


def test_a_long_descent_with_bends_is_taken_where_the_heights_are_unknown() -> None:
    """1,150 m down over 14 km, two thirds of it recovered."""
    time = np.arange(0.0, 1001.0)
    speed = 14.0 + 5.0 * np.sin(time / 20.0)
    power = -0.66 * MASS_KG * GRAVITY_M_S2 * 1150.0 / 14_000.0 * speed
    power += MASS_KG * speed * np.gradient(speed, time)
    observed = pd.DataFrame(
        {"time_s": time, "voltage_v": 350.0, "current_a": power / 350.0, "speed_m_s": speed}
    )
    assert forecast(None, 16_000.0).update(observed).measured_until_s > 0.0


def test_braking_to_a_stop_may_give_back_the_kinetic_energy() -> None:
    time = np.arange(0.0, 31.0)
    speed = np.maximum(0.0, 25.0 - time)
    power = -0.8 * MASS_KG * 1.0 * speed
    observed = pd.DataFrame(
        {"time_s": time, "voltage_v": 350.0, "current_a": power / 350.0, "speed_m_s": speed}
    )
    assert forecast(0.0).update(observed).measured_until_s > 0.0


@pytest.mark.parametrize("last_m_s", [15.0, 35.0])
def test_the_least_energy_of_a_flat_road_is_half_of_rolling_and_the_speed_gained(last_m_s) -> None:
    flat = [{"length_m": 54_000.0, "speed_m_s": 15.0, "start_elevation_m": 300.0, "end_elevation_m": 300.0}]
    forecast = tw.load_model().forecast(
        tw.read_route(flat), tw.Departure(soc=0.8, ambient_temperature_degc=20)
    )
    speed = np.full(2401, 15.0)
    speed[-1] = last_m_s
    driven_m = float(np.sum(0.5 * (speed[1:] + speed[:-1])))
    body = forecast.vehicle.body
    rolling_wh = forecast.drive.simulation.by_cause_wh["rolling"] * driven_m / 54_000.0
    gained_wh = 0.5 * body.test_mass_kg * body.rotating_mass_factor * (last_m_s**2 - 15.0**2) / 3600.0
    height_wh = 40.0 * body.test_mass_kg * GRAVITY_M_S2 / 3600.0  # error of the difference of two heights
    min_w = (0.5 * rolling_wh + gained_wh - height_wh) / (2400.0 / 3600.0)
    assert min_w > 300.0
    forecast.update(observed(2401, voltage_v=350.0, current_a=1.03 * min_w / 350.0, speed_m_s=speed))
    with pytest.raises(InvalidInput, match="less energy than the drive takes"):
        forecast.update(observed(2401, voltage_v=350.0, current_a=0.97 * min_w / 350.0, speed_m_s=speed))


@pytest.mark.parametrize("shown", [np.full(480, 0.9), np.zeros(480)], ids=["stuck", "zero"])
def test_a_charge_that_the_energy_contradicts_is_flagged_and_left_out(shown):
    plan = tw.read_route([{"length_m": 1000.0, "speed_m_s": 25.0}] * 80)
    forecast = tw.load_model().forecast(plan, tw.Departure(soc=0.9, ambient_temperature_degc=20.0))
    time_s = 5.0 * np.arange(480)
    columns = {"time_s": time_s, "speed_m_s": np.full(480, 25.0), "observed_energy_wh": 3.5 * time_s}
    by_energy = forecast.update_since_departure(pd.DataFrame(columns))
    right = 0.9 - columns["observed_energy_wh"] / forecast.charge.wh_per_display
    for charge, code in ((shown, ["charge_contradicted"]), (right, [])):
        now = forecast.update_since_departure(pd.DataFrame(columns | {"displayed_soc": charge}))
        assert [flag.code for flag in now.flags if flag.code == "charge_contradicted"] == code
        assert now.soc_arrival == pytest.approx(by_energy.soc_arrival, abs=0.02)


@pytest.mark.parametrize(("times", "is_plausible"), [(0.3, False), (0.5, True), (2.0, True), (3.0, False)])
def test_the_energy_of_most_trips_is_one_that_the_car_can_take(times, is_plausible) -> None:
    car = tw.load_vehicle("bmw_i3_60ah")
    trips = synthetic_fleet(5, seed=3).trips
    simulated = [tw.simulate(trip, car).simulated_energy_wh for trip in trips]
    measured = [
        dataclasses.replace(t, observed_energy_wh=times * wh) for t, wh in zip(trips, simulated, strict=True)
    ]
    measured[0] = dataclasses.replace(trips[0], observed_energy_wh=simulated[0])  # one trip decides nothing
    faults = list(absurd_energy(car, measured, "drives"))
    assert [str(fault).partition(";")[0] for fault in faults] == (
        [] if is_plausible else [f"implausible energy: drives: got {times:g} times the energy of {car.title}"]
    )
    assert list(absurd_energy(car, [], "drives")) == []
    assert bool(list(absurd_energy(car, measured[1:2], "one drive"))) != is_plausible
