"""Reports of readers: what was read from each file, and what was left out and why."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from tripwatt.arrays import by_key
from tripwatt.errors import Fault, and_more, counted

MAX_NAMES: Final = 20
"""Largest number of files that a sentence names."""

_FIGURES: Final = re.compile(r"[-+]?\d[\d.,:]*")


@dataclass(frozen=True, slots=True)
class Group:
    """Things of one kind that are told in one line.

    Attributes
    ----------
    what : str
        The kind.
    count : int
        How many there are.
    places : int
        Files or trips in which they are.
    example : str
        The first one in full.

    Examples
    --------
    >>> print(Group("not a number", 12, 3, "not a number: a.csv row 7 column 'Ambient': got 'ERR'"))
    not a number: 12 in 3 places, for example a.csv row 7 column 'Ambient': got 'ERR'
    >>> print(Group("90 m in 60 s: shorter than 1000 m", 2, 2, "monday: 90 m in 60 s: shorter than 1000 m"))
    monday: 90 m in 60 s: shorter than 1000 m (and 1 more like it)
    """

    what: str
    count: int
    places: int
    example: str

    def __str__(self) -> str:
        kind = f"{self.what}: "
        if not self.example.startswith(kind):
            return f"{self.example} (and {self.count - 1} more like it)" if self.count > 1 else self.example
        number = f"{self.count}" if self.places <= 1 else f"{self.count} in {self.places} places"
        return f"{kind}{number}, for example {self.example.removeprefix(kind)}"


def group_by_kind(things: Iterable[tuple[str, str, int, str]]) -> tuple[Group, ...]:
    """Group things by kind, the most frequent kind first.

    Parameters
    ----------
    things : iterable of (str, str, int, str)
        Kind, place, count, and full text of each thing. Kinds that differ only in numbers are one kind.

    Returns
    -------
    tuple of Group
        One for each kind.

    Examples
    --------
    >>> [(a.what, a.count) for a in group_by_kind([("3 gaps", "A", 1, "A: 3 gaps"), ("5 gaps", "B", 1, "B: 5 gaps")])]
    [('3 gaps', 2)]
    """
    groups = by_key(things, lambda thing: _FIGURES.sub("#", thing[0])).values()
    columns = ((*zip(*members, strict=True),) for members in groups)
    kinds = (Group(what[0], sum(n), len({*place}), text[0]) for what, place, n, text in columns)
    return tuple(sorted(kinds, key=lambda group: -group.count))


@dataclass(frozen=True, slots=True)
class FileReading:
    """What was taken of one file.

    Attributes
    ----------
    name : str
        Name of the file, as it was given.
    rows, rows_used : int
        Rows with a value, and those of them that are in a log.
    logs : int
        Logs in it.
    faults : tuple of Fault
        What could not be read.
    kind : int
        Files with the same columns have the same number.

    Examples
    --------
    >>> FileReading("a.csv", rows=10, rows_used=9, logs=1).state
    'in part'
    """

    name: str
    rows: int = 0
    rows_used: int = 0
    logs: int = 0
    faults: tuple[Fault, ...] = ()
    kind: int = 0

    @property
    def state(self) -> Literal["read", "in part", "left out"]:
        """Whether the file was read completely, in part, or left out."""
        if not self.logs:
            return "left out"
        return "in part" if self.faults or self.rows_used < self.rows else "read"


@dataclass(frozen=True, slots=True, repr=False)
class ReadingReport:
    """What a reader read from its files.

    Attributes
    ----------
    files : tuple of FileReading
        Files in the order in which they were read.

    Examples
    --------
    >>> fault = Fault("empty file", "b.csv", "0 bytes", "a header and rows")
    >>> report = ReadingReport((FileReading("a.csv", 10, 9, 1), FileReading("b.csv", faults=(fault,))))
    >>> print(report)
    2 files: 1 read, 1 left out; 9 of 10 rows are used
    >>> report.groups()[0].what
    'empty file'
    >>> report.notes()
    ['left out: b.csv; empty file: b.csv: got 0 bytes; allowed: a header and rows']
    """

    files: tuple[FileReading, ...]

    def groups(self) -> tuple[Group, ...]:
        """Group the faults of all files by kind."""
        return group_by_kind((f.what, file.name, f.count, f"{f}") for file in self.files for f in file.faults)

    def notes(self) -> list[str]:
        """Sentences on the files that were left out, by name and with their first fault, then on the faults of the others by kind."""
        read = ReadingReport(tuple(file for file in self.files if file.logs))
        left_out = (file for file in self.files if not file.logs)
        lines = []
        for files in by_key(left_out, lambda file: file.faults and file.faults[0].what).values():
            names = ", ".join(file.name for file in files[:MAX_NAMES]) + and_more(
                files[MAX_NAMES - 1 :], "file"
            )
            lines.append("; ".join([f"left out: {names}", *map(str, files[0].faults[:1])]))
        return [*lines, *map(str, read.groups())]

    @property
    def faults(self) -> Sequence[Fault]:
        """Faults of all files: everything that could not be read."""
        return [fault for file in self.files for fault in file.faults]

    def __str__(self) -> str:
        out = sum(file.state == "left out" for file in self.files)
        rows, used = sum(file.rows for file in self.files), sum(file.rows_used for file in self.files)
        counts = f"{len(self.files) - out} read, {out} left out; " if out else ""
        return f"{counted(len(self.files), 'file')}: {counts}{used} of {rows} rows are used"

    def __repr__(self) -> str:
        return f"<ReadingReport {self}>"
