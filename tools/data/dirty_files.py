"""How files of logs are written: delimiters, quotes, encodings, lines above the header, workbooks."""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from openpyxl import Workbook

TITLE: Final = ("Log of my car", "exported by me")
BLANK_SHARE: Final = 0.02
ENCODINGS: Final = {
    "utf-8": "utf-8",
    "latin-1": "latin-1",
    "byte order mark": "utf-8-sig",
    "utf-16": "utf-16",
}
_NUMBER: Final = re.compile(r"-?\d+\.\d+")
_SAVED: Final = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")


@dataclass
class Row:
    """A line of a file: its cells, (drive, sample), and what is wrong with it.

    Attributes
    ----------
    cells : list of str
    key : tuple of int
        Number of the drive, below 0 for other rows, and of the sample in it.
    keep : int
        Cells that were written before the line was cut, 0 for all.
    touched : bool
        Whether it has dirt.
    header : bool
        Whether it is a header.
    """

    cells: list[str]
    key: tuple[int, int]
    keep: int = 0
    touched: bool = False
    header: bool = False


@dataclass
class LogFile:
    """A file of a folder in the making.

    Attributes
    ----------
    name : str
    header : list of str
    rows : list of Row
    last_header : list of str or None
        Names of the columns at the end of the file, None where its header does not tell.
    headed : bool
        Whether the header is written.
    shifted : bool
        Whether the clock was set.
    cut_end : bool
        Whether the last line has no line break.
    """

    name: str
    header: list[str]
    rows: list[Row]
    last_header: list[str] | None
    headed: bool = True
    shifted: bool = False
    cut_end: bool = False


@dataclass(frozen=True)
class Look:
    """How all files of a folder are written.

    Attributes
    ----------
    delimiter, decimal, encoding, newline : str
        The encoding by its name in `ENCODINGS`.
    quoted : bool
        Quotes around all cells.
    trailing : bool
        A delimiter at the end of rows.
    blank : bool
        Blank lines between rows.
    top : str
        "title line" or "sep line" above the header, or empty.
    wide_title : bool
        A title of two cells.
    xlsx : bool
        Workbooks in place of text.
    """

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    newline: str = "\n"
    quoted: bool = False
    trailing: bool = False
    blank: bool = False
    top: str = ""
    wide_title: bool = False
    xlsx: bool = False

    def line(self, cells: Sequence[str]) -> str:
        """A line without its end."""
        if self.decimal == ",":
            cells = [cell.replace(".", ",") if _NUMBER.fullmatch(cell) else cell for cell in cells]
        if self.quoted:
            return self.delimiter.join([f'"{cell}"' for cell in cells])
        if self.decimal == "," and self.delimiter == ",":
            cells = [f'"{cell}"' if "," in cell else cell for cell in cells]
        return self.delimiter.join(cells)

    @property
    def title(self) -> list[str]:
        """Cells of the title."""
        return [] if self.top != "title line" else list(TITLE if self.wide_title else TITLE[:1])


def file_bytes(file: LogFile, look: Look, rng: np.random.Generator, units: Sequence[str]) -> bytes:
    """Content of a file."""
    return _workbook(file, look, units) if look.xlsx else _text(file, look, rng, units)


def _text(file: LogFile, look: Look, rng: np.random.Generator, units: Sequence[str]) -> bytes:
    lines = []
    if file.headed:
        lines += [f"sep={look.delimiter}"] if look.top == "sep line" else []
        lines += [look.delimiter.join(look.title)] if look.title else []
        lines.append(look.line(file.header))
        lines += [look.line(units)] if units else []
    blank = rng.random(len(file.rows)) < BLANK_SHARE if look.blank else np.zeros(len(file.rows), dtype=bool)
    end = look.delimiter if look.trailing else ""
    for row, is_blank in zip(file.rows, blank.tolist(), strict=True):
        lines += [""] if is_blank else []
        lines.append(
            _cut(look.line(row.cells[: row.keep]), look, rng) if row.keep else look.line(row.cells) + end
        )
    text = look.newline.join(lines) + ("" if file.cut_end else look.newline)
    return text.encode(ENCODINGS[look.encoding])


def _cut(line: str, look: Look, rng: np.random.Generator) -> str:
    """A line whose last cell was cut too; between quotes it stays whole."""
    last = 0 if look.quoted or line.endswith('"') else len(line) - line.rfind(look.delimiter) - 1
    return line[: len(line) - int(rng.integers(0, max(last, 1)))]


def _workbook(file: LogFile, look: Look, units: Sequence[str]) -> bytes:
    book = Workbook(write_only=True)
    sheet = book.create_sheet("Log")
    for cells in ([look.title] if look.title else []) + [file.header] + ([list(units)] if units else []):
        sheet.append(cells)
    for row in file.rows:
        sheet.append([_cell(cell) for cell in (row.cells[: row.keep] if row.keep else row.cells)])
    written = io.BytesIO()
    book.save(written)
    return _without_clock(written)


def _cell(text: str) -> float | str | dt.datetime | None:
    with contextlib.suppress(ValueError):
        return float(text)
    with contextlib.suppress(ValueError):
        return dt.datetime.strptime(text, "%Y-%m-%d %H:%M:%S")
    return text or None


def _without_clock(written: io.BytesIO) -> bytes:
    """A workbook without the time at which it was saved."""
    fixed = io.BytesIO()
    with zipfile.ZipFile(written) as old, zipfile.ZipFile(fixed, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "docProps/core.xml":
                content = _SAVED.sub(b"2024-01-01T00:00:00Z", content)
            new.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return fixed.getvalue()
