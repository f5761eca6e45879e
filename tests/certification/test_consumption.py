"""Certified and simulated consumption."""

import dataclasses

import pytest
from tools.data.anchoring import WH_PER_KM, certified_figures

from tripwatt.certification.consumption import (
    CertifiedFigure,
    charging_efficiency,
    driven_wh_per_km,
    relative_error,
    simulated_wh_per_km,
    wltp_test_mass,
)
from tripwatt.certification.schedules import schedule
from tripwatt.vehicles import load_vehicle


def test_units_of_certified_figures() -> None:
    assert 27.0 * WH_PER_KM["kWh/100 mi"] == pytest.approx(27_000.0 / 160.9344)
    assert 15.5 * WH_PER_KM["kWh/100 km"] == 155.0
    assert 149.6 * WH_PER_KM["Wh/mi"] == pytest.approx(149.6 / 1.609344)


def test_charging_efficiency_is_the_mean_of_the_seven_certificates() -> None:
    seven = (0.8856, 0.8894, 0.8902, 0.8915, 0.9015, 0.9015, 0.8973)
    assert charging_efficiency() == pytest.approx(sum(seven) / 7.0)


def test_test_mass_of_the_wltp() -> None:
    # 1577 kg with a driver and 25 kg, and 15 % of the 386 kg that are left up to 1988 kg
    assert wltp_test_mass(1577.0, 1988.0) == pytest.approx(1602.0 + 57.9)
    assert wltp_test_mass(1600.0) == pytest.approx(1625.0 + 52.5)


def test_figures_of_a_car_of_the_table() -> None:
    car = load_vehicle("vw_id4_pro_2024")
    figures = certified_figures("vw_id4_pro_2024", car)
    assert [f.cycle for f in figures] == ["udds"] * 4 + ["hwfet"] * 4 + ["wltc"]
    at_battery = [f for f in figures if not f.at_wall]
    assert sorted(f.wh_per_km for f in at_battery) == pytest.approx(
        [v / 1.609344 for v in (171.8, 174.6, 204.8, 205.0)]
    )
    assert {f.test_mass_kg for f in figures} == {5000.0 * 0.45359237, 2285.0}
    # mains over range: 85.869 kWh for 443.27 mi in mode D
    assert figures[0].wh_per_km == pytest.approx(85_869.0 / 443.27 / 1.609344, rel=1e-5)
    assert not any(f.outlier for f in figures)
    assert certified_figures("no such car", car) == ()


def test_test_masses_of_wltp_figures() -> None:
    own, zoe, megane = (load_vehicle(n) for n in ("vw_id3", "renault_zoe_ze50_r135", "renault_megane_60"))
    assert {f.test_mass_kg for f in certified_figures("vw_id3", own)} == {1911.0}  # as registered
    assert certified_figures("renault_zoe_ze50_r135", zoe)[0].test_mass_kg == pytest.approx(1659.9)
    (figure,) = certified_figures("renault_megane_60", megane)
    assert figure.test_mass_kg == pytest.approx(1711.0 + 25.0 + 52.5)
    assert figure.wh_per_km == pytest.approx(0.5 * (146.0 + 173.0))


def test_the_wall_is_the_battery_over_the_charging_efficiency() -> None:
    car = load_vehicle("vw_id4_pro")
    at_wall = CertifiedFigure("hwfet", 140.0, True, 2154.6, "")
    at_battery = dataclasses.replace(at_wall, at_wall=False)
    battery = simulated_wh_per_km(car, at_battery)
    assert battery == driven_wh_per_km(car, schedule("hwfet"), 2154.6)
    assert simulated_wh_per_km(car, at_wall) == pytest.approx(battery / charging_efficiency())
    assert relative_error(car, at_battery) == pytest.approx(battery / 140.0 - 1.0)


def test_heavier_and_rougher_cars_use_more_and_the_cell_is_warm() -> None:
    car = load_vehicle("nissan_leaf_40")
    base = driven_wh_per_km(car, schedule("udds"), 1758.0)
    assert driven_wh_per_km(car, schedule("udds"), 1.1 * 1758.0) > 1.02 * base
    rough = dataclasses.replace(
        car,
        road_load=dataclasses.replace(
            car.road_load, coastdown_a_n=1.2 * float(car.road_load.coastdown_a_n or 0.0)
        ),
    )
    assert driven_wh_per_km(rough, schedule("udds"), 1758.0) > base
    assert car.climate is not None
    hot = dataclasses.replace(car, climate=dataclasses.replace(car.climate, setpoint_degc=30.0))
    assert driven_wh_per_km(hot, schedule("udds"), 1758.0) == base  # climate control is off
