"""Plots of a forecast (energy and state of charge along the way, energy by cause)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from tripwatt.figures import Axes, Figure, figure_of, place_for_panels
from tripwatt.physics.chain import CAUSE_NAMES

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
    for axis, quantity, unit, scale, label in (
        (energy, "energy", "_wh", 1e-3, "energy [kWh]"),
        (soc, "displayed_soc", "", 100.0, "state of charge [%]"),
    ):
        low, middle, high = (scale * series[f"{quantity}{end}{unit}"] for end in ("_low", "", "_high"))
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


def _waterfall(axis: Any, by_cause_wh: Mapping[str, float]) -> None:
    values = {k: v / 1000.0 for k, v in by_cause_wh.items() if k != "shortfall" or abs(v) >= 0.5}
    sizes = np.array(list(values.values()))
    ends = np.cumsum(sizes)
    places = np.arange(len(sizes))
    axis.barh(places, sizes, left=ends - sizes, color=np.where(sizes >= 0, _ABOVE, _BELOW))
    axis.barh(len(sizes), ends[-1], color=_TOTAL)
    texts = [*(f"{round(size, 2) + 0.0:+.2f}" for size in sizes), f"{ends[-1]:.2f}"]
    for place, end in enumerate((*np.maximum(ends, ends - sizes), ends[-1])):
        axis.annotate(texts[place], (end, place), (4, 0), textcoords="offset points", va="center")
    axis.set_yticks([*places, len(sizes)], [*(CAUSE_NAMES.get(k, k) for k in values), "total"])
    axis.invert_yaxis()
    reach = np.concatenate([ends, ends - sizes, [0.0]])
    low, high = float(reach.min()), float(reach.max())
    # bars stick to the limits of an axis, their numbers stand beside them
    axis.set_xlim(low - 0.03 * (high - low) * (low < 0.0), high + 0.18 * (high - low))
    axis.set_xlabel("energy at the battery terminals [kWh]")
