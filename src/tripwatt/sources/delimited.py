"""Reader of delimited text files: only the wanted columns are read, and every fault is given with its row and column.

The fast path is Arrow's reader with the column types fixed to numbers. If it fails, or is not installed (the extra
`parquet`), the file is read line by line, which finds every fault that a user has to mend.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput, and_more, excerpt
from tripwatt.files import read_file, shipped_toml
from tripwatt.sources.mapping import UNITS
from tripwatt.trips.headers import DELIMITERS

LARGEST_NUMBER: Final = 1e15
"""Largest number accepted in any unit; time stamps in milliseconds since 1970 are about 2e12."""
MAX_HEADER_BYTES: Final = 1_000_000
"""Longest header [bytes]."""
MAX_COLUMNS: Final = 10_000
"""Largest number of columns; loggers write up to some hundreds."""
MAX_TITLE_LINES: Final = 50
"""Number of first lines in which the header is searched."""
MAX_SECTIONS: Final = 2000
"""Largest number of further headers in one file."""
MAX_CUT_SHARE: Final = 0.05
"""If more than this share of the rows has the same number of cells, below that of the header, the logger leaves out empty cells at
the end; rarer short rows were cut off."""
SHOWN_ROWS: Final = 5
"""Number of rows listed for one kind of fault in one column; the others are counted."""
NULL_TEXTS: Final = ("", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None", "-nan", "#N/A", "-")
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d+,\d+")
_UNITS: Final = frozenset().union(*UNITS.values())
_VALUE: Final = re.compile(r"[-+]?[.,]?\d[-+\d.,:/ eETZ]*")
"""Form of a cell that is a value and not the name of a column: a number, a date, a time."""


@dataclass(frozen=True, slots=True)
class RawColumn:
    """A column of a data set: its name in the files, our name, and the factor to our unit and sign."""

    name: str
    ours: str
    factor: float


@cache
def raw_columns(dataset: str) -> tuple[RawColumn, ...]:
    """Columns of a public data set that has its own reader, from `public.toml`.

    Examples
    --------
    >>> raw_columns("ved")[3]
    RawColumn(name='HV Battery Voltage[V]', ours='voltage_v', factor=1.0)
    """
    return tuple(
        RawColumn(name, about["ours"], about.get("sign", 1.0) * UNITS[about["ours"]][about["unit"]][0])
        for name, about in shipped_toml("sources/public.toml")[dataset]["columns"].items()
    )


@dataclass(frozen=True, slots=True)
class Delimited:
    """A delimited file whose header is parsed and whose body is not.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Header cells without byte order mark, quotes and outer blanks.
    delimiter : str
    data : bytes
        The content of the file in an encoding that contains ASCII.
    body_offset : int
        Where the line after the header starts in `data`.
    header_line : int
        1-based line of the header, or of the line of units below the header; one less than the first row's if there is no header.
    units : tuple of str
        Units of the columns, from a line below the header.
    """

    path: Path
    names: tuple[str, ...]
    delimiter: str
    data: bytes
    body_offset: int
    header_line: int
    units: tuple[str, ...] = ()

    def where(self, line: int, column: str) -> str:
        """Place of a cell for messages, with its line as an editor shows it."""
        return f"{self.path} row {line} column {column!r}"


def column_key(name: str) -> str:
    """A header cell in a form that is the same in all copies of a data set.

    Lower case without outer and repeated blanks, without characters outside ASCII (a degree sign in the wrong encoding) and
    the question marks that replaced them, and with damaged closing brackets mended.

    Examples
    --------
    >>> column_key("Velocity [km/h]]] "), column_key("max. SoC [%)"), column_key("Ambient Temperature [Â°C]")
    ('velocity [km/h]', 'max. soc [%]', 'ambient temperature [c]')
    """
    ascii_only = name.encode("ascii", "ignore").decode().replace("?", "").casefold()
    blanks = " ".join(ascii_only.split())
    opened = re.sub(r"[\])]+$", "]", blanks) if "[" in blanks else blanks
    return opened.replace("[ ", "[")


def open_delimited(path: Path, content: bytes | None = None, names: Sequence[str] = ()) -> Delimited:
    """Read a file and parse its header, which may be below a title.

    Parameters
    ----------
    path : path
    content : bytes, optional
        Content of the file; no file is then read, and `path` is only its name for messages.
    names : sequence of str
        Header to use if the file has none, such as that of the file before it.

    Raises
    ------
    InvalidInput
        When the file does not exist, is empty, is not text, or has no header or no rows below it.
    """
    data = _text_bytes(path, read_file(path) if content is None else content)
    offset, line, delimiter, own = _header(path, data)
    if own is None:
        if not names:
            got = f"a first line of values: {excerpt(decode(data[offset : offset + 40]))}"
            fix = "add the header of the other files"
            raise InvalidInput.of("no header", f"{path}", got, "names of columns in the first line", fix)
        return Delimited(path, tuple(names), delimiter, data, offset, line - 1)
    end = data.find(b"\n", offset)
    if end < 0 or not data[end:].strip():
        raise InvalidInput.of(
            "no samples", f"{path}", f"a header of {len(own)} columns without rows below", "rows"
        )
    data = data[: end + 1] + _without_headers(data[end + 1 :], data[offset:end].strip(b"\r"), delimiter)
    units = tuple(c.strip() for c in fields_of(decode(data[end + 1 :].partition(b"\n")[0]), delimiter))
    if (
        len(units) <= len(own)
        and sum(unit.lower() in _UNITS for unit in units) > 1
        and not _has_values(units)
    ):
        return Delimited(path, own, delimiter, data, data.find(b"\n", end + 1) + 1, line + 1, units)
    return Delimited(path, own, delimiter, data, end + 1, line)


def _header(path: Path, data: bytes) -> tuple[int, int, str, tuple[str, ...] | None]:
    """Offset, 1-based line, delimiter and cells of the header; the cells are None if the line has values instead of names.

    A title is a line with fewer cells than the header below it. A line `sep=;` states the delimiter for spreadsheets.
    """
    offset, stated = 0, ""
    head: list[tuple[int, int, str]] = []
    lines = data[: 2 * MAX_HEADER_BYTES].split(b"\n", MAX_TITLE_LINES)[:MAX_TITLE_LINES]
    for line, raw in enumerate(lines, start=1):
        if len(raw) > MAX_HEADER_BYTES:
            got = f"a first line of {len(raw)} bytes"
            raise InvalidInput.of("header too long", f"{path}", got, f"at most {MAX_HEADER_BYTES} bytes")
        text = decode(raw).strip("\r\n")
        if text.lower().startswith("sep=") and len(text) == len("sep=") + 1:
            stated = text[-1]
        elif text.strip() and len(head) < MAX_TITLE_LINES:
            head.append((offset, line, text))
        offset += len(raw) + 1
    for (offset, line, text), (_, _, below) in zip(head, [*head[1:], head[-1]], strict=True):
        delimiter = stated or max(DELIMITERS, key=text.count)
        cells = tuple(cell.strip() for cell in fields_of(text, delimiter))
        if text.count(delimiter) >= MAX_COLUMNS:
            got = f"{text.count(delimiter) + 1} columns"
            raise InvalidInput.of("too many columns", f"{path}", got, f"at most {MAX_COLUMNS}")
        if len([cell for cell in cells if cell]) > 1 and not _is_title(cells, below, delimiter):
            return offset, line, delimiter, None if _has_values(cells) else cells
    offset, line, text = head[0]
    delimiter = stated or max(DELIMITERS, key=text.count)
    return offset, line, delimiter, tuple(cell.strip() for cell in fields_of(text, delimiter))


def _is_title(cells: Sequence[str], below: str, delimiter: str) -> bool:
    """Whether a line is a title above the header: the line below has more cells, with either delimiter, and no values."""
    longest = max(
        (fields_of(below, other) for other in {delimiter, max(DELIMITERS, key=below.count)}), key=len
    )
    is_header = not any(_VALUE.fullmatch(cell.strip()) for cell in longest)
    return is_header and len(longest) > len(cells)


def _has_values(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return 2 * sum(_VALUE.fullmatch(cell) is not None for cell in filled) >= len(filled)


def sections(source: Delimited) -> list[Delimited]:
    """Split a file at its headers: an app that was updated may write a new header in the middle. O(bytes).

    Raises
    ------
    InvalidInput
        When there are more than `MAX_SECTIONS` further headers.
    """
    names = {column_key(name) for name in source.names if name}
    starts = "|".join(re.escape(name) for name in source.names if name)
    begin = re.compile(
        rf"\n[\"' ]*(?:{starts})[\"' ]*{re.escape(source.delimiter)}[^\n]*".encode(), re.IGNORECASE
    )
    found = [
        (match, tuple(c.strip() for c in fields_of(decode(match[0]).strip("\r\n"), source.delimiter)))
        for match in (begin.finditer(source.data, max(source.body_offset - 1, 0)) if starts else ())
    ]
    found = [(m, cells) for m, cells in found if 2 * len(names & set(map(column_key, cells))) >= len(names)]
    if len(found) > MAX_SECTIONS:
        got = f"{len(found)} lines that are headers"
        raise InvalidInput.of("too many headers", f"{source.path}", got, f"at most {MAX_SECTIONS}")
    parts = [replace(source, data=source.data[: found[0][0].start() + 1])] if found else [source]
    line = source.header_line
    for k, (match, cells) in enumerate(found):
        end = found[k + 1][0].start() + 1 if k + 1 < len(found) else len(source.data)
        line += parts[-1].data.count(b"\n", parts[-1].body_offset) + 1
        body = source.data[match.end() + 1 : end]
        parts.append(replace(source, names=cells, data=body, body_offset=0, header_line=line))
    return [part for part in parts if part.data[part.body_offset :].strip()]


def even_rows(source: Delimited) -> tuple[Delimited, list[Fault]]:
    """Give every row as many cells as the header, and return the faults of the rows that were changed. O(bytes).

    Surplus cells on the right are removed. Cells that the logger left out at the end become empty cells. A row that was cut off
    in the middle becomes an empty row.

    Raises
    ------
    InvalidInput
        When every row has more cells than the header: it is unknown which cells belong to which column.
    """
    width, mark = _body_width(source), source.delimiter.encode()
    body = source.data[source.body_offset :]
    codes = np.frombuffer(body, np.uint8)
    starts = np.append(0, np.flatnonzero(codes[:-1] == ord("\n")) + 1)
    counts = np.add.reduceat((codes == ord(mark)).view(np.uint8), starts, dtype=np.int64) + 1
    quotes = np.add.reduceat((codes == ord('"')).view(np.uint8), starts, dtype=np.int64)
    odd = np.flatnonzero((counts != width) | (quotes > 0))  # a delimiter may be inside quotes
    if not len(odd):
        return source, []
    lines = body.split(b"\n")
    for i in odd[:-1].tolist():
        lines[i] = lines[i] if lines[i].strip() else line_of([""] * width, source.delimiter)
    fields = {
        int(i): fields_of(decode(lines[i]).strip("\r"), source.delimiter) for i in odd if lines[i].strip()
    }
    wrong = {i: cells for i, cells in fields.items() if len(cells) != width}
    short = Counter(len(cells) for cells in wrong.values() if len(cells) < width)
    usual = {n for n, count in short.items() if count > MAX_CUT_SHARE * len(lines)}
    last = max((i for i, line in enumerate(lines) if line.strip()), default=-1)
    is_cut = last == len(lines) - 1 and len(wrong.get(last, [])) not in (0, *usual)
    for i, cells in wrong.items():
        kept = cells[:width] if len(cells) > width else cells if len(cells) in usual else []
        lines[i] = line_of([*kept, *[""] * (width - len(kept))], source.delimiter)
    uneven = {i: len(cells) for i, cells in wrong.items() if any(cells[width:]) or len(cells) < width}
    is_cut &= uneven.get(last, width) < width
    faults = list(_row_faults(source, uneven, width, last if is_cut else -1))
    if is_cut:
        faults.append(_cut_off_fault(source, source.header_line + 1 + last, width, wrong[last]))
    if uneven and min(uneven.values()) > width and len(uneven) == sum(bool(line.strip()) for line in lines):
        raise InvalidInput(faults)
    return replace(source, data=b"\n".join(lines), body_offset=0), faults


def _without_headers(body: bytes, header: bytes, delimiter: str) -> bytes:
    """The body with empty rows in place of repeated headers, which loggers write at each start; row numbers do not change."""
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


def decode(raw: bytes) -> str:
    """Decode bytes as UTF-8, or as latin-1 if they are not UTF-8."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def fields_of(line: str, delimiter: str) -> list[str]:
    """Split a line into its cells."""
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # a stray carriage return or an unbalanced quote in a damaged line
        return line.split(delimiter)


def read_texts(source: Delimited, wanted: Sequence[int]) -> list[list[str]]:
    """Read the columns at the given positions of the header as texts without outer blanks. O(bytes).

    Raises
    ------
    InvalidInput
        With every row of the wrong length.
    """
    try:
        if find_spec("pyarrow") is None:
            return _texts_by_line(source, wanted)
        table = _parsed(source, wanted, "binary", strings_can_be_null=False)
    except _UNREADABLE as error:
        _, faults = even_rows(source)
        got = str(error).splitlines()[0][:200]
        unreadable = Fault("not a readable CSV file", f"{source.path}", got, "rows of cells")
        raise InvalidInput(faults or [unreadable]) from error
    return [[decode(cell).strip() for cell in column.to_pylist()] for column in table]


def read_numbers(
    source: Delimited, wanted: Sequence[int], decimal: str = ".", faults: list[Fault] | None = None
) -> list[FloatArray]:
    """Read the columns at the given positions of the header as float64; empty cells are NaN. O(bytes).

    Parameters
    ----------
    source : Delimited
    wanted : sequence of int
    decimal : str
        Decimal separator of the file.
    faults : list, optional
        Faults are appended to this list instead of raised; cells that cannot be read are then NaN, and rows of another length are
        changed by `even_rows`.

    Raises
    ------
    InvalidInput
        If `faults` is not given: with every row of the wrong length and every cell that is not a number.
    """
    reason, nulls = "", {"null_values": list(NULL_TEXTS), "quoted_strings_can_be_null": True}
    try:
        if find_spec("pyarrow") is None:
            columns = _numbers_by_line(source, wanted, decimal)
        else:
            table = _parsed(source, wanted, "float64", **nulls, decimal_point=decimal)
            columns = [np.asarray(column.to_numpy(), dtype=np.float64) for column in table]
        if all(np.nanmax(np.abs(values), initial=0.0) <= LARGEST_NUMBER for values in columns):
            return columns
    except _UNREADABLE as error:
        reason = str(error).splitlines()[0][:200]
    even, found = even_rows(source)
    try:
        texts = read_texts(even, wanted)
    except InvalidInput as error:
        raise InvalidInput([*found, *error.faults]) from error
    columns = []
    for position, cells in zip(wanted, texts, strict=True):
        values, bad = numbers_of(cells, decimal)
        columns.append(values)
        found += _cell_faults(even, position, [(even.header_line + 1 + i, cells[i]) for i in bad], decimal)
    if faults is None:
        raise InvalidInput(
            found or [Fault("not a readable CSV file", f"{source.path}", reason, "rows of numbers")]
        )
    faults += found
    return columns


def numbers_of(cells: Sequence[str], decimal: str) -> tuple[FloatArray, list[int]]:
    """The numbers in texts, and the indices of texts that are not numbers.

    A number with a decimal comma that is not the separator has a value and is listed as well.
    """
    values, bad = np.full(len(cells), np.nan), []
    for i, cell in enumerate(cells):
        text = cell.strip('"').strip()
        if text in NULL_TEXTS:
            continue
        value = _value(text.replace(decimal, "."))
        if value is None or not abs(value) <= LARGEST_NUMBER:
            bad.append(i)
            value = _value(text.replace(",", ".")) if _DECIMAL_COMMA.fullmatch(text) else None
        values[i] = np.nan if value is None else value
    return values, bad


_UNREADABLE: Final = (ValueError, KeyError)
"""Base classes of the errors that Arrow raises for a damaged row."""


def _texts_by_line(source: Delimited, wanted: Sequence[int]) -> list[list[str]]:
    """Read columns as texts without Arrow; raise ValueError for a row of another length, as Arrow does."""
    lines = source.data[source.body_offset :].split(b"\n")
    rows = [fields_of(decode(line).strip("\r"), source.delimiter) for line in lines if line.strip()]
    if {len(row) for row in rows} != {_body_width(source)}:
        raise ValueError("rows of different lengths")
    return [[row[i].strip() for row in rows] for i in wanted]


def _numbers_by_line(source: Delimited, wanted: Sequence[int], decimal: str) -> list[FloatArray]:
    """Read columns as numbers without Arrow; raise ValueError for a cell that is not a number."""
    columns = [numbers_of(cells, decimal) for cells in _texts_by_line(source, wanted)]
    if any(bad for _, bad in columns):
        raise ValueError("a cell that is no number")
    return [values for values, _ in columns]


def _parsed(source: Delimited, wanted: Sequence[int], kind: str, **options: Any) -> list[Any]:
    """Read the columns at the given positions as Arrow arrays of type `kind`."""
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    names = [f"c{i}" for i in range(_body_width(source))]
    chosen = [f"c{i}" for i in wanted]
    table = pa_csv.read_csv(
        pa.BufferReader(memoryview(source.data)[source.body_offset :]),
        read_options=pa_csv.ReadOptions(column_names=names, use_threads=False, block_size=8 << 20),
        parse_options=pa_csv.ParseOptions(delimiter=source.delimiter),
        convert_options=pa_csv.ConvertOptions(
            include_columns=chosen,
            column_types=dict.fromkeys(chosen, pa.type_for_alias(kind)),
            check_utf8=False,
            **options,
        ),
    )
    return [table[name] for name in chosen]


def first_row(source: Delimited) -> list[str]:
    """Cells of the first row of the body."""
    end = source.data.find(b"\n", source.body_offset)
    first = source.data[source.body_offset : end if end >= 0 else len(source.data)]
    return fields_of(decode(first).strip("\r\n"), source.delimiter) or [""]


def _body_width(source: Delimited) -> int:
    """Number of cells in a row: as in the header, or one fewer or more if only one of the two ends in a delimiter."""
    row = first_row(source)
    header = len(source.names)
    if len(row) == header - 1 and not source.names[-1]:
        return header - 1
    if len(row) == header + 1 and not row[-1].strip():
        return header + 1
    return header


def _value(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def line_of(cells: Sequence[str], delimiter: str) -> bytes:
    """Join cells to a line."""
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter, lineterminator="").writerow(cells)
    return text.getvalue().encode()


def _cut_off_fault(source: Delimited, line: int, width: int, cells: Sequence[str]) -> Fault:
    position = min(len(cells) - 1, len(source.names) - 1)
    return Fault(
        "truncated file",
        source.where(line, source.names[position]),
        f"the last line ends in {excerpt(cells[-1])}, field {len(cells)} of {width}",
        f"{width} fields and a line break",
        "fetch the file again, or delete the last line to use the rest",
    )


def _row_faults(source: Delimited, fields: Mapping[int, int], width: int, cut: int) -> Iterator[Fault]:
    """A fault for each of the first `SHOWN_ROWS` rows of another length, and one fault that counts the others.

    `fields` has the number of cells of each such row by its place in the body; the row at `cut` is left out.
    """
    rows = [(place, n) for place, n in fields.items() if place != cut]
    what, where = "wrong number of columns", f"{source.path}"
    for place, n in rows[:SHOWN_ROWS]:
        comma = source.delimiter == "," and n > width
        fix = (
            "export with a decimal point, or with ';' between columns" if comma else "mend or delete the row"
        )
        yield Fault(what, f"{where} row {source.header_line + 1 + place}", f"{n}", f"{width}", fix)
    more = len(rows) - SHOWN_ROWS
    if more > 0:
        yield Fault(what, where, f"{more} more rows", f"{width}", count=more)


def _cell_faults(
    source: Delimited, position: int, bad: Sequence[tuple[int, str]], decimal: str
) -> Iterator[Fault]:
    """A fault for each bad cell of a column; if there are more than `SHOWN_ROWS`, one fault of the first cell with their number."""
    counted = len(bad) > SHOWN_ROWS
    for line, text in bad[:1] if counted else bad:
        what, allowed, fix = "not a number", "a number with a decimal point, or an empty cell", ""
        if _DECIMAL_COMMA.fullmatch(text):
            what, fix = "decimal comma", "export the file with a decimal point"
        elif _value(text.replace(decimal, ".")) is not None:
            what, allowed = "number out of range", f"a finite number of at most {LARGEST_NUMBER:g}"
        got = excerpt(text) + (and_more(bad) if counted else "")
        where = source.where(line, source.names[position])
        yield Fault(what, where, got, allowed, fix, count=len(bad) if counted else 1)
