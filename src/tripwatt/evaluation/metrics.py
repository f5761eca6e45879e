"""Errors of the energy at the end of the trip, each trip weighing the same, and their uncertainty over trips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import stats

from tripwatt.arrays import FloatArray

BOOTSTRAP_DRAWS: Final = 10_000
CONFIDENCE: Final = 0.95


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Summary of a model's errors over trips.

    Attributes
    ----------
    mape, median_ape, max_ape : float
        Mean, median and largest absolute percentage error, as fractions.
    mape_ci95 : tuple of float
        95 % percentile bootstrap interval of the mean over trips.
    bias : float
        Mean of (predicted - observed) / observed.
    rmse_wh : float
    """

    mape: float
    mape_ci95: tuple[float, float]
    median_ape: float
    max_ape: float
    bias: float
    rmse_wh: float


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Difference of the mean APE of two models over the same trips, `a - b`.

    Attributes
    ----------
    diff : float
        Negative when `a` errs less.
    ci95 : tuple of float
        95 % percentile bootstrap interval over trips.
    """

    diff: float
    ci95: tuple[float, float]

    @property
    def significant(self) -> bool:
        """Whether the interval leaves out 0."""
        return not self.ci95[0] <= 0.0 <= self.ci95[1]


def absolute_percentage_error(observed_wh: FloatArray, predicted_wh: FloatArray) -> FloatArray:
    """|observed - predicted| / |observed|, as a fraction.

    Parameters
    ----------
    observed_wh, predicted_wh : ndarray, shape (trips,)

    Examples
    --------
    >>> import numpy as np
    >>> absolute_percentage_error(np.array([100.0]), np.array([90.0]))
    array([0.1])
    """
    return np.abs(predicted_wh - observed_wh) / np.abs(observed_wh)


def bootstrap_interval(values: FloatArray, seed: int, *, draws: int = BOOTSTRAP_DRAWS) -> tuple[float, float]:
    """95 % percentile interval of the mean over trips drawn with replacement. O(draws x trips).

    Examples
    --------
    >>> import numpy as np
    >>> bootstrap_interval(np.full(5, 0.1), seed=0)
    (0.1, 0.1)
    """
    if len(values) == 1:  # every draw is the same
        return round(float(values[0]), 12), round(float(values[0]), 12)
    found = stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=draws,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return round(float(found.low), 12), round(float(found.high), 12)


def summarise_errors(observed_wh: FloatArray, predicted_wh: FloatArray, seed: int) -> ErrorSummary:
    """Summary of the errors at the end of the trip, arrays of shape (trips,) in [Wh]."""
    ape = absolute_percentage_error(observed_wh, predicted_wh)
    error = predicted_wh - observed_wh
    return ErrorSummary(
        mape=float(ape.mean()),
        mape_ci95=bootstrap_interval(ape, seed),
        median_ape=float(np.median(ape)),
        max_ape=float(ape.max()),
        bias=float(np.mean(error / observed_wh)),
        rmse_wh=float(np.sqrt(np.mean(error**2))),
    )


def paired_difference(ape_a: FloatArray, ape_b: FloatArray, seed: int) -> PairedDifference:
    """Mean difference of two models' APE over the same trips, arrays of shape (trips,)."""
    difference = ape_a - ape_b
    return PairedDifference(float(difference.mean()), bootstrap_interval(difference, seed))
