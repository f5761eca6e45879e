"""Seeded restarts over MQTT: brokers and followers that are killed, lost sessions, kept, doubled and swapped messages."""

from __future__ import annotations

import asyncio
import json
import random
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import aiomqtt
from tests.server.cars.brokers import broker, follower_of, subscribed, until
from tests.server.cars.messages import abrp_messages, measured
from tests.support.drives import example_trip

from tripwatt.server.cars.car import Car
from tripwatt.server.cars.following import MqttSettings
from tripwatt.server.cars.live_trip import SILENCE_S
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp

GROUP: Final = 20
"""Messages between two moments: fewer seconds than a message may be late."""
GARBAGE: Final = (
    b"",
    b"{",
    b"[]",
    b"\xff",
    b'{"utc": 1e999}',
    b"[" * 70_000,
    b'{"tlm": "{"}',
)
MOMENTS: Final = (
    "nothing",
    "broker killed",
    "follower killed",
    "session lost",
    "swapped",
    "doubled",
    "kept",
    "garbage",
)


@dataclass
class Fuzzed:
    """What became of a drive: messages, those in no trip, those in a trip twice, trips, and what went wrong."""

    messages: int
    missing: int = 0
    twice: int = 0
    trips: int = 0
    wrong: list[str] = field(default_factory=list)


class Home:
    """A broker, and a program that follows one car over it; each may be killed and started again."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self.stack = folder, stack
        self.where, self.process = stack.enter_context(broker(folder))
        self.wrong: list[str] = []
        self.start()

    def start(self) -> None:
        """Start the program."""
        self.car = Car.follow(self.folder / "cars" / "leaf")
        settings = MqttSettings(self.where, {"leaf": ("abrp", "cars/leaf/tlm")})
        follower = follower_of({"leaf": self.car}, settings)
        store, self.stuck = follower.take, asyncio.Event()
        self.stuck.set()

        async def take(name: str, sample: Sample) -> None:
            await self.stuck.wait()
            await store(name, sample)

        follower.take = take
        self.task = asyncio.ensure_future(follower.follow())

    async def stop(self) -> None:
        """End the program, as a kill would: nothing is written at its end."""
        if self.task.done():
            self.wrong.append(f"the follower ended: {self.task.exception()!r}")
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)
        self.car.close()

    async def publish(self, messages: list[dict[str, Any]], *, retain: bool = False) -> None:
        """Send messages, and send all of them again if the broker is lost meanwhile."""
        async with aiomqtt.Client(self.where.host, self.where.port) as client:
            for message in messages:
                await client.publish("cars/leaf/tlm", json.dumps(message), qos=1, retain=retain)

    async def lose_session(self) -> None:
        """Make the broker forget what it keeps for the program."""
        async with aiomqtt.Client(
            self.where.host, self.where.port, identifier="tripwatt-tripwatt", clean_session=True
        ):
            pass

    def restart_broker(self) -> None:
        """Kill the broker, which keeps nothing, and start it again."""
        self.process.kill()
        self.process.wait()
        self.where, self.process = self.stack.enter_context(broker(self.folder, self.where.port))


async def _moment(home: Home, moment: str, group: list[dict[str, Any]], draw: random.Random) -> None:
    """Send a group of messages while something happens; a sender repeats what may be lost."""
    at = draw.randrange(len(group) + 1)
    if moment == "swapped":
        group = draw.sample(group, len(group))
    await home.publish(group[:at], retain=moment == "kept")
    match moment:
        case "broker killed":
            home.restart_broker()
            await subscribed(home.where)
            at = 0
        case "follower killed":
            home.stuck.clear()  # what comes now is with the program, but not on disk
            await home.publish(group[at : at + 5])
            await home.stop()
            await home.publish(group[at + 5 :])
            home.start()
            at = len(group)  # nothing is sent again
        case "session lost":
            await home.stop()
            await home.lose_session()
            await home.publish(group[at:])
            home.start()
            await subscribed(home.where)
            at = 0
        case "doubled":
            await home.publish(draw.sample(group[:at], at))
        case "garbage":
            async with aiomqtt.Client(home.where.host, home.where.port) as client:
                for payload in GARBAGE:
                    await client.publish("cars/leaf/tlm", payload, qos=1)
    await home.publish(group[at:], retain=moment == "kept")
    last = max(message["utc"] for message in group)
    await until(lambda: home.car._ordered.newest_s >= last)


async def _fuzz(folder: Path, seed: int, seconds: int) -> Fuzzed:
    draw = random.Random(seed)
    table = measured(example_trip(seed)).iloc[:seconds]
    table["speed_m_s"] = table["speed_m_s"].clip(lower=2.0)  # every message is part of the trip
    messages = list(abrp_messages(table))
    done = Fuzzed(len(messages))
    with ExitStack() as stack:
        home = Home(folder, stack)
        await subscribed(home.where)
        for first in range(0, len(messages), GROUP):
            await _moment(home, draw.choice(MOMENTS), messages[first : first + GROUP], draw)
        assert home.car.received_s is not None
        home.car.end_when_silent(home.car.now_s() + SILENCE_S + 1.0)
        times: list[float] = []
        for log in home.car.logs():
            done.trips += 1
            assert log.context.started_at is not None
            started_s = log.context.started_at.timestamp()
            times += [round(started_s + t) for t in log.array("time_s")]
        await home.stop()
        done.wrong += home.wrong
    sent = {round(sample_from_abrp(message).time_s) for message in messages}
    done.missing, done.twice = len(sent - {*times}), len(times) - len({*times})
    return done


def fuzzed(folder: Path, seed: int, seconds: int = 300) -> Fuzzed:
    """A drive over MQTT with a seeded moment for each group of its messages."""
    return asyncio.run(_fuzz(folder, seed, seconds))
