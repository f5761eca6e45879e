"""Rules on time stamps: missing, repeated and decreasing stamps, and gaps."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.auditing.findings import Cut, Finding, array, between, whole
from tripwatt.trips.gaps import LONGEST_GAP_S, SHORTEST_GAP_S

STRAY_SHARE: Final = 0.01
"""Largest share of samples with a decreasing stamp that are left out as strays; a larger one means that the clock was set back."""


def mend_stamps(samples: pd.DataFrame, trip_id: str) -> tuple[pd.DataFrame, list[Cut], list[Finding]]:
    """Make the stamps increase inside each part; return the samples, the cuts between the parts and the findings.

    O(samples), or O(samples log samples) if stamps decrease.
    """
    findings: list[Finding] = []
    time = array(samples, "time_s")
    known = np.isfinite(time)
    if not known.all():
        what = f"{int((~known).sum())} samples without a time were left out"
        findings.append(whole(samples, trip_id, what, "noted"))
        samples, time = samples[known].reset_index(drop=True), time[known]
    repeated = np.append(False, np.diff(time) == 0)[: len(time)]
    if repeated.any():
        what = f"{int(repeated.sum())} samples have the time of the sample before and were left out"
        where = time[repeated]
        findings.append(Finding(trip_id, float(where.min()), float(where.max()), what, "noted"))
        samples, time = samples[~repeated].reset_index(drop=True), time[~repeated]
    if bool(np.all(np.diff(time) > 0)):
        return samples, [], findings
    kept = longest_increasing(time)
    strays = len(time) - len(kept)
    if strays <= STRAY_SHARE * len(time):
        lost = np.setdiff1d(np.arange(len(time)), kept)
        what = f"time decreases: {strays} samples were left out"
        findings.append(Finding(trip_id, float(time[lost].min()), float(time[lost].max()), what, "noted"))
        return samples.iloc[kept].reset_index(drop=True), [], findings
    back = np.flatnonzero(np.diff(time) <= 0) + 1
    cuts = [Cut(int(i), int(i), f"time decreases from {time[i - 1]:g} to {time[i]:g} s") for i in back]
    return samples, cuts, findings


def longest_increasing(values: FloatArray) -> IntArray:
    """Return the indices of the longest strictly increasing subsequence (patience sorting, O(n log n))."""
    listed = values.tolist()
    tails: list[int] = []  # by length of a subsequence: the index of the smallest value that ends one
    before = np.full(len(values), -1, dtype=np.int64)
    for i, value in enumerate(listed):
        place = bisect_left(tails, value, key=listed.__getitem__)
        before[i] = tails[place - 1] if place else -1
        tails[place : place + 1] = [i]
    chain = []
    i = tails[-1]
    while i >= 0:
        chain.append(i)
        i = int(before[i])
    return np.array(chain[::-1], dtype=np.int64)


def gap_cuts(samples: pd.DataFrame) -> Iterator[Cut]:
    """Cut the log at every gap longer than `LONGEST_GAP_S`; another drive begins there."""
    time = array(samples, "time_s")
    step = np.diff(time)
    for i in np.flatnonzero(step > LONGEST_GAP_S):
        yield Cut(int(i) + 1, int(i) + 1, f"no samples for {step[i]:.1f} s")


def gap_findings(samples: pd.DataFrame, trip_id: str) -> Iterator[Finding]:
    """Report gaps that are bridged: longer than `SHORTEST_GAP_S` and than five usual steps of the log."""
    time = array(samples, "time_s")
    step = np.diff(time)
    if not len(step):
        return
    gaps = np.flatnonzero((step > SHORTEST_GAP_S) & (step > 5.0 * float(np.median(step))))
    if len(gaps):
        longest, total = f"{step[gaps].max():.1f} s", f"{step[gaps].sum():.1f} s in all"
        what = f"{len(gaps)} gaps of up to {longest}, {total}, filled by linear interpolation"
        yield between(samples, trip_id, (gaps[0], gaps[-1] + 1), what, "noted")
