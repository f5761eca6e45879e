"""Samples of one drive under canonical names: what logs, trips and plans have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Drive:
    """Samples of one drive under canonical names; what logs, trips and plans have in common.

    Samples are never changed in place; each step makes a new drive.

    Attributes
    ----------
    trip_id : str
        Name of the drive, unique in its data set.
    samples : DataFrame
        One row per sample, canonical columns (see `tripwatt.trips.COLUMNS`), float64.

    Examples
    --------
    >>> import pandas as pd
    >>> drive = Drive("A", pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 2.0, 4.0]}))
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
        """One column as a float64 array, shape (samples,).

        Parameters
        ----------
        column : str
            A column of `samples`.

        Returns
        -------
        ndarray, shape (samples,)
            Its values in the unit of the column, NaN where they are unknown.

        Raises
        ------
        KeyError
            When the drive lacks the column.
        """
        return self.samples[column].to_numpy(dtype=np.float64)

    def has(self, *columns: str) -> bool:
        """Tell whether every named column is there with at least one finite value.

        Parameters
        ----------
        *columns : str
            Names of columns.

        Returns
        -------
        bool
            True for no names.
        """
        return all(c in self.samples.columns and not bool(np.isnan(self.array(c)).all()) for c in columns)

    @property
    def duration_s(self) -> float:
        """Time between the first and the last sample [s]."""
        time = self.array("time_s")
        return float(time[-1] - time[0]) if len(time) else 0.0

    @property
    def distance_m(self) -> float:
        """Distance by the trapezoid of speed over time [m]."""
        return float(np.trapezoid(self.array("speed_m_s"), self.array("time_s")))

    def to_frame(self) -> pd.DataFrame:
        """The samples, a copy.

        Returns
        -------
        DataFrame
            One row per sample; to change it does not change the drive.
        """
        return self.samples.copy()

    def _columns(self) -> dict[str, list[float | None]]:
        """The samples as lists, None where a value is missing."""
        return {
            name: [None if v != v else v for v in self.array(name).tolist()] for name in self.samples.columns
        }
