"""Colours, axes and thinning that all figures of a model share; matplotlib is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

BLUE: Final = "#0072B2"  # Okabe & Ito's palette, told apart by every eye
RED: Final = "#D55E00"
GREY: Final = "#999999"
MOST_POINTS: Final = 4000  # more are not seen in a figure, only waited for


def place_for_panels(ax: Axes | None, width_in: float, height_in: float) -> Figure | SubFigure:
    """A new figure of this size, or the place of given axes, from which they are removed."""
    from tripwatt.figures import place_for_panels

    return place_for_panels(ax, width_in, height_in)


def axes_or_new(ax: Axes | None) -> Axes:
    """The given axes, or those of a new figure."""
    from tripwatt.figures import axes_or_new

    return axes_or_new(ax, 5.0, 4.0)


def figure_of(drawn: Axes | SubFigure | Figure) -> Figure:
    """The whole figure of what was drawn."""
    from tripwatt.figures import figure_of

    return figure_of(drawn)


def thin_index(n: int) -> NDArray[np.intp]:
    """Evenly spaced row numbers, all of them where they are few."""
    return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).round().astype(np.intp))
