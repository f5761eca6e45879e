"""Inside the correctors: the importance of the covariates, and the error by the number of boosting rounds."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tripwatt.report.covariates import covariate_words
from tripwatt.report.model_styles import model_style, ordered
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, PAPER_COLOUR, annotate, stacked, thinned
from tripwatt.report.view import View, plain
from tripwatt.report.words import label, listed


@panel("importances", "Importance of the covariates", draws=True)
def importances(view: View) -> Content:
    """The most important covariates of each corrector."""
    if view.importances is None:
        return Content("No importances: this run has no corrector that reports them.")
    return Content(on_importances(view.importances), plot_importances(view, view.importances))


def on_importances(importances: pd.DataFrame) -> str:
    """The two most important covariates of each corrector."""
    mean = mean_importances(importances)
    parts = []
    for model, rows in mean.groupby("model", sort=False, observed=True):
        first = rows.sort_values("importance", ascending=False, kind="stable")["covariate"].head(2)
        parts.append(f"{listed([plain(covariate_words(str(c))) for c in first])} for {label(str(model))}")
    return f"The most important covariates are {'; '.join(parts)}."


def plot_importances(view: View, importances: pd.DataFrame) -> Figure:
    """Importance of each covariate, one panel per model; the bar is the mean over what the table holds.

    Parameters
    ----------
    view : View
    importances : DataFrame
        Columns `model, covariate, importance`.
    """
    mean = mean_importances(importances)
    models = ordered(map(str, mean["model"].unique()))
    counts = [int((mean["model"] == m).sum()) for m in models]
    height = 1.2 + 0.4 * len(models) + 0.25 * sum(counts)
    head = ("What the correctors use", "")
    figure, panels = stacked(view, height, head, len(models), height_ratios=counts)
    for number, (axes, model) in enumerate(zip(panels, models, strict=True)):
        rows = mean[mean["model"] == model].sort_values("importance", ascending=False, kind="stable")
        places = np.arange(len(rows))
        bars = axes.barh(places, rows["importance"], color=model_style(model).colour, height=0.65)
        for place, bar in enumerate(bars):
            bar.set_gid(f"importance-{number}-{place}")
        axes.set_yticks(places, [plain(covariate_words(str(c)), 30) for c in rows["covariate"]])
        axes.invert_yaxis()
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.axvline(0.0, color=INK, lw=0.9)
        axes.set_title(plain(model_style(model).label, 40))
        axes.grid(axis="x")
    panels[-1].set_xlabel("importance by permutation of the covariate")
    return figure


def mean_importances(importances: pd.DataFrame) -> pd.DataFrame:
    """One row per model and covariate: the mean importance."""
    by = importances.groupby(["model", "covariate"], sort=False, observed=True)
    return by["importance"].mean().reset_index()


@panel("learning-curve", "Learning curve", draws=True)
def learning_curve(view: View) -> Content:
    """At how many rounds the error is lowest."""
    curves = view.learning_curves
    if curves is None:
        return Content("No learning curve: this run has no boosting with a curve.")
    return Content(on_learning_curves(curves), plot_learning_curves(view, curves))


def on_learning_curves(curves: pd.DataFrame) -> str:
    """Where the mean curve of each model is lowest."""
    parts = []
    for model, part in curve_models(curves).items():
        lowest = lowest_round(part)
        each = part.loc[part.groupby("fold", observed=True)["error"].idxmin(), "rounds"]
        parts.append(
            f"at {lowest} rounds for {label(model)} (mean of {part['fold'].nunique()} folds; in the single folds between "
            f"{int(each.min())} and {int(each.max())})"
        )
    return f"The error on left-out training trips is lowest {' and '.join(parts)}."


def plot_learning_curves(view: View, curves: pd.DataFrame) -> Figure:
    """Error against boosting rounds, one panel per model: each fold thin, their mean thick, its lowest point marked.

    Parameters
    ----------
    view : View
    curves : DataFrame
        Columns `model, fold, rounds, error`.
    """
    models, head = curve_models(curves), ("Learning curves", "thin: each fold; thick: their mean")
    figure, panels = stacked(view, 1.0 + 2.3 * len(models), head, len(models))
    for number, (axes, (model, part)) in enumerate(zip(panels, models.items(), strict=True)):
        colour = model_style(model).colour
        for _, fold in part.groupby("fold", sort=False, observed=True):
            line = thinned(fold.sort_values("rounds"), 60)
            axes.plot(line["rounds"], line["error"], color=colour, lw=0.6, alpha=0.35)
        mean = mean_learning_curve(part)
        axes.plot(mean.index, mean.to_numpy(), color=colour, lw=2.2, gid=f"mean-{number}")
        lowest, error = lowest_round(part), float(mean.min())
        axes.plot(lowest, error, "o", color=PAPER_COLOUR, mec=INK, ms=6, zorder=5)
        side = "right" if lowest > 0.5 * float(mean.index.max()) else "left"
        annotate(axes, f"lowest at {lowest} rounds", (lowest, error), (0, 9), size=8.5, ha=side)
        axes.set(title=plain(model_style(model).label, 40), ylabel="error on left-out\ntraining trips")
        axes.grid(axis="y")
    panels[-1].set_xlabel("boosting rounds")
    return figure


def curve_models(curves: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The curves by model in table order."""
    return {m: curves[curves["model"] == m] for m in ordered(map(str, curves["model"].unique()))}


def mean_learning_curve(curves: pd.DataFrame) -> pd.Series[float]:
    """Mean error over the folds of one model, at the rounds that every fold has."""
    by_round = curves.groupby("rounds", observed=True)["error"]
    complete = by_round.count() == curves["fold"].nunique()
    mean = by_round.mean()
    return mean[complete] if bool(complete.any()) else mean


def lowest_round(curves: pd.DataFrame) -> int:
    """The number of rounds at which the mean curve of one model is lowest."""
    mean = mean_learning_curve(curves)
    return int(mean.index.to_numpy()[int(np.argmin(mean.to_numpy()))])
