"""Add logs on disk to a store; a folder of tables is read in parts, so that memory does not grow with the folder."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from tripwatt.errors import Check, Fault, InvalidInput, places_within, raise_faults
from tripwatt.fleet.store.store import Added, TripStore
from tripwatt.sources import read_logs
from tripwatt.sources.columnar import open_table, table_files
from tripwatt.trips import Recorded
from tripwatt.vehicles import load_vehicle

_FILES_AT_ONCE: Final = 64
"""Number of tables of a folder whose logs are committed together: a choice, because commits are slow and logs take memory."""


def add_files(
    store: TripStore,
    path: Path | str,
    *,
    car_model: str | Path,
    vehicle_id: str | None = None,
    started: str | None = None,
    dataset: str = "table",
    mapping: Path | str | None = None,
    progress: Callable[[Added], None] | None = None,
) -> Added:
    """Add all logs of a data set; a folder of tables is read in parts.

    Parameters
    ----------
    store : TripStore
        Store to which the logs are added.
    path : Path or str
        As in `read_logs`.
    car_model : str or Path
        Name of a car of the library; for a mixed fleet, the file of a table with the columns `vehicle_id` and `car`, a name of the
        library or a file beside the table.
    vehicle_id : str, optional
        Vehicle of the logs that name none.
    started : str, optional
        Departure of the logs that have no date: ISO 8601, or the pattern of the files' names, such as ``log_%Y-%m-%d_%H%M``.
    dataset : str
        As in `read_logs`.
    mapping : Path or str, optional
        As in `read_logs`.
    progress : callable, optional
        Called with the sums so far after each commit.

    Returns
    -------
    Added
        Sums over all files.

    Raises
    ------
    InvalidInput
        If files or rows of the table of cars have faults, or vehicles have no row, with all of them. Logs without a fault are added all the
        same; adding the repaired files again adds the rest.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.fleet.store import create_store
    >>> from tripwatt.sources.sample import sample_trips
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "trip.csv")
    ...     sample_trips().trips[0].samples.to_csv(file, index=False)
    ...     store = create_store(Path(folder, "store"))
    ...     print(add_files(store, file, car_model="bmw_i3_60ah", vehicle_id="V1"))
    1 trip added, 0 known before; without a sound drive: 0
    """
    total = Added()

    def report(added: Added) -> None:
        if progress is not None:
            progress(total + added)

    files = table_files(Path(path)) if dataset == "table" else [path]
    with Check() as check:
        models = car_model if isinstance(car_model, str) else _cars_of(car_model, check)
        for first in range(0, len(files), _FILES_AT_ONCE):
            batch = files[first : first + _FILES_AT_ONCE]
            trip_sets = [check(read_logs, file, dataset, mapping, strict=True) for file in batch]
            pairs = zip(batch, trip_sets, strict=True)
            read = [(Path(file), log) for file, trips in pairs if trips is not None for log in trips.logs]
            logs = [dated for file, log in read if (dated := check(_dated, log, file, started)) is not None]
            if not isinstance(models, str):
                logs = _with_car(logs, models, vehicle_id, check)
            added = check(store.add, logs, car_model=models, vehicle_id=vehicle_id, progress=report)
            total += added or Added()
    return total


def _dated(log: Recorded, file: Path, started: str | None) -> Recorded:
    """Return a log with the departure that its file's name or the user states, if it has none."""
    if started is None or log.context.started_at is not None:
        return log
    try:
        named = "%" in started
        moment = dt.datetime.strptime(file.stem, started) if named else dt.datetime.fromisoformat(started)
    except ValueError as error:
        allowed = "a time such as 2024-05-31T08:15, or the pattern of the file's name, such as log_%Y-%m-%d"
        raise InvalidInput.of("no departure", f"{file.name}", started, allowed) from error
    return replace(log, context=replace(log.context, started_at=moment))


def read_by_vehicle(file: Path, column: str) -> dict[str, str]:
    """Read a column of a table, CSV or Parquet, by the vehicles in its column `vehicle_id`.

    Raises
    ------
    InvalidInput
        If a column is missing, or a vehicle has several rows.
    """
    table = open_table(file)
    raise_faults(table.faults)
    got = ", ".join(table.names)[:200]
    missing = (name for name in ("vehicle_id", column) if name not in table.names)
    raise_faults(Fault("missing column", f"{file}", got, f"a column {name}") for name in missing)
    vehicles = table.texts("vehicle_id")
    counts = Counter(vehicles)
    raise_faults(Fault("several rows", f"{file}", v, "one row") for v in counts if counts[v] > 1)
    return dict(zip(vehicles, table.texts(column), strict=True))


def _cars_of(file: Path, check: Check) -> dict[str, str]:
    """Read the car of each vehicle from a table; it is empty for a row with a fault."""
    rows = read_by_vehicle(file, "car").items()
    return {vehicle: check(_car_of, file, vehicle, car) or "" for vehicle, car in rows}


def _car_of(file: Path, vehicle: str, car: str) -> str:
    name = f"{(file.parent / car).resolve()}" if car.endswith(".toml") else car
    with places_within(f"{file}: {vehicle}: "):
        load_vehicle(name)
    return name


def _with_car(
    logs: Sequence[Recorded], cars: Mapping[str, str], vehicle_id: str | None, check: Check
) -> list[Recorded]:
    """Return the logs of vehicles with a car; each vehicle without a row is a fault. A log without a vehicle is left to the store."""
    vehicles = [log.context.car or vehicle_id or "" for log in logs]
    without = sorted({v for v in vehicles if v and v not in cars})
    check(raise_faults, (Fault("vehicle without a car", "--cars", v, "a row for it") for v in without))
    return [log for log, v in zip(logs, vehicles, strict=True) if cars.get(v, not v)]
