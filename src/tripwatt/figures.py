"""Figures of matplotlib that a notebook shows and `show` opens, without pyplot's list of figures.

The method `plot(ax=None)` of an object returns the figure. A single chart is drawn in `ax`; several charts share its place.
"""

from __future__ import annotations

from io import BytesIO

from tripwatt.errors import InvalidInput, extras_faults

try:
    from matplotlib.axes import Axes as Axes
    from matplotlib.backend_bases import FigureManagerBase
    from matplotlib.figure import Figure as Figure
    from matplotlib.figure import SubFigure
except ImportError as error:
    raise InvalidInput(extras_faults({"figures": "a picture"})) from error


class ShownFigure(Figure):
    """A figure without pyplot: a notebook shows it as a picture, also without `%matplotlib`.

    Examples
    --------
    >>> figure = ShownFigure(figsize=(4.0, 3.0))
    >>> figure._repr_png_()[1:4]
    b'PNG'
    """

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()

    def show(self, warn: bool = True) -> None:
        """Open the figure in a window, as `pyplot.show` does; without a display nothing opens.

        Parameters
        ----------
        warn : bool
            Without effect; it is there because `matplotlib.figure.Figure.show` has it.
        """
        from matplotlib import pyplot

        pyplot.figure(FigureClass=lambda **settings: self)  # type: ignore[arg-type]  # this one, no new one
        pyplot.show()
        # a base manager has no window whose closing would remove the figure from pyplot's list
        if type(self.canvas.manager) is FigureManagerBase:
            pyplot.close(self)


def axes_or_new(ax: Axes | None, width_in: float, height_in: float) -> Axes:
    """The given axes, or those of a new figure of this size."""
    return ShownFigure(figsize=(width_in, height_in), layout="constrained").subplots() if ax is None else ax


def place_for_panels(ax: Axes | None, width_in: float, height_in: float) -> Figure | SubFigure:
    """A new figure of this size if `ax` is None; otherwise an empty subfigure in the place of `ax`, which is removed.

    Raises
    ------
    InvalidInput
        When the axes are not part of a grid.

    Examples
    --------
    >>> figure = Figure()
    >>> left, right = figure.subplots(1, 2)
    >>> place = place_for_panels(right, 4.0, 3.0)
    >>> len(place.subplots(2)), figure_of(place) is figure, len(figure.axes)
    (2, True, 3)
    """
    if ax is None:
        return ShownFigure(figsize=(width_in, height_in), layout="constrained")
    cell = ax.get_subplotspec()
    if cell is None:
        allowed = "axes that subplots() or add_subplot() made"
        raise InvalidInput.of("axes without a grid", "ax", f"{ax}", allowed)
    around = ax.figure
    ax.remove()
    return around.add_subfigure(cell)


def figure_of(drawn: Axes | Figure | SubFigure) -> Figure:
    """The figure that contains the given axes, figure or subfigure."""
    figure = drawn.figure
    return figure if isinstance(figure, Figure) else figure.figure
