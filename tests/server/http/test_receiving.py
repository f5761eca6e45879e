"""Bodies within bounds of size and time, and their media types."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.requests import Request
from tests.support.virtual_time import elapsed_s, run_jumping

from tripwatt.server.http import receiving
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.receiving import (
    GRACE_S,
    Arrival,
    Arrivals,
    media_type,
    require_media_type,
)

JSON = "application/json"


class Body:
    """A body whose parts arrive after the given delays [s]; a part of None ends the connection."""

    def __init__(self, *parts: tuple[float, bytes | None], is_complete: bool = True) -> None:
        self.parts, self.is_complete = list(parts), is_complete

    async def __call__(self) -> dict[str, Any]:
        if not self.parts:
            await asyncio.sleep(3600.0)
        delay_s, part = self.parts.pop(0)
        await asyncio.sleep(delay_s)
        if part is None:
            return {"type": "http.disconnect"}
        return {"type": "http.request", "body": part, "more_body": bool(self.parts) or not self.is_complete}


def asked(body: Body | None = None, **headers: str) -> Request:
    given = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    return Request({"type": "http", "headers": given}, body)  # type: ignore[arg-type]


async def read(
    arrivals: Arrivals, body: Body, limit: int = 10, timeout_s: float = 20.0, **more: str
) -> bytes:
    parts: list[bytes] = []
    request = asked(body, content_type=JSON, **more)
    await arrivals.read(request, (JSON,), limit, timeout_s, parts.append)
    return b"".join(parts)


def problem_of(body: Body, **more: Any) -> Problem:
    with pytest.raises(Problem) as caught:
        run_jumping(read(Arrivals(1), body, **more))
    return caught.value


def test_a_body_of_the_largest_size_is_read() -> None:
    assert run_jumping(read(Arrivals(1), Body((0.0, b"12345"), (0.0, b"67890")))) == b"1234567890"
    assert run_jumping(read(Arrivals(1), Body((0.0, b"1234567890")), content_length="10")) == b"1234567890"
    assert run_jumping(read(Arrivals(1), Body((0.0, b"")), content_length="0")) == b""


def test_one_byte_more_is_refused() -> None:
    counted = problem_of(Body((0.0, b"12345"), (0.0, b"678901")))
    announced = problem_of(Body((0.0, b"1")), content_length="11")
    for problem in (counted, announced):
        assert (problem.kind, problem.detail) == ("too-large", "at most 10 bytes")
        assert problem.headers == {"Connection": "close"}


def test_a_length_has_at_most_18_digits() -> None:
    body = Body((0.0, b"1"))
    assert run_jumping(read(Arrivals(1), body, limit=10**18, content_length="9" * 18)) == b"1"
    assert problem_of(Body((0.0, b"1")), limit=10**20, content_length="0" * 18 + "1").kind == "too-large"


@pytest.mark.parametrize("length", ["-1", "1.0", "", "x", "+1", "1 "])
def test_a_length_is_a_number(length: str) -> None:
    problem = problem_of(Body((0.0, b"1")), content_length=length)
    assert (problem.kind, problem.detail) == ("bad-request", "Content-Length is not a number")


def test_digits_of_other_scripts_are_no_length() -> None:
    request = Request(
        {"type": "http", "headers": [(b"content-type", JSON.encode()), (b"content-length", b"\xb2")]},
        Body((0.0, b"1")),  # type: ignore[arg-type]
    )
    with pytest.raises(Problem) as caught:
        run_jumping(Arrivals(1).read(request, (JSON,), 10, 1.0, lambda part: None))
    assert caught.value.kind == "bad-request"


def test_a_body_that_breaks_off_is_incomplete() -> None:
    problem = problem_of(Body((0.0, b"1"), (0.0, None)))
    assert (problem.kind, problem.detail) == ("bad-request", "the body is incomplete")


def test_a_body_has_its_time() -> None:
    async def run() -> None:
        arrivals = Arrivals(1)
        assert await read(arrivals, Body((1.0, b"1"), (1.4, b"2")), timeout_s=2.5) == b"12"
        assert elapsed_s() == 2.4
        with pytest.raises(Problem) as caught:
            await read(arrivals, Body((0.0, b"1"), is_complete=False), timeout_s=2.5)
        assert elapsed_s() == 4.9
        assert caught.value.kind == "body-late"
        assert caught.value.detail == "slower than others, or longer than 2.5 s"
        assert caught.value.headers == {"Connection": "close"}
        assert len(arrivals) == 0

    run_jumping(run())


def test_a_body_in_one_part_takes_no_place() -> None:
    async def run() -> None:
        arrivals = Arrivals(0)
        assert await read(arrivals, Body((0.0, b"1"))) == b"1"
        assert elapsed_s() == 0.0

    run_jumping(run())


def test_a_body_keeps_one_place_until_its_end() -> None:
    async def run() -> None:
        arrivals = Arrivals(2)
        task = asyncio.create_task(read(arrivals, Body((0.0, b"1"), (1.0, b"2"), (1.0, b"3"))))
        await asyncio.sleep(0.5)
        assert len(arrivals) == 1
        await asyncio.sleep(1.0)
        assert len(arrivals) == 1
        assert await task == b"123"
        assert len(arrivals) == 0

    run_jumping(run())


def test_the_grace_is_a_fifth_of_a_second() -> None:
    assert GRACE_S == 0.2


def test_a_further_body_waits_for_the_grace_of_the_oldest() -> None:
    async def run() -> None:
        arrivals = Arrivals(1)
        slow = asyncio.create_task(read(arrivals, Body((0.0, b"1"), (9.0, b"2"))))
        await asyncio.sleep(0.05)
        assert await read(arrivals, Body((0.0, b"3"), (0.0, b"4"))) == b"34"
        assert elapsed_s() == 0.2
        with pytest.raises(Problem) as caught:
            await slow
        assert caught.value.kind == "body-late"
        assert elapsed_s() == 0.2

    run_jumping(run())


@pytest.mark.parametrize("grace_s", [GRACE_S, 0.25])
def test_a_further_body_does_not_wait_after_the_grace(
    monkeypatch: pytest.MonkeyPatch, grace_s: float
) -> None:
    monkeypatch.setattr(receiving, "GRACE_S", grace_s)  # a quarter has no rounding error

    async def run() -> None:
        arrivals = Arrivals(1)
        slow = asyncio.create_task(read(arrivals, Body((0.0, b"1"), (9.0, b"2"))))
        await asyncio.sleep(grace_s)
        assert await read(arrivals, Body((0.0, b"3"), (0.0, b"4"))) == b"34"
        assert elapsed_s() == grace_s
        with pytest.raises(Problem):
            await slow

    run_jumping(run())


def test_there_is_a_place_until_all_are_taken() -> None:
    async def run() -> None:
        arrivals = Arrivals(2)
        first = asyncio.create_task(read(arrivals, Body((0.0, b"1"), (9.0, b"2"))))
        await asyncio.sleep(1.0)
        assert await read(arrivals, Body((0.0, b"3"), (1.0, b"4"))) == b"34"
        assert await first == b"12"

    run_jumping(run())


def test_the_slowest_body_gives_its_place() -> None:
    """The first body has 2 bytes in 4 s, the second 3 bytes in 4 s, the third is younger than the grace."""

    async def run() -> None:
        arrivals = Arrivals(3)
        bodies = (
            Body((0.0, b"1"), (1.0, b"2"), (9.0, b".")),
            Body((0.0, b"12"), (1.0, b"3"), (9.0, b".")),
            Body((3.9, b""), (9.0, b".")),
        )
        slow, fast, young = [asyncio.create_task(read(arrivals, body)) for body in bodies]
        await asyncio.sleep(4.0)
        assert await read(arrivals, Body((0.0, b"x"), (0.0, b"y"))) == b"xy"
        with pytest.raises(Problem):
            await slow
        assert elapsed_s() == 4.0
        assert (await fast, await young) == (b"123.", b".")

    run_jumping(run())


def test_the_rate_of_an_arrival_is_its_bytes_by_its_time() -> None:
    arrival = Arrival(asyncio.Timeout(None), 100.0)
    assert (arrival.size, arrival.rate(104.0)) == (0, 0.0)
    arrival.size = 50
    assert arrival.rate(104.0) == 12.5
    assert arrival.rate(100.0) == pytest.approx(5e10)


def test_a_media_type_has_no_parameters_and_no_case() -> None:
    assert media_type(asked(content_type=" Application/JSON ; charset=utf-8")) == JSON
    assert media_type(asked()) == ""


def test_other_media_types_are_refused_with_those_allowed() -> None:
    require_media_type(asked(content_type="text/csv"), (JSON, "text/csv"))
    with pytest.raises(Problem) as caught:
        require_media_type(asked(), (JSON, "text/csv"))
    assert caught.value.kind == "media-type"
    assert caught.value.detail == "Content-Type is missing; allowed: application/json, text/csv"
    assert caught.value.headers == {"Accept": "application/json, text/csv"}


def test_a_long_media_type_is_cut() -> None:
    with pytest.raises(Problem) as caught:
        require_media_type(asked(content_type="x" * 300), (JSON,))
    assert caught.value.detail == "Content-Type is " + "x" * 184 + "; allowed: application/json"


def test_a_compressed_body_is_refused() -> None:
    for coding in ("", " Identity "):
        require_media_type(asked(content_type=JSON, content_encoding=coding), (JSON,))
    with pytest.raises(Problem) as caught:
        require_media_type(asked(content_type=JSON, content_encoding="gzip"), (JSON,))
    assert (caught.value.kind, caught.value.headers) == ("media-type", {"Accept-Encoding": "identity"})
