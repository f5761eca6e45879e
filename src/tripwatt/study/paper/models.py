"""The hybrid model of arXiv:2405.10984: simulated energy plus a correction, in four steps.

1. Simulate the car along each trip; the simulated cumulative energy becomes a column.
2. ``residual = observed - simulated``, of the cumulative energy.
3. A corrector estimates the residual from covariates; the trip is only the cluster.
4. ``predicted = simulated + correction``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.hybrid.trip_table import TripTable


@dataclass
class HybridModel:
    """Simulation plus a correction of its cumulative energy.

    Parameters
    ----------
    corrector : Corrector
        Fitted to ``residual = observed - simulated`` [Wh], with the covariates as columns and the trips as groups.
    simulation : str or None
        Name of the simulated energy to correct; None makes a purely data-driven model (see `DataOnly`).
    shares_folds : bool
        Whether the corrector has `leave_groups_out`, which predicts all folds at once, each held out, with the same
        distribution as one refit per fold.

    Examples
    --------
    >>> import numpy as np
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.paper import Table2Corrector
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(4).trips, {"physics": load_vehicle(VEHICLE)})
    >>> model = HybridModel(Table2Corrector(every_rows=120, errors="normal", terms=("s(time_s, k=4)",)), "physics")
    >>> X, residual, groups = model.training_data(table)
    >>> len(X) == len(residual) == len(groups)
    True
    >>> error = model.fit(table).predict(table) - table.observed_wh
    >>> bool(np.abs(error).mean() < np.abs(residual).mean())
    True
    >>> model.predict_held_out(table, np.arange(4)).shape == residual.shape
    True
    >>> model.inner_errors(table, np.arange(4), seed=0).shape
    (4,)
    """

    corrector: Any
    simulation: str | None
    shares_folds: bool = False

    def fit(self, table: TripTable) -> Self:
        """Fit the residual: steps 2 and 3 of the method.

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.

        Returns
        -------
        HybridModel
            Itself.
        """
        X, residual, groups = self.training_data(table)
        self.corrector.fit(X, residual, groups=groups)
        return self

    def training_data(self, table: TripTable) -> tuple[pd.DataFrame, FloatArray, IntArray]:
        """Collect the corrector's training rows.

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.

        Returns
        -------
        covariates : DataFrame, shape (rows, covariates)
            Known before departure.
        residual_wh : ndarray, shape (rows,)
            Observed minus simulated cumulative energy [Wh].
        groups : ndarray of int, shape (rows,)
            Trip of each row.
        """
        return table.covariates, table.observed_wh - table.simulated(self.simulation), table.groups

    def predict(self, table: TripTable) -> FloatArray:
        """Predict the cumulative energy: step 4 of the method, simulated plus correction.

        Parameters
        ----------
        table : TripTable
            Trips; their measured energy is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """
        correction = np.asarray(self.corrector.predict(table.covariates), dtype=np.float64)
        return table.simulated(self.simulation) + correction

    def predict_held_out(self, table: TripTable, folds: IntArray) -> FloatArray:
        """Predict every row by a model fitted without its fold.

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.
        folds : ndarray of int, shape (trips,)
            Fold of each trip.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """
        row_folds = np.repeat(folds, np.diff(table.offsets))
        X, residual, groups = self.training_data(table)
        correction = self.corrector.leave_groups_out(X, residual, groups=groups, folds=row_folds)
        return table.simulated(self.simulation) + np.asarray(correction, dtype=np.float64)

    def inner_errors(self, table: TripTable, folds: IntArray, seed: int) -> FloatArray | None:
        """Return the mean error by which settings are compared inside each fold; None if the corrector has no such errors.

        The errors of a fold are those on trips outside of it, by models fitted without the fold and without these
        trips.

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.
        folds : ndarray of int, shape (trips,)
            Fold of each trip.
        seed : int
            Seed of the draw of blocks of folds.

        Returns
        -------
        ndarray, shape (folds,), or None
            Errors in the order of the sorted numbers of the folds [Wh].
        """
        if hasattr(self.corrector, "inner_errors"):
            X, residual, groups = self.training_data(table)
            row_folds = np.repeat(folds, np.diff(table.offsets))
            return np.asarray(self.corrector.inner_errors(X, residual, groups, row_folds, seed))
        errors = getattr(self.corrector, "fold_errors_", None)
        return None if errors is None else np.asarray(errors, dtype=np.float64)
