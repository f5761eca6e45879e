"""What all figures share: colours, text, width, the head, axes in percent.

Every figure is drawn for a column of a phone or half a desktop page. Text and rules use the colours `INK`, `RULE`
and `PAPER_COLOUR` alone, which the page exchanges for its own, so that a figure follows a dark page.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Final, ParamSpec

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.report.models import model_style
from tripwatt.report.view import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")

INK: Final = "#1f2328"
RULE: Final = "#d0d7de"
PAPER_COLOUR: Final = "#ffffff"
WIDTH_IN: Final = 5.4
CUT: Final = 1.5
"""Errors beyond this fraction are drawn at the edge and counted in words, or a few would flatten all others."""

STYLE: Final[Mapping[str, Any]] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "text.color": INK,
    "text.parse_math": False,  # a trip may be called "$x"
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "grid.color": RULE,
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": PAPER_COLOUR,
    "savefig.facecolor": PAPER_COLOUR,
    "svg.fonttype": "none",
    "svg.hashsalt": "tripwatt",
}


def style_context() -> AbstractContextManager[None]:
    """The process's matplotlib settings replaced by `STYLE` for a while, for drawing and for saving."""
    import matplotlib

    settings: Any = dict(STYLE)  # matplotlib types the keys as a literal of its own version's names
    return matplotlib.rc_context(settings)


def styled(plot: Callable[P, Figure]) -> Callable[P, Figure]:
    """Run a plot function under `STYLE` and leave the process's settings alone."""

    @functools.wraps(plot)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style_context():
            return plot(*args, **kwargs)

    return wrapper


def new_figure(height_in: float, title: str, note: str, synthetic: bool) -> Figure:
    """An empty figure of the common width with its head; one of made-up trips says so."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    lines = [title, *([note] if note else [])]
    if synthetic:
        lines.append("Synthetic trips, not measured ones")
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=9.5, linespacing=1.35)
    return figure


def percent_axis(axes: Axes, label: str) -> None:
    """An x axis that shows fractions as percent."""
    from matplotlib.ticker import FuncFormatter

    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f}".replace("-", "−")))
    axes.set_xlabel(label)
    axes.grid(axis="x")


def model_rows(axes: Axes, models: Sequence[str]) -> None:
    """One row per model, the first on top."""
    axes.set_yticks(range(len(models)), [plain(model_style(m).label, 28) for m in models])
    axes.set_ylim(len(models) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def cut_at(values: FloatArray) -> float:
    """Where an axis ends that shows all values, or all but those beyond `CUT`."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return min(1.08 * largest or 1.0, CUT)


def mark_beyond(axes: Axes, values: FloatArray, limit: float, y: float, colour: str) -> None:
    """Marks at the edge, with their number, for values that the axis does not reach."""
    for side, beyond in ((1.0, int((values > limit).sum())), (-1.0, int((values < -limit).sum()))):
        if beyond:
            axes.plot(side * limit, y, marker=">" if side > 0 else "<", color=colour, ms=6, clip_on=False)
            offset = (-7, 5) if side > 0 else (7, 5)
            axes.annotate(
                f"{beyond} beyond",
                (side * limit, y),
                offset,
                textcoords="offset points",
                fontsize=7.5,
                ha="right" if side > 0 else "left",
            )
