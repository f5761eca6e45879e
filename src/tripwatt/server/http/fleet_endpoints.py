"""The endpoints of the fleet of a registry: what its planned trips need, and the report for its manager."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from fastapi import Path as PathValue
from fastapi import Query, Response

from tripwatt.fleet.registry import SERVED_FILES, Registry, is_registry
from tripwatt.server.http.car_endpoints import Entries
from tripwatt.server.http.fleets import FleetRows, NightRequest, NightResponse, fleet_named
from tripwatt.server.http.openapi import JSON, TAGGED, TEXT, new_router, request_body, response_content
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.service import Call, Called, json_response

MEDIA_TYPES: Final = {".html": "text/html", ".json": JSON, ".csv": "text/csv", ".txt": "text/plain"}
"""Suffix of a file of a report -> media type."""

POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
"""Content-Security-Policy of a report, which is one file with its style and script; the page itself allows only this script, by its digest."""

REPORT: Final = {kind: {} if kind == JSON else TEXT for kind in MEDIA_TYPES.values()}
"""Media type of a file of a report -> its media type object."""

ReportFile = Annotated[str, PathValue(json_schema_extra={"enum": list(SERVED_FILES)})]
FleetName = Annotated[
    str | None, Query(max_length=100, description="a fleet of /v1/models; default: the first one")
]

Cursor = Annotated[int, Query(ge=0, le=1_000_000, description="`next` of the answer before")]

fleet = new_router("fleet")


@fleet.post("/v1/fleet/needs", response_model=NightResponse, **request_body(NightRequest))
async def fleet_needs(call: Called) -> Response:
    """Return what the planned trips of a fleet need, by vehicle and hour of departure, also as EMHASS and evcc read it."""
    return await call.body_job("night")


@fleet.get("/v1/fleet/report/{file}", **response_content(REPORT, "The file"), **TAGGED)
async def get_fleet_report(call: Called, file: ReportFile, model: FleetName = None) -> Response:
    """Return a file of the report that `tripwatt fleet report` wrote last: its page, its data, one of its tables; or the choice beside it."""
    content = _registry(call, model).report_file(file)
    if content is None:
        raise Problem("not-found", "no such file; `tripwatt fleet report` or `choose` writes it")
    response = call.with_entity_tag(content, MEDIA_TYPES[Path(file).suffix])
    response.headers["Content-Security-Policy"] = POLICY
    return response


async def list_fleet(
    call: Called, model: FleetName = None, limit: Entries = 200, cursor: Cursor = 0
) -> Response:
    """List the vehicles or changes of the last report, or what was done with the versions of the model (health)."""
    table = call.request.url.path.rpartition("/")[2]
    return json_response(_registry(call, model).page(table, limit, cursor))


for each in ("vehicles", "changes", "health"):  # a parameter of the path would also match /v1/fleet/needs
    fleet.get(f"/v1/fleet/{each}", name=f"list_fleet_{each}", response_model=FleetRows)(list_fleet)


def _registry(call: Call, model: str | None) -> Registry:
    """Return the registry of a fleet, by default of the first one."""
    folders = call.service.settings.models.items()
    return fleet_named({name: Registry(folder) for name, folder in folders if is_registry(folder)}, model)
