"""`docs/explanation/paper.md`: the rows of `tools.docs.paper_rows` as a table, and the sections that it links to.

The figures are those of the report of the protocol `paper`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from scipy.stats import norm

from tools.docs.paper_rows import (
    CLAIMS,
    EDF_COLUMNS,
    PAPER_EDF,
    PAPER_TABLE2,
    PAPER_TRIPS,
    RUNS,
    VERDICTS,
    Sources,
    by_mgcv,
    fit_on_power,
    mape,
    pair_of,
    power_of,
    table2_row,
    tails_of,
)
from tools.docs.tables import markdown
from tripwatt.study.evaluation.paper_studies import NEAREST
from tripwatt.study.paper.correctors import SIMULATION
from tripwatt.study.report.panels import paper_studies
from tripwatt.study.report.panels.paired import SIGNIFICANCE_NOTE
from tripwatt.study.report.tables import DASH, Column, Table, in_percent, make_table, number
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import listed, model_label

POWER_STEP_S: Final = 10
"""Spacing of rows of the power at which the fits of our engine and of mgcv are compared."""

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
    ("Elevation", "`elevation_m` [m]"),
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


# ---------------------------------------------------------------- sections


def _image(name: str, alt: str) -> str:
    return f"![{alt}](../images/paper-{name}.png)"


def _figure3(s: Sources) -> str:
    found = s.claims["figure3"]
    fits = make_table(
        "Residuals of the GAMM against its fitted t; quantiles: measured by expected",
        [{"fit": name.replace("ν free", "refitted, ν free"), **row} for name, row in found["fits"].items()],
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
        "Other errors on the same residuals of the first row, not refitted; log score per row on trips left out",
        found["errors"],
        Column("Error", "error"),
        Column("Log score", "log_score", digits=3),
        Column("Below −300 Wh expected", "expected", digits=1),
    )
    late = [row for row in found["far_trips"] if row["from_s"] >= 300.0]
    early = [row for row in found["far_trips"] if row not in late]
    rows = (
        f"Of the {tails_of(s, 'cumulative energy')['below']} rows below −300 Wh, "
        + listed([f"{r['rows']} are of {r['trip']} from minute {r['from_s'] / 60:.0f} on" for r in late])
        + f", and {sum(r['rows'] for r in early)} are of the first {max(r['to_s'] for r in early) / 60:.0f} minutes of {len(early)} {listed(sorted({r['season'] for r in early}))} trips. "
        "The residual of the cumulative energy starts at 0, while the effect of a trip is a constant, so a trip with a large effect starts far below it. No skew, second scale or scale by state mends this; "
        "a slope of time for each trip does, and so does the power as target."
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
    smooths, power = (
        dict(map(table2_row, rows)) for rows in (s.view.results["table2"], fit_on_power(s)["terms"])
    )
    names = [*PAPER_TABLE2, *(name for name in smooths if name not in PAPER_TABLE2)]
    rows = tuple(
        (name, smooths.get(name, DASH), power.get(name, DASH), PAPER_TABLE2.get(name, DASH)) for name in names
    )
    caption = "Estimate (standard error) in Wh, of the power in W; EDF (reference df) of a smooth; *** p < 0.001, ** p < 0.01, * p < 0.05"
    heads = ("Term", "Here", f"Power, row, {fit_on_power(s)['every_s']} s", "The paper")
    why = "Season is an ordered factor, so its smooths are centred differences of winter from summer; with an uncentred 0/1 they could not have the EDF 1.00 (1.00) that the paper prints."
    return "\n\n".join([markdown(Table(caption, heads, rows)), why, on_trip_df(s.view)])


def _path_row(row: Record) -> Record:
    """A fit on the way to Table 2 in words."""
    engine = f" (mgcv, {row['engine']})" if "engine" in row else ""
    simulation = ", table's simulation" if row.get("simulation") == SIMULATION else ""
    return {
        **row,
        "what": f"{row['target']}, {row['climb_from']}, {row['every_s']} s{simulation}{engine}",
        "constant": f"{number(row['intercept'], 1, 0)}\u00a0({number(row['se'], 1, 0)})",
    }


def _on_power(s: Sources) -> str:
    paper = {
        "what": "the paper",
        "constant": PAPER_TABLE2["(Intercept)"],
        **dict(zip((k for k, _ in EDF_COLUMNS), PAPER_EDF, strict=True)),
    }
    mgcv = [row for row in s.claims["mgcv"] if (row["target"], row["engine"]) == ("power", "bam")]
    path = make_table(
        "EDF by target, origin of the elevation difference (start of the trip or row before) and spacing of rows, on the nearest simulation; distance: mean absolute difference to the paper's",
        [*map(_path_row, (*s.claims["table2"], *mgcv)), paper],
        Column("Fit", "what"),
        *(Column(head, key, digits=1) for key, head in EDF_COLUMNS),
        Column("Distance", "distance", digits=1),
        Column("Intercept", "constant", text=True),
    )
    simulations = (SIMULATION, NEAREST)
    names = ("physics", *paper_studies.CORRECTORS, "boosting-only")

    def cumulative(model: str, simulation: str) -> float:
        if model == "physics":
            return mape(s, simulation)
        suffix = "-brochure" if simulation == NEAREST and model != "boosting-only" else ""
        return mape(s, f"{model}{suffix}")

    errors = make_table(
        "Mean error [%] by the target of the corrector and the simulation",
        [
            {
                "model": model_label(SIMULATION if name == "physics" else name),
                "paper": s.view.published.get(SIMULATION if name == "physics" else name),
            }
            | {f"c{i}": cumulative(name, x) for i, x in enumerate(simulations)}
            | {
                f"p{i}": power_of(s, name, None if name == "boosting-only" else x)["mape"]
                for i, x in enumerate(simulations)
            }
            for name in names
        ],
        Column("Model", "model"),
        in_percent("Cumulative, table's", "c0"),
        in_percent("Cumulative, nearest", "c1"),
        in_percent("Power, table's", "p0"),
        in_percent("Power, nearest", "p1"),
        in_percent("The paper", "paper"),
    )
    return "\n\n".join([_POWER, markdown(errors), markdown(path), _path(s)])


_POWER = (
    "The paper defines the *error* on cumulative energy, but not the residual. If the correctors learn that of the power of each row, and their "
    "predictions are summed, some of what fails above comes nearer: the difference among the correctors, EDF and intercept of Table 2, the skew of Figure 3. "
    "Physics in Table 3 and the share of improved trips depend on the simulation; the order of Figure 9 follows from either change. "
    "This may be the paper's regression. Target, spacing of rows and origin of the elevation difference were chosen with Table 2 in view: "
    "these are development figures. Of the power the GAMM also has a row every 10 s instead of 60 s, and the climb from the row before; trees keep the start's."
)


def _path(s: Sources) -> str:
    """What the other suspects change."""
    start = [
        row for row in s.claims["mgcv"] if row["target"] == "cumulative" and row["climb_from"] == "start"
    ]
    by_k = sorted((row for row in start if row["engine"] == "bam"), key=lambda row: row["k"])
    engines, surface = ([row[key] for row in start if row["k"] == 10] for key in ("distance", "surface"))
    power = {"target": "power", "climb_from": "row", "every_s": POWER_STEP_S}.items()
    mgcv, ours = (
        " and ".join(f"{row['speed']:.1f}" for row in s.claims[name] if power <= row.items())
        for name in ("mgcv", "table2")
    )
    sparse = {
        row["target"]: row["distance"]
        for row in s.claims["table2"]
        if (row["climb_from"], row["every_s"]) == ("row", 60)
    }
    coarse = next(row["ambient"] for row in s.claims["table2"] if row["every_s"] == 600)

    def each(key: str) -> str:
        return ", ".join(f"{row[key]:.1f}" for row in by_k)

    return (
        f"mgcv on the cumulative energy from the start, every 60 s: engine, discretisation (ours rounds covariates, `bam` here does not), family, method and γ leave the distance at {min(engines):.1f} to {max(engines):.1f}, the EDF of the surface at {min(surface):.0f} to {max(surface):.0f}. "
        f"With k = {', '.join(str(row['k']) for row in by_k)} s(ambient) has {each('ambient')}, the distance is {each('distance')}. The paper's reference df of 27 fixes k of the surface at 30; those of the other smooths only bound k from below. "
        f"From the row before s(ambient) is a line, and from the start it has {coarse:.1f} every 600 s. Every 60 s the power is farther from Table 2 than the cumulative energy "
        f"({sparse['power']:.1f} and {sparse['cumulative energy']:.1f}). "
        f"Open: the spacing of the paper's rows; surface, s(elevation difference) and s(time):winter of the power; s(speed) every {POWER_STEP_S} s, for which mgcv has {mgcv} and we have {ours}, "
        f"while every {fit_on_power(s)['every_s']} s both agree ({by_mgcv(s)['speed']:.1f} and {fit_on_power(s)['speed']:.1f})."
    )


def _physics(s: Sources) -> str:
    return "\n\n".join(
        [
            _FORMS,
            markdown(paper_studies.forms_table(s.view)),
        ]
    )


def _trips(s: Sources) -> str:
    study = s.view.results["studies"]["trips_needed"]
    return (
        f"Means over {study['curve'][-1]['draws']} draws, scored on all other trips. The crossing is at most {study['crossing']:.0f} trips, the fewest tried."
        f"\n\n{_image('trips-needed', 'Mean error against the number of training trips')}"
    )


def _evidence(s: Sources) -> str:
    wider = float(norm.ppf(1.0 - 0.025 / 3) / norm.ppf(0.975))
    gamm = [pair_of(s.view.results["paired"], "gamm", name) for name in ("forest", "boosting")]
    kept = sum(pair["diff"] > wider * (pair["ci95"][1] - pair["ci95"][0]) / 2 for pair in gamm)
    return f"{SIGNIFICANCE_NOTE} Intervals of one mean draw trips. Nothing is corrected for the number of comparisons: for three pairs Bonferroni widens the intervals by {number(wider)}, and {kept} of the {len(gamm)} differences of the GAMM stay significant."


def on_trip_df(view: View) -> str:
    """How many trips the paper's Table 2 was fitted on, from the reference df of its random effect."""
    rows = {table2_row(record)[0]: record for record in view.results["table2"]}
    weathers = [record["std_error"] for name, record in rows.items() if name.startswith("weather: ")]
    fitted = PAPER_TRIP_DF + 1 + PAPER_WEATHERS
    return (
        "mgcv's reference df of a random effect is the number of its levels less the number of columns that are constant within a "
        f"level. With the intercept and {PAPER_WEATHERS} weather coefficients, the {PAPER_TRIP_DF} of the paper's s(Trip.id) are "
        f"those of {fitted} trips, not of {PAPER_TRIPS}. Two weathers print 0.00 (0.00): two columns were redundant. Eight columns of 0 and 1 beside an intercept have that "
        "rank if one weather is absent from the fit; the other zero then falls on a weather that has trips, by the pivoting. So neither a ninth weather nor the absence of both follows. "
        f"Here {view.main['n_trips']} trips, an intercept and {sum(e > 0 for e in weathers)} of {len(weathers)} weather coefficients with data leave "
        f"{number(rows['s(trip)']['ref_df'], 1.0, 0)}."
    )


_FORMS = "The paper prints no parameter of its MATLAB car but the 50 % of regeneration. Ours has the measured coast-down and a drivetrain from named sources; the other forms take published values. "
SECTIONS: Final[tuple[tuple[str, str, Callable[[Sources], str]], ...]] = (
    ("power", "A reading that comes nearer: the power", _on_power),
    (
        "figure-1",
        "Figure 1: schematic of the simulation",
        lambda s: (
            f"{_image('simulation', 'From time, speed and grade over road load and drivetrain to battery and energy')}\n\n[The car model](car-model.md) has every value of the preset `paper`."
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
        [
            f"{verdicts}. Three figures in a row are those of GAMM, forest, boosting. Runs, all by `make results` but R: {runs}.",
            "\n".join(rows),
            *sections,
            origin,
        ]
    )
