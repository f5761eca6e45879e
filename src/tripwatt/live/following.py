"""Following a car over MQTT: its messages become samples of a `RoadCar`, which is described again every few seconds."""

from __future__ import annotations

import asyncio
import json
import ssl
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final
from urllib.parse import unquote, urlsplit

from tripwatt.errors import InvalidInput
from tripwatt.live.discovery import discovery
from tripwatt.live.documents import LiveDocument
from tripwatt.live.road_car import RoadCar
from tripwatt.live.telemetry import Sample
from tripwatt.live.topics import TopicJoiner

if TYPE_CHECKING:
    import aiomqtt

PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
"""Scheme of a URL -> usual port; `mqtts` is encrypted."""

AGAIN_S: Final = (1.0, 60.0)
"""First and longest wait before a broker that was lost is asked again [s]."""

FLUSH_S: Final = 2.0
"""A sample is complete when nothing came for so long [s]."""


@dataclass(frozen=True, slots=True)
class Broker:
    """Where an MQTT broker is.

    Attributes
    ----------
    host : str
        Name or address.
    port : int
        Of TCP.
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
            With the scheme `mqtt` or `mqtts`.
        password : str, optional
            For a URL without one.

        Returns
        -------
        Broker
            With the usual port of the scheme where the URL has none.

        Raises
        ------
        InvalidInput
            When it is none.

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
        username = None if parts.username is None else unquote(parts.username)
        given = None if parts.password is None else unquote(parts.password)
        return cls(
            parts.hostname, port or PORTS[parts.scheme], username, given or password, parts.scheme == "mqtts"
        )


@dataclass(eq=False)
class Follower:
    """Follows one car over MQTT until it is cancelled.

    Attributes
    ----------
    car : RoadCar
        The car that sends; with a model, its trips are forecast.
    joiner : TopicJoiner
        Makes samples of its messages.
    show : callable
        Called with `RoadCar.document` at first, and after new messages.
    every_s : float
        Shortest time between two forecasts [s].
    publish_to : str
        Topic for the same as JSON; empty for none.
    announce_below : str
        Prefix of topics below which Home Assistant finds what is published; empty for none.
    note : callable
        Called with a sentence when the broker is lost or a message is not stored.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from tripwatt.live import RoadCar
    >>> with tempfile.TemporaryDirectory() as folder, RoadCar(Path(folder, "leaf")) as car:
    ...     print(Follower(car, TopicJoiner("teslamate", "teslamate/cars/1"), show=print).every_s)
    5.0
    >>> asyncio.run(follower.follow(Broker.from_url("mqtt://127.0.0.1")))  # doctest: +SKIP
    """

    car: RoadCar
    joiner: TopicJoiner
    show: Callable[[LiveDocument], None]
    every_s: float = 5.0
    publish_to: str = ""
    announce_below: str = ""
    note: Callable[[str], None] = lambda _: None
    _received: float = 0.0

    def __post_init__(self) -> None:
        self.car.note = self.note

    async def follow(self, broker: Broker) -> None:
        """Follow the car; a broker that is lost is asked again, for as long as it takes.

        Parameters
        ----------
        broker : Broker
            That the car sends to.
        """
        import aiomqtt  # an extra

        wait_s = AGAIN_S[0]
        while True:
            try:
                async with (
                    _client(broker, f"tripwatt-{self.car.name}") as client,
                    asyncio.TaskGroup() as tasks,
                ):
                    await client.subscribe(self.joiner.filter, qos=1)
                    wait_s = AGAIN_S[0]
                    await self._announce(client)
                    tasks.create_task(self._listen(client))
                    tasks.create_task(self._report(client))
            except* aiomqtt.MqttError as lost:
                self.note(f"{broker.host}:{broker.port}: {lost.exceptions[0]}"[:200])
            await asyncio.sleep(wait_s)
            wait_s = min(2.0 * wait_s, AGAIN_S[1])

    async def _announce(self, client: aiomqtt.Client) -> None:
        if not (self.publish_to and self.announce_below):
            return
        for topic, message in discovery(self.car.name, self.publish_to, self.announce_below):
            await client.publish(topic, json.dumps(message), qos=1, retain=True)

    async def _listen(self, client: aiomqtt.Client) -> None:
        async for message in client.messages:
            payload = message.payload if isinstance(message.payload, bytes) else str(message.payload).encode()
            self._received = time.time()
            sample = self.joiner.take(
                message.topic.value, payload, self._received, retained=bool(message.retain)
            )
            self._take(sample)

    def _take(self, sample: Sample | None) -> None:
        if sample is None:
            return
        try:
            self.car.add(sample)
        except (InvalidInput, OSError) as error:
            self.note(f"message not stored: {error}"[:200])

    async def _report(self, client: aiomqtt.Client) -> None:
        shown = -1
        while True:
            await asyncio.sleep(self.every_s)
            now_s = time.time()
            if now_s - self._received >= FLUSH_S:
                self._take(self.joiner.flush())
            try:
                self.car.end_when_silent(now_s)
            except OSError as error:
                self.note(f"trip not stored: {error}"[:200])
            if self.car.counts["new"] != shown:
                shown = self.car.counts["new"]
                document = self.car.document(now_s)
                self.show(document)
                if self.publish_to:
                    await client.publish(self.publish_to, json.dumps(document), qos=1, retain=True)


def _client(broker: Broker, identifier: str) -> aiomqtt.Client:
    """A client whose messages the broker keeps while it is away."""
    import aiomqtt

    return aiomqtt.Client(
        broker.host,
        broker.port,
        username=broker.username,
        password=broker.password,
        identifier=identifier,
        clean_session=False,
        tls_context=ssl.create_default_context() if broker.encrypted else None,
    )
