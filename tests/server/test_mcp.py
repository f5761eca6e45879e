"""The tools for assistants, asked by the client of the package `mcp`: in this process, and as `tripwatt mcp`."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import anyio
import pytest
from tests.roads.journey.made import MADE
from tests.support import ROOT
from tests.support.roads import osrm
from tests.support.router_server import RouterServer, answering, write_map

import tripwatt as tw
from tripwatt.fleet.registry import Registry
from tripwatt.roads.journey import AtlasSettings, open_atlas
from tripwatt.server.http.example_requests import PLANNED_REQUEST
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.settings import Limits
from tripwatt.study.synthetic import synthetic_fleet

pytest.importorskip("mcp", reason="the extra mcp is not installed")
from jsonschema import Draft202012Validator
from mcp import Client, MCPError, StdioServerParameters
from mcp_types import INVALID_PARAMS

from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.journeys import JourneyJobs
from tripwatt.server.http.problems import WORDS
from tripwatt.server.mcp import LEFT_OUT, TOOLS, Assistant

COLD = tw.Departure(soc=0.8, ambient_temperature_degc=-5.0)
PLACES = ["47.0, 9.0", "47.0, 9.1"]
READING = {
    "plan",
    "need",
    "range",
    "reach",
    "advise",
    "advise_journey",
    "forecast",
    "live",
    "diary",
    "cars",
    "vehicles",
}
OF_MAP = {"plan", "reach", "advise_journey"}
CHANGING = {"new_car"}


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
    return Jobs.from_folders({}, Limits(), open_atlas(roads), cars)


@pytest.fixture(scope="module")
def every(jobs: Jobs, fleet: Any, tmp_path_factory: pytest.TempPathFactory) -> Jobs:
    """Jobs for every tool: with a made atlas and the registry of a fleet."""
    registry = Registry(tmp_path_factory.mktemp("fleets") / "vans")
    registry.promote(registry.add(fleet[2]))
    vans = Jobs.from_folders({"vans": registry.folder}, Limits()).fleets
    return replace(jobs, journeys=JourneyJobs(MADE), fleets=vans)


def asked(server: Any, ask: Callable[[Client], Awaitable[Any]]) -> Any:
    async def run() -> Any:
        async with Client(server) as client:
            return await ask(client)

    return anyio.run(run)


def call(jobs: Jobs, name: str, arguments: dict[str, Any], **more: Any) -> Any:
    return asked(Assistant(jobs, **more), lambda client: client.call_tool(name, arguments))


def keys(document: Any) -> set[str]:
    if isinstance(document, dict):
        return {*document} | {name for inner in document.values() for name in keys(inner)}
    return {name for inner in document for name in keys(inner)} if isinstance(document, list) else set()


def test_tools_are_typed_and_change_nothing_unless_it_is_allowed(every: Jobs) -> None:
    def tools(**more: Any) -> dict[str, Any]:
        listed = asked(Assistant(every, **more), lambda client: client.list_tools()).tools
        return {tool.name: tool for tool in listed}

    reading = tools()
    assert set(reading) == READING | {"fleet"}
    assert all(tool.annotations.read_only_hint for tool in reading.values())
    assert not any(tool.annotations.open_world_hint for tool in reading.values())
    assert all(tool.annotations.open_world_hint for tool in tools(remote=True).values())
    writing = tools(changes=True)
    assert {name for name, tool in writing.items() if not tool.annotations.read_only_hint} == CHANGING
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
    parts = [(name, tool) for tool in writing.values() for name in tool.input_schema.get("$defs", ())]
    for part in {name for name, _ in parts}:  # in full once, where the other tools say
        (full,) = [t for name, t in parts if name == part and "properties" in t.input_schema["$defs"][part]]
        others = [t.input_schema["$defs"][part] for name, t in parts if name == part and t is not full]
        assert all(other["description"] == f"as in the tool `{full.name}`" for other in others)


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
    "reach": {"start": "47.0, 9.0", "soc": 0.3, "ambient_temperature_degc": 10.0},
    "fleet": {
        "trips": [
            {"car": "V00000", "departs_at": f"2030-01-12T{k + 2}:30:00+01:00", "distance_km": 10.0 * k}
            for k in (8, 16)
        ]
    },
}


def test_tools_without_a_map_cars_or_a_fleet_are_not_offered(jobs: Jobs, every: Jobs) -> None:
    def offered(some: Jobs) -> set[str]:
        listed = asked(Assistant(some, changes=True), lambda client: client.list_tools()).tools
        return {tool.name for tool in listed}

    bare = replace(jobs, journeys=JourneyJobs(), cars=CarJobs())
    assert offered(every) == set(TOOLS) == offered(jobs) | {"fleet"}
    assert offered(bare) == {"need", "range", "advise", "forecast", "vehicles"}
    assert offered(replace(jobs, cars=CarJobs())) == offered(bare) | OF_MAP
    refused = call(bare, "plan", ARGUMENTS["plan"])
    assert refused.is_error
    assert "unknown tool" in refused.content[0].text
    assert "--map MAP" in Assistant(bare).instructions


@pytest.mark.parametrize("name", TOOLS)
def test_every_tool_answers_in_short(jobs: Jobs, every: Jobs, cars: Path, name: str) -> None:
    before = sorted(cars.rglob("*"))
    served = every if name in ("reach", "fleet") else jobs
    found = call(served, name, ARGUMENTS[name], changes=name in CHANGING)
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


def test_the_reach_and_the_needs_of_a_fleet_are_those_of_the_service(every: Jobs) -> None:
    reach = call(every, "reach", ARGUMENTS["reach"]).structured_content
    assert reach["areas"] == every.run("reach", json.dumps(ARGUMENTS["reach"]).encode())["areas"]  # type: ignore[index]
    first, later = call(every, "fleet", ARGUMENTS["fleet"]).structured_content["needs"]
    night: Any = every.run("night", json.dumps(ARGUMENTS["fleet"]).encode())
    assert later["energy_wh"] == pytest.approx(night["needs"][1]["energy_wh"], rel=1e-3)
    assert 0.0 < first["energy_wh"] < later["energy_wh"] < later["energy_quantile_wh"]


def test_the_cars_and_their_diaries_are_resources(jobs: Jobs) -> None:
    async def ask(client: Client) -> Any:
        listed = [one.uri for one in (await client.list_resources()).resources]
        listed += [one.uri_template for one in (await client.list_resource_templates()).resource_templates]
        read = [await client.read_resource(uri) for uri in ("tripwatt://cars", "tripwatt://cars/leaf/diary")]
        return listed, [json.loads(one.contents[0].text) for one in read]

    listed, (listing, diary) = asked(Assistant(jobs), ask)
    assert listed == ["tripwatt://cars", "tripwatt://cars/{car}/diary"]
    assert listing == call(jobs, "cars", {}).structured_content
    assert diary == call(jobs, "diary", {"car": "leaf"}).structured_content
    assert asked(Assistant(replace(jobs, cars=CarJobs())), ask_for_resources) == []
    for uri, words in (("tripwatt://cars/nobody/diary", "The car does not exist"), ("tripwatt://map", "map")):
        error = asked(Assistant(jobs), partial(refusal, lambda client, uri=uri: client.read_resource(uri)))
        assert (error.code, words in error.message) == (INVALID_PARAMS, True)


async def ask_for_resources(client: Client) -> Any:
    return (await client.list_resources()).resources


async def refusal(ask: Callable[[Client], Awaitable[Any]], client: Client) -> MCPError:
    with pytest.raises(MCPError) as caught:
        await ask(client)
    return caught.value


def test_prompts_name_only_tools_that_exist_and_what_is_given(jobs: Jobs) -> None:
    async def ask(client: Client) -> Any:
        prompts = (await client.list_prompts()).prompts
        for prompt in prompts:
            assert prompt.title
            assert prompt.description
        full = [{one.name: f"<{one.name}>{{x}}" for one in prompt.arguments} for prompt in prompts]
        given = [
            (prompt.name, some) for prompt, all_ in zip(prompts, full, strict=True) for some in (all_, {})
        ]
        return prompts, [(await client.get_prompt(*one)).messages for one in given]

    prompts, messages = asked(Assistant(jobs), ask)
    assert [prompt.name for prompt in prompts] == ["can_i_make_it", "plan_with_charging", "how_is_my_car"]
    for prompt, (message,), (bare,) in zip(prompts, messages[::2], messages[1::2], strict=True):
        assert message.role == "user"
        assert all(f"<{one.name}>{{x}}" in message.content.text for one in prompt.arguments)
        assert bare.content.text.count("not given") == len(prompt.arguments)
        named = set(re.findall(r"`(\w+)`", bare.content.text)) - {"departs_at"}
        assert named
        assert named <= set(TOOLS)


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
    assert jobs.cars.show("leaf", before=newest["trip"])["diary"] == older
    assert jobs.cars.show("leaf", limit=1, before=newest["trip"])["diary"] == older[:1]
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
        ("need", {"soc": 1.8}, ("soc", "distance_km, trip: got neither")),
        ("diary", {"car": "nobody", "trips": 0}, ("trips", "The car does not exist")),
        (
            "plan",
            {"stops": ["47.0, 9.0", "x"], "soc": 2, "car": "leaf", "driver": "D"},
            ("soc", "driver", "larger region"),
        ),
        ("forecast", {"route": {"a": 1}, "soc": 3, "model": "x"}, ("route", "soc", "unknown model")),
    ],
)
def test_all_faults_come_back_in_words(jobs: Jobs, name: str, arguments: dict[str, Any], words: Any) -> None:
    found = call(jobs, name, arguments)
    assert found.is_error
    assert found.structured_content is None
    for word in words:
        assert word in found.content[0].text


def test_each_fault_comes_once_and_a_field_that_is_wrong_is_not_missing_as_well(jobs: Jobs) -> None:
    links = {"links": [{"length_m": -3.0, "speed_m_s": 10.0}], "soc": 1.8}
    for name, arguments, count in (
        ("need", {"distance_km": 9e9, "soc": 1.8}, 2),
        ("plan", {"stops": ["one"], "soc": 2}, 2),
        ("plan", {"soc": 2}, 2),
        ("forecast", links, 2),
        ("forecast", {"route": {"a": 1}}, 1),
    ):
        lines = call(jobs, name, arguments).content[0].text.splitlines()
        assert len(lines) == len(set(lines)) == count, lines


def test_a_name_that_is_taken_is_a_fault_and_makes_no_car(jobs: Jobs, cars: Path) -> None:
    before = sorted(cars.rglob("*"))
    found = call(jobs, "new_car", {"name": "leaf", "car": "nissan_leaf_40"}, changes=True)
    assert "name: got 'leaf'" in found.content[0].text
    assert call(jobs, "new_car", {"name": "zoe2", "car": "nissan_leaf_40", "x": 1}, changes=True).is_error
    assert sorted(cars.rglob("*")) == before


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
        prompt = await client.get_prompt("how_is_my_car", {"car": "leaf"})
        diary = await client.read_resource("tripwatt://cars/leaf/diary")
        return client.server_info, tools, need, plan, prompt, diary

    info, tools, need, plan, prompt, diary = asked(server, talk)
    assert "my car leaf" in prompt.messages[0].content.text
    assert len(json.loads(diary.contents[0].text)["diary"]) == 3
    assert (info.name, info.version) == ("tripwatt", tw.__version__)
    assert {tool.name for tool in tools} == READING
    assert all(tool.annotations.open_world_hint for tool in tools)  # the roads are those of a server
    expected = tw.need(50, "motorway", COLD).energy_wh
    assert need.structured_content["energy_wh"] == pytest.approx(expected, rel=1e-3)
    assert plan.structured_content["roads"][0]["distance_m"] > 1000.0


def test_the_page_for_assistants_works_and_lists_every_tool() -> None:
    page = (ROOT / "docs" / "howto" / "assistants.md").read_text("utf-8")
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == set(TOOLS)
    for word in (*WORDS["prompts"], "tripwatt://cars", "tripwatt://cars/{car}/diary"):
        assert f"`{word}`" in page
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
