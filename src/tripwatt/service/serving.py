"""Listening: a socket, the application, and an end that finishes what runs."""

from __future__ import annotations

import json
import logging
import signal
import socket
import sys
import time
from collections.abc import Callable
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.service.settings import LEAST_TOKEN, TOKEN_VARIABLE, Settings, is_loopback

KEEP_ALIVE_S: Final = 75
"""Longer than proxies keep a connection, so that it is they who close it."""

BACKLOG: Final = 512


def require_safe(settings: Settings) -> None:
    """Refuse to listen to the world without a token.

    Raises
    ------
    InvalidInput
        Also for a token that is too short.

    Examples
    --------
    >>> require_safe(Settings(host="0.0.0.0"))
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: token is missing: --host...
    """
    faults = []
    if not is_loopback(settings.host) and not settings.token:
        fix = f"set {TOKEN_VARIABLE} to a token of {LEAST_TOKEN} characters or more"
        faults.append(
            Fault("token is missing", "--host", settings.host, "a loopback address without a token", fix)
        )
    if settings.token and (len(settings.token) < LEAST_TOKEN or not settings.token.isprintable()):
        allowed = f"{LEAST_TOKEN} printable characters or more"
        faults.append(
            Fault(
                "token is too short or not printable",
                TOKEN_VARIABLE,
                f"{len(settings.token)} characters",
                allowed,
            )
        )
    if settings.workers < 1:
        faults.append(Fault("no workers", "--workers", f"{settings.workers}", "1 or more"))
    if faults:
        raise InvalidInput(faults)


def listening(settings: Settings) -> socket.socket:
    """The socket of the service.

    Raises
    ------
    InvalidInput
        When the address is not this machine's or the port is taken.
    """
    try:
        found = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        family, kind, protocol, _, address = found[0]
        listener = socket.socket(family, kind, protocol)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(BACKLOG)
        except OSError:
            listener.close()
            raise
    except OSError as error:
        got = f"{settings.host} port {settings.port}: {error.strerror or error}"
        raise InvalidInput(
            Fault("cannot listen", "--host, --port", got, "an address of this machine and a free port")
        ) from error
    return listener


def address_of(listener: socket.socket) -> str:
    """What to type into a browser."""
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def serve(settings: Settings, started: Callable[[str], None] = lambda address: None) -> None:
    """Answer until SIGINT or SIGTERM, then finish what runs and return.

    Parameters
    ----------
    settings : Settings
    started : callable
        Told the address as soon as connections are taken.

    Raises
    ------
    InvalidInput
        When it is not safe, the address cannot be had, or a model cannot be used.
    """
    import uvicorn

    from tripwatt.service.app import create_app

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started:
                started(address_of(listener))

    require_safe(settings)
    app = create_app(settings, json_log)
    with listening(settings) as listener:
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=int(settings.limits.timeout_s) + 5,
            lifespan="on",
        )
        logging.getLogger("uvicorn").addHandler(_ToJson())
        for number in (signal.SIGINT, signal.SIGTERM):  # the server raises them again when it is done
            signal.signal(number, lambda *_: None)
        server = Server(config)
        server.run(sockets=[listener])
    if not server.started:
        raise InvalidInput(Fault("service did not start", "workers", fix="see the log"))


def json_log(**record: Any) -> None:
    """One record as a line of JSON on standard error."""
    text = json.dumps({"time": _now(), "event": "request", **record}, ensure_ascii=True)
    sys.stderr.write(text + "\n")


def _now() -> str:
    now = time.time()
    return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(now)) + f".{int(now % 1 * 1000):03d}Z"


class _ToJson(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.WARNING:
            text = self.format(record)
            json_log(event="server", level=record.levelname.lower(), message=text[:4000])
