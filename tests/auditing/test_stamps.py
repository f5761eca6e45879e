"""Rules on time, each threshold from both sides."""

import numpy as np
import pandas as pd
from tests.auditing.findings import NO, told

from tripwatt.auditing.findings import Cut
from tripwatt.auditing.stamps import gap_cuts, gap_findings, longest_increasing, mend_stamps


def mended(stamps):
    samples = pd.DataFrame({"time_s": np.array(stamps, dtype=float), "row": np.arange(len(stamps))})
    kept, cuts, findings = mend_stamps(samples, "t")
    return kept["row"].tolist(), cuts, told(findings)


def test_stamps_that_increase_are_left_alone():
    assert mended([1.0, 2.0, 4.0]) == ([0, 1, 2], [], [])
    assert mended([5.0]) == ([0], [], [])
    assert mended([]) == ([], [], [])


def test_samples_without_a_stamp_are_left_out():
    words = "2 samples without a time were left out"
    assert mended([NO, 2.0, NO, 4.0]) == ([1, 3], [], [(2.0, 4.0, "noted", words)])


def test_samples_with_the_stamp_before_are_left_out():
    words = "3 samples have the time of the sample before and were left out"
    assert mended([1.0, 1.0, 2.0, 3.0, 3.0, 3.0]) == ([0, 2, 3], [], [(1.0, 3.0, "noted", words)])


def test_a_hundredth_of_falling_stamps_are_strays():
    stamps = np.arange(100.0)
    stamps[60] = 7.5
    rows = [k for k in range(100) if k != 60]
    words = "time decreases: 1 samples were left out"
    assert mended(stamps) == (rows, [], [(7.5, 7.5, "noted", words)])
    two = np.arange(200.0)
    two[[60, 150]] = [7.5, 3.5]
    words = "time decreases: 2 samples were left out"
    assert mended(two)[2] == [(3.5, 7.5, "noted", words)]


def test_a_clock_that_is_set_back_cuts_between_two_samples():
    stamps = np.concatenate((np.arange(60.0), np.arange(20.0, 59.0)))
    rows, cuts, findings = mended(stamps)
    assert rows == list(range(99))
    assert cuts == [Cut(60, 60, "time decreases from 59 to 20 s")]
    assert findings == []
    one_of_99 = np.arange(99.0)
    one_of_99[60] = 7.5
    assert mended(one_of_99)[1] == [Cut(60, 60, "time decreases from 59 to 7.5 s")]


def test_the_longest_increasing_part():
    assert longest_increasing(np.array([5.0, 1.0, 2.0, 3.0, 9.0, 4.0, 5.0])).tolist() == [1, 2, 3, 5, 6]
    assert longest_increasing(np.array([3.0, 3.0, 4.0, 4.0])).tolist() in ([0, 2], [1, 2], [1, 3], [0, 3])
    assert longest_increasing(np.array([2.0, 1.0, 0.0])).tolist() == [2]
    assert longest_increasing(np.array([0.0, 8.0, 1.0, 9.0, 2.0, 3.0])).tolist() == [0, 2, 4, 5]


def stamped(*stamps):
    return pd.DataFrame({"time_s": np.array(stamps, dtype=float)})


def test_a_gap_of_more_than_a_minute_splits():
    assert list(gap_cuts(stamped(5.0, 65.0, 66.0))) == []
    assert list(gap_cuts(stamped(4.0, 5.0, 66.0, 67.0))) == [Cut(2, 2, "no samples for 61.0 s")]


def test_a_gap_of_more_than_ten_seconds_and_five_steps_is_filled():
    def gaps(*steps):
        return told(gap_findings(stamped(*np.cumsum([3.0, *steps])), "t"))

    assert gaps(1, 1, 10, 1, 1) == []
    words = "1 gaps of up to 11.0 s, 11.0 s in all, filled by linear interpolation"
    assert gaps(1, 1, 11, 1, 1) == [(5.0, 16.0, "noted", words)]
    assert gaps(4, 4, 20, 4, 4) == []
    assert len(gaps(4, 4, 21, 4, 4)) == 1
    assert gaps(1, 1, 6, 1, 1) == []
    words = "2 gaps of up to 12.0 s, 23.0 s in all, filled by linear interpolation"
    assert gaps(1, 11, 1, 12, 1) == [(4.0, 28.0, "noted", words)]
    assert gaps() == []
