"""Errors of the trips, as histograms and box plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from tripwatt.arrays import FloatArray
from tripwatt.study.report import style
from tripwatt.study.report.model_styles import in_table_order, model_style
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.view import View
from tripwatt.study.report.words import model_label

CUT: Final = 1.5
"""Errors beyond this fraction are drawn at the edge; otherwise a few would flatten all others."""
EDGE: Final = f"errors beyond {100 * CUT:.0f} % are drawn at the edge"


def panels(view: View) -> list[Panel]:
    """Return the panels with the distribution of the errors and the box plots."""
    models = in_table_order(map(str, view.main_folds["model"].unique()))
    counterparts = ((m, model_style(m).without_physics) for m in models)
    triples = [(model_style(m).stands_on, m, other) for m, other in counterparts if other in models]
    shown = []
    if models:
        caption = "Signed error of every held-out trip, by model."
        figure = plot_error_distribution(view, models)
        shown.append(Panel("error-distribution", "Error distribution", caption, figure))
        caption = "Absolute error of every held-out trip, by model."
        figure = plot_error_boxes(view, models, "Errors of all models")
        shown.append(Panel("error-boxes", "Box plot of all models", caption, figure))
    for triple in triples[:1]:
        caption = "A hybrid beside its simulation alone and beside the same learner without simulation."
        figure = plot_error_boxes(view, [m for m in triple if m in models], "Physics, hybrid, learner alone")
        shown.append(Panel("benchmark-boxes", "Physics alone, hybrid, and learner alone", caption, figure))
    return shown


def _signed_errors(view: View, model: str) -> FloatArray:
    """Return (predicted - observed) / observed of a model, one finite value per trip of the main evaluation."""
    rows = view.main_folds[view.main_folds["model"] == model]
    errors = (rows["predicted_energy_wh"] / rows["observed_energy_wh"] - 1.0).to_numpy(dtype=np.float64)
    return np.asarray(errors[np.isfinite(errors)])


def plot_error_distribution(view: View, models: Sequence[str]) -> Figure:
    """Draw histogram and rug of the signed errors of every model over the folds, on one common axis."""
    errors = {m: _signed_errors(view, m) for m in models}
    largest = np.abs(np.concatenate(list(errors.values()))).max(initial=0.2)
    limit = min(np.ceil(10 * largest) / 10, CUT)
    head = "Error of every trip, by model", f"{view.note}\nevery row to its own scale; {EDGE}"
    figure = style.new_figure(1.5 + 0.72 * len(models), *head, view.synthetic)
    rows = figure.subplots(len(models), 1, squeeze=False, sharex=True)[:, 0]
    for number, (axes, model) in enumerate(zip(rows, models, strict=True)):
        colour, clipped = model_style(model).colour, np.clip(errors[model], -limit, limit)
        axes.hist(clipped, bins=np.linspace(-limit, limit, 41).tolist(), color=colour, alpha=0.75, lw=0)
        rug = axes.plot(clipped, np.full(len(clipped), -0.09), "|", color=colour, ms=6, mew=0.9)[0]
        rug.set(transform=axes.get_xaxis_transform(), clip_on=False, gid=f"rug-{number}")
        axes.axvline(0.0, color=style.INK, lw=0.9)
        axes.axvline(float(np.median(clipped)), color=style.INK, lw=1.1, ls=(0, (2, 2)))
        axes.set(xlim=(-limit, limit), yticks=[])
        axes.spines["left"].set_visible(False)
        axes.set_title(model_label(model), fontsize=8.5, pad=2)
        axes.tick_params(axis="x", pad=7)
        axes.grid(axis="x")
    words = "(predicted − measured) / measured [%];  dashed: median;  ticks: single trips"
    style.percent_axis(rows[-1], words)
    return figure


def plot_error_boxes(view: View, models: Sequence[str], title: str) -> Figure:
    """Draw a box plot of each model's absolute errors, with every trip as a point and the paper's means as crosses."""
    figure, axes = style.new_axes(view, 1.7 + 0.52 * len(models), title, f"{view.note}\n{EDGE}")
    errors = [np.minimum(np.abs(_signed_errors(view, m)), CUT) for m in models]
    boxes = axes.boxplot(
        errors, positions=range(len(models)), orientation="horizontal", widths=0.48, showfliers=False,
        showmeans=True, patch_artist=True, medianprops={"color": style.INK, "lw": 1.8},
        meanprops={"marker": "D", "mfc": "white", "mec": style.INK, "ms": 4.5},
    )  # fmt: skip
    for row, (model, model_errors) in enumerate(zip(models, errors, strict=True)):
        colour = model_style(model).colour
        boxes["boxes"][row].set(facecolor=colour, edgecolor=colour, alpha=0.35)
        # a fixed low-discrepancy jitter: points of one row stay apart without a random state
        shift = 0.3 * (((np.arange(len(model_errors)) * 0.618034) % 1.0) - 0.5)
        axes.scatter(
            model_errors, row + shift, s=7, color=colour, alpha=0.7, lw=0, zorder=3, gid=f"trips-{row}"
        )
    paper = {view.published[m]: row for row, m in enumerate(models) if m in view.published}
    crosses = axes.plot([*paper], [row - 0.38 for row in paper.values()], "x", color=style.INK, ms=5)
    axes.legend(
        [boxes["means"][0], boxes["medians"][0], *(crosses if paper else ())],
        ["mean", "median", *(["the paper's mean"] if paper else ())],
        loc="best",
    )
    axes.set_yticks(range(len(models)), [model_label(m) for m in models])
    axes.set(xlim=(0, None), ylim=(len(models) - 0.4, -0.6))
    axes.tick_params(axis="y", length=0)
    style.percent_axis(axes, "absolute percentage error [%]")
    return figure
