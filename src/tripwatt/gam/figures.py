"""Colours, axes and thinning that all figures of a model share; matplotlib is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE: Final = "#0072B2"  # Okabe & Ito's palette, told apart by every eye
RED: Final = "#D55E00"
GREY: Final = "#999999"
MOST_POINTS: Final = 4000  # more are not seen in a figure, only waited for


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size in inches, outside any interactive state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def axes_or_new(ax: Axes | None) -> Axes:
    """The given axes, or those of a new figure."""
    return new_figure(5.0, 4.0).add_subplot() if ax is None else ax


def thin_index(n: int) -> NDArray[np.intp]:
    """Evenly spaced row numbers, all of them where they are few."""
    return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).round().astype(np.intp))
