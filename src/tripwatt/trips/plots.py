"""Plots of trips and plans, and of energies by part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tripwatt.arrays import FloatArray
from tripwatt.figures import Axes, Figure, axes_or_new, figure_of, place_for_panels
from tripwatt.trips.samples import Sampled
from tripwatt.units import M_S_PER_KM_H

LINE: Final = "#0b5c8a"
MIN_WH: Final = 1.0
"""Parts of an energy that always stay below this magnitude are not plotted."""


def plot_drive(drive: Sampled, title: str, energy_wh: FloatArray | None, ax: Axes | None) -> Figure:
    """Plot speed along a drive, and elevation and measured energy if they are known."""
    minutes = (drive.array("time_s") - drive.array("time_s")[0]) / 60.0
    curves = [("speed [km/h]", drive.array("speed_m_s") / M_S_PER_KM_H)]
    if drive.has("elevation_m"):
        curves.append(("elevation [m]", drive.array("elevation_m")))
    if energy_wh is not None:
        curves.append(("energy [kWh]", energy_wh / 1000.0))
    place = place_for_panels(ax, 8.0, 1.2 + 1.7 * len(curves))
    axes = place.subplots(len(curves), squeeze=False, sharex=True)[:, 0]
    for axis, (label, values) in zip(axes, curves, strict=True):
        axis.plot(minutes, values, color=LINE, lw=1)
        axis.set_ylabel(label)
        axis.margins(x=0)
    axes[-1].set_xlabel("time [min]")
    place.suptitle(title)
    return figure_of(place)


def plot_parts(
    time_s: FloatArray, parts_wh: Mapping[str, FloatArray], total_wh: FloatArray, title: str, ax: Axes | None
) -> Figure:
    """Plot cumulative energy by part and in total over time, without parts that stay below `MIN_WH`."""
    axis, minutes = axes_or_new(ax, 8.0, 4.4), (time_s - time_s[0]) / 60.0
    for name, energy in parts_wh.items():
        if abs(energy).max() >= MIN_WH:
            axis.plot(minutes, energy / 1000.0, lw=1, label=name)
    axis.plot(minutes, total_wh / 1000.0, color="black", label="total")
    axis.margins(x=0)
    axis.set(xlabel="time [min]", ylabel="energy at the battery terminals [kWh]", title=title)
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure_of(axis)
