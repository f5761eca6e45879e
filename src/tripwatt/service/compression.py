"""Answers in gzip for those who take it; a stream is flushed line by line, so that it stays one."""

from __future__ import annotations

import zlib
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from tripwatt.service.receiving import accepts_coding

LEAST_BYTES: Final = 1000
"""Smaller answers fit into one packet anyway."""

LEVEL: Final = 4
"""Speed before size: series of numbers hardly get smaller beyond."""

PACKED: Final = ("text/", "application/json", "application/x-ndjson", "application/problem+json", "image/svg")
"""Beginnings of types that get smaller; pictures and fonts are packed already."""


class Packing:
    """The layer that packs."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] == "http" and accepts_coding(Headers(scope=scope).get("accept-encoding", "")):
            send = _Packer(send).send
        await self.app(scope, receive, send)


class _Packer:
    def __init__(self, send: Send) -> None:
        self.out = send
        self.start: Message | None = None
        self.packer = zlib.compressobj(LEVEL, zlib.DEFLATED, 31)
        self.packs = False

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.start = message
            return
        if message["type"] != "http.response.body":
            await self.out(message)
            return
        body, more = message.get("body", b""), message.get("more_body", False)
        if self.start is not None:
            start, self.start = self.start, None
            self.packs = self._worth_it(start, body, more)
            if self.packs:
                headers = MutableHeaders(scope=start)
                headers["Content-Encoding"] = "gzip"
                headers.add_vary_header("Accept-Encoding")
                if more:
                    del headers["Content-Length"]
                else:
                    body = self.packer.compress(body) + self.packer.flush()
                    headers["Content-Length"] = str(len(body))
            await self.out(start)
            if self.packs and not more:
                await self.out({**message, "body": body})
                return
        if self.packs:
            body = self.packer.compress(body)
            body += self.packer.flush(zlib.Z_SYNC_FLUSH if more else zlib.Z_FINISH)
        await self.out({**message, "body": body})

    def _worth_it(self, start: Message, body: bytes, more: bool) -> bool:
        headers = Headers(raw=start["headers"])
        kind = headers.get("content-type", "")
        return (
            (more or len(body) >= LEAST_BYTES)
            and start["status"] not in (204, 206, 304)
            and "content-encoding" not in headers
            and kind.startswith(PACKED)
        )
