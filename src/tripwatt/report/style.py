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
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.figures import ShownFigure
from tripwatt.report.model_styles import model_style
from tripwatt.report.view import Record, View, plain

STYLE: Final = matplotlib.rc_params_from_file(
    Path(__file__).with_name("report.mplstyle"), use_default_template=False
)
INK: Final[str] = STYLE["text.color"]
RULE: Final[str] = STYLE["grid.color"]
PAPER_COLOUR: Final[str] = STYLE["figure.facecolor"]
FORECAST_COLOUR: Final = "#0f8797"
PLAIN_COLOUR: Final = "#7c7c7c"
WARM_COLOUR: Final = "#d55e00"
WIDTH_IN: Final = 5.4
CUT: Final = 1.5
"""Errors beyond this fraction are drawn at the edge and counted in words, or a few would flatten all others."""


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


def diagonal(axes: Axes, low: float, inside: str, stated: str) -> None:
    """Axes for shares that should be as stated: a diagonal from `low` to 1, and percent on both axes."""
    axes.plot([low, 1.0], [low, 1.0], color=RULE, lw=1.5, label="exactly as stated")
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f}")
    axes.set_ylabel(inside)
    percent_axis(axes, stated)
    axes.grid(axis="y")


def plot_sizes(axes: Axes, curve: Sequence[Record], models: Sequence[str]) -> list[float]:
    """Mean errors of two models against the number of training trips; returns these numbers."""
    sizes = [float(row["n_trips"]) for row in curve]
    for name, marker in zip(models, "so", strict=True):
        means, style = [100.0 * float(row[name]) for row in curve], model_style(name)
        look: dict[str, Any] = {"color": style.colour, "ms": 6, "lw": 2, "ls": "-"}
        axes.plot(sizes, means, marker, label=style.label, gid=f"curve-{name}", **look)
    axes.set_xscale("log")
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.set(xlabel="training trips", ylabel="mean error [%]")
    axes.grid(axis="y")
    return sizes


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


def model_rows(axes: Axes, models: Sequence[str]) -> None:
    """One row per model, the first on top."""
    row_names(axes, [plain(model_style(m).label, 28) for m in models])
    axes.spines["left"].set_visible(False)


def annotate(
    axes: Axes,
    text: str,
    at: tuple[float, float],
    offset: tuple[float, float],
    *,
    size: float = 7.5,
    **align: Any,
) -> None:
    """A text at an offset [points] from a point; `ha` and `va` align it."""
    axes.annotate(text, at, offset, textcoords="offset points", fontsize=size, **align)


def cut_at(values: FloatArray) -> float:
    """Where an axis ends that shows all values, or all but those beyond `CUT`."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return min(1.08 * largest or 1.0, CUT)


def mark_beyond(axes: Axes, values: FloatArray, limit: float, y: float, colour: str) -> None:
    """A mark at the edge, with their number, for values that the axis does not reach."""
    beyond = int((values > limit).sum())
    if beyond:
        axes.plot(limit, y, marker=">", color=colour, ms=6, clip_on=False)
        annotate(axes, f"{beyond} beyond", (limit, y), (-7, 5), ha="right")


def thinned(frame: pd.DataFrame, most: int = 500) -> pd.DataFrame:
    """At most `most` rows evenly spread, the first and the last among them."""
    if len(frame) <= most:
        return frame
    return frame.iloc[np.unique(np.linspace(0, len(frame) - 1, most).round().astype(np.int64))]


MOST_POINTS: Final = 700
"""Points of one scatter; the extremes are always among them."""


def kept_points(values: FloatArray) -> IntArray:
    """Row numbers of at most `MOST_POINTS` values, evenly spread, with the ten lowest and highest."""
    n = len(values)
    even = np.linspace(0, n - 1, min(n, MOST_POINTS)).round().astype(np.int64)
    order = np.argsort(values, kind="stable")
    return np.unique(np.concatenate([even, order[:10], order[-10:]]))


def padded(values: FloatArray) -> tuple[float, float]:
    """Limits of an axis with a little room at both ends."""
    pad = 0.04 * float(np.ptp(values)) or 1.0
    return float(values.min()) - pad, float(values.max()) + pad


def few_ticks(axes: Axes) -> None:
    """Room for numbers of five digits side by side."""
    axes.xaxis.get_major_locator().set_params(nbins=4)  # type: ignore[call-arg]  # that of MaxNLocator, which it is
    axes.tick_params(labelsize=7.5)
