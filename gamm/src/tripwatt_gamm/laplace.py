"""Fit scaled t models by exact Laplace REML over smoothing parameters, shape and scale together.

The score is that of Wood, Pya & Säfken (2016, eq. 5), the one score that is well defined for a scaled t: the
coefficients maximise the penalised likelihood, and the determinant is that of the observed information. Gradient and
Hessian are exact, by implicit differentiation of the coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.families import LOG_EXCESS_DF, ScaledT, TDerivatives, Theta, t_derivatives
from tripwatt_gamm.fit import Factor, Solution, Value, bounds, minimise
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import TableRows


@dataclass
class Mode:
    """Coefficients that maximise the penalised likelihood at given smoothing parameters, shape and scale."""

    beta: FloatArray
    residual: FloatArray
    factor: Factor
    derivatives: TDerivatives
    value: float


class LaplaceModel:
    """Laplace REML of one scaled t model.

    Parameters
    ----------
    rows : TableRows
    y : ndarray (n,)
    stack : PenaltyStack
    family : ScaledT
    beta : ndarray (p,)
        Start of the coefficients, rotated coordinates.
    """

    def __init__(
        self, rows: TableRows, y: FloatArray, stack: PenaltyStack, family: ScaledT, beta: FloatArray
    ) -> None:
        self.rows, self.y, self.stack, self.family, self.beta = rows, y, stack, family, beta

    def _objective(self, beta: FloatArray, rho: FloatArray, theta: Theta) -> tuple[float, FloatArray]:
        """Return the penalised negative log-likelihood and the residuals (n,)."""
        r = self.y - self.rows.predictor(self.stack.restore(beta))
        penalty = float((self.stack.products(rho, beta).T @ beta).sum()) / 2
        return penalty - self.family.loglik(r, theta.nu, theta.sigma), r

    def mode(self, rho: FloatArray, theta: Theta, max_iter: int = 200) -> Mode | None:
        """Find the coefficients by Newton's method; return None if it fails or ends where the observed information is indefinite.

        On the way, weights of an indefinite observed information are raised to at least 5 % of the expected weight.
        """
        beta = self.beta
        value, r = self._objective(beta, rho, theta)
        for _ in range(max_iter):
            d = t_derivatives(r, theta)
            g = self.stack.rotate(self.rows.rmatvec(d.eta[1])) - self.stack.products(rho, beta).sum(axis=1)
            observed = Factor.from_matrix(self._information(-d.eta[2], rho))
            factor = observed
            if factor is None:
                c = self.family.expected_weight(theta.nu, theta.sigma)
                factor = Factor.from_matrix(self._information(np.maximum(-d.eta[2], 0.05 * c), rho))
            if factor is None:
                return None
            step = factor.inverse @ g
            if float(g @ step) < 1e-18 * (1 + abs(value)):
                return None if observed is None else Mode(beta, r, observed, d, value)
            for _ in range(30):
                trial, trial_r = self._objective(beta + step, rho, theta)
                if trial <= value + 1e-13 * abs(value):
                    break
                step = step / 2
            else:
                return None if observed is None else Mode(beta, r, observed, d, value)
            beta, value, r = beta + step, trial, trial_r
        return None

    def _information(self, weights: FloatArray, rho: FloatArray) -> FloatArray:
        return self.stack.add_to(self.stack.rotate_both(self.rows.gram(weights)), rho)

    def score(self, rho: FloatArray, theta: Theta) -> tuple[float, Mode] | None:
        """Return the score at given parameters and the mode there, or None if there is no mode."""
        mode = self.mode(rho, theta)
        if mode is None:
            return None
        log_s = self.stack.log_determinant(rho)[0]
        constant = self.stack.null_dim / 2 * math.log(2 * math.pi)
        return mode.value + (mode.factor.log_determinant - log_s) / 2 - constant, mode

    def value(self, rho: FloatArray, theta: Theta) -> Value | None:
        """Return the score, its gradient and Hessian in (rho, log(nu - min_df), log sigma), or None if there is no mode."""
        scored = self.score(rho, theta)
        if scored is None:
            return None
        value, mode = scored
        return value, *self._derivatives(rho, mode)

    def _derivatives(self, rho: FloatArray, mode: Mode) -> tuple[FloatArray, FloatArray]:
        """Gradient and Hessian of the score at a mode, in (rho, log(nu - min_df), log sigma)."""
        stack, d, K, M = self.stack, mode.derivatives, mode.factor.inverse, self.stack.size
        restored = stack.restore(K)
        leverage = self.rows.leverage(stack.restore(restored.T))
        V = stack.products(rho, mode.beta)
        mixed = stack.rotate(self.rows.rmatvec(np.ascontiguousarray(d.eta_theta[1].T)))
        beta1 = K @ np.hstack([-V, mixed])
        eta1 = self.rows.predictor(stack.restore(beta1))
        w1 = -(d.eta[3][:, None] * eta1)
        w1[:, M:] -= d.eta_theta[2].T
        A1 = [stack.rotate_both(self.rows.gram(np.ascontiguousarray(w))) for w in w1.T]
        for j in range(M):
            pen = stack.penalties[j]
            A1[j][pen.where, pen.where] += np.exp(rho[j]) * pen.matrix
        products = [K @ A for A in A1]
        log_s1, log_s2 = stack.log_determinant(rho)[1:]
        d1 = V.T @ mode.beta
        gradient = np.concatenate([d1 / 2, -d.eta_theta[0].sum(axis=1)])
        gradient += np.array([np.trace(P) for P in products]) / 2
        gradient[:M] -= log_s1 / 2
        hessian = self._curvature(rho, mode, (beta1, eta1, V, A1, products, leverage))
        hessian[:M, :M] += np.diag(d1) / 2 - log_s2 / 2
        return gradient, (hessian + hessian.T) / 2

    def _curvature(
        self,
        rho: FloatArray,
        mode: Mode,
        parts: tuple[FloatArray, FloatArray, FloatArray, list[FloatArray], list[FloatArray], FloatArray],
    ) -> FloatArray:
        """Hessian of the score without the parts from log|S|+ and from the diagonal of the penalty term."""
        beta1, eta1, V, A1, products, leverage = parts
        stack, d, M = self.stack, mode.derivatives, self.stack.size
        size = M + 2
        single = stack.traces(rho, mode.factor.inverse)[0]
        adjoint = mode.factor.inverse @ stack.rotate(self.rows.rmatvec(leverage * d.eta[3]))
        hessian = np.zeros((size, size))
        for i in range(size):
            for j in range(i + 1):
                # total derivative of the partial derivative of the penalised likelihood
                if i < M:
                    likelihood_part = float(V[:, i] @ beta1[:, j])
                else:
                    likelihood_part = -float(d.eta_theta[1, i - M] @ eta1[:, j])
                    likelihood_part -= float(d.eta_theta2[0, i - M, j - M].sum()) if j >= M else 0.0
                right_side = -(A1[i] @ beta1[:, j])  # equals A beta_ij
                w = -(d.eta[4] * eta1[:, i] * eta1[:, j])
                if j < M:
                    S = stack.penalties[j]
                    right_side[S.where] -= np.exp(rho[j]) * S.times(beta1[S.where, i])
                    right_side -= V[:, j] if i == j else 0.0
                else:
                    w -= d.eta_theta[3, j - M] * eta1[:, i]
                    pull = d.eta_theta[2, j - M] * eta1[:, i] + d.eta_theta2[1, i - M, j - M]
                    w -= d.eta_theta2[2, i - M, j - M]
                    right_side += stack.rotate(self.rows.rmatvec(pull))
                if i >= M:
                    w -= d.eta_theta[3, i - M] * eta1[:, j]
                trace = float(leverage @ w) - float(adjoint @ right_side)
                trace += single[i] if i == j and i < M else 0.0
                trace -= float(np.einsum("ab,ba->", products[i], products[j]))
                hessian[i, j] = hessian[j, i] = likelihood_part + trace / 2
        return hessian


def fit_laplace(
    model: LaplaceModel,
    rho: FloatArray,
    theta: Theta,
    gram: FloatArray,
    fixed: bool = False,
    tolerance: float = 1e-6,
    max_iter: int = 100,
) -> Solution | None:
    """Minimise the Laplace REML score over smoothing parameters, shape and scale.

    Parameters
    ----------
    model : LaplaceModel
    rho : ndarray (M,)
        Start of the log smoothing parameters; with `fixed` their values.
    theta : Theta
        Start of shape and scale; parameters that the family fixes stay constant.
    gram : ndarray (p, p)
        X'X in rotated coordinates.
    fixed : bool
    tolerance, max_iter
        Settings of Newton's method.

    Returns
    -------
    Solution or None
        None if the score cannot be evaluated.
    """
    stack, family, M = model.stack, model.family, model.stack.size
    c = family.expected_weight(theta.nu, theta.sigma)
    lower, upper = bounds(c * np.diag(gram), stack)
    free = np.array([not fixed] * M + [family.nu is None, family.sigma is None])
    x0 = np.concatenate([rho, [theta.excess, theta.log_sigma]])
    lower = np.concatenate([lower, [max(LOG_EXCESS_DF[0], math.log(1e-5)), x0[-1] - 50]])
    upper = np.concatenate([upper, [LOG_EXCESS_DF[1], x0[-1] + 50]])

    def unpack(x: FloatArray) -> tuple[FloatArray, Theta]:
        full = x0.copy()
        full[free] = x
        return full[:M], Theta(float(full[M]), float(full[M + 1]), family.min_df)

    def score(x: FloatArray) -> Value | None:
        scored = model.value(*unpack(x))
        return None if scored is None else (scored[0], scored[1][free], scored[2][np.ix_(free, free)])

    x, n_iter, converged, message = x0[free], 0, True, "all parameters were given"
    gradient, hessian = np.zeros(0), np.zeros((0, 0))
    if free.any():
        x, last, n_iter, converged, message = minimise(
            score, x, lower[free], upper[free], tolerance, max_iter
        )
        _, gradient, hessian = last
    best_rho, best = unpack(x)
    scored = model.score(best_rho, best)
    if scored is None:
        return None
    value, mode = scored
    information = family.expected_weight(best.nu, best.sigma) * gram
    expected = Factor.from_matrix(stack.add_to(information, best_rho))
    return Solution(
        beta=stack.restore(mode.beta),
        rho=best_rho,
        scale=1.0,
        score=value,
        covariance=stack.restored_both((expected or mode.factor).inverse),
        information=stack.restored_both(information),
        converged=converged,
        n_iter=n_iter,
        message=message,
        gradient=gradient,
        hessian=np.zeros((0, 0)) if fixed else hessian,
        nu=best.nu if family.nu is None else family.nu,
        sigma=best.sigma,
    )
