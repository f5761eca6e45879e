"""Figures of an evaluation."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tripwatt.figures import axes_or_new, figure_of


def plot_errors(ape: pd.DataFrame, title: str, ax: Axes | None = None) -> Figure:
    """Draw a box plot of the trips' errors for each model.

    Parameters
    ----------
    ape : DataFrame, shape (trips, models)
        Absolute percentage errors as fractions.
    title : str
        Title of the chart.
    ax : Axes, optional
        Axes to draw on; a new figure by default.

    Returns
    -------
    Figure
        Boxes in order of the mean error (a diamond), the lowest at the top.

    Examples
    --------
    >>> axes = plot_errors(pd.DataFrame({"a": [0.3, 0.5], "b": [0.01, 0.1]}), "two trips").axes[0]
    >>> axes.get_xlabel(), [label.get_text() for label in axes.get_yticklabels()]
    ('absolute percentage error of each trip [%], mean: diamond', ['a', 'b'])
    """
    ax = axes_or_new(ax, 7.0, 1.2 + 0.4 * ape.shape[1])
    order = ape.mean().sort_values(ascending=False).index
    ax.boxplot(
        [ape[name].dropna().to_numpy() for name in order],
        orientation="horizontal",
        tick_labels=list(order),
        showmeans=True,
        widths=0.6,
        meanprops={"marker": "D", "markersize": 5, "markerfacecolor": "#c8553d", "markeredgecolor": "none"},
        medianprops={"color": "#0b5c8a"},
        flierprops={"marker": ".", "markeredgecolor": "#777777"},
    )
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(lambda value, _: f"{100.0 * value:g}")
    ax.set_xlabel("absolute percentage error of each trip [%], mean: diamond")
    ax.set_title(title)
    ax.grid(axis="x", alpha=0.3)
    return figure_of(ax)
