"""The bounds of a connection, byte by byte and with a clock that jumps."""

from __future__ import annotations

import asyncio
from typing import Any

import uvicorn
from tests.support.virtual_time import elapsed_s, run_jumping
from uvicorn.server import ServerState

from tripwatt.server.http.protocol import BoundedProtocol

START = b"GET / HTTP/1.1\r\nHost: x\r\n"
POST = b"POST / HTTP/1.1\r\nHost: x\r\n"


class Transport(asyncio.Transport):
    """Keeps what is written, and when the connection was closed or aborted."""

    def __init__(self) -> None:
        super().__init__()
        self.written = b""
        self.closed_s: float | None = None
        self.aborted_s: float | None = None
        self.closes = 0

    def is_closing(self) -> bool:
        return self.closed_s is not None

    def close(self) -> None:
        self.closes += 1
        self.closed_s = elapsed_s()

    def abort(self) -> None:
        self.aborted_s = elapsed_s()

    def pause_reading(self) -> None: ...

    def resume_reading(self) -> None: ...

    def write(self, data: Any) -> None:
        self.written += data


class Connection:
    """A connection to an application that notes the bodies of its requests."""

    def __init__(self, *, answers: bool = True) -> None:
        self.bodies: list[bytes] = []
        self.headers: list[int] = []

        async def app(scope: Any, receive: Any, send: Any) -> None:
            self.headers.append(len(scope["headers"]))
            body, more = b"", True
            while more:
                message = await receive()
                body += message.get("body", b"")
                more = message.get("more_body", False)
            self.bodies.append(body)
            if not answers:
                await asyncio.sleep(3600.0)
            await send({"type": "http.response.start", "status": 204, "headers": []})
            await send({"type": "http.response.body", "body": b""})

        config = uvicorn.Config(app, log_config=None, access_log=False, timeout_keep_alive=75)
        config.load()
        self.state = ServerState()
        self.protocol = BoundedProtocol(config, self.state, {})
        self.transport = Transport()
        self.protocol.connection_made(self.transport)

    def send(self, data: bytes) -> Connection:
        self.protocol.data_received(data)
        return self

    async def end(self) -> None:
        self.protocol.connection_lost(None)
        for task in list(self.state.tasks):
            task.cancel()
        await asyncio.sleep(0)

    @property
    def is_refused(self) -> bool:
        return b"HTTP/1.1 400 Bad Request\r\n" in self.transport.written


def test_a_chunk_without_an_end_is_bounded() -> None:
    head = POST + b"Transfer-Encoding: chunked\r\n\r\n1\r\n{\r\n0\r\n"
    trailer = b"t: " + b"x" * 32_765

    async def run() -> tuple[bool, bool]:
        connection = Connection()
        connection.send(head)
        connection.send(trailer)
        before = connection.transport.is_closing()
        connection.send(b"x")
        after = connection.transport.is_closing()
        await connection.end()
        return before, after

    assert run_jumping(run()) == (False, True)


def test_a_client_has_twenty_seconds_to_read() -> None:
    async def run() -> None:
        stalled, reading, gone = (Connection(answers=False).send(START + b"\r\n") for _ in range(3))
        for connection in (stalled, reading, gone):
            connection.protocol.pause_writing()
        await asyncio.sleep(5.0)
        stalled.protocol.pause_writing()
        reading.protocol.resume_writing()
        await gone.end()
        await asyncio.sleep(5.0)
        reading.protocol.pause_writing()
        await asyncio.sleep(30.0)
        found = [c.transport.aborted_s for c in (stalled, reading, gone)]
        assert found == [20.0, 30.0, None]
        await stalled.end()
        await reading.end()

    run_jumping(run())
