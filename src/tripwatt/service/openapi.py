"""What the OpenAPI document says beyond the routes: bodies, answers, problems, examples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from fastapi import FastAPI
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from tripwatt.service import answers, bodies
from tripwatt.service.problems import MEDIA_TYPE, TITLES

DESCRIPTION: Final = """The service returns the same forecast as `tripwatt forecast --json`, with the same field names. The
suffix of a name is its unit; numbers without a suffix are fractions. State of charge is the displayed one. Fields that a
request leaves out are unknown: the forecast flags them and its interval is wider. Errors are problem documents (RFC 9457)."""

REFERENCE: Final = "#/components/schemas/"

SAMPLES: Final = {
    "time_s": [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0],
    "speed_m_s": [0.0, 8.0, 13.0, 13.5, 13.0, 7.0, 0.0],
    "elevation_m": [520.0, 520.5, 522.0, 524.0, 525.0, 525.0, 525.0],
}
BY_LINKS: Final = {
    "links": [
        {"length_m": 800.0, "speed_m_s": 8.5, "grade": 0.01},
        {"length_m": 12000.0, "travel_time_s": 480.0, "grade": 0.0},
    ],
    "displayed_soc": 0.8,
    "ambient_temperature_degc": -5.0,
    "cabin_setpoint_degc": 21.0,
    "reserve": 0.15,
}
BY_SAMPLES: Final = {"samples": SAMPLES, "displayed_soc": 0.8, "ambient_temperature_degc": 12.0}
UPDATE: Final = {
    **BY_SAMPLES,
    "observed": {
        "time_s": [0.0, 10.0, 20.0],
        "voltage_v": [370.0, 362.0, 366.0],
        "current_a": [2.0, 40.0, 12.0],
    },
}
GPX: Final = (
    '<gpx><trk><trkseg><trkpt lat="48.10" lon="11.5"><time>2026-05-01T08:00:00Z</time></trkpt>'
    '<trkpt lat="48.11" lon="11.5"><time>2026-05-01T08:01:30Z</time></trkpt></trkseg></trk></gpx>'
)
CSV: Final = "time_s,speed_m_s\n0,0\n10,9\n20,12\n30,0\n"
GEOJSON: Final = {
    "type": "Feature",
    "geometry": {"type": "LineString", "coordinates": [[11.5, 48.1], [11.52, 48.1]]},
    "properties": {"speed_m_s": 14.0},
}
UPLOADS: Final[Mapping[str, dict[str, Any]]] = {
    "application/gpx+xml": {"schema": {"type": "string"}, "example": GPX},
    "application/xml": {"schema": {"type": "string"}, "example": GPX},
    "text/xml": {"schema": {"type": "string"}, "example": GPX},
    "text/csv": {"schema": {"type": "string"}, "example": CSV},
    "application/octet-stream": {"schema": {"type": "string", "format": "binary"}},
    "application/geo+json": {"schema": {"type": "object"}, "example": GEOJSON},
    "application/json": {"schema": {"type": ["object", "array"]}, "example": BY_LINKS["links"]},
}
"""Media type of an upload -> what is said of it."""

BODY_PROBLEMS: Final = (
    "bad-request",
    "not-acceptable",
    "body-late",
    "too-large",
    "media-type",
    "invalid-input",
)
WORK_PROBLEMS: Final = ("busy", "timeout")
ALWAYS: Final = ("bad-request", "token-needed", "too-many-requests", "internal")


def _problems(*kinds: str) -> dict[int | str, dict[str, Any]]:
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


def _answer(model: type[BaseModel], description: str, media_type: str = "application/json") -> dict[str, Any]:
    schema = {"$ref": REFERENCE + model.__name__}
    return {"description": description, "content": {media_type: {"schema": schema}}}


def _body(model: type[BaseModel], examples: Mapping[str, Any]) -> dict[str, Any]:
    shown = {name: {"value": value} for name, value in examples.items()}
    schema = {"$ref": REFERENCE + model.__name__}
    return {
        "requestBody": {
            "required": True,
            "content": {"application/json": {"schema": schema, "examples": shown}},
        }
    }


def forecast() -> dict[str, Any]:
    """About `POST /v1/forecast`."""
    return {
        "responses": {
            200: _answer(answers.ForecastAnswer, "The forecast"),
            **_problems(*ALWAYS, *BODY_PROBLEMS, *WORK_PROBLEMS),
        },
        "openapi_extra": _body(bodies.ForecastRequest, {"planned road": BY_LINKS, "speed trace": BY_SAMPLES}),
        "tags": ["forecast"],
    }


def update() -> dict[str, Any]:
    """About `POST /v1/forecast/update`."""
    return {
        "responses": {
            200: _answer(answers.ForecastAnswer, "The updated forecast"),
            **_problems(*ALWAYS, *BODY_PROBLEMS, *WORK_PROBLEMS),
        },
        "openapi_extra": _body(bodies.UpdateRequest, {"after 20 s": UPDATE}),
        "tags": ["forecast"],
    }


def batch() -> dict[str, Any]:
    """About `POST /v1/forecast/batch`."""
    text = {"description": "one ForecastRequest per line"}
    said = "One ForecastAnswer or ProblemDocument per line, in the order of the requests"
    return {
        "responses": {
            200: {
                "description": said,
                "content": {"application/x-ndjson": {"schema": {"type": "string"}}},
            },
            **_problems(*ALWAYS, *BODY_PROBLEMS, "busy"),
        },
        "openapi_extra": {
            "requestBody": {"required": True, "content": {"application/x-ndjson": {"schema": text}}}
        },
        "tags": ["forecast"],
    }


def route() -> dict[str, Any]:
    """About `POST /v1/routes`."""
    return {
        "responses": {
            200: _answer(answers.RouteAnswer, "The route or trip"),
            **_problems(*ALWAYS, *BODY_PROBLEMS, *WORK_PROBLEMS),
        },
        "openapi_extra": {"requestBody": {"required": True, "content": dict(UPLOADS)}},
        "tags": ["routes"],
    }


def plain(model: type[BaseModel], description: str) -> dict[str, Any]:
    """About a list that can be had."""
    return {
        "responses": {
            200: _answer(model, description),
            **_problems(*ALWAYS, "not-acceptable", *WORK_PROBLEMS),
        },
        "tags": ["library"],
    }


def example() -> dict[str, Any]:
    """About `GET /v1/examples/{trip}`."""
    about = plain(answers.ExampleTripAnswer, "The trip")
    about["responses"] |= _problems("not-found")
    about["responses"] |= _problems("invalid-input")
    return about


def health(*, ready: bool) -> dict[str, Any]:
    """About `GET /healthz` and `GET /readyz`."""
    more = _problems("busy") if ready else {}
    return {
        "responses": {
            200: _answer(answers.HealthAnswer, "The service is ready" if ready else "The service is alive"),
            **_problems("bad-request", "internal"),
            **more,
        },
        "tags": ["operation"],
    }


def metrics() -> dict[str, Any]:
    """About `GET /metrics`."""
    text = {"text/plain": {"schema": {"type": "string"}}}
    return {
        "responses": {
            200: {"description": "Metrics in the text format of Prometheus", "content": text},
            **_problems(*ALWAYS),
        },
        "tags": ["operation"],
    }


def complete(app: FastAPI, with_token: bool) -> None:
    """Put the schemas of bodies and answers, and the token where one is asked for, into the document of the app."""
    made = app.openapi
    models: list[type[BaseModel]] = [
        bodies.Link,
        bodies.ForecastRequest,
        bodies.UpdateRequest,
        answers.ForecastAnswer,
        answers.RouteAnswer,
        answers.ModelsAnswer,
        answers.VehiclesAnswer,
        answers.ExamplesAnswer,
        answers.ExampleTripAnswer,
        answers.HealthAnswer,
        answers.ProblemDocument,
    ]

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            found = made()
            _, schemas = models_json_schema(
                [(model, "validation") for model in models], ref_template=REFERENCE + "{model}"
            )
            components = found.setdefault("components", {})
            components["schemas"] = schemas["$defs"]
            if with_token:
                components["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
                found["security"] = [{"token": []}]
            app.openapi_schema = found
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign] # the way that FastAPI documents
