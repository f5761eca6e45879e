"""The worker pool: an idle worker process takes the next job; a worker that ends or hangs is replaced.

A job is a pure function of its input. When its worker is lost, another worker runs it again. The event loop itself reads and
writes the socket of each worker: an executor passes a job through two threads, which takes longer than all else that the
service does for it.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import pickle
import socket
from collections.abc import Callable, Coroutine, Iterable
from multiprocessing.process import BaseProcess
from typing import Any, Final, NamedTuple
from weakref import WeakValueDictionary

from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Settings
from tripwatt.server.http.sharing import CLIENT, Places
from tripwatt.server.http.worker import answer_calls, run_in_worker

MAX_ATTEMPTS: Final = 3
"""Most workers that one job may lose (a choice): without a bound, a job that crashes its worker would end all workers."""

LONG: Final = ("cars.", "journey", "plan", "reach", "night", "new_car")
"""Beginnings of kinds of jobs that may take `Limits.timeout_s`: files of logs, roads of routers, fleets; the others have `Limits.compute_s`."""

CHECK_S: Final = 1.0
CHECK_TIMEOUT_S: Final = 60.0
"""Time between two checks of idle workers, and longest wait for the answer of one, which a busy machine may delay [s]. Choices."""


async def cancel_all(tasks: Iterable[asyncio.Task[Any]]) -> None:
    """Cancel tasks and wait for their end.

    Parameters
    ----------
    tasks : iterable of Task
        Tasks to cancel; those that have ended stay as they are.

    Examples
    --------
    >>> asyncio.run(cancel_all([]))
    """
    listed = list(tasks)
    for task in listed:
        task.cancel()
    await asyncio.gather(*listed, return_exceptions=True)


class JobResult(NamedTuple):
    """Result of a job.

    Attributes
    ----------
    status : int
        HTTP status.
    content : bytes
        The document as JSON: the response, or a problem document. The bytes of a tile.
    seconds : float
        Computing time [s].
    """

    status: int
    content: bytes
    seconds: float


class Worker(NamedTuple):
    """A process that runs one call after the other, and the two directions of the socket to it."""

    process: BaseProcess
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    @classmethod
    async def start(cls, *needed: Any) -> Worker:
        """Start a process with the arguments of `worker.answer_calls` after the socket."""
        ours, theirs = socket.socketpair()
        process = multiprocessing.get_context("spawn").Process(target=answer_calls, args=(theirs, *needed))
        with theirs:
            process.start()
        return cls(process, *await asyncio.open_connection(sock=ours))

    async def call(self, work: Callable[..., Any], *args: Any) -> Any:
        """Return the result of a function in the process; raise EOFError or OSError if the process ends before."""
        self.writer.write(pickle.dumps((work, args)))
        length = await self.reader.readuntil()
        return pickle.loads(await self.reader.readexactly(int(length)))


class WorkerPool:
    """All worker processes of a service.

    Parameters
    ----------
    settings : Settings
    log : callable
        Called with the name of an event of a worker and its details as keywords.

    Attributes
    ----------
    places : Places
        Places in the queue, by client: those that are taken are the jobs that wait for a worker.
    lost : int
        Workers lost since the start.
    """

    def __init__(self, settings: Settings, log: Callable[..., None]) -> None:
        self.settings = settings
        self.log = log
        self.places = Places(settings.limits.waiting, "too many requests wait", {"Retry-After": "1"})
        self.lost = 0
        # the worker that was busy last has its code and its models in the caches of its core
        self._idle: asyncio.LifoQueue[Worker] = asyncio.LifoQueue()
        # only the first job of each client waits for a worker itself, so that clients take turns
        self._lines: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        self._workers: dict[Worker, int] = {}
        self._tasks: set[asyncio.Task[Any]] = set()

    @property
    def ready(self) -> int:
        """Number of workers that run and have loaded their models."""
        return len(self._workers)

    async def start(self) -> None:
        """Start all workers and wait until they are ready.

        Raises
        ------
        OSError, EOFError
            When a process does not start, or ends before it is ready.
        """
        await asyncio.gather(*map(self._start_worker, range(self.settings.workers)))
        self._keep_task(self._check_idle())

    async def stop(self) -> None:
        """End all workers. Requests that still wait for a job have to be finished before."""
        await cancel_all(self._tasks)
        for worker in self._workers:
            worker.process.kill()
            worker.process.join()
        self._workers.clear()

    async def run(self, job: dict[str, Any], body: bytes, *, may_queue: bool = False) -> JobResult:
        """Run a job on the next idle worker.

        Parameters
        ----------
        job : dict
            `kind` and the parameters of the job, see `Jobs.run`.
        body : bytes
        may_queue : bool
            Whether the job may wait although too many jobs of its client wait already.

        Raises
        ------
        Problem
            `busy` when too many jobs wait, `timeout` when it takes too long, `internal` when its workers are lost.
        """
        limits, clock = self.settings.limits, asyncio.get_running_loop().time
        is_long = job["kind"].startswith(LONG)
        longest_s = limits.timeout_s if is_long else min(limits.compute_s, limits.timeout_s)
        try:
            async with asyncio.timeout(limits.timeout_s):
                for attempt in range(MAX_ATTEMPTS):
                    with self.places.held(may_exceed=may_queue or attempt > 0):
                        async with self._lines.setdefault(CLIENT.get(), asyncio.Lock()):
                            worker = await self._idle.get()
                    # a cancelled request leaves the worker with a job that it has to finish
                    task = self._keep_task(self._run_on(worker, longest_s, run_in_worker, job, body))
                    begun_s, result = clock(), await asyncio.shield(task)
                    if result is not None:
                        return JobResult(*result)
                    if clock() - begun_s >= longest_s:
                        raise Problem("timeout", f"longer than {longest_s:g} s")
        except TimeoutError:
            raise Problem("timeout", f"longer than {limits.timeout_s:g} s") from None
        raise Problem("internal", "the computation ended without a result")

    async def _run_on(self, worker: Worker, timeout_s: float, work: Callable[..., Any], *args: Any) -> Any:
        """Run `work` on a worker and return its result; return None if the worker ended, or was killed because it hung."""
        timer = asyncio.get_running_loop().call_later(timeout_s, worker.process.kill)
        try:
            result = await worker.call(work, *args)
        except (OSError, EOFError):
            worker.writer.close()
            self.lost += 1
            self.log(event="worker lost", pid=worker.process.pid)
            self._keep_task(self._replace(self._workers.pop(worker)))
            return None
        finally:
            timer.cancel()
        self._idle.put_nowait(worker)
        return result

    async def _check_idle(self) -> None:
        """Replace idle workers that ended, before a job needs them."""
        while True:
            await asyncio.sleep(CHECK_S)
            for _ in range(self._idle.qsize()):
                self._keep_task(self._run_on(self._idle.get_nowait(), CHECK_TIMEOUT_S, os.getpid))

    def _keep_task(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Run and hold a task until it is done; asyncio itself holds a weak reference."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _start_worker(self, number: int) -> None:
        settings = self.settings
        needed = dict(settings.models), settings.limits, settings.atlas, settings.cars
        worker = await Worker.start(number, settings.workers, *needed)
        await worker.call(os.getpid)
        self._workers[worker] = number
        self._idle.put_nowait(worker)

    async def _replace(self, number: int) -> None:
        while True:
            try:
                await self._start_worker(number)
            except (OSError, EOFError) as error:
                self.log(event="worker did not start", error=repr(error))
                await asyncio.sleep(5.0)  # so that a lasting cause does not fill the log
            else:
                self.log(event="worker started", ready=self.ready)
                return
