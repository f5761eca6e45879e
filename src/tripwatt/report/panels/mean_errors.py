"""Mean errors with their intervals, in every evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tripwatt.report.model_styles import PAPER, model_style, ordered
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, model_rows, new_figure, percent_axis, styled
from tripwatt.report.view import Record, View, named_evaluation
from tripwatt.report.words import label, listed, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@panel("mean-errors", "Mean error and its interval", draws=True)
def mean_errors(view: View) -> Content | None:
    """Which intervals lie above that of the best hybrid."""
    if not view.evaluations:
        return None
    drawn = plot_mean_errors(view.evaluations, paper=view.published, synthetic=view.synthetic)
    return Content(on_intervals(view), drawn)


def on_intervals(view: View) -> str:
    """Which models' intervals lie wholly above the best hybrid's."""
    models = view.scores
    best = view.best
    bounds = {m: models[m]["mape_ci95"] for m in view.models if models[m].get("mape_ci95")}
    if best not in bounds:
        return "No interval is known."
    top = bounds[best][1]
    above = [label(m) for m in bounds if m != best and bounds[m][0] > top]
    rest = len(bounds) - 1 - len(above)
    text = f"The 95 % interval of {label(str(best))} ends at {percent(top)}. "
    text += f"Entirely above it: {listed(above)}" if above else "No other interval lies entirely above it"
    return (
        f"{text}; {rest} of the other {len(bounds) - 1} intervals overlap it. The paired differences below compare the "
        "models trip by trip and detect smaller differences."
    )


@styled
def plot_mean_errors(
    evaluations: Sequence[Record], *, paper: Mapping[str, float] | None = None, synthetic: bool = False
) -> Figure:
    """Mean APE with its 95 % interval, every model and every evaluation, the paper's figures as open diamonds.

    Parameters
    ----------
    evaluations : sequence of mapping
        As in `results.json`, the main one first.
    paper : mapping of str to float, optional
        Published mean errors by model name.
    synthetic : bool
        Whether the trips are made up.

    Returns
    -------
    Figure
    """
    models = ordered(name for e in evaluations for name in e.get("models") or {})
    figure = new_figure(
        1.6 + len(models) * (0.26 + 0.09 * len(evaluations)),
        "Mean error of the trip's energy",
        "bars: 95 % bootstrap interval over trips",
        synthetic,
    )
    axes = figure.add_subplot()
    spread = 0.62 / max(len(evaluations), 1)
    limit = 0.0
    for number, (evaluation, marker) in enumerate(
        zip(evaluations, "os^vDPX*" * len(evaluations), strict=False)
    ):
        offset = (number - (len(evaluations) - 1) / 2) * spread
        axes.plot([], [], marker, color=INK, ms=5 if number == 0 else 4, label=named_evaluation(evaluation))
        for row, model in enumerate(models):
            score = (evaluation.get("models") or {}).get(model)
            if not score or score.get("mape") is None or not np.isfinite(score["mape"]):
                continue
            mean = float(score["mape"])
            low, high = score.get("mape_ci95") or (mean, mean)
            colour = model_style(model).colour
            axes.plot([low, high], [row + offset] * 2, color=colour, lw=2.0 if number == 0 else 1.2)
            axes.plot(
                mean,
                row + offset,
                marker,
                color=colour,
                ms=6 if number == 0 else 4,
                gid=f"mean-{number}-{row}",
            )
            limit = max(limit, mean, float(high))
    for row, model in enumerate(models):
        if paper and model in paper:
            axes.plot(paper[model], row - 0.42, "D", mfc="none", mec=INK, ms=4.5, clip_on=False)
            limit = max(limit, paper[model])
    if paper and set(paper) & set(models):
        axes.plot([], [], "D", mfc="none", mec=INK, ms=4.5, label=f"the paper ({PAPER})")
    model_rows(axes, models)
    axes.set_xlim(0, 1.05 * limit or 1.0)
    percent_axis(axes, "mean absolute percentage error [%]")
    figure.legend(loc="outside lower left", ncols=1)
    return figure


PANELS = (mean_errors,)
