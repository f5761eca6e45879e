"""Intervals of a model that is fitted to somebody's own logs: python -m benchmarks.own_logs [--blocks 3] [--write].

The trips of each car in order of time, in blocks of equal size: each block is forecast by the default model, fitted to the other blocks.
So a block has no neighbours in time in its fit, as the trips to come have none. `--write` renews the part `own-logs` of
docs/explanation/uncertainty.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from sklearn.model_selection import KFold
from tools.command import run
from tools.docs import pages
from tools.docs.tables import markdown

import tripwatt as tw
from benchmarks.cars import cars
from tripwatt.population.adapting import in_order
from tripwatt.study.evaluation import Execution
from tripwatt.study.report.intervals import STAR
from tripwatt.study.report.tables import Column, in_words, make_table, number
from tripwatt.study.report.words import listed
from tripwatt.trips import Trip
from tripwatt.vehicles import Vehicle

MIN_TRIPS: Final = 15
LEVELS: Final = ("0.5", "0.9", "0.95")


def held_blocks(trips: Sequence[Trip], vehicle: Vehicle, blocks: int) -> dict[str, Any]:
    """Scores of the forecast on blocks of time, each left out of the fit."""
    done = tw.evaluate(
        in_order(trips),
        car=vehicle,
        protocol="forecast",
        models=["hybrid"],
        hold_outs=KFold(blocks),
        execution=Execution(n_jobs=1),
    )
    (scored,) = done.results["evaluations"]
    return dict(scored["models"]["hybrid"]) | {"n_trips": scored["n_trips"]}


def rows(name: str, score: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A row for each level."""
    for level in LEVELS:
        low, high = score["coverage_ci95"][level]
        yield {
            "car": name,
            "level": f"{100 * float(level):g} %",
            "off": "" if low <= float(level) <= high else "few" if high < float(level) else "many",
            "inside": f"{score['inside'][level]} of {score['n_trips']}",
            "ci95": f"{100 * low:.0f} to {100 * high:.0f}",
            "width": number(score["interval_width_wh"][level], 1e-3),
            "needed": number(score["needed_width_wh"][level], 1e-3),
        }


def shown(every: Sequence[dict[str, Any]], blocks: int) -> str:
    """The table as Markdown, and a sentence on what differs from its level.

    Examples
    --------
    >>> row = {"car": "a", "level": "90 %", "inside": "86 of 104", "ci95": "74 to 89", "width": "0.30", "needed": "0.38"}
    >>> print(shown([row | {"off": "few"}], 3).splitlines()[-1])
    Significantly too few trips (Clopper-Pearson, 95 %): a, 90 % (86 of 104).
    """
    columns = (
        in_words("Car", "car"),
        in_words("Level", "level"),
        Column("Inside", lambda row: row["inside"] + STAR * bool(row["off"])),
        Column("Clopper-Pearson 95 % [%]", "ci95"),
        Column("Mean width [kWh]", "width"),
        Column("Width needed [kWh]", "needed"),
    )
    caption = f"Default model, fitted to own logs; {blocks} blocks of time, each left out"
    said = []
    for kind in ("few", "many"):
        off = [f"{row['car']}, {row['level']} ({row['inside']})" for row in every if row["off"] == kind]
        said += [f"Significantly too {kind} trips (Clopper-Pearson, 95 %): {listed(off)}."] if off else []
    verdict = " ".join(said) or "No share differs significantly from its level (Clopper-Pearson, 95 %)."
    return f"{markdown(make_table(caption, every, *columns))}\n\n{verdict}"


def main(blocks: int = 3, write: bool = False) -> None:
    """Print the table; `--write` renews the page."""
    every: list[dict[str, Any]] = []
    for car in cars():
        if len(car.trips) >= MIN_TRIPS:
            score = held_blocks(car.trips, car.vehicle, blocks)
            every += rows(f"{car.name}: {car.vehicle.title}", score)
    print(shown(every, blocks))
    if write:
        pages.renew("explanation/uncertainty.md", "own-logs", shown(every, blocks))


if __name__ == "__main__":
    run(main)
