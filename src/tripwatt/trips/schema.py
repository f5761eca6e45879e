"""Checks of a table of samples: its columns, and the bounds of their values.

Readers of logs produce columns with the names of `COLUMNS`, and models of trips use these; all renaming and unit conversion is in
`sources`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import DAMAGE, Fault, and_more, excerpt, require_type
from tripwatt.trips.columns import COLUMNS, IN_KM_H, REQUIRED_COLUMNS, raise_faults


def structure_faults(
    samples: pd.DataFrame, where: str, *, required: Sequence[str] = REQUIRED_COLUMNS
) -> Iterator[Fault]:
    """Yield the faults of the structure of a table, with which it cannot be a trip. O(columns).

    Parameters
    ----------
    samples : DataFrame
        One row per sample.
    where : str
        Name of the table in messages.
    required : sequence of str
        Columns that must exist.

    Yields
    ------
    Fault
        One for each missing column, for too few samples, for each duplicate name, and for each canonical column that is not
        numeric.

    Examples
    --------
    >>> [fault.what for fault in structure_faults(pd.DataFrame({"time_s": [0.0]}), "drive.csv")]
    ['missing column', 'too few samples']
    """
    require_type(where, samples, pd.DataFrame, "a DataFrame")
    for name in required:
        if name not in samples.columns:
            got = f"columns {sorted(map(str, samples.columns))}"[:200]
            yield Fault("missing column", where, got, f"a column {name!r}")
    if len(samples) < 2:
        yield Fault("too few samples", where, f"{len(samples)}", "at least 2")
    names = samples.columns
    twice = [] if names.is_unique else names[names.duplicated()].unique().tolist()
    for name in twice:
        yield Fault("column given twice", where, excerpt(name), "each name once")
    for name in names:
        if name in (*COLUMNS, "observed_energy_wh") and name not in twice and not _is_numeric(samples[name]):
            yield Fault("not a number", f"{where}, column {name!r}", str(samples[name].dtype), "numbers")


def _is_numeric(values: pd.Series[Any]) -> bool:
    """Return whether a column has real numbers of NumPy, or of an extension type without missing values.

    Truth values and complex numbers do not count.
    """
    types, own_type = pd.api.types, isinstance(values.dtype, np.dtype)
    is_real = types.is_numeric_dtype(values) and not types.is_complex_dtype(values)
    return is_real and not types.is_bool_dtype(values) and (own_type or not bool(values.isna().any()))


def value_faults(samples: pd.DataFrame | Mapping[str, FloatArray], where: str) -> Iterator[Fault]:
    """Yield the faults of the values of a table without structure faults. O(samples x columns).

    Parameters
    ----------
    samples : DataFrame or mapping of str to ndarray
        One row per sample; `structure_faults` must find no fault.
    where : str
        Name of the table in messages.

    Yields
    ------
    Fault
        At most one for each column with missing values (if it is required), one for each column with values out of bounds,
        and one if times do not increase.

    Examples
    --------
    >>> [fault.what for fault in value_faults(pd.DataFrame({"time_s": [1.0, 0.0], "speed_m_s": [0.0, np.nan]}), "drive.csv")]
    ['missing value', 'time does not increase']
    """
    for name, column in ((name, COLUMNS[name]) for name in map(str, samples) if name in COLUMNS):
        values = np.asarray(samples[name], dtype=np.float64)
        place = f"{where}, column {name!r}, row "
        missing = np.flatnonzero(~np.isfinite(values)) if name in REQUIRED_COLUMNS else np.empty(0, np.int64)
        if len(missing):
            got = f"{values[missing[0]]}{and_more(missing)}"
            first = int(missing[0])
            yield Fault("missing value", f"{place}{first + 1}", got, "a finite number", at=(name, first))
        outside = np.flatnonzero((values < column.minimum) | (values > column.maximum))
        if len(outside):
            unit = "" if column.unit == "1" else f" {column.unit}"
            got = f"{values[outside[0]]:g}{unit}{and_more(outside)}"
            fix = IN_KM_H if name == "speed_m_s" and np.nanmax(values) > column.maximum else ""
            at = name, int(outside[0])
            yield Fault("value out of range", f"{place}{at[1] + 1}", got, column.allowed, fix, at=at)
    time = np.asarray(samples["time_s"], dtype=np.float64)
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        row = int(back[0]) + 1
        got = f"{time[row]:g} s after {time[row - 1]:g} s{and_more(back)}"
        place = f"{where}, column 'time_s', row {row + 1}"
        yield Fault("time does not increase", place, got, "increasing times", at=("time_s", row))


@contextmanager
def faults_named(samples: pd.DataFrame, where: str) -> Iterator[None]:
    """Raise `InvalidInput` with the faults of samples that were not checked, if the block fails on them."""
    try:
        yield
    except DAMAGE:
        validate_samples(samples, where)
        raise


def validate_samples(samples: pd.DataFrame, where: str) -> None:
    """Raise `InvalidInput` with every fault of the samples, if there is any.

    Parameters
    ----------
    samples : DataFrame
        One row per sample, canonical columns.
    where : str
        Name of the table in messages.

    Raises
    ------
    InvalidInput
        With every fault of the structure, or, if the structure has none, with every fault of the values.

    Examples
    --------
    >>> validate_samples(pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, -9.0]}), "drive.csv")
    Traceback (most recent call last):
        ...
    tripwatt.errors.InvalidInput: value out of range: drive.csv, column 'speed_m_s', row 2: got -9 m/s; allowed: 0 to 90 m/s
    """
    raise_faults(structure_faults(samples, where))
    raise_faults(value_faults(samples, where))
