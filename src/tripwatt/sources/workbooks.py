"""Sheets of an .xlsx workbook, read row by row: only shared texts and formats are held in memory, and all content is counted."""

from __future__ import annotations

import datetime as dt
import posixpath
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final, TypeVar
from xml.parsers import expat
from zipfile import ZipFile

from tripwatt.containers import CELLS, ELEMENTS, Budget, open_archive
from tripwatt.errors import InvalidInput, require_extras

T = TypeVar("T")
Element = tuple[str, str, dict[str, str], str]
"""Tag of the parent, tag, attributes and text."""
Convert = Callable[[float], Any]

MAX_SHEETS: Final = 50
MAX_COLUMNS: Final = 16_384
"""Largest number of columns in a sheet, as in Excel."""

MAX_DEPTH: Final = 100


def read_workbook(
    data: bytes, read: Callable[[Iterator[list[Any]]], T], budget: Budget, fix: str = ""
) -> list[tuple[str, T]]:
    """Apply a function to the rows of each of the first `MAX_SHEETS` sheets, and return the titles with the results.

    Parameters
    ----------
    data : bytes
        Content of the file.
    read : callable
        Takes an iterator of the rows of a sheet; a row is a list of numbers, texts, times, bools and None.
    budget : Budget
    fix : str
        Text of the fault.

    Raises
    ------
    InvalidInput
        When the file is not a workbook, or its content exceeds the budget.
    """
    require_extras({"workbooks": "a workbook"})
    try:
        archive = open_archive(data, budget)
        return [(title, read(rows)) for title, rows in _sheets(archive, budget)]
    except (InvalidInput, MemoryError):
        raise
    except Exception as error:  # a damaged archive makes zipfile, expat and the formats raise a dozen kinds
        got = f"{type(error).__name__}: {error}"[:160]
        raise InvalidInput.of("unreadable sheet", budget.where, got, "an .xlsx workbook", fix) from error


def _sheets(archive: ZipFile, budget: Budget) -> Iterator[tuple[str, Iterator[list[Any]]]]:
    book = next(path for kind, path in _links(archive, "", budget).values() if kind == "officeDocument")
    links = _links(archive, book, budget)
    parts = {kind: path for kind, path in links.values() if path in archive.namelist()}
    texts = list(_texts(archive, parts["sharedStrings"], budget)) if "sharedStrings" in parts else []
    elements = [*_elements(archive, book, budget)]
    is_1904 = any(a.get("date1904") in ("1", "true") for _, tag, a, _ in elements if tag == "workbookPr")
    epoch = dt.datetime(1904, 1, 1) if is_1904 else dt.datetime(1899, 12, 30)
    times = _times(archive, parts["styles"], epoch, budget) if "styles" in parts else []
    # the id of a sheet's link has the prefix of its namespace, such as "r:id"
    ids = [(a, next(key for key in a if key.endswith(":id"))) for _, tag, a, _ in elements if tag == "sheet"]
    sheets = [(a["name"], *links[a[key]]) for a, key in ids]
    for title, path in [(title, path) for title, kind, path in sheets if kind == "worksheet"][:MAX_SHEETS]:
        yield title, _rows(_elements(archive, path, budget), texts, times, budget)


def _elements(archive: ZipFile, name: str, budget: Budget) -> Iterator[Element]:
    """Yield the XML elements of a part of the archive in the order in which they end."""
    ended: list[Element] = []
    stack: list[tuple[str, dict[str, str]]] = [("", {})]
    text: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        stack.append((tag.rpartition(":")[2], attributes))
        text.clear()
        if len(stack) > MAX_DEPTH:
            raise ValueError("elements too deep")

    def end(_: str) -> None:
        ended.append((stack[-2][0], *stack.pop(), "".join(text)))
        text.clear()

    def refuse(*_: object) -> None:
        raise ValueError("a document type")  # a document type may declare entities, which can inflate a file

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text.append, refuse
    with archive.open(name) as part:
        while piece := part.read(1 << 16):
            parser.Parse(piece)
            budget.take(ELEMENTS, len(ended))
            yield from ended
            ended.clear()
    parser.Parse(b"", True)


def _links(archive: ZipFile, part: str, budget: Budget) -> dict[str, tuple[str, str]]:
    """Id -> kind and path of each part to which a part refers."""
    folder, name = posixpath.split(part)
    elements = _elements(archive, posixpath.join(folder, "_rels", f"{name}.rels"), budget)
    return {
        a["Id"]: (
            posixpath.basename(a["Type"]),
            posixpath.normpath(posixpath.join("/", folder, a["Target"]))[1:],
        )
        for _, tag, a, _ in elements
        if tag == "Relationship"
    }


def _texts(archive: ZipFile, name: str, budget: Budget) -> Iterator[str]:
    pieces: list[str] = []
    for parent, tag, _, text in _elements(archive, name, budget):
        if tag == "t" and parent != "rPh":  # "rPh" is the pronunciation of a text
            pieces.append(text)
        elif tag == "si":
            budget.take(CELLS, 1)
            yield "".join(pieces)
            pieces.clear()


def _times(archive: ZipFile, name: str, epoch: dt.datetime, budget: Budget) -> list[Convert | None]:
    """For each cell format the function that converts a number to a time; None if the format is not one of times."""
    from openpyxl.styles.numbers import BUILTIN_FORMATS, is_date_format, is_timedelta_format
    from openpyxl.utils.datetime import from_excel

    codes: dict[int, str] = dict(BUILTIN_FORMATS)
    times: list[Convert | None] = []
    for parent, tag, attributes, _ in _elements(archive, name, budget):
        if tag == "numFmt":
            codes[int(attributes["numFmtId"])] = attributes["formatCode"]
        elif (parent, tag) == ("cellXfs", "xf"):
            budget.take(CELLS, 1)
            code = codes.get(int(attributes.get("numFmtId", 0)), "")
            convert = partial(from_excel, epoch=epoch, timedelta=is_timedelta_format(code))
            times.append(convert if is_date_format(code) else None)
    return times


def _rows(
    elements: Iterator[Element], texts: list[str], times: list[Convert | None], budget: Budget
) -> Iterator[list[Any]]:
    from openpyxl.utils import column_index_from_string

    row: list[Any] = []
    content: list[str] = []
    for parent, tag, attributes, text in elements:
        if tag == "v" or (tag == "t" and parent != "rPh"):
            content.append(text)
        elif tag == "c":
            reference = attributes.get("r", "").rstrip("0123456789")
            column = column_index_from_string(reference) if reference else len(row) + 1
            if column > MAX_COLUMNS:
                raise ValueError(f"a row of over {MAX_COLUMNS} cells")
            row += [None] * (column - len(row))
            if any(content):
                row[column - 1] = _value("".join(content), attributes, texts, times)
            content.clear()
        elif tag == "row":
            budget.take(CELLS, len(row) + 1)
            yield row
            row = []


def _value(text: str, attributes: dict[str, str], texts: list[str], times: list[Convert | None]) -> Any:
    """The value of a cell from its text and attributes."""
    match attributes.get("t", "n"):
        case "s":
            return texts[int(text)]
        case "b":
            return text not in ("0", "false")
        case "n":
            number = float(text) if set(text) & set(".eE") else int(text)
            convert = times[int(attributes["s"])] if times and "s" in attributes else None
            try:
                return number if convert is None else convert(number)
            except (OverflowError, ValueError):
                return "#VALUE!"
        case _:  # a text, or a time in ISO 8601, the form in which `archives` writes times
            return text
