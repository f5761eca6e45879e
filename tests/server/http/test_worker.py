"""What a worker answers to each kind of failure, and how its process is prepared."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from typing import Any

import orjson
import pytest

from tripwatt.errors import Fault, InvalidInput, RemoteError
from tripwatt.roads.journey import AtlasSettings
from tripwatt.server.http import worker
from tripwatt.server.http.pool import Worker
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Limits

FAULT = Fault("wrong", "there")


class Jobs:
    """Jobs that return or raise what they are told."""

    limits = Limits(memory_bytes=1000)

    def __init__(self, *results: Any) -> None:
        self.results = list(results)
        self.asked: list[tuple[Any, ...]] = []

    def run(self, kind: str, body: bytes) -> Any:
        self.asked.append((kind, body))
        found = self.results.pop(0)
        if isinstance(found, Exception):
            raise found
        return found


@pytest.mark.parametrize(
    ("result", "status", "content"),
    [
        ({"a": 1}, 200, b'{"a":1}'),
        (b"\x00tile", 200, b"\x00tile"),
        (Problem("not-json", "line 1"), 400, orjson.dumps(Problem("not-json", "line 1").document())),
        (InvalidInput(FAULT), 422, orjson.dumps(Problem("invalid-input", faults=(FAULT,)).document())),
        (RemoteError(FAULT), 502, orjson.dumps(Problem("remote", faults=(FAULT,)).document())),
    ],
)
def test_a_result_or_what_was_wrong_is_answered(result: Any, status: int, content: bytes) -> None:
    assert worker.run_job(Jobs(result), {"kind": "x"}, b"") == (status, content)  # type: ignore[arg-type]


def test_a_bug_is_logged_and_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    found = worker.run_job(Jobs(ValueError("inside")), {"kind": "forecast"}, b"")  # type: ignore[arg-type]
    assert found == (500, orjson.dumps(Problem("internal").document()))
    record = orjson.loads(capsys.readouterr().err)
    assert (record["event"], record["kind"]) == ("bug", "forecast")
    assert record["traceback"].endswith("ValueError: inside\n")


def test_too_little_memory_is_a_fault_of_what_was_sent(capsys: pytest.CaptureFixture[str]) -> None:
    for body, kind in ((b"{}", "too-large"), (b"", "internal")):
        status, content = worker.run_job(Jobs(MemoryError()), {"kind": "x"}, body)  # type: ignore[arg-type]
        problem = Problem(kind, "it takes more than 1000 bytes of memory")
        assert (status, content) == (problem.status, orjson.dumps(problem.document()))
        assert orjson.loads(capsys.readouterr().err)["event"] == "out of memory"


def test_a_process_is_prepared_once_and_runs_jobs() -> None:
    """In a process of its own: its memory is bounded, its signals are ignored, and a call after its end is no result."""

    async def run() -> None:
        process = await Worker.start(1, 2, {}, Limits(), AtlasSettings(), None)
        status, content, seconds = await process.call(worker.run_in_worker, {"kind": "forecast"}, b"{")
        assert (status, orjson.loads(content)["type"]) == (400, "/problems/not-json")
        assert 0.0 <= seconds < 120.0
        assert await process.call(signal.getsignal, signal.SIGTERM) is signal.SIG_IGN
        body = bytes(3_000_000)
        assert await process.call(bytes, body) == body
        if sys.platform == "linux":
            import resource

            bound = (await process.call(resource.getrlimit, resource.RLIMIT_DATA))[0]
            assert Limits().memory_bytes < bound < Limits().memory_bytes + 4e9
            cores = sorted(os.sched_getaffinity(0))
            assert await process.call(os.sched_getaffinity, 0) == {*(cores[1::2] or cores)}
        for _ in range(2):
            with pytest.raises((EOFError, OSError)):
                await process.call(os._exit, 3)
        process.process.join()
        assert process.process.exitcode == 3

    asyncio.run(run())


def test_a_process_ends_when_its_socket_is_closed() -> None:
    async def run() -> None:
        process = await Worker.start(1, 2, {}, Limits(), AtlasSettings(), None)
        await process.call(os.getpid)
        process.writer.close()
        await asyncio.to_thread(process.process.join, 60.0)
        assert process.process.exitcode == 0

    asyncio.run(run())
