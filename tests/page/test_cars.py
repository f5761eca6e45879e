"""A car of one's own on the page: made, taught with the logs of any app, used, and deleted, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.test_car_operations import archive, logs_of
from tests.sources.test_loggers import EXPORTS, WITHOUT_BMS, WITHOUT_DISPLAY, written
from tests.support.service_process import Service, serving
from tools.quality.page import SHOWN, context_of

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

TRIPS = 4
COLUMNS = {
    "teslamate": {"Speed": "speed", "Battery power": "power", "State of charge (display)": "usable_battery_level"},
    "teslalogger": {"Speed": "speed", "Battery power": "power", "State of charge (battery)": "battery_level"},
    "ovms_log": {"Battery voltage": "v.b.voltage", "Battery current": "v.b.current", "Cabin temperature": "v.e.cabintemp"},
    "abrp": {"State of charge (display)": "soc", "Heating and cooling": "hvac_power", "Battery current": "current"},
    "torque": {"Speed": "Speed (OBD)(km/h)", "State of charge (display)": "SoC Display(%)"},
    "leaf_spy": {"Battery voltage": "Pack Volts", "Battery current": "Pack Amps", "Heater": "Est Pwr Htr(250w)"},
    "car_scanner": {"Battery voltage": "[BMS] HV battery voltage"},
    "german": {"Speed": "Geschwindigkeit", "Battery current": "HV-Strom (A)", "Cabin temperature": "Innentemperatur (°C)"},
}  # fmt: skip
"""What some rows of the mapping have to show."""


@pytest.fixture(scope="module")
def keeper(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("keeper")
    (folder / "cars").mkdir()
    (folder / "logs").mkdir()
    with serving(folder / "logs", "--workers", "1", "--cars", f"{folder / 'cars'}") as found:
        yield found


@pytest.fixture
def opened(browser: Any, keeper: Service, request: pytest.FixtureRequest) -> Iterator[Any]:
    size, scheme, locale = getattr(request, "param", ("desktop", "light", "en-IE"))
    context, wrong = context_of(browser, size, scheme, locale), []
    context.set_default_timeout(60_000)
    page = context.new_page()
    page.on("console", lambda m: None if "422" in m.text else wrong.append(m.text))  # refused on purpose
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda r: None if r.url.startswith(keeper.url) else wrong.append(r.url))
    page.goto(keeper.url)
    page.wait_for_selector(SHOWN)
    yield page
    context.close()
    assert wrong == []


def dialog(page: Any) -> Any:
    return page.locator("dialog.wide")


def open_cars(page: Any) -> None:
    """Open the list of cars; a single car is shown at once instead."""
    single = page.locator(".car option[value^='own:']").count() == 1
    page.locator(".car select").first.select_option("own")
    page.wait_for_selector("dialog.wide[open]")
    if single:
        dialog(page).locator(".heading .link").click()


def new_car(page: Any, name: str) -> None:
    open_cars(page)
    dialog(page).get_by_label("Name").fill(name)
    page.keyboard.press("Enter")
    dialog(page).get_by_role("heading", name=name).wait_for()


def send(page: Any, *files: Path | dict[str, Any]) -> None:
    dialog(page).locator("input[type=file]").set_input_files(list(files))


def mapped(page: Any) -> dict[str, str]:
    """Column of the file by our name of it."""
    rows = dialog(page).locator("table.mapping tbody tr")
    rows.first.wait_for()
    return {
        rows.nth(k).locator("th").inner_text(): rows.nth(k).locator("select").first.input_value()
        for k in range(rows.count())
    }


def test_a_car_is_made_taught_used_and_deleted(opened: Any, keeper: Service) -> None:
    page = opened
    new_car(page, "my-i3")
    files = [{"name": n, "mimeType": "text/csv", "buffer": c} for n, c in logs_of(TRIPS).items()]
    send(page, *files[:2])
    dialog(page).get_by_text("2 logs, 2 sound drives").wait_for()
    packed = {"name": "more.zip", "mimeType": "application/zip", "buffer": archive(logs_of(TRIPS))}
    send(page, packed)  # beside what was sent before
    dialog(page).get_by_text(f"{TRIPS + 2} logs").wait_for()
    dialog(page).get_by_role("button", name="Cancel").click()
    send(page, packed)
    dialog(page).get_by_role("button", name=f"Learn {TRIPS} drives").click()
    dialog(page).get_by_text(f"{TRIPS} new trips learned; 0 logs were known.").wait_for()
    car = keeper.client.get("/v1/cars/my-i3").json()
    rows = dialog(page).locator("table.diary").first.locator("tbody tr")
    assert rows.count() == TRIPS
    newest = car["diary"][0]
    assert rows.first.locator("td").nth(3).inner_text() == f"{newest['energy_wh'] / 1000.0:.2f}"
    shown = dialog(page).locator(".before-after").first.inner_text()
    assert f"{100.0 * car['latest_by_book']['weighted_error']:.1f}" in shown
    assert f"{100.0 * car['latest']['weighted_error']:.1f}" in shown
    assert dialog(page).locator(".learned li").count() >= 3
    with page.expect_response(lambda r: r.url.endswith("/v1/forecast")) as asked:
        dialog(page).get_by_role("button", name="Use for forecasts").click()
    assert asked.value.request.post_data_json["model"] == "my-i3"
    assert asked.value.ok
    page.get_by_text("my-i3, BMW i3 60 Ah: the model of its own trips.").wait_for()
    page.reload()
    page.wait_for_selector(SHOWN)
    assert page.locator(".car select").first.input_value() == "own:my-i3"
    page.locator(".car select").first.select_option("own")
    dialog(page).get_by_role("button", name="Delete …").click()
    dialog(page).get_by_role("button", name="Keep").click()
    dialog(page).get_by_role("button", name="Delete …").click()
    dialog(page).get_by_role("button", name="Delete", exact=True).click()
    dialog(page).get_by_role("heading", name="Add a car").wait_for()
    assert keeper.client.get("/v1/cars").json() == {"cars": []}
    dialog(page).get_by_role("button", name="Close").click()
    assert page.locator(".car select").first.input_value() == "bmw_i3_60ah"


def test_every_export_is_mapped_without_a_wrong_column(opened: Any, tmp_path: Path) -> None:
    page = opened
    new_car(page, "exports")
    for logger in EXPORTS:
        send(page, written(tmp_path, logger))
        dialog(page).get_by_text("1 log, 1 sound drive").wait_for()
        found = mapped(page)
        for name, column in COLUMNS[logger].items():
            assert found.get(name) == column, (logger, name)
        assert ("State of charge (battery)" in found) == (logger not in WITHOUT_BMS), logger
        assert ("State of charge (display)" in found) == (logger not in WITHOUT_DISPLAY), logger
        dialog(page).get_by_role("button", name="Cancel").click()


def test_a_column_is_corrected_and_a_wrong_one_is_explained(opened: Any, tmp_path: Path) -> None:
    page = opened
    new_car(page, "corrected")
    send(page, written(tmp_path, "torque"))
    assert mapped(page)["Speed"] == "Speed (OBD)(km/h)"
    column = dialog(page).get_by_label("Column with Speed")
    column.select_option("GPS Speed (Meters/second)")
    dialog(page).get_by_label("Unit of Speed").select_option("m/s")
    dialog(page).get_by_role("button", name="Learn 1 drive").wait_for()
    column.select_option("")
    dialog(page).get_by_text("missing key").wait_for()
    assert dialog(page).get_by_role("button", name="Learn 0 drives").is_disabled()
    send(page, {"name": "photo.png", "mimeType": "image/png", "buffer": b"\x89PNG"})
    dialog(page).locator(".faults").get_by_text("no trips").wait_for()


@pytest.mark.parametrize(
    "opened",
    [("desktop", "light", "en-IE"), ("phone", "dark", "de-DE")],
    indirect=True,
    ids=["desktop", "phone"],
)
def test_axe_finds_nothing_serious_in_your_car(opened: Any, tmp_path: Path) -> None:
    from axe_playwright_python.sync_playwright import Axe

    page = opened
    open_cars(page)
    found = [
        v["id"] for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")
    ]
    width = page.viewport_size["width"]
    dialog(page).locator("input[name=name]").fill(f"axe-{width}")
    page.keyboard.press("Enter")
    send(page, written(tmp_path, "leaf_spy"))
    mapped(page)
    found += [
        v["id"] for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")
    ]
    assert found == []
    assert dialog(page).evaluate("e => e.scrollWidth <= e.clientWidth")
