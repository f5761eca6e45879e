"""Coverage of intervals with their width and the width that was needed: the same table for every protocol and scheme."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from tripwatt.report.tables import DASH, Table, number, span

COLUMNS: Final = (
    "Scored",
    "Interval",
    "Inside",
    "Inside [%]",
    "Clopper-Pearson 95 %",
    "Mean width",
    "Width that was needed",
)
NOTE: Final = (
    "The width that was needed is that with which the intervals, all scaled by one factor, would have held exactly their share of these "
    "trips. It is known in hindsight alone. Widths of energy in kWh, of charge in points."
)
OFF: Final = "*"
"""Marks a share whose Clopper-Pearson interval leaves out the level."""


def energy_rows(name: str, score: Mapping[str, Any], trips: int) -> Iterable[tuple[str, ...]]:
    """A row for each level of the energy's interval.

    Parameters
    ----------
    name : str
        What was scored.
    score : mapping
        From `tripwatt.evaluation.forecast_scores.coverage_scores`; results of older versions lack counts and needed widths.
    trips : int
    """
    for key, share in score["coverage"].items():
        needed = score.get("needed_width_wh", {}).get(key)
        yield _row(
            name,
            f"{100.0 * float(key):g} % of energy",
            (round(share * trips), trips),
            score["coverage_ci95"][key],
            float(key),
            (number(score["interval_width_wh"][key], 1e-3), number(needed, 1e-3)),
        )


def charge_rows(name: str, arrival: Mapping[str, Any], level: float) -> Iterable[tuple[str, ...]]:
    """A row for the interval of the charge at arrival, where the display was known at departure.

    Parameters
    ----------
    name : str
    arrival : mapping
        From `tripwatt.evaluation.forecast_scores.arrival_scores`.
    level : float
    """
    score = arrival.get("soc")
    if score is None:
        return
    yield _row(
        name,
        f"{100.0 * level:g} % of charge",
        (round(score["coverage"] * score["n_trips"]), score["n_trips"]),
        score["coverage_ci95"],
        level,
        (number(score["interval_width"], 100, 1), number(score.get("needed_width"), 100, 1)),
    )


def intervals_table(caption: str, rows: Iterable[tuple[str, ...]]) -> Table:
    """The rows as a table; a set of trips is named in its first row alone."""
    shown, before = [], None
    for row in rows:
        shown.append(row if row[0] != before else ("", *row[1:]))
        before = row[0]
    return Table(caption, COLUMNS, tuple(shown), text_columns=frozenset({0, 1}))


def _row(
    name: str,
    interval: str,
    counts: tuple[int, int],
    ci95: tuple[float, float] | None,
    level: float,
    widths: tuple[str, str],
) -> tuple[str, ...]:
    inside, trips = counts
    share = number(inside / trips, 100, 0) if trips else DASH
    mark = OFF if ci95 and not ci95[0] <= level <= ci95[1] else ""
    return (name, interval, f"{inside} of {trips}", f"{share}{mark}", span(ci95, 0), *widths)
