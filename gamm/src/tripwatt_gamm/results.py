"""Results of a fit: degrees of freedom, covariances, likelihood, explained deviance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from tripwatt_gamm.arrays import FloatArray, Index
from tripwatt_gamm.design import Design
from tripwatt_gamm.families import AT_BOUND, Family, Gamma, Gaussian, Response, ScaledT
from tripwatt_gamm.fit import Solution


def _square_root(M: FloatArray) -> FloatArray:
    """Return R with R'R = M."""
    values, vectors = np.linalg.eigh(M)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


def _null_deviance(family: Family, response: Response, theta: FloatArray) -> float:
    """Deviance of the best constant beside the offset."""
    z = family.start(response.y) - response.offset
    low, high = z.min() - np.ptp(z), z.max() + np.ptp(z)
    if isinstance(family, ScaledT):
        # a constant has local minima in the far tails only: search from the 10 % to the 90 % quantile
        low, high = np.quantile(z, [0.1, 0.9])

    def at(constant: float) -> float:
        return float(family.deviance(response, constant + response.offset, theta).sum())

    return float(minimize_scalar(at, bounds=(float(low), float(high)), method="bounded").fun)


def _loglik(family: Family, response: Response, eta: FloatArray, theta: FloatArray) -> float:
    """Log-likelihood; the variance of normal errors, if estimated, is the mean square."""
    theta = family.first(response, eta) if isinstance(family, Gaussian) else theta
    return float(family.derivatives(response, eta, theta)[0].sum())


def _extremes(design: Design, parameters: FloatArray) -> list[str]:
    """Return a note for each variance component that is zero, or so large beside that of the errors that rounding decides."""
    owners = [fitted for fitted in design.terms for _ in fitted.matrices]
    return [
        f"{fitted.label}: variance {'estimated as zero' if value > 1 else 'too large beside the errors to be exact'}"
        for fitted, value in zip(owners, parameters, strict=True)
        if fitted.kind == "random" and not 5e-12 < value < 1e8
    ]


def _names(design: Design, solution: Solution, active: Index, which: list[int]) -> dict[str, Any]:
    """Terms, names of coefficients, ranges, levels and smoothing parameters; parameters without data are NaN."""
    names, coef_names = design.penalty_names, [name for fitted in design.terms for name in fitted.names]
    q, parameters = len(solution.loadings), np.full(len(names), math.nan)
    covariance = np.full((q + len(names), q + len(names)), math.nan)
    slopes = np.zeros((design.rows.p, len(names)))
    parameters[which], slopes[active[:, None], which] = np.exp(solution.rho), solution.slopes
    if solution.end.hessian.size:
        inverse = np.linalg.pinv(solution.end.hessian, hermitian=True)
        known = np.array([*range(q), *(q + i for i in which)], dtype=np.intp)
        covariance[np.ix_(known, known)] = inverse[: len(known), : len(known)]
    return {
        "formula": design.formula,
        "terms": design.terms,
        "training": design.training,
        "notes": [*design.notes, *_extremes(design, parameters)],
        "coef_names": coef_names,
        "empty_columns": [coef_names[i] for i in np.setdiff1d(np.arange(design.rows.p), active)],
        "ranges": {
            name: (float(support.low[j]), float(support.high[j]))
            for names, support in design.training.supports.items()
            for j, name in enumerate(names)
        },
        "levels": {name: levels.names for name, levels in design.training.levels.items()},
        "smoothing_parameters": dict(zip(names, parameters.tolist(), strict=True)),
        "log_sp_covariance": covariance[q:, q:],
        "joint_covariance": covariance,
        "loadings": solution.loadings,
        "slopes": slopes,
    }


def results(
    design: Design, response: Response, family: Family, solution: Solution, active: Index, which: list[int]
) -> dict[str, Any]:
    """Compute all results of a fit.

    Parameters
    ----------
    design : Design
    response : Response
    family : Family
    solution : Solution
        Solution for the active coefficients.
    active : ndarray
        Numbers of the active coefficients; the others are 0 with variance 0.
    which : list of int
        Positions of their smoothing parameters; the others are NaN.

    Returns
    -------
    dict
        Fitted quantities by name; the model has each as an attribute with a trailing underscore.
    """
    y, weights, theta = response.y, response.weights, solution.theta
    p, n = design.rows.p, len(y)
    square = np.ix_(active, active)
    Vp, F, R = np.zeros((3, p, p))
    coef = np.zeros(p)
    coef[active] = solution.beta
    Vp[square], F[square] = solution.covariance, solution.covariance @ solution.information
    R[square] = _square_root(solution.information)
    edf = np.diag(F).copy()
    root = np.sqrt(weights)
    log_root = float(np.log(root).sum()) if family.scaled_rows else 0.0
    eta = response.offset + design.rows.predictor(coef) / (root if family.scaled_rows else 1.0)
    fitted = family.link.mean(eta)
    residual = y - fitted
    deviances = family.deviance(response, eta, theta)
    signed = np.sign(residual) * np.sqrt(deviances)
    loglik = _loglik(family, response, eta, theta)
    white = solution.white
    if white is not None:  # the likelihood is that of the independent innovations
        innovations = Response.of(white.values(root * residual))
        loglik = _loglik(family, innovations, np.zeros(n), theta) + white.log_jacobian + log_root
    freedom, estimated = n - float(edf.sum()), float(edf.sum()) + int(family.free.sum())
    nu, sigma = family.shape(theta) if isinstance(family, ScaledT) else (math.nan, math.exp(theta[0] / 2))
    scale = reml_scale = 1.0 if isinstance(family, ScaledT) else math.exp(theta[0])
    if isinstance(family, Gamma) and family.estimates_scale:
        scale = family.dispersion(y, fitted, weights, freedom)
    ratio = scale / reml_scale
    # adjusted R^2 as 1 - var(residual) / var(y) with unbiased denominators, each difference times the root of its weight
    spread = root * (y - np.average(y, weights=weights))
    r2 = 1 - float((root * residual).var()) * (n - 1) / (float(spread.var()) * max(freedom, 1e-300))
    return {
        **_names(design, solution, active, which),
        "family": family,
        "response": y,
        "coef": coef,
        "Vp": Vp * ratio,
        "edf": edf,
        "edf1": 2 * edf - np.einsum("ij,ji->i", F, F),
        "R": R / math.sqrt(ratio),
        "scale": scale,
        "reml_scale": reml_scale,
        "nu": nu,
        "sigma": sigma,
        "nu_at_bound": isinstance(family, ScaledT) and family.nu is None and nu - family.min_df < AT_BOUND,
        "ar1_rho": 0.0 if white is None else white.rho,
        "reml": solution.score - log_root,
        "loglik": loglik,
        "aic": -2 * loglik + 2 * estimated,
        "bic": -2 * loglik + math.log(n) * estimated,
        "deviance": float(deviances.sum()),
        "deviance_explained": 1 - float(deviances.sum()) / _null_deviance(family, response, theta),
        "deviance_residuals": signed,
        "r2": r2,
        "n": n,
        "residual_df": freedom,
        "fitted_values": fitted,
        "linear_predictor": eta,
        "residuals": residual,
        "scaled_residuals": root * residual if family.scaled_rows else signed,
        **solution.end._asdict(),
    }
