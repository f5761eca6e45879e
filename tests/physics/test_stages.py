"""What `benchmarks.stages` compares: the shaft of a simulation, and means of bins."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from benchmarks.stages import (
    base_loads,
    by_speed,
    climate_power,
    energy_per_charge,
    shaft_power_w,
    trip_errors,
)

from tripwatt.physics import simulate
from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.losses import motor_loss

CAR = load_vehicle("bmw_i3_60ah")


def test_the_shaft_and_its_loss_are_the_power_of_the_drive():
    time = np.arange(240.0)
    speed = 12.0 + 8.0 * np.sin(time / 20.0)
    run = simulate(CAR, time, speed)
    shaft = shaft_power_w(CAR, run)
    mean_speed = np.concatenate((speed[:1], 0.5 * (speed[1:] + speed[:-1])))
    per_m = CAR.drivetrain.gear_ratio / CAR.drivetrain.wheel_radius_m
    loss = motor_loss(shaft / (mean_speed * per_m), mean_speed * per_m, CAR.drivetrain)
    assert (shaft < -1000.0).any()
    assert (shaft > 1000.0).any()
    useful = run.motor_power_w != 0.0
    np.testing.assert_allclose((shaft + loss)[useful], run.motor_power_w[useful], rtol=1e-9, atol=1e-6)


ROWS = pd.DataFrame(
    {
        "trip": ["a", "a", "b", "b"],
        "season": ["warm", "warm", "cold", "cold"],
        "speed_m_s": [0.0, 10.0, 10.0, 12.0],
        "torque_nm": [0.0, 20.0, 1.0, 40.0],
        "shaft": [0.0, 3000.0, 2000.0, 4000.0],
        "shaft_simulated": [0.0, 3300.0, 1500.0, 3000.0],
        "less_climate": [400.0, 3500.0, 700.0, 5000.0],
        "climate": [20.0, 400.0, 0.0, 1500.0],
        "climate_simulated": [0.0, 210.0, 1000.0, 2000.0],
        "battery": [420.0, 3900.0, 700.0, 6500.0],
        "battery_simulated": [300.0, 4020.0, 1800.0, 7200.0],
        "voltage_simulated": [350.0, 350.0, 360.0, 340.0],
        "current_a": [1.0, 11.0, 2.0, 18.0],
        "soc": [0.8, 0.799, 0.7, 0.698],
        "step_s": [1.0, 1.0, 1.0, 1.0],
    }
)


def test_bins_compare_means():
    table = by_speed(ROWS, "shaft").set_index(["season", "speed"])
    row = table.loc[("cold", "30 to 50 km/h")]
    assert (row["measured"], row["simulated"], row["seconds"]) == (3000.0, 2250.0, 2)
    assert row["difference"] == pytest.approx(-0.25)
    climate = climate_power(ROWS).set_index("season")["difference"]
    assert climate["cold"] == pytest.approx(1.0)  # 1,500 W for 750 W
    assert climate["warm"] == pytest.approx(-0.5)  # 105 W for 210 W


def test_base_load_is_that_of_standing_and_of_coasting_seconds():
    table = base_loads(ROWS.assign(base_w=320.0), 380.0).set_index(["state", "season", "climate control"])
    assert table["simulated"].to_dict() == {
        ("standing", "warm", "any"): 320.0,
        ("standing", "warm", "off"): 320.0,
        ("coasting", "cold", "any"): 700.0,
        ("coasting", "cold", "off"): 700.0,
    }
    assert table["difference"].tolist() == pytest.approx([-0.2, -0.2, 0.0, 0.0])
    assert table["measured"].to_dict() == {
        ("standing", "warm", "any"): 400.0,
        ("standing", "warm", "off"): 400.0,
        ("coasting", "cold", "any"): 700.0,
        ("coasting", "cold", "off"): 700.0,
    }


def test_trips_and_charge():
    errors = trip_errors(ROWS).set_index("season")
    assert errors.loc["warm", "bias"] == pytest.approx(4320.0 / 4320.0 - 1.0, abs=1e-12)
    assert errors.loc["cold", "mean error"] == pytest.approx(9000.0 / 7200.0 - 1.0)
    charge = energy_per_charge(ROWS).set_index("season")
    # 7,200 W s of 0.2 % of the charge: 2 Wh of 0.002
    assert charge.loc["cold", "measured"] == pytest.approx(7200.0 / 3600.0 / 0.002 / 1000.0)
    assert charge.loc["cold", "simulated"] == pytest.approx(
        (360.0 * 2 + 340.0 * 18) / 3600.0 / 0.002 / 1000.0
    )
