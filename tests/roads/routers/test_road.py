"""Roads of edges: links, lines, heights, and their ends."""

import math

import numpy as np
import pytest
from tests.roads.routers.made import EXACT, HALF_M, NO, A, B, valhalla_router
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.routers import Edges, Road, join_edges, road
from tripwatt.roads.routers.road import Leg
from tripwatt.routes.places import Place

DEGREE_M = 6_371_008.8 * math.pi / 180.0


def edges(length, time, speed=None, limit=None, kinds=None, signal=None):
    n = len(length)
    full = lambda values: np.full(n, NO) if values is None else np.array(values, dtype=float)  # noqa: E731
    signals = np.zeros(n, dtype=bool) if signal is None else np.array(signal)
    return Edges(
        full(length),
        full(time),
        full(speed),
        full(limit),
        tuple(kinds or [""] * n),
        signals,
        np.zeros(n, dtype=bool),
    )


def lengths(*columns, **more):
    return join_edges(edges(*columns, **more))[0].length_m.tolist()


def test_a_standstill_at_a_signal_has_two_seconds():
    for seconds, stop in ((12.0, 2.0), (11.99, NO)):
        links, _ = join_edges(edges([100.0], [seconds], [10.0], signal=[True]))
        np.testing.assert_array_equal(links.stop_s, [stop])


def test_edges_have_one_speed_up_to_what_rounding_leaves(monkeypatch):
    """A second edge of 2 s may be off by 1/16 s and by 1/32 of its time: by 1/8 s."""
    monkeypatch.setattr(road, "SAME_TIME_S", 0.0625)
    monkeypatch.setattr(road, "SAME_SPEED", 0.03125)
    for first_s, number in ((2.125, 1), (1.875, 1), (2.126, 2), (1.874, 2)):
        assert len(lengths([100.0, 100.0], [first_s, 2.0])) == number


def test_the_speed_of_all_edges_of_a_link_counts():
    """Each edge takes 3 % longer than the one before: the third is too slow for the first two together."""
    assert lengths([100.0] * 3, [10.0, 10.35, 10.7]) == [200.0, 100.0]
    assert lengths([0.5, 100.0], [1.0, 10.0]) == [0.5, 100.0]


def test_pieces_without_length_or_time_join_what_follows():
    """A centimetre is a link."""
    assert lengths([0.01, 100.0], [1.0, 10.0]) == [0.01, 100.0]
    assert lengths([0.009, 100.0], [1.0, 10.0]) == [100.009]
    assert lengths([5.0, 100.0], [0.0, 10.0]) == [105.0]
    assert lengths([5.0, 100.0], [0.5, 10.0], kinds=["a", "b"]) == [5.0, 100.0]
    assert lengths([100.0, 0.01], [10.0, 1.0]) == [100.0, 0.01]
    assert lengths([100.0, 0.009], [10.0, 1.0], kinds=["a", "b"]) == [100.009]
    links, kinds = join_edges(edges([100.0, 0.005, 100.0], [10.0, 1.0, 10.0], kinds=["a", "b", "c"]))
    assert (links.length_m.tolist(), kinds) == ([100.0, 100.005], ("a", "b"))
    assert lengths([0.005, 0.005, 100.0], [1.0, 1.0, 10.0], kinds=["a", "b", "c"]) == [0.01, 100.0]


def test_a_limit_that_is_unknown_is_no_limit():
    for pair, number in (([NO, 1.0], 2), ([NO, NO], 1), ([1.0, NO], 2), ([1.0, 1.0], 1)):
        assert len(lengths([5.0, 5.0], [9.0, 9.0], limit=pair)) == number
    assert join_edges(edges([5.0], [9.0]))[0].speed_limit_m_s is None
    assert join_edges(edges([5.0], [9.0], limit=[1.0]))[0].speed_limit_m_s.tolist() == [1.0]


def line(*longitudes, latitude=0.0):
    return np.array([(latitude, lon) for lon in longitudes])


def made(*legs, stops=None):
    """A road on the equator of legs (edges, line, heights)."""
    first, last = legs[0][1][0], legs[-1][1][-1]
    return Road.from_legs([Leg(*leg) for leg in legs], stops or [Place(*first), Place(*last)])


def test_the_way_that_a_car_looks():
    corner = Road(
        join_edges(edges([200.0], [20.0]))[0],
        ("",),
        np.array([0.0, 0.0, 0.001]),
        np.array([0.0, 0.001, 0.001]),
        np.array([0.0, 100.0, 200.0]),
    )
    at = np.array([-1.0, 0.0, 99.0, 100.0, 101.0, 200.0, 300.0])
    np.testing.assert_allclose(corner.heading_at(at), [90.0, 90.0, 90.0, 0.0, 0.0, 0.0, 0.0], atol=1e-3)
    short = Road(corner.links, ("",), np.zeros(2), np.array([0.0, 0.001]), np.array([0.0, 200.0]))
    np.testing.assert_allclose(short.heading_at(at), np.full(7, 90.0), atol=1e-3)
    point = Road(corner.links, ("",), np.zeros(1), np.zeros(1), np.zeros(1))
    assert point.heading_at(at).tolist() == [0.0] * 7
    assert corner.place_at(150.0) == Place(0.0005, 0.001)


@pytest.mark.parametrize(
    ("longitudes", "length_m", "positions"),
    [
        ((0.0, 0.001), 300.0, [0.0, 300.0]),
        ((0.0, 5e-6), 0.5, [0.0, 0.5]),
        ((0.0, 0.0, 0.001, 0.002), 300.0, [0.0, 0.0, 150.0, 300.0]),
        ((0.0, 0.0), 300.0, [0.0, 0.0]),
    ],
)
def test_points_of_a_road_lie_on_the_scale_of_its_links(longitudes, length_m, positions):
    found = made((edges([length_m], [30.0]), line(*longitudes), None))
    np.testing.assert_allclose(found.position_m, positions, **EXACT)
    assert found.stop_position_m == ()


def test_points_of_a_road_lie_by_their_ways_on_the_sphere():
    """A thousandth of a degree to the east, then two to the north."""
    corner = np.array([(0.0, 0.0), (0.0, 0.001), (0.002, 0.001)])
    found = made((edges([300.0], [30.0]), corner, None))
    np.testing.assert_allclose(found.position_m, [0.0, 100.0, 300.0], rtol=1e-6, atol=1e-6)


def test_legs_of_a_road_lie_one_behind_the_other():
    heights = (np.array([0.0, 50.0]), np.array([5.0, 6.0]))
    one = (edges([100.0], [10.0]), line(0.0, 0.001), heights)
    two = (edges([200.0, 100.0], [20.0, 10.0]), line(0.001, 0.004), heights)
    found = made(one, two, one)
    assert found.stop_position_m == (100.0, 400.0)
    assert found.links.elevation_position_m.tolist() == [0.0, 50.0, 100.0, 150.0, 400.0, 450.0]
    assert found.links.elevation_m.tolist() == [5.0, 6.0] * 3
    assert found.links.flags == ()
    flat = made(one, (*two[:2], None))
    assert flat.links.elevation_m is None
    assert [flag.code for flag in flat.links.flags] == ["no_elevation"]


@pytest.mark.parametrize(
    ("length", "time", "speed"),
    [
        ([-1.0, 100.0], [1.0, 10.0], None),
        ([1.0, 100.0], [-1.0, 10.0], None),
        ([NO, 100.0], [1.0, 10.0], None),
        ([1.0, 100.0], [NO, 10.0], None),
        ([math.inf, 100.0], [1.0, 10.0], None),
        ([1.0, 100.0], [math.inf, 10.0], None),
        ([1.0, 100.0], [1.0, 10.0], [0.0, 10.0]),
        ([1.0, 100.0], [1.0, 10.0], [-1.0, 10.0]),
    ],
)
def test_an_impossible_edge_is_counted_from_one(length, time, speed):
    for order, where in ((slice(None), "edge 1"), (slice(None, None, -1), "edge 2")):
        columns = [None if values is None else values[order] for values in (length, time, speed)]
        with pytest.raises(RemoteError, match=f"impossible edge of the road: {where}"):
            made((edges(*columns), line(0.0, 0.001), None))


def test_a_road_has_some_length_and_some_time():
    for length, time in (([0.0], [1.0]), ([1.0], [0.0]), ([], [])):
        with pytest.raises(RemoteError, match="impossible edge of the road: edges"):
            made((edges(length, time), line(0.0, 0.001), None))
    assert made((edges([0.0], [0.0]), line(0.0, 0.001), None)).duration_s == 1.0, "two places at one point"
    brief = made((edges([0.0, 0.5], [0.0, 0.25], [NO, 0.9]), line(0.0, 0.001), None))
    assert brief.distance_m == 0.5
    np.testing.assert_allclose(brief.duration_s, 0.5 / 0.9, **EXACT)


def test_a_road_ends_within_5_kilometres_of_its_places():
    leg = (edges([100.0], [10.0]), line(0.0, 0.001), None)
    for metres, sound in ((4999.0, True), (5001.0, False)):
        off = metres / DEGREE_M
        pairs = [(Place(off, 0.0), Place(0.0, 0.001)), (Place(0.0, 0.0), Place(0.0, 0.001 + off))]
        for stops in pairs:
            if sound:
                assert made(leg, stops=stops).distance_m == 100.0
                continue
            with pytest.raises(InvalidInput, match=r"got 5\.0 km from the nearest road") as caught:
                made(leg, stops=stops)
            assert len(caught.value.faults) == 1
            assert caught.value.faults[0].allowed == "at most 5 km"
    with pytest.raises(InvalidInput) as caught:
        made(leg, stops=(Place(1.0, 0.0), Place(1.0, 0.0)))
    assert len(caught.value.faults) == 2


def test_a_journey_has_two_places_a_metre_apart():
    near, far = Place(0.9 / DEGREE_M, 0.0), Place(1.1 / DEGREE_M, 0.0)
    start = Place(0.0, 0.0)
    road.require_stops([start, far])
    road.require_stops([start, start, far])
    road.require_stops([start, far, start])
    for stops in ([start, near], [start, near, start]):
        refuses("no way to drive", road.require_stops, stops)
    refuses("too few places: stops: got 1;", road.require_stops, [start])


def test_edges_of_one_speed_are_one_link_with_the_delays_in_its_time():
    links, kinds = join_edges(edges([100.0, 300.0, 200.0], [7.0, 15.0, 10.0], [20.0, 20.0, 20.0]))
    assert links.length_m.tolist() == [600.0]
    assert links.travel_time_s.tolist() == [32.0]
    assert links.moving_speed_m_s.tolist() == [20.0]
    assert math.isnan(links.stop_s[0])
    assert kinds == ("",)
    assert links.free_flow


@pytest.mark.parametrize(
    ("more", "lengths"),
    [
        ({}, [200.0]),
        ({"kinds": ["primary", "secondary"]}, [100.0, 100.0]),
        ({"limit": [14.0, 20.0]}, [100.0, 100.0]),
        ({"limit": [14.0, NO]}, [100.0, 100.0]),
        ({"limit": [14.0, 14.0]}, [200.0]),
        ({"signal": [True, False]}, [100.0, 100.0]),
        ({"signal": [False, True]}, [200.0]),
    ],
)
def test_links_end_where_class_limit_or_a_signal_changes(more, lengths):
    links, kinds = join_edges(edges([100.0, 100.0], [10.0, 10.0], **more))
    assert links.length_m.tolist() == lengths
    assert len(kinds) == len(lengths)


def test_a_time_shorter_than_the_free_one_becomes_the_free_one():
    found, _ = join_edges(edges([100.0], [9.0], [10.0]))
    assert found.travel_time_s.tolist() == [10.0]


def test_a_road_becomes_a_plan_with_its_times():
    (road,) = valhalla_router().roads([A, B])
    plan = road.plan("a to b")
    assert plan.trip_id == "a to b"
    assert plan.free_flow
    assert plan.duration_s == pytest.approx(420.0, rel=0.02)
    assert plan.distance_m == pytest.approx(2 * HALF_M, rel=2e-3)
    assert not road.links.__class__(*(np.array([v]) for v in (500.0, 50.0, NO, NO))).plan().free_flow
