"""Results of a fit: degrees of freedom, covariances, likelihood, explained deviance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.covariates import Index
from tripwatt_gamm.design import Design
from tripwatt_gamm.families import Family, Gaussian
from tripwatt_gamm.fit import Solution


def _square_root(M: FloatArray) -> FloatArray:
    """Return R with R'R = M; R is upper triangular if M is positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(M).T)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(M)
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


def _likelihood(
    family: Family, residual: FloatArray, y: FloatArray, nu: float, sigma: float
) -> tuple[float, float, float]:
    """Return the log-likelihood, the deviance and the deviance of the best constant."""
    n = len(y)
    if isinstance(family, Gaussian):
        deviance = float(residual @ residual)
        loglik = -n / 2 * (math.log(2 * math.pi * deviance / n) + 1)
        return loglik, deviance, float(((y - y.mean()) ** 2).sum())
    deviance = float(family.deviance(residual / sigma, nu).sum())

    def at(constant: float) -> float:
        return float(family.deviance((y - constant) / sigma, nu).sum())

    # the deviance of a constant has local minima in the far tails only: search from the 10 % to the 90 % quantile
    low, high = np.quantile(y, [0.1, 0.9])
    best = minimize_scalar(at, bounds=(float(low), float(high)), method="bounded")
    return family.loglik(residual, nu, sigma), deviance, float(best.fun)


def results(
    design: Design, y: FloatArray, family: Family, solution: Solution, active: Index
) -> dict[str, Any]:
    """Compute all results of a fit that concern its coefficients and the data.

    Parameters
    ----------
    design : Design
    y : ndarray (n,)
    family : Family
    solution : Solution
        Solution for the active coefficients.
    active : ndarray
        Numbers of the active coefficients; the others are 0 with variance 0.

    Returns
    -------
    dict
        Fitted quantities by name; the model has each as an attribute with a trailing underscore.
    """
    p, n = design.p, len(y)
    square = np.ix_(active, active)
    Vp, F, Ve, R = np.zeros((p, p)), np.zeros((p, p)), np.zeros((p, p)), np.zeros((p, p))
    coef = np.zeros(p)
    coef[active] = solution.beta
    hat = solution.covariance @ solution.information
    Vp[square], F[square] = solution.covariance, hat
    covariance = hat @ solution.covariance
    Ve[square] = (covariance + covariance.T) / 2
    R[square] = _square_root(solution.information)
    edf = np.diag(F).copy()
    edf1 = 2 * edf - np.einsum("ij,ji->i", F, F)
    eta = design.rows.predictor(coef)
    residual = y - eta
    loglik, deviance, null = _likelihood(family, residual, y, solution.nu, solution.sigma)
    white = solution.white
    if white is not None:  # the likelihood is that of the independent innovations
        loglik = (
            _likelihood(family, white.values(residual), y, solution.nu, solution.sigma)[0]
            + white.log_jacobian
        )
    if isinstance(family, Gaussian):
        n_shape_parameters, at_bound = 1, False
    else:
        n_shape_parameters = (family.nu is None) + (family.sigma is None)
        at_bound = family.nu is None and solution.nu - family.min_df < 1e-3
    freedom = n - float(edf.sum())
    # adjusted R^2 as 1 - var(residual) / var(y) with unbiased denominators
    r2 = 1 - float(residual.var()) * (n - 1) / (float(y.var()) * max(freedom, 1e-300))
    return {
        "coef": coef,
        "Vp": Vp,
        "Ve": Ve,
        "F": F,
        "edf": edf,
        "edf1": edf1,
        "R": R,
        "scale": solution.scale,
        "nu": solution.nu,
        "sigma": solution.sigma if not isinstance(family, Gaussian) else math.sqrt(solution.scale),
        "nu_at_bound": at_bound,
        "ar1_rho": 0.0 if white is None else white.rho,
        "reml": solution.score,
        "loglik": loglik,
        "aic": -2 * loglik + 2 * (float(edf.sum()) + n_shape_parameters),
        "deviance_explained": 1 - deviance / null,
        "r2": r2,
        "n": n,
        "residual_df": freedom,
        "fitted_values": eta,
        "residuals": residual,
        "converged": solution.converged,
        "n_iter": solution.n_iter,
        "message": solution.message,
    }
