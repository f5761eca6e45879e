"""The batch endpoint: one request per line in, one forecast or problem per line out, in the same order."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator
from typing import Any, Final

import orjson

from tripwatt.errors import Fault
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.pool import WorkerPool, cancel
from tripwatt.server.http.problems import Problem, invalid_input

QUEUED_JOBS: Final = 1
"""Jobs of a batch that wait while every worker runs one: a single request waits for at most these."""


class LineSplitter:
    r"""The lines of the body of a batch, counted while it arrives; empty lines are left out.

    Parameters
    ----------
    most : int
        Most lines.

    Examples
    --------
    >>> splitter = LineSplitter(2)
    >>> for part in (b"{} \n", b" \n[", b"]"):
    ...     splitter.take(part)
    >>> splitter.lines()
    [b'{} ', b'[]']
    """

    def __init__(self, most: int) -> None:
        self.most, self._breaks = most, 0
        self._lines: list[bytes] = []
        self._open: list[bytes] = []

    def take(self, part: bytes) -> None:
        """Take the next part of the body.

        Raises
        ------
        Problem
            `too-large` for too many lines; twice as many line breaks allow for empty lines.
        """
        self._breaks += part.count(b"\n")
        if self._breaks > 2 * self.most:
            raise self._too_many()
        first, *others = part.split(b"\n")
        self._open.append(first)
        for other in others:
            self._close()
            self._open = [other]

    def lines(self) -> list[bytes]:
        """Return all lines after the last part.

        Raises
        ------
        Problem
            `invalid-input` for no line, `too-large` for too many.
        """
        self._close()
        if not self._lines:
            raise invalid_input([Fault("no trips", "body", "no line", "one ForecastRequest per line")])
        return self._lines

    def _close(self) -> None:
        line, self._open = b"".join(self._open), []
        if line.strip():
            self._lines.append(line)
            if len(self._lines) > self.most:
                raise self._too_many()

    def _too_many(self) -> Problem:
        return Problem("too-large", f"at most {self.most} trips", headers={"Connection": "close"})


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
    most_running = pool.settings.workers + QUEUED_JOBS
    try:
        while True:
            while len(running) < most_running and (line := next(remaining, None)) is not None:
                running.append(asyncio.ensure_future(_forecast_line(line, pool, metrics, job)))
            if not running:
                return
            yield await running.popleft()
    finally:
        with contextlib.suppress(asyncio.CancelledError):
            await cancel(running)


async def _forecast_line(line: bytes, pool: WorkerPool, metrics: Metrics, job: dict[str, Any]) -> bytes:
    """A forecast, or a problem document with the trip of the request as far as the line shows it."""
    most_bytes, outcome = pool.settings.limits.body_bytes, "refused"
    try:
        if len(line) > most_bytes:
            raise Problem("too-large", f"at most {most_bytes} bytes per trip")
        outcome = "failed"
        result = await pool.run(job, line, may_queue=True)
    except Problem as problem:
        document = problem.document()
    else:
        metrics.job_seconds.labels("batch").observe(result.seconds)
        outcome = "answered" if result.status == 200 else "refused"
        document = {} if result.status == 200 else orjson.loads(result.content)
    metrics.trips.labels(outcome).inc()
    if outcome == "answered":
        return result.content + b"\n"
    with contextlib.suppress(orjson.JSONDecodeError, AttributeError):
        document["trip"] = orjson.loads(line if len(line) <= most_bytes else b"[]").get("trip", "trip")
    return orjson.dumps(document) + b"\n"
