"""A model for a car, and its flags at every entrance: library, command line, HTTP, journey, on the road, own car."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from tests.support.command import answered

import tripwatt as tw
from tripwatt.forecasting import load_model, save_model
from tripwatt.forecasting.leaving import leaving_with
from tripwatt.population import adaptation, for_car
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.telemetry import Sample
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.settings import Limits
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan
from tripwatt.trips.messages import message
from tripwatt.units import GRAVITY_M_S2
from tripwatt.vehicles import render_vehicle
from tripwatt.vehicles.parts import Charging

MODEL = tw.load_model()
HEAVY_KG = 2500.0
I3 = tw.load_vehicle("bmw_i3_60ah")
HEAVY = tw.load_vehicle("bmw_i3_60ah", overrides={"mass": HEAVY_KG})
MORE_KG = HEAVY.body.test_mass_kg - I3.body.test_mass_kg
DEPARTURE = tw.Departure(soc=0.9, ambient_temperature_degc=20.0)
UPHILL = [{"length_m": 5000.0, "speed_m_s": 15.0, "grade": 0.05}]
FLAT = [{"length_m": 5000.0, "speed_m_s": 15.0, "grade": 0.0}]
LINKS = [{"length_m": 5000.0, "speed_m_s": 15.0, "grade": 0.0}]
OTHER = "vw_id3"
FIRST = "no_trips_of_car"


def codes(flags: Any) -> list[str]:
    return [flag["code"] if isinstance(flag, dict) else flag.code for flag in flags]


@pytest.fixture(scope="module")
def other() -> tw.ForecastModel:
    return for_car(None, OTHER)


@pytest.fixture
def own_car(tmp_path: Path) -> Any:
    pytest.importorskip("deltalake", reason="a car's trips are kept with deltalake")
    return tw.create_car(tmp_path / "mine", OTHER)


@pytest.fixture
def links(tmp_path: Path) -> Path:
    file = tmp_path / "links.json"
    file.write_text(json.dumps(LINKS))
    return file


def test_the_packaged_model_has_no_flags() -> None:
    assert for_car().flags == tw.load_model().flags == ()


def test_a_model_is_named_by_its_folder_as_well(other: tw.ForecastModel, tmp_path: Path) -> None:
    save_model(tw.load_model(), tmp_path / "model")
    plan = tw.read_route(LINKS)
    made = for_car(tmp_path / "model", OTHER)
    assert made.flags == other.flags
    assert made.forecast(plan).energy_wh == other.forecast(plan).energy_wh


def test_flags_of_the_model_come_first_and_stay(other: tw.ForecastModel) -> None:
    samples = synthetic_fleet(1).trips[0]
    for plan in (samples, tw.read_route(LINKS)):
        made = other.forecast(plan)
        assert codes(made.flags)[0] == FIRST
        assert codes(leaving_with(made, 0.5).flags).count(FIRST) == 1
    so_far = samples.samples.iloc[:60]
    assert codes(other.forecast(samples).update(so_far).flags).count(FIRST) == 1


def test_a_stored_model_keeps_its_flags(other: tw.ForecastModel, tmp_path: Path) -> None:
    changed = for_car(None, tw.load_vehicle("bmw_i3_60ah", overrides={"mass": 2500.0}))
    for model in (other, changed):
        save_model(model, tmp_path / "model")
        assert load_model(tmp_path / "model").flags == model.flags != ()


def test_own_trips_take_the_flags_away(other: tw.ForecastModel) -> None:
    trips = synthetic_fleet(9, vehicle=tw.load_vehicle(OTHER)).trips
    assert adaptation(tw.load_model(), trips[:2], tw.load_vehicle(OTHER)).model.flags == ()
    fitted = replace(other, corrector="linear", vehicle=tw.load_vehicle(OTHER)).fit(trips)
    assert fitted.flags == ()


def test_the_library_flags_another_car() -> None:
    assert codes(tw.forecast(LINKS, car=OTHER).flags)[0] == FIRST


def test_a_car_on_the_road_flags_that_it_has_no_trips(other: tw.ForecastModel, tmp_path: Path) -> None:
    with Car.follow(tmp_path / "live", lambda _: other) as car:
        car.record(Sample(1.7e9, {"speed_m_s": 0.0, "displayed_soc": 0.8}))
        car.set_plan({"links": LINKS})
        made = car.at_departure()
    assert made is not None
    assert codes(made.flags)[0] == FIRST


def test_an_own_car_flags_that_it_has_no_trips_yet(own_car: Any, links: Path) -> None:
    assert codes(own_car.model().flags) == [FIRST]
    jobs = Jobs({"i3": tw.load_model()}, Limits(), cars=CarJobs(own_car.folder.parent))
    document = jobs.run("forecast", json.dumps({"links": LINKS, "car": "mine"}).encode())
    assert codes(document["flags"])[0] == FIRST
    printed = answered("forecast", own_car.folder, links, "--json")
    assert codes(json.loads(printed.out)["flags"])[0] == FIRST


def car_file(folder: Path, name: str = "bmw_i3_60ah", mass_kg: float | None = None) -> Path:
    file = folder / f"{name}.toml"
    text = render_vehicle(I3)
    if mass_kg is not None:
        known = f"curb_mass_kg = {{ value = {I3.body.curb_mass_kg}"
        assert known in text
        text = text.replace(known, f"curb_mass_kg = {{ value = {mass_kg}")
    file.write_text(text, encoding="utf-8")
    return file


def test_more_mass_takes_at_least_its_potential_energy_uphill() -> None:
    lift_wh = MORE_KG * GRAVITY_M_S2 * 250.0 / 3600.0
    heavy, own = (tw.forecast(UPHILL, DEPARTURE, car=car) for car in (HEAVY, None))
    more = [f.to_dict()["by_cause_wh"]["climb"] for f in (heavy, own)]
    assert more[0] - more[1] == pytest.approx(lift_wh, rel=0.01)
    assert heavy.energy_wh - own.energy_wh > lift_wh


def test_more_mass_takes_its_kinetic_energy_on_acceleration() -> None:
    time = np.arange(31.0)
    drive = pd.DataFrame({"time_s": time, "speed_m_s": np.minimum(time, 20.0), "elevation_m": 500.0})
    plan = Plan.from_samples(drive, "start")
    found = [tw.forecast(plan, DEPARTURE, car=car).to_dict()["by_cause_wh"] for car in (HEAVY, I3)]
    kinetic_wh = 0.5 * MORE_KG * I3.body.rotating_mass_factor * 20.0**2 / 3600.0
    assert found[0]["acceleration"] - found[1]["acceleration"] == pytest.approx(kinetic_wh, rel=1e-3)


def test_an_unchanged_copy_is_the_model_s_own_car(tmp_path: Path) -> None:
    for name in ("bmw_i3_60ah", "my_car"):
        copy = tw.load_vehicle(car_file(tmp_path, name))
        assert for_car(MODEL, copy) is MODEL
    assert for_car(MODEL, "bmw_i3_60ah") is for_car(MODEL, MODEL.vehicle) is for_car(MODEL) is MODEL


def test_a_copy_with_one_changed_value_is_noticed(tmp_path: Path) -> None:
    changed = tw.load_vehicle(car_file(tmp_path, mass_kg=HEAVY_KG))
    model = for_car(MODEL, changed)
    assert [(f.code, f.subject, f.value, f.unit) for f in model.flags] == [
        ("changed_car", "body.curb_mass_kg", f"{I3.body.curb_mass_kg:g} -> 2500", "kg")
    ]
    assert message(model.flags[0]).startswith(
        f"body.curb_mass_kg is 2500 kg in place of {I3.body.curb_mass_kg:g} kg"
    )
    # what the trips identified stays where nothing was changed
    assert replace(model.vehicle.body, curb_mass_kg=I3.body.curb_mass_kg) == MODEL.vehicle.body
    assert model.vehicle.road_load == MODEL.vehicle.road_load


def test_the_interval_of_a_changed_car_is_wider_and_its_mean_close_to_the_own_car_s() -> None:
    nearly = tw.load_vehicle("bmw_i3_60ah", overrides={"mass": I3.body.curb_mass_kg + 1.0})
    found, own = (tw.forecast(FLAT, DEPARTURE, car=car) for car in (nearly, None))
    assert found.energy_wh == pytest.approx(
        own.energy_wh, rel=0.07
    )  # the correction of its trips counts less
    assert found.sd_wh > own.sd_wh


def test_every_value_is_named_up_to_five_and_the_others_are_counted() -> None:
    other = tw.load_vehicle("vw_id3")
    renamed = replace(other, name="bmw_i3_60ah")
    flags = for_car(MODEL, renamed).flags
    assert [f.code for f in flags] == ["changed_car"] * 6
    assert message(flags[-1]).startswith(f"{flags[-1].value:.0f} more values")
    assert [f.code for f in for_car(MODEL, other).flags] == ["no_trips_of_car"]


def test_another_charging_power_is_taken_without_another_model() -> None:
    slow = replace(I3, charging=Charging((0.0, 1.0), (5e4, 1e4), 2300.0))
    model = for_car(MODEL, slow)
    assert (model.flags, model.corrector_ is MODEL.corrector_) == ((), True)
    assert model.vehicle.charging == slow.charging


def test_a_stored_model_keeps_what_its_values_were_before_the_trips(tmp_path: Path) -> None:
    mine = replace(MODEL.vehicle, name="no_car_of_the_library")
    entry = mine.entries["auxiliaries.base_load_w"]
    kept = replace(mine, entries={**mine.entries, "auxiliaries.base_load_w": replace(entry, published=300.0)})
    save_model(replace(MODEL, vehicle=kept), tmp_path / "model")
    model = load_model(tmp_path / "model")
    assert model.vehicle.entries["auxiliaries.base_load_w"].published == 300.0
    for base_load_w, is_own in ((300.0, True), (301.0, False)):
        car = replace(mine, auxiliaries=replace(mine.auxiliaries, base_load_w=base_load_w))
        assert (for_car(model, car).flags == ()) == is_own


def test_the_service_compares_the_library_s_car_with_that_of_its_model() -> None:
    """The model is of a changed car that kept the name: the car of the library is then another one."""
    jobs = Jobs({"heavy": replace(MODEL, vehicle=replace(MODEL.vehicle, body=HEAVY.body))}, Limits())

    def forecast(**more: str) -> dict[str, object]:
        return jobs.run("forecast", json.dumps({"links": UPHILL, "soc": 0.9, **more}).encode())

    own, library = forecast(), forecast(car="bmw_i3_60ah")
    assert own["energy_wh"] > library["energy_wh"] + MORE_KG * GRAVITY_M_S2 * 250.0 / 3600.0  # type: ignore[operator]
    assert library["flags"][0]["code"] == "changed_car"  # type: ignore[index]


def test_an_own_car_from_a_changed_file_starts_with_its_values(tmp_path: Path) -> None:
    pytest.importorskip("deltalake", reason="a car's trips are kept with deltalake")
    car = tw.create_car(tmp_path / "mine", car_file(tmp_path, mass_kg=HEAVY_KG))
    assert car.model().vehicle.body.curb_mass_kg == HEAVY_KG
    assert car.model().forecast(tw.read_route(UPHILL), DEPARTURE).energy_wh == pytest.approx(
        tw.forecast(UPHILL, DEPARTURE, car=HEAVY).energy_wh
    )
