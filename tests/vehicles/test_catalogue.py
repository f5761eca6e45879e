"""The table of cars, its search, the cars that it describes, and how well each is known."""

import re

import numpy as np
import pytest
from tests.support import ROOT
from tests.support.cars import some_cars

from tripwatt.errors import InvalidInput
from tripwatt.hybrid.parameters import PARAMETERS, on_road, parameters_of
from tripwatt.vehicles import (
    find_vehicles,
    load_vehicle,
    render_vehicle,
    require_vehicle,
    vehicle_names,
    vehicle_titles,
)
from tripwatt.vehicles.anchors import Anchor, anchors, with_anchor
from tripwatt.vehicles.catalogue import BODIES, Coastdown, catalogue, class_values, table_names
from tripwatt.vehicles.licences import LICENCES
from tripwatt.vehicles.loading import library_document
from tripwatt.vehicles.similar import CHEMISTRIES
from tripwatt.vehicles.spreads import loss_sd, road_gain, spreads
from tripwatt.vehicles.vehicle import ANCHORS

NUMBERS = {
    "test_weight": (2000.0, 9000.0, "lb"),
    "coastdown_a": (10.0, 70.0, "lbf"),
    "coastdown_b": (-0.5, 1.0, "lbf/mph"),
    "coastdown_c": (0.005, 0.04, "lbf/mph2"),
    "udds": (14.0, 45.0, "kWh/100 mi"),
    "hwfet": (17.0, 45.0, "kWh/100 mi"),
    "udds_battery": (140.0, 200.0, "Wh/mi"),
    "hwfet_battery": (150.0, 220.0, "Wh/mi"),
    "wltc": (10.0, 30.0, "kWh/100 km"),
    "usable_energy": (10.0, 140.0, "kWh"),
    "motor_power": (30.0, 800.0, "kW"),
    "pack_voltage": (200.0, 950.0, "V"),
    "year_first": (2018.0, 2026.0, "year"),
    "running_mass": (900.0, 2700.0, "kg"),
    "charging_efficiency": (0.8, 0.95, "1"),
}


def test_every_cell_has_a_value_in_range_a_unit_a_source_and_a_licence() -> None:
    for name, row in catalogue().items():
        for key, cells in row.items():
            for cell in cells:
                where = f"{name}, {key}"
                assert cell.value, where
                assert cell.source, where
                assert cell.licence in LICENCES, where
                if key in NUMBERS:
                    low, high, unit = NUMBERS[key]
                    assert low <= cell.number <= high, where
                    assert cell.unit == unit, where


def test_titles_have_energy_and_years_and_are_unique() -> None:
    titles = vehicle_titles()
    assert len(set(titles.values())) == len(titles) == len(vehicle_names())
    for name in table_names():
        row = catalogue()[name]
        energy = row["usable_energy"][0].number
        assert f"{energy:g} kWh" in titles[name]
        first, last = (int(row[key][0].value) for key in ("year_first", "year_last"))
        assert titles[name].endswith(f"({first})" if first == last else f"({first}-{last})")
        assert row["body"][0].value in BODIES
        assert row["confirmed"][0].value in ("0", "1")
    assert sum(int(catalogue()[n]["year_last"][0].value) >= 2019 for n in table_names()) >= 60


def test_no_figure_of_a_source_for_checking_only_is_shipped() -> None:
    sources = {c.source for row in catalogue().values() for cells in row.values() for c in cells}
    assert not [s for s in sources if "VCA" in s or "open-ev-data-dataset" in s or "eco-route" in s]


def test_coastdown_in_si_units() -> None:
    run = Coastdown.from_row(catalogue()["vw_id4_pro"])
    assert run.a_n == pytest.approx(23.987 * 4.4482216)
    assert run.b_n_s_m == pytest.approx(0.29124 * 4.4482216 / 0.44704)
    assert run.c_n_s2_m2 == pytest.approx(0.016006 * 4.4482216 / 0.44704**2)
    assert run.mass_kg == pytest.approx(4750 * 0.45359237)
    assert run.drag_area_m2 == pytest.approx(2.0 * run.c_n_s2_m2 / 1.167)
    assert run.weight_n == pytest.approx(run.mass_kg * 9.80665)
    assert run.force_n(10.0) == pytest.approx(run.a_n + 10.0 * run.b_n_s_m + 100.0 * run.c_n_s2_m2)
    assert run.force_n(10.0, 0.0) == pytest.approx(run.a_n + 10.0 * run.b_n_s_m)


def test_values_of_a_class_are_medians_without_the_cars_that_are_left_out() -> None:
    usual = class_values()
    measured = [n for n in table_names() if "coastdown_a" in catalogue()[n]]
    assert usual.cars == len(measured)
    one = class_values(measured[:3])
    assert one.cars == usual.cars - 3
    areas = sorted(
        Coastdown.from_row(catalogue()[n]).drag_area_m2
        for n in measured
        if catalogue()[n]["body"][0].value == "small"
    )
    assert len(areas) == 3
    assert usual.drag_area_m2["small"] == areas[1]
    assert usual.drag_area_m2["van"] == pytest.approx(1.15 * usual.drag_area_m2["suv"])
    assert 0.005 < usual.rolling < 0.012
    assert 0.03 <= usual.drag_area_sd < usual.rolling_sd < 0.3


def test_a_car_of_the_table_by_hand() -> None:
    car = load_vehicle("vw_id4_pro")
    assert car.body.curb_mass_kg == pytest.approx((4750 - 300) * 0.45359237)
    assert car.road_load.coastdown_a_n == pytest.approx(106.6998, abs=0.01)
    assert car.drivetrain.motor_max_torque_nm == pytest.approx(150_000.0 / 420.0)
    # 150 kW over 2018.5 kg are 74 W/kg: 160 km/h
    assert car.drivetrain.motor_max_speed_rad_s == pytest.approx(160.0 / 3.6 / 0.345 * 9.5)
    assert car.regeneration.max_torque_nm == pytest.approx(2.0 * 2093.5 * 0.345 / 9.5, rel=1e-4)
    assert car.regeneration.max_power_w == pytest.approx(45.0 * 2093.5, rel=1e-4)
    assert car.battery.cells_in_series == 110  # 400 V at 3.65 V
    assert car.battery.capacity_ah == pytest.approx(77_000.0 / (110 * 3.72) / 0.94)
    assert car.battery.heat_capacity_j_k == pytest.approx(6.2 * 77_000.0)
    assert car.climate is not None
    assert car.climate.heat_pump_max_heat_w == 0.0
    mini = load_vehicle("mini_cooper_se")  # 135 kW over 1451 kg: 93 W/kg, 200 km/h
    assert mini.drivetrain.motor_max_speed_rad_s == pytest.approx(200.0 / 3.6 / 0.295 * 9.5)
    assert mini.climate is not None
    assert mini.climate.heat_pump_max_heat_w == 2500.0
    plaid = load_vehicle("tesla_model_s_2021_plaid")
    assert plaid.drivetrain.motor_max_speed_rad_s == pytest.approx(240.0 / 3.6 / 0.335 * 9.5)
    spring = load_vehicle("dacia_spring")  # the motor, not the tyres, bounds the recovery
    assert spring.regeneration.max_power_w == 33_000.0
    assert spring.body.curb_mass_kg == pytest.approx(1012.0 - 75.0)


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("kona", "hyundai_kona_64"),
        ("model 3 2022", "tesla_model_3_2022_rwd"),
        ("MODEL3 2024", "tesla_model_3_2024_rwd"),
        ("ë-c4", "citroen_e_c4"),
        ("id4 awd", "vw_id4_awd_pro"),
        ("2025 ex30 18", "volvo_ex30_er"),
    ],
)
def test_words_find_cars(words: str, first: str) -> None:
    assert find_vehicles(words)[0] == first


def test_a_search_holds_every_word_and_a_year_has_to_be_one_of_the_car() -> None:
    assert find_vehicles("") == find_vehicles(" - ") == find_vehicles("kona tesla") == ()
    assert "tesla_model_3_2024_rwd" not in find_vehicles("model 3 2023")
    assert "tesla_model_3_2022_rwd" in find_vehicles("model 3 2023")
    assert "tesla_model_s_2021_lr" not in find_vehicles("model 3")
    assert all("Model 3" in vehicle_titles()[n] for n in find_vehicles("model 3"))


def test_an_unknown_car_is_named_with_those_that_are_meant() -> None:
    require_vehicle("vw_id3")
    with pytest.raises(InvalidInput, match="did you mean 'vw_id4_pro'") as error:
        load_vehicle("vw_id4")
    assert len(str(error.value)) < 300  # not the whole library
    with pytest.raises(InvalidInput, match=r"path of a \.toml file"):
        require_vehicle("zzz")


def test_anchors_take_the_place_of_entries() -> None:
    anchor = Anchor("road_load", "gear", {"drivetrain.gearbox_efficiency": (0.95, "1")}, -0.1)
    document = with_anchor({"name": "x", "drivetrain": {"gear_ratio": 1}}, anchor)
    assert document["anchor"] == "road_load"
    assert document["drivetrain"]["gear_ratio"] == 1
    assert document["drivetrain"]["gearbox_efficiency"]["value"] == 0.95
    assert "-10.0 %" in document["drivetrain"]["gearbox_efficiency"]["estimated"].replace("%", " %")
    assert with_anchor({"name": "x"}, None) == {"name": "x"}
    assert "anchor" not in library_document("vw_id4_pro")
    assert {a.level for a in anchors().values()} == {"road_load", "certification", "class"}
    assert all(a.entries for a in anchors().values())


def test_an_unknown_anchor_is_a_fault(tmp_path) -> None:
    path = tmp_path / "car.toml"
    text = render_vehicle(load_vehicle("vw_id4_pro"))
    path.write_text(text.replace('anchor = "road_load"', 'anchor = "rode_load"'), encoding="utf-8")
    with pytest.raises(InvalidInput, match="did you mean 'road_load'"):
        load_vehicle(path)


@pytest.mark.parametrize("name", some_cars(6))
def test_a_written_car_is_read_back(name: str, tmp_path) -> None:
    car = load_vehicle(name)
    path = tmp_path / f"{name}.toml"
    path.write_text(render_vehicle(car), encoding="utf-8")
    again = load_vehicle(path)
    assert again == car
    assert again.entries == car.entries


def test_the_better_a_car_is_known_the_narrower() -> None:
    assert set(ANCHORS) == {"published", "road_load", "certification", "class", "road"}
    levels = [spreads(level) for level in ("road_load", "certification", "class")]
    for name in ("rolling", "air", "drivetrain"):
        values = [level[name] for level in levels]
        assert values == sorted(values)
        assert values[0] < values[2]
    assert spreads("published") == spreads("road") == road_gain("published") == road_gain("road") == {}
    # tyres 15 % and the gain's 5 %; trim 5 % and the gain's 5 %; 2 % twice over a share of 13 %
    assert levels[0]["rolling"] == pytest.approx((0.15**2 + 0.05**2) ** 0.5)
    assert levels[0]["air"] == pytest.approx((2 * 0.05**2) ** 0.5)
    assert levels[0]["drivetrain"] == pytest.approx((2 * 0.02**2) ** 0.5 / 0.13)
    classes = class_values()
    half = (0.15**2 + 0.05**2 + 0.5 * classes.rolling_sd**2) ** 0.5
    assert levels[1]["rolling"] == pytest.approx(half)
    assert levels[2]["air"] == pytest.approx((2 * 0.05**2 + classes.drag_area_sd**2) ** 0.5)
    assert levels[2]["drivetrain"] == pytest.approx((0.02**2 + loss_sd() ** 2) ** 0.5 / 0.13)


def test_parameters_have_the_widths_of_the_car() -> None:
    assert parameters_of(load_vehicle("bmw_i3_60ah")) == PARAMETERS
    found = {p.name: p for p in parameters_of(load_vehicle("vw_id4_pro"))}
    usual = {p.name: p for p in PARAMETERS}
    assert found["mass"] == usual["mass"]
    assert found["air"].width == spreads("road_load")["air"]
    assert found["air"].keys == usual["air"].keys
    assert "coast-down" in found["air"].source


def test_on_the_road_an_anchored_car_has_more_drag_once() -> None:
    car = load_vehicle("vw_id4_pro")
    road = on_road(car)
    assert road.road_load.drag_area_m2 == pytest.approx(1.02 * car.road_load.drag_area_m2)
    assert road.road_load.coastdown_a_n == pytest.approx(1.02 * float(car.road_load.coastdown_a_n or 0.0))
    assert road.body == car.body
    assert road.anchor == "road"
    assert on_road(road) is road
    book = load_vehicle("bmw_i3_60ah")
    assert on_road(book) is book


def test_the_page_of_the_cars_shows_the_spreads() -> None:
    """The rows of the anchors in docs/reference/vehicles.md, in percent."""
    page = (ROOT / "docs" / "reference" / "vehicles.md").read_text(encoding="utf-8")
    published = {p.name: p.width for p in PARAMETERS}
    for anchor in ("road_load", "certification", "class", "published"):
        widths = {**published, **spreads(anchor)}
        shown = " | ".join(f"{100.0 * widths[name]:.0f} %" for name in ("rolling", "air", "drivetrain"))
        assert re.search(rf"^\| `{anchor}` \|.*\| {re.escape(shown)} \|$", page, re.MULTILINE), anchor


@pytest.mark.parametrize(
    ("name", "chemistry", "cells"), [("tesla_model_3_2024_rwd", "lfp", 109), ("vw_id4_pro", "nmc", 110)]
)
def test_the_chemistry_gives_voltage_and_cells(name: str, chemistry: str, cells: int) -> None:
    """350 V over 3.2 V and 400 V over 3.65 V; the usable energy is charge times the mean voltage of the shared curve."""
    car = load_vehicle(name)
    battery, kind = car.battery, CHEMISTRIES[chemistry]
    assert battery.cells_in_series == cells
    display = np.linspace(battery.displayed_zero_soc, battery.displayed_full_soc, 2001)
    mean_v = np.interp(display, battery.ocv_soc, battery.ocv_v).mean()
    assert mean_v == pytest.approx(kind.mean_v, rel=0.005)
    usable_ah = battery.capacity_ah * (battery.displayed_full_soc - battery.displayed_zero_soc)
    usable = catalogue()[name]["usable_energy"][0].number
    assert usable_ah * cells * kind.mean_v == pytest.approx(1000.0 * usable)
    assert battery.max_cell_voltage_v == {"lfp": 3.7, "nmc": 4.25}[chemistry]
