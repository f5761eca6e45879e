"""Every panel of the reports, one module each or for a group of them: sentence, figure and table together.

A protocol of `tripwatt.evaluation` names the panels of its sections; `PANELS` has them by these names.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from tripwatt.evaluation import EvaluationProtocol
from tripwatt.report.panel import Panel, PanelSpec, Section
from tripwatt.report.view import View

PANELS: Final[Mapping[str, PanelSpec]] = {
    spec.key: spec
    for module in pkgutil.iter_modules(__path__, f"{__name__}.")
    for spec in vars(importlib.import_module(module.name)).values()
    if isinstance(spec, PanelSpec)
}
"""Panels of every module of this folder, by name."""


def figure_keys(protocol: EvaluationProtocol | None = None) -> tuple[str, ...]:
    """Stems of the files in `figures/`: those of a protocol's report, or of every report."""
    names = PANELS if protocol is None else [name for s in protocol.sections for name in s.panels]
    return tuple(name for name in names if PANELS[name].draws)


def build_sections(view: View) -> list[Section]:
    """Every section of the report of a run; a panel without data stands last and gives the reason."""
    sections = []
    for section in view.protocol.sections:
        built = [p for name in section.panels if (p := PANELS[name].build(view)) is not None]
        empty = (panel for panel in built if not panel.shown)
        sections.append(
            Section(section.key, section.title, (*filled_rows([p for p in built if p.shown]), *empty))
        )
    return sections


def filled_rows(panels: Sequence[Panel]) -> tuple[Panel, ...]:
    """The panels, with one that would stand alone beside an empty half of the page made wide.

    Examples
    --------
    >>> [p.wide for p in filled_rows([Panel("a", "", "", wide=True), Panel("b", "", "")])]
    [True, True]
    >>> [p.wide for p in filled_rows([Panel("a", "", ""), Panel("b", "", "")])]
    [False, False]
    """
    laid_out: list[Panel] = []
    for wide, run in itertools.groupby(panels, key=lambda panel: panel.wide):
        together = list(run)
        alone = len(together) == 1 and not wide
        laid_out += [replace(panel, wide=True) for panel in together] if alone else together
    return tuple(laid_out)
