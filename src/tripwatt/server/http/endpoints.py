"""The endpoints of forecasts, routes, journeys, and what the service has: models, vehicles, map, examples."""

from __future__ import annotations

import inspect
from collections.abc import AsyncIterator
from typing import Annotated, Any, Final, get_type_hints

import orjson
from fastapi import APIRouter, Query, Response
from fastapi import Path as PathValue
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from starlette.responses import StreamingResponse

from tripwatt.forecasting.document import ForecastResponse
from tripwatt.server.http import journey_schemas as journey
from tripwatt.server.http import openapi, schemas
from tripwatt.server.http.batching import forecast_lines, parse_lines
from tripwatt.server.http.example_requests import UPLOADS
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.problems import TITLES, Problem
from tripwatt.server.http.service import Called, json_response

BATCH_TYPES: Final = (openapi.NDJSON, "application/jsonl", "application/ndjson")
"""Media types of the body of a batch."""

MAX_ZOOM: Final = 22
"""Finest zoom of a tile, as maps have it."""

Latitude = Annotated[float, Query(ge=-90.0, le=90.0, allow_inf_nan=False)]
Longitude = Annotated[float, Query(ge=-180.0, le=180.0, allow_inf_nan=False)]
Zoom = Annotated[int, PathValue(ge=0, le=MAX_ZOOM)]
TileNumber = Annotated[int, PathValue(ge=0, lt=2**MAX_ZOOM)]
MeanSpeed = Annotated[
    float | None,
    Query(
        gt=0, le=70, allow_inf_nan=False, description="mean speed [m/s] of a track without times and speeds"
    ),
]
NameStart = Annotated[
    str, Query(min_length=1, max_length=200, description="start of a name, a street, a house")
]
MaxPlaces = Annotated[int, Query(ge=1, le=50, description="most places")]
MaxShown = Annotated[int, Query(ge=1, le=1000, description="most settlements, most stations")]
ProblemKind = Annotated[str, PathValue(max_length=40, description="last part of the type of a problem")]
CarWords = Annotated[
    str | None, Query(min_length=1, max_length=100, description="words of the title or name, or a model year")
]
NeedQuery = Annotated[journey.NeedQuery, Query()]
RangeQuery = Annotated[journey.RangeQuery, Query()]
"""Parameters of operations."""

forecasts, routes = openapi.new_router("forecast"), openapi.new_router("routes")
journeys, library = openapi.new_router("journeys"), openapi.new_router("library")
monitoring = openapi.new_router("operation", refuses_unknown=False)
"""Routers by tag; operations for monitoring ignore unknown parameters."""


def _add_job(router: APIRouter, path: str, kind: str, answer: type[Any]) -> None:
    """Add the operation of a job that needs only a body; request and description are those of the job."""
    job = getattr(Jobs, kind)
    takes = openapi.request_body(get_type_hints(job)["request"])

    @router.post(path, name=kind, description=inspect.getdoc(job), response_model=answer, **takes)
    async def respond(call: Called, fields: openapi.Fields = None) -> Response:
        return await call.body_job(kind, fields=fields)


_add_job(forecasts, "/v1/forecast", "forecast", ForecastResponse)
_add_job(forecasts, "/v1/forecast/update", "update", ForecastResponse)
_add_job(forecasts, "/v1/forecast/difference", "difference", journey.DifferenceDocument)
_add_job(forecasts, "/v1/advice", "advice", journey.AdviceResponse)


@forecasts.post(
    "/v1/forecast/batch",
    **openapi.response_content(
        {openapi.NDJSON: openapi.TEXT},
        "One ForecastResponse or ProblemDocument per line, in the order of the requests",
    ),
    **openapi.request_content({openapi.NDJSON: {"schema": {"description": "one ForecastRequest per line"}}}),
)
async def batch(call: Called, fields: openapi.Fields = None) -> Response:
    """Forecast many trips: one request per line in, one forecast or problem per line out, in the same order."""
    service, limits = call.service, call.service.settings.limits
    lines = parse_lines(await service.read_body(call.request, BATCH_TYPES, limits.batch_bytes), limits.batch)
    if service.batches.locked():
        raise Problem("busy", "too many batches", headers={"Retry-After": "5"})

    async def answers() -> AsyncIterator[bytes]:
        async with service.batches:
            async for answer in forecast_lines(lines, service.pool, service.metrics, fields):
                yield answer

    return StreamingResponse(answers(), media_type=openapi.NDJSON)


@routes.post("/v1/routes", response_model=schemas.RouteResponse, **openapi.request_content(UPLOADS))
async def route(call: Called, speed_m_s: MeanSpeed = None) -> Response:
    """Read a route or a trip: GPX, KML, GeoJSON, the response of a router, links, or samples as CSV."""
    return await call.job("route", await call.read(tuple(UPLOADS)), speed_m_s=speed_m_s)


_add_job(journeys, "/v1/journeys", "plan", journey.PlanResponse)
_add_job(journeys, "/v1/journeys/difference", "journey_difference", journey.DifferenceDocument)
_add_job(journeys, "/v1/journeys/advice", "journey_advice", journey.AdviceResponse)
_add_job(journeys, "/v1/reachable", "reach", journey.ReachResponse)


@journeys.get("/v1/need", response_model=journey.NeedResponse)
async def get_need(call: Called, query: NeedQuery) -> Response:
    """Return what some kilometres or a usual trip need, without a road; without either, what the next trip of a car on the road needs."""
    if query.distance_km is None and query.trip is None and query.named is not None:
        live = call.service.live
        return call.answer(await call.service.ahead.need(await live.known(query.named), query))
    return await call.job("distance", **await call.service.job_without_road(query))


@journeys.get("/v1/range", response_model=journey.RangeResponse)
async def get_range(call: Called, query: RangeQuery) -> Response:
    """Return how far a charge carries, without a road."""
    return await call.job("range", **await call.service.job_without_road(query))


@journeys.get("/v1/places", response_model=journey.PlacesResponse)
async def get_places(call: Called, q: NameStart, limit: MaxPlaces = 10) -> Response:
    """Find places by the start of their names."""
    return await call.job("journeys.places", text=q, limit=limit)


@library.get("/v1/map", response_model=journey.MapResponse, **openapi.TAGGED)
async def get_map(call: Called) -> Response:
    """Return the roads, places and weather of the service."""
    return await call.constant_document("journeys.describe")


@journeys.get("/v1/map/view", response_model=journey.ViewResponse, **openapi.INTERNAL)
async def get_view(
    call: Called, south: Latitude, west: Longitude, north: Latitude, east: Longitude, limit: MaxShown = 200
) -> Response:
    """Return settlements and charging stations inside of bounds."""
    return await call.job("journeys.view", bounds_deg=[south, west, north, east], limit=limit)


@journeys.get(
    "/v1/tiles/{zoom}/{column}/{row}",
    **openapi.response_content({openapi.TILE: openapi.BINARY}, "The tile; empty without roads"),
    **openapi.INTERNAL,
)
async def get_tile(call: Called, zoom: Zoom, column: TileNumber, row: TileNumber) -> Response:
    """Return the roads of a part of the map as a vector tile."""
    response = await call.job("journeys.tile", media_type=openapi.TILE, zoom=zoom, column=column, row=row)
    response.headers["Cache-Control"] = "private, max-age=3600"
    return response


@library.get("/v1/models", response_model=schemas.ModelsResponse, **openapi.TAGGED)
async def get_models(call: Called) -> Response:
    """List the models with their inputs, provenance and scores."""
    return await call.about_models("summaries")


_add_job(library, "/v1/vehicles", "describe", schemas.DescribedVehicle)


@library.get("/v1/vehicles", response_model=schemas.VehiclesResponse, **openapi.TAGGED)
async def get_vehicles(call: Called, search: CarWords = None) -> Response:
    """List the cars of the library, or those that words find, and the models fitted on each."""
    return await (call.about_models("vehicles") if search is None else call.job("vehicles", search=search))


@library.get("/v1/examples", response_model=schemas.ExamplesResponse, **openapi.INTERNAL)
async def get_examples(call: Called) -> Response:
    """List recorded trips as examples."""
    return await call.constant_document("examples")


@library.get("/v1/examples/{trip}", response_model=schemas.ExampleResponse, **openapi.INTERNAL)
async def get_example(call: Called, trip: str) -> Response:
    """Return one recorded trip: a request for a forecast, and the samples measured on it."""
    return await call.constant_document("example", trip=trip)


@monitoring.get("/problems/{kind}", response_model=schemas.ProblemDocument)
async def get_problem(call: Called, kind: ProblemKind) -> Response:
    """Return what the type of a problem stands for."""
    if kind not in TITLES:
        raise Problem("not-found")
    return json_response(Problem(kind).document())


@monitoring.get("/healthz", response_model=schemas.HealthResponse)
async def healthz(call: Called) -> Response:
    """Check that the service is alive."""
    return json_response({"status": "alive", "workers": call.service.pool.ready})


@monitoring.get("/readyz", response_model=schemas.HealthResponse)
async def readyz(call: Called) -> Response:
    """Check that a worker is ready to forecast."""
    if not call.service.pool.ready:
        raise Problem("busy", "no worker is ready", headers={"Retry-After": "1"})
    return json_response({"status": "ready", "workers": call.service.pool.ready})


@monitoring.get("/openapi.json", include_in_schema=False)
async def get_openapi(call: Called) -> Response:
    """Return the OpenAPI document."""
    return call.with_entity_tag(orjson.dumps(call.request.app.openapi()))


@monitoring.get(
    "/metrics",
    **openapi.response_content({"text/plain": openapi.TEXT}, "Metrics in the text format of Prometheus"),
)
async def get_metrics(call: Called) -> Response:
    """Return metrics for Prometheus."""
    return Response(generate_latest(call.service.metrics.registry), media_type=CONTENT_TYPE_LATEST)
