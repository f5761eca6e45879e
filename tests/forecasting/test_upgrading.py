"""Models of older versions forecast as they did, and are written in the format of today."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from tripwatt.hybrid.car_corrector import HierarchicalCorrector

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import load_metadata, load_model
from tripwatt.forecasting.storage import model_of_parts, upgrade_model
from tripwatt.modelfile import read_model
from tripwatt.vehicles import load_vehicle


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah", overrides={"mass": 1300.0})


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
