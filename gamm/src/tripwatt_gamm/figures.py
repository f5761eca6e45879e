"""Colours, axes and thinning that all figures of a model share; the one module that needs matplotlib."""

from __future__ import annotations

from io import BytesIO
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tripwatt_gamm.errors import InvalidInput

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
except ImportError as error:
    raise ImportError("figures need matplotlib: pip install 'tripwatt-gamm[figures]'") from error

BLUE: Final = "#0072B2"  # Okabe & Ito's palette, told apart by every eye
RED: Final = "#D55E00"
GREY: Final = "#999999"
MOST_POINTS: Final = 4000  # more are not seen in a figure, only waited for


class NotebookFigure(Figure):
    """A figure outside of pyplot's list that a notebook shows as a picture."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def axes_or_new(ax: Axes | None) -> Axes:
    """The given axes, or those of a new figure."""
    return NotebookFigure(figsize=(5.0, 4.0), layout="constrained").subplots() if ax is None else ax


def place_for_panels(ax: Axes | None, width_in: float, height_in: float) -> Figure | SubFigure:
    """A new figure of this size, or the place of given axes in their grid, from which they are removed.

    Raises
    ------
    InvalidInput
        When the axes are not part of a grid.
    """
    if ax is None:
        return NotebookFigure(figsize=(width_in, height_in), layout="constrained")
    cell = ax.get_subplotspec()
    if cell is None:
        raise InvalidInput.of("axes without a grid", "ax", f"{ax}", "axes that subplots() made")
    around = ax.figure
    ax.remove()
    return around.add_subfigure(cell)


def figure_of(drawn: Axes | SubFigure | Figure) -> Figure:
    """The whole figure of what was drawn."""
    figure = drawn.figure
    return figure if isinstance(figure, Figure) else figure.figure


def thin_index(n: int) -> NDArray[np.intp]:
    """Evenly spaced row numbers, all of them where they are few."""
    return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).round().astype(np.intp))
