"""Vehicle files of FASTSim and SUMO as cars."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tools.data.import_vehicle import import_vehicle, main

from tripwatt.errors import InvalidInput
from tripwatt.vehicles import load_vehicle, vehicle_from_document


def faults_of(error: pytest.ExceptionInfo[InvalidInput]) -> str:
    return str(error.value)


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
    values = (
        "scenarioName=x vehPtType=BEV dragCoef=0.315 frontalAreaM2=2.755 cargoKg=136 vehOverrideKg=1636 maxMotorKw=80 maxEssKwh=30 "
        "wheelInertiaKgM2=0.815 numWheels=4 wheelRrCoef=0.008 wheelRadiusM=0.336 minSoc=0.05 maxSoc=0.95 auxKw=0.25 transEff=0.98 "
        "maxRegen=0.98"
    )
    lines = (f",{value.replace('=', ',')},\n" for value in values.split())
    single = "Category,Param Name,Param Value,Param Source\n" + "".join(lines)
    alone = vehicle_from_document(imported(tmp_path, "c.csv", single), "c", "c.toml")
    assert alone.body == stated.body
    assert alone.battery == stated.battery


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


def test_the_command_writes_a_car_that_loads_or_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = tmp_path / "ev.xml", tmp_path / "ev.toml"
    source.write_text(XML.replace("vehicleMass", "vehicleMas"))
    assert main(str(source), out=str(out)) == 2
    assert "ev.xml, Test_Car, vehicleMas" in capsys.readouterr().err
    assert not out.exists()
    source.write_text(XML)
    assert main(str(source), out=str(out)) == 0
    assert load_vehicle(str(out)).body.curb_mass_kg == pytest.approx(1500.0)
    assert main(str(source)) == 0
    assert capsys.readouterr().out == out.read_text()


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
