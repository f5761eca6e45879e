"""The service as an ASGI application: its endpoints, and the checks before a job runs in the worker pool."""

from __future__ import annotations

import asyncio
import math
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import orjson
from fastapi import FastAPI, Query, Request, Response
from fastapi import Path as PathValue
from fastapi.exceptions import RequestValidationError
from prometheus_client import CONTENT_TYPE_LATEST
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import StreamingResponse
from starlette.routing import Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Scope

import tripwatt
from tripwatt.errors import InvalidInput
from tripwatt.forecasting.document import ForecastResponse
from tripwatt.server.http import openapi, schemas
from tripwatt.server.http.advice_schemas import AdviceResponse, DifferenceDocument
from tripwatt.server.http.answering import Answering, json_response
from tripwatt.server.http.batching import forecast_lines, lines_of
from tripwatt.server.http.car_operations import CarOperations
from tripwatt.server.http.contract import Fields
from tripwatt.server.http.example_requests import UPLOADS
from tripwatt.server.http.fleet_operations import FleetOperations
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.journey_schemas import (
    JourneyAdviceRequest,
    JourneyDifferenceRequest,
    MapResponse,
    NeedAnswer,
    NeedQuery,
    PlacesResponse,
    PlanRequest,
    PlanResponse,
    RangeQuery,
    RangeResponse,
    ReachRequest,
    ReachResponse,
    ViewResponse,
)
from tripwatt.server.http.live_operations import LiveOperations
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.middleware import ServiceMiddleware
from tripwatt.server.http.pool import WorkerPool
from tripwatt.server.http.problems import Problem, invalid_input
from tripwatt.server.http.receiving import request_id
from tripwatt.server.http.settings import Settings

PAGE: Final = Path(__file__).with_name("page")
"""Folder of the built page."""

BATCH_TYPES: Final = (openapi.NDJSON, "application/jsonl", "application/ndjson")
"""Media types of the body of a batch."""

PROBLEM_KINDS: Final = {400: "bad-request", 404: "not-found", 405: "method-not-allowed"}
"""HTTP status of an error of the framework -> kind of problem."""

MIN_GZIP_BYTES: Final = 1000
"""Smaller bodies fit into one packet without compression."""

GZIP_LEVEL: Final = 4
"""Higher levels take longer and hardly shrink series of numbers further."""

CORS_METHODS: Final = ("GET", "POST", "PUT", "DELETE")
CORS_HEADERS: Final = ("Authorization", "Content-Type", "If-None-Match", "X-Request-ID")
"""Methods and headers that a page of another origin may use in requests, beside those that a browser always allows."""

CORS_EXPOSED: Final = ("ETag", "Retry-After", "X-Request-ID")
"""Headers of a response that such a page may read, beside those that a browser always shows."""

MAX_ZOOM: Final = 22
"""Finest zoom of a tile, as maps have it."""

Latitude = Annotated[float, Query(ge=-90.0, le=90.0, allow_inf_nan=False)]
Longitude = Annotated[float, Query(ge=-180.0, le=180.0, allow_inf_nan=False)]
Zoom = Annotated[int, PathValue(ge=0, le=MAX_ZOOM)]
TileNumber = Annotated[int, PathValue(ge=0, lt=2**MAX_ZOOM)]
MeanSpeed = Annotated[
    float | None, Query(gt=0, le=70, description="mean speed [m/s] of a track without times and speeds")
]
Start = Annotated[str, Query(min_length=1, max_length=200, description="start of a name, a street, a house")]
MostPlaces = Annotated[int, Query(ge=1, le=50, description="most places")]
MostShown = Annotated[int, Query(ge=1, le=1000, description="most settlements, most stations")]
CarWords = Annotated[
    str | None, Query(min_length=1, max_length=100, description="words of the title or name, or a model year")
]
"""Parameters of operations."""

Log = Callable[..., None]


class PageFiles(StaticFiles):
    """The files of the page. Names of assets contain a hash of the content, so that assets never change."""

    def file_response(
        self, full_path: Any, stat_result: Any, scope: Scope, status_code: int = 200
    ) -> Response:
        """Return the response with a file and its Cache-Control header."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        is_asset = "/assets/" in scope["path"]
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable" if is_asset else "no-cache"
        return response


def create_app(settings: Settings | None = None, log: Log = lambda **record: None) -> ASGIApp:
    """Create the application; its workers start and stop with its lifespan.

    Parameters
    ----------
    settings : Settings, optional
    log : callable, optional
        Called with one record of the log as keywords; a record without `event` is that of a request.

    Raises
    ------
    InvalidInput
        When a model or a car on the road cannot be used.
    """
    settings = settings or Settings()
    api = Api(settings, log)
    packed = GZipMiddleware(api.app, minimum_size=MIN_GZIP_BYTES, compresslevel=GZIP_LEVEL)
    app = ServiceMiddleware(packed, settings, api.metrics, log)
    if not settings.cors_origins:
        return app
    return CORSMiddleware(app, settings.cors_origins, CORS_METHODS, CORS_HEADERS, expose_headers=CORS_EXPOSED)


class Api:
    """The endpoints of one service, with its worker pool and its metrics.

    Parameters
    ----------
    settings : Settings
    log : callable
        See `create_app`.
    """

    def __init__(self, settings: Settings, log: Log) -> None:
        self.settings = settings
        self.metrics = Metrics()
        self.pool = WorkerPool(settings, log)
        self.metrics.waiting.set_function(lambda: self.pool.waiting)
        self.metrics.workers.set_function(lambda: self.pool.ready)
        self.metrics.lost.set_function(lambda: self.pool.lost)
        self.batches = asyncio.Semaphore(settings.limits.batches)
        self.answering = Answering(settings, self.pool, self.metrics)
        jobs = Jobs.from_folders(settings.models, settings.limits)  # raises faults before a worker starts
        self.kept = self.answering.job if jobs.fleets else self.answering.kept
        self.live = LiveOperations(settings, self.pool, self.answering.read, log)
        self.cars = CarOperations(self.answering, lambda: self.live.cars, log)
        self.app: FastAPI = FastAPI(
            title="tripwatt",
            version=tripwatt.__version__,
            summary="Forecasts the battery energy of an electric-car trip with a prediction interval.",
            description=openapi.DESCRIPTION,
            docs_url=None,  # the page of FastAPI loads scripts from another host
            redoc_url=None,
            servers=[{"url": settings.prefix}] if settings.prefix else None,
            lifespan=self._lifespan,
        )
        add_handlers(self.app)
        openapi.add_operations(
            self.app,
            (self, FleetOperations(self.answering), self.live, self.cars),
            with_token=bool(settings.token),
        )
        add_page(self.app)

    @asynccontextmanager
    async def _lifespan(self, _: FastAPI) -> AsyncIterator[None]:
        await self.pool.start()
        async with self.live.running(), self.cars.running():
            yield
        await self.pool.stop()

    @openapi.operation("POST /v1/forecast", "forecast", ForecastResponse, schemas.ForecastRequest)
    async def forecast(self, request: Request, fields: Fields = None) -> Response:
        """Forecast a trip from a speed trace or from the links of a planned route."""
        return await self.answering.body_job(request, "forecast", fields=fields)

    @openapi.operation("POST /v1/forecast/update", "forecast", ForecastResponse, schemas.UpdateRequest)
    async def update(self, request: Request, fields: Fields = None) -> Response:
        """Update the forecast of a trip with the samples measured so far."""
        return await self.answering.body_job(request, "update", fields=fields)

    @openapi.operation(
        "POST /v1/forecast/difference", "forecast", DifferenceDocument, schemas.DifferenceRequest
    )
    async def difference(self, request: Request) -> Response:
        """Compare two trips of one car: what both share cancels, and the difference has an interval of its own."""
        return await self.answering.body_job(request, "difference")

    @openapi.operation("POST /v1/advice", "forecast", AdviceResponse, schemas.AdviceRequest)
    async def advice(self, request: Request) -> Response:
        """Return what to do about a trip: the least that helps, and what each action saves."""
        return await self.answering.body_job(request, "advice")

    @openapi.operation(
        "POST /v1/forecast/batch",
        "forecast",
        {openapi.NDJSON: openapi.TEXT},
        {openapi.NDJSON: {"schema": {"description": "one ForecastRequest per line"}}},
        description="One ForecastResponse or ProblemDocument per line, in the order of the requests",
    )
    async def batch(self, request: Request, fields: Fields = None) -> Response:
        """Forecast many trips: one request per line in, one forecast or problem per line out, in the same order."""
        limits = self.settings.limits
        body = await self.answering.bodies.read(
            request, BATCH_TYPES, limits.batch_bytes, limits.body_timeout_s
        )
        lines = lines_of(body, limits.batch)
        if self.batches.locked():
            raise Problem("busy", "too many batches", headers={"Retry-After": "5"})
        return StreamingResponse(self._forecast_lines(lines, fields), media_type=openapi.NDJSON)

    async def _forecast_lines(self, lines: list[bytes], fields: str | None) -> AsyncIterator[bytes]:
        async with self.batches:
            async for line in forecast_lines(lines, self.pool, self.metrics, fields):
                yield line

    @openapi.operation("POST /v1/routes", "routes", schemas.RouteResponse, UPLOADS)
    async def route(self, request: Request, speed_m_s: MeanSpeed = None) -> Response:
        """Read a route or a trip: GPX, KML, GeoJSON, the response of a router, links, or samples as CSV."""
        body = await self.answering.read(request, tuple(UPLOADS))
        speed = speed_m_s if speed_m_s is not None and math.isfinite(speed_m_s) else None
        return await self.answering.job(request, "route", body, speed_m_s=speed)

    @openapi.operation("POST /v1/journeys", "journeys", PlanResponse, PlanRequest)
    async def plan(self, request: Request, fields: Fields = None) -> Response:
        """Plan a journey: roads, their forecasts, the charge to leave with, a charging stop."""
        return await self.answering.body_job(request, "plan", fields=fields)

    @openapi.operation(
        "POST /v1/journeys/difference", "journeys", DifferenceDocument, JourneyDifferenceRequest
    )
    async def journey_difference(self, request: Request) -> Response:
        """Compare two journeys of one car without their stops to charge, as `POST /v1/forecast/difference` does trips."""
        return await self.answering.body_job(request, "journey_difference")

    @openapi.operation("POST /v1/journeys/advice", "journeys", AdviceResponse, JourneyAdviceRequest)
    async def journey_advice(self, request: Request) -> Response:
        """Return what to do about a journey with its charging stops: the least that helps, what each action saves, and the time in all."""
        return await self.answering.body_job(request, "journey_advice")

    @openapi.operation("POST /v1/reachable", "journeys", ReachResponse, ReachRequest)
    async def reach(self, request: Request) -> Response:
        """Return the area that the charge reaches with 95 % and with 50 %."""
        return await self.answering.body_job(request, "reach")

    @openapi.operation("GET /v1/need", "journeys", NeedAnswer)
    async def get_need(self, request: Request, query: Annotated[NeedQuery, Query()]) -> Response:
        """Return what some kilometres or a usual trip need, without a road; without either, what the next trip of a car on the road needs."""
        if query.distance_km is None and query.trip is None and query.car is not None:
            return await self.live.next_need(request, query.car, query)
        return await self.answering.job(request, "distance", **await self.live.job_of(query))

    @openapi.operation("GET /v1/range", "journeys", RangeResponse)
    async def get_range(self, request: Request, query: Annotated[RangeQuery, Query()]) -> Response:
        """Return how far a charge carries, without a road."""
        return await self.answering.job(request, "range", **await self.live.job_of(query))

    @openapi.operation("GET /v1/places", "journeys", PlacesResponse)
    async def get_places(self, request: Request, q: Start, limit: MostPlaces = 10) -> Response:
        """Find places by the start of their names."""
        return await self.answering.job(request, "journeys.places", text=q, limit=limit)

    @openapi.operation("GET /v1/map", "library", MapResponse, tagged=True)
    async def get_map(self, request: Request) -> Response:
        """Return the roads, places and weather of the service."""
        return await self.answering.kept(request, "journeys.describe")

    @openapi.operation("GET /v1/map/view", "journeys", ViewResponse, internal=True)
    async def get_view(
        self,
        request: Request,
        south: Latitude,
        west: Longitude,
        north: Latitude,
        east: Longitude,
        limit: MostShown = 200,
    ) -> Response:
        """Return settlements and charging stations inside of bounds."""
        return await self.answering.job(
            request, "journeys.view", bounds_deg=[south, west, north, east], limit=limit
        )

    @openapi.operation(
        "GET /v1/tiles/{zoom}/{column}/{row}",
        "journeys",
        {openapi.TILE: openapi.BINARY},
        internal=True,
        description="The tile; empty without roads",
    )
    async def get_tile(self, request: Request, zoom: Zoom, column: TileNumber, row: TileNumber) -> Response:
        """Return the roads of a part of the map as a vector tile."""
        response = await self.answering.job(
            request, "journeys.tile", media_type=openapi.TILE, zoom=zoom, column=column, row=row
        )
        response.headers["Cache-Control"] = "private, max-age=3600"
        return response

    @openapi.operation("GET /v1/models", "library", schemas.ModelsResponse, tagged=True)
    async def get_models(self, request: Request) -> Response:
        """List the models with their inputs, provenance and scores."""
        return await self.kept(request, "summaries")

    @openapi.operation("POST /v1/vehicles", "library", schemas.DescribedVehicle, schemas.VehicleFigures)
    async def describe(self, request: Request) -> Response:
        """Describe a car that the library does not have, by a few figures."""
        return await self.answering.body_job(request, "describe")

    @openapi.operation("GET /v1/vehicles", "library", schemas.VehiclesResponse, tagged=True)
    async def get_vehicles(self, request: Request, search: CarWords = None) -> Response:
        """List the cars of the library, or those that words find, and the models fitted on each."""
        if search is not None:
            return await self.answering.job(request, "vehicles", search=search)
        return await self.kept(request, "vehicles")

    @openapi.operation("GET /v1/examples", "library", schemas.ExamplesResponse, internal=True)
    async def get_examples(self, request: Request) -> Response:
        """List synthetic trips as examples."""
        return await self.answering.kept(request, "examples")

    @openapi.operation("GET /v1/examples/{trip}", "library", schemas.ExampleResponse, internal=True)
    async def get_example(self, request: Request, trip: str) -> Response:
        """Return one synthetic trip: a request for a forecast, and the samples simulated for it."""
        return await self.answering.kept(request, "example", trip=trip)

    @openapi.operation("GET /healthz", openapi.HEALTH, schemas.HealthResponse)
    async def healthz(self) -> Response:
        """Check that the service is alive."""
        return json_response({"status": "alive", "workers": self.pool.ready})

    @openapi.operation("GET /readyz", openapi.HEALTH, schemas.HealthResponse)
    async def readyz(self) -> Response:
        """Check that a worker is ready to forecast."""
        if not self.pool.ready:
            raise Problem("busy", "no worker is ready", headers={"Retry-After": "1"})
        return json_response({"status": "ready", "workers": self.pool.ready})

    @openapi.operation(
        "GET /metrics",
        openapi.HEALTH,
        {"text/plain": openapi.TEXT},
        description="Metrics in the text format of Prometheus",
    )
    async def get_metrics(self) -> Response:
        """Return metrics for Prometheus."""
        return Response(self.metrics.render(), media_type=CONTENT_TYPE_LATEST)


def add_page(app: FastAPI) -> None:
    """Add a route per file of the page; a mount at `/` would turn status 405 of other paths into 404."""
    if not PAGE.is_dir():
        return
    files = PageFiles(directory=PAGE)

    async def respond(name: str, request: Request) -> Response:
        return await files.get_response(name, request.scope)

    for file in PAGE.iterdir():
        if file.is_file():
            path = "/" if file.name == "index.html" else f"/{file.name}"
            app.add_route(path, partial(respond, file.name), include_in_schema=False)
    app.mount("/assets", PageFiles(directory=PAGE / "assets"), name="assets")


def add_handlers(app: FastAPI) -> None:
    """Answer every error with a problem document."""

    @app.exception_handler(Problem)
    async def on_problem(request: Request, error: Problem) -> Response:
        return error.response(request_id(request))

    @app.exception_handler(InvalidInput)
    async def on_invalid(request: Request, error: InvalidInput) -> Response:
        return invalid_input(error.faults).response(request_id(request))

    @app.exception_handler(HTTPException)
    async def on_http(request: Request, error: HTTPException) -> Response:
        kind = PROBLEM_KINDS.get(error.status_code, "internal" if error.status_code >= 500 else "bad-request")
        headers = dict(error.headers or {})
        if error.status_code == 405:  # starlette names only the methods of a path's first route
            of_path = [r for r in app.routes if isinstance(r, Route) and r.path_regex.match(request.url.path)]
            methods = {method for route in of_path for method in route.methods or ()}
            headers["Allow"] = ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))
        begun = f"{request.url.path.rstrip('/')}/{{"
        longer = [r.path for r in app.routes if isinstance(r, Route) and r.path.startswith(begun)]
        detail = f"the address goes on: {longer[0]}" if error.status_code == 404 and longer else ""
        return Problem(kind, detail, headers=headers).response(request_id(request))

    @app.exception_handler(RequestValidationError)
    async def on_parameters(request: Request, error: RequestValidationError) -> Response:
        described = app.openapi()["paths"][request.scope["route"].path][request.method.lower()]
        known = [parameter["name"] for parameter in described["parameters"]]
        return invalid_input(list(schemas.faults_of(error.errors(), known))).response(request_id(request))


if __name__ == "__main__":  # the OpenAPI document of a service with the model of the package
    sys.stdout.buffer.write(orjson.dumps(Api(Settings(), lambda **record: None).app.openapi()))
