"""Rows that come in groups: their columns, labels, weights and losses.

The group (subject, site, session ...) is the unit of weighting, drawing, leaving out and scoring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.utils.validation import check_consistent_length

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput, raise_faults

Loss = Literal["squared", "absolute"]
ScoreRows = Literal["all", "last"]


def levels_of(X: Any) -> dict[str, list[Any]]:
    """Levels of each column that is not numeric, in the order of their codes."""
    levels: dict[str, list[Any]] = {}
    for name in X.columns if isinstance(X, pd.DataFrame) else ():
        column = X[name]
        if isinstance(column.dtype, pd.CategoricalDtype):
            levels[str(name)] = column.cat.categories.tolist()
        elif not pd.api.types.is_numeric_dtype(column.dtype):
            levels[str(name)] = sorted(column.dropna().unique().tolist(), key=str)
    return levels


def encoded(X: Any, levels: Mapping[str, list[Any]]) -> Any:
    """Replace levels by their codes; missing levels and levels that the training table lacks become NaN.

    Examples
    --------
    >>> levels = levels_of(pd.DataFrame({"dose": [1.0, 2.0], "site": ["a", "b"]}))
    >>> encoded(pd.DataFrame({"dose": [3.0], "site": ["elsewhere"]}), levels).to_numpy()
    array([[ 3., nan]])
    """
    if not isinstance(X, pd.DataFrame):
        return X
    columns, faults = {}, []
    for name in X.columns:
        known = levels.get(str(name))
        if known is not None:
            codes = pd.Index(known).get_indexer(pd.Index(X[name]))
            columns[name] = np.where(codes < 0, np.nan, codes.astype(float))
            continue
        try:
            columns[name] = X[name].to_numpy(dtype=float, na_value=np.nan)
        except (TypeError, ValueError):
            faults.append(Fault("text in a numeric column", f"column {name}", str(X[name].dtype)))
    raise_faults(faults)
    return pd.DataFrame(columns, index=X.index, columns=X.columns)


@dataclass(frozen=True)
class Clusters:
    """Assignment of rows to groups.

    Attributes
    ----------
    labels : ndarray of shape (n_groups,)
        Labels of the groups, sorted.
    codes : ndarray of shape (n_rows,)
        Position of each row's group in `labels`.
    """

    labels: npt.NDArray[Any]
    codes: IntArray

    @classmethod
    def from_groups(cls, groups: Any, n_rows: int) -> Clusters:
        """Read `groups`, one label per row; if None, each row is its own group."""
        if groups is None:
            return cls(np.arange(n_rows), np.arange(n_rows))
        values = np.asarray(groups)
        check_consistent_length(values, np.empty(n_rows))
        codes, labels = pd.factorize(pd.Series(values.ravel()), sort=True)
        if (codes < 0).any():
            rows = np.flatnonzero(codes < 0)
            raise InvalidInput.of("missing group label", f"row {rows[0]}", f"{rows.size} missing", "a label")
        return cls(np.asarray(labels), codes.astype(np.int64))


def thinned_rows(codes: IntArray, max_rows: int | None) -> IntArray:
    """Choose the rows to fit: at most `max_rows` of each group, evenly spaced, including the first (if `max_rows` is above 1) and the last.

    Parameters
    ----------
    codes : ndarray of shape (n_rows,)
        Group of each row.
    max_rows : int or None
        Largest number of rows of a group; None keeps all.

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
    """Weight of each row; the weights of an average group add up to 1.

    "equal" gives each group the total 1, "rows" gives each row the same weight.

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
    """Error of a prediction by group, so that each group has the same weight.

    Parameters
    ----------
    y : ndarray of shape (n_rows,)
        Observed target, rows sorted by group.
    codes : ndarray of shape (n_rows,)
        Group of each row, ascending.
    loss : {"squared", "absolute"}
        Mean over the rows of a group.
    score_rows : {"all", "last"}
        Rows of a group that count.
    """

    def __init__(self, y: FloatArray, codes: IntArray, loss: Loss, score_rows: ScoreRows) -> None:
        last = np.r_[codes[1:] != codes[:-1], True]
        self.rows = slice(None) if score_rows == "all" else np.flatnonzero(last)
        self.y = y[self.rows]
        self.loss = loss
        self.codes = codes[self.rows]
        self.starts = np.flatnonzero(np.r_[True, self.codes[1:] != self.codes[:-1]])
        self.sizes = np.diff(np.r_[self.starts, self.codes.size])

    def __call__(self, prediction: FloatArray) -> FloatArray:
        """Loss of each group, shape (..., n_groups), for predictions of shape (..., n_rows)."""
        error = prediction[..., self.rows] - self.y
        error = error * error if self.loss == "squared" else np.abs(error)
        return np.asarray(np.add.reduceat(error, self.starts, axis=-1) / self.sizes)


def mean_over_groups(losses: FloatArray) -> float:
    """Mean loss of the groups that have one; infinite if no group has a loss."""
    known = losses[~np.isnan(losses)]
    return float(known.mean()) if known.size else np.inf


def folds_of(folds: Any, clusters: Clusters) -> IntArray:
    """Index of each group's fold among the sorted labels of the folds; raises InvalidInput if a group is in two folds."""
    if folds is None:
        return np.arange(len(clusters.labels))
    by_row = Clusters.from_groups(folds, clusters.codes.size)
    fold_of_group = np.zeros(len(clusters.labels), dtype=np.int64)
    fold_of_group[clusters.codes] = by_row.codes
    torn = clusters.labels[np.unique(clusters.codes[fold_of_group[clusters.codes] != by_row.codes])]
    allowed = "one fold for all rows of a group"
    raise_faults(Fault("group in two folds", f"group {label}", allowed=allowed) for label in torn)
    return fold_of_group
