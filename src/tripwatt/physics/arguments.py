"""Checks of the arguments of `simulate`, which find all faults at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
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
    scalars: Mapping[str, tuple[float, float, float]],
    headwind: FloatArray | None = None,
) -> Iterator[Fault]:
    """Yield a fault for every argument of `simulate` that cannot be used.

    `scalars` maps a name to its value, the lowest and the highest value allowed.
    """
    if time.ndim != 1 or len(time) < 2:
        yield Fault("wrong shape", "time_s", str(time.shape), "one dimension, at least 2 samples")
    arrays = {
        "time_s": time,
        "speed_m_s": speed,
        "grade": slope,
        "elevation_m": height,
        "climate_power_w": climate,
        "headwind_m_s": headwind,
    }
    for name, values in arrays.items():
        if values is None or (name == "climate_power_w" and values.ndim == 0):
            continue
        if values.shape != time.shape:
            yield Fault("wrong shape", name, str(values.shape), f"that of time_s, {time.shape}")
        elif name == "elevation_m":
            if np.isinf(values).any():
                yield Fault("infinite value", name, "inf", "finite numbers, NaN where missing")
        elif not np.isfinite(values).all():
            first = int(np.flatnonzero(~np.isfinite(values.ravel()))[0])
            where, got = f"{name}, sample {first}", str(values.ravel()[first])
            yield Fault("missing value", where, got, "finite numbers")
    if time.ndim == 1 and not (time[1:] > time[:-1]).all() and np.isfinite(time).all():
        first = int(np.flatnonzero(np.diff(time) <= 0)[0]) + 1
        got = f"{time[first]:g} s after {time[first - 1]:g} s"
        yield Fault("time does not increase", f"time_s, sample {first}", got, "increasing times")
    for name, values, low, high in (
        ("speed_m_s", speed, *COLUMNS["speed_m_s"].bounds),
        ("grade", slope, *COLUMNS["grade"].bounds),
        ("climate_power_w", climate, 0.0, 1e5),
        ("headwind_m_s", headwind, -STRONGEST_WIND_M_S, STRONGEST_WIND_M_S),
    ):
        if values is None or not values.size:
            continue
        smallest, largest = float(values.min()), float(values.max())
        if (smallest < low or largest > high) and np.isfinite(values).all():
            got = f"{smallest if smallest < low else largest:g}"
            yield Fault("value out of range", name, got, f"{low:g} to {high:g}")
    for name, (value, low, high) in scalars.items():
        if not (math.isfinite(value) and low <= value <= high):
            yield Fault("value out of range", name, f"{value}", f"{low:g} to {high:g}")
