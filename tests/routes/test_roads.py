"""Roads of routers: their links, lines, heights and alternatives, worked out by hand; and answers that lie."""

import math

import httpx
import numpy as np
import pytest
from tests.support.roads import (
    VALHALLA_EDGES,
    body_of,
    client,
    encoded,
    graphhopper,
    mutated,
    openrouteservice,
    osrm,
    valhalla,
)

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.routes import plan_from_links
from tripwatt.routes.calibrate import road_work
from tripwatt.routes.places import Place, bearings_deg, read_coordinates
from tripwatt.routes.routers import Edges, open_server, pooled, split_kind
from tripwatt.routes.routers.servers import GraphHopperRouter, OpenRouteServiceRouter, OsrmRouter
from tripwatt.routes.routers.valhalla import ValhallaRouter

A, B = Place(47.0, 9.0), Place(47.0, 9.1)
NAN = float("nan")
HALF_M = 6371008.8 * math.radians(0.05) * math.cos(math.radians(47.0))
"""Length of half of the straight road; a parallel, which the great circle undercuts by less than a metre."""


def valhalla_router(**changed):
    server = client(valhalla(**changed))
    return ValhallaRouter(lambda action, request: server.post_json(f"/{action}", request))


ROUTERS = {
    "osrm": (OsrmRouter, lambda: osrm(annotated=True)),
    "steps": (OsrmRouter, lambda: osrm(annotated=False)),
    "graphhopper": (GraphHopperRouter, graphhopper),
    "openrouteservice": (OpenRouteServiceRouter, openrouteservice),
}


# places


def test_bearings_follow_the_compass():
    around = bearings_deg(np.array([47.0, 47.1, 47.1, 47.0, 47.0]), np.array([9.0, 9.0, 9.1, 9.1, 9.0]))
    assert around == pytest.approx([0.0, 89.963, 180.0, 270.037], abs=0.01)
    assert bearings_deg(np.array([0.0, 1.0]), np.array([179.5, -179.5])) == pytest.approx([45.0], abs=0.01)


def test_a_place_that_moved_there_and_back_is_where_it_was():
    there = A.moved(30.0, 50_000.0)
    assert A.distance_m(there) == pytest.approx(50_000.0, rel=1e-9)
    lats, lons = np.array([47.0, there.latitude_deg]), np.array([9.0, there.longitude_deg])
    assert bearings_deg(lats, lons) == pytest.approx([30.0])
    assert Place(0.0, 179.9).moved(90.0, 22239.0).longitude_deg == pytest.approx(-179.9, abs=1e-4)


@pytest.mark.parametrize("text", ["47.1,9.5", "47.1 9.5", " geo:47.1,9.5", "47.1; 9.5", "47.1, 9.5 "])
def test_coordinates_are_read_as_people_write_them(text):
    assert read_coordinates(text) == Place(47.1, 9.5)


@pytest.mark.parametrize("text", ["Vaduz", "12", "47.1,9.5,3", "12 Landstrasse", ""])
def test_other_texts_are_no_coordinates(text):
    assert read_coordinates(text) is None


def test_every_coordinate_that_no_place_has_is_named():
    with pytest.raises(InvalidInput, match=r"latitude: got 91°; allowed: -90° to 90°\n.*longitude: got 181°"):
        Place(91.0, 181.0)
    assert Place(-90.0, 180.0).title == "-90.00000, 180.00000"
    with pytest.raises(InvalidInput, match="nan°"):
        Place(NAN, 0.0)


# links of edges


def edges(length, time, speed=None, limit=None, kinds=None, signal=None):
    n = len(length)
    full = lambda values: np.full(n, NAN) if values is None else np.array(values, dtype=float)  # noqa: E731
    signals = np.zeros(n, dtype=bool) if signal is None else np.array(signal)
    return Edges(full(length), full(time), full(speed), full(limit), tuple(kinds or [""] * n), signals)


def test_edges_of_one_speed_are_one_link_with_the_delays_in_its_time():
    links, kinds = pooled(edges([100.0, 300.0, 200.0], [7.0, 15.0, 10.0], [20.0, 20.0, 20.0]))
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
        ({"limit": [14.0, NAN]}, [100.0, 100.0]),
        ({"limit": [14.0, 14.0]}, [200.0]),
        ({"signal": [True, False]}, [100.0, 100.0]),
        ({"signal": [False, True]}, [200.0]),
    ],
)
def test_links_end_where_class_limit_or_a_signal_changes(more, lengths):
    links, kinds = pooled(edges([100.0, 100.0], [10.0, 10.0], **more))
    assert links.length_m.tolist() == lengths
    assert len(kinds) == len(lengths)


@pytest.mark.parametrize(("second_s", "number"), [(10.0, 1), (10.34, 1), (10.4, 2), (9.7, 1), (9.6, 2)])
def test_speeds_that_differ_by_rounding_are_one(second_s, number):
    links, _ = pooled(edges([100.0, 100.0], [10.0, second_s]))
    assert len(links) == number


def test_a_delay_at_a_signal_is_a_standstill_a_short_one_is_not():
    found, _ = pooled(edges([100.0, 100.0], [15.0, 10.0], [10.0, 10.0], signal=[True, False]))
    assert found.stop_s[0] == 5.0
    assert math.isnan(found.stop_s[1])
    found, _ = pooled(edges([100.0, 100.0], [11.9, 10.0], [10.0, 10.0], signal=[True, False]))
    assert math.isnan(found.stop_s[0])


def test_a_time_shorter_than_the_free_one_becomes_the_free_one():
    found, _ = pooled(edges([100.0], [9.0], [10.0]))
    assert found.travel_time_s.tolist() == [10.0]


def test_edges_without_length_belong_to_the_next():
    found, _ = pooled(edges([0.0, 100.0, 0.001], [0.0, 10.0, 0.0]))
    assert found.length_m.tolist() == [100.001]


# Valhalla


def test_the_links_of_valhalla_come_from_its_edges():
    (road,) = valhalla_router().roads([A, B])
    assert road.links.length_m == pytest.approx([HALF_M, HALF_M], abs=1.0)
    assert road.links.moving_speed_m_s == pytest.approx([50.0 / 3.6, 100.0 / 3.6])
    assert road.links.travel_time_s == pytest.approx([283.0, 137.0])
    assert road.links.stop_s[0] == pytest.approx(283.0 - HALF_M * 3.6 / 50.0, abs=0.1)  # the signal
    assert road.links.speed_limit_m_s == pytest.approx([50.0 / 3.6, NAN], nan_ok=True)
    assert road.road_class == ("secondary", "motorway")
    assert road.distance_m == pytest.approx(2 * HALF_M, abs=1.0)
    assert road.duration_s == pytest.approx(420.0)
    assert road.position_m == pytest.approx([0.0, HALF_M, 2 * HALF_M], abs=1.0)
    assert road.place_at(HALF_M).longitude_deg == pytest.approx(9.05, abs=1e-5)
    assert road.heading_at(np.array([0.0, 5000.0, 9e9])) == pytest.approx([90.0, 90.0, 90.0], abs=0.1)


def test_a_tunnel_is_straight_between_the_heights_at_its_ends():
    (road,) = valhalla_router().roads([A, B])
    assert road.links.elevation_m.tolist() == [500.0, 537.0, 575.8]  # 900 m lies on the mountain above it
    assert "no_elevation" not in {flag.code for flag in road.links.flags}
    assert road.plan().flags == ()


@pytest.mark.parametrize(
    "height", [{"height": [None, None]}, {"range_height": []}, {"range_height": [[0, None], [9, 5.0]]}]
)
def test_without_heights_the_road_is_flat_and_flagged(height):
    (road,) = valhalla_router(height=height).roads([A, B])
    assert road.links.elevation_m is None
    assert [flag.code for flag in road.links.flags] == ["no_elevation"]


def test_what_valhalla_is_asked():
    seen = []

    def answer(request):
        seen.append((request.url.path, body_of(request)))
        return valhalla()(request)

    server = client(answer)
    router = ValhallaRouter(lambda action, request: server.post_json(f"/{action}", request))
    router.roads([A, B])
    assert [path for path, _ in seen] == ["/base/route", "/base/trace_attributes", "/base/height"]
    assert seen[0][1] == {
        "locations": [{"lat": 47.0, "lon": 9.0}, {"lat": 47.0, "lon": 9.1}],
        "costing": "auto",
        "directions_type": "none",
    }
    assert seen[1][1]["shape_match"] == "edge_walk"
    assert seen[1][1]["encoded_polyline"] == encoded([(47.0, 9.0), (47.0, 9.05), (47.0, 9.1)])
    assert seen[2][1]["shape_format"] == "polyline6"
    seen.clear()
    router.roads([A, B], alternatives=2)
    assert seen[0][1]["alternates"] == 2
    assert seen[1][1]["costing_options"] == {"auto": {"shortest": True}}
    assert len([path for path, _ in seen if path.endswith("trace_attributes")]) == 1  # the same line twice


def test_alternatives_differ_and_tracks_are_left_out():
    def trip(middle):
        return {"trip": {"legs": [{"shape": encoded([(47.0, 9.0), (middle, 9.05), (47.0, 9.1)])}]}}

    slow = [{**edge, "end_node": {"elapsed_time": 700.0 * (k + 1)}} for k, edge in enumerate(VALHALLA_EDGES)]

    def answer(request):
        if request.url.path.endswith("trace_attributes"):
            line = body_of(request)["encoded_polyline"]
            late = line == encoded([(47.0, 9.0), (47.02, 9.05), (47.0, 9.1)])
            return httpx.Response(200, json={"edges": slow if late else VALHALLA_EDGES})
        if request.url.path.endswith("route"):
            shortest = "costing_options" in body_of(request)
            more = {} if shortest else {"alternates": [trip(47.01), trip(47.0)]}
            return httpx.Response(200, json={**trip(47.02 if shortest else 47.0), **more})
        return valhalla()(request)

    server = client(answer)
    roads = ValhallaRouter(lambda action, request: server.post_json(f"/{action}", request)).roads(
        [A, B], alternatives=2
    )
    assert [round(float(road.latitude_deg[1]), 3) for road in roads] == [47.0, 47.01]


def test_legs_follow_each_other():
    middle = Place(47.0, 9.05)
    legs = [{"shape": encoded([(47.0, 9.0), (47.0, 9.05)])}, {"shape": encoded([(47.0, 9.05), (47.0, 9.1)])}]
    edge = {**VALHALLA_EDGES[0], "end_node": {"elapsed_time": 283.0, "traffic_signal": False}}
    changed = {
        "route": {"trip": {"legs": legs}},
        "trace_attributes": {"edges": [edge]},
        "height": {"range_height": [[0, 500.0], [3790, 540.0]]},
    }
    (road,) = valhalla_router(**changed).roads([A, middle, B])
    assert road.stop_position_m == pytest.approx((HALF_M,), abs=1.0)
    assert road.links.length_m == pytest.approx([2 * HALF_M], abs=1.0)
    assert road.links.elevation_position_m == pytest.approx([0.0, 3790.0, HALF_M, HALF_M + 3790.0], abs=1.0)


def test_corners_of_an_isochrone():
    assert valhalla_router().outline(A, 10.0) == (Place(47.0, 9.1), Place(47.1, 9.0), Place(47.0, 8.9))
    ring = [[[9.1, 47.0], [9.0, 47.1]]]
    many = {"features": [{"geometry": {"type": "MultiPolygon", "coordinates": [ring, ring]}}]}
    assert len(valhalla_router(isochrone=many).outline(A, 10.0)) == 4


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


@pytest.mark.parametrize("name", ["valhalla", *ROUTERS])
def test_a_road_far_from_the_place_belongs_to_another(name):
    far = Place(47.02, 9.0)  # 2.2 km north of the start
    with pytest.raises(
        InvalidInput, match=r"place outside of the map: 47.02000, 9.00000: got 2.2 km from the nearest road"
    ):
        router_of(name).roads([far, B])
    assert router_of(name).roads([Place(47.013, 9.0), B])


@pytest.mark.parametrize("stops", [[A], [A, A], []])
def test_a_journey_needs_two_places(stops):
    with pytest.raises(InvalidInput, match=r"too few places|no way to drive"):
        valhalla_router().roads(stops)


# the other routers


def router_of(name, document=None):
    if name == "valhalla":
        return valhalla_router()
    kind, make = ROUTERS[name]
    return kind(client(make() if document is None else document))


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


def test_the_energy_of_osrm_by_annotation_is_that_by_steps():
    work = [road_work(router_of(name).roads([A, B])[0].plan()) for name in ("osrm", "steps")]
    assert work[0] == pytest.approx(work[1], rel=0.02)


def test_graphhopper_gives_limits_classes_and_heights():
    (road,) = router_of("graphhopper").roads([A, B])
    assert road.links.length_m == pytest.approx([3792.0, 3792.0], abs=1.0)
    assert road.links.travel_time_s == pytest.approx([283.0, 137.0])
    assert road.links.moving_speed_m_s == pytest.approx([50.0 / 3.6, 100.0 / 3.6], rel=1e-3)
    assert road.links.speed_limit_m_s == pytest.approx([50.0 / 3.6, NAN], nan_ok=True)
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


@pytest.mark.parametrize("name", ROUTERS)
def test_each_router_is_asked_in_its_own_way(name):
    seen = []
    kind, make = ROUTERS[name]
    router = kind(client(lambda r: seen.append(r) or httpx.Response(200, json=make())))
    router.roads([A, B], alternatives=1)
    url = str(seen[0].url)
    if kind is OsrmRouter:
        assert "/base/route/v1/driving/9.000000,47.000000;9.100000,47.000000?alternatives=1&" in url
        assert seen[0].url.params["annotations"] == "duration,distance,speed"
    else:
        body = body_of(seen[0])
        key = "points" if kind is GraphHopperRouter else "coordinates"
        assert body[key] == [[9.0, 47.0], [9.1, 47.0]]
        assert body["elevation"] is True
        more = body.get("alternative_route.max_paths") or body["alternative_routes"]["target_count"]
        assert more == 2
    assert router.outline(A, 10.0) == ()


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
            outcomes.add(outcome(kind(client(answer))))
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


def test_too_many_edges_are_refused_before_they_are_read(monkeypatch):
    monkeypatch.setattr("tripwatt.routes.routers.valhalla.MOST_EDGES", 1)
    with pytest.raises(RemoteError, match="too many edges"):
        valhalla_router().roads([A, B])


# names of servers


def test_a_server_is_named_by_kind_and_url():
    assert open_server("http://h:8002").name == "valhalla at h:8002"
    assert open_server("graphhopper=https://h/api").name == "graphhopper at h"
    assert open_server("openrouteservice=https://h").client.base_url == "https://h"
    with pytest.raises(
        InvalidInput, match="unknown kind of server: --router: got google; allowed: valhalla, osrm"
    ):
        open_server("google=http://h")
    assert split_kind("http://h/a=b", {"x": 1}, "w") == ("x", "http://h/a=b")


def test_a_road_becomes_a_plan_with_its_times():
    (road,) = valhalla_router().roads([A, B])
    plan = road.plan("a to b")
    assert plan.trip_id == "a to b"
    assert plan.free_flow
    assert plan.duration_s == pytest.approx(420.0, rel=0.02)
    assert plan.distance_m == pytest.approx(2 * HALF_M, rel=2e-3)
    assert not plan_from_links(
        road.links.__class__(*(np.array([v]) for v in (500.0, 50.0, NAN, NAN)))
    ).free_flow
