"""A stored forecaster forecasts to the last bit as before, whatever happens to the library of cars."""

import dataclasses
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support.cars import some_cars

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel, load_metadata, load_model, save_model
from tripwatt.forecasting.storage import model_folder, model_of_parts, upgrade_model
from tripwatt.forecasting.training import data_digest, train_model
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.car_corrector import HierarchicalCorrector
from tripwatt.modelfile import read_model
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Flag, Fleet
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_document, vehicle_from_document


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    return synthetic_fleet(12, seed=5)


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah", overrides={"mass": 1300.0})


@pytest.fixture(scope="module")
def table(fleet, car):
    return segment_trips(fleet.trips[:8], car)


@pytest.mark.parametrize("corrector", ["linear", "gp", "boosting", "forest", "ensemble", "split"])
def test_round_trip_is_identical(corrector: str, fleet, car, table, tmp_path: Path) -> None:
    model = ForecastModel(car, corrector, seed=3).fit_segments(table)
    save_model(model, tmp_path / "model")
    again = load_model(tmp_path / "model")
    assert again.vehicle == model.vehicle
    for trip in (fleet.trips[8], fleet.trips[11]):
        bare = dataclasses.replace(trip, samples=trip.samples[["time_s", "speed_m_s"]])
        for drive in (trip, bare):
            before, after = model.forecast(drive), again.forecast(drive)
            assert before.to_dict() == after.to_dict()
            seen = trip.samples[trip.samples["time_s"] < 400.0]
            assert before.update(seen).to_dict() == after.update(seen).to_dict()
    save_model(again, tmp_path / "again")
    for name, part in read_model(tmp_path / "model").metadata["parts"].items():
        assert load_metadata(tmp_path / "again")["parts"][name] == part


def test_flags_of_a_model_come_back(car, table, tmp_path: Path) -> None:
    flags = (
        Flag("soc_assumed", "soc", 0.8, "1"),
        Flag("route_error_unknown", "links"),
        Flag("x", "y", "text"),
    )
    model = ForecastModel(car, "linear").fit_segments(table)
    save_model(dataclasses.replace(model, flags=flags), tmp_path / "model")
    assert load_model(tmp_path / "model").flags == flags


def test_what_cannot_be_stored_is_refused(car, table, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="not fitted"):
        save_model(ForecastModel(car), tmp_path / "model")
    model = ForecastModel(car, "linear").fit_segments(table)
    model.corrector_ = object()  # type: ignore[assignment]
    with pytest.raises(InvalidInput, match="cannot be stored"):
        save_model(model, tmp_path / "model")
    assert not list(tmp_path.iterdir())


def again(car: Vehicle) -> Vehicle:
    document = json.loads(json.dumps(vehicle_document(car)))
    return dataclasses.replace(vehicle_from_document(document, car.name, "test"), preset=car.preset)


@pytest.mark.parametrize("name", some_cars(20))
def test_every_car_comes_back(name: str) -> None:
    for preset in ("default", "paper"):
        car = load_vehicle(name, preset)
        assert again(car) == car
        assert again(car).entries == car.entries


def test_a_car_changed_after_loading_comes_back_as_changed(car) -> None:
    changed = dataclasses.replace(
        car,
        auxiliaries=dataclasses.replace(car.auxiliaries, base_load_w=411.0),
        battery=dataclasses.replace(car.battery, capacity_ah=55.5),
        climate=None,
    )
    assert again(changed) == changed
    assert again(changed).entries["auxiliaries.base_load_w"].source == "set after the car was loaded"
    assert again(changed).entries["auxiliaries.base_load_w"].licence == "user"
    assert again(changed).entries["body.driver_mass_kg"] == car.entries["body.driver_mass_kg"]
    bolt = load_vehicle("chevrolet_bolt")  # its capacity is on the displayed scale
    lighter = dataclasses.replace(bolt, body=dataclasses.replace(bolt.body, curb_mass_kg=1500.0))
    assert again(lighter) == lighter
    wider = dataclasses.replace(bolt, battery=dataclasses.replace(bolt.battery, displayed_full_soc=0.98))
    assert again(wider) == wider


OLD = Path(__file__).parents[1] / "fixtures" / "model_0_2_0"
"""Models that tripwatt 0.2.0 wrote, of every kind of corrector, and what it forecast with them."""


def forecasts(folder: Path) -> dict:
    model = load_model(folder)
    links = [
        {"length_m": 9000.0, "speed_m_s": 15.0, "grade": 0.01},
        {"length_m": 6000.0, "speed_m_s": 25.0},
    ]
    seen = {"time_s": [0.0, 100.0, 200.0, 300.0], "observed_energy_wh": [0.0, 200.0, 420.0, 610.0]}
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=4.0)
    before = model.forecast(tw.read_route(links), departure)
    after = before.update_since_departure(pd.DataFrame(seen).assign(speed_m_s=15.0))
    documents = {"before": before.to_dict(0.1, 0.95), "on_the_way": after.to_dict()}
    return json.loads(json.dumps(documents))


def numbers(document: object, place: str = "") -> dict[str, object]:
    if isinstance(document, dict | list):
        inner = document.items() if isinstance(document, dict) else enumerate(document)
        return {k: v for key, value in inner for k, v in numbers(value, f"{place}.{key}").items()}
    return {place: document}


@pytest.mark.parametrize("name", ["split", "adapted"])
def test_a_model_of_0_2_0_forecasts_as_it_did_and_is_upgraded(name: str, tmp_path: Path) -> None:
    place = tmp_path / "model"
    shutil.copytree(OLD / name, place)
    then, before = json.loads((OLD / f"{name}.json").read_text()), forecasts(place)
    for moment, document in then.items():
        found = numbers(before[moment])
        for key, value in numbers(document).items():
            assert found[key] == (pytest.approx(value, rel=1e-9) if isinstance(value, float) else value), key
    about = load_metadata(place)
    assert (about["format_version"], upgrade_model(place), upgrade_model(place)) == (1, True, False)
    upgraded = load_metadata(place)
    assert upgraded["format_version"] == 2
    assert sorted(f.name for f in place.iterdir()) == ["metadata.json", "model.json", "model.npz"]
    for kept in ("provenance", "evaluation", "model"):
        assert upgraded[kept] == about[kept]
    assert forecasts(place) == before
    old_names = (
        "block_s",
        "apart",
        "whole",
        "gain",
        "route_doubt",
        "elsewhere",
        "kriging",
        "channels",
        "familiar",
    )
    text = (place / "model.json").read_text()
    assert [name for name in old_names if f'"{name}"' in text] == []


def test_a_model_of_0_1_lacks_parts_and_forecasts(tmp_path: Path) -> None:
    """Its entries have no licence, its errors of power no course, and its process keeps the ranges of its columns."""
    stored = read_model(OLD / "split")
    parts = {name: dict(part) for name, part in stored.parts.items()}
    values = json.loads(json.dumps(parts["model.json"]))
    for key in ("course", "least_share", "charge", "free_flow", "route_doubt", "elsewhere"):
        values.pop(key)
    values["gain"].pop("off")
    values["fitted"]["climate"].pop("familiar")
    values["corrector"] = "channels"
    car = json.loads(json.dumps(parts["vehicle.json"]))
    car.pop("anchor")
    for section in car["document"].values():
        for entry in section.values():
            entry.pop("licence")
    model = model_of_parts({**parts, "model.json": values, "vehicle.json": car}, version=1)
    assert model.corrector == "split"
    assert {entry.licence for entry in model.vehicle.entries.values()} == {"not-stated"}
    assert model.uncertainty_ is not None
    assert model.uncertainty_.route is None
    assert model.uncertainty_.scale.course.hours(2.0) == 2.0
    newer = load_model(OLD / "split")
    plan = tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0, "grade": 0.0}])
    assert model.forecast(plan).energy_wh == pytest.approx(newer.forecast(plan).energy_wh, rel=1e-12)


def test_a_car_of_0_1_has_one_share_of_the_correction_for_all_stages() -> None:
    parts = {name: dict(part) for name, part in read_model(OLD / "adapted").parts.items()}
    values = json.loads(json.dumps(parts["model.json"]))
    del values["fitted"]["shares"]
    values["fitted"]["share"] = 0.3
    corrector = model_of_parts({**parts, "model.json": values}, version=1).corrector_
    assert isinstance(corrector, HierarchicalCorrector)
    assert corrector.shares == (0.3, 0.3)


def test_a_model_of_an_older_format_that_is_damaged_is_refused(tmp_path: Path) -> None:
    parts = {name: dict(part) for name, part in read_model(OLD / "split").parts.items()}
    del parts["model.json"]["gain"]
    with pytest.raises(InvalidInput, match="KeyError: 'gain'"):
        model_of_parts(parts, version=1)


def test_a_model_with_other_blocks_says_why_it_is_refused(
    car, table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tripwatt.forecasting.storage.SEGMENT_S", 10.0)
    save_model(ForecastModel(car, "linear").fit_segments(table), tmp_path / "model")
    monkeypatch.undo()
    with pytest.raises(InvalidInput, match="segment_s"):
        load_model(tmp_path / "model")


def test_a_model_says_where_it_comes_from(fleet, car, tmp_path: Path) -> None:
    model, provenance, figures = train_model(fleet, car, corrector="linear", seed=2)
    save_model(model, tmp_path / "model", provenance=provenance, evaluation=figures)
    about = load_metadata(tmp_path / "model")
    assert about["provenance"]["trips_used"] == list(model.trip_ids_)
    assert about["provenance"]["data"]["sha256"] == data_digest(fleet.trips)
    assert about["provenance"]["seed"] == 2
    ambient = next(e for e in about["contract"]["inputs"] if e["name"] == "ambient_temperature_degc")
    assert ambient["unit"] == "°C"
    first = [t.array("ambient_temperature_degc")[0] for t in fleet.trips]
    assert ambient["training"] == [min(first), max(first)]
    rows = figures["by_trip"]
    errors = [abs(r["predicted_wh"] / r["observed_wh"] - 1.0) for r in rows]
    assert figures["mape"] == pytest.approx(np.mean(errors))
    by_id = {t.trip_id: t.observed_energy_wh for t in fleet.trips}
    assert all(r["observed_wh"] == pytest.approx(by_id[r["trip"]], rel=0.02) for r in rows)
    # each row was forecast without its trip: the model that has seen it errs less
    table = segment_trips(fleet.trips, model.vehicle)
    assert model.corrector_ is not None
    fitted = table.totals_wh(table.simulated_w + model.corrector_.predict(table))
    seen = np.mean(np.abs(fitted / table.totals_wh(table.observed_power_w) - 1.0))
    assert seen < figures["mape"]


def test_digest_knows_every_value_but_no_order(fleet) -> None:
    trips = fleet.trips[:3]
    assert data_digest(trips) == data_digest(trips[::-1])
    samples = trips[0].samples.copy()
    samples.loc[5, "speed_m_s"] += 1e-12
    other = dataclasses.replace(trips[0], samples=samples)
    assert data_digest([other, *trips[1:]]) != data_digest(trips)


def test_model_of_the_package_is_small_sound_and_attributed() -> None:
    about = load_metadata()
    assert sum(f.stat().st_size for f in model_folder().iterdir()) < 1_000_000
    assert "CC BY 4.0" in about["provenance"]["data"]["citation"]
    assert about["evaluation"]["trips"] == about["model"]["trips"] == len(about["provenance"]["trips_used"])
    forecast = load_model().forecast(synthetic_fleet(1).trips[0])
    low, high = forecast.interval(0.9)
    assert 0.0 < low < forecast.energy_wh < high


def test_car_of_the_package_model_is_the_library_s() -> None:
    """When this fails the library's car has changed: make the model anew with tools/data/fit_default_model.py."""
    car, own = load_model().vehicle, load_vehicle("bmw_i3_60ah")
    identified = load_metadata()["provenance"]["identified"]
    assert {key.partition(".")[0] for key in identified} == {
        "road_load",
        "tyres",
        "regeneration",
        "auxiliaries",
        "climate",
        "battery",
    }
    for key, entry in car.entries.items():
        if key in identified:
            assert entry.source.startswith("identified on "), key
            published = own.entries[key].source if key in own.entries else "published 0: no source"
            assert published in entry.source, key
        else:
            assert entry == own.entries[key], key


def test_forecasting_imports_no_learner() -> None:
    code = (
        "import sys; from tripwatt.forecasting import load_model; from tripwatt.trips import plan_from_samples; import pandas as pd;"
        "t = pd.DataFrame({'time_s': [0.0, 50.0, 100.0], 'speed_m_s': [0.0, 9.0, 9.0]});"
        "load_model().forecast(plan_from_samples(t)).to_dict();"
        "print([m for m in ('sklearn', 'lightgbm', 'matplotlib', 'joblib', 'scipy') if m in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
