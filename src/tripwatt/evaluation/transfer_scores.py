"""Errors of a fleet's energy: sum |predicted - observed| / sum observed, and their uncertainty over trips and draws."""

from __future__ import annotations

from statistics import NormalDist
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.evaluation.forecast_scores import LEVELS, coverage_by_level
from tripwatt.evaluation.metrics import leaves_out_zero
from tripwatt.hybrid.hierarchy import DrawsForecast

RESAMPLES: Final = 4000


def resamples(n_trips: int, seed: int, n: int = RESAMPLES) -> IntArray:
    """Trips of each bootstrap sample, shape (samples, trips)."""
    return np.random.default_rng((seed, n_trips)).integers(0, n_trips, size=(n, n_trips))


def energy_error(observed_wh: FloatArray, predicted_wh: FloatArray) -> tuple[float, float]:
    """Error sum |predicted - observed| / sum observed, and bias sum (predicted - observed) / sum observed.

    Examples
    --------
    >>> energy_error(np.array([1000.0, 3000.0]), np.array([1100.0, 2700.0]))
    (0.1, -0.05)
    """
    miss = predicted_wh - observed_wh
    total = float(observed_wh.sum())
    return float(np.abs(miss).sum()) / total, float(miss.sum()) / total


def scored(observed_wh: FloatArray, predicted_wh: FloatArray, index: IntArray) -> dict[str, Any]:
    """Error and bias with 95 % bootstrap intervals over trips."""
    error, bias = energy_error(observed_wh, predicted_wh)
    miss, total = predicted_wh - observed_wh, observed_wh[index].sum(axis=1)
    return {
        "error": error,
        "error_ci95": _interval(np.abs(miss)[index].sum(axis=1) / total),
        "bias": bias,
        "bias_ci95": _interval(miss[index].sum(axis=1) / total),
    }


def paired_energy_error(
    observed_wh: FloatArray, a_wh: FloatArray, b_wh: FloatArray, index: IntArray
) -> dict[str, Any]:
    """Error of `a` minus that of `b` over the same trips; negative when `a` errs less."""
    difference = np.abs(a_wh - observed_wh) - np.abs(b_wh - observed_wh)

    def interval(index: IntArray) -> tuple[float, float]:
        return _interval(difference[index].sum(axis=1) / observed_wh[index].sum(axis=1))

    first = interval(index)
    n, trips = index.shape
    return {
        "diff": float(difference.sum() / observed_wh.sum()),
        "diff_ci95": first,
        "significant": leaves_out_zero(first, lambda seed: interval(resamples(trips, seed, n))),
    }


def curve_row(
    k: int,
    forecast: DrawsForecast,
    simulated_wh: FloatArray,
    observed_wh: FloatArray,
    index: IntArray,
    seed: int,
) -> dict[str, Any]:
    """What k own trips give: means over the draws, their spread, and the interval over draws and trips together.

    Of one draw also what its normal intervals hold, by level: `coverage`, `coverage_ci95`, `inside`, `interval_width_wh`,
    `needed_width_wh` (see `Coverage`).
    """
    miss = simulated_wh + forecast.mean_wh - observed_wh
    total = float(observed_wh.sum())
    error, bias = np.abs(miss).sum(axis=1) / total, miss.sum(axis=1) / total
    drawn = np.random.default_rng((seed, 1, k)).integers(0, len(miss), size=len(index))
    both = np.abs(miss[drawn[:, None], index]).sum(axis=1) / observed_wh[index].sum(axis=1)
    return {
        "k": k,
        "draws": len(miss),
        "error": float(error.mean()),
        "error_ci95": _interval(both),
        "error_of_draws": [float(q) for q in np.quantile(error, (0.025, 0.5, 0.975))],
        "bias": float(bias.mean()),
        "share_in_common": float(forecast.share.mean()),
        "inside_90": float(np.mean(np.abs(miss) <= half_width(0.9) * forecast.sd_wh)),
        **(_intervals(observed_wh, miss[0], forecast.sd_wh[0]) if len(miss) == 1 else {}),
    }


def half_width(level: float) -> float:
    """Standard deviations of a central interval of a normal distribution.

    Examples
    --------
    >>> round(half_width(0.9), 4)
    1.6449
    """
    return NormalDist().inv_cdf(0.5 + 0.5 * level)


def _intervals(observed_wh: FloatArray, miss: FloatArray, sd_wh: FloatArray) -> dict[str, Any]:
    centre = (observed_wh + miss)[:, None]
    half = sd_wh[:, None] * [half_width(level) for level in LEVELS]
    return coverage_by_level(observed_wh, centre - half, centre + half)


def _interval(values: FloatArray) -> tuple[float, float]:
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)
