"""The forecast protocol: energy before departure with its uncertainty, and updates on the way.

To predict a held-out trip, every model uses its speed trace and what was known at departure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter
from types import MappingProxyType
from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, IntArray
from tripwatt.auditing import Audit, audit
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import DEFAULT_CORRECTOR, GIVEN
from tripwatt.forecasting.model import MIN_TRIPS
from tripwatt.hybrid import Corrector
from tripwatt.learners.folds import TRAINING_ONLY, leave_one_out
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.forecast_data import ForecastData
from tripwatt.study.evaluation.forecast_models import DataMethod, ForecastMethod, PowerMethod
from tripwatt.study.evaluation.forecast_results import (
    CURVE_DRAWS,
    forecast_frame,
    forecast_scores,
    learning_curve,
    strata,
)
from tripwatt.study.evaluation.forecast_scores import FORECAST, WITHOUT_PHYSICS, crps
from tripwatt.study.evaluation.hold_outs import (
    LEAVE_ONE_TRIP_OUT,
    LEAVE_REGIME_OUT,
    OTHER_TRIPS,
    TIME_SPLIT,
    WITHOUT_DAYS,
    CarChoice,
    HoldOut,
    HoldOutChoice,
    Prepared,
    build_hold_outs,
    number_days,
    random_draws,
)
from tripwatt.study.evaluation.outside import WholeMethod, WholeModel, is_whole_model, outside_spec
from tripwatt.study.evaluation.results import EvaluationRun, build_run
from tripwatt.study.evaluation.table_models import CONSTANT, LINEAR4, LINEAR6, PHYSICS, PHYSICS4
from tripwatt.study.evaluation.tasks import ModelSpec
from tripwatt.trips import Plan, Trip, TripSet
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle

SPLIT: Final = 2.0 / 3.0
"""Share of the trips that models are fitted on to forecast a regime or a later time: a choice."""
MIN_SCORED: Final = 3
"""Smallest number of trips of a regime that is scored: a choice, because the mean of fewer says nothing."""
CURVE_SIZES: Final = (5, 10, 20, 40)
"""Numbers of training trips of the learning curve: a choice, even steps of the logarithm."""
CURVE_MIN_TEST: Final = 8
"""Smallest number of trips left to score for a training size of the curve: a choice, a seventh of the reference trips."""

_TITLES: Final[Mapping[str, str]] = {
    "linear": "default physics, each cause scaled",
    "gp": "default physics + additive Gaussian process on power",
    "boosting": "default physics + boosting on power",
    "forest": "default physics + forest on power",
    "gamm": "default physics + GAMM on power",
    "ensemble": "default physics + mean of Gaussian process and boosting on power",
    "split": "default physics + climate and driving corrected separately, by Gaussian processes and boosting",
}
_NAMES: Final[Mapping[str, str]] = {"gp": "power-kriging", "split": "power-channels"}
"""Corrector -> its name in the files if that is not power-CORRECTOR."""


def _power_model(name: str, title: str, corrector: str | None, *, identified: bool = False) -> ModelSpec:
    return ModelSpec(name, title, PowerMethod(corrector, identified), "physics")


_DATA_ONLY: Final = ModelSpec(
    WITHOUT_PHYSICS, "boosting on the power of segments, without physics", DataMethod("boosting")
)


class ForecastProtocol:
    """The forecast protocol; its members are documented in `tripwatt.study.evaluation.protocol.EvaluationProtocol`.

    Parameters
    ----------
    corrector : str
        Corrector of the forecast; the other correctors are compared with it.
    """

    name = "forecast"
    focus: str | None = FORECAST
    published: Mapping[str, float] = MappingProxyType({})
    given = GIVEN

    def __init__(self, corrector: str = DEFAULT_CORRECTOR) -> None:
        self.centre = _power_model(FORECAST, _TITLES[corrector], corrector)
        self.models: tuple[ModelSpec, ...] = (
            *(CONSTANT, LINEAR4, LINEAR6, PHYSICS, PHYSICS4, _DATA_ONLY),
            *(
                _power_model(_NAMES.get(name, f"power-{name}"), title, name)
                for name, title in _TITLES.items()
                if name != corrector
            ),
            _power_model(
                "physics-identified",
                "physics, stages identified from their signals in each fold",
                None,
                identified=True,
            ),
            _power_model("hybrid-published", f"{_TITLES[corrector]}, with published values only", corrector),
            ModelSpec(
                FORECAST,
                f"the forecast: {_TITLES[corrector]}, on physics identified in each fold, with intervals and updates",
                ForecastMethod(corrector),
                "physics",
            ),
        )

    def from_outside(self, name: str, model: Corrector | WholeModel) -> ModelSpec:
        """Make the row of a whole model, or of a corrector in a forecast with intervals and updates on physics identified in each fold."""
        if is_whole_model(model):
            return outside_spec(name, model, WholeMethod(model), None)
        return outside_spec(name, model, ForecastMethod(model), "physics")

    def further_comparisons(
        self, prepared: Prepared[ForecastData], specs: Sequence[ModelSpec], seed: int
    ) -> list[Comparison]:
        """Return the learning curve; empty if trips are too few, not left out one by one, or one of its two models was not chosen."""
        main, models = prepared.hold_outs[0], (self.centre, _DATA_ONLY)
        if main.scheme != LEAVE_ONE_TRIP_OUT or not {m.name for m in models} <= {s.name for s in specs}:
            return []
        draws = random_draws(main, CURVE_SIZES, CURVE_DRAWS, CURVE_MIN_TEST, seed)
        return [Comparison(draws, models)] if draws.splits else []

    def prepare(
        self, fleet: TripSet, test_fleet: TripSet | None, car: CarChoice, choice: HoldOutChoice
    ) -> Prepared[ForecastData]:
        """Prepare to leave one trip, one day and regimes out or, with `test_fleet`, to fit on one fleet and score another."""
        vehicle = car.load()
        scored = audited = audit(fleet)
        notes = [*map(message, fleet.notes)]
        if test_fleet is None:
            hold_outs, further_notes = _held_out(fleet, audited, vehicle, choice)
        else:
            if choice.chosen is not None:
                raise InvalidInput.of(
                    "option has no effect", "hold_outs", "hold-outs with test trips", "one of the two"
                )
            scored = audit(test_fleet)
            hold_outs, further_notes = _other_trips(fleet, audited, test_fleet, scored, vehicle)
            notes += map(message, test_fleet.notes)
        return Prepared(hold_outs, fleet, test_fleet, scored, {"physics": vehicle}, (*notes, *further_notes))

    def assemble(
        self,
        prepared: Prepared[ForecastData],
        main: Sequence[Comparison],
        further: Sequence[Comparison],
        seed: int,
    ) -> EvaluationRun:
        """Score totals, intervals, updates, strata and the learning curve."""
        first, summaries = main[0], []
        for comparison in main:
            summary = comparison.summary(seed)
            days = [comparison.hold_out.table.days[i] for i in comparison.hold_out.tested]
            for name, scores in summary["models"].items():
                rows = comparison.rows_of(name)
                observed, point = (rows[f"{kind}_energy_wh"].to_numpy() for kind in ("observed", "predicted"))
                scores["crps_wh"] = float(crps(observed, point[:, None]).mean())
                if forecasts := comparison.forecasts(name):
                    scores |= forecast_scores(forecasts, rows, seed, days)
            summaries.append(summary)
        forecasts = first.forecasts(FORECAST)
        frame = forecast_frame(first.hold_out, forecasts, first.rows_of(FORECAST)) if forecasts else None
        content = {
            "fitted_on": prepared.fleet.name,
            "evaluations": summaries,
            "learning_curve": [row for draws in further for row in learning_curve(draws, seed)],
            "strata": strata(first, seed),
        }
        return replace(build_run(self.name, prepared, main, seed, content), forecast=frame)


def _held_out(
    fleet: TripSet, audited: Audit, vehicle: Vehicle, choice: HoldOutChoice
) -> tuple[list[HoldOut[ForecastData]], list[str]]:
    """Return the hold-outs and notes of one fleet.

    Leave-one-trip-out of the reference and of the audited trips; leave-one-day-out and regimes of the first of
    these sets.
    """
    candidates = {"reference": fleet.reference_trips(), "audited": audited.trips}
    notes = [
        f"no {name} trips in the data set {fleet.name!r}" for name, trips in candidates.items() if not trips
    ]
    sets = {name: trips for name, trips in candidates.items() if trips}
    _require_training_trips(min(map(len, sets.values()), default=1) - 1, fleet)
    main = next(iter(sets.values()))
    by_day = number_days(main)
    if by_day is None:
        notes.append(WITHOUT_DAYS)
    elif len(by_day) - int(np.bincount(by_day).max()) < MIN_TRIPS:
        notes.append("leave-one-day-out left out: too few trips remain without the fullest day")
        by_day = None
    regimes, regime_notes = _regimes(main)
    prepare = partial(ForecastData.from_trips, vehicle=vehicle)
    hold_outs = build_hold_outs(sets, by_day, choice, prepare, attrgetter("table"), regimes)
    _require_training_trips(
        min(len(split.train) for hold_out in hold_outs for split in hold_out.splits), fleet
    )
    return hold_outs, [*notes, *regime_notes] if choice.chosen is None else choice.notes(main)


def _regimes(trips: Sequence[Trip]) -> tuple[dict[tuple[str, str], tuple[IntArray, IntArray]], list[str]]:
    """Find regimes: fit on a part of the trips, score another kind (longer, faster, the other season, later).

    Returns a mapping from scheme and name of each regime to its trips and their folds, and notes on regimes left out.
    """
    plans = [Plan.from_trip(trip) for trip in trips]
    duration = np.array([plan.duration_s for plan in plans])
    speed = np.array([plan.distance_m for plan in plans]) / np.maximum(duration, 1.0)
    seasons = np.array([str(trip.context.season) for trip in trips])
    parts: list[tuple[str, str, BoolArray, BoolArray]] = []
    for name, values in (("longer third", duration), ("faster third", speed)):
        upper_third = values > np.quantile(values, SPLIT)
        parts.append((LEAVE_REGIME_OUT, name, ~upper_third, upper_third))
    for train, test in (("summer", "winter"), ("winter", "summer")):
        parts.append((LEAVE_REGIME_OUT, f"{test}, fitted on {train}", seasons == train, seasons == test))
    days = [None if trip.context.day is None else str(trip.context.day) for trip in trips]
    if all(day is not None for day in days):
        order = np.argsort(np.array(days, dtype=np.str_), kind="stable")
        later = np.zeros(len(plans), dtype=bool)
        later[order[int(np.ceil(SPLIT * len(order))) :]] = True
        parts.append((TIME_SPLIT, "last third by date", ~later, later))
    regimes, left_out = {}, []
    for scheme, name, fitted, scored in parts:
        if fitted.sum() < MIN_TRIPS or scored.sum() < MIN_SCORED:
            left_out.append(name)
            continue
        chosen = np.flatnonzero(fitted | scored)
        regimes[scheme, name] = chosen, np.where(scored[chosen], 0, TRAINING_ONLY).astype(np.int64)
    notes = [f"regimes left out for too few trips: {', '.join(left_out)}"] if left_out else []
    return regimes, notes


def _other_trips(
    fleet: TripSet, audited: Audit, test_fleet: TripSet, test_audited: Audit, vehicle: Vehicle
) -> tuple[list[HoldOut[ForecastData]], list[str]]:
    """Return the hold-out that fits on one fleet and scores another: on the reference trips of each or, without, its audited trips."""
    train: Sequence[Trip] = fleet.reference_trips() or audited.trips
    set_name = "reference" if test_fleet.reference_trips() else "audited"
    test: Sequence[Trip] = test_fleet.reference_trips() or test_audited.trips
    _require_training_trips(len(train), fleet)
    if not test:
        raise InvalidInput.of(
            "no trip to score", f"--test {test_fleet.name}", "0", "at least 1 after the audit"
        )
    data = ForecastData.from_trips([*test, *train], vehicle)
    splits = leave_one_out(np.repeat([0, TRAINING_ONLY], [len(test), len(train)]))
    note = f"fitted on {len(train)} trips of {fleet.name!r}, scored on {len(test)} of {test_fleet.name!r}"
    return [HoldOut(OTHER_TRIPS, set_name, data.table, data, splits)], [note]


def _require_training_trips(training: int, fleet: TripSet) -> None:
    if training < MIN_TRIPS:
        got = f"{training} to train on, of {len(fleet.trips)}"
        allowed = f"at least {MIN_TRIPS} to train on"
        raise InvalidInput.of("too few trips after the audit", fleet.name, got, allowed)
