"""What is answered when a request is not: problem documents (RFC 9457)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import orjson
from starlette.responses import Response

from tripwatt.errors import Fault

MEDIA_TYPE: Final = "application/problem+json"
MOST_FAULTS: Final = 50
"""Faults that one answer names; the others are counted."""

LONGEST_TEXT: Final = 300
"""Characters of what is said of one fault; more would give back what was sent."""

TITLES: Final[Mapping[str, tuple[int, str]]] = {
    "not-json": (400, "The body is not JSON"),
    "bad-request": (400, "The request is malformed"),
    "host-not-served": (400, "The host is not served"),
    "token-needed": (401, "A token is required"),
    "not-found": (404, "The resource does not exist"),
    "method-not-allowed": (405, "The method is not allowed"),
    "not-acceptable": (406, "The accepted formats are not available"),
    "body-late": (408, "The body did not arrive in time"),
    "too-large": (413, "The body is too large"),
    "media-type": (415, "The media type is not supported"),
    "invalid-input": (422, "The input is invalid"),
    "too-many-requests": (429, "Too many requests"),
    "internal": (500, "Internal error"),
    "busy": (503, "The service is busy"),
    "timeout": (504, "The computation timed out"),
}
"""Kind of problem -> status and title; its type is the path `/problems/KIND`."""


@dataclass(eq=False)
class Problem(Exception):
    """A request that is not answered, and why."""

    kind: str
    detail: str = ""
    faults: tuple[Fault, ...] = ()
    headers: Mapping[str, str] = field(default_factory=dict)

    @property
    def status(self) -> int:
        """HTTP status."""
        return TITLES[self.kind][0]

    def document(self, instance: str = "") -> dict[str, Any]:
        """The problem as a document.

        Examples
        --------
        >>> Problem("busy").document()["type"]
        '/problems/busy'
        """
        status, title = TITLES[self.kind]
        found: dict[str, Any] = {"type": f"/problems/{self.kind}", "title": title, "status": status}
        if self.detail:
            found["detail"] = self.detail
        if instance:
            found["instance"] = instance
        if self.faults:
            found["faults"] = [shortened(fault) for fault in self.faults[:MOST_FAULTS]]
            left = len(self.faults) - MOST_FAULTS
            found["detail"] = "; ".join(f"{f['where']}: {f['what']}" for f in found["faults"][:3])
            if left > 0:
                found["more_faults"] = left
        return found

    def response(self, instance: str = "") -> Response:
        """The problem as an HTTP response."""
        content = orjson.dumps(self.document(instance))
        return Response(content, self.status, dict(self.headers), MEDIA_TYPE)


def shortened(fault: Fault) -> dict[str, str]:
    """A fault as plain values that orjson takes, none of them long."""
    return {name: _printable(text) for name, text in asdict(fault).items() if text}


def _printable(text: str) -> str:
    return text[:LONGEST_TEXT].encode("utf-8", "replace").decode()


def invalid(faults: Sequence[Fault]) -> Problem:
    """The problem of an input with faults."""
    return Problem("invalid-input", faults=tuple(faults))
