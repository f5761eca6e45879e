"""Reading request bodies within bounds of size, time and media type, and content negotiation."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from starlette.requests import ClientDisconnect, Request

from tripwatt.service.problems import Problem


async def read_body(request: Request, media_types: Sequence[str], limit: int, timeout_s: float) -> bytes:
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

    Raises
    ------
    Problem
        `media-type`, `too-large`, `body-late`, or `bad-request` for an incomplete body.
    """
    require_media_type(request, media_types)
    length = request.headers.get("content-length", "0")
    if not length.isascii() or not length.isdigit():
        raise Problem("bad-request", "Content-Length is not a number")
    if int(length) > limit:
        raise _too_large(limit)
    parts, size = [], 0
    try:
        async with asyncio.timeout(timeout_s):
            async for part in request.stream():
                size += len(part)
                if size > limit:
                    raise _too_large(limit)
                parts.append(part)
    except TimeoutError:
        raise Problem("body-late", f"longer than {timeout_s:g} s", headers={"Connection": "close"}) from None
    except ClientDisconnect:
        raise Problem("bad-request", "the body is incomplete") from None
    return parts[0] if len(parts) == 1 else b"".join(parts)


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


def require_accepts(request: Request, media_type: str) -> None:
    """Check that the Accept header of a request allows the media type of the response.

    Raises
    ------
    Problem
        `not-acceptable`.
    """
    given = ",".join(request.headers.getlist("accept"))
    if given.strip() and not accepts(given, media_type):
        raise Problem("not-acceptable", f"the response is {media_type}")


def accepts(header: str, media_type: str) -> bool:
    """Whether an Accept header allows a media type (RFC 9110, 12.5.1); the most specific range decides.

    Examples
    --------
    >>> accepts("text/html, */*;q=0.1", "application/json"), accepts("text/html", "application/json")
    (True, False)
    >>> accepts("*/*, application/json;q=0", "application/json")
    False
    """
    main = media_type.partition("/")[0]
    ranges = {"*/*": 1, f"{main}/*": 2, media_type: 3}
    best, quality = 0, 0.0
    for part in header.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        rank = ranges.get(name, 0)
        if rank >= best and rank:
            best, quality = rank, _quality(parameters)
    return quality > 0.0


def _quality(parameters: Sequence[str]) -> float:
    for parameter in parameters:
        key, _, value = parameter.partition("=")
        if key.strip() == "q":
            try:
                return float(value)
            except ValueError:
                return 0.0
    return 1.0


def accepts_gzip(header: str) -> bool:
    """Whether an Accept-Encoding header allows gzip.

    Examples
    --------
    >>> accepts_gzip("br, gzip;q=0.5"), accepts_gzip("gzip;q=0"), accepts_gzip("")
    (True, False, False)
    """
    for part in header.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        if name in ("gzip", "x-gzip"):
            return _quality(parameters) > 0.0
    return False
