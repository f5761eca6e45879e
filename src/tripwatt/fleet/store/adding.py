"""Add logs on disk to a store; a folder of tables is read in parts, so that memory does not grow with the folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from tripwatt.errors import Check, Fault, places_within, raise_faults
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
    car_model: str = "",
    cars: Path | None = None,
    vehicle_id: str | None = None,
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
    car_model : str
        Name of a car of the library.
    cars : Path, optional
        For a mixed fleet, instead of `car_model`: a table with the columns `vehicle_id` and `car`, a name of the library or a file
        beside the table.
    vehicle_id : str, optional
        Vehicle of the logs that name none.
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
        If files or rows of `cars` have faults, or vehicles have no row, with all of them. Logs without a fault are added all the
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
    1 trips added, 0 were known; 0 of the added have no sound drive
    """
    total = Added()

    def report(added: Added) -> None:
        if progress is not None:
            progress(total + added)

    files = table_files(Path(path)) if dataset == "table" else [path]
    with Check() as check:
        models = car_model if cars is None else _cars_of(cars, check)
        for first in range(0, len(files), _FILES_AT_ONCE):
            batch = files[first : first + _FILES_AT_ONCE]
            trip_sets = [check(read_logs, file, dataset, mapping, strict=True) for file in batch]
            logs = [log for trips in trip_sets if trips is not None for log in trips.logs]
            if not isinstance(models, str):
                logs = _with_car(logs, models, vehicle_id, check)
            added = check(store.add, logs, car_model=models, vehicle_id=vehicle_id, progress=report)
            total += added or Added()
    return total


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
    raise_faults(
        Fault("several rows", f"{file}", v, "a row of each vehicle") for v in counts if counts[v] > 1
    )
    return dict(zip(vehicles, table.texts(column), strict=True))


def _cars_of(file: Path, check: Check) -> dict[str, str]:
    """Read the car of each vehicle from a table; it is empty for a row with a fault."""
    rows = (check(read_by_vehicle, file, "car") or {}).items()
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
    check(
        raise_faults, (Fault("vehicle without a car", "--cars", v, "a row of the vehicle") for v in without)
    )
    return [log for log, v in zip(logs, vehicles, strict=True) if cars.get(v, not v)]
