"""Paired differences of the mean errors over the same trips, as a column of the table."""

from __future__ import annotations

from collections.abc import Sequence

from tripwatt.study.report.intervals import STAR
from tripwatt.study.report.tables import Column, number, span
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import model_label

SIGNIFICANCE_NOTE = "A difference is significant (*) if its interval does not contain 0 for any of 40 seeds of the bootstrap over days."


def paired_with(pairs: Sequence[Record], best: str | None) -> list[Record]:
    """Select the pairs with `best`, swapped so that `best` is always `b`; a positive difference means a lower error of `best`.

    Examples
    --------
    >>> paired_with([{"a": "boosting", "b": "forest", "diff": -0.01, "ci95": [-0.02, 0.005]}], "boosting")
    [{'a': 'forest', 'b': 'boosting', 'diff': 0.01, 'ci95': [-0.005, 0.02]}]
    """
    selected: list[Record] = []
    for pair in pairs:
        if pair["b"] == best:
            selected.append(pair)
        elif pair["a"] == best:
            low, high = pair["ci95"]
            selected.append({**pair, "a": pair["b"], "b": best, "diff": -pair["diff"], "ci95": [-high, -low]})
    return selected


def difference_column(view: View) -> Column:
    """Make the column of a row's mean error minus that of the best model, with its interval; a star if it is significant."""
    pairs = {pair["a"]: pair for pair in paired_with(view.results.get("paired") or (), view.best)}

    def cell(row: Record) -> str | None:
        pair = pairs.get(row["name"])
        if pair is None:
            return None
        return f"{number(pair['diff'], 100, 1)} ({span(pair['ci95'])}){STAR * pair['significant']}"

    return Column(f"Above {model_label(str(view.best))} [points]", cell)
