"""A CSV or Parquet file as columns, read by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.sources.delimited import Delimited, open_delimited, read_numbers, read_texts
from tripwatt.trips import raise_faults

SUFFIXES: Final = (".csv", ".tsv", ".txt", ".parquet")
PROSE: Final = ".txt"
"""In a folder with other tables a file of this suffix is a note about them."""


class TableFile(Protocol):
    """A file of columns, by name."""

    @property
    def path(self) -> Path:
        """Where the file is."""

    @property
    def names(self) -> Sequence[str]:
        """Columns as the file names them."""

    def numbers(self, names: Sequence[str]) -> list[FloatArray]:
        """Columns as float64."""

    def texts(self, name: str) -> list[str]:
        """One column as text."""

    def row(self, index: int) -> int:
        """Row of a sample as the user counts them."""


@dataclass(frozen=True, slots=True)
class CsvTable:
    """A delimited text file."""

    path: Path
    source: Delimited
    decimal: str

    @property
    def names(self) -> Sequence[str]:
        """Columns of the header."""
        return self.source.names

    def _position(self, name: str) -> int:
        return self.source.names.index(name)

    def numbers(self, names: Sequence[str]) -> list[FloatArray]:
        """Columns as float64, with every cell that is none named."""
        return read_numbers(self.source, [self._position(n) for n in names], self.decimal)

    def texts(self, name: str) -> list[str]:
        """One column as text."""
        return read_texts(self.source, [self._position(name)])[0]

    def row(self, index: int) -> int:
        """1-based line of the file."""
        return self.source.header_line + 1 + index


@dataclass(frozen=True, slots=True)
class ParquetTable:
    """A Parquet file."""

    path: Path
    frame: pd.DataFrame

    @property
    def names(self) -> Sequence[str]:
        """Columns of the schema."""
        return [str(c) for c in self.frame.columns]

    def numbers(self, names: Sequence[str]) -> list[FloatArray]:
        """Columns as float64, with every one that holds no numbers named."""
        faults, values = [], []
        for name in names:
            if pd.api.types.is_datetime64_any_dtype(self.frame[name].dtype):
                fix = 'in a mapping: unit = "timestamp"'
                where = f"{self.path} column {name!r}"
                faults.append(Fault("not a number", where, f"{self.frame[name].dtype}", "numbers", fix))
                continue
            try:
                values.append(np.asarray(pd.to_numeric(self.frame[name]), dtype=np.float64))
            except (ValueError, TypeError) as error:
                where = f"{self.path} column {name!r}"
                faults.append(
                    Fault("not a number", where, f"{self.frame[name].dtype}: {error}"[:120], "numbers")
                )
        raise_faults(faults)
        return values

    def texts(self, name: str) -> list[str]:
        """One column as text; missing values are empty."""
        column = self.frame[name]
        return ["" if missing else str(value) for value, missing in zip(column, column.isna(), strict=True)]

    def row(self, index: int) -> int:
        """1-based row."""
        return index + 1


def open_table(path: Path, decimal: str = ".") -> TableFile:
    """A CSV or Parquet file as columns.

    Raises
    ------
    InvalidInput
        When it cannot be read in the format of its suffix.
    """
    if path.suffix.lower() != ".parquet":
        return CsvTable(path, open_delimited(path), decimal)
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        frame = pq.read_table(path).to_pandas()
    except (OSError, pa.ArrowException) as error:
        got = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise InvalidInput(Fault("unreadable Parquet file", f"{path}", got, "a Parquet file")) from error
    return ParquetTable(path, frame.reset_index(drop=True))


def table_files(path: Path) -> list[Path]:
    """A table itself, or the tables of a folder by name; hidden files, and notes beside tables, are none.

    Raises
    ------
    InvalidInput
        When there is none.
    """
    allowed = f"a file or a folder of files {', '.join(SUFFIXES)}"
    if not path.exists():
        raise InvalidInput(Fault("no such file or folder", f"{path}", "", allowed))
    if path.is_file():
        return [path]
    visible = (p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
    files = sorted(p for p in visible if p.suffix.lower() in SUFFIXES)
    files = [p for p in files if p.suffix.lower() != PROSE] or files
    if not files:
        raise InvalidInput(Fault("no trips", f"{path}", "no table", allowed))
    return files
