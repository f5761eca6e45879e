"""Scale of the error of a trip's energy before departure, estimated from held-out trips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.factors import MIN_KM, MIN_NET, TAIL_DF
from tripwatt.uncertainty.process import ResidualProcess, Segments
from tripwatt.units import SECONDS_PER_HOUR

T_VARIANCE: Final = TAIL_DF / (TAIL_DF - 2.0)
"""Ratio of variance to squared scale of a t distribution with `TAIL_DF` degrees of freedom.

The part outside of the training has the standard deviation of a prior; dividing it by the root of this ratio gives its scale."""
_START: Final = np.array([100.0, 200.0, 0.03, 1.0])
"""Usual sizes of the parts: 100 Wh for every trip, 200 W for its time, 3 % of the energy moved, and the corrector's own uncertainty in
full; choices."""
_LOG_SD: Final = 2.0
"""Standard deviation of the log-normal priors around the usual sizes: a part may well be seven times as large or as small; a choice."""


@dataclass(frozen=True, slots=True)
class TimeCourse:
    """Growth of the error of energy over a trip: a constant error of power adds up in full, a drift the less the faster it changes.

    Attributes
    ----------
    constant_w : float
        Standard deviation of the part that is constant over a trip [W].
    drifts : tuple of (float, float)
        Standard deviation [W] and correlation time [s] of each drift.

    Examples
    --------
    >>> TimeCourse().hours(2.0), round(TimeCourse(0.0, ((300.0, 60.0),)).hours(2.0), 3)
    (2.0, 0.257)
    """

    constant_w: float = 1.0
    drifts: tuple[tuple[float, float], ...] = ()

    @classmethod
    def from_process(cls, process: ResidualProcess) -> TimeCourse:
        """Take the constants and drifts of both components of a process."""
        parts = (process.drive, process.climate)
        constant = float(np.hypot(process.drive.constant_sd_w, process.climate.constant_sd_w))
        drifts = tuple((part.drift_sd_w, part.drift_time_s) for part in parts if part.drift_sd_w > 0.0)
        return cls(constant, drifts)

    def hours(self, hours: float) -> float:
        """Duration of a constant error of power that gives the same standard deviation of energy [h]; at most `hours`.

        The integral of a drift over a time ``t`` has the variance ``2 sd² T² (t / T - 1 + exp(-t / T))``, T its correlation time.
        """
        square = (self.constant_w * hours) ** 2 + self.drift_wh2(hours)
        power_w2 = self.constant_w**2 + sum(sd_w**2 for sd_w, _ in self.drifts)
        return float(np.sqrt(square / power_w2)) if power_w2 > 0.0 else hours

    def drift_wh2(self, hours: Any) -> Any:
        """Variance of the energy due to the drifts [Wh²], which two parts of a journey do not share; `hours` is a number or an array."""
        seconds = np.asarray(hours) * SECONDS_PER_HOUR
        parts = [
            2.0 * (sd_w * time_s) ** 2 * (seconds / time_s + np.expm1(-seconds / time_s))
            for sd_w, time_s in self.drifts
        ]
        return sum(parts, np.zeros_like(seconds)) / SECONDS_PER_HOUR**2


@dataclass(frozen=True, eq=False)
class TotalScale:
    """Standard deviation of a trip's energy, the sum of independent parts.

    ``sd² = a² + (b hours)² + (c moved)² + (d corrector)² + outside² / 2``. The parts are an error of every trip, an error per hour
    (climate control, auxiliaries), a share of the energy moved at the wheels, the corrector's own uncertainty of a trip unlike
    those of its training, and the uncertainty of conditions outside the training range. The last is a standard deviation; the
    factor 1/2 converts it to the scale of the t distribution of the errors. The hours are those of `TimeCourse.hours`, because
    drifts cancel in part on a long trip. If the training trips do not show how errors grow with the trip, the errors by hours and
    by energy together are at least `least_share` of the energy moved: no error grows faster than the trip.

    Attributes
    ----------
    values : ndarray, shape (4,)
        ``a`` [Wh], ``b`` [W], ``c`` and ``d`` [1].
    course : TimeCourse
        Growth of the errors of power over time.
    least_share : float
        Least share of the energy moved; 0 if trips of many lengths were seen.
    net_shares : (float, float)
        Relative errors of the net energy, for a car with few or no trips of its own: one that is the same at any length, and one over
        a kilometre, which evens out with the distance.

    Examples
    --------
    >>> flat = np.full(4, 900.0)
    >>> segments = Segments(np.arange(4) * 900.0, flat, np.full(4, 4000.0), np.zeros(4))
    >>> TotalScale(np.array([30.0, 40.0, 0.0, 1.0])).sd_wh(segments)
    50.0
    """

    values: FloatArray
    course: TimeCourse = TimeCourse()
    least_share: float = 0.0
    net_shares: tuple[float, float] = (0.0, 0.0)

    def net_sd_wh(self, net_wh: float, moved_wh: float, distance_m: float) -> float:
        """Compute the part of the standard deviation due to `net_shares`.

        Parameters
        ----------
        net_wh, moved_wh : float
            Energy of the trip without the potential energy of its climb, and energy moved at its wheels [Wh].
        distance_m : float
            Length of the trip [m].

        Returns
        -------
        float
            Standard deviation [Wh].

        Examples
        --------
        >>> TotalScale(np.zeros(4), net_shares=(0.03, 0.4)).net_sd_wh(1000.0, 1200.0, 100_000.0)
        50.0
        """
        from_km = self.net_shares[1] / math.sqrt(max(distance_m / 1000.0, MIN_KM))
        return max(abs(net_wh), MIN_NET * moved_wh) * math.hypot(self.net_shares[0], from_km)

    def sd_wh(self, segments: Segments) -> float:
        """Compute the standard deviation of the trip's energy.

        Parameters
        ----------
        segments : Segments
            Segments of one trip.

        Returns
        -------
        float
            Standard deviation [Wh].
        """
        sizes = _sizes(segments, self.course)
        parts = self.values * sizes
        growing = max(float(np.hypot(parts[1], parts[2])), self.least_share * float(sizes[2]))
        outside = segments.outside_sd_wh / np.sqrt(T_VARIANCE)
        net = self.net_sd_wh(segments.net_wh, float(sizes[2]), segments.distance_m)
        return float(np.linalg.norm([parts[0], growing, parts[3], outside, net]))

    def with_share(self, share: float, energy_over_moved: float) -> TotalScale:
        """Add a relative error of every energy, such as by an uncertain capacity; it is added to the share of the energy moved.

        Parameters
        ----------
        share : float
            Relative standard deviation of every energy [1].
        energy_over_moved : float
            Energy of the trips divided by the energy moved at their wheels [1].

        Returns
        -------
        TotalScale
            A scale that is as wide or wider.

        Examples
        --------
        >>> float(TotalScale(np.array([30.0, 40.0, 0.03, 1.0])).with_share(0.02, 2.0).values[2])
        0.05
        """
        values = self.values.copy()
        values[2] = np.hypot(values[2], share * energy_over_moved)
        return replace(self, values=values)

    @classmethod
    def from_errors(
        cls,
        trips: Sequence[Segments],
        errors_wh: FloatArray,
        course: TimeCourse | None = None,
        measured_sd_wh: FloatArray | float = 0.0,
    ) -> TotalScale:
        """Estimate the parts from errors of held-out trips. O(trips) per step.

        The estimate is the maximum a posteriori for t-distributed errors, with log-normal priors around usual values.

        Parameters
        ----------
        trips : sequence of Segments
            Segments of each held-out trip.
        errors_wh : ndarray, shape (trips,)
            Measured minus predicted energy of each trip [Wh].
        course : TimeCourse, optional
            Growth of the errors of power over time; without drift by default.
        measured_sd_wh : ndarray or float
            Standard deviation of the measurement of each trip's energy [Wh]; its square is part of the variance of an error.

        Returns
        -------
        TotalScale
            Estimated scale, with `least_share` 0.

        Examples
        --------
        >>> flat = np.full(4, 900.0)
        >>> trip = Segments(np.arange(4) * 900.0, flat, np.full(4, 4000.0), np.zeros(4))
        >>> small = TotalScale.from_errors([trip] * 9, np.full(9, 20.0)).sd_wh(trip)
        >>> small < TotalScale.from_errors([trip] * 9, np.full(9, 200.0)).sd_wh(trip)
        True
        """
        from scipy.optimize import minimize

        course = course or TimeCourse()
        sizes = np.array([_sizes(segments, course) for segments in trips]) * _START
        beyond = np.array([segments.outside_sd_wh for segments in trips]) / np.sqrt(T_VARIANCE)
        outside = np.hypot(beyond, measured_sd_wh)

        def cost(logs: FloatArray) -> tuple[float, FloatArray]:
            parts = sizes**2 * np.exp(2.0 * logs)
            variance = parts.sum(axis=1) + outside**2
            square = errors_wh**2 / variance
            value = 0.5 * np.log(variance) + 0.5 * (TAIL_DF + 1.0) * np.log1p(square / TAIL_DF)
            slope = 0.5 - 0.5 * (TAIL_DF + 1.0) * square / (TAIL_DF + square)
            gradient = (slope / variance) @ (2.0 * parts) + logs / _LOG_SD**2
            return float(value.sum() + 0.5 * np.sum((logs / _LOG_SD) ** 2)), gradient

        # the factor of the corrector's own uncertainty is at most 1, as for a car without trips: a larger factor would
        # replace errors that grow with the trip, and the models of other cars would lack these
        bounds = [(-6.0, 6.0)] * 3 + [(-6.0, 0.0)]
        logs_of_parts = minimize(cost, np.zeros(4), jac=True, method="L-BFGS-B", bounds=bounds).x
        return cls(_START * np.exp(logs_of_parts), course)


def _sizes(segments: Segments, course: TimeCourse) -> FloatArray:
    hours = segments.hours
    total_hours = course.hours(float(hours.sum()))
    return np.array([1.0, total_hours, segments.moved_w @ hours, segments.corrector_sd_wh])
