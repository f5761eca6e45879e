"""Checks of the arguments of `simulate`, which find all faults at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault
from tripwatt.trips import COLUMNS, QUANTITIES

STRONGEST_WIND_M_S: Final = QUANTITIES["wind_speed_m_s"].maximum


def argument_faults(
    time: FloatArray,
    speed: FloatArray,
    slope: FloatArray | None,
    height: FloatArray | None,
    climate: FloatArray,
    headwind: FloatArray | None = None,
) -> Iterator[Fault]:
    """Yield a fault for every argument of `simulate` that cannot be used.

    All arrays have the shape of `time`; `climate` may also be a single number, and `height` may have NaN.
    """
    if time.ndim != 1 or len(time) < 2:
        yield Fault("wrong shape", "time_s", str(time.shape), "one dimension, at least 2 samples")
    elif np.isfinite(time).all() and not (time[1:] > time[:-1]).all():
        late = int(np.flatnonzero(np.diff(time) <= 0)[0]) + 1
        got = f"{time[late]:g} s after {time[late - 1]:g} s"
        yield Fault("time does not increase", f"time_s, sample {late}", got, "increasing times")
    for name, values, low, high in (
        ("time_s", time, -np.inf, np.inf),
        ("speed_m_s", speed, *COLUMNS["speed_m_s"].bounds),
        ("grade", slope, *COLUMNS["grade"].bounds),
        ("elevation_m", height, -np.inf, np.inf),
        ("climate_power_w", climate, 0.0, 1e5),
        ("headwind_m_s", headwind, -STRONGEST_WIND_M_S, STRONGEST_WIND_M_S),
    ):
        if values is None:
            continue
        if values.shape not in (time.shape, () if name == "climate_power_w" else time.shape):
            yield Fault("wrong shape", name, str(values.shape), f"that of time_s, {time.shape}")
        wrong = np.isinf(values) if name == "elevation_m" else ~np.isfinite(values)
        if wrong.any():
            sample = int(np.flatnonzero(wrong)[0])
            where, got = f"{name}, sample {sample}", str(values.flat[sample])
            yield Fault("missing value", where, got, "finite numbers")
        elif values.size and (values.min() < low or values.max() > high):
            got = f"{values.min() if values.min() < low else values.max():g}"
            yield Fault("value out of range", name, got, f"{low:g} to {high:g}")
