"""Every check against measurements from outside, side by side: `python -m benchmarks.outside [--write]`.

Computes the errors of the simulation against road tests, certified consumption and dynamometers, row by row: simulated over measured
energy, less one. Nothing is fitted. `--write` writes them to docs/results/outside.json and renews docs/explanation/accuracy.md with its
figure, and the line of the README, from them and from the published scores of trips (cars, before and links).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any, Final

import numpy as np
from tools import DATA, DOCS, REFERENCE
from tools.command import run
from tools.docs.accuracy_page import publish

from benchmarks import anchors, argonne, cold_rows, steady
from benchmarks.cars import lab_errors, lab_tables, on_dynamometer
from tripwatt.hybrid import SegmentTable
from tripwatt.vehicles import load_vehicle

RESULT: Final = DOCS / "results" / "outside.json"
DIGITS: Final = 5
CELLS_DEGC: Final = {
    "−18": (-18, -17),
    "−6": (-6, -6),
    "0 to 2": (0, 2),
    "22 to 23": (22, 23),
    "36": (36, 36),
}
"""Name -> the least and the largest temperature of the rows of Argonne's dynamometer."""


def check(group: str, name: str, errors: Iterable[float]) -> dict[str, Any]:
    """One row of the page."""
    return {"group": group, "name": name, "errors": [round(float(error), DIGITS) for error in errors]}


def road_tests() -> Iterator[dict[str, Any]]:
    """Constant speeds on a motorway, each as the planned route of one link that a driver would ask for."""
    tests = sorted(steady.compute(), key=lambda test: (test.season != "summer", test.season, test.speed_km_h))
    for (season, speed), same in groupby(tests, key=lambda test: (test.season, test.speed_km_h)):
        yield check("road tests", f"{season}, {speed:.0f} km/h", [test.error("planned") for test in same])


def certified() -> Iterator[dict[str, Any]]:
    """Rows of certified consumption before a car is anchored to them, and the rise of the consumption in the cold."""
    outcomes = anchors.committed()
    for measured, name in ((True, "measured coast-down"), (False, "no coast-down")):
        rows = [o.rows(o.before) for o in outcomes if o.measured == measured]
        yield check("certified", name, np.concatenate(rows))
    cold = cold_rows.compute()
    for way, name in (("off", "−7 °C, climate off"), ("heated", "−7 °C, cabin of 22 °C")):
        yield check("certified", name, [getattr(row, way) / row.measured - 1.0 for row in cold])


def dynamometer() -> Iterator[dict[str, Any]]:
    """The BMW i3 in the climate chamber of Argonne, and the sedan."""
    rows = argonne.argonne_rows(DATA, REFERENCE)
    for name, (low, high) in CELLS_DEGC.items():
        same = rows["cell_temperature_degc"].between(low, high)
        yield check("dynamometer", f"BMW i3, {name} °C", rows["error"][same])
    folder, car = DATA / "sedan" / "lab", on_dynamometer(load_vehicle("tesla_model_3_lr"))
    for name, errors in lab_errors(SegmentTable.join(lab_tables(folder, car))).items():
        yield check("dynamometer", f"Model 3, {name}", errors)


def compute() -> dict[str, Any]:
    """All checks."""
    return {"kind": "outside", "checks": [*road_tests(), *certified(), *dynamometer()]}


def main(write: bool = False) -> None:
    """Print the mean and the mean size of the errors of each check. `--write` renews the page."""
    results = compute()
    for row in results["checks"]:
        error = np.array(row["errors"])
        print(
            f"{row['group']:12} {row['name']:28} {error.size:4} {error.mean():+.3f} {np.abs(error).mean():.3f}"
        )
    if write:
        RESULT.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", "utf-8")
        publish()


if __name__ == "__main__":
    run(main)
