"""Requests to servers that a user names by URL, with time-outs, retries, bounded answers and keys that no message shows.

Nothing is sent unless a URL is set. `httpx` is part of the extra `tripwatt[routing]`; only its transport is used, because
the `httpx` client logs URLs, and a URL may contain a key.
"""

from __future__ import annotations

import os
import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, cast
from urllib.parse import urlsplit

from tripwatt.errors import InvalidInput, RemoteError, install, require_extras
from tripwatt.routes.documents import Node, parse_json

if TYPE_CHECKING:
    import httpx

_TOTAL_TIMEOUT_S: Final = 15.0
"""Longest time [s] of one request with its retries and its answer; a choice, because a person waits for the answer."""

MAX_ANSWER_BYTES: Final = 32 * 1024 * 1024
"""Largest answer [bytes]: a route of 10,000 km with all its points has less."""

_ATTEMPTS: Final = 3
"""Attempts of one request. A choice: the pauses between three attempts take 0.6 s in all."""
_FIRST_PAUSE_S: Final = 0.2
"""Pause [s] before the second attempt, a choice; each further pause is twice as long."""

EXTRA: Final = install("routing")
"""Command that installs the packages for servers."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Status and body of an HTTP answer."""

    status: int
    body: bytes


@contextmanager
def as_remote() -> Iterator[None]:
    """Raise `RemoteError` in place of `InvalidInput`: a fault in an answer is the server's, not the user's."""
    try:
        yield
    except RemoteError:
        raise
    except InvalidInput as error:
        raise RemoteError(error.faults) from error


def require_object(value: Any, where: str) -> Node:
    """The value of a server's answer as a `Node`, after a check that it is a JSON object.

    Raises
    ------
    RemoteError
        When the value is not a JSON object.
    """
    with as_remote():
        node = Node(value, where)
        node.members()
    return node


def require_url(url: str, where: str) -> str:
    """The URL of a server without a slash at its end.

    Raises
    ------
    InvalidInput
        When the text is not an HTTP URL with a host, or contains a user name, a password, a query or a fragment.

    Examples
    --------
    >>> require_url("http://127.0.0.1:8002/", "--router")
    'http://127.0.0.1:8002'
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port  # `port` raises ValueError if it is invalid
        is_http = parts.scheme in ("http", "https") and bool(host)
    except ValueError:
        is_http = False
    if not is_http or parts.username or parts.password or parts.query or parts.fragment:
        got = url.rpartition("@")[2][:60]  # no password in a message
        allowed = "http://HOST[:PORT][/PATH] or https://..., without user name and query"
        raise InvalidInput.of("not the URL of a server", where, got, allowed)
    return url.rstrip("/")


@dataclass(frozen=True)
class WebClient:
    """A client of one server over HTTP.

    Attributes
    ----------
    base_url : str
    what : str
        What messages call the server, for example "the router".
    key_variable : str
        Environment variable of the key; empty for a server without keys.
    key_place : str
        `header:NAME` or `query:NAME`: where the server expects the key.
    timeout_s : float
        Longest time [s] of one request with its retries.
    pause : callable
        Waits for a given time [s].
    transport : httpx.BaseTransport, optional
        Sends the requests; by default the client opens its own connections.
    """

    base_url: str
    what: str = "the server"
    key_variable: str = ""
    key_place: str = "header:Authorization"
    timeout_s: float = _TOTAL_TIMEOUT_S
    pause: Callable[[float], object] = time.sleep
    transport: httpx.BaseTransport | None = field(default=None, repr=False, compare=False)

    @property
    def host(self) -> str:
        """Host and port of the server, for messages."""
        return urlsplit(self.base_url).netloc

    def get_json(self, path: str, query: Mapping[str, Any] | None = None) -> Any:
        """The JSON document of the answer to a GET request. See `post_json`."""
        return self._document(self.request("GET", path, query=query))

    def post_json(self, path: str, body: Any) -> Any:
        """The JSON document of the answer to a POST request with a JSON body.

        The status may be any but 401, 403, 429, 502, 503 and 504; another one of 500 or above only if the body is a JSON object.

        Raises
        ------
        RemoteError
            When the server does not answer in time, refuses the key, fails, or the answer is too large or not JSON.
        """
        return self._document(self.request("POST", path, body=body))

    def request(
        self, method: str, path: str, *, body: Any = None, query: Mapping[str, Any] | None = None
    ) -> Answer:
        """Send a request and return the answer; repeat the request after failures that may pass.

        Raises
        ------
        RemoteError
            As `post_json`, except that the body of a status below 500 need not be JSON.
        """
        deadline = time.monotonic() + self.timeout_s
        for attempt in range(1, _ATTEMPTS + 1):
            answer = self._attempt(method, path, body, query, deadline)
            # after these statuses another attempt may succeed
            if isinstance(answer, Answer) and answer.status not in (429, 502, 503, 504):
                return self._check_status(answer)
            wait_s = _FIRST_PAUSE_S * 2.0 ** (attempt - 1)
            if attempt == _ATTEMPTS or time.monotonic() + wait_s >= deadline:
                break
            self.pause(wait_s)
        got = f"status {answer.status}" if isinstance(answer, Answer) else answer
        fix = "check the URL, or try again later"
        raise RemoteError.of(f"{self.what} does not respond", self.host, got, fix=fix)

    def _check_status(self, answer: Answer) -> Answer:
        if answer.status in (401, 403):
            fix = f"set {self.key_variable} to a valid key" if self.key_variable else "use another server"
            raise RemoteError.of(f"{self.what} refuses access", self.host, f"status {answer.status}", "", fix)
        if answer.status >= 500 and not answer.body.lstrip().startswith(b"{"):
            raise RemoteError.of(f"{self.what} failed", self.host, f"status {answer.status}")
        return answer

    def _attempt(
        self, method: str, path: str, body: Any, query: Mapping[str, Any] | None, deadline: float
    ) -> Answer | str:
        """The answer, or a text that says why there is none."""
        httpx = _httpx()
        remaining_s = max(deadline - time.monotonic(), 0.05)
        # a reachable server accepts a connection within 3 s
        timeout = httpx.Timeout(remaining_s, connect=min(3.0, remaining_s))
        try:
            request = httpx.Request(
                method,
                self.base_url + path,
                params={**(query or {}), **self._key("query")} or None,
                json=body,
                headers={"Accept": "application/json", "User-Agent": "tripwatt", **self._key("header")},
                extensions={"timeout": timeout.as_dict()},
            )
            # not with httpx.Client, which logs the URL of each request, and the URL may contain the key
            response = self._connections.handle_request(request)
            try:
                return Answer(response.status_code, self._body(response, request, deadline))
            finally:
                response.close()
        except httpx.TimeoutException:
            return f"no answer within {self.timeout_s:g} s"
        except (httpx.TransportError, httpx.InvalidURL, httpx.DecodingError) as error:
            return type(error).__name__.removesuffix("Error").lower() + " failed"

    def _body(self, response: httpx.Response, request: httpx.Request, deadline: float) -> bytes:
        """The body of an answer, unless the answer is too large or comes after the deadline."""
        httpx = _httpx()
        response.request = request
        parts, size = [], 0
        for part in response.iter_bytes():
            size += len(part)
            if size > MAX_ANSWER_BYTES:
                raise RemoteError.of("answer too large", self.host, f"more than {MAX_ANSWER_BYTES} bytes")
            if time.monotonic() > deadline:
                raise httpx.ReadTimeout("slow answer", request=request)
            parts.append(part)
        return b"".join(parts)

    def _document(self, answer: Answer) -> Any:
        try:
            return parse_json(answer.body, self.host)
        except InvalidInput as error:
            got = f"status {answer.status}, {len(answer.body)} bytes"
            raise RemoteError.of(f"{self.what} gives no JSON", self.host, got, "JSON") from error

    def _key(self, place: str) -> dict[str, str]:
        """Name and value of the key if the server expects it in this place, "query" or "header"; else empty."""
        expected, _, name = self.key_place.partition(":")
        key = os.environ.get(self.key_variable, "").strip() if self.key_variable else ""
        return {name: key} if expected == place and key else {}

    @cached_property
    def _connections(self) -> httpx.BaseTransport:
        """The transport of all requests, which keeps connections open and is closed when the client is deleted."""
        if self.transport is not None:
            return self.transport
        transport = _httpx().HTTPTransport(trust_env=False)
        weakref.finalize(self, transport.close)
        return cast("httpx.BaseTransport", transport)


def _httpx() -> Any:
    require_extras({"routing": "a server by URL"})
    import httpx  # slow to import

    return httpx
