"""A file of samples in its own units: the columns that a mapping wants, as they stand in it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, by_key
from tripwatt.errors import Fault, InvalidInput, and_more, did_you_mean, raise_faults
from tripwatt.sources.clocks import EARLIEST_YEAR, LATEST_YEAR, clock_only, seconds_of
from tripwatt.sources.columnar import TableFile, open_table
from tripwatt.sources.delimited import column_key, numbers_of
from tripwatt.sources.mapping import TIME_STAMPS, UNITS, ColumnMapping, MappedColumn
from tripwatt.sources.naming import unit_named
from tripwatt.trips import Flag
from tripwatt.trips.reading import FileReading

NEEDED: Final = ("time_s", "speed_m_s")
"""Columns without which no file is used."""
_ZONE: Final = re.compile(r"\d(?:Z|z|[+-]\d{2}:?\d{2})$")
"""The end of a time with a time zone, as in 08:15:00+02:00."""


@dataclass(eq=False)
class RawFile:
    """A file on its way to logs.

    Attributes
    ----------
    path : Path
    kind : int
        Number of its kind.
    mapping : ColumnMapping
    entries : dict of str to MappedColumn
        Our columns, with the file's own spelling of theirs.
    values : dict of str to ndarray, shape (rows,)
        Numbers in the units of the entries, the time in seconds once `with_seconds` was called; empty for a file that is left out.
    stamps : list of str
        Text of the time stamps, empty for a time in numbers.
    trips, vehicles, drivers : list of str or None
        Of each row, where the file has columns of them.
    faults, notes : list
        What could not be read as it stands, and what else was changed.
    rows, rows_used, logs : int
    stamped : bool
        Whether the time counts since 1970.
    """

    path: Path
    kind: int
    mapping: ColumnMapping
    entries: dict[str, MappedColumn] = field(default_factory=dict)
    values: dict[str, FloatArray] = field(default_factory=dict)
    stamps: list[str] = field(default_factory=list)
    trips: list[str] | None = None
    drivers: list[str] | None = None
    vehicles: list[str] | None = None
    faults: list[Fault] = field(default_factory=list)
    notes: list[Flag] = field(default_factory=list)
    rows: int = 0
    rows_used: int = 0
    logs: int = 0
    stamped: bool = False
    table: TableFile | None = None

    def row(self, index: int) -> int:
        """Row of a sample as the user counts them."""
        return index if self.table is None else self.table.row(index)

    def leave_out(self, faults: Iterable[Fault]) -> None:
        """Use nothing of the file."""
        self.faults += faults
        self.values = {}
        self.rows_used = 0

    @property
    def reading(self) -> FileReading:
        """What was taken of it."""
        return FileReading(
            self.path.name, self.rows, self.rows_used, self.logs, tuple(self.faults), self.kind
        )


def opened(path: Path, mapping: ColumnMapping, names: Sequence[str], kind: int) -> RawFile:
    """The wanted columns of a file, as they stand in it.

    Parameters
    ----------
    path : Path
    mapping : ColumnMapping
    names : sequence of str
        Header of a file that has none.
    kind : int
    """
    file = RawFile(path, kind, mapping)
    try:
        table = file.table = open_table(path, mapping.decimal, names, file.faults)
        file.entries = _entries(file, table)
        if names:
            got = "the columns of another file are used"
            file.faults.append(Fault("no header", f"{path}", got, "names of columns in the first line"))
        if mapping.long_name is None:
            _read_wide(file, table)
        else:
            _read_long(file, table)
    except InvalidInput as error:
        file.leave_out(error.faults)
    fix = f'add [file] decimal = "," to {mapping.source}'
    file.faults = [replace(f, fix=fix) if f.what == "decimal comma" else f for f in file.faults]
    return file


def _read_wide(file: RawFile, table: TableFile) -> None:
    time = file.entries["time_s"]
    if time.unit == "timestamp":
        file.stamps = table.texts(time.column)
        if time.date:
            file.stamps = [
                f"{day} {clock}".strip()
                for day, clock in zip(table.texts(time.date), file.stamps, strict=True)
            ]
    numbers = {ours: e for ours, e in file.entries.items() if ours != "time_s" or e.unit != "timestamp"}
    file.values = dict(zip(numbers, table.numbers([e.column for e in numbers.values()]), strict=True))
    file.trips, file.vehicles = _trip_names(table, file.mapping)
    file.drivers = table.texts(file.mapping.driver_column) if file.mapping.driver_column else None
    filled = [np.isfinite(column) for column in file.values.values()]
    filled += [np.array(file.stamps, dtype=object) != ""] if file.stamps else []
    file.rows = int(np.any(filled, axis=0).sum())
    file.stamped = time.unit in TIME_STAMPS


def _trip_names(table: TableFile, mapping: ColumnMapping) -> tuple[list[str] | None, list[str] | None]:
    """The trip of each row, with its vehicle before it where both have a column, and the vehicle; None where a file is one trip."""
    trips = table.texts(mapping.trip_column) if mapping.trip_column else None
    if mapping.vehicle_column is None:
        return trips, None
    vehicles = table.texts(mapping.vehicle_column)
    if trips is not None:
        trips = [f"{car}-{trip}" if trip else "" for car, trip in zip(vehicles, trips, strict=True)]
    return trips, vehicles


def _entries(file: RawFile, table: TableFile) -> dict[str, MappedColumn]:
    """Entries with the file's own spelling of their columns. A name is matched exactly, else by `column_key`.

    Raises
    ------
    InvalidInput
        Without a column of time or speed; another column that is missing is a fault of the file.
    """
    mapping = file.mapping
    own = [getattr(mapping, f"{name}_column") for name in ("trip", "vehicle", "driver")]
    own += [mapping.long_name, mapping.long_value]
    needed = [_missing(table, n, mapping) for n in own if n and n not in table.names]
    keys = by_key(table.names, column_key)

    def spelled(column: str) -> str | None:
        alike = [column] if column in table.names else keys.get(column_key(column), [])
        return alike[0] if len(alike) == 1 else None

    entries: dict[str, MappedColumn] = {}
    for ours, entry in mapping.columns.items():
        if mapping.long_name is not None and ours != "time_s":
            entries[ours] = entry
            continue
        column, date = spelled(entry.column), spelled(entry.date) if entry.date else ""
        if column is not None and date is not None:
            entries[ours] = replace(entry, column=column, date=date)
        elif not entry.optional:
            faults = needed if ours in NEEDED else file.faults
            faults.append(_missing(table, entry.column if column is None else entry.date, mapping))
    raise_faults(needed)
    return entries


def _missing(table: TableFile, name: str, mapping: ColumnMapping) -> Fault:
    got = ", ".join(repr(n[:40]) for n in table.names[:8]) + (" ..." if len(table.names) > 8 else "")
    fix = f"{did_you_mean(name, table.names)} see {mapping.source}".strip()
    return Fault("missing column", f"{table.path}", got, f"a column {name!r}", fix)


def _read_long(file: RawFile, table: TableFile) -> None:
    """A file with a row for each value: the signals side by side on the union of their times."""
    mapping = file.mapping
    (raw_time,) = table.numbers([file.entries["time_s"].column])
    timed = np.isfinite(raw_time)
    unit_column = next((n for n in table.names if column_key(n) in ("units", "unit")), None)
    wanted = (mapping.long_name, mapping.long_value, unit_column)
    signals, texts, units = (
        np.array(table.texts(n) if n else [""] * len(timed), dtype=object)[timed] for n in wanted
    )
    times, index = np.unique(raw_time[timed], return_inverse=True)
    file.values, file.rows = {"time_s": times}, len(times)
    for ours, entry in file.mapping.columns.items():
        rows = np.flatnonzero(signals == entry.column)
        if ours == "time_s":
            continue
        if not len(rows):
            seen = sorted(set(signals.tolist()))
            got, fix = ", ".join(map(repr, seen[:8])), did_you_mean(entry.column, seen)
            fault = Fault("missing signal", f"{table.path}", got, f"a signal {entry.column!r}", fix)
            if ours in NEEDED:
                raise InvalidInput([fault])
            file.faults += [] if entry.optional else [fault]
            continue
        values, bad = numbers_of(texts[rows].tolist(), mapping.decimal)
        if bad:
            where = f"{table.path} signal {entry.column!r}"
            got = repr(texts[rows[bad[0]]][:40]) + and_more(bad)
            file.faults.append(Fault("not a number", where, got, "a number", count=len(bad)))
        file.values[ours] = np.full(len(times), np.nan)
        file.values[ours][index[rows]] = values
        stated = unit_named(ours, Counter(units[rows].tolist()).most_common(1)[0][0])
        if stated is not None and UNITS[ours][stated] != UNITS[ours][entry.unit]:
            use_unit([file], ours, stated)


def use_unit(files: Sequence[RawFile], ours: str, unit: str) -> None:
    """Read a column of files in another unit than that of the mapping."""
    for file in files:
        entry = file.entries[ours]
        where, allowed = f"{file.path} column {entry.column!r}", f"{entry.unit}, as in {file.mapping.source}"
        file.faults.append(Fault("unit differs from the mapping's", where, f"values in {unit}", allowed))
        file.entries[ours] = replace(entry, unit=unit)


def in_ours(file: RawFile, ours: str) -> FloatArray:
    """A column in our unit."""
    column, entry = file.values[ours], file.entries[ours]
    factor, offset = UNITS[ours][entry.unit]
    converted = column if factor == 1.0 and offset == 0.0 else column * factor + offset
    # a battery that is switched off reports 0 V: that is no measurement
    return np.where(converted == 0.0, np.nan, converted) if ours == "voltage_v" else converted


def with_seconds(file: RawFile) -> None:
    """Turn the time of a file into seconds, since 1970 where its stamps have a day; stamps that are none are faults of the file."""
    entry = file.entries["time_s"]
    if entry.unit != "timestamp":
        factor = TIME_STAMPS[entry.unit] if entry.unit in TIME_STAMPS else UNITS["time_s"][entry.unit][0]
        file.values["time_s"] = file.values["time_s"] * factor
        return
    texts = pd.Series(file.stamps, dtype=object)
    time = file.values["time_s"] = seconds_of(texts, entry.format)
    file.stamped = not clock_only(entry.format)
    given = (texts != "").to_numpy()
    bad = np.flatnonzero(np.isnan(time) & given)
    if len(bad):
        allowed = f"a time like {entry.format}" if entry.format else "a time such as 2024-05-31T08:15:00"
        allowed += f", from {EARLIEST_YEAR} to {LATEST_YEAR}" if file.stamped else ""
        fix = "" if entry.format else 'give the format in the mapping: format = "%d.%m.%Y %H:%M:%S"'
        _add_fault(file, "invalid time", bad, repr(texts[int(bad[0])][:40]), allowed, fix)
    zoned = texts.str.contains(_ZONE).to_numpy(dtype=bool)
    if file.stamped and 0 < int((zoned & given).sum()) < int(given.sum()):
        few = np.flatnonzero(given & (zoned == (2 * (zoned & given).sum() < given.sum())))
        got = f"{texts[int(few[0])][:40]!r}, {'with' if zoned[few[0]] else 'without'} a time zone unlike most rows"
        _add_fault(file, "times with and without time zone", few, got, "the same in every row")
        time[few] = np.nan


def _add_fault(file: RawFile, what: str, rows: IntArray, got: str, allowed: str, fix: str = "") -> None:
    place = f"{file.path} row {file.row(int(rows[0]))} column {file.entries['time_s'].column!r}"
    file.faults.append(Fault(what, place, got + and_more(rows), allowed, fix, count=len(rows)))
