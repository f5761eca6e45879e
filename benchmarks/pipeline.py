"""Speed of reading, simulating and evaluating; the simulation beside FASTSim on the same trips in the same run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.measure import Row, median_seconds, reference_loop, tum_folder
from tripwatt.physics import simulate_trip
from tripwatt.sources import read_fleet
from tripwatt.trips import Trip, resample
from tripwatt.vehicles import load_vehicle

PEAK_MEMORY = """
import resource, sys
from tripwatt.sources import read_fleet
fleet = read_fleet(sys.argv[1], "tum")
print(sum(len(t) for t in fleet.trips), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def run() -> Iterator[Row]:
    """All rows, as they are measured."""
    yield Row("reference loop", reference_loop(), "s")
    folder = tum_folder()
    if folder is None:
        print("no TUM trips at hand: only the synthetic evaluation is measured", file=sys.stderr)
    else:
        yield from _reading(folder)
        yield from _simulating([resample(t, 1.0) for t in read_fleet(folder, "tum").trips])
        yield Row("evaluate the TUM trips, whole protocol", _evaluating(str(folder)), "s")
    yield Row("evaluate the synthetic fleet", _evaluating(), "s")


def _reading(folder: Path) -> Iterator[Row]:
    yield Row("read the TUM trips", median_seconds(lambda: read_fleet(folder, "tum")), "s")
    answer = subprocess.run(
        [sys.executable, "-c", PEAK_MEMORY, str(folder)], check=True, capture_output=True, text=True
    )
    rows, peak = answer.stdout.split()
    yield Row("rows of the TUM trips", float(rows), "rows")
    yield Row("peak memory of reading the TUM trips", float(peak), "MB")


def _simulating(trips: Sequence[Trip]) -> Iterator[Row]:
    car = load_vehicle("bmw_i3_60ah")
    simulated_s = sum(t.duration_s for t in trips)
    ours = simulated_s / median_seconds(lambda: [simulate_trip(car, t) for t in trips])
    theirs = simulated_s / median_seconds(_fastsim(trips))
    yield Row("simulate the trips at 1 Hz, one process", ours, "s/s", "FASTSim", theirs, ours / theirs)


def _fastsim(trips: Sequence[Trip]):  # type: ignore[no-untyped-def]
    """FASTSim over the same speed traces; only `walk` is timed, with histories off, building is not."""
    import warnings

    import fastsim

    car = fastsim.Vehicle.from_resource("2022_Renault_Zoe_ZE50_R135.yaml")
    template = fastsim.Cycle.from_resource("udds.csv")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        shape = template.to_dict()
    drives = []
    for trip in trips:
        n = len(trip)
        cycle = {
            key: ([value[0]] * n if isinstance(value, list) else value)
            for key, value in shape.items()
            if key
            in {"init_elev_meters", "temp_amb_air_kelvin", "pwr_max_chrg_watts", "pwr_solar_load_watts"}
        } | {
            "time_seconds": [float(i) for i in range(n)],
            "speed_meters_per_second": trip.array("speed_m_s").tolist(),
            "grade": [0.0] * n,
            "dist_meters": [],
            "elev_meters": [],
            "grade_interp": None,
            "elev_interp": None,
        }
        drives.append(fastsim.SimDrive(car, fastsim.Cycle.from_dict(cycle)))

    def job() -> None:
        for drive in drives:
            fresh = drive.copy()
            try:
                fresh.walk()
            except RuntimeError:  # a trace it cannot follow ends there: counted in its favour
                continue

    return job


def _evaluating(*arguments: str) -> float:
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "tripwatt.cli", "evaluate", *arguments, "--out", out]
        return median_seconds(lambda: subprocess.run(command, check=True, capture_output=True), runs=1)
