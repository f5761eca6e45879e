"""Speed traces with the same changes of speed as the schedules of certification.

`data/transitions.csv` counts, for UDDS, HWFET and WLTC (class 3b), how often one second takes the car from one speed to the
next, on a grid of `SPEED_STEP_M_S`. A trace that makes each of these changes as often as the schedule does has its distance, its
stops and, for a warm car without climate control, its energy, in another order. Such a trace is an Eulerian circuit of the
counts (Hierholzer's algorithm). `python -m tools.data.schedules --write` makes the file and chooses the order.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray

SPEED_STEP_M_S: Final = 0.1
"""Grid of the speeds; at 0.1 m/s the energy of a schedule changes by 0.1 % and less."""

CYCLES: Final = ("udds", "hwfet", "wltc")
"""City and highway schedule of the EPA (40 CFR 600.111), and the cycle of UN GTR 15 for cars of class 3b."""

ORDERS: Final[Mapping[str, int]] = {"udds": 76, "hwfet": 28, "wltc": 63}
"""Seed of the order of each trace: the one of 100 whose energy is nearest to that of the schedule."""

Transitions = Mapping[tuple[int, int], int]
"""Seconds by speed before and after, in steps of `SPEED_STEP_M_S`."""


@cache
def transitions(cycle: str) -> Transitions:
    """Changes of speed of a schedule.

    Examples
    --------
    >>> sum(transitions("hwfet").values())
    765
    """
    file = resources.files("tripwatt.certification") / "data" / "transitions.csv"
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines())
    counts = {(int(r["from"]), int(r["to"])): int(r["seconds"]) for r in rows if r["cycle"] == cycle}
    return MappingProxyType(counts)


@cache
def schedule(cycle: str) -> tuple[FloatArray, FloatArray]:
    """Time [s] and speed [m/s] of a trace with the changes of speed of a schedule, each of shape (samples,).

    Parameters
    ----------
    cycle : str
        One of `CYCLES`.

    Examples
    --------
    >>> time, speed = schedule("udds")
    >>> float(time[-1]), round(float(np.trapezoid(speed, time)) / 1000.0, 2)
    (1369.0, 11.99)
    """
    speed = SPEED_STEP_M_S * circuit(transitions(cycle), ORDERS[cycle]).astype(np.float64)
    time = np.arange(len(speed), dtype=np.float64)
    for values in (time, speed):
        values.setflags(write=False)
    return time, speed


def circuit(counts: Transitions, order: int) -> IntArray:
    """Speeds, in steps, of an Eulerian circuit from standstill, shape (seconds + 1,). O(seconds).

    Parameters
    ----------
    counts : mapping
        As from `transitions`; every speed is entered as often as it is left.
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
    whole: list[int] = []
    for speed in reversed(path):
        k = seen[speed] = seen.get(speed, 0) + 1
        seconds, n = constant.get(speed, 0), visits[speed]
        whole += [speed] * (1 + k * seconds // n - (k - 1) * seconds // n)
    return np.array(whole, dtype=np.int64)
