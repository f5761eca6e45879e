"""Running the service: the socket, the HTTP server, its log, and a shutdown that finishes running requests."""

from __future__ import annotations

import logging
import os
import re
import signal
import socket
from collections.abc import Callable, Iterator
from typing import Final

from tripwatt.errors import Fault, InvalidInput, raise_faults, system_errors
from tripwatt.server.http.log import JsonHandler, log_json
from tripwatt.server.http.settings import MIN_TOKEN_LENGTH, SECRETS, TOKEN_VARIABLE, Settings, is_loopback

KEEP_ALIVE_S: Final = 75
"""Time that an idle connection stays open; longer than in common proxies, so that the proxy closes it."""


def require_safe(settings: Settings) -> None:
    """Check the settings: addresses other than loopback need a token.

    Raises
    ------
    InvalidInput
        For a missing token, a token that is too short or not printable, no workers, an invalid prefix, or an invalid origin.

    Examples
    --------
    >>> require_safe(Settings(host="0.0.0.0"))
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: token is missing: --host...
    """
    raise_faults(_unsafe_faults(settings))


def _unsafe_faults(settings: Settings) -> Iterator[Fault]:
    if not is_loopback(settings.host) and not settings.token:
        fix = f"set {TOKEN_VARIABLE} to a token of {MIN_TOKEN_LENGTH} characters or more"
        yield Fault("token is missing", "--host", settings.host, "a loopback address without a token", fix)
    if settings.token and (len(settings.token) < MIN_TOKEN_LENGTH or not settings.token.isprintable()):
        got, allowed = f"{len(settings.token)} characters", f"{MIN_TOKEN_LENGTH} printable characters or more"
        yield Fault("token is too short or not printable", TOKEN_VARIABLE, got, allowed)
    if settings.workers < 1:
        yield Fault("no workers", "--workers", f"{settings.workers}", "1 or more")
    if not re.fullmatch(r"(/[\w.~-]+)*", settings.prefix, re.ASCII):
        yield Fault("no path", "--prefix", settings.prefix, "a path such as /tripwatt")
    for origin in settings.cors_origins:
        if not re.fullmatch(r"https?://[^/?#*\s]+", origin):
            yield Fault("no origin", "--cors-origin", origin, "an origin such as https://example.org")


def open_socket(settings: Settings) -> socket.socket:
    """Open the socket that the service listens on.

    Raises
    ------
    InvalidInput
        When the address is not an address of this machine, or the port is in use.
    """
    allowed = "an address of this machine and a free port"
    with system_errors("cannot listen", "--host, --port", allowed, f"{settings.host} port {settings.port}"):
        (family, _, _, _, address), *_ = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        return socket.create_server(address[:2], family=family, backlog=512)


def url_of(listener: socket.socket) -> str:
    """Return the URL of a listening socket."""
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def serve(settings: Settings, on_start: Callable[[str], None] = lambda url: None) -> None:
    """Serve requests until SIGINT or SIGTERM, then finish running requests and return.

    Parameters
    ----------
    settings : Settings
    on_start : callable
        Called with the URL when the service accepts connections.

    Raises
    ------
    InvalidInput
        When the settings are not safe, the address is not available, or a model cannot be used.
    """
    import uvicorn

    from tripwatt.server.http.app import create_app
    from tripwatt.server.http.middleware import ProxyHeaders
    from tripwatt.server.http.protocol import BoundedProtocol
    from tripwatt.server.http.worker import ENVIRONMENT

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started:
                on_start(url_of(listener))

    require_safe(settings)
    os.environ.update(ENVIRONMENT)
    for name in SECRETS:
        os.environ.pop(name, None)
    app = ProxyHeaders(create_app(settings, log_json), os.environ.get("FORWARDED_ALLOW_IPS", ""))
    with open_socket(settings) as listener:
        config = uvicorn.Config(
            app,
            http=BoundedProtocol,
            proxy_headers=False,  # `ProxyHeaders` has read them
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=int(settings.limits.timeout_s) + 5,  # seconds to send what is done
            lifespan="on",
        )
        logging.getLogger("uvicorn").addHandler(JsonHandler(logging.WARNING))
        for number in (signal.SIGINT, signal.SIGTERM):  # the server raises them again after its shutdown
            signal.signal(number, lambda *_: None)
        server = Server(config)
        server.run(sockets=[listener])
    if not server.started:
        raise InvalidInput.of("service did not start", "workers", fix="see the log")
