"""Tables of text cells, and the format of their numbers, for the page and the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

DASH: Final = "–"


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text cells with a caption; the first cell of a row is its head.

    Attributes
    ----------
    caption : str
    columns : tuple of str
    rows : tuple of tuple of str
    text_columns : frozenset of int
        Columns of words; all others hold numbers and are aligned to the right.
    strong : frozenset of int
        Rows to emphasise.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: frozenset[int] = frozenset({0})
    strong: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table of records.

    Attributes
    ----------
    head : str
    value : str or callable
        A key of the record, or a function of the record. Text is shown as it is, a number times `factor` with
        `digits`, a pair of fractions by `span`, and a missing value as a dash.
    factor : float
    digits : int
    text : bool
        Whether the column holds words; the first column of a table always does.

    Examples
    --------
    >>> in_percent("Error [%]", "mape").cell({"mape": 0.125}), Column("Trips", "n").cell({})
    ('12.5', '–')
    """

    head: str
    value: str | Callable[[Any], object]
    factor: float = 1.0
    digits: int = 2
    text: bool = False

    def cell(self, record: Any) -> str:
        """Return the text of a record's cell."""
        value = self.value(record) if callable(self.value) else record.get(self.value)
        if isinstance(value, str):
            return value
        if isinstance(value, list | tuple):
            return span(value, self.digits)
        return number(value, self.factor, self.digits)


def in_percent(head: str, value: str | Callable[[Any], object], digits: int = 1) -> Column:
    """Make a column of fractions, or of intervals of fractions, in percent."""
    return Column(head, value, 100.0, digits)


def in_kwh(head: str, value: str | Callable[[Any], object], digits: int = 2) -> Column:
    """Make a column of energies [Wh] in kWh."""
    return Column(head, value, 1e-3, digits)


def in_words(head: str, value: str | Callable[[Any], object]) -> Column:
    """Make a column of words."""
    return Column(head, value, text=True)


def make_table(
    caption: str, records: Iterable[Any], *columns: Column, strong: frozenset[int] = frozenset()
) -> Table:
    """Make a table with a row for each record.

    Examples
    --------
    >>> make_table("Trips", [{"trip": "a", "wh": 1200.0}], Column("Trip", "trip"), in_kwh("Energy [kWh]", "wh")).rows
    (('a', '1.20'),)
    """
    rows = tuple(tuple(column.cell(record) for column in columns) for record in records)
    words = frozenset(i for i, column in enumerate(columns) if column.text or i == 0)
    return Table(caption, tuple(column.head for column in columns), rows, words, strong)


def number(value: object, factor: float = 1.0, digits: int = 2) -> str:
    """Format a number times a factor; returns a dash for anything but a finite number.

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
    """Format an interval of fractions in percent, with spaces that do not break; returns a dash if it is missing."""
    if not bounds:
        return DASH
    return f"{number(bounds[0], 100, digits)}\u00a0to\u00a0{number(bounds[1], 100, digits)}"
