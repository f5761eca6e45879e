"""Clients that try to stall or exhaust the service: each is bounded, and others are served meanwhile."""

import socket
from pathlib import Path

import orjson
import pytest
from tests.support.service_attacks import FORECAST, attacking, seen_by_another
from tests.support.service_process import Service, serving

JSON = {"Content-Type": "application/json"}
HEAD = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def answer_to(service: Service, *parts: bytes) -> bytes:
    """What comes back until the server closes the connection; later parts may meet a closed one."""
    with socket.create_connection(("127.0.0.1", service.port), timeout=15) as connection:
        found = b""
        try:
            for part in parts:
                connection.sendall(part)
            while data := connection.recv(65536):
                found += data
        except OSError:
            pass
        return found


@pytest.mark.parametrize(
    "head",
    [HEAD + b"X-A: " + b"a" * 80_000, b"GET /" + b"a" * 80_000, HEAD + b"a: b\r\n" * 20_000],
    ids=["header", "target", "number"],
)
def test_a_head_has_a_largest_size(service: Service, head: bytes) -> None:
    answer = answer_to(service, head)
    assert answer.startswith(b"HTTP/1.1 400 Bad Request\r\n")
    assert answer.endswith(b"A head has at most 32768 bytes.")
    assert service.client.get("/healthz").status_code == 200


def test_a_head_within_its_bounds_is_answered(service: Service) -> None:
    close = b"Connection: close\r\n\r\n"
    assert answer_to(service, HEAD + b"a: b\r\n" * 98 + close).startswith(b"HTTP/1.1 200")
    assert answer_to(service, HEAD + b"a: " + b"b" * 30_000 + b"\r\n" + close).startswith(b"HTTP/1.1 200")
    slow = HEAD + b"a: " + b"b" * 20_000 + b"\r\n"
    assert answer_to(service, slow[:7], slow[7:9000], slow[9000:], close).startswith(b"HTTP/1.1 200")


def test_trailers_have_a_largest_number_and_size(service: Service) -> None:
    head = (
        b"POST /v1/forecast HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        b"Transfer-Encoding: chunked\r\n\r\n1\r\n{\r\n0\r\n"
    )
    for trailers in (b"t: x\r\n" * 20_000, b"t: " + b"x" * 80_000):
        answer = answer_to(service, head + trailers)
        assert b"200 OK" not in answer


def test_requests_in_one_packet_are_answered_in_order(service: Service) -> None:
    both = answer_to(service, HEAD + b"\r\n" + HEAD + b"Connection: close\r\n\r\n")
    assert both.count(b"HTTP/1.1 200 OK") == 2


def test_a_body_in_tiny_chunks_is_whole(service: Service) -> None:
    chunks = b"".join(b"1\r\n%c\r\n" % byte for byte in FORECAST) + b"0\r\n\r\n"
    head = (
        b"POST /v1/forecast HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        b"Connection: close\r\nTransfer-Encoding: chunked\r\n\r\n"
    )
    answer = answer_to(service, head + chunks)
    assert answer.startswith(b"HTTP/1.1 200")
    direct = service.client.post("/v1/forecast", content=FORECAST, headers=JSON)
    assert orjson.loads(answer.partition(b"\r\n\r\n")[2]) == direct.json()


@pytest.mark.parametrize("name", ["slow_bodies", "tiny_chunks", "lines_of_a_batch", "endless_header"])
def test_another_client_is_served_under_an_attack(service: Service, name: str) -> None:
    """The bars of the times are those of `make bars`; here a stall of a second fails."""
    with attacking(name, service.port, clients=1):
        seen = seen_by_another(service, 1.0)
    assert seen.wrong == []
    assert seen.forecast_s
    assert seen.median_s < 1.0


def test_idle_connections_beyond_the_limit_of_files_give_way(tmp_path: Path) -> None:
    """The service may open 256 files; 400 connections send nothing, and others are answered."""
    with serving(tmp_path, "--workers", "1", files=256) as service:
        held = [socket.create_connection(("127.0.0.1", service.port), timeout=10) for _ in range(400)]
        try:
            seen = seen_by_another(service, 2.0)
        finally:
            for connection in held:
                connection.close()
    assert seen.wrong == []
    assert seen.quantile_s(0.99) < 1.0


def test_head_is_answered_like_get(service: Service) -> None:
    for path in ("/healthz", "/v1/models", "/"):
        given, asked = service.client.get(path), service.client.head(path)
        assert (asked.status_code, asked.content) == (given.status_code, b"")
        assert asked.headers["content-type"] == given.headers["content-type"]
    refused = service.client.head("/v1/forecast")
    assert (refused.status_code, refused.headers["allow"]) == (405, "POST")
    assert any(r.get("method") == "HEAD" for r in service.records())


def test_nested_json_is_a_fault(service: Service) -> None:
    for field in (b"links", b"samples", b"model", b"soc", b"elevation", b"colour"):
        nested = b"[" * 900 + b"]" * 900
        body = b'{"links": [{"length_m": 9, "speed_m_s": 1}], "%s": [%s]}' % (field, nested)
        assert service.client.post("/v1/forecast", content=body, headers=JSON).status_code == 422, field


def test_a_gap_is_refused_or_flagged(service: Service) -> None:
    far = service.forecast({"samples": {"time_s": [0, 1, 43200], "speed_m_s": [10, 10, 10]}})
    assert far.status_code == 422
    assert far.json()["faults"][0]["what"] == "gap in the samples"
    near = service.forecast({"samples": {"time_s": [0, 1, 31, 32], "speed_m_s": [10, 10, 10, 10]}})
    assert "gap_bridged" in {flag["code"] for flag in near.json()["flags"]}
    upload = b"time_s,speed_m_s\n0,10\n1,10\n%d,10\n"
    headers = {"Content-Type": "text/csv"}
    assert service.client.post("/v1/routes", content=upload % 900, headers=headers).status_code == 422
    answer = service.client.post("/v1/routes", content=upload % 40, headers=headers)
    assert [flag["code"] for flag in answer.json()["notes"]] == ["gap_bridged"]
