"""The forecast before departure, scored: python -m benchmarks.before [--write].

The Renault Twizy's logs carry the speed limit of the road. Each of its trips is forecast as before departure, from the limits and heights of its road
alone: of the scored drive the forecast has the length of the road, where its limit changes, and what the first sample shows. Stops, speeds and
times come from the car's other trips, and beside that from the model that the car starts from, which has no trip of the car. The driven trace of the same
trips, with the same car, is the best case. The difference is split by replacing one thing after the other, so that the parts add up.

Beside that the travel times are tested where they were not learned: those of each data set on the trips of every other. `--write` renews
docs/results/before.json and the part `before` of docs/explanation/results.md.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from tools import DATA, DOCS, ROOT
from tools.command import run
from tools.docs import pages
from tools.docs.before_page import DRIVEN, ELSEWHERE, PLANNED, text_of

from benchmarks.cars import cars as every_car
from benchmarks.measure import Row, report
from tripwatt.arrays import FloatArray, distance_driven
from tripwatt.auditing import audit
from tripwatt.certification import describe_car
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel, load_model
from tripwatt.forecasting.fitting import versions
from tripwatt.population import Adaptation
from tripwatt.population.adapting import in_order, with_travel_times
from tripwatt.population.prior import Population, population
from tripwatt.routes.free_flow import TravelTimeFactors, free_flow_links
from tripwatt.routes.links import LinkRoute
from tripwatt.sources import read_logs
from tripwatt.study.evaluation.cars import CarTrips, population_without
from tripwatt.study.evaluation.forecast_scores import LEVELS, coverage_by_level
from tripwatt.study.evaluation.metrics import absolute_percentage_error, bootstrap_interval, summarise_errors
from tripwatt.trips import Plan, Trip
from tripwatt.uncertainty.coverage import clopper_pearson
from tripwatt.uncertainty.free_flow import MIN_TRIPS
from tripwatt.vehicles import Vehicle, without_data

MAX_OVER_DRIVEN = 1.3
MAX_DURATION = 0.12
RESULT = DOCS / "results" / "before.json"
BY_DAY = "twizy, whole days left out"
CITATION = "Y. NaitMalek et al., RSK Twizy EV dataset, CC BY 4.0, doi:10.1109/ACCESS.2022.3225643 and doi:10.3390/su14169993"
HEIGHTS: Final = "driven speeds, heights of the road"
TIMES: Final = "driven times of the links"
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

    Returns
    -------
    BeforeRun
        Scores, and a row for each trip.

    Raises
    ------
    InvalidInput
        When no car has enough trips with speed limits.
    """
    least = MIN_TRIPS + 1
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
    rest = population().without({car.dataset for car in cars})
    described: list[dict[str, Any]] = []
    tables: list[pd.DataFrame] = []
    for car in scored:
        known, made = _Car.of(car, population_without(cars, car, rest)), list[dict[str, Forecast]]()
        for k in range(len(car.trips)):
            apart = [i for i, trip in enumerate(car.trips) if fold(trip) != fold(car.trips[k])]
            made.append(known.forecasts(k, apart))
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
        driven = Plan.from_trip(trip)
        made = {DRIVEN: own.forecast(driven)}
        way_m = distance_driven(driven.array("time_s"), driven.array("speed_m_s"))
        height = links.elevation_at(way_m)
        samples = driven.samples if height is None else driven.samples.assign(elevation_m=height)
        made[HEIGHTS] = own.forecast(replace(driven, samples=samples))
        for name, model in ((ELSEWHERE, elsewhere), (PLANNED, own)):
            _, uncertainty = model.fitted_parts("model")
            assert uncertainty.free_flow is not None
            expected = uncertainty.free_flow.factors.with_expected_times(links)
            made[name] = model.forecast(_plan(trip, expected))
        made[TIMES] = own.forecast(_plan(trip, replace(expected, travel_time_s=driven_s)))
        return made


def _plan(trip: Trip, links: LinkRoute) -> Plan:
    """A trip on its road, with what was known at its departure."""
    return links.plan(trip_id=trip.trip_id).with_departure(trip.departure)


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
        energy = table[name].to_numpy(np.float64)
        known[name] = {
            "error": float(np.abs(energy - observed).sum() / observed.sum()),
            **summarise_errors(observed, energy, seed),
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


def twizy(data: Path = DATA) -> CarTrips:
    """The Twizy as its kind of body alone describes it, with its sound trips."""
    fleet = read_logs(data / "twizy", "table", ROOT / "tools" / "data" / "twizy.toml")
    trips = tuple(trip for trip in audit(fleet).trips if trip.observed_energy_wh is not None)
    return CarTrips("twizy", "twizy", describe_car(body="quadricycle"), trips)


def day_of(trip: Trip) -> object:
    """Day of a trip of the Twizy: its logs are named T1_03_29_2021 and the like."""
    return trip.trip_id.split("_")[1:4]


def transfer(sets: Mapping[str, Sequence[Trip]]) -> list[dict[str, Any]]:
    """Error of the durations of each set with the travel times of every other; of a set by itself each trip from the others."""
    cut = {name: [free_flow_links(trip) for trip in trips] for name, trips in sets.items()}
    rows = []
    for learned, known in cut.items():
        factors = TravelTimeFactors.from_links(*zip(*known, strict=True))
        for scored, asked in cut.items():
            errors = []
            for k, (links, driven_s) in enumerate(asked):
                rest = [other for i, other in enumerate(known) if i != k]
                used = (
                    factors if learned != scored else TravelTimeFactors.from_links(*zip(*rest, strict=True))
                )
                errors.append(used.with_expected_times(links).duration_s / driven_s.sum() - 1.0)
            rows.append(
                {
                    "learned": learned,
                    "scored": scored,
                    "trips": len(errors),
                    "mape": float(np.mean(np.abs(errors))),
                    "bias": float(np.mean(errors)),
                }
            )
    return rows


def measure(data: Path = DATA) -> dict[str, Any]:
    """The results file."""
    own = twizy(data)
    results = evaluate_before([own]).results
    by_day = evaluate_before([replace(own, name=BY_DAY)], fold=day_of).results
    sets: dict[str, list[Trip]] = {}
    for car in every_car(data):
        if car.dataset != own.dataset:
            sets.setdefault(car.dataset, []).extend(car.trips)
    scored = [*results["cars"], *by_day["cars"]]
    return {
        **results,
        "cars": scored,
        "citation": CITATION,
        "travel_times": transfer({**sets, own.dataset: own.trips}),
    }


def rows_of(results: Mapping[str, Any]) -> Iterator[Row]:
    """The bars."""
    for car in results["cars"]:
        known = car["known"]
        yield Row(
            f"{car['car']}, {PLANNED}: error over that of the driven trace",
            car["over_driven"],
            most=MAX_OVER_DRIVEN,
            note=f"{known[PLANNED]['mape']:.4f} over {known[DRIVEN]['mape']:.4f}",
        )
        for name in (PLANNED, ELSEWHERE):
            yield from rows_of_known(f"{car['car']}, {name}", known[name], car["trips"])


def rows_of_known(text: str, row: Mapping[str, Any], n: int) -> Iterator[Row]:
    """Duration, intervals and chances to arrive of one row of a car."""
    yield Row(f"{text}: error of the duration", row["duration"]["mape"], most=MAX_DURATION)
    held = [
        (
            f"{float(level):.0%} interval holds {row['inside'][level]} of {n}",
            level,
            row["coverage_ci95"][level],
        )
        for level in ("0.5", "0.9")
    ]
    held += [
        (f"{c['arrived']} of {n} arrive with a chance of {c['chance']:.0%}", c["chance"], c["ci95"])
        for c in row["arrival"]
    ]
    for what, level, (low, high) in held:
        yield Row(f"{text}: {what}; lower end of Clopper-Pearson's interval", low, most=float(level))
        yield Row(f"{text}: {what}; upper end", high, least=float(level))


def publish(results: Mapping[str, Any]) -> None:
    """The results file, and the parts of pages."""
    RESULT.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    pages.renew("explanation/results.md", "before", text_of(results))


def bounds() -> Iterator[Row]:
    """The bars, measured."""
    yield from rows_of(measure())


def main(write: bool = False) -> int:
    """Print the rows; 1 when a bound is missed."""
    results = measure()
    if write:
        publish(results)
    for row in results["travel_times"]:
        print(f"times of {row['learned']} on {row['scored']}: {row['mape']:.3f}, bias {row['bias']:+.3f}")
    return int(report(rows_of(results)) and not write)


if __name__ == "__main__":
    run(main)
