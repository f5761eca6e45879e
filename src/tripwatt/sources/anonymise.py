"""Anonymised copies of logs: everything that identifies a person, a car or a place is removed, and what a reader needs is kept.

Rows, faults and delimiters are kept, so that a copy causes the same faults when it is read.
"""

from __future__ import annotations

import datetime as dt
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tripwatt.errors import InvalidInput
from tripwatt.sources.archives import unpacked
from tripwatt.sources.clocks import FIRST_LOGGERS_S
from tripwatt.sources.columnar import open_table, table_files
from tripwatt.sources.delimited import NULL_TEXTS, cells_of, column_key, line_of, open_delimited
from tripwatt.sources.kinds import Kind, given_kind, natural, proposed_kinds
from tripwatt.sources.mapping import TIME_STAMPS, ColumnMapping, MappedColumn
from tripwatt.sources.naming import words
from tripwatt.sources.scales import ODOMETER, PLACES
from tripwatt.units import SECONDS_PER_DAY

_NUMBER: Final = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d{1,3})?")
_UNIT: Final = re.compile(r"[^\W\d]{0,4}[/%°]?[^\W\d]{0,4}")
_CLOCK: Final = re.compile(r"[\d:.,]+( ?[AaPp][Mm])?")
_KEPT: Final = {"units": _UNIT, "position": re.compile(r"[-\d., °NSEW]+")}
"""Form of the texts that are kept, by the role of their column."""
HIDDEN: Final = "x"
"""Replacement of a text that is hidden."""


@dataclass
class _Hiding:
    """Shift of times and replacements of names that all files of one call share."""

    days: int
    positions: bool
    names: dict[str, str] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)

    def column(self, name: str) -> str:
        """The replacement of a column's name; equal names have equal replacements."""
        return self.columns.setdefault(column_key(name), f"column {len(self.columns) + 1}") if name else ""

    def name(self, text: str) -> str:
        """The replacement of a trip's or a vehicle's name; equal names have equal replacements."""
        return self.names.setdefault(text, f"{len(self.names) + 1}") if text else ""


def anonymise_logs(
    path: Path | str, out: Path | str, *, mapping: Path | str | None = None, positions: bool = False
) -> list[Path]:
    """Write anonymous copies of logs: only the numbers of the columns that a reader uses, and shifted times.

    All times are shifted by the same random number of weeks, which is not stored. An odometer starts at 0. Files, trips and vehicles
    get numbers as names. In every other column the cells are empty and the name is replaced.

    Parameters
    ----------
    path : path
        As for `read_logs`.
    out : path
        New or empty folder.
    mapping : path or str, optional
        As for `read_logs`.
    positions : bool
        Keep columns of latitude and longitude.

    Returns
    -------
    list of Path
        The written files.

    Raises
    ------
    InvalidInput
        When there is no table, or `out` is in use.

    Examples
    --------
    >>> anonymise_logs("nowhere", "shared")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: no such file or folder: nowhere...
    """
    folder = Path(out)
    with unpacked(path) as place:
        kinds = proposed_kinds(place) if mapping is None else [given_kind(place, mapping)]
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InvalidInput.of("folder in use", f"{folder}", "not empty", "a new or empty folder")
        folder.mkdir(parents=True, exist_ok=True)
        hiding = _Hiding(7 * (1 + secrets.randbelow(520)), positions)  # up to ten years
        written = []
        of_file = {file: (kind, names) for kind in kinds for file, names in kind.files.items()}
        for number, file in enumerate(sorted(table_files(place), key=natural), start=1):
            kind, names = of_file.get(file, (Kind({}, ()), ()))
            target = folder / f"log_{number:04d}.csv"
            target.write_bytes(_hidden(file, kind, names, hiding))
            written.append(target)
    return written


def _hidden(file: Path, kind: Kind, names: tuple[str, ...], hiding: _Hiding) -> bytes:
    """The anonymised content of a file; empty if the file cannot be read."""
    if kind.mapping is None:
        return b""
    if file.suffix.lower() == ".parquet":
        table = open_table(file, faults=[])
        columns = [table.texts(name) for name in table.names]
        content = b"\n".join(line_of(row, ",") for row in [list(table.names), *zip(*columns, strict=True)])
        source = open_delimited(file, content + b"\n")
    else:
        source = open_delimited(file, names=names)
    hidden = _HiddenFile(kind.mapping, hiding)
    head = source.data[: source.body_offset].split(b"\n")[:-1]
    header_keys = {column_key(name) for name in source.names if name}
    current: Sequence[str] = source.names
    lines = []
    for number, raw in enumerate([*head, *source.data[source.body_offset :].split(b"\n")]):
        cells = cells_of(raw, source.delimiter)
        if (
            raw.strip()
            and 2 * len(header_keys & {column_key(cell) for cell in cells}) >= len(header_keys) > 0
        ):
            current = cells
            cells = [name if hidden.role(name) else hiding.column(name) for name in cells]
        elif number < len(head):
            is_units = source.units and number == len(head) - 1
            cells = [cell if is_units and _UNIT.fullmatch(cell) else HIDDEN if cell else "" for cell in cells]
        else:
            cells = hidden.row(cells, current)
        lines.append(line_of(cells, source.delimiter) if raw.strip() else b"")
    return b"\n".join(lines)


@dataclass
class _HiddenFile:
    """Anonymises the rows of one file."""

    mapping: ColumnMapping
    hiding: _Hiding
    roles: dict[str, str] = field(default_factory=dict)
    first_km: dict[str, float] = field(default_factory=dict)

    def role(self, name: str) -> str:
        """The role of a column: the name of one of ours, date, trip, vehicle, signal, value, units, position or odometer; else empty."""
        if name not in self.roles:
            self.roles[name] = _role(name, self.mapping, positions=self.hiding.positions)
        return self.roles[name]

    def row(self, cells: Sequence[str], names: Sequence[str]) -> list[str]:
        """The anonymised cells of a row; `names` is the header of the row."""
        signal = dict(zip(names, cells, strict=False)).get(self.mapping.long_name or "", "")
        shown = [self.cell(cell, name, signal) for cell, name in zip(cells, names, strict=False)]
        shown += [HIDDEN * bool(cell) for cell in cells[len(names) :]]
        clocks = (self.role(name) in ("time_s", "date") for name in names)
        if any(cell == HIDDEN and is_clock for cell, is_clock in zip(shown, clocks, strict=False)):
            # a row without a time may hold anything in any column
            return [HIDDEN if cell == HIDDEN else "" for cell in shown]
        return shown

    def cell(self, text: str, name: str, signal: str) -> str:
        """An anonymised cell of a column; `signal` is the signal of the row if the file has a row for each value, else empty."""
        role, time = self.role(name), self.mapping.columns["time_s"]
        if not role or text in NULL_TEXTS:
            return text if role else ""
        if role in ("trip", "vehicle"):
            return self.hiding.name(text)
        if role in ("signal", "value"):
            known = {entry.column for ours, entry in self.mapping.columns.items() if ours != "time_s"}
            if signal not in known:
                return HIDDEN if role == "signal" else ""
            if role == "signal":
                return text
        if time.unit == "timestamp" and role in ("date", "time_s") and not (role == "time_s" and time.date):
            form = time.format.partition(" ")[0] if role == "date" else time.format
            return _shifted(text, form, self.hiding.days)
        if role in _KEPT or (role == "time_s" and time.date):
            return text if _KEPT.get(role, _CLOCK).fullmatch(text) else HIDDEN
        if not _NUMBER.fullmatch(text):
            return HIDDEN
        if role == "odometer":
            value = float(text.replace(",", "."))
            return f"{value - self.first_km.setdefault(name, value):.3f}"
        return _later(text, time, self.hiding.days) if role == "time_s" else text


def _role(name: str, mapping: ColumnMapping, *, positions: bool) -> str:
    key = column_key(name)
    for ours, entry in mapping.columns.items():
        if key == column_key(entry.column) and (mapping.long_name is None or ours == "time_s"):
            return ours
        if entry.date and key == column_key(entry.date):
            return "date"
    special_columns = {
        "trip": mapping.trip_column,
        "vehicle": mapping.vehicle_column,
        "signal": mapping.long_name,
        "value": mapping.long_value,
    }
    role = next(
        (role for role, column in special_columns.items() if column and key == column_key(column)), ""
    )
    if role or not name:
        return role
    if any(form.search(words(name)) for form in PLACES):
        return "position" if positions else ""
    if mapping.long_name is not None and key in ("unit", "units"):
        return "units"
    return "odometer" if ODOMETER.search(words(name)) else ""


def _later(text: str, entry: MappedColumn, days: int) -> str:
    """A numeric time, shifted by `days` if it counts from 1970 and its clock was set."""
    scale = TIME_STAMPS.get(entry.unit)
    value = float(text.replace(",", "."))
    if scale is None or value * scale < FIRST_LOGGERS_S:
        return text
    moved = value + days * SECONDS_PER_DAY / scale
    return f"{moved:.0f}" if text.isdigit() else f"{moved:.6f}"


def _shifted(text: str, form: str, days: int) -> str:
    """A time stamp shifted by `days`; a time of day, or a time of a clock that was not set, is kept."""
    try:
        stamp = dt.datetime.strptime(text, form) if form else dt.datetime.fromisoformat(text)
    except ValueError:
        return HIDDEN
    if "%d" not in form and form:
        return text
    if stamp.year < dt.datetime.fromtimestamp(FIRST_LOGGERS_S, dt.UTC).year + 1:
        return text
    moved = stamp + dt.timedelta(days=days)
    return moved.strftime(form) if form else moved.isoformat(sep="T" if "T" in text else " ")
