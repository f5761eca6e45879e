"""The middleware by itself: rate, host, token, headers and log of one request."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import orjson
import pytest

from tripwatt.service import middleware
from tripwatt.service.metrics import Metrics
from tripwatt.service.middleware import ServiceMiddleware, TokenBuckets, rate_limit_key
from tripwatt.service.problems import Problem
from tripwatt.service.settings import Limits, Settings

TOKEN = "a-token-for-tests-only"


def test_a_client_has_its_burst_and_then_its_rate() -> None:
    buckets = TokenBuckets(rate_per_s=4.0, burst=3)
    assert [buckets.wait_s("a", 100.0) for _ in range(4)] == [0.0, 0.0, 0.0, 0.25]
    assert buckets.wait_s("a", 100.125) == 0.125
    assert buckets.wait_s("a", 100.25) == 0.0
    assert buckets.wait_s("a", 100.25) == 0.25
    assert buckets.wait_s("b", 100.25) == 0.0


def test_tokens_do_not_exceed_the_burst() -> None:
    buckets = TokenBuckets(rate_per_s=4.0, burst=3)
    buckets.wait_s("a", 0.0)
    assert [buckets.wait_s("a", 900.0) for _ in range(4)] == [0.0, 0.0, 0.0, 0.25]


def test_the_least_active_client_is_forgotten_after_ten_thousand() -> None:
    buckets = TokenBuckets(rate_per_s=1.0, burst=1)
    for client in range(10_000):
        buckets.wait_s(f"{client}", 0.0)
    assert buckets.wait_s("0", 0.0) == 1.0
    assert len(buckets.by_client) == 10_000
    buckets.wait_s("new", 0.0)
    assert len(buckets.by_client) == 10_000
    assert ("0" in buckets.by_client, "1" in buckets.by_client, "2" in buckets.by_client) == (
        True,
        False,
        True,
    )


@pytest.mark.parametrize(
    ("address", "key"),
    [
        ("127.0.0.1", None),
        ("::1", None),
        ("203.0.113.9", "203.0.113.9"),
        ("2001:db8:0:1::1:2", "2001:db8:0:1::/64"),
        ("2001:db8:0:1:ffff::", "2001:db8:0:1::/64"),
        ("unix", "unix"),
    ],
)
def test_a_client_is_its_address_or_its_network(address: str, key: str | None) -> None:
    assert rate_limit_key(address) == key


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


def test_the_rate_of_other_machines_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 50.0)
    asked = Asked(Settings(limits=Limits(rate_per_s=0.4, burst=1)))
    assert [asked(client="203.0.113.7") for _ in range(2)] == [200, 429]
    assert asked.header("retry-after") == "3"
    assert asked.document["detail"] == "wait 3 s"
    assert [asked("/healthz", client="203.0.113.7"), asked("/readyz", client="203.0.113.7")] == [200, 200]
    assert [asked(client="127.0.0.1") for _ in range(3)] == [200] * 3
    assert [asked(client=None) for _ in range(3)] == [200] * 3


@pytest.mark.parametrize(
    ("rate_per_s", "after"), [(50.0, "1"), (1.0, "2"), (0.8, "2"), (0.5, "2"), (0.35, "3"), (0.1, "10")]
)
def test_the_time_to_wait_is_told_in_whole_seconds(
    monkeypatch: pytest.MonkeyPatch, rate_per_s: float, after: str
) -> None:
    """Half a second is added and the sum rounded to even."""
    monkeypatch.setattr(time, "monotonic", lambda: 50.0)
    asked = Asked(Settings(limits=Limits(rate_per_s=rate_per_s, burst=1)))
    assert [asked(client="203.0.113.7") for _ in range(2)] == [200, 429]
    assert asked.header("retry-after") == after


def test_a_rate_of_zero_is_no_limit() -> None:
    asked = Asked(Settings(limits=Limits(rate_per_s=0.0, burst=1)))
    assert {asked(client="203.0.113.7") for _ in range(5)} == {200}
    assert Asked(Settings(limits=Limits(rate_per_s=0.5))).middleware.buckets is not None


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
        ([f"Bearer {TOKEN}"], 200),
        ([f"bearer  {TOKEN} "], 200),
        ([f"Bearer {TOKEN}x"], 401),
        ([f"Basic {TOKEN}"], 401),
        (["Bearer"], 401),
        ([TOKEN], 401),
        ([f"Bearer {TOKEN}", f"Bearer {TOKEN}"], 401),
        ([], 401),
    ],
)
def test_the_token_is_given_once_as_a_bearer(given: list[str], status: int) -> None:
    asked = Asked(Settings(token=TOKEN))
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


@pytest.mark.parametrize("valid", ["a", "A-z_0.9", "x" * 64])
def test_a_valid_id_of_a_request_is_kept(valid: str) -> None:
    asked = Asked()
    asked(headers=[("host", "localhost"), ("x-request-id", valid)], state={"kept": 1})
    assert asked.header("x-request-id") == asked.log[0]["request_id"] == valid
    assert asked.app.scopes[0]["state"] == {"kept": 1, "request_id": valid}


@pytest.mark.parametrize("wrong", ["", "x" * 65, "a b", "ü"])
def test_another_id_is_replaced_by_16_characters(wrong: str) -> None:
    asked = Asked()
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
