"""The forecast protocol from trips to `results.json`: prepare, run the folds, score."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from importlib.metadata import version
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.auditing import Audit
from tripwatt.evaluation.forecast_run import CURVE_DRAWS, CURVE_MODELS
from tripwatt.evaluation.forecast_scores import (
    FRACTIONS,
    LEVELS,
    UPDATES,
    ForecastInsight,
    coverage_scores,
    crps,
    crps_scores,
    strata_of,
    strata_scores,
    symmetric_quantiles,
    update_scores,
)
from tripwatt.evaluation.forecast_sets import TRAINING_ONLY, ForecastSet
from tripwatt.evaluation.metrics import absolute_percentage_error, bootstrap_interval
from tripwatt.evaluation.protocols import ModelSpec
from tripwatt.evaluation.results import (
    FOLD_COLUMNS,
    VERSIONED,
    Evaluation,
    EvaluationRun,
    FoldResult,
    paired_summary,
    summary_of,
)
from tripwatt.hybrid import IntArray
from tripwatt.trips import Fleet, FloatArray
from tripwatt.vehicles import Vehicle

CURVE: Final = "learning-curve"
PER_TRIP: Final = ("sd", "low", "high", "factors", "pit", "flags", "causes", "updates")
"""Arrays of a fold of `hybrid` with one row per trip."""


def assemble_forecast(
    evaluations: Sequence[Evaluation],
    sets: Sequence[ForecastSet],
    fold_results: Sequence[FoldResult],
    *,
    specs: Sequence[ModelSpec],
    fleet: Fleet,
    test_fleet: Fleet | None,
    audited: Audit,
    seed: int,
    vehicle: Vehicle,
    notes: Sequence[str],
) -> EvaluationRun:
    """Score the held-out forecasts and put everything in the contract's shape."""
    frames = [_fold_frame(i, e, fold_results, specs) for i, e in enumerate(evaluations)]
    summaries = []
    for i, evaluation in enumerate(evaluations):
        own = [r for r in fold_results if r.evaluation == i and r.model != CURVE]
        summary = summary_of(evaluation, frames[i], own, specs, seed)
        summary["n_trips"] = len(_scored(evaluation))
        _add_crps_of_points(summary["models"], frames[i])
        if "hybrid" in summary["models"]:
            summary["models"]["hybrid"] |= _hybrid_scores(evaluation, own, frames[i], seed)
        summaries.append(summary)
    shown = test_fleet or fleet
    main = _scored(evaluations[0])
    about = _about_trips(sets[0], main)
    results: dict[str, Any] = {
        "protocol": "forecast",
        "dataset": shown.name,
        "fitted_on": fleet.name,
        "synthetic": shown.name == "synthetic",
        "citation": shown.citation,
        "seed": seed,
        "versions": {"python": platform.python_version()} | {name: version(name) for name in VERSIONED},
        "vehicle": vehicle.name,
        "notes": list(dict.fromkeys(notes)),
        "models": {spec.name: spec.title for spec in specs},
        "trips_read": [t.trip_id for t in shown.trips],
        "trips_used": {e.trips: [e.table.trip_ids[i] for i in _scored(e)] for e in evaluations},
        "audit": [asdict(finding) for finding in audited.findings],
        "evaluations": summaries,
        "paired": paired_summary(evaluations[0], frames[0], specs, seed),
        "learning_curve": _learning_curve([r for r in fold_results if r.model == CURVE], seed),
        "strata": _strata(about, frames[0], seed),
    }
    kept = _insight(evaluations[0], sets[0], [r for r in fold_results if r.evaluation == 0], frames[0])
    return EvaluationRun(
        results=results,
        folds=pd.concat(frames, ignore_index=True),
        series={} if kept is None else _measured_beside(kept),
        signals=pd.DataFrame(),
        forecast=kept,
    )


def _scored(evaluation: Evaluation) -> IntArray:
    return np.flatnonzero(evaluation.folds != TRAINING_ONLY)


def _fold_frame(
    index: int, evaluation: Evaluation, results: Sequence[FoldResult], specs: Sequence[ModelSpec]
) -> pd.DataFrame:
    table, scored = evaluation.table, _scored(evaluation)
    last = table.last_rows[scored]
    observed, simulated = table.observed_wh[last], table.simulated_wh["physics"][last]
    frames = []
    for spec in specs:
        predicted = _by_trip(
            evaluation, [r for r in results if (r.evaluation, r.model) == (index, spec.name)]
        )
        start = np.zeros(len(last)) if spec.name in WITHOUT_PHYSICS else simulated
        columns = {
            "scheme": evaluation.scheme,
            "trips": evaluation.trips,
            "trip": [table.trip_ids[i] for i in scored],
            "model": spec.name,
            "observed_energy_wh": observed,
            "simulated_energy_wh": start,
            "correction_wh": predicted - start,
            "predicted_energy_wh": predicted,
            "ape": absolute_percentage_error(observed, predicted),
        }
        frames.append(pd.DataFrame(columns, columns=list(FOLD_COLUMNS)))
    return pd.concat(frames, ignore_index=True)


WITHOUT_PHYSICS: Final = frozenset({"constant", "linear4", "linear6", "boosting-only"})


def _by_trip(evaluation: Evaluation, results: Sequence[FoldResult], name: str | None = None) -> FloatArray:
    """An array of the folds in the order of the scored trips; the predicted energy when no name is given."""
    whole: FloatArray | None = None
    for result in results:
        values = result.predicted_wh if name is None else np.asarray(result.extra[name], dtype=np.float64)
        if whole is None:
            whole = np.full((len(evaluation.table), *values.shape[1:]), np.nan)
        whole[evaluation.folds == result.fold] = values
    assert whole is not None
    return whole[_scored(evaluation)]


def _add_crps_of_points(models: dict[str, Any], frame: pd.DataFrame) -> None:
    """The CRPS of a forecast that names one number is its mean absolute error."""
    for name, score in models.items():
        part = frame[frame["model"] == name]
        score["crps_wh"] = float((part["predicted_energy_wh"] - part["observed_energy_wh"]).abs().mean())


def _hybrid_scores(
    evaluation: Evaluation, results: Sequence[FoldResult], frame: pd.DataFrame, seed: int
) -> dict[str, Any]:
    own = [r for r in results if r.model == "hybrid"]
    part = frame[frame["model"] == "hybrid"]
    observed, centre = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
    found = {name: _by_trip(evaluation, own, name) for name in PER_TRIP}
    return {
        **coverage_scores(observed, found["low"], found["high"], seed),
        **crps_scores(observed, centre, found["sd"], found["factors"]),
        "update": update_scores(observed, found["updates"], seed),
    }


def _insight(
    evaluation: Evaluation, prepared: ForecastSet, results: Sequence[FoldResult], frame: pd.DataFrame
) -> ForecastInsight | None:
    own = sorted((r for r in results if r.model == "hybrid"), key=lambda r: r.fold)
    if not own:
        return None
    scored = _scored(evaluation)
    part = frame[frame["model"] == "hybrid"]
    found = {name: _by_trip(evaluation, own, name) for name in PER_TRIP}
    observed, centre = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
    columns: dict[str, Any] = {
        "trip": part["trip"].to_numpy(),
        "observed_energy_wh": observed,
        "energy_wh": centre,
        "sd_wh": found["sd"],
        "pit": found["pit"],
        "crps_wh": crps(observed, symmetric_quantiles(centre, found["factors"] * found["sd"][:, None])),
        "flags": found["flags"].astype(int),
    }
    for j, level in enumerate(LEVELS):
        columns[f"low_{100 * level:g}"] = found["low"][:, j]
        columns[f"high_{100 * level:g}"] = found["high"][:, j]
    for j, fraction in enumerate(FRACTIONS):
        for k, name in enumerate(UPDATES):
            columns[f"{name}_{100 * fraction:g}"] = found["updates"][:, j, k]
    about = _about_trips(prepared, scored).drop(columns="trip")
    trips = pd.concat([pd.DataFrame(columns), about], axis=1)
    names = [evaluation.table.trip_ids[i] for i in scored]
    causes = pd.DataFrame(found["causes"], index=names, columns=own[0].extra["cause_names"].tolist())
    logs = {evaluation.table.trip_ids[i]: prepared.logs[i] for i in scored}
    return ForecastInsight(trips, causes, _series(evaluation, own), logs)


def _series(evaluation: Evaluation, results: Sequence[FoldResult]) -> dict[str, pd.DataFrame]:
    """`Forecast.series` of each trip."""
    found = {}
    for result in results:
        ends = np.cumsum(result.extra["series_rows"])
        pieces = np.split(result.extra["series"], ends[:-1])
        for trip, piece in zip(np.flatnonzero(evaluation.folds == result.fold), pieces, strict=True):
            columns = result.extra["series_names"].tolist()
            found[evaluation.table.trip_ids[trip]] = pd.DataFrame(piece, columns=columns)
    return found


def _measured_beside(kept: ForecastInsight) -> dict[str, pd.DataFrame]:
    """The forecast along each trip beside the measured energy, at the ends of the blocks."""
    frames = {}
    for trip, series in kept.series.items():
        log = kept.logs[trip]
        time = series["time_s"].to_numpy()
        distance = series["distance_m"].to_numpy()
        speed = np.diff(distance, append=distance[-1]) / np.diff(time, append=time[-1] + 1.0)
        frames[trip] = pd.DataFrame(
            {
                "time_s": time,
                "speed_m_s": speed,
                "observed_energy_wh": np.interp(time, log["time_s"], log["observed_energy_wh"]),
                "hybrid": series["energy_wh"].to_numpy(),
            }
        )
    return frames


def _known(value: float | None) -> float:
    return float("nan") if value is None else value


def _about_trips(prepared: ForecastSet, members: Sequence[int] | npt.NDArray[np.int64]) -> pd.DataFrame:
    """What strata divide by, known at departure, one row per trip."""
    rows = []
    for i in members:
        plan, context = prepared.plans[i], prepared.table.trips[i].context
        height = plan.array("elevation_m") if "elevation_m" in plan else np.array([np.nan])
        rows.append(
            {
                "trip": plan.trip_id,
                "duration_s": plan.duration_s,
                "distance_m": plan.distance_m,
                "net_climb_m": float(height[-1] - height[0]),
                "ambient_temperature_degc": _known(plan.departure.ambient_temperature_degc),
                "battery_temperature_degc": _known(plan.departure.battery_temperature_degc),
                "driver": context.driver,
            }
        )
    return pd.DataFrame(rows)


def _strata(about: pd.DataFrame, frame: pd.DataFrame, seed: int) -> list[dict[str, Any]]:
    ape = {str(name): part["ape"].to_numpy() for name, part in frame.groupby("model")}
    if "hybrid" not in ape:
        return []
    return strata_scores(strata_of(about), ape["hybrid"], ape.get("boosting-only"), seed)


def _learning_curve(results: Sequence[FoldResult], seed: int) -> list[dict[str, Any]]:
    """Mean APE by number of training trips: the mean over draws, and over the trips that no draw was trained on."""
    rows = []
    by_size: Mapping[int, list[FoldResult]] = {
        size: [r for r in results if int(r.extra["size"]) == size]
        for size in sorted({int(r.extra["size"]) for r in results})
    }
    for size, draws in by_size.items():
        draws = sorted(draws, key=lambda r: int(r.extra["draw"]))
        means = {m: np.array([float(np.mean(r.extra[m])) for r in draws]) for m in CURVE_MODELS}
        row: dict[str, Any] = {"n_trips": size, "draws": len(draws)}
        for model, values in means.items():
            row[model] = float(values.mean())
            row[f"{model}_by_draw"] = values.tolist()
        difference = means["hybrid"] - means["boosting-only"]
        row["diff"] = float(difference.mean())
        row["diff_ci95"] = bootstrap_interval(difference, seed) if len(draws) == CURVE_DRAWS else None
        rows.append(row)
    return rows


def alike(results: Sequence[FoldResult], index: int, first: int) -> list[FoldResult]:
    """Results of an evaluation under the number of another with the same trips and folds."""
    return [replace(r, evaluation=index) for r in results if r.evaluation == first and r.model != CURVE]
