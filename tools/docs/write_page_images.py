"""Pictures of the page for the docs: `python -m tools.docs.write_page_images`. Needs chromium and the extra `dev`.

With the address of a running `tripwatt demo` as its argument it writes those of the map, of a car and of the road.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from tests.support.service_process import serving

from tools import DOCS
from tools.quality.page import MAP_SHOWN, SHOWN, browsing, choose_car, choose_place, context_of

IMAGES: Final = DOCS / "images"
SETTLE_MS: Final = 700
MOMENTS: Final = 40
HEIGHTS: Final = {"desktop": 1000, "phone": 1180}
WIDTHS: Final = {"desktop": 1360, "phone": 390}


def _check(page: Any, name: str) -> None:
    page.get_by_role("radio", name=name).check()


def _plan(page: Any) -> None:
    if not page.locator(".conditions").is_visible():
        page.locator(".chips").click()
    page.get_by_role("slider", name="Battery at departure", exact=True).fill("55")
    page.keyboard.press("Escape")


def _compare(page: Any) -> None:
    _check(page, "Compare")
    page.get_by_role("button", name="Cabin").click()


def _motorway(page: Any) -> None:
    _check(page, "Road sections")
    page.get_by_role("button", name="Try with an example").click()
    page.get_by_text("73 road sections").wait_for()
    _check(page, "Compare")
    page.get_by_role("button", name="Motorway speed").click()


def _drive(page: Any, share: float) -> None:
    _check(page, "Drive")
    car = page.get_by_role("slider", name="Position of the car")
    for k in range(1, int(MOMENTS * share) + 1):
        with page.expect_response(lambda answer: answer.url.endswith("/update")):
            car.fill(str(round(200 * k / MOMENTS)))


PICTURES: Final[dict[str, tuple[str, str, bool, Callable[[Any], None]]]] = {
    "page-plan-desktop-light": ("desktop", "light", False, _plan),
    "page-plan-desktop-dark": ("desktop", "dark", False, _plan),
    "page-compare-desktop-light": ("desktop", "light", True, _motorway),
    "page-drive-desktop-dark": ("desktop", "dark", True, lambda page: _drive(page, 0.6)),
    "page-plan-phone-light": ("phone", "light", False, _plan),
    "page-compare-phone-dark": ("phone", "dark", False, _compare),
    "page-drive-phone-dark": ("phone", "dark", False, lambda page: _drive(page, 1.0)),
}


def _journey(page: Any) -> None:
    """From one town to another, without the focus on a field."""
    page.wait_for_selector(MAP_SHOWN)
    change = page.locator(".trip .more")
    if change.is_visible():  # a phone has the form behind it
        change.click()
    for label, place in zip(("From", "To"), ("Falenlöv", "Marinsdorf"), strict=True):
        choose_place(page, label, place)
    page.get_by_role("button", name="Plan", exact=True).click()
    page.locator(".journey-answer:not(.old)").wait_for()
    page.get_by_role("slider", name="Position along the way").fill("110")
    page.wait_for_timeout(SETTLE_MS)


def _reach(page: Any) -> None:
    _journey(page)
    page.get_by_role("slider", name="Battery at departure", exact=True).fill("20")
    page.get_by_label("Show the area of reach from A").check()
    page.get_by_text("dashed: in 10 of 20 trips").wait_for()
    page.wait_for_timeout(3 * SETTLE_MS)


def _own_car(page: Any) -> None:
    choose_car(page, "no car of this name", "logs and diaries")
    page.locator("dialog.wide h3", has_text="Learned from").evaluate("e => e.scrollIntoView()")


def _on_road(page: Any) -> None:
    page.get_by_role("button", name="On the road").click()
    page.get_by_text("Left to drive").wait_for()


DEMO_PICTURES: Final[dict[str, tuple[str, str, bool, Callable[[Any], None]]]] = {
    "page-map-desktop-light": ("desktop", "light", False, _journey),
    "page-map-phone-dark": ("phone", "dark", False, _journey),
    "page-reach-desktop-dark": ("desktop", "dark", False, _reach),
    "page-car-desktop-light": ("desktop", "light", False, _own_car),
    "page-car-phone-dark": ("phone", "dark", False, _own_car),
    "page-road-phone-dark": ("phone", "dark", False, _on_road),
}
"""Of `tripwatt demo`."""


def write(url: str, pictures: dict[str, tuple[str, str, bool, Callable[[Any], None]]]) -> None:
    """Write pictures of the page of a running service."""
    with browsing() as browser:
        for name, (size, scheme, full_page, act) in pictures.items():
            page = context_of(browser, size, scheme).new_page()
            page.set_viewport_size({"width": WIDTHS[size], "height": HEIGHTS[size]})
            page.goto(url)
            page.wait_for_selector(f"{SHOWN}, {MAP_SHOWN}")
            act(page)
            page.wait_for_timeout(SETTLE_MS)
            page.evaluate("() => { document.activeElement.blur(); scrollTo(0, 0); }")
            page.wait_for_timeout(SETTLE_MS)
            page.screenshot(path=IMAGES / f"{name}.png", full_page=full_page)
            page.context.close()


def main() -> None:
    """Write the pictures of a service without anything, or those of the demo at an address."""
    if len(sys.argv) > 1:
        write(sys.argv[1], DEMO_PICTURES)
    else:
        with tempfile.TemporaryDirectory() as logs, serving(Path(logs)) as service:
            write(service.url, PICTURES)


if __name__ == "__main__":
    main()
