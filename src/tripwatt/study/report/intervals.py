"""Tabulate the coverage of intervals, their width and the width that was needed, for every protocol and scheme."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import groupby
from operator import itemgetter
from typing import Any, Final

from tripwatt.study.report.tables import DASH, Table, number, span

Bounds = tuple[float, float] | None
COLUMNS: Final = (
    "Scored",
    "Interval",
    "Inside",
    "Inside [%]",
    "Clopper-Pearson 95 %",
    "Mean width",
    "Width that was needed",
)
WIDTH_NOTE: Final = (
    "The width that was needed is that with which the intervals, all scaled by one factor, would have held exactly their share of these "
    "trips. It is known in hindsight alone. Widths of energy in kWh, of charge in points."
)
STAR: Final = "*"
"""Mark of a share whose Clopper-Pearson interval excludes the level."""


def energy_rows(name: str, score: Mapping[str, Any], trips: int) -> Iterable[tuple[str, ...]]:
    """Yield a row for each level of the energy's interval.

    Parameters
    ----------
    name : str
        Name of what was scored.
    score : mapping
        From `tripwatt.study.evaluation.forecast_scores.coverage_scores`; results of older versions lack counts and needed widths.
    trips : int
    """
    for key, share in score["coverage"].items():
        level, needed = float(key), score.get("needed_width_wh", {}).get(key)
        widths = number(score["interval_width_wh"][key], 1e-3), number(needed, 1e-3)
        yield _row(
            (name, f"{100.0 * level:g} % of energy"), share, trips, score["coverage_ci95"][key], level, widths
        )


def charge_rows(name: str, arrival: Mapping[str, Any], level: float) -> Iterable[tuple[str, ...]]:
    """Yield a row for the interval of the charge at arrival; none if there are no scores from the displayed charge.

    Parameters
    ----------
    name : str
    arrival : mapping
        From `tripwatt.study.evaluation.forecast_scores.arrival_scores`.
    level : float
    """
    score = arrival.get("soc")
    if score is None:
        return
    widths = number(score["interval_width"], 100, 1), number(score.get("needed_width"), 100, 1)
    share, trips, bounds = score["coverage"], score["n_trips"], score["coverage_ci95"]
    yield _row((name, f"{100.0 * level:g} % of charge"), share, trips, bounds, level, widths)


def intervals_table(caption: str, rows: Iterable[tuple[str, ...]]) -> Table:
    """Make a table of the rows; a set of trips is named only in its first row."""
    sets = (enumerate(of_set) for _, of_set in groupby(rows, key=itemgetter(0)))
    shown = (("" if k else row[0], *row[1:]) for of_set in sets for k, row in of_set)
    return Table(caption, COLUMNS, tuple(shown), text_columns=frozenset({0, 1}))


def _row(
    names: tuple[str, str], share: float, trips: int, ci95: Bounds, level: float, widths: tuple[str, str]
) -> tuple[str, ...]:
    inside = round(share * trips)
    shown = number(inside / trips, 100, 0) if trips else DASH
    mark = STAR if ci95 and not ci95[0] <= level <= ci95[1] else ""
    return (*names, f"{inside} of {trips}", f"{shown}{mark}", span(ci95, 0), *widths)
