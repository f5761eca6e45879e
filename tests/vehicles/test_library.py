"""The library of cars: inheritance, overrides, import, and certified consumption."""

import csv
import io
import itertools
import math
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from benchmarks.anchors import unanchored
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.errors import Fault, InvalidInput
from tripwatt.physics.road_load import aero_drag_force, rolling_resistance_force
from tripwatt.vehicles import (
    ALIASES,
    describe_vehicle,
    import_vehicle,
    load_vehicle,
    names_data,
    parse_overrides,
    vehicle_from_document,
    vehicle_names,
    without_data,
)
from tripwatt.vehicles.inheriting import bundled_bases, bundled_text, inherit
from tripwatt.vehicles.loading import file_names
from tripwatt.vehicles.losses import motor_loss
from tripwatt.vehicles.vehicle import SECTIONS

ASKED_FOR = [
    "bmw_i3_60ah",
    "bmw_i3_94ah",
    "bmw_i3_120ah",
    "nissan_leaf_24",
    "nissan_leaf_30",
    "nissan_leaf_40",
    "tesla_model_3_sr_plus",
    "tesla_model_3_lr",
    "vw_e_golf",
    "vw_id3",
    "renault_zoe_ze50_r135",
    "hyundai_kona_64",
    "chevrolet_bolt",
    "fiat_500e",
    "peugeot_e_208",
]


def faults_of(error: pytest.ExceptionInfo[InvalidInput]) -> str:
    return str(error.value)


def raw(name: str) -> dict[str, object]:
    folder = resources.files("tripwatt.vehicles") / "data"
    return tomllib.loads((folder / f"{name}.toml").read_text("utf-8"))


# ------------------------------------------------------------------------------------------------ the cars


def test_library_has_every_car_that_was_asked_for() -> None:
    assert set(ASKED_FOR) <= set(vehicle_names())
    assert not set(vehicle_names()) & {"passenger_car", "nmc_cells", "lmo_cells"}


@pytest.mark.parametrize("name", ASKED_FOR)
def test_cars_are_plausible_and_keep_the_origin_of_every_value(name: str) -> None:
    car = load_vehicle(name)
    kwh = car.battery.capacity_ah * car.battery.cells_in_series * np.mean(car.battery.ocv_v) / 1000.0
    assert 1150.0 < car.body.curb_mass_kg < 1850.0
    assert 18.0 < kwh < 90.0
    # Road load at 80 km/h as a share of the weight.
    speed = 80.0 / 3.6
    a, b = car.road_load.rolling_coefficients
    force = (
        a + b * speed + 0.5 * 1.17 * car.road_load.drag_area_m2 * speed**2 / (car.body.test_mass_kg * 9.81)
    )
    assert 0.013 < force < 0.028
    top = (
        car.drivetrain.motor_max_speed_rad_s / car.drivetrain.gear_ratio * car.drivetrain.wheel_radius_m * 3.6
    )
    assert 130.0 < top < 300.0
    rows = describe_vehicle(name)
    assert len(rows) == len(car.entries)
    assert all(source for *_, source in rows)


def test_scaled_losses_are_the_reference_at_equal_shares() -> None:
    # the i3 94 Ah has the motor of the reference itself
    reference, car = load_vehicle("bmw_i3_94ah").drivetrain, unanchored("hyundai_kona_64").drivetrain
    torque_ratio = car.motor_max_torque_nm / reference.motor_max_torque_nm
    speed_ratio = car.motor_max_speed_rad_s / reference.motor_max_speed_rad_s
    torque = np.array([5.0, 40.0, 120.0, 200.0])[:, None]
    speed = np.array([30.0, 300.0, 700.0, 1100.0])[None, :]
    theirs = motor_loss(torque, speed, reference) * torque_ratio * speed_ratio
    mine = motor_loss(torque * torque_ratio, speed * speed_ratio, car)
    np.testing.assert_allclose(mine, theirs, rtol=1e-9)


@pytest.mark.parametrize(
    ("section", "key"), [("drivetrain", "motor_max_speed_rad_s"), ("battery", "capacity_ah")]
)
def test_a_missing_entry_that_others_are_scaled_by_is_one_fault(section: str, key: str) -> None:
    document = tomllib.loads(bundled_text("vw_id3"))
    del document[section][key]
    with pytest.raises(InvalidInput) as caught:
        vehicle_from_document(document, "car", "car.toml")
    assert [(f.what, f.allowed) for f in caught.value.faults] == [("missing entry", f"an entry {key!r}")]


def test_scaled_resistance_is_inverse_to_capacity() -> None:
    reference, car = load_vehicle("bmw_i3_94ah").battery, load_vehicle("vw_id3").battery
    np.testing.assert_allclose(
        np.array(car.resistance_ohm) * car.capacity_ah,
        np.array(reference.resistance_ohm) * reference.capacity_ah,
    )
    assert "bmw_i3_94ah" in load_vehicle("vw_id3").entries["battery.resistance_ohm"].estimated


def test_own_entries_win_over_inherited_ones() -> None:
    faults: list[Fault] = []
    own = {"value": 99.0, "unit": "W", "source": "here", "licence": "user"}
    document = {"extends": ["passenger_car", "nmc_cells"], "auxiliaries": {"base_load_w": own}}
    result = inherit(document, "car.toml", faults)
    assert not faults
    assert result["auxiliaries"]["base_load_w"] == own
    assert result["battery"]["ocv_v"]["source"].startswith("Collath")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"extends": ["pasenger_car"]},
            ("unknown base", "pasenger_car", "did you mean 'passenger_car'?"),
        ),
        ({"extends": 3}, ("not a list of names", "3")),
        ({"scaled": {"motor_loses": "bmw_i3_60ah"}}, ("unknown key", "scaled.motor_loses", "motor_losses")),
        ({"scaled": {"motor_losses": "bmw_i4"}}, ("unknown base", "scaled.motor_losses", "bmw_i4")),
    ],
)
def test_wrong_inheritance_is_named(change: dict[str, object], words: tuple[str, ...]) -> None:
    with pytest.raises(InvalidInput) as error:
        vehicle_from_document({**raw("vw_id3"), **change}, "car", "car.toml")
    assert all(word in faults_of(error) for word in words)


def test_coastdown_coefficients_take_the_place_of_drag_and_rolling_resistance() -> None:
    def entry(value: object, unit: str) -> dict[str, object]:
        return {"value": value, "unit": unit, "source": "EPA test car list", "licence": "US-public-domain"}

    document = raw("nissan_leaf_24")
    document["road_load"] = {
        "coastdown_a_n": entry(150.0, "N"),
        "coastdown_b_n_s_m": entry(0.6, "N s/m"),
        "coastdown_c_n_s2_m2": entry(0.5, "N s2/m2"),
    }
    with pytest.raises(InvalidInput) as error:
        vehicle_from_document(document, "car", "car.toml")
    assert "coastdown_mass_kg" in faults_of(error)
    document["road_load"]["coastdown_mass_kg"] = entry(1644.0, "kg")  # type: ignore[index]
    car = vehicle_from_document(document, "car", "car.toml")
    speed = np.array([5.0, 15.0, 25.0])
    force = rolling_resistance_force(speed, 1644.0, car.road_load.rolling_coefficients) + aero_drag_force(
        speed, car.road_load.drag_area_m2, 1.167
    )
    assert force == pytest.approx(150.0 + 0.6 * speed + 0.5 * speed**2)


def test_missing_and_impossible_values_say_key_found_and_allowed() -> None:
    document = raw("vw_id3")
    body, drivetrain = document["body"], document["drivetrain"]
    assert isinstance(body, dict)
    assert isinstance(drivetrain, dict)
    body["curb_mass_kg"]["value"] = 3.0
    del drivetrain["gear_ratio"]
    with pytest.raises(InvalidInput) as error:
        vehicle_from_document(document, "car", "car.toml")
    text = faults_of(error)
    assert "car.toml, body.curb_mass_kg: got 3 kg; allowed: 100 to 60000 kg" in text
    assert "'gear_ratio'" in text


# ------------------------------------------------------------------------------------------------ overrides


def test_short_names_reach_entries_that_exist() -> None:
    known = {f"{section}.{name}" for section, part in SECTIONS.items() for name in part.__dataclass_fields__}
    assert set(ALIASES.values()) <= known


def test_overrides_with_short_names_change_the_car_and_say_so() -> None:
    car = load_vehicle("nissan_leaf_24", overrides=parse_overrides(["mass=1700", "c_d=0.3", "payload=150"]))
    assert car.body.test_mass_kg == 1850.0
    assert car.road_load.drag_coefficient == 0.3
    assert car.entries["body.curb_mass_kg"].source == "given by the caller"


def test_override_without_effect_is_refused() -> None:
    with pytest.raises(InvalidInput) as error:
        load_vehicle("nissan_leaf_40", overrides={"c_d": 0.3})
    assert "override has no effect" in faults_of(error)
    every = {"c_d": 0.28, "area": 2.3, "c_rr": 0.009, "road_load": "coefficients"}
    assert load_vehicle("nissan_leaf_40", overrides=every).road_load.drag_area_m2 == pytest.approx(0.644)


def test_every_wrong_override_is_named_at_once() -> None:
    with pytest.raises(InvalidInput) as error:
        parse_overrides(["mas=3", "mass", "c_d=1", "c_d=2"])
    text = faults_of(error)
    assert len(error.value.faults) == 3
    assert "did you mean 'mass'?" in text
    assert "override given twice" in text


# ------------------------------------------------------------------------------------------------ import

YAML = """---
name: 2030 Test Car # made up
pt_type:
  BEV:
    res:
      energy_capacity_joules: 180000000.0
      eff_interp:
        Constant: 0.98
      min_soc: 0.05
      max_soc: 0.95
    em:
      eff_interp_achieved:
        data:
          grid:
            - - 0.0
              - 1.0
          values:
            - 0.9
            - 0.95
      pwr_out_max_watts: 100000.0
    transmission:
      eff_interp: 0.97
chassis:
  drag_coef: 0.3
  frontal_area_square_meters: 2.3
  wheel_rr_coef: 0.009
  wheel_inertia_kilogram_square_meters: 0.8
  num_wheels: 4
  wheel_radius_meters: 0.32
  cargo_mass_kilograms: 136.0
mass_kilograms: 1636.0
pwr_aux_base_watts: 250.0
"""

XML = """<?xml version="1.0" encoding="utf-8"?>
<routes><vType id="Test_Car" emissionClass="MMPEVEM" vClass="passenger">
<param key="has.battery.device" value="true"/><param key="device.battery.capacity" value="50000"/>
<param key="maximumPower" value="100000"/><param key="maximumTorque" value="250"/>
<param key="maximumRecuperationTorque" value="80"/><param key="maximumRecuperationPower" value="40000"/>
<param key="gearRatio" value="10"/><param key="gearEfficiency" value="0.96"/><param key="vehicleMass" value="1575"/>
<param key="constantPowerIntake" value="360"/><param key="rollDragCoefficient" value="0.009"/>
<param key="airDragCoefficient" value="0.3"/><param key="frontSurfaceArea" value="2.2"/>
<param key="wheelRadius" value="0.31"/><param key="internalBatteryResistance" value="0.1"/>
<param key="nominalBatteryVoltage" value="354"/><param key="internalMomentOfInertia" value="12"/>
<param key="powerLossMap" value="2,1|0,6000,12000;-250,0,250|1,2,3,4,5,6,7,8,9"/>
</vType></routes>
"""

CSV_HEAD = (
    "selection,Scenario name,veh_pt_type,drag_coef,frontal_area_m2,glider_kg,cargo_kg,veh_override_kg,mc_max_kw,"
    "mc_pe_kg_per_kw,mc_pe_base_kg,ess_max_kwh,ess_kg_per_kwh,ess_base_kg,wheel_inertia_kg_m2,num_wheels,"
    "wheel_rr_coef,wheel_radius_m,min_soc,max_soc,aux_kw,trans_kg,trans_eff,comp_mass_multiplier,max_regen\n"
)
CSV_ROWS = (
    "1,Sum of parts,BEV,0.315,2.755,817.894,136,,80,0.833,21.6,30,7,75,0.815,4,0.008,0.336,0.05,0.95,0.25,114,"
    "0.98,1.4,0.98\n"
    "2,Given mass,BEV,0.315,2.755,0,136,1636,80,0.833,21.6,30,7,75,0.815,4,0.008,0.336,0.05,0.95,0.25,114,0.98,1.4,"
    "0.98\n"
    "3,Petrol,Conv,0.3,2.5,1000,136,,0,0.8,21,0,8,75,0.8,4,0.01,0.33,0.1,0.9,0.7,114,0.92,1.4,0.98\n"
)


def imported(folder: Path, name: str, text: str, row: str | None = None) -> dict[str, object]:
    (folder / name).write_text(text, encoding="utf-8")
    return tomllib.loads(import_vehicle(folder / name, row))


def test_fastsim_yaml_becomes_a_car(tmp_path: Path) -> None:
    document = imported(tmp_path, "car.yaml", YAML)
    car = vehicle_from_document(document, "car", "car.toml")
    assert car.title == "2030 Test Car"
    assert car.body.curb_mass_kg == pytest.approx(1500.0)
    assert car.body.rotating_mass_factor == pytest.approx(1.0 + 3.2 / (0.32**2 * 1636.0))
    assert car.road_load.drag_area_m2 == pytest.approx(0.69)
    assert car.drivetrain.gearbox_efficiency == 0.97
    assert car.drivetrain.motor_max_torque_nm == pytest.approx(200.0)
    assert car.battery.capacity_ah * car.battery.cells_in_series * 3.69 == pytest.approx(50_000.0)
    assert car.battery.displayed_zero_soc == 0.05
    assert car.entries["road_load.drag_coefficient"].source == "car.yaml"
    assert "car.yaml has none" in car.entries["drivetrain.gear_ratio"].estimated
    assert car.entries["road_load.drag_coefficient"].licence == "as-source-file"
    assert car.entries["drivetrain.gear_ratio"].licence == "facts"  # the BMW i3's
    assert car.entries["battery.heat_capacity_j_k"].licence == "estimate AND facts"


def test_sumo_xml_becomes_a_car(tmp_path: Path) -> None:
    car = vehicle_from_document(imported(tmp_path, "car.xml", XML), "car", "car.toml")
    assert car.body.curb_mass_kg == pytest.approx(1500.0)
    assert car.drivetrain.motor_max_speed_rad_s == pytest.approx(12_000 * math.pi / 30)
    assert car.battery.cells_in_series == 96
    assert np.array(car.battery.resistance_ohm) * 96 == pytest.approx([0.1, 0.1])
    assert car.regeneration.max_power_w == 40_000.0
    assert car.auxiliaries.base_load_w == 360.0


def test_fastsim_rows_give_the_same_mass_from_parts_and_as_stated(tmp_path: Path) -> None:
    text = CSV_HEAD + CSV_ROWS
    parts = vehicle_from_document(imported(tmp_path, "a.csv", text, "Sum of parts"), "a", "a.toml")
    stated = vehicle_from_document(imported(tmp_path, "b.csv", text, "2"), "b", "b.toml")
    assert parts.body.curb_mass_kg == pytest.approx(stated.body.curb_mass_kg, abs=0.1)
    single = "Category,Param Name,Param Value,Param Source\n" + "".join(
        f",{name},{value},\n"
        for name, value in zip(
            [
                "scenarioName",
                "vehPtType",
                "dragCoef",
                "frontalAreaM2",
                "cargoKg",
                "vehOverrideKg",
                "maxMotorKw",
                "maxEssKwh",
                "wheelInertiaKgM2",
                "numWheels",
                "wheelRrCoef",
                "wheelRadiusM",
                "minSoc",
                "maxSoc",
                "auxKw",
                "transEff",
                "maxRegen",
            ],
            [
                "x",
                "BEV",
                "0.315",
                "2.755",
                "136",
                "1636",
                "80",
                "30",
                "0.815",
                "4",
                "0.008",
                "0.336",
                "0.05",
                "0.95",
                "0.25",
                "0.98",
                "0.98",
            ],
            strict=True,
        )
    )
    alone = vehicle_from_document(imported(tmp_path, "c.csv", single), "c", "c.toml")
    assert alone.body == stated.body
    assert alone.battery == stated.battery


def test_fastsim_2_in_yaml_is_its_row_in_csv(tmp_path: Path) -> None:
    names, *rows = csv.reader(io.StringIO(CSV_HEAD + CSV_ROWS))
    row = dict(zip(names, rows[0], strict=True))
    lines = [f"{'scenario_name' if key == 'Scenario name' else key}: {value}" for key, value in row.items()]
    from_yaml = imported(tmp_path, "car.yaml", "---\n" + "\n".join(lines) + "\n")
    from_csv = imported(tmp_path, "car.csv", CSV_HEAD + CSV_ROWS, row["Scenario name"])
    cars = [vehicle_from_document(document, "c", "c.toml") for document in (from_yaml, from_csv)]
    assert cars[0].body == cars[1].body
    assert cars[0].road_load == cars[1].road_load
    assert cars[0].battery == cars[1].battery


@pytest.mark.parametrize(
    ("name", "text", "row", "words"),
    [
        ("car.txt", "", None, ("unknown file format", ".yaml")),
        ("car.csv", CSV_HEAD + CSV_ROWS, None, ("no single vehicle", "Sum of parts, Given mass")),
        ("car.csv", CSV_HEAD + CSV_ROWS, "Petrol", ("not a battery electric car", "Conv")),
        (
            "car.csv",
            CSV_HEAD + CSV_ROWS.replace("0.315", "much"),
            "1",
            ("drag_coef", "much", "a finite number"),
        ),
        (
            "car.yaml",
            YAML.replace("  drag_coef: 0.3\n", "").replace("mass_kilograms: 1636.0\n", ""),
            None,
            ("chassis.drag_coef", "mass_kilograms"),
        ),
        ("car.yaml", YAML.replace("drag_coef: 0.3", "drag_coef: 30"), None, ("drag_coefficient", "0 to 2")),
        (
            "car.yaml",
            YAML.replace("chassis:", "chassis: {a: 1}"),
            None,
            ("line cannot be read", "block mappings"),
        ),
        (
            "car.xml",
            XML.replace('key="gearRatio"', 'key="gearRation"').replace('key="wheelRadius"', 'key="x"'),
            None,
            ("unknown entry", "gearRation", "missing entry", "gearRatio", "wheelRadius"),
        ),
        ("car.xml", XML.replace("</vType>", ""), None, ("not an XML file",)),
        (
            "car.xml",
            XML.replace("<routes>", '<!DOCTYPE r [<!ENTITY a "b">]><routes>'),
            None,
            ("XML with entities", "plain XML"),
        ),
        ("long.csv", "selection,Scenario name\n1," + "a" * 200_000, "1", ("unreadable CSV", "field larger")),
    ],
)
def test_files_that_cannot_be_imported_say_why(
    tmp_path: Path, name: str, text: str, row: str | None, words: tuple[str, ...]
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput) as error:
        import_vehicle(tmp_path / name, row)
    assert all(word in faults_of(error) for word in words)


@settings(max_examples=50, deadline=None)
@given(st.sampled_from(["car.yaml", "car.csv", "car.xml"]), st.text(max_size=200), st.integers(0, 2000))
def test_broken_files_end_in_a_message_never_in_another_error(
    tmp_path_factory: pytest.TempPathFactory, name: str, noise: str, place: int
) -> None:
    whole = {"car.yaml": YAML, "car.csv": CSV_HEAD + CSV_ROWS, "car.xml": XML}[name]
    file = tmp_path_factory.getbasetemp() / name
    file.write_text(whole[:place] + noise + whole[place:], encoding="utf-8", errors="replace")
    try:
        result = import_vehicle(file, "1" if name == "car.csv" else None)
    except InvalidInput:
        return
    tomllib.loads(result)


def test_bases_are_files_and_names_are_cars() -> None:
    shared = {"passenger_car", "nmc_cells", "lmo_cells", "lfp_cells"}
    shared |= {"permanent_magnet_motor", "induction_motor", "externally_excited_motor"}
    assert {*shared, *file_names()} == set(bundled_bases())
    assert all(a < b for a, b in itertools.pairwise(bundled_bases()))


@pytest.mark.parametrize("name", vehicle_names())
def test_every_value_of_a_data_sets_logs_has_another_without_it(name: str) -> None:
    car = load_vehicle(name)
    logged = {key for key, entry in car.entries.items() if names_data(entry, "tum")}
    assert "auxiliaries.moving_load_w" in logged
    bare = without_data(car, "tum")
    assert not any(names_data(entry, "tum") for entry in bare.entries.values())
    differ = {key for key, entry in bare.entries.items() if entry.value != car.entries[key].value}
    assert differ == logged
    for key in logged:
        section, _, field = key.partition(".")
        assert getattr(getattr(bare, section), field) == bare.entries[key].value
        assert bare.entries[key].unit == car.entries[key].unit
    assert without_data(bare, "tum") is bare
    assert without_data(car, "ved") is car
