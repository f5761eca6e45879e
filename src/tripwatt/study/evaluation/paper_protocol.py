"""The protocol of arXiv:2405.10984: cumulative energy, correctors of the paper's physics, leave one trip out.

The correctors always correct `physics-paper`, even if the default physics improves. Inside the fold their
settings are chosen by the score of the table: the absolute error at the end of the trip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from tripwatt.auditing import Audit, audit
from tripwatt.errors import Fault, InvalidInput
from tripwatt.hybrid import Corrector, TripTable, build_table
from tripwatt.hybrid.outside import is_regressor
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.hold_outs import (
    WITHOUT_DAYS,
    CarChoice,
    HoldOut,
    HoldOutChoice,
    Prepared,
    build_hold_outs,
    number_days,
)
from tripwatt.study.evaluation.outside import WholeMethod, WholeModel, is_whole_model, outside_spec
from tripwatt.study.evaluation.paper_studies import simulation_forms, studies, study_comparisons
from tripwatt.study.evaluation.results import EvaluationRun, build_run
from tripwatt.study.evaluation.table_models import (
    CONSTANT,
    LINEAR4,
    LINEAR6,
    PHYSICS,
    PHYSICS4,
    PHYSICS_PAPER,
    TableMethod,
    table_model,
)
from tripwatt.study.evaluation.tasks import ModelSpec
from tripwatt.study.paper import correctors
from tripwatt.study.paper.insight import GammInsight, insight
from tripwatt.trips import Trip, TripSet, value_faults
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle

MIN_FOLDS: Final = 3
"""Smallest number of trips that are left out in turn: a choice, two trips to fit on."""

PRESETS: Final[Mapping[str, str]] = {"physics-paper": "paper", "physics": "default"}
"""Name of the simulated energy -> preset of the vehicle."""

PUBLISHED: Final[Mapping[str, float]] = {
    "physics-paper": 0.379,
    "gamm": 0.115,
    "forest": 0.106,
    "boosting": 0.103,
}
"""Mean errors from leave-one-trip-out in the paper's Table 3, by the names of models here."""


class PaperProtocol:
    """The paper's protocol; its members are documented in `tripwatt.study.evaluation.protocol.EvaluationProtocol`."""

    name = "paper"
    models: tuple[ModelSpec, ...] = (
        CONSTANT,
        LINEAR4,
        LINEAR6,
        PHYSICS_PAPER,
        PHYSICS,
        PHYSICS4,
        table_model("gamm", "hybrid, GAMM with Student's t errors", correctors.gamm, "physics-paper"),
        table_model("forest", "hybrid, clustered forest", correctors.forest, "physics-paper"),
        table_model("boosting", "hybrid, clustered boosting", correctors.boosting, "physics-paper"),
        table_model("boosting-only", "boosting without physics", correctors.boosting_without_physics),
    )
    focus: str | None = None
    published: Mapping[str, float] = PUBLISHED
    given = ""

    def from_outside(self, name: str, model: Corrector | WholeModel) -> ModelSpec:
        """Make the row of a whole model, or of a regressor with the covariates and the simulation of the paper's correctors."""
        if is_whole_model(model):
            return outside_spec(name, model, WholeMethod(model), None)
        if not is_regressor(model):
            got = f"{type(model).__name__} on segments"
            allowed = "a regressor, a whole model, or protocol 'forecast'"
            raise InvalidInput.of("model not available", "models", got, allowed)
        return outside_spec(
            name, model, TableMethod(partial(correctors.outside, model)), correctors.SIMULATION
        )

    def further_comparisons(
        self, prepared: Prepared[TripTable], specs: Sequence[ModelSpec], seed: int
    ) -> list[Comparison]:
        """Return the comparisons of `tripwatt.study.evaluation.paper_studies`."""
        return study_comparisons(prepared.hold_outs[0], [spec.name for spec in specs], seed)

    def prepare(
        self, fleet: TripSet, test_fleet: TripSet | None, car: CarChoice, choice: HoldOutChoice
    ) -> Prepared[TripTable]:
        """Prepare each set of trips for leave-one-trip-out, and the main set also for leave-one-day-out."""
        if test_fleet is not None:
            got, allowed = f"protocol {self.name!r}", "protocol 'forecast'"
            raise InvalidInput.of("option not available", "--test", got, allowed)
        cars = {name: car.load(preset) for name, preset in PRESETS.items()}
        override_notes = [
            f"{cars['physics'].name} with {key} = {value}" for key, value in (car.overrides or {}).items()
        ]
        audited = audit(fleet)
        forms = simulation_forms(car) if fleet.reference is not None and choice.chosen is None else {}
        hold_outs, notes = _hold_outs(fleet, audited, cars | forms, choice)
        return Prepared(
            hold_outs, fleet, None, audited, cars, (*map(message, fleet.notes), *override_notes, *notes)
        )

    def assemble(
        self,
        prepared: Prepared[TripTable],
        main: Sequence[Comparison],
        further: Sequence[Comparison],
        seed: int,
    ) -> EvaluationRun:
        """Score the totals and the studies, and fit the GAMM to all trips."""
        first, table = main[0], main[0].hold_out.table
        methods = {spec.name: spec.method for spec in first.specs}
        models = {name: m.make(seed) for name, m in methods.items() if isinstance(m, TableMethod)}
        weathers = {t.context.weather for t in prepared.fleet.trips if t.context.weather is not None}
        gamm = insight(table, models, weathers=sorted(weathers))
        scores = {
            "evaluations": [comparison.summary(seed) for comparison in main],
            "table2": _table2(gamm),
            "studies": studies(first, further, seed),
        }
        return replace(build_run(self.name, prepared, main, seed, scores), gamm=gamm)


def _table2(gamm: GammInsight | None) -> list[dict[str, Any]]:
    """List every term of the fitted GAMM: estimate and standard error, or EDF and reference df, and p (None without a test)."""
    if gamm is None:
        return []
    tables = ((gamm.summary.parametric, "estimate", "std_error"), (gamm.summary.smooth, "edf", "ref_df"))
    return [
        {"term": str(term)}
        | {column: float(row[column]) for column in columns}
        | {"p_value": float(row["p_value"]) if np.isfinite(row["p_value"]) else None}
        for table, *columns in tables
        for term, row in table.iterrows()
    ]


def _hold_outs(
    fleet: TripSet, audited: Audit, cars: Mapping[str, Vehicle], choice: HoldOutChoice
) -> tuple[list[HoldOut[TripTable]], list[str]]:
    """Return the hold-outs of the reference, the audited and all usable trips, as far as there are any, and notes."""
    usable, notes = _usable(fleet.trips)
    candidates = {"reference": fleet.reference_trips(), "audited": audited.trips, "all": usable}
    sets = {name: trips for name, trips in candidates.items() if trips}
    if fleet.reference is not None and "reference" not in sets:
        notes.append(f"none of the reference trips of the data set {fleet.name!r} is here")
    if not sets or max(map(len, sets.values())) < MIN_FOLDS:
        got = f"{len(audited.trips)} of {len(fleet.trips)}"
        allowed = f"at least {MIN_FOLDS} with measured energy"
        raise InvalidInput.of("too few trips after the audit", fleet.name, got, allowed)
    main = next(iter(sets.values()))
    days = number_days(main)
    notes += [WITHOUT_DAYS] if days is None else []
    hold_outs = build_hold_outs(sets, days, choice, partial(build_table, physics=cars), lambda table: table)
    return hold_outs, [*notes, *hold_outs[0].table.notes, *choice.notes(main)]


def _usable(trips: Sequence[Trip]) -> tuple[list[Trip], list[str]]:
    """Return the unaudited trips that can be simulated and scored, and notes that name the others."""
    usable, notes = [], []
    for trip in trips:
        faults = list(value_faults(trip.samples, trip.trip_id))
        if trip.observed_energy_wh is None or not trip.observed_energy_wh > 0:
            faults.append(Fault("no measured, positive energy", trip.trip_id))
        if faults:
            notes.append(f"unaudited row leaves out {faults[0]}")
        else:
            usable.append(trip)
    return usable, notes
