"""What the forecast protocol prepares of trips, against arithmetic that is written out here."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from tests.support.held_out import EXACT, NO, data, log_of

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.segments import SEGMENT_S
from tripwatt.study.evaluation.forecast_data import (
    _data_features,
    _with_distinct_ids,
    at_departure_only,
    measured_log,
)
from tripwatt.trips import Plan, Trip


class TestMeasuredLog:
    """360 V and 10 A are 1 Wh in each second, 10 m/s are 10 m."""

    def test_the_last_sample_that_is_not_after_each_second(self) -> None:
        log = measured_log(log_of([5.0, 5.4, 6.0, 6.9, 7.0, 9.2, 9.6]))
        # at 3 and 4 s the last one is still that of 2 s; the very last one ends the log
        assert log["time_s"].tolist() == pytest.approx([0.0, 1.0, 2.0, 4.6], **EXACT)
        assert log["observed_energy_wh"].tolist() == pytest.approx(log["time_s"].tolist(), **EXACT)
        assert log["distance_m"].tolist() == pytest.approx((10.0 * log["time_s"]).tolist(), **EXACT)
        assert list(log.columns) == ["time_s", "observed_energy_wh", "distance_m"]

    def test_steps(self) -> None:
        log = measured_log(log_of(np.arange(7.0)), step_s=2.5)
        assert log["time_s"].tolist() == [0.0, 2.0, 5.0, 6.0]

    def test_a_second_that_rounding_missed(self) -> None:
        """A sample up to a nanosecond after a second is that of the second."""
        log = measured_log(log_of([0.0, 0.5, 1.0 + 5e-10, 2.0]))
        assert log["time_s"].tolist() == pytest.approx([0.0, 1.0, 2.0], abs=1e-6)
        later = measured_log(log_of([0.0, 0.5, 1.0 + 2e-9, 2.0]))
        assert later["time_s"].tolist() == pytest.approx([0.0, 0.5, 2.0], abs=1e-6)

    def test_no_row_in_a_gap(self) -> None:
        current = [10.0, 10.0, NO, NO, 10.0, NO]
        log = measured_log(log_of(np.arange(6.0), current_a=current, soc=[0.5, 0.49, 0.48, 0.47, 0.46, 0.45]))
        assert log["time_s"].tolist() == [0.0, 1.0, 4.0]
        assert log["observed_energy_wh"].tolist() == pytest.approx([0.0, 1.0, 4.0], **EXACT)
        assert log["soc"].tolist() == [0.5, 0.49, 0.46]

    def test_changing_speed_and_a_counted_energy(self) -> None:
        rows = {
            "time_s": [0.0, 1.0, 3.0],
            "speed_m_s": [0.0, 10.0, 20.0],
            "observed_energy_wh": [5.0, 6.0, 8.0],
        }
        log = measured_log(Trip.from_samples("t", pd.DataFrame(rows)))
        assert log["distance_m"].tolist() == [0.0, 5.0, 35.0]
        assert log["observed_energy_wh"].tolist() == [0.0, 1.0, 3.0]
        with pytest.raises(InvalidInput, match="no measured energy"):
            measured_log(Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": 1.0})))


def test_only_the_departure_is_left_of_a_trip() -> None:
    samples = {"soc": [0.5, 0.4], "heating_power_w": [1.0, 2.0], "ambient_temperature_degc": [NO, NO]}
    trip = log_of([0.0, 1.0], elevation_m=[500.0, 510.0], **samples)
    known = at_departure_only(trip).samples
    assert known["soc"].tolist() == [0.5, 0.5]
    assert known["elevation_m"].tolist() == [500.0, 510.0]
    assert known["current_a"].tolist() == [10.0, 10.0]
    assert "heating_power_w" not in known
    if "ambient_temperature_degc" in known:
        assert known["ambient_temperature_degc"].isna().all()


def test_trips_of_one_name_get_marks() -> None:
    trips = [dataclasses.replace(log_of([0.0, 1.0]), trip_id=name) for name in ("a", "a", "b", "a")]
    assert [t.trip_id for t in _with_distinct_ids(trips)] == ["a", "a'", "b", "a''"]


class TestData:
    def test_take(self) -> None:
        some = data(1, 2, 1).take(np.array([0, 2]))
        assert some.plans == ("plan 0", "plan 2")
        assert some.logs == ("log 0", "log 2")
        assert some.table.trip_ids == ("t0", "t2")
        assert some.segments.features["row"].tolist() == [0.0, 3.0]
        assert some.data_features["seen"].tolist() == [0.0, 3.0]
        assert some.data_features.index.tolist() == [0, 1]
        assert len(some) == 2

    def test_slim(self) -> None:
        slim = data(1, 2).slim()
        assert (slim.plans, slim.logs, len(slim.table)) == ((), (), 0)
        assert len(slim.segments) == 2


SPEED = np.concatenate([np.linspace(0.0, 15.0, 31), np.full(60, 15.0)])


TIME = np.arange(91.0)


def table_for(features) -> SegmentTable:
    frame = pd.DataFrame(dict.fromkeys(features, np.zeros(3)))
    return SegmentTable(("t",), np.array([0, 3]), frame, np.full(3, SEGMENT_S / 3600.0), np.zeros(3))


def features_of(**road):
    from tripwatt.study.evaluation.forecast_data import DATA_FEATURES

    plan = Plan.from_trace("t", pd.DataFrame({"time_s": TIME, "speed_m_s": SPEED, **road}))
    own = ("climb_m_s", "kinetic_m2_s3")
    return _data_features(table_for([n for n in DATA_FEATURES if n not in own]), [plan])


def test_climb_from_a_grade():
    climb = features_of(grade=0.04)["climb_m_s"]
    # 4 % of the distance, each second at its own speed
    distance = np.concatenate(([0.0], np.cumsum(SPEED[1:])))
    expected = 0.04 * np.diff(distance[[0, 30, 60, 90]]) / SEGMENT_S
    np.testing.assert_allclose(climb, expected, rtol=1e-9)


def test_climb_from_heights_and_without_a_road():
    np.testing.assert_allclose(features_of(elevation_m=100.0 + 0.5 * TIME)["climb_m_s"], 0.5, rtol=1e-9)
    assert features_of()["climb_m_s"].isna().all()


def test_kinetic_energy_of_a_start():
    kinetic = features_of()["kinetic_m2_s3"]
    assert kinetic[0] == pytest.approx(0.5 * 15.0**2 / SEGMENT_S, rel=1e-9)
    assert kinetic[1:].tolist() == pytest.approx([0.0, 0.0], abs=1e-12)
