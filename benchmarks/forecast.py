"""Speed of the forecast: one in process, the command with its start, fitting on the TUM trips."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.measure import Row, median_seconds, reference_loop, tum_folder
from tripwatt.forecasting import load_model
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Trip, plan_from_samples

TRIP_S = 1300.0
RUNS = 101
ONE = "one forecast of 1,300 s at 1 Hz, in process"
COMMAND = "tripwatt forecast, the whole command"
FIT_TUM = "fit on the TUM trips, one process"


def run() -> Iterator[Row]:
    """All rows, as they are measured."""
    yield Row("reference loop", reference_loop(), "s")
    trip = trip_of(TRIP_S)
    model = load_model()
    seen = trip.samples[trip.samples["time_s"] <= 0.5 * TRIP_S]
    before = model.forecast(trip)
    jobs: dict[str, Callable[[], object]] = {
        ONE: lambda: model.forecast(trip),
        "one forecast with all that is answered": lambda: model.forecast(trip).to_dict(),
        "one update after half of the trip, with all that is answered": lambda: before.update(seen).to_dict(),
        "load the model of the package": load_model,
    }
    for name, job in jobs.items():
        yield Row(name, 1000.0 * median_seconds(job, runs=RUNS), "ms")
        yield Row(f"{name}: processor time", 1000.0 * processor_seconds(job), "ms")
    with tempfile.TemporaryDirectory() as scratch:
        table = Path(scratch) / "trip.csv"
        trip.samples.to_csv(table, index=False)
        yield Row(COMMAND, commanding("forecast", str(table)), "s")
        folder = tum_folder()
        if folder is None:
            print("no TUM trips at hand: fitting is not measured", file=sys.stderr)
            return
        yield Row(FIT_TUM, commanding("fit", str(folder), "--out", f"{scratch}/model", runs=1), "s")


def trip_of(duration_s: float) -> Trip:
    """The first samples of a synthetic trip that is long enough."""
    long = next(t for t in synthetic_fleet(8).trips if t.duration_s >= duration_s)
    return plan_from_samples(long.samples[long.samples["time_s"] <= duration_s], "bench")


def processor_seconds(job: Callable[[], object], runs: int = RUNS) -> float:
    """Mean processor time of a run [s]: what a busy machine does not change."""
    job()
    started = time.process_time()
    for _ in range(runs):
        job()
    return (time.process_time() - started) / runs


def commanding(*arguments: str, runs: int = 5) -> float:
    """Median wall time of a command [s], the start of the interpreter included."""
    command = [sys.executable, "-m", "tripwatt.cli", *arguments]
    return median_seconds(lambda: subprocess.run(command, check=True, capture_output=True), runs=runs)


if __name__ == "__main__":
    for row in run():
        print(f"{row.name}: {row.value:.4g} {row.unit}")
