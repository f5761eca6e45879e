"""The residual power of a trip as a Gaussian process over its blocks, shrunk by what is measured on the way.

The residual power of block t is ``r_t = sum_j u_j a_tj + c_t + d_t + w_t``: whole-trip effects `u` (driver, wind,
load, climate), each 0 for a new trip and known better with every block that was driven; a part `c` that drifts
whatever the car does (climate control, auxiliaries), with an exponential covariance; `d`, the change of an energy
that comes back, because a logged elevation errs by a bounded height: the energy itself has the exponential
covariance, so that what was taken too much on one block is expected back on later ones; and `w`, new in every block
in proportion to the power that is moved. At a standstill only `c` and the constant effect are left: that is how
climate is told from driving. The energy to come is a sum over blocks, so its variance counts the correlation along
the trip and is never a root of summed variances.

Conditioning is the textbook formula for a Gaussian vector of which linear functions were observed (Rasmussen and
Williams 2006, section 2.2): it is the same for measured power, for missing or late samples, and for a state of
charge read now and then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.trips import FloatArray
from tripwatt.units import SECONDS_PER_HOUR

_LOG_BOUND: Final = 4.6  # parameters stay within a factor of 100 of their start
_CLIMATE_TIME_S: Final = 900.0
_STORED_WH: Final = 40.0
_STORED_TIME_S: Final = 200.0


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
    doubt_wh : float
        Standard deviation of what the mean model itself does not know of the trip's energy [Wh]. It widens the
        interval; a started trip says nothing about it, so it is no part of the process.
    """

    time_s: FloatArray
    step_s: FloatArray
    loadings: FloatArray
    spread_w: FloatArray
    doubt_wh: float

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, eq=False)
class ResidualProcess:
    """Covariance of the residual power.

    Attributes
    ----------
    effect_sd : ndarray, shape (effects,)
        Standard deviation of each whole-trip effect.
    climate_sd_w : float
        Standard deviation of what drifts whatever the car does [W].
    climate_time_s : float
        Its correlation time [s].
    stored_sd_wh : float
        Standard deviation of the energy that comes back [Wh].
    stored_time_s : float
        Its correlation time [s].
    noise_factor : float
        Standard deviation of what is new in each block, over `Blocks.spread_w`.
    """

    effect_sd: FloatArray
    climate_sd_w: float
    climate_time_s: float
    stored_sd_wh: float
    stored_time_s: float
    noise_factor: float

    def covariance(self, blocks: Blocks) -> FloatArray:
        """Covariance of the residual power [W²], shape (blocks, blocks)."""
        effects = blocks.loadings * self.effect_sd
        lag = np.abs(blocks.time_s[:, None] - blocks.time_s[None, :])
        covariance = effects @ effects.T + self.climate_sd_w**2 * np.exp(-lag / self.climate_time_s)
        edges = np.concatenate(([0.0], np.cumsum(blocks.step_s)))
        stored = np.exp(-np.abs(edges[:, None] - edges[None, :]) / self.stored_time_s)
        hours = blocks.step_s / SECONDS_PER_HOUR
        covariance += self.stored_sd_wh**2 * _increments(stored) / np.outer(hours, hours)
        covariance[np.diag_indices(len(blocks))] += (self.noise_factor * blocks.spread_w) ** 2
        return np.asarray(covariance)

    def total_score(self, blocks: Blocks, residual_w: FloatArray) -> float:
        """Error of a trip's energy over its standard deviation before departure."""
        hours = blocks.step_s / SECONDS_PER_HOUR
        variance = hours @ self.covariance(blocks) @ hours + blocks.doubt_wh**2
        return float(hours @ residual_w / np.sqrt(variance))


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
        hours = step_s / SECONDS_PER_HOUR
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

    Blocks are merged in pairs and all trips are solved at once, by exact gradients. O(trips x blocks^3) a step.

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

    batch = _Batch.of([_merged(blocks, residual) for blocks, residual in trips])
    noise = float(np.sqrt(np.mean(batch.residual[batch.real] ** 2 / batch.spread[batch.real] ** 2))) + 1e-9
    size = float(np.sqrt(np.mean(batch.residual[batch.real] ** 2))) + 1e-9
    start = np.concatenate(
        [np.log(start_sd), np.log([0.2 * size, _CLIMATE_TIME_S, _STORED_WH, _STORED_TIME_S, noise])]
    )

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = batch.cost(np.exp(logs), effects)
        # a weak pull to the start keeps an effect that no trip shows from running off to 0
        pull = (logs - start) / 2.0
        return value + 0.5 * float(pull @ pull), gradient + pull / 2.0

    bounds = [(value - _LOG_BOUND, value + _LOG_BOUND) for value in start]
    found = np.exp(
        minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60}).x
    )
    return ResidualProcess(found[:effects], *map(float, found[effects:]))


def _merged(blocks: Blocks, residual_w: FloatArray) -> tuple[Blocks, FloatArray]:
    """Two blocks in one: means by time; the noise of a mean is that of independent parts."""
    start = np.arange(0, len(blocks), 2)
    step = np.add.reduceat(blocks.step_s, start)
    share = blocks.step_s / np.repeat(step, np.diff(np.append(start, len(blocks))))

    def mean(values: FloatArray) -> FloatArray:
        weighted = values * (share if values.ndim == 1 else share[:, None])
        return np.asarray(np.add.reduceat(weighted, start, axis=0))

    spread = np.sqrt(np.add.reduceat((share * blocks.spread_w) ** 2, start))
    merged = Blocks(mean(blocks.time_s), step, mean(blocks.loadings), spread, blocks.doubt_wh)
    return merged, mean(residual_w)


def _increments(kernel: FloatArray) -> FloatArray:
    """Covariance of the increments between edges, from that of the values at the edges (last two axes)."""
    return np.asarray(np.diff(np.diff(kernel, axis=-1), axis=-2))


@dataclass(frozen=True, eq=False)
class _Batch:
    """Trips side by side, shorter ones filled up with blocks of their own that say nothing."""

    real: npt.NDArray[np.bool_]
    residual: FloatArray
    loadings: FloatArray
    lag: FloatArray
    edge_lag: FloatArray
    per_hour2: FloatArray
    spread: FloatArray

    @classmethod
    def of(cls, trips: Sequence[tuple[Blocks, FloatArray]]) -> _Batch:
        n, m = len(trips), max(len(blocks) for blocks, _ in trips)
        real = np.zeros((n, m), dtype=bool)
        residual, spread, time = np.zeros((n, m)), np.zeros((n, m)), np.zeros((n, m))
        loadings = np.zeros((n, m, trips[0][0].loadings.shape[1]))
        hours, edges = np.full((n, m), np.inf), np.zeros((n, m + 1))
        for i, (blocks, left) in enumerate(trips):
            k = len(blocks)
            real[i, :k], residual[i, :k], spread[i, :k], time[i, :k] = (
                True,
                left,
                blocks.spread_w,
                blocks.time_s,
            )
            loadings[i, :k] = blocks.loadings
            hours[i, :k] = blocks.step_s / SECONDS_PER_HOUR
            edges[i, 1 : k + 1] = np.cumsum(blocks.step_s)
            edges[i, k + 1 :] = edges[i, k]
        lag = np.abs(time[:, :, None] - time[:, None, :])
        lag[~(real[:, :, None] & real[:, None, :])] = np.inf
        edge_lag = np.abs(edges[:, :, None] - edges[:, None, :])
        per_hour2 = 1.0 / (hours[:, :, None] * hours[:, None, :])
        return cls(real, residual, loadings, lag, edge_lag, per_hour2, spread)

    def cost(self, values: FloatArray, effects: int) -> tuple[float, FloatArray]:
        """Negative log likelihood but for a constant, and its gradient by the logarithms of the parameters."""
        sd = values[:effects]
        climate, climate_time, stored_sd, stored_time, noise = values[effects:]
        scaled = self.loadings * sd
        slow = climate**2 * np.exp(-self.lag / climate_time)
        at_edges = stored_sd**2 * np.exp(-self.edge_lag / stored_time)
        stored = _increments(at_edges) * self.per_hour2
        covariance = scaled @ scaled.transpose(0, 2, 1) + slow + stored
        diagonal = np.arange(self.real.shape[1])
        own = np.where(self.real, (noise * self.spread) ** 2, 1.0)
        covariance[:, diagonal, diagonal] += own
        factor = np.linalg.cholesky(covariance)
        inverse = np.linalg.inv(covariance)
        alpha = (inverse @ self.residual[:, :, None])[:, :, 0]
        log_det = np.log(factor[:, diagonal, diagonal]).sum()
        by_effect = np.einsum("tij,tik,tkj->j", scaled, inverse, scaled, optimize=True)
        by_effect -= (np.einsum("ti,tij->tj", alpha, scaled) ** 2).sum(axis=0)
        inner = inverse - alpha[:, :, None] * alpha[:, None, :]
        finite = np.where(np.isfinite(self.lag), self.lag, 0.0)
        rest = [
            np.sum(inner * slow),
            0.5 * np.sum(inner * slow * finite) / climate_time,
            np.sum(inner * stored),
            0.5 * np.sum(inner * _increments(at_edges * self.edge_lag) * self.per_hour2) / stored_time,
            np.sum(inner[:, diagonal, diagonal] * np.where(self.real, own, 0.0)),
        ]
        value = 0.5 * float(np.sum(alpha * self.residual)) + float(log_det)
        return value, np.concatenate([by_effect, rest])
