"""Speeds along the road: against every way that can be driven, against the whole simulation, and how fast they are found.

Run: ``python -m benchmarks.cruise``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from tests.advice.cruise_problems import (
    CARS,
    exhaustive,
    in_the_weather,
    made_problem,
    made_road,
    simulated,
    small_problem,
)
from tools.command import run

from benchmarks.measure import Row, report, seconds
from tripwatt.advice import Cruise, CruiseProblem, followable, front, least_energy, least_total_time
from tripwatt.physics import DriveConditions
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import load_vehicle

INSTANCES = 50
LINKS = 200
ROADS = 10
SLACK = (1.02, 1.06, 1.15)
"""Time that is allowed, over that of the highest speeds."""
COLD_DEGC = -10.0
CHARGING_W = (11e3, 50e3, 150e3)


def excess(seed: int) -> float:
    """Largest relative excess of a small road's energies and times over the least ones of all ways."""
    problem = small_problem(seed)
    time, energy = exhaustive(problem)
    limits = np.random.default_rng(seed).uniform(time.min(), time.max(), 5).tolist()
    over = [least_energy(problem, t).energy_wh / energy[time <= t].min() - 1.0 for t in limits]
    for power in CHARGING_W:
        least = (time + energy / (power * WH_PER_J)).min()
        over.append(least_total_time(problem, power).total_s(power) / least - 1.0)
    return max(over)


def differences(seed: int, car: str) -> tuple[float, float]:
    """Relative differences of time and energy to the whole simulation of the same speeds, the largest of a front."""
    conditions = DriveConditions(ambient_temperature_degc=(-10.0, 5.0, 25.0)[seed % 3])
    vehicle = load_vehicle(car)
    problem = CruiseProblem.from_road(made_road(seed, LINKS), vehicle, conditions)
    pairs = [simulated(one, vehicle, conditions) for one in front(problem, 4).cruises]
    times, energies = ([abs(own[k] / whole[k] - 1.0) for whole, own in pairs] for k in (0, 1))
    return max(times), max(energies)


def loss(best: Cruise) -> float:
    """What a driver who follows the advice loses: energy and time at the price of the cruise, over its energy."""
    advice = followable(best)
    return (advice.lost_wh + best.price_w * WH_PER_J * advice.lost_s) / best.energy_wh


def rows() -> Iterator[Row]:
    """All figures."""
    yield Row(
        f"roads of 6 links, {INSTANCES}: largest excess over the best of all ways",
        max(map(excess, range(INSTANCES))),
        most=0.002,
    )
    problems = [made_problem(seed, LINKS) for seed in range(ROADS)]
    fastest = [front(problem, 2).cruises[0].duration_s for problem in problems]
    found = [
        least_energy(problem, slack * time_s)
        for problem, time_s in zip(problems, fastest, strict=True)
        for slack in SLACK
    ]
    gap = max(one.energy_wh / one.least_wh - 1.0 for one in found)
    yield Row(f"{LINKS} links: largest distance to the bound from below", gap, most=0.002)
    times, energies = zip(*(differences(seed, car) for seed in range(3) for car in CARS), strict=True)
    cold = [
        simulated(one, vehicle, conditions, None)
        for car in CARS
        for length_km in (10.0, 40.0, 200.0)
        for problem, vehicle, conditions in [in_the_weather(car, COLD_DEGC, length_km)]
        for one in front(problem, 3).cruises
    ]
    yield Row("time of a cruise against its whole simulation, largest difference", max(times), most=0.03)
    yield Row("energy of a cruise against its whole simulation, largest difference", max(energies), most=0.03)
    yield Row(
        f"the same with climate control at {COLD_DEGC:.0f} °C",
        max(abs(own[1] / whole[1] - 1.0) for whole, own in cold),
        most=0.03,
    )
    road, car, mild = made_road(0, LINKS), load_vehicle(CARS[0]), DriveConditions()
    limit_s = 1.06 * front(CruiseProblem.from_road(road, car, mild), 2).duration_s[0]
    yield Row(
        f"least energy in a time, {LINKS} links, with what each step takes",
        seconds(lambda: least_energy(CruiseProblem.from_road(road, car, mild), limit_s)),
        "s",
        most=0.15,
    )
    slowest = max(seconds(lambda one=one: least_energy(one.problem, one.limit_s), 3) for one in found)
    yield Row(f"the same from the steps, the slowest of {len(found)}", slowest, "s", most=0.15)
    yield Row("front of 20 points", seconds(lambda: front(problems[0], 20)), "s", most=2.0)
    yield Row("least time with charging", seconds(lambda: least_total_time(problems[0], 50e3)), "s")
    yield Row("one speed for each class of road", seconds(lambda: followable(found[0])), "s")
    by_price = [least_total_time(problem, power) for problem in problems for power in CHARGING_W]
    for name, bests in (("in a time", found), ("with charging", by_price)):
        lost = [loss(best) for best in bests]
        yield Row(f"lost by one speed for each class, {name}: median", float(np.median(lost)))
        yield Row(f"lost by one speed for each class, {name}: largest", max(lost))


def main() -> int:
    """Print every figure; 1 when a bound is missed."""
    return report(rows())


if __name__ == "__main__":
    run(main)
