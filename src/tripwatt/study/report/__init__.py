"""Figures, tables and the one-file report of an evaluation.

`write_report` writes all of them; the terminal shows the `short_table` of a `View`.
"""

from tripwatt.study.report.html import render_report, write_report
from tripwatt.study.report.shortlist import short_table
from tripwatt.study.report.view import View

__all__ = ["View", "render_report", "short_table", "write_report"]
