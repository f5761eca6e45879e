"""Archives and workbooks of logs, unpacked into tables that the readers accept."""

from __future__ import annotations

import csv
import datetime as dt
import filecmp
import itertools
import re
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any, Final

from tripwatt.containers import CELLS, LIMITS, TABLES, Budget, open_archive
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.files import move_new, read_file
from tripwatt.sources.columnar import PARQUET, SUFFIXES, require_small_columns
from tripwatt.sources.delimited import MAX_COLUMNS
from tripwatt.sources.workbooks import read_workbook

ARCHIVE: Final = ".zip"
WORKBOOK: Final = ".xlsx"
MAX_FILES: Final = 2000
"""Largest number of tables in an archive."""


DAMAGED: Final = (zipfile.BadZipFile, zlib.error)
"""Errors that a damaged archive raises, besides those of files and values."""


def is_packed(path: Path | str) -> bool:
    """Whether the suffix of a file says that it must be unpacked before its tables can be read.

    Examples
    --------
    >>> is_packed("logs.zip"), is_packed("drive.csv")
    (True, False)
    """
    return Path(path).suffix.lower() in (ARCHIVE, WORKBOOK)


def unpack(
    path: Path | str, folder: Path, *, content: bytes | None = None, limits: Mapping[str, int] = LIMITS
) -> list[Path]:
    """Write the tables of a file into a folder: the file itself, the tables of an archive, or the sheets of a workbook as CSV.

    Files in an archive that are not tables are left out. O(bytes).

    Parameters
    ----------
    path : path
        The file; its suffix says its format.
    folder : Path
        An existing folder. A name that is taken gets a number.
    content : bytes, optional
        Content of the file; by default the file is read.
    limits : mapping of str to int
        Limits of the unpacked content, see `Budget`.

    Returns
    -------
    list of Path
        The tables, in the order of the archive.

    Raises
    ------
    InvalidInput
        When the file holds no table, is damaged, or exceeds `MAX_FILES` tables or the limits.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [made.name for made in unpack("a drive.csv", Path(folder), content=b"time_s,speed_m_s")]
    ['a drive.csv']
    """
    place = Path(path)
    data = read_file(place) if content is None else content
    budget = Budget(f"{place}", limits)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as unpacked_folder:
        tables = list(_tables(place, data, Path(unpacked_folder), budget))
        if not tables:
            allowed = f"a file {', '.join((*SUFFIXES, WORKBOOK))}, or an archive {ARCHIVE} of them"
            raise InvalidInput.of("no trips", f"{place}", f"no table in {place.name}", allowed)
        return [_kept(table, folder) for table in tables]


@contextmanager
def unpacked(path: Path | str, faults: list[Fault]) -> Iterator[Path]:
    """Give a path that can be read as tables: the path itself, or a temporary folder with the unpacked tables.

    Parameters
    ----------
    path : path
    faults : list, optional
        Faults of files that cannot be unpacked are appended to this list; by default they are raised.

    Yields
    ------
    Path

    Raises
    ------
    InvalidInput
        As `unpack`.
    """
    place = Path(path)
    packed = [place] if place.is_file() else sorted(place.iterdir()) if place.is_dir() else []
    if not any(is_packed(file) for file in packed):
        yield place
        return
    with tempfile.TemporaryDirectory() as folder:
        for file in (f for f in packed if f.is_file() and (is_packed(f) or f.suffix.lower() in SUFFIXES)):
            try:
                unpack(file, Path(folder))
            except InvalidInput as error:
                faults += error.faults
        raise_faults(() if any(Path(folder).iterdir()) else faults)
        yield Path(folder)


def _tables(place: Path, data: bytes, folder: Path, budget: Budget) -> Iterator[Path]:
    kind = place.suffix.lower()
    if kind == ARCHIVE:
        for name, member in _members(place, data, budget):
            yield from _tables(Path(name), member, folder, budget)
    elif kind == WORKBOOK:
        yield from _from_workbook(place, data, folder, budget)
    elif kind in SUFFIXES:
        table = _free(folder, place.name)
        table.write_bytes(data)
        if kind == PARQUET:
            require_small_columns(table)
        yield table


def safe_name(name: str, suffix: str) -> str:
    """Make a file name from the last part of a path: letters, digits, blanks and ``._-+()``, with a suffix.

    Examples
    --------
    >>> safe_name("../../etc/my drive?.CSV", ".csv"), safe_name("...", ".csv")
    ('my drive_.csv', 'table.csv')
    """
    stem = _last_part(name)
    if stem.lower().endswith(suffix):
        stem = stem[: -len(suffix)]
    # 160: with number and suffix, and while it is written, below the 255 bytes of a name
    stem = re.sub(r"[^\w .+()-]", "_", stem).encode()[:160].decode(errors="ignore").strip(" .")
    return f"{stem or 'table'}{suffix}"


def _last_part(name: str) -> str:
    return PurePosixPath(name.replace("\\", "/")).name


def _free(folder: Path, name: str) -> Path:
    """A path in a folder that is not taken, with a safe name."""
    wanted = folder / safe_name(name, PurePosixPath(name).suffix.lower())
    return next(place for place in _names(wanted) if not place.exists())


def _kept(table: Path, folder: Path) -> Path:
    """Move a table into a folder under a free name, and return its path.

    If a file of the same name and content exists, such as after a second upload, the path of that file is returned.
    """
    for place in _names(folder / table.name):
        try:
            move_new(table, place)  # a file of the same name may be written at the same moment
        except FileExistsError:
            if not (place.is_file() and filecmp.cmp(table, place, shallow=False)):
                continue
        return place
    raise AssertionError


def _names(wanted: Path) -> Iterator[Path]:
    """Yield a name, then the same name with the numbers 2, 3 and so on."""
    yield wanted
    yield from (wanted.with_name(f"{wanted.stem} {n}{wanted.suffix}") for n in itertools.count(2))


def _is_table(name: str) -> bool:
    is_hidden = _last_part(name).startswith((".", "~")) or "__MACOSX" in name
    return not is_hidden and PurePosixPath(name).suffix.lower() in (*SUFFIXES, WORKBOOK)


def _members(place: Path, data: bytes, budget: Budget) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of each table in an archive."""
    try:
        archive = open_archive(data, budget)
        tables = [entry for entry in archive.infolist() if _is_table(entry.filename)]
        if len(tables) > MAX_FILES:
            got = f"{len(tables)} tables"
            raise InvalidInput.of("too many files", f"{place}", got, f"at most {MAX_FILES}")
        for entry in tables:
            budget.take(TABLES, 0 if entry.filename.lower().endswith(WORKBOOK) else entry.file_size)
            yield entry.filename, archive.open(entry).read(entry.file_size + 1)
    except (*DAMAGED, NotImplementedError, RuntimeError, EOFError, OSError, ValueError) as error:
        allowed = "a ZIP archive without a password"
        raise InvalidInput.of("unreadable archive", f"{place}", f"{error}"[:160], allowed) from error


def _from_workbook(place: Path, data: bytes, folder: Path, budget: Budget) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir=folder) as sheets:
        read = read_workbook(data, lambda rows: _write_table(rows, Path(sheets), budget), budget)
        tables = [(title, table) for title, (count, table) in read if count > 1]
        for title, table in tables:
            stem = place.stem if len(tables) == 1 else f"{place.stem} {title}"
            yield table.rename(_free(folder, f"{stem}.csv"))


def _write_table(rows: Iterator[list[Any]], folder: Path, budget: Budget) -> tuple[int, Path]:
    """Write the rows of a sheet as CSV from the header on, cut to the width of the header; return the number of rows, and the file."""
    # 50: number of first rows of a sheet in which the header is searched
    head = list(itertools.islice(filter(_is_filled, rows), 50))
    target, count = folder / f"{len(list(folder.iterdir()))}", 0
    for k, row in enumerate(head):
        names, below = _names_in(row), _names_in(head[k + 1]) if k + 1 < len(head) else 0
        # 2: least number of texts in the header row of a sheet
        if names >= 2 and below <= names:  # a title has fewer cells than the header below it
            width = min(max(i + 1 for i, cell in enumerate(row) if cell is not None), MAX_COLUMNS)
            with target.open("w", encoding="utf-8", newline="") as text:
                writer = csv.writer(text, lineterminator="\n")
                for row in itertools.chain(head[k:], filter(_is_filled, rows)):
                    budget.take(CELLS, max(width - len(row), 0))
                    cells = [_text(cell) for cell in row[:width]] + [""] * (width - len(row))
                    budget.take(TABLES, sum(map(len, cells)) + width)
                    writer.writerow(cells)
                    count += 1
            break
    return count, target


def _is_filled(row: Sequence[Any]) -> bool:
    return any(cell is not None for cell in row)


def _names_in(row: Sequence[Any]) -> int:
    return sum(isinstance(cell, str) and bool(cell.strip()) for cell in row)


def _text(cell: Any) -> str:
    text = cell.isoformat() if isinstance(cell, dt.date | dt.time) else cell
    return "" if cell is None else f"{text}"
