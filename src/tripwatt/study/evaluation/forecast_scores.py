"""Score probabilistic forecasts: coverage, CRPS, re-forecasts, arrival, strata; from arrays to plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.study.evaluation.metrics import (
    BOOTSTRAP_DRAWS,
    absolute_percentage_error,
    bootstrap_interval,
    paired_difference,
)
from tripwatt.uncertainty.coverage import Coverage

FORECAST: Final = "hybrid"
"""Name of the forecast in the files of the protocol."""
WITHOUT_PHYSICS: Final = "boosting-only"
"""Name of the data-only model in the files of the protocol."""
LEVELS: Final = (0.5, 0.8, 0.9, 0.95)
"""Levels of the scored intervals: a choice, the usual ones."""
FRACTIONS: Final = (0.1, 0.25, 0.5, 0.75)
"""Fractions of the time of a trip after which it is forecast again: a choice."""
TOTALS: Final = ("update", "soc_only", "no_update", "naive_gauge")
"""Forecasts of the total energy made under way: re-forecast, re-forecast from the state of charge alone, two baselines."""
UPDATE_LEVEL: Final = 0.9
"""Level of the intervals of the re-forecast and of the charge at arrival: that of the forecast."""
ARRIVAL_STARTS: Final = ("soc", "bms_soc")
"""Fields of a departure from which the charge at arrival is forecast: `soc` (display), `bms_soc` (battery management)."""
RESERVE_OFFSETS: Final = tuple(round(0.01 * k, 2) for k in range(-6, 7))
"""Reserves, relative to the forecast charge at arrival, for which the probability to arrive is scored."""
DECILES: Final = 10
"""Classes of the stated probability in a reliability diagram: tenths, as usual."""
UPDATES: Final = (*TOTALS, "update_low", "update_high")
"""`TOTALS`, and the bounds of the re-forecast at `UPDATE_LEVEL`."""


def crps(observed_wh: FloatArray, quantiles_wh: FloatArray) -> FloatArray:
    """Compute the continuous ranked probability score: twice the pinball loss, averaged over equally spaced quantiles.

    Parameters
    ----------
    observed_wh : ndarray, shape (trips,)
    quantiles_wh : ndarray, shape (trips, m)
        Quantiles at the probabilities (k + 1/2) / m (Gneiting and Raftery 2007, equation 20 and section 4.2).

    Returns
    -------
    ndarray, shape (trips,)
        Scores in the unit of the observations.

    Examples
    --------
    >>> crps(np.array([3.0]), np.array([[1.0, 1.0]]))  # a point forecast scores its absolute error
    array([2.])
    """
    m = quantiles_wh.shape[1]
    p = (np.arange(m) + 0.5) / m
    error = observed_wh[:, None] - quantiles_wh
    return np.asarray(2.0 * np.maximum(p * error, (p - 1.0) * error).mean(axis=1))


def symmetric_quantiles(centre_wh: FloatArray, half_wh: FloatArray) -> FloatArray:
    """Compute quantiles (trips, 2 m) for `crps` from a centre and half widths at the levels (k + 1/2) / m."""
    return np.concatenate([centre_wh[:, None] - half_wh[:, ::-1], centre_wh[:, None] + half_wh], axis=1)


def coverage_scores(
    observed_wh: FloatArray, low_wh: FloatArray, high_wh: FloatArray, seed: int
) -> dict[str, Any]:
    """Compute coverage and width of intervals by nominal level.

    Parameters
    ----------
    observed_wh : ndarray, shape (trips,)
    low_wh, high_wh : ndarray, shape (trips, len(LEVELS))

    Returns
    -------
    dict
        `coverage`, `coverage_ci95` (Clopper-Pearson), `coverage_bootstrap95`, `inside` (number of trips), `interval_width_wh` and
        `needed_width_wh` (see `Coverage`), each by level.
    """
    inside = (observed_wh[:, None] >= low_wh) & (observed_wh[:, None] <= high_wh)
    drawn = {
        f"{level:g}": bootstrap_interval(inside[:, j].astype(float), seed) for j, level in enumerate(LEVELS)
    }
    return coverage_by_level(observed_wh, low_wh, high_wh) | {"coverage_bootstrap95": drawn}


def coverage_by_level(observed_wh: FloatArray, low_wh: FloatArray, high_wh: FloatArray) -> dict[str, Any]:
    """Return the `coverage_scores` without the bootstrap."""
    scores = {
        f"{level:g}": _interval_scores(
            Coverage.from_bounds(observed_wh, low_wh[:, j], high_wh[:, j], level), "_wh"
        )
        for j, level in enumerate(LEVELS)
    }
    names = next(iter(scores.values()))
    return {name: {level: score[name] for level, score in scores.items()} for name in names}


def _interval_scores(intervals: Coverage, unit: str) -> dict[str, Any]:
    """Return the coverage and the widths of intervals; `unit` ends the names of the widths."""
    return {
        "coverage": intervals.share,
        "coverage_ci95": intervals.ci95,
        "inside": intervals.inside,
        f"interval_width{unit}": intervals.width,
        f"needed_width{unit}": intervals.needed_width,
    }


def crps_scores(
    observed_wh: FloatArray, centre_wh: FloatArray, sd_wh: FloatArray, factors: FloatArray
) -> dict[str, float]:
    """Compute the CRPS of the forecasts, and the CRPS if all trips had the same standard deviation.

    Parameters
    ----------
    observed_wh, centre_wh, sd_wh : ndarray, shape (trips,)
    factors : ndarray, shape (trips, m)
        Half widths in standard deviations at the levels (k + 1/2) / m.

    Returns
    -------
    dict
        `crps_wh`; `crps_same_width_wh` with the mean standard deviation for every trip; `crps_best_same_width_wh` with
        the common standard deviation that scores best, which is known only in hindsight.
    """

    def score(sd: FloatArray) -> float:
        return float(crps(observed_wh, symmetric_quantiles(centre_wh, factors * sd[:, None])).mean())

    mean = float(sd_wh.mean())
    same_width = [score(np.full(len(sd_wh), mean * share)) for share in np.geomspace(0.25, 4.0, 49)]
    return {
        "crps_wh": score(sd_wh),
        "crps_same_width_wh": score(np.full(len(sd_wh), mean)),
        "crps_best_same_width_wh": min(same_width),
    }


def update_scores(
    observed_wh: FloatArray, energies_wh: FloatArray, seed: int, days: Sequence[str] | None = None
) -> dict[str, Any]:
    """Compute errors of the re-forecast total by the fraction of the trip's time.

    Parameters
    ----------
    observed_wh : ndarray, shape (trips,)
    energies_wh : ndarray, shape (trips, len(FRACTIONS), len(UPDATES))
        Forecasts of the total; NaN if a trip lacks the measurement.

    Returns
    -------
    dict
        Fraction -> `mape, mape_ci95, no_update, naive_gauge, soc_only` (None without a state of charge),
        `diff, diff_ci95, significant` against no update, `diff_gauge, diff_gauge_ci95` against the gauge; `coverage`
        and mean `interval_width_wh` of the re-forecast's interval of `UPDATE_LEVEL`.
    """
    scores = {}
    for j, fraction in enumerate(FRACTIONS):
        ape = {
            name: absolute_percentage_error(observed_wh, energies_wh[:, j, k])
            for k, name in enumerate(TOTALS)
        }
        low, high = (energies_wh[:, j, UPDATES.index(name)] for name in ("update_low", "update_high"))
        against_no_update = paired_difference(ape["update"], ape["no_update"], seed, days)
        against_gauge = paired_difference(ape["update"], ape["naive_gauge"], seed, days)
        soc = ape["soc_only"][np.isfinite(ape["soc_only"])]
        scores[f"{fraction:g}"] = {
            "mape": float(ape["update"].mean()),
            "mape_ci95": bootstrap_interval(ape["update"], seed),
            "no_update": float(ape["no_update"].mean()),
            "naive_gauge": float(ape["naive_gauge"].mean()),
            "soc_only": float(soc.mean()) if len(soc) else None,
            "diff": against_no_update.diff,
            "diff_ci95": against_no_update.ci95,
            "significant": against_no_update.significant,
            "diff_gauge": against_gauge.diff,
            "diff_gauge_ci95": against_gauge.ci95,
            "coverage": float(np.mean((low <= observed_wh) & (observed_wh <= high))),
            "interval_width_wh": float(np.mean(high - low)),
        }
    return scores


def arrival_scores(
    shown: FloatArray, arrival: FloatArray, chance: FloatArray, seed: int
) -> dict[str, dict[str, Any] | None]:
    """Score the forecast charge at arrival and the probability to arrive with a reserve, by what was known at departure.

    Parameters
    ----------
    shown : ndarray, shape (trips,)
        Displayed charge at arrival; NaN if it was not logged.
    arrival : ndarray, shape (trips, len(ARRIVAL_STARTS), 3)
        Forecast median and the bounds of the interval of `UPDATE_LEVEL`.
    chance : ndarray, shape (trips, len(ARRIVAL_STARTS), len(RESERVE_OFFSETS))
        Probability to arrive with the median plus each of `RESERVE_OFFSETS`.

    Returns
    -------
    dict
        Start -> `n_trips, mae, bias, coverage, coverage_ci95, inside, interval_width, needed_width` [1], and
        `reliability` (see the function `reliability`); None if no trip has the readings.
    """
    scores: dict[str, dict[str, Any] | None] = dict.fromkeys(ARRIVAL_STARTS)
    for k, start in enumerate(ARRIVAL_STARTS):
        complete = np.isfinite(shown) & np.isfinite(arrival[:, k]).all(axis=1)
        if not complete.any():
            continue
        truth, (centre, low, high) = shown[complete], arrival[complete, k].T
        arrived = truth[:, None] >= centre[:, None] + np.array(RESERVE_OFFSETS)
        scores[start] = {
            "n_trips": int(complete.sum()),
            "mae": float(np.mean(np.abs(centre - truth))),
            "bias": float(np.mean(centre - truth)),
            **_interval_scores(Coverage.from_bounds(truth, low, high, UPDATE_LEVEL), ""),
            "reliability": reliability(chance[complete, k], arrived, seed),
        }
    return scores


def reliability(chance: FloatArray, happened: BoolArray, seed: int) -> list[dict[str, Any]]:
    """Compare stated probabilities with observed shares, by tenths of the probability. O(draws x trips).

    Parameters
    ----------
    chance : ndarray, shape (trips, pairs)
    happened : ndarray of bool, shape (trips, pairs)

    Returns
    -------
    list of dict
        For each tenth with pairs: `share` of all pairs, mean `stated` probability, `observed` share, and
        `observed_ci95` by a bootstrap over trips, because pairs of one trip are not independent.
    """
    n_trips = len(chance)
    tenth = np.minimum((chance * DECILES).astype(np.int64), DECILES - 1)
    one_hot = tenth[:, :, None] == np.arange(DECILES)
    count = one_hot.sum(axis=1).astype(np.float64)
    stated = (one_hot * chance[:, :, None]).sum(axis=1)
    hits = (one_hot & happened[:, :, None]).sum(axis=1).astype(np.float64)
    draws = np.random.default_rng(seed).multinomial(
        n_trips, np.full(n_trips, 1.0 / n_trips), size=BOOTSTRAP_DRAWS
    )
    with np.errstate(invalid="ignore"):
        drawn = (draws @ hits) / (draws @ count)
    rows = []
    for k in np.flatnonzero(count.sum(axis=0) > 0):
        total = count[:, k].sum()
        low, high = np.nanquantile(drawn[:, k], [0.025, 0.975])
        rows.append(
            {
                "share": float(total / chance.size),
                "stated": float(stated[:, k].sum() / total),
                "observed": float(hits[:, k].sum() / total),
                "observed_ci95": (float(low), float(high)),
            }
        )
    return rows


STRATA: Final[Mapping[str, tuple[str, tuple[float, ...], tuple[str, ...]]]] = {
    "road": ("net_climb_m", (-10.0,), ("net descent of more than 10 m", "no net descent")),
    # the warmest class begins above 28 °C, the others at their lower edge
    "battery": (
        "battery_temperature_degc",
        (5.0, float(np.nextafter(28.0, 29.0))),
        ("below 5 °C", "5 to 28 °C", "above 28 °C"),
    ),
    "ambient": (
        "ambient_temperature_degc",
        (5.0, 15.0, 25.0),
        ("below 5 °C", "5 to 15 °C", "15 to 25 °C", "25 °C or more"),
    ),
    "length": ("km", (10.0, 20.0, 40.0), ("below 10 km", "10 to 20 km", "20 to 40 km", "40 km or more")),
    "mean speed": ("km_h", (30.0, 50.0), ("below 30 km/h", "30 to 50 km/h", "50 km/h or more")),
}
"""What trips are divided by -> column, inner edges and names of the classes: a choice, so that each class has some trips of
the reference data."""


def strata_of(trips: pd.DataFrame) -> dict[tuple[str, str], BoolArray]:
    """Divide trips into strata by what is known at departure.

    Parameters
    ----------
    trips : DataFrame
        `net_climb_m, battery_temperature_degc, ambient_temperature_degc, distance_m, duration_s, driver`; NaN or
        None if unknown.

    Returns
    -------
    dict
        What the trips are divided by and name of the stratum -> mask of the trips; empty strata are left out.
    """
    hours = trips["duration_s"].astype(float) / 3600.0
    frame = trips.assign(km=trips["distance_m"].astype(float) / 1000.0)
    frame = frame.assign(km_h=frame["km"] / hours)
    classes: dict[str, pd.Series[Any]] = {
        by: pd.cut(frame[column].astype(float), [-np.inf, *edges, np.inf], right=False, labels=names)
        for by, (column, edges, names) in STRATA.items()
    }
    classes["driver"] = trips["driver"].astype("category")
    return {
        (by, name): (of_trips == name).to_numpy(dtype=bool)
        for by, of_trips in classes.items()
        for name in of_trips.cat.categories
        if (of_trips == name).any()
    }


def strata_scores(
    strata: Mapping[tuple[str, str], BoolArray],
    ape: FloatArray,
    ape_data: FloatArray | None,
    seed: int,
    days: Sequence[str] | None = None,
) -> list[dict[str, Any]]:
    """Return the mean APE of the hybrid by stratum and, with `ape_data`, that of the data-only model and their paired difference.

    The difference has an interval if the stratum has several trips.
    """
    rows = []
    for (by, name), members in strata.items():
        row: dict[str, Any] = {"by": by, "stratum": name, "n_trips": int(members.sum())}
        row[FORECAST] = float(ape[members].mean())
        if ape_data is not None:
            days_of_members = None if days is None else np.array(days)[members].tolist()
            difference = paired_difference(ape[members], ape_data[members], seed, days_of_members)
            row |= {WITHOUT_PHYSICS: float(ape_data[members].mean()), "diff": difference.diff}
            row["diff_ci95"] = difference.ci95 if row["n_trips"] > 1 else None
        rows.append(row)
    return rows
