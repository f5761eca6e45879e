"""Public sets of logs that have a reader of their own: columns of their files, from `public.toml`, and files of a folder."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence, Sized
from functools import cache
from pathlib import Path
from typing import TypeVar

from tripwatt.arrays import FloatArray, by_key
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.files import shipped_toml
from tripwatt.sources.columnar import CsvTable, csv_table, read_all
from tripwatt.sources.delimited import Delimited, column_key, open_delimited
from tripwatt.sources.mapping import UNITS
from tripwatt.trips.reading import FileReading

Rows = TypeVar("Rows", bound=Sized)


@cache
def raw_columns(dataset: str) -> Mapping[str, tuple[str, float]]:
    """Columns of a public data set that has its own reader, from `public.toml`: name in the files -> our name, factor to our unit and sign.

    Examples
    --------
    >>> raw_columns("ved")["HV Battery Voltage[V]"]
    ('voltage_v', 1.0)
    """
    return {
        name: (about["ours"], about.get("sign", 1.0) * UNITS[about["ours"]][about["unit"]][0])
        for name, about in shipped_toml("sources/public.toml")[dataset]["columns"].items()
    }


def read_public(
    path: Path, dataset: str, needed: Collection[str], faults: list[Fault], unscaled: Sequence[str] = ()
) -> tuple[CsvTable, dict[str, FloatArray]]:
    """Read the columns of one file of a data set in our units; return the table as well, whose rows have lines in the file.

    Parameters
    ----------
    path : Path
    dataset : str
    needed : collection of str
        Names of ours, or of `unscaled`, without which a file is refused.
    faults : list of Fault
        Cells and rows that cannot be read are appended to this list.
    unscaled : sequence of str
        Columns that are none of ours, which keep their name and their numbers.

    Raises
    ------
    InvalidInput
        When the file cannot be read, or a column is missing or there twice.
    """
    source = open_delimited(path)
    columns = _columns_of(source, {n: (n, 1.0) for n in unscaled} | {**raw_columns(dataset)}, needed)
    table = csv_table(source, faults)
    numbers = table.numbers([name for name, _ in columns.values()])
    return table, {
        ours: values if factor == 1.0 else values * factor
        for (ours, (_, factor)), values in zip(columns.items(), numbers, strict=True)
    }


def _columns_of(
    source: Delimited, columns: Mapping[str, tuple[str, float]], needed: Collection[str]
) -> dict[str, tuple[str, float]]:
    """Our name -> name in the header of a file, factor; for each of ours the first of `columns` that is in the header."""
    positions = by_key(range(len(source.names)), lambda position: column_key(source.names[position]))
    chosen: dict[str, tuple[str, float]] = {}
    faults: list[Fault] = []
    place = f"{source.path} row {source.header_line}"
    for name, (ours, factor) in columns.items():
        places = positions.get(column_key(name), [])
        if not places or ours in chosen:
            continue
        chosen[ours] = source.names[places[0]], factor
        if len(places) > 1:
            where, got = f"{place} column {name!r}", f"columns {', '.join(str(k + 1) for k in places)}"
            faults.append(Fault("duplicate column", where, got, "one column of that name"))
    shown = ", ".join(repr(name[:40]) for name in source.names[:6]) + " ..." * (len(source.names) > 6)
    fix = "give a file with ';' or ',' between columns" if len(source.names) < 4 else ""
    for ours in needed:
        if ours not in chosen:
            names = " or ".join(repr(name) for name, (its, _) in columns.items() if its == ours)
            got = f"{len(source.names)} columns: {shown}"
            faults.append(Fault("missing column", place, got, f"a column {names}", fix))
    raise_faults(faults)
    return chosen


def read_folder(
    read: Callable[[str, Path, list[Fault]], Rows],
    files: Mapping[str, Path],
    *,
    strict: bool,
    faults: Iterable[Fault] = (),
) -> tuple[dict[str, Rows], list[FileReading]]:
    """Read files in several threads; return the result of each file that could be read, and a summary of every file.

    Parameters
    ----------
    read : callable
        Takes the name of a file, its path, and a list to which it appends faults.
    files : mapping of str to path
    strict : bool
        Raise every fault of all files.
    faults : iterable of Fault
        Further faults to raise together with those of the files.

    Raises
    ------
    InvalidInput
        When no file can be read, or when there is a fault and `strict` is True.
    """
    by_file: dict[str, list[Fault]] = {name: [] for name in files}

    def read_one(name: str) -> Rows | None:
        try:
            return read(name, files[name], by_file[name])
        except InvalidInput as error:
            by_file[name] += error.faults
            return None

    results = dict(zip(files, read_all(read_one, files), strict=True))
    used = {name: rows for name, rows in results.items() if rows is not None}
    if strict or not used:
        raise_faults([*faults, *itertools.chain(*by_file.values())])
    rows = {name: len(used.get(name, ())) for name in files}
    readings = [
        FileReading(path.name, rows[name], rows[name], int(name in used), tuple(by_file[name]))
        for name, path in files.items()
    ]
    return used, readings


def require_folder(folder: Path, allowed: str, fix: str) -> None:
    """Raise `InvalidInput` if a path is not a folder; `allowed` and `fix` are texts of the fault."""
    if not folder.is_dir():
        what, got = ("not a folder", "a file") if folder.exists() else ("no such folder", "")
        raise InvalidInput.of(what, f"{folder}", got, allowed, fix)
