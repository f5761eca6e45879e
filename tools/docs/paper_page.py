"""`docs/explanation/paper.md`: every figure, table, equation and claim of arXiv:2405.10984 beside ours, with the difference and why.

The numbers come from the `results.json` of the protocol `paper` and of the protocol `cars`; the figures are those of the report.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tools.docs.tables import markdown, on_names
from tripwatt.study.evaluation.paper_studies import CURVE_MODELS
from tripwatt.study.paper.correctors import SIMULATION
from tripwatt.study.report.covariates import term_in_words
from tripwatt.study.report.panels import paper_studies
from tripwatt.study.report.panels.results_table import results_table
from tripwatt.study.report.tables import DASH, Column, Table, in_percent, make_table, number
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import listed, model_label, percent, points

Cars = Mapping[str, Any]

PAPER_TABLE2: Final[Mapping[str, str]] = tomllib.loads(
    Path(__file__).with_name("paper_table2.toml").read_text("utf-8")
)
"""What the paper prints for its GAMM in its Table 2, by our names of the terms."""

PAPER_TRIPS: Final = 72
"""Trips that the paper's data set has, each of which it leaves out once (Methodology)."""

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
    return {**view.scores, **paper_studies.study_scores(view)}[name]


def _beside(view: View, name: str) -> str:
    """Our mean error beside the paper's."""
    ours, paper = _score(view, name)["mape"], view.published[name]
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
    value, spread = (record[k] for k in (("edf", "ref_df") if "edf" in record else ("estimate", "std_error")))
    p = record["p_value"]
    stars = "" if p is None else "*" * sum(p < bound for bound in (0.05, 0.01, 0.001))
    return term_in_words(record["term"]), f"{number(value)}\u00a0({number(spread)}){stars}"


def on_trip_df(view: View) -> str:
    """How many trips the paper's Table 2 was fitted on, from the reference df of its random effect."""
    rows = {table2_row(record)[0]: record for record in view.results["table2"]}
    weathers = [record["std_error"] for name, record in rows.items() if name.startswith("weather: ")]
    fitted = PAPER_TRIP_DF + 1 + PAPER_WEATHERS
    return (
        "mgcv's reference df of a random effect is the number of its levels less the number of columns that are constant within a "
        f"level. With the intercept and {PAPER_WEATHERS} weather coefficients, the {PAPER_TRIP_DF} of the paper's s(Trip.id) are "
        f"those of {fitted} trips, not of {PAPER_TRIPS}. Its weathers rainy and dark, little rainy have no estimate: none of the "
        "trips with them (TripA15, TripA16, TripB02 of the data set's sheet) was in the fit. All eight weathers of the sheet are "
        "printed, so its reference is a ninth one, which the sheet does not have. "
        f"Here {view.main['n_trips']} trips, an intercept and {sum(e > 0 for e in weathers)} of {len(weathers)} weather coefficients with data leave "
        f"{number(rows['s(trip)']['ref_df'], 1.0, 0)}."
    )


def _table2(view: View, cars: Cars) -> str:
    smooths = dict(map(table2_row, view.results["table2"]))
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


def _tables(text: str, *tables: Callable[[View], Table]) -> Callable[[View, Cars], str]:
    return lambda view, cars: "\n\n".join([text, *(markdown(table(view)) for table in tables)])


def _table3(view: View, cars: Cars) -> str:
    return "\n\n".join([markdown(results_table(view)), _PHYSICS_GAP, on_names(view)])


def _trips(view: View, cars: Cars) -> str:
    study = view.results["studies"]["trips_needed"]
    low, high = study["crossing_ci95"]
    text = (
        f"The hybrid has the error that the data-driven model has with all trips with {study['crossing']:.1f} trips (95 % interval {low:.1f} to "
        f"{'beyond the curve' if high is None else f'{high:.1f}'}). Means over {study['curve'][-1]['draws']} random draws of each number, scored on all other "
        "trips; the interval is a bootstrap over draws and trips. Where a regression of a few coefficients has a lower error "
        "than the data-driven model, the crossing says little of a good model without physics."
    )
    image = "![Mean error against the number of training trips](../images/paper-trips-needed.png)"
    table = make_table(
        "Mean error [%]",
        study["curve"],
        Column("Training trips", "n_trips", digits=0),
        *(in_percent(model_label(name), name) for name in CURVE_MODELS),
    )
    return "\n\n".join([text, image, markdown(table)])


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
    sentences = "; ".join(parts)
    return f"{sentences[:1].upper()}{sentences[1:]}." if sentences else "No other car was measured."


def _cars(view: View, cars: Cars) -> str:
    return f"{on_cars(cars)} [Any car](cars.md) has the errors of every car, by own trips, and the method."


def _improved(view: View) -> str:
    now, then = (
        listed(
            [percent(_score(view, f"{name}{form}")["improved_share"], 0) for name in paper_studies.CORRECTORS]
        )
        for form in ("", "-brochure")
    )
    return f"{then} of the trips on the nearest form of the simulation, {now} on the table's; the paper: over 90 % of the trips"


def _needed(view: View) -> str:
    study = view.results["studies"]["trips_needed"]
    largest, alone = study["curve"][-1], CURVE_MODELS[1]
    weak = min(view.scores[name]["mape"] for name in ("linear4", "linear6")) < largest[alone]
    return (
        f"{study['crossing']:.1f} trips reach the {percent(largest[alone])} that the data-driven model{', which is weak,' if weak else ''} has with "
        f"{largest['n_trips']}; the paper gives no figure"
    )


def _physics(view: View) -> str:
    scores, nearest = paper_studies.study_scores(view), view.results["studies"]["nearest"]
    return f"{_beside(view, SIMULATION)}; {percent(scores[nearest]['mape'])} with published values and without auxiliaries"


def _boosting_difference(view: View) -> str:
    same, chosen = (percent(_score(view, name)["mape"]) for name in ("boosting", "boosting-chosen"))
    paper = percent(view.published["boosting"])
    return f"{same} with the options of the paper, {chosen} when chosen inside the fold, {paper} in the paper"


_PHYSICS_GAP = (
    "The physics here and in the paper differ because the paper names no parameter of its MATLAB car (mass, drag, rolling resistance, efficiencies, "
    "auxiliaries), so ours takes measured coast-down values and a drivetrain from named sources. Both leave out the climate and "
    "take back 50 % of the braking energy."
)
_FORMS = (
    "The paper prints no parameter of its simulation but the 50 % of regeneration. These are forms with published values; the first is "
    "the table's own, with the measured coast-down. The share of trips that a corrector improves depends on how poor the simulation "
    "is, and so does not measure the corrector."
)
_CORRELATIONS = (
    "The paper writes its rounds as trees on plain residuals, F + T(y - F): that is independence, whatever the text says of "
    "a working correlation, and so is the method of the R package (htree) that it fits its forest with. Its row stands beside "
    "independence. The residual grows along a trip, so rows differ by their history: only independence is then consistent, and a "
    "correlation near 1 weighs differences within a trip and loses its level."
)
_TIMES = (
    "The paper prints no time; it says that GAMMs have a longer running time compared to the others. [The table](#table-3) has the times of a fit and of "
    "the prediction of one trip: wall times on a machine of two cores with a process on each, with one thread of linear algebra in each."
)

_EQUATIONS = """\
| The paper | Here |
|:--|:--|
| (1) absolute percentage error of the cumulative energy at the end of the trip | `tripwatt.study.evaluation.metrics.absolute_percentage_error` |
| (2) GAMM: sum of smooths and random effects | [the engine](gam.md), `tripwatt_gamm.GAMM` |
| (3) density of Student's t | `tripwatt_gamm.ScaledT`, ν and σ estimated, ν at least 3 |
| (4) F(k+1) = F(k) + T(k+1), boosting rounds chosen by leaving subjects out | `tripwatt.learners.boosting.ClusteredBoosting` |
| steps 1 to 4: simulate, take the residual, learn it, add it | `tripwatt.study.paper.HybridModel` |"""


def _longest_agrees(view: View) -> str:
    longest = max(paper_studies.CORRECTORS, key=lambda name: float(view.scores[name]["fit_s"]))
    return "confirmed" if longest == PAPER_LONGEST else f"not so here: {model_label(longest)}"


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
        _same("none"),
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
        lambda view: "; ".join(f"{model_label(n)} {_beside(view, n)}" for n in paper_studies.CORRECTORS),
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
            f"{model_label(n)} {_beside(view, n)}" for n in (SIMULATION, *paper_studies.CORRECTORS)
        ),
        _table3,
    ),
    Element(
        "physics",
        "Table 3, row Purely Physics-based model: 0.379",
        "forms of the simulation with published values",
        _physics,
        _tables(_FORMS, paper_studies.forms_table, paper_studies.improved_table),
    ),
    Element(
        "gamm",
        "Table 3, row GAMM with Student's t family: 0.115",
        "errors of the GAMM",
        lambda view: _beside(view, "gamm"),
        _tables("Student's t errors are those of the paper.", paper_studies.gamm_errors_table),
    ),
    Element(
        "boosting",
        "Table 3, row Boosting: 0.103, as a GEE",
        "working correlations",
        _boosting_difference,
        _tables(_CORRELATIONS, paper_studies.correlations_table),
    ),
    Element(
        "figure-9",
        "Figure 9: physics, data-driven and hybrid",
        "the same three box plots",
        lambda view: (
            f"largest error of the data-driven model {percent(_score(view, 'boosting-only')['max_ape'], 0)} here, almost 80 % in the paper"
        ),
        _image("benchmark-boxes", "Box plots of physics, hybrid and data-driven boosting"),
    ),
    Element(
        "improved",
        "Claim: over 90 % of the trips are improved",
        "share of trips, on two simulations",
        _improved,
        lambda view, cars: "[The table of the correctors](#physics) has the share for each simulation.",
    ),
    Element("less-data", "Claim: less data than purely data-driven", "learning curve", _needed, _trips),
    Element(
        "times",
        "Claim: the GAMM runs longest",
        "times of one fit and of one prediction",
        _longest_agrees,
        lambda view, cars: _TIMES,
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
            "little the errors depend on the choice. [Table 2](#table-2) shows on how many trips the paper's GAMM was fitted."
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
