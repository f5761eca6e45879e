"""Tools, resources and prompts for assistants over the Model Context Protocol: jobs of the service with its schemas, without HTTP."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final

import anyio
import orjson
from mcp.server.mcpserver import MCPServer
from mcp.server.mcpserver.exceptions import ResourceNotFoundError, ToolError
from mcp.server.mcpserver.prompts import Prompt
from mcp_types import CallToolResult, TextContent, Tool, ToolAnnotations
from pydantic import BaseModel, Field

from tripwatt import __version__
from tripwatt.errors import Fault, InvalidInput
from tripwatt.server.http import car_schemas, fleets, journey_schemas, schemas
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.openapi import JSON, without_null
from tripwatt.server.http.problems import TITLES, WORDS, Problem, problem_of
from tripwatt.server.http.schemas import StrictModel

LEFT_OUT: Final = ("series", "samples", "line", "course", "links", "learning", "emhass", "evcc")
"""Fields of answers that an assistant does not get: thousands of numbers for figures and maps, the state of a job, and what other programs read."""

EXACT: Final = ("latitude_deg", "longitude_deg", "coordinates")
"""Fields of answers that are not rounded: four digits of a degree are a kilometre or more."""

NOT_ASKED: Final = ("x-", "samples", "elevation", "covariates", "title", "departure")
"""Beginnings of the names, in lower case, of what the schema of a request leaves out: parts of a form, names for people, what has thousands of
numbers, and the second form of a departure."""


WORD: Final = re.compile(r"[a-z]\w*")
"""Pattern of what may be the name of a field in the text of a fault."""


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


TOOLS: Final[Mapping[str, tuple[Callable[[Jobs, Any], Mapping[str, Any]], type[BaseModel], str]]] = {
    "need": (Jobs.distance, journey_schemas.NeedQuery, ""),
    "range": (Jobs.range, journey_schemas.RangeQuery, ""),
    "plan": (Jobs.plan, journey_schemas.PlanRequest, "map"),
    "reach": (Jobs.reach, journey_schemas.ReachRequest, "map"),
    "advise": (Jobs.advice, schemas.AdviceRequest, ""),
    "advise_journey": (Jobs.journey_advice, journey_schemas.JourneyAdviceRequest, "map"),
    "forecast": (Jobs.forecast, schemas.ForecastRequest, ""),
    "fleet": (Jobs.night, fleets.NightRequest, "fleet"),
    "live": (lambda jobs, asked: jobs.cars.car(asked.car).document(time.time()), LiveRequest, "cars"),
    "diary": (lambda jobs, asked: jobs.cars.show(asked.car, asked.trips), DiaryRequest, "cars"),
    "cars": (lambda jobs, _: jobs.cars.list(), StrictModel, "cars"),
    "vehicles": (lambda jobs, asked: jobs.vehicles(asked.search), VehiclesRequest, ""),
    "new_car": (Jobs.new_car, car_schemas.NewCarRequest, "cars changes"),
}
"""Tools by name: the function that each runs, the schema of its request, and what it needs to be offered."""


class Refused(InvalidInput, ToolError, ResourceNotFoundError):
    """The faults of a call, in the form in which the library of the protocol returns them to the assistant."""


class Assistant(MCPServer[Any]):
    """The server of an assistant: tools, cars and their diaries as resources, and prompts.

    Parameters
    ----------
    jobs : Jobs
        Models, map and cars.
    changes : bool
        Whether tools that change something are offered, too.
    remote : bool
        Whether tools ask other servers: for roads, places or the weather.

    Examples
    --------
    >>> from tripwatt.server.http.settings import Limits
    >>> Assistant(Jobs.from_folders({}, Limits())).name
    'tripwatt'
    """

    def __init__(self, jobs: Jobs, *, changes: bool = False, remote: bool = False) -> None:
        super().__init__(
            "tripwatt", version=__version__, instructions=WORDS["instructions"], log_level="WARNING"
        )
        has = {"map": jobs.journeys.atlas, "cars": jobs.cars.folder, "fleet": jobs.fleets, "changes": changes}
        offered = [name for name, (_, _, needs) in TOOLS.items() if all(has[n] for n in needs.split())]
        self._tools = {tool.name: tool for tool in _describe_tools(offered, remote)}
        # models are kept in caches that one thread may use at a time
        self._jobs, self._one_thread = jobs, anyio.CapacityLimiter(1)
        if "cars" in offered:
            self.resource("tripwatt://cars", mime_type=JSON)(self.cars)
            self.resource("tripwatt://cars/{car}/diary", mime_type=JSON)(self.diary)
        for name, words in WORDS["prompts"].items():
            make = partial(words["text"].format, **{row["name"]: "not given" for row in words["arguments"]})
            self.add_prompt(Prompt(name=name, fn=make, context_kwarg=None, **words))

    async def list_tools(self) -> list[Tool]:
        """Return the descriptions of the tools."""
        return [*self._tools.values()]

    async def call_tool(self, name: str, arguments: dict[str, Any], context: Any = None) -> CallToolResult:
        """Run a tool.

        Raises
        ------
        Refused
            With all faults of the call.
        """
        if name not in self._tools:
            raise Refused(Fault.unknown("unknown tool", "name", name, self._tools))
        text = await self._answer(name, arguments)
        return CallToolResult(content=[TextContent(text=text)], structured_content=orjson.loads(text))

    async def cars(self) -> str:
        """Return the cars that learn from their trips."""
        return await self._answer("cars", {})

    async def diary(self, car: str) -> str:
        """Return what a car learned from its trips, how good its forecasts were, and its last trips."""
        return await self._answer("diary", {"car": car, "trips": 50})

    async def _answer(self, name: str, given: Mapping[str, Any]) -> str:
        """Return the answer of a tool as JSON text."""
        document = await anyio.to_thread.run_sync(_run, self._jobs, name, given, limiter=self._one_thread)
        return orjson.dumps(_shortened(document)).decode()


def _run(jobs: Jobs, name: str, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Run a tool. The faults are also those that it has without the wrong fields, unless it changes something."""
    work, takes, needs = TOOLS[name]
    try:
        # with NaN and Infinity by these names, which are no JSON; orjson would write null, which is unknown
        return work(jobs, schemas.check_request(schemas.parse_json(json.dumps(given).encode()), takes, jobs))
    except (InvalidInput, Problem) as error:
        problem = problem_of(error)
    faults = problem.faults or (Fault(TITLES[problem.kind][1], problem.detail),)
    named = {*WORD.findall(" ".join(fault.where for fault in faults))}
    sound = {field: value for field, value in given.items() if field not in named}
    if sound != given and "changes" not in needs:
        try:
            _run(jobs, name, sound)
        except InvalidInput as error:
            faults += tuple(
                f for f in error.faults if named.isdisjoint(WORD.findall(f"{f.where} {f.allowed}"))
            )
    raise Refused(faults)


def _describe_tools(names: Sequence[str], remote: bool) -> Iterator[Tool]:
    """Yield tools with their descriptions and schemas; the first tool that has a part of a schema has it in full."""
    first: dict[str, str] = {}
    for name in names:
        _, takes, needs = TOOLS[name]
        title, text = WORDS["tools"][name]
        reads: dict[str, Any] = {"read_only_hint": "changes" not in needs, "destructive_hint": False}
        hints = ToolAnnotations(**reads, open_world_hint=remote)
        schema = json.loads(json.dumps(takes.model_json_schema()), object_pairs_hook=_without_form)
        for part in schema.get("$defs", ()):
            if first.setdefault(part, name) != name:
                schema["$defs"][part] = {"description": f"as in the tool `{first[part]}`"}
        yield Tool(name=name, title=title, description=text, input_schema=schema, annotations=hints)


def _without_form(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a schema without null, and without what only a form needs."""
    parts = without_null(dict(pairs)).items()
    return {name: v for name, v in parts if v is not None and not name.lower().startswith(NOT_ASKED)}


def _shortened(value: Any, name: str = "") -> Any:
    """Return a document without the fields of `LEFT_OUT`, with four digits of its numbers."""
    if isinstance(value, Mapping):
        return {name: _shortened(inner, name) for name, inner in value.items() if name not in LEFT_OUT}
    if isinstance(value, list):
        return [_shortened(inner, name) for inner in value]
    return float(f"{value:.4g}") if isinstance(value, float) and name not in EXACT else value
