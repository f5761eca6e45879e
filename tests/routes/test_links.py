"""Routes of links: bounds, the links of a trip, the plan that a driver makes of them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.routes.made import NO, TO_ROUNDING
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.physics import simulate_trip
from tripwatt.routes import LinkRoute, links, links_of_trip, route_from_links
from tripwatt.routes.links import join_links, stretch_starts
from tripwatt.sources import read_logs
from tripwatt.trips import Departure, Flag, Plan, Trip, resample
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
    link = int(position[305] // 250.0)
    assert route.travel_time_s[link] > 40.0


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
    again = links_of_trip(route.plan(step_s=0.1), 500.0)
    np.testing.assert_allclose(again.travel_time_s[1:-1], route.travel_time_s[1:-1], rtol=0.02, atol=1.0)
    assert again.duration_s == pytest.approx(route.duration_s, rel=0.005)


def test_departure_is_known_at_the_start_and_nothing_is_measured():
    departure = Departure(ambient_temperature_degc=-3.0, bms_soc=0.6, payload_mass_kg=70.0)
    plan = route_from_links([{"length_m": 900.0, "speed_m_s": 9.0}]).plan()
    assert plan.departure == Departure()
    plan = plan.with_departure(departure)
    assert plan.departure == departure
    assert plan.flags == (Flag("no_elevation", "road"),)
    assert list(plan.samples.columns) == ["time_s", "speed_m_s"]
    assert plan.with_departure(Departure(soc=0.9)).departure == Departure(
        soc=0.9, ambient_temperature_degc=-3.0, payload_mass_kg=70.0
    )


def test_short_links_are_joined_and_their_time_is_kept():
    tiny = [{"length_m": 8.0, "speed_m_s": 12.0 if k % 3 else 9.0} for k in range(400)]
    route = route_from_links(tiny)
    trip = route.plan()
    assert trip.distance_m == pytest.approx(route.distance_m, rel=0.01)
    assert trip.duration_s == pytest.approx(route.duration_s, rel=0.03)


def test_links_of_real_trips_cost_what_the_trips_cost(data_dir):
    """A small sample with wide bounds; `benchmarks/links.py` measures all of them."""
    car = load_vehicle("bmw_i3_60ah")
    trips = [resample(t) for t in read_logs(data_dir / "tum").reference_trips()[::8]]
    true = np.array([simulate_trip(car, t).simulated_energy_wh for t in trips])
    for length, bound in ((250.0, 0.05), (1000.0, 0.06)):
        made = [links_of_trip(t, length).plan().with_departure(t.departure) for t in trips]
        off = np.array([simulate_trip(car, t).simulated_energy_wh for t in made]) / true - 1.0
        assert np.abs(off).mean() < bound


LIMITED = st.lists(
    st.tuples(st.floats(70.0, 3000.0), st.floats(3.0, 35.0), st.one_of(st.none(), st.floats(3.0, 40.0))),
    min_size=1,
    max_size=12,
)


@settings(max_examples=30, deadline=None)
@given(LIMITED, st.one_of(st.none(), st.integers(0, 9)))
def test_nobody_drives_faster_than_the_limit_or_the_mean_speed(links, seed):
    route = route_from_links(
        [{"length_m": length, "speed_m_s": v, "speed_limit_m_s": limit} for length, v, limit in links]
    )
    trip = route.plan(rng=None if seed is None else np.random.default_rng(seed), step_s=0.5)
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    position = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))
    position *= route.distance_m / position[-1]
    ends = np.cumsum(route.length_m)
    allowed = np.array([np.inf if limit is None else max(limit, v) for _, v, limit in links])
    # samples on a border belong to either link
    near = [np.minimum(np.searchsorted(ends, position + d), len(ends) - 1) for d in (-12.0, 0.0, 12.0)]
    assert np.all(speed <= np.max([allowed[link] for link in near], axis=0) + 0.01)


def test_a_speed_limit_changes_the_drive():
    free = [{"length_m": 800.0, "speed_m_s": 8.0}] * 4
    limited = [{**link, "speed_limit_m_s": 9.0} for link in free]
    routes = [route_from_links(links) for links in (free, limited)]
    fast, slow = (route.plan() for route in routes)
    assert fast.array("speed_m_s").max() > 12.0
    assert slow.array("speed_m_s").max() <= 9.0 + 1e-9
    assert slow.duration_s == pytest.approx(400.0, rel=0.02)


def test_a_planned_trip_knows_the_length_of_its_links():
    assert Plan.from_trip(driven(np.full(60, 10.0))).link_m is None
    two = route_from_links([{"length_m": 100.0, "speed_m_s": 9.0}, {"length_m": 300.0, "speed_m_s": 9.3}])
    assert two.plan().link_m == pytest.approx((100.0**2 + 300.0**2) / 400.0)


def route(length, time, **more):
    length = np.array(length, dtype=float)
    unknown = np.full(len(length), NO)
    given = {"stop_s": unknown, "moving_speed_m_s": unknown}
    arrays = {
        name: np.array(values, dtype=float) if isinstance(values, list) else values
        for name, values in more.items()
    }
    return LinkRoute(length, np.array(time, dtype=float), **{**given, **arrays})


def refused(*args, **more):
    with pytest.raises(InvalidInput) as caught:
        route(*args, **more)
    return [fault.where for fault in caught.value.faults]


def test_bounds_of_a_link():
    """A centimetre to ten thousand kilometres, 48 hours, 252 km/h."""
    assert route([0.01], [1.0]).distance_m == 0.01
    assert refused([0.009], [1.0]) == ["link 1, length_m"]
    assert route([1e7], [172_800.0]).duration_s == 172_800.0
    assert refused([1.1e7], [172_800.0]) == ["link 1, length_m"]
    assert refused([5.0, 5.0], [1.0, 0.0])[0] == "link 2, travel_time_s"
    assert refused([5.0], [172_801.0])[0] == "link 1, travel_time_s"
    assert route([70.0], [1.0]).speed_m_s.tolist() == [70.0]
    assert refused([70.1], [1.0]) == ["link 1, speed_m_s"]
    assert len(route([9.0], [9.0], stop_s=[0.0])) == 1
    assert len(route([9.0], [9.0], stop_s=[8.9])) == 1
    assert refused([9.0], [9.0], stop_s=[-0.1]) == ["link 1, stop_s"]
    assert refused([9.0], [9.0], stop_s=[9.0]) == ["link 1, stop_s"]
    for name in ("moving_speed_m_s", "speed_limit_m_s"):
        assert len(route([9.0], [9.0], **{name: [70.0]})) == 1
        assert refused([9.0], [9.0], **{name: [70.1]}) == [f"link 1, {name}"]
        assert refused([9.0], [9.0], **{name: [0.0]}) == [f"link 1, {name}"]
        assert refused([9.0], [9.0], **{name: [9.0, 9.0]}) == [name]


def test_bounds_of_a_route():
    assert route([9.0, 9.0], [86_400.0, 86_400.0]).duration_s == 172_800.0
    assert refused([9.0, 9.0], [86_400.0, 86_401.0]) == ["links"]
    assert refused([], []) == ["links"]
    n = 200_000
    assert len(route([1.0] * n, [0.5] * n)) == n
    assert refused([1.0] * (n + 1), [0.5] * (n + 1)) == ["links"]
    heights = {"elevation_position_m": [0.0, 9.0]}
    assert route([9.0], [9.0], elevation_m=[-500.0, 9000.0], **heights).elevation_at([9.0]) == 9000.0
    assert refused([9.0], [9.0], elevation_m=[-500.0, 9001.0], **heights) == ["elevation 2"]
    assert refused([9.0], [9.0], elevation_m=[-501.0, 9000.0], **heights) == ["elevation 1"]


def test_several_wrong_links_are_counted():
    refuses(r"link 2, length_m: got 0 \(and 1 more link\)", route, [9.0, 0.0, 0.0], [9.0] * 3)


def logged(speed, **columns):
    time = 5.0 + np.arange(float(len(speed)))
    return Trip.from_samples("t", pd.DataFrame({"time_s": time, "speed_m_s": speed, **columns}))


def test_links_of_a_trip_by_hand():
    """100 m at 10 m/s, a standstill of 5 s, 60 m at 20 m/s with half seconds of change on both sides."""
    speed = [10.0] * 11 + [0.0] * 6 + [20.0] * 4
    trip = logged(speed, elevation_m=np.linspace(500.0, 520.0, 21))
    made = links_of_trip(trip, 60.0)
    np.testing.assert_allclose(made.length_m, [60.0, 60.0, 55.0], **TO_ROUNDING)
    # 60 m after 6 s; 105 m when it stands, 5 s standing, 10 m more while it starts, then 5 m at 20 m/s
    np.testing.assert_allclose(made.travel_time_s, [6.0, 4.0 + 1.0 + 5.0 + 1.0 + 0.25, 2.75], **TO_ROUNDING)
    np.testing.assert_allclose(made.elevation_at([0.0, 60.0, 175.0]), [500.0, 506.0, 520.0], **TO_ROUNDING)
    assert made.flags == ()
    assert len(links_of_trip(trip, 400.0)) == 1
    assert len(links_of_trip(trip)) == 1
    assert len(links_of_trip(logged([10.0] * 51))) == 2
    assert len(links_of_trip(trip, 71.0)) == 2


def test_a_link_of_a_trip_starts_with_its_first_sample_and_ends_with_its_last():
    made = links_of_trip(logged([0.0] * 4 + [10.0] * 11 + [0.0] * 4), 55.0)
    np.testing.assert_allclose(made.length_m, [55.0, 55.0], **TO_ROUNDING)
    assert made.travel_time_s.sum() == 18.0
    assert made.travel_time_s[0] == 3.0 + 1.0 + 5.0


def test_a_standstill_at_a_border_belongs_to_the_link_behind_it():
    """95 m with the stop from 10 m/s in the last second, 5 s standing, 95 m with the start in the first second."""
    made = links_of_trip(logged([10.0] * 10 + [0.0] * 6 + [10.0] * 10), 95.0)
    assert made.length_m.tolist() == [95.0, 95.0]
    assert made.travel_time_s.tolist() == [10.0, 15.0]


def test_heights_of_a_trip_are_bridged_and_told_when_missing():
    heights = np.full(21, NO)
    heights[[0, 10, 20]] = [500.0, 510.0, 500.0]
    made = links_of_trip(logged([10.0] * 21, elevation_m=heights), 50.0)
    np.testing.assert_allclose(made.elevation_m, [500.0, 505.0, 510.0, 505.0, 500.0], **TO_ROUNDING)
    flat = links_of_trip(logged([10.0] * 21), 50.0)
    assert flat.elevation_m is None
    assert flat.flags == (Flag("no_elevation", "road"),)


@pytest.mark.parametrize("length_m", [0.0, -1.0, NO, np.inf])
def test_a_length_that_cuts_nothing(length_m):
    refuses("length out of range", links_of_trip, logged([10.0] * 5), length_m)
    refuses("trip without distance", links_of_trip, logged([0.0] * 5))


def test_a_plan_has_two_million_samples_of_a_millisecond(monkeypatch):
    refuses(r"allowed: 0\.05 s or more", route([50_000.0], [100_000.0]).plan, step_s=0.0499)
    for step_s in (0.0009, 0.0, -1.0, NO):
        refuses(r"allowed: 0\.001 s or more", route([90.0], [10.0]).plan, step_s=step_s)
    monkeypatch.setattr(links, "MAX_SAMPLES", 100)
    assert route([90.0], [10.0]).plan(step_s=0.1).step_s == 0.1


def stretches(length, stop=None):
    made = route(length, [60.0] * len(length), **({} if stop is None else {"stop_s": stop}))
    return stretch_starts(made).tolist()


def test_links_shorter_than_sixty_metres_are_joined():
    assert stretches([60.0, 60.0, 60.0]) == [0, 1, 2]
    assert stretches([59.0, 60.0, 60.0]) == [0, 2]
    assert stretches([20.0, 40.0, 30.0, 30.0]) == [0, 2]
    assert stretches([20.0, 39.0, 30.0, 90.0]) == [0, 3]
    assert stretches([20.0, 40.0, 30.0, 29.0]) == [0]
    assert stretches([200.0, 30.0]) == [0]
    assert stretches([30.0]) == [0]


def test_links_are_joined_up_to_a_stop():
    assert stretches([20.0, 40.0, 30.0], [5.0, 0.0, 0.0]) == [0, 1]
    assert stretches([20.0, 40.0, 10.0], [5.0, 0.0, 0.0]) == [0, 1]
    assert stretches([20.0, 40.0, 10.0], [0.0, 0.0, 0.0]) == [0]
    assert stretches([20.0, 40.0, 10.0], [NO, 5.0, 0.0]) == [0, 2]
    assert stretches([20.0, 60.0], [0.0, 5.0]) == [0]


def test_a_stop_at_the_end_of_join_links_is_where_it_was_given():
    """20 m and 480 m in 50 s with a stop of 10 s behind them, then 500 m."""
    made = route([20.0, 480.0, 500.0], [2.0, 48.0, 45.0], stop_s=[0.0, 10.0, 0.0])
    plan = made.plan(step_s=0.5)
    speed = plan.array("speed_m_s")
    standing = np.flatnonzero(speed[5:-5] == 0.0) + 5
    assert len(standing) in (20, 21)
    assert speed[: standing[0]].sum() * 0.5 == pytest.approx(500.0, rel=0.01)


def test_what_is_known_of_join_links():
    made = route(
        [30.0, 30.0, 60.0, 30.0, 30.0],
        [10.0, 10.0, 10.0, 20.0, 20.0],
        stop_s=[NO, 0.0, NO, NO, 5.0],
        moving_speed_m_s=[10.0, 15.0, NO, 10.0, NO],
        speed_limit_m_s=[10.0, 20.0, NO, NO, 5.0],
    )
    joined = join_links(made, np.array([0, 2, 3]))
    np.testing.assert_array_equal(joined["length_m"], [60.0, 60.0, 60.0])
    np.testing.assert_array_equal(joined["travel_time_s"], [20.0, 10.0, 40.0])
    np.testing.assert_array_equal(joined["stop_s"], [NO, NO, 5.0])
    np.testing.assert_array_equal(joined["moving_speed_m_s"], [60.0 / (3.0 + 2.0), NO, NO])
    np.testing.assert_array_equal(joined["speed_limit_m_s"], [20.0, NO, NO])
    known = route([30.0, 30.0], [10.0, 10.0], stop_s=[0.0, 4.0])
    np.testing.assert_array_equal(join_links(known, np.array([0, 1]))["stop_s"], [0.0, 4.0])
    np.testing.assert_array_equal(join_links(known, np.array([0]))["stop_s"], [4.0])
    assert join_links(known, np.array([0]))["speed_limit_m_s"] is None


def uncut(length, time, **more):
    """The mean length of the links of a plan, weighted by length: which neighbours count as one."""
    made = route(length, time, **more).plan()
    return round(made.link_m, 6)


@pytest.mark.parametrize(
    ("more", "one"),
    [
        ({}, True),
        ({"stop_s": [0.0, 0.0]}, True),
        ({"stop_s": [0.0, NO]}, False),
        ({"stop_s": [NO, 0.0]}, False),
        ({"stop_s": [5.0, 0.0]}, False),
        ({"stop_s": [0.0, 5.0]}, False),
        ({"stop_s": [5.0, 5.0]}, False),
        ({"moving_speed_m_s": [12.0, 12.0]}, True),
        ({"moving_speed_m_s": [12.0, 12.00001]}, True),
        ({"moving_speed_m_s": [12.0, 12.00002]}, False),
        ({"moving_speed_m_s": [12.0, NO]}, False),
        ({"speed_limit_m_s": [14.0, 14.0]}, True),
        ({"speed_limit_m_s": [14.0, 14.0001]}, False),
        ({"speed_limit_m_s": [NO, 14.0]}, False),
    ],
)
def test_neighbours_that_differ_in_nothing_are_one_link(more, one):
    assert uncut([200.0, 200.0], [20.0, 20.0], **more) == (400.0 if one else 200.0)


def test_speeds_that_agree_within_a_hundredth_are_one():
    assert uncut([200.0, 200.0], [20.01, 20.2]) == 400.0
    assert uncut([200.0, 200.0], [20.01, 20.3]) == 200.0
    steadily_faster = 20.01 * 0.985 ** np.arange(40)
    assert uncut(np.full(40, 200.0), steadily_faster) == 200.0
    whole_seconds = [20.0, 21.0], [20.0, 23.0]
    assert [uncut([200.0, 200.0], times) for times in whole_seconds] == [400.0, 200.0]
    measured = replace(route([200.0, 200.0], [20.0, 20.0]), measured=True)
    assert measured.plan().link_m == 200.0
    assert links.MAX_SAMPLES == 2_000_000


@pytest.mark.parametrize("digits", [3, 2, 1, 0])
@pytest.mark.parametrize("km_h", [30.0, 50.0, 80.0, 120.0])
def test_rounded_travel_times_do_not_change_the_drive(km_h, digits):
    length = np.random.default_rng(3).uniform(80.0, 400.0, 60).round()
    time = length / (km_h / 3.6)
    exact, rounded = (route(length, times).plan() for times in (time, time.round(digits)))
    assert rounded.link_m == pytest.approx(exact.link_m, rel=1e-3)
    strokes = [
        float(np.maximum(np.diff(plan.array("speed_m_s") ** 2), 0.0).sum()) for plan in (exact, rounded)
    ]
    assert strokes[1] == pytest.approx(strokes[0], rel=0.03)
    assert uncut([200.0, 300.0, 100.0], [20.0, 30.0, 20.0]) == pytest.approx((500.0**2 + 100.0**2) / 600.0)


def test_equal_neighbours_beyond_the_longest_link_stay_apart(monkeypatch):
    monkeypatch.setattr(links, "LONGEST_LINK_M", 600.0)
    assert uncut([300.0, 300.0], [30.0, 30.0]) == 600.0
    assert uncut([300.0, 300.5], [30.0, 30.05]) == pytest.approx(300.25, abs=0.01)
