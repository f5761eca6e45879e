"""The hybrid model of arXiv:2405.10984: simulated energy plus a learned correction, in four steps.

1. Simulate the car along each trip; the simulated cumulative energy becomes a column.
2. ``residual = observed - simulated``, of the cumulative energy.
3. A corrector learns the residual from covariates; the trip is only the cluster.
4. ``predicted = simulated + correction``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.hybrid.trip_table import TripTable


class Corrector(Protocol):
    """What a hybrid needs of a learner: scikit-learn's fit and predict, with the trip as the cluster."""

    def fit(self, X: Any, y: Any, groups: Any = None) -> Any:
        """Learn `y` from the columns of `X`; rows of one group belong together."""
        ...

    def predict(self, X: Any) -> Any:
        """Predicted `y`, shape (rows,)."""
        ...


@dataclass
class HybridModel:
    """Simulation plus a correction of its cumulative energy.

    Parameters
    ----------
    corrector : Corrector
        Learns ``residual = observed - simulated`` [Wh] from the covariates; its groups are the trips.
    simulation : str or None
        Physics preset to correct; None makes it a purely data-driven model (see `DataOnly`).
    shares_folds : bool
        Whether the corrector has `leave_groups_out`, which gives the held-out predictions of all folds at once,
        identical in law to one refit per fold.
    """

    corrector: Any
    simulation: str | None
    shares_folds: bool = False

    def fit(self, table: TripTable) -> Self:
        """Steps 2 and 3: take the residual, learn it."""
        X, residual, groups = self.training_data(table)
        self.corrector.fit(X, residual, groups=groups)
        return self

    def training_data(self, table: TripTable) -> tuple[pd.DataFrame, FloatArray, IntArray]:
        """What the corrector learns from: covariates, residual [Wh] and the trip of each row."""
        return table.covariates, table.observed_wh - table.simulated(self.simulation), table.groups

    def predict(self, table: TripTable) -> FloatArray:
        """Step 4: simulated plus correction [Wh], shape (rows,)."""
        correction = np.asarray(self.corrector.predict(table.covariates), dtype=np.float64)
        return table.simulated(self.simulation) + correction

    def predict_held_out(self, table: TripTable, folds: IntArray) -> FloatArray:
        """Predictions of every row by a model that never saw its fold [Wh].

        Parameters
        ----------
        table : TripTable
        folds : ndarray of int, shape (trips,)
            Fold of each trip.
        """
        row_folds = np.repeat(folds, np.diff(table.offsets))
        X, residual, groups = self.training_data(table)
        correction = self.corrector.leave_groups_out(X, residual, groups=groups, folds=row_folds)
        return table.simulated(self.simulation) + np.asarray(correction, dtype=np.float64)

    def inner_errors(self, table: TripTable, folds: IntArray, seed: int) -> FloatArray | None:
        """Mean error by which settings are compared inside each fold; None where the corrector has none.

        The errors come from trips outside of the fold alone, by models that saw neither the fold nor these trips.

        Parameters
        ----------
        table : TripTable
        folds : ndarray of int, shape (trips,)
            Fold of each trip.
        seed : int
            Of the draw of blocks of folds.

        Returns
        -------
        ndarray, shape (folds,), or None
            In the order of the sorted numbers of the folds [Wh].
        """
        if hasattr(self.corrector, "inner_errors"):
            X, residual, groups = self.training_data(table)
            row_folds = np.repeat(folds, np.diff(table.offsets))
            return np.asarray(self.corrector.inner_errors(X, residual, groups, row_folds, seed))
        found = getattr(self.corrector, "fold_errors_", None)
        return None if found is None else np.asarray(found, dtype=np.float64)


def DataOnly(corrector: Corrector, *, shares_folds: bool = False) -> HybridModel:  # noqa: N802 - reads as a model
    """The same learner on the observed energy itself: the paper's purely data-driven benchmark."""
    return HybridModel(corrector, simulation=None, shares_folds=shares_folds)
