"""The main table, the other evaluations, and what the models are."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from tripwatt.report.model_styles import PAPER, PAPER_CAR, PAPER_IMPROVED, PAPER_TRIPS, model_style, ordered
from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Column, Table, in_kwh, in_percent, in_words, number, span, tabulated
from tripwatt.report.view import Record, View, named_evaluation, of_evaluation
from tripwatt.report.words import compared, interval, label, listed, percent, points


@panel("table", "The table", wide=True)
def main_table(view: View) -> Content:
    """The main evaluation, and what it shows."""
    if not view.evaluations:
        return Content("No evaluation was run: no trip could be used, see the audit.")
    return Content(on_table(view), tables=(results_table(view, view.main),))


@panel("legend", "What the models are")
def legend(view: View) -> Content | None:
    """The models of the run."""
    if not view.evaluations:
        return None
    table = tabulated(
        "The models",
        view.models,
        Column("Model", label),
        in_words("Name in the files", str),
        in_words("What it is", lambda name: model_style(name).meaning),
    )
    n = len(view.models)
    return Content("One model." if n == 1 else f"{n} models, the same trips for each.", tables=(table,))


@panel("sets", "Other trips, other folds", wide=True)
def sets(view: View) -> Content | None:
    """How the errors depend on the trips and on the folds."""
    if not view.evaluations:
        return None
    said = " ".join(filter(None, [on_sets(view), without_days(view)]))
    return Content(said, tables=(sets_table(view),))


@panel("full-tables", "The other evaluations in full", folded=True, wide=True)
def full_tables(view: View) -> Content | None:
    """The table of every evaluation but the main one."""
    others = tuple(results_table(view, e) for e in view.evaluations[1:])
    return Content(f"{len(others)} more.", tables=others) if others else None


def on_table(view: View) -> str:
    """What the main evaluation shows: the protocol's focus, or the hybrid with the lowest error and the paper."""
    if view.protocol.focus:
        return on_focus(view)
    return " ".join(filter(None, [on_lowest(view), on_paper(view), on_physics_gap(view)]))


def on_lowest(view: View) -> str:
    """Best hybrid against physics alone in the main evaluation."""
    best = view.best
    if best is None:
        return "No model was evaluated."
    models = view.scores
    hybrid = model_style(best).kind == "hybrid"
    rivals = [m for m in models if m != best and (model_style(m).kind == "hybrid" or not hybrid)]
    text = f"{'Of the hybrids, ' if hybrid else ''}{label(best)} has the lowest mean error: "
    text = text if rivals else f"The mean error of {label(best)} is "
    text += f"{percent(models[best]['mape'])}{interval(models[best])}"
    if view.physics and view.physics != best:
        text += f". The mean error of {label(view.physics)} alone is {percent(models[view.physics]['mape'])}"
    lower = [m for m in view.models if m != best and (models[m].get("mape") or np.inf) < models[best]["mape"]]
    if lower:
        below = [f"{label(m)} ({percent(models[m]['mape'])})" for m in lower]
        text += f". Models of another kind with a lower mean error: {listed(below)}"
    return f"{text}. Folds and trips: {of_evaluation(view.main)}."


def on_focus(view: View) -> str:
    """The error of the protocol's focus, and how it compares with the other models."""
    score, focus = view.focus, view.protocol.focus or ""
    if not score:
        return view.no_focus
    low, high = score["mape_ci95"]
    text = (
        f"The mean error of the {label(focus).lower()} is {percent(score['mape'])} (95 % interval {100 * low:.1f} to "
        f"{100 * high:.1f} %), its RMSE {number(score['rmse_wh'], 1e-3)} kWh ({view.note}, {view.given})."
    )
    lower = [m for m in view.models if view.scores[m]["mape"] < score["mape"]]
    if lower:
        below = [f"{label(m)} ({percent(view.scores[m]['mape'])})" for m in lower]
        text += f" Models with a lower mean error: {listed(below)}."
    beside = compared(view.paired_of(view.main), focus, model_style(focus).rivals)
    return " ".join(filter(None, [text, beside, on_parts(view)]))


def on_parts(view: View) -> str:
    """The protocol's focus against each of its two parts alone: its own physics, and learning without physics."""
    focus = view.protocol.focus or ""
    style = model_style(focus)
    parts = [name for name in (style.own_physics, style.without_physics) if name is not None]
    return compared(view.paired_of(view.main), focus, parts, f"The mean error of the {label(focus).lower()}")


def on_paper(view: View) -> str:
    """Our means beside the paper's, or why they do not stand there."""
    paper, models, physics = view.published, view.scores, view.published_physics
    if not paper:
        what = "made-up trips" if view.synthetic else "other trips"
        return (
            f"The paper's figures are those of its TUM trips; these are {what}, so its figures are not shown."
        )
    ours = [m for m in view.models if m in paper]
    parts = [
        f"{label(m)} {percent(models[m]['mape'])} ({percent(paper[m])} in the paper, {points(models[m]['mape'] - paper[m])})"
        for m in ours
    ]
    text = f"Beside {PAPER}: {'; '.join(parts)}." if parts else f"No model here has a figure in {PAPER}."
    improved = {m: (models[m].get("improved_share") or {}).get(physics) for m in ours if m != physics}
    shares = [f"{label(m)} {percent(share, 0)}" for m, share in improved.items() if share is not None]
    if shares:
        text += f" Share of trips improved over the paper preset: {listed(shares)}; the paper says {PAPER_IMPROVED}."
    return text


def on_physics_gap(view: View) -> str:
    """Why our simulation of the paper's car is not at the paper's error; empty on other trips or another car."""
    physics = view.published_physics
    its_car = str(view.results.get("vehicle") or PAPER_CAR) == PAPER_CAR
    if physics is None or physics not in view.scores or physics not in view.published or not its_car:
        return ""
    return (
        f"Why the mean error of {label(physics)} is {percent(view.scores[physics]['mape'])} and that of the paper's physics "
        f"{percent(view.published[physics])}: the paper names no parameter of its MATLAB car (mass, drag, rolling "
        "resistance, efficiencies, auxiliaries), so ours takes measured coast-down values and a drivetrain from named sources. "
        "Both leave out the climate and take back 50 % of the braking energy. "
        f"The paper scored {PAPER_TRIPS} trips, this table {view.main.get('n_trips', 'another number')}."
    )


def on_sets(view: View) -> str:
    """How the best model's error moves with the choice of trips and with days left out whole."""
    best = view.best
    scored = [e for e in view.evaluations if best in (e.get("models") or {})]
    if best is None or not scored:
        return "No model was evaluated."
    parts = [f"{percent(e['models'][best]['mape'])} ({named_evaluation(e)})" for e in scored]
    return f"{label(best)}: {'; '.join(parts)}."


def without_days(view: View) -> str:
    """Why there is no leave-one-day-out evaluation; empty when there is one."""
    if any(e.get("scheme") == "leave_one_day_out" for e in view.evaluations):
        return ""
    noted = next((str(n) for n in view.results.get("notes") or () if "leave-one-day-out" in str(n)), "")
    reason = noted.partition(":")[2].strip().rstrip(".") or "the run gives no reason"
    return f"Leave one day out was not run: {reason}."


def results_table(view: View, evaluation: Record) -> Table:
    """One evaluation: a row per model, errors in percent, RMSE in kWh, the paper's mean beside ours."""
    models: Mapping[str, Record] = evaluation.get("models") or {}
    names, head = ordered(map(str, models)), named_evaluation(evaluation)
    paper = view.published if evaluation.get("scheme") == "leave_one_trip_out" else {}

    def beaten(preset: str) -> Column:
        heading = f"Beats {model_style(preset).preset} [% of trips]"
        return in_percent(heading, lambda row: (row.get("improved_share") or {}).get(preset), 0)

    return tabulated(
        view.captioned(head[:1].upper() + head[1:]),
        [{**models[name], "name": name} for name in names],
        Column("Model", lambda row: label(row["name"])),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        *([in_percent("The paper [%]", lambda row: paper.get(row["name"]))] if paper else []),
        in_percent("Median [%]", "median_ape"),
        in_percent("Max [%]", "max_ape"),
        in_percent("Bias [%]", "bias"),
        in_kwh("RMSE [kWh]", "rmse_wh"),
        *(beaten(m.name) for m in view.protocol.models if model_style(m.name).preset),
        Column("Fit [s]", "fit_s"),
        Column("Predict [ms]", "predict_ms", digits=1),
        strong=frozenset(i for i, name in enumerate(names) if name == view.best),
    )


def sets_table(view: View) -> Table:
    """Mean error of each model (rows) in each evaluation (columns)."""
    scores = [(named_evaluation(e), e.get("models") or {}) for e in view.evaluations]
    paper = [in_percent(f"the paper ({PAPER})", view.published.get)] if view.published else []
    return tabulated(
        view.captioned("Mean error [%] with its 95 % interval, by the trips that were used"),
        view.models,
        Column("Model", label),
        *(Column(name, partial(_mean_and_interval, models)) for name, models in scores),
        *paper,
    )


def _mean_and_interval(models: Mapping[str, Record], model: str) -> str | None:
    score = models.get(model)
    if score is None:
        return None
    bounds = score.get("mape_ci95")
    return f"{number(score.get('mape'), 100, 1)} {f'({span(bounds)})' if bounds else ''}"
