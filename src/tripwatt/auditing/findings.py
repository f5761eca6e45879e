"""Findings of an audit: one `Finding` for each thing that was wrong with a log, and what was done about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import wraps
from typing import Final, Literal

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray

Consequence = Literal["trimmed", "split", "set aside", "noted"]

MEASURED: Final = ("speed_m_s", "voltage_v", "current_a")
"""The signals that every sound log of a drive holds and that never stand still together while the car moves."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong with a log.

    Attributes
    ----------
    trip : str
        Id of the log, or of the leg that was cut out of it.
    from_s, to_s : float
        Log time [s] between which it lies.
    what : str
        What is wrong, with its figures.
    consequence : {"trimmed", "split", "set aside", "noted"}
        An end was cut off; a middle was cut out and the rest became legs; the drive is not used; the drive is used,
        and the samples that `what` names are blank.

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
    """Samples `first` to `last` (excluded) cannot be used; `first == last` cuts between two samples."""

    first: int
    last: int
    what: str


Change = tuple[str, FloatArray | None, Finding]
"""A column, its values with NaN in place of those that are removed (None = all stay), and the finding."""

Rule = Callable[[pd.DataFrame, str], Iterator[Change]]


def array(samples: pd.DataFrame, column: str) -> FloatArray:
    """A column as float64, all missing when the log lacks it."""
    if column not in samples.columns:
        return np.full(len(samples), np.nan)
    return samples[column].to_numpy(dtype=np.float64)


def has(samples: pd.DataFrame, column: str) -> bool:
    """Whether the column is there with at least one value."""
    return column in samples.columns and not bool(np.isnan(array(samples, column)).all())


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """First index and one past the last of every run of true values.

    Examples
    --------
    >>> runs(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def whole(samples: pd.DataFrame, trip_id: str, what: str, consequence: Consequence) -> Finding:
    """A finding on the whole of a log."""
    time = array(samples, "time_s")
    known = time[np.isfinite(time)]
    ends = (float(known[0]), float(known[-1])) if len(known) else (0.0, 0.0)
    return Finding(trip_id, *ends, what, consequence)


def between(
    samples: pd.DataFrame, trip_id: str, first: int, last: int, what: str, consequence: Consequence
) -> Finding:
    """A finding from one sample to another, both included."""
    time = array(samples, "time_s")
    return Finding(trip_id, float(time[first]), float(time[last]), what, consequence)


def blanking(rule: Rule) -> Callable[[pd.DataFrame, str], tuple[pd.DataFrame, list[Finding]]]:
    """A rule that gives the name of a column, the values that it keeps and a finding, as one that changes the samples."""

    @wraps(rule)
    def applied(samples: pd.DataFrame, trip_id: str) -> tuple[pd.DataFrame, list[Finding]]:
        changes = list(rule(samples, trip_id))
        kept = {name: values for name, values, _ in changes if values is not None}
        findings = [finding for _, _, finding in changes]
        return (samples.assign(**kept) if kept else samples), findings

    return applied
