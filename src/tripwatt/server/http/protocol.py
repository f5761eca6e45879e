"""The HTTP protocol of the server with the bounds that uvicorn lacks: bytes of a head, connections, and time to read a response.

A proxy has to bound the time of a head, and the rate and the connections of one client.
"""

from __future__ import annotations

import asyncio
import sys
from typing import Any, Final

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

if sys.platform != "win32":
    import resource

MAX_HEAD_BYTES: Final = 32_768
"""Most bytes that a connection may send without completing a head or a part of a body. A choice."""

SLICE_BYTES: Final = 16_384
"""Bytes that the parser takes at a time; the bound of the head is checked in between. A choice: half of `MAX_HEAD_BYTES`."""

SEND_TIMEOUT_S: Final = 20.0
"""Longest time that a client may leave a full send buffer unread. A choice, as `Limits.body_timeout_s`."""


def max_connections() -> int:
    """Return half of the number of files that the process may open; workers, uploads and new connections need the others."""
    if sys.platform == "win32":
        return 512
    return min(resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2, 16_384)


class BoundedProtocol(HttpToolsProtocol):
    """HTTP/1.1 of uvicorn with bounds."""

    max_connections = max_connections()

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._body: list[bytes] = []
        self._unused_bytes = 0
        self._received_s = self.loop.time()
        self._send_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection; if there are too many, close the one that has been idle for longest."""
        super().connection_made(transport)
        if len(self.connections) > self.max_connections:
            idle = (c for c in self.connections if isinstance(c, BoundedProtocol) and c.is_idle)
            min(idle, key=lambda connection: connection._received_s).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer."""
        self.resume_writing()
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether the connection is not closing and no request is being answered."""
        return not self.transport.is_closing() and (self.cycle is None or self.cycle.response_complete)

    def data_received(self, data: bytes) -> None:
        """Parse received bytes in slices, until a head exceeds its bound."""
        self._received_s = self.loop.time()
        for start in range(0, len(data), SLICE_BYTES):
            if self.transport.is_closing():
                return
            part = data[start : start + SLICE_BYTES]
            self._unused_bytes += len(part)
            super().data_received(part)
            self._pass_body_on()
            if self._unused_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
                self.send_400_response(f"A head has at most {MAX_HEAD_BYTES} bytes.")

    def on_headers_complete(self) -> None:
        """Reset the count of bytes at the end of a head."""
        self._unused_bytes = 0
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Collect a part of the body; the parts of a slice are passed on together, because each pass copies what waits."""
        self._unused_bytes = 0
        self._body.append(body)

    def on_message_complete(self) -> None:
        """Pass the rest of the body on at the end of a request."""
        self._unused_bytes = 0
        self._pass_body_on()
        super().on_message_complete()

    def pause_writing(self) -> None:
        """Start the time-out of a client that does not read, because its response is held meanwhile."""
        super().pause_writing()
        if self._send_timer is None:
            self._send_timer = self.loop.call_later(SEND_TIMEOUT_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop the time-out of a client that reads again."""
        if self._send_timer is not None:
            self._send_timer.cancel()
            self._send_timer = None
        super().resume_writing()

    def _pass_body_on(self) -> None:
        if self._body:
            body, self._body = b"".join(self._body), []
            super().on_body(body)
