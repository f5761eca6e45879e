"""From A to B on the page, by keyboard and on the map, with the roads of a router on loopback."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pytest
from PIL import Image
from tests.server.page.conftest import serious
from tests.support.roads import END, START, encoded, valhalla_answers
from tests.support.router_server import answering, write_map
from tests.support.service_process import Service, serving
from tools.quality.page import MAP_SHOWN, context_of

ARC = {"legs": [{"shape": encoded([START, (47.02, 9.05), END])}]}


def router_answers() -> Callable[[str], Any]:
    """A Valhalla with another road to the north, and tiles without roads."""
    answers = valhalla_answers()
    answers["route"]["alternates"] = [{"trip": ARC}]
    return lambda path: b"" if path.startswith("/tile") else answers[path.strip("/").partition("?")[0]]


@pytest.fixture(scope="module")
def planner(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("planner")
    (folder / "logs").mkdir()
    with answering(router_answers()) as router:
        named = f"{write_map(folder / 'map')}@valhalla={router.url}"
        with serving(folder / "logs", "--workers", "1", "--map", named) as found:
            yield found


@pytest.fixture(scope="module")
def opened(browser: Any, planner: Service) -> Iterator[tuple[Any, list[str]]]:
    """One page for all tests, with what it said and asked that it should not."""
    context = context_of(browser, "desktop", "light", "en-IE")
    context.set_default_timeout(60_000)
    page, wrong = context.new_page(), []
    page.on("console", lambda m: None if "GL Driver Message" in m.text else wrong.append(m.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda r: None if r.url.startswith(planner.url) else wrong.append(r.url))
    yield page, wrong
    context.close()


@pytest.fixture
def expected() -> list[str]:
    """Parts of what the browser may tell of in a test."""
    return []


@pytest.fixture
def page(opened: tuple[Any, list[str]], planner: Service, expected: list[str]) -> Iterator[Any]:
    page, wrong = opened
    page.set_viewport_size({"width": 1440, "height": 900})
    page.goto(f"{planner.url}/licences.txt")  # where no timer of the page writes any more
    page.evaluate("localStorage.clear()")
    page.goto(planner.url)
    # without a link in its address and without an earlier visit: an example of the map
    page.get_by_text("an example of this map").wait_for()
    page.locator(".todo:not(.old)").wait_for()
    yield page
    page.goto(f"{planner.url}/licences.txt")  # an answer that is under way is told of in its own test
    found = [text for text in wrong if not any(part in text for part in expected)]
    wrong.clear()
    assert found == []


def choose(page: Any, label: str, typed: str, name: str) -> None:
    """Type the start of a name and take the first suggestion with the keyboard."""
    page.get_by_label(label, exact=True).first.focus()
    page.keyboard.type(typed)
    page.get_by_role("option", name=name).first.wait_for()
    page.keyboard.press("Enter")


def whole_answer(page: Any, act: Callable[[], Any]) -> Any:
    """The response with all answers that an action leads to."""

    def is_whole(response: Any) -> bool:
        asked = response.url.endswith("/v1/journeys") and response.request.post_data_json
        return bool(asked) and asked.get("alternatives") == 2

    with page.expect_response(is_whole) as planned:
        act()
    return planned.value


def plan(page: Any) -> Any:
    choose(page, "From", "west", "Westend")
    choose(page, "To", "ost", "Ostheim")
    return whole_answer(page, lambda: page.get_by_role("button", name="Plan", exact=True).click()).json()


def centre(page: Any, selector: str) -> tuple[float, float]:
    box = page.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def tip(page: Any, selector: str) -> tuple[float, float]:
    """The corner of a pin at its place."""
    box, lean = page.locator(selector).bounding_box(), page.locator(selector).get_attribute("data-lean")
    return (
        box["x"] + (0.0 if lean.endswith("left") else box["width"]),
        box["y"] + (0.0 if lean.startswith("top") else box["height"]),
    )


def test_from_a_to_b_by_keyboard_alone_where_axe_finds_nothing_serious(page: Any) -> None:
    choose(page, "From", "west", "Westend")
    page.keyboard.press("Tab")
    page.keyboard.type("ost")
    page.get_by_role("option", name="Ostheim").first.wait_for()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    answer = whole_answer(page, lambda: page.keyboard.press("Enter")).json()
    assert [stop["name"] for stop in answer["stops"]] == ["Westend", "Ostheim"]
    page.get_by_text("Westend – Ostheim").first.wait_for()
    assert page.get_by_text("© OpenStreetMap contributors, ODbL 1.0").is_visible()
    # what the driver sees is the answer of the service to the conditions of the page
    slider = page.get_by_label("Outside", exact=True).first
    slider.focus()
    colder = whole_answer(page, lambda: page.keyboard.press("PageDown")).json()
    assert 0.1 < answer["soc_needed"] < colder["soc_needed"] < 1.0
    shown = f"{-(-colder['soc_needed'] * 100 // 1):.0f}\u00a0%".replace("-", "")
    page.locator(".journey-answer:not(.old)").get_by_text(shown).wait_for()
    roads = page.get_by_role("group", name="Routes").get_by_role("radio")
    assert roads.count() == len(colder["roads"]) == 2
    assert "Fastest" in page.locator(".roads label").first.inner_text()
    roads.first.focus()
    page.keyboard.press("ArrowRight")
    metres = colder["roads"][1]["forecast"]["series"]["distance_m"][-1]
    assert metres > colder["roads"][0]["forecast"]["series"]["distance_m"][-1]
    distance = page.locator(".stats dd").nth(2)
    distance.get_by_text(f"{metres / 1000:.1f}").wait_for()
    page.emulate_media(color_scheme="dark")
    page.wait_for_selector(MAP_SHOWN)
    found = serious(page)
    page.emulate_media(color_scheme="light")
    assert found == []


def test_a_click_sets_a_then_b_and_dragging_b_gives_the_new_arrival(page: Any) -> None:
    page.wait_for_selector(MAP_SHOWN)
    page.get_by_text("Choose your own start on the map").wait_for()
    # the marks of the example are 0.1 ° of longitude apart, and their tips are on the road
    (west_x, y), (ost_x, _) = (tip(page, f".end-{end}") for end in ("from", "to"))
    y, apart, middle = y + 25.0, ost_x - west_x, centre(page, ".map-canvas")[1]
    x = west_x + 0.6 * apart

    def road_y() -> float:
        """Where the road is, since what is said above the map moves it."""
        return y - 25.0 + centre(page, ".map-canvas")[1] - middle

    page.mouse.click(west_x + 0.04 * apart, y)
    page.get_by_text("Choose the destination on the map").wait_for()
    page.locator(".end-to").wait_for(state="detached")  # the map draws after the text
    answer = whole_answer(page, lambda: page.mouse.click(west_x + 0.96 * apart, y))
    west, ost = answer.request.post_data_json["stops"]
    assert west["longitude_deg"] == pytest.approx(9.004, abs=0.006)
    assert ost["longitude_deg"] == pytest.approx(9.096, abs=0.006)
    # what was clicked 25 px beside the road is on it, and the page says how far that is
    told = page.locator(".verdict .off-road", has_text="from the nearest road").first
    told.wait_for()
    assert told.bounding_box()["y"] < page.locator("#verdict-title").bounding_box()["y"]
    for end in ("from", "to"):
        assert tip(page, f".end-{end}")[1] == pytest.approx(road_y(), abs=4.0)
    bx, by = centre(page, ".end-to")
    page.mouse.move(bx, by)
    page.mouse.down()
    with page.expect_response(lambda r: r.url.endswith("/v1/journeys")) as draft:
        page.mouse.move(bx + 8, by)
    quick = draft.value.request.post_data_json
    assert quick["answers"] is False
    assert quick["stops"][0] == west
    assert ost["longitude_deg"] < quick["stops"][1]["longitude_deg"] < ost["longitude_deg"] + 0.02
    page.mouse.move(bx + 4, by)
    last = whole_answer(page, page.mouse.up).request.post_data_json
    assert last["stops"][1]["longitude_deg"] < quick["stops"][1]["longitude_deg"]
    place = page.get_by_label("To", exact=True).first.input_value()
    assert place == last["stops"][1]["name"]
    # the pointer on the road shows the charge there
    page.mouse.move(x, road_y())
    page.locator(".readout").get_by_text("battery").wait_for()


def test_a_station_is_avoided_and_used_again_by_keyboard_and_stopped_at_by_mouse(
    page: Any, expected: list[str]
) -> None:
    expected.append("422")  # the router has one road
    page.wait_for_selector(MAP_SHOWN)
    plan(page)
    stations = page.get_by_label("Charging stations in view")
    stations.locator("option", has_text="Halbweg").wait_for(state="attached")
    stations.focus()
    page.keyboard.type("Halb")
    page.locator(".station").get_by_text("150\u00a0kW").wait_for()
    avoided = whole_answer(
        page, lambda: page.get_by_role("button", name="Avoid", exact=True).press("Enter")
    ).request.post_data_json
    assert [(one["name"], one["longitude_deg"]) for one in avoided["avoid"]] == [("Halbweg", 9.05)]
    page.get_by_text("Avoided: Halbweg").wait_for()
    assert serious(page) == []
    page.wait_for_function("() => location.hash.includes('avoid=Halbweg')")
    again = whole_answer(page, lambda: page.get_by_role("button", name="Use again: Halbweg").press("Enter"))
    assert "avoid" not in again.request.post_data_json
    page.keyboard.press("Escape")
    stations.select_option("")
    page.wait_for_timeout(SETTLE_MS)
    (west, y), (east, _) = (tip(page, f".end-{end}") for end in ("from", "to"))
    page.mouse.click((west + east) / 2.0, y)
    with page.expect_response(lambda r: r.url.endswith("/v1/journeys")) as asked:
        page.get_by_role("button", name="Stop here").click()
    start, stop, end = asked.value.request.post_data_json["stops"]
    assert (stop["name"], stop["kind"]) == ("Halbweg", "charging_station")
    assert "kind" not in start | end
    page.wait_for_function("() => location.hash.includes('station=Halbweg')")
    page.get_by_label("Via 1", exact=True).first.wait_for()
    with page.expect_response(
        lambda r: r.url.endswith("/v1/journeys") and len(r.request.post_data_json["stops"]) == 2
    ):
        page.get_by_role("button", name="Do not stop here").click()
    page.get_by_label("Via 1", exact=True).first.wait_for(state="detached")


SETTLE_MS = 1500
"""Time for the map to move, and to ask for what is in view then."""


def wider(route: Any) -> None:
    """An area that reaches farther than the road of the router of these tests."""
    answer = route.fetch().json()
    for area in answer["areas"]:
        area["polygon"]["coordinates"] = [[[8.6, 46.9], [9.4, 46.8], [9.2, 47.2], [8.6, 46.9]]]
    route.fulfill(json=answer)


def test_the_area_of_reach_is_fitted_into_view_and_follows_the_charge(page: Any) -> None:
    page.wait_for_selector(MAP_SHOWN)
    page.route("**/v1/reachable", wider)
    views: list[str] = []
    page.on("request", lambda request: views.append(request.url) if "/v1/map/view" in request.url else None)
    box = page.get_by_label("Show how far you get from A")
    choose(page, "From", "west", "Westend")
    with page.expect_response(lambda r: r.url.endswith("/v1/reachable")) as found:
        box.check()
    asked = found.value.request.post_data_json
    assert asked["start"]["name"] == "Westend"
    assert [area["probability"] for area in found.value.json()["areas"]] == [0.95, 0.5]
    page.get_by_text("dashed line: in 50 of 100").wait_for()
    rings = [ring for area in found.value.json()["areas"] for ring in area["polygon"]["coordinates"]]
    (west, south), (east, north) = (limit(np.concatenate(rings), axis=0) for limit in (np.min, np.max))
    page.wait_for_timeout(SETTLE_MS)
    view = {name: float(value) for name, value in parse_qsl(urlsplit(views[-1]).query)}
    assert view["south"] < south <= north < view["north"]
    assert view["west"] < west < east < view["east"]
    shares = (east - west) / (view["east"] - view["west"]), (north - south) / (view["north"] - view["south"])
    assert max(shares) > 0.5  # and little else
    with page.expect_response(lambda r: r.url.endswith("/v1/reachable")) as again:
        page.get_by_role("slider", name="Battery at departure", exact=True).press("Home")
    assert again.value.request.post_data_json["soc"] == pytest.approx(0.0)
    box.uncheck()
    page.get_by_text("dashed line: in 50 of 100").wait_for(state="detached")
    page.unroute("**/v1/reachable")


FIRST_PX = 600.0
"""The part of the first screen in which the answer is complete."""


def test_the_verdict_is_first_also_on_paper_and_follows_every_condition(page: Any, planner: Service) -> None:
    plan(page)
    page.emulate_media(media="print")
    assert page.locator(".verdict h2").is_visible()
    for control in (".ways", ".share", ".conditions", ".modes"):
        assert not page.locator(control).first.is_visible(), control
    page.emulate_media(media="screen")
    for size in ((1280, 800), (390, 844)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.evaluate("scrollTo(0, 0)")
        for part in (".verdict h2", ".verdict .number", ".verdict .chance", ".verdict .whole"):
            box = page.locator(part).first.bounding_box()
            assert box["y"] + box["height"] <= FIRST_PX, (part, size)
        assert page.locator(".verdict").bounding_box()["y"] < page.locator(".map").bounding_box()["y"]
    page.locator(".chips").press("Enter")  # on a phone, the conditions are behind their line
    slider = page.get_by_role("slider", name="Extra time per charging stop")
    assert slider.get_attribute("aria-valuetext") == "5\u00a0min"
    asked = whole_answer(page, lambda: slider.fill("12")).request.post_data_json
    assert asked["stop_overhead_s"] == 720.0
    assert "12\u00a0min per stop" in page.locator(".chips").inner_text()
    whole_answer(page, lambda: page.get_by_label("Departure", exact=True).fill("2030-01-12T07:30"))
    with page.expect_response(lambda r: r.url.endswith("/v1/journeys")) as asked:
        page.get_by_label("Battery", exact=True).check()
    sent = asked.value.request.post_data_json
    assert sent["departs_at"].startswith("2030-01-12T07:30:00")
    assert sent["battery_temperature_degc"] == 25.0
    assert sent["cabin_temperature_degc"] == 10.0  # the cabin is not preheated with it
    assert "7:30" in page.locator(".chips").inner_text()
    assert "warm battery" in page.locator(".chips").inner_text()
    page.keyboard.press("Escape")
    assert not page.get_by_label("Departure", exact=True).is_visible()
    # who looks at the examples sees a forecast, also on a phone, where the list folds behind it
    rows = page.evaluate("fetch('v1/examples').then(answer => answer.json())")["examples"]
    longest = max(rows, key=lambda row: row["distance_m"])["trip"]
    page.locator(".trip .more").click()
    page.get_by_role("radio", name="Examples").check()
    page.locator(".todo:not(.old)").wait_for()
    page.wait_for_url(re.compile(f"example={longest}(&|$)"))
    page.locator(".trip .more").click()
    page.get_by_role("radio", name="Upload").check()
    page.get_by_text("or drop").first.wait_for()
    # a tab without a trip leaves no answer up
    page.locator(".empty", has_text="Choose a file.").wait_for()
    assert page.locator(".verdict .number").count() == 0
    page.get_by_role("radio", name="From A to B").check()
    page.locator(".verdict .number").wait_for()


STATION = {
    "latitude_deg": 47.0,
    "longitude_deg": 9.05,
    "name": "Halbweg",
    "power_w": 150_000.0,
    "direct_current": True,
    "power_known": True,
    "plugs": [],
}


def charging(answer: dict[str, Any], label: str, leave: float, minutes: float) -> dict[str, Any]:
    """A plan with one charging stop halfway, as the service gives it."""
    road = answer["roads"][0]
    whole, middle = road["distance_m"], road["distance_m"] / 2.0
    driving = road["forecast"]["series"]["time_s"][-1]
    stopped = 60.0 * minutes + 300.0
    soc = [0.16, 0.13, leave, leave - 0.03]
    full = {"station": STATION | {"name": "Beiweg"}, "soc_arrival": 0.12, "p_reach": 0.96, "more_s": 240.0}
    stop = {
        "station": STATION,
        "position_m": middle,
        "soc_arrival": 0.13,
        "soc_interval": [0.11, 0.15],
        "soc_leave": leave,
        "energy_wh": 5000.0,
        "charging_s": 60.0 * minutes,
        "overhead_s": 300.0,
        "arrives_after_s": driving / 2.0,
        "p_reach": 0.98,
        "needed_below": 0.14,
        "preheat": False,
        "if_full": full,
        "pause_s": 0.0,
    }
    return {
        "label": label,
        "stops": [stop],
        "p_arrive": 0.998,
        "p_reserve": 0.97,
        "soc_arrival": leave - 0.03,
        "soc_interval": [leave - 0.05, leave - 0.01],
        "driving_s": driving,
        "charging_s": stopped,
        "duration_s": driving + stopped,
        "energy_wh": road["forecast"]["energy_wh"] + 40.0,
        "by_cause_wh": {"rolling": road["forecast"]["energy_wh"], "climate": 40.0},
        "battery_loss_wh": 30.0,
        "course": {
            "position_m": [0.0, middle, middle, whole],
            "time_s": [0.0, driving / 2.0, driving / 2.0 + stopped, driving + stopped],
            "displayed_soc": soc,
            "low": [one - 0.02 for one in soc],
            "high": [one + 0.02 for one in soc],
        },
        "line": road["line"],
    }


def test_verdict_list_and_chart_speak_of_the_journey_with_its_charging_stop(page: Any) -> None:
    def with_stops(route: Any) -> None:
        answer = route.fetch().json()
        if route.request.post_data_json.get("answers") is not False:
            answer["charging"] = charging(answer, "fastest", 0.45, 12.0)
            answer["charging_alternatives"] = [charging(answer, "safest", 0.62, 20.0)]
            answer["roads"][1]["charging"] = charging(answer, "fastest", 0.55, 15.0)
            answer["roads"].append(answer["roads"][1] | {"labels": []})  # looks like the second one
        route.fulfill(json=answer)

    page.route("**/v1/journeys", with_stops)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("11"))
    page.get_by_role("heading", name="You will arrive, with 1 charging stop").wait_for()
    assert "Almost impossible" not in page.locator(".verdict").inner_text()
    number, at_end = page.locator(".verdict .number"), page.locator(".verdict .arrival .missing")
    assert number.inner_text().startswith("13")  # the least of all, at the stop
    assert at_end.inner_text().startswith("Battery on arrival: 42\u00a0%")
    assert "97 of 100 trips" in page.locator(".chance").inner_text()
    assert "12\u00a0min charging, 5\u00a0min plugging in" in page.locator(".whole").inner_text()
    todo = page.locator(".todo li").first.inner_text().replace("\u00a0", " ")
    assert todo.startswith("Drive ")
    assert "safely in reach" not in todo  # there is another station
    there = "to “Halbweg” and charge for 12 min with about 25 kW, from 13 % to 45 %; you are there at about "
    assert there in todo.replace("there tomorrow at", "there at")
    assert page.locator(".todo a").count() == 0  # a computer opens no link to a position
    stops = page.locator(".stops li")
    assert stops.count() == 1
    for part in (
        "Halbweg",
        "13\u00a0% to 45\u00a0%, for 12\u00a0min",
        "98 of 100 trips",
        "If it is occupied: Beiweg",
        "needed only if you have less than 14\u00a0% there",
    ):
        assert part in stops.inner_text()
    assert page.locator(".mark-arrival").inner_text() == "42\u00a0%"
    assert page.locator(".mark-stop").inner_text() == "1"
    assert "mark-left" in page.locator(".mark-stop").get_attribute(
        "class"
    )  # beside its line, which is not at the axis
    causes = page.locator(
        "section.causes tr"
    )  # of the whole journey too, with what warms the battery for the stop
    assert causes.filter(has_text="Heating and cooling").locator(".value").inner_text() == "0.04"
    total = page.locator(".whole dd").last.inner_text().split()[0]
    assert causes.last.locator(".value").inner_text() == total
    headed = page.locator(".choices").inner_text()
    assert [headed.count(title) for title in ("Charging stops", "Charging plans", "Routes")] == [1, 0, 1]
    group = page.get_by_role("group", name="Charging plans")
    assert group.inner_text().count("97 of 100 trips") == 2
    assert "same energy" not in group.inner_text()  # only what differs is said
    assert page.get_by_role("group", name="Routes").get_by_role("radio").count() == 2
    plans = group.get_by_role("radio")
    plans.first.focus()
    page.keyboard.press("ArrowRight")
    page.locator(".verdict .arrival .missing", has_text="59\u00a0%").wait_for()
    assert page.locator(".mark-arrival").inner_text() == "59\u00a0%"
    page.get_by_role("group", name="Routes").get_by_role("radio").nth(
        1
    ).check()  # another road has stops of its own
    page.locator(".verdict .arrival .missing", has_text="52\u00a0%").wait_for()
    page.get_by_role("heading", name="You will arrive, with 1 charging stop").wait_for()
    page.unroute("**/v1/journeys")


def test_who_charges_at_the_start_drives_nowhere_first_and_a_doubtful_charge_is_named_so(page: Any) -> None:
    def beside_the_start(route: Any) -> None:
        answer = route.fetch().json()
        if route.request.post_data_json.get("answers") is not False:
            whole = charging(answer, "best effort", 0.45, 12.0)
            whole["stops"] = [whole["stops"][0] | {"position_m": away, "if_full": None, "needed_below": 0.1}]
            whole["stops"][0]["p_reach"] = reach
            answer["charging"] = whole | ({} if below else {"p_arrive": 0.96, "p_reserve": reach})
            answer["verdict"]["reason"] = "leaves_below_reserve" if below else "to_a_stop"
        elif reach == 0.6:
            answer["roads"][0]["forecast"]["p_arrive_by_soc"]["0"] = reach
        route.fulfill(json=answer)

    below, away, reach = False, 150.0, 0.81

    page.route("**/v1/journeys", beside_the_start)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("11"))
    page.locator(".todo:not(.old) li", has_text="Halbweg").wait_for()
    page.locator(
        ".todo:not(.old) li", has_text="If it is occupied, wait"
    ).wait_for()  # after another was looked for
    told = [one.replace("\u00a0", " ") for one in page.locator(".todo li").all_inner_texts()]
    first, occupied, *_ = told
    charge = "Charge here, at “Halbweg”, for 12 min with about 25 kW, from 13 % to 45 %."
    assert first == charge
    assert occupied == "If it is occupied, wait: no other station near your route is in reach."
    title = "You will arrive, but perhaps below your reserve at Halbweg"
    assert page.locator("#verdict-title").inner_text() == title
    figure = " ".join(page.locator(".verdict .arrival").inner_text().split())
    there = "Lowest battery, at Halbweg 13% 11 to 15 % in 9 of 10 trips"  # and then of the end
    assert figure == f"{there} Battery on arrival: 42 % (40 to 44 %)"
    assert page.locator(".todo ~ .headline").count() == 1  # with so little, what to do comes first
    below, reach = True, 0.98
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("8"))
    page.get_by_role("heading", name="Charge here first, then you will arrive").wait_for()
    assert page.locator(".todo ~ .headline").count() == 1
    assert "charging now" in page.locator(".whole").inner_text()
    assert page.locator(".reason").count() == 0  # who charges first does not leave with less than the reserve
    assert "You get there" not in page.locator(".todo:not(.old)").inner_text()
    away = 900.0
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("7"))
    there = page.locator(".todo:not(.old) li", has_text="you get there in 98 of 100 trips, with 11 to 15")
    there.wait_for()
    assert "you arrive there" not in page.locator(".stops").inner_text()  # once is enough
    assert "needed only if" not in page.locator(".stops").inner_text()  # less than the charge there can be
    from_there = "to reach the first stop, and to have 10\u00a0% or more from there on"
    assert from_there in page.locator(".verdict .chance").inner_text()
    reach = 0.6
    held: list[Any] = []

    def hold(route: Any) -> None:
        if '"climate":"off"' in (route.request.post_data or ""):
            return held.append(route)
        route.continue_()

    page.route("**/v1/forecast", hold)
    with page.expect_request(
        lambda sent: '"climate":"off"' in (sent.post_data or "") and "links" in sent.post_data
    ) as asked:
        whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("19"))
    page.get_by_role("heading", name="Looking for charging stops").wait_for()
    assert page.locator(".todo, .stops").count() == 0  # nothing is told before the slow way is known
    held.pop().continue_()
    page.get_by_role("heading", name="Drive slowly to Halbweg, and you will arrive").wait_for()
    told = [one.replace("\u00a0", " ") for one in page.locator(".todo li").all_inner_texts()]
    slowly = "Drive 0.9 km, no faster than 60 km/h and with heating and air conditioning off, to “Halbweg” and charge for"
    assert told[0].startswith(slowly)
    assert re.match("You get there in .* Driven as usual: in ", told[1])
    assert page.locator(".verdict-open .chance-open").count() == 1
    assert page.get_by_role("group", name="Routes").count() == 0
    sent = asked.value.post_data_json  # the way to the station
    assert all(3.6 * link["length_m"] < 60.1 * link["travel_time_s"] for link in sent["links"])
    page.unroute("**/v1/forecast")
    page.unroute("**/v1/journeys")


def test_the_next_station_has_a_plug_of_the_car_and_its_way_is_told(page: Any) -> None:
    def without_another(route: Any) -> None:
        body = route.request.post_data_json
        body["stops"].sort(key=lambda stop: stop["longitude_deg"])  # the router of these tests has one road
        answer = route.fetch(post_data=json.dumps(body)).json() | {"plugs": ["type2_combo"]}
        if body.get("answers") is not False:
            whole = charging(answer, "fastest", 0.45, 12.0)
            answer["charging"] = whole | {"stops": [whole["stops"][0] | {"if_full": None, "p_reach": 0.01}]}
        route.fulfill(json=answer)

    def around(route: Any) -> None:
        at = [(9.03, "Stecker", "type2_combo"), (9.04, "Fremd", "chademo")]
        places = [
            STATION | {"longitude_deg": lon, "name": name, "plugs": [plug(kind)]} for lon, name, kind in at
        ]
        route.fulfill(json={"settlements": [], "stations": places, "attribution": ""})

    def plug(kind: str) -> dict[str, Any]:
        return {"kind": kind, "power_w": 150_000.0, "power_known": True}

    page.route("**/v1/map/view**", around)
    page.route("**/v1/journeys", without_another)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("15"))
    told = page.locator(".todo:not(.old) li", has_text="Stecker")
    told.wait_for()
    way = (
        "If it is occupied, wait, or drive to “Stecker”, the nearest other station for this car: "
        r"7\.[0-9] km \([0-9]+ min\) by road, away from your destination\. "
        r"You get there in 9[0-9] of 100 trips, with [0-4] to [5-9] %\."
    )
    assert re.fullmatch(way, told.inner_text().replace("\u00a0", " ").strip())
    # with little charge, but sure to get there: nobody has to drive slowly for the reserve
    assert "no faster than" not in page.locator(".todo").inner_text()
    stations = page.get_by_role("combobox", name="Charging stations in view").locator("option")
    assert [one.split(" · ")[0] for one in stations.all_inner_texts()[1:]] == ["Halbweg", "Stecker"]
    page.unroute("**/v1/journeys")
    page.unroute("**/v1/map/view**")


def test_a_plan_with_fewer_stops_is_one_tap_away(page: Any) -> None:
    def with_stops(route: Any) -> None:
        answer = route.fetch().json()
        if route.request.post_data_json.get("answers") is not False:
            one, two = charging(answer, "fewest stops", 0.62, 20.0), charging(answer, "fastest", 0.45, 12.0)
            (stop,) = two["stops"]
            two["stops"] = [stop, stop | {"position_m": 1.1 * stop["position_m"]}]
            answer["charging"], answer["charging_alternatives"] = two, [one]
        route.fulfill(json=answer)

    page.route("**/v1/journeys", with_stops)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("11"))
    page.get_by_role("heading", name="You will arrive, with 2 charging stops").wait_for()
    page.get_by_role("radio", name="Fewest stops").check()
    page.get_by_role("heading", name="You will arrive, with 1 charging stop").wait_for()
    page.unroute("**/v1/journeys")


def test_the_figures_of_a_way_back_are_those_of_its_end(page: Any, expected: list[str]) -> None:
    expected.append("422")  # the advice about the way back

    def one_way(route: Any) -> None:
        body = route.request.post_data_json  # the router of these tests has one road
        back, pause_s = body.pop("round_trip", False), body.pop("pause_s", None)
        answer = route.fetch(post_data=json.dumps(body)).json()
        answer |= {} if back else {"soc_needed": 0.98}
        for road in answer["roads"] if back else []:
            road["stops"] = [{"position_m": road["distance_m"] / 2.0}]
        if pause_s and body.get("answers") is not False:
            answer["charging"] = out_and_back(charging(answer, "fastest", 0.45, 12.0), pause_s)
        route.fulfill(json=answer)

    def out_and_back(plan: dict[str, Any], pause_s: float) -> dict[str, Any]:
        """With a stop on the way out, one in the pause, and one on the way back."""
        line, (stop,), whole = plan["line"], plan["stops"], plan["course"]["position_m"][-1]
        back = {name: column + column[::-1] for name, column in line.items()}
        back["position_m"] = line["position_m"] + [2.0 * whole - at for at in line["position_m"][::-1]]
        places = [
            0.0,
            *(0.4 * whole,) * 2,
            *(0.999 * whole,) * 2,
            1.01 * whole,
            *(1.6 * whole,) * 2,
            2.0 * whole,
        ]
        soc = [0.5, 0.3, 0.8, 0.55, 1.0, 0.99, 0.7, 0.9, 0.8]
        times = [60.0 * k + pause_s * (k > 4) for k in range(9)]
        course = {
            "position_m": places,
            "time_s": times,
            **dict.fromkeys(("displayed_soc", "low", "high"), soc),
        }
        stops = [stop | {"position_m": places[k], "pause_s": pause_s * (k == 3)} for k in (1, 3, 6)]
        return plan | {"line": back, "course": course, "stops": stops}

    def labels() -> list[str]:
        return page.locator(".verdict :is(.label, dt)").all_inner_texts()[:2]

    page.route("**/v1/journeys", one_way)
    plan(page)
    page.locator(".todo:not(.old)").wait_for()
    assert labels() == ["Battery on arrival", "Arrival"]
    page.get_by_label("And back").press("Space")
    page.locator(".todo:not(.old) li", has_text="At Ostheim at about").wait_for()
    assert labels() == ["Battery when back", "Back at"]
    page.get_by_label("Pause at the destination").fill("8")
    page.keyboard.press("Enter")
    page.locator(".todo:not(.old) li", has_text="Pause of").wait_for()

    page.get_by_role(
        "heading", name=re.compile("^Or, if you can charge to 99.% before you leave \\([0-9.]+.kWh more\\)$")
    ).wait_for()
    *told, now, better = [
        words.replace("\u00a0", " ") for words in page.locator(".todo :is(p, li, strong)").all_inner_texts()
    ]
    assert re.match(
        "Do not drive straight there with [0-9]+ %: you would arrive with [0-9]+ %, with the", now
    )
    assert re.match("Drive straight there and charge in the pause only: .* less on the way.", better)
    assert [words.split(" ")[0] for words in told[:6]] == ["Drive", "If", "At", "Charge", "If", "Drive"]
    assert "with 55 %. Pause of 8 h; start back" in told[2]  # before the car charges in the pause
    pausing = "in the pause: at least to 14 % (about 23 s). Up to 45 % for 12 min with about 25 kW."
    assert told[3].endswith(pausing)
    assert page.locator(".stops > li").count() == 4
    assert page.locator(".stops > li").nth(1).inner_text().startswith("At Ostheim")
    page.unroute("**/v1/journeys")


def test_who_reaches_no_station_is_told_not_to_set_out_and_then_what_to_do(
    page: Any, expected: list[str]
) -> None:
    expected.append("422")

    def without_stops(route: Any) -> None:
        given = route.fetch()
        if given.status == 422:  # no road to the station "Eck" or "Luft"
            return route.fulfill(response=given)
        answer = given.json() | {"charging": None, "charging_alternatives": [], "soc_needed": 0.3}
        answer["soc_needed_with_stops"] = with_stops
        answer["roads"] = [road | {"charging": None} for road in answer["roads"]]
        return route.fulfill(json=answer)

    def around(route: Any) -> None:
        # from Westend, 12, 8 and 3.8 km; no road leads to the last
        at = [(47.09, 8.91, "Eck"), (47.0, 9.11, "Nah"), (47.0, 8.95, "Luft")]
        by = float(re.findall("north=([0-9.]+)", route.request.url)[0]) - 47.0
        near = [one for one in at if max(one[0] - 47.0, abs(one[1] - 9.0)) < by]
        places = [
            STATION | {"latitude_deg": lat, "longitude_deg": lon, "name": name} for lat, lon, name in near
        ]
        route.fulfill(json={"settlements": [], "stations": places, "attribution": ""})

    with_stops = None
    page.route("**/v1/map/view**", around)
    page.route("**/v1/journeys", without_stops)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("1"))
    title = re.compile("^Do not set out: the charge lasts about [0-9]+.km( .[0-9]+ to [0-9]+.km.)?$")
    page.get_by_role("heading", name=title).wait_for()
    assert page.locator(".verdict :is(.number, .whole)").count() == 0
    page.locator(".todo:not(.old) li", has_text="You get there in").wait_for()
    todo = [words.replace("\u00a0", " ") for words in page.locator(".todo li").all_inner_texts()]
    assert (
        todo[0]
        == "If you can charge here: to 30 % or more before you set out. Otherwise call roadside assistance."
    )
    told = (
        "With this charge, no charging stop was .* charging station is Nah, 7.[0-9] km by road. "
        "You get there in (fewer than )?[0-9]+ of 100 trips(, with [0-9]+( to [0-9]+)? %( or less)?)?."
        "( Drive at most 60 km/h, with heating .*)?"
    )
    assert re.fullmatch(told, todo[1].strip()), todo[1]
    with_stops = 0.221
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("2"))
    page.locator(".todo:not(.old) li", has_text="leave with 30").wait_for()
    todo = [words.replace("\u00a0", " ") for words in page.locator(".todo li").all_inner_texts()]
    first = page.locator(".todo p").first.inner_text().replace("\u00a0", " ")
    assert re.fullmatch(
        r"If you can charge here to 23 % or more \([0-9.]+ kWh more\), you arrive with your reserve, with a .*",
        first,
    )
    assert todo[:2] == [
        "If you cannot charge here, call roadside assistance.",
        "To drive without a stop: leave with 30 % or more.",
    ]
    page.unroute_all(behavior="wait")  # answers that are under way find their page


def test_a_chosen_station_that_does_not_help_says_why(
    page: Any, planner: Service, expected: list[str]
) -> None:
    expected.append("422")
    fault = {"code": "no-charging-station-for-this-car", "what": "no", "where": "Halbweg"}
    problem = {"type": "/problems/invalid-input", "title": "", "status": 422, "faults": [fault]}
    soc: float | None = -0.07

    def answered(route: Any) -> None:
        body = route.request.post_data_json
        if soc is None and len(body["stops"]) == 3:
            return route.fulfill(status=422, json=problem, content_type="application/problem+json")
        body["stops"] = [body["stops"][0], body["stops"][-1]]  # the router of these tests has one road
        answer = route.fetch(post_data=json.dumps(body)).json()
        answer |= {"charging": None, "charging_alternatives": []}
        halfway = [{"position_m": answer["roads"][0]["distance_m"] / 2.0, "displayed_soc": soc}]
        answer["roads"] = [road | {"charging": None, "stops": halfway} for road in answer["roads"]]
        return route.fulfill(json=answer)

    page.route("**/v1/journeys", answered)
    places = "place=Westend%4047,9&station=Halbweg%4047,9.05&place=Ostheim%4047,9.1"
    page.goto(f"{planner.url}/licences.txt")
    page.goto(f"{planner.url}/#trip=journey&{places}&soc=0.02&vehicle=bmw_i3_60ah")
    page.get_by_text("“Halbweg” is out of reach with this charge.").wait_for()
    for there, told in (
        (0.03, "You would reach “Halbweg” with about 3"),
        (0.2, "Even after charging at “Halbweg”"),
    ):
        soc = there
        page.wait_for_load_state("networkidle")  # answers that are under way find their page
        page.reload()
        page.get_by_text(told).wait_for()
    soc = None
    page.wait_for_load_state("networkidle")
    page.reload()
    page.get_by_role("alert").get_by_text("“Halbweg” has no plug for this car").wait_for()
    page.get_by_role("alert").get_by_role("button", name="Do not stop here").click()
    page.get_by_role("alert").wait_for(state="detached")
    page.locator(".todo:not(.old)").wait_for()  # the answer that is under way
    page.unroute_all(behavior="ignoreErrors")


@pytest.mark.parametrize(
    ("spare", "told"),
    [(0.0, ". With less you have to charge on the way."), (0.04, ", with little to spare.")],
)
def test_who_has_just_what_is_needed_is_told_so(page: Any, spare: float, told: str) -> None:
    """No one is told not to leave with less where less is enough."""

    def just_enough(route: Any) -> None:
        answer = route.fetch().json()
        answer["soc_needed"] = answer["roads"][0]["forecast"]["series"]["displayed_soc"][0] - spare
        route.fulfill(json=answer)

    page.route("**/v1/journeys", just_enough)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("83"))
    page.get_by_text(f"83\u00a0% is enough{told}").wait_for()
    page.unroute("**/v1/journeys")


def test_a_journey_starts_where_the_device_is(browser: Any, planner: Service) -> None:
    """Asked on a tap only; who cannot be found is told why."""
    context = context_of(browser, "phone", "light", "en-IE")
    page = context.new_page()
    answer = page.goto(planner.url)
    assert "geolocation=(self)" in answer.headers["permissions-policy"]
    page.locator(".todo:not(.old)").wait_for()
    page.get_by_role("button", name="Change", exact=True).first.click()
    field = page.get_by_label("From", exact=True).first

    def tap() -> None:
        field.click()
        page.get_by_role("option", name="From here").click()

    tap()
    page.get_by_text("The browser may not tell where you are.").wait_for()
    field.fill("Westend")
    page.get_by_role("option", name="Westend").first.wait_for()
    field.fill("")  # who deletes the old place may still take his own
    page.get_by_role("option", name="From here").wait_for()
    context.grant_permissions(["geolocation"])
    context.set_geolocation({"latitude": 52.0, "longitude": 13.0})
    tap()
    page.get_by_text("You are outside this map.").wait_for()
    context.set_geolocation({"latitude": 47.001, "longitude": 9.01})
    tap()
    page.wait_for_function("e => e.value === 'Your position'", arg=field.element_handle())
    assert page.locator(".place-from .faults").inner_text() == ""
    found = whole_answer(page, page.get_by_role("button", name="Plan", exact=True).click)
    start = found.request.post_data_json["stops"][0]
    assert (start["latitude_deg"], start["longitude_deg"]) == pytest.approx((47.001, 9.01))
    context.close()


def test_two_journeys_are_compared_with_their_charging_stops(page: Any) -> None:
    def with_stops(route: Any) -> None:
        answer = route.fetch().json()
        warm = route.request.post_data_json.get("cabin_setpoint_degc") != 18
        for road in answer["roads"]:
            charges, seconds = (2, 7200.0) if warm else (1, 5400.0)
            road["whole"] |= {
                "charges": charges,
                "duration_s": seconds,
                "soc_arrival": 0.31 if warm else 0.33,
            }
        route.fulfill(json=answer)

    page.route("**/v1/journeys", with_stops)
    page.get_by_role("radio", name="Compare").check()
    page.wait_for_function("() => document.querySelectorAll('.side')[1]?.innerText.includes('1 stop')")
    first, second = (side.replace("\u00a0", " ") for side in page.locator(".side").all_inner_texts())
    assert ("31" in first, "2 stops" in first, "2 h" in first) == (True, True, True)
    assert ("33" in second, "1 h 30" in second) == (True, True)
    told = page.locator(".difference").inner_text()
    assert "2.0 points" in told or "2.0 percentage points" in told
    assert "30\u00a0min less" in told
    assert (
        "1 stop" in page.locator(".roads").first.inner_text()
        or "2 stops" in page.locator(".roads").first.inner_text()
    )
    page.unroute("**/v1/journeys")
    page.get_by_role("radio", name="Plan", exact=True).check()


def test_on_a_phone_the_first_of_several_stops_is_on_the_first_screen(browser: Any, planner: Service) -> None:
    """In German, which has the longer words."""

    def with_stops(route: Any) -> None:
        answer = route.fetch().json()
        if route.request.post_data_json.get("answers") is not False:
            whole = charging(answer, "fastest", 0.45, 12.0)
            whole["stops"] = [
                whole["stops"][0] | {"position_m": whole["stops"][0]["position_m"] + k} for k in range(3)
            ]
            answer["charging"] = whole | {"charging_s": 3480.0}
        route.fulfill(json=answer)

    context = context_of(browser, "phone", "light", "de-DE")
    context.set_default_timeout(60_000)
    page = context.new_page()
    page.route("**/v1/journeys", with_stops)
    page.goto(planner.url)
    first = page.locator(".todo:not(.old) li").first
    first.wait_for()
    for part in ("bis „Halbweg“ fahren", "12\u00a0min mit etwa 25\u00a0kW laden", "45\u00a0%"):
        assert part in first.inner_text()
    assert "43\u00a0min laden, 15\u00a0min anstecken" in page.locator(".whole").inner_text()
    link = first.locator("a")  # for the navigation of the phone
    assert link.get_attribute("href") == "geo:47,9.05"
    box = first.bounding_box()
    assert box["y"] + box["height"] <= FIRST_PX
    each = page.locator(".todo li", has_text="von 13\u00a0% auf 45\u00a0%")
    assert [one.is_visible() for one in each.all()] == [True, True, True]
    context.close()


def test_names_on_the_map_keep_clear_of_the_pins_and_of_the_road(page: Any) -> None:
    """With the pins out of the way, nothing dark is where they stand or along the road: only dots of places."""
    share = 0.3

    def with_a_place_on_the_road(route: Any) -> None:
        found = route.fetch().json()
        place = {
            "name": "Mittdorf",
            "kind": "village",
            "latitude_deg": 47.0,
            "longitude_deg": 9.0 + 0.1 * share,
        }
        found["settlements"].append(found["settlements"][0] | place)
        route.fulfill(json=found)

    page.route("**/v1/map/view?*", with_a_place_on_the_road)
    page.reload()
    page.wait_for_selector(MAP_SHOWN)
    page.wait_for_timeout(2 * SETTLE_MS)
    boxes = [page.locator(f".end-{end}").bounding_box() for end in ("from", "to")]
    tips = [tip(page, f".end-{end}") for end in ("from", "to")]
    page.evaluate("document.querySelectorAll('.end-mark').forEach((e) => { e.style.visibility = 'hidden'; })")
    picture = np.asarray(Image.open(BytesIO(page.screenshot())).convert("L"), dtype=int)
    page.unroute("**/v1/map/view?*")

    def darkest(x: float, y: float, width: float, height: float) -> int:
        return int(picture[round(y) : round(y + height), round(x) : round(x + width)].min())

    for box in boxes:
        rows = box["height"] - DOT_PX
        assert darkest(box["x"] + DOT_PX, box["y"], box["width"] - 2.0 * DOT_PX, rows) > TEXT
    (west, y), (east, _) = tips
    for x in (west, west + share * (east - west), east):
        for side in (x - DOT_PX - 60.0, x + DOT_PX):
            assert darkest(side, y - 6.0, 60.0, 12.0) > TEXT
        above, below = (darkest(x - 60.0, start, 120.0, 20.0) for start in (y - 30.0, y + 10.0))
        assert min(above, below) < TEXT  # the name stands there


DOT_PX = 10.0
TEXT = 80
"""Grey of names [0 to 255]; the road is lighter."""


def test_places_are_typed_as_coordinates_or_names_and_an_unknown_one_is_told_with_the_region(
    page: Any, planner: Service
) -> None:
    choose(page, "From", "47.0, 9.0", "47.0000, 9.0000")
    page.get_by_label("To", exact=True).first.focus()
    page.keyboard.type("ost")
    page.locator("[role=option]").first.wait_for()
    page.keyboard.press("Escape")
    assert page.locator("[role=option]").count() == 0
    page.get_by_label("To", exact=True).first.fill("")
    assert page.get_by_role("button", name="Plan", exact=True).is_disabled()
    button = page.get_by_role("button", name="Plan", exact=True)
    page.get_by_label("From", exact=True).first.fill("Westend")
    page.get_by_label("To", exact=True).first.fill("")
    assert button.is_disabled()
    page.get_by_label("To", exact=True).first.fill("ostheim")
    page.keyboard.press("Tab")  # to the button, which the suggestions would cover
    answer = whole_answer(page, lambda: page.keyboard.press("Enter")).json()
    assert [stop["name"] for stop in answer["stops"]] == ["Westend", "Ostheim"]
    assert page.get_by_label("To", exact=True).first.input_value() == "Ostheim"
    assert page.locator("[role=option]").count() == 0
    to = page.get_by_label("To", exact=True).first
    to.fill("Qqxz")
    page.get_by_text("No place is called “Qqxz”.").wait_for()
    assert to.get_attribute("aria-invalid") == "true"
    page.locator(".verdict.late").wait_for()
    page.keyboard.press("Enter")
    page.get_by_text("No place is called “Qqxz”.").wait_for()
    assert page.locator(".verdict.late").count() == 1
    to.fill("Ostheim")
    page.get_by_text("No place is called").wait_for(state="detached")

    def also(route: Any) -> None:
        found = route.fetch().json()
        for place in found["places"]:
            place["also_called"] = "Vestend"
        route.fulfill(json=found)

    def with_heights(route: Any) -> None:
        route.fulfill(
            json=route.fetch().json() | {"terrain": {"known": True, "source": "SRTM tiles of NASA"}}
        )

    page.route("**/v1/places?*", also)
    page.get_by_label("From", exact=True).first.focus()
    page.keyboard.type("westen")
    option = page.get_by_role("option", name="Westend").first
    option.wait_for()
    assert option.inner_text() == "Westend — also Vestend · town"
    page.unroute("**/v1/places?*")
    covers = planner.client.get("/v1/map").json()["covers"]
    assert "Westend" in covers
    page.get_by_label("To", exact=True).first.fill("Qqxz")
    page.get_by_text(f"No place is called “Qqxz”. The map covers {covers}.").wait_for()
    page.route("**/v1/map", with_heights)
    page.reload()
    page.locator("section.causes .note").get_by_text("Heights: SRTM tiles of NASA.").wait_for()
    assert "The route climbs " in page.locator("section.causes .note").inner_text()
    page.unroute("**/v1/map")


def test_figures_of_other_places_are_named_and_no_stops_are_looked_for(page: Any) -> None:
    plan(page)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("11"))
    page.locator(".todo:not(.old)").wait_for()
    kept = page.locator(".verdict h2").inner_text()
    to = page.get_by_label("To", exact=True).first
    to.fill("Qqxz")
    page.get_by_text("No place is called “Qqxz”.").wait_for()
    for name in ("", "Hauptstraße"):  # unknown, then known and not planned
        if name:
            to.fill("")
            choose(page, "To", "haupt", name)
        page.get_by_text("The figures are of Westend – Ostheim.").wait_for()
        assert page.locator(".verdict h2").inner_text() == "Will I arrive?"
        assert page.locator(".verdict.late .number").count() == 1
        assert page.get_by_text("Looking for charging stops").count() == 0
    to.fill("")
    choose(page, "To", "ost", "Ostheim")
    page.locator(".verdict h2", has_text=kept).wait_for()
    page.locator(".verdict.late").wait_for(state="detached")


def test_one_reason_is_first_and_no_action_contradicts_the_plan(page: Any) -> None:
    chances = {"p_arrive": 0.9, "p_reserve": 0.6}

    def with_stops(route: Any) -> None:
        answer = route.fetch().json()
        if route.request.post_data_json.get("answers") is not False:
            answer["charging"] = charging(answer, "fastest", 0.45, 12.0) | chances
            answer |= {"motorway_speed_m_s": 25.0, "soc_needed": 0.4}
            answer["verdict"] |= {"reason": "to_a_stop"}
        route.fulfill(json=answer)

    def advised(route: Any) -> None:
        answer = route.fetch().json()
        whole = {"duration_s": 3600.0, "charges": 1, "p_reserve": chances["p_reserve"]}
        one = {"code": "other_road", "value": 1.0, "effort": "some", "wall_wh": 0.0, "before_s": 0.0}
        answer["singly"] = [answer["singly"][0] | {"actions": [one]}, *answer["singly"][1:]]
        route.fulfill(json=answer | {"whole": whole, "p_arrive": 0.1, "least": []})

    page.route("**/v1/journeys", with_stops)
    page.route("**/v1/journeys/advice", advised)
    slider = page.get_by_role("slider", name="Battery at departure")
    whole_answer(page, lambda: slider.fill("16"))
    page.get_by_role("heading", name="You may not arrive", exact=True).wait_for()
    label = page.locator(".verdict .arrival .label").inner_text()
    assert label == "Lowest battery, at Halbweg"  # the end has the risk, and more charge
    todo = page.locator(".todo :is(p, li, strong)").all_inner_texts()
    assert [words.split()[0] for words in todo] == [
        "If",
        "Drive",
        "If",
        "Or",
    ]  # who has 16 % does not leave with 40 %
    assert todo[-1] == "Or drive at most 90\u00a0km/h on motorways, without a charging stop."
    page.get_by_text("None of these gives a chance").wait_for()
    page.locator(".advice", has_text="Take the route “Route 2”").wait_for()
    roads = page.get_by_role("group", name="Routes").get_by_role("radio")
    assert roads.count() == 2  # a road that is advised can be chosen
    chances |= {"p_arrive": 0.999, "p_reserve": 0.97}
    with page.expect_response("**/v1/journeys/advice"):
        slider.fill("17")
    page.get_by_role("heading", name="You will arrive, with 1 charging stop").wait_for()
    page.get_by_text("None of these gives a chance").wait_for(state="detached")
    chances |= {"p_arrive": 0.3, "p_reserve": 0.1}
    whole_answer(page, lambda: slider.fill("16"))
    page.get_by_role("heading", name="Even with charging stops you will probably not arrive").wait_for()
    page.unroute_all(behavior="ignoreErrors")


def test_a_road_of_unknown_heights_is_not_green(page: Any) -> None:
    def with_reason(route: Any) -> None:
        answer = route.fetch().json()
        answer["verdict"] |= {"arrives": True, "reason": "unknown_heights"}
        route.fulfill(json=answer)

    plan(page)
    page.locator(".verdict-good").wait_for()
    page.route("**/v1/journeys", with_reason)
    whole_answer(page, lambda: page.get_by_role("slider", name="Battery at departure").fill("85"))
    page.get_by_text("The heights of this road are unknown.").wait_for()
    assert page.locator(".verdict-good").count() == 0
    page.get_by_role("heading", name="You will probably arrive", exact=True).wait_for()
    page.unroute("**/v1/journeys")


def test_a_place_outside_of_the_map_is_told_with_its_region(page: Any, expected: list[str]) -> None:
    expected.append("422")  # the refusal

    def outside(route: Any) -> None:
        fault = {
            "what": "place outside of the map",
            "where": "a to b",
            "got": "none",
            "allowed": "near a road",
        }
        document = {"type": "/problems/invalid-input", "title": "The input is invalid", "status": 422}
        route.fulfill(status=422, json=document | {"detail": "", "faults": [fault]})

    page.route("**/v1/journeys", outside)
    page.get_by_role("slider", name="Outside", exact=True).fill("-3")
    page.locator(".trip .covers").wait_for()
    assert page.locator(".verdict .number").count() == 1  # the same journey, under other conditions
    choose(page, "To", "haupt", "Hauptstraße")
    page.get_by_role("button", name="Plan", exact=True).press("Enter")
    page.locator(".verdict .number").wait_for(state="detached")
    assert page.locator(".verdict h2").inner_text() == "Will I arrive?"
    page.unroute("**/v1/journeys")


def test_the_way_back_and_a_place_on_the_way(page: Any, expected: list[str]) -> None:
    expected.append("422")  # the router has one road
    choose(page, "From", "west", "Westend")
    page.get_by_role("button", name="Add a place on the way").press("Enter")
    choose(page, "Via 1", "haupt", "Hauptstraße")
    choose(page, "To", "ost", "Ostheim")
    page.get_by_label("And back").press("Space")  # what is typed is planned when it is complete
    page.get_by_label("Pause at the destination").fill("8")
    with page.expect_response(lambda r: r.url.endswith("/v1/journeys")) as asked:
        page.get_by_role("button", name="Plan", exact=True).press("Enter")
    sent = asked.value.request.post_data_json
    assert sent["pause_s"] == 28_800.0
    assert [stop["name"] for stop in sent["stops"]] == ["Westend", "Hauptstraße, Westend", "Ostheim"]
    assert sent["round_trip"] is True
    page.get_by_text("Westend – Hauptstraße, Westend – Ostheim – Westend").first.wait_for()
    # it has a pin of its own, which is dragged as A and B are
    pin = page.get_by_role("img", name="Via 1: Hauptstraße, Westend")
    assert pin.inner_text() == "V1"
    choose(page, "Via 1", "47.0, 9.06", "47.0000, 9.0600")
    page.get_by_role("button", name="Plan", exact=True).press("Enter")
    page.wait_for_timeout(SETTLE_MS)
    x, y = centre(page, ".end-via")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y)
    with page.expect_response(lambda r: r.url.endswith("/v1/journeys")) as asked:
        page.mouse.up()
    moved = asked.value.request.post_data_json["stops"]
    page.get_by_role("alert").wait_for()  # the router of these tests has one road
    assert moved[1]["longitude_deg"] > 9.06
    assert [moved[0], moved[2]] == [sent["stops"][0], sent["stops"][2]]
    page.get_by_role("button", name="Remove Via 1").press("Enter")
    page.get_by_label("Via 1").first.wait_for(state="detached")
    assert page.locator(".end-mark").count() == 2


def test_a_plan_is_a_link(page: Any, planner: Service, expected: list[str]) -> None:
    expected.append("422")  # the router has one road
    plan(page)
    # the last change is in the link of who reloads at once
    page.wait_for_timeout(SETTLE_MS)
    slider = page.get_by_role("slider", name="Outside", exact=True)
    slider.fill("-9")
    page.reload()
    assert "ambient_temperature_degc=-9" in page.url
    page.locator(".todo:not(.old)").wait_for()
    assert slider.input_value() == "-9"
    whole_answer(page, lambda: slider.fill("-7"))
    page.get_by_text("Weather and extras").press("Enter")
    whole_answer(page, lambda: page.get_by_label("Roof box").check())
    page.wait_for_function("() => location.hash.includes('extras=roof_box')")
    page.locator(".todo:not(.old)").wait_for()
    link = page.evaluate("location.href")
    shown = page.locator(".verdict .number").first.inner_text()
    page.evaluate("localStorage.clear()")
    page.goto("about:blank")
    page.goto(link)
    page.locator(".todo:not(.old)").wait_for()
    assert page.locator(".verdict .number").first.inner_text() == shown
    assert slider.input_value() == "-7"
    assert page.get_by_label("Roof box").is_checked()
    assert page.get_by_label("From", exact=True).first.input_value() == "Westend"
    # another journey, and back
    choose(page, "To", "haupt", "Hauptstraße")
    page.get_by_role("button", name="Plan", exact=True).press("Enter")
    page.wait_for_function("() => decodeURIComponent(location.hash).includes('Hauptstraße')")
    page.go_back()
    page.get_by_text("Westend – Ostheim").first.wait_for()
    page.go_forward()
    page.get_by_text("Westend – Hauptstraße").first.wait_for()
    # without a link, the page opens on the last journey
    page.goto("about:blank")
    page.goto(planner.url)
    page.get_by_text("Westend – Hauptstraße").first.wait_for()
    assert slider.input_value() == "-7"


def test_a_phone_starts_with_from_and_to_and_needs_no_webgl(browser: Any, planner: Service) -> None:
    context = context_of(browser, "phone", "dark", "de-DE")
    context.set_default_timeout(60_000)
    context.add_init_script(
        "HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext, "
        "{apply: (get, of, args) => (args[0].startsWith('webgl') ? null : Reflect.apply(get, of, args))})"
    )
    page = context.new_page()
    page.goto(planner.url)
    page.get_by_text("Dieser Browser kann die Karte nicht zeichnen").wait_for()
    page.get_by_role("button", name="Ändern", exact=True).click()
    choose(page, "Von", "west", "Westend")
    choose(page, "Nach", "ost", "Ostheim")
    whole_answer(page, lambda: page.get_by_role("button", name="Planen", exact=True).click())
    page.locator(".journey-answer").get_by_text("bei 95 von 100 Fahrten").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]
    context.close()
