"""Media types that schemathesis does not know by itself; it loads this file, see `tests.support.service_schema`."""

from __future__ import annotations

from typing import Any

import schemathesis


@schemathesis.serializer("application/x-ndjson", "application/gpx+xml", "text/csv")
def as_text(ctx: schemathesis.SerializationContext, value: Any) -> bytes:
    """A body that is text, as it is."""
    return value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogatepass")


@schemathesis.hook
def before_load_schema(ctx: schemathesis.HookContext, raw_schema: dict[str, Any]) -> None:
    """Tuples as lists of any of their kinds: schemathesis 4.32 makes `items` a list of them, which is no schema of OpenAPI 3.1."""
    nodes: list[Any] = [raw_schema]
    while nodes:
        node = nodes.pop()
        if isinstance(node, dict) and "prefixItems" in node:
            node["items"] = {"anyOf": node.pop("prefixItems")}
        nodes += node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
