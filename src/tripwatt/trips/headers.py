"""Unknown names of columns and keys: the faults of a header, and the known name of the same quantity."""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Final

from tripwatt.errors import MAX_FAULTS, MAX_HINTS, Fault

DELIMITERS: Final = ";,\t|"
"""Possible delimiters between the cells of a text table."""

LONGEST_NAME: Final = 60
"""Number of characters of a name that are compared and shown."""

UNITS: Final = re.compile(
    r"_(m_s|km_h|kmh|kph|mph|k?m|mi|ft|m?s|min|h|deg[cf]|[cfk]|[mk]?v|m?a|k?w|k?wh|nm|pa|1|pct|percent)$"
)


def same_quantity(name: object, known: Collection[str], *, cutoff: float = 0.6) -> str:
    """Return the known name of the same quantity in any unit, or else the most similar known name; empty if none is similar.

    Parameters
    ----------
    name : object
        Name in the input.
    known : collection of str
        Known names.
    cutoff : float
        Least similarity for the name of another quantity, see `difflib.get_close_matches`.

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
    """Yield the faults of unknown and of duplicate columns. O(names); only the first few have hints, and the first lists the allowed names.

    Parameters
    ----------
    names : sequence of str
        Names of the columns of a file.
    known : collection of str
        Allowed names.
    where, what : str
        Names of the table and of the fault of an unknown column in messages.
    hint : callable
        Unknown name -> hint for the message; empty for no hint.

    Examples
    --------
    >>> [fault.got for fault in header_faults(["a", "b", "b"], ("b",), "table", "unknown column", str.upper)]
    ['a', '2 times']
    """
    unknown = [name for name in names if name not in known]
    for k, name in enumerate(unknown[:MAX_FAULTS]):
        shown = name[:LONGEST_NAME]
        fix = hint(name) if k < MAX_HINTS else ""
        allowed = "" if k else ", ".join(known)
        yield Fault(what, f"{where}, column {shown!r}", shown, allowed, fix, at=(name,))
    if len(unknown) > MAX_FAULTS:
        yield Fault(what, where, f"{len(unknown) - MAX_FAULTS} more", ", ".join(known))
    twice = [(name, count) for name, count in Counter(names).items() if count > 1]
    for name, count in twice[:MAX_FAULTS]:
        yield Fault("duplicate column", f"{where}, column {name[:LONGEST_NAME]!r}", f"{count} times", "once")
    if len(twice) > MAX_FAULTS:
        yield Fault("duplicate column", where, f"{len(twice) - MAX_FAULTS} more", "once")
