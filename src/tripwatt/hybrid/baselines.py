"""Baseline models of the energy of trips: the simulation alone, and linear regressions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.trip_table import TripTable


@dataclass
class PhysicsOnly:
    """The simulation as it is, without a fit.

    Parameters
    ----------
    simulation : str or None
        Physics preset, a key of `TripTable.simulated_wh`; None predicts 0.

    Examples
    --------
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(1).trips, {"physics": load_vehicle(VEHICLE)})
    >>> predicted = PhysicsOnly("physics").fit(table).predict(table)
    >>> float(predicted[-1]) == float(table.simulated("physics")[-1])
    True
    """

    simulation: str | None

    def fit(self, table: TripTable) -> Self:
        """Do nothing: there is nothing to fit.

        Parameters
        ----------
        table : TripTable
            Not used.

        Returns
        -------
        PhysicsOnly
            The model itself.
        """
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Predict the simulated cumulative energy.

        Parameters
        ----------
        table : TripTable
            Trips with their simulated energy.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """
        return table.simulated(self.simulation)


@dataclass
class EnergyRegression:
    """Linear regression of a trip's energy on running totals, by least squares of the relative error.

    Rows of the least-squares problem are trips, divided by the trip's observed energy; there is no intercept. The totals are
    running sums, so the same coefficients give the energy along the trip. With `simulation`, the simulated energy is the first
    regressor, with a free coefficient.

    Parameters
    ----------
    regressors : tuple of str
        Columns of `TripTable.totals`.
    simulation : str or None
        Physics preset whose energy is an additional regressor.
    coefficients_ : ndarray, shape (regressors,)
        Energy per unit of each regressor [Wh per unit], set by `fit`; with `simulation` first that of the simulated energy [1].

    Examples
    --------
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(3).trips, {"physics": load_vehicle(VEHICLE)})
    >>> model = EnergyRegression((), simulation="physics").fit(table)
    >>> model.coefficients_.shape, model.predict(table).shape == table.observed_wh.shape
    ((1,), True)
    """

    regressors: tuple[str, ...]
    simulation: str | None = None
    coefficients_: FloatArray = field(default_factory=lambda: np.empty(0))

    def fit(self, table: TripTable) -> Self:
        """Fit the coefficients by least squares over trips. O(trips x regressors^2).

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.

        Returns
        -------
        EnergyRegression
            The model itself.
        """
        last = table.last_rows
        observed = table.observed_wh[last]
        design = self._design(table)[last] / observed[:, None]
        self.coefficients_ = np.asarray(
            np.linalg.lstsq(design, np.ones(len(last)), rcond=None)[0], dtype=np.float64
        )
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Predict the cumulative energy.

        Parameters
        ----------
        table : TripTable
            Trips; their measured energy is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """
        return np.asarray(self._design(table) @ self.coefficients_, dtype=np.float64)

    def _design(self, table: TripTable) -> FloatArray:
        totals = table.totals[list(self.regressors)].to_numpy(dtype=np.float64)
        if self.simulation is None:
            return totals
        return np.column_stack([table.simulated(self.simulation), totals])
