"""Following a car over MQTT: its messages into a `LiveCar`, and the forecast of its trip again every few seconds."""

from __future__ import annotations

import asyncio
import json
import ssl
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote, urlsplit

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.live.discovery import discovery
from tripwatt.live.live_car import LiveCar
from tripwatt.live.telemetry import Sample
from tripwatt.live.topics import TopicJoiner
from tripwatt.live.usual import road_of
from tripwatt.routes import plan_from_links
from tripwatt.trips import Plan
from tripwatt.trips.schema import require_fraction

if TYPE_CHECKING:
    import aiomqtt

PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
"""Scheme of a URL -> usual port; `mqtts` is encrypted."""

AGAIN_S: Final = (1.0, 60.0)
"""First and longest wait before a broker that was lost is asked again [s]."""

FLUSH_S: Final = 2.0
"""A sample is complete when nothing came for so long [s]."""

QUANTILES: Final = (0.05, 0.5, 0.95)


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
            raise InvalidInput(
                Fault("not a broker", "--mqtt", got, "mqtt://HOST[:PORT] or mqtts://HOST[:PORT]")
            )
        username = None if parts.username is None else unquote(parts.username)
        given = None if parts.password is None else unquote(parts.password)
        return cls(
            parts.hostname, port or PORTS[parts.scheme], username, given or password, parts.scheme == "mqtts"
        )


@dataclass(eq=False)
class LiveForecaster:
    """The forecast of the trip of one car, made at its departure and updated on the way.

    Attributes
    ----------
    model : ForecastModel
        Of the car.
    plan : Plan or None
        Without one, each trip is forecast on the road of the car's usual trip at this time of day. What the plan leaves
        unknown of the departure is what the car's messages show.
    reserve : float
        Displayed state of charge to keep.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import tripwatt as tw
    >>> from tripwatt.live import Sample, open_live_car
    >>> plan = tw.read_route(b'[{"length_m": 3000, "speed_m_s": 12}]')
    >>> forecaster = LiveForecaster(tw.load_model("bmw_i3_tum"), plan)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     car = open_live_car(Path(folder, "i3"))
    ...     _ = car.add(Sample(1.7e9, {"speed_m_s": 0.0, "displayed_soc": 0.8}))
    ...     print(forecaster.at_departure(car).plan.departure.soc, forecaster.document(car)["plan"])
    ...     car.close()
    0.8 given
    """

    model: ForecastModel
    plan: Plan | None = None
    reserve: float = 0.1
    _made: tuple[Any, Forecast] | None = None
    _usual: Plan | None = None

    def __post_init__(self) -> None:
        require_fraction("reserve", self.reserve)

    def at_departure(self, car: LiveCar) -> Forecast | None:
        """Make the forecast at the departure, again only when more is known of it.

        Parameters
        ----------
        car : LiveCar
            The car on its trip.

        Returns
        -------
        Forecast or None
            None without a plan.
        """
        plan = self._plan_of(car)
        if plan is None:
            return None
        departure = car.departure().merge(plan.departure)
        made_of = plan.trip_id, departure
        if self._made is None or self._made[0] != made_of:
            self._made = made_of, self.model.forecast(replace(plan, departure=departure))
        return self._made[1]

    def _plan_of(self, car: LiveCar) -> Plan | None:
        """The plan that was given, else the road of the usual trip."""
        if self.plan is not None:
            return self.plan
        usual = car.usual_trip()
        if usual is None:
            return None
        if self._usual is None or self._usual.trip_id != usual.trip_id:
            road = road_of(usual)
            self._usual = None if road is None else plan_from_links(road, trip_id=usual.trip_id)
        return self._usual

    def document(self, car: LiveCar) -> dict[str, Any]:
        """Describe the forecast given what was measured, and why it lacks the last messages.

        Parameters
        ----------
        car : LiveCar
            The car on its trip.

        Returns
        -------
        dict
            Plain values as the service gives them: `plan`, `usual_trip`, `forecast` and `faults`.
        """
        forecast, faults = None, []
        try:
            forecast = self.at_departure(car)
            forecast = None if forecast is None else car.update(forecast)
        except InvalidInput as error:
            faults = [fault_fields(fault) for fault in error.faults]
        usual = None if self.plan is not None or forecast is None else forecast.plan.trip_id
        return {
            "plan": None if forecast is None else "given" if usual is None else "usual",
            "usual_trip": usual,
            "forecast": None if forecast is None else self._shown(forecast),
            "faults": faults,
        }

    def _shown(self, forecast: Forecast) -> dict[str, Any]:
        return {
            "energy_wh": forecast.energy_wh,
            "quantiles_wh": {f"{p:g}": forecast.quantile(p) for p in QUANTILES},
            "soc_arrival": forecast.soc_arrival,
            "soc_quantiles": {f"{p:g}": forecast.soc_quantile(p) for p in QUANTILES},
            "reserve": self.reserve,
            "p_arrive": forecast.p_arrive(self.reserve),
            "p_arrive_at_all": forecast.p_arrive(),
            "measured_until_s": forecast.measured_until_s,
        }


def fault_fields(fault: Fault) -> dict[str, str]:
    """The fields of a fault that are not empty."""
    return {name: text for name, text in asdict(fault).items() if text}


@dataclass(eq=False)
class Follower:
    """Follows one car over MQTT until it is cancelled.

    Attributes
    ----------
    car : LiveCar
        The car that sends.
    joiner : TopicJoiner
        Makes samples of its messages.
    show : callable
        Called with the state of the car and the forecast after new messages.
    forecaster : LiveForecaster, optional
        Without one, trips are kept and not forecast. It loses its plan when the trip of it has ended.
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
    >>> from tripwatt.live import open_live_car
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     car = open_live_car(Path(folder, "leaf"))
    ...     follower = Follower(car, TopicJoiner("teslamate", "teslamate/cars/1"), show=print)
    ...     print(follower.document(1.7e9)["forecast"])
    ...     car.close()
    None
    >>> asyncio.run(follower.follow(Broker.from_url("mqtt://127.0.0.1")))  # doctest: +SKIP
    """

    car: LiveCar
    joiner: TopicJoiner
    show: Callable[[dict[str, Any]], None]
    forecaster: LiveForecaster | None = None
    every_s: float = 5.0
    publish_to: str = ""
    announce_below: str = ""
    note: Callable[[str], None] = lambda _: None
    _received: float = 0.0
    _on_trip: bool = False

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
                async with _client(broker, f"tripwatt-{self.car.name}") as client:
                    await client.subscribe(self.joiner.filter, qos=1)
                    wait_s = AGAIN_S[0]
                    await self._announce(client)
                    await self._run(client)
            except aiomqtt.MqttError as error:
                self.note(f"{broker.host}:{broker.port}: {error}"[:200])
            await asyncio.sleep(wait_s)
            wait_s = min(2.0 * wait_s, AGAIN_S[1])

    async def _run(self, client: aiomqtt.Client) -> None:
        """Listen and report until one of the two ends."""
        tasks = [asyncio.ensure_future(self._listen(client)), asyncio.ensure_future(self._report(client))]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

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
            self._look_for_the_end(now_s)
            if self.car.counts["new"] != shown:
                shown = self.car.counts["new"]
                document = self.document(now_s)
                self.show(document)
                if self.publish_to:
                    await client.publish(self.publish_to, json.dumps(document), qos=1, retain=True)

    def _look_for_the_end(self, now_s: float) -> None:
        """End the trip of a car that is silent, and forget the plan of a trip that has ended."""
        try:
            self.car.end_when_silent(now_s)
        except OSError as error:
            self.note(f"trip not stored: {error}"[:200])
        if self._on_trip and self.car.trip is None and self.forecaster is not None:
            self.forecaster.plan = None
        self._on_trip = self.car.trip is not None

    def document(self, now_s: float) -> dict[str, Any]:
        """Describe the state of the car and the forecast of its trip.

        Parameters
        ----------
        now_s : float
            The time by our clock [s since 1970].

        Returns
        -------
        dict
            Plain values: what `LiveCar.about` and `LiveForecaster.document` give.
        """
        found = self.car.about(now_s)
        if self.forecaster is None:
            return {**found, "plan": None, "usual_trip": None, "forecast": None, "faults": []}
        return found | self.forecaster.document(self.car)


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
