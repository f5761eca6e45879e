"""The HTTP protocol of the server with bounds that hold before the application gets a request.

Uvicorn bounds neither the head of a request nor the time until it is complete, and waits for a client that does not read its
response. A connection that exceeds a bound gets a problem document or is closed; the application and other connections do
not notice it.
"""

from __future__ import annotations

import asyncio
import sys
from http import HTTPStatus
from typing import Any, Final

import orjson
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from tripwatt.server.http.problems import MEDIA_TYPE, Problem

if sys.platform != "win32":
    import resource

MAX_HEAD_BYTES: Final = 32_768
"""Most bytes that a connection may send without completing a head or a part of a body."""

MAX_HEADERS: Final = 100
"""Most headers and trailers of a request."""

SLICE_BYTES: Final = 16_384
"""Bytes that the parser takes at a time; the bound of the head is checked in between."""

HEAD_TIMEOUT_S: Final = 10.0
"""Longest time until the head of a request is complete."""

SEND_TIMEOUT_S: Final = 20.0
"""Longest time that a client may leave a full send buffer unread."""


def most_connections() -> int:
    """Half of the files that the process may open: workers, uploads and connections that just arrive need the others."""
    if sys.platform == "win32":
        return 512
    return min(resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2, 16_384)


class BoundedProtocol(HttpToolsProtocol):
    """HTTP/1.1 of uvicorn with bounds of the head of a request and of slow clients.

    Raising inside a callback of the parser ends the request with `send_400_response`.
    """

    _timer: asyncio.TimerHandle | None = None
    _send_timer: asyncio.TimerHandle | None = None
    _unused_bytes = 0
    _progress = False
    _is_too_large = False
    _heard_s = 0.0
    most_connections = most_connections()

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._body: list[bytes] = []

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the time of the first head; with too many connections, close the one that is idle for longest."""
        super().connection_made(transport)
        self._heard_s = self.loop.time()
        self._start_timer()
        if len(self.connections) > self.most_connections:
            open_ones = (c for c in self.connections if isinstance(c, BoundedProtocol) and c.is_idle)
            min(open_ones, key=lambda one: one._heard_s).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timers."""
        self._stop_timer()
        self.resume_writing()
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether no request is answered, and the connection is not closing."""
        return not self.transport.is_closing() and (self.cycle is None or self.cycle.response_complete)

    def data_received(self, data: bytes) -> None:
        """Parse received bytes in slices, until one exceeds the bound."""
        self._heard_s = self.loop.time()
        for start in range(0, len(data), SLICE_BYTES):
            if self.transport.is_closing():
                return
            part = data[start : start + SLICE_BYTES]
            self._progress = False
            super().data_received(part)
            self._pass_body_on()
            self._unused_bytes = 0 if self._progress else self._unused_bytes + len(part)
            if self._unused_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
                self._is_too_large = True
                self.send_400_response("")

    def on_message_begin(self) -> None:
        """Start the time of the head."""
        super().on_message_begin()
        self._start_timer()

    def on_header(self, name: bytes, value: bytes) -> None:
        """Count the header."""
        if len(self.headers) >= MAX_HEADERS:
            self._is_too_large = True
            raise ValueError("too many headers")
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Stop the time of the head."""
        self._progress = True
        self._stop_timer()
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Take a part of the body; the parts of a slice are passed on together, because each copies what waits."""
        self._progress = True
        self._body.append(body)

    def on_message_complete(self) -> None:
        """End a request."""
        self._progress = True
        self._pass_body_on()
        super().on_message_complete()

    def send_400_response(self, msg: str) -> None:
        """Answer a request that is no HTTP or exceeds a bound, and close the connection."""
        detail = f"at most {MAX_HEAD_BYTES} bytes and {MAX_HEADERS} headers" if self._is_too_large else msg
        problem = Problem("head-too-large" if self._is_too_large else "bad-request", detail)
        self._stop_timer()
        if self.cycle is None or self.cycle.response_complete:
            body = orjson.dumps(problem.document())
            head = (
                f"HTTP/1.1 {problem.status} {HTTPStatus(problem.status).phrase}\r\nContent-Type: {MEDIA_TYPE}\r\n"
                f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
            )
            self.transport.write(head.encode() + body)
        self.transport.close()

    def pause_writing(self) -> None:
        """Start the time of the client to read; an unread response would be held until then."""
        super().pause_writing()
        if self._send_timer is None:
            self._send_timer = self.loop.call_later(SEND_TIMEOUT_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop the time of the client to read."""
        if self._send_timer is not None:
            self._send_timer.cancel()
            self._send_timer = None
        super().resume_writing()

    def _pass_body_on(self) -> None:
        if self._body:
            body, self._body = b"".join(self._body), []
            super().on_body(body)

    def _start_timer(self) -> None:
        self._stop_timer()
        self._timer = self.loop.call_later(HEAD_TIMEOUT_S, self._on_late_head)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _on_late_head(self) -> None:
        if not self.transport.is_closing():
            self.transport.close()
