"""Pictures of the page for the docs: `python -m tools.docs.write_page_images`. Needs chromium and the extra `dev`.

With a map of Liechtenstein as its argument it writes those of the map: what `tripwatt serve --map` takes.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import httpx
import pandas as pd
from benchmarks.many_vehicles import FleetPlan, many_vehicles
from tests.live.messages import abrp_messages, measured
from tests.support.service_process import serving

from tools import DOCS
from tools.quality.page import MAP_SHOWN, SHOWN, browsing, choose_car, choose_place, context_of
from tripwatt.synthetic import example_trip

IMAGES: Final = DOCS / "images"
SETTLE_MS: Final = 700
MOMENTS: Final = 40
DRIVES: Final = 24
ROWS_DRIVEN: Final = 600
OWN_CAR: Final = "vw_id3"
OWN_CAR_TITLE: Final = "Volkswagen ID.3"
LOGGED: Final = {
    "speed_m_s": ("speed [km/h]", 3.6),
    "voltage_v": ("HV voltage [V]", 1.0),
    "current_a": ("HV current [A]", 1.0),
    "displayed_soc": ("SoC display [%]", 100.0),
    "ambient_temperature_degc": ("outside temp [°C]", 1.0),
    "elevation_m": ("altitude [m]", 1.0),
}
"""Our columns, and what the logger of the pictures calls them, in its units."""
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
    """From Vaduz to Ruggell, without the focus on a field."""
    page.wait_for_selector(MAP_SHOWN)
    change = page.locator(".trip .more")
    if change.is_visible():  # a phone has the form behind it
        change.click()
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


def logged_year() -> bytes:
    """An archive with a year of synthetic drives of one car, as a logger with time stamps writes them."""
    packed = io.BytesIO()
    plan = FleetPlan(DRIVES, vehicles=1, car_models=(OWN_CAR,), days_between=365.0 / DRIVES)
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as made:
        for log in many_vehicles(plan):
            table = log.samples
            start = pd.Timestamp(str(log.context.started_at))
            stamps = start + pd.to_timedelta(table["time_s"], unit="s")
            columns = {shown: table[ours] * factor for ours, (shown, factor) in LOGGED.items()}
            made.writestr(f"{log.trip_id}.csv", pd.DataFrame({"date": stamps, **columns}).to_csv(index=False))
    return packed.getvalue()


def _own_car(page: Any) -> None:
    choose_car(page, OWN_CAR_TITLE, OWN_CAR_TITLE)
    choose_car(page, "no car of this name", "logs and diaries")
    dialog = page.locator("dialog.wide")
    page.wait_for_timeout(SETTLE_MS)  # a single car is shown at once
    if dialog.get_by_role("button", name="All cars").count():
        dialog.get_by_role("button", name="All cars").click()
    dialog.get_by_label("Name").fill(f"my-car-{page.viewport_size['width']}")
    page.keyboard.press("Enter")
    archive = {"name": "my drives.zip", "mimeType": "application/zip", "buffer": logged_year()}
    dialog.locator("input[type=file]").first.set_input_files(archive)
    dialog.get_by_role("button", name=f"Learn {DRIVES} drives").click(timeout=60_000)
    dialog.get_by_text("new trips learned").wait_for(timeout=120_000)
    dialog.locator("h3", has_text="Learned from").evaluate("e => e.scrollIntoView()")


CAR_PICTURES: Final[dict[str, tuple[str, str, bool, Callable[[Any], None]]]] = {
    "page-car-desktop-light": ("desktop", "light", False, _own_car),
    "page-car-phone-dark": ("phone", "dark", False, _own_car),
}
"""Need a service that keeps cars."""


def _on_road(page: Any) -> None:
    """A car on its way, after ten minutes of the example trip."""
    name = "my-i3"
    with httpx.Client(base_url=page.url) as client:
        client.post("/v1/cars", json={"name": name, "vehicle": "bmw_i3_60ah"})
        token = client.post(f"/v1/cars/{name}/token").json()["token"]
        drive = measured(example_trip())
        plan = {"links": [{"length_m": 18_200.0, "speed_m_s": 12.7}], "reserve": 0.2}
        client.put(f"/v1/live/{name}/plan", json=plan).raise_for_status()
        for message in list(abrp_messages(drive, time.time() - drive["time_s"].iloc[-1]))[:ROWS_DRIVEN]:
            client.post("/v1/telemetry", json={"token": token, "tlm": message}).raise_for_status()
    page.reload()
    page.get_by_role("button", name="On the road").click()
    page.get_by_text("Left to drive").wait_for()


ROAD_PICTURES: Final[dict[str, tuple[str, str, bool, Callable[[Any], None]]]] = {
    "page-road-phone-dark": ("phone", "dark", False, _on_road),
}
"""Need a service that keeps cars, and none of them sends messages."""


def write(pictures: dict[str, tuple[str, str, bool, Callable[[Any], None]]], *options: str) -> None:
    """Write pictures of a service with options."""
    shown = MAP_SHOWN if "--map" in options else SHOWN
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
        with tempfile.TemporaryDirectory() as cars:
            write(CAR_PICTURES, "--cars", cars)
        with tempfile.TemporaryDirectory() as cars:
            write(ROAD_PICTURES, "--cars", cars)


if __name__ == "__main__":
    main()
