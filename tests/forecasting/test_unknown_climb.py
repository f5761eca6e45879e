"""Roads of unknown heights: their climb is part of the forecast, and of what a trip teaches."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from benchmarks.unknown_climb import REGION_SCALE_M as SCALES
from benchmarks.unknown_climb import region_scale, route_rows, trips_of
from hypothesis import given, settings
from hypothesis import strategies as st

import tripwatt as tw
from tripwatt.arrays import distance_driven
from tripwatt.forecasting.leaving import leaving_with, soc_needed
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.segments import unknown_climb_wh
from tripwatt.roads.journey.forecasting import RoadForecaster
from tripwatt.routes import terrain
from tripwatt.routes.terrain import net_climbs
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import TERRAINS, Plan
from tripwatt.trips.plan import KnownClimb

COLD = tw.Departure(
    soc=0.8,
    ambient_temperature_degc=5.0,
    battery_temperature_degc=5.0,
    cabin_temperature_degc=5.0,
    cabin_setpoint_degc=21.0,
)


def road(km: float = 15.0, grade: float | None = None, speed_m_s: float = 15.0) -> Plan:
    link = {"length_m": 500.0, "speed_m_s": speed_m_s} | ({} if grade is None else {"grade": grade})
    return tw.read_route([link] * round(2 * km))


def forecast(plan: Plan, **known: object) -> tw.Forecast:
    return tw.forecast(plan, replace(COLD, **known))


def width(found: tw.Forecast) -> float:
    low, high = found.interval(0.9)
    return high - low


def test_a_known_road_has_no_unknown_climb():
    level = forecast(road(grade=0.0), terrain="mountains")
    assert level.climbing is None
    assert level.soc_per_climb_m is None
    assert level.climb_to(0.1) is None
    assert level.to_dict()["climb"] is None
    assert "unknown_climb" not in {flag.code for flag in level.flags}
    assert level.energy_wh == forecast(road(grade=0.0)).energy_wh


def test_intervals_follow_the_country():
    level = width(forecast(road(grade=0.0)))
    flat, hilly, mountains, unknown = (
        width(forecast(road(), terrain=name)) for name in ("flat", "hilly", "mountains", None)
    )
    assert level < flat < 1.1 * level
    assert flat < hilly < mountains
    assert flat < unknown < 1.6 * flat
    far = [forecast(road(), terrain=name).quantile(0.999) for name in ("flat", "hilly", None, "mountains")]
    assert far == sorted(far)


@pytest.mark.parametrize("terrain_", TERRAINS)
@settings(max_examples=25, deadline=None)
@given(p=st.floats(1e-3, 1.0 - 1e-3), soc=st.floats(0.05, 1.0))
def test_probabilities_are_the_inverse_of_quantiles(terrain_, p, soc):
    found = forecast(road(), terrain=terrain_, soc=soc)
    assert found.quantile(0.5) == pytest.approx(found.energy_wh, abs=1e-3)
    assert found.probability_below(found.quantile(p)) == pytest.approx(p, abs=1e-6)
    charge = found.charge.wh_per_display
    arrives = found.along.soc(p)[-1]
    assert found.arrival.p_above(float(arrives)) == pytest.approx(p, abs=1e-6)
    assert sum(found.by_cause_wh.values()) == pytest.approx(found.energy_wh)
    assert charge > 0.0


@pytest.mark.parametrize("vehicle", ["bmw_i3_60ah", "nissan_leaf_40", "tesla_model_3_lr"])
def test_hills_on_the_way_cost(vehicle):
    """As much as a simulation of such a road; without them each scenario takes less, and no climb is a gain."""
    found = tw.forecast(road(), replace(COLD, terrain="mountains"), car=vehicle)
    climbing = found.climbing
    assert climbing is not None
    steep = float(climbing.hill[-1])
    links = [{"length_m": 500.0, "speed_m_s": 15.0, "grade": steep * (-1.0) ** k} for k in range(30)]
    hilly, level = (
        tw.simulate(plan, vehicle, COLD).simulated_energy_wh
        for plan in (tw.read_route(links), road(grade=0.0))
    )
    # the reader rounds the tops and bottoms of the links, over 200 of their 500 m
    assert 0.5 * climbing.hill_wh[-1, -1] < hilly - level < climbing.hill_wh[-1, -1]
    smooth = replace(climbing, hill_wh=np.zeros_like(climbing.hill_wh))
    more = climbing.ahead().offsets_wh[:, -1] - smooth.ahead().offsets_wh[:, -1]
    assert (more > 0.0).all()


def test_hills_of_a_steady_climb_cost_less_than_those_of_a_level_road():
    """Nothing is braked away where the road hardly goes down, as in a simulation of such a road."""
    climbs = (known_climb(15_000.0, (0.0, climb)) for climb in (0.0, 600.0, 1200.0))
    found = [forecast(replace(road(), climb=climb), terrain="mountains") for climb in climbs]
    cost = [float(each.climbing.hill_wh[-1, -1]) for each in found]
    assert cost[0] > 2.0 * cost[1] > 2.0 * abs(cost[2])
    links = [{"length_m": 500.0, "speed_m_s": 15.0, "grade": 0.08 + 0.08 * (-1.0) ** k} for k in range(30)]
    hilly, even = (
        tw.simulate(plan, "bmw_i3_60ah", COLD).simulated_energy_wh
        for plan in (tw.read_route(links), road(grade=0.08))
    )
    assert abs(hilly - even) < 0.5 * cost[0]


@pytest.mark.parametrize(("soc", "air_degc"), [(1.0, 30.0), (0.7, 30.0), (0.9, -25.0)])
def test_a_descent_after_a_climb_is_that_of_the_known_road(soc, air_degc):
    """The climb makes room in a full battery and warms a cold one, before the descent charges it."""
    flat, departure = road(60.0), tw.Departure(soc, air_degc, terrain="flat")
    places = known_climb(60_000.0, (0.0, 2095.0, 0.0))
    at_m = distance_driven(flat.array("time_s"), flat.array("speed_m_s"))
    pass_road = replace(flat, samples=flat.samples.assign(elevation_m=places.height(at_m)))
    hidden, known = (
        tw.forecast(plan, departure, car="tesla_model_3_lr")
        for plan in (replace(flat, climb=places), pass_road)
    )
    # flat country has small hills, which cost a little, but warm a cold battery
    assert hidden.energy_wh == pytest.approx(known.energy_wh, rel=1e-3)
    assert np.array_equal(hidden.drive.power_w, known.drive.power_w)


@pytest.mark.parametrize("vehicle", ["bmw_i3_60ah", "nissan_leaf_40", "tesla_model_3_lr"])
def test_a_metre_of_climb_takes_what_the_simulation_says(vehicle):
    found = tw.forecast(road(), COLD, car=vehicle)
    assert found.climbing is not None
    for grade in (0.01, 0.03):
        climb = grade / np.hypot(1.0, grade) * 15_000.0
        plans = (road(grade=grade), road(grade=0.0))
        up, level = (tw.simulate(plan, vehicle, COLD).simulated_energy_wh for plan in plans)
        assert found.climbing.more_wh(climb) == pytest.approx(up - level, rel=0.05)


def test_the_climb_that_is_named_takes_the_charge_to_the_reserve():
    found = forecast(road(), soc=0.3)
    climb = found.climb_to(0.1)
    assert climb is not None
    grade = climb / 15_000.0
    assert forecast(road(grade=grade), soc=0.3).soc_arrival == pytest.approx(0.1, abs=0.02)
    assert found.climb_to(0.9) == 0.0
    assert forecast(road(3.0), soc=0.9).climb_to(0.1) is None  # no road climbs 0.2 of its length


def test_what_was_driven_has_no_unknown_climb():
    before = forecast(road(30.0))
    widths = []
    for share in (0.25, 0.5, 0.9, 1.0):
        end = share * before.plan.duration_s
        seen = {"time_s": np.arange(0.0, end, 1.0)}
        power = before.energy_wh / before.plan.duration_s * seen["time_s"]
        after = before.update_since_departure(
            pd.DataFrame(seen | {"speed_m_s": 15.0, "observed_energy_wh": power})
        )
        widths.append(float(after.along.excess.climb.core_sd_wh[-1]))  # type: ignore[union-attr]
    assert widths == sorted(widths, reverse=True)
    assert widths[-1] < 0.1 * float(before.along.excess.climb.core_sd_wh[-1])  # type: ignore[union-attr]


def test_a_terrain_is_one_of_four():
    with pytest.raises(tw.InvalidInput) as caught:
        tw.Departure(terrain="alps")
    assert caught.value.faults[0].where == "terrain"
    assert "mountains" in caught.value.faults[0].allowed


def test_a_set_that_is_scored_gives_no_heights(monkeypatch):
    """The distribution without a set is that of a package that never had it."""
    for name in SCALES:
        net_climbs.cache_clear()
        without = net_climbs("unknown", without=name)
        assert not np.array_equal(without.over_10_km_m, net_climbs("unknown").over_10_km_m)
        with monkeypatch.context() as patch:
            patch.setattr(terrain, "REGION_SCALE_M", {k: v for k, v in SCALES.items() if k != name})
            net_climbs.cache_clear()
            assert np.array_equal(net_climbs("unknown").over_10_km_m, without.over_10_km_m)
    net_climbs.cache_clear()


def test_scales_of_regions_are_those_of_their_logs(data_dir: Path, tmp_path: Path):
    for name, scale in SCALES.items():
        if not (data_dir / name).is_dir():
            pytest.skip(f"no trips at {data_dir / name}")
        assert region_scale(trips_of(name, data_dir, tmp_path)[0]) == pytest.approx(scale, abs=0.05)


def test_a_trip_without_heights_teaches_with_the_error_of_its_climb():
    trips = synthetic_fleet(3).trips
    car = tw.load_vehicle("bmw_i3_60ah")
    bare = [
        replace(trip, samples=trip.samples.drop(columns=["elevation_m", "grade"], errors="ignore"))
        for trip in trips
    ]
    known, unknown = (segment_trips(some, car).energy_errors.own_wh for some in (trips, bare))
    expected = [unknown_climb_wh(Plan.from_trip(trip), car) for trip in bare]
    assert unknown == pytest.approx(np.hypot(known, expected))
    assert min(expected) > 0.0
    longer = [unknown_climb_wh(road(km), car) for km in (5.0, 20.0, 80.0)]
    assert longer == sorted(longer)


def test_intervals_cover_seeded_roads():
    """Forty mountain and forty flat roads whose energy is drawn with known heights."""
    rows = list(route_rows(40))
    assert len(rows) == 2
    assert all(row.met for row in rows), [f"{row.text}: {row.value}" for row in rows]


def test_reach_and_charge_to_leave_with_allow_for_the_climb():
    level, unknown = forecast(road(30.0, grade=0.0)), forecast(road(30.0), terrain="mountains")
    assert soc_needed(unknown, 0.1, 0.95) > soc_needed(level, 0.1, 0.95) + 0.02
    leave = soc_needed(unknown, 0.1, 0.95)
    assert leaving_with(unknown, leave).p_arrive(0.1) == pytest.approx(0.95, abs=0.01)
    assert float(unknown.along.soc(0.95)[-1]) < float(level.along.soc(0.95)[-1])
    drive = RoadForecaster(tw.load_model(), replace(COLD, terrain="mountains"))
    assert drive.departure.terrain == "mountains"


def test_two_roads_differ_by_both_of_their_climbs():
    unknown, level = ([forecast(road(km, grade)) for km in (15.0, 30.0)] for grade in (None, 0.0))
    climbs_wh2 = sum(one.sd_wh**2 - float(one.along.energy_sd_wh[-1]) ** 2 for one in unknown)
    apart_wh2 = unknown[0].difference(unknown[1]).sd_wh ** 2 - level[0].difference(level[1]).sd_wh ** 2
    assert climbs_wh2 > 0.0
    assert apart_wh2 == pytest.approx(climbs_wh2, rel=0.05)


def known_climb(way_m, climb_m, sd_m=0.0):
    """A climb of straight lines between points, whose error grows evenly."""
    distance = np.linspace(0.0, way_m, len(climb_m))
    return KnownClimb(distance, np.array(climb_m, dtype=float), sd_m * distance / way_m, 800.0)


@pytest.mark.parametrize("profile", [(0.0, 300.0, 600.0), (0.0, -300.0, -600.0), (0.0, 600.0, 100.0)])
def test_a_climb_that_is_known_costs_what_it_costs_on_a_road_of_known_heights(profile):
    """Up, down and over a pass; the energy of unknown hills on the way remains."""
    links = [{"length_m": 1000.0, "speed_m_s": 15.0}] * 12
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=15.0, terrain="flat")
    model, plan = tw.load_model(), tw.read_route(links)
    way = np.linspace(0.0, 12_000.0, len(profile))
    at = np.arange(0.0, 12_001.0, 1000.0)
    heights = np.interp(at, way, profile)
    road = tw.read_route(
        [link | {"grade": (b - a) / 1000.0} for link, a, b in zip(links, heights, heights[1:], strict=False)]
    )
    flat = model.forecast(plan, departure).energy_wh
    known = model.forecast(replace(plan, climb=known_climb(12_000.0, profile)), departure)
    truth = model.forecast(road, departure).energy_wh
    assert known.energy_wh - flat == pytest.approx(truth - flat, rel=0.06, abs=100.0)
    assert known.to_dict()["climb"]["expected_m"] == profile[-1]


def test_places_that_climb_steeper_than_any_road_have_a_forecast():
    plan, peak = road(), known_climb(15_000.0, (*[0.0] * 15, 560.0))
    found = forecast(replace(plan, climb=peak), terrain="mountains")
    assert found.energy_wh > forecast(plan, terrain="flat").energy_wh


def test_the_air_is_that_of_the_expected_height():
    """A level road of hidden heights takes what the same road of known heights takes, and less the higher it is."""
    plan, departure = road(30.0), tw.Departure(0.9, 5.0, terrain="flat")
    level = KnownClimb(np.array([0.0, 30_000.0]), np.zeros(2), np.zeros(2), 2000.0)
    high, known, low = (
        tw.forecast(each, departure).by_cause_wh["air"]
        for each in (
            replace(plan, climb=level),
            replace(plan, samples=plan.samples.assign(elevation_m=2000.0)),
            replace(plan, climb=replace(level, start_m=0.0)),
        )
    )
    assert high == pytest.approx(known)
    assert high < 0.85 * low


@pytest.mark.parametrize("air_degc", [30.0, 5.0, -25.0])
def test_an_expected_climb_is_as_uncertain_as_a_known_one(air_degc):
    """The errors of the trip act on the energy of the climb as well. The air is that of the heights, so its pressure is given."""
    links = [{"length_m": 500.0, "speed_m_s": 15.0, "grade": 0.05}] * 60
    departure = tw.Departure(0.95, air_degc, terrain="flat", pressure_pa=1e5)
    places = known_climb(30_000.0, (0.0, 1498.0))
    hidden, known = (
        float(np.diff(tw.forecast(plan, departure, car="nissan_leaf_40").interval(0.9))[0])
        for plan in (replace(road(30.0), climb=places), tw.read_route(links))
    )
    assert hidden == pytest.approx(known, rel=0.05)


def test_the_interval_is_that_of_what_is_known():
    model, plan = tw.load_model(), tw.read_route([{"length_m": 12_000.0, "speed_m_s": 15.0}])
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=15.0, terrain="mountains")
    widths = [
        np.diff(model.forecast(replace(plan, climb=climb), departure).interval(0.9))[0]
        for climb in (known_climb(12_000.0, (0.0, 500.0), sd) for sd in (5.0, 60.0, 200.0))
    ]
    bare = np.diff(model.forecast(plan, departure).interval(0.9))[0]
    assert widths[0] < widths[1] < widths[2] < bare


def test_on_the_way_the_rest_of_a_known_climb_remains():
    model, plan = tw.load_model(), tw.read_route([{"length_m": 12_000.0, "speed_m_s": 15.0}])
    departure = tw.Departure(soc=0.8, ambient_temperature_degc=15.0, terrain="mountains")
    before = model.forecast(replace(plan, climb=known_climb(12_000.0, (0.0, 800.0, 1000.0), 40.0)), departure)
    course, time_s = before.along, np.arange(0.0, 401.0)
    driven_wh = np.interp(time_s, course.time_s, course.energy_wh)
    seen = pd.DataFrame({"time_s": time_s, "speed_m_s": 15.0, "observed_energy_wh": driven_wh})
    rest_wh = before.update_since_departure(seen).energy_wh - driven_wh[-1]
    assert rest_wh == pytest.approx(course.energy_wh[-1] - driven_wh[-1], rel=0.1)
    assert rest_wh < 0.4 * course.energy_wh[-1]
    climbs = before.climbing.net.net_m(np.array([0.0, 6000.0]), 6000.0)
    assert climbs[:, 0].tolist() == [0.0] * len(climbs)
    assert np.median(climbs[:, 1]) == pytest.approx(200.0, abs=1.0)


def test_the_error_of_a_known_climb_is_the_stated_one():
    for kind in ("flat", "hilly", "mountains"):
        net = net_climbs(kind).given(known_climb(12_000.0, (0.0, 500.0), 60.0))
        assert net.typical_m(12_000.0) == pytest.approx(60.0, rel=1e-6)
        assert net.typical_m(6000.0) == pytest.approx(30.0, rel=1e-6)
        assert net.quantile(0.5, 12_000.0) == pytest.approx(500.0, abs=1.0)
