"""The OpenAPI document: the decorator `operation` of a handler states what FastAPI cannot derive."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from fastapi import FastAPI
from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from starlette.responses import Response

from tripwatt.server.http.contract import known_parameters
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
HEALTH: Final = "operation"
"""Tag of operations for monitoring, which ignore unknown parameters."""

BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
TEXT: Final = {"schema": {"type": "string"}}

TAG: Final = {"ETag": {"description": "changes with the content", **TEXT}}
HELD: Final = {
    "name": "If-None-Match",
    "in": "header",
    "description": "the `ETag` that the client has: a 304 has no content",
    **TEXT,
}
"""Headers of a document that seldom changes, and of a request for it."""

Content = type | dict[str, Any]
"""Schema of a JSON document, or an OpenAPI object for a media type."""

Handler = TypeVar("Handler", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Operation:
    """What the OpenAPI document states of an operation beyond the signature and the docstring of its handler.

    Attributes
    ----------
    method, path : str
    tag : str
    answer : mapping of str to Content
        Content of the response with status 200, by media type.
    takes : mapping of str to Content
        Content of the request by media type; empty for a request without a body.
    tagged : bool
        Whether the operation supports `If-None-Match`.
    internal : bool
        Whether the operation serves only the page and may change in any version.
    description : str
        Description of the response with status 200; that of its schema by default.
    more : mapping
        Further fields of the operation.
    """

    method: str
    path: str
    tag: str
    answer: Mapping[str, Content]
    takes: Mapping[str, Content]
    tagged: bool = False
    internal: bool = False
    description: str = ""
    more: Mapping[str, Any] = field(default_factory=dict)

    def add_to(self, app: FastAPI, handler: Callable[..., Any]) -> None:
        """Add the operation to an application; any response that it does not describe is a problem document."""
        answer = {"description": self._description(), "content": _contents(self.answer)}
        answers: dict[int | str, dict[str, Any]] = {200: answer, "default": PROBLEM}
        extra = {**self.more, **({"x-internal": True} if self.internal else {})}
        if self.takes:
            extra["requestBody"] = {"required": True, "content": _contents(self.takes)}
        if self.tagged:
            answers[304] = {"description": "The client has it already", "headers": TAG}
            answer["headers"], extra["parameters"] = TAG, [HELD]
        app.add_api_route(
            self.path,
            handler,
            methods=[self.method],
            operation_id=handler.__name__,
            tags=[self.tag],
            dependencies=[] if self.tag == HEALTH else known_parameters(handler, self.path),
            response_class=Response,
            response_model=None,
            responses=answers,
            openapi_extra=extra,
        )

    def models(self) -> set[type]:
        """Return the schemas of request and response."""
        contents = (*self.answer.values(), *self.takes.values())
        return {content for content in contents if isinstance(content, type)}

    def _description(self) -> str:
        content, *_ = self.answer.values()
        summary = inspect.getdoc(content) if isinstance(content, type) else ""
        return self.description or (summary or "").partition("\n")[0]


class Schemas(GenerateJsonSchema):
    """Makes schemas with `x-default` in place of `default`: some generated clients take a field with `default` as required."""

    def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a dataclass of the library; all of its fields are required."""
        made = super().dataclass_schema(schema)
        described = (inspect.getdoc(schema["cls"]) or "").partition("\n\nExamples\n")[0]
        return made | {
            "description": described,
            "required": [*made["properties"]],
            "additionalProperties": False,
        }

    def default_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a field that has a default."""
        made = super().default_schema(schema)
        default = made.pop("default", None)
        if default is not None:
            made["x-default"] = default
        return made


def operation(
    route: str,
    tag: str,
    answer: Content | Mapping[str, Content],
    takes: Content | Mapping[str, Content] | None = None,
    **more: Any,
) -> Callable[[Handler], Handler]:
    """Describe the operation of a handler.

    Parameters
    ----------
    route : str
        Method and path.
    tag : str
    answer, takes : type, or mapping of str to Content
        A schema of JSON, or content by media type.
    **more : object
        Further attributes of `Operation`.
    """
    method, path = route.split()

    def mark(handler: Handler) -> Handler:
        made = Operation(method, path, tag, _by_type(answer), _by_type(takes), **more)
        handler.operation = made  # type: ignore[attr-defined]
        return handler

    return mark


def add_operations(app: FastAPI, owners: Iterable[object], *, with_token: bool) -> None:
    """Add the operations of objects to an application, and their schemas to its document.

    Parameters
    ----------
    app : FastAPI
        Its method `openapi` is replaced.
    owners : iterable of object
        Objects with methods that `operation` describes.
    with_token : bool
        Whether the document requires a bearer token.
    """
    models: set[type] = {ProblemDocument}
    for owner in owners:
        for name, handler in vars(type(owner)).items():
            described = getattr(handler, "operation", None)
            if described is not None:
                described.add_to(app, getattr(owner, name))
                models |= described.models()
    derive = app.openapi

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            derived = derive()
            for operations in derived["paths"].values():
                for parameter in (p for of in operations.values() for p in of.get("parameters", ())):
                    parameter["schema"] = _without_null(parameter["schema"])
            ordered = sorted(models, key=lambda model: model.__name__)
            _, schemas = TypeAdapter.json_schemas(
                [(model, "validation", TypeAdapter(model)) for model in ordered],
                ref_template=REFERENCE + "{model}",
                schema_generator=Schemas,
            )
            security = {"car": {"type": "http", "scheme": "bearer"}}
            if with_token:
                security["token"] = {"type": "http", "scheme": "bearer"}
                derived["security"] = [{"token": []}]
            derived["components"] = {"schemas": schemas["$defs"], "securitySchemes": security}
            app.openapi_schema = derived
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign] # the way that FastAPI documents


def _without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a parameter without null: in a URL, a parameter can be left out but not be null."""
    kinds = [one for one in schema.get("anyOf", ()) if one != {"type": "null"}]
    return {**kinds[0], **{k: v for k, v in schema.items() if k != "anyOf"}} if len(kinds) == 1 else schema


def _by_type(content: Content | Mapping[str, Content] | None) -> Mapping[str, Content]:
    if content is None:
        return {}
    return {JSON: content} if isinstance(content, type) else content


def _contents(contents: Mapping[str, Content]) -> dict[str, Any]:
    """Return media type objects; a schema comes with its examples."""
    described = {}
    for media_type, content in contents.items():
        if isinstance(content, type):
            examples = EXAMPLES.get(content.__name__, {})
            shown = {name: {"value": value} for name, value in examples.items()}
            reference = {"schema": {"$ref": REFERENCE + content.__name__}}
            content = {**reference, **({"examples": shown} if shown else {})}
        described[media_type] = content
    return described


PROBLEM: Final[dict[str, Any]] = {
    "description": "A problem document",
    "content": _contents({MEDIA_TYPE: ProblemDocument}),
    "headers": {"Retry-After": {"description": "seconds to wait, where the service is busy", **TEXT}},
}
"""Any response of an operation that is not described otherwise."""
