"""Errors of the energy at the end of trips, all trips with equal weight, and the uncertainty of these errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy import stats

from tripwatt.arrays import FloatArray

BOOTSTRAP_DRAWS: Final = 10_000
"""Draws of the bootstrap: a choice, because the ends then move by about a hundredth of the width with the seed."""
CONFIDENCE: Final = 0.95
"""Level of the bootstrap intervals: the usual one."""
SIGNIFICANCE_SEEDS: Final = 40
"""Number of bootstrap seeds: a choice. A difference is significant if the interval of each of these seeds excludes 0."""
NEAR: Final = 0.1
"""Share of an interval's width; an interval that ends farther than this from 0 excludes 0 for any seed, since seeds
move its ends by about a hundredth of its width."""


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Difference of the mean APE of two models over the same trips, `a - b`.

    Attributes
    ----------
    diff : float
        The difference; negative if `a` has the smaller error.
    ci95 : tuple of float
        95 % percentile bootstrap interval over trips.
    significant : bool
        Whether the interval excludes 0 for all seeds of the bootstrap, see `leaves_out_zero`.

    Examples
    --------
    >>> pair = paired_difference(np.full(20, 0.05), np.full(20, 0.08), seed=0)
    >>> round(pair.diff, 3), pair.significant
    (-0.03, True)
    """

    diff: float
    ci95: tuple[float, float]
    significant: bool


def absolute_percentage_error(observed_wh: FloatArray, predicted_wh: FloatArray) -> FloatArray:
    """Compute |observed - predicted| / |observed|, as a fraction.

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


def bootstrap_interval(
    values: FloatArray, seed: int, days: Sequence[str] | None = None, *, draws: int = BOOTSTRAP_DRAWS
) -> tuple[float, float]:
    """Compute the 95 % bootstrap interval of the mean over trips; with `days`, whole days are drawn instead of trips. O(draws x trips).

    Examples
    --------
    >>> import numpy as np
    >>> bootstrap_interval(np.full(5, 0.1), seed=0)
    (0.1, 0.1)
    """
    place = np.arange(len(values)) if days is None else np.unique(days, return_inverse=True)[1]
    sums, trips = np.bincount(place, values), np.bincount(place)
    if len(sums) == 1:  # every draw is the same
        return round(float(values.mean()), 12), round(float(values.mean()), 12)
    interval = stats.bootstrap(
        (sums, trips),
        lambda total, number, axis: total.sum(axis=axis) / number.sum(axis=axis),
        paired=True,
        vectorized=True,
        n_resamples=draws,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return round(float(interval.low), 12), round(float(interval.high), 12)


def summarise_errors(observed_wh: FloatArray, predicted_wh: FloatArray, seed: int) -> dict[str, Any]:
    """Summarise the errors at the end of the trips.

    Parameters
    ----------
    observed_wh : ndarray, shape (trips,)
        Measured energy [Wh], above 0.
    predicted_wh : ndarray, shape (trips,)
        Predicted energy [Wh].
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    dict
        `mape`, `median_ape` and `max_ape`: mean, median and largest absolute percentage error, as fractions; `mape_ci95`:
        95 % percentile bootstrap interval of the mean over trips; `bias`: mean of (predicted - observed) / observed;
        `rmse_wh`: root mean square of predicted minus observed energy [Wh].

    Examples
    --------
    >>> errors = summarise_errors(np.array([1000.0, 2000.0]), np.array([1100.0, 1900.0]), seed=0)
    >>> round(errors["mape"], 3), round(errors["bias"], 3), errors["rmse_wh"]
    (0.075, 0.025, 100.0)
    """
    ape = absolute_percentage_error(observed_wh, predicted_wh)
    error = predicted_wh - observed_wh
    return {
        "mape": float(ape.mean()),
        "mape_ci95": bootstrap_interval(ape, seed),
        "median_ape": float(np.median(ape)),
        "max_ape": float(ape.max()),
        "bias": float(np.mean(error / observed_wh)),
        "rmse_wh": float(np.sqrt(np.mean(error**2))),
    }


def paired_difference(
    ape_a: FloatArray, ape_b: FloatArray, seed: int, days: Sequence[str] | None = None
) -> PairedDifference:
    """Compare the APE of two models over the same trips.

    Parameters
    ----------
    ape_a : ndarray, shape (trips,)
        Absolute percentage errors of the first model, as fractions.
    ape_b : ndarray, shape (trips,)
        Absolute percentage errors of the second model.
    seed : int
        Seed of the bootstrap.
    days : sequence of str, optional
        Day of each trip. If given, the bootstrap draws days, because trips of one day share its weather and traffic.

    Returns
    -------
    PairedDifference
        Mean of `ape_a - ape_b` and its interval.

    Examples
    --------
    >>> paired_difference(np.array([0.05, 0.15]), np.array([0.08, 0.12]), seed=0).significant
    False
    """
    difference = ape_a - ape_b
    interval = bootstrap_interval(difference, seed, days)
    sure = leaves_out_zero(interval, lambda other: bootstrap_interval(difference, seed + other, days))
    return PairedDifference(float(difference.mean()), interval, sure)


def leaves_out_zero(interval: tuple[float, float], again: Callable[[int], tuple[float, float]]) -> bool:
    """Check whether the bootstrap interval excludes 0 for each of `SIGNIFICANCE_SEEDS` seeds.

    Parameters
    ----------
    interval : tuple of float
        Interval of the first seed.
    again : callable
        Function from k to the interval of the first seed plus k; called only if the first interval ends near 0.

    Examples
    --------
    >>> leaves_out_zero((0.1, 0.3), lambda other: (0.0, 0.0)), leaves_out_zero((0.001, 0.3), lambda other: (-0.001, 0.3))
    (True, False)
    """
    low, high = interval
    if low <= 0.0 <= high:
        return False
    if min(abs(low), abs(high)) > NEAR * (high - low):
        return True
    return not any(a <= 0.0 <= b for a, b in map(again, range(1, SIGNIFICANCE_SEEDS)))
