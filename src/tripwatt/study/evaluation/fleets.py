"""Score a fleet's linear model on rows of trips: later trips, new vehicles, new car models, few own trips.

The model is fitted from sums over trips: those of held-out trips are subtracted. The scales of the deviations are
fitted to the training part for the split by time, and to all trips for the other protocols. Trees are not evaluated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.errors import InvalidInput
from tripwatt.fleet.deviations import LEVEL, predict_with_error
from tripwatt.fleet.features import START
from tripwatt.fleet.model import predict_rows
from tripwatt.fleet.statistics import TripRows
from tripwatt.hybrid.groups import Scales, Sums, fit_scales, group_posterior
from tripwatt.learners.folds import leave_one_out
from tripwatt.uncertainty import ConformalScores

NEWEST_SHARE: Final = 0.2
"""Share of the trips that the split by time scores: a choice, as usual for such a split."""
VEHICLE_FOLDS: Final = 10
"""Parts of the vehicles that are left out in turn: a choice, as usual for cross-validation."""
OWN_TRIPS: Final = (0, 1, 3, 10, 30)
"""Numbers of own trips with which a vehicle is forecast: a choice, about even steps of the logarithm."""
OWN_VEHICLES: Final = 60
"""Largest number of vehicles that are forecast with own trips, in a seeded random order: a choice, enough for a mean."""

CLASSES: Final = {
    "temperature": (
        "ambient_temperature_degc",
        (-np.inf, 0.0, 10.0, 20.0, np.inf),
        ("below 0 °C", "0 to 10 °C", "10 to 20 °C", "above 20 °C"),
    ),
    "length": (
        "distance_m",
        (0.0, 10e3, 25e3, np.inf),
        ("below 10 km", "10 to 25 km", "above 25 km"),
    ),
}
"""Name of a classification of trips -> column, edges and names of its classes; a class has its lower edge."""


@dataclass(frozen=True, eq=False)
class FleetEvaluation:
    """Forecasts of held-out trips.

    Attributes
    ----------
    trips : DataFrame
        One row per trip and protocol: `protocol`, `car_model`, `vehicle_id`, `distance_m`, `ambient_temperature_degc`,
        `observed_wh`, `predicted_wh`, `low_wh`, `high_wh`.
    own : DataFrame
        One row per number of own trips: `own_trips`, `vehicles`, `pooled`, `own_only`, `fleet_only` (mean relative
        errors).
    """

    trips: pd.DataFrame
    own: pd.DataFrame

    def table(self, by: str) -> pd.DataFrame:
        """Return the mean relative error and the coverage of each protocol, by a column or by "temperature" or "length"."""
        trips, observed = self.trips, self.trips["observed_wh"]
        error = (trips["predicted_wh"] - observed).abs() / observed.abs()
        frame = trips.assign(error=error, inside=observed.between(trips["low_wh"], trips["high_wh"]))
        if by in CLASSES:
            column, edges, names = CLASSES[by]
            of_trips = pd.cut(frame[column], edges, right=False, labels=names)
            frame[by] = of_trips.astype(object).fillna("unknown")
        grouped = frame.groupby(["protocol", by], sort=True)
        means = {name: (name, "mean") for name in ("error", "inside")}
        return grouped.agg(trips=("error", "size"), **means).reset_index()


def evaluate_rows(rows: TripRows, scales: Scales | None = None) -> FleetEvaluation:
    """Score the linear model on rows of trips.

    Parameters
    ----------
    rows : TripRows
    scales : Scales, optional
        Scales of the deviations; fitted to the trips by default.

    Raises
    ------
    InvalidInput
        If there are fewer than two vehicles.
    """
    vehicles, vehicle = np.unique(rows.texts("vehicle_id").astype(str), return_inverse=True)
    if len(vehicles) < 2:
        raise InvalidInput.of("too few vehicles", "fleet", f"{len(vehicles)}", "at least 2")
    all_trips = rows.sums
    scales = scales or fit_scales(all_trips, START)
    fold = np.random.default_rng(0).permutation(len(vehicles))[vehicle] % VEHICLE_FOLDS
    parts = [_later(rows, fold), _left_out(rows, all_trips, scales, fold, fold, "new vehicles")]
    names, car_model = np.unique(rows.texts("car_model").astype(str), return_inverse=True)
    if len(names) > 1:
        parts.append(_left_out(rows, all_trips, scales, car_model, fold, "new car models"))
    held_out = pd.concat([part for part in parts if part is not None], ignore_index=True)
    return FleetEvaluation(held_out, own_trips(rows, all_trips, scales))


def _later(rows: TripRows, fold: IntArray) -> pd.DataFrame | None:
    """Forecast the newest fifth of the trips from all others; returns None if start times are too few or too much alike."""
    started = rows.started
    dated = ~np.isnat(started)
    if dated.sum() < 10:  # fewer trips have no fifth worth a score
        return None
    cut = np.sort(started[dated])[int((1.0 - NEWEST_SHARE) * dated.sum())]
    newest = dated & (started >= cut)
    if newest.all():
        return None
    train = rows.where(~newest).sums
    test = rows.where(newest)
    posterior = group_posterior(train, fit_scales(train, START))
    energy, sd = predict_with_error(posterior, test)
    return _frame(test, energy, sd, fold[newest], "later trips")


def _left_out(
    rows: TripRows, all_trips: Sums, scales: Scales, part: IntArray, fold: IntArray, protocol: str
) -> pd.DataFrame:
    """Forecast the trips of each part from all others."""
    energy, sd = np.zeros(len(rows)), np.zeros(len(rows))
    for split in leave_one_out(part):
        test = rows.take(split.test)
        posterior = group_posterior(_nonempty(all_trips - test.sums), scales)
        energy[split.test], sd[split.test] = predict_with_error(posterior, test)
    return _frame(rows, energy, sd, fold, protocol)


def _nonempty(sums: Sums) -> Sums:
    """Drop the groups without a trip, which would otherwise still count as known."""
    return sums.take(np.flatnonzero(sums.count > 0.5).tolist())


def _frame(rows: TripRows, energy: FloatArray, sd: FloatArray, fold: IntArray, protocol: str) -> pd.DataFrame:
    """Tabulate forecasts with intervals; the intervals of a vehicle are calibrated on the vehicles of other folds."""
    observed = rows.numbers("observed_wh")
    score = np.abs(observed - energy) / sd
    factor = np.zeros(len(rows))
    for split in leave_one_out(fold):
        calibration = score[split.train] if len(split.train) else score
        factor[split.test] = ConformalScores.from_errors(calibration.tolist()).factor(LEVEL)
    return pd.DataFrame(
        {
            "protocol": protocol,
            **{name: rows.texts(name) for name in ("car_model", "vehicle_id")},
            **{name: rows.numbers(name) for name in ("distance_m", "ambient_temperature_degc")},
            "observed_wh": observed,
            "predicted_wh": energy,
            "low_wh": energy - factor * sd,
            "high_wh": energy + factor * sd,
        }
    )


def own_trips(rows: TripRows, all_trips: Sums, scales: Scales) -> pd.DataFrame:
    """Tabulate errors by the number of own trips, for models of the fleet with them, of the own trips alone, and of the fleet without them.

    The earliest trips of each vehicle are its known own trips; up to 10 trips after the largest possible number of them are
    forecast.

    Parameters
    ----------
    rows : TripRows
    all_trips : Sums
        Sums of all rows.
    scales : Scales
    """
    started = rows.texts("started_at")
    ids = rows.texts("vehicle_id")
    vehicles = np.random.default_rng(0).permutation(sorted(set(ids.tolist())))[:OWN_VEHICLES]
    errors: dict[int, list[list[float]]] = {k: [] for k in OWN_TRIPS}
    for vehicle in vehicles:
        index = np.flatnonzero(ids == vehicle)
        index = index[np.argsort([f"{started[i]}" for i in index], kind="stable")]
        fitting = [k for k in OWN_TRIPS if k <= len(index) - 5]
        if not fitting:
            continue
        test = rows.take(index[max(fitting) : max(fitting) + 10])
        fleet_sums = _nonempty(all_trips - rows.take(index).sums)
        for k in fitting:
            own_sums = rows.take(index[:k]).sums
            compared = fleet_sums + own_sums, own_sums, fleet_sums
            errors[k].append([mean_error(sums, scales, test) for sums in compared])
    table = [(k, len(e), *np.mean(e, axis=0)) for k, e in errors.items() if e]
    return pd.DataFrame(table, columns=["own_trips", "vehicles", "pooled", "own_only", "fleet_only"])


def mean_error(sums: Sums, scales: Scales, test: TripRows) -> float:
    """Return the mean relative error on `test` of a model fitted to `sums`, or of the simulation alone if `sums` has no trips."""
    observed, energy = test.numbers("observed_wh"), test.numbers("simulated_wh")
    if sums.groups:
        energy = predict_rows(group_posterior(sums, scales), test)[0]
    return float(np.mean(np.abs(energy - observed) / np.abs(observed)))
