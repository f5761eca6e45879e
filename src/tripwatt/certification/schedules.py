"""Speed traces with the same changes of speed as the schedules of certification.

`data/schedules.csv` has one trace each for UDDS, HWFET and WLTC (class 3b). It contains each change from one speed to another as often
as the schedule does, on a grid of `SPEED_STEP_M_S`, but in another order. Distance, stops and, for a warm car without climate control,
energy are those of the schedule. `python -m tools.data.schedules --write` makes the file.
"""

from __future__ import annotations

import csv
from functools import cache
from importlib import resources
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray

SPEED_STEP_M_S: Final = 0.1
"""Step of the grid of speeds; at 0.1 m/s the energy of a schedule changes by at most 0.1 %."""

CYCLES: Final = ("udds", "hwfet", "wltc")
"""City and highway schedule of the EPA (40 CFR 600.111), and the cycle of UN GTR 15 for cars of class 3b."""


@cache
def schedule(cycle: str) -> tuple[FloatArray, FloatArray]:
    """Return time [s] and speed [m/s] of the trace that stands for a schedule, shape (samples,) each.

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
    file = resources.files("tripwatt.certification") / "data" / "schedules.csv"
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines())
    speed = SPEED_STEP_M_S * np.array([float(row["speed"]) for row in rows if row["cycle"] == cycle])
    time = np.arange(len(speed), dtype=np.float64)
    for values in (time, speed):
        values.setflags(write=False)
    return time, speed
