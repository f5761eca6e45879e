"""Lines that install: from a clone, or from an index once the package is on one. One switch sets all.

``python -m tools.docs.install_lines --index`` (or ``--clone``) sets `tripwatt.errors.ON_AN_INDEX` and rewrites the pages; without a word it
rewrites them as the switch stands.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Final

from typer import Option

from tools import DOCS, ROOT
from tools.command import run
from tripwatt import errors

PAGES: Final = (ROOT / "README.md", ROOT / "gamm" / "README.md", *sorted(DOCS.rglob("*.md")))
SWITCH: Final = Path("src/tripwatt/errors.py")

SENTENCES: Final = (
    (
        "## Install from a clone\n\nYou need `make` and Python 3.11 or newer; a map needs 3.12.\n",
        "## Install\n\n`pip install tripwatt`, with Python 3.11 or newer; a map needs 3.12. In a clone, with `make`:\n",
    ),
    ("(`pip install -e .` in a clone)", "(`pip install tripwatt`)"),
    (
        "In a clone of tripwatt:\n\n```\npip install -e 'gamm[figures]'\n",
        "```\npip install 'tripwatt-gamm[figures]'\n",
    ),
)
"""Sentences about a clone, and those about an index in their place."""

CLONE: Final = r"pip install (?:-e gamm )?-e '\.\[([a-z,]+)\]'"
INDEX: Final = r"pip install 'tripwatt\[([a-z,]+)\]'"


def in_form(text: str, *, on_index: bool) -> str:
    """A page with its lines that install the package: from an index, or from a clone.

    Examples
    --------
    >>> in_form("`pip install -e '.[fleet]'`", on_index=True)
    "`pip install 'tripwatt[fleet]'`"
    >>> in_form("`pip install 'tripwatt[fleet,gamm]'`", on_index=False)
    "`pip install -e gamm -e '.[fleet,gamm]'`"
    """
    for clone, index in SENTENCES:
        text = text.replace(clone, index) if on_index else text.replace(index, clone)
    if on_index:
        text = text.replace("`pip install -e .`", "`pip install tripwatt`")
        return re.sub(CLONE, r"pip install 'tripwatt[\1]'", text)
    text = text.replace("`pip install tripwatt`", "`pip install -e .`")
    return re.sub(INDEX, lambda line: errors.clone_line(line[1].split(",")), text)


def main(
    index: Annotated[bool | None, Option("--index/--clone", help="Where it is installed from.")] = None,
) -> None:
    """Set the switch, and rewrite the lines that install."""
    on_index = errors.ON_AN_INDEX if index is None else index
    switch = ROOT / SWITCH
    text = switch.read_text("utf-8")
    switch.write_text(re.sub(r"(?<=ON_AN_INDEX: Final = )\w+", f"{on_index}", text), "utf-8")
    for page in PAGES:
        page.write_text(in_form(page.read_text("utf-8"), on_index=on_index), "utf-8")


if __name__ == "__main__":
    run(main)
