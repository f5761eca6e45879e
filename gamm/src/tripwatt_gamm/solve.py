"""Solve a model from its sums over rows: choice of method, starts and fallbacks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from tripwatt_gamm.arrays import FloatArray, Index, central_differences
from tripwatt_gamm.errors import InvalidInput
from tripwatt_gamm.families import ExponentialFamily, Family, Gaussian, Response, ScaledT
from tripwatt_gamm.fit import Solution, fit_gaussian
from tripwatt_gamm.laplace import LaplaceModel, fit_laplace
from tripwatt_gamm.moments import NormalEquations
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.performance import PerformanceIteration
from tripwatt_gamm.tables import TableRows, Whitening

Method = Literal["fREML", "REML"]
THIN_ROWS = 10_000
"""A scaled t with at least twice this many rows is started from a fit to about this many of them: a choice, enough rows that
the start is close."""

AR1_BOUNDS = (-0.95, 0.9999)
"""Range in which an autocorrelation is searched: dense logs have values near 1, none has values near -1."""

MAX_GRADIENT = 1e-2
"""Gradient of the score in the loadings of correlated effects below which their search has converged: a choice, because a
likelihood that changes by less is flat."""

LOADING_STEP = 1e-3
"""Step for numerical derivatives of the score in the loadings; the score is accurate to ten digits or more."""


@dataclass(frozen=True)
class FitSettings:
    """Settings of a fit.

    Attributes
    ----------
    family : Family
    method : {"fREML", "REML"}
    rho : ndarray (M,) or None
        Given log smoothing parameters.
    ar1_rho : float, "estimate" or None
    tolerance : float
        Tolerance of the fit, in posterior standard deviations.
    max_iter : int
    """

    family: Family
    method: Method = "fREML"
    rho: FloatArray | None = None
    ar1_rho: float | Literal["estimate"] | None = None
    tolerance: float = 1e-3
    max_iter: int = 400


@dataclass(frozen=True, eq=False)
class Problem:
    """Data and penalties of a fit, restricted to the active coefficients.

    Attributes
    ----------
    rows : TableRows
        Active columns only.
    y : ndarray (n,)
    sums : NormalEquations
        Sums of the active columns.
    stack : PenaltyStack
        Penalties of the active columns.
    settings : FitSettings
    previous : ndarray (n,), optional
        Number of the preceding row of the same group, for autocorrelated errors.
    response : Response, optional
        Response of a family without additive errors; `y` is then a rough linear predictor, to start from.
    """

    rows: TableRows
    y: FloatArray
    sums: NormalEquations
    stack: PenaltyStack
    settings: FitSettings
    previous: Index | None = None
    response: Response | None = None

    def normal(self, rho: float) -> NormalEquations:
        """Normal equations at autocorrelation `rho`."""
        if self.previous is None:
            return self.sums.rotated(self.stack)
        jacobian = Whitening(self.previous, rho).log_jacobian
        return NormalEquations.of_rows(*self.whitened(rho), jacobian).rotated(self.stack)

    def whitened(self, rho: float) -> tuple[TableRows, FloatArray]:
        """Rows and response, whitened to independent errors if rows are autocorrelated."""
        if self.previous is None:
            return self.rows, self.y
        white = Whitening(self.previous, rho)
        return white.rows(self.rows), white.values(self.y)


def _gaussian(
    data: NormalEquations, stack: PenaltyStack, settings: FitSettings, scale: float | None
) -> Solution | None:
    """Fit with given smoothing parameters, or from two starts and keep the better fit, converged ones first; None if no fit succeeds."""
    if settings.rho is not None:
        return fit_gaussian(data, stack, settings.rho, True, scale)
    # the score may have two optima; the lower one counts
    fits = [
        fit_gaussian(data, stack, None, False, scale, max_iter=settings.max_iter, shift=shift)
        for shift in (0.0, -8.0)
    ]
    successful = [fit for fit in fits if fit is not None]
    return min(successful, key=lambda fit: (not fit.end.converged, fit.score), default=None)


def _subset_start(iteration: PerformanceIteration, settings: FitSettings) -> FloatArray | None:
    """Start from a fit to evenly spaced rows; returns None if rows are too few or that fit fails."""
    stack, step = iteration.stack, iteration.rows.n // THIN_ROWS
    if step < 2:
        return None
    chosen = np.arange(0, iteration.rows.n, step, dtype=np.intp)
    rows, y = iteration.rows.subset(chosen), iteration.y[chosen]
    thinned = replace(iteration, rows=rows, y=y, data=NormalEquations.of_rows(rows, y).rotated(stack))
    iterated = thinned.run(None, 100 * settings.tolerance, settings.max_iter)
    if iterated is None:
        return None
    return np.concatenate([stack.rotate(iterated.beta), iterated.rho, iterated.theta])


def _scaled_t(
    rows: TableRows, y: FloatArray, data: NormalEquations, stack: PenaltyStack, settings: FitSettings
) -> Solution | None:
    """Fit by performance iteration and, if `method` is "REML", from there by exact Laplace REML; None if a fit fails."""
    family = settings.family
    assert isinstance(family, ScaledT)
    iteration = PerformanceIteration(rows, y, data, stack, family, settings.rho)
    start = _subset_start(iteration, settings)
    exact = settings.method == "REML"
    iterated = iteration.run(start, settings.tolerance * (100 if exact else 1), settings.max_iter)
    if iterated is None or not exact:
        return iterated
    model = LaplaceModel(rows, Response.of(y), stack, family, stack.rotate(iterated.beta))
    # at the bound of nu the score is flat in the log of its excess: Newton's method would not leave it
    theta = np.where(family.free & [True, False], np.maximum(iterated.theta, 0.0), iterated.theta)
    fixed = settings.rho is not None
    return fit_laplace(model, iterated.rho, theta, data.gram, fixed, settings.max_iter)


def _laplace(problem: Problem, response: Response, data: NormalEquations) -> Solution | None:
    """Fit a family without additive errors, from a gaussian fit to a rough linear predictor; None if a fit fails."""
    family, stack, given = problem.settings.family, problem.stack, problem.settings.rho
    start = fit_gaussian(data, stack, given, given is not None, tolerance=1e-4)
    if start is None:
        return None
    eta = response.offset + problem.rows.predictor(start.beta)
    assert isinstance(family, ExponentialFamily)
    theta = family.first(response, eta)
    rho = start.rho - start.theta + theta if given is None else given
    model = LaplaceModel(problem.rows, response, stack, family, stack.rotate(start.beta))
    return fit_laplace(model, rho, theta, data.gram, given is not None, problem.settings.max_iter)


def _fit_at(problem: Problem, rho: float) -> Solution | None:
    """Fit at a given autocorrelation; if the fit fails, again with a ridge."""
    settings, stack, normal = problem.settings, problem.stack, problem.normal(rho)
    # a ridge of 1e-8 of the diagonal is for crossproducts that are singular to working precision
    for ridge in (0.0, 1e-8):
        corner = normal.gram.corner * (1 + ridge * np.eye(len(normal.gram.corner)))
        data = replace(normal, gram=replace(normal.gram, corner=corner))
        if isinstance(settings.family, Gaussian):
            fitted = _gaussian(data, stack, settings, settings.family.scale)
        elif problem.response is not None:
            fitted = _laplace(problem, problem.response, data)
        elif fitted := _scaled_t(*problem.whitened(rho), data, stack, settings):
            fitted.score -= data.log_jacobian
        if fitted is not None:
            white = None if problem.previous is None else Whitening(problem.previous, rho)
            return replace(fitted, white=white)
    return None


def _solve(problem: Problem) -> Solution | None:
    """Fit with the loadings of the stack; an autocorrelation to estimate is found by a search on the score."""
    settings, stack, family = problem.settings, problem.stack, problem.settings.family
    if not isinstance(settings.ar1_rho, str):
        return _fit_at(problem, float(settings.ar1_rho or 0.0))
    start = settings.rho

    def score(z: float) -> float:
        nonlocal start
        rho = float(np.tanh(z))
        if isinstance(family, Gaussian) and not stack.n_loadings:
            fixed = settings.rho is not None
            fitted = fit_gaussian(problem.normal(rho), stack, start, fixed, family.scale)
        else:
            fitted = _fit_at(problem, rho)
        start = start if fitted is None else fitted.rho
        return math.inf if fitted is None else fitted.score

    # the outer search over loadings needs a smooth score; for this reason warm starts are not used there either
    xatol = 1e-8 if stack.n_loadings else 1e-4
    best = minimize_scalar(score, bounds=np.arctanh(AR1_BOUNDS), method="bounded", options={"xatol": xatol})
    return _fit_at(problem, float(np.tanh(best.x)))


def solve(problem: Problem, where: str) -> Solution:
    """Fit the active coefficients; correlations of effects are found by an outer search on the REML score.

    Parameters
    ----------
    problem : Problem
    where : str
        Name of the data, for the message of the error.

    Raises
    ------
    InvalidInput
        If no start leads to a positive definite system.
    """
    solution = _search_loadings(problem) if problem.stack.n_loadings else _solve(problem)
    if solution is None:
        allowed = "linearly independent terms"
        raise InvalidInput.of("model not identifiable", where, "singular system", allowed)
    return solution


def _search_loadings(problem: Problem) -> Solution | None:
    """Find the loadings of correlated effects with the best REML score; return None if no fit succeeds there."""
    settings, stack = problem.settings, problem.stack

    def fit_at(loadings: FloatArray, settings: FitSettings) -> tuple[float, Solution | None]:
        fitted = _solve(replace(problem, stack=stack.loaded(loadings), settings=settings))
        return math.inf if fitted is None else fitted.score, fitted

    def scored(loadings: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Score, its gradient in the loadings, and the other parameters of the best fit at given loadings."""
        score, fitted = fit_at(loadings, settings)
        if fitted is None:
            size = stack.size + int(settings.family.free.sum())
            return score, np.full(len(loadings), math.nan), np.full(size, math.nan)
        # the rest is best there: to first order, the score moves as if the rest stayed
        held = replace(settings, rho=fitted.rho, ar1_rho=getattr(fitted.white, "rho", None))

        def slope(step: float) -> FloatArray:
            return central_differences(lambda x: fit_at(x, held)[0], loadings, step)

        # without the error of the second order, which is larger than that of a fit
        gradient = (4 * slope(LOADING_STEP) - slope(2 * LOADING_STEP)) / 3
        return score, gradient, np.append(fitted.rho, fitted.theta[settings.family.free])

    q, options = stack.n_loadings, {"gtol": 1e-4}
    best = minimize(lambda x: scored(x)[:2], np.zeros(q), jac=True, method="BFGS", options=options)
    _, solution = fit_at(best.x, settings)
    if solution is None:
        return None
    flat = float(np.abs(best.jac).max()) < MAX_GRADIENT
    end = solution.end._replace(converged=solution.end.converged and flat)
    # the Hessian is that at the autocorrelation found
    settings = replace(settings, ar1_rho=getattr(solution.white, "rho", None))
    if m := len(end.hessian):
        moves = central_differences(lambda x: np.concatenate(scored(x)[1:]), best.x, LOADING_STEP)
        curvature, slopes, _ = np.split(moves, [q, q + m], axis=1)
        end = end._replace(hessian=_joint_hessian(end.hessian, slopes.T, curvature))
    return replace(solution, loadings=best.x, end=end)


def _joint_hessian(inner: FloatArray, slopes: FloatArray, curvature: FloatArray) -> FloatArray:
    """Hessian of the score in the loadings (q,) and in the parameters of a fit at given loadings (m,).

    Parameters
    ----------
    inner : ndarray (m, m)
        Hessian H of the score at given loadings.
    slopes : ndarray (m, q)
        Slopes D, in the loadings, of the parameters that fit best at given loadings.
    curvature : ndarray (q, q)
        Hessian, in the loadings, of the score of the best fit at given loadings.

    Returns
    -------
    ndarray (q + m, q + m)
        The gradient in the parameters stays zero along D: the mixed block is -H D, that of the loadings `curvature` + D'H D.
        (0, 0) if a fit near the best one failed.
    """
    mixed = -inner @ slopes
    joint = np.block([[(curvature + curvature.T) / 2 - slopes.T @ mixed, mixed.T], [mixed, inner]])
    return joint if np.isfinite(joint).all() else np.zeros((0, 0))
