"""From sums over rows to a solution: which method runs, where it starts, what it falls back on."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from tripwatt.arrays import FloatArray
from tripwatt.gam.covariates import Index
from tripwatt.gam.families import Family, Gaussian, ScaledT, Theta
from tripwatt.gam.fit import NormalEquations, Rows, Solution, fit_gaussian
from tripwatt.gam.laplace import LaplaceModel, fit_laplace
from tripwatt.gam.moments import Moments
from tripwatt.gam.penalties import PenaltyStack
from tripwatt.gam.performance import PerformanceIteration, State, TData
from tripwatt.gam.tables import TableRows, Whitening

Method = Literal["fREML", "REML"]
THIN_ROWS = 10_000
"""A scaled t with twice as many rows is started from a fit to so many of them."""

AR1_BOUNDS = (-0.95, 0.9999)

LOADING_STEP = 1e-4
"""Of the derivatives of the score in the loadings of correlated effects; the score has ten digits or more."""


@dataclass(frozen=True)
class FitSettings:
    """How a model is to be fitted.

    Attributes
    ----------
    family : Family
    method : {"fREML", "REML"}
    rho : ndarray (M,) or None
        Given log smoothing parameters.
    ar1_rho : float, "estimate" or None
    tolerance : float
        Of the fit, in posterior standard deviations.
    max_iter : int
    """

    family: Family
    method: Method = "fREML"
    rho: FloatArray | None = None
    ar1_rho: float | Literal["estimate"] | None = None
    tolerance: float = 1e-3
    max_iter: int = 400


def _with_ridge(data: NormalEquations) -> NormalEquations:
    """A ridge of one part in 1e8, for crossproducts that are singular to working precision."""
    gram = data.gram.copy()
    gram[np.diag_indices_from(gram)] *= 1 + 1e-8
    return replace(data, gram=gram)


def _gaussian(
    data: NormalEquations, stack: PenaltyStack, settings: FitSettings, scale: float | None
) -> Solution | None:
    if settings.rho is not None:
        return fit_gaussian(data, stack, settings.rho, True, scale)
    solutions = [
        solution
        for shift in (0.0, -8.0)  # the score may have two optima; the lower one counts
        if (
            solution := fit_gaussian(data, stack, None, False, scale, max_iter=settings.max_iter, shift=shift)
        )
    ]
    return (
        min(solutions, key=lambda solution: (not solution.converged, solution.score)) if solutions else None
    )


def _autoregressive(
    sums: Moments, stack: PenaltyStack, active: Index, settings: FitSettings, scale: float | None
) -> Solution | None:
    if not isinstance(settings.ar1_rho, str):
        rho = float(settings.ar1_rho or 0.0)
        fitted = _gaussian(sums.normal(stack, active, rho), stack, settings, scale)
        return None if fitted is None else replace(fitted, ar1_rho=rho)
    last: dict[str, FloatArray] = {}

    def score(z: float) -> float:
        solution = fit_gaussian(
            sums.normal(stack, active, float(np.tanh(z))), stack, last.get("rho"), False, scale
        )
        if solution is None:
            return np.inf
        last["rho"] = solution.rho
        return solution.score

    if settings.rho is not None:
        kept = settings.rho

        def score(z: float) -> float:
            solution = fit_gaussian(sums.normal(stack, active, float(np.tanh(z))), stack, kept, True, scale)
            return np.inf if solution is None else solution.score

    low, high = np.arctanh(AR1_BOUNDS)
    best = minimize_scalar(score, bounds=(low, high), method="bounded", options={"xatol": _xatol(stack)})
    rho = float(np.tanh(best.x))
    return _autoregressive(sums, stack, active, replace(settings, ar1_rho=rho), scale)


def _xatol(stack: PenaltyStack) -> float:
    """Tolerance of the search for the autocorrelation; a search around it needs a smooth score."""
    return 1e-8 if stack.n_loadings else 1e-4


def _subset_start(rows: Rows, y: FloatArray, stack: PenaltyStack, settings: FitSettings) -> State | None:
    """A start from every so many-th row, where there are many rows; None where that is no use."""
    step = rows.n // THIN_ROWS
    if step < 2 or not isinstance(rows, TableRows):
        return None
    every = np.arange(0, rows.n, step, dtype=np.intp)
    few, some = rows.subset(every), y[every]
    family = settings.family
    assert isinstance(family, ScaledT)
    data = TData(few, some, stack.rotate_both(few.gram()), stack.rotate(few.transpose(some)))
    iteration = PerformanceIteration(data, stack, family, settings.rho is not None)
    start = iteration.start(settings.rho)
    iterated = None if start is None else iteration.run(start, 100 * settings.tolerance, settings.max_iter)
    if iterated is None:
        return None
    theta = Theta.from_estimates(iterated.nu, iterated.sigma, family.min_df)
    return State(stack.rotate(iterated.beta), iterated.rho, theta)


def _scaled_t(
    rows: Rows, y: FloatArray, data: NormalEquations, stack: PenaltyStack, settings: FitSettings
) -> Solution | None:
    family = settings.family
    assert isinstance(family, ScaledT)
    fixed = settings.rho is not None
    iteration = PerformanceIteration(TData(rows, y, data.gram, data.cross), stack, family, fixed)
    start = _subset_start(rows, y, stack, settings) or iteration.start(settings.rho)
    if start is None:
        return None
    exact = settings.method == "REML"
    first = iteration.run(start, settings.tolerance * (100 if exact else 1), settings.max_iter)
    if first is None or not exact:
        return first
    model = LaplaceModel(rows, y, stack, family, stack.rotate(first.beta))
    theta = Theta.from_estimates(first.nu, first.sigma, family.min_df)
    return fit_laplace(model, first.rho, theta, data.gram, fixed, max_iter=settings.max_iter)


def _autoregressive_t(
    rows: Rows,
    y: FloatArray,
    sums: Moments,
    stack: PenaltyStack,
    active: Index,
    settings: FitSettings,
    previous: Index,
) -> Solution | None:
    """Errors that follow e_t = rho e_(t-1) + sqrt(1 - rho^2) sigma T_nu: independent, once the rows are whitened."""
    assert isinstance(rows, TableRows)

    def at(rho: float) -> Solution | None:
        white = Whitening(previous, rho)
        data = sums.normal(stack, active, rho)
        fitted = _scaled_t(white.rows(rows), white.values(y), data, stack, settings)
        score = math.inf if fitted is None else fitted.score - data.log_jacobian
        return None if fitted is None else replace(fitted, score=score, ar1_rho=rho)

    def score(z: float) -> float:
        fitted = at(float(np.tanh(z)))
        return math.inf if fitted is None else fitted.score

    if settings.ar1_rho != "estimate":
        return at(float(settings.ar1_rho or 0.0))
    ends = np.arctanh(AR1_BOUNDS)
    best = minimize_scalar(score, bounds=ends, method="bounded", options={"xatol": _xatol(stack)})
    return at(float(np.tanh(best.x)))


def _solve(
    rows: Rows,
    y: FloatArray,
    sums: Moments,
    stack: PenaltyStack,
    active: Index,
    settings: FitSettings,
    previous: Index | None,
) -> Solution | None:
    """Fit with the correlations of effects that the stack has."""
    family = settings.family
    if isinstance(family, Gaussian):
        solution = _autoregressive(sums, stack, active, settings, family.scale)
        if solution is not None or len(sums.gram) > 1:
            return solution
        return _gaussian(_with_ridge(sums.normal(stack, active)), stack, settings, family.scale)
    if previous is not None:
        return _autoregressive_t(rows, y, sums, stack, active, settings, previous)
    data = sums.normal(stack, active)
    solution = _scaled_t(rows, y, data, stack, settings)
    return solution if solution is not None else _scaled_t(rows, y, _with_ridge(data), stack, settings)


def solve(
    rows: Rows,
    y: FloatArray,
    sums: Moments,
    stack: PenaltyStack,
    active: Index,
    settings: FitSettings,
    previous: Index | None = None,
) -> Solution | None:
    """Fit the active coefficients, and the correlations of effects by an outer search on the REML score.

    Parameters
    ----------
    rows : Rows
        Active columns only.
    y : ndarray (n,)
    sums : Moments
        Of all columns.
    stack : PenaltyStack
        Of the active columns.
    active : ndarray
        Active columns.
    settings : FitSettings
    previous : ndarray (n,), optional
        The row of the same group before each row, for autocorrelated errors.

    Returns
    -------
    Solution or None
        None where no start leads to a positive definite system.
    """
    if not stack.n_loadings:
        return _solve(rows, y, sums, stack, active, settings, previous)

    def at(loadings: FloatArray) -> Solution | None:
        return _solve(rows, y, sums, stack.loaded(loadings), active, settings, previous)

    def score(loadings: FloatArray) -> float:
        fitted = at(loadings)
        return math.inf if fitted is None else fitted.score

    def gradient(loadings: FloatArray) -> FloatArray:
        steps = LOADING_STEP * np.eye(len(loadings))
        return np.array([score(loadings + s) - score(loadings - s) for s in steps]) / (2 * LOADING_STEP)

    best = minimize(score, np.zeros(stack.n_loadings), jac=gradient, method="BFGS", options={"gtol": 1e-5})
    solution = at(best.x)
    return None if solution is None else replace(solution, loadings=best.x)
