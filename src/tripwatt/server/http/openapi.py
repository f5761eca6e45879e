"""The OpenAPI document: what FastAPI cannot derive of an operation stands at its handler, in `operation`."""

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
from tripwatt.server.http.problems import MEDIA_TYPE, SAFE_METHODS, TITLES
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

COMMON_PROBLEMS: Final = ("bad-request", "token-needed", "internal")
BODY_PROBLEMS: Final = ("body-late", "too-large", "media-type", "invalid-input")
QUERY_PROBLEMS: Final = ("invalid-input",)
POOL_PROBLEMS: Final = ("busy", "timeout")
TAG_PROBLEMS: Final[Mapping[str, tuple[str, ...]]] = {
    "journeys": ("no-map", "remote"),
    "live": ("no-such-car", "no-live"),
    "cars": ("no-such-car", "no-live"),
}
"""Problems of all operations of a tag."""

TAG: Final = "If-None-Match"
HEADERS: Final = {
    TAG: "the `ETag` that the client has: a 304 has no content",
    "ETag": "changes with the content",
    "Retry-After": "seconds to wait",
}
"""Headers of requests that an operation heeds, and of responses."""

Content = type | dict[str, Any]
"""A document of JSON by its schema, or an object of OpenAPI for a media type."""

Handler = TypeVar("Handler", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Operation:
    """What the document has of an operation beside the signature and the docstring of its handler.

    Attributes
    ----------
    method, path : str
    tag : str
    answer : mapping of str to Content
        Content of that response by media type.
    takes : mapping of str to Content
        Content of the request by media type; empty for a request without a body.
    also : tuple of str
        Kinds of problems beside those that follow from body, parameters and tag.
    only : tuple of str or None
        All kinds of problems, where they do not follow.
    header : str
        A header of the request that the operation heeds: `TAG`; empty for none.
    internal : bool
        Whether it serves the page alone and may change in any version.
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
    also: tuple[str, ...] = ()
    only: tuple[str, ...] | None = None
    header: str = ""
    internal: bool = False
    description: str = ""
    more: Mapping[str, Any] = field(default_factory=dict)

    def add_to(self, app: FastAPI, handler: Callable[..., Any]) -> None:
        """Add the operation to an application."""
        extra = {**self.more, **({"x-internal": True} if self.internal else {})}
        if self.takes:
            extra["requestBody"] = {"required": True, "content": _contents(self.takes)}
        kinds = self._kinds() if self.only is None else self.only
        if self.method not in SAFE_METHODS:
            kinds = (*kinds, "foreign-site")
        checks = known_parameters(handler, self.path) if "invalid-input" in kinds else []
        answer = {"description": self._description(), "content": _contents(self.answer)}
        answers = {200: answer, **_problems(kinds)}
        if self.header == TAG:
            answer |= _headers("ETag")
            answers[304] = {"description": "The client has it already", **_headers("ETag")}
        if self.header:
            heeded = {"name": self.header, "in": "header", "description": HEADERS[self.header], **TEXT}
            extra["parameters"] = [heeded]
        app.add_api_route(
            self.path,
            handler,
            methods=[self.method],
            operation_id=handler.__name__,
            tags=[self.tag],
            dependencies=checks,
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

    def _kinds(self) -> tuple[str, ...]:
        of_input = BODY_PROBLEMS if self.takes else QUERY_PROBLEMS
        return (*COMMON_PROBLEMS, *of_input, *POOL_PROBLEMS, *TAG_PROBLEMS.get(self.tag, ()), *self.also)


class Schemas(GenerateJsonSchema):
    """Schemas of which generated clients make optional fields: some count a field with a `default` as required."""

    def dataclass_schema(self, schema: Any) -> JsonSchemaValue:
        """Return the schema of a dataclass of the library, which a response has with all its fields."""
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
    """The schema of a parameter: in a URL it can be left out, but not be null."""
    kinds = [one for one in schema.get("anyOf", ()) if one != {"type": "null"}]
    return {**kinds[0], **{k: v for k, v in schema.items() if k != "anyOf"}} if len(kinds) == 1 else schema


def _by_type(content: Content | Mapping[str, Content] | None) -> Mapping[str, Content]:
    if content is None:
        return {}
    return {JSON: content} if isinstance(content, type) else content


def _contents(contents: Mapping[str, Content]) -> dict[str, Any]:
    """Media type objects; a schema comes with its examples."""
    described = {}
    for media_type, content in contents.items():
        if isinstance(content, type):
            examples = EXAMPLES.get(content.__name__, {})
            shown = {name: {"value": value} for name, value in examples.items()}
            reference = {"schema": {"$ref": REFERENCE + content.__name__}}
            content = {**reference, **({"examples": shown} if shown else {})}
        described[media_type] = content
    return described


def _headers(*names: str) -> dict[str, Any]:
    return {"headers": {name: {"description": HEADERS[name], **TEXT} for name in names}}


def _problems(kinds: Iterable[str]) -> dict[int | str, dict[str, Any]]:
    """Responses with problem documents, by status; kinds of one status share a response."""
    by_status: dict[int, dict[str, None]] = {}
    for kind in kinds:
        status, title = TITLES[kind]
        by_status.setdefault(status, {})[title] = None
    content = _contents({MEDIA_TYPE: ProblemDocument})
    retry = dict.fromkeys((503,), _headers("Retry-After"))
    return {
        status: {"description": "; ".join(titles), "content": content, **retry.get(status, {})}
        for status, titles in sorted(by_status.items())
    }
