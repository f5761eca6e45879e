"""What differs from the paper and why: forms of its simulation, working correlations, errors of the GAMM, trips needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from matplotlib.figure import Figure

from tripwatt.evaluation.paper_studies import CORRELATIONS, CURVE_MODELS, FORMS, GAMM_ERRORS, NEAREST
from tripwatt.paper.correctors import SIMULATION
from tripwatt.report.model_styles import PAPER_IMPROVED
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, legend_below, plot_sizes, plotted
from tripwatt.report.tables import DASH, Column, Table, in_percent, in_words, tabulated
from tripwatt.report.view import Record, View
from tripwatt.report.words import interval, label, listed, percent, points

ABSENT = (
    "Measured on the reference trips of the TUM data set alone, with the models that it varies in the run."
)

CORRECTORS = ("gamm", "forest", "boosting")
"""The paper's correctors, in the order of its Table 3."""


def study_scores(view: View) -> Mapping[str, Record]:
    """Scores of the models beside the table, and of those of the table on the same trips, by name."""
    return (view.results.get("studies") or {}).get("models") or {}


def forms(view: View) -> list[str]:
    """The simulations of the studies, the one of the table first."""
    return shown((SIMULATION, *(form.name for form in FORMS)), study_scores(view))


def shown(names: Sequence[str], scores: Mapping[str, Record]) -> list[str]:
    """Those of the names that have scores."""
    return [name for name in names if name in scores]


@panel("simulation-forms", "Published forms of the paper's simulation", wide=True)
def simulation_forms(view: View) -> Content:
    """Which form of the simulation comes nearest to the paper's, and what the correctors reach on it."""
    scores = study_scores(view)
    if NEAREST not in scores:
        return Content(ABSENT)
    return Content(on_forms(view), tables=(forms_table(view), improved_table(view)))


def on_forms(view: View) -> str:
    """The nearest form, the errors of the correctors on it, and the share of trips that they improve."""
    scores, paper = study_scores(view), view.published
    target = paper.get(SIMULATION)
    if target is None:
        return ABSENT
    errors = {name: float(scores[name]["mape"]) for name in forms(view)}
    nearest = min(errors, key=lambda name: abs(errors[name] - target))
    text = (
        f"The paper prints no parameter of its simulation but the 50 % of regeneration. Of {len(errors)} forms with published "
        f"values the one nearest to its {percent(target)} has {percent(errors[nearest])}: {scores[nearest]['title']}. The table's "
        f"own simulation, with the measured coast-down, has {percent(errors[SIMULATION])}."
    )
    on = {name: scores[f"{name}-brochure"] for name in CORRECTORS if f"{name}-brochure" in scores}
    if on:
        parts = [
            f"{label(name)} {percent(score['mape'])} ({percent(paper.get(name))} in the paper)"
            for name, score in on.items()
        ]
        shares = [percent(score["improved_share"], 0) for score in on.values()]
        before = [percent(scores[name]["improved_share"], 0) for name in on if name in scores]
        text += (
            f" On {scores[NEAREST]['title']} the correctors reach {listed(parts)}, and improve {listed(shares)} of the trips; on "
            f"the table's simulation they improve {listed(before)}. The paper states {PAPER_IMPROVED}: the share depends on how "
            "poor the simulation is, and so does not measure the corrector."
        )
    return text


def forms_table(view: View) -> Table:
    """Errors of every form of the simulation beside the paper's."""
    scores, target = study_scores(view), view.published.get(SIMULATION)
    rows = [scores[name] for name in forms(view)]

    def to_the_paper(row: Record) -> str:
        return DASH if target is None or row is paper else points(float(row["mape"]) - target)

    paper = {"title": "the paper's simulation", "mape": target}
    return tabulated(
        view.captioned("Simulation alone, without climate control"),
        [*rows, paper] if target is not None else rows,
        Column("Simulation", "title"),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Bias [%]", "bias"),
        in_percent("Max [%]", "max_ape"),
        Column("To the paper", to_the_paper),
    )


def improved_table(view: View) -> Table:
    """The correctors on the table's simulation and on the nearest form, with the share of trips that they improve."""
    scores = study_scores(view)
    names = shown([*CORRECTORS, *(f"{name}-brochure" for name in CORRECTORS)], scores)
    return tabulated(
        view.captioned("Correctors, and the share of trips that they improve over their simulation"),
        [scores[name] for name in names],
        Column("Corrector", "title"),
        in_words("Simulation", lambda row: scores[row["simulation"]]["title"]),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Trips improved [%]", "improved_share", 0),
    )


@panel("working-correlations", "Working correlation of the boosting")
def working_correlations(view: View) -> Content:
    """The boosting under each working correlation, and with the choice inside the fold."""
    names = ["boosting", *(model.name for model in CORRELATIONS), "boosting-chosen"]
    return _options(view, names, on_correlations, "Boosting by its working correlation")


def on_correlations(view: View) -> str:
    """Which working correlation has the lowest error, and which one the paper's row stands for."""
    scores = study_scores(view)
    names = shown(["boosting", *(model.name for model in CORRELATIONS)], scores)
    best = min(names, key=lambda name: float(scores[name]["mape"]))
    return (
        "The paper writes its rounds as trees on plain residuals, F + T(y - F): that is independence, whatever the text says of "
        "a working correlation, and so is the method of the R package (htree) that it fits its forest with. Its row stands beside "
        f"independence. Lowest here: {scores[best]['title']}, {percent(scores[best]['mape'])}. The residual grows along a trip, so "
        "rows differ by their history: only independence is then consistent, and a correlation near 1 weighs differences within "
        f"a trip and loses its level.{_on_choice(view, 'boosting-chosen')}"
    )


@panel("gamm-errors", "Errors of the GAMM")
def gamm_errors(view: View) -> Content:
    """The GAMM with independent Student's t errors, with AR(1) errors, and with the choice inside the fold."""
    names = ["gamm", *(model.name for model in GAMM_ERRORS), "gamm-chosen"]
    return _options(view, names, on_gamm_errors, "The GAMM by the model of its errors")


def on_gamm_errors(view: View) -> str:
    """The mean error with the paper's options beside its figure, and without the trip of the largest error."""
    own = study_scores(view)["gamm"]
    return (
        f"With Student's t errors, as in the paper, the mean error is {percent(own['mape'])}{interval(own)}."
        f"{gamm_beside_paper(view)} Without the trip of the largest error it is {percent(without_worst(view, 'gamm'))}."
        f"{_on_choice(view, 'gamm-chosen')}"
    )


def gamm_beside_paper(view: View) -> str:
    """Whether the interval of the GAMM's mean error contains the figure of the paper; empty without either."""
    paper, bounds = view.published.get("gamm"), study_scores(view)["gamm"].get("mape_ci95")
    if paper is None or bounds is None:
        return ""
    contains = "contains" if bounds[0] <= paper <= bounds[1] else "does not contain"
    return f" The interval {contains} the paper's {percent(paper)}."


def without_worst(view: View, name: str) -> float:
    """Mean absolute percentage error of a model of the studies without the trip of its largest error."""
    score, trips = study_scores(view)[name], int(view.results["studies"]["n_trips"])
    return (trips * float(score["mape"]) - float(score["max_ape"])) / (trips - 1)


def _on_choice(view: View, name: str) -> str:
    """How often each candidate was chosen inside the fold, and the error of the choice."""
    scores = study_scores(view)
    chosen = ((view.results.get("studies") or {}).get("choices") or {}).get(name)
    if not chosen or name not in scores:
        return ""
    parts = [f"{scores[model]['title']} in {count}" for model, count in chosen.items()]
    return f" Chosen inside the fold: {listed(parts)} folds; mean error {percent(scores[name]['mape'])}."


def _options(view: View, names: Sequence[str], say: Callable[[View], str], caption: str) -> Content:
    scores = study_scores(view)
    if not all(name in scores for name in names):
        return Content(ABSENT)
    rows, paper = [scores[name] for name in names], view.published.get(names[0])
    best = min(range(len(names)), key=lambda i: float(rows[i]["mape"]))
    table = tabulated(
        view.captioned(caption),
        rows if paper is None else [*rows, {"title": "the paper", "mape": paper}],
        Column("Model", "title"),
        in_percent("Mean error [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Median [%]", "median_ape"),
        in_percent("Max [%]", "max_ape"),
        Column("Fit [s]", "fit_s"),
        strong=frozenset({best}),
    )
    return Content(say(view), tables=(table,))


@panel("trips-needed", "How many trips the hybrid needs", draws=True)
def trips_needed(view: View) -> Content:
    """The learning curves of the hybrid and of the data-driven boosting, with their crossing."""
    needed = (view.results.get("studies") or {}).get("trips_needed")
    if not needed:
        return Content(ABSENT)
    return Content(on_trips_needed(needed, view.scores), plot_trips_needed(view, needed))


def on_trips_needed(needed: Record, scores: Mapping[str, Record] = MappingProxyType({})) -> str:
    """The number of trips with which the hybrid has the error that the data-driven model has with the most trips.

    `scores` of the main evaluation show how strong the data-driven model is beside a regression of a few coefficients.
    """
    hybrid, alone = CURVE_MODELS
    most = needed["curve"][-1]
    least = needed["curve"][0]
    said = (
        f"With {most['n_trips']} training trips the mean error of {label(alone)} is {percent(most[alone])}, that of {label(hybrid)} "
        f"{percent(most[hybrid])}"
    )
    if needed["crossing"] is None:
        return f"{said}. At no number of trips is the hybrid's error as low as {percent(most[alone])}."
    low, high = needed["crossing_ci95"]
    reach = f"{low:.1f} to {'beyond the curve' if high is None else f'{high:.1f}'}"
    floor = ""
    if needed["crossing"] <= least["n_trips"]:
        floor = f", the fewest that were tried ({percent(least[hybrid])} with them)"
    return (
        f"{said}. The hybrid has the former error with {needed['crossing']:.1f} trips (95 % interval {reach}){floor}: it needs less "
        f"data than the data-driven model, as the paper states without a figure. Means over {most['draws']} random draws of each "
        f"number, scored on all other trips; the interval is a bootstrap over draws and trips.{_weakness(most[alone], scores)}"
    )


def stronger_baseline(error: float, scores: Mapping[str, Record]) -> str | None:
    """The regression of a few coefficients with the lowest error, where that is below `error`."""
    linear = [name for name in ("linear4", "linear6") if name in scores]
    best = min(linear, key=lambda name: float(scores[name]["mape"]), default=None)
    return best if best is not None and float(scores[best]["mape"]) < error else None


def _weakness(error: float, scores: Mapping[str, Record]) -> str:
    """That the data-driven model is a weak rival, where a regression of a few coefficients has a lower error."""
    best = stronger_baseline(error, scores)
    if best is None:
        return ""
    return (
        f" The data-driven model of this comparison is weak: {label(best)} has {percent(scores[best]['mape'])}, each trip left out in turn. "
        "So the crossing says little of a good model without physics."
    )


def plot_trips_needed(view: View, needed: Record) -> Figure:
    """Mean error against the number of training trips, with the crossing and its interval."""
    figure, axes = plotted(view, 3.7, "How many training trips it takes", view.note)
    curve: Sequence[Record] = needed["curve"]
    hybrid, alone = CURVE_MODELS
    sizes = plot_sizes(axes, curve, (alone, hybrid))
    target = 100.0 * float(curve[-1][alone])
    axes.axhline(target, color=INK, lw=0.8, ls=":")
    if needed["crossing"] is not None:
        bounds = [sizes[-1] if end is None else float(end) for end in needed["crossing_ci95"]]
        axes.plot(bounds, [target, target], color=INK, lw=3.0, solid_capstyle="butt", gid="interval")
        words = "crossing, 95 % interval"
        axes.plot(needed["crossing"], target, "D", color=INK, ms=5, gid="crossing", label=words)
    return legend_below(figure, 3)
