"""Reading request bodies within bounds of size, time and media type."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Final

from starlette.requests import ClientDisconnect, Request

from tripwatt.server.http.problems import Problem

CLOSE: Final = {"Connection": "close"}
"""Header of a response to a request whose body is not read to its end."""


def request_id(request: Request) -> str:
    """Return the id that the middleware has set for a request."""
    return str(request.scope.get("state", {}).get("request_id", ""))


class Bodies:
    """Request bodies that are arriving, with one bound for the sum of their bytes.

    If slow bodies fill the bound, further bodies are refused until the time-out of bodies.

    Parameters
    ----------
    most : int
        Most bytes of all bodies together.

    Attributes
    ----------
    arriving : int
        Bytes received so far of bodies that are not complete.
    """

    def __init__(self, most: int) -> None:
        self.most, self.arriving = most, 0

    async def read(self, request: Request, media_types: Sequence[str], limit: int, timeout_s: float) -> bytes:
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
            `media-type`, `too-large`, `body-late`, `busy` when other bodies have taken all bytes, or `bad-request` for an
            incomplete body.
        """
        require_media_type(request, media_types)
        parts: list[bytes] = []
        size = 0
        try:
            async with asyncio.timeout(timeout_s):
                async for part in request.stream():
                    size += len(part)
                    self.arriving += len(part)
                    if size > limit:
                        raise Problem("too-large", f"at most {limit} bytes", headers=CLOSE)
                    if self.arriving > self.most:
                        raise Problem("busy", "too many bodies arrive", headers={**CLOSE, "Retry-After": "2"})
                    parts.append(part)
        except TimeoutError:
            raise Problem("body-late", f"longer than {timeout_s:g} s", headers=CLOSE) from None
        except ClientDisconnect:
            raise Problem("bad-request", "the body is incomplete") from None
        finally:
            self.arriving -= size
        return b"".join(parts)


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
