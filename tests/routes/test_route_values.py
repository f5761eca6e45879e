"""Numbers of links, points and routers' answers, each bound from both sides."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes import (
    LinkRoute,
    LinkStyle,
    calibrate_style,
    documents,
    join_routes,
    link_objects,
    links,
    links_of_trip,
    plan_from_links,
    points,
    polyline,
    road_work,
    route_from_links,
)
from tripwatt.routes.answers import intervals, speeds_at_points
from tripwatt.routes.calibrate import LINK_LENGTHS_M
from tripwatt.routes.documents import Node, content
from tripwatt.routes.link_objects import columns_of_links
from tripwatt.routes.links import _limits, _moving_speeds, _stops, _stretches
from tripwatt.routes.points import haversine_m, require_on_earth
from tripwatt.routes.polyline import decode_polyline
from tripwatt.routes.responses import (
    Pieces,
    heights_of,
    route_from_graphhopper,
    route_from_openrouteservice,
    route_from_osrm,
    route_from_valhalla,
    router_of,
)
from tripwatt.trips import Flag, Trip

NO = np.nan
EXACT = {"rtol": 1e-12, "atol": 1e-9}


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


def test_values_below_one_are_values():
    slow = {"stop_s": [0.5], "moving_speed_m_s": [0.5], "speed_limit_m_s": [0.5]}
    assert route([0.5], [0.9], **slow).distance_m == 0.5
    assert links_of_trip(logged([1.0] * 3), 0.5).length_m.tolist() == [0.5] * 4
    assert links_of_trip(logged([0.2] * 3), 5.0).distance_m == pytest.approx(0.4)
    assert links_of_trip(logged([5.0, 5.0])).length_m.tolist() == [5.0]


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
    with pytest.raises(InvalidInput, match=r"link 2, length_m: got 0 \(and 1 more links\)"):
        route([9.0, 0.0, 0.0], [9.0] * 3)


def test_one_wrong_link_is_not_counted():
    with pytest.raises(InvalidInput) as caught:
        route([9.0, 0.0], [9.0] * 2)
    assert caught.value.faults[0].got == "0"


def test_what_is_not_given_of_a_route():
    plain = route([9.0], [9.0])
    assert plain.free_flow is False
    assert plan_from_links(plain).step_s == 1.0
    assert plain.speed_limit_m_s is None
    assert plain.elevation_at([0.0]) is None
    assert route([9.0], [9.0], elevation_m=[5.0]).elevation_at([0.0]) is None
    assert route([9.0], [9.0], elevation_position_m=[0.0]).elevation_at([0.0]) is None


def logged(speed, **columns):
    time = 5.0 + np.arange(float(len(speed)))
    return Trip.from_samples("t", pd.DataFrame({"time_s": time, "speed_m_s": speed, **columns}))


def test_links_of_a_trip_by_hand():
    """100 m at 10 m/s, a standstill of 5 s, 60 m at 20 m/s with half seconds of change on both sides."""
    speed = [10.0] * 11 + [0.0] * 6 + [20.0] * 4
    trip = logged(speed, elevation_m=np.linspace(500.0, 520.0, 21))
    made = links_of_trip(trip, 60.0)
    np.testing.assert_allclose(made.length_m, [60.0, 60.0, 55.0], **EXACT)
    # 60 m after 6 s; 105 m when it stands, 5 s standing, 10 m more while it starts, then 5 m at 20 m/s
    np.testing.assert_allclose(made.travel_time_s, [6.0, 4.0 + 1.0 + 5.0 + 1.0 + 0.25, 2.75], **EXACT)
    np.testing.assert_allclose(made.elevation_at([0.0, 60.0, 175.0]), [500.0, 506.0, 520.0], **EXACT)
    assert made.flags == ()
    assert len(links_of_trip(trip, 400.0)) == 1
    assert len(links_of_trip(trip)) == 1
    assert len(links_of_trip(logged([10.0] * 51))) == 2
    assert len(links_of_trip(trip, 71.0)) == 2


def test_a_link_of_a_trip_starts_with_its_first_sample_and_ends_with_its_last():
    made = links_of_trip(logged([0.0] * 4 + [10.0] * 11 + [0.0] * 4), 55.0)
    np.testing.assert_allclose(made.length_m, [55.0, 55.0], **EXACT)
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
    np.testing.assert_allclose(made.elevation_m, [500.0, 505.0, 510.0, 505.0, 500.0], **EXACT)
    flat = links_of_trip(logged([10.0] * 21), 50.0)
    assert flat.elevation_m is None
    assert flat.flags == (Flag("no_elevation", "road"),)


@pytest.mark.parametrize("length_m", [0.0, -1.0, NO, np.inf])
def test_a_length_that_cuts_nothing(length_m):
    with pytest.raises(InvalidInput, match="length out of range"):
        links_of_trip(logged([10.0] * 5), length_m)
    with pytest.raises(InvalidInput, match="trip without distance"):
        links_of_trip(logged([0.0] * 5))


def test_a_plan_has_two_million_samples_of_a_millisecond(monkeypatch):
    with pytest.raises(InvalidInput, match=r"allowed: 0\.05 s or more"):
        plan_from_links(route([50_000.0], [100_000.0]), step_s=0.0499)
    with pytest.raises(InvalidInput, match=r"allowed: 0\.001 s or more"):
        plan_from_links(route([90.0], [10.0]), step_s=0.0009)
    monkeypatch.setattr(links, "MOST_SAMPLES", 100)
    assert plan_from_links(route([90.0], [10.0]), step_s=0.1).step_s == 0.1


def stretches(length, stop=None):
    made = route(length, [60.0] * len(length), **({} if stop is None else {"stop_s": stop}))
    return _stretches(made).tolist()


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


def test_a_stop_at_the_end_of_joined_links_is_where_it_was_given():
    """20 m and 480 m in 50 s with a stop of 10 s behind them, then 500 m."""
    made = route([20.0, 480.0, 500.0], [2.0, 48.0, 45.0], stop_s=[0.0, 10.0, 0.0])
    plan = plan_from_links(made, step_s=0.5)
    speed = plan.array("speed_m_s")
    standing = np.flatnonzero(speed[5:-5] == 0.0) + 5
    assert len(standing) in (20, 21)
    assert speed[: standing[0]].sum() * 0.5 == pytest.approx(500.0, rel=0.01)


def test_what_is_known_of_joined_links():
    made = route(
        [30.0, 30.0, 60.0, 30.0, 30.0],
        [10.0, 10.0, 10.0, 20.0, 20.0],
        stop_s=[NO, 0.0, NO, NO, 5.0],
        moving_speed_m_s=[10.0, 15.0, NO, 10.0, NO],
        speed_limit_m_s=[10.0, 20.0, NO, NO, 5.0],
    )
    first, last = np.array([0, 2, 3]), np.array([1, 2, 4])
    np.testing.assert_array_equal(_stops(made, first, last), [NO, NO, 5.0])
    known = route([30.0, 30.0], [10.0, 10.0], stop_s=[0.0, 4.0])
    np.testing.assert_array_equal(_stops(known, np.array([0, 1]), np.array([0, 1])), [0.0, 4.0])
    np.testing.assert_array_equal(_stops(known, np.array([0]), np.array([1])), [4.0])
    np.testing.assert_array_equal(_moving_speeds(made, first), [60.0 / (3.0 + 2.0), NO, NO])
    np.testing.assert_array_equal(_limits(made, first), [20.0, NO, NO])
    assert _limits(route([30.0], [9.0]), np.array([0])) is None


def test_joined_routes_by_hand():
    one = route([400.0, 100.0], [40.0, 9.0], elevation_position_m=[0.0, 500.0], elevation_m=[5.0, 9.0])
    two = route(
        [300.0], [20.0], elevation_position_m=[0.0, 300.0], elevation_m=[9.0, 3.0], speed_limit_m_s=[20.0]
    )
    both = join_routes([one, two, one])
    assert both.elevation_position_m.tolist() == [0.0, 500.0, 500.0, 800.0, 800.0, 1300.0]
    assert both.elevation_m.tolist() == [5.0, 9.0, 9.0, 3.0, 5.0, 9.0]
    np.testing.assert_array_equal(both.speed_limit_m_s, [NO, NO, 20.0, NO, NO])
    assert both.flags == ()
    flat = join_routes([one, route([300.0], [20.0])])
    assert flat.elevation_m is None
    assert flat.elevation_position_m is None
    assert flat.flags == (Flag("no_elevation", "road"),)
    told = route([300.0], [20.0], flags=(Flag("no_elevation", "road"),))
    assert join_routes([told, told]).flags == told.flags


def uncut(length, time, **more):
    """The mean length of the links of a plan, weighted by length: which neighbours count as one."""
    made = plan_from_links(route(length, time, **more))
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


def test_speeds_that_differ_by_a_millionth_are_one():
    assert uncut([200.0, 200.0], [20.0, 20.00001]) == 400.0
    assert uncut([200.0, 200.0], [20.0, 20.00003]) == 200.0
    assert links.MOST_SAMPLES == 2_000_000
    assert uncut([200.0, 300.0, 100.0], [20.0, 30.0, 20.0]) == pytest.approx((500.0**2 + 100.0**2) / 600.0)


@pytest.mark.parametrize(
    "more",
    [
        {"stop_s": [5.0, NO, NO]},
        {"stop_s": [NO, 0.0, 0.0]},
        {"moving_speed_m_s": [12.0, NO, NO]},
        {"moving_speed_m_s": [12.0, 14.0, 14.0]},
        {"moving_speed_m_s": [NO, 14.0, 14.0]},
        {"speed_limit_m_s": [14.0, NO, NO]},
        {"speed_limit_m_s": [NO, 16.0, 16.0]},
    ],
)
def test_each_link_is_compared_with_its_own_neighbour(more):
    """The second and the third are one."""
    found = uncut([200.0] * 3, [20.0] * 3, **more)
    assert found == pytest.approx((200.0**2 + 400.0**2) / 600.0)


def test_equal_neighbours_beyond_the_longest_link_stay_apart(monkeypatch):
    monkeypatch.setattr(links, "LONGEST_LINK_M", 600.0)
    assert uncut([300.0, 300.0], [30.0, 30.0]) == 600.0
    assert uncut([300.0, 300.5], [30.0, 30.05]) == pytest.approx(300.25, abs=0.01)


LINK = {"length_m": 100.0, "speed_m_s": 10.0}


@pytest.mark.parametrize(
    ("change", "sound"),
    [
        ({"grade": 0.4}, True),
        ({"grade": -0.4}, True),
        ({"grade": 0.41}, False),
        ({"grade": -0.41}, False),
        ({"length_m": 0.0}, False),
        ({"speed_m_s": 0.0}, False),
        ({"speed_m_s": None, "travel_time_s": 0.0}, False),
        ({"speed_m_s": None, "travel_time_s": 0.5, "stop_s": 0.25}, False),
        ({"speed_m_s": None, "travel_time_s": 5.0}, True),
        ({"travel_time_s": 5.0}, False),
        ({"speed_m_s": None}, False),
        ({"length_m": None}, False),
        ({"start_elevation_m": 5.0}, False),
        ({"end_elevation_m": 5.0}, False),
        ({"start_elevation_m": 5.0, "end_elevation_m": 6.0}, True),
        ({"start_elevation_m": 5.0, "end_elevation_m": 6.0, "grade": 0.01}, False),
        ({"start_elevation_m": 5.0, "grade": 0.01}, False),
    ],
)
def test_a_link_is_sound_or_refused(change, sound):
    given = [LINK, {**LINK, **change}]
    columns, faults = columns_of_links(given)
    assert len(columns["length_m"]) == 2
    assert bool(faults) != (sound or change.get("travel_time_s") == 0.5)
    if sound:
        assert len(route_from_links(given)) == 2
        return
    with pytest.raises(InvalidInput):
        route_from_links(given)


def faults_of_links(links):
    with pytest.raises(InvalidInput) as caught:
        route_from_links(links)
    return [str(fault) for fault in caught.value.faults]


def test_three_alike_faults_are_named_and_more_are_counted():
    found = faults_of_links([LINK, *[{**LINK, "colour": 1.0}] * 3])
    assert [
        f"unknown key: link {k}: got 'colour'" in text for k, text in zip((2, 3, 4), found, strict=True)
    ] == [True] * 3
    (counted,) = faults_of_links([LINK, *[{**LINK, "colour": 1.0}] * 4])
    assert "link 2: got 'colour' (and 3 more links);" in counted
    found = faults_of_links([{**LINK, "colour": 1.0, "length_m": -1.0}] * 50)
    assert [text.partition(":")[0] for text in found] == ["unknown key", "link out of range"]


def test_fifty_faults_are_named_and_the_rest_counted():
    def faults(n):
        return faults_of_links([{**LINK, **{f"c{k}": 1.0 for k in range(n)}}])

    assert len(faults(50)) == 50
    assert (len(faults(51)), faults(51)[-1].partition(";")[0]) == (51, "unknown key: links: got 1 more")
    assert (len(faults(53)), faults(53)[-1].partition(";")[0]) == (51, "unknown key: links: got 3 more")


def test_too_many_links_are_refused_before_they_are_read(monkeypatch):
    monkeypatch.setattr(link_objects, "MOST_LINKS", 3)
    assert len(route_from_links([LINK] * 3)) == 3
    with pytest.raises(InvalidInput, match="too many links"):
        route_from_links(LINK for _ in range(4))
    with pytest.raises(InvalidInput, match="no links"):
        route_from_links([])


def test_heights_of_links():
    by_grade = route_from_links([{**LINK, "grade": 0.02}, LINK, {**LINK, "length_m": 300.0, "grade": -0.01}])
    assert by_grade.elevation_position_m.tolist() == [0.0, 100.0, 200.0, 500.0]
    np.testing.assert_allclose(by_grade.elevation_m, [1.0, 3.0, 3.0, 0.0], **EXACT)  # above the lowest place
    assert by_grade.flags == (Flag("elevation_relative", "road"),)
    ends = {"start_elevation_m": 5.0, "end_elevation_m": 7.0}
    known = route_from_links(
        [{**LINK, **ends}, LINK, {**LINK, "start_elevation_m": 9.0, "end_elevation_m": 1.0}]
    )
    assert known.elevation_position_m.tolist() == [0.0, 100.0, 200.0, 300.0]
    assert known.elevation_m.tolist() == [5.0, 7.0, 9.0, 1.0]
    assert known.flags == (Flag("elevation_interpolated", "links"),)
    assert route_from_links([{**LINK, **ends}]).flags == ()
    with pytest.raises(InvalidInput, match="grade and elevation mixed"):
        route_from_links([{**LINK, **ends}, {**LINK, "grade": 0.01}])
    assert route_from_links([LINK]).elevation_m is None


def test_values_that_are_no_numbers_are_named_once():
    with pytest.raises(InvalidInput) as caught:
        route_from_links([{"length_m": "x", "speed_m_s": "y", "grade": "z", "stop_s": float("inf")}])
    assert [f.what for f in caught.value.faults] == ["not a number"] * 3 + ["not a finite number"]


@pytest.mark.parametrize("name", ["grade", "stop_s", "length_m", "speed_m_s", "moving_speed_m_s"])
def test_an_endless_value_is_one_fault(name):
    with pytest.raises(InvalidInput) as caught:
        route_from_links([{**LINK, name: float("inf")}])
    assert [str(fault) for fault in caught.value.faults] == [
        f"not a finite number: link 1, {name}: got inf; allowed: a finite number"
    ]


def test_distances_on_the_sphere():
    """The mean radius of the earth is 6371.0088 km."""
    quarter = np.pi / 2.0 * 6_371_008.8
    np.testing.assert_allclose(haversine_m([0.0, 90.0], [0.0, 0.0]), quarter, **EXACT)
    np.testing.assert_allclose(
        haversine_m([0.0, 0.0, 0.0], [-45.0, 45.0, 46.0]), [quarter, quarter / 90.0], rtol=1e-9
    )
    np.testing.assert_allclose(haversine_m([90.0, -90.0], [0.0, 77.0]), 2.0 * quarter, **EXACT)
    # at 60 degrees a degree of longitude: sin(d / 2R) = cos 60 sin 0.5
    degree = 2.0 * 6_371_008.8 * np.arcsin(0.5 * np.sin(np.radians(0.5)))
    np.testing.assert_allclose(haversine_m([60.0, 60.0], [10.0, 11.0]), degree, rtol=1e-9)
    # from the equator to 60 degrees, a quarter turn away: the central angle has a cosine of 0
    np.testing.assert_allclose(haversine_m([0.0, 60.0], [0.0, 90.0]), quarter, rtol=1e-9)


def test_polylines_by_hand():
    """Five bits to a character, the lowest first, 63 added, 32 where more follow; the sign is the lowest bit."""
    np.testing.assert_allclose(decode_polyline("A@A@", "t"), [[1e-5, -1e-5], [2e-5, -2e-5]], **EXACT)
    np.testing.assert_allclose(
        decode_polyline("_AC??", "t", precision=10.0), [[3.2, 0.2], [3.2, 0.2]], **EXACT
    )
    three = decode_polyline("AC" + "_A" + "??" + "@", "t", dimensions=3)
    np.testing.assert_allclose(three, [[1e-5, 2e-5, 0.32], [1e-5, 2e-5, 0.31]], **EXACT)
    assert not decode_polyline("_" * 9 + "????", "t").any()
    np.testing.assert_allclose(decode_polyline("~@???", "t", precision=10.0)[0], [-3.2, 0.0], **EXACT)


@pytest.mark.parametrize("text", ["", "AA", "AAA", "AAA_", "AA>A", "AA\x7fA", "_" * 10 + "????"])
def test_broken_polylines(text):
    with pytest.raises(InvalidInput, match="not an encoded polyline"):
        decode_polyline(text, "t")


def test_lengths_of_polylines(monkeypatch):
    monkeypatch.setattr(polyline, "MOST_POINTS", 2)
    monkeypatch.setattr(points, "MOST_POINTS", 2)
    assert len(decode_polyline("?" * 4, "t")) == 2
    with pytest.raises(InvalidInput, match="too many points"):
        decode_polyline("?" * 6, "t")
    with pytest.raises(InvalidInput, match="too many points"):
        decode_polyline("?" * 64, "t")
    with pytest.raises(InvalidInput, match="polyline too long"):
        decode_polyline("?" * 65, "t")


def test_places_on_earth():
    require_on_earth(np.array([90.0, -90.0]), np.array([180.0, -180.0]), "t")
    for lat, lon, words in ((90.1, 0.0, "point 2, latitude"), (0.0, -180.1, "point 2, longitude")):
        with pytest.raises(InvalidInput, match=words):
            require_on_earth(np.array([0.0, lat]), np.array([0.0, lon]), "t")
    with pytest.raises(InvalidInput, match=r"91° \(and 1 more points\)"):
        require_on_earth(np.array([0.0, 91.0, 92.0]), np.zeros(3), "t")


def test_the_most_bytes_and_points_of_a_route(monkeypatch, tmp_path):
    assert documents.MOST_BYTES == 64 * 2**20
    assert points.MOST_POINTS == 500_000
    monkeypatch.setattr(documents, "MOST_BYTES", 4)
    (tmp_path / "four").write_bytes(b"1234")
    (tmp_path / "five").write_bytes(b"12345")
    assert content(b"1234") == (b"1234", "route")
    assert content(tmp_path / "four") == (b"1234", "four")
    for source in (b"12345", tmp_path / "five"):
        with pytest.raises(InvalidInput, match="too large"):
            content(source)


def test_numbers_and_lists_of_json():
    assert Node(2, "t").number(least=2.0) == 2.0
    for value in (1.9, True, "2", None, float("inf"), 10**400):
        with pytest.raises(InvalidInput, match="2 or more"):
            Node(value, "t").number(least=2.0)
    with pytest.raises(InvalidInput, match="a number without end"):
        Node(10**18 + 1, "t").entries()
    with pytest.raises(InvalidInput, match=f"got {10**18};"):
        Node(10**18, "t").entries()
    assert [entry.value for entry in Node([1], "t").entries(least=1)] == [1]
    with pytest.raises(InvalidInput, match="too few entries"):
        Node([], "t").entries(least=1)
    assert Node({}, "t").members() == {}


def test_positions_of_geojson():
    found = Node([[11.0, 48.0], [12.0, 49.0, None], [13.0, 50.0, 500.0]], "t").coordinates()
    np.testing.assert_array_equal(found, [[48.0, 11.0, NO], [49.0, 12.0, NO], [50.0, 13.0, 500.0]])
    for wrong in ([[11.0, 48.0]], [[11.0], [12.0, 49.0]]):
        with pytest.raises(InvalidInput, match="at least 2"):
            Node(wrong, "t").coordinates()


def test_pieces_without_length_or_time_go_to_the_next():
    pieces = Pieces()
    for length, time in ((0.0, 5.0), (100.0, 10.0), (30.0, 0.0), (0.005, 1.0), (64.0, 9.0), (2.0, 0.0)):
        pieces.add(length, time)
    made = pieces.route("t", (np.array([0.0, 1.0, 4.0]), np.array([5.0, 6.0, 7.0])), Flag("a", "b"))
    np.testing.assert_allclose(made.length_m, [100.0, 30.005, 66.0], **EXACT)
    assert made.travel_time_s.tolist() == [15.0, 1.0, 9.0]
    np.testing.assert_allclose(made.elevation_position_m, np.array([0.0, 0.25, 1.0]) * 196.005, **EXACT)
    assert made.flags == (Flag("a", "b"),)


def test_time_after_the_last_piece_belongs_to_it():
    pieces = Pieces()
    pieces.add(100.0, 10.0)
    pieces.add(0.0, 4.0)
    made = pieces.route("t", None)
    assert (made.length_m.tolist(), made.travel_time_s.tolist()) == ([100.0], [14.0])
    assert made.flags == (Flag("no_elevation", "road"),)


def test_a_piece_has_a_centimetre_and_some_time():
    pieces = Pieces()
    pieces.add(0.01, 1.0, 8.0)
    pieces.add(0.009, 1.0, 9.0)
    pieces.add(5.0, 2.0, 7.0)
    assert pieces.length_m == [0.01, 5.009]
    assert pieces.time_s == [1.0, 3.0]
    assert pieces.moving_m_s == [8.0, 7.0]
    assert (pieces.left_m, pieces.left_s) == (0.0, 0.0)
    with pytest.raises(InvalidInput, match="no route"):
        Pieces().route("t", None)


def test_heights_of_points():
    at = np.array([[0.0, 0.0, 500.0], [0.0, 1.0, NO], [0.0, 3.0, 530.0], [0.0, 4.0, NO]])
    position, height = heights_of(at)
    degree = np.pi / 180.0 * 6_371_008.8
    np.testing.assert_allclose(position, degree * np.array([0.0, 1.0, 3.0, 4.0]), rtol=1e-9)
    np.testing.assert_allclose(height, [500.0, 510.0, 530.0, 530.0], rtol=1e-9)
    assert heights_of(at[:, :2]) is None
    assert heights_of(np.full((2, 3), NO)) is None
    assert heights_of(np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 6.0]])) is None


def leg_of(duration, distances, durations):
    return {"duration": duration, "annotation": {"distance": distances, "duration": durations}}


def test_what_a_leg_takes_longer_is_shared_out():
    """60 s for pieces of 10 and 30 s: each takes half as long again, and its moving speed stays."""
    made = route_from_osrm({"routes": [{"legs": [leg_of(60.0, [100.0, 450.0], [10.0, 30.0])]}]})
    np.testing.assert_allclose(made.travel_time_s, [15.0, 45.0], **EXACT)
    np.testing.assert_allclose(made.moving_speed_m_s, [10.0, 15.0], **EXACT)
    shorter = route_from_osrm({"routes": [{"legs": [leg_of(20.0, [100.0, 450.0], [10.0, 30.0])]}]})
    np.testing.assert_allclose(shorter.travel_time_s, [10.0, 30.0], **EXACT)
    empty = route_from_osrm({"routes": [{"legs": [leg_of(20.0, [0.0, 450.0], [10.0, 30.0])]}]})
    np.testing.assert_allclose(empty.moving_speed_m_s, [15.0], **EXACT)
    assert empty.travel_time_s.tolist() == [40.0]


def test_of_several_routes_the_first_is_used():
    leg = {"distance": 900.0, "duration": 60.0}
    several = route_from_osrm({"routes": [{"legs": [leg]}, {"legs": []}, {}]})
    assert several.flags[0] == Flag("first_of_several", "routes", 3.0, "1")
    assert several.distance_m == 900.0
    assert route_from_osrm({"routes": [{"legs": [leg]}]}).flags == (Flag("no_elevation", "road"),)


def test_legs_of_valhalla_follow_each_other():
    def leg(km, seconds, heights):
        return {"maneuvers": [{"length": km, "time": seconds}], "elevation": heights}

    trip = {"legs": [leg(1.0, 60.0, [500.0, 510.0]), leg(3.0, 90.0, [510.0, 530.0, 520.0])]}
    made = route_from_valhalla({"trip": trip})
    assert made.length_m.tolist() == [1000.0, 3000.0]
    np.testing.assert_allclose(made.elevation_position_m, [0.0, 1000.0, 1000.0, 2500.0, 4000.0], **EXACT)
    assert made.elevation_m.tolist() == [500.0, 510.0, 510.0, 530.0, 520.0]
    trip["legs"][0].pop("elevation")
    assert route_from_valhalla({"trip": trip}).elevation_m is None
    miles = route_from_valhalla({"trip": {"units": "miles", "legs": [leg(1.0, 60.0, [100.0, 200.0])]}})
    assert miles.distance_m == 1609.344
    np.testing.assert_allclose(miles.elevation_m, [30.48, 60.96], **EXACT)


def test_segments_of_openrouteservice():
    segment = {"distance": 1.5, "duration": 120.0}
    made = route_from_openrouteservice(
        {"routes": [{"segments": [segment]}], "metadata": {"query": {"units": "km"}}}
    )
    assert (made.distance_m, made.duration_s) == (1500.0, 120.0)
    assert made.elevation_m is None


def test_details_of_graphhopper():
    """Points a degree apart, on a path that is twice as long; times in milliseconds, speeds in km/h."""
    path = {
        "distance": 2.0 * 2.0 * np.pi / 180.0 * 6_371_008.8,
        "points": {"coordinates": [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]},
        "details": {"time": [[0, 1, 9_000_000], [1, 2, 8_000_000]], "average_speed": [[0, 2, 90.0]]},
    }
    made = route_from_graphhopper({"paths": [path]})
    np.testing.assert_allclose(made.length_m, path["distance"] / 2.0, rtol=1e-9)
    np.testing.assert_allclose(made.travel_time_s, [9000.0, 8000.0], **EXACT)
    np.testing.assert_allclose(made.moving_speed_m_s, 25.0, **EXACT)
    without = {"distance": 900.0, "time": 60_000.0}
    assert route_from_graphhopper({"paths": [without]}).duration_s == 60.0


def test_intervals_of_points():
    found = intervals(Node([[0, 2, 5.0], [2, 2, None]], "t"), 3)
    assert [(start, end, value.value) for start, end, value in found] == [(0, 2, 5.0), (2, 2, None)]
    for wrong in ([0, 3, 5.0], [2, 1, 5.0], [0.5, 1, 5.0], [0, 1.5, 5.0]):
        with pytest.raises(InvalidInput, match="point index out of range"):
            [v.number(least=0.0) for _, _, v in intervals(Node([wrong], "t"), 3)]
    for wrong in ([0, 1], [-1, 1, 5.0], [0, 1, -5.0]):
        with pytest.raises(InvalidInput):
            [v.number(least=0.0) for _, _, v in intervals(Node([wrong], "t"), 3)]


def test_speeds_of_intervals():
    found = speeds_at_points(Node([[0, 2, 36.0], [2, 2, 72.0], [3, 4, 0.0]], "t"), 5)
    np.testing.assert_allclose(found, [10.0, 10.0, 20.0, NO, NO], **EXACT)
    assert np.isnan(speeds_at_points(Node(None, "t"), 2)).all()


@pytest.mark.parametrize(
    ("response", "router"),
    [
        ({"trip": {}}, "valhalla"),
        ({"paths": []}, "graphhopper"),
        ({"features": [{"properties": {"segments": []}}]}, "openrouteservice"),
        ({"features": [{"properties": {}}]}, None),
        ({"features": [{}]}, None),
        ({"features": []}, None),
        ({"features": [5]}, None),
        ({"code": "Ok"}, "osrm"),
        ({"routes": [{"legs": []}]}, "osrm"),
        ({"routes": [{}]}, "openrouteservice"),
        ({"routes": []}, None),
        ({"error": 5}, "openrouteservice"),
        ({}, None),
    ],
)
def test_responses_are_told_apart(response, router):
    assert router_of(response) == router


def test_the_work_of_a_compact_car_by_hand():
    """Rolling 0.01 g, drag 2.6e-4 v², inertia 1.05; 85 % of it on the way out, 70 % on the way back."""
    trip = Trip.from_samples(
        "t", pd.DataFrame({"time_s": [3.0, 7.0, 9.0, 14.0], "speed_m_s": [0.0, 20.0, 20.0, 0.0]})
    )
    rolling = 0.01 * 9.80665
    up = (rolling + 2.6e-4 * 100.0 + 1.05 * 5.0) * 10.0
    steady = (rolling + 2.6e-4 * 400.0) * 20.0
    down = (rolling + 2.6e-4 * 100.0 - 1.05 * 4.0) * 10.0
    expected = up / 0.85 * 4.0 + steady / 0.85 * 2.0 + 0.7 * down * 5.0
    assert road_work(trip) == pytest.approx(expected, rel=1e-12)


def test_slow_driving_takes_work_and_slow_braking_gives_some_back():
    """At a walking pace the power per mass is far below 1 W/kg: 0.01 g and 2.6e-4 v² at 1 m/s."""
    steady = Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 10.0], "speed_m_s": [1.0, 1.0]}))
    assert road_work(steady) == pytest.approx((0.0980665 + 2.6e-4) / 0.85 * 10.0, rel=1e-12)
    slower = Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 5.0], "speed_m_s": [1.5, 0.5]}))
    power = 0.0980665 + 2.6e-4 - 1.05 * 0.2
    assert road_work(slower) == pytest.approx(0.7 * power * 5.0, rel=1e-12)
    assert LINK_LENGTHS_M == (250.0, 1000.0)


def cruise(name, n=101):
    return Trip.from_samples(
        name, pd.DataFrame({"time_s": np.arange(float(n)), "speed_m_s": np.full(n, 10.0)})
    )


def calibrated(monkeypatch, answer, tried=(), **options):
    """The style from an answer of the search, what the search was given, and its loss at some places."""
    seen = {}

    def search(loss, first, **given):
        seen.update(given, first=first, losses=[loss(np.array(x)) for x in tried])
        return SimpleNamespace(x=np.array(answer))

    monkeypatch.setattr("scipy.optimize.minimize", search)
    used = []

    def energy(trip):
        used.append(trip.trip_id)
        return 100.0 if trip.trip_id != "route" else 130.0

    trips = options.pop("trips", [cruise("A")])
    style = calibrate_style(trips, energy=energy, **options)
    return style, seen, dict.fromkeys(used)


def test_the_search_starts_at_the_style_and_a_quarter_more(monkeypatch):
    style, seen, _ = calibrated(monkeypatch, [9.0, 0.4, 0.3])
    np.testing.assert_allclose(seen["first"], [8.9, 0.43, 0.27])
    np.testing.assert_allclose(
        seen["options"]["initial_simplex"],
        [[8.9, 0.43, 0.27], [8.9 * 1.25, 0.43, 0.27], [8.9, 0.43 * 1.25, 0.27], [8.9, 0.43, 0.27 * 1.25]],
    )
    assert (seen["options"]["maxfev"], seen["options"]["xatol"], seen["options"]["fatol"]) == (
        120,
        5e-3,
        2e-5,
    )
    assert (style.street_speed_m_s, style.length_exponent, style.comfort) == (9.0, 0.4, 0.3)
    assert (style.sharpness, style.stop_place) == (3.5, 0.5)


def test_one_length_of_links_leaves_the_growth_alone(monkeypatch):
    start = LinkStyle(length_exponent=0.7)
    style, seen, _ = calibrated(monkeypatch, [9.0, 0.3], length_m=(250.0,), style=start)
    assert len(seen["first"]) == 2
    assert (style.street_speed_m_s, style.length_exponent, style.comfort) == (9.0, 0.7, 0.3)


def test_the_found_style_keeps_to_its_bounds(monkeypatch):
    low, seen, _ = calibrated(
        monkeypatch, [1.0, -0.5, 0.01], tried=[[1.0, 0.5, 0.5], [9.0, 0.4, 0.9], [9.0, 0.4, 0.3]]
    )
    assert (low.street_speed_m_s, low.length_exponent, low.comfort) == (2.0, 0.0, 0.08)
    # driven again, the trip takes three tenths more; beyond a bound the distance from it is added
    np.testing.assert_allclose(seen["losses"], [0.3 + 1.0, 0.3 + 0.1, 0.3])
    high, _, _ = calibrated(monkeypatch, [99.0, 0.99, 0.99])
    assert (high.street_speed_m_s, high.length_exponent, high.comfort) == (30.0, 0.8, 0.8)


def test_of_many_trips_every_nth_is_used(monkeypatch):
    trips = [cruise(f"T{k}") for k in range(5)]
    answer = [9.0, 0.4, 0.3]
    assert list(calibrated(monkeypatch, answer, trips=trips, most_trips=2)[2]) == ["T0", "T3"]
    assert list(calibrated(monkeypatch, answer, trips=trips, most_trips=5)[2]) == [f"T{k}" for k in range(5)]
    many = [cruise(f"T{k}", 11) for k in range(41)]
    assert len(calibrated(monkeypatch, answer, trips=many[:40])[2]) == 40
    assert len(calibrated(monkeypatch, answer, trips=many)[2]) == 21


def test_trips_without_positive_energy_are_refused():
    for energy in (0.0, -1.0, NO):
        with pytest.raises(InvalidInput, match="no positive energy"):
            calibrate_style([cruise("A")], energy=lambda trip, found=energy: found)


def test_little_energy_is_energy(monkeypatch):
    found = SimpleNamespace(x=np.array([9.0, 0.4, 0.3]))
    monkeypatch.setattr("scipy.optimize.minimize", lambda *args, **more: found)
    assert calibrate_style([cruise("A")], energy=lambda trip: 0.5).comfort == 0.3
