"""Rows of the two tables of a store: made from a log when it is added, and made into a log again when it is read."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Final

import numpy as np
import pyarrow as pa

from tripwatt.arrays import FloatArray
from tripwatt.auditing import audit, logs
from tripwatt.trips import COLUMNS, Context, Log, Recorded, observed_energy, table_of

_COUNTED: Final = "observed_energy_wh"
"""Cumulative energy of a log that has neither voltage nor current."""

SIGNALS: Final = (*COLUMNS, _COUNTED)
"""Columns of the samples of a log that a store keeps."""

_UNKNOWN_MONTH: Final = "unknown"
"""Month of a log without a time of departure."""

_KEYS: Final = {"bucket": pa.int32()} | dict.fromkeys(("month", "batch", "digest", "vehicle_id"), pa.string())
SAMPLES: Final = pa.schema(_KEYS | {"sample": pa.int32()} | dict.fromkeys(SIGNALS, pa.float64()))
"""One row per sample; `sample` counts from 0 within a log."""

TRIPS: Final = pa.schema(
    _KEYS
    | dict.fromkeys(("trip_id", "car_model", "driver", "started_at"), pa.string())
    | {"started_at_utc": pa.timestamp("us", tz="UTC")}
    | dict.fromkeys(("distance_m", "duration_s", "energy_wh", "energy_std_wh"), pa.float64())
    | {"energy_from": pa.string(), "drives": pa.int32(), "as_logged": pa.bool_()}
    | {"ambient_temperature_degc": pa.float64()}
    | dict.fromkeys(("findings", "context", "columns"), pa.string())
    | {"samples": pa.int32()}
)
"""One row per log. `findings`, `context` and `columns` are JSON; `started_at` is ISO 8601 as it was logged, by which rows are sorted, and
`started_at_utc` the same instant, null without an offset.
`as_logged` is true if the audit found one drive and changed nothing in it."""


@dataclass(frozen=True, eq=False, slots=True)
class StoredLog:
    """A log to be added to a store, with its row of `trips`.

    Attributes
    ----------
    row : dict
        Every column of `TRIPS` but `batch`.
    log : Recorded
        The log with its samples.
    """

    row: dict[str, Any]
    log: Recorded


def bucket_of(vehicle_id: str, buckets: int) -> int:
    """Return the hash bucket of a vehicle, 0 to `buckets` - 1; the same on every machine.

    Examples
    --------
    >>> bucket_of("V17", 16), bucket_of("V17", 1)
    (13, 0)
    """
    return int.from_bytes(hashlib.sha256(vehicle_id.encode()).digest()[:8], "big") % buckets


def month_of(started_at: dt.datetime | None) -> str:
    """Return the month of a departure as the name of a partition.

    Examples
    --------
    >>> month_of(dt.datetime(2024, 5, 31, 8)), month_of(None)
    ('2024-05', 'unknown')
    """
    return _UNKNOWN_MONTH if started_at is None else f"{started_at:%Y-%m}"


def digest_of(vehicle_id: str, log: Recorded) -> str:
    """Return the SHA-256 of the vehicle, the departure and every kept value of a log, but not of its name. O(samples).

    Examples
    --------
    >>> import pandas as pd
    >>> log = Log.from_samples("a", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0]}))
    >>> digest_of("V1", log) == digest_of("V1", log), digest_of("V1", log) == digest_of("V2", log)
    (True, False)
    """
    sha = hashlib.sha256()
    started = log.context.started_at
    for text in (vehicle_id, "" if started is None else started.isoformat()):
        sha.update(text.encode() + b"\0")
    for name in kept_columns(log):
        sha.update(name.encode() + b"\0")
        values = log.array(name)
        # all NaN get the same bytes, and so do zeros of both signs
        sha.update(np.where(np.isnan(values), np.nan, values + 0.0).astype("<f8").tobytes())
    return sha.hexdigest()


def kept_columns(log: Recorded) -> list[str]:
    """Return the names of the columns of a log that a store keeps, in the order of `SIGNALS`."""
    return [name for name in SIGNALS if name in log]


def stored_log(log: Recorded, vehicle_id: str, car_model: str, buckets: int) -> StoredLog:
    """Audit one log by itself and make its row of `trips`. O(samples).

    Parameters
    ----------
    log : Recorded
    vehicle_id : str
    car_model : str
        Name of a car of the library.
    buckets : int
        Number of hash buckets of the store.
    """
    audited = audit([log])
    started = log.context.started_at
    drives = audited.trips or (log,)
    energy, std, source = _measured_energy(audited.trips)
    ambient = "ambient_temperature_degc"
    row = {
        "bucket": bucket_of(vehicle_id, buckets),
        "month": month_of(started),
        "digest": digest_of(vehicle_id, log),
        "vehicle_id": vehicle_id,
        "trip_id": log.trip_id,
        "car_model": car_model,
        "driver": log.context.driver,
        "started_at": None if started is None else started.isoformat(),
        "started_at_utc": started if started is not None and started.tzinfo is not None else None,
        "distance_m": sum(logs.driven_m(drive.samples) for drive in drives),
        "duration_s": sum(drive.duration_s for drive in drives),
        "energy_wh": energy,
        "energy_std_wh": std,
        "energy_from": source,
        "drives": len(audited.trips),
        "as_logged": _unchanged(log, audited.trips),
        ambient: float(np.nanmean(drives[0].array(ambient))) if drives[0].has(ambient) else None,
        "findings": json.dumps([asdict(f) for f in audited.findings], ensure_ascii=False),
        "context": json.dumps(context_values(log), ensure_ascii=False),
        "columns": json.dumps(kept_columns(log)),
        "samples": len(log),
    }
    return StoredLog(row, log)


def _unchanged(log: Recorded, drives: Sequence[Recorded]) -> bool:
    """Return whether the audit left the log unchanged: one drive with the same id, context, energy and samples."""
    if len(drives) != 1:
        return False
    (drive,) = drives
    names = "trip_id", "context", "observed_energy_wh"
    same = (getattr(drive, name) == getattr(log, name) for name in names)
    return all(same) and drive.samples.equals(log.samples)


def _measured_energy(drives: Sequence[Recorded]) -> tuple[float | None, float | None, str]:
    """Sum up the measured energy of sound drives.

    Returns
    -------
    energy : float or None
        Energy [Wh]; None if a drive has no measured energy, or there is no drive.
    std : float or None
        Standard error of the energy [Wh]; None if no drive has one.
    source : {"voltage and current", "state of charge", "counter", "unknown"}
        Signals from which the energy was measured.
    """
    if not drives or any(drive.observed_energy_wh is None for drive in drives):
        return None, None, "unknown"
    energy = math.fsum(drive.observed_energy_wh or 0.0 for drive in drives)
    errors = [drive.observed_energy_std_wh for drive in drives]
    std = None if all(e is None for e in errors) else math.hypot(*(e or 0.0 for e in errors))
    if all({"voltage_v", "current_a"} <= set(drive.samples.columns) for drive in drives):
        return energy, std, "voltage and current"
    return energy, std, "state of charge" if any(d.observed_energy_common_std for d in drives) else "counter"


def context_values(log: Recorded) -> dict[str, Any]:
    """Return the known context of a log and its energy errors, for `log_from_rows`; departure and driver have their own columns."""
    values = {field: getattr(log.context, field.name) for field in fields(Context)}
    in_columns = ("started_at", "driver")
    known = {f.name: value for f, value in values.items() if f.name not in in_columns and value != f.default}
    if log.observed_energy_std_wh is not None:
        known["energy_std_wh"] = log.observed_energy_std_wh
    if log.observed_energy_common_std:
        known["energy_common_std"] = log.observed_energy_common_std
    return known


def samples_table(stored: Sequence[StoredLog], batch: str) -> pa.Table:
    """Make the rows of `samples` of a batch of logs; missing columns and values are null. O(samples x columns)."""
    counts = [len(s.log) for s in stored]
    names = ("bucket", "month", "digest", "vehicle_id")
    arrays: dict[str, Any] = {name: np.repeat([s.row[name] for s in stored], counts) for name in names}
    arrays |= {"batch": pa.repeat(batch, sum(counts)), "sample": np.concatenate([*map(np.arange, counts)])}
    for name in SIGNALS:
        blocks = [s.log.array(name) if name in s.log else np.full(len(s.log), np.nan) for s in stored]
        arrays[name] = pa.array(np.concatenate(blocks), from_pandas=True)
    return pa.table(arrays, schema=SAMPLES)


def log_from_rows(row: Mapping[str, Any], columns: Mapping[str, FloatArray]) -> Log:
    """Rebuild a log from its row of `trips` and its samples in their order, with exactly the values that were added.

    Parameters
    ----------
    row : mapping
        A row of `trips`.
    columns : mapping of str to ndarray, shape (samples,)
        At least the columns named in the row; NaN if a value is missing.
    """
    names = json.loads(row["columns"])
    samples = table_of({name: columns[name] for name in names})
    known = json.loads(row["context"])
    std, common = known.pop("energy_std_wh", None), known.pop("energy_common_std", 0.0)
    started = row["started_at"]
    context = Context(
        **known,
        driver=row["driver"],
        started_at=None if started is None else dt.datetime.fromisoformat(started),
    )
    return Log(row["trip_id"], samples, context, observed_energy(samples), None, std, common)
