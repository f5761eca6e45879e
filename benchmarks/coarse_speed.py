"""Speed from coarse logs: python -m benchmarks.coarse_speed.

The speed of TUM trips, every 0.1 s in steps of 0.01 km/h, is written as coarse loggers would have it, and simulated as it stands and
as `rebuild_speed` makes it. Printed is the error of the simulated energy against that of the full speed, its median and 90th
percentile over the trips, and the median error of the losses in drivetrain and friction brakes. The trips are others than those on which
the constants of the method were chosen (the first, fourth, seventh ... of the set).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from tools import DATA
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.arrays import FloatArray
from tripwatt.sources.tum import REFERENCE_TRIPS
from tripwatt.trips import Trip
from tripwatt.trips.coarse_speed import rebuild_speed
from tripwatt.units import M_S_PER_KM_H

VEHICLE = "bmw_i3_60ah"
CHOSEN = slice(1, None, 3)
M_S_PER_MPH = 0.44704
LOSSES = ("drivetrain", "friction_brakes")


def held(speed: FloatArray, *rows: int) -> FloatArray:
    """Each value stands for so many rows, in turn."""
    first = np.cumsum(np.append(0, np.resize(rows, len(speed))))
    number = np.arange(len(speed))
    return speed[first[np.searchsorted(first, number, side="right") - 1]]


def rounded(speed: FloatArray, step_m_s: float) -> FloatArray:
    """Whole steps."""
    return step_m_s * np.round(speed / step_m_s)


class Logger(NamedTuple):
    """Rows of the 10 Hz log that it keeps, what it makes of their speed, and most median and 90th percentile of the error [%]."""

    every: int
    coarse: Callable[[FloatArray], FloatArray]
    most: tuple[float, float]


LOGGERS = {
    "every 1 s, whole km/h": Logger(10, lambda v: rounded(v, M_S_PER_KM_H), (0.1, 0.3)),
    "every 1 s, whole mph": Logger(10, lambda v: rounded(v, M_S_PER_MPH), (0.15, 0.5)),
    "every 1 s, held 5 s": Logger(10, lambda v: held(v, 5), (1.5, 4.0)),
    "every 1 s, held 10 s": Logger(10, lambda v: held(v, 10), (4.0, 8.0)),
    "every 1 s, held 3 to 10 s": Logger(10, lambda v: held(v, 7, 3, 10, 5, 8), (2.5, 6.0)),
    "every 5 s": Logger(50, lambda v: v, (1.5, 4.0)),
    "every 1 s, held 10 s, whole km/h": Logger(10, lambda v: rounded(held(v, 10), M_S_PER_KM_H), (4.0, 8.0)),
    "every 1 s, held 5 s, whole mph": Logger(10, lambda v: rounded(held(v, 5), M_S_PER_MPH), (1.5, 4.0)),
}


def energies(trip: Trip) -> FloatArray:
    """Simulated energy and its losses [Wh]."""
    simulation = tw.simulate(trip, VEHICLE)
    by_cause = simulation.by_cause_wh
    return np.array([simulation.simulated_energy_wh, sum(by_cause[cause] for cause in LOSSES)])


def errors(trips: Sequence[Trip], logger: Logger) -> FloatArray:
    """Relative errors [%] of energy and losses, as it stands and rebuilt; shape (trips, 2, 2)."""
    out = []
    for trip in trips:
        samples = trip.samples.iloc[:: logger.every].reset_index(drop=True)
        coarse = logger.coarse(samples["speed_m_s"].to_numpy())
        rebuilt = rebuild_speed(samples["time_s"].to_numpy(), coarse).speed_m_s
        made = [trip.with_samples(samples.assign(speed_m_s=speed)) for speed in (coarse, rebuilt)]
        out.append([100.0 * np.abs(energies(m) / energies(trip) - 1.0) for m in made])
    return np.array(out)


def rows_of(trips: Sequence[Trip], name: str) -> Iterator[Row]:
    """All rows of one logger."""
    logger = LOGGERS[name]
    found = errors(trips, logger)
    figures = (
        ("energy, median", 0, 50.0, logger.most[0]),
        ("energy, 90th percentile", 0, 90.0, logger.most[1]),
        ("losses, median", 1, 50.0, np.inf),
    )
    for what, quantity, percentile, most in figures:
        stands, rebuilt = np.percentile(found[:, :, quantity], percentile, axis=0)
        text = f"{name}: error of {what}"
        peer, ratio = "as it stands", float(rebuilt / stands)
        yield Row(text, float(rebuilt), "%", most=most, peer=peer, peer_value=float(stands), ratio=ratio)


def rows() -> Iterator[Row]:
    """All rows."""
    trips = [t for t in tw.read_trips(DATA / "tum", "tum") if t.trip_id in REFERENCE_TRIPS][CHOSEN]
    for name in LOGGERS:
        yield from rows_of(trips, name)


def main() -> int:
    """Print the rows; 1 when a bound is missed."""
    return report(rows())


if __name__ == "__main__":
    run(main)
