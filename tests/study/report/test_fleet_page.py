"""The report of a fleet in a browser: its tables sort and filter from one file, and nothing else is loaded."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tests.fleet.rows import year_of_rows
from tools.quality.page import browsing, chromium, context_of

from tripwatt.fleet.changes import changes
from tripwatt.fleet.features import START
from tripwatt.fleet.statistics import TripRows
from tripwatt.hybrid.groups import fit_scales, group_posterior
from tripwatt.study.report.fleets import ManagerReport
from tripwatt.study.report.totals import ReportSettings, drivers_by_name, totals

LARGEST_BYTES, LONGEST_S = 3_000_000, 2.0
CELLS = "rows => rows.map(row => row.cells[{}].textContent)"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of 200 vehicles, one of which has the road load of a roof box from July on."""
    rows: TripRows = year_of_rows(61, vehicles=200, trips=60, changes=[(7, "road load", 180, 0.15)])
    posterior = group_posterior(rows.sums, fit_scales(rows.sums, START))
    found = changes(rows)
    groups = {f"v{k:02d}": ("north", "<b>south")[k % 2] for k in range(200)}
    asked = ReportSettings(groups=groups)
    made = ManagerReport(
        0.95, found, **totals(posterior, rows, asked), drivers=drivers_by_name(posterior, rows)
    )
    written = tmp_path_factory.mktemp("report") / "report.html"
    written.write_text(made.page(), "utf-8")
    return written


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if chromium() is None:
        pytest.skip("no chromium: install Debian's package of that name (as root, `make browser` does)")
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with browsing() as found:
        yield found


@pytest.mark.parametrize("size", ["desktop", "phone"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_report_opens_and_sorts_and_filters(browser: Any, file: Path, size: str, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed").Axe()
    assert file.stat().st_size < LARGEST_BYTES
    context = context_of(browser, size, scheme)
    page = context.new_page()
    faults: list[str] = []
    page.on("console", lambda message: faults.append(message.text))
    page.on("pageerror", lambda error: faults.append(f"{error}"))
    began = time.perf_counter()
    page.goto(file.as_uri())
    page.wait_for_selector("#charts canvas")
    assert time.perf_counter() - began < LONGEST_S
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.locator("#charts canvas").count() == 2
    assert axe.run(page).response["violations"] == []

    table = page.locator("#panel-vehicles")
    rows = table.locator("tbody tr")
    assert rows.count() == 15
    head = table.locator("thead th", has_text="distance")
    for order in ("ascending", "descending"):
        head.get_by_role("button").press("Enter")
        table.locator(f"thead th[aria-sort={order}]", has_text="distance").wait_for()
        km = [float(text.replace(",", "")) for text in rows.evaluate_all(CELLS.format(9))]
        assert km == sorted(km, reverse=order == "descending"), order
    table.get_by_label("Search").fill("v07")
    assert rows.evaluate_all(CELLS.format(0)) == ["v07"]
    table.get_by_label("Search").fill("")
    table.get_by_label("group", exact=True).select_option("<b>south")
    assert set(rows.evaluate_all(CELLS.format(17))) == {"<b>south"}
    # drivers are not ranked
    if page.locator("#panel-drivers").count():
        assert page.locator("#panel-drivers [aria-sort], #panel-drivers .dt-orderable-asc").count() == 0
    assert faults == []
    context.close()
