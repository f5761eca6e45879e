"""What an evaluation found, as one object and as the files `results.json` and `folds.csv`.

`results.json` is a contract; its keys are listed in `docs/evaluation.md`.
"""

from __future__ import annotations

import itertools
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.auditing import Audit
from tripwatt.evaluation.forecast_scores import ForecastInsight
from tripwatt.evaluation.insight import GammInsight, insight
from tripwatt.evaluation.metrics import absolute_percentage_error, paired_difference, summarise_errors
from tripwatt.evaluation.protocols import ModelSpec
from tripwatt.hybrid import IntArray, TripTable
from tripwatt.physics import simulate_trip
from tripwatt.trips import Fleet, FloatArray, Trip
from tripwatt.vehicles import Vehicle

FOLD_COLUMNS: Final = (
    "scheme",
    "trips",
    "trip",
    "model",
    "observed_energy_wh",
    "simulated_energy_wh",
    "correction_wh",
    "predicted_energy_wh",
    "ape",
)
VERSIONED: Final = ("tripwatt", "numpy", "scipy", "pandas", "scikit-learn", "lightgbm")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One way to hold trips out: the scheme, the set of trips, and the fold of each trip.

    Attributes
    ----------
    scheme : {"leave_one_trip_out", "leave_one_day_out"}
    trips : {"reference", "audited", "all"}
    table : TripTable
    folds : ndarray of int, shape (trips,)
    """

    scheme: str
    trips: str
    table: TripTable
    folds: IntArray


@dataclass(frozen=True, eq=False)
class FoldResult:
    """Held-out predictions of one fold: cumulative energy at every row of its trips [Wh]."""

    evaluation: int
    model: str
    fold: int
    predicted_wh: FloatArray
    fit_s: float
    predict_ms: float
    extra: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    """What a protocol keeps beside the prediction, by name."""


@dataclass(frozen=True, eq=False)
class EvaluationRun:
    """Everything that the report shows.

    Attributes
    ----------
    results : dict
        The content of `results.json`.
    folds : DataFrame
        The content of `folds.csv`: one row per evaluation, trip and model.
    series : mapping of str to DataFrame
        Trip -> `time_s, speed_m_s, observed_energy_wh` and the held-out cumulative prediction of every model, of the
        first evaluation.
    signals : DataFrame
        RMSE of simulated against measured battery signals, one row per trip of the first evaluation.
    learning_curves : DataFrame or None
        `model, fold, rounds, error` of the boosting models, fitted on all trips of the first evaluation.
    importances : DataFrame or None
        `model, covariate, importance`, likewise.
    gamm : GammInsight or None
        Summary, diagnosis and effects of the GAMM, likewise; None where it was not among the models.
    forecast : ForecastInsight or None
        Held-out forecasts of the first evaluation; None in a protocol without them.
    """

    results: dict[str, Any]
    folds: pd.DataFrame
    series: Mapping[str, pd.DataFrame]
    signals: pd.DataFrame
    learning_curves: pd.DataFrame | None = None
    importances: pd.DataFrame | None = None
    gamm: GammInsight | None = None
    forecast: ForecastInsight | None = None


def assemble(
    evaluations: Sequence[Evaluation],
    fold_results: Sequence[FoldResult],
    *,
    specs: Sequence[ModelSpec],
    fleet: Fleet,
    audited: Audit,
    protocol: str,
    seed: int,
    physics: Mapping[str, Vehicle],
    notes: Sequence[str],
) -> EvaluationRun:
    """Score the held-out predictions and put everything in the contract's shape."""
    predictions = _predictions(evaluations, fold_results, specs)
    frames = [_fold_frame(e, predictions[i], specs, seed) for i, e in enumerate(evaluations)]
    summaries = [
        summary_of(e, frames[i], [r for r in fold_results if r.evaluation == i], specs, seed)
        for i, e in enumerate(evaluations)
    ]
    known = sorted({t.context.weather for t in fleet.trips if t.context.weather is not None})
    inside = insight(evaluations[0].table, specs, seed, weathers=known)
    results: dict[str, Any] = {
        "protocol": protocol,
        "dataset": fleet.name,
        "synthetic": fleet.name == "synthetic",
        "citation": fleet.citation,
        "seed": seed,
        "versions": {"python": platform.python_version()} | {name: version(name) for name in VERSIONED},
        "vehicle": next(iter(physics.values())).name,
        "notes": list(dict.fromkeys(notes)),
        "models": {spec.name: spec.title for spec in specs},
        "trips_read": [t.trip_id for t in fleet.trips],
        "trips_used": {e.trips: list(e.table.trip_ids) for e in evaluations},
        "audit": [asdict(finding) for finding in audited.findings],
        "evaluations": summaries,
        "paired": paired_summary(evaluations[0], frames[0], specs, seed),
    }
    return EvaluationRun(
        results=results,
        folds=pd.concat(frames, ignore_index=True),
        series=_series(evaluations[0].table, predictions[0]),
        signals=_signals(evaluations[0].table.trips, physics["physics"]),
        learning_curves=inside.learning_curves,
        importances=inside.importances,
        gamm=inside.gamm,
    )


def _predictions(
    evaluations: Sequence[Evaluation], fold_results: Sequence[FoldResult], specs: Sequence[ModelSpec]
) -> list[dict[str, FloatArray]]:
    predictions = [
        {spec.name: np.full(len(e.table.observed_wh), np.nan) for spec in specs} for e in evaluations
    ]
    for result in fold_results:
        evaluation = evaluations[result.evaluation]
        rows = evaluation.table.rows_of(np.flatnonzero(evaluation.folds == result.fold))
        predictions[result.evaluation][result.model][rows] = result.predicted_wh
    return predictions


def _fold_frame(
    evaluation: Evaluation, predictions: Mapping[str, FloatArray], specs: Sequence[ModelSpec], seed: int
) -> pd.DataFrame:
    table, last = evaluation.table, evaluation.table.last_rows
    observed = table.observed_wh[last]
    frames = []
    for spec in specs:
        model = spec.build(seed)
        predicted = predictions[spec.name][last]
        simulated = (
            np.zeros(len(last)) if model.simulation is None else table.simulated_wh[model.simulation][last]
        )
        frames.append(
            pd.DataFrame(
                {
                    "scheme": evaluation.scheme,
                    "trips": evaluation.trips,
                    "trip": table.trip_ids,
                    "model": spec.name,
                    "observed_energy_wh": observed,
                    "simulated_energy_wh": simulated,
                    "correction_wh": predicted - simulated,
                    "predicted_energy_wh": predicted,
                    "ape": absolute_percentage_error(observed, predicted),
                },
                columns=list(FOLD_COLUMNS),
            )
        )
    return pd.concat(frames, ignore_index=True)


def summary_of(
    evaluation: Evaluation,
    frame: pd.DataFrame,
    results: Sequence[FoldResult],
    specs: Sequence[ModelSpec],
    seed: int,
) -> dict[str, Any]:
    """Errors of every model in one evaluation."""
    ape = {name: part["ape"].to_numpy() for name, part in frame.groupby("model")}
    models: dict[str, Any] = {}
    for spec in specs:
        part = frame[frame["model"] == spec.name]
        observed, predicted = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
        own = [r for r in results if r.model == spec.name]
        models[spec.name] = asdict(summarise_errors(observed, predicted, seed)) | {
            "improved_share": {
                base: float(np.mean(ape[spec.name] < ape[base]))
                for base in ("physics-paper", "physics")
                if base in ape and base != spec.name
            },
            "fit_s": float(np.median([r.fit_s for r in own])),
            "predict_ms": float(np.median([r.predict_ms for r in own])),
        }
    return {
        "scheme": evaluation.scheme,
        "trips": evaluation.trips,
        "n_trips": len(evaluation.table),
        "models": models,
    }


def paired_summary(
    evaluation: Evaluation, frame: pd.DataFrame, specs: Sequence[ModelSpec], seed: int
) -> list[dict[str, Any]]:
    """Every pair of models over the trips of one evaluation."""
    ape = {name: part["ape"].to_numpy() for name, part in frame.groupby("model")}
    pairs = []
    for a, b in itertools.combinations((spec.name for spec in specs), 2):
        difference = paired_difference(ape[a], ape[b], seed)
        pairs.append(
            {
                "a": a,
                "b": b,
                "diff": difference.diff,
                "ci95": difference.ci95,
                "significant": difference.significant,
                "scheme": evaluation.scheme,
                "trips": evaluation.trips,
            }
        )
    return pairs


def _series(table: TripTable, predictions: Mapping[str, FloatArray]) -> dict[str, pd.DataFrame]:
    frames = {}
    for i, trip in enumerate(table.trips):
        rows = slice(int(table.offsets[i]), int(table.offsets[i + 1]))
        frames[trip.trip_id] = pd.DataFrame(
            {
                "time_s": trip.array("time_s"),
                "speed_m_s": trip.array("speed_m_s"),
                "observed_energy_wh": table.observed_wh[rows],
            }
            | {name: values[rows] for name, values in predictions.items()}
        )
    return frames


def _signals(trips: Sequence[Trip], vehicle: Vehicle) -> pd.DataFrame:
    """RMSE of the simulated battery signals, default preset; NaN where a trip lacks the measurement."""
    pairs = {
        "current_rmse_a": ("current_a", "battery_current_a"),
        "voltage_rmse_v": ("voltage_v", "terminal_voltage_v"),
        "battery_temperature_rmse_degc": ("battery_temperature_degc", "battery_temperature_degc"),
        "soc_rmse": ("soc", "soc"),
    }
    rows = []
    for trip in trips:
        simulation = simulate_trip(vehicle, trip)
        row: dict[str, Any] = {"trip": trip.trip_id}
        for name, (measured, simulated) in pairs.items():
            error = (trip.array(measured) if measured in trip else np.nan) - getattr(simulation, simulated)
            known = error[np.isfinite(error)]
            row[name] = float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")
        rows.append(row)
    return pd.DataFrame(rows)


def write_results(run: EvaluationRun, out: Path) -> None:
    """Write `results.json`, `folds.csv` and, where there are forecasts, `forecasts.csv` into the folder `out`."""
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(run.results, indent=1, allow_nan=False, default=_plain)
    (out / "results.json").write_text(text + "\n", encoding="utf-8")
    run.folds.to_csv(out / "folds.csv", index=False)
    if run.forecast is not None:
        run.forecast.trips.to_csv(out / "forecasts.csv", index=False)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"results hold a {type(value).__name__}")
