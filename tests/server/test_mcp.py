"""The tools for assistants, asked by the client of the package `mcp`: in this process, and as `tripwatt mcp`."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import anyio
import pytest
from tests.support import ROOT
from tests.support.roads import osrm
from tests.support.router_server import RouterServer, answering, write_map

import tripwatt as tw
from tripwatt.roads.journey import AtlasSettings, open_atlas
from tripwatt.server.http.example_requests import PLANNED_REQUEST
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.settings import Limits
from tripwatt.study.synthetic import synthetic_fleet

pytest.importorskip("mcp", reason="the extra mcp is not installed")
from jsonschema import Draft202012Validator
from mcp import Client, StdioServerParameters

from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.journeys import JourneyJobs
from tripwatt.server.mcp import CHANGING, LEFT_OUT, TOOLS, make_server

COLD = tw.Departure(soc=0.8, ambient_temperature_degc=-5.0)
PLACES = ["47.0, 9.0", "47.0, 9.1"]
READING = {
    "plan",
    "need",
    "range",
    "advise",
    "advise_journey",
    "forecast",
    "live",
    "diary",
    "cars",
    "vehicles",
}


@pytest.fixture(scope="module")
def router() -> Iterator[RouterServer]:
    with answering(osrm(annotated=True)) as found:
        yield found


@pytest.fixture(scope="module")
def roads(router: RouterServer, tmp_path_factory: pytest.TempPathFactory) -> str:
    return f"{write_map(tmp_path_factory.mktemp('assistants') / 'map')}@osrm={router.url}"


@pytest.fixture(scope="module")
def cars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("deltalake")
    folder = tmp_path_factory.mktemp("cars")
    own = tw.create_car(folder / "leaf", "nissan_leaf_24")
    own.add(synthetic_fleet(3, vehicle=tw.load_vehicle("nissan_leaf_24")))
    return folder


@pytest.fixture(scope="module")
def jobs(roads: str, cars: Path) -> Jobs:
    atlas = JourneyJobs.from_settings(AtlasSettings(roads))
    return Jobs.from_folders({}, Limits(), atlas, CarJobs(cars))


def asked(server: Any, ask: Callable[[Client], Awaitable[Any]]) -> Any:
    async def run() -> Any:
        async with Client(server) as client:
            return await ask(client)

    return anyio.run(run)


def call(jobs: Jobs, name: str, arguments: dict[str, Any], **more: Any) -> Any:
    return asked(make_server(jobs, **more), lambda client: client.call_tool(name, arguments))


def keys(document: Any) -> set[str]:
    if isinstance(document, dict):
        return {*document} | {name for inner in document.values() for name in keys(inner)}
    return {name for inner in document for name in keys(inner)} if isinstance(document, list) else set()


def test_tools_are_typed_and_change_nothing_unless_it_is_allowed(jobs: Jobs) -> None:
    def tools(**more: Any) -> dict[str, Any]:
        listed = asked(make_server(jobs, **more), lambda client: client.list_tools()).tools
        return {tool.name: tool for tool in listed}

    reading = tools()
    assert set(reading) == READING
    assert all(tool.annotations.read_only_hint for tool in reading.values())
    assert not any(tool.annotations.open_world_hint for tool in reading.values())
    assert all(tool.annotations.open_world_hint for tool in tools(remote=True).values())
    writing = tools(changes=True)
    assert {name for name, tool in writing.items() if not tool.annotations.read_only_hint} == {"new_car"}
    for tool in writing.values():
        schema = tool.input_schema
        Draft202012Validator.check_schema(schema)
        assert schema["type"] == "object"
        assert schema["additionalProperties"] is False
        named = {ref.rpartition("/")[2] for ref in references(schema)}
        assert named <= set(schema.get("$defs", {})), tool.name
        assert tool.title
    assert sum(len(json.dumps(tool.input_schema)) for tool in writing.values()) < 40_000
    soc = reading["range"].input_schema["properties"]["soc"]
    assert (soc["minimum"], soc["maximum"]) == (0.0, 1.0)


def references(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        yield from (schema[name] for name in ("$ref",) if isinstance(schema.get(name), str))
        for inner in schema.values():
            yield from references(inner)
    elif isinstance(schema, list):
        for inner in schema:
            yield from references(inner)


ARGUMENTS: dict[str, dict[str, Any]] = {
    "plan": {"stops": PLACES, **COLD.to_dict()},
    "need": {"distance_km": 50.0, "kind": "motorway", **COLD.to_dict()},
    "range": COLD.to_dict(),
    "advise": PLANNED_REQUEST,
    "advise_journey": {"stops": PLACES, **COLD.to_dict()},
    "forecast": PLANNED_REQUEST,
    "live": {"car": "leaf"},
    "diary": {"car": "leaf", "trips": 2},
    "cars": {},
    "vehicles": {"search": "id.3"},
    "new_car": {"name": "zoe", "car": "nissan_leaf_40"},
}


def test_tools_without_a_map_or_cars_are_not_offered(jobs: Jobs) -> None:
    def offered(some: Jobs) -> set[str]:
        listed = asked(make_server(some, changes=True), lambda client: client.list_tools()).tools
        return {tool.name for tool in listed}

    bare = replace(jobs, journeys=JourneyJobs(), cars=CarJobs())
    assert offered(jobs) == set(TOOLS)
    assert offered(bare) == {"need", "range", "advise", "forecast", "vehicles"}
    assert offered(replace(jobs, cars=CarJobs())) == offered(bare) | {"plan", "advise_journey"}
    refused = call(bare, "plan", ARGUMENTS["plan"])
    assert refused.is_error
    assert "unknown tool" in refused.content[0].text
    assert "--map MAP" in make_server(bare).instructions


@pytest.mark.parametrize("name", TOOLS)
def test_every_tool_answers_in_short(jobs: Jobs, cars: Path, name: str) -> None:
    before = sorted(cars.rglob("*"))
    found = call(jobs, name, ARGUMENTS[name], changes=name in CHANGING)
    assert not found.is_error, found.content
    assert found.structured_content
    assert not keys(found.structured_content) & set(LEFT_OUT)
    assert len(found.content[0].text) < 30_000
    assert (sorted(cars.rglob("*")) != before) == (name in CHANGING)


def test_answers_are_those_of_python(jobs: Jobs, roads: str) -> None:
    need = call(jobs, "need", ARGUMENTS["need"]).structured_content
    assert need["energy_wh"] == pytest.approx(tw.need(50, "motorway", COLD).energy_wh, rel=1e-3)
    assert call(jobs, "range", COLD.to_dict()).structured_content["range_m"] == pytest.approx(
        tw.range_km(None, "mixed", COLD).range_m, rel=1e-3
    )
    plan = tw.read_route(PLANNED_REQUEST["links"])
    forecast = tw.load_model().forecast(
        plan, tw.Departure(soc=0.8, ambient_temperature_degc=-5.0, cabin_setpoint_degc=21.0)
    )
    found = call(jobs, "forecast", PLANNED_REQUEST).structured_content
    assert found["energy_wh"] == pytest.approx(forecast.energy_wh, rel=1e-3)
    journey = tw.plan_journey(PLACES, COLD, atlas=open_atlas(AtlasSettings(roads)))
    planned = call(jobs, "plan", ARGUMENTS["plan"]).structured_content
    assert planned["p_arrive"] == pytest.approx(journey.verdict.p_reserve, rel=1e-3)


def test_the_newest_trips_of_a_diary_come_first(jobs: Jobs) -> None:
    trips = call(jobs, "diary", {"car": "leaf", "trips": 2}).structured_content["diary"]
    every = call(jobs, "diary", {"car": "leaf"}).structured_content["diary"]
    assert len(every) == 3
    assert trips == every[:2]
    assert [entry["trips_learned"] for entry in trips] == sorted(
        (entry["trips_learned"] for entry in trips), reverse=True
    )


def test_a_diary_is_read_in_parts(jobs: Jobs) -> None:
    newest, *older = jobs.cars.show("leaf")["diary"]
    assert len(older) == 2
    assert jobs.cars.show("leaf", before=newest["trip_id"])["diary"] == older
    assert jobs.cars.show("leaf", limit=1, before=newest["trip_id"])["diary"] == older[:1]
    assert (
        jobs.cars.show("leaf", limit=0)["diary"]
        == jobs.cars.show("leaf", before="no such trip")["diary"]
        == []
    )


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("range", {"soc": 1.8, "knd": "city"}, ("soc: got 1.8", "did you mean 'kind'?")),
        ("plan", {"stops": ["one"], "soc": -1}, ("stops", "soc")),
        ("diary", {"car": "nobody"}, ("The car does not exist",)),
        ("diary", {"car": "../leaf"}, ("The car does not exist",)),
        ("vehicles", {"serch": "leaf"}, ("did you mean 'search'?",)),
        ("cars", {"folder": "/"}, ("folder",)),
        ("forecast", {"links": [], "car": "../car.toml"}, ("links", "../car.toml")),
        ("new_car", {"name": "zoe"}, ("unknown tool", "'new_car'")),
    ],
)
def test_all_faults_come_back_in_words(jobs: Jobs, name: str, arguments: dict[str, Any], words: Any) -> None:
    found = call(jobs, name, arguments)
    assert found.is_error
    assert found.structured_content is None
    for word in words:
        assert word in found.content[0].text


def test_a_number_that_is_none_is_not_taken_as_unknown() -> None:
    """In lines as an assistant may send them: its library reads `NaN` and `1e400`, which are no JSON numbers of ours."""
    sample = '{"samples": {"time_s": [0, 1, 2], "speed_m_s": [1, 2, 3], "elevation_m": [1, %s, 1]}}'
    forms = [
        ("range", '{"soc": 0.8, "ambient_temperature_degc": %s}'),
        ("need", '{"distance_km": 50.0, "soc": %s}'),
        ("forecast", '{"links": [{"length_m": 900, "speed_m_s": 14, "grade": %s}]}'),
        ("forecast", sample),
    ]
    cases = [(name, form % value) for value in ("NaN", "Infinity", "-1e400", "null") for name, form in forms]
    about = (
        '{"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "a", "version": "1"}}'
    )
    lines = [f'{{"jsonrpc": "2.0", "id": "begin", "method": "initialize", "params": {about}}}']
    lines.append('{"jsonrpc": "2.0", "method": "notifications/initialized"}')
    lines += [
        f'{{"jsonrpc": "2.0", "id": {k}, "method": "tools/call", "params": {{"name": "{name}", "arguments": {arguments}}}}}'
        for k, (name, arguments) in enumerate(cases)
    ]
    command = [sys.executable, "-m", "tripwatt", "mcp"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    assert process.stdout is not None
    answers = {}
    with process, process.stdin as sent:
        for line in lines:
            sent.write(f"{line}\n")
            sent.flush()
        while len(answers) < len(cases) + 1:
            answer = json.loads(process.stdout.readline())
            answers[answer["id"]] = answer
    for k, (_, arguments) in enumerate(cases):
        result = answers[k]["result"]
        assert result["isError"] == ("null" not in arguments), arguments
        assert ("not JSON" in result["content"][0]["text"]) == result["isError"]


def test_the_command_serves_an_assistant(roads: str, cars: Path) -> None:
    arguments = ["-m", "tripwatt", "mcp", "--map", roads, "--cars", f"{cars}"]
    server = StdioServerParameters(command=sys.executable, args=arguments, env={**os.environ})

    async def talk(client: Client) -> Any:
        tools = (await client.list_tools()).tools
        need = await client.call_tool("need", ARGUMENTS["need"])
        plan = await client.call_tool("plan", ARGUMENTS["plan"])
        return client.server_info, tools, need, plan

    info, tools, need, plan = asked(server, talk)
    assert (info.name, info.version) == ("tripwatt", tw.__version__)
    assert {tool.name for tool in tools} == READING
    assert all(tool.annotations.open_world_hint for tool in tools)  # the roads are those of a server
    expected = tw.need(50, "motorway", COLD).energy_wh
    assert need.structured_content["energy_wh"] == pytest.approx(expected, rel=1e-3)
    assert plan.structured_content["roads"][0]["distance_m"] > 1000.0


def test_the_page_for_assistants_works_and_lists_every_tool() -> None:
    page = (ROOT / "docs" / "howto" / "assistants.md").read_text("utf-8")
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == set(TOOLS)
    (shown,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    here = '(command=sys.executable, env={**os.environ}, args=["-m", "tripwatt", "mcp"])'
    names: dict[str, Any] = {"sys": sys, "os": os}
    exec(shown.replace('(command="tripwatt", args=["mcp"])', here), names)
    expected = tw.need(50, "mixed", tw.Departure(ambient_temperature_degc=-5.0))
    assert names["need"]["soc_needed"] == pytest.approx(expected.soc_needed, rel=1e-3)


def test_the_command_names_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    from tripwatt.command.serve import mcp

    monkeypatch.setattr("tripwatt.errors.find_spec", lambda name: None if name == "mcp" else object())
    with pytest.raises(tw.InvalidInput, match=r"missing package: tripwatt mcp: got no mcp.*\.\[mcp\]"):
        mcp()
