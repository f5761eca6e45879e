"""How long each model takes to fit and to predict, as the paper compares its correctors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import annotate, model_rows, new_figure
from tripwatt.report.tables import Column, Table, tabulated
from tripwatt.report.view import View, is_known
from tripwatt.report.words import label

PAPER_SAYS: Final[Mapping[str, str]] = {"gamm": "GAMMs have a longer running time compared to the others"}
"""Model -> the paper's words on its running time (arXiv:2405.10984, Evaluation and Results); it prints no figure."""


@panel("running-time", "Running time of the correctors", draws=True, folded=True)
def running_time(view: View) -> Content:
    """Times of fits and predictions."""
    if not timed_models(view):
        return Content(on_running_time(view))
    return Content(on_running_time(view), plot_running_time(view), (running_time_table(view),))


def timed_models(view: View) -> list[str]:
    """Models of the main evaluation that are fitted, and whose times are known, in table order."""
    models = view.scores
    return [
        m
        for m in view.models
        if model_style(m).kind != "physics"
        and all(is_known(value) and value > 0 for value in map(models[m].get, ("fit_s", "predict_ms")))
    ]


def correctors(view: View) -> list[str]:
    """Those of `timed_models` that correct the paper's physics, which are what the paper compares."""
    return [m for m in timed_models(view) if model_style(m).stands_on in view.protocol.published]


def duration(seconds: float) -> str:
    r"""A time in the unit that fits it.

    Examples
    --------
    >>> duration(0.0042), duration(1.25)
    ('4.2\xa0ms', '1.2\xa0s')
    """
    factor, unit = (1.0, "s") if seconds >= 1 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "µs")
    value = factor * seconds
    return f"{value:,.0f}\u00a0{unit}" if value >= 100 else f"{value:.2g}\u00a0{unit}"


def on_running_time(view: View) -> str:
    """Which corrector takes longest to fit and to predict, and how that compares with the paper."""
    names, models = correctors(view), view.scores
    if not names:
        return "No corrector of the paper's physics was timed in this run."
    fit = {m: float(models[m]["fit_s"]) for m in names}
    predict = {m: float(models[m]["predict_ms"]) / 1e3 for m in names}
    parts = [f"{label(m)} {duration(fit[m])} and {duration(predict[m])}" for m in names]
    said = [_beside_others(m, fit, predict, view) for m in PAPER_SAYS if m in fit and len(fit) > 1]
    return " ".join([*said, f"To fit, and to predict one trip: {'; '.join(parts)}."])


def _beside_others(model: str, fit: Mapping[str, float], predict: Mapping[str, float], view: View) -> str:
    """The times of a model relative to the slowest of the others."""
    others = [m for m in fit if m != model]
    slowest, longest = max(others, key=lambda m: fit[m]), max(others, key=lambda m: predict[m])
    paper = f"; the paper states that {PAPER_SAYS[model]}" if view.published else ""
    return (
        f"The fit of {label(model)} takes {_short(fit[model] / fit[slowest])} times as long as that of {label(slowest)}, the "
        f"slowest of the other correctors, and its prediction {_short(predict[model] / predict[longest])} times as long as that "
        f"of {label(longest)}{paper}."
    )


def running_time_table(view: View) -> Table:
    """Fit and prediction time of every model that is fitted."""
    return tabulated(
        view.captioned("Wall time on one core of this machine"),
        timed_models(view),
        Column("Model", label),
        Column("One fit on the training trips [s]", lambda m: view.scores[m]["fit_s"], digits=3),
        Column("Predicting one trip [ms]", lambda m: view.scores[m]["predict_ms"]),
    )


def _short(value: float) -> str:
    """Two digits of a positive number, without a power of ten."""
    return f"{value:,.0f}" if value >= 10 else f"{float(f'{value:.2g}'):.12g}"


def plot_running_time(view: View) -> Figure:
    """Fit and prediction time in the main evaluation of every model that is fitted, on logarithmic axes."""
    names, models = timed_models(view), view.scores
    figure = new_figure(1.6 + 0.27 * len(names), "Running time", view.note, view.synthetic)
    panels = figure.subplots(1, 2, sharey=True)
    shown = ("fit_s", "one fit [s]"), ("predict_ms", "predicting one trip [ms]")
    for axes, (key, words) in zip(panels, shown, strict=True):
        values = np.array([float(models[m][key]) for m in names])
        for row, (model, value) in enumerate(zip(names, values, strict=True)):
            axes.plot(value, row, "o", color=model_style(model).colour, ms=6, gid=f"{key}-{row}")
            annotate(axes, _short(value), (value, row), (0, 6), ha="center")
        axes.set(xscale="log", xlim=(values.min() / 4, values.max() * 4), xlabel=words)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _short(value)))
        axes.minorticks_off()
        axes.grid(axis="x")
        model_rows(axes, names)
    panels[1].tick_params(labelleft=False)
    return figure
