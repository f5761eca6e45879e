"""The learning of trips by users' cars: this process keeps track of it, and one worker learns."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from typing import Any, Final

import orjson

from tripwatt.errors import or_none
from tripwatt.server.cars.folder import open_car
from tripwatt.server.http.car_jobs import read_progress, require_folder
from tripwatt.server.http.pool import JobResult, WorkerPool, cancel_all
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Settings

FIRST_DELAY_S: Final = 30.0
MAX_DELAY_S: Final = 3600.0
"""Delay before a car that could not learn is tried again: doubled each time, up to the longest. A choice: a full disk is emptied, or a
broken worker started again, within minutes or by hand."""


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


class LearningCars:
    """The cars of a service that learn.

    Parameters
    ----------
    settings : Settings
    log : callable
        As in `WorkerPool`.

    Attributes
    ----------
    learners : WorkerPool
        One worker, started when a car learns for the first time; its jobs may take minutes.
    by_car : dict of str to Learning
        Name of a car -> its current or last learning.
    """

    def __init__(self, settings: Settings, log: Callable[..., None]) -> None:
        self.settings = settings
        limits = replace(settings.limits, timeout_s=settings.limits.learn_s)
        self.learners = WorkerPool(replace(settings, workers=1, limits=limits), log)
        self.by_car: dict[str, Learning] = {}
        self._started = False
        # cars that may have finished a trip, and the tasks that learn these trips
        self._news: set[str] = set()
        self._teaching: dict[str, asyncio.Task[None]] = {}

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Learn trips that cars finish on the road, until the service stops; what was learned by then is kept."""
        # a trip may have ended right before the last service did
        for folder in require_folder(self.settings.cars).iterdir():
            self.learn_soon(folder.name)
        try:
            yield
        finally:
            await cancel_all(self._teaching.values())  # before the others, because they start to learn
            await cancel_all(learning.task for learning in self.by_car.values() if learning.task is not None)
            await self.learners.stop()

    def learn_soon(self, car: str) -> None:
        """Learn the trips that a car has finished on the road, as soon as possible."""
        self._news.add(car)
        if car not in self._teaching:
            self._teaching[car] = asyncio.ensure_future(self._teach(car))

    async def _teach(self, car: str) -> None:
        """Learn the finished trips of a car, and try again later if this fails."""
        delay_s = FIRST_DELAY_S
        while car in self._news:
            self._news.discard(car)
            if await asyncio.to_thread(or_none, self._has_news, car) and not await self.learn_finished(car):
                await asyncio.sleep(delay_s)
                delay_s = min(2.0 * delay_s, MAX_DELAY_S)
                self._news.add(car)
        del self._teaching[car]

    def _has_news(self, car: str) -> bool:
        return open_car(require_folder(self.settings.cars) / car).has_news

    async def learn_finished(self, car: str) -> bool:
        """Learn the trips that a car finished on the road, unless it is learning already; return whether they were learned."""
        if self._is_learning(car):
            return False
        learning = Learning()
        task = self.start(learning, {"kind": "cars.learn_finished", "name": car})
        await asyncio.gather(task, return_exceptions=True)
        return learning.result is not None and learning.result.status == 200

    def start(self, learning: Learning, job: dict[str, Any], body: bytes = b"") -> asyncio.Task[None]:
        """Start a job by which the car `name` of the job learns."""
        self.by_car[job["name"]] = learning
        learning.task = asyncio.ensure_future(self._learn(learning, job, body))
        return learning.task

    async def _learn(self, learning: Learning, job: dict[str, Any], body: bytes) -> None:
        try:
            if not self._started:
                self._started = True
                try:
                    await self.learners.start()
                except (OSError, EOFError) as error:
                    self._started = False
                    raise Problem("busy", "no worker started", headers={"Retry-After": "30"}) from error
            learning.result = await self.learners.run(job, body, may_queue=True)
        except Problem as problem:
            learning.result = JobResult(problem.status, orjson.dumps(problem.document()), 0.0)

    def _is_learning(self, car: str) -> bool:
        return car in self.by_car and self.by_car[car].result is None

    def require_idle(self, car: str) -> None:
        """Check that a car is not learning.

        Raises
        ------
        Problem
            `busy`.
        """
        if self._is_learning(car):
            raise Problem("busy", "the car is learning", headers={"Retry-After": "5"})

    def document(self, car: str) -> dict[str, Any] | None:
        """Return what a car learns or learned last, as `LearningDocument`; None if it has not learned yet."""
        learning = self.by_car.get(car)
        if learning is None:
            return None
        nothing = dict.fromkeys(("added", "known", "entries", "flat")) | {"left_out": [], "faults": []}
        if learning.result is None:
            done, total = read_progress(require_folder(self.settings.cars) / car, learning.upload)
            return {"state": "running", "done": done, "total": total, **nothing}
        document = orjson.loads(learning.result.content)
        if learning.result.status != 200:
            faults = document.get("faults") or [
                {"code": "failed", "what": document["title"], "where": "logs"}
            ]
            return {"state": "failed", "done": 0, "total": None, **nothing, "faults": faults}
        trips = document["entries"]
        return {"state": "done", "done": trips, "total": trips, **document, "faults": []}
