"""The standard deviation of a difference by hand: one part after the other, and all of them together."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tripwatt.forecasting.difference import Shared, sd_between
from tripwatt.uncertainty.scale import TotalScale

SCALE = TotalScale(np.array([30.0, 40.0, 0.02, 0.5]))
ONE = Shared(
    hours=1.0,
    moved_wh=5000.0,
    net_wh=4000.0,
    weights_wh=np.array([10.0, -20.0]),
    outside_wh=50.0,
    state_wh=30.0,
    route_wh=60.0,
    links_wh=100.0,
    climb_wh=80.0,
    climate_wh=500.0,
    distance_m=20_000.0,
)


def between(scale: TotalScale = SCALE, causes_wh: tuple[float, ...] = (), **changed: Any) -> float:
    return sd_between(ONE, replace(ONE, **changed), scale, causes_wh)


@pytest.mark.parametrize(
    ("changed", "parts"),
    [
        ({}, []),
        ({"hours": 1.5}, [40.0 * 0.5, 0.54 * 100.0]),
        ({"hours": 0.5, "links_wh": 120.0}, [40.0 * 0.5, 0.54 * 120.0]),
        ({"moved_wh": 6000.0}, [0.02 * 1000.0]),
        ({"weights_wh": np.array([40.0, 20.0])}, [0.5 * 50.0]),
        ({"outside_wh": 130.0}, [120.0]),
        ({"state_wh": 45.0}, [15.0]),
        ({"climate_wh": 250.0}, [0.5 * 30.0]),
        ({"climate_wh": 1000.0, "state_wh": 40.0}, [0.5 * 40.0]),
        ({"route_wh": 25.0}, [35.0]),
        ({"climb_wh": 70.0}, [10.0]),
        ({"distance_m": 20_030.0, "climb_wh": 70.0}, [10.0]),
        ({"distance_m": 20_050.0}, [60.0, 60.0, 80.0, 80.0]),
        ({"distance_m": 19_000.0, "hours": 0.9}, [60.0, 60.0, 80.0, 80.0, 40.0 * 0.1]),
    ],
)
def test_what_two_forecasts_share_cancels(changed: dict[str, Any], parts: list[float]) -> None:
    assert between(**changed) == pytest.approx(math.hypot(*parts))


def test_the_corrector_leaves_a_fifth_of_what_the_causes_change() -> None:
    assert between(causes_wh=(300.0, -400.0)) == pytest.approx(0.2 * 500.0)
    more = between(causes_wh=(300.0, -400.0), weights_wh=np.array([250.0, -20.0]))
    assert more == pytest.approx(0.5 * 240.0)


def test_the_growth_with_the_energy_is_at_least_its_share() -> None:
    least = replace(SCALE, least_share=0.1)
    assert between(least, moved_wh=6000.0) == pytest.approx(0.1 * 1000.0)
    assert between(replace(SCALE, least_share=0.01), moved_wh=6000.0) == pytest.approx(0.02 * 1000.0)


def test_little_climate_control_counts_by_the_watt_hour() -> None:
    small, other = replace(ONE, climate_wh=0.2), replace(ONE, climate_wh=0.7)
    assert sd_between(small, other, SCALE, ()) == pytest.approx(0.5 * 30.0)
