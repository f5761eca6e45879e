"""The worker processes: who is idle gets the next job; who dies or hangs is replaced, and nobody notices.

A job is a pure function of its body, so that one whose worker died is simply given to another.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Final

from tripwatt.service.frames import next_frame, packed
from tripwatt.service.problems import Problem
from tripwatt.service.settings import Settings

START_S: Final = 120.0
"""Longest time that a worker may take to load its models."""

TRIES: Final = 3
"""Workers that a job may lose before it is given up: it may be what kills them."""

FIRST_PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 10.0
"""Pause before another start, after many that failed."""

END_S: Final = 5.0
"""Time that a worker has to end by itself."""


@dataclass(frozen=True, slots=True)
class Reply:
    """What a worker answered."""

    status: int
    content: bytes
    seconds: float


class WorkerLost(Exception):
    """The worker died with the job."""


class Worker:
    """One process, seen from the service."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process

    @classmethod
    async def start(cls, settings: Settings) -> Worker:
        """Start a process and wait until it is ready."""
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "tripwatt.service.worker",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            env={**{k: v for k, v in os.environ.items() if k != "TRIPWATT_TOKEN"}, **threads},
            start_new_session=True,
        )
        worker = cls(process)
        models = {name: str(folder) for name, folder in settings.models.items()}
        try:
            async with asyncio.timeout(START_S):
                await worker._exchange(packed({"models": models, "limits": asdict(settings.limits)}, b""))
        except BaseException:
            await worker.kill()
            raise
        return worker

    async def ask(self, frame: bytes) -> Reply:
        """Give it a job and wait for the answer.

        Raises
        ------
        WorkerLost
            When it dies.
        """
        head, content = await self._exchange(frame)
        return Reply(head["status"], content, head["seconds"])

    async def _exchange(self, frame: bytes) -> tuple[dict[str, Any], bytes]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            self.process.stdin.write(frame)
            await self.process.stdin.drain()
            return await next_frame(self.process.stdout)
        except (asyncio.IncompleteReadError, ConnectionError) as error:
            raise WorkerLost from error

    async def kill(self) -> None:
        """End it now."""
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        await self.process.wait()

    async def end(self) -> None:
        """Let it finish and end."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            async with asyncio.timeout(END_S):
                await self.process.wait()
        except TimeoutError:
            await self.kill()


class Crew:
    """All workers of a service.

    Parameters
    ----------
    settings : Settings
    note : callable
        Told of what happens to workers: an event's name and more about it.
    """

    def __init__(self, settings: Settings, note: Callable[..., None]) -> None:
        self.settings = settings
        self.note = note
        self.waiting = 0
        self._idle: asyncio.Queue[Worker] = asyncio.Queue()
        self._workers: set[Worker] = set()
        self._tasks: set[asyncio.Task[Any]] = set()
        self.lost = 0

    @property
    def ready(self) -> int:
        """Workers that are alive and have their models."""
        return len(self._workers)

    @property
    def idle(self) -> int:
        """Workers without a job."""
        return self._idle.qsize()

    async def start(self) -> None:
        """Start all workers and wait until they are ready."""
        await asyncio.gather(*(self._hire() for _ in range(self.settings.workers)))

    async def stop(self) -> None:
        """End all workers; jobs that run are finished first by those who wait for them."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(worker.end() for worker in list(self._workers)))
        self._workers.clear()

    async def run(self, job: dict[str, Any], body: bytes, *, patient: bool = False) -> Reply:
        """The answer to a job.

        Parameters
        ----------
        job : dict
            `kind` and what else `work` needs to know.
        body : bytes
        patient : bool
            Whether it waits also where many wait already.

        Raises
        ------
        Problem
            `busy` when too many wait, `timeout` when it takes too long, `internal` when it kills its workers.
        """
        if not patient and self.waiting >= self.settings.limits.waiting:
            raise Problem("busy", "try again soon", headers={"Retry-After": "1"})
        frame = packed(job, body)
        try:
            async with asyncio.timeout(self.settings.limits.timeout_s):
                for _ in range(TRIES):
                    worker = await self._next_idle()
                    # a caller that goes away leaves the worker with a job that it has to finish
                    task = self._keep(asyncio.ensure_future(self._work(worker, frame)))
                    try:
                        return await asyncio.shield(task)
                    except WorkerLost:
                        continue
        except TimeoutError:
            raise Problem("timeout", f"longer than {self.settings.limits.timeout_s:g} s") from None
        raise Problem("internal", "the computation ended without an answer")

    async def _next_idle(self) -> Worker:
        self.waiting += 1
        try:
            while True:
                worker = await self._idle.get()
                if worker in self._workers:
                    return worker
        finally:
            self.waiting -= 1

    async def _work(self, worker: Worker, frame: bytes) -> Reply:
        try:
            async with asyncio.timeout(self.settings.limits.timeout_s):
                reply = await worker.ask(frame)
        except TimeoutError as error:
            self.note("worker hung", pid=worker.process.pid)
            await worker.kill()
            raise WorkerLost from error
        except BaseException:
            await worker.kill()
            raise
        self._idle.put_nowait(worker)
        return reply

    def _keep(self, task: asyncio.Task[Any]) -> asyncio.Task[Any]:
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _hire(self) -> None:
        worker = await Worker.start(self.settings)
        self._workers.add(worker)
        self._idle.put_nowait(worker)
        self._keep(asyncio.ensure_future(self._watch(worker)))

    async def _watch(self, worker: Worker) -> None:
        """Start another worker when this one is gone."""
        code = await worker.process.wait()
        self._workers.discard(worker)
        self.lost += 1
        self.note("worker lost", pid=worker.process.pid, code=code)
        pause = FIRST_PAUSE_S
        while True:
            try:
                await self._hire()
            except (OSError, WorkerLost, TimeoutError) as error:
                self.note("worker did not start", error=repr(error))
                await asyncio.sleep(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE_S)
            else:
                self.note("worker started", ready=self.ready)
                return
