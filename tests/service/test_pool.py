"""The pool of workers, with workers that are told what to do, and the bounds of the protocol, with a transport that listens."""

from __future__ import annotations

import asyncio
import signal
from types import SimpleNamespace
from typing import Any

import orjson
import pytest
import uvicorn
from uvicorn.server import ServerState

from tripwatt.service import pool as pools
from tripwatt.service.pool import JobResult, Worker, WorkerLost, WorkerPool
from tripwatt.service.problems import Problem
from tripwatt.service.protocol import (
    HEAD_TIMEOUT_S,
    MAX_HEAD_BYTES,
    MAX_HEADERS,
    SEND_TIMEOUT_S,
    SLICE_BYTES,
    BoundedProtocol,
)
from tripwatt.service.settings import Limits, Settings


class Told:
    """A worker that does as it is told: gives a result, is lost, or does not answer."""

    def __init__(self, *answers: Any) -> None:
        self.answers = list(answers)
        self.ended = asyncio.Event()
        self.process = SimpleNamespace(pid=7, wait=self.wait)
        self.killed = False

    async def wait(self) -> int:
        await self.ended.wait()
        return -9

    async def run(self, frame: bytes) -> JobResult:
        answer = self.answers.pop(0) if self.answers else JobResult(200, b"{}", 0.0)
        if answer == "hang":
            await asyncio.Event().wait()
        if isinstance(answer, Exception):
            self.ended.set()
            raise answer
        return answer

    async def kill(self) -> None:
        self.killed = True
        self.ended.set()

    async def stop(self) -> None:
        self.ended.set()


class Started:
    """Starts workers in turn; an exception is a start that fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *workers: Any) -> None:
        self.workers = list(workers)
        monkeypatch.setattr(Worker, "start", self.start)

    async def start(self, settings: Settings) -> Any:
        found = self.workers.pop(0) if self.workers else Told()
        if isinstance(found, Exception):
            raise found
        return found


def made(events: list[str], workers: int = 1, **limits: Any) -> WorkerPool:
    settings = Settings(workers=workers, limits=Limits(**limits))
    return WorkerPool(settings, lambda name, **details: events.append(name))


def test_a_lost_start_is_repeated_after_twice_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    sleep = asyncio.sleep

    async def note(seconds: float) -> None:
        waits.append(seconds)
        await sleep(0)

    async def run() -> tuple[int, int]:
        first = Told()
        Started(monkeypatch, first, *(OSError() for _ in range(9)))
        pool = made(events)
        await pool.start()
        monkeypatch.setattr(pools.asyncio, "sleep", note)
        first.ended.set()
        while "worker started" not in events:
            await sleep(0)
        await pool.stop()
        return pool.lost, pool.ready

    events: list[str] = []
    assert asyncio.run(run()) == (1, 0)
    assert waits == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 10.0, 10.0])
    assert events == ["worker lost", *["worker did not start"] * 9, "worker started"]


@pytest.mark.parametrize(
    ("crashed", "losses", "kind"),
    [(True, 1, None), (True, 2, "internal"), (False, 3, None), (False, 4, "busy")],
)
def test_how_many_workers_a_job_may_lose(
    monkeypatch: pytest.MonkeyPatch, crashed: bool, losses: int, kind: str | None
) -> None:
    """Two that crash: the job is probably the cause. Four that were ended: the client has to ask again."""

    async def run() -> Any:
        Started(monkeypatch, *(Told(WorkerLost(crashed=crashed)) for _ in range(losses)))
        pool = made([], timeout_s=30.0)
        await pool.start()
        try:
            return await pool.run({"kind": "forecast"}, b"")
        finally:
            await pool.stop()

    if kind is None:
        assert asyncio.run(run()).status == 200
        return
    with pytest.raises(Problem) as caught:
        asyncio.run(run())
    assert caught.value.kind == kind
    assert caught.value.headers == ({"Retry-After": "1"} if kind == "busy" else {})


def test_as_many_jobs_wait_as_the_limit_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    async def run() -> tuple[str, int, int]:
        Started(monkeypatch, Told(*["hang"] * 9))
        pool = made([], waiting=2, timeout_s=30.0)
        await pool.start()
        jobs = [asyncio.ensure_future(pool.run({"kind": "x"}, b"")) for _ in range(3)]
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        waiting = pool.waiting
        with pytest.raises(Problem) as caught:
            await pool.run({"kind": "x"}, b"")
        queued = asyncio.ensure_future(pool.run({"kind": "x"}, b"", may_queue=True))
        await asyncio.sleep(0)
        more = pool.waiting
        for job in (*jobs, queued):
            job.cancel()
        await asyncio.gather(*jobs, queued, return_exceptions=True)
        await pool.stop()
        return caught.value.kind, waiting, more

    assert asyncio.run(run()) == ("busy", 2, 3)


def test_a_worker_that_hangs_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    async def run() -> tuple[str, bool]:
        hanging = Told("hang")
        Started(monkeypatch, hanging)
        pool = made(events, timeout_s=0.01)
        await pool.start()
        with pytest.raises(Problem) as caught:
            await pool.run({"kind": "x"}, b"")
        while "worker hung" not in events:
            await asyncio.sleep(0)
        await pool.stop()
        return caught.value.detail, hanging.killed

    events: list[str] = []
    assert asyncio.run(run()) == ("longer than 0.01 s", True)


def test_a_worker_that_was_ended_from_outside_did_not_crash() -> None:
    assert pools.KILL_SIGNALS == (-signal.SIGKILL, -signal.SIGTERM)

    async def lost(code: int) -> bool:
        process = SimpleNamespace(
            stdin=SimpleNamespace(write=lambda frame: None, drain=ended), stdout=None, wait=ends(code)
        )
        process.stdout = process.stdin
        with pytest.raises(WorkerLost) as caught:
            await Worker(process).run(b"")  # type: ignore[arg-type]
        return caught.value.crashed

    async def ended() -> None:
        raise ConnectionResetError

    def ends(code: int) -> Any:
        async def wait() -> int:
            return code

        return wait

    assert [asyncio.run(lost(code)) for code in (-9, -15, -11, 0, 1)] == [False, False, True, True, True]


# the protocol


class Wire:
    """A transport that keeps what is written."""

    def __init__(self) -> None:
        self.sent, self.closed, self.aborted = b"", False, False

    def write(self, data: bytes) -> None:
        self.sent += data

    def is_closing(self) -> bool:
        return self.closed

    def close(self) -> None:
        self.closed = True

    def abort(self) -> None:
        self.aborted = True

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return ("127.0.0.1", 1) if name in ("sockname", "peername") else default

    def pause_reading(self) -> None: ...
    def resume_reading(self) -> None: ...


def connected(app: Any, timers: list[float]) -> tuple[BoundedProtocol, Wire]:
    """A protocol with an application; the delays of its timers are kept."""
    loop = asyncio.get_running_loop()
    config = uvicorn.Config(app, log_config=None)
    config.load()
    protocol = BoundedProtocol(config, ServerState(), {}, loop)
    later = loop.call_later

    def call_later(delay: float, *rest: Any) -> Any:
        timers.append(delay)
        return later(delay, *rest)

    loop.call_later = call_later  # type: ignore[method-assign]
    wire = Wire()
    protocol.connection_made(wire)  # type: ignore[arg-type]
    return protocol, wire


async def echo(scope: Any, receive: Any, send: Any) -> None:
    size = 0
    while True:
        message = await receive()
        size += len(message.get("body", b""))
        if not message.get("more_body"):
            break
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"%d bytes" % size})


def answer_to(*parts: bytes) -> tuple[bytes, bool]:
    async def run() -> tuple[bytes, bool]:
        protocol, wire = connected(echo, [])
        for part in parts:
            protocol.data_received(part)
        for _ in range(20):
            await asyncio.sleep(0)
        found = wire.sent, wire.closed
        protocol.connection_lost(None)
        return found

    return asyncio.run(run())


def head(size: int) -> bytes:
    """A head of so many bytes."""
    start, end = b"GET / HTTP/1.1\r\nHost: a\r\nX: ", b"\r\n\r\n"
    return start + b"x" * (size - len(start) - len(end)) + end


def test_a_head_of_the_limit_is_read() -> None:
    assert MAX_HEAD_BYTES == 2 * SLICE_BYTES == 32_768
    sent, _ = answer_to(head(MAX_HEAD_BYTES)[:-4], b"\r\n\r\n")
    assert sent.startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize("pieces", [1, 7])
def test_a_head_beyond_the_limit_is_answered_and_closed(pieces: int) -> None:
    whole = head(MAX_HEAD_BYTES + SLICE_BYTES + 100)
    size = -(-len(whole) // pieces)
    sent, closed = answer_to(*(whole[k : k + size] for k in range(0, len(whole), size)))
    assert closed
    assert sent.startswith(b"HTTP/1.1 431 Request Header Fields Too Large\r\n")
    document = orjson.loads(sent.partition(b"\r\n\r\n")[2])
    assert document["detail"] == "at most 32768 bytes and 100 headers"


def test_a_head_without_an_end_may_have_the_limit_and_no_byte_more() -> None:
    open_head = head(MAX_HEAD_BYTES + 100)[:MAX_HEAD_BYTES]
    assert answer_to(open_head) == (b"", False)
    sent, closed = answer_to(open_head, b"x")
    assert closed
    assert sent.startswith(b"HTTP/1.1 431")


@pytest.mark.parametrize(("headers", "status"), [(MAX_HEADERS, b"200"), (MAX_HEADERS + 1, b"431")])
def test_headers_are_counted(headers: int, status: bytes) -> None:
    lines = b"".join(b"X-%d: 1\r\n" % k for k in range(headers - 1))
    sent, _ = answer_to(b"GET / HTTP/1.1\r\nHost: a\r\n" + lines + b"\r\n")
    assert sent.split(b" ", 2)[1] == status


def test_a_long_body_is_no_head() -> None:
    body = b"x" * (3 * MAX_HEAD_BYTES)
    start = b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: %d\r\n\r\n" % len(body)
    sent, _ = answer_to(start, *(body[k : k + 10_000] for k in range(0, len(body), 10_000)))
    assert b"\r\n%d bytes\r\n" % len(body) in sent


def test_what_is_no_http_is_told_and_closed() -> None:
    sent, closed = answer_to(b"nonsense\r\n\r\n")
    assert closed
    assert sent.startswith(b"HTTP/1.1 400 Bad Request\r\n")
    length = int(sent.partition(b"Content-Length: ")[2].split(b"\r\n")[0])
    assert length == len(sent.partition(b"\r\n\r\n")[2])


def test_times_of_a_connection() -> None:
    async def run() -> tuple[list[float], bool]:
        timers: list[float] = []
        protocol, wire = connected(echo, timers)
        protocol.data_received(b"GET / HTTP/1.1\r\n")
        protocol.pause_writing()
        protocol.pause_writing()
        protocol.resume_writing()
        protocol.connection_lost(None)
        return timers, wire.aborted

    timers, aborted = asyncio.run(run())
    assert (HEAD_TIMEOUT_S, SEND_TIMEOUT_S) == (10.0, 20.0)
    assert timers == [
        10.0,
        10.0,
        20.0,
    ]  # of the connection, of the head that began, of the client that does not read
    assert not aborted
