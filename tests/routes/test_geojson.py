"""GeoJSON texts as tracks."""

import copy
import json

import numpy as np
import pytest
from tests.routes.made import NO, SPEED, drive, faults_of, gpx
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.routes import Track, parse_route, points
from tripwatt.routes.geojson import ROAD_SPEED_M_S
from tripwatt.trips import Flag


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
    monkeypatch.setattr(points, "MAX_POINTS", 4)
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
