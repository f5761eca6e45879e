"""Reader of the TUM BMW i3 data set: 70 trips of one car around Munich, a CSV file for each trip and a sheet with their context.

M. Steinstraeter, J. Buberger, D. Trifonov, "Battery and Heating Data in Real Driving Cycles", IEEE DataPort, 2020,
doi 10.21227/6jr9-5235, CC BY 4.0. The raw files are 10 Hz, semicolon separated and latin-1; re-saved copies (comma,
UTF-8, 1 s) are read as well. State of charge, distance and duration come from the logs, never from the sheet.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import pandas as pd

from tripwatt.arrays import by_key
from tripwatt.errors import Fault, InvalidInput, system_errors
from tripwatt.files import file_head
from tripwatt.sources.columnar import csv_table, read_folder, require_folder
from tripwatt.sources.delimited import Delimited, RawColumn, column_key, open_delimited, raw_columns
from tripwatt.sources.tum_overview import read_overview
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


NEEDED_COLUMNS: Final = (*REQUIRED_COLUMNS, "voltage_v", "current_a")
"""Columns that a file needs; without them there is no observed energy, and the file is refused."""

_TRIP_FILE: Final = re.compile(r"trip([ab]\d{2,3})(?!\d).*\.csv", re.IGNORECASE)
_PUBLISHED: Final = (*(f"A{i:02d}" for i in range(1, 33)), *(f"B{i:02d}" for i in range(1, 39)))
_ABSENT_FROM_REFERENCE: Final = tuple(f"B{i:02d}" for i in (1, 2, 4, 7, 8, 9, 10, 12, 14, 15, 34, 36))

REFERENCE_TRIPS: Final[Mapping[str, float | None]] = {
    f"Trip{short}": 1203.9 if short == "B28" else None
    for short in _PUBLISHED
    if short not in _ABSENT_FROM_REFERENCE
}
"""The 58 trips on which tripwatt is compared with other systems: id -> time [s] at which the trip ends, None for its own
end. arXiv:2405.10984 scores 72 trips of the set, which it does not name."""

ALL_TRIP_IDS: Final = tuple(f"Trip{short}" for short in _PUBLISHED)
"""The 70 trips that were published."""


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
    files, notes = trip_files(folder)
    faults: list[Fault] = []
    contexts: Mapping[str, Context] = {}
    try:
        contexts, overview_notes = read_overview(folder / OVERVIEW_NAME, tuple(files))
        notes += overview_notes
    except InvalidInput as error:
        faults += error.faults

    def read_one(trip_id: str, path: Path, kept: list[Fault]) -> Log:
        return read_tum_file(path, trip_id, contexts.get(trip_id), kept)

    logs, readings = read_folder(read_one, files, strict=strict, faults=faults)
    if faults:
        readings.append(FileReading(OVERVIEW_NAME, faults=tuple(faults)))
    report = ReadingReport(tuple(readings))
    return TripSet("tum", tuple(logs.values()), tuple(notes), REFERENCE_TRIPS, CITATION, report)


def trip_files(folder: Path) -> tuple[dict[str, Path], list[Flag]]:
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
        match = _TRIP_FILE.fullmatch(path.name)
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


def is_tum_log(path: Path) -> bool:
    """Whether the first line of a CSV file has the columns of time and speed of the TUM set; False if it cannot be read."""
    if path.suffix.lower() != ".csv":
        return False
    head = file_head(path).decode("latin-1")
    names = {column_key(name) for name in re.split(r"[;,\t]", head.splitlines()[0])} if head else set()
    return {column_key("Time [s]"), column_key("Velocity [km/h]")} <= names


def read_tum_file(
    path: Path, trip_id: str, context: Context | None = None, faults: list[Fault] | None = None
) -> Log:
    """Read one trip file as a log, with its elevation interpolated over distance. See `read_tum`.

    Cells that cannot be read are faults. They are appended to `faults` if it is given, else they are raised.

    Raises
    ------
    InvalidInput
        With every fault of the file.
    """
    source = open_delimited(path)
    chosen = _choose(source)
    table = csv_table(source, [] if faults is None else faults)
    columns = zip(chosen.values(), table.numbers([*chosen]), strict=True)
    samples = pd.DataFrame(
        {raw.ours: column if raw.factor == 1.0 else column * raw.factor for raw, column in columns},
        copy=False,
    )
    raise_faults(table.faults if faults is None else ())
    raise_faults(structure_faults(samples, str(path)))
    if "elevation_m" in samples:
        time, speed, height = (samples[c].to_numpy() for c in ("time_s", "speed_m_s", "elevation_m"))
        samples["elevation_m"] = elevation_over_distance(time, speed, height)
    return Log.from_samples(trip_id, samples, context)


def _choose(source: Delimited) -> dict[str, RawColumn]:
    """Names in the header -> columns to read, in the order of `COLUMNS`."""
    positions = by_key(range(len(source.names)), lambda position: column_key(source.names[position]))
    chosen: dict[str, tuple[str, RawColumn]] = {}
    faults: list[Fault] = []
    for raw in raw_columns("tum"):
        places = positions.get(column_key(raw.name), [])
        if not places or raw.ours in chosen:
            continue
        chosen[raw.ours] = (source.names[places[0]], raw)
        if len(places) > 1:
            where, got = (
                f"{source.path} row {source.header_line} column {raw.name!r}",
                ", ".join(str(p + 1) for p in places),
            )
            faults.append(Fault("duplicate column", where, f"columns {got}", "one column of that name"))
    faults += [_missing_column(source, ours) for ours in NEEDED_COLUMNS if ours not in chosen]
    raise_faults(faults)
    return dict(chosen[ours] for ours in COLUMNS if ours in chosen)


def _missing_column(source: Delimited, ours: str) -> Fault:
    names = " or ".join(repr(raw.name) for raw in raw_columns("tum") if raw.ours == ours)
    shown = ", ".join(repr(name[:40]) for name in source.names[:6])
    more = f" and {len(source.names) - 6} more" if len(source.names) > 6 else ""
    got, where = f"{len(source.names)} columns: {shown}{more}", f"{source.path} row {source.header_line}"
    fix = "give a file of the TUM set with ';' or ',' between columns" if len(source.names) < 4 else ""
    return Fault("missing column", where, got, f"a column {names}", fix)
