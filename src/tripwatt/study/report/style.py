"""What all figures share: colours, text, width, the head, axes in percent.

Every figure is drawn for a column of a phone or half a desktop page. Text and rules use the colours `INK`, `RULE`
and `PAPER_COLOUR` alone, which the page exchanges for its own, so that a figure follows a dark page.
"""

from __future__ import annotations

from collections.abc import Sequence
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
RULE: Final[str] = STYLE["grid.color"]
PAPER_COLOUR: Final[str] = STYLE["figure.facecolor"]
BLACK: Final = "#000000"
"""In the figures of a GAMM: the page exchanges it as it does `INK`."""
WIDTH_IN: Final = 5.4


def style_context() -> AbstractContextManager[None]:
    """The process's matplotlib settings replaced by those of the reports for a while, for drawing and for saving."""
    return matplotlib.rc_context(STYLE)


def new_figure(height_in: float, title: str, note: str, synthetic: bool) -> Figure:
    """An empty figure of the common width with its head, marked where the trips are made up."""
    figure = ShownFigure(figsize=(WIDTH_IN, height_in), layout="constrained")
    lines = [title, *([note] if note else [])]
    if synthetic:
        lines.append("Synthetic trips, not measured ones")
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=9.5, linespacing=1.35)
    return figure


def plotted(view: View, height_in: float, title: str, note: str = "") -> tuple[Figure, Axes]:
    """A figure of a run with one pair of axes.

    Parameters
    ----------
    view : View
        Of which it is marked whether the trips are made up.
    height_in : float
    title, note : str
        Its head.
    """
    figure = new_figure(height_in, title, note, view.synthetic)
    return figure, figure.add_subplot()


def stacked(
    view: View, height_in: float, head: tuple[str, str], rows: int, **settings: Any
) -> tuple[Figure, list[Axes]]:
    """The same with a title and a note in `head` and several pairs of axes, one below the other."""
    figure = new_figure(height_in, *head, view.synthetic)
    return figure, list(figure.subplots(rows, 1, squeeze=False, **settings)[:, 0])


def legend_below(figure: Figure, columns: int = 1, **settings: Any) -> Figure:
    """The figure with its legend below the axes."""
    figure.legend(loc="outside lower left", ncols=columns, **settings)
    return figure


def percent_axis(axes: Axes, label: str) -> None:
    """An x axis that shows fractions as percent."""
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f}".replace("-", "−")))
    axes.set_xlabel(label)
    axes.grid(axis="x")


def row_names(axes: Axes, names: Sequence[str], **text: Any) -> None:
    """One named row each, the first on top."""
    axes.set_yticks(range(len(names)), names, **text)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
