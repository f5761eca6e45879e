"""Jobs of users' cars: list and show them, propose how their logs are read, learn, forget. All file work is here."""

from __future__ import annotations

import contextlib
import datetime as dt
import os
import shutil
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import orjson
from cachetools import LRUCache
from pydantic import BaseModel

from tripwatt.auditing import Audit, audit
from tripwatt.containers import INSIDE, LIMITS
from tripwatt.containers import TABLES as TABLES_BYTES
from tripwatt.errors import Fault, InvalidInput, excerpt, or_none, raise_faults
from tripwatt.files import write_bytes
from tripwatt.forecasting import ForecastModel
from tripwatt.forecasting.plausible import absurd_energy
from tripwatt.server.cars import folder as folders
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import CarFile
from tripwatt.server.cars.diary import causes_of
from tripwatt.server.cars.folder import UPLOADS, describe_cars, folder_name, holds_car, setting_of
from tripwatt.server.cars.learning import Learned
from tripwatt.server.cars.live_car import VALID_NAME
from tripwatt.server.http.car_schemas import CarResponse, CarSummary, LogsRequest, plain
from tripwatt.server.http.problems import MAX_FAULTS, Problem, fault_document
from tripwatt.sources.archives import unpack
from tripwatt.sources.kinds import Kind, proposed_kinds
from tripwatt.sources.mapping import TIME_STAMPS, UNITS
from tripwatt.sources.table import Heights, read_kinds
from tripwatt.trips import TripSet
from tripwatt.trips.reading import FileReading, Group, ReadingReport
from tripwatt.vehicles import Vehicle

PROGRESS: Final = "progress.json"
"""File beside the tables of an upload with the trips that were learned."""

TABLES: Final = "tables"
MAX_FILES: Final = 4000
"""Most tables of an upload. A choice: ten drives a day for a year."""

EXPIRES_AFTER_S: Final = 3600.0
"""An upload that did not change for this time [s] is erased when the car gets its next file. A choice: a person looks at the preview for minutes."""

MAX_KEPT_MODELS: Final = 16
"""Most models of cars that a worker keeps in memory; the least recently used is dropped first. A choice."""


@dataclass(frozen=True)
class CarJobs:
    """The cars of a folder.

    Attributes
    ----------
    folder : Path or None
        Folder of the cars; None for a service without cars.
    heights : callable or None
        Heights of the service's map, as for `tripwatt.read_logs`.
    models : LRUCache
        Name of a car -> its learned state and its model at that state.
    """

    folder: Path | None = None
    heights: Heights | None = None
    models: LRUCache[str, tuple[str, ForecastModel]] = field(
        default_factory=lambda: LRUCache(MAX_KEPT_MODELS)
    )

    def folders(self) -> list[Path]:
        """Return the folders of the cars, by name."""
        found = [] if self.folder is None or not self.folder.is_dir() else self.folder.iterdir()
        return sorted(folder for folder in found if holds_car(folder))

    def car(self, name: str) -> Car:
        """Open the car of this name; raises as `car_folder` does."""
        return folders.open_car(car_folder(self.folder, name))

    def model(self, name: str) -> ForecastModel | None:
        """Return the current model of a car; None if there is no such car."""
        if self.folder is None or VALID_NAME.fullmatch(name) is None:
            return None
        state, cached = setting_of(self.folder / name, "state"), self.models.get(name)
        if state is None:
            return None
        if cached is None or cached[0] != state:
            self.models[name] = cached = state, folders.open_car(self.folder / name).model()
        return cached[1]

    def list(self) -> dict[str, Any]:
        """Return the cars, as `CarsResponse`; one that cannot be read is listed with its faults beside the others."""
        described, unread = describe_cars(self.folders())
        cars = None if self.folder is None else [_summary(about, CarSummary) for about in described]
        faults = {place.name: _without_folder(error, place.parent).faults for place, error in unread.items()}
        return {"cars": cars, "damaged": {name: [*map(fault_document, its)] for name, its in faults.items()}}

    def show(self, name: str, limit: int = 200, before: str | None = None) -> dict[str, Any]:
        """Return a car and the last `limit` entries of its diary, those before a trip, as `CarResponse` without `learning`."""
        car = self.car(name)
        diary = car.diary
        table = diary.table if before is None else diary.table[: diary.table["trip_id"].eq(before).argmax()]
        rows = table.tail(limit).iloc[::-1].to_dict("records")
        return {**_summary(car.about(diary), CarResponse), "diary": [_diary_entry(row, car) for row in rows]}

    def create(self, name: str, vehicle: Vehicle | str) -> dict[str, Any]:
        """Make a car, and return it as `show`."""
        folder = require_folder(self.folder) / folder_name(name)
        # a killed call may have left a file without tables
        is_free = not holds_car(folder) or or_none(lambda: CarFile(folder).is_finished) is False
        try:
            if is_free:
                return self.show(folders.create_car(folder, vehicle, label=name).name)
        except InvalidInput:
            if not folders.is_car(folder):  # else another call was faster
                raise
        fault = Fault("name is taken", "name", excerpt(name), "a name that no car has", at=("name",))
        raise Problem("name-taken", faults=(fault,))

    def forget(self, name: str) -> dict[str, Any]:
        """Erase a car, also a damaged one."""
        folders.forget_car(car_folder(self.folder, name, holds_car))
        self.models.pop(name, None)
        return {"forgotten": name}

    def token(self, name: str) -> dict[str, Any]:
        """Make a token for a car."""
        return {"token": folders.issue_token(self.car(name).folder)}

    def store(self, name: str, upload: str, file: str, body: bytes, max_bytes: int) -> dict[str, int]:
        """Unpack a file into the tables of an upload, and return their number and bytes; expired uploads are erased first."""
        try:
            folder = car_folder(self.folder, name) / UPLOADS / upload
        except InvalidInput as error:  # a full disk: not even the car can be read
            raise Problem("busy", f"the file cannot be stored: {error.faults[0].got}") from error
        tables = folder / TABLES
        _erase_expired(folder.parent, time.time() - EXPIRES_AFTER_S)
        free_bytes = max(max_bytes - sum(_sizes(folder.parent)), 0)
        limits = {**LIMITS, **{kind: min(free_bytes, LIMITS[kind]) for kind in (INSIDE, TABLES_BYTES)}}
        try:
            for part in (folder.parent, folder, tables):  # but not a car that is erased
                part.mkdir(exist_ok=True)
            tables_before = set(tables.iterdir())
            unpacked = unpack(file, tables, content=body, limits=limits)
        except OSError as error:
            raise Problem("busy", f"the file cannot be stored: {error.strerror}") from error
        sizes = _sizes(tables)
        if len(sizes) > MAX_FILES or sum(_sizes(folder.parent)) > max_bytes:
            for table in set(unpacked) - tables_before:  # those that were sent before stay
                table.unlink(missing_ok=True)
            if not _sizes(tables):
                shutil.rmtree(folder, ignore_errors=True)
            allowed = f"{MAX_FILES} tables and {max_bytes} bytes"
            raise Problem("too-large", f"at most {allowed} that are not learned yet")
        if not folders.is_car(folder.parents[1]):  # erased meanwhile
            shutil.rmtree(folder.parent, ignore_errors=True)
            raise Problem("no-such-car", "GET /v1/cars lists the cars")
        return {"files": len(sizes), "bytes": sum(sizes)}

    def logs(self, name: str, upload: str, request: LogsRequest, strict: bool = False) -> dict[str, Any]:
        """Return how the files of an upload are read, and what they hold then, as `LogsResponse`.

        Raises
        ------
        InvalidInput
            With `strict`, when nothing can be read, or the energy is not one that the car can take.
        """
        car = self.car(name)
        tables = upload_tables(car.folder, upload)
        kinds = _kinds_of_upload(tables, request, car.vehicle)
        preview, faults, report = None, [], None
        try:
            fleet = read_kinds(tables, kinds, heights=self.heights)
            audited, report = audit(fleet), fleet.report
            preview = preview_logs(fleet, audited)
            raise_faults(() if request.implausible else absurd_energy(car.vehicle, audited.trips, "logs"))
        except InvalidInput as error:
            shown = _without_folder(error, tables)
            if strict:
                raise shown from error
            faults = [*map(fault_document, shown.faults[:MAX_FAULTS])]
        return {
            "fields": [{"ours": ours, "units": _units_of(ours)} for ours in UNITS],
            "kinds": [_kind_document(n, kind) for n, kind in enumerate(kinds) if kind.tables],
            "files": _file_documents(kinds, report, request.ignored, tables),
            "report": [_group_document(group, tables) for group in report.groups()] if report else [],
            "preview": preview,
            "faults": faults,
        }

    def learn(self, name: str, upload: str, request: LogsRequest) -> dict[str, Any]:
        """Learn the trips of an upload and erase its files, but not those that come meanwhile; return the fields of `Learned`."""
        car = self.car(name)
        tables = upload_tables(car.folder, upload)
        file = tables.parent / PROGRESS
        read = [*tables.glob("[!.]*")]
        try:
            fleet = read_kinds(tables, _kinds_of_upload(tables, request, car.vehicle), heights=self.heights)
        except InvalidInput as error:
            raise _without_folder(error, tables) from error

        def note_progress(done: int, total: int) -> None:
            write_bytes(file, orjson.dumps({"done": done, "total": total}))

        learned = car.add(fleet, progress=note_progress)
        with contextlib.suppress(OSError):
            for part in (*read, file):
                part.unlink(missing_ok=True)
            tables.rmdir()  # fails if it has other files
            tables.parent.rmdir()
        return _learned_document(learned)

    def learn_finished(self, name: str) -> dict[str, Any]:
        """Learn the trips that a car finished on the road; return the fields of `Learned`."""
        return _learned_document(self.car(name).learn())


def require_folder(folder: Path | None) -> Path:
    """Return the folder of cars, if the service has one.

    Raises
    ------
    Problem
        `no-live` for a service without cars.
    """
    if folder is None:
        raise Problem("no-live", "start the service with --cars")
    return folder


def car_folder(folder: Path | None, name: str, is_there: Callable[[Path], bool] = folders.is_car) -> Path:
    """Return the folder of the car of this name; `is_there` tells whether a folder is that of a car.

    Raises
    ------
    Problem
        `no-live` for a service without cars, `no-such-car`.
    """
    path = require_folder(folder) / name
    if VALID_NAME.fullmatch(name) is None or not is_there(path):
        raise Problem("no-such-car", "GET /v1/cars lists the cars")
    return path


def upload_tables(car: Path, upload: str) -> Path:
    """Return the folder with the tables of an upload.

    Raises
    ------
    Problem
        `not-found`.
    """
    tables = car / UPLOADS / upload / TABLES
    if not upload.isalnum() or not any(tables.glob("[!.]*")):
        raise Problem("not-found", "no such upload")
    return tables


def _units_of(ours: str) -> list[str]:
    """Return the units that a table's column may have for one of our columns.

    Examples
    --------
    >>> _units_of("speed_m_s")[:2]
    ['m/s', 'km/h']
    """
    return [*UNITS[ours], *(TIME_STAMPS if ours == "time_s" else ())]


def _kinds_of_upload(tables: Path, request: LogsRequest, vehicle: Vehicle) -> list[Kind]:
    """Return the kinds of files of an upload, with the changes of a request."""
    changes = {int(n): kind.model_dump() for n, kind in request.kinds.items() if n.isdigit()}
    return proposed_kinds(tables, vehicle, changes, request.ignored)


def preview_logs(fleet: TripSet, audited: Audit) -> dict[str, Any]:
    """Return the audit of logs, as `LogsPreview`."""
    sound = [trip for trip in audited.trips if trip.observed_energy_wh is not None]
    starts = sorted(trip.context.started_at for trip in sound if trip.context.started_at is not None)
    temperatures = [t for trip in sound if (t := trip.departure.ambient_temperature_degc) is not None]
    return {
        "logs": len(fleet.logs),
        "drives": len(sound),
        "distance_m": float(sum(trip.distance_m for trip in sound)),
        "duration_s": float(sum(trip.duration_s for trip in sound)),
        "energy_wh": float(sum(trip.observed_energy_wh or 0.0 for trip in sound)),
        "from_date": starts[0].astimezone().isoformat() if starts else None,
        "to_date": starts[-1].astimezone().isoformat() if starts else None,
        "ambient_degc": [min(temperatures), max(temperatures)] if temperatures else None,
        "lost_distance_m": audited.lost_distance_m,
        "lost_duration_s": audited.lost_duration_s,
        # those that cost most come before
        "findings": [{**asdict(group), "consequence": why} for why, group in audited.groups()[:40]],
    }


def read_progress(folder: Path, upload: str) -> tuple[int, int | None]:
    """Return the number of trips of an upload learned so far, and of all its trips; 0 and None before the first."""
    try:
        progress = orjson.loads((folder / UPLOADS / upload / PROGRESS).read_bytes())
        return int(progress["done"]), int(progress["total"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0, None


def _without_folder(error: InvalidInput, tables: Path) -> InvalidInput:
    """Return the same faults with names of files without the service's folder, which clients need not know."""
    folder = f"{tables}{os.sep}"
    return InvalidInput(
        replace(fault, where=fault.where.replace(folder, ""), got=fault.got.replace(folder, ""))
        for fault in error.faults
    )


def _kind_document(number: int, kind: Kind) -> dict[str, Any]:
    """Return a kind of files, as `KindDocument`."""
    guesses = () if kind.proposal is None else kind.proposal.guesses
    why = {(guess.ours, guess.column): guess.why for guess in guesses}
    mapping = [
        {
            "ours": ours,
            "column": str(entry.get("column", "")),
            "unit": str(entry.get("unit") or _units_of(ours)[0]).lower(),
            "why": why.get((ours, str(entry.get("column", ""))), ""),
        }
        for ours, entry in kind.tables.get("columns", {}).items()
    ]
    used = [entry["column"] for entry in mapping]
    # in a file with a row for each value, the signals are the columns
    columns = [column for column in dict.fromkeys([*kind.names, *used]) if column]
    return {
        "number": number,
        "files": len(kind.files),
        "columns": columns,
        "mapping": mapping,
        "shipped": None if kind.proposal is None else kind.proposal.shipped,
        "unused": [column for column in columns if column not in used],
        "current_positive": kind.tables.get("current", {}).get("positive", "discharge"),
        "assumed": kind.assumed,
    }


def _file_documents(
    kinds: Sequence[Kind], report: ReadingReport | None, ignored: Sequence[str], tables: Path
) -> list[dict[str, Any]]:
    """Return the files of an upload, as `FileDocument`."""
    numbered = ((number, kind, path) for number, kind in enumerate(kinds) for path in kind.files)
    unread = (FileReading(path.name, kind=number, faults=kind.faults) for number, kind, path in numbered)
    names = ("name", "state", "rows", "rows_used", "logs")
    documents = [
        {
            **{name: getattr(file, name) for name in names},
            "kind": file.kind if kinds[file.kind].tables else None,
            "faults": [*map(fault_document, _without_folder(InvalidInput(file.faults), tables).faults[:5])],
        }
        for file in (unread if report is None else report.files)
    ]
    nothing: dict[str, Any] = {"state": "ignored", **dict.fromkeys(names[2:], 0), "kind": None, "faults": []}
    return [*documents, *({"name": name, **nothing} for name in ignored)]


def _group_document(group: Group, tables: Path) -> dict[str, Any]:
    return {**asdict(group), "example": group.example.replace(f"{tables}{os.sep}", "")}


def _diary_entry(row: Mapping[Hashable, Any], car: Car) -> dict[str, Any]:
    """Return a row of the diary of a car, as `DiaryEntry`."""
    values = {f"{key}": plain(value) for key, value in row.items()}
    causes = {name: values.pop(column) for column, name in causes_of(values).items()}
    known = {name: value for name, value in causes.items() if value is not None}
    made = [asdict(forecast) for forecast in car.forecasts_of(f"{row['trip_id']}")]
    local = values.pop("started_at")
    about = {"started_at": dt.datetime.fromisoformat(local).astimezone().isoformat() if local else None}
    return {"trip": values.pop("trip_id"), **about, **values, "by_cause_wh": known, "on_the_way": made}


def _learned_document(learned: Learned) -> dict[str, Any]:
    return {**asdict(learned), "left_out": list(learned.left_out[:20])}


def _summary(about: Mapping[str, Any], model: type[BaseModel]) -> dict[str, Any]:
    """Return the fields of `Car.about` that a response has, with the name of the car."""
    fields = {key: about[key] for key in model.model_fields if key in about}
    return {**fields, "name": about["car"], "car": about["vehicle"]}


def _sizes(folder: Path) -> list[int]:
    """Return the sizes of the files below a folder [bytes], without those being written, or erased meanwhile by another upload."""
    sizes = []
    for path, _, names in os.walk(folder):
        for name in () if Path(path).name.startswith(".") else names:
            if name.startswith("."):
                continue
            with contextlib.suppress(FileNotFoundError):
                sizes.append((Path(path) / name).stat().st_size)
    return sizes


def _erase_expired(uploads: Path, before_s: float) -> None:
    for upload in uploads.iterdir() if uploads.is_dir() else []:
        with contextlib.suppress(OSError):
            if max(file.stat().st_mtime for file in (upload, *upload.rglob("*"))) < before_s:
                shutil.rmtree(upload, ignore_errors=True)
