"""The tables of an evaluation, built once and rendered as HTML, in the terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.report.models import PAPER, model_style
from tripwatt.report.sentences import in_words, label, points
from tripwatt.report.view import (
    TRIP_SETS,
    Record,
    View,
    absolute_errors,
    named_evaluation,
    natural_key,
    of_evaluation,
    plain,
)

if TYPE_CHECKING:
    import rich.console

DASH: Final = "–"


@dataclass(frozen=True, slots=True)
class Table:
    """Text cells with a caption; the first cell of a row is its head.

    Attributes
    ----------
    caption : str
    columns : tuple of str
    rows : tuple of tuple of str
    text_columns : frozenset of int
        Columns of words; all others hold numbers and stand to the right.
    strong : frozenset of int
        Rows to stress.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: frozenset[int] = frozenset({0})
    strong: frozenset[int] = frozenset()


def number(value: object, factor: float = 1.0, digits: int = 2) -> str:
    """A number times a factor, a dash when it is missing.

    Examples
    --------
    >>> number(512.0, 1e-3)
    '0.51'
    """
    if not isinstance(value, int | float | np.floating | np.integer) or not np.isfinite(value):
        return DASH
    text = f"{round(factor * float(value), digits) + 0.0:,.{digits}f}"  # + 0.0: no minus before a zero
    return text.replace("-", "−")


def span(bounds: Sequence[float] | None, digits: int = 1) -> str:
    """An interval of fractions in percent, in one piece."""
    if not bounds:
        return DASH
    return f"{number(bounds[0], 100, digits)}\u00a0to\u00a0{number(bounds[1], 100, digits)}"


def _unbroken(bounds: Sequence[float] | None) -> str:
    return f"({span(bounds)})" if bounds else ""


def _names(view: View, evaluation: Record) -> list[str]:
    models = evaluation.get("models") or {}
    return [m for m in view.models if m in models] + [m for m in models if m not in view.models]


def results_table(view: View, evaluation: Record, *, caption: str | None = None) -> Table:
    """One evaluation: a row per model, errors in percent, RMSE in kWh, the paper's mean beside ours."""
    models: Mapping[str, Record] = evaluation.get("models") or {}
    names = _names(view, evaluation)
    paper = view.paper_mape if evaluation.get("scheme") == "leave_one_trip_out" else {}
    beside_paper = not view.is_forecast  # the forecast protocol has no paper preset to beat
    columns = [
        "Model",
        "Mean error [%]",
        "95 % interval",
        *(["The paper [%]"] if paper else []),
        "Median [%]",
        "Max [%]",
        "Bias [%]",
        "RMSE [kWh]",
        *(["Beats paper preset [% of trips]"] if beside_paper else []),
        "Beats default preset [% of trips]",
        "Fit [s]",
        "Predict [ms]",
    ]
    rows = []
    for name in names:
        score = models[name]
        share = score.get("improved_share") or {}
        rows.append(
            (
                label(name),
                number(score.get("mape"), 100, 1),
                span(score.get("mape_ci95")),
                *([number(paper.get(name), 100, 1)] if paper else []),
                number(score.get("median_ape"), 100, 1),
                number(score.get("max_ape"), 100, 1),
                number(score.get("bias"), 100, 1),
                number(score.get("rmse_wh"), 1e-3, 2),
                *([number(share.get("physics-paper"), 100, 0)] if beside_paper else []),
                number(share.get("physics"), 100, 0),
                number(score.get("fit_s"), 1.0, 2),
                number(score.get("predict_ms"), 1.0, 1),
            )
        )
    best = frozenset(i for i, name in enumerate(names) if name == view.best)
    head = caption or named_evaluation(evaluation)
    return Table(_labelled(view, head[:1].upper() + head[1:]), tuple(columns), tuple(rows), strong=best)


def sets_table(view: View) -> Table:
    """Mean error of each model (columns) in each evaluation (rows)."""
    rows = []
    for evaluation in view.evaluations:
        models = evaluation.get("models") or {}
        cells = [
            f"{number(models[m].get('mape'), 100, 1)} {_unbroken(models[m].get('mape_ci95'))}"
            if m in models
            else DASH
            for m in view.models
        ]
        rows.append((named_evaluation(evaluation), *cells))
    if view.paper_mape:
        cells = [number(view.paper_mape.get(m), 100, 1) for m in view.models]
        rows.append((f"the paper ({PAPER})", *cells))
    caption = _labelled(view, "Mean error [%] with its 95 % interval, by the trips that were used")
    return Table(caption, ("Trips", *map(label, view.models)), tuple(rows))


def audit_table(view: View) -> Table:
    """Every finding of the audit and what it led to."""
    findings = sorted(
        view.results.get("audit") or (), key=lambda f: (natural_key(f.get("trip")), f.get("from_s") or 0.0)
    )
    rows = [
        (
            plain(f.get("trip")),
            number(f.get("from_s"), 1.0, 1),
            number(f.get("to_s"), 1.0, 1),
            plain(f.get("what", ""), 400),
            plain(f.get("consequence", ""), 200),
        )
        for f in findings
    ]
    columns = ("Trip", "From [s]", "To [s]", "What was found", "Consequence")
    return Table(_labelled(view, "Findings of the audit"), columns, tuple(rows), frozenset({0, 3, 4}))


def used_table(view: View) -> Table:
    """The trips of each set, and those that were read but are not in it, with the reason."""
    used: Mapping[str, Sequence[str]] = view.results.get("trips_used") or {}
    read = [str(trip) for trip in view.results.get("trips_read") or ()]
    rows = []
    for name, ids in used.items():
        absent = sorted(set(read) - set(map(str, ids)), key=natural_key)
        rows.append(
            (
                TRIP_SETS.get(name, name),
                str(len(ids)),
                ", ".join(plain(i) for i in sorted(ids, key=natural_key)),
                "; ".join(f"{plain(trip)}: {_why_absent(view, name, trip)}" for trip in absent) or "none",
            )
        )
    columns = ("Set", "Number", "Trips", "Read, but not in it")
    return Table(_labelled(view, "Trips of each set"), columns, tuple(rows), frozenset({0, 2, 3}))


def _why_absent(view: View, name: str, trip: str) -> str:
    found = [f for f in view.results.get("audit") or () if str(f.get("trip")) == trip]
    reasons = [plain(f.get("what", ""), 200) for f in found if f.get("consequence") in ("set aside", "split")]
    if name == "reference":
        return "; ".join(
            ["not a reference trip of the data set", *(f"audit: {reason}" for reason in reasons)]
        )
    if name == "all":
        noted = [plain(n, 200) for n in view.results.get("notes") or () if trip in str(n)]
        return "; ".join(noted) or "could not be simulated or scored"
    return "; ".join(reasons) or "see the audit"


def trips_table(view: View) -> Table:
    """Every trip of the main evaluation: measured energy and the error of every model."""
    folds = view.folds_of(view.main)
    wide = absolute_errors(folds)
    observed = folds.groupby("trip", observed=True)["observed_energy_wh"].first()
    rows = [
        (
            plain(trip),
            number(float(observed.loc[trip]), 1e-3, 2),
            *(number(float(e), 100, 1) for e in wide.loc[trip]),
        )
        for trip in wide.index
    ]
    columns = ("Trip", "Measured [kWh]", *(label(str(m)) for m in wide.columns))
    return Table(_labelled(view, "Absolute error [%] of every trip and model"), columns, tuple(rows))


def paired_table(view: View) -> Table:
    """Every pair of models of every evaluation, with its interval and the result in words."""
    rows = []
    for evaluation in view.evaluations:
        for pair in view.paired_of(evaluation):
            low, high = pair["ci95"]
            rows.append(
                (
                    f"{label(str(pair['a']))} − {label(str(pair['b']))}",
                    points(float(pair["diff"])),
                    f"{points(float(low))} to {points(float(high))}".replace(" points to", " to"),
                    in_words(pair),
                    of_evaluation(evaluation),
                )
            )
    columns = ("Pair", "Difference of mean errors", "95 % interval", "Result", "Evaluation")
    caption = _labelled(view, "Paired differences over the same trips")
    return Table(caption, columns, tuple(rows), frozenset({0, 3, 4}))


_SIGNALS: Final = {
    "current_rmse_a": ("Current [A]", 1.0, 1),
    "voltage_rmse_v": ("Voltage [V]", 1.0, 2),
    "battery_temperature_rmse_degc": ("Battery temperature [°C]", 1.0, 2),
    "soc_rmse": ("SoC [points]", 100.0, 2),
}


def signals_table(view: View) -> Table | None:
    """RMSE of simulated against measured signals: median, largest, and every trip."""
    signals = view.signals
    if signals is None:
        return None
    columns = [c for c in _SIGNALS if c in signals]

    def row(head: str, values: pd.Series[Any]) -> tuple[str, ...]:
        return (head, *(number(float(values[c]), _SIGNALS[c][1], _SIGNALS[c][2]) for c in columns))

    rows = [row("Median of all trips", signals[columns].median()), row("Largest", signals[columns].max())]
    by_trip = signals.sort_values("trip", key=lambda names: names.map(natural_key))
    rows += [row(plain(line["trip"]), line) for _, line in by_trip.iterrows()]
    caption = _labelled(view, "RMSE of the simulated signals, by trip")
    heads = ("Trip", *(_SIGNALS[c][0] for c in columns))
    return Table(caption, heads, tuple(rows), strong=frozenset({0, 1}))


def legend_table(view: View) -> Table:
    """What each model of this run is."""
    rows = tuple((label(m), m, model_style(m).meaning) for m in view.models)
    return Table("The models", ("Model", "Name in the files", "What it is"), rows, frozenset({0, 1, 2}))


def _labelled(view: View, caption: str) -> str:
    return f"{caption} (synthetic trips)" if view.synthetic else caption


def markdown(table: Table) -> str:
    r"""A table as GitHub Markdown.

    Examples
    --------
    >>> print(markdown(Table("Caption", ("Model", "Error"), (("a|b", "1.0"),))))
    *Caption*
    <BLANKLINE>
    | Model | Error |
    |:--|--:|
    | a\|b | 1.0 |
    """

    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(_markdown_text(cell) for cell in cells)} |"

    rule = "|".join(":--" if i in table.text_columns else "--:" for i in range(len(table.columns)))
    body = [
        line([f"**{cell}**" if i == 0 else cell for i, cell in enumerate(row)])
        if place in table.strong
        else line(row)
        for place, row in enumerate(table.rows)
    ]
    return "\n".join([f"*{_markdown_text(table.caption)}*", "", line(table.columns), f"|{rule}|", *body])


def _markdown_text(text: str) -> str:
    for char, safe in (("\\", "\\\\"), ("|", "\\|"), ("<", "&lt;"), (">", "&gt;"), ("\n", " ")):
        text = text.replace(char, safe)
    return text


SHORT_ROWS: Final = 5
"""Rows of the short table; a run with no more models than this shows them all."""


def short_list(view: View) -> list[str]:
    """The models that a short table shows: the constant, and the best model of each kind.

    Each kind is a question that the best hybrid has to answer with a lower error: is more needed than one consumption per
    distance (the constant), than a few coefficients (the best other baseline), than the simulation (the best physics
    alone), than learning (the best model without physics)? Best is the lowest mean error in the main evaluation; the
    model of lowest error of all is always among them. In table order, the best hybrid last.
    """
    names = view.models
    if len(names) <= SHORT_ROWS:
        return names
    models = view.main["models"]
    kinds: dict[str, list[str]] = {}
    for name in names:
        kind = "constant" if name == "constant" else model_style(name).kind
        kinds.setdefault(kind, []).append(name)
    best = {kind: min(of_kind, key=lambda m: _error(models[m])) for kind, of_kind in kinds.items()}
    if view.best is not None:
        best[model_style(view.best).kind] = view.best
    order = ("constant", "baseline", "physics", "data", "hybrid")
    return [best[kind] for kind in order if kind in best]


def _error(score: Record) -> float:
    value = score.get("mape")
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else float("inf")


def short_table(view: View) -> Table:
    """The models of `short_list`: mean error with its interval and, for a forecast, how often its interval holds."""
    models: Mapping[str, Record] = view.main.get("models") or {}
    names = short_list(view)
    coverage = {m: (models[m].get("coverage") or {}).get("0.9") for m in names}
    told = any(value is not None for value in coverage.values())
    rows = tuple(
        (
            label(m),
            number(models[m].get("mape"), 100, 1),
            span(models[m].get("mape_ci95")),
            *((number(coverage[m], 100, 0),) if told else ()),
        )
        for m in names
    )
    columns = (
        "Model",
        "Mean error [%]",
        "95 % interval",
        *(("Inside the 90 % interval [% of trips]",) if told else ()),
    )
    head = f"Error of a trip's energy: {named_evaluation(view.main)}"
    best = frozenset(i for i, m in enumerate(names) if m == view.best)
    return Table(_labelled(view, head), columns, rows, strong=best)


def render_table(results: Mapping[str, Any]) -> rich.console.Group:
    """The result as a short table for the terminal (see `short_table`); the report holds all models and evaluations.

    Parameters
    ----------
    results : mapping
        The contract of `results.json`.

    Returns
    -------
    rich.console.Group

    Examples
    --------
    >>> score = {"mape": 0.1, "mape_ci95": [0.08, 0.12], "rmse_wh": 500.0}
    >>> shown = render_table({"evaluations": [{"scheme": "leave_one_trip_out", "trips": "audited",
    ...                                        "n_trips": 2, "models": {"boosting": score}}]})
    >>> print(shown.renderables[0])
    Error of a trip's energy: leave one trip out, 2 trips the audit keeps
    """
    import rich.box
    import rich.console
    import rich.table
    from rich.text import Text

    view = View(results)
    source = short_table(view)
    left_out = len(view.models) - len(source.rows)
    more = f" The best model of each kind; {left_out} more are in the report." if left_out else ""
    table = rich.table.Table(
        box=rich.box.SIMPLE,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for place, head in enumerate(source.columns):
        table.add_column(
            head.replace("Inside the 90 % interval [% of trips]", "Inside its\n90 % interval [%]"),
            justify="left" if place in source.text_columns else "right",
            no_wrap=True,
        )
    for place, row in enumerate(source.rows):
        style = "bold" if place in source.strong else ""
        table.add_row(*(Text(cell, style=style) for cell in row))
    return rich.console.Group(
        Text(source.caption), table, Text(f"95 % interval: bootstrap over trips.{more}")
    )
