"""Links as users write them, links of driven trips, and the trips that are made of them."""

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.physics import simulate_trip
from tripwatt.routes import (
    LinkRoute,
    LinkStyle,
    calibrate_style,
    join_routes,
    links_of_trip,
    parse_route,
    plan_from_links,
    plan_from_route,
    road_work,
    route_from_links,
)
from tripwatt.routes.link_objects import LINK_KEYS, columns_of_links
from tripwatt.sources import read_logs
from tripwatt.trips import Departure, Flag, Trip, plan_from_trip, resample
from tripwatt.units import GRAVITY_M_S2, WH_PER_J
from tripwatt.vehicles import load_vehicle


def driven(speed, **columns):
    return Trip.from_samples(
        "t", pd.DataFrame({"time_s": np.arange(float(len(speed))), "speed_m_s": speed, **columns})
    )


def test_links_keep_length_time_and_height_of_the_trip():
    rng = np.random.default_rng(3)
    speed = np.clip(np.cumsum(rng.normal(0.0, 0.8, 900)) + 12.0, 0.0, 30.0)
    speed[300:340] = 0.0
    trip = driven(speed, elevation_m=500.0 + np.linspace(0.0, 40.0, 900))
    route = links_of_trip(trip, 250.0)
    assert route.distance_m == pytest.approx(trip.distance_m)
    assert route.duration_s == pytest.approx(trip.duration_s)
    np.testing.assert_allclose(route.length_m[:-1], 250.0)
    assert 125.0 < route.length_m[-1] < 375.0
    assert route.elevation_at([0.0, route.distance_m]).tolist() == pytest.approx([500.0, 540.0])
    assert np.isnan(route.stop_s).all()
    # each link's time from the trapezoid of the trip itself, the standstill included
    position = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))))
    halt = int(np.searchsorted(position, position[305]) // 1)
    link = int(position[305] // 250.0)
    assert route.travel_time_s[link] > 40.0
    assert halt > 0


def test_a_link_made_trip_has_the_links_of_the_trip():
    speed = np.concatenate(
        (np.linspace(0.0, 14.0, 20), np.full(120, 14.0), np.linspace(14.0, 0.0, 12), np.zeros(30))
    )
    # each leg is a little faster than the one before: links of exactly one speed would count as one
    trip = driven(
        np.concatenate([(1.0 + 0.002 * k) * speed for k in range(5)])
        + 0.001 * np.sin(np.arange(910.0) / 90.0) ** 2
    )
    route = links_of_trip(trip, 500.0)
    again = links_of_trip(plan_from_links(route, step_s=0.1), 500.0)
    np.testing.assert_allclose(again.travel_time_s[1:-1], route.travel_time_s[1:-1], rtol=0.02, atol=1.0)
    assert again.duration_s == pytest.approx(route.duration_s, rel=0.005)


def test_departure_is_known_at_the_start_and_nothing_is_measured():
    departure = Departure(ambient_temperature_degc=-3.0, bms_soc=0.6, payload_mass_kg=70.0)
    plan = plan_from_route(route_from_links([{"length_m": 900.0, "speed_m_s": 9.0}]))
    assert plan.departure == Departure()
    plan = plan.with_departure(departure)
    assert plan.departure == departure
    assert plan.flags == (Flag("no_elevation", "road"),)
    assert list(plan.samples.columns) == ["time_s", "speed_m_s"]
    assert plan.with_departure(Departure(soc=0.9)).departure == Departure(
        soc=0.9, ambient_temperature_degc=-3.0, payload_mass_kg=70.0
    )


def test_heights_and_grades_say_the_same_road():
    by_grade = route_from_links(
        [{"length_m": 400.0, "speed_m_s": 10.0, "grade": 0.03}, {"length_m": 600.0, "speed_m_s": 10.0}]
    )
    by_height = route_from_links(
        [
            {"length_m": 400.0, "speed_m_s": 10.0, "start_elevation_m": 0.0, "end_elevation_m": 12.0},
            {"length_m": 600.0, "travel_time_s": 60.0, "start_elevation_m": 12.0, "end_elevation_m": 12.0},
        ]
    )
    place = np.linspace(0.0, 1000.0, 21)
    np.testing.assert_allclose(by_grade.elevation_at(place), by_height.elevation_at(place), atol=1e-9)
    assert by_height.flags == ()


@pytest.mark.parametrize("grade", [0.3, -0.3, 0.4])
def test_a_steep_link_climbs_as_given(grade):
    """Streets of 0.3 exist; a link that no street has is refused."""
    flat = {"length_m": 500.0, "speed_m_s": 8.0, "grade": 0.0}
    plan = plan_from_links(route_from_links([flat, {"length_m": 1900.0, "speed_m_s": 8.0, "grade": grade}]))
    car = load_vehicle("bmw_i3_60ah")
    climb = simulate_trip(car, plan).energy_by_cause_wh["climb"][-1]
    expected = car.body.test_mass_kg * GRAVITY_M_S2 * grade * 1900.0 * WH_PER_J
    assert climb == pytest.approx(expected, rel=1e-3)
    with pytest.raises(
        InvalidInput, match=r"grade out of range: link 1, grade: got 0.45; allowed: -0.4 to 0.4"
    ):
        route_from_links([{"length_m": 100.0, "speed_m_s": 8.0, "grade": 0.45}])


def test_short_links_are_joined_and_their_time_is_kept():
    tiny = [{"length_m": 8.0, "speed_m_s": 12.0 if k % 3 else 9.0} for k in range(400)]
    route = route_from_links(tiny)
    trip = plan_from_links(route)
    assert trip.distance_m == pytest.approx(route.distance_m, rel=0.01)
    assert trip.duration_s == pytest.approx(route.duration_s, rel=0.03)


def test_joined_routes_follow_each_other():
    one = route_from_links(
        [{"length_m": 400.0, "speed_m_s": 10.0, "start_elevation_m": 5.0, "end_elevation_m": 9.0}]
    )
    two = join_routes([one, one])
    assert two.elevation_at([0.0, 400.0, 800.0]).tolist()[::2] == [5.0, 9.0]
    assert two.distance_m == 800.0
    assert Flag("no_elevation", "road") in join_routes([one, links_of_trip(driven(np.full(90, 10.0)))]).flags


def test_every_fault_of_the_links_at_once():
    with pytest.raises(InvalidInput) as caught:
        route_from_links(
            [
                {"length_m": 0.0, "speed_m_s": 10.0},
                {"length_m": 100.0, "speed_m_s": 10.0, "travel_time_s": 10.0},
                {"length_m": 100.0, "speed_m_s": 10.0, "grade": 3.0},
                {"length_m": 100.0, "speed_m_s": 10.0, "colour": 1.0},
                {"length_m": float("inf"), "speed_m_s": 10.0},
                {"length_m": 10**400, "speed_m_s": 10.0},
                {"length_m": True, "speed_m_s": 10.0},
            ]
        )
    said = [fault.where for fault in caught.value.faults]
    assert [f"link {k}" in " ".join(said) for k in range(1, 8)] == [True] * 7
    with pytest.raises(InvalidInput, match="at most 70"):
        route_from_links([{"length_m": 1000.0, "speed_m_s": 100.0}])
    with pytest.raises(InvalidInput, match="takes too long"):
        route_from_links([{"length_m": 1000.0, "speed_m_s": 0.001}])


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.dictionaries(
            st.sampled_from(
                [
                    "length_m",
                    "speed_m_s",
                    "travel_time_s",
                    "grade",
                    "stop_s",
                    "start_elevation_m",
                    "end_elevation_m",
                    "x",
                ]
            ),
            st.one_of(
                st.none(),
                st.floats(),
                st.floats(0.1, 500.0),
                st.booleans(),
                st.text(max_size=3),
                st.integers(),
            ),
            max_size=5,
        ),
        max_size=4,
    )
)
def test_any_links_are_refused_or_driven(links):
    try:
        trip = plan_from_route(route_from_links(links))
    except InvalidInput:
        return
    assert trip.duration_s > 0


def test_links_come_as_json_too():
    links = [{"length_m": 500.0, "speed_m_s": 10.0}]
    for document in (links, {"links": links}):
        route = parse_route(json.dumps(document).encode())
        assert isinstance(route, LinkRoute)
        assert route.duration_s == 50.0


def test_calibration_finds_the_style_that_made_the_trips():
    truth = LinkStyle(street_speed_m_s=14.0, comfort=0.4)
    rng = np.random.default_rng(5)
    trips = [
        plan_from_links(
            route_from_links([{"length_m": 250.0, "speed_m_s": v} for v in rng.uniform(4.0, 16.0, 30)]),
            style=truth,
        )
        for _ in range(4)
    ]
    found = calibrate_style(trips, length_m=(250.0,), most_evaluations=60)
    wrong = [
        abs(road_work(plan_from_links(links_of_trip(t), style=LinkStyle())) / road_work(t) - 1.0)
        for t in trips
    ]
    right = [
        abs(road_work(plan_from_links(links_of_trip(t), style=found)) / road_work(t) - 1.0) for t in trips
    ]
    assert np.mean(right) < 0.02
    assert np.mean(right) < 0.25 * np.mean(wrong)
    with pytest.raises(InvalidInput, match="no trips"):
        calibrate_style([])


def test_links_of_real_trips_cost_what_the_trips_cost(data_dir):
    """A small sample with wide bounds; `benchmarks/links.py` measures all of them."""
    car = load_vehicle("bmw_i3_60ah")
    trips = [resample(t) for t in read_logs(data_dir / "tum").reference_trips()[::8]]
    true = np.array([simulate_trip(car, t).simulated_energy_wh for t in trips])
    for length, bound in ((250.0, 0.05), (1000.0, 0.06)):
        made = [plan_from_links(links_of_trip(t, length)).with_departure(t.departure) for t in trips]
        off = np.array([simulate_trip(car, t).simulated_energy_wh for t in made]) / true - 1.0
        assert np.abs(off).mean() < bound


def test_steps_that_give_too_many_samples_are_refused():
    route = route_from_links([{"length_m": 1000.0, "speed_m_s": 1.0}] * 100)
    for step_s in (0.0, -1.0, float("nan"), 1e-3):
        with pytest.raises(InvalidInput, match="step out of range"):
            plan_from_links(route, step_s=step_s)


LIMITED = st.lists(
    st.tuples(st.floats(70.0, 3000.0), st.floats(3.0, 35.0), st.one_of(st.none(), st.floats(3.0, 40.0))),
    min_size=1,
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(LIMITED, st.one_of(st.none(), st.integers(0, 9)))
def test_nobody_drives_faster_than_the_limit_or_the_mean_speed(links, seed):
    route = route_from_links(
        [{"length_m": length, "speed_m_s": v, "speed_limit_m_s": limit} for length, v, limit in links]
    )
    trip = plan_from_route(route, rng=None if seed is None else np.random.default_rng(seed), step_s=0.5)
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    position = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))
    position *= route.distance_m / position[-1]
    ends = np.cumsum(route.length_m)
    allowed = np.array([np.inf if limit is None else max(limit, v) for _, v, limit in links])
    # samples on a border belong to either link
    near = [np.minimum(np.searchsorted(ends, position + d), len(ends) - 1) for d in (-12.0, 0.0, 12.0)]
    assert np.all(speed <= np.max([allowed[link] for link in near], axis=0) + 0.01)


def test_a_speed_limit_changes_the_drive_and_joins():
    free = [{"length_m": 800.0, "speed_m_s": 8.0}] * 4
    limited = [{**link, "speed_limit_m_s": 9.0} for link in free]
    routes = [route_from_links(links) for links in (free, limited)]
    fast, slow = (plan_from_route(route) for route in routes)
    assert fast.array("speed_m_s").max() > 12.0
    assert slow.array("speed_m_s").max() <= 9.0 + 1e-9
    assert slow.duration_s == pytest.approx(400.0, rel=0.02)
    both = join_routes(routes)
    assert np.isnan(both.speed_limit_m_s[:4]).all()
    assert both.speed_limit_m_s[4:].tolist() == [9.0] * 4
    assert join_routes([routes[0]] * 2).speed_limit_m_s is None


def test_a_planned_trip_knows_the_length_of_its_links():
    assert plan_from_trip(driven(np.full(60, 10.0))).link_m is None
    two = route_from_links([{"length_m": 100.0, "speed_m_s": 9.0}, {"length_m": 300.0, "speed_m_s": 9.1}])
    assert plan_from_route(two).link_m == pytest.approx((100.0**2 + 300.0**2) / 400.0)


TABLE = "length_m;speed_m_s;grade;stop_s\n500;10,5;0,01;\n\n250;5;;20\n"


def test_links_come_as_csv_too(tmp_path):
    objects = route_from_links(
        [{"length_m": 500, "speed_m_s": 10.5, "grade": 0.01}, {"length_m": 250, "speed_m_s": 5, "stop_s": 20}]
    )
    for text in (
        TABLE,
        TABLE.replace(",", ".").replace(";", ","),
        TABLE.replace(";", "\t").replace("\n", "\r\n"),
    ):
        (tmp_path / "route.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
        route = parse_route(tmp_path / "route.csv")
        for name in ("length_m", "travel_time_s", "stop_s", "elevation_m"):
            np.testing.assert_array_equal(getattr(route, name), getattr(objects, name))


def test_every_fault_of_a_table_at_once():
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_km,speed_km_h,colour\n1,50,red\n")
    said = str(caught.value)
    assert "did you mean length_m?" in said
    assert "did you mean speed_m_s?" in said
    assert "'colour'" in said
    assert said.count("missing column") == 2
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_m,speed_m_s,grade\nx,9,0\n5,-9,7\n,nan,0\n8,9,0,1\n")
    said = str(caught.value)
    for words in ("link 1, length_m: got 'x'", "link 2, speed_m_s", "link 2, grade", "missing key: route, link 3",
                  "link 3, speed_m_s: got nan", "too many cells"):  # fmt: skip
        assert words in said
    assert "missing key: route, link 1" not in said
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_m,speed_m_s\n" + b"0,0\n" * 20_000)
    assert len(caught.value.faults) == 2
    assert "(and 19999 more links)" in str(caught.value.faults[-1])


@given(
    st.lists(
        st.dictionaries(
            st.sampled_from(sorted(LINK_KEYS)),
            st.sampled_from(
                [None, -1.0, 0, 0.0, 0.3, 0.5, 5, 9.5, 50.0, 1e400, 10**400, math.nan, True, "5"]
            ),
            max_size=6,
        ),
        max_size=4,
    )
)
def test_columns_of_links_are_those_of_the_links_one_by_one(links: list[dict[str, Any]]) -> None:
    """A look at all links at once takes what a look at each takes, to the same values, and nothing else."""
    if not links:
        return
    columns, faults = columns_of_links(links)
    alone = [columns_of_links([link]) for link in links]
    assert bool(faults) == any(its_faults for _, its_faults in alone)
    for name, values in columns.items():
        assert values.tobytes() == np.concatenate([its_columns[name] for its_columns, _ in alone]).tobytes()
