"""Print the output of commands: tables and notes for people, JSON for machines, the progress of long work."""

from __future__ import annotations

import json
import math
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final, TextIO

import typer

from tripwatt.errors import counted, printable

if TYPE_CHECKING:
    from rich.console import Console

    from tripwatt.auditing import Audit
    from tripwatt.trips import Flag, TripSet


UNBROKEN: Final = 1000
"""Width [characters] of output to a pipe or a file, so that lines are not broken."""


def console(stream: TextIO | None = None) -> Console:
    """Make a console on a stream, by default standard error; square brackets are printed, not read as markup."""
    from rich.console import Console

    stream = stream or sys.stderr
    width = None if stream.isatty() else UNBROKEN
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False)


def say(*lines: str, err: bool = False) -> None:
    """Print lines on standard output or error; control characters, also line breaks inside of a line, are printed as escapes."""
    typer.echo("\n".join(map(_harmless, lines)), err=err)


def _harmless(text: str) -> str:
    return printable(text.replace("\u00a0", " "))


def print_json(value: object) -> None:
    """Print one JSON document on standard output; control characters are escaped, so that none reaches a terminal."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False)
    typer.echo(re.sub("[\x7f-\x9f]", lambda character: f"\\u{ord(character[0]):04x}", text))


NARROWEST: Final = 12
"""Smallest width [characters] of a column whose lines may break."""
PADDING: Final = 2
"""Characters between two columns."""


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Sequence[str] = (),
    folding: Sequence[str] = (),
) -> None:
    """Print a table on standard output; columns in `numbers` are aligned to the right, columns in `folding` may break lines."""
    from rich.box import SIMPLE
    from rich.cells import cell_len
    from rich.table import Table

    rows = [[_harmless(cell) for cell in row] for row in rows]
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for column, *cells in zip(columns, *rows, strict=True):
        longest, folds = max(map(cell_len, (column, *cells))), column in folding
        table.add_column(
            column,
            justify="right" if column in numbers else "left",
            no_wrap=not folds,
            overflow="fold",
            min_width=min(longest, NARROWEST) if folds else longest,
        )
    for row in rows:
        table.add_row(*row)
    shown = console(sys.stdout)
    shown.print(_harmless(title))
    # a column that does not fit would be cut: the table is made wide, and the terminal breaks the lines instead
    shown.width = max(shown.width, sum((column.min_width or 0) + PADDING for column in table.columns))
    shown.print(table, crop=False)


MAX_GROUPS: Final = 12
"""Largest number of kinds of faults and notes that are listed."""


def grouped(flags: Iterable[Flag]) -> list[str]:
    """Return one sentence for each kind of flag, with the number of further flags of that kind."""
    from tripwatt.trips.messages import message
    from tripwatt.trips.reading import group_by_kind  # pandas is slow to import

    return [*map(str, group_by_kind((flag.code, flag.subject, 1, message(flag)) for flag in flags))]


def print_reading(fleet: TripSet, result: Audit) -> None:
    """Print on standard error what was read, how much the audit left out, and which files were left out or read in part."""
    report = fleet.report
    if report is not None and report.files:
        say(f"{report}", err=True)

    def amount(distance_m: float, duration_s: float) -> str:
        return f"{distance_m / 1000.0:.1f} km and {duration_s / 3600.0:.1f} h"

    used = amount(sum(t.distance_m for t in result.trips), sum(t.duration_s for t in result.trips))
    lost = amount(result.lost_distance_m, result.lost_duration_s)
    say(f"{counted(len(result.trips), 'trip')} used, with {used}; left out: {lost}", err=True)
    lines = [*(report.notes() if report else ()), *grouped(fleet.notes)]
    rest = len(lines) - MAX_GROUPS
    further = [f"{rest} more kinds (`tripwatt audit DATA --json` lists all)"] if rest > 0 else []
    print_notes([*lines[:MAX_GROUPS], *further])


def print_notes(notes: Iterable[str | Flag]) -> None:
    """Print notes on standard error; a flag is printed as its sentence, a serious flag as a warning."""
    from tripwatt.trips.messages import message, severity_of  # the help needs no words of flags

    for note in notes:
        kind = "note" if isinstance(note, str) or severity_of(note) != "warning" else "warning"
        say(f"{kind}: {note if isinstance(note, str) else message(note)}", err=True)


def print_few_notes(flags: Sequence[Flag]) -> None:
    """Print the notes of a short answer: serious flags, flags on the outside temperature, and the number of the others."""
    from tripwatt.trips.messages import severity_of

    few = [f for f in flags if severity_of(f) != "note" or f.subject == "ambient_temperature_degc"]
    rest = len(flags) - len(few)
    print_notes([*few, f"{rest} more, such as values that are assumed: --json has all"] if rest else few)


PROGRESS_EVERY_S: Final = 5.0
"""Shortest time [s] between two lines of progress if there is no terminal."""


@contextmanager
def progress(shown: Console, what: str = "folds") -> Iterator[Callable[[int, int], None]]:
    """Show a bar with the time left; the context gives a function of (finished, all).

    Without a terminal, plain lines are written: the first, the last, and few between.
    """
    if not shown.is_terminal:
        started, last = time.monotonic(), -math.inf

        def advance(finished: int, total: int) -> None:
            nonlocal last
            now = time.monotonic()
            if finished == total or now - last >= PROGRESS_EVERY_S:
                last = now
                shown.print(f"{finished} of {total} {what} finished after {now - started:.0f} s")

        yield advance
        return
    from rich import progress as bars

    done, times = bars.MofNCompleteColumn(), (bars.TimeElapsedColumn(), "left", bars.TimeRemainingColumn())
    with bars.Progress("{task.description}", bars.BarColumn(), done, *times, console=shown) as bar:
        task = bar.add_task(what, total=None)
        yield lambda finished, total: bar.update(task, completed=finished, total=total)


def kwh(energy_wh: float, digits: int = 2, sign: str = "") -> str:
    """Format an energy in kWh.

    Examples
    --------
    >>> kwh(1234.0), kwh(-0.1, 3, "+")
    ('1.23 kWh', '+0.000 kWh')
    """
    return f"{round(energy_wh / 1000.0, digits) + 0.0:{sign}.{digits}f} kWh"
