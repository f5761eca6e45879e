"""Logs that can be handed on: what a reader needs stays, everything by which a person, a car or a place is known goes.

Rows, faults and delimiters stay as they are, so that a fault of reading is still there.
"""

from __future__ import annotations

import datetime as dt
import re
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tripwatt.errors import InvalidInput
from tripwatt.sources.archives import unpacked
from tripwatt.sources.clocks import FIRST_LOGGERS_S
from tripwatt.sources.columnar import open_table, table_files
from tripwatt.sources.delimited import NULL_TEXTS, column_key, decode, fields_of, line_of, open_delimited
from tripwatt.sources.kinds import Kind, given_kind, natural, proposed_kinds
from tripwatt.sources.mapping import TIME_STAMPS, ColumnMapping, MappedColumn
from tripwatt.sources.naming import words
from tripwatt.sources.scales import ODOMETER, PLACES
from tripwatt.units import SECONDS_PER_DAY

MOST_WEEKS: Final = 520
_NUMBER: Final = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d{1,3})?")
_UNIT: Final = re.compile(r"[^\W\d]{0,4}[/%°]?[^\W\d]{0,4}")
HIDDEN: Final = "x"
"""Stands for a text that is no number."""


@dataclass
class _Hiding:
    """What all files of one call have in common."""

    days: int
    positions: bool
    names: dict[str, str] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)

    def column(self, name: str) -> str:
        """Another name for a column, the same for the same name."""
        return self.columns.setdefault(column_key(name), f"column {len(self.columns) + 1}") if name else ""

    def name(self, text: str) -> str:
        """Another name for a trip or a vehicle, the same for the same text."""
        return self.names.setdefault(text, f"{len(self.names) + 1}") if text else ""


def anonymise_logs(
    path: Path | str, out: Path | str, *, mapping: Path | str | None = None, positions: bool = False
) -> list[Path]:
    """Write logs without what tells whose they are: numbers of the columns that a reader uses, and shifted times.

    All times move by the same number of weeks, which nobody is told; an odometer starts at 0; files, trips and vehicles get numbers;
    cells and names of every other column are empty.

    Parameters
    ----------
    path : path
        As of `read_logs`.
    out : path
        New or empty folder.
    mapping : path or str, optional
        As of `read_logs`.
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
        hiding = _Hiding(7 * (1 + secrets.randbelow(MOST_WEEKS)), positions)
        written = []
        of_file = {file: (kind, names) for kind in kinds for file, names in kind.files.items()}
        for number, file in enumerate(sorted(table_files(place), key=natural), start=1):
            kind, names = of_file.get(file, (Kind({}, ()), ()))
            target = folder / f"log_{number:04d}.csv"
            target.write_bytes(_hidden(file, kind, names, hiding))
            written.append(target)
    return written


def _hidden(file: Path, kind: Kind, names: tuple[str, ...], hiding: _Hiding) -> bytes:
    """The content of a file without what has to go; nothing of one that cannot be read."""
    if kind.mapping is None:
        return b""
    if file.suffix.lower() == ".parquet":
        table = open_table(file, faults=[])
        columns = [table.texts(name) for name in table.names]
        content = b"\n".join(line_of(row, ",") for row in [list(table.names), *zip(*columns, strict=True)])
        source = open_delimited(file, content + b"\n")
    else:
        source = open_delimited(file, names=names)
    formats = _formats(kind.mapping)
    head = source.data[: source.body_offset].split(b"\n")[:-1]
    own = {column_key(name) for name in source.names if name}
    current: Sequence[str] = source.names
    first_km: dict[str, float] = {}
    clocks = {name for name in source.names if _role(name, kind.mapping, hiding) in ("time_s", "date")}
    lines = []
    for number, raw in enumerate([*head, *source.data[source.body_offset :].split(b"\n")]):
        text = decode(raw).strip("\r")
        cells = [cell.strip() for cell in fields_of(text, source.delimiter)]
        if text.strip() and 2 * len(own & {column_key(cell) for cell in cells}) >= len(own) > 0:
            current = cells
            cells = [
                name if _role(name, kind.mapping, hiding) else hiding.column(name)
                for k, name in enumerate(cells)
            ]
        elif number < len(head):
            is_units = source.units and number == len(head) - 1
            cells = [cell if is_units and _UNIT.fullmatch(cell) else HIDDEN if cell else "" for cell in cells]
        else:
            row = dict(zip(current, cells, strict=False))
            cells = [
                _cell(cell, current[k], row, kind.mapping, formats, first_km, hiding)
                if k < len(current)
                else HIDDEN * bool(cell)
                for k, cell in enumerate(cells)
            ]
            if any(cell == HIDDEN and name in clocks for cell, name in zip(cells, current, strict=False)):
                # a row without a time may hold anything in any column
                cells = [HIDDEN if cell == HIDDEN else "" for cell in cells]
        lines.append(line_of(cells, source.delimiter) if text.strip() else b"")
    return b"\n".join(lines)


def _role(name: str, mapping: ColumnMapping, hiding: _Hiding) -> str:
    """What a column is: one of ours, the day of the time, a trip, a vehicle, a signal, a value, positions or an odometer; else empty."""
    key = column_key(name)
    for ours, entry in mapping.columns.items():
        if key == column_key(entry.column) and (mapping.long_name is None or ours == "time_s"):
            return ours
        if entry.date and key == column_key(entry.date):
            return "date"
    own = {
        "trip": mapping.trip_column,
        "vehicle": mapping.vehicle_column,
        "signal": mapping.long_name,
        "value": mapping.long_value,
    }
    role = next((role for role, column in own.items() if column and key == column_key(column)), "")
    if role or not name:
        return role
    if any(form.search(words(name)) for form in PLACES):
        return "position" if hiding.positions else ""
    if mapping.long_name is not None and key in ("unit", "units"):
        return "units"
    return "odometer" if ODOMETER.search(words(name)) else ""


def _formats(mapping: ColumnMapping) -> Mapping[str, str]:
    """Formats of the texts of time and day."""
    entry = mapping.columns["time_s"]
    if entry.unit != "timestamp":
        return {}
    day, _, clock = entry.format.partition(" ") if entry.date else ("", "", entry.format)
    return {"date": day, "time_s": clock}


def _cell(
    text: str,
    name: str,
    row: Mapping[str, str],
    mapping: ColumnMapping,
    formats: Mapping[str, str],
    first_km: dict[str, float],
    hiding: _Hiding,
) -> str:
    role = _role(name, mapping, hiding)
    if not role or text in NULL_TEXTS:
        return text if role else ""
    if role in ("trip", "vehicle"):
        return hiding.name(text)
    if role == "units":
        return text if _UNIT.fullmatch(text) else HIDDEN
    signals = {entry.column for ours, entry in mapping.columns.items() if ours != "time_s"}
    if role == "signal":
        return text if text in signals else HIDDEN
    if role == "value" and row.get(mapping.long_name or "") not in signals:
        return ""
    if role in formats and not (role == "time_s" and mapping.columns["time_s"].date):
        return _shifted(text, formats[role], hiding.days)
    if role == "time_s" and mapping.columns["time_s"].date:
        return text if re.fullmatch(r"[\d:.,]+( ?[AaPp][Mm])?", text) else HIDDEN
    if role == "position":
        return text if re.fullmatch(r"[-\d., °NSEW]+", text) else HIDDEN
    if not _NUMBER.fullmatch(text):
        return HIDDEN
    if role == "odometer":
        value = float(text.replace(",", "."))
        return f"{value - first_km.setdefault(name, value):.3f}"
    if role == "time_s":
        return _later(text, mapping.columns["time_s"], hiding.days)
    return text


def _later(text: str, entry: MappedColumn, days: int) -> str:
    """A time in numbers; one that counts since 1970 moves, unless its clock was not set."""
    scale = TIME_STAMPS.get(entry.unit)
    value = float(text.replace(",", "."))
    if scale is None or value * scale < FIRST_LOGGERS_S:
        return text
    moved = value + days * SECONDS_PER_DAY / scale
    return f"{moved:.0f}" if text.isdigit() else f"{moved:.6f}"


def _shifted(text: str, form: str, days: int) -> str:
    """A time stamp so many days later; a clock that was not set stays."""
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
