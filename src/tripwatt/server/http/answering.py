"""From a request to its response: the body within its bounds, a job of the pool, and the document that it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import orjson
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.server.http.contract import tagged
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.openapi import JSON
from tripwatt.server.http.pool import JobResult, WorkerPool
from tripwatt.server.http.problems import MEDIA_TYPE, Problem
from tripwatt.server.http.receiving import Bodies, request_id
from tripwatt.server.http.settings import Settings


class Answering:
    """Reading of bodies and running of jobs, for all endpoints that have a job.

    Parameters
    ----------
    settings : Settings
    pool : WorkerPool
    metrics : Metrics

    Attributes
    ----------
    bodies : Bodies
        Bodies that are arriving.
    """

    def __init__(self, settings: Settings, pool: WorkerPool, metrics: Metrics) -> None:
        self.settings, self.pool, self.metrics = settings, pool, metrics
        self.bodies = Bodies(settings.limits.arriving_bytes)
        self._kept: dict[bytes, bytes] = {}

    async def read(
        self, request: Request, media_types: Sequence[str] = (JSON,), max_bytes: int | None = None
    ) -> bytes:
        """Read the body of a request for a job; raise the problem `busy` if too many requests wait already."""
        limits = self.settings.limits
        if self.pool.waiting >= limits.waiting:
            raise Problem("busy", "too many requests wait", headers={"Retry-After": "1"})
        most = limits.body_bytes if max_bytes is None else max_bytes
        return await self.bodies.read(request, media_types, most, limits.body_timeout_s)

    async def job(
        self, request: Request, kind: str, body: bytes = b"", media_type: str = JSON, **parameters: Any
    ) -> Response:
        """Run a job, and return its document as the response to a request."""
        result = await self.pool.run({"kind": kind, **parameters}, body)
        self.metrics.job_seconds.labels(kind).observe(result.seconds)
        return answer(request, result, media_type)

    async def body_job(self, request: Request, kind: str, **parameters: Any) -> Response:
        """Run a job on the body of a request, and return its document as the response."""
        return await self.job(request, kind, await self.read(request), **parameters)

    async def kept(self, request: Request, kind: str, **parameters: Any) -> Response:
        """Return a document that stays the same while the service runs; its job runs only once."""
        key = orjson.dumps([kind, parameters])
        if key not in self._kept:
            response = await self.job(request, kind, **parameters)
            if response.status_code == 404:
                return response
            if response.status_code != 200:
                raise Problem("internal")  # without input there is nothing to correct
            self._kept[key] = bytes(response.body)
        return tagged(request, self._kept[key], JSON)


def answer(request: Request, result: JobResult, media_type: str = JSON) -> Response:
    """Return the result of a job as the response to a request; a problem document gets the id of the request."""
    if result.status == 200:
        return Response(result.content, media_type=media_type)
    problem = {**orjson.loads(result.content), "instance": request_id(request)}
    return Response(orjson.dumps(problem), result.status, media_type=MEDIA_TYPE)


def json_response(document: Mapping[str, Any]) -> Response:
    """Return a document as a response."""
    return Response(orjson.dumps(document), media_type=JSON)
