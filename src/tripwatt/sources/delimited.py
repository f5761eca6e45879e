"""Reader of delimited text files: only the wanted columns are read, and every fault is given with its row and column.

`open_delimited` finds the header, `sections` splits the file at further headers, and `even_rows` gives every row as many cells as the
header. The parser of pandas then reads columns of numbers. If it fails, the cells are read one by one, which finds every fault.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, number_in
from tripwatt.errors import Fault, InvalidInput, and_more, excerpt
from tripwatt.files import read_file
from tripwatt.sources.grouping import MARKS, group_separator, may_be_grouped, unclear_fault, use_of
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
SHOWN_ROWS: Final = 5
"""Number of rows listed for one kind of fault in one column; the others are counted."""
NULL_TEXTS: Final = ("", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None", "-nan", "#N/A", "-")
_IN_TWO_CELLS: Final = re.compile(r"(?<![^,])[+-]?[1-9]\d{0,2},0\d\d(?:\.\d*)?(?![^,])")
_SPACE_IN_NUMBER: Final = re.compile(r"[ '’\u00a0\u202f](?<=\d.)(?=\d{3}(?!\d))")
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d+,\d+")
_UNITS: Final = frozenset().union(*UNITS.values())
_VALUE: Final = re.compile(r"[-+]?[.,]?\d[-+\d.,:/ eETZ]*")
"""Form of a cell that is a value and not the name of a column: a number, a date, a time."""


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
    offset, line, delimiter, header_names = _header(path, data)
    if header_names is None:
        if not names:
            got = f"a first line of values: {excerpt(decode(data[offset : offset + 40]))}"
            fix = "add the header of the other files"
            raise InvalidInput.of("no header", f"{path}", got, "names of columns in the first line", fix)
        return Delimited(path, tuple(names), delimiter, data, offset, line - 1)
    end = data.find(b"\n", offset) + 1 or len(data)
    header, body = data[offset:end].strip(b"\n"), data[end:]
    # loggers repeat it at each start; a blank line in its place keeps the numbers of the lines
    if header in body:
        body = b"\n".join(b"" if line == header else line for line in body.split(b"\n"))
    if not body.strip():
        got = f"a header of {len(header_names)} columns without rows below"
        raise InvalidInput.of("no samples", f"{path}", got, "rows")
    data = data[:end] + body
    units = tuple(cell.strip("[](){}") for cell in cells_of(body.partition(b"\n")[0], delimiter))
    stated = [unit for unit in units if unit.lower() in _UNITS]
    if len(units) <= len(header_names) and len(stated) > 1 and not _has_values(units):
        return Delimited(path, header_names, delimiter, data, data.find(b"\n", end) + 1, line + 1, units)
    return Delimited(path, header_names, delimiter, data, end, line)


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
        text = decode(raw)
        if text.lower().startswith("sep=") and len(text) == len("sep=") + 1:
            stated = text[-1]
        elif text.strip() and len(head) < MAX_TITLE_LINES:
            head.append((offset, line, text))
        offset += len(raw) + 1
    for (offset, line, text), (_, _, below) in zip(head, [*head[1:], head[-1]], strict=True):
        delimiter = stated or max(DELIMITERS, key=text.count)
        cells = tuple(cells_of(text, delimiter))
        if text.count(delimiter) >= MAX_COLUMNS:
            got = f"{text.count(delimiter) + 1} columns"
            raise InvalidInput.of("too many columns", f"{path}", got, f"at most {MAX_COLUMNS}")
        if len([cell for cell in cells if cell]) > 1 and not _is_title(cells, below, delimiter):
            return offset, line, delimiter, None if _has_values(cells) else cells
    offset, line, text = head[0]
    delimiter = stated or max(DELIMITERS, key=text.count)
    return offset, line, delimiter, tuple(cells_of(text, delimiter))


def _is_title(cells: Sequence[str], below: str, delimiter: str) -> bool:
    """Whether a line is a title above the header: the line below has more cells, with either delimiter, and no values."""
    delimiters = {delimiter, max(DELIMITERS, key=below.count)}
    longest = max((cells_of(below, other) for other in delimiters), key=len)
    return len(longest) > len(cells) and not any(_VALUE.fullmatch(cell) for cell in longest)


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
    named = [name for name in source.names if name]
    keys = set(map(column_key, named))
    # a search in the rows of numbers would take as long as reading them: only lines with the first letter of a name are compared
    codes = np.frombuffer(source.data, np.uint8)
    starts = np.flatnonzero(codes[source.body_offset : -1] == ord("\n")) + source.body_offset + 1
    initials = "\"' " + "".join(name[0].lower() + name[0].upper() for name in named)
    starts = starts[np.isin(codes[starts], np.frombuffer(initials.encode(), np.uint8))]
    first_cell = "|".join(map(re.escape, named)) or "(?!)"
    header = re.compile(
        rf"[\"' ]*(?:{first_cell})[\"' ]*{re.escape(source.delimiter)}[^\n]*".encode(), re.IGNORECASE
    )
    matches = [header.match(source.data, start) for start in (source.body_offset, *starts.tolist())]
    further = [
        (match, names)
        for match in matches
        if match is not None
        for names in [tuple(cells_of(match[0], source.delimiter))]
        if 2 * len(keys & set(map(column_key, names))) >= len(keys)
    ]
    if len(further) > MAX_SECTIONS:
        got = f"{len(further)} lines that are headers"
        raise InvalidInput.of("too many headers", f"{source.path}", got, f"at most {MAX_SECTIONS}")
    ends = [*(match.start() for match, _ in further), len(source.data)]
    parts = [replace(source, data=source.data[: ends[0]])]
    line = source.header_line
    for (match, names), end in zip(further, ends[1:], strict=True):
        line += parts[-1].data.count(b"\n", parts[-1].body_offset) + 1
        body = source.data[match.end() + 1 : end]
        parts.append(replace(source, names=names, data=body, body_offset=0, header_line=line))
    return [part for part in parts if part.data[part.body_offset :].strip()]


def even_rows(source: Delimited) -> tuple[Delimited, IntArray, list[Fault]]:
    """Give every row as many cells as the header. O(bytes).

    Blank lines are left out. Surplus cells on the right are removed. Cells that the logger left out at the end become empty cells. A
    row that was cut off in the middle, or is longer because of commas in its numbers, becomes an empty row.

    Returns
    -------
    source : Delimited
        The file with even rows.
    line_numbers : ndarray, shape (rows,)
        1-based line of each row in the file.
    faults : list of Fault
        The rows that were changed.

    Raises
    ------
    InvalidInput
        When every row, or many rows divided by commas, have more cells than the header: it is unknown to which column they belong.
    """
    width, delimiter = _body_width(source), source.delimiter
    body = source.data[source.body_offset :].rstrip(b"\n")
    if _is_plain_grid(body, delimiter, width):
        rows = np.arange(body.count(b"\n") + 1)
        return replace(source, data=body, body_offset=0), source.header_line + 1 + rows, []
    lines = source.data[source.body_offset :].split(b"\n")
    filled = [i for i, line in enumerate(lines) if line.strip()]
    mark = delimiter.encode()
    cells = {  # of rows that may be uneven; a delimiter may be inside quotes
        i: cells_of(lines[i], delimiter)
        for i in filled
        if lines[i].count(mark) != width - 1 or b'"' in lines[i]
    }
    lengths = Counter(len(row) for row in cells.values() if len(row) < width)
    # 0.05: if more than this share of the rows has the same number of cells, below that of the header, the
    # logger leaves out empty cells at the end; rarer short rows were cut off
    usual = {length for length, count in lengths.items() if count > 0.05 * len(lines)}
    uneven = {i: len(row) for i, row in cells.items() if len(row) < width or any(row[width:])}
    is_cut = uneven.get(len(lines) - 1, width) < width and uneven[len(lines) - 1] not in usual
    listed = [i for i in uneven if not (is_cut and i == len(lines) - 1)]
    faults = [*_row_faults(source, [(source.header_line + 1 + i, uneven[i]) for i in listed], width)]
    if is_cut:
        faults.append(_cut_off_fault(source, source.header_line + len(lines), width, cells[len(lines) - 1]))
    longer = {i: cells[i] for i, length in uneven.items() if length > width}
    # rows that were cut off say nothing of a column that was added
    whole = [i for i in filled if uneven.get(i, width) >= width]
    shifted = longer if delimiter == "," and not _is_appended(longer, whole) else {}
    # 0.05: largest share of rows with commas in their numbers with which the other rows are used
    if len(longer) == len(filled) or len(shifted) > max(0.05 * len(filled), SHOWN_ROWS):
        raise InvalidInput(faults)
    for i, row in cells.items():
        kept = row[:width] if i not in shifted and (len(row) >= width or len(row) in usual) else []
        lines[i] = line_of([*kept, *[""] * (width - len(kept))], delimiter)
    body = b"\n".join(lines[i] for i in filled)
    return replace(source, data=body, body_offset=0), source.header_line + 1 + np.array(filled), faults


def _is_appended(longer: Mapping[int, Sequence[str]], rows: Sequence[int]) -> bool:
    """Whether the surplus cells of longer rows are those of a column that the logger added, from some row to the end of the file."""
    is_tail = [*longer] == rows[len(rows) - len(longer) :]
    # 1,012 is one number in two cells: a number of its own has no leading zero
    in_two = any(_IN_TWO_CELLS.search(",".join(row)) for row in longer.values())
    return is_tail and len({len(row) for row in longer.values()}) == 1 and not in_two


def _is_plain_grid(body: bytes, delimiter: str, width: int) -> bool:
    """Whether every row has `width` cells, and no quote character occurs."""
    codes = np.frombuffer(body, np.uint8)
    ends = np.append(np.flatnonzero(codes == ord("\n")), len(codes))
    delimiters = np.searchsorted(np.flatnonzero(codes == ord(delimiter)), ends)
    return b'"' not in body and bool((np.diff(delimiters, prepend=0) == width - 1).all())


def _text_bytes(path: Path, data: bytes) -> bytes:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeDecodeError as error:
            raise InvalidInput(_not_text(path, "damaged UTF-16")) from error
    data = data.removeprefix(b"\xef\xbb\xbf")
    if not data.strip():
        got, fix = f"{len(data)} bytes", "fetch the file again"
        raise InvalidInput.of("empty file", f"{path}", got, "a header and rows", fix)
    if b"\0" in data[:65536]:
        raise InvalidInput(_not_text(path, "zero bytes"))
    if re.match(rb"\s*<(!doctype|!--|html|head)", data, re.IGNORECASE):
        raise InvalidInput(_not_text(path, "a web page (HTML), such as that of a login"))
    return data.replace(b"\r\n", b"\n") if b"\n" in data else data.replace(b"\r", b"\n")


def _not_text(path: Path, got: str) -> Fault:
    return Fault("not a text file", f"{path}", got, "a CSV file in UTF-8 or latin-1", "fetch the file again")


def decode(raw: bytes) -> str:
    """Decode bytes as UTF-8, or as latin-1 if they are not UTF-8."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def cells_of(line: str | bytes, delimiter: str) -> list[str]:
    """Split a line into its cells, without outer blanks."""
    text = (line if isinstance(line, str) else decode(line)).strip("\r")
    try:
        cells = next(csv.reader([text], delimiter=delimiter), [])
    except csv.Error:  # a stray carriage return or an unbalanced quote in a damaged line
        cells = text.split(delimiter)
    return [cell.strip() for cell in cells]


def read_texts(source: Delimited, wanted: Sequence[int]) -> list[list[str]]:
    """Read the columns at the given positions of the header as texts without outer blanks; the rows have to be even. O(bytes)."""
    table = _parsed(source, wanted, dtype=object, na_filter=False)
    return [[(c if c.isascii() else decode(c.encode("latin-1"))).strip() for c in table[i]] for i in wanted]


def read_numbers(
    source: Delimited, wanted: Sequence[int], decimal: str, line_numbers: IntArray
) -> tuple[list[FloatArray], list[Fault]]:
    """Read the columns at the given positions of the header as float64; the rows have to be even. O(bytes).

    Parameters
    ----------
    source : Delimited
    wanted : sequence of int
    decimal : str
        Decimal separator of the file.
    line_numbers : ndarray, shape (rows,)
        Line of each row, for the faults.

    Returns
    -------
    list of ndarray, shape (rows,)
        NaN if a cell is empty or cannot be read.
    list of Fault
        The cells that cannot be read.
    """
    try:
        table = _parsed(source, wanted, dtype=np.float64, na_values=NULL_TEXTS, decimal=decimal)
        columns = [table[i].to_numpy() for i in wanted]
        is_small = all(np.nanmax(np.abs(values), initial=0.0) <= LARGEST_NUMBER for values in columns)
        doubtful = [(i, v) for i, v in zip(wanted, columns, strict=True) if is_small and may_be_grouped(v)]
        lines = source.data[source.body_offset :].split(b"\n") if doubtful else []
        # 100: number of first rows that are not whole, of which one mostly shows that the separator begins decimals
        rows = {i: [lines[row] for row in np.flatnonzero(v % 1.0)[:100]] for i, v in doubtful}
        heads = (read_texts(_of_lines(source, own), [i])[0] for i, own in rows.items())
        if is_small and all(use_of(cells, decimal) == "decimal" for cells in heads):
            return columns, []
    except ValueError:  # a cell that is not a number
        pass
    columns, faults = [], list[Fault]()
    for position, cells in zip(wanted, read_texts(source, wanted), strict=True):
        if _SPACE_IN_NUMBER.search("\n".join(cells)):
            cells = [_SPACE_IN_NUMBER.sub("", cell) for cell in cells]
        separator = group_separator(cells, lambda: _decimals(source))
        where = f"{source.path} row {{}} column {source.names[position]!r}"
        if separator is None:
            filled = [cell for cell in cells if cell not in NULL_TEXTS]
            faults.append(unclear_fault(where.replace(" row {}", ""), filled))
            cells = [""] * len(cells)
        # a separator of groups is left out; the other one begins decimals, if there are any
        plain = [cell.replace(separator, "") for cell in cells] if separator else cells
        values, bad = numbers_of(plain, MARKS.get(separator or "", decimal))
        columns.append(values)
        faults += _cell_faults([(where.format(line_numbers[i]), cells[i]) for i in bad], decimal)
    return columns, faults


def _of_lines(source: Delimited, lines: Sequence[bytes]) -> Delimited:
    return replace(source, data=b"\n".join(lines), body_offset=0)


def _decimals(source: Delimited) -> set[str]:
    """The separators that begin decimals in some column of a file."""
    # 1000: number of first rows that are looked at
    lines = source.data[source.body_offset :].split(b"\n", 1000)[:1000]
    columns = read_texts(_of_lines(source, lines), range(len(source.names)))
    return {mark for mark in MARKS if any(use_of(cells, mark) == "decimal" for cells in columns)}


def numbers_of(cells: Sequence[str], decimal: str) -> tuple[FloatArray, list[int]]:
    """The numbers in texts, and the indices of texts that are not numbers.

    A number with a decimal comma that is not the separator has a value and is listed as well.
    """
    texts = [cell.strip('"').strip() for cell in cells]
    values = np.array([number_in(text.replace(decimal, ".")) for text in texts])
    unread = np.flatnonzero(~(np.abs(values) <= LARGEST_NUMBER)).tolist()
    bad = [i for i in unread if texts[i] not in NULL_TEXTS]
    for i in bad:
        values[i] = number_in(texts[i].replace(",", ".")) if _DECIMAL_COMMA.fullmatch(texts[i]) else np.nan
    return values, bad


def _parsed(source: Delimited, wanted: Sequence[int], **options: Any) -> pd.DataFrame:
    """Read the columns at the given positions; `options` are those of `pandas.read_csv`."""
    table: pd.DataFrame = pd.read_csv(  # noqa: TID251 - the content was read within its bounds
        io.BytesIO(source.data[source.body_offset :]),
        sep=source.delimiter,
        header=None,
        names=range(_body_width(source)),
        usecols=sorted(wanted),
        index_col=False,
        keep_default_na=False,
        skip_blank_lines=False,
        lineterminator="\n",
        encoding="latin-1",  # any bytes are text in it
        **options,
    )
    return table


def first_row(source: Delimited) -> list[str]:
    """Cells of the first row of the body."""
    end = source.data.find(b"\n", source.body_offset)
    return cells_of(source.data[source.body_offset : end if end >= 0 else None], source.delimiter) or [""]


def _body_width(source: Delimited) -> int:
    """Number of cells in a row: as in the header, or one fewer or more if only one of the two ends in a delimiter."""
    row, header = first_row(source), len(source.names)
    ends_empty = {header - 1: not source.names[-1], header + 1: not row[-1]}
    return len(row) if ends_empty.get(len(row)) else header


def line_of(cells: Sequence[str], delimiter: str) -> bytes:
    """Join cells to a line."""
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter, lineterminator="").writerow(cells)
    return text.getvalue().encode()


def _cut_off_fault(source: Delimited, line: int, width: int, cells: Sequence[str]) -> Fault:
    name = source.names[min(len(cells), len(source.names)) - 1]
    return Fault(
        "truncated file",
        f"{source.path} row {line} column {name!r}",
        f"the last line ends in {excerpt(cells[-1])}, field {len(cells)} of {width}",
        f"{width} fields and a line break",
        "fetch the file again, or delete the last line to use the rest",
    )


def _row_faults(source: Delimited, rows: Sequence[tuple[int, int]], width: int) -> Iterator[Fault]:
    """A fault for each of the first `SHOWN_ROWS` rows, and one fault that counts the others; `rows` has lines and numbers of cells."""
    what = "wrong number of columns"
    for line, length in rows[:SHOWN_ROWS]:
        fix = "mend or delete the row"
        if source.delimiter == "," and length > width:
            fix = "export with a decimal point, without separators of thousands, or with ';' between columns"
        yield Fault(what, f"{source.path} row {line}", f"{length}", f"{width}", fix)
    unlisted = len(rows) - SHOWN_ROWS
    if unlisted > 0:
        yield Fault(what, f"{source.path}", f"{unlisted} more rows", f"{width}", count=unlisted)


def _cell_faults(bad: Sequence[tuple[str, str]], decimal: str) -> Iterator[Fault]:
    """A fault for each bad cell of a column, given as (place, text); for more than `SHOWN_ROWS`, one of the first with their number."""
    counted = len(bad) > SHOWN_ROWS
    for place, text in bad[:1] if counted else bad:
        what, allowed, fix = "not a number", "a number with a decimal point, or an empty cell", ""
        if _DECIMAL_COMMA.fullmatch(text):
            what, fix = "decimal comma", "export the file with a decimal point"
        elif not np.isnan(number_in(text.replace(decimal, "."))):
            what, allowed = "number out of range", f"a finite number of at most {LARGEST_NUMBER:g}"
        got = excerpt(text) + (and_more(bad) if counted else "")
        yield Fault(what, place, got, allowed, fix, count=len(bad) if counted else 1)
