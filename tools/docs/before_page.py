"""The forecast before departure on the pages: from the results file of `python -m benchmarks.before`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from tools.docs.tables import bounds, markdown
from tripwatt.study.report.tables import Column, Table, in_percent, make_table, number, span

Record = Mapping[str, Any]

DRIVEN: Final = "driven trace"
PLANNED: Final = "before departure"
ELSEWHERE: Final = "before departure, times of another car"
LABELS: Final = {
    "driven trace": "the driven trace, the best case",
    "before departure": "travel times of the other trips",
    "before departure, times of another car": "travel times of another car",
}


def text_of(results: Record) -> str:
    """The part of the page of results."""
    tables = (*before_tables(results), transfer_table(results))
    car = results["cars"][0]
    planned, duration = car["known"][PLANNED], car["known"][PLANNED]["duration"]
    sentences = (
        f"The energy before departure errs by {number(planned['mape'], 100, 1)} % in the mean over {car['trips']} trips (95 % interval "
        f"{span(planned['mape_ci95'])} %), {number(car['over_driven'])} times as much as with the driven trace; the duration errs by "
        f"{number(duration['mape'], 100, 1)} %. Data: {results['citation']}."
    )
    return "\n\n".join((sentences, *map(markdown, tables)))


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
    return make_table(
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
    """How many trips arrive with the energy for a chance to arrive; a column for each chance."""
    rows = [
        {"label": f"{car['car']}: {LABELS[name]}", **{f"{c['chance']}": c for c in row["arrival"]}}
        for car in results["cars"]
        for name, row in car["known"].items()
    ]

    def arrived(chance: str) -> Column:
        head = f"{100.0 * float(chance):g} %"
        return Column(head, lambda row: f"{row[chance]['arrived']} ({bounds(row[chance]['ci95'])})")

    return make_table(
        "Trips that arrive with the energy for a chance of 50 % and more, with the Clopper-Pearson interval (95 %) of their share [%]",
        rows,
        Column("Known", "label"),
        *(arrived(chance) for chance in rows[0] if chance != "label"),
    )


def split_table(results: Record) -> Table:
    """The parts of the error before departure."""
    rows = [
        {"label": f"{car['car']}: {row['part']}", **row} for car in results["cars"] for row in car["split"]
    ]
    return make_table(
        "The error before departure by cause; means and shares add up",
        rows,
        Column("Part", "label"),
        in_percent("Mean [% of energy]", "mean"),
        in_percent("Mean size [% of energy]", "size"),
        in_percent("Share of the mean squared error [%]", "share", 0),
    )


def transfer_table(results: Record) -> Table:
    """Errors of durations, a row for each set that times are learned from."""
    by_set: dict[str, dict[str, Any]] = {}
    for row in results["travel_times"]:
        by_set.setdefault(row["learned"], {"learned": row["learned"]})[row["scored"]] = row["mape"]
    columns = [in_percent(f"Trips of {name} [%]", name) for name in by_set]
    return make_table(
        "Mean error of the duration by where the travel times were learned; a set by itself: each trip from the others",
        by_set.values(),
        Column("Learned from", "learned"),
        *columns,
    )
