"""The licence of every source of a car."""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from tests.support import ROOT
from tools.docs.write_parameters import render_licences

from tripwatt.errors import Fault, InvalidInput
from tripwatt.vehicles import (
    load_vehicle,
    vehicle_from_document,
)
from tripwatt.vehicles.licences import with_licences


@pytest.fixture
def document() -> dict[str, Any]:
    text = (resources.files("tripwatt.vehicles") / "data" / "bmw_i3_60ah.toml").read_text("utf-8")
    return tomllib.loads(text)


def faults_of(document: dict[str, Any], **more: Any) -> list[str]:
    with pytest.raises(InvalidInput) as caught:
        vehicle_from_document(document, "car", "car.toml", **more)
    return [str(fault) for fault in caught.value.faults]


def entry(value: object, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "source": "a chart", "licence": "user"}


# ------------------------------------------------------------------------------------------------ licences
def test_an_entry_has_the_licences_of_all_works_that_its_source_cites() -> None:
    document = {
        "licence": "user",
        "licences": {"Apache-2.0": ["NREL"], "facts": ["NREL press kit", "Maker"]},
        "auxiliaries": {
            "a": {"source": "NREL database"},
            "b": {"source": "NREL press kit"},
            "c": {"source": "NREL database; page 3; Maker, technical data"},
            "d": {"source": "weighed at home; NREL database"},
            "e": {"source": "NREL database", "licence": "MIT"},
        },
    }
    faults: list[Fault] = []
    entries = with_licences(document, "car.toml", faults)["auxiliaries"]
    assert faults == []
    assert {key: entry["licence"] for key, entry in entries.items()} == {
        "a": "Apache-2.0",
        "b": "facts",
        "c": "Apache-2.0 AND facts",
        "d": "user",
        "e": "MIT",
    }


def test_an_own_file_without_licences_is_the_users(tmp_path: Path) -> None:
    text = (resources.files("tripwatt.vehicles") / "data" / "bmw_i3_60ah.toml").read_text("utf-8")
    head, _, rest = text.partition("[licences]")
    own = tmp_path / "mine.toml"
    own.write_text(head + rest[rest.index("\n[") :], encoding="utf-8")
    assert {entry.licence for entry in load_vehicle(own).entries.values()} >= {"user"}
    assert load_vehicle(own).entries["body.curb_mass_kg"].licence == "user"


def test_sources_without_a_licence_are_one_fault_that_says_what_to_write(document: dict[str, Any]) -> None:
    del document["licences"]
    (fault,) = faults_of(document)
    assert "missing licence" in fault
    assert 'licence = "user"' in fault
    document["licence"] = "user"
    car = vehicle_from_document(document, "car", "car.toml")
    assert {entry.licence for entry in car.entries.values()} == {"user"}


@pytest.mark.parametrize(
    "change",
    [
        {"licence": "GPL"},
        {"licences": {"GPL": ["EPA"]}, "licence": "user"},
        {"licences": {"facts": "EPA"}, "licence": "user"},
        {"licences": ["facts"], "licence": "user"},
        {"licences": {"facts": [""]}, "licence": "user"},
    ],
)
def test_unknown_licences_and_wrong_tables_of_them_are_faults(
    document: dict[str, Any], change: dict[str, Any]
) -> None:
    faults = faults_of({**document, **change})
    assert any("licence" in fault and "car.toml" in fault for fault in faults)


def test_an_entry_with_an_unknown_licence_is_a_fault(document: dict[str, Any]) -> None:
    document["body"]["curb_mass_kg"]["licence"] = "mine"
    (fault,) = faults_of(document)
    assert "body.curb_mass_kg" in fault
    assert "mine" in fault


def test_what_is_taken_over_keeps_the_licence_of_its_own_file() -> None:
    entries = load_vehicle("nissan_leaf_40", overrides={"mass": 1600.0}).entries
    assert entries["body.curb_mass_kg"].licence == "user"
    assert entries["road_load.coastdown_a_n"].licence == "US-public-domain"
    assert entries["auxiliaries.base_load_w"].licence == "Apache-2.0"  # of passenger_car
    theirs = load_vehicle("bmw_i3_60ah").entries["drivetrain.phase_resistance_ohm"].licence
    assert entries["drivetrain.phase_resistance_ohm"].licence == theirs
    assert load_vehicle("nissan_leaf_40", "paper").entries["regeneration.fraction"].licence == "facts"


def test_table_of_licences_in_the_documentation_is_that_of_the_code() -> None:
    page = (ROOT / "docs" / "reference" / "vehicles.md").read_text("utf-8")
    assert render_licences() in page, "run: python -m tools.docs.write_parameters"
