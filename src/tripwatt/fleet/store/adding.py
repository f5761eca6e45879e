"""Add logs on disk to a store; a folder of tables is read in parts, so that memory does not grow with the folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from tripwatt.errors import Check
from tripwatt.fleet.store.store import Added, TripStore
from tripwatt.sources import read_logs
from tripwatt.sources.columnar import table_files

_FILES_AT_ONCE: Final = 64
"""Number of tables of a folder whose logs are committed together: a choice, because commits are slow and logs take memory."""


def add_files(
    store: TripStore,
    path: Path | str,
    *,
    car_model: str,
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
        If files have faults, with all of them. In a folder of tables, logs without a fault are added all the same; adding the
        repaired folder again adds the rest.

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
    if dataset != "table":
        logs = read_logs(path, dataset, mapping, strict=True)
        return store.add(logs, car_model=car_model, vehicle_id=vehicle_id, progress=progress)
    total = Added()

    def report(added: Added) -> None:
        if progress is not None:
            progress(total + added)

    files = table_files(Path(path))
    with Check() as check:
        for first in range(0, len(files), _FILES_AT_ONCE):
            batch = files[first : first + _FILES_AT_ONCE]
            trip_sets = [check(read_logs, file, "table", mapping, strict=True) for file in batch]
            batch_logs = [log for trips in trip_sets if trips is not None for log in trips.logs]
            added = check(store.add, batch_logs, car_model=car_model, vehicle_id=vehicle_id, progress=report)
            total += added or Added()
    return total
