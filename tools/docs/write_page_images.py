"""Pictures of the page for the docs: `python -m tools.docs.write_page_images`. Needs chromium, Valhalla and the extra `dev`.

A picture has the digest of the sources of the page that it shows in docs/images/page.json; `make release` names those of an older page.
"""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from tests.support.router_server import valhalla_serving
from tests.support.service_process import serving

from tools import DOCS, ROOT
from tools.quality.page import MAP_SHOWN, SHOWN, browsing, choose_car, choose_place, context_of
from tools.release import PAGE
from tools.release import PICTURES as PICTURE_DIGESTS
from tripwatt.roads.maps.engine import valhalla_folder
from tripwatt.roads.maps.folder import open_map
from tripwatt.server.http.demo import depart, example_map, make_demo, send

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
    page.get_by_text("5 road sections").wait_for()
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
    page.get_by_label("Show how far you get from A").check()
    page.get_by_text("dashed line: in 50 of 100").wait_for()
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


@contextmanager
def demo() -> Iterator[str]:
    """The service of `tripwatt demo`, with its map on every Python for which Valhalla's programs are at hand; gives its address."""
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as logs:
        settings, token = make_demo(Path(folder))
        samples = depart(settings)
        with (
            valhalla_serving(open_map(example_map(Path(folder)))) as roads,
            serving(Path(logs), "--map", roads, "--cars", f"{settings.cars}") as service,
        ):
            threading.Thread(target=send, args=(samples, service.url, token), daemon=True).start()
            yield service.url


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
    drawn = dict.fromkeys(pictures, json.loads((ROOT / PAGE).read_text("utf-8"))["sources_sha256"])
    known = json.loads((ROOT / PICTURE_DIGESTS).read_text("utf-8"))
    (ROOT / PICTURE_DIGESTS).write_text(json.dumps(known | drawn, indent=1, sort_keys=True) + "\n", "utf-8")


def main() -> None:
    """Write the pictures of a service without anything, and those of the demo."""
    with tempfile.TemporaryDirectory() as logs, serving(Path(logs)) as service:
        write(service.url, PICTURES)
    if valhalla_folder() is None:
        print(f"no Valhalla: not drawn: {', '.join(DEMO_PICTURES)}")
        return
    with demo() as url:
        write(url, DEMO_PICTURES)


if __name__ == "__main__":
    main()
