"""Units by positions, odometer and the temperature of the battery."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tripwatt.sources.columnar import open_table
from tripwatt.sources.scales import Distances, air_unit_of, distances_of, speed_unit_of

FACTORS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704}


@pytest.mark.parametrize("assumed", FACTORS)
@pytest.mark.parametrize("true", FACTORS)
def test_positions_give_the_unit_of_the_speed(tmp_path: Path, assumed: str, true: str) -> None:
    degrees = assumed != true  # as degrees and minutes
    time = np.arange(600.0)
    speed = 14.0 + 4.0 * np.sin(time / 20.0)
    way = np.cumsum(speed)
    north, east = 48.0 + 0.6 * way / 111_195.0, 11.0 + 0.8 * way / 111_195.0 / np.cos(np.radians(48.0))
    spelled = [f"{int(x)} {60 * (x - int(x)):.5f}" if degrees else f"{x:.7f}" for x in (*north, *east)]
    pd.DataFrame({"Lat": spelled[:600], "Long": spelled[600:]}).to_csv(tmp_path / "a.csv", index=False)
    distances = distances_of(
        open_table(tmp_path / "a.csv", faults=[]), time, speed / FACTORS[true] * FACTORS[assumed]
    )
    assert speed_unit_of(assumed, [distances]) == true


def test_an_odometer_needs_twenty_kilometres() -> None:
    assert speed_unit_of("km/h", [Distances(0.0, 0.0, 12_000.0, 19_300.0)]) == "km/h"
    assert speed_unit_of("km/h", [Distances(0.0, 0.0, 13_000.0, 20_900.0)]) == "mph"


@pytest.mark.parametrize("air", [-15.0, 0.0, 12.0, 30.0])
@pytest.mark.parametrize("battery_above", [0.0, 6.0])
def test_air_is_nearer_to_the_battery_in_its_own_unit(air: float, battery_above: float) -> None:
    celsius = air + np.linspace(-3.0, 8.0, 50)
    battery = [celsius + battery_above]
    assert air_unit_of("degc", [celsius], battery) == "degc"
    assert air_unit_of("degf", [celsius * 1.8 + 32.0], battery) == "degf"
    if air >= 0.0:
        assert air_unit_of("degc", [celsius * 1.8 + 32.0], battery) == "degf"
