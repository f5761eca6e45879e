"""Many drives at once: each as it is alone, whatever is beside it."""

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from benchmarks.worlds import changed

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.physics import chain, simulate_trip
from tripwatt.physics.batch import CHUNK_SAMPLES, energies_on_grades, simulate_trips, trip_totals
from tripwatt.physics.cabin import MIN_SIDE_BY_SIDE
from tripwatt.physics.chain import CAUSES
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan

I3 = tw.load_vehicle("bmw_i3_60ah")
CARS = (
    I3,
    tw.load_vehicle("bmw_i3_60ah", "paper"),
    tw.load_vehicle("nissan_leaf_24"),
    tw.load_vehicle("tesla_model_3_lr"),
)
WEATHER = (
    {"ambient_temperature_degc": -15.0, "soc": 0.9},
    {"ambient_temperature_degc": 37.0, "soc": 1.0},
    {"ambient_temperature_degc": 20.0, "soc": 0.02},
    {"climate": "off", "payload_mass_kg": 200.0},
    {"wind_speed_m_s": 9.0, "rain_mm_h": 2.0, "extras": ("roof_box",)},
)


def drive(seed: int, n: int, **known) -> Plan:
    """A drive over hills at about 1 Hz, with steps that are not all equal."""
    rng = np.random.default_rng(seed)
    speed = np.clip(14.0 + np.cumsum(rng.normal(0.0, 0.8, n)), 0.0, 45.0)
    time = np.cumsum(rng.choice([1.0, 1.0, 0.5], n))
    height = 200.0 + 40.0 * np.sin(time / 300.0 + seed)
    columns = {"time_s": time, "speed_m_s": speed} | ({"elevation_m": height} if seed % 2 else {})
    return Plan.from_trace(f"drive {seed}", pd.DataFrame(columns), tw.Departure(**known))


DRIVES = [drive(k, n, **known) for k, (n, known) in enumerate(itertools.product((2, 300, 317, 900), WEATHER))]


def assert_same(one, many):
    for name in vars(one):
        expected, found = getattr(one, name), getattr(many, name)
        if name == "power_by_cause_w":
            for cause in CAUSES:
                np.testing.assert_allclose(found[cause], expected[cause], rtol=1e-9, atol=1e-9)
        elif name == "flags":
            assert [(f.code, f.subject) for f in found] == [(f.code, f.subject) for f in expected]
            assert [f.value for f in found] == pytest.approx([f.value for f in expected], rel=1e-9)
        else:
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9, err_msg=name)


def test_each_drive_is_as_it_is_alone():
    pairs = list(itertools.product(CARS, DRIVES))
    assert len(pairs) > MIN_SIDE_BY_SIDE
    codes = set()
    for (car, plan), run in zip(pairs, simulate_trips(pairs), strict=True):
        alone = simulate_trip(car, plan)
        codes |= {flag.code for flag in alone.flags}
        assert_same(alone, run)
    assert {"battery_empty", "battery_full"} <= codes, "the drives reach both ends of the battery"


def test_totals_are_the_sums_of_the_arrays():
    pairs = list(itertools.product(CARS, DRIVES))
    totals = trip_totals(pairs)
    for row, (car, plan) in enumerate(pairs):
        alone = simulate_trip(car, plan)
        energy = alone.simulated_energy_wh
        assert totals["energy_wh"][row] == pytest.approx(energy, rel=1e-9)
        for cause, wh in alone.by_cause_wh.items():
            assert totals[f"energy_{cause}_wh"][row] == pytest.approx(wh, rel=1e-9, abs=1e-9 * abs(energy))
        assert totals["soc"][row] == pytest.approx(alone.soc[-1], rel=1e-9)
        assert totals["duration_s"][row] == pytest.approx(plan.duration_s, rel=1e-9)
        assert totals["distance_m"][row] == pytest.approx(plan.distance_m, rel=1e-9)
        assert [f.code for f in totals["flags"][row]] == [f.code for f in alone.flags]


def test_the_order_of_the_drives_does_not_matter():
    order = np.random.default_rng(1).permutation(len(DRIVES))
    straight = trip_totals((I3, plan) for plan in DRIVES)["energy_wh"]
    mixed = trip_totals((I3, DRIVES[i]) for i in order)["energy_wh"]
    assert mixed == pytest.approx([straight[i] for i in order], rel=1e-9)


def test_cars_that_differ_in_their_values_are_driven_side_by_side():
    cars = [changed(I3, {"mass": 0.02 * k, "air": -0.01 * k, "base_load": 0.1 * k}) for k in range(12)]
    curve = tuple(v + 0.01 for v in I3.battery.ocv_v)
    cars += [I3.with_values({"battery.ocv_v": curve}), I3.with_values({"battery.heat_loss_w_k": 0.0})]
    for car, run in zip(cars, simulate_trips((car, DRIVES[15]) for car in cars), strict=True):
        assert_same(simulate_trip(car, DRIVES[15]), run)


def test_a_long_drive_beside_short_ones_and_a_drive_larger_than_a_chunk():
    time = np.linspace(0.0, 170_000.0, 300)  # hundreds of time constants of the tyres
    days = Plan.from_trace("days", pd.DataFrame({"time_s": time, "speed_m_s": 10.0 + time % 7.0}))
    long = [drive(3, CHUNK_SAMPLES + 5, soc=0.9)]
    plans = [days, *long, *DRIVES[5:9], days]
    car = I3.with_values({"tyres.warm_up_time_s": 600.0})
    for plan, run in zip(plans, simulate_trips((car, plan) for plan in plans), strict=True):
        assert_same(simulate_trip(car, plan), run)


def test_a_sweep_is_the_grid_of_its_values():
    values = {"c_rr": [0.008, 0.012], "climate.setpoint_degc": [18.0, 22.0, 26.0]}
    car = tw.load_vehicle(
        "vw_id3", "default", {"road_load": "coefficients", "c_d": 0.27, "area": 2.4, "c_rr": 0.01}
    )
    plan = DRIVES[5]
    table = tw.sweep(plan, car, values, tw.Departure(soc=0.7))
    assert list(table.columns[:4]) == ["trip", "car", *values]
    assert table.attrs["units"]["climate.setpoint_degc"] == "degC"
    for row, (rolling, setpoint) in enumerate(itertools.product(*values.values())):
        own = car.with_values(
            {"road_load.rolling_resistance_coefficient": rolling, "climate.setpoint_degc": setpoint}
        )
        alone = tw.simulate(plan, own, tw.Departure(soc=0.7))
        assert table["energy_wh"][row] == pytest.approx(alone.simulated_energy_wh, rel=1e-9)


def test_a_sweep_forecasts_along_departures():
    model, plans, degrees = tw.load_model(), DRIVES[5:7], [-10.0, 20.0]
    values = {"ambient_temperature_degc": degrees, "season": ["winter"]}
    table = tw.sweep(plans, model.vehicle, values, tw.Departure(soc=0.7), model=model)
    assert list(table.columns[:4]) == ["trip", "car", *values]
    assert table.attrs["units"]["ambient_temperature_degc"] == "degC"
    for row, (plan, degc) in enumerate(itertools.product(plans, degrees)):
        departure = tw.Departure(soc=0.7, ambient_temperature_degc=degc, season="winter")
        alone = model.forecast(plan, departure)
        wanted = {
            "energy_wh": alone.energy_wh,
            "p_arrive": alone.p_arrive(),
            "displayed_soc": alone.soc_arrival,
        }
        wanted |= dict(zip(("energy_low_wh", "energy_high_wh"), alone.interval(0.9), strict=True))
        assert {name: table[name][row] for name in wanted} == wanted
    links = [{"length_m": 5000.0, "speed_m_s": 20.0}]
    assert np.diff(tw.sweep(links, I3, values)["energy_wh"]).item() < 0.0


def test_all_faults_of_a_sweep_come_at_once():
    with pytest.raises(InvalidInput) as error:
        tw.sweep(DRIVES[5], I3, {"body.mas": [1.0], "battery.heat_loss_w_k": [5.0, -1.0]})
    assert sorted(fault.what for fault in error.value.faults) == ["unknown key", "value out of range"]


@pytest.mark.parametrize("model", [None, "bmw_i3_tum"])
def test_a_sweep_of_no_drives_is_refused(model):
    with pytest.raises(InvalidInput, match="no drives: trip"):
        tw.sweep(iter([]), I3, {"payload_mass_kg": [0.0, 300.0]}, model=model)


def test_faults_of_many_drives_have_their_names():
    wrong = [plan.with_departure(tw.Departure(payload_mass_kg=59_000.0)) for plan in DRIVES[:2]]
    light = I3.with_values({"body.curb_mass_kg": 1000.0})
    bad = Plan("far", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1000.0]}))
    with pytest.raises(InvalidInput) as error:
        simulate_trips((light, plan) for plan in [*wrong, bad, bad])
    assert {fault.where for fault in error.value.faults} == {"far, speed_m_s"}


def test_rows_of_a_table_are_each_trip_with_each_car():
    trips = synthetic_fleet(3).trips
    table = tw.sweep(trips, ["vw_id3", I3], departure=tw.Departure(soc=0.6))
    assert list(zip(table["trip"], table["car"], strict=True)) == list(
        itertools.product([trip.trip_id for trip in trips], ["vw_id3", "bmw_i3_60ah"])
    )
    assert set(table.attrs["units"]) == set(table.columns) - {"trip", "car", "flags"}


@pytest.mark.parametrize("car", CARS, ids=lambda car: f"{car.name} {car.preset}")
def test_the_energy_on_grades_is_that_of_simulations(car, monkeypatch):
    """Also where a cold or full battery limits regeneration; elsewhere its state is not computed."""
    in_full = []

    def counted(car, trace, wheel_power, *others):
        in_full.extend(wheel_power if wheel_power.ndim > 1 else ())
        return with_battery(car, trace, wheel_power, *others)

    with_battery = chain._drive_and_battery
    monkeypatch.setattr(chain, "_drive_and_battery", counted)
    long = drive(0, CHUNK_SAMPLES // 2 - 1, ambient_temperature_degc=5.0, soc=0.6)
    plans = [plan for plan in DRIVES if "elevation_m" not in plan]
    seconds = np.arange(1200.0)
    trace = pd.DataFrame({"time_s": seconds, "speed_m_s": np.minimum(0.2 * seconds, 12.0)})
    gentle = Plan.from_trace("gentle", trace, tw.Departure(ambient_temperature_degc=20.0, soc=0.98))
    for plan in (*plans, long, gentle):
        up_and_down = np.where(np.arange(len(plan.samples)) // 50 % 2, -0.06, 0.07)
        grades = [-0.1, -0.03, 0.0, 0.05, up_and_down]
        found = energies_on_grades(car, plan, simulate_trip(car, plan), grades)
        for grade, energy_wh in zip(grades, found, strict=True):
            road = replace(plan, samples=plan.samples.assign(grade=grade))
            np.testing.assert_allclose(energy_wh, simulate_trip(car, road).energy_wh, rtol=1e-12, atol=1e-9)
    assert 0.1 < len(in_full) / (5 * len(plans) + 10) < 0.7
