"""The endpoints of users' cars: made, shown, given logs, erased.

This process stores uploads and keeps track of what is learned; workers read, audit and learn.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final

import orjson
from fastapi import Path as PathValue
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.errors import Fault, or_none
from tripwatt.server.cars import is_car, open_car
from tripwatt.server.http.answering import Answering, json_response
from tripwatt.server.http.car_jobs import car_folder, read_progress, require_folder
from tripwatt.server.http.car_schemas import (
    NAME_PATTERN,
    CarResponse,
    CarsResponse,
    Forgotten,
    LogsRequest,
    LogsResponse,
    NewCarRequest,
    TokenResponse,
    UploadResponse,
)
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.openapi import BINARY, BYTES, operation
from tripwatt.server.http.pool import JobResult, WorkerPool, cancel
from tripwatt.server.http.problems import Problem, invalid_input

UPLOAD: Final = "/v1/cars/{car}/uploads/{upload}"
UPLOAD_PATTERN: Final = "^[a-z0-9]{8,32}$"
MAX_PLACES: Final = 4
"""Most files that arrive and wait to be unpacked; further ones are refused."""

FIRST_DELAY_S: Final = 30.0
MAX_DELAY_S: Final = 3600.0
"""Delay before a car that could not learn is tried again: doubled each time, up to the longest."""

CarName = Annotated[str, PathValue(pattern=NAME_PATTERN, description="name of the car")]
UploadName = Annotated[
    str, PathValue(pattern=UPLOAD_PATTERN, description="name of the upload, chosen by the client")
]
FileName = Annotated[str, PathValue(min_length=1, max_length=200, description="name of the file")]


@dataclass(eq=False)
class Learning:
    """The learning of trips by a car: the current run, or the last one.

    Attributes
    ----------
    upload : str
        Empty for trips that the car finished on the road.
    task : asyncio.Task
    result : JobResult or None
        None while the learning runs.
    """

    upload: str = ""
    task: asyncio.Task[None] | None = None
    result: JobResult | None = None


class CarOperations:
    """The endpoints of cars; each raises the problem `no-live` if the service has no folder of cars.

    Parameters
    ----------
    answering : Answering
        Its pool shows cars and reads logs.
    live : callable
        Returns the cars on the road; its exceptions are passed on.
    log : callable
        As in `WorkerPool`.

    Attributes
    ----------
    learners : WorkerPool
        One worker, started with the first upload that is learned; its jobs may take minutes.
    learning : dict
        Name of a car -> its current or last `Learning`.
    """

    def __init__(self, answering: Answering, live: Callable[[], LiveCars], log: Callable[..., None]) -> None:
        self.answering, self.live, self.settings = answering, live, answering.settings
        limits = replace(self.settings.limits, timeout_s=self.settings.limits.learn_s)
        self.learners = WorkerPool(replace(self.settings, workers=1, limits=limits), log)
        self.learning: dict[str, Learning] = {}
        self._started = False
        # cars that may have finished a trip, and the tasks that learn these trips
        self._news: set[str] = set()
        self._teaching: dict[str, asyncio.Task[None]] = {}
        self._places, self._unpacking = asyncio.Semaphore(MAX_PLACES), asyncio.Lock()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Learn trips that cars finish on the road, until the service stops; what was learned by then is kept."""
        if self.settings.cars is not None:
            self.live().learn = self.learn_soon
            for (
                place
            ) in self.settings.cars.iterdir():  # a trip may have ended right before the last service did
                self.learn_soon(place.name)
        try:
            yield
        finally:
            await cancel(self._teaching.values())  # first, because they start to learn
            await cancel(one.task for one in self.learning.values() if one.task is not None)
            if self._started:
                await self.learners.stop()

    def learn_soon(self, car: str) -> None:
        """Learn the trips that a car has finished on the road, as soon as possible."""
        self._news.add(car)
        if car not in self._teaching:
            self._teaching[car] = asyncio.ensure_future(self._teach(car))

    async def _teach(self, car: str) -> None:
        delay_s = FIRST_DELAY_S
        while car in self._news:
            self._news.discard(car)
            if await asyncio.to_thread(or_none, self._has_news, car) and not await self.learn_finished(car):
                await asyncio.sleep(delay_s)
                delay_s = min(2.0 * delay_s, MAX_DELAY_S)
                self._news.add(car)
        del self._teaching[car]

    def _has_news(self, car: str) -> bool:
        place = require_folder(self.settings.cars) / car
        return is_car(place) and open_car(place).has_news

    @operation("GET /v1/cars", "cars", CarsResponse)
    async def list_cars(self, request: Request) -> Response:
        """List the cars."""
        return await self.answering.job(request, "cars.list")

    @operation("POST /v1/cars", "cars", CarResponse, NewCarRequest)
    async def new_car(self, request: Request) -> Response:
        """Make a car."""
        return _shown(await self.answering.body_job(request, "new_car"), None)

    @operation("GET /v1/cars/{car}", "cars", CarResponse)
    async def get_car(self, request: Request, car: CarName) -> Response:
        """Return a car, what it learned, and its diary."""
        learning = self._learning(car)  # before: what is done by then is shown
        return _shown(await self.answering.job(request, "cars.show", name=car), learning)

    @operation("DELETE /v1/cars/{car}", "cars", Forgotten)
    async def forget_car(self, request: Request, car: CarName) -> Response:
        """Erase a car: its trips, its model, its diary, and what it sent."""
        self._require_idle(car)
        with contextlib.suppress(Problem):
            await self.live().drop(car)
        response = await self.answering.job(request, "cars.forget", name=car)
        self.learning.pop(car, None)
        return response

    @operation("POST /v1/cars/{car}/token", "cars", TokenResponse)
    async def new_token(self, request: Request, car: CarName) -> Response:
        """Make a token with which a car sends its messages; an earlier one is no longer accepted."""
        response = await self.answering.job(request, "cars.token", name=car)
        if response.status_code == 200:
            await self.live().follow(car_folder(self.settings.cars, car))
        return response

    @operation(f"PUT {UPLOAD}/{{file}}", "cars", UploadResponse, {BYTES: BINARY})
    async def put_file(self, request: Request, car: CarName, upload: UploadName, file: FileName) -> Response:
        """Add a file of logs to an upload: a table, a workbook, or an archive of them."""
        car_folder(self.settings.cars, car)  # before the file arrives
        if self._places.locked():
            raise Problem("busy", "too many files are unpacked", headers={"Retry-After": "2"})
        async with self._places:
            limits, place = self.settings.limits, {"name": car, "upload": upload, "file": file}
            content = await self.answering.read(request, (BYTES,), limits.upload_bytes)
            async with self._unpacking:  # one worker unpacks, the others go on
                return await self.answering.job(
                    request, "cars.store", content, **place, max_bytes=limits.car_bytes
                )

    @operation(f"POST {UPLOAD}", "cars", LogsResponse, LogsRequest)
    async def read_logs(self, request: Request, car: CarName, upload: UploadName) -> Response:
        """Return how the tables of an upload are read, and what the audit says of them; nothing is learned."""
        return await self.answering.body_job(request, "cars.logs", name=car, upload=upload)

    @operation(f"POST {UPLOAD}/learn", "cars", CarResponse, LogsRequest)
    async def learn(self, request: Request, car: CarName, upload: UploadName) -> Response:
        """Learn the trips of an upload: the response comes at once, and the car shows the progress."""
        body = await self.answering.read(request)
        checked = await self.answering.job(request, "cars.logs", body, name=car, upload=upload)
        if checked.status_code != 200:
            return checked
        faults = orjson.loads(checked.body)["faults"]
        if faults:
            raise invalid_input(
                [Fault(**{"where": "logs", **{k: v for k, v in fault.items() if v}}) for fault in faults]
            )
        self._require_idle(car)
        self._start(Learning(upload), {"kind": "cars.learn", "name": car, "upload": upload}, body)
        return await self.get_car(request, car)

    async def learn_finished(self, car: str) -> bool:
        """Learn the trips that a car finished on the road, unless the car is learning already.

        Returns
        -------
        bool
            Whether the trips were learned.
        """
        if self._is_learning(car):
            return False
        learning = Learning()
        await asyncio.gather(
            self._start(learning, {"kind": "cars.learn_finished", "name": car}), return_exceptions=True
        )
        return learning.result is not None and learning.result.status == 200

    def _start(self, learning: Learning, job: dict[str, Any], body: bytes = b"") -> asyncio.Task[None]:
        self.learning[job["name"]] = learning
        learning.task = asyncio.ensure_future(self._learn(learning, job, body))
        return learning.task

    async def _learn(self, learning: Learning, job: dict[str, Any], body: bytes) -> None:
        try:
            if not self._started:
                self._started = True
                try:
                    await self.learners.start()
                except (OSError, BrokenProcessPool) as error:
                    self._started = False
                    raise Problem("busy", "no worker started", headers={"Retry-After": "30"}) from error
            learning.result = await self.learners.run(job, body, may_queue=True)
        except Problem as problem:
            learning.result = JobResult(problem.status, orjson.dumps(problem.document()), 0.0)

    def _is_learning(self, car: str) -> bool:
        return car in self.learning and self.learning[car].result is None

    def _require_idle(self, car: str) -> None:
        if self._is_learning(car):
            raise Problem("busy", "the car is learning", headers={"Retry-After": "5"})

    def _learning(self, car: str) -> dict[str, Any] | None:
        """Return what a car learns or learned last, as `LearningDocument`; None if it has not learned yet."""
        learning = self.learning.get(car)
        if learning is None:
            return None
        nothing = dict.fromkeys(("added", "known", "entries", "flat")) | {"left_out": [], "faults": []}
        if learning.result is None:
            done, total = read_progress(require_folder(self.settings.cars) / car, learning.upload)
            return {"state": "running", "done": done, "total": total, **nothing}
        document: Mapping[str, Any] = orjson.loads(learning.result.content)
        if learning.result.status != 200:
            faults = document.get("faults") or [{"what": document["title"], "where": "logs"}]
            return {"state": "failed", "done": 0, "total": None, **nothing, "faults": faults}
        entries = document["entries"]
        return {"state": "done", "done": entries, "total": entries, **document, "faults": []}


def _shown(response: Response, learning: Mapping[str, Any] | None) -> Response:
    """Return the response with a car's document, completed by what the car learns."""
    if response.status_code != 200:
        return response
    return json_response({**orjson.loads(response.body), "learning": learning})
