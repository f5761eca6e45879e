"""Deviations of vehicles and drivers from others, and of trips from their forecasts, by the linear part of a fleet's model."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.fleet.features import CLIMATE, FEATURES, SCALES
from tripwatt.fleet.model import predict_rows
from tripwatt.fleet.statistics import KEYS, TripRows
from tripwatt.hybrid.groups import GroupPosterior

LEVEL: Final = 0.9
"""Level of the intervals."""

_BASE: Final = np.isin(FEATURES, "base_load")
_CLIMATE: Final = np.isin(FEATURES, ("climate", *CLIMATE))
PARTS: Final = {"driving": ~(_BASE | _CLIMATE), "climate": _CLIMATE, "base_load": _BASE}
"""Masks of the features that belong to each part of a deviation."""
_MIN_TRIPS: Final = 10
"""Smallest number of trips of a month that is compared: a choice, because a few trips may be on its coldest day."""


def predict_with_error(posterior: GroupPosterior, rows: TripRows) -> tuple[FloatArray, FloatArray]:
    """Predict the energy of trips [Wh], and its standard deviation including the trip's own error [Wh]."""
    energy, sd = predict_rows(posterior, rows)
    return energy, np.hypot(sd, np.sqrt(posterior.scales.noise * rows.numbers("variance_wh2")))


def deviations(posterior: GroupPosterior, rows: TripRows, *, drivers: bool = False) -> pd.DataFrame:
    """Estimate how much more energy each vehicle takes than its car model on the usual trip of the car model.

    With `drivers`, estimate how much more each driver takes than the vehicle does with a driver of whom nothing is known.

    Parameters
    ----------
    posterior : GroupPosterior
    rows : TripRows
    drivers : bool
        Compare drivers instead of vehicles.

    Returns
    -------
    DataFrame
        One row per vehicle or driver, the largest deviation first: `car_model`, `vehicle_id`, `driver` (only with `drivers`), `trips`,
        `share` (additional energy [1]), `sd` (its standard deviation), and the parts of `share` from `driving`, `climate` and
        `base_load` [1].
    """
    depth = 3 if drivers else 2
    trip_counts = Counter(group[:depth] for group in rows.groups if all(group[:depth]))
    models, X = rows.texts("car_model"), rows.X
    base_wh = pd.Series(rows.numbers("simulated_wh")).groupby(models).mean()
    usual = pd.DataFrame(X).groupby(models).mean()
    table = []
    for group, n_trips in trip_counts.items():
        x = usual.loc[group[0]].to_numpy()
        weights, covariance = posterior.weights(*group)
        parent_weights = posterior.weights(*group[:-1])[0]
        mean_wh = float(base_wh[group[0]] + x @ parent_weights)
        parts = [float(x[part] @ (weights - parent_weights)[part]) / mean_wh for part in PARTS.values()]
        table.append((*group, n_trips, sum(parts), float(np.sqrt(x @ covariance @ x)) / mean_wh, *parts))
    columns = [*KEYS[:depth], "trips", "share", "sd", *PARTS]
    return pd.DataFrame(table, columns=columns).sort_values("share", ascending=False, ignore_index=True)


def worst_month(posterior: GroupPosterior, rows: TripRows) -> dict[str, str]:
    """Say which month took most for a kilometre, and by what it differs from the others.

    The car models expect energy for heating and cooling, and for roads, speed and load. What is measured beyond that is of vehicles and
    drivers, or not known.

    Returns
    -------
    dict of str to str
        The sentence by "Worst month"; empty with fewer than two months of `_MIN_TRIPS` trips.
    """
    weights = {model: posterior.weights(model)[0] for model in set(rows.texts("car_model"))}
    corrections = rows.X * np.array([weights[model] for model in rows.texts("car_model")])
    expected_wh = rows.numbers("simulated_wh") + corrections.sum(axis=1)
    simulated = np.where(np.isin(FEATURES, CLIMATE), 0.0, rows.X / SCALES)  # the others are energies
    climate_wh = (corrections + simulated)[:, _CLIMATE].sum(axis=1)
    beyond_wh, month = rows.numbers("observed_wh") - expected_wh, pd.Series(rows.texts("started_at")).str[:7]
    wh = pd.DataFrame({"heating and cooling": climate_wh, "roads, speed and load": expected_wh - climate_wh})
    wh = wh.assign(**{"vehicles, drivers or unknown": beyond_wh, "km": rows.numbers("distance_m") / 1000.0})
    sums = wh[month.map(month.value_counts()) >= _MIN_TRIPS].groupby(month).sum()
    if len(sums) < 2:
        return {}
    km = sums.pop("km")
    worst = f"{(sums.sum(axis=1) / km).idxmax()}"
    more = sums.loc[worst] / km[worst] - sums.drop(worst).sum() / km.drop(worst).sum()
    why = ", ".join(f"{wh:+.0f} by {name}" for name, wh in more.sort_values(ascending=False).items())
    total = f"{sums.loc[worst].sum() / km[worst]:.0f} Wh/km, {more.sum():+.0f} beside the other months"
    return {"Worst month": f"{worst} took {total}: {why}"}


def drift(posterior: GroupPosterior, rows: TripRows) -> dict[str, Any]:
    """Compare new trips with their forecasts by the linear part, for the fleet and for each vehicle.

    Parameters
    ----------
    posterior : GroupPosterior
        Posterior of the model before it was updated with the trips.
    rows : TripRows

    Returns
    -------
    dict
        `trips`, `bias` (mean of measured minus forecast over forecast energy) [1], `coverage` of the intervals of the level `LEVEL`
        for normal errors [1], and `vehicles`: those whose mean standardised error is more than 3 standard errors
        from 0, with `trips`, `bias` and `z`.
    """
    from scipy.special import ndtri

    energy, sd = predict_with_error(posterior, rows)
    observed = rows.numbers("observed_wh")
    z = (observed - energy) / sd
    relative = (observed - energy) / np.maximum(np.abs(energy), 1.0)
    of_vehicle = pd.DataFrame({"bias": relative, "z": z}).groupby(rows.texts("vehicle_id"))
    vehicles = of_vehicle.mean().assign(trips=of_vehicle.size())[["trips", "bias", "z"]]
    vehicles["z"] *= np.sqrt(vehicles["trips"])
    return {
        "trips": len(rows),
        "bias": float(relative.mean()),
        "coverage": float(np.mean(np.abs(z) <= ndtri(0.5 + 0.5 * LEVEL))),
        "vehicles": vehicles[vehicles["z"].abs() > 3.0].to_dict("index"),
    }
