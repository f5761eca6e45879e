"""Token, limits, media types, headers and the log, as every request meets them."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Iterator
from typing import Any

import httpx
import orjson
import pytest
from tests.support.service_process import TOKEN, Service, serving

from tripwatt.server.http import middleware
from tripwatt.server.http.metrics import Metrics
from tripwatt.server.http.middleware import ProxyHeaders, ServiceMiddleware
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Settings
from tripwatt.server.http.sharing import client_key

JSON = {"Content-Type": "application/json"}


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service for other machines, with small limits."""
    limits = ("body_bytes=20000", "samples=400", "links=50", "batch=3", "batch_bytes=50000", "waiting=1")
    options = [option for limit in limits for option in ("--limit", limit)]
    folder = tmp_path_factory.mktemp("strict")
    arguments = ("--host", "0.0.0.0", "--workers", "1", "--limit", "body_timeout_s=1", *options)
    with serving(folder, *arguments, token=TOKEN) as found:
        found.client.headers["Authorization"] = f"Bearer {TOKEN}"
        yield found


def test_requests_without_the_token_are_refused(strict: Service) -> None:
    for path in ("/v1/models", "/metrics", "/openapi.json", "/v1/nothing"):
        answer = httpx.get(f"{strict.url}{path}", headers={"Authorization": f"Bearer {TOKEN}x"})
        assert (answer.status_code, answer.json()["type"]) == (401, "/problems/token-needed")
        assert httpx.get(f"{strict.url}{path}").status_code == 401


def test_a_stream_takes_the_token_of_its_address_which_is_not_logged(strict: Service) -> None:
    """An EventSource of a browser sends no header; other operations do not take it so."""
    for path, given, status in (
        ("/v1/events", TOKEN, 501),
        ("/v1/live/leaf/events", TOKEN, 501),
        ("/v1/events", f"{TOKEN}x", 401),
        ("/v1/models", TOKEN, 401),
    ):
        answer = httpx.get(f"{strict.url}{path}", params={"token": given})
        assert answer.status_code == status, path
    assert TOKEN not in strict.log.read_text()


def test_health_needs_no_token_and_the_token_gives_access(strict: Service) -> None:
    assert strict.client.get("/healthz", headers={"Authorization": ""}).status_code == 200
    assert strict.client.get("/readyz", headers={"Authorization": ""}).json()["workers"] == 1
    assert strict.client.get("/v1/models").status_code == 200
    assert TOKEN not in strict.log.read_text()


def test_inputs_above_the_limits_are_refused(strict: Service, drive: dict[str, Any]) -> None:
    post = strict.client.post
    long = {"samples": {"time_s": list(range(500)), "speed_m_s": [1] * 500}}
    many = {"links": [{"length_m": 100, "speed_m_s": 10}] * 60}
    assert post("/v1/forecast", json=long).json()["faults"][0]["what"] == "too many samples"
    assert post("/v1/forecast", json=many).json()["faults"][0]["what"] == "too many links"
    assert post("/v1/routes", json=many).json()["faults"][0]["what"] == "too many links"
    assert post("/v1/forecast", content=b" " * 20001, headers=JSON).status_code == 413
    lines = {"Content-Type": "application/x-ndjson"}
    assert post("/v1/forecast/batch", content=b"{}\n" * 4, headers=lines).status_code == 413
    assert post("/v1/forecast/batch", content=b"\n\n", headers=lines).status_code == 422
    wide = post("/v1/forecast/batch", content=b'{"trip":"' + b"x" * 20000 + b'"}', headers=lines)
    assert orjson.loads(wide.content)["status"] == 413


def test_a_body_is_counted_as_it_arrives(strict: Service) -> None:
    """Without a Content-Length; the response arrives before the body is complete."""

    def endless() -> Iterator[bytes]:
        for _ in range(30):
            yield b" " * 1000

    answer = strict.client.post("/v1/forecast", content=endless(), headers=JSON)
    assert answer.status_code == 413
    assert answer.headers["connection"] == "close"


def test_a_body_that_does_not_arrive_times_out(strict: Service) -> None:
    with socket.create_connection(("127.0.0.1", strict.port), timeout=10) as connection:
        head = f"POST /v1/forecast HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {TOKEN}\r\nContent-Length: 9"
        connection.sendall(f"{head}\r\nContent-Type: application/json\r\n\r\n{{".encode())
        assert connection.recv(1000).startswith(b"HTTP/1.1 408")


def test_requests_are_refused_while_the_queue_is_full(strict: Service) -> None:
    """One worker and one waiting request: of many requests at a time, the others get 503."""
    from tests.support.service_load import read_answer, request

    samples = {
        "time_s": [60.0 * k for k in range(400)],
        "speed_m_s": [10.0] * 400,
    }  # a tenth of a second of work
    body = orjson.dumps({"samples": samples})
    head, _, rest = request("/v1/forecast", body).partition(b"\r\n")
    sent = head + f"\r\nAuthorization: Bearer {TOKEN}\r\n".encode() + rest

    async def ask() -> tuple[int, bytes]:
        reader, writer = await asyncio.open_connection("127.0.0.1", strict.port)
        writer.write(sent)
        answer = await read_answer(reader)
        writer.close()
        return answer

    async def together() -> list[tuple[int, bytes]]:
        return await asyncio.gather(*(ask() for _ in range(12)))

    answers = asyncio.run(together())
    statuses = [status for status, _ in answers]
    assert set(statuses) == {200, 503}
    assert statuses.count(200) >= 2
    assert len({body for status, body in answers if status == 200}) == 1


SECRET = "a-token-for-tests-only"


class Application:
    """Answers with what it is told, and notes the requests."""

    def __init__(self) -> None:
        self.messages: list[dict[str, Any]] = [
            {"type": "http.response.start", "status": 200, "headers": []},
            {"type": "http.response.body", "body": b"123", "more_body": True},
            {"type": "http.response.body", "body": b"45"},
        ]
        self.error: Exception | None = None
        self.scopes: list[Any] = []

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.scopes.append(scope)
        for message in self.messages:
            await send(message)
        if self.error is not None:
            raise self.error


class Asked:
    """The middleware around an application, with what it has sent, logged and counted."""

    def __init__(self, settings: Settings | None = None) -> None:
        self.app, self.metrics = Application(), Metrics()
        self.log: list[dict[str, Any]] = []
        self.sent: list[dict[str, Any]] = []
        self.middleware = ServiceMiddleware(
            self.app, settings or Settings(), self.metrics, lambda **record: self.log.append(record)
        )

    def __call__(
        self,
        path: str = "/v1/models",
        method: str = "GET",
        client: str | None = "127.0.0.1",
        headers: list[tuple[str, str]] | None = None,
        **more: Any,
    ) -> int:
        given = [("host", "localhost")] if headers is None else headers
        scope = {
            "type": "http",
            "path": path,
            "method": method,
            "headers": [(name.encode(), value.encode()) for name, value in given],
            "client": None if client is None else (client, 1),
            **more,
        }

        async def send(message: Any) -> None:
            self.sent.append(message)

        self.sent.clear()
        asyncio.run(self.middleware(scope, None, send))  # type: ignore[arg-type]
        return int(self.sent[0]["status"])

    def header(self, name: str) -> str | None:
        found = [value for key, value in self.sent[0]["headers"] if key.lower() == name.lower().encode()]
        return found[0].decode() if found else None

    @property
    def document(self) -> dict[str, Any]:
        return dict(orjson.loads(self.sent[1]["body"]))


@pytest.mark.parametrize(
    ("hosts", "status"),
    [
        (["localhost"], 200),
        (["LocalHost:8000"], 200),
        (["127.0.0.1:1"], 200),
        (["[::1]"], 200),
        (["[::1]:8000"], 200),
        (["evil.example"], 400),
        (["localhost.evil"], 400),
        (["localhost", "localhost"], 400),
        (["local", "host"], 400),
        (["localhost", ""], 400),
        ([""], 400),
        ([], 400),
    ],
)
def test_the_host_header_names_this_machine_once(hosts: list[str], status: int) -> None:
    asked = Asked()
    assert asked(headers=[("host", host) for host in hosts]) == status
    assert status == 200 or asked.document["type"] == "/problems/host-not-served"
    open_to_all = Asked(Settings(host="0.0.0.0"))
    assert open_to_all(headers=[("host", host) for host in hosts]) == 200


@pytest.mark.parametrize(
    ("given", "status"),
    [
        ([f"Bearer {SECRET}"], 200),
        ([f"bearer  {SECRET} "], 200),
        ([f"Bearer {SECRET}x"], 401),
        ([f"Basic {SECRET}"], 401),
        (["Bearer"], 401),
        ([SECRET], 401),
        ([f"Bearer {SECRET}", f"Bearer {SECRET}"], 401),
        ([], 401),
    ],
)
def test_the_token_is_given_once_as_a_bearer(given: list[str], status: int) -> None:
    asked = Asked(Settings(token=SECRET))
    headers = [("host", "localhost"), *(("authorization", value) for value in given)]
    assert [asked(path, headers=headers) for path in ("/v1/models", "/metrics", "/openapi.json")] == [
        status
    ] * 3
    assert status == 200 or asked.header("www-authenticate") == 'Bearer realm="tripwatt"'
    assert [asked(path, headers=headers) for path in ("/", "/healthz", "/assets/a.js")] == [200] * 3
    assert Asked()(headers=headers) == 200


def test_other_connections_are_handed_on() -> None:
    asked = Asked()
    asked.app.messages = []
    asyncio.run(asked.middleware({"type": "lifespan"}, None, None))  # type: ignore[arg-type]
    assert asked.app.scopes == [{"type": "lifespan"}]
    assert asked.log == []


def test_a_valid_id_of_a_request_is_kept_and_another_one_replaced() -> None:
    asked = Asked()
    for valid in ("a", "A-z_0.9", "x" * 64):
        asked(headers=[("host", "localhost"), ("x-request-id", valid)], state={"kept": 1})
        assert asked.header("x-request-id") == asked.log[-1]["request_id"] == valid
        assert asked.app.scopes[-1]["state"] == {"kept": 1, "request_id": valid}
    for wrong in ("", "x" * 65, "a b", "ü"):
        asked(headers=[("host", "localhost"), ("x-request-id", wrong)])
        found = asked.header("x-request-id") or ""
        assert (len(found), int(found, 16) >= 0) == (16, True)


def test_every_response_has_the_security_headers() -> None:
    asked = Asked()
    asked()
    found = {name: asked.header(name) for name in middleware.SECURITY_HEADERS}
    assert found == middleware.SECURITY_HEADERS
    assert asked.header("cache-control") == "no-store"
    asked.app.messages[0]["headers"] = [(b"cache-control", b"no-cache")]
    asked()
    assert asked.header("cache-control") == "no-cache"


def test_a_request_is_logged(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([10.0, 10.0123456])
    monkeypatch.setattr(time, "perf_counter", lambda: next(times))
    asked = Asked()
    asked("/" + "x" * 300, "POST", headers=[("host", "localhost"), ("x-request-id", "me")])
    assert asked.log == [
        {
            "request_id": "me",
            "method": "POST",
            "path": "/" + "x" * 199,
            "status": 200,
            "ms": 12.35,
            "bytes": 5,
            "client": "127.0.0.1",
        }
    ]
    value = asked.metrics.registry.get_sample_value
    assert value("tripwatt_request_seconds_sum", {"route": "other"}) == pytest.approx(0.0123456)
    assert value("tripwatt_requests_running") == 0.0


def test_requests_are_counted_by_route_and_known_method() -> None:
    asked = Asked()

    class Route:
        path = "/v1/examples/{trip}"

    asked(method="BREW", client=None, route=Route())
    asked(method="HEAD", route=Route())
    assert [(record["method"], record["client"]) for record in asked.log] == [
        ("other", ""),
        ("HEAD", "127.0.0.1"),
    ]
    assert [scope["method"] for scope in asked.app.scopes] == ["BREW", "GET"]
    for method in ("other", "HEAD"):
        labels = {"route": Route.path, "method": method, "status": "200"}
        assert asked.metrics.registry.get_sample_value("tripwatt_requests_total", labels) == 1.0


def test_a_problem_before_the_response_is_its_document() -> None:
    asked = Asked()
    asked.app.messages, asked.app.error = [], Problem("busy", headers={"Retry-After": "5"})
    assert asked() == 503
    assert (asked.header("retry-after"), asked.document["title"]) == ("5", "The service is busy")
    assert asked.document["instance"] == asked.log[0]["request_id"]
    assert (asked.log[0]["bytes"], "error" in asked.log[0]) == (len(asked.sent[1]["body"]), False)


def test_a_bug_before_the_response_is_an_internal_error() -> None:
    asked = Asked()
    asked.app.messages, asked.app.error = [], KeyError("x")
    assert asked() == 500
    assert (asked.document["type"], asked.log[0]["error"]) == ("/problems/internal", "KeyError('x')")


@pytest.mark.parametrize("error", [KeyError("x"), Problem("busy")])
def test_a_bug_during_the_response_breaks_it_off(error: Exception) -> None:
    asked = Asked()
    asked.app.messages, asked.app.error = asked.app.messages[:2], error
    with pytest.raises(RuntimeError, match="failed during the response"):
        asked()
    assert asked.log[0]["status"] == 200
    assert asked.metrics.registry.get_sample_value("tripwatt_requests_running") == 0.0


def test_a_bug_after_the_response_is_logged() -> None:
    asked = Asked()
    asked.app.error = KeyError("x")
    assert asked() == 200
    assert len(asked.sent) == 3
    assert asked.log[0]["error"] == "KeyError('x')"


def test_a_path_in_front_is_taken_off_before_anything_is_checked() -> None:
    asked = Asked(Settings(token=TOKEN, prefix="/tripwatt"))
    assert asked("/tripwatt/v1/models") == 401
    assert asked("/v1/models") == 401  # a proxy that has taken it off
    given = [("host", "localhost"), ("authorization", f"Bearer {TOKEN}")]
    assert asked("/tripwatt/v1/models", headers=given) == 200
    assert asked("/tripwattv1/models") == 200
    assert [scope["path"] for scope in asked.app.scopes] == ["/v1/models", "/tripwattv1/models"]
    assert asked.log[0]["path"] == "/v1/models"
    assert asked("/tripwatt") == 308
    assert (b"location", b"/tripwatt/") in asked.sent[0]["headers"]


def test_the_host_that_a_proxy_forwards_counts_where_its_peer_is_trusted() -> None:
    seen: list[list[bytes]] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        seen.append([name for name, _ in scope.get("headers", [])])

    async def run(peer: str | None, trusted: str) -> list[bytes]:
        headers = [(b"host", b"127.0.0.1"), (b"x-forwarded-host", b"page.example")]
        client = None if peer is None else (peer, 1)
        await ProxyHeaders(app, trusted)({"type": "http", "client": client, "headers": headers}, None, None)
        return seen[-1]

    both, own = [b"host", b"x-forwarded-host"], [b"host"]
    assert asyncio.run(run("127.0.0.1", "")) == both
    assert asyncio.run(run("::1", "")) == both
    assert asyncio.run(run("172.17.0.1", "")) == own
    assert asyncio.run(run(None, "")) == own
    named = "172.17.0.1, 10.0.0.0/8"
    assert [asyncio.run(run(peer, named)) for peer in ("172.17.0.1", "10.1.2.3", "127.0.0.1")] == [both] * 3
    assert asyncio.run(run("11.0.0.1", named)) == own
    assert asyncio.run(run("11.0.0.1", " * ")) == both


@pytest.mark.parametrize(
    ("peer", "trusted", "given", "client"),
    [
        ("192.0.2.7", "", ["9.9.9.9"], "192.0.2.7"),
        ("127.0.0.1", "", [], "127.0.0.1"),
        ("127.0.0.1", "", ["9.9.9.9, 192.0.2.7"], "192.0.2.7"),
        ("127.0.0.1", "", ["9.9.9.9", "192.0.2.7"], "192.0.2.7"),
        ("::ffff:127.0.0.1", "", ["9.9.9.9, 192.0.2.7"], "192.0.2.7"),
        ("::1", "", ["9.9.9.9, ::ffff:192.0.2.7"], "192.0.2.7"),
        ("10.0.0.2", "10.0.0.2", ["9.9.9.9, 192.0.2.7, 127.0.0.1"], "192.0.2.7"),
        ("::ffff:10.0.0.2", "10.0.0.0/8", ["127.0.0.1, 192.0.2.7"], "192.0.2.7"),
        ("10.0.0.2", "*", ["127.0.0.1, 192.0.2.7"], "192.0.2.7"),
        ("10.0.0.2", "*", ["127.0.0.1", "192.0.2.7"], "192.0.2.7"),
        ("10.0.0.2", "*", [], "10.0.0.2"),
    ],
)
def test_the_client_is_the_last_address_that_no_trusted_proxy_has(
    peer: str, trusted: str, given: list[str], client: str
) -> None:
    """What a client itself writes into `X-Forwarded-For` is before that, and changes nothing."""
    seen = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        seen.append(scope["client"][0])

    headers = [(b"x-forwarded-for", value.encode()) for value in given]
    scope = {"type": "http", "client": (peer, 1), "headers": headers}
    asyncio.run(ProxyHeaders(app, trusted)(scope, None, None))
    assert seen == [client]


def test_each_client_has_one_key() -> None:
    hosts = ["192.0.2.7", "192.0.2.8", "2001:db8::1", "2001:db8:0:1::1", "fe80::1%eth0", "", "unix"]
    assert len({client_key(host) for host in hosts}) == len(hosts)
    assert client_key("::ffff:192.0.2.7") == client_key("192.0.2.7")
    assert client_key("2001:db8::1") == client_key("2001:db8::ffff:1"), "one client has a whole network"
