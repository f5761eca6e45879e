"""The forecast beside the model without physics: by the number of training trips, and by kind of trip."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from tripwatt.evaluation.forecast_scores import FORECAST, WITHOUT_PHYSICS
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import RULE, legend_below, percent_axis, plot_sizes, plotted, row_names
from tripwatt.report.tables import Column, Table, in_percent, tabulated
from tripwatt.report.view import Record, View, plain
from tripwatt.report.words import label, listed, percent


@panel("training-size", "Error by the number of training trips", draws=True)
def training_size(view: View) -> Content:
    """The learning curve of the forecast and of the model without physics."""
    curve = view.results.get("learning_curve") or []
    if not curve:
        return Content(
            f"No learning curve: too few trips, or {FORECAST} or {WITHOUT_PHYSICS} was not among the models."
        )
    return Content(on_training_size(curve, view.given), plot_training_size(view, curve))


def on_training_size(curve: Sequence[Record], given: str) -> str:
    """How many trips the forecast needs for the error of the model without physics."""
    least, most = curve[0], curve[-1]
    alone = label(WITHOUT_PHYSICS)
    later = (
        f"; with {most['n_trips']} they are {percent(most[FORECAST])} and {percent(most[WITHOUT_PHYSICS])}"
    )
    later = later if len(curve) > 1 else ""
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


def plot_training_size(view: View, curve: Sequence[Record]) -> Figure:
    """Mean error against the number of training trips, hybrid and data-only, every draw as a point."""
    figure, axes = plotted(view, 3.9, "How many training trips it takes", view.note_given)
    for model, marker in ((WITHOUT_PHYSICS, "s"), (FORECAST, "o")):
        for row in curve:
            draws = [100 * draw for draw in row.get(f"{model}_by_draw") or []]
            colour, numbers = model_style(model).colour, [row["n_trips"]] * len(draws)
            axes.plot(numbers, draws, marker, color=colour, ms=3, alpha=0.45)
    plot_sizes(axes, curve, (WITHOUT_PHYSICS, FORECAST))
    return legend_below(figure, 2)


@panel("strata", "Error by kind of trip", draws=True, folded=True)
def strata(view: View) -> Content:
    """Errors of the forecast and of the model without physics by stratum."""
    kinds = view.results.get("strata") or []
    if not kinds:
        return Content(view.no_focus)
    return Content(on_strata(kinds, view.given), plot_strata(view, kinds), (strata_table(view, kinds),))


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
    return tabulated(
        view.captioned(f"Mean error by stratum, {view.given}"),
        strata,
        Column("Stratum", lambda s: f"{s['by']}: {s['stratum']}"),
        Column("Trips", "n_trips", digits=0),
        in_percent("Hybrid [%]", FORECAST),
        in_percent("Data only [%]", WITHOUT_PHYSICS),
        in_percent("Difference [points]", "diff"),
        in_percent("95 % interval", "diff_ci95"),
    )


def plot_strata(view: View, strata: Sequence[Record]) -> Figure:
    """Mean error by stratum, hybrid against data-only."""
    figure, axes = plotted(view, 1.7 + 0.25 * len(strata), "Rare and common cases", view.note_given)
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
    return legend_below(figure, 2)
