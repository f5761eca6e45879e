"""Saved responses of routers as links: units, bounds, lines with and without heights, and which reader takes what."""

import json
import math

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes import LinkRoute, Track, parse_route, read_response
from tripwatt.routes.responses import (
    is_route,
    route_from_graphhopper,
    route_from_openrouteservice,
    route_from_osrm,
    route_from_valhalla,
    router_of,
)

NO = math.nan
EXACT = {"rtol": 1e-9, "atol": 1e-9}
DEGREE_M = 6_371_008.8 * math.pi / 180.0


def faults_of(read, *args, **more):
    with pytest.raises(InvalidInput) as caught:
        read(*args, **more)
    return caught.value.faults


# OSRM


def osrm(*legs, **more):
    return route_from_osrm({"routes": [{"legs": list(legs)}], **more})


def leg(duration, distances, durations):
    return {"duration": duration, "annotation": {"distance": distances, "duration": durations}}


def test_pieces_of_an_osrm_leg_without_length_or_time_have_no_speed():
    made = osrm(leg(8.0, [0.5, 0.0, 60.0, 90.0], [0.25, 1.75, 2.0, 0.0]))
    np.testing.assert_allclose(made.length_m, [0.5, 150.0], **EXACT)
    np.testing.assert_allclose(made.travel_time_s, [0.5, 7.5], **EXACT)
    np.testing.assert_allclose(made.moving_speed_m_s, [2.0, 30.0], **EXACT)
    with pytest.raises(InvalidInput, match="no route"):
        osrm(leg(8.0, [50.0], [0.0]))


def test_time_without_length_belongs_to_the_length_before():
    made = osrm(leg(5.0, [90.0, 0.0], [0.0, 5.0]))
    assert (made.length_m.tolist(), made.travel_time_s.tolist()) == ([90.0], [5.0])
    assert np.isnan(made.moving_speed_m_s).all()
    behind = osrm(leg(17.0, [90.0, 60.0, 0.0], [9.0, 6.0, 2.0]))
    np.testing.assert_allclose(behind.travel_time_s, [9.0, 8.0], **EXACT)
    more = osrm(leg(15.0, [90.0, 60.0, 4.0], [9.0, 6.0, 0.0]))
    np.testing.assert_allclose(more.length_m, [90.0, 64.0], **EXACT)


def test_an_osrm_leg_may_be_shorter_than_its_pieces():
    np.testing.assert_allclose(osrm(leg(0.5, [9.0], [0.9])).travel_time_s, [0.9], **EXACT)
    np.testing.assert_allclose(osrm(leg(0.8, [9.0], [0.4])).travel_time_s, [0.8], **EXACT)


def test_what_stands_in_for_an_annotation():
    step = {"distance": 50.0, "duration": 5.0}
    whole = {"distance": 70.0, "duration": 7.0}
    for annotation in (None, {}, 5, {"duration": [], "distance": [1.0]}, {"duration": [1.0]}):
        assert osrm({**whole, "annotation": annotation, "steps": [step]}).distance_m == 50.0
        assert osrm({**whole, "annotation": annotation, "steps": []}).distance_m == 70.0
    small = osrm({"distance": 0.5, "duration": 0.25})
    assert (small.distance_m, small.duration_s) == (0.5, 0.25)


@pytest.mark.parametrize(
    "entry",
    [
        leg(-0.1, [9.0], [0.9]),
        leg(1.0, [-0.1], [0.9]),
        leg(1.0, [9.0], [-0.1]),
        {"distance": -0.1, "duration": 1.0},
        {"distance": 1.0, "duration": 1.0, "steps": [{"distance": 1.0, "duration": -0.1}]},
    ],
)
def test_nothing_of_an_osrm_response_is_negative(entry):
    with pytest.raises(InvalidInput, match="0 or more"):
        osrm(entry)


def test_faults_of_an_osrm_response():
    assert faults_of(osrm, code="NoRoute")[0].got == "'NoRoute'"
    (fault,) = faults_of(osrm, {"duration": 1.0, "distance": 1.0}, leg(1.0, [1.0, 2.0], [1.0]))
    assert (fault.what, fault.got) == ("annotations of different lengths", "2 and 1")
    assert fault.where == "OSRM response, routes[0], legs[1]"
    assert faults_of(osrm)[0].what == "too few entries"
    assert faults_of(route_from_osrm, {"routes": []})[0].what == "too few entries"


# Valhalla


def valhalla(*legs, **more):
    return route_from_valhalla({"trip": {"legs": list(legs), **more}})


def turns(*pairs, **more):
    return {"maneuvers": [{"length": length, "time": time} for length, time in pairs], **more}


def test_manoeuvres_of_valhalla():
    made = valhalla(turns((0.0005, 0.25), (0.0, 0.0), (1.0, 60.0)), status=0)
    np.testing.assert_allclose(made.length_m, [0.5, 1000.0], **EXACT)
    assert made.travel_time_s.tolist() == [0.25, 60.0]
    assert made.elevation_m is None
    for pair in ((-0.0001, 1.0), (1.0, -0.1)):
        with pytest.raises(InvalidInput, match="0 or more"):
            valhalla(turns(pair))
    for wrong in ([], [turns()]):
        with pytest.raises(InvalidInput, match="too few entries"):
            valhalla(*wrong)


def test_heights_of_valhalla_need_all_legs():
    high = turns((1.0, 60.0), elevation=[500.0, 520.0, 540.0])
    both = valhalla(high, high)
    assert both.elevation_position_m.tolist() == [0.0, 500.0, 1000.0, 1000.0, 1500.0, 2000.0]
    for legs in ([high, turns((1.0, 60.0))], [turns((1.0, 60.0), elevation=[]), high]):
        assert valhalla(*legs).elevation_m is None


def test_one_height_of_valhalla_lies_at_the_start():
    made = valhalla(turns((1.0, 60.0), elevation=[500.0]))
    assert (made.elevation_position_m.tolist(), made.elevation_m.tolist()) == ([0.0], [500.0])


def test_faults_of_a_valhalla_response():
    assert faults_of(valhalla, status=1, status_message="s" * 200)[0].got == "'" + "s" * 79
    assert faults_of(valhalla, units="u" * 99)[0].got == "'" + "u" * 39


# openrouteservice


def test_units_of_a_response_repeat_the_request():
    def metres(**more):
        segment = {"distance": 0.5, "duration": 60.0}
        return route_from_openrouteservice({"routes": [{"segments": [segment]}], **more}).distance_m

    assert metres() == 0.5
    assert metres(metadata=5) == metres(metadata={"query": 5}) == metres(metadata={"query": {}}) == 0.5
    assert metres(metadata={"query": {"units": "KM"}}) == 500.0
    assert metres(metadata={"query": {"units": "mi"}}) == 804.672
    for units in (5, None, "u" * 99):
        (fault,) = faults_of(metres, metadata={"query": {"units": units}})
        assert fault.got == repr(units)[:40]


def test_steps_of_openrouteservice_come_before_their_segment():
    step = {"distance": 0.5, "duration": 0.25}
    routes = [{"segments": [{"distance": 1.0, "duration": 1.0, "steps": [step, step]}, step]}]
    made = route_from_openrouteservice({"routes": routes})
    assert made.length_m.tolist() == [0.5] * 3
    assert faults_of(route_from_openrouteservice, {"error": "e" * 150})[0].got == "'" + "e" * 119
    with pytest.raises(InvalidInput, match="too few entries"):
        route_from_openrouteservice({"routes": [{"segments": []}]})


@pytest.mark.parametrize(
    ("longitudes", "positions"),
    [
        ((0.0, 5e-6), [0.0, 50.0]),
        ((0.0, 0.0, 0.002), [0.0, 0.0, 50.0]),
        ((0.0, 0.001, 0.002), [0.0, 25.0, 50.0]),
        ((0.0, 0.002, 0.002), [0.0, 50.0, 50.0]),
        ((0.0, 0.0), None),
    ],
)
def test_heights_lie_on_the_scale_of_the_steps(longitudes, positions):
    feature = {
        "geometry": {"coordinates": [[at, 0.0, 500.0 + k] for k, at in enumerate(longitudes)]},
        "properties": {"segments": [{"distance": 50.0, "duration": 5.0}]},
    }
    made = route_from_openrouteservice({"features": [feature]})
    if positions is None:
        assert made.elevation_m is None
        return
    np.testing.assert_allclose(made.elevation_position_m, positions, rtol=1e-9, atol=1e-9)
    assert made.elevation_m[-1] == 499.0 + len(longitudes)


def lines(latitudes, heights=None):
    """Deltas of an encoded line to the north, one hundred-thousandth of a degree or a hundredth of a metre each."""
    letters = {0: "?", 1: "A", 2: "C", -1: "@"}
    return "".join(
        letters[north] + "?" + ("" if heights is None else letters[heights[k]])
        for k, north in enumerate(latitudes)
    )


@pytest.mark.parametrize(
    ("summary", "known"),
    [({"ascent": 1.0}, True), ({"descent": 0.0}, True), ({"distance": 9.0}, False), ("ascent", False)],
)
def test_an_encoded_line_has_heights_where_the_summary_has_ascents(summary, known):
    route = {
        "summary": summary,
        "geometry": lines([0, 2], [1, 1]),
        "segments": [{"distance": 50.0, "duration": 5.0}],
    }
    made = route_from_openrouteservice({"routes": [route]})
    assert (None if made.elevation_m is None else made.elevation_m.tolist()) == (
        [0.01, 0.02] if known else None
    )
    route["geometry"] = {"coordinates": []}
    assert route_from_openrouteservice({"routes": [route]}).elevation_m is None


# GraphHopper


def graphhopper(**path):
    return route_from_graphhopper({"paths": [path]})


STEPS = [{"distance": 50.0, "time": 5000.0}]
TWO_OR_THREE = "A?AA?A"
"""Six numbers: three points of two, 2.7 m long, or two points of three, 1.1 m long."""


@pytest.mark.parametrize(
    ("points", "more", "heights"),
    [
        (TWO_OR_THREE, {}, None),
        (TWO_OR_THREE, {"bbox": [1.0, 2.0, 3.0, 4.0]}, None),
        (TWO_OR_THREE, {"bbox": [1.0, 2.0, 3.0, 4.0, 5.0]}, None),
        (TWO_OR_THREE, {"bbox": "123456"}, None),
        (TWO_OR_THREE, {"bbox": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 1.2}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 0.0}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 1.8}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 2.0}, None),
        (TWO_OR_THREE, {"distance": 9.0}, None),
        ("A?A?", {}, None),
        ("A?A?", {"bbox": [0.0] * 6}, None),
        ("A?AA?AA?A", {}, [0.01, 0.02, 0.03]),
    ],
)
def test_an_encoded_path_has_heights_where_they_fit(points, more, heights):
    made = graphhopper(points=points, instructions=STEPS, **more)
    assert (None if made.elevation_m is None else made.elevation_m.tolist()) == heights


def test_the_multiplier_of_a_path():
    path = {"points": "_ibE?_ibE?", "instructions": STEPS, "details": {"time": [[0, 1, 9_000_000]]}}
    np.testing.assert_allclose(graphhopper(**path).length_m, [DEGREE_M], **EXACT)
    fine = graphhopper(**path, points_encoded_multiplier=1e6)
    np.testing.assert_allclose(fine.length_m, [DEGREE_M / 10.0], rtol=1e-9)
    whole = {**path, "points": "A?A?"}
    np.testing.assert_allclose(
        graphhopper(**whole, points_encoded_multiplier=1).length_m, [DEGREE_M], rtol=1e-9
    )
    with pytest.raises(InvalidInput, match="1 or more"):
        graphhopper(**whole, points_encoded_multiplier=0.9)
    (fault,) = faults_of(graphhopper, points="A?A", instructions=STEPS)
    assert fault.got == "3 numbers"
    assert fault.allowed.startswith("2 for each")


def line(*longitudes):
    return {"coordinates": [[at, 0.0] for at in longitudes]}


@pytest.mark.parametrize(
    ("longitudes", "distance", "lengths"),
    [
        ((0.0, 0.01, 0.03), 600.0, [200.0, 400.0]),
        ((0.0, 0.01, 0.03), None, [DEGREE_M / 100.0, DEGREE_M / 50.0]),
        ((0.0, 0.0, 0.03), 600.0, [600.0]),
        ((0.0, 2e-6, 6e-6), 0.6, [0.2, 0.4]),
        ((0.0, 0.03, 0.03), 600.0, [600.0]),
    ],
)
def test_a_path_has_its_length(longitudes, distance, lengths):
    details = {"time": [[0, 1, 50_500], [1, 2, 90_000]], "average_speed": [[0, 2, 0.9]]}
    made = graphhopper(points=line(*longitudes), distance=distance, details=details)
    np.testing.assert_allclose(made.length_m, lengths, rtol=1e-9)
    assert made.travel_time_s.sum() == 140.5
    assert made.moving_speed_m_s[-1] == 0.25


def test_a_path_at_one_place_is_no_route():
    with pytest.raises(InvalidInput, match="no route"):
        graphhopper(points=line(9.0, 9.0), distance=600.0, details={"time": [[0, 1, 500]]})
    still = graphhopper(points=line(9.0, 9.0), distance=600.0, time=60_000)
    assert (still.distance_m, still.duration_s, still.elevation_m) == (600.0, 60.0, None)


def test_what_stands_in_for_details():
    for details in (None, 5, {}, {"time": []}):
        made = graphhopper(points=line(0.0, 0.01), details=details, instructions=STEPS)
        assert (made.distance_m, made.duration_s) == (50.0, 5.0)
    timed = {"time": [[0, 1, 9000]]}
    assert graphhopper(details=timed, distance=9.0, time=500.0, instructions=[]).duration_s == 0.5
    assert faults_of(route_from_graphhopper, {"message": "m" * 150})[0].got == "'" + "m" * 119
    assert faults_of(route_from_graphhopper, {})[0].what == "not a list"
    assert (
        route_from_graphhopper({"message": "hint", "paths": [{"distance": 9, "time": 900}]}).distance_m == 9
    )


# which reader


def test_links_that_a_file_holds(tmp_path):
    """A name decides, or the beginning; a file that is not there is none."""
    yes = {
        "a.GPX": b"",
        "a.kml": b"x",
        "a.txt": b"\xef\xbb\xbf \t\r\n<gpx/>",
        "b.txt": b" {",
        "c.txt": b"[",
        "d.csv": b"length_m;speed_m_s\n",
    }
    no = {"e.csv": b"time_s,speed_m_s\n", "f.txt": b"", "g.txt": b"PAR1", "h.txt": b"a<b"}
    for name, content in {**yes, **no}.items():
        (tmp_path / name).write_bytes(content)
        assert is_route(tmp_path / name) is (name in yes), name
        assert is_route(str(tmp_path / name)) is (name in yes)
    assert not is_route(tmp_path / "none.gpx")
    assert not is_route(tmp_path / "none.txt")
    (tmp_path / "folder.gpx").mkdir()
    assert not is_route(tmp_path / "folder.gpx")


GPX = b'<gpx><rte><rtept lat="1" lon="2"/><rtept lat="2" lon="2"/></rte></gpx>'


def test_the_beginning_of_a_text_tells_its_format():
    assert isinstance(parse_route(b" " * 199 + GPX), Track)
    with pytest.raises(InvalidInput, match="not JSON"):
        parse_route(b" " * 200 + GPX)
    links = [{"length_m": 9.0, "speed_m_s": 3.0}]
    assert isinstance(parse_route(json.dumps({"links": links, "type": "x"}).encode()), LinkRoute)
    line = {"type": "LineString", "coordinates": [[1.0, 2.0], [1.0, 3.0]]}
    assert isinstance(parse_route(json.dumps(line).encode()), Track)
    osrm = {"type": "x", "code": "Ok", "routes": [{"legs": [{"distance": 9.0, "duration": 3.0}]}]}
    assert isinstance(parse_route(json.dumps(osrm).encode()), LinkRoute)
    with pytest.raises(InvalidInput, match="packed file: route: got a ZIP archive"):
        parse_route(b"PK\x03\x04")


def test_keys_of_an_unknown_document_are_cut():
    many = {f"k{n}": 1 for n in range(9)}
    (fault,) = faults_of(parse_route, json.dumps(many).encode())
    assert fault.got == "an object with ['k0', 'k1', 'k2', 'k3', 'k4', 'k5']"
    (same,) = faults_of(read_response, json.dumps(many).encode())
    assert same.got == fault.got
    long = {"k" * 200: 1}
    for read in (parse_route, read_response):
        assert faults_of(read, json.dumps(long).encode())[0].got == "an object with ['" + "k" * 103
    (named,) = faults_of(read_response, b"{}", "mapquest")
    assert (named.what, named.got) == ("unknown router", "'mapquest'")


@pytest.mark.parametrize(
    ("response", "router"),
    [
        ({"trip": 1, "paths": 1, "code": "Ok"}, "valhalla"),
        ({"paths": 1, "code": "Ok"}, "graphhopper"),
        ({"features": [{"properties": {"segments": []}}], "code": "Ok"}, "openrouteservice"),
        ({"features": [{"properties": {}}], "code": "Ok"}, None),
        ({"features": [], "code": "Ok"}, "osrm"),
        ({"features": {}, "code": "Ok"}, "osrm"),
        ({"features": [{"properties": {}}, {"properties": {"segments": []}}]}, None),
        ({"features": [5, {"properties": {"segments": []}}]}, None),
        ({"routes": [{"legs": []}, {}]}, "osrm"),
        ({"routes": [{}, {"legs": []}]}, "openrouteservice"),
        ({"routes": [5]}, None),
        ({"routes": {"legs": 1}}, None),
        ({"routes": [], "error": 1}, "openrouteservice"),
    ],
)
def test_the_first_sign_of_a_router_counts(response, router):
    assert router_of(response) == router
