"""The common style of all figures: colours, text, width, head, axes in percent.

Every figure is drawn for a column of a phone or half a desktop page.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from tripwatt.figures import ShownFigure
from tripwatt.study.report.view import View

STYLE: Final = matplotlib.rc_params_from_file(
    Path(__file__).with_name("report.mplstyle"), use_default_template=False
)
INK: Final[str] = STYLE["text.color"]
"""Colour of text and of lines that are no model's."""
WIDTH_IN: Final = 5.4
"""Width of every figure: a choice, so that its text is readable on a phone."""


def style_context() -> AbstractContextManager[None]:
    """Replace the matplotlib settings by those of the reports within a `with` block, for drawing and saving."""
    return matplotlib.rc_context(STYLE)


def new_figure(height_in: float, title: str, note: str, synthetic: bool) -> Figure:
    """Make an empty figure of the common width with its head, which is marked if the trips are synthetic."""
    figure = ShownFigure(figsize=(WIDTH_IN, height_in), layout="constrained")
    lines = filter(None, (title, note, "Synthetic trips, not measured ones" if synthetic else ""))
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=9.5, linespacing=1.35)
    return figure


def new_axes(view: View, height_in: float, title: str, note: str = "") -> tuple[Figure, Axes]:
    """Make a figure of a run with one pair of axes.

    Parameters
    ----------
    view : View
        The run; the figure is marked if its trips are synthetic.
    height_in : float
    title, note : str
        Head of the figure.
    """
    figure = new_figure(height_in, title, note, view.synthetic)
    return figure, figure.add_subplot()


def legend_below(figure: Figure, columns: int = 1, **settings: Any) -> Figure:
    """Add a legend below the axes; return the figure."""
    figure.legend(loc="outside lower left", ncols=columns, **settings)
    return figure


def percent_axis(axes: Axes, label: str) -> None:
    """Show the fractions of the x axis as percent."""
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f}".replace("-", "−")))
    axes.set_xlabel(label)
    axes.grid(axis="x")
