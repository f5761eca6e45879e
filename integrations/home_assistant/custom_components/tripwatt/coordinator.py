"""What the service knows of its cars, as it streams it; asked again and again only while there is no stream."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Iterable
from contextlib import aclosing
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, TypeAlias

from homeassistant.config_entries import ConfigEntry
from homeassistant.const import CONF_TOKEN, CONF_URL
from homeassistant.core import HomeAssistant
from homeassistant.exceptions import ConfigEntryAuthFailed
from homeassistant.helpers.aiohttp_client import async_get_clientsession
from homeassistant.helpers.debounce import Debouncer
from homeassistant.helpers.update_coordinator import DataUpdateCoordinator, UpdateFailed

from .client import ServiceAwayError, ServiceClient, ServiceProblemError, TokenRefusedError
from .const import (
    AGAIN_S,
    AHEAD_EVERY_S,
    CONF_CALENDARS,
    CONF_INTERVAL,
    CONF_PLUG,
    CONF_PROBABILITY,
    CONF_RESERVE,
    CONF_WEATHER,
    DOMAIN,
    INTERVAL_S,
    NEWS_S,
    PROBABILITY,
)
from .trips import CalendarTrip, next_trip
from .weather import temperature_degc

_LOGGER = logging.getLogger(__name__)

JOURNEY_FIELDS = "soc_needed,leave,verdict,p_arrive,flags"
"""What is read of a journey; without its roads it is short."""

AIR = "ambient_temperature_degc"

TripwattEntry: TypeAlias = "ConfigEntry[TripwattCoordinator]"


@dataclass(slots=True)
class Ahead:
    """What lies before a car: the trip of its calendar, what the next trip needs, and how far the charge carries."""

    made_of: tuple[Any, ...]
    trip: CalendarTrip | None
    need: dict[str, Any] | None
    reach: dict[str, Any] | None


@dataclass(slots=True)
class CarState:
    """A car as the service has it, and what lies before it."""

    live: dict[str, Any]
    described: bool
    """whether the service keeps a description of the car, and with it a model"""
    ahead: Ahead
    read_s: float
    """when it was read, on the clock that only goes on [s]"""

    @property
    def silence_s(self) -> float | None:
        """Time since the last message of the car, which grows without news [s]."""
        then_s: float | None = self.live["seconds_since_message"]
        return None if then_s is None else then_s + time.monotonic() - self.read_s

    @property
    def known(self) -> dict[str, Any]:
        """What a journey has of the car: its charge, the outside temperature, and its own model where there is one."""
        named = {"car": self.live["car"]} if self.described else {}
        return {"soc": self.live["soc"], AIR: self.live[AIR], **named}


class TripwattCoordinator(DataUpdateCoordinator[dict[str, CarState]]):
    """The cars of one service, by name.

    Parameters
    ----------
    hass : HomeAssistant
    entry : ConfigEntry
    """

    config_entry: TripwattEntry

    def __init__(self, hass: HomeAssistant, entry: TripwattEntry) -> None:
        interval = timedelta(seconds=entry.options.get(CONF_INTERVAL, INTERVAL_S))
        super().__init__(
            hass,
            _LOGGER,
            config_entry=entry,
            name=DOMAIN,
            update_interval=interval,
            request_refresh_debouncer=Debouncer(hass, _LOGGER, cooldown=NEWS_S, immediate=True),
        )
        session = async_get_clientsession(hass)
        self.client = ServiceClient(session, entry.data[CONF_URL], entry.data.get(CONF_TOKEN, ""))
        self._has_map: bool | None = None
        self.has_weather = False
        self._lives: dict[str, tuple[dict[str, Any], float]] = {}
        self._described: set[str] = set()
        self._is_open = False  # the stream

    async def listen(self) -> None:
        """Take the states of the cars as the service streams them. A stream that ends is opened again; meanwhile the service is asked."""
        while True:
            try:
                async with aclosing(self.client.events()) as events:
                    async for live in events:
                        self._is_open = True
                        if live:
                            await self._take(live)
            except (ServiceAwayError, ServiceProblemError, TokenRefusedError) as error:
                _LOGGER.debug("no stream: %s", error)
            was_open, self._is_open = self._is_open, False
            if was_open:
                await self.async_refresh()
            assert self.update_interval is not None
            interval_s = self.update_interval.total_seconds()
            await asyncio.sleep(AGAIN_S if was_open and self.last_update_success else interval_s)

    async def _take(self, live: dict[str, Any]) -> None:
        if live["car"] not in self._lives:
            await self._ask_descriptions()
        self._lives[live["car"]] = live, time.monotonic()
        await self.async_request_refresh()

    async def _async_update_data(self) -> dict[str, CarState]:
        try:
            return await self._cars()
        except TokenRefusedError as error:
            raise ConfigEntryAuthFailed(translation_domain=DOMAIN, translation_key="token_refused") from error
        except (ServiceAwayError, ServiceProblemError) as error:
            raise UpdateFailed(
                translation_domain=DOMAIN,
                translation_key="away",
                translation_placeholders={"why": str(error)},
            ) from error

    async def _cars(self) -> dict[str, CarState]:
        if not self._is_open:
            lives = (await self.client.get("/v1/live"))["cars"]
            self._lives = {live["car"]: (live, time.monotonic()) for live in lives}
            await self._ask_descriptions()
        if self._has_map is None:
            known = await self.client.get("/v1/map")
            self._has_map, self.has_weather = known["roads"], known["weather"]
        before = self.data or {}
        return {name: await self._car(name, before.get(name)) for name in sorted(self._lives)}

    async def _ask_descriptions(self) -> None:
        self._described = {row["name"] for row in (await self.client.get("/v1/cars"))["cars"] or ()}

    async def _car(self, name: str, earlier: CarState | None) -> CarState:
        live, read_s = self._lives[name]
        described, before = name in self._described, None if earlier is None else earlier.ahead
        source = self.config_entry.options.get(CONF_CALENDARS, {}).get(live["car"])
        trip = None if source is None else await next_trip(self.hass, source)
        air_degc = await self.air_degc(trip)
        made_of = (
            live["messages"]["new"],
            live["soc"],
            live["trip"] is None,
            live["plan"],
            live["forecast"],  # of another plan, it is another one
            live["usual_trip"],
            live[AIR],
            trip,
            air_degc,
            time.time() // AHEAD_EVERY_S,
        )
        if before is not None and before.made_of == made_of:
            return CarState(live, described, before, read_s)
        state = CarState(live, described, Ahead(made_of, trip, None, None), read_s)
        try:
            if live["trip"] is None:
                state.ahead.need = await self.need(state, trip)
            if live["soc"] is not None:
                state.ahead.reach = await self._or_none("/v1/range", ("invalid-input",), car=live["car"])
        except (
            ServiceAwayError
        ) as error:  # too busy for a forecast: the state of the cars counts all the same
            _LOGGER.debug("%s: %s", live["car"], error)
            state.ahead.made_of = ()
        return state

    async def _or_none(self, path: str, kinds: Iterable[str], **parameters: Any) -> dict[str, Any] | None:
        """An answer, or None where the service refuses for one of these kinds of problems."""
        try:
            answer: dict[str, Any] = await self.client.get(path, **parameters)
        except ServiceProblemError as problem:
            if problem.kind not in kinds:
                raise
            _LOGGER.debug("%s: %s", path, problem)
            return None
        return answer

    async def air_degc(self, trip: CalendarTrip | None) -> float | None:
        """The outside temperature of the weather entity at the departure of a trip, or now; None without an entity that has one."""
        entity = self.config_entry.options.get(CONF_WEATHER)
        if entity is None:
            return None
        return await temperature_degc(self.hass, entity, None if trip is None else trip.starts_at)

    async def need(self, car: CarState, trip: CalendarTrip | None) -> dict[str, Any] | None:
        """What the next trip needs, with the fields of `GET /v1/need`; those that are not known are missing.

        A trip with a place that the map has is a journey from home, one with kilometres is a distance, and any other is
        the plan of the car or the trip that it usually drives at that time of day. The answer has the outside temperature that counts as
        `temperature`.
        """
        air_degc = await self.air_degc(trip)
        need = await self._need(car, trip, air_degc)
        if need is None:
            return None
        assumed = [
            flag["value"] for flag in need["flags"] if flag["subject"] == AIR and flag["unit"] == "degc"
        ]
        return {"temperature": air_degc if air_degc is not None else next(iter(assumed), None), **need}

    async def _need(
        self, car: CarState, trip: CalendarTrip | None, air_degc: float | None
    ) -> dict[str, Any] | None:
        """`need` with an outside temperature; None for that of the car, or the weather of the service."""
        options = self.config_entry.options
        chance = options.get(CONF_PROBABILITY, PROBABILITY) / 100.0
        reserve = options.get(CONF_RESERVE)
        share = None if reserve is None else reserve / 100.0
        kept = {"reserve": share, "plug_w": options.get(CONF_PLUG), AIR: air_degc}
        name, leaves = car.live["car"], None if trip is None else trip.starts_at.isoformat()
        if trip is not None and trip.place and self._has_map:
            journey = await self._journey(car, trip, share, air_degc)
            if journey is not None:
                return journey
        if trip is not None and trip.distance_km is not None:
            return await self._or_none(
                "/v1/need",
                ("invalid-input",),
                distance_km=trip.distance_km,
                probability=chance,
                departs_at=leaves,
                car=name,
                **kept,
            )
        return await self._or_none(
            "/v1/need",
            ("no-plan", "no-such-car", "invalid-input"),
            car=name,
            probability=chance,
            departs_at=leaves,
            **kept,
        )

    async def _journey(
        self, car: CarState, trip: CalendarTrip, reserve: float | None, air_degc: float | None
    ) -> dict[str, Any] | None:
        """The need of a trip from home to its place; None where the map has no such place."""
        body = {
            **car.known,
            "stops": [self.home, trip.place],
            "departs_at": trip.starts_at.isoformat(),
            "reserve": reserve,
        }
        if air_degc is not None or self.has_weather:
            body[AIR] = air_degc  # else that of the car
        try:
            journey = await self.client.post("/v1/journeys", body, fields=JOURNEY_FIELDS)
        except ServiceProblemError as problem:
            _LOGGER.debug("%s: %s", trip.place, problem)
            return None
        return {
            "kind": "journey",
            "energy_wh": journey["verdict"]["energy_wh"],
            "soc_needed": journey["soc_needed"],
            "target_soc": min(1.0, journey["soc_needed"]),
            "message": journey["leave"],
            "departs_at": trip.starts_at.isoformat(),
            "p_arrive": journey["p_arrive"],
            "flags": journey["flags"],
        }

    @property
    def home(self) -> dict[str, Any]:
        """The home of Home Assistant as a place of a request."""
        config = self.hass.config
        return {
            "latitude_deg": config.latitude,
            "longitude_deg": config.longitude,
            "name": config.location_name,
        }


def parsed_time(text: str | None) -> datetime | None:
    """A time of the service; it has its offset."""
    return None if text is None else datetime.fromisoformat(text)
