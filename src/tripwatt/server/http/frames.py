"""Frames between the service and a worker process: two lengths, a head as JSON, and a body."""

from __future__ import annotations

import struct
from asyncio import StreamReader
from typing import Any, BinaryIO, Final

import orjson

LENGTHS: Final = struct.Struct(">II")
"""Lengths [bytes] of head and body."""


def encode_frame(head: dict[str, Any], body: bytes) -> bytes:
    r"""Encode a head and a body as one frame.

    Examples
    --------
    >>> encode_frame({}, b"x")[8:]
    b'{}x'
    """
    text = orjson.dumps(head)
    return LENGTHS.pack(len(text), len(body)) + text + body


def read_frame(stream: BinaryIO) -> tuple[dict[str, Any], bytes] | None:
    """Read the next frame of a blocking stream.

    Returns
    -------
    tuple of dict and bytes, or None
        Head and body; None at the end of the stream.
    """
    lengths = stream.read(LENGTHS.size)
    if len(lengths) < LENGTHS.size:
        return None
    head_bytes, body_bytes = LENGTHS.unpack(lengths)
    text, body = stream.read(head_bytes), stream.read(body_bytes)
    return (orjson.loads(text), body) if len(body) == body_bytes else None


async def read_frame_async(stream: StreamReader) -> tuple[dict[str, Any], bytes]:
    """Read the next frame of an asyncio stream.

    Raises
    ------
    asyncio.IncompleteReadError
        At the end of the stream.
    """
    head_bytes, body_bytes = LENGTHS.unpack(await stream.readexactly(LENGTHS.size))
    text = await stream.readexactly(head_bytes)
    return orjson.loads(text), await stream.readexactly(body_bytes) if body_bytes else b""
