"""`docs/explanation/paper.md`: every figure, table, equation and claim of arXiv:2405.10984 beside ours, with the difference and why.

The numbers come from the `results.json` of the protocol `paper` and of the protocol `cars`; the figures are those of the report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from tools.docs.tables import markdown
from tripwatt.evaluation.paper_studies import CURVE_MODELS
from tripwatt.paper.correctors import SIMULATION
from tripwatt.report.covariates import term_in_words
from tripwatt.report.model_styles import PAPER_IMPROVED, PAPER_TRIPS
from tripwatt.report.panel import PanelSpec
from tripwatt.report.panels import paper_studies
from tripwatt.report.panels.gamm_summary import PAPER_TABLE2
from tripwatt.report.panels.running_time import PAPER_SAYS
from tripwatt.report.tables import DASH, Table, number, span
from tripwatt.report.view import Record, View
from tripwatt.report.words import interval, label, listed, percent, points

Cars = Mapping[str, Any]

PAPER_LONGEST: Final = "gamm"
"""The corrector that takes longest by the paper (its conclusion)."""

FIGURES: Final = (
    "gamm-diagnosis",
    "gamm-smooths",
    "gamm-surface",
    "gamm-random",
    "error-distribution",
    "error-boxes",
    "benchmark-boxes",
    "trips-needed",
)
"""Figures of the report that the page shows, as `docs/images/paper-<name>.png`."""

SCHEMATICS: Final = ("simulation", "hybrid")
"""Figures that `tools.docs.schematics` draws, under the same kind of name."""

VARIABLES: Final = (
    ("Time", "`time_s` [s]"),
    ("Trip.id", "`Trip.trip_id`, the cluster and no input"),
    ("Seasonality", "`Trip.context.season`"),
    ("Weather", "`Trip.context.weather`"),
    ("Velocity", "`speed_m_s` [m/s]"),
    ("Elevation", "`elevation_m` [m]; the correctors read its difference to the start of the trip"),
    ("Battery temperature", "`battery_temperature_degc` [°C]"),
    ("Requested heating power", "`requested_heating_power_w` [W]"),
    ("Air conditioner power", "`aircon_power_w` [W]"),
    ("Ambient temperature", "`ambient_temperature_degc` [°C]"),
    ("Battery current", "`current_a` [A], + discharges (in the files a discharge is negative)"),
    ("Battery voltage", "`voltage_v` [V]"),
)
"""The paper's Table 1, and where each variable is here."""

MACHINE: Final = "These are wall times on a machine of two cores with a process on each, in which linear algebra has one thread."
"""What the times of a published run stand for (`tools.docs.make_results`)."""

PAPER_TRIP_DF: Final = 57
"""Reference df of s(Trip.id) in the paper's Table 2."""

PAPER_WEATHERS: Final = 6
"""Weather coefficients with a standard error in the paper's Table 2; two more are 0.00 (0.00)."""


@dataclass(frozen=True, slots=True)
class Element:
    """Something that the paper shows or states.

    Attributes
    ----------
    key : str
        Anchor on the page.
    paper : str
        What and where in the paper.
    ours : str
        What stands for it here.
    difference : callable
        Sentence from the results.
    content : callable
        Text below the heading, from the results of both protocols.
    """

    key: str
    paper: str
    ours: str
    difference: Callable[[View], str]
    content: Callable[[View, Cars], str]


def _same(text: str) -> Callable[[View], str]:
    return lambda view: text


def _image(name: str, alt: str, text: str = "") -> Callable[[View, Cars], str]:
    shown = f"![{alt}](../images/paper-{name}.png)"
    return lambda view, cars: "\n\n".join(filter(None, [shown, text]))


def _score(view: View, name: str) -> Record:
    return paper_studies.study_scores(view).get(name) or view.scores.get(name) or {}


def _beside(view: View, name: str) -> str:
    """Our mean error beside the paper's."""
    ours, paper = _score(view, name).get("mape"), view.published.get(name)
    if ours is None or paper is None:
        return "not in this run"
    return f"{percent(ours)} here, {percent(paper)} in the paper ({points(ours - paper)})"


def _table1(view: View, cars: Cars) -> str:
    return markdown(Table("Variables", ("The paper", "Here"), VARIABLES, frozenset({0, 1})))


def table2_row(record: Record) -> tuple[str, str]:
    r"""Name of a term and its two numbers as the paper prints them.

    Examples
    --------
    >>> table2_row({"term": "weatherdark", "estimate": 1.0, "std_error": 2.0, "p_value": 0.04})
    ('weather: dark', '1.00\xa0(2.00)*')
    >>> table2_row({"term": "s(time_s):seasonwinter", "edf": 4.3, "ref_df": 4.8, "p_value": 0.0})
    ('s(time):winter', '4.30\xa0(4.80)***')
    """
    term = str(record["term"])
    name = f"weather: {term.removeprefix('weather')}" if term.startswith("weather") else term_in_words(term)
    first, second = (record[k] for k in (("edf", "ref_df") if "edf" in record else ("estimate", "std_error")))
    p = record["p_value"]
    stars = "" if p is None else "*" * sum(p < bound for bound in (0.05, 0.01, 0.001))
    return name, f"{number(first)}\u00a0({number(second)}){stars}"


def on_trip_df(view: View) -> str:
    """How many trips the paper's Table 2 was fitted on, from the reference df of its random effect."""
    own = {table2_row(record)[0]: record for record in view.results.get("table2") or ()}
    trips = own.get("s(trip)")
    fitted = PAPER_TRIP_DF + 1 + PAPER_WEATHERS
    text = (
        "mgcv's reference df of a random effect is the number of its levels less the number of columns that are constant within a "
        f"level. With the intercept and {PAPER_WEATHERS} weather coefficients, the {PAPER_TRIP_DF} of the paper's s(Trip.id) are "
        f"those of {fitted} trips, not of {PAPER_TRIPS}. Its weathers rainy and dark, little rainy have no estimate: none of the "
        "trips with them (TripA15, TripA16, TripB02 of the data set's sheet) was in the fit. All eight weathers of the sheet are "
        "printed, so its reference is a ninth one, which the sheet does not have."
    )
    if trips is None:
        return text
    weathers = sum(name.startswith("weather: ") for name in own)
    known = sum(1 for name, r in own.items() if name.startswith("weather: ") and r["std_error"] > 0)
    return (
        f"{text} Here {view.main.get('n_trips')} trips, an intercept and {known} of {weathers} weather coefficients with data leave "
        f"{number(trips['ref_df'], 1.0, 0)}."
    )


def _table2(view: View, cars: Cars) -> str:
    smooths = dict(table2_row(record) for record in view.results.get("table2") or ())
    if not smooths:
        return "The GAMM was not among the models of the run."
    names = [*PAPER_TABLE2, *(name for name in smooths if name not in PAPER_TABLE2)]
    rows = tuple((name, smooths.get(name, DASH), PAPER_TABLE2.get(name, DASH)) for name in names)
    caption = "Estimate (standard error) in Wh, EDF (reference df) of a smooth; *** p < 0.001, ** p < 0.01, * p < 0.05"
    table = Table(caption, ("Term", "Here", "The paper"), rows)
    why = (
        "The terms are those of the paper. Season is an ordered factor, so its smooths are centred differences of winter from "
        "summer; with a number 0/1 the smooth would not be centred and could not have the EDF 1.00 (1.00) that the paper prints. "
        "The estimates differ because they explain what another simulation leaves, on other trips."
    )
    return "\n\n".join([markdown(table), why, on_trip_df(view)])


def _panel(spec: PanelSpec) -> Callable[[View, Cars], str]:
    def shown(view: View, cars: Cars) -> str:
        content = spec.content(view)
        assert content is not None
        return "\n\n".join([content.sentence, *(markdown(table) for table in content.tables)])

    return shown


def _table3(view: View, cars: Cars) -> str:
    shown = (SIMULATION, *paper_studies.CORRECTORS, CURVE_MODELS[1])
    rows = tuple(
        (
            label(name),
            number(view.scores[name]["mape"], 100, 1),
            span(view.scores[name]["mape_ci95"]),
            number(view.published.get(name), 100, 1),
        )
        for name in shown
        if name in view.scores
    )
    head = ("Model", "Mean error here [%]", "95 % interval", "The paper [%]")
    more = (
        "[The results](results.md#as-in-the-paper) have every model, also on other sets of trips, with times."
    )
    return "\n\n".join([markdown(Table("Average errors", head, rows)), more])


def _times(view: View, cars: Cars) -> str:
    said = [f"{label(name)}: {words}." for name, words in PAPER_SAYS.items()]
    return f"The paper prints no time. Its words on the {' '.join(said)} [The results](results.md) have ours. {MACHINE}"


def _trips(view: View, cars: Cars) -> str:
    study = (view.results.get("studies") or {}).get("trips_needed")
    if not study:
        return paper_studies.ABSENT
    rows = tuple(
        (str(row["n_trips"]), *(number(row[name], 100, 1) for name in CURVE_MODELS)) for row in study["curve"]
    )
    table = Table("Mean error [%]", ("Training trips", *map(label, CURVE_MODELS)), rows)
    image = "![Mean error against the number of training trips](../images/paper-trips-needed.png)"
    return "\n\n".join([paper_studies.on_trips_needed(study, view.scores), image, markdown(table)])


def own_models(cars: Cars) -> list[Record]:
    """The cars with a model of their own."""
    return [car for car in cars.get("cars", ()) if car.get("own_model")]


def on_cars(cars: Cars) -> str:
    """Whether a model from other cars and own trips is as accurate as one of the car's own trips alone."""
    kept: list[str] = []
    lost: list[str] = []
    for car in own_models(cars):
        worse = car["curves"]["population"][-1]["error"] > car["own_model"]["error"]
        (lost if worse else kept).append(str(car["vehicle_title"]))
    parts = []
    if kept:
        parts.append(
            f"for {listed(kept)} what other cars show, with the same trips, is no worse than the car's own model"
        )
    if lost:
        parts.append(f"for {listed(lost)} the own model has a lower error")
    said = "; ".join(parts)
    return f"{said[:1].upper()}{said[1:]}." if said else "No other car was measured."


def _cars(view: View, cars: Cars) -> str:
    if not own_models(cars):
        return "No other car was measured."
    return f"{on_cars(cars)} [Any car](cars.md) has the errors of every car, by own trips, and the method."


def _improved(view: View) -> str:
    scores = paper_studies.study_scores(view)
    names = [n for n in paper_studies.CORRECTORS if f"{n}-brochure" in scores and n in scores]
    if not names:
        return "not in this run"
    now = [percent(scores[n]["improved_share"], 0) for n in names]
    then = [percent(scores[f"{n}-brochure"]["improved_share"], 0) for n in names]
    return f"{listed(then)} of the trips on the nearest form of the simulation, {listed(now)} on the table's; the paper: {PAPER_IMPROVED}"


def _needed(view: View) -> str:
    study = (view.results.get("studies") or {}).get("trips_needed") or {}
    if study.get("crossing") is None:
        return "not in this run"
    most = study["curve"][-1]
    error = most[CURVE_MODELS[1]]
    weak = ", which is weak," if paper_studies.stronger_baseline(error, view.scores) else ""
    floor = "at most " if study["crossing"] <= study["curve"][0]["n_trips"] else ""
    return (
        f"{floor}{study['crossing']:.3g} trips reach the {percent(error)} that the data-driven model{weak} has with {most['n_trips']}; "
        "the paper gives no figure"
    )


def _physics(view: View) -> str:
    scores, paper = paper_studies.study_scores(view), view.published.get(SIMULATION)
    nearest = str((view.results.get("studies") or {}).get("nearest"))
    if paper is None or nearest not in scores:
        return _beside(view, SIMULATION)
    return f"{_beside(view, SIMULATION)}; {percent(scores[nearest]['mape'])} with published values and without auxiliaries"


def _gamm_difference(view: View) -> str:
    score = paper_studies.study_scores(view).get("gamm")
    if score is None:
        return "not in this run"
    least = percent(paper_studies.without_worst(view, "gamm"))
    beside = paper_studies.gamm_beside_paper(view)
    return f"{percent(score['mape'])}{interval(score)}.{beside} Without the trip of the largest error {least}"


def _boosting_difference(view: View) -> str:
    ours, paper = _score(view, "boosting-chosen").get("mape"), view.published.get("boosting")
    if ours is None or paper is None:
        return "not in this run"
    same = f"{percent(_score(view, 'boosting').get('mape'))} with the options of the paper, "
    return f"{same}{percent(ours)} when chosen inside the fold, {percent(paper)} in the paper"


_EQUATIONS = """\
| The paper | Here |
|:--|:--|
| (1) absolute percentage error of the cumulative energy at the end of the trip | `tripwatt.evaluation.metrics.absolute_percentage_error` |
| (2) GAMM: sum of smooths and random effects | [the engine](gam.md), `tripwatt.gam.GAMM` |
| (3) density of Student's t | `tripwatt.gam.ScaledT`, ν and σ estimated, ν at least 3 |
| (4) F(k+1) = F(k) + T(k+1), boosting rounds chosen by leaving subjects out | `tripwatt.learners.boosting.ClusteredBoosting` |
| steps 1 to 4: simulate, take the residual, learn it, add it | `tripwatt.paper.HybridModel` |"""


def _longest(view: View) -> str:
    names = [n for n in paper_studies.CORRECTORS if n in view.scores]
    return max(names, key=lambda n: float(view.scores[n]["fit_s"]), default=PAPER_LONGEST)


def _longest_agrees(view: View) -> str:
    longest = _longest(view)
    return "confirmed" if longest == PAPER_LONGEST else f"not so here: {label(longest)}"


ELEMENTS: Final = (
    Element(
        "figure-1",
        "Figure 1: schematic of the simulation",
        "redrawn from the code",
        _same("none in structure; the values are named here"),
        _image(
            "simulation",
            "From time, speed and grade over road load and drivetrain to battery and energy",
            "Drawn from the car under the preset `paper`; [the car model](car-model.md) has every value.",
        ),
    ),
    Element(
        "figure-2",
        "Figure 2: prediction for a trip",
        "redrawn from the code",
        _same("none"),
        _image("hybrid", "Simulated energy plus the correction of a learner gives the energy of the trip"),
    ),
    Element(
        "table-1",
        "Table 1: variables of the data set",
        "columns and context of a trip",
        _same("units are SI; the signs are stated"),
        _table1,
    ),
    Element(
        "equations",
        "Equations 1 to 4 and the four steps",
        "classes and functions",
        _same("none"),
        lambda view, cars: _EQUATIONS,
    ),
    Element(
        "figure-3",
        "Figure 3: diagnosis of the GAMM",
        "the same four plots",
        _same("ν is at its bound of 3, as in mgcv's fits"),
        _image("gamm-diagnosis", "Q-Q plot against the fitted t, residuals, histogram, response and fitted"),
    ),
    Element(
        "figure-4",
        "Figure 4: smooths and random effects",
        "smooths, surface and random effects",
        _same("a smooth whose band is wider than the data is named in place of its curve"),
        lambda view, cars: "\n\n".join(
            f"![{alt}](../images/paper-{name}.png)"
            for name, alt in (
                ("gamm-smooths", "Smooths of time, ambient temperature, speed and elevation difference"),
                ("gamm-surface", "Surface of ambient temperature and elevation difference"),
                ("gamm-random", "Effects of trips against Gaussian quantiles"),
            )
        ),
    ),
    Element(
        "table-2",
        "Table 2: summary of the GAMM",
        "the same terms, estimate by estimate",
        _same(
            "s(ambient):winter has EDF 1.00 (1.00) in both; other terms explain another simulation's residual"
        ),
        _table2,
    ),
    Element(
        "figures-5-to-7",
        "Figures 5, 6 and 7: error distributions of GAMM, forest and boosting",
        "one figure with every model",
        lambda view: "; ".join(f"{label(n)} {_beside(view, n)}" for n in paper_studies.CORRECTORS),
        _image("error-distribution", "Distribution of the errors of every model over the held-out trips"),
    ),
    Element(
        "figure-8",
        "Figure 8: box plots of the models",
        "box plots of every model",
        lambda view: f"physics: {_beside(view, SIMULATION)}",
        _image("error-boxes", "Box plots of the errors"),
    ),
    Element(
        "table-3",
        "Table 3: average errors",
        "the main table of the protocol",
        lambda view: "; ".join(
            f"{label(n)} {_beside(view, n)}" for n in (SIMULATION, *paper_studies.CORRECTORS)
        ),
        _table3,
    ),
    Element(
        "physics",
        "Table 3, row Purely Physics-based model: 0.379",
        "forms of the simulation with published values",
        _physics,
        _panel(paper_studies.simulation_forms),
    ),
    Element(
        "gamm",
        "Table 3, row GAMM with Student's t family: 0.115",
        "errors of the GAMM",
        _gamm_difference,
        _panel(paper_studies.gamm_errors),
    ),
    Element(
        "boosting",
        "Table 3, row Boosting: 0.103, as a GEE",
        "working correlations",
        _boosting_difference,
        _panel(paper_studies.working_correlations),
    ),
    Element(
        "figure-9",
        "Figure 9: physics, data-driven and hybrid",
        "the same three box plots",
        lambda view: (
            f"largest error of the data-driven model {percent(_score(view, 'boosting-only').get('max_ape'), 0)} here, almost 80 % in the paper"
        ),
        _image("benchmark-boxes", "Box plots of physics, hybrid and data-driven boosting"),
    ),
    Element(
        "improved",
        "Claim: over 90 % of the trips are improved",
        "share of trips, on two simulations",
        _improved,
        lambda view, cars: (
            "The second table on the row *Purely Physics-based model* has the shares on both simulations."
        ),
    ),
    Element("less-data", "Claim: less data than purely data-driven", "learning curve", _needed, _trips),
    Element(
        "times",
        "Claim: the GAMM runs longest",
        "times of one fit and of one prediction",
        _longest_agrees,
        _times,
    ),
    Element(
        "cars",
        "Claim: another vehicle without sacrificing the accuracy",
        "cars that took no part, without and with own trips",
        _same("measured, see there"),
        _cars,
    ),
    Element(
        "trips",
        f"Data: {PAPER_TRIPS} trips",
        "58 reference trips, of 70 of the published data set",
        lambda view: f"{view.main.get('n_trips')} trips scored here",
        lambda view, cars: (
            "The published data set has 70 trips; the paper scores 72 and names none. [Other sets of trips](results.md) show how "
            "little the errors depend on the choice. Table 2 shows how many trips the paper's GAMM was fitted on."
        ),
    ),
)
"""Everything that the paper shows or states, in its order."""


def render_paper_page(results: Mapping[str, Any], cars: Cars = MappingProxyType({})) -> str:
    """The list of all elements with links, and a section for each.

    Parameters
    ----------
    results : mapping
        `results.json` of the protocol `paper`.
    cars : mapping
        `results.json` of the protocol `cars`.
    """
    view = View(results)
    rows = [
        "| In the paper | Here | Difference |",
        "|:--|:--|:--|",
        *(
            f"| {e.paper} | [{e.ours}](#{e.key}) | {e.difference(view).replace('|', chr(92) + '|')} |"
            for e in ELEMENTS
        ),
    ]
    sections = [f'<a id="{e.key}"></a>\n\n## {e.paper}\n\n{e.content(view, cars)}' for e in ELEMENTS]
    origin = (
        f"Protocol `{results.get('protocol', '?')}`, seed {results.get('seed', '?')}, {view.note}; written from `results.json` by "
        "`tools.docs.publish_results`."
    )
    return "\n\n".join(["\n".join(rows), *sections, origin])
