"""Saved responses of routers as links, and which reader takes what."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.routes.made import NO, SPEED, TO_ROUNDING, drive, encode_polyline, faults_of, gpx
from tests.support.refusals import refusal, refuses

from tripwatt.errors import InvalidInput
from tripwatt.routes import LinkRoute, Track, is_route, parse_route
from tripwatt.routes.points import haversine_m, heights_along
from tripwatt.routes.responses import (
    ROUTERS,
    recognise_router,
    route_from_graphhopper,
    route_from_openrouteservice,
    route_from_osrm,
    route_from_parts,
    route_from_valhalla,
)
from tripwatt.routes.services import Part
from tripwatt.trips import Flag

RESPONSES = Path(__file__).parent / "responses"


@pytest.mark.parametrize(
    ("router", "length", "time"),
    [
        ("osrm", [25 + 225, 500, 500, 600], [36, 43.2, 28.8, 60]),
        ("valhalla", [500, 1500], [60, 90]),
        ("openrouteservice", [400, 1100], [48, 72]),
        ("graphhopper", [1000, 1000], [100, 60]),
    ],
)
def test_responses_of_routers(router, length, time):
    path = RESPONSES / f"{router}.json"
    route = parse_route(path)
    got_length, got_time = route.length_m, route.travel_time_s
    if router == "osrm":  # the first two pieces have one speed
        got_length = np.concatenate(([got_length[:2].sum()], got_length[2:]))
        got_time = np.concatenate(([got_time[:2].sum()], got_time[2:]))
        assert route.moving_speed_m_s[2] == pytest.approx(500 / 36)
    np.testing.assert_allclose(got_length, length, rtol=1e-3)
    np.testing.assert_allclose(got_time, time, rtol=1e-6)
    assert ROUTERS[router](json.loads(path.read_bytes()), "t").duration_s == route.duration_s
    trip = parse_route(path).plan()
    assert trip.duration_s == pytest.approx(sum(time), rel=0.02, abs=2.0)
    assert trip.distance_m == pytest.approx(sum(length), rel=0.01)


def test_heights_of_responses():
    assert parse_route(RESPONSES / "valhalla.json").elevation_at([0, 1000, 2000]).tolist() == [500, 520, 510]
    assert parse_route(RESPONSES / "graphhopper.json").elevation_at(
        [0, 1000, 2000]
    ).tolist() == pytest.approx([500, 504, 510])
    assert parse_route(RESPONSES / "openrouteservice.json").elevation_at(
        [0, 400, 1500]
    ).tolist() == pytest.approx([500, 508, 508], abs=0.1)
    assert parse_route(RESPONSES / "osrm.json").flags == (Flag("no_elevation", "road"),)


def test_one_height_is_that_of_the_whole_line_wherever_it_is():
    line = np.array([[0.0, 0.0, NO], [0.0, 1.0, NO], [0.0, 1.5, NO]])
    assert heights_along(line) is None
    for k in range(3):
        points = line.copy()
        points[k, 2] = 7.0
        position, height = heights_along(points)
        assert position.tolist() == [0.0, *np.cumsum(haversine_m(line[:, 0], line[:, 1])).tolist()]
        assert height.tolist() == [7.0] * 3
    assert heights_along(np.array([[0.0, 0.0, 7.0], [0.0, 0.0, 8.0]])) is None


def test_a_leg_of_osrm_has_its_duration():
    response = json.loads((RESPONSES / "osrm.json").read_text())
    for wrong in (None, -1.0, "60"):
        leg = response["routes"][0]["legs"][0]
        leg["duration"] = wrong
        assert "legs[0], duration: got" in refusal(route_from_osrm, response)


def test_encoded_responses_with_heights():
    points = [(48.1, 11.5, 500.0), (48.1, 11.5135, 504.0), (48.1, 11.527, 510.0)]
    response = json.loads((RESPONSES / "graphhopper.json").read_text())
    path = response["paths"][0]
    path |= {"points": encode_polyline(points, [1e5, 1e5, 100]), "points_encoded": True}
    assert parse_route(json.dumps(response).encode()).elevation_at([0, 1000, 2000]).tolist() == pytest.approx(
        [500, 504, 510]
    )
    flat = [(48.1 + 0.001 * k, 11.5 + 0.002 * k) for k in range(6)]
    length = float(haversine_m([p[0] for p in flat], [p[1] for p in flat]).sum())
    flat_path = {
        "points": encode_polyline(flat, [1e5, 1e5]),
        "points_encoded": True,
        "distance": length,
        "time": 90_000,
    }
    route = parse_route(json.dumps({"paths": [flat_path]}).encode())
    assert route.elevation_m is None
    assert route.distance_m == pytest.approx(length)
    steps = [{"distance": 2000.0, "duration": 160.0, "way_points": [0, 2]}]
    ors = {
        "routes": [
            {
                "summary": {"distance": 2000, "duration": 160, "ascent": 10.0, "descent": 0.0},
                "geometry": encode_polyline(points, [1e5, 1e5, 100]),
                "segments": [{"distance": 2000, "duration": 160, "steps": steps}],
            }
        ]
    }
    assert parse_route(json.dumps(ors).encode()).elevation_at([1000]).tolist() == pytest.approx(
        [504], abs=0.01
    )


BOMB = """<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>
<gpx><rte><rtept lat="48" lon="11"/><rtept lat="49" lon="11"><name>&b;</name></rtept></rte></gpx>"""


REFUSED = {
    "entities": BOMB.encode(),
    "external entity": BOMB.replace('"aaaaaaaaaa"', 'SYSTEM "file:///etc/hostname"').encode(),
    "document type": b'<!DOCTYPE gpx SYSTEM "x.dtd"><gpx/>',
    "cut off": gpx(drive(SPEED))[:-20],
    "not gpx": b"<svg/>",
    "no points": b"<gpx/>",
    "one point": gpx([(48.0, 11.0, None, None)]),
    "deep": b"<gpx>" + b"<extensions>" * 200 + b"</extensions>" * 200 + b"</gpx>",
    "unknown encoding": gpx(drive(SPEED), head="<?xml version='1.0' encoding='klingon'?>"),
    "latitude": gpx([(91.0, 11.0, None, None), (48.0, 11.0, None, None)]),
    "longitude": gpx([(48.0, 999.0, None, None), (48.0, 11.0, None, None)]),
    "not a number": gpx(drive(SPEED)).replace(b'lat="48.0', b'lat="x48.0', 1),
    "nan": gpx(drive(SPEED)).replace(b'lat="48.000000000"', b'lat="nan"'),
    "time back": gpx(drive(SPEED)[:50] + drive(SPEED)[40:60]),
    "no time": gpx(drive(SPEED)).replace(b"2026-05-01T08:00:07Z", b"yesterday"),
    "no length": gpx([(48.0, 11.0, None, None)] * 3),
    "teleport": gpx([*drive(SPEED)[:30], (48.5, 11.0, None, "2026-05-01T08:00:31Z")]),
    "json": b"{",
    "empty": b"",
    "zeros": b"\0\0\0",
    "deep json": b"[" * 100_000,
    "deep geojson": b'{"type":"Feature","geometry":' * 5000,
    "nan json": b'[{"length_m": NaN, "speed_m_s": 1}]',
    "huge": b'{"type":"LineString","coordinates":[[1e999,0],[0,0]]}',
    "huge integer": b'{"type":"LineString","coordinates":[[' + b"9" * 4000 + b",0],[0,0]]}",
    "endless integer": b'[{"length_m": ' + b"9" * 100_000 + b', "speed_m_s": 1}]',
    "text": b'{"type":"LineString","coordinates":[["a","b"],[0,0]]}',
    "no route": b'{"code":"NoRoute","message":"Impossible route","routes":[]}',
    "no paths": b'{"message":"Cannot find point"}',
    "ors error": b'{"error":{"code":2010,"message":"Could not find routable point"}}',
    "valhalla error": b'{"trip":{"status":442,"status_message":"No path could be found"}}',
    "bad polyline": json.dumps(
        {
            "routes": [
                {
                    "summary": {"ascent": 1},
                    "geometry": "\u00e9\u00e9",
                    "segments": [{"distance": 1, "duration": 1}],
                }
            ]
        }
    ).encode(),
    "something else": b'{"name":"me"}',
    "number": b"12",
    "table of nothing": b"length_m,speed_m_s\n",
    "table without a speed": b"length_m\n500\n",
    "table of nan": b"length_m,speed_m_s\nnan,inf\n",
    "table of bytes": b"length_m,speed_m_s\n\xff\xfe,1\n",
    "table of one endless cell": b"length_m,speed_m_s\n" + b"1" * 200_000 + b",1\n",
    "deep tracks": b"<gpx>" + b"<trk>" * 100_000,
    "wide attribute": b'<gpx><rte><rtept lat="48" lon="' + b"1" * 1_000_000 + b'"/></rte></gpx>',
    "infinite place": gpx(drive(SPEED)).replace(b'lat="48.000000000"', b'lat="1e400"'),
    "parameter entity": b'<!DOCTYPE gpx [<!ENTITY % a SYSTEM "file:///etc/passwd">%a;]><gpx/>',
    "late document type": b"<!-- --><?x y?><!DOCTYPE gpx><gpx/>",
    "UTF-16 bomb": BOMB.replace('version="1.0"', 'version="1.0" encoding="UTF-16"').encode("utf-16"),
    "year 99999": gpx(drive(SPEED)).replace(b"2026-05-01T08:00:00Z", b"99999-05-01T08:00:00Z"),
    "negative duration": b'{"code":"Ok","routes":[{"legs":[{"distance":900,"duration":-60}]}]}',
    "huge duration": b'{"code":"Ok","routes":[{"legs":[{"distance":900,"duration":1e300}]}]}',
    "unknown unit": b'{"trip":{"status":0,"units":"versts","legs":[]}}',
    "points beyond the path": json.dumps(
        {"paths": [{"points": {"coordinates": [[11, 48], [11.1, 48]]}, "details": {"time": [[0, 9, 1000]]}}]}
    ).encode(),
}


@pytest.mark.parametrize("name", REFUSED)
def test_broken_routes_are_refused(name):
    with pytest.raises(InvalidInput) as caught:
        parse_route(REFUSED[name]).plan()
    assert all(len(str(fault)) < 500 for fault in caught.value.faults)


def test_a_height_that_no_place_has_is_not_known() -> None:
    track = parse_route(gpx([(48.0, 11.0, 99999, None), (48.1, 11.0, 0, None)]))
    plan = track.plan(speed_m_s=10.0)
    assert {flag.code for flag in plan.flags} & {"elevation_interpolated", "flat_road", "flat"}
    assert np.ptp(plan.array("elevation_m")) == 0.0


SEEDS = [
    gpx(drive(SPEED, np.linspace(1, 9, len(SPEED)), every_s=9)),
    json.dumps({"type": "LineString", "coordinates": [[11, 48, 3], [11.1, 48], [11.2, 48.1]]}).encode(),
    json.dumps(
        [{"length_m": 300, "speed_m_s": 9, "grade": 0.01}, {"length_m": 90, "travel_time_s": 9}]
    ).encode(),
    b"length_m,speed_m_s,grade,stop_s,speed_limit_m_s\n500,10,0.01,,14\n250,5,,20,\n",
    *(p.read_bytes() for p in sorted(RESPONSES.glob("*.json"))),
]


SNIPPETS = [
    b"",
    b"-",
    b"1e9",
    b"null",
    b"[]",
    b"{}",
    b'"',
    b"<",
    b">",
    b"9999999999",
    b"0",
    b"nan",
    b"\xff",
    b"&x;",
    b"true",
    b"-1",
    b"<trk>",
    b"</trkseg>",
    b",",
    b";",
    b"\n",
    b"\x00",
    b"<!DOCTYPE x>",
]


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from(SEEDS),
    st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(SNIPPETS)), min_size=1, max_size=4
    ),
)
def test_mutants_are_refused_or_driven(text, changes):
    for place, length, snippet in changes:
        at = int(place * len(text))
        text = text[:at] + snippet + text[at + length :]
    try:
        route = parse_route(text)
        trip = route.plan(speed_m_s=10.0) if isinstance(route, Track) else route.plan()
    except InvalidInput:
        return
    assert isinstance(route, LinkRoute | Track)
    assert trip.distance_m > 0
    assert np.isfinite(trip.array("speed_m_s")).all()


KEYS = [
    "type",
    "coordinates",
    "routes",
    "legs",
    "trip",
    "paths",
    "features",
    "properties",
    "segments",
    "points",
    "details",
    "time",
    "distance",
    "duration",
    "maneuvers",
    "sections",
    "spans",
    "steps",
    "progress",
    "transport",
    "polyline",
    "links",
    "code",
]


@settings(max_examples=60, deadline=None)
@given(
    st.recursive(
        st.sampled_from([None, True, -5, 0, 3, 0.5, 1e300, "", "Ok"]),
        lambda inner: st.one_of(
            st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(KEYS), inner, max_size=4)
        ),
        max_leaves=12,
    ),
    st.sampled_from([None, *ROUTERS]),
)
def test_any_json_is_refused_or_a_route(document, router):
    try:
        if router and isinstance(document, dict):
            route = ROUTERS[router](document, "t")
        else:
            route = parse_route(json.dumps(document).encode())
    except InvalidInput:
        return
    assert len(route) > 0


EXACT = {"rtol": 1e-9, "atol": 1e-9}


DEGREE_M = 6_371_008.8 * math.pi / 180.0


def osrm(*legs, **more):
    return route_from_osrm({"routes": [{"legs": list(legs)}], **more})


def leg(duration, distances, durations):
    return {"duration": duration, "annotation": {"distance": distances, "duration": durations}}


def test_time_without_length_belongs_to_the_length_before():
    made = osrm(leg(5.0, [90.0, 0.0], [0.0, 5.0]))
    assert (made.length_m.tolist(), made.travel_time_s.tolist()) == ([90.0], [5.0])
    assert np.isnan(made.moving_speed_m_s).all()
    behind = osrm(leg(17.0, [90.0, 60.0, 0.0], [9.0, 6.0, 2.0]))
    np.testing.assert_allclose(behind.travel_time_s, [9.0, 8.0], **EXACT)
    more = osrm(leg(15.0, [90.0, 60.0, 4.0], [9.0, 6.0, 0.0]))
    np.testing.assert_allclose(more.length_m, [90.0, 64.0], **EXACT)


def test_what_stands_in_for_an_annotation():
    step = {"distance": 50.0, "duration": 5.0}
    whole = {"distance": 70.0, "duration": 7.0}
    for annotation in (None, {}, 5, {"duration": [], "distance": [1.0]}, {"duration": [1.0]}):
        assert osrm({**whole, "annotation": annotation, "steps": [step]}).distance_m == 50.0
        assert osrm({**whole, "annotation": annotation, "steps": []}).distance_m == 70.0
    small = osrm({"distance": 0.5, "duration": 0.25})
    assert (small.distance_m, small.duration_s) == (0.5, 0.25)


def test_faults_of_an_osrm_response():
    assert faults_of(osrm, code="NoRoute")[0].got == "'NoRoute'"
    (fault,) = faults_of(osrm, {"duration": 1.0, "distance": 1.0}, leg(1.0, [1.0, 2.0], [1.0]))
    assert (fault.what, fault.got) == ("annotations of different lengths", "2 and 1")
    assert fault.where == "OSRM response, routes[0], legs[1]"
    assert faults_of(osrm)[0].what == "too few entries"
    assert faults_of(route_from_osrm, {"routes": []})[0].what == "too few entries"


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
        refuses("0 or more", valhalla, turns(pair))
    for wrong in ([], [turns()]):
        refuses("too few entries", valhalla, *wrong)


def test_one_height_of_valhalla_lies_at_the_start():
    made = valhalla(turns((1.0, 60.0), elevation=[500.0]))
    assert (made.elevation_position_m.tolist(), made.elevation_m.tolist()) == ([0.0], [500.0])


def test_faults_of_a_valhalla_response():
    assert faults_of(valhalla, status=1, status_message="s" * 200)[0].got == "'" + "s" * 79
    assert faults_of(valhalla, units="u" * 99)[0].got == "'" + "u" * 39


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
    refuses("too few entries", route_from_openrouteservice, {"routes": [{"segments": []}]})


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


def graphhopper(**path):
    return route_from_graphhopper({"paths": [path]})


STEPS = [{"distance": 50.0, "time": 5000.0}]


TWO_OR_THREE = "A?AA?A"
"""Six numbers: three points of two, 2.7 m long, or two points of three, 1.1 m long."""


@pytest.mark.parametrize(
    ("points", "more", "heights"),
    [
        (TWO_OR_THREE, {"distance": 1.2}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 0.0}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 1.8}, [0.01, 0.02]),
        (TWO_OR_THREE, {"distance": 2.0}, None),
        (TWO_OR_THREE, {"distance": 9.0}, None),
        ("A?A?", {}, None),
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
    refuses("1 or more", graphhopper, **whole, points_encoded_multiplier=0.9)
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
    refuses("no route", graphhopper, points=line(9.0, 9.0), distance=600.0, details={"time": [[0, 1, 500]]})
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
    refuses("not JSON", parse_route, b" " * 200 + GPX)
    links = [{"length_m": 9.0, "speed_m_s": 3.0}]
    assert isinstance(parse_route(json.dumps({"links": links, "type": "x"}).encode()), LinkRoute)
    line = {"type": "LineString", "coordinates": [[1.0, 2.0], [1.0, 3.0]]}
    assert isinstance(parse_route(json.dumps(line).encode()), Track)
    osrm = {"type": "x", "code": "Ok", "routes": [{"legs": [{"distance": 9.0, "duration": 3.0}]}]}
    assert isinstance(parse_route(json.dumps(osrm).encode()), LinkRoute)
    refuses("packed file: route: got a ZIP archive", parse_route, b"PK\x03\x04")


def test_keys_of_an_unknown_document_are_cut():
    many = {f"k{n}": 1 for n in range(9)}
    (fault,) = faults_of(parse_route, json.dumps(many).encode())
    assert fault.got == "an object with ['k0', 'k1', 'k2', 'k3', 'k4', 'k5']"
    long = {"k" * 200: 1}
    assert faults_of(parse_route, json.dumps(long).encode())[0].got == "an object with ['" + "k" * 103


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
        ({"routes": [{}, {"legs": []}]}, None),
        ({"routes": [{"summary": {}}]}, "openrouteservice"),
        ({"routes": [5]}, None),
        ({"routes": {"legs": 1}}, None),
        ({"routes": [], "error": 1}, "openrouteservice"),
        ({"error": 5}, "openrouteservice"),
        ({}, None),
    ],
)
def test_the_first_sign_of_a_router_counts(response, router):
    assert recognise_router(response) == router


def of_pieces(pieces, heights=None):
    return Part(np.array(pieces), np.zeros(len(pieces), dtype=bool), heights)


def test_pieces_without_length_or_time_go_to_the_next():
    pieces = [
        (0.0, 5.0, 1.0),
        (100.0, 10.0, 8.0),
        (30.0, 0.0, 2.0),
        (0.005, 1.0, 9.0),
        (64.0, 9.0, 7.0),
        (2.0, 0.0, 3.0),
    ]
    heights = np.array([0.0, 1.0, 4.0]), np.array([5.0, 6.0, 7.0])
    made = route_from_parts([of_pieces(pieces, heights)], "t", Flag("a", "b"))
    np.testing.assert_allclose(made.length_m, [100.0, 30.005, 66.0], **TO_ROUNDING)
    assert made.travel_time_s.tolist() == [15.0, 1.0, 9.0]
    assert made.moving_speed_m_s.tolist() == [8.0, 9.0, 7.0]
    np.testing.assert_allclose(made.elevation_position_m, np.array([0.0, 0.25, 1.0]) * 196.005, **TO_ROUNDING)
    assert made.flags == (Flag("a", "b"),)
    short = route_from_parts([of_pieces([(0.01, 1.0, NO), (0.009, 1.0, NO), (5.0, 2.0, NO)])], "t")
    assert short.length_m.tolist() == [0.01, 5.009]
    refuses("no route", route_from_parts, [of_pieces(np.zeros((0, 3)))], "t")


def test_heights_of_points():
    at = np.array([[0.0, 0.0, 500.0], [0.0, 1.0, NO], [0.0, 3.0, 530.0], [0.0, 4.0, NO]])
    position, height = heights_along(at)
    degree = np.pi / 180.0 * 6_371_008.8
    np.testing.assert_allclose(position, degree * np.array([0.0, 1.0, 3.0, 4.0]), rtol=1e-9)
    np.testing.assert_allclose(height, [500.0, 510.0, 530.0, 530.0], rtol=1e-9)
    assert heights_along(at[:, :2]) is None
    assert heights_along(np.full((2, 3), NO)) is None
    assert heights_along(np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 6.0]])) is None


def test_what_a_leg_takes_longer_is_shared_out():
    """60 s for pieces of 10 and 30 s: each takes half as long again, and its moving speed stays."""
    made = route_from_osrm({"routes": [{"legs": [leg(60.0, [100.0, 450.0], [10.0, 30.0])]}]})
    np.testing.assert_allclose(made.travel_time_s, [15.0, 45.0], **TO_ROUNDING)
    np.testing.assert_allclose(made.moving_speed_m_s, [10.0, 15.0], **TO_ROUNDING)
    shorter = route_from_osrm({"routes": [{"legs": [leg(20.0, [100.0, 450.0], [10.0, 30.0])]}]})
    np.testing.assert_allclose(shorter.travel_time_s, [10.0, 30.0], **TO_ROUNDING)
    empty = route_from_osrm({"routes": [{"legs": [leg(20.0, [0.0, 450.0], [10.0, 30.0])]}]})
    np.testing.assert_allclose(empty.moving_speed_m_s, [15.0], **TO_ROUNDING)
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
    np.testing.assert_allclose(
        made.elevation_position_m, [0.0, 1000.0, 1000.0, 2500.0, 4000.0], **TO_ROUNDING
    )
    assert made.elevation_m.tolist() == [500.0, 510.0, 510.0, 530.0, 520.0]
    trip["legs"][0].pop("elevation")
    assert route_from_valhalla({"trip": trip}).elevation_m is None
    miles = route_from_valhalla({"trip": {"units": "miles", "legs": [leg(1.0, 60.0, [100.0, 200.0])]}})
    assert miles.distance_m == 1609.344
    np.testing.assert_allclose(miles.elevation_m, [30.48, 60.96], **TO_ROUNDING)
