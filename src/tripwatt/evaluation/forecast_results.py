"""Held-out forecasts as scores, frames and curves: the results of the forecast protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.evaluation.forecast_data import ForecastData
from tripwatt.evaluation.forecast_models import CURVE_DRAWS
from tripwatt.evaluation.forecast_scores import (
    FORECAST,
    FRACTIONS,
    LEVELS,
    UPDATES,
    WITHOUT_PHYSICS,
    ForecastInsight,
    arrival_scores,
    coverage_scores,
    crps,
    crps_scores,
    strata_of,
    strata_scores,
    symmetric_quantiles,
    update_scores,
)
from tripwatt.evaluation.hold_outs import HoldOut
from tripwatt.evaluation.metrics import bootstrap_interval
from tripwatt.evaluation.protocol import FoldResult

PER_TRIP: Final = ("sd", "low", "high", "factors", "pit", "flags", "causes", "updates")
"""Arrays of a fold of the forecast with one row per trip."""
ARRIVALS: Final = ("shown", "arrival", "arrival_chance")
"""Those of the charge at arrival."""


def by_trip_of(hold_out: HoldOut, results: Sequence[FoldResult], name: str | None = None) -> FloatArray:
    """An array of the folds in the order of the scored trips; the predicted energy when no name is given."""
    by_trip: FloatArray | None = None
    for result in results:
        values = result.predicted_wh if name is None else np.asarray(result.extra[name], dtype=np.float64)
        if by_trip is None:
            by_trip = np.full((len(hold_out.table), *values.shape[1:]), np.nan)
        by_trip[hold_out.folds == result.fold] = values
    assert by_trip is not None
    return by_trip[hold_out.scored]


def add_crps_of_points(models: dict[str, Any], frame: pd.DataFrame) -> None:
    """The CRPS of a forecast that names one number is its mean absolute error."""
    for name, score in models.items():
        part = frame[frame["model"] == name]
        score["crps_wh"] = float((part["predicted_energy_wh"] - part["observed_energy_wh"]).abs().mean())


def forecast_scores(
    hold_out: HoldOut, results: Sequence[FoldResult], frame: pd.DataFrame, seed: int
) -> dict[str, Any]:
    """Coverage, CRPS and update scores of the forecast in one hold-out."""
    own = [r for r in results if r.model == FORECAST]
    part = frame[frame["model"] == FORECAST]
    observed, centre = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
    found = {name: by_trip_of(hold_out, own, name) for name in PER_TRIP}
    shown, arrival, chance = (by_trip_of(hold_out, own, name) for name in ARRIVALS)
    return {
        "arrival": arrival_scores(shown, arrival, chance, seed),
        **coverage_scores(observed, found["low"], found["high"], seed),
        **crps_scores(observed, centre, found["sd"], found["factors"]),
        "update": update_scores(observed, found["updates"], seed),
    }


def forecast_insight(
    hold_out: HoldOut, results: Sequence[FoldResult], frame: pd.DataFrame
) -> ForecastInsight | None:
    """Held-out forecasts of one hold-out; None where the forecast was not among the models."""
    own = sorted((r for r in results if r.model == FORECAST), key=lambda r: r.fold)
    if not own:
        return None
    scored = hold_out.scored
    part = frame[frame["model"] == FORECAST]
    found = {name: by_trip_of(hold_out, own, name) for name in PER_TRIP}
    observed, centre = part["observed_energy_wh"].to_numpy(), part["predicted_energy_wh"].to_numpy()
    columns: dict[str, Any] = {
        "trip": part["trip"].to_numpy(),
        "observed_energy_wh": observed,
        "energy_wh": centre,
        "sd_wh": found["sd"],
        "pit": found["pit"],
        "crps_wh": crps(observed, symmetric_quantiles(centre, found["factors"] * found["sd"][:, None])),
        "flags": found["flags"].astype(int),
    }
    for j, level in enumerate(LEVELS):
        columns[f"low_{100 * level:g}"] = found["low"][:, j]
        columns[f"high_{100 * level:g}"] = found["high"][:, j]
    for j, fraction in enumerate(FRACTIONS):
        for k, name in enumerate(UPDATES):
            columns[f"{name}_{100 * fraction:g}"] = found["updates"][:, j, k]
    about = about_trips(hold_out.data, scored).drop(columns="trip")
    trips = pd.concat([pd.DataFrame(columns), about], axis=1)
    names = [hold_out.table.trip_ids[i] for i in scored]
    causes = pd.DataFrame(found["causes"], index=names, columns=own[0].extra["cause_names"].tolist())
    logs = {hold_out.table.trip_ids[i]: hold_out.data.logs[i] for i in scored}
    return ForecastInsight(trips, causes, _series(hold_out, own), logs)


def _series(hold_out: HoldOut, results: Sequence[FoldResult]) -> dict[str, pd.DataFrame]:
    """`Forecast.series` of each trip."""
    found = {}
    for result in results:
        ends = np.cumsum(result.extra["series_rows"])
        pieces = np.split(result.extra["series"], ends[:-1])
        for trip, piece in zip(np.flatnonzero(hold_out.folds == result.fold), pieces, strict=True):
            columns = result.extra["series_names"].tolist()
            found[hold_out.table.trip_ids[trip]] = pd.DataFrame(piece, columns=columns)
    return found


def measured_beside(kept: ForecastInsight) -> dict[str, pd.DataFrame]:
    """The forecast along each trip beside the measured energy, at the ends of the segments."""
    frames = {}
    for trip, series in kept.series.items():
        log = kept.logs[trip]
        time = series["time_s"].to_numpy()
        distance = series["distance_m"].to_numpy()
        speed = np.diff(distance, append=distance[-1]) / np.diff(time, append=time[-1] + 1.0)
        frames[trip] = pd.DataFrame(
            {
                "time_s": time,
                "speed_m_s": speed,
                "observed_energy_wh": np.interp(time, log["time_s"], log["observed_energy_wh"]),
                FORECAST: series["energy_wh"].to_numpy(),
            }
        )
    return frames


def _known(value: float | None) -> float:
    return float("nan") if value is None else value


def about_trips(data: ForecastData, members: IntArray) -> pd.DataFrame:
    """What strata divide by, known at departure, one row per trip."""
    rows = []
    for i in members:
        plan, context = data.plans[i], data.table.trips[i].context
        height = plan.array("elevation_m") if "elevation_m" in plan else np.array([np.nan])
        rows.append(
            {
                "trip": plan.trip_id,
                "duration_s": plan.duration_s,
                "distance_m": plan.distance_m,
                "net_climb_m": float(height[-1] - height[0]),
                "ambient_temperature_degc": _known(plan.departure.ambient_temperature_degc),
                "battery_temperature_degc": _known(plan.departure.battery_temperature_degc),
                "driver": context.driver,
            }
        )
    return pd.DataFrame(rows)


def strata(about: pd.DataFrame, frame: pd.DataFrame, seed: int) -> list[dict[str, Any]]:
    """Mean errors of forecast and data-only model by kind of trip."""
    ape = {str(name): part["ape"].to_numpy() for name, part in frame.groupby("model")}
    if FORECAST not in ape:
        return []
    return strata_scores(strata_of(about), ape[FORECAST], ape.get(WITHOUT_PHYSICS), seed)


def learning_curve(results: Sequence[FoldResult], seed: int) -> list[dict[str, Any]]:
    """Mean APE by number of training trips: the mean over draws, and over the trips that no draw was trained on."""
    rows = []
    by_size: Mapping[int, list[FoldResult]] = {
        size: [r for r in results if int(r.extra["size"]) == size]
        for size in sorted({int(r.extra["size"]) for r in results})
    }
    for size, draws in by_size.items():
        draws = sorted(draws, key=lambda r: int(r.extra["draw"]))
        means = {
            m: np.array([float(np.mean(r.extra[m])) for r in draws]) for m in (FORECAST, WITHOUT_PHYSICS)
        }
        row: dict[str, Any] = {"n_trips": size, "draws": len(draws)}
        for model, values in means.items():
            row[model] = float(values.mean())
            row[f"{model}_by_draw"] = values.tolist()
        difference = means[FORECAST] - means[WITHOUT_PHYSICS]
        row["diff"] = float(difference.mean())
        row["diff_ci95"] = bootstrap_interval(difference, seed) if len(draws) == CURVE_DRAWS else None
        rows.append(row)
    return rows
