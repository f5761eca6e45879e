"""GPX, KML and GeoJSON texts as tracks."""

import copy
import datetime as dt
import json

import numpy as np
import pytest
from tests.routes.made import NO, SPEED, drive, faults_of, gpx
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.routes import Track, parse_route, track_files
from tripwatt.routes.track_files import ROAD_SPEED_M_S
from tripwatt.trips import Flag


def test_a_logged_drive_comes_back_from_gpx():
    track = parse_route(gpx(drive(SPEED, np.linspace(500.0, 530.0, len(SPEED)))))
    trip = track.plan()
    assert track.is_log
    assert trip.departure.departs_at.hour == 8
    assert trip.distance_m == pytest.approx(float(np.trapezoid(SPEED)), rel=0.01)
    assert np.abs(trip.array("speed_m_s") - SPEED).max() < 1.0
    assert np.all(trip.array("speed_m_s")[138:146] == 0.0)
    assert trip.array("elevation_m")[[0, -1]].tolist() == pytest.approx([500.0, 530.0], abs=0.1)


def gpx_text(first, last='<rtept lat="2" lon="1"/>'):
    return f"<gpx><rte>{first}{last}</rte></gpx>".encode()


def test_numbers_of_gpx_are_cut_in_messages():
    (fault,) = faults_of(parse_route, gpx_text(f'<rtept lat="{"x" * 50}" lon="1"/>'))
    assert (fault.where, fault.got) == ("route, point 1, lat", repr("x" * 40))
    assert faults_of(parse_route, gpx_text('<rtept lat="inf" lon="1"/>'))[0].got == "'inf'"
    (fault,) = faults_of(parse_route, gpx_text('<rtept lat="1"/>'), where="mine")
    assert (fault.where, fault.got) == ("mine, point 1, lon", "''")
    (fault,) = faults_of(parse_route, gpx_text('<rtept lat="1" lon="1"><ele>high</ele></rtept>'))
    assert (fault.where, fault.got) == ("route, point 1, ele", "'high'")


def test_an_element_belongs_to_the_point_around_it():
    """Heights and times of extensions, of tracks and of other points are others."""
    inside = "<ele> 7 </ele><x><ele>8</ele><time>never</time></x>"
    found = parse_route(gpx_text(f'<ele>9</ele><rtept lat="1" lon="1">{inside}</rtept><time>never</time>'))
    np.testing.assert_array_equal(found.elevation_m, [7.0, NO])
    assert found.time_s is None


def xml(inside: str) -> bytes:
    return f'<gpx version="1.1">{inside}</gpx>'.encode()


def points(tag: str, *places: tuple[float, float], more: str = "") -> str:
    return "".join(f'<{tag} lat="{a}" lon="{b}">{more}</{tag}>' for a, b in places)


def test_the_first_track_of_two_points_before_any_route() -> None:
    route = f"<rte>{points('rtept', (10, 1), (11, 2))}</rte>"
    alone = f"<trk><trkseg>{points('trkpt', (20, 1))}</trkseg></trk>"
    two = f"<trk><trkseg>{points('trkpt', (30, 1))}</trkseg><trkseg>{points('trkpt', (31, 2))}</trkseg></trk>"
    found = parse_route(xml(route + alone + two))
    assert found.latitude_deg.tolist() == [30.0, 31.0]
    assert found.longitude_deg.tolist() == [1.0, 2.0]
    assert np.isnan(found.piece_speed_m_s).tolist() == [True]
    (flag,) = found.flags
    assert flag.value == 2
    assert parse_route(xml(route)).flags == ()
    nested = f"<trk>{points('trkpt', (1, 1), (2, 2))}<trk/></trk>"
    assert parse_route(xml(nested)).flags == ()
    assert parse_route(xml(route + alone)).latitude_deg.tolist() == [10.0, 11.0]


def test_points_outside_of_tracks_do_not_count() -> None:
    strange = f"<other><trk>{points('trkpt', (7, 1), (8, 2))}</trk></other>"
    found = parse_route(xml(f"{strange}<rte>{points('rtept', (1, 1), (2, 2))}</rte>"))
    assert found.latitude_deg.tolist() == [1.0, 2.0]
    refuses("a trk or rte of two points", parse_route, xml(strange))


def test_depth() -> None:
    """64 levels with <gpx>."""
    route = f"<rte>{points('rtept', (1, 1), (2, 2))}</rte>"
    assert len(parse_route(xml("<a><b/></a>" * 70 + route))) == 2
    assert len(parse_route(xml("<a>" * 63 + "</a>" * 63 + route))) == 2
    refuses("got 65 levels; allowed: at most 64", parse_route, xml("<a>" * 64 + "</a>" * 64 + route))


def test_number_of_points(monkeypatch) -> None:
    monkeypatch.setattr(track_files, "MAX_POINTS", 2)
    assert len(parse_route(xml(f"<rte>{points('rtept', (1, 1), (2, 2))}</rte>"))) == 2
    refuses("more than 2", parse_route, xml(f"<rte>{points('rtept', (1, 1), (2, 2), (3, 3))}</rte>"))
    assert faults_of(parse_route, kml(line("1,2 1,3 1,4")))[0].got == "more than 2"


@pytest.mark.parametrize("void", ["NaN", "nan", "-32768", "-9999", "32767", ""])
def test_a_height_of_no_place_is_not_known(void: str) -> None:
    ends = (
        '<trkpt lat="48" lon="11"><ele>520</ele></trkpt>{}<trkpt lat="48.2" lon="11"><ele>540</ele></trkpt>'
    )
    middle = f'<trkpt lat="48.1" lon="11"><ele>{void}</ele></trkpt>'
    track = parse_route(f"<gpx><trk><trkseg>{ends.format(middle)}</trkseg></trk></gpx>".encode())
    assert track.elevation()[1].tolist() == [520.0, 540.0]
    assert [flag.code for flag in track.elevation()[2]] == ["elevation_interpolated"]


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
    track = parse_route(kml(line("\n  11.50,48.10,500\n  11.52,48.10,510  11.52,48.11,520 ")))
    assert track.latitude_deg.tolist() == [48.10, 48.10, 48.11]
    assert track.longitude_deg.tolist() == [11.50, 11.52, 11.52]
    assert track.elevation_m.tolist() == [500.0, 510.0, 520.0]
    assert (track.time_s, track.started_at, track.flags) == (None, None, ())
    assert np.isnan(track.piece_speed_m_s).tolist() == [True, True]
    assert track.needs_speed


def test_altitudes_that_are_missing_or_all_zero_are_no_elevation():
    for text in ("11.5,48.1 11.5,48.2", "11.5,48.1,0 11.5,48.2,-0"):
        assert np.isnan(parse_route(kml(line(text))).elevation_m).all()
    assert parse_route(kml(line("1,2,0 1,3,-0.5"))).elevation_m.tolist() == [0.0, -0.5]
    some = parse_route(kml(line("11.5,48.1,0 11.5,48.2,3")))
    assert some.elevation_m.tolist() == [0.0, 3.0]
    half = parse_route(kml(line("11.5,48.1 11.5,48.2,3")))
    assert np.isnan(half.elevation_m).tolist() == [True, False]


def test_a_recording_has_times_and_comes_before_lines():
    rows = [
        ("2026-05-01T08:00:00Z", 11.5, 48.0, 500),
        ("2026-05-01T08:00:30Z", 11.5, 48.003, 501),
        ("2026-05-01T08:01:00Z", 11.5, 48.006, 502),
    ]
    track = parse_route(kml(line("1,2 3,4"), recording(rows)))
    assert track.time_s.tolist() == [0.0, 30.0, 60.0]
    assert track.started_at == dt.datetime(2026, 5, 1, 8, tzinfo=dt.UTC)
    assert track.latitude_deg.tolist() == [48.0, 48.003, 48.006]
    assert [(flag.code, flag.subject, flag.value) for flag in track.flags] == [
        ("first_of_several", "tracks and routes", 2)
    ]
    assert not track.needs_speed
    # 0.006 degrees of latitude are 667.2 m, in a minute 11.1 m/s
    assert track.plan().duration_s == pytest.approx(60.0, abs=3.0)


def test_the_format_is_recognised_by_the_root():
    bare = kml(line("11.5,48.1 11.5,48.2"), head="<kml>")
    assert len(parse_route(bare).latitude_deg) == 2
    wide = kml(line("11.5,48.1 11.5,48.2")).decode().replace("UTF-8", "UTF-16").encode("utf-16")
    assert len(parse_route(wide).latitude_deg) == 2
    prefixed = bare.replace(b"<kml>", b'<k:kml xmlns:k="x">').replace(b"</kml>", b"</k:kml>")
    assert len(parse_route(prefixed).latitude_deg) == 2
    (fault,) = faults_of(parse_route, b"<html/>")
    assert (fault.what, fault.got, fault.allowed) == ("not GPX/KML", "<html>", "<gpx>, <kml>")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (b'<!DOCTYPE kml [<!ENTITY a "1">]><kml/>', "document type"),
        (b"<gpx/>", "no track in the file"),
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
        parse_route(text)


def test_a_packed_file_is_named(tmp_path):
    path = tmp_path / "tour.kmz"
    path.write_bytes(b"PK\x03\x04" + bytes(60))
    refuses("unpack it", parse_route, path)


@pytest.mark.parametrize("text", ["1", "1,2,3,4", "1,,3", "1;2", "a,b", "x" * 70])
def test_a_point_of_kml_has_two_or_three_numbers(text):
    (fault,) = faults_of(parse_route, kml(line(f"1,2 {text}")))
    assert (fault.where, fault.got) == ("route, point 2", repr(text[:60]))
    assert len(parse_route(kml(line("1,2 1,3,4")))) == 2


def test_points_belong_to_the_line_and_the_recording_around_them():
    line = "<LineString><coordinates>{}</coordinates></LineString>"
    found = parse_route(f"\n<kml> {line.format('1,1')} {line.format('1,2 1,3')} </kml>\n".encode())
    assert found.latitude_deg.tolist() == [2.0, 3.0]
    parts = line.format("1,2</coordinates><coordinates>1,3 1,4")
    assert parse_route(f"<kml>{parts}</kml>".encode()).latitude_deg.tolist() == [2.0, 3.0, 4.0]
    stamps = "<when>2026-05-01T08:00:00Z</when><when>2026-05-01T08:00:07Z</when>"
    short = "<Track><when>never</when><coord>1 1</coord></Track>"
    track = f"<Track>{stamps}<coord>1 2</coord><coord>1 3</coord></Track>"
    found = parse_route(f"<kml>{short}{track}</kml>".encode())
    assert (found.latitude_deg.tolist(), found.time_s.tolist()) == ([2.0, 3.0], [0.0, 7.0])


def test_coordinates_of_other_shapes_are_left_out():
    lines = "<LineString><coordinates>1,2 1,3</coordinates></LineString>"
    ring = "<Polygon><outerBoundaryIs><LinearRing><coordinates>1,1 2,2</coordinates></LinearRing></outerBoundaryIs></Polygon>"
    loose = "<coord>8 8</coord><when>never</when>"
    found = parse_route(f"<kml>{ring}{loose}{lines}{lines.replace('1,3', '1,4')}</kml>".encode())
    assert found.latitude_deg.tolist() == [2.0, 3.0]
    assert [(flag.code, flag.value) for flag in found.flags] == [("first_of_several", 2.0)]


def test_a_recording_has_a_time_for_each_point():
    when = "".join(f"<when>2026-05-01T08:00:0{k}Z</when>" for k in range(3))
    where = "".join(f"<coord>1 {k}</coord>" for k in range(3))
    track = f"<kml><Track>{when}{where}</Track></kml>"
    assert parse_route(track.encode()).time_s.tolist() == [0.0, 1.0, 2.0]
    assert parse_route(f"<kml><Track>{where}</Track></kml>".encode()).time_s is None
    (fault,) = faults_of(parse_route, track.replace("<coord>1 0</coord>", "").encode())
    assert fault.got == "3 times, 2 points"


def test_the_root_of_another_format_is_cut():
    (fault,) = faults_of(parse_route, b"<" + b"x" * 50 + b"/>")
    assert (fault.what, fault.got, fault.allowed) == (
        "not GPX/KML",
        f"<{'x' * 40}>",
        "<gpx>, <kml>",
    )
    (fault,) = faults_of(parse_route, b'<?xml version="1.0" encoding="' + b"e" * 200 + b'"?><gpx/>')
    assert fault.what == "not well-formed XML"
    assert len(fault.got) <= 120


def kml_line(*coordinates):
    return f"<LineString><coordinates>{' '.join(coordinates)}</coordinates></LineString>"


def test_the_parts_of_a_multi_geometry_are_one_line():
    """As the segments of a GPX track are; lines beside it are others."""
    parts = kml_line("11,48", "11,48.1") + kml_line("11,48.1", "11,48.2")
    (other,) = (kml_line("12,48", "12,49"),)
    joined = parse_route(f"<kml><MultiGeometry>{parts}</MultiGeometry>{other}</kml>".encode())
    assert joined.latitude_deg.tolist() == [48.0, 48.1, 48.1, 48.2]
    assert [flag.code for flag in joined.flags] == ["first_of_several"]
    two = parse_route(f"<kml>{parts}</kml>".encode())
    assert two.latitude_deg.tolist() == [48.0, 48.1]
    again = parse_route(
        f"<kml><MultiGeometry>{other}</MultiGeometry><MultiGeometry>{parts}</MultiGeometry></kml>".encode()
    )
    assert again.longitude_deg.tolist() == [12.0, 12.0]


def test_the_parts_of_a_multi_track_are_one_recording():
    def part(*seconds):
        points = "".join(
            f"<when>2026-05-01T08:00:{s:02d}Z</when><gx:coord>11 {48 + s / 1e4} 0</gx:coord>" for s in seconds
        )
        return f"<gx:Track>{points}</gx:Track>"

    text = f"<kml><gx:MultiTrack>{part(0, 1, 2)}{part(4, 5)}</gx:MultiTrack></kml>"
    track = parse_route(text.encode())
    assert track.time_s.tolist() == [0.0, 1.0, 2.0, 4.0, 5.0]
    assert track.flags == ()


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
    track = parse_route(text)
    route = track.links()
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
        parse_route(json.dumps(line).encode()).plan().array("speed_m_s"),
        parse_route(gpx(drive(SPEED))).plan().array("speed_m_s"),
        atol=1e-3,
    )


def feature(properties, positions=((1.0, 2.0), (1.0, 3.0))):
    geometry = {"type": "LineString", "coordinates": positions}
    return json.dumps({"type": "Feature", "geometry": geometry, "properties": properties}).encode()


def test_the_points_of_all_lines_are_counted(monkeypatch):
    """And places east of 90 degrees are on earth."""
    monkeypatch.setattr("tripwatt.routes.points.MAX_POINTS", 4)
    for number, refused in ((2, False), (3, True)):
        collection = [json.loads(feature(None, ((150.0, 2.0), (-150.0, k)))) for k in range(number)]
        text = json.dumps({"type": "FeatureCollection", "features": collection}).encode()
        if refused:
            (fault,) = faults_of(parse_route, text)
            assert (fault.what, fault.where, fault.got) == ("too many points", "track", "6")
        else:
            assert len(parse_route(text)) == 4


EXACT = {"rel": 1e-9, "abs": 1e-9}


def geojson(kind: str, coordinates, **properties) -> dict:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def collected(*features) -> bytes:
    return json.dumps({"type": "FeatureCollection", "features": list(features)}).encode()


LINE = [[11.0, 48.0], [11.1, 48.1, 530.0]]


class TestGeojson:
    def test_the_piece_between_two_lines_has_the_speed_of_the_second(self) -> None:
        other = [[11.2, 48.2], [11.3, 48.3]]
        made = parse_route(
            collected(
                geojson("LineString", LINE, speed_m_s=10),
                geojson("LineString", other, highway="motorway"),
                geojson("LineString", [[11.4, 48.4], [11.4, 48.5]], highway="unheard of"),
                geojson("LineString", [[11.5, 48.5], [11.5, 48.6]], highway=7),
                geojson("LineString", [[11.6, 48.6], [11.6, 48.7]], speed_m_s=5, highway="motorway"),
            )
        )
        assert made.piece_speed_m_s == pytest.approx(
            [10.0, 25.0, 25.0, NO, NO, NO, NO, 5.0, 5.0], nan_ok=True, **EXACT
        )

    def test_what_is_no_line_is_counted(self) -> None:
        found = parse_route(
            collected(
                geojson("Point", [11.0, 48.0]),
                {"type": "Feature", "geometry": None, "properties": None},
                geojson("MultiLineString", [LINE, [[11.2, 48.2], [11.3, 48.3]]]),
                {"type": "GeometryCollection", "geometries": [{"type": "Polygon", "coordinates": []}]},
            )
        )
        assert len(found) == 4
        assert found.flags == (Flag("geometries_skipped", "geometries", 2.0, "1"),)
        assert parse_route(collected(geojson("LineString", LINE))).flags == ()
        refuses("no line", parse_route, collected(geojson("Point", [11.0, 48.0])))

    def test_times(self) -> None:
        stamps = [f"2026-05-01T08:00:0{k}Z" for k in range(4)]
        lines = [LINE, [[11.2, 48.2], [11.3, 48.3]]]
        flat = parse_route(collected(geojson("MultiLineString", lines, coordTimes=stamps)))
        nested = geojson("MultiLineString", lines, coordinateProperties={"times": [stamps[:2], stamps[2:]]})
        for found in (flat, parse_route(collected(nested))):
            assert found.time_s.tolist() == [0.0, 1.0, 2.0, 3.0]
        gap = parse_route(
            collected(geojson("MultiLineString", lines, coordTimes=[stamps[0], None, *stamps[2:]]))
        )
        assert gap.time_s.tolist() == [0.0, 1.0, 2.0, 3.0]
        assert [f.code for f in gap.flags] == ["times_interpolated"]
        for wrong, said in ((stamps[:2], "got 2 times; allowed: 4"), ([*stamps[:3], 5], "invalid time")):
            with pytest.raises(InvalidInput, match=said):
                parse_route(collected(geojson("MultiLineString", lines, coordTimes=wrong)))
        plain = parse_route(collected(geojson("LineString", LINE, coordinateProperties=3)))
        assert plain.time_s is None

    @pytest.mark.parametrize(("speed", "allowed"), [(70.0, True), (70.1, False), (0.0, False), (0.1, True)])
    def test_bounds_of_a_speed(self, speed: float, allowed: bool) -> None:
        text = collected(geojson("LineString", LINE, speed_m_s=speed))
        if allowed:
            assert parse_route(text).piece_speed_m_s.tolist() == [speed]
        else:
            refuses("speed out of range", parse_route, text)

    def test_depth(self) -> None:
        """The 64th collection may hold a line, the 65th not."""
        node: dict = {"type": "LineString", "coordinates": LINE}
        for _ in range(64):
            node = {"type": "GeometryCollection", "geometries": [node]}
        assert len(parse_route(json.dumps(node).encode())) == 2
        with pytest.raises(InvalidInput, match="got 65 levels; allowed: at most 64"):
            parse_route(json.dumps({"type": "GeometryCollection", "geometries": [node]}).encode())
        feature: dict = {"type": "Feature", "geometry": node, "properties": {}}
        refuses("got 65 levels", parse_route, json.dumps(feature).encode())

    def test_types(self) -> None:
        refuses("type: got 'Topology'", parse_route, b'{"type": "Topology"}')
