"""Parts of the OpenAPI document that FastAPI cannot derive: request bodies, responses, problems, examples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from fastapi import FastAPI
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from tripwatt.service import car_schemas, journey_schemas, live_schemas, schemas
from tripwatt.service.example_requests import (
    CSV,
    FIGURES_REQUEST,
    GEOJSON,
    GPX,
    KML,
    NEW_CAR_REQUEST,
    PLAN_REQUEST,
    PLANNED_REQUEST,
    REACH_REQUEST,
    SAMPLES_REQUEST,
    TELEMETRY_REQUEST,
    UPDATE_REQUEST,
)
from tripwatt.service.problems import MEDIA_TYPE, TITLES

DESCRIPTION: Final = """The service returns the same forecast as `tripwatt forecast --json`, with the same field names. The
suffix of a name is its unit; numbers without a suffix are fractions. State of charge is the displayed one. Fields that a
request leaves out are unknown: the forecast flags them and its interval is wider. Errors are problem documents (RFC 9457)."""

JSON: Final = "application/json"
NDJSON: Final = "application/x-ndjson"
FORM: Final = "application/x-www-form-urlencoded"
EVENTS: Final = "text/event-stream"
BYTES: Final = "application/octet-stream"
TILE: Final = "application/vnd.mapbox-vector-tile"

REFERENCE: Final = "#/components/schemas/"

DOCUMENTED: Final[tuple[type[BaseModel], ...]] = (
    schemas.Link,
    schemas.ForecastRequest,
    journey_schemas.PlanRequest,
    journey_schemas.ReachRequest,
    journey_schemas.PlanResponse,
    journey_schemas.ReachResponse,
    journey_schemas.PlacesResponse,
    journey_schemas.MapResponse,
    journey_schemas.ViewResponse,
    live_schemas.TelemetryRequest,
    live_schemas.TelemetryResponse,
    live_schemas.LivePlanRequest,
    live_schemas.LiveResponse,
    live_schemas.LiveCarsResponse,
    live_schemas.NeedResponse,
    car_schemas.NewCarRequest,
    car_schemas.LogsRequest,
    car_schemas.CarsResponse,
    car_schemas.CarResponse,
    car_schemas.UploadResponse,
    car_schemas.LogsResponse,
    car_schemas.TokenResponse,
    car_schemas.Forgotten,
    schemas.UpdateRequest,
    schemas.ForecastResponse,
    schemas.RouteResponse,
    schemas.ModelsResponse,
    schemas.VehiclesResponse,
    schemas.VehicleFigures,
    schemas.DescribedVehicle,
    schemas.ExamplesResponse,
    schemas.ExampleResponse,
    schemas.HealthResponse,
    schemas.ProblemDocument,
)
"""Schemas that the document contains, with those that they refer to."""

UPLOADS: Final[Mapping[str, dict[str, Any]]] = {
    "application/gpx+xml": {"schema": {"type": "string"}, "example": GPX},
    "application/vnd.google-earth.kml+xml": {"schema": {"type": "string"}, "example": KML},
    "application/xml": {"schema": {"type": "string"}, "example": GPX},
    "text/xml": {"schema": {"type": "string"}, "example": GPX},
    "text/csv": {"schema": {"type": "string"}, "example": CSV},
    "application/octet-stream": {"schema": {"type": "string", "format": "binary"}},
    "application/geo+json": {"schema": {"type": "object"}, "example": GEOJSON},
    JSON: {"schema": {"type": ["object", "array"]}, "example": PLANNED_REQUEST["links"]},
}
"""Media type of an upload -> its media type object."""

BODY_PROBLEMS: Final = (
    "bad-request",
    "not-acceptable",
    "body-late",
    "too-large",
    "media-type",
    "invalid-input",
)
POOL_PROBLEMS: Final = ("busy", "timeout")
COMMON_PROBLEMS: Final = ("bad-request", "token-needed", "too-many-requests", "internal")
_MAP_PROBLEMS: Final = (
    *COMMON_PROBLEMS,
    "not-acceptable",
    "invalid-input",
    *POOL_PROBLEMS,
    "no-map",
    "remote",
)

_LIVE_PROBLEMS: Final = (
    *COMMON_PROBLEMS,
    "not-found",
    "not-acceptable",
    "invalid-input",
    *POOL_PROBLEMS,
    "no-live",
)


def _problems(*kinds: str) -> dict[int | str, dict[str, Any]]:
    """Responses with problem documents, by status; kinds of one status share a response."""
    by_status: dict[int, list[str]] = {}
    for kind in kinds:
        status, title = TITLES[kind]
        titles = by_status.setdefault(status, [])
        if title not in titles:
            titles.append(title)
    content = {MEDIA_TYPE: {"schema": {"$ref": REFERENCE + "ProblemDocument"}}}
    return {
        status: {"description": "; ".join(titles), "content": content}
        for status, titles in sorted(by_status.items())
    }


def _content(media_type: str, schema: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {media_type: {"schema": schema, **more}}


def _reference(model: type[BaseModel]) -> dict[str, Any]:
    return {"$ref": REFERENCE + model.__name__}


def _operation(
    tag: str,
    description: str,
    content: dict[str, Any],
    problems: Iterable[str],
    request_content: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Arguments of `FastAPI.add_api_route` for one operation.

    Parameters
    ----------
    tag : str
    description : str
        Description of the response with status 200.
    content : dict
        Its media types.
    problems : iterable of str
        Kinds of problems.
    request_content : dict, optional
        Media types of the request body.
    """
    responses = {200: {"description": description, "content": content}, **_problems(*problems)}
    if request_content is None:
        return {"tags": [tag], "responses": responses}
    body = {"requestBody": {"required": True, "content": request_content}}
    return {"tags": [tag], "responses": responses, "openapi_extra": body}


def _forecast_operation(
    request: type[BaseModel], description: str, examples: Mapping[str, Any]
) -> dict[str, Any]:
    shown = {name: {"value": value} for name, value in examples.items()}
    return _operation(
        "forecast",
        description,
        _content(JSON, _reference(schemas.ForecastResponse)),
        (*COMMON_PROBLEMS, *BODY_PROBLEMS, *POOL_PROBLEMS),
        _content(JSON, _reference(request), examples=shown),
    )


def forecast() -> dict[str, Any]:
    """Return the description of `POST /v1/forecast`."""
    examples = {"planned road": PLANNED_REQUEST, "speed trace": SAMPLES_REQUEST}
    return _forecast_operation(schemas.ForecastRequest, "The forecast", examples)


def update() -> dict[str, Any]:
    """Return the description of `POST /v1/forecast/update`."""
    return _forecast_operation(schemas.UpdateRequest, "The updated forecast", {"after 20 s": UPDATE_REQUEST})


def batch() -> dict[str, Any]:
    """Return the description of `POST /v1/forecast/batch`."""
    return _operation(
        "forecast",
        "One ForecastResponse or ProblemDocument per line, in the order of the requests",
        _content(NDJSON, {"type": "string"}),
        (*COMMON_PROBLEMS, *BODY_PROBLEMS, "busy"),
        _content(NDJSON, {"description": "one ForecastRequest per line"}),
    )


def route() -> dict[str, Any]:
    """Return the description of `POST /v1/routes`."""
    return _operation(
        "routes",
        "The route or trip",
        _content(JSON, _reference(schemas.RouteResponse)),
        (*COMMON_PROBLEMS, *BODY_PROBLEMS, *POOL_PROBLEMS),
        dict(UPLOADS),
    )


def plan() -> dict[str, Any]:
    """Return the description of `POST /v1/plan`."""
    return _journey(journey_schemas.PlanRequest, journey_schemas.PlanResponse, "The journey", PLAN_REQUEST)


def reach() -> dict[str, Any]:
    """Return the description of `POST /v1/reachable`."""
    return _journey(journey_schemas.ReachRequest, journey_schemas.ReachResponse, "The area", REACH_REQUEST)


def _journey(
    request: type[BaseModel], response: type[BaseModel], description: str, example: Mapping[str, Any]
) -> dict[str, Any]:
    return _operation(
        "journeys",
        description,
        _content(JSON, _reference(response)),
        (*COMMON_PROBLEMS, *BODY_PROBLEMS, *POOL_PROBLEMS, "no-map", "remote"),
        _content(JSON, _reference(request), examples={"a journey": {"value": example}}),
    )


def places() -> dict[str, Any]:
    """Return the description of `GET /v1/places`."""
    content = _content(JSON, _reference(journey_schemas.PlacesResponse))
    return _operation("journeys", "The places", content, _MAP_PROBLEMS)


def tile() -> dict[str, Any]:
    """Return the description of `GET /v1/tiles/{zoom}/{column}/{row}`."""
    schema = {"type": "string", "format": "binary"}
    return _operation("journeys", "The tile; empty without roads", _content(TILE, schema), _MAP_PROBLEMS)


def view() -> dict[str, Any]:
    """Return the description of `GET /v1/map/view`."""
    content = _content(JSON, _reference(journey_schemas.ViewResponse))
    return _operation("journeys", "What is named there", content, _MAP_PROBLEMS)


def telemetry() -> dict[str, Any]:
    """Return the description of `POST /v1/telemetry`."""
    schema = _reference(live_schemas.TelemetryRequest)
    examples = {"a message": {"value": TELEMETRY_REQUEST}}
    found = _operation(
        "live",
        "What became of the message",
        _content(JSON, _reference(live_schemas.TelemetryResponse)),
        (*COMMON_PROBLEMS, *BODY_PROBLEMS, "busy", "no-live"),
        {**_content(JSON, schema, examples=examples), **_content(FORM, schema, examples=examples)},
    )
    found["openapi_extra"]["security"] = [{"car": []}, {}]  # or the token is part of the message
    return found


def live() -> dict[str, Any]:
    """Return the description of `GET /v1/live/{vehicle}`."""
    return _operation(
        "live", "The car", _content(JSON, _reference(live_schemas.LiveResponse)), _LIVE_PROBLEMS
    )


def live_cars() -> dict[str, Any]:
    """Return the description of `GET /v1/live`."""
    problems = (*COMMON_PROBLEMS, "not-acceptable", "no-live")
    return _operation("live", "The cars", _content(JSON, _reference(live_schemas.LiveCarsResponse)), problems)


def need() -> dict[str, Any]:
    """Return the description of `GET /v1/need`."""
    return _operation(
        "live",
        "What the next trip needs",
        _content(JSON, _reference(live_schemas.NeedResponse)),
        _LIVE_PROBLEMS,
    )


def live_plan() -> dict[str, Any]:
    """Return the description of `PUT /v1/live/{vehicle}/plan`."""
    return _operation(
        "live",
        "The car with its plan",
        _content(JSON, _reference(live_schemas.LiveResponse)),
        (*_LIVE_PROBLEMS, *BODY_PROBLEMS),
        _content(
            JSON,
            _reference(live_schemas.LivePlanRequest),
            examples={"planned road": {"value": PLANNED_REQUEST}},
        ),
    )


def live_events() -> dict[str, Any]:
    """Return the description of `GET /v1/live/{vehicle}/events`."""
    schema = {"type": "string", "description": "events `live`; the data of each is a LiveResponse"}
    return _operation("live", "A stream of server-sent events", _content(EVENTS, schema), _LIVE_PROBLEMS)


def cars() -> dict[str, Any]:
    """Return the description of `GET /v1/cars`."""
    return _operation(
        "cars", "The cars", _content(JSON, _reference(car_schemas.CarsResponse)), _LIVE_PROBLEMS
    )


def new_car() -> dict[str, Any]:
    """Return the description of `POST /v1/cars`."""
    return _car_operation("The car", car_schemas.NewCarRequest, NEW_CAR_REQUEST)


def car() -> dict[str, Any]:
    """Return the description of `GET /v1/cars/{car}`."""
    return _operation("cars", "The car", _content(JSON, _reference(car_schemas.CarResponse)), _LIVE_PROBLEMS)


def forget_car() -> dict[str, Any]:
    """Return the description of `DELETE /v1/cars/{car}`."""
    return _operation("cars", "Its name", _content(JSON, _reference(car_schemas.Forgotten)), _LIVE_PROBLEMS)


def car_token() -> dict[str, Any]:
    """Return the description of `POST /v1/cars/{car}/token`."""
    content = _content(JSON, _reference(car_schemas.TokenResponse))
    return _operation("cars", "The token; it cannot be shown again", content, _LIVE_PROBLEMS)


def put_logs() -> dict[str, Any]:
    """Return the description of `PUT /v1/cars/{car}/uploads/{upload}/{file}`."""
    return _operation(
        "cars",
        "The upload so far",
        _content(JSON, _reference(car_schemas.UploadResponse)),
        (*_LIVE_PROBLEMS, *BODY_PROBLEMS),
        {BYTES: {"schema": {"type": "string", "format": "binary"}}},
    )


def read_logs() -> dict[str, Any]:
    """Return the description of `POST /v1/cars/{car}/uploads/{upload}`."""
    return _car_operation(
        "The mapping, and what the tables hold", car_schemas.LogsRequest, {}, car_schemas.LogsResponse
    )


def learn() -> dict[str, Any]:
    """Return the description of `POST /v1/cars/{car}/uploads/{upload}/learn`."""
    return _car_operation("The car; its field `learning` shows the progress", car_schemas.LogsRequest, {})


def _car_operation(
    description: str,
    request: type[BaseModel],
    example: Mapping[str, Any],
    response: type[BaseModel] = car_schemas.CarResponse,
) -> dict[str, Any]:
    return _operation(
        "cars",
        description,
        _content(JSON, _reference(response)),
        (*_LIVE_PROBLEMS, *BODY_PROBLEMS),
        _content(JSON, _reference(request), examples={"example": {"value": dict(example)}}),
    )


def describe() -> dict[str, Any]:
    """Return the description of `POST /v1/vehicles`."""
    return _operation(
        "library",
        "The car",
        _content(JSON, _reference(schemas.DescribedVehicle)),
        (*COMMON_PROBLEMS, *BODY_PROBLEMS, *POOL_PROBLEMS),
        _content(
            JSON, _reference(schemas.VehicleFigures), examples={"compact car": {"value": FIGURES_REQUEST}}
        ),
    )


def library(model: type[BaseModel], description: str, *problems: str) -> dict[str, Any]:
    """Return the description of a GET request for cars, models or examples.

    Parameters
    ----------
    model : type
        Schema of the response.
    description : str
    *problems : str
        Kinds of problems beside the common ones.
    """
    kinds = (*COMMON_PROBLEMS, "not-acceptable", *POOL_PROBLEMS, *problems)
    return _operation("library", description, _content(JSON, _reference(model)), kinds)


def health(*, ready: bool) -> dict[str, Any]:
    """Return the description of `GET /readyz` (`ready`) or `GET /healthz`."""
    return _operation(
        "operation",
        "The service is ready" if ready else "The service is alive",
        _content(JSON, _reference(schemas.HealthResponse)),
        ("bad-request", "internal", *(("busy",) if ready else ())),
    )


def metrics() -> dict[str, Any]:
    """Return the description of `GET /metrics`."""
    return _operation(
        "operation",
        "Metrics in the text format of Prometheus",
        _content("text/plain", {"type": "string"}),
        COMMON_PROBLEMS,
    )


def add_schemas(app: FastAPI, with_token: bool) -> None:
    """Add the schemas of requests and responses to the OpenAPI document of an application.

    Parameters
    ----------
    app : FastAPI
        Its method `openapi` is replaced.
    with_token : bool
        Whether the document requires a bearer token.
    """
    derive = app.openapi

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            found = derive()
            _, models = models_json_schema(
                [(model, "validation") for model in DOCUMENTED], ref_template=REFERENCE + "{model}"
            )
            components = found.setdefault("components", {})
            components["schemas"] = models["$defs"]
            components["securitySchemes"] = {"car": {"type": "http", "scheme": "bearer"}}
            if with_token:
                components["securitySchemes"]["token"] = {"type": "http", "scheme": "bearer"}
                found["security"] = [{"token": []}]
            app.openapi_schema = found
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign] # the way that FastAPI documents
