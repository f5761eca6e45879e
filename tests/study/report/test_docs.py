"""The pages for people: every canonical name is explained, every link leads somewhere, no figure is typed."""

import dataclasses
import re
from pathlib import Path

import pytest
from tools.docs.results_pages import PAGE, markers

from tripwatt.physics.simulate import Simulation
from tripwatt.trips import COLUMNS, Context

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + sorted(
    DOCS.rglob("*.md")
)


def test_nomenclature_gives_unit_and_meaning_of_every_canonical_column() -> None:
    lines = (DOCS / "reference" / "nomenclature.md").read_text(encoding="utf-8").splitlines()
    for name, column in COLUMNS.items():
        assert f"| `{name}` | {column.unit} | {column.meaning} |" in lines


@pytest.mark.parametrize("holder", [Simulation, Context])
def test_nomenclature_names_every_field(holder: type) -> None:
    named = set(re.findall(r"`(\w+)`", (DOCS / "reference" / "nomenclature.md").read_text(encoding="utf-8")))
    assert {f.name for f in dataclasses.fields(holder)} - {"flags"} <= named


def test_links_of_all_pages_lead_somewhere() -> None:
    links = [(page, link) for page in PAGES for link in re.findall(r"\]\(([^)#]+)", page.read_text("utf-8"))]
    inside = [(page, link) for page, link in links if "://" not in link]
    assert [(page.name, link) for page, link in inside if not (page.parent / link).resolve().is_file()] == []


def test_the_indices_list_every_page() -> None:
    listed = {DOCS / "index.md"}
    for index in (DOCS / "index.md", DOCS / "decisions" / "index.md"):
        links = re.findall(r"\]\(([^)#]+\.md)", index.read_text(encoding="utf-8"))
        listed |= {(index.parent / link).resolve() for link in links}
    assert set(DOCS.rglob("*.md")) - listed == set()


README_PLACES = tuple(map(markers, ("line", "example")))
PAGE_PLACES = tuple(map(markers, (*PAGE, "before")))


@pytest.mark.parametrize(
    ("page", "places"),
    [(ROOT / "README.md", README_PLACES), (DOCS / "explanation" / "results.md", PAGE_PLACES)],
)
def test_a_page_has_one_place_for_each_result_and_no_typed_percentage_elsewhere(
    page: Path, places: tuple[tuple[str, str], ...]
) -> None:
    outside = page.read_text(encoding="utf-8")
    for begin, end in places:
        assert (outside.count(begin), outside.count(end)) == (1, 1)
        outside = outside.partition(begin)[0] + outside.partition(end)[2]
    outside = re.sub(
        r"^```.*?^```$", "", outside, flags=re.M | re.S
    )  # what code prints has a test of its own
    assert not re.search(r"\d\s?%", outside)
    assert "make r" in page.read_text(encoding="utf-8")
