"""What all operations share: parameters, chosen fields, entity tags, keys of repeated requests, and the document of it all."""

from __future__ import annotations

import asyncio
import copy
import inspect
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import orjson
import pytest
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.requests import Request
from tests.support import ROOT
from tests.support.service_process import Service

import tripwatt as tw
from tripwatt.command.forecast import Drive, advise, forecast, need, range_
from tripwatt.command.journey import reach
from tripwatt.errors import InvalidInput
from tripwatt.fleet.nights import needs_by_hour
from tripwatt.forecasting.document import ForecastResponse
from tripwatt.roads.journey import Atlas, JourneyOptions, find_reach
from tripwatt.roads.routers import open_server
from tripwatt.server.http.app import openapi_document
from tripwatt.server.http.example_requests import EXAMPLES
from tripwatt.server.http.fleets import NightRequest, PlannedTripRequest
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.openapi import refuse_unknown_parameters
from tripwatt.server.http.problems import TITLES
from tripwatt.server.http.schemas import check_request, departure_of
from tripwatt.server.http.settings import Limits
from tripwatt.server.http.worker import chosen_fields, run_job
from tripwatt.server.mcp import TOOLS
from tripwatt.trips import ASKED, Departure


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    return openapi_document()


def operations(document: dict[str, Any]) -> list[dict[str, Any]]:
    return [operation for path in document["paths"].values() for operation in path.values()]


def test_operations_have_readable_names_of_their_own(document: dict[str, Any]) -> None:
    names = [operation["operationId"] for operation in operations(document)]
    assert len(set(names)) == len(names) >= 36
    assert {"forecast", "update", "batch", "plan", "get_need", "get_live"} <= set(names)
    assert all(re.fullmatch("[a-z]+(_[a-z]+)*", name) for name in names)


def test_no_schema_has_what_generators_stumble_over(document: dict[str, Any]) -> None:
    """A default makes a field required in some clients; alternatives beside properties drop the operation in others."""
    text = orjson.dumps(document["components"]["schemas"])
    assert b'"default"' not in text
    for schema in document["components"]["schemas"].values():
        assert not ({"oneOf", "anyOf", "allOf"} & schema.keys() and "properties" in schema)


ROADS = ("AdviceRequest", "ForecastRequest", "LivePlanRequest", "PlannedTripRequest", "UpdateRequest")
UNBOUNDED = {
    *(f"{name}.{field}" for name in ROADS for field in ("links", "samples", "route")),
    *("UpdateRequest.observed", "Elevation.position_m", "Elevation.elevation_m", "TelemetryRequest.tlm"),
}
"""Fields that are bounded as whole tables by `Limits`, and the message of a car, which has at most 64 kB."""


def is_bounded(schema: dict[str, Any]) -> bool:
    """Whether a number has a lower and an upper bound, and a text and a list a largest length."""
    if {"enum", "const", "$ref", "format", "pattern"} & schema.keys():
        return True
    if {"anyOf", "oneOf"} & schema.keys():
        return all(map(is_bounded, schema.get("anyOf") or schema["oneOf"]))
    low, high = ({f"{end}imum", f"exclusive{end.title()}imum"} & schema.keys() for end in ("min", "max"))
    bounds = {
        "string": "maxLength" in schema,
        "array": "maxItems" in schema,
        "object": "maxProperties" in schema,
    }
    numbers = dict.fromkeys(("number", "integer"), bool(low and high))
    return {**bounds, **numbers, "boolean": True, "null": True}[schema["type"]]


def test_every_field_of_a_request_has_bounds(document: dict[str, Any]) -> None:
    schemas, checked, waiting = document["components"]["schemas"], set[str](), [m.__name__ for m in EXAMPLES]
    unbounded = set[str]()
    while waiting:
        name = waiting.pop()
        if name not in checked:
            checked.add(name)
            waiting += re.findall(r"#/components/schemas/(\w+)", orjson.dumps(schemas[name]).decode())
            fields = schemas[name].get("properties", {}).items()
            unbounded |= {f"{name}.{field}" for field, schema in fields if not is_bounded(schema)}
    assert unbounded == UNBOUNDED
    assert {"PlannedTripRequest", "VehicleFigures", "PlaceRequest", "ColumnChoice"} <= checked
    parameters = [p for o in operations(document) for p in o.get("parameters", ()) if p["in"] != "header"]
    # the head of a request bounds the name of an example and the token of a car, which is compared as a digest
    assert {p["name"] for p in parameters if not is_bounded(p["schema"])} == {"token", "trip"}


def test_problems_are_told_apart_and_nothing_is_deprecated(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    assert schemas["ProblemDocument"]["properties"]["type"]["enum"] == [
        f"/problems/{kind}" for kind in TITLES
    ]
    assert b'"deprecated"' not in orjson.dumps(document)
    marked = {o["operationId"] for o in operations(document) if o.get("x-internal")}
    assert marked == {"get_view", "get_tile", "get_examples", "get_example"}


LINKS = [{"length_m": 900.0, "speed_m_s": 9.0}]
WRONG_ROADS = [  # job, its body -> places of its faults
    (
        "forecast",
        {"samples": {"time_s": [0, 2, 1], "speed_m_s": [0, None, 500]}},
        {"/samples/speed_m_s/1", "/samples/speed_m_s/2", "/samples/time_s/2"},
    ),
    ("forecast", {"samples": {"time_s": [0, 1, 90], "speed_m_s": [0, 1, 1], "bms_soc": [2, 1, 1]}}, {"/samples/bms_soc/0"}),
    ("forecast", {"samples": {"time_s": [0, 1, 9000], "speed_m_s": [0, 1, 1]}}, {"/samples/time_s/2"}),
    ("forecast", {"samples": {"time_s": [0, "1", 2], "speed_m_s": [0, 1, 1], "soc": []}}, {"/samples/time_s/1", "/samples/soc"}),
    ("forecast", {"samples": {"time_s": [0, 1, 2]}}, {"/samples"}),
    ("forecast", {"links": [*LINKS, {"length_m": 9.0, "speed_m_s": -1}, {"length_m": 5}]}, {"/links/1/speed_m_s", "/links/2"}),
    ("forecast", {"links": LINKS, "elevation": {"position_m": [5.0, 1.0], "elevation_m": [1.0, 2.0]}}, {"/elevation/position_m"}),
    ("forecast", {"links": LINKS, "km/h~": 5}, {"/km~1h~0"}),
    ("forecast", {"links": LINKS, "x" * 400: 5}, {None}),
    ("forecast", {"links": LINKS, "car": "zzzz"}, {"/car"}),
    ("forecast", {"links": LINKS, "departure": {"soc": 0.5}, "soc": 0.4}, {"/departure/soc"}),
    ("forecast", {"route": "time_s,speed_m_s\n0,0\n1,500\n2,5"}, {"/route"}),
    ("forecast", {"route": {"links": [*LINKS, {"length_m": 5}, {"length_m": "x", "speed_m_s": 5}]}}, {"/route/links/1", "/route/links/2/length_m"}),
    ("forecast", {"route": {"roads": [{"samples": {"time_s": [0, 1, 2], "speed_m_s": [0, 500, 1]}}]}}, {"/route/roads/0/samples/speed_m_s/1"}),
    ("forecast", {"route": {"links": LINKS, "elevation": {"position_m": [1.0], "elevation_m": [1e6]}}}, {"/route/elevation"}),
    ("forecast", {"route": {"code": "Ok", "routes": [{"legs": [{"duration": "x", "distance": 5}]}]}}, {"/route/routes/0/legs/0/duration"}),
    ("forecast", {"links": LINKS, "elevation": {"position_m": [1.0]}}, {"/elevation"}),
    ("update", {"route": {"links": LINKS}}, {""}),
    ("update", {"links": LINKS, "observed": {"time_s": [0, 1]}}, {"/observed"}),
    ("live_plan", {"route": {"links": []}}, {"/route/links"}),
    ("forecast", [], {""}),
    ("difference", {"one": {"links": LINKS}, "other": {"links": [{"length_m": 5}]}}, {"/other/links/0"}),
    ("difference", {"one": {"links": LINKS}, "other": {"links": LINKS, "driver": "ann"}}, {"/other/driver"}),
    ("difference", {"one": {"route": {"links": [5]}}, "other": {"links": LINKS}}, {"/one/route/links/0"}),
    ("plan", {"stops": ["47.14,9.52", "147.10,9.61"], "soc": 0.8}, {"/stops/1"}),
    ("plan", {"stops": ["1,2", {"latitude_deg": 95, "longitude_deg": 2}]}, {"/stops/1/latitude_deg"}),
    ("reach", {"start": "nowhere", "soc": 0.8}, {"/start"}),
    ("journey_difference", {"one": {"stops": ["1,2", "95,2"]}, "other": {"stops": ["1,2", "1,3"]}}, {"/one/stops/1"}),
    ("journey_difference", {"one": {"stops": ["1,2", "3,2"], "driver": "ann"}, "other": {"stops": ["1,2", "1,3"]}}, {"/one/driver"}),
    ("live_plan", {"stops": ["47.14,9.52", "x"]}, {"/stops/1"}),
    ("distance", {"distance_km": 9, "car": "zzzz"}, {"car"}),
    ("distance", {"trip": "A"}, {"car"}),
    ("journeys.places", None, {"q"}),
    ("route", "time_s,speed_m_s\n0,0\n1,500\n2,5", {None}),
    ("route", "<gpx/>", {None}),
]  # fmt: skip


@pytest.fixture(scope="module")
def placeless() -> Jobs:
    return Jobs.from_folders({}, Limits(), Atlas(open_server("osrm=http://127.0.0.1:9")))


@pytest.mark.parametrize(("kind", "given", "places"), WRONG_ROADS)
def test_a_fault_has_its_place_in_the_body_or_its_parameter(
    placeless: Jobs, kind: str, given: Any, places: set[str | None]
) -> None:
    job = {"kind": kind, "speed_m_s": None, "text": "x", "limit": 1}
    status, content = run_job(
        placeless, job, given.encode() if isinstance(given, str) else orjson.dumps(given)
    )
    faults = orjson.loads(content)["faults"]
    assert status == 422
    assert {fault.get("pointer", fault.get("parameter")) for fault in faults} == places
    assert all(("parameter" in fault) == fault["where"].startswith("query.") for fault in faults)
    for pointer in (fault["pointer"] for fault in faults if "pointer" in fault):
        value = given
        for step in re.findall("/([^/]*)", pointer):  # fails where the body has no such place
            value = value[
                int(step) if isinstance(value, list) else step.replace("~1", "/").replace("~0", "~")
            ]
    if kind == "forecast" and "samples" in given and len(places) == 3:
        by_place = {fault["pointer"]: (fault["where"], fault["got"]) for fault in faults}
        assert by_place["/samples/speed_m_s/1"] == ("samples.speed_m_s[1]", "null")


def test_unknown_parameters_are_refused(service: Service) -> None:
    client = service.client
    refused = client.get("/v1/vehicles", params={"serach": "leaf"})
    assert refused.status_code == 422
    (fault,) = refused.json()["faults"]
    assert (fault["where"], fault["fix"]) == ("query.serach", "did you mean 'search'?")
    assert "pointer" not in fault
    assert client.get("/v1/range", params={"soc": 0.5, "kidn": "city"}).status_code == 422
    assert client.post("/v1/forecast", params={"verbose": 1}, json={}).status_code == 422
    assert client.get("/healthz", params={"at": "now"}).status_code == 200


def test_a_response_has_the_fields_that_were_asked_for(service: Service, drive: dict[str, Any]) -> None:
    whole = service.client.post("/v1/forecast", json=drive).json()
    part = service.client.post("/v1/forecast", params={"fields": "energy_wh,soc_arrival"}, json=drive)
    assert part.json() == {name: whole[name] for name in ("energy_wh", "soc_arrival")}
    lines = service.client.post(
        "/v1/forecast/batch",
        params={"fields": "trip"},
        content=orjson.dumps(drive),
        headers={"Content-Type": "application/x-ndjson"},
    )
    assert orjson.loads(lines.content) == {"trip": whole["trip"]}
    wrong = service.client.post("/v1/forecast", params={"fields": "energy"}, json=drive)
    assert (wrong.status_code, wrong.json()["faults"][0]["where"]) == (422, "query.fields")


def test_parameters_of_the_path_are_not_those_of_the_query() -> None:
    async def handler(request: Request, zoom: int, fields: str | None) -> None: ...

    route = APIRoute("/v1/tiles/{zoom}", handler)

    def faults_of(query: bytes) -> list[tuple[str, str]]:
        request = Request({"type": "http", "query_string": query, "route": route})
        try:
            asyncio.run(refuse_unknown_parameters(request))
        except InvalidInput as refused:
            return [(fault.where, fault.fix) for fault in refused.faults]
        return []

    assert faults_of(b"fields=a") == []
    assert [where for where, _ in faults_of(b"request=1&zoom=2&fields=a")] == ["query.request", "query.zoom"]
    ((where, fix),) = faults_of(b"field=a")
    assert (where, "fields" in fix) == ("query.field", True)
    assert faults_of(b"x" * 100 + b"=1")[0][0] == f"query.{'x' * 80}"


def test_what_is_refused_names_what_is_allowed(service: Service, complete: Service) -> None:
    def fault(given: dict[str, Any], path: str = "/v1/forecast") -> dict[str, str]:
        (found,) = service.client.post(
            path, json={"links": [{"length_m": 900, "speed_m_s": 9}]} | given
        ).json()["faults"]
        assert isinstance(found, dict)
        return found

    assert fault({"soc": 80})["allowed"] == "at most 1"
    assert fault({"climate": "warm"})["allowed"] == "'auto', 'off', 'heat' or 'cool'"
    for name in ("vehicle", "vehicle_figures"):
        assert fault({name: "vw_id3"})["fix"] == "did you mean 'car'?"
    vehicle = fault({"car": "zzzz"})
    assert "GET /v1/vehicles" in vehicle["allowed"]
    assert "figures" in vehicle["fix"]
    for path in ("/v1/need", "/v1/range"):
        (unknown,) = service.client.get(path, params={"distance_km": 3, "ambient_temperature": 3} if path == "/v1/need"
                                        else {"ambient_temperature": 3}).json()["faults"]  # fmt: skip
        assert unknown["fix"] == "did you mean 'ambient_temperature_degc'?"
    (unknown,) = service.client.get("/v1/range", params={"vehicle": "vw_id3"}).json()["faults"]
    assert unknown["fix"] == "did you mean 'car'?"
    (unknown,) = service.client.get("/v1/need", params={"km": 50}).json()["faults"]
    assert unknown["fix"] == "did you mean 'distance_km'?"
    for path, other in (
        ("/v1/live/leav", "'leaf'"),
        ("/v1/live/zzz", "/v1/live"),
        ("/v1/cars/zzz", "/v1/cars"),
    ):
        assert other in complete.client.get(path).json()["detail"]


def test_every_unknown_field_is_named() -> None:
    with pytest.raises(InvalidInput) as refused:
        chosen_fields({"a": 1}, "b,a,c")
    assert [fault.got for fault in refused.value.faults] == ["'b'", "'c'"]


@pytest.mark.parametrize("path", ["/v1/models", "/v1/vehicles", "/v1/examples", "/v1/map", "/openapi.json"])
def test_what_does_not_change_has_a_tag(service: Service, path: str) -> None:
    first = service.client.get(path)
    tag = first.headers["etag"]
    again = service.client.get(path, headers={"If-None-Match": f'W/"0", {tag}'})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert service.client.get(path, headers={"If-None-Match": 'W/"0"'}).content == first.content


@pytest.mark.parametrize(
    ("method", "path", "given", "where"),
    [
        ("POST", "/v1/reachable", {"departs_at": 1769927400.0}, "departs_at"),
        ("POST", "/v1/forecast", {"samples": {"soc": [0.5]}}, "samples.soc"),
        ("PUT", "/v1/live/leaf/plan", {"departs_at": 1769927400}, "departs_at"),
        ("GET", "/v1/need", {"distance_km": 30, "departs_at": 1769927400}, "departs_at"),
        ("GET", "/v1/need", {"soc": 0.5}, "distance_km, trip"),
        ("POST", "/v1/forecast", {"departure": {"departs_at": 1769927400.0}}, "departure.departs_at"),
        ("POST", "/v1/reachable", {"start": "a", "departure": {"soc": 0.5}, "soc": 0.4}, "departure.soc"),
        ("PUT", "/v1/live/leaf/plan", {"departure": {"soc": 80}}, "departure.soc"),
        ("POST", "/v1/forecast/difference", {"one": {"route": 5}, "other": {}}, "one.route"),
    ],
)  # fmt: skip
def test_a_time_is_a_text_and_a_charge_of_samples_has_its_full_name(
    complete: Service, method: str, path: str, given: dict[str, Any], where: str
) -> None:
    found = complete.client.request(method, path, **{"params" if method == "GET" else "json": given})
    assert found.status_code == 422
    assert where in {fault["where"].removeprefix("query.") for fault in found.json()["faults"]}


def test_the_page_of_the_forecast_has_its_fields_and_who_takes_a_departure(document: dict[str, Any]) -> None:
    page = (ROOT / "docs" / "reference" / "forecast.md").read_text("utf-8")
    of_forecast = page.partition("## Fields")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", of_forecast, re.MULTILINE)) == set(
        ForecastResponse.__annotations__
    )
    schemas = document["components"]["schemas"]
    departures = [
        kind["properties"] for kind in schemas.values() if "tyre_pressure" in kind.get("properties", {})
    ]
    assert len(departures) >= 8
    assert all("departs_at" in fields for fields in departures)
    assert all(name in schemas["Verdict"]["description"] for name in schemas["Verdict"]["properties"])


def test_every_answer_is_described(document: dict[str, Any]) -> None:
    described = {
        (path, method): operation["responses"]["200"]["description"]
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }
    assert {one for one, text in described.items() if not text} == set()
    assert described["/v1/forecast", "post"] == ForecastResponse.__doc__.partition("\n")[0]  # type: ignore[union-attr]


def test_headers_are_in_the_document(document: dict[str, Any]) -> None:
    paths = document["paths"]
    for path in ("/v1/models", "/v1/vehicles", "/v1/map"):
        heeds = [p["name"] for p in paths[path]["get"]["parameters"] if p["in"] == "header"]
        answers = paths[path]["get"]["responses"]
        assert (heeds, "ETag" in answers["200"]["headers"], "content" in answers["304"]) == (
            ["If-None-Match"],
            True,
            False,
        )
    forecast = paths["/v1/forecast"]["post"]
    assert "parameters" not in forecast or all(p["in"] == "query" for p in forecast["parameters"])
    assert "headers" not in forecast["responses"]["200"]
    assert set(forecast["responses"]) == {"200", "default"}
    assert list(forecast["responses"]["default"]["content"]) == ["application/problem+json"]
    assert "Retry-After" in forecast["responses"]["default"]["headers"]


def test_another_site_neither_changes_nor_reads(service: Service, document: dict[str, Any]) -> None:
    """Every operation; a program sends neither header, and the page those of its own origin."""
    client, operations = service.client, set[tuple[str, str]]()
    for path, of_path in document["paths"].items():
        operations |= {(method, path) for method in of_path if path.startswith("/v1/")}
    assert len(operations) >= 36
    foreign = ({"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"}, {"Origin": "null"})
    own = ({}, {"Origin": service.url}, {"Sec-Fetch-Site": "same-origin", "Origin": service.url})

    def check(method: str, path: str) -> None:
        place = re.sub(r"\{\w+\}", "abcdefgh", path)
        for headers in (*foreign, {"Origin": "https://evil.example"}):
            refused = client.request(method, place, headers=headers)
            assert (refused.status_code, refused.json()["type"]) == (403, "/problems/foreign-site"), path
        for sent in own:
            with client.stream(method, place, headers=sent) as answer:
                assert answer.status_code != 403, path

    with ThreadPoolExecutor(len(operations)) as at_once:  # a refusal waits
        list(at_once.map(lambda operation: check(*operation), operations))
    for path in ("/", "/healthz"):
        assert client.get(path, headers={"Sec-Fetch-Site": "cross-site"}).status_code == 200


def with_departure(request: dict[str, Any]) -> dict[str, Any]:
    """The request with what it knows of the departure in one object, also in the requests inside of it."""
    inside = {
        name: [with_departure(one) for one in value] if name == "trips" else with_departure(value)
        for name, value in request.items()
        if name in ("one", "other", "trips")
    }
    # the trip of a fleet has its time beside the departure, as in Python
    known = {name: request[name] for name in ASKED if name in request and name != "departs_at"}
    return (
        {n: v for n, v in request.items() if n not in known}
        | inside
        | ({"departure": known} if known else {})
    )


def test_a_departure_is_taken_as_fields_and_as_one_object() -> None:
    """Over every request that has one."""
    jobs, tried = Jobs.from_folders({}, Limits()), set[str]()
    for model, examples in EXAMPLES.items():
        for example in examples.values():
            together = with_departure(dict(example))
            if together == example:
                continue
            tried.add(model.__name__)
            flat, nested = (departures(check_request(one, model, jobs)) for one in (example, together))
            assert flat == nested
            assert flat[0] != Departure()
    assert len(tried) >= 9


def departures(request: Any) -> list[Departure]:
    """The departures of a checked request."""
    inside = [request.one, request.other] if hasattr(request, "one") else [request]
    if isinstance(request, NightRequest):  # its rows are checked one by one
        inside = [
            check_request(row, PlannedTripRequest, Jobs.from_folders({}, Limits())) for row in request.trips
        ]
    return [departure_of(one) for one in inside]


Path = tuple[str | int, ...]


def nullable(schema: dict[str, Any]) -> bool:
    return any(one.get("type") == "null" for one in schema.get("anyOf", ()))


def objects(
    value: Any, schema: dict[str, Any], schemas: dict[str, Any], path: Path = ()
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Places of the objects of a document, and the properties that the schema gives each."""
    if "$ref" in schema:
        schema = schemas[schema["$ref"].rpartition("/")[2]]
    for one in schema.get("anyOf", ()):
        yield from objects(value, one, schemas, path)
    if isinstance(value, dict) and "properties" in schema:
        yield path, schema["properties"]
        for name in value.keys() & schema["properties"].keys():
            yield from objects(value[name], schema["properties"][name], schemas, (*path, name))
    elif isinstance(value, list) and "items" in schema:
        for k, item in enumerate(value):
            yield from objects(item, schema["items"], schemas, (*path, k))


def variants(example: Any, schema: dict[str, Any], schemas: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Each field that may be null: its place, the example without it, and with null."""
    for path, properties in objects(example, schema, schemas):
        for name, of_field in properties.items():
            if not nullable(of_field):
                continue
            without, with_null = copy.deepcopy(example), copy.deepcopy(example)
            for document, change in (
                (without, lambda o, n: o.pop(n, None)),
                (with_null, lambda o, n: o.update({n: None})),
            ):
                for step in path:
                    document = document[step]
                change(document, name)
            yield ".".join(map(str, (*path, name))), without, with_null


def test_null_counts_as_left_out_wherever_the_document_allows_it(document: dict[str, Any]) -> None:
    """Over every request, field by field."""
    schemas, jobs = document["components"]["schemas"], Jobs.from_folders({}, Limits())

    def refused(model: type[BaseModel], request: Any) -> list[str]:
        try:
            check_request(request, model, jobs)
        except InvalidInput as error:
            return [fault.where for fault in error.faults]
        return []

    wrong, tried = [], 0
    for model, examples in EXAMPLES.items():
        for example in examples.values():
            for place, absent, null in variants(example, schemas[model.__name__], schemas):
                tried += 1
                if refused(model, absent) != refused(model, null):
                    wrong.append(f"{model.__name__}.{place}")
    assert tried > 150
    assert wrong == []


def test_places_lines_and_areas_have_one_form_each(document: dict[str, Any]) -> None:
    """In every request and answer."""
    schemas = document["components"]["schemas"]
    forms: dict[str, set[str]] = {}
    for name, schema in schemas.items():
        fields = schema.get("properties", {})
        if {"latitude_deg", "coordinates"} & fields.keys():
            kind = fields.get("latitude_deg", {}).get("type", "area")
            forms.setdefault({"number": "place", "array": "line"}.get(kind, kind), set()).add(name)
        if "line" in fields:
            assert fields["line"]["$ref"].endswith("/LineDocument"), name
    assert forms.pop("place") == {"PlaceDocument", "PlaceRequest", "Station"}
    assert forms == {"line": {"LineDocument"}, "area": {"PolygonDocument"}}


WORDS = {
    "ChargingDocument.label": "best effort",
    "RoadDocument.labels": "least energy",
    "NeedResponse.kind": "trip",
    "KindRange.kind": "motorway",
    "VehicleSummary.anchor": "road",
    "HealthResponse.status": "ready",
}
"""Fields whose value is one of a few words, and one of these."""


def test_words_are_enumerated(document: dict[str, Any]) -> None:
    for place, word in WORDS.items():
        of, _, name = place.partition(".")
        schema = document["components"]["schemas"][of]["properties"][name]
        assert word in schema.get("items", schema)["enum"], place


def test_no_parameter_is_documented_as_null(document: dict[str, Any]) -> None:
    parameters = [p for o in operations(document) for p in o.get("parameters", ())]
    assert len(parameters) > 50
    assert [p for p in parameters if nullable(p["schema"]) or p["schema"].get("type") == "null"] == []


def test_the_type_of_every_problem_is_an_address(service: Service) -> None:
    for kind, (status, title) in TITLES.items():
        answer = service.client.get(f"/problems/{kind}")
        assert (answer.status_code, answer.json()) == (
            200,
            {"type": f"/problems/{kind}", "title": title, "status": status},
        )
    assert service.client.get("/problems/moon").status_code == 404


NOT_NOUNS = {"vehicle", "vehicle_id", "car_id", "quantile", "chance", "own_car", "trip_id"}
"""Names that say car, trip or probability otherwise."""


def test_one_thing_has_one_name_and_one_default(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    fields = {
        f"{of}.{name}": field
        for of, kind in schemas.items()
        for name, field in kind.get("properties", {}).items()
    }
    named = {place for place in fields if place.rpartition(".")[2] in NOT_NOUNS}
    assert not named
    asked = [p for operation in operations(document) for p in operation.get("parameters", ())]
    assert not {parameter["name"] for parameter in asked} & NOT_NOUNS
    defaults = {"reserve": 0.1, "probability": 0.95}
    for name, default in defaults.items():
        of_requests = [field for place, field in fields.items() if place.endswith(f"Request.{name}")]
        of_queries = [parameter["schema"] for parameter in asked if parameter["name"] == name]
        given = [field["x-default"] for field in of_requests if "x-default" in field]
        given += [field.get("default", field.get("x-default")) for field in of_queries]
        assert given
        assert set(given) == {default}, name


def test_every_door_has_the_same_defaults() -> None:
    """Functions, the command line and the tools of assistants."""
    functions = (tw.need, tw.range_km, tw.advise, tw.soc_needed, JourneyOptions, needs_by_hour, find_reach)
    for function in functions:
        known = inspect.signature(function).parameters
        assert known["reserve"].default == 0.1, function
        assert "probability" not in known or known["probability"].default == 0.95, function
        assert not NOT_NOUNS & known.keys()
    for _, takes, _ in TOOLS.values():
        fields = takes.model_fields
        assert not NOT_NOUNS & fields.keys()
        assert "reserve" not in fields or fields["reserve"].default == 0.1
    for command in (need, range_, reach, forecast, advise):
        options = inspect.signature(command).parameters
        assert not (NOT_NOUNS - {"vehicle"}) & options.keys()
        assert "reserve" not in options or options["reserve"].default == 0.1
    assert Drive().reserve == 0.1
