"""What the two tree learners for clustered data share: columns, groups, rows, losses and the trees themselves.

Rows come in groups (subjects, sites, sessions ...). Everything here treats the group as the unit: it weighs,
it is drawn, it is scored. The trees are LightGBM's; only its histogram tree is used, one tree per call, with
gradients and weights of our own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_consistent_length, validate_data

from tripwatt.errors import Fault, InvalidInput

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Loss = Literal["squared", "absolute"] | Callable[[Floats, Floats], float]
ScoreRows = Literal["all", "last"]


@dataclass(frozen=True)
class Columns:
    """How the columns of a table become numbers: levels by column name, learned once.

    Attributes
    ----------
    levels : dict
        Column name -> its levels, in the order of their codes. Other columns are numeric.

    Examples
    --------
    >>> table = pd.DataFrame({"dose": [1.0, 2.0], "site": ["a", "b"]})
    >>> columns = Columns.of(table)
    >>> columns.encode(pd.DataFrame({"dose": [3.0], "site": ["elsewhere"]})).to_numpy()
    array([[ 3., nan]])
    """

    levels: dict[str, list[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, X: Any) -> Columns:
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
        """Numbers for levels; a level that was not learned, and a missing one, become NaN."""
        if not isinstance(X, pd.DataFrame):
            return X
        encoded = {}
        faults = []
        for name in X.columns:
            known = self.levels.get(str(name))
            if known is not None:
                codes = pd.Index(known).get_indexer(pd.Index(X[name]))
                encoded[name] = np.where(codes < 0, np.nan, codes.astype(float))
                continue
            try:
                encoded[name] = X[name].to_numpy(dtype=float, na_value=np.nan)
            except (TypeError, ValueError):
                faults.append(
                    Fault("a column of text where numbers were learned", f"column {name}", str(X[name].dtype))
                )
        if faults:
            raise InvalidInput(faults)
        return pd.DataFrame(encoded, index=X.index, columns=X.columns)

    def categorical_positions(self, names: Sequence[str]) -> list[int]:
        """Positions of the columns with levels."""
        return [position for position, name in enumerate(names) if name in self.levels]


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
    codes: Ints

    @classmethod
    def of(cls, groups: Any, n_rows: int) -> Clusters:
        """Read `groups`, one label a row; None makes each row its own group."""
        if groups is None:
            return cls(np.arange(n_rows), np.arange(n_rows))
        values = np.asarray(groups)
        check_consistent_length(values, np.empty(n_rows))
        codes, labels = pd.factorize(pd.Series(values.ravel()), sort=True)
        if (codes < 0).any():
            rows = np.flatnonzero(codes < 0)
            raise InvalidInput(
                Fault("missing group label", f"row {rows[0]}", f"{rows.size} missing", "a label")
            )
        return cls(np.asarray(labels), codes.astype(np.int64))

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return len(self.labels)


def thinned_rows(codes: Ints, max_rows: int | None) -> Ints:
    """Rows to learn from, group after group: at most `max_rows` of each, evenly spaced, first and last kept.

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


def row_weights(codes: Ints, group_weight: Literal["equal", "rows"]) -> Floats:
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
    loss : {"squared", "absolute"} or callable
        Mean over the rows of a group, or `loss(y_group, prediction_group) -> float`.
    score_rows : {"all", "last"}
        Rows of a group that count.
    """

    def __init__(self, y: Floats, codes: Ints, loss: Loss, score_rows: ScoreRows) -> None:
        last = np.r_[codes[1:] != codes[:-1], True]
        self.rows = np.arange(codes.size) if score_rows == "all" else np.flatnonzero(last)
        self.y = y[self.rows]
        self.loss = loss
        self.codes = codes[self.rows]
        self.starts = np.flatnonzero(np.r_[True, self.codes[1:] != self.codes[:-1]])
        self.sizes = np.diff(np.r_[self.starts, self.codes.size])

    def __call__(self, prediction: Floats) -> Floats:
        """Loss of each group, shape (..., n_groups), of predictions of shape (..., n_rows)."""
        at_rows = prediction[..., self.rows]
        if callable(self.loss):
            loss = self.loss
            pieces = [slice(start, start + size) for start, size in zip(self.starts, self.sizes, strict=True)]
            flat = at_rows.reshape(-1, self.rows.size)
            values = np.array([[float(loss(self.y[p], row[p])) for p in pieces] for row in flat])
            return np.asarray(values.reshape(*at_rows.shape[:-1], self.sizes.size))
        error = at_rows - self.y
        error = error * error if self.loss == "squared" else np.abs(error)
        return np.asarray(np.add.reduceat(error, self.starts, axis=-1) / self.sizes)


@dataclass(frozen=True)
class TreeShape:
    """What a single tree may look like; weights are counted in groups."""

    max_leaf_nodes: int = 16
    max_depth: int | None = None
    min_leaf_weight: float = 0.5
    max_features: float = 1.0

    def parameters(self) -> dict[str, Any]:
        """LightGBM's words for it."""
        return {
            "objective": "none",
            "learning_rate": 1.0,
            "num_leaves": int(self.max_leaf_nodes),
            "max_depth": -1 if self.max_depth is None else int(self.max_depth),
            "min_sum_hessian_in_leaf": float(self.min_leaf_weight) * (1.0 - 1e-6),
            "feature_fraction_bynode": float(self.max_features),
            "min_data_in_leaf": 1,
            "min_data_per_group": 1,
            "max_cat_threshold": 64,
            "cat_l2": 1.0,  # one group's weight: a level has to convince by more than one group
            "cat_smooth": 1.0,
            **_QUIET,
        }


_QUIET = {"num_threads": 1, "deterministic": True, "force_row_wise": True, "verbosity": -1}


class TreeGrower:
    """Histogram trees on one table, one tree per call; the table is binned once and shared.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
        Encoded columns; NaN is missing.
    categorical : list of int
        Positions of the columns that hold codes of levels.
    max_bins : int
        Most bins of a column. Bin edges depend on `X` alone.
    """

    def __init__(self, X: Floats, categorical: list[int], max_bins: int) -> None:
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

    def start(self, shape: TreeShape) -> Trees:
        """An empty sequence of trees of one shape on this table."""
        return Trees(self._data, shape)


class Trees:
    """A growing sequence of trees; tree `t` may be a lone leaf, which the library does not keep."""

    def __init__(self, data: Any, shape: TreeShape) -> None:
        self._data = data
        self._parameters = shape.parameters()
        self._reseed = shape.max_features < 1.0
        self.position: list[int] = []  # of tree t in the booster, -1 for a lone leaf
        self._restart()

    def _restart(self) -> None:
        import lightgbm

        self.booster = lightgbm.Booster(self._parameters, self._data)
        self._n_kept = 0

    def grow(self, gradient: Floats, weight: Floats, seed: int) -> bool:
        """Add the tree that fits `gradient / weight` by weighted least squares; False if it is a lone leaf.

        The seed restarts the draw of columns, so that a tree depends on nothing but its own arguments.
        """
        if self._reseed:
            self.booster.reset_parameter({"feature_fraction_seed": seed})
        finished = self.booster.update(fobj=lambda _prediction, _data: (-gradient, weight))
        if finished:
            if self._n_kept == 0:
                self._restart()  # a lone first tree would stay in the booster
            self.position.append(-1)
            return False
        self.position.append(self._n_kept)
        self._n_kept += 1
        return True

    def leaves(self, X: Floats, first: int = 0) -> Ints:
        """Leaf of each row in each tree from `first` on, shape (n_trees - first, n_rows)."""
        wanted = np.array(self.position[first:], dtype=np.int64)
        result = np.zeros((wanted.size, len(X)), dtype=np.int64)
        split = wanted >= 0
        if split.any():
            kept = self.booster.predict(
                X,
                start_iteration=int(wanted[split][0]),
                num_iteration=int(split.sum()),
                pred_leaf=True,
                num_threads=1,
            )
            result[split] = np.asarray(kept).reshape(len(X), -1).T
        return result


def sum_of_trees(booster: Any, X: Floats, first: int, n_trees: int) -> Floats:
    """Sum of `n_trees` trees of a booster from tree `first` on, shape (n_rows,)."""
    if n_trees <= 0 or booster is None:
        return np.zeros(len(X))
    return np.asarray(
        booster.predict(X, start_iteration=first, num_iteration=n_trees, raw_score=True, num_threads=1),
        dtype=float,
    )


def validated(estimator: Any, X: Any, y: Any, *, reset: bool) -> tuple[Floats, Floats | None]:
    """Encode and check a table, and a target if there is one, in scikit-learn's manner.

    Errors
    ------
    ValueError for wrong shapes, infinite values or missing targets, as scikit-learn words them.
    """
    if reset:
        estimator.columns_ = Columns.of(X)
    encoded = estimator.columns_.encode(X)
    options: dict[str, Any] = {"dtype": np.float64, "ensure_all_finite": "allow-nan", "reset": reset}
    if y is None:
        return validate_data(estimator, encoded, **options), None
    encoded, target = validate_data(estimator, encoded, y, y_numeric=True, **options)
    return encoded, np.asarray(target, dtype=float)


def column_names(estimator: Any) -> list[str]:
    """Names of the columns an estimator was fitted on, `x0, x1, ...` where the table had none."""
    names = getattr(estimator, "feature_names_in_", None)
    return [f"x{i}" for i in range(estimator.n_features_in_)] if names is None else [str(n) for n in names]


def settings_of(base: Mapping[str, Any], grid: Mapping[str, Sequence[Any]] | None) -> list[dict[str, Any]]:
    """All combinations of a grid on top of the base settings; unknown names are refused, all at once."""
    from itertools import product

    if not grid:
        return [{}]
    unknown = [name for name in grid if name not in base]
    if unknown:
        raise InvalidInput(
            [
                Fault("unknown setting in param_grid", name, allowed=", ".join(sorted(base)))
                for name in unknown
            ]
        )
    return [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]


def checked(estimator: Any, allowed: Mapping[str, tuple[str, Callable[[Any], bool]]]) -> None:
    """Refuse settings that make no sense, all at once: name -> (what is allowed, test)."""
    faults = []
    for name, (text, test) in allowed.items():
        value = getattr(estimator, name)
        try:
            sound = bool(test(value))
        except TypeError:
            sound = False
        if not sound:
            faults.append(
                Fault("setting out of range", f"{type(estimator).__name__}({name}=)", repr(value), text)
            )
    if faults:
        raise InvalidInput(faults)


def permutation_losses(
    predict: Callable[[Floats], Floats],
    X: Floats,
    loss: GroupLoss,
    blocks: Mapping[str, Sequence[int]],
    n_repeats: int,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Rise of the mean group loss when a block of columns is permuted over the rows (Breiman 2001).

    Returns
    -------
    DataFrame
        One row per block: `covariate, importance, std` (over the repeats), the most important first.
    """
    reference = loss(predict(X)).mean()
    rows = []
    for name, positions in blocks.items():
        rises = []
        for _ in range(n_repeats):
            shuffled = X.copy()
            shuffled[:, list(positions)] = X[rng.permutation(len(X))][:, list(positions)]
            rises.append(loss(predict(shuffled)).mean() - reference)
        rows.append({"covariate": name, "importance": float(np.mean(rises)), "std": float(np.std(rises))})
    return pd.DataFrame(rows).sort_values("importance", ascending=False, ignore_index=True)


def column_blocks(names: Sequence[str], columns: Mapping[str, Sequence[str]] | None) -> dict[str, list[int]]:
    """Positions of the columns that are permuted together: each alone, or as `columns` says."""
    if columns is None:
        return {name: [position] for position, name in enumerate(names)}
    faults = [
        Fault("unknown column", f"columns[{block!r}]", name, ", ".join(names))
        for block, members in columns.items()
        for name in members
        if name not in names
    ]
    if faults:
        raise InvalidInput(faults)
    return {block: [list(names).index(name) for name in members] for block, members in columns.items()}


def as_text_array(value: Any) -> npt.NDArray[np.uint8]:
    """JSON as bytes in an array, so that a model is arrays and nothing else."""
    return np.frombuffer(json.dumps(value).encode(), dtype=np.uint8).copy()


def from_text_array(array: npt.NDArray[np.uint8]) -> Any:
    """Reverse of `as_text_array`."""
    return json.loads(array.tobytes().decode())


def booster_array(booster: Any) -> npt.NDArray[np.uint8]:
    """LightGBM's documented text format, as bytes (empty: no trees)."""
    text = "" if booster is None else booster.model_to_string(num_iteration=-1)
    return np.frombuffer(text.encode(), dtype=np.uint8).copy()


def booster_of(array: npt.NDArray[np.uint8]) -> Any:
    """Reverse of `booster_array`."""
    import lightgbm

    return lightgbm.Booster(model_str=array.tobytes().decode()) if array.size else None


def plain(value: Any) -> Any:
    """A setting as JSON knows it; what JSON cannot hold (a generator, a function) becomes None."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(v) for v in value]
    return value if value is None or isinstance(value, bool | int | float | str) else None


def mean_over_groups(losses: Floats) -> float:
    """Mean of the groups that have a loss; infinite if none has."""
    known = losses[~np.isnan(losses)]
    return float(known.mean()) if known.size else np.inf


def seed_of(random_state: Any) -> int:
    """An integer seed out of whatever scikit-learn takes for one."""
    return int(check_random_state(random_state).randint(2**31 - 2))


def folds_of(folds: Any, clusters: Clusters) -> tuple[npt.NDArray[Any], Ints]:
    """Labels of the folds and the fold of each group."""
    if folds is None:
        return clusters.labels, np.arange(clusters.n_groups)
    by_row = Clusters.of(folds, clusters.codes.size)
    fold_of_group = np.zeros(clusters.n_groups, dtype=np.int64)
    fold_of_group[clusters.codes] = by_row.codes
    torn = clusters.labels[np.unique(clusters.codes[fold_of_group[clusters.codes] != by_row.codes])]
    if torn.size:
        raise InvalidInput(
            [
                Fault(
                    "a group lies in two folds", f"group {label}", allowed="one fold for all rows of a group"
                )
                for label in torn
            ]
        )
    return by_row.labels, fold_of_group
