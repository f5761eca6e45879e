"""Questions to Valhalla, and its answers as roads."""

import math
import threading

import httpx
import numpy as np
import pytest
from tests.roads.routers.made import EXACT, HALF_M, MIDDLE, NO, A, B, valhalla_at, valhalla_router
from tests.support.refusals import refuses
from tests.support.roads import VALHALLA_EDGES, body_of, client, encoded, valhalla

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.routers.valhalla import ValhallaRouter
from tripwatt.routes.places import Place


def asked(stops=(A, B), answers=None, **more):
    """What Valhalla is asked for roads: (action, document)."""
    seen = []

    def answer(request):
        seen.append((request.url.path.rpartition("/")[2], body_of(request)))
        return valhalla(**(answers or {}))(request)

    return valhalla_at(client(answer)).roads(list(stops), **more), seen


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
                        "edge.use",
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
    found = valhalla_router(route=many).roads([A, B])
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

    assert len(valhalla_at(client(answer)).roads([A, B])) == kept


def outline(*geometries):
    features = [{"geometry": geometry} for geometry in geometries]
    return valhalla_router(isochrone={"features": features}).outline(A, 10.0)


def test_an_outline_has_the_outer_rings():
    outer, hole = [[9.0, 47.0, 500.0], [9.1, 47.1]], [[9.02, 47.02], [9.03, 47.03]]
    other = [[8.0, 46.0], [8.1, 46.0]]
    polygon = {"type": "Polygon", "coordinates": [outer, hole]}
    corners = (Place(47.0, 9.0), Place(47.1, 9.1))
    assert outline(polygon) == corners
    assert outline({"type": "MultiPolygon", "coordinates": [[outer, hole], [other]]}, polygon) == (
        *corners,
        Place(46.0, 8.0),
        Place(46.0, 8.1),
        *corners,
    )
    assert outline() == ()
    for wrong in ([], [[[9.0]]]):
        refuses("too few entries", outline, {"type": "Polygon", "coordinates": wrong})
    refuses("too few entries", outline, {"type": "MultiPolygon", "coordinates": [[]]})


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
        valhalla_router(route={"error_code": 442, "error": "x" * 200}).roads([A, B])
    assert caught.value.faults[0].got == "x" * 120
    refuses("no road found", valhalla_router(route={"error_code": "171", "error": "as a text"}).roads, [A, B])
    for half in ({"error": "x"}, {"error_code": 442}):
        refuses("no road found", valhalla_router(route={**half, **trip(47.0)}).roads, [A, B])
    with pytest.raises(RemoteError, match="no line") as caught:
        valhalla_router(route={"trip": {"legs": [{"shape": ["y" * 99]}]}}).roads([A, B])
    assert caught.value.faults[0].got == "['" + "y" * 38


def test_a_server_is_asked_side_by_side():
    found = ValhallaRouter.from_client(client(valhalla()))
    assert found.at_once is True
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
    return valhalla_router(**answers).roads([A, B])[0]


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
    monkeypatch.setattr("tripwatt.roads.routers.valhalla.MAX_EDGES", 2)
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


def test_a_leg_within_one_edge_has_its_own_length_and_the_speed_of_the_edge():
    """Valhalla walks no part of an edge, on a line of one point, where a leg begins and ends on it."""
    line = [(47.0, 9.0), (47.0, 9.001)]
    trip = {"trip": {"status": 0, "legs": [{"shape": encoded(line)}]}}
    walk = {"edges": [edge(0, 0, 0.0)], "shape": encoded(line[:1])}
    heights = {"range_height": [[0, 500.0], [60, 500.0]]}
    road = valhalla_router(route=trip, trace_attributes=walk, height=heights).roads([A, Place(47.0, 9.001)])[
        0
    ]
    metres = 0.001 * 111_195.0 * math.cos(math.radians(47.0))
    assert road.distance_m == pytest.approx(metres, rel=1e-3)
    assert road.duration_s == pytest.approx(metres / (50.0 / 3.6), rel=1e-3)


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
        ([[0, 5.0], [3000, 6.0], [3300, None]], [5.0, 6.0]),
        ([[0, 5.0], [3000, 6.0], [3301, None]], None),
        ([[0, None], [301, 6.0], [3301, 7.0]], None),
        ([[0, 5.0], [1000, None], [3000, 6.0]], [5.0, 6.0]),
        ([[0, 5.0], [1000, None], [3001, 6.0]], None),
        ([[0, 5.0]], None),
        ([], None),
        ("none", None),
    ],
)
def test_two_heights_are_known_heights(heights, known):
    found = walked(edge(0, 2, 400.0), heights=heights).links.elevation_m
    assert (found if found is None else found.tolist()) == known


def test_the_links_of_valhalla_come_from_its_edges():
    (road,) = valhalla_router().roads([A, B])
    assert road.links.length_m == pytest.approx([HALF_M, HALF_M], abs=1.0)
    assert road.links.moving_speed_m_s == pytest.approx([50.0 / 3.6, 100.0 / 3.6])
    assert road.links.travel_time_s == pytest.approx([283.0, 137.0])
    assert road.links.stop_s[0] == pytest.approx(283.0 - HALF_M * 3.6 / 50.0, abs=0.1)  # the signal
    assert road.links.speed_limit_m_s == pytest.approx([50.0 / 3.6, NO], nan_ok=True)
    assert road.road_class == ("secondary", "motorway")
    assert road.distance_m == pytest.approx(2 * HALF_M, abs=1.0)
    assert road.duration_s == pytest.approx(420.0)
    assert road.position_m == pytest.approx([0.0, HALF_M, 2 * HALF_M], abs=1.0)
    assert road.place_at(HALF_M).longitude_deg == pytest.approx(9.05, abs=1e-5)
    assert road.heading_at(np.array([0.0, 5000.0, 9e9])) == pytest.approx([90.0, 90.0, 90.0], abs=0.1)


def test_legs_follow_each_other():
    legs = [{"shape": encoded([(47.0, 9.0), (47.0, 9.05)])}, {"shape": encoded([(47.0, 9.05), (47.0, 9.1)])}]
    edge = {**VALHALLA_EDGES[0], "end_node": {"elapsed_time": 283.0, "traffic_signal": False}}
    changed = {
        "route": {"trip": {"legs": legs}},
        "trace_attributes": {"edges": [edge]},
        "height": {"range_height": [[0, 500.0], [3790, 540.0]]},
    }
    (road,) = valhalla_router(**changed).roads([A, MIDDLE, B])
    assert road.stop_position_m == pytest.approx((HALF_M,), abs=1.0)
    assert road.links.length_m == pytest.approx([2 * HALF_M], abs=1.0)
    assert road.links.elevation_position_m == pytest.approx([0.0, 3790.0, HALF_M, HALF_M + 3790.0], abs=1.0)


def test_a_tile_is_passed_on_as_it_comes():
    asked = []

    def answer(request):
        asked.append((request.method, request.url.path, body_of(request)))
        return httpx.Response(200, content=b"\x1a\x00tile")

    router = ValhallaRouter.from_client(client(answer))
    assert router.tile(12, 2156, 1436) == b"\x1a\x00tile"
    assert asked == [("POST", "/base/tile", {"tile": {"z": 12, "x": 2156, "y": 1436}})]


def test_where_a_router_has_no_tile_it_is_empty():
    refuse = lambda request: httpx.Response(400, json={"error_code": 174})  # noqa: E731
    assert ValhallaRouter.from_client(client(refuse)).tile(15, 0, 0) == b""
    assert ValhallaRouter(lambda action, request: {}).tile(1, 0, 0) == b""
    with pytest.raises(RemoteError, match="refuses access"):
        ValhallaRouter.from_client(client(lambda request: httpx.Response(403))).tile(1, 0, 0)


@pytest.mark.parametrize(
    ("answer", "what"),
    [
        ({"error_code": 171, "error": "No suitable edges near location"}, "place outside of the map"),
        ({"error_code": 170, "error": "Locations are in unconnected regions"}, "place outside of the map"),
        ({"error_code": 442, "error": "No path could be found for input"}, "no road found"),
    ],
)
def test_no_road_is_an_invalid_input_and_no_failure_of_the_router(answer, what):
    with pytest.raises(
        InvalidInput, match=f"{what}: 47.00000, 9.00000 to 47.00000, 9.10000: got {answer['error']}"
    ) as caught:
        valhalla_router(route=answer).roads([A, B])
    assert not isinstance(caught.value, RemoteError)
