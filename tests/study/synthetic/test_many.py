"""The synthetic fleet of many vehicles: its truth, its independence of how it is made, and what it logs."""

import datetime as dt

import numpy as np
import pytest
from benchmarks.many_vehicles import (
    AGEING_PER_YEAR,
    BLOCK,
    CAR_MODELS,
    BlockOfTrips,
    FleetPlan,
    battery_states,
    block_of_logs,
    climate_power,
    many_vehicles,
    vehicle_truth,
    wheel_power,
)

from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.trips import observed_energy
from tripwatt.vehicles import load_vehicle

PLAN = FleetPlan(150, vehicles=12, car_models=CAR_MODELS[:2], minutes=10.0)


def trips_of(
    car_model="bmw_i3_60ah", *, shares=(0.0, 0.0, 0.0, 0.0), ambient=20.0, years=0.0, resistance=0.0
):
    one = np.ones(1)
    return BlockOfTrips(
        60.0 * one,
        0.0 * one,
        ["A"],
        21.0 * one,
        0.0 * one,
        np.array([shares]),
        years * one,
        ambient * one,
        0.8 * one,
        resistance * one,
        dict.fromkeys(("climate", "base load", "road load", "battery"), 0.0 * one[:, None]),
    )


def test_a_longer_fleet_begins_with_the_shorter_one_and_any_block_can_be_made_alone():
    longer = FleetPlan(400, vehicles=12, car_models=CAR_MODELS[:2], minutes=10.0)
    short = {log.trip_id: log for log in many_vehicles(PLAN)}
    long = {log.trip_id: log for log in many_vehicles(longer)}
    assert len(short) == 150
    assert len(long) == 400
    assert set(short) <= set(long)
    assert all(short[name].samples.equals(long[name].samples) for name in short)
    alone = block_of_logs(PLAN, 1, 1)
    assert [log.trip_id for log in alone] == [log.trip_id for log in list(many_vehicles(PLAN))[-len(alone) :]]
    assert alone[0].samples.equals(short[alone[0].trip_id].samples)
    other = next(many_vehicles(FleetPlan(1, vehicles=12, car_models=CAR_MODELS[:2], minutes=10.0, seed=1)))
    assert not other.samples.equals(short["V00000-00000"].samples)


def test_trips_are_spread_over_vehicles_and_models():
    plan = FleetPlan(100, vehicles=7, car_models=CAR_MODELS[:3])
    assert [list(plan.vehicles_of(m)) for m in range(3)] == [[0, 3, 6], [1, 4], [2, 5]]
    assert [plan.trips_of(m) for m in range(3)] == [
        14 * 3 + 1,
        14 * 2 + 1,
        14 * 2,
    ]  # 2 trips are left for 0 and 1
    assert plan.blocks() == [(0, 0), (1, 0), (2, 0)]
    assert FleetPlan(BLOCK + 1, vehicles=1, car_models=CAR_MODELS[:1]).blocks() == [(0, 0), (0, 1)]
    assert FleetPlan(BLOCK, vehicles=1, car_models=CAR_MODELS[:1]).blocks() == [(0, 0)]
    counts = np.unique([log.context.car for log in many_vehicles(PLAN)], return_counts=True)[1]
    assert counts.tolist() == [13] * 6 + [12] * 6


def test_logs_are_sound_and_their_energy_is_that_of_voltage_and_current():
    logs = list(many_vehicles(FleetPlan(24, vehicles=8)))
    found = audit(logs)
    assert len(found.trips) == 24
    assert not [f for f in found.findings if f.consequence != "noted"]
    for log in logs:
        assert log.observed_energy_wh == pytest.approx(observed_energy(log.samples), rel=1e-12)
        assert 16 * 60 <= log.duration_s <= 24 * 60
        assert log.array("speed_m_s").max() < 45.0
        assert log.context.driver.startswith(log.context.car)
        assert log.context.started_at >= dt.datetime(2023, 1, 1)


def test_the_truth_differs_by_model_and_vehicle():
    truths = [vehicle_truth(FleetPlan(1, vehicles=400, car_models=CAR_MODELS[:2]), n) for n in range(400)]
    assert truths[2].car_model == CAR_MODELS[0]
    common = np.array([t.shares for t in truths]) - np.array([t.own for t in truths])
    assert np.ptp(common[::2], axis=0).max() < 1e-12
    assert np.abs(common[0] - common[1]).min() > 0.0
    own = np.array([t.own for t in truths])
    assert own.std(axis=0) == pytest.approx([0.08, 0.05, 0.15, 0.25], rel=0.2)
    assert {len(t.drivers) for t in truths} == {1, 2, 3}


def test_wheel_power_is_that_of_the_forces():
    car = load_vehicle("bmw_i3_60ah")
    v, flat = np.full((1, 2), 20.0), np.zeros((1, 2))
    time = np.array([[0.0, 1e6]])  # cold, and warm
    base = wheel_power(car, trips_of(), v, flat, flat, time)
    mass, (c0, c1) = car.body.test_mass_kg, car.road_load.rolling_coefficients
    rho = 101325.0 * (1 - 0.0065 * 300 / 288.15) ** (9.80665 / (287.05287 * 0.0065)) / (287.05287 * 293.15)
    air = 0.5 * rho * car.road_load.drag_area_m2 * 400.0
    tyres = car.tyres
    weather = 1.0 + tyres.temperature_coefficient_per_k * (tyres.reference_temperature_degc - 20.0)
    rolling = mass * 9.80665 * (c0 + c1 * 20.0) * weather
    assert base[0, 1] == pytest.approx(20.0 * (air + rolling), rel=1e-4)
    assert base[0, 0] == pytest.approx(20.0 * (air + rolling * (1.0 + tyres.cold_excess)), rel=1e-4)
    more = wheel_power(car, trips_of(shares=(0.1, 0.2, 0.0, 0.0), resistance=0.05), v, flat, flat, time)
    assert more[0, 1] == pytest.approx(20.0 * (1.25 * air + 1.15 * rolling), rel=1e-4)
    hill = wheel_power(car, trips_of(), v, np.full((1, 2), 0.5), np.full((1, 2), 0.75), time)
    inertia = mass * car.body.rotating_mass_factor * 0.5
    assert hill[0, 1] - base[0, 1] == pytest.approx(20.0 * (inertia + mass * 9.80665 * 0.6), rel=1e-9)


def test_climate_heats_in_the_cold_and_cools_in_the_heat():
    car = load_vehicle("bmw_i3_60ah")
    time = np.array([[0.0, 1e6]])
    cold, _ = climate_power(car, trips_of(ambient=-10.0), time)
    mild, _ = climate_power(car, trips_of(ambient=19.0), time)
    hot, cabin = climate_power(car, trips_of(ambient=40.0), time)
    rules = car.climate
    loss = rules.shell_w_k + rules.fresh_air_low_w_k
    heat = loss * 31.0 - rules.occupant_heat_w - 150.0
    cop = max(1.0, rules.heat_pump_cop_at_0_degc - 10.0 * rules.heat_pump_cop_per_k)
    pumped = min(heat, rules.heat_pump_max_heat_w * max(1.0 - 0.03 * 17.0, 0.0))
    steady = pumped / cop + (heat - pumped) / rules.heater_efficiency + rules.blower_low_power_w
    assert cold[0, 1] == pytest.approx(steady, rel=1e-9)
    assert cold[0, 0] > cold[0, 1] > mild[0, 1]
    cool = (loss * 19.0 + rules.occupant_heat_w + 150.0) / rules.cooler_cop + rules.blower_low_power_w
    assert hot[0, 1] == pytest.approx(cool, rel=1e-9)
    assert cabin[0].tolist() == [41.0, 21.0]
    leaky, _ = climate_power(car, trips_of(ambient=40.0, shares=(0.0, 0.0, 0.5, 0.0)), time)
    assert leaky[0, 1] - hot[0, 1] == pytest.approx(0.5 * loss * 19.0 / rules.cooler_cop, rel=1e-9)


def test_the_battery_gives_the_power_and_ages():
    car = load_vehicle("bmw_i3_60ah")
    power = np.full((1, 3600), 7000.0)
    current, voltage, soc = battery_states(car, trips_of(), power)
    assert (current * voltage)[0] == pytest.approx(power[0], rel=1e-9)
    assert 0.8 - soc[0, -1] == pytest.approx(current.sum() / 3600.0 / car.battery.capacity_ah, rel=1e-9)
    old = battery_states(car, trips_of(years=2.0), power)
    share = 0.8 - old[2][0, -1]
    aged = car.battery.capacity_ah * (1.0 - 2.0 * AGEING_PER_YEAR[1])
    assert share == pytest.approx(old[0].sum() / 3600.0 / aged, rel=1e-9)
    assert old[1][0, 0] < voltage[0, 0]


def test_every_fault_of_a_plan_is_named():
    with pytest.raises(InvalidInput) as error:
        FleetPlan(0, vehicles=0, minutes=4.0, days_between=0.01)
    assert [f.where for f in error.value.faults] == ["trips", "vehicles", "minutes", "days_between"]
    for models in ((), CAR_MODELS):
        with pytest.raises(InvalidInput, match="wrong number of car models"):
            FleetPlan(1, vehicles=7, car_models=models)
    FleetPlan(1, vehicles=8)
