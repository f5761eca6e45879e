"""Check a model: no term can be built from the others, bases are large enough, rows are independent, and no other model is better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import stats
from scipy.spatial import cKDTree

from tripwatt_gamm.arrays import FloatArray, Index
from tripwatt_gamm.errors import Fault, InvalidInput, raise_faults
from tripwatt_gamm.inference import scaled_penalties, total_penalty
from tripwatt_gamm.terms import Smooth, Tensor

if TYPE_CHECKING:
    from tripwatt_gamm.estimator import Estimator


def basis_check(model: Estimator, frame: pd.DataFrame, draws: int = 400, seed: int = 0) -> pd.DataFrame:
    """Check whether the basis of each smooth is large enough for what the residuals still show (Wood 2017, section 5.9).

    If a smooth leaves structure along its covariates, residuals of neighbouring rows differ less than others. The
    k-index is half the mean square of their differences, over the mean square of the residuals; the p-value is the
    share of random orders of the residuals that have a smaller one. Neighbours are the next rows along one covariate,
    or the three nearest in several; those of a tensor product in shares of the ranges, which mgcv scales otherwise.

    Parameters
    ----------
    model : GAMM
        A fitted model.
    frame : pandas.DataFrame
        The rows of the fit.
    draws, seed : int
        Number of random orders, and their seed.

    Returns
    -------
    pandas.DataFrame
        One row per smooth: ``k`` (coefficients), ``edf``, ``k_index``, ``p_value``. If ``edf`` is near ``k`` and the
        k-index below 1 with a small p-value, try a larger ``k``.

    Raises
    ------
    InvalidInput
        If the frame has another number of rows than the fit.

    Examples
    --------
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 200)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(30 * x) + 0.2 * np.cos(900 * x)})
    >>> basis_check(GAMM("y ~ s(x, k=5)").fit(frame), frame).round(2).loc["s(x)", ["k", "p_value"]].tolist()
    [4.0, 0.0]
    """
    residual, rng = model.deviance_residuals_, np.random.default_rng(seed)
    if len(frame) != len(residual):
        allowed = f"the {len(residual)} rows of the fit"
        raise InvalidInput.of("wrong length", "basis_check(frame)", f"{len(frame)} rows", allowed)
    orders = np.array([residual, *(rng.permutation(residual) for _ in range(draws))])
    rows = {}
    for fitted in model.terms_:
        if not isinstance(fitted.term, Smooth | Tensor):
            continue
        x = frame[list(fitted.term.names)].to_numpy(dtype=np.float64)
        x = x / np.ptp(x, axis=0) if isinstance(fitted.term, Tensor) else x
        here, near = np.arange(len(x)), cKDTree(x).query(x, 4)[1][:, 1:]
        if x.shape[1] == 1:
            order = np.argsort(x[:, 0], kind="stable")
            here, near = order[1:], order[:-1, None]
        spread = np.array([np.mean((r[here, None] - r[near]) ** 2) / 2 for r in orders])
        edf, index = model.edf_[fitted.slice].sum(), spread[0] / np.mean(residual**2)
        rows[fitted.label] = (fitted.size, edf, index, np.mean(spread[1:] < spread[0]))
    columns = ["k", "edf", "k_index", "p_value"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("term")


def concurvity(model: Estimator) -> pd.DataFrame:
    """Measure how far each term can be built from all the others: 0 is not at all, 1 entirely.

    A term's function f is split into the part g in the space of the other terms, and the rest. All three
    measures are ||g||^2 / ||f||^2 on the rows of the data (after Ramsay, Burnett & Krewski 2003, Epidemiology
    14:18, for functions; Wood 2017, section 5.6, for these three).

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    pandas.DataFrame
        Indexed by term ("parametric" holds all parametric ones): ``worst``, over all functions that the term
        could be; ``observed``, for the function that was fitted; ``estimate``, for its basis as a whole.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> model = GAMM("y ~ s(x, k=8)").fit(frame)
    >>> concurvity(model).round(3).loc["s(x)"].tolist()
    [0.0, 0.0, 0.0]
    """
    owners = np.full(model.coef_.size, "parametric", dtype=object)
    for fitted in model.terms_:
        owners[fitted.slice] = "parametric" if fitted.kind == "parametric" else fitted.label
    inside = {label: np.flatnonzero(owners == label) for label in dict.fromkeys(owners)}
    rows = {label: column_concurvity(model.R_, model.coef_, at) for label, at in inside.items()}
    columns = ["worst", "observed", "estimate"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("term")


def column_concurvity(factor: FloatArray, coef: FloatArray, inside: Index) -> tuple[float, float, float]:
    """Return worst, observed and estimated concurvity of some columns of a model matrix X with the others.

    Parameters
    ----------
    factor : ndarray (m, p)
        Any matrix A with A'A = X'X.
    coef : ndarray (p,)
    inside : ndarray of int
        The columns.

    Examples
    --------
    >>> column_concurvity(np.eye(2), np.ones(2), np.array([0]))
    (0.0, 0.0, 0.0)
    """
    nonzero = np.flatnonzero((factor**2).sum(axis=0) > 0)
    inside = np.intersect1d(inside, nonzero)
    outside = np.setdiff1d(nonzero, inside)
    if inside.size == 0 or outside.size == 0:
        return (0.0, 0.0, 0.0)
    other_space, own_space = _orthonormal(factor[:, outside]), _orthonormal(factor[:, inside])
    worst = float(np.linalg.svd(other_space.T @ own_space, compute_uv=False)[0] ** 2)
    projected = other_space.T @ factor[:, inside]
    fit, projected_fit = factor[:, inside] @ coef[inside], projected @ coef[inside]
    observed = float(projected_fit @ projected_fit / (fit @ fit)) if fit @ fit > 0 else 0.0
    estimate = float((projected**2).sum() / (factor[:, inside] ** 2).sum())
    return min(worst, 1.0), min(observed, 1.0), min(estimate, 1.0)


def _orthonormal(a: FloatArray) -> FloatArray:
    """Orthonormal basis of the column space; linearly dependent columns add nothing."""
    u, size, _ = np.linalg.svd(a / np.linalg.norm(a, axis=0), full_matrices=False)
    return np.asarray(u[:, size > 1e-8 * size[0]], dtype=float)


@dataclass(frozen=True, slots=True)
class Autocorrelation:
    """Correlation of residuals with later ones of the same group.

    Attributes
    ----------
    lag : ndarray (m,)
        In rows, from 1.
    correlation : ndarray (m,)
        Pooled over the groups, between -1 and 1; 0 if the earlier or the later residuals of all pairs are 0.
    pairs : ndarray (m,)
        Pairs of rows behind each value.

    Examples
    --------
    >>> result = autocorrelation([1.0, -1.0, 1.0, -1.0], ["a", "a", "b", "b"], max_lag=1)
    >>> result.correlation.round(3).tolist(), result.bound.round(3).tolist(), result.warning
    ([-1.0], [1.414], '')
    """

    lag: Index
    correlation: FloatArray
    pairs: Index

    @property
    def bound(self) -> FloatArray:
        """Twice the standard error of each correlation if the rows were independent."""
        return np.asarray(2 / np.sqrt(np.maximum(self.pairs, 1)), dtype=float)

    @property
    def warning(self) -> str:
        """Warning for the summary of a model; empty if the rows may pass for independent."""
        first = float(self.correlation[0])
        if first <= max(0.1, float(self.bound[0])):
            return ""
        return (
            f"Neighbouring residuals within a group correlate with {first:.4f}. The model takes the rows for "
            "independent: its EDFs are too large, its standard errors and p-values too small. Rely on a validation "
            "that leaves out whole groups."
        )


def autocorrelation(
    residuals: ArrayLike, groups: ArrayLike | Sequence[object], max_lag: int = 30
) -> Autocorrelation:
    """Compute the autocorrelation of residuals within groups, rows in the order of the data.

    At each lag, the sum of the products of all pairs of one group is divided by the root of the two sums of squares of
    the earlier and of the later members of those same pairs (residuals less their overall mean). By the inequality of
    Cauchy and Schwarz the value lies between -1 and 1. The empirical autocorrelation of mixed models (Pinheiro & Bates
    2000, Mixed-Effects Models in S and S-PLUS, section 5.3) divides the mean product of the pairs at a lag by the
    variance of all residuals instead. That variance includes rows without a partner at this lag, so the ratio may
    exceed 1 in absolute value, as no correlation can, if only a few long groups have pairs at the lag. For stationary
    residuals both estimate the same quantity.

    Parameters
    ----------
    residuals : array_like, shape (n,)
        Residuals, those of one group in their order of time.
    groups : array_like, shape (n,)
        Group of each row.
    max_lag : int
        Largest lag, in rows; cut to the longest group.

    Returns
    -------
    Autocorrelation
        At lags from 1 to the largest.

    Raises
    ------
    InvalidInput
        If lengths differ, a residual is not finite or there is no pair within a group.

    Examples
    --------
    >>> result = autocorrelation([1.0, -1.0, 1.0, -1.0], ["a", "a", "b", "b"], max_lag=1)
    >>> result.correlation.round(9).tolist(), result.pairs.tolist()
    ([-1.0], [2])
    """
    r = np.asarray(residuals, dtype=float)
    code = pd.factorize(np.asarray(groups))[0]
    faults = []
    if r.shape != code.shape:
        faults.append(Fault("lengths differ", "residuals and groups", f"{r.size} and {code.size}", "equal"))
    if not np.isfinite(r).all():
        faults.append(Fault("not finite", "residuals", f"{(~np.isfinite(r)).sum()} values", "finite numbers"))
    raise_faults(faults)
    order = np.argsort(code, kind="stable")
    r, code = r[order] - r.mean(), code[order]
    # scaled, so that neither large nor small residuals overflow
    r = r / max(np.abs(r).max(initial=0.0), np.finfo(float).tiny)
    longest = int(np.bincount(code).max(initial=0)) if r.size else 0
    lags = np.arange(1, min(max_lag, longest - 1) + 1)
    if lags.size == 0:
        raise InvalidInput.of("no pair of rows", "groups", f"longest has {longest} rows", "two rows or more")
    correlation, pairs = np.zeros(lags.size), np.zeros(lags.size, dtype=np.intp)
    for i, lag in enumerate(lags):
        same = code[lag:] == code[:-lag]
        pairs[i], earlier, later = same.sum(), r[:-lag][same], r[lag:][same]
        size = np.linalg.norm(earlier) * np.linalg.norm(later)
        correlation[i] = np.clip(earlier @ later / size, -1.0, 1.0) if size > 0 else 0.0
    return Autocorrelation(lags, correlation, pairs)


PRIOR_PRECISION: Final = 0.1
"""Precision of a normal prior of log smoothing parameters in the second-order term; that of mgcv, found from its fits."""


def corrected_covariance(model: Estimator) -> FloatArray:
    """Compute the covariance of the coefficients with that of their smoothing parameters (Wood, Pya & Säfken 2016).

    With the inverse Cholesky factor R, R'R = V, of the penalised information, its first two terms beyond V are
    J C J' and the sum of C_kl dR/drho_k' dR/drho_l over the log smoothing parameters rho, where J is the derivative of
    the coefficients in rho, by the observed information, and C the covariance of rho (section 4).

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    ndarray, shape (p, p)
        `Vp_` if the smoothing parameters were given.

    Examples
    --------
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> model = GAMM("y ~ s(x, k=8)").fit(pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)}))
    >>> bool(np.trace(corrected_covariance(model)) > np.trace(model.Vp_))
    True
    """
    p, ratio = len(model.coef_), model.scale_ / model.reml_scale_
    penalised = model.R_.T @ model.R_ * ratio + total_penalty(model) / model.reml_scale_
    kept = np.flatnonzero(np.diag(penalised) > 0)
    inverse = np.zeros((p, p))
    inverse[np.ix_(kept, kept)] = np.linalg.inv(np.linalg.cholesky(penalised[np.ix_(kept, kept)]))
    C = np.nan_to_num(model.log_sp_covariance_)  # of a term without data, whose penalty is 0
    bounded = np.linalg.solve(np.eye(len(C)) + PRIOR_PRECISION * C, C)
    roots = np.zeros((len(C), p, p))
    for root, (where, S) in zip(roots, scaled_penalties(model), strict=True):
        change = np.tril(inverse[:, where] @ S @ inverse[:, where].T) / model.reml_scale_
        change[np.diag_indices(p)] /= 2
        root[:] = -change @ inverse
    second = np.einsum("kl,kij,lim->jm", bounded, roots, roots, optimize=True)
    return np.asarray(model.Vp_ + model.slopes_ @ C @ model.slopes_.T + ratio * second)


def anova(*models: Estimator) -> pd.DataFrame:
    """Compare models by their deviances, as mgcv's ``anova`` does, and by their information criteria.

    Parameters
    ----------
    *models : GAMM
        Two or more fitted models of one family and the same rows, each nested in the next one.

    Returns
    -------
    pandas.DataFrame
        One row per model: ``residual_df`` (rows minus the EDF of the tests, with the uncertainty of the smoothing
        parameters), ``deviance``, ``aic``, ``bic``; from the second on ``df`` and ``difference`` to the model before
        (of deviances, or of twice the log-likelihoods for Student's t), ``statistic`` (F if the scale is estimated,
        chi-square if it is known) and ``p_value``. The p-value is approximate; that of a variance is too large.

    Raises
    ------
    InvalidInput
        If there are fewer than two models, or their families or responses differ.

    Examples
    --------
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> table = anova(GAMM("y ~ x").fit(frame), GAMM("y ~ s(x, k=8)").fit(frame))
    >>> table["residual_df"].round(1).tolist(), bool(table["p_value"].iloc[1] < 1e-20)
    ([58.0, 52.1], True)
    """
    kinds = {model.family_.name for model in models}
    equal = all(np.array_equal(model.response_, models[0].response_) for model in models)
    if len(models) < 2 or len(kinds) > 1 or not equal:
        got = f"{len(models)} of {', '.join(sorted(kinds))}"
        allowed = "two or more of one family and the same rows"
        raise InvalidInput.of("models that cannot be compared", "anova", got, allowed)
    rows = []
    for model in models:
        corrected = float((corrected_covariance(model) * (model.R_.T @ model.R_)).sum())
        tested, edf = float(model.edf1_.sum()), float(model.edf_.sum())
        freedom = model.n_ - tested - min(corrected, tested) + edf
        rows.append((freedom, model.deviance_, model.aic_, model.bic_, 2 * model.loglik_))
    index = pd.Index([str(model.formula) for model in models], name="model")
    table = pd.DataFrame(rows, index, ["residual_df", "deviance", "aic", "bic", "likelihood"])
    likelihood = table.pop("likelihood").diff()
    gain = likelihood if kinds == {"scat"} else -table["deviance"].diff()
    table = table.assign(df=-table["residual_df"].diff(), difference=gain)
    largest = min(models, key=lambda model: float(model.residual_df_))
    if not largest.family_.estimates_scale:
        return table.assign(statistic=gain, p_value=stats.chi2.sf(gain, table["df"]))
    statistic = gain / table["df"] / largest.scale_
    tail = stats.f.sf(statistic, table["df"], table["residual_df"].min())
    return table.assign(statistic=statistic, p_value=tail)
