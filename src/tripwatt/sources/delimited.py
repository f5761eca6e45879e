"""Numbers out of a delimited text file: only the wanted columns, and every fault of the file with row and column.

The fast path is Arrow's reader with the column types fixed to numbers. Only when it fails is the file read a second
time, line by line, to find every fault that a user has to mend.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, and_more
from tripwatt.files import read_file
from tripwatt.trips.headers import DELIMITERS

LARGEST_NUMBER: Final = 1e15
"""No measurement in any unit is larger; time stamps in milliseconds since 1970 are about 2e12."""
MOST_HEADER_BYTES: Final = 1_000_000
"""Longest header."""
MOST_COLUMNS: Final = 10_000
"""Most columns; loggers write up to some hundreds."""
SHOWN_ROWS: Final = 5
"""Rows named for one kind of fault in one column; the others are counted."""
NULL_TEXTS: Final = ("", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None", "-nan", "#N/A", "-")
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d+,\d+")


@dataclass(frozen=True, slots=True)
class RawColumn:
    """A column of a data set's files: its name there, our name, and the factor to our unit and sign."""

    name: str
    ours: str
    factor: float


@dataclass(frozen=True, slots=True)
class Delimited:
    """A delimited file, its header understood and its body not yet parsed.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Header cells as written, without byte order mark, quotes and outer blanks.
    delimiter : str
    data : bytes
        The whole file in an encoding that keeps ASCII.
    body_offset : int
        Where the line after the header starts in `data`.
    header_line : int
        1-based line of the header.
    """

    path: Path
    names: tuple[str, ...]
    delimiter: str
    data: bytes
    body_offset: int
    header_line: int

    def where(self, line: int, column: str) -> str:
        """Place of a cell, as the user sees it in an editor."""
        return f"{self.path} row {line} column {column!r}"


def column_key(name: str) -> str:
    """A header cell without everything that differs between copies of one data set.

    Case, outer and repeated blanks, characters outside ASCII (a degree sign in the wrong encoding, or the question
    mark that replaced it) and damaged closing brackets go.

    Examples
    --------
    >>> column_key("Velocity [km/h]]] "), column_key("max. SoC [%)"), column_key("Ambient Temperature [Â°C]")
    ('velocity [km/h]', 'max. soc [%]', 'ambient temperature [c]')
    """
    ascii_only = name.encode("ascii", "ignore").decode().replace("?", "").casefold()
    blanks = " ".join(ascii_only.split())
    opened = re.sub(r"[\])]+$", "]", blanks) if "[" in blanks else blanks
    return opened.replace("[ ", "[")


def open_delimited(path: Path, content: bytes | None = None) -> Delimited:
    """Read a file and understand its header.

    Parameters
    ----------
    path : path
    content : bytes, optional
        What is in the file; `path` is then only its name for messages, and no file is read.

    Raises
    ------
    InvalidInput
        When there is no such file, or it is empty, not text, or has no rows below its header.
    """
    data = _text_bytes(path, read_file(path) if content is None else content)
    offset, line = 0, 1
    while data[offset : offset + 1] in (b"\r", b"\n"):  # blank lines above the header
        line += data[offset : offset + 1] == b"\n"
        offset += 1
    end = data.find(b"\n", offset)
    header = data[offset : end if end >= 0 else len(data)]
    if len(header) > MOST_HEADER_BYTES:
        got = f"a first line of {len(header)} bytes"
        raise InvalidInput.of("header too long", f"{path}", got, f"at most {MOST_HEADER_BYTES} bytes")
    text = _decode(header).strip("\r\n")
    delimiter = max(DELIMITERS, key=text.count)
    if text.count(delimiter) >= MOST_COLUMNS:
        got = f"{text.count(delimiter) + 1} columns"
        raise InvalidInput.of("too many columns", f"{path}", got, f"at most {MOST_COLUMNS}")
    cells = tuple(cell.strip() for cell in _fields(text, delimiter))
    if end < 0 or not data[end:].strip():
        raise InvalidInput.of(
            "no samples", f"{path}", f"a header of {len(cells)} columns without rows below", "rows"
        )
    data = data[: end + 1] + _without_headers(data[end + 1 :], header.strip(b"\r"), delimiter)
    return Delimited(path, cells, delimiter, data, end + 1, line)


def _without_headers(body: bytes, header: bytes, delimiter: str) -> bytes:
    """The body with empty rows in place of repeated headers, which loggers write at each start; rows keep their numbers."""
    if header not in body:
        return body
    empty = delimiter.encode() * header.count(delimiter.encode())
    return b"\n".join(empty if row.strip(b"\r") == header else row for row in body.split(b"\n"))


def _text_bytes(path: Path, data: bytes) -> bytes:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeDecodeError as error:
            raise InvalidInput(_not_text(path, "damaged UTF-16")) from error
    data = data.removeprefix(b"\xef\xbb\xbf")
    if not data.strip():
        raise InvalidInput.of(
            "empty file", f"{path}", f"{len(data)} bytes", "a header and rows", "fetch the file again"
        )
    if b"\0" in data[:65536]:
        raise InvalidInput(_not_text(path, "zero bytes"))
    return data if b"\n" in data else data.replace(b"\r", b"\n")


def _not_text(path: Path, got: str) -> Fault:
    return Fault("not a text file", f"{path}", got, "a CSV file in UTF-8 or latin-1", "fetch the file again")


def _decode(raw: bytes) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _fields(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # a stray carriage return or an unbalanced quote in a damaged line
        return line.split(delimiter)


def read_texts(source: Delimited, wanted: Sequence[int]) -> list[list[str]]:
    """The columns at the given positions of the header, as text without outer blanks. O(bytes).

    Raises
    ------
    InvalidInput
        With every row of the wrong length.
    """
    try:
        table = _parsed(source, wanted, pa.binary(), strings_can_be_null=False)
    except _UNREADABLE as error:
        raise InvalidInput(_body_faults(source, (), _reason(error))) from error
    return [[_decode(cell).strip() for cell in column.to_pylist()] for column in table]


def read_numbers(source: Delimited, wanted: Sequence[int], decimal: str = ".") -> list[FloatArray]:
    """The columns at the given positions of the header, as float64; empty cells are NaN. O(bytes).

    Raises
    ------
    InvalidInput
        With every row of the wrong length and every cell that is not a number.
    """
    reason = ""
    nulls = {"null_values": list(NULL_TEXTS), "quoted_strings_can_be_null": True}
    try:
        table = _parsed(source, wanted, pa.float64(), **nulls, decimal_point=decimal)
        columns = [np.asarray(column.to_numpy(), dtype=np.float64) for column in table]
        sound = all(np.nanmax(np.abs(values), initial=0.0) <= LARGEST_NUMBER for values in columns)
    except _UNREADABLE as error:
        sound, reason = False, _reason(error)
    if not sound:
        raise InvalidInput(_body_faults(source, wanted, reason, decimal))
    return columns


_UNREADABLE: Final = (pa.ArrowInvalid, pa.ArrowKeyError, UnicodeDecodeError)
"""What Arrow raises for a damaged row; the last where its message quotes the row."""


def _reason(error: Exception) -> str:
    return str(error).splitlines()[0][:200]


def _parsed(source: Delimited, wanted: Sequence[int], kind: Any, **options: Any) -> list[Any]:
    """The columns at the given positions as Arrow's arrays, all of one type."""
    names = [f"c{i}" for i in range(_body_width(source))]
    chosen = [f"c{i}" for i in wanted]
    table = pa_csv.read_csv(
        pa.BufferReader(memoryview(source.data)[source.body_offset :]),
        read_options=pa_csv.ReadOptions(column_names=names, use_threads=False, block_size=8 << 20),
        parse_options=pa_csv.ParseOptions(delimiter=source.delimiter),
        convert_options=pa_csv.ConvertOptions(
            include_columns=chosen, column_types=dict.fromkeys(chosen, kind), check_utf8=False, **options
        ),
    )
    return [table[name] for name in chosen]


def _body_width(source: Delimited) -> int:
    """Fields of a row: the header's, or one fewer or more where only one of them ends in a delimiter."""
    end = source.data.find(b"\n", source.body_offset)
    first = source.data[source.body_offset : end if end >= 0 else len(source.data)]
    row = _fields(_decode(first).strip("\r\n"), source.delimiter)
    header = len(source.names)
    if len(row) == header - 1 and not source.names[-1]:
        return header - 1
    if len(row) == header + 1 and not row[-1].strip():
        return header + 1
    return header


def _body_faults(
    source: Delimited, wanted: Sequence[int], reason: str, decimal: str = "."
) -> tuple[Fault, ...]:
    """Every fault below the header, line by line. O(bytes), only after the fast reader failed."""
    width = _body_width(source)
    lines = source.data[source.body_offset :].split(b"\n")
    first_line = source.header_line + 1
    bad_cells: dict[int, list[tuple[int, str]]] = {}
    bad_rows: list[tuple[int, int]] = []
    last = max((i for i, line in enumerate(lines) if line.strip()), default=-1)
    cut_off = last >= 0 and last == len(lines) - 1  # a whole file ends in a line break
    cut_fault: Fault | None = None
    for number, line in enumerate(lines, start=first_line):
        if not line.strip():
            continue
        text = _decode(line).strip("\r")
        cells = _fields(text, source.delimiter) if '"' in text else text.split(source.delimiter)
        if len(cells) != width:
            if cut_off and number - first_line == last and len(cells) < width:
                cut_fault = _cut_off_fault(source, number, len(cells), width, cells)
            else:
                bad_rows.append((number, len(cells)))
            continue
        for position in wanted:
            cell = cells[position].strip().strip('"').strip()
            value = _value(cell.replace(decimal, "."))
            if cell not in NULL_TEXTS and (value is None or not abs(value) <= LARGEST_NUMBER):
                bad_cells.setdefault(position, []).append((number, cell))
    faults = [*_row_faults(source, bad_rows, width), *_cell_faults(source, bad_cells)]
    if cut_fault:
        faults.append(cut_fault)
    return tuple(faults) or (Fault("not a readable CSV file", f"{source.path}", reason, "rows of numbers"),)


def _value(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _cut_off_fault(source: Delimited, line: int, got: int, width: int, cells: Sequence[str]) -> Fault:
    position = min(got - 1, len(source.names) - 1)
    return Fault(
        "truncated file",
        source.where(line, source.names[position]),
        f"the last line ends in {_excerpt(cells[-1])}, field {got} of {width}",
        f"{width} fields and a line break",
        "fetch the file again, or delete the last line to use the rest",
    )


def _row_faults(source: Delimited, rows: Sequence[tuple[int, int]], width: int) -> Iterator[Fault]:
    what = "wrong number of columns"
    for line, fields in rows[:SHOWN_ROWS]:
        comma = source.delimiter == "," and fields > width
        fix = (
            "export with a decimal point, or with ';' between columns" if comma else "mend or delete the row"
        )
        yield Fault(what, f"{source.path} row {line}", f"{fields}", f"{width}", fix)
    if len(rows) > SHOWN_ROWS:
        yield Fault(what, f"{source.path}", f"{len(rows) - SHOWN_ROWS} more rows", f"{width}")


def _cell_faults(source: Delimited, cells: dict[int, list[tuple[int, str]]]) -> Iterator[Fault]:
    """A fault for each cell while they are few, else the first of the column and how many more there are."""
    for position, bad in sorted(cells.items()):
        counted = len(bad) > SHOWN_ROWS
        for line, text in bad[:1] if counted else bad:
            what, allowed, fix = "not a number", "a number with a decimal point, or an empty cell", ""
            if _DECIMAL_COMMA.fullmatch(text):
                what, fix = "decimal comma", "export the file with a decimal point"
            elif _value(text) is not None:
                what, allowed = "number out of range", f"a finite number of at most {LARGEST_NUMBER:g}"
            got = _excerpt(text) + (and_more(bad) if counted else "")
            yield Fault(what, source.where(line, source.names[position]), got, allowed, fix)


def _excerpt(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
