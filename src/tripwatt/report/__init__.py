"""Figures, tables and the one-file report of an evaluation.

`write_report` writes them all; `render_table` is its short table in the terminal, `update_readme` that of a README,
`update_results_page` the wide tables of a page, `update_coverage` what the intervals held, `update_paper_page` the page on the paper.
"""

from tripwatt.report.html import render_report, write_report
from tripwatt.report.readme import (
    update_coverage,
    update_paper_page,
    update_readme,
    update_results_page,
)
from tripwatt.report.short_table import render_table

__all__ = [
    "render_report",
    "render_table",
    "update_coverage",
    "update_paper_page",
    "update_readme",
    "update_results_page",
    "write_report",
]
