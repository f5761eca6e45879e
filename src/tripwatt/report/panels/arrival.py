"""The displayed state of charge at arrival: its error, its interval, and the reliability of the probability to arrive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from tripwatt.report.panel import Content, panel
from tripwatt.report.style import FORECAST_COLOUR, RULE, WARM_COLOUR, new_figure, percent_axis, styled
from tripwatt.report.tables import Table, number, span
from tripwatt.report.view import Record, View
from tripwatt.report.words import percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STARTS: Final[Mapping[str, tuple[str, str, str]]] = {
    "soc": ("the display was known at departure", FORECAST_COLOUR, "o"),
    "bms_soc": ("the battery management's charge was known", WARM_COLOUR, "s"),
}
"""Key in `arrival` -> words, colour, marker."""


@panel("arrival", "Displayed charge at arrival", draws=True, wide=True)
def arrival(view: View) -> Content:
    """Error and interval of the charge at arrival, and how often a stated probability to arrive came true."""
    scores = {key: found for key, found in (view.focus.get("arrival") or {}).items() if found}
    if not scores:
        return Content("No trip has readings of the displayed charge.")
    drawn = plot_reliability(scores, note=view.note_given, synthetic=view.synthetic)
    return Content(
        on_arrival(view, scores), drawn, (arrival_table(view, scores), reliability_table(view, scores))
    )


def on_arrival(view: View, scores: Mapping[str, Record]) -> str:
    """The mean error and the coverage from each start."""
    parts = [
        f"{100 * found['mae']:.1f} percentage points where {STARTS[key][0]} "
        f"(the 90 % interval holds {percent(found['coverage'], 0)} of {found['n_trips']} trips)"
        for key, found in scores.items()
    ]
    return f"The displayed charge at arrival errs by {'; and by '.join(parts)}, {view.given}."


def arrival_table(view: View, scores: Mapping[str, Record]) -> Table:
    """A row for each thing that was known at departure."""
    columns = (
        "Known at departure",
        "Trips",
        "Mean error [points]",
        "Bias [points]",
        "Inside 90 % [%]",
        "Clopper-Pearson 95 %",
        "Its width [points]",
    )
    rows = tuple(
        (
            STARTS[key][0],
            str(found["n_trips"]),
            number(found["mae"], 100, 2),
            number(found["bias"], 100, 2),
            number(found["coverage"], 100, 1),
            span(found["coverage_ci95"]),
            number(found["interval_width"], 100, 1),
        )
        for key, found in scores.items()
    )
    return Table(view.captioned(f"Displayed charge at arrival, {view.given}"), columns, rows)


def reliability_table(view: View, scores: Mapping[str, Record]) -> Table:
    """A row for each tenth of the stated probability."""
    columns = (
        "Known at departure",
        "Stated [%]",
        "Came true [%]",
        "95 % interval over trips",
        "Of all pairs [%]",
    )
    rows = tuple(
        (
            STARTS[key][0],
            number(row["stated"], 100, 1),
            number(row["observed"], 100, 1),
            span(row["observed_ci95"]),
            number(row["share"], 100, 1),
        )
        for key, found in scores.items()
        for row in found["reliability"]
    )
    return Table(
        view.captioned("Probability to arrive with reserves within 6 points of the forecast charge"),
        columns,
        rows,
    )


@styled
def plot_reliability(scores: Mapping[str, Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Share of pairs of trip and reserve that came true against the stated probability to arrive."""
    figure = new_figure(3.9, "How often a stated probability to arrive came true", note, synthetic)
    axes = figure.add_subplot()
    axes.plot([0.0, 1.0], [0.0, 1.0], color=RULE, lw=1.5, label="exactly as stated")
    for place, (key, found) in enumerate(scores.items()):
        words, colour, marker = STARTS[key]
        shift = 0.008 * (2 * place - 1)
        for row in found["reliability"]:
            at = row["stated"] + shift
            axes.plot([at, at], row["observed_ci95"], color=colour, lw=1.8, solid_capstyle="butt")
            axes.plot(at, row["observed"], marker, color=colour, ms=5.5)
        axes.plot([], [], marker=marker, color=colour, label=f"{words}, 95 % bootstrap interval over trips")
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f}")
    axes.set_ylabel("came true [% of pairs]")
    percent_axis(axes, "stated probability to arrive [%]")
    axes.grid(axis="y")
    figure.legend(loc="outside lower left", ncols=1)
    return figure


PANELS = (arrival,)
