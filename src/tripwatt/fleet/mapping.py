"""Compute the rows of all trips of a store and the segments of a sample of them, data file by data file.

`run_task` is a pure function of one immutable data file and of the trips wanted from it. Its result gets its final name
only when it is complete, and the name is a digest of everything that the result depends on. A run that was killed and started
again therefore finds its finished results, and computes nothing twice.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tripwatt.arrays import IntArray, by_key
from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.files import write_file
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.features import FEATURES, trip_features, trip_variance_wh2
from tripwatt.fleet.statistics import KEYS, NO_DRIVER, ROWS, TripRows
from tripwatt.fleet.store import TripStore, read_file
from tripwatt.fleet.store.delta import DeltaFolder, is_one_of, is_url
from tripwatt.hybrid import SegmentTable, segment_table
from tripwatt.hybrid.groups import Sums
from tripwatt.hybrid.segments import unknown_climb_wh
from tripwatt.physics import simulate_trip
from tripwatt.trips import REQUIRED_COLUMNS, Log, Plan, Trip, observed_cumulative_energy, table_of
from tripwatt.vehicles import Vehicle, load_vehicle

VERSION: Final = 3
"""Number to raise whenever the rows of the same trips change."""

_MEASURED: Final = (*REQUIRED_COLUMNS, "voltage_v", "current_a", "observed_energy_wh", "soc", "displayed_soc")
"""Columns of a drive from which its measured power and its charge are computed."""

_KEPT: Final = pa.schema([*ROWS, pa.field("batch", pa.string())])
"""Schema of the rows that `store_rows` keeps; `drive` is null if a trip has no row."""


class _FileResult(NamedTuple):
    """The Parquet files that a task writes.

    Attributes
    ----------
    rows : Path
        Rows of the schema `ROWS`. They are written last: the task is finished if this file exists.
    segments : Path
        Segments of the sampled trips; there is no such file if there are none.
    """

    rows: Path
    segments: Path


@dataclass(frozen=True, slots=True)
class _FileTask:
    """The trips to read from one data file.

    Attributes
    ----------
    samples : DeltaFolder
        Table of samples, whose place is the same in every process.
    path : str
        Path of the data file, relative to the table.
    rows : tuple of mapping
        Rows of `trips` that are wanted from the file.
    sampled : frozenset of str
        Digests of the trips whose segments are written as well.
    out : str
        Folder of the results.
    """

    samples: DeltaFolder
    path: str
    rows: tuple[Mapping[str, Any], ...]
    sampled: frozenset[str]
    out: str

    @property
    def name(self) -> str:
        """Digest of everything that the result depends on."""
        wanted = sorted((row["digest"], row["digest"] in self.sampled) for row in self.rows)
        text = json.dumps([VERSION, self.samples.place, self.path, wanted, FEATURES])
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    @property
    def result(self) -> _FileResult:
        """The files of the result."""
        return _FileResult(*(Path(self.out, f"{self.name}.{kind}.parquet") for kind in _FileResult._fields))


def file_tasks(
    store: TripStore, rows: Iterable[Mapping[str, Any]], out: Path | str, sampled: Iterable[str] = ()
) -> list[_FileTask]:
    """Make the tasks for some trips of a store; trips without a sound drive or measured energy are left out.

    Parameters
    ----------
    store : TripStore
    rows : iterable of mapping
        Rows of `trips`, all columns.
    out : path
        Folder of the results, which every worker can reach under this name.
    sampled : iterable of str
        Digests of the trips whose segments are written as well.
    """
    usable = [row for row in rows if row["drives"] and row["energy_wh"] is not None]
    sampled = frozenset(sampled)
    folder, samples = str(Path(out).absolute()), DeltaFolder(_place_of(store), dict(store.options))
    return [
        _FileTask(samples, path, wanted, sampled & {row["digest"] for row in wanted}, folder)
        for path, wanted in store.file_trips(usable).items()
    ]


def _place_of(store: TripStore) -> str:
    """Return the place of the samples, which is the same from every folder."""
    place = store.samples.place
    return place if is_url(place) else str(Path(place).absolute())


def map_store(
    tasks: Sequence[_FileTask], workers: Workers, progress: Callable[[int, int], None] | None = None
) -> Iterator[_FileResult]:
    """Yield the results of all tasks, those of finished tasks first.

    Parameters
    ----------
    tasks : sequence of _FileTask
    workers : Workers
    progress : callable, optional
        Called with (finished tasks, all tasks) after each task that is run.
    """
    by_state = by_key(tasks, lambda task: task.result.rows.is_file())
    yield from (task.result for task in by_state.get(True, ()))
    open_tasks = by_state.get(False, [])
    new_results = workers.map(run_task, open_tasks)
    for number, result in enumerate(new_results, len(tasks) - len(open_tasks) + 1):
        if progress is not None:
            progress(number, len(tasks))
        yield result


def run_task(task: _FileTask) -> _FileResult:
    """Audit, simulate, cut and sum up the wanted trips of one data file, and write their rows. A pure function of the file.

    Drives that cannot be simulated with their car model, or have no measured energy, are left out.
    """
    result = task.result
    if result.rows.is_file():
        return result
    rows: list[dict[str, Any]] = []
    segments: list[pa.Table] = []
    for row, log in read_file(task.samples.filesystem(), task.path, task.rows):
        for drive in sound_drives(log, row):
            table = drive_segments(drive, row["car_model"])
            if table is None:
                continue
            rows.append(drive_row(drive, table, row))
            if row["digest"] in task.sampled:
                segments.append(_segment_rows(table, row))
    result.rows.parent.mkdir(parents=True, exist_ok=True)
    if segments:
        write_parquet(result.segments, [pa.concat_tables(segments)], segments[0].schema)
    write_parquet(result.rows, [pa.Table.from_pylist(rows, schema=ROWS)], ROWS)
    return result


def write_parquet(path: Path, tables: Iterable[pa.Table], schema: pa.Schema) -> None:
    """Write tables to a Parquet file, each as one row group, whole or not at all: another process may write the same file."""

    def write(partial: Path) -> None:
        with pq.ParquetWriter(partial, schema, compression="zstd") as writer:
            for table in tables:
                writer.write_table(table)

    write_file(path, write)


def sound_drives(log: Log, row: Mapping[str, Any]) -> Sequence[Trip]:
    """Return the sound drives of a stored log: the log as it is if its audit changed nothing, else the drives of a new audit."""
    return (Trip.from_log(log),) if row["as_logged"] else audit([log]).trips


def drive_segments(drive: Trip, car_model: str) -> SegmentTable | None:
    """Cut a drive into segments; returns None if it has no measured energy or cannot be simulated.

    Parameters
    ----------
    drive : Trip
    car_model : str
    """
    if drive.observed_energy_wh is None:
        return None
    samples = table_of({name: drive.array(name) for name in _MEASURED if name in drive})
    measured = replace(drive, samples=samples)
    car = load_car(car_model)
    try:
        plan = Plan.from_trip(drive)
        return segment_table(plan, simulate_trip(car, plan), measured, climb_wh=unknown_climb_wh(plan, car))
    except InvalidInput:
        return None


@lru_cache(maxsize=256)
def load_car(name: str) -> Vehicle:
    """Load a car of the library or of a TOML file, once in each process.

    Raises
    ------
    InvalidInput
        If there is no such car.
    """
    if name.endswith(".toml") and not Path(name).is_file():
        got, allowed = "no such file", "the file with which the trips were added"
        raise InvalidInput.of("the file of a car model is missing", name, got, allowed, "put it back there")
    return load_vehicle(name)


def drive_row(drive: Trip, table: SegmentTable, row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of one drive, with the columns of `ROWS`.

    Parameters
    ----------
    drive : Trip
    table : SegmentTable
        Segments of the drive.
    row : mapping
        Row of `trips` of its log.
    """
    ambient = table.features["ambient_temperature_degc"].to_numpy(dtype=np.float64)
    observed = table.totals_wh(table.observed_power_w)[0]
    started = drive.context.started_at
    readings = _charge_at_ends(drive, float(observed))
    return {
        **_key_values(row, drive.trip_id),
        "started_at": None if started is None else started.isoformat(),
        "distance_m": drive.distance_m,
        "hours": float(table.hours.sum()),
        "ambient_temperature_degc": float(ambient[0]),
        "simulated_wh": float(table.totals_wh(table.simulated_w)[0]),
        "observed_wh": float(observed),
        "displayed_start": float(readings[0]),
        "displayed_end": float(readings[1]),
        "variance_wh2": float(trip_variance_wh2(table)[0] + (drive.observed_energy_std_wh or 0.0) ** 2),
        **{f"x_{name}": float(x) for name, x in zip(FEATURES, trip_features(table)[0], strict=True)},
    }


def _charge_at_ends(drive: Trip, observed_wh: float) -> Any:
    """Return the displayed charge at departure and arrival, or that of the battery management if the display was not logged, shape (2,).

    Where it falls by a step, a reading has no error of rounding: the ends are those of the line through these points over the energy. With
    fewer than two, or without an energy along the drive, they are the first and last reading; NaN without a reading.
    """
    logged = [drive.array(name) for name in ("displayed_soc", "soc") if name in drive]
    unknown = np.full(len(drive.samples), np.nan)
    charge = next((column for column in logged if np.isfinite(column).any()), unknown)
    energy_wh = observed_cumulative_energy(drive.samples)
    points = np.stack([unknown if energy_wh is None else energy_wh, charge])
    known = points[:, np.isfinite(points).all(axis=0)]
    falls = 0.5 * (known[:, 1:] + known[:, :-1])[:, np.diff(known[1]) < 0.0]
    if falls.shape[1] > 1 and np.ptp(falls[0]) > 0.0:
        return np.polyval(np.polyfit(falls[0], falls[1], 1), np.array([0.0, observed_wh]))
    readings = charge[np.isfinite(charge)]
    return readings[[0, -1]] if len(readings) else charge[:2]


def _key_values(row: Mapping[str, Any], drive: str) -> dict[str, str]:
    values = {**row, "driver": row["driver"] or NO_DRIVER, "drive": drive}
    return {name: values[name] for name in KEYS}


def _segment_rows(table: SegmentTable, row: Mapping[str, Any]) -> pa.Table:
    """Return the segments of one drive as rows: keys, features, hours, powers and readings of the charge."""
    n = len(table.hours)
    charge = np.full((1, 4), np.nan) if table.charge is None else table.charge
    keys = {name: pa.repeat(text, n) for name, text in _key_values(row, table.trip_ids[0]).items()}
    features = {f"feature_{name}": values.to_numpy(np.float64) for name, values in table.features.items()}
    powers = {"hours": table.hours, "base_w": table.simulated_w, "observed_w": table.observed_power_w}
    readings = {f"charge_{k}": np.full(n, charge[0, k]) for k in range(4)}
    return pa.table({**keys, **features, **powers, **readings})


@dataclass(frozen=True, eq=False)
class SampledTrips:
    """Segments of a sample of drives, sorted by car model, vehicle, driver and digest.

    Attributes
    ----------
    table : SegmentTable
        The segments. Its `trip_ids` are ``digest/drive``.
    groups : tuple of (str, str, str)
        Car model, vehicle and driver of each drive.
    digests : tuple of str
    """

    table: SegmentTable
    groups: tuple[tuple[str, str, str], ...]
    digests: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.groups)

    def sums(self, members: IntArray) -> Sums:
        """Return the sums of some of the drives, given by their numbers."""
        table = self.table
        values = (trip_features(table), table.totals_wh(table.residual_w), trip_variance_wh2(table))
        return Sums.from_trips([self.groups[i] for i in members], *(value[members] for value in values))

    @classmethod
    def read(cls, results: Iterable[_FileResult]) -> SampledTrips:
        """Read the segments of results, and keep repeated ones once; raise `InvalidInput` if there are none. O(rows log rows)."""
        tables = [pq.read_table(path) for _, path in sorted(results) if path.is_file()]
        if not tables:
            raise InvalidInput.of("no trips", "sample", "0", "at least one trip with measured energy")
        frame = pa.concat_tables(tables).to_pandas()
        keys = [*KEYS]
        frame = frame.sort_values(keys, kind="stable", ignore_index=True)
        frame = frame.drop_duplicates([*keys, "feature_time_s"], ignore_index=True)
        drives = frame[keys].drop_duplicates()
        offsets = np.append(drives.index.to_numpy(), len(frame)).astype(np.int64)
        features = frame.filter(regex="^feature_").rename(columns=lambda name: name.removeprefix("feature_"))
        names = tuple(f"{d}/{name}" for d, name in zip(drives["digest"], drives["drive"], strict=True))
        hours, base_w, observed_w = (frame[name].to_numpy() for name in ("hours", "base_w", "observed_w"))
        charge = frame.loc[drives.index, [f"charge_{k}" for k in range(4)]].to_numpy(dtype=np.float64)
        table = SegmentTable(names, offsets, features, hours, base_w, observed_w, None, charge)
        groups = tuple(drives[keys[:3]].itertuples(index=False, name=None))
        return cls(table, groups, tuple(drives["digest"]))


def read_rows(results: Iterable[_FileResult]) -> TripRows:
    """Read the rows of all results, sorted."""
    return TripRows.join([pq.read_table(result.rows).cast(ROWS) for result in results])


def usable_trips(store: TripStore, **which: Any) -> pd.DataFrame:
    """List the trips with a sound drive and measured energy; `which` is as in `TripStore.trips`."""
    columns = ["car_model", "vehicle_id", "digest", "batch", "drives", "energy_wh"]
    listed = store.trips(columns=columns, **which)
    return listed[(listed["drives"] > 0) & listed["energy_wh"].notna()]


def store_rows(
    store: TripStore, listed: pd.DataFrame, work: Path | str, workers: Workers, *,
    sampled: frozenset[str] = frozenset(), progress: Callable[[int, int], None] | None = None,
) -> tuple[TripRows, list[_FileResult]]:  # fmt: skip
    """Return the rows of the listed trips, and the results of the tasks that were needed for them.

    All rows are kept in one file of `work`, by trip and batch. A later call reads the samples of new and of sampled trips only, also
    after the data files of the store were merged.

    Parameters
    ----------
    store : TripStore
    listed : DataFrame
        From `usable_trips`.
    work : path
        Folder of finished parts.
    workers, progress
        As in `map_store`.
    sampled : frozenset of str
        Digests of the trips whose segments are needed, too.
    """
    name = hashlib.sha256(json.dumps([VERSION, _place_of(store), FEATURES]).encode()).hexdigest()[:32]
    path = Path(work) / f"{name}.parquet"
    kept = pq.read_table(path) if path.is_file() else _KEPT.empty_table()
    batches = dict(zip(listed["digest"], listed["batch"], strict=True))
    pairs = [*zip(kept["digest"].to_pylist(), kept["batch"].to_pylist(), strict=True)]
    new = frozenset(batches) - {digest for digest, batch in pairs if batches.get(digest) == batch}
    results: list[_FileResult] = []
    if new | sampled:
        tasks = file_tasks(store, store.trip_rows(digests=new | sampled), work, sampled)
        results = list(map_store(tasks, workers, progress))
    if new:
        made = read_rows(results).table.filter(is_one_of("digest", new))
        without = new.difference(made["digest"].to_pylist())  # a trip without a row is not read again, either
        empty = pa.Table.from_pylist([{"digest": digest} for digest in sorted(without)], ROWS)
        made = pa.concat_tables([made, empty])
        of_batch = pa.array([batches[digest] for digest in made["digest"].to_pylist()], pa.string())
        kept = kept.filter(~is_one_of("digest", new))
        kept = pa.concat_tables([kept, made.append_column(_KEPT.field("batch"), of_batch)])
        path.parent.mkdir(parents=True, exist_ok=True)
        write_parquet(path, [kept], _KEPT)
    wanted = is_one_of("digest", batches) & pc.field("drive").is_valid()
    return TripRows.join([kept.filter(wanted).select(ROWS.names)]), results


def sample_digests(
    rows: Sequence[Mapping[str, Any]], per_vehicle: int, vehicles: int, seed: int = 0
) -> frozenset[str]:
    """Draw a seeded sample of the trips with a sound drive and measured energy, and return their digests.

    The choice depends only on the seed, the vehicles' names and the digests, not on the order of the trips.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of `trips`.
    per_vehicle : int
        Largest number of trips of each vehicle.
    vehicles : int
        Largest number of vehicles of each car model.
    seed : int
    """

    def rank(text: str) -> str:
        return hashlib.sha256(f"{seed}/{text}".encode()).hexdigest()

    usable = (row for row in rows if row["drives"] and row["energy_wh"] is not None)
    by_vehicle = by_key(usable, lambda row: (row["car_model"], row["vehicle_id"]))
    chosen: list[str] = []
    for keys in by_key(by_vehicle, lambda key: key[0]).values():
        for key in sorted(keys, key=lambda k: rank(k[1]))[:vehicles]:
            chosen += sorted((row["digest"] for row in by_vehicle[key]), key=rank)[:per_vehicle]
    return frozenset(chosen)
