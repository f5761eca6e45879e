"""How everything here is timed: the median of repeated runs, beside a reference loop in the same run."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tools import DATA

RUNS = 5


@dataclass(frozen=True)
class Row:
    """One line of bench.json."""

    name: str
    value: float
    unit: str
    peer: str | None = None
    peer_value: float | None = None
    ratio: float | None = None

    @property
    def line(self) -> str:
        """What is printed."""
        peer = (
            "" if self.peer is None else f"   {self.peer}: {self.peer_value:,.4g}   ratio {self.ratio:,.3g}"
        )
        return f"{self.name}: {self.value:,.4g} {self.unit}{peer}"


def median_seconds(job: Callable[[], object], *, runs: int = RUNS, warm_up: bool = True) -> float:
    """Median wall time of `runs` runs [s], after one run that is not counted when `warm_up`."""
    if warm_up:
        job()
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        job()
        times.append(time.perf_counter() - started)
    return statistics.median(times)


def medians_in_turn(job: Callable[[], object], peer: Callable[[], object]) -> tuple[float, float]:
    """Median wall times [s] of a job and of its peer, run in turn so that both meet the same load of the machine."""
    ours, theirs = [], []
    for _ in range(RUNS):
        ours.append(median_seconds(job, runs=3))
        theirs.append(median_seconds(peer, runs=1, warm_up=False))
    return statistics.median(ours), statistics.median(theirs)


def reference_loop() -> float:
    """Seconds of a fixed piece of array work: tells a slow machine from slow code."""
    values = np.random.default_rng(0).standard_normal(1_000_000)
    return median_seconds(lambda: np.sort(np.sin(values)).cumsum())


def tum_folder() -> Path | None:
    """The real trips, or None where they are not at hand."""
    return data_folder("tum")


def data_folder(name: str) -> Path | None:
    """A set of data, or None where it is not at hand."""
    folder = DATA / name
    return folder if folder.is_dir() else None
