"""The worker pool with processes that only pretend: starts, jobs, losses, restarts and times."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson
import pytest
from tests.support.virtual_time import elapsed_s, run_jumping

from tripwatt.roads.journey import AtlasSettings
from tripwatt.server.http.frames import encode_frame, read_frame_async
from tripwatt.server.http.pool import KILL_SIGNALS, JobResult, Worker, WorkerLost, WorkerPool
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Limits, Settings

READY = encode_frame({"ready": True}, b"")
ANSWER = encode_frame({"status": 200, "seconds": 0.5}, b"done")
JOB = {"kind": "forecast"}

Step = bytes | int | float | None
"""What a process does with a frame: answer, end with a code, answer after a delay [s] and `done`, or hang."""


class Process:
    """A process that follows its steps, the first of which is the one for its start."""

    def __init__(self, pid: int, *steps: Step, ends_with_input: bool = True) -> None:
        self.pid, self.steps, self.ends_with_input = pid, list(steps), ends_with_input
        self.stdout = asyncio.StreamReader()
        self.stdin = self
        self.frames: list[bytes] = []
        self.killed_s: float | None = None
        self.ended: asyncio.Future[int] = asyncio.get_running_loop().create_future()

    def write(self, frame: bytes) -> None:
        self.frames.append(frame)
        step = self.steps.pop(0) if self.steps else ANSWER
        if isinstance(step, bytes):
            self.stdout.feed_data(step)
        elif isinstance(step, int):
            self.end(step)
        elif step is not None:
            asyncio.get_running_loop().call_later(step, self.stdout.feed_data, ANSWER)

    async def drain(self) -> None: ...

    def close(self) -> None:
        if self.ends_with_input:
            self.end(0)

    def end(self, code: int) -> None:
        if not self.ended.done():
            self.ended.set_result(code)
            self.stdout.feed_eof()

    def kill(self) -> None:
        if self.ended.done():
            raise ProcessLookupError
        self.killed_s = elapsed_s()
        self.end(-9)

    async def wait(self) -> int:
        return await asyncio.shield(self.ended)


class Processes:
    """Starts processes in place of the real ones, each with the next steps."""

    def __init__(self, patch: pytest.MonkeyPatch, *steps: tuple[Step, ...] | OSError) -> None:
        self.steps = list(steps)
        self.started: list[Process] = []
        self.calls: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
        self.refused = 0
        patch.setattr(asyncio, "create_subprocess_exec", self.start)

    async def start(self, *command: Any, **options: Any) -> Process:
        self.calls.append((command, options))
        steps = self.steps.pop(0) if self.steps else (READY,)
        if isinstance(steps, OSError):
            self.refused += 1
            raise steps
        self.started.append(Process(100 + len(self.started), *steps))
        return self.started[-1]


class Log:
    """What a pool has said."""

    def __init__(self) -> None:
        self.said: list[dict[str, Any]] = []

    def __call__(self, event: str, **more: Any) -> None:
        self.said.append({"event": event, **more})

    def events(self) -> list[str]:
        return [record["event"] for record in self.said]


async def settled() -> None:
    for _ in range(30):
        await asyncio.sleep(0)


def pool_of(log: Callable[..., None] | None = None, workers: int = 1, **limits: Any) -> WorkerPool:
    return WorkerPool(Settings(workers=workers, limits=Limits(**limits)), log or Log())


async def problem_of(pool: WorkerPool, **more: Any) -> Problem:
    with pytest.raises(Problem) as caught:
        await pool.run(JOB, b"", **more)
    return caught.value


def test_a_worker_is_started_without_the_token_and_with_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIPWATT_TOKEN", "secret")
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    monkeypatch.setenv("SOME_VARIABLE", "kept")
    processes = Processes(monkeypatch)
    settings = Settings({"one": Path("/m/1")}, limits=Limits(samples=7), atlas=AtlasSettings("a-map"))
    worker = run_jumping(Worker.start(settings))
    assert worker.process is processes.started[0]  # type: ignore[comparison-overlap]
    command, options = processes.calls[0]
    assert command == (sys.executable, "-m", "tripwatt.server.http.worker")
    assert options["start_new_session"] is True
    environment = options["env"]
    assert "TRIPWATT_TOKEN" not in environment
    assert [environment[k] for k in ("SOME_VARIABLE", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")] == [
        *("kept", "1", "1")
    ]


def test_a_worker_is_told_its_models_limits_and_atlas(monkeypatch: pytest.MonkeyPatch) -> None:
    processes = Processes(monkeypatch)
    settings = Settings({"one": Path("/m/1")}, limits=Limits(samples=7), atlas=AtlasSettings("a-map"))

    async def run() -> tuple[dict[str, Any], bytes]:
        await Worker.start(settings)
        stream = asyncio.StreamReader()
        stream.feed_data(processes.started[0].frames[0])
        return await read_frame_async(stream)

    head, body = run_jumping(run())
    assert (head["models"], head["limits"]["samples"], body) == ({"one": "/m/1"}, 7, b"")
    assert head["atlas"] == {"map": "a-map", "places": "", "weather": "", "stations": ""}


def test_a_worker_has_two_minutes_to_start(monkeypatch: pytest.MonkeyPatch) -> None:
    processes = Processes(monkeypatch, (None,), (119.0,))

    async def run() -> None:
        with pytest.raises(TimeoutError):
            await Worker.start(Settings())
        assert (elapsed_s(), processes.started[0].killed_s) == (120.0, 120.0)
        await Worker.start(Settings())
        assert processes.started[1].killed_s is None

    run_jumping(run())


@pytest.mark.parametrize(("code", "crashed"), [(0, True), (1, True), (-11, True), (-9, False), (-15, False)])
def test_a_worker_that_ends_is_lost_and_only_kills_are_no_crash(code: int, crashed: bool) -> None:
    async def run() -> bool:
        with pytest.raises(WorkerLost) as caught:
            await Worker(Process(1, code)).run(b"")  # type: ignore[arg-type]
        return caught.value.crashed

    assert run_jumping(run()) is crashed
    assert KILL_SIGNALS == (-9, -15)
    assert WorkerLost().crashed is False


def test_a_result_has_status_content_and_time() -> None:
    async def run() -> JobResult:
        return await Worker(Process(1)).run(b"x")  # type: ignore[arg-type]

    assert run_jumping(run()) == JobResult(200, b"done", 0.5)


def test_a_worker_that_does_not_stop_is_killed_after_five_seconds() -> None:
    async def run() -> tuple[float | None, float | None]:
        good, bad = Process(1), Process(2, ends_with_input=False)
        await Worker(good).stop()  # type: ignore[arg-type]
        assert elapsed_s() == 0.0
        await Worker(bad).stop()  # type: ignore[arg-type]
        return good.killed_s, bad.killed_s

    assert run_jumping(run()) == (None, 5.0)


def test_a_worker_that_has_ended_can_be_killed() -> None:
    async def run() -> None:
        process = Process(1, 0)
        process.end(0)
        await Worker(process).kill()  # type: ignore[arg-type]
        assert process.killed_s is None

    run_jumping(run())


def test_all_workers_start_and_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    processes, log = Processes(monkeypatch), Log()

    async def run() -> None:
        pool = pool_of(log, workers=3)
        assert (pool.ready, pool.waiting, pool.lost) == (0, 0, 0)
        await pool.start()
        assert (pool.ready, pool.waiting, pool.lost) == (3, 0, 0)
        await pool.stop()
        await settled()
        assert (pool.ready, pool.lost) == (0, 0)

    run_jumping(run())
    assert [process.ended.result() for process in processes.started] == [0, 0, 0]
    assert [process.killed_s for process in processes.started] == [None] * 3
    assert log.said == []


def test_workers_take_jobs_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    processes = Processes(monkeypatch)

    async def run() -> None:
        pool = pool_of(workers=2)
        await pool.start()
        for _ in range(4):
            assert (await pool.run(JOB, b"body")).content == b"done"
        assert [len(process.frames) for process in processes.started] == [3, 3]
        assert processes.started[0].frames[1] == encode_frame(JOB, b"body")
        await pool.stop()

    run_jumping(run())


def test_jobs_beyond_the_waiting_ones_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    Processes(monkeypatch, (READY, 1.0))

    async def run() -> None:
        pool = pool_of(waiting=2)
        await pool.start()
        tasks = [asyncio.create_task(pool.run(JOB, b"")) for _ in range(2)]
        await settled()
        assert pool.waiting == 1
        tasks.append(asyncio.create_task(pool.run(JOB, b"")))
        await settled()
        assert pool.waiting == 2
        problem = await problem_of(pool)
        assert (problem.kind, problem.detail) == ("busy", "too many requests wait")
        assert problem.headers == {"Retry-After": "1"}
        tasks.append(asyncio.create_task(pool.run(JOB, b"", may_queue=True)))
        await settled()
        assert pool.waiting == 3
        assert [result.status for result in await asyncio.gather(*tasks)] == [200] * 4
        assert (pool.waiting, elapsed_s()) == (0, 1.0)
        await pool.stop()

    run_jumping(run())


def test_a_hung_worker_is_killed_and_its_job_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    processes, log = Processes(monkeypatch, (READY, None)), Log()

    async def run() -> None:
        pool = pool_of(log, timeout_s=2.5)
        await pool.start()
        problem = await problem_of(pool)
        assert (problem.kind, problem.detail, elapsed_s()) == ("timeout", "longer than 2.5 s", 2.5)
        await settled()
        assert (pool.ready, pool.lost, pool.waiting) == (1, 1, 0)
        assert (await pool.run(JOB, b"")).status == 200
        await pool.stop()

    run_jumping(run())
    assert processes.started[0].killed_s == 2.5
    assert log.said == [
        {"event": "worker hung", "pid": 100},
        {"event": "worker lost", "pid": 100, "code": -9},
        {"event": "worker started", "ready": 1},
    ]


def test_a_request_that_waits_too_long_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    Processes(monkeypatch, (READY, 3.0))

    async def run() -> None:
        pool = pool_of(timeout_s=4.0)
        await pool.start()
        first = asyncio.create_task(pool.run(JOB, b""))
        await asyncio.sleep(0.0)
        pool.settings = Settings(workers=1, limits=Limits(timeout_s=1.0))
        assert (await problem_of(pool)).detail == "longer than 1 s"
        assert (elapsed_s(), pool.waiting) == (1.0, 0)
        assert (await first).content == b"done"
        await pool.stop()

    run_jumping(run())


def test_a_cancelled_request_leaves_its_worker_usable(monkeypatch: pytest.MonkeyPatch) -> None:
    processes = Processes(monkeypatch, (READY, 2.0))

    async def run() -> None:
        pool = pool_of()
        await pool.start()
        task = asyncio.create_task(pool.run(JOB, b""))
        await settled()
        task.cancel()
        await settled()
        assert (await pool.run(JOB, b"")).status == 200
        assert elapsed_s() == 2.0
        assert (len(processes.started), pool.lost) == (1, 0)
        await pool.stop()

    run_jumping(run())


def test_a_job_is_given_up_after_two_crashes(monkeypatch: pytest.MonkeyPatch) -> None:
    Processes(monkeypatch, *[(READY, 1)] * 3)

    async def run() -> None:
        pool = pool_of()
        await pool.start()
        problem = await problem_of(pool)
        assert (problem.kind, problem.detail) == ("internal", "the computation ended without a result")
        await settled()
        assert pool.lost == 2
        await pool.stop()

    run_jumping(run())


def test_a_job_is_tried_again_after_one_crash(monkeypatch: pytest.MonkeyPatch) -> None:
    Processes(monkeypatch, (READY, 1))

    async def run() -> None:
        pool = pool_of()
        await pool.start()
        assert (await pool.run(JOB, b"")).status == 200
        assert (pool.lost, pool.ready) == (1, 1)
        await pool.stop()

    run_jumping(run())


@pytest.mark.parametrize(("kills", "is_busy"), [(3, False), (4, True)])
def test_a_job_loses_at_most_four_killed_workers(
    monkeypatch: pytest.MonkeyPatch, kills: int, is_busy: bool
) -> None:
    Processes(monkeypatch, *[(READY, -9)] * kills)

    async def run() -> None:
        pool = pool_of()
        await pool.start()
        if is_busy:
            problem = await problem_of(pool)
            assert (problem.kind, problem.detail) == ("busy", "the workers were ended; try again")
            assert problem.headers == {"Retry-After": "1"}
        else:
            assert (await pool.run(JOB, b"")).status == 200
        await settled()
        assert (pool.lost, pool.ready) == (kills, 1)
        await pool.stop()

    run_jumping(run())


def test_an_idle_worker_that_was_lost_gets_no_job(monkeypatch: pytest.MonkeyPatch) -> None:
    processes = Processes(monkeypatch)

    async def run() -> None:
        pool = pool_of()
        await pool.start()
        processes.started[0].end(-9)
        await settled()
        assert (await pool.run(JOB, b"")).status == 200
        assert [len(process.frames) for process in processes.started] == [1, 2]
        await pool.stop()

    run_jumping(run())


def test_the_delay_before_another_start_doubles_up_to_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    failed = [OSError("no process"), (1,), (None,), *[OSError("no process")] * 7]
    log, delays = Log(), []
    sleep = asyncio.sleep

    async def noted(delay_s: float) -> None:
        delays.append(delay_s)
        await sleep(0)

    async def lose() -> None:
        processes = Processes(monkeypatch, (READY,), *failed)  # type: ignore[arg-type]
        pool = pool_of(log)
        await pool.start()
        monkeypatch.setattr(asyncio, "sleep", noted)
        processes.started[0].end(3)
        while "worker started" not in log.events():
            await sleep(1.0)
        monkeypatch.setattr(asyncio, "sleep", sleep)
        assert (pool.ready, pool.lost) == (1, 1)
        await pool.stop()

    run_jumping(lose())
    assert delays == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 10.0, 10.0, 10.0]
    assert log.said[0] == {"event": "worker lost", "pid": 100, "code": 3}
    assert log.said[1] == {"event": "worker did not start", "error": "OSError('no process')"}
    assert log.events() == ["worker lost", *["worker did not start"] * 10, "worker started"]
    assert orjson.dumps(log.said)
