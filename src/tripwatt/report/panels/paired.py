"""Paired differences of the mean errors over the same trips."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from tripwatt.report.model_styles import model_style
from tripwatt.report.panel import Content, panel
from tripwatt.report.style import INK, PAPER_COLOUR, percent_axis, plotted, row_names
from tripwatt.report.tables import Column, Table, in_words, tabulated
from tripwatt.report.view import Record, View, of_evaluation, plain
from tripwatt.report.words import is_significant, label, listed, points, points_between


@panel("paired-differences", "Paired differences", draws=True, folded=True)
def paired_differences(view: View) -> Content:
    """The best model against every other, and the table of all pairs."""
    pairs, best, table = view.paired_of(view.main), view.best, paired_table(view)
    if not pairs:
        return Content("No pair of models was compared.")
    shown = paired_with(pairs, best) or pairs
    said = (
        f"{on_paired(pairs, best)} A difference is significant if its interval does not contain 0 for any of 40 seeds of "
        f"the bootstrap over days; the table has all {len(table.rows)} pairs."
    )
    return Content(said, plot_paired_differences(view, shown), (table,))


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


def result_of(pair: Record) -> str:
    """The result of one paired comparison.

    Examples
    --------
    >>> result_of({"a": "forest", "b": "boosting", "diff": 0.01, "ci95": [-0.01, 0.02]})
    'no significant difference'
    """
    if is_significant(pair):
        better, worse = (pair["b"], pair["a"]) if pair["diff"] > 0 else (pair["a"], pair["b"])
        return f"{label(str(better))} has a significantly lower error than {label(str(worse))}"
    return "no significant difference"


def on_paired(pairs: Sequence[Record], best: str | None) -> str:
    """Which models the best one beats beyond chance, and which it does not."""
    beaten: list[str] = []
    equal: list[str] = []
    above: list[str] = []
    for pair in pairs:
        if best not in (pair["a"], pair["b"]):
            continue
        other = str(pair["b"] if pair["a"] == best else pair["a"])
        side = 1.0 if pair["b"] == best else -1.0
        better = beaten if side * pair["diff"] > 0 else above
        (better if is_significant(pair) else equal).append(label(other))
    if best is None or not (beaten or equal or above):
        return "No pair of models was compared."
    parts = []
    if beaten:
        parts.append(f"significantly lower than that of {listed(beaten)}")
    if equal:
        parts.append(f"not significantly different from that of {listed(equal)}")
    if above:
        parts.append(f"significantly higher than that of {listed(above)}")
    return f"The mean error of {label(best)} is {'; '.join(parts)}."


def paired_table(view: View) -> Table:
    """Every pair of models of every evaluation, with its interval and the result in words."""
    return tabulated(
        view.captioned("Paired differences over the same trips"),
        [{**pair, "of": of_evaluation(e)} for e in view.evaluations for pair in view.paired_of(e)],
        Column("Pair", lambda pair: f"{label(str(pair['a']))} − {label(str(pair['b']))}"),
        Column("Difference of mean errors", lambda pair: points(float(pair["diff"]))),
        Column("95 % interval", lambda pair: points_between(*map(float, pair["ci95"]))),
        in_words("Result", result_of),
        in_words("Evaluation", "of"),
    )


def plot_paired_differences(view: View, paired: Sequence[Record]) -> Figure:
    """Forest plot of paired differences of the mean APE: a significant difference is drawn solid.

    Parameters
    ----------
    view : View
    paired : sequence of mapping
        `{a, b, diff, ci95}` as in `results.json`, `diff` = mean APE of `a` minus that of `b`.
    """
    height = 1.5 + 0.34 * len(paired)
    figure, axes = plotted(view, height, "Paired differences over the same trips", view.note)
    seconds = {str(pair["b"]) for pair in paired}
    common = model_style(seconds.pop()).label if len(seconds) == 1 else ""
    labels = []
    for row, pair in enumerate(paired):
        low, high = pair["ci95"]
        apart = is_significant(pair)
        colour = model_style(str(pair["a"])).colour
        width, dash, fill = (2.0, "-", colour) if apart else (1.2, (0, (3, 2)), PAPER_COLOUR)
        axes.plot([low, high], [row, row], color=colour, lw=width, ls=dash)
        axes.plot(pair["diff"], row, "o", color=fill, mec=colour, ms=5.5, gid=f"pair-{row}")
        first = plain(model_style(str(pair["a"])).label, 28)
        labels.append(first if common else f"{first}\n− {plain(model_style(str(pair['b'])).label, 28)}")
    axes.axvline(0.0, color=INK, lw=0.9)
    row_names(axes, labels)
    axes.spines["left"].set_visible(False)
    difference = f"mean error minus that of {common}" if common else "difference of mean errors"
    percent_axis(axes, f"{difference}\n[percentage points];  solid: significant")
    return figure
