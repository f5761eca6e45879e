"""`docs/explanation/paper.md`: every claim, equation, figure and table of arXiv:2405.10984 as a row with a verdict and our figure.

The numbers come from the `results.json` of the protocol `paper`, of `benchmarks.transfer` and of `benchmarks.paper_claims`; the figures are
those of the report. Verdicts that depend on a figure are computed from it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.stats import norm

from tools.docs import transfer_page
from tools.docs.tables import markdown
from tripwatt.learners.forest import ClusteredForest
from tripwatt.study.evaluation.paper_studies import CURVE_MODELS, NEAREST
from tripwatt.study.paper.correctors import SIMULATION
from tripwatt.study.report.covariates import term_in_words
from tripwatt.study.report.intervals import STAR
from tripwatt.study.report.panels import paper_studies
from tripwatt.study.report.panels.paired import SIGNIFICANCE_NOTE
from tripwatt.study.report.tables import DASH, Column, Table, in_percent, make_table, number, span
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import listed, model_label, percent, points

PAPER_TABLE2: Final[Mapping[str, str]] = tomllib.loads(
    Path(__file__).with_name("paper_table2.toml").read_text("utf-8")
)
"""What the paper prints for its GAMM in its Table 2, by our names of the terms."""

PAPER_EDF: Final = tuple(
    float(text.split()[0]) for term, text in PAPER_TABLE2.items() if term.startswith("s(")
)
"""EDF of the paper's Table 2, in its order."""

POWER_STEP_S: Final = 10
"""Spacing of rows of the power at which the fits of our engine and of mgcv are compared."""

FINE_STEP_S: Final = 5
"""Spacing of rows of the power with the EDF nearest to the paper's."""

PAPER_TRIPS: Final = 72
"""Trips that the paper's data set has, each of which it leaves out once (Methodology)."""

PAPER_ALONE_MAX: Final = 0.8
"""Largest error of the purely data-driven model, which the paper calls "almost 0.8"."""

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


class Sources(NamedTuple):
    """What the page rests on: the run of the protocol `paper`, that on other vehicles, and the tests of the claims."""

    view: View
    transfer: Mapping[str, Any]
    claims: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Claim:
    """Something that the paper shows or states, in the order of the paper.

    Attributes
    ----------
    paper : str
        Place and content in the paper.
    verdict : callable or str
        One of `VERDICTS`.
    ours : callable or str
        Our figure, or the reason.
    run : str
        One of `RUNS`; empty where no figure is shown.
    """

    paper: str
    verdict: Callable[[Sources], str] | str
    ours: Callable[[Sources], str] | str
    run: str = ""


VERDICTS: Final = {
    "form": "built or drawn as in the paper; of its pictures only the text was at hand",
    "deviates": "built in another way, which is named",
    "yes": "our figure supports it; of Table 3, within one point",
    "partly": "a part of it, on one of our forms, or within its interval",
    "no": "our figure contradicts it",
    "untestable": "these data cannot tell, or it is cited",
}

RUNS: Final = {
    "P": "`tripwatt evaluate data/tum --protocol paper`",
    "Q": "`python -m benchmarks.paper_claims`",
    "R": "`Rscript benchmarks/table2_mgcv.R FOLDER docs/results/table2_mgcv.csv`",
    "T": "`python -m benchmarks.transfer`",
}
"""Letters of the commands."""


def say(holds: bool, otherwise: str = "no") -> str:
    """Verdict of a statement that a figure decides."""
    return "yes" if holds else otherwise


def _score(s: Sources, name: str) -> Record:
    return {**s.view.scores, **paper_studies.study_scores(s.view)}[name]


def _beside(s: Sources, name: str) -> str:
    """Our mean error beside the paper's."""
    ours, paper = _score(s, name)["mape"], s.view.published[name]
    return f"{percent(ours)} ({points(ours - paper)})"


def _power(s: Sources, model: str, simulation: str | None = NEAREST) -> Record:
    """Scores of a model of the power."""
    (row,) = (r for r in s.claims["power"] if (r["model"], r["simulation"]) == (model, simulation))
    return dict(row)


def _pair(pairs: Sequence[Record], a: str, b: str) -> Record:
    (row,) = (r for r in pairs if (r["a"], r["b"]) == (a, b))
    return row


def _below(s: Sources, corrector: str) -> Record:
    """By how much a corrector is below the simulation."""
    return _pair(s.view.results["paired"], SIMULATION, corrector)


def _gap(pair: Record) -> str:
    star = STAR if pair["significant"] else ""
    return f"{points(pair['diff'])} ({span(pair['ci95'])}){star}"


def _tails(s: Sources, name: str) -> Record:
    return dict(s.claims["figure3"]["fits"][name])


def _option(s: Sources, model: str, option: str) -> str:
    """Errors of the trees under an option, lowest to highest."""
    (row,) = (r for r in s.claims["options"] if (r["model"], r["option"]) == (model, option))
    low, high = min(row["errors"]), max(row["errors"])
    return percent(low) if len(row["errors"]) == 1 else f"{100 * low:.1f} to {percent(high)}"


def _weathers(s: Sources) -> tuple[int, int]:
    """Weather coefficients that differ from 0 at 5 %, and all with data."""
    p = [r["p_value"] for r in s.view.results["table2"] if r["term"].startswith("weather")]
    known = [value for value in p if value is not None]
    return sum(value < 0.05 for value in known), len(known)


def _improved(s: Sources, suffix: str) -> list[float]:
    return [_score(s, f"{name}{suffix}")["improved_share"] for name in paper_studies.CORRECTORS]


def _shares(values: Sequence[float]) -> str:
    return ", ".join(f"{100 * value:.0f}" for value in values) + " %"


def _kind(s: Sources, by: str, place: int) -> Record:
    return dict([row for row in s.claims["kinds"] if row["by"] == by][place])


def _rare(s: Sources) -> str:
    """The hybrid and the data-driven model on descents and with a cold battery, beside all other trips."""
    rows = (
        ("net descents", _kind(s, "road", 0)),
        ("other roads", _kind(s, "road", 1)),
        ("battery below 5 °C", _kind(s, "battery", 0)),
        ("5 to 28 °C", _kind(s, "battery", 1)),
    )
    parts = (
        f"{name} ({row['trips']} trips) {percent(row['boosting'])} and {percent(row['boosting-only'])}, difference {span(row['diff_ci95'])}"
        for name, row in rows
    )
    hot, descent = _kind(s, "battery", -1)["trips"], _kind(s, "road", 0)["largest_descent_m"]
    return f"hybrid and data alone, of the power, nearest form: {'; '.join(parts)}. Long descents (largest {descent:.0f} m) and hot batteries ({hot} trip) are not in the data"


def _needed(s: Sources) -> str:
    study = s.view.results["studies"]["trips_needed"]
    largest, alone = study["curve"][-1], CURVE_MODELS[1]
    return (
        f"at most {study['crossing']:.0f} trips, the fewest tried, reach what data alone reach with {largest['n_trips']} ({percent(largest[alone])}); "
        f"but the simulation without trips has {percent(_score(s, SIMULATION)['mape'])}, and data alone of the power {percent(_power(s, 'boosting-only', None)['mape'])}"
    )


def _transferred(s: Sources) -> list[Record]:
    """Errors of the paper's correctors on another vehicle without own trips of it."""
    return transfer_page.rows_of(s.transfer, tuple(transfer_page.CORRECTORS), 0, True)


def _on_another(s: Sources) -> str:
    rows, physics = (
        transfer_page.rows_of(s.transfer, ("physics",), 0, False) if alone else _transferred(s)
        for alone in (False, True)
    )
    lower, worst = sum(row["less_physics"] < 0.0 for row in rows), max(row["mape"] for row in rows)
    middle, alone = (float(np.median([row["mape"] for row in one])) for one in (rows, physics))
    return (
        f"the paper's correctors on another vehicle, without own trips of it: median {percent(middle)}, its physics alone {percent(alone)}; better in {lower} of {len(rows)} cases, "
        f"worst {percent(worst)}: [any car](cars.md)"
    )


def _range(s: Sources, suffix: str) -> str:
    errors = [float(_score(s, f"{name}{suffix}")["mape"]) for name in paper_studies.CORRECTORS]
    return f"{100 * min(errors):.1f} to {percent(max(errors))}"


def _same_correctors(s: Sources) -> str:
    spread = [_score(s, name)["mape"] for name in paper_studies.CORRECTORS]
    best, worst = (_pair(s.view.results["paired"], "gamm", name) for name in ("boosting", "forest"))
    power = _pair(s.claims["pairs"], "gamm", "boosting")
    return (
        f"{100 * min(spread):.1f} to {percent(max(spread))}: GAMM above boosting {_gap(best)}, above forest {_gap(worst)}; "
        f"of the power, nearest form, {_gap(power)}"
    )


def _order(s: Sources) -> str:
    """Whether the three errors of Figure 9 have the paper's order, of the power."""
    physics, alone, hybrid = (_power(s, *k) for k in (("physics",), ("boosting-only", None), ("boosting",)))
    ordered = physics["mape"] > alone["mape"] > hybrid["mape"]
    return (
        "partly"
        if ordered and _score(s, "boosting-only")["mape"] > _score(s, SIMULATION)["mape"]
        else say(ordered)
    )


def _figure9(s: Sources) -> str:
    alone, power, names = (
        _score(s, "boosting-only"),
        _power(s, "boosting-only", None),
        paper_studies.CORRECTORS,
    )
    largest = _shares([_power(s, name)["max_ape"] for name in names])
    return (
        f"data alone {percent(alone['mape'])} (largest {percent(alone['max_ape'], 0)}) are behind the table's simulation, {percent(_score(s, SIMULATION)['mape'])}. The nearest simulation, or the power as target, restores the order; "
        f"both: {percent(_power(s, 'physics')['mape'])} physics, {percent(power['mape'])} data alone, {percent(_power(s, 'boosting')['mape'])} hybrid. Standard deviations there {percent(_power(s, 'physics')['spread'])}, {percent(power['spread'])}, "
        f"{percent(_power(s, 'boosting')['spread'])}; but the largest error of data alone is {percent(power['max_ape'], 0)} (paper almost {percent(PAPER_ALONE_MAX, 0)}), of GAMM, forest, boosting {largest}"
    )


def _slowest(s: Sources, key: str) -> str:
    return max(paper_studies.CORRECTORS, key=lambda name: float(s.view.scores[name][key]))


def _times(s: Sources) -> str:
    fit, predict = (
        [float(s.view.scores[n][key]) for n in paper_studies.CORRECTORS] for key in ("fit_s", "predict_ms")
    )
    return (
        f"in our software, with rows thinned differently, on two cores (paper: R on an i7-8565U): fit {number(fit[0])}, {number(fit[1])}, {number(fit[2])} s; a trip {number(predict[0], 1, 0)}, {number(predict[1], 1, 0)}, {number(predict[2], 1, 1)} ms "
        f"(GAMM, forest, boosting). Slowest fit: {model_label(_slowest(s, 'fit_s'))}; slowest prediction: {model_label(_slowest(s, 'predict_ms'))}"
    )


def _correlations(s: Sources) -> str:
    names = ("boosting", "boosting-exchangeable", "boosting-ar1")
    return (
        "cited, for many subjects; "
        + " / ".join(f"{100 * _score(s, name)['mape']:.1f}" for name in names)
        + " % by working correlation independence / exchangeable / AR(1); the paper's rounds, and `htb` of htree, are independence. Another one needs a mean that does not depend on the covariates of other rows (Pepe & Anderson 1994)"
    )


def _table2_figure(s: Sources) -> str:
    first, best = s.claims["table2"][0], min(s.claims["table2"], key=lambda row: row["distance"])
    return (
        f"[beside it](#table-2): mean distance of the EDF {first['distance']:.1f}, intercept {number(first['intercept'], 1, 0)}, {_weathers(s)[0]} weathers with a star (paper 2); "
        f"{best['distance']:.1f} and {number(best['intercept'], 1, 0)} [on the power](#power), the best of {len(s.claims['table2'])} fits that were chosen by it"
    )


def _season(s: Sources, season: str) -> Record:
    return dict(s.claims["climate"][season])


def _near(s: Sources, name: str) -> str:
    return f"mean {_beside(s, name)}"


_FOREST_GRID: Final = "the paper names no grid, ours has leaves " + " and shares of columns ".join(
    ", ".join(f"{value:g}" for value in values)
    for values in (ClusteredForest.default_grid[k] for k in ("max_leaf_nodes", "max_features"))
)

CLAIMS: Final = (
    Claim(
        "Abstract, §4: hybrids lower the average error from 40 % to 10 %",
        "partly",
        lambda s: (
            f"from {percent(_score(s, SIMULATION)['mape'])} to {_range(s, '')}; from {percent(_power(s, 'physics')['mape'])} to {_range(s, '-brochure')} on the nearest form of the simulation"
        ),
        "P, Q",
    ),
    Claim(
        "Abstract: factors such as weather have a huge effect",
        "partly",
        lambda s: (
            "of {1} weather coefficients {0} differ from 0 at 5 %; s(ambient temperature) does; climate control takes {2} of a winter trip".format(
                *_weathers(s), percent(_season(s, "winter")["mean"], 0)
            )
        ),
        "P, Q",
    ),
    Claim(
        "§1: heating can take over 30 % of the energy",
        lambda s: say(_season(s, "winter")["max"] > 0.3),
        lambda s: (
            f"in {_season(s, 'winter')['above_30_percent']} of {_season(s, 'winter')['trips']} winter trips, at most {percent(_season(s, 'winter')['max'], 0)}; {_season(s, 'summer')['above_30_percent']} of {_season(s, 'summer')['trips']} summer trips, at most {percent(_season(s, 'summer')['max'], 0)}; the others have no signal"
        ),
        "Q",
    ),
    Claim("§1: range anxiety hinders electric cars", "untestable", "cited"),
    Claim(
        "§1, §4: the model of the vehicle and the external factors are apart",
        "form",
        "`Vehicle` and corrector; what it brings is the row on another car",
    ),
    Claim(
        "§1: cold lowers capacity and efficiency of the battery",
        "untestable",
        "cited; no capacity is measured",
    ),
    Claim(
        "§1: higher accuracy in spite of few trips and unknown drivers",
        lambda s: say(all(_below(s, n)["significant"] for n in paper_studies.CORRECTORS), "partly"),
        lambda s: (
            "below the simulation: "
            + ", ".join(f"{model_label(n)} {_gap(_below(s, n))}" for n in paper_studies.CORRECTORS)
        ),
        "P",
    ),
    Claim(
        "§1, §4: a model of one car serves another without loss",
        lambda s: say(2 * sum(row["less_physics"] < 0.0 for row in _transferred(s)) > len(_transferred(s))),
        _on_another,
        "T",
    ),
    Claim("§1: other drivers", "untestable", "no driver is recorded"),
    Claim(
        "§2.1: physics alone lacks heating and air conditioning",
        "partly",
        lambda s: (
            f"bias {number(_score(s, SIMULATION)['bias'], 100, 1)} % without climate control, {number(_score(s, 'physics')['bias'], 100, 1)} % with, where regeneration and tyres also differ"
        ),
        "P",
    ),
    Claim(
        "§2.1: data-driven models need much data and fail on unseen trips; with physics a learner adapts to driving conditions",
        "partly",
        lambda s: (
            f"with {s.view.main['n_trips'] - 1} trips {percent(_score(s, 'boosting-only')['mape'])}, of the power {percent(_power(s, 'boosting-only', None)['mape'])}; trips of another kind in [the results](results.md)"
        ),
        "P, Q",
    ),
    Claim(
        "§2.1: data-driven models depend on settings and explain nothing; others' models of many cars lack heating",
        "untestable",
        "cited, or without a measure",
    ),
    Claim(
        "Figure 1: schematic of the simulation (MATLAB; no values)",
        "form",
        "[redrawn](#figure-1), with values from named sources",
    ),
    Claim(
        "§2.2: 50 % recuperation, as more trips are warm",
        "form",
        lambda s: f"half of the braking power; {_summer(s)} of {s.view.main['n_trips']} trips are of summer",
        "P",
    ),
    Claim(
        "Figure 2: inputs time, speed, inclination; outputs battery temperature, current, voltage",
        "form",
        "[redrawn](#figure-2)",
    ),
    Claim(
        "§2.2: longitudinal models remove the dependence of rows",
        lambda s: say(s.claims["figure3"]["correlation_of_rows"] < 0.1),
        lambda s: (
            f"residuals of the GAMM of the cumulative energy a minute apart correlate with {number(s.claims['figure3']['correlation_of_rows'])}; with AR(1) errors the protocol has [another fit](results.md#as-in-the-paper)"
        ),
        "Q",
    ),
    Claim(
        "§2.2: the random effect is that of the driver: style and comfort temperature",
        "untestable",
        lambda s: (
            f"no driver is recorded; {percent(s.claims['trips']['share'], 0)} of the variance at the end of a trip is left to the trip by least squares on the same trips; §2.2's gain of mixed models is cited"
        ),
        "Q",
    ),
    Claim("§2.2: leave one trip out, averaged", "form", "also by days, in [the results](results.md)", "P"),
    Claim(
        f"§2.3: {PAPER_TRIPS} trips of one BMW i3, 10 Hz",
        "deviates",
        lambda s: (
            f"{s.view.main['n_trips']} of {len(s.view.results['trips_read'])} trips that were read, of 70 published; means of 1 s, every 60th for the GAMM, 60 rows a trip for trees; with 240 rows boosting {_option(s, 'boosting', '240 rows')}, forest {_option(s, 'forest', '240 rows')}"
        ),
        "Q",
    ),
    Claim("Table 1: variables", "form", "[in SI units](#table-1)"),
    Claim(
        "§3, steps 1 to 4: simulate, residual, learn, add",
        "deviates",
        "`HybridModel`; the residual is that of the cumulative energy, which the paper does not state. [The other reading](#power)",
    ),
    Claim("Equation 1: absolute percentage error at the end", "form", "`metrics.absolute_percentage_error`"),
    Claim(
        "Equation 2: GAMM with link, variance function, prior weights, D(θ)",
        "deviates",
        "`tripwatt_gamm.GAMM`: link identity, constant variance, no weights, as the paper's own fit; one variance for trips",
    ),
    Claim(
        "§3.1: effects of trips are normal; estimates are robust if not",
        "untestable",
        lambda s: (
            f"the effects of trips have skew {number(s.claims['figure3']['trip_effects']['skew'])}, p = {number(s.claims['figure3']['trip_effects']['shapiro_p'])} (Shapiro & Wilk)"
        ),
        "Q",
    ),
    Claim(
        "§3.1, equation 3: the residual has heavy tails, so Student's t",
        "yes",
        lambda s: (
            f"`tripwatt_gamm.ScaledT`; ν at its bound of 3, {number(_tails(s, 'cumulative energy, ν free')['nu'])} freed: an infinite variance; log score {number(s.claims['figure3']['errors'][0]['log_score'])} a row, of two normal scales {number(s.claims['figure3']['errors'][3]['log_score'])}. The equation's mean should be g⁻¹(η)"
        ),
        "Q",
    ),
    Claim(
        "Figure 3: the residuals match the quantiles of the t",
        lambda s: say(
            _tails(s, "cumulative energy")["below"] < 2 * _tails(s, "cumulative energy")["expected"]
        ),
        lambda s: (
            "the left tail leaves the band: {below} rows below −300 Wh, {expected:.1f} expected, {above} above 300 Wh; skew {0}. On the power {1} of the lowest and {2} of the highest 1 % of rows leave it. [Rows and remedies](#figure-3)".format(
                number(_tails(s, "cumulative energy")["skew"], 1, 1),
                *(percent(_tails(s, "power")[f"outside_{end}_percent"], 0) for end in ("lowest", "highest")),
                **_tails(s, "cumulative energy"),
            )
        ),
        "Q",
    ),
    Claim(
        "Figure 4: smooths, and effects of trips against Gaussian quantiles",
        "form",
        "[drawn](#figure-4)",
        "P",
    ),
    Claim(
        "Table 2: summary of the GAMM",
        "no",
        _table2_figure,
        "P, Q, R",
    ),
    Claim("§3.1: terms stay whatever their p; EDF 1 is a straight line", "form", "as in the paper"),
    Claim("Figure 5: errors of the GAMM", "form", lambda s: _near(s, "gamm"), "P"),
    Claim(
        "§3.2: forest with bootstrap of subjects, R package htree, grid search",
        "deviates",
        lambda s: (
            f"`ClusteredForest`; {_FOREST_GRID}. The historical trees that htree grows by default are not built: columns of history (mean and top speed, climb so far) give {_option(s, 'forest', 'history')}, seeds {_option(s, 'forest', 'seeds')}; htree was not run, nor a bootstrap of rows"
        ),
        "Q",
    ),
    Claim("Figure 6: errors of the forest", "form", lambda s: _near(s, "forest"), "P"),
    Claim(
        "§3.3: boosting as a GEE, valid whatever the working correlation",
        "untestable",
        _correlations,
        "P",
    ),
    Claim(
        "§3.3, rounds: F(k+1) = F(k) + T(k+1), rounds by leaving subjects out",
        "deviates",
        lambda s: (
            f"learning rate 0.1 instead of 1 ({_option(s, 'boosting', 'learning rate 1')} with 1; seeds {_option(s, 'boosting', 'seeds')}); five folds of trips choose the rounds"
        ),
        "Q",
    ),
    Claim("Figure 7: errors of boosting", "form", lambda s: _near(s, "boosting"), "P"),
    Claim("Figure 8: box plots", "form", "[with every model](#figures-5-to-8)", "P"),
    Claim(
        "Table 3: physics 0.379",
        "no",
        lambda s: (
            f"{_beside(s, SIMULATION)}; {percent(_power(s, 'physics')['mape'])} [with published values](#physics)"
        ),
        "P",
    ),
    Claim(
        "Table 3: GAMM 0.115",
        "partly",
        lambda s: (
            f"{_beside(s, 'gamm')}; with AR(1) errors, normal ones, which {s.view.results['studies']['choices']['gamm-chosen']['gamm-ar1']} of {s.view.main['n_trips']} folds choose, {percent(_score(s, 'gamm-ar1')['mape'])}; of the power, nearest form, {percent(_power(s, 'gamm')['mape'])}"
        ),
        "P, Q",
    ),
    Claim(
        "Table 3: forest 0.106",
        lambda s: say(abs(_score(s, "forest")["mape"] - 0.106) < 0.01),
        lambda s: (
            f"{_beside(s, 'forest')}; of the power, nearest form, {percent(_power(s, 'forest')['mape'])}"
        ),
        "P, Q",
    ),
    Claim(
        "Table 3: boosting 0.103",
        lambda s: say(abs(_score(s, "boosting")["mape"] - 0.103) < 0.01),
        lambda s: (
            f"{_beside(s, 'boosting')}; of the power, nearest form, {percent(_power(s, 'boosting')['mape'])}"
        ),
        "P, Q",
    ),
    Claim(
        "§3.4: no large difference among the correctors",
        lambda s: say(
            not any(
                _pair(s.view.results["paired"], "gamm", n)["significant"] for n in ("forest", "boosting")
            ),
            "no" if _pair(s.claims["pairs"], "gamm", "boosting")["significant"] else "partly",
        ),
        _same_correctors,
        "P, Q",
    ),
    Claim(
        "§3.4: GAMMs run longest",
        lambda s: say(
            _slowest(s, "fit_s") == "gamm" and _slowest(s, "predict_ms") == "gamm",
            "partly" if "gamm" in (_slowest(s, "fit_s"), _slowest(s, "predict_ms")) else "no",
        ),
        _times,
        "P",
    ),
    Claim(
        "§3.4: drivers do not wait, so trees are preferable",
        "untestable",
        "no driver was asked; the times are in the row above",
    ),
    Claim("§3.4: GAMMs show the effect of each predictor", "yes", "[Figure 4](#figure-4)", "P"),
    Claim(
        "§3.4: boosting is best",
        lambda s: say(
            all(_pair(s.view.results["paired"], n, "boosting")["significant"] for n in ("gamm", "forest")),
            "partly",
        ),
        lambda s: (
            f"forest above boosting {_gap(_pair(s.view.results['paired'], 'forest', 'boosting'))}; of the power, nearest form, {_gap(_pair(s.claims['pairs'], 'forest', 'boosting'))}; with the paper's rate of 1 boosting has {_option(s, 'boosting', 'learning rate 1')}"
        ),
        "P, Q",
    ),
    Claim(
        "§3.4: all models have the same inputs, and the driven speed",
        "form",
        "time, driven speed, ambient temperature, elevation difference, season, weather",
    ),
    Claim(
        "Figure 9: errors of physics, then data alone, then hybrid; data alone vary most",
        _order,
        _figure9,
        "P, Q",
    ),
    Claim(
        "§3.4: over 90 % of the trips are improved",
        lambda s: say(
            min(_improved(s, "")) > 0.9, "partly" if min(_improved(s, "-brochure")) > 0.9 else "no"
        ),
        lambda s: (
            f"{_shares(_improved(s, ''))}; on the nearest form {_shares(_improved(s, '-brochure'))}; there of the power {_shares([_power(s, n)['improved_share'] for n in paper_studies.CORRECTORS])} (GAMM, forest, boosting). The share measures the simulation"
        ),
        "P, Q",
    ),
    Claim("§3.4: less data than data-driven models", "partly", _needed, "P, Q"),
    Claim(
        "§3.4: limits: drivers unknown, few trips, one car", "form", "the same data; [other cars](cars.md)"
    ),
    Claim(
        "§4: about 10 % with either corrector",
        "partly",
        lambda s: ", ".join(
            f"{model_label(n)} {percent(_score(s, n)['mape'])}" for n in paper_studies.CORRECTORS
        ),
        "P",
    ),
    Claim(
        "§4: others reach the same accuracy without climate control (12 % with a Holden)",
        "untestable",
        "other trips; [other systems on these trips](peers.md)",
    ),
    Claim(
        "§4: rare cases: long descents, cold or hot battery",
        lambda s: "partly" if _kind(s, "road", 0)["diff_ci95"][0] > 0.0 else "untestable",
        _rare,
        "Q",
    ),
)
"""Everything that the paper shows or states, in its order; what it only announces or cites as background is left out."""


def _summer(s: Sources) -> int:
    return sum(day[5:7] in ("06", "07", "08") for day in s.view.results["days"].values())


# ---------------------------------------------------------------- sections


def _image(name: str, alt: str) -> str:
    return f"![{alt}](../images/paper-{name}.png)"


def _figure3(s: Sources) -> str:
    found = s.claims["figure3"]
    fits = make_table(
        "Residuals of the GAMM against its fitted t; quantiles: measured by expected",
        [{"fit": name, **row} for name, row in found["fits"].items()],
        Column("Fit to", "fit"),
        Column("Rows", "rows", digits=0),
        Column("ν", "nu"),
        Column("Skew", "skew", digits=1),
        Column("1 % quantile", "ratio_low"),
        Column("99 % quantile", "ratio_high"),
        Column(
            "Below −300 Wh",
            lambda row: DASH if row["fit"] == "power" else f"{row['below']} ({row['expected']:.1f})",
        ),
    )
    errors = make_table(
        "Other errors on the residuals of the first row; log score per row on trips left out",
        found["errors"],
        Column("Error", "error"),
        Column("Log score", "log_score", digits=3),
        Column("Below −300 Wh expected", "expected", digits=1),
    )
    late = [row for row in found["far_trips"] if row["from_s"] >= 300.0]
    early = [row for row in found["far_trips"] if row not in late]
    rows = (
        f"Of the {_tails(s, 'cumulative energy')['below']} rows below −300 Wh, "
        + listed([f"{r['rows']} are of {r['trip']} from minute {r['from_s'] / 60:.0f} on" for r in late])
        + f", and {sum(r['rows'] for r in early)} are of the first {max(r['to_s'] for r in early) / 60:.0f} minutes of {len(early)} {listed(sorted({r['season'] for r in early}))} trips. "
        "The residual of the cumulative energy starts at 0, while the effect of a trip is a constant, so a trip with a large effect starts far below it. No skew, second scale or scale by state mends this; "
        "a slope of time for each trip does, and so does the power as target, in which the trip's effect is a slope."
    )
    return "\n\n".join(
        [
            _image(
                "gamm-diagnosis", "Q-Q plot against the fitted t, residuals, histogram, response and fitted"
            ),
            rows,
            markdown(fits),
            markdown(errors),
        ]
    )


def _table2(s: Sources) -> str:
    smooths = dict(map(table2_row, s.view.results["table2"]))
    names = [*PAPER_TABLE2, *(name for name in smooths if name not in PAPER_TABLE2)]
    rows = tuple((name, smooths.get(name, DASH), PAPER_TABLE2.get(name, DASH)) for name in names)
    caption = "Estimate (standard error) in Wh, EDF (reference df) of a smooth; *** p < 0.001, ** p < 0.01, * p < 0.05"
    why = (
        "The terms are those of the paper. Season is an ordered factor, so its smooths are centred differences of winter from "
        "summer; with a number 0/1 the smooth would not be centred and could not have the EDF 1.00 (1.00) that the paper prints."
    )
    return "\n\n".join(
        [markdown(Table(caption, ("Term", "Here", "The paper"), rows)), why, on_trip_df(s.view)]
    )


_EDF_COLUMNS: Final = (
    ("time", "time"),
    ("ambient", "ambient"),
    ("speed", "speed"),
    ("elevation", "elevation"),
    ("time_winter", "time, winter"),
    ("ambient_winter", "ambient, winter"),
    ("surface", "surface"),
    ("trip", "trip"),
)


def _path_row(row: Record) -> Record:
    """A fit on the way to Table 2 in words: what differs from the row above it, or the options of mgcv."""
    if "engine" in row:
        options = f"{row['engine']}, {row['family']}, {row['method']}, γ {row['gamma']:g}, k {row['k']}"
        what = f"mgcv: {row['target']}, {row['climb_from']}, {row['every_s']} s, {options}{'' if row['converged'] else ', not converged'}"
    else:
        simulation = ", table's simulation" if row["simulation"] == SIMULATION else ""
        what = f"{row['target']}, {row['climb_from']}, {row['every_s']} s{simulation}"
    return {
        **row,
        "what": what,
        "constant": f"{number(row['intercept'], 1, 0)}\u00a0({number(row['se'], 1, 0)})",
    }


def _on_power(s: Sources) -> str:
    paper = {
        "what": "the paper",
        "constant": PAPER_TABLE2["(Intercept)"],
        **dict(zip((k for k, _ in _EDF_COLUMNS), PAPER_EDF, strict=True)),
    }
    path = make_table(
        "EDF of the terms of Table 2 by target, origin of the elevation difference (start of the trip or row before), and spacing of rows, on the nearest simulation; distance: mean absolute difference to the paper's",
        [*map(_path_row, (*s.claims["table2"], *s.claims["mgcv"])), paper],
        Column("Fit", "what"),
        *(Column(head, key, digits=1) for key, head in _EDF_COLUMNS),
        Column("Distance", "distance", digits=1),
        Column("Intercept", "constant", text=True),
    )
    simulations = (SIMULATION, NEAREST)
    names = ("physics", *paper_studies.CORRECTORS, "boosting-only")

    def cumulative(model: str, simulation: str) -> float:
        if model == "physics":
            return float(_score(s, simulation)["mape"])
        suffix = "-brochure" if simulation == NEAREST and model != "boosting-only" else ""
        return float(_score(s, f"{model}{suffix}")["mape"])

    errors = make_table(
        "Mean error [%] by the target of the corrector and the simulation; of the power, the GAMM has a row every 10 s in place of 60 s and the climb from the row before",
        [
            {
                "model": model_label(SIMULATION if name == "physics" else name),
                "paper": s.view.published.get(SIMULATION if name == "physics" else name),
            }
            | {f"c{i}": cumulative(name, x) for i, x in enumerate(simulations)}
            | {
                f"p{i}": _power(s, name, None if name == "boosting-only" else x)["mape"]
                for i, x in enumerate(simulations)
            }
            | {"improved": _power(s, name)["improved_share"] if name != "boosting-only" else None}
            for name in names
        ],
        Column("Model", "model"),
        in_percent("Cumulative, table's", "c0"),
        in_percent("Cumulative, nearest", "c1"),
        in_percent("Power, table's", "p0"),
        in_percent("Power, nearest", "p1"),
        in_percent("The paper", "paper"),
        in_percent("Improved, power, nearest", "improved", 0),
    )
    return "\n\n".join([_POWER, markdown(errors), markdown(path), _path(s)])


_POWER = (
    "The paper defines the *error* on cumulative energy, but not the residual. If the correctors learn the residual of the power of each row, and their "
    "predictions are summed, the correctors of Table 3, their small difference, and EDF and intercept of Table 2 come nearer, and the residuals of Figure 3 are symmetric. "
    "This may be the paper's regression; it does not say so. The physics of Table 3 and the share of improved trips follow from the simulation instead. Target, spacing of rows and origin of the elevation difference were chosen with Table 2 in view: "
    "these are development figures, and the protocol keeps the cumulative energy."
)


def _path(s: Sources) -> str:
    """What the other suspects change."""
    rows = [row for row in s.claims["mgcv"] if row["target"] == "cumulative" and row["climb_from"] == "start"]
    low, high = min(row["surface"] for row in rows), max(row["surface"] for row in rows)
    speeds = [
        [row["speed"] for row in (*s.claims["mgcv"], *s.claims["table2"]) if power.items() <= row.items()]
        for power in (
            {"target": "power", "climb_from": "row", "every_s": step} for step in (POWER_STEP_S, FINE_STEP_S)
        )
    ]
    bound = [row["ambient"] for row in rows if row["k"] != rows[0]["k"]]
    (by_row,) = (
        row["ambient"]
        for row in s.claims["table2"]
        if (row["target"], row["climb_from"]) == ("cumulative energy", "row")
    )
    same = [
        row["distance"] for row in s.claims["table2"] if row["every_s"] == 60 and row["target"] != "power"
    ][1]
    return (
        f"Not the cause: the simulation; discretisation (we round covariates, `bam` here does not: distance {same:.1f} and {rows[0]['distance']:.1f}; `bam` with `discrete=TRUE` refuses this formula); family, method and γ, "
        f"over which the EDF of the surface stays between {low:.0f} and {high:.0f}; the paper's reference df fixes its k at 30. s(ambient) has {min(bound):.1f} to {max(bound):.1f} by the k of the curves, and {by_row:.1f} with the elevation difference from the row before. "
        f"Open: the paper's rows, s(elevation difference), which stays too flexible, and s(speed) of the power: mgcv and we have {' and '.join(f'{x:.1f}' for x in speeds[0])} every {POWER_STEP_S} s, {' and '.join(f'{x:.1f}' for x in speeds[1])} every {FINE_STEP_S} s."
    )


def _physics(s: Sources) -> str:
    return "\n\n".join(
        [
            _FORMS,
            markdown(paper_studies.forms_table(s.view)),
            markdown(paper_studies.improved_table(s.view)),
        ]
    )


def _trips(s: Sources) -> str:
    study = s.view.results["studies"]["trips_needed"]
    low, high = study["crossing_ci95"]
    text = (
        f"The hybrid reaches the final error of the data-driven model with at most {study['crossing']:.1f} trips, the fewest tried (95 % interval {low:.1f} to "
        f"{'beyond the curve' if high is None else f'{high:.1f}'}): means over {study['curve'][-1]['draws']} random draws, scored on all other trips; "
        "the interval is a bootstrap over draws and trips."
    )
    return f"{text}\n\n{_image('trips-needed', 'Mean error against the number of training trips')}"


def _evidence(s: Sources) -> str:
    wider = float(norm.ppf(1.0 - 0.025 / 3) / norm.ppf(0.975))
    gamm = [_pair(s.view.results["paired"], "gamm", name) for name in ("forest", "boosting")]
    kept = sum(pair["diff"] > wider * (pair["ci95"][1] - pair["ci95"][0]) / 2 for pair in gamm)
    return (
        f"{SIGNIFICANCE_NOTE} Intervals of one mean draw trips. Nothing is corrected for the number of comparisons: for the three pairs of correctors a correction (Bonferroni, normal) widens the intervals by {number(wider)}, and {kept} of the {len(gamm)} differences of the GAMM stay significant. "
        f"One seed is shown; over {len(s.claims['options'][0]['errors'])} seeds boosting has {_option(s, 'boosting', 'seeds')} and the forest {_option(s, 'forest', 'seeds')}. "
    )


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
        f"those of {fitted} trips, not of {PAPER_TRIPS}. Two weathers, rainy and dark, little rainy, have no estimate: "
        "with a column for each of the eight weathers and one without trips, mgcv also drops one that has trips. "
        f"Here {view.main['n_trips']} trips, an intercept and {sum(e > 0 for e in weathers)} of {len(weathers)} weather coefficients with data leave "
        f"{number(rows['s(trip)']['ref_df'], 1.0, 0)}."
    )


_FORMS = (
    "The paper prints no parameter of its MATLAB car but the 50 % of regeneration. Ours has the measured coast-down and a drivetrain from named sources; the other forms take published values. "
    "The share of trips that a corrector improves depends on how poor the simulation is, and so does not measure the corrector."
)
SECTIONS: Final[tuple[tuple[str, str, Callable[[Sources], str]], ...]] = (
    ("power", "A reading that agrees better", _on_power),
    (
        "figure-1",
        "Figure 1: schematic of the simulation",
        lambda s: (
            f"{_image('simulation', 'From time, speed and grade over road load and drivetrain to battery and energy')}\n\nDrawn from the car under the preset `paper`; [the car model](car-model.md) has every value."
        ),
    ),
    (
        "figure-2",
        "Figure 2: prediction for a trip",
        lambda s: _image(
            "hybrid", "Simulated energy plus the correction of a learner gives the energy of the trip"
        ),
    ),
    (
        "table-1",
        "Table 1: variables of the data set",
        lambda s: markdown(Table("Variables", ("The paper", "Here"), VARIABLES, frozenset({0, 1}))),
    ),
    ("figure-3", "Figure 3: diagnosis of the GAMM", _figure3),
    (
        "figure-4",
        "Figure 4: smooths and random effects",
        lambda s: "\n\n".join(
            _image(name, alt)
            for name, alt in (
                ("gamm-smooths", "Smooths of time, ambient temperature, speed and elevation difference"),
                ("gamm-surface", "Surface of ambient temperature and elevation difference"),
                ("gamm-random", "Effects of trips against Gaussian quantiles"),
            )
        ),
    ),
    ("table-2", "Table 2: summary of the GAMM", _table2),
    (
        "figures-5-to-8",
        "Figures 5 to 8: errors of every model",
        lambda s: (
            f"{_image('error-distribution', 'Distribution of the errors of every model over the held-out trips')}\n\n{_image('error-boxes', 'Box plots of the errors')}"
        ),
    ),
    ("physics", "Forms of the simulation", _physics),
    (
        "figure-9",
        "Figure 9: physics, data-driven and hybrid",
        lambda s: _image("benchmark-boxes", "Box plots of physics, hybrid and data-driven boosting"),
    ),
    ("less-data", "Less data than purely data-driven", _trips),
    ("evidence", "What the figures can show", _evidence),
)
"""Anchor, title and content of what stands below the table."""


def _filled(text: Callable[[Sources], str] | str, s: Sources) -> str:
    return (text if isinstance(text, str) else text(s)).replace("|", "\\|")


def render_paper_page(
    results: Mapping[str, Any], transfer: Mapping[str, Any], claims: Mapping[str, Any]
) -> str:
    """The table of all claims, and the sections that it links to.

    Parameters
    ----------
    results : mapping
        `results.json` of the protocol `paper`.
    transfer : mapping
        What `benchmarks.transfer` writes.
    claims : mapping
        What `benchmarks.paper_claims` writes.
    """
    s = Sources(View(results), transfer, claims)
    rows = [
        "| The paper | Verdict | Here | Run |",
        "|:--|:--|:--|:--|",
        *(
            f"| {_filled(c.paper, s)} | {_filled(c.verdict, s)} | {_filled(c.ours, s)} | {c.run} |"
            for c in CLAIMS
        ),
    ]
    verdicts = "; ".join(f"*{word}*: {meaning}" for word, meaning in VERDICTS.items())
    runs = "; ".join(f"{letter}: {line}" for letter, line in RUNS.items())
    sections = [f'<a id="{key}"></a>\n\n## {title}\n\n{content(s)}' for key, title, content in SECTIONS]
    origin = f"Protocol `{results.get('protocol', '?')}`, seed {results.get('seed', '?')}, {s.view.note}; written from `docs/results` by `tools.docs.publish_results`."
    return "\n\n".join(
        [f"{verdicts}. Runs, all by `make results` but R: {runs}.", "\n".join(rows), *sections, origin]
    )
