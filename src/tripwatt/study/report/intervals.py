"""Tabulate the coverage of intervals, their width and the width that was needed, for every protocol and scheme."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from tripwatt.study.evaluation.forecast_scores import UPDATE_LEVEL
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


def intervals_table(caption: str, scored: Iterable[tuple[str, Mapping[str, Any], int]]) -> Table:
    """Make a table with a row for each interval of energy and of charge; a set of trips is named only in its first row.

    Parameters
    ----------
    caption : str
    scored : iterable of (str, mapping, int)
        Name of what was scored, its scores from `tripwatt.study.evaluation.forecast_scores.coverage_scores`, with those of
        `arrival_scores` as `arrival` if there are any, and number of trips. Results of older versions lack counts and needed widths.
    """
    rows = [
        ("" if k else name, *row)
        for name, score, trips in scored
        for k, row in enumerate(_rows(score, trips))
    ]
    return Table(caption, COLUMNS, tuple(rows), text_columns=frozenset({0, 1}))


def _rows(score: Mapping[str, Any], trips: int) -> Iterator[tuple[str, ...]]:
    """Yield a row for each level of the energy's interval, and one for the charge at arrival from the displayed charge."""
    for key, share in score["coverage"].items():
        needed = score.get("needed_width_wh", {}).get(key)
        widths = number(score["interval_width_wh"][key], 1e-3), number(needed, 1e-3)
        yield _row("energy", share, trips, score["coverage_ci95"][key], float(key), widths)
    charge = (score.get("arrival") or {}).get("soc")
    if charge is not None:
        widths = number(charge["interval_width"], 100, 1), number(charge.get("needed_width"), 100, 1)
        share, trips, bounds = charge["coverage"], charge["n_trips"], charge["coverage_ci95"]
        yield _row("charge", share, trips, bounds, UPDATE_LEVEL, widths)


def _row(
    of: str, share: float, trips: int, ci95: Bounds, level: float, widths: tuple[str, str]
) -> tuple[str, ...]:
    inside = round(share * trips)
    shown = number(inside / trips, 100, 0) if trips else DASH
    mark = STAR if ci95 and not ci95[0] <= level <= ci95[1] else ""
    return (f"{100.0 * level:g} % of {of}", f"{inside} of {trips}", f"{shown}{mark}", span(ci95, 0), *widths)
