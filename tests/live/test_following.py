"""Cars followed over MQTT with a real broker: the forecast of `update`, a broker that is killed, an age that grows."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.live.brokers import (
    MOSQUITTO,
    Sent,
    broker,
    follower_of,
    published,
    replay,
    retained,
    subscribed,
    until,
)
from tests.live.messages import NOON_S, measured

pytest.importorskip("aiomqtt", reason="the extra tripwatt[live] is not installed")

import aiomqtt

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.live import Broker, MqttSettings, RoadCar, Sample, following
from tripwatt.live.discovery import EXPIRES_S, SENSORS, discovery
from tripwatt.synthetic import example_trip
from tripwatt.trips import plan_from_samples

needs_broker = pytest.mark.skipif(
    MOSQUITTO is None, reason="no mosquitto: install it from the distribution's packages"
)
ROOT = "ovms/me/leaf/metric"
METRICS = {
    "speed_m_s": ("v/p/speed", 3.6),
    "voltage_v": ("v/b/voltage", 1.0),
    "current_a": ("v/b/current", 1.0),
    "elevation_m": ("v/p/altitude", 1.0),
    "ambient_temperature_degc": ("v/e/temp", 1.0),
}


@pytest.fixture(scope="module")
def drive() -> pd.DataFrame:
    return measured(example_trip()).iloc[:300]


MODEL = tw.load_model()


def request() -> dict[str, Any]:
    """The whole trip as a speed trace."""
    return {"samples": {name: values.tolist() for name, values in example_trip().items()}, "reserve": 0.2}


async def publish(where: Broker, rows: pd.DataFrame) -> None:
    """Each second of a drive as OVMS sends it: the time, then the metrics."""
    async with aiomqtt.Client(where.host, where.port) as client:
        for row in rows.to_dict("records"):
            await client.publish(f"{ROOT}/m/time/utc", f"{NOON_S + row['time_s']:.0f}", qos=1)
            for ours, (metric, factor) in METRICS.items():
                await client.publish(f"{ROOT}/{metric}", repr(float(row[ours] * factor)), qos=1)


def following_car(
    folder: Path,
    where: Broker,
    work: Callable[[RoadCar], Awaitable[None]],
    note: Callable[[str], None] = lambda _: None,
) -> None:
    """Do something while a car is followed."""

    async def run() -> None:
        with RoadCar(folder / "leaf", lambda _: MODEL) as car:
            car.set_plan(request())
            follower = follower_of({"leaf": car}, MqttSettings(where, {"leaf": ("ovms", ROOT)}), note)
            task = asyncio.ensure_future(follower.follow())
            try:
                await work(car)
            finally:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)

    asyncio.run(run())


@needs_broker
def test_the_forecast_over_mqtt_is_that_of_update(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    documents: list[dict[str, Any]] = []
    sensors: dict[str, bytes] = {}
    states: list[bytes] = []

    async def work(car: RoadCar) -> None:
        await subscribed(where)
        await publish(where, drive)
        documents.append(
            await published(where, "tripwatt/leaf", lambda found: found["messages"]["new"] == len(drive))
        )
        sensors.update(await retained(where, "homeassistant/#", len(SENSORS)))
        states.append((await retained(where, "tripwatt", 1))["tripwatt"])

    with broker(tmp_path) as (where, _):
        following_car(tmp_path, where, work)
        states.append(asyncio.run(retained(where, "tripwatt", 1))["tripwatt"])
    assert states == [b"online", b"offline"]
    expected = dict(discovery("leaf", "tripwatt", "homeassistant"))
    assert {topic: json.loads(text) for topic, text in sensors.items()} == expected
    table = drive[["time_s", *METRICS]]
    own = MODEL.forecast(plan_from_samples(example_trip())).update_since_departure(table)
    found = documents[-1]["forecast"]
    assert found["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    assert found["soc_quantiles"] == {
        f"{p:g}": pytest.approx(own.soc_quantile(p), abs=1e-9) for p in (0.05, 0.5, 0.95)
    }
    assert found["p_arrive"] == pytest.approx(own.p_arrive(0.2), abs=1e-9)
    assert (found["reserve"], found["measured_until_s"], documents[-1]["faults"]) == (0.2, 299.0, [])


@needs_broker
def test_the_age_of_a_silent_car_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "AGE_S", 0.5)
    ages: list[float] = []

    async def work(car: RoadCar) -> None:
        car.add(Sample(NOON_S, {"speed_m_s": 0.0}), now_s=time.time() - 40.0)
        while len(ages) < 3:
            wanted = max(ages, default=39.0)
            found = await published(
                where,
                "tripwatt/leaf",
                lambda found, wanted=wanted: (found["seconds_since_message"] or 0.0) > wanted,
            )
            ages.append(found["seconds_since_message"])

    with broker(tmp_path) as (where, _):
        following_car(tmp_path, where, work)
    assert ages[0] >= 40.0
    assert ages[0] + 0.4 < ages[1] < ages[2] - 0.4
    assert ages[2] < 60.0


def test_sensors_expire_after_several_times_of_an_age() -> None:
    """A silent car is published again long before; 10 min after the end of a program nothing is left."""
    assert 3.0 * following.AGE_S <= EXPIRES_S <= 600.0


@needs_broker
def test_a_broker_that_is_killed_costs_no_message_that_comes_after_it(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "AGAIN_S", (0.05, 0.1))
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    notes: list[str] = []

    async def work(car: RoadCar) -> None:
        await subscribed(where)
        await publish(where, drive.iloc[:100])
        await until(lambda: car.counts["new"] == 100)
        process.kill()
        process.wait()
        await until(lambda: notes)
        with broker(tmp_path, where.port) as (again, _):
            await subscribed(again)
            await publish(again, drive.iloc[100:])
            await until(lambda: car.counts["new"] == len(drive))
            assert car.observed()["time_s"].tolist() == drive["time_s"].tolist()
            notes.clear()
        await until(lambda: notes)

    with broker(tmp_path) as (where, process):
        following_car(tmp_path, where, work, notes.append)
    assert all(note.startswith("127.0.0.1:") for note in notes)


@pytest.mark.parametrize("url", ["", "host", "http://host", "mqtt://", "mqtt://host:x", "mqtt://host:99999"])
def test_a_broker_has_a_url(url: str) -> None:
    with pytest.raises(InvalidInput, match="not a broker"):
        Broker.from_url(url)


def test_a_password_is_that_of_the_url_or_the_given_one_and_is_not_shown() -> None:
    assert Broker.from_url("mqtt://me@h", "secret") == Broker("h", 1883, "me", "secret")
    assert Broker.from_url("mqtts://me:p%40ss@h:1", "secret") == Broker("h", 1, "me", "p@ss", True)
    assert "secret" not in repr(Broker.from_url("mqtt://me:secret@h"))
    with pytest.raises(InvalidInput) as caught:
        Broker.from_url("http://me:secret@h")
    assert "secret" not in str(caught.value)


@needs_broker
@pytest.mark.parametrize("killed", [False, True])
def test_trips_with_lost_late_and_doubled_messages_end_whole(tmp_path: Path, killed: bool) -> None:
    drives, forecasts = [], {}
    for seed in range(3):
        table = measured(example_trip(seed)).iloc[: 300 + 50 * seed]
        drives.append(Sent.from_table(f"car{seed}", table, seed))
        forecasts[f"car{seed}"] = tw.forecast(plan_from_samples(example_trip(seed)))
        assert len(drives[-1].messages) > len(drives[-1].table())
    for found in replay(tmp_path, drives, forecasts, killed=killed):
        assert found.difference_wh < 1e-6
        assert (found.missing, found.twice) == (0, 0)
