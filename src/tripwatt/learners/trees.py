"""Common parts of the two tree learners for clustered rows: growing trees, the sample of a fit, checks and storage.

The trees are LightGBM's: only its histogram tree is used, one tree per call, with gradients and weights computed here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, Final

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import Fault, raise_faults
from tripwatt.learners.clusters import Clusters, GroupLoss, encoded, levels_of, row_weights, thinned_rows

Allowed = tuple[str, Callable[[Any], bool]]
"""Allowed values of a setting: a description and a test."""

_NUMBERS: Final[Mapping[str, Any]] = {"dtype": np.float64, "ensure_all_finite": "allow-nan"}


def tree_parameters(setting: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of LightGBM for the shape of a single tree; weights are counted in groups."""
    return {
        "objective": "none",
        "learning_rate": 1.0,
        "num_leaves": int(setting["max_leaf_nodes"]),
        "max_depth": -1 if setting["max_depth"] is None else int(setting["max_depth"]),
        "min_sum_hessian_in_leaf": float(setting["min_leaf_weight"]) * (1.0 - 1e-6),
        "feature_fraction_bynode": float(setting["max_features"]),
        "min_data_in_leaf": 1,
        "min_data_per_group": 1,
        "max_cat_threshold": 64,
        "cat_l2": 1.0,  # one group's weight: a level needs evidence from more than one group
        "cat_smooth": 1.0,
        **_QUIET,
    }


_QUIET = {"num_threads": 1, "deterministic": True, "force_row_wise": True, "verbosity": -1}
"""Parameters that make trees independent of the machine; a choice."""


class TreeGrower:
    """Histogram trees on one table, one tree per call; the table is binned once and shared.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
        Encoded columns; NaN is missing.
    categorical : list of int
        Positions of the columns that hold codes of levels.
    max_bins : int
        Largest number of bins of a column. Bin edges depend on `X` only.
    """

    def __init__(self, X: FloatArray, categorical: list[int], max_bins: int) -> None:
        import lightgbm

        self.X = X
        parameters = {
            "max_bin": int(max_bins),
            "min_data_in_bin": 1,
            "feature_pre_filter": False,
            "bin_construct_sample_cnt": max(len(X), 2),
            **_QUIET,
        }
        self._data = lightgbm.Dataset(
            X, np.zeros(len(X)), categorical_feature=categorical, params=parameters, free_raw_data=False
        )
        self._data.construct()
        self._barren = all(self._data.feature_num_bin(column) < 2 for column in range(X.shape[1]))

    def start(self, setting: Mapping[str, Any]) -> Trees:
        """Return an empty sequence of trees of one shape on this table."""
        return Trees(None if self._barren else self._data, tree_parameters(setting))


class Trees:
    """A growing sequence of trees; a tree may be a single leaf, which LightGBM does not keep."""

    def __init__(self, data: Any | None, parameters: dict[str, Any]) -> None:
        self._data = data
        self._parameters = parameters
        self.position: list[int] = []  # index of each tree in the booster, -1 for a lone leaf
        self._restart()

    def _restart(self) -> None:
        import lightgbm

        self.booster: Any = None if self._data is None else lightgbm.Booster(self._parameters, self._data)
        self._n_kept = self._n_splits = 0
        self._score: Any = 0.0  # sum of the library's own leaf values at each row of the table

    def grow(self, gradient: FloatArray, weight: FloatArray, seed: int) -> None:
        """Add the tree that fits `gradient / weight` by weighted least squares; it may be a lone leaf.

        The seed restarts the draw of columns, so that a tree depends only on the arguments.
        """
        if self.booster is not None and self._parameters["feature_fraction_bynode"] < 1.0:
            self.booster.reset_parameter({"feature_fraction_seed": seed})
        # without a booster no column has two values
        if self.booster is None or self.booster.update(fobj=lambda _prediction, _data: (-gradient, weight)):
            self.position.append(-1)
            if self._n_kept == 0:
                self._restart()  # a lone first tree would stay in the booster
            return
        self.position.append(self._n_kept)
        self._n_kept += 1

    def last_leaves(self, X: FloatArray) -> IntArray:
        """Leaf of each row of the table `X` in the last tree, by the value that this tree added to the row's score.

        To have the library predict the leaves takes longer than to grow the tree; it does so only if rounding hides a leaf. Call this
        after every tree, or after none.
        """
        if self.position[-1] < 0:
            return np.zeros(len(X), dtype=np.int64)
        before = self._score

        def keep(score: FloatArray, _data: Any) -> tuple[str, float, bool]:
            self._score = score.copy()
            return "", 0.0, True

        self.booster.eval_train(keep)
        n_splits = int(self.booster.feature_importance().sum())
        leaves, self._n_splits = range(n_splits - self._n_splits + 1), n_splits
        values = np.array([self.booster.get_leaf_output(self._n_kept - 1, leaf) for leaf in leaves])
        order, added = np.argsort(values), self._score - before
        ranked, place = values[order], np.zeros(len(added), dtype=np.int64)
        # for a few leaves a quarter of the time of `np.searchsorted`
        for middle in (0.5 * (ranked[1:] + ranked[:-1])).tolist():
            place += added > middle
        error = max(np.abs(added - ranked[place]).max(), np.spacing(np.abs(self._score).max()))
        if 4.0 * error < (ranked[1:] - ranked[:-1]).min():
            return np.asarray(order[place], dtype=np.int64)
        return np.asarray(self.leaves(X, first=len(self.position) - 1)[0])

    def with_values(self, values: Sequence[FloatArray]) -> tuple[Any, int, float]:
        """Write leaf values into the booster; returns it, the number of its trees, and the sum of the lone leaves, which it lacks."""
        rest = 0.0
        for place, its_values in zip(self.position, values, strict=True):
            rest += float(its_values[0]) if place < 0 else 0.0
            for leaf, value in enumerate(its_values if place >= 0 else ()):
                self.booster.set_leaf_output(place, leaf, float(value))
        return self.booster, self._n_kept, rest

    def leaves(self, X: FloatArray, first: int = 0) -> IntArray:
        """Leaf of each row in each tree from `first` on, shape (n_trees - first, n_rows)."""
        position = np.array(self.position[first:], dtype=np.int64)
        result = np.zeros((position.size, len(X)), dtype=np.int64)
        split = position >= 0
        if split.any():
            span = {"start_iteration": int(position[split][0]), "num_iteration": int(split.sum())}
            kept = self.booster.predict(X, **span, pred_leaf=True, num_threads=1)
            result[split] = np.asarray(kept).reshape(len(X), -1).T
        return result


@dataclass(frozen=True)
class Sample:
    """The rows of a fit, sorted by group, and the loss by which groups are scored.

    Attributes
    ----------
    grower : TreeGrower
        Grower of trees on the covariates.
    y, codes, weight : ndarray of shape (n_rows,)
        Target, group and weight of each row.
    loss : GroupLoss
        Loss of each group.
    n_groups : int
        Number of groups.
    """

    grower: TreeGrower
    y: FloatArray
    codes: IntArray
    weight: FloatArray
    loss: GroupLoss
    n_groups: int


_ALLOWED: Final[Mapping[str, Allowed]] = {
    "max_leaf_nodes": ("an integer >= 2", lambda v: v >= 2),
    "max_depth": ("None or an integer >= 1", lambda v: v is None or v >= 1),
    "min_leaf_weight": ("a number >= 0", lambda v: v >= 0),
    "max_features": ("a share in (0, 1]", lambda v: 0 < v <= 1),
    "group_weight": ("'equal' or 'rows'", lambda v: v in ("equal", "rows")),
    "max_rows_per_group": ("None or an integer >= 1", lambda v: v is None or v >= 1),
    "max_bins": ("an integer >= 2", lambda v: v >= 2),
    "param_grid": (
        "None, 'default' or a dict",
        lambda v: v is None or v == "default" or isinstance(v, Mapping),
    ),
    "loss": ("'squared' or 'absolute'", lambda v: v in ("squared", "absolute")),
    "score_rows": ("'all' or 'last'", lambda v: v in ("all", "last")),
}
"""Settings of all learners -> allowed values."""


class ClusteredTrees(RegressorMixin, BaseEstimator):
    """Base class of learners for clustered rows with trees of LightGBM; subclasses add their settings and their fit.

    A fit sets `trees_` (see `Trees.with_values`); the prediction is `start_` plus their sum, divided by `divisor_` unless that is None.
    """

    settings_names: ClassVar[tuple[str, ...]]
    """Settings that `param_grid` may choose."""

    default_grid: ClassVar[Mapping[str, list[Any]]]
    allowed: ClassVar[Mapping[str, Allowed]]
    """Settings of this learner only -> allowed values."""

    __metadata_request__fit: ClassVar = {"groups": True}  # read by the metadata routing of scikit-learn

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.non_deterministic = False
        return tags

    def predict(self, X: Any) -> FloatArray:
        """Prediction of each row, shape (n_rows,): the mean of a forest's trees, or a boosting after its chosen rounds."""
        check_is_fitted(self, "trees_")
        rows = validate_data(self, encoded(X, self.levels_), reset=False, **_NUMBERS)
        return np.asarray(self.start_ + sum_of_trees(rows, *self.trees_) / (self.divisor_ or 1))

    def _prepare(self, X: Any, y: Any, groups: Any) -> tuple[Sample, Clusters, FloatArray, int]:
        """Check settings and input of `fit`, thin and bin the rows.

        Returns the sample, the groups of all rows, all rows encoded, and a seed. scikit-learn raises ValueError for wrong shapes,
        infinite values or missing targets.
        """
        _check_parameters(self, {**_ALLOWED, **self.allowed})
        self.levels_ = levels_of(X)
        rows, target = validate_data(self, encoded(X, self.levels_), y, y_numeric=True, **_NUMBERS)
        target = np.asarray(target, dtype=float)
        clusters = Clusters.from_groups(groups, len(rows))
        kept = thinned_rows(clusters.codes, self.max_rows_per_group)
        codes = clusters.codes[kept]
        names = getattr(self, "feature_names_in_", ())
        categorical = [k for k, name in enumerate(names) if name in self.levels_]
        sample = Sample(
            grower=TreeGrower(rows[kept], categorical, self.max_bins),
            y=target[kept],
            codes=codes,
            weight=row_weights(codes, self.group_weight),
            loss=GroupLoss(target[kept], codes, self.loss, self.score_rows),
            n_groups=len(clusters.labels),
        )
        seed = int(check_random_state(self.random_state).randint(2**31 - 2))
        return sample, clusters, rows, seed

    def _settings(self) -> list[dict[str, Any]]:
        """The settings, in all combinations of the grid; raises InvalidInput with every name that is no setting."""
        base = {name: getattr(self, name) for name in self.settings_names}
        grid = self.default_grid if isinstance(self.param_grid, str) else self.param_grid or {}
        what, allowed = "unknown setting in param_grid", ", ".join(sorted(base))
        raise_faults(Fault(what, name, allowed=allowed) for name in grid if name not in base)
        return [base | dict(zip(grid, row, strict=True)) for row in product(*grid.values())]


def keep_arguments(estimator: Any, arguments: Mapping[str, Any]) -> None:
    """Set the arguments of a constructor, given by its `locals()`, as attributes, as scikit-learn expects."""
    for name, value in arguments.items():
        if value is not estimator:
            setattr(estimator, name, value)


def sum_of_trees(X: FloatArray, booster: Any, n_trees: int, rest: float) -> FloatArray:
    """Sum of the trees of a booster and of the `rest` that it lacks, shape (n_rows,)."""
    if n_trees == 0:
        return np.full(len(X), rest)
    return np.asarray(booster.predict(X, num_iteration=n_trees, raw_score=True, num_threads=1) + rest)


def _check_parameters(estimator: Any, allowed: Mapping[str, Allowed]) -> None:
    """Raise InvalidInput with every setting that is out of range; `allowed` maps a name to (description, test)."""
    faults = []
    for name, (text, test) in allowed.items():
        value = getattr(estimator, name)
        try:
            sound = bool(test(value))
        except TypeError:
            sound = False
        if not sound:
            where = f"{type(estimator).__name__}({name}=)"
            faults.append(Fault("setting out of range", where, repr(value), text))
    raise_faults(faults)
