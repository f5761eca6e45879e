"""How time and memory grow with the size of the work, beside peers on the same work in the same run.

Run: ``python -m benchmarks.growth [--write]``. Least CPU time of this process in some runs, and the peak of what Python and NumPy
allocate. The exponent of a figure is the slope of its logarithm over that of the size. A peer that is not installed is left out.
``--write`` puts the table into docs/explanation/peers.md.
"""

from __future__ import annotations

import datetime as dt
import itertools
import math
import shutil
import subprocess
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from tools.command import run
from tools.docs import pages

import tripwatt as tw
from benchmarks import gam, peers, stops
from benchmarks.measure import seconds
from tripwatt.physics.batch import trip_totals
from tripwatt.roads.journey.plans import find_plans
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
from tripwatt.trips import Context, Log, Trip
from tripwatt.vehicles import load_vehicle
from tripwatt_gamm import GAMM

Job = Callable[[], object]
CAR: Final = load_vehicle(VEHICLE)
R_CODE: Final = """
suppressMessages(library(mgcv))
d <- read.csv(commandArgs(TRUE)[1])
t <- system.time(bam(y ~ s(x) + s(z), data = d, discrete = TRUE, nthreads = 1))
cat(t[1] + t[2])
"""
SAMPLES: Final = 900
"""Samples of a trip where the number of trips or cars grows."""


def driven(samples: int) -> Trip:
    """A drive at 1 Hz with the speeds of synthetic trips in turn."""
    speed = np.concatenate([trip.array("speed_m_s") for trip in synthetic_fleet(4, seed=3).trips])
    table = pd.DataFrame({"time_s": np.arange(float(samples)), "speed_m_s": np.resize(speed, samples)})
    return Trip.from_samples("drive", table)


def cars_of(trips: Sequence[Trip]) -> peers.Cars:
    """Trips of the car in the form of the peers."""
    return peers.Cars("", CAR, tuple(trips), np.zeros(len(trips)), ("BMW", "i3 22 kWh", "2014"))


def several(trips: int) -> peers.Cars:
    """Equal trips."""
    return cars_of([driven(SAMPLES)] * trips)


def trips(size: int) -> Job:
    """Equal trips of one car, side by side."""
    drives = several(size).trips
    return lambda: trip_totals((CAR, drive) for drive in drives)


def cars(size: int) -> Job:
    """One trip of cars that differ in mass."""
    body, trip = CAR.body, driven(SAMPLES)
    masses = np.linspace(1.0, 1.2, size) * body.curb_mass_kg
    fleet = [replace(CAR, body=replace(body, curb_mass_kg=float(mass))) for mass in masses]
    return lambda: trip_totals((car, trip) for car in fleet)


def links(size: int) -> Job:
    """The forecast of a route of equal links."""
    model, plan = tw.load_model(), tw.read_route([{"length_m": 400.0, "speed_m_s": 13.0}] * size)
    return lambda: model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=15.0))


def stations(size: int) -> Job:
    """Plans of charging stops on a road with stations beside it."""
    corridor = stops.planned(0, stops.LENGTH_KM, size)
    return lambda: find_plans(replace(corridor))


def later(context: Context, weeks: int) -> Context:
    """The same departure some weeks later."""
    began = context.started_at or dt.datetime(2026, 1, 5, 8)
    return replace(context, started_at=began + dt.timedelta(weeks=weeks))


def diary(size: int) -> Job:
    """One more trip of a car whose diary has that many, in a folder that is left to the system."""
    trips = synthetic_fleet(8, seed=1).trips
    car = tw.create_car(Path(tempfile.mkdtemp()) / "car", CAR)
    # the same trips on later days
    names = (
        Log.from_samples(f"{trip.trip_id}-{n}", trip.samples, later(trip.context, n))
        for n in itertools.count()
        for trip in trips
    )
    car.add([*itertools.islice(names, size)])
    return lambda: car.add([next(names)])


def rows_of(size: int) -> pd.DataFrame:
    """Rows of two known curves."""
    return gam.grouped(size, 20)


def pygam(size: int) -> Job:
    """Two curves by pyGAM."""
    from pygam import LinearGAM, s

    table = rows_of(size)
    return lambda: LinearGAM(s(0) + s(1)).fit(table[["x", "z"]].to_numpy(), table["y"].to_numpy())


def statsmodels(size: int) -> Job:
    """The same two curves by the GAM of statsmodels, with given penalties."""
    from statsmodels.gam.api import BSplines, GLMGam

    table = rows_of(size)
    curves = BSplines(table[["x", "z"]], df=[10, 10], degree=[3, 3])
    return lambda: GLMGam(table["y"], smoother=curves, alpha=[1.0, 1.0]).fit()


def mgcv(size: int) -> Job:
    """The same two curves by mgcv's bam, which measures its own CPU time [s]."""
    rscript, table = shutil.which("Rscript"), Path(tempfile.mkdtemp()) / "rows.csv"
    if rscript is None:
        raise ImportError("no Rscript")
    rows_of(size).to_csv(table, index=False)

    def job() -> float:
        done = subprocess.run(
            [rscript, "-e", R_CODE, str(table)], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise ImportError(done.stderr)
        return float(done.stdout.split()[-1])

    return job


def curves(size: int) -> Job:
    """The same two curves by our engine."""
    table = rows_of(size)
    return lambda: GAMM("y ~ s(x) + s(z)").fit(table)


OURS: Final = "tripwatt"
WORKS: Final[Mapping[str, tuple[tuple[int, ...], Mapping[str, Callable[[int], Job]]]]] = {
    "simulated samples": (
        (2_000, 10_000, 50_000),
        {
            OURS: lambda n: peers.tripwatt_physics(cars_of([driven(n)])),
            "FASTSim 3": lambda n: peers.fastsim3(cars_of([driven(n)])),
            "RouteE": lambda n: peers.routee(cars_of([driven(n)])),
        },
    ),
    "simulated quarter-hours": (
        (5, 20, 80),
        {
            OURS: trips,
            "FASTSim 3": lambda n: peers.fastsim3(several(n)),
            "RouteE": lambda n: peers.routee(several(n)),
        },
    ),
    "cars on a quarter-hour": ((10, 100, 1000), {OURS: cars}),
    "links of a forecast": ((25, 250, 2500), {OURS: links}),
    "stations on 1000 km": ((25, 50, 100), {OURS: stations}),
    "trips in the diary when one is added": ((4, 16, 64), {OURS: diary}),
    "rows of a GAM": (
        (5_000, 25_000, 125_000),
        {OURS: curves, "mgcv (bam, discrete)": mgcv, "pyGAM": pygam, "statsmodels": statsmodels},
    ),
}
"""What grows -> its sizes, and who does the work."""


@dataclass(frozen=True)
class Growth:
    """Time [s] and peak memory [MB] at the largest size, each with its exponent."""

    what: str
    who: str
    largest: int
    time_s: float
    time_exponent: float
    memory_mb: float
    memory_exponent: float

    @property
    def line(self) -> str:
        """As a row of the table."""
        pairs = (self.time_s, self.time_exponent), (self.memory_mb, self.memory_exponent)
        shown = " | ".join(
            "" if math.isnan(value) else f"{value:.3g} ({slope:z.2f})" for value, slope in pairs
        )
        return f"| {self.what} | {self.who} | {self.largest:,} | {shown} |"


HEAD: Final = """| what grows | system | largest | CPU s (exponent) | MB (exponent) |
|---|---|---:|---:|---:|"""


def measured(job: Job) -> tuple[float, float]:
    """Least CPU time [s] of three runs after one that warms up, and the peak of the memory that another one allocates [MB]."""
    own = job()
    if isinstance(own, float):  # another program, which measures itself
        return min(own, *(float(str(job())) for _ in range(2))), math.nan
    took = seconds(job, 3, of=min, clock=time.process_time, warm_up=False)
    tracemalloc.start()
    job()
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return took, peak


def growths() -> Iterator[Growth]:
    """Every work by everybody who is installed."""
    for what, (sizes, systems) in WORKS.items():
        for who, job_of in systems.items():
            try:
                figures = np.array([measured(job_of(size)) for size in sizes])
            except ImportError:
                continue
            (took, used), (time_exponent, memory_exponent) = (
                figures[-1],
                np.polyfit(np.log(sizes), np.log(figures), 1)[0],
            )
            yield Growth(what, who, sizes[-1], took, time_exponent, used, memory_exponent)


def main(write: bool = False) -> None:
    """Print the table. `--write` renews that of docs/explanation/peers.md."""
    lines = [HEAD]
    for growth in growths():
        lines.append(growth.line)
        print(growth.line, flush=True)
    if write:
        pages.renew("explanation/peers.md", "growth", "\n".join(lines))


if __name__ == "__main__":
    run(main)
