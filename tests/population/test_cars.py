"""A model for a car, and its flags at every entrance: library, command line, HTTP, journey, on the road, own car."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.command import answered

import tripwatt as tw
from tripwatt.forecasting import load_model, save_model
from tripwatt.journey.forecasting import RoadForecaster
from tripwatt.live import RoadCar, Sample
from tripwatt.population import adaptation, for_car
from tripwatt.service.car_jobs import CarJobs
from tripwatt.service.jobs import Jobs
from tripwatt.service.settings import Limits
from tripwatt.synthetic import synthetic_fleet

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
        assert codes(made.leaving_with(0.5).flags).count(FIRST) == 1
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
    assert codes(tw.forecast(LINKS, vehicle=OTHER).flags)[0] == FIRST


def test_the_command_line_flags_another_car(links: Path) -> None:
    document = answered("forecast", links, "--vehicle", OTHER, "--json")
    assert codes(json.loads(document.out)["flags"])[0] == FIRST


def test_a_request_flags_another_car() -> None:
    document = Jobs({"i3": tw.load_model()}, Limits()).forecast(
        json.dumps({"links": LINKS, "vehicle": OTHER}).encode()
    )
    assert codes(document["flags"])[0] == FIRST


def test_a_journey_flags_another_car(other: tw.ForecastModel) -> None:
    plan = tw.read_route(LINKS)
    assert codes(RoadForecaster(other, tw.Departure(soc=0.8)).forecast_plan(plan).flags)[0] == FIRST


def test_a_car_on_the_road_flags_that_it_has_no_trips(other: tw.ForecastModel, tmp_path: Path) -> None:
    with RoadCar(tmp_path / "live", lambda _: other) as car:
        car.add(Sample(1.7e9, {"speed_m_s": 0.0, "displayed_soc": 0.8}))
        car.set_plan({"links": LINKS})
        made = car.at_departure()
    assert made is not None
    assert codes(made.flags)[0] == FIRST


def test_an_own_car_flags_that_it_has_no_trips_yet(own_car: Any, links: Path) -> None:
    assert codes(own_car.model().flags) == [FIRST]
    jobs = Jobs({"i3": tw.load_model()}, Limits(), cars=CarJobs(own_car.folder.parent))
    document = jobs.forecast(json.dumps({"links": LINKS, "model": "mine"}).encode())
    assert codes(document["flags"])[0] == FIRST
    printed = answered("forecast", own_car.folder, links, "--json")
    assert codes(json.loads(printed.out)["flags"])[0] == FIRST
