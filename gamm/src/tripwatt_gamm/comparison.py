"""Compare fitted models: tests of the terms by which they differ, and information criteria."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from scipy import stats

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.inference import scaled_penalties, total_penalty

if TYPE_CHECKING:
    from tripwatt_gamm.estimator import Estimator

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
