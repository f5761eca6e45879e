"""What of the service's OpenAPI document would break a client of an older one.

``python -m tools.quality.contract [OLD.json [NEW.json]]`` prints each break of this checkout, by default for clients of the newest release,
and exits with 1 where there is one. ``--write`` writes them down as what the next minor version breaks: the gate fails for any other.

What a client of the old document sends has to fit the new one, and what the new service answers the old one; a response may have more
fields. Operations with `x-internal` are left out. The comparison is of JSON Schema as pydantic writes it: references, alternatives,
types, choices, bounds, objects and lists.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from typer import Argument

from tools import DOCS
from tools.command import run

Schema = Mapping[str, Any]

LEAST: Final = (("minimum", "exclusiveMinimum"), ("minLength",), ("minItems",), ("minProperties",))
MOST: Final = (("maximum", "exclusiveMaximum"), ("maxLength",), ("maxItems",), ("maxProperties",))
RELEASED: Final = DOCS / "reference" / "openapi"
"""OpenAPI documents by the version that was released with them."""

BREAKS: Final = RELEASED / "breaks.txt"
"""What the next minor version breaks for clients of the newest release; empty where nothing."""

ALTERNATIVES: Final = ("anyOf", "oneOf")


@dataclass(frozen=True)
class Side:
    """A schema, and the document that its references are in."""

    schema: Schema
    document: Schema = field(repr=False)

    def of(self, schema: Schema) -> Side:
        """Another schema of the document; a reference is replaced by the schema that it names."""
        while "$ref" in schema:
            schema = self.document["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
        return Side(schema, self.document)

    def alternatives(self) -> list[Side]:
        """Schemas, one of which a value has to fit."""
        for key in ALTERNATIVES:
            if key in self.schema:
                parts = [self.of(part).schema for part in self.schema[key]]
                return [
                    alternative
                    for part in parts
                    for alternative in self.of(self._with(key, part)).alternatives()
                ]
        kinds = self.schema.get("type")
        if isinstance(kinds, list):
            return [self.of({**self.schema, "type": kind}) for kind in kinds]
        return [self]

    def _with(self, key: str, part: Schema) -> Schema:
        """An alternative with what stands beside the alternatives, whose fields count: the document of 0.2 alone has such schemas."""
        beside = {name: value for name, value in self.schema.items() if name != key}
        if "properties" not in beside:
            return part
        fields = {**part.get("properties", {}), **beside["properties"]}
        required = [*beside.get("required", ()), *part.get("required", ())]
        return {**beside, **part, "properties": fields, "required": required}


def breaks(old: Schema, new: Schema) -> list[str]:
    """Each break of a document for clients of an older one: operation, place, what has changed."""
    now = {(_place(path), method): o for path, group in new["paths"].items() for method, o in group.items()}
    return sorted(
        f"{method.upper()} {path}{line}"
        for path, operations in old["paths"].items()
        for method, operation in operations.items()
        if not operation.get("x-internal")
        for line in set(_of_operation(operation, now.get((_place(path), method)), old, new))
    )


def _place(path: str) -> str:
    """A path without the names of its parameters, which no client sends."""
    return re.sub(r"\{\w+\}", "{}", path)


def _of_operation(was: Schema, now: Schema | None, old: Schema, new: Schema) -> Iterator[str]:
    if now is None:
        yield ": operation is removed"
        return
    before, after = (_parameters(operation) for operation in (was, now))
    for name in before.keys() - after.keys():
        yield f" parameter {name}: is removed"
    for name, parameter in after.items():
        if parameter.get("required") and not before.get(name, {}).get("required"):
            yield f" parameter {name}: is required"
        if name in before:
            sides = Side(before[name]["schema"], old), Side(parameter["schema"], new)
            yield from _misfits(*sides, f" parameter {name}", to_service=True)
    body, body_now = (operation.get("requestBody", {}) for operation in (was, now))
    if body_now.get("required") and not body.get("required"):
        yield " request: a body is required"
    yield from _of_content(body, body_now, old, new, " request", to_service=True)
    for status, answer in was["responses"].items():
        response = now["responses"].get(status, now["responses"].get("default"))
        if response is None:
            yield f" response {status}: is removed"
        else:
            yield from _of_content(answer, response, old, new, f" response {status}", to_service=False)


def _parameters(operation: Schema) -> dict[str, Schema]:
    return {p["name"]: p for p in operation.get("parameters", ()) if p["in"] != "path"}


def _of_content(
    was: Schema, now: Schema, old: Schema, new: Schema, where: str, *, to_service: bool
) -> Iterator[str]:
    for kind, content in was.get("content", {}).items():
        if kind not in now.get("content", {}):
            yield f"{where}: {kind} is removed"
            continue
        sides = (
            Side(content.get("schema", {}), old),
            Side(now["content"][kind].get("schema", {}), new),
        )
        yield from _misfits(*(sides if to_service else sides[::-1]), where, to_service=to_service)


def _misfits(
    given: Side, wanted: Side, where: str, *, to_service: bool, above: tuple[Any, ...] = ()
) -> list[str]:
    """Reasons why a value of the schema `given` may not fit the schema `wanted`."""
    pair = given.schema.get("$ref"), wanted.schema.get("$ref")
    if pair in above and None not in pair:
        return []
    given, wanted = given.of(given.schema), wanted.of(wanted.schema)
    misfits: list[str] = []
    for alternative in given.alternatives():
        tried = (
            list(_misfits_of_one(alternative, other, where, to_service, (*above, pair)))
            for other in wanted.alternatives()
        )
        nearest: list[str] = min(tried, key=lambda lines: _distance(lines, where))
        misfits += nearest
    return misfits


def _distance(misfits: list[str], where: str) -> tuple[bool, int]:
    """How far an alternative is from a schema: one of another type is the farthest."""
    return any(line.startswith(f"{where}: type ") for line in misfits), len(misfits)


def _misfits_of_one(
    given: Side, wanted: Side, where: str, to_service: bool, above: tuple[Any, ...]
) -> Iterator[str]:
    a, b = given.schema, wanted.schema
    kind, kind_wanted = a.get("type"), b.get("type")
    if kind_wanted not in (None, kind) and (kind, kind_wanted) != ("integer", "number"):
        yield f"{where}: type {kind} beside {kind_wanted}"
        return
    choices, allowed = _choices(a), _choices(b)
    if allowed is not None and (choices is None or not choices <= allowed):
        extra = "any value" if choices is None else ", ".join(sorted(choices - allowed))
        yield f"{where}: {extra} beside the choices {', '.join(sorted(allowed))}"
    for name in ("pattern", "format"):
        if choices is None and b.get(name) not in (None, "binary", a.get(name)):  # any text is binary
            yield f"{where}: {name} {a.get(name)} beside {b[name]}"
    for names, sign in ((LEAST, 1.0), (MOST, -1.0)):
        for pair in names:
            if choices is None and _limit(a, pair, sign) < _limit(b, pair, sign):
                yield f"{where}: {pair[0]} {_shown(a, pair)} beside {_shown(b, pair)}"
    fields, wanted_fields = a.get("properties", {}), b.get("properties", {})
    closed = b.get("additionalProperties") is False
    lost = (
        (fields.keys() - wanted_fields.keys() if closed else ())
        if to_service
        else wanted_fields.keys() - fields.keys()
    )
    yield from (f"{where}.{name}: field is removed" for name in sorted(lost))
    words = "is required" if to_service else "may be missing"
    unsure = set(b.get("required", ())) - set(a.get("required", ())) - set(lost)
    yield from (f"{where}.{name}: field {words}" for name in sorted(unsure))
    inner = [(f".{name}", fields[name], wanted_fields[name]) for name in fields if name in wanted_fields]
    inner += [
        (f"[{key}]", a.get(key, {}), b[key])
        for key in ("items", "additionalProperties")
        if isinstance(b.get(key), Mapping) and isinstance(a.get(key, {}), Mapping)
    ]
    inner += [
        (f"[{k}]", *parts)
        for k, parts in enumerate(zip(a.get("prefixItems", ()), b.get("prefixItems", ()), strict=False))
    ]
    for place, one, other in inner:
        sides = Side(one, given.document), Side(other, wanted.document)
        yield from _misfits(*sides, f"{where}{place}", to_service=to_service, above=above)


def _choices(schema: Schema) -> set[str] | None:
    if "const" in schema:
        return {json.dumps(schema["const"])}
    return {json.dumps(value) for value in schema["enum"]} if "enum" in schema else None


def _limit(schema: Schema, names: tuple[str, ...], sign: float) -> tuple[float, bool]:
    """The stricter of a limit and an exclusive one, larger where it is stricter."""
    limits = [(sign * schema[name], name.startswith("exclusive")) for name in names if name in schema]
    return max(limits, default=(-math.inf, False))


def _shown(schema: Schema, names: tuple[str, ...]) -> str:
    return " and ".join(f"{schema[name]:g}" for name in names if name in schema) or "none"


def of_checkout() -> dict[str, Any]:
    """The OpenAPI document of the package that this process imports."""
    from tripwatt.server.http.app import openapi_document

    document: dict[str, Any] = openapi_document()
    return document


def released() -> Path:
    """The document of the newest release."""
    return max(RELEASED.glob("*.json"), key=lambda file: [int(part) for part in file.stem.split(".")])


def main(
    old: Annotated[Path | None, Argument()] = None,
    new: Annotated[Path | None, Argument()] = None,
    write: bool = False,
) -> None:
    """Print what breaks clients of an older document, or write it as what the next release will break."""
    after = of_checkout() if new is None else json.loads(new.read_bytes())
    lines = breaks(json.loads((old or released()).read_bytes()), after)
    if write:
        BREAKS.write_text("".join(f"{line}\n" for line in lines), "utf-8")
        return
    print("\n".join([*lines, f"{len(lines)} breaks"]))
    sys.exit(bool(lines))


if __name__ == "__main__":
    run(main)
