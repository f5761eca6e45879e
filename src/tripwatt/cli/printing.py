"""What commands print: tables and notes for people, JSON for machines, the progress of long work."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final, TextIO

import typer

if TYPE_CHECKING:
    from rich.console import Console

from tripwatt.trips.flags import Flag
from tripwatt.trips.messages import message

UNBROKEN: Final = 1000
"""Width [characters] of what goes into a pipe or a file, where nobody needs lines to be broken."""


def console(stream: TextIO | None = None) -> Console:
    """A console on a stream, by default on standard error; square brackets in names and notes are no markup."""
    from rich.console import Console

    stream = stream or sys.stderr
    width = None if stream.isatty() else UNBROKEN
    return Console(file=stream, width=width, highlight=False, markup=False, emoji=False)


def print_json(value: object) -> None:
    """One JSON document on standard output."""
    typer.echo(json.dumps(value, allow_nan=False, ensure_ascii=False))


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Sequence[str] = (),
    folding: Sequence[str] = (),
) -> None:
    """A table on standard output. Columns in `numbers` stand to the right, those in `folding` may break lines."""
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table(box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for column in columns:
        table.add_column(
            column,
            justify="right" if column in numbers else "left",
            no_wrap=column not in folding,
            overflow="fold",
        )
    for row in rows:
        table.add_row(*row)
    shown = console(sys.stdout)
    shown.print(title)
    shown.print(table)


def print_notes(notes: Iterable[str | Flag]) -> None:
    """Notes on standard error; a flag as its sentence."""
    for note in notes:
        console().print(f"note: {message(note) if isinstance(note, Flag) else note}")


@contextmanager
def progress(shown: Console) -> Iterator[Callable[[int, int], None]]:
    """A bar with the time left; gives a function of (finished, all)."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=shown) as bar:
        task = bar.add_task("folds", total=None)

        def advance(finished: int, total: int) -> None:
            bar.update(task, completed=finished, total=total)

        yield advance
