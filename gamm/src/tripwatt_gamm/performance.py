"""Fit scaled t models by performance iteration with expected weights: one crossproduct for the whole fit.

Each pass updates shape and scale given the residuals, forms the working response z = eta + g / c with the
constant weight c, takes a Newton step of the working model's REML score, and solves for the coefficients
(Wood, Goude & Shaw 2015; Wood et al. 2017). The passes converge linearly; Anderson mixing accelerates them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tripwatt_gamm.arrays import FloatArray
from tripwatt_gamm.families import LOG_EXCESS_DF, ScaledT, Theta, fit_theta
from tripwatt_gamm.fit import (
    Evaluation,
    NormalEquations,
    Solution,
    bounds,
    fit_gaussian,
    gaussian_score,
    newton_step,
)
from tripwatt_gamm.penalties import PenaltyStack
from tripwatt_gamm.tables import TableRows

SHORT = 0.5
"""Largest step of the log smoothing parameters that, near the end, is taken without evaluating the score there: a choice,
because a Newton step near the minimum lowers the score."""

CLOSE = 0.014
"""Change of the predictor in one pass, in units of sigma, below which passes are mixed: a choice, because further away
mixing may lead to another mode than plain passes."""


@dataclass(frozen=True)
class TData:
    """Response, rows and crossproduct of a scaled t model.

    Attributes
    ----------
    rows : TableRows
        Model matrix.
    y : ndarray (n,)
    gram : ndarray (p, p)
        X'X in rotated coordinates.
    cross : ndarray (p,)
        X'y in the same coordinates.
    """

    rows: TableRows
    y: FloatArray
    gram: FloatArray
    cross: FloatArray


@dataclass(frozen=True)
class State:
    """State of the iteration: rotated coefficients, log smoothing parameters, shape and scale."""

    beta: FloatArray
    rho: FloatArray
    theta: Theta

    def pack(self) -> FloatArray:
        """Return the state as one vector."""
        return np.concatenate([self.beta, self.rho, [self.theta.excess, self.theta.log_sigma]])

    def unpack(self, x: FloatArray, lower: FloatArray, upper: FloatArray) -> State:
        """Build a state from one vector; smoothing parameters and shape are clipped to their bounds."""
        p = len(self.beta)
        low, high = LOG_EXCESS_DF
        theta = Theta(float(np.clip(x[-2], low, high)), float(x[-1]), self.theta.min_df)
        return State(x[:p], np.clip(x[p:-2], lower, upper), theta)


@dataclass(frozen=True)
class Pass:
    """Result of one pass: next state, working model, weights of the state's components, and normal equations."""

    state: State
    working: Evaluation
    weights: FloatArray
    data: NormalEquations


class PerformanceIteration:
    """One scaled t model, ready to iterate.

    Parameters
    ----------
    data : TData
    stack : PenaltyStack
    family : ScaledT
    fixed : bool
        Whether the smoothing parameters are given and kept.
    """

    def __init__(self, data: TData, stack: PenaltyStack, family: ScaledT, fixed: bool = False) -> None:
        self.data, self.stack, self.family, self.fixed = data, stack, family, fixed
        self.free = (family.nu is None, family.sigma is None)

    def start(self, rho: FloatArray | None) -> State | None:
        """Start from a gaussian fit and its scale; returns None if that fit fails."""
        d = self.data
        normal = NormalEquations(d.gram, d.cross, float(d.y @ d.y), d.rows.n)
        first = fit_gaussian(normal, self.stack, rho if self.fixed else None, self.fixed, tolerance=1e-4)
        if first is None:
            return None
        sigma = self.family.sigma if self.family.sigma is not None else 0.8 * float(np.sqrt(first.scale))
        nu = self.family.nu if self.family.nu is not None else self.family.min_df + 2.0
        theta = Theta.from_estimates(nu, max(sigma, 1e-150), self.family.min_df)
        rho_of_t = first.rho if self.fixed else first.rho - np.log(first.scale)
        return State(self.stack.rotate(first.beta), rho_of_t, theta)

    def residual(self, state: State) -> FloatArray:
        """Response minus the predictor of a state, (n,)."""
        return np.asarray(self.data.y - self.data.rows.predictor(self.stack.restore(state.beta)))

    def advance(self, state: State, lower: FloatArray, upper: FloatArray, near: bool = False) -> Pass | None:
        """Run one pass: shape and scale, working response, smoothing parameters, coefficients.

        With `near`, a short step of the smoothing parameters is taken without evaluating the score. Returns None if the working model is
        not identifiable.
        """
        d = self.data
        residual = self.residual(state)
        theta = fit_theta(residual, state.theta, self.free, steps=3) if any(self.free) else state.theta
        c = self.family.expected_weight(theta.nu, theta.sigma)
        g = self.family.score(residual, theta.nu, theta.sigma)
        gram = c * d.gram
        cross = gram @ state.beta + self.stack.rotate(d.rows.rmatvec(g))
        z = g / c - residual + d.y
        normal = NormalEquations(gram, cross, c * float(z @ z), d.rows.n)
        current = gaussian_score(normal, self.stack, state.rho, 1.0, derivatives=not self.fixed)
        if current is None:
            return None
        diagonal = 1 / np.sqrt(np.maximum(np.diag(current.factor.inverse), 1e-300))
        ends = np.sqrt(d.rows.n) * np.array([1.0 if theta.nu < 50 else 0.1, 1.0])
        if theta.at_bound:
            ends[0] = 0.0
        if self.fixed or not self.stack.size:
            weights = np.concatenate([diagonal, np.zeros(self.stack.size), ends])
            return Pass(State(current.beta, state.rho, theta), current, weights, normal)
        working, rho = self._smooth(normal, current, state.rho, lower, upper, near)
        curvature = np.sqrt(np.maximum(np.diag(current.hessian), 1e-8))
        return Pass(
            State(working.beta, rho, theta), working, np.concatenate([diagonal, curvature, ends]), normal
        )

    def _smooth(
        self,
        normal: NormalEquations,
        current: Evaluation,
        rho: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        near: bool,
    ) -> tuple[Evaluation, FloatArray]:
        """Take one Newton step of the working model's score, halved until the score falls; a short step if `near` is taken as is."""
        step = newton_step(current.gradient, current.hessian, rho, lower, upper)
        if near and float(np.abs(step).max()) < SHORT:
            return current, rho + step  # the coefficients follow in the next pass
        for _ in range(12):
            trial = gaussian_score(normal, self.stack, rho + step, 1.0, derivatives=False)
            if trial is not None and trial.value <= current.value + 1e-9 * (1 + abs(current.value)):
                return trial, rho + step
            step = step / 2
        return current, rho

    def run(self, start: State, tolerance: float = 1e-3, max_iter: int = 400) -> Solution | None:
        """Iterate to convergence.

        Parameters
        ----------
        start : State
        tolerance : float
            Largest change in one pass, in posterior standard deviations.
        max_iter : int
            Largest number of passes.

        Returns
        -------
        Solution or None
            None if the model is not identifiable.
        """
        c = self.family.expected_weight(start.theta.nu, start.theta.sigma)
        lower, upper = bounds(c * np.diag(self.data.gram), self.stack)
        mixing = Mixing(close=CLOSE * float(np.sqrt(self.data.rows.n / self.data.rows.p)))
        state, done, count, largest_change = start, False, 0, np.inf
        result: Pass | None = None
        while not done and count < max_iter:
            count += 1
            trial = self.advance(state, lower, upper, largest_change <= 4 * mixing.close)
            if trial is None:
                return None
            result = trial
            x, fx = state.pack(), trial.state.pack()
            change = trial.weights * (fx - x)
            largest_change = float(np.abs(change).max(initial=0.0))
            done = largest_change <= tolerance
            state = trial.state.unpack(mixing.next(x, fx, trial.weights), lower, upper)
        return self._solution(result, done, count, tolerance) if result is not None else None

    def _solution(self, last: Pass, done: bool, iterations: int, tolerance: float) -> Solution:
        """Solution at the last pass, with the score and its derivatives computed once more if they can be."""
        message = (
            f"the last pass moved nothing by more than {tolerance:g} standard errors"
            if done
            else f"{iterations} accelerated passes did not settle; a larger max_iter or method='REML' may"
        )
        final = gaussian_score(last.data, self.stack, last.state.rho, 1.0)
        working = last.working if final is None else final
        return Solution(
            beta=self.stack.restore(working.beta),
            rho=last.state.rho,
            scale=1.0,
            score=working.value,
            covariance=self.stack.restored_both(working.factor.inverse),
            information=self.stack.restored_both(last.data.gram),
            converged=done,
            n_iter=iterations,
            message=message,
            gradient=working.gradient,
            hessian=np.zeros((0, 0)) if self.fixed else working.hessian,
            nu=last.state.theta.nu if self.family.nu is None else self.family.nu,
            sigma=last.state.theta.sigma,
        )


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
        if self.points and (size > 2 * self.best or largest > self.close):
            best_image = self.best_image  # mixing made the change larger: plain passes from the best point
            self._forget()
            self.plain = 2
            return best_image
        growing = before is not None and size > float(np.linalg.norm(before))
        if largest > self.close or self.plain > 0 or (not self.points and growing):
            self.plain -= 1
            # for small residuals the observed weight is (nu + 3) / nu times the expected one: at nu = 3 a pass goes
            # twice as far as it should, so half of it is taken
            overshoots = before is not None and float(before @ change) < -0.5 * size * float(
                np.linalg.norm(before)
            )
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
