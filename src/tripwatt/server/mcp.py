"""Tools for assistants over the Model Context Protocol: jobs of the service with its schemas, without HTTP."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

import anyio
import mcp_types as types
import orjson
from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server
from pydantic import BaseModel, Field

import tripwatt
from tripwatt.errors import Fault, InvalidInput
from tripwatt.server.http import car_schemas, schemas
from tripwatt.server.http import journey_schemas as journey
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.openapi import without_null
from tripwatt.server.http.problems import TITLES, WORDS, Problem
from tripwatt.server.http.schemas import StrictModel, check_request, parse_json

LEFT_OUT: Final = ("series", "samples", "line", "course", "links", "learning")
"""Fields of answers that an assistant does not get: thousands of numbers for figures and maps, and the state of a job."""


NOT_ASKED: Final = ("x-", "samples", "elevation", "Elevation", "covariates")
"""Beginnings of the names of what the schema of a request leaves out: parts of a form, and what has thousands of numbers."""


class LiveRequest(StrictModel):
    """A car that learns from its trips."""

    car: str = Field(max_length=100)
    """its name, one of the tool `cars`"""


class DiaryRequest(LiveRequest):
    """A car that learns from its trips, and how many."""

    trips: int = Field(10, ge=1, le=200)
    """entries of the diary, the newest first"""


class VehiclesRequest(StrictModel):
    """Words to look for among the cars of the library."""

    search: str | None = Field(None, max_length=100)
    """words of maker, model and year; default: all cars"""


Tool = tuple[Callable[[Jobs, Any], Mapping[str, Any]], type[BaseModel]]
"""A tool: the function that it runs, and the schema of its request."""

TOOLS: Final[Mapping[str, Tool]] = {
    "plan": (Jobs.plan, journey.PlanRequest),
    "need": (Jobs.distance, journey.NeedQuery),
    "range": (Jobs.range, journey.RangeQuery),
    "advise": (Jobs.advice, schemas.AdviceRequest),
    "advise_journey": (Jobs.journey_advice, journey.JourneyAdviceRequest),
    "forecast": (Jobs.forecast, schemas.ForecastRequest),
    "live": (lambda jobs, asked: jobs.cars.car(asked.car).document(time.time()), LiveRequest),
    "diary": (lambda jobs, asked: jobs.cars.show(asked.car, asked.trips), DiaryRequest),
    "cars": (lambda jobs, _: jobs.cars.list(), StrictModel),
    "vehicles": (lambda jobs, asked: jobs.vehicles(asked.search), VehiclesRequest),
    "new_car": (Jobs.new_car, car_schemas.NewCarRequest),
}
"""Tools by name."""

CHANGING: Final = ("new_car",)
"""Tools that change something."""

OF_MAP: Final = ("plan", "advise_journey")
OF_CARS: Final = ("live", "diary", "cars", "new_car")
"""Tools that need a map, and tools that need a folder of cars; without these they are not offered."""


def make_server(jobs: Jobs, *, changes: bool = False, remote: bool = False) -> Server[Any]:
    """Make the server of the tools.

    Parameters
    ----------
    jobs : Jobs
        Models, map and cars.
    changes : bool
        Whether tools that change something are offered, too.
    remote : bool
        Whether tools ask other servers: for roads, places or the weather.

    Returns
    -------
    mcp.server.lowlevel.Server
        Server that runs one tool at a time.

    Examples
    --------
    >>> from tripwatt.server.http.settings import Limits
    >>> make_server(Jobs.from_folders({}, Limits())).name
    'tripwatt'
    """
    absent = OF_MAP * (jobs.journeys.atlas is None) + OF_CARS * (jobs.cars.folder is None)
    offered = [name for name in TOOLS if name not in absent and (changes or name not in CHANGING)]
    listed = types.ListToolsResult(tools=[_describe_tool(name, remote) for name in offered])
    one_thread = anyio.CapacityLimiter(1)  # models are kept in caches that one thread may use at a time

    def run(name: str, arguments: bytes) -> Mapping[str, Any]:
        work, takes = TOOLS[name]
        return work(jobs, check_request(parse_json(arguments), takes, jobs))

    async def list_tools(context: Any, parameters: Any) -> types.ListToolsResult:
        return listed

    async def call_tool(context: Any, parameters: Any) -> types.CallToolResult:
        try:
            if parameters.name not in offered:
                raise InvalidInput(Fault.unknown("unknown tool", "name", parameters.name, offered))
            # with NaN and Infinity by these names, which are no JSON; orjson would write null, which is unknown
            arguments = json.dumps(parameters.arguments or {}).encode()
            document = await anyio.to_thread.run_sync(run, parameters.name, arguments, limiter=one_thread)
        except InvalidInput as error:
            return _tool_result(f"{error}", is_error=True)
        except Problem as error:
            return _tool_result(f"{TITLES[error.kind][1]} {error.detail}".strip(), is_error=True)
        text = orjson.dumps(_without_long_fields(document))
        return _tool_result(text.decode(), structured_content=orjson.loads(text))

    description: dict[str, Any] = {
        "version": tripwatt.__version__,
        "instructions": WORDS["assistants"]["instructions"],
    }
    return Server("tripwatt", **description, on_list_tools=list_tools, on_call_tool=call_tool)


def serve(server: Server[Any]) -> None:
    """Serve an assistant over standard input and output until the input ends.

    Examples
    --------
    >>> serve(server)  # doctest: +SKIP
    """

    async def run() -> None:
        async with stdio_server() as (reads, writes):
            await server.run(reads, writes, server.create_initialization_options())

    anyio.run(run)


def _describe_tool(name: str, remote: bool) -> types.Tool:
    """Return the description of a tool for an assistant, with its schema."""
    hints = types.ToolAnnotations(
        read_only_hint=name not in CHANGING, destructive_hint=False, open_world_hint=remote
    )
    title, description = WORDS["tools"][name]
    schema = _without_form(TOOLS[name][1].model_json_schema())
    return types.Tool(name=name, title=title, description=description, input_schema=schema, annotations=hints)


def _without_form(value: Any) -> Any:
    """Return a schema without titles, without null, and without what only a form needs."""
    if isinstance(value, list):
        return [_without_form(inner) for inner in value]
    if not isinstance(value, Mapping):
        return value
    parts = [
        (n, v) for n, v in without_null(dict(value)).items() if not n.startswith(NOT_ASKED) and v is not None
    ]
    return {n: _without_form(v) for n, v in parts if n != "title" or isinstance(v, Mapping)}


def _without_long_fields(value: Any) -> Any:
    """Return a document without the fields of `LEFT_OUT`, with four digits of its numbers."""
    if isinstance(value, Mapping):
        return {name: _without_long_fields(inner) for name, inner in value.items() if name not in LEFT_OUT}
    if isinstance(value, list):
        return [_without_long_fields(inner) for inner in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def _tool_result(text: str, **more: Any) -> types.CallToolResult:
    return types.CallToolResult(content=[types.TextContent(text=text)], **more)
