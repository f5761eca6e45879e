"""Start and end of a trip by documented thresholds, and the table of its samples."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tripwatt.arrays import hold_last
from tripwatt.server.cars import live_trip
from tripwatt.server.cars.live_trip import (
    BEFORE_S,
    HOLD_S,
    MOVING_M_S,
    PARKED_S,
    SILENCE_S,
    STANDING_S,
    LiveTrip,
    TripFinder,
)
from tripwatt.server.cars.telemetry import Sample

T0 = 1_700_000_000.0


def at(time_s: float, speed: float | None = None, **more: float | bool) -> Sample:
    flags = {name: bool(more.pop(name)) for name in ("charging", "parked") if name in more}
    values = {name: float(value) for name, value in more.items()}
    return Sample(T0 + time_s, values if speed is None else {"speed_m_s": speed, **values}, **flags)


def fed(*samples: Sample) -> tuple[TripFinder, list[LiveTrip]]:
    finder, ended = TripFinder(), []
    for sample in samples:
        done = finder.add(sample)
        if done is not None:
            ended.append(done)
    return finder, ended


def test_a_trip_starts_with_the_first_motion_and_the_standstill_before_it() -> None:
    standing = [at(10.0 * k, 0.99 * MOVING_M_S) for k in range(40)]
    finder, _ = fed(*standing)
    assert finder.trip is None
    finder.add(at(400.0, MOVING_M_S))
    assert finder.trip is not None
    assert finder.trip.start_s == T0 + 400.0 - BEFORE_S
    assert len(finder.trip) == BEFORE_S / 10.0 + 1
    assert len(finder.before) == 0


@pytest.mark.parametrize(("parked", "limit"), [(False, STANDING_S), (True, PARKED_S)])
def test_a_standstill_ends_a_trip_at_its_last_motion(parked: bool, limit: float) -> None:
    finder, ended = fed(at(0.0, 10.0), at(1.0, 10.0), at(2.0, 0.0), at(limit + 0.5, 0.0, parked=parked))
    assert ended == []
    last = finder.add(at(limit + 1.0, 0.0, parked=parked))
    assert last is not None
    assert finder.trip is None
    assert last.moved_s == T0 + 1.0
    assert last.columns(until_s=last.moved_s)["time_s"].tolist() == [0.0, 1.0]
    assert [sample.time_s - T0 for sample in finder.before] == [limit + 1.0]


def test_a_gap_is_no_standstill() -> None:
    _, ended = fed(at(0.0, 10.0), at(400.0, 0.0), at(401.0, 10.0))
    assert ended == [], "the car drove on, and nobody saw it"
    _, ended = fed(at(0.0, 10.0), at(400.0, 0.0), at(400.0 + STANDING_S - HOLD_S, 0.0))
    assert len(ended) == 1


def test_a_late_sample_has_its_place_in_a_gap() -> None:
    trip = LiveTrip([at(float(k), 10.0) for k in (0, 1, 2, 3, 10, 11, 12, 13)])
    whole = trip.distance_m
    assert [trip.insert(at(t, 10.0, soc=0.5)) for t in (2.5, 3.0, 3.5, -1.0, 14.0, 0.0)] == [
        False, False, True, False, False, False,
    ]  # fmt: skip
    assert not trip.insert(at(10.0, 10.0, soc=0.5)), "its time is taken, though there is a gap before it"
    assert trip.insert(at(6.0))
    assert trip.distance_m == pytest.approx(whole)
    assert trip.insert(at(5.0, 20.0))
    assert trip.distance_m > whole
    table = trip.columns()
    assert table["time_s"].tolist() == [0.0, 1.0, 2.0, 3.0, 3.5, 5.0, 6.0, 10.0, 11.0, 12.0, 13.0]
    assert np.isfinite(table["soc"]).sum() == 1
    assert trip.has(at(3.5, 10.0, soc=0.5))
    assert not trip.has(at(3.5, 10.0, soc=0.6))
    assert not trip.has(at(3.5, 10.0, cabin_temperature_degc=20.0))
    assert not trip.has(at(99.0, 10.0))


def test_a_late_motion_is_the_last_one() -> None:
    trip = LiveTrip([at(float(k), 10.0) for k in range(5)] + [at(float(k), 0.0) for k in range(20, 30)])
    assert trip.insert(at(15.0, 5.0))
    assert (trip.moved_s, trip.stood_s) == (T0 + 15.0, T0 + 15.0)
    trip.shift_times(-5.0)
    assert (trip.start_s, trip.moved_s, trip.last_s, trip.stood_s) == (
        T0 - 5.0,
        T0 + 10.0,
        T0 + 24.0,
        T0 + 10.0,
    )


def test_a_sample_without_speed_is_neither_motion_nor_standstill() -> None:
    _, ended = fed(at(0.0, 10.0), *(at(float(k), displayed_soc=0.5) for k in range(1, 590)))
    assert ended == []


def test_silence_ends_a_trip_and_the_next_motion_starts_another() -> None:
    finder, ended = fed(at(0.0, 10.0), at(SILENCE_S - 0.5, 10.0), at(2.0 * SILENCE_S - 0.5, 10.0))
    assert [trip.start_s - T0 for trip in ended] == [0.0]
    assert finder.trip is not None
    assert finder.trip.start_s == T0 + 2.0 * SILENCE_S - 0.5


def test_a_car_that_is_charged_is_on_no_trip() -> None:
    finder, ended = fed(at(0.0, 0.0), at(1.0, 10.0), at(2.0, 0.0, charging=True), at(3.0, 5.0, charging=True))
    assert len(ended) == 1
    assert (finder.trip, len(finder.before)) == (None, 0)
    assert [t - T0 for t in (ended[0].start_s, ended[0].last_s)] == [0.0, 1.0]


def test_a_trip_has_a_longest_duration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_trip, "MAX_DURATION_S", 100.0)
    _, ended = fed(*(at(float(k), 10.0) for k in range(250)))
    assert [trip.last_s - trip.start_s for trip in ended] == [99.0, 99.0]


def test_the_end_of_a_trip_can_be_called() -> None:
    finder, _ = fed(at(0.0, 10.0))
    trip = finder.trip
    assert finder.end() is trip
    assert finder.end() is None


def test_the_table_has_every_column_and_is_timed_from_the_departure() -> None:
    trip = LiveTrip([at(0.0, 0.0), at(1.0, 10.0, displayed_soc=0.5)])
    table = trip.columns([at(2.0, 12.0, soc=0.4), at(3.0, 5.0)])
    assert table["time_s"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert table["speed_m_s"].tolist() == [0.0, 10.0, 12.0, 5.0]
    np.testing.assert_array_equal(table["displayed_soc"], [math.nan, 0.5, math.nan, math.nan])
    np.testing.assert_array_equal(table["soc"], [math.nan, math.nan, 0.4, math.nan])
    later = trip.columns([at(2.0, 12.0)], since_s=T0 + 1.0)
    assert later["time_s"].tolist() == [0.0, 1.0]
    assert len(trip) == 2, "what waits is no part of the trip"


def test_what_waits_counts_up_to_charging() -> None:
    trip = LiveTrip([at(0.0, 10.0)])
    table = trip.columns([at(1.0, 0.0), at(2.0, 0.0, charging=True), at(3.0, 0.0)])
    assert table["time_s"].tolist() == [0.0, 1.0]


def test_a_speed_is_held_for_ten_seconds() -> None:
    trip = LiveTrip([at(0.0, 10.0), at(HOLD_S, soc=0.4), at(HOLD_S + 1.0, soc=0.4), at(HOLD_S + 2.0, 8.0)])
    assert trip.columns()["speed_m_s"].tolist() == [10.0, 10.0, 8.0]
    assert hold_last(np.array([0.0]), np.array([math.nan]), HOLD_S).tolist() != [0.0]
    assert len(trip.columns(since_s=T0 + 100.0)["time_s"]) == 0


def test_the_distance_is_the_trapezoid_of_the_speed_without_gaps() -> None:
    trip = LiveTrip([at(0.0, 0.0), at(2.0, 10.0), at(4.0), at(102.0, 20.0)])
    assert trip.distance_m == 0.5 * 10.0 * 2.0 + 0.5 * 30.0 * HOLD_S


def test_memory_is_bounded_and_the_whole_trip_stays_covered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_trip, "MAX_SAMPLES", 100)
    trip = LiveTrip([at(0.0, 10.0)])
    for k in range(1, 5000):
        trip.append(at(float(k), 10.0, soc=0.5))
        assert len(trip) <= 100
    time = trip.columns()["time_s"]
    assert len(time) > 50
    assert (time[0], trip.last_s - T0) == (0.0, 4999.0)
    assert time[-1] > 4900.0
    assert np.diff(time).max() < 5000.0 / 25.0
    assert trip.distance_m == pytest.approx(49_990.0)
