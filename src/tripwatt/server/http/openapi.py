"""The OpenAPI document: FastAPI derives it from the routes; requests, whose bodies the workers check, are described here."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, FastAPI, Query
from fastapi.routing import APIRoute
from pydantic import BaseModel, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.errors import Fault, did_you_mean, raise_faults
from tripwatt.server.http.example_requests import EXAMPLES
from tripwatt.server.http.problems import MEDIA_TYPE
from tripwatt.server.http.schemas import ProblemDocument

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
BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
TEXT: Final = {"schema": {"type": "string"}}

PROBLEM: Final[dict[str, Any]] = {
    "description": "A problem document",
    "content": {MEDIA_TYPE: {"schema": {"$ref": f"{REFERENCE}ProblemDocument"}}},
    "headers": {"Retry-After": {"description": "seconds to wait, where the service is busy", **TEXT}},
}
"""Any response of an operation that is not described otherwise."""

_TAG: Final = {"headers": {"ETag": {"description": "changes with the content", **TEXT}}}
_IF_NONE_MATCH: Final = {
    "name": "If-None-Match",
    "in": "header",
    "description": "the `ETag` that the client has: a 304 has no content",
    **TEXT,
}
_TAGGED: Final = {"200": _TAG, "304": {"description": "The client has it already", **_TAG}}
TAGGED: Final[dict[str, Any]] = {"openapi_extra": {"parameters": [_IF_NONE_MATCH], "responses": _TAGGED}}
"""Arguments of the route of a document that seldom changes."""

INTERNAL: Final[dict[str, Any]] = {"openapi_extra": {"x-internal": True}}
"""Arguments of a route that serves only the page and may change in any version."""


Fields = Annotated[
    str | None,
    Query(max_length=500, description="fields of the response, with commas, as `energy_wh,soc_arrival`; default: all. With it, required fields of the response may be missing: read it as JSON, without the types of a generated client"),
]  # fmt: skip


async def refuse_unknown_parameters(request: Request) -> None:  # a plain function would run in another thread
    """Refuse query parameters that the operation of a request lacks; a model of parameters refuses them itself.

    Raises
    ------
    InvalidInput
        With the most similar name.
    """
    parameters = request.scope["route"].dependant.query_params
    kinds = [parameter.field_info.annotation for parameter in parameters]
    if any(isinstance(kind, type) and issubclass(kind, BaseModel) for kind in kinds):
        return
    names = [parameter.alias for parameter in parameters]
    raise_faults(
        Fault("unknown parameter", f"query.{name[:80]}", fix=did_you_mean(name, names))
        for name in request.query_params
        if name not in names
    )


def new_router(tag: str, *, refuses_unknown: bool = True) -> APIRouter:
    """Return a router whose operations answer errors with problem documents, and refuse unknown parameters by default."""
    return APIRouter(
        tags=[tag],
        dependencies=[Depends(refuse_unknown_parameters)] * refuses_unknown,
        responses={"default": PROBLEM},
        generate_unique_id_function=lambda route: route.name,
    )


def request_body(model: type[BaseModel], *media_types: str, **more: Any) -> dict[str, Any]:
    """Return the arguments of a route whose body is a `model`, with its examples and `more` fields; a worker checks the body."""
    examples = {name: {"value": value} for name, value in EXAMPLES[model].items()}
    media_type = {"schema": {"$ref": REFERENCE + model.__name__}, "examples": examples}
    return request_content(dict.fromkeys(media_types or (JSON,), media_type), **more)


def request_content(content: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return the arguments of a route whose body has OpenAPI's objects `content` by media type, and `more` fields."""
    return {"openapi_extra": {"requestBody": {"required": True, "content": content}, **more}}


def response_content(content: dict[str, Any], description: str) -> dict[str, Any]:
    """Return the arguments of a route whose response is not JSON, but has OpenAPI's objects `content` by media type."""
    responses = {200: {"content": content}}
    return {"response_class": Response, "response_description": description, "responses": responses}


class Schemas(GenerateJsonSchema):
    """Makes schemas with `x-default` in place of `default`: some generated clients take a field with `default` as required."""

    def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a dataclass of the library; all of its fields are required."""
        document = super().dataclass_schema(schema)
        described = (inspect.getdoc(schema["cls"]) or "").partition("\n\nExamples\n")[0]
        return document | {
            "description": described,
            "required": [*document["properties"]],
            "additionalProperties": False,
        }

    def default_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a field that has a default."""
        document = super().default_schema(schema)
        default = document.pop("default", None)
        if default is not None:
            document["x-default"] = default
        return document


def describe_requests(app: FastAPI, *, with_token: bool) -> None:
    """Complete the OpenAPI document of an application by the schemas of requests and, `with_token`, by a required token."""
    derive = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            answered = [r for r in app.routes if isinstance(r, APIRoute) and r.response_model is not None]
            for route in answered:
                route.response_description = (inspect.getdoc(route.response_model) or "").partition("\n")[0]
            document = derive()
            for operations in document["paths"].values():
                for parameter in (p for of in operations.values() for p in of.get("parameters", ())):
                    parameter["schema"] = without_null(parameter["schema"])
            security = {"car": {"type": "http", "scheme": "bearer"}}
            if with_token:
                security["token"] = {"type": "http", "scheme": "bearer"}
                document["security"] = [{"token": []}]
            document["components"] = {
                "schemas": _schemas(r.response_model for r in answered),
                "securitySchemes": security,
            }
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign] # the way that FastAPI documents


def _schemas(answers: Iterable[Any]) -> dict[str, Any]:
    """Return the schemas of all requests, and of these answers."""
    models = sorted({ProblemDocument, *EXAMPLES, *answers}, key=lambda model: model.__name__)
    _, document = TypeAdapter.json_schemas(
        [(model, "validation", TypeAdapter(model)) for model in models],
        ref_template=REFERENCE + "{model}",
        schema_generator=Schemas,
    )
    return dict(document["$defs"])


def without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a parameter without null: in a URL, a parameter can be left out but not be null."""
    kinds = [kind for kind in schema.get("anyOf", ()) if kind != {"type": "null"}]
    return {**kinds[0], **{k: v for k, v in schema.items() if k != "anyOf"}} if len(kinds) == 1 else schema
