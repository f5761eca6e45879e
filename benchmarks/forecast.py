"""Speed of the forecast: one in process, the command with its start, fitting on the TUM trips."""

from __future__ import annotations

import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd

from benchmarks.measure import Row, not_measured, reference_loop, report, seconds, tum_folder
from tripwatt.forecasting import ForecastModel, load_model
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan

TRIP_S = 1300.0
RUNS = 101
MAX_MS = {"one forecast of 1,300 s at 1 Hz, in process": 5.0}
LONG_TRIP_H = 12
LITTLE = 0.4
"""Measured over driven current of the first half of the long trip."""


def run() -> Iterator[Row]:
    """All rows, as they are measured."""
    yield Row("reference loop", reference_loop(), "s")
    samples = samples_of(TRIP_S)
    trip = Plan.from_samples(samples, "bench")
    model = load_model()
    seen = samples[samples["time_s"] <= 0.5 * TRIP_S]
    before = model.forecast(trip)
    jobs: dict[str, Callable[[], object]] = {
        "one forecast of 1,300 s at 1 Hz, in process": lambda: model.forecast(trip),
        "one forecast with all that is answered": lambda: model.forecast(trip).to_dict(),
        "one update after half of the trip, with all that is answered": lambda: before.update(seen).to_dict(),
        "load the model of the package": load_model,
    }
    for name, job in jobs.items():
        yield Row(name, 1000.0 * seconds(job, RUNS), "ms", most=MAX_MS.get(name, math.inf))
        yield Row(
            f"{name}: processor time",
            1000.0 * seconds(job, RUNS, of=statistics.mean, clock=time.process_time),
            "ms",
        )
    yield from long_trips(model, samples)
    with tempfile.TemporaryDirectory() as scratch:
        table = Path(scratch) / "trip.csv"
        samples.to_csv(table, index=False)
        yield Row("tripwatt forecast, the whole command", commanding("forecast", str(table)), "s", most=1.5)
        folder = tum_folder()
        if folder is None:
            yield not_measured("fit on the TUM trips, one process")
            return
        yield Row(
            "fit on the TUM trips, one process",
            commanding("fit", str(folder), "--out", f"{scratch}/model", runs=1),
            "s",
            most=60,
        )


def samples_of(duration_s: float) -> pd.DataFrame:
    """The first samples of a synthetic trip that is long enough, with what was measured."""
    long = next(t for t in synthetic_fleet(8).trips if t.duration_s >= duration_s)
    return long.samples[long.samples["time_s"] <= duration_s]


def long_trips(model: ForecastModel, samples: pd.DataFrame) -> Iterator[Row]:
    """A trip of many hours, which repeats a short one: best of some runs, and the growth from one to the other."""
    samples = samples.drop(columns=["soc", "displayed_soc"], errors="ignore")  # a repeated trip would charge
    repeats = round(LONG_TRIP_H * 3600.0 / (TRIP_S + 1.0))
    clock = samples["time_s"] - samples["time_s"].iloc[0]
    long = pd.concat(
        [samples.assign(time_s=clock + (TRIP_S + 1.0) * k) for k in range(repeats)], ignore_index=True
    )
    took: list[tuple[float, float]] = []
    for log in (samples, long):
        plan = Plan.from_samples(log, "bench")
        seen = log[log["time_s"] <= 0.5 * log["time_s"].iloc[-1]]
        seen = seen.assign(
            current_a=seen["current_a"] * LITTLE
        )  # six hours as driven take more than a battery holds
        before = model.forecast(plan)
        took.append(
            (
                seconds(lambda plan=plan: model.forecast(plan).sd_wh, 15, of=min),
                seconds(lambda seen=seen, before=before: before.update(seen).sd_wh, 15, of=min),
            )
        )
    for k, (name, most) in enumerate((("forecast", 25.0), ("update after half", 15.0))):
        text = f"one {name} of {LONG_TRIP_H} h at 1 Hz, in process, with its interval"
        yield Row(text, 1000.0 * took[1][k], "ms", most=most)
        growth = math.log(took[1][k] / took[0][k]) / math.log(repeats)
        yield Row(f"growth exponent of the {name} from 1,300 s to {LONG_TRIP_H} h", growth, most=1.1)


def commanding(*arguments: str, runs: int = 5) -> float:
    """Median wall time of a command [s], the start of the interpreter included."""
    command = [sys.executable, "-m", "tripwatt.command", *arguments]
    return seconds(lambda: subprocess.run(command, check=True, capture_output=True), runs)


if __name__ == "__main__":
    report(run())
