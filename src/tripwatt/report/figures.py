"""Figures of an evaluation: each `plot_` takes plain frames and gives a matplotlib `Figure`, and keeps no state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.report.models import PAPER, covariate_words, model_style, ordered
from tripwatt.report.style import (
    INK,
    PAPER_COLOUR,
    RULE,
    cut_at,
    mark_beyond,
    model_rows,
    new_figure,
    percent_axis,
    styled,
)
from tripwatt.report.view import Record, absolute_errors, named_evaluation, plain, signed_errors
from tripwatt.units import M_S_PER_KM_H

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_TRIPS: Final = 60
"""Trips that the figure of errors by trip shows; the table beside it always holds them all."""


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


@styled
def plot_error_distribution(folds: pd.DataFrame, *, note: str = "", synthetic: bool = False) -> Figure:
    """Histogram and rug of the signed error of every model over the folds, on one common axis.

    Parameters
    ----------
    folds : DataFrame
        Columns `trip, model, observed_energy_wh, predicted_energy_wh`.
    note : str
        Which evaluation it is, for the title.
    synthetic : bool
        Whether the trips are made up.
    """
    models = ordered(map(str, folds["model"].unique()))
    errors = {m: found for m in models if len(found := signed_errors(folds, m))}
    models = list(errors)
    every = np.concatenate(list(errors.values())) if errors else np.empty(0)
    limit = max(0.2, np.ceil(10 * cut_at(every)) / 10)
    bins = np.linspace(-limit, limit, 41)
    head = "\n".join(filter(None, [note, "height: number of trips, every row to its own scale"]))
    figure = new_figure(1.5 + 0.72 * len(models), "Error of every trip, by model", head, synthetic)
    panels = figure.subplots(max(len(models), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axes, model in zip(panels, models, strict=False):
        values, colour = errors[model], model_style(model).colour
        axes.hist(np.clip(values, -limit, limit), bins=bins.tolist(), color=colour, alpha=0.75, lw=0)
        rug = axes.plot(
            np.clip(values, -limit, limit), np.full(len(values), -0.09), "|", color=colour, ms=6, mew=0.9
        )[0]
        rug.set(transform=axes.get_xaxis_transform(), clip_on=False, gid=f"rug-{models.index(model)}")
        axes.axvline(0.0, color=INK, lw=0.9)
        axes.axvline(float(np.median(values)), color=INK, lw=1.1, ls=(0, (2, 2)))
        axes.set_xlim(-limit, limit)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        outside = int((np.abs(values) > limit).sum())
        beyond = f"   ({outside} beyond the axis, drawn at its edge)" if outside else ""
        axes.set_title(f"{plain(model_style(model).label, 32)}{beyond}", fontsize=8.5, pad=2)
        axes.tick_params(axis="x", length=2 if axes is not panels[-1] else 4, pad=7)
    percent_axis(panels[-1], "(predicted − measured) / measured [%];  dashed: median;  ticks: single trips")
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
    axes.plot([median, median], [row - half, row + half], color=INK, lw=1.8)
    axes.plot(min(float(values.mean()), limit), row, "D", color=PAPER_COLOUR, mec=INK, ms=4.5, zorder=5)


@styled
def plot_error_boxes(
    folds: pd.DataFrame,
    *,
    models: Sequence[str] | None = None,
    paper: Mapping[str, float] | None = None,
    title: str = "Errors of all models",
    note: str = "",
    synthetic: bool = False,
) -> Figure:
    """Box plot of the APE of each model over the folds, every trip as a point.

    Parameters
    ----------
    folds : DataFrame
        Columns `trip, model, ape`.
    models : sequence of str, optional
        Which models, in this order; all in table order by default.
    paper : mapping of str to float, optional
        Published mean errors, drawn as crosses.
    title, note : str
        Head of the figure.
    synthetic : bool
        Whether the trips are made up.
    """
    models = list(models) if models is not None else ordered(map(str, folds["model"].unique()))
    known = folds[np.isfinite(folds["ape"].to_numpy(dtype=np.float64))]
    values = {m: known.loc[known["model"] == m, "ape"].to_numpy(dtype=np.float64) for m in models}
    every = np.concatenate(list(values.values())) if values else np.empty(0)
    limit = cut_at(every)
    figure = new_figure(1.55 + 0.52 * len(models), title, note, synthetic)
    axes = figure.add_subplot()
    for row, model in enumerate(models):
        found, colour = values[model], model_style(model).colour
        if not len(found):
            continue
        # a fixed low-discrepancy jitter: points of one row stay apart without a random state
        shift = 0.3 * (((np.arange(len(found)) * 0.618034) % 1.0) - 0.5)
        inside = found <= limit
        axes.scatter(
            found[inside],
            row + shift[inside],
            s=7,
            color=colour,
            alpha=0.7,
            lw=0,
            gid=f"trips-{row}",
            zorder=3,
            clip_on=False,
        )
        mark_beyond(axes, found, limit, row, colour)
        _box(axes, row, found, colour, limit)
        if paper and model in paper:
            axes.plot(paper[model], row - 0.38, "x", color=INK, ms=5, mew=1.3)
    axes.plot([], [], "D", color=PAPER_COLOUR, mec=INK, ms=4.5, label="mean")
    axes.plot([], [], color=INK, lw=1.8, label="median")
    if paper and set(paper) & set(models):
        axes.plot([], [], "x", color=INK, ms=5, mew=1.3, ls="", label="the paper's mean")
    model_rows(axes, models)
    axes.set_xlim(0, limit)
    percent_axis(axes, "absolute percentage error [%]")
    figure.legend(loc="outside lower left", ncols=3)
    return figure


def _thinned(frame: pd.DataFrame, most: int = 500) -> pd.DataFrame:
    """At most `most` rows evenly spread, the first and the last among them."""
    if len(frame) <= most:
        return frame
    return frame.iloc[np.unique(np.linspace(0, len(frame) - 1, most).round().astype(np.int64))]


@styled
def plot_trip_energy(
    series: Mapping[str, pd.DataFrame],
    selected: Sequence[tuple[str, str, float]],
    model: str,
    *,
    simulated: str | None = "physics-paper",
    synthetic: bool = False,
) -> Figure:
    """Cumulative energy along trips: measured, simulated and corrected, with the speed below.

    Parameters
    ----------
    series : mapping of str to DataFrame
        By trip: `time_s, speed_m_s, observed_energy_wh` and a cumulative energy [Wh] per model.
    selected : sequence of (role, trip, ape)
        Which trips, e.g. `("Worst", "B28", 0.31)`.
    model : str
        The corrected prediction.
    simulated : str or None
        The simulation that it corrects.
    synthetic : bool
        Whether the trips are made up.
    """
    figure = new_figure(
        1.0 + 2.55 * len(selected), f"Energy along the trip: {model_style(model).label}", "", synthetic
    )
    grid = figure.add_gridspec(2 * len(selected), 1, height_ratios=[3.2, 1.0] * len(selected))
    curves: list[tuple[str, str, str, Any, float]] = [("observed_energy_wh", "measured", INK, "-", 1.8)]
    if simulated:
        curves.append((simulated, "simulated", model_style(simulated).colour, (0, (5, 2)), 1.6))
    curves.append((model, "corrected", model_style(model).colour, "-", 1.6))
    for number, (role, trip, ape) in enumerate(selected):
        frame = _thinned(series[trip])
        minutes = (frame["time_s"] - series[trip]["time_s"].iloc[0]) / 60.0
        top = figure.add_subplot(grid[2 * number])
        below = figure.add_subplot(grid[2 * number + 1], sharex=top)
        for column, label, colour, dash, width in curves:
            if column in frame:
                line = top.plot(
                    minutes, frame[column] / 1000.0, color=colour, ls=dash, lw=width, label=label
                )[0]
                line.set_gid(f"energy-{number}-{label}")
        top.axhline(0.0, color=RULE, lw=0.8, zorder=0)
        top.set_title(f"{role} trip: {plain(trip, 34)}, error {100 * ape:.1f} %")
        top.set_ylabel("energy [kWh]")
        top.grid(axis="y")
        top.tick_params(labelbottom=False)
        below.fill_between(minutes, frame["speed_m_s"] / M_S_PER_KM_H, color=INK, alpha=0.35, lw=0)
        below.set_ylabel("km/h")
        below.set_ylim(bottom=0)
        below.set_xlim(0, float(minutes.iloc[-1]) or 1.0)
        if number == len(selected) - 1:
            below.set_xlabel("time since departure [min]")
        if number == 0:
            figure.legend(*top.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


@styled
def plot_trip_errors(
    folds: pd.DataFrame, model: str, against: str | None = None, *, note: str = "", synthetic: bool = False
) -> Figure:
    """APE of a model on each trip, with a line to the error of another model on the same trip.

    Parameters
    ----------
    folds : DataFrame
        Columns `trip, model, ape`.
    model : str
        Sorted by this model's error; the `MOST_TRIPS` with the largest are shown.
    against : str or None
        The model to compare with.
    note : str
        Which evaluation it is, for the title.
    synthetic : bool
        Whether the trips are made up.
    """
    wide = absolute_errors(folds).dropna(subset=model).sort_values(model, kind="stable", ascending=False)
    total = len(wide)
    wide = wide.head(MOST_TRIPS)
    shown = f"the {len(wide)} largest of {total}" if total > len(wide) else f"all {total} trips"
    figure = new_figure(1.5 + 0.165 * len(wide), f"Error by trip, {shown}", note, synthetic)
    axes = figure.add_subplot()
    rows = np.arange(len(wide))
    own = wide[model].to_numpy(dtype=np.float64)
    drawn = [own]
    if against in wide.columns:
        other = wide[against].to_numpy(dtype=np.float64)
        drawn.append(other)
    limit = cut_at(np.concatenate(drawn))
    if len(drawn) == 2:
        axes.hlines(rows, np.minimum(own, limit), np.minimum(drawn[1], limit), color=RULE, lw=1.4, zorder=1)
        style = model_style(str(against))
        axes.plot(
            np.minimum(drawn[1], limit),
            rows,
            "o",
            mfc=PAPER_COLOUR,
            mec=style.colour,
            ms=4,
            label=style.label,
            gid="other",
            clip_on=False,
        )
    else:
        axes.hlines(rows, 0, np.minimum(own, limit), color=RULE, lw=1.4, zorder=1)
    style = model_style(model)
    axes.plot(
        np.minimum(own, limit),
        rows,
        "o",
        color=style.colour,
        ms=4.5,
        label=style.label,
        gid="own",
        clip_on=False,
    )
    axes.set_yticks(rows, [plain(trip, 18) for trip in wide.index], fontsize=7.5)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(wide) - 0.3, -0.7)
    axes.set_xlim(0, limit)
    axes.spines["left"].set_visible(False)
    percent_axis(axes, "absolute percentage error [%]")
    figure.legend(loc="outside lower left", ncols=2)
    return figure


@styled
def plot_paired_differences(paired: Sequence[Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Forest plot of paired differences of the mean APE: an interval that leaves out 0 is drawn solid.

    Parameters
    ----------
    paired : sequence of mapping
        `{a, b, diff, ci95}` as in `results.json`, `diff` = mean APE of `a` minus that of `b`.
    note : str
        Which evaluation it is, for the title.
    synthetic : bool
        Whether the trips are made up.
    """
    figure = new_figure(1.5 + 0.34 * len(paired), "Paired differences over the same trips", note, synthetic)
    axes = figure.add_subplot()
    seconds = {str(pair["b"]) for pair in paired}
    common = model_style(seconds.pop()).label if len(seconds) == 1 else ""
    labels = []
    for row, pair in enumerate(paired):
        low, high = pair["ci95"]
        apart = low > 0 or high < 0
        colour = model_style(str(pair["a"])).colour
        axes.plot(
            [low, high], [row, row], color=colour, lw=2.0 if apart else 1.2, ls="-" if apart else (0, (3, 2))
        )
        axes.plot(
            pair["diff"],
            row,
            "o",
            color=colour if apart else PAPER_COLOUR,
            mec=colour,
            ms=5.5,
            gid=f"pair-{row}",
        )
        first = plain(model_style(str(pair["a"])).label, 28)
        labels.append(first if common else f"{first}\n− {plain(model_style(str(pair['b'])).label, 28)}")
    axes.axvline(0.0, color=INK, lw=0.9)
    axes.set_yticks(range(len(paired)), labels)
    axes.set_ylim(len(paired) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    difference = f"mean error minus that of {common}" if common else "difference of mean errors"
    percent_axis(axes, f"{difference}\n[percentage points];  solid: 95 % interval without 0")
    return figure


@styled
def plot_learning_curves(curves: pd.DataFrame, *, synthetic: bool = False) -> Figure:
    """Error against boosting rounds, one panel per model: each fold thin, their mean thick, its lowest point marked.

    Parameters
    ----------
    curves : DataFrame
        Columns `fold, rounds, error` and, where several models are in it, `model`.
    synthetic : bool
        Whether the trips are made up.
    """
    models = curve_models(curves)
    height = 1.0 + 2.3 * len(models)
    figure = new_figure(height, "Learning curves", "thin: each fold; thick: their mean", synthetic)
    panels = figure.subplots(len(models), 1, squeeze=False)[:, 0]
    for number, (axes, (model, part)) in enumerate(zip(panels, models.items(), strict=True)):
        colour = model_style(model).colour
        for _, fold in part.groupby("fold", sort=False, observed=True):
            line = _thinned(fold.sort_values("rounds"), 60)
            axes.plot(line["rounds"], line["error"], color=colour, lw=0.6, alpha=0.35)
        mean = mean_learning_curve(part)
        axes.plot(mean.index, mean.to_numpy(), color=colour, lw=2.2, gid=f"mean-{number}")
        lowest, error = lowest_round(part), float(mean.min())
        axes.plot(lowest, error, "o", color=PAPER_COLOUR, mec=INK, ms=6, zorder=5)
        side = "right" if lowest > 0.5 * float(mean.index.max()) else "left"
        axes.annotate(
            f"lowest at {lowest} rounds",
            (lowest, error),
            (0, 9),
            textcoords="offset points",
            ha=side,
            fontsize=8.5,
        )
        axes.set_title(plain(model_style(model).label, 40))
        axes.set_ylabel("error on left-out\ntraining trips")
        axes.grid(axis="y")
    panels[-1].set_xlabel("boosting rounds")
    return figure


def curve_models(curves: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The curves by model in table order; curves that name no model are those of `boosting`."""
    if "model" not in curves:
        return {"boosting": curves}
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


@styled
def plot_importances(importances: pd.DataFrame, *, synthetic: bool = False) -> Figure:
    """Importance of each covariate, one panel per model; the bar is the mean over what the table holds.

    Parameters
    ----------
    importances : DataFrame
        Columns `model, covariate, importance`.
    synthetic : bool
        Whether the trips are made up.
    """
    mean = mean_importances(importances)
    models = ordered(map(str, mean["model"].unique()))
    counts = [int((mean["model"] == m).sum()) for m in models]
    figure = new_figure(
        1.2 + 0.4 * len(models) + 0.25 * sum(counts), "What the correctors use", "", synthetic
    )
    panels = figure.subplots(len(models), 1, sharex=False, squeeze=False, height_ratios=counts)[:, 0]
    for axes, model in zip(panels, models, strict=True):
        rows = mean[mean["model"] == model].sort_values("importance", ascending=False, kind="stable")
        places = np.arange(len(rows))
        bars = axes.barh(places, rows["importance"], color=model_style(model).colour, height=0.65)
        for place, bar in enumerate(bars):
            bar.set_gid(f"importance-{models.index(model)}-{place}")
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
