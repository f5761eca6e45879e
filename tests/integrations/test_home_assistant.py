"""The integration in the real Home Assistant, with the real service and a car whose drive is replayed beside it."""

from __future__ import annotations

import datetime as dt
import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.integrations.hass import COMPONENTS, HomeAssistant, environment, running
from tests.server.cars.messages import abrp_messages, measured
from tests.support.drives import example_trip
from tests.support.roads import osrm
from tests.support.router_server import answering, write_map
from tests.support.service_process import TOKEN, Service, free_port, serving, wait_for

from tripwatt.server.cars.discovery import SENSORS, discovery
from tripwatt.server.cars.folder import issue_token

HASS, WHY = environment()
pytestmark = pytest.mark.skipif(HASS is None, reason=WHY)

OTHER_TOKEN = "another-token-for-tests"
TOKENS = (TOKEN, OTHER_TOKEN)
EVERY_S = 5
UNKNOWN = ("unknown", "unavailable")
LINKS = [{"length_m": 12_000.0, "speed_m_s": 14.0}, {"length_m": 25_000.0, "speed_m_s": 27.0}]


class Served:
    """A service with cars, which may be ended and started again at the same address."""

    def __init__(self, folder: Path, *cars: str, **options: str) -> None:
        self.folder, self.port, self.token = folder, free_port(), TOKEN
        (folder / "logs").mkdir(parents=True)
        self.tokens = {car: issue_token(folder / "cars" / car) for car in cars}
        self.words = ["--workers", "1", "--port", str(self.port)]
        if cars:
            self.words += ["--cars", str(folder / "cars")]
        for name, value in options.items():
            self.words += [f"--{name}", value]
        self._running = ExitStack()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def form(self) -> dict[str, str]:
        """What a user enters to add the service."""
        return {"url": self.url, "token": self.token}

    def start(self, token: str = "") -> None:
        self.token = token or self.token
        self.service: Service = self._running.enter_context(
            serving(self.folder / "logs", *self.words, token=self.token)
        )
        self.service.client.headers["authorization"] = f"Bearer {self.token}"

    def stop(self) -> None:
        self._running.close()

    def get(self, path: str, **parameters: Any) -> Any:
        answer = self.service.client.get(path, params=parameters)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def plan(self, car: str, **changes: Any) -> None:
        fields = {"links": LINKS, "ambient_temperature_degc": 2.0, **changes}
        request = {name: value for name, value in fields.items() if value is not None}
        answer = self.service.client.put(f"/v1/live/{car}/plan", json=request)
        assert answer.status_code == 200, answer.text

    def send(self, car: str, *messages: dict[str, Any]) -> None:
        headers = {"authorization": f"Bearer {self.tokens[car]}"}
        for message in messages:
            answer = self.service.client.post("/v1/telemetry", json={"tlm": message}, headers=headers)
            assert answer.status_code == 200, answer.text

    def park(self, car: str, soc: float) -> None:
        """Let the car stand with this charge."""
        self.send(car, {"utc": time.time() - 60.0, "speed": 0.0, "soc": 100.0 * soc, "ext_temp": 2.0})


@contextmanager
def started(folder: Path, *cars: str, **options: str) -> Iterator[Served]:
    service = Served(folder / "served", *cars, **options)
    service.start()
    try:
        yield service
    finally:
        service.stop()


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HomeAssistant]:
    """One Home Assistant for all tests; at its end it stores no token of the services that were removed."""
    assert HASS is not None
    with running(HASS / "bin" / "python", tmp_path_factory.mktemp("hass") / "config") as hass:
        yield hass
        hass.stop()
        stored = {file.name: file.read_text() for file in (hass.folder / ".storage").iterdir()}
        assert [name for name, text in stored.items() if any(token in text for token in TOKENS)] == []


@pytest.fixture
def hass(program: HomeAssistant) -> Iterator[HomeAssistant]:
    """Home Assistant without a service; at the end nothing of the integration failed there or blocked its loop."""
    before = len(program.log())
    yield program
    for domain in ("tripwatt", "local_calendar"):
        for entry in program.entries(domain):
            program(f"/config/config_entries/entry/{entry['entry_id']}", method="DELETE")
    log = program.log()[before:]
    assert "Detected blocking call" not in log
    assert "custom_components/tripwatt" not in log  # no traceback through it
    errors = [line for line in log.splitlines() if "ERROR" in line and "tripwatt" in line]
    # a service that was ended or got another token, and answers to what a test asked
    expected = ("does not answer", "refused the token", "websocket_api")
    assert [line for line in errors if not any(words in line for words in expected)] == []


@pytest.fixture(scope="module")
def with_map(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A service with a car, and a map with one straight road from Westend, where home is, to Ostheim."""
    folder = tmp_path_factory.mktemp("with-map")
    with (
        answering(osrm(annotated=True)) as router,
        started(folder, "leaf", map=f"{write_map(folder / 'map')}@osrm={router.url}") as service,
    ):
        yield service


@pytest.fixture
def served(with_map: Served) -> Served:
    """The service with a car that has a plan and stands with 60 %."""
    with_map.plan("leaf", reserve=0.2)
    with_map.park("leaf", 0.6)
    return with_map


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A service with three cars and without a map."""
    with started(tmp_path_factory.mktemp("several"), "leaf", "zoe", "driven") as service:
        for car, soc in (("leaf", 0.6), ("zoe", 0.3)):
            service.plan(car, reserve=0.1)
            service.park(car, soc)
        yield service


def add(hass: HomeAssistant, served: Served, every_s: int = EVERY_S, **calendars: str) -> str:
    """Add a service that is asked every few seconds where it has no stream; returns the id of its entry."""
    step = hass.flow("tripwatt", served.form)
    assert step["type"] == "create_entry", step
    entry: str = step["result"]["entry_id"]
    options = {"interval_s": every_s, "probability": 90}
    assert hass.flow(entry, options, calendars, kind="options/flow")["type"] == "create_entry"
    assert wait_for(lambda: hass.entries()[0]["state"] == "loaded")
    return entry


def wait_until(read: Callable[[], Any], wanted: Any) -> None:
    """Wait until `read` returns `wanted`."""
    values: list[Any] = []

    def is_there() -> bool:
        values.append(read())
        return bool(values[-1] == wanted)

    assert wait_for(is_there, 12 * EVERY_S, every_s=0.5), f"{values[-1]} is not {wanted}"


def soc_of(hass: HomeAssistant, car: str = "leaf") -> Callable[[], str | None]:
    return lambda: hass.figures(car).get("soc")


def test_a_service_is_added_once_and_wrong_entries_are_refused_with_their_reason(
    hass: HomeAssistant, served: Served, tmp_path: Path
) -> None:
    form = hass.flow("tripwatt")
    assert (form["type"], form["step_id"], form["errors"]) == ("form", "user", {})
    fields = [(field["name"], field.get("required", False)) for field in form["data_schema"]]
    assert fields == [("url", True), ("token", False)]
    path = f"/config/config_entries/flow/{form['flow_id']}"

    def errors(url: str, **token: str) -> dict[str, str]:
        answer: dict[str, dict[str, str]] = hass(path, {"url": url, "token": served.token, **token})
        return answer["errors"]

    assert errors("somewhere") == {"url": "invalid_url"}
    assert errors(f"http://127.0.0.1:{free_port()}") == {"base": "cannot_connect"}
    assert errors(hass.url) == {"base": "no_service"}  # something else answers there
    assert errors(f"{served.url}/elsewhere") == {"base": "no_service"}
    with started(tmp_path) as without_cars:
        assert errors(without_cars.url) == {"base": "no_cars"}
    assert errors(served.url, token="a-wrong-token-of-some-length") == {"token": "invalid_auth"}
    assert hass.flow("tripwatt", {"url": served.url})["errors"] == {"token": "token_needed"}
    assert hass.entries() == []
    done = hass(path, {**served.form, "url": f" {served.url}/ "})
    assert (done["type"], done["title"]) == ("create_entry", f"127.0.0.1:{served.port}")
    (entry,) = hass.entries()
    supports = [entry[name] for name in ("state", "supports_options", "supports_reconfigure")]
    assert supports == ["loaded", True, True]
    again = hass.flow("tripwatt", served.form)
    assert (again["type"], again["reason"]) == ("abort", "already_configured")


def test_a_service_that_is_away_is_back_by_itself_and_a_refused_token_is_asked_for_again(
    hass: HomeAssistant, served: Served
) -> None:
    entry = add(hass, served)
    wait_until(soc_of(hass), "60.0")
    before = len(hass.log())
    served.stop()
    wait_until(lambda: set(hass.figures("leaf").values()), {"unavailable"})
    served.start()
    served.park("leaf", 0.55)
    wait_until(soc_of(hass), "55.0")
    assert [row["entry_id"] for row in hass.entries()] == [entry]
    assert hass.log()[before:].count("Error fetching tripwatt data") == 1  # once, not at every question
    old_token = served.token
    served.stop()
    served.start(OTHER_TOKEN)

    def asking() -> list[dict[str, Any]]:
        flows = hass.websocket("config_entries/flow/progress")
        return [flow for flow in flows if flow["context"]["source"] == "reauth"]

    assert wait_for(asking)
    (flow,) = asking()
    path = f"/config/config_entries/flow/{flow['flow_id']}"
    assert hass(path)["step_id"] == "reauth_confirm"
    assert hass(path, {"token": old_token})["errors"] == {"token": "invalid_auth"}
    done = hass(path, {"token": OTHER_TOKEN})
    assert (done["type"], done["reason"]) == ("abort", "reauth_successful")
    wait_until(soc_of(hass), "55.0")
    assert asking() == []


def test_every_figure_of_a_car_is_an_entity_and_new_cars_come_by_themselves(
    hass: HomeAssistant, served: Served
) -> None:
    entry = add(hass, served)
    keys = {sensor.key for sensor in SENSORS}
    assert set(hass.registered()) == {f"{entry}_leaf_{key}" for key in keys}
    assert {state["entity_id"].partition(".")[0] for state in hass.states("leaf").values()} == {"sensor"}
    figures = hass.figures("leaf")
    # a plan has no earlier trip, so every figure is known
    assert [key for key, value in figures.items() if value in UNKNOWN] == []
    need = served.get("/v1/need", car="leaf", probability=0.9)
    assert float(figures["soc_needed"]) == pytest.approx(100.0 * need["soc_needed"])
    assert float(figures["need"]) == pytest.approx(need["energy_quantile_wh"] / 1000.0)
    reach = served.get("/v1/range", car="leaf")
    assert float(figures["range"]) == pytest.approx(reach["range_m"] / 1000.0)
    cold = served.get("/v1/range", soc=0.6, ambient_temperature_degc=2.0)  # what the car sent
    assert reach["range_m"] == pytest.approx(cold["range_m"])
    about = {key: state["attributes"] for key, state in hass.states("leaf").items()}
    assert about["soc_needed"]["message"] == need["message"]
    assert (about["range"]["soc"], about["range"]["reserve"]) == (0.6, 0.1)
    for key, answer in (("range", reach), ("soc_needed", need)):
        messages = [flag["message"] for flag in answer["flags"]]
        assert about[key]["flags"] == messages
        assert "leaf has no description" in messages[0 if key == "soc_needed" else 1]
    made = served.service.client.post("/v1/cars", json={"name": "zoe", "car": "renault_zoe_ze50_r135"})
    assert made.status_code == 200, made.text
    served.tokens["zoe"] = served.service.client.post("/v1/cars/zoe/token", json={}).json()["token"]
    served.park("zoe", 0.5)
    wait_until(lambda: hass.figures("zoe").get("soc"), "50.0")
    assert set(hass.figures("zoe")) == keys
    own = served.get("/v1/range", soc=0.5, car="zoe")["range_m"] / 1000.0
    wait_until(lambda: round(float(hass.figures("zoe")["range"]), 6), round(own, 6))  # by its own model
    assert served.service.client.delete("/v1/cars/zoe").status_code == 200
    wait_until(lambda: set(hass.figures("zoe").values()), {"unavailable"})
    assert hass.removed(hass.devices()["leaf"]["id"], entry) is False  # the service has it
    assert hass.removed(hass.devices()["zoe"]["id"], entry) is True
    assert set(hass.devices()) == {"leaf"}


CLASSES = ("unit_of_measurement", "device_class", "state_class")


def test_the_entities_are_those_over_mqtt(hass: HomeAssistant, served: Served) -> None:
    """Keys, names, units and classes; a class `battery` is of the measured charge only, and a figure has statistics."""
    add(hass, served)
    shown = {
        key: (
            state["attributes"]["friendly_name"].removeprefix("leaf "),
            *map(state["attributes"].get, CLASSES),
        )
        for key, state in hass.states("leaf").items()
    }
    announced = dict(discovery("leaf", "tripwatt", "homeassistant"))
    over_mqtt = {
        topic.split("/")[-2]: (message["name"], *map(message.get, CLASSES))
        for topic, message in announced.items()
    }
    assert shown == over_mqtt
    assert [key for key, about in shown.items() if "battery" in about] == ["soc"]
    assert {key for key, about in shown.items() if about[-1] is None} == {"departs_at", "preheat_at"}


def test_the_recorder_compiles_statistics_of_all_figures(hass: HomeAssistant, served: Served) -> None:
    served.park("leaf", 0.61)
    add(hass, served)
    wait_until(soc_of(hass), "61.0")
    ids = {key: state["entity_id"] for key, state in hass.states("leaf").items()}
    figures = {ids[key]: float(text) for key, text in hass.figures("leaf").items() if not key.endswith("_at")}
    hass("/services/compile_statistics/now", {})
    kept = hass.websocket("recorder/list_statistic_ids", statistic_type="mean")
    assert {row["statistic_id"] for row in kept if row["statistic_id"] in ids.values()} == set(figures)
    since = (dt.datetime.now(dt.UTC) - dt.timedelta(minutes=10)).isoformat()
    asked = {"start_time": since, "statistic_ids": [*figures], "period": "5minute"}
    found = hass.websocket("recorder/statistics_during_period", **asked)
    assert set(found) == set(figures)
    last = {entity: rows[-1] for entity, rows in found.items()}
    for entity, value in figures.items():
        if entity != ids["silence"]:  # it grows
            least, mean, most = (last[entity][name] for name in ("min", "mean", "max"))
            assert least - 1e-9 <= value <= most + 1e-9
            assert least - 1e-9 <= mean <= most + 1e-9
    issues = hass.websocket("recorder/validate_statistics")
    assert [entity for entity in ids.values() if entity in issues] == []


def questions(served: Served) -> int:
    """How often the service was asked for the state of its cars."""
    return sum(row.get("path") == "/v1/live" for row in served.service.records())


def test_news_is_shown_at_once_and_nobody_asks_while_the_stream_is_open(
    hass: HomeAssistant, served: Served
) -> None:
    add(hass, served, every_s=600)
    asked, before = None, hass.states("leaf")["silence"]
    for soc in (0.5, 0.25, 0.75):
        served.park("leaf", soc)
        wait_until(soc_of(hass), str(100.0 * soc))
        asked = questions(served) if asked is None else asked
    assert questions(served) == asked
    assert hass.states("leaf")["silence"]["last_updated"] > before["last_updated"]
    served.plan("leaf", reserve=0.3)
    wait_until(lambda: hass.states("leaf")["soc_needed"]["attributes"]["reserve"], 0.3)
    assert questions(served) == asked


def test_a_service_whose_stream_is_refused_is_asked_until_it_is_open(
    hass: HomeAssistant, tmp_path: Path
) -> None:
    with started(tmp_path, "leaf", limit="listeners=1") as service:
        service.plan("leaf", reserve=0.1)
        service.park("leaf", 0.6)
        with service.service.client.stream("GET", "/v1/events") as taken:
            assert taken.status_code == 200
            add(hass, service)
            first = questions(service)
            service.park("leaf", 0.5)
            wait_until(soc_of(hass), "50.0")
            assert wait_for(lambda: questions(service) >= first + 2, 12 * EVERY_S)
        streams: list[int] = []

        def is_quiet() -> bool:
            streams.append(questions(service))
            time.sleep(2.5 * EVERY_S)
            return questions(service) == streams[-1]

        assert wait_for(is_quiet, 12 * EVERY_S)
        service.park("leaf", 0.4)
        wait_until(soc_of(hass), "40.0")
        assert questions(service) == streams[-1]
        (entry,) = hass.entries()
        hass(f"/config/config_entries/entry/{entry['entry_id']}", method="DELETE")


def settled(hass: HomeAssistant, several: Served) -> tuple[dict[str, str], dict[str, float]]:
    """Figures of the car `driven`, and those of its document once it is the same for two seconds."""
    before, now = None, several.get("/v1/live/driven")["forecast"]
    while before != now:
        time.sleep(2.0)
        before, now = now, several.get("/v1/live/driven")["forecast"]
    wanted = {
        "arrival": 100.0 * now["soc_quantiles"]["0.5"],
        "arrival_low": 100.0 * now["soc_quantiles"]["0.05"],
        "arrival_high": 100.0 * now["soc_quantiles"]["0.95"],
        "p_arrive": 100.0 * now["p_arrive"],
        "energy": now["energy_wh"] / 1000.0,
    }
    return hass.figures("driven"), wanted


def test_states_follow_a_car_that_drives(hass: HomeAssistant, several: Served) -> None:
    table = example_trip()
    begins = time.time() - float(table["time_s"].iloc[-1]) - 60.0
    departs_at = dt.datetime.fromtimestamp(begins, dt.UTC).isoformat()
    samples = {name: table[name].tolist() for name in ("time_s", "speed_m_s", "elevation_m")}
    several.plan("driven", links=None, samples=samples, soc=0.6, departs_at=departs_at, reserve=0.2)
    add(hass, several)
    messages = [*abrp_messages(measured(table), begins)]
    seen = []
    for part in (messages[:200], messages[200:400]):
        several.send("driven", *part)
        live = several.get("/v1/live/driven")
        assert live["trip"] is not None
        wait_until(soc_of(hass, "driven"), str(100.0 * live["soc"]))
        figures, wanted = settled(hass, several)
        assert {key: float(figures[key]) for key in wanted} == pytest.approx(wanted)
        assert figures["charge"] == figures["need"] == "unknown"  # of the next trip: not on a trip
        seen.append(wanted)
    early, late = seen
    assert early["arrival"] != late["arrival"]
    assert late["arrival_high"] - late["arrival_low"] < early["arrival_high"] - early["arrival_low"]


def test_entities_are_the_same_after_a_restart_without_the_service(
    hass: HomeAssistant, served: Served
) -> None:
    add(hass, served)
    before = {unique: row["entity_id"] for unique, row in hass.registered().items()}
    values = hass.figures("leaf")
    hass.stop()
    served.stop()
    hass.start()
    wait_until(lambda: hass.entries()[0]["state"], "setup_retry")
    assert {"plan", "advise"} <= set(services(hass))
    served.start()
    wait_until(soc_of(hass), values["soc"])
    assert hass.figures("leaf")["range"] == values["range"]
    assert {unique: row["entity_id"] for unique, row in hass.registered().items()} == before


def services(hass: HomeAssistant) -> dict[str, Any]:
    """The actions of the integration."""
    return next((row["services"] for row in hass("/services") if row["domain"] == "tripwatt"), {})


def test_cars_are_devices_with_figures_of_their_own(hass: HomeAssistant, several: Served) -> None:
    add(hass, several)
    devices = {name: device["id"] for name, device in hass.devices().items()}
    assert set(devices) == {"leaf", "zoe", "driven"}
    leaf, zoe = hass.figures("leaf"), hass.figures("zoe")
    assert (leaf["soc"], zoe["soc"]) == ("60.0", "30.0")
    assert float(zoe["range"]) < 0.7 * float(leaf["range"])
    several.park("zoe", 0.35)
    wait_until(soc_of(hass, "zoe"), "35.0")
    assert hass.figures("leaf")["soc"] == "60.0"

    def arrival(car: str, **conditions: float) -> float:
        data = {"device_id": devices[car], "links": LINKS, **conditions}
        return float(hass.action("tripwatt", "advise", **data)["soc_arrival"])

    warm = arrival("leaf", temperature=20)
    assert warm - arrival("zoe", temperature=20) == pytest.approx(0.25, abs=0.02)
    # without a temperature, that of the last message counts: 2 °C
    cold = arrival("leaf")
    request = {"links": LINKS, "soc": 0.6, "ambient_temperature_degc": 2.0}
    advice = several.service.client.post("/v1/advice", json=request).json()
    assert cold == pytest.approx(advice["soc_arrival"])
    assert cold < warm
    # it has no map
    plan = {"device_id": devices["leaf"], "stops": ["Ostheim"]}
    assert "start the service with --map" in refusal(hass, "plan", plan)


def refusal(hass: HomeAssistant, action: str, data: dict[str, Any]) -> str:
    """The message with which an action refuses its data."""
    words = {"domain": "tripwatt", "service": action, "service_data": data, "return_response": True}
    error: dict[str, str] = hass.asked("call_service", **words)["error"]
    assert error["code"] == "service_validation_error"
    return error["message"]


def calendar_of(hass: HomeAssistant) -> str:
    """A calendar of Home Assistant's own."""
    made = hass.flow("local_calendar", {"calendar_name": "Drives", "import": "create_empty"})
    assert made["type"] == "create_entry", made
    assert wait_for(lambda: any(row["entity_id"] == "calendar.drives" for row in hass("/states")))
    return "calendar.drives"


def test_the_next_trip_of_a_calendar_gives_the_need(hass: HomeAssistant, served: Served) -> None:
    calendar = calendar_of(hass)
    add(hass, served, leaf=calendar)
    tomorrow = dt.datetime.now(dt.UTC).replace(microsecond=0, second=0) + dt.timedelta(hours=20)

    def event(title: str, hours: float, **more: str) -> dt.datetime:
        starts = tomorrow + dt.timedelta(hours=hours)
        ends = starts + dt.timedelta(hours=1)
        given = {"start_date_time": starts.isoformat(), "end_date_time": ends.isoformat()}
        hass("/services/calendar/create_event", {"entity_id": calendar, "summary": title, **given, **more})
        return starts

    def departs() -> dt.datetime | None:
        value = hass.figures("leaf")["departs_at"]
        return None if value in UNKNOWN else dt.datetime.fromisoformat(value)

    def needed() -> float:
        return float(hass.figures("leaf")["soc_needed"]) / 100.0

    usual = event("Work", 3.0)
    wait_until(departs, usual)
    of_plan = served.get("/v1/need", car="leaf", probability=0.9, departs_at=usual.isoformat())
    assert needed() == pytest.approx(of_plan["soc_needed"])
    far = event("Grandparents, 80 km", 2.0)
    wait_until(departs, far)
    asked = {"car": "leaf", "distance_km": 80, "probability": 0.9, "departs_at": far.isoformat()}
    by_distance = served.get("/v1/need", **asked)
    attributes = hass.states("leaf")["soc_needed"]["attributes"]
    assert (attributes["message"], attributes["temperature"]) == (by_distance["message"], 2.0)
    assert needed() == pytest.approx(by_distance["soc_needed"])
    assert float(hass.figures("leaf")["charge"]) == pytest.approx(by_distance["charge_wh"] / 1000.0)
    place = event("Concert", 1.0, location="Ostheim")
    wait_until(departs, place)
    home = {"latitude_deg": 47.0, "longitude_deg": 9.0}
    body = {"stops": [home, "Ostheim"], "soc": 0.6, "departs_at": place.isoformat()}
    body["ambient_temperature_degc"] = 2.0
    journey = served.service.client.post("/v1/journeys", json=body).json()
    assert needed() == pytest.approx(journey["soc_needed"])
    assert hass.states("leaf")["soc_needed"]["attributes"]["trip"] == "Concert"
    nowhere = event("Nowhere", 0.5, location="a place that no map has")
    wait_until(departs, nowhere)
    assert needed() == pytest.approx(of_plan["soc_needed"])
    (entity,) = [row["entity_id"] for row in hass("/calendars") if row["entity_id"] != calendar]
    window = {"start": tomorrow.isoformat(), "end": (tomorrow + dt.timedelta(hours=5)).isoformat()}
    shown = [row["summary"] for row in hass(f"/calendars/{entity}", params=window)]
    needs = [of_plan, journey, by_distance, of_plan]
    titles = ["Nowhere", "Concert", "Grandparents, 80 km", "Work"]
    assert shown == [
        f"{title} ({100.0 * need['soc_needed']:.0f} %)" for title, need in zip(titles, needs, strict=True)
    ]
    assert hass(f"/states/{entity}")["attributes"]["message"] == shown[0]


def test_a_weather_entity_gives_the_temperature_of_calendar_trips_and_of_the_need(
    hass: HomeAssistant, served: Served
) -> None:
    served.plan("leaf", ambient_temperature_degc=None)
    calendar = calendar_of(hass)
    leaves = dt.datetime.now(dt.UTC).replace(microsecond=0) + dt.timedelta(hours=22)
    entry = add(hass, served, leaf=calendar)

    def temperature() -> Any:
        return hass.states("leaf")["soc_needed"]["attributes"].get("temperature")

    wait_until(temperature, 2.0)  # of the last message
    first = {"interval_s": EVERY_S, "probability": 90, "weather": "weather.frost"}
    hass.flow(entry, first, {"leaf": calendar}, kind="options/flow")
    wait_until(temperature, -4.0)  # now
    event = {"summary": "Grandparents, 80 km", "start_date_time": leaves.isoformat()}
    event["end_date_time"] = (leaves + dt.timedelta(hours=1)).isoformat()
    hass("/services/calendar/create_event", {"entity_id": calendar, **event})
    wait_until(temperature, -9.0)  # the forecast at departure
    asked = {"distance_km": 80, "probability": 0.9, "ambient_temperature_degc": -9.0}
    need = served.get("/v1/need", car="leaf", departs_at=leaves.isoformat(), **asked)
    assert float(hass.figures("leaf")["soc_needed"]) == pytest.approx(100.0 * need["soc_needed"])
    assert "last message" not in "".join(hass.states("leaf")["soc_needed"]["attributes"]["flags"])


def test_plan_and_advise_respond_with_the_answers_of_the_service(hass: HomeAssistant, served: Served) -> None:
    add(hass, served)
    device = hass.devices()["leaf"]["id"]
    west, east = ({"latitude_deg": 47.0, "longitude_deg": longitude} for longitude in (9.0, 9.1))
    asked: dict[str, Any] = {"stops": [west, east], "soc": 0.6, "reserve": 0.15}
    asked["ambient_temperature_degc"] = -5.0
    plan = served.service.client.post("/v1/journeys", json=asked).json()
    told = hass.action("tripwatt", "plan", device_id=device, stops=["Ostheim"], reserve=15, temperature=-5)
    figures = ("p_arrive", "p_reserve", "soc_arrival", "driving_s", "energy_wh")
    assert [told["verdict"][name] for name in figures] == pytest.approx(
        [plan["verdict"][name] for name in figures]
    )
    assert (told["leave"], told["soc_needed"]) == (plan["leave"], pytest.approx(plan["soc_needed"]))
    assert "roads" not in told
    names = [stop["name"] for stop in told["stops"]]
    assert names == ["Home", "Ostheim"]
    home = hass.action("tripwatt", "plan", device_id=device, stops=["zone.home", "Ostheim"], soc=30)
    assert [stop["name"] for stop in home["stops"]] == ["Home", "Ostheim"]
    assert home["verdict"]["soc_arrival"] < told["verdict"]["soc_arrival"] - 0.2
    there = served.service.client.post(
        "/v1/journeys/advice", json={**asked, "soc": 0.2, "probability": 0.9}
    ).json()
    advice = hass.action(
        "tripwatt",
        "advise",
        device_id=device,
        stops=[west, east],
        soc=20,
        reserve=15,
        temperature=-5,
        probability=90,
    )
    assert advice["charge_to"] == pytest.approx(there["charge_to"])
    codes = [[row["code"] for row in each["actions"]] for each in there["least"]]
    assert [[row["code"] for row in each["actions"]] for each in advice["least"]] == codes
    without_map = {"links": LINKS, "soc": 0.6, "ambient_temperature_degc": 5.0}
    road = served.service.client.post("/v1/advice", json=without_map).json()
    by_links = hass.action("tripwatt", "advise", device_id=device, links=LINKS, temperature=5)
    assert by_links["soc_arrival"] == pytest.approx(road["soc_arrival"])
    hass("/services/tripwatt/set_plan", {"device_id": device, "stops": ["Ostheim"], "destination": "Work"})
    planned = served.get("/v1/live/leaf")
    assert (planned["plan"], planned["destination"]) == ("given", "Work")
    assert planned["forecast"]["distance_m"] > 1000.0
    # what cannot be answered is refused in words, not with a traceback
    assert "place" in refusal(hass, "plan", {"device_id": device, "stops": ["a place that no map has"]})
    assert "no car of tripwatt" in refusal(hass, "advise", {"device_id": "no such device", "links": LINKS})
    assert set(services(hass)) == {"plan", "advise", "set_plan"}


def test_a_service_that_is_removed_leaves_nothing(hass: HomeAssistant, served: Served) -> None:
    entry = add(hass, served)
    assert hass.registered()
    hass(f"/config/config_entries/entry/{entry}", method="DELETE")
    assert (hass.entries(), hass.registered(), hass.devices(), services(hass)) == ([], {}, {}, {})
    assert [row["entity_id"] for row in hass("/states") if "leaf" in row["entity_id"]] == []
    asked = len(served.service.records())
    time.sleep(1.5 * EVERY_S)
    assert len(served.service.records()) == asked  # nobody asks any more
    # it may be added again, with the same names
    add(hass, served)
    assert hass.states("leaf")["soc"]["entity_id"] == "sensor.leaf_charge"


def test_a_service_that_moved_is_found_at_its_new_address(
    hass: HomeAssistant, served: Served, several: Served
) -> None:
    entry = add(hass, served)
    form = hass("/config/config_entries/flow", {"handler": "tripwatt", "entry_id": entry})
    assert form["step_id"] == "reconfigure"
    path = f"/config/config_entries/flow/{form['flow_id']}"
    gone = hass(path, {**served.form, "url": f"http://127.0.0.1:{free_port()}"})
    assert gone["errors"] == {"base": "cannot_connect"}
    assert hass(path, several.form)["reason"] == "reconfigure_successful"
    several.park("zoe", 0.35)
    wait_until(soc_of(hass, "zoe"), "35.0")
    assert [row["entry_id"] for row in hass.entries()] == [entry]
    assert hass.flow("tripwatt", several.form)["reason"] == "already_configured"


def test_diagnostics_have_no_token_no_address_and_no_times_of_departure(
    hass: HomeAssistant, served: Served
) -> None:
    entry = add(hass, served)
    text = json.dumps(hass(f"/diagnostics/config_entry/{entry}"))
    assert json.loads(text)["data"]["cars"]["leaf"]["live"]["soc"] == 0.6
    for secret in (*TOKENS, served.url, hass.figures("leaf")["departs_at"][:16]):
        assert secret not in text


def test_the_folder_is_the_one_that_home_assistant_loads(hass: HomeAssistant) -> None:
    manifest = hass.websocket("manifest/get", integration="tripwatt")
    own = json.loads((COMPONENTS / "tripwatt" / "manifest.json").read_text())
    assert {name: manifest[name] for name in own} == own
    assert manifest["is_built_in"] is False
