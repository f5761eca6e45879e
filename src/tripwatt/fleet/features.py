"""The features in which the correction of a fleet is linear: causes of the simulation, and the climate."""

from __future__ import annotations

from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid import SegmentTable
from tripwatt.hybrid.groups import Scales
from tripwatt.hybrid.segments import LINE_CAUSES

WARM_DEGC: Final = 20.0
"""Outside air [°C] at which neither heating nor cooling is expected: a choice near the usual set-points of cabins."""

_SETTLING_S: Final = 900.0
"""Time constant [s] with which cabin and driveline settle after departure: a choice of
the order in which both warm up."""

CLIMATE: Final = ("cold", "hot", "cold_start", "start")

FEATURES: Final = (*LINE_CAUSES, *CLIMATE)
"""Names of the features: simulated power of each cause [W]; kelvin below (`cold`) and above (`hot`) `WARM_DEGC` [K]; with the factor
exp(-time since departure / `_SETTLING_S`), `cold` again (`cold_start`) [K], and the factor itself (`start`) [1]."""

SCALES: Final = np.array([0.1] * len(LINE_CAUSES) + [10.0, 10.0, 20.0, 150.0])
"""Usual size of each weight, a choice that only brings the features to one scale: a tenth of a cause [1]; W/K of `cold`, `hot` and `cold_start`; W of `start`."""

START: Final = Scales(
    ((0.5, 0.5), (0.5, 0.5), (0.3, 0.3)), 1.0, (*[0] * len(LINE_CAUSES), *[1] * len(CLIMATE))
)
"""Usual scales of car models, vehicles and drivers, for causes and for climate: the start of the search for the scales of a fleet."""


def segment_features(table: SegmentTable) -> FloatArray:
    """Return the features of each segment times the usual size of their weights [W], shape (segments, features). O(segments).

    An unknown outside temperature counts as `WARM_DEGC`.
    """
    features = table.features
    ambient = features["ambient_temperature_degc"].to_numpy(dtype=np.float64)
    below = np.where(np.isfinite(ambient), WARM_DEGC - ambient, 0.0)
    fading = np.exp(-features["time_s"].to_numpy(dtype=np.float64) / _SETTLING_S)
    cold, hot = np.maximum(below, 0.0), np.maximum(-below, 0.0)
    causes = [features[f"{cause}_w"].to_numpy(dtype=np.float64) for cause in LINE_CAUSES]
    return np.asarray(np.column_stack([*causes, cold, hot, cold * fading, fading]) * SCALES, dtype=np.float64)


def trip_features(table: SegmentTable) -> FloatArray:
    """Return the energy of each trip by each feature [Wh], shape (trips, features)."""
    weighted = segment_features(table) * table.hours[:, None]
    return np.asarray(np.add.reduceat(weighted, table.offsets[:-1], axis=0))


def trip_variance_wh2(table: SegmentTable) -> FloatArray:
    """Return the usual variance of the error of each trip [Wh²], shape (trips,).

    The variance is (40 Wh)² + (5 % of the energy moved at the wheels)². Only the ratios between trips count, since the level is
    estimated.
    """
    moved = table.totals_wh(table.features["moved_w"].to_numpy(dtype=np.float64))
    return np.asarray(40.0**2 + (0.05 * moved) ** 2)
