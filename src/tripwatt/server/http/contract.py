"""What operations have in common beside their documents: known parameters, chosen fields, entity tags, requests that are sent twice."""

from __future__ import annotations

import asyncio
import hashlib
import inspect
import re
from collections.abc import Awaitable, Callable
from typing import Annotated, Any, Final, get_type_hints

from cachetools import TTLCache
from fastapi import Query
from fastapi.params import Depends
from pydantic import BaseModel
from starlette.requests import Request
from starlette.responses import Response

from tripwatt.errors import Fault, InvalidInput, did_you_mean, excerpt, raise_faults
from tripwatt.server.http.problems import Problem

KEPT_REQUESTS: Final = 1000
KEPT_FOR_S: Final = 86_400.0
"""Responses that are kept by `Idempotency-Key`, and how long [s]."""

VALID_KEY: Final = re.compile(r"[\x21-\x7e]{1,255}")

Fields = Annotated[
    str | None,
    Query(max_length=500, description="fields of the response, with commas, as `energy_wh,soc_arrival`; default: all. With it, required fields of the response may be missing: read it as JSON, without the types of a generated client"),
]  # fmt: skip


def known_parameters(handler: Callable[..., Any], path: str) -> list[Depends]:
    """The check that a request has no parameter in its query which the handler of its operation lacks; a model checks its own.

    Raises
    ------
    InvalidInput
        With the most similar name, by the check.
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
    """The named fields of a document; all where no name is given.

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
    """A document that seldom changes, with its entity tag; without content where the client has it already."""
    tag = f'W/"{hashlib.sha256(content).hexdigest()[:20]}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    if tag in [given.strip() for given in request.headers.get("if-none-match", "").split(",")]:
        return Response(status_code=304, headers=headers)
    return Response(content, headers=headers, media_type=media_type)


class Repeats:
    """Responses by `Idempotency-Key`: a request that is sent again does nothing and gets the first response."""

    def __init__(self) -> None:
        self._kept: TTLCache[tuple[str, str, str], tuple[bytes, asyncio.Task[Response]]] = TTLCache(
            KEPT_REQUESTS, KEPT_FOR_S
        )

    async def once(self, request: Request, body: bytes, work: Callable[[], Awaitable[Response]]) -> Response:
        """Do the work of a request, unless it was done for the same key.

        Raises
        ------
        InvalidInput
            For a key of other characters than printable ASCII.
        Problem
            `key-used` where the key came with another body.
        """
        key = request.headers.get("idempotency-key")
        if key is None:
            return await work()
        if not VALID_KEY.fullmatch(key):
            raise InvalidInput.of("not a key", "header.Idempotency-Key", excerpt(key), "1 to 255 characters")
        place, digest = (request.method, request.url.path, key), hashlib.sha256(body).digest()
        before = self._kept.get(place)
        if before is None:
            before = self._kept[place] = digest, asyncio.ensure_future(work())
        elif before[0] != digest:
            raise Problem("key-used", "the Idempotency-Key of another body")
        try:
            response = await asyncio.shield(before[1])
        except BaseException:
            self._kept.pop(place, None)
            raise
        if response.status_code >= 400:
            self._kept.pop(place, None)  # what was not done may be tried again
        return Response(response.body, response.status_code, media_type=response.media_type)
