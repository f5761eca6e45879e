"""A fitted model on another car of which no trip was measured: that car's own physics, and what cars have in common.

It is the adaptation of `adapting` before its first trip: how much of the correction cars share, how wrong a car's book
is and how much larger the error may be are as uncertain as they are before anything was seen, and all of that is in
the interval.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tripwatt.forecasting.model import ForecastModel
from tripwatt.hybrid.car_corrector import HierarchicalCorrector
from tripwatt.hybrid.hierarchy import CarTransfer, Evidence, term_scales
from tripwatt.hybrid.parameters import on_road, parameters_of
from tripwatt.parallel import one_blas_thread
from tripwatt.transfer.adapting import TRANSFERRED, adapted_scale, weighted_quantiles
from tripwatt.trips import Flag
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.scale import T_VARIANCE
from tripwatt.vehicles import Vehicle, differences, load_vehicle, vehicle_names, with_differences
from tripwatt.vehicles.catalogue import beyond_classes, mass_range_kg
from tripwatt.vehicles.spreads import CLASS_ANCHORS


@one_blas_thread
def zero_shot_model(base: ForecastModel, vehicle: Vehicle) -> ForecastModel:
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
    >>> own, other = base.forecast(trips[11]), zero_shot_model(base, load_vehicle("nissan_leaf_24")).forecast(trips[11])
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


MOST_NAMED: Final = 5
"""Changed values that are named each; the rest is counted."""

_NO_ENERGY: Final = "charging"
"""Section of a car on which the energy of a drive does not depend."""


@dataclass(frozen=True, slots=True)
class OtherCar:
    """A car that is not the car of a model.

    Attributes
    ----------
    vehicle : Vehicle
        With its published values; a changed car keeps the model's values where it is not changed.
    flags : tuple of Flag
        That the model has no trips of it, and of a changed car each value that differs.
    """

    vehicle: Vehicle
    flags: tuple[Flag, ...]


def other_car(model: ForecastModel, vehicle: Vehicle | str | None) -> OtherCar | None:
    """Compare a car with that of a model, by value. O(values).

    A car of another name and other values is another car. A car of the model's name with other values is the model's car, changed: what its trips
    identified stays where nothing was changed. Values that trips changed count as equal to the published ones.

    Parameters
    ----------
    model : ForecastModel
        A fitted model.
    vehicle : Vehicle or str, optional
        A car, or the name of one of the library, or of the model's car.

    Returns
    -------
    OtherCar or None
        None for the model's own car, whatever its name and title.

    Raises
    ------
    InvalidInput
        When there is no such car.

    Examples
    --------
    >>> import tripwatt as tw
    >>> model, heavy = tw.load_model(), tw.load_vehicle("bmw_i3_60ah", overrides={"mass": 2500.0})
    >>> other_car(model, "bmw_i3_60ah") is None, other_car(model, heavy).flags[0].value
    (True, '1281 -> 2500')
    """
    own = model.vehicle
    if isinstance(vehicle, str):
        if vehicle == own.name and vehicle not in vehicle_names():
            return None
        vehicle = load_vehicle(vehicle, own.preset if vehicle == own.name else "default")
    if vehicle is None or vehicle is own:
        return None
    found = [d for d in differences(vehicle, own) if d.key.partition(".")[0] != _NO_ENERGY]
    if not found:
        return None
    if vehicle.name != own.name:
        return OtherCar(vehicle, (Flag("no_trips_of_car", own.title), *_beyond_flags(vehicle)))
    flags = [Flag("changed_car", d.key, d.change, d.unit) for d in found[:MOST_NAMED]]
    if len(found) > MOST_NAMED:
        flags.append(Flag("changed_car", "others", float(len(found) - MOST_NAMED), "1"))
    # the correction was learned with the model's values as they are, which need not be carried from a test to the road
    return OtherCar(replace(with_differences(own, found, vehicle), anchor="road"), tuple(flags))


def _beyond_flags(vehicle: Vehicle) -> tuple[Flag, ...]:
    """That values of a class are extrapolated to a car that is lighter or heavier than every car of the library."""
    mass = vehicle.body.curb_mass_kg
    if vehicle.anchor not in CLASS_ANCHORS or not beyond_classes(mass):
        return ()
    return (Flag("outside_classes", "lighter" if mass < mass_range_kg()[0] else "heavier", mass, "kg"),)


def on_vehicle(model: ForecastModel, vehicle: Vehicle | str | None) -> tuple[ForecastModel, tuple[Flag, ...]]:
    """Put a model on the chosen car.

    Cars are compared by value (`other_car`). A car of the model's name with other values is forecast with these values, and as another car
    in what was learned: the trips were of the unchanged one.

    Parameters
    ----------
    model : ForecastModel
        A fitted model.
    vehicle : Vehicle or str, optional
        A car, or the name of one of the library; the model's own when not given.

    Returns
    -------
    model : ForecastModel
        Of the chosen car; the same object for the model's own car, unless its charging power differs.
    flags : tuple of Flag
        That the car has no trips, or in what it differs from the model's car; empty for the model's own car.

    Raises
    ------
    InvalidInput
        When there is no such car, or the model cannot be transferred.

    Examples
    --------
    >>> import tripwatt as tw
    >>> model, flags = on_vehicle(tw.load_model("bmw_i3_tum"), "vw_id3")
    >>> model.vehicle.name, flags[0].code
    ('vw_id3', 'no_trips_of_car')
    """
    other = other_car(model, vehicle)
    if other is not None:
        return zero_shot_model(model, other.vehicle), other.flags
    if isinstance(vehicle, Vehicle) and vehicle.charging not in (None, model.vehicle.charging):
        return replace(model, vehicle=replace(model.vehicle, charging=vehicle.charging)), ()
    return model, ()
