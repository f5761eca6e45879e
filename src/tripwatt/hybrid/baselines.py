"""Models of the energy of trips without a learner: the simulation alone, and linear regressions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.trip_table import TripTable


@dataclass
class PhysicsOnly:
    """The simulation as it is; nothing to learn."""

    simulation: str | None

    def fit(self, table: TripTable) -> Self:
        """Nothing is learned."""
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Simulated cumulative energy [Wh], shape (rows,)."""
        return table.simulated(self.simulation)


@dataclass
class EnergyRegression:
    """Linear regression of a trip's energy on running totals, least squares of the relative error.

    Rows of the least-squares problem are trips, divided by the trip's observed energy; no intercept. The totals are
    running sums, so the same coefficients give the energy along the trip. With `simulation`, the simulated energy is
    the first regressor's stand-in for distance (coefficient free).

    Parameters
    ----------
    regressors : tuple of str
        Columns of `TripTable.totals`.
    simulation : str or None
        Physics preset whose energy is one more regressor.
    """

    regressors: tuple[str, ...]
    simulation: str | None = None
    coefficients_: FloatArray = field(default_factory=lambda: np.empty(0))

    def fit(self, table: TripTable) -> Self:
        """Least squares over trips. O(trips x regressors^2)."""
        last = table.last_rows
        observed = table.observed_wh[last]
        design = self._design(table)[last] / observed[:, None]
        self.coefficients_ = np.asarray(
            np.linalg.lstsq(design, np.ones(len(last)), rcond=None)[0], dtype=np.float64
        )
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Cumulative energy [Wh], shape (rows,)."""
        return np.asarray(self._design(table) @ self.coefficients_, dtype=np.float64)

    def _design(self, table: TripTable) -> FloatArray:
        totals = table.totals[list(self.regressors)].to_numpy(dtype=np.float64)
        if self.simulation is None:
            return totals
        return np.column_stack([table.simulated(self.simulation), totals])
