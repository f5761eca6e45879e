"""Cars on the road through the service: its forecasts are those of `update`, and every refusal is a problem document."""

from __future__ import annotations

import asyncio
import dataclasses
import datetime as dt
import json
import sqlite3
import time
import urllib.parse
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import anyio
import httpx
import numpy as np
import orjson
import pandas as pd
import pytest
from starlette.requests import ClientDisconnect
from tests.server.cars.messages import NOON, NOON_S, abrp_messages, measured
from tests.support.drives import example_trip
from tests.support.service_process import TOKEN, Service, serving, wait_for
from tests.support.service_schema import conformance

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.roads.advice.preheating import CHARGER, PLUG_W, preheating
from tripwatt.routes import links_of_trip
from tripwatt.server.cars import car as car_module
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import Database
from tripwatt.server.cars.folder import create_car, issue_token, setting_of
from tripwatt.server.cars.following import Broker, MqttSettings
from tripwatt.server.cars.live_trip import SILENCE_S
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp
from tripwatt.server.cars.topics import TopicJoiner
from tripwatt.server.http import live as module
from tripwatt.server.http import service as room
from tripwatt.server.http.ahead import Ahead
from tripwatt.server.http.app import create_app
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.pool import JobResult
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Limits, Settings
from tripwatt.server.http.sharing import CLIENT, Places
from tripwatt.server.http.worker import run_job
from tripwatt.trips import Plan
from tripwatt.trips.messages import leave_in_words

JSON, FORM = "application/json", "application/x-www-form-urlencoded"
LINKS = [
    {"length_m": 4000.0, "speed_m_s": 12.0, "grade": 0.0},
    {"length_m": 9000.0, "speed_m_s": 20.0, "grade": 0.0},
]


@pytest.fixture(scope="module")
def jobs() -> Jobs:
    return Jobs.from_folders({}, Limits())


@pytest.fixture(scope="module")
def drive() -> pd.DataFrame:
    return measured(example_trip()).iloc[:400]


@pytest.fixture(scope="module")
def plan() -> dict[str, Any]:
    """The whole trip as a speed trace, with what is known at its departure."""
    table = example_trip()
    samples = {name: table[name].tolist() for name in ("time_s", "speed_m_s", "elevation_m")}
    return {
        "samples": samples,
        "soc": 0.9,
        "ambient_temperature_degc": 4.0,
        "cabin_temperature_degc": 10.0,
        "battery_temperature_degc": 12.0,
        "cabin_setpoint_degc": 21.0,
        "reserve": 0.3,
        "departs_at": NOON,
    }


def own_forecast(plan: dict[str, Any]) -> Forecast:
    """The forecast of a plan at its departure, by the library."""
    left_out = ("samples", "reserve", "departs_at")
    departure = tw.Departure(**{name: value for name, value in plan.items() if name not in left_out})
    return tw.forecast(Plan.from_samples(pd.DataFrame(plan["samples"]), departure=departure))


class Pool:
    """Runs the jobs in this process."""

    waiting, ready, lost = 0, 1, 0
    jobs: Jobs
    kinds: list[str]

    def __init__(self, settings: Settings, log_event: Callable[..., None]) -> None:
        self.settings = settings
        self.places = Places(settings.limits.waiting, "too many requests wait", {})

    async def run(self, job: dict[str, Any], body: bytes, *, may_queue: bool = False) -> JobResult:
        self.kinds.append(job["kind"])
        return JobResult(*run_job(self.jobs, job, body), 0.0)


class Served:
    """An application with two cars, and its client."""

    def __init__(self, folder: Path, **more: Any) -> None:
        self.tokens = {name: issue_token(folder / name) for name in ("leaf", "zoe")}
        self.logged: list[dict[str, Any]] = []
        settings = Settings(cars=folder, **more)
        self.app = create_app(settings, lambda **record: self.logged.append(record))

    def __call__(self, path: str, method: str = "GET", **more: Any) -> httpx.Response:
        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(self.app)  # type: ignore[arg-type]
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
                return await client.request(method, path, **more)

        return asyncio.run(ask())

    def send(self, message: Any, car: str = "leaf", **more: Any) -> httpx.Response:
        return self("/v1/telemetry", "POST", json={"token": self.tokens[car], "tlm": message}, **more)

    def put(self, plan: Any, car: str = "leaf") -> httpx.Response:
        return self(f"/v1/live/{car}/plan", "PUT", json=plan)


@pytest.fixture
def served(tmp_path: Path, jobs: Jobs, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    with_cars = dataclasses.replace(jobs, cars=CarJobs(tmp_path))
    monkeypatch.setattr(Pool, "jobs", with_cars, raising=False)
    monkeypatch.setattr(Pool, "kinds", [], raising=False)
    monkeypatch.setattr(room, "WorkerPool", Pool)
    found = Served(tmp_path)
    yield found
    _cars(found).close()


def _cars(served: Served) -> LiveCars:
    """The cars of an application."""
    packed: Any = served.app.app
    cars: LiveCars = packed.app.state.service.live
    return cars


def message(k: float, **more: Any) -> dict[str, Any]:
    return {"utc": NOON_S + k, "speed": 36.0, "power": 6.0, "soc": 80.0, **more}


def test_the_forecast_on_the_way_is_that_of_update(
    served: Served, drive: pd.DataFrame, plan: dict[str, Any]
) -> None:
    assert served.put(plan).status_code == 200
    own = own_forecast(plan)
    found = served("/v1/live/leaf").json()
    assert (found["trip"], found["seconds_since_message"], found["plan"]) == (None, None, "given")
    assert found["forecast"]["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    for sent in abrp_messages(drive):
        assert served.send(sent).json()["arrival"] == "new"
    found = served("/v1/live/leaf").json()
    updated = own.update(drive)
    assert found["forecast"]["energy_wh"] == pytest.approx(updated.energy_wh, abs=1e-6)
    assert found["forecast"]["quantiles_wh"] == {
        f"{p:g}": pytest.approx(updated.quantile(p), abs=1e-6) for p in (0.05, 0.5, 0.95)
    }
    assert found["forecast"]["soc_quantiles"] == {
        f"{p:g}": pytest.approx(updated.arrival.quantile(p), abs=1e-9) for p in (0.05, 0.5, 0.95)
    }
    assert found["forecast"]["p_arrive"] == pytest.approx(updated.p_arrive(0.3), abs=1e-9)
    assert (found["forecast"]["reserve"], found["forecast"]["measured_until_s"]) == (0.3, 399.0)
    assert found["messages"] == {"new": 400, "doubled": 0, "late": 0, "faulty": 0}
    assert found["faults"] == []
    trip = found["trip"]
    assert dt.datetime.fromisoformat(trip["departs_at"]).timestamp() == NOON_S
    assert (trip["duration_s"], trip["samples"]) == (found["forecast"]["measured_until_s"], 400)
    power_w, speed_m_s = drive["voltage_v"] * drive["current_a"], drive["speed_m_s"]
    assert trip["distance_m"] == pytest.approx(np.trapezoid(speed_m_s, drive["time_s"]))
    assert trip["energy_wh"] == pytest.approx(np.trapezoid(power_w, drive["time_s"]) / 3600.0)
    assert served("/v1/live/zoe").json()["forecast"] is None


def test_the_course_is_the_plan_of_the_departure_beside_the_forecast_now(
    served: Served, drive: pd.DataFrame, plan: dict[str, Any]
) -> None:
    served.put(plan | {"destination": "Work"})
    before = served("/v1/live/leaf").json()
    assert before["forecast"]["course"]["planned"] == before["forecast"]["course"]["expected"]
    for sent in abrp_messages(drive):
        served.send(sent)
    found = served("/v1/live/leaf").json()
    course, forecast = found["forecast"]["course"], found["forecast"]
    assert course["planned"] == before["forecast"]["course"]["planned"]
    assert course["expected"] != course["planned"]
    ends = [course[name][-1] for name in ("low", "expected", "high")]
    assert ends == sorted(ends)
    assert course["expected"][-1] == pytest.approx(forecast["soc_arrival"], abs=1e-6)
    assert (course["distance_m"][0], course["distance_m"][-1]) == (0.0, pytest.approx(forecast["distance_m"]))
    assert forecast["duration_s"] > forecast["measured_until_s"] > 0.0
    assert found["destination"] == "Work"
    assert need(served).status_code == 200, "what only a plan has is no part of a forecast"


def test_without_a_plan_energy_and_power_are_those_of_the_messages(served: Served) -> None:
    for k in range(61):
        served.send(message(10.0 * k, soc=None))
    found = served("/v1/live/leaf").json()
    assert found["forecast"] is None
    trip = found["trip"]
    assert trip["power_w"] == pytest.approx(6000.0)
    assert trip["energy_wh"] == pytest.approx(6000.0 * trip["duration_s"] / 3600.0)
    for k in range(3):
        served.send({"utc": NOON_S + k, "speed": 36.0}, "zoe")
    silent = served("/v1/live/zoe").json()["trip"]
    assert silent is None or (silent["energy_wh"], silent["power_w"]) == (None, None)


@pytest.mark.parametrize("stuck", [90.0, 0.0])
def test_a_charge_that_the_energy_contradicts_is_not_shown(served: Served, stuck: float) -> None:
    links = [{"length_m": 1000.0, "speed_m_s": 25.0, "grade": 0.0}] * 80
    served.put({"links": links, "soc": 0.9, "ambient_temperature_degc": 20.0})
    for second in range(0, 2400, 10):
        served.send(message(float(second), speed=90.0, power=12.5, soc=stuck))
    found = served("/v1/live/leaf").json()
    assert "charge_contradicted" in [flag["code"] for flag in found["forecast"]["flags"]]
    taken = found["trip"]["energy_wh"] / own_wh_per_display()
    assert found["soc"] == pytest.approx(0.9 - taken, abs=0.03)


@pytest.mark.parametrize("stuck", [90.0, 0.0, None])
def test_without_a_plan_a_charge_that_the_energy_contradicts_is_not_shown(
    tmp_path: Path, stuck: float | None
) -> None:
    create_car(tmp_path / "i3", "bmw_i3_60ah")
    with Car.follow(tmp_path / "i3") as car:
        per_display = own_wh_per_display()
        for second in range(0, 2400, 10):
            right = 90.0 - 12_500.0 * second / 36.0 / per_display
            sent = message(float(second), speed=90.0, power=12.5, soc=right if stuck is None else stuck)
            car.record(sample_from_abrp(sent))
        assert car.updated is None
        assert car.shown_soc() == (pytest.approx(right / 100.0) if stuck is None else None)


def own_wh_per_display() -> float:
    return tw.forecast(LINKS, tw.Departure(soc=0.9)).charge.wh_per_display


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Forecasts of cars as they are made: at their departure, and updates."""
    found: list[str] = []
    forecast, update = ForecastModel.forecast, car_module.updated
    monkeypatch.setattr(ForecastModel, "forecast", lambda *a: (found.append("forecast"), forecast(*a))[1])
    monkeypatch.setattr(car_module, "updated", lambda *a: (found.append("update"), update(*a))[1])
    return found


def need(served: Served, **asked: Any) -> httpx.Response:
    return served("/v1/need", params={"car": "leaf", **asked})


def test_the_need_of_a_plan_is_a_quantile_and_the_charge_to_leave_with(served: Served) -> None:
    served.send(message(0.0, speed=0, soc=30.0))
    served.put({"links": LINKS, "soc": 0.8, "ambient_temperature_degc": -5.0, "reserve": 0.25})
    own = tw.forecast(LINKS, tw.Departure(soc=0.8, ambient_temperature_degc=-5.0))
    found = need(served, probability=0.95, departs_at=NOON, plug_w=3700.0).json()
    until = {name: found.pop(name) for name in ("wall_wh", "charging_s", "preheat")}
    ends = [*found.pop("half_wh"), *found.pop("interval_wh")]
    assert ends == pytest.approx([own.quantile(level) for level in (0.25, 0.75, 0.05, 0.95)], abs=1e-6)
    doubt = found.pop("doubt")
    assert sum(doubt[name] for name in ("car", "road", "weather", "day")) == pytest.approx(1.0)
    codes = [flag["code"] for flag in found.pop("flags")]
    assert codes == ["no_description", *(flag.code for flag in own.flags), "class_charging_curve"]
    assert found.pop("charging_w") == 3700.0
    assert until["wall_wh"] == pytest.approx(found["charge_wh"] / CHARGER)
    assert until["charging_s"] == pytest.approx(until["wall_wh"] / 3700.0 * 3600.0)
    heat = preheating(own.vehicle, own.plan, plug_w=3700.0)
    assert heat is not None
    leaves = dt.datetime.fromtimestamp(NOON_S, dt.UTC)
    assert until["preheat"] == heat.to_dict(leaves)
    assert found == {
        "car": "leaf",
        "title": "BMW i3 60 Ah",
        "kind": "trip",
        "usual_trip": None,
        "probability": 0.95,
        "reserve": 0.25,
        "distance_m": pytest.approx(own.plan.distance_m),
        "duration_s": pytest.approx(own.plan.duration_s),
        "energy_wh": pytest.approx(own.quantile(0.5), abs=1e-6),
        "energy_quantile_wh": pytest.approx(own.quantile(0.95), abs=1e-6),
        "soc_needed": pytest.approx(soc_needed(own, 0.25, 0.95), abs=1e-9),
        "message": leave_in_words(soc_needed(own, 0.25, 0.95), 0.25, 0.95),
        "target_soc": pytest.approx(soc_needed(own, 0.25, 0.95), abs=1e-9),
        "departs_at": leaves.isoformat(),
        "soc": 0.3,
        "charge_wh": pytest.approx((soc_needed(own, 0.25, 0.95) - 0.3) * own.charge.wh_per_display, abs=1e-3),
    }
    assert found["charge_wh"] > 0.0
    warm = need(served, reserve=0.0, ambient_temperature_degc=20.0).json()
    own = tw.forecast(LINKS, tw.Departure(soc=0.8, ambient_temperature_degc=20.0))
    assert (warm["probability"], warm["reserve"]) == (0.95, 0.0)
    assert warm["energy_quantile_wh"] == pytest.approx(own.quantile(0.95), abs=1e-6)
    assert warm["soc_needed"] == pytest.approx(soc_needed(own, 0.0, 0.95), abs=1e-9)
    served.send(message(1.0, speed=0, soc=99.0))
    assert need(served).json()["charge_wh"] == 0.0


def codes_of(document: dict[str, Any]) -> dict[str, Any]:
    return {flag["code"]: flag["value"] for flag in document["flags"]}


@pytest.mark.parametrize("path", ["/v1/range", "/v1/need"])
def test_what_is_asked_of_a_car_takes_the_temperature_and_the_charge_of_its_last_message(
    served: Served, path: str
) -> None:
    asked = {"distance_km": 50} if path == "/v1/need" else {}
    served.send(message(0.0, speed=0, soc=40.0, ext_temp=-3.0))
    served.send(message(1.0, speed=0, soc=40.0))  # without a temperature: the last one counts
    found = served(path, params={"car": "leaf", **asked}).json()
    given = served(path, params={**asked, "soc": 0.4, "ambient_temperature_degc": -3.0}).json()
    codes = codes_of(found)
    assert (codes.pop("of_last_message"), codes.pop("no_description")) == (-3.0, "leaf")
    assert codes == codes_of(given)
    assert {**found, "flags": [], "car": ""} == {**given, "flags": [], "car": ""}
    assert found["soc"] == 0.4
    warm = served(path, params={"car": "leaf", "ambient_temperature_degc": 20.0, **asked}).json()
    assert "of_last_message" not in codes_of(warm)
    name = "energy_wh" if asked else "range_m"
    assert warm[name] != found[name]


def test_a_car_without_a_description_is_flagged_until_it_has_one(served: Served, tmp_path: Path) -> None:
    served.send(message(0.0, speed=0, soc=40.0))
    (flag,) = served("/v1/live/leaf").json()["flags"]
    assert flag["message"] == (
        "leaf has no description: BMW i3 60 Ah is assumed; describe it with `tripwatt car new cars/leaf --car NAME`"
    )
    assert flag["code"] in codes_of(served("/v1/range", params={"car": "leaf"}).json())
    made = create_car(tmp_path / "leaf", "hyundai_ioniq_5_lr_rwd")  # the folder has `live` and a token
    assert made.vehicle.name == "hyundai_ioniq_5_lr_rwd"
    assert setting_of(made.folder, "token")
    assert served("/v1/live/leaf").json()["flags"] == []
    assert flag["code"] not in codes_of(served("/v1/range", params={"car": "leaf"}).json())
    shown = served("/v1/forecast", "POST", json={"links": LINKS, "car": "leaf"}).json()
    assert shown["series"]["displayed_soc"][0] == pytest.approx(0.4), "the charge of its last message"
    served.put({"links": LINKS, "car": "vw_id3"}, "zoe")
    assert served("/v1/live/zoe").json()["flags"] == []  # its plan names a car


def test_the_need_without_a_plan_is_that_of_the_usual_trip(served: Served, drive: pd.DataFrame) -> None:
    car = _cars(served).by_name("leaf")
    for sent in abrp_messages(drive):
        served.send(sent)
    assert car.received_s is not None
    car.end_when_silent(car.received_s + SILENCE_S)
    (log,) = car.logs()
    found = need(served, departs_at="2023-11-15T22:43:20Z").json()
    air = tw.Departure(ambient_temperature_degc=car.last_air_degc(car.now_s()))
    assert air.ambient_temperature_degc == pytest.approx(drive["ambient_temperature_degc"].iloc[-1])
    own = tw.load_model().forecast(links_of_trip(log).plan(), air)
    shown = float(drive["displayed_soc"].iloc[-1])
    assert (found["kind"], found["usual_trip"], found["soc"]) == ("trip", log.trip_id, pytest.approx(shown))
    assert found["energy_quantile_wh"] == pytest.approx(own.quantile(0.95), abs=1e-6)
    assert found["charge_wh"] == 0.0
    for departs_at in ("2023-11-16T04:13:20Z", "2023-11-13T22:13:20Z"):
        assert need(served, departs_at=departs_at).status_code == 404


def test_the_signals_of_a_speed_trace_count_before_those_of_messages(
    served: Served, plan: dict[str, Any]
) -> None:
    served.send(message(0.0, speed=0, ext_temp=30.0))
    samples = plan["samples"] | {"ambient_temperature_degc": [-5.0] * len(plan["samples"]["time_s"])}
    samples["time_s"] = [value + 100.0 for value in samples["time_s"]]
    served.put({"samples": samples, "soc": 0.9})
    cold = served("/v1/live/leaf").json()["forecast"]["energy_wh"]
    served.put({"samples": samples, "soc": 0.9, "ambient_temperature_degc": 30.0})
    assert abs(served("/v1/live/leaf").json()["forecast"]["energy_wh"] - cold) > 100.0


def test_messages_that_cannot_be_of_this_trip_leave_the_forecast_before_them(
    served: Served, drive: pd.DataFrame, plan: dict[str, Any]
) -> None:
    served.put(plan)
    messages = list(abrp_messages(drive))
    for sent in messages[:200]:
        served.send(sent)
    before = served("/v1/live/leaf").json()
    served.send(messages[200] | {"soc": 20.0})
    served.send(messages[201] | {"soc": 90.0})
    after = served("/v1/live/leaf").json()
    assert after["forecast"] == before["forecast"]
    assert [fault["what"] for fault in after["faults"]] == ["charge rises"]
    assert before["faults"] == []
    served.put(plan | {"reserve": 0.2})
    other = served("/v1/live/leaf").json()
    assert (other["forecast"]["reserve"], other["forecast"]["measured_until_s"]) == (0.2, 0.0)
    assert other["faults"] == after["faults"], "the forecast before was of another plan"


def test_a_message_may_have_any_form_that_senders_use(served: Served) -> None:
    token, tlm = served.tokens["leaf"], message(0.0)
    bearer = {"Authorization": f"Bearer {token}"}
    sent: list[dict[str, Any]] = [
        {"json": {"token": token, "tlm": message(0.0)}},
        {"json": {"token": token, "tlm": json.dumps(message(1.0))}},
        {"json": {"tlm": message(2.0)}, "headers": bearer},
        {"json": message(3.0), "headers": bearer},
        {"json": message(4.0), "params": {"token": token}},
        {"data": {"token": token, "tlm": json.dumps(message(5.0))}},
        {"data": {"tlm": json.dumps(message(6.0))}, "headers": bearer},
        {"method": "GET", "params": {"token": token, "tlm": json.dumps(message(7.0))}},
        {"method": "GET", "params": {"tlm": json.dumps(message(8.0))}, "headers": bearer},
    ]
    for more in sent:
        found = served("/v1/telemetry", more.pop("method", "POST"), **more)
        assert (found.status_code, found.json()) == (
            200,
            {"status": "ok", "car": "leaf", "arrival": "new", "ignored": []},
        )
    assert served.send(tlm).json()["arrival"] == "doubled"
    assert served("/v1/live/leaf").json()["messages"] == {"new": 9, "doubled": 1, "late": 0, "faulty": 0}


def test_a_message_without_a_time_is_of_now_and_a_wrong_value_is_counted(served: Served) -> None:
    before_s = time.time()
    bearer = {"Authorization": f"Bearer {served.tokens['leaf']}"}
    found = served("/v1/telemetry", "POST", json={"speed": 36, "soc": 900}, headers=bearer)
    assert (found.status_code, found.json()["arrival"]) == (200, "new")
    assert [(fault["where"], fault["pointer"]) for fault in found.json()["ignored"]] == [("soc", "/soc")]
    by_url = served("/v1/telemetry", params={"tlm": '{"soc": 900}', "token": served.tokens["zoe"]}).json()
    assert [fault["parameter"] for fault in by_url["ignored"]] == ["tlm"]
    car = _cars(served).by_name("leaf")
    assert car.received_s is not None
    assert car.received_s >= before_s
    shown = served("/v1/live/leaf").json()
    assert (shown["messages"]["new"], shown["messages"]["faulty"], shown["soc"]) == (1, 1, None)


def test_a_message_needs_the_token_of_a_car(served: Served) -> None:
    for token in ("", "x" * 32, "ä", 7, None):
        found = served("/v1/telemetry", "POST", json={"token": token, "tlm": message(0.0)})
        assert (found.status_code, found.json()["type"]) == (401, "/problems/token-needed")
        assert found.headers["www-authenticate"].startswith("Bearer")
    assert served("/v1/live/leaf").json()["messages"]["new"] == 0


def test_a_body_that_is_no_message_is_a_problem(served: Served) -> None:
    for body, kind, status, problem in (
        (b"{", JSON, 400, "not-json"),
        (b"[]", JSON, 422, "invalid-input"),
        (b"&".join(b"a=1" for _ in range(21)), FORM, 422, "invalid-input"),
        (b"\xff", FORM, 422, "invalid-input"),
        (b"x" * 65_537, JSON, 413, "too-large"),
        (b"utc=1", "text/plain", 415, "media-type"),
    ):
        found = served("/v1/telemetry", "POST", content=body, headers={"Content-Type": kind})
        assert (found.status_code, found.json()["type"]) == (status, f"/problems/{problem}")


def test_a_message_that_does_not_count_is_answered_as_such(served: Served) -> None:
    car = _cars(served).by_name("leaf")
    for k in range(100):
        car.record(Sample(NOON_S + k, {"speed_m_s": 10.0}), now_s=car.now_s() - 1000.0 + k)
    held = served.send(message(86_400.0))
    assert (held.status_code, held.json()["status"], held.json()["arrival"]) == (200, "held", "held")
    assert served("/v1/live/leaf").json()["held"] == 1
    assert served.send(message(99.0)).json()["arrival"] == "doubled"
    car._sender.offset_s = None
    late = served.send(message(1.5))
    (fault,) = late.json()["faults"]
    assert (late.status_code, fault["what"], fault["pointer"]) == (422, "message too late", "/tlm/utc")
    assert served("/v1/live/leaf").json()["messages"]["late"] == 1


def test_a_plan_is_a_forecast_request(served: Served) -> None:
    for plan, where in (
        ({}, ["samples, links"]),
        ([], ["body"]),
        ({"links": LINKS, "colour": 1}, ["colour"]),
        ({"links": LINKS, "observed": {"time_s": [0, 1]}}, ["observed"]),
        ({"links": LINKS, "departs_at": "now"}, ["departs_at"]),
        ({"links": LINKS, "departs_at": True}, ["departs_at"]),
        ({"links": LINKS, "departs_at": 5.0}, ["departs_at"]),
    ):
        found = served.put(plan)
        assert found.status_code == 422, found.text
        assert [fault["where"] for fault in found.json()["faults"]] == where
        assert found.headers["content-type"] == "application/problem+json"
        assert found.json()["instance"] == found.headers["x-request-id"]
        assert served("/v1/live/leaf").json()["plan"] is None
    assert served.put({"links": LINKS, "departs_at": None}).status_code == 200
    assert served("/v1/live/leaf").json()["plan"] == "given"


def test_the_token_of_the_service_is_for_readers_and_that_of_a_car_for_its_messages(
    tmp_path: Path, served: Served
) -> None:
    guarded = Served(tmp_path / "guarded", token=TOKEN)
    assert guarded("/v1/live/leaf").status_code == 401
    assert guarded("/v1/live/leaf", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200
    car = {"Authorization": f"Bearer {guarded.tokens['leaf']}"}
    assert guarded("/v1/live/leaf", headers=car).status_code == 401
    assert guarded("/v1/telemetry", "POST", json=message(0.0), headers=car).status_code == 200
    service = {"Authorization": f"Bearer {TOKEN}"}
    assert guarded("/v1/telemetry", "POST", json=message(0.0), headers=service).status_code == 401


def test_an_unknown_car_is_not_found(served: Served) -> None:
    for path, method in (("", "GET"), ("/plan", "PUT"), ("/events", "GET")):
        found = served(f"/v1/live/none{path}", method, json={"links": LINKS} if method == "PUT" else None)
        assert (found.status_code, found.json()["type"]) == (404, "/problems/no-such-car")
        found = served(f"/v1/live/..%2Fleaf{path}", method)
        assert found.status_code in (404, 422)


def test_without_a_folder_of_cars_the_service_follows_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "WorkerPool", Pool)
    app: Any = create_app(Settings())

    async def ask(path: str, method: str) -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.request(method, path, json={})

    for path, method in (
        ("/v1/telemetry", "POST"),
        ("/v1/live", "GET"),
        ("/v1/live/leaf", "GET"),
        ("/v1/live/leaf/plan", "PUT"),
        ("/v1/live/leaf/events", "GET"),
        ("/v1/need?car=leaf", "GET"),
    ):
        found = asyncio.run(ask(path, method))
        assert (found.status_code, found.json()["type"]) == (501, "/problems/no-live")


def test_a_folder_that_is_missing_is_refused_and_an_empty_one_is_not(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="no folder of cars"):
        create_app(Settings(cars=tmp_path / "missing"))
    Car.follow(tmp_path / "no-token").close()
    create_app(Settings(cars=tmp_path))


def test_a_message_that_cannot_be_stored_is_to_be_sent_again(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(Database, "put_messages", full)
        found = served.send(message(0.0))
    assert (found.status_code, found.headers["retry-after"]) == (503, "10")
    (logged,) = (record for record in served.logged if "event" in record)
    assert (logged["event"], logged["vehicle"]) == ("message not stored", "leaf")
    assert "database or disk is full" in logged["error"]
    assert served.send(message(0.0)).json()["arrival"] == "new"


def quick(cars: LiveCars, monkeypatch: pytest.MonkeyPatch, **more: Any) -> None:
    """Streams have an event right after news."""
    limits = Limits(live_every_s=0.01, **more)
    monkeypatch.setattr(cars, "settings", dataclasses.replace(cars.settings, limits=limits))


def test_events_come_at_once_and_after_news(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    cars = _cars(served)
    quick(cars, monkeypatch)
    car = cars.by_name("leaf")

    async def listen() -> list[bytes]:
        found, ending = [], anyio.Event()
        async for part in cars.events(car, ending):
            found.append(part.encode())
            if len(found) == 1:
                car.record(Sample(NOON_S, {"speed_m_s": 1.0}))
            else:
                ending.set()
        return found

    for part, new in zip(asyncio.run(listen()), (0, 1), strict=True):
        number, head, data, *rest = part.split(b"\n")
        assert (number, head, rest) == (f"id: {new + 1}".encode(), b"event: live", [b"", b""])
        assert orjson.loads(data.removeprefix(b"data: "))["messages"]["new"] == new


def test_one_stream_has_the_news_of_all_cars(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    cars = _cars(served)
    quick(cars, monkeypatch)

    async def listen() -> list[tuple[str, int]]:
        found, ending = list[tuple[str, int]](), anyio.Event()
        async for part in cars.events(None, ending):
            data = orjson.loads(part.encode().split(b"data: ")[1])
            found.append((data["car"], data["messages"]["new"]))
            if len(found) == 2:
                cars.by_name("zoe").record(Sample(NOON_S, {"speed_m_s": 1.0}))
            if len(found) == 3:
                ending.set()
        return found

    assert asyncio.run(listen()) == [("leaf", 0), ("zoe", 0), ("zoe", 1)]


def test_what_is_ahead_is_shown_where_it_is_included(served: Served) -> None:
    for k in range(60):
        served.send(message(float(k), soc=60.0, speed=36))
    (leaf, zoe) = served("/v1/live", params={"include": "need,range,next"}).json()["cars"]
    assert [one["distance_m"] for one in leaf["next"]] == [10_000.0, 50_000.0]  # on a trip without a plan
    assert leaf["next"][0]["energy_wh"] < leaf["next"][1]["energy_wh"]
    assert (leaf["need"], leaf["range"]["soc"], leaf["forecast"]) == (None, pytest.approx(0.6), None)
    assert leaf["trip"]["distance_m"] > 100.0
    assert (zoe["need"], zoe["range"], zoe["next"]) == (None, None, [])
    served.put({"links": LINKS})
    planned = served("/v1/live/leaf", params={"include": "next,need"}).json()
    assert planned["next"] == []
    assert "range" not in planned
    assert {"need", "range", "next"}.isdisjoint(served("/v1/live/leaf").json())
    assert served("/v1/live/leaf", params={"include": "moon"}).status_code == 422


def test_a_plan_is_read_removed_and_given_back(served: Served) -> None:
    assert served("/v1/live/leaf/plan").json()["type"] == "/problems/no-plan"
    gpx = (
        b'<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><rte><rtept lat="47" lon="9"/>'
        b'<rtept lat="47.1" lon="9.1"/></rte></gpx>'
    )
    shown = served.put(
        {
            "route": gpx.decode(),
            "speed_m_s": 15.0,
            "destination": "Work",
            "departs_at": NOON,
            "departure": {"soc": 0.8, "rain_mm_h": None},
        }
    ).json()
    assert (shown["plan"], shown["destination"]) == ("given", "Work")
    given = served("/v1/live/leaf/plan").json()
    assert set(given) >= {"links", "destination", "departs_at"}
    assert given["soc"] == 0.8
    assert {"departure", "rain_mm_h"}.isdisjoint(given)
    assert served("/v1/live/leaf/plan", "DELETE").json()["plan"] is None
    assert served.put(given, "zoe").json()["forecast"]["distance_m"] == shown["forecast"]["distance_m"]
    refused = served.put({"route": "no road"}, "zoe")
    assert (refused.status_code, refused.json()["faults"][0]["where"]) == (422, "route")
    assert served("/v1/live/zoe/plan").json() == given, "a plan that is refused changes nothing"


def test_a_plan_over_mqtt_is_set_removed_or_logged(served: Served) -> None:
    cars = _cars(served)
    asyncio.run(cars.plan_published("leaf", orjson.dumps({"links": LINKS, "destination": "Work"})))
    assert served("/v1/live/leaf").json()["destination"] == "Work"
    for payload in (b"{", b"[]", b'{"links": []}', b'{"route": 5}'):
        asyncio.run(cars.plan_published("leaf", payload))
        assert served.logged[-1]["event"] == "plan refused"
    assert served("/v1/live/leaf").json()["plan"] == "given"
    asyncio.run(cars.plan_published("leaf", b""))
    assert served("/v1/live/leaf").json()["plan"] is None


@pytest.mark.parametrize("of_all", [False, True])
def test_a_stream_with_a_car_that_is_deleted_ends(
    served: Served, monkeypatch: pytest.MonkeyPatch, of_all: bool
) -> None:
    """A listener opens it again, and finds the cars that are left."""
    cars = _cars(served)
    quick(cars, monkeypatch)
    car = cars.by_name("leaf")

    async def listen() -> int:
        found = 0
        async for _ in cars.events(None if of_all else car, anyio.Event()):
            found += 1
            if found == 1 + of_all:
                await cars.drop("leaf")
        return found

    assert asyncio.run(listen()) == 1 + of_all
    assert [row["car"] for row in served("/v1/live").json()["cars"]] == ["zoe"]


def test_a_forecast_that_a_diary_keeps_is_made_without_listeners(
    served: Served, drive: pd.DataFrame, made: list[str]
) -> None:
    cars = _cars(served)
    served.put({"links": LINKS})
    for sent in abrp_messages(drive):
        served.send(sent)
    car = cars.by_name("leaf")
    made.clear()

    async def run() -> None:
        watch = asyncio.ensure_future(cars.watch())
        while len(car.forecasts) < 2:
            await asyncio.sleep(0.01)
        watch.cancel()

    asyncio.run(run())
    assert made == ["forecast", "update"]
    departing, kept = car.forecasts
    assert (departing.at_s, departing.distance_m) == (0.0, 0.0), "that of the plan, before the car drove off"
    assert departing.energy_wh != kept.energy_wh
    found = served("/v1/live/leaf").json()
    assert kept.energy_wh == found["forecast"]["energy_wh"]
    assert [kept.low_wh, kept.high_wh] == [found["forecast"]["quantiles_wh"][p] for p in ("0.05", "0.95")]
    assert made == ["forecast", "update"], "it was made already"
    assert not car.wants_forecast


def test_listeners_have_places(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    cars = _cars(served)
    quick(cars, monkeypatch)
    cars.listeners.most = 2
    cars.listeners.taken["another"] = 2
    found = served("/v1/live/leaf/events")
    assert (found.status_code, found.json()["detail"]) == (503, "too many listeners")
    cars.listeners.taken["another"] = 1
    ending = anyio.Event()
    ending.set()
    monkeypatch.setattr(module.anyio, "Event", lambda: ending)
    found = served("/v1/live/leaf/events")
    assert (found.status_code, found.headers["content-type"]) == (200, "text/event-stream; charset=utf-8")
    assert cars.listeners.taken == {"another": 1}, "the place of a stream that has ended is free"


def test_streams_that_begin_together_are_no_more_than_the_places(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All are made before the first is sent, as where many connect at once; each client has a share."""
    cars = _cars(served)
    quick(cars, monkeypatch)
    cars.listeners.most = 8
    open_streams: set[int] = set()

    async def listen(number: int) -> bool:
        CLIENT.set(f"client {number % 3}")
        stream = cars.stream(cars.by_name("leaf"))
        await asyncio.sleep(0.0)

        async def send(message: Any) -> None:
            open_streams.add(number)
            await asyncio.sleep(0.2)
            raise OSError  # the client has gone

        async def receive() -> dict[str, str]:
            await asyncio.sleep(60.0)
            return {"type": "http.disconnect"}

        try:
            await stream({"type": "http", "method": "GET"}, receive, send)
        except Problem:
            return False
        except (OSError, ExceptionGroup, ClientDisconnect):
            pass
        return True

    async def run() -> list[bool]:
        return await asyncio.gather(*(listen(number) for number in range(40)))

    assert sum(asyncio.run(run())) == len(open_streams) <= 8
    assert {number % 3 for number in open_streams} == {0, 1, 2}
    assert not cars.listeners.taken


def test_a_stream_without_news_sends_comments(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "KEEP_ALIVE_S", 0.01)
    stream = _cars(served).stream(_cars(served).by_name("leaf"))
    assert stream.ping_interval == 0.01
    assert stream.ping_message_factory is not None
    assert stream.ping_message_factory().encode() == b": no news\n\n"


def test_the_head_of_a_stream_ends(served: Served) -> None:
    found = served("/v1/live/leaf/events", "HEAD")
    assert (found.status_code, found.content) == (200, b"")
    assert found.headers["content-type"].startswith("text/event-stream")
    assert not _cars(served).listeners.taken


def test_a_bug_of_one_car_does_not_end_the_watch_of_the_others(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    cars = _cars(served)
    seen: list[str] = []

    def broken(_: float) -> bool:
        raise ZeroDivisionError

    monkeypatch.setattr(cars.by_name("leaf"), "end_when_silent", broken)
    monkeypatch.setattr(cars.by_name("zoe"), "end_when_silent", lambda _: bool(seen.append("zoe")))

    async def run() -> None:
        watch = asyncio.ensure_future(cars.watch())
        while not seen:
            await asyncio.sleep(0.01)
        watch.cancel()

    asyncio.run(run())
    assert {"event": "bug", "vehicle": "leaf", "error": "ZeroDivisionError()"} in served.logged


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Service, dict[str, str]]]:
    folder = tmp_path_factory.mktemp("road")
    tokens = {name: issue_token(folder / "cars" / name) for name in ("leaf", "zoe")}
    more = ("--workers", "1", "--cars", f"{folder / 'cars'}", "--limit", "live_every_s=0.05")
    with serving(folder, *more) as found:
        yield found, tokens


def test_the_operations_of_cars_conform_to_the_openapi_document(
    road: tuple[Service, dict[str, str]],
) -> None:
    """Without messages, which need a token, and events, which do not end."""
    found = conformance(
        road[0].url,
        3,
        seed=3,
        only=r"^/v1/(live(/\{car\}(/plan)?)?|need)$",
        phases="examples,fuzzing",
        timeout_s=400,
    )
    assert found.clean, found.text


def test_a_running_service_streams_forecasts_and_ends_in_time(
    road: tuple[Service, dict[str, str]], drive: pd.DataFrame, plan: dict[str, Any]
) -> None:
    """The last test of this service."""
    service, tokens = road
    assert service.client.put("/v1/live/leaf/plan", json=plan).status_code == 200
    form = {"Content-Type": FORM, "Authorization": f"Bearer {tokens['leaf']}"}
    with service.client.stream("GET", "/v1/live/leaf/events") as stream:
        lines = stream.iter_lines()
        assert [next(lines), next(lines)] == ["id: 1", "event: live"]
        first = orjson.loads(next(lines).removeprefix("data: "))
        assert first["messages"]["new"] == 0
        for sent in abrp_messages(drive):
            body = urllib.parse.urlencode({"tlm": json.dumps(sent)})
            assert service.client.post("/v1/telemetry", content=body, headers=form).status_code == 200
        for line in lines:
            if line.startswith("data: "):
                last = orjson.loads(line[6:])
                if last["forecast"]["measured_until_s"] == drive["time_s"].iloc[-1]:
                    break
        own = own_forecast(plan)
        assert last["forecast"]["energy_wh"] == pytest.approx(own.update(drive).energy_wh, abs=1e-6)
        service.process.terminate()
        assert list(lines)[-1:] in ([], [""])
    assert wait_for(lambda: service.process.poll() is not None)
    assert service.process.returncode == 0


def test_a_message_comes_when_the_verdict_changes(served: Served, plan: dict[str, Any]) -> None:
    forecast = own_forecast(plan)
    reserve = forecast.soc_arrival - 0.5 * (forecast.soc_arrival - forecast.arrival.quantile(0.02))
    served.put({**plan, "reserve": round(reserve, 4)})
    assert served("/v1/live/leaf").json()["message"] is None
    table = measured(example_trip()).iloc[:560]
    for sent in abrp_messages(table.iloc[::10]):
        served.send(sent)
    told = served("/v1/live/leaf").json()
    assert told["faults"] == []
    assert 0.05 < forecast.p_arrive(round(reserve, 4)) < 0.95
    assert told["message"]["verdict"] == "arrives"
    assert told["message"]["p_arrive"] == told["forecast"]["p_arrive"] >= 0.95
    assert served("/v1/live/leaf").json()["message"] == told["message"]


PLAN = {"links": LINKS, "ambient_temperature_degc": 4.0, "reserve": 0.2, "car": "vw_id3"}
PARKED = Sample(
    NOON_S, {"speed_m_s": 0.0, "displayed_soc": 0.12, "ambient_temperature_degc": -5.0}, parked=True
)


class CountingPool:
    """Runs the jobs in this process, and keeps their kinds."""

    def __init__(self) -> None:
        self.kinds: list[str] = []
        self.jobs, self.status = Jobs.from_folders({}, Limits()), 200

    async def run(self, job: dict[str, Any], body: bytes) -> JobResult:
        self.kinds.append(job["kind"])
        status, content = run_job(self.jobs, job, body)
        return JobResult(status if self.status == 200 else self.status, content, 0.0)


class Published:
    """A service with one car at a time that is set."""

    def __init__(self, folder: Path) -> None:
        self.pool, self.logged, self.now_s = CountingPool(), list[dict[str, Any]](), NOON_S
        issue_token(folder / "leaf")
        broker = MqttSettings(Broker("192.0.2.7", 1883))
        settings = Settings(cars=folder, limits=Limits(publish_every_s=3.0), mqtt=broker)
        self.cars = LiveCars(settings, self.pool, lambda **record: self.logged.append(record))  # type: ignore[arg-type]
        self.ahead = Ahead(self.cars)
        self.car = self.cars.by_name("leaf")

    def take(self, sample: Sample, name: str = "leaf") -> dict[str, Any] | None:
        return asyncio.run(self.cars.take_published(name, lambda: sample))

    def document(self) -> dict[str, Any]:
        return asyncio.run(self.cars.published())["leaf"]


@pytest.fixture
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Published]:
    found = Published(tmp_path)
    monkeypatch.setattr(time, "time", lambda: found.now_s)
    yield found
    found.cars.close()


def test_the_need_and_the_range_of_a_parked_car_are_those_of_the_library(published: Published) -> None:
    published.take(PARKED)
    published.car.set_plan(PLAN)
    found = published.document()
    own = tw.forecast(tw.read_route(LINKS), tw.Departure(ambient_temperature_degc=4.0), car="vw_id3")
    assert found["need"]["probability"] == 0.95
    assert found["need"]["energy_quantile_wh"] == pytest.approx(own.quantile(0.95), rel=1e-6)
    needed = soc_needed(own, 0.2, 0.95)
    assert found["need"]["soc_needed"] == pytest.approx(needed, abs=1e-9)
    charging_s = (needed - 0.12) * own.charge.wh_per_display / CHARGER / PLUG_W * 3600.0
    assert found["need"]["charging_s"] == pytest.approx(charging_s, rel=1e-3)
    known = tw.Departure(soc=0.12, ambient_temperature_degc=-5.0)
    of_message, *flags = found["range"].pop("flags")
    expected = tw.range_km(departure=known, car="vw_id3").to_dict()
    assert flags == expected.pop("flags")
    assert (of_message["code"], of_message["value"]) == ("of_last_message", -5.0)
    assert found["range"] == expected
    assert (expected["soc"], expected["reserve"]) == (0.12, 0.1)
    assert (found["car"], found["soc"]) == ("leaf", 0.12)


def test_need_and_range_are_made_again_after_news_and_with_the_time_of_day(published: Published) -> None:
    assert published.document()["range"] is None
    assert published.pool.kinds == []  # no charge, no plan
    published.take(PARKED)
    published.car.set_plan(PLAN)
    ten_minutes = 600.0
    begins_s = (NOON_S // ten_minutes + 1.0) * ten_minutes
    published.now_s = begins_s
    first = published.document()
    assert published.pool.kinds == ["need", "range"]
    published.now_s = begins_s + 599.0
    assert published.document()["need"] == first["need"]
    assert published.pool.kinds == ["need", "range"]
    again = Sample(NOON_S + 2.0, dict(PARKED.values), parked=True)
    published.take(again)  # a message without news
    assert published.document()["need"] == first["need"]
    assert published.pool.kinds == ["need", "range"]
    published.now_s = begins_s + ten_minutes
    starts = [document["need"]["preheat"]["starts_at"] for document in (first, published.document())]
    early, late = (dt.datetime.fromisoformat(text) for text in starts)
    assert (late - early).total_seconds() == ten_minutes
    assert published.pool.kinds == ["need", "range"] * 2
    published.take(Sample(NOON_S + 5.0, {"speed_m_s": 0.0, "displayed_soc": 0.5}, parked=True))
    assert published.document()["range"]["range_m"] > first["range"]["range_m"]
    assert published.pool.kinds == ["need", "range"] * 3


def test_on_a_trip_and_after_a_refusal_nothing_is_guessed(published: Published) -> None:
    table: pd.DataFrame = measured(example_trip()).iloc[:200]
    for message in abrp_messages(table):
        published.now_s = message["utc"]
        published.take(sample_from_abrp(message))
    published.car.set_plan(PLAN, NOON_S)
    found = published.document()
    assert published.car.trip is not None
    assert (found["need"], published.pool.kinds) == (None, ["range"])
    assert found["range"]["range_m"] > 0.0
    published.pool.status, published.now_s = 503, published.now_s + 600.0
    assert published.document()["range"] is None


def test_messages_of_forgotten_cars_and_a_full_disk_are_passed_over(
    published: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    published.take(PARKED, "zoe")
    assert published.car.counts["new"] == 0
    published.take(PARKED)
    assert published.car.counts["new"] == 1

    def late(_: Sample) -> None:
        raise InvalidInput.of("message too late", "utc")

    with monkeypatch.context() as patch:
        patch.setattr(published.car, "record", late)
        refused = published.take(PARKED)
    assert refused is not None
    assert (refused["type"], refused["faults"][0]["what"]) == ("/problems/invalid-input", "message too late")

    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr(Database, "put_messages", full)
    busy = published.take(Sample(NOON_S + 2.0, {"speed_m_s": 0.0}))
    assert busy is not None
    assert busy["type"] == "/problems/busy"
    assert [record["event"] for record in published.logged] == ["faulty message", "message not stored"]


BAD: Final[tuple[Any, ...]] = (
    {"soc": 900},
    {"speed": 36, "soc": "none", "ext_temp": "warm", "power": 1e9},
    {"utc": 1000.0 * NOON_S, "speed": 36},
    {"utc": "now", "soc": 50},
    {"speeed": 36},
    {},
    7,
    None,
)
"""Messages with one fault or more; no other way to send one may answer it otherwise."""


@pytest.mark.parametrize("sent", BAD, ids=str)
def test_a_faulty_message_is_counted_logged_and_answered_over_mqtt_as_over_http(
    served: Served, sent: Any
) -> None:
    cars, joiner = _cars(served), TopicJoiner("abrp", "leaf")
    over_http = served("/v1/telemetry", "POST", json={"token": served.tokens["zoe"], "tlm": sent}).json()
    payload = json.dumps({"tlm": sent}).encode()
    read = partial(joiner.take, "leaf", payload, cars.by_name("leaf").now_s())
    over_mqtt = asyncio.run(cars.take_published("leaf", read))
    assert over_mqtt is not None
    over_http.pop("instance", None)
    assert over_http | {"car": ""} == over_mqtt | {"car": ""}
    faults = over_mqtt.get("ignored") or over_mqtt["faults"]
    assert all(fault["pointer"] == f"/tlm/{fault['where']}".removesuffix("/tlm") for fault in faults)
    counts = [cars.by_name(name).counts for name in ("leaf", "zoe")]
    assert counts[0] == counts[1]
    assert counts[0]["faulty"] == 1
    records = [row for row in served.logged if row.get("event") == "faulty message"]
    assert [row["vehicle"] for row in records] == ["zoe", "leaf"]
    assert records[0]["error"] == records[1]["error"]
    for _ in range(100):
        asyncio.run(cars.take_published("leaf", read))
    assert len(orjson.dumps(over_mqtt)) < 4096
    assert cars.by_name("leaf").counts["faulty"] == 101
    assert len([row for row in served.logged if row.get("event") == "faulty message"]) == 2, "seldom"


@pytest.mark.parametrize(
    "sent", [{"speed": 36}, {"utc": None, "speed": 36}, {"utc": "", "speed": 36}], ids=str
)
@pytest.mark.parametrize("wrapped", [True, False])
def test_a_missing_time_is_that_of_arrival_over_http_and_mqtt(
    served: Served, sent: dict[str, Any], wrapped: bool
) -> None:
    cars, joiner, since_s = _cars(served), TopicJoiner("abrp", "leaf"), time.time()
    message: dict[str, Any] = {"tlm": sent} if wrapped else sent
    over_http = served("/v1/telemetry", "POST", json={"token": served.tokens["zoe"], **message})
    assert (over_http.status_code, over_http.json()["arrival"]) == (200, "new")
    read = partial(joiner.take, "leaf", json.dumps(message).encode(), time.time())
    assert asyncio.run(cars.take_published("leaf", read)) is None
    for name in ("leaf", "zoe"):
        (sample,) = cars.by_name(name)._ordered.waiting
        assert since_s <= sample.time_s <= time.time()
        assert sample.values == {"speed_m_s": 10.0}


def test_what_the_broker_does_is_logged_and_cars_are_as_often_as_asked(published: Published) -> None:
    follower = published.cars._follower
    assert follower is not None
    assert follower.every_s == 3.0
    follower.note("192.0.2.7:1883: refused")
    assert published.logged == [{"event": "mqtt", "error": "192.0.2.7:1883: refused"}]
