"""Adapting a fitted model to another car: that car's own physics, the population of cars, and the trips of the car.

The base model contributes the parts that do not depend on the car: errors along a trip, of planned routes and of travel times.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.errors import require_type
from tripwatt.forecasting.fitting import held_out_figures, provenance_of
from tripwatt.forecasting.model import ForecastModel, HeldOut
from tripwatt.forecasting.ranges import NEVER_KNOWN, training_ranges
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.factors import UNITS, USUAL_SHARE, USUAL_SHARE_KM, USUAL_WH, TripEvidence
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.learning import KINDS, MEMORY, Experts, Innovations
from tripwatt.hybrid.parameters import on_road
from tripwatt.hybrid.segments import day_of, driven_roads, driving_w, require_measured
from tripwatt.parallel import one_blas_thread
from tripwatt.population.prior import Population, Source, population
from tripwatt.trips import Trip, TripSet
from tripwatt.uncertainty import ChargeScale
from tripwatt.uncertainty.conformal import ConformalScores, t4_half_width
from tripwatt.uncertainty.free_flow import MIN_TRIPS, FreeFlowTrips
from tripwatt.uncertainty.scale import T_VARIANCE, TotalScale
from tripwatt.vehicles import Vehicle

ADAPTED: Final = "population"
"""Name of the corrector of a model on another car."""

PRIOR_TRIPS: Final = 20.0
"""Weight of the usual scores against those of own trips, in trips: twice the fewest trips that show a 90 % interval at all."""


_LEVELS: Final = 40
"""Number of scores that a model on another car keeps."""

PROTOCOL: Final = "own trips, each forecast before it was learned"


@dataclass(frozen=True, eq=False)
class Adaptation:
    """A base model adapted to a car, with the factors estimated from the car's trips.

    Attributes
    ----------
    base : ForecastModel
        Model that contributes the parts that do not depend on the car.
    vehicle : Vehicle
        The car as it is expected on the road.
    experts : Experts
        Estimates of the car's factors.
    evidence : TripEvidence
        Evidence of the car's trips.
    innovations : Innovations
        Forecasts of these trips, each made before the trip was used.
    ranges : mapping of str to Range
        Ranges of the quantities that forecasts compare with own trips; empty before the first trip.
    roads : ndarray, shape (trips, 9), or None
        Roads of the trips from `tripwatt.hybrid.segments.driven_roads`, with the simulated energy of driving.

    Examples
    --------
    >>> import tripwatt as tw
    >>> car = tw.load_vehicle("nissan_leaf_24")
    >>> new = Adaptation.before_trips(tw.load_model(), car, population())
    >>> known = new.with_trips(tw.sample_trips("ved").trips[:3])
    >>> known.model
    <ForecastModel Nissan Leaf 24 kWh, population corrector, 3 trips>
    >>> again = new.with_evidence(known.evidence, known.ranges, known.roads)
    >>> again.changes == known.changes, len(again.innovations.sd_wh)
    (True, 3)
    """

    base: ForecastModel
    vehicle: Vehicle
    experts: Experts
    evidence: TripEvidence
    innovations: Innovations
    ranges: Mapping[str, Range] = field(default_factory=dict)
    roads: FloatArray | None = None

    @classmethod
    def before_trips(cls, base: ForecastModel, vehicle: Vehicle, cars: Population) -> Adaptation:
        """Start from a car with its published values and without trips, as one car of a population.

        Parameters
        ----------
        base : ForecastModel
            A fitted model.
        vehicle : Vehicle
            The car with its published values.
        cars : Population
            Population of other cars.

        Returns
        -------
        Adaptation
            Adaptation without trips.
        """
        experts = cars.experts(vehicle)
        evidence = TripEvidence.empty()
        return cls(base, on_road(vehicle), experts, evidence, experts.learn(evidence)[1])

    def with_trips(self, trips: Sequence[Trip]) -> Adaptation:
        """Add trips after the earlier ones; each trip is forecast before it is used. O(samples).

        Parameters
        ----------
        trips : sequence of Trip
            At least one trip of the car with measured energy, in the order in which they are added.

        Returns
        -------
        Adaptation
            Adaptation with these trips as well.

        Raises
        ------
        InvalidInput
            If there is no trip, or a trip has no measured energy.
        """
        table = segment_trips(trips, self.vehicle)
        evidence, ranges = TripEvidence.from_table(table, self.vehicle), training_ranges(table)
        roads = driven_roads(trips, table, driving_w(table))
        roads = roads if self.roads is None else np.concatenate([self.roads, roads])
        widened = {name: _both(self.ranges.get(name, new), new) for name, new in ranges.items()}
        return self.with_evidence(evidence, widened, roads)

    def with_evidence(
        self, evidence: TripEvidence, ranges: Mapping[str, Range], roads: FloatArray | None = None
    ) -> Adaptation:
        """Add trips whose energies by factor were computed before. O(trips x experts x factors^2).

        Parameters
        ----------
        evidence : TripEvidence
            Evidence of trips with measured energy, in the order in which they are added.
        ranges : mapping of str to Range
            Ranges of the quantities that forecasts compare with own trips, over all trips of the result.
        roads : ndarray, shape (trips, 9), optional
            Roads of all trips of the result, see `Adaptation.roads`.

        Returns
        -------
        Adaptation
            Adaptation with these trips as well.
        """
        experts, seen = self.experts.learn(evidence)
        return replace(
            self,
            experts=experts,
            evidence=self.evidence + evidence,
            innovations=self.innovations + seen,
            ranges=ranges,
            roads=roads,
        )

    @property
    def changes(self) -> Mapping[str, tuple[float, float]]:
        """Mean change of each factor and the standard deviation of the mean, in the unit of the factor (relative or kW)."""
        return self.experts.corrector(self.vehicle).changes

    @property
    def model(self) -> ForecastModel:
        """The model of the car, which forecasts and is stored like any other; raises `InvalidInput` if the base is not fitted."""
        _, usual = self.base.fitted_parts("base")
        own = (self.evidence.residual_wh - self.innovations.mean_wh) / self.innovations.sd_wh
        noise = self.experts.noise_scale**0.5
        observed = self.evidence.observed_wh
        predicted = self.evidence.simulated_wh + self.innovations.mean_wh
        return ForecastModel(
            vehicle=self.vehicle,
            corrector=ADAPTED,
            seed=self.base.seed,
            corrector_=self.experts.corrector(self.vehicle),
            uncertainty_=replace(
                usual,
                process=replace(usual.process, split=False),
                charge=ChargeScale.from_readings(self.evidence.charge, observed) if len(observed) else None,
                scale=TotalScale(
                    np.array([USUAL_WH * noise, 0.0, 0.0, 1.0]),
                    net_shares=(USUAL_SHARE * noise, USUAL_SHARE_KM * noise),
                ),
                scores=scores_of(own),
            ),
            ranges_=_joined(self.base.ranges_, self.ranges) if self.ranges else self.base.ranges_,
            trip_ids_=self.evidence.trip_ids,
            held_out_=tuple(
                map(HeldOut, self.evidence.trip_ids, *np.stack((observed, predicted, own)).tolist())
            ),
            evidence_=self.evidence if len(self.evidence) else None,
            roads_=self.roads,
        )


@one_blas_thread
def adaptation(
    base: ForecastModel, trips: Sequence[Trip], vehicle: Vehicle, cars: Population | None = None
) -> Adaptation:
    """Adapt a fitted model to another car, with that car's trips. O(samples).

    Parameters
    ----------
    base : ForecastModel
        A fitted model.
    trips : sequence of Trip
        At least one trip of the new car with measured energy. If all trips have a date, they are used in the order of their dates.
    vehicle : Vehicle
        The new car with its published values.
    cars : Population, optional
        Population of other cars; by default the cars of the package and that of the base.

    Returns
    -------
    Adaptation
        The adaptation; its `model` forecasts like any other.

    Raises
    ------
    InvalidInput
        If the base is not fitted, there is no trip, or a trip has no measured energy.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips = synthetic_fleet(n_trips=12).trips
    >>> base = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips[:10])
    >>> adapted = adaptation(base, trips[10:11], load_vehicle("nissan_leaf_24"))
    >>> adapted.model.vehicle.title, len(adapted.model.trip_ids_)
    ('Nissan Leaf 24 kWh', 1)
    """
    require_type("base", base, ForecastModel, "a ForecastModel").fitted_parts("base")
    require_measured(trips)
    cars = cars or population_of(base)
    base = with_travel_times(base, trips, vehicle, cars)
    return Adaptation.before_trips(base, vehicle, cars).with_trips(in_order(trips))


def with_travel_times(
    base: ForecastModel, trips: Sequence[Trip], vehicle: Vehicle, cars: Population
) -> ForecastModel:
    """Replace the base's travel times of an empty road by those of trips whose logs have the speed limit. O(trips x samples).

    The uncertainty that the travel times add is measured on each trip with the times of the other trips, by the model of the car
    without trips.

    Parameters
    ----------
    base : ForecastModel
        A fitted model.
    trips : sequence of Trip
        Trips of the car with measured energy.
    vehicle : Vehicle
        The car with its published values.
    cars : Population
        Population of other cars.

    Returns
    -------
    ForecastModel
        The base with the new travel times and their uncertainty. The base itself if fewer than
        `tripwatt.uncertainty.free_flow.MIN_TRIPS` trips have a speed limit, or if they do not show the uncertainty.
    """
    known = [trip for trip in trips if trip.has("speed_limit_m_s")]
    if len(known) < MIN_TRIPS:
        return base
    _, uncertainty = base.fitted_parts("base")
    tripless = without_trips(base, vehicle, cars)
    corrector, _ = tripless.fitted_parts("base")
    free, table = FreeFlowTrips.from_trips(known, tripless.vehicle), segment_trips(known, tripless.vehicle)
    each = [free.differences(corrector, table, np.array([k])) for k in range(len(known))]
    measured = free.uncertainty(np.concatenate(each))
    return base if measured is None else replace(base, uncertainty_=replace(uncertainty, free_flow=measured))


@one_blas_thread
def without_trips(base: ForecastModel, vehicle: Vehicle, cars: Population | None = None) -> ForecastModel:
    """Adapt a fitted model to a car without measured trips.

    The difference of a car from its published values is as uncertain as the spread between the cars with trips; the intervals include
    all of this uncertainty.

    Parameters
    ----------
    base : ForecastModel
        A fitted model.
    vehicle : Vehicle
        The car without trips.
    cars : Population, optional
        Population of other cars, as for `adaptation`.

    Returns
    -------
    ForecastModel
        Model for the car.

    Raises
    ------
    InvalidInput
        If the base is not fitted.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> trips = synthetic_fleet(n_trips=12).trips
    >>> base = ForecastModel(load_vehicle("bmw_i3_60ah"), corrector="linear").fit(trips[:11])
    >>> own, other = base.forecast(trips[11]), without_trips(base, load_vehicle("nissan_leaf_24")).forecast(trips[11])
    >>> bool(other.sd_wh > own.sd_wh)
    True
    """
    return Adaptation.before_trips(base, vehicle, cars or population_of(base)).model


def population_of(base: ForecastModel, *, of_car: bool = False) -> Population:
    """Join the cars of the package and the car of a base model, if the package does not have its car model.

    Parameters
    ----------
    base : ForecastModel
        Base model; its trips count if the model has their evidence.
    of_car : bool
        Whether the base's trips replace those of the package for its car model; for a changed version of the base's car.

    Returns
    -------
    Population
        Population of the package, with or without the car of the base.

    Examples
    --------
    >>> from tripwatt.forecasting import load_model
    >>> population_of(load_model()) is population()
    True
    >>> [source.vehicle for source in population_of(load_model(), of_car=True).sources]
    ['ved-10', 'ved-541', 'twizy', 'base']
    """
    cars, name = population(), base.vehicle.name
    if base.evidence_ is None or (not of_car and any(source.car_model == name for source in cars.sources)):
        return cars
    return cars.with_car(Source(name, "base", "", len(base.evidence_), "", ""), base.evidence_)


def in_order(trips: Iterable[Trip]) -> list[Trip]:
    """Sort trips with measured energy by departure; the order is kept if a trip has no date.

    Parameters
    ----------
    trips : iterable of Trip
        Trips in any order; those without measured energy are left out.

    Returns
    -------
    list of Trip
        Trips in the order in which a model uses them.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> [f"{trip.context.started_at:%m}" for trip in in_order(synthetic_fleet(3).trips)]
    ['06', '07', '12']
    """
    measured = [trip for trip in trips if trip.observed_energy_wh is not None]
    if any(trip.context.started_at is None for trip in measured):
        return measured
    return sorted(measured, key=lambda trip: (day_of(trip.context.started_at), trip.trip_id))


def adapt_model(
    fleet: TripSet, vehicle: Vehicle, base: ForecastModel, about_base: Mapping[str, Any]
) -> tuple[ForecastModel, dict[str, Any], dict[str, Any]]:
    """Audit a car's logs, adapt a stored model to the sound trips, and collect the provenance of both.

    Parameters
    ----------
    fleet : TripSet
        Logs of the new car, as a reader gave them.
    vehicle : Vehicle
        The new car.
    base : ForecastModel
        The stored model, of another car.
    about_base : mapping
        The base's metadata, from `load_metadata`.

    Returns
    -------
    model, provenance, evaluation
        See `fit_with_provenance`; the provenance contains that of the base with its digest.

    Raises
    ------
    InvalidInput
        If the base is not fitted, or no sound trip has measured energy.

    Examples
    --------
    >>> from tripwatt.forecasting import load_metadata, load_model
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("vw_id3")
    >>> logs = synthetic_fleet(3, vehicle=car)
    >>> model, provenance, evaluation = adapt_model(logs, car, load_model(), load_metadata())
    >>> model.corrector, provenance["adapted"]["trips"], evaluation["protocol"]
    ('population', 3, 'own trips, each forecast before it was learned')
    """
    sound = audit(fleet)
    done = adaptation(base, sound.trips, vehicle)
    model = done.model
    cars = sorted({trip.context.car for trip in sound.trips if trip.context.car is not None})
    notes = [f"cars {', '.join(cars)} count as one car"] if len(cars) > 1 else []
    provenance = {**provenance_of(fleet, sound, model, notes), **about_adaptation(done, about_base)}
    return model, provenance, {**held_out_figures(model.held_out_), "protocol": PROTOCOL}


def about_adaptation(done: Adaptation, about_base: Mapping[str, Any]) -> dict[str, Any]:
    """Return the results of an adaptation, and its base, as plain values.

    Parameters
    ----------
    done : Adaptation
        The adaptation to a car.
    about_base : mapping
        The base's metadata, from `load_metadata`.

    Returns
    -------
    dict
        `adapted`: number of trips, probability of each kind of expert, variance of the errors relative to the usual one, and each
        factor with its unit. `base`: digest, version of tripwatt, model and provenance.

    Examples
    --------
    >>> from tripwatt.forecasting import load_metadata, load_model
    >>> from tripwatt.vehicles import load_vehicle
    >>> new = Adaptation.before_trips(load_model(), load_vehicle("vw_id3"), population())
    >>> list(about_adaptation(new, load_metadata())["adapted"])
    ['trips', 'experts', 'noise_scale', 'parameters']
    """
    adapted = {
        "trips": len(done.evidence),
        "experts": dict(zip(KINDS, done.experts.kind_weights.tolist(), strict=True)),
        "noise_scale": done.experts.noise_scale,
        "parameters": {
            name: {"change": change, "sd": sd, "unit": UNITS[name]}
            for name, (change, sd) in done.changes.items()
        },
    }
    base = {name: about_base[name] for name in ("sha256", "tripwatt", "model", "provenance")}
    return {"adapted": adapted, "base": base}


def scores_of(own: FloatArray) -> ConformalScores:
    """Combine usual standardised errors, of a t distribution, with those of own trips; the latest trips count most.

    The usual errors count as `PRIOR_TRIPS` trips, so that one trip alone changes an interval little; they are scaled to the size of
    all errors. The weight of own errors fades as that of the experts' evidence does, so that the coverage follows a car whose errors
    change.

    Parameters
    ----------
    own : ndarray, shape (trips,)
        Errors of own trips over their standard deviations [1], the latest last; may be empty.

    Returns
    -------
    ConformalScores
        `_LEVELS` scores, the quantiles of the combined distribution.

    Examples
    --------
    >>> usual, calm = scores_of(np.empty(0)), scores_of(np.full(30, 0.5))
    >>> calm.factor(0.9) < usual.factor(0.9)
    True
    """
    levels = (np.arange(_LEVELS) + 0.5) / _LEVELS
    usual = t4_half_width(levels) / np.sqrt(T_VARIANCE)
    fading = MEMORY ** np.arange(len(own))[::-1]
    share = PRIOR_TRIPS / (PRIOR_TRIPS + fading.sum())
    # for the scale, errors are limited to three standard deviations; a choice
    usual *= np.sqrt(share + (1.0 - share) * (fading @ np.minimum(own**2, 9.0)) / max(fading.sum(), 1.0))
    weight = np.append(np.full(_LEVELS, share / _LEVELS), fading * (1.0 - share) / max(fading.sum(), 1.0))
    values = np.append(usual, np.abs(own))
    order = np.argsort(values)
    level = np.cumsum(weight[order]) - 0.5 * weight[order]
    spread = (np.arange(_LEVELS) + 1.0) / (_LEVELS + 1.0)
    return ConformalScores.from_errors(np.interp(spread, level, values[order]).tolist())


def _joined(base: Mapping[str, Range], own: Mapping[str, Range]) -> dict[str, Range]:
    """Ranges over the trips of both cars; `NEVER_KNOWN` for an input that the car's log lacks."""
    return {
        name: _both(old, own[name]) if name in own and np.isfinite(own[name].low) else NEVER_KNOWN
        for name, old in base.items()
    }


def _both(one: Range, other: Range) -> Range:
    """Range that covers two ranges; if one is unknown, returns the other."""
    known = [each for each in (one, other) if np.isfinite(each.low)] or [other]
    return Range(min(each.low for each in known), max(each.high for each in known), known[0].sd)
