"""What the endpoints share: settings, workers, arriving bodies and cars; and a call of an endpoint, from its body to its response."""

from __future__ import annotations

import asyncio
import hashlib
import re
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Final

import orjson
from fastapi import Depends, FastAPI
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from tripwatt.server.http.ahead import Ahead
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.journey_schemas import RangeQuery
from tripwatt.server.http.learning import LearningCars
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.openapi import JSON
from tripwatt.server.http.pool import JobResult, WorkerPool
from tripwatt.server.http.problems import MEDIA_TYPE, Problem
from tripwatt.server.http.settings import Settings
from tripwatt.server.http.sharing import Places

MAX_UPLOADS: Final = 4
"""Most files of logs that arrive and wait to be unpacked; further ones are refused. A choice: each takes up to `Limits.upload_bytes`."""


CAR_NAME: Final = re.compile(rb'"car"\s*:\s*"([\w.-]{1,64})"')
"""A car that a body names, as `VALID_NAME` has it."""


class Service:
    """One service: its workers, its metrics, and its cars.

    Parameters
    ----------
    settings : Settings
    log : callable
        Called with one record of the log as keywords.

    Attributes
    ----------
    bodies : Places
        Bytes of the bodies that are arriving.
    batches : asyncio.Semaphore
        Bounds the batches that run at the same time.
    uploads : asyncio.Semaphore
        Bounds the files of logs that arrive and wait to be unpacked.
    unpacking : asyncio.Lock
        Held while one worker unpacks a file; the other workers go on.
    documents : dict of bytes to bytes
        Documents that stay the same while the service runs, by their jobs.
    follows_fleets : bool
        Whether models of fleets are served, whose versions change.
    learning : LearningCars

    Raises
    ------
    InvalidInput
        When a model or a car on the road cannot be used.
    """

    def __init__(self, settings: Settings, log: Callable[..., None]) -> None:
        self.settings, self.metrics = settings, Metrics()
        self.pool = WorkerPool(settings, log)
        self.metrics.waiting.set_function(self.pool.places.taken.total)
        self.metrics.workers.set_function(lambda: self.pool.ready)
        self.metrics.lost.set_function(lambda: self.pool.lost)
        busy = "too many bodies arrive", {**CLOSE, "Retry-After": "2"}
        self.bodies = Places(settings.limits.arriving_bytes, *busy)
        self.batches = asyncio.Semaphore(settings.limits.batches)
        self.uploads, self.unpacking = asyncio.Semaphore(MAX_UPLOADS), asyncio.Lock()
        self.documents: dict[bytes, bytes] = {}
        # raises faults before a worker starts
        self.follows_fleets = bool(Jobs.from_folders(settings.models, settings.limits).fleets)
        self.learning = LearningCars(settings, log)
        self._live = None if settings.cars is None else LiveCars(settings, self.pool, log)
        if self._live is not None:
            self._live.learn = self.learning.learn_soon
            self.ahead = Ahead(self._live)

    @property
    def live(self) -> LiveCars:
        """The cars on the road.

        Raises
        ------
        Problem
            `no-live`.
        """
        if self._live is None:
            raise Problem("no-live", "start the service with --cars")
        return self._live

    async def job_without_road(self, query: RangeQuery) -> dict[str, Any]:
        """Return the parameters of a query's job: `body`, and `last_message` if the query is about a car on the road."""
        given, live = query.model_dump(mode="json", exclude_unset=True), self._live
        if live is None or query.named not in live.cars or query.model is not None:
            return {"body": orjson.dumps(given)}
        if given.get("trip") is None:  # else the car is that of the trip
            del given["car"]
        return await self.ahead.job_without_road(live.cars[query.named], given)

    async def last_message(self, body: bytes) -> dict[str, Any]:
        """Return the parameter `last_message` of a job whose body names a car on the road."""
        named = (match[1].decode() for match in CAR_NAME.finditer(body))
        cars = {} if self._live is None else self._live.cars
        car = next((cars[name] for name in named if name in cars), None)
        return {} if self._live is None or car is None else await self._live.last_message(car)

    async def read_body(self, request: Request, media_types: Sequence[str], limit: int) -> bytes:
        """Read the body of a request.

        If slow bodies fill the share of a client, its further bodies are refused until the time-out of bodies.

        Parameters
        ----------
        request : Request
        media_types : sequence of str
            Supported types.
        limit : int
            Largest size [bytes], counted as the bytes arrive.

        Raises
        ------
        Problem
            `media-type`, `too-large`, `body-late`, `busy` when other bodies have taken all bytes, or `bad-request` for an
            incomplete body.
        """
        require_media_type(request, media_types)
        parts: list[bytes] = []
        size, timeout_s = 0, self.settings.limits.body_timeout_s
        try:
            async with asyncio.timeout(timeout_s):
                async for part in request.stream():
                    if size + len(part) > limit:
                        raise Problem("too-large", f"at most {limit} bytes", headers=CLOSE)
                    self.bodies.require(len(part))
                    self.bodies.add(len(part))
                    size += len(part)
                    parts.append(part)
        except TimeoutError:
            raise Problem("body-late", f"longer than {timeout_s:g} s", headers=CLOSE) from None
        except ClientDisconnect:
            raise Problem("bad-request", "the body is incomplete") from None
        finally:
            self.bodies.add(-size)
        return b"".join(parts)

    @asynccontextmanager
    async def running(self, _: FastAPI) -> AsyncIterator[None]:
        """Start the workers, follow the cars on the road and let them learn, until the service stops."""
        await self.pool.start()
        if self._live is None:
            yield
        else:
            async with self._live.running(), self.learning.running():
                yield
        await self.pool.stop()


CLOSE: Final = {"Connection": "close"}
"""Header of a response to a request whose body is not read to its end."""


def request_id(request: Request) -> str:
    """Return the id that the middleware has set for a request."""
    return str(request.scope.get("state", {}).get("request_id", ""))


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


@dataclass(frozen=True)
class Call:
    """A request to an endpoint, and the service that answers it."""

    request: Request
    service: Service

    async def read(self, media_types: Sequence[str] = (JSON,), max_bytes: int | None = None) -> bytes:
        """Read the body for a job; raise the problem `busy` if too many requests wait already."""
        limits = self.service.settings.limits
        self.service.pool.places.require()
        max_bytes = limits.body_bytes if max_bytes is None else max_bytes
        return await self.service.read_body(self.request, media_types, max_bytes)

    async def job(self, kind: str, body: bytes = b"", media_type: str = JSON, **parameters: Any) -> Response:
        """Run a job, and return its document as the response."""
        result = await self.service.pool.run({"kind": kind, **parameters}, body)
        self.service.metrics.job_seconds.labels(kind).observe(result.seconds)
        return self.answer(result, media_type)

    async def body_job(self, kind: str, **parameters: Any) -> Response:
        """Run a job on the body, and return its document as the response.

        The job gets what the last messages of a car on the road show if the body names it.
        """
        body = await self.read()
        return await self.job(kind, body, **{**await self.service.last_message(body), **parameters})

    async def constant_document(self, kind: str, **parameters: Any) -> Response:
        """Return a document that stays the same while the service runs; its job runs only once."""
        key, documents = orjson.dumps([kind, parameters]), self.service.documents
        if key not in documents:
            response = await self.job(kind, **parameters)
            if response.status_code == 404:
                return response
            if response.status_code != 200:
                raise Problem("internal")  # without input there is nothing to correct
            documents[key] = bytes(response.body)
        return self.with_entity_tag(documents[key])

    async def about_models(self, kind: str) -> Response:
        """Return a document about models, which changes while the service runs only if it follows the models of fleets."""
        return await (self.job if self.service.follows_fleets else self.constant_document)(kind)

    def answer(self, result: JobResult, media_type: str = JSON) -> Response:
        """Return the result of a job as the response; a problem document gets the id of the request."""
        if result.status == 200:
            return Response(result.content, media_type=media_type)
        problem = {**orjson.loads(result.content), "instance": request_id(self.request)}
        return Response(orjson.dumps(problem), result.status, media_type=MEDIA_TYPE)

    def with_entity_tag(self, content: bytes, media_type: str = JSON) -> Response:
        """Return a document that seldom changes with its entity tag; status 304 without content if the client has it already."""
        tag = f'W/"{hashlib.sha256(content).hexdigest()[:20]}"'
        headers = {"ETag": tag, "Cache-Control": "no-cache"}
        if tag in [given.strip() for given in self.request.headers.get("if-none-match", "").split(",")]:
            return Response(status_code=304, headers=headers)
        return Response(content, headers=headers, media_type=media_type)


async def _call(request: Request) -> Call:
    return Call(request, request.app.state.service)


Called = Annotated[Call, Depends(_call)]
"""Parameter of an endpoint: the call."""


def json_response(document: Mapping[str, Any]) -> Response:
    """Return a document as a response."""
    return Response(orjson.dumps(document), media_type=JSON)
