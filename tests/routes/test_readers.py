"""GPX, GeoJSON and routers' answers: what they say is what is driven, and nothing else than that gets through."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.routes import (
    ROAD_SPEED_M_S,
    LinkRoute,
    Track,
    parse_route,
    plan_from_route,
    plan_from_track,
    read_geojson,
    read_gpx,
    read_response,
    route_from_track,
)
from tripwatt.routes.points import haversine_m
from tripwatt.routes.polyline import decode_polyline
from tripwatt.trips import Flag

RESPONSES = Path(__file__).parent / "responses"
M_PER_DEGREE = float(haversine_m([48.0, 49.0], [11.0, 11.0])[0])


def gpx(points, tag="trkpt", head="<?xml version='1.0' encoding='UTF-8'?>\n"):
    """A GPX text of (latitude, longitude, elevation or None, time or None)."""
    body = "".join(
        f'<{tag} lat="{lat:.9f}" lon="{lon:.9f}">'
        + ("" if ele is None else f"<ele>{ele}</ele>")
        + ("" if time is None else f"<time>{time}</time>")
        + f"</{tag}>"
        for lat, lon, ele, time in points
    )
    inner = f"<trk><trkseg>{body}</trkseg></trk>" if tag == "trkpt" else f"<rte>{body}</rte>"
    return f'{head}<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">{inner}</gpx>'.encode()


def drive(speed, elevation=None, every_s=1):
    """GPX points of a drive due north, one every so many seconds."""
    position = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))))
    return [
        (
            48.0 + position[k] / M_PER_DEGREE,
            11.0,
            None if elevation is None else elevation[k],
            f"2026-05-01T{8 + k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d}Z",
        )
        for k in range(0, len(speed), every_s)
    ]


SPEED = np.concatenate(
    (
        np.linspace(0, 15, 20),
        np.full(100, 15.0),
        np.linspace(15, 0, 12),
        np.zeros(20),
        np.linspace(0, 12, 15),
        np.full(90, 12.0),
    )
)


def test_a_logged_drive_comes_back_from_gpx():
    track = read_gpx(gpx(drive(SPEED, np.linspace(500.0, 530.0, len(SPEED)))))
    trip = plan_from_route(track)
    assert track.is_log
    assert trip.departure.started_at.hour == 8
    assert trip.distance_m == pytest.approx(float(np.trapezoid(SPEED)), rel=0.01)
    assert np.abs(trip.array("speed_m_s") - SPEED).max() < 1.0
    assert np.all(trip.array("speed_m_s")[138:146] == 0.0)
    assert trip.array("elevation_m")[[0, -1]].tolist() == pytest.approx([500.0, 530.0], abs=0.1)


def test_jitter_of_positions_is_no_driving():
    rng = np.random.default_rng(1)
    points = [
        (lat + e / M_PER_DEGREE, lon, ele, t)
        for (lat, lon, ele, t), e in zip(drive(np.zeros(120)), rng.normal(0, 0.15, 120), strict=True)
    ]
    points += [(48.001, 11.0, None, "2026-05-01T08:02:09Z")]
    assert plan_from_track(read_gpx(gpx(points))).array("speed_m_s")[5:110].max() == 0.0


def test_a_sparse_track_gives_links_with_its_times():
    track = read_gpx(gpx(drive(SPEED, every_s=20)))
    route = route_from_track(track)
    assert not track.is_log
    assert route.duration_s == pytest.approx(track.time_s[-1])
    assert route.distance_m == pytest.approx(track.position_m[-1])
    assert plan_from_route(track).duration_s == pytest.approx(track.time_s[-1], rel=0.02)


def test_a_route_without_times_needs_a_speed():
    track = read_gpx(gpx([(48.0, 11.0, None, None), (48.02, 11.0, None, None)], "rtept"))
    with pytest.raises(InvalidInput, match="give speed_m_s"):
        plan_from_route(track)
    trip = plan_from_route(track, speed_m_s=16.0)
    assert trip.duration_s == pytest.approx(0.02 * M_PER_DEGREE / 16.0, abs=1.5)
    assert Flag("speed_assumed", "track", 16.0, "m_s") in trip.flags
    assert Flag("no_elevation", "road") in trip.flags


def test_geojson_lines_properties_and_heights():
    feature = {
        "type": "Feature",
        "properties": {"highway": "secondary"},
        "geometry": {"type": "LineString", "coordinates": [[11.0, 48.0, 500], [11.0, 48.01, 510]]},
    }
    faster = copy.deepcopy(feature)
    faster["properties"] = {"speed_m_s": 25.0}
    faster["geometry"]["coordinates"] = [[11.0, 48.01, 510], [11.0, 48.02, 505]]
    point = {"type": "Feature", "properties": None, "geometry": {"type": "Point", "coordinates": [11, 48]}}
    text = json.dumps({"type": "FeatureCollection", "features": [feature, point, faster]}).encode()
    track = read_geojson(text)
    route = route_from_track(track)
    np.testing.assert_allclose(route.speed_m_s, [ROAD_SPEED_M_S["secondary"], 25.0])
    assert route.elevation_at([0.0, route.distance_m / 2, route.distance_m]).tolist() == pytest.approx(
        [500, 510, 505]
    )
    assert track.flags == (Flag("geometries_skipped", "geometries", 1.0, "1"),)
    assert isinstance(parse_route(text), Track)


def test_geojson_times_are_a_log():
    line = {
        "type": "Feature",
        "properties": {"coordTimes": [p[3] for p in drive(SPEED)]},
        "geometry": {"type": "LineString", "coordinates": [[p[1], p[0]] for p in drive(SPEED)]},
    }
    np.testing.assert_allclose(
        plan_from_route(read_geojson(json.dumps(line).encode())).array("speed_m_s"),
        plan_from_route(read_gpx(gpx(drive(SPEED)))).array("speed_m_s"),
        atol=1e-3,
    )


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
    route = read_response(path)
    got_length, got_time = route.length_m, route.travel_time_s
    if router == "osrm":  # the first two pieces have one speed
        got_length = np.concatenate(([got_length[:2].sum()], got_length[2:]))
        got_time = np.concatenate(([got_time[:2].sum()], got_time[2:]))
        assert route.moving_speed_m_s[2] == pytest.approx(500 / 36)
    np.testing.assert_allclose(got_length, length, rtol=1e-3)
    np.testing.assert_allclose(got_time, time, rtol=1e-6)
    assert read_response(path, router).duration_s == route.duration_s
    trip = plan_from_route(parse_route(path))
    assert trip.duration_s == pytest.approx(sum(time), rel=0.02, abs=2.0)
    assert trip.distance_m == pytest.approx(sum(length), rel=0.01)


def test_heights_of_responses():
    assert read_response(RESPONSES / "valhalla.json").elevation_at([0, 1000, 2000]).tolist() == [
        500,
        520,
        510,
    ]
    assert read_response(RESPONSES / "graphhopper.json").elevation_at(
        [0, 1000, 2000]
    ).tolist() == pytest.approx([500, 504, 510])
    assert read_response(RESPONSES / "openrouteservice.json").elevation_at(
        [0, 400, 1500]
    ).tolist() == pytest.approx([500, 508, 508], abs=0.1)
    assert read_response(RESPONSES / "osrm.json").flags == (Flag("no_elevation", "road"),)


def test_miles_and_feet_of_valhalla():
    response = json.loads((RESPONSES / "valhalla.json").read_text())
    response["trip"]["units"] = "miles"
    route = read_response(json.dumps(response).encode())
    assert route.distance_m == pytest.approx(2.0 * 1609.344)
    assert route.elevation_at([0.0])[0] == pytest.approx(152.4)


@pytest.mark.parametrize(("units", "metres"), [("m", 1.0), ("km", 1000.0), ("mi", 1609.344)])
def test_units_of_openrouteservice(units, metres):
    response = json.loads((RESPONSES / "openrouteservice.json").read_text())
    for step in response["features"][0]["properties"]["segments"][0]["steps"]:
        step["distance"] /= metres
    response["metadata"]["query"] = {"units": units, "profile": "driving-car"}
    assert read_response(json.dumps(response).encode()).distance_m == pytest.approx(1500.0)
    response["metadata"]["query"]["units"] = "furlong"
    with pytest.raises(InvalidInput, match="unknown unit"):
        read_response(json.dumps(response).encode())


def encode(points, scales):
    """An encoded polyline, written the other way round than the reader."""
    text, before = "", np.zeros(len(scales), dtype=np.int64)
    for point in np.rint(np.asarray(points) * scales).astype(np.int64):
        for delta in (point - before).tolist():
            value = ~(delta << 1) if delta < 0 else delta << 1
            while value >= 0x20:
                text += chr((0x20 | (value & 0x1F)) + 63)
                value >>= 5
            text += chr(value + 63)
        before = point
    return text


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.floats(-90, 90), st.floats(-180, 180), st.floats(-400, 8000)), min_size=2, max_size=30
    )
)
def test_polylines_round_trip(points):
    flat = [p[:2] for p in points]
    np.testing.assert_allclose(decode_polyline(encode(flat, [1e6, 1e6]), "t", precision=1e6), flat, atol=1e-6)
    np.testing.assert_allclose(
        decode_polyline(encode(points, [1e5, 1e5, 100]), "t", dimensions=3), points, atol=0.006
    )


def test_encoded_responses_with_heights():
    points = [(48.1, 11.5, 500.0), (48.1, 11.5135, 504.0), (48.1, 11.527, 510.0)]
    response = json.loads((RESPONSES / "graphhopper.json").read_text())
    path = response["paths"][0]
    path |= {
        "points": encode(points, [1e5, 1e5, 100]),
        "points_encoded": True,
        "bbox": [11.5, 48.1, 500, 11.527, 48.1, 510],
    }
    assert read_response(json.dumps(response).encode()).elevation_at(
        [0, 1000, 2000]
    ).tolist() == pytest.approx([500, 504, 510])
    path["bbox"] = [11.5, 48.1, 11.527, 48.1]  # newer versions: no heights in it
    assert read_response(json.dumps(response).encode()).elevation_at([1000]).tolist() == pytest.approx([504])
    flat = [(48.1 + 0.001 * k, 11.5 + 0.002 * k) for k in range(6)]
    length = float(haversine_m([p[0] for p in flat], [p[1] for p in flat]).sum())
    flat_path = {
        "points": encode(flat, [1e5, 1e5]),
        "points_encoded": True,
        "distance": length,
        "time": 90_000,
    }
    route = read_response(json.dumps({"paths": [flat_path]}).encode())
    assert route.elevation_m is None
    assert route.distance_m == pytest.approx(length)
    steps = [{"distance": 2000.0, "duration": 160.0, "way_points": [0, 2]}]
    ors = {
        "routes": [
            {
                "summary": {"distance": 2000, "duration": 160, "ascent": 10.0, "descent": 0.0},
                "geometry": encode(points, [1e5, 1e5, 100]),
                "segments": [{"distance": 2000, "duration": 160, "steps": steps}],
            }
        ]
    }
    assert read_response(json.dumps(ors).encode()).elevation_at([1000]).tolist() == pytest.approx(
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
    "high": gpx([(48.0, 11.0, 99999, None), (48.1, 11.0, 0, None)]),
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
        plan_from_route(parse_route(REFUSED[name]), speed_m_s=10.0)
    assert all(len(str(fault)) < 500 for fault in caught.value.faults)


def test_missing_and_too_large_files(tmp_path, monkeypatch):
    with pytest.raises(InvalidInput, match="cannot read"):
        parse_route(tmp_path / "none.gpx")
    monkeypatch.setattr("tripwatt.routes.documents.MOST_BYTES", 10)
    with pytest.raises(InvalidInput, match="too large"):
        parse_route(b"[" + b" " * 20)


def test_too_many_points(monkeypatch):
    monkeypatch.setattr("tripwatt.routes.xml_events.MOST_POINTS", 50)
    with pytest.raises(InvalidInput, match="too many points"):
        read_gpx(gpx(drive(SPEED)))


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


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
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
        trip = plan_from_route(route, speed_m_s=10.0)
    except InvalidInput:
        return
    assert isinstance(route, LinkRoute | Track)
    assert trip.distance_m > 0
    assert np.isfinite(trip.array("speed_m_s")).all()


@settings(max_examples=200, deadline=None)
@given(
    st.recursive(
        st.one_of(
            st.none(), st.booleans(), st.integers(-5, 5), st.floats(allow_nan=False), st.text(max_size=4)
        ),
        lambda inner: st.one_of(
            st.lists(inner, max_size=3),
            st.dictionaries(
                st.sampled_from(
                    [
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
                        "links",
                        "code",
                    ]
                ),
                inner,
                max_size=4,
            ),
        ),
        max_leaves=12,
    ),
    st.sampled_from([None, "osrm", "valhalla", "openrouteservice", "graphhopper"]),
)
def test_any_json_is_refused_or_a_route(document, router):
    text = json.dumps(document).encode()
    try:
        route = read_response(text, router) if router else parse_route(text)
    except InvalidInput:
        return
    assert len(route) > 0
