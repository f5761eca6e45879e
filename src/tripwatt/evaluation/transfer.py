"""Transfer, measured: a corrector of one car on another, with none and with a few of that car's trips.

Everything about the second car is estimated from the first half of its trips in time and scored on the second half. The
k trips are drawn at random from the first half, many times. The first car's trips are seen as the second car's log
would show them: inputs that it lacks are masked before the first car is simulated and fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.auditing import audit
from tripwatt.errors import Fault, raise_faults
from tripwatt.evaluation.forecast_data import ForecastData
from tripwatt.evaluation.forecast_models import DataMethod, PowerMethod, held_out_learner
from tripwatt.evaluation.transfer_scores import curve_row, paired_energy_error, resamples, scored
from tripwatt.forecasting.donor import DonorModel, unknown_inputs, without_inputs
from tripwatt.forecasting.fitting import donor_model, versions
from tripwatt.forecasting.model import MIN_TRIPS
from tripwatt.hybrid import identify_trips, power_corrector
from tripwatt.hybrid.hierarchy import MODES, CarTransfer, DrawsForecast, Evidence, term_scales
from tripwatt.hybrid.parameters import PARAMETERS, sensitivities
from tripwatt.trips import Fleet, Trip
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle, load_vehicle, names_data, without_data

TRIPS: Final = (0, 1, 2, 5, 10, 20, 50)
DRAWS: Final = 200
MIN_DISTANCE_M: Final = 2000.0
MAIN_MODE: Final = "both"
OWN: Final = MappingProxyType({"own-kriging": "gp", "own-ensemble": "ensemble", "own-channels": "split"})
"""Name in the files -> corrector of a model trained on the scored car's own trips alone; the last is the default."""
MIN_CAR_TRIPS: Final = 4
"""Fewest trips of a car that are cut into halves; a car with fewer has no model of its own."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class TransferRun:
    """The result of `evaluate_transfer`.

    Attributes
    ----------
    results : dict
        As written to `results.json`.
    trips : DataFrame
        One row for each scored trip and model without a random draw: `car, trip, model,
        observed_energy_wh, predicted_energy_wh`.
    """

    results: dict[str, Any]
    trips: pd.DataFrame


@dataclass(frozen=True, eq=False)
class _Source:
    """The first car with the inputs that the second car's log has."""

    prepared: ForecastData
    donor: DonorModel
    vehicle: Vehicle


@dataclass(frozen=True, eq=False)
class _Car:
    """Trips of one car of the target, in the order of time, and which of them are the first half."""

    name: str
    trips: tuple[Trip, ...]
    prepared: ForecastData
    physical_w: FloatArray
    first: IntArray
    second: IntArray

    @property
    def observed_wh(self) -> FloatArray:
        """Of the scored trips."""
        segments = self.prepared.segments
        return segments.totals_wh(segments.observed_power_w)[self.second]

    def energies(self, correction_w: FloatArray) -> FloatArray:
        """Energy of the scored trips with a correction of each segment's power."""
        segments = self.prepared.segments
        return segments.totals_wh(segments.simulated_w + correction_w)[self.second]


def evaluate_transfer(
    source: Fleet,
    target: Fleet,
    *,
    vehicles: tuple[str | Vehicle, str | Vehicle] = ("bmw_i3_60ah", "nissan_leaf_24"),
    trips: Sequence[int] = TRIPS,
    draws: int = DRAWS,
    min_distance_m: float = MIN_DISTANCE_M,
    seed: int = 0,
    progress: Progress | None = None,
) -> TransferRun:
    """Train on one car, forecast another with none and with k of its own trips, and score it beside other models.

    Values of both cars that come from the target's logs are replaced by those that the library has without them.

    Parameters
    ----------
    source, target : Fleet
        Raw trips. Of the source the reference trips, else those that the audit keeps; of the target those that the
        audit keeps, each of its cars by itself.
    vehicles : (str or Vehicle, str or Vehicle)
        The cars of source and target, as for `load_vehicle`.
    trips : sequence of int
        Numbers k of own trips.
    draws : int
        Random draws of k trips.
    min_distance_m : float
        Shorter trips of the target are left out.
    seed : int
    progress : callable, optional
        Called with (finished steps, all steps).

    Raises
    ------
    InvalidInput
        When an argument cannot be used or too few trips are left.
    """
    _check(trips, draws, min_distance_m)
    given = [v if isinstance(v, Vehicle) else load_vehicle(v) for v in vehicles]
    cars = [without_data(car, target.name) for car in given]
    learned = list(source.reference_trips() or audit(source).trips)
    audited = audit(target)
    by_car, notes = _by_car(audited.trips, min_distance_m)
    _require(len(learned), source, by_car, target, min_distance_m)
    masked = unknown_inputs([trip for trips_of in by_car.values() for trip in trips_of])
    steps = 1 + len(by_car)
    origin = _source(learned, masked, cars[0], seed)
    report = progress or (lambda done, steps: None)
    report(1, steps)
    described, rows = [], []
    for number, (name, own) in enumerate(by_car.items()):
        car = _car(name, own, cars[1])
        about, predicted = _evaluate_car(car, origin, cars[1], sorted({*trips}), draws, seed)
        described.append(about)
        rows += predicted
        report(2 + number, steps)
    results = {
        "kind": "transfer",
        "from": _about(source, cars[0], len(learned)),
        "to": _about(target, cars[1], sum(len(t) for t in by_car.values())),
        "without_target": sorted(
            {k for car in given for k, e in car.entries.items() if names_data(e, target.name)}
        ),
        "hidden": [name for name in masked if name not in unknown_inputs(learned)],
        "given": "given the driven speed trace",
        "min_distance_m": min_distance_m,
        "draws": draws,
        "seed": seed,
        "main_mode": MAIN_MODE,
        "parameters": [{"name": p.name, "width": p.width, "source": p.source} for p in PARAMETERS],
        "cars": described,
        "notes": [*map(message, (*source.notes, *target.notes)), *notes],
        "audit": [str(finding) for finding in audited.findings],
        "citations": [c for c in (source.citation, target.citation) if c],
        "versions": versions()["packages"],
    }
    return TransferRun(results, pd.DataFrame(rows))


def _check(trips: Sequence[int], draws: int, min_distance_m: float) -> None:
    faults = []
    if not trips or min(trips) < 0:
        faults.append(Fault("value out of range", "trips", str(list(trips)), "whole numbers of 0 or more"))
    if draws < 1:
        faults.append(Fault("value out of range", "draws", str(draws), "1 or more"))
    if not min_distance_m >= 0.0:
        faults.append(Fault("value out of range", "min_distance_m", str(min_distance_m), "0 or more"))
    raise_faults(faults)


def _by_car(trips: Sequence[Trip], min_distance_m: float) -> tuple[dict[str, list[Trip]], list[str]]:
    """Trips of each car in the order of time; the car with most of them first."""
    long = [t for t in trips if t.distance_m >= min_distance_m and t.observed_energy_wh is not None]
    notes = [f"{len(trips) - len(long)} trips of less than {min_distance_m / 1000.0:g} km were left out"]
    cars: dict[str, list[Trip]] = {}
    for trip in long:
        cars.setdefault(trip.context.car or "", []).append(trip)
    for name, own in cars.items():
        if all(trip.context.started_at is not None for trip in own):
            own.sort(key=lambda trip: str(trip.context.started_at))
        else:
            which = f" of car {name}" if name else ""
            notes.append(f"no dates{which}: the order of the log counts as that of time")
    ordered = dict(sorted(cars.items(), key=lambda item: (-len(item[1]), item[0])))
    return ordered, notes if len(long) < len(trips) else notes[1:]


def _require(
    learned: int, source: Fleet, by_car: Mapping[str, Sequence[Trip]], target: Fleet, min_distance_m: float
) -> None:
    faults = []
    if learned < MIN_TRIPS:
        got, allowed = f"{learned} of {len(source.trips)} after the audit", f"at least {MIN_TRIPS}"
        faults.append(Fault("too few trips to train on", f"--from {source.name}", got, allowed))
    most = max((len(trips) for trips in by_car.values()), default=0)
    if most < MIN_CAR_TRIPS:
        got = f"{most} of {len(target.trips)} after the audit, of at least {min_distance_m / 1000.0:g} km"
        allowed = f"at least {MIN_CAR_TRIPS} of one car"
        faults.append(Fault("too few trips to score", f"--to {target.name}", got, allowed))
    raise_faults(faults)


def _source(trips: Sequence[Trip], masked: Sequence[str], vehicle: Vehicle, seed: int) -> _Source:
    vehicle = identify_trips(trips, vehicle).applied(vehicle)
    trips = [without_inputs(trip, masked) for trip in trips]
    return _Source(
        ForecastData.from_trips(trips, vehicle), donor_model(trips, vehicle, (), seed=seed), vehicle
    )


def _car(name: str, trips: Sequence[Trip], vehicle: Vehicle) -> _Car:
    prepared = ForecastData.from_trips(trips, vehicle)
    order = np.arange(len(trips), dtype=np.int64)
    half = len(trips) // 2 if len(trips) >= MIN_CAR_TRIPS else 0
    return _Car(
        name,
        tuple(trips),
        prepared,
        sensitivities(prepared.plans, vehicle, prepared.segments),
        order[:half],
        order[half:],
    )


def _about(fleet: Fleet, vehicle: Vehicle, used: int) -> dict[str, Any]:
    return {
        "dataset": fleet.name,
        "vehicle": vehicle.name,
        "vehicle_title": vehicle.title,
        "trips_read": len(fleet.trips),
        "trips_used": used,
    }


def _evaluate_car(
    car: _Car, source: _Source, vehicle: Vehicle, trips: Sequence[int], draws: int, seed: int
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The results of one car, and its trips' predictions."""
    observed = car.observed_wh
    segments, members = car.prepared.segments, source.donor.members
    scales, variances = term_scales(members, source.vehicle, vehicle), source.donor.variances_wh2(segments)
    transfers = {mode: CarTransfer(members, scales, PARAMETERS, mode) for mode in MODES}
    evidence = {mode: t.evidence(segments, car.physical_w, variances) for mode, t in transfers.items()}
    models = {
        "physics": car.energies(np.zeros(len(segments.hours))),
        **_transferred_as_is(car, source, seed),
        **_own_models(car, seed),
    }
    none = np.empty((1, 0), dtype=np.int64)
    models["zero-shot"] = (
        models["physics"]
        + transfers[MAIN_MODE].predict_draws(evidence[MAIN_MODE], none, car.second).mean_wh[0]
    )
    index = resamples(len(observed), seed)
    curves, everything = {}, None
    for mode in MODES:
        forecasts = _forecasts(transfers[mode], evidence[mode], car, trips, draws, seed)
        curves[mode] = [
            curve_row(k, forecast, models["physics"], observed, index, seed) for k, forecast in forecasts
        ]
        if mode == MAIN_MODE and len(car.first):
            everything = transfers[mode].posterior(evidence[mode].take(car.first))
            models[f"adapted-{len(car.first)}"] = models["physics"] + forecasts[-1][1].mean_wh[0]
    scores = {name: scored(observed, predicted, index) for name, predicted in models.items()}
    about = {
        "car": car.name,
        "trips_first": len(car.first),
        "trips_second": len(car.second),
        "first_from_to": _period(car, car.first),
        "second_from_to": _period(car, car.second),
        "models": scores,
        "curves": curves,
        "paired": _paired(models, observed, index),
        "bars": _bars(scores, curves[MAIN_MODE], models, observed, index),
        "calibrated": None
        if everything is None
        else {
            name: {"change": m, "sd": s}
            for name, (m, s) in everything.parameters([p.name for p in PARAMETERS]).items()
        },
    }
    rows = [
        {
            "car": car.name,
            "trip": segments.trip_ids[i],
            "model": name,
            "observed_energy_wh": float(o),
            "predicted_energy_wh": float(p),
        }
        for name, predicted in models.items()
        for i, o, p in zip(car.second, observed, predicted, strict=True)
    ]
    return about, rows


def _forecasts(
    transfer: CarTransfer, evidence: Evidence, car: _Car, trips: Sequence[int], draws: int, seed: int
) -> list[tuple[int, DrawsForecast]]:
    """For each k that the first half allows, and for the whole of it, the scored trips given each draw."""
    most = len(car.first)
    done = []
    for k in [*(k for k in trips if k < most), most] if most else [0]:
        rng = np.random.default_rng((seed, k))
        n = draws if 0 < k < most else 1
        chosen = np.array([rng.permutation(car.first)[:k] for _ in range(n)], dtype=np.int64).reshape(n, k)
        done.append((k, transfer.predict_draws(evidence, chosen, car.second)))
    return done


def _transferred_as_is(car: _Car, source: _Source, seed: int) -> dict[str, FloatArray]:
    """Models of the first car used on the second unchanged."""
    training, segments = source.prepared.segments, car.prepared.segments
    learner, trees = held_out_learner("boosting", seed).model, power_corrector("boosting", seed)
    learner.fit(source.prepared.data_features, training.observed_power_w, groups=training.groups)
    power_w = np.asarray(learner.predict(car.prepared.data_features))
    return {
        "data-only": car.energies(power_w - segments.simulated_w),
        "kriging-as-is": car.energies(source.donor.members.predict(segments)),
        "boosting-as-is": car.energies(trees.fit(training).predict(segments)),
    }


def _own_models(car: _Car, seed: int) -> dict[str, FloatArray]:
    """Models of the car's own, fitted to its whole first half."""
    if len(car.first) < MIN_TRIPS:
        return {}
    methods: dict[str, PowerMethod | DataMethod] = {
        name: PowerMethod(learner) for name, learner in OWN.items()
    }
    methods["own-data-only"] = DataMethod("boosting")
    return {
        name: method.fit(car.prepared, car.first, seed).predict(car.second)
        for name, method in methods.items()
    }


def _period(car: _Car, members: IntArray) -> list[str] | None:
    days = [car.trips[i].context.day for i in members]
    known = [str(day) for day in days if day is not None]
    return [min(known), max(known)] if known else None


def _paired(models: Mapping[str, FloatArray], observed: FloatArray, index: IntArray) -> list[dict[str, Any]]:
    """Differences of the error that matter, over the same trips."""
    wanted = [("zero-shot", other) for other in ("physics", "data-only", "kriging-as-is", "boosting-as-is")]
    wanted += [("zero-shot", name) for name in OWN]
    return [
        {"a": a, "b": b, **paired_energy_error(observed, models[a], models[b], index)}
        for a, b in wanted
        if a in models and b in models
    ]


def _bars(
    scores: Mapping[str, Mapping[str, Any]],
    curve: Sequence[Mapping[str, Any]],
    models: Mapping[str, FloatArray],
    observed: FloatArray,
    index: IntArray,
) -> dict[str, Any]:
    """The questions of the transfer and their results."""
    pair = paired_energy_error(observed, models["zero-shot"], models["physics"], index)
    bars: dict[str, Any] = {
        "zero_shot_better_than_physics": {
            "met": bool(pair["significant"] and pair["diff"] < 0.0),
            "diff": pair["diff"],
            "diff_ci95": pair["diff_ci95"],
        }
    }
    ten = next((row for row in curve if row["k"] == 10), None)
    own = min((scores[m]["error"] for m in OWN if m in scores), default=None)
    if ten is not None and own:
        bars["ten_trips_within_15_percent_of_own"] = {
            "met": bool(ten["error"] <= 1.15 * own),
            "error": ten["error"],
            "own_error": own,
            "ratio": ten["error"] / own,
        }
    return bars
