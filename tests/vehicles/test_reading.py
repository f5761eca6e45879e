"""From a document to a car, with every fault in one message."""

import copy
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from tests.support import ROOT
from tests.support.refusals import refuses
from tools.docs.write_parameters import render_licences

from tripwatt.errors import InvalidInput
from tripwatt.vehicles import (
    ALIASES,
    load_vehicle,
    vehicle_from_document,
    vehicle_names,
)
from tripwatt.vehicles.parts import Charging
from tripwatt.vehicles.vehicle import SECTIONS


@pytest.fixture
def document() -> dict[str, Any]:
    text = (resources.files("tripwatt.vehicles") / "data" / "bmw_i3_60ah.toml").read_text("utf-8")
    return tomllib.loads(text)


def faults_of(document: dict[str, Any], **more: Any) -> list[str]:
    with pytest.raises(InvalidInput) as caught:
        vehicle_from_document(document, "car", "car.toml", **more)
    return [str(fault) for fault in caught.value.faults]


def test_presets_differ_where_the_file_says() -> None:
    default, paper = load_vehicle("bmw_i3_60ah"), load_vehicle("bmw_i3_60ah", "paper")
    assert paper.regeneration.fraction == 0.5
    assert paper.climate is None
    assert paper.tyres is None
    assert default.climate is not None
    assert paper.drivetrain == default.drivetrain
    assert paper.battery == default.battery


def test_every_car_has_the_preset_of_the_paper_also_with_overrides_of_what_it_leaves_out() -> None:
    car = load_vehicle("nissan_leaf_24", "paper", {"setpoint": 18.0, "mass": 1600.0})
    assert car.climate is None
    assert car.regeneration.fraction == 0.5
    assert car.body.curb_mass_kg == 1600.0
    refuses("setpoint", load_vehicle, "nissan_leaf_24", "paper", {"setpoint": -400.0})


def test_all_faults_come_together_with_file_and_key(document: dict[str, Any]) -> None:
    document["body"]["curb_mas_kg"] = document["body"].pop("curb_mass_kg")
    document["drivetrain"]["gear_ratio"]["source"] = " "
    document["drivetrain"]["wheel_radius_m"]["unit"] = "mm"
    document["regeneration"]["fraction"]["value"] = 1.5
    document["battery"]["capacity_ah"].pop("scale")
    document["battery"]["ocv_v"]["value"] = "high"
    document["auxiliaries"]["base_load_w"] = 300.0
    document["body"]["driver_mass_kg"]["note"] = "heavy"
    document["battery"]["heat_loss_w_k"]["value"] = True
    document["wheels"] = {}
    found = faults_of(document)
    for where in (
        "body.curb_mas_kg",
        "drivetrain.gear_ratio",
        "drivetrain.wheel_radius_m",
        "regeneration.fraction",
        "battery.capacity_ah",
        "battery.ocv_v",
        "auxiliaries.base_load_w",
        "body.driver_mass_kg",
        "battery.heat_loss_w_k",
        "wheels",
    ):
        assert any("car.toml" in fault and where in fault for fault in found), where
    assert any("did you mean 'body.curb_mass_kg'" in fault for fault in found)


def test_each_required_entry_is_missed(document: dict[str, Any]) -> None:
    for section in ("body", "drivetrain", "regeneration", "battery", "auxiliaries", "climate", "tyres"):
        for key in document[section]:
            if key == "moving_load_w":  # a car of one's own may leave it out
                continue
            broken = copy.deepcopy(document)
            del broken[section][key]
            assert any("missing entry" in f and section in f and repr(key) in f for f in faults_of(broken))


@pytest.mark.parametrize(
    ("section", "key", "value", "word"),
    [
        ("battery", "ocv_soc", [0.0, 0.5], "differ in length"),
        ("battery", "resistance_soc", [0.0, 0.2, 0.1, 1.0], "does not increase"),
        ("battery", "min_cell_voltage_v", 3.9, "cell voltage limit too high"),
        ("regeneration", "full_soc", 0.99, "wrong order"),
        ("climate", "fresh_air_low_w_k", 500.0, "wrong order"),
    ],
)
def test_values_that_contradict_each_other(document, section, key, value, word) -> None:
    document[section][key]["value"] = value
    assert any(word in fault for fault in faults_of(document))


def test_coast_down_stands_in_for_drag_and_rolling(document: dict[str, Any]) -> None:
    road = document["road_load"]
    coastdown = {k: v for k, v in road.items() if k.startswith("coastdown_")}
    coefficients = {k: v for k, v in road.items() if k not in coastdown and k != "method"}
    measured = vehicle_from_document({**document, "road_load": coastdown}, "car", "car.toml").road_load
    named = vehicle_from_document({**document, "road_load": coefficients}, "car", "car.toml").road_load
    assert measured.method == "coastdown"
    assert named.method == "coefficients"
    assert named.drag_area_m2 == pytest.approx(0.29 * 2.38)
    assert named.rolling_coefficients == (0.0065, 0.0)
    weight = 1443.33 * 9.80665
    constant, linear = measured.rolling_coefficients
    force = weight * (constant + linear * 20.0) + 0.5 * 1.167 * measured.drag_area_m2 * 400.0
    a, b, c = (float(coastdown[f"coastdown_{k}"]["value"]) for k in ("a_n", "b_n_s_m", "c_n_s2_m2"))
    assert force == pytest.approx(a + b * 20.0 + c * 400.0)
    both = {**coastdown, **coefficients}
    assert any("incomplete or ambiguous" in f for f in faults_of({**document, "road_load": both}))
    half = dict(list(coastdown.items())[:2])
    assert any("incomplete or ambiguous" in f for f in faults_of({**document, "road_load": half}))


def test_a_displayed_capacity_is_put_on_the_soc_scale(document: dict[str, Any]) -> None:
    document["battery"]["capacity_ah"].update(value=41.0, scale="displayed_soc")
    assert vehicle_from_document(document, "car", "car.toml").battery.capacity_ah == pytest.approx(50.0)


def test_overrides_name_their_keys() -> None:
    assert load_vehicle("bmw_i3_60ah", overrides={"body.driver_mass_kg": 90.0}).body.test_mass_kg == 1371.0
    with pytest.raises(InvalidInput, match=r"did you mean 'body\.driver_mass_kg'") as caught:
        load_vehicle("bmw_i3_60ah", overrides={"body.driver_mas_kg": 90.0, "regeneration.fraction": -1.0})
    assert len(caught.value.faults) == 2


def test_the_largest_regenerative_torque_is_the_floor_of_the_logged_torque(data_dir: Path) -> None:
    torque = load_vehicle("bmw_i3_60ah").regeneration.max_torque_nm
    for name in ("TripA10", "TripB11", "TripB20"):
        file = data_dir / "tum" / f"{name}.csv"
        if not file.is_file():
            continue
        columns = pd.read_csv(
            file, sep=";", encoding="latin-1", usecols=lambda c: c.startswith("Motor Torque")
        )
        braking = columns.iloc[:, 0].to_numpy()
        braking = braking[braking < -70.0]
        share = np.mean((braking >= -torque) & (braking <= 2.0 - torque))
        assert share > 0.25, name  # a pile at the floor, not a tail


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"body": 5}, "not a table: car.toml, body"),
        ({"scaled": []}, "not a table: car.toml, scaled"),
        ({"preset": "paper"}, "not a table: car.toml, preset"),
        ({"preset": {"mine": 5}}, "not a table: car.toml, preset.mine"),
        ({"preset": {"mine": {"without": 5}}}, "part cannot be left out: car.toml, preset.mine, without"),
        ({"preset": {"mine": {"wheels": {}}}}, "unknown section: car.toml, preset.mine, wheels"),
        ({"licence": "GPL"}, "unknown licence: car.toml, licence"),
        ({"licence": ["facts"]}, "unknown licence: car.toml, licence"),
        ({"anchor": []}, "unknown anchor: car.toml, anchor"),
    ],
)
def test_a_wrong_shape_is_a_fault_with_its_place(document, change, words) -> None:
    preset = "mine" if isinstance(change.get("preset"), dict) else "default"
    assert any(words in fault for fault in faults_of({**document, **change}, preset=preset))


def test_every_value_of_the_library_has_the_licence_of_its_source() -> None:
    for name in vehicle_names():
        licences = {entry.licence for entry in load_vehicle(name).entries.values()}
        assert not licences & {"not-stated", "user", "as-source-file"}, name


def test_an_entry_without_a_licence_has_that_of_its_file(tmp_path: Path) -> None:
    own = tmp_path / "mine.toml"
    own.write_text(
        'extends = ["nissan_leaf_40"]\nbody.curb_mass_kg = {value = 1600, unit = "kg", source = "weighed"}'
    )
    entries = load_vehicle(own).entries
    assert entries["body.curb_mass_kg"].licence == "user"
    assert entries["road_load.coastdown_a_n"].licence == "US-public-domain"
    assert entries["auxiliaries.base_load_w"].licence == "Apache-2.0"  # of passenger_car
    own.write_text('licence = "MIT"\n' + own.read_text())
    assert load_vehicle(own).entries["body.curb_mass_kg"].licence == "MIT"
    assert load_vehicle(own, overrides={"mass": 1700.0}).entries["body.curb_mass_kg"].licence == "user"
    assert load_vehicle(own, "paper").entries["regeneration.fraction"].licence == "facts"


def test_an_entry_with_an_unknown_licence_is_a_fault(document: dict[str, Any]) -> None:
    document["body"]["curb_mass_kg"]["licence"] = "facts AND mine"
    (fault,) = faults_of(document)
    assert "body.curb_mass_kg" in fault
    assert "mine" in fault


def test_table_of_licences_in_the_documentation_is_that_of_the_code() -> None:
    page = (ROOT / "docs" / "reference" / "vehicles.md").read_text("utf-8")
    assert render_licences() in page, "run: python -m tools.docs.write_parameters"


def test_short_names_reach_entries_that_exist() -> None:
    known = {f"{section}.{name}" for section, part in SECTIONS.items() for name in part.__dataclass_fields__}
    assert set(ALIASES.values()) <= known


def test_overrides_with_short_names_change_the_car_and_say_so() -> None:
    car = load_vehicle("peugeot_e_208", overrides={"mass": 1700.0, "c_d": 0.3, "payload": 150.0})
    assert car.body.test_mass_kg == 1850.0
    assert car.road_load.drag_coefficient == 0.3
    assert car.entries["body.curb_mass_kg"].source == "given by the caller"


def test_override_without_effect_is_refused() -> None:
    refuses("override has no effect", load_vehicle, "nissan_leaf_40", overrides={"c_d": 0.3})
    every = {"c_d": 0.28, "area": 2.3, "c_rr": 0.009, "road_load": "coefficients"}
    assert load_vehicle("nissan_leaf_40", overrides=every).road_load.drag_area_m2 == pytest.approx(0.644)


def test_every_wrong_override_is_named_at_once() -> None:
    refuses("did you mean 'mass'", load_vehicle, "nissan_leaf_40", overrides={"mas": 3.0})


def entry(value: object, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "source": "a chart", "licence": "user"}


@pytest.mark.parametrize(
    ("soc", "power", "word"),
    [
        ([0.0, 1.0], [50_000.0, 20_000.0, 10_000.0], "differ in length"),
        ([0.0, 0.9], [50_000.0, 20_000.0], "does not cover"),
        ([0.1, 1.0], [50_000.0, 20_000.0], "does not cover"),
        ([0.0, 0.5, 0.5, 1.0], [50_000.0] * 4, "does not increase"),
        ([0.0, 1.0], [50_000.0, 0.0], "out of range"),
    ],
)
def test_a_charging_curve_goes_from_empty_to_full(document, soc, power, word) -> None:
    document["charging"] = {
        "displayed_soc": entry(soc, "1"),
        "power_w": entry(power, "W"),
        "alternating_power_w": entry(7_400.0, "W"),
    }
    (fault,) = [f for f in faults_of(document) if "charging" in f]
    assert word in fault


def test_a_charging_curve_is_part_of_a_car(document) -> None:
    assert vehicle_from_document(document, "car", "car.toml").charging is None
    document["charging"] = {
        "displayed_soc": entry([0.0, 0.6, 1.0], "1"),
        "power_w": entry([100_000.0, 80_000.0, 10_000.0], "W"),
        "alternating_power_w": entry(7_400.0, "W"),
    }
    found = vehicle_from_document(document, "car", "car.toml").charging
    assert found == Charging((0.0, 0.6, 1.0), (100_000.0, 80_000.0, 10_000.0), 7_400.0)
    del document["charging"]["power_w"]
    assert any("missing entry" in f and "power_w" in f for f in faults_of(document))


def test_curves_of_the_library_are_of_their_own_cars() -> None:
    """Written out from the public list, in percent of the display and kilowatts."""
    zoe = load_vehicle("renault_zoe_ze50_r135").charging
    assert zoe == Charging((0.0, 0.52, 0.8, 1.0), (41_000.0, 46_000.0, 27_000.0, 22_000.0), 22_000.0)
    known = [car for name in vehicle_names() if (car := load_vehicle(name)).charging is not None]
    assert len(known) == 62
    for car in known:
        assert car.entries["charging.power_w"].licence == "MIT"
        assert 20_000.0 <= max(car.charging.power_w) <= 350_000.0
        assert 3_000.0 < car.charging.alternating_power_w <= 22_000.0
