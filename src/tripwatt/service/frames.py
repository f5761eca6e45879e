"""How a job goes to a worker process and its answer comes back: lengths, a small head, a body."""

from __future__ import annotations

import struct
from typing import Any, BinaryIO, Final, Protocol

import orjson

LENGTHS: Final = struct.Struct(">II")
"""Lengths [bytes] of head and body."""


class Reader(Protocol):
    """As much of a stream as a frame needs."""

    async def readexactly(self, n: int) -> bytes:
        """Exactly so many bytes."""


def packed(head: dict[str, Any], body: bytes) -> bytes:
    r"""A frame of a head and a body.

    Examples
    --------
    >>> packed({}, b"x")[8:]
    b'{}x'
    """
    text = orjson.dumps(head)
    return LENGTHS.pack(len(text), len(body)) + text + body


def read_frame(stream: BinaryIO) -> tuple[dict[str, Any], bytes] | None:
    """The next frame of a stream that waits; None at its end."""
    lengths = stream.read(LENGTHS.size)
    if len(lengths) < LENGTHS.size:
        return None
    size, rest = LENGTHS.unpack(lengths)
    text, body = stream.read(size), stream.read(rest)
    return (orjson.loads(text), body) if len(body) == rest else None


async def next_frame(stream: Reader) -> tuple[dict[str, Any], bytes]:
    """The next frame of a stream; `asyncio.IncompleteReadError` at its end."""
    size, rest = LENGTHS.unpack(await stream.readexactly(LENGTHS.size))
    text = await stream.readexactly(size)
    return orjson.loads(text), await stream.readexactly(rest) if rest else b""
