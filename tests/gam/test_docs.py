"""The worked example of the page runs, prints what the page shows and draws what the page includes."""

import importlib.util
import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def renderer():
    spec = importlib.util.spec_from_file_location("render_pages", DOCS / "render_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_prints_what_it_shows(tmp_path):
    page = DOCS / "gam.md"
    result = renderer().render(page, tmp_path)
    assert result.failed == 0
    assert result.attempted > 15
    shown = set(re.findall(r"\(images/([\w-]+\.png)\)", page.read_text(encoding="utf-8")))
    assert shown == {path.name for path in tmp_path.iterdir()}
    assert all((DOCS / "images" / name).is_file() for name in shown)


def test_a_changed_number_or_word_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        ">>> print('rmse 1.08')\nrmse 1.20\n>>> print('rmse 1.08')\nbias 1.08\n>>> print('rmse 1.08')\nrmse 1.081\n"
    )
    assert renderer().render(page, tmp_path).failed == 2
