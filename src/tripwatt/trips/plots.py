"""Pictures of departures, trips and plans."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tripwatt.arrays import FloatArray
from tripwatt.figures import axes_or_new, figure_of, place_for_panels
from tripwatt.trips.samples import Sampled
from tripwatt.units import M_S_PER_KM_H

LINE: Final = "#0b5c8a"


def plot_drive(drive: Sampled, title: str, energy_wh: FloatArray | None, ax: Axes | None) -> Figure:
    """Speed along a drive, with elevation and measured energy where they are known."""
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


def plot_table(title: str, rows: Sequence[tuple[str, str]], ax: Axes | None) -> Figure:
    """Names and values as a picture."""
    axis = axes_or_new(ax, 6.0, 0.7 + 0.3 * max(len(rows), 1))
    axis.set_axis_off()
    axis.set_title(title)
    if rows:
        axis.table(cellText=[list(row) for row in rows], loc="center", cellLoc="left", edges="horizontal")
    else:
        axis.text(0.5, 0.5, "nothing is known", ha="center", va="center")
    return figure_of(axis)
