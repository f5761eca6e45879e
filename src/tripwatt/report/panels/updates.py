"""The error of the forecast during the trip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt.report.panel import Content, panel
from tripwatt.report.style import (
    FORECAST_COLOUR,
    PLAIN_COLOUR,
    WARM_COLOUR,
    new_figure,
    percent_axis,
    styled,
)
from tripwatt.report.tables import Table, number, span
from tripwatt.report.view import Record, View
from tripwatt.report.words import listed, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES: Final[Mapping[str, tuple[str, str, str]]] = {
    "naive_gauge": ("consumption per km so far × all km", PLAIN_COLOUR, "^"),
    "no_update": ("no update: measured + departure forecast of the rest", WARM_COLOUR, "s"),
    "soc_only": ("re-forecast from the state of charge alone", "#7d6bc6", "D"),
    "mape": ("re-forecast", FORECAST_COLOUR, "o"),
}
"""Key in `update` -> words, colour, marker."""


@panel("updates", "Error of the forecast during the trip", draws=True, wide=True)
def updates(view: View) -> Content:
    """The error of the re-forecast total beside its baselines."""
    update = view.focus.get("update")
    if not update:
        return Content(view.no_focus)
    drawn = plot_updates(update, note=view.note_given, synthetic=view.synthetic)
    return Content(on_updates(view), drawn, (updates_table(view),))


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
    said += (
        f"It is significantly lower than without an update after {listed(better)}. "
        if better
        else "At no time is it significantly lower than without an update. "
    )
    said += (
        f"It is higher than that of a baseline after {listed(worse)}."
        if worse
        else "At no time is it higher than that of a baseline."
    )
    return said


def updates_table(view: View) -> Table:
    """Errors and intervals of the re-forecast by the part that was driven, beside the baselines."""
    update = view.focus["update"]
    known = all("coverage" in row for row in update.values())
    rows = tuple(
        (
            f"{100 * float(key):g} %",
            number(row["mape"], 100, 1),
            span(row["mape_ci95"]),
            number(row["no_update"], 100, 1),
            number(row["diff"], 100, 2),
            span(row["diff_ci95"], 2),
            number(row["soc_only"], 100, 1),
            number(row["naive_gauge"], 100, 1),
            *((number(row["coverage"], 100, 1), number(row["interval_width_wh"], 1e-3)) if known else ()),
        )
        for key, row in update.items()
    )
    columns: tuple[str, ...] = (
        "Part driven",
        "Re-forecast [%]",
        "95 % interval",
        "No update [%]",
        "Difference [points]",
        "Its 95 % interval",
        "SoC alone [%]",
        "Gauge [%]",
        *(("Inside 90 % [%]", "Its width [kWh]") if known else ()),
    )
    return Table(view.captioned(f"Mean error of the re-forecast total, {view.given}"), columns, rows)


@styled
def plot_updates(update: Mapping[str, Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Error of the re-forecast total against the part of the trip driven, beside its baselines."""
    figure = new_figure(4.3, "During the trip: error of the trip's total", note, synthetic)
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
    axes.fill_between(fractions, bounds[:, 0], bounds[:, 1], color=FORECAST_COLOUR, alpha=0.18, lw=0)
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


PANELS = (updates,)
