"""The batch endpoint: one request per line in, one forecast or problem per line out, in the same order."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator
from typing import Final

import orjson

from tripwatt.errors import Fault
from tripwatt.service.metrics import Metrics
from tripwatt.service.pool import WorkerPool
from tripwatt.service.problems import Problem, invalid_input
from tripwatt.service.settings import Limits

QUEUED_JOBS: Final = 1
"""Jobs of a batch that wait while every worker runs one: a single request waits for at most these."""


def split_lines(body: bytes, limits: Limits) -> list[bytes]:
    r"""Split the body of a batch into its lines, without empty ones.

    Raises
    ------
    Problem
        `invalid-input` for no line, `too-large` for too many.

    Examples
    --------
    >>> split_lines(b"{} \n \n[]", Limits())
    [b'{} ', b'[]']
    """
    lines = [line for line in body.split(b"\n") if line.strip()]
    if not lines:
        raise invalid_input([Fault("no trips", "body", "no line", "one ForecastRequest per line")])
    if len(lines) > limits.batch:
        raise Problem("too-large", f"{len(lines)} trips; at most {limits.batch}")
    return lines


async def forecast_lines(lines: list[bytes], pool: WorkerPool, metrics: Metrics) -> AsyncIterator[bytes]:
    """Forecast the trips of a batch.

    Parameters
    ----------
    lines : list of bytes
        One `ForecastRequest` each.
    pool : WorkerPool
    metrics : Metrics

    Yields
    ------
    bytes
        A forecast or a problem document and a line feed, in the order of the requests.
    """
    running: deque[asyncio.Task[bytes]] = deque()
    remaining = iter(lines)
    most_running = pool.settings.workers + QUEUED_JOBS
    try:
        while True:
            while len(running) < most_running and (line := next(remaining, None)) is not None:
                running.append(asyncio.ensure_future(_forecast_line(line, pool, metrics)))
            if not running:
                return
            yield await running.popleft()
    finally:
        for task in running:
            task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.gather(*running, return_exceptions=True)


async def _forecast_line(line: bytes, pool: WorkerPool, metrics: Metrics) -> bytes:
    most_bytes = pool.settings.limits.body_bytes
    if len(line) > most_bytes:
        metrics.trips.labels("refused").inc()
        return _problem_line(Problem("too-large", f"at most {most_bytes} bytes per trip"))
    try:
        result = await pool.run({"kind": "forecast"}, line, may_queue=True)
    except Problem as problem:
        metrics.trips.labels("failed").inc()
        return _problem_line(problem)
    metrics.trips.labels("answered" if result.status == 200 else "refused").inc()
    metrics.job_seconds.labels("batch").observe(result.seconds)
    return result.content + b"\n"


def _problem_line(problem: Problem) -> bytes:
    return orjson.dumps(problem.document()) + b"\n"
