"""Gaps and durations of a drive to come: bridged and flagged, or refused."""

import numpy as np
import pandas as pd
import pytest
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.trips import Flag, Plan, bin_means, gap_flags, time_faults
from tripwatt.trips.messages import message


def drive(time) -> pd.DataFrame:
    return pd.DataFrame({"time_s": np.asarray(time, dtype=np.float64), "speed_m_s": 10.0})


def without(first: float, last: float, end: float = 1800.0) -> np.ndarray:
    """Seconds of a drive of which a part is missing."""
    time = np.arange(end + 1)
    return time[(time <= first) | (time >= last)]


def test_a_short_gap_is_bridged_and_flagged() -> None:
    plan = Plan.from_samples(drive(without(100.0, 160.0)))
    assert plan.flags == (Flag("gap_bridged", "speed_m_s", 60.0, "s"),)
    assert message(plan.flags[0]) == "no samples for 60 s in all: speed is interpolated over the gaps"
    assert plan.distance_m == pytest.approx(18_000.0, rel=1e-3)
    assert Plan.from_samples(drive(without(100.0, 110.0))).flags == ()
    assert gap_flags(without(100.0, 111.0)) == (Flag("gap_bridged", "speed_m_s", 11.0, "s"),)


def test_a_longer_gap_is_refused_with_its_place() -> None:
    with pytest.raises(InvalidInput) as caught:
        Plan.from_samples(drive(without(100.0, 161.0)), "commute")
    assert str(caught.value) == (
        "gap in the samples: commute, column 'time_s', row 102: got no samples for 61 s; allowed: at most 60 s; "
        "give the whole trace, or the planned route as links"
    )
    time = np.concatenate((np.arange(10.0), 200.0 + np.arange(10.0), 400.0 + np.arange(10.0)))
    assert "no samples for 191 s (one of 2 gaps)" in str(next(time_faults(time, "x")))


@pytest.mark.parametrize(
    "time",
    [without(150.0, 1650.0), [0.0, 900.0, 1800.0], [0.0, 1.0, 43_200.0]],
    ids=["25 min", "three", "12 h"],
)
def test_most_of_a_trip_cannot_be_missing(time) -> None:
    refuses("gap in the samples", Plan.from_samples, drive(time))


def test_milliseconds_are_recognised() -> None:
    with pytest.raises(
        InvalidInput, match=r"got 1.461e.06 s; allowed: at most 172800 s; times look like milli"
    ):
        Plan.from_samples(drive(1000.0 * np.arange(1462)))
    with pytest.raises(InvalidInput, match=r"gap in the samples.*times look like milliseconds"):
        Plan.from_samples(drive(100.0 * np.arange(100)))
    with pytest.raises(InvalidInput) as caught:
        Plan.from_samples(drive([0.0, 1.0, 2.0, 172_801.0]))
    assert "duration out of range" in str(caught.value)
    assert "milliseconds" not in str(caught.value)
    steps = [fault.fix for fault in time_faults(np.array([0.0, 49.0, 98.0, 200.0]), "x")]
    assert steps == ["give the whole trace, or the planned route as links"]


def test_a_trip_has_a_longest_duration_and_most_samples() -> None:
    assert not list(time_faults(60.0 * np.arange(2881), "x"))
    assert [f.what for f in time_faults(60.0 * np.arange(2882), "x")] == ["duration out of range"]
    many = np.linspace(0.0, 1000.0, 2_000_001)
    assert [f.what for f in time_faults(many, "x")] == ["too many samples"]
    assert not list(time_faults(many[1:], "x"))


def test_no_plan_and_no_table_of_bins_takes_any_amount_of_memory() -> None:
    refuses("duration out of range: a: got 172801 s", Plan.from_trace, "a", drive([0.0, 172_801.0]))
    Plan.from_trace("a", drive([0.0, 172_800.0]))
    columns = {"time_s": np.array([0.0, 172_801.0]), "speed_m_s": np.full(2, 10.0)}
    refuses("duration out of range: a: got 172801 s", Plan.from_trace, "a", columns)
    refuses("value out of range", Plan.from_trace, "a", columns | {"speed_m_s": np.full(2, -1.0)})
    columns["time_s"] = np.array([0.0, 60.0])
    pd.testing.assert_frame_equal(
        Plan.from_trace("a", columns).samples, Plan.from_trace("a", drive([0.0, 60.0])).samples
    )
    with pytest.raises(InvalidInput, match=r"1e.07 s in steps of 1 s; allowed: at most 10000000 steps"):
        bin_means(np.array([0.0, 1e7]), {"speed_m_s": np.zeros(2)}, 1.0)
