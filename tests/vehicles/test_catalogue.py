"""The table of cars, its search, the cars that it describes, and how well each is known."""

import pytest

from tripwatt.vehicles import (
    LICENCES,
    vehicle_names,
    vehicle_titles,
)
from tripwatt.vehicles.catalogue import BODIES, Coastdown, catalogue, class_values, table_names
from tripwatt.vehicles.loading import file_names

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
    one = class_values(frozenset(measured[:3]))
    assert one.cars == usual.cars - 3
    areas = sorted(
        Coastdown.of_parts(catalogue()[n]).drag_area_m2
        for n in measured
        if catalogue()[n]["body"][0].value == "small"
    )
    assert len(areas) == 3
    assert usual.drag_area_m2["small"] == areas[1]
    assert usual.drag_area_m2["van"] == pytest.approx(1.15 * usual.drag_area_m2["suv"])
    assert 0.005 < usual.rolling < 0.012
    assert 0.03 <= usual.drag_area_sd < usual.rolling_sd < 0.3


def test_a_car_has_a_file_or_a_row_and_not_both() -> None:
    """A file of the name of a row would hide the row without a word."""
    assert set(file_names()) & set(table_names()) == set()
