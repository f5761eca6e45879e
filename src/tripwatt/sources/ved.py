"""Reader of the electric cars in the Vehicle Energy Dataset: weekly files of many cars around Ann Arbor.

G. S. Oh, D. J. LeBlanc, H. Peng, "Vehicle Energy Dataset (VED), a large-scale dataset for vehicle energy consumption
research", IEEE Transactions on Intelligent Transportation Systems 23(4), 2022, doi 10.1109/TITS.2020.3035596; data at
github.com/gsoh/VED, Apache-2.0. A trip is identified by (VehId, Trip). A sample is logged if any sensor has a new value, so
that steps are irregular and every other signal keeps its last value.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.errors import Fault, InvalidInput, and_more
from tripwatt.sources.columnar import CsvTable
from tripwatt.sources.public import raw_columns, read_folder, read_public, require_folder
from tripwatt.trips import COLUMNS, Context, Flag, Log, TripSet, raise_faults
from tripwatt.trips.reading import ReadingReport

CITATION: Final = (
    'G. S. Oh, D. J. LeBlanc, H. Peng, "Vehicle Energy Dataset (VED), a Large-Scale Dataset for Vehicle Energy '
    'Consumption Research", IEEE Transactions on Intelligent Transportation Systems, 2022, '
    "https://doi.org/10.1109/TITS.2020.3035596, licensed under Apache-2.0"
)


_KEYS: Final = ("DayNum", "VehId", "Trip")
_ENGINE: Final = ("Engine RPM[RPM]", "MAF[g/sec]", "Fuel Rate[L/hr]")
"""Signals of a combustion engine: a car with any value of one of these, even 0, is not electric."""


@dataclass(frozen=True, slots=True)
class _Week:
    """One weekly file: its rows with a battery voltage, the keys of all its trips, and its cars with an engine."""

    samples: pd.DataFrame
    trips: frozenset[tuple[int, int]]
    with_engine: frozenset[int]
    file: str

    def __len__(self) -> int:
        return len(self.samples)


def read_ved(folder: Path | str, *, strict: bool = False) -> TripSet:
    """Read the electric cars of a folder of weekly files `VED_*_week.csv`.

    Parameters
    ----------
    folder : path
    strict : bool
        Refuse everything that cannot be read as it stands.

    Returns
    -------
    TripSet
        Raw trips named `VED<VehId>-<Trip>`, in the order of departure. `notes` has the number of skipped trips, such as those of
        combustion cars and hybrids, and a note that the road counts as flat.

    Raises
    ------
    InvalidInput
        When no trip can be read; with `strict`, with every fault of the folder and of all its files.

    Examples
    --------
    >>> read_ved("no/such/folder")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: no such folder: no/such/folder: allowed: a folder with VED_*_week.csv; ...
    """
    folder = Path(folder)
    files = _week_files(folder)

    read, readings = read_folder(_read_week, {file.name: file for file in files}, strict=strict)
    weeks = [*read.values()]
    with_engine = frozenset().union(*(w.with_engine for w in weeks))
    trips, notes = _trips(weeks, with_engine)
    if not trips:
        got = f"{len(files)} weekly files, no trip of an electric car"
        raise InvalidInput.of("no trips", f"{folder}", got, "trips with a traction battery and no engine")
    notes.append(Flag("no_elevation", "VED"))
    return TripSet("ved", tuple(trips), tuple(notes), None, CITATION, ReadingReport(tuple(readings)))


def _week_files(folder: Path) -> list[Path]:
    allowed = "a folder with VED_*_week.csv"
    fix = "download the data from https://github.com/gsoh/VED and unpack them"
    require_folder(folder, allowed, fix)
    form = re.compile(r"VED_\d{6}_week.*\.csv", re.IGNORECASE)
    files = sorted(path for path in folder.iterdir() if form.fullmatch(path.name))
    if not files:
        raise InvalidInput.of("no trips", f"{folder}", "no weekly file", allowed, fix)
    return files


def _read_week(file: str, path: Path, faults: list[Fault]) -> _Week:
    ours = [ours for ours, _ in raw_columns("ved").values()]
    table, values = read_public(path, "ved", (*_KEYS, *ours), faults, unscaled=(*_KEYS, *_ENGINE))
    sound = _with_sound_keys(table, values)
    values = {name: column[sound] for name, column in values.items()}
    cars, numbers = values["VehId"].astype(np.int64), values["Trip"].astype(np.int64)
    has_battery = np.isfinite(values["voltage_v"])
    has_engine = np.isfinite([values[name] for name in _ENGINE if name in values]).any(axis=0)
    columns = {"car": cars, "trip": numbers, "day": values["DayNum"], **{name: values[name] for name in ours}}
    samples = pd.DataFrame({name: column[has_battery] for name, column in columns.items()}, copy=False)
    trips = frozenset(zip(cars.tolist(), numbers.tolist(), strict=True))
    return _Week(samples, trips, frozenset(cars[has_engine].tolist()), file)


def _with_sound_keys(table: CsvTable, values: Mapping[str, FloatArray]) -> BoolArray:
    """Mark the rows with a car, a trip and a day; the others are faults of the table."""
    sound = np.ones(len(values["VehId"]), dtype=bool)
    for name in _KEYS:
        column = values[name]
        integer = (column == np.round(column)) | (name == "DayNum")
        # 1e6: largest number accepted for a car, a trip or a day
        bad = np.flatnonzero(~(np.isfinite(column) & integer & (column >= 0.0) & (column <= 1e6)))
        if len(bad):
            sound[bad] = False
            where = f"{table.path} row {table.row(bad[0])} column {name!r}"
            got = f"{column[bad[0]]:g}{and_more(bad)}"
            table.faults.append(Fault("not a whole number", where, got, "a whole number", count=len(bad)))
    return sound


def _trips(weeks: list[_Week], with_engine: frozenset[int]) -> tuple[list[Log], list[Flag]]:
    seen: dict[tuple[int, int], str] = {}
    faults: list[Fault] = []
    trips: list[tuple[float, Log]] = []
    for week in weeks:
        electric = week.samples[~week.samples["car"].isin(with_engine)]
        for _, samples in electric.groupby(["car", "trip"], sort=False):
            car, number = int(samples["car"].iloc[0]), int(samples["trip"].iloc[0])
            if (car, number) in seen:
                files = f"{seen[car, number]} and {week.file}"
                faults.append(Fault("duplicate trip id", f"VehId {car}, Trip {number}", files, "one file"))
                continue
            seen[car, number] = week.file
            if len(samples) < 2:
                continue
            day = float(samples["day"].iloc[0])
            # DayNum 1 is 1 November 2017
            started_at = dt.datetime(2017, 11, 1) + dt.timedelta(days=day - 1.0)
            context = Context(started_at=started_at, route="Ann Arbor", car=f"{car}")
            ours = samples[[c for c in COLUMNS if c in samples.columns]].reset_index(drop=True)
            trips.append((day, Log.from_samples(f"VED{car}-{number}", ours, context)))
    raise_faults(faults)
    skipped = len(frozenset().union(*(w.trips for w in weeks))) - len(trips)
    notes = [Flag("trips_skipped", "VED", float(skipped), "1")] if skipped else []
    return [trip for _, trip in sorted(trips, key=lambda item: (item[0], item[1].trip_id))], notes
