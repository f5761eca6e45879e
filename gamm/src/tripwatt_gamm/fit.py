"""Smoothing parameters and coefficients: restricted maximum likelihood by Newton with exact derivatives.

Gaussian models are fitted from their normal equations alone (Wood 2011; for large data Wood, Goude & Shaw
2015). Scaled t models in their fast form are a performance iteration: the working model of each pass has the
constant expected weight c = (nu + 1) / ((nu + 3) sigma^2), so that one crossproduct X'X serves the whole fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.gram import Factor
from tripwatt_gamm.moments import NormalEquations
from tripwatt_gamm.penalties import LOG_RATIO, PenaltyStack
from tripwatt_gamm.tables import Whitening

LAST_STEP = 1e-3
"""Longest step that is taken without a comparison of scores: a choice, far below the spread of a log smoothing parameter."""

Value: TypeAlias = tuple[float, FloatArray, FloatArray, *tuple[Any, ...]]


class End(NamedTuple):
    """How an iteration ended: Hessian of the score, whether it converged, number of iterations, and why it ended."""

    hessian: FloatArray
    converged: bool
    n_iter: int
    message: str


@dataclass
class Solution:
    """A fitted model in the coordinates of its design.

    Attributes
    ----------
    beta : ndarray (p,)
    rho : ndarray (M,)
        Log smoothing parameters.
    slopes : ndarray (p, M)
        Derivative of the coefficients in the log smoothing parameters.
    theta : ndarray (m,)
        Parameters of the family.
    score : float
        Negative log restricted likelihood.
    covariance : ndarray (p, p)
        Bayesian posterior covariance.
    information : ndarray (p, p)
        X'WX with expected weights, over the scale.
    end : End
        The Hessian is (m, m), loadings first, then `rho`; (0, 0) if the smoothing parameters were given.
    white : Whitening or None
        Whitening of autocorrelated errors.
    loadings : ndarray
        Loadings of correlated effects, as `PenaltyStack.loaded` takes them.
    """

    beta: FloatArray
    rho: FloatArray
    slopes: FloatArray
    theta: FloatArray
    score: float
    covariance: FloatArray
    information: FloatArray
    end: End
    white: Whitening | None = None
    loadings: FloatArray = field(default_factory=lambda: np.zeros(0))


class Evaluation(NamedTuple):
    """REML score of a gaussian working model, its derivatives and its ingredients, in rotated coordinates."""

    value: float
    gradient: FloatArray
    hessian: FloatArray
    beta: FloatArray
    factor: Factor
    scale: float

    def solution(self, data: NormalEquations, stack: PenaltyStack, rho: FloatArray, end: End) -> Solution:
        """Return the fit at these log smoothing parameters, in the coordinates of the model."""
        covariance = stack.rotate_factor(self.factor).dense() * self.scale
        information = stack.rotate_gram(data.gram, back=True).dense() / self.scale
        beta, theta = stack.rotate(self.beta, back=True), np.array([math.log(self.scale)])
        slopes = -stack.rotate(self.factor.solve(stack.products(rho, self.beta)), back=True)
        return Solution(beta, rho, slopes, theta, self.value, covariance, information, end)


def gaussian_score(
    data: NormalEquations, stack: PenaltyStack, rho: FloatArray, scale: float | None, derivatives: bool = True
) -> Evaluation | None:
    """Compute the REML score (Wood 2011, eq. 4) of a gaussian model and its derivatives in `rho`.

    Parameters
    ----------
    data : NormalEquations
    stack : PenaltyStack
    rho : ndarray (M,)
        Log smoothing parameters.
    scale : float or None
        Variance; None profiles it out.
    derivatives : bool
        Whether to compute gradient and Hessian.

    Returns
    -------
    Evaluation or None
        None if the penalised crossproduct is not positive definite.
    """
    penalised_gram = stack.add_to(data.gram, rho)
    factor = Factor.from_gram(penalised_gram)
    if factor is None:
        return None
    beta = factor.solve(data.cross)
    beta += factor.solve(data.cross - penalised_gram @ beta)  # one refinement
    # errors of the coefficients enter the quadratic form in the second order only
    penalised = data.square - float((2 * data.cross - penalised_gram @ beta) @ beta)
    freedom = data.n - stack.null_dim
    penalised = max(penalised, 1e-14 * data.square + 1e-300)
    phi = penalised / freedom if scale is None else scale
    log_s, log_s1, log_s2 = stack.log_determinant(rho)
    value = (
        penalised / (2 * phi)
        + freedom / 2 * math.log(2 * math.pi * phi)
        + (factor.log_determinant - log_s) / 2
        - data.log_jacobian
    )
    if not derivatives:
        return Evaluation(value, np.empty(0), np.empty((0, 0)), beta, factor, phi)
    single, pairs = stack.traces(rho, factor)
    V = stack.products(rho, beta)
    d1 = V.T @ beta
    d2 = np.diag(d1) - 2 * V.T @ factor.solve(V)
    gradient = d1 / (2 * phi) + (single - log_s1) / 2
    hessian = d2 / (2 * phi) + (np.diag(single) - pairs - log_s2) / 2
    if scale is None:
        hessian -= np.outer(d1, d1) / (2 * phi * penalised)
    return Evaluation(value, gradient, hessian, beta, factor, phi)


def newton_step(
    gradient: FloatArray, hessian: FloatArray, x: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Newton descent step within bounds, of at most 5 in each component.

    The eigenvalues of the scaled Hessian are replaced by their absolute values, at least 1e-4.
    """
    free = ~(((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0)))
    step = np.zeros_like(x)
    if not free.any():
        return step
    H, g = hessian[free][:, free], gradient[free]
    size = np.abs(H.diagonal())
    d = np.sqrt(np.maximum(size, 1e-10 * max(float(size.max()), 1e-300)))
    values, vectors = np.linalg.eigh(H / (d * d[:, None]))
    values = np.maximum(np.abs(values), 1e-4)
    move = -(vectors @ ((vectors.T @ (g / d)) / values)) / d
    step[free] = np.minimum(np.maximum(move, -5.0), 5.0)
    return np.asarray(np.minimum(np.maximum(x + step, lower), upper) - x)


def minimise(
    score: Callable[[FloatArray], Value | None],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    tolerance: float,
    max_iter: int,
) -> tuple[FloatArray, End]:
    """Minimise a score by Newton's method with step halving and bounds; from their middle if the start cannot be evaluated.

    Parameters
    ----------
    score : callable
        Returns value, gradient and Hessian at a point, or None if the score cannot be evaluated there.
    start, lower, upper : ndarray (M,)
    tolerance : float
        The iteration ends once the predicted gain is at most ``tolerance**1.5 * (1 + |value| / 1000)``.
    max_iter : int

    Returns
    -------
    point, end
    """
    x = np.clip(start, lower, upper)
    current = score(x)
    if current is None:
        x = np.clip(np.zeros_like(x) + (lower + upper) / 2, lower, upper)
        current = score(x)
    if current is None:
        return x, End(np.eye(len(x)), False, 0, "the score cannot be evaluated")
    for iteration in range(1, max_iter + 1):
        value, gradient, hessian, *_ = current
        step = newton_step(gradient, hessian, x, lower, upper)
        gain = -float(gradient @ step)
        if gain <= tolerance**1.5 * (1 + abs(value) / 1000) or not step.any():
            # the gradient has more digits than the score: a short step still brings the point closer
            last = np.where(np.abs(step) < LAST_STEP, step, 0.0)
            return x + last, End(hessian, True, iteration, "gradient and predicted gain are zero")
        for _ in range(25):
            trial = score(x + step)
            if trial is not None and trial[0] <= value - 1e-4 * max(-float(gradient @ step), 0.0):
                break
            step = step / 2
        else:
            small = gain <= 1e-6 * (1 + abs(value) / 1000)
            return x, End(hessian, small, iteration, "no step lowers the score (25 halvings tried)")
        x, current = x + step, trial
    message = f"{max_iter} Newton steps with halving did not converge"
    return x, End(current[2], False, max_iter, message)


def bounds(gram_diagonal: FloatArray, stack: PenaltyStack) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest log smoothing parameters that still make a difference beside the data."""
    middle = np.array(
        [math.log(max(float(gram_diagonal[pen.where].sum()), 1e-300) / pen.trace) for pen in stack.penalties]
    )
    return middle + LOG_RATIO[0], middle + np.array([pen.log_most for pen in stack.penalties])


def fit_gaussian(
    data: NormalEquations,
    stack: PenaltyStack,
    rho: FloatArray | None = None,
    fixed: bool = False,
    scale: float | None = None,
    tolerance: float = 1e-7,
    max_iter: int = 200,
    shift: float = 0.0,
) -> Solution | None:
    """Fit a gaussian model by REML from its normal equations.

    Parameters
    ----------
    data : NormalEquations
        In the rotated coordinates of `stack`.
    stack : PenaltyStack
    rho : ndarray (M,), optional
        Start of the log smoothing parameters; with `fixed` their values.
    fixed : bool
    scale : float, optional
        Known variance.
    tolerance, max_iter
        Settings of Newton's method.
    shift : float
        Shift of the default start: towards rougher functions if negative, towards smoother ones if positive.

    Returns
    -------
    Solution or None
        None if the model is not identifiable.
    """
    lower, upper = bounds(data.gram.diagonal, stack)
    start = rho if rho is not None else lower - LOG_RATIO[0] - 3 + shift
    x, end = start, End(np.zeros((0, 0)), True, 0, "smoothing parameters were given")
    if not fixed and stack.size:
        score = partial(gaussian_score, data, stack, scale=scale)
        x, end = minimise(score, start, lower, upper, tolerance, max_iter)
    scored = gaussian_score(data, stack, x, scale, derivatives=False)
    if scored is None:
        return None
    return scored.solution(data, stack, x, end)
