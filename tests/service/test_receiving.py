"""Bodies as they arrive, lines of a batch, media types and problem documents: by value, on both sides of each bound."""

from __future__ import annotations

import asyncio
import io
from typing import Any

import orjson
import pytest
from starlette.requests import Request

from tripwatt.errors import Fault, InvalidInput
from tripwatt.service.batching import LineSplitter, forecast_lines
from tripwatt.service.frames import encode_frame, read_frame, read_frame_async
from tripwatt.service.metrics import BUCKETS_S, Metrics
from tripwatt.service.middleware import MAX_CLIENTS, TokenBuckets, rate_limit_key
from tripwatt.service.pool import JobResult
from tripwatt.service.problems import MAX_FAULTS, MAX_TEXT_LENGTH, TITLES, Problem, invalid_input
from tripwatt.service.receiving import GRACE_S, Arrival, Arrivals, accepts, media_type, require_media_type
from tripwatt.service.schemas import MIN_DURATION_S, require_duration
from tripwatt.service.settings import Limits


def request(parts: list[bytes] | None = None, **headers: str) -> Request:
    """A request whose body arrives in parts; None for a client that leaves."""
    messages = [
        {"type": "http.request", "body": part, "more_body": k + 1 < len(parts)}
        for k, part in enumerate(parts or [])
    ]
    left = iter(messages if parts is not None else [])

    async def receive() -> Any:
        return next(left, {"type": "http.disconnect"})

    named = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    return Request({"type": "http", "method": "POST", "headers": named}, receive)


def read(asked: Request, limit: int = 10, most: int = 1) -> bytes:
    taken: list[bytes] = []
    asyncio.run(Arrivals(most).read(asked, ["application/json"], limit, 5.0, taken.append))
    return b"".join(taken)


JSON = {"content_type": "application/json"}


def test_a_body_of_the_limit_is_read_and_one_byte_more_is_not() -> None:
    assert read(request([b"12345", b"67890"], **JSON)) == b"1234567890"
    for parts in ([b"12345678901"], [b"1234567890", b"1"]):
        with pytest.raises(Problem) as caught:
            read(request(parts, **JSON))
        assert (caught.value.kind, caught.value.detail) == ("too-large", "at most 10 bytes")
        assert caught.value.headers == {"Connection": "close"}


@pytest.mark.parametrize(
    ("length", "kind"),
    [("10", None), ("11", "too-large"), ("9" * 19, "too-large"), ("-1", "bad-request"), ("x", "bad-request")],
)
def test_the_length_that_a_request_names(length: str, kind: str | None) -> None:
    asked = request([b"{}"], **JSON, content_length=length)
    if kind is None:
        assert read(asked) == b"{}"
        return
    with pytest.raises(Problem) as caught:
        read(asked)
    assert caught.value.kind == kind


def test_an_incomplete_body() -> None:
    with pytest.raises(Problem) as caught:
        read(request(None, **JSON))
    assert (caught.value.kind, caught.value.detail) == ("bad-request", "the body is incomplete")


def test_the_slowest_body_gives_its_place_to_the_next() -> None:
    """Two bodies hold two places; a third one takes that of the slower, which fails as late."""

    async def run() -> list[str]:
        arrivals = Arrivals(2)
        gates = [asyncio.Event() for _ in range(3)]
        sizes = (100, 5, 50)
        ends: list[str] = ["", "", ""]

        async def client(k: int) -> None:
            sent = 0

            async def receive() -> Any:
                nonlocal sent
                sent += 1
                if sent == 1:
                    return {"type": "http.request", "body": b"x" * sizes[k], "more_body": True}
                await gates[k].wait()
                return {"type": "http.request", "body": b"", "more_body": False}

            head = [(b"content-type", b"application/json")]
            asked = Request({"type": "http", "method": "POST", "headers": head}, receive)
            try:
                await arrivals.read(asked, ["application/json"], 1000, 60.0, lambda part: None)
                ends[k] = "read"
            except Problem as problem:
                ends[k] = problem.kind

        loop = asyncio.get_running_loop()
        now = 0.0
        loop.time = lambda: now  # type: ignore[method-assign] # the places are told by this clock alone
        tasks = [asyncio.ensure_future(client(k)) for k in (0, 1)]
        for _ in range(10):
            await asyncio.sleep(0)
        assert len(arrivals) == 2
        now = GRACE_S
        tasks.append(asyncio.ensure_future(client(2)))
        for _ in range(10):
            await asyncio.sleep(0)
        for gate in gates:
            gate.set()
        await asyncio.gather(*tasks)
        assert len(arrivals) == 0
        return ends

    assert asyncio.run(run()) == ["read", "body-late", "read"]


def test_the_rate_of_an_arrival() -> None:
    found = Arrival(None, 10.0)  # type: ignore[arg-type]
    found.size = 300
    assert found.rate(12.0) == 150.0
    assert found.rate(10.0) == 300.0 / 1e-9


def test_media_types() -> None:
    assert media_type(request(content_type=" Application/JSON ; charset=utf-8")) == "application/json"
    assert media_type(request()) == ""
    require_media_type(request(**JSON, content_encoding="Identity"), ["application/json"])
    with pytest.raises(Problem) as caught:
        require_media_type(request(), ["application/json", "text/csv"])
    assert caught.value.detail == "Content-Type is missing; allowed: application/json, text/csv"
    assert caught.value.headers == {"Accept": "application/json, text/csv"}
    with pytest.raises(Problem) as caught:
        require_media_type(request(**JSON, content_encoding="gzip"), ["application/json"])
    assert caught.value.headers == {"Accept-Encoding": "identity"}


@pytest.mark.parametrize(
    ("header", "accepted"),
    [
        ("*/*", True),
        ("application/*", True),
        ("text/*", False),
        ("application/*;q=0, application/json", True),
        ("application/json;q=0, */*", False),
        ("*/*;q=0, application/*;q=0.1", True),
        ("application/json; charset=x; q=0.0", False),
        ("application/json;q=x", False),
        ("application/json, application/json;q=0", False),  # of two of one rank the last counts
        ("", False),
    ],
)
def test_what_an_accept_header_allows(header: str, accepted: bool) -> None:
    assert accepts(header, "application/json") is accepted


def lines_of(parts: list[bytes]) -> list[bytes]:
    splitter = LineSplitter(2)
    for part in parts:
        splitter.take(part)
    return splitter.lines()


def test_lines_of_a_batch_are_counted_on_the_way() -> None:
    splitter = LineSplitter(2)
    splitter.take(b"a\n\nb\n\n")  # four line breaks, two lines
    assert splitter.lines() == [b"a", b"b"]
    for parts in ([b"a\nb\nc"], [b"a\nb\n", b"c"], [b"\n\n\n\n\n"]):
        with pytest.raises(Problem) as caught:
            lines_of(parts)
        assert (caught.value.kind, caught.value.detail) == ("too-large", "at most 2 trips")
    with pytest.raises(Problem) as caught:
        LineSplitter(2).lines()
    assert caught.value.kind == "invalid-input"


class Pool:
    """Forecasts a line as its length; at most so many at once."""

    def __init__(self, workers: int, most_bytes: int) -> None:
        self.settings = type("S", (), {"workers": workers, "limits": Limits(body_bytes=most_bytes)})()
        self.running = self.most = 0

    async def run(self, job: Any, line: bytes, *, may_queue: bool) -> JobResult:
        assert (job, may_queue) == ({"kind": "forecast"}, True)
        self.running += 1
        self.most = max(self.most, self.running)
        await asyncio.sleep(0)
        self.running -= 1
        if line == b"bad":
            raise Problem("timeout")
        return JobResult(422 if line == b"no" else 200, str(len(line)).encode(), 0.003)


def test_lines_are_answered_in_order() -> None:
    async def run() -> list[bytes]:
        return [answer async for answer in forecast_lines(lines, pool, metrics)]  # type: ignore[arg-type]

    pool, metrics = Pool(2, 4), Metrics()
    lines = [b"a", b"bad", b"1234", b"12345", b"no", b"bb"]
    found = asyncio.run(run())
    assert [found[k] for k in (0, 2, 4, 5)] == [b"1\n", b"4\n", b"2\n", b"2\n"]
    assert orjson.loads(found[1])["status"] == 504
    assert orjson.loads(found[3])["detail"] == "at most 4 bytes per trip"
    assert pool.most <= 3  # two workers, and one that waits
    text = metrics.render().decode()
    for outcome, count in (("answered", 3), ("failed", 1), ("refused", 2)):
        assert f'tripwatt_trips_total{{outcome="{outcome}"}} {count}.0' in text
    assert 'tripwatt_work_seconds_count{kind="batch"} 4.0' in text
    assert 'tripwatt_work_seconds_bucket{kind="batch",le="0.0025"} 0.0' in text
    assert 'tripwatt_work_seconds_bucket{kind="batch",le="0.005"} 4.0' in text


def test_the_buckets_of_the_metrics_hold_the_longest_time() -> None:
    assert list(BUCKETS_S) == sorted(BUCKETS_S)
    assert (BUCKETS_S[0], BUCKETS_S[-1]) == (0.0025, Limits().timeout_s)


def test_frames_that_end_too_early() -> None:
    frame = encode_frame({"a": 1}, b"body")
    assert frame[:8] == b"\0\0\0\x07\0\0\0\x04"
    assert read_frame(io.BytesIO(frame + b"rest")) == ({"a": 1}, b"body")
    assert read_frame(io.BytesIO(frame[:7])) is None
    assert read_frame(io.BytesIO(frame[:-1])) is None
    assert read_frame(io.BytesIO(encode_frame({}, b""))) == ({}, b"")

    async def read_async(data: bytes) -> Any:
        reader = asyncio.StreamReader()
        reader.feed_data(data)
        reader.feed_eof()
        return await read_frame_async(reader)

    assert asyncio.run(read_async(frame)) == ({"a": 1}, b"body")
    with pytest.raises(asyncio.IncompleteReadError):
        asyncio.run(read_async(frame[:-1]))


def test_tokens_of_a_client() -> None:
    buckets = TokenBuckets(rate_per_s=2.0, burst=3)
    assert [buckets.wait_s("a", 0.0) for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    assert buckets.wait_s("b", 0.0) == 0.0
    assert buckets.wait_s("a", 0.25) == 0.25  # half a token is there
    assert buckets.wait_s("a", 0.5) == 0.0
    assert [buckets.wait_s("a", 100.0) for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]  # never more than the burst


def test_the_clients_that_were_quiet_longest_are_forgotten() -> None:
    buckets = TokenBuckets(1.0, 1)
    for k in range(MAX_CLIENTS + 1):
        buckets.wait_s(str(k), 0.0)
    assert len(buckets.by_client) == MAX_CLIENTS == 10_000
    assert "0" not in buckets.by_client
    assert "1" in buckets.by_client


@pytest.mark.parametrize(
    ("address", "key"),
    [
        ("::1", None),
        ("2001:db8:0:1:ffff::2", "2001:db8:0:1::/64"),
        ("unix", "unix"),
        ("10.0.0.1", "10.0.0.1"),
    ],
)
def test_keys_of_clients(address: str, key: str | None) -> None:
    assert rate_limit_key(address) == key


def test_statuses_of_problems() -> None:
    assert {kind: status for kind, (status, _) in TITLES.items()} == {
        "not-json": 400,
        "bad-request": 400,
        "host-not-served": 400,
        "token-needed": 401,
        "not-found": 404,
        "method-not-allowed": 405,
        "not-acceptable": 406,
        "body-late": 408,
        "too-large": 413,
        "media-type": 415,
        "invalid-input": 422,
        "head-too-large": 431,
        "too-many-requests": 429,
        "internal": 500,
        "no-map": 501,
        "remote": 502,
        "busy": 503,
        "timeout": 504,
    }


def test_a_document_lists_fifty_faults_and_counts_the_others() -> None:
    faults = [Fault(f"f{k}", f"w{k}", "x" * (MAX_TEXT_LENGTH + k)) for k in range(MAX_FAULTS + 2)]
    full = invalid_input(faults[:MAX_FAULTS]).document("id")
    assert (len(full["faults"]), "more_faults" in full, full["instance"]) == (50, False, "id")
    assert full["detail"] == "w0: f0; w1: f1; w2: f2"
    assert [len(fault["got"]) for fault in full["faults"][:2]] == [300, 300]
    more = invalid_input(faults).document()
    assert (len(more["faults"]), more["more_faults"]) == (50, 2)
    assert "instance" not in more
    assert Problem("busy").document() == {"type": "/problems/busy", "title": TITLES["busy"][1], "status": 503}
    response = Problem("busy", headers={"Retry-After": "1"}).response("id")
    assert (response.status_code, response.headers["retry-after"]) == (503, "1")
    assert response.headers["content-type"] == "application/problem+json"


def test_durations_of_trips() -> None:
    limits = Limits(duration_s=60.0)
    require_duration(MIN_DURATION_S, "samples", limits)
    require_duration(60.0, "samples", limits)
    for wrong in (0.99 * MIN_DURATION_S, 60.1, float("nan")):
        with pytest.raises(InvalidInput, match="duration out of range: samples"):
            require_duration(wrong, "samples", limits)
