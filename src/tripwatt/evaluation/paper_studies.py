"""What the protocol `paper` measures beside its table, on the reference trips alone.

Other published forms of the simulation and what the correctors reach on them, working correlations of the boosting,
errors of the GAMM, choices among them inside the fold, and the error by the number of training trips.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.evaluation.hold_outs import LEAVE_ONE_TRIP_OUT, HoldOut
from tripwatt.evaluation.metrics import absolute_percentage_error, summarise_errors
from tripwatt.evaluation.protocol import FoldResult, ModelSpec
from tripwatt.evaluation.table_models import REFERENCE, TableModel
from tripwatt.hybrid import EnergyModel, PhysicsOnly, TripTable
from tripwatt.paper import correctors
from tripwatt.vehicles import Vehicle, load_vehicle

PAPER_CAR: Final = "bmw_i3_60ah"
"""The car for which the forms of the simulation have values."""

BROCHURE: Final[Mapping[str, float | str]] = MappingProxyType(
    {"road_load.method": "coefficients", "body.curb_mass_kg": 1195.0}
)
"""Drag, rolling resistance and mass as published for the i3 in place of the measured coast-down and the test weight:
c_d 0.29 and 2.38 m² (BMW, technical data i3), c_r 0.0065 (TUM simulation of the i3), 1195 kg (BMW, without driver)."""

NO_AUXILIARIES: Final[Mapping[str, float | str]] = MappingProxyType({"auxiliaries.base_load_w": 0.0})

EFFICIENCY: Final = 0.9
"""Of motor, inverter and gearbox together in the quasi-static form, a round number that no source states for this car."""

CONSTANT_EFFICIENCY: Final[Mapping[str, float | str]] = MappingProxyType(
    {
        "drivetrain.gearbox_efficiency": EFFICIENCY,
        "drivetrain.phase_resistance_ohm": 0.0,
        "drivetrain.iron_loss_linear": 0.0,
        "drivetrain.iron_loss_quadratic": 0.0,
        "drivetrain.inverter_fixed_loss_w": 0.0,
        "drivetrain.inverter_voltage_drop_v": 0.0,
        "drivetrain.inverter_resistance_ohm": 0.0,
    }
)
"""The quasi-static model of a textbook (Guzzella and Sciarretta, Vehicle Propulsion Systems): one efficiency from battery
to wheel and its reciprocal for braking, in place of the loss maps."""


@dataclass(frozen=True, slots=True)
class SimulationForm:
    """A published form of the simulation: what differs from the preset `paper`."""

    name: str
    title: str
    overrides: Mapping[str, float | str]


FORMS: Final = (
    SimulationForm(
        "physics-no-auxiliaries", "paper preset without auxiliary loads (base load of 300 W)", NO_AUXILIARIES
    ),
    SimulationForm(
        "physics-idle", "published drag, rolling resistance and mass; base load of 300 W", BROCHURE
    ),
    SimulationForm(
        "physics-brochure",
        "published drag, rolling resistance and mass; no auxiliary loads",
        {**BROCHURE, **NO_AUXILIARIES},
    ),
    SimulationForm(
        "physics-textbook",
        f"quasi-static, efficiency {EFFICIENCY:g}; published drag, rolling resistance and mass; no auxiliary loads",
        {**BROCHURE, **NO_AUXILIARIES, **CONSTANT_EFFICIENCY},
    ),
    SimulationForm(
        "physics-textbook-energy",
        "the same; half of the braking energy, not of the braking power, returns to the battery",
        {**BROCHURE, **NO_AUXILIARIES, **CONSTANT_EFFICIENCY, "regeneration.fraction": 0.5 / EFFICIENCY},
    ),
)
"""Forms of the paper's simulation. All are without climate control, as the paper says of its own."""

NEAREST: Final = "physics-brochure"
"""The form whose error on the reference trips is nearest to that of the paper's simulation; the correctors run on it."""


@dataclass(frozen=True, slots=True)
class StudyModel(TableModel):
    """A model that runs on the reference trips, where their simulation is known."""

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """All folds of the reference trips, none of other sets."""
        known = self.simulation is None or self.simulation in hold_out.table.simulated_wh
        return hold_out.fold_numbers if known and _is_reference(hold_out) else frozenset()


def _is_reference(hold_out: HoldOut) -> bool:
    return hold_out.scheme == LEAVE_ONE_TRIP_OUT and hold_out.trips == REFERENCE


def _physics(seed: int, *, simulation: str) -> EnergyModel:
    return PhysicsOnly(simulation)


SIMULATIONS: Final = tuple(
    StudyModel(form.name, form.title, functools.partial(_physics, simulation=form.name), form.name)
    for form in FORMS
)
ON_NEAREST: Final = tuple(
    StudyModel(
        f"{name}-brochure",
        f"{title} on {NEAREST}",
        functools.partial(make, simulation=NEAREST),
        NEAREST,
    )
    for name, title, make in (
        ("gamm", "GAMM with Student's t errors", correctors.gamm),
        ("forest", "clustered forest", correctors.forest),
        ("boosting", "clustered boosting", correctors.boosting),
    )
)
CORRELATIONS: Final = tuple(
    StudyModel(
        f"boosting-{kind}",
        f"clustered boosting, working correlation {kind}",
        functools.partial(correctors.boosting, correlation=kind),
        correctors.SIMULATION,
    )
    for kind in ("exchangeable", "ar1")
)
GAMM_ERRORS: Final = (
    StudyModel(
        "gamm-ar1",
        "GAMM with normal AR(1) errors within a trip",
        functools.partial(correctors.gamm, errors="ar1"),
        correctors.SIMULATION,
    ),
)

CHOICES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "gamm-chosen": ("gamm", *(model.name for model in GAMM_ERRORS)),
        "boosting-chosen": ("boosting", *(model.name for model in CORRELATIONS)),
    }
)
"""Name in the results -> models among which each fold chooses by errors of its own training trips."""

CHOSEN_TITLES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "gamm-chosen": "GAMM, errors chosen inside the fold",
        "boosting-chosen": "clustered boosting, working correlation chosen inside the fold",
    }
)

SIZES: Final = (3, 6, 12, 24, 48)
"""Numbers of training trips of the learning curve."""
DRAWS: Final = 4
"""Random draws of training trips of each number."""
CURVE: Final = "trips-needed"
CURVE_MODELS: Final = ("boosting", "boosting-only")
CURVE_BOOTSTRAP: Final = 2000


@dataclass(frozen=True, slots=True)
class TripsNeeded:
    """Errors of the hybrid and of the data-driven boosting by the number of training trips."""

    name: str = CURVE
    title: str = "error by the number of training trips"
    simulation: str | None = None

    def folds(self, hold_out: HoldOut) -> frozenset[int]:
        """Numbers of the draws: draw x 1000 + size; a size needs as many trips again to be scored."""
        if not _is_reference(hold_out):
            return frozenset()
        sizes = [size for size in SIZES if size + MIN_SCORED <= len(hold_out.table)]
        return frozenset(draw * 1000 + size for draw in range(DRAWS) for size in sizes)

    def tasks(
        self, index: int, hold_out: HoldOut, folds: Sequence[int], seed: int
    ) -> Iterator[TripsNeededTask]:
        """One task for each draw; a smaller training set is part of the larger one of the same draw."""
        table = hold_out.table.without_samples()
        for fold in folds:
            yield TripsNeededTask(index, table, fold, seed)


MIN_SCORED: Final = 5
"""Trips that are left to score."""


@dataclass(frozen=True)
class TripsNeededTask:
    """One random draw of training trips; both models are scored on all others."""

    evaluation: int
    table: TripTable
    fold: int
    seed: int
    rank: int = 2

    @property
    def members(self) -> tuple[int, ...]:
        """The one result of the task."""
        return (self.fold,)

    def run(self) -> list[FoldResult]:
        """APE of each model over the trips that were not drawn."""
        draw, size = divmod(self.fold, 1000)
        order = np.random.default_rng((self.seed, draw)).permutation(len(self.table))
        train, test = np.sort(order[:size]), np.sort(order[size:])
        known, held_out = self.table.take(train), self.table.take(test)
        observed = held_out.observed_wh[held_out.last_rows]
        extra: dict[str, Any] = {"trips": test}
        began = time.perf_counter()
        for name, make in zip(
            CURVE_MODELS, (correctors.boosting, correctors.boosting_without_physics), strict=True
        ):
            predicted = make(self.seed).fit(known).predict(held_out)[held_out.last_rows]
            extra[name] = absolute_percentage_error(observed, predicted)
        spent = time.perf_counter() - began
        return [FoldResult(self.evaluation, CURVE, self.fold, observed, spent, 0.0, extra)]


def study_models(names: Sequence[str]) -> tuple[ModelSpec, ...]:
    """The models beside the table, where the models that they vary are in the table."""
    found: list[ModelSpec] = []
    if correctors.SIMULATION in names:
        found += SIMULATIONS
        found += [model for model in ON_NEAREST if model.name.removesuffix("-brochure") in names]
    found += CORRELATIONS if "boosting" in names else ()
    found += GAMM_ERRORS if "gamm" in names else ()
    return (*found, TripsNeeded()) if set(CURVE_MODELS) <= set(names) else tuple(found)


def simulation_forms(car: str, overrides: Mapping[str, float | str] | None) -> dict[str, Vehicle]:
    """The forms of the simulation by name; none for another car than the paper's."""
    if car != PAPER_CAR:
        return {}
    return {form.name: load_vehicle(car, "paper", {**(overrides or {}), **form.overrides}) for form in FORMS}


def studies(
    hold_out: HoldOut, results: Sequence[FoldResult], specs: Sequence[ModelSpec], seed: int
) -> dict[str, Any]:
    """Scores of everything beside the table; empty where the studies did not run.

    Parameters
    ----------
    hold_out : HoldOut
        The main one.
    results : sequence of FoldResult
        Of the main hold-out, those of the table's models included.
    specs : sequence of ModelSpec
        Models of the table.
    seed : int

    Returns
    -------
    dict
        `trips, n_trips, models` (name -> title, simulation, scores, share of trips improved over that simulation),
        `choices` (name -> model -> number of folds) and `trips_needed`.
    """
    if not _is_reference(hold_out):
        return {}
    all_specs = {spec.name: spec for spec in (*specs, *study_models([spec.name for spec in specs]))}
    by_model: dict[str, dict[int, FoldResult]] = {}
    for result in results:
        by_model.setdefault(result.model, {})[result.fold] = result
    curve = list(by_model.pop(CURVE, {}).values())
    chosen = {}
    for name, candidates in CHOICES.items():
        if all(candidate in by_model for candidate in candidates):
            by_model[name], chosen[name] = chosen_folds(name, [by_model[c] for c in candidates])
    models = {}
    for name, folds in by_model.items():
        first = all_specs[CHOICES[name][0] if name in CHOICES else name]
        title = CHOSEN_TITLES.get(name, first.title)
        models[name] = {"title": title} | _scores(hold_out, folds, first.simulation, seed)
    found: dict[str, Any] = {"trips": hold_out.trips, "n_trips": len(hold_out.scored), "models": models}
    found["nearest"] = NEAREST
    found["choices"] = chosen
    found["trips_needed"] = trips_needed(curve, len(hold_out.table), seed) if curve else None
    return found


def chosen_folds(
    name: str, candidates: Sequence[Mapping[int, FoldResult]]
) -> tuple[dict[int, FoldResult], dict[str, int]]:
    """For each fold the result of the candidate with the least inner error, and how often each was chosen.

    The time of a fit is that of all candidates: all of them are fitted for the choice.
    """
    found, count = {}, {next(iter(c.values())).model: 0 for c in candidates}
    for fold in candidates[0]:
        options = [c[fold] for c in candidates]
        errors = [float(option.extra["inner_error"]) for option in options]
        best = options[int(np.nanargmin(errors))] if np.isfinite(errors).any() else options[0]
        count[best.model] += 1
        fit_s = sum(option.fit_s for option in options)
        found[fold] = FoldResult(best.evaluation, name, fold, best.predicted_wh, fit_s, best.predict_ms)
    return found, count


def _scores(
    hold_out: HoldOut, folds: Mapping[int, FoldResult], simulation: str | None, seed: int
) -> dict[str, Any]:
    table = hold_out.table
    last = table.last_rows
    predicted = np.full(len(table.observed_wh), np.nan)
    for fold, result in folds.items():
        predicted[table.rows_of(np.flatnonzero(hold_out.folds == fold))] = result.predicted_wh
    observed, ours = table.observed_wh[last], predicted[last]
    simulated = absolute_percentage_error(observed, table.simulated(simulation)[last])
    improved = np.mean(absolute_percentage_error(observed, ours) < simulated)
    own = simulation is None or np.array_equal(ours, table.simulated(simulation)[last])
    return asdict(summarise_errors(observed, ours, seed)) | {
        "simulation": simulation,
        "improved_share": None if own else float(improved),
        "fit_s": float(np.median([result.fit_s for result in folds.values()])),
        "predict_ms": float(np.median([result.predict_ms for result in folds.values()])),
    }


def trips_needed(results: Sequence[FoldResult], n_trips: int, seed: int) -> dict[str, Any]:
    """The learning curve, and the number of trips at which the hybrid reaches the other's error with the most trips.

    Parameters
    ----------
    results : sequence of FoldResult
        Of `TripsNeeded`.
    n_trips : int
        Trips of the data set.
    seed : int
        Of the bootstrap over draws and trips.

    Returns
    -------
    dict
        `curve` (`n_trips, draws`, mean error by model), `crossing` and its 95 % interval `crossing_ci95` (None where
        the curve does not reach the error).
    """
    sizes = np.unique([result.fold % 1000 for result in results])
    draws = np.unique([result.fold // 1000 for result in results])
    errors = np.full((len(CURVE_MODELS), len(sizes), len(draws), n_trips), np.nan)
    for result in results:
        draw, size = divmod(result.fold, 1000)
        place = np.searchsorted(sizes, size), np.searchsorted(draws, draw), result.extra["trips"]
        for m, name in enumerate(CURVE_MODELS):
            errors[(m, *place)] = result.extra[name]
    means = _weighted(errors, np.ones(len(draws)), np.ones(n_trips))
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(CURVE_BOOTSTRAP):
        drawn = np.bincount(rng.integers(0, len(draws), len(draws)), minlength=len(draws))
        trips = np.bincount(rng.integers(0, n_trips, n_trips), minlength=n_trips)
        found.append(crossing(sizes, _weighted(errors, drawn, trips)))
    low, high = np.quantile(found, [0.025, 0.975], method="nearest")
    curve = [
        {"n_trips": int(size), "draws": len(draws)}
        | {name: float(means[m, i]) for m, name in enumerate(CURVE_MODELS)}
        for i, size in enumerate(sizes)
    ]
    point = crossing(sizes, means)
    ends = [None if not np.isfinite(end) else float(end) for end in (low, high)]
    return {
        "curve": curve,
        "crossing": float(point) if np.isfinite(point) else None,
        "crossing_ci95": ends,
    }


def _weighted(errors: FloatArray, draws: IntArray | FloatArray, trips: IntArray | FloatArray) -> FloatArray:
    """Mean error of each model and size, shape (models, sizes), with weights of draws and of trips."""
    weight = np.where(np.isnan(errors), 0.0, np.outer(draws, trips))
    total = weight.sum(axis=(2, 3))
    with np.errstate(invalid="ignore"):
        return np.asarray((np.nan_to_num(errors) * weight).sum(axis=(2, 3)) / total)


def crossing(sizes: IntArray, means: FloatArray) -> float:
    """Number of trips at which the first curve comes down to the last value of the second; infinite where it does not.

    Between two sizes the error is a straight line in the logarithm of the number of trips. A first curve that is below from
    the start has the smallest size.

    Parameters
    ----------
    sizes : ndarray of int, shape (sizes,)
        Increasing.
    means : ndarray, shape (2, sizes)

    Examples
    --------
    >>> float(crossing(np.array([1, 4, 16]), np.array([[0.5, 0.3, 0.1], [0.9, 0.6, 0.4]])).round(6))
    2.0
    """
    target, curve = means[1, -1], means[0]
    below = np.flatnonzero(curve <= target)
    if not len(below):
        return float("inf")
    i = int(below[0])
    if i == 0:
        return np.float64(sizes[0])
    share = (curve[i - 1] - target) / (curve[i - 1] - curve[i])
    logs = np.log(sizes[[i - 1, i]])
    return np.float64(np.exp(logs[0] + share * (logs[1] - logs[0])))
