"""What operations have in common beside their documents: known parameters, chosen fields and entity tags."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

from fastapi import Query
from fastapi.params import Depends
from pydantic import BaseModel
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.errors import Fault, did_you_mean, excerpt, raise_faults

Fields = Annotated[
    str | None,
    Query(max_length=500, description="fields of the response, with commas, as `energy_wh,soc_arrival`; default: all. With it, required fields of the response may be missing: read it as JSON, without the types of a generated client"),
]  # fmt: skip


def known_parameters(handler: Callable[..., Any], path: str) -> list[Depends]:
    """Return the dependency that refuses query parameters which the handler lacks; none if a model checks its parameters.

    Raises
    ------
    InvalidInput
        By the dependency, with the most similar name.
    """
    types = get_type_hints(handler)
    parameters = inspect.signature(handler).parameters
    names = [name for name in parameters if name != "request" and f"{{{name}}}" not in path]
    if any(isinstance(types[name], type) and issubclass(types[name], BaseModel) for name in names):
        return []

    async def check(request: Request) -> None:  # a plain function would run in another thread
        raise_faults(
            Fault("unknown parameter", f"query.{name[:80]}", fix=did_you_mean(name, names))
            for name in request.query_params
            if name not in names
        )

    return [Depends(check)]


def chosen(document: Any, fields: str | None) -> Any:
    """Return the named fields of a document; all fields if `fields` is None.

    Raises
    ------
    InvalidInput
        For a name that the document does not have.

    Examples
    --------
    >>> chosen({"energy_wh": 1.0, "series": []}, "energy_wh")
    {'energy_wh': 1.0}
    """
    if fields is None:
        return document
    names = fields.split(",")
    raise_faults(
        Fault("unknown field", "query.fields", excerpt(name), ", ".join(document))
        for name in names
        if name not in document
    )
    return {name: document[name] for name in names}


def tagged(request: Request, content: bytes, media_type: str) -> Response:
    """Return a document that seldom changes with its entity tag; status 304 without content if the client has it already."""
    tag = f'W/"{hashlib.sha256(content).hexdigest()[:20]}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    if tag in [given.strip() for given in request.headers.get("if-none-match", "").split(",")]:
        return Response(status_code=304, headers=headers)
    return Response(content, headers=headers, media_type=media_type)
