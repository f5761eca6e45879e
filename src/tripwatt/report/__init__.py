"""Figures, tables and the one-file report of an evaluation.

`write_report` writes them all; `render_table` is the same result in the terminal, `update_readme` in a README.
"""

from tripwatt.report.forecast import forecast_sentences
from tripwatt.report.html import render_report, write_report
from tripwatt.report.readme import update_readme
from tripwatt.report.tables import render_table

__all__ = ["forecast_sentences", "render_report", "render_table", "update_readme", "write_report"]
