"""Coverage of the forecast's intervals, and errors of the forecast at arrival and during the trip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tripwatt.study.report.intervals import STAR, WIDTH_NOTE, intervals_table
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.tables import Column, Table, in_kwh, in_percent, make_table
from tripwatt.study.report.view import Record, View, describe_evaluation

STARTS: Final[Mapping[str, str]] = {
    "soc": "the display was known at departure",
    "bms_soc": "the battery management's charge was known",
}
"""Key in `arrival` -> what was known at departure."""


def panels(view: View) -> list[Panel]:
    """Return the panels of coverage and of errors at arrival and during the trip; none without a forecast."""
    if "coverage" not in view.focus:
        return []
    arrival = _arrival_table(view)
    note = f"{STAR} differs significantly from the level. {WIDTH_NOTE}"
    return [
        Panel("coverage", "Coverage of the intervals", note, tables=(coverage_by_set(view),)),
        *([Panel("arrival", "State of charge at arrival", tables=(arrival,))] if arrival.rows else ()),
        Panel("updates", "Error of the forecast during the trip", tables=(updates_table(view),)),
    ]


def scored_sets(view: View) -> list[tuple[str, Record, int]]:
    """Return name, scores of the forecast and number of trips of every set of held-out trips."""
    scored = [(e, e["models"].get(view.protocol.focus, {})) for e in view.evaluations]
    return [(describe_evaluation(e), score, int(e["n_trips"])) for e, score in scored if "coverage" in score]


def coverage_by_set(view: View) -> Table:
    """Tabulate coverage, width and needed width of energy and charge, for every set of held-out trips."""
    caption = view.captioned(f"Intervals of held-out trips by kind, {view.protocol.given}")
    return intervals_table(caption, scored_sets(view))


def _arrival_table(view: View) -> Table:
    """Tabulate error and interval of the displayed charge at arrival, a row for each charge known at departure."""
    scores = view.focus.get("arrival") or {}
    return make_table(
        view.captioned(f"Displayed charge at arrival, {view.protocol.given}"),
        [{**scores[key], "start": words} for key, words in STARTS.items() if scores.get(key)],
        Column("Known at departure", "start"),
        Column("Trips", "n_trips", digits=0),
        in_percent("Mean error [points]", "mae", 2),
        in_percent("Bias [points]", "bias", 2),
        in_percent("Inside 90 % [%]", "coverage"),
        in_percent("Clopper-Pearson 95 %", "coverage_ci95"),
        in_percent("Its width [points]", "interval_width"),
    )


def updates_table(view: View) -> Table:
    """Tabulate errors and intervals of the re-forecast, and errors of the baselines, by the part that was driven."""
    return make_table(
        view.captioned(f"Mean error of the re-forecast total, {view.protocol.given}"),
        [{**row, "part": f"{100 * float(key):g} %"} for key, row in view.focus["update"].items()],
        Column("Part driven", "part"),
        in_percent("Re-forecast [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("No update [%]", "no_update"),
        in_percent("Difference [points]", "diff", 2),
        in_percent("Its 95 % interval", "diff_ci95", 2),
        in_percent("SoC alone [%]", "soc_only"),
        in_percent("Gauge [%]", "naive_gauge"),
        in_percent("Inside 90 % [%]", "coverage"),
        in_kwh("Its width [kWh]", "interval_width_wh"),
    )
