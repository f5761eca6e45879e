"""How well a fleet's linear model forecasts, on rows of trips: later trips, new vehicles, new car models, few own trips.

All of it works on the sums: what is held out is taken out of them, and the posterior follows. The scales of the
deviations come from the training part of the time split, and from all trips elsewhere; trees are not part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, IntArray
from tripwatt.errors import Fault, InvalidInput
from tripwatt.fleet.hierarchy import Posterior, Scales, fit_scales, posterior
from tripwatt.fleet.model import predict_rows
from tripwatt.fleet.statistics import Sums, TripRows
from tripwatt.uncertainty import ConformalScores

LEVEL: Final = 0.9
NEWEST_SHARE: Final = 0.2
VEHICLE_FOLDS: Final = 10
OWN_TRIPS: Final = (0, 1, 3, 10, 30)

PROTOCOLS: Final = ("later trips", "new vehicles", "new car models")

TEMPERATURES: Final = (
    (-np.inf, 0.0, "below 0 °C"),
    (0.0, 10.0, "0 to 10 °C"),
    (10.0, 20.0, "10 to 20 °C"),
    (20.0, np.inf, "above 20 °C"),
)
LENGTHS: Final = ((0.0, 10e3, "below 10 km"), (10e3, 25e3, "10 to 25 km"), (25e3, np.inf, "above 25 km"))

CHANGE_Z: Final = 4.0
"""A vehicle's consumption counts as changed where its means before and after differ by this many standard errors."""


@dataclass(frozen=True, eq=False)
class FleetEvaluation:
    """Forecasts of held-out trips.

    Attributes
    ----------
    trips : DataFrame
        One row a trip and protocol: `protocol`, `car_model`, `vehicle_id`, `distance_m`, `ambient_temperature_degc`,
        `observed_wh`, `predicted_wh`, `low_wh`, `high_wh`.
    own : DataFrame
        One row a number of own trips: `own_trips`, `trips`, `pooled`, `own_only`, `fleet_only` (mean relative errors).
    """

    trips: pd.DataFrame
    own: pd.DataFrame

    def table(self, by: str) -> pd.DataFrame:
        """Mean relative error and coverage by a column, or by "temperature" or "length", of each protocol."""
        frame = self.trips.assign(
            error=np.abs(self.trips["predicted_wh"] - self.trips["observed_wh"])
            / np.abs(self.trips["observed_wh"]),
            inside=(self.trips["observed_wh"] >= self.trips["low_wh"])
            & (self.trips["observed_wh"] <= self.trips["high_wh"]),
        )
        if by == "temperature":
            frame["temperature"] = classes(frame["ambient_temperature_degc"].to_numpy(), TEMPERATURES)
        elif by == "length":
            frame["length"] = classes(frame["distance_m"].to_numpy(), LENGTHS)
        grouped = frame.groupby(["protocol", by], sort=True)
        return grouped.agg(
            trips=("error", "size"), error=("error", "mean"), inside=("inside", "mean")
        ).reset_index()


def classes(values: FloatArray, bounds: Sequence[tuple[float, float, str]]) -> Any:
    """Name of the class of each value; "unknown" for NaN.

    Examples
    --------
    >>> classes(np.array([-1.0, 10.0, np.nan]), TEMPERATURES).tolist()
    ['below 0 °C', '10 to 20 °C', 'unknown']
    """
    found = np.full(len(values), "unknown", dtype=object)
    for low, high, name in bounds:
        found[(values >= low) & (values < high)] = name
    return found


def evaluate_rows(rows: TripRows, scales: Scales | None = None) -> FleetEvaluation:
    """Score the linear model on rows of trips.

    Parameters
    ----------
    rows : TripRows
    scales : Scales, optional
        Found from the trips when not given.

    Raises
    ------
    InvalidInput
        With fewer than two vehicles.
    """
    vehicles = sorted(set(rows.texts("vehicle_id").tolist()))
    if len(vehicles) < 2:
        raise InvalidInput(Fault("too few vehicles", "fleet", f"{len(vehicles)}", "at least 2"))
    whole = Sums.from_rows(rows)
    scales = scales or fit_scales(whole)
    code = np.searchsorted(vehicles, rows.texts("vehicle_id"))
    fold = np.random.default_rng(0).permutation(len(vehicles))[code] % VEHICLE_FOLDS
    models = rows.texts("car_model")
    parts = [_later(rows, fold)]
    parts.append(_left_out(rows, whole, scales, fold, fold, "new vehicles"))
    names, model_code = np.unique(models.astype(str), return_inverse=True)
    if len(names) > 1:
        parts.append(_left_out(rows, whole, scales, model_code, fold, "new car models"))
    return FleetEvaluation(
        pd.concat([p for p in parts if p is not None], ignore_index=True), own_trips(rows, whole, scales)
    )


def _later(rows: TripRows, fold: IntArray) -> pd.DataFrame | None:
    """The newest fifth of the trips, from all before."""
    started = pd.to_datetime(pd.Series(rows.texts("started_at")), errors="coerce").to_numpy()
    known = ~np.isnat(started)
    if known.sum() < 10:
        return None
    cut = np.sort(started[known])[int((1.0 - NEWEST_SHARE) * known.sum())]
    late = known & (started >= cut)
    if not late.any() or late.all():
        return None
    train = Sums.from_rows(rows.where(~late))
    test = rows.where(late)
    found = posterior(train, fit_scales(train))
    energy, sd = _predicted(found, test)
    return _frame(test, energy, sd, fold[late], "later trips")


def _left_out(
    rows: TripRows, whole: Sums, scales: Scales, part: IntArray, fold: IntArray, protocol: str
) -> pd.DataFrame:
    energy, sd = np.zeros(len(rows)), np.zeros(len(rows))
    for k in np.unique(part):
        held = part == k
        test = rows.where(held)
        found = posterior(_nonempty(whole - Sums.from_rows(test)), scales)
        energy[held], sd[held] = _predicted(found, test)
    return _frame(rows, energy, sd, fold, protocol)


def _nonempty(sums: Sums) -> Sums:
    """Without groups that have no trip left, which would still be known by name."""
    return sums.take(np.flatnonzero(sums.count > 0.5).tolist())


def _predicted(found: Posterior, rows: TripRows) -> tuple[FloatArray, FloatArray]:
    """Energy [Wh] and its standard deviation with the trip's own error [Wh]."""
    energy, sd = predict_rows(found, rows)
    return energy, np.hypot(sd, np.sqrt(found.scales.noise * rows.numbers("variance_wh2")))


def _frame(rows: TripRows, energy: FloatArray, sd: FloatArray, fold: IntArray, protocol: str) -> pd.DataFrame:
    """Forecasts with intervals; the scores of a vehicle's intervals are those of the vehicles of other folds."""
    observed = rows.numbers("observed_wh")
    score = np.abs(observed - energy) / sd
    factor = np.zeros(len(rows))
    for k in np.unique(fold):
        others = score[fold != k]
        factor[fold == k] = ConformalScores.from_errors((others if len(others) else score).tolist()).factor(
            LEVEL
        )
    return pd.DataFrame(
        {
            "protocol": protocol,
            "car_model": rows.texts("car_model"),
            "vehicle_id": rows.texts("vehicle_id"),
            "distance_m": rows.numbers("distance_m"),
            "ambient_temperature_degc": rows.numbers("ambient_temperature_degc"),
            "observed_wh": observed,
            "predicted_wh": energy,
            "low_wh": energy - factor * sd,
            "high_wh": energy + factor * sd,
        }
    )


def own_trips(rows: TripRows, whole: Sums, scales: Scales, most_vehicles: int = 60) -> pd.DataFrame:
    """Error by the number of own trips: the whole fleet's model, the vehicle's trips alone, the fleet without them.

    Of each vehicle the earliest trips are known and the 10 after the largest number are forecast.

    Parameters
    ----------
    rows : TripRows
    whole : Sums
        Of all rows.
    scales : Scales
    most_vehicles : int
        Vehicles that are looked at, in a seeded order.
    """
    started = rows.texts("started_at")
    ids = rows.texts("vehicle_id")
    vehicles = np.random.default_rng(0).permutation(sorted(set(ids.tolist())))[:most_vehicles]
    errors: dict[int, list[tuple[float, float, float]]] = {k: [] for k in OWN_TRIPS}
    for vehicle in vehicles:
        index = np.flatnonzero(ids == vehicle)
        index = index[np.argsort([f"{started[i]}" for i in index], kind="stable")]
        fitting = [k for k in OWN_TRIPS if k <= len(index) - 5]
        if not fitting:
            continue
        test = rows.where(_mask(len(rows), index[max(fitting) : max(fitting) + 10]))
        observed = test.numbers("observed_wh")
        others = _nonempty(whole - Sums.from_rows(rows.where(_mask(len(rows), index))))
        for k in fitting:
            known = Sums.from_rows(rows.where(_mask(len(rows), index[:k])))
            pooled = _error(
                posterior(others + known, scales) if others.groups else posterior(known, scales),
                test,
                observed,
            )
            own = _error(posterior(known, scales), test, observed) if k else _physics(test, observed)
            fleet = (
                _error(posterior(others, scales), test, observed)
                if others.groups
                else _physics(test, observed)
            )
            errors[k].append((pooled, own, fleet))
    found = [(k, len(e), *np.mean(e, axis=0)) for k, e in errors.items() if e]
    return pd.DataFrame(found, columns=["own_trips", "vehicles", "pooled", "own_only", "fleet_only"])


def _mask(n: int, index: IntArray) -> BoolArray:
    found = np.zeros(n, dtype=bool)
    found[index] = True
    return found


def _error(found: Posterior, rows: TripRows, observed: FloatArray) -> float:
    return float(np.mean(np.abs(predict_rows(found, rows)[0] - observed) / np.abs(observed)))


def _physics(rows: TripRows, observed: FloatArray) -> float:
    return float(np.mean(np.abs(rows.numbers("simulated_wh") - observed) / np.abs(observed)))


def sisters(found: Posterior, rows: TripRows) -> pd.DataFrame:
    """How much more each vehicle takes than its car model on the usual trip of its model, and since when.

    Parameters
    ----------
    found : Posterior
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
        energy[its] += X[its] @ found.weights(name)[0]
    relative = (observed - energy) / np.maximum(np.abs(energy), 1.0)
    started = rows.texts("started_at")
    table = []
    for vehicle in sorted(set(ids.tolist())):
        index = np.flatnonzero(ids == vehicle)
        name = str(models[index[0]])
        its_model = models == name
        usual, mean_wh = X[its_model].mean(axis=0), float(energy[its_model].mean())
        mean, covariance = found.weights(name, vehicle)
        base, _ = found.weights(name)
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


def drift(found: Posterior, rows: TripRows, level: float = LEVEL) -> dict[str, Any]:
    """How new trips compare with their forecasts, of the fleet and of each vehicle, by the linear part.

    Parameters
    ----------
    found : Posterior
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

    energy, sd = _predicted(found, rows)
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
