"""One evaluation run as the report reads it; missing parts are empty."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import pandas as pd

from tripwatt.files import shipped_toml
from tripwatt.study.evaluation import DEFAULT_PROTOCOL, PROTOCOLS, EvaluationProtocol
from tripwatt.study.paper.insight import GammInsight
from tripwatt.study.report.model_styles import in_table_order, model_style

Record = Mapping[str, Any]

_EVALUATIONS: Final = shipped_toml("study/report/evaluations.toml")
SCHEMES: Final = _EVALUATIONS["schemes"]
TESTED: Final = _EVALUATIONS["tested"]
"""Scheme -> a sentence that explains it to readers who do not know hold-outs."""
TRIP_SETS: Final = _EVALUATIONS["trip_sets"]


def printable(text: object, longest: int = 48) -> str:
    """Return a text as one printable line: control characters become a visible mark, a long text is cut in the middle.

    Examples
    --------
    >>> printable("a" * 60, 9)
    'aaaa…aaaa'
    """
    line = "".join("�" if unicodedata.category(c) in ("Cc", "Cs", "Cn", "Co") else c for c in str(text))
    if len(line) <= longest:
        return line
    half = (longest - 1) // 2
    return f"{line[:half]}…{line[-half:]}"


def describe_evaluation(evaluation: Record) -> str:
    """Describe scheme and trip set of an evaluation in words.

    Examples
    --------
    >>> describe_evaluation({"scheme": "leave_one_trip_out", "trips": "reference", "n_trips": 58})
    'leave one trip out, 58 reference trips'
    >>> describe_evaluation({"scheme": "leave_regime_out", "trips": "longer third", "n_trips": 19})
    'trips of another kind, longer third (19 trips)'
    """
    scheme, trips, number = evaluation["scheme"], evaluation["trips"], evaluation["n_trips"]
    if trips == "all":
        counted = f"all {number} trips, unaudited"
    elif trips in TRIP_SETS:
        counted = f"{number} {TRIP_SETS[trips]}"
    else:
        counted = f"{trips} ({number} trips)"
    return f"{SCHEMES.get(scheme, scheme)}, {counted}"


@dataclass(frozen=True)
class View:
    """A run as the report reads it.

    Attributes
    ----------
    results : mapping
        Content of `results.json`.
    folds : DataFrame
        One row per scheme, trip set, trip and model; possibly empty.
    gamm : GammInsight or None
    """

    results: Record
    folds: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=["scheme", "trips", "model"]))
    gamm: GammInsight | None = None

    @property
    def dataset(self) -> str:
        """Name of the data set; empty if unknown."""
        return str(self.results.get("dataset") or "")

    @property
    def synthetic(self) -> bool:
        """Whether the trips are synthetic; if so, every table and figure is marked."""
        return bool(self.results.get("synthetic")) or "synthetic" in self.dataset.lower()

    @property
    def protocol(self) -> EvaluationProtocol:
        """The protocol of the run."""
        return PROTOCOLS[self.results.get("protocol", DEFAULT_PROTOCOL)]

    @property
    def published(self) -> Mapping[str, float]:
        """The paper's mean errors by model; empty for other data than the TUM trips, with which they cannot be compared."""
        return self.protocol.published if self.dataset.lower().startswith("tum") else {}

    @property
    def evaluations(self) -> Sequence[Record]:
        """Every evaluation, the main one first."""
        return self.results.get("evaluations") or ()

    @property
    def main(self) -> Record:
        """The first evaluation, which figures show: leave-one-trip-out on the reference trips if there are any."""
        return self.evaluations[0] if self.evaluations else {}

    @property
    def scores(self) -> Mapping[str, Record]:
        """Scores of the main evaluation by model."""
        return self.main.get("models") or {}

    @property
    def models(self) -> list[str]:
        """Models of the main evaluation in table order."""
        return in_table_order(map(str, self.scores))

    @property
    def best(self) -> str | None:
        """The model that the report describes: the focus of the protocol, whatever its error, if it was evaluated.

        Otherwise the hybrid with the lowest mean error in the main evaluation or, without hybrids, the model with
        the lowest.
        """
        if self.protocol.focus in self.scores:
            return self.protocol.focus
        errors = {m: float(score["mape"]) for m, score in self.scores.items()}
        hybrids = {m: e for m, e in errors.items() if model_style(m).kind == "hybrid"}
        candidates = hybrids or errors
        return min(in_table_order(candidates), key=lambda m: candidates[m]) if candidates else None

    @property
    def focus(self) -> Record:
        """Scores of the protocol's focus in the main evaluation; empty if it was not evaluated."""
        return self.scores.get(self.protocol.focus or "") or {}

    @property
    def note(self) -> str:
        """Folds and trips of the main evaluation, for the head of a figure."""
        return describe_evaluation(self.main) if self.main else ""

    @property
    def main_folds(self) -> pd.DataFrame:
        """The folds of the main evaluation."""
        scheme, trips = self.main.get("scheme"), self.main.get("trips")
        return self.folds[(self.folds["scheme"] == scheme) & (self.folds["trips"] == trips)]

    def captioned(self, caption: str) -> str:
        """Return a table's caption, marked if the trips are synthetic."""
        return f"{caption} (synthetic trips)" if self.synthetic else caption
