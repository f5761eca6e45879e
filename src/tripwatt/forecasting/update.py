"""The residual power of a trip, given what was measured of it so far."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.forecasting.expected import ExpectedDrive
from tripwatt.forecasting.measured import Measured, PowerReadings
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.uncertainty import PowerPosterior, PowerPrior, UncertaintyModel
from tripwatt.uncertainty.process import EXACT_W2
from tripwatt.uncertainty.shrinkage import is_off


def updated_power(
    drive: ExpectedDrive,
    uncertainty: UncertaintyModel,
    samples: pd.DataFrame,
    measured: Measured,
    readings: PowerReadings,
) -> tuple[PowerPosterior | PowerPrior, float]:
    """Posterior of the residual power, and the factor of its standard deviation for the rest of the trip.

    Climate control is updated separately where the samples have its power. O(segments^2 x readings).
    """
    process, shrinkage = uncertainty.process, uncertainty.shrinkage
    if not len(readings.power_w):  # no segment was measured for long enough
        return process.prior(drive.segments), 1.0
    weights = readings.weights
    ahead = drive.edges_s[1:] > measured.until_s + 1e-9
    fraction = min(measured.until_s / float(drive.edges_s[-1]), 1.0)
    residual = readings.power_w - weights @ drive.power_w
    expected, logged = _climate_power(drive, samples) if process.split else (None, None)
    needed = (weights > 0.0).any(axis=0)
    if expected is None or logged is None or not np.isfinite(logged[needed]).all():
        joint = PowerPosterior.from_covariance(process.covariance(drive.segments))
        joint = joint.given(weights, residual, readings.variance_w2)
        return shrinkage.applied("joint", joint, ahead, fraction), shrinkage.sd_factor(False, fraction)
    seen = weights @ np.nan_to_num(logged - expected)
    own = PowerPosterior.from_covariance(process.climate_covariance(drive.segments))
    own = own.given(weights, process.limited(seen), np.full(len(seen), EXACT_W2))
    driving = PowerPosterior.from_covariance(process.drive_covariance(drive.segments))
    driving = driving.given(weights, residual - seen, readings.variance_w2)
    if is_off(logged[needed], drive.segments.step_s[needed]):
        posterior = PowerPosterior(np.where(ahead, -expected, own.mean_w), own.covariance_w2)
        posterior = shrinkage.applied("off", posterior, ahead, fraction)
    else:
        posterior = shrinkage.applied("climate", own, ahead, fraction)
    posterior += shrinkage.applied("drive", driving, ahead, fraction)
    return posterior, shrinkage.sd_factor(True, fraction)


def _climate_power(
    drive: ExpectedDrive, samples: pd.DataFrame
) -> tuple[FloatArray, FloatArray] | tuple[None, None]:
    """Expected and measured power of climate control [W]; NaN in segments that were not measured."""
    logged = logged_climate(samples, drive.edges_s)
    expected = None if logged is None else drive.climate_w
    return (None, None) if logged is None or expected is None else (expected, logged)
