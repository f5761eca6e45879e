"""The short table of a run, for the terminal: the best model of each kind, and the models of a published comparison."""

from __future__ import annotations

from typing import Final

from tripwatt.arrays import by_key
from tripwatt.study.report.model_styles import model_style
from tripwatt.study.report.tables import DASH, Column, Table, in_percent, make_table
from tripwatt.study.report.view import View, describe_evaluation
from tripwatt.study.report.words import model_label

SHORT_ROWS: Final = 5
"""Number of models up to which the short table shows all of them: as many as it has kinds."""

_INSIDE: Final = "Inside the 90 % interval [% of trips]"
_KINDS: Final = ("constant", "baseline", "physics", "data", "hybrid")
"""Kinds of models in the order of the short table."""


def short_table_models(view: View) -> list[str]:
    """Choose the models of the short table: the constant, the best model of each kind, the forecast with published values.

    Each kind is a benchmark for the best hybrid: one consumption per distance (the constant), a few coefficients
    (the best other baseline), the simulation (the best physics alone), a learner (the best model without physics).
    The best model has the lowest mean error in the main evaluation. The forecast comes last, preceded by its
    variant with only published values of the car if the run has that. Where a paper has published errors on the data
    set, the models of the paper stand among them, in the order of the tables.
    """
    names, models = view.models, view.main["models"]
    if len(names) <= SHORT_ROWS:
        return names
    kinds = by_key(names, lambda name: model_style(name).kind)
    best = {kind: min(of_kind, key=lambda m: float(models[m]["mape"])) for kind, of_kind in kinds.items()}
    if view.best is not None:
        best[model_style(view.best).kind] = view.best
    if view.published:
        return [name for name in names if name in view.published or name in best.values()]
    shown = [best[kind] for kind in _KINDS if kind in best]
    published = model_style(shown[-1]).published
    if published is None or published not in models:
        return shown
    return [*shown[:-1], published, shown[-1]]


def short_table(view: View, *, whole: bool = False) -> Table:
    """Tabulate the models of `short_table_models`, or all if `whole`: mean error with its interval, that of the paper, and coverage if there is a forecast."""
    rows = [{**view.scores[m], "name": m} for m in (view.models if whole else short_table_models(view))]
    published = in_percent("Mean error in the paper [%]", lambda row: view.published.get(row["name"]))
    inside = in_percent(_INSIDE, lambda row: (row.get("coverage") or {}).get("0.9"), 0)
    return make_table(
        view.captioned(f"Error of a trip's energy: {describe_evaluation(view.main)}"),
        rows,
        Column("Model", lambda row: model_label(row["name"])),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval of it", "mape_ci95"),
        *([published] if view.published else []),
        *([inside] if any(inside.cell(row) != DASH for row in rows) else []),
        strong=frozenset(i for i, row in enumerate(rows) if row["name"] == view.best),
    )
