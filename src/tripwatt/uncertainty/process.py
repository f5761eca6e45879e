"""The residual power of a trip as a Gaussian process over its segments, in two components: driving and climate control.

The residual power of segment t is ``r_t = d_t + c_t``. Each component is ``u + v s_t + g_t z_t + w_t``: a constant `u` and
a share `v` of the power `s` that the component moves, both of the whole trip (driver, wind, load, set-point), 0 for a
new trip and known better with every segment that was driven; a drift `z` with an exponential covariance; and `w`, new in
every segment. At departure a climate control is far from its steady state, so its drift starts wider by ``g_t``. The
energy to come is a sum over segments: its variance counts the correlation along the trip and is never a root of summed
variances.

Where the log has the power of climate control, each component is fitted and updated separately. A burst of a heater
does not last, so the observed climate residual is limited.

`residual_power` conditions it on what was measured: power, with missing or late samples, or a state of charge read now and
then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.uncertainty.residual_power import ComponentProcess, PowerPrior
from tripwatt.units import SECONDS_PER_HOUR

_STARTS: Final = {
    "drive": (100.0, 0.05, 300.0, 200.0, 0.5, 0.0, 1.0),
    "climate": (200.0, 0.15, 300.0, 200.0, 50.0, 2.0, 200.0),
}
"""Where the search of each component's values starts, in the order of `ComponentProcess`."""
EXACT_W2: Final = 1.0
"""Variance of a fully measured segment's power, which keeps the system well conditioned."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of one trip, as the process takes them.

    Attributes
    ----------
    time_s : ndarray, shape (segments,)
        Middle of each segment.
    step_s : ndarray, shape (segments,)
        Length of each segment.
    moved_w : ndarray, shape (segments,)
        Power at the wheels, drawn or given back.
    climate_w : ndarray, shape (segments,)
        Simulated power of climate control.
    corrector_sd_wh : float
        Standard deviation of the corrector's own uncertainty of the trip's energy [Wh].
    outside_sd_wh : float
        Standard deviation of what the corrector may have missed outside of its training [Wh].
    net_wh : float
        Energy of the trip [Wh].
    distance_m : float
        Length of the trip [m].

    Examples
    --------
    >>> segments = Segments(np.array([450.0, 1350.0]), np.full(2, 900.0), np.full(2, 4000.0), np.zeros(2))
    >>> len(segments), segments.hours.tolist()
    (2, [0.25, 0.25])
    """

    time_s: FloatArray
    step_s: FloatArray
    moved_w: FloatArray
    climate_w: FloatArray
    corrector_sd_wh: float = 0.0
    outside_sd_wh: float = 0.0
    net_wh: float = 0.0
    distance_m: float = 0.0

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def hours(self) -> FloatArray:
        """Length of each segment [h]."""
        return self.step_s / SECONDS_PER_HOUR

    @property
    def drive_noise_w(self) -> FloatArray:
        """Scale of what is new in every segment of the driving component: it grows with the power that is moved [W]."""
        # the fit scales both together; choices
        return 100.0 + 0.3 * self.moved_w


@dataclass(frozen=True, eq=False)
class ResidualProcess:
    """Covariance of the residual power.

    Attributes
    ----------
    drive, climate : ComponentProcess
        Processes of driving and of climate control.
    climate_limit_w : float
        Measured climate power counts as no further than this from what was expected [W].
    split : bool
        Whether the components were fitted separately, on logged climate control.

    Examples
    --------
    >>> still = ComponentProcess(0.0, 0.0, 0.0, 600.0, 0.0)
    >>> process = ResidualProcess(ComponentProcess(60.0, 0.0, 0.0, 600.0, 0.0), still, climate_limit_w=500.0, split=True)
    >>> segments = Segments(np.array([900.0]), np.array([1800.0]), np.zeros(1), np.zeros(1))
    >>> process.sd_wh(segments), process.prior(segments, "climate").energy_wh(segments.hours)[1].tolist()
    (30.0, [0.0])
    >>> process.limited(np.array([-900.0, 20.0])).tolist()
    [-500.0, 20.0]
    """

    drive: ComponentProcess
    climate: ComponentProcess
    climate_limit_w: float
    split: bool

    def prior(self, segments: Segments, component: str = "joint") -> PowerPrior:
        """Make the distribution of the residual power before anything was observed.

        Parameters
        ----------
        segments : Segments
            Of one trip.
        component : {"joint", "drive", "climate"}
            Which component; "joint" is the sum of both.

        Returns
        -------
        PowerPrior
            With mean 0.
        """
        parts = {
            "drive": (self.drive, segments.moved_w, segments.drive_noise_w),
            "climate": (self.climate, segments.climate_w, np.ones(len(segments))),
        }
        chosen = list(parts.values()) if component == "joint" else [parts[component]]
        return PowerPrior.from_components(segments.time_s, chosen)

    def sd_wh(self, segments: Segments) -> float:
        """Compute the standard deviation of the trip's energy.

        Parameters
        ----------
        segments : Segments
            Of one trip.

        Returns
        -------
        float
            Standard deviation [Wh] of the sum of both components.
        """
        return float(np.sqrt(self.prior(segments).variance_wh2(segments.hours)[-1]))

    def limited(self, climate_w: FloatArray) -> FloatArray:
        """Limit the residual of climate control to `climate_limit_w`.

        Parameters
        ----------
        climate_w : ndarray
            Measured minus expected power [W].

        Returns
        -------
        ndarray
            Residual within the limit [W], shape of `climate_w`.
        """
        return np.clip(climate_w, -self.climate_limit_w, self.climate_limit_w)


@dataclass(frozen=True, eq=False)
class HeldOutResidual:
    """Residual power of a trip that the mean model has not seen.

    Attributes
    ----------
    segments : Segments
    residual_w : ndarray, shape (segments,)
        Observed minus predicted power.
    climate_w : ndarray or None, shape (segments,)
        Its part of climate control; None where the corrector is joint or climate control was not logged throughout.
    climate_expected_w : ndarray or None, shape (segments,)
        Predicted power of climate control, where `climate_w` is known.
    measured_sd_wh : float
        Standard deviation of the measurement of the trip's energy [Wh].
    along : bool
        Whether the energy was measured along the trip, and not for the whole trip only.
    """

    segments: Segments
    residual_w: FloatArray
    climate_w: FloatArray | None = None
    climate_expected_w: FloatArray | None = None
    measured_sd_wh: float = 0.0
    along: bool = True

    @property
    def error_wh(self) -> float:
        """Observed minus predicted energy of the trip [Wh]."""
        return float(self.segments.hours @ self.residual_w)


def fit_process(trips: Sequence[HeldOutResidual]) -> ResidualProcess:
    """Fit the process by maximum likelihood to trips that its mean model has not seen.

    Where trips log climate control, each component is fitted separately on those trips; else both on the sum.
    Segments are merged in pairs and all trips are solved at once, by exact gradients. O(trips x segments^3) a step.
    Where no trip was measured along the way, the process is that of usual values.

    Parameters
    ----------
    trips : sequence of HeldOutResidual
        Residual powers of held-out trips, at least one.

    Returns
    -------
    ResidualProcess
        With separate components where a trip logs climate control.

    Examples
    --------
    >>> flat = np.full(4, 900.0)
    >>> segments = Segments(np.arange(4) * 900.0, flat, np.full(4, 4000.0), np.zeros(4))
    >>> trips = [HeldOutResidual(segments, np.full(4, residual)) for residual in (-80.0, 60.0, 20.0)]
    >>> process = fit_process(trips)
    >>> process.split, process.sd_wh(segments) > 0.0
    (False, True)
    """
    trips = [trip for trip in trips if trip.along]
    if not trips:
        drive, climate = (ComponentProcess(*_STARTS[name]) for name in ("drive", "climate"))
        return ResidualProcess(drive, climate, float("inf"), split=False)
    split = [trip for trip in trips if trip.climate_w is not None]
    if not split:
        drive, climate = _fitted(ResidualBatch.from_trips(trips, "joint"), ("drive", "climate"))
        return ResidualProcess(drive, climate, float("inf"), split=False)
    seen = np.concatenate([np.abs(trip.climate_w) for trip in split if trip.climate_w is not None])
    # one segment in twenty is beyond the limit; a choice
    limit = float(np.quantile(seen, 0.95))
    (climate,) = _fitted(ResidualBatch.from_trips(split, "climate", limit), ("climate",))
    (drive,) = _fitted(ResidualBatch.from_trips(split, "drive"), ("drive",))
    return ResidualProcess(drive, climate, limit, split=True)


def _fitted(batch: ResidualBatch, components: tuple[str, ...]) -> list[ComponentProcess]:
    from scipy.optimize import minimize

    starts = np.array([_STARTS[name] for name in components])
    free = starts > 0.0
    free[:, -1] &= starts[:, -2] > 0.0
    start = np.log(starts[free])

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        values = starts.copy()
        values[free] = np.exp(logs)
        value, gradient = batch.cost(components, values)
        # a weak pull to the start keeps an effect that no trip shows from running off to 0
        pull = (logs - start) / 2.0
        return value + 0.5 * float(pull @ pull), gradient[free] + pull / 2.0

    # parameters stay within a factor of 100 of their start; a choice
    bounds = [(value - 4.6, value + 4.6) for value in start]
    starts[free] = np.exp(
        minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 80}).x
    )
    return [ComponentProcess(*map(float, row)) for row in starts]


def _merged(segments: Segments, residual_w: FloatArray) -> tuple[Segments, FloatArray, FloatArray]:
    """Two segments in one: means by time; the noise of a mean is that of independent parts, here relative to one segment's."""
    start = np.arange(0, len(segments), 2)
    step = np.add.reduceat(segments.step_s, start)
    share = segments.step_s / np.repeat(step, np.diff(np.append(start, len(segments))))

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values * share, start))

    merged = Segments(mean(segments.time_s), step, mean(segments.moved_w), mean(segments.climate_w))
    return merged, mean(residual_w), np.sqrt(np.add.reduceat(share**2, start))


@dataclass(frozen=True, eq=False)
class ResidualBatch:
    """Trips side by side, shorter ones filled up with segments that carry no information."""

    real: BoolArray
    residual: FloatArray
    time: FloatArray
    size: dict[str, FloatArray]
    noise: dict[str, FloatArray]

    @classmethod
    def from_trips(
        cls, trips: Sequence[HeldOutResidual], what: str, limit_w: float = np.inf
    ) -> ResidualBatch:
        """`what` is the residual to explain: all of it, its climate part (within a limit) or its driving part."""
        rows = []
        for trip in trips:
            left, climate = trip.residual_w, trip.climate_w
            if what != "joint" and climate is not None:
                left = np.clip(climate, -limit_w, limit_w) if what == "climate" else left - climate
            rows.append(_merged(trip.segments, left))
        shape = len(rows), max(len(segments) for segments, _, _ in rows)
        real = np.zeros(shape, dtype=bool)
        residual, time, moved, climate = (np.zeros(shape) for _ in range(4))
        drive_noise, climate_noise = np.zeros(shape), np.zeros(shape)
        for i, (segments, left, rest) in enumerate(rows):
            k = len(segments)
            real[i, :k], residual[i, :k], time[i, :k] = True, left, segments.time_s
            moved[i, :k], climate[i, :k] = segments.moved_w, segments.climate_w
            drive_noise[i, :k], climate_noise[i, :k] = rest * segments.drive_noise_w, rest
        size = {"drive": moved, "climate": climate}
        return cls(real, residual, time, size, {"drive": drive_noise, "climate": climate_noise})

    def cost(self, components: Sequence[str], values: FloatArray) -> tuple[float, FloatArray]:
        """Negative log likelihood but for a constant, and its gradient by the logarithms of the values."""
        pairs = self.real[:, :, None] & self.real[:, None, :]
        lag = np.where(pairs, np.abs(self.time[:, :, None] - self.time[:, None, :]), np.inf)
        diagonal = np.arange(self.real.shape[1])
        covariance = np.zeros_like(lag)
        covariance[:, diagonal, diagonal] += np.where(self.real, 0.0, 1.0)
        drifts, starts = [], []
        for name, (constant, share, sd, time, noise, onset, onset_time) in zip(
            components, values, strict=True
        ):
            early = onset**2 * np.exp(-self.time / onset_time)
            start = np.sqrt(1.0 + early)
            drift = sd**2 * np.exp(-lag / time) * start[:, :, None] * start[:, None, :]
            size = share * self.size[name]
            covariance += drift + np.where(pairs, constant**2, 0.0) + size[:, :, None] * size[:, None, :]
            covariance[:, diagonal, diagonal] += (noise * self.noise[name]) ** 2
            drifts.append(drift)
            starts.append(early / (1.0 + early))
        factor = np.linalg.cholesky(covariance)
        inverse = np.linalg.inv(covariance)
        alpha = (inverse @ self.residual[:, :, None])[:, :, 0]
        value = 0.5 * float(np.sum(alpha * self.residual)) + float(
            np.log(factor[:, diagonal, diagonal]).sum()
        )
        inner = inverse - alpha[:, :, None] * alpha[:, None, :]
        finite = np.where(pairs, lag, 0.0)
        gradient = np.zeros_like(values)
        real = self.real.astype(np.float64)
        for row, (name, drift, weight) in enumerate(zip(components, drifts, starts, strict=True)):
            constant, share, _, time, noise, _, onset_time = values[row]
            size = share * self.size[name]
            pulled = inner * drift
            by_start = pulled.sum(axis=2)
            gradient[row] = (
                constant**2 * np.einsum("ti,tij,tj->", real, inner, real, optimize=True),
                np.einsum("ti,tij,tj->", size, inner, size, optimize=True),
                pulled.sum(),
                0.5 * np.sum(pulled * finite) / time,
                np.sum(inner[:, diagonal, diagonal] * (noise * self.noise[name]) ** 2),
                np.sum(by_start * weight),
                0.5 * np.sum(by_start * weight * self.time) / onset_time,
            )
        return value, gradient
