"""Times of logs: texts as seconds, the order of day and month, and clocks that are set during a drive."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, running_sum
from tripwatt.sources.evidence import stamp_format
from tripwatt.units import SECONDS_PER_DAY, SECONDS_PER_HOUR

EARLIEST_YEAR, LATEST_YEAR = 1970, 2199
"""First and last year allowed for a time stamp of a log."""
FIRST_LOGGERS_S: Final = 1.1e9
"""Earliest plausible time [s since 1970], November 2004: an earlier time is of a clock that was not set yet."""
GAP_S: Final = 60.0
MOVING_M_S: Final = 1.0
LONGEST_STEP: Final = 10.0
"""A step that differs from a full hour by at most this many usual steps is a change to or from daylight saving time."""


def clock_only(form: str) -> bool:
    """Whether a time format has a time of day but no date."""
    return bool(form) and not re.search("%[djUVxcsDF]", form)


def seconds_of(texts: pd.Series, form: str) -> FloatArray:
    """Convert time stamps in a format (ISO 8601 if it is empty) to seconds since 1970; NaN if a text is no time stamp.

    Times of day without a date are counted from the first one, and a fall by more than half a day is a midnight; of minutes and
    seconds alone, as spreadsheets show them, a fall by more than half an hour is a full hour.

    Examples
    --------
    >>> seconds_of(pd.Series(["23:59:59", "00:00:01", "-"]), "%H:%M:%S")
    array([ 0.,  2., nan])
    """
    stamps = pd.to_datetime(texts, format=form or "ISO8601", utc=True, errors="coerce")
    if not clock_only(form):
        stamps = stamps.where((stamps.dt.year >= EARLIEST_YEAR) & (stamps.dt.year <= LATEST_YEAR))
    values = np.array((stamps - pd.Timestamp(0, tz="UTC")).dt.total_seconds(), dtype=np.float64)
    if not clock_only(form):
        return values
    known = np.isfinite(values)
    period = SECONDS_PER_DAY if re.search("%[HI]", form) else SECONDS_PER_HOUR
    full = running_sum(np.diff(values[known]) < -0.5 * period)
    values[known] += period * full - values[known][:1].sum()
    return values


def decide_format(files: Sequence[Sequence[str]], form: str) -> str:
    """The format of the time stamps of files, given an assumed format `form`; `files` has the texts of each file, in order.

    If most texts do not have the assumed format, the format is determined anew. If day and month may be in either order, a text
    with a day after the 12th decides; without one, the order in which the files follow each other in much less time.

    Examples
    --------
    >>> decide_format([["05/04/2024 08:00:00"], ["06/04/2024 08:00:00"], ["13/04/2024 08:00:00"]], "%m/%d/%Y %H:%M:%S")
    '%d/%m/%Y %H:%M:%S'
    """
    ends = [text for texts in files for text in (*texts[:3], *texts[-3:]) if text]
    forms = [form]
    if clock_only(form) or not ends:
        return form
    shown = pd.Series(ends, dtype=object)
    if np.isnan(seconds_of(shown, form)).mean() > 0.5:
        other = stamp_format(ends)
        forms = [form if other is None else other[0]]
    if {"%d", "%m"} <= set(re.findall("%.", forms[0])) and not forms[0].startswith("%Y"):
        forms.append(forms[0].replace("%d", "%_").replace("%m", "%d").replace("%_", "%m"))
    starts = [next((text for text in texts if text), "") for texts in files]
    fits, spans = [], []
    for candidate in forms:
        fits.append(float(np.isfinite(seconds_of(shown, candidate)).mean()))
        at = seconds_of(pd.Series(starts, dtype=object), candidate)
        spans.append(float(np.abs(np.diff(at[np.isfinite(at)])).sum()))
    # 0.3: the order of day and month is changed if this shortens the total time between files to below
    # this share
    if len(forms) > 1 and (fits[1] > fits[0] or (fits[1] == fits[0] and spans[1] < 0.3 * spans[0])):
        return forms[1]
    return forms[0]


def steady_clock(time: FloatArray, speed: FloatArray) -> tuple[FloatArray, list[str]]:
    """Correct times [s since 1970] for settings of the clock during a drive; return the times and codes of the corrections.

    A change by an hour of daylight saving time is removed. Times before the clock was set are shifted to end just before the first
    time after that. If rows are out of order, the code ``rows_sorted`` means that the caller has to sort them. If parts of the log
    overlap in time, this code is left out: the clock was set back, and the audit splits the log there.

    Examples
    --------
    >>> steady_clock(np.array([1.7e9 + 3599, 1.7e9 + 0, 1.7e9 + 1]), np.array([9.0, 9.0, 9.0]))[0] - 1.7e9
    array([3599., 3600., 3601.])
    """
    codes: list[str] = []
    if len(time) < 2:
        return time, codes
    time, step = time.copy(), np.diff(time)
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 1.0
    unset = np.flatnonzero((time[:-1] < FIRST_LOGGERS_S) & (time[1:] >= FIRST_LOGGERS_S))
    if len(unset) == 1 and bool((time[: int(unset[0]) + 1] < FIRST_LOGGERS_S).all()):
        last = int(unset[0])
        time[: last + 1] += time[last + 1] - time[last] - usual
        codes.append("clock_unset")
    step = np.diff(time)
    near = np.minimum(speed[:-1], speed[1:]) > MOVING_M_S
    back = (
        (step + SECONDS_PER_HOUR > 0.0)
        & (step + SECONDS_PER_HOUR <= max(GAP_S, LONGEST_STEP * usual))
        & (step < 0.0)
    )
    ahead = near & (step - SECONDS_PER_HOUR > 0.0) & (step - SECONDS_PER_HOUR <= LONGEST_STEP * usual)
    if 0 < back.sum() + ahead.sum() <= 2:
        time[1:] += SECONDS_PER_HOUR * (np.cumsum(back) - np.cumsum(ahead))
        codes.append("clock_daylight_saving")
    falls = np.flatnonzero(np.diff(time) < 0.0)
    if len(falls):
        breaks = int((np.diff(np.argsort(time, kind="stable")) != 1).sum())
        # 4: largest number of breaks in the order of rows, after sorting by time, per fall of the time:
        # with so few breaks, blocks of rows were exchanged and do not overlap in time
        if breaks <= 4 * len(falls) or len(falls) > LONGEST_STEP:
            codes.append("rows_sorted")
    return time, codes
