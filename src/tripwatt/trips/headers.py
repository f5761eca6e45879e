"""Names of columns and keys that are not ours: the faults of a header, and our name of the same quantity."""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Final

from tripwatt.errors import MOST_FAULTS, MOST_HINTS, Fault

DELIMITERS: Final = ";,\t|"
"""What may be between the cells of a text table."""

LONGEST_NAME: Final = 60
"""Characters of a name that are compared and shown."""

UNITS: Final = re.compile(
    r"_(m_s|km_h|kmh|kph|mph|k?m|mi|ft|m?s|min|h|deg[cf]|[cfk]|[mk]?v|m?a|k?w|k?wh|nm|pa|1|pct|percent)$"
)


def same_quantity(name: object, known: Collection[str], *, cutoff: float = 0.6) -> str:
    """The known name of the same quantity, whatever its unit, else the most similar one; empty where none is near.

    Parameters
    ----------
    name : object
        As it comes from outside.
    known : collection of str
    cutoff : float
        Least similarity of another quantity's name, see `difflib.get_close_matches`.

    Examples
    --------
    >>> [same_quantity(name, ("length_m", "speed_m_s"), cutoff=0.8) for name in ("speed_km_h", "Length_km", "colour")]
    ['speed_m_s', 'length_m', '']
    """
    text = str(name).lower()[:LONGEST_NAME]
    same = [ours for ours in known if UNITS.sub("", ours) == UNITS.sub("", text)]
    return next(iter(same or difflib.get_close_matches(text, known, n=1, cutoff=cutoff)), "")


def header_faults(
    names: Sequence[str], known: Collection[str], where: str, what: str, hint: Callable[[str], str]
) -> Iterator[Fault]:
    """Columns that are unknown, and those that occur twice. O(names): hints for the first few alone.

    Parameters
    ----------
    names : sequence of str
        As a file has them.
    known : collection of str
        Names that are allowed.
    where, what : str
        Name of the table and of the fault for messages.
    hint : callable
        What helps against an unknown name; empty for nothing.

    Examples
    --------
    >>> [fault.got for fault in header_faults(["a", "b", "b"], ("b",), "table", "unknown column", str.upper)]
    ['a', '2 times']
    """
    allowed = ", ".join(known)
    unknown = [name for name in names if name not in known]
    for k, name in enumerate(unknown[:MOST_FAULTS]):
        shown = name[:LONGEST_NAME]
        fix = hint(name) if k < MOST_HINTS else ""
        yield Fault(what, f"{where}, column {shown!r}", shown, allowed, fix)
    if len(unknown) > MOST_FAULTS:
        yield Fault(what, where, f"{len(unknown) - MOST_FAULTS} more", allowed)
    twice = [(name, count) for name, count in Counter(names).items() if count > 1]
    for name, count in twice[:MOST_FAULTS]:
        yield Fault("duplicate column", f"{where}, column {name[:LONGEST_NAME]!r}", f"{count} times", "once")
    if len(twice) > MOST_FAULTS:
        yield Fault("duplicate column", where, f"{len(twice) - MOST_FAULTS} more", "once")
