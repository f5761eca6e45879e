"""Roads that are made from a seed, every way along one, tried, and the whole simulation of a cruise."""

from dataclasses import replace

import numpy as np

from tripwatt.advice import CruiseProblem, CruiseRoad
from tripwatt.physics import DriveConditions, conditions_at_departure, simulate
from tripwatt.routes import LinkStyle, plan_from_links, route_from_links
from tripwatt.routes.driver import speed_profile
from tripwatt.trips import Departure
from tripwatt.vehicles import load_vehicle

LIMITS_M_S = np.array([50.0, 70.0, 100.0, 130.0, 130.0]) / 3.6
CARS = ("vw_id3", "bmw_i3_60ah", "tesla_model_3_lr", "renault_zoe_ze50_r135", "nissan_leaf_40")


def made_road(seed, links, same=5):
    """Limits that stay for some links, hills, wind, and a standstill at the end of some links."""
    rng = np.random.default_rng(seed)
    grade = np.clip(np.repeat(rng.normal(0.0, 0.015, links // 2 + 1), 2)[:links], -0.05, 0.05)
    return CruiseRoad(
        rng.uniform(500.0, 1500.0, links),
        np.repeat(rng.choice(LIMITS_M_S, links // same + 1), same)[:links],
        grade,
        rng.normal(0.0, 2.0, links),
        np.where(rng.random(links) < 0.05, 20.0, 0.0),
    )


def made_problem(seed, links=60, same=5, **more):
    """A made road with a car and a temperature from the seed."""
    rng = np.random.default_rng([seed, 1])
    conditions = DriveConditions(ambient_temperature_degc=float(rng.uniform(-10.0, 30.0)))
    car = load_vehicle(CARS[int(rng.integers(len(CARS)))])
    return CruiseProblem.from_road(made_road(seed, links, same), car, conditions, **more)


def small_problem(seed):
    """Six links of which each has its own limit, few speeds, and climate control."""
    problem = made_problem(seed, links=6, same=1, floor=0.45, step_m_s=10.0 / 3.6)
    power = float(np.random.default_rng([seed, 2]).uniform(0.0, 3000.0))
    return replace(problem, climate_w=power, fixed_wh=100.0)


def in_the_weather(car, degc, length_km):
    """A plan over links of three speeds with climate control: the problem, the car and the conditions."""
    speeds = np.sort(
        np.random.default_rng(int(length_km)).choice([14.0, 26.0, 33.0], max(int(length_km / 2.0), 4))
    )
    length_m = 1000.0 * length_km / len(speeds)
    links = [{"length_m": length_m, "speed_m_s": float(v), "stop_s": 0.0} for v in speeds]
    departure = Departure(ambient_temperature_degc=degc, soc=0.9)
    plan, vehicle = plan_from_links(route_from_links(links)).with_departure(departure), load_vehicle(car)
    conditions = conditions_at_departure(vehicle, departure)
    return CruiseProblem.from_plan(plan, vehicle), vehicle, conditions


def exhaustive(problem):
    """Time and energy of every way along the road that is possible."""
    ways = {0: (np.zeros(1), np.full(1, problem.fixed_wh))}
    count = problem.speed_m_s.shape[1]
    for step_s, step_wh in zip(problem.step_s, problem.step_wh, strict=True):
        grown = {}
        for level, (time, energy) in ways.items():
            for step in np.flatnonzero(np.isfinite(step_wh[level])):
                more = time + step_s[level, step], energy + step_wh[level, step]
                grown.setdefault(int(step) % count, []).append(more)
        ways = {level: tuple(map(np.concatenate, zip(*parts, strict=True))) for level, parts in grown.items()}
    time, energy = ways[0]
    return time, energy + problem.climate_w * time / 3600.0


def simulated(cruise, vehicle, conditions, climate_w=0.0):
    """Time [s] and energy [Wh] of the whole simulation of a cruise without lifting, and of the cruise itself; None = climate control by its model."""
    nodes = cruise.problem.road
    moves = nodes.length_m > 0.0
    last_link = np.cumsum(moves) - 1
    stops = np.flatnonzero(~moves)[1:-1]
    wait = np.zeros(int(moves.sum()))
    wait[last_link[stops]] = nodes.wait_s[stops]
    style = LinkStyle()
    driver = replace(
        style.driver,
        acceleration_m_s2=style.comfort * style.driver.acceleration_m_s2,
        deceleration_m_s2=style.comfort * style.driver.deceleration_m_s2,
        speed_share=1.0,
    )
    profile = speed_profile(nodes.length_m[moves], cruise.speed_m_s, dwell_s=wait, style=driver, step_s=0.5)
    run = simulate(
        vehicle,
        profile.time_s,
        profile.speed_m_s,
        grade=nodes.grade[moves][profile.link],
        headwind_m_s=nodes.headwind_m_s[moves][profile.link],
        climate_power_w=climate_w,
        conditions=conditions,
    )
    (time,), (energy,) = cruise.problem.totals(cruise.levels[None], np.zeros_like(cruise.lifted)[None])
    return (float(profile.time_s[-1]), run.simulated_energy_wh), (float(time), float(energy))
