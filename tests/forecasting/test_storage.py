"""A stored forecaster forecasts to the last bit as before, whatever happens to the library of cars."""

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.support.refusals import refusal, refuses

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel, load_metadata, load_model, save_model, storage
from tripwatt.forecasting.storage import model_folder
from tripwatt.hybrid import segment_trips
from tripwatt.modelfile import read_model, write_model
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Flag, TripSet
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_document, vehicle_from_document


@pytest.fixture(scope="module")
def fleet() -> TripSet:
    return synthetic_fleet(12, seed=5)


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah", overrides={"mass": 1300.0})


@pytest.fixture(scope="module")
def table(fleet, car):
    return segment_trips(fleet.trips[:8], car)


@pytest.mark.parametrize("corrector", ["linear", "forest", "split"])  # split has the parts of the others
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
    refuses("not fitted", save_model, ForecastModel(car), tmp_path / "model")
    model = ForecastModel(car, "linear").fit_segments(table)
    model.corrector_ = object()  # type: ignore[assignment]
    refuses("cannot be stored", save_model, model, tmp_path / "model")
    assert not list(tmp_path.iterdir())


def again(car: Vehicle) -> Vehicle:
    document = json.loads(json.dumps(vehicle_document(car)))
    return dataclasses.replace(vehicle_from_document(document, car.name, "test"), preset=car.preset)


def test_a_model_with_other_blocks_says_why_it_is_refused(
    car, table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tripwatt.forecasting.storage.SEGMENT_S", 10.0)
    save_model(ForecastModel(car, "linear").fit_segments(table), tmp_path / "model")
    monkeypatch.undo()
    assert refusal(load_model, tmp_path / "model") == (
        "model of an older version: model.json, segment_s: got segments of 10.0 s; allowed: segments of 30 s; "
        "fit the model again with this version of tripwatt"
    )


def test_a_model_of_an_older_format_is_refused_and_stays(tmp_path: Path) -> None:
    stored = read_model(model_folder())
    write_model(tmp_path / "older", {**stored.metadata, "format_version": 1}, stored.parts)
    content = {file.name: file.read_bytes() for file in (tmp_path / "older").iterdir()}
    for read in (load_model, load_metadata):
        with pytest.raises(InvalidInput, match=r"older format: .*got 1; allowed: 3; fit it again") as caught:
            read(tmp_path / "older")
        assert len(caught.value.faults) == 1
    assert {file.name: file.read_bytes() for file in (tmp_path / "older").iterdir()} == content


def test_model_of_the_package_is_small_sound_and_attributed() -> None:
    about = load_metadata()
    assert sum(f.stat().st_size for f in model_folder().iterdir()) < 500_000
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
        "import sys; from tripwatt.forecasting import load_model; from tripwatt.trips import Plan; import pandas as pd;"
        "t = pd.DataFrame({'time_s': [0.0, 50.0, 100.0], 'speed_m_s': [0.0, 9.0, 9.0]});"
        "load_model().forecast(Plan.from_samples(t)).to_dict();"
        "print([m for m in ('sklearn', 'lightgbm', 'matplotlib', 'joblib', 'scipy') if m in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("document", "sound"),
    [
        ({"quantiles_wh": {"0.1": 1.0, "0.9": 2.0}, "soc": None}, True),
        ({"quantiles_wh": {"0.1": 2.0, "0.9": 1.0}, "soc": None}, False),
        ({"quantiles_wh": {"0.1": 1.0, "0.9": 2.0}, "soc": math.nan}, False),
        ({"quantiles_wh": {"0.1": 1.0, "0.9": 2.0}, "series": {"soc": [0.5, math.inf]}}, False),
    ],
)
def test_a_model_from_outside_forecasts_finite_numbers_in_their_order(monkeypatch, document, sound):
    monkeypatch.setattr(Forecast, "to_dict", lambda self: document)
    if sound:
        storage.require_usable(load_model(), "model")
        return
    with pytest.raises(InvalidInput) as caught:
        storage.require_usable(load_model(), "model")
    (fault,) = caught.value.faults
    assert fault.where == "model"
    assert fault.got == "quantiles that cross" or "float values are not JSON" in fault.got


def test_a_model_from_outside_is_tried_in_cold_and_heat():
    tried, model = [], load_model()

    def forecast(plan):
        tried.append((plan.departure.ambient_temperature_degc, plan.link_m))
        return model.forecast(plan)

    storage.require_usable(SimpleNamespace(forecast=forecast), "model")
    assert tried == [(None, None), (None, 250.0), (-15.0, None), (40.0, None)]


@pytest.mark.parametrize("parts", [{}, {"model.json": b"{}"}, {"model.json": 3}])
def test_parts_that_are_no_model_are_refused_in_one_sentence(parts):
    refuses(r"^parts do not make a forecast model: model: got no '", storage.model_of_parts, parts)
