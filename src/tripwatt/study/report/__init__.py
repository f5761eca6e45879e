"""Figures, tables and the one-file report of an evaluation.

`write_report` writes them all; `render_table` is its short table in the terminal.
"""

from tripwatt.study.report.html import render_report, write_report
from tripwatt.study.report.short_table import render_table

__all__ = ["render_report", "render_table", "write_report"]
