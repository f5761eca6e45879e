"""Gaps in the samples of a planned drive: short gaps are bridged and flagged, longer gaps are faults."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault
from tripwatt.trips.columns import LINK_COLUMNS
from tripwatt.trips.flags import Flag

MAX_DURATION_S: Final = LINK_COLUMNS["travel_time_s"].maximum
"""Longest trip [s]: no battery lasts longer without a charge; time and memory of a forecast grow with the square of the duration."""

MAX_SAMPLES: Final = 2_000_000
"""Most samples of one trip: 48 h at 10 Hz have 1,728,000."""

SHORTEST_GAP_S: Final = 10.0
"""A longer step between two samples is a gap [s]: in this time the power of a car can change completely, so a straight line is a guess."""

LONGEST_GAP_S: Final = 60.0
"""Longest gap of a speed trace that is bridged [s]; the audit splits a log at a longer one, because neither its energy nor its road is known."""


def time_faults(time_s: FloatArray, where: str) -> Iterator[Fault]:
    """Yield the reasons why increasing times cannot be those of the samples of one planned trip. O(samples).

    Parameters
    ----------
    time_s : ndarray, shape (samples,)
        Increasing times [s].
    where : str
        Name of the samples in messages.

    Yields
    ------
    Fault
        Too many samples, too long a duration, or a gap longer than `LONGEST_GAP_S`.

    Examples
    --------
    >>> [fault.what for fault in time_faults(np.array([0.0, 1.0, 43200.0]), "samples")]
    ['gap in the samples']
    >>> print(*time_faults(np.arange(0.0, 9e5, 1000.0), "samples"))
    duration out of range: samples, column 'time_s': got 899000 s; allowed: at most 172800 s; times look like milliseconds...
    """
    if len(time_s) > MAX_SAMPLES:
        yield Fault("too many samples", where, f"{len(time_s)}", f"at most {MAX_SAMPLES}")
    step = np.diff(time_s)
    span = float(time_s[-1] - time_s[0]) if len(time_s) else 0.0
    gaps = np.flatnonzero(step > LONGEST_GAP_S)
    # 50.0: median step of the times from which they look like milliseconds: 50 ms at 20 Hz
    looks_ms = len(step) > 1 and float(np.median(step)) >= 50.0
    fix = "times look like milliseconds: give time_s in seconds" if looks_ms else ""
    if span > MAX_DURATION_S:
        place = f"{where}, column 'time_s'"
        yield Fault("duration out of range", place, f"{span:g} s", f"at most {MAX_DURATION_S:g} s", fix)
    elif len(gaps):
        k = int(gaps[0])
        others = f" (one of {len(gaps)} gaps)" if len(gaps) > 1 else ""
        place = f"{where}, column 'time_s', row {k + 2}"
        got = f"no samples for {step[k]:g} s{others}"
        fix = fix or "give the whole trace, or the planned route as links"
        at, allowed = ("time_s", k + 1), f"at most {LONGEST_GAP_S:g} s"
        yield Fault("gap in the samples", place, got, allowed, fix, at=at)


def gap_flags(time_s: FloatArray) -> tuple[Flag, ...]:
    """Return a flag with the total time of the gaps of a speed trace [s]. O(samples).

    Parameters
    ----------
    time_s : ndarray, shape (samples,)
        Increasing times [s].

    Returns
    -------
    tuple of Flag
        One flag `gap_bridged` with the sum of all steps longer than `SHORTEST_GAP_S`; empty without such a step.

    Examples
    --------
    >>> gap_flags(np.array([0.0, 1.0, 31.0, 32.0]))
    (Flag(code='gap_bridged', subject='speed_m_s', value=30.0, unit='s'),)
    >>> gap_flags(np.arange(0.0, 60.0, 10.0))
    ()
    """
    step = np.diff(time_s)
    gaps = step[step > SHORTEST_GAP_S]
    return (Flag("gap_bridged", "speed_m_s", float(gaps.sum()), "s"),) if len(gaps) else ()
