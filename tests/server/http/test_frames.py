"""Frames between the service and its workers, byte by byte."""

from __future__ import annotations

import asyncio
import io

import pytest

from tripwatt.server.http.frames import encode_frame, read_frame, read_frame_async

FRAME = b"\x00\x00\x00\x07\x00\x00\x00\x02" + b'{"a":1}' + b"xy"


def test_a_frame_begins_with_the_lengths_of_head_and_body() -> None:
    assert encode_frame({"a": 1}, b"xy") == FRAME
    assert encode_frame({}, b"") == b"\x00\x00\x00\x02\x00\x00\x00\x00{}"
    assert encode_frame({}, b"x" * 258)[4:8] == b"\x00\x00\x01\x02"


def test_frames_are_read_one_after_the_other_until_the_end() -> None:
    stream = io.BytesIO(FRAME + encode_frame({}, b""))
    assert read_frame(stream) == ({"a": 1}, b"xy")
    assert read_frame(stream) == ({}, b"")
    assert read_frame(stream) is None


@pytest.mark.parametrize("length", [0, 7, 16])
def test_an_incomplete_frame_is_the_end(length: int) -> None:
    assert read_frame(io.BytesIO(FRAME[:length])) is None


def test_frames_are_read_from_an_asyncio_stream() -> None:
    async def run() -> None:
        stream = asyncio.StreamReader()
        stream.feed_data(FRAME + encode_frame({}, b"") + FRAME[:-1])
        stream.feed_eof()
        assert await read_frame_async(stream) == ({"a": 1}, b"xy")
        assert await read_frame_async(stream) == ({}, b"")
        with pytest.raises(asyncio.IncompleteReadError):
            await read_frame_async(stream)

    asyncio.run(run())
