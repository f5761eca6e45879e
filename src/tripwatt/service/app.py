"""The service as an ASGI application: routes, and what is decided before a worker gets a job."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated, Any, Final

import orjson
from fastapi import FastAPI, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from prometheus_client import CONTENT_TYPE_LATEST
from starlette.exceptions import HTTPException
from starlette.responses import StreamingResponse
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

import tripwatt
from tripwatt.errors import Fault
from tripwatt.forecasting import load_metadata, load_model
from tripwatt.forecasting.storage import DEFAULT_MODEL
from tripwatt.service import answers, openapi
from tripwatt.service.batching import answers as batch_answers
from tripwatt.service.batching import lines_of
from tripwatt.service.compression import Packing
from tripwatt.service.metrics import Metrics
from tripwatt.service.middleware import Gate
from tripwatt.service.pool import Crew
from tripwatt.service.problems import MEDIA_TYPE, Problem, invalid
from tripwatt.service.receiving import body_of, require_accepts
from tripwatt.service.settings import Settings

PAGE: Final = Path(__file__).with_name("page")
JSON: Final = "application/json"
NDJSON: Final = "application/x-ndjson"
KINDS: Final = {400: "bad-request", 404: "not-found", 405: "method-not-allowed"}

Log = Callable[..., None]


class Page(StaticFiles):
    """The page's files; those whose name holds a hash of their content never change."""

    def file_response(
        self, full_path: Any, stat_result: Any, scope: Scope, status_code: int = 200
    ) -> Response:
        """A file with how long it may be kept."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        lasting = "/assets/" in scope["path"]
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable" if lasting else "no-cache"
        return response


def request_id(request: Request) -> str:
    """The id that the gate gave to a request."""
    return str(request.scope.get("state", {}).get("request_id", ""))


class Stream(StreamingResponse):
    """Lines, and what to do once when they end, also where nobody waits for them any longer."""

    def __init__(self, lines: AsyncIterator[bytes], done: Callable[[], None]) -> None:
        super().__init__(self._until_end(lines), media_type=NDJSON)
        self.done: Callable[[], None] | None = done

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._end()

    async def _until_end(self, lines: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        async for line in lines:
            yield line
        self._end()  # before the client hears that it was the last line, so that its next batch finds room

    def _end(self) -> None:
        if self.done is not None:
            self.done()
            self.done = None


def create_app(settings: Settings | None = None, log: Log = lambda **record: None) -> ASGIApp:
    """The service; its workers start and end with the application's lifespan.

    Parameters
    ----------
    settings : Settings, optional
    log : callable, optional
        Takes one record as keywords; `event` says what it is about, else it is a request.

    Raises
    ------
    InvalidInput
        When a model cannot be used.
    """
    settings = settings or Settings()
    api = Api(settings, log)
    return Gate(Packing(api.app), settings, api.metrics, log)


class Api:
    """The endpoints of one service, its workers and its counts."""

    def __init__(self, settings: Settings, log: Log) -> None:
        self.settings = settings
        self.metrics = Metrics()
        self.crew = Crew(settings, lambda event, **more: log(event=event, **more))
        self.metrics.follow(lambda: self.crew.waiting, lambda: self.crew.ready, lambda: self.crew.lost)
        self.batches = self.bodies = 0
        self.kept: dict[str, bytes] = {}
        places: dict[str, Path | None] = {**settings.models} or {DEFAULT_MODEL: None}
        for folder in places.values():
            load_model(folder)  # a model that cannot be used is told now, not by workers that do not start
        models = [{"name": name, **load_metadata(folder)} for name, folder in places.items()]
        self.models = orjson.dumps({"models": models})
        self.app = FastAPI(
            title="tripwatt",
            version=tripwatt.__version__,
            summary="Forecasts the battery energy of an electric-car trip with a prediction interval.",
            description=openapi.DESCRIPTION,
            docs_url=None,  # its page loads scripts from another host
            redoc_url=None,
            lifespan=self._lifespan,
        )
        self._add_handlers()
        self._add_routes()
        openapi.complete(self.app, bool(settings.token))
        self._add_page()

    def _add_page(self) -> None:
        """The page's files, each under its own path: a mount at the root would turn 405 of the API into 404."""
        if not PAGE.is_dir():
            return
        page = Page(directory=PAGE)

        def serving(name: str) -> Callable[[Request], Awaitable[Response]]:
            async def respond(request: Request) -> Response:
                return await page.get_response(name, request.scope)

            return respond

        for file in PAGE.iterdir():
            if file.is_file():
                path = "/" if file.name == "index.html" else f"/{file.name}"
                self.app.add_route(path, serving(file.name), include_in_schema=False)
        self.app.mount("/assets", Page(directory=PAGE / "assets"), name="assets")

    @asynccontextmanager
    async def _lifespan(self, _: FastAPI) -> AsyncIterator[None]:
        await self.crew.start()
        yield
        await self.crew.stop()

    def _add_handlers(self) -> None:
        async def on_problem(request: Request, error: Exception) -> Response:
            assert isinstance(error, Problem)
            return error.response(request_id(request))

        async def on_http(request: Request, error: Exception) -> Response:
            assert isinstance(error, HTTPException)
            kind = KINDS.get(error.status_code, "internal" if error.status_code >= 500 else "bad-request")
            return Problem(kind, headers=error.headers or {}).response(request_id(request))

        async def on_parameters(request: Request, error: Exception) -> Response:
            assert isinstance(error, RequestValidationError)
            faults = [
                Fault(e["msg"], ".".join(map(str, e["loc"])), repr(e.get("input"))[:80])
                for e in error.errors()
            ]
            return invalid(faults).response(request_id(request))

        self.app.add_exception_handler(Problem, on_problem)
        self.app.add_exception_handler(HTTPException, on_http)
        self.app.add_exception_handler(RequestValidationError, on_parameters)

    def _add_routes(self) -> None:
        add = self.app.add_api_route
        for path, method, handler, more in (
            ("/v1/forecast", "POST", self.forecast, openapi.forecast()),
            ("/v1/forecast/update", "POST", self.update, openapi.update()),
            ("/v1/forecast/batch", "POST", self.batch, openapi.batch()),
            ("/v1/routes", "POST", self.route, openapi.route()),
            ("/v1/models", "GET", self.get_models, openapi.plain(answers.ModelsAnswer, "models")),
            ("/v1/vehicles", "GET", self.get_vehicles, openapi.plain(answers.VehiclesAnswer, "vehicles")),
            ("/v1/examples", "GET", self.get_examples, openapi.plain(answers.ExamplesAnswer, "examples")),
            ("/v1/examples/{trip}", "GET", self.get_example, openapi.example()),
            ("/healthz", "GET", self.healthz, openapi.health(ready=False)),
            ("/readyz", "GET", self.readyz, openapi.health(ready=True)),
            ("/metrics", "GET", self.get_metrics, openapi.metrics()),
        ):
            add(path, handler, methods=[method], response_class=Response, response_model=None, **more)

    async def forecast(self, request: Request) -> Response:
        """Forecast a trip from a speed trace or from the links of a planned route."""
        return await self._job(request, {"kind": "forecast"}, await self._body(request, (JSON,)))

    async def update(self, request: Request) -> Response:
        """Update the forecast of a trip with the samples measured so far."""
        return await self._job(request, {"kind": "update"}, await self._body(request, (JSON,)))

    async def batch(self, request: Request) -> Response:
        """Forecast many trips: one request per line in, one forecast or problem per line out, in the same order."""
        require_accepts(request, NDJSON)
        if self.batches >= self.settings.limits.batches:
            raise Problem("busy", "too many batches", headers={"Retry-After": "5"})
        self.batches += 1
        try:
            limits = self.settings.limits
            types = (NDJSON, "application/jsonl", "application/ndjson")
            body = await body_of(request, types, limits.batch_bytes, limits.body_timeout_s)
            lines = lines_of(body, limits)
        except BaseException:
            self.batches -= 1
            raise
        return Stream(batch_answers(lines, self.crew, self.metrics), self._batch_done)

    def _batch_done(self) -> None:
        self.batches -= 1

    async def route(
        self,
        request: Request,
        speed_m_s: Annotated[
            float | None,
            Query(gt=0, le=70, description="mean speed [m/s] of a track without times and speeds"),
        ] = None,
    ) -> Response:
        """Read a route or a trip: GPX, GeoJSON, the response of a router, links, or samples as CSV."""
        body = await self._body(request, tuple(openapi.UPLOADS))
        speed = speed_m_s if speed_m_s is not None and math.isfinite(speed_m_s) else None
        return await self._job(request, {"kind": "route", "speed_m_s": speed}, body)

    async def get_models(self, request: Request) -> Response:
        """List the models with their inputs, provenance and scores."""
        require_accepts(request, JSON)
        return Response(self.models, media_type=JSON)

    async def get_vehicles(self, request: Request) -> Response:
        """List the cars of the library and the models fitted on each."""
        require_accepts(request, JSON)
        return Response(await self._kept("vehicles"), media_type=JSON)

    async def get_examples(self, request: Request) -> Response:
        """List synthetic trips as examples."""
        require_accepts(request, JSON)
        await self._kept("examples")
        return Response(self.kept["example list"], media_type=JSON)

    async def get_example(self, request: Request, trip: str) -> Response:
        """Return one synthetic trip: a request for a forecast, and the samples simulated for it."""
        require_accepts(request, JSON)
        await self._kept("examples")
        if f"example {trip}" not in self.kept:
            raise Problem("not-found", "unknown example")
        return Response(self.kept[f"example {trip}"], media_type=JSON)

    async def healthz(self) -> Response:
        """Check that the service is alive."""
        return self._health("alive", 200)

    async def readyz(self) -> Response:
        """Check that a worker is ready to forecast."""
        if not self.crew.ready:
            raise Problem("busy", "no worker is ready", headers={"Retry-After": "1"})
        return self._health("ready", 200)

    def _health(self, status: str, code: int) -> Response:
        return Response(orjson.dumps({"status": status, "workers": self.crew.ready}), code, media_type=JSON)

    async def get_metrics(self) -> Response:
        """Return metrics for Prometheus."""
        return Response(self.metrics.render(), media_type=CONTENT_TYPE_LATEST)

    async def _body(self, request: Request, media_types: Sequence[str]) -> bytes:
        """The body of a request for a job, unless there is too much to do anyway."""
        limits = self.settings.limits
        require_accepts(request, JSON)
        if self.crew.waiting >= limits.waiting or self.bodies >= limits.bodies:
            raise Problem("busy", "try again soon", headers={"Retry-After": "1"})
        self.bodies += 1
        try:
            return await body_of(request, media_types, limits.body_bytes, limits.body_timeout_s)
        finally:
            self.bodies -= 1

    async def _job(self, request: Request, job: dict[str, Any], body: bytes) -> Response:
        reply = await self.crew.run(job, body)
        self.metrics.work.labels(job["kind"]).observe(reply.seconds)
        if reply.status == 200:
            return Response(reply.content, media_type=JSON)
        document = {**orjson.loads(reply.content), "instance": request_id(request)}
        return Response(orjson.dumps(document), reply.status, media_type=MEDIA_TYPE)

    async def _kept(self, kind: str) -> bytes:
        """A document that never changes, computed once."""
        if kind not in self.kept:
            reply = await self.crew.run({"kind": kind}, b"")
            if reply.status != 200:
                raise Problem("internal")
            if kind == "examples":
                found = orjson.loads(reply.content)
                brief = [
                    {k: v for k, v in one.items() if k not in ("request", "observed")}
                    for one in found.values()
                ]
                self.kept |= {f"example {name}": orjson.dumps(one) for name, one in found.items()}
                self.kept["example list"] = orjson.dumps({"examples": brief})
            self.kept[kind] = reply.content
        return self.kept[kind]
