"""KML texts as tracks."""

import datetime as dt

import numpy as np
import pytest
from tests.routes.made import faults_of

from tripwatt.errors import InvalidInput
from tripwatt.routes import parse_route, read_kml, xml_events
from tripwatt.routes.xml_events import root_name

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">'


def kml(*parts, head=HEAD):
    """A KML text of parts in folders, as programs nest them."""
    marks = "".join(f"<Placemark><name>a, b</name>{part}</Placemark>" for part in parts)
    return f"{head}<Document><Folder>{marks}</Folder></Document></kml>".encode()


def line(text):
    return f"<LineString><tessellate>1</tessellate><coordinates>{text}</coordinates></LineString>"


def recording(rows, more=""):
    """A `gx:Track` of (time, longitude, latitude, altitude)."""
    when = "".join(f"<when>{row[0]}</when>" for row in rows)
    places = "".join(f"<gx:coord>{lon} {lat} {height}</gx:coord>" for _, lon, lat, height in rows)
    return f"<gx:Track>{when}{more}{places}</gx:Track>"


def test_a_line_is_a_track_without_times():
    track = read_kml(kml(line("\n  11.50,48.10,500\n  11.52,48.10,510  11.52,48.11,520 ")))
    assert track.latitude_deg.tolist() == [48.10, 48.10, 48.11]
    assert track.longitude_deg.tolist() == [11.50, 11.52, 11.52]
    assert track.elevation_m.tolist() == [500.0, 510.0, 520.0]
    assert (track.time_s, track.started_at, track.flags) == (None, None, ())
    assert np.isnan(track.piece_speed_m_s).tolist() == [True, True]
    assert track.needs_speed


@pytest.mark.parametrize("text", ["11.5,48.1 11.5,48.2", "11.5,48.1,0 11.5,48.2,0"])
def test_altitudes_that_are_missing_or_all_zero_are_no_elevation(text):
    assert np.isnan(read_kml(kml(line(text))).elevation_m).all()
    some = read_kml(kml(line("11.5,48.1,0 11.5,48.2,3")))
    assert some.elevation_m.tolist() == [0.0, 3.0]
    half = read_kml(kml(line("11.5,48.1 11.5,48.2,3")))
    assert np.isnan(half.elevation_m).tolist() == [True, False]


def test_a_recording_has_times_and_comes_before_lines():
    rows = [
        ("2026-05-01T08:00:00Z", 11.5, 48.0, 500),
        ("2026-05-01T08:00:30Z", 11.5, 48.003, 501),
        ("2026-05-01T08:01:00Z", 11.5, 48.006, 502),
    ]
    track = read_kml(kml(line("1,2 3,4"), recording(rows)))
    assert track.time_s.tolist() == [0.0, 30.0, 60.0]
    assert track.started_at == dt.datetime(2026, 5, 1, 8, tzinfo=dt.UTC)
    assert track.latitude_deg.tolist() == [48.0, 48.003, 48.006]
    assert [(flag.code, flag.subject, flag.value) for flag in track.flags] == [
        ("first_of_several", "tracks and routes", 2)
    ]
    assert not track.needs_speed
    # 0.006 degrees of latitude are 667.2 m, in a minute 11.1 m/s
    assert track.plan().duration_s == pytest.approx(60.0, abs=3.0)


def test_points_of_interest_and_lines_of_one_point_are_left_out():
    text = kml("<Point><coordinates>9,47</coordinates></Point>", line("1,1"), line("11.5,48.1 11.5,48.2"))
    track = parse_route(text)
    assert (len(track.latitude_deg), track.flags) == (2, ())


def test_the_format_is_recognised_by_the_root():
    bare = kml(line("11.5,48.1 11.5,48.2"), head="<kml>")
    assert len(parse_route(bare).latitude_deg) == 2
    wide = kml(line("11.5,48.1 11.5,48.2")).decode().replace("UTF-8", "UTF-16").encode("utf-16")
    assert len(parse_route(wide).latitude_deg) == 2
    prefixed = bare.replace(b"<kml>", b'<k:kml xmlns:k="x">').replace(b"</kml>", b"</k:kml>")
    assert len(parse_route(prefixed).latitude_deg) == 2
    assert [root_name(text) for text in (b"<gpx/>", b"<!-- kml --><gpx>", b"", b"text", b"<")] == [
        "gpx",
        "gpx",
        "",
        "",
        "",
    ]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (b'<!DOCTYPE kml [<!ENTITY a "1">]><kml/>', "document type"),
        (b"<gpx/>", "not KML"),
        (b"<kml/>", "no track in the file"),
        (kml(line("11.5,48.1")), "got 1 points"),
        (kml(line("11.5,48.1 11.5"))[:-4], "not coordinates: route, point 2"),
        (kml(line("11.5,48.1 11.5,48.2"))[:-4], "not well-formed"),
        (kml(line("11.5,48.1 nan,48")), "not coordinates"),
        (kml(line("11.5,48.1 11.5,91")), "latitude"),
        (kml(recording([("yesterday", 1, 2, 3), ("2026-05-01T08:00:00Z", 1, 3, 3)])), "invalid time"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_said(text, what):
    with pytest.raises(InvalidInput, match=what):
        read_kml(text)


def test_a_packed_file_is_named(tmp_path):
    path = tmp_path / "tour.kmz"
    path.write_bytes(b"PK\x03\x04" + bytes(60))
    with pytest.raises(InvalidInput, match="unpack it"):
        parse_route(path)


def kml_text(text, tag="LineString"):
    return f"<kml><{tag}><coordinates>{text}</coordinates></{tag}></kml>".encode()


@pytest.mark.parametrize("text", ["1", "1,2,3,4", "1,,3", "1;2", "a,b"])
def test_a_point_of_kml_has_two_or_three_numbers(text):
    (fault,) = faults_of(read_kml, kml_text(f"1,2 {text}"))
    assert (fault.where, fault.got) == ("route, point 2", repr(text))
    assert len(read_kml(kml_text("1,2 1,3,4"))) == 2


def test_points_of_kml_are_cut_in_messages():
    (fault,) = faults_of(read_kml, kml_text("x" * 70 + " 1,2"))
    assert (fault.where, fault.got) == ("route, point 1", repr("x" * 60))


def test_a_little_height_is_a_height():
    assert read_kml(kml_text("1,2,0 1,3,0.5")).elevation_m.tolist() == [0.0, 0.5]
    assert read_kml(kml_text("1,2,0 1,3,-0.5")).elevation_m.tolist() == [0.0, -0.5]
    assert np.isnan(read_kml(kml_text("1,2,0 1,3,-0")).elevation_m).all()


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


def test_the_most_points_of_kml(monkeypatch):
    monkeypatch.setattr(xml_events, "MAX_POINTS", 2)
    assert len(read_kml(kml_text("1,2 1,3"))) == 2
    assert faults_of(read_kml, kml_text("1,2 1,3 1,4"))[0].got == "more than 2"
