"""The protocol `before`: each trip is forecast as before departure, from the speed limits and heights of its road alone.

Of the scored drive the forecast has the length of the road, where its limit changes, and what the first sample shows. Stops, speeds and times
come from the travel times of the car's other trips, and beside that from those of the model that the car starts from, which has
no trip of the car. The driven trace of the same trips, with the same car, is the best case. The difference is split by replacing one thing
after the other, so that the parts add up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from operator import attrgetter
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, distance_driven
from tripwatt.errors import InvalidInput
from tripwatt.evaluation.cars import CarTrips, others_of
from tripwatt.evaluation.forecast_scores import LEVELS, coverage_by_level
from tripwatt.evaluation.metrics import absolute_percentage_error, bootstrap_interval, summarise_errors
from tripwatt.forecasting import Forecast, ForecastModel, load_model
from tripwatt.forecasting.fitting import versions
from tripwatt.population import Adaptation
from tripwatt.population.adapting import in_order, with_travel_times
from tripwatt.population.prior import Population, population
from tripwatt.routes.free_flow import free_flow_links
from tripwatt.routes.links import LinkRoute, plan_from_links
from tripwatt.trips import Plan, Trip, plan_from_trip
from tripwatt.uncertainty.coverage import clopper_pearson
from tripwatt.uncertainty.free_flow import LEAST_TRIPS
from tripwatt.vehicles import Vehicle, without_data

DRIVEN: Final = "driven trace"
HEIGHTS: Final = "driven speeds, heights of the road"
TIMES: Final = "driven times of the links"
PLANNED: Final = "before departure"
ELSEWHERE: Final = "before departure, times of another car"
SPLIT: Final = {
    "travel times": (PLANNED, TIMES),
    "stops and speeds": (TIMES, HEIGHTS),
    "climb": (HEIGHTS, DRIVEN),
    "car": (DRIVEN, "observed"),
}
"""Part of the error before departure -> the two energies whose difference it is; the parts add up to the error."""
CHANCES: Final = (0.5, 0.8, 0.9, 0.95)
"""Chances to arrive that a car leaves with."""


@dataclass(frozen=True, eq=False)
class BeforeRun:
    """The result of `evaluate_before`.

    Attributes
    ----------
    results : dict
        As written to `results.json`.
    trips : DataFrame
        One row for each trip: `car, trip, observed`, the energy of each forecast [Wh], `duration_s` and the planned durations.
    """

    results: dict[str, Any]
    trips: pd.DataFrame


def evaluate_before(
    cars: Sequence[CarTrips],
    *,
    fold: Callable[[Trip], object] = attrgetter("trip_id"),
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> BeforeRun:
    """Score the trips of every car whose logs carry the speed limit, each forecast from the others as before departure.

    Parameters
    ----------
    cars : sequence of CarTrips
        Those without limits in their logs take part as other cars only.
    fold : callable
        Trips of a car with equal folds are left out together; each trip alone by default.
    seed : int
        Of the bootstrap.
    progress : callable, optional
        Called with (finished trips, all trips).

    Returns
    -------
    BeforeRun
        Scores, and a row for each trip.

    Raises
    ------
    InvalidInput
        When no car has enough trips with speed limits.
    """
    least = LEAST_TRIPS + 1
    with_limits = [
        replace(car, trips=tuple(t for t in car.trips if t.has("speed_limit_m_s"))) for car in cars
    ]
    scored = [car for car in with_limits if len(car.trips) >= least]
    if not scored:
        got = ", ".join(f"{car.name} {len(car.trips)}" for car in with_limits) or "no car"
        fix = "map the column of the limit to speed_limit_m_s"
        raise InvalidInput.of(
            "too few trips with speed limits", "cars", got, f"at least {least} of one car", fix
        )
    rest, total = population().without({car.dataset for car in cars}), sum(len(car.trips) for car in scored)
    described: list[dict[str, Any]] = []
    tables: list[pd.DataFrame] = []
    done = 0
    for car in scored:
        known, made = _Car.of(car, others_of(cars, car, rest)), list[dict[str, Forecast]]()
        for k in range(len(car.trips)):
            apart = [i for i, trip in enumerate(car.trips) if fold(trip) != fold(car.trips[k])]
            made.append(known.forecasts(k, apart))
            done += 1
            if progress is not None:
                progress(done, total)
        table = _table(car, made)
        described.append(_scores(car, known.others, made, table, seed))
        tables.append(table)
    results = {"protocol": "before", "seed": seed, "cars": described, "versions": versions()["packages"]}
    return BeforeRun(results, pd.concat(tables, ignore_index=True))


@dataclass(frozen=True, eq=False)
class _Car:
    """A scored car: its trips, and what is known without them."""

    trips: tuple[Trip, ...]
    vehicle: Vehicle
    others: Population
    base: ForecastModel
    roads: Sequence[tuple[LinkRoute, FloatArray]]

    @classmethod
    def of(cls, car: CarTrips, others: Population) -> _Car:
        vehicle = without_data(car.vehicle, car.dataset)
        return cls(car.trips, vehicle, others, load_model(), [free_flow_links(trip) for trip in car.trips])

    def forecasts(self, k: int, train: Sequence[int]) -> dict[str, Forecast]:
        """Forecasts of a trip by what is known of it, from a model that was fitted to some of the others."""
        rest = [self.trips[i] for i in train]
        base = with_travel_times(self.base, rest, self.vehicle, self.others)
        own, elsewhere = (
            Adaptation.before_trips(start, self.vehicle, self.others).with_trips(in_order(rest)).model
            for start in (base, self.base)
        )
        trip, (links, driven_s) = self.trips[k], self.roads[k]
        driven = plan_from_trip(trip)
        made = {DRIVEN: own.forecast(driven)}
        way_m = distance_driven(driven.array("time_s"), driven.array("speed_m_s"))
        height = links.elevation_at(way_m)
        samples = driven.samples if height is None else driven.samples.assign(elevation_m=height)
        made[HEIGHTS] = own.forecast(replace(driven, samples=samples))
        for name, model in ((ELSEWHERE, elsewhere), (PLANNED, own)):
            _, uncertainty = model.fitted_parts("model")
            assert uncertainty.free_flow is not None
            expected = uncertainty.free_flow.factors.expected(links)
            made[name] = model.forecast(_plan(trip, expected))
        made[TIMES] = own.forecast(_plan(trip, replace(expected, travel_time_s=driven_s)))
        return made


def _plan(trip: Trip, links: LinkRoute) -> Plan:
    """A trip on its road, with what was known at its departure."""
    return plan_from_links(links, trip_id=trip.trip_id).with_departure(trip.departure)


def _table(car: CarTrips, made: Sequence[Mapping[str, Forecast]]) -> pd.DataFrame:
    energies = {name: [each[name].energy_wh for each in made] for name in made[0]}
    durations = {
        f"duration_s, {name}": [each[name].plan.duration_s for each in made] for name in (PLANNED, ELSEWHERE)
    }
    known = {
        "car": car.name,
        "trip": [trip.trip_id for trip in car.trips],
        "observed": [trip.observed_energy_wh for trip in car.trips],
        "duration_s": [trip.duration_s for trip in car.trips],
    }
    return pd.DataFrame(known | energies | durations)


def _scores(
    car: CarTrips, others: Population, made: Sequence[Mapping[str, Forecast]], table: pd.DataFrame, seed: int
) -> dict[str, Any]:
    observed, duration_s = (table[name].to_numpy(np.float64) for name in ("observed", "duration_s"))
    known = {}
    for name in (DRIVEN, PLANNED, ELSEWHERE):
        bounds = np.array([[each[name].interval(level) for level in LEVELS] for each in made])
        known[name] = {
            **asdict(summarise_errors(observed, table[name].to_numpy(np.float64), seed)),
            **coverage_by_level(observed, bounds[:, :, 0], bounds[:, :, 1]),
            "arrival": [_arrived(observed, [each[name].quantile(p) for each in made], p) for p in CHANCES],
        }
        if name != DRIVEN:
            planned_s = table[f"duration_s, {name}"].to_numpy(np.float64)
            error = absolute_percentage_error(duration_s, planned_s)
            known[name]["duration"] = {
                "mape": float(error.mean()),
                "mape_ci95": bootstrap_interval(error, seed),
                "bias": float(np.mean(planned_s / duration_s - 1.0)),
            }
    return {
        "car": car.name,
        "vehicle_title": car.vehicle.title,
        "others": [source.vehicle for source in others.sources],
        "trips": len(table),
        "known": known,
        "over_driven": known[PLANNED]["mape"] / known[DRIVEN]["mape"],
        "split": _split(table, observed),
    }


def _arrived(observed: FloatArray, budget: Sequence[float], chance: float) -> dict[str, Any]:
    """Trips that would have arrived, had each left with the energy for a chance to arrive."""
    hits = int(np.sum(observed <= np.array(budget)))
    return {"chance": chance, "arrived": hits, "ci95": clopper_pearson(hits, len(observed))}


def _split(table: pd.DataFrame, observed: FloatArray) -> list[dict[str, Any]]:
    """Each part's mean, mean size, and share of the mean squared error, relative to the measured energy; the last row is their sum."""
    whole = (table[PLANNED].to_numpy() - observed) / observed
    parts = {name: (table[a].to_numpy() - table[b].to_numpy()) / observed for name, (a, b) in SPLIT.items()}
    return [
        {
            "part": name,
            "mean": float(part.mean()),
            "size": float(np.abs(part).mean()),
            "share": float(part @ whole) / float(whole @ whole),
        }
        for name, part in (parts | {"all": whole}).items()
    ]
