"""CSV and Parquet files as tables of columns that are read by name."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.containers import MAX_CONTENT_BYTES
from tripwatt.errors import Fault, InvalidInput, require_extras
from tripwatt.files import read_file
from tripwatt.sources.delimited import (
    MAX_COLUMNS,
    Delimited,
    even_rows,
    open_delimited,
    read_numbers,
    read_texts,
    sections,
)
from tripwatt.sources.parquet_heads import column_sizes

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

Item = TypeVar("Item")
Read = TypeVar("Read")

PARQUET: Final = ".parquet"
SUFFIXES: Final = (".csv", ".tsv", ".txt", PARQUET)
MAX_ROWS: Final = 500_000
"""Largest number of rows in a Parquet file with less than `MIN_ROW_BYTES` a row; equal values take almost no space there."""
MIN_ROW_BYTES: Final = 4
"""Least number of bytes that a row of measurements takes in a Parquet file."""

UNFOLLOWED: Final = (ValueError, LookupError, TypeError, ArithmeticError, RecursionError)
"""Errors that damaged or contradictory heads of a Parquet file raise."""

UNREADABLE: Final = "unreadable Parquet file"


@dataclass(frozen=True, slots=True)
class CsvTable:
    """A delimited text file as a table; a column that is missing in a part of the file is empty in its rows.

    Attributes
    ----------
    path : Path
    parts : tuple of Delimited
        The rows below each header of the file.
    lines : tuple of ndarray, shape (rows of a part,)
        1-based line of each row in the file.
    faults : list of Fault
        Faults are appended to this list.
    decimal : str
        Decimal separator.
    """

    path: Path
    parts: tuple[Delimited, ...]
    lines: tuple[IntArray, ...]
    faults: list[Fault]
    decimal: str = "."

    @property
    def names(self) -> Sequence[str]:
        """Names of the columns in all headers."""
        if len(self.parts) == 1:
            return self.parts[0].names
        return [*dict.fromkeys(name for part in self.parts for name in part.names)]

    def numbers(self, names: Sequence[str]) -> list[FloatArray]:
        """Read columns as float64; every cell that is not a number is a fault."""
        by_part = []
        for part, lines in zip(self.parts, self.lines, strict=True):
            present = [name for name in names if name in part.names]
            positions = [part.names.index(name) for name in present]
            values, faults = read_numbers(part, positions, self.decimal, lines)
            self.faults.extend(faults)
            columns = dict(zip(present, values, strict=True))
            by_part.append([columns.get(name, np.full(len(lines), np.nan)) for name in names])
        return [np.concatenate(pieces) for pieces in zip(*by_part, strict=True)]

    def texts(self, name: str) -> list[str]:
        """Read one column as texts."""
        cells: list[str] = []
        for part, lines in zip(self.parts, self.lines, strict=True):
            is_there = name in part.names
            cells += read_texts(part, [part.names.index(name)])[0] if is_there else [""] * len(lines)
        return cells

    def row(self, index: int) -> int:
        """1-based line in the file of the row with an index."""
        return int(np.concatenate(self.lines)[index])


@dataclass(frozen=True, slots=True)
class ParquetTable:
    """A Parquet file as a table. A column is read only if it is used.

    Attributes
    ----------
    path : Path
    file : pyarrow.parquet.ParquetFile
    values, inflated : mapping of str to int
        Number of values of each column, and bytes of its inflated pages (`column_sizes`).
    faults : list of Fault
        Faults are appended to this list.
    """

    path: Path
    file: pq.ParquetFile
    values: Mapping[str, int]
    inflated: Mapping[str, int]
    faults: list[Fault]

    @property
    def names(self) -> Sequence[str]:
        """Names of the columns of the schema, without the index that pandas writes."""
        names = map(str, self.file.schema_arrow.names)
        return [name for name in names if not re.fullmatch(r"__index_level_\d+__", name)]

    def read(self, name: str) -> pd.Series:
        """Read one column, if neither its pages nor the texts of its rows exceed `MAX_CONTENT_BYTES`.

        Raises
        ------
        InvalidInput
            When the column is larger, has values that are neither numbers, times nor texts, or cannot be read.
        """
        import pyarrow as pa

        rows, size = self.file.metadata.num_rows, self.inflated[name]
        try:
            if not _is_plain(self.file.schema_arrow.field(name).type):
                raise TypeError("values that are neither numbers, times nor texts")
            if self.values[name] != rows:
                raise ValueError(f"{self.values[name]} values of {name!r} in {rows} rows")
            if size <= MAX_CONTENT_BYTES:
                # texts are read as a dictionary, so that a text that is in every row is held once
                column = self.file.read(columns=[name], use_threads=False)[name]
                size = sum(map(_text_size, column.chunks))
            if size <= MAX_CONTENT_BYTES:
                return pd.Series(column.to_pandas())
        except MemoryError:  # Arrow's MemoryError is an ArrowException as well
            raise
        except (*UNFOLLOWED, OSError, pa.ArrowException) as error:  # also of a text that is not UTF-8
            raise InvalidInput(_unreadable(self.path, error)) from error
        where, got = f"{self.path} column {name!r}", f"{size} bytes when inflated"
        raise InvalidInput.of("column too large", where, got, f"at most {MAX_CONTENT_BYTES} bytes")

    def numbers(self, names: Sequence[str]) -> list[FloatArray]:
        """Read columns as float64; every column that is not numeric is a fault."""
        columns: list[FloatArray] = []
        for name in names:
            where = f"{self.path} column {name!r}"
            column = self.read(name)
            if pd.api.types.is_datetime64_any_dtype(column.dtype):
                fix = 'in a mapping: unit = "timestamp"'
                raise InvalidInput.of("not a number", where, f"{column.dtype}", "numbers", fix)
            try:
                values = pd.to_numeric(column)
            except (ValueError, TypeError) as error:
                values = pd.to_numeric(column, errors="coerce")
                bad = int((values.isna() & column.notna()).sum())
                got = f"{column.dtype}: {error}"[:120]
                self.faults.append(Fault("not a number", where, got, "numbers", count=bad))
            columns.append(np.asarray(values, dtype=np.float64))
        return columns

    def texts(self, name: str) -> list[str]:
        """Read one column as texts; missing values are empty."""
        column = self.read(name)
        return ["" if missing else str(value) for value, missing in zip(column, column.isna(), strict=True)]

    def row(self, index: int) -> int:
        """1-based number of the row with an index."""
        return index + 1


TableFile = CsvTable | ParquetTable
"""A table whose columns are read by name."""


def open_table(
    path: Path, decimal: str = ".", names: Sequence[str] = (), faults: list[Fault] | None = None
) -> TableFile:
    """Open a CSV or Parquet file as a table.

    Parameters
    ----------
    path : Path
    decimal : str
        Decimal separator of a text file.
    names : sequence of str
        Header to use for a text file without one.
    faults : list, optional
        Faults of the file are appended to this list; by default it is a new one.

    Raises
    ------
    InvalidInput
        When the file cannot be read in the format of its suffix.
    """
    faults = [] if faults is None else faults
    if path.suffix.lower() == PARQUET:
        return _open_parquet(path, faults)
    return csv_table(open_delimited(path, names=names), faults, decimal)


def csv_table(source: Delimited, faults: list[Fault], decimal: str = ".") -> CsvTable:
    """Make a table of a delimited file; further headers and uneven rows are appended to `faults`."""
    parts, lines = [], []
    for part in sections(source):
        if part.names != source.names:
            where, got = f"{source.path} row {part.header_line}", f"{len(part.names)} columns"
            allowed = f"the {len(source.names)} columns of the first"
            faults.append(Fault("another header", where, got, allowed))
        even, line_numbers, uneven = even_rows(part)
        parts.append(even)
        lines.append(line_numbers)
        faults += uneven
    if not parts:
        got = f"a header of {len(source.names)} columns without rows below"
        raise InvalidInput.of("no samples", f"{source.path}", got, "rows")
    return CsvTable(source.path, tuple(parts), tuple(lines), faults, decimal)


def stamp_texts(table: TableFile, column: str, date: str = "") -> list[str]:
    """The texts of the time stamps of each row; `date` is the column of the day if `column` has only the time of day."""
    texts = table.texts(column)
    if not date:
        return texts
    return [f"{day} {clock}".strip() for day, clock in zip(table.texts(date), texts, strict=True)]


def _open_parquet(path: Path, faults: list[Fault]) -> ParquetTable:
    require_extras({"parquet": f"{path}"})
    import pyarrow as pa
    import pyarrow.parquet as pq

    content = read_file(path)
    try:
        file = pq.ParquetFile(io.BytesIO(content))
        schema = file.schema
        leaves = [schema.column(k) for k in range(len(schema))]
        texts = [leaf.path for leaf in leaves if leaf.physical_type == "BYTE_ARRAY"]
        file = pq.ParquetFile(io.BytesIO(content), read_dictionary=texts)
        values, inflated = column_sizes(content)
    except (*UNFOLLOWED, OSError, pa.ArrowException) as error:
        raise InvalidInput(_unreadable(path, error)) from error
    rows, columns = file.metadata.num_rows, file.metadata.num_columns
    max_rows = max(MAX_ROWS, len(content) // MIN_ROW_BYTES)
    size, max_size = sum(inflated.values()), MAX_CONTENT_BYTES * max(min(columns, len(content) >> 20), 1)
    if rows > max_rows or columns > MAX_COLUMNS or size > max_size:
        got = f"{rows} rows of {columns} columns in {len(content)} bytes, {size} when inflated"
        allowed = f"at most {max_rows} rows of {MAX_COLUMNS} columns, {max_size} bytes when inflated"
        raise InvalidInput.of("Parquet file too large", f"{path}", got, allowed)
    return ParquetTable(path, file, values, inflated, faults)


def require_small_columns(path: Path) -> None:
    """Raise `InvalidInput` if a Parquet file or one of its columns is too large; do nothing if the file cannot be read."""
    try:
        table = _open_parquet(path, [])
        for name in table.names:
            table.read(name)
    except InvalidInput as error:
        if error.faults[0].what != UNREADABLE:
            fault = error.faults[0]
            raise InvalidInput([replace(fault, where=fault.where.replace(f"{path}", path.name))]) from error


def _is_plain(data_type: pa.DataType) -> bool:
    import pyarrow as pa

    data_type = data_type.value_type if pa.types.is_dictionary(data_type) else data_type
    texts = (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary, pa.types.is_large_binary)
    kinds = (pa.types.is_primitive, pa.types.is_decimal, pa.types.is_null, *texts)
    return any(kind(data_type) for kind in kinds)


def _text_size(chunk: pa.Array) -> int:
    """Bytes of the texts of all rows in a chunk; for other values, bytes of the chunk."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if not pa.types.is_dictionary(chunk.type) or pa.types.is_primitive(chunk.type.value_type):
        return int(chunk.nbytes)
    return pc.sum(pc.binary_length(chunk.dictionary).take(chunk.indices)).as_py() or 0


def _unreadable(path: Path, error: Exception) -> Fault:
    got = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
    return Fault(UNREADABLE, f"{path}", got, "a Parquet file")


def table_files(path: Path) -> list[Path]:
    """The path itself if it is a file, else the tables of the folder by name, without hidden files and notes about tables.

    Raises
    ------
    InvalidInput
        When the path does not exist or the folder has no table.
    """
    allowed = f"a file or a folder of files {', '.join(SUFFIXES)}"
    if not path.exists():
        raise InvalidInput.of("no such file or folder", f"{path}", "", allowed)
    if path.is_file():
        return [path]
    visible = (p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
    files = sorted(p for p in visible if p.suffix.lower() in SUFFIXES)
    # a file .txt is taken for a note about the tables, if its folder has tables of other suffixes
    files = [p for p in files if p.suffix.lower() != ".txt"] or files
    if not files:
        raise InvalidInput.of("no trips", f"{path}", "no table", allowed)
    return files


def read_all(read: Callable[[Item], Read], items: Iterable[Item]) -> list[Read]:
    """Apply `read` to items in several threads, and return the results in the order of the items."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return list(pool.map(read, items))
