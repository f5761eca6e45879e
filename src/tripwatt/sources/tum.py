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

from tripwatt.errors import Fault, InvalidInput, system_errors
from tripwatt.sources.public import read_folder, read_public, require_folder
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
