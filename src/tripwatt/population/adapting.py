"""A fitted model on another car: that car's own physics, what cars have in common, and the trips that it has.

The base gives what is not of one car: how errors run along a trip, on planned routes and in travel times.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.forecasting.fitting import held_out_figures, provenance_of
from tripwatt.forecasting.model import ForecastModel, HeldOut
from tripwatt.forecasting.ranges import NEVER_KNOWN, training_ranges
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.factors import UNITS, USUAL_SHARE, USUAL_SHARE_KM, USUAL_WH, TripEvidence
from tripwatt.hybrid.familiarity import Range
from tripwatt.hybrid.learning import KINDS, MEMORY, Experts, Innovations
from tripwatt.hybrid.parameters import on_road
from tripwatt.hybrid.segments import driven_roads, driving_w, require_measured
from tripwatt.parallel import one_blas_thread
from tripwatt.population.prior import Population, Source, population
from tripwatt.trips import Trip, TripSet
from tripwatt.uncertainty import ChargeScale
from tripwatt.uncertainty.conformal import ConformalScores, t4_half_width
from tripwatt.uncertainty.free_flow import LEAST_TRIPS, FreeFlowTrips
from tripwatt.uncertainty.scale import T_VARIANCE, TotalScale
from tripwatt.vehicles import Vehicle

ADAPTED: Final = "population"
"""Name of the corrector of a model on another car."""

PRIOR_TRIPS: Final = 20.0
"""Weight of the usual scores beside the own trips', in trips: twice the fewest that show a 90 % interval at all."""


_LEVELS: Final = 40
"""Scores that a model on another car keeps."""

PROTOCOL: Final = "own trips, each forecast before it was learned"


@dataclass(frozen=True, eq=False)
class Adaptation:
    """A model on its car, and what was learned of the car.

    Attributes
    ----------
    base : ForecastModel
        What is not of one car comes from it.
    vehicle : Vehicle
        The car as it is expected on the road.
    experts : Experts
        What is known of its factors.
    evidence : TripEvidence
        Its trips.
    innovations : Innovations
        Forecasts of these, each before it was learned.
    ranges : mapping of str to Range
        Of the quantities that forecasts compare with own trips; empty before the first.
    roads : ndarray, shape (trips, 9), or None
        Of the trips, as of `tripwatt.hybrid.segments.driven_roads`, with the simulated energy of driving.

    Examples
    --------
    >>> import tripwatt as tw
    >>> car = tw.load_vehicle("vw_id3")
    >>> new = Adaptation.before_trips(tw.load_model(), car, population())
    >>> known = new.with_trips(tw.synthetic_fleet(3, vehicle=car).trips)
    >>> known.model
    <ForecastModel Volkswagen ID.3 58 kWh, population corrector, 3 trips>
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
        """Take a car with its published values and without a trip as one of a population.

        Parameters
        ----------
        base : ForecastModel
            Fitted.
        vehicle : Vehicle
            The car with its published values.
        cars : Population
            What is known of other cars.

        Returns
        -------
        Adaptation
            Without trips.
        """
        experts = cars.experts(vehicle)
        evidence = TripEvidence.empty()
        return cls(base, on_road(vehicle), experts, evidence, experts.learn(evidence)[1])

    def with_trips(self, trips: Sequence[Trip]) -> Adaptation:
        """Learn trips after those that were learned, each forecast by what was known before it. O(samples).

        Parameters
        ----------
        trips : sequence of Trip
            Of the car, at least one, with measured energy, in the order in which they are learned.

        Returns
        -------
        Adaptation
            With these trips as well.

        Raises
        ------
        InvalidInput
            When there is no trip, or one has no measured energy.
        """
        table = segment_trips(trips, self.vehicle)
        evidence, ranges = TripEvidence.from_table(table, self.vehicle), training_ranges(table)
        roads = driven_roads(trips, table, driving_w(table))
        roads = roads if self.roads is None else np.concatenate([self.roads, roads])
        return self.with_evidence(evidence, _widened(self.ranges, ranges), roads)

    def with_evidence(
        self, evidence: TripEvidence, ranges: Mapping[str, Range], roads: FloatArray | None = None
    ) -> Adaptation:
        """Learn trips of which the energies by factor are known already. O(trips x experts x factors^2).

        Parameters
        ----------
        evidence : TripEvidence
            Of trips with measured energy, in the order in which they are learned.
        ranges : mapping of str to Range
            Of the quantities that forecasts compare with own trips, over all trips of the result.
        roads : ndarray, shape (trips, 9), optional
            As `Adaptation.roads`, of all trips of the result.

        Returns
        -------
        Adaptation
            With these trips as well.
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
        """Mean change of each factor and its standard deviation, relative or in kW as its unit is."""
        return self.experts.corrector(self.vehicle).changes

    @property
    def model(self) -> ForecastModel:
        """The model of the car: it forecasts and is stored like any other. Without a base that is fitted it raises `InvalidInput`."""
        _, usual = self.base.fitted_parts("base")
        own = (self.evidence.residual_wh - self.innovations.mean_wh) / self.innovations.sd_wh
        noise = self.experts.noise_scale**0.5
        observed = self.evidence.observed_wh
        predicted = observed - self.evidence.residual_wh + self.innovations.mean_wh
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
                HeldOut(name, float(o), float(p), float(s))
                for name, o, p, s in zip(self.evidence.trip_ids, observed, predicted, own, strict=True)
            ),
            evidence_=self.evidence if len(self.evidence) else None,
            roads_=self.roads,
        )


@one_blas_thread
def adaptation(
    base: ForecastModel, trips: Sequence[Trip], vehicle: Vehicle, cars: Population | None = None
) -> Adaptation:
    """Put a fitted model on another car, with that car's trips. O(samples).

    Parameters
    ----------
    base : ForecastModel
        Fitted.
    trips : sequence of Trip
        Of the new car, at least one, with measured energy. They are learned in the order of their dates where all have one.
    vehicle : Vehicle
        The new car with its published values.
    cars : Population, optional
        What is known of other cars; those of the package and the base's by default.

    Returns
    -------
    Adaptation
        Its model forecasts like any other.

    Raises
    ------
    InvalidInput
        When the base is not fitted, there is no trip, or one has no measured energy.

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
    base.fitted_parts("base")
    require_measured(trips)
    cars = cars or population_of(base)
    base = with_travel_times(base, trips, vehicle, cars)
    return Adaptation.before_trips(base, vehicle, cars).with_trips(in_order(trips))


def with_travel_times(
    base: ForecastModel, trips: Sequence[Trip], vehicle: Vehicle, cars: Population
) -> ForecastModel:
    """Replace a base's travel times of an empty road by those of trips whose logs carry the speed limit. O(trips x samples).

    What the times add to the uncertainty is measured on each trip with the times of the others, by the car without trips.

    Parameters
    ----------
    base : ForecastModel
        Fitted.
    trips : sequence of Trip
        Of the car, with measured energy.
    vehicle : Vehicle
        The car with its published values.
    cars : Population
        What is known of other cars.

    Returns
    -------
    ForecastModel
        The base itself with fewer than `tripwatt.uncertainty.free_flow.LEAST_TRIPS` such trips.
    """
    known = [trip for trip in trips if trip.has("speed_limit_m_s")]
    if len(known) < LEAST_TRIPS:
        return base
    _, usual = base.fitted_parts("base")
    new = without_trips(base, vehicle, cars)
    corrector, _ = new.fitted_parts("base")
    free, table = FreeFlowTrips.from_trips(known, new.vehicle), segment_trips(known, new.vehicle)
    each = [free.differences(corrector, table, np.array([k])) for k in range(len(known))]
    measured = free.uncertainty(np.concatenate(each))
    return base if measured is None else replace(base, uncertainty_=replace(usual, free_flow=measured))


@one_blas_thread
def without_trips(base: ForecastModel, vehicle: Vehicle, cars: Population | None = None) -> ForecastModel:
    """Put a fitted model on a car without a measured trip.

    How far a car is from its published values is as uncertain as between the cars with trips, and all of that is in the interval.

    Parameters
    ----------
    base : ForecastModel
        Fitted.
    vehicle : Vehicle
        The car without trips.
    cars : Population, optional
        As for `adaptation`.

    Returns
    -------
    ForecastModel
        Of the car.

    Raises
    ------
    InvalidInput
        When the base is not fitted.

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
    """Join the cars of the package and that of a base which they do not have.

    Parameters
    ----------
    base : ForecastModel
        Its trips count where it has their evidence.
    of_car : bool
        Whether the base's trips take the place of those that the package has of its car model: for that car, changed.

    Returns
    -------
    Population
        That of the package, with or without the car of the base.

    Examples
    --------
    >>> from tripwatt.forecasting import load_model
    >>> population_of(load_model()) is population()
    True
    >>> [source.vehicle for source in population_of(load_model(), of_car=True).sources]
    ['ved-10', 'ved-541', 'twizy', 'base']
    """
    cars, name = population(), base.vehicle.name
    if (
        base.evidence_ is None
        or not base.evidence_.is_current
        or (not of_car and any(source.car_model == name for source in cars.sources))
    ):
        return cars
    own = Source(name, "base", "", len(base.evidence_), "", "")
    return cars.with_car(own, base.evidence_)


def in_order(trips: Iterable[Trip]) -> list[Trip]:
    """Sort trips with measured energy by their departure; without a date of each they stay as they are.

    Parameters
    ----------
    trips : iterable of Trip
        In any order; those without measured energy are left out.

    Returns
    -------
    list of Trip
        In the order in which they are learned.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> [f"{trip.context.started_at:%m}" for trip in in_order(synthetic_fleet(3).trips)]
    ['06', '07', '12']
    """
    measured = [trip for trip in trips if trip.observed_energy_wh is not None]
    if any(trip.context.started_at is None for trip in measured):
        return measured
    return sorted(measured, key=lambda trip: (f"{trip.context.started_at}", trip.trip_id))


def adapt_model(
    fleet: TripSet, vehicle: Vehicle, base: ForecastModel, about_base: Mapping[str, Any]
) -> tuple[ForecastModel, dict[str, Any], dict[str, Any]]:
    """Audit a car's logs, adapt a stored model to the sound trips, and keep where both come from.

    Parameters
    ----------
    fleet : TripSet
        Logs of the new car, as a reader gave them.
    vehicle : Vehicle
        The new car.
    base : ForecastModel
        The stored model, of another car.
    about_base : mapping
        The base's metadata, as `load_metadata` gives them.

    Returns
    -------
    model, provenance, evaluation
        As of `fit_with_provenance`; the provenance nests the base's with its digest.

    Raises
    ------
    InvalidInput
        When the base is not fitted, or no sound trip has measured energy.

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
    """Give what was learned of a car, and the base, as plain values.

    Parameters
    ----------
    done : Adaptation
        The car.
    about_base : mapping
        The base's metadata, as `load_metadata` gives them.

    Returns
    -------
    dict
        `adapted`: trips, probability of each kind of expert, variance of the errors over the usual one, and each factor with its
        unit; `base`: digest, version of tripwatt, model and provenance.

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
    """Join the standardised errors of a t distribution and those of own trips, of which the latest count most.

    The usual ones count as `PRIOR_TRIPS` trips, so that one trip alone neither narrows nor blows up an interval, and have the
    scale of all. Own ones fade as the experts' evidence does, so that the coverage follows a car whose errors change.

    Parameters
    ----------
    own : ndarray, shape (trips,)
        Errors of own trips over their standard deviations [1], the latest last; may be empty.

    Returns
    -------
    ConformalScores
        As many as a model on another car keeps.

    Examples
    --------
    >>> usual, calm = scores_of(np.empty(0)), scores_of(np.full(30, 0.5))
    >>> calm.factor(0.9) < usual.factor(0.9)
    True
    """
    levels = (np.arange(_LEVELS) + 0.5) / _LEVELS
    usual = np.array([t4_half_width(level) for level in levels.tolist()]) / np.sqrt(T_VARIANCE)
    fading = MEMORY ** np.arange(len(own))[::-1]
    share = PRIOR_TRIPS / (PRIOR_TRIPS + fading.sum())
    # beyond three standard deviations an error counts no more for the scale; a choice
    usual *= np.sqrt(share + (1.0 - share) * (fading @ np.minimum(own**2, 9.0)) / max(fading.sum(), 1.0))
    weight = np.append(np.full(_LEVELS, share / _LEVELS), fading * (1.0 - share) / max(fading.sum(), 1.0))
    values = np.append(usual, np.abs(own))
    order = np.argsort(values)
    level = np.cumsum(weight[order]) - 0.5 * weight[order]
    spread = (np.arange(_LEVELS) + 1.0) / (_LEVELS + 1.0)
    return ConformalScores.from_errors(np.interp(spread, level, values[order]).tolist())


def _joined(base: Mapping[str, Range], own: Mapping[str, Range]) -> dict[str, Range]:
    """Ranges over the trips of both cars; an input that the car's log lacks has none."""
    return {
        name: _both(old, own[name]) if name in own and np.isfinite(own[name].low) else NEVER_KNOWN
        for name, old in base.items()
    }


def _widened(before: Mapping[str, Range], now: Mapping[str, Range]) -> dict[str, Range]:
    """Ranges of own trips with further ones."""
    return {name: _both(before.get(name, new), new) for name, new in now.items()}


def _both(one: Range, other: Range) -> Range:
    """A range over two; where one is not known, the other."""
    if not np.isfinite(one.low):
        return other
    if not np.isfinite(other.low):
        return one
    return Range(min(one.low, other.low), max(one.high, other.high), one.sd)
