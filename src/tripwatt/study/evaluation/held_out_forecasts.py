"""Forecasts of held-out trips: everything that is scored or drawn of them, as plain arrays.

Only the re-forecasts see measurements, and of these no sample after the cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.hybrid.climate_log import TOLD_BY
from tripwatt.study.evaluation.forecast_data import CHARGE_COLUMNS
from tripwatt.study.evaluation.forecast_scores import (
    ARRIVAL_STARTS,
    FRACTIONS,
    LEVELS,
    RESERVE_OFFSETS,
    UPDATE_LEVEL,
)
from tripwatt.trips import Plan

CRPS_LEVELS: Final = 100


@dataclass(frozen=True, eq=False)
class HeldOutForecasts:
    """Forecasts of some trips before departure and on the way.

    Attributes
    ----------
    sd_wh : ndarray, shape (trips,)
    low_wh, high_wh : ndarray, shape (trips, len(LEVELS))
        Bounds of the intervals.
    factors : ndarray, shape (trips, m)
        Half widths in standard deviations at the levels (k + 1/2) / m.
    pit : ndarray, shape (trips,)
        Probability that the forecast gave to less than was measured.
    flags : ndarray of int, shape (trips,)
        Number of flags.
    causes_wh : ndarray, shape (trips, causes)
        Energy by cause.
    cause_names : ndarray of str, shape (causes,)
    updates_wh : ndarray, shape (trips, len(FRACTIONS), len(UPDATES))
        From `reforecast`.
    shown : ndarray, shape (trips,)
        Displayed charge at arrival; NaN where it was not logged.
    arrival : ndarray, shape (trips, len(ARRIVAL_STARTS), 3)
        Its forecast median and the bounds of its interval of `UPDATE_LEVEL`; NaN where the start was not known.
    arrival_chance : ndarray, shape (trips, len(ARRIVAL_STARTS), len(RESERVE_OFFSETS))
        Probability to arrive with the median plus each of `RESERVE_OFFSETS`.
    series : ndarray, shape (rows of all trips, columns)
        `Forecast.series` of each trip, one after the other.
    series_names : ndarray of str, shape (columns,)
    series_rows : ndarray of int, shape (trips,)
    """

    sd_wh: FloatArray
    low_wh: FloatArray
    high_wh: FloatArray
    factors: FloatArray
    pit: FloatArray
    flags: IntArray
    causes_wh: FloatArray
    cause_names: npt.NDArray[np.str_]
    updates_wh: FloatArray
    shown: FloatArray
    arrival: FloatArray
    arrival_chance: FloatArray
    series: FloatArray
    series_names: npt.NDArray[np.str_]
    series_rows: IntArray

    @classmethod
    def from_forecasts(
        cls,
        model: ForecastModel,
        plans: Sequence[Plan],
        forecasts: Sequence[Forecast],
        logs: Sequence[pd.DataFrame],
    ) -> HeldOutForecasts:
        """Score forecasts of a model on what was measured.

        Parameters
        ----------
        model : ForecastModel
            For the forecasts of the charge at arrival.
        plans : sequence of Plan
        forecasts : sequence of Forecast
        logs : sequence of DataFrame
            From `measured_log`.
        """
        levels = (np.arange(CRPS_LEVELS) + 0.5) / CRPS_LEVELS
        bounds = np.array([[f.interval(level) for level in LEVELS] for f in forecasts])
        pairs = list(zip(forecasts, logs, strict=True))
        series = [f.to_frame() for f in forecasts]
        arrivals = [arrivals_of(model, plan) for plan in plans]
        return cls(
            sd_wh=np.array([f.sd_wh for f in forecasts]),
            low_wh=bounds[:, :, 0],
            high_wh=bounds[:, :, 1],
            factors=np.array([[f.uncertainty.scores.factor(level) for level in levels] for f in forecasts]),
            pit=np.array(
                [f.probability_below(float(log["observed_energy_wh"].iloc[-1])) for f, log in pairs]
            ),
            flags=np.array([len(f.flags) for f in forecasts]),
            causes_wh=np.array([list(f.by_cause_wh.values()) for f in forecasts]),
            cause_names=np.array(list(forecasts[0].by_cause_wh)),
            updates_wh=np.array([[reforecast(f, log, x) for x in FRACTIONS] for f, log in pairs]),
            shown=np.array([_shown_at_arrival(log) for log in logs]),
            arrival=np.array([bounds for bounds, _ in arrivals]),
            arrival_chance=np.array([chance for _, chance in arrivals]),
            series=np.concatenate([s.to_numpy(dtype=np.float64) for s in series]),
            series_names=np.array(list(series[0].columns)),
            series_rows=np.array([len(s) for s in series]),
        )

    @classmethod
    def joined(cls, parts: Sequence[HeldOutForecasts], order: IntArray) -> HeldOutForecasts:
        """The trips of several parts, one after the other, and then in an order."""
        first = parts[0]
        pieces = [piece for part in parts for piece in part.pieces()]
        whole: dict[str, npt.NDArray[Any]] = {"series": np.concatenate([pieces[i] for i in order])}
        whole |= {"cause_names": first.cause_names, "series_names": first.series_names}
        rows: dict[str, npt.NDArray[Any]] = {
            name: np.concatenate([vars(part)[name] for part in parts])[order]
            for name in vars(first)
            if name not in whole
        }
        return cls(**rows, **whole)

    def pieces(self) -> list[FloatArray]:
        """`series` of each trip."""
        return np.split(self.series, np.cumsum(self.series_rows)[:-1])


def _shown_at_arrival(log: pd.DataFrame) -> float:
    shown = log["displayed_soc"].dropna().to_numpy() if "displayed_soc" in log else np.empty(0)
    return float(shown[-1]) if len(shown) else np.nan


def arrivals_of(model: ForecastModel, plan: Plan) -> tuple[FloatArray, FloatArray]:
    """Displayed charge at arrival of a trip, as forecast from each start of `ARRIVAL_STARTS` alone.

    Parameters
    ----------
    model : ForecastModel
    plan : Plan

    Returns
    -------
    bounds : ndarray, shape (len(ARRIVAL_STARTS), 3)
        Median and bounds of the interval of `UPDATE_LEVEL`; NaN where the start is not known.
    chance : ndarray, shape (len(ARRIVAL_STARTS), len(RESERVE_OFFSETS))
        Probability to arrive with the median plus each of `RESERVE_OFFSETS`.
    """
    bounds = np.full((len(ARRIVAL_STARTS), 3), np.nan)
    chance = np.full((len(ARRIVAL_STARTS), len(RESERVE_OFFSETS)), np.nan)
    for row, start in enumerate(ARRIVAL_STARTS):
        if getattr(plan.departure, start) is not None:
            others = {other: None for other in ARRIVAL_STARTS if other != start}
            forecast = model.forecast(replace(plan, departure=replace(plan.departure, **others)))
            bounds[row] = forecast.soc_arrival, *forecast.arrival.interval(UPDATE_LEVEL)
            chance[row] = [forecast.arrival.p_above(bounds[row, 0] + offset) for offset in RESERVE_OFFSETS]
    return bounds, chance


def reforecast(forecast: Forecast, log: pd.DataFrame, fraction: float) -> list[float]:
    """Energy of the whole trip after a fraction of its time, in the order of `UPDATES` [Wh].

    Parameters
    ----------
    forecast : Forecast
        Before departure.
    log : DataFrame
        From `measured_log`; rows after the cut are not used, except that the gauge needs the whole distance.
    fraction : float

    Returns
    -------
    list of float
        NaN where a measurement is missing. The gauge of a car that has not moved yet shows the departure forecast.
    """
    planned_series = forecast.to_frame()
    cut = fraction * float(planned_series["time_s"].iloc[-1])
    so_far = log[log["time_s"] <= cut]
    if len(so_far) < 2:
        same = forecast.energy_wh
        return [same, float("nan"), same, same, *forecast.interval(UPDATE_LEVEL)]
    last = so_far.iloc[-1]
    measured = ["time_s", "observed_energy_wh", *(c for c in TOLD_BY if c in so_far)]
    updated = forecast.update_since_departure(so_far[measured])
    charge = [c for c in CHARGE_COLUMNS if c in so_far and so_far[c].notna().any()]
    by_charge = (
        forecast.update_since_departure(so_far[["time_s", *charge]]).energy_wh if charge else float("nan")
    )
    then = float(np.interp(last["time_s"], planned_series["time_s"], planned_series["energy_wh"]))
    metres, whole = float(last["distance_m"]), float(planned_series["distance_m"].iloc[-1])
    gauge = float(last["observed_energy_wh"]) * whole / metres if metres > 0.0 else forecast.energy_wh
    no_update = float(last["observed_energy_wh"]) + forecast.energy_wh - then
    return [updated.energy_wh, by_charge, no_update, gauge, *updated.interval(UPDATE_LEVEL)]
