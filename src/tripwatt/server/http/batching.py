"""The batch endpoint: one request per line in, one forecast or problem per line out, in the same order."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator
from typing import Any, Final

import orjson

from tripwatt.errors import InvalidInput
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.pool import JobResult, WorkerPool, cancel_all
from tripwatt.server.http.problems import Problem

QUEUED_JOBS: Final = 1
"""Jobs of a batch that wait while every worker runs one: a single request waits for at most these. A choice."""


def parse_lines(body: bytes, max_lines: int) -> list[bytes]:
    r"""Return the lines of the body of a batch without empty lines.

    Raises
    ------
    InvalidInput
        When there is no line.
    Problem
        `too-large` if there are more than `max_lines` lines, or more than twice as many line breaks.

    Examples
    --------
    >>> parse_lines(b"{} \n \n[]", 2)
    [b'{} ', b'[]']
    """
    breaks = body.count(b"\n")  # before they become a list
    lines = [] if breaks > 2 * max_lines else [line for line in body.split(b"\n") if line.strip()]
    if breaks > 2 * max_lines or len(lines) > max_lines:
        raise Problem("too-large", f"at most {max_lines} trips")
    if not lines:
        raise InvalidInput.of("no trips", "body", "no line", "one ForecastRequest per line")
    return lines


async def forecast_lines(
    lines: list[bytes], pool: WorkerPool, metrics: Metrics, fields: str | None = None
) -> AsyncIterator[bytes]:
    """Forecast the trips of a batch.

    Parameters
    ----------
    lines : list of bytes
        One `ForecastRequest` each.
    pool : WorkerPool
    metrics : Metrics
    fields : str, optional
        Names of fields of a forecast, with commas.

    Yields
    ------
    bytes
        A forecast or a problem document and a line feed, in the order of the requests.
    """
    running: deque[asyncio.Task[bytes]] = deque()
    remaining, job = iter(lines), {"kind": "forecast", "fields": fields}
    max_running = pool.settings.workers + QUEUED_JOBS
    try:
        while True:
            while len(running) < max_running and (line := next(remaining, None)) is not None:
                running.append(asyncio.ensure_future(_forecast_line(line, pool, metrics, job)))
            if not running:
                return
            yield await running.popleft()
    finally:
        with contextlib.suppress(asyncio.CancelledError):
            await cancel_all(running)


async def _forecast_line(line: bytes, pool: WorkerPool, metrics: Metrics, job: dict[str, Any]) -> bytes:
    """Return a forecast, or a problem document with the name of the trip if the line can be read."""
    max_bytes = pool.settings.limits.body_bytes
    try:
        if len(line) > max_bytes:
            raise Problem("too-large", f"at most {max_bytes} bytes per trip")
        result = await pool.run(job, line, may_queue=True)
        metrics.job_seconds.labels("batch").observe(result.seconds)
    except Problem as problem:
        result = JobResult(problem.status, orjson.dumps(problem.document()), 0.0)
    status = result.status
    metrics.trips.labels("answered" if status == 200 else "refused" if status < 500 else "failed").inc()
    if status == 200:
        return result.content + b"\n"
    document = orjson.loads(result.content)
    with contextlib.suppress(orjson.JSONDecodeError, AttributeError):
        document["trip"] = orjson.loads(line if len(line) <= max_bytes else b"[]").get("trip", "trip")
    return orjson.dumps(document) + b"\n"
