"""Variances of random effects and errors, on the scale of standard deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy import stats

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.inference import scaled_penalties, total_penalty

if TYPE_CHECKING:
    from tripwatt_gamm.estimator import Estimator
    from tripwatt_gamm.fitted_terms import FittedTerm


def random_covariance(model: Estimator, fitted: FittedTerm) -> FloatArray:
    """Covariance (q, q) of the q effects that each level of a random effect has.

    Parameters
    ----------
    model : GAMM
        A fitted model.
    fitted : FittedTerm
        One of its random effects.
    """
    first = np.arange(fitted.start, fitted.start + fitted.size, fitted.copies)
    return np.asarray(np.linalg.inv(total_penalty(model)[np.ix_(first, first)]) * model.reml_scale_)


def _log_sd_errors(model: Estimator) -> FloatArray:
    """Standard errors of log standard deviations: one for each smoothing parameter, then that of the residuals.

    With the scale profiled out of the REML score, log(scale) has the conditional variance 2 / f about a value whose
    slope in log(lambda_j) is lambda_j b'S_j b / (f scale). Here f is the number of rows minus the number of unpenalised
    coefficients. All are NaN if the smoothing parameters were given.
    """
    covariance = model.log_sp_covariance_
    size = len(covariance)
    slopes, spread = np.zeros(size), 0.0
    if model.family_.estimates_scale:
        free = sum(fitted.null_dim for fitted in model.terms_) - len(model.empty_columns_)
        quadratic = [model.coef_[at] @ S @ model.coef_[at] for at, S in scaled_penalties(model)]
        slopes = np.array(quadratic) / ((model.n_ - free) * model.reml_scale_)
        spread = 2 / (model.n_ - free)
    if np.isnan(covariance).all():
        return np.full(size + 1, np.nan)
    directions = np.vstack([slopes - np.eye(size), slopes])
    variances = np.einsum("ij,jk,ik->i", directions, np.nan_to_num(covariance), directions) + spread
    return np.asarray(np.sqrt(np.where(variances < 0, np.nan, variances)) / 2)


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
        normal on the log scale, from the Hessian of the REML score), ``correlation`` (with the intercept of the level).
        Intervals are NaN for correlated effects, for Student's t errors and if smoothing parameters were given.

    Examples
    --------
    >>> import pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> frame = pd.DataFrame({"g": list("aabbcc"), "y": [1.0, 1.2, 3.0, 3.1, 2.2, 2.0]})
    >>> variance_components(GAMM('y ~ s(g, bs="re")').fit(frame))[["term", "std_dev"]].round(2).to_numpy().tolist()
    [['s(g)', 0.97], ['Residual', 0.12]]
    """
    half = stats.norm.ppf((1 + level) / 2) * _log_sd_errors(model)
    rows, penalty = [], 0
    for fitted in model.terms_:
        covariance = random_covariance(model, fitted) if fitted.kind == "random" else np.zeros((0, 0))
        sds = np.sqrt(np.diag(covariance))
        for j, effect in enumerate(fitted.effects):
            half_width = float(half[penalty]) if len(sds) == 1 else np.nan
            correlation = covariance[j, 0] / (sds[j] * sds[0]) if j else np.nan
            rows.append((fitted.label, ":".join(fitted.groups), effect, sds[j], half_width, correlation))
        penalty += len(fitted.matrices)
    if model.family_.scaled_rows:
        normal = np.isnan(model.nu_)
        sd = model.sigma_ if normal else model.sigma_ * np.sqrt(model.nu_ / (model.nu_ - 2))
        rows.append(("Residual", "", "", sd, float(half[-1]) if normal else np.nan, np.nan))
    table = pd.DataFrame(rows, columns=["term", "group", "effect", "std_dev", "half", "correlation"])
    with np.errstate(over="ignore"):
        factor = np.exp(table["half"])
    table = table.assign(
        variance=table["std_dev"] ** 2, lower=table["std_dev"] / factor, upper=table["std_dev"] * factor
    )
    return table[["term", "group", "effect", "std_dev", "variance", "lower", "upper", "correlation"]]
