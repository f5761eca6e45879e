"""A panel of a report: a title, a caption, a figure and tables."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.figure import Figure

from tripwatt.study.report.tables import Table


@dataclass(frozen=True)
class Panel:
    """One panel on the page.

    Attributes
    ----------
    key : str
        Anchor in the page and stem of the figure's files.
    title : str
    caption : str
        Text below the title, also read by screen readers for the figure.
    figure : Figure or None
    tables : tuple of Table
    """

    key: str
    title: str
    caption: str = ""
    figure: Figure | None = None
    tables: tuple[Table, ...] = ()
