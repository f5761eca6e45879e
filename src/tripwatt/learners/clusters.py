"""Rows that come in groups: their columns, labels, weights and losses.

The group (subject, site, session ...) is the unit: it weighs, it is drawn, it is left out, it is scored.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.utils.validation import check_consistent_length

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput, raise_faults

Loss = Literal["squared", "absolute"]
ScoreRows = Literal["all", "last"]


@dataclass(frozen=True)
class Columns:
    """How the columns of a table become numbers: levels by column name, from the training table.

    Attributes
    ----------
    levels : dict
        Column name -> its levels, in the order of their codes. Other columns are numeric.

    Examples
    --------
    >>> table = pd.DataFrame({"dose": [1.0, 2.0], "site": ["a", "b"]})
    >>> columns = Columns.from_frame(table)
    >>> columns.encode(pd.DataFrame({"dose": [3.0], "site": ["elsewhere"]})).to_numpy()
    array([[ 3., nan]])
    """

    levels: dict[str, list[Any]] = field(default_factory=dict)

    @classmethod
    def from_frame(cls, X: Any) -> Columns:
        """Learn the levels of the non-numeric columns of `X` (anything but a DataFrame has none)."""
        if not isinstance(X, pd.DataFrame):
            return cls()
        levels: dict[str, list[Any]] = {}
        for name in X.columns:
            column = X[name]
            if isinstance(column.dtype, pd.CategoricalDtype):
                levels[str(name)] = column.cat.categories.tolist()
            elif not pd.api.types.is_numeric_dtype(column.dtype):
                levels[str(name)] = sorted(column.dropna().unique().tolist(), key=str)
        return cls(levels)

    def encode(self, X: Any) -> Any:
        """Numbers for levels; a level outside of the training table, and a missing one, become NaN."""
        if not isinstance(X, pd.DataFrame):
            return X
        encoded, faults = {}, []
        for name in X.columns:
            known = self.levels.get(str(name))
            if known is not None:
                codes = pd.Index(known).get_indexer(pd.Index(X[name]))
                encoded[name] = np.where(codes < 0, np.nan, codes.astype(float))
                continue
            try:
                encoded[name] = X[name].to_numpy(dtype=float, na_value=np.nan)
            except (TypeError, ValueError):
                faults.append(Fault("text in a numeric column", f"column {name}", str(X[name].dtype)))
        raise_faults(faults)
        return pd.DataFrame(encoded, index=X.index, columns=X.columns)


@dataclass(frozen=True)
class Clusters:
    """Which group each row belongs to.

    Attributes
    ----------
    labels : ndarray of shape (n_groups,)
        The groups, sorted.
    codes : ndarray of shape (n_rows,)
        Position of each row's group in `labels`.
    """

    labels: npt.NDArray[Any]
    codes: IntArray

    @classmethod
    def from_groups(cls, groups: Any, n_rows: int) -> Clusters:
        """Read `groups`, one label a row; None makes each row its own group."""
        if groups is None:
            return cls(np.arange(n_rows), np.arange(n_rows))
        values = np.asarray(groups)
        check_consistent_length(values, np.empty(n_rows))
        codes, labels = pd.factorize(pd.Series(values.ravel()), sort=True)
        if (codes < 0).any():
            rows = np.flatnonzero(codes < 0)
            raise InvalidInput.of("missing group label", f"row {rows[0]}", f"{rows.size} missing", "a label")
        return cls(np.asarray(labels), codes.astype(np.int64))

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return len(self.labels)


def thinned_rows(codes: IntArray, max_rows: int | None) -> IntArray:
    """Rows to fit, group after group: at most `max_rows` of each, evenly spaced, first and last kept.

    Parameters
    ----------
    codes : ndarray of shape (n_rows,)
        Group of each row.
    max_rows : int or None
        Most rows of a group; None keeps all.

    Returns
    -------
    ndarray
        Row numbers, sorted by group, within a group in the order of the input.

    Examples
    --------
    >>> thinned_rows(np.array([0, 1, 0, 0, 0, 0]), 3)
    array([0, 3, 5, 1])
    """
    order = np.argsort(codes, kind="stable")
    if max_rows is None:
        return order
    sizes = np.bincount(codes)
    starts = np.cumsum(sizes) - sizes
    kept = [
        start + np.unique(np.linspace(0, size - 1, min(size, max_rows)).round().astype(np.int64))
        if max_rows > 1
        else np.array([start + size - 1])
        for start, size in zip(starts[sizes > 0], sizes[sizes > 0], strict=True)
    ]
    return np.asarray(order[np.concatenate(kept)])


def row_weights(codes: IntArray, group_weight: Literal["equal", "rows"]) -> FloatArray:
    """Weight of each row, in groups: an average group weighs 1.

    `equal` gives each group the total 1, `rows` gives each row the same weight.

    Examples
    --------
    >>> row_weights(np.array([0, 0, 0, 1]), "equal").round(2)
    array([0.33, 0.33, 0.33, 1.  ])
    >>> row_weights(np.array([0, 0, 0, 1]), "rows")
    array([0.5, 0.5, 0.5, 0.5])
    """
    sizes = np.bincount(codes)
    if group_weight == "equal":
        return np.asarray(1.0 / sizes[codes])
    return np.full(codes.size, np.count_nonzero(sizes) / codes.size)


class GroupLoss:
    """Error of a prediction by group, so that each group weighs the same.

    Parameters
    ----------
    y : ndarray of shape (n_rows,)
        Truth, rows sorted by group.
    codes : ndarray of shape (n_rows,)
        Group of each row, ascending.
    loss : {"squared", "absolute"}
        Mean over the rows of a group.
    score_rows : {"all", "last"}
        Rows of a group that count.
    """

    def __init__(self, y: FloatArray, codes: IntArray, loss: Loss, score_rows: ScoreRows) -> None:
        last = np.r_[codes[1:] != codes[:-1], True]
        self.rows = np.arange(codes.size) if score_rows == "all" else np.flatnonzero(last)
        self.y = y[self.rows]
        self.loss = loss
        self.codes = codes[self.rows]
        self.starts = np.flatnonzero(np.r_[True, self.codes[1:] != self.codes[:-1]])
        self.sizes = np.diff(np.r_[self.starts, self.codes.size])

    def __call__(self, prediction: FloatArray) -> FloatArray:
        """Loss of each group, shape (..., n_groups), of predictions of shape (..., n_rows)."""
        error = prediction[..., self.rows] - self.y
        error = error * error if self.loss == "squared" else np.abs(error)
        return np.asarray(np.add.reduceat(error, self.starts, axis=-1) / self.sizes)


def mean_over_groups(losses: FloatArray) -> float:
    """Mean of the groups that have a loss; infinite if none has."""
    known = losses[~np.isnan(losses)]
    return float(known.mean()) if known.size else np.inf


def folds_of(folds: Any, clusters: Clusters) -> tuple[npt.NDArray[Any], IntArray]:
    """Labels of the folds and the fold of each group."""
    if folds is None:
        return clusters.labels, np.arange(clusters.n_groups)
    by_row = Clusters.from_groups(folds, clusters.codes.size)
    fold_of_group = np.zeros(clusters.n_groups, dtype=np.int64)
    fold_of_group[clusters.codes] = by_row.codes
    torn = clusters.labels[np.unique(clusters.codes[fold_of_group[clusters.codes] != by_row.codes])]
    allowed = "one fold for all rows of a group"
    raise_faults(Fault("group in two folds", f"group {label}", allowed=allowed) for label in torn)
    return by_row.labels, fold_of_group
