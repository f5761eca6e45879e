"""The residual power of a trip as a Gaussian process over its blocks, shrunk by what is measured on the way.

The residual power of block t is ``r_t = sum_j u_j a_tj + o_t + w_t``: whole-trip effects `u` (driver, wind, load,
climate), each 0 for a new trip and known better with every block that was driven; a slowly varying part `o`
(exponential covariance) and a part `w` that is new in every block. The energy that is left is a sum over blocks, so
its variance counts the correlation along the trip and is never a root of summed variances.

Conditioning is the textbook formula for a Gaussian vector of which linear functions were observed (Rasmussen and
Williams 2006, section 2.2): it is the same for measured power, for missing or late samples, and for a state of
charge read now and then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.trips import FloatArray

_LOG_BOUND: Final = 4.6  # parameters stay within a factor of 100 of their start


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of one trip, as the process sees them.

    Attributes
    ----------
    time_s : ndarray, shape (blocks,)
        Middle of each block.
    step_s : ndarray, shape (blocks,)
        Length of each block.
    loadings : ndarray, shape (blocks, effects)
        Power [W] by which each whole-trip effect of size 1 changes the block.
    spread_w : ndarray, shape (blocks,)
        Scale [W] of what is new in every block, relative to the process's own factor.
    doubt_w : ndarray, shape (blocks, any)
        Factor of the covariance of what the mean model itself does not know [W].
    """

    time_s: FloatArray
    step_s: FloatArray
    loadings: FloatArray
    spread_w: FloatArray
    doubt_w: FloatArray

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, eq=False)
class ResidualProcess:
    """Covariance of the residual power.

    Attributes
    ----------
    effect_sd : ndarray, shape (effects,)
        Standard deviation of each whole-trip effect.
    slow_sd_w : float
        Standard deviation of the slowly varying part [W].
    slow_time_s : float
        Its correlation time [s].
    noise_factor : float
        Standard deviation of what is new in each block, over `Blocks.spread_w`.
    """

    effect_sd: FloatArray
    slow_sd_w: float
    slow_time_s: float
    noise_factor: float

    def covariance(self, blocks: Blocks) -> FloatArray:
        """Covariance of the residual power [W²], shape (blocks, blocks)."""
        effects = blocks.loadings * self.effect_sd
        lag = np.abs(blocks.time_s[:, None] - blocks.time_s[None, :])
        known = np.concatenate([effects, blocks.doubt_w], axis=1)
        covariance = known @ known.T + self.slow_sd_w**2 * np.exp(-lag / self.slow_time_s)
        covariance[np.diag_indices(len(blocks))] += (self.noise_factor * blocks.spread_w) ** 2
        return np.asarray(covariance)

    def log_likelihood(self, blocks: Blocks, residual_w: FloatArray) -> float:
        """Log density of the residual power of one trip. O(blocks^3)."""
        factor = np.linalg.cholesky(self.covariance(blocks))
        white = np.linalg.solve(factor, residual_w)
        return float(
            -0.5 * white @ white - np.log(np.diag(factor)).sum() - 0.5 * len(blocks) * np.log(2 * np.pi)
        )

    def total_score(self, blocks: Blocks, residual_w: FloatArray) -> float:
        """Error of a trip's energy over its standard deviation before departure."""
        hours = blocks.step_s / 3600.0
        return float(hours @ residual_w / np.sqrt(hours @ self.covariance(blocks) @ hours))


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of a trip's residual power, before or during it.

    Attributes
    ----------
    mean_w : ndarray, shape (blocks,)
    covariance_w2 : ndarray, shape (blocks, blocks)
    """

    mean_w: FloatArray
    covariance_w2: FloatArray

    def given(self, weights: FloatArray, observed: FloatArray, variance: FloatArray) -> Belief:
        """Belief after linear functions of the residual power were observed. O(blocks^2 x observations).

        Parameters
        ----------
        weights : ndarray, shape (observations, blocks)
            Each observation is ``weights @ residual power`` plus an independent error.
        observed : ndarray, shape (observations,)
        variance : ndarray, shape (observations,)
            Variance of the error of each observation.
        """
        if not len(observed):
            return self
        cross = self.covariance_w2 @ weights.T
        total = weights @ cross + np.diag(variance)
        scale = np.sqrt(np.diag(total))
        gain = np.linalg.solve(total / np.outer(scale, scale), (cross / scale).T).T / scale
        covariance = self.covariance_w2 - gain @ cross.T
        return Belief(
            self.mean_w + gain @ (observed - weights @ self.mean_w), 0.5 * (covariance + covariance.T)
        )

    def energy_wh(
        self, step_s: FloatArray, cumulative: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of the cumulative residual energy at the end of each block [Wh]."""
        hours = step_s / 3600.0
        mean = np.cumsum(self.mean_w * hours)
        scaled = self.covariance_w2 * np.outer(hours, hours)
        variance = np.diag(np.cumsum(np.cumsum(scaled, axis=0), axis=1))
        return mean, np.sqrt(np.maximum(variance, 0.0))


def prior(process: ResidualProcess, blocks: Blocks) -> Belief:
    """Belief before departure: mean 0."""
    return Belief(np.zeros(len(blocks)), process.covariance(blocks))


def fit_process(
    trips: Sequence[tuple[Blocks, FloatArray]], effects: int, start_sd: FloatArray
) -> ResidualProcess:
    """Maximum likelihood of the process over trips that its mean model has not seen.

    Parameters
    ----------
    trips : sequence of (Blocks, ndarray of shape (blocks,))
        Blocks and residual power [W] of each trip, held out of the model that the residual belongs to.
    effects : int
        Number of whole-trip effects.
    start_sd : ndarray, shape (effects,)
        Where the search starts for the effects' standard deviations.
    """
    from scipy.optimize import minimize

    residuals = np.concatenate([r for _, r in trips])
    spreads = np.concatenate([b.spread_w for b, _ in trips])
    start = np.concatenate(
        [np.log(start_sd), np.log([0.5 * residuals.std() + 1e-9, 300.0, (residuals / spreads).std() + 1e-9])]
    )

    def process_of(logs: FloatArray) -> ResidualProcess:
        values = np.exp(logs)
        return ResidualProcess(
            values[:effects], float(values[effects]), float(values[effects + 1]), float(values[-1])
        )

    def cost(logs: FloatArray) -> float:
        # a weak pull to the start keeps an effect that no trip shows from running off to 0
        pull = 0.5 * float(np.sum(((logs - start) / 2.0) ** 2))
        return pull - sum(process_of(logs).log_likelihood(b, r) for b, r in trips)

    bounds = [(value - _LOG_BOUND, value + _LOG_BOUND) for value in start]
    return process_of(minimize(cost, start, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60}).x)
