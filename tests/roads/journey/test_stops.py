"""Charging stops of a journey."""

import datetime as dt
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.absurd import contradictions, journeys
from benchmarks.stops import chances
from tests.roads.journey.made import COLD, MADE, A, B, journey

import tripwatt as tw
from tripwatt.command.sentences import journey_in_words
from tripwatt.forecasting.leaving import leaving_with
from tripwatt.population import for_car
from tripwatt.roads.journey import Place, RoadForecast, RoadForecaster, planning, plans
from tripwatt.roads.journey import corridor as corridor_module
from tripwatt.roads.journey.charging import WARM_DEGC
from tripwatt.roads.journey.corridor import Corridor, Leg
from tripwatt.roads.journey.solver import StopPlan, StopProblem
from tripwatt.roads.journey.stops import SAME_TIME_S, variance_along
from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.roads.maps.stations import Plug, Station
from tripwatt.trips.showing import period

WRONG_PLAN = {
    "soc_interval": [0.2, 0.3],
    "soc_arrival": 0.4,
    "p_reserve": 0.9,
    "p_arrive": 0.8,
    "course": {"displayed_soc": [0.5], "time_s": [0.0]},
    "duration_s": 600.0,
    "charging_s": 0.0,
}
FAR = Place(47.0, 11.2, "Far")
LOW = replace(COLD, soc=0.7)
SUNDAY = dt.datetime(2026, 2, 1, 7, 30, tzinfo=dt.UTC)


def row(count, far=11.2, power_w=100_000.0):
    """Stations along the road, one of three a little beside it."""
    return tuple(
        Station(
            47.0 + 0.004 * (k % 3),
            9.0 + (far - 9.0) * (k + 1) / (count + 1),
            f"S{k}",
            power_w,
            direct_current=True,
        )
        for k in range(count)
    )


@pytest.fixture(scope="module")
def long_journey(model):
    return journey(
        model, tw.Departure(soc=0.8, ambient_temperature_degc=12.0), (A, FAR), replace(MADE, stations=row(14))
    )


def test_a_stop_to_charge_where_the_charge_does_not_suffice(model):
    found = journey(model, LOW)
    plan = found.charging
    (stop,) = plan.stops
    assert stop.station.name == "Halbweg"
    assert 0.1 <= stop.soc_interval[0] < stop.soc_arrival < stop.soc_interval[1] < 0.7
    assert stop.soc_arrival < stop.soc_leave <= 1.0
    assert plan.p_reserve >= 0.95
    assert plan.p_reserve <= stop.p_reach <= 1.0
    assert plan.p_arrive >= plan.p_reserve
    assert 600.0 < stop.charging_s < 7200.0
    assert plan.duration_s == pytest.approx(plan.driving_s + stop.charging_s + 300.0)
    assert stop.if_full is None
    assert [flag.code for flag in found.flags] == [
        "class_charging_curve",
        "plugs_unknown",
        "cold_charging_assumed",
    ]


def test_a_slower_station_takes_longer_and_the_better_one_is_taken(model):
    slow = Station(47.0, 9.41, "Langsam", 12_000.0, direct_current=True)
    off = Station(47.1, 9.4, "Abseits", 300_000.0, direct_current=True)  # 11 km from the road
    both = replace(MADE, stations=(slow, *MADE.stations, off))
    found = journey(model, LOW, atlas=both).charging
    assert [stop.station.name for stop in found.stops] == ["Halbweg"]
    assert found.stops[0].if_full.station.name == "Langsam"
    assert found.stops[0].if_full.more_s > 0.0
    words = f" If it is occupied: Langsam, {period(found.stops[0].if_full.more_s)} more."
    assert words in found.stops[0].in_words()
    alone = journey(model, LOW, atlas=replace(MADE, stations=(slow,))).charging
    assert alone.charging_s > found.charging_s + 200.0
    # where no station beside the road helps, those farther away do
    alone, far = (
        journey(model, LOW, atlas=replace(MADE, stations=(one,)))
        for one in (off, Station(47.3, 9.4, "Weit", 300_000.0, direct_current=True))
    )
    assert ([stop.station.name for stop in alone.charging.stops], far.charging) == (["Abseits"], None)


@pytest.mark.parametrize(("soc", "first"), [(0.08, "Hier"), (0.7, "Halbweg")])
def test_who_leaves_below_the_reserve_charges_at_the_next_station(model, soc, first):
    here = Station(47.0, 9.005, "Hier", 50_000.0, direct_current=True)  # 400 m from the start
    atlas = replace(MADE, stations=(here, *MADE.stations))
    assert journey(model, replace(LOW, soc=soc), atlas=atlas).charging.stops[0].station.name == first


def test_without_stations_it_is_said_that_none_are_known(model):
    found = journey(model, LOW, atlas=replace(MADE, stations=()))
    assert [flag.code for flag in found.flags] == ["no_stations"]


def test_a_long_journey_has_several_stops_and_the_verdict_is_about_all_of_it(long_journey):
    plan, verdict = long_journey.charging, long_journey.verdict
    assert len(plan.stops) >= 2
    assert not long_journey.forecast.p_arrive(0.1) >= 0.95
    assert (verdict.arrives, verdict.advice, verdict.charges) == (True, "stop", len(plan.stops))
    assert (verdict.p_reserve, verdict.soc_arrival) == (plan.p_reserve, plan.soc_arrival)
    assert verdict.duration_s == pytest.approx(verdict.driving_s + verdict.charging_s)
    assert plan.p_reserve <= min(stop.p_reach for stop in plan.stops)
    assert verdict.arrives_at is None
    assert long_journey.to_dict()["p_arrive"] == plan.p_reserve


def test_the_course_has_a_jump_for_each_stop(long_journey):
    plan = long_journey.charging
    course = {name: np.array(values) for name, values in plan.to_dict()["course"].items()}
    jumps = np.flatnonzero(np.diff(course["position_m"]) < 1e-6)
    assert len(jumps) == len(plan.stops)
    for k, stop in zip(jumps, plan.stops, strict=True):
        assert course["position_m"][k] == pytest.approx(stop.position_m, rel=1e-3)
        assert course["time_s"][k] == pytest.approx(stop.arrives_after_s, abs=2.0 * (len(plan.stops) + 1))
        assert course["time_s"][k + 1] - course["time_s"][k] == pytest.approx(
            stop.charging_s + stop.overhead_s
        )
        assert course["displayed_soc"][k] == pytest.approx(stop.soc_arrival, abs=1e-6)
        assert course["displayed_soc"][k + 1] == pytest.approx(stop.soc_leave, abs=0.005)
    assert np.all(np.diff(course["time_s"]) >= 0.0)
    assert course["time_s"][-1] == pytest.approx(plan.duration_s, abs=20.0)
    assert np.all(course["low"] <= course["high"])
    assert plan.line["position_m"][-1] == pytest.approx(plan.distance_m)
    assert sum(plan.by_cause_wh.values()) == pytest.approx(plan.energy_wh)


def test_stops_are_counted_from_the_departure(long_journey):
    plan, (begins, *_) = long_journey.charging, long_journey.charging.series().to_dict("records")
    assert (begins["time_s"], begins["distance_m"], begins["energy_wh"]) == (0.0, 0.0, 0.0)
    after_s = position_m = 0.0
    for leg, stop in zip(plan.legs, plan.stops, strict=False):
        after_s, position_m = after_s + leg.forecast.plan.duration_s, position_m + leg.road.distance_m
        assert stop.arrives_after_s == pytest.approx(after_s, abs=1e-6)
        assert stop.position_m == pytest.approx(position_m, abs=1e-6)
        after_s += stop.charging_s + stop.overhead_s


def test_errors_of_energy_add_up_over_legs_between_independent_and_common_ones(long_journey):
    plan = long_journey.charging
    series = plan.series()
    above = (series["energy_high_wh"] - series["energy_wh"]).to_numpy()
    legs = np.array([leg.forecast.interval(0.9)[1] - leg.forecast.energy_wh for leg in plan.legs])
    assert np.sqrt((legs**2).sum()) < above[-1] < legs.sum()
    assert plan.energy_interval_wh[1] == pytest.approx(plan.energy_wh + above[-1])
    assert np.all(np.diff(above) > -1e-6)


def test_costs_are_those_of_all_legs(model, long_journey):
    legs = long_journey.charging.legs
    off = tw.Departure(climate="off")
    without = sum(model.forecast(leg.forecast.plan, off).energy_wh for leg in legs)
    driven = sum(leg.forecast.energy_wh for leg in legs)
    assert long_journey.costs_wh["climate"] == pytest.approx(driven - without)
    assert long_journey.costs_wh["speed"] > 0.0
    assert long_journey.costs_wh["wind"] == 0.0


def test_alternatives_are_better_in_what_they_are_called(long_journey):
    fastest = long_journey.charging
    for plan in long_journey.charging_alternatives:
        assert plan.p_reserve >= 0.95
        gains = {
            "fewest stops": len(fastest.stops) - len(plan.stops),
            "safest": plan.p_reserve - fastest.p_reserve,
            "cheapest": fastest.energy_wh - plan.energy_wh,
        }
        assert gains[plan.label] > 0
    assert "safest" in [plan.label for plan in long_journey.charging_alternatives]


def test_a_longer_stop_overhead_never_means_more_stops_and_the_clock_counts_it(model, long_journey):
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=12.0, departs_at=SUNDAY)
    atlas = replace(MADE, stations=row(14))
    slow = journey(model, departure, (A, FAR), atlas, stop_overhead_s=1800.0)
    assert len(slow.charging.stops) <= len(long_journey.charging.stops)
    verdict = slow.verdict
    assert (verdict.arrives_at - verdict.departs_at).total_seconds() == pytest.approx(verdict.duration_s)
    assert verdict.to_dict()["arrives_at"].startswith("2026-02-01T")
    # a leg leaves after the charging before it, since its weather is that of the hour
    leaves = [leg.forecast.plan.departure.departs_at for leg in slow.charging.legs[1:]]
    elapsed = [stop.arrives_after_s + stop.more_s for stop in slow.charging.stops]
    assert [(at - SUNDAY).total_seconds() for at in leaves] == pytest.approx(elapsed, abs=300.0)


def test_a_heated_battery_charges_faster_and_takes_its_energy(model):
    cold = replace(COLD, soc=0.8, ambient_temperature_degc=-10.0)
    atlas = replace(MADE, stations=row(9, 9.8, 150_000.0))
    plain = journey(model, cold, atlas=atlas).charging
    heated = journey(model, cold, atlas=atlas, preheat_battery=True).charging
    assert not any(stop.preheat for stop in plain.stops)
    assert any(stop.preheat for stop in heated.stops)
    assert heated.duration_s < plain.duration_s
    assert sum(leg.energy_wh - leg.forecast.energy_wh for leg in heated.legs) > 100.0


def test_stated_chances_hold_in_a_world_that_gave_them_no_width():
    leg, whole = chances(draws=2000, worlds=1, trips=60)
    assert abs(leg) <= 0.02
    assert abs(whole) <= 0.02


def test_the_whole_chance_is_close_to_what_it_has_to_be_where_charge_limits_it(model, long_journey):
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=12.0)
    fewer = journey(model, departure, (A, FAR), replace(MADE, stations=row(9)))
    for plan in (*long_journey.charging_plans, *fewer.charging_plans):
        if plan.label != "safest":
            assert 0.95 <= plan.p_reserve <= 0.97
    assert long_journey.charging_plans[0].label == fewer.charging_plans[0].label == "fastest"


def test_a_start_that_reaches_no_station_surely_has_the_plan_that_does_best(model):
    near, far = (
        Station(47.0, 9.0 + at, name, 1e5, direct_current=True) for at, name in ((0.4, "Nah"), (0.5, "Fern"))
    )
    found = journey(model, replace(COLD, soc=0.55), atlas=replace(MADE, stations=(near, far)))
    plan = found.charging
    assert (plan.label, plan.stops[0].station.name, found.charging_alternatives) == ("best effort", "Nah", ())
    assert found.forecast.p_arrive(0.1) < plan.p_reserve <= plan.stops[0].p_reach < 0.95
    assert (found.verdict.arrives, found.verdict.p_reserve) == (False, plan.p_reserve)
    assert found.verdict.advice != "stop"
    assert found.flags[0].code == "no_stop_found"
    # more charge at the start makes it a plan that arrives
    needed = found.soc_needed_with_stops
    assert 0.55 < needed < 0.75
    assert found.verdict.advice == "charge_before"
    told = f"With stops to charge, leave with at least {math.ceil(100.0 * needed)} %"
    assert [one.startswith(told) for one in journey_in_words(found)].count(True) == 1
    charged = journey(model, replace(COLD, soc=needed + 0.01), atlas=replace(MADE, stations=(near, far)))
    assert (charged.verdict.arrives, charged.soc_needed_with_stops) == (True, None)
    assert len(charged.charging.stops) == len(plan.stops)
    # who will strand is not sent off: the charge alone is said
    lower = journey(model, replace(COLD, soc=0.3), atlas=replace(MADE, stations=(near, far)))
    assert (lower.charging, lower.verdict.advice) == (None, "charge_before")
    assert lower.soc_needed_with_stops == pytest.approx(needed, abs=0.02)
    assert lower.soc_needed > 1.0


def test_more_charge_is_never_worse_around_the_reserve(model):
    """One who has the reserve and cannot keep it to the station is told as much as one who leaves with less."""
    at = replace(
        MADE, stations=tuple(Station(47.0, 9.0 + k, "", 1e5, direct_current=True) for k in (0.06, 0.4))
    )
    found = [
        journey(model, replace(COLD, soc=soc), atlas=at, alternatives=1)
        for soc in (0.03, 0.07, 0.09, 0.1, 0.11, 0.15, 0.2, 0.3)
    ]
    chances = [min(each.verdict.p_arrive, 0.95) for each in found]  # plans of more are as fast as can be
    assert chances == sorted(chances)
    assert chances[1] < 0.5 < chances[3] < chances[4] < 0.95
    assert [each.charging is not None for each in found] == [chance >= 0.5 for chance in chances]


def test_who_has_the_charge_to_leave_with_arrives_and_who_arrives_was_not_told_more(model):
    """Legs of a small battery at -30 °C are estimated too high from the long road; they are routed before a charge is told."""
    car = for_car(model, "smart_eq_fortwo")
    for far, count, enough in ((9.5, 3, 0.5), (9.75, 2, 0.79)):
        slow = (replace(each, direct_current=False) for each in row(count, far=far, power_w=2.2e4))
        leaving = [replace(COLD, ambient_temperature_degc=-30.0, soc=soc) for soc in (0.03, 0.1, 0.2, enough)]
        at, to = replace(MADE, stations=tuple(slow)), replace(FAR, longitude_deg=far)
        *low, last = (journey(car, each, (A, to), at) for each in leaving)
        assert last.arrives
        told = [each.soc_needed_with_stops for each in low]
        assert max(told) - min(told) < 0.01
        assert max(told) <= enough


def test_a_certain_plan_comes_before_one_that_is_more_likely_to_arrive_at_all():
    """Chances are rounded to compare plans, but not past the chance that a journey has to have."""
    certain, other = (SimpleNamespace(p_reserve=p, p_arrive=q) for p, q in ((0.9501, 0.96), (0.9499, 0.99)))
    assert max(other, certain, key=plans._by_chance) is certain
    other.p_reserve, certain.p_reserve = 0.9, 0.899
    assert max(certain, other, key=plans._by_chance) is other


def test_no_charge_makes_up_for_later_legs_that_are_too_unsure():
    doubtful = SimpleNamespace(legs=(None,), leg_chances=(0.99, 0.97, 0.97))
    assert plans._first_need(doubtful) is None
    doubtful.leg_chances = (0.99, 0.9502)  # the first leg would need the chance of 0.9998
    assert plans._first_need(doubtful) is None


def test_a_plan_of_best_effort_is_as_fast_as_others_to_within_a_stop():
    """A tenth of the display that is missing does not hide minutes in the tolerance of the search."""
    problem = StopProblem(0.1, *np.full((2, 2, 2), 0.2), np.ones((2, 2)), np.ones((2, 2)), 0.0, np.zeros(2))
    cost_s = corridor_module._problem_for_label(problem, plans.BEST_EFFORT).time_s[0, 1] - 1.0
    assert 3600.0 < cost_s < SAME_TIME_S / corridor_module._TOLERANCE


def test_stations_without_a_plug_of_the_car_are_left_out(model):
    chademo = Station.with_plugs(47.0, 9.4, "Halbweg", Plug("chademo", 1e5))
    plugs = Plug("type2_combo", 5e4, power_known=False), Plug("chademo", 1e5)
    beside = Station.with_plugs(47.0, 9.41, "Daneben", *plugs)
    found = journey(model, LOW, atlas=replace(MADE, stations=(chademo, beside)))
    assert [stop.station.name for stop in found.charging.stops] == ["Daneben"]
    assert found.charging.stops[0].if_full is None
    codes = [flag.code for flag in found.flags]
    assert "plugs_assumed" in codes
    assert "plugs_unknown" not in codes
    assert "station_power_assumed" in codes
    used = found.charging.to_dict()["stops"][0]["station"]
    assert (used["plug"], used["power_w"], used["power_known"]) == ("type2_combo", 5e4, False)
    leaf = journey(tw.for_car(model, "nissan_leaf_40"), LOW, atlas=replace(MADE, stations=(beside,)))
    assert (leaf.charging.stops[0].station.plug, leaf.charging.stops[0].station.power_w) == ("chademo", 1e5)
    assert "station_power_assumed" not in [flag.code for flag in leaf.flags]
    told = [next(filter(re.compile("^Charge").match, journey_in_words(one))) for one in (found, leaf)]
    assert "at Daneben (CCS, 50 kW assumed) after" in told[0]
    assert "at Daneben (CHAdeMO, 100 kW) after" in told[1]
    assert journey(model, LOW, atlas=replace(MADE, stations=(chademo,))).charging is None


def test_a_stop_is_needed_only_below_the_charge_that_reaches_the_next(long_journey):
    """With this charge, the next leg keeps the reserve as surely as the plan asks of each leg; with less charge, it is less sure."""
    for plan in long_journey.charging_plans:
        for stop, leg in zip(plan.stops, plan.legs[1:], strict=True):
            less, surely = (leg.leaving_with(stop.needed_below + d).chance(0.1) for d in (-0.02, 0.0))
            assert 0.95 <= surely <= min(plan.leg_chances[1:]) + 0.005
            assert less < surely
            assert 0.1 < stop.needed_below <= stop.soc_leave + 0.01
            assert stop.to_dict()["needed_below"] == stop.needed_below


@pytest.mark.parametrize("soc", [0.93, 0.8, 0.7])
def test_roads_are_compared_with_the_time_and_energy_of_their_stops(model, soc):
    found = journey(model, replace(COLD, soc=soc), alternatives=1)
    wholes = [road.whole(0.1) for road in found.roads]
    assert found.charging is wholes[0]
    least_s = min(plan.duration_s for plan in wholes)
    assert wholes[0].duration_s <= least_s + 300.0 * bool(wholes[0].stops)
    fastest, least = (
        next(plan for plan, road in zip(wholes, found.roads, strict=True) if label in road.labels)
        for label in ("fastest", "least energy")
    )
    assert (fastest.duration_s, least.energy_wh) == (least_s, min(plan.energy_wh for plan in wholes))
    for road, plan, told in zip(found.roads, wholes, found.to_dict()["roads"], strict=True):
        assert bool(plan.stops) == (road.charging is not None)
        assert plan.duration_s == pytest.approx(plan.driving_s + plan.charging_s)
        assert told["whole"] == {
            "charges": len(plan.stops),
            "duration_s": plan.duration_s,
            "energy_wh": plan.energy_wh,
            "soc_arrival": plan.soc_arrival,
            "p_reserve": plan.p_reserve,
        }
        charging = told["charging"] or {"stops": [], "duration_s": plan.driving_s}
        assert len(charging["stops"]) == told["whole"]["charges"]
        assert charging["duration_s"] == told["whole"]["duration_s"]
    frame = found.to_frame()
    assert frame["duration_s"].tolist()[-1] == wholes[1].duration_s
    assert frame["labels"].tolist()[-1] == ", ".join(found.roads[1].labels)


def test_the_first_road_has_the_fewest_stops_of_those_as_fast_and_is_never_dominated():
    """Plans by time [s], stops, energy [Wh] and chance, and the order of their roads."""
    rng, chances = np.random.default_rng(7), [(0.5, 0.7), (0.5, 0.9), (0.96, 0.99)]
    for _ in range(3000):
        n = int(rng.integers(1, 5))
        plans = [
            SimpleNamespace(
                duration_s=60.0 * s, stops=(0,) * c, energy_wh=100.0 * wh, p_reserve=p, p_arrive=q
            )
            for s, c, wh, (p, q) in zip(*rng.integers(0, 9, (3, n)), rng.choice(chances, n), strict=True)
        ]
        order = planning._order(plans, True)
        assert sorted(order) == list(range(n))
        first, others = plans[order[0]], [plans[k] for k in order[1:]]
        for other in others:
            assert (other.p_reserve, other.p_arrive) <= (first.p_reserve, first.p_arrive)
            if other.p_arrive == first.p_arrive:
                ours, theirs = ((plan.duration_s, len(plan.stops), plan.energy_wh) for plan in (first, other))
                assert any(b > a for a, b in zip(ours, theirs, strict=True)) or ours == theirs
                if other.duration_s <= first.duration_s:
                    assert (len(first.stops), first.energy_wh) <= (len(other.stops), other.energy_wh)
        times = [(-plan.p_arrive, plan.duration_s) for plan in others]
        assert times == sorted(times)


def test_only_the_first_road_is_called_the_fastest_like_its_plan(model, monkeypatch):
    """Also where another road is faster by less than the time of plugging in."""
    found = journey(model, replace(COLD, soc=0.8), alternatives=1)
    for seconds, p in (((3600.0, 3400.0), 0.96), ((3600.0, 3800.0), 0.96), ((3600.0, 3400.0), 0.4)):
        wholes = [SimpleNamespace(duration_s=s, energy_wh=s, p_reserve=p, distance_m=s) for s in seconds]
        by_road = dict(zip((id(road.road) for road in found.roads), wholes, strict=True))
        monkeypatch.setattr(RoadForecast, "whole", lambda self, reserve, by=by_road: by[id(self.road)])
        first, other = planning._label_roads([*found.roads], 0.1)
        assert ("fastest" in first.labels, "fastest" in other.labels) == (True, False)
        least = ["least energy" in road.labels for road in (first, other)]  # no merit of a road that fails
        assert least == [p > 0.5 and s == min(seconds) for s in seconds]


def test_a_slower_road_without_a_stop_is_first_if_it_is_faster_in_all(model):
    weak = replace(MADE, stations=(Station(47.0, 9.4, "Halbweg", 3700.0),))
    slow, fast = journey(model, replace(COLD, soc=0.93), atlas=weak, alternatives=1).roads
    assert slow.road.duration_s > fast.road.duration_s
    assert (slow.charging, len(fast.charging.stops)) == (None, 1)
    assert slow.whole(0.1).duration_s < fast.whole(0.1).duration_s


def test_departures_are_compared_with_the_time_and_energy_of_their_stops(model):
    """In the cold the car has to charge, in mild air it arrives without a stop."""
    cold, mild = (
        journey(model, tw.Departure(soc=0.85, ambient_temperature_degc=degc)) for degc in (-5.0, 20.0)
    )
    if mild.charging is not None:  # the second needs less time at the station
        assert mild.charging.charging_s < cold.charging.charging_s
    more = cold.difference(mild)
    plain = cold.forecast.difference(mild.forecast)
    wholes = [one.roads[0].whole(0.1) for one in (cold, mild)]
    assert more.duration_s == pytest.approx(wholes[0].duration_s - wholes[1].duration_s)
    assert more.duration_s > plain.duration_s + 120.0
    assert more.energy_wh == pytest.approx(wholes[0].energy_wh - wholes[1].energy_wh)
    assert sum(more.by_cause_wh.values()) == pytest.approx(more.energy_wh)
    assert more.sd_wh == plain.sd_wh
    back = mild.difference(cold)
    assert (back.duration_s, back.energy_wh) == (-more.duration_s, pytest.approx(-more.energy_wh))


def test_no_stops_are_planned_where_none_are_asked_for(model):
    found = journey(model, LOW, charge=False)
    assert (found.charging, found.charging_alternatives) == (None, ())
    assert found.verdict.advice in ("charge_before", "slower", "none")
    assert found.verdict.charges == 0


def test_a_leg_from_a_charge_nearby_has_nearly_the_energy_of_its_own_forecast(long_journey):
    leg = long_journey.charging.legs[1]
    soc = leg.forecast.plan.departure.soc - 0.05
    exact, shifted = leaving_with(leg.forecast, soc), leg.leaving_with(soc).forecast
    assert shifted.energy_wh == pytest.approx(exact.energy_wh, rel=0.003)
    assert shifted.soc_arrival == pytest.approx(exact.soc_arrival, abs=0.002)


def test_the_journey_shows_its_stops(long_journey):
    frame = long_journey.to_frame()
    plans = (long_journey.charging, *long_journey.charging_alternatives)
    with_stops = frame[frame["charges"] > 0]
    assert with_stops["duration_s"].tolist() == [plan.duration_s for plan in plans]
    assert (frame["energy_low_wh"] < frame["energy_wh"]).all()
    assert (frame["energy_wh"] < frame["energy_high_wh"]).all()
    assert "stops to charge" in repr(long_journey)


def corridor_of(model, departure, atlas, patch, **options):
    """What the stops of a journey are looked for in."""
    seen = []
    patch.setattr(planning, "find_plans", lambda corridor: seen.append(corridor) or ())
    journey(model, departure, atlas=atlas, **options)
    return seen[0]


def test_a_battery_is_heated_for_stations_alone(model, monkeypatch):
    """By hand: what the cells lack to be warm, where it is worth it; nothing for the start and the destination."""
    cold = replace(COLD, soc=0.9, ambient_temperature_degc=-10.0)
    atlas = replace(MADE, stations=row(9, 9.8, 150_000.0))
    corridor = corridor_of(model, cold, atlas, monkeypatch, preheat_battery=True)
    heat = corridor.preheat_soc
    assert (heat[0], heat[-1], heat.max() > 0.0) == (0.0, 0.0, True)
    lacking_k = WARM_DEGC - corridor.cell_degc
    assert lacking_k[-1] > 0.0
    wh = model.vehicle.battery.heat_capacity_j_k * lacking_k / 3600.0
    heated = heat > 0.0
    assert heat[heated] == pytest.approx(wh[heated] / corridor.forecast.charge.wh_per_display)
    plain = corridor_of(model, cold, atlas, monkeypatch)
    assert (plain.preheat_soc == 0.0).all()
    assert (plain.charging_s[[0, -1]] == 0.0).all()
    assert (plain.charging_s[1:-1, -1] > 0.0).all()
    assert (corridor.charging_s[1:-1, -1] < plain.charging_s[1:-1, -1]).any()


@pytest.mark.parametrize(
    ("sure", "heat", "need"),
    [((0.6, 0.1, 0.4), 0.0, 0.6), ((0.6, 0.5, 0.4), 0.0, 0.4), ((0.6, 0.5, 0.4), 0.1, 0.5)],
)
def test_a_leg_needs_what_its_lowest_charge_and_its_reserve_do(sure, heat, need):
    """With 0.1 in reserve: over a pass the lowest charge counts, else that at the end, and heat for the battery on top."""
    along = SimpleNamespace(soc=lambda chance: np.array(sure), expected_soc=np.array((0.7, 0.6, 0.5)))
    forecast = SimpleNamespace(along=along)
    leg = Leg(None, forecast, heat)
    corridor = SimpleNamespace(_leg_needs={}, rules=SimpleNamespace(reserve=0.1))
    assert Corridor._leg_need(corridor, leg, 0.9, 0.1) == pytest.approx((0.2 + heat, need))


@pytest.fixture
def searched(monkeypatch):
    """Searches for the risk of each leg by the chance of the whole journey at a risk, None where there is no plan; and what it tried."""

    def search(whole_of, guess):
        tried = []

        def optimum(chances, label):
            tried.append(1.0 - chances[1])
            return whole_of(tried[-1]) and chances

        made = SimpleNamespace(optimum=optimum)
        made.legs_of, made.options = (lambda found: found), SimpleNamespace(reserve=0.1)
        return *plans._best_certain_plan(made, "fastest", guess), tried

    monkeypatch.setattr(plans, "_with_stops", lambda corridor, plan, found, chances: plan)

    def searching(whole_of, guess):
        plan = lambda label, _, legs, reserve: SimpleNamespace(p_reserve=whole_of(1.0 - legs[1]))  # noqa: E731
        monkeypatch.setattr(plans, "ChargingPlan", plan)
        return search(whole_of, guess)

    return searching


def test_a_risk_at_which_there_is_no_plan_is_too_small(searched):
    """Made: no plan below a risk of 0.02 of each leg; the whole has twice the risk of a leg, and 0.025 is the most."""
    for guess in (0.001, 0.01, 0.03):
        plan, risk, tried = searched(lambda leg: 1.0 - 2.0 * leg if leg >= 0.02 else None, guess)
        assert 0.95 <= plan.p_reserve <= 0.96
        assert 0.02 <= risk <= 0.025
    # the last guess: its whole risk is 0.06, and 0.0475 is aimed at
    assert tried == pytest.approx([0.03, 0.03 * 0.0475 / 0.06])


@pytest.mark.parametrize("leap", [0.004, 0.011, 0.02, 0.045])
def test_where_the_chance_leaps_the_risk_of_a_leg_is_known_to_a_tenth(searched, leap):
    plan, risk, _ = searched(lambda leg: 0.98 if leg <= leap else 0.92, 0.01)
    assert plan.p_reserve == 0.98
    assert leap / 1.1 <= risk <= leap


@pytest.mark.parametrize("whole", [0.95, 0.955])
def test_a_chance_that_is_close_ends_the_search(searched, whole):
    assert searched(lambda leg: whole, 0.01)[1:] == (0.01, [pytest.approx(0.01)])


def test_the_leg_from_the_start_keeps_its_charge():
    class Left:
        def leaving_with(self, level):
            return level

    start, later = Left(), Left()
    corridor = SimpleNamespace(routed={(0, 2): start, (2, 3): later})
    found = StopPlan((0, 2, 3), (0.7, 0.6), 1.0)
    assert Corridor.legs_of(corridor, found) == (start, 0.6)
    assert corridor.routed == {(0, 2): start, (2, 3): 0.6}


def test_of_too_many_stations_the_two_strongest_of_each_stretch_are_kept(model, long_journey, monkeypatch):
    power_w = 1000.0 * np.array([50, 20, 90, 70, 30, 11, 12, 150, 40, 60, 25, 35, 45])
    stations = [replace(one, power_w=float(w)) for one, w in zip(row(13), power_w, strict=True)]
    monkeypatch.setattr(corridor_module, "_MAX_STATIONS", 6)
    corridor = replace(long_journey.corridor, atlas=replace(MADE, stations=tuple(stations)))
    thirds = np.split(power_w, [4, 9])
    expected = [w for third in thirds for w in third if w >= np.sort(third)[-2]]
    assert [station.power_w for station in corridor.stations] == expected


def test_the_variance_of_a_forecast_is_what_legs_share_and_what_they_do_not(long_journey):
    forecast = long_journey.forecast
    wh = forecast.charge.wh_per_display
    common, own = variance_along(forecast)
    whole = forecast.along.energy_sd_wh**2 + (forecast.charge.sd(forecast.along.energy_wh, True) * wh) ** 2
    assert np.all(common[1:] > 0.0)
    assert common + own == pytest.approx(whole)
    driven = replace(forecast, drive=replace(forecast.drive, plan=replace(forecast.plan, free_flow=False)))
    own = [variance_along(replace(driven, sd_factor=factor))[1] for factor in (1.0, 1.5, 2.0)]
    assert own[2] - own[0] == pytest.approx(2.4 * (own[1] - own[0]), rel=1e-9), (
        "the drift counts with its square"
    )


def test_a_way_to_a_station_in_vain_takes_its_share_of_the_road(long_journey):
    corridor = long_journey.corridor
    ways = np.array([corridor.detour(0, node) for node in range(1, len(corridor.stations) + 1)])
    length_m = corridor_module._DETOUR_M_S * ways[:, 1]
    assert length_m.min() < 500.0 < 2000.0 < length_m.max()
    per_m = corridor.forecast.energy_wh / corridor.road.distance_m / corridor.forecast.charge.wh_per_display
    assert ways[:, 0] == pytest.approx(per_m * length_m)


def test_unknown_heights_are_named_until_the_charge_covers_a_climb_in_mountains(model):
    """No chance is above 99 in 100 on a road of unknown heights, however much is left."""
    stops = (A, Place(47.0, 9.2))
    short, full = (journey(model, replace(COLD, soc=soc), stops, answers=False).verdict for soc in (0.5, 1.0))
    assert [(one.arrives, one.reason) for one in (short, full)] == [(True, "unknown_heights"), (True, "")]
    assert short.p_arrive == full.p_arrive == full.p_reserve == 0.99
    road = MADE.router.roads(stops)[0]
    rng = np.random.default_rng(1)
    places = 47.0 + rng.uniform(-0.1, 0.1, 30), 9.1 + rng.uniform(-0.1, 0.1, 30)
    flat, steep = (
        RoadForecaster(model, COLD, heights=KnownHeights(*places, rng.normal(400.0, sd_m, 30))).forecast(
            road, "road"
        )
        for sd_m in (5.0, 300.0)
    )
    assert [each.plan.departure.terrain for each in (flat, steep)] == ["flat", "mountains"]
    assert np.diff(steep.interval(0.9)) > 1.5 * np.diff(flat.interval(0.9))
    heights = KnownHeights(*places, rng.normal(400.0, 300.0, 30))
    hilly, unknown, unsaid = (
        RoadForecaster(model, replace(COLD, terrain=terrain), heights=heights).forecast(road, "road")
        for terrain in ("hilly", "unknown", None)
    )
    assert hilly.plan.departure.terrain == "hilly", "what a driver says of the country"
    assert hilly.plan.climb.climb_m == pytest.approx(unsaid.plan.climb.climb_m), "does not hide a known climb"
    assert unknown.plan.departure == unsaid.plan.departure
    assert unknown.energy_wh == unsaid.energy_wh


def test_a_departure_below_the_reserve_is_named_and_exempts_the_first_leg(model):
    near = replace(MADE, stations=(Station(47.0, 9.2, "near", 1e5, direct_current=True),))
    trip = journey(model, replace(COLD, soc=0.33), (A, Place(47.0, 9.5)), near, reserve=0.35)
    assert trip.charging is not None
    assert trip.verdict.reason == "leaves_below_reserve"
    assert trip.charging.leg_chances[0] == trip.charging.legs[0].chance(0.0) >= 0.95
    assert trip.charging.leg_chances[1] == trip.charging.legs[1].chance(0.35)


def test_who_is_low_drives_to_a_station_off_the_road_that_is_surely_reached(model):
    """The station on the road is farther than the charge lasts for most; one 6 km off the road is near."""
    off, ahead = Station(47.045, 8.95, "off", 5e4, direct_current=True), Station(47.0, 9.25, "ahead", 5e4)
    atlas = replace(MADE, stations=(off, replace(ahead, direct_current=True)))
    id3 = for_car(model, "vw_id3")
    low, enough = (
        journey(id3, tw.Departure(soc=soc, ambient_temperature_degc=5.0), (A, B), atlas)
        for soc in (0.08, 0.4)
    )
    assert low.charging.stops[0].station.name == "off"
    assert low.charging.stops[0].p_reach > 0.95
    assert "off" not in [stop.station.name for stop in enough.charging.stops]


def test_random_journeys_do_not_contradict_themselves():
    for answer in journeys(10, seed=3):
        assert list(contradictions(answer)) == []
        stop = {"charging_s": 60.0, "overhead_s": 300.0, "pause_s": 90.0}
        stop |= {"soc_leave": 0.2, "soc_arrival": 0.3, "position_m": 0.0}
        wrong = answer | {"charging_alternatives": [WRONG_PLAN | {"stops": [stop]}]}
        is_low = answer["roads"][0]["forecast"]["series"]["displayed_soc"][0] < answer["reserve"]
        assert len(list(contradictions(wrong))) == 7 - is_low  # who is low charges at a station at the start


def test_a_station_at_the_start_is_no_stop_on_the_way(model):
    near = tuple(Station(47.0, 9.0 + d, f"{d}", 1e5, direct_current=True) for d in (0.01, 0.25))
    plan = journey(
        model, replace(COLD, soc=0.5), (A, Place(47.0, 9.5)), replace(MADE, stations=near)
    ).charging
    assert [stop.station.name for stop in plan.stops] == ["0.25"]
    alone = journey(model, replace(COLD, soc=0.5), (A, Place(47.0, 9.5)), replace(MADE, stations=near[:1]))
    assert (alone.charging, alone.verdict.advice) == (None, "charge_before")


def test_a_station_behind_the_start_helps_where_no_other_does(model):
    """The place of the road that is nearest to it is the start, but the car has to drive there."""
    behind = Station(A.latitude_deg - 0.1, A.longitude_deg - 0.05, "Behind", 100_000.0, direct_current=True)
    departure = tw.Departure(soc=0.35, ambient_temperature_degc=12.0)
    found = journey(model, departure, (A, Place(47.0, 9.6)), replace(MADE, stations=(behind,)))
    assert not any(road.forecast.p_arrive(0.1) > 0.5 for road in found.roads)
    (stop,) = found.charging.stops
    assert stop.station.name == "Behind"
    assert stop.position_m > 10_000.0
    assert found.verdict.advice == "stop"


def test_a_battery_that_a_road_beyond_its_range_heats_starts_no_leg_so_hot():
    smart = tw.for_car(None, "smart_eq_fortwo")
    departure = tw.Departure(soc=0.9, ambient_temperature_degc=35.0)
    slow = tuple(replace(station, direct_current=False) for station in row(9))
    found = journey(smart, departure, (A, FAR, A), replace(MADE, stations=slow))
    assert found.forecast.drive.simulation.battery_temperature_degc.max() > 80.0
    assert found.corridor.cell_degc.max() <= 60.0
    assert found.charging is not None
