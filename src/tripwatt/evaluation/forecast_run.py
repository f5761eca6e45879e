"""Held-out runs of the forecast protocol: models of power beside the baselines, the hybrid with intervals and updates.

Everything that is fitted, tuned or calibrated is fitted inside the fold, the residual process and the conformal
scores of `hybrid` too. Whatever a model sees of a held-out trip was known at its departure; only the re-forecasts see
the measurements, and of these no sample after the cut.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.evaluation.forecast_scores import FRACTIONS, LEVELS, UPDATE_LEVEL, UPDATES
from tripwatt.evaluation.forecast_sets import CHARGE_COLUMNS, TRAINING_ONLY, ForecastSet
from tripwatt.evaluation.protocols import ModelSpec
from tripwatt.evaluation.results import Evaluation, FoldResult
from tripwatt.forecasting import DEFAULT_CORRECTOR, Forecast, ForecastModel
from tripwatt.hybrid import BlockTable, IntArray, TripTable, power_corrector
from tripwatt.hybrid.climate_log import TOLD_BY
from tripwatt.hybrid.power import LearnerCorrector
from tripwatt.trips import FloatArray, Plan
from tripwatt.vehicles import Vehicle

POWER_PREFIX: Final = "power-"
FOLDS_PER_TASK: Final = 12
CURVE_SIZES: Final = (5, 10, 20, 40)
CURVE_DRAWS: Final = 6
CURVE_MODELS: Final = ("hybrid", "boosting-only")
CURVE_LEAST_TEST: Final = 8
"""Trips that have to be left to score a training size of the curve."""
CRPS_LEVELS: Final = 100


@dataclass(frozen=True)
class ForecastTask:
    """Some folds of one model in one evaluation; `plans` and `logs` are those of the held-out trips alone."""

    evaluation: int
    spec: ModelSpec
    folds: IntArray
    members: tuple[int, ...]
    seed: int
    vehicle: Vehicle
    table: TripTable | None = None
    blocks: BlockTable | None = None
    data_features: pd.DataFrame | None = None
    plans: Mapping[int, Plan] | None = None
    logs: Mapping[int, pd.DataFrame] | None = None


@dataclass(frozen=True)
class CurveTask:
    """One random draw of training trips; the models are scored on all others."""

    evaluation: int
    draw: int
    size: int
    seed: int
    blocks: BlockTable
    data_features: pd.DataFrame

    @property
    def fold(self) -> int:
        """Number under which the draw is kept."""
        return self.draw * 1000 + self.size

    @property
    def members(self) -> tuple[int, ...]:
        """The one result of the task."""
        return (self.fold,)


def tasks_of(
    index: int,
    evaluation: Evaluation,
    prepared: ForecastSet,
    spec: ModelSpec,
    missing: Sequence[int],
    seed: int,
    vehicle: Vehicle,
) -> Iterator[ForecastTask]:
    """The missing folds of one model, cut so that the cores are busy and nothing large is sent around."""
    if not missing:
        return
    folds = evaluation.folds
    if spec.name == "hybrid":
        for fold in missing:
            own = np.flatnonzero(folds == fold).tolist()
            plans, logs = {i: prepared.plans[i] for i in own}, {i: prepared.logs[i] for i in own}
            yield ForecastTask(
                index,
                spec,
                folds,
                (fold,),
                seed,
                vehicle,
                blocks=prepared.blocks,
                plans=plans,
                logs=logs,
            )
        return
    size = len(missing) if _together(spec, seed) or not _of_power(spec) else FOLDS_PER_TASK
    data: dict[str, Any] = (
        {"blocks": prepared.blocks, "data_features": prepared.data_features}
        if _of_power(spec)
        else {"table": evaluation.table.without_samples()}
    )
    for start in range(0, len(missing), size):
        yield ForecastTask(index, spec, folds, tuple(missing[start : start + size]), seed, vehicle, **data)


def curve_tasks(index: int, prepared: ForecastSet, seed: int) -> list[CurveTask]:
    """Draws of training trips; a smaller training set is part of the larger one of the same draw."""
    sizes = [size for size in CURVE_SIZES if size <= len(prepared) - CURVE_LEAST_TEST]
    return [
        CurveTask(index, draw, size, seed, prepared.blocks, prepared.data_features)
        for draw in range(CURVE_DRAWS)
        for size in sizes
    ]


def cost_of(task: ForecastTask | CurveTask) -> int:
    """Rank by running time: the long tasks first, so that no core waits for one at the end."""
    if isinstance(task, CurveTask):
        return 2
    if _together(task.spec, task.seed):
        return 0
    return 1 if task.spec.name == "hybrid" else 3


def run_task(task: ForecastTask | CurveTask) -> list[FoldResult]:
    """Run one task; importable by name for other processes."""
    if isinstance(task, CurveTask):
        return [_run_curve(task)]
    if task.spec.name == "hybrid":
        return [_run_hybrid(task, fold) for fold in task.members]
    if not _of_power(task.spec):
        return [_run_baseline(task, fold) for fold in task.members]
    if _together(task.spec, task.seed) and TRAINING_ONLY not in task.folds:
        return _run_together(task)
    return [_run_power(task, fold) for fold in task.members]


def _of_power(spec: ModelSpec) -> bool:
    return spec.name == "boosting-only" or spec.name.startswith(POWER_PREFIX)


def _together(spec: ModelSpec, seed: int) -> bool:
    """Whether the model's learner gives the held-out predictions of all folds at once."""
    if spec.name == "boosting-only":
        return True
    return spec.name.startswith(POWER_PREFIX) and isinstance(
        power_corrector(spec.name.removeprefix(POWER_PREFIX), seed), LearnerCorrector
    )


def _data_learner(seed: int) -> Any:
    """The boosting of the corrector, for the measured power itself."""
    corrector = power_corrector("boosting", seed)
    assert isinstance(corrector, LearnerCorrector)
    return corrector.model


def _learned(task: ForecastTask) -> tuple[Any, Any, FloatArray, FloatArray]:
    """Learner, its columns, its target and what it starts from, over all rows [W]."""
    blocks = task.blocks
    assert blocks is not None
    if task.spec.name == "boosting-only":
        target = blocks.observed_power_w
        return _data_learner(task.seed), task.data_features, target, np.zeros(len(target))
    corrector = power_corrector(task.spec.name.removeprefix(POWER_PREFIX), task.seed)
    assert isinstance(corrector, LearnerCorrector)
    return corrector.model, corrector.columns(blocks), blocks.residual_w, blocks.simulated_w


def _run_together(task: ForecastTask) -> list[FoldResult]:
    """All folds at once; the times are those of one plain fit."""
    learner, columns, target, start = _learned(task)
    blocks = task.blocks
    assert blocks is not None
    row_folds = task.folds[blocks.groups]
    held_out = np.asarray(learner.leave_groups_out(columns, target, groups=blocks.groups, folds=row_folds))
    totals = blocks.totals_wh(start + held_out)
    began = time.perf_counter()
    learner.fit(columns, target, groups=blocks.groups)
    fitted = time.perf_counter()
    learner.predict(columns)
    each_ms = 1000.0 * (time.perf_counter() - fitted) / len(blocks)
    return [
        FoldResult(task.evaluation, task.spec.name, fold, totals[task.folds == fold], fitted - began, each_ms)
        for fold in task.members
    ]


def _run_power(task: ForecastTask, fold: int) -> FoldResult:
    assert task.blocks is not None
    assert task.data_features is not None
    train = np.flatnonzero(task.folds != fold)
    test = np.flatnonzero(task.folds == fold)
    began = time.perf_counter()
    predict = _fitted(task.spec.name, task.seed, task.blocks, task.data_features, train)
    fitted = time.perf_counter()
    totals = predict(test)
    each_ms = 1000.0 * (time.perf_counter() - fitted) / len(test)
    return FoldResult(task.evaluation, task.spec.name, fold, totals, fitted - began, each_ms)


def _fitted(name: str, seed: int, blocks: BlockTable, data_features: pd.DataFrame, train: IntArray) -> Any:
    """Fit a point model of power on some trips; what comes back predicts the energies of others [Wh]."""
    of_train = blocks.take(train)
    if name == "boosting-only":
        learner = _data_learner(seed)
        rows = np.isin(blocks.groups, train)
        learner.fit(
            data_features[rows], blocks.take(np.sort(train)).observed_power_w, groups=blocks.groups[rows]
        )

        def by_data(test: IntArray) -> FloatArray:
            chosen = np.isin(blocks.groups, test)
            return blocks.take(np.sort(test)).totals_wh(np.asarray(learner.predict(data_features[chosen])))

        return by_data
    corrector = power_corrector(name.removeprefix(POWER_PREFIX), seed).fit(of_train)

    def corrected(test: IntArray) -> FloatArray:
        found = blocks.take(test)
        return found.totals_wh(found.simulated_w + corrector.predict(found))

    return corrected


def _run_baseline(task: ForecastTask, fold: int) -> FoldResult:
    assert task.table is not None
    test = np.flatnonzero(task.folds == fold)
    model = task.spec.build(task.seed)
    began = time.perf_counter()
    model.fit(task.table.take(np.flatnonzero(task.folds != fold)))
    fitted = time.perf_counter()
    found = task.table.take(test)
    predicted = model.predict(found)[found.last_rows]
    each_ms = 1000.0 * (time.perf_counter() - fitted) / len(test)
    return FoldResult(task.evaluation, task.spec.name, fold, predicted, fitted - began, each_ms)


def _run_curve(task: CurveTask) -> FoldResult:
    """APE of both models over the trips that were not drawn."""
    order = np.random.default_rng((task.seed, task.draw)).permutation(len(task.blocks))
    train, test = np.sort(order[: task.size]), np.sort(order[task.size :])
    found = task.blocks.take(test)
    observed = found.totals_wh(found.observed_power_w)
    names = {"hybrid": f"{POWER_PREFIX}{DEFAULT_CORRECTOR}", "boosting-only": "boosting-only"}
    extra: dict[str, npt.NDArray[Any]] = {"size": np.array(task.size), "draw": np.array(task.draw)}
    began = time.perf_counter()
    for model, name in names.items():
        predicted = _fitted(name, task.seed, task.blocks, task.data_features, train)(test)
        extra[model] = np.abs(predicted - observed) / np.abs(observed)
    return FoldResult(
        task.evaluation, "learning-curve", task.fold, observed, time.perf_counter() - began, 0.0, extra
    )


def _run_hybrid(task: ForecastTask, fold: int) -> FoldResult:
    assert task.blocks is not None
    assert task.plans is not None
    assert task.logs is not None
    test = np.flatnonzero(task.folds == fold)
    model = ForecastModel(task.vehicle, seed=task.seed)
    began = time.perf_counter()
    model.fit_blocks(task.blocks.take(np.flatnonzero(task.folds != fold)))
    fitted = time.perf_counter()
    forecasts = [model.forecast(task.plans[int(i)]) for i in test]
    energies = np.array([f.energy_wh for f in forecasts])
    each_ms = 1000.0 * (time.perf_counter() - fitted) / len(test)
    extra = _kept(forecasts, [task.logs[int(i)] for i in test])
    return FoldResult(task.evaluation, task.spec.name, fold, energies, fitted - began, each_ms, extra)


def _kept(forecasts: Sequence[Forecast], logs: Sequence[pd.DataFrame]) -> dict[str, npt.NDArray[Any]]:
    """Everything that is scored or drawn of some forecasts, as plain arrays with one row per trip."""
    levels = (np.arange(CRPS_LEVELS) + 0.5) / CRPS_LEVELS
    bounds = np.array([[f.interval(level) for level in LEVELS] for f in forecasts])
    observed = [float(log["observed_energy_wh"].iloc[-1]) for log in logs]
    causes = [f.by_cause_wh for f in forecasts]
    series = [f.series() for f in forecasts]
    return {
        "sd": np.array([f.sd_wh for f in forecasts]),
        "low": bounds[:, :, 0],
        "high": bounds[:, :, 1],
        "factors": np.array([[f.scores.factor(level) for level in levels] for f in forecasts]),
        "pit": np.array([f.probability_below(o) for f, o in zip(forecasts, observed, strict=True)]),
        "flags": np.array([len(f.flags) for f in forecasts]),
        "cause_names": np.array(list(causes[0])),
        "causes": np.array([list(c.values()) for c in causes]),
        "updates": np.array(
            [[reforecast(f, log, x) for x in FRACTIONS] for f, log in zip(forecasts, logs, strict=True)]
        ),
        "series_names": np.array(list(series[0].columns)),
        "series_rows": np.array([len(s) for s in series]),
        "series": np.concatenate([s.to_numpy(dtype=np.float64) for s in series]),
    }


def reforecast(forecast: Forecast, log: pd.DataFrame, fraction: float) -> list[float]:
    """Energy of the whole trip after a fraction of its time, in the order of `UPDATES` [Wh].

    Parameters
    ----------
    forecast : Forecast
        Before departure.
    log : DataFrame
        From `measured_log`; rows after the cut are not looked at, except that the gauge knows the whole distance.
    fraction : float

    Returns
    -------
    list of float
        NaN where a measurement is missing. The gauge of a car that has not moved yet shows the departure forecast.
    """
    planned_series = forecast.series()
    cut = fraction * float(planned_series["time_s"].iloc[-1])
    so_far = log[log["time_s"] <= cut]
    if len(so_far) < 2:
        same = forecast.energy_wh
        return [same, float("nan"), same, same, *forecast.interval(UPDATE_LEVEL)]
    last = so_far.iloc[-1]
    measured = ["time_s", "observed_energy_wh", *(c for c in TOLD_BY if c in so_far)]
    updated = forecast.update_since_departure(so_far[measured])
    low, high = updated.interval(UPDATE_LEVEL)
    charge = [c for c in CHARGE_COLUMNS if c in so_far and so_far[c].notna().any()]
    by_charge = (
        forecast.update_since_departure(so_far[["time_s", *charge]]).energy_wh if charge else float("nan")
    )
    then = float(np.interp(last["time_s"], planned_series["time_s"], planned_series["energy_wh"]))
    metres, whole = float(last["distance_m"]), float(planned_series["distance_m"].iloc[-1])
    gauge = float(last["observed_energy_wh"]) * whole / metres if metres > 0.0 else forecast.energy_wh
    found = {
        "update": updated.energy_wh,
        "soc_only": by_charge,
        "no_update": float(last["observed_energy_wh"]) + forecast.energy_wh - then,
        "naive_gauge": gauge,
        "update_low": low,
        "update_high": high,
    }
    return [found[name] for name in UPDATES]
