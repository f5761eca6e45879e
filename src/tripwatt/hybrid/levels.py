"""Weights that cars share and weights of their own: levels, their priors, and their posterior given trips.

The residual energy of a trip is linear in known features `x_l` with weights `d_l` of every level that the trip belongs to: all cars, its
car model, its vehicle, its driver; or the correction of another car, what this car adds to it, and its physical parameters,

    y_i = sum_l x_il' d_l + e_i,   d_l ~ N(s_l m_l, s_l^2 P_l),   e_i ~ N(0, lambda n_i + m_i),

with priors `m_l`, `P_l` that are known and scales `s_l`, `lambda` that are not (Gelman et al., Bayesian Data Analysis, chapters 5 and 15).
The posterior has two forms, which give the same numbers:

- `Mixture`, for few trips and many weights: one covariance of all trips, with the scales integrated over a grid. A donor car and its
  target have it, because two cars carry no information about how much cars differ.
- `group_posterior`, for many trips and few weights: sums of trips (`Sums`) that add up, one pass to the root of the tree of groups and
  one back, with the scales at the maximum of their marginal likelihood (`fit_scales`). A fleet has it, and several donors have.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray

_NEGLIGIBLE: Final = 1e-4
"""Options of a smaller posterior probability are left out of the posterior of the weights."""


@dataclass(frozen=True, eq=False)
class Level:
    """Weights of one level: what each trip takes of them, and their prior at a scale of 1.

    Attributes
    ----------
    features : ndarray, shape (trips, weights)
    prior : ndarray, shape (weights,) or (weights, any)
        Variances of independent weights, or `L` with ``L @ L.T`` the covariance of dependent ones.
    mean : ndarray or None, shape (weights,)
        None for zeros.
    """

    features: FloatArray
    prior: FloatArray
    mean: FloatArray | None = None

    def covariance_times(self, X: FloatArray) -> FloatArray:
        """Prior covariance of the weights times a matrix."""
        if self.prior.ndim == 1:
            return self.prior[:, None] * X
        return np.asarray(self.prior @ (self.prior.T @ X))

    @property
    def usual(self) -> FloatArray:
        """Prior mean, shape (weights,)."""
        return np.zeros(self.features.shape[1]) if self.mean is None else self.mean

    @cached_property
    def cross(self) -> FloatArray:
        """Prior covariance of weights and trips, shape (weights, trips)."""
        return self.covariance_times(self.features.T)


@dataclass(frozen=True, eq=False)
class Mixture:
    """Levels with a grid of scales, and trips: the posterior of the weights and of the options of the grid.

    Attributes
    ----------
    levels : tuple of Level
        Independent of each other.
    scales : ndarray, shape (options, levels)
        Factor of the mean and of the standard deviation of each level.
    noise : ndarray, shape (options,)
        Factor of the usual variances.
    usual_wh2, measured_wh2 : ndarray, shape (trips,)
        Usual variance of each trip, and that of the measurement of its energy.
    residual_wh : ndarray, shape (trips,)

    Examples
    --------
    >>> flat = Level(np.ones((2, 1)), np.ones(1))
    >>> given = Mixture((flat,), np.ones((1, 1)), np.ones(1), np.ones(2), np.zeros(2), np.array([3.0, 3.0]))
    >>> [values.round(6).tolist() for values in given.posterior()]
    [[2.0], [[0.333333]]]
    """

    levels: tuple[Level, ...]
    scales: FloatArray
    noise: FloatArray
    usual_wh2: FloatArray
    measured_wh2: FloatArray
    residual_wh: FloatArray

    def error_wh2(self, option: int) -> FloatArray:
        """Variance of each trip's measured energy given the weights, shape (trips,)."""
        return np.asarray(self.noise[option] * self.usual_wh2 + self.measured_wh2)

    @cached_property
    def _kernels(self) -> FloatArray:
        return np.array([(level.features @ level.cross).ravel() for level in self.levels])

    @cached_property
    def _centres(self) -> FloatArray:
        return np.array([level.features @ level.usual for level in self.levels])

    def before(self, option: int) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance of the trips' residual energies before any of them, without their errors."""
        scales, n = self.scales[option], len(self.residual_wh)
        return scales @ self._centres, (scales**2 @ self._kernels).reshape(n, n)

    def _each(self) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        for option in range(len(self.noise)):
            yield option, *self.before(option)

    @cached_property
    def weights(self) -> FloatArray:
        """Posterior probability of each option, shape (options,); all are alike before the trips."""
        y = self.residual_wh
        logs = np.zeros(len(self.noise))
        if len(y):
            for option, mean, kernel in self._each():
                logs[option] = log_density(y - mean, kernel + np.diag(self.error_wh2(option)))
        weights = np.exp(logs - logs.max())
        return np.asarray(weights / weights.sum())

    def posterior(self) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance of the weights of all levels, one after the other, integrated over the options.

        O(options x trips^3 + trips x weights^2 x options that count).
        """
        counting = np.flatnonzero(self.weights >= _NEGLIGIBLE)
        share = self.weights[counting] / self.weights[counting].sum()
        means, gains = [], []
        for option, root in zip(counting.tolist(), np.sqrt(share), strict=True):
            scales = self.scales[option]
            mean, kernel = self.before(option)
            cross = np.vstack([s**2 * level.cross for s, level in zip(scales, self.levels, strict=True)])
            usual = np.concatenate([s * level.usual for s, level in zip(scales, self.levels, strict=True)])
            # the inverse of the trips' covariance is factor @ factor.T
            factor = np.linalg.inv(np.linalg.cholesky(kernel + np.diag(self.error_wh2(option)))).T
            gain = cross @ factor
            means.append(root * (usual + gain @ (factor.T @ (self.residual_wh - mean))))
            gains.append(root * gain)
        stacked, known = np.array(means), np.hstack(gains)
        centre = np.sqrt(share) @ stacked
        covariance = stacked.T @ stacked - np.outer(centre, centre) - known @ known.T
        start = 0
        for level, square in zip(self.levels, share @ self.scales[counting] ** 2, strict=True):
            rows = slice(start, start + level.features.shape[1])
            covariance[rows, rows] += square * level.covariance_times(np.eye(level.features.shape[1]))
            start = rows.stop
        return centre, covariance

    def left_out(self) -> tuple[FloatArray, FloatArray]:
        """Mean and variance [Wh, Wh²] of each trip's residual energy given all others, without its own error.

        The options are weighted by the others as well: p(y_others) = p(y) / p(y_i | y_others). O(options x trips^3).
        """
        y = self.residual_wh
        logs, means, variances = [], [], []
        for option, mean, kernel in self._each():
            noise = self.error_wh2(option)
            covariance = kernel + np.diag(noise)
            inverse = np.linalg.inv(covariance)
            variance = 1.0 / np.diag(inverse)
            error = (inverse @ (y - mean)) * variance
            own = -0.5 * error**2 / variance - 0.5 * np.log(variance)
            logs.append(log_density(y - mean, covariance) - own)
            means.append(y - error)
            variances.append(np.maximum(variance - noise, 0.0))
        mean, variance, _ = _mixed(np.array(logs), np.array(means), np.array(variances))
        return mean, np.maximum(variance, 0.0)

    def given_draws(self, draws: IntArray, score: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Some trips given each of many draws of k other trips. O(options x draws x k^3).

        Parameters
        ----------
        draws : ndarray of int, shape (draws, k)
            The trips that are known; k may be 0.
        score : ndarray of int, shape (trips,)
            The trips to predict.

        Returns
        -------
        mean, variance : ndarray, shape (draws, trips)
            Of the measured residual energy [Wh, Wh²].
        weights : ndarray, shape (options, draws)
            Posterior probability of each option.
        """
        logs, means, variances = [], [], []
        for option, mean, kernel in self._each():
            noise = self.error_wh2(option)
            centre, variance, log = _given_draws(mean, kernel, noise, self.residual_wh, draws, score)
            logs.append(log)
            means.append(centre)
            variances.append(variance + noise[score])
        mean, variance, weights = _mixed(np.array(logs)[:, :, None], np.array(means), np.array(variances))
        return mean, np.maximum(variance, 0.0), weights[:, :, 0]


def _mixed(
    logs: FloatArray, means: FloatArray, variances: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and variance of a mixture along the first axis, and the weights of its parts from their logarithms."""
    weights = np.exp(logs - logs.max(axis=0))
    weights /= weights.sum(axis=0)
    mean = (weights * means).sum(axis=0)
    return mean, (weights * (variances + means**2)).sum(axis=0) - mean**2, weights


def log_density(error: FloatArray, covariance: FloatArray) -> float:
    """Logarithm of a normal density without its constant."""
    factor = np.linalg.cholesky(covariance)
    z = np.linalg.solve(factor, error)
    return float(-0.5 * z @ z - np.log(np.diag(factor)).sum())


def _given_draws(
    mean: FloatArray,
    kernel: FloatArray,
    noise: FloatArray,
    residual: FloatArray,
    draws: IntArray,
    score: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and variance of the scored trips, shape (draws, trips), and log marginal likelihood of each draw."""
    k = draws.shape[1]
    inner = kernel[draws[:, :, None], draws[:, None, :]]
    inner[:, range(k), range(k)] += noise[draws]
    inverse = np.linalg.inv(np.linalg.cholesky(inner))
    z = np.einsum("dij,dj->di", inverse, (residual - mean)[draws])
    cross = np.einsum("dij,djs->dis", inverse, kernel[draws[:, :, None], score[None, None, :]])
    log_likelihood = -0.5 * (z**2).sum(axis=1) + np.log(inverse[:, range(k), range(k)]).sum(axis=1)
    return (
        mean[score] + np.einsum("dis,di->ds", cross, z),
        np.maximum(np.diag(kernel)[score] - (cross**2).sum(axis=1), 0.0),
        log_likelihood,
    )
