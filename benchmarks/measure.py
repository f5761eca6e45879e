"""How everything here is timed: the median of repeated runs, beside a reference loop in the same run."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tests.support import ROOT

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

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


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
    folder = Path(os.environ.get("TRIPWATT_DATA", ROOT / "../shared/data")) / "tum"
    return folder if folder.is_dir() else None
