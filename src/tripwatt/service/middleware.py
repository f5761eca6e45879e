"""What every request passes on its way in and every answer on its way out: one plain ASGI layer.

In: is the host served, is the token right, is it too often. Out: request id, security headers, the access log, the
counts. Whatever goes wrong inside becomes a problem document.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from tripwatt.service.metrics import Metrics
from tripwatt.service.problems import Problem
from tripwatt.service.settings import Settings

OPEN: Final = ("/healthz", "/readyz")
"""Paths that need no token and are never too often."""

GUARDED: Final = ("/v1/", "/metrics", "/openapi.json")
"""Paths that need the token where there is one; the page itself holds no secret."""

REQUEST_ID: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
MOST_CLIENTS: Final = 10_000
"""Clients whose requests are counted; the ones not seen for longest are forgotten."""

HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "font-src 'self'; connect-src 'self'; manifest-src 'self'; worker-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}


class Buckets:
    """Token buckets by client: `burst` at once, `rate_per_s` on average.

    Examples
    --------
    >>> buckets = Buckets(rate_per_s=1.0, burst=2)
    >>> [buckets.wait_s("a", now) for now in (0.0, 0.0, 0.0, 1.0)]
    [0.0, 0.0, 1.0, 0.0]
    """

    def __init__(self, rate_per_s: float, burst: int) -> None:
        self.rate, self.burst = rate_per_s, float(burst)
        self.left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, client: str, now: float) -> float:
        """0 if the client may go on, else how long it has to wait [s]."""
        left, then = self.left.pop(client, (self.burst, now))
        left = min(self.burst, left + (now - then) * self.rate)
        wait = 0.0 if left >= 1.0 else (1.0 - left) / self.rate
        self.left[client] = (left if wait else left - 1.0, now)
        if len(self.left) > MOST_CLIENTS:
            self.left.popitem(last=False)
        return wait


def counted_client(address: str) -> str | None:
    """Whose requests are counted together: an IPv4 address, the /64 of an IPv6 one; None for this machine itself.

    Examples
    --------
    >>> counted_client("127.0.0.1"), counted_client("203.0.113.9"), counted_client("2001:db8::1:2")
    (None, '203.0.113.9', '2001:db8::/64')
    """
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return address
    if found.is_loopback:
        return None
    return str(found) if found.version == 4 else str(ipaddress.ip_network((int(found), 64), strict=False))


class Gate:
    """The layer around the application.

    Parameters
    ----------
    app : ASGI application
    settings : Settings
    metrics : Metrics
    log : callable
        Takes one access record as keywords.
    """

    def __init__(self, app: ASGIApp, settings: Settings, metrics: Metrics, log: Callable[..., None]) -> None:
        self.app, self.settings, self.metrics, self.log = app, settings, metrics, log
        self.token = settings.token.encode()
        limits = settings.limits
        self.buckets = Buckets(limits.rate_per_s, limits.burst) if limits.rate_per_s > 0 else None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        await _Passage(self, scope).go(receive, send)

    def check(self, scope: Scope, headers: Headers) -> None:
        """Raise the `Problem` of a request that may not go in."""
        self._check_host(headers.getlist("host"))
        path = scope["path"]
        if path in OPEN:
            return
        client = counted_client(scope["client"][0]) if scope.get("client") else None
        if self.buckets is not None and client is not None:
            wait = self.buckets.wait_s(client, time.monotonic())
            if wait > 0.0:
                after = str(max(1, round(wait + 0.5)))
                raise Problem("too-many-requests", f"wait {after} s", headers={"Retry-After": after})
        if self.token and path.startswith(GUARDED):
            self._check_token(headers.getlist("authorization"))

    def _check_host(self, hosts: list[str]) -> None:
        allowed = self.settings.hosts
        if not allowed:
            return
        name = (
            hosts[0].rsplit(":", 1)[0] if len(hosts) == 1 and not hosts[0].endswith("]") else "".join(hosts)
        )
        if len(hosts) != 1 or name.lower() not in allowed:
            raise Problem("host-not-served", "the Host header names another host")

    def _check_token(self, given: list[str]) -> None:
        kind, _, token = (given[0] if len(given) == 1 else "").partition(" ")
        # the comparison takes as long for any token
        same = hmac.compare_digest(token.strip().encode("utf-8", "replace"), self.token)
        if kind.lower() != "bearer" or not same:
            challenge = 'Bearer realm="tripwatt"'
            raise Problem(
                "token-needed", "Authorization: Bearer ...", headers={"WWW-Authenticate": challenge}
            )


class _Passage:
    """One request on its way."""

    def __init__(self, gate: Gate, scope: Scope) -> None:
        self.gate, self.scope = gate, scope
        self.headers = Headers(scope=scope)
        given = self.headers.get("x-request-id", "")
        self.request_id = given if REQUEST_ID.fullmatch(given) else secrets.token_hex(8)
        self.status, self.sent, self.finished = 0, 0, False
        self.started = time.perf_counter()

    async def go(self, receive: Receive, send: Send) -> None:
        """Check it, hand it on, and see the answer out."""
        gate = self.gate
        self.scope["state"] = {**self.scope.get("state", {}), "request_id": self.request_id}
        gate.metrics.running.inc()
        error = ""

        async def out(message: Message) -> None:
            if message["type"] == "http.response.start":
                self.status = message["status"]
                self._dress(message)
            elif message["type"] == "http.response.body":
                self.sent += len(message.get("body", b""))
                self.finished = not message.get("more_body", False)
            await send(message)

        try:
            try:
                gate.check(self.scope, self.headers)
                await gate.app(self.scope, receive, out)
            except Problem as problem:
                await self._answer(problem, receive, out)
            except Exception as found:
                error = repr(found)
                if not self.finished:
                    await self._answer(Problem("internal"), receive, out)
        finally:
            gate.metrics.running.dec()
            self._record(error)

    async def _answer(self, problem: Problem, receive: Receive, out: Send) -> None:
        if self.status:  # half of an answer is out: the connection is all that can tell
            raise RuntimeError(f"failed while answering: {problem.kind}") from problem
        await problem.response(self.request_id)(self.scope, receive, out)

    def _dress(self, message: Message) -> None:
        headers = MutableHeaders(scope=message)
        headers["X-Request-ID"] = self.request_id
        for name, value in HEADERS.items():
            headers[name] = value
        headers.setdefault("Cache-Control", "no-store")

    def _record(self, error: str) -> None:
        seconds = time.perf_counter() - self.started
        route = getattr(self.scope.get("route"), "path", "") or "other"
        method = self.scope["method"] if self.scope["method"] in METHODS else "other"
        metrics = self.gate.metrics
        metrics.requests.labels(route, method, str(self.status)).inc()
        metrics.duration.labels(route).observe(seconds)
        client = self.scope.get("client")
        self.gate.log(
            request_id=self.request_id,
            method=method,
            path=self.scope["path"][:200],
            status=self.status,
            ms=round(1000.0 * seconds, 2),
            bytes=self.sent,
            client=client[0] if client else "",
            **({"error": error} if error else {}),
        )
