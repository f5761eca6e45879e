"""The panels of an evaluation's report, with one module for each section."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels import (
    errors,
    gamm,
    paper_studies,
    results_table,
    uncertainty,
)
from tripwatt.study.report.style import style_context
from tripwatt.study.report.view import View

SECTIONS: Final[Mapping[str, Callable[[View], list[Panel]]]] = {
    "Result": results_table.panels,
    "Errors": errors.panels,
    "Uncertainty": uncertainty.panels,
    "Beside the paper": paper_studies.panels,
    "The GAMM": gamm.panels,
}
"""Heading of each section -> function that makes its panels; it returns none if the run has nothing to show."""


def build_sections(view: View) -> dict[str, list[Panel]]:
    """Return heading and panels of every section that has panels for the run."""
    with style_context():
        built = {title: panels(view) for title, panels in SECTIONS.items()}
    return {title: panels for title, panels in built.items() if panels}
