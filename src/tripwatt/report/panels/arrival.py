"""The displayed state of charge at arrival: its error, its interval, and the reliability of the probability to arrive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from matplotlib.figure import Figure

from tripwatt.report.panel import Content, panel
from tripwatt.report.style import FORECAST_COLOUR, WARM_COLOUR, diagonal, legend_below, plotted
from tripwatt.report.tables import Column, Table, in_percent, tabulated
from tripwatt.report.view import Record, View
from tripwatt.report.words import percent

STARTS: Final[Mapping[str, tuple[str, str, str]]] = {
    "soc": ("the display was known at departure", FORECAST_COLOUR, "o"),
    "bms_soc": ("the battery management's charge was known", WARM_COLOUR, "s"),
}
"""Key in `arrival` -> words, colour, marker."""


@panel("arrival", "Displayed charge at arrival", draws=True, wide=True)
def arrival(view: View) -> Content:
    """Error and interval of the charge at arrival, and how often a stated probability to arrive came true."""
    scores = {key: score for key, score in (view.focus.get("arrival") or {}).items() if score}
    if not scores:
        return Content("No trip has readings of the displayed charge.")
    tables = (arrival_table(view, scores), reliability_table(view, scores))
    return Content(on_arrival(view, scores), plot_reliability(view, scores), tables)


def on_arrival(view: View, scores: Mapping[str, Record]) -> str:
    """The mean error and the coverage from each start."""
    parts = [
        f"{100 * score['mae']:.1f} percentage points where {STARTS[key][0]} "
        f"(the 90 % interval holds {percent(score['coverage'], 0)} of {score['n_trips']} trips)"
        for key, score in scores.items()
    ]
    return f"The displayed charge at arrival errs by {'; and by '.join(parts)}, {view.given}."


def arrival_table(view: View, scores: Mapping[str, Record]) -> Table:
    """A row for each thing that was known at departure."""
    return tabulated(
        view.captioned(f"Displayed charge at arrival, {view.given}"),
        [{**score, "start": STARTS[key][0]} for key, score in scores.items()],
        Column("Known at departure", "start"),
        Column("Trips", "n_trips", digits=0),
        in_percent("Mean error [points]", "mae", 2),
        in_percent("Bias [points]", "bias", 2),
        in_percent("Inside 90 % [%]", "coverage"),
        in_percent("Clopper-Pearson 95 %", "coverage_ci95"),
        in_percent("Its width [points]", "interval_width"),
    )


def reliability_table(view: View, scores: Mapping[str, Record]) -> Table:
    """A row for each tenth of the stated probability."""
    return tabulated(
        view.captioned("Probability to arrive with reserves within 6 points of the forecast charge"),
        [{**row, "start": STARTS[key][0]} for key, score in scores.items() for row in score["reliability"]],
        Column("Known at departure", "start"),
        in_percent("Stated [%]", "stated"),
        in_percent("Came true [%]", "observed"),
        in_percent("95 % interval over trips", "observed_ci95"),
        in_percent("Of all pairs [%]", "share"),
    )


def plot_reliability(view: View, scores: Mapping[str, Record]) -> Figure:
    """Share of pairs of trip and reserve that came true against the stated probability to arrive."""
    figure, axes = plotted(view, 3.9, "How often a stated probability to arrive came true", view.note_given)
    diagonal(axes, 0.0, "came true [% of pairs]", "stated probability to arrive [%]")
    for place, (key, score) in enumerate(scores.items()):
        words, colour, marker = STARTS[key]
        for row in score["reliability"]:
            at = row["stated"] + 0.008 * (2 * place - 1)
            axes.plot([at, at], row["observed_ci95"], color=colour, lw=1.8, solid_capstyle="butt")
            axes.plot(at, row["observed"], marker, color=colour, ms=5.5)
        axes.plot([], [], marker=marker, color=colour, label=f"{words}, 95 % bootstrap interval over trips")
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
    return legend_below(figure)
