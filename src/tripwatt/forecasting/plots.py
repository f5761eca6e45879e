"""Plots of a forecast (energy and state of charge along the way, energy by cause) and of a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.figures import Axes, Figure, axes_or_new, figure_of, place_for_panels
from tripwatt.physics.chain import CAUSE_NAMES
from tripwatt.trips import Departure, Plan, table_of
from tripwatt.units import M_S_PER_KM_H

_LINE, _ABOVE, _BELOW, _TOTAL = "#0b5c8a", "#c8553d", "#3a7d44", "#444444"


def plot_forecast(
    series: pd.DataFrame,
    by_cause_wh: Mapping[str, float],
    title: str,
    measured_until_s: float = 0.0,
    ax: Axes | None = None,
) -> Figure:
    """Plot energy and displayed state of charge along the trip with 90 % bands, and a waterfall of the causes.

    Parameters
    ----------
    series : DataFrame
        Table of `Forecast.to_frame`.
    by_cause_wh : mapping of str to float
        `Forecast.by_cause_wh`.
    title : str
    measured_until_s : float
        Time up to which the trip was measured [s since departure]; 0 before departure.
    ax : Axes, optional
        Axes that the panels replace.
    """
    place = place_for_panels(ax, 10.0, 6.4)
    grid = place.add_gridspec(2, 2, width_ratios=[1.0, 1.15])
    energy = place.add_subplot(grid[0, 0])
    soc = place.add_subplot(grid[1, 0], sharex=energy)
    minutes = series["time_s"] / 60.0
    for axis, of, unit, scale, label in (
        (energy, "energy", "_wh", 1e-3, "energy [kWh]"),
        (soc, "displayed_soc", "", 100.0, "state of charge [%]"),
    ):
        low, middle, high = (scale * series[f"{of}{end}{unit}"] for end in ("_low", "", "_high"))
        axis.fill_between(minutes, low, high, color=_LINE, alpha=0.2, lw=0)
        axis.plot(minutes, middle, color=_LINE)
        if measured_until_s > 0.0:
            axis.axvline(measured_until_s / 60.0, color=_TOTAL, lw=1, ls=":")
        axis.set_ylabel(label)
    soc.set_xlabel("time [min]")
    energy.set_title("expected, with the central 90 % interval", fontsize="medium")
    _waterfall(place.add_subplot(grid[:, 1]), by_cause_wh)
    place.suptitle(title)
    return figure_of(place)


MODEL_SPEEDS_KM_H: Final = (20, 30, 50, 70, 90, 110, 130)
MODEL_AMBIENT_DEGC: Final = (-10.0, 5.0, 20.0)
MODEL_DRIVE_M: Final = 20_000.0


def plot_model(forecast: Callable[[Plan, Departure], Any], car: str, ax: Axes | None = None) -> Figure:
    """Plot the forecast consumption of a flat drive of 20 km at constant speeds and three outside temperatures.

    Parameters
    ----------
    forecast : callable
        `ForecastModel.forecast`.
    car : str
        Name of the car.
    ax : Axes, optional
        Axes to draw in.
    """
    axis = axes_or_new(ax, 7.0, 4.4)
    for ambient, colour, marker in zip(MODEL_AMBIENT_DEGC, (_LINE, _TOTAL, _ABOVE), "so^", strict=True):
        departure = Departure(
            soc=0.9,
            ambient_temperature_degc=ambient,
            cabin_temperature_degc=ambient,
            battery_temperature_degc=ambient,
        )
        forecasts = [forecast(_constant(speed), departure) for speed in MODEL_SPEEDS_KM_H]
        km = MODEL_DRIVE_M / 1000.0
        low, high = np.array([one.interval(0.9) for one in forecasts]).T / km / 10.0
        middle = np.array([one.energy_wh for one in forecasts]) / km / 10.0
        axis.fill_between(MODEL_SPEEDS_KM_H, low, high, color=colour, alpha=0.15, lw=0)
        axis.plot(
            MODEL_SPEEDS_KM_H, middle, color=colour, marker=marker, ms=4, label=f"{ambient:.0f} °C outside"
        )
    axis.set_xlabel("constant speed [km/h]")
    axis.set_ylabel("consumption [kWh/100 km]")
    axis.set_title(f"{car}: flat road, with the central 90 %", fontsize="medium")
    axis.legend()
    return figure_of(axis)


def _constant(speed_km_h: float) -> Plan:
    speed = speed_km_h * M_S_PER_KM_H
    time = np.arange(0.0, MODEL_DRIVE_M / speed + 1.0)
    samples = {"time_s": time, "speed_m_s": np.full(len(time), speed), "grade": np.zeros(len(time))}
    return Plan.from_trace(f"{speed_km_h:g} km/h", table_of(samples))


def _waterfall(axis: Any, by_cause_wh: Mapping[str, float]) -> None:
    values = {k: v / 1000.0 for k, v in by_cause_wh.items() if k != "shortfall" or abs(v) >= 0.5}
    sizes = np.array(list(values.values()))
    ends = np.cumsum(sizes)
    places = np.arange(len(sizes))
    axis.barh(places, sizes, left=ends - sizes, color=np.where(sizes >= 0, _ABOVE, _BELOW))
    axis.barh(len(sizes), ends[-1], color=_TOTAL)
    for place, (end, size) in enumerate(zip(ends, sizes, strict=True)):
        axis.annotate(
            f"{round(size, 2) + 0.0:+.2f}",
            (max(end, end - size), place),
            (4, 0),
            textcoords="offset points",
            va="center",
        )
    axis.annotate(f"{ends[-1]:.2f}", (ends[-1], len(sizes)), (4, 0), textcoords="offset points", va="center")
    axis.set_yticks([*places, len(sizes)], [*(CAUSE_NAMES.get(k, k) for k in values), "total"])
    axis.invert_yaxis()
    reach = np.concatenate([ends, ends - sizes, [0.0]])
    low, high = float(reach.min()), float(reach.max())
    # bars stick to the limits of an axis, their numbers stand beside them
    axis.set_xlim(low - 0.03 * (high - low) * (low < 0.0), high + 0.18 * (high - low))
    axis.set_xlabel("energy at the battery terminals [kWh]")
