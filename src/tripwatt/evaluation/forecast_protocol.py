"""The forecast protocol: energy before departure with its uncertainty, and updates on the way.

Every model sees of a held-out trip its speed trace and what was known at its departure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, IntArray
from tripwatt.auditing import Audit, audit
from tripwatt.errors import Fault, InvalidInput
from tripwatt.evaluation.forecast_data import ForecastData
from tripwatt.evaluation.forecast_models import ForecastSpec, IdentifiedModel, LearningCurve, PowerModel
from tripwatt.evaluation.forecast_results import (
    about_trips,
    add_crps_of_points,
    by_trip_of,
    forecast_insight,
    forecast_scores,
    learning_curve,
    measured_beside,
    strata,
)
from tripwatt.evaluation.forecast_scores import FORECAST, WITHOUT_PHYSICS
from tripwatt.evaluation.hold_outs import (
    LEAVE_ONE_DAY_OUT,
    LEAVE_ONE_TRIP_OUT,
    LEAVE_REGIME_OUT,
    OTHER_TRIPS,
    TIME_SPLIT,
    TRAINING_ONLY,
    HoldOut,
)
from tripwatt.evaluation.protocol import CarChoice, FoldResult, ModelSpec, Prepared, ReportSection
from tripwatt.evaluation.results import EvaluationRun, about_run, fold_frame, paired_summary, summary_of
from tripwatt.evaluation.table_models import CONSTANT, LINEAR4, LINEAR6, PHYSICS, PHYSICS4, TotalModel
from tripwatt.forecasting import DEFAULT_CORRECTOR, GIVEN
from tripwatt.forecasting.model import MIN_TRIPS
from tripwatt.trips import Fleet, Trip
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle, load_vehicle

MIN_DAYS: Final = 3
SPLIT: Final = 2.0 / 3.0
"""Part of the trips that a regime or a later time is forecast from."""
MIN_SCORED: Final = 3
"""Fewest trips of a regime that is scored."""
CURVE: Final = "learning-curve"
PHYSICS_IDENTIFIED: Final = "physics-identified"
PUBLISHED_ONLY: Final = "hybrid-published"

_TITLES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "linear": "default physics, each cause scaled",
        "gp": "default physics + additive Gaussian process on power",
        "boosting": "default physics + boosting on power",
        "forest": "default physics + forest on power",
        "gamm": "default physics + GAMM on power",
        "ensemble": "default physics + mean of Gaussian process and boosting on power",
        "split": "default physics + climate and driving corrected separately, by Gaussian processes and boosting",
    }
)
_NAMES: Final[Mapping[str, str]] = MappingProxyType({"gp": "power-kriging", "split": "power-channels"})
"""Corrector -> its name in the files where it is not power-CORRECTOR."""

_BASELINES: Final = tuple(TotalModel(model) for model in (CONSTANT, LINEAR4, LINEAR6, PHYSICS, PHYSICS4))
_DATA_ONLY: Final = PowerModel(
    WITHOUT_PHYSICS, "boosting on the power of segments, without physics", "boosting", None
)


class ForecastProtocol:
    """See `tripwatt.evaluation.protocol.EvaluationProtocol`.

    Parameters
    ----------
    corrector : str
        Corrector of the forecast; the others are models beside it.
    """

    name = "forecast"
    title = "the forecast before departure and on the way, beside models of power"
    sections = (
        ReportSection("result", "Result", ("table", "mean-errors", "legend", "sets", "full-tables")),
        ReportSection("sure", "Uncertainty", ("coverage", "pit", "widths", "crps", "regimes")),
        ReportSection("arrival", "State of charge at arrival", ("arrival",)),
        ReportSection("during", "During the trip", ("updates",)),
        ReportSection("learning", "Amount of training data, and kinds of trips", ("training-size", "strata")),
        ReportSection("why", "Energy by cause", ("waterfall", "example")),
        ReportSection("errors", "Errors of every model", ("error-distribution", "error-boxes")),
        ReportSection("trips", "Trip by trip", ("trip-energy", "trip-errors", "all-trips")),
        ReportSection("comparison", "Differences between the models", ("paired-differences",)),
        ReportSection(
            "audit", "Trips that were used, and reasons why others were not", ("audit-findings", "trips-used")
        ),
    )
    focus: str | None = FORECAST
    published: Mapping[str, float] = MappingProxyType({})
    given = GIVEN

    def __init__(self, corrector: str = DEFAULT_CORRECTOR) -> None:
        self.centre = PowerModel(FORECAST, _TITLES[corrector], corrector)
        self.models: tuple[ModelSpec, ...] = (
            *_BASELINES,
            _DATA_ONLY,
            *(
                PowerModel(_NAMES.get(name, f"power-{name}"), title, name)
                for name, title in _TITLES.items()
                if name != corrector
            ),
            IdentifiedModel(
                PHYSICS_IDENTIFIED, "physics, stages identified from their signals in each fold", None
            ),
            PowerModel(PUBLISHED_ONLY, f"{_TITLES[corrector]}, with published values only", corrector),
            ForecastSpec(
                FORECAST,
                f"the forecast: {_TITLES[corrector]}, on physics identified in each fold, with intervals and updates",
                corrector,
            ),
        )

    def extra(self, specs: Sequence[ModelSpec]) -> tuple[ModelSpec, ...]:
        """The learning curve, where both of its models were chosen."""
        curves = {model.name: model for model in (self.centre, _DATA_ONLY)}
        return (LearningCurve(CURVE, CURVE, curves),) if curves.keys() <= {s.name for s in specs} else ()

    def prepare(self, fleet: Fleet, test_fleet: Fleet | None, car: CarChoice) -> Prepared:
        """Leave one trip and one day out, or fit on one fleet and score another."""
        vehicle = load_vehicle(car.name, "default", car.overrides)
        audited = audit(fleet)
        notes = [*map(message, fleet.notes)]
        if test_fleet is None:
            hold_outs, more = _held_out(fleet, audited, vehicle)
            return Prepared(hold_outs, fleet, None, audited, {"physics": vehicle}, (*notes, *more))
        scored = audit(test_fleet)
        hold_outs, more = _other_trips(fleet, audited, test_fleet, scored, vehicle)
        notes += map(message, test_fleet.notes)
        return Prepared(hold_outs, fleet, test_fleet, scored, {"physics": vehicle}, (*notes, *more))

    def assemble(
        self, prepared: Prepared, results: Sequence[FoldResult], specs: Sequence[ModelSpec], seed: int
    ) -> EvaluationRun:
        """Errors of the totals, intervals, updates, strata and the learning curve."""
        hold_outs, names = prepared.hold_outs, [spec.name for spec in specs]
        frames, summaries = [], []
        for i, hold_out in enumerate(hold_outs):
            own = [r for r in results if r.evaluation == i and r.model in names]
            energies = {n: by_trip_of(hold_out, [r for r in own if r.model == n]) for n in names}
            frame = fold_frame(hold_out, energies, specs)
            summary = summary_of(hold_out, frame, own, specs, seed)
            add_crps_of_points(summary["models"], frame)
            if FORECAST in summary["models"]:
                summary["models"][FORECAST] |= forecast_scores(hold_out, own, frame, seed)
            frames.append(frame)
            summaries.append(summary)
        main = hold_outs[0]
        about = about_trips(main.data, main.scored)
        found: dict[str, Any] = {
            **about_run(self.name, prepared, specs, seed),
            "fitted_on": prepared.fleet.name,
            "evaluations": summaries,
            "paired": paired_summary(main, frames[0], specs, seed),
            "learning_curve": learning_curve([r for r in results if r.model == CURVE], seed),
            "strata": strata(about, frames[0], seed),
        }
        kept = forecast_insight(main, [r for r in results if r.evaluation == 0], frames[0])
        return EvaluationRun(
            results=found,
            folds=pd.concat(frames, ignore_index=True),
            series={} if kept is None else measured_beside(kept),
            signals=pd.DataFrame(),
            forecast=kept,
        )


def _held_out(fleet: Fleet, audited: Audit, vehicle: Vehicle) -> tuple[list[HoldOut], list[str]]:
    """Leave-one-trip-out on the reference and the audited trips, leave-one-day-out on the first of them."""
    named = {"reference": fleet.reference_trips(), "audited": audited.trips}
    notes = []
    found: list[HoldOut] = []
    for name, trips in named.items():
        if not trips:
            notes.append(f"no {name} trips in the data set {fleet.name!r}")
            continue
        _require(len(trips) - 1, fleet)
        data = ForecastData.from_trips(trips, vehicle)
        folds = np.arange(len(data), dtype=np.int64)
        found.append(HoldOut(LEAVE_ONE_TRIP_OUT, name, data.table, folds, data))
    if not found:
        _require(0, fleet)
    main = found[0]
    days = [trip.context.day for trip in main.table.trips]
    _, day = np.unique(np.array([str(d) for d in days]), return_inverse=True)
    if any(d is None for d in days) or len(set(days)) < MIN_DAYS:
        notes.append("leave-one-day-out left out: the dates of the trips are unknown or fewer than three")
    elif len(days) - int(np.bincount(day).max()) < MIN_TRIPS:
        notes.append("leave-one-day-out left out: too few trips remain without the fullest day")
    else:
        found.append(HoldOut(LEAVE_ONE_DAY_OUT, main.trips, main.table, day.astype(np.int64), main.data))
    regimes, more = _regimes(main)
    return [*found, *regimes], [*notes, *more]


def _regimes(main: HoldOut) -> tuple[list[HoldOut], list[str]]:
    """Fit on a part of the trips, score another kind: longer, faster, the other season, later."""
    plans, trips = main.data.plans, main.table.trips
    duration = np.array([plan.duration_s for plan in plans])
    speed = np.array([plan.distance_m for plan in plans]) / np.maximum(duration, 1.0)
    seasons = np.array([str(trip.context.season) for trip in trips])
    parts: list[tuple[str, str, BoolArray, BoolArray]] = []
    for name, values in (("longer third", duration), ("faster third", speed)):
        beyond = values > np.quantile(values, SPLIT)
        parts.append((LEAVE_REGIME_OUT, name, ~beyond, beyond))
    for train, test in (("summer", "winter"), ("winter", "summer")):
        parts.append((LEAVE_REGIME_OUT, f"{test}, fitted on {train}", seasons == train, seasons == test))
    days = [None if trip.context.day is None else str(trip.context.day) for trip in trips]
    if all(day is not None for day in days):
        order = np.argsort(np.array(days, dtype=np.str_), kind="stable")
        later = np.zeros(len(plans), dtype=bool)
        later[order[int(np.ceil(SPLIT * len(order))) :]] = True
        parts.append((TIME_SPLIT, "last third by date", ~later, later))
    found, left_out = [], []
    for scheme, name, fitted, scored in parts:
        if fitted.sum() < MIN_TRIPS or scored.sum() < MIN_SCORED:
            left_out.append(name)
            continue
        chosen = np.flatnonzero(fitted | scored)
        folds = np.where(scored[chosen], 0, TRAINING_ONLY).astype(np.int64)
        data = main.data.take(chosen)
        found.append(HoldOut(scheme, name, data.table, folds, data))
    notes = [f"regimes left out for too few trips: {', '.join(left_out)}"] if left_out else []
    return found, notes


def _other_trips(
    fleet: Fleet, audited: Audit, test_fleet: Fleet, test_audited: Audit, vehicle: Vehicle
) -> tuple[list[HoldOut], list[str]]:
    """Fit on the trips of one fleet, score those of another: reference trips, or audited ones without a reference."""
    train: Sequence[Trip] = fleet.reference_trips() or audited.trips
    name = "reference" if test_fleet.reference_trips() else "audited"
    test: Sequence[Trip] = test_fleet.reference_trips() or test_audited.trips
    _require(len(train), fleet)
    if not test:
        raise InvalidInput(
            Fault("no trip to score", f"--test {test_fleet.name}", "0", "at least 1 after the audit")
        )
    data = ForecastData.from_trips([*test, *train], vehicle)
    folds: IntArray = np.concatenate(
        [np.zeros(len(test), np.int64), np.full(len(train), TRAINING_ONLY, np.int64)]
    )
    note = f"fitted on {len(train)} trips of {fleet.name!r}, scored on {len(test)} of {test_fleet.name!r}"
    return [HoldOut(OTHER_TRIPS, name, data.table, folds, data)], [note]


def _require(training: int, fleet: Fleet) -> None:
    if training < MIN_TRIPS:
        got = f"{training} to train on, of {len(fleet.trips)}"
        raise InvalidInput(
            Fault("too few trips after the audit", fleet.name, got, f"at least {MIN_TRIPS} to train on")
        )
