"""Speeds along the road: against every way, tried, against the whole simulation, and by laws."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.advice.cruise_problems import (
    CARS,
    exhaustive,
    in_the_weather,
    made_problem,
    made_road,
    simulated,
    small_problem,
)

import tripwatt as tw
from tripwatt.advice import (
    CruiseProblem,
    CruiseRoad,
    cruise,
    cruise_advice,
    followable,
    front,
    least_energy,
    least_total_time,
)
from tripwatt.advice.cruise_problem import SHORTEST_M
from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.routes import LinkStyle
from tripwatt.units import WH_PER_J
from tripwatt.vehicles import load_vehicle

SEEDS = st.integers(0, 10_000)
SAMPLE = range(50)
FEW = settings(max_examples=15, deadline=None)
KM_H = 1.0 / 3.6


def level_road(lengths, speeds_km_h, **more):
    calm = np.zeros(len(lengths))
    rows = {"grade": calm, "headwind_m_s": calm, "wait_s": calm} | more
    return CruiseRoad(np.array(lengths, np.float64), np.array(speeds_km_h) * KM_H, **rows)


def problem_of(road, car="vw_id3", degc=20.0, **more):
    return CruiseProblem.from_road(
        road, load_vehicle(car), DriveConditions(ambient_temperature_degc=degc), **more
    )


@pytest.fixture(scope="module")
def mixed():
    """Town, country and motorway over hills."""
    return made_problem(2)


class TestAgainstEveryWay:
    @pytest.mark.parametrize("seed", SAMPLE)
    def test_no_way_takes_less_energy_in_the_time(self, seed):
        problem = small_problem(seed)
        time, energy = exhaustive(problem)
        assert len(time) > 300
        rng = np.random.default_rng(seed)
        for limit in (*rng.uniform(time.min(), time.max(), 3), float(rng.choice(time))):
            best = least_energy(problem, limit)
            assert best.duration_s <= limit * (1.0 + 1e-8)
            assert best.energy_wh == pytest.approx(energy[time <= limit].min(), rel=1e-8)
            assert best.least_wh <= best.energy_wh <= best.least_wh * (1.0 + 1e-7)

    @pytest.mark.parametrize("seed", SAMPLE)
    def test_no_way_takes_less_time_with_charging(self, seed):
        problem = small_problem(seed)
        time, energy = exhaustive(problem)
        for charging_w in (3e3, 20e3, 50e3, 200e3):
            least = (time + energy / (charging_w * WH_PER_J)).min()
            assert least_total_time(problem, charging_w).total_s(charging_w) == pytest.approx(least, rel=1e-9)

    @pytest.mark.parametrize("seed", SAMPLE[:10])
    def test_no_way_is_below_the_front(self, seed):
        problem = small_problem(seed)
        time, energy = exhaustive(problem)
        line = front(problem, 1000)
        on_line = np.interp(time, line.duration_s, line.energy_wh)
        assert (energy >= on_line * (1.0 - 1e-9)).all()
        assert line.duration_s[0] == pytest.approx(time.min(), rel=1e-9)
        assert line.energy_wh[-1] == pytest.approx(energy.min(), rel=1e-9)

    def test_few_labels_still_keep_to_the_time_and_give_a_bound(self, monkeypatch):
        problem = problem_of(level_road([1000.0] * 20, [130.0] * 20))
        limit = 1.06 * front(problem, 2).duration_s[0]
        most = least_energy(problem, limit)
        monkeypatch.setattr(cruise, "LABELS", 1)
        rough = least_energy(problem, limit)
        assert rough.duration_s <= limit * (1.0 + 1e-8)
        assert rough.least_wh <= most.energy_wh < rough.energy_wh <= 1.01 * most.energy_wh
        assert most.energy_wh <= 1.002 * most.least_wh


class TestAgainstTheSimulation:
    @pytest.mark.parametrize("car", CARS)
    @pytest.mark.parametrize("seed", range(3))
    def test_a_cruise_takes_what_the_simulation_of_its_speeds_takes(self, car, seed):
        conditions = DriveConditions(ambient_temperature_degc=(-10.0, 5.0, 25.0)[seed])
        vehicle = load_vehicle(car)
        problem = CruiseProblem.from_road(made_road(seed, 40), vehicle, conditions)
        for one in front(problem, 3).cruises:
            whole, own = simulated(one, vehicle, conditions)
            assert own[0] == pytest.approx(whole[0], rel=1e-3)
            assert own[1] == pytest.approx(whole[1], rel=0.015)

    @pytest.mark.parametrize(("degc", "length_km"), [(-10.0, 10.0), (-10.0, 40.0), (35.0, 40.0)])
    def test_climate_control_of_a_slower_drive_is_that_of_its_simulation(self, degc, length_km):
        problem, vehicle, conditions = in_the_weather("vw_id3", degc, length_km)
        fast, slow = front(problem, 2).cruises
        for one, most in ((fast, 0.01), (slow, 0.02)):
            whole, own = simulated(one, vehicle, conditions, None)
            assert own[1] == pytest.approx(whole[1], rel=most)
        without = slow.energy_wh - problem.fixed_wh - problem.climate_w * slow.duration_s * WH_PER_J
        assert without < 0.96 * slow.energy_wh

    @pytest.mark.parametrize("grade", [-0.005, 0.0, 0.02])
    def test_lifting_leaves_the_motor_without_work(self, grade):
        """Over the way of the lift, the mean power of a car that slows down evenly is close to its base load."""
        road = level_road([20_000.0, 20_000.0], [100.0, 70.0], grade=np.full(2, grade))
        problem = problem_of(road, floor=1.0)
        vehicle = load_vehicle("vw_id3")
        way = problem.lift_m[1, 0, 0]
        time = 2.0 * way / (170.0 * KM_H)
        samples = np.linspace(0.0, time, 200)
        warm = DriveConditions(initial_warmth=1.0)
        run = simulate(
            vehicle,
            samples,
            np.linspace(100.0, 70.0, 200) * KM_H,
            grade=np.full(200, grade),
            climate_power_w=0.0,
            conditions=warm,
        )
        kinetic_wh = 0.5 * vehicle.body.test_mass_kg * (100.0**2 - 70.0**2) * KM_H**2 * WH_PER_J
        assert abs(run.simulated_energy_wh - run.by_cause_wh["base_load"]) < 0.06 * kinetic_wh
        assert run.by_cause_wh["acceleration"] < -0.9 * kinetic_wh

    def test_a_plan_at_its_own_speeds_takes_what_its_simulation_takes(self):
        links = [
            {"length_m": length, "speed_m_s": v * KM_H, "stop_s": stop}
            for length, v, stop in [
                (1500.0, 45.0, 0.0),
                (800.0, 45.0, 15.0),
                (9000.0, 85.0, 0.0),
                (30_000.0, 115.0, 0.0),
            ]
        ]
        departure = tw.Departure(ambient_temperature_degc=-5.0, soc=0.8, wind_speed_m_s=6.0)
        plan = tw.read_route(links).with_departure(departure)
        vehicle = load_vehicle("vw_id3")
        problem = CruiseProblem.from_plan(plan, vehicle, tw.routes.route_from_links(links))
        fastest = least_total_time(problem, 1e9)
        run = simulate_trip(vehicle, plan)
        assert problem.road.length_m.sum() == pytest.approx(plan.distance_m)
        assert (problem.road.wait_s > 0.0).sum() == 1
        assert problem.road.headwind_m_s.max() > 0.0
        assert fastest.duration_s == pytest.approx(plan.duration_s, rel=0.02)
        assert fastest.energy_wh == pytest.approx(run.simulated_energy_wh, rel=0.03)
        climate_wh = problem.fixed_wh + problem.climate_w * plan.duration_s * WH_PER_J
        assert climate_wh == pytest.approx(run.by_cause_wh["climate"])
        late = run.time_s >= 0.75 * plan.duration_s
        assert problem.climate_w == pytest.approx(run.climate_power_w[late].mean(), rel=1e-3)
        assert abs(run.climate_power_w.mean() / problem.climate_w - 1.0) > 0.02
        slower = least_energy(problem, 1.15 * fastest.duration_s)
        assert slower.energy_wh < 0.9 * fastest.energy_wh


class TestLaws:
    @FEW
    @given(st.sampled_from(CARS), st.floats(-15.0, 35.0), st.floats(-0.02, 0.03), st.floats(0.0, 4000.0))
    def test_slower_never_costs_more_above_the_speed_of_least_energy(self, car, degc, grade, climate_w):
        road = level_road([50_000.0], [130.0], grade=np.full(1, grade))
        problem = replace(problem_of(road, car, degc, floor=0.15), climate_w=climate_w)
        count = (np.diff(problem.speed_m_s[1]) < 0.0).sum() + 1
        levels = np.stack([np.zeros(count, int), np.arange(count), np.zeros(count, int)], axis=1)
        energy = problem.totals(levels, np.zeros((count, 2), bool))[1]
        best = int(energy.argmin())
        assert (np.diff(energy[: best + 1]) < 0.0).all()

    @pytest.mark.parametrize("charging_w", [5e3, 15e3, 30e3])
    def test_at_the_best_speed_a_second_costs_what_it_saves(self, charging_w):
        """d(energy)/d(time) of the steady simulation is the charging power: from finite differences, to a step of speed."""
        road = level_road([200_000.0], [130.0])
        problem = problem_of(road, floor=0.3, step_m_s=1.0 * KM_H)
        speed = float(least_total_time(problem, charging_w).speed_m_s[0])
        assert 45.0 * KM_H < speed < 125.0 * KM_H

        def price(around):
            ends = np.array([around - 0.5, around + 0.5])
            times = 200_000.0 / ends
            energy = [
                simulate(
                    load_vehicle("vw_id3"), np.linspace(0.0, t, 400), np.full(400, v), climate_power_w=0.0
                ).simulated_energy_wh
                for t, v in zip(times, ends, strict=True)
            ]
            return (energy[1] - energy[0]) / (times[0] - times[1]) / WH_PER_J

        assert price(speed - 1.5 * KM_H) < charging_w < price(speed + 1.5 * KM_H)

    @FEW
    @given(SEEDS)
    def test_the_front_falls_and_is_convex_and_its_slopes_are_the_prices(self, seed):
        line = front(made_problem(seed, 20), 20)
        time, energy = line.duration_s, line.energy_wh
        assert len(time) == 20
        slope_w = np.diff(energy) / np.diff(time) / WH_PER_J
        assert (np.diff(time) > 0.0).all()
        assert (slope_w < 0.0).all()
        assert (np.diff(slope_w) > -1e-6 * np.abs(slope_w[1:])).all()
        prices = np.array([one.price_w for one in line.cruises])
        assert (prices[1:] <= -slope_w * (1.0 + 1e-6)).all()
        assert (prices[:-1] >= -slope_w * (1.0 - 1e-6)).all()

    @FEW
    @given(SEEDS, st.floats(0.5, 8.0))
    def test_a_tail_wind_never_costs(self, seed, wind):
        road = made_road(seed, 20)
        calm, behind = (
            problem_of(replace(road, headwind_m_s=np.full(20, w)), floor=0.7) for w in (0.0, -wind)
        )
        for limit in np.linspace(1.001, 1.25, 4) * front(calm, 2).duration_s[0]:
            assert least_energy(behind, limit).energy_wh < least_energy(calm, limit).energy_wh
        for charging_w in (5e3, 50e3):
            totals = [least_total_time(one, charging_w).total_s(charging_w) for one in (behind, calm)]
            assert totals[0] < totals[1]

    @FEW
    @given(SEEDS)
    def test_the_faster_the_station_the_faster_the_drive(self, seed):
        problem = made_problem(seed, 20)
        fastest = front(problem, 2).cruises[0]
        drives = [least_total_time(problem, w) for w in (1e3, 11e3, 50e3, 150e3, 1e9, np.inf)]
        times = [one.duration_s for one in drives]
        assert times == sorted(times, reverse=True)
        assert times[-1] == pytest.approx(fastest.duration_s)
        assert drives[-1].levels.max() == 0
        assert times[0] > 1.05 * times[-1]
        assert drives[0].energy_wh < drives[-1].energy_wh

    @FEW
    @given(SEEDS, st.floats(100.0, 5000.0))
    def test_power_that_flows_all_the_time_raises_the_best_speed(self, seed, more_w):
        problem = made_problem(seed, 20)
        for charging_w in (1.0, 11e3, 50e3):
            less = least_total_time(problem, charging_w)
            more = least_total_time(replace(problem, climate_w=more_w), charging_w)
            assert more.duration_s <= less.duration_s
        assert more_w < 2000.0 or more.speed_m_s.sum() > front(problem, 2).cruises[1].speed_m_s.sum()

    @FEW
    @given(SEEDS)
    def test_more_time_never_takes_more_energy_and_the_front_is_met(self, seed):
        problem = made_problem(seed, 20)
        line = front(problem, 8)
        energies = [least_energy(problem, t).energy_wh for t in line.duration_s]
        assert energies == pytest.approx(line.energy_wh, rel=1e-8)
        between = [least_energy(problem, t) for t in 0.5 * (line.duration_s[1:] + line.duration_s[:-1])]
        for one, before, after in zip(between, energies, energies[1:], strict=False):
            assert before * (1.0 + 1e-9) >= one.energy_wh >= after * (1.0 - 1e-9)
            assert one.energy_wh >= one.least_wh >= after * (1.0 - 1e-9)

    def test_the_knee_is_farthest_from_the_line_between_the_ends(self, mixed):
        line = front(mixed, 20)
        time, energy = line.duration_s, line.energy_wh
        share = (time - time[0]) / (time[-1] - time[0]) + (energy - energy[-1]) / (energy[0] - energy[-1])
        assert line.knee is line.cruises[int(share.argmin())]
        assert share.min() < 0.9


class TestRoad:
    def test_speeds_keep_to_limits_and_floors(self, mixed):
        for one in front(mixed, 5).cruises:
            highest = mixed.road.highest_m_s[mixed.road.length_m > 0.0]
            assert (one.speed_m_s <= highest + 1e-9).all()
        highest = mixed.speed_m_s[:, :1]
        below = mixed.speed_m_s.min(axis=1) < 0.7 * mixed.road.highest_m_s - 1e-9
        assert below.sum() < 0.25 * len(highest)  # where it is not reached
        assert (mixed.road.length_m[below] < 1500.0).all()
        steps = mixed.speed_m_s[:, 1:][mixed.speed_m_s[:, 1:] < highest] / (5.0 * KM_H)
        assert steps == pytest.approx(steps.round())

    def test_a_short_link_after_a_stop_has_a_speed_that_is_reached_on_its_half(self):
        problem = problem_of(level_road([200.0, 3000.0, 300.0], [100.0, 100.0, 100.0]))
        pace = LinkStyle().comfort * 2.5
        first, _, last = problem.speed_m_s[1:-1, 0]
        assert last == pytest.approx(np.sqrt(2.0 * pace * 150.0), rel=1e-2)
        assert 0.8 * np.sqrt(2.0 * pace * 100.0) < first < np.sqrt(2.0 * pace * 100.0)

    def test_every_change_of_speed_fits_into_half_of_the_faster_link(self, mixed):
        length, speed = mixed.road.length_m, mixed.speed_m_s
        count = speed.shape[1]
        node, before, after = np.nonzero(np.isfinite(mixed.step_wh[:, :, :count]))
        v, u = speed[node, before], speed[node + 1, after]
        way = np.abs(v**2 - u**2) / (2.0 * LinkStyle().comfort * 2.5)
        assert (way <= 0.5 * np.where(u > v, length[node + 1], length[node]) + 0.5).all()
        assert way.max() > 200.0
        node, before, after = np.nonzero(np.isfinite(mixed.step_wh[:, :, count:]))
        assert (speed[node, before] > speed[node + 1, after]).all()
        assert (mixed.lift_m[node, before, after] <= 0.5 * length[node]).all()

    def test_a_standstill_takes_its_time_and_the_base_load(self):
        road = level_road([3000.0, 3000.0], [70.0, 70.0], wait_s=np.array([30.0, 99.0]))
        longer = replace(road, wait_s=np.array([630.0, 0.0]))
        one, two = (least_total_time(problem_of(each), np.inf) for each in (road, longer))
        base_w = load_vehicle("vw_id3").auxiliaries.base_load_w
        assert two.duration_s - one.duration_s == pytest.approx(600.0)
        assert base_w / 6.0 < two.energy_wh - one.energy_wh < 1.15 * base_w / 6.0  # the tyres cool down

    def test_a_plan_is_cut_at_its_stops_and_its_links(self):
        links = [
            {"length_m": 2300.0, "speed_m_s": 13.0, "stop_s": 20.0},
            {"length_m": 8200.0, "speed_m_s": 25.0, "stop_s": 0.0},
        ]
        plan = tw.read_route(links)
        problem = CruiseProblem.from_plan(plan, load_vehicle("vw_id3"), tw.routes.route_from_links(links))
        road = problem.road
        inside = np.flatnonzero(road.length_m == 0.0)[1:-1]
        assert len(inside) == 1
        assert road.length_m[: inside[0]].sum() == pytest.approx(2300.0, abs=30.0)
        assert road.wait_s[inside[0]] == pytest.approx(20.0, abs=2.0)
        lengths = road.length_m[road.length_m > 0.0]
        assert lengths.min() >= SHORTEST_M
        assert lengths.max() <= 1500.0
        driven = plan.array("speed_m_s").max()
        assert road.highest_m_s.max() == pytest.approx(driven, rel=0.02)

    def test_without_links_each_piece_has_its_own_highest_speed(self):
        speed = np.repeat([15.0, 15.0, 30.0, 30.0], [200, 200, 200, 101])
        plan = tw.Plan.from_samples(
            "two", tw.trips.table_of({"time_s": np.arange(701.0), "speed_m_s": speed})
        )
        road = CruiseProblem.from_plan(plan, load_vehicle("vw_id3")).road
        assert road.highest_m_s[[1, 5, 8, -2]] == pytest.approx([15.0, 15.0, 30.0, 30.0])
        assert road.length_m[1:-2] == pytest.approx(np.full(len(road.length_m) - 3, 1000.0))

    def test_hills_and_wind_of_a_plan_are_those_of_its_links(self):
        speed = np.full(601, 25.0)
        samples = {
            "time_s": np.arange(601.0),
            "speed_m_s": speed,
            "grade": np.where(np.arange(601) < 300, 0.03, -0.01),
        }
        plan = tw.Plan.from_samples("hill", tw.trips.table_of(samples))
        plan = plan.with_weather(tw.trips.PlanWeather(np.where(np.arange(601) < 300, 4.0, -2.0)))
        road = CruiseProblem.from_plan(plan, load_vehicle("vw_id3")).road
        length = road.length_m
        assert (road.grade * length).sum() == pytest.approx(7500.0 * 0.02, rel=0.01)
        assert road.grade[1:3] == pytest.approx([0.03, 0.03])
        assert (road.headwind_m_s * length).sum() == pytest.approx(7500.0 * 2.0, rel=0.01)
        assert (road.headwind_m_s[1], road.headwind_m_s[-2]) == pytest.approx((4.0, -2.0))

    def test_a_speed_that_the_car_cannot_hold_is_left_out(self):
        road = level_road([3000.0] * 3, [130.0] * 3, grade=np.array([0.0, 0.25, 0.0]))
        problem = problem_of(road, "bmw_i3_60ah", floor=0.2)
        held = np.isfinite(problem.step_wh).any(axis=1)[1, : problem.speed_m_s.shape[1]]
        assert not held[0]
        assert held.any()
        fastest = least_total_time(problem, np.inf)
        assert fastest.speed_m_s[1] < fastest.speed_m_s[0]
        with pytest.raises(InvalidInput, match="no speeds that the car can hold"):
            least_total_time(problem_of(road, "bmw_i3_60ah", floor=1.0), 50e3)


class TestFollowable:
    def test_it_is_the_best_of_all_choices(self):
        """Two classes of road, every pair of speeds tried by itself."""
        problem = problem_of(level_road([2000.0] * 10, [100.0] * 4 + [130.0] * 6), floor=0.8)
        best = least_energy(problem, 1.05 * front(problem, 2).duration_s[0])
        advice = followable(best)
        energies = []
        for country in range(80, 101, 5):
            for motorway in range(105, 131, 5):
                speed = np.array([0.0, *[country] * 4, *[motorway] * 6, 0.0]) * KM_H
                levels = np.abs(
                    problem.speed_m_s - np.minimum(speed, problem.speed_m_s[:, 0])[:, None]
                ).argmin(axis=1)
                ramps = np.zeros(len(levels) - 1, dtype=bool)
                (time,), (energy,) = problem.totals(levels[None], ramps[None])
                if time <= best.limit_s:
                    energies.append(energy)
        assert [highest for highest, _ in advice.kept_m_s] == pytest.approx([100.0 * KM_H, 130.0 * KM_H])
        assert advice.cruise.energy_wh <= min(energies) + 1e-6
        plain = advice.cruise.problem.totals(
            advice.cruise.levels[None], np.zeros_like(advice.cruise.lifted)[None]
        )
        assert plain[1][0] == pytest.approx(min(energies))

    @FEW
    @given(SEEDS, st.floats(1.0, 1.3))
    def test_it_keeps_to_the_time_and_shows_its_loss(self, seed, slack):
        problem = made_problem(seed, 30)
        limit = slack * front(problem, 2).duration_s[0]
        best = least_energy(problem, limit)
        advice = followable(best)
        assert advice.cruise.duration_s <= limit * (1.0 + (1e-8 if slack > 1.001 else 1e-4))
        assert advice.cruise.energy_wh >= best.least_wh * (1.0 - 1e-9)
        assert advice.lost_wh == advice.cruise.energy_wh - best.energy_wh
        assert advice.lost_s == advice.cruise.duration_s - best.duration_s
        for highest, speed in advice.kept_m_s:
            assert speed / (5.0 * KM_H) == pytest.approx(round(speed / (5.0 * KM_H)))
            assert 0.65 * highest < speed < highest + 5.0 * KM_H
        links = problem.road.highest_m_s[problem.road.length_m > 0.0]
        reached = problem.speed_m_s[problem.road.length_m > 0.0, 0]
        kept = np.array([next(v for top, v in advice.kept_m_s if link <= top + 1e-9) for link in links])
        least = np.minimum(kept, reached) - 1e-9
        assert (advice.cruise.speed_m_s <= least + 2e-9).all()
        assert np.average(advice.cruise.speed_m_s >= least) > 0.6  # others have no room for a ramp
        assert advice.cruise.lifted.sum() <= cruise_advice.MOST_LIFTS

    @FEW
    @given(SEEDS, st.floats(2e3, 2e5))
    def test_it_keeps_to_the_price_of_time(self, seed, charging_w):
        best = least_total_time(made_problem(seed, 30), charging_w)
        advice = followable(best)
        assert advice.cruise.total_s(charging_w) >= best.total_s(charging_w) * (1.0 - 1e-12)
        assert advice.lost_s + advice.lost_wh / (charging_w * WH_PER_J) < 0.06 * best.total_s(charging_w)

    def test_a_link_without_room_for_the_ramp_to_the_kept_speed_is_driven_slower(self):
        """Slowly through a town, 300 m are too short to reach what is kept on the road behind."""
        problem = problem_of(level_road([3000.0, 300.0, 9000.0], [60.0, 100.0, 100.0]), floor=0.7)
        advice = followable(least_total_time(problem, 1.0))
        (_, town), (_, country) = advice.kept_m_s
        assert town < 50.0 * KM_H
        assert country == pytest.approx(70.0 * KM_H)
        speed = advice.cruise.speed_m_s
        assert speed[[0, 2]] == pytest.approx([town, country])
        assert town < speed[1] < country
        assert problem.speed_m_s[2, 0] > speed[1] + 1.0

    @pytest.mark.parametrize("seed", range(5))
    def test_every_choice_can_be_driven(self, seed):
        problem = made_problem(seed)
        highest, speeds, levels = cruise_advice._one_for_each_class(problem)
        time, energy = problem.totals(levels, np.zeros((len(levels), levels.shape[1] - 1), dtype=bool))
        assert np.isfinite(energy).all()
        assert len(np.unique(speeds, axis=0)) == len(speeds)
        assert len(highest) == speeds.shape[1]
        fastest = least_total_time(problem, np.inf)
        assert time.min() == pytest.approx(
            fastest.duration_s, rel=1e-4
        )  # lifting uphill is quicker than a ramp

    def test_on_an_even_road_it_loses_nothing(self):
        problem = problem_of(level_road([5000.0] * 8, [130.0] * 8))
        best = least_total_time(problem, 12e3)
        advice = followable(best)
        assert len(advice.kept_m_s) == 1
        assert advice.lost_wh == pytest.approx(0.0, abs=1e-6)
        assert advice.cruise.speed_m_s == pytest.approx(np.full(8, advice.kept_m_s[0][1]))

    def test_lifting_before_a_town_pays_when_time_is_cheap(self):
        problem = problem_of(level_road([4000.0, 2000.0], [70.0, 50.0]), floor=1.0)
        cheap, dear = least_total_time(problem, 1.0), least_total_time(problem, 1e6)
        assert cheap.lifted.tolist() == [False, True, True]  # before the town and before the end
        assert not dear.lifted.any()
        assert cheap.energy_wh < dear.energy_wh
        assert cheap.lift_at_m == pytest.approx(
            [4000.0 - problem.lift_m[1, 0, 0], 6000.0 - problem.lift_m[2, 0, 0]]
        )
        assert 100.0 < problem.lift_m[1, 0, 0] < 1500.0
        assert followable(cheap).cruise.lift_at_m == pytest.approx(cheap.lift_at_m)

    def test_a_loaded_car_rolls_farther(self):
        """Air drag alone does not grow with the mass."""
        road, car = level_road([9000.0, 9000.0], [120.0, 70.0]), load_vehicle("vw_id3")
        light, heavy = (
            CruiseProblem.from_road(road, car, DriveConditions(payload_mass_kg=kg), floor=1.0).lift_m[1, 0, 0]
            for kg in (0.0, 400.0)
        )
        assert 1.05 * light < heavy < (1.0 + 400.0 / car.body.test_mass_kg) * light

    def test_of_many_places_to_lift_those_that_save_most_are_told(self):
        """Towns of different limits: every choice of as many places, tried."""
        towns = (50.0, 45.0, 60.0, 48.0, 55.0, 65.0, 52.0, 58.0, 62.0, 46.0, 54.0)
        limits = [*(limit for town in towns for limit in (70.0, town)), 70.0]
        problem = problem_of(level_road([3000.0] * len(limits), limits), floor=1.0)
        best = least_total_time(problem, 500.0)
        places = np.flatnonzero(best.lifted)
        assert len(places) > cruise_advice.MOST_LIFTS
        every = itertools.combinations(places, cruise_advice.MOST_LIFTS)
        lifted = np.array([np.isin(np.arange(len(best.lifted)), chosen) for chosen in every])
        time, energy = problem.totals(np.tile(best.levels, (len(lifted), 1)), lifted)
        told = followable(best).cruise
        assert told.lifted.sum() == cruise_advice.MOST_LIFTS
        least = (energy + 500.0 * WH_PER_J * time).min()
        assert told.energy_wh + 500.0 * WH_PER_J * told.duration_s == pytest.approx(least, rel=1e-9)


class TestFaults:
    def test_a_time_that_is_too_short(self, mixed):
        fastest = front(mixed, 2).duration_s[0]
        assert least_energy(mixed, fastest).duration_s == pytest.approx(fastest)
        with pytest.raises(InvalidInput, match="no speeds are fast enough"):
            least_energy(mixed, 0.99 * fastest)
        with pytest.raises(InvalidInput, match="no speeds are fast enough"):
            least_energy(mixed, float("nan"))

    def test_a_time_without_need_gives_the_least_energy(self, mixed):
        slowest = front(mixed, 2).cruises[1]
        found = least_energy(mixed, 10.0 * slowest.duration_s)
        assert (found.energy_wh, found.duration_s) == (slowest.energy_wh, slowest.duration_s)

    @pytest.mark.parametrize("charging_w", [0.0, -1.0, float("nan")])
    def test_a_power_that_is_none(self, mixed, charging_w):
        with pytest.raises(InvalidInput, match="charging power"):
            least_total_time(mixed, charging_w)

    @pytest.mark.parametrize("rule", [{"floor": 0.0}, {"floor": 1.1}, {"step_m_s": 0.0}, {"step_m_s": 20.0}])
    def test_rules_out_of_bounds(self, rule):
        with pytest.raises(InvalidInput, match="rule of speeds"):
            problem_of(level_road([3000.0], [70.0]), **rule)

    def test_a_road_with_one_speed_has_a_front_of_one_cruise(self):
        problem = problem_of(level_road([3000.0, 3000.0], [70.0, 70.0]), floor=1.0)
        line = front(problem, 20)
        assert len(line.cruises) <= 3
        assert line.knee in line.cruises
