"""The panels of an evaluation's report, a module for each section."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from tripwatt.study.report.panel import Panel
from tripwatt.study.report.panels import (
    audit,
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
    "Audit of the trips": audit.panels,
}
"""Headings of the report, and what makes the panels below each; none where the run has nothing to show."""


def build_sections(view: View) -> dict[str, list[Panel]]:
    """Heading and panels of every section of which the run has something to show."""
    with style_context():
        built = {title: panels(view) for title, panels in SECTIONS.items()}
    return {title: panels for title, panels in built.items() if panels}
