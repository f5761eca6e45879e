"""Tracks of points: times, links, and logged plans."""

import datetime as dt
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.routes.made import M_PER_DEGREE, NO, SPEED, drive, gpx
from tests.support.refusals import refusal, refuses

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.routes import Track, parse_route
from tripwatt.routes.tracks import EARLIEST_YEAR, LATEST_YEAR, _parse_time, parse_times
from tripwatt.trips import Flag


def test_jitter_of_positions_is_no_driving():
    rng = np.random.default_rng(1)
    points = [
        (lat + e / M_PER_DEGREE, lon, ele, t)
        for (lat, lon, ele, t), e in zip(drive(np.zeros(120)), rng.normal(0, 0.15, 120), strict=True)
    ]
    points += [(48.001, 11.0, None, "2026-05-01T08:02:09Z")]
    assert parse_route(gpx(points)).driven_plan().array("speed_m_s")[5:110].max() == 0.0


def test_a_sparse_track_gives_links_with_its_times():
    track = parse_route(gpx(drive(SPEED, every_s=20)))
    route = track.links()
    assert not track.is_log
    assert route.duration_s == pytest.approx(track.time_s[-1])
    assert route.distance_m == pytest.approx(track.position_m[-1])
    assert track.plan().duration_s == pytest.approx(track.time_s[-1], rel=0.02)


def test_a_route_without_times_needs_a_speed():
    track = parse_route(gpx([(48.0, 11.0, None, None), (48.02, 11.0, None, None)], "rtept"))
    refuses("give speed_m_s", track.plan)
    trip = track.plan(speed_m_s=16.0)
    assert trip.duration_s == pytest.approx(0.02 * M_PER_DEGREE / 16.0, abs=1.5)
    assert Flag("speed_assumed", "track", 16.0, "m_s") in trip.flags
    assert Flag("no_elevation", "road") in trip.flags


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
            "point 2: got 172801 s, of which 172801 s before this point; allowed: more than 0, at most"
            in refused([0.0, 9.0], [0.0, 172_801.0])[0]
        )
        assert "got 0 s" in refused([0.0, 9.0], [5.0, 5.0])[0]
        assert len(track([0.0, 9.0, 18.0], [0.0, 5.0, 5.0])) == 3
        back = refused([0.0, 9.0, 18.0, 27.0, 36.0], [0.0, 5.0, 3.0, 9.0, 8.0])
        assert back == [
            "time decreases: track, point 3: got 2 s back (and 1 more point); allowed: times that never decrease"
        ]
        assert "got 2 s back; allowed" in refused([0.0, 9.0, 18.0, 27.0], [0.0, 5.0, 3.0, 9.0])[0]
        assert refused([5.0, 5.0])[0].startswith("track has no length")
        assert refused([0.0])[0].startswith("too few points: track: got 1")
        assert len(track([0.0, 9.0], height=[-500.0, 9000.0])) == 2

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
        for void in (9001.0, -501.0, -9999.0, -32768.0):
            place, height, flags = track([0.0, 100.0, 300.0], height=[500.0, void, 9000.0]).elevation()
            assert (place.round().tolist(), height.tolist()) == ([0.0, 300.0], [500.0, 9000.0])
            assert flags == (Flag("elevation_interpolated", "track"),)
        nothing, _, flags = track([0.0, 100.0]).elevation()
        assert nothing is None
        assert [f.code for f in flags] == ["flat_road"] or len(flags) == 1

    def test_which_tracks_need_a_speed(self) -> None:
        assert track([0.0, 9.0, 18.0], speed=[5.0, NO]).needs_speed
        assert not track([0.0, 9.0, 18.0], speed=[5.0, 5.0]).needs_speed
        assert not track([0.0, 9.0], [0.0, 1.0]).needs_speed


class TestTimes:
    def test_seconds_from_the_first(self) -> None:
        texts = ["2026-05-01T08:00:00Z", "", "2026-05-01T10:00:30+02:00", "2026-05-01T08:01:00"]
        values, first, flags = parse_times(texts, "x")
        assert values.tolist() == [0.0, 15.0, 30.0, 60.0]
        assert first == dt.datetime(2026, 5, 1, 8, tzinfo=dt.UTC)
        assert flags == (Flag("times_interpolated", "track"),)
        assert parse_times([texts[0], texts[3]], "x")[2] == ()

    def test_both_ends_need_one(self) -> None:
        one = "2026-05-01T08:00:00Z"
        assert parse_times(["", ""], "x") == (None, None, ())
        assert parse_times([one, ""], "x") == (None, None, (Flag("times_ignored", "track"),))
        assert parse_times(["", one], "x") == (None, None, (Flag("times_ignored", "track"),))

    def test_wrong(self) -> None:
        with pytest.raises(InvalidInput, match=r"x, point 2: got 'noon'"):
            parse_times(["2026-05-01T08:00:00Z", "noon", "2026-05-01T08:00:01Z"], "x")
        with pytest.raises(InvalidInput, match=f"got '{'n' * 38}"):
            parse_times(["2026-05-01T08:00:00Z", "n" * 60, "2026-05-01T08:00:01Z"], "x")


class TestLinks:
    def test_points_are_joined_up_to_a_hundred_metres(self) -> None:
        made = track([0.0, 60.0, 110.0, 150.0, 210.5, 300.0], [0.0, 10.0, 20.0, 30.0, 40.0, 60.0]).links()
        assert made.length_m == pytest.approx([110.0, 100.5, 89.5], rel=1e-6)
        assert made.travel_time_s.tolist() == [20.0, 20.0, 20.0]
        assert np.isnan(made.stop_s).all()

    def test_a_rest_without_length_or_time_joins_the_link_before(self) -> None:
        stands = track([0.0, 150.0, 300.0, 300.0], [0.0, 10.0, 20.0, 50.0]).links()
        assert stands.length_m == pytest.approx([150.0, 150.0], rel=1e-6)
        assert stands.travel_time_s.tolist() == [10.0, 40.0]
        at_once = track([0.0, 150.0, 300.0, 450.0], [0.0, 10.0, 20.0, 20.0]).links()
        assert at_once.travel_time_s.tolist() == [10.0, 10.0]
        assert at_once.length_m == pytest.approx([150.0, 300.0], rel=1e-6)

    def test_without_time_a_link_goes_on(self) -> None:
        """The first 150 m take no time, so a link cannot end there."""
        made = track([0.0, 150.0, 300.0, 450.0], [0.0, 0.0, 20.0, 30.0]).links()
        assert made.length_m == pytest.approx([300.0, 150.0], rel=1e-6)
        assert made.travel_time_s.tolist() == [20.0, 10.0]

    def test_links_end_where_the_speed_of_the_pieces_changes(self) -> None:
        made = track([0.0, 20.0, 40.0, 60.0, 80.0], speed=[10.0, 10.0, 20.0, 20.0]).links()
        assert made.length_m == pytest.approx([40.0, 40.0], rel=1e-6)
        assert made.travel_time_s == pytest.approx([4.0, 2.0], rel=1e-6)
        assert all(f.code != "speed_assumed" for f in made.flags)
        quick = track([0.0, 20.0, 40.0], speed=[40.0, 20.0]).links()
        assert quick.travel_time_s == pytest.approx([0.5, 1.0], rel=1e-6)

    def test_less_than_a_hundred_metres_are_no_link(self) -> None:
        made = track([0.0, 99.5, 199.0], [0.0, 10.0, 20.0]).links()
        assert made.length_m == pytest.approx([199.0], rel=1e-6)

    def test_a_speed_for_pieces_without_one(self) -> None:
        some = track([0.0, 200.0, 400.0], speed=[10.0, NO], flags=(Flag("times_ignored", "track"),))
        made = some.links(25.0)
        assert made.travel_time_s == pytest.approx([20.0, 8.0], rel=1e-6)
        codes = [(f.code, f.value, f.unit) for f in made.flags]
        assert codes[:2] == [("times_ignored", None, ""), ("speed_assumed", 25.0, "m_s")]
        assert len(codes) == 3  # and a flat road
        known = track([0.0, 200.0], speed=[10.0]).links(25.0)
        assert known.travel_time_s == pytest.approx([20.0], rel=1e-6)
        assert all(f.code != "speed_assumed" for f in known.flags)

    def test_bounds_of_the_speed(self) -> None:
        slow = track([0.0, 100.0])
        assert slow.links(70.0).travel_time_s == pytest.approx([100.0 / 70.0], rel=1e-6)
        for wrong in (0.0, -1.0, 70.1):
            refuses("speed out of range", slow.links, wrong)
        refuses(r"got 1 pieces without time and speed", track([0.0, 100.0, 200.0], speed=[10.0, NO]).links)


class TestLoggedPlan:
    def test_speed_over_five_seconds(self) -> None:
        """0, 10, 30 m after 0, 1, 2 s and 10 m/s from there: the mean from two seconds before to two after."""
        metres = [0.0, 10.0, 30.0, 40.0, 50.0, 60.0]
        plan = track(metres, np.arange(6.0), height=[0.0, 1.0, 3.0, 4.0, 5.0, 6.0]).driven_plan()
        assert plan.array("time_s").tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
        expected = [30 / 2, 40 / 3, 50 / 4, 50 / 4, 30 / 3, 20 / 2]
        assert plan.array("speed_m_s") == pytest.approx(expected, rel=1e-6)
        assert plan.array("elevation_m") == pytest.approx([0.0, 1.0, 3.0, 4.0, 5.0, 6.0], rel=1e-6)
        assert plan.step_s == 1.0
        assert plan.departure.departs_at is None

    def test_the_last_second_ends_after_the_track(self) -> None:
        short = track([0.0, 5.0], [0.0, 0.5]).driven_plan()
        assert short.array("time_s").tolist() == [0.0, 1.0]
        assert short.array("speed_m_s") == pytest.approx([10.0, 10.0], rel=1e-6)

    def test_of_points_with_one_time_the_last_place_counts(self) -> None:
        plan = track([0.0, 5.0, 10.0, 20.0, 30.0], [0.0, 1.0, 1.0, 2.0, 3.0]).driven_plan()
        assert plan.array("speed_m_s")[1:3] == pytest.approx([10.0, 10.0], rel=1e-6)
        end = track([0.0, 10.0, 20.0, 30.0], [0.0, 1.0, 2.0, 2.0]).driven_plan()
        assert end.array("speed_m_s")[0] == pytest.approx(15.0, rel=1e-6)

    def test_jitter_stands(self) -> None:
        slow = track(0.499 * np.arange(9.0), np.arange(9.0)).driven_plan()
        assert (slow.array("speed_m_s") == 0.0).all()
        moves = track(0.501 * np.arange(9.0), np.arange(9.0)).driven_plan()
        assert moves.array("speed_m_s") == pytest.approx([0.501] * 9, rel=1e-6)

    def test_no_car_is_so_fast(self) -> None:
        assert len(track([0.0, 69.9, 139.8], np.arange(3.0)).driven_plan()) == 3
        with pytest.raises(InvalidInput, match=r"got 256 km/h at 0 s; allowed: at most 252 km/h"):
            track([0.0, 71.0, 142.0], np.arange(3.0)).driven_plan()
        refuses("no times", track([0.0, 71.0]).driven_plan)

    def test_started(self) -> None:
        start = dt.datetime(2026, 5, 1, 8, tzinfo=dt.UTC)
        known = (Flag("times_interpolated", "track"),)
        plan = track([0.0, 20.0], [0.0, 2.0], started_at=start, flags=known).driven_plan()
        assert plan.departure.departs_at == start
        assert plan.flags[0] == known[0]
        assert len(plan.flags) == 2  # and a flat road


def at_moments(seconds, stamps):
    """The track of `SPEED` with points at some seconds that have these stamps."""
    driven = np.interp(seconds, np.arange(len(SPEED)), np.cumsum(SPEED))
    times = [f"{dt.datetime(2026, 5, 1, 8) + dt.timedelta(seconds=float(s))}Z" for s in stamps]
    places = (48.0 + driven / M_PER_DEGREE).tolist()
    return parse_route(gpx([(place, 11.0, 500.0, time) for place, time in zip(places, times, strict=True)]))


@pytest.mark.parametrize("step_s", [0.7, 1.05, 1.1, 1.5, 2.5, 4.5, 4.9, 5.4, 7.5])
def test_stamps_cut_to_whole_seconds_give_the_energy_of_exact_ones(step_s):
    seconds = np.arange(0.3, len(SPEED) - 1.0, step_s)
    tracks = [at_moments(seconds, stamps) for stamps in (seconds, np.floor(seconds))]
    exact, cut = (tw.forecast(track.plan(), car="vw_id3").energy_wh for track in tracks)
    assert cut == pytest.approx(exact, rel=0.1)
    assert tracks[1].time_s == pytest.approx(seconds - seconds[0], abs=1.0)


@pytest.mark.parametrize("lost", [0.0, 0.05, 0.3, 0.7])
def test_exact_whole_seconds_stay(lost):
    """A logger of 1 Hz that lost points, and then a pause: the distances follow the stamps."""
    seconds = np.flatnonzero(np.random.default_rng(1).random(len(SPEED)) >= lost)
    stamps = seconds + 2700.0 * (seconds > 200)
    assert (at_moments(seconds, stamps).time_s == stamps - stamps[0]).all()


def drive_of(seconds, zone="Z"):
    """A GPX of points every 100 m whose times are those of `seconds` after a start."""
    points = "".join(
        f'<trkpt lat="{47.0 + k / 1112.0:.6f}" lon="9"><time>{(start + dt.timedelta(seconds=s)).isoformat()}{zone}</time></trkpt>'
        for k, s in enumerate(seconds)
        for start in [dt.datetime(2026, 3, 29, 1, 55)]
    )
    return parse_route(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode())


@pytest.mark.parametrize("pause_s", [2700.0, 36_000.0])
def test_a_pause_between_points_takes_no_energy_and_keeps_the_way(pause_s):
    seconds = 5.0 * np.arange(201)
    straight = drive_of(seconds).driven_plan()
    paused = drive_of(np.where(np.arange(201) > 100, seconds + pause_s, seconds)).driven_plan()
    assert paused.distance_m == pytest.approx(straight.distance_m, rel=1e-3)
    assert paused.duration_s == pytest.approx(straight.duration_s, rel=1e-2)
    (pause,) = paused.pauses
    assert pause.position_m == pytest.approx(10_000.0, rel=1e-3)
    assert paused.elapsed_s == pytest.approx(straight.elapsed_s + pause_s)
    assert [flag.code for flag in paused.flags][-1] == "pause"


@pytest.mark.parametrize("hour_s", [3600.0, -3600.0])
def test_the_hour_of_summer_time_is_no_time(hour_s):
    seconds = 5.0 * np.arange(201)
    changed = np.where(np.arange(201) > 60, seconds + hour_s, seconds)
    assert drive_of(changed, zone="").driven_plan().elapsed_s == pytest.approx(seconds[-1])


@given(st.data())
def test_one_repeated_or_missing_time_changes_nothing(data):
    """Times of a steady drive: a repeated one is between its neighbours, and so is a missing one, also at an end."""
    n = data.draw(st.integers(25, 60))
    texts = [f"2026-05-01T08:{5 * k // 60:02d}:{5 * k % 60:02d}Z" for k in range(n)]
    right, started_at, _ = parse_times(texts, "x")
    k = data.draw(st.integers(1, n - 2))
    repeated, _, flags = parse_times([*texts[:k], texts[k - 1], *texts[k + 1 :]], "x")
    assert repeated == pytest.approx(right)
    assert flags == ()
    k = data.draw(st.sampled_from([0, 1, n - 2, n - 1]))
    missing, started, flags = parse_times([*texts[:k], "", *texts[k + 1 :]], "x")
    assert missing == pytest.approx(right)
    assert started == started_at
    assert [flag.code for flag in flags] == ["times_interpolated"]


def test_times_that_too_many_points_lack_at_an_end_are_ignored():
    texts = [f"2026-05-01T08:00:{k:02d}Z" for k in range(40)]
    for kept in ([*texts[:35], *[""] * 5], [*[""] * 5, *texts[5:]]):
        assert parse_times(kept, "x")[2] == (Flag("times_ignored", "track"),)


def test_a_clock_that_is_set_on_the_way_is_named_with_its_point():
    texts = ["1970-01-01T00:00:01Z", *(f"2026-05-01T08:00:{k:02d}Z" for k in range(40))]
    time_s, *_ = parse_times(texts, "x")
    with pytest.raises(InvalidInput, match=r"duration out of range: track, point 2: .* before this point"):
        Track(
            np.linspace(48.0, 48.1, 41), np.full(41, 11.0), np.full(41, np.nan), time_s, np.full(40, np.nan)
        )


@pytest.mark.parametrize(
    ("year", "is_right"),
    [(EARLIEST_YEAR - 1, False), (EARLIEST_YEAR, True), (LATEST_YEAR, True), (LATEST_YEAR + 1, False)],
)
def test_a_time_is_of_a_year_in_which_a_car_is_driven(year, is_right):
    text = f"{year}-05-01T08:00:00Z"
    if is_right:
        assert _parse_time(text, "x").year == year
        return
    with pytest.raises(
        InvalidInput, match=f"invalid time: x: got year {year}; allowed: {EARLIEST_YEAR} to {LATEST_YEAR}"
    ):
        _parse_time(text, "x")


@pytest.mark.parametrize(("gap_s", "is_refused"), [(30.0, False), (200.0, True)])
def test_a_track_is_refused_if_most_of_its_way_is_in_gaps(gap_s, is_refused):
    """A minute at 10 m/s, a gap at 10 m/s, another minute."""
    seconds = np.concatenate((np.arange(61.0), 60.0 + gap_s + np.arange(61.0)))
    points = np.stack((48.0 + 10.0 * seconds / M_PER_DEGREE, np.full(122, 11.0)))
    track = Track(*points, np.full(122, np.nan), seconds, np.full(121, np.nan))
    if is_refused:
        assert refusal(track.driven_plan) == (
            "gaps in the track: track: got 63 % of the way in gaps of up to 200 s; "
            "allowed: at most 25 % in gaps over 10 s; give the whole track"
        )
    else:
        assert track.driven_plan().flags[-1] == Flag("gap_bridged", "speed_m_s", gap_s, "s")
