"""A batch is split into lines and forecast in order, with as many jobs at a time as there is work for."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import orjson
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.server.http.batching import forecast_lines, parse_lines
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.pool import JobResult
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Limits


def problem_of(body: bytes, most: int) -> Problem:
    with pytest.raises(Problem) as caught:
        parse_lines(body, most)
    return caught.value


def test_a_batch_has_a_largest_number_of_lines_and_empty_ones_are_left_out() -> None:
    assert parse_lines(b"a\n\n \t\nbc\r\nd", 3) == [b"a", b"bc\r", b"d"]
    assert parse_lines(b"a\n", 1) == [b"a"]
    assert parse_lines(b"a\n\n\n\n\n\n", 3) == [b"a"]
    for body, most in ((b"a\nb", 1), (b"a\nb\nc", 2), (b"\n" * 7, 3)):
        assert (problem_of(body, most).kind, problem_of(body, most).detail) == (
            "too-large",
            f"at most {most} trips",
        )
    with pytest.raises(InvalidInput) as nothing:
        parse_lines(b" \n", 3)
    assert [(fault.what, fault.where) for fault in nothing.value.faults] == [("no trips", "body")]


class Pool:
    """Answers every line with itself, slowest first; lines that begin with a word fail."""

    def __init__(self, workers: int, body_bytes: int = 100) -> None:
        self.settings = SimpleNamespace(workers=workers, limits=Limits(body_bytes=body_bytes))
        self.running = self.most = self.cancelled = 0
        self.hold = False

    async def run(self, job: dict[str, Any], body: bytes, *, may_queue: bool = False) -> JobResult:
        assert job == {"kind": "forecast", "fields": None}
        assert may_queue
        self.running += 1
        self.most = max(self.most, self.running)
        try:
            for _ in range(3):
                await asyncio.sleep(0)
            while self.hold and body != b"first":
                await asyncio.sleep(0.001)
        except asyncio.CancelledError:
            self.cancelled += 1
            raise
        finally:
            self.running -= 1
        if b"busy" in body:
            raise Problem("busy", "try again")
        refused = orjson.dumps(Problem("invalid-input").document())
        return JobResult(422, refused, 0.01) if b"wrong" in body else JobResult(200, body, 0.01)


async def all_of(lines: list[bytes], pool: Pool, metrics: Metrics) -> list[bytes]:
    return [line async for line in forecast_lines(lines, pool, metrics)]  # type: ignore[arg-type]


@pytest.mark.parametrize("workers", [1, 3])
def test_one_job_more_than_workers_is_asked_for(workers: int) -> None:
    pool = Pool(workers)
    lines = [b"%d" % k for k in range(9)]
    assert asyncio.run(all_of(lines, pool, Metrics())) == [line + b"\n" for line in lines]
    assert pool.most == workers + 1


def test_what_fails_is_a_problem_document_in_its_place() -> None:
    metrics = Metrics()
    lines = [b"a" * 7, b"a" * 8, b"busy", b"wrong", b"last"]
    found = asyncio.run(all_of(lines, Pool(1, body_bytes=7), metrics))
    assert (found[0], found[4]) == (b"aaaaaaa\n", b"last\n")
    assert orjson.loads(found[3]) == Problem("invalid-input").document()
    assert orjson.loads(found[1]) == Problem("too-large", "at most 7 bytes per trip").document()
    assert found[2] == orjson.dumps(Problem("busy", "try again").document()) + b"\n"
    counted = {
        outcome: metrics.registry.get_sample_value("tripwatt_trips_total", {"outcome": outcome})
        for outcome in ("answered", "refused", "failed")
    }
    assert counted == {"answered": 2.0, "refused": 2.0, "failed": 1.0}
    labels = {"kind": "batch"}
    assert metrics.registry.get_sample_value("tripwatt_work_seconds_count", labels) == 3.0


def test_a_problem_has_the_trip_of_its_line() -> None:
    lines = [b'{"trip": "busy"}', b'{"trip": "wrong"}', b'{"of": "wrong"}', b'["wrong"]', b'{"trip": "a"}']
    found = asyncio.run(all_of(lines, Pool(2), Metrics()))
    assert [orjson.loads(line).get("trip") for line in found] == ["busy", "wrong", "trip", None, "a"]
    assert [orjson.loads(line).get("status") for line in found] == [503, 422, 422, 422, None]


def test_no_lines_give_nothing() -> None:
    assert asyncio.run(all_of([], Pool(2), Metrics())) == []


def test_a_batch_that_ends_early_cancels_its_jobs() -> None:
    pool = Pool(2)
    pool.hold = True

    async def run() -> None:
        stream = forecast_lines([b"first", b"x", b"y", b"z"], pool, Metrics())  # type: ignore[arg-type]
        assert await anext(stream) == b"first\n"
        await stream.aclose()  # type: ignore[attr-defined]

    asyncio.run(run())
    assert (pool.cancelled, pool.running) == (2, 0)
