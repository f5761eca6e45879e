"""The worker pool with workers that only pretend: starts, jobs, losses, restarts and times. `test_process` has real ones."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Callable
from typing import Any

import pytest
from tests.support.virtual_time import elapsed_s, run_jumping

from tripwatt.server.http import pool as room
from tripwatt.server.http.pool import WorkerPool
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Limits, Settings
from tripwatt.server.http.sharing import CLIENT

ANSWER = (200, b"done", 0.5)
JOB = {"kind": "forecast"}

Step = tuple[Any, ...] | float | Exception | None
"""What a worker does with a job: answer, answer after a delay [s], fail or end, or hang."""


class Worker:
    """A worker that follows its steps; it is its own process, which has a number, and its own socket."""

    def __init__(self, pid: int, steps: list[Step]) -> None:
        self.pid, self.steps, self.process, self.writer = pid, steps, self, self
        self.asked: list[tuple[Any, ...]] = []
        self.running: asyncio.Future[Any] | None = None
        self.broken = self.stopped = self.closed = False
        self.killed_s: float | None = None

    def close(self) -> None:
        self.closed = True

    async def call(self, work: Callable[..., Any], *args: Any) -> Any:
        if self.broken:
            raise EOFError
        if work is os.getpid:
            return self.pid
        self.asked.append(args)
        step = self.steps.pop(0) if self.steps else ANSWER
        if isinstance(step, tuple):
            return step
        if isinstance(step, Exception):
            self.broken = True
            raise step
        self.running = asyncio.get_running_loop().create_future()
        if step is not None:
            asyncio.get_running_loop().call_later(step, self.running.set_result, ANSWER)
        return await self.running

    def kill(self) -> None:
        self.killed_s = elapsed_s()
        self.end()

    def end(self) -> None:
        self.broken = True
        if self.running is not None and not self.running.done():
            self.running.set_exception(EOFError())

    def join(self) -> None:
        self.stopped = True


class Workers:
    """Starts such workers in place of the real ones, each with the next steps."""

    def __init__(self, patch: pytest.MonkeyPatch, *steps: list[Step] | Exception) -> None:
        self.steps = list(steps)
        self.made: list[Worker] = []
        self.numbers: list[int] = []
        patch.setattr(room.Worker, "start", self.start)

    async def start(self, number: int, *args: Any) -> Worker:
        self.numbers.append(number)
        steps = self.steps.pop(0) if self.steps else []
        if isinstance(steps, Exception):
            raise steps
        self.made.append(Worker(100 + len(self.made), steps))
        return self.made[-1]


@contextlib.asynccontextmanager
async def running(workers: int = 1, log: Any = lambda **record: None, **limits: Any) -> Any:
    pool = WorkerPool(Settings(workers=workers, limits=Limits(**limits)), log)
    await pool.start()
    yield pool
    await pool.stop()


async def problem_of(pool: WorkerPool, **more: Any) -> Problem:
    with pytest.raises(Problem) as caught:
        await pool.run(JOB, b"", **more)
    return caught.value


async def settled() -> None:
    for _ in range(30):
        await asyncio.sleep(0)


def test_jobs_beyond_the_waiting_ones_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    Workers(monkeypatch, [1.0])

    async def run() -> None:
        async with running(waiting=1) as pool:
            tasks = [asyncio.create_task(pool.run(JOB, b"")) for _ in range(2)]
            await settled()
            assert pool.places.taken.total() == 1
            problem = await problem_of(pool)
            assert (problem.kind, problem.headers) == ("busy", {"Retry-After": "1"})
            tasks.append(asyncio.create_task(pool.run(JOB, b"", may_queue=True)))
            await settled()
            assert pool.places.taken.total() == 2
            assert [result.status for result in await asyncio.gather(*tasks)] == [200] * 3
            assert (pool.places.taken.total(), elapsed_s()) == (0, 1.0)

    run_jumping(run())


@pytest.mark.parametrize("greedy", [3, 30])
def test_clients_take_turns_and_each_finds_a_place(monkeypatch: pytest.MonkeyPatch, greedy: int) -> None:
    """However many jobs other clients send, one more waits for at most one of each; a client takes no more places than it leaves."""
    Workers(monkeypatch, [1.0] * 200)
    ended_s: dict[str, list[float]] = {"first": [], "second": [], "late": []}
    refused: list[str] = []

    async def send(pool: WorkerPool, client: str) -> None:
        CLIENT.set(client)
        try:
            await pool.run(JOB, b"")
        except Problem:
            refused.append(client)
        else:
            ended_s[client].append(elapsed_s())

    async def run() -> None:
        async with running(waiting=24, timeout_s=300.0) as pool:
            tasks = [asyncio.create_task(send(pool, "first")) for _ in range(greedy)]
            await settled()
            tasks += [asyncio.create_task(send(pool, "second")) for _ in range(greedy)]
            await settled()
            await asyncio.sleep(1.5)
            tasks += [asyncio.create_task(send(pool, "late")) for _ in range(2)]
            await asyncio.gather(*tasks)
            assert pool.places.taken.total() == 0

    run_jumping(run())
    assert "late" not in refused
    assert len(ended_s["late"]) == 2
    assert ended_s["late"][0] <= 1.5 + 4.0, "what runs, one of each that waits, and its own"
    assert ended_s["late"][1] - ended_s["late"][0] <= 3.0
    if greedy == 30:
        assert {"first", "second"} == {*refused}
        assert len(ended_s["first"]) == 13, "what runs, and half of the places"
        assert len(ended_s["second"]) == 6, "half of the others"


@pytest.mark.parametrize(
    ("kind", "ends_s"), [("advice", 3.0), ("distance", 3.0), ("plan", 20.0), ("cars.logs", 20.0)]
)
def test_the_computing_time_of_a_job_is_bounded_by_its_kind(
    monkeypatch: pytest.MonkeyPatch, kind: str, ends_s: float
) -> None:
    """The worker is replaced at the bound, and the job does not run again on another one."""
    workers = Workers(monkeypatch, [None], [])

    async def run() -> None:
        async with running(compute_s=3.0) as pool:
            with pytest.raises(Problem) as caught:
                await pool.run({"kind": kind}, b"")
            assert (caught.value.kind, elapsed_s()) == ("timeout", ends_s)
            await settled()
            assert workers.made[0].killed_s == ends_s
            assert (await pool.run({"kind": kind}, b"")).status == 200
            assert len(workers.made[1].asked) == 1

    run_jumping(run())


def test_a_cancelled_request_leaves_its_worker_usable(monkeypatch: pytest.MonkeyPatch) -> None:
    workers = Workers(monkeypatch, [2.0])

    async def run() -> None:
        async with running() as pool:
            task = asyncio.create_task(pool.run(JOB, b""))
            await settled()
            task.cancel()
            await settled()
            assert (await pool.run(JOB, b"")).status == 200
            assert (elapsed_s(), len(workers.made), pool.lost) == (2.0, 1, 0)

    run_jumping(run())


@pytest.mark.parametrize(("losses", "is_lost"), [(2, False), (3, True)])
def test_a_job_loses_at_most_three_workers(
    monkeypatch: pytest.MonkeyPatch, losses: int, is_lost: bool
) -> None:
    Workers(monkeypatch, *([EOFError()] for _ in range(losses)))

    async def run() -> None:
        async with running() as pool:
            if is_lost:
                problem = await problem_of(pool)
                assert (problem.kind, problem.detail) == (
                    "internal",
                    "the computation ended without a result",
                )
            else:
                assert (await pool.run(JOB, b"")).status == 200
            await settled()
            assert (pool.lost, pool.ready) == (losses, 1)

    run_jumping(run())


def test_the_worker_that_was_busy_last_takes_the_next_job(monkeypatch: pytest.MonkeyPatch) -> None:
    workers = Workers(monkeypatch)

    async def run() -> None:
        async with running(2) as pool:
            for _ in range(5):
                await pool.run(JOB, b"")

    run_jumping(run())
    assert sorted(len(worker.asked) for worker in workers.made) == [0, 5]


def test_an_idle_worker_that_ended_is_replaced_within_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    workers = Workers(monkeypatch)

    async def run() -> None:
        async with running(2) as pool:
            workers.made[0].end()
            await asyncio.sleep(1.1)
            assert (pool.lost, pool.ready, len(workers.made)) == (1, 2, 3)
            assert [worker.closed for worker in workers.made] == [True, False, False]
            assert workers.numbers == [0, 1, 0], "the new worker has the cores of the one that ended"

    run_jumping(run())


def test_a_worker_that_does_not_start_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    said = list[dict[str, Any]]()
    Workers(monkeypatch, [EOFError()], OSError("no process"), EOFError("ended"))

    async def run() -> None:
        async with running(log=lambda **record: said.append(record)) as pool:
            assert (await pool.run(JOB, b"")).status == 200
            assert elapsed_s() == 10.0

    run_jumping(run())
    assert [record["event"] for record in said] == [
        *("worker lost", "worker did not start", "worker did not start", "worker started")
    ]
    assert said[1]["error"] == "OSError('no process')"
