"""A fitted model adapted to another car: that car's own physics, the base's correction, and a few trips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.forecasting.donor import DonorModel, unknown_inputs
from tripwatt.forecasting.fitting import held_out_figures, provenance_of
from tripwatt.forecasting.model import ForecastModel, HeldOut
from tripwatt.forecasting.ranges import NEVER_KNOWN, training_ranges
from tripwatt.hybrid import SegmentTable, segment_trips
from tripwatt.hybrid.car_corrector import HierarchicalCorrector
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.hierarchy import CarTransfer, Evidence, Posterior, require_mode, term_scales
from tripwatt.hybrid.parameters import changed, on_road, parameters_of, sensitivities
from tripwatt.hybrid.segments import require_measured
from tripwatt.parallel import one_blas_thread
from tripwatt.trips import Fleet, Trip, plan_from_trip
from tripwatt.uncertainty import ChargeScale
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.scale import T_VARIANCE, TotalScale
from tripwatt.vehicles import Vehicle

TRANSFERRED: Final = "transferred"
"""Name of the corrector of an adapted model."""

BASE_TRIPS: Final = 10.0
"""Weight of the base's scores beside the own trips', in trips: the fewest that show a 90 % interval at all."""

_LEVELS: Final = 40
"""ConformalScores that an adapted model keeps."""

PROTOCOL: Final = "own trips, each left out of the adaptation"


@dataclass(frozen=True, eq=False)
class Adaptation:
    """A model on its new car, and what was estimated for it.

    Attributes
    ----------
    model : ForecastModel
        The adapted model.
    posterior : Posterior
        What was estimated of the car.
    parameters : mapping of str to (float, float)
        Relative change of each physical parameter and its standard deviation.
    masked_inputs : tuple of str
        Inputs that the new car's log lacks, masked in the donor model.

    Examples
    --------
    >>> adapted = adaptation(base, trips, vehicle)  # doctest: +SKIP
    >>> adapted.model.forecast(plan)  # doctest: +SKIP
    """

    model: ForecastModel
    posterior: Posterior
    parameters: Mapping[str, tuple[float, float]]
    masked_inputs: tuple[str, ...]


@one_blas_thread
def adaptation(
    base: ForecastModel, trips: Sequence[Trip], vehicle: Vehicle, *, mode: str = "both"
) -> Adaptation:
    """Put a fitted model on another car, with that car's trips. O(options x features^2 + trips^3).

    Parameters
    ----------
    base : ForecastModel
        Fitted, with a corrector that holds a Gaussian process: linear, gp, ensemble or split.
    trips : sequence of Trip
        Of the new car, at least one, with measured energy.
    vehicle : Vehicle
        The new car with its published values.
    mode : {"both", "effects", "parameters"}
        What may differ between the cars: terms of the corrector, physical parameters, or both.

    Returns
    -------
    Adaptation
        Its model forecasts like any other. Mass, rolling, air and base load of its car are calibrated.

    Raises
    ------
    InvalidInput
        When the base cannot be transferred, or a trip has no measured energy.

    Examples
    --------
    >>> from tripwatt.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips = synthetic_fleet(n_trips=12).trips
    >>> base = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips[:10])
    >>> adapted = adaptation(base, trips[10:11], load_vehicle("nissan_leaf_24"))
    >>> adapted.model.vehicle.title, len(adapted.model.trip_ids_)
    ('Nissan Leaf 24 kWh', 1)
    """
    require_mode(mode)
    require_measured(trips)
    donor, masked = _donor(base, trips)
    parameters, vehicle = parameters_of(vehicle), on_road(vehicle)
    table = segment_trips(trips, vehicle)
    transfer = CarTransfer(donor.members, term_scales(donor.members, base.vehicle, vehicle), parameters, mode)
    changes_w = sensitivities([plan_from_trip(trip) for trip in trips], vehicle, table, parameters)
    evidence = transfer.evidence(table, changes_w, donor.variances_wh2(table))
    posterior = transfer.posterior(evidence)
    changes = posterior.parameters([p.name for p in parameters])
    calibrated = {p.name: changes[p.name][0] for p in parameters if p.keys}
    source = f"calibrated on {len(trips)} trip{'s' if len(trips) > 1 else ''} of the car"
    own_car = changed(vehicle, calibrated, source=source) if mode != "effects" else vehicle
    model = transferred(base, donor, own_car, transfer, posterior, frozenset(calibrated))
    assert model.uncertainty_ is not None
    centre, corrector_variance = transfer.left_out(evidence)
    observed, error = table.totals_wh(table.observed_power_w), evidence.residual_wh - centre
    own = error / np.sqrt(evidence.error_wh2(posterior.noise_scale) + corrector_variance)
    share = _share_of_energy(table, donor.scale, evidence.noise_wh2, posterior.noise_scale)
    uncertainty = replace(
        model.uncertainty_,
        charge=None if table.charge is None else ChargeScale.from_readings(table.charge, observed),
        scale=replace(model.uncertainty_.scale, least_share=share),
        scores=_scores(donor.scores, posterior, own),
    )
    model = replace(
        model,
        uncertainty_=uncertainty,
        ranges_=_joined(base.ranges_, training_ranges(table), masked),
        trip_ids_=table.trip_ids,
        held_out_=tuple(
            HeldOut(name, float(o), float(o - e), float(s))
            for name, o, e, s in zip(table.trip_ids, observed, error, own, strict=True)
        ),
    )
    return Adaptation(model, posterior, changes, masked)


@one_blas_thread
def without_trips(base: ForecastModel, vehicle: Vehicle) -> ForecastModel:
    """Put a fitted model on a car without a measured trip.

    It is the adaptation before its first trip: how much of the correction cars share, how far a car is from its published values and how
    much larger the error may be are as uncertain as before any trip, and all of that is in the interval.

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
    donor = base.donor_ or base.as_donor()  # without the cabin, which few of its departures know
    parameters, vehicle = parameters_of(vehicle), on_road(vehicle)
    transfer = CarTransfer(donor.members, term_scales(donor.members, base.vehicle, vehicle), parameters)
    features, nothing = np.empty((0, len(transfer.scales))), np.empty(0)
    evidence = Evidence(features, features, features, np.empty((0, len(parameters))), nothing, nothing)
    return transferred(base, donor, vehicle, transfer, transfer.posterior(evidence), frozenset())


def transferred(
    base: ForecastModel,
    donor: DonorModel,
    vehicle: Vehicle,
    transfer: CarTransfer,
    posterior: Posterior,
    calibrated: frozenset[str],
) -> ForecastModel:
    """A model of another car from the posterior of its correction; of its own trips only the posterior counts."""
    _, uncertainty = base.fitted_parts("base")
    return ForecastModel(
        vehicle=vehicle,
        corrector=TRANSFERRED,
        seed=base.seed,
        corrector_=HierarchicalCorrector.from_posterior(transfer, posterior, calibrated),
        uncertainty_=replace(
            uncertainty,
            process=replace(uncertainty.process, split=False),
            charge=None,
            scale=adapted_scale(donor.scale, posterior.noise_scale),
            scores=_scores(donor.scores, posterior, np.empty(0)),
        ),
        ranges_=base.ranges_,
    )


def adapt_model(
    fleet: Fleet,
    vehicle: Vehicle,
    base: ForecastModel,
    about_base: Mapping[str, Any],
    *,
    mode: str = "both",
) -> tuple[ForecastModel, dict[str, Any], dict[str, Any]]:
    """Audit a car's logs, adapt a stored model to the sound trips, and keep where both come from.

    Parameters
    ----------
    fleet : Fleet
        Logs of the new car, as a reader gave them.
    vehicle : Vehicle
        The new car.
    base : ForecastModel
        The stored model, of another car.
    about_base : mapping
        The base's metadata, as `load_metadata` gives them.
    mode : str
        As for `adaptation`.

    Returns
    -------
    model, provenance, evaluation
        As of `fit_with_provenance`; the provenance nests the base's with its digest.

    Examples
    --------
    >>> model, provenance, evaluation = adapt_model(fleet, vehicle, base, load_metadata())  # doctest: +SKIP
    """
    sound = audit(fleet)
    done = adaptation(base, sound.trips, vehicle, mode=mode)
    provenance = {
        **provenance_of(fleet, sound, done.model, _cars(sound.trips)),
        "adapted": {
            "trips": len(sound.trips),
            "mode": mode,
            "hidden": list(done.masked_inputs),
            "share_in_common": done.posterior.share,
            "shares_by_stage": list(done.posterior.shares),
            "noise_scale": done.posterior.noise_scale,
            "parameters": {k: {"change": m, "sd": s} for k, (m, s) in done.parameters.items()}
            if mode != "effects"
            else {},
        },
        "base": {name: about_base[name] for name in ("sha256", "tripwatt", "model", "provenance")},
    }
    return done.model, provenance, {**held_out_figures(done.model.held_out_), "protocol": PROTOCOL}


def _cars(trips: Sequence[Trip]) -> list[str]:
    """A note where several cars count as one."""
    cars = sorted({trip.context.car for trip in trips if trip.context.car is not None})
    return [f"cars {', '.join(cars)} count as one car"] if len(cars) > 1 else []


def _donor(base: ForecastModel, trips: Sequence[Trip]) -> tuple[DonorModel, tuple[str, ...]]:
    """The donor model for the new car, fitted with no more inputs than its log has, and the masked inputs."""
    usual = base.as_donor()
    used = {column for term in usual.members.terms for column in term.columns}
    missing = tuple(name for name in unknown_inputs(trips) if name in used)
    if missing and base.donor_ is not None:
        return base.donor_, base.donor_.masked_inputs
    return usual, missing


def adapted_scale(base: TotalScale, noise_scale: float) -> TotalScale:
    """Scale of an adapted model's totals: the base's errors times the noise of own trips; the corrector's uncertainty in full."""
    factor = np.sqrt(noise_scale * T_VARIANCE)
    return TotalScale(np.append(base.values[:3] * factor, 1.0), base.course)


def _share_of_energy(
    table: SegmentTable, base: TotalScale, noise_wh2: FloatArray, noise_scale: float
) -> float:
    """Root mean square of the errors of own trips, less their constant part, over the energy moved.

    How the errors of this car grow with a trip was seen on the base's trips alone. What no published value has (wind, tyres, load,
    the driver) takes a share of the energy, and no error grows faster. Small errors on a few trips do not show that those of
    long ones are smaller than the base's.
    """
    moved = np.add.reduceat(table.features["moved_w"].to_numpy() * table.hours, table.offsets[:-1])
    constant = base.values[0] ** 2 * T_VARIANCE
    driven = np.maximum(moved, 0.5 * np.median(moved))  # a trip that hardly moves has no share of its own
    square = np.maximum(noise_wh2 - constant, 0.0) * max(noise_scale, 1.0)
    return float(np.sqrt(np.mean(square / driven**2)))


def _scores(base: ConformalScores, posterior: Posterior, own: FloatArray) -> ConformalScores:
    """Standardised errors: the base's, over the posterior of the error's scale, and those of own trips, each left out in turn.

    The base counts as `BASE_TRIPS` of them, so that one trip alone neither narrows nor blows up an interval.
    """
    spread = np.sqrt([option.noise / posterior.noise_scale for option in posterior.options])
    usual = base.values[:, None] / np.sqrt(T_VARIANCE) * spread  # as in `adapted_scale`
    share = BASE_TRIPS / (BASE_TRIPS + len(own))
    weight = np.tile(share * posterior.weights / len(usual), len(usual))
    own_weight = np.full(len(own), (1.0 - share) / max(len(own), 1))
    values = weighted_quantiles(np.append(usual.ravel(), np.abs(own)), np.append(weight, own_weight))
    return ConformalScores.from_errors(values.tolist())


def weighted_quantiles(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Values at evenly spread levels of a weighted sample."""
    order = np.argsort(values)
    level = np.cumsum(weight[order]) - 0.5 * weight[order]
    return np.asarray(np.interp((np.arange(_LEVELS) + 1.0) / (_LEVELS + 1.0), level, values[order]))


def _joined(base: Mapping[str, Range], own: Mapping[str, Range], masked: Sequence[str]) -> dict[str, Range]:
    """Ranges over the trips of both cars; a masked input has none."""
    joined = {}
    for name, old in base.items():
        new = own.get(name, old)
        joined[name] = (
            NEVER_KNOWN
            if name in masked
            else Range(min(old.low, new.low), max(old.high, new.high), old.sd)
            if np.isfinite(new.low)
            else old
        )
    return joined
