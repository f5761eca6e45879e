"""ASGI middleware for all requests.

It checks the Host header, the site and the token before the application runs. It adds the request id and
the security headers to the response, writes the access log and counts requests. An exception of the application becomes
a problem document.
"""

from __future__ import annotations

import asyncio
import hmac
import re
import secrets
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from starlette.datastructures import Headers, MutableHeaders, QueryParams
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from tripwatt.errors import excerpt
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.problems import CHALLENGE, Problem
from tripwatt.server.http.settings import Settings
from tripwatt.server.http.sharing import CLIENT, client_key, unmapped

TOKEN_PATHS: Final = ("/v1/", "/metrics", "/openapi.json")
"""First parts of paths that need the token; the files of the page hold no secret."""

CAR_TOKEN_PATHS: Final = ("/v1/telemetry",)
"""Paths that need the token of a car instead, which the application checks."""

VALID_REQUEST_ID: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
KNOWN_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
OWN_SITES: Final = ("same-origin", "none")
"""Values of `Sec-Fetch-Site` of a request that the page of the service, or a person, made."""

FOREIGN_PAUSE_S: Final = 0.2
"""Time before the refusal of a page of another site [s]: a browser has six connections to a service."""

SECURITY_HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "font-src 'self'; connect-src 'self'; manifest-src 'self'; worker-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(self), microphone=(), payment=(), usb=()",
    "Cache-Control": "no-store",
}


class ProxyHeaders(ProxyHeadersMiddleware):
    """Reads the client from `X-Forwarded-For` and the host from `X-Forwarded-Host` of a trusted proxy; ignores those of other peers.

    Parameters
    ----------
    app : ASGI application
    trusted : str
        Addresses and networks of proxies beside loopback, with commas; `*` for all.
    """

    def __init__(self, app: Any, trusted: str = "") -> None:
        super().__init__(app, "*" if trusted.strip() == "*" else f"127.0.0.1,::1,{trusted}")

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Handle one request."""
        if scope["type"] == "http":
            host, trusted = unmapped((scope["client"] or ("",))[0]), self.trusted_hosts
            given = ",".join(Headers(scope=scope).getlist("x-forwarded-for"))
            if host not in trusted:
                scope["headers"] = [header for header in scope["headers"] if header[0] != b"x-forwarded-host"]
            else:  # the last address is the one that the proxy itself has seen
                seen = given.rpartition(",")[2].strip() if trusted.always_trust else given
                host = trusted.get_trusted_client_address(seen)[0] or host
            scope["client"] = (unmapped(host), 0)
        await self.app(scope, receive, send)


class ServiceMiddleware:
    """The middleware around the application.

    Parameters
    ----------
    app : ASGI application
    settings : Settings
    metrics : Metrics
    log : callable
        Called with one record of the access log as keywords.
    """

    def __init__(self, app: ASGIApp, settings: Settings, metrics: Metrics, log: Callable[..., None]) -> None:
        self.app, self.settings, self.metrics, self.log = app, settings, metrics, log
        self.token, self.hosts = settings.token.encode(), settings.hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        prefix, path = self.settings.prefix, scope["path"]
        if prefix and path == prefix:  # the page has relative links
            await RedirectResponse(f"{prefix}/", 308)(scope, receive, send)
            return
        if prefix and path.startswith(f"{prefix}/"):  # a proxy may remove it, too
            scope = {**scope, "path": path.removeprefix(prefix)}
        await _Exchange(self, scope).run(receive, send)

    def check(self, scope: Scope, headers: Headers) -> None:
        """Check the Host header, the site and the token of a request.

        Raises
        ------
        Problem
            `host-not-served`, `foreign-site` or `token-needed`.
        """
        allowed, path = self.hosts, scope["path"]
        names = [re.sub(r":\d*$", "", host).lower() for host in headers.getlist("host")]
        if allowed and (len(names) != 1 or names[0] not in allowed):
            raise Problem("host-not-served", "the Host header does not name this service")
        # an operation that reads takes computing time, too
        if scope["method"] not in ("GET", "HEAD", "OPTIONS") or path.startswith(TOKEN_PATHS):
            _check_site(headers, self.settings.cors_origins)
        if self.token and path.startswith(TOKEN_PATHS) and path not in CAR_TOKEN_PATHS:
            query = scope["query_string"] if path.endswith("/events") else ""
            tokens = [f"Bearer {token}" for token in QueryParams(query).getlist("token")]
            self._check_token(headers.getlist("authorization") or tokens)

    def _check_token(self, given: list[str]) -> None:
        kind, _, token = (given[0] if len(given) == 1 else "").partition(" ")
        # the time of the comparison does not depend on the token
        is_right = hmac.compare_digest(token.strip().encode("utf-8", "replace"), self.token)
        if kind.lower() != "bearer" or not is_right:
            raise Problem("token-needed", "Authorization: Bearer ...", headers=CHALLENGE)


def _check_site(headers: Headers, allowed: Sequence[str]) -> None:
    """Refuse a request that a browser sends for a page of another site, unless its origin is allowed.

    A program other than a browser sends neither `Sec-Fetch-Site` nor `Origin`, and passes.
    """
    site, origin = headers.get("sec-fetch-site"), headers.get("origin")
    host = headers.get("x-forwarded-host", headers.get("host", "")).partition(",")[0].strip()
    is_same = origin is None or origin.lower().partition(":")[2] == f"//{host.lower()}"
    if origin not in allowed and not (is_same if site is None else site in OWN_SITES):
        remedy = "start the service with --cors-origin ORIGIN to allow it; for its own page, let the proxy pass its host as X-Forwarded-Host"
        raise Problem("foreign-site", f"a page of {excerpt(origin or site)} sent the request: {remedy}")


class _Exchange:
    """A request and its response."""

    def __init__(self, middleware: ServiceMiddleware, scope: Scope) -> None:
        self.middleware, self.scope = middleware, scope
        self.headers = Headers(scope=scope)
        given = self.headers.get("x-request-id", "")
        self.request_id = given if VALID_REQUEST_ID.fullmatch(given) else secrets.token_hex(8)
        self.status, self.sent_bytes, self.finished = 0, 0, False
        self.started = time.perf_counter()
        self.client = (scope.get("client") or ("",))[0]

    async def run(self, receive: Receive, send: Send) -> None:
        middleware = self.middleware
        CLIENT.set(client_key(self.client))
        self.scope["state"] = {**self.scope.get("state", {}), "request_id": self.request_id}
        middleware.metrics.running.inc()
        error = ""

        async def send_on(message: Message) -> None:
            if message["type"] == "http.response.start":
                self.status, headers = message["status"], MutableHeaders(scope=message)
                headers["X-Request-ID"] = self.request_id
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
            elif message["type"] == "http.response.body":
                self.sent_bytes += len(message.get("body", b""))
                self.finished = not message.get("more_body", False)
            await send(message)

        try:
            middleware.check(self.scope, self.headers)
            if self.scope["method"] == "HEAD":  # as GET; the server leaves out the body
                self.scope = {**self.scope, "method": "GET", "was_head": True}
            await middleware.app(self.scope, receive, send_on)
        except Problem as problem:
            # a page that repeats it at once takes the time of the loop
            if problem.kind == "foreign-site":
                await asyncio.sleep(FOREIGN_PAUSE_S)
            await self._respond(problem, receive, send_on)
        except Exception as exception:
            error = repr(exception)
            if not self.finished:
                await self._respond(Problem("internal"), receive, send_on)
        finally:
            middleware.metrics.running.dec()
            self._log(error)

    async def _respond(self, problem: Problem, receive: Receive, send_on: Send) -> None:
        if self.status:  # the response has begun: only closing the connection can report the failure
            raise RuntimeError(f"failed during the response: {problem.kind}") from problem
        await problem.response(self.request_id)(self.scope, receive, send_on)

    def _log(self, error: str) -> None:
        seconds = time.perf_counter() - self.started
        route = getattr(self.scope.get("route"), "path", "") or "other"
        given = "HEAD" if self.scope.get("was_head") else self.scope["method"]
        method = given if given in KNOWN_METHODS else "other"
        metrics = self.middleware.metrics
        metrics.requests.labels(route, method, str(self.status)).inc()
        metrics.duration.labels(route).observe(seconds)
        self.middleware.log(
            request_id=self.request_id,
            method=method,
            path=self.scope["path"][:200],
            status=self.status,
            ms=round(1000.0 * seconds, 2),
            bytes=self.sent_bytes,
            client=self.client,
            **({"error": error} if error else {}),
        )
