"""Clients that try to stall or exhaust the service: each is bounded, and others are served meanwhile."""

import asyncio
import socket
import time
from pathlib import Path
from typing import Any

import orjson
import pytest
from tests.support.service_attacks import FORECAST, attacking, seen_by_another
from tests.support.service_process import Service, serving

from tripwatt.server.http import protocol
from tripwatt.server.http.batching import LineSplitter
from tripwatt.server.http.pool import KILL_SIGNALS, WorkerLost, WorkerPool
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.receiving import GRACE_S, Arrival, Arrivals
from tripwatt.server.http.settings import Settings

JSON = {"Content-Type": "application/json"}
HEAD = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def answer_to(service: Service, *parts: bytes) -> bytes:
    """What comes back until the server closes the connection; later parts may meet a closed one."""
    with socket.create_connection(("127.0.0.1", service.port), timeout=15) as connection:
        found = b""
        try:
            for part in parts:
                connection.sendall(part)
            while data := connection.recv(65536):
                found += data
        except OSError:
            pass
        return found


@pytest.mark.parametrize(
    "head",
    [
        HEAD + b"X-A: " + b"a" * 80_000,
        b"GET /" + b"a" * 80_000,
        HEAD + b"a: b\r\n" * 101 + b"\r\n",
    ],
    ids=["header", "target", "number"],
)
def test_a_head_has_a_largest_size(service: Service, head: bytes) -> None:
    answer = answer_to(service, head)
    assert answer.startswith(b"HTTP/1.1 431 Request Header Fields Too Large\r\n")
    assert b"Content-Type: application/problem+json" in answer
    document = orjson.loads(answer.partition(b"\r\n\r\n")[2])
    assert (document["type"], document["status"]) == ("/problems/head-too-large", 431)
    assert service.client.get("/healthz").status_code == 200


def test_a_head_within_its_bounds_is_answered(service: Service) -> None:
    close = b"Connection: close\r\n\r\n"
    assert answer_to(service, HEAD + b"a: b\r\n" * 98 + close).startswith(b"HTTP/1.1 200")
    assert answer_to(service, HEAD + b"a: " + b"b" * 30_000 + b"\r\n" + close).startswith(b"HTTP/1.1 200")
    slow = HEAD + b"a: " + b"b" * 20_000 + b"\r\n"
    assert answer_to(service, slow[:7], slow[7:9000], slow[9000:], close).startswith(b"HTTP/1.1 200")


def test_trailers_have_a_largest_number_and_size(service: Service) -> None:
    head = (
        b"POST /v1/forecast HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        b"Transfer-Encoding: chunked\r\n\r\n1\r\n{\r\n0\r\n"
    )
    for trailers in (b"t: x\r\n" * 1000, b"t: " + b"x" * 80_000):
        answer = answer_to(service, head + trailers)
        assert b"200 OK" not in answer


def test_bytes_that_are_no_http_get_a_problem_document(service: Service) -> None:
    answer = answer_to(service, b"\x16\x03\x01\x02\x00\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 400 Bad Request\r\n")
    assert orjson.loads(answer.partition(b"\r\n\r\n")[2])["type"] == "/problems/bad-request"


def test_requests_in_one_packet_are_answered_in_order(service: Service) -> None:
    both = answer_to(service, HEAD + b"\r\n" + HEAD + b"Connection: close\r\n\r\n")
    assert both.count(b"HTTP/1.1 200 OK") == 2


def test_a_body_in_tiny_chunks_is_whole(service: Service) -> None:
    chunks = b"".join(b"1\r\n%c\r\n" % byte for byte in FORECAST) + b"0\r\n\r\n"
    head = (
        b"POST /v1/forecast HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        b"Connection: close\r\nTransfer-Encoding: chunked\r\n\r\n"
    )
    answer = answer_to(service, head + chunks)
    assert answer.startswith(b"HTTP/1.1 200")
    direct = service.client.post("/v1/forecast", content=FORECAST, headers=JSON)
    assert orjson.loads(answer.partition(b"\r\n\r\n")[2]) == direct.json()


class Transport(asyncio.Transport):
    """Notes what a protocol does with its connection."""

    def __init__(self) -> None:
        super().__init__()
        self.closed = self.aborted = False

    def is_closing(self) -> bool:
        return self.closed

    def close(self) -> None:
        self.closed = True

    def abort(self) -> None:
        self.aborted = True

    def pause_reading(self) -> None: ...

    def resume_reading(self) -> None: ...

    def write(self, data: Any) -> None: ...


def connected() -> tuple[protocol.BoundedProtocol, Transport]:
    import uvicorn
    from uvicorn.server import ServerState

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await asyncio.sleep(60)

    found = protocol.BoundedProtocol(uvicorn.Config(app), ServerState(), {})
    transport = Transport()
    found.connection_made(transport)
    return found, transport


def test_a_connection_has_a_time_for_its_head(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "HEAD_TIMEOUT_S", 0.05)

    async def run() -> None:
        silent, nothing = connected()
        slow, half = connected()
        whole, complete = connected()
        slow.data_received(HEAD)
        whole.data_received(HEAD)
        whole.data_received(b"\r\n")
        await asyncio.sleep(0.15)
        assert nothing.closed
        assert half.closed
        assert not complete.closed
        for one in (silent, slow, whole):
            one.connection_lost(None)

    asyncio.run(run())


def test_a_client_has_a_time_to_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "SEND_TIMEOUT_S", 0.05)

    async def run() -> None:
        stalled, never = connected()
        reads, later = connected()
        stalled.pause_writing()
        reads.pause_writing()
        reads.resume_writing()  # with no wait before it: on a busy machine the shortest one outlasts the timeout
        await asyncio.sleep(0.1)
        assert never.aborted
        assert not later.aborted
        for one in (stalled, reads):
            one.connection_lost(None)

    asyncio.run(run())


def test_a_slow_body_gives_its_place_to_the_next(service: Service) -> None:
    head = b"POST /v1/forecast HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 99\r\n\r\n{"
    most = Settings().limits.bodies
    held = [socket.create_connection(("127.0.0.1", service.port), timeout=10) for _ in range(most)]
    for connection in held:
        connection.sendall(head)
    held[0].sendall(b" " * 50)
    time.sleep(2 * GRACE_S)
    assert service.client.post("/v1/forecast", content=FORECAST, headers=JSON).status_code == 200
    for _ in range(2):
        whole = head.replace(b"99", b"%d\r\nConnection: close" % len(FORECAST))
        with socket.create_connection(("127.0.0.1", service.port), timeout=15) as connection:
            connection.sendall(whole)
            time.sleep(0.05)
            connection.sendall(FORECAST[1:])
            assert connection.recv(12) == b"HTTP/1.1 200"
    answers = []
    for connection in held:
        connection.setblocking(False)
        try:
            answers.append(connection.recv(100)[:12])
        except BlockingIOError:
            answers.append(b"")
        connection.close()
    assert answers[0] == b"", "the fastest of the slow keeps its place"
    assert {a for a in answers if a} <= {b"HTTP/1.1 408"}
    assert sum(a != b"" for a in answers) in (1, 2)


def test_the_slowest_arrival_goes_and_a_young_one_stays() -> None:
    async def run() -> None:
        arrivals = Arrivals(2)
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(5) as first, asyncio.timeout(5) as second, asyncio.timeout(5) as third:
            slow, fast = await arrivals._admit(first), await arrivals._admit(second)
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(arrivals._admit(third), GRACE_S / 4)
            assert len(arrivals) == 2
            slow.started -= 2 * GRACE_S
            fast.started -= 2 * GRACE_S
            slow.size, fast.size = 10, 1000
            before = first.when(), second.when()
            await arrivals._admit(third)
            assert len(arrivals) == 2
            assert (first.when() < before[0], second.when() == before[1]) == (True, True)
            first.reschedule(None)
            assert Arrival(first, loop.time() - 2.0).rate(loop.time()) == 0.0
            slow.started, slow.size = 0.0, 100
            assert slow.rate(4.0) == 25.0

    asyncio.run(run())


class Sent:
    """A request whose body comes in the given parts; nothing comes after them."""

    def __init__(self, *parts: bytes, is_complete: bool) -> None:
        self.headers = {"content-type": "application/json"}
        self.messages = [
            {"type": "http.request", "body": part, "more_body": not is_complete or i + 1 < len(parts)}
            for i, part in enumerate(parts)
        ]

    async def receive(self) -> dict[str, Any]:
        if not self.messages:
            await asyncio.sleep(60)
        return self.messages.pop(0)


def test_a_body_in_one_part_needs_no_place_and_a_longer_one_waits_for_the_grace() -> None:
    async def read(arrivals: Arrivals, request: Sent, timeout_s: float) -> tuple[bytes, float]:
        loop = asyncio.get_running_loop()
        parts: list[bytes] = []
        started = loop.time()
        await arrivals.read(request, ("application/json",), 1000, timeout_s, parts.append)  # type: ignore[arg-type]
        return b"".join(parts), loop.time() - started

    async def run() -> None:
        arrivals = Arrivals(1)
        held = asyncio.create_task(read(arrivals, Sent(b"{", is_complete=False), 30.0))
        await asyncio.sleep(0)
        assert len(arrivals) == 1
        assert (await read(arrivals, Sent(b"{}", is_complete=True), 30.0))[0] == b"{}"
        assert len(arrivals) == 1
        body, waited_s = await read(arrivals, Sent(b"{", b"}", is_complete=True), 30.0)
        assert body == b"{}"
        assert waited_s > 0.5 * GRACE_S
        with pytest.raises(Problem) as caught:
            await held
        assert caught.value.kind == "body-late"
        assert len(arrivals) == 0

    asyncio.run(run())


def test_a_batch_is_counted_while_it_arrives() -> None:
    splitter = LineSplitter(3)
    for part in (b"a\n", b"\n", b"b", b"c\n d", b"\n"):
        splitter.take(part)
    assert splitter.lines() == [b"a", b"bc", b" d"]
    many = LineSplitter(3)
    many.take(b"1\n2\n3\n")
    with pytest.raises(Problem) as caught:
        many.take(b"4\n")
    assert caught.value.kind == "too-large"
    last = LineSplitter(3)
    last.take(b"1\n2\n3\n4")
    with pytest.raises(Problem):
        last.lines()
    empty = LineSplitter(3)
    empty.take(b"\n" * 6)
    with pytest.raises(Problem):
        empty.take(b"\n")
    with pytest.raises(Problem) as nothing:
        LineSplitter(3).lines()
    assert nothing.value.kind == "invalid-input"


@pytest.mark.parametrize("name", ["slow_bodies", "tiny_chunks", "lines_of_a_batch", "endless_header"])
def test_another_client_is_served_under_an_attack(service: Service, name: str) -> None:
    """The bars of the times are those of `make bars`; here a stall of a second fails."""
    with attacking(name, service.port, clients=1):
        seen = seen_by_another(service, 1.0)
    assert seen.wrong == []
    assert seen.forecast_s
    assert seen.median_s < 1.0


def test_idle_connections_beyond_the_limit_of_files_give_way(tmp_path: Path) -> None:
    """The service may open 256 files; 400 connections send nothing, and others are answered."""
    with serving(tmp_path, "--workers", "1", files=256) as service:
        held = [socket.create_connection(("127.0.0.1", service.port), timeout=10) for _ in range(400)]
        try:
            seen = seen_by_another(service, 2.0)
        finally:
            for connection in held:
                connection.close()
    assert seen.wrong == []
    assert seen.quantile_s(0.99) < 1.0


def test_a_job_that_crashes_workers_fails_and_one_that_lost_killed_ones_is_tried_again() -> None:
    pool = WorkerPool(Settings(), lambda *_, **__: None)
    lost: list[bool] = []

    async def run(crashes: list[bool]) -> str:
        async def run_on(worker: Any, frame: bytes) -> Any:
            lost.append(crashes[len(lost)])
            raise WorkerLost(crashed=lost[-1])

        pool._next_idle = lambda: asyncio.sleep(0)  # type: ignore[assignment, method-assign, return-value]
        pool._run_on = run_on  # type: ignore[method-assign]
        lost.clear()
        try:
            await pool.run({"kind": "forecast"}, b"")
        except Problem as problem:
            return f"{problem.kind} {problem.headers.get('Retry-After')}"
        return ""

    assert asyncio.run(run([True, True, True])) == "internal None"
    assert len(lost) == 2
    assert asyncio.run(run([False, True, False, False])) == "busy 1"
    assert len(lost) == 4
    assert asyncio.run(run([True, False, True])) == "internal None"
    assert KILL_SIGNALS == (-9, -15)


def test_head_is_answered_like_get(service: Service) -> None:
    for path in ("/healthz", "/v1/models", "/"):
        given, asked = service.client.get(path), service.client.head(path)
        assert (asked.status_code, asked.content) == (given.status_code, b"")
        assert asked.headers["content-type"] == given.headers["content-type"]
    refused = service.client.head("/v1/forecast")
    assert (refused.status_code, refused.headers["allow"]) == (405, "POST")
    assert any(r.get("method") == "HEAD" for r in service.records())


def test_all_faults_come_together_with_suggestions(service: Service) -> None:
    answer = service.client.post(
        "/v1/forecast/update",
        json={
            "samples": {"time_s": [0, 1, 1], "speed_m_s": [0, 1, 2], "speed_kmh": [1, 2, 3]},
            "observed": {"time_s": [0, 1], "bms_soc": [2, 0.5]},
            "model": "bmw_i3_tu",
            "vehicle": "vw_id4",
            "resreve": 0.1,
            "soc": 3,
        },
    )
    assert answer.status_code == 422
    faults = {fault["where"]: fault for fault in answer.json()["faults"]}
    assert {
        "samples, column 'speed_kmh'",
        "samples, column 'time_s', row 3",
        "observed, column 'soc', row 1",
        "model",
        "vehicle",
        "resreve",
        "soc",
    } <= set(faults)
    assert faults["model"]["fix"] == "did you mean 'bmw_i3_tum'?"
    assert "'vw_id4_pro'" in faults["vehicle"]["fix"]
    assert faults["resreve"]["fix"] == "did you mean 'reserve'?"
    assert "did you mean speed_m_s" in faults["samples, column 'speed_kmh'"]["fix"]


@pytest.mark.parametrize("depth", [300, 900])
@pytest.mark.parametrize("field", ["links", "samples", "model", "soc", "elevation", "colour"])
def test_nested_json_is_a_fault(service: Service, field: str, depth: int) -> None:
    nested = b"[" * depth + b"]" * depth
    body = b'{"links": [{"length_m": 9, "speed_m_s": 1}], "%s": [%s]}' % (field.encode(), nested)
    answer = service.client.post("/v1/forecast", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422


def test_a_gap_is_refused_or_flagged(service: Service) -> None:
    far = service.forecast({"samples": {"time_s": [0, 1, 43200], "speed_m_s": [10, 10, 10]}})
    assert far.status_code == 422
    assert far.json()["faults"][0]["what"] == "gap in the samples"
    near = service.forecast({"samples": {"time_s": [0, 1, 31, 32], "speed_m_s": [10, 10, 10, 10]}})
    assert "gap_bridged" in {flag["code"] for flag in near.json()["flags"]}
    upload = b"time_s,speed_m_s\n0,10\n1,10\n%d,10\n"
    headers = {"Content-Type": "text/csv"}
    assert service.client.post("/v1/routes", content=upload % 900, headers=headers).status_code == 422
    answer = service.client.post("/v1/routes", content=upload % 40, headers=headers)
    assert [flag["code"] for flag in answer.json()["notes"]] == ["gap_bridged"]
