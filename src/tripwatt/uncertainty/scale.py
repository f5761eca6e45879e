"""Scale of the error of a trip's energy before departure, estimated from held-out trips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.uncertainty.process import Segments

TAIL_DF: Final = 4.0
"""Degrees of freedom of the errors' t distribution, as Lange, Little and Taylor (1989) advise for few data."""
_START: Final = np.array([100.0, 200.0, 0.03, 1.0])
_LOG_SD: Final = 2.0


@dataclass(frozen=True, eq=False)
class TotalScale:
    """Standard deviation of a trip's energy: independent parts that grow with the trip.

    ``sd² = a² + (b hours)² + (c moved)² + (d corrector)² + outside²``: an error of every trip, one of every hour (climate
    control, auxiliaries), a share of the energy moved at the wheels, the corrector's own uncertainty of a trip unlike
    those of its training, and in full what it may have missed outside of their range.

    Attributes
    ----------
    values : ndarray, shape (4,)
        ``a`` [Wh], ``b`` [W], ``c`` and ``d`` [1].

    Examples
    --------
    >>> flat = np.full(4, 900.0)
    >>> segments = Segments(np.arange(4) * 900.0, flat, np.full(4, 4000.0), np.zeros(4))
    >>> TotalScale(np.array([30.0, 40.0, 0.0, 1.0])).sd_wh(segments)
    50.0
    """

    values: FloatArray

    def sd_wh(self, segments: Segments) -> float:
        """Standard deviation of the trip's energy [Wh]."""
        return float(np.hypot(np.linalg.norm(self.values * _sizes(segments)), segments.outside_sd_wh))

    @classmethod
    def from_errors(cls, trips: Sequence[Segments], errors_wh: FloatArray) -> TotalScale:
        """Maximum a posteriori of t-distributed errors, with log-normal priors around usual values. O(trips) a step."""
        from scipy.optimize import minimize

        sizes = np.array([_sizes(segments) for segments in trips]) * _START
        outside = np.array([segments.outside_sd_wh for segments in trips])

        def cost(logs: FloatArray) -> tuple[float, FloatArray]:
            parts = sizes**2 * np.exp(2.0 * logs)
            variance = parts.sum(axis=1) + outside**2
            square = errors_wh**2 / variance
            value = 0.5 * np.log(variance) + 0.5 * (TAIL_DF + 1.0) * np.log1p(square / TAIL_DF)
            slope = 0.5 - 0.5 * (TAIL_DF + 1.0) * square / (TAIL_DF + square)
            gradient = (slope / variance) @ (2.0 * parts) + logs / _LOG_SD**2
            return float(value.sum() + 0.5 * np.sum((logs / _LOG_SD) ** 2)), gradient

        found = minimize(cost, np.zeros(4), jac=True, method="L-BFGS-B", bounds=[(-6.0, 6.0)] * 4).x
        return cls(_START * np.exp(found))


def _sizes(segments: Segments) -> FloatArray:
    hours = segments.hours
    return np.array([1.0, hours.sum(), segments.moved_w @ hours, segments.corrector_sd_wh])
