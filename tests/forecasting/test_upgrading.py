"""Fitted models of older versions forecast as they did, and are written in the format of today; adapted ones are refused."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import load_metadata, load_model
from tripwatt.forecasting.forecast import SOC_PRECISION
from tripwatt.forecasting.storage import model_of_parts, upgrade_model
from tripwatt.hybrid.split import SplitCorrector
from tripwatt.modelfile import read_model

OLD = Path(__file__).parents[1] / "fixtures" / "model_0_2_0"
"""Models that tripwatt 0.2.0 wrote: a fitted one and what it forecast, and one that was adapted to another car."""
OLD_MARGIN = 2e-6
"""0.2.0 searched the charge to leave with to 1e-6 and added twice that, to be on the side that suffices; the search of today ends within
twice `SOC_PRECISION` above the root."""


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


def test_a_model_of_0_2_0_forecasts_as_it_did_and_is_upgraded(tmp_path: Path) -> None:
    place = tmp_path / "model"
    shutil.copytree(OLD / "split", place)
    then, before = (
        json.loads(
            (OLD / "split.json")
            .read_text()
            .replace('"hvac"', '"climate"')
            .replace("learned_correction", "correction")
        ),
        forecasts(place),
    )
    for moment, document in then.items():
        found = numbers(before[moment])
        for key, value in numbers(document).items():
            if key.endswith(".soc_needed"):
                assert found[key] == pytest.approx(value - OLD_MARGIN, abs=2.0 * SOC_PRECISION), key
                continue
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
        "hvac_w",
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


def test_a_model_of_0_2_0_is_read_without_what_it_held_for_other_cars(tmp_path: Path) -> None:
    """It was a second corrector; the trips of a model of today say what they show of the car."""
    stored = read_model(OLD / "split")
    assert "elsewhere" in stored.parts["model.json"]
    of_others = [name for name in stored.parts if name.startswith("corrector-elsewhere")]
    assert len(of_others) == 2
    parts = {name: part for name, part in stored.parts.items() if name not in of_others}
    models = load_model(OLD / "split"), model_of_parts(parts, version=1)
    plan = tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0, "grade": 0.0}])
    first, second = (model.forecast(plan) for model in models)
    assert first.energy_wh == second.energy_wh
    assert first.sd_wh == second.sd_wh
    for model in models:
        assert isinstance(model.corrector_, SplitCorrector)
        assert model.evidence_ is None
    place = tmp_path / "model"
    shutil.copytree(OLD / "split", place)
    assert upgrade_model(place)
    assert '"elsewhere"' not in (place / "model.json").read_text()
    assert load_model(place).evidence_ is None


def test_a_model_of_0_2_0_of_an_adapted_car_is_refused_and_stays(tmp_path: Path) -> None:
    place = tmp_path / "model"
    shutil.copytree(OLD / "adapted", place)
    content = {file.name: file.read_bytes() for file in place.iterdir()}
    assert load_metadata(place)["format_version"] == 1
    for read in (load_model, upgrade_model):
        with pytest.raises(InvalidInput) as caught:
            read(place)
        (fault,) = caught.value.faults
        assert fault.what == "model of an older version"
        assert fault.fix == "adapt the base again with this version of tripwatt"
        assert "adapted to a car" in fault.got
    assert {file.name: file.read_bytes() for file in place.iterdir()} == content


def test_a_model_of_an_older_format_that_is_damaged_is_refused(tmp_path: Path) -> None:
    parts = {name: dict(part) for name, part in read_model(OLD / "split").parts.items()}
    del parts["model.json"]["gain"]
    with pytest.raises(InvalidInput, match="KeyError: 'gain'"):
        model_of_parts(parts, version=1)
