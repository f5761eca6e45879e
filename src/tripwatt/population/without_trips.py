"""A fitted model on another car of which no trip was measured: that car's own physics, and what cars have in common.

It is the adaptation of `adapting` before its first trip: how much of the correction cars share, how wrong a car's book
is and how much larger the error may be are as uncertain as they are before anything was seen, and all of that is in
the interval.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tripwatt.forecasting.model import ForecastModel
from tripwatt.hybrid.car_corrector import HierarchicalCorrector
from tripwatt.hybrid.hierarchy import CarTransfer, Evidence, term_scales
from tripwatt.hybrid.parameters import on_road, parameters_of
from tripwatt.parallel import one_blas_thread
from tripwatt.population.adapting import TRANSFERRED, adapted_scale, weighted_quantiles
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.scale import T_VARIANCE
from tripwatt.vehicles import Vehicle


@one_blas_thread
def without_trips(base: ForecastModel, vehicle: Vehicle) -> ForecastModel:
    """Put a fitted model on a car without a measured trip.

    Parameters
    ----------
    base : ForecastModel
        Fitted, with a corrector that holds a Gaussian process.
    vehicle : Vehicle
        The car without trips.

    Returns
    -------
    ForecastModel
        Its intervals contain the uncertainty of the car's published values and of what cars have in common.

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
    >>> own, other = base.forecast(trips[11]), without_trips(base, load_vehicle("nissan_leaf_24")).forecast(trips[11])
    >>> bool(other.sd_wh > own.sd_wh)
    True
    """
    _, own = base.fitted_parts("base")
    donor = base.donor_ or base.as_donor()  # without the cabin, which few of its departures know
    parameters, vehicle = parameters_of(vehicle), on_road(vehicle)
    transfer = CarTransfer(donor.members, term_scales(donor.members, base.vehicle, vehicle), parameters)
    features, nothing = np.empty((0, len(transfer.scales))), np.empty(0)
    evidence = Evidence(features, features, features, np.empty((0, len(parameters))), nothing, nothing)
    posterior = transfer.posterior(evidence)
    spread = np.sqrt([option.noise / posterior.noise_scale for option in posterior.options])
    values = (donor.scores.values[:, None] / np.sqrt(T_VARIANCE) * spread).ravel()  # as in `adapted_scale`
    weight = np.tile(posterior.weights / len(donor.scores.values), len(donor.scores.values))
    uncertainty = replace(
        own,
        process=replace(own.process, split=False),
        charge=None,
        scale=adapted_scale(donor.scale, posterior.noise_scale),
        scores=ConformalScores.from_errors(weighted_quantiles(values, weight).tolist()),
    )
    return ForecastModel(
        vehicle=vehicle,
        corrector=TRANSFERRED,
        seed=base.seed,
        corrector_=HierarchicalCorrector.from_posterior(transfer, posterior, frozenset()),
        uncertainty_=uncertainty,
        ranges_=base.ranges_,
    )
