"""Additive Gaussian process for clustered rows, fitted to the clusters' totals.

``y(x) = sum_c f_c(x) + group effect + error`` with independent Gaussian processes `f_c`: a line through the origin in
one column, or a smooth function of a few columns. Rows of a cluster are far from independent, so the model is fitted to
the weighted totals of the clusters. Smooth parts are represented on inducing points (Nystrom), so the model is a Bayesian
linear regression in a few hundred features and is stored as plain arrays. The variances of the parts are found by maximum
a posteriori of the marginal likelihood (Rasmussen and Williams 2006, sections 2.2, 5.4 and 8.1). The module is
independent of cars and trips.
"""

from __future__ import annotations

import types
from collections.abc import Collection, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
import pandas as pd
from numpy.linalg import cholesky, solve

from tripwatt.arrays import FloatArray, covariance_factor
from tripwatt.errors import Fault, InvalidInput, raise_faults

Table = pd.DataFrame | Mapping[str, FloatArray]
"""Columns by name: a data frame, or arrays of shape (rows,)."""

_JITTER: Final = 1e-8
# most inducing points of a term in one column; terms in several columns have four times as many
_INDUCING: Final = 10
_LOG_SD: Final = 3.0  # standard deviation of the log-normal prior of each variance around its start


@dataclass(frozen=True, slots=True)
class KernelTerm:
    """One function of the sum.

    Attributes
    ----------
    columns : tuple of str
        Columns that the function depends on.
    kind : {"line", "smooth"}
        A line through the origin in one column, or a smooth (squared-exponential) function of all columns.
    sd : float
        Prior standard deviation of the slope of a line or of the value of a smooth function; the search of the variance starts
        at its square.
    length : float
        Length scale of a smooth term, in standard deviations of each column.
    """

    columns: tuple[str, ...]
    kind: str
    sd: float
    length: float = 1.0


@dataclass(eq=False, repr=False)
class AdditiveGP:
    """Additive Gaussian process on cluster totals.

    Parameters
    ----------
    terms : sequence of KernelTerm
    effect_sd : float
        Start value of the standard deviation of the group effect, a constant in the units of `y`.
    share_column : str or None
        Column for a second group effect, in proportion to the column; None for no such effect.
    share_sd : float
        Start value of the standard deviation of that proportion.
    df : float or None
        Degrees of freedom of the group effects' t distribution: outlying clusters count less. Lange, Little and Taylor
        (1989, JASA 84) advise 4 for few data; None makes the effects Gaussian.

    Attributes
    ----------
    variances_ : ndarray
        Variance of each term, of the group effect, and of the proportion of `share_column`.
    weights_, factor_ : ndarray, shapes (features,) and (features, features)
        Posterior of the features' weights: their mean, and the lower triangle `L` of their covariance ``L @ L.T``.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> site = np.repeat(np.arange(40), 10)
    >>> X = pd.DataFrame({"dose": rng.uniform(0.0, 10.0, 400)})
    >>> y = 3.0 * X["dose"].to_numpy() + rng.normal(0.0, 1.0, 40)[site]
    >>> model = AdditiveGP([KernelTerm(("dose",), "line", sd=10.0)], effect_sd=1.0).fit(X, y, site)
    >>> bool(abs(model.predict(pd.DataFrame({"dose": [1.0]}))[0] - 3.0) < 0.1)
    True
    """

    terms: Sequence[KernelTerm]
    _: KW_ONLY
    effect_sd: float
    share_column: str | None = None
    share_sd: float = 0.05
    df: float | None = 4.0
    means_: dict[str, float] = field(init=False)
    sds_: dict[str, float] = field(init=False)
    ranges_: dict[str, tuple[float, float]] = field(init=False)
    points_: dict[int, FloatArray] = field(init=False)
    whiteners_: dict[int, FloatArray] = field(init=False)

    def fit(
        self,
        X: pd.DataFrame,
        y: npt.ArrayLike,
        groups: npt.ArrayLike,
        weight: npt.ArrayLike | None = None,
        total_sd: npt.ArrayLike | None = None,
    ) -> Self:
        """Fit to the groups' totals. O(groups^3 + rows x features).

        Parameters
        ----------
        X : DataFrame, (rows, columns)
            NaN counts as the column's mean.
        y : array_like, shape (rows,)
        groups : array_like, shape (rows,)
        weight : array_like, shape (rows,), optional
            Weight of each row in its group's total, e.g. its duration; 1 by default.
        total_sd : array_like, shape (groups,), optional
            Known standard deviation of the measurement of each group's total, in the order of their first rows; 0 by default.

        Raises
        ------
        InvalidInput
            If a column is missing or there are fewer than 3 groups.
        """
        wanted = {c for term in self.terms for c in term.columns} | ({self.share_column} - {None})
        missing = sorted(str(c) for c in wanted if c not in X.columns)
        raise_faults(Fault("missing column", "X", c, f"one of {sorted(X.columns)}") for c in missing)
        codes, labels = pd.factorize(np.asarray(groups))
        if len(labels) < 3:
            raise InvalidInput.of("too few groups", "groups", str(len(labels)), "at least 3")
        w = np.ones(len(X)) if weight is None else np.asarray(weight, dtype=np.float64)
        self._learn_columns(X)
        features = self.features(X)
        totals = np.stack([np.bincount(codes, feature * w) for feature in features.T], 1, dtype=np.float64)
        target = np.asarray(np.bincount(codes, np.asarray(y, dtype=np.float64) * w), dtype=np.float64)
        effects: list[FloatArray] = [np.asarray(np.bincount(codes, w), dtype=np.float64)]
        if self.share_column is not None:
            share = self._fill_missing(float_columns(X)[self.share_column], self.share_column)
            effects.append(np.asarray(np.bincount(codes, np.abs(share) * w), dtype=np.float64))
        self._measured2 = np.zeros(len(labels)) if total_sd is None else np.square(np.asarray(total_sd))
        self._fit_totals(totals, target, np.array(effects))
        return self

    def predict(self, X: Table) -> FloatArray:
        """Mean of the sum of the terms, shape (rows,); the group effect of a new group is 0."""
        return np.asarray(self.features(X) @ self.weights_)

    def features(self, X: Table) -> FloatArray:
        """Features of the rows, shape (rows, features)."""
        columns, ends = float_columns(X), np.cumsum(self._sizes())
        features = np.empty((len(next(iter(columns.values()))), ends[-1]))
        smooth = dict.fromkeys(c for term in self.terms if term.kind == "smooth" for c in term.columns)
        # the first value if all are equal, such as a temperature at departure in the rows of a trip
        held = {n: c[:1] if (c == c[:1]).all() else c for n in smooth for c in [self._held(columns, n)]}
        for i, (term, end) in enumerate(zip(self.terms, ends, strict=True)):
            if term.kind == "line":
                block = self._fill_missing(columns[term.columns[0]], term.columns[0])[:, None]
            else:
                block = _squared_exponential(self._standard(held, term), self.points_[i]) @ self.whiteners_[i]
            features[:, end - block.shape[1] : end] = block
        return features

    def factor(self, features: FloatArray) -> FloatArray:
        """Factor `L`, shape of `features`, of the posterior covariance ``L @ L.T`` of the sum of the terms at the rows, or at a sum of rows."""
        return np.asarray(features @ self.factor_)

    def prior_factor(self, features: FloatArray) -> FloatArray:
        """Factor `L`, shape (rows, features), of the prior covariance ``L @ L.T`` of the sum of the terms at the rows."""
        return np.asarray(features * np.sqrt(self.by_feature(self.variances_[: len(self.terms)])))

    def outside_factor(
        self,
        X: Table,
        at_most: Mapping[str, float] = types.MappingProxyType({}),
        inside: Collection[str] = (),
    ) -> FloatArray:
        """Prior standard deviation of smooth terms outside of their training range, shape (rows, smooth terms with a value outside).

        A term is held at the edge of its range. Under its prior, of variance `v`, its value at a scaled distance `d`
        differs from that at the edge with mean square ``2 v (1 - exp(-d²/2))``: 0 inside the range, and twice the prior
        variance far outside. Each column of the result is the root of this, the error of one term, common to all rows of a
        group. Columns of `X` in `at_most` are limited to the given values; those in `inside` count as inside of their range.
        """
        columns = dict(float_columns(X))
        columns |= {name: np.minimum(columns[name], most) for name, most in at_most.items()}
        smooth = [(i, term) for i, term in enumerate(self.terms) if term.kind == "smooth"]
        names = dict.fromkeys(c for _, term in smooth for c in term.columns if c not in inside)
        distance2 = {}
        for name in names:
            low, high = self.ranges_[name]
            if np.fmin.reduce(columns[name]) < low or np.fmax.reduce(columns[name]) > high:
                values = self._fill_missing(columns[name], name) - self.means_[name]
                distance2[name] = ((values - self._held(columns, name)) / self.sds_[name]) ** 2
        spreads = [
            np.sqrt(-2.0 * self.variances_[i] * np.expm1(-0.5 * sum(outside) / term.length**2))
            for i, term in smooth
            if (outside := [distance2[c] for c in term.columns if c in distance2])
        ]
        return np.column_stack(spreads) if spreads else np.zeros((len(next(iter(columns.values()))), 0))

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return everything that prediction needs, as plain arrays."""
        return {
            "weights": self.weights_,
            "factor": self.factor_,
            "variances": self.variances_,
            "columns": np.array(list(self.means_), dtype=np.str_),
            "means": np.array(list(self.means_.values())),
            "sds": np.array([self.sds_[c] for c in self.means_]),
            "ranges": np.array([self.ranges_[c] for c in self.means_]),
            **{f"points{i}": points for i, points in self.points_.items()},
            **{f"whitener{i}": whitener for i, whitener in self.whiteners_.items()},
        }

    def load_arrays(self, arrays: dict[str, npt.NDArray[Any]]) -> Self:
        """Reverse of `to_arrays`, on a model made with the same settings."""
        names = [str(c) for c in arrays["columns"]]
        self.weights_, self.factor_ = arrays["weights"], arrays["factor"]
        self.variances_ = arrays["variances"]
        self.means_ = dict(zip(names, arrays["means"].tolist(), strict=True))
        self.sds_ = dict(zip(names, arrays["sds"].tolist(), strict=True))
        self.ranges_ = dict(zip(names, map(tuple, arrays["ranges"].tolist()), strict=True))
        smooth = [i for i, term in enumerate(self.terms) if term.kind == "smooth"]
        self.points_ = {i: arrays[f"points{i}"] for i in smooth}
        self.whiteners_ = {i: arrays[f"whitener{i}"] for i in smooth}
        return self

    def _learn_columns(self, X: pd.DataFrame) -> None:
        self.means_, self.sds_, self.ranges_ = {}, {}, {}
        for name in dict.fromkeys(c for term in self.terms for c in term.columns):
            values = np.asarray(X[name], dtype=np.float64)
            known = values[np.isfinite(values)]
            self.means_[name] = float(known.mean()) if len(known) else 0.0
            self.sds_[name] = float(known.std()) or 1.0 if len(known) else 1.0
            self.ranges_[name] = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
        self.points_, self.whiteners_ = {}, {}
        columns = float_columns(X)
        for i, term in ((i, term) for i, term in enumerate(self.terms) if term.kind == "smooth"):
            held = {c: self._held(columns, c) for c in term.columns}
            z = np.column_stack(self._standard(held, term)).round(3)
            # much faster for one column than with an axis
            z = np.unique(z)[:, None] if z.shape[1] == 1 else np.unique(z, axis=0)
            most = _INDUCING if len(term.columns) == 1 else 4 * _INDUCING
            self.points_[i] = _inducing_points(z, most)
            gram = _squared_exponential(list(self.points_[i].T), self.points_[i])
            self.whiteners_[i] = np.linalg.inv(cholesky(gram + 1e-6 * np.eye(len(gram)))).T

    def _fill_missing(self, values: FloatArray, name: str) -> FloatArray:
        """Replace missing values of a column by its mean."""
        known = np.isfinite(values)
        return values if known.all() else np.where(known, values, self.means_.get(name, 0.0))

    def _held(self, X: Mapping[str, FloatArray], name: str) -> FloatArray:
        """Distance of a column from its mean, held at the edge of the training range."""
        low, high = self.ranges_[name]
        return np.minimum(np.maximum(self._fill_missing(X[name], name), low), high) - self.means_[name]

    def _standard(self, held: Mapping[str, FloatArray], term: KernelTerm) -> list[FloatArray]:
        """Columns of a smooth term in units of its length scale."""
        return [held[c] / (self.sds_[c] * term.length) for c in term.columns]

    def _sizes(self) -> list[int]:
        """Number of features of each term."""
        return [1 if t.kind == "line" else self.whiteners_[i].shape[1] for i, t in enumerate(self.terms)]

    def by_feature(self, of_terms: npt.ArrayLike) -> FloatArray:
        """Repeat a value of each term for all features of the term."""
        return np.repeat(np.asarray(of_terms), self._sizes())

    def _fit_totals(self, totals: FloatArray, target: FloatArray, effects: FloatArray) -> None:
        """Fit the variances, then the posterior of the features' weights; outlying clusters count less."""
        of_terms = np.split(totals, np.cumsum(self._sizes())[:-1], axis=1)
        kernels = np.array([part @ part.T for part in of_terms])
        scale = np.ones(len(target))  # latent scale of the t distribution of each cluster's own effects
        self.variances_ = self._variances(kernels, target, effects, scale)
        # three passes; a choice
        for _ in range(3 if self.df is not None else 0):
            scale = self._latent_scale(kernels, target, effects, scale)
            self.variances_ = self._variances(kernels, target, effects, scale, self.variances_)
        K = self._covariance(kernels, effects, scale)
        prior = self.by_feature(self.variances_[: len(self.terms)])
        gain = solve(K, totals * prior).T
        self.weights_ = np.asarray(gain @ target)
        factor = covariance_factor(np.diag(prior) - gain @ (totals * prior))
        # half of it is zeros, which take no space in a stored model
        self.factor_ = np.asarray(np.linalg.qr(factor.T, mode="r")).T

    def _variances(
        self,
        kernels: FloatArray,
        target: FloatArray,
        effects: FloatArray,
        scale: FloatArray,
        before: FloatArray | None = None,
    ) -> FloatArray:
        """Maximum a posteriori of the variances, by exact gradients. O(parts x groups^2 + groups^3) per step.

        The search starts at the variances `before`, or at those of the prior if not given.
        """
        from scipy.optimize import minimize

        every = np.concatenate([kernels, [np.diag(e**2 * scale) for e in effects]])
        sds = [p.sd for p in self.terms] + [self.effect_sd, self.share_sd][: len(effects)]
        start = 2.0 * np.log(np.array(sds))
        jitter = _JITTER * float(np.mean(target**2) + 1e-12)

        def cost(logs: FloatArray) -> tuple[float, FloatArray]:
            v = np.exp(logs)
            K = np.tensordot(v, every, 1)
            K[np.diag_indices_from(K)] += jitter + self._measured2
            inverse = np.linalg.inv(K)
            alpha = inverse @ target
            value = 0.5 * target @ alpha + np.log(np.diag(cholesky(K))).sum()
            gradient = 0.5 * v * np.tensordot(every, inverse - np.outer(alpha, alpha), ([1, 2], [0, 1]))
            pull = (logs - start) / _LOG_SD
            return float(value + 0.5 * pull @ pull), gradient + pull / _LOG_SD

        bounds = [(s - 9.0, s + 9.0) for s in start]
        first = start if before is None else np.log(before)
        result = minimize(cost, first, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 100})
        return np.asarray(np.exp(result.x))

    def _covariance(self, kernels: FloatArray, effects: FloatArray, scale: FloatArray) -> FloatArray:
        n = len(self.terms)
        K = np.tensordot(self.variances_[:n], kernels, 1)
        effect_variance = self.variances_[n:] @ effects**2
        K[np.diag_indices_from(K)] += (
            effect_variance * scale + _JITTER * effect_variance.mean() + self._measured2
        )
        return np.asarray(K)

    def _latent_scale(
        self, kernels: FloatArray, target: FloatArray, effects: FloatArray, scale: FloatArray
    ) -> FloatArray:
        """Expectation step of the t distribution: scale of each cluster, from its standardised leave-one-out residual."""
        assert self.df is not None
        inverse = np.linalg.inv(self._covariance(kernels, effects, scale))
        diagonal = np.diag(inverse)
        effect_variance = self.variances_[len(self.terms) :] @ effects**2
        variance = np.maximum(1.0 / diagonal + effect_variance * (1.0 - scale), 0.1 * effect_variance)
        squared = (inverse @ target / diagonal) ** 2 / variance
        return np.asarray((self.df + squared) / (self.df + 1.0))


def float_columns(X: Table) -> Mapping[str, FloatArray]:
    """Numeric columns by name; a table of floats only is converted at once."""
    if not isinstance(X, pd.DataFrame):
        return X
    values = X.to_numpy()
    if values.dtype != np.float64:
        X = X.select_dtypes(["number", "bool"])
        values = X.to_numpy(np.float64, na_value=np.nan)
    return dict(zip(X.columns.tolist(), values.T, strict=True))


def _squared_exponential(columns: Sequence[FloatArray], points: FloatArray) -> FloatArray:
    """Kernel between rows, given by columns, and points of shape (points, columns)."""
    squares = ((column[:, None] - point) ** 2 for column, point in zip(columns, points.T, strict=True))
    return np.asarray(np.exp(-0.5 * sum(squares)))


def _inducing_points(z: FloatArray, most: int) -> FloatArray:
    """Choose at most `most` of the points, each as far as possible from those chosen before (Gonzalez 1985)."""
    if len(z) <= most:
        return z
    chosen = [int(np.argmin(((z - z.mean(axis=0)) ** 2).sum(axis=1)))]
    distance = ((z - z[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < most:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((z - z[chosen[-1]]) ** 2).sum(axis=1))
    return z[chosen]
