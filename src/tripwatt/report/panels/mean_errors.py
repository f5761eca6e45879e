"""Mean errors with their intervals, in every evaluation."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from tripwatt.report.model_styles import PAPER, model_style, ordered
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, legend_below, model_rows, percent_axis, plotted
from tripwatt.report.view import View, named_evaluation
from tripwatt.report.words import label, listed, percent


@panel("mean-errors", "Mean error and its interval", draws=True)
def mean_errors(view: View) -> Content | None:
    """Which intervals lie above that of the best hybrid."""
    if not view.evaluations:
        return None
    return Content(on_intervals(view), plot_mean_errors(view))


def on_intervals(view: View) -> str:
    """Which models' intervals lie wholly above the best hybrid's."""
    models = view.scores
    best = view.best
    bounds = {m: models[m]["mape_ci95"] for m in view.models if models[m].get("mape_ci95")}
    if best not in bounds:
        return "No interval is known."
    if len(bounds) == 1:
        return f"The 95 % interval is that of {label(str(best))}, the only model of this run."
    top = bounds[best][1]
    above = [label(m) for m in bounds if m != best and bounds[m][0] > top]
    rest = len(bounds) - 1 - len(above)
    text = f"The 95 % interval of {label(str(best))} ends at {percent(top)}. "
    text += f"Entirely above it: {listed(above)}" if above else "No other interval lies entirely above it"
    return (
        f"{text}; {rest} of the other {len(bounds) - 1} intervals overlap it. The paired differences below compare the "
        "models trip by trip and detect smaller differences."
    )


def plot_mean_errors(view: View) -> Figure:
    """Mean APE with its 95 % interval, every model and every evaluation, the paper's figures as open diamonds."""
    evaluations, paper = view.evaluations, view.published
    models = ordered(name for e in evaluations for name in e.get("models") or {})
    height = 1.6 + len(models) * (0.26 + 0.09 * len(evaluations))
    note = "bars: 95 % bootstrap interval over trips"
    figure, axes = plotted(view, height, "Mean error of the trip's energy", note)
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
            size = 6 if number == 0 else 4
            axes.plot(mean, row + offset, marker, color=colour, ms=size, gid=f"mean-{number}-{row}")
            limit = max(limit, mean, float(high))
    for row, model in enumerate(models):
        if model in paper:
            axes.plot(paper[model], row - 0.42, "D", mfc="none", mec=INK, ms=4.5, clip_on=False)
            limit = max(limit, paper[model])
    if set(paper) & set(models):
        axes.plot([], [], "D", mfc="none", mec=INK, ms=4.5, label=f"the paper ({PAPER})")
    model_rows(axes, models)
    axes.set_xlim(0, 1.05 * limit or 1.0)
    percent_axis(axes, "mean absolute percentage error [%]")
    return legend_below(figure)
