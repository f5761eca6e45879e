"""A trip store: logs of many vehicles in two Delta tables, added by many writers at once.

The table `samples` has the samples of the logs, the table `trips` one row per log with its audit. A log is in the store once its row of
`trips` is committed. Its samples are written before; samples without such a row were left by a writer that was killed.
"""

from __future__ import annotations

import datetime as dt
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import islice, pairwise
from operator import and_
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from tripwatt.arrays import by_key
from tripwatt.errors import Fault, InvalidInput, counted, require_one, require_type
from tripwatt.fleet.store.delta import DeltaFolder, is_one_of, join_place, text_column
from tripwatt.fleet.store.rows import (
    SAMPLES,
    SIGNALS,
    TRIPS,
    StoredLog,
    bucket_of,
    log_from_rows,
    samples_table,
    stored_log,
)
from tripwatt.trips import Log, Recorded, TripSet, raise_faults

FORMAT: Final = 2
_BUCKETS: Final = 16
"""Default number of hash buckets of vehicles: a choice, because it suits some thousand vehicles."""

_MAX_BUCKETS: Final = 1024
"""A choice, because each bucket is a folder with files of its own."""

BATCH: Final = 500
"""Number of logs in one commit: a choice, because commits are slow and logs take memory."""

_FILE_BYTES: Final = 16 << 20
"""Size up to which `compact` merges data files [bytes]: a worker that reads one file needs far less than 1 GB of memory."""

FILES_A_BUCKET: Final = 16
"""Mean number of data files of `trips` per bucket above which `add` merges them, since each commit reads all of them."""

_ORPHANS_AFTER_S: Final = 86_400.0
"""Age [s] from which samples without a row of `trips` are dropped; younger ones may be of a writer at work. A choice, because no
commit takes a day."""

_KEPT_HOURS: Final = 168
"""Time for which old versions are kept for readers at work [h]: the default of Delta Lake."""

KEYS: Final = pa.schema([(name, pa.string()) for name in ("digest", "vehicle_id", "trip_id")])
"""Columns of `trips` that show whether a log is in the store."""

FINDINGS: Final = ("trimmed", "split", "set_aside", "noted")
"""Columns of `TripStore.trips` with the number of findings of the audit, by consequence."""

LISTED: Final = (
    "vehicle_id",
    "trip_id",
    "car_model",
    "driver",
    "started_at",
    "distance_m",
    "duration_s",
    "energy_wh",
    "energy_std_wh",
    "energy_from",
    "drives",
    "ambient_temperature_degc",
    "digest",
    *FINDINGS,
)
"""Columns of `TripStore.trips`, in this order."""

LONGEST_NAME: Final = 200
"""Largest number of characters of a vehicle's or a car model's name: a choice that bounds the memory of a hostile table."""


@dataclass(frozen=True, slots=True)
class Added:
    """Numbers of logs that were added to a store, or were in the store before.

    Attributes
    ----------
    added : int
        Logs that are new in the store.
    known : int
        Logs that were in the store before.
    unusable : int
        New logs in which the audit found no sound drive.

    Examples
    --------
    >>> Added(added=12, unusable=1)
    Added(added=12, known=0, unusable=1)
    """

    added: int = 0
    known: int = 0
    unusable: int = 0

    def __add__(self, other: Added) -> Added:
        return Added(self.added + other.added, self.known + other.known, self.unusable + other.unusable)

    def __str__(self) -> str:
        return f"{counted(self.added, 'trip')} added, {self.known} known before; without a sound drive: {self.unusable}"


@dataclass(frozen=True, repr=False)
class TripStore:
    """A store of logs of many vehicles, made by `create_store` and opened by `open_store`.

    Attributes
    ----------
    place : str
        A folder or a URL of an object store.
    options : mapping of str to str
        Options of the object store, such as its region.
    buckets : int
        Number of hash buckets of vehicles.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = create_store(folder)
    ...     print(store.add(synthetic_fleet(2), vehicle_id="V1", car_model="bmw_i3_60ah"))
    ...     print(store.trips(columns=["trip_id", "vehicle_id"]).shape, len(store.trip_rows(vehicle_id="V1")))
    ...     print([len(log) > 1 for log in store.logs(limit=1)])
    ...     print(len(store.file_trips(store.trip_rows())))
    ...     print(store.about()["vehicles"], sorted(store.compact()))
    ...     print(store.forget("V1"))
    2 trips added, 0 known before; without a sound drive: 0
    (2, 2) 2
    [True]
    2
    1 ['made', 'merged', 'orphans', 'removed']
    2
    """

    place: str
    options: Mapping[str, str] = field(default_factory=dict)
    buckets: int = _BUCKETS
    _keys: dict[str, pa.Table] = field(default_factory=dict, compare=False)

    @cached_property
    def samples(self) -> DeltaFolder:
        """The table `samples`, with one row per sample."""
        return DeltaFolder(join_place(self.place, "samples"), self.options)

    @property
    def rows(self) -> DeltaFolder:
        """The table `trips`, with one row per log."""
        return DeltaFolder(join_place(self.place, "trips"), self.options)

    def add(
        self,
        logs: TripSet | Iterable[Recorded],
        *,
        car_model: str | Mapping[str, str],
        vehicle_id: str | None = None,
        progress: Callable[[Added], None] | None = None,
    ) -> Added:
        """Add logs, except those that are in the store already by their digest.

        O(samples), and for each commit a read of the rows of `trips` in the buckets of its vehicles.

        Logs are committed in batches of `BATCH`. After a crash, the store has all batches for which `progress` was called.

        Parameters
        ----------
        logs : TripSet or iterable of Log
            Logs as returned by a reader, before any resampling. They are audited one by one.
        car_model : str or mapping of str to str
            Name of a car of the library, or the one of each vehicle.
        vehicle_id : str, optional
            Vehicle of the logs that name none in `context.car`.
        progress : callable, optional
            Called with the sums so far after each commit.

        Returns
        -------
        Added
            Numbers of logs that are new, were known before, and are unusable.

        Raises
        ------
        InvalidInput
            If logs name no vehicle, were resampled, or have the id of another log of their vehicle.
        """
        cars = {} if isinstance(car_model, str) else car_model
        usual = car_model if isinstance(car_model, str) else None
        raise_faults([*_name_faults("car model", usual), *_name_faults("vehicle", vehicle_id)])
        total = Added()
        remaining = iter(logs.logs if isinstance(logs, TripSet) else logs)
        while chunk := list(islice(remaining, BATCH)):
            raise_faults(_log_faults(chunk, vehicle_id))
            vehicles = [log.context.car or vehicle_id or "" for log in chunk]
            models = [usual or cars.get(vehicle, "") for vehicle in vehicles]
            raise_faults(fault for model in models for fault in _name_faults("car model", model))
            each = zip(chunk, vehicles, models, strict=True)
            total += self._add_batch([stored_log(*row, self.buckets) for row in each])
            if progress is not None:
                progress(total)
        return total

    def _add_batch(self, stored: Sequence[StoredLog]) -> Added:
        """Commit the logs that are new; their samples are written first, and dropped again if another writer commits the logs first."""
        unique = list({s.row["digest"]: s for s in stored}.values())
        before = self.rows.open()
        version, new = before.version(), self._unknown(unique, before)
        if not new:
            return Added(known=len(stored))
        batch = f"{time.time_ns():020d}-{uuid.uuid4().hex[:12]}"
        self.samples.append(samples_table(new, batch))
        committed: list[StoredLog] = []

        def rows_for(table: Any) -> pa.Table | None:
            committed[:] = new if table.version() == version else self._unknown(new, table)
            rows = [{**s.row, "batch": batch} for s in committed]
            return pa.Table.from_pylist(rows, schema=TRIPS) if rows else None

        try:
            self.rows.append_checked(rows_for, before)
        finally:
            # another writer added the same logs first: drop our samples
            if lost := [s.row["digest"] for s in new if s not in committed]:
                self.samples.delete(f"batch = '{batch}' AND digest IN ({_sql_texts(lost)})")
        if len(before.file_uris()) > FILES_A_BUCKET * self.buckets:
            self.rows.try_to_compact(_FILE_BYTES)
        unusable = sum(s.row["drives"] == 0 for s in committed)
        return Added(len(committed), len(stored) - len(committed), unusable)

    def _unknown(self, stored: Sequence[StoredLog], table: Any) -> list[StoredLog]:
        """Return the logs that are not in one version of the table `trips`.

        Raises
        ------
        InvalidInput
            If a vehicle has another log of the same id, in the table or among the logs.
        """
        vehicles = pa.array({s.row["vehicle_id"] for s in stored}, pa.string())
        buckets = sorted({s.row["bucket"] for s in stored})
        keys = self._read_keys(table.to_pyarrow_dataset().get_fragments(pc.field("bucket").isin(buckets)))
        rows = keys.filter(pc.is_in(keys["vehicle_id"], vehicles))
        known, *names = (rows[name].to_pylist() for name in KEYS.names)
        known = set(known)
        unknown = [s for s in stored if s.row["digest"] not in known]
        of_unknown = ((s.row["vehicle_id"], s.row["trip_id"]) for s in unknown)
        counts = Counter((*zip(*names, strict=True), *of_unknown))
        places = (f"vehicle {vehicle}, trip {trip}" for (vehicle, trip), n in counts.items() if n > 1)
        got, fix = "another log of this vehicle has it", "give the log an id of its own"
        about = got, "one id per trip of a vehicle", fix
        raise_faults(Fault("duplicate trip id", place, *about) for place in places)
        return unknown

    def _read_keys(self, files: Iterable[Any]) -> pa.Table:
        """Read `KEYS` of data files of `trips`, each once, because a file never changes."""
        if len(self._keys) > 2 * FILES_A_BUCKET * self.buckets:
            self._keys.clear()  # most are of files that were merged
        for file in (files := [*files]):
            if file.path not in self._keys:
                self._keys[file.path] = file.to_table(columns=KEYS.names).cast(KEYS)
        return pa.concat_tables([KEYS.empty_table(), *(self._keys[file.path] for file in files)])

    def trips(
        self,
        *,
        vehicle_id: str | None = None,
        car_model: str | None = None,
        since: dt.date | str | None = None,
        until: dt.date | str | None = None,
        digests: Iterable[str] | None = None,
        columns: Sequence[str] = LISTED,
        limit: int | None = None,
    ) -> pd.DataFrame:
        """List the logs, one row each, by vehicle and departure.

        Parameters
        ----------
        vehicle_id : str, optional
            Only logs of this vehicle.
        car_model : str, optional
            Only logs of vehicles of this model.
        since : date or str, optional
            Only logs that depart at or after this time; a text is ISO 8601.
        until : date or str, optional
            Only logs that depart before this time.
        digests : iterable of str, optional
            Only logs with these digests.
        columns : sequence of str
            Columns of the table `trips`, or of `FINDINGS`.
        limit : int, optional
            Largest number of rows.

        Returns
        -------
        DataFrame
            One row per log with `columns`.

        Raises
        ------
        InvalidInput
            If columns are unknown.
        """
        allowed = (*TRIPS.names, *FINDINGS)
        unknown = [c for c in columns if c not in allowed]
        raise_faults(Fault.unknown("unknown column", "columns", c, allowed) for c in unknown)
        stored = dict.fromkeys("findings" if c in FINDINGS else c for c in columns)
        order = [c for c in ("vehicle_id", "started_at", "trip_id") if c not in stored]
        given = {"vehicle_id": vehicle_id, "car_model": car_model}
        where = [text_column(name) == value for name, value in given.items() if value is not None]
        if vehicle_id is not None:
            where.append(pc.field("bucket") == bucket_of(vehicle_id, self.buckets))
        if since is not None:
            where.append(text_column("started_at") >= _to_iso(since, "since"))
        if until is not None:
            where.append(text_column("started_at") < _to_iso(until, "until"))
        if digests is not None:
            where.append(is_one_of("digest", digests))
        table = self.rows.read([*stored, *order], reduce(and_, where) if where else None)
        by = [("vehicle_id", "ascending"), ("started_at", "ascending"), ("trip_id", "ascending")]
        table = table.take(pc.sort_indices(table, sort_keys=by)[:limit])
        listed: pd.DataFrame = table.to_pandas()
        for name in FINDINGS if "findings" in stored else ():
            said = f'"consequence": "{name.replace("_", " ")}"'
            listed[name] = listed["findings"].str.count(said)
        return listed[list(columns)]

    def logs(self, rows: Sequence[Mapping[str, Any]] | None = None, **which: Any) -> Iterator[Log]:
        """Read logs as they were added, data file by data file.

        Parameters
        ----------
        rows : sequence of mapping, optional
            Rows of `trips` with all columns. By default, the rows that `which` selects.
        **which
            As in `trips`.

        Yields
        ------
        Log
            A raw log with its context.
        """
        wanted = self.trip_rows(**which) if rows is None else rows
        files = self.samples.filesystem()
        for path, of_file in self.file_trips(wanted).items():
            yield from (log for _, log in read_file(files, path, of_file))

    def trip_rows(self, **which: Any) -> list[dict[str, Any]]:
        """Read rows of the table `trips` with all columns.

        Parameters
        ----------
        **which
            As in `trips`, without `columns`.

        Returns
        -------
        list of dict
            One row per log; None if a value is unknown.
        """
        # `started_at` has more than the instant, which the stores of older cars lack
        frame = self.trips(columns=[n for n in TRIPS.names if n != "started_at_utc"], **which)
        rows: list[Any] = frame.astype(object).where(frame.notna(), None).to_dict("records")
        return rows

    def file_trips(self, rows: Iterable[Mapping[str, Any]]) -> dict[str, tuple[Mapping[str, Any], ...]]:
        """Find the data files that may have samples of some logs. O(files x logs of a partition).

        Parameters
        ----------
        rows : iterable of mapping
            Rows of `trips` with `bucket`, `month` and `batch`.

        Returns
        -------
        dict of str to tuple of mapping
            Path of each data file, relative to the table `samples` -> rows of the logs that may be in it; data files without a wanted log are
            left out.
        """
        by_partition = by_key(rows, lambda row: (row["bucket"], row["month"]))
        files = {}
        for file in self.samples.data_files():
            near = by_partition.get((file["partition.bucket"], file["partition.month"]), ())
            wanted = tuple(row for row in near if file["min.batch"] <= row["batch"] <= file["max.batch"])
            if wanted:
                files[file["path"]] = wanted
        return files

    def compact(self, *, file_bytes: int = _FILE_BYTES, keep_hours: int = _KEPT_HOURS) -> dict[str, int]:
        """Merge small data files, and remove samples without a trip and files of old versions.

        Parameters
        ----------
        file_bytes : int
            Size up to which files are merged [bytes].
        keep_hours : int
            Age of versions from which their files are removed [h].

        Returns
        -------
        dict
            Numbers of files that were `merged`, `made` and `removed`, and of dropped samples without a trip (`orphans`).
        """
        orphans = self._drop_orphans()
        metrics = [folder.compact(file_bytes) for folder in (self.samples, self.rows)]
        removed = sum(folder.drop_old_files(keep_hours) for folder in (self.samples, self.rows))
        return {
            "merged": sum(f["numFilesRemoved"] for f in metrics),
            "made": sum(f["numFilesAdded"] for f in metrics),
            "orphans": orphans,
            "removed": removed,
        }

    def _drop_orphans(self) -> int:
        """Drop samples of batches that are in no row of `trips`, if they are old enough that no writer is at work on them."""
        before = f"{time.time_ns() - int(_ORPHANS_AFTER_S * 1e9):020d}"
        batches = self.samples.read(["batch"], text_column("batch") < before)["batch"].unique().to_pylist()
        kept = set(self.rows.read(["batch"])["batch"].unique().to_pylist())
        lost = sorted(set(batches) - kept)
        return self.samples.delete(f"batch IN ({_sql_texts(lost)})") if lost else 0

    def forget(self, vehicle_id: str | None = None, *, driver: str | None = None) -> int:
        """Erase a vehicle, or a driver: the rows, the samples, and the data files that held them; a killed call can be repeated.

        Old versions of the tables that need these files can no longer be read. Models and reports that were made from the trips are
        not part of a store and stay as they are.

        Parameters
        ----------
        vehicle_id : str, optional
            Name of the vehicle, as it was added.
        driver : str, optional
            Name of the driver, in place of the vehicle; the trips of other drivers remain.

        Returns
        -------
        int
            Number of trips that were erased.

        Raises
        ------
        InvalidInput
            If neither or both are given, or the tables have no rows of them; files that held them earlier are removed all the same.
        """
        require_one("vehicle_id, driver", vehicle_id, driver)
        name, value = ("driver", driver) if vehicle_id is None else ("vehicle_id", vehicle_id)
        named = text_column(name) == value
        if vehicle_id is not None:
            named &= pc.field("bucket") == bucket_of(vehicle_id, self.buckets)
        # samples without a row are of a killed writer, and name the vehicle only
        folders = (self.rows, self.samples) if driver is None else (self.rows,)
        tables = [folder.read(["bucket", "digest"], named).to_pydict() for folder in folders]
        keys = sorted({key for table in tables for key in zip(*table.values(), strict=True)})
        erased = 0
        for bucket, of_bucket in by_key(keys, lambda key: key[0]).items():
            # a predicate stays in the table's log, so it must not name the vehicle
            where = f"bucket = {bucket} AND digest IN ({_sql_texts([digest for _, digest in of_bucket])})"
            # first: without a row, a repeated call does not find the samples of a driver
            self.samples.delete(where)
            erased += self.rows.delete(where)
        # also of an earlier call that was killed before it came here
        for folder in (self.rows, self.samples):
            folder.drop_old_files(0)
        if not keys:
            what = f"unknown {name.removesuffix('_id')}"
            raise InvalidInput.of(what, name, repr(value), "one of the store")
        return erased

    def about(self) -> dict[str, Any]:
        """Summarise the store.

        Returns
        -------
        dict
            Place and format, numbers of logs, vehicles and car models, the distance [m], first and last departure, and the
            size of the data files of samples [bytes].
        """
        rows = self.rows.read(["vehicle_id", "car_model", "distance_m", "energy_wh", "drives", "started_at"])
        frame = rows.to_pandas()
        started = frame["started_at"].dropna()
        return {
            "store": self.place,
            "format": FORMAT,
            "buckets": self.buckets,
            "trips": len(frame),
            "usable": int((frame["drives"] > 0).sum()),
            "with_energy": int(frame["energy_wh"].notna().sum()),
            "vehicles": int(frame["vehicle_id"].nunique()),
            "car_models": {str(k): int(n) for k, n in frame["car_model"].value_counts().sort_index().items()},
            "distance_m": float(frame["distance_m"].sum()),
            "first": None if started.empty else str(started.min()),
            "last": None if started.empty else str(started.max()),
            "bytes": sum(file["size_bytes"] for file in self.samples.data_files()),
        }

    def __repr__(self) -> str:
        about = self.about()
        return f"<TripStore {self.place}: {about['trips']} trips of {about['vehicles']} vehicles>"


def create_store(
    place: Path | str, *, buckets: int = _BUCKETS, options: Mapping[str, str] | None = None
) -> TripStore:
    """Make an empty trip store.

    Parameters
    ----------
    place : path or URL
        A new or empty folder, or a place in an object store.
    buckets : int
        Number of hash buckets of vehicles, the first partition of the tables. Some hundred vehicles per bucket are a good number.
    options : mapping of str to str, optional
        Options of the object store.

    Returns
    -------
    TripStore
        The empty store.

    Raises
    ------
    InvalidInput
        If `buckets` is out of range, there is a store already, or the place cannot be written.

    Examples
    --------
    >>> import tripwatt as tw
    >>> store = tw.create_store("trips")  # doctest: +SKIP
    """
    if not 1 <= require_type("buckets", buckets, int, "a whole number") <= _MAX_BUCKETS:
        raise InvalidInput.of("value out of range", "buckets", f"{buckets}", f"1 to {_MAX_BUCKETS}")
    store = TripStore(f"{require_type('place', place, str | Path, 'a path')}", dict(options or {}), buckets)
    if store.rows.exists():
        raise InvalidInput.of("trip store exists", store.place, "", "a new or empty folder")
    about = {"tripwatt_store": FORMAT, "buckets": buckets}
    store.samples.create(SAMPLES, ["bucket", "month"], "tripwatt samples", about)
    store.rows.create(TRIPS, ["bucket"], "tripwatt trips", about)
    return open_store(place, options=options)


def open_store(place: Path | str, *, options: Mapping[str, str] | None = None) -> TripStore:
    """Open a trip store: logs of many vehicles, in a folder or an object store.

    Parameters
    ----------
    place : path or URL
        Place of a store made by `create_store` or `tripwatt store create`.
    options : mapping of str to str, optional
        Options of the object store, as the package `deltalake` takes them.

    Returns
    -------
    TripStore
        The store with its logs.

    Raises
    ------
    InvalidInput
        If there is no store, its format is newer, or the package `deltalake` is missing.

    Examples
    --------
    >>> import tripwatt as tw
    >>> tw.open_store("trips").about()["trips"]  # doctest: +SKIP
    1280
    """
    store = TripStore(f"{place}", dict(require_type("options", options or {}, Mapping, "a Mapping")))
    about = store.rows.about()
    if about["tripwatt_store"] > FORMAT:
        got, fix = f"format {about['tripwatt_store']}", "install a newer tripwatt"
        raise InvalidInput.of("trip store of a newer format", store.place, got, f"format {FORMAT}", fix)
    return TripStore(store.place, store.options, int(about["buckets"]))


def read_file(
    files: Any, path: str, rows: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[Mapping[str, Any], Log]]:
    """Read the wanted logs that are in a data file of samples. O(rows of the file).

    Parameters
    ----------
    files : pyarrow.fs.FileSystem
        File system of the table `samples`.
    path : str
        Path of the data file, as `TripStore.file_trips` has it.
    rows : sequence of mapping
        Rows of `trips` of the wanted logs; those that are not in the file are skipped.

    Yields
    ------
    row : mapping
        Row of `trips` of the log.
    log : Log
        The raw log; logs are in the order of their digests.

    Raises
    ------
    InvalidInput
        If samples of a log are missing.

    Examples
    --------
    >>> import tempfile
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = create_store(folder)
    ...     _ = store.add(synthetic_fleet(1), vehicle_id="V1", car_model="bmw_i3_60ah")
    ...     ((path, rows),) = store.file_trips(store.trip_rows()).items()
    ...     for row, log in read_file(store.samples.filesystem(), path, rows):
    ...         print(row["vehicle_id"], len(log) == row["samples"])
    V1 True
    """
    import pyarrow.parquet as pq

    rows = sorted(rows, key=lambda row: str(row["digest"]))
    batches, digests = (pa.array([row[name] for row in rows], pa.string()) for name in ("batch", "digest"))
    with files.open_input_file(path) as source, pq.ParquetFile(source) as parquet:
        keys = parquet.read(["batch", "digest", "sample"])
        log = pc.index_in(keys["digest"].cast(pa.string()), digests)
        # the samples of a writer that was killed have another batch
        of_batch = pc.equal(keys["batch"].cast(pa.string()), pc.take(batches, log))
        chosen = np.flatnonzero(of_batch.fill_null(False).to_numpy())
        if not len(chosen):
            return
        numbers = parquet.read(list(SIGNALS))
    log = log.fill_null(0).to_numpy()[chosen]
    order = np.lexsort((keys["sample"].to_numpy()[chosen], log))  # merging files mixes their rows
    columns = {name: numbers[name].to_numpy()[chosen[order]] for name in SIGNALS}
    edges = [0, *(np.flatnonzero(np.diff(log[order])) + 1).tolist(), len(order)]
    for first, last in pairwise(edges):
        row = rows[log[order[first]]]
        if last - first != row["samples"]:
            where, got = f"{path}, trip {row['trip_id']}", f"{last - first} samples"
            raise InvalidInput.of("samples are missing", where, got, f"{row['samples']} samples")
        yield row, log_from_rows(row, {name: values[first:last] for name, values in columns.items()})


def _to_iso(moment: dt.date | str, where: str) -> str:
    try:
        return dt.datetime.fromisoformat(f"{moment}").isoformat()
    except ValueError as error:
        raise InvalidInput.of("invalid time", where, repr(moment), "a date such as 2024-05-31") from error


def _name_faults(what: str, name: str | None) -> list[Fault]:
    if name is None or (0 < len(name) <= LONGEST_NAME and name.isprintable()):
        return []
    allowed = f"1 to {LONGEST_NAME} printable characters"
    return [Fault(f"invalid name of a {what}", what, repr(name)[:60], allowed)]


def _log_faults(logs: Sequence[Recorded], vehicle_id: str | None) -> list[Fault]:
    """Return the faults of logs: no vehicle, an invalid name of a vehicle, means instead of raw samples."""
    faults = []
    for log in logs:
        if log.context.car is None and vehicle_id is None:
            fix = "give vehicle_id, or name the vehicle's column in the mapping"
            faults.append(Fault("vehicle is missing", log.trip_id, "", "the vehicle of each log", fix))
        faults += _name_faults("vehicle", log.context.car)
        if log.step_s is not None:
            faults.append(Fault("not a raw log", log.trip_id, f"means over {log.step_s} s"))
    return faults


def _sql_texts(texts: Sequence[str]) -> str:
    """Return texts as SQL literals with commas in between.

    Examples
    --------
    >>> _sql_texts(["V1", "O'Neill"])
    "'V1', 'O''Neill'"
    """
    return ", ".join("'" + text.replace("'", "''") + "'" for text in texts)
