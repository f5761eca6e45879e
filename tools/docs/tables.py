"""A table of the report as Markdown, for the pages."""

from __future__ import annotations

from collections.abc import Sequence

from tripwatt.report.tables import Table


def markdown(table: Table) -> str:
    r"""A table as GitHub Markdown.

    Examples
    --------
    >>> print(markdown(Table("Caption", ("Model", "Error"), (("a|b", "1.0"),))))
    *Caption*
    <BLANKLINE>
    | Model | Error |
    |:--|--:|
    | a\|b | 1.0 |
    """

    def line(cells: Sequence[str]) -> str:
        return f"| {' | '.join(_markdown_text(cell) for cell in cells)} |"

    rule = "|".join(":--" if i in table.text_columns else "--:" for i in range(len(table.columns)))
    body = [
        line([f"**{cell}**" if i == 0 else cell for i, cell in enumerate(row)])
        if place in table.strong
        else line(row)
        for place, row in enumerate(table.rows)
    ]
    return "\n".join([f"*{_markdown_text(table.caption)}*", "", line(table.columns), f"|{rule}|", *body])


def _markdown_text(text: str) -> str:
    for char, safe in (("\\", "\\\\"), ("|", "\\|"), ("<", "&lt;"), (">", "&gt;"), ("\n", " ")):
        text = text.replace(char, safe)
    return text
