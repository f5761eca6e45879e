"""How everything here is timed: the median of repeated runs, beside a reference loop in the same run."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tools import DATA

RUNS = 5


@dataclass(frozen=True)
class Row:
    """One figure and its bounds; NaN where it is not measured, and `note` names the reason or what it stands beside."""

    name: str
    value: float
    unit: str = ""
    least: float = -math.inf
    most: float = math.inf
    note: str = ""
    peer: str | None = None
    peer_value: float | None = None
    ratio: float | None = None

    @property
    def bounds(self) -> str:
        """For people; empty without any."""
        ends = (("≥", self.least), ("≤", self.most))
        return ", ".join(f"{sign} {end:g}" for sign, end in ends if math.isfinite(end))

    @property
    def met(self) -> bool | None:
        """Whether the figure is within its bounds; None where it has none, or is not measured."""
        return None if math.isnan(self.value) or not self.bounds else self.least <= self.value <= self.most

    @property
    def verdict(self) -> str:
        """For people."""
        return {True: "yes", False: "NO", None: "not measured" if math.isnan(self.value) else ""}[self.met]

    @property
    def figure(self) -> str:
        """The value with its unit."""
        return f"{self.value:,.4g} {self.unit}".strip()

    @property
    def cells(self) -> str:
        """As a row of Markdown; what a figure stands beside replaces its bounds, which are no claim then."""
        met = "" if self.note else self.verdict.lower()
        return f"| {self.name} | {self.value:.3g} | {self.note or self.bounds} | {met} |"

    @property
    def line(self) -> str:
        """What is printed."""
        peer = "" if self.peer is None else f"{self.peer}: {self.peer_value:,.4g}, ratio {self.ratio:,.3g}"
        beside = "; ".join(filter(None, (self.bounds, self.note, peer)))
        return f"{self.verdict:12s} {self.name}: {self.figure}{beside and f' ({beside})'}"


def report(rows: Iterable[Row]) -> int:
    """Print rows as they are measured; 1 when a bound is missed."""
    missed = False
    for row in rows:
        print(row.line, flush=True)
        missed |= row.met is False
    return int(missed)


def not_measured(name: str, why: str = "not at hand") -> Row:
    """A row without a figure."""
    return Row(name, math.nan, note=why)


def seconds(
    job: Callable[[], object],
    runs: int = RUNS,
    *,
    of: Callable[[Sequence[float]], float] = statistics.median,
    clock: Callable[[], float] = time.perf_counter,
    warm_up: bool = True,
) -> float:
    """Median wall time of some runs [s], or another figure of them or of another clock; a first run warms up and does not count."""
    if warm_up:
        job()
    times = []
    for _ in range(runs):
        started = clock()
        job()
        times.append(clock() - started)
    return of(times)


def medians_in_turn(job: Callable[[], object], peer: Callable[[], object]) -> tuple[float, float]:
    """Median wall times [s] of a job and of its peer, run in turn so that both meet the same load of the machine."""
    ours, theirs = [], []
    for _ in range(RUNS):
        ours.append(seconds(job, 3))
        theirs.append(seconds(peer, 1, warm_up=False))
    return statistics.median(ours), statistics.median(theirs)


def reference_loop() -> float:
    """Seconds of a fixed piece of array work: tells a slow machine from slow code."""
    values = np.random.default_rng(0).standard_normal(1_000_000)
    return seconds(lambda: np.sort(np.sin(values)).cumsum())


def tum_folder() -> Path | None:
    """The real trips, or None where they are not at hand."""
    return data_folder("tum")


def data_folder(name: str) -> Path | None:
    """A set of data, or None where it is not at hand."""
    folder = DATA / name
    return folder if folder.is_dir() else None
