"""Questions to OSRM, GraphHopper and openrouteservice, and their answers."""

import httpx
import numpy as np
import pytest
from benchmarks.link_style import road_work
from tests.roads.routers.made import EXACT, MIDDLE, NO, A, B, valhalla_router
from tests.support.refusals import refuses
from tests.support.roads import (
    VALHALLA_EDGES,
    body_of,
    client,
    encoded,
    graphhopper,
    mutated,
    openrouteservice,
    osrm,
)

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.roads.routers.road import no_road
from tripwatt.roads.routers.servers import SERVERS, ServerRouter
from tripwatt.routes.documents import Node
from tripwatt.routes.places import Place

ROUTERS = {
    "osrm": ("osrm", lambda: osrm(annotated=True)),
    "steps": ("osrm", lambda: osrm(annotated=False)),
    "graphhopper": ("graphhopper", graphhopper),
    "openrouteservice": ("openrouteservice", openrouteservice),
}


def router_of(name, document=None):
    kind, make = ROUTERS[name]
    return ServerRouter(client(make() if document is None else document), kind)


def test_osrm_gives_a_link_for_each_speed_whatever_its_edges():
    (road,) = router_of("osrm").roads([A, B])
    assert road.links.length_m == pytest.approx([3792.0, 3792.0])
    assert road.links.moving_speed_m_s == pytest.approx([13.9, 27.8], rel=2e-3)
    assert road.links.duration_s == pytest.approx(
        osrm(annotated=True)["routes"][0]["duration"], abs=1.0
    )  # speeds are rounded
    (road,) = router_of("steps").roads([A, B])
    assert road.links.length_m == pytest.approx([3792.0, 3792.0])
    assert road.links.travel_time_s[0] == pytest.approx(273.6 + 4.0)


def test_a_server_without_outlines_gives_none():
    assert router_of("osrm").outline(A, 10.0) == ()


def test_the_energy_of_osrm_by_annotation_is_that_by_steps():
    work = [road_work(router_of(name).roads([A, B])[0].plan()) for name in ("osrm", "steps")]
    assert work[0] == pytest.approx(work[1], rel=0.02)


def test_graphhopper_gives_limits_classes_and_heights():
    (road,) = router_of("graphhopper").roads([A, B])
    assert road.links.length_m == pytest.approx([3792.0, 3792.0], abs=1.0)
    assert road.links.travel_time_s == pytest.approx([283.0, 137.0])
    assert road.links.moving_speed_m_s == pytest.approx([50.0 / 3.6, 100.0 / 3.6], rel=1e-3)
    assert road.links.speed_limit_m_s == pytest.approx([50.0 / 3.6, NO], nan_ok=True)
    assert road.road_class == ("secondary", "motorway")
    assert road.links.elevation_m.tolist() == [500.0, 520.0, 510.0]


def test_openrouteservice_gives_steps_and_heights():
    (road,) = router_of("openrouteservice").roads([A, B])
    assert road.links.length_m == pytest.approx([3792.0, 3792.0])
    assert road.links.travel_time_s == pytest.approx([283.0, 137.0])
    assert road.links.elevation_position_m == pytest.approx([0.0, 3792.0, 7584.0], abs=1.0)


@pytest.mark.parametrize(
    ("name", "document"),
    [
        ("osrm", {"code": "NoRoute", "message": "Impossible route"}),
        ("graphhopper", {"message": "Cannot find point 0"}),
        ("openrouteservice", {"error": {"code": 2010, "message": "Could not find routable point"}}),
    ],
)
def test_each_router_may_find_no_road(name, document):
    with pytest.raises(
        InvalidInput, match=r"no road found: 47.00000, 9.00000 to 47.00000, 9.10000: got "
    ) as caught:
        router_of(name, document).roads([A, B])
    assert not isinstance(caught.value, RemoteError)


@pytest.mark.parametrize("name", ["valhalla", *ROUTERS])
def test_a_mutated_answer_is_a_road_or_one_clear_error(name):
    """2,000 mutated answers over all routers: a road that can be driven, or an error of ours, within the time of any."""
    outcomes = set()
    if name == "valhalla":
        for action, document in (
            ("route", {"trip": {"legs": [{"shape": encoded([(47.0, 9.0), (47.0, 9.05), (47.0, 9.1)])}]}}),
            ("trace_attributes", {"edges": VALHALLA_EDGES}),
            ("height", {"range_height": [[0, 500.0], [3700, 537.0], [7583, 575.8]]}),
        ):
            for answer in mutated(document, 200, seed=1):
                outcomes.add(outcome(valhalla_router(**{action: answer})))
    else:
        kind, make = ROUTERS[name]
        for answer in mutated(make(), 350, seed=2):
            outcomes.add(outcome(ServerRouter(client(answer), kind)))
    assert outcomes == {"road", "error"}


def outcome(router):
    try:
        roads = router.roads([A, B])
    except InvalidInput as error:
        return "error" if error.faults else "an error without a fault"
    for road in roads:
        assert np.isfinite(road.links.length_m).all()
        assert np.isfinite(road.links.travel_time_s).all()
        assert road.distance_m > 0.0
    return "road"


def osrm_leg(route):
    return SERVERS["osrm"][2](Node(route, "x"))


def graphhopper_path(path):
    return SERVERS["graphhopper"][2](Node(path, "x"))


def openrouteservice_feature(feature):
    return SERVERS["openrouteservice"][2](Node(feature, "x"))


def asked(kind, document, stops=(A, B), **more):
    """What a router asks its server."""
    seen = []
    answering = client(lambda r: seen.append(r) or httpx.Response(200, json=document))
    ServerRouter(answering, kind).roads(stops, **more)
    (request,) = seen
    return request


@pytest.mark.parametrize(("wanted", "text"), [(0, "false"), (1, "1"), (2, "2"), (3, "3"), (4, "3"), (9, "3")])
def test_osrm_is_asked_for_three_alternatives_at_most(wanted, text):
    found = asked("osrm", osrm(annotated=True), alternatives=wanted)
    assert found.url.params["alternatives"] == text
    through = asked("osrm", osrm(annotated=True), (A, MIDDLE, B), alternatives=wanted)
    assert through.url.params["alternatives"] == "false"
    line = "9.000000,47.000000;9.050000,47.000000;9.100000,47.000000"
    assert through.url.path == f"/base/route/v1/driving/{line}"


def test_the_whole_question_to_osrm():
    assert dict(asked("osrm", osrm(annotated=True)).url.params) == {
        "alternatives": "false",
        "geometries": "geojson",
        "overview": "full",
        "steps": "true",
        "annotations": "duration,distance,speed",
    }


@pytest.mark.parametrize(("wanted", "paths"), [(1, 2), (2, 3), (3, 4), (4, 4), (9, 4)])
def test_graphhopper_is_asked_for_four_paths_at_most(wanted, paths):
    question = {
        "points": [[9.0, 47.0], [9.1, 47.0]],
        "profile": "car",
        "points_encoded": False,
        "elevation": True,
        "instructions": False,
        "details": ["time", "distance", "average_speed", "max_speed", "road_class", "road_environment"],
    }
    assert body_of(asked("graphhopper", graphhopper())) == question
    more = {"algorithm": "alternative_route", "alternative_route.max_paths": paths}
    assert body_of(asked("graphhopper", graphhopper(), alternatives=wanted)) == question | more
    through = asked("graphhopper", graphhopper(), (A, MIDDLE, B), alternatives=wanted)
    assert body_of(through) == question | {"points": [[9.0, 47.0], [9.05, 47.0], [9.1, 47.0]]}


@pytest.mark.parametrize(("wanted", "count"), [(1, 2), (2, 3), (3, 3), (9, 3)])
def test_openrouteservice_is_asked_for_three_routes_at_most(wanted, count):
    question = {
        "coordinates": [[9.0, 47.0], [9.1, 47.0]],
        "elevation": True,
        "units": "m",
        "instructions": True,
        "extra_info": ["waytype"],
    }
    assert body_of(asked("openrouteservice", openrouteservice())) == question
    more = {"alternative_routes": {"target_count": count}}
    assert body_of(asked("openrouteservice", openrouteservice(), alternatives=wanted)) == question | more
    through = asked("openrouteservice", openrouteservice(), (A, MIDDLE, B), alternatives=wanted)
    assert body_of(through) == question | {"coordinates": [[9.0, 47.0], [9.05, 47.0], [9.1, 47.0]]}


@pytest.mark.parametrize(
    ("kind", "document", "key"),
    [
        ("osrm", osrm(annotated=True), "routes"),
        ("graphhopper", graphhopper(), "paths"),
        ("openrouteservice", openrouteservice(), "features"),
    ],
)
def test_four_roads_of_an_answer_are_read(kind, document, key):
    for number, kept in ((1, 1), (4, 4), (5, 4)):
        many = {**document, key: document[key] * number}
        assert len(ServerRouter(client(many), kind).roads([A, B])) == kept
    with pytest.raises(RemoteError, match="too few entries"):
        ServerRouter(client({**document, key: []}), kind).roads([A, B])


def test_words_of_a_server_are_cut():
    assert no_road([A, B], "x" * 121).faults[0].got == "x" * 120
    assert no_road([A, MIDDLE, B], "x").faults[0].where == " to ".join(p.title for p in (A, MIDDLE, B))
    with pytest.raises(RemoteError, match="the router failed") as caught:
        ServerRouter(client({"code": "y" * 100}), "osrm").roads([A, B])
    assert caught.value.faults[0].got == "'" + "y" * 59


EQUATOR = {"type": "LineString", "coordinates": [[0.0, 0.0], [0.01, 0.0]]}


def osrm_edges(*legs):
    """Length, time and speed of each edge."""
    edges, points, heights = osrm_leg({"legs": list(legs), "geometry": EQUATOR})
    assert heights is None
    assert points.tolist() == [[0.0, 0.0], [0.0, 0.01]]
    return [edges.length_m.tolist(), edges.time_s.tolist(), edges.speed_m_s.tolist()]


def annotated(duration, distance, seconds, **more):
    return {"duration": duration, "annotation": {"distance": distance, "duration": seconds, **more}}


def same(found, *expected):
    for got, wanted in zip(found, expected, strict=True):
        np.testing.assert_allclose(got, wanted, **EXACT)


def test_turns_of_an_osrm_leg_are_shared_out_by_time():
    leg = annotated(0.9, [0.25, 0.5], [0.2, 0.4], speed=[0.5, 0.0])
    same(osrm_edges(leg), [0.25, 0.5], [0.3, 0.6], [0.5, NO])
    same(osrm_edges(annotated(0.5, [0.25, 0.5], [0.2, 0.4])), [0.25, 0.5], [0.2, 0.4], [1.25, 1.25])
    same(osrm_edges(annotated(0.0, [90.0], [9.0])), [90.0], [9.0], [10.0])


def test_osrm_edges_without_time_have_no_speed():
    leg = annotated(8.0, [50.0, 0.0, 90.0], [4.0, 0.0, 0.0])
    same(osrm_edges(leg), [50.0, 0.0, 90.0], [8.0, 0.0, 0.0], [12.5, NO, NO])
    same(osrm_edges(annotated(8.0, [50.0], [0.0])), [50.0], [0.0], [NO])


def test_steps_and_legs_of_osrm_stand_in_for_annotations():
    steps = {"duration": 9.0, "steps": [{"distance": 0.5, "duration": 0.25}, {"distance": 0, "duration": 0}]}
    same(osrm_edges(steps), [0.5, 0.0], [0.25, 0.0], [NO, NO])
    bare = {"distance": 70.0, "duration": 7.0, "steps": []}
    same(osrm_edges(bare, steps), [70.0, 0.5, 0.0], [7.0, 0.25, 0.0], [NO, NO, NO])


@pytest.mark.parametrize(
    "leg",
    [
        annotated(8.0, [50.0, 60.0], [4.0]),
        annotated(8.0, [], []),
        annotated(8.0, [50.0], [4.0], speed=[1.0, 2.0]),
    ],
)
def test_an_annotation_is_one_value_for_each_edge(leg):
    refuses("annotations of different lengths", osrm_edges, leg)


@pytest.mark.parametrize(
    "leg",
    [
        annotated(-0.1, [50.0], [4.0]),
        annotated(8.0, [-0.1], [4.0]),
        annotated(8.0, [50.0], [-0.1]),
        annotated(8.0, [50.0], [4.0], speed=[-0.1]),
        {"duration": 1.0, "steps": [{"distance": -0.1, "duration": 1.0}]},
        {"duration": 1.0, "steps": [{"distance": 1.0, "duration": -0.1}]},
    ],
)
def test_nothing_of_an_osrm_leg_is_negative(leg):
    refuses("0 or more", osrm_edges, leg)


def line(*degrees, heights=None):
    """Points on the equator."""
    return [[at, 0.0] if heights is None else [at, 0.0, heights[k]] for k, at in enumerate(degrees)]


def path(points, distance, **details):
    return {"distance": distance, "points": {"coordinates": points}, "details": details}


def test_intervals_of_graphhopper_are_edges_on_the_scale_of_the_path():
    """Points after 0, 1, 3 and 4 hundredths of a degree, on a path of 800 m; the third edge has one point."""
    found = graphhopper_path(
        path(
            line(0.0, 0.01, 0.03, 0.04, heights=[5.0, None, 7.0, 9.0]),
            800.0,
            time=[[0, 1, 500], [1, 2, 40_000], [2, 2, 0], [2, 3, 20_000]],
            average_speed=[[0, 1, 0.0], [1, 3, 36.0]],
            max_speed=[[0, 1, 0.0], [1, 1, 0.9], [2, 3, None]],
            road_class=[[0, 1, "primary"], [2, 2, None], [2, 3, "service"]],
        )
    )
    edges = found.edges
    np.testing.assert_allclose(edges.length_m, [200.0, 400.0, 0.0, 200.0], rtol=1e-9, atol=1e-6)
    assert edges.time_s.tolist() == [0.5, 40.0, 0.0, 20.0]
    np.testing.assert_allclose(edges.speed_m_s, [NO, 10.0, 10.0, 10.0], **EXACT)
    np.testing.assert_allclose(edges.limit_m_s, [NO, 0.25, NO, NO], **EXACT)
    assert edges.road_class == ("primary", "primary", "service", "service")
    assert edges.signal.tolist() == [False] * 4
    position, height = found.heights
    np.testing.assert_allclose(position, [0.0, 600.0, 800.0], **EXACT)
    assert height.tolist() == [5.0, 7.0, 9.0]
    assert found.points.tolist() == [[0.0, 0.0], [0.0, 0.01], [0.0, 0.03], [0.0, 0.04]]


def test_a_speed_and_a_limit_of_one_point_count_there_alone():
    details = {"time": [[0, 1, 9000], [1, 1, 9000], [1, 2, 9000], [2, 3, 9000]]}
    speeds = {"average_speed": [[0, 3, 36.0], [1, 1, 0.9]], "max_speed": [[1, 2, 90.0]]}
    edges = graphhopper_path(path(line(0.0, 0.01, 0.02, 0.03), 300.0, **details, **speeds)).edges
    np.testing.assert_allclose(edges.speed_m_s, [10.0, 0.25, 0.25, 10.0], **EXACT)
    np.testing.assert_allclose(edges.limit_m_s, [NO, 25.0, 25.0, NO], **EXACT)
    assert edges.road_class == ("",) * 4


def test_a_class_that_is_empty_ends_the_class_before():
    classes = [[0, 1, "primary"], [1, 2, ""], [2, 3, "motorway"]]
    times = [[0, 1, 9], [1, 2, 9], [2, 3, 9]]
    found = graphhopper_path(path(line(0.0, 0.01, 0.02, 0.03), 9.0, time=times, road_class=classes[::-1]))
    assert found.edges.road_class == ("primary", "", "motorway")
    later = graphhopper_path(path(line(0.0, 0.01, 0.02), 9.0, time=times[:2], road_class=classes[1:2]))
    assert later.edges.road_class == ("", "")


@pytest.mark.parametrize(
    ("degrees", "distance", "positions"),
    [
        ((0.0, 5e-6), 0.5, [0.0, 0.5]),
        ((0.0, 0.01), 0.0, [0.0, 0.0]),
        ((0.0, 0.0, 0.01), 900.0, [0.0, 0.0, 900.0]),
        ((0.0, 0.01, 0.01), 900.0, [0.0, 900.0, 900.0]),
        ((0.0, 0.0, 0.005, 0.01), 900.0, [0.0, 0.0, 450.0, 900.0]),
    ],
)
def test_the_line_of_a_road_has_its_length(degrees, distance, positions):
    """Also where points repeat, and below a metre."""
    points, n = line(*degrees, heights=[1.0] * len(degrees)), len(degrees)
    found, _ = graphhopper_path(path(points, distance, time=[[0, n - 1, 9000]])).heights
    np.testing.assert_allclose(found, positions, **EXACT)
    half = {"distance": distance / 2.0, "duration": 4.0}
    feature = {
        "geometry": {"coordinates": points},
        "properties": {"segments": [half, {"steps": [half, {"distance": 0, "duration": 0.5}]}]},
    }
    made = openrouteservice_feature(feature)
    np.testing.assert_allclose(made.heights[0], positions, **EXACT)
    assert made.edges.length_m.tolist() == [distance / 2.0, distance / 2.0, 0.0]
    assert made.edges.time_s.tolist() == [4.0, 4.0, 0.5]
    assert np.isnan(made.edges.speed_m_s).all()


def test_a_line_that_is_one_point_is_no_road():
    nowhere = graphhopper()
    nowhere["paths"][0]["points"]["coordinates"] = [[9.0, 47.0, 500.0]] * 3
    with pytest.raises(RemoteError, match="impossible edge of the road"):
        ServerRouter(client(nowhere), "graphhopper").roads([A, Place(47.0, 9.001)])
    still = openrouteservice()
    still["features"][0]["geometry"]["coordinates"] = [[9.0, 47.0, 500.0]] * 3
    (road,) = ServerRouter(client(still), "openrouteservice").roads([A, Place(47.0, 9.001)])
    assert road.links.elevation_position_m.tolist() == [0.0, 0.0, 0.0]
    assert road.position_m.tolist() == [0.0, 0.0, 0.0]


def test_one_height_is_enough():
    for heights, known in (([None, None], None), ([None, 8.0], [8.0])):
        points = line(0.0, 0.01, heights=heights)
        found = graphhopper_path(path(points, 9.0, time=[[0, 1, 9]])).heights
        feature = {
            "geometry": {"coordinates": points},
            "properties": {"segments": [{"distance": 9.0, "duration": 1.0}]},
        }
        other = openrouteservice_feature(feature).heights
        assert (found if found is None else found[1].tolist()) == known
        assert (other if other is None else other[1].tolist()) == known


@pytest.mark.parametrize(
    ("times", "what"),
    [
        ([[0, 2, 5]], None),
        ([[0, 1, 5, "more"], [1, 2, 0]], None),
        ([[0, 2, 5], [2, 2, 5]], None),
        ([[0, 0, 5], [0, 2, 5]], None),
        ([[0, 3, 5]], "point index out of range"),
        ([[0, 2, 5], [2, 1, 5]], "point index out of range"),
        ([[0, 1.5, 5]], "point index out of range"),
        ([[0.5, 2, 5]], "point index out of range"),
        ([[0, 1, 5], [0, 2, 5]], "incomplete path details"),
        ([[0, 1, 5], [2, 2, 5]], "incomplete path details"),
        ([], "incomplete path details"),
        (None, "incomplete path details"),
        ([[0, 2]], "too few entries"),
        ([[-1, 2, 5]], "not a number"),
        ([[0, -1, 5]], "not a number"),
        ([[0, 2, -0.1]], "not a number"),
    ],
)
def test_intervals_of_graphhopper_follow_each_other(times, what):
    given = path(line(0.0, 0.01, 0.02), 9.0, time=times)
    if what is None:
        assert len(graphhopper_path(given).edges.length_m) == len(times)
        return
    with pytest.raises(InvalidInput, match=what):
        graphhopper_path(given)


@pytest.mark.parametrize("name", ["average_speed", "max_speed"])
def test_speeds_of_graphhopper_are_not_negative(name):
    with pytest.raises(InvalidInput, match="0 or more"):
        graphhopper_path(path(line(0.0, 0.01), 9.0, time=[[0, 1, 5]], **{name: [[0, 1, -0.1]]}))
    refuses("0 or more", graphhopper_path, path(line(0.0, 0.01), -0.1, time=[[0, 1, 5]]))


def test_a_road_has_legs_or_segments():
    refuses("legs: got 0; allowed: at least 1", osrm_edges)
    feature = {"geometry": {"coordinates": line(0.0, 0.01)}, "properties": {"segments": []}}
    refuses("segments: got 0; allowed: at least 1", openrouteservice_feature, feature)
