"""The forecast before departure, scored: python -m benchmarks.before [--write].

The Renault Twizy's logs carry the speed limit of the road. Each of its trips is planned from limits and heights; the car is learned from its other
trips. Beside that the travel times are tested where they were not learned: those of each data set on the trips of every other. `--write` renews
docs/results/before.json and the parts `before` of the README, of docs/explanation/results.md and of docs/explanation/evaluation.md.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tools import DATA, DOCS, ROOT
from tools.command import run
from tools.docs import pages

from benchmarks.cars import cars
from benchmarks.measure import Row, report
from tripwatt.auditing import audit
from tripwatt.certification import describe_car
from tripwatt.evaluation.before import DRIVEN, ELSEWHERE, PLANNED, evaluate_before
from tripwatt.evaluation.cars import CarTrips
from tripwatt.report.before import LABELS, before_tables
from tripwatt.report.tables import Column, Table, in_percent, markdown, number, span, tabulated
from tripwatt.routes.free_flow import TravelTimeFactors, free_flow_links
from tripwatt.sources import read_logs
from tripwatt.trips import Trip

MOST_OVER_DRIVEN = 1.3
MOST_DURATION = 0.12
RESULT = DOCS / "results" / "before.json"
BY_DAY = "twizy, whole days left out"
CITATION = "Y. NaitMalek et al., RSK Twizy EV dataset, CC BY 4.0, doi:10.1109/ACCESS.2022.3225643 and doi:10.3390/su14169993"


def twizy(data: Path = DATA) -> CarTrips:
    """The Twizy as its kind of body alone describes it, with its sound trips."""
    fleet = read_logs(data / "twizy", "table", ROOT / "tools" / "data" / "twizy.toml")
    trips = tuple(trip for trip in audit(fleet).trips if trip.observed_energy_wh is not None)
    return CarTrips("twizy", "twizy", describe_car(body="quadricycle"), trips)


def day_of(trip: Trip) -> object:
    """Day of a trip of the Twizy: its logs are named T1_03_29_2021 and the like."""
    return trip.trip_id.split("_")[1:4]


def transfer(sets: Mapping[str, Sequence[Trip]]) -> list[dict[str, Any]]:
    """Error of the durations of each set with the travel times of every other; of a set by itself each trip from the others."""
    cut = {name: [free_flow_links(trip) for trip in trips] for name, trips in sets.items()}
    rows = []
    for learned, known in cut.items():
        factors = TravelTimeFactors.from_links(*zip(*known, strict=True))
        for scored, asked in cut.items():
            errors = []
            for k, (links, driven_s) in enumerate(asked):
                rest = [other for i, other in enumerate(known) if i != k]
                used = (
                    factors if learned != scored else TravelTimeFactors.from_links(*zip(*rest, strict=True))
                )
                errors.append(used.expected(links).duration_s / driven_s.sum() - 1.0)
            rows.append(
                {
                    "learned": learned,
                    "scored": scored,
                    "trips": len(errors),
                    "mape": float(np.mean(np.abs(errors))),
                    "bias": float(np.mean(errors)),
                }
            )
    return rows


def measure(data: Path = DATA) -> dict[str, Any]:
    """The results file."""
    own = twizy(data)
    results = evaluate_before([own]).results
    by_day = evaluate_before([replace(own, name=BY_DAY)], fold=day_of).results
    sets: dict[str, list[Trip]] = {}
    for car in cars(data):
        if car.dataset != own.dataset:
            sets.setdefault(car.dataset, []).extend(car.trips)
    scored = [*results["cars"], *by_day["cars"]]
    return {
        **results,
        "cars": scored,
        "citation": CITATION,
        "travel_times": transfer({**sets, own.dataset: own.trips}),
    }


def rows_of(results: Mapping[str, Any]) -> Iterator[Row]:
    """The bars."""
    for car in results["cars"]:
        known = car["known"]
        yield Row(
            f"{car['car']}, {PLANNED}: error over that of the driven trace",
            car["over_driven"],
            most=MOST_OVER_DRIVEN,
            note=f"{known[PLANNED]['mape']:.4f} over {known[DRIVEN]['mape']:.4f}",
        )
        for name in (PLANNED, ELSEWHERE):
            yield from rows_of_known(f"{car['car']}, {name}", known[name], car["trips"])


def rows_of_known(text: str, row: Mapping[str, Any], n: int) -> Iterator[Row]:
    """Duration, intervals and chances to arrive of one row of a car."""
    yield Row(f"{text}: error of the duration", row["duration"]["mape"], most=MOST_DURATION)
    held = [
        (
            f"{float(level):.0%} interval holds {row['inside'][level]} of {n}",
            level,
            row["coverage_ci95"][level],
        )
        for level in ("0.5", "0.9")
    ]
    held += [
        (f"{c['arrived']} of {n} arrive with a chance of {c['chance']:.0%}", c["chance"], c["ci95"])
        for c in row["arrival"]
    ]
    for what, level, (low, high) in held:
        yield Row(f"{text}: {what}; lower end of Clopper-Pearson's interval", low, most=float(level))
        yield Row(f"{text}: {what}; upper end", high, least=float(level))


def transfer_table(results: Mapping[str, Any]) -> Table:
    """Errors of durations, a row for each set that times are learned from."""
    by_set: dict[str, dict[str, Any]] = {}
    for row in results["travel_times"]:
        by_set.setdefault(row["learned"], {"learned": row["learned"]})[row["scored"]] = row["mape"]
    columns = [in_percent(f"Trips of {name} [%]", name) for name in by_set]
    return tabulated(
        "Mean error of the duration by where the travel times were learned; a set by itself: each trip from the others",
        by_set.values(),
        Column("Learned from", "learned"),
        *columns,
    )


def short(results: Mapping[str, Any]) -> str:
    """The part of the README."""
    car = results["cars"][0]
    known, n = car["known"], car["trips"]
    table = tabulated(
        f"The forecast before departure: {n} trips of a Renault Twizy, planned from speed limits and heights, each by a model without it",
        [{"label": LABELS[name], **row} for name, row in known.items()],
        Column("Known of the trip", "label"),
        in_percent("Mean error of the energy [%]", "mape"),
        in_percent("95 % interval", "mape_ci95"),
        in_percent("Mean error of the duration [%]", lambda row: row.get("duration", {}).get("mape")),
        Column("Inside the 90 % interval", lambda row: row["inside"]["0.9"], digits=0),
        strong=frozenset({list(known).index(PLANNED)}),
    )
    return markdown(table)


def text_of(results: Mapping[str, Any]) -> str:
    """The part of the page of results."""
    tables = (*before_tables(results), transfer_table(results))
    car = results["cars"][0]
    planned, duration = car["known"][PLANNED], car["known"][PLANNED]["duration"]
    said = (
        f"The energy before departure errs by {number(planned['mape'], 100, 1)} % in the mean over {car['trips']} trips (95 % interval "
        f"{span(planned['mape_ci95'])} %), {number(car['over_driven'])} times as much as with the driven trace; the duration errs by "
        f"{number(duration['mape'], 100, 1)} %. Data: {results['citation']}."
    )
    return "\n\n".join((said, *map(markdown, tables)))


def bars_table(results: Mapping[str, Any]) -> str:
    """The part of the page on measuring."""
    head = "| What | Figure | Bound | Met |\n|:--|--:|--:|:--|"
    return "\n".join([head, *(row.cells for row in rows_of(results))])


def publish(results: Mapping[str, Any]) -> None:
    """The results file, and the parts of pages."""
    RESULT.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    pages.renew(ROOT / "README.md", "before", short(results))
    pages.renew("explanation/results.md", "before", text_of(results))
    pages.renew("explanation/evaluation.md", "before", bars_table(results))


def bounds() -> Iterator[Row]:
    """The bars, measured."""
    yield from rows_of(measure())


def main(write: bool = False) -> int:
    """Print the rows; 1 when a bound is missed."""
    results = measure()
    if write:
        publish(results)
    for row in results["travel_times"]:
        print(f"times of {row['learned']} on {row['scored']}: {row['mape']:.3f}, bias {row['bias']:+.3f}")
    return int(report(rows_of(results)) and not write)


if __name__ == "__main__":
    run(main)
