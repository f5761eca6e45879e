"""Wrapper for a regressor from outside, such as one of scikit-learn, to use it on the tables of features of our learners."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput


class OutsideRegressor:
    """Wrapper that applies a regressor with scikit-learn's `fit` and `predict` to a table of features.

    Levels of a categorical column become columns of 0 and 1. A missing value becomes the median of the fit, unless the regressor
    accepts missing values; a column without any value is left out. A search of settings is given the clusters, so that a `GroupKFold` inside the search keeps trips whole.

    Parameters
    ----------
    regressor : object
        An unfitted regressor; each fit clones it.
    seed : int
        Value of each `random_state` of the regressor that is not set.

    Attributes
    ----------
    regressor_ : object
        The fitted clone.
    medians_ : dict of str to float
        Median of each column of the fit, in the order of the columns.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> X = pd.DataFrame({"a": [0.0, 1.0, 2.0, np.nan], "b": pd.Categorical(["x", "y", "x", "y"])})
    >>> OutsideRegressor(Ridge(1e-9)).fit(X, [0.0, 2.0, 2.0, 2.0]).predict(X).round(3)
    array([0., 2., 2., 2.])
    """

    def __init__(self, regressor: Any, seed: int = 0) -> None:
        self.regressor = regressor
        self.seed = seed
        self.regressor_: Any = None
        self.medians_: dict[str, float] = {}

    def fit(self, X: pd.DataFrame, y: npt.ArrayLike, groups: npt.ArrayLike | None = None) -> OutsideRegressor:
        """Fit a clone of the regressor.

        Parameters
        ----------
        X : DataFrame, shape (rows, features)
            Numbers and categories.
        y : array_like, shape (rows,)
            The target.
        groups : array_like, shape (rows,), optional
            Cluster of each row, for a regressor whose `fit` takes `groups` and for searches of settings.
        """
        from sklearn.base import clone
        from sklearn.model_selection import GridSearchCV, RandomizedSearchCV

        columns = _numbers(X)
        self.medians_ = {str(name): float(m) for name, m in columns.median().dropna().items()}
        regressor = clone(self.regressor)
        open_seeds = [
            k for k, v in regressor.get_params().items() if v is None and k.split("__")[-1] == "random_state"
        ]
        regressor.set_params(**dict.fromkeys(open_seeds, self.seed))
        takes = (
            isinstance(regressor, GridSearchCV | RandomizedSearchCV)
            or "groups" in inspect.signature(regressor.fit).parameters
        )
        self.regressor_ = regressor
        regressor.fit(self._input(columns), np.asarray(y), **({"groups": groups} if takes else {}))
        return self

    def tuned(self) -> OutsideRegressor:
        """Return an unfitted copy; a search of settings is repeated in each fit."""
        return OutsideRegressor(self.regressor, self.seed)

    def predict(self, X: pd.DataFrame) -> FloatArray:
        """Predict each row.

        Raises
        ------
        InvalidInput
            If the regressor does not return a finite number for each row.
        """
        return checked(self.regressor_.predict(self._input(_numbers(X))), len(X), self.regressor_)

    def _input(self, columns: pd.DataFrame) -> pd.DataFrame:
        from sklearn.utils import get_tags

        known = columns.reindex(columns=list(self.medians_), fill_value=0.0)  # 0 for a level that is absent
        return known if get_tags(self.regressor_).input_tags.allow_nan else known.fillna(self.medians_)


def checked(predicted: object, rows: int, model: object) -> FloatArray:
    """Convert predictions of an object from outside to an array of finite numbers, shape (rows,).

    Raises
    ------
    InvalidInput
        If the predictions are not numbers, not finite, or not of this shape.
    """
    where = f"predict of {type(model).__name__}"
    try:
        values = np.asarray(predicted, dtype=np.float64)
    except (TypeError, ValueError):
        got = type(predicted).__name__
        raise InvalidInput.of("prediction cannot be used", where, got, "numbers") from None
    if values.shape != (rows,):
        got, allowed = f"shape {values.shape}", f"shape ({rows},)"
        raise InvalidInput.of("prediction cannot be used", where, got, allowed)
    if not np.isfinite(values).all():
        got = f"{int((~np.isfinite(values)).sum())} values that are not finite"
        raise InvalidInput.of("prediction cannot be used", where, got, "finite numbers")
    return values


def _numbers(X: pd.DataFrame) -> pd.DataFrame:
    """Convert every categorical column to columns of 0 and 1."""
    levels = [name for name, kind in X.dtypes.items() if isinstance(kind, pd.CategoricalDtype)]
    return pd.get_dummies(X, columns=levels, dtype=np.float64) if levels else X
