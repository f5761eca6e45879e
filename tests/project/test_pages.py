"""Generated parts of pages: read, replaced, left out."""

from pathlib import Path

import pytest
from tools.docs import pages

PAGE = "before\n<!-- one:begin -->\n\nold\n\n<!-- one:end -->\nbetween <!-- fig: a | % -->1<!-- /fig -->\n<!-- two-b:begin -->2<!-- two-b:end -->\n"


def test_a_part_is_read_and_replaced(tmp_path: Path) -> None:
    assert pages.names(PAGE) == ["one", "two-b"]
    assert (pages.part(PAGE, "one"), pages.part(PAGE, "two-b")) == ("old", "2")
    page = tmp_path / "page.md"
    page.write_text(PAGE, "utf-8")
    pages.renew(page, "one", "\nnew\\1\n")
    assert page.read_text("utf-8") == PAGE.replace("\n\nold\n\n", "\nnew\\1\n")
    assert pages.without_parts(PAGE) == "before\n\nbetween <!-- fig: a | % -->1<!-- /fig -->\n\n"


@pytest.mark.parametrize("page", ["", PAGE + PAGE, PAGE.replace("one:end", "gone")])
def test_a_part_that_is_not_there_once_is_a_fault(page: str) -> None:
    with pytest.raises(ValueError, match="not one part one"):
        pages.with_part(page, "one", "new")
