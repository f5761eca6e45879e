"""How good the forecast's intervals are: coverage, calibration, width, and the gain from a width for each trip."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import binom, kstest

from tripwatt.arrays import FloatArray
from tripwatt.evaluation.forecast_scores import UPDATE_LEVEL
from tripwatt.report.intervals import NOTE, charge_rows, energy_rows, intervals_table
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import (
    FORECAST_COLOUR,
    INK,
    PLAIN_COLOUR,
    RULE,
    WARM_COLOUR,
    annotate,
    diagonal,
    legend_below,
    plotted,
    row_names,
)
from tripwatt.report.tables import Column, Table, in_kwh, in_percent, number, tabulated
from tripwatt.report.view import Record, View, named_evaluation
from tripwatt.report.words import label, listed, percent


@panel("coverage", "Coverage of the intervals", draws=True)
def coverage(view: View) -> Content:
    """Share of the trips in each interval."""
    if "coverage" not in view.focus:
        return Content(view.no_focus)
    return Content(on_coverage(view), plot_coverage(view), (coverage_table(view),))


def on_coverage(view: View) -> str:
    """How many held-out trips lie in their intervals."""
    score = view.focus
    outside = off_levels(score)
    levels = listed([f"{100 * float(key):g}" for key in score["coverage"]])
    shares = listed([f"{100 * covered:.0f}" for covered in score["coverage"].values()])
    verdict = "no share differs significantly from its nominal level"
    if outside:
        verdict = f"the share differs significantly from the nominal level at {listed(outside)}"
    return (
        f"The intervals of {levels} % contain the measured energy of {shares} % of the trips; {verdict} (Clopper-Pearson, 95 %; {view.note}, "
        f"{view.given})."
    )


def off_levels(score: Record) -> list[str]:
    """Levels whose share of trips differs significantly from them."""
    bounds = score["coverage_ci95"].items()
    return [f"{100.0 * float(key):g} %" for key, (low, high) in bounds if not low <= float(key) <= high]


def coverage_table(view: View) -> Table:
    """Share of the trips in each interval, with its confidence intervals, and the interval's mean width."""
    score = view.focus
    return tabulated(
        view.captioned(f"Intervals of held-out trips, {view.given}"),
        score["coverage"],
        Column("Level", lambda key: f"{100 * float(key):g} %"),
        in_percent("Inside [%]", score["coverage"].get),
        in_percent("Clopper-Pearson 95 %", score["coverage_ci95"].get),
        in_percent("Bootstrap 95 %", score["coverage_bootstrap95"].get),
        in_kwh("Mean width [kWh]", score["interval_width_wh"].get),
    )


def plot_coverage(view: View) -> Figure:
    """Share of trips inside the interval against its nominal level, with Clopper-Pearson intervals."""
    figure, axes = plotted(view, 3.9, "How often the interval holds the measured energy", view.note_given)
    diagonal(axes, 0.4, "inside [% of trips]", "nominal level [%]")
    for place, (key, covered) in enumerate(view.focus["coverage"].items()):
        level, bounds = float(key), view.focus["coverage_ci95"][key]
        axes.plot([level, level], bounds, color=FORECAST_COLOUR, lw=2.2, solid_capstyle="butt")
        axes.plot(level, covered, "o", color=FORECAST_COLOUR, ms=7, gid=f"coverage-{place}")
        offset, side = ((-8, 4), "right") if level < 0.93 else ((10, -14), "left")
        annotate(axes, f"{100 * covered:.0f} %", (level, covered), offset, size=8.5, ha=side)
    axes.plot([], [], "-o", color=FORECAST_COLOUR, label="held-out trips, 95 % Clopper-Pearson interval")
    axes.set(xlim=(0.4, 1.0), ylim=(0.25, 1.02))
    return legend_below(figure)


def _scored_sets(view: View) -> list[tuple[str, Record, int]]:
    """Name, scores of the forecast and number of trips of every set of trips with forecasts."""
    scored = [(e, (e.get("models") or {}).get(view.protocol.focus, {})) for e in view.evaluations]
    return [(named_evaluation(e), score, int(e["n_trips"])) for e, score in scored if "coverage" in score]


@panel("regimes", "Trips unlike those that were learned from", wide=True)
def regimes(view: View) -> Content:
    """Error, coverage and width where the scored trips are of another kind, beside leave-one-trip-out."""
    if len(_scored_sets(view)) < 2:
        return Content("No other kind of trips was scored.")
    said = f"{on_sets(view)} Nothing in the model is chosen by the kind of trip. {NOTE}"
    return Content(said, tables=(regimes_table(view), coverage_by_set(view)))


def on_sets(view: View) -> str:
    """What the intervals of 50 and 90 % hold over all sets of held-out trips, and where a share is off its level."""
    scored = _scored_sets(view)
    shares = {key: [score["coverage"][key] for _, score, _ in scored] for key in ("0.5", "0.9")}
    spans = [
        f"{100.0 * float(key):g} % interval holds {100.0 * min(some):.0f} to {100.0 * max(some):.0f} %"
        for key, some in shares.items()
    ]
    off = [f"{level} in {name}" for name, score, _ in scored for level in off_levels(score)]
    verdict = "No share differs significantly from its level"
    if off:
        verdict = f"It differs significantly from its level at: {listed(off)}"
    said = f"Over {len(scored)} sets of held-out trips the {' and the '.join(spans)} of the trips."
    return f"{said} {verdict} (Clopper-Pearson, 95 %)."


def regimes_table(view: View) -> Table:
    """A row for each evaluation of the forecast."""
    return tabulated(
        view.captioned(f"Held-out trips by kind, {view.given}"),
        [{**score, "name": name} for name, score, _ in _scored_sets(view)],
        Column("Scored", "name"),
        in_percent("Mean error [%]", "mape"),
        in_percent("Bias [%]", "bias"),
    )


def coverage_by_set(view: View) -> Table:
    """Coverage, width and the width that was needed, of energy and charge, for every set of held-out trips."""
    rows: list[tuple[str, ...]] = []
    for name, score, trips in _scored_sets(view):
        rows += energy_rows(name, score, trips)
        rows += charge_rows(name, score.get("arrival") or {}, UPDATE_LEVEL)
    return intervals_table(view.captioned(f"Intervals of held-out trips by kind, {view.given}"), rows)


PIT_BINS: Final = 10


@panel("pit", "Calibration of the whole distribution", draws=True)
def pit(view: View) -> Content:
    """Whether the measured energy is uniformly distributed over the quantiles of the forecast."""
    if view.forecast is None:
        return Content(view.no_focus)
    values = view.forecast.trips["pit"].to_numpy(dtype=np.float64)
    return Content(on_pit(values, view.given), plot_pit(view, values))


def on_pit(pit: FloatArray, given: str) -> str:
    """The share of the trips above the median, and a test of uniformity."""
    test = kstest(pit, "uniform")
    verdict = "do not differ" if test.pvalue >= 0.05 else "differ"
    return (
        f"Of {len(pit)} trips, {percent(float(np.mean(pit > 0.5)), 0)} took more energy than the median of their forecast. The "
        f"values {verdict} significantly from a uniform distribution (Kolmogorov-Smirnov, p = {test.pvalue:.2f}), {given}."
    )


def plot_pit(view: View, pit: FloatArray) -> Figure:
    """Histogram of the probability that the forecast gave to less than was measured; flat for a calibrated forecast."""
    figure, axes = plotted(view, 3.2, "Where the measured energy falls in the forecast", view.note_given)
    n = len(pit)
    low, high = binom.ppf([0.025, 0.975], n, 1.0 / PIT_BINS)
    axes.axhspan(low, high, color=RULE, alpha=0.5, lw=0, label="95 % of the bars of a calibrated forecast")
    axes.axhline(n / PIT_BINS, color=INK, lw=1.0, ls=(0, (3, 2)))
    axes.hist(
        pit, bins=np.linspace(0, 1, PIT_BINS + 1).tolist(), color=FORECAST_COLOUR, alpha=0.8, rwidth=0.92
    )
    axes.set(xlim=(0, 1), xlabel="probability integral transform", ylabel="trips")
    return legend_below(figure)


@panel("widths", "Width of the intervals", draws=True)
def widths(view: View) -> Content:
    """The 90 % interval of short and of long trips."""
    if view.forecast is None:
        return Content(view.no_focus)
    trips = view.forecast.trips
    return Content(on_widths(trips, view.given), plot_widths(view, trips))


def on_widths(trips: pd.DataFrame, given: str) -> str:
    """Mean widths of the 90 % interval."""
    width = (trips["high_90"] - trips["low_90"]).to_numpy(dtype=np.float64)
    short = trips["distance_m"].to_numpy() <= np.median(trips["distance_m"])
    said = f"The mean width of the 90 % interval is {number(float(width.mean()), 1e-3)} kWh"
    if short.any() and not short.all():
        said += (
            f": {number(float(width[short].mean()), 1e-3)} kWh on the shorter half of the trips, "
            f"{number(float(width[~short].mean()), 1e-3)} kWh on the longer"
        )
    return f"{said}, {given}."


def plot_widths(view: View, trips: pd.DataFrame) -> Figure:
    """Half width of the 90 % interval and the error of each trip, against the trip's length."""
    figure, axes = plotted(view, 3.9, "Half width of the interval and error of each trip", view.note_given)
    km = trips["distance_m"].to_numpy(dtype=np.float64) / 1e3
    half = (trips["high_90"] - trips["low_90"]).to_numpy(dtype=np.float64) / 2e3
    error = (trips["observed_energy_wh"] - trips["energy_wh"]).abs().to_numpy(dtype=np.float64) / 1e3
    missed = error > half
    axes.vlines(km, 0.0, half, color=RULE, lw=1.2)
    axes.plot(km, half, "_", color=FORECAST_COLOUR, ms=9, mew=2.2, label="half width of the 90 % interval")
    axes.plot(km[~missed], error[~missed], "o", color=INK, ms=3.5, label="error, inside")
    axes.plot(km[missed], error[missed], "X", color=WARM_COLOUR, ms=6.5, label="error, outside")
    ends = {"xlim": (0, 1.03 * float(km.max())), "ylim": (0, 1.08 * float(max(half.max(), error.max())))}
    axes.set(xlabel="trip [km]", ylabel="energy [kWh]", **ends)
    axes.grid(axis="y")
    return legend_below(figure, 2)


@panel("crps", "Gain from an interval width for each trip", draws=True)
def crps(view: View) -> Content:
    """The score of the distribution, with one width for all trips and without an interval."""
    score = view.focus
    if "crps_same_width_wh" not in score:
        return Content(view.no_focus)
    return Content(on_crps(score, view.given), plot_crps(view))


def on_crps(score: Record, given: str) -> str:
    """The gain in CRPS from a width for each trip."""
    own, same = score["crps_wh"], score["crps_same_width_wh"]
    word = "lower" if own < same else "higher"
    return (
        f"The mean CRPS is {number(own, 1.0, 0)} Wh with a width for each trip, {percent(abs(same - own) / same)} {word} than "
        f"with the mean width for every trip ({number(same, 1.0, 0)} Wh). The CRPS of a forecast without an interval is its "
        f"mean absolute error; all {given}."
    )


def crps_rows(view: View) -> list[tuple[str, float, str]]:
    """(name, CRPS [Wh], colour) of the forecast, of itself with one width, and of its rivals without an interval."""
    score, focus = view.focus, view.protocol.focus or ""
    described = model_style(focus)
    rivals = [m for m in (*described.rivals, described.without_physics) if m is not None and m in view.scores]
    return [
        (label(focus), score["crps_wh"], FORECAST_COLOUR),
        ("same, one width for all trips", score["crps_same_width_wh"], WARM_COLOUR),
        ("same, best one width in hindsight", score["crps_best_same_width_wh"], WARM_COLOUR),
        *((f"{label(m)}, no interval", view.scores[m]["crps_wh"], PLAIN_COLOUR) for m in rivals),
    ]


def plot_crps(view: View) -> Figure:
    """CRPS as bars."""
    rows = crps_rows(view)
    height = 1.2 + 0.3 * len(rows)
    figure, axes = plotted(view, height, "Score of the whole distribution (CRPS)", view.note_given)
    largest = max(value for _, value, _ in rows)
    for row, (_, value, colour) in enumerate(rows):
        axes.barh(row, value, color=colour, height=0.62)
        annotate(axes, f"{value:.0f}", (value, row), (4, 0), size=8.5, va="center")
    row_names(axes, [name for name, _, _ in rows])
    axes.set(xlim=(0, 1.12 * largest), xlabel="mean CRPS [Wh], lower is better")
    return figure
