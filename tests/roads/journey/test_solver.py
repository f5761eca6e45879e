"""The least time over a road with stations: against every plan, tried, and by laws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.roads.journey.stop_problems import exhaustive, made_problem

from tripwatt.roads.journey.solver import MIN_CHARGE_S, MIN_GAIN_SOC, _best_charging, joint_chance, least_time

SAMPLE = range(24)
"""Seeds of the gate; `python -m benchmarks.stops` tries 500."""


def best_s(problem):
    plan = least_time(problem)
    return float("inf") if plan is None else plan.duration_s


def test_the_sample_has_roads_with_and_without_a_plan_and_with_several_stops():
    plans = [least_time(made_problem(seed)) for seed in SAMPLE]
    stops = [len(plan.nodes) - 2 for plan in plans if plan is not None]
    assert sum(plan is None for plan in plans) >= 1
    assert sum(count >= 2 for count in stops) >= 5


@pytest.mark.parametrize("stations", [None, 4])
@pytest.mark.parametrize("seed", SAMPLE)
def test_no_plan_that_is_tried_takes_less_time_and_the_plan_keeps_the_needs_of_its_legs(seed, stations):
    problem = made_problem(seed, stations, paused=stations is not None)
    assert best_s(problem) == pytest.approx(exhaustive(problem), rel=1e-12)
    plan = least_time(problem)
    if plan is None:
        return
    assert list(plan.nodes) == sorted(set(plan.nodes))
    for here, there, level in zip(plan.nodes[:-1], plan.nodes[1:], plan.levels, strict=True):
        assert level >= problem.need[here, there]


@pytest.mark.parametrize("seed", SAMPLE)
def test_more_charge_is_never_slower_and_more_reserve_never_faster(seed):
    problem = made_problem(seed)
    least = best_s(problem)
    for more in (0.001, 0.013, 0.1):
        fuller = replace(problem, start_soc=min(problem.start_soc + more, 1.0))
        assert best_s(fuller) <= least + 1e-6
        assert best_s(replace(problem, need=problem.need + more)) >= least - 1e-6


@pytest.mark.parametrize("seed", SAMPLE)
def test_all_stations_are_at_least_as_good_as_some_of_them(seed):
    problem = made_problem(seed)
    keep = np.unique(
        [0, *np.random.default_rng(seed).integers(0, len(problem.taken), 8), len(problem.taken) - 1]
    )
    assert best_s(problem.among(keep)) >= best_s(problem) - 1e-6


def test_faster_stations_and_shorter_stops_are_never_slower():
    for seed in SAMPLE:
        problem = made_problem(seed)
        assert best_s(replace(problem, charging_s=0.8 * problem.charging_s)) <= best_s(problem)
        assert best_s(replace(problem, overhead_s=0.0)) <= best_s(problem)


@pytest.mark.parametrize("share", [0.0, 0.4, 0.8, 0.95])
def test_the_chance_of_all_legs_is_that_of_draws_with_a_shared_error(share):
    rng = np.random.default_rng(3)
    draws = 200_000
    common = rng.normal(size=(draws, 1))
    errors = share * common + np.sqrt(1.0 - share**2) * rng.normal(size=(draws, 4))
    limits = np.array([1.7, 2.0, 1.8, 2.4])
    chances = (errors <= limits).mean(axis=0)
    held = float((errors <= limits).all(axis=1).mean())
    assert joint_chance(chances, np.full(4, share)) == pytest.approx(held, abs=0.003)
    assert float(chances.prod()) - 0.003 <= held <= float(chances.min())


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 500.0)), min_size=1, max_size=6))
def test_a_level_at_a_station_takes_the_least_time_of_all_ways_to_it(ways):
    levels, charging_s = np.linspace(0.0, 1.0, 11), 1000.0 * np.linspace(0.0, 1.0, 11) ** 2
    arrival, total = np.array(ways).T
    charging = np.maximum(charging_s - np.interp(arrival, levels, charging_s)[:, None], MIN_CHARGE_S)
    charging = np.where(levels - MIN_GAIN_SOC >= arrival[:, None], charging, 1e9)
    least, chosen = _best_charging(arrival, total, levels, charging_s, MIN_CHARGE_S)
    reached = np.isfinite(least)
    assert reached.tolist() == (arrival.min() <= levels - MIN_GAIN_SOC).tolist()
    assert least[reached] == pytest.approx((total[:, None] + charging).min(axis=0)[reached], abs=1e-9)
    assert (total + charging.T)[range(11), chosen][reached] == pytest.approx(least[reached], abs=1e-9)
