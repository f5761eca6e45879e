"""The GAMM of the paper's Table 2 as a corrector."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, Final, Literal, Self

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.hybrid.gamm import gamm_engine
from tripwatt.learners.folds import deal_folds

TABLE2: Final = (
    "weather",
    "s(time_s)",
    "s(ambient_temperature_degc)",
    "s(speed_m_s)",
    "s(elevation_difference_m)",
    "s(time_s, by=season)",
    "s(ambient_temperature_degc, by=season)",
    "s(ambient_temperature_degc, elevation_difference_m, k=30)",
    's(trip, bs="re")',
)
"""Terms of the paper's Table 2; smooths by the ordered factor `season` are differences of winter from summer, and `trip` is
the cluster."""

SEASONS: Final = ("summer", "winter")
"""Levels of `season`; the first is the reference."""

Errors = Literal["t", "normal", "ar1"]

INNER_BLOCKS: Final = 5
"""Blocks of folds that `Table2Corrector.inner_errors` leaves out in pairs: a choice, ten fits."""


@dataclass
class Table2Corrector:
    """The paper's GAMM with Student's t errors (its Table 2) as a corrector.

    Terms are left out if a covariate is missing in all trips or constant over the training rows. Missing values are
    replaced by the median of the training rows (a trip without elevation counts as flat). Unseen weather has the mean
    effect, and covariates outside the training range are moved to its edge, as usual in the engine.

    Parameters
    ----------
    every_rows : int
        The fit uses every `every_rows`-th row of a trip, and the last row. At 1 s the residuals of successive rows are so
        alike (correlation 0.999) that every smooth would reach its largest number of degrees of freedom.
    errors : {"t", "normal", "ar1"}
        Student's t, normal, or normal with a correlation rho^|i - j| of the rows i and j of a trip. There rho is
        estimated with the smoothing parameters, and the last row of a trip, which may follow sooner, counts as one
        step.
    terms : tuple of str
        Terms of the formula.
    min_df : float
        Lower bound of the degrees of freedom of Student's t.

    Attributes
    ----------
    model_ : GAMM
        The fitted engine, for summary, diagnosis and effects.
    medians_ : Series
        Medians of the numeric covariates over the rows given to the fit.
    left_out_ : tuple of str
        Terms that were left out.

    Examples
    --------
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(4).trips, {"physics": load_vehicle(VEHICLE)})
    >>> X, y, trip = table.covariates, table.observed_wh - table.simulated("physics"), table.groups
    >>> corrector = Table2Corrector(every_rows=120, errors="normal", terms=("s(time_s, k=4)",)).fit(X, y, trip)
    >>> corrector.predict(X).shape == corrector.leave_groups_out(X, y, trip).shape == y.shape
    True
    >>> frame, rows = corrector.training_frame(X, trip)
    >>> len(frame) == len(rows), len(corrector.frame(X)) == len(X)
    (True, True)
    >>> corrector.inner_errors(X, y, trip, trip, seed=0).shape
    (4,)
    """

    every_rows: int = 60
    errors: Errors = "t"
    terms: tuple[str, ...] = TABLE2
    min_df: float = 3.0
    model_: Any = None
    medians_: pd.Series | None = None
    left_out_: tuple[str, ...] = ()

    def fit(self, X: pd.DataFrame, y: FloatArray, groups: IntArray) -> Self:
        """Fit by performance iteration and fREML. O(rows x coefficients^2).

        Parameters
        ----------
        X : DataFrame, shape (rows, covariates)
            Columns as in `TripTable.covariates`.
        y : ndarray, shape (rows,)
            The target, such as the residual [Wh].
        groups : ndarray of int, shape (rows,)
            Trip of each row; rows of a trip follow one another.

        Returns
        -------
        Table2Corrector
            Itself.
        """
        frame, rows = self._training(X, groups)
        with gamm_engine() as engine:
            self.model_ = self._model(engine, frame).fit(frame, np.asarray(y)[rows], groups=groups[rows])
        return self

    def predict(self, X: pd.DataFrame) -> FloatArray:
        """Predict `y` of new trips, with a random effect of 0.

        Parameters
        ----------
        X : DataFrame, shape (rows, covariates)
            Covariates as for `fit`.

        Returns
        -------
        ndarray, shape (rows,)
            Predictions in the unit of `y`.
        """
        return np.asarray(self.model_.predict(self.frame(X)), dtype=np.float64)

    def leave_groups_out(
        self, X: pd.DataFrame, y: FloatArray, groups: IntArray, folds: IntArray | None = None
    ) -> FloatArray:
        """Predict `y` of every row by a fit without its fold.

        Coefficients, smoothing parameters and parameters of the errors are estimated anew for each fold. The knots of
        the smooths, the medians of missing values and the choice of terms come from the covariates of all rows.

        Parameters
        ----------
        X : DataFrame, shape (rows, covariates)
            Covariates as for `fit`.
        y : ndarray, shape (rows,)
            The target.
        groups : ndarray of int, shape (rows,)
            Trip of each row.
        folds : ndarray of int, shape (rows,), optional
            Fold of each row; each trip is a fold by default.

        Returns
        -------
        ndarray, shape (rows,)
            Held-out predictions, in the unit of `y`.
        """
        units = groups if folds is None else folds
        frame, rows = self._training(X, groups)
        with gamm_engine() as engine:
            predictions = self._model(engine, frame).leave_groups_out(
                frame,
                np.asarray(y)[rows],
                groups=groups[rows],
                folds=units[rows],
                at=self.frame(X),
                at_folds=units,
            )
        return np.asarray(predictions, dtype=np.float64)

    def inner_errors(
        self, X: pd.DataFrame, y: FloatArray, groups: IntArray, folds: IntArray, seed: int
    ) -> FloatArray:
        """Compute for each fold the mean absolute error at the end of trips of other folds, by models fitted without both.

        The folds are put into `INNER_BLOCKS` blocks at random. A model fitted without the blocks b and c predicts the
        trips of c for the folds of b, and the trips of b for the folds of c.

        Parameters
        ----------
        X : DataFrame, shape (rows, covariates)
            Covariates as for `fit`.
        y : ndarray, shape (rows,)
            The target.
        groups : ndarray of int, shape (rows,)
            Trip of each row.
        folds : ndarray of int, shape (rows,)
            Fold of each row.
        seed : int
            Seed of the draw of the blocks.

        Returns
        -------
        ndarray, shape (folds,)
            Errors in the order of the sorted numbers of the folds, in the unit of `y`; NaN if there are fewer than
            three folds.
        """
        numbers, row_fold = np.unique(folds, return_inverse=True)
        if len(numbers) < 3:
            return np.full(len(numbers), np.nan)
        blocks = min(INNER_BLOCKS, len(numbers))
        block = deal_folds(len(numbers), blocks, np.random.default_rng([seed, 5]))
        row_block = block[row_fold]
        ends = np.append(groups[1:] != groups[:-1], True)
        total, count = np.zeros(blocks), np.zeros(blocks)
        for first, second in itertools.combinations(range(blocks), 2):
            kept = (row_block != first) & (row_block != second)
            model = replace(self).fit(X[kept], y[kept], groups[kept])
            for fold_block, scored_block in ((first, second), (second, first)):
                rows = np.flatnonzero(ends & (row_block == scored_block))
                total[fold_block] += np.abs(y[rows] - model.predict(X.iloc[rows])).sum()
                count[fold_block] += len(rows)
        return np.asarray((total / count)[block])

    def _training(self, X: pd.DataFrame, groups: IntArray) -> tuple[pd.DataFrame, IntArray]:
        """Set the medians, and return the rows of the fit and their numbers."""
        self.medians_ = X.select_dtypes("number").median()
        return self.training_frame(X, groups)

    def training_frame(self, X: pd.DataFrame, groups: IntArray) -> tuple[pd.DataFrame, IntArray]:
        """Choose the rows that `fit` uses.

        Parameters
        ----------
        X : DataFrame, shape (rows, covariates)
            Covariates as for `fit`.
        groups : ndarray of int, shape (rows,)
            Trip of each row.

        Returns
        -------
        frame : DataFrame
            Chosen rows, in the engine's columns.
        rows : ndarray of int
            Numbers of the chosen rows.
        """
        position = pd.Series(groups).groupby(groups, sort=False).cumcount().to_numpy()
        last = np.append(groups[1:] != groups[:-1], True)
        rows = np.flatnonzero((position % self.every_rows == 0) | last).astype(np.int64)
        return self.frame(X.iloc[rows], groups[rows]), rows

    def _model(self, engine: ModuleType, frame: pd.DataFrame) -> Any:
        """Make the unfitted engine for the rows of a fit; set the terms that are left out."""
        varying = {name for name in map(str, frame) if len(frame[name].unique()) > 1}
        columns = {term: engine.formula.parse_formula(f"y ~ {term}").columns for term in self.terms}
        self.left_out_ = tuple(term for term in self.terms if not varying.issuperset(columns[term]))
        formula = "y ~ " + " + ".join(term for term in self.terms if term not in self.left_out_)
        family = engine.ScaledT(min_df=self.min_df) if self.errors == "t" else "gaussian"
        rho = "estimate" if self.errors == "ar1" else None
        return engine.GAMM(formula, family, extrapolation="clamp", ar1_rho=rho)

    def frame(self, X: pd.DataFrame, groups: IntArray | None = None) -> pd.DataFrame:
        """Convert covariates to the engine's columns. Needs `fit`.

        Parameters
        ----------
        X : DataFrame, shape (rows, covariates)
            Covariates as for `fit`.
        groups : ndarray of int, shape (rows,), optional
            Trip of each row; adds the column `trip`, which only trips of the fit need.

        Returns
        -------
        DataFrame
            Covariates with missing numbers replaced by the medians of the training rows.
        """
        assert self.medians_ is not None
        frame = X.fillna(self.medians_.to_dict())
        if "season" in frame:
            codes = (frame["season"] == "winter").to_numpy().astype(np.intp)  # unknown counts as summer
            frame["season"] = pd.Categorical.from_codes(codes, pd.Index(SEASONS), ordered=True)
        if groups is not None:
            frame["trip"] = groups.astype(str)
        return frame
