"""Findings of an audit: a `Finding` states one thing that is wrong with a log, and what was done about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Final, Literal

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, IntArray

Consequence = Literal["trimmed", "split", "set aside", "noted"]

MEASURED: Final = ("speed_m_s", "voltage_v", "current_a")
"""Signals that every sound log of a drive has, and that never all stay constant while the car moves."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong with a log.

    Attributes
    ----------
    trip : str
        Id of the log, or of the leg that was cut out of it.
    from_s, to_s : float
        Start and end of the affected part, on the clock of the log [s].
    what : str
        What is wrong, with its figures.
    consequence : {"trimmed", "split", "set aside", "noted"}
        "trimmed": an end was cut off. "split": a middle part was cut out and the rest became legs. "set aside": the drive is
        not used. "noted": the drive is used; values that `what` calls removed are blank.

    Examples
    --------
    >>> print(Finding("A", 10.0, 25.5, "every signal frozen", "trimmed"))
    A, 10.0 to 25.5 s: every signal frozen (trimmed)
    """

    trip: str
    from_s: float
    to_s: float
    what: str
    consequence: Consequence

    def __str__(self) -> str:
        return f"{self.trip}, {self.from_s:.1f} to {self.to_s:.1f} s: {self.what} ({self.consequence})"


@dataclass(frozen=True, slots=True)
class Cut:
    """Samples `first` to `stop - 1` that cannot be used; if `first == stop`, a cut between two samples."""

    first: int
    stop: int
    what: str


Change = tuple[str, FloatArray | None, Finding]
"""Name of a column, its values with NaN for removed ones (None if no value is removed), and the finding."""

Rule = Callable[[pd.DataFrame, str], Iterator[Change]]


def array(samples: pd.DataFrame, column: str) -> FloatArray:
    """Return a column as float64; all NaN if the log lacks the column."""
    if column not in samples.columns:
        return np.full(len(samples), np.nan)
    return samples[column].to_numpy(dtype=np.float64)


def has(samples: pd.DataFrame, column: str) -> bool:
    """Return whether the column exists and has at least one value."""
    return column in samples.columns and not bool(np.isnan(array(samples, column)).all())


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Return the first index, and the one after the last, of every run of true values.

    Examples
    --------
    >>> runs(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def whole(samples: pd.DataFrame, trip_id: str, what: str, consequence: Consequence) -> Finding:
    """Make a finding about a whole log."""
    time = array(samples, "time_s")
    known = time[np.isfinite(time)]
    ends = (float(known[0]), float(known[-1])) if len(known) else (0.0, 0.0)
    return Finding(trip_id, *ends, what, consequence)


def between(
    samples: pd.DataFrame, trip_id: str, rows: Sequence[int] | IntArray, what: str, consequence: Consequence
) -> Finding:
    """Make a finding about the time from the first to the last of some rows."""
    time = array(samples, "time_s")
    return Finding(trip_id, float(time[rows[0]]), float(time[rows[-1]]), what, consequence)


def blanking(rule: Rule) -> Callable[[pd.DataFrame, str], tuple[pd.DataFrame, list[Finding]]]:
    """Decorate a rule that yields a `Change` for each affected column.

    The decorated rule applies the changes, and returns the new samples and the findings.
    """

    @wraps(rule)
    def applied(samples: pd.DataFrame, trip_id: str) -> tuple[pd.DataFrame, list[Finding]]:
        changes = list(rule(samples, trip_id))
        blanked = {name: values for name, values, _ in changes if values is not None}
        findings = [finding for _, _, finding in changes]
        return (samples.assign(**blanked) if blanked else samples), findings

    return applied
