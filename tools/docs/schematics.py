"""The paper's two schematic figures, redrawn from what the code does."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ParamSpec

from tripwatt.hybrid.trip_table import COVARIATES
from tripwatt.study.report.covariates import COVARIATES as WORDS
from tripwatt.study.report.style import INK, new_figure, style_context

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tripwatt.vehicles import Vehicle

P = ParamSpec("P")
Box = tuple[float, float, str]
"""Centre of a box and its text."""


def styled(plot: Callable[P, Figure]) -> Callable[P, Figure]:
    """Run a plot function under `STYLE` and leave the process's settings alone."""

    @functools.wraps(plot)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style_context():
            return plot(*args, **kwargs)

    return wrapper


@styled
def plot_simulation(car: Vehicle) -> Figure:
    """The simulation of a car from speed and road to the energy at the battery terminals (the paper's figure 1).

    Parameters
    ----------
    car : Vehicle
        Under the preset `paper`; its share of regeneration and its base load are shown.
    """
    climate = "none" if car.climate is None else "simulated"
    boxes = {
        "trace": (0.1, 0.75, "time, speed,\nroad grade"),
        "road": (0.36, 0.75, "road load\nair, rolling,\nclimb, inertia"),
        "drive": (0.62, 0.75, "drivetrain\ngear, motor,\ninverter"),
        "battery": (0.88, 0.75, "battery\nOCV, resistance,\ntemperature"),
        "brake": (0.62, 0.25, f"regeneration\n{100 * car.regeneration.fraction:g} % of\nbraking power"),
        "load": (0.36, 0.25, f"base load {car.auxiliaries.base_load_w:g} W\nclimate: {climate}"),
        "energy": (0.88, 0.25, "voltage × current:\ncumulative\nenergy [Wh]"),
    }
    arrows = [
        ("trace", "road"),
        ("road", "drive"),
        ("drive", "battery"),
        ("brake", "drive"),
        ("load", "battery"),
        ("battery", "energy"),
    ]
    return _schematic("Simulation of the car", f"{car.title}, preset {car.preset}", boxes, arrows)


@styled
def plot_hybrid(covariates: Sequence[str] = COVARIATES) -> Figure:
    """The prediction of a trip's energy by the hybrid model (the paper's figure 2).

    Parameters
    ----------
    covariates : sequence of str
        Columns that the corrector reads.
    """
    words = [WORDS.get(name, name) for name in covariates]
    half = (len(words) + 1) // 2
    read = f"{', '.join(words[:half])},\n{', '.join(words[half:])}"
    boxes = {
        "inputs": (0.11, 0.75, "time, speed,\nroad grade"),
        "physics": (0.39, 0.75, "simulation"),
        "simulated": (0.67, 0.75, "simulated\nenergy"),
        "covariates": (0.14, 0.25, "\n".join(_wrapped(read, 24))),
        "corrector": (0.42, 0.25, "corrector\nGAMM, forest\nor boosting"),
        "correction": (0.67, 0.25, "correction\n(learned residual)"),
        "sum": (0.9, 0.5, "sum: energy\nof the trip"),
    }
    arrows = [
        ("inputs", "physics"),
        ("physics", "simulated"),
        ("covariates", "corrector"),
        ("corrector", "correction"),
        ("simulated", "sum"),
        ("correction", "sum"),
    ]
    note = "the correction is learned from measured − simulated energy of training trips"
    return _schematic("Prediction of a trip", note, boxes, arrows)


def _wrapped(text: str, width: int) -> list[str]:
    import textwrap

    return textwrap.wrap(" ".join(text.split()), width)


def _schematic(title: str, note: str, boxes: dict[str, Box], arrows: Sequence[tuple[str, str]]) -> Figure:
    figure = new_figure(2.9, title, note, synthetic=False)
    axes = figure.add_subplot()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    axes.axis("off")
    for key, box in boxes.items():
        _box(axes, key, box)
    for start, end in arrows:
        _arrow(axes, boxes[start], boxes[end], f"{start}-{end}")
    return figure


def _box(axes: Axes, key: str, box: Box) -> None:
    x, y, text = box
    axes.text(
        x,
        y,
        text,
        ha="center",
        va="center",
        fontsize=8,
        gid=key,
        bbox={"boxstyle": "round,pad=0.45", "facecolor": "white", "edgecolor": INK, "linewidth": 1.0},
    )


def _arrow(axes: Axes, start: Box, end: Box, gid: str) -> None:
    gap = 26 if start[0] == end[0] else 41  # boxes are wider than high
    axes.annotate(
        "",
        (end[0], end[1]),
        (start[0], start[1]),
        gid=gid,
        zorder=0,
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.2, "shrinkA": gap, "shrinkB": gap},
    )
