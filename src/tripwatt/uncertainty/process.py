"""The residual power of a trip as a Gaussian process over its segments, in two components: driving and climate control.

The residual power of segment t is ``r_t = d_t + c_t``, driving plus climate control. Each component is
``u + v s_t + g_t z_t + w_t``. The constant `u` and the share `v` of the power `s` that the component moves hold for the whole
trip (driver, wind, load, set-point); their mean is 0 for a new trip, and every driven segment shows more of them. `z` is a drift
with an exponential covariance, and `w` is independent in every segment. At departure a climate control is far from its steady
state, so ``g_t`` makes its drift wider at the start. The energy to come is a sum over segments: its variance includes the
correlation along the trip.

If the log has the power of climate control, each component is fitted and updated separately. A burst of a heater
does not last, so the observed climate residual is limited.

The module `residual_power` conditions the process on measurements: power, with missing or late samples, or a state of charge
that is read now and then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.hybrid import PowerCorrector, SegmentTable
from tripwatt.uncertainty.residual_power import ComponentProcess, PowerPrior
from tripwatt.units import SECONDS_PER_HOUR

_STARTS: Final = {
    "drive": (100.0, 0.05, 300.0, 200.0, 0.5, 0.0, 1.0),
    "climate": (200.0, 0.15, 300.0, 200.0, 50.0, 2.0, 200.0),
}
"""Start values of the fit of each component, in the order of the fields of `ComponentProcess`."""
EXACT_W2: Final = 1.0
"""Variance of the measured power of a fully measured segment [W²]; not 0, which keeps the system well conditioned."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of one trip, in the form that the residual process takes.

    Attributes
    ----------
    time_s : ndarray, shape (segments,)
        Middle of each segment [s].
    step_s : ndarray, shape (segments,)
        Duration of each segment [s].
    moved_w : ndarray, shape (segments,)
        Power at the wheels, drawn or given back [W].
    climate_w : ndarray, shape (segments,)
        Simulated power of climate control [W].
    corrector_sd_wh : float
        Standard deviation of the trip's energy due to the corrector's own uncertainty [Wh].
    outside_sd_wh : float
        Standard deviation of the trip's energy due to conditions outside the corrector's training [Wh].
    net_wh : float
        Simulated energy of the trip without the potential energy of its climb [Wh].
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
        """Duration of each segment [h]."""
        return self.step_s / SECONDS_PER_HOUR

    @property
    def drive_noise_w(self) -> FloatArray:
        """Scale of the independent part of driving in each segment [W]; it grows with the power that is moved."""
        # the fit scales both together; choices
        return 100.0 + 0.3 * self.moved_w


def process_segments(
    table: SegmentTable, uncertainty_wh: FloatArray, outside_w: FloatArray | None = None
) -> Segments:
    """Segments of one trip in the form that the residual process takes.

    Parameters
    ----------
    table : SegmentTable
        Table of one trip.
    uncertainty_wh : ndarray, shape (any,)
        Factor of the trip's energy, from `PowerCorrector.predict_with_uncertainty`.
    outside_w : ndarray, shape (segments, any), optional
        Factor from `PowerCorrector.outside_factor`.
    """
    return Segments(
        time_s=table.columns["time_s"],
        step_s=table.hours * SECONDS_PER_HOUR,
        moved_w=table.columns["moved_w"],
        climate_w=table.columns["climate_w"],
        corrector_sd_wh=float(np.linalg.norm(uncertainty_wh)),
        outside_sd_wh=0.0 if outside_w is None else float(np.linalg.norm(table.hours @ outside_w)),
        net_wh=float(table.hours @ (table.simulated_w - table.columns["climb_w"])),
        distance_m=float((table.hours * table.columns["speed_m_s"]).sum()) * SECONDS_PER_HOUR,
    )


@dataclass(frozen=True, eq=False)
class ResidualProcess:
    """Covariance of the residual power.

    Attributes
    ----------
    drive, climate : ComponentProcess
        Processes of driving and of climate control.
    climate_limit_w : float
        Largest difference of measured from expected climate power that counts [W].
    split : bool
        Whether the components were fitted separately, on logged climate control.

    Examples
    --------
    >>> still = ComponentProcess(0.0, 0.0, 0.0, 600.0, 0.0)
    >>> process = ResidualProcess(ComponentProcess(60.0, 0.0, 0.0, 600.0, 0.0), still, climate_limit_w=500.0, split=True)
    >>> segments = Segments(np.array([900.0]), np.array([1800.0]), np.zeros(1), np.zeros(1))
    >>> [process.prior(segments, part).sd_wh(segments.hours).tolist() for part in ("joint", "climate")]
    [[30.0], [0.0]]
    >>> process.limited(np.array([-900.0, 20.0])).tolist()
    [-500.0, 20.0]
    """

    drive: ComponentProcess
    climate: ComponentProcess
    climate_limit_w: float
    split: bool

    def prior(self, segments: Segments, component: str = "joint") -> PowerPrior:
        """Make the distribution of the residual power before any measurement.

        Parameters
        ----------
        segments : Segments
            Segments of one trip.
        component : {"joint", "drive", "climate"}
            Which component; "joint" is the sum of both.

        Returns
        -------
        PowerPrior
            Distribution with mean 0.
        """
        parts = {
            "drive": (self.drive, segments.moved_w, segments.drive_noise_w),
            "climate": (self.climate, segments.climate_w, np.ones(len(segments))),
        }
        chosen = list(parts.values()) if component == "joint" else [parts[component]]
        return PowerPrior.from_components(segments.time_s, chosen)

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
    """Residual power of a trip that was held out of the fit of the corrector.

    Attributes
    ----------
    segments : Segments
    residual_w : ndarray, shape (segments,)
        Observed minus predicted power [W].
    climate_w : ndarray or None, shape (segments,)
        Part of the residual by climate control [W]; None if the corrector is joint or climate control was not logged throughout.
    climate_expected_w : ndarray or None, shape (segments,)
        Predicted power of climate control [W]; None if `climate_w` is None.
    measured_sd_wh : float
        Standard deviation of the measurement of the trip's energy [Wh].
    along : bool
        Whether the energy was measured along the trip; False if only the total was measured.
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


def held_out_residual(corrector: PowerCorrector, table: SegmentTable) -> HeldOutResidual:
    """Residual power of one trip, by a corrector that was fitted without this trip."""
    correction, uncertainty = corrector.predict_with_uncertainty(table, table.hours)
    segments = process_segments(table, uncertainty, corrector.outside_factor(table))
    climate = corrector.predict_climate(table)
    residual = HeldOutResidual(
        segments,
        table.residual_w - correction,
        measured_sd_wh=float(table.energy_errors.own_wh[0]),
        along=bool(table.energy_errors.along[0]),
    )
    if climate is None or not np.isfinite(left := table.climate_residual_w - climate).all():
        return residual
    return replace(residual, climate_w=left, climate_expected_w=segments.climate_w + climate)


def fit_process(trips: Sequence[HeldOutResidual]) -> ResidualProcess:
    """Fit the process by penalised maximum likelihood to trips that were held out of the fit of the corrector.

    If trips log climate control, each component is fitted separately on those trips; otherwise both are fitted on the sum.
    Segments are merged in pairs, and all trips are solved at once with exact gradients. O(trips x segments^3) per step.
    If no trip was measured along the way, the process has the start values of the fit.

    Parameters
    ----------
    trips : sequence of HeldOutResidual
        Residual powers of held-out trips, at least one.

    Returns
    -------
    ResidualProcess
        Fitted process; `split` is True if any trip logs climate control.

    Examples
    --------
    >>> flat = np.full(4, 900.0)
    >>> segments = Segments(np.arange(4) * 900.0, flat, np.full(4, 4000.0), np.zeros(4))
    >>> trips = [HeldOutResidual(segments, np.full(4, residual)) for residual in (-80.0, 60.0, 20.0)]
    >>> process = fit_process(trips)
    >>> process.split, bool((process.prior(segments).sd_wh(segments.hours) > 0.0).all())
    (False, True)
    """
    trips = [trip for trip in trips if trip.along]
    split = [trip for trip in trips if trip.climate_w is not None]
    if not split:
        drive, climate = (ComponentProcess(*start) for start in _STARTS.values())
        if trips:
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
    found = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 80})
    starts[free] = np.exp(found.x)
    return [ComponentProcess(*map(float, row)) for row in starts]


def _merged(segments: Segments, residual_w: FloatArray) -> tuple[Segments, FloatArray, FloatArray]:
    """Merge segments in pairs: segments and residuals as means over time, and the noise of a mean relative to that of one segment."""
    start = np.arange(0, len(segments), 2)
    step = np.add.reduceat(segments.step_s, start)
    share = segments.step_s / np.repeat(step, np.diff(np.append(start, len(segments))))

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values * share, start))

    merged = Segments(mean(segments.time_s), step, mean(segments.moved_w), mean(segments.climate_w))
    return merged, mean(residual_w), np.sqrt(np.add.reduceat(share**2, start))


@dataclass(frozen=True, eq=False)
class ResidualBatch:
    """Trips as rows of arrays; shorter trips are padded with segments that carry no information."""

    real: BoolArray
    residual: FloatArray
    time: FloatArray
    size: dict[str, FloatArray]
    noise: dict[str, FloatArray]

    @classmethod
    def from_trips(
        cls, trips: Sequence[HeldOutResidual], what: str, limit_w: float = np.inf
    ) -> ResidualBatch:
        """Make a batch of trips; `what` is the residual to fit: "joint", "climate" (limited to `limit_w`) or "drive"."""
        rows = []
        for trip in trips:
            left, climate = trip.residual_w, trip.climate_w
            if what != "joint" and climate is not None:
                left = np.clip(climate, -limit_w, limit_w) if what == "climate" else left - climate
            rows.append(_merged(trip.segments, left))
        columns = [
            (left, s.time_s, s.moved_w, s.climate_w, rest * s.drive_noise_w, rest) for s, left, rest in rows
        ]
        lengths = np.array([len(row[0]) for row in columns])
        real = np.arange(lengths.max()) < lengths[:, None]
        padded = np.zeros((6, *real.shape))
        padded[:, real] = np.concatenate(columns, axis=1)
        residual, time, moved, climate, *noise = padded
        size = {"drive": moved, "climate": climate}
        return cls(real, residual, time, size, dict(zip(("drive", "climate"), noise, strict=True)))

    @cached_property
    def _parts(self) -> list[ResidualBatch]:
        """The trips in four parts of similar length, which need little padding; the number is a choice."""
        lengths, parts = self.real.sum(axis=1), []
        for rows in np.array_split(np.argsort(lengths, kind="stable"), min(4, len(lengths))):
            cut = np.ix_(rows, np.arange(lengths[rows].max()))
            size, noise = ({name: v[cut] for name, v in of.items()} for of in (self.size, self.noise))
            parts.append(ResidualBatch(self.real[cut], self.residual[cut], self.time[cut], size, noise))
        return parts

    def cost(self, components: Sequence[str], values: FloatArray) -> tuple[float, FloatArray]:
        """Negative log likelihood up to a constant, and its gradient with respect to the logarithms of the values."""
        costs, gradients = zip(*(part._cost(components, values) for part in self._parts), strict=True)
        return sum(costs), np.sum(gradients, axis=0)

    def _cost(self, components: Sequence[str], values: FloatArray) -> tuple[float, FloatArray]:
        pairs = self.real[:, :, None] & self.real[:, None, :]
        lag = np.where(pairs, np.abs(self.time[:, :, None] - self.time[:, None, :]), np.inf)
        diagonal = np.arange(self.real.shape[1])
        covariance = np.zeros_like(lag)
        covariance[:, diagonal, diagonal] += np.where(self.real, 0.0, 1.0)
        drifts, starts = [], []
        for name, row in zip(components, values, strict=True):
            constant, share, sd, time, noise, onset, onset_time = row
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
        log_root = float(np.log(factor[:, diagonal, diagonal]).sum())
        value = 0.5 * float(np.sum(alpha * self.residual)) + log_root
        inner = inverse - alpha[:, :, None] * alpha[:, None, :]
        finite = np.where(pairs, lag, 0.0)
        gradient = np.zeros_like(values)
        real = self.real.astype(np.float64)
        for k, (name, drift, weight) in enumerate(zip(components, drifts, starts, strict=True)):
            constant, share, _, time, noise, _, onset_time = values[k]
            size = share * self.size[name]
            pulled = inner * drift
            by_start = pulled.sum(axis=2)
            gradient[k] = (
                constant**2 * np.sum(inner @ real[:, :, None] * real[:, :, None]),
                np.sum(inner @ size[:, :, None] * size[:, :, None]),
                pulled.sum(),
                0.5 * np.sum(pulled * finite) / time,
                np.sum(inner[:, diagonal, diagonal] * (noise * self.noise[name]) ** 2),
                np.sum(by_start * weight),
                0.5 * np.sum(by_start * weight * self.time) / onset_time,
            )
        return value, gradient
