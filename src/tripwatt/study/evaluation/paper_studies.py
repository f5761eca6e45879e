"""Studies of the protocol `paper` beside its table, on the reference trips alone.

They compare other published forms of the simulation and the correctors on one of them, working correlations of the
boosting, error models of the GAMM, choices among these inside the fold, and numbers of training trips.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.hybrid import EnergyModel, TripTable
from tripwatt.study.evaluation.comparison import Comparison, median_times
from tripwatt.study.evaluation.hold_outs import CarChoice, HoldOut, random_draws
from tripwatt.study.evaluation.metrics import absolute_percentage_error, summarise_errors
from tripwatt.study.evaluation.table_models import physics, table_model
from tripwatt.study.evaluation.tasks import FoldResult, ModelSpec
from tripwatt.study.paper import correctors
from tripwatt.vehicles import Vehicle

PAPER_CAR: Final = "bmw_i3_60ah"
"""The car for which the forms of the simulation have values."""

BROCHURE: Final[Mapping[str, float | str]] = {"road_load.method": "coefficients", "body.curb_mass_kg": 1195.0}
"""Drag, rolling resistance and mass as published for the i3 instead of the measured coast-down and the test weight:
c_d 0.29 and 2.38 m² (BMW, technical data i3), c_r 0.0065 (TUM simulation of the i3), 1195 kg (BMW, without driver)."""

NO_AUXILIARIES: Final[Mapping[str, float | str]] = {"auxiliaries.base_load_w": 0.0}

EFFICIENCY: Final = 0.9
"""Efficiency of motor, inverter and gearbox together in the quasi-static form: a round number, without a source for this car."""

CONSTANT_EFFICIENCY: Final[Mapping[str, float | str]] = {
    "drivetrain.gearbox_efficiency": EFFICIENCY,
    "drivetrain.phase_resistance_ohm": 0.0,
    "drivetrain.iron_loss_linear": 0.0,
    "drivetrain.iron_loss_quadratic": 0.0,
    "drivetrain.inverter_fixed_loss_w": 0.0,
    "drivetrain.inverter_voltage_drop_v": 0.0,
    "drivetrain.inverter_resistance_ohm": 0.0,
}
"""The quasi-static model of a textbook (Guzzella and Sciarretta, Vehicle Propulsion Systems): one efficiency from battery
to wheel and its reciprocal for braking, instead of the loss maps."""


FORMS: Final[Mapping[str, tuple[str, Mapping[str, float | str]]]] = {
    "physics-no-auxiliaries": ("paper preset without auxiliary loads (base load of 300 W)", NO_AUXILIARIES),
    "physics-idle": ("published drag, rolling resistance and mass; base load of 300 W", BROCHURE),
    "physics-brochure": (
        "published drag, rolling resistance and mass; no auxiliary loads",
        {**BROCHURE, **NO_AUXILIARIES},
    ),
    "physics-textbook": (
        f"quasi-static, efficiency {EFFICIENCY:g}; published drag, rolling resistance and mass; no auxiliary loads",
        {**BROCHURE, **NO_AUXILIARIES, **CONSTANT_EFFICIENCY},
    ),
    "physics-textbook-energy": (
        "the same; half of the braking energy, not of the braking power, returns to the battery",
        {**BROCHURE, **NO_AUXILIARIES, **CONSTANT_EFFICIENCY, "regeneration.fraction": 0.5 / EFFICIENCY},
    ),
}
"""Name of each published form of the paper's simulation -> title, and values that differ from the preset `paper`. Like the
paper's own, all are without climate control."""

NEAREST: Final = "physics-brochure"
"""Form of the simulation whose error on the reference trips is nearest to the paper's; correctors are also run on it."""


def _study_model(name: str, title: str, make: Callable[..., EnergyModel], **settings: Any) -> ModelSpec:
    """Make a model from `make` with settings, on the simulation among the settings or else on that of the correctors."""
    simulation = settings.get("simulation", correctors.SIMULATION)
    return table_model(name, title, functools.partial(make, **settings), simulation)


SIMULATIONS: Final = tuple(
    _study_model(name, title, physics, simulation=name) for name, (title, _) in FORMS.items()
)
ON_NEAREST: Final = tuple(
    _study_model(f"{name}-brochure", f"{title} on {NEAREST}", make, simulation=NEAREST)
    for name, title, make in (
        ("gamm", "GAMM with Student's t errors", correctors.gamm),
        ("forest", "clustered forest", correctors.forest),
        ("boosting", "clustered boosting", correctors.boosting),
    )
)
CORRELATIONS: Final = tuple(
    _study_model(
        f"boosting-{kind}",
        f"clustered boosting, working correlation {kind}",
        correctors.boosting,
        correlation=kind,
    )
    for kind in ("exchangeable", "ar1")
)
GAMM_ERRORS: Final = (
    _study_model("gamm-ar1", "GAMM with normal AR(1) errors within a trip", correctors.gamm, errors="ar1"),
)

CHOICES: Final[Mapping[str, tuple[str, ...]]] = {
    "gamm-chosen": ("gamm", *(model.name for model in GAMM_ERRORS)),
    "boosting-chosen": ("boosting", *(model.name for model in CORRELATIONS)),
}
"""Name in the results -> models among which each fold chooses by errors on its own training trips."""

CHOSEN_TITLES: Final[Mapping[str, str]] = {
    "gamm-chosen": "GAMM, errors chosen inside the fold",
    "boosting-chosen": "clustered boosting, working correlation chosen inside the fold",
}

SIZES: Final = (3, 6, 12, 24, 48)
"""Numbers of training trips of the learning curve: a choice, even steps of the logarithm."""
DRAWS: Final = 4
"""Number of random draws for each number of training trips: a choice, because each draw is a fit."""
CURVE_MODELS: Final = ("boosting", "boosting-only")
CURVE: Final = (
    table_model("boosting", "", correctors.boosting, correctors.SIMULATION),
    table_model("boosting-only", "", correctors.boosting_without_physics),
)
"""Hybrid and data-driven boosting, whose errors are compared by the number of training trips."""
CURVE_BOOTSTRAP: Final = 2000
"""Draws of the bootstrap of the crossing: a choice, because the ends are whole steps between sizes."""
MIN_SCORED: Final = 5
"""Smallest number of trips left to score: a choice, because the mean of fewer says nothing."""


def study_models(names: Sequence[str]) -> tuple[ModelSpec, ...]:
    """Return the models that are evaluated besides those of the table: variants of the chosen models `names`."""
    models: list[ModelSpec] = []
    if correctors.SIMULATION in names:
        models += SIMULATIONS
        models += [model for model in ON_NEAREST if model.name.removesuffix("-brochure") in names]
    models += CORRELATIONS if "boosting" in names else ()
    models += GAMM_ERRORS if "gamm" in names else ()
    return tuple(models)


def study_comparisons(hold_out: HoldOut[TripTable], names: Sequence[str], seed: int) -> list[Comparison]:
    """Return the comparisons beside the table: models whose simulation is available, and the learning curve.

    Parameters
    ----------
    hold_out : HoldOut
        The main hold-out; returns no comparison unless it is that of the reference trips.
    names : sequence of str
        Models of the table.
    seed : int
    """
    if not hold_out.is_reference:
        return []
    available = {None, *hold_out.table.simulated_wh}
    models = tuple(model for model in study_models(names) if model.simulation in available)
    comparisons = [Comparison(hold_out, models)]
    draws = random_draws(hold_out, SIZES, DRAWS, MIN_SCORED, seed)
    return [*comparisons, Comparison(draws, CURVE)] if set(CURVE_MODELS) <= set(names) else comparisons


def simulation_forms(car: CarChoice) -> dict[str, Vehicle]:
    """Return the car under each form of the simulation, by name; empty for any other car than the paper's."""
    if car.name != PAPER_CAR:
        return {}
    return {name: car.load("paper", overrides) for name, (_, overrides) in FORMS.items()}


def studies(main: Comparison, further: Sequence[Comparison], seed: int) -> dict[str, Any]:
    """Score everything beside the table; returns an empty dict if the studies did not run.

    Parameters
    ----------
    main : Comparison
        The models of the table on the main hold-out.
    further : sequence of Comparison
        From `study_comparisons`.
    seed : int

    Returns
    -------
    dict
        `trips, n_trips, models` (name -> title, simulation, scores, share of trips improved over that simulation),
        `choices` (name -> model -> number of folds) and `trips_needed`.
    """
    if not further:
        return {}
    table, (varied, *curve) = main.hold_out.table, further
    all_specs = {spec.name: spec for spec in (*main.specs, *varied.specs)}
    by_model: dict[str, dict[int, FoldResult]] = {}
    for result in (*main.results, *varied.results):
        by_model.setdefault(result.model, {})[result.split.number] = result
    chosen = {}
    for name, candidates in CHOICES.items():
        if all(candidate in by_model for candidate in candidates):
            by_model[name], chosen[name] = chosen_folds(name, [by_model[c] for c in candidates])
    models = {}
    for name, folds in by_model.items():
        first = all_specs[CHOICES[name][0] if name in CHOICES else name]
        title = CHOSEN_TITLES.get(name, first.title)
        models[name] = {"title": title} | _scores(table, folds, first.simulation, seed)
    return {
        "trips": main.hold_out.trips,
        "n_trips": len(table),
        "models": models,
        "nearest": NEAREST,
        "choices": chosen,
        "trips_needed": trips_needed(curve[0], seed) if curve else None,
    }


def chosen_folds(
    name: str, candidates: Sequence[Mapping[int, FoldResult]]
) -> tuple[dict[int, FoldResult], dict[str, int]]:
    """Return for each fold the result of the candidate with the smallest inner error, and how often each was chosen.

    The first candidate is chosen if no inner error is known. The time of a fit is the sum over all candidates, because all are
    fitted for the choice.
    """
    chosen, count = {}, {next(iter(c.values())).model: 0 for c in candidates}
    for fold in candidates[0]:
        options = [c[fold] for c in candidates]
        errors = [option.inner_error for option in options]
        best = options[int(np.nanargmin(errors))] if np.isfinite(errors).any() else options[0]
        count[best.model] += 1
        fit_s = sum(option.fit_s for option in options)
        chosen[fold] = replace(best, model=name, fit_s=fit_s)
    return chosen, count


def _scores(
    table: TripTable, folds: Mapping[int, FoldResult], simulation: str | None, seed: int
) -> dict[str, Any]:
    """Score one model from its folds; the share of improved trips is None for a simulation alone or without one."""
    last, predicted = table.last_rows, np.empty(len(table))
    observed, simulated = table.observed_wh[last], table.simulated(simulation)[last]
    for result in folds.values():
        predicted[result.split.test] = result.predicted_wh
    errors = (absolute_percentage_error(observed, energy_wh) for energy_wh in (predicted, simulated))
    improved = np.mean(np.less(*errors))
    is_simulation = simulation is None or np.array_equal(predicted, simulated)
    return summarise_errors(observed, predicted, seed) | {
        "simulation": simulation,
        "improved_share": None if is_simulation else float(improved),
        **median_times(list(folds.values())),
    }


def trips_needed(draws: Comparison, seed: int) -> dict[str, Any]:
    """Compute the learning curve, and the number of trips at which the hybrid reaches the data-driven model's final error.

    Parameters
    ----------
    draws : Comparison
        Comparison of `CURVE` on random draws of the trips.
    seed : int
        Seed of the bootstrap over draws and trips.

    Returns
    -------
    dict
        `curve` (`n_trips, draws`, mean error by model), `crossing` and its 95 % interval `crossing_ci95` (None if
        the curve does not reach the error).
    """
    table, splits = draws.hold_out.table, draws.hold_out.splits
    n_trips, observed = len(table), table.observed_wh[table.last_rows]
    sizes, n_draws = np.unique([len(s.train) for s in splits]), 1 + max(s.draw for s in splits)
    errors = np.full((len(CURVE_MODELS), len(sizes), n_draws, n_trips), np.nan)
    for result in draws.results:
        split, model = result.split, CURVE_MODELS.index(result.model)
        index = model, np.searchsorted(sizes, len(split.train)), split.draw, split.test
        errors[index] = absolute_percentage_error(observed[split.test], result.predicted_wh)
    means = _weighted(errors, np.ones(n_draws), np.ones(n_trips))
    rng = np.random.default_rng(seed)
    crossings = []
    for _ in range(CURVE_BOOTSTRAP):
        drawn = np.bincount(rng.integers(0, n_draws, n_draws), minlength=n_draws)
        trips = np.bincount(rng.integers(0, n_trips, n_trips), minlength=n_trips)
        crossings.append(crossing(sizes, _weighted(errors, drawn, trips)))
    low, high = np.quantile(crossings, [0.025, 0.975], method="nearest")
    curve = [
        {"n_trips": int(size), "draws": n_draws}
        | {name: float(means[m, i]) for m, name in enumerate(CURVE_MODELS)}
        for i, size in enumerate(sizes)
    ]
    point, *ends = (float(end) if np.isfinite(end) else None for end in (crossing(sizes, means), low, high))
    return {"curve": curve, "crossing": point, "crossing_ci95": ends}


def _weighted(errors: FloatArray, draws: IntArray | FloatArray, trips: IntArray | FloatArray) -> FloatArray:
    """Compute the mean error of each model and size, shape (models, sizes), weighted by draws and trips."""
    weight = np.where(np.isnan(errors), 0.0, np.outer(draws, trips))
    total = weight.sum(axis=(2, 3))
    with np.errstate(invalid="ignore"):
        return np.asarray((np.nan_to_num(errors) * weight).sum(axis=(2, 3)) / total)


def crossing(sizes: IntArray, means: FloatArray) -> float:
    """Find the number of trips at which the first curve falls to the last value of the second; infinite if it never does.

    Between two sizes the error is interpolated linearly in the logarithm of the number of trips. If the first curve
    starts at or below that value, the smallest size is returned.

    Parameters
    ----------
    sizes : ndarray of int, shape (sizes,)
        Numbers of trips, increasing.
    means : ndarray, shape (2, sizes)

    Examples
    --------
    >>> round(crossing(np.array([1, 4, 16]), np.array([[0.5, 0.3, 0.1], [0.9, 0.6, 0.4]])), 6)
    2.0
    """
    target, curve = means[1, -1], means[0]
    below = np.flatnonzero(curve <= target)
    if not len(below):
        return float("inf")
    around = slice(max(below[0] - 1, 0), below[0] + 1)
    return float(np.exp(np.interp(-target, -curve[around], np.log(sizes[around]))))
