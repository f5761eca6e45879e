"""Follow cars over MQTT: their messages become samples, and the state of each car is published every few seconds."""

from __future__ import annotations

import asyncio
import contextlib
import json
import ssl
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote, urlsplit

from tripwatt.errors import InvalidInput
from tripwatt.server.cars.discovery import OFFLINE, ONLINE, discovery
from tripwatt.server.cars.sender import steady_clock
from tripwatt.server.cars.telemetry import Sample
from tripwatt.server.cars.topics import TopicJoiner

if TYPE_CHECKING:
    import aiomqtt

PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
"""Scheme of a URL -> usual port; `mqtts` is encrypted."""

AGAIN_S: Final = (1.0, 60.0)
"""First and longest wait before connecting to a lost broker again [s]; doubled each time. A choice."""

PLAN_TOPIC: Final = "/plan/set"
"""Topic below that of a car, on which its plan is set."""

FAULT_TOPIC: Final = "/telemetry/fault"
"""Topic below that of a car, with what is wrong with its messages, at most every `every_s`."""

FLUSH_S: Final = 2.0
"""A sample is complete if nothing arrives for this long [s]. A choice."""

AGE_S: Final = 30.0
"""A car without news is published again after this time [s], because the time since its last message grows. A choice."""

KEEP_ALIVE_S: Final = 30
"""A broker that receives nothing for one and a half times this publishes the will [s]. A choice."""


@dataclass(frozen=True, slots=True)
class Broker:
    """Address and account of an MQTT broker.

    Attributes
    ----------
    host : str
        Name or address.
    port : int
        TCP port.
    username, password : str or None
        None for a broker without accounts.
    encrypted : bool
        Whether the connection is by TLS.

    Examples
    --------
    >>> Broker("broker.example", 1883).encrypted
    False
    """

    host: str
    port: int
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    encrypted: bool = False

    @classmethod
    def from_url(cls, url: str, password: str | None = None) -> Broker:
        """Read a URL such as `mqtt://name@192.0.2.7:1883`.

        Parameters
        ----------
        url : str
            URL with the scheme `mqtt` or `mqtts`.
        password : str, optional
            Password for a URL without one.

        Returns
        -------
        Broker
            The broker, with the usual port of the scheme if the URL has none.

        Raises
        ------
        InvalidInput
            When the URL is not that of a broker.

        Examples
        --------
        >>> Broker.from_url("mqtts://me:secret@broker.example")
        Broker(host='broker.example', port=8883, username='me', encrypted=True)
        """
        try:
            parts = urlsplit(url)
            port = parts.port
        except ValueError:
            parts, port = urlsplit(""), None
        if parts.scheme not in PORTS or not parts.hostname:
            got = url.rpartition("@")[2][:80]  # never a password
            raise InvalidInput.of("not a broker", "--mqtt", got, "mqtt://HOST[:PORT] or mqtts://HOST[:PORT]")
        username, given = (text and unquote(text) for text in (parts.username, parts.password))
        return cls(
            parts.hostname, port or PORTS[parts.scheme], username, given or password, parts.scheme == "mqtts"
        )


@dataclass(frozen=True, slots=True)
class MqttSettings:
    """Which cars are followed over MQTT, and to which topics they are published.

    Attributes
    ----------
    broker : Broker
        Broker that the cars send to.
    cars : mapping of str to tuple of str
        Name of a car -> its sender (see `TopicJoiner`) and topic.
    publish_to : str
        Topic below which cars are published; the topic itself has `online` or `offline`. Empty to publish nothing.
    announce_below : str
        Prefix of topics below which Home Assistant finds what is published; empty for none.

    Examples
    --------
    >>> MqttSettings(Broker("192.0.2.7", 1883), {"leaf": ("ovms", "ovms/me/leaf/metric")}).publish_to
    'tripwatt'
    """

    broker: Broker
    cars: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    publish_to: str = "tripwatt"
    announce_below: str = "homeassistant"


@dataclass(eq=False)
class Follower:
    """Follows cars over MQTT and publishes their state, until `follow` is cancelled. Cars are given by name only.

    Attributes
    ----------
    settings : MqttSettings
        What is followed and published.
    take : callable
        Called with the name of a car and a function that returns its next sample, or None, or raises `InvalidInput`. What it returns
        is published on `FAULT_TOPIC`: what is wrong with the message.
    documents : callable
        Returns name of a car -> document to publish.
    plan : callable
        Called with the name of a car and the plan of its next trip as JSON text, from the topic `PLAN_TOPIC` below that of the car.
    note : callable
        Called with a sentence when the broker is lost.
    every_s : float
        Shortest time between two published messages of a car [s].

    Raises
    ------
    InvalidInput
        For an unknown sender or an invalid topic.

    Examples
    --------
    >>> async def documents():
    ...     return {"leaf": {"soc": 0.8}}
    >>> async def take(name, read):
    ...     print(name, read())
    >>> settings = MqttSettings(Broker.from_url("mqtt://127.0.0.1"), {"leaf": ("teslamate", "teslamate/cars/1")})
    >>> follower = Follower(settings, take, documents, print, print)
    >>> asyncio.run(follower.follow())  # doctest: +SKIP
    """

    settings: MqttSettings
    take: Callable[[str, Callable[[], Sample | None]], Awaitable[Mapping[str, Any] | None]]
    documents: Callable[[], Awaitable[Mapping[str, Mapping[str, Any]]]]
    plan: Callable[[str, bytes], Awaitable[object]]
    note: Callable[[str], None]
    every_s: float = 5.0

    def __post_init__(self) -> None:
        self._joiners = {name: TopicJoiner(*given) for name, given in self.settings.cars.items()}
        self._now_s = steady_clock()
        self._received_s = dict.fromkeys(self._joiners, 0.0)
        # the latest answers to messages with faults that are not published yet, at most one of a car
        self._answers: dict[str, Mapping[str, Any]] = {}
        # what was published of a car, without its age, and when
        self._published: dict[str, tuple[dict[str, Any], float]] = {}

    async def follow(self) -> None:
        """Follow the cars; connect to a lost broker again, for as long as it takes."""
        import aiomqtt  # an extra

        wait_s = AGAIN_S[0]
        while True:
            try:
                async with self._client() as client:
                    for joiner in self._joiners.values():
                        await client.subscribe(f"{joiner.root}/#", qos=1)  # the topic itself, too
                    if self.settings.publish_to:
                        await client.subscribe(f"{self.settings.publish_to}/+{PLAN_TOPIC}", qos=1)
                    wait_s = AGAIN_S[0]
                    self._published.clear()
                    await self._publish(client, "", ONLINE)
                    try:
                        async with asyncio.TaskGroup() as tasks:
                            tasks.create_task(self._listen(client))
                            tasks.create_task(self._publish_cars(client))
                    finally:  # the will is for a process that is killed, and for a lost connection
                        with contextlib.suppress(aiomqtt.MqttError):
                            await self._publish(client, "", OFFLINE)
            except* aiomqtt.MqttError as lost:
                broker = self.settings.broker
                self.note(f"{broker.host}:{broker.port}: {lost.exceptions[0]}"[:200])
            await asyncio.sleep(wait_s)
            wait_s = min(2.0 * wait_s, AGAIN_S[1])

    async def _listen(self, client: aiomqtt.Client) -> None:
        mqtt = client._client  # aiomqtt has no way to acknowledge a message when it is stored
        mqtt.manual_ack_set(True)
        async for message in client.messages:
            payload = message.payload if isinstance(message.payload, bytes) else str(message.payload).encode()
            now_s, topic, kept = self._now_s(), message.topic.value, bool(message.retain)
            if topic.endswith(PLAN_TOPIC) and not kept:  # a kept one may be of a trip that has ended
                await self.plan(topic.split("/")[-3], payload)
            for name, joiner in self._joiners.items():
                if topic == joiner.root or topic.startswith(f"{joiner.root}/"):
                    self._received_s[name] = now_s
                    await self._take(name, partial(joiner.take, topic, payload, now_s, retained=kept))
            mqtt.ack(message.mid, message.qos)

    async def _take(self, name: str, read: Callable[[], Sample | None]) -> None:
        answer = await self.take(name, read)
        if answer is not None:
            self._answers[name] = answer

    async def _publish_cars(self, client: aiomqtt.Client) -> None:
        while True:
            await asyncio.sleep(self.every_s)
            for name, joiner in self._joiners.items():
                if self._now_s() - self._received_s[name] >= FLUSH_S:
                    await self._take(name, joiner.flush)
                answer = self._answers.pop(name, None)
                if answer is not None:
                    await self._publish(client, f"/{name}{FAULT_TOPIC}", json.dumps(answer), retain=False)
            if self.settings.publish_to:
                for name, document in (await self.documents()).items():
                    await self._publish_car(client, name, document)
            # `wait_for` of Python 3.11, which the client uses, loses a cancellation that comes with an answer
            task = asyncio.current_task()
            if task is not None and task.cancelling():
                return

    async def _publish_car(self, client: aiomqtt.Client, name: str, document: Mapping[str, Any]) -> None:
        """Publish a car if its document changed; without a change, publish it every `AGE_S` to update its age."""
        now_s, lasting = self._now_s(), {**document, "seconds_since_message": None}
        previous = self._published.get(name)
        if previous is not None and previous[0] == lasting and now_s < previous[1] + AGE_S:
            return
        if previous is None and self.settings.announce_below:
            for topic, message in discovery(name, self.settings.publish_to, self.settings.announce_below):
                await client.publish(topic, json.dumps(message), qos=1, retain=True)
        self._published[name] = lasting, now_s
        await self._publish(client, f"/{name}", json.dumps(document))

    async def _publish(self, client: aiomqtt.Client, below: str, text: str, *, retain: bool = True) -> None:
        if self.settings.publish_to:
            await client.publish(f"{self.settings.publish_to}{below}", text, qos=1, retain=retain)

    def _client(self) -> aiomqtt.Client:
        """Return a client for which the broker keeps messages while it is disconnected."""
        import aiomqtt

        broker, topic = self.settings.broker, self.settings.publish_to
        return aiomqtt.Client(
            broker.host,
            broker.port,
            username=broker.username,
            password=broker.password,
            identifier=f"tripwatt-{topic or ','.join(self._joiners)}",
            clean_session=False,
            tls_context=ssl.create_default_context() if broker.encrypted else None,
            will=aiomqtt.Will(topic, OFFLINE, qos=1, retain=True) if topic else None,
            keepalive=KEEP_ALIVE_S,
        )
