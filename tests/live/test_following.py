"""A car followed over MQTT with a real broker: the forecast of `update`, a broker that is killed, a command that prints."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.live.brokers import MOSQUITTO, Sent, broker, replay
from tests.live.messages import NOON_S, abrp_messages, measured
from tests.support.service_process import serving

pytest.importorskip("aiomqtt", reason="the extra tripwatt[live] is not installed")

import aiomqtt

import tripwatt as tw
from tripwatt.cli.on_road import sentence
from tripwatt.errors import InvalidInput
from tripwatt.live import Broker, Follower, RoadCar, TopicJoiner, following, issue_token
from tripwatt.live.discovery import SENSORS, discovery
from tripwatt.live.folder import finished_names, forecasts_of
from tripwatt.live.live_trip import SILENCE_S
from tripwatt.service.live_schemas import LiveResponse
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
LINKS = [{"length_m": 9000.0, "speed_m_s": 14.0}]


def request() -> dict[str, Any]:
    """The whole trip as a speed trace."""
    return {"samples": {name: values.tolist() for name, values in example_trip().items()}, "reserve": 0.2}


def opened(folder: Path) -> RoadCar:
    return RoadCar(folder, lambda _: MODEL)


async def publish(where: Broker, rows: pd.DataFrame) -> None:
    """Each second of a drive as OVMS sends it: the time, then the metrics."""
    async with aiomqtt.Client(where.host, where.port) as client:
        for row in rows.to_dict("records"):
            await client.publish(f"{ROOT}/m/time/utc", f"{NOON_S + row['time_s']:.0f}", qos=1)
            for ours, (metric, factor) in METRICS.items():
                await client.publish(f"{ROOT}/{metric}", repr(float(row[ours] * factor)), qos=1)


async def until(condition: Callable[[], Any]) -> None:
    for _ in range(1200):
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it did not come true in a minute")


def following_car(
    folder: Path,
    where: Broker,
    work: Callable[[Follower, list[dict[str, Any]]], Awaitable[None]],
    **more: Any,
) -> list[dict[str, Any]]:
    """Do something while a car is followed; what it showed."""
    shown: list[dict[str, Any]] = []

    async def run() -> None:
        with opened(folder) as car:
            car.set_plan(request())
            follower = Follower(car, TopicJoiner("ovms", ROOT), shown.append, every_s=0.1, **more)
            task = asyncio.ensure_future(follower.follow(where))
            try:
                await work(follower, shown)
            finally:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)

    asyncio.run(run())
    return shown


async def subscribed(where: Broker) -> None:
    """Wait until the follower's session is there: what is published after that is kept for it."""
    async with aiomqtt.Client(where.host, where.port) as client:
        await client.subscribe("$SYS/broker/subscriptions/count")
        async for message in client.messages:
            if int(bytes(message.payload)) >= 2:  # type: ignore[arg-type]
                return


@needs_broker
def test_the_forecast_over_mqtt_is_that_of_update(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    published: list[dict[str, Any]] = []

    async def work(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await subscribed(where)
        await publish(where, drive)
        await until(lambda: follower.car.counts["new"] == len(drive))
        await until(lambda: shown and shown[-1]["messages"]["new"] == len(drive))
        async with aiomqtt.Client(where.host, where.port) as client:
            await client.subscribe("tripwatt/leaf")
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                published.append(json.loads(message.payload))
                if published[-1]["messages"]["new"] == len(drive):
                    break

    found_by_home_assistant: dict[str, Any] = {}

    async def work_and_look(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await work(follower, shown)
        async with aiomqtt.Client(where.host, where.port) as client:
            await client.subscribe("homeassistant/#")
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                assert message.retain
                found_by_home_assistant[message.topic.value] = json.loads(message.payload)
                if len(found_by_home_assistant) == len(SENSORS):
                    break

    with broker(tmp_path) as (where, _):
        shown = following_car(
            tmp_path / "leaf",
            where,
            work_and_look,
            publish_to="tripwatt/leaf",
            announce_below="homeassistant",
        )
    assert found_by_home_assistant == dict(discovery("leaf", "tripwatt/leaf", "homeassistant"))
    table = drive[["time_s", *METRICS]]
    own = MODEL.forecast(plan_from_samples(example_trip())).update_since_departure(table)
    found = shown[-1]["forecast"]
    assert found["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    assert found["soc_quantiles"] == {
        f"{p:g}": pytest.approx(own.soc_quantile(p), abs=1e-9) for p in (0.05, 0.5, 0.95)
    }
    assert found["p_arrive"] == pytest.approx(own.p_arrive(0.2), abs=1e-9)
    assert (found["reserve"], found["measured_until_s"], shown[-1]["faults"]) == (0.2, 299.0, [])
    assert published[-1]["forecast"] == found


@needs_broker
def test_a_broker_that_is_killed_costs_no_message_that_comes_after_it(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "AGAIN_S", (0.05, 0.1))
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    notes: list[str] = []

    async def work(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await subscribed(where)
        await publish(where, drive.iloc[:100])
        await until(lambda: follower.car.counts["new"] == 100)
        process.kill()
        process.wait()
        await until(lambda: notes)
        with broker(tmp_path, where.port) as (again, _):
            await subscribed(again)
            await publish(again, drive.iloc[100:])
            await until(lambda: follower.car.counts["new"] == len(drive))
            assert follower.car.observed()["time_s"].tolist() == drive["time_s"].tolist()
            notes.clear()
        await until(lambda: notes)

    with broker(tmp_path) as (where, process):
        following_car(tmp_path / "leaf", where, work, note=notes.append)
    assert all(note.startswith("127.0.0.1:") for note in notes)


@needs_broker
def test_the_command_prints_a_line_for_new_messages(drive: pd.DataFrame, tmp_path: Path) -> None:
    (tmp_path / "route.json").write_text(json.dumps(LINKS))
    with broker(tmp_path) as (where, _):
        found = printed_by_the_command(tmp_path, where, list(abrp_messages(drive)))
    plan = tw.read_route(LINKS)
    with RoadCar(tmp_path / "leaf") as car:
        assert car.plan is not None, "it is kept for the next start of the command"
        own = car.update(MODEL.forecast(plan, car.departure()))
    assert found["forecast"]["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    assert sentence(found).startswith(  # type: ignore[arg-type]
        f"leaf: {found['trip']['distance_m'] / 1000.0:.1f} km driven, 300 messages, "
    )


@needs_broker
def test_mqtt_and_http_give_equal_documents(drive: pd.DataFrame, tmp_path: Path) -> None:
    """The same plan and the same messages, over a broker to the command and over HTTP to the service."""
    pytest.importorskip("fastapi", reason="the extra tripwatt[service] is not installed")
    (tmp_path / "route.json").write_text(json.dumps(LINKS))
    (tmp_path / "logs").mkdir()
    messages = list(abrp_messages(drive))
    token = issue_token(tmp_path / "cars" / "leaf")
    with serving(tmp_path / "logs", "--workers", "1", "--cars", f"{tmp_path / 'cars'}") as service:
        assert service.client.put("/v1/live/leaf/plan", json={"links": LINKS}).status_code == 200
        for message in messages:
            sent = service.client.post("/v1/telemetry", json={"token": token, "tlm": message})
            assert sent.status_code == 200, sent.text
        over_http = service.client.get("/v1/live/leaf").json()
    LiveResponse.model_validate(over_http)
    with broker(tmp_path) as (where, _):
        over_mqtt = printed_by_the_command(tmp_path, where, messages)
    for document in (over_http, over_mqtt):
        assert document.pop("seconds_since_message") >= 0.0
    over_http.pop("message")  # over HTTP alone
    assert over_mqtt == over_http
    assert over_mqtt["forecast"]["distance_m"] == pytest.approx(9000.0, rel=1e-3)


def printed_by_the_command(folder: Path, where: Broker, messages: list[dict[str, Any]]) -> dict[str, Any]:
    """The last line that `tripwatt live --json` prints of some messages."""
    command = [sys.executable, "-m", "tripwatt.cli", "live", f"{folder / 'leaf'}"]
    command += ["--mqtt", f"mqtt://127.0.0.1:{where.port}", "--source", "abrp", "--topic", "leaf/tlm"]
    command += ["--plan", f"{folder / 'route.json'}", "--every", "0.2", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:

        async def send() -> None:
            await subscribed(where)
            async with aiomqtt.Client(where.host, where.port) as client:
                for message in messages:
                    await client.publish("leaf/tlm", json.dumps(message), qos=1)

        asyncio.run(send())
        assert process.stdout is not None
        assert process.stderr is not None
        document: dict[str, Any] = {}
        for line in process.stdout:
            document = json.loads(line)
            if document["messages"]["new"] == len(messages):
                break
        process.terminate()
        process.stdout.read()
        said = process.stderr.read()
    assert "waiting for messages of leaf/tlm at 127.0.0.1; the trip is forecast on its plan" in said
    return document


@needs_broker
def test_a_forecast_over_mqtt_reaches_the_diary(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    made: list[Any] = []

    async def work(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await subscribed(where)
        await until(lambda: shown)
        await publish(where, drive)
        await until(lambda: shown[-1]["messages"]["new"] == len(drive))
        made.extend(follower.car.forecasts)
        assert follower.car.received_s is not None
        follower.car.end_when_silent(follower.car.received_s + SILENCE_S)

    with broker(tmp_path) as (where, _):
        shown = following_car(tmp_path / "leaf", where, work)
    departing, first, *_ = made
    assert (departing.at_s, departing.energy_wh) == (0.0, shown[0]["forecast"]["energy_wh"])
    on_the_way = {document["forecast"]["energy_wh"]: document["forecast"] for document in shown}
    ends = on_the_way[first.energy_wh]["quantiles_wh"]
    assert (first.low_wh, first.high_wh) == (ends["0.05"], ends["0.95"])
    (name,) = finished_names(tmp_path / "leaf")
    assert forecasts_of(tmp_path / "leaf", f"leaf-{name}") == tuple(made)


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
