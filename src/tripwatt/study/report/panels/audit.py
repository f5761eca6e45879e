"""Findings of the audit."""

from __future__ import annotations

from tripwatt.study.report.panel import Panel
from tripwatt.study.report.tables import Column, Table, in_words, tabulated
from tripwatt.study.report.view import View, plain


def panels(view: View) -> list[Panel]:
    """Return the panel of the audit; none without findings."""
    table = audit_table(view)
    return [Panel("audit-findings", "Findings and consequences", tables=(table,))] if table.rows else []


def audit_table(view: View) -> Table:
    """Tabulate every finding of the audit and its consequence."""
    return tabulated(
        view.captioned("Findings of the audit"),
        view.results.get("audit") or (),
        Column("Trip", lambda f: plain(f["trip"])),
        Column("From [s]", "from_s", digits=1),
        Column("To [s]", "to_s", digits=1),
        in_words("What was found", lambda f: plain(f["what"], 400)),
        in_words("Consequence", lambda f: plain(f["consequence"], 200)),
    )
