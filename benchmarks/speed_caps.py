"""One highest speed for all roads of a trip, against the best of all choices of one for each class of road: ``python -m benchmarks.speed_caps``.

Roads, cars and temperatures are made from a seed. Every choice is simulated as a planned route. What counts is the time in all: of the drive,
and of charging what the battery gave.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any, Final

import numpy as np
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report, seconds
from tripwatt.arrays import FloatArray
from tripwatt.forecasting.leaving import forecasts_like
from tripwatt.physics import simulate_trip
from tripwatt.roads.advice.actions import FAST_KM_H, SPEEDS_KM_H, actions
from tripwatt.trips import Departure, Plan
from tripwatt.units import M_S_PER_KM_H, WH_PER_J
from tripwatt.vehicles import load_vehicle

LIMITS_KM_H: Final = (50.0, 70.0, 100.0, 130.0, 130.0)
CARS: Final = ("vw_id3", "bmw_i3_60ah", "tesla_model_3_lr", "renault_zoe_ze50_r135", "nissan_leaf_40")
ROADS: Final = 10
LINKS: Final = 60
SAME: Final = 5
"""Links that follow each other with one limit."""
CHARGING_W: Final = np.array([11e3, 16e3, 20e3, 25e3, 50e3])


def made_road(seed: int) -> list[dict[str, Any]]:
    """Links of about a kilometre over hills."""
    rng = np.random.default_rng(seed)
    limits = np.repeat(rng.choice(LIMITS_KM_H, LINKS // SAME), SAME)
    return [
        {
            "length_m": float(rng.uniform(500.0, 1500.0)),
            "speed_m_s": float(limit) * M_S_PER_KM_H,
            "grade": float(np.clip(rng.normal(0.0, 0.015), -0.05, 0.05)),
            "stop_s": 0.0,
        }
        for limit in limits
    ]


def made_trip(seed: int, caps_km_h: Mapping[float, float]) -> Plan:
    """The trip on a made road with a highest speed for some of its limits [km/h]."""
    links = made_road(seed)
    for link in links:
        limit = round(link["speed_m_s"] / M_S_PER_KM_H)
        link["speed_m_s"] = min(limit, caps_km_h.get(limit, limit)) * M_S_PER_KM_H
    degc = float(np.random.default_rng([seed, 1]).uniform(-10.0, 30.0))
    return tw.read_route(links).with_departure(Departure(ambient_temperature_degc=degc, soc=0.9))


def in_all_s(seed: int, caps_km_h: Mapping[float, float]) -> FloatArray:
    """Time of the drive and of charging what it takes [s], for each power of charging."""
    plan = made_trip(seed, caps_km_h)
    energy_wh = simulate_trip(load_vehicle(CARS[seed % len(CARS)]), plan).simulated_energy_wh
    return plan.duration_s + energy_wh / (CHARGING_W * WH_PER_J)


def excess(seed: int) -> FloatArray:
    """Relative excess of the best highest speed for all roads over the best one for each limit, for each power of charging."""
    fast = [limit for limit in sorted({*LIMITS_KM_H}) if limit > FAST_KM_H]
    best = [
        np.min([in_all_s(seed, dict(zip(fast, caps, strict=True))) for caps in choices], axis=0)
        for choices in (zip(*[SPEEDS_KM_H] * len(fast), strict=True), product(SPEEDS_KM_H, repeat=len(fast)))
    ]
    return np.asarray(best[0] / best[1] - 1.0)


def rows() -> Iterator[Row]:
    """All figures."""
    found = np.array([excess(seed) for seed in range(ROADS)])
    for power, over in zip(CHARGING_W, found.T, strict=True):
        name = f"time with charging at {power / 1000.0:.0f} kW: largest excess over one speed for each class of road"
        yield Row(name, over.max(), most=0.002)
    forecast = tw.forecast(made_trip(0, {}))
    again = forecasts_like(forecast)
    slower = [action for action in actions(forecast) if action.code == "slower"]
    took = seconds(lambda: [again(action.apply_to(forecast.plan)) for action in slower])
    yield Row(
        f"forecasts of {len(slower)} highest speeds, {forecast.plan.distance_m / 1000.0:.0f} km",
        took,
        "s",
        most=2.0,
    )


def main() -> int:
    """Print every figure; 1 when a bound is missed."""
    return report(rows())


if __name__ == "__main__":
    run(main)
