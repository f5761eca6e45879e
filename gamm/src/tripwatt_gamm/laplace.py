"""Fit models of any family by exact Laplace REML over smoothing parameters and the parameters of the family together.

The score is that of Wood, Pya & Säfken (2016, eq. 5), the one score that is well defined for a scaled t: the
coefficients maximise the penalised likelihood, and the determinant is that of the observed information. The gradient is
exact, by implicit differentiation of the coefficients; the Hessian is a difference of gradients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tripwatt_gamm.arrays import FloatArray, central_differences
from tripwatt_gamm.families import Family, Response
from tripwatt_gamm.fit import End, Solution, Value, bounds, minimise
from tripwatt_gamm.gram import Factor, Gram
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import TableRows

STEP = 1e-4
"""Step for differences in the parameters: gradients are accurate to ten digits or more, so that differences have four."""


MODE_STEPS = 200
TOLERANCE = 1e-6
"""Largest number of Newton steps to a mode: a choice, because few take more than twenty."""


@dataclass
class Mode:
    """Coefficients that maximise the penalised likelihood at given smoothing parameters and parameters of the family."""

    beta: FloatArray
    eta: FloatArray
    factor: Factor
    derivatives: FloatArray
    value: float


@dataclass(frozen=True)
class LaplaceModel:
    """Laplace REML of one model.

    Attributes
    ----------
    rows : TableRows
    response : Response
    stack : PenaltyStack
    family : Family
    beta : ndarray (p,)
        Start of the coefficients, rotated coordinates.
    """

    rows: TableRows
    response: Response
    stack: PenaltyStack
    family: Family
    beta: FloatArray

    def _objective(
        self, beta: FloatArray, rho: FloatArray, theta: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """Return the penalised negative log-likelihood, the linear predictor (n,), and the derivatives (4, n)."""
        eta = self.response.offset + self.rows.predictor(self.stack.rotate(beta, back=True))
        with np.errstate(over="ignore", invalid="ignore"):  # a step that is too long is halved
            d = self.family.derivatives(self.response, eta, theta)
        return float((self.stack.products(rho, beta).T @ beta).sum()) / 2 - float(d[0].sum()), eta, d

    def mode(self, x: FloatArray, start: Mode | None = None) -> Mode | None:
        """Find the mode at parameters `x`: log smoothing parameters, then those of the family.

        Smoothing parameters of a family that estimates its scale are relative to it, as those of normal errors. Newton's
        method starts from the mode `start`. The mode is None if it fails or ends where the observed information is
        indefinite; on the way, weights of such an information are raised to at least 5 % of the expected weight.
        """
        (rho, theta), beta = self.split(x), self.beta if start is None else start.beta
        value, eta, d = self._objective(beta, rho, theta)
        for _ in range(MODE_STEPS):
            g = self.stack.rotate(self.rows.rmatvec(d[1])) - self.stack.products(rho, beta).sum(axis=1)
            observed = factor = Factor.from_gram(self._information(-d[2], rho))
            if factor is None:
                least = 0.05 * self.family.information(self.response, eta, theta)
                factor = Factor.from_gram(self._information(np.maximum(-d[2], least), rho))
            if factor is None:
                return None
            step = factor.solve(g)
            done = float(g @ step) < 1e-18 * (1 + abs(value))
            for _ in range(30):
                trial = self._objective(beta + step, rho, theta)
                if trial[0] <= value + 1e-13 * abs(value):
                    beta, (value, eta, d) = beta + step, trial
                    break
                step = step / 2
            else:
                done = True
            if done:
                return None if observed is None else Mode(beta, eta, observed, d, value)
        return None

    def _information(self, weights: FloatArray, rho: FloatArray) -> Gram:
        return self.stack.add_to(self.stack.rotate_gram(self.rows.gram(weights)), rho)

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log smoothing parameters, no longer relative to a scale, and the parameters of the family."""
        rho, theta = x[: self.stack.size], x[self.stack.size :]
        return (rho - theta[0] if self.family.estimates_scale else rho), theta

    def score(self, x: FloatArray, mode: Mode) -> float:
        """Compute the score at a mode."""
        log_s = self.stack.log_determinant(self.split(x)[0])[0]
        constant = self.stack.null_dim / 2 * math.log(2 * math.pi)
        return mode.value + (mode.factor.log_determinant - log_s) / 2 - constant

    def gradient(self, x: FloatArray, mode: Mode) -> FloatArray:
        """Compute the gradient of the score in the parameters `x` at a mode."""
        (rho, theta), stack, d = self.split(x), self.stack, mode.derivatives
        factor, M = mode.factor, self.stack.size
        leverage = self.rows.leverage(stack.rotate_factor(factor))
        V = stack.products(rho, mode.beta)
        changes = central_differences(
            lambda t: self.family.derivatives(self.response, mode.eta, t), theta, STEP
        )
        mixed = stack.rotate(self.rows.rmatvec(np.ascontiguousarray(changes[:, 1].T)))
        beta1 = factor.solve(np.hstack([-V, mixed]))
        trace = -beta1.T @ stack.rotate(self.rows.rmatvec(leverage * d[3]))
        trace[:M] += stack.traces(rho, factor)[0]
        trace[M:] -= changes[:, 2] @ leverage
        gradient = np.concatenate([V.T @ mode.beta / 2, -changes[:, 0].sum(axis=1)]) + trace / 2
        gradient[:M] -= stack.log_determinant(rho)[1] / 2
        if self.family.estimates_scale:
            gradient[M] -= gradient[:M].sum()
        return np.asarray(gradient)

    def value(self, x: FloatArray, free: FloatArray) -> Value | None:
        """Return the score, and its gradient and Hessian in the `free` of the parameters `x`; None if there is no mode."""
        mode = self.mode(x)
        if mode is None:
            return None
        gradient = self.gradient(x, mode)
        hessian = np.zeros((len(x), len(x)))
        for i in np.flatnonzero(free):
            moved = x + STEP * np.eye(len(x))[i]
            near = self.mode(moved, mode)
            if near is None:
                return None
            hessian[i] = (self.gradient(moved, near) - gradient) / STEP
        hessian = (hessian + hessian.T) / 2
        return self.score(x, mode), gradient[free], hessian[np.ix_(free, free)]


def fit_laplace(
    model: LaplaceModel, rho: FloatArray, theta: FloatArray, gram: Gram, fixed: bool, max_iter: int
) -> Solution | None:
    """Minimise the Laplace REML score over smoothing parameters and the parameters of the family.

    Parameters
    ----------
    model : LaplaceModel
    rho : ndarray (M,)
        Start of the log smoothing parameters; with `fixed` their values.
    theta : ndarray (m,)
        Start of the parameters of the family; those that it fixes stay constant.
    gram : Gram
        X'X in rotated coordinates.
    fixed : bool
    max_iter : int
        Largest number of steps of Newton's method.

    Returns
    -------
    Solution or None
        None if the score cannot be evaluated.
    """
    stack, family, M, response = model.stack, model.family, model.stack.size, model.response
    weights = family.information(response, response.offset, theta)
    lower, upper = bounds(float(weights.mean()) * gram.diagonal, stack)
    free = np.concatenate([np.full(M, not fixed), family.free])
    full = np.concatenate([rho, theta])
    lower = np.concatenate([lower, np.maximum(family.bounds[0], theta - 50)])
    upper = np.concatenate([upper, np.minimum(family.bounds[1], theta + 50)])

    def at(x: FloatArray) -> FloatArray:
        filled = full.copy()
        filled[free] = x
        return filled

    x, end = full[free], End(np.zeros((0, 0)), True, 0, "all parameters were given")
    if free.any():
        limits = lower[free], upper[free]
        x, end = minimise(lambda x: model.value(at(x), free), x, *limits, TOLERANCE, max_iter)
    mode = model.mode(at(x))
    if mode is None:
        return None
    rho, theta = at(x)[:M], at(x)[M:]
    weights = family.information(response, mode.eta, theta)
    information = model.rows.gram(weights)
    absolute = model.split(at(x))[0]
    slopes = -stack.rotate(mode.factor.solve(stack.products(absolute, mode.beta)), back=True)
    penalised = stack.add_to(stack.rotate_gram(information), absolute)
    covariance = stack.rotate_factor(Factor.from_gram(penalised) or mode.factor).dense()
    end = end._replace(hessian=np.zeros((0, 0))) if fixed else end
    score, beta = model.score(at(x), mode), stack.rotate(mode.beta, back=True)
    return Solution(beta, rho, slopes, theta, score, covariance, information.dense(), end)
