"""Boosted trees as a marginal model of clustered rows (generalised estimating equations).

Each round fits a tree to the working residuals V_i^-1 (y_i - F(x_i)) of the groups and gives its leaves the
values that solve the estimating equation sum_i Z_i' V_i^-1 (y_i - F_i - Z_i b) = 0 (Liang & Zeger 1986; Friedman
2001). The number of rounds is chosen by leaving groups out. See `docs/learners.md`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
import pandas as pd
from joblib import Parallel, delayed
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from tripwatt.trees import (
    Bools,
    Clusters,
    Columns,
    Floats,
    GroupLoss,
    Ints,
    Loss,
    ScoreRows,
    TreeGrower,
    Trees,
    TreeShape,
    as_text_array,
    booster_array,
    booster_of,
    checked,
    column_blocks,
    column_names,
    folds_of,
    from_text_array,
    permutation_losses,
    plain,
    row_weights,
    seed_of,
    settings_of,
    sum_of_trees,
    thinned_rows,
    validated,
)

Correlation = Literal["independence", "exchangeable", "ar1"]

DEFAULT_GRID: dict[str, list[Any]] = {"max_leaf_nodes": [3, 6], "min_leaf_weight": [1.0, 4.0]}
_SETTINGS = (
    "learning_rate",
    "max_leaf_nodes",
    "max_depth",
    "min_leaf_weight",
    "max_features",
    "subsample",
    "correlation",
)
_LARGEST = {"independence": 0.0, "exchangeable": 0.95, "ar1": 0.99}


class WorkingCorrelation:
    """V_i^-1 of every group in closed form, for rows sorted by group.

    V_i = R_i(rho) / w_i with the weight w_i of the group's rows; R_i is the identity, or has rho off its diagonal
    (exchangeable), or rho^|j - k| (first-order autoregression over the rows of a group in their order).

    Parameters
    ----------
    kind : {"independence", "exchangeable", "ar1"}
        Structure of R_i.
    codes : ndarray of shape (n_rows,)
        Group of each row, ascending.
    weight : ndarray of shape (n_rows,)
        Weight of each row, constant within a group; 0 leaves the group out.

    Examples
    --------
    >>> codes = np.array([0, 0, 1])
    >>> working = WorkingCorrelation("exchangeable", codes, np.ones(3))
    >>> working.rho = 0.5
    >>> working.solve(np.array([1.0, 0.0, 1.0])).round(3)
    array([ 1.333, -0.667,  1.   ])
    """

    def __init__(self, kind: Correlation, codes: Ints, weight: Floats) -> None:
        self.kind = kind
        self.codes = codes
        self.weight = weight
        self.rho = 0.0
        self.sizes = np.bincount(codes)
        self.pair = (codes[1:] == codes[:-1]) & (weight[1:] > 0)
        edges = np.r_[False, codes[1:] == codes[:-1]].astype(float) + np.r_[codes[1:] == codes[:-1], False]
        self.neighbours = edges  # 0, 1 or 2 rows beside a row in its group

    def estimate(self, residual: Floats) -> None:
        """Moment estimate of rho from the current residuals, between 0 and just below 1."""
        if self.kind == "independence":
            return
        weighted = self.weight * residual
        total = float((weighted * residual).sum())
        if self.kind == "ar1":
            pairs = float((weighted[1:] * residual[:-1])[self.pair].sum())
            share = self.weight[1:][self.pair].sum() / max(self.weight.sum(), 1e-300)
        else:
            sums, squares = np.bincount(self.codes, weighted), np.bincount(self.codes, weighted * residual)
            plain_sums = np.bincount(self.codes, residual)
            several = self.sizes > 1
            pairs = float(((sums * plain_sums - squares)[several] / (self.sizes[several] - 1)).sum())
            share = self.weight[several[self.codes]].sum() / max(self.weight.sum(), 1e-300)
        rho = pairs / (total * share) if total * share > 0 else 0.0
        self.rho = float(np.clip(rho, 0.0, _LARGEST[self.kind]))

    def _spread(self) -> Floats:
        """Rho / (1 + (n_i - 1) rho) of each group."""
        return np.asarray(self.rho / (1.0 + (self.sizes - 1) * self.rho))

    def solve(self, residual: Floats) -> Floats:
        """V^-1 r, in one pass over the rows."""
        weighted = self.weight * residual
        if self.kind == "independence" or self.rho == 0.0:
            return weighted
        if self.kind == "exchangeable":
            sums = np.bincount(self.codes, weighted)
            return np.asarray((weighted - (self._spread() * sums)[self.codes]) / (1.0 - self.rho))
        result = self._ar1_diagonal() * weighted
        result[1:][self.pair] -= self.rho * weighted[:-1][self.pair]
        result[:-1][self.pair] -= self.rho * weighted[1:][self.pair]
        return np.asarray(result / (1.0 - self.rho**2))

    def _ar1_diagonal(self) -> Floats:
        return np.asarray(
            np.select(
                [self.neighbours == 0, self.neighbours == 1], [1.0 - self.rho**2, 1.0], 1.0 + self.rho**2
            )
        )

    def normal_matrix(self, leaf: Ints, n_leaves: int) -> Floats:
        """Z' V^-1 Z for the indicators Z of the leaves."""
        if self.kind == "independence" or self.rho == 0.0:
            return np.diag(np.bincount(leaf, self.weight, n_leaves))
        if self.kind == "exchangeable":
            n_groups = self.sizes.size
            in_leaf = np.bincount(self.codes * n_leaves + leaf, minlength=n_groups * n_leaves)
            table = in_leaf.reshape(n_groups, n_leaves).astype(float)
            weight = np.zeros(n_groups)
            weight[self.codes] = self.weight
            own = np.diag((table * weight[:, None]).sum(axis=0))
            return np.asarray(
                (own - (table * (self._spread() * weight)[:, None]).T @ table) / (1.0 - self.rho)
            )
        own = np.diag(np.bincount(leaf, self._ar1_diagonal() * self.weight, n_leaves))
        flat = leaf[1:][self.pair] * n_leaves + leaf[:-1][self.pair]
        cross = np.bincount(flat, self.weight[1:][self.pair], n_leaves**2).reshape(n_leaves, n_leaves)
        return np.asarray((own - self.rho * (cross + cross.T)) / (1.0 - self.rho**2))


@dataclass(frozen=True)
class _Sample:
    """The rows that are learned from, sorted by group, and how groups are scored."""

    grower: TreeGrower
    y: Floats
    codes: Ints
    weight: Floats
    loss: GroupLoss
    n_groups: int


@dataclass
class _Path:
    """One run of boosting: `values[t]` are the leaf values of round t, `losses[t]` the loss of each group after it."""

    start: float
    trees: Trees
    values: list[Floats] = field(default_factory=list)
    losses: list[Floats] = field(default_factory=list)
    rho: float = 0.0


class ClusteredBoosting(RegressorMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn ships no types
    """Gradient boosting of trees as a marginal, GEE-type model, stopped by leave-groups-out cross-validation.

    Parameters
    ----------
    n_rounds : int
        Most rounds.
    learning_rate : float
        Shrinkage of each tree.
    max_leaf_nodes, max_depth : int, int or None
        Size of a tree.
    min_leaf_weight : float
        Least weight of a leaf, counted in groups.
    max_features : float
        Share of the columns that each split may choose from.
    subsample : float
        Share of the groups that each round learns from (whole groups; Friedman 2002).
    correlation : {"independence", "exchangeable", "ar1"}
        Working correlation of the rows of a group; ar1 goes by their order.
    start : {"mean", "zero"}
        F_0: the mean of the target (solving the estimating equation), or 0.
    group_weight : {"equal", "rows"}
        Weight of a group: the same for each, or in proportion to its rows.
    max_rows_per_group : int or None
        Learn from at most so many rows of a group, evenly spaced.
    max_bins : int
        Most bins of a column; edges depend on X alone.
    n_folds : int or None
        Folds (of whole groups) of the cross-validation that chooses the number of rounds and the setting;
        None takes all `n_rounds` of the base setting.
    patience : int
        A fold stops when its error has not improved for so many rounds.
    param_grid : dict, "default" or None
        Values of `learning_rate`, `max_leaf_nodes`, `max_depth`, `min_leaf_weight`, `max_features`, `subsample`,
        `correlation` to choose from.
    loss : {"squared", "absolute"} or callable
        Error of a group in the cross-validation. Each group weighs the same.
    score_rows : {"all", "last"}
        Rows of a group that are scored.
    n_jobs : int or None
        Processes of `leave_groups_out`; the result does not depend on it.
    random_state : int, RandomState or None
        Seed of folds and draws.

    Attributes
    ----------
    n_rounds_ : int
        Chosen number of rounds.
    best_params_ : dict
        Chosen setting.
    learning_curve_ : DataFrame
        `round, fold, error` of the chosen setting.
    correlation_parameter_ : float
        rho after the last round.

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
        max_rows_per_group: int | None = None,
        max_bins: int = 255,
        n_folds: int | None = 5,
        patience: int = 50,
        param_grid: Mapping[str, Sequence[Any]] | Literal["default"] | None = None,
        loss: Loss = "squared",
        score_rows: ScoreRows = "all",
        n_jobs: int | None = None,
        random_state: Any = None,
    ) -> None:
        self.n_rounds = n_rounds
        self.learning_rate = learning_rate
        self.max_leaf_nodes = max_leaf_nodes
        self.max_depth = max_depth
        self.min_leaf_weight = min_leaf_weight
        self.max_features = max_features
        self.subsample = subsample
        self.correlation = correlation
        self.start = start
        self.group_weight = group_weight
        self.max_rows_per_group = max_rows_per_group
        self.max_bins = max_bins
        self.n_folds = n_folds
        self.patience = patience
        self.param_grid = param_grid
        self.loss = loss
        self.score_rows = score_rows
        self.n_jobs = n_jobs
        self.random_state = random_state

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.non_deterministic = False
        return tags

    def fit(self, X: Any, y: Any, groups: Any = None) -> Self:
        """Choose setting and rounds by leaving groups out, then fit all rows.

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
            Itself.

        Errors
        ------
        InvalidInput for settings out of range, ValueError for malformed arrays.
        """
        sample, clusters, _, seed = self._prepared(X, y, groups)
        settings = self._settings()
        self.learning_curve_ = pd.DataFrame({"round": [], "fold": [], "error": []})
        best, n_rounds = 0, self.n_rounds
        if self.n_folds is not None and sample.n_groups > 1:
            block = _blocks(sample.n_groups, self.n_folds, seed)
            everything = np.ones(sample.n_groups, dtype=bool)
            errors = [self._fold_errors(sample, setting, block, everything, seed) for setting in settings]
            best, n_rounds = _choice(errors)
            self.learning_curve_ = _learning_curve(errors[best], block)
        chosen = self._base() | settings[best]
        path = self._boost(sample, chosen, np.ones(sample.n_groups, dtype=bool), n_rounds, seed)
        self.groups_ = clusters.labels
        self.best_params_ = chosen
        self.n_rounds_ = n_rounds
        self.correlation_parameter_ = path.rho
        self._keep(path)
        return self

    def predict(self, X: Any) -> Floats:
        """F(x) after the chosen number of rounds, shape (n_rows,)."""
        check_is_fitted(self, "steps_")
        rows, _ = validated(self, X, None, reset=False)
        return self._raw(rows)

    def staged_predict(self, X: Any) -> npt.NDArray[np.float64]:
        """F(x) after each round, shape (n_rounds_, n_rows)."""
        check_is_fitted(self, "steps_")
        rows, _ = validated(self, X, None, reset=False)
        steps = np.array(
            [
                np.full(len(rows), value) if tree < 0 else sum_of_trees(self.booster_, rows, int(tree), 1)
                for tree, value in zip(self.position_, self.steps_, strict=True)
            ]
        ).reshape(len(self.steps_), len(rows))
        return np.asarray(self.start_ + np.cumsum(steps, axis=0))

    def permutation_importance(
        self,
        X: Any,
        y: Any,
        groups: Any = None,
        *,
        columns: Mapping[str, Sequence[str]] | None = None,
        n_repeats: int = 5,
    ) -> pd.DataFrame:
        """Rise of the loss when a covariate is permuted over the rows; give rows that were not fitted.

        Parameters
        ----------
        X, y, groups
            As in `fit`.
        columns : dict, optional
            Name -> columns to permute together (say, the indicators of one factor); default each alone.
        n_repeats : int
            Number of permutations of each.

        Returns
        -------
        DataFrame
            `covariate, importance, std`, the most important first.
        """
        check_is_fitted(self, "steps_")
        rows, target = validated(self, X, None, reset=False)[0], np.asarray(y, dtype=float)
        codes = Clusters.of(groups, len(rows)).codes
        kept = thinned_rows(codes, self.max_rows_per_group)
        loss = GroupLoss(target[kept], codes[kept], self.loss, self.score_rows)
        blocks = column_blocks(column_names(self), columns)
        rng = np.random.default_rng(seed_of(self.random_state))
        return permutation_losses(self._raw, rows[kept], loss, blocks, n_repeats, rng)

    def leave_groups_out(self, X: Any, y: Any, groups: Any = None, folds: Any = None) -> Floats:
        """Prediction of each row by a model that is fitted and tuned without the row's fold.

        Every fold gets a fit of its own. For the choice of setting and rounds the folds are put into blocks: a
        model without the blocks b and c scores c for the folds of b, and b for the folds of c. So the folds of
        a block share their choice, and no choice has seen the fold it is for (nor the rest of its block).

        Parameters
        ----------
        X, y, groups
            As in `fit`.
        folds : array-like of shape (n_rows,), optional
            Fold of each row, constant within a group; default each group is a fold.

        Returns
        -------
        ndarray of shape (n_rows,)
            Predictions. Attributes `fold_labels_`, `fold_params_`, `fold_rounds_` say what each fold used.
        """
        sample, clusters, rows, seed = self._prepared(X, y, groups)
        fold_labels, fold_of_group = folds_of(folds, clusters)
        settings = self._settings()
        with Parallel(n_jobs=self.n_jobs) as parallel:
            choices = self._shared_choices(sample, settings, fold_of_group, len(fold_labels), seed, parallel)
            fold_of_row = fold_of_group[clusters.codes]
            jobs = [
                delayed(self._predicted)(
                    sample,
                    self._base() | settings[setting],
                    fold_of_group != fold,
                    rounds,
                    seed,
                    rows[fold_of_row == fold],
                )
                for fold, (setting, rounds) in enumerate(choices)
            ]
            results = parallel(jobs)
        prediction = np.empty(len(rows))
        for fold, values in enumerate(results):
            prediction[fold_of_row == fold] = values
        self.fold_labels_ = fold_labels
        self.fold_params_ = [self._base() | settings[setting] for setting, _ in choices]
        self.fold_rounds_ = np.array([rounds for _, rounds in choices])
        return prediction

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted model as plain arrays: numbers, and bytes of JSON and of LightGBM's text format."""
        check_is_fitted(self, "steps_")
        about = {
            "settings": plain(self.get_params(deep=False)),
            "best_params": plain(self.best_params_),
            "levels": plain(self.columns_.levels),
            "n_features_in": int(self.n_features_in_),
            "feature_names_in": plain(getattr(self, "feature_names_in_", None)),
            "n_rounds": int(self.n_rounds_),
            "correlation_parameter": float(self.correlation_parameter_),
            "start": float(self.start_),
        }
        return {
            "about": as_text_array(about),
            "booster": booster_array(self.booster_),
            "position": self.position_,
            "steps": self.steps_,
            "learning_curve": self.learning_curve_.to_numpy(dtype=float),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Reverse of `to_arrays`; predictions are the same to the last bit."""
        about = from_text_array(arrays["about"])
        model = cls(**about["settings"])
        model.best_params_ = about["best_params"]
        model.columns_ = Columns(about["levels"])
        model.n_features_in_ = about["n_features_in"]
        if about["feature_names_in"] is not None:
            model.feature_names_in_ = np.array(about["feature_names_in"], dtype=object)
        model.n_rounds_, model.start_ = about["n_rounds"], about["start"]
        model.correlation_parameter_ = about["correlation_parameter"]
        model.booster_ = booster_of(arrays["booster"])
        model.position_, model.steps_ = arrays["position"], arrays["steps"]
        model.learning_curve_ = pd.DataFrame(arrays["learning_curve"], columns=["round", "fold", "error"])
        return model

    def _prepared(self, X: Any, y: Any, groups: Any) -> tuple[_Sample, Clusters, Floats, int]:
        checked(self, _ALLOWED)
        rows, target = validated(self, X, y, reset=True)
        assert target is not None
        clusters = Clusters.of(groups, len(rows))
        kept = thinned_rows(clusters.codes, self.max_rows_per_group)
        codes = clusters.codes[kept]
        categorical = self.columns_.categorical_positions(column_names(self))
        sample = _Sample(
            grower=TreeGrower(rows[kept], categorical, self.max_bins),
            y=target[kept],
            codes=codes,
            weight=row_weights(codes, self.group_weight),
            loss=GroupLoss(target[kept], codes, self.loss, self.score_rows),
            n_groups=clusters.n_groups,
        )
        return sample, clusters, rows, seed_of(self.random_state)

    def _base(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in _SETTINGS}

    def _settings(self) -> list[dict[str, Any]]:
        grid = DEFAULT_GRID if isinstance(self.param_grid, str) else self.param_grid
        return settings_of(self._base(), grid)

    def _raw(self, rows: Floats) -> Floats:
        lone = self.position_ < 0
        total = sum_of_trees(self.booster_, rows, 0, int((~lone).sum()))
        return np.asarray(self.start_ + total + self.steps_[lone].sum())

    def _keep(self, path: _Path) -> None:
        self.start_ = path.start
        self.booster_, self.position_, self.steps_ = _written(path)

    def _predicted(
        self, sample: _Sample, setting: dict[str, Any], allowed: Bools, n_rounds: int, seed: int, rows: Floats
    ) -> Floats:
        """Fit the allowed groups and predict `rows`."""
        path = self._boost(sample, setting, allowed, n_rounds, seed)
        booster, position, steps = _written(path)
        total = sum_of_trees(booster, rows, 0, int((position >= 0).sum()))
        return np.asarray(path.start + total + steps[position < 0].sum())

    def _boost(
        self,
        sample: _Sample,
        setting: dict[str, Any],
        allowed: Bools,
        n_rounds: int,
        seed: int,
        scored: Sequence[Ints] = (),
    ) -> _Path:
        """Boost on the allowed groups; with `scored` sets of groups, stop once all of them stopped improving."""
        inside = allowed[sample.codes]
        weight = np.where(inside, sample.weight, 0.0)
        y = np.where(inside, sample.y, 0.0)
        shape = TreeShape(**{name: setting[name] for name in TreeShape.__dataclass_fields__})
        path = _Path(0.0, sample.grower.start(shape))
        working = WorkingCorrelation(setting["correlation"], sample.codes, weight)
        if self.start == "mean":
            working.estimate(np.where(inside, y - np.average(y, weights=weight), 0.0))
            one = np.zeros(y.size, dtype=np.int64)
            path.start = float(working.solve(y).sum() / working.normal_matrix(one, 1)[0, 0])
        fitted = np.full(y.size, path.start)
        rng = np.random.default_rng([seed, 2])
        for _ in range(n_rounds):
            drawn = rng.random(sample.n_groups) < setting["subsample"]
            tree_seed = int(rng.integers(1, 2**31 - 1))
            residual = np.where(inside, y - fitted, 0.0)
            working.estimate(residual)
            round_weight = weight
            if setting["subsample"] < 1.0 and (drawn & allowed).any():
                round_weight = np.where(drawn[sample.codes], weight, 0.0)
            fitted = fitted + self._round(path, working, residual, round_weight, setting, tree_seed, sample)
            if scored:
                path.losses.append(sample.loss(fitted))
                if all(_stopped(path.losses, groups, self.patience) for groups in scored):
                    break
        path.rho = working.rho
        return path

    def _round(
        self,
        path: _Path,
        working: WorkingCorrelation,
        residual: Floats,
        weight: Floats,
        setting: dict[str, Any],
        tree_seed: int,
        sample: _Sample,
    ) -> Floats:
        """Add a tree; the step of every row of the sample."""
        current = working
        if weight is not working.weight:
            current = WorkingCorrelation(working.kind, working.codes, weight)
            current.rho = working.rho
        gradient = current.solve(residual)
        path.trees.grow(gradient, weight, tree_seed)
        leaf = path.trees.leaves(sample.grower.X, first=len(path.trees.position) - 1)[0]
        n_leaves = int(leaf.max()) + 1
        normal = current.normal_matrix(leaf, n_leaves)
        empty = np.diag(normal) <= 0
        normal[empty, empty] = 1.0
        score = np.bincount(leaf, gradient, n_leaves)
        values = setting["learning_rate"] * np.linalg.solve(normal, score)
        path.values.append(values)
        return np.asarray(values[leaf])

    def _fold_errors(
        self, sample: _Sample, setting: dict[str, Any], block: Ints, allowed: Bools, seed: int
    ) -> Floats:
        """Loss of each group after each round when its block is left out, shape (n_rounds, n_groups)."""
        errors = np.full((self.n_rounds + 1, sample.n_groups), np.nan)
        for left_out in np.unique(block[allowed]):
            inside = allowed & (block != left_out)
            groups = np.flatnonzero(allowed & (block == left_out))
            if not inside.any():
                continue
            path = self._boost(sample, self._base() | setting, inside, self.n_rounds, seed, [groups])
            _fill(errors, path, groups, self.patience)
        return errors[1:]

    def _shared_choices(
        self,
        sample: _Sample,
        settings: list[dict[str, Any]],
        fold_of_group: Ints,
        n_folds: int,
        seed: int,
        parallel: Parallel,
    ) -> list[tuple[int, int]]:
        """Setting and number of rounds of each fold."""
        if self.n_folds is None or n_folds < 3:
            return [(0, self.n_rounds)] * n_folds
        block_of_fold = _blocks(n_folds, 2 * self.n_folds, seed)
        block = block_of_fold[fold_of_group]
        n_blocks = int(block.max()) + 1
        pairs = [(b, c) for b in range(n_blocks) for c in range(b + 1, n_blocks)]
        jobs = [
            delayed(self._pair_errors)(sample, self._base() | setting, block, pair, seed)
            for setting in settings
            for pair in pairs
        ]
        results = parallel(jobs)
        errors = np.full((n_blocks, len(settings), self.n_rounds, sample.n_groups), np.nan)
        for index, (of_first, of_second) in enumerate(results):
            setting, (b, c) = index // len(pairs), pairs[index % len(pairs)]
            errors[c, setting][:, block == b] = of_first
            errors[b, setting][:, block == c] = of_second
        chosen = [_choice(list(errors[b])) for b in range(n_blocks)]
        return [chosen[b] for b in block_of_fold]

    def _pair_errors(
        self, sample: _Sample, setting: dict[str, Any], block: Ints, pair: tuple[int, int], seed: int
    ) -> tuple[Floats, Floats]:
        """Losses by round of the groups of two blocks, by a model without both."""
        scored = [np.flatnonzero(block == b) for b in pair]
        inside = (block != pair[0]) & (block != pair[1])
        errors = np.full((self.n_rounds + 1, sample.n_groups), np.nan)
        path = self._boost(sample, setting, inside, self.n_rounds, seed, scored)
        for groups in scored:
            _fill(errors, path, groups, self.patience)
        return errors[1:, scored[0]], errors[1:, scored[1]]


_ALLOWED = {
    "n_rounds": ("an integer >= 1", lambda v: v >= 1),
    "learning_rate": ("a number in (0, 1]", lambda v: 0 < v <= 1),
    "max_leaf_nodes": ("an integer >= 2", lambda v: v >= 2),
    "max_depth": ("None or an integer >= 1", lambda v: v is None or v >= 1),
    "min_leaf_weight": ("a number >= 0", lambda v: v >= 0),
    "max_features": ("a share in (0, 1]", lambda v: 0 < v <= 1),
    "subsample": ("a share in (0, 1]", lambda v: 0 < v <= 1),
    "correlation": ("one of " + ", ".join(_LARGEST), lambda v: v in _LARGEST),
    "start": ("'mean' or 'zero'", lambda v: v in ("mean", "zero")),
    "group_weight": ("'equal' or 'rows'", lambda v: v in ("equal", "rows")),
    "max_rows_per_group": ("None or an integer >= 1", lambda v: v is None or v >= 1),
    "max_bins": ("an integer >= 2", lambda v: v >= 2),
    "n_folds": ("None or an integer >= 2", lambda v: v is None or v >= 2),
    "patience": ("an integer >= 1", lambda v: v >= 1),
    "param_grid": (
        "None, 'default' or a dict",
        lambda v: v is None or v == "default" or isinstance(v, Mapping),
    ),
    "loss": ("'squared', 'absolute' or a function", lambda v: callable(v) or v in ("squared", "absolute")),
    "score_rows": ("'all' or 'last'", lambda v: v in ("all", "last")),
}


def _blocks(n: int, n_blocks: int, seed: int) -> Ints:
    """Assign n items at random to blocks of nearly equal size."""
    return np.random.default_rng([seed, 3]).permutation(np.arange(n) % min(n, n_blocks))


def _stopped(losses: list[Floats], groups: Ints, patience: int) -> bool:
    """Whether the last `patience` rounds brought no improvement for these groups."""
    curve = (
        np.array([loss[groups].mean() for loss in losses[-patience - 1 :]])
        if len(losses) > patience
        else None
    )
    return curve is not None and bool(curve[1:].min() >= curve[0])


def _fill(errors: Floats, path: _Path, groups: Ints, patience: int) -> None:
    """Write the losses of `groups` up to the round where they alone would have stopped."""
    curve = np.array(path.losses)[:, groups]
    mean = curve.mean(axis=1)
    end = len(curve)
    for t in range(patience, len(curve)):
        if mean[t - patience + 1 : t + 1].min() >= mean[t - patience]:
            end = t + 1
            break
    errors[1 : end + 1, groups] = curve[:end]


def _choice(errors: Sequence[Floats]) -> tuple[int, int]:
    """Setting and number of rounds of the least mean error over groups, among rounds that all groups reached."""
    best, n_rounds, least = 0, 1, np.inf
    for index, error in enumerate(errors):
        scored = ~np.isnan(error[0])
        curve = error[:, scored].mean(axis=1)
        if not scored.any() or np.isnan(curve).all():
            continue
        at = int(np.nanargmin(curve))
        if curve[at] < least:
            best, n_rounds, least = index, at + 1, float(curve[at])
    return best, n_rounds


def _learning_curve(errors: Floats, block: Ints) -> pd.DataFrame:
    """Mean error of each fold after each round, long."""
    parts = []
    for fold in np.unique(block):
        curve = errors[:, block == fold].mean(axis=1)
        reached = ~np.isnan(curve)
        parts.append(
            pd.DataFrame({"round": np.flatnonzero(reached) + 1, "fold": fold, "error": curve[reached]})
        )
    return pd.concat(parts, ignore_index=True)


def _written(path: _Path) -> tuple[Any, Ints, Floats]:
    """Booster with the leaf values of the path, tree -> its place there, first value of each tree."""
    position = np.array(path.trees.position, dtype=np.int64)
    for place, values in zip(position, path.values, strict=True):
        if place >= 0:
            for leaf, value in enumerate(values):
                path.trees.booster.set_leaf_output(int(place), leaf, float(value))
    return path.trees.booster, position, np.array([values[0] for values in path.values])
