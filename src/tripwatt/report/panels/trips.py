"""Errors trip by trip, and the energy along some of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from tripwatt.arrays import FloatArray
from tripwatt.report import style
from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Column, Table, in_kwh, in_percent, tabulated
from tripwatt.report.view import View, plain
from tripwatt.report.words import label, listed, percent
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_MINUTE

MOST_TRIPS: Final = 60
"""Trips that the figure of errors by trip shows; the table beside it always holds them all."""


@panel("trip-energy", "Energy along the best, the median and the worst trip", draws=True)
def trip_energy(view: View) -> Content | None:
    """Measured, simulated and corrected energy along three trips."""
    best, selected = view.best, view.selected_trips()
    if best is None or not _known(view):
        return None
    if not selected:
        return Content("No predictions along the trips were kept.")
    said = on_trip_energy(selected, best)
    if view.protocol.focus is None and model_style(best).kind == "hybrid":
        said += " A corrected curve need not begin at 0: the paper's correctors estimate the error of the energy so far, also at departure."
    return Content(said, plot_trip_energy(view, selected, best))


@panel("trip-errors", "Error by trip", draws=True)
def trip_errors(view: View) -> Content:
    """The error of the best model on every trip, beside that of the simulation."""
    best = view.best
    if best is None or not _known(view):
        return Content("No fold is known, so there is nothing to show by trip.")
    against = view.physics if view.physics != best else None
    return Content(on_trip_errors(view), plot_trip_errors(view, best, against))


@panel("all-trips", "Every trip and model", folded=True, wide=True)
def all_trips(view: View) -> Content | None:
    """The error of every model on every trip."""
    if not _known(view):
        return None
    table = trips_table(view)
    return Content(f"{len(table.rows)} trips.", tables=(table,))


def _known(view: View) -> bool:
    """Whether there are folds of the model that the report describes."""
    return view.best in set(view.main_folds["model"])


def on_trip_energy(selected: Sequence[tuple[str, str, float]], model: str) -> str:
    """The trips shown and their errors."""
    parts = [f"{percent(ape)} on the {role.lower()} trip ({plain(trip)})" for role, trip, ape in selected]
    return f"The error of {label(model)} at the end of the trip is {listed(parts)}."


def on_trip_errors(view: View) -> str:
    """On how many trips the best model is closer than the physics, and where it is worst."""
    wide = view.main_errors
    if view.best is None or view.best not in wide:
        return "No fold is known."
    worst = wide[view.best].idxmax()
    largest = f"{percent(float(wide[view.best].max()))}, on trip {plain(worst)}"
    if view.physics in wide and view.physics != view.best:
        both = wide[[view.best, view.physics]].dropna()
        closer = int((both[view.best] < both[view.physics]).sum())
        return (
            f"{label(view.best)} has a smaller error than {label(str(view.physics))} on {closer} of {len(both)} trips "
            f"({percent(closer / len(both), 0)}). Its largest error is {largest}."
        )
    return f"The largest error of {label(view.best)} is {largest}."


def trips_table(view: View) -> Table:
    """Every trip of the main evaluation: measured energy and the error of every model."""
    wide = view.main_errors
    observed = view.main_folds.groupby("trip", observed=True)["observed_energy_wh"].first()
    return tabulated(
        view.captioned("Absolute error [%] of every trip and model"),
        wide.index,
        Column("Trip", plain),
        in_kwh("Measured [kWh]", observed.loc.__getitem__),
        *(in_percent(label(str(model)), wide[model].loc.__getitem__) for model in wide.columns),
    )


def plot_trip_energy(view: View, selected: Sequence[tuple[str, str, float]], model: str) -> Figure:
    """Cumulative energy along trips: measured, simulated and corrected, with the speed below.

    Parameters
    ----------
    view : View
        Its `series` have the trips.
    selected : sequence of (role, trip, ape)
        Which trips, e.g. `("Worst", "B28", 0.31)`.
    model : str
        The corrected prediction; beside it the simulation that it corrects, where each of the trips has it.
    """
    height, title = 1.0 + 2.55 * len(selected), f"Energy along the trip: {model_style(model).label}"
    figure = style.new_figure(height, title, "", view.synthetic)
    grid = figure.add_gridspec(2 * len(selected), 1, height_ratios=[3.2, 1.0] * len(selected))
    simulated = model_style(model).stands_on
    curves: list[tuple[str, str, str, Any, float]] = [("observed_energy_wh", "measured", style.INK, "-", 1.8)]
    if simulated and all(simulated in view.series[trip] for _, trip, _ in selected):
        curves.append((simulated, "simulated", model_style(simulated).colour, (0, (5, 2)), 1.6))
    curves.append((model, "corrected", model_style(model).colour, "-", 1.6))
    for place, (role, trip, ape) in enumerate(selected):
        frame = style.thinned(view.series[trip])
        minutes = (frame["time_s"] - view.series[trip]["time_s"].iloc[0]) / SECONDS_PER_MINUTE
        top = figure.add_subplot(grid[2 * place])
        below = figure.add_subplot(grid[2 * place + 1], sharex=top)
        for column, words, colour, dash, width in curves:
            if column in frame:
                look: dict[str, Any] = {"color": colour, "ls": dash, "lw": width}
                top.plot(minutes, frame[column] / 1e3, label=words, gid=f"energy-{place}-{words}", **look)
        top.axhline(0.0, color=style.RULE, lw=0.8, zorder=0)
        top.set(title=f"{role} trip: {plain(trip, 34)}, error {100 * ape:.1f} %", ylabel="energy [kWh]")
        top.grid(axis="y")
        top.tick_params(labelbottom=False)
        below.fill_between(minutes, frame["speed_m_s"] / M_S_PER_KM_H, color=style.INK, alpha=0.35, lw=0)
        below.set(xlim=(0, float(minutes.iloc[-1]) or 1.0), ylabel="km/h")
        below.set_ylim(bottom=0)
    figure.axes[-1].set_xlabel("time since departure [min]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


def plot_trip_errors(view: View, model: str, against: str | None = None) -> Figure:
    """APE of a model on each trip, with a line to the error of another model on the same trip.

    Parameters
    ----------
    view : View
    model : str
        Sorted by this model's error; the `MOST_TRIPS` with the largest are shown.
    against : str or None
        The model to compare with.
    """
    wide = view.main_errors.dropna(subset=model).sort_values(model, kind="stable", ascending=False)
    total = len(wide)
    wide = wide.head(MOST_TRIPS)
    shown = f"the {len(wide)} largest of {total}" if total > len(wide) else f"all {total} trips"
    figure, axes = style.plotted(view, 1.5 + 0.165 * len(wide), f"Error by trip, {shown}", view.note)
    rows = np.arange(len(wide))
    own = wide[model].to_numpy(dtype=np.float64)
    others = [wide[against].to_numpy(dtype=np.float64)] if against in wide.columns else []
    limit = style.cut_at(np.concatenate([own, *others]))

    def dots(values: FloatArray, name: str, gid: str, **look: Any) -> None:
        words = model_style(name).label
        axes.plot(np.minimum(values, limit), rows, "o", label=words, gid=gid, clip_on=False, **look)

    base = others[0] if others else np.zeros_like(own)
    axes.hlines(rows, np.minimum(own, limit), np.minimum(base, limit), color=style.RULE, lw=1.4, zorder=1)
    for other in others:
        dots(other, str(against), "other", mfc=style.PAPER_COLOUR, mec=model_style(str(against)).colour, ms=4)
    dots(own, model, "own", color=model_style(model).colour, ms=4.5)
    style.row_names(axes, [plain(trip, 18) for trip in wide.index], fontsize=7.5)
    axes.set(xlim=(0, limit), ylim=(len(wide) - 0.3, -0.7))
    axes.spines["left"].set_visible(False)
    style.percent_axis(axes, "absolute percentage error [%]")
    return style.legend_below(figure, 2)
