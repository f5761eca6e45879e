"""Variances of random effects and errors, on the scale of standard deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy import stats

from tripwatt_gamm.arrays import FloatArray, central_differences
from tripwatt_gamm.penalties import correlated_penalties

if TYPE_CHECKING:
    from tripwatt_gamm.estimator import Estimator

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
