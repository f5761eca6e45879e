"""Traces in place of the schedules of certification: `python -m tools.data.schedules --write`.

A trace that makes each change of speed as often as the schedule does is an Eulerian circuit of their counts (Hierholzer's algorithm).
Needs the schedules of the package fastsim 2.1.5 (the extra `schedules`). Prints how far the energy of the traces of
`tripwatt.certification.consumption` is from that of the schedules themselves, for some cars of the library.
"""

from __future__ import annotations

import csv
import importlib.util
import itertools
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tools import DATA, ROOT
from tools.command import run
from tripwatt.arrays import FloatArray, IntArray
from tripwatt.certification.consumption import CYCLES, SPEED_STEP_M_S, driven_wh_per_km
from tripwatt.vehicles import Vehicle, load_vehicle

FILES: Final = {"udds": "udds.csv", "hwfet": "hwfet.csv", "wltc": "wltc_3b.csv"}
TABLE: Final = ROOT / "src" / "tripwatt" / "certification" / "data" / "schedules.csv"
CARS: Final = ("bmw_i3_60ah", "vw_id3", "tesla_model_3_lr", "fiat_500e")
SEEDS: Final = 100
ORDERS: Final[Mapping[str, int]] = {"udds": 76, "hwfet": 28, "wltc": 63}
"""Seed of the order of each trace: the one of `SEEDS` whose energy is nearest to that of the schedule."""

Transitions = Mapping[tuple[int, int], int]
"""Seconds by speed before and after, in steps of `SPEED_STEP_M_S`."""


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


def circuit(counts: Transitions, order: int) -> IntArray:
    """Speeds, in steps, of an Eulerian circuit from standstill, shape (seconds + 1,). O(seconds).

    Parameters
    ----------
    counts : mapping
        As from `counted`; every speed is entered as often as it is left.
    order : int
        Seed of the order in which the ways out of a speed are taken. Seconds at one speed are spread evenly over the visits.
    """
    rng = np.random.default_rng(order)
    ways: dict[int, list[int]] = {}
    constant: dict[int, int] = {}
    for (before, after), seconds in counts.items():
        if before == after:
            constant[before] = seconds
        else:
            ways.setdefault(before, []).extend([after] * seconds)
    for ends in ways.values():
        rng.shuffle(ends)
    stack, path = [0], []
    while stack:
        if ways.get(stack[-1]):
            stack.append(ways[stack[-1]].pop())
        else:
            path.append(stack.pop())
    visits = Counter(path)
    seen: dict[int, int] = {}
    edges: list[int] = []
    for speed in reversed(path):
        k = seen[speed] = seen.get(speed, 0) + 1
        seconds, n = constant.get(speed, 0), visits[speed]
        edges += [speed] * (1 + k * seconds // n - (k - 1) * seconds // n)
    return np.array(edges, dtype=np.int64)


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
        order = ORDERS[cycle]
        if search:
            order = min(range(SEEDS), key=lambda seed: abs(error(cycle, seed, counts, cars[1:2])[0]))
        rows += [(cycle, speed) for speed in circuit(counts, order).tolist()]
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
            out.writerow(["cycle", "speed"])
            out.writerows(rows)


if __name__ == "__main__":
    run(main)
