"""Speed of reading, simulating and evaluating; the simulation beside FASTSim on the same trips in the same run."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.measure import Row, medians_in_turn, not_measured, reference_loop, seconds, tum_folder
from tripwatt.physics import simulate_trip
from tripwatt.physics.batch import trip_totals
from tripwatt.sources import read_logs
from tripwatt.trips import Trip, resample
from tripwatt.vehicles import load_vehicle

PEAK_MEMORY = """
import resource, sys
from tripwatt.sources import read_logs
fleet = read_logs(sys.argv[1], "tum")
print(sum(len(t) for t in fleet.trips), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def run() -> Iterator[Row]:
    """All rows, as they are measured."""
    yield Row("evaluate the synthetic fleet", evaluating(), "s", most=60)
    yield Row("reference loop", reference_loop(), "s")
    folder = tum_folder()
    if folder is None:
        yield not_measured("reading and simulating the TUM trips")
    else:
        yield from _reading(folder)
        ved = folder.parent / "ved"
        if ved.is_dir():
            yield Row("read the 211 VED trips", seconds(lambda: read_logs(ved, "ved")), "s", most=3)
        yield from _simulating([resample(t, 1.0) for t in read_logs(folder, "tum").trips])


def _reading(folder: Path) -> Iterator[Row]:
    yield Row("read the TUM trips", seconds(lambda: read_logs(folder, "tum")), "s", most=4)
    answer = subprocess.run(
        [sys.executable, "-c", PEAK_MEMORY, str(folder)], check=True, capture_output=True, text=True
    )
    rows, peak = answer.stdout.split()
    yield Row("rows of the TUM trips", float(rows), "rows")
    yield Row("peak memory of reading the TUM trips", float(peak), "MB", most=1024)


def _simulating(trips: Sequence[Trip]) -> Iterator[Row]:
    car = load_vehicle("bmw_i3_60ah")
    simulated_s = sum(t.duration_s for t in trips)
    job, driven_s = _fastsim(trips)
    our_s, their_s = medians_in_turn(lambda: [simulate_trip(car, t) for t in trips], job)
    ours, theirs = simulated_s / our_s, driven_s / their_s
    text = "simulate the trips at 1 Hz, one process"
    yield Row(text, ours, "s/s", least=1e6, peer="FASTSim", peer_value=theirs, ratio=ours / theirs)
    yield Row(f"{text}, times FASTSim", ours / theirs, least=20)
    many = simulated_s / seconds(lambda: trip_totals((car, t) for t in trips))
    text = "simulate the trips at 1 Hz side by side, one process"
    yield Row(text, many, "s/s", peer="FASTSim", peer_value=theirs, ratio=many / theirs)


def _fastsim(trips: Sequence[Trip]) -> tuple[Callable[[], None], float]:
    """FASTSim over the same speed traces on a flat road, and how many seconds of them it drives.

    A car of about the same power; only `run` is timed, building is not; histories are off, a missed trace is allowed.
    A trace that it refuses all the same ends there, and only the seconds before count.
    """
    import fastsim

    car = fastsim.Vehicle.from_resource("2022_Renault_Zoe_ZE50_R135.yaml")
    car.set_save_interval(None)
    udds = fastsim.Cycle.from_resource("udds.csv").to_dict()
    drives = [fastsim_drive(fastsim, car, udds, trip) for trip in trips]

    def walked() -> list[Any]:
        fresh = [drive.copy() for drive in drives]
        for drive in fresh:
            with contextlib.suppress(RuntimeError):
                drive.run()
        return fresh

    driven_s = sum(float(drive.to_dict()["veh"]["state"]["i"]) for drive in walked())

    def job() -> None:
        walked()

    return job, driven_s


def fastsim_drive(
    fastsim: Any, car: Any, template: Mapping[str, Any], trip: Trip, grade: Sequence[float] | None = None
) -> Any:
    """A drive of a trip at 1 Hz; on a flat road without `grade`. A missed trace is allowed."""
    n = len(trip)
    constant = ("pwr_max_chrg_watts", "temp_amb_air_kelvin", "pwr_solar_load_watts")
    cycle = {
        **template,
        **{key: [template[key][0]] * n for key in constant},
        "time_seconds": [float(i) for i in range(n)],
        "speed_meters_per_second": trip.array("speed_m_s").tolist(),
        "grade": [0.0] * n if grade is None else [float(g) for g in grade],
        "dist_meters": [],
        "elev_meters": [],
        "grade_interp": None,
        "elev_interp": None,
    }
    drive = fastsim.SimDrive(car, fastsim.Cycle.from_dict(cycle)).to_dict()
    drive["sim_params"]["trace_miss_opts"] = "Allow"
    return fastsim.SimDrive.from_dict(drive)


def evaluating(*arguments: str, out: Path | None = None, runs: int = 1) -> float:
    """Median wall time of `tripwatt evaluate` [s]; the results of the last run stay in `out`."""
    with tempfile.TemporaryDirectory() as scratch:
        target = str(out or Path(scratch) / "out")
        command = [sys.executable, "-m", "tripwatt.command", "evaluate", *arguments, "--out", target]
        return seconds(
            lambda: subprocess.run(command, check=True, capture_output=True), runs=runs, warm_up=False
        )
