"""How the errors of the trips are distributed: histograms and boxes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tripwatt.arrays import FloatArray
from tripwatt.report import style
from tripwatt.report.model_styles import model_style, ordered
from tripwatt.report.panel import Content, panel
from tripwatt.report.view import View, plain, signed_errors
from tripwatt.report.words import label, listed, percent


@panel("error-distribution", "Error distribution over the folds", draws=True)
def error_distribution(view: View) -> Content:
    """Histograms of the signed errors."""
    folds = view.main_folds
    if folds.empty:
        return Content("No fold is known, so there is no distribution.")
    return Content(on_distribution(view), plot_error_distribution(view, folds))


@panel("error-boxes", "Box plot of all models", draws=True)
def error_boxes(view: View) -> Content | None:
    """Box plots of the absolute errors."""
    folds = view.main_folds
    if folds.empty:
        return None
    return Content(on_boxes(view), plot_error_boxes(view, folds))


@panel("benchmark-boxes", "Physics alone, hybrid, and boosting alone", draws=True)
def benchmark_boxes(view: View) -> Content | None:
    """A hybrid beside its simulation alone and beside the same learner without it."""
    folds = view.main_folds
    if folds.empty:
        return None
    present = set(folds["model"])
    pairs = ((m, model_style(m).without_physics) for m in view.models)
    pair = next(((m, alone) for m, alone in pairs if alone is not None and {m, alone} <= present), None)
    if pair is None:
        return Content("The benchmark needs boosting with and without physics; this run lacks one of them.")
    shown = [m for m in (model_style(pair[0]).stands_on, *pair) if m is not None and m in present]
    title = "Physics, hybrid boosting, boosting without physics"
    return Content(on_benchmark(view, *pair), plot_error_boxes(view, folds, shown, title))


def on_distribution(view: View) -> str:
    """The median error, and the number of trips with an error above 20 %."""
    wide = view.main_errors
    if view.best is None or view.best not in wide:
        return "No fold is known."
    errors = wide[view.best].dropna()
    far = int((errors > 0.2).sum())
    text = (
        f"With {label(view.best)}, half of the trips have an error below {percent(float(errors.median()))}, "
        f"and {far} of {len(errors)} have an error above 20 %"
    )
    if view.physics in wide and view.physics != view.best:
        text += f"; with {label(str(view.physics))}, {int((wide[view.physics] > 0.2).sum())} have"
    return f"{text}."


def on_boxes(view: View) -> str:
    """Where the middle half of the errors lies."""
    wide = view.main_errors
    names = [m for m in (view.best, view.physics) if m is not None and m in wide]
    parts = []
    for model in dict.fromkeys(names):
        low, high = wide[model].quantile([0.25, 0.75])
        parts.append(f"{100 * low:.1f} to {100 * high:.1f}\u00a0% with {label(model)}")
    return f"The middle half of the errors is {listed(parts)}." if parts else "No fold is known."


def on_benchmark(view: View, hybrid: str, alone: str) -> str:
    """How the error of a learner changes without the simulation."""
    both = view.main_errors[[hybrid, alone]].dropna()
    closer = float((both[hybrid] < both[alone]).mean())
    means = both.mean()
    gap = means[alone] - means[hybrid]
    word = "higher" if gap > 0 else "lower"
    return (
        f"Without the simulation, the mean error of the same boosting is {percent(means[alone])} instead of "
        f"{percent(means[hybrid])}, {abs(100 * gap):.1f} percentage points {word}. With the simulation the error is smaller "
        f"on {percent(closer, 0)} of the trips."
    )


def plot_error_distribution(view: View, folds: pd.DataFrame) -> Figure:
    """Histogram and rug of the signed error of every model over the folds, on one common axis.

    Parameters
    ----------
    view : View
    folds : DataFrame
        Columns `trip, model, observed_energy_wh, predicted_energy_wh`.
    """
    models = ordered(map(str, folds["model"].unique()))
    errors = {m: values for m in models if len(values := signed_errors(folds, m))}
    models = list(errors)
    every = np.concatenate(list(errors.values())) if errors else np.empty(0)
    limit = max(0.2, np.ceil(10 * style.cut_at(every)) / 10)
    bins = np.linspace(-limit, limit, 41)
    note = "\n".join(filter(None, [view.note, "height: number of trips, every row to its own scale"]))
    head, height = ("Error of every trip, by model", note), 1.5 + 0.72 * len(models)
    figure, panels = style.stacked(view, height, head, max(len(models), 1), sharex=True)
    for axes, model in zip(panels, models, strict=False):
        values, colour = errors[model], model_style(model).colour
        clipped, below = np.clip(values, -limit, limit), np.full(len(values), -0.09)
        axes.hist(clipped, bins=bins.tolist(), color=colour, alpha=0.75, lw=0)
        rug = axes.plot(clipped, below, "|", color=colour, ms=6, mew=0.9)[0]
        rug.set(transform=axes.get_xaxis_transform(), clip_on=False, gid=f"rug-{models.index(model)}")
        axes.axvline(0.0, color=style.INK, lw=0.9)
        axes.axvline(float(np.median(values)), color=style.INK, lw=1.1, ls=(0, (2, 2)))
        axes.set(xlim=(-limit, limit), yticks=[])
        axes.spines["left"].set_visible(False)
        outside = int((np.abs(values) > limit).sum())
        beyond = f"   ({outside} beyond the axis, drawn at its edge)" if outside else ""
        axes.set_title(f"{plain(model_style(model).label, 32)}{beyond}", fontsize=8.5, pad=2)
        axes.tick_params(axis="x", length=2 if axes is not panels[-1] else 4, pad=7)
    style.percent_axis(
        panels[-1], "(predicted − measured) / measured [%];  dashed: median;  ticks: single trips"
    )
    for axes in panels:
        axes.grid(axis="x")
    return figure


def _box(axes: Axes, row: float, values: FloatArray, colour: str, limit: float, half: float = 0.24) -> None:
    """One horizontal box: quartiles, median, whiskers to the last value within 1.5 interquartile ranges."""
    from matplotlib.patches import Rectangle

    first, median, third = np.quantile(values, [0.25, 0.5, 0.75])
    reach = 1.5 * (third - first)
    low, high = values[values >= first - reach].min(), values[values <= third + reach].max()
    axes.plot([low, first], [row, row], color=colour, lw=1.3)
    axes.plot([third, high], [row, row], color=colour, lw=1.3)
    axes.add_patch(
        Rectangle((first, row - half), third - first, 2 * half, fc=colour, ec=colour, alpha=0.3, lw=1.2)
    )
    axes.plot([median, median], [row - half, row + half], color=style.INK, lw=1.8)
    axes.plot(
        min(float(values.mean()), limit), row, "D", color=style.PAPER_COLOUR, mec=style.INK, ms=4.5, zorder=5
    )


def plot_error_boxes(
    view: View, folds: pd.DataFrame, models: Sequence[str] | None = None, title: str = "Errors of all models"
) -> Figure:
    """Box plot of the APE of each model over the folds, every trip as a point; the paper's means as crosses.

    Parameters
    ----------
    view : View
    folds : DataFrame
        Columns `trip, model, ape`.
    models : sequence of str, optional
        Which models, in this order; all in table order by default.
    title : str
        Of the figure.
    """
    models = list(models) if models is not None else ordered(map(str, folds["model"].unique()))
    known = folds[np.isfinite(folds["ape"].to_numpy(dtype=np.float64))]
    values = {m: known.loc[known["model"] == m, "ape"].to_numpy(dtype=np.float64) for m in models}
    every = np.concatenate(list(values.values())) if values else np.empty(0)
    limit = style.cut_at(every)
    figure, axes = style.plotted(view, 1.55 + 0.52 * len(models), title, view.note)
    paper = view.published
    for row, model in enumerate(models):
        errors, colour = values[model], model_style(model).colour
        if not len(errors):
            continue
        # a fixed low-discrepancy jitter: points of one row stay apart without a random state
        shift = 0.3 * (((np.arange(len(errors)) * 0.618034) % 1.0) - 0.5)
        inside = errors <= limit
        look: dict[str, Any] = {"s": 7, "color": colour, "alpha": 0.7, "lw": 0, "zorder": 3}
        axes.scatter(errors[inside], row + shift[inside], gid=f"trips-{row}", clip_on=False, **look)
        style.mark_beyond(axes, errors, limit, row, colour)
        _box(axes, row, errors, colour, limit)
        if model in paper:
            axes.plot(paper[model], row - 0.38, "x", color=style.INK, ms=5, mew=1.3)
    axes.plot([], [], "D", color=style.PAPER_COLOUR, mec=style.INK, ms=4.5, label="mean")
    axes.plot([], [], color=style.INK, lw=1.8, label="median")
    if set(paper) & set(models):
        axes.plot([], [], "x", color=style.INK, ms=5, mew=1.3, ls="", label="the paper's mean")
    style.model_rows(axes, models)
    axes.set_xlim(0, limit)
    style.percent_axis(axes, "absolute percentage error [%]")
    return style.legend_below(figure, 3)
