"""The bundle in the package is built from the sources in web/ and refers to no other host."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest

import tripwatt.server.http
import tripwatt.study.report

WEB = Path(__file__).resolve().parents[3] / "web"
PAGE = Path(tripwatt.server.http.__file__).with_name("page")
REPORT = Path(tripwatt.study.report.__file__).with_name("templates")
SOURCES = (
    "build.mjs",
    "icon.svg",
    "index.html",
    "package-lock.json",
    "package.json",
    "report",
    "src",
    "tsconfig.json",
)
FIRST_VISIT_BYTES, FONT_BYTES = 340_000, 48_256
"""What a first visit in English loads, and the font of it, which the style sheet names."""

LARGEST_BYTES = 400_000
"""What a first visit loads, and the licences that it links to."""

LARGEST_MAP_BYTES = 1_800_000
"""The code of the map, which is loaded when a map is first shown."""

LARGEST_LANGUAGE_BYTES = {"de": 40_000, "messages-de": 90_000}
"""The texts of the page and the messages of the service in a language, which are loaded when it is chosen."""

LANGUAGE = re.compile(r"assets/((?:messages-)?de)-")

LATER = re.compile(r"assets/(own-cars-dialog|live-drive|dist)-")
"""The user's cars and the encoder of QR codes, which are loaded when they are first shown."""

MAP_CODE = re.compile(r"assets/(maplibre-gl|road-map|map-worker)-")


@pytest.fixture(scope="module")
def manifest() -> dict:
    return json.loads((PAGE / "manifest.json").read_text())


def test_built_from_the_sources_that_are_here(manifest: dict) -> None:
    files = [f for name in SOURCES for f in [WEB / name, *(WEB / name).rglob("*")] if f.is_file()]
    digest = hashlib.sha256()
    for name, file in sorted((file.relative_to(WEB).as_posix(), file) for file in files):
        content = file.read_bytes()
        digest.update(f"{name}\n{len(content)}\n".encode() + content)
    assert manifest["sources_sha256"] == digest.hexdigest(), "web/ has changed: run `make page`"


def test_files_are_those_that_were_built(manifest: dict) -> None:
    found = {file.relative_to(PAGE).as_posix(): file for file in PAGE.rglob("*") if file.is_file()}
    del found["manifest.json"]
    assert found.keys() == manifest["files"].keys()
    for name, file in found.items():
        assert manifest["files"][name]["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest(), name
    for name, digest in manifest["report"].items():
        assert digest == hashlib.sha256((REPORT / name).read_bytes()).hexdigest(), name
    of_map = {name: file.stat().st_size for name, file in found.items() if MAP_CODE.match(name)}
    assert len(of_map) == 3
    assert 500_000 < sum(of_map.values()) < LARGEST_MAP_BYTES
    of_language = {name: (file, part[1]) for name, file in found.items() if (part := LANGUAGE.match(name))}
    assert sorted(part for _, part in of_language.values()) == sorted(LARGEST_LANGUAGE_BYTES)
    for file, part in of_language.values():
        assert 0 < file.stat().st_size < LARGEST_LANGUAGE_BYTES[part]
    later = of_map.keys() | of_language.keys() | {name for name in found if LATER.match(name)}
    assert len(later) == 8
    assert sum(file.stat().st_size for name, file in found.items() if name not in later) < LARGEST_BYTES


def test_the_map_is_no_part_of_the_first_visit() -> None:
    index = (PAGE / "index.html").read_text()
    loaded = re.findall(r'(?:src|href)="(assets/[^"]+)"', index)
    assert not any(part.match(name) for part in (MAP_CODE, LANGUAGE, LATER) for name in loaded)
    (script,) = re.findall(r'<script[^>]* src="(assets/[^"]+)"', index)
    preloaded = re.findall(r'modulepreload" href="assets/([^"]+)"', index)
    parts = [(PAGE / name).read_text() for name in loaded if name.endswith(".js")]
    code = "".join(parts)
    assert (
        len(re.findall(r"import\(", code)) == 7
    )  # the two parts of the map, and of a language; own cars; a car on the road; the sections of a road
    assert "Sie kommen an" not in code
    imported = [name for part in parts for name in re.findall(r'from"\./([^"]+)"', part)]
    assert {*imported} == {*preloaded}, "no part waits for another one"
    assert (
        sum((PAGE / name).stat().st_size for name in {*loaded, "index.html"}) < FIRST_VISIT_BYTES - FONT_BYTES
    )
    assert (PAGE / script).stat().st_size > 0


def test_nothing_inline_and_no_other_host() -> None:
    index = (PAGE / "index.html").read_text()
    assert re.findall(r"<script(?![^>]*\bsrc=)", index) == []
    assert "<style" not in index
    assert re.findall(r"\s(?:style|on\w+)=", index) == []
    for file in [PAGE / "index.html", *PAGE.glob("assets/*.[cj]s*")]:
        hosts = set(re.findall(r"https?://([\w.-]+)", file.read_text()))
        named = {"www.w3.org", "HOST", "..."}  # names of XML and of what is to be filled in, not addresses
        if MAP_CODE.match(f"assets/{file.name}"):  # comments, and a link that is not shown
            named |= {"maplibre.org", "maplibre.invalid", "github.com", "wiki.openstreetmap.org"}
        assert hosts <= named, file.name
        assert "sourceMappingURL" not in file.read_text()


def test_everything_shipped_has_its_licence() -> None:
    shipped = json.loads((WEB / "package.json").read_text())["dependencies"]
    licences = (PAGE / "licences.txt").read_text() + (REPORT / "fleet.js").read_text()
    for name, version in shipped.items():
        assert f"{name} {version} (" in licences
