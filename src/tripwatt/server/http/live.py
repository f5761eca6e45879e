"""Cars on the road: their messages, the plan of their trip, its forecast, and a stream of forecasts for listeners.

One thread does all work on cars, so that the event loop reads no file and no two threads use the same car. A worker forecasts a
plan before it is set: a plan that takes too long or crashes is refused there.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, partial
from hmac import compare_digest
from pathlib import Path
from typing import Any, Final, TypeVar

import anyio
import orjson
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.types import Receive, Scope, Send

from tripwatt.errors import Fault, InvalidInput, did_you_mean, or_none
from tripwatt.forecasting import ForecastModel
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import digest_of, setting_of
from tripwatt.server.cars.following import Follower
from tripwatt.server.cars.telemetry import Sample
from tripwatt.server.http.car_jobs import CarJobs, car_folder
from tripwatt.server.http.car_schemas import LivePlanRequest
from tripwatt.server.http.jobs import Jobs, no_description_flag
from tripwatt.server.http.pool import JobResult, WorkerPool, cancel_all
from tripwatt.server.http.problems import CHALLENGE, Problem, placed_document, problem_of
from tripwatt.server.http.schemas import check_request, json_object
from tripwatt.server.http.settings import Settings
from tripwatt.server.http.sharing import Places
from tripwatt.trips.messages import flag_to_dict

SILENCE_CHECK_S: Final = 30.0
"""Time between two checks for cars that became silent [s]. A choice: a trip ends after 10 min of silence."""

FAULT_EVERY_S: Final = 10.0
"""Shortest time between two records in the log of faulty messages of a car [s]. A choice."""

KEEP_ALIVE_S: Final = 15.0
"""A stream without events sends a comment after this time [s], so that no proxy closes the stream: nginx does so after 60 s."""

CAR_FIELDS: Final = ("car", "model")
"""Fields of a request that name a car or a model."""

Result = TypeVar("Result")


class Stream(EventSourceResponse):
    """A stream of events that holds a place as long as it is sent; without a free place it is refused."""

    def __init__(self, places: Places, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self.places = places

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the stream."""
        with self.places.held():
            await super().__call__(scope, receive, send)


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
    listeners : Places
        Open streams, by client.
    learn : callable
        Called with the name of a car that has finished a trip.
    shown : callable
        Returns the document of a car that is published over MQTT.

    Raises
    ------
    InvalidInput
        When there is no such folder.
    """

    def __init__(self, settings: Settings, pool: WorkerPool, log: Callable[..., None]) -> None:
        self.settings, self.pool, self.log = settings, pool, log
        self.cars: dict[str, Car] = {}
        self.listeners = Places(settings.limits.listeners, "too many listeners", {"Retry-After": "30"})
        self.learn: Callable[[str], None] = lambda name: None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._numbers = itertools.count(1)  # of the events
        self._digests: dict[str, bytes] = {}
        self._logged_s: dict[str, float] = {}  # when faults of a car were logged
        self._thread = ThreadPoolExecutor(1, "cars")
        folder = settings.cars
        if folder is None or not folder.is_dir():
            fix = "make it; cars are made in it on the page or by `tripwatt car new`"
            raise InvalidInput.of("no folder of cars", "--cars", f"{folder}", "a folder", fix)
        subscribed = set[str]() if settings.mqtt is None else {*settings.mqtt.cars}
        self._follower: Follower | None = None
        self.shown = self.document
        if settings.mqtt is not None:
            self._follower = Follower(
                settings.mqtt,
                self.take_published,
                self.published,
                self.plan_published,
                lambda text: log(event="mqtt", error=text),
                settings.limits.publish_every_s,
            )
        for name in sorted(subscribed | {car.name for car in CarJobs(folder).folders()}):
            try:
                if name in subscribed or setting_of(folder / name, "token"):
                    self._open(folder / name)
            except Exception as error:  # the other cars are followed all the same
                log(event="car not followed", vehicle=name, error=f"{error}"[:200])

    async def run(self, work: Callable[..., Result], *args: Any) -> Result:
        """Call `work` in the thread of the cars, and return its result."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, work, *args)

    def _open(self, folder: Path) -> None:
        name = folder.name
        if name not in self.cars:
            car = Car.follow(folder, keep_days=self.settings.keep_days)
            car.model_of = partial(self._model, car)
            car.note = lambda text: self.log(event="forecast not stored", vehicle=name, error=text)
            car.finished = partial(self._finished, name)
            self.cars[name] = car
        digest = {name: f"{setting_of(folder, 'token') or ''}".encode()}  # of a damaged car, any value
        is_copy = setting_of(folder, "token_of") not in (None, name)  # with the token of another car
        self._digests = self._digests | digest if is_copy else digest | self._digests | digest

    def _finished(self, name: str) -> None:
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self.learn, name)

    async def follow(self, folder: Path) -> None:
        """Follow the car of a folder; if it is followed already, only read its token again.

        Raises
        ------
        InvalidInput
            When the car cannot be opened.
        """
        await self.run(self._open, folder)

    async def drop(self, name: str) -> None:
        """Close a car and stop following it."""
        self._digests.pop(name, None)
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

    async def known(self, name: str) -> Car:
        """Return the car of this name; one without a token is opened, and has no messages.

        Raises
        ------
        Problem
            `no-such-car`.
        """
        cars, folder = self.cars, self.settings.cars
        return cars[name] if name in cars else await self.run(Car, car_folder(folder, name))

    def by_token(self, token: str) -> Car:
        """Return the car with this token. Digests are compared, each in constant time. O(cars).

        Raises
        ------
        Problem
            `token-needed`.
        """
        sent = digest_of(token).encode()
        names = [name for name, digest in self._digests.items() if compare_digest(sent, digest)]
        if not names:
            raise Problem("token-needed", "the token of a car: `token`, or a bearer token", headers=CHALLENGE)
        return self.cars[names[0]]

    async def take(self, car: Car, read: Callable[[], Sample | None]) -> dict[str, Any]:
        """Store the message of a car that `read` returns, and return the `TelemetryResponse`; an empty one without a message.

        A message that is no sample, or has a value that cannot be one, is counted and logged.

        Raises
        ------
        InvalidInput
            For a message that is no sample, or is too late to count.
        Problem
            `busy` if the message cannot be stored.
        """
        try:
            sample = read()
            arrival = None if sample is None else await self.run(car.record, sample)
        except OSError as error:
            raise self._not_stored("message", car, error) from error
        except InvalidInput as error:
            await self.run(car.count_faulty)
            self._log_faults(car, error.faults)
            raise
        if sample is None:
            return {}
        self._log_faults(car, sample.faults)
        if arrival == "late":
            allowed = "the time of a message that fits the trip"
            fix = "send messages in the order of their times"
            raise InvalidInput.of("message too late", "utc", f"{sample.time_s:.3f}", allowed, fix)
        status, ignored = "held" if arrival == "held" else "ok", map(placed_document, sample.faults)
        return {"status": status, "car": car.name, "arrival": arrival, "ignored": [*ignored]}

    def _log_faults(self, car: Car, faults: Sequence[Fault]) -> None:
        """Log the first fault of a message, for a car at most every `FAULT_EVERY_S`."""
        now_s = car.now_s()
        if faults and now_s >= self._logged_s.get(car.name, 0.0) + FAULT_EVERY_S:
            self._logged_s[car.name] = now_s
            self.log(event="faulty message", vehicle=car.name, error=f"{faults[0]}"[:200])

    async def take_published(self, name: str, read: Callable[[], Sample | None]) -> dict[str, Any] | None:
        """Store what a car sent over MQTT, unless the car was forgotten; return the response of HTTP if something is wrong with it."""
        try:
            answer = await self.take(self.cars[name], read) if name in self.cars else {}
        except (InvalidInput, Problem) as error:
            return problem_of(error).document()
        return answer if answer.get("ignored") else None

    async def plan_published(self, name: str, payload: bytes) -> None:
        """Set the plan that a car got over MQTT; an empty one removes the plan. A plan that is refused is logged."""
        error, most = "", self.settings.limits.body_bytes
        try:
            car = self.by_name(name)
            if len(payload) > most:
                raise Problem("too-large", f"at most {most} bytes")
            if payload:
                result = await self.set_plan(car, json_object(payload))
                error = "" if result.status == 200 else result.content.decode()
            else:
                await self.run(car.set_plan, None)
        except (Problem, InvalidInput) as refused:
            error = f"{refused}"
        if error:
            self.log(event="plan refused", vehicle=name, error=error[:200])

    async def set_plan(self, car: Car, plan: dict[str, Any]) -> JobResult:
        """Set the plan of a car's trip, if the plan can be forecast.

        Parameters
        ----------
        car : Car
        plan : dict
            A `LivePlanRequest`.

        Returns
        -------
        JobResult
            Result of the job that makes the road and the forecast at departure; the plan is set if the status is 200.
        """
        checked = await self.pool.run({"kind": "live_plan"}, orjson.dumps(self.with_own_model(car, plan)))
        if checked.status == 200:
            fields = {**orjson.loads(checked.content), "car": plan.get("car")}
            fields |= fields.pop("departure", None) or {}
            request = {name: value for name, value in fields.items() if value is not None}
            departs_at = check_request({"departs_at": request.get("departs_at")}, LivePlanRequest).departs_at
            try:
                await self.run(car.set_plan, request, departs_at and departs_at.timestamp())
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
        document: dict[str, Any] = {**car.document(car.now_s())}
        document["message"] = None if document["faults"] else or_none(self._message, car)
        if not names_car(self.with_own_model(car, {} if car.plan is None else car.plan.request)):
            document["flags"] = [flag_to_dict(no_description_flag(car.name, self._model(car, {}).vehicle))]
        return document

    def _message(self, car: Car) -> dict[str, Any] | None:
        """Return the latest advice on the trip of a car."""
        departing, companion = car.at_departure(), car.companion
        if departing is None or companion is None or car.trip is None:
            return None
        observed = car.observed(departing.plan.start_s)
        if len(observed) > 1:
            companion.update(observed, car.updated)
        return None if companion.latest is None else companion.latest.to_dict()

    def with_own_model(self, car: Car, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return a request; if it names no car or model, with the name of the car's own model."""
        own = {"car": car.name} if car.is_described and not names_car(request) else {}
        return {**request, **own}

    def _model(self, car: Car, request: Mapping[str, Any]) -> ForecastModel:
        return self._jobs.model_named(self.with_own_model(car, request))

    @cached_property
    def _jobs(self) -> Jobs:
        """The same models as in the workers, loaded when a car first needs one."""
        settings = self.settings
        return Jobs.from_folders(settings.models, settings.limits, cars=settings.cars)

    async def last_message(self, car: Car) -> dict[str, Any]:
        """Return the parameter `last_message` of a job: charge and outside temperature that the last messages of a car show."""
        shown = {"car": car.name, "soc": await self.run(car.shown_soc)}
        return {"last_message": {**shown, "ambient_temperature_degc": car.last_air_degc(car.now_s())}}

    async def published(self) -> dict[str, dict[str, Any]]:
        """Return what is published of each car."""
        return {name: await self.shown(car) for name, car in [*self.cars.items()]}

    def stream(self, car: Car | None) -> EventSourceResponse:
        """Return the forecasts of a car, or of all, as a stream of server-sent events, which is refused if there are too many listeners."""
        ending = anyio.Event()
        return Stream(
            self.listeners,
            self.events(car, ending),
            headers={"Content-Encoding": "identity"},  # a compressed stream would wait for more
            sep="\n",
            ping=KEEP_ALIVE_S,
            ping_message_factory=lambda: ServerSentEvent(comment="no news", sep="\n"),
            shutdown_event=ending,
            shutdown_grace_period=5.0,
        )

    async def events(self, car: Car | None, ending: anyio.Event) -> AsyncIterator[ServerSentEvent]:
        """Yield documents of a car, or of all, as events: one at once, then one after each change, until the service ends or follows one of them no more.

        Yields
        ------
        ServerSentEvent
            An event `live` whose data is a `LiveResponse`.
        """
        sent: dict[str, tuple[Any, ...]] = {}
        while not ending.is_set() and sent.keys() <= self.cars.keys() and car in (None, *self.cars.values()):
            for each in [*self.cars.values()] if car is None else [car]:
                if sent.get(each.name) != each.live_state:
                    sent[each.name] = each.live_state
                    data = orjson.dumps(await self.document(each)).decode()
                    yield ServerSentEvent(data, event="live", id=f"{next(self._numbers)}", sep="\n")
            with anyio.move_on_after(self.settings.limits.live_every_s):
                await ending.wait()

    async def watch(self) -> None:
        """End the trips of cars that became silent, and make the forecasts that diaries keep, until this is cancelled."""
        while True:
            for car in [*self.cars.values()]:
                try:
                    await self.run(_watch_car, car)
                except OSError as error:
                    self._not_stored("trip", car, error)
                except Exception as error:  # the other cars are watched all the same
                    self.log(event="bug", vehicle=car.name, error=repr(error)[:200])
            await asyncio.sleep(SILENCE_CHECK_S)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Watch the cars and follow them over MQTT; close them at the end."""
        self._loop = asyncio.get_running_loop()
        tasks = [asyncio.ensure_future(self.watch())]
        if self._follower is not None:
            tasks.append(asyncio.ensure_future(self._follower.follow()))
        try:
            yield
        finally:
            await cancel_all(tasks)
            self.close()

    def close(self) -> None:
        """Close the cars, so that another process can follow them."""
        self._thread.shutdown()
        for car in self.cars.values():
            car.close()


def _watch_car(car: Car) -> None:
    """End the trip of a car that is silent; otherwise make its forecast if one is due for the diary."""
    if not car.end_when_silent(car.now_s()) and car.wants_forecast:
        car.document(car.now_s())


def names_car(request: Mapping[str, Any]) -> bool:
    """Return whether a request names a car or a model."""
    return any(request.get(field) is not None for field in CAR_FIELDS)
