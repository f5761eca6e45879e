"""The residual power of one trip before departure and on the way, without the matrix of its covariance.

The process is a linear Gaussian state space with three parts: terms that are constant over the trip (a constant, and shares
of the power that is moved), drifts with an exponential covariance, and noise that is independent in every segment. Given the
measured power of segments, the precision of the drifts is a band matrix with the constants as its border (Rue and Held 2005,
section 2.4): conditioning costs O(segments). The segments to come follow from the constants and from the drifts at the last
measured segment. Readings of the state of charge give a few means over several segments; conditioning on them takes a matrix
with one row per reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, IntArray, Relaxation, changes


@dataclass(frozen=True, slots=True)
class ComponentProcess:
    """Covariance of one component's residual power.

    Attributes
    ----------
    constant_sd_w : float
        Standard deviation of the error that is constant over a trip [W].
    share_sd : float
        Standard deviation of the error as a share of the power that the component moves [1].
    drift_sd_w, drift_time_s : float
        Standard deviation [W] and correlation time [s] of the drift.
    noise : float
        Standard deviation of the independent part of each segment, divided by the component's scale of that part [1].
    onset, onset_time_s : float
        At ``t`` seconds after departure the variance of the drift is ``1 + onset² exp(-t / onset_time_s)`` times as large.
    """

    constant_sd_w: float
    share_sd: float
    drift_sd_w: float
    drift_time_s: float
    noise: float
    onset: float = 0.0
    onset_time_s: float = 1.0


@dataclass(frozen=True, eq=False)
class PowerPrior:
    """Distribution of a trip's residual power before departure, for one component or their sum; its mean is 0.

    Attributes
    ----------
    time_s : ndarray, shape (segments,)
        Middle of each segment [s].
    constant_w : ndarray, shape (segments, any)
        Loadings of independent terms of unit variance that are constant over the trip [W].
    drifts : tuple of (ndarray of shape (segments,), float)
        Terms that change slowly over the trip: a process of unit variance, its size [W] in each segment and its correlation time [s].
    new_w2 : ndarray, shape (segments,)
        Variance of the independent part of each segment [W²].
    own : int
        How many of the last terms of `constant_w` are what is unknown of the car.

    Examples
    --------
    >>> prior = PowerPrior(np.array([30.0, 90.0]), np.full((2, 1), 100.0), (), np.full(2, 400.0))
    >>> hours = np.full(2, 1.0 / 60.0)
    >>> (prior.sd_wh(hours) ** 2).round(3).tolist()
    [2.889, 11.333]
    >>> prior.times(np.eye(2)).tolist()
    [[10400.0, 10000.0], [10000.0, 10400.0]]
    >>> after = prior.measured(np.array([0]), np.array([50.0]), np.array([25.0]))
    >>> after.mean_w.round(1).tolist()
    [49.9, 48.0]
    >>> prior.averaged(np.full((1, 2), 0.5), np.array([50.0]), np.array([[25.0]])).mean_w.round(1).tolist()
    [49.9, 49.9]
    """

    time_s: FloatArray
    constant_w: FloatArray
    drifts: tuple[tuple[FloatArray, float], ...]
    new_w2: FloatArray
    own: int = 0

    @classmethod
    def from_components(
        cls, time_s: FloatArray, parts: list[tuple[ComponentProcess, FloatArray, FloatArray]]
    ) -> PowerPrior:
        """Make the distribution of the sum of independent components.

        Parameters
        ----------
        time_s : ndarray, shape (segments,)
            Middle of each segment [s].
        parts : list of tuple
            For each component its process, the power that it moves [W], shape (segments,), and the scale of its independent
            part in each segment [W], shape (segments,).

        Returns
        -------
        PowerPrior
            Distribution of the sum.

        Examples
        --------
        >>> part = ComponentProcess(constant_sd_w=100.0, share_sd=0.0, drift_sd_w=0.0, drift_time_s=600.0, noise=0.0)
        >>> PowerPrior.from_components(np.array([30.0, 90.0]), [(part, np.zeros(2), np.zeros(2))]).constant_w.tolist()
        [[100.0], [100.0]]
        """
        n = len(time_s)
        constant = float(np.sqrt(sum(part.constant_sd_w**2 for part, _, _ in parts)))
        columns = [np.full(n, constant)] if constant > 0.0 else []
        columns += [part.share_sd * size for part, size, _ in parts if part.share_sd > 0.0]
        drifts = tuple(
            (
                part.drift_sd_w * np.sqrt(1.0 + part.onset**2 * np.exp(-time_s / part.onset_time_s)),
                part.drift_time_s,
            )
            for part, _, _ in parts
            if part.drift_sd_w > 0.0
        )
        new = sum(((part.noise * noise) ** 2 for part, _, noise in parts), np.zeros(n))
        return cls(time_s, np.column_stack(columns) if columns else np.zeros((n, 0)), drifts, new)

    def with_own(self, share: float, own_w: FloatArray) -> PowerPrior:
        """Make the distribution of a trip of which more is unknown, since the car is.

        Parameters
        ----------
        share : float
            Factor of the present standard deviations [1].
        own_w : ndarray, shape (segments, any)
            Loadings of independent terms of unit variance that are unknown of the car [W].

        Returns
        -------
        PowerPrior
            Distribution with these terms last.

        Examples
        --------
        >>> prior = PowerPrior(np.array([30.0, 90.0]), np.full((2, 1), 100.0), (), np.full(2, 400.0))
        >>> prior.with_own(0.5, np.full((2, 1), 30.0)).times(np.eye(2)).tolist()
        [[3500.0, 3400.0], [3400.0, 3500.0]]
        """
        constant_w = np.column_stack([share * self.constant_w, own_w])
        drifts = tuple((share * size_w, fading_s) for size_w, fading_s in self.drifts)
        return PowerPrior(self.time_s, constant_w, drifts, share**2 * self.new_w2, own_w.shape[1])

    @property
    def mean_w(self) -> FloatArray:
        """Zeros, shape (segments,)."""
        return np.zeros(len(self.time_s))

    @property
    def covariance_w2(self) -> FloatArray:
        """See `ResidualPower.covariance_w2`. O(segments²)."""
        return self.times(np.eye(len(self.time_s)))

    def sd_wh(self, hours: FloatArray) -> FloatArray:
        """Compute the standard deviation of the cumulative residual energy at the end of each segment. O(segments).

        Parameters
        ----------
        hours : ndarray, shape (segments,)
            Duration over which the power of each segment is added up [h].

        Returns
        -------
        ndarray, shape (segments,)
            Standard deviation [Wh].
        """
        constant = np.cumsum(hours[:, None] * self.constant_w, axis=0)
        variance = np.sum(constant**2, axis=1) + np.cumsum(hours**2 * self.new_w2)
        for size_w, fading_s in self.drifts:
            variance += drift_variance(self.time_s, hours * size_w, fading_s)
        return np.asarray(np.sqrt(variance))

    def times(self, columns: FloatArray) -> FloatArray:
        """Multiply the covariance of the segments with each column. O(segments x columns).

        Parameters
        ----------
        columns : ndarray, shape (segments, columns)
            Factors.

        Returns
        -------
        ndarray, shape (segments, columns)
            Covariance [W²] times `columns`.
        """
        product = self.constant_w @ (self.constant_w.T @ columns) + self.new_w2[:, None] * columns
        for size_w, fading_s in self.drifts:
            inner = size_w[:, None] * columns
            both = fading_sums(self.time_s, inner, fading_s) - inner
            both += fading_sums(-self.time_s[::-1], inner[::-1], fading_s)[::-1]
            product += size_w[:, None] * both
        return np.asarray(product)

    def measured(self, seen: IntArray, power_w: FloatArray, variance_w2: FloatArray) -> MeasuredPower:
        """Condition the distribution on the measured power of some segments. O(segments).

        Parameters
        ----------
        seen : ndarray, shape (measured,)
            Indices of the measured segments, ascending, at least one.
        power_w : ndarray, shape (measured,)
            Measured residual power [W].
        variance_w2 : ndarray, shape (measured,)
            Variance of the error of each measurement [W²].

        Returns
        -------
        MeasuredPower
            The distribution after the measurements.
        """
        n, J, last = len(self.time_s), len(self.drifts), int(seen[-1])
        is_seen = np.zeros(n, dtype=bool)
        is_seen[seen] = True
        error_w2, observed = np.zeros((2, n))
        error_w2[seen] = variance_w2
        observed[seen] = power_w
        weight = np.where(is_seen, 1.0 / np.where(is_seen, self.new_w2 + error_w2, 1.0), 0.0)[: last + 1]
        S = self.constant_w[: last + 1]
        sizes = np.array([size_w[: last + 1] for size_w, _ in self.drifts]).reshape(J, last + 1).T
        solve = _band_solver(self, sizes, weight)
        border = (sizes[:, :, None] * (weight[:, None] * S)[:, None, :]).reshape((last + 1) * J, S.shape[1])
        X = solve(border)
        corner = np.eye(S.shape[1]) + S.T @ (weight[:, None] * S) - border.T @ X
        covariance = np.asarray(np.linalg.inv(corner))
        weighted = weight * observed[: last + 1]
        b = (sizes * weighted[:, None]).reshape(-1)
        constants = covariance @ (S.T @ weighted - X.T @ b)
        drift_values = (solve(b[:, None])[:, 0] - X @ constants).reshape(last + 1, J)
        mean = self.constant_w @ constants
        mean[: last + 1] += np.sum(sizes * drift_values, axis=1)
        mean[: last + 1] += self.new_w2[: last + 1] * weight * (observed - mean)[: last + 1]
        for drift, value in zip(self.drifts, drift_values[last], strict=True):
            mean[last + 1 :] += _carried(self.time_s, drift, last)[last + 1 :] * value
        return MeasuredPower(self, is_seen, error_w2, mean, constants, solve, X, covariance)

    def averaged(self, weights: FloatArray, power_w: FloatArray, errors_w2: FloatArray) -> AveragedPower:
        """Condition the distribution on measured means over segments. O(segments x readings²).

        Parameters
        ----------
        weights : ndarray, shape (readings, segments)
            Weights of the segments in each reading, which is ``weights @ residual power`` plus an error.
        power_w : ndarray, shape (readings,)
            Measured means of residual power [W].
        errors_w2 : ndarray, shape (readings, readings)
            Covariance of the errors of the readings [W²].

        Returns
        -------
        AveragedPower
            The distribution after the readings.
        """
        from scipy.linalg import solve_triangular

        cross = self.times(np.ascontiguousarray(weights.T))
        total = weights @ cross + errors_w2
        lower = np.linalg.cholesky(total)
        factor = solve_triangular(lower, cross.T, lower=True).T
        white = solve_triangular(lower, power_w, lower=True)
        constants = (weights @ self.constant_w).T @ solve_triangular(lower, white, lower=True, trans=1)
        return AveragedPower(self, factor @ white, constants, factor)


def fading_sums(time_s: FloatArray, values: FloatArray, fading_s: float) -> FloatArray:
    """``sum over i <= k of values[i] exp(-(t[k] - t[i]) / T)`` for each k, along the first axis; T is `fading_s`. O(values)."""
    fading, sums = np.exp(-np.diff(time_s) / fading_s), values.copy()
    for k, kept in enumerate(fading.tolist()):
        sums[k + 1] += kept * sums[k]
    return sums


def drift_variance(time_s: FloatArray, weight: FloatArray, fading_s: float) -> FloatArray:
    """Variance of the cumulative sum of `weight` times a drift of unit variance, at each segment. O(segments).

    Segment k adds ``w[k] (2 c[k] - w[k])``, where ``c[k]`` is the covariance of the sum up to k and the drift at k.
    """
    # as `fading_sums` without a loop, but not to the last digit, on which the drawn samples depend
    c = Relaxation(changes(time_s) / fading_s, adds=True).solve(0.0, weight)
    return np.asarray(np.cumsum(weight * (2.0 * c - weight)))


@dataclass(frozen=True, eq=False)
class MeasuredPower:
    """Distribution of the residual power after the power of some segments was measured.

    `constants` is the mean of the constants. The unknowns are the constants and, up to the last measured segment, the drifts. `solve` solves with the band of the drifts'
    precision, `X` is its solution for the border, and `constant_covariance` is the posterior covariance of the constants.
    """

    prior: PowerPrior
    seen: BoolArray
    variance_w2: FloatArray
    mean_w: FloatArray
    constants: FloatArray
    solve: Callable[[FloatArray], FloatArray]
    X: FloatArray
    constant_covariance: FloatArray

    @property
    def covariance_w2(self) -> FloatArray:
        """See `ResidualPower.covariance_w2`. O(segments³)."""
        before = self.prior.covariance_w2
        cross, error_w2 = before[:, self.seen], np.diag(self.variance_w2[self.seen])
        return np.asarray(before - cross @ np.linalg.solve(cross[self.seen] + error_w2, cross.T))

    def sd_wh(self, hours: FloatArray) -> FloatArray:
        """See `ResidualPower.sd_wh`. O(segments x (1 + past segments with hours that count))."""
        prior, J = self.prior, len(self.prior.drifts)
        last = int(np.flatnonzero(self.seen)[-1])
        # a segment with less than this left was measured as a whole
        hours = np.where(hours > 1e-9, hours, 0.0)
        known = np.where(self.seen, self.variance_w2 / (prior.new_w2 + self.variance_w2), 1.0)
        behind = np.flatnonzero(hours[: last + 1])
        # linear functions of constants and drifts: segments behind, the constants, and the drifts at the last segment
        m, k = len(behind), prior.constant_w.shape[1]
        local = np.zeros((len(self.X), m + k + J))
        for j, (size_w, _) in enumerate(prior.drifts):
            local[behind * J + j, np.arange(m)] = known[behind] * size_w[behind]
            local[last * J + j, m + k + j] = 1.0
        free = np.concatenate([known[behind, None] * prior.constant_w[behind], np.eye(k + J, k)])
        free -= local.T @ self.X
        inner = local.T @ self.solve(local) + free @ self.constant_covariance @ free.T
        variance = np.zeros(len(hours))
        at = hours[behind]
        scaled = inner[:m, :m] * np.outer(at, at)
        variance[behind] = np.diff(np.diag(np.cumsum(np.cumsum(scaled, axis=0), axis=1)), prepend=0.0)
        variance = np.cumsum(variance)
        # ahead: sums over segments of the power by the constants and the last drifts
        tail = np.arange(len(hours)) > last
        carried = (_carried(prior.time_s, drift, last) for drift in prior.drifts)
        power_w = np.column_stack([prior.constant_w, *carried])  # by unit constants and unit last drifts
        reach = np.cumsum(np.where(tail, hours, 0.0)[:, None] * power_w, axis=0)
        variance += np.sum(reach @ inner[m:, m:] * reach, axis=1) + 2.0 * reach @ (at @ inner[:m, m:])
        for j, (size_w, fading_s) in enumerate(prior.drifts):
            weight = np.where(tail, hours, 0.0) * size_w
            variance += drift_variance(prior.time_s, weight, fading_s) - reach[:, k + j] ** 2
        variance += np.cumsum(hours**2 * prior.new_w2 * known)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


@dataclass(frozen=True, eq=False)
class AveragedPower:
    """Distribution of the residual power after a few means over segments were measured.

    Attributes
    ----------
    prior : PowerPrior
        Distribution before the measurements.
    mean_w : ndarray, shape (segments,)
        Mean after the measurements [W].
    constants : ndarray, shape (terms,)
        Mean of the terms that are constant over the trip.
    factor_w : ndarray, shape (segments, readings)
        The covariance is that of the prior minus ``factor_w @ factor_w.T``.
    """

    prior: PowerPrior
    mean_w: FloatArray
    constants: FloatArray
    factor_w: FloatArray

    @property
    def covariance_w2(self) -> FloatArray:
        """See `ResidualPower.covariance_w2`. O(segments²)."""
        return np.asarray(self.prior.covariance_w2 - self.factor_w @ self.factor_w.T)

    def sd_wh(self, hours: FloatArray) -> FloatArray:
        """See `ResidualPower.sd_wh`. O(segments x readings)."""
        known = np.cumsum(hours[:, None] * self.factor_w, axis=0)
        variance = self.prior.sd_wh(hours) ** 2 - np.sum(known**2, axis=1)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


@dataclass(frozen=True, eq=False)
class PowerSum:
    """Distribution of the sum of independent residual powers, with a mean that is given.

    Attributes
    ----------
    parts : tuple of ResidualPower
    mean_w : ndarray, shape (segments,)
        Mean of the sum [W]; it may differ from the sum of the means.
    """

    parts: tuple[ResidualPower, ...]
    mean_w: FloatArray
    _known_wh: dict[bytes, FloatArray] = field(default_factory=dict, init=False)

    @property
    def covariance_w2(self) -> FloatArray:
        """See `ResidualPower.covariance_w2`; the covariances of the parts add up."""
        return np.asarray(np.sum([part.covariance_w2 for part in self.parts], axis=0))

    def sd_wh(self, hours: FloatArray) -> FloatArray:
        """See `ResidualPower.sd_wh`; the variances of the parts add up. Computed once for the same hours."""
        key = hours.tobytes()
        if key not in self._known_wh:
            self._known_wh[key] = np.linalg.norm([part.sd_wh(hours) for part in self.parts], axis=0)
        return self._known_wh[key]


ResidualPower = PowerPrior | MeasuredPower | AveragedPower | PowerSum
"""Distribution of a trip's residual power: before departure, and after measurements. Each has the mean `mean_w` of each segment [W],
their covariance `covariance_w2` [W²], and `sd_wh(hours)`, the standard deviation of the cumulative energy [Wh]."""


def own_mean_w(posterior: ResidualPower) -> FloatArray | float:
    """The part of `mean_w` by what was learned of the car [W], shape (segments,); 0 if the prior has no terms of the car.

    Parameters
    ----------
    posterior : ResidualPower

    Examples
    --------
    >>> prior = PowerPrior(np.array([30.0, 90.0]), np.full((2, 1), 30.0), (), np.full(2, 400.0))
    >>> after = prior.with_own(1.0, np.full((2, 1), 40.0)).measured(np.array([0]), np.array([29.0]), np.zeros(1))
    >>> own_mean_w(after).round(6).tolist(), after.mean_w.round(6).tolist(), own_mean_w(prior)
    ([16.0, 16.0], [29.0, 25.0], 0.0)
    """
    if isinstance(posterior, PowerPrior | PowerSum) or not posterior.prior.own:
        return 0.0
    own = slice(-posterior.prior.own, None)
    return np.asarray(posterior.prior.constant_w[:, own] @ posterior.constants[own])


def _carried(time_s: FloatArray, drift: tuple[FloatArray, float], last: int) -> FloatArray:
    """Expected power of each segment if the drift is 1 at the last measured segment [W]."""
    size_w, fading_s = drift
    return np.asarray(size_w * np.exp(-np.maximum(time_s - time_s[last], 0.0) / fading_s))


def _band_solver(
    prior: PowerPrior, sizes: FloatArray, weight: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """Return a solver for the precision of the drifts, ordered by segment, given measurements of weight 1 / variance."""
    from scipy.linalg import cho_solve_banded, cholesky_banded

    n, J = sizes.shape
    if not J:
        return lambda columns: columns
    band = np.zeros((J + 1, n * J))
    step = np.diff(prior.time_s[:n])
    for j, (_, fading_s) in enumerate(prior.drifts):
        rho = np.exp(-step / fading_s)
        free = -1.0 / np.expm1(-2.0 * step / fading_s)  # 1 / (1 - rho²)
        diagonal = np.ones(n)
        diagonal[1:] += free - 1.0
        diagonal[:-1] += rho**2 * free
        band[0, j::J] = diagonal + weight * sizes[:, j] ** 2
        band[J, j : (n - 1) * J : J] = -rho * free
        for other in range(j + 1, J):
            band[other - j, j::J] = weight * sizes[:, j] * sizes[:, other]
    factor = cholesky_banded(band, lower=True, check_finite=False)
    return lambda columns: np.asarray(cho_solve_banded((factor, True), columns, check_finite=False))
