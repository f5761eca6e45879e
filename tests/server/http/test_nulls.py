"""Where the OpenAPI document allows null, null counts as a field that is left out: over every operation, field by field."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from tests.support.service_process import Service

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


def test_null_counts_as_left_out_wherever_the_document_allows_it(service: Service) -> None:
    document = service.client.get("/openapi.json").json()
    wrong, tried = [], 0
    for route, operations in document["paths"].items():
        for method, operation in operations.items():
            content = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
            for example in content.get("examples", {}).values():
                url = route.replace("{", "").replace("}", "")
                for place, *both in variants(
                    example["value"], content["schema"], document["components"]["schemas"]
                ):
                    tried += 1
                    absent, null = (service.client.request(method, url, json=body) for body in both)
                    if absent.status_code != null.status_code:
                        wrong.append(
                            f"{method} {route} {place}: {absent.status_code} absent, {null.status_code} null {null.text[:200]}"
                        )
    assert tried > 150
    assert wrong == []


def test_no_parameter_is_documented_as_null(service: Service) -> None:
    document = service.client.get("/openapi.json").json()
    parameters = [
        (route, one["name"], one["schema"])
        for route, operations in document["paths"].items()
        for operation in operations.values()
        for one in operation.get("parameters", ())
    ]
    assert len(parameters) > 50
    assert [one for one in parameters if nullable(one[2]) or one[2].get("type") == "null"] == []
