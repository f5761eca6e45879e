"""A table of the report as Markdown, for the pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from tripwatt.study.report.intervals import STAR
from tripwatt.study.report.tables import DASH, Table, number
from tripwatt.study.report.view import View
from tripwatt.study.report.words import model_label

SHARED: Final = ("boosting-only", "linear4", "linear6")
"""Models of both protocols that take something else in each."""
DIFFERS: Final[Mapping[str, str]] = {
    "forecast": "the protocol `paper` has other models of these names, of the energy since departure and with the mean temperature",
    "paper": "the protocol `forecast` has other models of these names, of the power of segments and with the temperature at departure",
}


CELLS_NOTE: Final = (
    "A cell has the share inside [%], its Clopper-Pearson interval (95 %), and the mean width/the needed width, of energy in kWh, of charge in "
    f"points. \\{STAR} differs significantly from the level. With the needed width, known in hindsight alone, the intervals, all scaled by one "
    "factor, would have held exactly their share."
)


def on_names(view: View) -> str:
    """Which models of the run share their name with another model, and how they differ; empty where none does."""
    names = [model_label(name) for name in SHARED if name in view.scores]
    differs = DIFFERS.get(view.protocol.name)
    return f"*{'*, *'.join(names)}*: {differs}." if names and differs else ""


def markdown(table: Table) -> str:
    r"""A table as GitHub Markdown.

    Examples
    --------
    >>> print(markdown(Table("Caption", ("Model", "Error"), (("a|b", "1.0"),))))
    *Caption*
    <BLANKLINE>
    | Model | Error |
    |:--|--:|
    | a\|b | 1.0 |
    """

    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(_markdown_text(cell) for cell in cells)} |"

    rule = "|".join(":--" if i in table.text_columns else "--:" for i in range(len(table.columns)))
    body = [
        line([f"**{cell}**" if i == 0 else cell for i, cell in enumerate(row)])
        if place in table.strong
        else line(row)
        for place, row in enumerate(table.rows)
    ]
    return "\n".join([f"*{_markdown_text(table.caption)}*", "", line(table.columns), f"|{rule}|", *body])


def bounds(shares: Sequence[float]) -> str:
    """An interval of shares in percent, as short as a cell needs it.

    Examples
    --------
    >>> bounds((0.371, 0.629))
    '37–63'
    """
    return "–".join(number(share, 100.0, 0) for share in shares)


def intervals_side_by_side(table: Table) -> Table:
    """A table of intervals (`tripwatt.study.report.intervals`) with one row for each set of trips and one column for each interval.

    Examples
    --------
    >>> rows = ("A", "50 % of energy", "1 of 2", "50", "1 to 99", "0.21", "0.20"), ("", "90 % of energy", "2 of 2", "100*", "16 to 100", "0.5", "0.4")
    >>> shown = intervals_side_by_side(Table("Intervals", ("",) * 7, rows))
    >>> shown.columns, shown.rows
    (('Scored', '50 % of energy', '90 % of energy'), (('A', '50 (1–99) 0.21/0.20', '100* (16–100) 0.5/0.4'),))
    """
    by_set: dict[str, dict[str, str]] = {}
    for name, interval, _, share, span, *widths in table.rows:
        cells = by_set.setdefault(name, {}) if name else by_set[next(reversed(by_set))]
        cells[interval] = f"{share} ({'–'.join(span.split()[::2])}) {'/'.join(widths)}"
    intervals = dict.fromkeys(interval for cells in by_set.values() for interval in cells)
    rows = tuple((name, *(cells.get(i, DASH) for i in intervals)) for name, cells in by_set.items())
    return Table(table.caption, ("Scored", *intervals), rows)


def _markdown_text(text: str) -> str:
    for char, safe in (("\\", "\\\\"), ("|", "\\|"), ("<", "&lt;"), (">", "&gt;"), ("\n", " ")):
        text = text.replace(char, safe)
    return text
