"""Cars without a heater, cars by hand, and quadricycles: what a file leaves out and how well its values are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tripwatt as tw
from tripwatt.certification import describe_car
from tripwatt.errors import InvalidInput
from tripwatt.vehicles import load_vehicle, render_vehicle, vehicle_document, vehicle_from_document

PLAN = tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0}])
COLD = tw.Departure(soc=0.8, ambient_temperature_degc=-8.0)
HOT = tw.Departure(soc=0.8, ambient_temperature_degc=35.0)


def car_file(folder: Path, *lines: str, without: str = "", name: str = "vw_id3") -> Path:
    """The file of a car of the library, with some lines at its top and one of its own left out."""
    text = render_vehicle(load_vehicle(name))
    if without:
        kept = [line for line in text.splitlines() if not line.startswith(without)]
        assert len(kept) < len(text.splitlines())
        text = "\n".join(kept)
    path = folder / "mine.toml"
    path.write_text("\n".join([*lines, text]), encoding="utf-8")
    return path


def test_a_car_without_a_heater_has_no_climate_control_in_any_weather(tmp_path: Path) -> None:
    usual = load_vehicle("vw_id3")
    bare = load_vehicle(car_file(tmp_path, 'without = ["climate"]'))
    assert usual.climate is not None
    assert bare.climate is None
    assert [key for key in bare.entries if key.startswith("climate.")] == []
    assert (bare.battery, bare.road_load, bare.auxiliaries) == (
        usual.battery,
        usual.road_load,
        usual.auxiliaries,
    )
    for departure in (COLD, HOT):
        run = tw.simulate(PLAN, bare, departure)
        assert np.abs(run.power_by_cause_w["climate"]).max() == 0.0
        assert tw.simulate(PLAN, usual, departure).power_by_cause_w["climate"].max() > 300.0
        off = tw.simulate(PLAN, usual, tw.Departure(**{**known(departure), "climate": "off"}))
        assert run.simulated_energy_wh == pytest.approx(off.simulated_energy_wh, rel=1e-12)


def known(departure: tw.Departure) -> dict[str, float]:
    return {name: getattr(departure, name) for name in ("soc", "ambient_temperature_degc")}


def test_a_car_without_a_heater_that_extends_one_with_it_loses_it(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('name = "Mine"\nextends = "vw_id3"\nwithout = ["climate"]\n')
    bare = load_vehicle(path)
    assert bare.climate is None
    assert load_vehicle(path, "paper").climate is None
    path.write_text('name = "Mine"\nextends = "vw_id3"\n')
    assert load_vehicle(path).climate is not None


def test_a_car_without_a_heater_is_written_and_read_as_it_is(tmp_path: Path) -> None:
    bare = load_vehicle(car_file(tmp_path, 'without = ["climate"]'))
    assert vehicle_from_document(vehicle_document(bare), bare.name, "again") == bare
    path = tmp_path / "mine.toml"
    path.write_text(render_vehicle(bare), encoding="utf-8")
    assert load_vehicle(path) == bare


@pytest.mark.parametrize("value", ['"climate"', "true", '["battery"]', "[[]]"])
def test_only_optional_parts_can_be_left_out(tmp_path: Path, value: str) -> None:
    with pytest.raises(InvalidInput, match="part cannot be left out") as caught:
        load_vehicle(car_file(tmp_path, f"without = {value}"))
    (fault,) = caught.value.faults
    assert fault.where.endswith("mine.toml, without")
    assert fault.allowed == "a list of charging, climate, tyres"


def test_a_file_of_one_s_own_is_held_against_no_test_unless_it_says_so(tmp_path: Path) -> None:
    assert load_vehicle(car_file(tmp_path, without="anchor = ")).anchor == "class"
    for anchor in ("published", "road_load", "certification", "class"):
        path = car_file(tmp_path, f'anchor = "{anchor}"', without="anchor = ")
        assert load_vehicle(path).anchor == anchor
    assert load_vehicle(car_file(tmp_path, 'anchor = "book"', without="anchor = ")).anchor == "published"
    path.write_text('name = "Mine"\nextends = "bmw_i3_60ah"\n')
    assert load_vehicle("bmw_i3_60ah").anchor == "published"
    assert load_vehicle(path).anchor == "class", "no test was of this car"


def test_a_quadricycle_is_a_light_car_without_climate_control() -> None:
    car = describe_car(body="quadricycle")
    assert car.climate is None
    assert car.body.curb_mass_kg == 474.0
    assert car.drivetrain.motor_max_power_w == 13_000.0
    window = car.battery.displayed_full_soc - car.battery.displayed_zero_soc
    usable_wh = car.battery.capacity_ah * window * car.battery.cells_in_series * 3.72
    assert usable_wh == pytest.approx(6100.0, rel=1e-6)
    assert describe_car(body="L7e") == car
    assert car.anchor == "class"
    assert car.title == "quadricycle"
    run = tw.simulate(PLAN, car, COLD)
    assert np.abs(run.power_by_cause_w["climate"]).max() == 0.0
    assert 60.0 < run.simulated_energy_wh / (PLAN.distance_m / 1000.0) < 130.0


def test_a_light_car_without_a_kind_of_body_is_a_quadricycle_and_one_with_a_heater_is_none() -> None:
    light = describe_car(mass_kg=500.0)
    assert light.climate is None
    assert light.body.curb_mass_kg == 500.0
    assert light.title.startswith("extrapolated from quadricycle")
    assert describe_car(body="small").climate is not None
    assert describe_car(body="quadricycle", mass_kg=560.0, usable_battery_kwh=9.0).body.curb_mass_kg == 560.0


def test_no_heat_of_the_heater_leaves_cooling_as_it_is_and_the_cabin_cold() -> None:
    usual = load_vehicle("bmw_i3_60ah")
    cold = load_vehicle("bmw_i3_60ah", overrides={"climate.heater_max_heat_w": 0.0})
    assert tw.simulate(PLAN, cold, HOT).by_cause_wh == tw.simulate(PLAN, usual, HOT).by_cause_wh
    winter = tw.simulate(PLAN, cold, COLD)
    blower_wh = usual.climate.blower_low_power_w * PLAN.duration_s / 3600.0
    defrost_wh = usual.climate.defrost_power_w * PLAN.duration_s / 3600.0
    assert blower_wh <= winter.by_cause_wh["climate"] <= blower_wh + defrost_wh
    assert winter.cabin_temperature_degc[-1] < 0.0
