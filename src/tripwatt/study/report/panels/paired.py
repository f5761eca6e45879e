"""Paired differences of the mean errors over the same trips."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from tripwatt.study.report.intervals import OFF
from tripwatt.study.report.model_styles import model_style
from tripwatt.study.report.panel import Panel
from tripwatt.study.report.style import INK, PAPER_COLOUR, percent_axis, plotted, row_names
from tripwatt.study.report.tables import Column, number, span
from tripwatt.study.report.view import Record, View
from tripwatt.study.report.words import label

SIGNIFICANT = "A difference is significant (*) if its interval does not contain 0 for any of 40 seeds of the bootstrap over days."


def panels(view: View) -> list[Panel]:
    """Every model beside the one that the report describes."""
    pairs = paired_with(view.results.get("paired") or (), view.best)
    if not pairs:
        return []
    drawn = plot_paired_differences(view, pairs)
    return [Panel("paired-differences", "Paired differences", SIGNIFICANT, drawn)]


def paired_with(pairs: Sequence[Record], best: str | None) -> list[Record]:
    """The pairs that hold `best`, turned so that `best` is always `b`: a positive difference means that its error is lower.

    Examples
    --------
    >>> paired_with([{"a": "boosting", "b": "forest", "diff": -0.01, "ci95": [-0.02, 0.005]}], "boosting")
    [{'a': 'forest', 'b': 'boosting', 'diff': 0.01, 'ci95': [-0.005, 0.02]}]
    """
    turned: list[Record] = []
    for pair in pairs:
        if pair["b"] == best:
            turned.append(pair)
        elif pair["a"] == best:
            low, high = pair["ci95"]
            turned.append({**pair, "a": pair["b"], "b": best, "diff": -pair["diff"], "ci95": [-high, -low]})
    return turned


def difference_column(view: View) -> Column:
    """Mean error of the model of a row less that of `best`, with its interval; a star where it is significant."""
    pairs = {pair["a"]: pair for pair in paired_with(view.results.get("paired") or (), view.best)}

    def cell(row: Record) -> str | None:
        pair = pairs.get(row["name"])
        if pair is None:
            return None
        star = OFF if pair["significant"] else ""
        return f"{number(pair['diff'], 100, 1)} ({span(pair['ci95'])}){star}"

    return Column(f"Above {label(str(view.best))} [points]", cell)


def plot_paired_differences(view: View, paired: Sequence[Record]) -> Figure:
    """Forest plot of the differences from one model: a significant difference is drawn solid.

    Parameters
    ----------
    view : View
    paired : sequence of mapping
        From `paired_with`.
    """
    head = "Paired differences over the same trips", view.note
    figure, axes = plotted(view, 1.5 + 0.34 * len(paired), *head)
    for row, pair in enumerate(paired):
        colour = model_style(pair["a"]).colour
        width, dash, fill = (2.0, "-", colour) if pair["significant"] else (1.2, (0, (3, 2)), PAPER_COLOUR)
        axes.plot(pair["ci95"], [row, row], color=colour, lw=width, ls=dash)
        axes.plot(pair["diff"], row, "o", color=fill, mec=colour, ms=5.5, gid=f"pair-{row}")
    axes.axvline(0.0, color=INK, lw=0.9)
    row_names(axes, [label(pair["a"]) for pair in paired])
    percent_axis(
        axes, f"mean error minus that of {label(str(view.best))}\n[percentage points];  solid: significant"
    )
    return figure
