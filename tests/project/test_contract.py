"""The service against the documents of releases: every kind of break is recognised, and none happens unnoticed."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

import pytest
from tools.quality.contract import BREAKS, breaks, of_checkout, released


@pytest.fixture(scope="module")
def ours() -> Any:
    """The document of this checkout."""
    return of_checkout()


def test_what_breaks_clients_of_the_newest_release_is_what_is_written_down(ours: Any) -> None:
    """A change that breaks them fails here until `python -m tools.quality.contract --write`, and then asks for a new minor version."""
    found = breaks(json.loads(released().read_bytes()), ours)
    assert found == BREAKS.read_text("utf-8").splitlines()


def test_a_document_breaks_nothing_for_its_own_clients(ours: Any) -> None:
    for document in (ours, json.loads(released().read_bytes())):
        assert breaks(document, document) == []


def fields(d: Any, name: str) -> Any:
    return d["components"]["schemas"][name]["properties"]


def schema(name: str, field: str) -> Callable[[Any], Any]:
    return lambda d: fields(d, name)[field]


def forecast(d: Any) -> Any:
    return d["paths"]["/v1/forecast"]["post"]


def need(d: Any, name: str) -> Any:
    return next(p for p in d["paths"]["/v1/need"]["get"]["parameters"] if p["name"] == name)


def required(d: Any, name: str, field: str) -> None:
    d["components"]["schemas"][name].setdefault("required", []).append(field)


KINDS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "operation": (lambda d: d["paths"].pop("/v1/forecast"), "POST /v1/forecast: operation is removed"),
    "parameter": (
        lambda d: d["paths"]["/v1/need"]["get"]["parameters"].remove(need(d, "distance_km")),
        "GET /v1/need parameter distance_km: is removed",
    ),
    "required parameter": (
        lambda d: need(d, "distance_km").update(required=True),
        "GET /v1/need parameter distance_km: is required",
    ),
    "field of a response": (
        lambda d: fields(d, "ForecastResponse").pop("energy_wh"),
        "POST /v1/forecast response 200.energy_wh: field is removed",
    ),
    "certainty of a field of a response": (
        lambda d: d["components"]["schemas"]["ForecastResponse"]["required"].remove("energy_wh"),
        "POST /v1/forecast response 200.energy_wh: field may be missing",
    ),
    "null in a response": (
        lambda d: schema("ForecastResponse", "energy_wh")(d).update(type=["number", "null"]),
        "POST /v1/forecast response 200.energy_wh: type null beside number",
    ),
    "type in a response": (
        lambda d: schema("ForecastResponse", "trip")(d).update(type="integer"),
        "POST /v1/forecast response 200.trip: type integer beside string",
    ),
    "choice in a response": (
        lambda d: schema("Verdict", "advice")(d)["enum"].append("wait"),
        'POST /v1/journeys response 200.verdict.advice: "wait" beside the choices '
        '"charge_before", "charge_first", "go", "none", "slower", "stop"',
    ),
    "value of a map in a response": (
        lambda d: schema("ForecastResponse", "p_arrive_by_soc")(d).update(
            additionalProperties={"type": "string"}
        ),
        "POST /v1/forecast response 200.p_arrive_by_soc[additionalProperties]: type string beside number",
    ),
    "field of a request": (
        lambda d: fields(d, "ForecastRequest").pop("soc"),
        "POST /v1/forecast request.soc: field is removed",
    ),
    "required field of a request": (
        lambda d: required(d, "ForecastRequest", "soc"),
        "POST /v1/forecast request.soc: field is required",
    ),
    "bound in a request": (
        lambda d: schema("ForecastRequest", "soc")(d)["anyOf"][0].update(minimum=0.1),
        "POST /v1/forecast request.soc: minimum 0 beside 0.1",
    ),
    "exclusive bound in a request": (
        lambda d: schema("ForecastRequest", "soc")(d)["anyOf"][0].update(exclusiveMinimum=0.0),
        "POST /v1/forecast request.soc: minimum 0 beside 0 and 0",
    ),
    "choice in a request": (
        lambda d: schema("ForecastRequest", "climate")(d)["anyOf"][0]["enum"].remove("heat"),
        'POST /v1/forecast request.climate: "heat" beside the choices "auto", "cool", "off"',
    ),
    "null in a request": (
        lambda d: schema("ForecastRequest", "soc")(d)["anyOf"].pop(),
        "POST /v1/forecast request.soc: type null beside number",
    ),
    "pattern in a request": (
        lambda d: schema("ForecastRequest", "trip")(d).update(pattern="^[a-z]+$"),
        "POST /v1/forecast request.trip: pattern None beside ^[a-z]+$",
    ),
    "status": (
        lambda d: forecast(d)["responses"].pop("default"),
        "POST /v1/forecast response default: is removed",
    ),
    "media type of a response": (
        lambda d: forecast(d)["responses"]["200"]["content"].pop("application/json"),
        "POST /v1/forecast response 200: application/json is removed",
    ),
    "body": (
        lambda d: d["paths"]["/v1/cars"]["get"].update(requestBody={"required": True, "content": {}}),
        "GET /v1/cars request: a body is required",
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_break_is_recognised(ours: Any, kind: str) -> None:
    change, expected = KINDS[kind]
    document = copy.deepcopy(ours)
    change(document)
    found = breaks(ours, document)
    assert expected in found
    part = expected.split(":")[0].rpartition(".")[2].rpartition(" ")[2]
    assert all(part in line for line in found), found


HARMLESS: dict[str, Callable[[Any], Any]] = {
    "operation": lambda d: d["paths"].update({"/v1/new": {"get": {"responses": {}}}}),
    "field of a response": lambda d: fields(d, "ForecastResponse").update(more={"type": "number"}),
    "field of a request": lambda d: fields(d, "ForecastRequest").update(more={"type": "number"}),
    "wider bound in a request": lambda d: schema("ForecastRequest", "soc")(d)["anyOf"][0].update(maximum=2.0),
    "integer in place of a number": lambda d: schema("ForecastResponse", "energy_wh")(d).update(
        type="integer"
    ),
    "status": lambda d: forecast(d)["responses"].update({"418": {"description": "tea"}}),
    "name of a schema": lambda d: json.loads(json.dumps(d).replace("ForecastResponse", "Forecast")),
    "name of a parameter of a path": lambda d: d["paths"].update(
        {"/v1/cars/{name}": d["paths"].pop("/v1/cars/{car}")}
    ),
    "internal operation": lambda d: d["paths"].pop("/v1/examples"),
}


@pytest.mark.parametrize("kind", HARMLESS)
def test_what_no_client_notices_is_no_break(ours: Any, kind: str) -> None:
    document = copy.deepcopy(ours)
    changed = HARMLESS[kind](document)
    other = changed if isinstance(changed, dict) and "paths" in changed else document
    assert other != ours
    assert breaks(ours, other) == []


def test_schemas_that_name_themselves_end() -> None:
    tree = {"type": "object", "properties": {"inner": {"$ref": "#/components/schemas/Tree"}}}
    answer = {"content": {"application/json": {"schema": {"$ref": "#/components/schemas/Tree"}}}}
    document = {
        "paths": {"/t": {"get": {"responses": {"200": answer}}}},
        "components": {"schemas": {"Tree": tree}},
    }
    assert breaks(document, document) == []
