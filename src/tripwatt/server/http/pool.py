"""The worker pool: an idle worker process takes the next job; a worker that ends or hangs is replaced.

A job is a pure function of its input. When its worker is lost, another worker runs it again.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any, Final

from tripwatt.server.http.frames import encode_frame, read_frame_async
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import TOKEN_VARIABLE, Settings

START_TIMEOUT_S: Final = 120.0
"""Longest time that a worker may take to load its models."""

STOP_TIMEOUT_S: Final = 5.0
"""Longest time that a worker may take to end by itself."""

MAX_ATTEMPTS: Final = 4
"""Workers that may be lost with one job before the client has to ask again."""

MAX_CRASHES: Final = 2
"""Workers that may crash in one job before the job fails: it is probably the cause, and would end every worker."""

KILL_SIGNALS: Final = (-signal.SIGKILL, -signal.SIGTERM) if sys.platform != "win32" else ()
"""Return codes of a worker that was ended from outside, by an operator or for want of memory."""

FIRST_RESTART_DELAY_S: Final = 0.1
MAX_RESTART_DELAY_S: Final = 10.0
"""Delay before another start, after several that failed."""


async def cancel(tasks: Iterable[asyncio.Task[Any]]) -> None:
    """Cancel tasks and wait for their end.

    Parameters
    ----------
    tasks : iterable of Task
        Those that have ended stay as they are.

    Examples
    --------
    >>> asyncio.run(cancel([]))
    """
    listed = list(tasks)
    for task in listed:
        task.cancel()
    await asyncio.gather(*listed, return_exceptions=True)


@dataclass(frozen=True, slots=True)
class JobResult:
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


class WorkerLost(Exception):
    """The worker ended or was killed before the job was done.

    Parameters
    ----------
    crashed : bool
        Whether it ended by itself, so that the job may be the cause.
    """

    def __init__(self, *, crashed: bool = False) -> None:
        super().__init__()
        self.crashed = crashed


class Worker:
    """The service's handle of one worker process.

    Parameters
    ----------
    process : asyncio.subprocess.Process
    """

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process

    @classmethod
    async def start(cls, settings: Settings) -> Worker:
        """Start a process and wait until it is ready.

        Raises
        ------
        OSError, WorkerLost, TimeoutError
            When the process does not start, ends, or is not ready in time.
        """
        libraries = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        libraries["ARROW_DEFAULT_MEMORY_POOL"] = "system"  # the others reserve a gigabyte at their start
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "tripwatt.server.http.worker",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            env={**{k: v for k, v in os.environ.items() if k != TOKEN_VARIABLE}, **libraries},
            start_new_session=True,
        )
        worker = cls(process)
        models = {name: str(folder) for name, folder in settings.models.items()}
        first = {
            "models": models,
            "limits": asdict(settings.limits),
            "atlas": asdict(settings.atlas),
            "cars": None if settings.cars is None else str(settings.cars),
        }
        first_frame = encode_frame(first, b"")
        try:
            async with asyncio.timeout(START_TIMEOUT_S):
                await worker._exchange(first_frame)
        except BaseException:
            await worker.kill()
            raise
        return worker

    async def run(self, frame: bytes) -> JobResult:
        """Send a job and wait for its result.

        Raises
        ------
        WorkerLost
            When the process ends first.
        """
        head, content = await self._exchange(frame)
        return JobResult(head["status"], content, head["seconds"])

    async def _exchange(self, frame: bytes) -> tuple[dict[str, Any], bytes]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            self.process.stdin.write(frame)
            await self.process.stdin.drain()
            return await read_frame_async(self.process.stdout)
        except (asyncio.IncompleteReadError, ConnectionError) as error:
            code = await self.process.wait()
            raise WorkerLost(crashed=code not in KILL_SIGNALS) from error

    async def kill(self) -> None:
        """Kill the process and wait for its end."""
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        await self.process.wait()

    async def stop(self) -> None:
        """Close the input of the process and wait for its end; kill it after `STOP_TIMEOUT_S`."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            async with asyncio.timeout(STOP_TIMEOUT_S):
                await self.process.wait()
        except TimeoutError:
            await self.kill()


class WorkerPool:
    """All worker processes of a service.

    Parameters
    ----------
    settings : Settings
    log : callable
        Called with the name of an event of a worker and its details as keywords.

    Attributes
    ----------
    waiting : int
        Jobs that wait for a worker.
    lost : int
        Workers lost since the start.
    """

    def __init__(self, settings: Settings, log: Callable[..., None]) -> None:
        self.settings = settings
        self.log = log
        self.waiting = 0
        self.lost = 0
        self._idle: asyncio.Queue[Worker] = asyncio.Queue()
        self._workers: set[Worker] = set()
        self._tasks: set[asyncio.Task[Any]] = set()

    @property
    def ready(self) -> int:
        """Number of workers that run and have loaded their models."""
        return len(self._workers)

    async def start(self) -> None:
        """Start all workers and wait until they are ready."""
        await asyncio.gather(*(self._start_worker() for _ in range(self.settings.workers)))

    async def stop(self) -> None:
        """Stop all workers. Requests that still wait for a job have to be finished before."""
        await cancel(self._tasks)
        await asyncio.gather(*(worker.stop() for worker in list(self._workers)))
        self._workers.clear()

    async def run(self, job: dict[str, Any], body: bytes, *, may_queue: bool = False) -> JobResult:
        """Run a job on the next idle worker.

        Parameters
        ----------
        job : dict
            `kind` and the parameters of the job, see `Jobs.run`.
        body : bytes
        may_queue : bool
            Whether the job may wait although `Limits.waiting` jobs wait already.

        Raises
        ------
        Problem
            `busy` when too many jobs wait or its workers were ended from outside, `timeout` when it takes too long,
            `internal` when it crashes its workers.
        """
        limits = self.settings.limits
        if not may_queue and self.waiting >= limits.waiting:
            raise Problem("busy", "too many requests wait", headers={"Retry-After": "1"})
        frame, crashes = encode_frame(job, body), 0
        try:
            async with asyncio.timeout(limits.timeout_s):
                for _ in range(MAX_ATTEMPTS):
                    worker = await self._next_idle()
                    # a cancelled request leaves the worker with a job that it has to finish
                    task = self._keep_task(asyncio.ensure_future(self._run_on(worker, frame)))
                    try:
                        return await asyncio.shield(task)
                    except WorkerLost as lost:
                        crashes += lost.crashed
                        if crashes >= MAX_CRASHES:
                            raise Problem("internal", "the computation ended without a result") from lost
        except TimeoutError:
            raise Problem("timeout", f"longer than {limits.timeout_s:g} s") from None
        raise Problem("busy", "the workers were ended; try again", headers={"Retry-After": "1"})

    async def _next_idle(self) -> Worker:
        self.waiting += 1
        try:
            while True:
                worker = await self._idle.get()
                if worker in self._workers:
                    return worker
        finally:
            self.waiting -= 1

    async def _run_on(self, worker: Worker, frame: bytes) -> JobResult:
        try:
            async with asyncio.timeout(self.settings.limits.timeout_s):
                result = await worker.run(frame)
        except TimeoutError as error:
            self.log(event="worker hung", pid=worker.process.pid)
            await worker.kill()
            raise WorkerLost from error
        except BaseException:
            await worker.kill()
            raise
        self._idle.put_nowait(worker)
        return result

    def _keep_task(self, task: asyncio.Task[Any]) -> asyncio.Task[Any]:
        """Hold a reference to a task until it is done; asyncio itself holds a weak one."""
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _start_worker(self) -> None:
        worker = await Worker.start(self.settings)
        self._workers.add(worker)
        self._idle.put_nowait(worker)
        self._keep_task(asyncio.ensure_future(self._replace_when_lost(worker)))

    async def _replace_when_lost(self, worker: Worker) -> None:
        code = await worker.process.wait()
        self._workers.discard(worker)
        self.lost += 1
        self.log(event="worker lost", pid=worker.process.pid, code=code)
        delay_s = FIRST_RESTART_DELAY_S
        while True:
            try:
                await self._start_worker()
            except (OSError, WorkerLost, TimeoutError) as error:
                self.log(event="worker did not start", error=repr(error))
                await asyncio.sleep(delay_s)
                delay_s = min(2.0 * delay_s, MAX_RESTART_DELAY_S)
            else:
                self.log(event="worker started", ready=self.ready)
                return
