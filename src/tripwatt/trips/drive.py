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
    samples : DataFrame
        One row per sample, canonical columns (see `tripwatt.trips.COLUMNS`), float64.
    """

    trip_id: str
    samples: pd.DataFrame

    def __len__(self) -> int:
        return len(self.samples)

    def __contains__(self, column: object) -> bool:
        return column in self.samples.columns

    def array(self, column: str) -> FloatArray:
        """One column as a float64 array, shape (samples,).

        Raises
        ------
        KeyError
            When the drive lacks the column.
        """
        return self.samples[column].to_numpy(dtype=np.float64)

    def has(self, *columns: str) -> bool:
        """Whether every named column is there with at least one finite value."""
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
        """The samples, a copy."""
        return self.samples.copy()

    def _columns(self) -> dict[str, list[float | None]]:
        """The samples as lists, None where a value is missing."""
        return {
            name: [None if v != v else v for v in self.array(name).tolist()] for name in self.samples.columns
        }
