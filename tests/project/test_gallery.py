"""The gallery: every script draws a figure with labelled axes, without a warning, and the pages are those of the scripts."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator

import pytest
from matplotlib.figure import Figure
from PIL import Image
from tools.docs import gallery

MAX_BYTES = 1_000_000
NUMBER = re.compile(r"[−+-]?[\d.]+(e[+-]?\d+)?|\$.*\$")
"""Of a tick; powers of ten are formulas."""
OF_OTHERS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning)


def without_unit(figure: Figure) -> Iterator[str]:
    """Axes that show numbers and no unit in brackets; names as ticks need none."""
    figure.draw_without_rendering()
    for k, axes in enumerate(figure.axes):
        for axis in (axes.xaxis, axes.yaxis):
            shown = [tick.get_text() for tick in axis.get_ticklabels() if tick.get_visible()]
            if any(map(NUMBER.fullmatch, shown)) and not re.search(r"\[.+\]", axis.get_label_text()):
                yield f"{axis.axis_name} of {k}: {axis.get_label_text()!r}"


@pytest.mark.parametrize("name", gallery.NAMES)
def test_an_example_draws_its_figure(name: str) -> None:
    if name == "fleet_posterior":
        pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        figure = gallery.drawn(name)
        assert list(without_unit(figure)) == []
    said = [w for w in caught if f"{name}.py" in w.filename or not issubclass(w.category, OF_OTHERS)]
    assert [f"{w.filename}: {w.message}" for w in said] == []
    assert all(axes.has_data() for axes in figure.axes)
    width, height = (round(gallery.DPI * inches) for inches in figure.get_size_inches())
    with Image.open(gallery.IMAGES / f"{name}.png") as picture:
        assert picture.size == (width, height)


def test_an_axis_without_a_unit_is_found() -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2, sharey=True)
    left.plot([0.0, 1.0], [0.0, 1.0])
    left.set(xlabel="time", ylabel="power [kW]")
    right.bar(["a 1", "b 2"], [1.0, 2.0])
    assert list(without_unit(figure)) == ["x of 0: 'time'"]


def test_every_script_is_in_one_section_and_has_title_text_and_code() -> None:
    assert sorted(gallery.NAMES) == sorted(script.stem for script in gallery.FOLDER.glob("*.py"))
    titles = {gallery.example(name).title for name in gallery.NAMES}
    assert len(titles) == len(gallery.NAMES) == 12
    for name in gallery.NAMES:
        _, text, code = gallery.example(name)
        assert len(text) > 200
        assert code.startswith("import ") or code.startswith("from ")


def test_the_first_page_is_that_of_the_scripts() -> None:
    assert gallery.PAGE.read_text("utf-8") == gallery.first_page()


def test_the_pictures_are_small() -> None:
    files = sorted(gallery.IMAGES.iterdir())
    assert [file.stem for file in files] == sorted(gallery.NAMES)
    assert sum(file.stat().st_size for file in files) < MAX_BYTES
