"""Fit scaled t models by performance iteration with expected weights: one crossproduct for the whole fit.

The state is one vector: rotated coefficients, log smoothing parameters, parameters of the family.
Each pass updates shape and scale given the residuals, forms the working response z = eta + g / c with the
constant weight c, takes a Newton step of the working model's REML score, and solves for the coefficients
(Wood, Goude & Shaw 2015; Wood et al. 2017). The passes converge linearly; Anderson mixing accelerates them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.families import AT_BOUND, Response, ScaledT
from tripwatt_gamm.fit import (
    End,
    Evaluation,
    Solution,
    Value,
    bounds,
    fit_gaussian,
    gaussian_score,
    minimise,
    newton_step,
)
from tripwatt_gamm.moments import NormalEquations
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import TableRows

SHORT = 0.5
"""Largest step of the log smoothing parameters that, near the end, is taken without evaluating the score there: a choice,
because a Newton step near the minimum lowers the score."""

CLOSE = 0.014
"""Change of the predictor in one pass, in units of sigma, below which passes are mixed: a choice, because further away
mixing may lead to another mode than plain passes."""


class Pass(NamedTuple):
    """Result of one pass: next state, weights of its components, and the working model's normal equations."""

    state: FloatArray
    weights: FloatArray
    data: NormalEquations


@dataclass(frozen=True)
class PerformanceIteration:
    """One scaled t model, ready to iterate.

    Attributes
    ----------
    rows : TableRows
        Model matrix.
    y : ndarray (n,)
    data : NormalEquations
        X'X and X'y in rotated coordinates.
    stack : PenaltyStack
    family : ScaledT
    given : ndarray, optional
        Log smoothing parameters to keep; by default they are estimated.
    """

    rows: TableRows
    y: FloatArray
    data: NormalEquations
    stack: PenaltyStack
    family: ScaledT
    given: FloatArray | None = None

    def start(self) -> FloatArray | None:
        """Start from a gaussian fit and its scale; returns None if that fit fails."""
        family = self.family
        fixed = self.given is not None
        first = fit_gaussian(self.data, self.stack, self.given, fixed, tolerance=1e-4)
        if first is None:
            return None
        log_scale = float(first.theta[0])
        sigma = family.sigma if family.sigma is not None else max(0.8 * math.exp(log_scale / 2), 1e-150)
        theta = family.theta(family.nu if family.nu is not None else family.min_df + 2.0, sigma)
        rho_of_t = first.rho if fixed else first.rho - log_scale
        return np.concatenate([self.stack.rotate(first.beta), rho_of_t, theta])

    def _theta(self, residual: FloatArray, theta: FloatArray) -> FloatArray:
        """Take three steps of Newton's method to the shape and scale of greatest likelihood."""
        family, free = self.family, self.family.free
        full = theta.copy()

        def objective(x: FloatArray) -> Value:
            full[free] = x
            value, gradient, hessian = family.objective(residual, full)
            return value, gradient[free], hessian[free][:, free]

        if free.any():
            low, high = family.bounds[:, free]
            full[free] = minimise(objective, theta[free], low, high, 1e-8, 3)[0]
        return full

    def advance(self, state: FloatArray, limits: FloatArray, near: bool = False) -> Pass | None:
        """Run one pass: shape and scale, working response, smoothing parameters, coefficients.

        With `near`, a short step of the smoothing parameters is taken without evaluating the score. Returns None if the
        working model is not identifiable.
        """
        (beta, rho, theta), n = np.split(state, [self.stack.p, -2]), self.rows.n
        eta = self.rows.predictor(self.stack.rotate(beta, back=True))
        residual = self.y - eta
        theta = self._theta(residual, theta)
        c, (nu, sigma) = self._weight(theta), self.family.shape(theta)
        g = (nu + 1) * residual / (residual**2 + nu * sigma**2)
        gram, z = self.data.gram * c, g / c + eta
        cross = gram @ beta + self.stack.rotate(self.rows.rmatvec(g))
        normal = NormalEquations(gram, cross, c * float(z @ z), n)
        current = gaussian_score(normal, self.stack, rho, 1.0)
        if current is None:
            return None
        beta, curvature = current.beta, np.zeros(len(rho))
        if self.given is None and len(rho):
            beta, rho = self._smooth(normal, current, rho, limits, near)
            curvature = np.sqrt(np.maximum(np.diag(current.hessian), 1e-8))
        diagonal = 1 / np.sqrt(np.maximum(current.factor.diagonal, 1e-300))
        excess = 0.0 if nu - self.family.min_df < AT_BOUND else 1.0 if nu < 50 else 0.1
        weights = np.concatenate([diagonal, curvature, np.sqrt(n) * np.array([excess, 1.0])])
        return Pass(np.concatenate([beta, rho, theta]), weights, normal)

    def _weight(self, theta: FloatArray) -> float:
        """Fisher information of one row."""
        return float(self.family.information(Response.of(np.zeros(1)), np.zeros(1), theta)[0])

    def _smooth(
        self, normal: NormalEquations, current: Evaluation, rho: FloatArray, limits: FloatArray, near: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Take one Newton step of the working model's score, halved until the score falls; a short step if `near` is taken as is."""
        step = newton_step(current.gradient, current.hessian, rho, *limits)
        if near and float(np.abs(step).max()) < SHORT:
            return current.beta, rho + step  # the coefficients follow in the next pass
        for _ in range(12):
            trial = gaussian_score(normal, self.stack, rho + step, 1.0, derivatives=False)
            if trial is not None and trial.value <= current.value + 1e-9 * (1 + abs(current.value)):
                return trial.beta, rho + step
            step = step / 2
        return current.beta, rho

    def run(self, start: FloatArray | None, tolerance: float = 1e-3, max_iter: int = 400) -> Solution | None:
        """Iterate to convergence.

        Parameters
        ----------
        start : ndarray, optional
            State; that of a gaussian fit by default.
        tolerance : float
            Largest change in one pass, in posterior standard deviations.
        max_iter : int
            Largest number of passes.

        Returns
        -------
        Solution or None
            None if the model is not identifiable.
        """
        state = self.start() if start is None else start
        if state is None:
            return None
        limits = np.array(bounds(self._weight(state[-2:]) * self.data.gram.diagonal, self.stack))
        inside = np.hstack([limits, self.family.bounds])
        mixing = Mixing(close=CLOSE * float(np.sqrt(self.rows.n / self.rows.p)))
        largest_change = np.inf
        for count in range(1, max_iter + 1):
            advanced = self.advance(state, limits, largest_change <= 4 * mixing.close)
            if advanced is None:
                return None
            last = advanced
            change = last.weights * (last.state - state)
            largest_change = float(np.abs(change).max(initial=0.0))
            if largest_change <= tolerance:
                message = f"the last pass moved nothing by more than {tolerance:g} standard errors"
                return self._solution(last, End(np.zeros((0, 0)), True, count, message))
            mixed, p = mixing.next(state, last.state, last.weights), self.stack.p
            state = np.concatenate([mixed[:p], np.clip(mixed[p:], *inside)])
        message = f"{max_iter} accelerated passes did not settle; a larger max_iter or method='REML' may"
        return self._solution(last, End(np.zeros((0, 0)), False, max_iter, message))

    def _solution(self, last: Pass, end: End) -> Solution | None:
        """Solution at the last pass, with its score; None if the score cannot be evaluated."""
        _, rho, theta = np.split(last.state, [self.stack.p, -2])
        working = gaussian_score(last.data, self.stack, rho, 1.0)
        if working is None:
            return None
        end = end if self.given is not None else end._replace(hessian=working.hessian)
        return replace(working.solution(last.data, self.stack, rho, end), theta=theta)


class Mixing:
    """Anderson acceleration of a fixed point iteration, used only close to convergence.

    A scaled t has several modes. Plain passes decide which mode is reached; mixing only speeds up the approach to it.

    Parameters
    ----------
    close : float
        Change of a pass, in standard errors, below which passes are mixed.
    memory : int
        Number of earlier passes that are mixed in.
    """

    def __init__(self, close: float, memory: int = 6) -> None:
        self.memory, self.close = memory, close
        self.change: FloatArray | None = None
        self.plain, self.patience = 0, 10
        self.points: list[FloatArray] = []
        self.images: list[FloatArray] = []
        self.best, self.landmark, self.mixed = np.inf, np.inf, 0
        self.best_image: FloatArray = np.empty(0)

    def next(self, x: FloatArray, fx: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the next point to evaluate, given the map's value `fx` at `x` and weights of the components."""
        change = weights * (fx - x)
        size, largest = float(np.linalg.norm(change)), float(np.abs(change).max(initial=0.0))
        before, self.change = self.change, change
        size_before = 0.0 if before is None else float(np.linalg.norm(before))
        if self.points and (size > 2 * self.best or largest > self.close):
            best_image = self.best_image  # mixing made the change larger: plain passes from the best point
            self._forget()
            self.plain = 2
            return best_image
        growing = before is not None and size > size_before
        if largest > self.close or self.plain > 0 or (not self.points and growing):
            self.plain -= 1
            # for small residuals the observed weight is (nu + 3) / nu times the expected one: at nu = 3 a pass goes
            # twice as far as it should, so half of it is taken
            overshoots = before is not None and float(before @ change) < -0.5 * size * size_before
            return (x + fx) / 2 if overshoots else fx
        if size < self.best:
            self.best, self.best_image = size, fx
        self.points = [*self.points, x][-self.memory - 1 :]
        self.images = [*self.images, fx][-self.memory - 1 :]
        self.mixed += 1
        if self.mixed % (2 * self.memory) == 1:
            if self.best > 0.5 * self.landmark:  # stalled, perhaps at a point that plain passes would leave
                self._forget()
                self.plain, self.patience = self.patience, 2 * self.patience
                return fx
            self.landmark = self.best
        return self._mixture(fx, weights, largest) if len(self.points) > 1 else fx

    def _mixture(self, fx: FloatArray, weights: FloatArray, largest: float) -> FloatArray:
        """Anderson's combination of the stored passes, which moves `fx` by at most 20 times the largest change of the last pass."""
        P, F = np.array(self.points), np.array(self.images)
        R = (F - P) * weights
        dR, dF = np.diff(R, axis=0), np.diff(F, axis=0)
        coefficients = np.linalg.lstsq(dR.T, R[-1], rcond=1e-8)[0]
        moved = -coefficients @ dF
        longest = float(np.abs(weights * moved).max(initial=0.0))
        return np.asarray(fx + moved * min(1.0, 20 * largest / max(longest, 1e-300)))

    def _forget(self) -> None:
        self.points, self.images, self.mixed = [], [], 0
        self.best, self.landmark = np.inf, np.inf
