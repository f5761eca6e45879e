"""The forecast beside the model without physics: by the number of training trips, and by kind of trip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tripwatt.evaluation.forecast_scores import FORECAST, WITHOUT_PHYSICS
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import (
    RULE,
    new_figure,
    percent_axis,
    row_names,
    styled,
)
from tripwatt.report.tables import Table, number, span
from tripwatt.report.view import Record, View, plain
from tripwatt.report.words import label, listed, percent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure


@panel("training-size", "Error by the number of training trips", draws=True)
def training_size(view: View) -> Content:
    """The learning curve of the forecast and of the model without physics."""
    curve = view.results.get("learning_curve") or []
    if not curve:
        return Content(
            f"No learning curve: too few trips, or {FORECAST} or {WITHOUT_PHYSICS} was not among the models."
        )
    drawn = plot_training_size(curve, note=view.note_given, synthetic=view.synthetic)
    return Content(on_training_size(curve, view.given), drawn)


def on_training_size(curve: Sequence[Record], given: str) -> str:
    """How many trips the forecast needs for the error of the model without physics."""
    least, most = curve[0], curve[-1]
    alone = label(WITHOUT_PHYSICS)
    later = (
        f"; with {most['n_trips']} they are {percent(most[FORECAST])} and {percent(most[WITHOUT_PHYSICS])}"
        if len(curve) > 1
        else ""
    )
    said = (
        f"With {least['n_trips']} training trips the mean error of {label(FORECAST)} is {percent(least[FORECAST])} and that of "
        f"{alone} {percent(least[WITHOUT_PHYSICS])}{later} (means of {most['draws']} random draws, scored on all other trips, "
        f"{given}). "
    )
    enough = [row["n_trips"] for row in curve if row[FORECAST] <= most[WITHOUT_PHYSICS]]
    if enough:
        return (
            f"{said}The hybrid needs {enough[0]} trips for the error that {alone} has with {most['n_trips']}."
        )
    return f"{said}At no number of trips is the error of the hybrid as low as that of {alone} with {most['n_trips']}."


@styled
def plot_training_size(curve: Sequence[Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Mean error against the number of training trips, hybrid and data-only, every draw as a point."""
    figure = new_figure(3.9, "How many training trips it takes", note, synthetic)
    axes = figure.add_subplot()
    sizes = [float(row["n_trips"]) for row in curve]
    for model, marker in ((WITHOUT_PHYSICS, "s"), (FORECAST, "o")):
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


@panel("strata", "Error by kind of trip", draws=True, folded=True)
def strata(view: View) -> Content:
    """Errors of the forecast and of the model without physics by stratum."""
    found = view.results.get("strata") or []
    if not found:
        return Content(view.no_focus)
    drawn = plot_strata(found, note=view.note_given, synthetic=view.synthetic)
    return Content(on_strata(found, view.given), drawn, (strata_table(view, found),))


def on_strata(strata: Sequence[Record], given: str) -> str:
    """The stratum with the largest error, and those in which the model without physics is better."""
    compared = [s for s in strata if s.get(WITHOUT_PHYSICS) is not None]
    worst = max(strata, key=lambda s: s[FORECAST])
    behind = [f"{s['by']} {s['stratum']}" for s in compared if s[FORECAST] > s[WITHOUT_PHYSICS]]
    said = (
        f"Highest mean error of the hybrid: {percent(worst[FORECAST])} ({worst['by']} {worst['stratum']}, trips: "
        f"{worst['n_trips']}). "
    )
    if compared:
        lower = len(compared) - len(behind)
        said += f"It is below {label(WITHOUT_PHYSICS)} in {lower} of {len(compared)} strata"
        said += f", not in {listed(behind)}" if behind else ""
    return f"{said}; {given}."


def strata_table(view: View, strata: Sequence[Record]) -> Table:
    """Mean errors by stratum, and their paired difference."""
    rows = tuple(
        (
            f"{s['by']}: {s['stratum']}",
            str(s["n_trips"]),
            number(s[FORECAST], 100, 1),
            number(s.get(WITHOUT_PHYSICS), 100, 1),
            number(s.get("diff"), 100, 1),
            span(s.get("diff_ci95")),
        )
        for s in strata
    )
    columns = ("Stratum", "Trips", "Hybrid [%]", "Data only [%]", "Difference [points]", "95 % interval")
    return Table(view.captioned(f"Mean error by stratum, {view.given}"), columns, rows)


@styled
def plot_strata(strata: Sequence[Record], *, note: str = "", synthetic: bool = False) -> Figure:
    """Mean error by stratum, hybrid against data-only."""
    figure = new_figure(1.7 + 0.25 * len(strata), "Rare and common cases", note, synthetic)
    axes = figure.add_subplot()
    for row, stratum in enumerate(strata):
        both = [stratum[m] for m in (FORECAST, WITHOUT_PHYSICS) if stratum.get(m) is not None]
        axes.plot([min(both), max(both)], [row, row], color=RULE, lw=2.2, zorder=1)
        for model, marker in ((WITHOUT_PHYSICS, "s"), (FORECAST, "o")):
            if stratum.get(model) is not None:
                axes.plot(stratum[model], row, marker, color=model_style(model).colour, ms=6.5)
    for model, marker in ((FORECAST, "o"), (WITHOUT_PHYSICS, "s")):
        if any(stratum.get(model) is not None for stratum in strata):
            axes.plot([], [], marker, color=model_style(model).colour, label=model_style(model).label)
    names = [f"{s['by']}: {s['stratum']} ({s['n_trips']})" for s in strata]
    row_names(axes, [plain(name) for name in names])
    axes.tick_params(axis="y", labelsize=7.5)
    axes.set_xlim(left=0)
    percent_axis(axes, "mean error [%]")
    figure.legend(loc="outside lower left", ncols=2)
    return figure


PANELS = (
    training_size,
    strata,
)
