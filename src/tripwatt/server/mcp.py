"""Tools for assistants over the Model Context Protocol: jobs of the service with its schemas, without HTTP."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import anyio
import mcp_types as types
import orjson
from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server
from pydantic import BaseModel, Field, TypeAdapter

import tripwatt
from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.document import ForecastResponse
from tripwatt.server.http import car_schemas, schemas
from tripwatt.server.http import journey_schemas as journey
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.openapi import Schemas
from tripwatt.server.http.problems import TITLES, WORDS, Problem
from tripwatt.server.http.schemas import StrictModel, check_request, parse_json

LEFT_OUT: Final = ("series", "samples", "line", "course", "links", "learning")
"""Fields of answers that an assistant does not get: thousands of numbers for figures and maps, and the state of a job."""


class DiaryRequest(StrictModel):
    """A car that learns from its trips."""

    car: str = Field(max_length=100)
    """its name, one of the tool `cars`"""
    trips: int = Field(10, ge=1, le=200)
    """entries of the diary, the newest first"""


class VehiclesRequest(StrictModel):
    """Words to look for among the cars of the library."""

    search: str | None = Field(None, max_length=100)
    """words of maker, model and year; default: all cars"""


def _show_diary(jobs: Jobs, request: DiaryRequest) -> dict[str, Any]:
    document = jobs.cars.show(request.car)
    return document | {"diary": document["diary"][: request.trips]}


class Tool(NamedTuple):
    """A tool: the function that it runs, and the schemas of its request and its answer."""

    run: Callable[[Jobs, Any], dict[str, Any]]
    takes: type[BaseModel]
    gives: type


TOOLS: Final[Mapping[str, Tool]] = {
    "plan": Tool(Jobs.plan, journey.PlanRequest, journey.PlanResponse),
    "need": Tool(Jobs.distance, journey.NeedQuery, journey.NeedResponse),
    "range": Tool(Jobs.range, journey.RangeQuery, journey.RangeResponse),
    "advise": Tool(Jobs.advice, schemas.AdviceRequest, journey.AdviceResponse),
    "advise_journey": Tool(Jobs.journey_advice, journey.JourneyAdviceRequest, journey.AdviceResponse),
    "forecast": Tool(Jobs.forecast, schemas.ForecastRequest, ForecastResponse),
    "diary": Tool(_show_diary, DiaryRequest, car_schemas.CarResponse),
    "cars": Tool(lambda jobs, _: jobs.cars.list(), StrictModel, car_schemas.CarsResponse),
    "vehicles": Tool(
        lambda jobs, asked: jobs.vehicles(asked.search), VehiclesRequest, schemas.VehiclesResponse
    ),
    "new_car": Tool(Jobs.new_car, car_schemas.NewCarRequest, car_schemas.CarResponse),
}
"""Tools by name."""

CHANGING: Final = ("new_car",)
"""Tools that change something."""

OF_MAP: Final = ("plan", "advise_journey")
OF_CARS: Final = ("diary", "cars", "new_car")
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

    def run(name: str, arguments: bytes) -> dict[str, Any]:
        tool = TOOLS[name]
        return tool.run(jobs, check_request(parse_json(arguments), tool.takes, jobs))

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
    """Return the description of a tool for an assistant, with its schemas."""
    tool, reads = TOOLS[name], name not in CHANGING
    hints = types.ToolAnnotations(read_only_hint=reads, destructive_hint=False, open_world_hint=remote)
    return types.Tool(
        name=name,
        description=WORDS["tools"][name],
        input_schema=tool.takes.model_json_schema(),
        output_schema=_without_long_fields(
            TypeAdapter(tool.gives).json_schema(mode="serialization", schema_generator=Schemas)
        ),
        annotations=hints,
    )


def _without_long_fields(value: Any) -> Any:
    """Return a document, or its schema, without the fields of `LEFT_OUT`."""
    if isinstance(value, Mapping):
        return {name: _without_long_fields(inner) for name, inner in value.items() if name not in LEFT_OUT}
    if isinstance(value, list):
        return [_without_long_fields(inner) for inner in value if inner not in LEFT_OUT]
    return value


def _tool_result(text: str, **more: Any) -> types.CallToolResult:
    return types.CallToolResult(content=[types.TextContent(text=text)], **more)
