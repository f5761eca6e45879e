"""The result of an evaluation, as one object and as the files `results.json` and `folds.csv`.

`results.json` is a contract; its keys are listed in `docs/explanation/evaluation.md`.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.evaluation.comparison import Comparison
from tripwatt.evaluation.forecast_scores import ForecastInsight
from tripwatt.evaluation.hold_outs import Prepared
from tripwatt.paper.insight import GammInsight

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


def about_run(protocol: str, prepared: Prepared[Any], main: Comparison, seed: int) -> dict[str, Any]:
    """The part of `results.json` about what was evaluated, and the paired differences in the main comparison."""
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
        "models": {spec.name: spec.title for spec in main.specs},
        "trips_read": [t.trip_id for t in shown.trips],
        "trips_used": {h.trips: [h.table.trip_ids[i] for i in h.scored] for h in prepared.hold_outs},
        "audit": [asdict(finding) for finding in prepared.audited.findings],
        "paired": main.paired(seed),
    }


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
