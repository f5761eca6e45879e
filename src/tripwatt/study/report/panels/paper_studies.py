"""Variants of the paper's models: forms of its simulation, working correlations, errors of the GAMM, trips needed."""

from __future__ import annotations

from typing import Final

from matplotlib.figure import Figure

from tripwatt.study.evaluation.paper_studies import CHOICES, CURVE_MODELS, FORMS
from tripwatt.study.paper.correctors import SIMULATION
from tripwatt.study.report.model_styles import model_style
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.style import INK, legend_below, new_axes
from tripwatt.study.report.tables import DASH, Column, Table, in_percent, in_words, make_table
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import points

CORRECTORS: Final = ("gamm", "forest", "boosting")
"""The paper's correctors, in the order of its Table 3."""
CAPTIONS: Final = {
    "boosting-chosen": "Boosting by its working correlation",
    "gamm-chosen": "The GAMM by the model of its errors",
}
"""Name of a choice inside the fold -> caption of the table of its variants."""


def panels(view: View) -> list[Panel]:
    """Return the panels of the studies and of the trips that the hybrid needs; none if the run had no studies."""
    if not view.results.get("studies"):
        return []
    tables = forms_table(view), improved_table(view), *(choice_table(view, name) for name in CAPTIONS)
    shown = [Panel("paper-studies", "Variants of the paper's models", tables=tables)]
    if view.results["studies"].get("trips_needed"):
        caption = "Means over random draws of training trips, scored on all other trips."
        figure = plot_trips_needed(view)
        shown.append(Panel("trips-needed", "How many trips the hybrid needs", caption, figure))
    return shown


def forms_table(view: View) -> Table:
    """Tabulate the errors of every form of the simulation beside the paper's error."""
    scores, target = view.results["studies"]["models"], view.published[SIMULATION]
    rows = [scores[name] for name in (SIMULATION, *FORMS) if name in scores]
    paper = {"title": "the paper's simulation", "mape": target}
    return make_table(
        "Simulation alone, without climate control",
        [*rows, paper],
        Column("Simulation", "title"),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Bias [%]", "bias"),
        in_percent("Max [%]", "max_ape"),
        Column("To the paper", lambda row: DASH if row is paper else points(row["mape"] - target)),
    )


def improved_table(view: View) -> Table:
    """Tabulate the correctors on the table's simulation and on the nearest form, with the share of trips that they improve."""
    scores = view.results["studies"]["models"]
    names = [*CORRECTORS, *(f"{name}-brochure" for name in CORRECTORS)]
    others = int(view.results["studies"]["n_trips"]) - 1
    return make_table(
        "Correctors, and the share of trips that they improve over their simulation",
        [scores[name] for name in names if name in scores],
        Column("Corrector", "title"),
        in_words("Simulation", lambda row: scores.get(row["simulation"], {"title": DASH})["title"]),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent(
            "Without the worst trip [%]", lambda row: row["mape"] + (row["mape"] - row["max_ape"]) / others
        ),
        in_percent("Trips improved [%]", "improved_share", 0),
    )


def choice_table(view: View, choice: str) -> Table:
    """Tabulate the variants of a model, that of `CHOICES` which is chosen inside the fold, and the paper's error of the first."""
    scores, names = view.results["studies"]["models"], CHOICES[choice]
    chosen = view.results["studies"]["choices"].get(choice, {})
    rows = [{**scores[name], "chosen": chosen.get(name)} for name in (*names, choice) if name in scores]
    return make_table(
        CAPTIONS[choice],
        [*rows, {"title": "the paper", "mape": view.published[names[0]]}],
        Column("Model", "title"),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Median [%]", "median_ape"),
        in_percent("Max [%]", "max_ape"),
        Column("Folds that chose it", "chosen", digits=0),
    )


def plot_trips_needed(view: View) -> Figure:
    """Draw the mean error against the number of training trips, with the crossing and its interval."""
    needed: Record = view.results["studies"]["trips_needed"]
    figure, axes = new_axes(view, 3.7, "How many training trips it takes", view.note)
    hybrid, alone = CURVE_MODELS
    sizes = [row["n_trips"] for row in needed["curve"]]
    for name, marker in ((alone, "s"), (hybrid, "o")):
        means, style = [100.0 * row[name] for row in needed["curve"]], model_style(name)
        (line,) = axes.plot(sizes, means, f"{marker}-", lw=2, ms=6, color=style.colour)
        line.set(label=style.label, gid=f"curve-{name}")
    axes.set_xscale("log")
    axes.set_xticks(sizes, map(str, sizes))
    axes.minorticks_off()
    axes.set(xlabel="training trips", ylabel="mean error [%]")
    axes.set_ylim(bottom=0)
    axes.grid(axis="y")
    target = 100.0 * needed["curve"][-1][alone]
    axes.axhline(target, color=INK, lw=0.8, ls=":")
    if needed["crossing"] is not None:
        bounds = [sizes[-1] if end is None else end for end in needed["crossing_ci95"]]
        axes.plot(bounds, [target, target], color=INK, lw=3.0, solid_capstyle="butt", gid="interval")
        words = "crossing, 95 % interval"
        axes.plot(needed["crossing"], target, "D", color=INK, ms=5, gid="crossing", label=words)
    return legend_below(figure, 3)
