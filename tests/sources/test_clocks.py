"""Time stamps: day and month by all files, hours of daylight saving time, clocks that were not set."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripwatt.sources.clocks import decide_format, steady_clock

START = 1.7e9
FORMS = ("%m/%d/%Y %H:%M:%S", "%d/%m/%Y %H:%M:%S")


@given(
    st.dates(pd.Timestamp("2010-01-01").date(), pd.Timestamp("2030-01-01").date()),
    st.sampled_from(FORMS),
    st.sampled_from(FORMS),
)
def test_files_of_successive_days_tell_day_and_month(first, written: str, assumed: str) -> None:
    days = [pd.Timestamp(first) + pd.Timedelta(days=k) for k in range(6)]
    files = [[day.strftime(written)] for day in days]
    alike = all(day.strftime(FORMS[0]) == day.strftime(FORMS[1]) for day in days)
    assert alike or decide_format(files, assumed) == written


@pytest.mark.parametrize("at", [1, 40, 99])
@pytest.mark.parametrize("hour", [-3600.0, 3600.0])
def test_an_hour_of_daylight_saving_time_is_taken_out(at: int, hour: float) -> None:
    true = START + np.arange(100.0)
    clock = true + hour * (np.arange(100) >= at)
    time, codes = steady_clock(clock, np.full(100, 15.0))
    assert time == pytest.approx(true)
    assert codes == ["clock_daylight_saving"]


def test_a_stop_of_an_hour_stays_one() -> None:
    clock = START + np.r_[np.arange(50.0), 3601.0 + 50.0 + np.arange(50.0)]
    time, codes = steady_clock(clock, np.zeros(100))
    assert (np.ptp(time), codes) == (np.ptp(clock), [])


def test_rows_before_the_clock_was_set_follow_on() -> None:
    clock = np.r_[946_684_800.0 + np.arange(5.0), START + np.arange(5.0)]
    time, codes = steady_clock(clock, np.full(10, 9.0))
    assert time == pytest.approx(START + np.arange(-5.0, 5.0))
    assert codes == ["clock_unset"]


@given(st.integers(5, 60), st.integers(1, 20))
def test_blocks_in_another_order_are_sorted(first: int, length: int) -> None:
    clock = START + np.arange(100.0)
    swapped = np.r_[
        clock[:first],
        clock[first + length : first + 2 * length],
        clock[first : first + length],
        clock[first + 2 * length :],
    ]
    assert steady_clock(swapped, np.full(100, 9.0))[1] == ["rows_sorted"]


def test_a_clock_that_was_set_back_is_not_sorted_into_itself() -> None:
    clock = START + np.r_[np.arange(100.0), 30.5 + np.arange(100.0)]
    assert steady_clock(clock, np.full(200, 9.0))[1] == []
