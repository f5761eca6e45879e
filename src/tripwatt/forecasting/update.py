"""The residual power of a trip, given the measurements so far."""

from __future__ import annotations

import numpy as np

from tripwatt.forecasting.expected import ExpectedTrip
from tripwatt.forecasting.measured import Columns, Measured, PowerReadings
from tripwatt.hybrid.climate_log import TOLD_BY, logged_climate
from tripwatt.trips import table_of
from tripwatt.uncertainty import ResidualPower, UncertaintyModel
from tripwatt.uncertainty.residual_power import PowerSum
from tripwatt.uncertainty.shrinkage import is_off


def updated_power(
    drive: ExpectedTrip,
    uncertainty: UncertaintyModel,
    samples: Columns,
    measured: Measured,
    readings: PowerReadings,
) -> tuple[ResidualPower, float]:
    """Posterior of the residual power, and the factor by which its standard deviation is widened for the rest of the trip.

    Climate control is updated separately if the samples have its power in all measured segments. O(segments).
    """
    process, shrinkage = uncertainty.process, uncertainty.shrinkage
    if not len(readings.power_w):  # no segment was measured for long enough
        return process.prior(drive.segments), 1.0
    segments = drive.segments
    ahead = drive.edges_s[1:] > measured.until_s + 1e-9
    fraction = min(measured.until_s / float(drive.edges_s[-1]), 1.0)
    residual = readings.power_w - readings.mean_of(drive.power_w)
    told = process.split and any(name in samples for name in TOLD_BY)
    logged = logged_climate(table_of(samples), drive.edges_s) if told else None
    needed = readings.touches(len(segments))
    expected = None if logged is None else drive.climate_w
    if logged is None or expected is None or not np.isfinite(logged[needed]).all():
        joint = readings.condition(process.prior(segments), residual)
        return shrinkage.applied("joint", joint, ahead, fraction), shrinkage.sd_factor(False, fraction)
    seen = readings.mean_of(np.nan_to_num(logged - expected))
    climate = readings.condition(process.prior(segments, "climate"), process.limited(seen), exact=True)
    driving = readings.condition(process.prior(segments, "drive"), residual - seen)
    if is_off(logged[needed], segments.step_s[needed]):
        off = PowerSum((climate,), np.where(ahead, -expected, climate.mean_w))
        climate = shrinkage.applied("off", off, ahead, fraction)
    else:
        climate = shrinkage.applied("climate", climate, ahead, fraction)
    driving = shrinkage.applied("drive", driving, ahead, fraction)
    return PowerSum((climate, driving), climate.mean_w + driving.mean_w), shrinkage.sd_factor(True, fraction)
