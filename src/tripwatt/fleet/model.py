"""A model of a fleet: fitted on a store, updated with the trips of a night, and the forecasts of each vehicle.

The linear part is exact and cheap to update: sums of trips add up. Trees, residual process and conformal scores come from
a seeded sample and stay as they are until the next fit.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray, by_key, covariance_factor
from tripwatt.errors import InvalidInput
from tripwatt.fleet.corrector import FleetCorrector, FleetTrees, choose_rounds
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.features import FEATURES, START
from tripwatt.fleet.mapping import SampledTrips, load_car, sample_digests, store_rows, usable_trips
from tripwatt.fleet.statistics import TripRows
from tripwatt.fleet.store import TripStore
from tripwatt.forecasting.forecast import Forecast
from tripwatt.forecasting.model import ForecastModel
from tripwatt.forecasting.ranges import training_ranges
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.groups import GroupPosterior, Scales, Sums, fit_scales, group_posterior
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.uncertainty import ChargeScale, ConformalScores, UncertaintyModel
from tripwatt.uncertainty.model import scale_wh
from tripwatt.uncertainty.process import held_out_residual

_FOLDS: Final = 5
_MIN_TRIPS: Final = 8
"""A choice, because fewer trips do not show their own spread."""
_PROCESS_TRIPS: Final = 200
"""Trips on which the residual process is estimated: a choice, because its few parameters do not gain by more, and each trip is slow."""

_MIN_SCORES: Final = 60
"""Sampled trips from which on a car model, or a temperature class of all models, has conformal scores of its own: a choice, because the
95 % quantile of 60 scores has three above it."""

COLD_DEGC: Final = 8.0
"""Bound [°C] of the two temperature classes: a choice, because cabin and battery take much heat below it."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """How many trips a fit samples to read segment by segment.

    Attributes
    ----------
    per_vehicle : int
        Largest number of trips of a vehicle.
    vehicles : int
        Largest number of vehicles of a car model.
    seed : int
    """

    per_vehicle: int = 10
    vehicles: int = 25
    seed: int = 0


@dataclass(eq=False, repr=False)
class FleetModel:
    """A fitted model of a fleet.

    Attributes
    ----------
    sums : Sums
        Sums of all trips on which the linear part was fitted.
    posterior : GroupPosterior
    trees : FleetTrees
    uncertainty : UncertaintyModel
        Uncertainty of the whole fleet.
    scores : mapping of str to ConformalScores
        Scores of each car model and temperature class ("cold", "mild") with at least `_MIN_SCORES` sampled trips.
    charges : mapping of str to ChargeScale
        By car model.
    ranges : mapping of str to Range
        Ranges of the features in the sampled trips.
    digests : frozenset of str
        Digests of the trips on which the model was fitted.
    sampled : int
        Number of sampled trips.
    about : dict
        Provenance of the fit.
    """

    sums: Sums
    posterior: GroupPosterior
    trees: FleetTrees
    uncertainty: UncertaintyModel
    scores: Mapping[str, ConformalScores]
    charges: Mapping[str, ChargeScale]
    ranges: dict[str, Range]
    digests: frozenset[str]
    sampled: int = 0
    about: dict[str, Any] = field(default_factory=dict)

    @property
    def trips(self) -> int:
        """Number of trips on which the linear part was fitted."""
        return round(float(self.sums.count.sum()))

    @cached_property
    def _counts(self) -> Counter[tuple[str, ...]]:
        """Number of trips by (car model, vehicle), computed once for all forecasts."""
        counts: Counter[tuple[str, ...]] = Counter()
        for group, count in zip(self.sums.groups, self.sums.count.round().astype(int).tolist(), strict=True):
            counts[group[:2]] += count
        return counts

    @cached_property
    def _models_by_vehicle(self) -> dict[str, str]:
        return {vehicle: name for name, vehicle in self._counts}

    def vehicles(self) -> Mapping[str, str]:
        """Return the car model of each vehicle."""
        return self._models_by_vehicle

    def of_vehicle(
        self,
        vehicle_id: str | None = None,
        *,
        car_model: str | None = None,
        driver: str | None = None,
        ambient_degc: float | None = None,
    ) -> ForecastModel:
        """Return the forecasting model of one vehicle.

        Parameters
        ----------
        vehicle_id : str, optional
            A vehicle without trips starts from its car model.
        car_model : str, optional
            Name of a car of the library. By default, the car model of the vehicle's trips.
        driver : str, optional
        ambient_degc : float, optional
            Outside temperature [°C]. The scores of its class are used if the car model has none of its own.

        Raises
        ------
        InvalidInput
            If the vehicle is new and no car model is given, or if its trips are of another car model.
        """
        fitted_model = self.vehicles().get(vehicle_id or "")
        if fitted_model is None and car_model is None:
            got, fix = repr(vehicle_id), "give the car model of a new vehicle"
            allowed = f"a vehicle with trips, such as {next(iter(self.vehicles()), '')!r}"
            raise InvalidInput.of("unknown vehicle", "vehicle_id", got, allowed, fix)
        if fitted_model is not None and car_model not in (None, fitted_model):
            raise InvalidInput.of("another car model", "car_model", f"{car_model}", fitted_model)
        name = fitted_model or car_model or ""
        mean, covariance = self.posterior.weights(name, vehicle_id, driver)
        model = ForecastModel(load_car(name), "fleet")
        model.corrector_ = FleetCorrector(mean, covariance_factor(covariance), self.trees)
        model.uncertainty_ = self.uncertainty_of(name, ambient_degc)
        model.ranges_ = self.ranges
        model.trip_ids_ = ("",) * self._counts[name, vehicle_id or ""]
        return model

    def uncertainty_of(self, car_model: str, ambient_degc: float | None = None) -> UncertaintyModel:
        """Return the fleet's uncertainty with the charge scale and the scores of a car model.

        If the car model has no scores, those of the temperature class are used, and else those of the whole fleet.
        """
        temperature = "" if ambient_degc is None else "cold" if ambient_degc < COLD_DEGC else "mild"
        of_fleet = self.scores.get(temperature, self.uncertainty.scores)
        scores = self.scores.get(car_model, of_fleet)
        return replace(self.uncertainty, scores=scores, charge=self.charges.get(car_model))

    def forecast(
        self,
        trip: Plan | Trip,
        departure: Departure | None = None,
        *,
        vehicle_id: str | None = None,
        car_model: str | None = None,
        driver: str | None = None,
    ) -> Forecast:
        """Forecast a trip of a vehicle by the model that `of_vehicle` returns.

        Parameters
        ----------
        trip, departure
            As in `ForecastModel.forecast`.
        vehicle_id, car_model, driver
            As in `of_vehicle`.
        """
        degc = trip.departure.merge(departure).ambient_temperature_degc
        model = self.of_vehicle(vehicle_id, car_model=car_model, driver=driver, ambient_degc=degc)
        return model.forecast(trip, departure)

    def with_sums(self, sums: Sums) -> FleetModel:
        """Return the model with other trips in its linear part and the same trees, scales and uncertainty."""
        return replace(self, sums=sums, posterior=group_posterior(sums, self.posterior.scales))

    def __repr__(self) -> str:
        vehicles, models = len(self.vehicles()), len({group[0] for group in self.sums.groups})
        return f"<FleetModel {self.trips} trips of {vehicles} vehicles, {models} car models>"


def predict_rows(posterior: GroupPosterior, rows: TripRows) -> tuple[FloatArray, FloatArray]:
    """Predict the energy of trips by the linear part, and its standard deviation from the uncertainty of the weights [Wh]."""
    X = rows.X
    energy = rows.numbers("simulated_wh").copy()
    sd = np.zeros(len(rows))
    groups = rows.groups
    for group, index in by_key(range(len(groups)), groups.__getitem__).items():
        mean, covariance = posterior.weights(*group)
        energy[index] += X[index] @ mean
        sd[index] = np.sqrt(np.einsum("ip,pq,iq->i", X[index], covariance, X[index]))
    return energy, sd


def fit_fleet(
    store: TripStore,
    work: Path | str,
    workers: Workers,
    *,
    which: Mapping[str, Any] | None = None,
    sampling: Sampling = Sampling(),
    progress: Callable[[int, int], None] | None = None,
) -> FleetModel:
    """Fit a model on the trips of a store.

    Parameters
    ----------
    store : TripStore
    work : path
        Folder of finished parts, which every worker can reach. An interrupted fit continues from these parts.
    workers : Workers
    which : mapping, optional
        Arguments of `TripStore.trips` that select the trips to fit on. By default, all trips.
    sampling : Sampling
    progress : callable, optional
        Called with (finished files, all files).

    Raises
    ------
    InvalidInput
        If there are fewer than `_MIN_TRIPS` sound trips with measured energy.
    """
    listed = usable_trips(store, **(which or {}))
    records: list[Any] = listed.to_dict("records")
    chosen = sample_digests(records, sampling.per_vehicle, sampling.vehicles, sampling.seed)
    rows, results = store_rows(store, listed, work, workers, sampled=chosen, progress=progress)
    if len(rows) < _MIN_TRIPS:
        allowed = f"at least {_MIN_TRIPS} with measured energy"
        raise InvalidInput.of("too few trips", "fleet", f"{len(rows)}", allowed)
    return _fit_rows(rows, SampledTrips.read(results), sampling.seed)


def _fit_rows(rows: TripRows, sample: SampledTrips, seed: int = 0) -> FleetModel:
    """Fit a model on rows of trips and the segments of a sample of them.

    For trees and uncertainty, the folds of the sampled trips are held out in turn: the sums of a fold are subtracted, and the
    posterior is computed anew. The scales of the deviations are estimated once, from all trips.
    """
    sums = rows.sums
    scales = fit_scales(sums, START)
    folds = np.array([int(hashlib.sha256(d.encode()).hexdigest()[:8], 16) % _FOLDS for d in sample.digests])
    correctors = held_out_correctors(sums, scales, sample, folds)
    linear = np.concatenate([c.predict(sample.table.take([i])) for i, c in enumerate(correctors)])
    rounds, trees_w = choose_rounds(sample.table, sample.table.residual_w - linear, folds, seed)
    trees = FleetTrees.fit(sample.table, sample.table.residual_w - linear, rounds, seed)
    left = [held_out_residual(corrector, sample.table.take([i])) for i, corrector in enumerate(correctors)]
    by_trees_w = np.split(trees_w, sample.table.offsets[1:-1])
    residuals = [replace(r, residual_w=r.residual_w - w) for r, w in zip(left, by_trees_w, strict=True)]
    # the residual process costs far more per trip than scale and scores
    process_trips = np.sort(np.random.default_rng(seed).permutation(len(sample))[:_PROCESS_TRIPS])
    uncertainty = UncertaintyModel.from_held_out([residuals[i] for i in process_trips])
    standardised = np.array([r.error_wh for r in residuals]) / scale_wh(uncertainty.scale, residuals)
    uncertainty = replace(uncertainty, scores=ConformalScores.from_errors(standardised.tolist()))
    return FleetModel(
        sums,
        group_posterior(sums, scales),
        trees,
        uncertainty,
        *_by_class(sample, standardised),
        training_ranges(sample.table),
        frozenset(rows.texts("digest").tolist()),
        len(sample),
        {"rounds": rounds, "seed": seed, "features": list(FEATURES)},
    )


def held_out_correctors(
    sums: Sums, scales: Scales, sample: SampledTrips, folds: IntArray
) -> list[FleetCorrector]:
    """Return the linear part for each sampled trip, fitted without the fold of this trip."""
    correctors: dict[int, FleetCorrector] = {}
    for fold in np.unique(folds):
        held_out = np.flatnonzero(folds == fold)
        posterior = group_posterior(sums - sample.sums(held_out), scales)
        for i in held_out.tolist():
            mean, covariance = posterior.weights(*sample.groups[i])
            correctors[i] = FleetCorrector(mean, covariance_factor(covariance))
    return [correctors[i] for i in range(len(sample))]


def _by_class(
    sample: SampledTrips, standardised: FloatArray
) -> tuple[dict[str, ConformalScores], dict[str, ChargeScale]]:
    """Return the scores of each car model and temperature class with at least `_MIN_SCORES` sampled trips, and charge scales.

    A car model has a charge scale if its sampled trips have readings enough for one.
    """
    table = sample.table
    assert table.charge is not None
    observed = table.totals_wh(table.observed_power_w)
    ambient = table.features["ambient_temperature_degc"].to_numpy()[table.offsets[:-1]]
    models = np.array([group[0] for group in sample.groups])
    of_model = {name: models == name for name in sorted(set(models.tolist()))}
    masks = of_model | {"cold": ambient < COLD_DEGC, "mild": ambient >= COLD_DEGC}
    scores = {
        name: ConformalScores.from_errors(standardised[mask].tolist())
        for name, mask in masks.items()
        if mask.sum() >= _MIN_SCORES
    }
    scales = {n: ChargeScale.from_readings(table.charge[m], observed[m]) for n, m in of_model.items()}
    return scores, {name: scale for name, scale in scales.items() if scale is not None}


def update_fleet(
    model: FleetModel, store: TripStore, work: Path | str, workers: Workers
) -> tuple[FleetModel, TripRows]:
    """Update a model with the trips of the store that are new. O(new trips).

    The linear part becomes that of a fit on all trips with the scales of the last fit. Trees, residual process and scores stay as
    they are.

    Returns
    -------
    model : FleetModel
    rows : TripRows
        Rows of the new trips.
    """
    listed = usable_trips(store)
    rows, _ = store_rows(store, listed[~listed["digest"].isin(model.digests)], work, workers)
    if not len(rows):
        return model, rows
    digests = model.digests | frozenset(rows.texts("digest").tolist())
    return replace(model.with_sums(model.sums + rows.sums), digests=digests), rows
