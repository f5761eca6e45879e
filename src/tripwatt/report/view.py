"""One evaluation run as the report reads it: what is missing is empty, never an error, and never invented."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeGuard

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.evaluation import DEFAULT_PROTOCOL, PROTOCOLS, EvaluationProtocol
from tripwatt.evaluation.comparison import FOLD_COLUMNS
from tripwatt.evaluation.forecast_scores import ForecastInsight
from tripwatt.files import shipped_toml
from tripwatt.paper.insight import GammInsight
from tripwatt.report.model_styles import model_style, ordered

Record = Mapping[str, Any]

_EVALUATIONS: Final = shipped_toml("report/evaluations.toml")
SCHEMES: Final = _EVALUATIONS["schemes"]
TESTED: Final = _EVALUATIONS["tested"]
"""Schemes as sentences for those who read of a hold-out for the first time."""
TRIP_SETS: Final = _EVALUATIONS["trip_sets"]


def plain(text: object, longest: int = 48) -> str:
    """A name as one printable line: control characters become a visible mark, a long one is cut in the middle.

    Examples
    --------
    >>> plain("a" * 60, 9)
    'aaaa…aaaa'
    """
    line = "".join("�" if unicodedata.category(c) in ("Cc", "Cs", "Cn", "Co") else c for c in str(text))
    if len(line) <= longest:
        return line
    half = (longest - 1) // 2
    return f"{line[:half]}…{line[-half:]}"


def natural_key(name: object) -> tuple[tuple[int, int, str], ...]:
    """Sort key under which `B2` comes before `B10`.

    Examples
    --------
    >>> sorted(["B10", "B2", "A1"], key=natural_key)
    ['A1', 'B2', 'B10']
    """
    parts = re.findall(r"[0-9]+|[^0-9]", str(name))
    return (*((0, int(part), "") if part[0] in "0123456789" else (1, 0, part) for part in parts), (1, 0, ""))


def of_evaluation(evaluation: Record) -> str:
    """Scheme and trip set of an evaluation in words.

    Examples
    --------
    >>> of_evaluation({"scheme": "leave_one_trip_out", "trips": "reference", "n_trips": 58})
    'leave one trip out, 58 reference trips'
    >>> of_evaluation({"scheme": "leave_regime_out", "trips": "longer third", "n_trips": 19})
    'trips of another kind, longer third (19 trips)'
    """
    scheme, trips = str(evaluation.get("scheme", "")), str(evaluation.get("trips", ""))
    words = TRIP_SETS.get(trips, trips)
    number = evaluation.get("n_trips")
    if number is None:
        counted = words
    elif trips == "all":
        counted = f"all {number} trips, unaudited"
    elif trips in TRIP_SETS:
        counted = f"{number} {words}"
    else:
        counted = f"{words} ({number} trips)"
    return f"{SCHEMES.get(scheme, scheme.replace('_', ' '))}, {counted}"


SAME: Final = "same_as"
"""Key of an evaluation of `View.evaluations` under which those stand that have identical scores."""


def named_evaluation(evaluation: Record) -> str:
    """`of_evaluation`, with the names of the evaluations that coincide with it.

    Examples
    --------
    >>> one = {"scheme": "leave_one_trip_out", "trips": "audited", "n_trips": 9}
    >>> named_evaluation({**one, "same_as": [{**one, "trips": "all"}]})
    'leave one trip out, 9 trips the audit keeps (identical: all 9 trips, unaudited)'
    """
    own = of_evaluation(evaluation)
    others = []
    for other in evaluation.get(SAME) or ():
        scheme, _, trips = of_evaluation(other).partition(", ")
        others.append(trips if own.startswith(f"{scheme}, ") else f"{scheme}, {trips}")
    return f"{own} (identical: {'; '.join(others)})" if others else own


def without_repeats(evaluations: Sequence[Record]) -> list[Record]:
    """The evaluations with those that coincide in every score as one, the first of them.

    Wall times are no score. Two sets of trips give the same scores of every model only where the trips, and the folds,
    are the same.
    """
    kept: dict[str, dict[str, Any]] = {}
    for place, evaluation in enumerate(evaluations):
        models = evaluation.get("models") or {}
        scores = {m: {k: v for k, v in s.items() if k not in _TIMES} for m, s in models.items()}
        key = json.dumps([evaluation.get("n_trips"), scores], sort_keys=True) if models else str(place)
        if key in kept:
            kept[key].setdefault(SAME, []).append(evaluation)
        else:
            kept[key] = dict(evaluation)
    return list(kept.values())


_TIMES: Final = ("fit_s", "predict_ms")


def signed_errors(folds: pd.DataFrame, model: str) -> FloatArray:
    """(predicted - observed) / observed of a model, one finite value per trip, in the order of `folds`."""
    rows = folds[folds["model"] == model]
    observed = rows["observed_energy_wh"].to_numpy(dtype=np.float64)
    errors = (rows["predicted_energy_wh"].to_numpy(dtype=np.float64) - observed) / observed
    return np.asarray(errors[np.isfinite(errors)], dtype=np.float64)


def absolute_errors(folds: pd.DataFrame) -> pd.DataFrame:
    """APE by trip (rows) and model (columns, in table order)."""
    wide = folds.pivot_table(index="trip", columns="model", values="ape", aggfunc="mean", observed=True)
    wide = wide[ordered(map(str, wide.columns))]
    return wide.loc[sorted(wide.index, key=natural_key)]


def _frame(run: object, name: str) -> pd.DataFrame | None:
    frame = getattr(run, name, None)
    return frame if isinstance(frame, pd.DataFrame) and len(frame) else None


@dataclass(frozen=True)
class View:
    """A run as the report reads it, made by `View.from_run`.

    Attributes
    ----------
    results : mapping
        The contract of `results.json`.
    folds : DataFrame
        One row per scheme, trip set, trip and model; possibly empty.
    series : mapping of str to DataFrame
        Held-out predictions of the main evaluation along each trip; possibly empty.
    signals, learning_curves, importances : DataFrame or None
    gamm : GammInsight or None
    forecast : ForecastInsight or None
    """

    results: Record
    folds: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=list(FOLD_COLUMNS)))
    series: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    signals: pd.DataFrame | None = None
    learning_curves: pd.DataFrame | None = None
    importances: pd.DataFrame | None = None
    gamm: GammInsight | None = None
    forecast: ForecastInsight | None = None

    @classmethod
    def from_run(cls, run: object) -> View:
        """Read a run, whatever optional part it lacks."""
        folds = _frame(run, "folds")
        series = getattr(run, "series", None) or {}
        return cls(
            results=getattr(run, "results", None) or {},
            folds=folds if folds is not None else pd.DataFrame(columns=list(FOLD_COLUMNS)),
            series={str(trip): frame for trip, frame in dict(series).items()},
            signals=_frame(run, "signals"),
            learning_curves=_frame(run, "learning_curves"),
            importances=_frame(run, "importances"),
            gamm=getattr(run, "gamm", None),
            forecast=getattr(run, "forecast", None),
        )

    @property
    def dataset(self) -> str:
        """Name of the data set, empty when unknown."""
        return str(self.results.get("dataset") or "")

    @property
    def synthetic(self) -> bool:
        """Whether the trips are made up; every table and figure is then marked."""
        return bool(self.results.get("synthetic")) or "synthetic" in self.dataset.lower()

    @property
    def protocol(self) -> EvaluationProtocol:
        """The protocol of the run; results that name none that exists are read as those of the default one."""
        name = str(self.results.get("protocol") or DEFAULT_PROTOCOL)
        return PROTOCOLS.get(name, PROTOCOLS[DEFAULT_PROTOCOL])

    @property
    def published(self) -> Mapping[str, float]:
        """The paper's mean errors where they may stand beside ours: on the TUM trips only."""
        return self.protocol.published if self.dataset.lower().startswith("tum") else {}

    @property
    def published_physics(self) -> str | None:
        """The simulation among the models whose errors the paper of this protocol reports."""
        return next((m for m in self.protocol.published if model_style(m).kind == "physics"), None)

    @property
    def evaluations(self) -> Sequence[Record]:
        """Every evaluation, the main one first; those that coincide are one (see `named_evaluation`)."""
        runs = list(self.results.get("evaluations") or ())
        sets, schemes = list(TRIP_SETS), list(SCHEMES)

        def rank(evaluation: Record) -> list[int]:
            places = (schemes, evaluation.get("scheme")), (sets, evaluation.get("trips"))
            return [known.index(name) if name in known else len(known) for known, name in places]

        return without_repeats(sorted(runs, key=rank))

    @property
    def main(self) -> Record:
        """The evaluation that figures show: leave-one-trip-out on the reference trips where there are any."""
        evaluations = self.evaluations
        return evaluations[0] if evaluations else {}

    @property
    def scores(self) -> Mapping[str, Record]:
        """Scores of the main evaluation by model."""
        models: Mapping[str, Record] = self.main.get("models") or {}
        return models

    @property
    def models(self) -> list[str]:
        """Models of the main evaluation in table order."""
        return ordered(map(str, self.scores))

    @property
    def best(self) -> str | None:
        """The model that the report describes: the focus of the protocol, whatever its error, where there is one.

        Otherwise the hybrid with the lowest mean error in the main evaluation, or any model when there is no hybrid.
        """
        if self.protocol.focus in self.scores:
            return self.protocol.focus
        errors = {m: float(v["mape"]) for m, v in self.scores.items() if is_known(v.get("mape"))}
        hybrids = {m: e for m, e in errors.items() if model_style(m).kind == "hybrid"}
        pool = hybrids or errors
        return min(ordered(pool), key=lambda m: pool[m]) if pool else None

    @property
    def focus(self) -> Record:
        """Scores of the protocol's focus in the main evaluation, empty without it."""
        return self.scores.get(self.protocol.focus or "") or {}

    @property
    def no_focus(self) -> str:
        """Why a panel about the protocol's focus is empty."""
        return f"The model {self.protocol.focus} was not among the models of this run, so there is nothing to show."

    @property
    def given(self) -> str:
        """Condition of every error of the protocol, empty where there is none."""
        return self.protocol.given

    @property
    def note(self) -> str:
        """Folds and trips of the main evaluation, for the head of a figure."""
        return of_evaluation(self.main)

    @property
    def note_given(self) -> str:
        """`note`, and `given` on a line of its own."""
        return "\n".join(filter(None, [self.note, self.given]))

    @property
    def main_folds(self) -> pd.DataFrame:
        """The folds of the main evaluation."""
        return self.folds_of(self.main)

    @property
    def main_errors(self) -> pd.DataFrame:
        """APE of the main evaluation by trip (rows) and model (columns)."""
        return absolute_errors(self.main_folds)

    def captioned(self, caption: str) -> str:
        """A table's caption, marked where the trips are made up."""
        return f"{caption} (synthetic trips)" if self.synthetic else caption

    @property
    def physics(self) -> str | None:
        """The simulation that hybrids are set against: the paper's preset, else any."""
        names = [m for m in self.models if model_style(m).kind == "physics"]
        return names[0] if names else None

    def folds_of(self, evaluation: Record) -> pd.DataFrame:
        """The folds of one evaluation."""
        folds = self.folds
        for key in ("scheme", "trips"):
            if key in folds.columns and key in evaluation:
                folds = folds[folds[key] == evaluation[key]]
        return folds

    def paired_of(self, evaluation: Record) -> list[Record]:
        """The paired comparisons of one evaluation; one that names no evaluation belongs to the main one."""
        main = self.main
        return [
            pair
            for pair in self.results.get("paired") or ()
            if all(pair.get(key, main.get(key)) == evaluation.get(key) for key in ("scheme", "trips"))
        ]

    def selected_trips(self) -> list[tuple[str, str, float]]:
        """(role, trip, APE) of the best, the median and the worst trip of `best` among the trips with a series."""
        folds = self.main_folds
        rows = folds[(folds["model"] == self.best) & folds["trip"].astype(str).isin(list(self.series))]
        rows = rows.dropna(subset="ape").sort_values("ape", kind="stable")
        if rows.empty:
            return []
        places = {len(rows) - 1: "Worst", (len(rows) - 1) // 2: "Median", 0: "Best"}  # the first role counts
        chosen = ((places[place], rows.iloc[place]) for place in sorted(places))
        return [(role, str(row["trip"]), float(row["ape"])) for role, row in chosen]


def is_known(value: object) -> TypeGuard[float]:
    """Whether a value of the results is a finite number."""
    return isinstance(value, int | float) and bool(np.isfinite(value))
