"""Media types that schemathesis does not know by itself; it loads this file, see `tests.support.service_schema`."""

from __future__ import annotations

from typing import Any

import schemathesis


@schemathesis.serializer("application/x-ndjson", "application/gpx+xml", "text/csv")
def as_text(ctx: schemathesis.SerializationContext, value: Any) -> bytes:
    """A body that is text, as it is."""
    return value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogatepass")
