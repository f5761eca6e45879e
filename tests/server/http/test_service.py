"""Bodies within bounds of size and time, and their media types."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.requests import Request
from tests.support.virtual_time import elapsed_s, run_jumping

from tripwatt.server.http.problems import Problem
from tripwatt.server.http.service import CLOSE, Service, media_type, require_media_type
from tripwatt.server.http.settings import Limits, Settings
from tripwatt.server.http.sharing import Places

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


def bodies_of(most: int) -> Service:
    service = Service.__new__(Service)
    service.bodies = Places(most, "too many bodies arrive", {**CLOSE, "Retry-After": "2"})
    return service


async def read(bodies: Service, body: Body, limit: int = 10, timeout_s: float = 20.0) -> bytes:
    bodies.settings = Settings(limits=Limits(body_timeout_s=timeout_s))
    return await bodies.read_body(asked(body, content_type=JSON), (JSON,), limit)


def problem_of(body: Body) -> Problem:
    with pytest.raises(Problem) as caught:
        run_jumping(read(bodies_of(100), body))
    return caught.value


def test_a_body_has_a_largest_size() -> None:
    assert run_jumping(read(bodies_of(100), Body((0.0, b"12345"), (0.0, b"67890")))) == b"1234567890"
    assert run_jumping(read(bodies_of(100), Body((0.0, b"")))) == b""
    problem = problem_of(Body((0.0, b"12345"), (0.0, b"678901")))
    assert (problem.kind, problem.detail) == ("too-large", "at most 10 bytes")
    assert problem.headers == {"Connection": "close"}


def test_a_body_that_breaks_off_is_incomplete() -> None:
    problem = problem_of(Body((0.0, b"1"), (0.0, None)))
    assert (problem.kind, problem.detail) == ("bad-request", "the body is incomplete")


def test_a_body_has_its_time() -> None:
    async def run() -> None:
        bodies = bodies_of(100)
        assert await read(bodies, Body((1.0, b"1"), (1.4, b"2")), timeout_s=2.5) == b"12"
        assert elapsed_s() == 2.4
        with pytest.raises(Problem) as caught:
            await read(bodies, Body((0.0, b"1"), is_complete=False), timeout_s=2.5)
        assert elapsed_s() == 4.9
        assert (caught.value.kind, caught.value.detail) == ("body-late", "longer than 2.5 s")
        assert caught.value.headers == {"Connection": "close"}
        assert bodies.bodies.taken.total() == 0

    run_jumping(run())


def test_all_bodies_together_have_a_largest_size() -> None:
    """The body that exceeds it is refused; slow ones hold what they have sent, and are read to their ends."""

    async def run() -> None:
        bodies = bodies_of(24)
        slow = asyncio.create_task(read(bodies, Body((0.0, b"12345"), (9.0, b"678"))))
        await asyncio.sleep(1.0)
        assert bodies.bodies.taken.total() == 5
        assert await read(bodies, Body((0.0, b"1234567"))) == b"1234567"
        with pytest.raises(Problem) as caught:
            await read(bodies, Body((0.0, b"1234"), (0.0, b"5678")))
        assert caught.value.kind == "busy"
        assert caught.value.headers == {"Connection": "close", "Retry-After": "2"}
        assert bodies.bodies.taken.total() == 5
        assert await slow == b"12345678"
        assert bodies.bodies.taken.total() == 0

    run_jumping(run())


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
    with pytest.raises(Problem) as long:
        require_media_type(asked(content_type="x" * 300), (JSON,))
    assert long.value.detail == "Content-Type is " + "x" * 184 + "; allowed: application/json"


def test_a_compressed_body_is_refused() -> None:
    for coding in ("", " Identity "):
        require_media_type(asked(content_type=JSON, content_encoding=coding), (JSON,))
    with pytest.raises(Problem) as caught:
        require_media_type(asked(content_type=JSON, content_encoding="gzip"), (JSON,))
    assert (caught.value.kind, caught.value.headers) == ("media-type", {"Accept-Encoding": "identity"})
