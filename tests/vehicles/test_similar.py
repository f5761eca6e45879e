"""Cars of which only a few figures are published."""

import numpy as np
import pytest

from tripwatt.vehicles import (
    load_vehicle,
)
from tripwatt.vehicles.catalogue import SPLIT_SPEEDS_M_S, catalogue
from tripwatt.vehicles.similar import CHEMISTRIES


def test_a_car_of_the_table_by_hand() -> None:
    car = load_vehicle("vw_id4_pro")
    assert car.body.curb_mass_kg == pytest.approx((4750 - 300) * 0.45359237)
    load = car.road_load
    assert load.drag_area_m2 == pytest.approx(0.28 * 2.55)  # 0.84 of 1.852 m times 1.640 m
    for speed in SPLIT_SPEEDS_M_S:  # 23.987 lbf, 0.29124 lbf/mph, 0.016006 lbf/mph2
        force = 106.6995 + 2.89795 * speed + 0.356303 * speed**2
        split = (load.coastdown_a_n or 0.0) + (load.coastdown_b_n_s_m or 0.0) * speed
        assert split + (load.coastdown_c_n_s2_m2 or 0.0) * speed**2 == pytest.approx(force, rel=1e-4)
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
    assert mini.climate.heat_pump_max_heat_w == 5000.0  # of 2022
    plaid = load_vehicle("tesla_model_s_2021_plaid")
    assert plaid.drivetrain.motor_max_speed_rad_s == pytest.approx(240.0 / 3.6 / 0.335 * 9.5)
    spring = load_vehicle("dacia_spring")  # the motor, not the tyres, bounds the recovery
    assert spring.regeneration.max_power_w == 33_000.0
    assert spring.body.curb_mass_kg == pytest.approx(1012.0 - 75.0)


@pytest.mark.parametrize(
    ("name", "chemistry", "cells"), [("tesla_model_3_2024_rwd", "lfp", 109), ("vw_id4_pro", "nmc", 110)]
)
def test_the_chemistry_gives_voltage_and_cells(name: str, chemistry: str, cells: int) -> None:
    """350 V over 3.2 V and 400 V over 3.65 V; the usable energy is charge times the mean voltage of the shared curve."""
    car = load_vehicle(name)
    battery, cell_v = car.battery, CHEMISTRIES[chemistry][1]
    assert battery.cells_in_series == cells
    display = np.linspace(battery.displayed_zero_soc, battery.displayed_full_soc, 2001)
    mean_v = np.interp(display, battery.ocv_soc, battery.ocv_v).mean()
    assert mean_v == pytest.approx(cell_v, rel=0.005)
    usable_ah = battery.capacity_ah * (battery.displayed_full_soc - battery.displayed_zero_soc)
    usable = catalogue()[name]["usable_energy"][0].number
    assert usable_ah * cells * cell_v == pytest.approx(1000.0 * usable)
    assert battery.max_cell_voltage_v == {"lfp": 3.7, "nmc": 4.25}[chemistry]
