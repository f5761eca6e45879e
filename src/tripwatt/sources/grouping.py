"""Separators of thousands: whether a comma or a point in the numbers of a column divides groups of digits or begins decimals.

All cells of a column are looked at together, because "12,345" alone may be either.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Final, Literal

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, and_more, excerpt

MARKS: Final = {",": ".", ".": ","}
"""Separator -> the other one."""
MIN_GROUPED: Final = 10
"""Least number of cells such as 1,913 that show groups beside whole numbers below 1000: decimals have other numbers of digits as well."""

Use = Literal["unused", "decimal", "group", "unclear"]


def use_of(cells: Sequence[str], mark: str) -> Use:
    """What a separator means in the cells of a column.

    Parameters
    ----------
    cells : sequence of str
    mark : str
        "," or ".".

    Examples
    --------
    >>> use_of(["1,913", "12,5"], ","), use_of(["1,913", "12,872"], ","), use_of(["1,913.5"], ",")
    ('decimal', 'unclear', 'group')
    >>> use_of(["1,913", "-78"] * 10, ",")
    'group'
    """
    own, other = re.escape(mark), re.escape(MARKS[mark])
    grouped = re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{own}\d{{3}})+(?:{other}\d+)?")
    decimal = re.compile(rf"[+-]?(?:\d*|\d{{1,3}}(?:{other}\d{{3}})+){own}\d*(?:[eE][+-]?\d+)?")
    marked = [cell for cell in cells if mark in cell]
    has_decimals = any(decimal.fullmatch(cell) and not grouped.fullmatch(cell) for cell in marked)
    is_sure = any((c.count(mark) > 1 or MARKS[mark] in c) and grouped.fullmatch(c) for c in marked)
    if has_decimals or is_sure:
        return "unclear" if has_decimals and is_sure else "decimal" if has_decimals else "group"
    as_groups = [cell for cell in marked if grouped.fullmatch(cell)]
    if not as_groups:
        return "unused"
    whole = [abs(int(cell)) for cell in cells if re.fullmatch(r"[+-]?\d{1,15}", cell)]
    if any(whole) and max(whole) < 1000 and len(as_groups) >= MIN_GROUPED:
        return "group"
    return "decimal" if any(value >= 1000 for value in whole) else "unclear"


def group_separator(cells: Sequence[str], decimals: Callable[[], set[str]]) -> str | None:
    """The separator of groups of digits in a column, empty if there is none; None if the cells leave it open.

    Parameters
    ----------
    cells : sequence of str
    decimals : callable
        Gives the separators that begin decimals in the other columns of the file.

    Examples
    --------
    >>> group_separator(["1,913", "12,872"], lambda: {"."}), group_separator(["1.913", "12.872"], lambda: {"."})
    (',', '')
    >>> group_separator(["1.913", "12.872"], set) is None
    True
    """
    uses = {mark: use_of(cells, mark) for mark in MARKS}
    for mark, use in uses.items():
        if use == "group":
            # a point that groups in one column and begins decimals in another is no usual way to write
            contradicts = uses[MARKS[mark]] != "decimal" and mark in decimals()
            return None if contradicts else mark
    for mark, use in uses.items():
        if use == "unclear":
            others = decimals()
            if len(others & {*MARKS}) != 1:
                return None
            return "" if mark in others else mark
    return ""


def unclear_fault(where: str, filled: Sequence[str]) -> Fault:
    """The fault of a column whose cells leave open what the separator means."""
    got = excerpt(next(cell for cell in filled if MARKS.keys() & {*cell})) + and_more(filled)
    allowed = "numbers of which one shows what the separator means"
    fix = "export the file without separators of thousands"
    return Fault("decimals or thousands", where, got, allowed, fix, count=len(filled))


def may_be_grouped(values: FloatArray) -> bool:
    """Whether numbers that were read with a decimal separator may have been grouped: up to three decimals, and none between 0 and 1.

    Examples
    --------
    >>> may_be_grouped(np.array([12.345, 78.0])), may_be_grouped(np.array([12.345, 0.078]))
    (True, False)
    """
    size = np.abs(values[np.isfinite(values)])
    if ((size > 0.0) & (size < 1.0)).any() or size.max(initial=0.0) >= 1000.0 or not (size % 1.0).any():
        return False
    return bool(np.isclose(1000.0 * size, np.round(1000.0 * size), rtol=0.0, atol=1e-6).all())
