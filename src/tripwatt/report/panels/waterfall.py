"""Energy of single trips by cause, and one forecast along its route."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from tripwatt.evaluation.forecast_scores import ForecastInsight
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import FORECAST_COLOUR, INK, WARM_COLOUR, annotate, row_names, stacked
from tripwatt.report.tables import number
from tripwatt.report.view import View, plain
from tripwatt.report.words import listed, percent


@panel("waterfall", "Energy by cause", draws=True)
def waterfall(view: View) -> Content:
    """The energy by cause of the best, the median and the worst trip."""
    kept, selected = view.forecast, view.selected_trips()
    if kept is None or not selected:
        return Content(view.no_focus)
    parts = []
    for role, trip, _ in selected:
        largest = str(kept.causes.loc[trip].drop("correction", errors="ignore").idxmax())
        parts.append(f"{largest.replace('_', ' ')} on the {role.lower()} trip {plain(trip)}")
    said = (
        f"The largest cause is {listed(parts)}. Each bar starts where the one above it ends; forecasts before departure, "
        f"{view.given}."
    )
    return Content(said, plot_waterfall(view, kept, selected))


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
    return Content(said, plot_example(view, kept, trip))


def plot_waterfall(view: View, kept: ForecastInsight, selected: Sequence[tuple[str, str, float]]) -> Figure:
    """Energy by cause of some trips, each bar from where the last one ended, and the measured energy.

    Parameters
    ----------
    view : View
    kept : ForecastInsight
    selected : sequence of (role, trip, APE)
    """
    causes = kept.causes
    both = kept.trips[["energy_wh", "observed_energy_wh"]].to_numpy(dtype=np.float64) / 1e3
    totals = dict(zip(kept.trips["trip"], both, strict=True))
    names = [c for c in causes.columns if causes.loc[[t for _, t, _ in selected], c].abs().max() >= 0.5]
    height = 0.9 + len(selected) * (0.75 + 0.2 * (len(names) + 2))
    figure, panels = stacked(view, height, ("Where the energy goes", view.given), len(selected))
    for axes, (role, trip, ape) in zip(panels, selected, strict=True):
        values = causes.loc[trip, names].to_numpy(dtype=np.float64) / 1e3
        ends = np.cumsum(values)
        starts = ends - values
        colours = [WARM_COLOUR if value > 0 else "#1f8a5b" for value in values]
        axes.barh(range(len(names)), values, left=starts, color=colours, height=0.7)
        total, measured = totals[trip].tolist()
        axes.barh([len(names), len(names) + 1], [total, measured], color=[FORECAST_COLOUR, INK], height=0.7)
        every = [*values, total, measured]
        reach = float(max(ends.max(), total, measured) - min(0.0, starts.min(), ends.min()))
        for row, (value, end) in enumerate(
            zip(every, [*np.maximum(starts, ends), total, measured], strict=True)
        ):
            text = f"{value:+.2f}" if row < len(names) else f"{value:.2f}"
            annotate(axes, text.replace("-", "−"), (end, row), (3, 0), va="center")
        row_names(axes, [*(n.replace("_", " ") for n in names), "forecast", "measured"])
        axes.tick_params(axis="y", labelsize=7.5)
        axes.set_xlim(
            min(0.0, float(ends.min())) - 0.02 * reach, max(float(ends.max()), total, measured) + 0.13 * reach
        )
        axes.axvline(0.0, color=INK, lw=0.8)
        axes.set_title(f"{role}: {plain(trip)}, error {100 * ape:.1f} %")
    panels[-1].set_xlabel("energy at the battery [kWh]")
    return figure


def plot_example(view: View, kept: ForecastInsight, trip: str) -> Figure:
    """One departure forecast along its route: energy and displayed state of charge with 90 % bands, and as measured."""
    series, log = kept.series[trip], kept.logs[trip]
    note = "\n".join(filter(None, ["bands: 90 % interval", view.given]))
    head = (f"Departure forecast along {plain(trip)}", note)
    figure, (top, bottom) = stacked(view, 4.9, head, 2, sharex=True)
    km, measured_km = series["distance_m"] / 1e3, log["distance_m"] / 1e3
    for axes, factor, value, low, high, measured in (
        (top, 1e-3, "energy_wh", "energy_low_wh", "energy_high_wh", "observed_energy_wh"),
        (bottom, 100.0, "displayed_soc", "displayed_soc_low", "displayed_soc_high", "displayed_soc"),
    ):
        band = factor * series[low], factor * series[high]
        axes.fill_between(km, *band, color=FORECAST_COLOUR, alpha=0.22, lw=0)
        axes.plot(km, factor * series[value], color=FORECAST_COLOUR, lw=2, label="forecast")
        if measured in log and log[measured].notna().any():
            axes.plot(measured_km, factor * log[measured], color=INK, lw=1.2, label="measured")
        axes.grid(axis="y")
        axes.set_xlim(0, float(km.iloc[-1]))
    top.set_ylabel("energy [kWh]")
    bottom.set(xlabel="distance [km]", ylabel="displayed charge [%]")
    figure.legend(*top.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure
