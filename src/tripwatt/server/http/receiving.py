"""Reading request bodies within bounds of size, time and media type."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Final

from starlette.requests import ClientDisconnect, Request

from tripwatt.server.http.problems import Problem

GRACE_S: Final = 0.2
"""Time for which an arriving body cannot be given up for another one."""


def request_id(request: Request) -> str:
    """Return the id that the middleware has set for a request."""
    return str(request.scope.get("state", {}).get("request_id", ""))


class Arrival:
    """A body that is arriving: when it began and how much of it is there.

    Parameters
    ----------
    deadline : asyncio.Timeout
        The time-out of its reading.
    now : float
        Time of the event loop [s].
    """

    def __init__(self, deadline: asyncio.Timeout, now: float) -> None:
        self.deadline, self.started, self.size = deadline, now, 0

    def rate(self, now: float) -> float:
        """Mean bytes per second."""
        return self.size / max(now - self.started, 1e-9)


class Arrivals:
    """Places for bodies that are arriving; when all are taken, the slowest body gives its place to the next one.

    A client that sends slowly can therefore not hold a place that another needs. A body that arrives in one part takes
    no place: the server holds at most 64 kB of a connection, and those connections are counted already.

    Parameters
    ----------
    most : int
        Number of places.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._running: set[Arrival] = set()

    def __len__(self) -> int:
        return len(self._running)

    async def read(
        self,
        request: Request,
        media_types: Sequence[str],
        limit: int,
        timeout_s: float,
        take: Callable[[bytes], object],
    ) -> None:
        """Read the body of a request.

        Parameters
        ----------
        request : Request
        media_types : sequence of str
            Supported types.
        limit : int
            Largest size [bytes], counted as the bytes arrive.
        timeout_s : float
            Longest time [s] until the body is complete.
        take : callable
            Called with each part of the body; what it raises ends the reading.

        Raises
        ------
        Problem
            `media-type`, `too-large`, `body-late`, or `bad-request` for an incomplete body.
        """
        require_media_type(request, media_types)
        length = request.headers.get("content-length", "0")
        if not length.isascii() or not length.isdigit():
            raise Problem("bad-request", "Content-Length is not a number")
        if len(length) > 18 or int(length) > limit:
            raise _too_large(limit)
        try:
            async with asyncio.timeout(timeout_s) as deadline:
                await self._take_all(request, limit, deadline, take)
        except TimeoutError:
            detail = f"slower than others, or longer than {timeout_s:g} s"
            raise Problem("body-late", detail, headers={"Connection": "close"}) from None
        except ClientDisconnect:
            raise Problem("bad-request", "the body is incomplete") from None

    async def _take_all(
        self, request: Request, limit: int, deadline: asyncio.Timeout, take: Callable[[bytes], object]
    ) -> None:
        size, arrival = 0, None
        try:
            while True:
                message = await request.receive()
                if message["type"] == "http.disconnect":
                    raise ClientDisconnect
                part = message.get("body", b"")
                size += len(part)
                if size > limit:
                    raise _too_large(limit)
                take(part)
                if not message.get("more_body", False):
                    return
                if arrival is None:
                    arrival = await self._admit(deadline)
                arrival.size = size
        finally:
            if arrival is not None:
                self._running.discard(arrival)

    async def _admit(self, deadline: asyncio.Timeout) -> Arrival:
        loop = asyncio.get_running_loop()
        while len(self._running) >= self.most:
            now = loop.time()
            oldest_s = now - min(arrival.started for arrival in self._running)
            if oldest_s < GRACE_S:
                await asyncio.sleep(GRACE_S - oldest_s)
                continue
            slow = (arrival for arrival in self._running if now - arrival.started >= GRACE_S)
            slowest = min(slow, key=lambda arrival: arrival.rate(now))
            self._running.discard(slowest)
            slowest.deadline.reschedule(now)
        arrival = Arrival(deadline, loop.time())
        self._running.add(arrival)
        return arrival


def _too_large(limit: int) -> Problem:
    # the rest of the body is not read
    return Problem("too-large", f"at most {limit} bytes", headers={"Connection": "close"})


def require_media_type(request: Request, media_types: Sequence[str]) -> None:
    """Check the media type of a body, and that it is not compressed: its size would be unknown until it is decompressed.

    Raises
    ------
    Problem
        `media-type`.
    """
    given = media_type(request)
    if given not in media_types:
        detail = f"Content-Type is {given or 'missing'}"[:200] + f"; allowed: {', '.join(media_types)}"
        raise Problem("media-type", detail, headers={"Accept": ", ".join(media_types)})
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    if coding not in ("", "identity"):
        detail = "Content-Encoding is not supported: send the body uncompressed"
        raise Problem("media-type", detail, headers={"Accept-Encoding": "identity"})


def media_type(request: Request) -> str:
    """Return the media type of a body in lower case, without parameters; empty when the header is missing."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()
