"""What operations have in common: known parameters, and fields of a document that a request chooses."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from pydantic import BaseModel
from starlette.requests import Request

from tripwatt.errors import Fault, did_you_mean, excerpt, raise_faults

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


def chosen_fields(document: Any, fields: str | None) -> Any:
    """Return the named fields of a document; all fields if `fields` is None.

    Raises
    ------
    InvalidInput
        For a name that the document does not have.

    Examples
    --------
    >>> chosen_fields({"energy_wh": 1.0, "series": []}, "energy_wh")
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
