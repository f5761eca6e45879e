"""Trips that were held out of a fit of the corrector, in the form that the uncertainty model takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid import PowerCorrector, SegmentTable
from tripwatt.uncertainty.process import HeldOutResidual, Segments
from tripwatt.units import SECONDS_PER_HOUR


def process_segments(
    table: SegmentTable, uncertainty_w: FloatArray, outside_w: FloatArray | None = None
) -> Segments:
    """Segments of one trip in the form that the residual process takes.

    Parameters
    ----------
    table : SegmentTable
        Table of one trip.
    uncertainty_w : ndarray, shape (segments, any)
        Factor from `PowerCorrector.predict_with_uncertainty`.
    outside_w : ndarray, shape (segments, any), optional
        Factor from `PowerCorrector.outside_factor`.
    """
    features = table.features
    return Segments(
        time_s=features["time_s"].to_numpy(dtype=np.float64),
        step_s=table.hours * SECONDS_PER_HOUR,
        moved_w=features["moved_w"].to_numpy(dtype=np.float64),
        climate_w=features["climate_w"].to_numpy(dtype=np.float64),
        corrector_sd_wh=float(np.linalg.norm(table.hours @ uncertainty_w)),
        outside_sd_wh=0.0 if outside_w is None else float(np.linalg.norm(table.hours @ outside_w)),
        net_wh=float((table.hours * table.simulated_w).sum()),
        distance_m=float((table.hours * features["speed_m_s"].to_numpy(dtype=np.float64)).sum())
        * SECONDS_PER_HOUR,
    )


def held_out_residual(corrector: PowerCorrector, table: SegmentTable) -> HeldOutResidual:
    """Residual power of one trip, by a corrector that was fitted without this trip."""
    correction, uncertainty = corrector.predict_with_uncertainty(table)
    segments = process_segments(table, uncertainty, corrector.outside_factor(table))
    climate = corrector.predict_climate(table)
    left = None if climate is None else table.climate_residual_w - climate
    residual = HeldOutResidual(
        segments,
        table.residual_w - correction,
        measured_sd_wh=float(table.energy_errors.own_wh[0]),
        along=bool(table.energy_errors.along[0]),
    )
    if climate is None or left is None or not np.isfinite(left).all():
        return residual
    return replace(residual, climate_w=left, climate_expected_w=segments.climate_w + climate)
