"""A real broker on loopback, and drives that are sent over it with lost, late and doubled messages."""

from __future__ import annotations

import asyncio
import json
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AsyncExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import aiomqtt
import pandas as pd
from tests.server.cars.messages import NOON_S, abrp_messages, over_a_bad_connection
from tests.support.service_process import free_port

from tripwatt.errors import InvalidInput
from tripwatt.forecasting import Forecast
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.following import Broker, Follower, MqttSettings
from tripwatt.server.cars.live_trip import SILENCE_S
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp

MOSQUITTO: Final = shutil.which("mosquitto") or shutil.which("/usr/sbin/mosquitto")
PART: Final = 25
"""Messages of a car that are sent before it is waited for those before them."""
AGAIN: Final = 4 * PART
"""Messages that are sent again after the broker was killed: all that it may not have delivered."""


@contextmanager
def broker(folder: Path, port: int = 0) -> Iterator[tuple[Broker, subprocess.Popen[bytes]]]:
    """A broker on loopback that holds what it cannot deliver yet."""
    port = port or free_port()
    config = folder / "mosquitto.conf"
    config.write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\nmax_queued_messages 0\npersistence false\nsys_interval 1\n"
    )
    assert MOSQUITTO is not None
    process = subprocess.Popen([MOSQUITTO, "-c", f"{config}"], stderr=subprocess.DEVNULL)
    try:
        for _ in range(200):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            assert process.poll() is None
            time.sleep(0.05)
        yield Broker("127.0.0.1", port), process
    finally:
        process.kill()
        process.wait()


@dataclass(frozen=True, eq=False)
class Sent:
    """A drive as its messages arrive at the broker."""

    name: str
    messages: Sequence[dict[str, Any]]
    samples: Sequence[Sample]

    @classmethod
    def from_table(cls, name: str, table: pd.DataFrame, seed: int) -> Sent:
        """A fifth of the messages each lost, late and doubled; `table` is timed from the departure of the plan."""
        found = {
            sample_from_abrp(m).time_s: m
            for m in abrp_messages(table, NOON_S + float(table["time_s"].iloc[0]))
        }
        arrived = over_a_bad_connection([sample_from_abrp(m) for m in found.values()], seed)
        return cls(name, [found[sample.time_s] for sample in arrived], arrived)

    @property
    def topic(self) -> str:
        return f"cars/{self.name}/tlm"

    def table(self) -> pd.DataFrame:
        """What arrived, once each, in the order of time."""
        once = {s.time_s: {"time_s": s.time_s - NOON_S, **s.values} for s in self.samples}
        return pd.DataFrame([once[time_s] for time_s in sorted(once)])


@dataclass(frozen=True)
class Replayed:
    """What became of a drive: difference of its last forecast to that of `update` [Wh], and its finished trip.

    `missing` and `twice` count samples between the first and the last of the trip.
    """

    difference_wh: float
    missing: int
    twice: int


def replay(
    folder: Path, drives: Sequence[Sent], forecasts: Mapping[str, Forecast], *, killed: bool
) -> list[Replayed]:
    """Send drives to cars that are followed over a broker, which is killed in the middle of them or not."""
    with broker(folder) as (where, process):
        return asyncio.run(_replay(folder, where, drives, forecasts, process if killed else None))


async def _replay(
    folder: Path,
    where: Broker,
    drives: Sequence[Sent],
    forecasts: Mapping[str, Forecast],
    victim: subprocess.Popen[bytes] | None,
) -> list[Replayed]:
    async with AsyncExitStack() as stack:
        cars = {d.name: stack.enter_context(Car.follow(folder / "cars" / d.name)) for d in drives}
        for car in cars.values():
            car.set_plan({}, NOON_S)
        settings = MqttSettings(where, {d.name: ("abrp", d.topic) for d in drives})
        task = asyncio.ensure_future(follower_of(cars, settings).follow())
        try:
            half = {d.name: len(d.messages) // 2 for d in drives}
            await subscribed(where, len(drives))
            for d in drives:
                await _send(where, d, cars[d.name], 0, half[d.name], wait=victim is None)
            if victim is not None:
                victim.kill()
                victim.wait()
                with broker(folder, where.port) as (again, _):
                    await subscribed(again, len(drives))
                    for d in drives:
                        await _send(again, d, cars[d.name], max(half[d.name] - AGAIN, 0), len(d.messages))
            else:
                for d in drives:
                    await _send(where, d, cars[d.name], half[d.name], len(d.messages))
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        return [_judged(d, cars[d.name], forecasts[d.name]) for d in drives]


async def subscribed(where: Broker, topics: int = 1) -> None:
    """Wait until all topics are subscribed: what is published after that is kept for the followers."""
    async with aiomqtt.Client(where.host, where.port) as client:
        await client.subscribe("$SYS/broker/subscriptions/count")
        async for message in client.messages:
            assert isinstance(message.payload, bytes)
            if int(message.payload) > topics:
                return


async def published(where: Broker, topic: str, wanted: Callable[[Mapping[str, Any]], bool]) -> dict[str, Any]:
    """The first document on a topic that is wanted."""
    async with aiomqtt.Client(where.host, where.port) as client:
        await client.subscribe(topic)
        async with asyncio.timeout(60.0):
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                document: dict[str, Any] = json.loads(message.payload)
                if wanted(document):
                    return document
    raise AssertionError("the broker was lost")


async def retained(where: Broker, topics: str, count: int) -> dict[str, bytes]:
    """What a broker keeps on some topics."""
    kept: dict[str, bytes] = {}
    async with aiomqtt.Client(where.host, where.port) as client:
        await client.subscribe(topics)
        async with asyncio.timeout(60.0):
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                assert message.retain
                kept[message.topic.value] = message.payload
                if len(kept) == count:
                    return kept
    raise AssertionError("the broker was lost")


def follower_of(
    cars: Mapping[str, Car],
    settings: MqttSettings,
    note: Callable[[str], None] = lambda _: None,
    every_s: float = 0.1,
) -> Follower:
    """Follows cars in this process, without a service."""

    async def take(name: str, read: Callable[[], Sample | None]) -> None:
        with suppress(InvalidInput):  # the service answers it
            sample = read()
            if sample is not None:
                cars[name].record(sample)

    async def documents() -> dict[str, Mapping[str, Any]]:
        return {name: dict(car.document(time.time())) for name, car in cars.items()}

    async def plan(name: str, payload: bytes) -> None:
        cars[name].set_plan(json.loads(payload))

    return Follower(settings, take, documents, plan, note, every_s)


async def _send(where: Broker, drive: Sent, car: Car, start: int, stop: int, *, wait: bool = True) -> None:
    """Send a part of a drive. Without `wait`, what is sent last may not be with the car when this returns."""
    before = sum(car.counts.values())
    async with aiomqtt.Client(where.host, where.port) as client:
        for first in range(start, stop, PART):
            last = min(first + PART, stop)
            await until(lambda first=first: sum(car.counts.values()) - before >= first - start - PART)
            for message in drive.messages[first:last]:
                await client.publish(drive.topic, json.dumps(message), qos=1)
    if wait:
        await until(lambda: sum(car.counts.values()) - before >= stop - start)


async def until(condition: Callable[[], Any]) -> None:
    for _ in range(6000):
        if condition():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("it did not come true in a minute")


def _judged(drive: Sent, car: Car, forecast: Forecast) -> Replayed:
    expected = drive.table()
    difference = abs(car.update(forecast).energy_wh - forecast.update(expected).energy_wh)
    assert car.update(forecast).energy_wh != forecast.energy_wh
    assert car.received_s is not None
    assert car.trip is not None
    started = car.trip.start_s
    assert car.end_when_silent(car.received_s + SILENCE_S)
    (log,) = car.logs()
    times = [round(started + t, 3) for t in log.array("time_s")]
    sent = {round(s.time_s, 3) for s in drive.samples}
    between = {t for t in sent if times[0] <= t <= times[-1]}
    return Replayed(difference, len(between - set(times)), len(times) - len(set(times)))
