"""The error of the forecast during the trip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from tripwatt.report import style
from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Column, Table, in_kwh, in_percent, tabulated
from tripwatt.report.view import Record, View
from tripwatt.report.words import listed, percent

LINES: Final[Mapping[str, tuple[str, str, str]]] = {
    "naive_gauge": ("consumption per km so far × all km", style.PLAIN_COLOUR, "^"),
    "no_update": ("no update: measured + departure forecast of the rest", style.WARM_COLOUR, "s"),
    "soc_only": ("re-forecast from the state of charge alone", "#7d6bc6", "D"),
    "mape": ("re-forecast", style.FORECAST_COLOUR, "o"),
}
"""Key in `update` -> words, colour, marker."""


@panel("updates", "Error of the forecast during the trip", draws=True, wide=True)
def updates(view: View) -> Content:
    """The error of the re-forecast total beside its baselines."""
    update = view.focus.get("update")
    if not update:
        return Content(view.no_focus)
    return Content(on_updates(view), plot_updates(view), (updates_table(view),))


def on_updates(view: View) -> str:
    """How the error of the total falls on the way, beside the baselines."""
    update = view.focus["update"]
    parts = [f"{percent(row['mape'])} after {100 * float(key):g} %" for key, row in update.items()]
    better = [f"{100 * float(k):g} %" for k, r in update.items() if r["significant"] and r["diff"] < 0]
    worse = [
        f"{100 * float(k):g} %"
        for k, r in update.items()
        if r["mape"] > min(r["no_update"], r["naive_gauge"])
    ]
    said = f"The mean error of the trip's total is {listed(parts)} of its time, {view.given}. "
    lower, higher = "significantly lower than without an update", "higher than that of a baseline"
    said += f"It is {lower} after {listed(better)}. " if better else f"At no time is it {lower}. "
    said += f"It is {higher} after {listed(worse)}." if worse else f"At no time is it {higher}."
    return said


def updates_table(view: View) -> Table:
    """Errors and intervals of the re-forecast by the part that was driven, beside the baselines."""
    rows = [{**row, "part": f"{100 * float(key):g} %"} for key, row in view.focus["update"].items()]
    held = (in_percent("Inside 90 % [%]", "coverage"), in_kwh("Its width [kWh]", "interval_width_wh"))
    return tabulated(
        view.captioned(f"Mean error of the re-forecast total, {view.given}"),
        rows,
        Column("Part driven", "part"),
        in_percent("Re-forecast [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("No update [%]", "no_update"),
        in_percent("Difference [points]", "diff", 2),
        in_percent("Its 95 % interval", "diff_ci95", 2),
        in_percent("SoC alone [%]", "soc_only"),
        in_percent("Gauge [%]", "naive_gauge"),
        *(held if all("coverage" in row for row in rows) else ()),
    )


def plot_updates(view: View) -> Figure:
    """Error of the re-forecast total against the part of the trip driven, beside its baselines."""
    figure, axes = style.plotted(view, 4.3, "During the trip: error of the trip's total", view.note_given)
    update: Mapping[str, Record] = view.focus["update"]
    fractions = [float(key) for key in update]
    for key, (words, colour, marker) in LINES.items():
        values = [np.nan if row.get(key) is None else 100 * float(row[key]) for row in update.values()]
        if np.isfinite(values).any():
            look: dict[str, Any] = {"marker": marker, "color": colour, "lw": 2.4 if key == "mape" else 1.4}
            axes.plot(fractions, values, ms=5.5, label=words, gid=f"update-{key}", **look)
    bounds = np.array([row["mape_ci95"] for row in update.values()]) * 100
    axes.fill_between(fractions, bounds[:, 0], bounds[:, 1], color=style.FORECAST_COLOUR, alpha=0.18, lw=0)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_yticks([tick for tick in (1, 2, 5, 10, 20, 50, 100, 200) if low <= tick <= high])
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set(xticks=fractions, ylabel="mean error of the total [%]")
    style.percent_axis(axes, "part of the trip's time driven [%]")
    axes.grid(axis="y")
    return style.legend_below(figure, reverse=True)
