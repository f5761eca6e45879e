"""Pictures of the page for the docs: `python docs/write_page_images.py`. Needs chromium and the extra `dev`.

With a map of Liechtenstein as its argument it writes those of the map: what `tripwatt serve --map` takes.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parent.parent
IMAGES: Final = ROOT / "docs" / "images"
sys.path.insert(0, str(ROOT))

from benchmarks.page import MAP_SHOWN, SHOWN, browsing, choose_place, context_of  # noqa: E402
from tests.support.service_process import serving  # noqa: E402

SETTLE_MS: Final = 700
MOMENTS: Final = 40
HEIGHTS: Final = {"desktop": 1000, "phone": 1180}
WIDTHS: Final = {"desktop": 1360, "phone": 390}


def _check(page: Any, name: str) -> None:
    page.get_by_role("radio", name=name).check()


def _plan(page: Any) -> None:
    page.get_by_role("slider", name="Battery at departure", exact=True).fill("55")


def _compare(page: Any) -> None:
    _check(page, "Compare")
    page.get_by_role("button", name="Cabin").click()


def _motorway(page: Any) -> None:
    _check(page, "Links")
    page.get_by_role("button", name="Try with an example").click()
    page.get_by_text("73 links").wait_for()
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
    """From Vaduz to Ruggell, without the focus on a field."""
    page.wait_for_selector(MAP_SHOWN)
    choose_place(page, "From", "Vaduz")
    choose_place(page, "To", "Ruggell")
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


MAP_PICTURES: Final[dict[str, tuple[str, str, bool, Callable[[Any], None]]]] = {
    "page-map-desktop-light": ("desktop", "light", False, _journey),
    "page-map-phone-dark": ("phone", "dark", False, _journey),
    "page-reach-desktop-dark": ("desktop", "dark", False, _reach),
}
"""Need a map of Liechtenstein, as the first argument: what `tripwatt serve --map` takes."""


def write(pictures: dict[str, tuple[str, str, bool, Callable[[Any], None]]], *options: str) -> None:
    """Write pictures of a service with options."""
    shown = MAP_SHOWN if options else SHOWN
    with (
        tempfile.TemporaryDirectory() as logs,
        serving(Path(logs), *options) as service,
        browsing() as browser,
    ):
        for name, (size, scheme, whole, act) in pictures.items():
            page = context_of(browser, size, scheme).new_page()
            page.set_viewport_size({"width": WIDTHS[size], "height": HEIGHTS[size]})
            page.goto(service.url)
            page.wait_for_selector(shown)
            act(page)
            page.wait_for_timeout(SETTLE_MS)
            page.evaluate("() => { document.activeElement.blur(); scrollTo(0, 0); }")
            page.wait_for_timeout(SETTLE_MS)
            page.screenshot(path=IMAGES / f"{name}.png", full_page=whole)
            page.context.close()


def main() -> None:
    """Write all pictures; those of the map alone where one is given."""
    if len(sys.argv) > 1:
        write(MAP_PICTURES, "--map", sys.argv[1])
    else:
        write(PICTURES)


if __name__ == "__main__":
    main()
