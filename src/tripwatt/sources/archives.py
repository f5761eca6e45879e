"""Logs as people keep them: archives of many files, and workbooks, unpacked into tables that readers read."""

from __future__ import annotations

import csv
import datetime as dt
import io
import itertools
import lzma
import re
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any, Final, TypeVar

from tripwatt.errors import Fault, InvalidInput
from tripwatt.files import MOST_CONTENT_BYTES, read_file, require_small_content, write_new
from tripwatt.sources.columnar import MOST_ROWS, SUFFIXES
from tripwatt.sources.delimited import MOST_COLUMNS

T = TypeVar("T")

ARCHIVE: Final = ".zip"
WORKBOOK: Final = ".xlsx"
MOST_FILES: Final = 2000
"""Most tables of an archive."""

MOST_SHEETS: Final = 50
LEAST_NAMES: Final = 2
"""Texts that make a row of a sheet its header."""

MOST_LEADING_ROWS: Final = 50
"""Rows above the header of a sheet."""

LONGEST_STEM: Final = 60

DAMAGED: Final = (zipfile.BadZipFile, zlib.error, lzma.LZMAError)
"""What reading a damaged archive raises beside errors of files and values."""


def is_packed(path: Path | str) -> bool:
    """Whether a file has to be unpacked before a reader of tables can read it, by its suffix.

    Examples
    --------
    >>> is_packed("logs.zip"), is_packed("drive.csv")
    (True, False)
    """
    return Path(path).suffix.lower() in (ARCHIVE, WORKBOOK)


def unpack(path: Path | str, folder: Path, *, content: bytes | None = None) -> list[Path]:
    """Write the tables of a file into a folder: its own, those of an archive, the sheets of a workbook as CSV.

    Members of an archive that are no tables are left out. O(bytes).

    Parameters
    ----------
    path : path
        Its suffix is its format.
    folder : Path
        An existing folder. Names that are taken get a number.
    content : bytes, optional
        Of the file; it is read when not given.

    Returns
    -------
    list of Path
        The tables, in the order of the archive.

    Raises
    ------
    InvalidInput
        When it holds no table, is damaged, or holds more than `MOST_FILES` tables or 256 MiB.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [made.name for made in unpack("a drive.csv", Path(folder), content=b"time_s,speed_m_s")]
    ['a drive.csv']
    """
    place = Path(path)
    data = read_file(place) if content is None else content
    kind = place.suffix.lower()
    tables: list[Path] = []
    before = set(folder.iterdir())
    try:
        for name, table in _tables(kind, place, data):
            tables.append(_written(folder, name, table))
    except BaseException:  # a damaged archive or a full disk leaves nothing
        for made in set(tables) - before:
            made.unlink(missing_ok=True)
        raise
    if not tables:
        allowed = f"a file {', '.join((*SUFFIXES, WORKBOOK))}, or an archive {ARCHIVE} of them"
        raise InvalidInput.of("no trips", f"{place}", f"no table in {place.name}", allowed)
    return tables


@contextmanager
def unpacked(path: Path | str, faults: list[Fault] | None = None) -> Iterator[Path]:
    """A path that readers of tables read: the file or folder itself, or a temporary folder with its unpacked tables.

    Parameters
    ----------
    path : path
    faults : list, optional
        Takes those of files that cannot be unpacked; without it, they are refused.

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
        for file in packed:
            if not file.is_file() or not (is_packed(file) or file.suffix.lower() in SUFFIXES):
                continue
            try:
                unpack(file, Path(folder))
            except InvalidInput as error:
                if faults is None:
                    raise
                faults += error.faults
        yield Path(folder)


def _tables(kind: str, place: Path, data: bytes) -> Iterator[tuple[str, bytes]]:
    """Names and contents."""
    if kind == ARCHIVE:
        yield from _from_archive(place, data)
    elif kind == WORKBOOK:
        yield from _from_workbook(place, data)
    elif kind in SUFFIXES:
        yield place.name, data


def safe_name(name: str, suffix: str) -> str:
    """The last part of a name as a name of a file: letters, digits, blanks and ``._-+()``, with a suffix.

    Examples
    --------
    >>> safe_name("../../etc/my drive?.CSV", ".csv"), safe_name("...", ".csv")
    ('my drive_.csv', 'table.csv')
    """
    stem = _last_part(name)
    if stem.lower().endswith(suffix):
        stem = stem[: -len(suffix)]
    stem = re.sub(r"[^\w .+()-]", "_", stem)[:LONGEST_STEM].strip(" .")
    return f"{stem or 'table'}{suffix}"


def _last_part(name: str) -> str:
    return PurePosixPath(name.replace("\\", "/")).name


def _written(folder: Path, name: str, data: bytes) -> Path:
    """The file of a table, written under a name that is free; one with the same content is there already: it was sent again."""
    suffix = PurePosixPath(name).suffix.lower()
    wanted = folder / safe_name(name, suffix)
    place, number = wanted, 1
    while True:
        try:
            write_new(place, data)  # a file of the same name may be written at the same moment
        except FileExistsError:
            if place.is_file() and place.read_bytes() == data:
                return place
            number += 1
            place = wanted.with_name(f"{wanted.stem} {number}{suffix}")
        else:
            return place


def _is_table(name: str) -> bool:
    is_hidden = _last_part(name).startswith((".", "~")) or "__MACOSX" in name
    return not is_hidden and PurePosixPath(name).suffix.lower() in (*SUFFIXES, WORKBOOK)


def _from_archive(place: Path, data: bytes) -> Iterator[tuple[str, bytes]]:
    try:
        archive = require_small_content(io.BytesIO(data), f"{place}")
        tables = [entry for entry in archive.infolist() if _is_table(entry.filename)]
        if len(tables) > MOST_FILES:
            got = f"{len(tables)} tables"
            raise InvalidInput.of("too many files", f"{place}", got, f"at most {MOST_FILES}")
        for entry in tables:
            member = archive.read(entry)
            if entry.filename.lower().endswith(WORKBOOK):
                yield from _from_workbook(Path(entry.filename), member)
            else:
                yield entry.filename, member
    except (*DAMAGED, NotImplementedError, RuntimeError, EOFError, OSError, ValueError) as error:
        allowed = "a ZIP archive without a password"
        raise InvalidInput.of("unreadable archive", f"{place}", f"{error}"[:160], allowed) from error


def read_workbook(
    data: bytes, where: str, read: Callable[[Any], T], *, most_bytes: int = MOST_CONTENT_BYTES, fix: str = ""
) -> list[tuple[str, T]]:
    """Title of each of the first sheets of a workbook, and what a function reads of the sheet.

    Raises
    ------
    InvalidInput
        When it is no workbook, or holds more than so many bytes when it is inflated.
    """
    import openpyxl

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about styles and extensions, which are not read
            stream = io.BytesIO(data)
            require_small_content(stream, where, most_bytes)
            book = openpyxl.load_workbook(stream, data_only=True, read_only=True)
            return [(sheet.title, read(sheet)) for sheet in book.worksheets[:MOST_SHEETS]]
    except InvalidInput:
        raise
    except Exception as error:  # openpyxl documents no error types: a damaged archive raises a dozen kinds
        got = f"{type(error).__name__}: {error}"[:160]
        raise InvalidInput.of("unreadable sheet", where, got, "an .xlsx workbook", fix) from error


def _from_workbook(place: Path, data: bytes) -> Iterator[tuple[str, bytes]]:
    sheets = read_workbook(data, f"{place}", _table_of)
    tables = [(title, table) for title, table in sheets if len(table) > 1]
    for title, table in tables:
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(table)
        stem = place.stem if len(tables) == 1 else f"{place.stem} {title}"
        yield f"{stem}.csv", text.getvalue().encode("utf-8")


def _table_of(sheet: Any) -> list[list[str]]:
    """Rows of a sheet as texts from its header on, cut to the columns that the header names."""
    rows = sheet.iter_rows(values_only=True, max_col=MOST_COLUMNS, max_row=MOST_ROWS)
    head = [row for row in itertools.islice(rows, MOST_LEADING_ROWS) if any(cell is not None for cell in row)]
    for k, row in enumerate(head):
        names, below = _names_in(row), _names_in(head[k + 1]) if k + 1 < len(head) else 0
        if names >= LEAST_NAMES and below <= names:  # a title has fewer cells than the header below it
            width = max(i + 1 for i, cell in enumerate(row) if cell is not None)
            filled = (row for row in rows if any(cell is not None for cell in row))
            return [[_text(cell) for cell in row[:width]] for row in itertools.chain(head[k:], filled)]
    return []


def _names_in(row: Sequence[Any]) -> int:
    return sum(isinstance(cell, str) and bool(cell.strip()) for cell in row)


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    return cell.isoformat() if isinstance(cell, dt.date | dt.time) else f"{cell}"
