"""Generated parts of pages: what stands between ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->``."""

from __future__ import annotations

import re
from pathlib import Path

from tools import DOCS

MARK = re.compile(r"<!-- ([\w-]+):begin -->")


def _parted(text: str, name: str) -> tuple[str, str, str]:
    """What is before, in and after a part."""
    pieces = re.split(rf"<!-- {re.escape(name)}:(?:begin|end) -->", text)
    if len(pieces) != 3:
        raise ValueError(f"not one part {name}: {len(pieces) - 1} marks")
    before, inside, after = pieces
    return before, inside, after


def names(text: str) -> list[str]:
    """The parts of a page, in its order."""
    return MARK.findall(text)


def part(text: str, name: str) -> str:
    """A part of a page, without the blank lines around it. Raises ValueError where the page does not have it once."""
    return _parted(text, name)[1].strip()


def of_page(page: str, name: str) -> str:
    """A part of a page, which is named from the folder of the docs."""
    return part((DOCS / page).read_text("utf-8"), name)


def with_part(text: str, name: str, shown: str) -> str:
    """The page with another text in a part. Raises ValueError where the page does not have it once."""
    before, _, after = _parted(text, name)
    return f"{before}<!-- {name}:begin -->\n{shown.strip()}\n<!-- {name}:end -->{after}"


def renew(page: str | Path, name: str, shown: str) -> None:
    """Write a part of a page, which is named from the folder of the docs."""
    path = DOCS / page
    path.write_text(with_part(path.read_text("utf-8"), name, shown), "utf-8")


def without_parts(text: str) -> str:
    """A page without its generated parts."""
    return re.sub(r"<!-- ([\w-]+):begin -->.*?<!-- \1:end -->", "", text, flags=re.S)
