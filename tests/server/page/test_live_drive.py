"""A car on the road on the page: large figures that follow its messages, and clear words where there are none."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.server.cars.messages import abrp_messages, measured
from tests.server.page.conftest import serious
from tests.support.service_process import TOKEN, Service

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tests.support.drives import example_trip
from tools.quality.page import SHOWN, choose_car

from tripwatt.server.cars.folder import create_car

PLAN = {
    "links": [{"length_m": 18_000.0, "speed_m_s": 14.0}],
    "soc": 0.8,
    "reserve": 0.2,
    "destination": "Work",
}
HOUR_S = 3600.0
FIRST_ROWS = 240


@pytest.fixture
def opened(look: Any, request: pytest.FixtureRequest) -> Any:
    size, scheme, locale = getattr(request, "param", ("phone", "light", "en-IE"))
    return look(size, scheme, locale=locale)


def road(page: Any) -> Any:
    return page.locator("dialog.road")


def figures_of(page: Any) -> dict[str, str]:
    """The figures of the view by their names."""
    names, values = (road(page).locator(f".stats {part}").all_inner_texts() for part in ("dt", "dd"))
    return dict(zip(names, values, strict=True))


def new_car(service: Service, cars: Path, name: str) -> str:
    """A car that the service follows; its token."""
    create_car(cars / name, "bmw_i3_60ah")
    return str(service.client.post(f"/v1/cars/{name}/token").json()["token"])


def send(service: Service, token: str, messages: list[dict[str, Any]]) -> None:
    with httpx.Client(base_url=service.url) as client:
        for message in messages:
            assert client.post("/v1/telemetry", json={"token": token, "tlm": message}).status_code == 200


def test_figures_follow_the_messages_of_a_car(opened: Any, service: Service, cars: Path) -> None:
    page = opened
    page.get_by_role("button", name="On the road").click()
    road(page).get_by_text("No car sends messages yet.").wait_for()
    road(page).get_by_role("button", name="Close").click()

    token = new_car(service, cars, "my-i3")
    page.get_by_role("button", name="On the road").click()
    road(page).get_by_role("heading", name="my-i3").wait_for()  # the only one is followed at once
    road(page).get_by_text("No message yet.").first.wait_for()
    messages = list(abrp_messages(measured(example_trip()), time.time() - HOUR_S))
    send(service, token, [{**messages[0], "speed": 0.0}])
    road(page).get_by_text("The car is not on a trip.").wait_for()
    soc = messages[0]["soc"]
    assert road(page).locator(".stats dd").first.inner_text() == f"{soc:.0f}\u00a0%"

    service.client.put("/v1/live/my-i3/plan", json=PLAN).raise_for_status()
    send(service, token, [{**messages[1], "speed": 0.0}])
    road(page).get_by_text("Battery on arrival: Work").wait_for()
    send(service, token, messages[2:FIRST_ROWS])
    road(page).get_by_text("Left to drive").wait_for()
    page.wait_for_timeout(1000)
    now = service.client.get("/v1/live/my-i3").json()
    forecast, driven = now["forecast"], now["trip"]["distance_m"]
    assert road(page).locator(".number").inner_text() == f"{100.0 * forecast['soc_arrival']:.0f}%"
    figures = figures_of(page)
    assert figures["Left to drive"] == f"{(forecast['distance_m'] - driven) / 1000.0:.1f}\u00a0km"
    assert figures["Driven"] == f"{driven / 1000.0:.1f}\u00a0km"
    energy_wh = now["trip"]["energy_wh"]
    assert figures["Used so far"] == f"{energy_wh / 1000.0:.1f}\u00a0kWh"
    assert figures["Consumption"].split()[0] == f"{energy_wh / driven * 100.0:.1f}"
    left_s = forecast["duration_s"] - forecast["measured_until_s"]
    at = {time.strftime("%H:%M", time.localtime(time.time() + left_s + s)) for s in (-60.0, 0.0, 60.0)}
    assert figures["Arrival"].split()[-1].zfill(5) in at  # "tomorrow" before midnight
    assert road(page).locator(".todo").inner_text() == "Drive on as planned."
    assert "planned" in road(page).locator("figcaption").inner_text().lower()
    assert road(page).locator(".course .plot canvas").count() == 1
    assert "Battery on arrival: Work" in road(page).locator(".arrival").inner_text()
    low, high = (100.0 * forecast["soc_quantiles"][p] for p in ("0.05", "0.95"))
    assert f"{low:.0f} to {high:.0f}" in road(page).locator(".range").inner_text()
    road(page).get_by_text("Message within the last minute").wait_for()
    road(page).get_by_text("Connected").wait_for()
    road(page).get_by_text("screen").wait_for()  # whether it stays on is the browser's choice
    service.client.delete("/v1/cars/my-i3").raise_for_status()


@pytest.mark.parametrize("opened", [("desktop", "light", "en-IE")], indirect=True)
def test_the_trip_of_the_page_becomes_the_plan_of_the_car(opened: Any, service: Service, cars: Path) -> None:
    page = opened
    token = new_car(service, cars, "planned")
    start_s = time.time() - HOUR_S
    send(service, token, [{"utc": start_s, "speed": 0.0, "soc": 70.0, "ext_temp": 3.0}])
    page.get_by_role("button", name="On the road").click()
    road(page).get_by_text("The car is not on a trip.").wait_for()
    plan = road(page).get_by_role("button", name="Drive the planned trip")
    assert plan.count() == 0, "a driven trip is no plan"
    page.keyboard.press("Escape")
    page.get_by_role("radio", name="Distance").check()
    page.get_by_label("Distance", exact=True).last.fill("30")
    page.keyboard.press("Tab")
    page.get_by_text("30 km, country roads and motorway").first.wait_for()
    page.get_by_role("button", name="On the road").click()
    with page.expect_response(lambda answer: answer.url.endswith("/plan")) as answered:
        plan.click()
    sent, found = answered.value.request.post_data_json, answered.value.json()
    assert not {"soc", "ambient_temperature_degc"} & sent.keys(), "these are what the car sends"
    assert found["forecast"]["distance_m"] == pytest.approx(30_000.0, rel=1e-3)
    shown = f"{100.0 * found['forecast']['soc_arrival']:.0f}%"
    road(page).locator(".number", has_text=shown).wait_for()
    assert found["forecast"]["soc_arrival"] < 0.7
    assert plan.count() == 0
    service.client.delete("/v1/cars/planned").raise_for_status()


def test_an_old_message_a_lost_stream_and_a_deleted_car_are_said(
    opened: Any, service: Service, cars: Path
) -> None:
    page = opened
    document = {
        "car": "old",
        "seconds_since_message": 185.0,
        "messages": {"new": 1, "doubled": 0, "late": 0, "faulty": 0},
        "soc": None,
        "trip": {
            "departs_at": "2023-11-14T22:13:20Z",
            "duration_s": 60.0,
            "distance_m": 900.0,
            "samples": 60,
            "energy_wh": 150.0,
            "power_w": 9000.0,
        },
        "destination": None,
        "message": None,
        "plan": None,
        "usual_trip": None,
        "forecast": None,
        "ambient_temperature_degc": None,
        "flags": [],
        "faults": [{"what": "a charge that rises", "where": "soc"}],
    }
    new_car(service, cars, "old")
    said: list[Any] = []

    def once(route: Any) -> None:
        said.append(route.request.headers.get("authorization"))
        if len(said) == 1:
            body = "event: live\ndata: " + httpx.Request("POST", "http://x", json=document).content.decode()
            route.fulfill(content_type="text/event-stream", body=f"{body}\n\n")
        else:
            route.continue_()

    page.route("**/events", once)
    page.get_by_role("button", name="On the road").click()
    road(page).get_by_text("Last message 3 minutes ago").wait_for()
    road(page).get_by_text("No forecast: the route is not known.").wait_for()
    figures = figures_of(page)
    assert (figures["Power"], figures["Consumption"].split()[0]) == ("9\u00a0kW", "16.7")
    road(page).get_by_text("a charge that rises").wait_for()
    road(page).get_by_text("Connection lost, trying again").wait_for()
    road(page).get_by_text("Connected").wait_for()  # the service itself, at the second attempt
    assert said[:2] == [f"Bearer {TOKEN}"] * 2
    service.client.delete("/v1/cars/old").raise_for_status()


@pytest.mark.parametrize(
    "opened",
    [("phone", "dark", "de-DE"), ("desktop", "light", "en-IE")],
    indirect=True,
    ids=["phone", "desktop"],
)
def test_axe_finds_nothing_serious_by_day_and_by_night(opened: Any, service: Service, cars: Path) -> None:
    page = opened
    size = page.viewport_size["width"]
    token = new_car(service, cars, f"axe-{size}")
    new_car(service, cars, f"other-{size}")
    messages = list(abrp_messages(measured(example_trip()), time.time() - HOUR_S))
    service.client.put(f"/v1/live/axe-{size}/plan", json=PLAN).raise_for_status()
    page.locator("button:has(.icon-wheel)").click()
    road(page).get_by_role("button", name=f"other-{size}").wait_for()
    found = serious(page)
    road(page).get_by_role("button", name=f"axe-{size}").click()
    send(service, token, messages[:FIRST_ROWS])
    road(page).locator(".stats div").nth(3).wait_for()
    night = road(page).locator("button[aria-pressed]")
    assert night.get_attribute("aria-pressed") == ("true" if size < 500 else "false")
    for _ in range(2):
        found += serious(page)
        assert road(page).evaluate("e => e.scrollWidth <= e.clientWidth")
        night.click()
    assert found == []
    number = road(page).locator(".number").bounding_box()
    assert number["height"] > 90.0, "read from a holder"
    page.keyboard.press("Escape")
    assert not road(page).is_visible()
    for name in ("axe", "other"):
        service.client.delete(f"/v1/cars/{name}-{size}").raise_for_status()


def test_a_phone_gets_address_and_token_by_a_code(opened: Any, service: Service, cars: Path) -> None:
    page = opened
    create_car(cars / "sender", "bmw_i3_60ah")
    page.reload()
    page.wait_for_selector(SHOWN)
    choose_car(page, "no car of this name", re.compile("logs and diaries"))
    wide = page.locator("dialog.wide")
    wide.get_by_text("Let the car send speed and charge").click()
    wide.get_by_role("button", name="Create a token").click()
    wide.get_by_text("Only this computer reaches this address.").wait_for()
    assert wide.locator("svg.qr").count() == 0, "no phone reaches localhost"
    wide.get_by_label("Address of this service for the phone").fill("https://car.example/tripwatt")
    wide.get_by_role("img", name="Address and token for the app that sends").wait_for()
    token = wide.locator("code").first.inner_text()
    assert (
        wide.locator("figcaption code").inner_text()
        == f"https://car.example/tripwatt/v1/telemetry?token={token}"
    )
    assert serious(page) == []
    assert wide.evaluate("e => e.scrollWidth <= e.clientWidth")
    service.client.delete("/v1/cars/sender").raise_for_status()


def test_the_address_of_a_code_opens_the_view_with_its_token(look: Any, service: Service, cars: Path) -> None:
    new_car(service, cars, "coded")
    page = look("phone", stranger=True, expect="401")
    page.goto("about:blank")
    page.goto(f"{service.url}/#drive=coded&token={TOKEN}")
    road(page).get_by_role("heading", name="coded").wait_for()
    road(page).get_by_text("No message yet.").first.wait_for()
    page.wait_for_selector(SHOWN)
    assert TOKEN not in page.evaluate("location.href")
    service.client.delete("/v1/cars/coded").raise_for_status()


def test_what_to_do_is_to_drive_on_to_drive_slower_or_to_charge(
    opened: Any, service: Service, cars: Path
) -> None:
    page, token = opened, new_car(service, cars, "todo")
    service.client.put("/v1/live/todo/plan", json=PLAN).raise_for_status()
    messages = list(abrp_messages(measured(example_trip()), time.time() - HOUR_S))[:FIRST_ROWS]
    send(service, token, [{**message, "soc": None} for message in messages])
    document = service.client.get("/v1/live/todo").json()
    assert document["soc"] is None
    course = document["forecast"]["course"]
    course["planned"] = [soc + 0.22 for soc in course["expected"]]
    said: list[Any] = []

    def answer(route: Any) -> None:
        route.fulfill(content_type="text/event-stream", body=f"event: live\ndata: {json.dumps(said[0])}\n\n")

    page.route("**/events", answer)
    for verdict, speed_m_s, text in (
        ("arrives", None, "Drive on as planned."),
        ("open", 25.0, "At most 90\u00a0km/h keeps the reserve: 96 of 100 trips."),
        ("does_not_arrive", None, "Charge on the way: no speed is sure to keep the reserve."),
    ):
        told = {"time_s": 60.0, "verdict": verdict, "soc_arrival": 0.1, "p_arrive": 0.5}
        said[:] = [document | {"message": told | {"speed_m_s": speed_m_s, "p_at_speed": 0.96}}]
        page.get_by_role("button", name="On the road").click()
        road(page).get_by_text(text).wait_for()
        colours = "e => [e, e.closest('dialog')].map(one => getComputedStyle(one).color)"
        of_advice, of_text = road(page).locator(".todo strong").evaluate(colours)
        assert of_advice == of_text, "driving on is no alarm"
        now = figures_of(page)["Battery now"]
        planned = f"{int(now.split()[0]) + 22}\u00a0%"
        assert road(page).locator("figcaption").inner_text() == f"{now} now, {planned} planned (dotted)"
        assert 0.0 < float(now.split("\u00a0")[0]) < 80.0, "by the energy where no message has a charge"
        page.keyboard.press("Escape")
    service.client.delete("/v1/cars/todo").raise_for_status()
