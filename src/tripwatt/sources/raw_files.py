"""Files of samples in their own units: the columns that a mapping names, not yet converted."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, by_key
from tripwatt.errors import Fault, InvalidInput, and_more, did_you_mean, raise_faults
from tripwatt.sources.clocks import EARLIEST_YEAR, LATEST_YEAR, clock_only, seconds_of
from tripwatt.sources.columnar import TableFile, open_table, stamp_texts
from tripwatt.sources.delimited import column_key, numbers_of
from tripwatt.sources.mapping import TIME_STAMPS, UNITS, ColumnMapping, MappedColumn
from tripwatt.sources.naming import unit_named
from tripwatt.trips import Flag
from tripwatt.trips.reading import FileReading

NEEDED: Final = ("time_s", "speed_m_s")
"""Columns that every file needs."""
_ZONE: Final = re.compile(r"\d(?:Z|z|[+-]\d{2}:?\d{2})$")
"""End of a time with a time zone, as in 08:15:00+02:00."""


@dataclass(eq=False)
class RawFile:
    """A file whose columns are read but not yet converted into logs.

    Attributes
    ----------
    path : Path
    kind : int
        Number of the file's `Kind`.
    mapping : ColumnMapping
    entries : dict of str to MappedColumn
        Our columns -> entries of the mapping, with the names of columns as the file spells them.
    values : dict of str to ndarray, shape (rows,)
        Our columns -> numbers in the units of the entries; the time is in seconds after `convert_times`. Empty if the file is left out.
    stamps : list of str
        Texts of the time stamps; empty if the time is a number.
    trips, vehicles, drivers : list of str or None
        Trip, vehicle and driver of each row; None if the file has no such column.
    faults, notes : list
        What could not be read as it stands, and what else was changed.
    rows, rows_used, logs : int
        Number of rows that are not empty, of rows used, and of logs made.
    stamped : bool
        Whether the time counts from 1970.
    covariates : dict of str to Series
        Numbers or words of each covariate of the mapping.
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
    covariates: dict[str, pd.Series[Any]] = field(default_factory=dict)
    table: TableFile | None = None

    def row(self, index: int) -> int:
        """Number of a sample's row as the user counts rows."""
        return index if self.table is None else self.table.row(index)

    def leave_out(self, faults: Iterable[Fault]) -> None:
        """Add faults and discard all values of the file."""
        self.faults += faults
        self.values = {}
        self.rows_used = 0

    @property
    def unread(self) -> list[str]:
        """Columns of the file that the mapping does not use."""
        mapping = self.mapping
        used: set[str | None] = {column for e in self.entries.values() for column in (e.column, e.date)}
        used |= {mapping.trip_column, mapping.vehicle_column, mapping.driver_column, ""}
        used |= {*mapping.covariates.values()}
        names = self.table.names if self.table is not None and mapping.long_name is None else ()
        return [name for name in names if name not in used]

    def reading(self, source: Path) -> FileReading:
        """Summary of what was read from the file, which was unpacked or is in the source that the user gave, or is it."""
        counts, folder = (self.rows, self.rows_used, self.logs), self.path.parent
        shown = folder if folder == source.parent else source
        faults = [replace(f, where=f.where.replace(f"{folder}", f"{shown}", 1)) for f in self.faults]
        return FileReading(self.path.name, *counts, tuple(faults), self.kind)


def open_raw_file(path: Path, mapping: ColumnMapping, names: Sequence[str], kind: int) -> RawFile:
    """Read the columns of a file that a mapping names, without conversion.

    Parameters
    ----------
    path : Path
    mapping : ColumnMapping
    names : sequence of str
        Header to use for a file without one; else empty.
    kind : int
        Number of the file's `Kind`.
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
        file.stamped = file.entries["time_s"].unit in TIME_STAMPS
    except InvalidInput as error:
        file.leave_out(error.faults)
    fix = f'add [file] decimal = "," to {mapping.source}'
    file.faults = [replace(f, fix=fix) if f.what == "decimal comma" else f for f in file.faults]
    return file


def _read_wide(file: RawFile, table: TableFile) -> None:
    time = file.entries["time_s"]
    if time.unit == "timestamp":
        file.stamps = stamp_texts(table, time.column, time.date)
    numbers = {ours: e for ours, e in file.entries.items() if ours != "time_s" or e.unit != "timestamp"}
    file.values = dict(zip(numbers, table.numbers([e.column for e in numbers.values()]), strict=True))
    keys = (file.mapping.trip_column, file.mapping.vehicle_column, file.mapping.driver_column)
    file.trips, file.vehicles, file.drivers = (table.texts(name) if name else None for name in keys)
    if file.trips is not None and file.vehicles is not None:
        pairs = zip(file.vehicles, file.trips, strict=True)
        file.trips = [f"{car}-{trip}" if trip else "" for car, trip in pairs]
    for name, column in file.mapping.covariates.items():
        texts = pd.Series(table.texts(column), dtype=object).replace("", None)
        numbers_of_texts = pd.to_numeric(texts, errors="coerce")
        is_numeric = numbers_of_texts.notna().sum() == texts.notna().sum()
        file.covariates[name] = numbers_of_texts if is_numeric else texts
    filled = [np.isfinite(column) for column in file.values.values()]
    filled += [np.array(file.stamps, dtype=object) != ""] if file.stamps else []
    file.rows = int(np.any(filled, axis=0).sum())


def _entries(file: RawFile, table: TableFile) -> dict[str, MappedColumn]:
    """Entries of the mapping with the names of columns as the file spells them: the exact name, else one of equal `column_key`.

    Raises
    ------
    InvalidInput
        When a column of time, speed, trip, vehicle, driver, signal or a covariate is missing; another missing column is a fault of the file.
    """
    mapping = file.mapping
    keyed = [mapping.trip_column, mapping.vehicle_column, mapping.driver_column]
    keyed += [mapping.long_name, mapping.long_value, *mapping.covariates.values()]
    needed = [_missing(table, name, mapping) for name in keyed if name and name not in table.names]
    keys = by_key(table.names, column_key)

    def spelled(column: str) -> str | None:
        names = [column] if column in table.names else keys.get(column_key(column), [])
        return names[0] if len(names) == 1 else None

    entries: dict[str, MappedColumn] = {}
    for ours, entry in mapping.columns.items():
        column, date = spelled(entry.column), spelled(entry.date) if entry.date else ""
        if mapping.long_name is not None and ours != "time_s":
            entries[ours] = entry
        elif column is not None and date is not None:
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
    """Read a file with a row for each value: the signals become columns on the union of their times."""
    mapping, time = file.mapping, file.entries["time_s"]
    as_text = time.unit == "timestamp"
    if as_text:
        raw_time: Any = np.array(stamp_texts(table, time.column, time.date), dtype=object)
    else:
        (raw_time,) = table.numbers([time.column])
    timed = raw_time != "" if as_text else np.isfinite(raw_time)
    unit_column = next((n for n in table.names if column_key(n) in ("units", "unit")), None)
    wanted = (mapping.long_name, mapping.long_value, unit_column, mapping.vehicle_column)
    columns = [table.texts(name) if name else [""] * len(timed) for name in wanted]
    signals, texts, units, vehicles = (np.array(column, dtype=object)[timed] for column in columns)
    times, first, index = np.unique(raw_time[timed], return_index=True, return_inverse=True)
    file.stamps, file.rows = (times.tolist() if as_text else []), len(times)
    file.values = {} if as_text else {"time_s": times}
    file.vehicles = vehicles[first].tolist() if mapping.vehicle_column else None
    for ours, entry in ((ours, entry) for ours, entry in mapping.columns.items() if ours != "time_s"):
        rows = np.flatnonzero(signals == entry.column)
        if not len(rows):
            present = sorted(set(signals.tolist()))
            got, fix = ", ".join(map(repr, present[:8])), did_you_mean(entry.column, present)
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
    """Set the unit of a column in files; if it differs from the mapping's, add a fault that says so."""
    for file in files:
        entry = file.entries[ours]
        if unit != entry.unit:
            where = f"{file.path} column {entry.column!r}"
            allowed = f"{entry.unit}, as in {file.mapping.source}"
            file.faults.append(Fault("unit differs from the mapping's", where, f"values in {unit}", allowed))
            file.entries[ours] = replace(entry, unit=unit)


def in_our_unit(file: RawFile, ours: str) -> FloatArray:
    """The values of a column, converted to our unit."""
    column = file.values[ours]
    factor, offset = UNITS[ours][file.entries[ours].unit]
    converted = column if factor == 1.0 and offset == 0.0 else column * factor + offset
    # 0 V from a battery that is switched off is no measurement
    return np.where(converted == 0.0, np.nan, converted) if ours == "voltage_v" else converted


def convert_times(file: RawFile) -> None:
    """Convert the time of a file to seconds, counted from 1970 if its time stamps have a day; invalid stamps are faults of the file."""
    entry = file.entries["time_s"]
    if entry.unit != "timestamp":
        factor = TIME_STAMPS[entry.unit] if entry.unit in TIME_STAMPS else UNITS["time_s"][entry.unit][0]
        file.values["time_s"] = file.values["time_s"] * factor
        return
    texts = pd.Series(file.stamps, dtype=object)
    time = file.values["time_s"] = seconds_of(texts, entry.format)
    file.stamped = not clock_only(entry.format)
    filled = (texts != "").to_numpy()
    bad = np.flatnonzero(np.isnan(time) & filled)
    if len(bad):
        allowed = f"a time like {entry.format}" if entry.format else "a time such as 2024-05-31T08:15:00"
        allowed += f", from {EARLIEST_YEAR} to {LATEST_YEAR}" if file.stamped else ""
        fix = "" if entry.format else 'give the format in the mapping: format = "%d.%m.%Y %H:%M:%S"'
        _add_fault(file, "invalid time", bad, repr(texts[int(bad[0])][:40]), allowed, fix)
    zoned = texts.str.contains(_ZONE).to_numpy(dtype=bool)
    if file.stamped and 0 < int((zoned & filled).sum()) < int(filled.sum()):
        minority = np.flatnonzero(filled & (zoned == (2 * (zoned & filled).sum() < filled.sum())))
        got = f"{texts[int(minority[0])][:40]!r}, {'with' if zoned[minority[0]] else 'without'} a time zone unlike most rows"
        _add_fault(file, "times with and without time zone", minority, got, "the same in every row")
        time[minority] = np.nan


def _add_fault(file: RawFile, what: str, rows: IntArray, got: str, allowed: str, fix: str = "") -> None:
    place = f"{file.path} row {file.row(int(rows[0]))} column {file.entries['time_s'].column!r}"
    file.faults.append(Fault(what, place, got + and_more(rows), allowed, fix, count=len(rows)))
