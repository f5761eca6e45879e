"""A random forest for clustered rows: whole groups are drawn, left out and scored.

Each tree takes a bootstrap of groups (Karpievitch et al. 2009), so a group that was not drawn is out of bag with
all of its rows and the out-of-bag error is an error on new groups. The same property gives leave-one-group-out
predictions without refits, see `ClusteredForest.leave_groups_out`. See `docs/explanation/learners.md`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import clone

from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.learners.clusters import Loss, ScoreRows, folds_of, mean_over_groups
from tripwatt.learners.trees import (
    ClusteredTrees,
    Sample,
    Trees,
    keep_arguments,
)

_CHUNK = 16_384  # rows whose leaf numbers are held at a time


@dataclass(frozen=True)
class _Grown:
    """A forest of one setting.

    `leaves` and `values` have one row per tree: the leaf of each sample row, the value of each leaf.
    """

    setting: dict[str, Any]
    trees: Trees
    leaves: IntArray
    values: FloatArray

    def predict(self, X: FloatArray, used: BoolArray) -> FloatArray:
        """Mean prediction of the trees `used`."""
        result = np.empty(len(X))
        for start in range(0, len(X), _CHUNK):
            rows = slice(start, start + _CHUNK)
            leaves = self.trees.leaves(X[rows])[used]
            result[rows] = np.take_along_axis(self.values[used], leaves, axis=1).mean(axis=0)
        return result


class ClusteredForest(ClusteredTrees):
    """Random forest with subject-level bootstrap, tuned by its out-of-bag error by group.

    Parameters
    ----------
    n_trees : int
        Number of trees for each setting that is tried.
    max_leaf_nodes, max_depth : int, int or None
        Size of a tree.
    min_leaf_weight : float
        Least weight of a leaf, counted in groups: 2.0 means that two drawn groups' worth of rows lie in it.
    max_features : float
        Share of the columns that each split may choose from.
    group_weight : {"equal", "rows"}
        Weight of a drawn group: the same for each, or in proportion to its rows. A group drawn twice has twice the weight.
    max_rows_per_group : int or None
        Largest number of rows of a group to fit, evenly spaced, including the first and the last. Neighbouring rows of
        a long series are nearly redundant: thinning changes the fit little and saves much time. None fits all rows.
        All rows are predicted.
    max_bins : int
        Largest number of bins of a column; edges depend on X only.
    param_grid : dict, "default" or None
        Values of `max_leaf_nodes`, `max_depth`, `min_leaf_weight`, `max_features` to choose from.
    loss : {"squared", "absolute"}
        Error of a group in the comparison of settings: mean over its rows. Each group has the same weight.
    score_rows : {"all", "last"}
        Rows of a group that are scored.
    min_oob_trees : int
        Fewest out-of-bag trees for a prediction (or a score) by leave-groups-out.
    random_state : int, RandomState or None
        Seed of the draws.

    Attributes
    ----------
    groups_ : ndarray of shape (n_groups,)
        Labels of the groups.
    oob_error_ : ndarray of shape (n_groups,)
        Out-of-bag loss of each group under the chosen setting; NaN if it was in every bag.
    best_params_ : dict
        The chosen setting.

    References
    ----------
    Karpievitch, Hill, Leclerc, Dabney, Almeida 2009, An introspective comparison of random forest-based
    classifiers for the analysis of cluster-correlated data by way of RF++, PLoS ONE 4(9).
    Breiman 2001, Random forests, Machine Learning 45.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> subject = np.repeat(np.arange(30), 20)
    >>> dose = rng.uniform(0, 1, 600)
    >>> response = np.where(dose > 0.5, 2.0, 0.0) + rng.normal(0, 1, 30)[subject]
    >>> forest = ClusteredForest(n_trees=100, random_state=0).fit(dose[:, None], response, groups=subject)
    >>> bool(np.diff(forest.predict([[0.2], [0.8]]))[0] > 1.0)
    True
    """

    settings_names = ("max_leaf_nodes", "max_depth", "min_leaf_weight", "max_features")
    default_grid = MappingProxyType({"max_leaf_nodes": [6, 12, 24], "max_features": [0.34, 0.67, 1.0]})
    allowed = MappingProxyType(
        dict.fromkeys(("n_trees", "min_oob_trees"), ("an integer >= 1", lambda v: v >= 1))
    )

    def __init__(
        self,
        n_trees: int = 500,
        *,
        max_leaf_nodes: int = 12,
        max_depth: int | None = None,
        min_leaf_weight: float = 1.0,
        max_features: float = 1.0,
        group_weight: Literal["equal", "rows"] = "equal",
        max_rows_per_group: int | None = 60,
        max_bins: int = 255,
        param_grid: Mapping[str, Sequence[Any]] | Literal["default"] | None = "default",
        loss: Loss = "squared",
        score_rows: ScoreRows = "all",
        min_oob_trees: int = 15,
        random_state: Any = None,
    ) -> None:
        keep_arguments(self, locals())

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Grow and tune the forest.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_rows, n_columns)
            Covariates; text and categorical columns of a DataFrame are levels. NaN is missing.
        y : array-like of shape (n_rows,)
            Target.
        groups : array-like of shape (n_rows,), optional
            Group of each row; if not given, each row is its own group.

        Returns
        -------
        ClusteredForest
            The learner itself.

        Raises
        ------
        InvalidInput
            If a setting is out of range.
        ValueError
            If an array is malformed.
        """
        sample, clusters, _, seed = self._prepare(X, y, groups)
        counts = _bootstrap(self.n_trees, np.ones(sample.n_groups, dtype=bool), seed)
        forests = [self._grow(sample, counts, setting, seed) for setting in self._settings()]
        out_of_bag = counts == 0
        errors = [_oob_losses(forest, sample, out_of_bag) for forest in forests]
        best = int(np.argmin([mean_over_groups(error) for error in errors]))
        self.groups_ = clusters.labels
        self.counts_ = counts
        self.best_params_ = forests[best].setting
        self.oob_error_ = errors[best]
        self.values_ = forests[best].values
        # the leaf values are written into the booster, so that it alone can predict
        widths = forests[best].leaves.max(axis=1) + 1
        values = [values[:width] for values, width in zip(self.values_, widths, strict=True)]
        self.trees_ = forests[best].trees.with_values(values)
        self.start_, self.divisor_ = 0.0, self.n_trees
        return self

    def tuned(self) -> ClusteredForest:
        """Return an unfitted copy with the setting that `fit` chose, to fit on a part of the same groups."""
        copy: ClusteredForest = clone(self).set_params(param_grid=None, **self.best_params_)
        return copy

    def leave_groups_out(self, X: Any, y: Any, groups: Any = None, folds: Any = None) -> FloatArray:
        """Prediction of each row by a forest that is grown and tuned without the row's fold.

        A bootstrap of all groups in which the groups of a fold were not drawn is a bootstrap of the other groups. So the
        trees for which the whole fold is out of bag are the forest of the fold. The setting of a fold is chosen by the
        trees that are out of bag for the fold and for the group that is scored. If there are fewer than `min_oob_trees`
        such trees, a new forest is grown for the fold.

        Parameters
        ----------
        X, y, groups
            As in `fit`.
        folds : array-like of shape (n_rows,), optional
            Fold of each row, constant within a group; by default each group is a fold.

        Returns
        -------
        ndarray of shape (n_rows,)
            Predictions. Attribute `fold_params_` has the setting of each fold.
        """
        sample, clusters, rows, seed = self._prepare(X, y, groups)
        fold_of_group = folds_of(folds, clusters)
        counts = _bootstrap(self.n_trees, np.ones(sample.n_groups, dtype=bool), seed)
        held = fold_of_group == np.arange(fold_of_group.max() + 1)[:, None]  # (n_folds, n_groups)
        without = (counts @ held.T == 0).T  # (n_folds, n_trees)
        needed = without.astype(int) @ (counts == 0) + np.where(held, self.n_trees, 0)
        enough = (needed.min(axis=1) >= self.min_oob_trees) & (len(held) > 1)
        forests = [self._grow(sample, counts, setting, seed) for setting in self._settings()]
        best = np.zeros(len(held), dtype=np.int64)
        if len(forests) > 1:
            # by trees out of bag for the fold and for the group that is scored
            errors = np.array([_oob_losses(forest, sample, counts == 0, without) for forest in forests])
            errors[:, held] = np.nan
            best = np.argmin([[mean_over_groups(e) for e in error] for error in errors], axis=0)
        fold_of_row = fold_of_group[clusters.codes]
        prediction = np.empty(len(rows))
        for fold in range(len(held)):
            inside = fold_of_row == fold
            if enough[fold]:
                chosen, used = forests[best[fold]], without[fold]
            else:
                chosen, used = self._refit(sample, ~held[fold], seed + fold + 1)
                best[fold] = [f.setting for f in forests].index(chosen.setting)
            prediction[inside] = chosen.predict(rows[inside], used)
        self.fold_params_ = [forests[choice].setting for choice in best]
        return prediction

    def _grow(self, sample: Sample, counts: IntArray, setting: dict[str, Any], seed: int) -> _Grown:
        trees = sample.grower.start(setting)
        seeds = np.random.default_rng(seed).integers(1, 2**31 - 1, len(counts))
        weights = counts[:, sample.codes] * sample.weight
        for tree_seed, weight in zip(seeds, weights, strict=True):
            # the product alone would keep a NaN or the sign of a zero of a target that was not drawn
            gradient = np.where(weight > 0, weight * sample.y, 0.0)
            trees.grow(gradient, weight, int(tree_seed))
        leaves = trees.leaves(sample.grower.X)
        n_leaves = int(leaves.max()) + 1
        flat = (leaves + n_leaves * np.arange(len(leaves))[:, None]).ravel()
        size = n_leaves * len(leaves)
        total = np.bincount(flat, (weights * np.where(weights > 0, sample.y, 0.0)).ravel(), size)
        weight_in = np.bincount(flat, weights.ravel(), size)
        values = np.divide(total, weight_in, out=np.zeros(size), where=weight_in > 0)
        return _Grown(setting, trees, leaves, values.reshape(len(leaves), n_leaves))

    def _refit(self, sample: Sample, allowed: BoolArray, seed: int) -> tuple[_Grown, BoolArray]:
        """Grow a forest of the allowed groups only, tuned by its own out-of-bag error; returns it with a mask of all its trees.

        A third of the trees is enough to choose a setting: a group is out of bag in 1/e of them. The shortcut of
        `leave_groups_out` scores with the 1/e^2 of all trees that are out of bag for the fold as well.
        """
        counts = _bootstrap(self.n_trees, allowed, seed)
        settings = self._settings()
        best = 0
        if len(settings) > 1:
            few = counts[: max(1, len(counts) // 3)]
            trials = [self._grow(sample, few, setting, seed) for setting in settings]
            losses = [_oob_losses(trial, sample, few == 0)[allowed] for trial in trials]
            best = int(np.argmin([mean_over_groups(loss) for loss in losses]))
        return self._grow(sample, counts, settings[best], seed), np.ones(len(counts), dtype=bool)


def _bootstrap(n_trees: int, allowed: BoolArray, seed: int) -> IntArray:
    """Number of times that each tree draws each group, shape (n_trees, n_groups)."""
    rng = np.random.default_rng([seed, 1])
    members = np.flatnonzero(allowed)
    draws = members[rng.integers(0, members.size, (n_trees, members.size))]
    flat = draws + allowed.size * np.arange(n_trees)[:, None]
    return np.bincount(flat.ravel(), minlength=n_trees * allowed.size).reshape(n_trees, allowed.size)


def _oob_losses(
    forest: _Grown, sample: Sample, out_of_bag: BoolArray, without: BoolArray | None = None
) -> FloatArray:
    """Loss of each group by the trees fitted without the group, shape (n_groups,).

    With trees that are fitted `without` folds, of shape (n_folds, n_trees), only these count, and the shape is (n_folds, n_groups).
    """
    counted = np.ones(len(out_of_bag)) if without is None else without.astype(float)
    predictions = np.take_along_axis(forest.values, forest.leaves, axis=1)
    total = counted @ (predictions * out_of_bag[:, sample.codes])
    n_used = (counted @ out_of_bag.astype(float))[..., sample.codes]
    return sample.loss(np.divide(total, n_used, out=np.full(total.shape, np.nan), where=n_used > 0))
