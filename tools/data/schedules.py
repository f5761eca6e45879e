"""The changes of speed of the schedules of certification: `python -m tools.data.schedules --write`.

Needs the schedules of the package fastsim 2.1.5 (the extra `schedules`). Prints how far the energy of the traces of
`tripwatt.certification.schedules` is from that of the schedules themselves, for some cars of the library.
"""

from __future__ import annotations

import csv
import importlib.util
import itertools
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tools import DATA, ROOT
from tools.command import run
from tripwatt.arrays import FloatArray
from tripwatt.certification.consumption import driven_wh_per_km
from tripwatt.certification.schedules import CYCLES, ORDERS, SPEED_STEP_M_S, circuit
from tripwatt.vehicles import Vehicle, load_vehicle

FILES: Final = {"udds": "udds.csv", "hwfet": "hwfet.csv", "wltc": "wltc_3b.csv"}
TABLE: Final = ROOT / "src" / "tripwatt" / "certification" / "data" / "transitions.csv"
CARS: Final = ("bmw_i3_60ah", "vw_id3", "tesla_model_3_lr", "fiat_500e")
SEEDS: Final = 100


@cache
def published(cycle: str) -> tuple[FloatArray, FloatArray]:
    """Time [s] and speed [m/s] of a schedule as it is published.

    Raises
    ------
    LookupError
        When the package is not there.
    """
    spec = importlib.util.find_spec("fastsim")
    places = [DATA / "cycles"]
    if spec is not None and spec.origin is not None:
        places.insert(0, Path(spec.origin).parent / "resources" / "cycles")
    for place in places:
        if (place / FILES[cycle]).is_file():
            table = pd.read_csv(place / FILES[cycle], encoding="utf-8-sig")
            return table["cycSecs"].to_numpy(float), table["cycMps"].to_numpy(float)
    raise LookupError(f"no schedule {cycle}: install fastsim 2.1.5, the extra `schedules`")


def available(cycle: str) -> bool:
    """Whether a schedule is there."""
    try:
        published(cycle)
    except LookupError:
        return False
    return True


def counted(cycle: str) -> dict[tuple[int, int], int]:
    """Changes of speed of a schedule, on the grid."""
    steps = np.rint(published(cycle)[1] / SPEED_STEP_M_S).astype(int).tolist()
    return dict(sorted(Counter(itertools.pairwise(steps)).items()))


def error(cycle: str, order: int, counts: dict[tuple[int, int], int], cars: list[Vehicle]) -> list[float]:
    """Relative error of the energy of a trace, for each car."""
    speed = SPEED_STEP_M_S * circuit(counts, order).astype(float)
    trace = np.arange(len(speed), dtype=float), speed
    errors = []
    for car in cars:
        mass = car.body.test_mass_kg
        errors.append(
            driven_wh_per_km(car, trace, mass) / driven_wh_per_km(car, published(cycle), mass) - 1.0
        )
    return errors


def main(write: bool = False, search: bool = False) -> None:
    """Compare each schedule with its order. `--write` renews the file of the package, `--search` looks for the best order."""
    cars = [load_vehicle(name) for name in CARS]
    rows = []
    for cycle in CYCLES:
        counts = counted(cycle)
        rows += [(cycle, before, after, n) for (before, after), n in counts.items()]
        order = ORDERS[cycle]
        if search:
            order = min(range(SEEDS), key=lambda seed: abs(error(cycle, seed, counts, cars[1:2])[0]))
        errors = ", ".join(
            f"{name} {100 * value:+.2f} %"
            for name, value in zip(CARS, error(cycle, order, counts, cars), strict=True)
        )
        print(
            f"{cycle}: order {order}, {len(counts)} changes of speed; energy against the schedule: {errors}"
        )
    if write:
        TABLE.parent.mkdir(parents=True, exist_ok=True)
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            out = csv.writer(file, lineterminator="\n")
            out.writerow(["cycle", "from", "to", "seconds"])
            out.writerows(rows)


if __name__ == "__main__":
    run(main)
