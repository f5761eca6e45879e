"""Cars at a steady speed against road tests: `python -m benchmarks.steady --write`.

`tools/data/steady_tests.csv` has the consumption of cars on a motorway, driven out and back at a constant speed by GPS (github.com/tbtp-ev, MIT
License; bmwi3owner.com, 2014). Each is simulated twice, as the driven trace and as a planned route of one link of the same mean speed: a warm
car of the tested mass, a flat road and calm air. The tests name a season and no temperature (`SEASON_DEGC`). Between testers and days one car
differs by about 5 %. These tests were in sight when the losses at speed were chosen, so that the figures are development figures; whoever
has other tests gives their file: `--tests FILE`. `--write` renews the table of docs/reference/library.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import pandas as pd
from tools import ROOT
from tools.command import run
from tools.docs import pages
from typer import Option

import tripwatt as tw
from benchmarks.measure import Row
from tripwatt.hybrid.parameters import on_road
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.trips import Departure
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_names

TESTS: Final = ROOT / "tools" / "data" / "steady_tests.csv"
SEASON_DEGC: Final = {"summer": 18.0, "spring": 10.0, "winter": -3.0}
"""About the middle of what the source says: summer 12 to 22 °C, winter -8 to 3 °C. The test of the BMW i3 was in March."""
SPEEDS_KM_H: Final = (90.0, 110.0, 130.0)
AMBIENT_DEGC: Final = (20.0, 0.0, -10.0)
POINTS: Final = tuple((speed, ambient) for ambient in AMBIENT_DEGC for speed in SPEEDS_KM_H)
DURATION_S: Final = 600.0
"""Short, so that the smallest battery is not empty at the highest speed."""
LENGTH_M: Final = 100_000.0
SOC: Final = 0.9
WARM_DEGC: Final = 15.0
"""A battery after some time on the motorway is at least as warm as this."""
WAYS: Final = ("driven", "planned")
TEST_SD: Final = 0.05
"""Relative standard deviation of a test between testers and days, as its source says."""


@dataclass(frozen=True, slots=True)
class RoadTest:
    """A road test beside the simulation of both ways [Wh/km]."""

    car: str
    season: str
    speed_km_h: float
    tested: float
    driven: float
    planned: float

    def error(self, way: str) -> float:
        """Simulated over tested, less one."""
        return float(getattr(self, way)) / self.tested - 1.0


def steady(vehicle: Vehicle, speed_km_h: float, ambient_degc: float) -> float:
    """Consumption of some minutes at a constant speed, warm car, climate control on [Wh/km]."""
    time = np.arange(0.0, DURATION_S + 1.0, 10.0)
    warm = None if vehicle.climate is None else vehicle.climate.setpoint_degc
    conditions = DriveConditions(
        ambient_temperature_degc=ambient_degc,
        initial_battery_temperature_degc=max(ambient_degc, WARM_DEGC),
        initial_cabin_temperature_degc=warm,
        initial_soc=SOC,
        initial_warmth=1.0,
    )
    driven = simulate(vehicle, time, np.full_like(time, speed_km_h * M_S_PER_KM_H), conditions=conditions)
    return driven.simulated_energy_wh / (speed_km_h * DURATION_S / SECONDS_PER_HOUR)


def planned(vehicle: Vehicle, speed_km_h: float, ambient_degc: float) -> float:
    """Consumption of a planned route of one link with a mean speed, warm car, climate control on [Wh/km]."""
    plan = tw.read_route([{"length_m": LENGTH_M, "speed_m_s": speed_km_h * M_S_PER_KM_H}])
    departure = Departure(
        ambient_temperature_degc=ambient_degc,
        soc=SOC,
        warmth=1.0,
        cabin_temperature_degc=None if vehicle.climate is None else vehicle.climate.setpoint_degc,
        battery_temperature_degc=max(ambient_degc, WARM_DEGC),
    )
    return simulate_trip(vehicle, plan.with_departure(departure)).simulated_energy_wh / (LENGTH_M / 1000.0)


def compute(tests: Path = TESTS) -> list[RoadTest]:
    """Every test of a file with columns `car, season, speed_km_h, energy_wh_per_km, weight_kg`, simulated with the car as on the road."""
    found = []
    table: Any = pd.read_csv(tests)
    for row in table.itertuples():
        car = on_road(load_vehicle(row.car))
        if not np.isnan(row.weight_kg):
            curb_kg = float(row.weight_kg) - car.body.driver_mass_kg
            car = replace(car, body=replace(car.body, curb_mass_kg=curb_kg))
        point = (car, float(row.speed_km_h), SEASON_DEGC[row.season])
        both = steady(*point), planned(*point)
        found.append(RoadTest(row.car, row.season, point[1], float(row.energy_wh_per_km), *both))
    return found


def rise(tests: Sequence[RoadTest], way: str) -> float:
    """Rise of the consumption from the slowest to the fastest test of a car and season over the tested one, mean over these."""
    ratios = []
    for key in dict.fromkeys((test.car, test.season) for test in tests):
        same = sorted((t for t in tests if (t.car, t.season) == key), key=lambda t: t.speed_km_h)
        if len(same) > 1:
            first, last = same[0], same[-1]
            ratios.append((getattr(last, way) - getattr(first, way)) / (last.tested - first.tested))
    return float(np.mean(ratios))


def rise_error(tests: Sequence[RoadTest]) -> float:
    """Standard error of that mean by `TEST_SD` of each test alone: a perfect simulation would miss 1 by this."""
    of_car: list[float] = []
    for key in dict.fromkeys((test.car, test.season) for test in tests):
        same = [t.tested for t in tests if (t.car, t.season) == key]
        if len(same) > 1:
            of_car.append(TEST_SD * float(np.hypot(max(same), min(same))) / (max(same) - min(same)))
    return float(np.sqrt(np.sum(np.square(of_car)))) / len(of_car)


def bars(tests: Path = TESTS) -> Iterator[Row]:
    """Mean, root mean square and rise of both ways."""
    found = compute(tests)
    for way in WAYS:
        errors = np.array([test.error(way) for test in found])
        yield Row(
            f"steady speed, {way}: mean error of {len(found)} road tests",
            errors.mean(),
            least=-0.04,
            most=0.04,
        )
        yield Row(f"steady speed, {way}: root mean square", float(np.sqrt(np.mean(errors**2))), most=0.09)
        yield Row(f"steady speed, {way}: rise over the tested one", rise(found, way), least=0.95, most=1.05)


def render(tests: Sequence[RoadTest]) -> str:
    """Markdown: each test, and the mean over all."""
    lines = [
        "| car | season | km/h | tested | driven trace | error | planned link | error |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| `{t.car}` | {t.season} | {t.speed_km_h:.0f} | {t.tested:.0f} | {t.driven:.0f} | {t.error('driven'):+.0%} "
        f"| {t.planned:.0f} | {t.error('planned'):+.0%} |"
        for t in tests
    ]
    for way, name in zip(WAYS, ("driven traces", "planned links"), strict=True):
        errors = np.array([test.error(way) for test in tests])
        lines.append(
            f"\nOf {name}: mean error {errors.mean():+.1%}, root mean square {np.sqrt(np.mean(errors**2)):.1%}; the rise from the slowest to the "
            f"fastest test of a car is {rise(tests, way):.2f} times the tested one; the scatter of the tests alone is a standard error of "
            f"{rise_error(tests):.2f}."
        )
    return "\n".join(lines)


def render_cars() -> str:
    """Markdown: the nine points of every car of the library as on the road, by title."""
    head = " | ".join(f"{speed:.0f} km/h, {ambient:.0f} °C" for speed, ambient in POINTS)
    lines = [f"| car | name | {head} |", "|---|---|" + "---:|" * len(POINTS)]
    cars = sorted((load_vehicle(name) for name in vehicle_names()), key=lambda car: (car.title, car.name))
    for car in cars:
        points = " | ".join(f"{steady(on_road(car), *point):.0f}" for point in POINTS)
        lines.append(f"| {car.title} | `{car.name}` | {points} |")
    return "\n".join(lines)


def main(write: bool = False, tests: Annotated[Path, Option()] = TESTS) -> None:
    """Print the tests of a file and every car. `--write` renews the table of docs/reference/library.md."""
    print(f"{render(compute(tests))}\n\n{render_cars()}")
    if write:
        pages.renew("reference/library.md", "steady", render(compute()))


if __name__ == "__main__":
    run(main)
