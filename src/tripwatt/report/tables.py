"""A table of text cells, the text of its numbers, and its Markdown; the page and the terminal show the same table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

DASH: Final = "–"


@dataclass(frozen=True, slots=True)
class Table:
    """Text cells with a caption; the first cell of a row is its head.

    Attributes
    ----------
    caption : str
    columns : tuple of str
    rows : tuple of tuple of str
    text_columns : frozenset of int
        Columns of words; all others hold numbers and stand to the right.
    strong : frozenset of int
        Rows to stress.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: frozenset[int] = frozenset({0})
    strong: frozenset[int] = frozenset()


def number(value: object, factor: float = 1.0, digits: int = 2) -> str:
    """A number times a factor, a dash when it is missing.

    Examples
    --------
    >>> number(512.0, 1e-3)
    '0.51'
    """
    if not isinstance(value, int | float | np.floating | np.integer) or not np.isfinite(value):
        return DASH
    text = f"{round(factor * float(value), digits) + 0.0:,.{digits}f}"  # + 0.0: no minus before a zero
    return text.replace("-", "−")


def span(bounds: Sequence[float] | None, digits: int = 1) -> str:
    """An interval of fractions in percent, in one piece."""
    if not bounds:
        return DASH
    return f"{number(bounds[0], 100, digits)}\u00a0to\u00a0{number(bounds[1], 100, digits)}"


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
