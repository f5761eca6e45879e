"""The page in a real browser."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pytest
from tests.server.page.conftest import serious
from tests.support.drives import example_trip
from tests.support.service_process import TOKEN, Service
from tools.quality.page import choose_car, follow_times

Look = Callable[..., Any]

MOVES = 3


def headline(page: Any) -> int:
    return int(re.sub(r"\D", "", page.locator(".arrival .number").inner_text()))


def slider(page: Any, name: str) -> Any:
    return page.get_by_role("slider", name=name, exact=True)


def mode(page: Any, name: str) -> None:
    page.get_by_role("radio", name=name).check()


def asked(page: Any, path: str, act: Callable[[], Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The request of the page to `path` after an action, and the response; not the one for the charge to leave with."""

    def is_asked(answer: Any) -> bool:
        leaves = '"probability"' in (answer.request.post_data or "")
        return answer.url.endswith(path) and answer.ok and not leaves

    with page.expect_response(is_asked) as found:
        act()
    return found.value.request.post_data_json, found.value.json()


def gpx(step_s: float = 1.0) -> bytes:
    """Ten minutes at 15 m/s to the north, over a hill."""
    points = []
    for time in np.arange(0.0, 600.0 + step_s, step_s):
        latitude, height = 48.0 + time * 15.0 / 111_195.0, 500.0 + 30.0 * np.sin(time / 100.0)
        stamp = f"2024-01-01T10:{int(time // 60):02d}:{time % 60:06.3f}Z"
        points.append(
            f'<trkpt lat="{latitude:.7f}" lon="11"><ele>{height:.1f}</ele><time>{stamp}</time></trkpt>'
        )
    head = '<gpx version="1.1" creator="test" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
    return f"{head}{''.join(points)}</trkseg></trk></gpx>".encode()


def upload(page: Any, name: str, content: bytes) -> None:
    mode(page, "Upload")
    page.locator("input[type=file]").set_input_files(
        {"name": name, "mimeType": "application/octet-stream", "buffer": content}
    )


def test_shows_the_forecast_of_the_service(look: Look, service: Service) -> None:
    page = look("phone")
    page.locator(".chips").click()  # the line that opens the conditions
    sent, answer = asked(page, "/v1/forecast", lambda: slider(page, "Outside").press("ArrowLeft"))
    page.wait_for_timeout(100)
    assert headline(page) == round(100 * answer["soc_arrival"])
    assert page.locator(".mark-arrival").inner_text() == f"{answer['soc_arrival'] * 100:.0f}\u00a0%"
    assert "driven speed trace" in page.locator(".given").text_content()
    energy = page.locator(".stats dd").first.inner_text()
    assert energy.startswith(f"{answer['energy_wh'] / 1000:.2f}")
    assert service.forecast(sent).json() == answer
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]


def test_without_a_map_page_and_command_say_how_journeys_come(look: Look, service: Service) -> None:
    page = look()
    assert page.locator(".needs-map code").all_inner_texts() == [
        "tripwatt map build REGION.osm.pbf",
        "tripwatt serve --map map",
    ]
    assert page.locator(".needs-map").is_visible()
    assert service.process.stdout is not None
    assert "tripwatt map build" in service.process.stdout.readline()


def test_charts_follow_a_slider_causes_add_up_and_the_keyboard_is_enough(look: Look) -> None:
    page = look(expect="Canvas2D: Multiple readback")  # the test's own doing
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    slider(page, "Position along the way").focus()
    page.keyboard.press("PageUp")
    page.wait_for_function("() => document.querySelector('.readout').innerText.includes('battery')")
    page.get_by_text("Along the way as a table").press("Enter")
    rows = page.locator(".result .as-table tbody tr")
    assert rows.count() > 8
    assert rows.last.is_visible()
    cells = page.locator("section.causes tbody .value").all_inner_texts()
    parts = [float(text.replace("−", "-")) for text in cells]
    total = float(page.locator("section.causes tfoot .value").inner_text())
    assert sum(parts) == pytest.approx(total, abs=0.01 * len(parts))
    boxes = [row.bounding_box() for row in page.locator("section.causes tbody .picture span").all()]
    for (above, part), (below, _) in pairwise(zip(boxes, parts, strict=True)):
        end = above["x"] + above["width"] if part > 0 else above["x"]
        assert min(abs(below["x"] - end), abs(below["x"] + below["width"] - end)) < 4.0
    for when in ("Plan", "Compare"):
        mode(page, when)
        page.wait_for_timeout(300)
        assert len(follow_times(page, MOVES)) == MOVES  # tools.quality.page measures how quickly


def test_a_colder_trip_takes_more_and_an_empty_battery_is_told_with_what_it_lacks(look: Look) -> None:
    page = look()
    before = headline(page)
    _, answer = asked(page, "/v1/forecast", lambda: slider(page, "Outside").fill("-15"))
    sure = page.locator("details.sure")
    assert page.get_by_role("list", name="Warnings").count() == 0  # the answer is clear all the same
    sure.locator("summary").click()
    assert sure.inner_text().count("outside the range") == 1
    assert headline(page) < before
    _, answer = asked(page, "/v1/forecast", lambda: slider(page, "Reserve to keep").fill("47"))
    chance = round(100 * answer["p_arrive_by_soc"]["0.47"])
    text = page.locator(".chance").inner_text()
    assert "47" in text
    assert "more than 99" in text or "fewer than 1" in text or f"{chance} of 100 trips" in text
    page.wait_for_function(
        "() => document.querySelector('[aria-live=polite]').innerText.includes('on arrival')"
    )
    answer = answered(page, lambda: slider(page, "Battery at departure").fill("6"), soc=0.06)
    assert answer["missing_wh"]["expected"] > 0.0
    page.get_by_text("too little in the battery").first.wait_for()
    text = page.locator(".arrival").inner_text()
    assert "Empty after about" in text
    assert f"{answer['missing_wh']['expected'] / 1000:.1f}\u00a0kWh" in text
    assert "To arrive at all:" in page.locator(".chance").inner_text()
    assert page.locator(".verdict h2").inner_text() == "You will not arrive without charging"


def answered(page: Any, act: Callable[[], Any], **sent: Any) -> dict[str, Any]:
    """The forecast of the request that an action leads to; `leaves` is whether it asks for the charge to leave with."""
    leaves = sent.pop("leaves", False)

    def is_asked(answer: Any) -> bool:
        asked = answer.request.post_data_json if answer.url.endswith("/v1/forecast") else {}
        return ("probability" in asked) == leaves and all(
            asked.get(name) == pytest.approx(value) for name, value in sent.items()
        )

    with page.expect_response(is_asked) as found:
        act()
    return dict(found.value.json())


def test_who_leaves_with_what_the_page_shows_arrives_in_19_of_20_trips(look: Look) -> None:
    """Two seeded conditions: the charge that is shown is enough, and one percent less is not."""
    page = look()
    rng = np.random.default_rng(5)
    leave = page.locator(".journey-answer:not(.old)")
    for _ in range(2):
        ambient, reserve, start = (int(rng.integers(*ends)) for ends in ((-15, 30), (1, 40), (50, 100)))
        slider(page, "Outside").fill(str(ambient))
        slider(page, "Reserve to keep").fill(str(reserve))
        conditions = {"ambient_temperature_degc": ambient, "reserve": reserve / 100}
        now = slider(page, "Battery at departure")
        if now.input_value() == str(start):
            start += 1
        answer = answered(page, lambda: now.fill(str(start)), **conditions, soc=start / 100, leaves=True)  # noqa: B023
        needed = int(np.ceil(100 * answer["leave_with"]["soc_needed"] - 1e-4))
        leave.get_by_text(re.compile(f"^((Leave|Leaving) with )?{needed}\u00a0%")).first.wait_for()
        for soc, verdict in ((needed, "good"), (needed - 1, "open")):
            found = answered(page, lambda: now.fill(str(soc)), **conditions, soc=soc / 100)  # noqa: B023
            assert (found["p_arrive_by_soc"][f"{reserve / 100:g}"] >= 0.95) == (verdict == "good")
            page.locator(f".chance-{verdict}").wait_for()
            chance = page.locator(".chance .figures").inner_text().strip(" ·")
            assert f"is kept in {chance}." in page.locator(".outcomes").inner_text()
        # whatever charge the plan has
        leave.get_by_text(re.compile(f"^((Leave|Leaving) with )?{needed}\u00a0%")).first.wait_for()


def test_uploads_are_planned_or_driven_by_what_they_hold_and_their_faults_are_shown(look: Look) -> None:
    page = look(expect="422")
    upload(page, "wrong.gpx", b"<!DOCTYPE gpx [<!ENTITY a 'b'>]><gpx>&a;</gpx>")
    fault = page.locator(".trip .faults")
    fault.wait_for()
    assert "document type" in fault.inner_text().lower() or "doctype" in fault.inner_text().lower()
    assert page.get_by_role("alert").is_visible()
    page.get_by_role("button", name="Close", exact=True).click()
    page.get_by_role("alert").wait_for(state="detached")
    assert page.locator(".arrival").count() == 0  # nothing of the example that was left
    mode(page, "Examples")
    page.locator(".arrival").wait_for()
    assert headline(page) > 0
    for step_s, given in ((1.0, "the driven speed trace"), (60.0, "a planned route")):
        name = f"every-{step_s:.0f}-s.gpx"
        sent, answer = asked(page, "/v1/forecast", lambda: upload(page, name, gpx(step_s)))  # noqa: B023
        assert answer["given"] == given
        assert ("links" in sent) == (step_s > 5)
        page.get_by_text(name).wait_for()
        assert answer["series"]["distance_m"][-1] == pytest.approx(9000.0, rel=0.02)
        assert "9.0" in page.locator(".stats").last.inner_text()
        assert page.get_by_role("radio", name="Drive").is_disabled()
    track = b"<kml><LineString><coordinates>11,48 11,48.09</coordinates></LineString></kml>"
    sent, slow = asked(page, "/v1/forecast", lambda: upload(page, "way.kml", track))
    assert sent["links"]
    page.get_by_text("50 km/h is assumed").wait_for()
    speed = page.get_by_label("Speed for tracks without times")
    speed.fill("100")
    _, quick = asked(page, "/v1/forecast", lambda: speed.press("Enter"))
    page.get_by_text("100 km/h is assumed").wait_for()
    assert slow["series"]["time_s"][-1] > 1.5 * quick["series"]["time_s"][-1]
    mode(page, "mi\u00a0°F")
    note = page.locator(".trip .note", has_text="way.kml")
    note.get_by_text("62\u00a0mph is assumed").wait_for()
    assert "m/s" not in note.inner_text()
    table = example_trip().iloc[:400].to_csv(index=False).encode()
    sent, answer = asked(page, "/v1/forecast", lambda: upload(page, "log.csv", table))
    assert answer["given"] == "the driven speed trace"
    assert len(sent["samples"]["time_s"]) == 400
    mode(page, "Drive")
    _, answer = asked(page, "/update", lambda: slider(page, "Position of the car").press("End"))
    assert answer["measured_until_s"] == pytest.approx(sent["samples"]["time_s"][-1])


def test_sections_are_typed_or_pasted_a_wrong_one_is_named_and_unknown_heights_count(look: Look) -> None:
    page = look(expect="422")
    mode(page, "Road sections")
    typed = page.get_by_role("textbox", name="Sections, one a line")
    typed.fill("500\n1.5 30\n12; 80.5; 620")
    use = page.get_by_role("button", name="Use these sections")
    sent, _ = asked(page, "/v1/forecast", use.click)
    assert [link["length_m"] for link in sent["links"]] == [1500.0, 12000.0]
    assert sent["links"][1]["travel_time_s"] == pytest.approx(12000.0 * 3.6 / 80.5)
    assert sent["elevation"]["elevation_m"][-1] == 620.0
    typed.fill('[{"length_m": -5, "speed_m_s": 10}, {"length_m": 500}]')
    use.click()
    page.locator(".trip .faults li").nth(1).wait_for()
    second, first = page.locator(".trip .faults li").all_inner_texts()
    assert "link 1, length_m" in first
    assert "link 2" in second
    assert "travel_time_s" in second
    # without heights, the chances decide
    sections = json.dumps([{"length_m": 1000.0, "speed_m_s": 16.0}] * 20)
    typed.fill(sections)
    asked(page, "/v1/forecast", use.click)
    half = slider(page, "Battery at departure")
    answer = answered(page, lambda: half.fill("35"), soc=0.35)
    assert answer["climb"]["terrain"] == "unknown"
    assert 0.95 < answer["p_arrive_by_soc"]["0.1"] < 0.99
    page.locator(".chance-good").get_by_text("Very likely").wait_for()
    changes = f"With a climb of {answer['climb']['changes_at_m']['0.1']:,.0f}\u00a0m"
    page.locator("details.sure summary").click()
    for part in (".sure .given", "section.causes .note"):
        assert "Climb unknown" in page.locator(part).inner_text()
        assert changes in page.locator(part).inner_text()
    country = page.get_by_label("Terrain")
    sent, steep = asked(page, "/v1/forecast", lambda: country.select_option("mountains"))
    assert sent["terrain"] == steep["climb"]["terrain"] == "mountains"
    assert 0.5 < steep["p_arrive_by_soc"]["0.1"] < 0.95
    page.locator(".chance-open").get_by_text("Likely").wait_for()
    _, flat = asked(page, "/v1/forecast", lambda: country.select_option("flat"))
    assert flat["p_arrive_by_soc"]["0.1"] > answer["p_arrive_by_soc"]["0.1"]
    page.locator(".chance-good").get_by_text("Almost certain").wait_for()


def distance(page: Any, typed: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the service finds for a distance: the need, and the range."""

    def typing() -> None:
        page.get_by_label("Distance", exact=True).last.fill(typed)
        page.keyboard.press("Tab")

    with (
        page.expect_response(lambda r: "/v1/need?" in r.url) as need,
        page.expect_response(lambda r: "/v1/range?" in r.url) as far,
    ):
        typing()
    return need.value.json(), far.value.json()


def test_a_distance_needs_energy_and_a_charge_goes_so_far(look: Look) -> None:
    page = look(locale="en-GB")
    assert slider(page, "Outside").get_attribute("aria-valuetext").endswith("°C")
    stats = page.locator(".stats").last.inner_text()
    assert "mi/kWh" in stats
    assert "km" not in stats
    assert "°F" not in page.locator("main").inner_text()
    mode(page, "Distance")
    page.get_by_text("How far you get").wait_for()
    need, far = distance(page, "40")
    assert need["distance_m"] == pytest.approx(64_373.8, rel=1e-3)
    page.locator(".need .number", has_text=f"{need['energy_wh'] / 1000:.1f}").first.wait_for()
    enough = f"{need['energy_quantile_wh'] / 1000:.1f}\u00a0kWh is enough for 95 of 100 such trips"
    assert enough in page.locator(".need .missing").inner_text()
    assert page.get_by_text("The uncertainty comes from the car").count() == 1
    assert f"{100 * need['soc_needed']:.0f}\u00a0%" in page.locator(".need .whole").inner_text()
    assert f"{far['range_m'] / 1609.344:.0f}\u00a0mi" in page.locator(".far").inner_text()
    assert f"at least {far['interval_m'][0] / 1609.344:.0f}\u00a0mi" in page.locator(".far").inner_text()
    assert page.locator(".far tbody tr").count() == len(far["by_kind"])
    page.set_viewport_size({"width": 390, "height": 844})
    wide = "e => e.closest('.card').getBoundingClientRect().right - e.getBoundingClientRect().right"
    assert page.locator(".far tr > :last-child").evaluate_all(f"all => Math.min(...all.map({wide}))") > 0
    page.set_viewport_size({"width": 1440, "height": 900})
    before = need["energy_quantile_wh"]
    with page.expect_response(lambda r: "/v1/need?" in r.url) as colder:
        slider(page, "Outside").fill("-10")
    assert colder.value.json()["energy_quantile_wh"] > before
    page.wait_for_url(re.compile("distance_m=.*ambient_temperature_degc=-10"))
    page.reload()
    page.get_by_text("40 mi").first.wait_for()
    assert slider(page, "Outside").input_value() == "-10"
    # a wrong distance has no answer, neither its own nor that of before
    field = page.get_by_label("Distance", exact=True).last
    for typed, wrong in (("41", "-5"), ("42", "0"), ("41", ""), ("42", "1300")):
        distance(page, typed)
        page.locator(".need .number").first.wait_for()
        field.fill(wrong)
        page.keyboard.press("Tab")
        page.get_by_text("Enter a distance from 0.3 to 1,243\u00a0mi.").wait_for()
        assert field.get_attribute("aria-invalid") == "true"
        assert page.locator(".need .number").count() == 0


def test_weather_and_extras_are_fields_of_the_request_and_advice_names_what_saves(
    look: Look, service: Service
) -> None:
    page = look()
    more = page.locator("details.more")
    more.locator("summary").click()
    assert page.get_by_role("checkbox", name="Wind from").count() == 0
    sent, _ = asked(page, "/v1/forecast", lambda: more.get_by_role("checkbox", name="Wind").check())
    assert sent["wind_speed_m_s"] == pytest.approx(30.0 / 3.6)
    assert "wind_from_deg" not in sent
    page.locator("details.sure summary").click()
    page.get_by_text("The direction of the wind (30\u00a0km/h) relative to the road is unknown.").wait_for()
    sent, _ = asked(page, "/v1/forecast", lambda: more.get_by_role("checkbox", name="Rain").check())
    assert sent["rain_mm_h"] == 2.0
    sent, answer = asked(page, "/v1/forecast", lambda: more.get_by_role("checkbox", name="Trailer").check())
    assert sent["extras"] == ["trailer"]
    for chip in ("Wind 30\u00a0km/h", "Rain", "Trailer"):
        assert chip in page.locator(".chips").inner_text()
    assert service.forecast(sent).json() == answer
    sent, _ = asked(page, "/v1/forecast", lambda: slider(page, "Wind").fill("50"))
    assert sent["wind_speed_m_s"] == pytest.approx(50.0 / 3.6)
    sent, _ = asked(page, "/v1/forecast", lambda: page.get_by_role("button", name="Reset").click())
    assert not {"wind_speed_m_s", "rain_mm_h", "extras"} & set(sent)

    def is_cold(response: Any) -> bool:
        is_advice = response.url.endswith("/v1/advice")
        return is_advice and response.request.post_data_json["ambient_temperature_degc"] == -10

    with page.expect_response(is_cold) as found:
        slider(page, "Outside").fill("-10")
    sent, answer = found.value.request.post_data_json, found.value.json()
    card = page.locator(".advice[aria-busy=false]")
    card.wait_for()
    assert [one["actions"][0]["code"] for one in answer["singly"]] != []
    card.locator(".savings > li").nth(len(answer["singly"]) - 1).wait_for()
    assert card.locator(".savings > li").count() == len(answer["singly"])
    first, saved = answer["singly"][0], card.locator(".savings > li").first
    assert f"saves {-first['difference']['energy_wh'] / 1000.0:.2f}" in saved.inner_text()
    saved.get_by_text("Where it comes from").click()
    assert "kWh" in saved.locator("details p").inner_text()
    assert service.client.post("/v1/advice", json=sent).json() == answer
    mode(page, "Distance")
    assert page.locator(".advice").count() == 0


def test_compares_two_speeds_on_the_motorway(look: Look) -> None:
    page = look()
    mode(page, "Road sections")
    page.get_by_role("button", name="Try with an example").click()
    page.get_by_text(re.compile(r"\d+ road sections")).wait_for()
    mode(page, "Compare")
    page.get_by_role("button", name=re.compile("Motorway speed")).click()
    page.get_by_role("heading", name="Motorway speed 110 km/h").wait_for()
    page.get_by_role("heading", name="Motorway speed 130 km/h").wait_for()
    page.wait_for_function("() => document.querySelector('.difference')?.innerText.startsWith('110')")
    first, second = (int(re.sub(r"\D", "", t)) for t in page.locator(".side .number").all_inner_texts())
    assert second > first + 3
    assert "longer" in page.locator(".difference").inner_text()
    page.wait_for_function(
        "() => document.querySelector('.difference').innerText.includes('in 9 of 10 trips')"
    )
    told = page.locator(".difference").inner_text()
    middle, low, high = map(
        float, re.findall(r"([\d.]+)\u00a0kWh less energy \(([\d.]+) to ([\d.]+)", told)[0]
    )
    assert 0.0 < low < middle < high
    change = page.locator("section.causes tbody tr", has_text="Air drag").locator(".change").inner_text()
    assert change.startswith("−")


def test_drives_a_measured_trip(look: Look, service: Service) -> None:
    page = look()
    mode(page, "Drive")
    mode(page, "120×")
    page.get_by_role("button", name="Start").click()
    page.wait_for_function("() => document.querySelector('.drive-line .is-other')?.innerText.includes('%')")
    page.locator(".history canvas").wait_for()
    page.get_by_role("button", name="Pause").click()
    assert page.locator(".mark-car").count() == 1
    page.wait_for_timeout(500)  # the last update of the drive
    sent, answer = asked(page, "/update", lambda: slider(page, "Position of the car").press("End"))
    assert service.client.post("/v1/forecast/update", json=sent).json() == answer
    page.get_by_text("Arrived with").wait_for()
    observed = {name: np.array(column, dtype=float) for name, column in sent["observed"].items()}
    power = observed["voltage_v"] * observed["current_a"]
    measured_wh = np.trapezoid(power, observed["time_s"]) / 3600.0
    assert answer["energy_wh"] == pytest.approx(measured_wh, rel=0.01)
    gauges = [float(t.split()[0]) for t in page.locator(".drive-line dd").all_inner_texts()[1:]]
    assert gauges[0] == pytest.approx(gauges[1], abs=0.3)  # on arrival nothing is left to extrapolate


def test_another_car_is_forecast_with_its_published_values_and_a_missing_one_is_described(
    look: Look, service: Service
) -> None:
    page = look(expect="422")
    own = headline(page)
    cars = service.client.get("/v1/vehicles").json()["vehicles"]
    # the option that is active stays active when the search answers
    held: list[Any] = []
    page.route("**/v1/vehicles?*", lambda route: held.append(route))
    title = cars[-1]["title"]
    page.get_by_role("combobox", name="Car").fill(title)
    option = page.get_by_role("option", name=title).first
    while option.get_attribute("aria-selected") != "true":
        page.keyboard.press("ArrowDown")
    assert page.locator(".car [role=option]").count() < len(cars)  # filtered before the answer
    with page.expect_response("**/v1/vehicles?*"):
        held[0].continue_()
    assert option.get_attribute("aria-selected") == "true"
    page.unroute("**/v1/vehicles?*")
    page.keyboard.press("Escape")
    largest = max(cars, key=lambda car: car["usable_energy_wh"])
    sent, answer = asked(page, "/v1/forecast", lambda: choose_car(page, largest["title"], largest["title"]))
    assert sent["car"] == largest["name"]
    assert service.forecast(sent).json() == answer
    assert page.get_by_role("combobox", name="Car").input_value() == largest["title"]
    assert headline(page) > own
    assert page.get_by_role("radio", name="Drive").is_disabled()
    field = page.get_by_role("combobox", name="Car")
    before = field.input_value()
    field.click()
    page.get_by_role("option").nth(8).wait_for()
    page.keyboard.press("Escape")
    assert page.locator(".car [role=option]").count() == 0
    assert field.input_value() == before
    sent, _ = asked(page, "/v1/forecast", lambda: choose_car(page, "golf", "e-Golf"))
    assert "golf" in sent["car"]
    choose_car(page, "nothing like it", "describe it")
    form = page.get_by_role("dialog", name="My car")
    form.get_by_label("Mass without driver").fill("1830")
    form.get_by_label("Published consumption").fill("60")
    form.get_by_label("Body").select_option("hatchback")
    form.get_by_role("button", name="Use this car").click()
    form.get_by_text("consumption does not fit the car").wait_for()
    form.get_by_label("Published consumption").fill("15.5")
    sent, answer = asked(
        page, "/v1/forecast", lambda: form.get_by_role("button", name="Use this car").click()
    )
    assert sent["car"] == {
        "mass_kg": 1830,
        "consumption_kwh_per_100km": 15.5,
        "body": "hatchback",
        "heat_pump": False,
        "procedure": "wltp",
    }
    assert service.forecast(sent).json() == answer
    assert "WLTP 15.5 kWh/100 km" in field.input_value()
    assert not form.is_visible()
    # a distance is answered for it too, not for the car of the model
    with page.expect_response(lambda r: "/v1/need?" in r.url) as need:
        mode(page, "Distance")
    query = dict(parse_qsl(urlsplit(need.value.url).query))
    assert json.loads(query["car"])["mass_kg"] == 1830
    del query["car"]
    other = service.client.get("/v1/need", params=query).json()
    described = need.value.json()
    assert described["energy_quantile_wh"] > 1.1 * other["energy_quantile_wh"]
    page.locator(".need .number", has_text=f"{described['energy_wh'] / 1000:.1f}").first.wait_for()


def test_units_theme_and_language_are_stored(look: Look) -> None:
    page = look()
    mode(page, "mi\u00a0°F")
    page.get_by_role("button", name=re.compile("Theme")).click()
    slider(page, "Outside").fill("50")
    page.wait_for_timeout(300)
    page.reload()
    page.wait_for_selector(".result .plot canvas")
    assert slider(page, "Outside").get_attribute("aria-valuetext").replace("\u00a0", " ") == "50 °F"
    assert "mi" in page.locator(".stats").last.inner_text()
    assert page.get_by_role("button", name="Theme: light").is_visible()
    assert page.evaluate("document.documentElement.lang") == "en"
    page.get_by_role("radio", name="DE", exact=True).check()
    page.get_by_role("heading", name="Bedingungen").wait_for()
    assert page.evaluate("document.documentElement.lang") == "de"
    page.reload()
    page.get_by_role("heading", name="Bedingungen").wait_for()
    page.get_by_role("radio", name="EN", exact=True).check()
    page.get_by_role("heading", name="Conditions").wait_for()
    assert page.title().startswith("tripwatt: battery")


def test_is_german_in_a_german_browser_and_fits_a_narrow_phone(look: Look) -> None:
    """German has the longer words."""
    page = look("phone", locale="de-DE")
    page.set_viewport_size({"width": 360, "height": 800})
    assert page.evaluate("document.documentElement.lang") == "de"
    assert "Ladestand" in page.title()
    for name in ("Fahren", "Vergleichen", "Planen"):
        page.locator(".modes label", has_text=name).click()
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth") <= 360, name
    assert re.match(r"\d+,\d\d\s", page.locator(".stats dd").first.inner_text())


def test_requests_the_token_and_tries_an_unreachable_service_again(look: Look) -> None:
    page = look(expect="401|ERR_FAILED", stranger=True)
    page.get_by_role("textbox", name="Token").fill("a wrong one, by mistake")
    page.get_by_role("button", name="Continue").click()
    page.get_by_text("was not accepted").wait_for()
    page.get_by_role("textbox", name="Token").fill(TOKEN)
    page.get_by_role("button", name="Continue").click()
    page.wait_for_selector(".result .plot canvas")
    assert headline(page) > 0
    page.route("**/v1/**", lambda route: route.abort())
    page.reload()
    page.get_by_text("The service cannot be reached").wait_for()
    page.unroute("**/v1/**")
    page.get_by_role("button", name="Try again").click()
    page.wait_for_selector(".result .plot canvas")
    assert page.get_by_role("alert").count() == 0


@pytest.mark.parametrize(("size", "scheme"), [("desktop", "light"), ("phone", "dark")])
def test_axe_finds_nothing_serious(look: Look, size: str, scheme: str) -> None:
    """Each size and each scheme once; `tools.quality.page` looks at all four."""
    page = look(size, scheme)
    found = {}
    for name in ("Plan", "Compare", "Drive"):
        mode(page, name)
        page.wait_for_timeout(150)
        found[name] = serious(page)
    assert found == {"Plan": [], "Compare": [], "Drive": []}
