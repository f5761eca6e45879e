"""A Nissan Leaf of the VED as one's own car, its trips in order of time: python -m benchmarks.own_car [--car 10] [--data FOLDER].

Each trip is forecast before it is learned, by a population of cars without those of the VED. Printed are the energy-weighted errors of the ranges of trips, the coverage of the
90 % interval, and the largest excess over the forecasts without own trips in 20 trips in a row.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pandas as pd
from tools import DATA
from tools.command import run

from benchmarks.measure import Row, report
from tripwatt.population import adapting, population
from tripwatt.server.cars.diary import Score
from tripwatt.server.cars.folder import create_car
from tripwatt.sources import read_logs
from tripwatt.trips import TripSet

VEHICLE = "nissan_leaf_24"
MIN_M = 2000.0
IN_A_ROW = 20


def rows(car: str = "10") -> Iterator[Row]:
    """All rows of one car."""
    fleet = read_logs(DATA / "ved", "ved")
    own = [log for log in fleet.logs if log.context.car == car and log.distance_m > MIN_M]
    others = population().without({"ved"})
    with tempfile.TemporaryDirectory() as folder, patch.object(adapting, "population", lambda: others):
        learning = create_car(Path(folder) / "car", VEHICLE)
        done = learning.add(
            TripSet("ved", tuple(own)),
            progress=lambda k, n: print(f"{k} of {n}", file=sys.stderr) if k % 20 == 0 else None,
        )
        table = learning.diary.table
    print(f"{done}", file=sys.stderr)
    yield from rows_of(table)


def rows_of(table: pd.DataFrame) -> Iterator[Row]:
    """All rows of a diary."""
    early, late, everything = (Score.of(part) for part in (table.iloc[20:69], table.iloc[69:138], table))
    book = Score.of(table, "book_")
    yield Row("error without own trips, all trips", book.weighted_error)
    yield Row("error, trips 21 to 69", early.weighted_error, most=0.125)
    yield Row("error, trips 70 to 138", late.weighted_error, most=0.115)
    yield Row("coverage of the 90 % interval, all trips", everything.coverage, least=0.85, most=0.96)
    yield Row("width of the 90 % interval, all trips", everything.width)
    took = table["energy_wh"].abs().rolling(IN_A_ROW).sum()
    excess = (
        (table["forecast_wh"] - table["energy_wh"]).abs().rolling(IN_A_ROW).sum()
        - (table["book_forecast_wh"] - table["energy_wh"]).abs().rolling(IN_A_ROW).sum()
    ) / took
    yield Row(
        "largest excess over the forecasts without own trips in 20 trips in a row",
        float(excess.max()),
        most=0.01,
    )


def main(car: str = "10") -> int:
    """Print the rows of a car of the VED; 1 when a bound is missed."""
    return report(rows(car))


if __name__ == "__main__":
    run(main)
