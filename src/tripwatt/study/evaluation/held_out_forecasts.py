"""Everything about forecasts of held-out trips that is scored or drawn in figures.

Only re-forecasts use measurements, and only samples up to the cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
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
"""Levels of which the CRPS is averaged: a choice, one for each percent."""


@dataclass(frozen=True, eq=False, slots=True)
class HeldOutForecast:
    """The forecast of a trip before departure and on the way.

    Attributes
    ----------
    sd_wh : float
    bounds_wh : ndarray, shape (len(LEVELS), 2)
        Bounds of the intervals.
    factors : ndarray, shape (m,)
        Half widths in standard deviations at the levels (k + 1/2) / m.
    pit : float
        Forecast probability of an energy below the measured one.
    flags : int
        Number of flags.
    updates_wh : ndarray, shape (len(FRACTIONS), len(UPDATES))
        From `reforecast`.
    shown : float
        Displayed charge at arrival; NaN if it was not logged.
    arrival : ndarray, shape (len(ARRIVAL_STARTS), 3)
        Forecast median of that charge and the bounds of its interval of `UPDATE_LEVEL`; NaN if the start was not known.
    arrival_chance : ndarray, shape (len(ARRIVAL_STARTS), len(RESERVE_OFFSETS))
        Probability to arrive with more than the median plus each of `RESERVE_OFFSETS`.
    """

    sd_wh: float
    bounds_wh: FloatArray
    factors: FloatArray
    pit: float
    flags: int
    updates_wh: FloatArray
    shown: float
    arrival: FloatArray
    arrival_chance: FloatArray

    @classmethod
    def from_forecast(
        cls, model: ForecastModel, plan: Plan, forecast: Forecast, log: pd.DataFrame
    ) -> HeldOutForecast:
        """Score a forecast of a model on what was measured.

        Parameters
        ----------
        model : ForecastModel
            Fitted model, for the forecasts of the charge at arrival.
        plan : Plan
        forecast : Forecast
        log : DataFrame
            From `measured_log`.
        """
        levels = (np.arange(CRPS_LEVELS) + 0.5) / CRPS_LEVELS
        arrival, chance = forecast_arrivals(model, plan)
        shown = log["displayed_soc"].dropna().tolist() if "displayed_soc" in log else []
        return cls(
            sd_wh=forecast.sd_wh,
            bounds_wh=np.array([forecast.interval(level) for level in LEVELS]),
            factors=np.array([forecast.uncertainty.scores.factor(level) for level in levels]),
            pit=forecast.probability_below(float(log["observed_energy_wh"].iloc[-1])),
            flags=len(forecast.flags),
            updates_wh=np.array([reforecast(forecast, log, x) for x in FRACTIONS]),
            shown=shown[-1] if shown else np.nan,
            arrival=arrival,
            arrival_chance=chance,
        )


def stack(forecasts: Sequence[HeldOutForecast], name: str) -> FloatArray:
    """Stack the attribute `name` of all forecasts."""
    return np.array([getattr(forecast, name) for forecast in forecasts])


def forecast_arrivals(model: ForecastModel, plan: Plan) -> tuple[FloatArray, FloatArray]:
    """Forecast the displayed charge at arrival of a trip, with only one of the fields `ARRIVAL_STARTS` of the departure at a time.

    Parameters
    ----------
    model : ForecastModel
    plan : Plan

    Returns
    -------
    soc : ndarray, shape (len(ARRIVAL_STARTS), 3)
        Median and bounds of the interval of `UPDATE_LEVEL`; NaN, as in `chance`, if the field is not known.
    chance : ndarray, shape (len(ARRIVAL_STARTS), len(RESERVE_OFFSETS))
        Probability to arrive with more than the median plus each of `RESERVE_OFFSETS`.
    """
    soc = np.full((len(ARRIVAL_STARTS), 3), np.nan)
    chance = np.full((len(ARRIVAL_STARTS), len(RESERVE_OFFSETS)), np.nan)
    for row, start in enumerate(ARRIVAL_STARTS):
        if getattr(plan.departure, start) is not None:
            others = {other: None for other in ARRIVAL_STARTS if other != start}
            forecast = model.forecast(replace(plan, departure=replace(plan.departure, **others)))
            soc[row] = forecast.soc_arrival, *forecast.arrival.interval(UPDATE_LEVEL)
            chance[row] = [forecast.arrival.p_above(soc[row, 0] + offset) for offset in RESERVE_OFFSETS]
    return soc, chance


def reforecast(forecast: Forecast, log: pd.DataFrame, fraction: float) -> list[float]:
    """Forecast the energy of the whole trip after a fraction of its time, in the order of `UPDATES` [Wh].

    Parameters
    ----------
    forecast : Forecast
        Forecast before departure.
    log : DataFrame
        From `measured_log`; rows after the cut are not used.
    fraction : float

    Returns
    -------
    list of float
        NaN if a measurement is missing. The gauge of a car that has not moved yet shows the forecast before departure.
    """
    planned = forecast.to_frame()
    cut = fraction * float(planned["time_s"].iloc[-1])
    so_far = log[log["time_s"] <= cut]
    if len(so_far) < 2:
        energy_wh = forecast.energy_wh
        return [energy_wh, np.nan, energy_wh, energy_wh, *forecast.interval(UPDATE_LEVEL)]
    last = so_far.iloc[-1]
    measured = ["time_s", "observed_energy_wh", *(c for c in TOLD_BY if c in so_far)]
    updated = forecast.update_since_departure(so_far[measured])
    charge = [c for c in CHARGE_COLUMNS if c in so_far and so_far[c].notna().any()]
    by_charge = forecast.update_since_departure(so_far[["time_s", *charge]]).energy_wh if charge else np.nan
    planned_so_far_wh = float(np.interp(last["time_s"], planned["time_s"], planned["energy_wh"]))
    driven_m, trip_m = float(last["distance_m"]), float(planned["distance_m"].iloc[-1])
    gauge = float(last["observed_energy_wh"]) * trip_m / driven_m if driven_m > 0.0 else forecast.energy_wh
    no_update = float(last["observed_energy_wh"]) + forecast.energy_wh - planned_so_far_wh
    return [updated.energy_wh, by_charge, no_update, gauge, *updated.interval(UPDATE_LEVEL)]
