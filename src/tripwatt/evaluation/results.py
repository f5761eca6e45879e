"""What an evaluation found, as one object and as the files `results.json` and `folds.csv`.

`results.json` is a contract; its keys are listed in `docs/explanation/evaluation.md`.
"""

from __future__ import annotations

import itertools
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.evaluation.forecast_scores import ForecastInsight
from tripwatt.evaluation.hold_outs import HoldOut
from tripwatt.evaluation.metrics import absolute_percentage_error, paired_difference, summarise_errors
from tripwatt.evaluation.protocol import FoldResult, ModelSpec, Prepared
from tripwatt.paper.insight import GammInsight

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
PHYSICS_ALONE: Final = ("physics-paper", "physics")
"""Models of a simulation alone, over which the share of improved trips is counted."""
SYNTHETIC: Final = "synthetic"
"""Name of the built-in fleet."""
VERSIONED: Final = ("tripwatt", "numpy", "scipy", "pandas", "scikit-learn", "lightgbm")


@dataclass(frozen=True, eq=False, repr=False)
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

    Examples
    --------
    >>> import tripwatt as tw
    >>> from tripwatt.evaluation import Execution
    >>> run = tw.evaluate(tw.synthetic_fleet(6), protocol="paper", models=["constant"], execution=Execution(n_jobs=1))
    >>> run.folds["model"].unique().tolist(), len(run.series)
    (['constant'], 6)
    """

    results: dict[str, Any]
    folds: pd.DataFrame
    series: Mapping[str, pd.DataFrame]
    signals: pd.DataFrame
    learning_curves: pd.DataFrame | None = None
    importances: pd.DataFrame | None = None
    gamm: GammInsight | None = None
    forecast: ForecastInsight | None = None

    def __repr__(self) -> str:
        protocol, models, read = (self.results[key] for key in ("protocol", "models", "trips_read"))
        return f"<EvaluationRun protocol {protocol}, {len(models)} models, {len(read)} trips read>"


def about_run(protocol: str, prepared: Prepared, specs: Sequence[ModelSpec], seed: int) -> dict[str, Any]:
    """The part of `results.json` about what was evaluated."""
    shown = prepared.scored_fleet
    return {
        "protocol": protocol,
        "dataset": shown.name,
        "synthetic": shown.name == SYNTHETIC,
        "citation": shown.citation,
        "seed": seed,
        "versions": {"python": platform.python_version()} | {name: version(name) for name in VERSIONED},
        "vehicle": next(iter(prepared.cars.values())).name,
        "notes": list(dict.fromkeys(prepared.notes)),
        "models": {spec.name: spec.title for spec in specs},
        "trips_read": [t.trip_id for t in shown.trips],
        "trips_used": {h.trips: [h.table.trip_ids[i] for i in h.scored] for h in prepared.hold_outs},
        "audit": [asdict(finding) for finding in prepared.audited.findings],
    }


def fold_frame(
    hold_out: HoldOut, predicted_wh: Mapping[str, FloatArray], specs: Sequence[ModelSpec]
) -> pd.DataFrame:
    """`FOLD_COLUMNS` of every model: one row for each scored trip.

    Parameters
    ----------
    hold_out : HoldOut
    predicted_wh : mapping of str to ndarray, shape (scored trips,)
        Energy of each trip by model [Wh].
    specs : sequence of ModelSpec
    """
    table, scored = hold_out.table, hold_out.scored
    last = table.last_rows[scored]
    observed = table.observed_wh[last]
    frames = []
    for spec in specs:
        predicted, simulated = predicted_wh[spec.name], table.simulated(spec.simulation)[last]
        columns = {
            "scheme": hold_out.scheme,
            "trips": hold_out.trips,
            "trip": [table.trip_ids[i] for i in scored],
            "model": spec.name,
            "observed_energy_wh": observed,
            "simulated_energy_wh": simulated,
            "correction_wh": predicted - simulated,
            "predicted_energy_wh": predicted,
            "ape": absolute_percentage_error(observed, predicted),
        }
        frames.append(pd.DataFrame(columns, columns=list(FOLD_COLUMNS)))
    return pd.concat(frames, ignore_index=True)


def summary_of(
    hold_out: HoldOut,
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
                for base in PHYSICS_ALONE
                if base in ape and base != spec.name
            },
            "fit_s": float(np.median([r.fit_s for r in own])),
            "predict_ms": float(np.median([r.predict_ms for r in own])),
        }
    return {
        "scheme": hold_out.scheme,
        "trips": hold_out.trips,
        "n_trips": len(hold_out.scored),
        "models": models,
    }


def paired_summary(
    hold_out: HoldOut, frame: pd.DataFrame, specs: Sequence[ModelSpec], seed: int
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
                "scheme": hold_out.scheme,
                "trips": hold_out.trips,
            }
        )
    return pairs


def write_results(run: EvaluationRun, out: Path) -> None:
    """Write `results.json`, `folds.csv` and, where there are forecasts, `forecasts.csv` into the folder `out`.

    Parameters
    ----------
    run : EvaluationRun
        As `evaluate` returns it.
    out : Path
        Folder, made where it is missing; files of an earlier run are replaced.

    Examples
    --------
    >>> import tempfile
    >>> import tripwatt as tw
    >>> from tripwatt.evaluation import Execution
    >>> run = tw.evaluate(tw.synthetic_fleet(6), protocol="paper", models=["constant"], execution=Execution(n_jobs=1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_results(run, Path(folder))
    ...     print(sorted(file.name for file in Path(folder).iterdir()))
    ['folds.csv', 'results.json']
    """
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
