"""Cars followed over MQTT with a real broker: the forecast of `update`, a broker that is killed, an age that grows."""

from __future__ import annotations

import asyncio
import json
import ssl
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.server.cars.brokers import (
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
from tests.server.cars.messages import NOON_S, measured

from tripwatt.trips import Plan

pytest.importorskip("aiomqtt", reason="the extra tripwatt[live] is not installed")

import aiomqtt
from tests.support.drives import example_trip

import tripwatt as tw
from tripwatt.errors import Fault, InvalidInput
from tripwatt.server.cars import following
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.discovery import SENSORS, discovery
from tripwatt.server.cars.following import Broker, MqttSettings
from tripwatt.server.cars.telemetry import Sample

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
    work: Callable[[Car], Awaitable[None]],
    note: Callable[[str], None] = lambda _: None,
) -> None:
    """Do something while a car is followed."""

    async def run() -> None:
        with Car.follow(folder / "leaf", lambda _: MODEL) as car:
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

    async def work(car: Car) -> None:
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
    own = MODEL.forecast(Plan.from_samples(example_trip())).update_since_departure(table)
    found = documents[-1]["forecast"]
    assert found["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    assert found["soc_quantiles"] == {
        f"{p:g}": pytest.approx(own.arrival.quantile(p), abs=1e-9) for p in (0.05, 0.5, 0.95)
    }
    assert found["p_arrive"] == pytest.approx(own.p_arrive(0.2), abs=1e-9)
    assert (found["reserve"], found["measured_until_s"], documents[-1]["faults"]) == (0.2, 299.0, [])


@pytest.mark.parametrize("delay_s", [0.23])
def test_a_client_that_loses_a_cancellation_delays_no_end(
    monkeypatch: pytest.MonkeyPatch, delay_s: float
) -> None:
    """`asyncio.wait_for` of Python 3.11, which the client uses, loses one that comes with its answer."""

    lost: list[None] = []

    class Losing:
        async def __aenter__(self) -> Losing:
            self._client = self
            return self

        async def __aexit__(self, *_: object) -> None: ...

        async def subscribe(self, *_: object, **__: object) -> None:
            await self.publish()

        async def publish(self, *_: object, **__: object) -> None:
            try:
                await asyncio.sleep(0.05)
            except asyncio.CancelledError:
                if lost:
                    raise
                lost.append(None)

        def manual_ack_set(self, _: bool) -> None: ...

        @property
        async def messages(self) -> AsyncIterator[Any]:
            await asyncio.sleep(60.0)
            yield

    async def nothing(*_: object) -> None: ...

    async def documents() -> dict[str, Any]:
        return {"leaf": {"seconds_since_message": time.monotonic(), "k": time.monotonic()}}

    async def run() -> None:
        settings = MqttSettings(Broker("127.0.0.1", 1883), {"leaf": ("ovms", "o/m/l/metric")})
        follower = following.Follower(settings, nothing, documents, nothing, print, every_s=0.0)
        monkeypatch.setattr(follower, "_client", Losing)
        task = asyncio.ensure_future(follower.follow())
        await asyncio.sleep(delay_s)
        task.cancel()
        done, _ = await asyncio.wait([task], timeout=5.0)
        assert done
        assert task.cancelled()

    asyncio.run(run())


@needs_broker
def test_a_broker_that_is_killed_costs_no_message_that_comes_after_it(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "AGAIN_S", (0.05, 0.1))
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    notes: list[str] = []

    async def work(car: Car) -> None:
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
    with pytest.raises(InvalidInput, match=f"not a broker: --mqtt: (got {url}; )?allowed"):
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
        forecasts[f"car{seed}"] = tw.forecast(Plan.from_samples(example_trip(seed)))
        assert len(drives[-1].messages) > len(drives[-1].table())
    for found in replay(tmp_path, drives, forecasts, killed=killed):
        assert found.difference_wh < 1e-6
        assert (found.missing, found.twice) == (0, 0)


class Client:
    """Stands for a client of a broker: what is published, with its options; it is lost when its messages end."""

    def __init__(self, *messages: aiomqtt.Message) -> None:
        self.given, self.sent, self.filters = messages, list[tuple[Any, ...]](), list[Any]()
        self.acknowledged, self._client = list[tuple[int, int]](), self

    def manual_ack_set(self, on: bool) -> None:
        assert on

    def ack(self, number: int, qos: int) -> None:
        self.acknowledged.append((number, qos))

    async def __aenter__(self) -> Client:
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    @property
    async def messages(self) -> AsyncIterator[aiomqtt.Message]:
        for message in self.given:
            yield message
        raise aiomqtt.MqttError("gone")

    async def subscribe(self, name: str, qos: int) -> None:
        self.filters.append((name, qos))

    async def publish(self, topic: str, text: str, qos: int, retain: bool) -> None:
        self.sent.append((topic, text, qos, retain))


class Followed:
    """A follower whose clients, clock and waits are those of a test; it stops after a number of waits."""

    def __init__(
        self, patch: pytest.MonkeyPatch, clients: list[Client | None], waits: int, **more: Any
    ) -> None:
        self.clients, self.waits, self.slept = clients, waits, list[float]()
        self.taken, self.notes = list[tuple[str, Sample]](), list[str]()
        self.plans = list[tuple[str, bytes]]()
        settings = MqttSettings(
            Broker("192.0.2.7", 1883), {"leaf": ("abrp", "cars/leaf"), "zoe": ("abrp", "cars/leaf2")}, **more
        )
        self.follower = following.Follower(settings, self.take, self.documents, self.plan, self.notes.append)
        patch.setattr(self.follower, "_client", self.client)
        patch.setattr(asyncio, "sleep", self.sleep)

    def client(self) -> Client:
        found = self.clients.pop(0) if self.clients else None
        if found is None:
            raise aiomqtt.MqttError("x" * 300)
        return found

    async def take(self, name: str, read: Callable[[], Sample | None]) -> dict[str, Any] | None:
        try:
            sample = read()
        except InvalidInput as refused:
            return {"car": name, "faults": [fault.what for fault in refused.faults]}
        if sample is None:
            return None
        self.taken.append((name, sample))
        return {"car": name, "faults": [fault.where for fault in sample.faults]} if sample.faults else None

    async def documents(self) -> dict[str, dict[str, Any]]:
        return {}

    async def plan(self, name: str, payload: bytes) -> None:
        self.plans.append((name, payload))

    async def sleep(self, seconds: float) -> None:
        if seconds == self.follower.every_s:  # between two messages
            await asyncio.Event().wait()
        self.slept.append(seconds)
        if len(self.slept) == self.waits:
            raise asyncio.CancelledError

    def follow(self) -> None:
        with pytest.raises(asyncio.CancelledError):
            asyncio.run(self.follower.follow())


def test_a_lost_broker_is_asked_again_after_twice_the_time_and_at_most_a_minute(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lost = Followed(monkeypatch, [], 8)
    lost.follow()
    assert lost.slept == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0, 60.0]
    assert lost.notes == [("192.0.2.7:1883: " + "x" * 300)[:200]] * 8
    found = Followed(monkeypatch, [None, None, Client(), None], 5)
    found.follow()
    assert found.slept == [1.0, 2.0, 1.0, 2.0, 4.0]
    assert found.notes[2] == "192.0.2.7:1883: gone"


def test_a_sample_is_complete_after_two_seconds_of_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    found, now_s = Followed(monkeypatch, [], 1, publish_to=""), [NOON_S]
    flushed: list[tuple[str, float]] = []
    monkeypatch.setattr(found.follower, "_now_s", lambda: now_s[0])
    for name, joiner in found.follower._joiners.items():
        monkeypatch.setattr(joiner, "flush", lambda name=name: flushed.append((name, now_s[0] - NOON_S)))
    found.follower._received_s = {"leaf": NOON_S, "zoe": NOON_S + 1.0}

    async def sleep(seconds: float) -> None:
        now_s[0] += 0.5
        if now_s[0] > NOON_S + 3.0:
            raise asyncio.CancelledError

    monkeypatch.setattr(asyncio, "sleep", sleep)
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(found.follower._publish_cars(Client()))  # type: ignore[arg-type]
    assert flushed == [("leaf", 2.0), ("leaf", 2.5), ("leaf", 3.0), ("zoe", 3.0)]


def test_a_message_is_of_the_car_whose_topic_it_is_below(monkeypatch: pytest.MonkeyPatch) -> None:
    def message(topic: str, speed_m_s: float) -> aiomqtt.Message:
        text = json.dumps({"utc": NOON_S, "speed": 3.6 * speed_m_s})
        return aiomqtt.Message(topic, text.encode(), 1, False, 1, None)

    client = Client(
        message("cars/leaf2", 3.0),
        message("cars/leaf", 4.0),
        message("x/leaf", 5.0),
        aiomqtt.Message("tripwatt/zoe/plan/set", b'{"links": []}', 1, False, 1, None),
        aiomqtt.Message("tripwatt/zoe/plan/set", b"kept", 1, True, 1, None),
    )
    found = Followed(monkeypatch, [client], 1)
    found.follow()
    assert [(name, round(sample.values["speed_m_s"], 6)) for name, sample in found.taken] == [
        ("zoe", 3.0),
        ("leaf", 4.0),
    ]
    assert found.notes == ["192.0.2.7:1883: gone"]
    assert found.plans == [("zoe", b'{"links": []}')]
    assert client.acknowledged == [(1, 1)] * 5


def test_what_is_wrong_with_messages_is_published_once_in_the_time_between_two_states(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def faulty(speed: str) -> aiomqtt.Message:
        return aiomqtt.Message("cars/leaf", f'{{"speed": "{speed}"}}'.encode(), 1, False, 1, None)

    last = aiomqtt.Message("cars/leaf", b"{", 1, False, 1, None)
    client, waits = Client(*map(faulty, ["1e9"] * 1000), last), 0
    found = Followed(monkeypatch, [client], 1)
    found.follow()
    assert client.acknowledged == [(1, 1)] * 1001  # none comes again
    client.sent.clear()

    async def sleep(seconds: float) -> None:
        nonlocal waits
        waits += 1
        assert seconds == found.follower.every_s
        if waits == 4:
            raise asyncio.CancelledError
        if waits == 3:
            await found.follower._take("zoe", lambda: Sample(NOON_S, faults=(Fault("x", "soc"),)))

    monkeypatch.setattr(asyncio, "sleep", sleep)
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(found.follower._publish_cars(client))  # type: ignore[arg-type]
    leaf, zoe = ('{"car": "leaf", "faults": ["not JSON"]}', '{"car": "zoe", "faults": ["soc"]}')
    assert client.sent == [
        ("tripwatt/leaf/telemetry/fault", leaf, 1, False),
        ("tripwatt/zoe/telemetry/fault", zoe, 1, False),
    ]


def test_a_car_is_published_where_it_is_another_and_after_its_age(monkeypatch: pytest.MonkeyPatch) -> None:
    found, client, now_s = Followed(monkeypatch, [], 1), Client(), [NOON_S]
    monkeypatch.setattr(found.follower, "_now_s", lambda: now_s[0])

    def publish_at(later_s: float, soc: float, age_s: float) -> list[tuple[str, Any]]:
        client.sent.clear()
        now_s[0] = NOON_S + later_s
        document = {"soc": soc, "seconds_since_message": age_s}
        asyncio.run(found.follower._publish_car(client, "leaf", document))  # type: ignore[arg-type]
        assert {tuple(more) for _, _, *more in client.sent} <= {(1, True)}
        return [(topic, json.loads(text)) for topic, text, *_ in client.sent]

    first = publish_at(0.0, 0.8, 0.0)
    car = [("tripwatt/leaf", {"soc": 0.8, "seconds_since_message": 0.0})]
    assert first == [*discovery("leaf", "tripwatt", "homeassistant"), *car]
    assert publish_at(29.9, 0.8, 29.9) == []
    assert publish_at(30.0, 0.8, 30.0) == [("tripwatt/leaf", {"soc": 0.8, "seconds_since_message": 30.0})]
    assert publish_at(31.0, 0.7, 0.5) == [("tripwatt/leaf", {"soc": 0.7, "seconds_since_message": 0.5})]
    assert publish_at(60.0, 0.7, 29.5) == []


def test_a_client_leaves_a_will_and_its_messages_wait_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made: dict[str, Any] = {}
    monkeypatch.setattr(aiomqtt, "Client", lambda *given, **more: made.update(more, given=given))

    def client(broker: Broker, **more: Any) -> dict[str, Any]:
        settings = MqttSettings(broker, {"leaf": ("plain", "x"), "zoe": ("plain", "y")}, **more)
        following.Follower(settings, print, print, print, print)._client()  # type: ignore[arg-type]
        return made

    plain = dict(client(Broker("h", 1883, "me", "secret")))
    assert plain["given"] == ("h", 1883)
    assert (plain["username"], plain["password"], plain["tls_context"]) == ("me", "secret", None)
    assert (plain["clean_session"], plain["keepalive"]) == (False, 30)
    assert plain["identifier"] == "tripwatt-tripwatt"
    will = plain["will"]
    assert (will.topic, will.payload, will.qos, will.retain) == ("tripwatt", "offline", 1, True)
    silent = client(Broker("h", 8883, encrypted=True), publish_to="")
    assert (silent["identifier"], silent["will"]) == ("tripwatt-leaf,zoe", None)
    assert silent["tls_context"].verify_mode == ssl.CERT_REQUIRED
