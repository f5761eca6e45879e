"""Samples of a drive under canonical names, tables of them, and their means over equal steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput

MAX_BINS: Final = 10_000_000
"""Largest number of bins of one drive: 115 days at 1 Hz. Without it, a few samples far apart could take any amount of memory."""


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Sampled:
    """Samples of one drive under canonical names; the base of logs, trips and plans.

    Samples are never changed in place; each step makes a new object.

    Attributes
    ----------
    trip_id : str
        Name of the drive, unique in its data set.
    samples : DataFrame
        One row per sample, canonical columns (see `tripwatt.trips.COLUMNS`), float64.

    Examples
    --------
    >>> import pandas as pd
    >>> drive = Sampled("A", pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 2.0, 4.0]}))
    >>> len(drive), drive.duration_s, drive.distance_m
    (3, 2.0, 4.0)
    >>> drive.array("speed_m_s")
    array([0., 2., 4.])
    >>> drive.has("speed_m_s"), drive.has("speed_m_s", "elevation_m")
    (True, False)
    >>> drive.to_frame().shape
    (3, 2)
    """

    trip_id: str
    samples: pd.DataFrame

    def __len__(self) -> int:
        return len(self.samples)

    def __contains__(self, column: object) -> bool:
        return column in self.samples.columns

    def array(self, column: str) -> FloatArray:
        """Return one column as a float64 array, shape (samples,).

        Parameters
        ----------
        column : str
            A column of `samples`.

        Returns
        -------
        ndarray, shape (samples,)
            Values in the unit of the column; unknown values are NaN.

        Raises
        ------
        KeyError
            If the drive lacks the column.
        """
        return self.samples[column].to_numpy(dtype=np.float64)

    def has(self, *columns: str) -> bool:
        """Return whether every named column exists and has at least one known value.

        Parameters
        ----------
        *columns : str
            Names of columns.

        Returns
        -------
        bool
            True if no names are given.
        """
        return all(c in self.samples.columns and not bool(np.isnan(self.array(c)).all()) for c in columns)

    @property
    def elevation_m(self) -> FloatArray | None:
        """Elevation at the samples [m]; None if it is unknown."""
        return self.array("elevation_m") if "elevation_m" in self else None

    @property
    def duration_s(self) -> float:
        """Time between the first and the last sample [s]."""
        time = self.array("time_s")
        return float(time[-1] - time[0]) if len(time) else 0.0

    @property
    def distance_m(self) -> float:
        """Distance driven [m], by the trapezoidal rule from speed over time."""
        return float(np.trapezoid(self.array("speed_m_s"), self.array("time_s")))

    def to_frame(self) -> pd.DataFrame:
        """Return a copy of the samples.

        Returns
        -------
        DataFrame
            One row per sample; changes to this table do not change the drive.
        """
        return self.samples.copy()


def table_of(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Make a table from float columns of equal length in one array, which is much faster than column by column.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (samples,), or to float
        Name of a column -> its values; a single number counts for every row. The first column has to be an array.

    Returns
    -------
    DataFrame
        The columns in their order, float64.

    Examples
    --------
    >>> table_of({"time_s": np.arange(2.0), "speed_m_s": np.ones(2)}).shape
    (2, 2)
    """
    table = np.empty((len(columns), len(next(iter(columns.values()), ()))))
    for row, values in zip(table, columns.values(), strict=True):
        row[:] = values
    return pd.DataFrame(table.T, columns=_names(tuple(columns)), copy=False)


def columns_of(samples: pd.DataFrame) -> dict[str, list[float | None]]:
    """Convert a table to lists by column, as for JSON; missing values become None.

    Examples
    --------
    >>> columns_of(pd.DataFrame({"time_s": [0, 1], "soc": [0.5, np.nan]}))
    {'time_s': [0.0, 1.0], 'soc': [0.5, None]}
    """
    return {
        name: [None if v != v else v for v in np.asarray(samples[name], dtype=np.float64).tolist()]
        for name in map(str, samples.select_dtypes("number"))
    }


@lru_cache(maxsize=64)
def _names(columns: tuple[str, ...]) -> pd.Index:
    return pd.Index(columns, dtype=object)  # a string index is slow to look up


def bin_means(time: FloatArray, columns: Mapping[str, FloatArray], step_s: float) -> dict[str, FloatArray]:
    """Divide time into bins of `step_s` seconds, and return the mean of each column in each. O(samples).

    Parameters
    ----------
    time : ndarray, shape (samples,)
        Increasing times since the first sample [s]; used in place of the column `time_s`.
    columns : mapping of str to ndarray, shape (samples,)
        Name of a column -> its values; NaN means unknown and is left out of the means.
    step_s : float
        Width of a bin [s], more than 0.

    Returns
    -------
    dict of str to ndarray, shape (bins,)
        Name of a column -> its means, from time 0 to the last sample. In a bin without samples, the mean is interpolated and the time is the centre of the bin.

    Raises
    ------
    InvalidInput
        If there would be `MAX_BINS` bins or more.
    ValueError
        If the times do not increase.

    Examples
    --------
    >>> bin_means(np.arange(4.0), {"speed_m_s": np.array([0.0, 2.0, 4.0, 6.0])}, 2.0)["speed_m_s"].tolist()
    [1.0, 5.0]
    """
    if (np.diff(time) <= 0.0).any():
        raise ValueError("times that do not increase")
    if not float(time[-1]) / step_s < MAX_BINS:
        got = f"{float(time[-1]):g} s in steps of {step_s:g} s"
        raise InvalidInput.of("duration out of range", "samples", got, f"at most {MAX_BINS} steps")
    bin_index = np.floor(time / step_s + 1e-6).astype(np.int64)
    n_bins = int(bin_index[-1]) + 1
    count = np.bincount(bin_index, minlength=n_bins)
    empty = count == 0
    centre = (np.arange(n_bins) + 0.5) * step_s
    means: dict[str, FloatArray] = {}
    for name, values in columns.items():
        values = time if name == "time_s" else values
        known = np.isfinite(values)
        total = np.bincount(bin_index, np.where(known, values, 0.0), n_bins)
        number = np.bincount(bin_index[known], minlength=n_bins)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / number
        if name == "time_s":
            mean = np.where(empty, centre, mean)
        elif empty.any() and number.any():
            usable = number > 0
            mean[empty] = np.interp(centre[empty], centre[usable], mean[usable])
        means[name] = mean
    return means
