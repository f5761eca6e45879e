"""Energy of single trips by cause, and one forecast along its route."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from tripwatt.report.panel import Content, panel
from tripwatt.report.style import (
    FORECAST_COLOUR,
    INK,
    WARM_COLOUR,
    annotate,
    new_figure,
    styled,
)
from tripwatt.report.tables import number
from tripwatt.report.view import View, plain
from tripwatt.report.words import listed, percent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

TOTALS: Final = ("energy_wh", "observed_energy_wh")


@panel("waterfall", "Energy by cause", draws=True)
def waterfall(view: View) -> Content:
    """The energy by cause of the best, the median and the worst trip."""
    kept, selected = view.forecast, view.selected_trips()
    if kept is None or not selected:
        return Content(view.no_focus)
    parts = []
    for role, trip, _ in selected:
        largest = str(kept.causes.loc[trip].drop("learned_correction", errors="ignore").idxmax())
        parts.append(f"{largest.replace('_', ' ')} on the {role.lower()} trip {plain(trip)}")
    said = (
        f"The largest cause is {listed(parts)}. Each bar starts where the one above it ends; forecasts before departure, "
        f"{view.given}."
    )
    drawn = plot_waterfall(kept.causes, kept.trips, selected, note=view.given, synthetic=view.synthetic)
    return Content(said, drawn)


@panel("example", "One forecast along its route", draws=True)
def example(view: View) -> Content:
    """The forecast of the trip with the median error."""
    kept, selected = view.forecast, view.selected_trips()
    if kept is None or not selected:
        return Content(view.no_focus)
    role, trip, ape = next((s for s in selected if s[0] == "Median"), selected[0])
    series, log = kept.series[trip], kept.logs[trip]
    last, measured = series.iloc[-1], float(log["observed_energy_wh"].iloc[-1])
    inside = "inside" if last["energy_low_wh"] <= measured <= last["energy_high_wh"] else "outside"
    said = (
        f"The {role.lower()} trip {plain(trip)}: {number(last['energy_wh'], 1e-3)} kWh forecast before departure "
        f"({number(last['energy_low_wh'], 1e-3)} to {number(last['energy_high_wh'], 1e-3)} at 90 %), {number(measured, 1e-3)} "
        f"measured, {inside} the interval, error {percent(ape)}, {view.given}; charge on arrival "
        f"{percent(float(last['displayed_soc']), 0)}."
    )
    return Content(said, plot_example(series, log, trip, note=view.given, synthetic=view.synthetic))


@styled
def plot_waterfall(
    causes: pd.DataFrame,
    trips: pd.DataFrame,
    selected: Sequence[tuple[str, str, float]],
    *,
    note: str = "",
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
    note : str
        Condition of the forecasts, for the title.
    synthetic : bool
        Whether the trips are made up.
    """
    names = [c for c in causes.columns if causes.loc[[t for _, t, _ in selected], c].abs().max() >= 0.5]
    figure = new_figure(
        0.9 + len(selected) * (0.75 + 0.2 * (len(names) + 2)), "Where the energy goes", note, synthetic
    )
    panels = figure.subplots(len(selected), 1, squeeze=False)[:, 0]
    totals = {c: dict(zip(trips["trip"], trips[c].astype(float) / 1e3, strict=True)) for c in TOTALS}
    for axes, (role, trip, ape) in zip(panels, selected, strict=True):
        values = causes.loc[trip, names].to_numpy(dtype=np.float64) / 1e3
        ends = np.cumsum(values)
        starts = ends - values
        colours = [WARM_COLOUR if value > 0 else "#1f8a5b" for value in values]
        axes.barh(range(len(names)), values, left=starts, color=colours, height=0.7)
        total, measured = (float(totals[c][trip]) for c in TOTALS)
        axes.barh([len(names), len(names) + 1], [total, measured], color=[FORECAST_COLOUR, INK], height=0.7)
        every = [*values, total, measured]
        reach = float(max(ends.max(), total, measured) - min(0.0, starts.min(), ends.min()))
        for row, (value, end) in enumerate(
            zip(every, [*np.maximum(starts, ends), total, measured], strict=True)
        ):
            text = f"{value:+.2f}" if row < len(names) else f"{value:.2f}"
            annotate(axes, text.replace("-", "−"), (end, row), (3, 0), va="center")
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
def plot_example(
    series: pd.DataFrame, log: pd.DataFrame, trip: str, *, note: str = "", synthetic: bool = False
) -> Figure:
    """One departure forecast along its route: energy and displayed state of charge with 90 % bands, and as measured."""
    figure = new_figure(
        4.9,
        f"Departure forecast along {plain(trip)}",
        "\n".join(filter(None, ["bands: 90 % interval", note])),
        synthetic,
    )
    top, bottom = figure.subplots(2, 1, sharex=True)
    km, measured_km = series["distance_m"] / 1e3, log["distance_m"] / 1e3
    top.fill_between(
        km,
        series["energy_low_wh"] / 1e3,
        series["energy_high_wh"] / 1e3,
        color=FORECAST_COLOUR,
        alpha=0.22,
        lw=0,
    )
    top.plot(km, series["energy_wh"] / 1e3, color=FORECAST_COLOUR, lw=2, label="forecast")
    top.plot(measured_km, log["observed_energy_wh"] / 1e3, color=INK, lw=1.2, label="measured")
    top.set_ylabel("energy [kWh]")
    bottom.fill_between(
        km,
        100 * series["displayed_soc_low"],
        100 * series["displayed_soc_high"],
        color=FORECAST_COLOUR,
        alpha=0.22,
        lw=0,
    )
    bottom.plot(km, 100 * series["displayed_soc"], color=FORECAST_COLOUR, lw=2)
    if "displayed_soc" in log and log["displayed_soc"].notna().any():
        bottom.plot(measured_km, 100 * log["displayed_soc"], color=INK, lw=1.2)
    bottom.set(xlabel="distance [km]", ylabel="displayed charge [%]")
    for axes in (top, bottom):
        axes.grid(axis="y")
        axes.set_xlim(0, float(km.iloc[-1]))
    figure.legend(loc="outside lower left", ncols=2)
    return figure


PANELS = (waterfall, example)
