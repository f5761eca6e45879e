"""Tests of the terms of a fitted model, and the variances of its random effects and errors.

Smooth terms after Wood (2013a, "On p-values for smooth components of an extended generalized additive model",
Biometrika 100:221), random effects after Wood (2013b, "A simple test for random effects in regression models",
Biometrika 100:1005), parametric coefficients by t or z. The tests work on arrays and do not depend on models; the
tables below them apply them to the parts of a model. Components of variance are on the scale of standard deviations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from scipy import stats

from tripwatt_gamm.arrays import FloatArray, Index, central_differences
from tripwatt_gamm.chisq import weighted_chi2_sf
from tripwatt_gamm.penalties import correlated_penalties

if TYPE_CHECKING:
    from tripwatt_gamm.estimator import Estimator

Matrices: TypeAlias = tuple[FloatArray, FloatArray]

WHOLE_DF: Final = 1e-6
"""Distance from a whole number up to which a reference df counts as whole: a choice, because EDFs are no more accurate."""
MIN_EIGENVALUE: Final = 1e-8
"""Relative size below which an eigenvalue is rounding: about the square root of the working precision."""
MIN_REMAINDER: Final = 1e-7
"""Share of a column up to which what remains after projection on other terms is rounding: some ten times as much."""


class TermTest(NamedTuple):
    """Outcome of the test that a term is zero.

    Attributes
    ----------
    ref_df : float
        Reference degrees of freedom: the rank that the statistic uses.
    statistic : float
        Chi-square if the scale is known; divided by `ref_df` (an F) if it is estimated.
    p_value : float
        Probability of a larger statistic if the term is zero.
    """

    ref_df: float
    statistic: float
    p_value: float


def _tail(total: float, weights: FloatArray, residual_df: float | None) -> float:
    """Pr(sum w chi2_1 > total); if the scale is estimated on `residual_df`, the sum is divided by chi2/df first."""
    if residual_df is None:
        return weighted_chi2_sf(total, weights)
    df = np.append(np.ones_like(weights), residual_df)
    return weighted_chi2_sf(0.0, np.append(weights, -total / residual_df), df)


def smooth_test(
    coef: FloatArray,
    vp: FloatArray,
    factor: FloatArray,
    ref_df: float,
    residual_df: float | None = None,
) -> TermTest:
    """Test whether a smooth term is zero: T_r = f' V^{r-} f (Wood 2013a, section 3).

    Parameters
    ----------
    coef : ndarray, shape (k,)
        Coefficients of the term.
    vp : ndarray, shape (k, k)
        Bayesian covariance of these coefficients.
    factor : ndarray, shape (m, k)
        Any matrix A with A'A = X_j'WX_j, where X_j are the columns of the term.
    ref_df : float
        Rank r of the test, tr(2F - FF) over the term.
    residual_df : float, optional
        Degrees of freedom of an estimated scale; None if the scale is known.

    Returns
    -------
    TermTest

    Notes
    -----
    The pseudo-inverse of rank r between k and k + 1 mixes the k-th and (k+1)-th eigen-direction by a 2 x 2 block with
    off-diagonal rho = sqrt(nu (1 - nu) / 2), nu = r - k. The paper leaves open the sign of rho, which depends on the
    arbitrary signs of the eigenvectors. For the reported statistic every eigenvector is given the sign that makes its
    first component positive. The p-value must not depend on such a choice; it is the mean over both signs.

    Examples
    --------
    >>> coef, vp = np.array([3.0, 0.0]), np.eye(2)
    >>> test = smooth_test(coef, vp, np.eye(2), 2.0)
    >>> round(test.statistic, 6), round(test.p_value, 6)
    (9.0, 0.011109)
    """
    root = np.linalg.qr(factor)[1]
    values, vectors = np.linalg.eigh(root @ vp @ root.T)
    values, vectors = values[::-1], vectors[:, ::-1]
    rank = int((values > MIN_EIGENVALUE * max(values[0], 0.0)).sum())
    if rank == 0:
        return TermTest(float(ref_df), 0.0, 1.0)  # a term without data explains nothing
    signs = np.where(vectors[0] < 0, -1.0, 1.0)
    z = (vectors * signs).T[:rank] @ (root @ coef) / np.sqrt(values[:rank])
    r = float(min(max(ref_df, 1.0), rank))
    n_whole = int(np.floor(r + WHOLE_DF))
    fraction = r - n_whole
    if fraction <= WHOLE_DF:
        totals = [float(z[:n_whole] @ z[:n_whole])]
        weights = np.ones(n_whole)
    else:
        rho = np.sqrt(fraction * (1 - fraction) / 2)
        base = float(z[:n_whole] @ z[:n_whole] + fraction * z[n_whole] ** 2)
        cross = float(2 * rho * z[n_whole - 1] * z[n_whole])
        totals = [base + cross, max(base - cross, 0.0)]
        gap = np.sqrt(1 - fraction**2)
        weights = np.append(np.ones(n_whole - 1), [(fraction + 1 + gap) / 2, (fraction + 1 - gap) / 2])
    p_value = float(np.mean([_tail(total, weights, residual_df) for total in totals]))
    return TermTest(float(ref_df), totals[0] if residual_df is None else totals[0] / r, p_value)


def _random_effect_test(
    coef: FloatArray, system: Matrices, index: Index, random: Index, residual_df: float | None = None
) -> TermTest:
    """Test that a random effect has no variance (Wood 2013b).

    Parameters
    ----------
    coef : ndarray, shape (p,)
        All coefficients.
    system : tuple of ndarray, shape (p, p)
        X'WX of the whole model and its penalty, smoothing parameters included, both over the scale.
    index : ndarray
        Coefficients of the random effect under test.
    random : ndarray
        Those of all other random effects, which stay random under the null hypothesis.
    residual_df : float, optional
        Degrees of freedom of an estimated scale; None when the scale is known.

    Returns
    -------
    TermTest
        `ref_df` is the rank of the effect after projection on the other terms.

    Notes
    -----
    With the smooths profiled out, the log likelihood ratio of the predicted effects b against b = 0 is T = b'(M + S_b)
    b. Here Z are the columns of the effect, S_b its penalty, and M the part of Z'WZ that the other terms do
    not explain. If the variance is zero, the covariance of b is the frequentist one, P X'WX P with P = (X'WX + S)^-1,
    plus a part from the other random effects (columns Z_o, variance Psi). T is then a weighted sum of chi-square
    variables whose weights are eigenvalues; no refit is needed. Other random effects enter M through the marginal
    covariance I + Z_o Psi Z_o' of the working data. Their variances under the null model are those of the fit.

    Examples
    --------
    >>> b = np.array([2.0, -2.0])
    >>> test = _random_effect_test(b, (np.eye(2), np.eye(2)), np.arange(2), np.arange(0))
    >>> test.ref_df, test.statistic
    (2.0, 16.0)
    """
    gram, penalty = system
    fixed = np.setdiff1d(np.arange(len(gram)), np.concatenate([index, random]))
    rows = _solve(gram + penalty, np.eye(len(gram))[:, index]).T
    crossed, precision = rows @ gram, penalty[np.ix_(random, random)]  # the inverse of Psi of the notes
    covariance = crossed @ rows.T + crossed[:, random] @ _solve(precision, crossed[:, random].T)
    weighted = gram + gram[:, random] @ _solve(precision, gram[random])  # X'W(I + Z_o Psi Z_o')WX
    b = coef[index]
    cross = weighted[np.ix_(fixed, index)]
    unexplained = cross.T @ _solve((weighted + penalty)[np.ix_(fixed, fixed)], cross)
    explained = weighted[np.ix_(index, index)] - unexplained  # M of the notes
    penalised = explained + penalty[np.ix_(index, index)]
    total = float(b @ penalised @ b)
    values, vectors = np.linalg.eigh(penalised)
    half = vectors * np.sqrt(np.clip(values, 0.0, None))
    size = np.diag(gram)[index]  # what remains is compared with the columns before the projection
    d = np.where(size > 0, size, 1.0) ** 0.5
    rank = int((np.linalg.eigvalsh(explained / np.outer(d, d)) > MIN_REMAINDER).sum())
    if rank == 0:
        return TermTest(0.0, 0.0, 1.0)
    weights = np.clip(np.linalg.eigvalsh(half.T @ covariance @ half)[::-1][:rank], 0.0, None)
    p = _tail(total, weights, residual_df)
    return TermTest(float(weights.size), total if residual_df is None else total / weights.size, p)


def _solve(a: FloatArray, b: FloatArray) -> FloatArray:
    """Solve a symmetric non-negative definite system, scaled to unit diagonal, without directions that are rounding."""
    d = np.sqrt(np.where(np.diag(a) > 0, np.diag(a), 1.0))[:, None]
    values, vectors = np.linalg.eigh(a / d / d.T)
    # the matrix has no negative eigenvalue: those are rounding as well
    kept = values > 1e-14 * values.max(initial=0.0)
    return np.asarray((vectors[:, kept] / values[kept]) @ (vectors[:, kept].T @ (b / d)) / d)


def total_penalty(model: Estimator) -> FloatArray:
    """Compute the penalty matrix of a fitted model, smoothing parameters included.

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    ndarray, shape (p, p)

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> model = GAMM("y ~ s(x, k=8)").fit(frame)
    >>> total_penalty(model).shape
    (8, 8)
    """
    penalty = np.zeros((model.coef_.size, model.coef_.size))
    for where, matrix in scaled_penalties(model):
        penalty[where, where] += matrix
    return penalty


def scaled_penalties(model: Estimator) -> list[tuple[slice, FloatArray]]:
    """List the penalties of a fitted model: the coefficients of each, and its matrix times its smoothing parameter."""
    # the smoothing parameter of a term without data is NaN; the term has no penalty
    parameters = iter(np.nan_to_num(list(model.smoothing_parameters_.values())))
    return [(fitted.slice, next(parameters) * S) for fitted in model.terms_ for S in fitted.penalties]


def _estimated_scale_df(model: Estimator) -> float | None:
    """Residual degrees of freedom if the scale is estimated; returns None if it is known."""
    return float(model.residual_df_) if model.family_.estimates_scale else None


def coefficient_table(model: Estimator) -> pd.DataFrame:
    """Tabulate the tests of the parametric coefficients.

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    pandas.DataFrame
        One row per coefficient, named in the index: ``estimate``, ``std_error`` (Bayesian, as is usual), ``statistic``
        (t if the scale is estimated, z if it is known) and ``p_value``. A level without data has estimate 0, standard
        error 0 and no test (NaN).

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> model = GAMM("y ~ s(x, k=8)").fit(frame)
    >>> coefficient_table(model).round(2).loc["(Intercept)", "estimate"]
    np.float64(0.01)
    """
    inside = [np.arange(model.coef_.size)[b.slice] for b in model.terms_ if b.kind == "parametric"]
    index = np.concatenate([np.arange(0), *inside]).astype(int)
    error = np.sqrt(np.clip(np.diag(model.Vp_)[index], 0.0, None))
    known = error > 0
    estimate = np.where(known, model.coef_[index], 0.0)
    statistic = np.where(known, estimate / np.where(known, error, 1.0), np.nan)
    df = _estimated_scale_df(model)
    tail = stats.norm.sf(np.abs(statistic)) if df is None else stats.t.sf(np.abs(statistic), df)
    columns = {"estimate": estimate, "std_error": error, "statistic": statistic, "p_value": 2 * tail}
    return pd.DataFrame(columns, index=pd.Index([model.coef_names_[i] for i in index], name="term"))


def term_table(model: Estimator) -> pd.DataFrame:
    """Tabulate the tests of the smooth terms and random effects.

    Parameters
    ----------
    model : GAMM
        A fitted model.

    Returns
    -------
    pandas.DataFrame
        One row per term, named in the index: ``edf``, ``ref_df``, ``statistic`` (F if the scale is estimated,
        chi-square if it is known), ``p_value``. A term whose coefficients are all penalised, such as a random effect,
        is tested as a variance (Wood 2013b); every other term is tested as a function (Wood 2013a).

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> model = GAMM("y ~ s(x, k=8)").fit(frame)
    >>> term_table(model).index.tolist(), bool(term_table(model)["p_value"].iloc[0] < 1e-20)
    (['s(x)'], True)
    """
    df = _estimated_scale_df(model)
    smooth = [fitted for fitted in model.terms_ if fitted.kind != "parametric"]
    random = [fitted for fitted in smooth if fitted.kind == "random"]
    columns, coef = np.arange(model.coef_.size), model.coef_
    system = model.R_.T @ model.R_, total_penalty(model) / float(model.scale_)
    rows = []
    for fitted in smooth:
        at = fitted.slice
        if fitted.null_dim == 0:
            others = [columns[other.slice] for other in random if other is not fitted]
            test = _random_effect_test(coef, system, columns[at], np.concatenate([columns[:0], *others]), df)
        else:
            test = smooth_test(coef[at], model.Vp_[at, at], model.R_[:, at], float(model.edf1_[at].sum()), df)
        rows.append((float(model.edf_[at].sum()), *test))
    index = pd.Index([fitted.label for fitted in smooth], name="term")
    return pd.DataFrame(rows, columns=["edf", "ref_df", "statistic", "p_value"], index=index, dtype=float)


STEP = 1e-5
"""Step for derivatives of the components in the parameters of the score; about the cube root of the working precision."""


def _relative(model: Estimator, x: FloatArray) -> FloatArray:
    """Return the components (2, m) at parameters `x` and a scale of 1, and below them the penalty b'Sb of all coefficients.

    The components are the logs of standard deviations and the inverse hyperbolic tangents of correlations, the errors last;
    the parameters are the loadings of correlated effects, then the logs of all smoothing parameters.
    """
    loadings, logs = np.split(x, [len(model.loadings_)])
    columns, penalty = [], 0.0
    for fitted in model.terms_:
        matrices, sizes = fitted.matrices, fitted.scales
        own, logs = np.split(logs, [len(matrices)])
        if sizes is not None:
            matrices, loadings = correlated_penalties(loadings, sizes)
        b = model.coef_[fitted.slice].reshape(-1, fitted.copies)
        precision = np.einsum("j,jkl->kl", np.exp(own), np.reshape(matrices, (-1, len(b), len(b))))
        penalty += float((b * (precision @ b)).sum())
        if fitted.kind == "random":
            covariance = np.linalg.inv(precision)
            sds = np.sqrt(np.diag(covariance))
            correlations = np.append(np.nan, covariance[1:, 0] / sds[1:] / sds[0])
            columns += list(zip(np.log(sds), np.arctanh(correlations), strict=True))
    return np.vstack([np.transpose([*columns, (0.0, np.nan)]), np.full(len(columns) + 1, penalty)])


def _components(model: Estimator) -> tuple[FloatArray, FloatArray]:
    """Return the components (2, m) of a model and their standard errors, by the delta method.

    With the scale profiled out of the REML score, log(scale) has the conditional variance 2 / f about a value whose slope in
    a parameter is that of b'Sb, over f scale. Here f is the number of rows minus the number of unpenalised coefficients.
    All errors are NaN if the smoothing parameters were given.
    """
    logs = np.nan_to_num(np.log(list(model.smoothing_parameters_.values())))
    x, covariance, freedom = np.append(model.loadings_, logs), model.joint_covariance_, np.inf
    if model.family_.estimates_scale:
        freedom = model.n_ + len(model.empty_columns_) - sum(fitted.null_dim for fitted in model.terms_)
    with np.errstate(divide="ignore", invalid="ignore"):  # a correlation of 1 has no error
        centre = _relative(model, x)
        slopes = central_differences(lambda at: _relative(model, at), x, STEP).reshape(len(x), *centre.shape)
    slopes[:, 0] += slopes[:, 2] / (2 * freedom * model.reml_scale_)
    variances = np.einsum("iak,ij,jak->ak", slopes[:, :2], np.nan_to_num(covariance), slopes[:, :2])
    variances[0] += 1 / (2 * freedom)
    centre[0] += np.log(model.reml_scale_) / 2
    given = len(x) > 0 and np.isnan(covariance).all()
    return centre[:2], np.sqrt(np.where(given | (variances < 0), np.nan, variances))


def variance_components(model: Estimator, level: float = 0.95) -> pd.DataFrame:
    """Tabulate the standard deviations of all random effects and of the errors.

    Parameters
    ----------
    model : GAMM
        A fitted model.
    level : float
        Coverage of the intervals, between 0 and 1.

    Returns
    -------
    pandas.DataFrame
        One row for each effect and one for additive errors: ``term``, ``group`` (columns of the levels), ``effect``
        ("(Intercept)" or the multiplier), ``std_dev``, ``variance``, ``lower``, ``upper`` (of the standard deviation:
        normal on the log scale, from the Hessian of the REML score), ``correlation`` (with the intercept of the level),
        ``correlation_lower``, ``correlation_upper`` (normal on the scale of Fisher's z). Intervals are NaN for the errors
        of Student's t and if smoothing parameters were given.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> frame = pd.DataFrame({"g": list("aabbcc"), "y": [1.0, 1.2, 3.0, 3.1, 2.2, 2.0]})
    >>> variance_components(GAMM('y ~ s(g, bs="re")').fit(frame))[["term", "std_dev"]].round(2).to_numpy().tolist()
    [['s(g)', 0.97], ['Residual', 0.12]]
    """
    centre, error = _components(model)
    if not np.isnan(model.nu_):
        centre[0, -1] = np.log(model.sigma_ * np.sqrt(model.nu_ / (model.nu_ - 2)))
        error[0, -1] = np.nan
    half = stats.norm.ppf((1 + level) / 2) * error
    names = [(f.label, ":".join(f.groups), effect) for f in model.terms_ for effect in f.effects]
    table = pd.DataFrame([*names, ("Residual", "", "")], columns=["term", "group", "effect"])
    ends = np.array([centre, centre - half, centre + half])
    with np.errstate(over="ignore"):
        sd, lower, upper = np.exp(ends[:, 0])
    table = table.assign(std_dev=sd, variance=sd**2, lower=lower, upper=upper)
    table[["correlation", "correlation_lower", "correlation_upper"]] = np.tanh(ends[:, 1]).T
    return table if model.family_.scaled_rows else table[:-1]
