"""A panel of the report: a title, a sentence from the numbers, and a figure, tables, or the reason why there are none."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from tripwatt.report.style import style_context
from tripwatt.report.tables import Table
from tripwatt.report.view import View


@dataclass(frozen=True)
class Content:
    """What a panel shows of a run.

    Attributes
    ----------
    sentence : str
        What it shows, from the numbers; without a figure and tables, why there is nothing to show.
    figure : Figure or None
    tables : tuple of Table
    """

    sentence: str
    figure: Figure | None = None
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True)
class Panel:
    """One panel on the page.

    Attributes
    ----------
    key : str
        Anchor in the page and stem of the figure's files.
    title : str
    sentence : str
    figure : Figure or None
    tables : tuple of Table
    folded : bool
        Whether the tables start closed.
    wide : bool
        Whether it takes the full width of a desktop page; the others stand in two balanced columns.
    """

    key: str
    title: str
    sentence: str
    figure: Figure | None = None
    tables: tuple[Table, ...] = ()
    folded: bool = False
    wide: bool = False

    @property
    def shown(self) -> bool:
        """Whether it has a figure or a table; of another one the page has the sentence, in a list at its end."""
        return self.figure is not None or bool(self.tables)


@dataclass(frozen=True)
class Section:
    """Panels under one heading."""

    key: str
    title: str
    panels: tuple[Panel, ...]


@dataclass(frozen=True)
class PanelSpec:
    """A panel under the name by which a section of a protocol asks for it.

    Attributes
    ----------
    key, title : str
    content : callable
        Takes a `View`, gives a `Content`, or None where the panel is left out.
    draws : bool
        Whether it has a figure.
    folded, wide : bool
        As in `Panel`.
    errors : bool
        Whether it states errors, beside which the condition of the protocol is repeated.
    """

    key: str
    title: str
    content: Callable[[View], Content | None]
    draws: bool = False
    folded: bool = False
    wide: bool = False
    errors: bool = True

    def build(self, view: View) -> Panel | None:
        """The panel of a run, None where it is left out."""
        shown = self.content(view)
        if shown is None:
            return None
        sentence, given = shown.sentence, view.given
        if self.errors and given not in sentence and (shown.figure is not None or shown.tables):
            sentence = f"{sentence} {given[:1].upper()}{given[1:]}."
        return Panel(self.key, self.title, sentence, shown.figure, shown.tables, self.folded, self.wide)


def panel(key: str, title: str, **how: bool) -> Callable[[Callable[[View], Content | None]], PanelSpec]:
    """Make a function from a `View` to a `Content` a `PanelSpec`; the parameters are its attributes."""

    def specified(content: Callable[[View], Content | None]) -> PanelSpec:
        @functools.wraps(content)
        def drawn(view: View) -> Content | None:
            with style_context():
                return content(view)

        return PanelSpec(key, title, drawn, **how)

    return specified
