"""GPX, KML, GeoJSON and XML texts: how much of them is read, and what messages quote, each bound from both sides."""

import json
import math

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes import points, read_geojson, read_gpx, read_kml, xml_events
from tripwatt.routes.documents import Node, parse_json
from tripwatt.routes.xml_events import root_of

NO = math.nan


def faults_of(read, *args, **more):
    with pytest.raises(InvalidInput) as caught:
        read(*args, **more)
    return caught.value.faults


def coordinates(value, where):
    return Node(value, where).coordinates()


def numbers(value, where, **more):
    return Node(value, where).numbers(**more)


def a_number(value, where, **more):
    return Node(value, where).number(**more)


# GPX


def gpx(first, last='<rtept lat="2" lon="1"/>'):
    return f"<gpx><rte>{first}{last}</rte></gpx>".encode()


def test_a_hundred_characters_of_an_element_are_read():
    """The parser hands over what it has when a piece of more than 8192 characters follows."""
    for zeros, height in ((98, 5.0), (99, 0.0)):
        inside = "0" * zeros + "&#48;" + "5" + " " * 9000
        assert read_gpx(gpx(f'<rtept lat="1" lon="1"><ele>{inside}</ele></rtept>')).elevation_m[0] == height


def test_numbers_of_gpx_are_cut_in_messages():
    (fault,) = faults_of(read_gpx, gpx(f'<rtept lat="{"x" * 50}" lon="1"/>'))
    assert (fault.where, fault.got) == ("route, point 1, lat", repr("x" * 40))
    (fault,) = faults_of(read_gpx, gpx('<rtept lat="1"/>'), where="mine")
    assert (fault.where, fault.got) == ("mine, point 1, lon", "''")
    (fault,) = faults_of(read_gpx, gpx('<rtept lat="1" lon="1"><ele>high</ele></rtept>'))
    assert (fault.where, fault.got) == ("route, point 1, ele", "'high'")


def test_an_element_belongs_to_the_point_around_it():
    """Heights and times of extensions, of tracks and of other points are others."""
    inside = "<ele> 7 </ele><x><ele>8</ele><time>never</time></x>"
    found = read_gpx(gpx(f'<ele>9</ele><rtept lat="1" lon="1">{inside}</rtept><time>never</time>'))
    np.testing.assert_array_equal(found.elevation_m, [7.0, NO])
    assert found.time_s is None


def test_a_point_without_a_route_around_it_is_left_out():
    found = read_gpx(b'<gpx><rtept lat="9" lon="1"/>' + gpx('<rtept lat="1" lon="1"/>')[5:])
    assert found.latitude_deg.tolist() == [1.0, 2.0]


def test_points_of_the_first_track_alone_are_counted_with_the_others():
    two = '<trkpt lat="1" lon="1"/><trkpt lat="2" lon="1"/>'
    tracks = f"<trk>{two}</trk><trk><trkseg>{two}</trkseg></trk><rte>{two.replace('trkpt', 'rtept')}</rte>"
    found = read_gpx(f"<gpx>{tracks}</gpx>".encode())
    assert [(flag.code, flag.value) for flag in found.flags] == [("first_of_several", 3.0)]
    nested = f"<gpx><trk>{two}<trk/></trk></gpx>"
    assert read_gpx(nested.encode()).flags == ()


# KML


def kml(text, tag="LineString"):
    return f"<kml><{tag}><coordinates>{text}</coordinates></{tag}></kml>".encode()


@pytest.mark.parametrize("text", ["1", "1,2,3,4", "1,,3", "1;2"])
def test_a_point_of_kml_has_two_or_three_numbers(text):
    (fault,) = faults_of(read_kml, kml(f"1,2 {text}"))
    assert (fault.where, fault.got) == ("route, point 2", repr(text))
    assert len(read_kml(kml("1,2 1,3,4"))) == 2


def test_points_of_kml_are_cut_in_messages():
    (fault,) = faults_of(read_kml, kml("x" * 70 + " 1,2"))
    assert (fault.where, fault.got) == ("route, point 1", repr("x" * 60))


def test_the_most_points_of_kml(monkeypatch):
    monkeypatch.setattr(xml_events, "MOST_POINTS", 2)
    assert len(read_kml(kml("1,2 1,3"))) == 2
    assert faults_of(read_kml, kml("1,2 1,3 1,4"))[0].got == "more than 2"


def test_a_little_height_is_a_height():
    assert read_kml(kml("1,2,0 1,3,0.5")).elevation_m.tolist() == [0.0, 0.5]
    assert read_kml(kml("1,2,0 1,3,-0.5")).elevation_m.tolist() == [0.0, -0.5]
    assert np.isnan(read_kml(kml("1,2,0 1,3,-0")).elevation_m).all()


def test_points_belong_to_the_line_and_the_recording_around_them():
    line = "<LineString><coordinates>{}</coordinates></LineString>"
    found = read_kml(f"\n<kml> {line.format('1,1')} {line.format('1,2 1,3')} </kml>\n".encode())
    assert found.latitude_deg.tolist() == [2.0, 3.0]
    parts = line.format("1,2</coordinates><coordinates>1,3 1,4")
    assert read_kml(f"<kml>{parts}</kml>".encode()).latitude_deg.tolist() == [2.0, 3.0, 4.0]
    stamps = "<when>2026-05-01T08:00:00Z</when><when>2026-05-01T08:00:07Z</when>"
    short = "<Track><when>never</when><coord>1 1</coord></Track>"
    track = f"<Track>{stamps}<coord>1 2</coord><coord>1 3</coord></Track>"
    found = read_kml(f"<kml>{short}{track}</kml>".encode())
    assert (found.latitude_deg.tolist(), found.time_s.tolist()) == ([2.0, 3.0], [0.0, 7.0])


def test_coordinates_of_other_shapes_are_left_out():
    lines = "<LineString><coordinates>1,2 1,3</coordinates></LineString>"
    ring = "<Polygon><outerBoundaryIs><LinearRing><coordinates>1,1 2,2</coordinates></LinearRing></outerBoundaryIs></Polygon>"
    loose = "<coord>8 8</coord><when>never</when>"
    found = read_kml(f"<kml>{ring}{loose}{lines}{lines.replace('1,3', '1,4')}</kml>".encode())
    assert found.latitude_deg.tolist() == [2.0, 3.0]
    assert [(flag.code, flag.value) for flag in found.flags] == [("first_of_several", 2.0)]


def test_a_recording_has_a_time_for_each_point():
    when = "".join(f"<when>2026-05-01T08:00:0{k}Z</when>" for k in range(3))
    where = "".join(f"<coord>1 {k}</coord>" for k in range(3))
    track = f"<kml><Track>{when}{where}</Track></kml>"
    assert read_kml(track.encode()).time_s.tolist() == [0.0, 1.0, 2.0]
    assert read_kml(f"<kml><Track>{where}</Track></kml>".encode()).time_s is None
    (fault,) = faults_of(read_kml, track.replace("<coord>1 0</coord>", "").encode())
    assert fault.got == "3 times, 2 points"


# XML


def test_the_root_begins_within_its_first_bytes():
    assert xml_events.ROOT_BYTES == 65_536
    for spaces, root in ((65_536 - 5, "gpx"), (65_536 - 4, "")):
        assert root_of(b"<!--" + b" " * (spaces - 7) + b"-->" + b"<gpx>") == root
    assert root_of(b"<a:b:kml/>") == "kml"


def test_a_level_of_xml_ends_with_its_element():
    wide = b"<gpx>" + b"<a><b/></a>" * 70
    route = b'<rte><rtept lat="1" lon="1"/><rtept lat="2" lon="1"/></rte></gpx>'
    assert len(read_gpx(wide + route)) == 2


def test_the_root_of_another_format_is_cut():
    (fault,) = faults_of(read_kml, b"<" + b"x" * 50 + b"/>")
    assert (fault.what, fault.got, fault.allowed) == ("not KML", f"<{'x' * 40}>", "<kml>")
    (fault,) = faults_of(read_gpx, b'<?xml version="1.0" encoding="' + b"e" * 200 + b'"?><gpx/>')
    assert fault.what == "not well-formed XML"
    assert len(fault.got) <= 120


# GeoJSON


def feature(properties, positions=((1.0, 2.0), (1.0, 3.0))):
    geometry = {"type": "LineString", "coordinates": positions}
    return json.dumps({"type": "Feature", "geometry": geometry, "properties": properties}).encode()


def test_properties_of_a_line():
    assert read_geojson(feature({"speed_m_s": 0.5})).piece_speed_m_s.tolist() == [0.5]
    assert read_geojson(feature({"speed_m_s": None, "highway": "service"})).piece_speed_m_s == pytest.approx(
        [15.0 / 3.6]
    )
    assert np.isnan(read_geojson(feature(None)).piece_speed_m_s).all()
    (fault,) = faults_of(read_geojson, feature([1]))
    assert (fault.what, fault.got) == ("not an object", "a list of 1")


def test_times_of_a_line():
    stamps = ["2026-05-01T08:00:00Z", "2026-05-01T08:00:09Z"]
    both = {"coordTimes": stamps, "coordinateProperties": {"times": ["x"]}}
    assert read_geojson(feature(both)).time_s.tolist() == [0.0, 9.0]
    (fault,) = faults_of(read_geojson, feature({"coordTimes": [stamps[0], ["a" * 90, 5]]}))
    assert fault.what == "times and points differ in number"
    (fault,) = faults_of(read_geojson, feature({"coordTimes": [stamps[0], {"a" * 90: 1}]}))
    assert fault.got == "{'" + "a" * 38
    assert read_geojson(feature({"coordTimes": None})).time_s is None


def test_the_points_of_all_lines_are_counted(monkeypatch):
    """And places east of 90 degrees are on earth."""
    monkeypatch.setattr(points, "MOST_POINTS", 4)
    for number, refused in ((2, False), (3, True)):
        collection = [json.loads(feature(None, ((150.0, 2.0), (-150.0, k)))) for k in range(number)]
        text = json.dumps({"type": "FeatureCollection", "features": collection}).encode()
        if refused:
            (fault,) = faults_of(read_geojson, text)
            assert (fault.what, fault.where, fault.got) == ("too many points", "route", "6")
        else:
            assert len(read_geojson(text)) == 4


def test_lines_keep_their_own_times():
    lines = [[[1.0, 2.0], [1.0, 2.1], [1.0, 2.2]], [[1.0, 2.3], [1.0, 2.4]]]
    times = [f"2026-05-01T08:00:{k:02d}Z" for k in (0, 1, 3, 6, 10)]
    geometry = {"type": "MultiLineString", "coordinates": lines}
    text = {"type": "Feature", "geometry": geometry, "properties": {"coordTimes": times}}
    assert read_geojson(json.dumps(text).encode()).time_s.tolist() == [0.0, 1.0, 3.0, 6.0, 10.0]


# JSON


def test_positions_have_a_height_or_more():
    found = coordinates([[1, 2, 3, 4], [1, 2]], "t")
    np.testing.assert_array_equal(found, [[2.0, 1.0, 3.0], [2.0, 1.0, NO]])
    for wrong, where in (([[1, 2], [1, "x"]], "t[1][1]"), ([[1, 2], [1, 2, "x"]], "t[1][2]")):
        assert faults_of(coordinates, wrong, "t")[0].where == where


def test_the_most_positions(monkeypatch):
    monkeypatch.setattr(points, "MOST_POINTS", 2)
    assert len(coordinates([[1, 2]] * 2, "t")) == 2
    assert faults_of(coordinates, [[1, 2]] * 3, "t")[0].what == "too many points"
    assert points.require_on_earth(np.zeros(2), np.zeros(2), "t") is None
    assert faults_of(points.require_on_earth, np.zeros(3), np.zeros(3), "t")[0].got == "3"


def test_lists_of_numbers():
    assert numbers([1, 2.5], "t", least=1.0).tolist() == [1.0, 2.5]
    assert faults_of(numbers, [1, 0.9], "t", least=1.0)[0].where == "t[1]"
    assert a_number(-5, "t") == -5.0
    assert faults_of(a_number, NO, "t")[0].allowed == "a finite number"
    assert faults_of(a_number, -(10**19), "t", least=0)[0].got == "a number without end"
    assert faults_of(a_number, "x", "t", least=0)[0].allowed == "a finite number, 0 or more"
    assert faults_of(Node([1, 2, 3], "t").members)[0].got == "a list of 3"
    assert faults_of(Node({"a": 1, "b": 2}, "t").entries)[0].got == "an object of 2"
    assert faults_of(Node(True, "t").entries)[0].got == "True"


def test_what_is_no_json_is_cut_in_messages():
    (fault,) = faults_of(parse_json, b"[" * 100_000, "t")
    assert fault.got == "nested too deeply"
    (fault,) = faults_of(parse_json, b"NaN", "t")
    assert fault.got == "NaN is no JSON number"
    assert len(faults_of(parse_json, b"\xff" * 9, "t")[0].got) <= 120
    assert parse_json(b"[1e3]", "t") == [1000.0]
