"""Colours, axes and thinning that all figures of a model share."""

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
MAX_POINTS: Final = 4000  # more points only take time to draw


class NotebookFigure(Figure):
    """A figure that a notebook shows as a picture, although pyplot does not manage it."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def axes_or_new(ax: Axes | None) -> Axes:
    """The given axes, or those of a new figure."""
    return NotebookFigure(figsize=(5.0, 4.0), layout="constrained").subplots() if ax is None else ax


def place_for_panels(ax: Axes | None, width_in: float, height_in: float) -> Figure | SubFigure:
    """Return a new figure of this size or, if axes are given, a subfigure that replaces them in their grid.

    Raises
    ------
    InvalidInput
        If the axes are not part of a grid.
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
    """Return the whole figure that axes, a subfigure or a figure belong to."""
    figure = drawn.figure
    return figure if isinstance(figure, Figure) else figure.figure


def thin_index(n: int) -> NDArray[np.intp]:
    """Return at most `MAX_POINTS` evenly spaced numbers of `n` rows; all of them if they are fewer."""
    return np.unique(np.linspace(0, n - 1, min(n, MAX_POINTS)).round().astype(np.intp))
