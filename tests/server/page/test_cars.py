"""A car of one's own on the page: made, taught with the logs of any app, used, and deleted, in a real browser."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.server.http.test_car_endpoints import archive, logs_of
from tests.server.page.conftest import serious
from tests.sources.test_loggers import EXPORTS, LACKING, written
from tests.support.service_process import Service
from tools.quality.page import SHOWN, choose_car

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tripwatt.server.cars.folder import create_car
from tripwatt.sources.sample import sample_trips
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Log

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


@pytest.fixture
def opened(look: Any, request: pytest.FixtureRequest) -> Any:
    size, scheme, locale = getattr(request, "param", ("desktop", "light", "en-IE"))
    return look(size, scheme, expect="422", locale=locale)  # refused on purpose


def dialog(page: Any) -> Any:
    return page.locator("dialog.wide")


def manage_cars(page: Any) -> None:
    choose_car(page, "no car of this name", re.compile("logs and diaries|Logs und Tagebücher"))


KEPT = """() => fetch("v1/cars", {
    headers: { authorization: `Bearer ${sessionStorage.getItem("tripwatt.token")}` },
}).then((answer) => answer.json())"""


def open_cars(page: Any) -> None:
    """Open the list of cars; a single car is shown at once instead."""
    kept = page.evaluate(KEPT)["cars"]
    manage_cars(page)
    page.wait_for_selector("dialog.wide[open]")
    if len(kept) == 1:
        dialog(page).locator(".heading .link").click()


def new_car(page: Any, name: str) -> None:
    open_cars(page)
    dialog(page).get_by_label("Name").fill(name)
    page.keyboard.press("Enter")
    dialog(page).get_by_role("heading", name=name).wait_for()


def send(page: Any, *files: Path | dict[str, Any]) -> None:
    dialog(page).locator("input[type=file]:not([webkitdirectory])").set_input_files(list(files))


def table(name: str, content: bytes) -> dict[str, Any]:
    return {"name": name, "mimeType": "text/csv", "buffer": content}


def read(page: Any, summary: str) -> None:
    """Wait until the files are read, with this summary."""
    dialog(page).locator(".summary").get_by_text(summary, exact=True).wait_for()


def whole(value: float) -> str:
    """A number as the page rounds it: halves away from zero."""
    return ("−" if value <= -0.5 else "") + f"{math.floor(abs(value) + 0.5)}"


def holds(page: Any, drives: str) -> None:
    dialog(page).locator(".learnable").get_by_text(drives, exact=True).wait_for()


def mapped(page: Any) -> dict[str, str]:
    """Column of the file by our name of it, of the only kind of files."""
    kind = dialog(page).locator("details.kind")
    if kind.get_attribute("open") is None:
        kind.locator("summary").first.click()
    rows = dialog(page).locator("table.mapping tbody tr")
    rows.first.wait_for()
    return {
        rows.nth(k).locator("th").inner_text(): rows.nth(k).locator("select").first.input_value()
        for k in range(rows.count())
    }


def opens_with_the_only_car(page: Any, service: Service, title: str) -> None:
    """A page without a link and without an earlier visit has the car of the service; one that was left with another car has that."""

    def visit() -> str:
        page.goto(f"{service.url}/licences.txt")  # where no timer of the page writes any more
        page.goto(service.url)
        page.wait_for_selector(SHOWN)
        return str(page.locator("header [role=combobox]").input_value())

    page.goto(f"{service.url}/licences.txt")
    page.evaluate("localStorage.clear()")
    assert visit() == title
    page.locator("header [role=combobox]").click()
    shown = page.locator("header [role=option]")
    assert [shown.nth(k).inner_text().partition(" · ")[0].partition(":")[0] for k in range(2)] == [
        "my-i3",
        "Your cars",
    ]
    page.keyboard.press("Escape")
    choose_car(page, "Leaf 24", "Nissan Leaf 24 kWh")
    page.wait_for_url(re.compile("vehicle=nissan_leaf_24"))
    assert visit() == "Nissan Leaf 24 kWh"
    choose_car(page, "my-i3", "my-i3")
    page.wait_for_url(re.compile("own="))
    assert visit() == title


def test_a_car_is_made_taught_used_and_deleted(opened: Any, service: Service) -> None:
    page = opened
    new_car(page, "my-i3")
    files = [table(*file) for file in logs_of(TRIPS).items()]
    use = dialog(page).get_by_role("button", name="Use for forecasts")
    assert "primary" not in use.get_attribute("class")  # what comes first is to add logs
    send(page, *files[:2])
    holds(page, "2 from 2 logs")
    packed = {"name": "more.zip", "mimeType": "application/zip", "buffer": archive(logs_of(TRIPS))}
    send(page, packed)  # beside what was sent before
    holds(page, f"{TRIPS} from {TRIPS} logs")  # what is sent again counts once
    dialog(page).get_by_role("button", name="Cancel").click()
    send(page, packed)
    dialog(page).get_by_role("button", name=f"Learn {TRIPS} trips").click()
    dialog(page).get_by_text(f"{TRIPS} new trips learned.").wait_for()
    car = service.client.get("/v1/cars/my-i3").json()
    rows = dialog(page).locator("table.diary").first.locator("tbody tr")
    assert rows.count() == TRIPS
    newest = car["diary"][0]
    assert rows.first.locator("td").nth(3).inner_text() == f"{newest['energy_wh'] / 1000.0:.2f}"
    shown = dialog(page).locator(".error-now .arrival").inner_text()
    assert f"{100.0 * car['latest_by_book']['weighted_error']:.1f}" in shown
    assert f"{100.0 * car['latest']['weighted_error']:.1f}" in shown
    is_better = car["latest"]["weighted_error"] < car["latest_by_book"]["weighted_error"]
    assert ("primary" in use.get_attribute("class")) == is_better
    by_name = {name: factor["seen_degc"] for name, factor in car["learned"].items()}
    seen = [degc for range_ in by_name.values() if range_ for degc in range_]
    shown = f"Measured at {whole(min(seen))} to {whole(max(seen))} °C."
    dialog(page).get_by_text(shown).wait_for()
    dialog(page).get_by_text("more factors").click()
    assert dialog(page).locator("table.learned tbody tr").count() == len(by_name)
    assert dialog(page).locator("tr.not-seen").count() == sum(value is None for value in by_name.values())
    with page.expect_response(lambda r: r.url.endswith("/v1/forecast")) as asked:
        use.click()
    assert asked.value.request.post_data_json["car"] == "my-i3"
    assert asked.value.ok
    page.get_by_text("my-i3, BMW i3 60 Ah: model from its own trips.").wait_for()
    page.wait_for_url(re.compile("own=my-i3"))
    page.reload()
    page.wait_for_selector(SHOWN)
    page.locator(".sure summary").click()
    given = page.locator(".sure .given").inner_text()
    assert f"Learned from {TRIPS} trips." in given
    assert ("not more accurate for it yet" in given) != is_better
    assert page.locator("header [role=combobox]").input_value() == "my-i3: BMW i3 60 Ah"
    opens_with_the_only_car(page, service, "my-i3: BMW i3 60 Ah")
    manage_cars(page)
    dialog(page).get_by_role("button", name="Delete …").click()
    dialog(page).get_by_role("button", name="Keep").click()
    dialog(page).get_by_role("button", name="Delete …").click()
    dialog(page).get_by_role("button", name="Delete", exact=True).click()
    dialog(page).get_by_role("heading", name="Add a car").wait_for()
    assert service.client.get("/v1/cars").json() == {"cars": [], "damaged": {}}
    dialog(page).get_by_role("button", name="Close").click()
    assert page.locator("header [role=combobox]").input_value() == "BMW i3 60 Ah"


def test_every_export_is_mapped_without_a_wrong_column(opened: Any, tmp_path: Path) -> None:
    page = opened
    new_car(page, "exports")
    for logger in EXPORTS:
        send(page, written(tmp_path, logger))
        holds(page, "1 from 1 log")
        found = mapped(page)
        for name, column in COLUMNS[logger].items():
            assert found.get(name) == column, (logger, name)
        lacking = LACKING.get(logger, set())
        assert ("State of charge (battery)" in found) == ("soc" not in lacking), logger
        assert ("State of charge (display)" in found) == ("displayed_soc" not in lacking), logger
        dialog(page).get_by_role("button", name="Cancel").click()


def test_a_column_is_corrected_and_a_wrong_one_is_explained(opened: Any, tmp_path: Path) -> None:
    page = opened
    new_car(page, "corrected")
    send(page, written(tmp_path, "torque"))
    assert mapped(page)["Speed"] == "Speed (OBD)(km/h)"
    column = dialog(page).get_by_label("Column with Speed")
    column.select_option("GPS Speed (Meters/second)")
    dialog(page).get_by_label("Unit of Speed").select_option("m/s")
    dialog(page).get_by_role("button", name="Learn 1 trip").wait_for()
    column.select_option("")
    dialog(page).locator(".files .out").get_by_text("missing key").wait_for()
    assert dialog(page).get_by_role("button", name="Learn 0 trips").is_disabled()
    column.select_option("GPS Speed (Meters/second)")
    dialog(page).get_by_role("button", name="Learn 1 trip").wait_for()
    send(page, {"name": "photo.png", "mimeType": "image/png", "buffer": b"\x89PNG"})
    dialog(page).locator(".files .out").get_by_text("no trips").wait_for()
    read(page, "2 files: 1 read, 1 left out")
    assert dialog(page).get_by_role("button", name="Learn 1 trip").is_enabled()
    # what is chosen for a kind stays with it when other files come
    send(page, written(tmp_path, "leaf_spy"))  # larger: its kind comes first
    dialog(page).get_by_text("1 file with these columns (Leaf Spy)").wait_for()
    found = page.evaluate(
        "() => [...document.querySelectorAll('details.kind')].map((kind) =>"
        " [kind.querySelector('summary').textContent, kind.querySelectorAll('select')[2].value])"
    )
    torque = [column for title, column in found if "Torque" in title]
    assert torque == ["GPS Speed (Meters/second)"], found


def test_an_energy_that_the_car_cannot_take_is_taken_only_when_asked_for(opened: Any) -> None:
    page = opened
    new_car(page, "Three times")
    for log in synthetic_fleet(2).logs:
        samples = log.samples.drop(columns=["soc", "displayed_soc"], errors="ignore")
        samples = samples.assign(current_a=3.0 * samples["current_a"])[::12]
        send(page, table(f"{log.trip_id}.csv", samples.to_csv(index=False).encode()))
    learns = dialog(page).get_by_role("button", name="Learn 2 trips")
    dialog(page).get_by_text("implausible energy").wait_for()
    assert learns.is_disabled()
    dialog(page).get_by_role("button", name="Use anyway").click()
    dialog(page).get_by_text("implausible energy").wait_for(state="detached")
    learns.click()
    dialog(page).get_by_text("2 new trips learned").wait_for()


def test_many_files_of_which_some_are_bad(opened: Any, service: Service) -> None:
    page = opened
    new_car(page, "My Model 3")
    good = [content.split(b"\n") for content in logs_of(TRIPS).values()]
    bad = (b"", bytes(range(256)) * 8, good[0][0] + b"\n")
    files = [
        table(
            f"drive {k:03}.csv",
            bad[k // 5 % 3] if k % 5 == 3 else b"\n".join(good[k % TRIPS][: 300 + k]),
        )
        for k in range(20)
    ]
    send(page, *files)
    read(page, "20 files: 16 read, 4 left out")
    groups = dialog(page).locator(".files details")
    assert groups.locator("summary").all_inner_texts() == ["4 files cannot be read", "16 files can be read"]
    assert groups.locator("li").count() == 4  # the others when they are asked for
    assert not dialog(page).locator(".findings").is_visible()  # behind one line
    reasons = " ".join(groups.locator(".why").all_inner_texts())
    for reason in ("empty file", "not a text file", "no samples"):
        assert reason in reasons
        assert dialog(page).locator(".findings").get_by_text(reason).count() >= 1
    assert dialog(page).locator(".files").evaluate("e => e.clientHeight") <= 300
    dialog(page).get_by_role("button", name="Leave out the 4 files that cannot be read").click()
    read(page, "20 files: 16 read, 4 ignored")
    assert page.evaluate("document.activeElement.className") == "files"
    assert dialog(page).locator(".findings").count() == 0
    use = dialog(page).get_by_role("button", name="Use for forecasts")
    assert use.is_enabled()
    dialog(page).get_by_role("button", name="Learn 16 trips").click()
    dialog(page).locator(".learning").wait_for()
    assert use.is_disabled()  # its forecasts would be those of the published values
    assert dialog(page).get_by_text("No own trips yet").count() == 0
    dialog(page).get_by_text("16 new trips learned.").wait_for()
    (car,) = (c for c in service.client.get("/v1/cars").json()["cars"] if c["label"] == "My Model 3")
    assert car["in_diary"] == 16
    dialog(page).get_by_role("button", name="Use for forecasts").click()
    page.get_by_text("My Model 3, BMW i3 60 Ah: model from its own trips.").wait_for()
    assert page.locator("header [role=combobox]").input_value().startswith("My Model 3:")


@pytest.mark.parametrize("opened", [("phone", "dark", "en-IE")], indirect=True, ids=["phone"])
def test_a_file_is_left_out_and_used_again_by_keyboard(opened: Any) -> None:
    page = opened
    page.set_viewport_size({"width": 360, "height": 800})
    new_car(page, "by keyboard")
    files = logs_of(3)
    send(page, *(table(*file) for file in files.items()), table("photo.png", b"\x89PNG"))
    read(page, "4 files: 3 read, 1 left out")
    name = sorted(files)[1]
    dialog(page).locator(".files").focus()
    reached: list[str] = []
    for _ in range(30):
        page.keyboard.press("Tab")
        label = page.evaluate(
            "document.activeElement.getAttribute('aria-label') ?? document.activeElement.innerText"
        )
        reached.append(label)
        if label == f"Leave out {name}":
            break
    assert "Leave out photo.png" in reached
    page.keyboard.press("Enter")
    read(page, "4 files: 2 read, 1 left out, 1 ignored")
    assert page.evaluate("document.activeElement.getAttribute('aria-label')") == f"Use {name} again"
    dialog(page).get_by_role("button", name="Learn 2 trips").wait_for()
    page.keyboard.press("Enter")
    read(page, "4 files: 3 read, 1 left out")
    assert page.evaluate("document.activeElement.getAttribute('aria-label')") == f"Leave out {name}"
    dialog(page).get_by_role("button", name="Leave out photo.png").click()
    read(page, "4 files: 3 read, 1 ignored")
    dialog(page).get_by_role("button", name="Use photo.png again").press("Enter")  # it is sent again
    read(page, "4 files: 3 read, 1 left out")
    assert dialog(page).evaluate("e => e.scrollWidth <= e.clientWidth")


def test_a_folder_is_read_with_the_folders_in_it(opened: Any, tmp_path: Path) -> None:
    page = opened
    new_car(page, "a folder")
    folder = tmp_path / "my logs"
    for k, (name, content) in enumerate(logs_of(3).items()):
        place = folder / f"{2024 + k % 2}"
        place.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)
    (folder / "readme.md").write_text("not a log")
    (folder / "2024" / ".hidden.csv").write_text("not a log")
    with page.expect_file_chooser() as chooser:
        dialog(page).get_by_role("button", name="Choose a folder").press("Enter")
    chooser.value.set_files(folder)
    read(page, "3 files: 3 read")
    dialog(page).get_by_role("button", name="Cancel").click()
    # the same by a drop, whose entries the page walks through
    page.evaluate(
        """(drives) => {
            const file = (name) => ({ isFile: true, isDirectory: false, name,
                file: (done) => done(new File([drives.pop()], name)) });
            const dir = (...inside) => ({ isFile: false, isDirectory: true, createReader: () => {
                const parts = [inside, []];
                return { readEntries: (done) => done(parts.shift() ?? []) };
            } });
            const tree = dir(file("a.csv"), file("photo.jpg"), dir(file("c.csv"), dir(file("d.CSV"))));
            const event = new Event("drop", { bubbles: true, cancelable: true });
            event.dataTransfer = { files: [new File([], "my logs")], items: [{ webkitGetAsEntry: () => tree }] };
            document.querySelector("dialog.wide .drop").dispatchEvent(event);
        }""",
        [content.decode() for content in logs_of(4).values()],
    )
    read(page, "3 files: 3 read")


@pytest.mark.parametrize(
    "opened",
    [("desktop", "light", "en-IE"), ("phone", "dark", "de-DE")],
    indirect=True,
    ids=["desktop", "phone"],
)
def test_axe_finds_nothing_serious_in_your_car(opened: Any, tmp_path: Path) -> None:
    page = opened
    open_cars(page)
    assert serious(page) == []
    width = page.viewport_size["width"]
    dialog(page).locator("input[name=name]").fill(f"axe-{width}")
    page.keyboard.press("Enter")
    leaf_spy = table("leaf_spy.csv", written(tmp_path, "leaf_spy").read_bytes())
    send(page, leaf_spy, table("empty.csv", b""), *(table(*file) for file in logs_of(2).items()))
    dialog(page).locator(".learnable").wait_for()
    for kind in dialog(page).locator("details.kind > summary").all():
        kind.click()
    assert serious(page) == []
    assert dialog(page).evaluate("e => e.scrollWidth <= e.clientWidth")


def without_heights(log: Log) -> Log:
    samples = log.samples.drop(columns=["elevation_m", "grade"], errors="ignore")
    return Log.from_samples(log.trip_id, samples, log.context)


@pytest.mark.parametrize("opened", [("phone", "light", "en-IE"), ("phone", "dark", "de-DE")], indirect=True)
def test_the_diary_begins_with_the_gain_and_says_what_to_switch_on(
    opened: Any, service: Service, cars: Path
) -> None:
    page, name = opened, f"diary-{opened.evaluate('document.documentElement.lang')}"
    sample = sample_trips()
    logs = tuple(without_heights(log) if k < 2 else log for k, log in enumerate(sample.logs[:6]))
    create_car(cars / name, "bmw_i3_60ah", label=name).add(replace(sample, logs=logs))
    page.reload()
    page.wait_for_selector(SHOWN)
    open_cars(page)
    dialog(page).get_by_role("button", name=name).click()
    figure = dialog(page).locator(".error-now .number")
    figure.wait_for()
    car = service.client.get(f"/v1/cars/{name}").json()
    rows = car["diary"]
    assert sorted(row["has_heights"] for row in rows) == [False] * 2 + [True] * 4
    parts = [rows[:3], rows[3:]]
    last, before = (
        100.0 * sum(abs(r["forecast_wh"] - r["energy_wh"]) for r in part) / sum(r["energy_wh"] for r in part)
        for part in parts
    )
    learned, without = (100.0 * car[part]["weighted_error"] for part in ("latest", "latest_by_book"))
    assert float(figure.inner_text().replace(",", ".").rstrip("%")) == pytest.approx(learned, abs=0.05)
    gain, trend = dialog(page).locator(".error-now .range").all_inner_texts()
    told = [float(one) for one in re.findall(r"\d+\.\d", f"{gain} {trend}".replace(",", "."))]
    assert told == pytest.approx([without, last, before], abs=0.05)
    why = dialog(page).locator("#own-car-diary ~ .findings li").all_inner_texts()
    assert len(why) == 2, "heights, and few trips"
    assert why[0].startswith(("2 of 6 trips without heights", "2 von 6 Fahrten ohne Höhen"))
    wide = dialog(page).evaluate(
        "e => [...e.querySelectorAll('.scroll')].filter(s => s.scrollWidth > s.clientWidth)"
    )
    assert wide == []
    assert serious(page) == []
    service.client.delete(f"/v1/cars/{name}").raise_for_status()
