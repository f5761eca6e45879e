"""The protocol `cars`: forecast each car as if it were unknown, with none and with a few trips of its own.

The scored car, its model and its data set are excluded: the population is built from the trips of the other cars, and
library values that came from the logs of the scored car's data set are replaced. Own trips are drawn at random from
the first half of the car's trips, and its second half is scored; for a car with few trips, all trips that were not
drawn are scored. In a second evaluation trips are forecast in order of time, each with what was fitted to the trips
before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit
from tripwatt.errors import Check, Fault, InvalidInput, raise_faults
from tripwatt.files import MAX_TEXT_BYTES, parse_toml, read_text_file
from tripwatt.forecasting import ForecastModel, load_model
from tripwatt.forecasting.fitting import versions
from tripwatt.hybrid import SegmentTable, segment_trips
from tripwatt.hybrid.factors import TripEvidence
from tripwatt.hybrid.learning import KINDS
from tripwatt.hybrid.parameters import on_road
from tripwatt.learners.folds import Split
from tripwatt.population import Adaptation
from tripwatt.population.adapting import in_order
from tripwatt.population.prior import Population, Source, population
from tripwatt.sources import read_logs
from tripwatt.trips import Trip
from tripwatt.uncertainty import Coverage
from tripwatt.uncertainty.coverage import power
from tripwatt.vehicles import Vehicle, load_vehicle, without_data

TRIPS: Final = (0, 1, 2, 5, 10, 20)
"""Numbers of own trips with which a car is scored: a choice, about even steps of the logarithm."""
DRAWS: Final = 100
"""Random draws of own trips: a choice, because the mean error then has a tenth of the spread of single draws."""
FEW: Final = 40
"""Number of trips below which all trips that were not drawn are scored, instead of the second half: a choice, half of them are
too few to score."""
MIN_SCORED: Final = 5
"""Smallest number of trips that are scored: a choice, because the mean of fewer says nothing."""
LEVEL: Final = 0.9
"""Level of the scored intervals: that of the forecast."""
TOO_LOW: Final = 0.75
"""True coverage for which the power of the coverage check is reported: a choice, an error that a driver would notice."""
FROM: Final = (0, 5, 20)
"""Numbers of earlier trips after which the scores in order of time begin: a choice, new, soon and settled."""

Learner = Callable[[TripEvidence, TripEvidence], FloatArray]
"""Function (known trips, other trips) -> residual energy of the other trips [Wh]."""


@dataclass(frozen=True, eq=False)
class CarTrips:
    """A vehicle with its trips.

    Attributes
    ----------
    name : str
    dataset : str
        Data set that is excluded when the vehicle is scored.
    vehicle : Vehicle
        Car model with published values.
    trips : tuple of Trip
        Sound trips with measured energy.
    lab : Callable or None
        Function from the car to the evidence of its dynamometer runs.
    """

    name: str
    dataset: str
    vehicle: Vehicle
    trips: tuple[Trip, ...]
    lab: Callable[[Vehicle], TripEvidence] | None = None

    def source(self) -> Source:
        """Describe the vehicle as a source of a population."""
        return Source(self.vehicle.name, self.name, self.dataset, len(self.trips), "", "")


@dataclass(frozen=True, eq=False)
class CarsRun:
    """The result of `evaluate_cars`.

    Attributes
    ----------
    results : dict
        Content of `results.json`.
    trips : DataFrame
        One row for each trip: `car, trip, observed_energy_wh`, the forecasts without own trips and in order of
        time, and the ends of the 90 % interval of both.
    """

    results: dict[str, Any]
    trips: pd.DataFrame

    def __repr__(self) -> str:
        return f"<CarsRun of {len(self.results['cars'])} cars, {len(self.trips)} trips>"


def evaluate_cars(
    cars: Sequence[CarTrips],
    *,
    trips: Sequence[int] = TRIPS,
    draws: int = DRAWS,
    seed: int = 0,
    own_model: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> CarsRun:
    """Score every car as if it were unknown, with a model built from all other cars.

    Parameters
    ----------
    cars : sequence of CarTrips
        At least one car. Cars of the package's population take part too, unless one of these cars has their data set.
    trips : sequence of int
        Numbers k of own trips to score with.
    draws : int
        Number of random draws of k trips.
    seed : int
    own_model : bool
        Whether to fit another model to the first half of each car's own trips alone.
    progress : callable, optional
        Called with (finished cars, all cars).

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    """
    are_counts = bool(trips) and all(isinstance(k, int) and k >= 0 for k in trips)
    checks = (
        ("trips", list(trips), "whole numbers of 0 or more", are_counts),
        ("draws", draws, "a whole number of 1 or more", isinstance(draws, int) and draws >= 1),
        ("cars", len(cars), "at least 1", len(cars) >= 1),
    )
    raise_faults(
        Fault("value out of range", name, f"{got}", allowed)
        for name, got, allowed, valid in checks
        if not valid
    )
    given = {car.dataset for car in cars}
    described, rows = [], []
    for number, car in enumerate(cars):
        population_rest = population_without(cars, car, population().without(given))
        about, table = _score(car, population_rest, sorted({*trips}), draws, seed, own_model)
        described.append(about)
        rows.append(table)
        if progress is not None:
            progress(number + 1, len(cars))
    results = {
        "kind": "cars",
        "given": "given the driven speed trace",
        "draws": draws,
        "seed": seed,
        "cars": described,
        "factors": population().to_frame().reset_index().to_dict("records"),
        "versions": versions()["packages"],
    }
    return CarsRun(results, pd.concat(rows, ignore_index=True))


def read_cars(path: Path) -> list[CarTrips]:
    """Read cars with their trips from a TOML file: a table for each data set, with `logs`, `vehicle` and optional `dataset` and `mapping`.

    Paths are relative to the file. Each vehicle named in the logs becomes a car of its own; its trips are audited. A
    data set of kind "table" is named after its TOML table; this name decides what is excluded when a car is scored.

    Raises
    ------
    InvalidInput
        With all faults of the file, or of the logs.
    """
    document = parse_toml(read_text_file(path, MAX_TEXT_BYTES), f"{path}")
    raise_faults(_file_faults(document, f"{path}"))
    with Check() as check:
        cars = [check(list, _cars_of(name, about, path.parent)) for name, about in document.items()]
    return [car for some in cars for car in some]


def _cars_of(name: str, about: Mapping[str, str], folder: Path) -> Iterator[CarTrips]:
    """Yield a car for each vehicle in the logs of one table of the file, with its sound trips that have measured energy."""
    mapping: Path | str | None = about.get("mapping")
    if mapping is not None and (folder / mapping).is_file():
        mapping = folder / mapping
    car = about["vehicle"]
    vehicle = load_vehicle(folder / car if car.endswith(".toml") else car)
    dataset = about.get("dataset", "table" if mapping is not None else "tum")
    fleet = read_logs(folder / about["logs"], dataset, mapping)
    audited, audit_name = audit(fleet), name if dataset == "table" else fleet.name
    sound = [trip for trip in audited.trips if trip.observed_energy_wh is not None]
    if not sound:
        raise InvalidInput.of("no sound trips", f"[{name}]", f"{audited}", "at least 1 with measured energy")
    ids = sorted({trip.context.car or "" for trip in sound})
    for vehicle_id in ids:
        trips = tuple(trip for trip in sound if (trip.context.car or "") == vehicle_id)
        yield CarTrips(f"{name}-{vehicle_id}" if len(ids) > 1 else name, audit_name, vehicle, trips)


def _file_faults(document: Mapping[str, Any], where: str) -> Iterator[Fault]:
    """Yield the faults of a file of cars: no table, or entries that are missing, unknown or no text."""
    if not document:
        yield Fault("no cars", where, "an empty file", "a table [NAME] for each data set")
    for name, about in document.items():
        place = f"{where}, [{name}]"
        if not isinstance(about, Mapping):
            yield Fault("not a table", place, f"{about!r}"[:40], "a table with logs and vehicle")
            continue
        for key in ("logs", "vehicle"):
            if key not in about:
                yield Fault("missing entry", place, "nothing", f"{key} = a text")
        for key, value in about.items():
            if key not in ("logs", "vehicle", "dataset", "mapping"):
                yield Fault.unknown("unknown key", place, key, ("logs", "vehicle", "dataset", "mapping"))
            elif not isinstance(value, str):
                yield Fault("not a text", f"{place}, {key}", f"{value!r}"[:40], f"{key} = a text")


def evidence_of(car: CarTrips, dataset: str) -> tuple[Vehicle, TripEvidence, SegmentTable]:
    """Return a car on the road without values from a data set, the evidence of its trips, and the table of their segments."""
    vehicle = on_road(without_data(car.vehicle, dataset))
    table = segment_trips(in_order(car.trips), vehicle)
    return vehicle, TripEvidence.from_table(table, vehicle), table


def population_without(cars: Sequence[CarTrips], scored: CarTrips, rest: Population) -> Population:
    """Build the population of all cars whose model and data set differ from the scored one's.

    These cars are simulated without values from the scored car's data set; `rest` is the population to add.
    """
    evidence = [
        (car.source(), evidence_of(car, scored.dataset)[1])
        for car in cars
        if car.dataset != scored.dataset and car.vehicle.name != scored.vehicle.name
    ]
    measured = Population.from_evidence(evidence)
    kept = [i for i, (model, _) in enumerate(rest.sums.groups) if model != scored.vehicle.name]
    sources = tuple(source for source in rest.sources if source.car_model != scored.vehicle.name)
    return Population(measured.sums + rest.sums.take(kept), (*measured.sources, *sources))


def _score(
    car: CarTrips, others: Population, trips: Sequence[int], draws: int, seed: int, own_model: bool
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Score one car by the population of the others; return its entry in the results and the table of its trips."""
    vehicle, evidence, table = evidence_of(car, car.dataset)
    observed = evidence.observed_wh
    published = without_data(car.vehicle, car.dataset)
    experts = others.experts(published)
    learners: dict[str, Learner] = {
        "population": lambda train, test: experts.learn(train)[0].predict(test)[0],
        "constant": partial(
            _constant_residuals, lengths={trip.trip_id: trip.distance_m for trip in car.trips}
        ),
        "one factor": _one_factor_residuals,
        "by cause": _by_cause_residuals,
    }
    curves = {
        name: _curve(learner, evidence, [k for k in trips if k or name == "population"], draws, seed)
        for name, learner in learners.items()
    }
    without_trips, in_time = _in_time(car, published, others)
    mean, _ = experts.predict(evidence)
    error = evidence.residual_wh - mean
    # score everything on the second half, also what is not fitted to the first half
    second = np.arange(len(evidence) // 2 if len(evidence) >= FEW else 0, len(evidence))
    total = np.append(evidence.factors_wh.sum(axis=0), 0.0)
    common = total @ experts.collapsed()[1] @ total
    spread = np.sqrt(common + float((experts.noise_scale * evidence.usual_wh2 + evidence.measured_wh2).sum()))
    about: dict[str, Any] = {
        "car": car.name,
        "dataset": car.dataset,
        "vehicle": car.vehicle.name,
        "vehicle_title": car.vehicle.title,
        "anchor": car.vehicle.anchor,
        "trips": len(evidence),
        "others": [source.vehicle for source in others.sources],
        "scored": "second half" if len(evidence) >= FEW else "trips that were not drawn",
        "physics": _error(evidence.residual_wh[second], observed[second]),
        "mean_error_over_sd": float(error.sum() / spread),
        "curves": curves,
        "in_time": [
            {"from": start, **_scores(in_time.iloc[start:])}
            for start in FROM
            if start + MIN_SCORED <= len(in_time)
        ],
        "without_trips": _scores(without_trips),
    }
    if own_model and len(evidence) >= FEW:
        about["own_model"] = _own_model(vehicle, table)
    if car.lab is not None:
        learned, _ = experts.learn(car.lab(vehicle))
        residual = evidence.residual_wh - learned.on_the_road().predict(evidence)[0]
        about["lab_to_road"] = _error(residual[second], observed[second])
    frame = in_time.assign(car=car.name).join(
        without_trips[["forecast_wh", "low_wh", "high_wh"]].add_prefix("zero_")
    )
    return about, frame


def _error(residual_wh: FloatArray, observed_wh: FloatArray) -> dict[str, float]:
    """Return `error` and `bias`: sums of absolute and of signed errors (forecast minus observed) over the observed energy."""
    total = float(observed_wh.sum())
    return {"error": float(np.abs(residual_wh).sum()) / total, "bias": -float(residual_wh.sum()) / total}


def _curve(
    learner: Learner, evidence: TripEvidence, trips: Sequence[int], draws: int, seed: int
) -> list[dict[str, Any]]:
    """Return the mean error over random draws for each number k of trips and, for a car with enough trips, with the whole first half."""
    n = len(evidence)
    half = n // 2 if n >= FEW else n
    counts = [k for k in trips if k < half and (n >= FEW or n - k >= MIN_SCORED or not k)]
    rows = []
    for k in [*counts, half] if n >= FEW else counts:
        splits = _draws(n, half, k, draws if 0 < k < half else 1, seed)
        sets = ((evidence.take(split.train), evidence.take(split.test)) for split in splits)
        errors = [_error(test.residual_wh - learner(train, test), test.observed_wh) for train, test in sets]
        rows.append({"k": k, "draws": len(errors), **(_mean_over_draws(errors) if k < half else errors[0])})
    return rows


def _draws(n: int, half: int, k: int, draws: int, seed: int) -> Iterator[Split]:
    """Draw k of the first `half` trips `draws` times; the later trips are scored or, if there are none, all that were not drawn."""
    rng = np.random.default_rng((seed, k))
    for draw in range(draws):
        train = np.sort(rng.permutation(half)[:k])
        yield Split(draw, train, np.arange(half, n) if half < n else np.delete(np.arange(n), train), draw)


def _mean_over_draws(scores: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    errors = [score["error"] for score in scores]
    return {
        "error": float(np.mean(errors)),
        "error_of_draws": np.quantile(errors, (0.05, 0.5, 0.95)).tolist(),
        "bias": float(np.mean([score["bias"] for score in scores])),
    }


def _constant_residuals(train: TripEvidence, test: TripEvidence, lengths: Mapping[str, float]) -> FloatArray:
    """Residuals of a forecast with one energy per metre, fitted to the known trips."""
    rate = train.observed_wh.sum() / sum(lengths[name] for name in train.trip_ids)
    return np.array([rate * lengths[name] for name in test.trip_ids]) - test.simulated_wh


def _one_factor_residuals(train: TripEvidence, test: TripEvidence) -> FloatArray:
    """Residuals of a forecast with one factor on the simulated energy, fitted to the known trips."""
    factor = train.observed_wh.sum() / train.simulated_wh.sum()
    return np.asarray((factor - 1.0) * test.simulated_wh)


def _by_cause_residuals(train: TripEvidence, test: TripEvidence) -> FloatArray:
    """Residuals by a linear model in the factors, shrunk to the published values by the factors' usual standard deviations."""
    X, variance = train.factors_wh, train.usual_wh2 + train.measured_wh2
    gram = (X.T / variance) @ X + np.eye(X.shape[1])
    return np.asarray(test.factors_wh @ np.linalg.solve(gram, (X.T / variance) @ train.residual_wh))


def _own_model(vehicle: Vehicle, table: SegmentTable) -> dict[str, float]:
    """Score the default model, fitted to the first half of the car's trips alone, on the second."""
    half = len(table) // 2
    model = ForecastModel(vehicle).fit_segments(table.take(np.arange(half)))
    second = table.take(np.arange(half, len(table)))
    assert model.corrector_ is not None
    residual = second.totals_wh(second.residual_w - model.corrector_.predict(second))
    return _error(residual, second.totals_wh(second.observed_power_w))


def _in_time(car: CarTrips, vehicle: Vehicle, others: Population) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return tables of forecasts in order of time: without own trips, and fitted to all earlier ones, with the weights of each kind."""
    adaptation = Adaptation.before_trips(load_model(), vehicle, others)
    without_trips = adaptation.model
    tables: tuple[list[object], list[object]] = [], []
    for trip in in_order(car.trips):
        for rows, model in zip(tables, (without_trips, adaptation.model), strict=True):
            forecast = model.forecast(trip)
            energies_wh = trip.observed_energy_wh, forecast.energy_wh, *forecast.interval(LEVEL)
            rows.append((trip.trip_id, *energies_wh))
        adaptation = adaptation.with_trips([trip])
    columns = ["trip", "observed_energy_wh", "forecast_wh", "low_wh", "high_wh"]
    kinds = [f"weight_{kind.replace(' ', '_')}" for kind in KINDS]
    weights = pd.DataFrame(adaptation.innovations.weights, columns=kinds)
    without, in_time = (pd.DataFrame(rows, columns=columns) for rows in tables)
    return without, in_time.join(weights)


def _scores(table: pd.DataFrame) -> dict[str, Any]:
    """Return the error, the coverage of the 90 % interval, and its width over the energy beside the width that was needed."""
    names = ["observed_energy_wh", "forecast_wh", "low_wh", "high_wh"]
    observed, forecast, low, high = table[names].to_numpy(dtype=np.float64).T
    covered = Coverage.from_bounds(observed, low, high, LEVEL)
    relative = np.abs(forecast - observed) / observed
    needed = 2.0 * float(np.quantile(relative, LEVEL))
    width = float(np.mean((high - low) / observed))
    return {
        **_error(observed - forecast, observed),
        "trips": len(table),
        "coverage": covered.share,
        "coverage_ci95": list(covered.ci95),
        "power": power(len(table), LEVEL, TOO_LOW),
        "width": width,
        "needed": needed,
        "width_over_needed": width / needed,
    }
