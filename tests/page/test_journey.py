"""From A to B on the page, with the roads of a router on loopback."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from benchmarks.page import SHOWN, context_of
from tests.support.roads import osrm
from tests.support.router_server import answering, write_map
from tests.support.service_process import Service, serving


@pytest.fixture(scope="module")
def planner(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("planner")
    (folder / "logs").mkdir()
    with answering(osrm(annotated=True)) as router:
        named = f"{write_map(folder / 'map')}@osrm={router.url}"
        with serving(folder / "logs", "--workers", "1", "--map", named) as found:
            yield found


@pytest.fixture
def page(browser: Any, planner: Service) -> Iterator[Any]:
    context = context_of(browser, "desktop", "light", "en-IE")
    context.set_default_timeout(60_000)
    opened, said, strangers = context.new_page(), [], []
    opened.on("console", lambda message: said.append(message.text))
    opened.on("request", lambda r: None if r.url.startswith(planner.url) else strangers.append(r.url))
    opened.goto(planner.url)
    opened.wait_for_selector(SHOWN)
    yield opened
    context.close()
    assert (said, strangers) == ([], [])


def choose(page: Any, label: str, typed: str, name: str) -> None:
    """Type the start of a name and take the first suggestion with the keyboard."""
    page.get_by_label(label, exact=True).first.focus()
    page.keyboard.type(typed)
    page.get_by_role("option", name=name).first.wait_for()
    page.keyboard.press("Enter")


def test_from_a_to_b_by_keyboard_alone(page: Any, planner: Service) -> None:
    choose(page, "From", "west", "Westend")
    page.keyboard.press("Tab")
    page.keyboard.type("ost")
    page.get_by_role("option", name="Ostheim").first.wait_for()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    with page.expect_response(lambda r: r.url.endswith("/v1/plan")) as planned:
        page.keyboard.press("Enter")
    answer = planned.value.json()
    assert [stop["name"] for stop in answer["stops"]] == ["Westend", "Ostheim"]
    page.get_by_text("Westend – Ostheim").first.wait_for()
    page.get_by_role("img", name="Road Westend – Ostheim; north is up").wait_for()
    assert page.locator(".way").count() > 10
    assert page.get_by_text("© OpenStreetMap contributors, ODbL 1.0").count() == 2
    # what the driver sees is the answer of the service to the conditions of the page
    with page.expect_response(lambda r: r.url.endswith("/v1/plan")) as colder:
        slider = page.get_by_label("Outside", exact=True).first
        slider.focus()
        page.keyboard.press("PageDown")
    needed = colder.value.json()["soc_needed"]
    page.get_by_text("to arrive with the reserve in 19 of 20 trips").wait_for()
    assert 0.1 < needed < 1.0


def test_escape_closes_the_suggestions(page: Any) -> None:
    page.get_by_label("From", exact=True).first.focus()
    page.keyboard.type("west")
    page.locator("[role=option]").first.wait_for()
    page.keyboard.press("Escape")
    assert page.locator("[role=option]").count() == 0
    assert page.get_by_role("button", name="Plan", exact=True).is_disabled()


def test_axe_finds_nothing_serious_in_a_journey(page: Any) -> None:
    from axe_playwright_python.sync_playwright import Axe

    choose(page, "From", "west", "Westend")
    choose(page, "To", "ost", "Ostheim")
    page.get_by_role("button", name="Plan", exact=True).click()
    page.locator(".road-picture svg").wait_for()
    found = Axe().run(page).response["violations"]
    assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == []
    assert page.locator(".way.low, .way.usual, .way.high").count() == page.locator(".way").count()
