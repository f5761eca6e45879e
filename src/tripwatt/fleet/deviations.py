"""Vehicles that take more than their sisters, and trips that take more than their forecasts, by the linear part of a fleet's model."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.fleet.model import predict_rows
from tripwatt.fleet.statistics import TripRows
from tripwatt.hybrid.groups import GroupPosterior

LEVEL: Final = 0.9
"""Coverage of the intervals."""

CHANGE_Z: Final = 4.0
"""A vehicle's consumption counts as changed where its means before and after differ by this many standard errors."""


def with_errors(posterior: GroupPosterior, rows: TripRows) -> tuple[FloatArray, FloatArray]:
    """Energy [Wh] and its standard deviation with the trip's own error [Wh]."""
    energy, sd = predict_rows(posterior, rows)
    return energy, np.hypot(sd, np.sqrt(posterior.scales.noise * rows.numbers("variance_wh2")))


def sisters(posterior: GroupPosterior, rows: TripRows) -> pd.DataFrame:
    """How much more each vehicle takes than its car model on the usual trip of its model, and since when.

    Parameters
    ----------
    posterior : GroupPosterior
    rows : TripRows

    Returns
    -------
    DataFrame
        `vehicle_id`, `car_model`, `trips`, `share` more [1] with its standard deviation `sd`, and where the means before
        and after a day differ by `CHANGE_Z` standard errors, that day `since` and the `change` [1].
    """
    models, ids = rows.texts("car_model"), rows.texts("vehicle_id")
    observed, X = rows.numbers("observed_wh"), rows.X
    energy = rows.numbers("simulated_wh").copy()
    for name in sorted(set(models.tolist())):
        its = models == name
        energy[its] += X[its] @ posterior.weights(name)[0]
    relative = (observed - energy) / np.maximum(np.abs(energy), 1.0)
    started = rows.texts("started_at")
    table = []
    for vehicle in sorted(set(ids.tolist())):
        index = np.flatnonzero(ids == vehicle)
        name = str(models[index[0]])
        its_model = models == name
        usual, mean_wh = X[its_model].mean(axis=0), float(energy[its_model].mean())
        mean, covariance = posterior.weights(name, vehicle)
        base, _ = posterior.weights(name)
        order = index[np.argsort([f"{started[i]}" for i in index], kind="stable")]
        since, change = change_point(relative[order])
        table.append(
            (
                vehicle,
                name,
                len(index),
                float(usual @ (mean - base)) / mean_wh,
                float(np.sqrt(usual @ covariance @ usual)) / mean_wh,
                None if since is None else str(started[order[since]] or "")[:10],
                change,
            )
        )
    columns = ["vehicle_id", "car_model", "trips", "share", "sd", "since", "change"]
    return pd.DataFrame(table, columns=columns).sort_values("share", ascending=False, ignore_index=True)


def change_point(values: FloatArray, least: int = 8) -> tuple[int | None, float]:
    """Where the mean of a sequence changes, and by how much; None where it does not beyond chance. O(values).

    The place with the largest difference of means in standard errors, with the variance within both parts.

    Examples
    --------
    >>> change_point(np.array([0.0, 0.1] * 10 + [1.0, 1.1] * 10))
    (20, 1.0)
    >>> change_point(np.array([0.0, 0.1] * 20))[0] is None
    True
    """
    n = len(values)
    if n < 2 * least:
        return None, 0.0
    k = np.arange(least, n - least + 1)
    total, squares = np.cumsum(values), np.cumsum(values**2)
    before, after = total[k - 1] / k, (total[-1] - total[k - 1]) / (n - k)
    within = (squares[-1] - k * before**2 - (n - k) * after**2) / (n - 2)
    error = np.sqrt(np.maximum(within, 1e-12) * (1.0 / k + 1.0 / (n - k)))
    best = int(np.argmax(np.abs(after - before) / error))
    change = float(after[best] - before[best])
    if abs(change) < CHANGE_Z * error[best]:
        return None, 0.0
    return int(k[best]), round(change, 12)


def drift(posterior: GroupPosterior, rows: TripRows, level: float = LEVEL) -> dict[str, Any]:
    """How new trips compare with their forecasts, of the fleet and of each vehicle, by the linear part.

    Parameters
    ----------
    posterior : GroupPosterior
        Of the model before it saw the trips.
    rows : TripRows
    level : float
        Of the coverage, for errors with a normal distribution.

    Returns
    -------
    dict
        `trips`, mean relative error `bias` [1], `coverage` [1], and `vehicles`: those whose mean standardised error is
        beyond 3 standard errors, with `trips`, `bias` and `z`.
    """
    from scipy.special import ndtri

    energy, sd = with_errors(posterior, rows)
    observed = rows.numbers("observed_wh")
    z = (observed - energy) / sd
    relative = (observed - energy) / np.maximum(np.abs(energy), 1.0)
    ids = rows.texts("vehicle_id")
    vehicles = {}
    for vehicle in sorted(set(ids.tolist())):
        its = ids == vehicle
        score = float(z[its].mean() * np.sqrt(its.sum()))
        if abs(score) > 3.0:
            vehicles[vehicle] = {"trips": int(its.sum()), "bias": float(relative[its].mean()), "z": score}
    return {
        "trips": len(rows),
        "bias": float(relative.mean()),
        "coverage": float(np.mean(np.abs(z) <= ndtri(0.5 + 0.5 * level))),
        "vehicles": vehicles,
    }
