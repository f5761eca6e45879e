"""Cars on the road: their messages, the plan of their trip, its forecast, and a stream of forecasts for listeners.

One thread does all work on cars, so that the event loop reads no file and no two threads use the same car. A worker forecasts a
plan before it is set: a plan that takes too long or crashes is refused there.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property, partial
from hmac import compare_digest
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar

import anyio
import orjson
from sse_starlette import EventSourceResponse, ServerSentEvent

from tripwatt.errors import InvalidInput, did_you_mean, or_none
from tripwatt.forecasting import ForecastModel
from tripwatt.roads.advice import Companion, Message
from tripwatt.server.cars import Car, Sample, has_token, is_car
from tripwatt.server.cars.folder import digest_of, token_digest
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.pool import JobResult, WorkerPool, cancel
from tripwatt.server.http.problems import Problem, fault_document
from tripwatt.server.http.seen import undescribed
from tripwatt.server.http.settings import Settings
from tripwatt.trips.messages import flag_to_dict

SILENCE_CHECK_S: Final = 30.0
"""Time between two checks for cars that became silent [s]."""

KEEP_ALIVE_S: Final = 15.0
"""A stream without events sends a comment after this time [s], so that no proxy closes the stream."""

STREAM_END_S: Final = 5.0
"""Time that streams have to end with the service [s]."""

CAR_FIELDS: Final = ("model", "vehicle", "vehicle_figures")
"""Fields of a request that name a car or a model."""

Given = ParamSpec("Given")
Result = TypeVar("Result")


class LiveCars:
    """The cars of a folder and the forecasts of their trips.

    Parameters
    ----------
    settings : Settings
        The cars in sub-folders of `cars` with a token are followed, and so are the cars of `mqtt`.
    pool : WorkerPool
    log : callable
        Called with one record of the log as keywords.

    Attributes
    ----------
    cars : dict of str to Car
        The cars that are followed, by name.
    listeners : int
        Streams that are open.
    learn : callable
        Called with the name of a car that has finished a trip.

    Raises
    ------
    InvalidInput
        When there is no such folder, or a car with a token cannot be opened.
    """

    def __init__(self, settings: Settings, pool: WorkerPool, log: Callable[..., None]) -> None:
        self.settings, self.pool, self.log = settings, pool, log
        self.cars: dict[str, Car] = {}
        self.listeners = 0
        self.learn: Callable[[str], None] = lambda name: None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._digests: dict[str, str] = {}
        self._companions: dict[str, Companion] = {}
        self._thread = ThreadPoolExecutor(1, "cars")
        folder = settings.cars
        if folder is None or not folder.is_dir():
            fix = "make it; cars are made in it on the page or by `tripwatt car new`"
            raise InvalidInput.of("no folder of cars", "--cars", f"{folder}", "a folder", fix)
        over_mqtt = {} if settings.mqtt is None else settings.mqtt.cars
        for name in sorted({place.name for place in folder.iterdir() if has_token(place)} | {*over_mqtt}):
            self._open(folder / name)

    async def run(self, work: Callable[Given, Result], *args: Given.args, **more: Given.kwargs) -> Result:
        """Call `work` in the thread of the cars, and return its result."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, partial(work, *args, **more))

    def _open(self, place: Path) -> None:
        name = place.name
        if name not in self.cars:
            keep_days = self.settings.keep_days
            car = Car.follow(place, lambda request: self._model(name, request), keep_days=keep_days)
            car.note = lambda text: self.log(event="forecast not stored", vehicle=name, error=text)
            car.finished = partial(self._finished, name)
            self.cars[name] = car
        self._digests[name] = token_digest(place) or ""

    def _finished(self, name: str) -> None:
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self.learn, name)

    async def follow(self, place: Path) -> None:
        """Follow the car of a folder; if it is followed already, only read its token again.

        Raises
        ------
        InvalidInput
            When the car cannot be opened.
        """
        await self.run(self._open, place)

    async def drop(self, name: str) -> None:
        """Close a car and stop following it."""
        self._digests.pop(name, None)
        self._companions.pop(name, None)
        car = self.cars.pop(name, None)
        if car is not None:
            await self.run(car.close)

    def by_name(self, name: str) -> Car:
        """Return the followed car of this name.

        Raises
        ------
        Problem
            `no-such-car`.
        """
        if name not in self.cars:
            hint = did_you_mean(name, self.cars) or "GET /v1/live lists the cars on the road"
            raise Problem("no-such-car", hint)
        return self.cars[name]

    def by_token(self, token: str) -> Car:
        """Return the car with this token. Digests are compared, each in constant time. O(cars).

        Raises
        ------
        Problem
            `token-needed`.
        """
        given = digest_of(token)
        name = next((name for name, digest in self._digests.items() if compare_digest(given, digest)), None)
        if name is None:
            challenge = {"WWW-Authenticate": 'Bearer realm="tripwatt"'}
            raise Problem("token-needed", "the token of a car: `token`, or a bearer token", headers=challenge)
        return self.cars[name]

    async def take(self, car: Car, sample: Sample) -> dict[str, Any]:
        """Store a message of a car.

        Returns
        -------
        dict
            As `TelemetryResponse`.

        Raises
        ------
        InvalidInput
            For a message that is too late to count.
        Problem
            `busy` if the message cannot be stored.
        """
        try:
            arrival = await self.run(car.record, sample)
        except OSError as error:
            raise self._not_stored("message", car, error) from error
        if arrival == "late":
            allowed = "the time of a message that fits the trip"
            fix = "send messages in the order of their times"
            raise InvalidInput.of("message too late", "utc", f"{sample.time_s:.3f}", allowed, fix)
        ignored = [fault_document(fault) for fault in sample.faults]
        return {
            "status": "held" if arrival == "held" else "ok",
            "car": car.name,
            "arrival": arrival,
            "ignored": ignored,
        }

    async def set_plan(self, car: Car, plan: dict[str, Any], departure_s: float | None) -> JobResult:
        """Set the plan of a car's trip, if the plan can be forecast.

        Parameters
        ----------
        car : Car
        plan : dict
            A `ForecastRequest`.
        departure_s : float or None
            Departure [s since 1970].

        Returns
        -------
        JobResult
            Result of the forecast at departure; the plan is set if the status is 200.
        """
        checked = await self.pool.run({"kind": "forecast"}, orjson.dumps(self.by_own_model(car.name, plan)))
        if checked.status == 200:
            try:
                await self.run(car.set_plan, plan, departure_s)
            except OSError as error:
                raise self._not_stored("plan", car, error) from error
        return checked

    def _not_stored(self, what: str, car: Car, error: OSError) -> Problem:
        self.log(event=f"{what} not stored", vehicle=car.name, error=f"{error}"[:200])
        return Problem("busy", f"the {what} cannot be stored; send it again", headers={"Retry-After": "10"})

    async def document(self, car: Car) -> dict[str, Any]:
        """Return a car with the latest forecast of its trip and the latest message, as `LiveResponse`."""
        return await self.run(self._document, car)

    def _document(self, car: Car) -> dict[str, Any]:
        document = car.document(car.now_s())
        message = None if document["faults"] else or_none(self._told, car)
        told = None if message is None else message.to_dict()
        named = _names_car(self.by_own_model(car.name, {} if car.plan is None else car.plan.request))
        flags = [] if named else [flag_to_dict(undescribed(car.name, self._model(car.name, {}).vehicle))]
        return {**document, "flags": flags, "message": told}

    def _told(self, car: Car) -> Message | None:
        """Return the latest message on the trip of a car; each forecast at departure gets a companion of its own."""
        departing = car.at_departure()
        if departing is None or car.trip is None:
            return None
        companion = self._companions.get(car.name)
        if companion is None or companion.departure is not departing:
            plan = car.plan
            reserve = None if plan is None else plan.request.get("reserve")
            companion = Companion(departing, car.reserve if reserve is None else reserve)
            self._companions[car.name] = companion
        observed = car.observed(departing.plan.start_s)
        if len(observed) > 1:
            companion.hear(observed, car.updated)
        return companion.last

    def by_own_model(self, name: str, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return a request; if it names no car or model and the car has a model of its own, add the name of this model."""
        cars = self.settings.cars
        own = not _names_car(request) and cars is not None and is_car(cars / name)
        return {**request, "model": name} if own else dict(request)

    def _model(self, name: str, request: Mapping[str, Any]) -> ForecastModel:
        return self._jobs.model_named(self.by_own_model(name, request))

    @cached_property
    def _jobs(self) -> Jobs:
        """The same models as in the workers, loaded when a car first needs one."""
        settings = self.settings
        return Jobs.from_folders(settings.models, settings.limits, cars=CarJobs(settings.cars))

    async def need(self, car: Car, how: Mapping[str, float], known: Mapping[str, float]) -> JobResult:
        """Return what the next trip of a car needs, as `NeedResponse`.

        Parameters
        ----------
        car : Car
        how : mapping of str to float
            `probability`, 0.5 to 1; `departure_s`, when it leaves [s since 1970]; `plug_w`, power of the plug [W].
        known : mapping of str to float
            Fields of the request that replace those of the plan.

        Raises
        ------
        Problem
            `no-plan` if there is neither a plan nor a usual trip.
        """
        plan = await self.run(car.plan_at, how["departure_s"])
        if plan is None:
            raise Problem("no-plan", "no plan, and no earlier trip at this time of day")
        soc = await self.run(car.shown_soc) if car.trip is None else None
        asked = await self.job_of(car, {**plan.request, **known})
        seen = {**asked["seen"], "soc": None}  # only the charge of the plan counts
        result = await self.pool.run(
            {"kind": "need", "how": {**how, "soc": soc}, "seen": seen}, asked["body"]
        )
        if result.status != 200:
            return result
        needed = {
            "car": car.name,
            "plan": "given" if plan.usual_trip is None else "usual",
            "usual_trip": plan.usual_trip,
            "probability": how["probability"],
            **orjson.loads(result.content),
        }
        return replace(result, content=orjson.dumps(needed))

    async def job_of(self, car: Car, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters of a job about a car: `body` is the request with the own model, `seen` what the last messages show."""
        asked = self.by_own_model(car.name, request)
        seen = {
            "soc": await self.run(car.shown_soc),
            "ambient_temperature_degc": car.last_air_degc(car.now_s()),
            "undescribed": None if _names_car(asked) else car.name,
        }
        return {"body": orjson.dumps(asked), "seen": seen}

    async def job_without_road(self, car: Car, known: Mapping[str, Any]) -> dict[str, Any]:
        """Return `job_of` for the range of a car or the need of a distance; a car that the plan names replaces the own model."""
        asked = {} if car.plan is None else {name: car.plan.request.get(name) for name in CAR_FIELDS}
        if asked.get("vehicle_figures") is not None:
            asked["vehicle_figures"] = orjson.dumps(asked["vehicle_figures"]).decode()
        return await self.job_of(car, {**asked, **known})

    def summary(self) -> dict[str, Any]:
        """Return the cars, as `LiveCarsResponse`."""
        rows = (car.shown(car.now_s()) for _, car in sorted(self.cars.items()))
        cars = [
            {
                "car": row["car"],
                "seconds_since_message": row["seconds_since_message"],
                "on_trip": row["trip"] is not None,
            }
            for row in rows
        ]
        return {"cars": cars}

    def stream(self, car: Car) -> EventSourceResponse:
        """Return the forecasts of a car as a stream of server-sent events.

        Raises
        ------
        Problem
            `busy` if there are too many listeners already.
        """
        if self.listeners >= self.settings.limits.listeners:
            raise Problem("busy", "too many listeners", headers={"Retry-After": "30"})
        ending = anyio.Event()
        return EventSourceResponse(
            self.events(car, ending),
            headers={"Content-Encoding": "identity"},  # a compressed stream would wait for more
            sep="\n",
            ping=KEEP_ALIVE_S,
            ping_message_factory=lambda: ServerSentEvent(comment="no news", sep="\n"),
            shutdown_event=ending,
            shutdown_grace_period=STREAM_END_S,
        )

    async def events(self, car: Car, ending: anyio.Event) -> AsyncIterator[ServerSentEvent]:
        """Yield documents of a car as events: one at once, then one after each change, until the service or the following ends.

        Yields
        ------
        ServerSentEvent
            An event `live` whose data is a `LiveResponse`.
        """
        self.listeners += 1
        sent: tuple[Any, ...] | None = None
        try:
            while not ending.is_set() and self.cars.get(car.name) is car:
                if sent != car.live_state:
                    sent = car.live_state
                    data = orjson.dumps(await self.document(car)).decode()
                    yield ServerSentEvent(data, event="live", sep="\n")
                with anyio.move_on_after(self.settings.limits.live_every_s):
                    await ending.wait()
        finally:
            self.listeners -= 1

    async def watch(self) -> None:
        """End the trips of cars that became silent, and make the forecasts that diaries keep, until this is cancelled."""
        while True:
            for car in [*self.cars.values()]:
                try:
                    await self.run(_watched, car)
                except OSError as error:
                    self._not_stored("trip", car, error)
                except Exception as error:  # the other cars are watched all the same
                    self.log(event="bug", vehicle=car.name, error=repr(error)[:200])
            await asyncio.sleep(SILENCE_CHECK_S)

    @contextlib.asynccontextmanager
    async def running(self, *work: Awaitable[None]) -> AsyncIterator[None]:
        """Watch the cars and await `work` meanwhile; close the cars at the end."""
        self._loop = asyncio.get_running_loop()
        tasks = [asyncio.ensure_future(one) for one in (self.watch(), *work)]
        try:
            yield
        finally:
            await cancel(tasks)
            self.close()

    def close(self) -> None:
        """Close the cars, so that another process can follow them."""
        self._thread.shutdown()
        for car in self.cars.values():
            car.close()


def _watched(car: Car) -> None:
    """End the trip of a car that is silent; otherwise make its forecast if one is due for the diary."""
    if not car.end_when_silent(car.now_s()) and car.wants_forecast:
        car.document(car.now_s())


def _names_car(request: Mapping[str, Any]) -> bool:
    return any(request.get(field) is not None for field in (*CAR_FIELDS, "car"))
