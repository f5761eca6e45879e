"""Which settings are safe, the socket, its URL and the lines of the log."""

from __future__ import annotations

import json
import logging
import signal
import socket
import time
from typing import Any

import pytest
import uvicorn
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.server.http import app, serving
from tripwatt.server.http.log import log_json
from tripwatt.server.http.protocol import BoundedProtocol
from tripwatt.server.http.serving import open_socket, require_safe, serve, url_of
from tripwatt.server.http.settings import Limits, Settings


def refusals(**settings: Any) -> list[str]:
    try:
        require_safe(Settings(**settings))
    except InvalidInput as error:
        return [f"{fault.what}: {fault.got}" for fault in error.faults]
    return []


def test_other_addresses_need_a_token() -> None:
    assert refusals(host="0.0.0.0") == ["token is missing: 0.0.0.0"]
    assert refusals(host="myhost") == ["token is missing: myhost"]
    assert refusals(host="0.0.0.0", token="x" * 16) == []
    assert refusals(host="127.0.0.1") == []
    assert refusals(host="127.0.0.1", token="x" * 16) == []


def test_a_token_has_16_printable_characters() -> None:
    assert refusals(token="x" * 15) == ["token is too short or not printable: 15 characters"]
    assert refusals(token="x" * 16) == []
    assert refusals(token="x" * 20 + "\n") == ["token is too short or not printable: 21 characters"]


def test_there_is_a_worker() -> None:
    assert refusals(workers=1) == []
    assert refusals(workers=0) == ["no workers: 0"]


def test_a_prefix_is_a_path_and_an_origin_has_none() -> None:
    assert refusals(prefix="/tripwatt", cors_origins=("https://a.example:8443", "http://localhost")) == []
    assert refusals(prefix="tripwatt") == ["no path: tripwatt"]
    assert refusals(prefix="/a//b") == ["no path: /a//b"]
    wrong = ("*", "https://a.example/", "a.example", "https://*.example")
    assert refusals(cors_origins=wrong) == [f"no origin: {origin}" for origin in wrong]


class Listener:
    """A socket at an address."""

    def __init__(self, *address: Any) -> None:
        self.address = address

    def getsockname(self) -> tuple[Any, ...]:
        return self.address


def test_the_url_of_a_socket() -> None:
    assert url_of(Listener("127.0.0.1", 8000)) == "http://127.0.0.1:8000"  # type: ignore[arg-type]
    assert url_of(Listener("::1", 8000, 0, 0)) == "http://[::1]:8000"  # type: ignore[arg-type]


noted: list[tuple[Any, ...]] = []


def test_a_socket_listens_on_a_free_port() -> None:
    with open_socket(Settings(port=0)) as listener:
        assert listener.getsockname()[0] == "127.0.0.1"
        assert listener.getsockname()[1] > 0
        assert listener.type == socket.SOCK_STREAM


def test_a_port_in_use_is_a_fault() -> None:
    with open_socket(Settings(port=0)) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(InvalidInput) as caught:
            open_socket(Settings(port=port))
    (fault,) = caught.value.faults
    assert (fault.what, fault.where) == ("cannot listen", "--host, --port")
    assert fault.got.startswith(f"127.0.0.1 port {port}: Address already in use")


def test_a_record_of_the_log_is_a_line_of_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(time, "time", lambda: 86_400.0 + 3661.25)
    log_json(path="/ü")
    log_json(event="bug")
    first, second, rest = capsys.readouterr().err.split("\n")
    assert first == '{"time": "1970-01-02T01:01:01.250Z", "event": "request", "path": "/\\u00fc"}'
    assert (json.loads(second)["event"], rest) == ("bug", "")


class Configured:
    """What the HTTP server was configured with; it runs no longer than it is asked to."""

    def __init__(self) -> None:
        self.options: dict[str, Any] = {}
        self.app: Any = None


@pytest.fixture
def configured(monkeypatch: pytest.MonkeyPatch) -> Configured:
    found = Configured()
    config = uvicorn.Config

    def noted_config(app: Any, **options: Any) -> uvicorn.Config:
        found.app, found.options = app, options
        return config(app, **options)

    def run(server: uvicorn.Server, sockets: list[socket.socket]) -> None:
        assert len(sockets) == 1
        logging.getLogger("uvicorn.error").warning("x" * 5000)
        logging.getLogger("uvicorn.error").info("not in the log")
        server.started = server.config.timeout_graceful_shutdown != 12

    monkeypatch.setattr(uvicorn, "Config", noted_config)
    monkeypatch.setattr(uvicorn.Server, "run", run)
    monkeypatch.setattr(app, "create_app", lambda settings, log: (settings, log))
    monkeypatch.setattr(signal, "signal", lambda *given: noted.append(given))
    monkeypatch.setattr(logging.getLogger("uvicorn"), "handlers", [])
    return found


def test_the_server_has_its_times_and_protocol(configured: Configured) -> None:
    noted.clear()
    settings = Settings(port=0, limits=Limits(timeout_s=30.9))
    serve(settings)
    assert configured.app.app == (settings, log_json)
    assert configured.options == {
        "http": BoundedProtocol,
        "proxy_headers": False,
        "log_config": None,
        "access_log": False,
        "server_header": False,
        "timeout_keep_alive": 75,
        "timeout_graceful_shutdown": 35,
        "lifespan": "on",
    }
    assert [number for number, _ in noted] == [signal.SIGINT, signal.SIGTERM]
    assert [handler(0, None) for _, handler in noted] == [None, None]


def test_warnings_of_the_server_are_logged_with_at_most_4000_characters(
    configured: Configured, capsys: pytest.CaptureFixture[str]
) -> None:
    serve(Settings(port=0))
    (line,) = capsys.readouterr().err.splitlines()
    record = json.loads(line)
    assert (record["event"], record["level"], record["message"]) == ("server", "warning", "x" * 4000)


def test_a_server_that_did_not_start_is_a_fault(configured: Configured) -> None:
    refuses("service did not start", serve, Settings(port=0, limits=Limits(timeout_s=7.0)))


def test_settings_that_are_not_safe_do_not_start(configured: Configured) -> None:
    refuses("token is missing", serve, Settings(host="0.0.0.0", port=0))
    assert configured.options == {}
    assert serving.KEEP_ALIVE_S == 75
