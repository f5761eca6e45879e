"""The rows of `docs/explanation/paper.md`: what arXiv:2405.10984 shows or states, with a verdict and our figure.

The numbers come from the `results.json` of the protocol `paper`, and from those of `benchmarks.transfer` and `benchmarks.paper_claims`.
Verdicts that depend on a figure are computed from it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from tools.docs import transfer_page
from tripwatt.hybrid.trip_table import COVARIATES
from tripwatt.learners.forest import ClusteredForest
from tripwatt.study.evaluation.paper_studies import CURVE_MODELS, NEAREST
from tripwatt.study.paper.correctors import SIMULATION
from tripwatt.study.report.covariates import term_in_words
from tripwatt.study.report.intervals import STAR
from tripwatt.study.report.panels import paper_studies
from tripwatt.study.report.tables import number, span
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import listed, percent, points

PAPER_TABLE2: Final[Mapping[str, str]] = tomllib.loads(
    Path(__file__).with_name("paper_table2.toml").read_text("utf-8")
)
"""What the paper prints for its GAMM in its Table 2, by our names of the terms."""

PAPER_EDF: Final = tuple(
    float(text.split()[0]) for term, text in PAPER_TABLE2.items() if term.startswith("s(")
)
"""EDF of the paper's Table 2, in its order."""

EDF_COLUMNS: Final = (
    ("time", "time"),
    ("ambient", "ambient"),
    ("speed", "speed"),
    ("elevation", "elevation"),
    ("time_winter", "time, winter"),
    ("ambient_winter", "ambient, winter"),
    ("surface", "surface"),
    ("trip", "trip"),
)

PAPER_TRIPS: Final = 72
"""Trips that the paper's data set has, each of which it leaves out once (Methodology)."""

PUBLISHED_TRIPS: Final = 70
"""Trips that the publication of the data set has."""

CORRECTORS: Final = paper_studies.CORRECTORS


class Sources(NamedTuple):
    """What the page rests on: the runs of the protocol `paper` and of the correctors on another car, and the tests of the claims."""

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


NEAR: Final = 0.01
"""Difference of two mean errors below which a value of Table 3 is reproduced: a choice, one point."""

NEAR_EDF: Final = 1.0
"""The same of an EDF: a choice."""

VERDICTS: Final = {
    "form": "built or drawn as in the paper; of its pictures only the text was at hand",
    "deviates": "built in another way, which is named",
    "yes": "our figure supports it; a value of Table 3: within a point",
    "partly": "a part of it, or on one of our forms; a value of Table 3: within our 95 % interval",
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


# ---------------------------------------------------------------- figures


def score_of(s: Sources, name: str) -> Record:
    """Scores of a model of the cumulative energy."""
    scores: Mapping[str, Record] = {**s.view.scores, **s.view.results["studies"]["models"]}
    return scores[name]


def mape(s: Sources, name: str) -> float:
    """Mean error of a model of the cumulative energy."""
    return float(score_of(s, name)["mape"])


def power_of(s: Sources, model: str, simulation: str | None = NEAREST) -> Record:
    """Scores of a model of the power."""
    (row,) = (r for r in s.claims["power"] if (r["model"], r["simulation"]) == (model, simulation))
    return dict(row)


def pair_of(pairs: Sequence[Record], a: str, b: str) -> Record:
    """Comparison of two models."""
    (row,) = (r for r in pairs if (r["a"], r["b"]) == (a, b))
    return row


def tails_of(s: Sources, name: str) -> Record:
    """Residuals of a fit against its fitted t."""
    return dict(s.claims["figure3"]["fits"][name])


def option(s: Sources, model: str, name: str) -> str:
    """Errors under an option, lowest to highest."""
    (row,) = (r for r in s.claims["options"] if (r["model"], r["option"]) == (model, name))
    low, high = min(row["errors"]), max(row["errors"])
    return percent(low) if len(row["errors"]) == 1 else f"{100 * low:.1f} to {percent(high)}"


def fit_on_power(s: Sources) -> Record:
    """The fit of the power whose terms are printed."""
    (row,) = (row for row in s.claims["table2"] if "terms" in row)
    return dict(row)


def by_mgcv(s: Sources) -> Record:
    """The same fit by mgcv."""
    ours = fit_on_power(s)
    same = {name: ours[name] for name in ("target", "climb_from", "every_s")}.items()
    (row,) = (row for row in s.claims["mgcv"] if same <= row.items())
    return dict(row)


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


def _beside(s: Sources, name: str) -> str:
    """Our mean error beside the paper's."""
    return f"{percent(mape(s, name))} ({points(mape(s, name) - s.view.published[name])})"


def _each(errors: Sequence[float], digits: int = 1) -> str:
    return ", ".join(f"{100 * error:.{digits}f}" for error in errors) + "\u00a0%"


def _mapes(s: Sources, suffix: str = "") -> str:
    return _each([mape(s, f"{name}{suffix}") for name in CORRECTORS])


def _power_mapes(s: Sources, name: str) -> str:
    near, table = (power_of(s, name, simulation)["mape"] for simulation in (NEAREST, SIMULATION))
    return f"of the power, nearest {percent(near)}, table's {percent(table)}"


def _gap(pair: Record) -> str:
    star = STAR if pair["significant"] else ""
    return f"{points(pair['diff'])} ({span(pair['ci95'])}){star}"


def _table3_verdict(s: Sources, name: str) -> str:
    paper, (low, high) = s.view.published[name], score_of(s, name)["mape_ci95"]
    return say(abs(mape(s, name) - paper) < NEAR, "partly" if low <= paper <= high else "no")


def _simulated(s: Sources, name: str) -> Record:
    (row,) = (row for row in s.claims["simulations"] if row["simulation"] == name)
    return dict(row)


def _terms(s: Sources, start: str) -> list[Record]:
    return [row for row in s.view.results["table2"] if row["term"].startswith(start)]


def _weather(s: Sources) -> str:
    p = [row["p_value"] for row in _terms(s, "weather") if row["p_value"] is not None]
    ambient = _terms(s, "s(ambient_temperature_degc)")[0]
    winter = s.claims["climate"]["winter"]
    return (
        f"{sum(value < 0.05 for value in p)} of {len(p)} weather coefficients differ from 0 at 5 %, s(ambient) does "
        f"({table2_row(ambient)[1]}); climate control takes {percent(winter['mean'], 0)} of a winter trip"
    )


def _heating(s: Sources) -> str:
    parts = [
        f"{row['above_30_percent']} of {row['trips']} {season} trips, at most {percent(row['max'], 0)}"
        for season, row in sorted(s.claims["climate"].items(), reverse=True)
    ]
    kept = sum(row["trips"] for row in s.claims["climate"].values())
    return f"climate control: {'; '.join(parts)}; {kept} of {s.view.main['n_trips']} trips have its power"


def _moved(s: Sources, own: int) -> list[Record]:
    return transfer_page.rows_of(s.transfer, tuple(transfer_page.CORRECTORS), own, True)


def _transfer_verdict(s: Sources) -> str:
    rows = _moved(s, 0)
    lower = sum(row["less_physics"] < 0.0 for row in rows)
    return say(lower == len(rows), "partly" if lower > len(rows) / 2 else "no")


def _transfer(s: Sources) -> str:
    kinds = {
        own: [
            number(transfer_page.median(transfer_page.rows_of(s.transfer, models, own, moved)), 100, 1)
            for _, models, moved, _ in map(transfer_page.KINDS.__getitem__, ("transferred", "physics", "own"))
        ]
        for own in (0, 20)
    }
    rows = _moved(s, 0)
    return (
        f"its correctors moved: median {kinds[0][0]} %, physics alone {kinds[0][1]} %; better in "
        f"{sum(row['less_physics'] < 0.0 for row in rows)} of {len(rows)} cases, worst {percent(max(row['mape'] for row in rows))}. "
        f"With 20 own trips {kinds[20][0]}, own corrector {kinds[20][2]} %: [cars](cars.md)"
    )


def _season_errors(s: Sources, target: str) -> dict[str, Record]:
    return {row["season"]: row for row in s.claims["seasons"] if row["target"] == target}


def _unseen(s: Sources) -> str:
    cumulative, power = (_season_errors(s, target) for target in ("cumulative energy", "power"))

    def both(model: str) -> str:
        return _each([cumulative[season][model] for season in ("winter", "summer")])

    return (
        f"winter, summer, each by the other: {both('boosting-only')}; of the power "
        f"{_each([power[season]['boosting-only'] for season in ('winter', 'summer')])}"
    )


def _unseen_verdict(s: Sources) -> str:
    worse = [
        row["boosting-only"] > known
        for target, known in (
            ("cumulative energy", mape(s, "boosting-only")),
            ("power", power_of(s, "boosting-only", None)["mape"]),
        )
        for row in _season_errors(s, target).values()
    ]
    return say(all(worse), "partly" if any(worse) else "no")


def _adapts(s: Sources) -> str:
    parts = [
        f"{season} {percent(row['boosting'])}, physics {percent(row['physics'])}"
        for season, row in _season_errors(s, "cumulative energy").items()
    ]
    power = _season_errors(s, "power")
    return (
        f"fitted on the other season: {'; '.join(parts)}; of the power {_each([row['boosting'] for row in power.values()])}, "
        f"physics {_each([row['physics'] for row in power.values()])}"
    )


def _adapts_verdict(s: Sources) -> str:
    better = [row["boosting"] < row["physics"] for row in s.claims["seasons"]]
    return say(all(better), "partly" if any(better) else "no")


def _recuperation(s: Sources) -> str:
    summer = sum(day[5:7] in ("06", "07", "08") for day in s.view.results["days"].values())
    few, much = (percent(_simulated(s, f"paper, recuperation {share}")["mape"]) for share in ("0.25", "0.75"))
    return (
        f"half of the braking power; {summer} of {s.view.main['n_trips']} trips are of summer. "
        f"The simulation errs by {few} with 25 %, by {much} with 75 %"
    )


def _dependence_verdict(s: Sources) -> str:
    found = s.claims["figure3"]["correlation_of_rows"]
    return say(found["t"] < 0.1, "partly" if found["power"] < 0.1 else "no")


def _dependence(s: Sources) -> str:
    found = {name: number(value) for name, value in s.claims["figure3"]["correlation_of_rows"].items()}
    return (
        f"residuals a minute apart correlate with {found['t']}; AR(1) errors leave {found['ar1_left']}; "
        f"of the power, 10 s apart, {found['power']}"
    )


def _trips_used(s: Sources) -> str:
    read, used = s.view.results["trips_read"], s.view.results["trips_used"]["reference"]
    dropped = listed(sorted(set(read) - set(used)))
    return (
        f"{len(read)} of the {PUBLISHED_TRIPS} published trips were at hand, {len(used)} used (with {dropped} in [the results](results.md)); the paper's [64](#table-2). "
        "Means of 1 s; every 60th for the GAMM "
        f"(30 s: {option(s, 'gamm', 'every 30 s')}, 120 s: {option(s, 'gamm', 'every 120 s')}), 60 rows a trip for trees (240: boosting {option(s, 'boosting', '240 rows')}, forest {option(s, 'forest', '240 rows')})"
    )


def _machine(s: Sources) -> str:
    versions = s.view.results["versions"]
    named = ", ".join(f"{name} {versions[name.lower()]}" for name in ("Python", "LightGBM", "scikit-learn"))
    return f"our times are of another machine, with {named}, mgcv {by_mgcv(s)['mgcv']}"


def _heavy(s: Sources) -> str:
    by_name = {row["error"]: number(row["log_score"], 1.0, 3) for row in s.claims["figure3"]["errors"]}
    return (
        f"`tripwatt_gamm.ScaledT`; log score {by_name[_T]}, "
        f"normal {by_name['normal']} ([rows](#figure-3)). ν at its bound of 3, {number(tails_of(s, 'cumulative energy, ν free')['nu'])} freed: an infinite variance. The equation's mean should be g⁻¹(η)"
    )


_T: Final = "Student's t, ν ≥ 3"


def _heavy_verdict(s: Sources) -> str:
    by_name = {row["error"]: row["log_score"] for row in s.claims["figure3"]["errors"]}
    return say(by_name[_T] > by_name["normal"])


def _figure3(s: Sources) -> str:
    tails, power = tails_of(s, "cumulative energy"), tails_of(s, "power")
    return (
        f"the left tail leaves the band: {tails['below']} rows below −300 Wh, {tails['expected']:.1f} expected, {tails['above']} above 300 Wh; skew {number(tails['skew'], 1, 1)}. "
        f"Of the power symmetric, but {percent(power['outside_lowest_percent'], 0)} of the lowest and {percent(power['outside_highest_percent'], 0)} of the highest 1 % of rows leave it. [Rows](#figure-3)"
    )


def _figure3_verdict(s: Sources) -> str:
    tails, power = tails_of(s, "cumulative energy"), tails_of(s, "power")
    outside = max(power["outside_lowest_percent"], power["outside_highest_percent"])
    return say(tails["below"] < 2 * tails["expected"], "partly" if outside < 0.1 else "no")


def _intercept(s: Sources) -> str:
    ours, power, mgcv = _terms(s, "(Intercept)")[0], fit_on_power(s), by_mgcv(s)
    return (
        f"{table2_row(ours)[1]}; of the power {number(power['intercept'], 1, 0)} ({number(power['se'], 1, 0)}), "
        f"by mgcv {number(mgcv['intercept'], 1, 0)} ({number(mgcv['se'], 1, 0)})"
    )


def _near_intercept(row: Record) -> bool:
    """Whether an intercept is within one standard error of the paper."""
    paper, error = (float(text.strip("()")) for text in PAPER_TABLE2["(Intercept)"].split())
    return bool(abs(row["intercept"] - paper) < error)


def _stars(rows: Sequence[Record]) -> list[str]:
    """Weathers that differ from 0 at 5 %."""
    return [
        table2_row(row)[0].removeprefix("weather: ")
        for row in rows
        if row["p_value"] is not None and row["p_value"] < 0.05
    ]


def _starred(s: Sources) -> str:
    power = [row for row in fit_on_power(s)["terms"] if row["term"].startswith("weather")]
    mgcv = by_mgcv(s)
    p = {table2_row(row)[0]: number(row["p_value"], 1.0, 3) for row in power}
    return (
        f"{listed(_stars(_terms(s, 'weather')))}; of the power {listed(_stars(power))} (dark p = {p['weather: dark']}, sunset {p['weather: sunset']}; "
        f"by mgcv {number(mgcv['p_dark'], 1.0, 3)}, {number(mgcv['p_sunset'], 1.0, 3)})"
    )


def _edf(s: Sources) -> str:
    first, power, mgcv = s.claims["table2"][0], fit_on_power(s), by_mgcv(s)
    near = {
        name: [
            words
            for (key, words), paper in zip(EDF_COLUMNS, PAPER_EDF, strict=True)
            if abs(row[key] - paper) < NEAR_EDF
        ]
        for name, row in (("first", first), ("power", power))
    }
    return (
        f"within 1: {len(near['first'])} of {len(PAPER_EDF)} ({listed(near['first'])}), mean distance {first['distance']:.1f}; "
        f"[of the power](#power) {len(near['power'])} ({listed(near['power'])}), {power['distance']:.1f}, by mgcv {mgcv['distance']:.1f}"
    )


def _significance(s: Sources) -> tuple[list[str], list[str]]:
    """Smooths whose significance at 5 % differs from the paper's: in the protocol's fit, and of the power."""
    return tuple(  # type: ignore[return-value]
        [
            name
            for name, cell in map(table2_row, rows)
            if name.startswith("s(") and cell.endswith("*") != PAPER_TABLE2[name].endswith("*")
        ]
        for rows in (s.view.results["table2"], fit_on_power(s)["terms"])
    )


def _correlations(s: Sources) -> str:
    names = ("boosting", "boosting-exchangeable", "boosting-ar1")
    errors = " / ".join(f"{100 * mape(s, name):.1f}" for name in names)
    return (
        f"cited, asymptotic. Errors {errors} % by independence / exchangeable / AR(1); the paper's rounds, and `htb` of htree, are independence. "
        "With covariates that vary in time the others also need E[y_t | all rows] = E[y_t | row t] (Pepe & Anderson 1994)"
    )


def _same_correctors(s: Sources) -> str:
    best, worst = (pair_of(s.view.results["paired"], "gamm", name) for name in ("boosting", "forest"))
    power = pair_of(s.claims["pairs"], "gamm", "boosting")
    return f"GAMM above boosting {_gap(best)}, above forest {_gap(worst)}; of the power above boosting {_gap(power)}"


def _same_verdict(s: Sources) -> str:
    paired = [pair_of(s.view.results["paired"], "gamm", n)["significant"] for n in ("forest", "boosting")]
    return say(
        not any(paired), "no" if pair_of(s.claims["pairs"], "gamm", "boosting")["significant"] else "partly"
    )


def _times(s: Sources) -> str:
    fit, predict = ([float(s.view.scores[n][key]) for n in CORRECTORS] for key in ("fit_s", "predict_ms"))
    return (
        f"another language, other rows; no driver was asked. Here fit {', '.join(number(x) for x in fit)} s, "
        f"a trip {', '.join(number(x, 1, 0) for x in predict)} ms"
    )


def _best_verdict(s: Sources) -> str:
    pair = pair_of(s.view.results["paired"], "forest", "boosting")
    lowest = min(CORRECTORS, key=lambda name: mape(s, name)) == "boosting"
    return say(lowest and pair["significant"], "partly" if lowest else "no")


def _best(s: Sources) -> str:
    pair, power = (
        pair_of(pairs, "forest", "boosting") for pairs in (s.view.results["paired"], s.claims["pairs"])
    )
    return (
        f"forest above boosting {_gap(pair)}; of the power {_gap(power)}; with the paper's rate of 1 boosting has "
        f"{option(s, 'boosting', 'learning rate 1')}, above the forest's {percent(mape(s, 'forest'))}"
    )


def orders(s: Sources) -> dict[str, tuple[float, float, float]]:
    """Errors of physics, data alone and hybrid boosting by target and simulation."""
    alone = mape(s, "boosting-only"), power_of(s, "boosting-only", None)["mape"]
    return {
        "cumulative, table's": (mape(s, SIMULATION), alone[0], mape(s, "boosting")),
        "cumulative, nearest": (mape(s, NEAREST), alone[0], mape(s, "boosting-brochure")),
        "power, table's": (
            mape(s, SIMULATION),
            alone[1],
            power_of(s, "boosting", SIMULATION)["mape"],
        ),
        "power, nearest": (mape(s, NEAREST), alone[1], power_of(s, "boosting")["mape"]),
    }


def _order_verdict(s: Sources) -> str:
    held = [a > b > c for a, b, c in orders(s).values()]
    return say(all(held), "partly" if any(held) else "no")


def _variation(s: Sources) -> str:
    names = ("boosting-only", "physics", *CORRECTORS)
    power = [power_of(s, name, None if name == "boosting-only" else NEAREST) for name in names]
    largest = [score_of(s, name)["max_ape"] for name in ("boosting-only", SIMULATION, *CORRECTORS)]
    return (
        f"standard deviation of the power {_each([row['spread'] for row in power])} (data alone, physics, correctors), "
        f"but the largest error is a hybrid's: {_each([row['max_ape'] for row in power], 0)}; cumulative {_each(largest, 0)}"
    )


def _variation_verdict(s: Sources) -> str:
    names = ("physics", *CORRECTORS)
    alone, others = power_of(s, "boosting-only", None), [power_of(s, name) for name in names]
    held = [all(alone[key] > row[key] for row in others) for key in ("spread", "max_ape")]
    return say(all(held), "partly" if any(held) else "no")


def improved(s: Sources, target: str, simulation: str) -> list[float]:
    """Shares of the trips that the correctors improve."""
    if target == "power":
        return [float(power_of(s, name, simulation)["improved_share"]) for name in CORRECTORS]
    suffix = "-brochure" if simulation == NEAREST else ""
    return [float(score_of(s, f"{name}{suffix}")["improved_share"]) for name in CORRECTORS]


def _improved(s: Sources) -> str:
    shares = [
        f"{words} {_each(improved(s, target, simulation), digits)}"
        for words, target, simulation, digits in (
            ("table's simulation", "cumulative", SIMULATION, 0),
            ("nearest", "cumulative", NEAREST, 0),
            ("of the power, table's", "power", SIMULATION, 0),
            ("of the power, nearest", "power", NEAREST, 1),
        )
    ]
    return f"{'; '.join(shares)}. It measures the simulation"


def _improved_verdict(s: Sources) -> str:
    held = [
        min(improved(s, target, simulation)) > 0.9
        for target in ("cumulative", "power")
        for simulation in (SIMULATION, NEAREST)
    ]
    return say(all(held), "partly" if any(held) else "no")


def _needed(s: Sources) -> str:
    study = s.view.results["studies"]["trips_needed"]
    first, last, (hybrid, alone) = study["curve"][0], study["curve"][-1], CURVE_MODELS
    return (
        f"{first['n_trips']} trips, the fewest tried, beat data alone with {last['n_trips']} ({percent(last[alone])}), but so does the simulation "
        f"({percent(mape(s, SIMULATION))}); with {first['n_trips']} the hybrid has {percent(first[hybrid])}, data alone of the power with {s.view.main['n_trips'] - 1} "
        f"{percent(power_of(s, alone, None)['mape'])}, six coefficients {percent(mape(s, 'linear6'))}"
    )


def _kinds(s: Sources, by: str) -> list[Record]:
    return [row for row in s.claims["kinds"] if row["by"] == by]


def _gain(row: Record) -> str:
    gain = points(row["boosting-only"] - row["boosting"])
    return f"{gain} ({span(row['diff_ci95'])})" if row["trips"] > 1 else gain


def _rare(s: Sources) -> str:
    (descent, road), (cold, mild, hot) = _kinds(s, "road"), _kinds(s, "battery")
    return (
        f"data alone above hybrid (power, nearest): net descents ({descent['trips']} trips, largest {descent['largest_descent_m']:.0f} m) {_gain(descent)}, other roads {_gain(road)}; "
        f"battery below 5 °C ({cold['trips']} trips) {_gain(cold)}, 5 to 28 °C {_gain(mild)}. Not in the data: long descents, hot batteries ({hot['trips']} trip)"
    )


def _rare_verdict(s: Sources) -> str:
    held = [_kinds(s, by)[0]["diff_ci95"][0] > 0.0 for by in ("road", "battery")]
    return say(all(held), "partly" if any(held) else "untestable")


def _settings_verdict(s: Sources) -> str:
    found = [row["errors"][0] for row in s.claims["options"] if row["model"] == "boosting-only"]
    return say(max(abs(error - mape(s, "boosting-only")) for error in found) > 0.02)


_FOREST_GRID: Final = "the paper names no grid, ours has leaves " + " and shares of columns ".join(
    ", ".join(f"{value:g}" for value in values)
    for values in (ClusteredForest.default_grid[k] for k in ("max_leaf_nodes", "max_features"))
)

# ---------------------------------------------------------------- rows

CLAIMS: Final = (
    Claim(
        "Abstract, §4: hybrids lower the average error from 40 % to 10 %",
        "partly",
        lambda s: (
            f"to 10 %: {_mapes(s)}; not from 40 %: {percent(mape(s, SIMULATION))}. On the nearest simulation from {percent(mape(s, NEAREST))} to {_mapes(s, '-brochure')}"
        ),
        "P",
    ),
    Claim("Abstract: factors such as weather have a huge effect", "partly", _weather, "P, Q"),
    Claim(
        "§1: heating can take over 30 % of the energy",
        lambda s: say(s.claims["climate"]["winter"]["max"] > 0.3),
        _heating,
        "Q",
    ),
    Claim(
        "§1: cold lowers capacity and efficiency of the battery; range anxiety is a barrier",
        "untestable",
        "cited",
    ),
    Claim(
        "§1: higher accuracy in spite of few trips and unknown drivers",
        lambda s: say(
            all(pair_of(s.view.results["paired"], SIMULATION, n)["significant"] for n in CORRECTORS), "partly"
        ),
        lambda s: (
            "below the simulation: "
            + ", ".join(_gap(pair_of(s.view.results["paired"], SIMULATION, n)) for n in CORRECTORS)
        ),
        "P",
    ),
    Claim(
        "§1, §4: vehicle and external factors are apart, so a model serves another car without loss",
        _transfer_verdict,
        _transfer,
        "T",
    ),
    Claim("§1: other drivers", "untestable", "no driver is recorded"),
    Claim(
        "§2.1: physics alone lacks heating and air conditioning",
        lambda s: say(
            abs(_simulated(s, "paper, climate control")["bias"]) < abs(_simulated(s, SIMULATION)["bias"])
        ),
        lambda s: (
            "with climate control and nothing else changed: bias from {} to {} %, error from {} to {}".format(
                *(
                    number(_simulated(s, name)["bias"], 100, 1)
                    for name in (SIMULATION, "paper, climate control")
                ),
                *(percent(_simulated(s, name)["mape"]) for name in (SIMULATION, "paper, climate control")),
            )
        ),
        "Q",
    ),
    Claim(
        "§2.1, §4: works without climate control (VED; Holden, 12 %) are as accurate",
        "untestable",
        "other trips; [other systems on these trips](peers.md)",
    ),
    Claim(
        "§2.1: data-driven models need much data",
        "partly",
        lambda s: "{3} with {0} trips, {4} with {1}; but six coefficients have {2}".format(
            *(s.view.results["studies"]["trips_needed"]["curve"][k]["n_trips"] for k in (0, -1)),
            percent(mape(s, "linear6")),
            *(
                percent(s.view.results["studies"]["trips_needed"]["curve"][k]["boosting-only"])
                for k in (0, -1)
            ),
        ),
        "P",
    ),
    Claim(
        "§2.1: they depend on their settings",
        _settings_verdict,
        lambda s: (
            f"two tried: {percent(mape(s, 'boosting-only'))}; rate 1 {option(s, 'boosting-only', 'learning rate 1')}, 240 rows {option(s, 'boosting-only', '240 rows')}"
        ),
        "P, Q",
    ),
    Claim("§2.1: they fail on trips unlike those of the fit", _unseen_verdict, _unseen, "Q"),
    Claim("§2.1: they explain nothing", "untestable", "a judgement"),
    Claim("§2.1: the hybrid adapts to driving conditions", _adapts_verdict, _adapts, "Q"),
    Claim(
        "Figure 1: schematic of the simulation (MATLAB 2017b; no values)",
        "form",
        "[redrawn](#figure-1), with values from named sources",
    ),
    Claim("§2.2: 50 % recuperation, as more trips are warm", "form", _recuperation, "P, Q"),
    Claim(
        "Figure 2: inputs time, speed, inclination; outputs battery temperature, current, voltage",
        "form",
        "[redrawn](#figure-2); every error here is given the driven speed",
    ),
    Claim("§2.2: longitudinal models remove the dependence of rows", _dependence_verdict, _dependence, "Q"),
    Claim(
        "§2.2: mixed models explain random variability, by the driver's style and comfort temperature",
        "untestable",
        lambda s: (
            f"cited; no driver is recorded. In sample, least squares on season, weather, duration and temperature leave {percent(s.claims['trips']['share'], 0)} of the variance at the end of {s.view.main['n_trips']} trips to the trip"
        ),
        "Q",
    ),
    Claim("§2.2: leave one trip out, averaged", "form", "also by days, in [the results](results.md)", "P"),
    Claim(f"§2.3: {PAPER_TRIPS} trips of one BMW i3, 10 Hz", "deviates", _trips_used, "P, Q"),
    Claim("Table 1: variables", "form", "[in SI units](#table-1)"),
    Claim("§3: Intel i7-8565U, 16 GB", "untestable", _machine, "P, R"),
    Claim(
        "§3, steps 1 to 4: simulate, residual, learn, add",
        "deviates",
        "`HybridModel`; the residual of the cumulative energy, which the paper does not state. [Another reading](#power)",
    ),
    Claim("Equation 1: absolute percentage error at the end", "form", "`metrics.absolute_percentage_error`"),
    Claim(
        "Equation 2: GAMM with link, variance function, prior weights, D(θ)",
        "deviates",
        "`tripwatt_gamm.GAMM`, not mgcv, which fits Table 2 alone; link identity, constant variance, no weights, as in its fit",
    ),
    Claim(
        "§3.1, equation 3: outliers and heavy tails, so Student's t",
        _heavy_verdict,
        _heavy,
        "Q",
    ),
    Claim("Figure 3: the residuals match the quantiles of the t", _figure3_verdict, _figure3, "Q"),
    Claim("Figure 4: smooths", "form", "[drawn](#figure-4)", "P"),
    Claim(
        "§3.1, Figure 4: the effects of trips are Gaussian",
        lambda s: say(s.claims["figure3"]["trip_effects"]["shapiro_p"] > 0.05),
        lambda s: (
            f"skew {number(s.claims['figure3']['trip_effects']['skew'])}, p = {number(s.claims['figure3']['trip_effects']['shapiro_p'])} (Shapiro & Wilk)"
        ),
        "Q",
    ),
    Claim("§3.1: estimates are robust to effects that are not normal", "untestable", "cited"),
    Claim(
        f"Table 2: intercept {PAPER_TABLE2['(Intercept)']}",
        lambda s: say(
            _near_intercept(s.claims["table2"][0]), "partly" if _near_intercept(fit_on_power(s)) else "no"
        ),
        _intercept,
        "P, Q, R",
    ),
    Claim(
        "Table 2: of the weathers dark and sunset differ from 0",
        lambda s: say({"dark", "sunset"} <= {*_stars(_terms(s, "weather"))}),
        _starred,
        "P, Q, R",
    ),
    Claim(
        "Table 2: rainy and dark, little rainy are 0.00 (0.00)",
        "untestable",
        "two columns were redundant; [what follows](#table-2)",
    ),
    Claim(
        "Table 2: EDF of the smooths",
        lambda s: say(
            s.claims["table2"][0]["distance"] < NEAR_EDF,
            "partly" if fit_on_power(s)["distance"] < NEAR_EDF else "no",
        ),
        _edf,
        "P, Q, R",
    ),
    Claim(
        "Table 2: which smooths are significant",
        lambda s: say(not _significance(s)[0], "partly" if not _significance(s)[1] else "no"),
        lambda s: "differ: {}; of the power: {}".format(*(listed(names) for names in _significance(s))),
        "P, Q",
    ),
    Claim("§3.1: terms stay whatever their p; EDF 1 is a straight line", "form", "as in the paper"),
    Claim(
        "§3.2: forest with bootstrap of subjects, R package htree, grid search",
        "deviates",
        lambda s: (
            f"`ClusteredForest`; htree was not run. {_FOREST_GRID[0].upper()}{_FOREST_GRID[1:]}. Its historical trees are not built: columns of history (mean and top speed, climb so far) give {option(s, 'forest', 'history')}, seeds {option(s, 'forest', 'seeds')}"
        ),
        "Q",
    ),
    Claim(
        "§3.2: to draw subjects is better than to draw rows",
        lambda s: say(_drawn(s, "trips drawn") < _drawn(s, "rows drawn")),
        lambda s: (
            f"ten folds: {percent(_drawn(s, 'trips drawn'))}, rows drawn {percent(_drawn(s, 'rows drawn'))}"
        ),
        "Q",
    ),
    Claim(
        "§3.3: boosting as a GEE, consistent whatever the working correlation",
        "untestable",
        _correlations,
        "P",
    ),
    Claim(
        "§3.3, rounds: F(k+1) = F(k) + T(k+1), rounds by leaving subjects out",
        "deviates",
        lambda s: (
            f"learning rate 0.1 instead of 1 ({option(s, 'boosting', 'learning rate 1')} with 1; seeds {option(s, 'boosting', 'seeds')}); five folds of trips choose the rounds"
        ),
        "Q",
    ),
    Claim(
        "Figure 5 (GAMM), Figure 6 (forest), Figure 7 (boosting): errors; Figure 8: box plots",
        "form",
        "[with every model](#figures-5-to-8)",
        "P",
    ),
    Claim(
        "Table 3: physics 0.379",
        lambda s: _table3_verdict(s, SIMULATION),
        lambda s: (
            f"{_beside(s, SIMULATION)}; {percent(mape(s, NEAREST))} ({span(score_of(s, NEAREST)['mape_ci95'])}) [with published values](#physics)"
        ),
        "P",
    ),
    Claim(
        "Table 3: GAMM 0.115",
        lambda s: _table3_verdict(s, "gamm"),
        lambda s: (
            f"{_beside(s, 'gamm')}, interval {span(score_of(s, 'gamm')['mape_ci95'])}; with normal AR(1) errors instead of Student's t, which all {s.view.results['studies']['choices']['gamm-chosen']['gamm-ar1']} folds choose, {percent(mape(s, 'gamm-ar1'))}; {_power_mapes(s, 'gamm')}"
        ),
        "P, Q",
    ),
    *(
        Claim(
            f"Table 3: {name} {paper}",
            lambda s, name=name: _table3_verdict(s, name),  # type: ignore[misc]
            lambda s, name=name: f"{_beside(s, name)}; {_power_mapes(s, name)}",  # type: ignore[misc]
            "P, Q",
        )
        for name, paper in (("forest", "0.106"), ("boosting", "0.103"))
    ),
    Claim("§3.4: no large difference among the correctors", _same_verdict, _same_correctors, "P, Q"),
    Claim("§3.4: GAMMs run longest; drivers do not wait, so trees are preferable", "untestable", _times, "P"),
    Claim("§3.4: GAMMs show the effect of each predictor", "yes", "[Figure 4](#figure-4)", "P"),
    Claim("§3.4: boosting is best", _best_verdict, _best, "P, Q"),
    Claim(
        "§3.4: the data-driven model has the same inputs",
        "form",
        "all learners read "
        + ", ".join(f"`{name}`" for name in COVARIATES)
        + ": no heating power, no battery temperature",
    ),
    Claim(
        "Figure 9: errors of physics, then data alone, then hybrid",
        _order_verdict,
        lambda s: "; ".join(f"{name}: {_each(errors)}" for name, errors in orders(s).items()),
        "P, Q",
    ),
    Claim("Figure 9: data alone vary most, up to almost 80 %", _variation_verdict, _variation, "P, Q"),
    Claim("§3.4: over 90 % of the trips are improved", _improved_verdict, _improved, "P, Q"),
    Claim("§3.4: less data than data-driven models", "partly", _needed, "P, Q"),
    Claim("§3.4: limits: drivers unknown, few trips, one car", "form", "the same data"),
    Claim("§4: about 10 % with either corrector", "partly", "the first row", "P"),
    Claim(
        "§4: physics has what is known, the corrector the rest",
        "partly",
        lambda s: (
            f"data alone of the power above the hybrid {_gap(pair_of(s.claims['pairs'], 'boosting-only', 'boosting'))}; six coefficients without physics {percent(mape(s, 'linear6'))}"
        ),
        "P, Q",
    ),
    Claim("§4: rare cases: long descents, cold or hot battery", _rare_verdict, _rare, "Q"),
)
"""Everything that the paper shows or states, in its order; what it only announces is left out."""


def _drawn(s: Sources, name: str) -> float:
    (row,) = (r for r in s.claims["options"] if (r["model"], r["option"]) == ("forest", name))
    return float(row["errors"][0])
