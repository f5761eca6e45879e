"""What users can name: commands with their options, routes with their fields, names of the door.

``python -m tools.quality.surface [CHECKOUT]`` prints them, by default of this checkout; with a second one, it prints what the first
has and the second lacks (``-``), and what is new (``+``).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from typer import Argument

from tools import ROOT
from tools.command import run


def commands(command: Any, name: str = "tripwatt") -> Iterator[str]:
    """Each command and its arguments and options, as the help names them."""
    children = getattr(command, "commands", {})
    for child, below in children.items():
        yield from commands(below, f"{name} {child}")
    if not children:
        yield f"command {name}"
        for parameter in command.params:
            for word in (*parameter.opts, *parameter.secondary_opts):
                yield f"{parameter.param_type_name} {name} {word}"


def routes(document: dict[str, Any]) -> Iterator[str]:
    """Each route of an OpenAPI document with its parameters, and the fields of its bodies and answers."""
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            route = f"{method.upper()} {path}"
            yield f"route {route}"
            yield from (f"parameter {route} {p['name']}" for p in operation.get("parameters", ()))
            answers = [a for code, a in operation["responses"].items() if code.startswith("2")]
            for kind, parts in (("request", [operation.get("requestBody", {})]), ("response", answers)):
                for content in (c for part in parts for c in part.get("content", {}).values()):
                    yield from (f"{kind} {route} {f}" for f in fields(content.get("schema", {}), document))


def fields(schema: dict[str, Any], document: dict[str, Any]) -> set[str]:
    """The fields of an object, of any of its alternatives."""
    if "$ref" in schema:
        return fields(document["components"]["schemas"][schema["$ref"].rpartition("/")[2]], document)
    parts = [part for key in ("anyOf", "allOf", "oneOf") for part in schema.get(key, ())]
    return set(schema.get("properties", {})).union(*(fields(part, document) for part in parts))


def surface() -> Iterator[str]:
    """All lines, of the package that this process imports."""
    import typer.main

    import tripwatt
    from tripwatt.command import app
    from tripwatt.server.http.app import create_app

    yield from commands(typer.main.get_command(app))
    service: Any = create_app()
    while not hasattr(service, "openapi"):
        service = service.app
    yield from routes(service.openapi())
    yield from (f"door {name}" for name in tripwatt.__all__)


def of_checkout(root: Path) -> list[str]:
    """All lines of a checkout, in order, from a process of its own."""
    code = "import json; from tools.quality.surface import surface; print(json.dumps(sorted(set(surface()))))"
    path = os.pathsep.join((str(root.resolve() / "src"), str(root.resolve() / "gamm" / "src"), str(ROOT)))
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
    )
    lines: list[str] = json.loads(done.stdout)
    return lines


def main(
    checkout: Annotated[Path, Argument()] = ROOT, new: Annotated[Path | None, Argument()] = None
) -> None:
    """Print the lines of a checkout, or how those of another one differ."""
    old = of_checkout(checkout)
    if new is None:
        print("\n".join(old))
        return
    after = of_checkout(new)
    for sign, line in sorted([("-", x) for x in {*old} - {*after}] + [("+", x) for x in {*after} - {*old}]):
        print(sign, line)
    print(f"{len(old)} names before, {len(after)} after")


if __name__ == "__main__":
    run(main)
