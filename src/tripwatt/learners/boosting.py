"""Boosted trees as a marginal model of clustered rows (generalised estimating equations).

Each round fits a tree to the working residuals V_i^-1 (y_i - F(x_i)) of the groups i, with the prediction F so far and the
working covariance V_i. The values b of its leaves solve the estimating equation sum_i Z_i' V_i^-1 (y_i - F_i - Z_i b) = 0,
with the indicators Z_i of the leaves (Liang & Zeger 1986; Friedman 2001). The number of rounds is chosen by leaving groups
out. See `docs/explanation/learners.md`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from types import MappingProxyType
from typing import Any, Literal, Self

import numpy as np
from sklearn.base import clone

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.learners.clusters import Loss, ScoreRows, folds_of
from tripwatt.learners.correlation import LARGEST, Correlation
from tripwatt.learners.folds import deal_folds
from tripwatt.learners.rounds import boost
from tripwatt.learners.trees import ClusteredTrees, Sample, keep_arguments, sum_of_trees


class ClusteredBoosting(ClusteredTrees):
    """Gradient boosting of trees as a marginal, GEE-type model, stopped by leave-groups-out cross-validation.

    Parameters
    ----------
    n_rounds : int
        Largest number of rounds.
    learning_rate : float
        Shrinkage of each tree.
    max_leaf_nodes, max_depth : int, int or None
        Size of a tree.
    min_leaf_weight : float
        Least weight of a leaf, counted in groups.
    max_features : float
        Share of the columns that each split may choose from.
    subsample : float
        Share of the groups that each round is fitted to (whole groups; Friedman 2002).
    correlation : {"independence", "exchangeable", "ar1"}
        Working correlation of the rows of a group; ar1 goes by their order.
    start : {"mean", "zero"}
        F_0: the mean of the target (solving the estimating equation), or 0.
    group_weight : {"equal", "rows"}
        Weight of a group: the same for each, or in proportion to its rows.
    max_rows_per_group : int or None
        Largest number of rows of a group to fit, evenly spaced; None fits all rows.
    max_bins : int
        Largest number of bins of a column; edges depend on X only.
    n_folds : int or None
        Number of folds (of whole groups) of the cross-validation that chooses the number of rounds and the setting;
        None uses all `n_rounds` of the base setting.
    patience : int
        Number of rounds without an improvement of its error after which a fold stops.
    param_grid : dict, "default" or None
        Values of `learning_rate`, `max_leaf_nodes`, `max_depth`, `min_leaf_weight`, `max_features`, `subsample`,
        `correlation` to choose from.
    loss : {"squared", "absolute"}
        Error of a group in the cross-validation. Each group weighs the same.
    score_rows : {"all", "last"}
        Rows of a group that are scored.
    random_state : int, RandomState or None
        Seed of folds and draws.

    Attributes
    ----------
    n_rounds_ : int
        Chosen number of rounds.
    best_params_ : dict
        Chosen setting.
    correlation_parameter_ : float
        Parameter rho of the working correlation after the last round.

    References
    ----------
    Liang & Zeger 1986, Longitudinal data analysis using generalized linear models, Biometrika 73.
    Friedman 2001, Greedy function approximation: a gradient boosting machine, Annals of Statistics 29.
    Friedman 2002, Stochastic gradient boosting, Computational Statistics & Data Analysis 38.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> subject = np.repeat(np.arange(30), 20)
    >>> dose = rng.uniform(0, 1, 600)
    >>> response = np.where(dose > 0.5, 2.0, 0.0) + rng.normal(0, 1, 30)[subject]
    >>> model = ClusteredBoosting(correlation="exchangeable", random_state=0)
    >>> model = model.fit(dose[:, None], response, groups=subject)
    >>> bool(np.diff(model.predict([[0.2], [0.8]]))[0] > 1.8)
    True
    """

    settings_names = (
        "learning_rate",
        "max_leaf_nodes",
        "max_depth",
        "min_leaf_weight",
        "max_features",
        "subsample",
        "correlation",
    )
    default_grid = MappingProxyType({"max_leaf_nodes": [3, 6], "min_leaf_weight": [1.0, 4.0]})
    allowed = MappingProxyType(
        {
            "n_rounds": ("an integer >= 1", lambda v: v >= 1),
            "learning_rate": ("a number in (0, 1]", lambda v: 0 < v <= 1),
            "subsample": ("a share in (0, 1]", lambda v: 0 < v <= 1),
            "correlation": ("one of " + ", ".join(LARGEST), lambda v: v in LARGEST),
            "start": ("'mean' or 'zero'", lambda v: v in ("mean", "zero")),
            "n_folds": ("None or an integer >= 2", lambda v: v is None or v >= 2),
            "patience": ("an integer >= 1", lambda v: v >= 1),
        }
    )

    def __init__(
        self,
        n_rounds: int = 300,
        *,
        learning_rate: float = 0.1,
        max_leaf_nodes: int = 6,
        max_depth: int | None = None,
        min_leaf_weight: float = 1.0,
        max_features: float = 1.0,
        subsample: float = 1.0,
        correlation: Correlation = "independence",
        start: Literal["mean", "zero"] = "mean",
        group_weight: Literal["equal", "rows"] = "equal",
        max_rows_per_group: int | None = 60,
        max_bins: int = 255,
        n_folds: int | None = 5,
        patience: int = 50,
        param_grid: Mapping[str, Sequence[Any]] | Literal["default"] | None = None,
        loss: Loss = "squared",
        score_rows: ScoreRows = "all",
        random_state: Any = None,
    ) -> None:
        keep_arguments(self, locals())

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Choose setting and number of rounds by leaving groups out, then fit all rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_rows, n_columns)
            Covariates; text and categorical columns of a DataFrame are levels. NaN is missing.
        y : array-like of shape (n_rows,)
            Target.
        groups : array-like of shape (n_rows,), optional
            Group of each row, rows of a group in their order; without it each row is its own group.

        Returns
        -------
        ClusteredBoosting
            The learner itself.

        Raises
        ------
        InvalidInput
            If a setting is out of range.
        ValueError
            If an array is malformed.
        """
        sample, clusters, _, seed = self._prepare(X, y, groups)
        self._choose(sample, seed)
        everything = np.ones(sample.n_groups, dtype=bool)
        path = boost(sample, self.best_params_, everything, self.n_rounds_, seed, start=self.start)
        self.groups_ = clusters.labels
        self.correlation_parameter_ = path.rho
        self.start_, self.divisor_ = path.start, None
        self.trees_ = path.trees.with_values(path.values)
        return self

    def tune(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Choose setting and number of rounds as `fit` does, and leave out the fit of all rows."""
        sample, _, _, seed = self._prepare(X, y, groups)
        self._choose(sample, seed)
        return self

    def _choose(self, sample: Sample, seed: int) -> None:
        settings = self._settings()
        best, n_rounds = 0, self.n_rounds
        if self.n_folds is not None and sample.n_groups > 1:
            block = _blocks(sample.n_groups, self.n_folds, seed)
            folds = [(number,) for number in np.unique(block)]
            errors = [
                np.fmax.reduce([self._errors(sample, setting, block, fold, seed) for fold in folds])
                for setting in settings
            ]
            best, n_rounds, _ = _choice(errors)
        self.best_params_, self.n_rounds_ = settings[best], n_rounds

    def leave_groups_out(self, X: Any, y: Any, groups: Any = None, folds: Any = None) -> FloatArray:
        """Prediction of each row by a model that is fitted and tuned without the row's fold.

        Every fold has its own fit. To choose setting and rounds, the folds are put into blocks: a model without the
        blocks b and c scores c for the folds of b, and b for the folds of c. So the folds of a block share their
        choice, and no choice uses the fold for which it is made (nor the rest of its block).

        Parameters
        ----------
        X, y, groups
            As in `fit`.
        folds : array-like of shape (n_rows,), optional
            Fold of each row, constant within a group; by default each group is a fold.

        Returns
        -------
        ndarray of shape (n_rows,)
            Predictions. Attribute `fold_rounds_` has the number of rounds of each fold, `fold_errors_` the mean loss by which it was
            chosen (NaN if there was no choice).
        """
        sample, clusters, rows, seed = self._prepare(X, y, groups)
        fold_of_group = folds_of(folds, clusters)
        settings = self._settings()
        choices = self._shared_choices(sample, fold_of_group, seed)
        fold_of_row, prediction = fold_of_group[clusters.codes], np.empty(len(rows))
        for fold, (setting, rounds, _) in enumerate(choices):
            inside = fold_of_row == fold
            path = boost(sample, settings[setting], fold_of_group != fold, rounds, seed, start=self.start)
            prediction[inside] = path.start + sum_of_trees(rows[inside], *path.trees.with_values(path.values))
        self.fold_rounds_ = np.array([rounds for _, rounds, _ in choices])
        self.fold_errors_ = np.array([error for _, _, error in choices])
        return prediction

    def tuned(self) -> ClusteredBoosting:
        """Return an unfitted copy with the rounds that `fit` chose, to fit on a part of the same groups."""
        rounds = max(int(self.n_rounds_), 1)
        copy: ClusteredBoosting = clone(self).set_params(n_rounds=rounds, n_folds=None)
        return copy

    def _errors(
        self, sample: Sample, setting: dict[str, Any], block: IntArray, left_out: tuple[int, ...], seed: int
    ) -> FloatArray:
        """Errors of the groups in some blocks after each round, by a model without these blocks, shape (n_rounds, n_groups).

        Errors are NaN for other groups, and after the round in which the error of a block stopped improving.
        """
        scored = [np.flatnonzero(block == number) for number in left_out]
        options: dict[str, Any] = {"start": self.start, "patience": self.patience, "scored": scored}
        inside = ~np.isin(block, left_out)
        path = boost(sample, setting, inside, self.n_rounds, seed, **options)
        errors = np.full((self.n_rounds, sample.n_groups), np.nan)
        errors[: len(path.losses)] = path.losses
        return errors

    def _shared_choices(
        self, sample: Sample, fold_of_group: IntArray, seed: int
    ) -> list[tuple[int, int, float]]:
        """Index of the setting and number of rounds for each fold, and the mean loss of that choice."""
        settings, n_folds = self._settings(), int(fold_of_group.max()) + 1
        if self.n_folds is None or n_folds < 3:
            return [(0, self.n_rounds, np.nan)] * n_folds
        block_of_fold = _blocks(n_folds, 2 * self.n_folds, seed)
        block = block_of_fold[fold_of_group]
        n_blocks = int(block.max()) + 1
        errors = np.full((n_blocks, len(settings), self.n_rounds, sample.n_groups), np.nan)
        for (number, setting), (b, c) in product(enumerate(settings), combinations(range(n_blocks), 2)):
            losses = self._errors(sample, setting, block, (b, c), seed)
            errors[c, number][:, block == b] = losses[:, block == b]
            errors[b, number][:, block == c] = losses[:, block == c]
        chosen = [_choice(list(errors[b])) for b in range(n_blocks)]
        return [chosen[b] for b in block_of_fold]


def _blocks(n: int, n_blocks: int, seed: int) -> IntArray:
    """Assign n items at random to blocks of nearly equal size."""
    return deal_folds(n, n_blocks, np.random.default_rng([seed, 3]))


def _choice(errors: Sequence[FloatArray]) -> tuple[int, int, float]:
    """Index of the setting and number of rounds with the least mean error over groups, and that error.

    Only rounds that all groups reached are compared.
    """
    curves = np.array([error[:, ~np.isnan(error[0])].mean(axis=1) for error in errors])
    curves[np.isnan(curves)] = np.inf
    best, at = np.unravel_index(curves.argmin(), curves.shape)
    return int(best), int(at) + 1, float(curves[best, at])
