"""Problem documents (RFC 9457): the responses to requests that cannot be served."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import orjson
from starlette.responses import Response

from tripwatt.errors import Fault, InvalidInput, RemoteError
from tripwatt.files import shipped_toml

MEDIA_TYPE: Final = "application/problem+json"
MAX_FAULTS: Final = 50
"""Faults that one document lists; the others are counted. A choice: nobody mends more at once."""

MAX_TEXT_LENGTH: Final = 300
"""Most characters of a text of a fault, so that a document does not repeat a large input. A choice."""

CHALLENGE: Final = {"WWW-Authenticate": 'Bearer realm="tripwatt"'}
"""Headers of the problem `token-needed`."""

WORDS: Final[Mapping[str, Any]] = shipped_toml("server/http/words.toml")
"""Texts of the service."""

TITLES: Final[Mapping[str, tuple[int, str]]] = WORDS["problems"]
"""Kind of problem -> status and title; its type is the path `/problems/KIND`."""


@dataclass(eq=False)
class Problem(Exception):
    """The reason why a request cannot be served.

    Attributes
    ----------
    kind : str
        A key of `TITLES`.
    detail : str
    faults : tuple of Fault
        Faults of the input.
    headers : mapping of str to str
        Headers of the response.
    """

    kind: str
    detail: str = ""
    faults: tuple[Fault, ...] = ()
    headers: Mapping[str, str] = field(default_factory=dict)

    @property
    def status(self) -> int:
        """HTTP status of the kind."""
        return TITLES[self.kind][0]

    def document(self, instance: str = "") -> dict[str, Any]:
        """Return the problem as a document.

        Parameters
        ----------
        instance : str
            Id of the request.

        Examples
        --------
        >>> Problem("busy").document()["type"]
        '/problems/busy'
        """
        status, title = TITLES[self.kind]
        document: dict[str, Any] = {"type": f"/problems/{self.kind}", "title": title, "status": status}
        texts = {"detail": self.detail, "instance": instance}
        document |= {name: text for name, text in texts.items() if text}
        if self.faults:
            document["faults"] = [*map(placed_document, self.faults[:MAX_FAULTS])]
            unlisted = len(self.faults) - MAX_FAULTS
            document["detail"] = "; ".join(f"{f['where']}: {f['what']}" for f in document["faults"][:3])
            if unlisted > 0:
                document["more_faults"] = unlisted
        return document

    def response(self, instance: str = "") -> Response:
        """Return the problem as an HTTP response; `instance` is the id of the request."""
        return Response(orjson.dumps(self.document(instance)), self.status, dict(self.headers), MEDIA_TYPE)


def fault_document(fault: Fault) -> dict[str, str]:
    """Return the fields of a fault that are not empty, with long texts cut and unencodable characters replaced."""
    cut = {name: text[:MAX_TEXT_LENGTH] for name, text in fault.texts.items()}
    return {name: text.encode("utf-8", "replace").decode() for name, text in cut.items()}


def placed_document(fault: Fault) -> dict[str, str]:
    """Return the fields of a fault, and the `pointer` or the `parameter` of its place in the request if it has one."""
    document, (place, _, name) = fault_document(fault), fault.where.partition(".")
    if fault.at is None:
        return document | ({"parameter": name} if place == "query" else {})
    if fault.at[:1] == ("query",) and len(fault.at) > 1:  # no request has such an object
        return document | {"where": f"query.{document['where']}", "parameter": f"{fault.at[1]}"}
    pointer = json_pointer(fault.at)
    return document | ({"pointer": pointer} if len(pointer) <= MAX_TEXT_LENGTH else {})


def json_pointer(steps: Iterable[str | int]) -> str:
    """Return the JSON pointer (RFC 6901) of a place in the body of a request.

    Examples
    --------
    >>> json_pointer(["samples", "speed_m_s", 3]), json_pointer(["km/h"]), json_pointer([])
    ('/samples/speed_m_s/3', '/km~1h', '')
    """
    return "".join("/" + f"{step}".replace("~", "~0").replace("/", "~1") for step in steps)


def problem_of(error: Problem | InvalidInput) -> Problem:
    """Return the problem that an error is, or that its faults are.

    Examples
    --------
    >>> problem_of(InvalidInput([])).kind, problem_of(RemoteError([])).kind, problem_of(Problem("busy")).kind
    ('invalid-input', 'remote', 'busy')
    """
    if isinstance(error, Problem):
        return error
    return Problem("remote" if isinstance(error, RemoteError) else "invalid-input", faults=error.faults)
