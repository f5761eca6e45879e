"""Strict reader of tables whose columns have our own names and units: the samples of one planned or recorded trip."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import Check, Fault, InvalidInput, raise_faults, require_type
from tripwatt.sources.columnar import TableFile, csv_table, open_table
from tripwatt.sources.delimited import open_delimited
from tripwatt.sources.mapping import ENERGY
from tripwatt.sources.naming import candidates, column_names
from tripwatt.trips import (
    COLUMNS,
    REQUIRED_COLUMNS,
    Context,
    Flag,
    Log,
    TripSet,
    structure_faults,
    table_of,
    value_faults,
)
from tripwatt.trips.headers import header_faults, same_quantity

Frames = pd.DataFrame | Sequence[pd.DataFrame] | Mapping[str, pd.DataFrame]
"""Logs as tables in memory."""

MIN_SAMPLES: Final = 3
"""Least number of samples of a drive."""


def read_canonical(
    path: Path | str, *, required: Sequence[str] = REQUIRED_COLUMNS, minimum: int = MIN_SAMPLES
) -> pd.DataFrame:
    """Read the samples of one trip from a CSV or Parquet file with the columns of `tripwatt.trips.COLUMNS`.

    Parameters
    ----------
    path : path
    required : sequence of str
        Columns that have to be there.
    minimum : int
        Smallest number of samples.

    Returns
    -------
    DataFrame
        float64; NaN if a cell is empty.

    Raises
    ------
    InvalidInput
        With every fault: a name or unit that is not ours, a missing column, too few samples, an impossible value, times that
        are negative or do not increase.

    Examples
    --------
    >>> read_canonical("nowhere.csv")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: cannot read the file: nowhere.csv...
    """
    path = Path(path)
    if not path.is_file():
        got = "a folder" if path.is_dir() else "no such file"
        raise InvalidInput.of("cannot read the file", f"{path}", got, "a file")
    return _samples_of(open_table(path), f"{path}", required, minimum)


def canonical_of_text(content: bytes, where: str = "table") -> pd.DataFrame:
    r"""Read the samples of one trip from the content of a CSV file, as `read_canonical` does from a file.

    Examples
    --------
    >>> canonical_of_text(b"time_s,speed_m_s\n0,0\n1,2.5\n2,4")["speed_m_s"].tolist()
    [0.0, 2.5, 4.0]
    """
    table = csv_table(open_delimited(Path(where), content), [])
    return _samples_of(table, where, REQUIRED_COLUMNS, MIN_SAMPLES)


def canonical_samples(
    columns: Mapping[str, FloatArray] | pd.DataFrame,
    where: str = "samples",
    *,
    required: Sequence[str] = REQUIRED_COLUMNS,
    minimum: int = MIN_SAMPLES,
) -> pd.DataFrame:
    """Check columns in memory by the rules of `read_canonical`, and return them as samples of a trip. O(samples x columns).

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (samples,), or DataFrame
        NaN = missing value.
    where : str
        Name for messages.
    required : sequence of str
        Columns that have to be there.
    minimum : int
        Smallest number of samples.

    Raises
    ------
    InvalidInput
        With every fault: a name that is not ours, a column that is missing, not numeric or of another length, and the faults
        of `read_canonical`.

    Examples
    --------
    >>> canonical_samples({"time_s": np.arange(3.0), "speed_m_s": np.ones(3)})["speed_m_s"].sum()
    np.float64(3.0)
    """
    names = [*map(str, columns)]
    if isinstance(columns, pd.DataFrame):
        raise_faults(_header_faults(names, required, where))
        raise_faults(structure_faults(columns, where, required=()))
        columns = {name: columns[name].to_numpy(np.float64) for name in names}
    known = {name: values for name, values in columns.items() if name in COLUMNS}
    lengths = {name: len(values) for name, values in known.items()}
    if len(set(lengths.values())) > 1:
        got = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        different = Fault("columns of different lengths", where, got[:300], "one value per sample in each")
        raise InvalidInput([*_header_faults(names, required, where), different])
    return _checked(known, names, where, required, minimum)


def read_frames(frames: Frames) -> TripSet:
    """Make logs of tables in memory with canonical columns. O(samples).

    Parameters
    ----------
    frames : DataFrame, sequence of DataFrame, or mapping of str to DataFrame
        One table for each drive; the keys of a mapping are the names of the drives. A single table may have many drives, with their
        names in a column `trip`. A table without `time_s` may have times as its index. Columns that are no signals are kept as
        covariates.

    Raises
    ------
    InvalidInput
        With the faults of the structure of all tables.

    Examples
    --------
    >>> drive = pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": 10.0, "observed_energy_wh": [0.0, 90.0], "traffic": 2})
    >>> logs = read_frames({"A": drive})
    >>> logs.logs[0], logs.notes[0].value
    (<Log A: 0.6 km in 60 s, 0.09 kWh measured, 2 samples>, 'traffic')
    """
    require_type("source", frames, Iterable, "a path, or tables")
    if isinstance(frames, pd.DataFrame):
        groups = frames.groupby(frames.get("trip", ["trip"] * len(frames)), sort=False)
        frames = {f"{name}": part for name, part in groups}
    elif not isinstance(frames, Mapping):
        frames = {f"trip {number}": frame for number, frame in enumerate(frames, start=1)}
    if not frames:
        raise InvalidInput.of("no tables", "source", "none", "at least one table with the samples of a drive")
    with Check() as check:
        logs = [check(_log_of_frame, name, frame) for name, frame in frames.items()]
    others = dict.fromkeys(c for log in logs for c in log.samples if c not in (*COLUMNS, ENERGY))
    notes = (Flag("covariates_kept", "table", ", ".join(map(str, others))),) if others else ()
    return TripSet("table", tuple(logs), notes)


def _log_of_frame(name: str, frame: pd.DataFrame) -> Log:
    require_type(name, frame, pd.DataFrame, "a DataFrame")
    started = None
    if "time_s" not in frame and len(frame) and isinstance(frame.index, pd.DatetimeIndex):
        started = frame.index[0].tz_localize(None).to_pydatetime()
        frame = frame.assign(time_s=(frame.index - frame.index[0]).total_seconds())
    samples = frame.drop(columns="trip", errors="ignore").reset_index(drop=True)
    return Log.from_samples(name, samples, Context(started_at=started))


def _samples_of(table: TableFile, where: str, required: Sequence[str], minimum: int) -> pd.DataFrame:
    names = [name for name in table.names if name]
    known = [name for name in dict.fromkeys(names) if name in COLUMNS]
    columns = dict(zip(known, table.numbers(known), strict=True))
    if table.faults:
        raise InvalidInput([*_header_faults(names, required, where), *table.faults])
    return _checked(columns, names, where, required, minimum)


def _checked(
    columns: Mapping[str, FloatArray], names: Sequence[str], where: str, required: Sequence[str], minimum: int
) -> pd.DataFrame:
    samples = table_of(columns)
    raise_faults([*_header_faults(names, required, where), *_sample_faults(samples, where, minimum)])
    return samples


def _header_faults(names: Sequence[str], required: Sequence[str], where: str) -> Iterator[Fault]:
    signals = [name for name in names if name != ENERGY]  # of our own tables; ignored
    yield from header_faults(signals, COLUMNS, where, "unknown column or unit", _hint)
    got = f"columns {', '.join(name[:40] for name in names[:12])}"
    fix = "convert the log with `tripwatt mapping apply`"
    for name in required:
        if name not in names:
            yield Fault("missing column", where, got, f"a column {name!r}", fix)


def _hint(name: str) -> str:
    named = (ours for ours in column_names() if ours in COLUMNS and candidates(ours, [name]))
    near = next(named, same_quantity(name, COLUMNS))
    return f"did you mean {near} in {COLUMNS[near].unit}?" if near else "rename the column or leave it out"


def _sample_faults(samples: pd.DataFrame, where: str, minimum: int) -> Iterator[Fault]:
    if "time_s" not in samples:  # a missing column, which is named
        return
    if len(samples) < minimum:
        yield Fault("too few samples", where, f"{len(samples)}", f"at least {minimum}")
        return
    yield from value_faults(samples, where)
    first_s = samples["time_s"].iloc[0]  # the least: else they do not increase
    if first_s < 0:
        yield Fault("negative time", f"{where}, column 'time_s', row 1", f"{first_s:g} s", "0 s or more")
