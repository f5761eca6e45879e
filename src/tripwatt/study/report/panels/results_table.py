"""The main table, the other evaluations, and the meanings of the models."""

from __future__ import annotations

from functools import partial

from tripwatt.study.report.model_styles import PAPER, model_style
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels.paired import SIGNIFICANCE_NOTE, difference_column
from tripwatt.study.report.tables import Column, Table, in_kwh, in_percent, in_words, make_table, number, span
from tripwatt.study.report.view import Record, View, describe_evaluation
from tripwatt.study.report.words import model_label

NOTE = f"Bold is the model that the others are compared with. {SIGNIFICANCE_NOTE}"


def panels(view: View) -> list[Panel]:
    """Return the panels of the main evaluation, of all evaluations, and of the models' meanings."""
    if not view.evaluations:
        return []
    legend = make_table(
        "The models",
        view.models,
        Column("Model", model_label),
        in_words("Name in the files", str),
        in_words("What it is", lambda name: model_style(name).meaning),
    )
    return [
        Panel("table", "Errors of the models", NOTE, tables=(results_table(view),)),
        Panel("sets", "Other trips and other folds", tables=(sets_table(view),)),
        Panel("legend", "What the models are", tables=(legend,)),
    ]


def results_table(view: View) -> Table:
    """Tabulate the main evaluation: a row per model, errors in percent, RMSE in kWh, and the paper's mean error."""
    paper, head = view.published, ", ".join(filter(None, [view.note, view.protocol.given]))

    def beaten(preset: str) -> Column:
        heading = f"Beats {model_style(preset).preset} [% of trips]"
        return in_percent(heading, lambda row: (row.get("improved_share") or {}).get(preset), 0)

    return make_table(
        view.captioned(head[:1].upper() + head[1:]),
        [{**view.scores[name], "name": name} for name in view.models],
        Column("Model", lambda row: model_label(row["name"])),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        difference_column(view),
        *([in_percent("The paper [%]", lambda row: paper.get(row["name"]))] if paper else []),
        in_percent("Median [%]", "median_ape"),
        in_percent("Max [%]", "max_ape"),
        in_percent("Bias [%]", "bias"),
        in_kwh("RMSE [kWh]", "rmse_wh"),
        *(beaten(m.name) for m in view.protocol.models if model_style(m.name).preset),
        Column("Fit [s]", "fit_s"),
        Column("Predict [ms]", "predict_ms", digits=1),
        strong=frozenset(i for i, name in enumerate(view.models) if name == view.best),
    )


def sets_table(view: View) -> Table:
    """Tabulate the mean error of each model (rows) in each evaluation (columns)."""
    paper = [in_percent(f"the paper ({PAPER})", view.published.get)] if view.published else []
    return make_table(
        view.captioned("Mean error [%] with its 95 % interval, by the trips that were used"),
        view.models,
        Column("Model", model_label),
        *(Column(describe_evaluation(e), partial(_mean_and_interval, e)) for e in view.evaluations),
        *paper,
    )


def _mean_and_interval(evaluation: Record, model: str) -> str | None:
    score = evaluation["models"].get(model)
    return f"{number(score['mape'], 100, 1)} ({span(score['mape_ci95'])})" if score else None
