"""Gzip compression of responses for clients that accept it; a streamed response is flushed with each line."""

from __future__ import annotations

import zlib
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from tripwatt.service.receiving import accepts_gzip

MIN_BYTES: Final = 1000
"""Smaller bodies fit into one packet without compression."""

LEVEL: Final = 4
"""Compression level of zlib: higher levels take longer and hardly shrink series of numbers further."""

GZIP_WINDOW_BITS: Final = 31
"""Largest window of zlib, with the header and the trailer of gzip."""

COMPRESSIBLE_TYPES: Final = (
    "text/",
    "application/json",
    "application/x-ndjson",
    "application/problem+json",
    "image/svg",
)
"""First parts of media types that are compressed; other images and fonts are compressed files already."""


class CompressionMiddleware:
    """ASGI middleware that compresses responses.

    Parameters
    ----------
    app : ASGI application
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] == "http" and accepts_gzip(Headers(scope=scope).get("accept-encoding", "")):
            send = _ResponseCompressor(send).send
        await self.app(scope, receive, send)


class _ResponseCompressor:
    """The `send` of one response; the start is held back until the first part of the body is there."""

    def __init__(self, send: Send) -> None:
        self.send_on = send
        self.start: Message | None = None
        self.compressor = zlib.compressobj(LEVEL, zlib.DEFLATED, GZIP_WINDOW_BITS)
        self.compresses = False

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.start = message
            return
        if message["type"] != "http.response.body":
            await self.send_on(message)
            return
        body, more = message.get("body", b""), message.get("more_body", False)
        start, self.start = self.start, None
        if start is not None:
            self.compresses = _is_worth_compressing(start, body, more)
        if self.compresses:
            body = self.compressor.compress(body)
            body += self.compressor.flush(zlib.Z_SYNC_FLUSH if more else zlib.Z_FINISH)
        if start is not None:
            if self.compresses:
                _set_headers(start, None if more else len(body))
            await self.send_on(start)
        await self.send_on({**message, "body": body})


def _is_worth_compressing(start: Message, body: bytes, more: bool) -> bool:
    headers = Headers(raw=start["headers"])
    return (
        (more or len(body) >= MIN_BYTES)
        and start["status"] not in (204, 206, 304)
        and "content-encoding" not in headers
        and headers.get("content-type", "").startswith(COMPRESSIBLE_TYPES)
    )


def _set_headers(start: Message, length: int | None) -> None:
    """Set the headers of a compressed response; the length of a stream is unknown."""
    headers = MutableHeaders(scope=start)
    headers["Content-Encoding"] = "gzip"
    headers.add_vary_header("Accept-Encoding")
    if length is None:
        del headers["Content-Length"]
    else:
        headers["Content-Length"] = str(length)
