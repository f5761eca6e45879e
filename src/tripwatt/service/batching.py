"""Many trips in one request: lines in, lines out, in order, while the workers go on."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator
from typing import Final

import orjson

from tripwatt.errors import Fault
from tripwatt.service.metrics import Metrics
from tripwatt.service.pool import Crew
from tripwatt.service.problems import Problem, invalid
from tripwatt.service.settings import Limits

AHEAD: Final = 1
"""Jobs of a batch that wait while each worker has one: a request that comes in between waits for no more than these."""


def lines_of(body: bytes, limits: Limits) -> list[bytes]:
    r"""The lines of a batch that hold something.

    Raises
    ------
    Problem
        `invalid-input` without any, `too-large` with too many.

    Examples
    --------
    >>> lines_of(b"{} \n \n[]", Limits())
    [b'{} ', b'[]']
    """
    lines = [line for line in body.split(b"\n") if line.strip()]
    if not lines:
        raise invalid([Fault("no trips", "body", "no line", "one ForecastRequest per line")])
    if len(lines) > limits.batch:
        raise Problem("too-large", f"{len(lines)} trips; at most {limits.batch}")
    return lines


async def answers(lines: list[bytes], crew: Crew, metrics: Metrics) -> AsyncIterator[bytes]:
    """A line for each trip, in order: its answer, or the problem that it has."""
    running: deque[asyncio.Task[bytes]] = deque()
    left = iter(lines)
    width = crew.settings.workers + AHEAD
    try:
        while True:
            while len(running) < width and (line := next(left, None)) is not None:
                running.append(asyncio.ensure_future(_answer(line, crew, metrics)))
            if not running:
                return
            yield await running.popleft()
    finally:
        for task in running:
            task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.gather(*running, return_exceptions=True)


async def _answer(line: bytes, crew: Crew, metrics: Metrics) -> bytes:
    if len(line) > crew.settings.limits.body_bytes:
        problem = Problem("too-large", f"at most {crew.settings.limits.body_bytes} bytes a trip")
        metrics.trips.labels("refused").inc()
        return orjson.dumps(problem.document()) + b"\n"
    try:
        reply = await crew.run({"kind": "forecast"}, line, patient=True)
    except Problem as problem:
        metrics.trips.labels("failed").inc()
        return orjson.dumps(problem.document()) + b"\n"
    metrics.trips.labels("answered" if reply.status == 200 else "refused").inc()
    metrics.work.labels("batch").observe(reply.seconds)
    return reply.content + b"\n"
