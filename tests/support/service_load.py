"""A light load generator: requests that are made once, over connections that stay open.

It shares the machine with what it measures, so that it speaks as little HTTP as it can: it sends bytes that are ready
and reads an answer by its Content-Length.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Load:
    """What was seen: seconds of every answer, in order of arrival, and what was no answer."""

    seconds: list[float] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    wrong: int = 0

    def quantile_ms(self, p: float) -> float:
        """Quantile of the times [ms]."""
        ordered = sorted(self.seconds)
        return 1000.0 * ordered[min(int(p * len(ordered)), len(ordered) - 1)]


def request(path: str, body: bytes, media_type: str = "application/json") -> bytes:
    """A POST request, ready to be sent."""
    head = (
        f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: {media_type}\r\n"
        f"Content-Length: {len(body)}\r\n\r\n"
    )
    return head.encode() + body


async def read_answer(reader: asyncio.StreamReader) -> tuple[int, bytes]:
    """Status and body of the next answer of a connection."""
    head = await reader.readuntil(b"\r\n\r\n")
    lines = head.lower().split(b"\r\n")
    length = next(int(line[15:]) for line in lines if line.startswith(b"content-length:"))
    return int(head[9:12]), await reader.readexactly(length)


async def load(
    port: int,
    requests: list[bytes],
    *,
    seconds: float,
    concurrency: int,
    check: Callable[[int, bytes], bool] = lambda index, body: True,
) -> Load:
    """Send the requests in turn over so many connections, each as soon as the one before is answered.

    Parameters
    ----------
    port : int
        On loopback.
    requests : list of bytes
        From `request`.
    seconds : float
        How long.
    concurrency : int
        Connections.
    check : callable
        Whether an answer to the request of an index is right.
    """
    found = Load()
    until = time.perf_counter() + seconds

    async def client(number: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=1 << 20)
        index = number
        try:
            while (started := time.perf_counter()) < until:
                index = (index + concurrency) % len(requests)
                writer.write(requests[index])
                status, body = await read_answer(reader)
                found.seconds.append(time.perf_counter() - started)
                if status != 200:
                    found.errors.append(f"{status}: {body[:200].decode()}")
                elif not check(index, body):
                    found.wrong += 1
        except (OSError, asyncio.IncompleteReadError) as error:
            found.errors.append(repr(error))
        finally:
            writer.close()

    await asyncio.gather(*(client(number) for number in range(concurrency)))
    return found
