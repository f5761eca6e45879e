"""Cars of a service over MQTT: what is taken of their messages, and their need and range that are published."""

from __future__ import annotations

import asyncio
import datetime as dt
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.server.cars.messages import NOON_S, abrp_messages, measured

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.roads.advice.preheating import CHARGER, PLUG_W
from tripwatt.server.cars import Broker, MqttSettings, Sample, issue_token, live_car, sample_from_abrp
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.pool import JobResult
from tripwatt.server.http.settings import Limits, Settings
from tripwatt.server.http.worker import run_job
from tripwatt.study.synthetic import example_trip

LINKS = [{"length_m": 4000.0, "speed_m_s": 12.0}, {"length_m": 9000.0, "speed_m_s": 20.0}]
PLAN = {"links": LINKS, "ambient_temperature_degc": 4.0, "reserve": 0.2, "vehicle": "vw_id3"}
PARKED = Sample(
    NOON_S, {"speed_m_s": 0.0, "displayed_soc": 0.12, "ambient_temperature_degc": -5.0}, parked=True
)


class Pool:
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
        self.pool, self.logged, self.now_s = Pool(), list[dict[str, Any]](), NOON_S
        issue_token(folder / "leaf")
        broker = MqttSettings(Broker("192.0.2.7", 1883))
        settings = Settings(cars=folder, limits=Limits(live_every_s=3.0), mqtt=broker)
        self.cars = LiveCars(settings, self.pool, lambda **record: self.logged.append(record))  # type: ignore[arg-type]
        self.car = self.cars.by_name("leaf")

    def take(self, sample: Sample, name: str = "leaf") -> None:
        asyncio.run(self.cars.take_published(name, sample))

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
    own = tw.forecast(tw.read_route(LINKS), tw.Departure(ambient_temperature_degc=4.0), vehicle="vw_id3")
    assert found["need"]["probability"] == 0.9
    assert found["need"]["energy_quantile_wh"] == pytest.approx(own.quantile(0.9), rel=1e-6)
    needed = soc_needed(own, 0.2, 0.9)
    assert found["need"]["soc_needed"] == pytest.approx(needed, abs=1e-9)
    charging_s = (needed - 0.12) * own.charge.wh_per_display / CHARGER / PLUG_W * 3600.0
    assert found["need"]["charging_s"] == pytest.approx(charging_s, rel=1e-3)
    known = tw.Departure(soc=0.12, ambient_temperature_degc=-5.0)
    of_message, *flags = found["range"].pop("flags")
    expected = tw.range_km(departure=known, vehicle="vw_id3").to_dict()
    assert flags == expected.pop("flags")
    assert (of_message["code"], of_message["value"]) == ("of_last_message", -5.0)
    assert found["range"] == expected
    assert (expected["soc"], expected["reserve"]) == (0.12, 0.0)  # down to an empty display
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
        with pytest.raises(InvalidInput, match="message too late"):  # the follower notes it
            published.take(PARKED)

    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr(live_car, "put_messages", full)
    published.take(Sample(NOON_S + 2.0, {"speed_m_s": 0.0}))
    assert [record["event"] for record in published.logged] == ["message not stored"]


def test_what_the_broker_does_is_logged_and_cars_are_as_often_as_in_a_stream(published: Published) -> None:
    follower = published.cars._follower
    assert follower is not None
    assert follower.every_s == 3.0
    follower.note("192.0.2.7:1883: refused")
    assert published.logged == [{"event": "mqtt", "error": "192.0.2.7:1883: refused"}]
