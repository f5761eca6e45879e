"""Tools for assistants over the Model Context Protocol: jobs of the service with its schemas, without HTTP."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, Literal, NamedTuple

import anyio
import orjson
from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server
from mcp_types import CallToolResult, ListToolsResult, TextContent, ToolAnnotations
from mcp_types import Tool as ToolDocument
from pydantic import BaseModel, Field, TypeAdapter
from pydantic.json_schema import models_json_schema

import tripwatt
from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.document import ForecastResponse
from tripwatt.service.advice_schemas import AdviceResponse
from tripwatt.service.car_schemas import CarResponse, CarsResponse, NewCarRequest
from tripwatt.service.jobs import Jobs
from tripwatt.service.journey_schemas import (
    DistanceNeed,
    JourneyAdviceRequest,
    NeedQuery,
    PlanRequest,
    PlanResponse,
    RangeQuery,
    RangeResponse,
)
from tripwatt.service.problems import TITLES, Problem
from tripwatt.service.schemas import (
    AdviceRequest,
    ForecastRequest,
    Link,
    StrictModel,
    VehiclesResponse,
    check_request,
    parse_json,
)

LEFT_OUT: Final = ("series", "samples", "line", "course", "links", "learning")
"""Fields of answers that an assistant does not get: thousands of numbers for figures and maps, and the state of a job."""

IN_OPENAPI: Final = "#/components/schemas/"
"""Where the OpenAPI document has its schemas."""

INSTRUCTIONS: Final = (
    "Forecasts for electric cars. Energies are in Wh; charges and probabilities are fractions from 0 to 1. Give intervals and "
    "probabilities with every figure, and what the flags say was assumed. Where a description has /v1/vehicles or /v1/cars, the tool "
    "of that name lists them."
)


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


class NoRequest(StrictModel):
    """A request without fields."""


class Tool(NamedTuple):
    """A tool: what it runs, what it takes and gives."""

    run: Callable[[Jobs, bytes], dict[str, Any]]
    takes: type[BaseModel]
    gives: type
    about: str
    changes: bool = False


def _diary(jobs: Jobs, body: bytes) -> dict[str, Any]:
    asked = check_request(parse_json(body), DiaryRequest)
    shown = jobs.cars.show(asked.car)
    return shown | {"diary": shown["diary"][: asked.trips]}


def _vehicles(jobs: Jobs, body: bytes) -> dict[str, Any]:
    return jobs.vehicles(check_request(parse_json(body), VehiclesRequest).search)


def _cars(jobs: Jobs, body: bytes) -> dict[str, Any]:
    check_request(parse_json(body), NoRequest)
    return jobs.cars.list()


TOOLS: Final[Mapping[str, Tool]] = {
    "plan": Tool(
        Jobs.plan,
        PlanRequest,
        PlanResponse,
        "Plan a journey from place to place: whether it arrives and with what charge, stops to charge, other roads. Needs a map.",
    ),
    "need": Tool(
        Jobs.distance,
        NeedQuery,
        DistanceNeed,
        "What a distance needs, or a usual trip of a car: energy, the charge to leave with, and when to charge and preheat. Needs no map.",
    ),
    "range": Tool(
        Jobs.range, RangeQuery, RangeResponse, "How far a charge carries, by kind of road. Needs no map."
    ),
    "advise": Tool(
        Jobs.advice,
        AdviceRequest,
        AdviceResponse,
        "What to do about a trip that is given by its links or samples: the least that makes it arrive, and what each action saves.",
    ),
    "advise_journey": Tool(
        Jobs.journey_advice,
        JourneyAdviceRequest,
        AdviceResponse,
        "What to do about a journey from place to place: the least that makes it arrive, and what each action saves. Needs a map.",
    ),
    "forecast": Tool(
        Jobs.forecast,
        ForecastRequest,
        ForecastResponse,
        "Energy and charge at arrival of a trip that is given by its links or samples, with their intervals.",
    ),
    "diary": Tool(
        _diary,
        DiaryRequest,
        CarResponse,
        "What a car learned from its trips, how good its forecasts were, and its last trips.",
    ),
    "cars": Tool(_cars, NoRequest, CarsResponse, "The cars that learn from their trips."),
    "vehicles": Tool(_vehicles, VehiclesRequest, VehiclesResponse, "Cars of the library, by words."),
    "new_car": Tool(
        Jobs.new_car, NewCarRequest, CarResponse, "Make a car that learns from its trips.", changes=True
    ),
}
"""Tools by name."""


def make_server(jobs: Jobs, *, changes: bool = False, remote: bool = False) -> Server[Any]:
    """The server of the tools.

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
        It runs one tool at a time.

    Examples
    --------
    >>> from tripwatt.service.settings import Limits
    >>> make_server(Jobs.from_folders({}, Limits())).name
    'tripwatt'
    """
    offered = {name: tool for name, tool in TOOLS.items() if changes or not tool.changes}
    listed = ListToolsResult(tools=[_document(name, tool, remote) for name, tool in offered.items()])
    one = anyio.CapacityLimiter(1)  # models are kept in caches that one thread may use at a time

    async def list_tools(context: Any, parameters: Any) -> ListToolsResult:
        return listed

    async def call_tool(context: Any, parameters: Any) -> CallToolResult:
        body = orjson.dumps(parameters.arguments or {})
        try:
            if parameters.name not in offered:
                raise InvalidInput(Fault.unknown("unknown tool", "name", parameters.name, offered))
            found = await anyio.to_thread.run_sync(offered[parameters.name].run, jobs, body, limiter=one)
        except (InvalidInput, Problem) as error:
            return CallToolResult(content=[TextContent(text=_in_words(error))], is_error=True)
        text = orjson.dumps(_short(found))
        return CallToolResult(
            content=[TextContent(text=text.decode())], structured_content=orjson.loads(text)
        )

    return Server(
        "tripwatt",
        version=tripwatt.__version__,
        instructions=INSTRUCTIONS,
        on_list_tools=list_tools,
        on_call_tool=call_tool,
    )


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


def _document(name: str, tool: Tool, remote: bool) -> ToolDocument:
    """A tool as an assistant sees it."""
    wanted: list[tuple[type[BaseModel], Literal["validation"]]] = [(tool.takes, "validation")]
    if "links" in tool.takes.model_fields:
        wanted.append((Link, "validation"))  # which the schema of links names as the OpenAPI document has it
    schemas = orjson.dumps(models_json_schema(wanted, ref_template=f"{IN_OPENAPI}{{model}}")[1]["$defs"])
    named = orjson.loads(schemas.replace(IN_OPENAPI.encode(), b"#/$defs/"))
    takes = {**named.pop(tool.takes.__name__), "$defs": named}
    return ToolDocument(
        name=name,
        description=tool.about,
        input_schema=takes,
        output_schema=_short(TypeAdapter(tool.gives).json_schema(mode="serialization")),
        annotations=ToolAnnotations(
            read_only_hint=not tool.changes, destructive_hint=False, open_world_hint=remote
        ),
    )


def _short(value: Any) -> Any:
    """A document, or its schema, without the fields that are left out."""
    if isinstance(value, Mapping):
        return {name: _short(inner) for name, inner in value.items() if name not in LEFT_OUT}
    if isinstance(value, list):
        return [_short(inner) for inner in value if inner not in LEFT_OUT]
    return value


def _in_words(error: InvalidInput | Problem) -> str:
    if isinstance(error, InvalidInput):
        return f"{error}"
    return "\n".join(filter(None, [TITLES[error.kind][1], error.detail, *map(str, error.faults)]))
