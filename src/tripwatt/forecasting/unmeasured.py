"""A fitted model on another car of which no trip was measured: that car's own physics, and what cars have in common.

It is the adaptation of `adapting` before its first trip: how much of the correction cars share, how wrong a car's book
is and how much larger the error may be are as uncertain as they are before anything was seen, and all of that is in
the interval.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tripwatt.forecasting.adapting import _T_VARIANCE, TRANSFERRED, _quantiles, _scale
from tripwatt.forecasting.elsewhere import Elsewhere
from tripwatt.forecasting.model import ForecastModel
from tripwatt.forecasting.scores import Scores
from tripwatt.hybrid.parameters import PARAMETERS
from tripwatt.hybrid.transfer import CarTransfer, Evidence, part_scales
from tripwatt.hybrid.transferred import TransferredCorrector
from tripwatt.trips import Flag
from tripwatt.vehicles import Vehicle, load_vehicle


def unmeasured(base: ForecastModel, vehicle: Vehicle) -> ForecastModel:
    """Put a fitted model on a car that nobody has measured.

    Parameters
    ----------
    base : ForecastModel
        Fitted, with a corrector that holds a Gaussian process.
    vehicle : Vehicle

    Returns
    -------
    ForecastModel
        Its intervals hold the doubt of the car's book values and of what cars have in common.

    Raises
    ------
    InvalidInput
        When the base cannot be transferred.

    Examples
    --------
    >>> from tripwatt.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips = synthetic_fleet(n_trips=12).trips
    >>> base = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips[:11])
    >>> own, other = base.forecast(trips[11]), unmeasured(base, load_vehicle("nissan_leaf_24")).forecast(trips[11])
    >>> bool(other.sd_wh > own.sd_wh)
    True
    """
    origin = Elsewhere.of(base)
    transfer = CarTransfer(origin.members, part_scales(origin.members, base.vehicle, vehicle))
    features, nothing = np.empty((0, len(transfer.scales))), np.empty(0)
    evidence = Evidence(features, features, features, np.empty((0, len(PARAMETERS))), nothing, nothing)
    posterior = transfer.posterior(evidence)
    spread = np.sqrt([option.noise / posterior.noise_scale for option in posterior.options])
    values = (origin.scores.values[:, None] / np.sqrt(_T_VARIANCE) * spread).ravel()  # as `_scale` counts it
    weight = np.tile(posterior.weights / len(origin.scores.values), len(origin.scores.values))
    return ForecastModel(
        vehicle=vehicle,
        corrector=TRANSFERRED,
        seed=base.seed,
        fitted_=TransferredCorrector.of(transfer, posterior, frozenset()),
        process_=None if base.process_ is None else replace(base.process_, apart=False),
        scale_=_scale(origin.scale, posterior.noise_scale),
        scores_=Scores.of(_quantiles(values, weight).tolist()),
        gain_=base.gain_,
        route_doubt_=base.route_doubt_,
        ranges_=base.ranges_,
    )


def on_vehicle(model: ForecastModel, vehicle: Vehicle | str | None) -> tuple[ForecastModel, tuple[Flag, ...]]:
    """A model on the car that is asked for, and the flag of a car without trips.

    Parameters
    ----------
    model : ForecastModel
    vehicle : Vehicle or str, optional
        A car, or the name of one of the library; the model's own when not given.

    Raises
    ------
    InvalidInput
        When there is no such car, or the model cannot be transferred.
    """
    name = vehicle.name if isinstance(vehicle, Vehicle) else vehicle
    if name is None or name == model.vehicle.name:
        return model, ()
    car = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(name)
    return unmeasured(model, car), (Flag("no_trips_of_car", model.vehicle.title),)
