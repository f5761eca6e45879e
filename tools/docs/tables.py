"""A table of the report as Markdown, for the pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from tripwatt.study.report.tables import Table
from tripwatt.study.report.view import View
from tripwatt.study.report.words import model_label

SHARED: Final = ("boosting-only", "linear4", "linear6")
"""Models of both protocols that take something else in each."""
DIFFERS: Final[Mapping[str, str]] = {
    "forecast": "the protocol `paper` has other models of these names, of the energy since departure and with the mean temperature",
    "paper": "the protocol `forecast` has other models of these names, of the power of segments and with the temperature at departure",
}


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


def _markdown_text(text: str) -> str:
    for char, safe in (("\\", "\\\\"), ("|", "\\|"), ("<", "&lt;"), (">", "&gt;"), ("\n", " ")):
        text = text.replace(char, safe)
    return text
