"""Colours, new figures and thinning that all figures of a model share."""

from __future__ import annotations

from io import BytesIO
from typing import Final

import numpy as np

from tripwatt_gamm.arrays import FloatArray, Index

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
except ImportError as error:
    raise ImportError("figures need matplotlib: pip install matplotlib") from error

BLUE: Final = "#0072B2"  # Okabe & Ito's palette, whose colours differ for every kind of colour vision
RED: Final = "#D55E00"
GREY: Final = "#999999"
MAX_POINTS: Final = 4000
"""Largest number of points that are drawn; a choice, because more of them only take time."""


class NotebookFigure(Figure):
    """A figure that a notebook shows as a picture, although pyplot does not manage it."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def new_figure(width_in: float, height_in: float) -> Figure:
    """Make an empty figure of a size in inches."""
    return NotebookFigure(figsize=(width_in, height_in), layout="constrained")


def axes_or_new(ax: Axes | None) -> Axes:
    """Return the given axes, or those of a new figure."""
    return new_figure(5.0, 4.0).subplots() if ax is None else ax


def figure_of(ax: Axes) -> Figure:
    """Return the whole figure that axes belong to, also if they are part of a subfigure."""
    figure: Figure | SubFigure = ax.figure
    return figure if isinstance(figure, Figure) else figure.figure


def dots(
    ax: Axes, x: FloatArray, y: FloatArray, xerr: FloatArray | None = None, yerr: FloatArray | None = None
) -> None:
    """Draw points with bars of these half lengths."""
    ax.errorbar(x, y, yerr, xerr, fmt="o", markersize=4, color=BLUE, ecolor=GREY, elinewidth=0.8)


def scatter(ax: Axes, x: FloatArray, y: FloatArray) -> None:
    """Draw points, of which many are thinned by `shown_rows` of `y`."""
    shown = shown_rows(y)
    ax.scatter(x[shown], y[shown], s=7, color=BLUE, alpha=0.35, linewidths=0, rasterized=True)


def shown_rows(values: FloatArray) -> Index:
    """Return the sorted positions of the values to draw: `MAX_POINTS` evenly spaced ones, the 50 smallest and 50 largest."""
    even = np.linspace(0, len(values) - 1, min(len(values), MAX_POINTS)).round().astype(np.intp)
    order = np.argsort(values)
    return np.unique(np.concatenate([even, order[:50], order[-50:]]))
