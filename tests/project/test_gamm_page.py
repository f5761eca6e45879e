"""The worked example of the page runs, prints what the page shows and draws what the page includes."""

import re

from tools import DOCS
from tools.docs.render_pages import render


def test_the_page_prints_what_it_shows(tmp_path):
    page = DOCS / "explanation" / "gam.md"
    result = render(page, tmp_path)
    assert result.failed == 0
    assert result.attempted > 15
    shown = set(re.findall(r"\(\.\./images/([\w-]+\.png)\)", page.read_text(encoding="utf-8")))
    assert shown == {path.name for path in tmp_path.iterdir()}
    assert all((DOCS / "images" / name).is_file() for name in shown)


def test_a_changed_number_or_word_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        ">>> print('rmse 1.08')\nrmse 1.20\n>>> print('rmse 1.08')\nbias 1.08\n>>> print('rmse 1.08')\nrmse 1.081\n"
    )
    assert render(page, tmp_path).failed == 2
