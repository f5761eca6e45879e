"""Links of edges and roads of legs, and what Valhalla is asked and answers, with numbers that are worked out by hand."""

import math
import threading

import httpx
import numpy as np
import pytest
from tests.support.roads import VALHALLA_EDGES, body_of, client, encoded, valhalla

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.routes.places import Place
from tripwatt.routes.routers import Edges, Road, RoadParts, ValhallaRouter, pooled, road

NO = math.nan
EXACT = {"rtol": 1e-9, "atol": 1e-9}
DEGREE_M = 6_371_008.8 * math.pi / 180.0
A, B = Place(47.0, 9.0), Place(47.0, 9.1)


def edges(length, time, speed=None, limit=None, kinds=None, signal=None):
    n = len(length)
    full = lambda values: np.full(n, NO) if values is None else np.array(values, dtype=float)  # noqa: E731
    signals = np.zeros(n, dtype=bool) if signal is None else np.array(signal)
    return Edges(full(length), full(time), full(speed), full(limit), tuple(kinds or [""] * n), signals)


def lengths(*columns, **more):
    return pooled(edges(*columns, **more))[0].length_m.tolist()


# links of edges


def test_a_standstill_at_a_signal_has_two_seconds():
    for seconds, stop in ((12.0, 2.0), (11.99, NO)):
        links, _ = pooled(edges([100.0], [seconds], [10.0], signal=[True]))
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
    links, kinds = pooled(edges([100.0, 0.005, 100.0], [10.0, 1.0, 10.0], kinds=["a", "b", "c"]))
    assert (links.length_m.tolist(), kinds) == ([100.0, 100.005], ("a", "b"))
    assert lengths([0.005, 0.005, 100.0], [1.0, 1.0, 10.0], kinds=["a", "b", "c"]) == [0.01, 100.0]


def test_a_limit_that_is_unknown_is_no_limit():
    for pair, number in (([NO, 1.0], 2), ([NO, NO], 1), ([1.0, NO], 2), ([1.0, 1.0], 1)):
        assert len(lengths([5.0, 5.0], [9.0, 9.0], limit=pair)) == number
    assert pooled(edges([5.0], [9.0]))[0].speed_limit_m_s is None
    assert pooled(edges([5.0], [9.0], limit=[1.0]))[0].speed_limit_m_s.tolist() == [1.0]


def test_lists_of_routes_end_at_four():
    assert road.MOST_ROUTES == 4


# roads


def line(*longitudes, latitude=0.0):
    return np.array([(latitude, lon) for lon in longitudes])


def made(*legs, stops=None):
    """A road on the equator of legs (edges, line, heights)."""
    parts = RoadParts()
    for leg in legs:
        parts.add(*leg)
    first, last = legs[0][1][0], legs[-1][1][-1]
    return parts.road(stops or [Place(*first), Place(*last)])


def test_the_way_that_a_car_looks():
    corner = Road(
        pooled(edges([200.0], [20.0]))[0],
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
    brief = made((edges([0.0, 0.5], [0.0, 0.25], [NO, 0.9]), line(0.0, 0.001), None))
    assert brief.distance_m == 0.5
    np.testing.assert_allclose(brief.duration_s, 0.5 / 0.9, **EXACT)


def test_a_road_ends_within_1500_metres_of_its_places():
    leg = (edges([100.0], [10.0]), line(0.0, 0.001), None)
    for metres, sound in ((1499.0, True), (1501.0, False)):
        off = metres / DEGREE_M
        pairs = [(Place(off, 0.0), Place(0.0, 0.001)), (Place(0.0, 0.0), Place(0.0, 0.001 + off))]
        for stops in pairs:
            if sound:
                assert made(leg, stops=stops).distance_m == 100.0
                continue
            with pytest.raises(InvalidInput, match=r"got 1\.5 km from the nearest road") as caught:
                made(leg, stops=stops)
            assert len(caught.value.faults) == 1
            assert caught.value.faults[0].allowed == "at most 1.5 km"
    with pytest.raises(InvalidInput) as caught:
        made(leg, stops=(Place(1.0, 0.0), Place(1.0, 0.0)))
    assert len(caught.value.faults) == 2


def test_a_place_may_be_as_far_as_its_bound(monkeypatch):
    leg, off = (edges([100.0], [10.0]), line(0.0, 0.001), None), Place(0.01, 0.0)
    far = off.distance_m(Place(0.0, 0.0))
    monkeypatch.setattr(road, "FARTHEST_START_M", far)
    assert made(leg, stops=(off, Place(0.0, 0.001))).distance_m == 100.0
    monkeypatch.setattr(road, "FARTHEST_START_M", far - 1e-6)
    with pytest.raises(InvalidInput, match="place outside of the map"):
        made(leg, stops=(off, Place(0.0, 0.001)))


def test_a_journey_has_two_places_a_metre_apart():
    near, far = Place(0.9 / DEGREE_M, 0.0), Place(1.1 / DEGREE_M, 0.0)
    start = Place(0.0, 0.0)
    road.require_stops([start, far])
    road.require_stops([start, start, far])
    road.require_stops([start, far, start])
    for stops in ([start, near], [start, near, start]):
        with pytest.raises(InvalidInput, match="no way to drive"):
            road.require_stops(stops)
    with pytest.raises(InvalidInput, match="too few places: stops: got 1;"):
        road.require_stops([start])


# Valhalla


def asked(stops=(A, B), answers=None, **more):
    """What Valhalla is asked for roads: (action, document)."""
    seen = []

    def answer(request):
        seen.append((request.url.path.rpartition("/")[2], body_of(request)))
        return valhalla(**(answers or {}))(request)

    server = client(answer)
    router = ValhallaRouter(lambda action, document: server.post_json(f"/{action}", document))
    return router.roads(list(stops), **more), seen


def router_of(**answers):
    server = client(valhalla(**answers))
    return ValhallaRouter(lambda action, document: server.post_json(f"/{action}", document))


SHAPE = encoded([(47.0, 9.0), (47.0, 9.05), (47.0, 9.1)])


def test_the_whole_questions_to_valhalla():
    _, seen = asked()
    assert seen == [
        (
            "route",
            {
                "locations": [{"lat": 47.0, "lon": 9.0}, {"lat": 47.0, "lon": 9.1}],
                "costing": "auto",
                "directions_type": "none",
            },
        ),
        (
            "trace_attributes",
            {
                "encoded_polyline": SHAPE,
                "shape_match": "edge_walk",
                "costing": "auto",
                "filters": {
                    "attributes": [
                        "shape",
                        "edge.length",
                        "edge.speed",
                        "edge.speed_limit",
                        "edge.road_class",
                        "edge.begin_shape_index",
                        "edge.end_shape_index",
                        "edge.tunnel",
                        "edge.bridge",
                        "node.elapsed_time",
                        "node.traffic_signal",
                    ],
                    "action": "include",
                },
            },
        ),
        (
            "height",
            {
                "encoded_polyline": SHAPE,
                "shape_format": "polyline6",
                "range": True,
                "resample_distance": 30.0,
            },
        ),
    ]


@pytest.mark.parametrize(("wanted", "alternates"), [(1, 1), (2, 2), (3, 2), (9, 2)])
def test_valhalla_is_asked_for_two_alternates_and_the_shortest_road(wanted, alternates):
    _, seen = asked(alternatives=wanted)
    assert [document.get("alternates") for action, document in seen if action == "route"] == [
        alternates,
        None,
    ]
    assert seen[1][1]["costing_options"] == {"auto": {"shortest": True}}
    _, plain = asked(alternatives=0)
    assert [action for action, _ in plain].count("route") == 1


def trip(middle):
    return {"trip": {"legs": [{"shape": encoded([(47.0, 9.0), (middle, 9.05), (47.0, 9.1)])}]}}


def test_four_alternates_are_read():
    many = {**trip(47.0), "alternates": [trip(47.0 + k / 1000.0) for k in range(1, 8)]}
    found = router_of(route=many).roads([A, B])
    assert [round(float(r.latitude_deg[1]), 3) for r in found] == [47.0, 47.001, 47.002, 47.003, 47.004]


@pytest.mark.parametrize(("seconds", "kept"), [(672.0, 2), (673.0, 1)])
def test_a_road_takes_at_most_1_6_times_as_long_as_the_fastest(seconds, kept):
    """The straight road takes 420 s."""
    late = [dict(edge) for edge in VALHALLA_EDGES]
    late[1]["end_node"] = {"elapsed_time": seconds}

    def answer(request):
        if request.url.path.endswith("trace_attributes"):
            straight = body_of(request)["encoded_polyline"] == SHAPE
            return httpx.Response(200, json={"edges": VALHALLA_EDGES if straight else late})
        return valhalla(route={**trip(47.0), "alternates": [trip(47.0), trip(47.001)]})(request)

    server = client(answer)
    router = ValhallaRouter(lambda action, document: server.post_json(f"/{action}", document))
    assert len(router.roads([A, B])) == kept


def outline(*geometries):
    features = [{"geometry": geometry} for geometry in geometries]
    return router_of(isochrone={"features": features}).outline(A, 10.0)


def test_an_outline_has_the_outer_rings():
    outer, hole, other = [[9.0, 47.0, 500.0], [9.1, 47.1]], [[9.02, 47.02]], [[8.0, 46.0]]
    polygon = {"type": "Polygon", "coordinates": [outer, hole]}
    corners = (Place(47.0, 9.0), Place(47.1, 9.1))
    assert outline(polygon) == corners
    assert outline({"type": "MultiPolygon", "coordinates": [[outer, hole], [other]]}, polygon) == (
        *corners,
        Place(46.0, 8.0),
        *corners,
    )
    assert outline() == ()
    for wrong in ([], [[[9.0]]]):
        with pytest.raises(InvalidInput, match="too few entries"):
            outline({"type": "Polygon", "coordinates": wrong})
    with pytest.raises(InvalidInput, match="too few entries"):
        outline({"type": "MultiPolygon", "coordinates": [[]]})


def test_what_an_outline_is_asked_with():
    seen = []

    def ask(action, document):
        seen.append((action, document))
        return {"features": []}

    assert ValhallaRouter(ask).outline(A, 12.3456) == ()
    assert seen == [
        (
            "isochrone",
            {
                "locations": [{"lat": 47.0, "lon": 9.0}],
                "costing": "auto",
                "contours": [{"time": 12.35}],
                "polygons": True,
                "generalize": 100.0,
            },
        )
    ]


def test_words_of_valhalla_are_cut():
    with pytest.raises(InvalidInput, match="no road found") as caught:
        router_of(route={"error_code": 442, "error": "x" * 200}).roads([A, B])
    assert caught.value.faults[0].got == "x" * 120
    with pytest.raises(InvalidInput, match="no road found"):
        router_of(route={"error_code": "171", "error": "as a text"}).roads([A, B])
    for half in ({"error": "x"}, {"error_code": 442}):
        with pytest.raises(InvalidInput, match="no road found"):
            router_of(route={**half, **trip(47.0)}).roads([A, B])
    with pytest.raises(RemoteError, match="no line") as caught:
        router_of(route={"trip": {"legs": [{"shape": ["y" * 99]}]}}).roads([A, B])
    assert caught.value.faults[0].got == "['" + "y" * 38


def test_a_server_is_asked_side_by_side_and_named_by_its_host():
    found = ValhallaRouter.from_client(client(valhalla()))
    assert (found.name, found.at_once) == ("valhalla at router.test", True)
    assert ValhallaRouter(lambda action, document: {}).at_once is False
    assert [r.duration_s for r in found.roads([A, B], alternatives=2)] == [420.0]


@pytest.mark.parametrize("at_once", [False, True])
def test_several_questions_at_once_leave_their_thread(at_once):
    """A single question stays in it."""
    elsewhere, answer = [], valhalla()

    def ask(action, document):
        elsewhere.append((action, threading.get_ident() != here))
        request = httpx.Request("POST", f"http://h/{action}", json=document)
        return answer(request).json()

    here, router = threading.get_ident(), ValhallaRouter(ask, at_once=at_once)
    router.roads([A, B])
    assert sorted(elsewhere) == [("height", at_once), ("route", False), ("trace_attributes", at_once)]
    elsewhere.clear()
    router.roads([A, B], alternatives=1)
    assert [found for found in elsewhere if found[0] == "route"] == [("route", at_once)] * 2


def edge(begin, end, elapsed, **more):
    node = {"elapsed_time": elapsed, **more.pop("node", {})}
    return {"begin_shape_index": begin, "end_shape_index": end, "speed": 50, "end_node": node, **more}


def walked(*entries, heights=None, **more):
    answers = {"trace_attributes": {"edges": list(entries), **more}}
    if heights is not None:
        answers["height"] = {"range_height": heights}
    return router_of(**answers).roads([A, B])[0]


@pytest.mark.parametrize(
    ("entries", "what"),
    [
        ([edge(0, 1, 200.0), edge(1, 2, 400.0)], None),
        ([edge(0, 1, 200.0), edge(1, 1, 200.0), edge(1, 2, 400.0)], None),
        ([edge(0, 0, 0.0), edge(0, 2, 0.5)], None),
        ([edge(0, 0, 0.0), edge(0, 1, 200.0), edge(1, 2, 400.0)], None),
        ([edge(0, 1, 200.0), edge(1, 3, 400.0)], "point index out of range"),
        ([edge(0, 1.5, 200.0), edge(1.5, 2, 400.0)], "point index out of range"),
        ([edge(-1, 1, 200.0), edge(1, 2, 400.0)], "not a number"),
        ([edge(1, 0, 200.0), edge(0, 2, 400.0)], "edges out of order"),
        ([edge(1, 2, 200.0), edge(0, 1, 400.0)], "edges out of order"),
        ([edge(0, 1, 200.0), edge(0, 2, 400.0)], "edges out of order"),
        ([edge(0, 0, 200.0), edge(1, 2, 400.0)], "edges out of order"),
        ([edge(0, 1, 200.0), edge(1, 2, 199.0)], "time decreases"),
        ([edge(0, 1, -0.1), edge(1, 2, 199.0)], "not a number"),
        ([edge(0, 1, 200.0, speed=1), edge(1, 2, 400.0)], None),
        ([edge(0, 1, 200.0, speed=0.9), edge(1, 2, 400.0)], "not a number"),
        ([edge(0, 1, 200.0, speed_limit=-1), edge(1, 2, 400.0)], "not a number"),
        ([], "too few entries"),
    ],
)
def test_edges_of_valhalla_follow_each_other(entries, what):
    if what is None:
        assert walked(*entries).distance_m == pytest.approx(7583.0, abs=1.0)
        return
    with pytest.raises(RemoteError, match=what):
        walked(*entries)


def test_edges_may_be_as_many_as_their_bound(monkeypatch):
    from tripwatt.routes.routers import valhalla as module

    assert module.MOST_EDGES == 200_000
    monkeypatch.setattr(module, "MOST_EDGES", 2)
    assert len(walked(edge(0, 1, 200.0), edge(1, 2, 400.0)).links) == 1
    with pytest.raises(RemoteError, match="got 3; allowed: at most 2"):
        walked(edge(0, 1, 200.0), edge(1, 1, 200.0), edge(1, 2, 400.0))


@pytest.mark.parametrize(
    ("given", "limit"),
    [(None, NO), ("unlimited", NO), (0, NO), (0.9, 0.25), (215.9, 215.9 / 3.6), (216, NO), (300, NO)],
)
def test_limits_of_valhalla_lie_below_60_metres_a_second(given, limit):
    found = walked(edge(0, 1, 200.0, speed_limit=given), edge(1, 2, 400.0, speed_limit=90)).links
    np.testing.assert_allclose(found.speed_limit_m_s, [limit, 25.0], **EXACT)


def test_what_an_edge_of_valhalla_says():
    first = edge(0, 1, 300.0, speed=90, node={"traffic_signal": True}, road_class="primary")
    found = walked(first, edge(1, 2, 460.0, speed=90, node={"traffic_signal": 1}))
    half_m = found.links.length_m[0]
    np.testing.assert_allclose(found.links.moving_speed_m_s, [25.0, 25.0], **EXACT)
    np.testing.assert_allclose(found.links.travel_time_s, [300.0, 160.0], **EXACT)
    np.testing.assert_allclose(found.links.stop_s, [300.0 - half_m / 25.0, NO], **EXACT)
    assert found.road_class == ("primary", "")
    bare = {k: v for k, v in edge(0, 2, 460.0).items() if k != "end_node"}
    with pytest.raises(RemoteError, match=r"edges\[0\]"):
        walked(bare)


def test_the_line_of_the_edges_may_have_a_point_more():
    longer = encoded([(47.0, 9.0), (47.0, 9.02), (47.0, 9.05), (47.0, 9.1)])
    times = [edge(0, 1, 80.0, speed=90), edge(1, 3, 400.0, speed=30)]
    whole = walked(*times, shape=longer).links.length_m
    np.testing.assert_allclose(whole[0] / whole.sum(), 0.2, rtol=1e-6)
    assert whole.sum() == pytest.approx(7583.0, abs=1.0)
    with pytest.raises(RemoteError, match="point index out of range"):
        walked(*times, shape=SHAPE)
    with pytest.raises(RemoteError, match="point index out of range"):
        walked(*times, shape=None)


GROUND = [[0, 500.0], [100, 510.0], [3791, 520.0], [5000, 900.0], [7583, 530.0]]


@pytest.mark.parametrize(
    ("more", "kept"),
    [
        ({}, [0, 100, 3791, 5000, 7583]),
        ({"tunnel": True}, [0, 100, 3791]),
        ({"bridge": True}, [0, 100, 3791]),
        ({"bridge": 1, "tunnel": "yes"}, [0, 100, 3791, 5000, 7583]),
    ],
)
def test_heights_of_tunnels_and_bridges_are_left_out(more, kept):
    """Half of the road is 3791.5 m long, the whole of it 7583.0 m."""
    found = walked(edge(0, 1, 200.0), edge(1, 2, 400.0, **more), heights=GROUND)
    assert found.links.elevation_position_m.tolist() == kept


def test_heights_at_the_ends_of_a_tunnel_stay():
    """Two heights outside are enough, with fewer all of them are kept."""
    both = [edge(0, 1, 200.0), edge(1, 2, 400.0, tunnel=True)]
    middle = float(walked(*both).links.distance_m) / 2.0
    inside = [[middle, 5.0], [middle + 1.0, 6.0], [2.0 * middle, 7.0]]
    assert walked(*both, heights=inside).links.elevation_m.tolist() == [5.0, 7.0]
    assert walked(*both, heights=inside[1:]).links.elevation_m.tolist() == [6.0, 7.0]
    everything = [edge(0, 2, 400.0, tunnel=True)]
    assert walked(*everything, heights=inside).links.elevation_m.tolist() == [5.0, 6.0, 7.0]


def test_heights_at_the_ends_of_the_road_are_kept_under_a_roof():
    start = [edge(0, 1, 200.0, tunnel=True), edge(1, 2, 400.0)]
    found = walked(*start, heights=[[0, 5.0], [100, 6.0], [5000, 7.0], [7000, 8.0]])
    assert found.links.elevation_m.tolist() == [5.0, 7.0, 8.0]
    whole = edge(0, 2, 400.0, tunnel=True)
    end = walked(whole).links.distance_m
    assert walked(whole, heights=[[0, 5.0], [100, 6.0], [end, 7.0]]).links.elevation_m.tolist() == [5.0, 7.0]


@pytest.mark.parametrize(
    ("heights", "known"),
    [
        ([[0, 5.0], [9, 6.0]], [5.0, 6.0]),
        ([[0, 5.0], [4, None], [9, 6.0]], [5.0, 6.0]),
        ([[0, 5.0], [4], [5, 1.0, 2.0], "x", [9, 6.0]], [5.0, 6.0]),
        ([[0, 5.0], [9, None]], None),
        ([[0, 5.0]], None),
        ([], None),
        ("none", None),
    ],
)
def test_two_heights_are_known_heights(heights, known):
    found = walked(edge(0, 2, 400.0), heights=heights).links.elevation_m
    assert (found if found is None else found.tolist()) == known
