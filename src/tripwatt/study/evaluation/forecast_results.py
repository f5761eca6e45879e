"""Held-out forecasts as scores, frames and curves: the results of the forecast protocol."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import IntArray
from tripwatt.study.evaluation.comparison import Comparison
from tripwatt.study.evaluation.forecast_data import ForecastData
from tripwatt.study.evaluation.forecast_scores import (
    FORECAST,
    FRACTIONS,
    LEVELS,
    UPDATES,
    WITHOUT_PHYSICS,
    arrival_scores,
    coverage_scores,
    crps,
    crps_scores,
    strata_of,
    strata_scores,
    symmetric_quantiles,
    update_scores,
)
from tripwatt.study.evaluation.held_out_forecasts import HeldOutForecast, stack
from tripwatt.study.evaluation.hold_outs import HoldOut
from tripwatt.study.evaluation.metrics import absolute_percentage_error, bootstrap_interval

CURVE_DRAWS: Final = 6
"""Number of random draws of training trips for each size of the learning curve: a choice, because each draw is a fit."""


def forecast_scores(
    forecasts: Sequence[HeldOutForecast], part: pd.DataFrame, seed: int, days: Sequence[str] | None = None
) -> dict[str, Any]:
    """Score arrival, coverage, CRPS and updates of the forecasts of a hold-out; `part` has their rows of the folds, `days` their days."""
    observed, centre = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
    bounds, factors = stack(forecasts, "bounds_wh"), stack(forecasts, "factors")
    shown, arrival, chance = (stack(forecasts, name) for name in ("shown", "arrival", "arrival_chance"))
    return {
        "arrival": arrival_scores(shown, arrival, chance, seed),
        **coverage_scores(observed, bounds[:, :, 0], bounds[:, :, 1], seed),
        **crps_scores(observed, centre, stack(forecasts, "sd_wh"), factors),
        "update": update_scores(observed, stack(forecasts, "updates_wh"), seed, days),
    }


def forecast_frame(
    hold_out: HoldOut[ForecastData], forecasts: Sequence[HeldOutForecast], part: pd.DataFrame
) -> pd.DataFrame:
    """Tabulate the forecasts of a hold-out, one row for each; `part` has their rows of the folds.

    Columns: `trip, observed_energy_wh, energy_wh, sd_wh, pit, crps_wh, flags`; bounds `low_50, high_50, ...` by
    nominal level in percent; for each fraction of the trip's time and each of `UPDATES` a column such as `update_25`
    [Wh]; and the columns of `departure_table`.
    """
    observed, centre = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
    sd_wh, bounds = stack(forecasts, "sd_wh"), stack(forecasts, "bounds_wh")
    half_wh = stack(forecasts, "factors") * sd_wh[:, None]
    columns: dict[str, Any] = {
        "trip": part["trip"].to_numpy(),
        "observed_energy_wh": observed,
        "energy_wh": centre,
        "sd_wh": sd_wh,
        "pit": stack(forecasts, "pit"),
        "crps_wh": crps(observed, symmetric_quantiles(centre, half_wh)),
        "flags": stack(forecasts, "flags"),
    }
    for j, level in enumerate(LEVELS):
        columns[f"low_{100 * level:g}"], columns[f"high_{100 * level:g}"] = bounds[:, j].T
    updates = stack(forecasts, "updates_wh")
    for (j, fraction), (k, name) in itertools.product(enumerate(FRACTIONS), enumerate(UPDATES)):
        columns[f"{name}_{100 * fraction:g}"] = updates[:, j, k]
    about = departure_table(hold_out.data, hold_out.tested).drop(columns="trip")
    return pd.concat([pd.DataFrame(columns), about], axis=1)


def departure_table(data: ForecastData, members: IntArray) -> pd.DataFrame:
    """Tabulate what strata are divided by, known at departure: one row per trip."""
    plans = [data.plans[i] for i in members]
    heights = [plan.array("elevation_m") if "elevation_m" in plan else np.array([np.nan]) for plan in plans]
    return pd.DataFrame(
        {
            "trip": [plan.trip_id for plan in plans],
            "duration_s": [plan.duration_s for plan in plans],
            "distance_m": [plan.distance_m for plan in plans],
            "net_climb_m": [float(height[-1] - height[0]) for height in heights],
            "ambient_temperature_degc": [plan.departure.ambient_temperature_degc for plan in plans],
            "battery_temperature_degc": [plan.departure.battery_temperature_degc for plan in plans],
            "driver": [data.table.trips[i].context.driver for i in members],
        }
    )


def strata(main: Comparison, seed: int) -> list[dict[str, Any]]:
    """Return mean errors of forecast and data-only model by stratum; empty if the forecast is not among the models."""
    names = {spec.name for spec in main.specs}
    if FORECAST not in names:
        return []
    about = departure_table(main.hold_out.data, main.hold_out.scored)
    other = main.ape(WITHOUT_PHYSICS) if WITHOUT_PHYSICS in names else None
    days = [main.hold_out.table.days[i] for i in main.hold_out.scored]
    return strata_scores(strata_of(about), main.ape(FORECAST), other, seed, days)


def learning_curve(draws: Comparison, seed: int) -> list[dict[str, Any]]:
    """Return the mean APE by number of training trips: the mean over draws of the mean over each draw's remaining trips.

    Parameters
    ----------
    draws : Comparison
        Comparison of the forecast's centre and the model without physics on random draws of trips.
    seed : int
    """
    segments = draws.hold_out.data.segments
    observed = segments.totals_wh(segments.observed_power_w)
    by_size: dict[int, dict[str, dict[int, float]]] = {}
    for result in draws.results:
        split = result.split
        error = float(absolute_percentage_error(observed[split.test], result.predicted_wh).mean())
        by_size.setdefault(len(split.train), {}).setdefault(result.model, {})[split.draw] = error
    rows = []
    for size, errors in sorted(by_size.items()):
        means = {m: np.array([errors[m][k] for k in sorted(errors[m])]) for m in (FORECAST, WITHOUT_PHYSICS)}
        difference = means[FORECAST] - means[WITHOUT_PHYSICS]
        row: dict[str, Any] = {"n_trips": size, "draws": len(difference)}
        for model, values in means.items():
            row |= {model: float(values.mean()), f"{model}_by_draw": values.tolist()}
        interval = bootstrap_interval(difference, seed) if len(difference) == CURVE_DRAWS else None
        rows.append(row | {"diff": float(difference.mean()), "diff_ci95": interval})
    return rows
