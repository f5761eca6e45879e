"""One simulation as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tripwatt.arrays import FloatArray
from tripwatt.figures import axes_or_new, figure_of

LEAST_WH: Final = 1.0
"""Causes that never take or give more are left out."""


def plot_simulation(
    time_s: FloatArray,
    by_cause_wh: Mapping[str, FloatArray],
    energy_wh: FloatArray,
    title: str,
    ax: Axes | None,
) -> Figure:
    """Cumulative energy by cause and their sum over time."""
    axis, minutes = axes_or_new(ax, 8.0, 4.4), (time_s - time_s[0]) / 60.0
    for name, energy in by_cause_wh.items():
        if abs(energy).max() > LEAST_WH:
            axis.plot(minutes, energy / 1000.0, lw=1, label=name)
    axis.plot(minutes, energy_wh / 1000.0, color="black", label="total")
    axis.margins(x=0)
    axis.set_xlabel("time [min]")
    axis.set_ylabel("energy at the battery terminals [kWh]")
    axis.set_title(title, fontsize="medium")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure_of(axis)
