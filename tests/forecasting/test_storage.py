"""A stored forecaster forecasts to the last bit as before, whatever happens to the library of cars."""

import dataclasses
import json
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from tests.support.cars import some_cars

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel, load_metadata, load_model, save_model
from tripwatt.forecasting.storage import model_folder, vehicle_of_part, vehicle_part
from tripwatt.forecasting.training import data_digest, train_model
from tripwatt.hybrid import segment_trips
from tripwatt.modelfile import read_model
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Fleet
from tripwatt.vehicles import load_vehicle


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


def test_what_cannot_be_stored_is_refused(car, table, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="not fitted"):
        save_model(ForecastModel(car), tmp_path / "model")
    model = ForecastModel(car, "linear").fit_segments(table)
    model.corrector_ = object()  # type: ignore[assignment]
    with pytest.raises(InvalidInput, match="cannot be stored"):
        save_model(model, tmp_path / "model")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", some_cars(20))
def test_every_car_comes_back(name: str) -> None:
    for preset in ("default", "paper"):
        car = load_vehicle(name, preset)
        part = json.loads(json.dumps(vehicle_part(car)))
        assert vehicle_of_part(part) == car
        assert vehicle_of_part(part).entries == car.entries


def test_a_car_changed_after_loading_comes_back_as_changed(car) -> None:
    changed = dataclasses.replace(
        car,
        auxiliaries=dataclasses.replace(car.auxiliaries, base_load_w=411.0),
        battery=dataclasses.replace(car.battery, capacity_ah=55.5),
        climate=None,
    )
    again = vehicle_of_part(json.loads(json.dumps(vehicle_part(changed))))
    assert again == changed
    assert "changed" not in again.entries["auxiliaries.base_load_w"].source
    assert again.entries["auxiliaries.base_load_w"].source == "set after the car was loaded"
    assert again.entries["auxiliaries.base_load_w"].licence == "user"
    bolt = load_vehicle("chevrolet_bolt")  # its capacity is on the displayed scale
    lighter = dataclasses.replace(bolt, body=dataclasses.replace(bolt.body, curb_mass_kg=1500.0))
    assert vehicle_of_part(vehicle_part(lighter)) == lighter


def test_a_car_stored_before_licences_were_recorded_loads(car) -> None:
    text = (resources.files("tripwatt") / "models/bmw_i3_tum/vehicle.json").read_text("utf-8")
    stored = json.loads(
        re.sub(r'"licence": "[^"]*",?', "", re.sub(r',\s*"licence": "[^"]*"(?=\s*\})', "", text))
    )
    assert "licence" not in json.dumps(stored)
    assert {entry.licence for entry in vehicle_of_part(stored).entries.values()} == {"not-stated"}
    again = vehicle_of_part(json.loads(json.dumps(vehicle_part(car))))
    assert again.entries["battery.displayed_full_soc"].licence == "CC-BY-4.0"


def test_a_model_with_other_blocks_says_why_it_is_refused(
    car, table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tripwatt.forecasting.storage.SEGMENT_S", 10.0)
    save_model(ForecastModel(car, "linear").fit_segments(table), tmp_path / "model")
    monkeypatch.undo()
    with pytest.raises(InvalidInput, match="block_s"):
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
