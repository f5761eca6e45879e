"""Tracks, and the texts that they come from, against distances and times that are worked out by hand."""

import datetime as dt
import json
import math

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.routes import link_objects, link_table, read_geojson, read_gpx, xml_events
from tripwatt.routes.geojson import ROAD_SPEED_M_S
from tripwatt.routes.link_table import is_links_table, route_from_table
from tripwatt.routes.links import LinkRoute
from tripwatt.routes.tracks import Track, needs_speed, plan_from_track, route_from_track, times_of
from tripwatt.trips import Flag

NO = math.nan
EXACT = {"rel": 1e-9, "abs": 1e-9}
DEGREE_M = 6_371_008.8 * math.pi / 180.0
"""A degree of latitude on the sphere of mean radius."""


def track(metres, time=None, height=None, speed=None, **more) -> Track:
    """Points along a meridian at some distances from the first."""
    metres = np.asarray(metres, dtype=float)
    n = len(metres)
    return Track(
        metres / DEGREE_M,
        np.full(n, 11.0),
        np.full(n, NO) if height is None else np.asarray(height, dtype=float),
        None if time is None else np.asarray(time, dtype=float),
        np.full(n - 1, NO) if speed is None else np.asarray(speed, dtype=float),
        **more,
    )


def refused(*args, **more) -> list[str]:
    with pytest.raises(InvalidInput) as caught:
        track(*args, **more)
    return [str(fault) for fault in caught.value.faults]


class TestTrack:
    def test_distances(self) -> None:
        made = track([0.0, 300.0, 700.0])
        assert made.step_m == pytest.approx([300.0, 400.0], rel=1e-6)
        assert made.position_m == pytest.approx([0.0, 300.0, 700.0], rel=1e-6)
        assert len(made) == 3

    def test_bounds(self) -> None:
        assert len(track([0.0, 9.0], [0.0, 172_800.0])) == 2
        assert (
            "got 172801 s; allowed: more than 0, at most 172800 s" in refused([0.0, 9.0], [0.0, 172_801.0])[0]
        )
        assert "got 0 s" in refused([0.0, 9.0], [5.0, 5.0])[0]
        assert len(track([0.0, 9.0, 18.0], [0.0, 5.0, 5.0])) == 3
        back = refused([0.0, 9.0, 18.0, 27.0, 36.0], [0.0, 5.0, 3.0, 9.0, 8.0])
        assert back == [
            "time decreases: track, point 3: got 2 s back (and 1 more points); allowed: times that never decrease"
        ]
        assert "got 2 s back; allowed" in refused([0.0, 9.0, 18.0, 27.0], [0.0, 5.0, 3.0, 9.0])[0]
        assert refused([5.0, 5.0])[0].startswith("track has no length")
        assert refused([0.0])[0].startswith("too few points: track: got 1")
        assert len(track([0.0, 9.0], height=[-500.0, 9000.0])) == 2
        assert refused([0.0, 9.0], height=[NO, 9001.0])[0].startswith(
            "elevation out of range: track, point 2: got 9001"
        )
        assert refused([0.0, 9.0], height=[-501.0, 0.0])[0].startswith(
            "elevation out of range: track, point 1: got -501"
        )

    def test_a_log_has_a_median_step_of_five_seconds_at_most(self) -> None:
        assert track([0.0, 9.0, 18.0, 27.0], [0.0, 5.0, 10.0, 90.0]).is_log
        assert not track([0.0, 9.0, 18.0, 27.0], [0.0, 5.1, 10.2, 11.0]).is_log
        assert not track([0.0, 9.0]).is_log

    def test_heights(self) -> None:
        place, height, flags = track([0.0, 100.0, 300.0], height=[500.0, NO, 520.0]).elevation()
        assert place == pytest.approx([0.0, 300.0], rel=1e-6)
        assert height.tolist() == [500.0, 520.0]
        assert flags == (Flag("elevation_interpolated", "track"),)
        assert track([0.0, 100.0], height=[500.0, 501.0]).elevation()[2] == ()
        nothing, _, flags = track([0.0, 100.0]).elevation()
        assert nothing is None
        assert [f.code for f in flags] == ["flat_road"] or len(flags) == 1

    def test_which_tracks_need_a_speed(self) -> None:
        assert needs_speed(track([0.0, 9.0, 18.0], speed=[5.0, NO]))
        assert not needs_speed(track([0.0, 9.0, 18.0], speed=[5.0, 5.0]))
        assert not needs_speed(track([0.0, 9.0], [0.0, 1.0]))
        links = LinkRoute(np.array([9.0]), np.array([9.0]), np.array([NO]), np.array([NO]))
        assert not needs_speed(links)


class TestTimes:
    def test_seconds_from_the_first(self) -> None:
        texts = ["2026-05-01T08:00:00Z", "", "2026-05-01T10:00:30+02:00", "2026-05-01T08:01:00"]
        values, first, flags = times_of(texts, "x")
        assert values.tolist() == [0.0, 15.0, 30.0, 60.0]
        assert first == dt.datetime(2026, 5, 1, 8, tzinfo=dt.UTC)
        assert flags == (Flag("times_interpolated", "track"),)
        assert times_of([texts[0], texts[3]], "x")[2] == ()

    def test_both_ends_need_one(self) -> None:
        one = "2026-05-01T08:00:00Z"
        assert times_of(["", ""], "x") == (None, None, ())
        assert times_of([one, ""], "x") == (None, None, (Flag("times_ignored", "track"),))
        assert times_of(["", one], "x") == (None, None, (Flag("times_ignored", "track"),))

    def test_wrong(self) -> None:
        with pytest.raises(InvalidInput, match=r"x, point 2: got 'noon'"):
            times_of(["2026-05-01T08:00:00Z", "noon", "2026-05-01T08:00:01Z"], "x")
        with pytest.raises(InvalidInput, match=f"got '{'n' * 38}"):
            times_of(["2026-05-01T08:00:00Z", "n" * 60, "2026-05-01T08:00:01Z"], "x")


class TestLinks:
    def test_points_are_joined_up_to_a_hundred_metres(self) -> None:
        made = route_from_track(
            track([0.0, 60.0, 110.0, 150.0, 210.5, 300.0], [0.0, 10.0, 20.0, 30.0, 40.0, 60.0])
        )
        assert made.length_m == pytest.approx([110.0, 100.5, 89.5], rel=1e-6)
        assert made.travel_time_s.tolist() == [20.0, 20.0, 20.0]
        assert np.isnan(made.stop_s).all()

    def test_a_rest_without_length_or_time_joins_the_link_before(self) -> None:
        stands = route_from_track(track([0.0, 150.0, 300.0, 300.0], [0.0, 10.0, 20.0, 50.0]))
        assert stands.length_m == pytest.approx([150.0, 150.0], rel=1e-6)
        assert stands.travel_time_s.tolist() == [10.0, 40.0]
        at_once = route_from_track(track([0.0, 150.0, 300.0, 450.0], [0.0, 10.0, 20.0, 20.0]))
        assert at_once.travel_time_s.tolist() == [10.0, 10.0]
        assert at_once.length_m == pytest.approx([150.0, 300.0], rel=1e-6)

    def test_without_time_a_link_goes_on(self) -> None:
        """The first 150 m take no time, so a link cannot end there."""
        made = route_from_track(track([0.0, 150.0, 300.0, 450.0], [0.0, 0.0, 20.0, 30.0]))
        assert made.length_m == pytest.approx([300.0, 150.0], rel=1e-6)
        assert made.travel_time_s.tolist() == [20.0, 10.0]

    def test_links_end_where_the_speed_of_the_pieces_changes(self) -> None:
        made = route_from_track(track([0.0, 20.0, 40.0, 60.0, 80.0], speed=[10.0, 10.0, 20.0, 20.0]))
        assert made.length_m == pytest.approx([40.0, 40.0], rel=1e-6)
        assert made.travel_time_s == pytest.approx([4.0, 2.0], rel=1e-6)
        assert all(f.code != "speed_assumed" for f in made.flags)
        quick = route_from_track(track([0.0, 20.0, 40.0], speed=[40.0, 20.0]))
        assert quick.travel_time_s == pytest.approx([0.5, 1.0], rel=1e-6)

    def test_less_than_a_hundred_metres_are_no_link(self) -> None:
        made = route_from_track(track([0.0, 99.5, 199.0], [0.0, 10.0, 20.0]))
        assert made.length_m == pytest.approx([199.0], rel=1e-6)

    def test_a_speed_for_pieces_without_one(self) -> None:
        some = track([0.0, 200.0, 400.0], speed=[10.0, NO], flags=(Flag("times_ignored", "track"),))
        made = route_from_track(some, 25.0)
        assert made.travel_time_s == pytest.approx([20.0, 8.0], rel=1e-6)
        codes = [(f.code, f.value, f.unit) for f in made.flags]
        assert codes[:2] == [("times_ignored", None, ""), ("speed_assumed", 25.0, "m_s")]
        assert len(codes) == 3  # and a flat road
        known = route_from_track(track([0.0, 200.0], speed=[10.0]), 25.0)
        assert known.travel_time_s == pytest.approx([20.0], rel=1e-6)
        assert all(f.code != "speed_assumed" for f in known.flags)

    def test_bounds_of_the_speed(self) -> None:
        slow = track([0.0, 100.0])
        assert route_from_track(slow, 70.0).travel_time_s == pytest.approx([100.0 / 70.0], rel=1e-6)
        for wrong in (0.0, -1.0, 70.1):
            with pytest.raises(InvalidInput, match="speed out of range"):
                route_from_track(slow, wrong)
        with pytest.raises(InvalidInput, match=r"got 1 pieces without time and speed"):
            route_from_track(track([0.0, 100.0, 200.0], speed=[10.0, NO]))


class TestLoggedPlan:
    def test_speed_over_five_seconds(self) -> None:
        """0, 10, 30 m after 0, 1, 2 s and 10 m/s from there: the mean from two seconds before to two after."""
        metres = [0.0, 10.0, 30.0, 40.0, 50.0, 60.0]
        plan = plan_from_track(track(metres, np.arange(6.0), height=[0.0, 1.0, 3.0, 4.0, 5.0, 6.0]))
        assert plan.array("time_s").tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
        expected = [30 / 2, 40 / 3, 50 / 4, 50 / 4, 30 / 3, 20 / 2]
        assert plan.array("speed_m_s") == pytest.approx(expected, rel=1e-6)
        assert plan.array("elevation_m") == pytest.approx([0.0, 1.0, 3.0, 4.0, 5.0, 6.0], rel=1e-6)
        assert plan.step_s == 1.0
        assert plan.departure.started_at is None

    def test_steps(self) -> None:
        """5.5 s in steps of 2 s end at 6 s, where the plan looks back two seconds from 6 s to the end at 5.5 s."""
        even = track(10.0 * np.array([0.0, 2.0, 4.0, 5.5]), [0.0, 2.0, 4.0, 5.5])
        plan = plan_from_track(even, step_s=2.0, trip_id="mine")
        assert plan.array("time_s").tolist() == [0.0, 2.0, 4.0, 6.0]
        assert plan.array("speed_m_s") == pytest.approx([10.0] * 4, rel=1e-6)
        assert plan.step_s == 2.0
        assert plan.trip_id == "mine"
        whole = plan_from_track(track([0.0, 20.0, 40.0], [0.0, 2.0, 4.0]), step_s=2.0)
        assert whole.array("time_s").tolist() == [0.0, 2.0, 4.0]
        short = plan_from_track(track([0.0, 5.0], [0.0, 0.5]))
        assert short.array("time_s").tolist() == [0.0, 1.0]
        assert short.array("speed_m_s") == pytest.approx([10.0, 10.0], rel=1e-6)

    def test_bounds_of_a_step(self) -> None:
        even = track([0.0, 20.0], [0.0, 2.0])
        for wrong in (0.0009, 0.0, -1.0, NO, math.inf, 172_801.0):
            with pytest.raises(InvalidInput, match="step out of range"):
                plan_from_track(even, step_s=wrong)
        assert len(plan_from_track(even, step_s=0.001)) == 2001
        brief = plan_from_track(track([0.0, 0.001], [0.0, 0.0001]), step_s=172_800.0)
        assert brief.array("time_s").tolist() == [0.0, 172_800.0]
        assert brief.array("speed_m_s") == pytest.approx([10.0, 0.0], rel=1e-3)

    def test_of_points_with_one_time_the_last_place_counts(self) -> None:
        plan = plan_from_track(track([0.0, 5.0, 10.0, 20.0, 30.0], [0.0, 1.0, 1.0, 2.0, 3.0]))
        assert plan.array("speed_m_s")[1:3] == pytest.approx([10.0, 10.0], rel=1e-6)
        end = plan_from_track(track([0.0, 10.0, 20.0, 30.0], [0.0, 1.0, 2.0, 2.0]))
        assert end.array("speed_m_s")[0] == pytest.approx(15.0, rel=1e-6)

    def test_jitter_stands(self) -> None:
        slow = plan_from_track(track(0.499 * np.arange(9.0), np.arange(9.0)))
        assert (slow.array("speed_m_s") == 0.0).all()
        moves = plan_from_track(track(0.501 * np.arange(9.0), np.arange(9.0)))
        assert moves.array("speed_m_s") == pytest.approx([0.501] * 9, rel=1e-6)

    def test_no_car_is_so_fast(self) -> None:
        assert len(plan_from_track(track([0.0, 69.9, 139.8], np.arange(3.0)))) == 3
        with pytest.raises(InvalidInput, match=r"got 256 km/h at 0 s; allowed: at most 252 km/h"):
            plan_from_track(track([0.0, 71.0, 142.0], np.arange(3.0)))
        with pytest.raises(InvalidInput, match="no times"):
            plan_from_track(track([0.0, 71.0]))

    def test_started(self) -> None:
        start = dt.datetime(2026, 5, 1, 8, tzinfo=dt.UTC)
        known = (Flag("times_interpolated", "track"),)
        plan = plan_from_track(track([0.0, 20.0], [0.0, 2.0], started_at=start, flags=known))
        assert plan.departure.started_at == start
        assert plan.flags[0] == known[0]
        assert len(plan.flags) == 2  # and a flat road


def xml(inside: str) -> bytes:
    return f'<gpx version="1.1">{inside}</gpx>'.encode()


def points(tag: str, *places: tuple[float, float], more: str = "") -> str:
    return "".join(f'<{tag} lat="{a}" lon="{b}">{more}</{tag}>' for a, b in places)


class TestGpx:
    def test_the_first_track_of_two_points_before_any_route(self) -> None:
        route = f"<rte>{points('rtept', (10, 1), (11, 2))}</rte>"
        alone = f"<trk><trkseg>{points('trkpt', (20, 1))}</trkseg></trk>"
        two = f"<trk><trkseg>{points('trkpt', (30, 1))}</trkseg><trkseg>{points('trkpt', (31, 2))}</trkseg></trk>"
        found = read_gpx(xml(route + alone + two))
        assert found.latitude_deg.tolist() == [30.0, 31.0]
        assert found.longitude_deg.tolist() == [1.0, 2.0]
        assert np.isnan(found.piece_speed_m_s).tolist() == [True]
        (flag,) = found.flags
        assert flag.value == 2
        assert read_gpx(xml(route)).flags == ()
        assert read_gpx(xml(route + alone)).latitude_deg.tolist() == [10.0, 11.0]

    def test_heights_and_times(self) -> None:
        inside = "<ele> 520.5 </ele><time>2026-05-01T08:00:0{}Z</time>"
        rows = "".join(points("trkpt", (48 + k, 11), more=inside.format(k)) for k in range(2))
        other = "<extensions><ele>9</ele></extensions>"
        found = read_gpx(
            xml(f"<trk>{other}<trkseg>{rows}{points('trkpt', (50, 11), more=other)}</trkseg></trk>")
        )
        assert found.elevation_m[:2].tolist() == [520.5, 520.5]
        assert np.isnan(found.elevation_m[2])
        assert found.time_s is None
        assert [f.code for f in found.flags] == ["times_ignored"]

    def test_names_with_a_prefix(self) -> None:
        text = f'<g:gpx xmlns:g="x"><g:rte>{points("g:rtept", (1, 1), (2, 2))}</g:rte></g:gpx>'
        assert len(read_gpx(text.encode())) == 2

    def test_points_outside_of_tracks_do_not_count(self) -> None:
        strange = f"<other><trk>{points('trkpt', (7, 1), (8, 2))}</trk></other>"
        found = read_gpx(xml(f"{strange}<rte>{points('rtept', (1, 1), (2, 2))}</rte>"))
        assert found.latitude_deg.tolist() == [1.0, 2.0]
        with pytest.raises(InvalidInput, match="a trk or rte of two points"):
            read_gpx(xml(strange))

    def test_depth(self) -> None:
        """64 levels with <gpx>."""
        route = f"<rte>{points('rtept', (1, 1), (2, 2))}</rte>"
        assert len(read_gpx(xml("<a>" * 63 + "</a>" * 63 + route))) == 2
        with pytest.raises(InvalidInput, match="got 65 levels; allowed: at most 64"):
            read_gpx(xml("<a>" * 64 + "</a>" * 64 + route))

    def test_number_of_points(self, monkeypatch) -> None:
        monkeypatch.setattr(xml_events, "MOST_POINTS", 2)
        assert len(read_gpx(xml(f"<rte>{points('rtept', (1, 1), (2, 2))}</rte>"))) == 2
        with pytest.raises(InvalidInput, match="more than 2"):
            read_gpx(xml(f"<rte>{points('rtept', (1, 1), (2, 2), (3, 3))}</rte>"))

    @pytest.mark.parametrize(("lat", "named"), [("north", "'north'"), ("inf", "'inf'"), ("", "''")])
    def test_numbers(self, lat: str, named: str) -> None:
        bad = f'<rte><rtept lat="1" lon="1"/><rtept lat="{lat}" lon="1"/></rte>'
        with pytest.raises(InvalidInput, match=f"point 2, lat: got {named}"):
            read_gpx(xml(bad))

    def test_roots_and_document_types(self) -> None:
        with pytest.raises(InvalidInput, match=f"not GPX.*<{'k' * 40}>"):
            read_gpx(b"<" + b"k" * 50 + b"/>")
        with pytest.raises(InvalidInput, match="document type"):
            read_gpx(b"<!DOCTYPE gpx><gpx/>")
        with pytest.raises(InvalidInput, match="not well-formed XML"):
            read_gpx(b"<gpx>")


def geojson(kind: str, coordinates, **properties) -> dict:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def collected(*features) -> bytes:
    return json.dumps({"type": "FeatureCollection", "features": list(features)}).encode()


LINE = [[11.0, 48.0], [11.1, 48.1, 530.0]]


class TestGeojson:
    def test_a_line(self) -> None:
        found = read_geojson(json.dumps({"type": "LineString", "coordinates": LINE}).encode())
        assert found.latitude_deg.tolist() == [48.0, 48.1]
        assert found.longitude_deg.tolist() == [11.0, 11.1]
        assert np.isnan(found.elevation_m[0])
        assert found.elevation_m[1] == 530.0

    def test_the_piece_between_two_lines_has_the_speed_of_the_second(self) -> None:
        other = [[11.2, 48.2], [11.3, 48.3]]
        made = read_geojson(
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

    def test_speeds_of_roads_are_those_of_osrm(self) -> None:
        """Kilometres per hour of `profiles/car.lua`."""
        given = {road: round(speed * 3.6, 9) for road, speed in ROAD_SPEED_M_S.items()}
        assert given == {
            "motorway": 90,
            "motorway_link": 45,
            "trunk": 85,
            "trunk_link": 40,
            "primary": 65,
            "primary_link": 30,
            "secondary": 55,
            "secondary_link": 25,
            "tertiary": 40,
            "tertiary_link": 20,
            "unclassified": 25,
            "residential": 25,
            "living_street": 10,
            "service": 15,
        }

    def test_what_is_no_line_is_counted(self) -> None:
        found = read_geojson(
            collected(
                geojson("Point", [11.0, 48.0]),
                {"type": "Feature", "geometry": None, "properties": None},
                geojson("MultiLineString", [LINE, [[11.2, 48.2], [11.3, 48.3]]]),
                {"type": "GeometryCollection", "geometries": [{"type": "Polygon", "coordinates": []}]},
            )
        )
        assert len(found) == 4
        assert found.flags == (Flag("geometries_skipped", "geometries", 2.0, "1"),)
        assert read_geojson(collected(geojson("LineString", LINE))).flags == ()
        with pytest.raises(InvalidInput, match="no line"):
            read_geojson(collected(geojson("Point", [11.0, 48.0])))

    def test_times(self) -> None:
        stamps = [f"2026-05-01T08:00:0{k}Z" for k in range(4)]
        lines = [LINE, [[11.2, 48.2], [11.3, 48.3]]]
        flat = read_geojson(collected(geojson("MultiLineString", lines, coordTimes=stamps)))
        nested = geojson("MultiLineString", lines, coordinateProperties={"times": [stamps[:2], stamps[2:]]})
        for found in (flat, read_geojson(collected(nested))):
            assert found.time_s.tolist() == [0.0, 1.0, 2.0, 3.0]
        gap = read_geojson(
            collected(geojson("MultiLineString", lines, coordTimes=[stamps[0], None, *stamps[2:]]))
        )
        assert gap.time_s.tolist() == [0.0, 1.0, 2.0, 3.0]
        assert [f.code for f in gap.flags] == ["times_interpolated"]
        for wrong, said in ((stamps[:2], "got 2 times; allowed: 4"), ([*stamps[:3], 5], "invalid time")):
            with pytest.raises(InvalidInput, match=said):
                read_geojson(collected(geojson("MultiLineString", lines, coordTimes=wrong)))
        plain = read_geojson(collected(geojson("LineString", LINE, coordinateProperties=3)))
        assert plain.time_s is None

    @pytest.mark.parametrize(("speed", "allowed"), [(70.0, True), (70.1, False), (0.0, False), (0.1, True)])
    def test_bounds_of_a_speed(self, speed: float, allowed: bool) -> None:
        text = collected(geojson("LineString", LINE, speed_m_s=speed))
        if allowed:
            assert read_geojson(text).piece_speed_m_s.tolist() == [speed]
        else:
            with pytest.raises(InvalidInput, match="speed out of range"):
                read_geojson(text)

    def test_depth(self) -> None:
        """The 64th collection may hold a line, the 65th not."""
        node: dict = {"type": "LineString", "coordinates": LINE}
        for _ in range(64):
            node = {"type": "GeometryCollection", "geometries": [node]}
        assert len(read_geojson(json.dumps(node).encode())) == 2
        with pytest.raises(InvalidInput, match="got 65 levels; allowed: at most 64"):
            read_geojson(json.dumps({"type": "GeometryCollection", "geometries": [node]}).encode())
        feature: dict = {"type": "Feature", "geometry": node, "properties": {}}
        with pytest.raises(InvalidInput, match="got 65 levels"):
            read_geojson(json.dumps(feature).encode())

    def test_types(self) -> None:
        with pytest.raises(InvalidInput, match="type: got 'Topology'"):
            read_geojson(b'{"type": "Topology"}')


class TestTable:
    def test_headers(self) -> None:
        assert is_links_table(b"a;length_m\n1;2")
        assert not is_links_table(b"length_m;time_s\n")
        assert not is_links_table(b"a;b\n")
        assert is_links_table(b"x" * 3993 + b",length_m\n")  # the word ends with the 4000th byte
        assert not is_links_table(b"x" * 3994 + b",length_m\n")

    def test_cells(self) -> None:
        made = route_from_table(b'"Length_M" ; speed_m_s;stop_s\n1000,5;10;\n\n;;\n500;5;20\n')
        assert made.length_m.tolist() == [1000.5, 500.0]
        assert made.travel_time_s.tolist() == [100.05, 100.0]  # of which 20 s stand
        tabs = route_from_table(b"length_m\tspeed_m_s\n1000,5\t10\n")
        assert tabs.length_m.tolist() == [1000.5]
        assert route_from_table(b"length_m,travel_time_s\n1000.5,50").travel_time_s.tolist() == [50.0]

    def faults(self, text: bytes) -> list[str]:
        with pytest.raises(InvalidInput) as caught:
            route_from_table(text)
        return [str(fault) for fault in caught.value.faults]

    def test_faults_of_a_header(self) -> None:
        found = self.faults(b"length_m,length_m,colour\n")
        assert [f.split(":")[0] for f in found] == ["unknown column", "duplicate column", "missing column"]
        assert "got 2 times" in found[1]
        assert found[2].endswith("speed_m_s or travel_time_s")
        assert self.faults(b"speed_m_s\n5\n")[0].endswith("allowed: length_m")
        long = self.faults(b"length_m,speed_m_s," + b"c" * 80 + b"\n")
        assert f"column '{'c' * 60}'" in long[0]

    def test_faults_of_cells(self) -> None:
        found = self.faults(b"length_m,speed_m_s\n500,5\nlong,5\n500,5,5\n")
        assert found[0].startswith("not a number: links, link 2, length_m: got 'long'")
        assert found[1].startswith("too many cells: links, link 3: got 3; allowed: 2")
        assert len(found) == 2
        wrong = self.faults(b"length_m,speed_m_s\n" + b"x,5\n" * 500)
        assert len(wrong) < 500

    def test_bytes_that_are_no_text(self) -> None:
        assert self.faults(b"length_m,speed_m_s\n\xff,5\n")[0].startswith("not a table")

    def test_the_first_line_alone_is_the_header(self) -> None:
        assert is_links_table(b"length_m,name\n5,time of day\n")
        assert not is_links_table(b"name,speed\nlength_m,time\n")
        assert not is_links_table(b"length_m,time_s\n5,6\n")
        assert is_links_table(b"\xef\xbb\xbf LENGTH \t b")
        assert len(route_from_table(b"length_m,speed_m_s\n5,6\n").length_m) == 1

    def test_so_many_links_are_read(self, monkeypatch) -> None:
        """Empty lines do not count."""
        for module in (link_table, link_objects):
            monkeypatch.setattr(module, "MOST_LINKS", 3)
        head, row = b"length_m,speed_m_s\n", b"500,5\n"
        assert len(route_from_table(head + b"\n,\n" + row + b"\n" + row * 2)) == 3
        assert self.faults(head + row * 4)[0].startswith("too many links: links: got more than 3")
        assert self.faults(head + b"\n\n\n" + row * 4)[0].startswith("too many links")
        assert len(self.faults(head + row * 3 + b"x,5\n")) == 2

    def test_fifty_unknown_columns_are_named_and_ten_have_hints(self) -> None:
        names = [f"length_{k}_m" for k in range(52)]
        found = self.faults(",".join(["length_m", "speed_m_s", *names]).encode() + b"\n5,5\n")
        assert [f.split(":")[0] for f in found] == ["unknown column"] * 51
        assert found[-1].startswith("unknown column: links: got 2 more; ")
        assert ["did you mean" in f for f in found] == [True] * 10 + [False] * 41

    def test_words_of_a_header_are_cut(self) -> None:
        found = self.faults(f"length_m,speed_m_s,{'c' * 80}\n5,5\n".encode())
        assert f"links, column '{'c' * 60}': got {'c' * 60}; " in found[0]
        missing = self.faults(f"speed_m_s,{'c' * 200}\n5,5\n".encode())
        assert f"got speed_m_s, {'c' * 109}; allowed: length_m" in missing[1]
        neither = self.faults(f"length_m,{'c' * 200}\n5,5\n".encode())
        assert f"got length_m, {'c' * 110}; allowed: speed_m_s or travel_time_s" in neither[1]

    def test_alike_faults_of_cells_are_counted(self) -> None:
        found = self.faults(b"length_m,speed_m_s\n" + b"x,5\n" * 3 + b"5,x\n")
        assert [f.split(": got")[0] for f in found] == [
            *(f"not a number: links, link {k}, length_m" for k in (1, 2, 3)),
            "not a number: links, link 4, speed_m_s",
        ]
        found = self.faults(b"length_m,speed_m_s\n" + b"x,5\n" * 49 + b"x,x\n" + b"x,5\n" * 9)
        assert [f.split(";")[0] for f in found] == [
            "not a number: links, link 1, length_m: got 'x' (and 58 more links)",
            "not a number: links, link 50, speed_m_s: got 'x'",
        ]

    def test_fifty_rows_with_too_many_cells_are_named(self) -> None:
        for number, faults in ((50, 50), (53, 51)):
            found = self.faults(b"length_m,speed_m_s\n" + b"5,5,5\n" * number)
            assert len(found) == faults
            assert found[0].startswith("too many cells: links, link 1: got 3")
        assert found[-1] == "further faults: links: got 3 more"

    def test_a_link_may_have_as_many_cells_as_the_header(self) -> None:
        assert len(route_from_table(b"length_m,speed_m_s,grade\n5,5\n5,5,0.01\n")) == 2
        found = self.faults(b"length_m,speed_m_s\n5,5\n5,5,\n")
        assert found == ["too many cells: links, link 2: got 3; allowed: 2"]
