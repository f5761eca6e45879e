"""The documentation as a site: it builds without a warning, its links lead somewhere, and it asks no other host for anything."""

from __future__ import annotations

import http.server
import json
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote, urljoin, urlsplit

import pytest
from tests.support import ROOT
from tools.docs import gallery, render_pages, write_cli
from tools.docs.site import conf
from tools.docs.site.build import WORDS, with_words
from tools.quality.page import browsing, chromium

import tripwatt
from tripwatt.vehicles import vehicle_names

DOCS = ROOT / "docs"
RUNNABLE = sorted(
    page
    for page in [DOCS / "index.md", *(DOCS / "tutorials").glob("*.md"), *(DOCS / "howto").glob("*.md")]
    if ">>> " in page.read_text("utf-8")
)
ASSETS = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src", "object": "data"}
"""Element -> the attribute that makes a browser ask for a file."""


# ------------------------------------------------------------------------------------------------ pages that run


@pytest.mark.parametrize("page", RUNNABLE, ids=lambda page: page.stem)
def test_a_page_prints_what_it_shows(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if page.stem == "fleet":
        pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")
    monkeypatch.chdir(tmp_path)
    result = render_pages.render(page, tmp_path)
    assert result.failed == 0
    assert result.attempted == page.read_text("utf-8").count("\n>>> ")


def test_what_a_page_prints_can_be_written_into_it(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    before = "Text.\n\n```python\n>>> x = 2\n>>> x + 1\n{}\n>>> print('a\\n\\nb')\n{}\n```\n\nEnd.\n"
    page.write_text(before.format("7", "old"), "utf-8")
    assert render_pages.with_output(page, tmp_path) == before.format("3", "a\n<BLANKLINE>\nb")
    assert set(RUNNABLE) <= set(render_pages.pages())


def test_the_request_for_home_assistant_is_one_that_the_service_takes() -> None:
    pytest.importorskip("pydantic", reason="needs the extra tripwatt[service]")
    from tripwatt.server.http.schemas import ForecastRequest
    from tripwatt.server.http.settings import Limits

    text = (DOCS / "howto" / "home-assistant-evcc.md").read_text("utf-8")
    (payload,) = re.findall(r"payload: >-\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    body, replaced = re.subn(r"\{\{.*?\}\}", "0.5", payload)
    assert replaced == 2
    assert set(json.loads(body)) <= set(ForecastRequest.model_fields)
    request = ForecastRequest.model_validate_json(body, context=SimpleNamespace(limits=Limits()))
    assert (request.soc, request.ambient_temperature_degc, request.trip) == (0.5, 0.5, "commute")


# ------------------------------------------------------------------------------------------------ contents


def test_the_contents_are_the_links_of_the_sections() -> None:
    pytest.importorskip("sphinx", reason="needs the extra tripwatt[docs]")
    index = (
        "# A\n[no](zero.md)\n## Install\n[no](install.md)\n## Where to begin\n[no](one.md)\n## Reference\n- [b](b.md#part), [a](x/a.md) [no](gallery/b.md)\n- [b](b.md)\n"
        "[out](https://x.org/c.md)\n## Empty\ntext\n## More\n[b](b.md) [d](d.md)\n"
    )
    assert conf.contents(index).split("\n") == [
        *("", "```{toctree}", ":hidden:", ":titlesonly:", ":caption: Reference", "", "b", "x/a", "```"),
        *("", "```{toctree}", ":hidden:", ":titlesonly:", ":caption: More", "", "d", "```", ""),
    ]


# ------------------------------------------------------------------------------------------------ the site


class Found(HTMLParser):
    """Links, files that a browser asks for, and places to link to, of one page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.assets: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        held = {name: value or "" for name, value in attrs}
        self.places |= {held[name] for name in ("id", "name") if name in held}
        if tag == "a" and "href" in held:
            self.links.append(held["href"])
        if tag in ASSETS and ASSETS[tag] in held:
            self.assets.append(held[ASSETS[tag]])
        self.assets += [part.split()[0] for part in held.get("srcset", "").split(",") if part.strip()]


def dead_links(pages: dict[str, Found], files: set[str]) -> list[str]:
    """Links and assets inside of the site that lead nowhere, `page -> target`."""
    dead = []
    for page, found in pages.items():
        for target in [*found.links, *found.assets]:
            parts = urlsplit(urljoin(f"http://site/{page}", target))
            if parts.netloc != "site" or parts.scheme != "http":
                continue
            name, place = unquote(parts.path.lstrip("/")), unquote(parts.fragment)
            if name not in files or (place and name in pages and place not in pages[name].places):
                dead.append(f"{page} -> {target}")
    return dead


def foreign(page: str, found: Found) -> list[str]:
    """What a browser would ask another host for."""
    return [
        f"{page} -> {url}"
        for url in found.assets
        if urlsplit(url).scheme in ("http", "https") or url.startswith("//")
    ]


def test_dead_links_and_files_of_other_hosts_are_found() -> None:
    text = (
        '<a id="here"></a><a href="#here">x</a><a href="#lost">x</a><a href="b.html">x</a><a href="gone.html">x</a>'
        '<a href="https://example.org/x">x</a><img src="https://cdn.example.org/a.png"><script src="//x.org/a.js"></script>'
        '<link href="a.css"><a href="mailto:a@b">x</a>'
    )
    pages = {"a.html": Found(text), "b.html": Found("")}
    assert dead_links(pages, {"a.html", "b.html"}) == [
        "a.html -> #lost",
        "a.html -> gone.html",
        "a.html -> a.css",
    ]
    assert foreign("a.html", pages["a.html"]) == [
        "a.html -> https://cdn.example.org/a.png",
        "a.html -> //x.org/a.js",
    ]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built once for this module, in a process of its own: Sphinx changes signatures of the classes that it describes."""
    for name in ("sphinx", "myst_parser", "numpydoc", "furo"):
        pytest.importorskip(name, reason="needs the extra tripwatt[docs]")
    out = tmp_path_factory.mktemp("site") / "site"
    built = subprocess.run(
        [sys.executable, "-m", "tools.docs.site.build", str(out)],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert (built.returncode, built.stderr) == (0, "")
    return out


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[str, Found]:
    return {
        file.relative_to(site).as_posix(): Found(file.read_text("utf-8")) for file in site.rglob("*.html")
    }


def test_every_page_of_the_repository_is_in_the_site(site: Path, pages: dict[str, Found]) -> None:
    for page in DOCS.rglob("*.md"):
        assert page.relative_to(DOCS).with_suffix(".html").as_posix() in pages
    for name in ("contributing", "changes", "security", "notice", "licence"):
        assert f"project/{name}.html" in pages


def test_every_example_of_the_gallery_is_a_page_that_its_thumbnail_leads_to(pages: dict[str, Found]) -> None:
    first = pages["gallery/index.html"]
    for name in gallery.NAMES:
        assert f"{name}.html" in first.links
        assert f"../_images/{name}.png" in first.assets
        assert f"../_images/{name}.png" in pages[f"gallery/{name}.html"].assets


def test_the_pages_of_commands_and_cars_have_their_long_tables(pages: dict[str, Found], site: Path) -> None:
    named = dict(write_cli.commands(write_cli.typer.main.get_command(write_cli.app)))
    assert {name.replace(" ", "-") for name in named} <= pages["reference/cli.html"].places
    text = (site / "reference" / "library.html").read_text("utf-8")
    assert [name for name in vehicle_names() if f">{name}<" not in text] == []


def test_every_name_of_the_door_is_described(site: Path, pages: dict[str, Found]) -> None:
    text = (site / "api" / "tripwatt.html").read_text("utf-8")
    for name in set(tripwatt.__all__) - {"__version__"}:
        assert f"tripwatt.{name}" in pages["api/tripwatt.html"].places, name
        assert f'id="tripwatt.{name}"' in text
    assert "tripwatt_gamm.GAMM" in pages["api/tripwatt_gamm.html"].places
    assert "tripwatt.Forecast.interval" in pages["api/tripwatt.html"].places


def test_links_inside_of_the_site_lead_somewhere(site: Path, pages: dict[str, Found]) -> None:
    files = {file.relative_to(site).as_posix() for file in site.rglob("*") if file.is_file()}
    assert sum(len(found.links) for found in pages.values()) > 1000
    assert dead_links(pages, files) == []


def test_no_page_asks_another_host_for_a_file(site: Path, pages: dict[str, Found]) -> None:
    assert [url for page, found in pages.items() for url in foreign(page, found)] == []
    for sheet in site.rglob("*.css"):
        text = sheet.read_text("utf-8")
        assert not re.search(r"@import|url\(\s*['\"]?(https?:)?//", text), sheet.name


def test_options_keep_their_hyphens(site: Path) -> None:
    for page in ("reference/cli", "howto/proxy", "howto/page"):
        text = re.sub(r"<[^>]+>", "", (site / f"{page}.html").read_text("utf-8"))
        assert re.findall(r"[–—][a-z][\w-]*", text) == [], page
        assert " --" in text, page


def test_formulas_are_drawn_without_a_script(site: Path) -> None:
    text = (site / "explanation" / "gam.html").read_text("utf-8")
    assert text.count("<math") > 20
    assert "$" not in re.sub(r"<(pre|script|style)\b.*?</\1>", "", text, flags=re.DOTALL)


# ------------------------------------------------------------------------------------------------ a real browser


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Nothing."""


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/"
        server.shutdown()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if chromium() is None:
        pytest.skip("no chromium: install Debian's package of that name (as root, `make browser` does)")
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with browsing() as found:
        yield found


@pytest.fixture
def look(address: str, browser: Any) -> Iterator[Callable[..., Any]]:
    """Opens a page. At the end, the console is empty and all requests went to the site."""
    contexts, said, strangers = [], [], []

    def open_page(name: str, width: int, scheme: str) -> Any:
        context = browser.new_context(viewport={"width": width, "height": 844}, color_scheme=scheme)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: said.append(f"error: {error}"))
        page.on(
            "request", lambda r: strangers.append(r.url) if not r.url.startswith((address, "data:")) else None
        )
        page.goto(address + name)
        page.wait_for_load_state("networkidle")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert said == []
    assert strangers == []


def brightness(page: Any) -> float:
    """Of the page's background, 0 to 255."""
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    red, green, blue = (float(part) for part in re.findall(r"[\d.]+", colour)[:3])
    return (red + green + blue) / 3


@pytest.mark.parametrize("name", ["index.html", "api/tripwatt.html", "gallery/index.html"])
def test_a_page_fits_a_phone_and_follows_the_scheme_without_other_hosts(
    look: Callable[..., Any], name: str
) -> None:
    shown = {scheme: look(name, 390, scheme) for scheme in ("light", "dark")}
    for page in shown.values():
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.locator("h1").first.is_visible()
    assert brightness(shown["light"]) > 200
    assert brightness(shown["dark"]) < 60


def found_first(page: Any) -> str:
    """The page that the search puts first."""
    page.wait_for_function("document.querySelector('.search-summary')?.innerText.length > 0")
    href = page.locator("#search-results li a").first.get_attribute("href")
    return str(href).partition("#")[0]


def test_the_search_finds_a_page_and_shows_what_it_has(look: Callable[..., Any]) -> None:
    page = look("search.html?q=wallbox", 390, "dark")
    assert found_first(page) == "howto/charge-planning.html"
    page.wait_for_selector("#search-results li p.context")
    hrefs = page.locator("#search-results li a").evaluate_all(
        "links => links.map(a => a.getAttribute('href'))"
    )
    assert hrefs.count("howto/charge-planning.html") == 1
    assert "howto/charge-planning.html#index-0" not in hrefs
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_words_of_the_search_are_of_pages_and_each_once() -> None:
    for words in WORDS.values():
        assert words
        assert len(set(words)) == len(words)
        assert [w for w in words if w != w.lower() or "," in w] == []
    assert with_words("# A\n\nText.\n", ["one", "two words"]) == (
        "# A\n\n```{eval-rst}\n.. index::\n   ! one\n   ! two words\n\n```\n\nText.\n"
    )


SEARCHED = {
    "preheat": "howto/charge-planning.html",
    "winter": "explanation/questions.html",
    "roof box": "reference/vehicles.html",
    "how far": "howto/need.html",
    "faq": "explanation/questions.html",
}
"""What people type -> the page that they mean."""


def test_the_site_opens_and_searches_from_a_folder(site: Path, browser: Any) -> None:
    said: list[str] = []
    page = browser.new_context().new_page()
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto((site / "index.html").as_uri())
    page.locator("input[name=q]").first.fill("roof box")
    page.locator("input[name=q]").first.press("Enter")
    page.wait_for_url("**/search.html?q=roof+box*")
    assert found_first(page) == SEARCHED["roof box"]
    page.locator("#search-results li a").first.click()
    page.wait_for_url("**/reference/vehicles.html*")
    first = {}
    for words in SEARCHED:
        page.goto(f"{(site / 'search.html').as_uri()}?q={words}")
        first[words] = found_first(page)
    assert first == SEARCHED
    assert said == []
