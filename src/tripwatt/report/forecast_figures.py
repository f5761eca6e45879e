"""Figures of the forecast protocol: each `plot_` takes plain numbers and frames and gives a matplotlib `Figure`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.report.models import model_style
from tripwatt.report.style import INK, RULE, new_figure, percent_axis, styled
from tripwatt.report.view import Record, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GIVEN: Final = "given the driven speed trace"
HYBRID: Final = "#0f8797"
PLAIN: Final = "#7c7c7c"
WARM: Final = "#d55e00"
PIT_BINS: Final = 10
TOTALS: Final = ("energy_wh", "observed_energy_wh")
LINES: Final[Mapping[str, tuple[str, str, str]]] = {
    "naive_gauge": ("consumption per km so far × all km", PLAIN, "^"),
    "no_update": ("no update: measured + departure forecast of the rest", WARM, "s"),
    "soc_only": ("re-forecast from the state of charge alone", "#7d6bc6", "D"),
    "mape": ("re-forecast", HYBRID, "o"),
}
"""Key in `update` -> words, colour, marker."""


def _note(note: str) -> str:
    return "\n".join(filter(None, [note, GIVEN]))


@styled
def plot_coverage(score: Record, *, note: str = "", synthetic: bool = False) -> Figure:
    """Share of trips inside the interval against its nominal level, with Clopper-Pearson intervals."""
    figure = new_figure(3.9, "How often the interval holds the measured energy", _note(note), synthetic)
    axes = figure.add_subplot()
    axes.plot([0.4, 1.0], [0.4, 1.0], color=RULE, lw=1.5, label="exactly as stated")
    for number, (key, covered) in enumerate(score["coverage"].items()):
        level, (low, high) = float(key), score["coverage_ci95"][key]
        axes.plot([level, level], [low, high], color=HYBRID, lw=2.2, solid_capstyle="butt")
        axes.plot(level, covered, "o", color=HYBRID, ms=7, gid=f"coverage-{number}")
        axes.annotate(
            f"{100 * covered:.0f} %",
            (level, covered),
            (-8, 4) if level < 0.93 else (10, -14),
            textcoords="offset points",
            fontsize=8.5,
            ha="right" if level < 0.93 else "left",
        )
    axes.plot([], [], "-o", color=HYBRID, label="held-out trips, 95 % Clopper-Pearson interval")
    axes.set(xlim=(0.4, 1.0), ylim=(0.25, 1.02))
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f}")
    axes.set_ylabel("inside [% of trips]")
    percent_axis(axes, "nominal level [%]")
    axes.grid(axis="y")
    figure.legend(loc="outside lower left", ncols=1)
    return figure


@styled
def plot_pit(pit: FloatArray, *, note: str = "", synthetic: bool = False) -> Figure:
    """Histogram of the probability that the forecast gave to less than was measured; flat for a calibrated forecast."""
    from scipy.stats import binom

    figure = new_figure(3.2, "Where the measured energy falls in the forecast", _note(note), synthetic)
    axes = figure.add_subplot()
    n = len(pit)
    low, high = binom.ppf([0.025, 0.975], n, 1.0 / PIT_BINS)
    axes.axhspan(low, high, color=RULE, alpha=0.5, lw=0, label="95 % of the bars of a calibrated forecast")
    axes.axhline(n / PIT_BINS, color=INK, lw=1.0, ls=(0, (3, 2)))
    axes.hist(pit, bins=np.linspace(0, 1, PIT_BINS + 1).tolist(), color=HYBRID, alpha=0.8, rwidth=0.92)
    axes.set(xlim=(0, 1), xlabel="probability integral transform", ylabel="trips")
    figure.legend(loc="outside lower left")
    return figure


@styled
def plot_widths(trips: pd.DataFrame, *, note: str = "", synthetic: bool = False) -> Figure:
    """Half width of the 90 % interval and the error of each trip, against the trip's length."""
    figure = new_figure(3.9, "Half width of the interval and error of each trip", _note(note), synthetic)
    axes = figure.add_subplot()
    km = trips["distance_m"].to_numpy(dtype=np.float64) / 1e3
    half = (trips["high_90"] - trips["low_90"]).to_numpy(dtype=np.float64) / 2e3
    error = (trips["observed_energy_wh"] - trips["energy_wh"]).abs().to_numpy(dtype=np.float64) / 1e3
    missed = error > half
    axes.vlines(km, 0.0, half, color=RULE, lw=1.2)
    axes.plot(km, half, "_", color=HYBRID, ms=9, mew=2.2, label="half width of the 90 % interval")
    axes.plot(km[~missed], error[~missed], "o", color=INK, ms=3.5, label="error, inside")
    axes.plot(km[missed], error[missed], "X", color=WARM, ms=6.5, label="error, outside")
    axes.set(xlabel="trip [km]", ylabel="energy [kWh]")
    axes.set_xlim(0, 1.03 * float(km.max()))
    axes.set_ylim(0, 1.08 * float(max(half.max(), error.max())))
    axes.grid(axis="y")
    figure.legend(loc="outside lower left", ncols=2)
    return figure


@styled
def plot_crps(rows: Sequence[tuple[str, float, str]], *, note: str = "", synthetic: bool = False) -> Figure:
    """CRPS as bars; rows of (name, CRPS in Wh, colour)."""
    figure = new_figure(
        1.2 + 0.3 * len(rows), "Score of the whole distribution (CRPS)", _note(note), synthetic
    )
    axes = figure.add_subplot()
    largest = max(value for _, value, _ in rows)
    for row, (_, value, colour) in enumerate(rows):
        axes.barh(row, value, color=colour, height=0.62)
        axes.annotate(
            f"{value:.0f}", (value, row), (4, 0), textcoords="offset points", va="center", fontsize=8.5
        )
    axes.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    axes.set(xlim=(0, 1.12 * largest), ylim=(len(rows) - 0.4, -0.6), xlabel="mean CRPS [Wh], lower is better")
    axes.tick_params(axis="y", length=0)
    return figure


@styled
def plot_updates(update: Mapping[str, Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Error of the re-forecast total against the part of the trip driven, beside its baselines."""
    figure = new_figure(4.3, "During the trip: error of the trip's total", _note(note), synthetic)
    axes = figure.add_subplot()
    fractions = [float(key) for key in update]
    for key, (words, colour, marker) in LINES.items():
        values = [np.nan if row.get(key) is None else 100 * float(row[key]) for row in update.values()]
        if np.isfinite(values).any():
            width = 2.4 if key == "mape" else 1.4
            axes.plot(
                fractions,
                values,
                marker=marker,
                color=colour,
                lw=width,
                ms=5.5,
                label=words,
                gid=f"update-{key}",
            )
    bounds = np.array([row["mape_ci95"] for row in update.values()]) * 100
    axes.fill_between(fractions, bounds[:, 0], bounds[:, 1], color=HYBRID, alpha=0.18, lw=0)
    axes.set_yscale("log")
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axes.set_yticks(
        [t for t in (1, 2, 5, 10, 20, 50, 100, 200) if axes.get_ylim()[0] <= t <= axes.get_ylim()[1]]
    )
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("mean error of the total [%]")
    axes.set_xticks(fractions)
    percent_axis(axes, "part of the trip's time driven [%]")
    axes.grid(axis="y")
    figure.legend(loc="outside lower left", ncols=1, reverse=True)
    return figure


@styled
def plot_training_size(curve: Sequence[Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Mean error against the number of training trips, hybrid and data-only, every draw as a point."""
    figure = new_figure(3.9, "How many training trips it takes", _note(note), synthetic)
    axes = figure.add_subplot()
    sizes = [float(row["n_trips"]) for row in curve]
    for model, marker in (("boosting-only", "s"), ("hybrid", "o")):
        colour = model_style(model).colour
        for row in curve:
            draws = row.get(f"{model}_by_draw") or []
            axes.plot(
                [row["n_trips"]] * len(draws),
                [100 * d for d in draws],
                marker,
                color=colour,
                ms=3,
                alpha=0.45,
            )
        means = [100 * float(row[model]) for row in curve]
        axes.plot(sizes, means, marker, ls="-", color=colour, ms=6, lw=2, label=model_style(model).label)
    axes.set_xscale("log")
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.set(xlabel="training trips", ylabel="mean error [%]")
    axes.grid(axis="y")
    figure.legend(loc="outside lower left", ncols=2)
    return figure


@styled
def plot_strata(strata: Sequence[Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Mean error by stratum, hybrid against data-only."""
    figure = new_figure(1.7 + 0.25 * len(strata), "Rare and common cases", _note(note), synthetic)
    axes = figure.add_subplot()
    for row, stratum in enumerate(strata):
        both = [stratum[m] for m in ("hybrid", "boosting-only") if stratum.get(m) is not None]
        axes.plot([min(both), max(both)], [row, row], color=RULE, lw=2.2, zorder=1)
        for model, marker in (("boosting-only", "s"), ("hybrid", "o")):
            if stratum.get(model) is not None:
                axes.plot(stratum[model], row, marker, color=model_style(model).colour, ms=6.5)
    for model, marker in (("hybrid", "o"), ("boosting-only", "s")):
        if any(stratum.get(model) is not None for stratum in strata):
            axes.plot([], [], marker, color=model_style(model).colour, label=model_style(model).label)
    names = [f"{s['by']}: {s['stratum']} ({s['n_trips']})" for s in strata]
    axes.set_yticks(range(len(strata)), [plain(name) for name in names])
    axes.set_ylim(len(strata) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0, labelsize=7.5)
    axes.set_xlim(left=0)
    percent_axis(axes, "mean error [%]")
    figure.legend(loc="outside lower left", ncols=2)
    return figure


@styled
def plot_waterfall(
    causes: pd.DataFrame,
    trips: pd.DataFrame,
    selected: Sequence[tuple[str, str, float]],
    *,
    synthetic: bool = False,
) -> Figure:
    """Energy by cause of some trips, each bar from where the last one ended, and the measured energy.

    Parameters
    ----------
    causes : DataFrame
        Energy by cause [Wh], index trip.
    trips : DataFrame
        `trip, energy_wh, observed_energy_wh`.
    selected : sequence of (role, trip, APE)
    synthetic : bool
    """
    names = [c for c in causes.columns if causes.loc[[t for _, t, _ in selected], c].abs().max() >= 0.5]
    figure = new_figure(
        0.9 + len(selected) * (0.75 + 0.2 * (len(names) + 2)), "Where the energy goes", _note(""), synthetic
    )
    panels = figure.subplots(len(selected), 1, squeeze=False)[:, 0]
    totals = {c: dict(zip(trips["trip"], trips[c].astype(float) / 1e3, strict=True)) for c in TOTALS}
    for axes, (role, trip, ape) in zip(panels, selected, strict=True):
        values = causes.loc[trip, names].to_numpy(dtype=np.float64) / 1e3
        ends = np.cumsum(values)
        starts = ends - values
        colours = [WARM if value > 0 else "#1f8a5b" for value in values]
        axes.barh(range(len(names)), values, left=starts, color=colours, height=0.7)
        total, measured = (float(totals[c][trip]) for c in TOTALS)
        axes.barh([len(names), len(names) + 1], [total, measured], color=[HYBRID, INK], height=0.7)
        every = [*values, total, measured]
        reach = float(max(ends.max(), total, measured) - min(0.0, starts.min(), ends.min()))
        for row, (value, end) in enumerate(
            zip(every, [*np.maximum(starts, ends), total, measured], strict=True)
        ):
            text = f"{value:+.2f}" if row < len(names) else f"{value:.2f}"
            axes.annotate(
                text.replace("-", "−"),
                (end, row),
                (3, 0),
                textcoords="offset points",
                va="center",
                fontsize=7.5,
            )
        axes.set_yticks(
            range(len(names) + 2), [*(n.replace("_", " ") for n in names), "forecast", "measured"]
        )
        axes.set_ylim(len(names) + 1.6, -0.6)
        axes.tick_params(axis="y", length=0, labelsize=7.5)
        axes.set_xlim(
            min(0.0, float(ends.min())) - 0.02 * reach, max(float(ends.max()), total, measured) + 0.13 * reach
        )
        axes.axvline(0.0, color=INK, lw=0.8)
        axes.set_title(f"{role}: {plain(trip)}, error {100 * ape:.1f} %")
    panels[-1].set_xlabel("energy at the battery [kWh]")
    return figure


@styled
def plot_example(series: pd.DataFrame, log: pd.DataFrame, trip: str, *, synthetic: bool = False) -> Figure:
    """One departure forecast along its route: energy and displayed state of charge with 90 % bands, and as measured."""
    figure = new_figure(
        4.9, f"Departure forecast along {plain(trip)}", _note("bands: 90 % interval"), synthetic
    )
    top, bottom = figure.subplots(2, 1, sharex=True)
    km, measured_km = series["distance_m"] / 1e3, log["distance_m"] / 1e3
    top.fill_between(
        km, series["energy_low_wh"] / 1e3, series["energy_high_wh"] / 1e3, color=HYBRID, alpha=0.22, lw=0
    )
    top.plot(km, series["energy_wh"] / 1e3, color=HYBRID, lw=2, label="forecast")
    top.plot(measured_km, log["observed_energy_wh"] / 1e3, color=INK, lw=1.2, label="measured")
    top.set_ylabel("energy [kWh]")
    bottom.fill_between(
        km,
        100 * series["displayed_soc_low"],
        100 * series["displayed_soc_high"],
        color=HYBRID,
        alpha=0.22,
        lw=0,
    )
    bottom.plot(km, 100 * series["displayed_soc"], color=HYBRID, lw=2)
    if "displayed_soc" in log and log["displayed_soc"].notna().any():
        bottom.plot(measured_km, 100 * log["displayed_soc"], color=INK, lw=1.2)
    bottom.set(xlabel="distance [km]", ylabel="displayed charge [%]")
    for axes in (top, bottom):
        axes.grid(axis="y")
        axes.set_xlim(0, float(km.iloc[-1]))
    figure.legend(loc="outside lower left", ncols=2)
    return figure
