"""The page stands alone, is well formed, holds everything, and says what it lacks."""

import base64
import functools
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from tripwatt.study.report import render_report, write_report
from tripwatt.study.report.model_styles import model_style, model_styles

MakeRun = Callable[..., SimpleNamespace]
STYLES = model_styles()
MODELS = [name for name in STYLES if not name.startswith(("hybrid", "power-", "physics-identified"))]
FIGURE_KEYS = (
    "error-distribution",
    "error-boxes",
    "benchmark-boxes",
    "gamm-diagnosis",
    "gamm-smooths",
    "gamm-surface",
    "gamm-random",
)
"""Figures of a run that has everything but the studies beside the paper."""
VOID = {"meta", "link", "br", "hr", "img", "input", "col", "source", "wbr"}
HOSTILE = [
    '<script>alert("x")</script>',
    'a&b\'s "trip"',
    "$\\frac{1}{0}$ _^",
    "tab\tand\x00null",
    "旅行🚗" * 30,
    "%s {0} {{x}}",
]


class Page(HTMLParser):
    """Balanced tags, all attributes, and the text outside of style."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == [], f"not closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text.append(data)

    def words(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.text))


@pytest.fixture(scope="module")
def html(run: SimpleNamespace) -> str:
    with not_laid_out():
        return render_report(run)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are laid out but not drawn: for tests of words."""
    monkeypatch.setattr("tripwatt.study.report.html.svg_text", lambda figure: "<svg></svg>")


@contextmanager
def not_laid_out() -> Iterator[None]:
    """Figures are drawn where matplotlib puts them first: for tests of what a figure holds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda self, figure: None)
        patch.setattr("tripwatt.study.report.html.PNG_DPI", 40)
        yield


def drawn(html: str) -> list[str]:
    """The figures of a page, as SVG."""
    return [
        base64.b64decode(code).decode()
        for code in re.findall(r'src="data:image/svg\+xml;base64,([^"]*)"', html)
    ]


FEW = ("linear6", "physics-paper", "physics", "gamm", "boosting", "boosting-only")
"""The models of a run that has every figure and little to draw."""


@pytest.fixture(scope="module")
def small(made_up: MakeRun) -> Callable[..., SimpleNamespace]:
    """Makes a run of three trips and few models."""
    return functools.partial(made_up, "tum", trips=["a", "b", "c"], models=FEW)


def synthetic_run(made_up: MakeRun) -> SimpleNamespace:
    return made_up("synthetic", trips=["s1", "s2", "s3", "s4"], models=FEW)


@pytest.fixture(scope="module")
def written(made_up: MakeRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of synthetic trips as files."""
    out = tmp_path_factory.mktemp("written")
    with not_laid_out():
        write_report(synthetic_run(made_up), out)
    return out


@pytest.fixture(scope="module")
def synthetic_html(written: Path) -> str:
    return (written / "report.html").read_text(encoding="utf-8")


def test_page_is_well_formed_and_every_id_is_its_own(html: str) -> None:
    ids = [a["id"] for _, a in Page(html).tags if "id" in a]
    assert len(ids) == len(set(ids))


def test_no_panel_is_empty(html: str) -> None:
    panels = re.findall(r"<article.*?</article>", html, re.DOTALL)
    assert len(panels) > 8
    assert all("<figure>" in panel or "<table>" in panel for panel in panels)
    assert "<h2>Beside the paper</h2>" not in html  # the run has no studies
    assert "<h2>Uncertainty</h2>" not in html  # nor a forecast


def test_page_reaches_for_no_other_file_or_host(html: str) -> None:
    page = Page(html)
    for tag, attributes in page.tags:
        assert tag not in {"script", "iframe", "link", "object", "embed", "base"}
        for name, value in attributes.items():
            assert not name.startswith("on")
            if name in {"src", "href", "xlink:href", "action", "poster", "srcset"}:
                assert (value or "").startswith("data:image/svg+xml;base64,")
    assert not re.search(r"url\((?!#)|@import", html)


def test_page_is_for_phone_print_dark_and_for_those_who_listen(html: str) -> None:
    page = Page(html)
    assert "width=device-width" in html
    assert "prefers-color-scheme: dark" in html
    assert "@media print" in html
    pictures = [a for tag, a in page.tags if tag == "img"]
    assert len(pictures) == len(FIGURE_KEYS)
    assert all(len(a.get("alt") or "") > 40 for a in pictures)
    tables = html.split("<table")[1:]
    assert tables
    assert all("<caption>" in t and 'scope="col"' in t and 'scope="row"' in t for t in tables)


def test_page_holds_every_model_and_every_mean_error(run: SimpleNamespace, html: str) -> None:
    words = Page(html).words()
    for model in MODELS:
        assert model_style(model).label in words
        for evaluation in run.results["evaluations"]:
            assert f"{100 * evaluation['models'][model]['mape']:.1f}" in words
    assert run.results["citation"] in words
    assert run.results["notes"][0] in words


def test_paper_stands_beside_its_own_trips_alone(html: str, synthetic_html: str) -> None:
    words = Page(html).words()
    assert "arXiv:2405.10984, Table 3" in words
    assert " 37.9 " in words
    assert "arXiv" not in Page(synthetic_html).words()


def test_synthetic_trips_are_called_so_in_every_table_and_figure(html: str, synthetic_html: str) -> None:
    captions = re.findall(r"<caption>(.*?)</caption>", synthetic_html)
    assert captions
    assert all("synthetic" in c for c in captions if c != "The models")
    pictures = drawn(synthetic_html)
    assert len(pictures) == len(FIGURE_KEYS)
    assert all("Synthetic trips, not measured ones" in picture for picture in pictures)
    assert "<strong>Synthetic trips.</strong>" in synthetic_html
    assert "ynthetic" not in html


def test_hostile_names_are_text_and_nothing_else(made_up: MakeRun) -> None:
    hostile = made_up("tum", trips=HOSTILE, models=FEW)
    hostile.folds["model"] = hostile.folds["model"].replace({"linear6": HOSTILE[2]})
    hostile.results["notes"] = ["<img src=x onerror=alert(1)>"]
    with not_laid_out():
        html = render_report(hostile)
    page = Page(html)
    assert "script" not in [tag for tag, _ in page.tags]
    assert [a["src"] for tag, a in page.tags if tag == "img"] == re.findall(r'src="(data:[^"]*)"', html)
    assert "<img src=x onerror=alert(1)>" in page.words()
    assert "\x00" not in html
    pictures = drawn(html)
    assert any("$\\frac{1}{0}$ _^" in picture for picture in pictures)  # not typeset as mathematics
    for picture in pictures:
        ElementTree.fromstring(picture)


def test_files_beside_the_page(written: Path) -> None:
    names = {p.name for p in (written / "figures").iterdir()}
    assert names == {f"{key}.{suffix}" for key in FIGURE_KEYS for suffix in ("png", "svg")}
    for path in (written / "figures").glob("*.svg"):
        assert ElementTree.parse(path).getroot().tag.endswith("svg")
    assert all(p.read_bytes()[:4] == b"\x89PNG" for p in (written / "figures").glob("*.png"))
    assert (written / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert not list(written.rglob("*.partial"))


def test_same_run_same_bytes(made_up: MakeRun, synthetic_html: str) -> None:
    with not_laid_out():
        assert render_report(synthetic_run(made_up)) == synthetic_html


@pytest.mark.usefixtures("undrawn")
def test_what_a_run_lacks_is_left_out(small: MakeRun) -> None:
    whole = small()
    lacking = SimpleNamespace(**{**vars(whole), "gamm": None})
    html = render_report(lacking)
    assert "<h2>The GAMM</h2>" not in html
    assert "panel-error-boxes" in html


def test_colours_differ() -> None:
    colours = [style.colour for style in STYLES.values()]
    assert len(set(colours)) == len(colours)
