"""The cars of a service over MQTT: their messages are stored as those over HTTP, and their state is published."""

from __future__ import annotations

import contextlib
import time
from typing import Any, Final

import orjson

from tripwatt.errors import InvalidInput
from tripwatt.roads.advice.preheating import PLUG_W
from tripwatt.server.cars import Car, Follower, MqttSettings, Sample
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.problems import Problem

NEED_S: Final = 600.0
"""Need and range are computed again after this time [s], because usual trips depend on the time of day."""

PROBABILITY: Final = 0.9
"""Probability of the need that is published."""


class OverMqtt:
    """Cars that are followed and published over MQTT.

    Parameters
    ----------
    cars : LiveCars
        All of them are published.
    settings : MqttSettings
        The cars that it names are followed.

    Attributes
    ----------
    follower : Follower

    Raises
    ------
    InvalidInput
        As `Follower`.
    """

    def __init__(self, cars: LiveCars, settings: MqttSettings) -> None:
        self.cars = cars
        self.follower = Follower(
            settings,
            self.take,
            self.documents,
            lambda text: cars.log(event="mqtt", error=text),
            cars.settings.limits.live_every_s,
        )
        # name of a car -> state of which need and range were computed, and need and range
        self._ahead: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {}

    async def take(self, name: str, sample: Sample) -> None:
        """Store a sample of a car, unless the car was forgotten.

        Raises
        ------
        InvalidInput
            For a message that is too late to count.
        """
        with contextlib.suppress(Problem):  # it is logged, and a broker does not send a message again
            if name in self.cars.cars:
                await self.cars.take(self.cars.cars[name], sample)

    async def documents(self) -> dict[str, dict[str, Any]]:
        """Return what is published of each car: its document, what its next trip needs, and how far its charge carries."""
        documents = {}
        for name, car in [*self.cars.cars.items()]:
            document = await self.cars.document(car)
            made_of = (*car.live_state[1:], document["soc"], time.time() // NEED_S)
            if name not in self._ahead or self._ahead[name][0] != made_of:
                ahead = {"need": await self._need(car), "range": await self._range(car, document["soc"])}
                self._ahead[name] = made_of, ahead
            documents[name] = {**document, **self._ahead[name][1]}
        return documents

    async def _need(self, car: Car) -> dict[str, Any] | None:
        """Return what the next trip of a car needs, as `NeedResponse`; None if the car is on a trip or the need is unknown."""
        if car.trip:
            return None
        how = {"probability": PROBABILITY, "departure_s": time.time(), "plug_w": PLUG_W}
        with contextlib.suppress(Problem, InvalidInput):
            result = await self.cars.need(car, how, {})
            return orjson.loads(result.content) if result.status == 200 else None
        return None

    async def _range(self, car: Car, soc: float | None) -> dict[str, Any] | None:
        """Return how far the charge of a car carries, as `RangeResponse`; None if this is unknown."""
        if soc is None:
            return None
        asked = await self.cars.job_without_road(car, {})
        with contextlib.suppress(Problem):
            result = await self.cars.pool.run({"kind": "range", "seen": asked["seen"]}, asked["body"])
            return orjson.loads(result.content) if result.status == 200 else None
        return None
