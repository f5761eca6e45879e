"""Token, limits, rate, content negotiation, headers and the log, as every request meets them."""

from __future__ import annotations

import asyncio
import gzip
import socket
from collections.abc import Iterator
from typing import Any

import httpx
import orjson
import pytest
from tests.support.service_process import TOKEN, Service, serving, wait_for

from tripwatt.service import worker
from tripwatt.service.jobs import Jobs
from tripwatt.service.problems import Problem
from tripwatt.service.settings import Limits

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


@pytest.mark.parametrize("given", [None, "", "Bearer", "Bearer wrong", f"Basic {TOKEN}", f"Bearer {TOKEN}x"])
@pytest.mark.parametrize("path", ["/v1/models", "/metrics", "/openapi.json", "/v1/nothing"])
def test_requests_without_the_token_are_refused(strict: Service, given: str | None, path: str) -> None:
    headers = {} if given is None else {"Authorization": given}
    del strict.client.headers["Authorization"]
    try:
        answer = strict.client.get(path, headers=headers)
    finally:
        strict.client.headers["Authorization"] = f"Bearer {TOKEN}"
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"].startswith("Bearer")
    assert answer.json()["type"] == "/problems/token-needed"


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


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Content-Type": "text/plain"}, 415),
        ({"Content-Type": ""}, 415),
        (JSON | {"Content-Encoding": "gzip"}, 415),
        (JSON | {"Accept": "text/html"}, 406),
        (JSON | {"Accept": "application/json;q=0, */*"}, 406),
        (JSON | {"Accept": "text/html, application/*;q=0.1"}, 400),
        (JSON | {"Content-Type": "application/json; charset=utf-8"}, 400),
    ],
)
def test_unsupported_media_types_are_refused(service: Service, headers: dict[str, str], status: int) -> None:
    answer = service.client.post("/v1/forecast", content=b"no json", headers=headers)
    assert answer.status_code == status
    assert answer.json()["status"] == status


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [("GET", "/v1/nothing", 404), ("DELETE", "/v1/forecast", 405), ("GET", "/v1/examples/none", 404)],
)
def test_unknown_paths_and_methods_are_problem_documents(
    service: Service, method: str, path: str, status: int
) -> None:
    answer = service.client.request(method, path)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert answer.json()["instance"] == answer.headers["x-request-id"]


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "evil.example:80", ""])
def test_another_host_name_is_refused_on_loopback(service: Service, host: str) -> None:
    assert service.client.get("/v1/models", headers={"Host": host}).status_code == 400
    assert service.client.get("/v1/models", headers={"Host": f"LOCALHOST:{service.port}"}).status_code == 200


def test_responses_have_an_id_security_headers_and_compression(
    service: Service, drive: dict[str, Any]
) -> None:
    headers = {"X-Request-ID": "my-id.1", "Accept-Encoding": "identity"}
    plain = service.client.post("/v1/forecast", json=drive, headers=headers)
    assert plain.headers["x-request-id"] == "my-id.1"
    assert plain.headers["x-content-type-options"] == "nosniff"
    policy = plain.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    bad = service.client.get("/healthz", headers={"X-Request-ID": "a b\\'\"{}"})
    assert len(bad.headers["x-request-id"]) == 16
    packed = service.client.post("/v1/forecast", json=drive, headers={"Accept-Encoding": "gzip"})
    assert packed.headers["content-encoding"] == "gzip"
    assert packed.json() == plain.json()
    assert len(gzip.compress(plain.content)) < len(plain.content)


def test_requests_are_logged_and_counted(service: Service, drive: dict[str, Any]) -> None:
    service.client.post("/v1/forecast", json=drive, headers={"X-Request-ID": "find-me"})
    service.client.get("/v1/" + "x" * 50)
    record = next(r for r in service.records() if r.get("request_id") == "find-me")
    assert (record["method"], record["path"], record["status"]) == ("POST", "/v1/forecast", 200)
    assert record["ms"] > 0
    text = service.client.get("/metrics").text
    lines = [line.rpartition(" ") for line in text.splitlines() if not line.startswith("#")]
    counted = {name: float(value) for name, _, value in lines}
    assert counted['tripwatt_requests_total{method="POST",route="/v1/forecast",status="200"}'] >= 1
    assert counted['tripwatt_work_seconds_count{kind="forecast"}'] >= 1
    assert counted["tripwatt_workers_ready"] == 1
    assert "xxx" not in text  # no client makes up labels


@pytest.fixture(scope="module")
def rationed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service that takes few requests of a client, and one batch at a time."""
    limits = ("--limit", "burst=3", "--limit", "rate_per_s=0.1", "--limit", "batches=1")
    with serving(tmp_path_factory.mktemp("rationed"), "--workers", "1", *limits) as found:
        yield found


def test_the_rate_of_a_client_is_limited(rationed: Service) -> None:
    """The client of a proxy is limited; requests from loopback itself are not."""
    client = rationed.client
    one, other = ({"X-Forwarded-For": address} for address in ("203.0.113.7", "203.0.113.8"))
    seen = [client.get("/v1/models", headers=one).status_code for _ in range(5)]
    assert seen == [200, 200, 200, 429, 429]
    late = client.get("/v1/models", headers=one)
    assert int(late.headers["retry-after"]) >= 1
    assert client.get("/v1/models", headers=other).status_code == 200
    assert {client.get("/v1/models").status_code for _ in range(9)} == {200}


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


def test_an_aborted_batch_leaves_no_jobs(rationed: Service, drive: dict[str, Any]) -> None:
    """The place of the batch and the workers are free again."""
    body = b"\n".join([b'{"links": [{"length_m": 9000, "speed_m_s": 15}]}'] * 5000)  # many seconds of work
    headers = {"Content-Type": "application/x-ndjson"}

    def short() -> httpx.Response:
        return rationed.client.post("/v1/forecast/batch", content=b"{}", headers=headers)

    for _ in range(3):
        assert wait_for(lambda: short().status_code == 200)
        with rationed.client.stream("POST", "/v1/forecast/batch", content=body, headers=headers) as answer:
            assert answer.status_code == 200
            lines = answer.iter_lines()  # kept: the stream ends with it
            assert orjson.loads(next(lines))["energy_wh"] > 0.0
            busy = short()
            assert (busy.status_code, busy.headers["retry-after"]) == (503, "5")
        assert rationed.forecast(drive).status_code == 200
        assert wait_for(lambda: b"tripwatt_jobs_waiting 0.0" in rationed.client.get("/metrics").content)


def test_a_bug_is_a_500_with_its_traceback_in_the_log_only() -> None:
    said: list[dict[str, Any]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worker, "log_json", lambda **record: said.append(record))
        status, document = worker.run_job(Jobs({}, Limits()), {"kind": "no such job"}, b"")
    assert (status, orjson.loads(document)) == (500, Problem("internal").document())
    assert "KeyError" in said[0]["traceback"]
