"""Reader of the TUM BMW i3 data set: 70 trips of one car around Munich, a CSV file for each trip and a sheet with their context.

M. Steinstraeter, J. Buberger, D. Trifonov, "Battery and Heating Data in Real Driving Cycles", IEEE DataPort, 2020,
doi 10.21227/6jr9-5235, CC BY 4.0. The raw files are 10 Hz, semicolon separated and latin-1; re-saved copies (comma,
UTF-8, 1 s) are read as well. Season, weather, departure, set-point and payload come from the sheet, and only these: its states of charge, distances
and durations are partly wrong.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import pandas as pd

from tripwatt.arrays import number_in
from tripwatt.containers import INSIDE, LIMITS, Budget
from tripwatt.errors import Fault, InvalidInput, system_errors
from tripwatt.files import read_file
from tripwatt.sources.delimited import column_key
from tripwatt.sources.public import read_folder, read_public, require_folder
from tripwatt.sources.workbooks import read_workbook
from tripwatt.trips import (
    COLUMNS,
    REQUIRED_COLUMNS,
    Context,
    Flag,
    Log,
    TripSet,
    raise_faults,
    structure_faults,
)
from tripwatt.trips.elevation import elevation_over_distance
from tripwatt.trips.reading import FileReading, ReadingReport

CITATION: Final = (
    'M. Steinstraeter, J. Buberger, D. Trifonov, "Battery and Heating Data in Real Driving Cycles", '
    "IEEE DataPort, 2020, https://doi.org/10.21227/6jr9-5235, licensed under CC BY 4.0"
)
OVERVIEW_NAME: Final = "Overview.xlsx"


_PUBLISHED: Final = (*(f"A{i:02d}" for i in range(1, 33)), *(f"B{i:02d}" for i in range(1, 39)))
_ABSENT_FROM_REFERENCE: Final = tuple(f"B{i:02d}" for i in (1, 2, 4, 7, 8, 9, 10, 12, 14, 15, 34, 36))

REFERENCE_TRIPS: Final[Mapping[str, float | None]] = {
    f"Trip{short}": 1203.9 if short == "B28" else None
    for short in _PUBLISHED
    if short not in _ABSENT_FROM_REFERENCE
}
"""The 58 trips on which tripwatt is compared with other systems: id -> time [s] at which the trip ends, None for its own
end. arXiv:2405.10984 scores 72 trips of the set, which it does not name."""


def read_tum(folder: Path | str, *, strict: bool = False) -> TripSet:
    """Read a folder of `TripA*.csv` and `TripB*.csv`, with `Overview.xlsx` for their context.

    Parameters
    ----------
    folder : path
    strict : bool
        Refuse everything that cannot be read as it stands.

    Returns
    -------
    TripSet
        Raw trips in the order of their ids. Without the sheet, season and weather are None and `notes` says so. `report` lists
        what is left out.

    Raises
    ------
    InvalidInput
        When no trip can be read; with `strict`, with every fault of the folder, of all its files and of the sheet.

    Examples
    --------
    >>> read_tum("no/such/folder")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: no such folder: no/such/folder: allowed: a folder with TripA*.csv and TripB*.csv; ...
    """
    folder = Path(folder)
    files, notes = _trip_files(folder)
    faults: list[Fault] = []
    contexts: Mapping[str, Context] = {}
    try:
        contexts, overview_notes = read_overview(folder / OVERVIEW_NAME, tuple(files))
        notes += overview_notes
    except InvalidInput as error:
        faults += error.faults

    def read_one(trip_id: str, path: Path, file_faults: list[Fault]) -> Log:
        return _read_file(trip_id, path, contexts.get(trip_id), file_faults)

    logs, readings = read_folder(read_one, files, strict=strict, faults=faults)
    if faults:
        readings.append(FileReading(OVERVIEW_NAME, faults=tuple(faults)))
    report = ReadingReport(tuple(readings))
    return TripSet("tum", tuple(logs.values()), tuple(notes), REFERENCE_TRIPS, CITATION, report)


def _trip_files(folder: Path) -> tuple[dict[str, Path], list[Flag]]:
    """The trip files of a folder by trip id, and a note on the number of its other CSV files.

    Raises
    ------
    InvalidInput
        When the folder does not exist, holds no trip, or has two files of the same trip.
    """
    allowed = "a folder with TripA*.csv and TripB*.csv"
    get_it = "get the data from https://doi.org/10.21227/6jr9-5235"
    require_folder(folder, allowed, get_it)
    with system_errors("cannot read the folder", f"{folder}", allowed):
        csv_files = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".csv" and p.is_file())
    files: dict[str, Path] = {}
    faults: list[Fault] = []
    for path in csv_files:
        match = re.fullmatch(r"trip([ab]\d{2,3})(?!\d).*\.csv", path.name, re.IGNORECASE)
        if match is None:
            continue
        trip_id = f"Trip{match[1].upper()}"
        if trip_id in files:
            got = f"{files[trip_id].name} and {path.name}"
            faults.append(Fault("two files of one trip", f"{folder}", got, "one file"))
        files.setdefault(trip_id, path)
    if not files:
        below = sorted({p.parent for p in folder.glob("*/[Tt]rip[ABab]*.csv")})
        got = f"{len(csv_files)} CSV files, none named like a trip"
        if below:
            get_it = f"give {below[0]}"
        elif csv_files:
            get_it += (
                f"; for tables of your own, `tripwatt mapping suggest {folder}` writes what --mapping needs"
            )
        faults.append(Fault("no trips", f"{folder}", got, allowed, get_it))
    raise_faults(faults)
    others = len(csv_files) - len(files)
    return files, ([Flag("files_not_read", "CSV files", float(others), "1")] if others else [])


def _read_file(trip_id: str, path: Path, context: Context | None, faults: list[Fault]) -> Log:
    """Read one trip file as a log, with its elevation interpolated over distance; cells that cannot be read are appended to `faults`."""
    needed = (*REQUIRED_COLUMNS, "voltage_v", "current_a")  # without them there is no observed energy
    _, columns = read_public(path, "tum", needed, faults)
    samples = pd.DataFrame({ours: columns[ours] for ours in COLUMNS if ours in columns}, copy=False)
    raise_faults(structure_faults(samples, str(path)))
    if "elevation_m" in samples:
        time, speed, height = (samples[c].to_numpy() for c in ("time_s", "speed_m_s", "elevation_m"))
        samples["elevation_m"] = elevation_over_distance(time, speed, height)
    return Log.from_samples(trip_id, samples, context)


_MAX_SHEET_BYTES: Final = 1 << 26
"""Largest workbook [bytes], also when inflated; that of the data set has 25 kB."""
_MAX_ROWS, _MAX_COLUMNS = 10_000, 200


def read_overview(path: Path, trip_ids: Sequence[str]) -> tuple[dict[str, Context], list[Flag]]:
    """Read the context of each trip from the sheet; return contexts by trip id, and notes on the sheet.

    If the sheet or a trip in it is missing, there is a note, and season and weather are unknown.

    Raises
    ------
    InvalidInput
        When the sheet exists but cannot be read or has no column of trip ids.
    """
    if not path.exists():
        return {}, [Flag("sheet_missing", path.name)]
    rows: dict[str, Mapping[str, object]] = {}
    for row in _sheet_rows(path):
        match = re.fullmatch(r"trip([ab]\d{2,3})", _text(row.get("trip")), re.IGNORECASE)
        if match is not None:
            rows.setdefault(f"Trip{match[1].upper()}", row)
    contexts = {trip_id: _context(trip_id, rows[trip_id]) for trip_id in trip_ids if trip_id in rows}
    notes = []
    absent = [trip_id for trip_id in trip_ids if trip_id not in rows]
    if absent:
        notes.append(Flag("sheet_row_missing", ", ".join(absent), path.name))
    departures: dict[dt.datetime, str] = {}
    for trip_id, context in contexts.items():
        departure = context.started_at
        if departure is not None and departures.setdefault(departure, trip_id) != trip_id:
            notes.append(Flag("same_departure", f"{departures[departure]} and {trip_id}", path.name))
    return contexts, notes


def _sheet_rows(path: Path) -> list[Mapping[str, object]]:
    """Rows of the first sheet with a column `Trip`: cells by the `column_key` of their header without its unit."""
    fix = "fetch it again, or remove it to read the trips without season and weather"

    def rows_of(rows: Iterator[list[object]]) -> list[list[object]]:
        return [row[:_MAX_COLUMNS] for row in itertools.islice(rows, _MAX_ROWS)]

    data = read_file(path, _MAX_SHEET_BYTES)
    tables = read_workbook(data, rows_of, Budget(f"{path}", {**LIMITS, INSIDE: _MAX_SHEET_BYTES}), fix)
    for _, table in tables:
        for number, cells in enumerate(table[:10]):
            names = [re.sub(r"\s*\[.*", "", column_key(_text(cell))) for cell in cells]
            if "trip" in names:
                rows = (zip(names, row, strict=False) for row in table[number + 1 :])
                return [{name: cell for name, cell in row if name} for row in rows]
    got, allowed = "no header with a column 'Trip'", "one row per trip under the heading 'Trip'"
    raise InvalidInput.of("missing column", f"{path}", got, allowed, fix)


def _context(trip_id: str, row: Mapping[str, object]) -> Context:
    """The context of a trip; a cell that cannot be read counts as unknown."""
    remarks = "; ".join(t for t in (_text(row.get("fan")), _text(row.get("note"))) if t)
    masses = re.findall(r"\+\s*(\d+(?:[.,]\d+)?)\s*kg", remarks, re.IGNORECASE)
    setpoint = number_in(_text(row.get("target cabin temperature")).replace(",", "."))
    return Context(
        season={"A": "summer", "B": "winter"}[trip_id[4]],  # the two measurement campaigns
        weather=_text(row.get("weather")).lower() or None,
        started_at=_departure(row.get("date")),
        route=_text(row.get("route/area")) or None,
        # 10 to 40 °C is what a car's climate control offers, with a margin
        cabin_setpoint_degc=setpoint if 10.0 <= setpoint <= 40.0 else None,
        payload_mass_kg=sum((float(mass.replace(",", ".")) for mass in masses), start=0.0),
        follows_trip="directly after previous trip" in remarks.lower(),
        remarks=remarks,
    )


def _departure(cell: object) -> dt.datetime | None:
    if isinstance(cell, dt.datetime):
        return cell.replace(tzinfo=None)
    # 2019-06-25_13-21-14 and 2019_12_08_09-38-26 both occur
    with contextlib.suppress(ValueError):
        return dt.datetime.strptime(re.sub(r"[^0-9]+", "-", _text(cell)), "%Y-%m-%d-%H-%M-%S")
    return None


def _text(cell: object) -> str:
    return "" if cell is None else " ".join(str(cell).split())
