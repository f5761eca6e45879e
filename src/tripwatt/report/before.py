"""The report of the protocol `before`: one page and the files beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tripwatt.report.html import write_page, write_whole
from tripwatt.report.panel import Panel
from tripwatt.report.tables import Column, Table, in_percent, tabulated

if TYPE_CHECKING:
    from tripwatt.evaluation.before import BeforeRun

Record = Mapping[str, Any]

LABELS: Final = {
    "driven trace": "the driven trace, the best case",
    "before departure": "before departure, travel times of the other trips",
    "before departure, times of another car": "before departure, travel times of another car",
}


def write_before(run: BeforeRun, out: Path) -> None:
    """Write `results.json`, `trips.csv` and `report.html` into a folder, `results.json` last."""
    results = run.results
    facts = [("Cars", f"{len(results['cars'])}"), ("Trips", f"{len(run.trips)}")]
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    panel = Panel(
        "before", "Errors, intervals and their causes", "", tables=before_tables(results), wide=True
    )
    write_page(out, "before.html.jinja", [panel], facts=facts, versions=versions)
    run.trips.to_csv(out / "trips.csv", index=False, lineterminator="\n")
    write_whole(out / "results.json", json.dumps(results, indent=1, allow_nan=False).encode("utf-8"))


def before_tables(results: Record) -> tuple[Table, ...]:
    """The tables of the page."""
    return errors_table(results), chances_table(results), split_table(results)


def errors_table(results: Record) -> Table:
    """Error of energy and duration, and the intervals, by what is known of a trip."""
    rows = [
        {"label": f"{car['car']}: {LABELS[name]}", "trips": car["trips"], **row}
        for car in results["cars"]
        for name, row in car["known"].items()
    ]
    return tabulated(
        "Energy and duration by what is known of a trip",
        rows,
        Column("Known", "label"),
        in_percent("Mean error of the energy [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Bias [%]", "bias"),
        in_percent("Mean error of the duration [%]", lambda row: row.get("duration", {}).get("mape")),
        in_percent("Its bias [%]", lambda row: row.get("duration", {}).get("bias")),
        *_inside("0.5"),
        *_inside("0.9"),
        Column("Trips", "trips", digits=0),
    )


def _inside(level: str) -> tuple[Column, Column]:
    """Trips inside the intervals of a level, and what chance explains."""
    head = f"Inside the {100.0 * float(level):.0f} % interval"
    return (
        Column(head, lambda row: row["inside"][level], digits=0),
        in_percent("Clopper-Pearson 95 %", lambda row: row["coverage_ci95"][level], 0),
    )


def chances_table(results: Record) -> Table:
    """How many trips arrive that leave with the energy for a chance to arrive."""
    rows = [
        {"label": f"{car['car']}: {LABELS[name]}", "trips": car["trips"], **chance}
        for car in results["cars"]
        for name, row in car["known"].items()
        for chance in row["arrival"]
    ]
    return tabulated(
        "Chance to arrive: trips that leave with the energy for it",
        rows,
        Column("Known", "label"),
        in_percent("Chance [%]", "chance", 0),
        Column("Arrive", "arrived", digits=0),
        Column("Trips", "trips", digits=0),
        in_percent("Clopper-Pearson 95 %", "ci95", 0),
    )


def split_table(results: Record) -> Table:
    """The parts of the error before departure."""
    rows = [
        {"label": f"{car['car']}: {row['part']}", **row} for car in results["cars"] for row in car["split"]
    ]
    return tabulated(
        "The error before departure by cause; means and shares add up",
        rows,
        Column("Part", "label"),
        in_percent("Mean [% of energy]", "mean"),
        in_percent("Mean size [% of energy]", "size"),
        in_percent("Share of the mean squared error [%]", "share", 0),
    )
