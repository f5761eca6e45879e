"""Clients that try to stall or exhaust a service, and what another client sees meanwhile.

`ATTACKS` is the table: a new input of the service gets a line here, and both the gate and `make bars` run it.
"""

from __future__ import annotations

import io
import resource
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Any, Final

import httpx
import numpy as np
import pandas as pd
from tests.support import ROOT
from tests.support.bombs import BOMBS, HEAD, book, zipped
from tests.support.service_process import Service

BINARY: Final = MappingProxyType({"content-type": "application/octet-stream"})
LINES: Final = MappingProxyType({"content-type": "application/x-ndjson"})
FORECAST: Final = b'{"links": [{"length_m": 9000, "speed_m_s": 15}], "soc": 0.8}'


@dataclass
class Seen:
    """What another client saw: seconds of `/healthz` and of good forecasts, and what was not answered with 200."""

    health_s: list[float] = field(default_factory=list)
    forecast_s: list[float] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    def quantile_s(self, p: float) -> float:
        ordered = sorted(self.health_s)
        return ordered[min(int(p * len(ordered)), len(ordered) - 1)]

    @property
    def median_s(self) -> float:
        return statistics.median(self.health_s)


def _connect(port: int) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", port), timeout=10)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def _head(path: str, length: int | None, media_type: str = "application/json") -> bytes:
    size = "Transfer-Encoding: chunked" if length is None else f"Content-Length: {length}"
    return f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: {media_type}\r\n{size}\r\n".encode()


def _flood(port: int, first: bytes, piece: bytes, pieces: int, stop: threading.Event) -> None:
    """Send a beginning and then one piece after the other, as fast as it is taken, until the server closes."""
    with suppress(OSError), _connect(port) as connection:
        connection.sendall(first)
        for _ in range(pieces):
            if stop.is_set():
                return
            connection.sendall(piece)


def endless_header(port: int, stop: threading.Event) -> None:
    """A header without an end."""
    _flood(port, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nX-A: ", b"a" * 65536, 2500, stop)


def endless_url(port: int, stop: threading.Event) -> None:
    """A target without an end."""
    _flood(port, b"GET /", b"a" * 65536, 2500, stop)


def many_headers(port: int, stop: threading.Event) -> None:
    """100,000 headers."""
    _flood(port, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"a: b\r\n" * 10_000, 10, stop)


def endless_trailers(port: int, stop: threading.Event) -> None:
    """Trailers without an end after a complete body."""
    first = _head("/v1/forecast", None) + b"\r\n1\r\n{\r\n0\r\n"
    _flood(port, first, b"t: x\r\n" * 10_000, 500, stop)


def tiny_chunks(port: int, stop: threading.Event) -> None:
    """A body in chunks of one byte."""
    _flood(port, _head("/v1/forecast", None) + b"\r\n", b"1\r\n \r\n" * 10_000, 300, stop)


def lines_of_a_batch(port: int, stop: threading.Event) -> None:
    """64 MB of the shortest lines."""
    media_type = "application/x-ndjson"
    _flood(port, _head("/v1/forecast/batch", 64_000_000, media_type) + b"\r\n", b"1\n" * 32_000, 1000, stop)


def empty_lines_of_a_batch(port: int, stop: threading.Event) -> None:
    """64 MB of empty lines."""
    media_type = "application/x-ndjson"
    _flood(port, _head("/v1/forecast/batch", 64_000_000, media_type) + b"\r\n", b"\n" * 64_000, 1000, stop)


def one_line_of_a_batch(port: int, stop: threading.Event) -> None:
    """64 MB in one line."""
    media_type = "application/x-ndjson"
    _flood(port, _head("/v1/forecast/batch", 64_000_000, media_type) + b"\r\n", b"1" * 64_000, 1000, stop)


def nested_json(port: int, stop: threading.Event) -> None:
    """Bodies that are nested as deeply as the parser allows."""
    body = b'{"links": [' + b"[" * 900 + b"]" * 900 + b"]}"
    with suppress(OSError):
        while not stop.is_set():
            with _connect(port) as connection:
                connection.sendall(_head("/v1/forecast", len(body)) + b"\r\n" + body)
                connection.recv(4096)


def _held(port: int, number: int, sent: bytes, stop: threading.Event, again: bytes = b"") -> None:
    """Hold many connections open that have sent the same beginning."""
    connections = []
    with suppress(OSError):
        for _ in range(number):
            connections.append(_connect(port))
            connections[-1].sendall(sent)
    while not stop.wait(0.5):
        for connection in connections:
            with suppress(OSError):
                connection.sendall(again)
    for connection in connections:
        connection.close()


def slow_bodies(port: int, stop: threading.Event) -> None:
    """200 bodies of which a byte arrives twice a second."""
    _held(port, 200, _head("/v1/forecast", 1_000_000) + b"\r\n{", stop, b" ")


def slow_heads(port: int, stop: threading.Event) -> None:
    """200 heads that are never complete."""
    _held(port, 200, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n", stop, b"a: b\r\n")


def slow_batches(port: int, stop: threading.Event) -> None:
    """Batches whose bodies never end."""
    _held(port, 20, _head("/v1/forecast/batch", 1000, "application/x-ndjson") + b"\r\n{", stop, b" ")


def idle_connections(port: int, stop: threading.Event) -> None:
    """1,150 connections that send nothing."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    _held(port, 1150, b"", stop)


def used_once(service: Service) -> int:
    """Memory of a service [bytes] whose workers have all answered ordinary requests of the kinds that the attacks imitate."""
    table = io.BytesIO()
    pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0]}).to_parquet(table)
    row = "<row><c><v>0</v></c><c><v>1</v></c></row>"
    files = {"a.xlsx": book(HEAD + row), "a.zip": zipped({"b.parquet": table.getvalue()})}
    asked: list[tuple[str, str, dict[str, Any]]] = [
        ("POST", "/v1/forecast/batch", {"content": FORECAST, "headers": LINES})
    ]
    for file, content in files.items():
        place = f"/v1/cars/ordinary0/uploads/upload01/{file}"
        asked.append(("PUT", place, {"content": content, "headers": BINARY}))
    repeated = range(3 * len(service.workers()))  # one kind after the other, as workers take turns
    for k in repeated:
        car = {"name": f"ordinary{k}", "car": "nissan_leaf_24"}
        service.client.post("/v1/cars", json=car).raise_for_status()
    for method, place, body in asked:
        for _ in repeated:
            service.client.request(method, place, **body).raise_for_status()
    seen_by_another(service, 2.0)
    return service.resident_bytes()


@cache
def _made_bombs() -> list[tuple[str, bytes]]:
    """Those that take little time to make."""
    kinds = (
        "long_string_in_many_cells",
        "wide_rows",
        "entities",
        "workbooks_in_an_archive",
        "parquet_dictionary",
    )
    return [BOMBS[kind](np.random.default_rng(k)) for kind in kinds for k in range(2)]


def bombs(port: int, stop: threading.Event) -> None:
    """Archives, workbooks and tables that unpack to gigabytes; the service needs a folder of cars."""
    address = f"http://127.0.0.1:{port}/v1/cars"
    with httpx.Client(timeout=60.0) as client:
        client.post(address, json={"name": "bombed", "car": "nissan_leaf_24"})
        for name, content in _made_bombs():
            if not stop.is_set():
                with suppress(httpx.HTTPError):
                    client.put(f"{address}/bombed/uploads/upload01/{name}", content=content, headers=BINARY)


ATTACKS: Final[Mapping[str, Callable[[int, threading.Event], None]]] = MappingProxyType(
    {
        attack.__name__: attack
        for attack in (
            endless_header,
            endless_url,
            many_headers,
            endless_trailers,
            tiny_chunks,
            lines_of_a_batch,
            empty_lines_of_a_batch,
            one_line_of_a_batch,
            nested_json,
            slow_bodies,
            slow_heads,
            slow_batches,
            idle_connections,
            bombs,
        )
    }
)
"""Attacks by name."""


@contextmanager
def attacking(name: str, port: int, clients: int = 2) -> Iterator[None]:
    """The clients of an attack, each a process that repeats it until the block ends."""
    command = [sys.executable, "-m", "tests.support.service_attacks", name, str(port)]
    running = [subprocess.Popen(command, cwd=ROOT) for _ in range(clients)]
    try:
        time.sleep(0.5)
        yield
    finally:
        for process in running:
            process.kill()
        for process in running:
            process.wait(15)


def seen_by_another(service: Service, seconds: float, *, forecasts: bool = True) -> Seen:
    """What another client sees of a service for some seconds."""
    found = Seen()
    headers = {"Content-Type": "application/json"}
    with httpx.Client(base_url=service.url, timeout=30.0) as client:  # takes a second on a busy machine
        until = time.perf_counter() + seconds
        while time.perf_counter() < until:
            for path, times in (("/healthz", found.health_s), ("/v1/forecast", found.forecast_s)):
                if path == "/v1/forecast" and not (forecasts and len(found.health_s) % 5 == 1):
                    continue
                started = time.perf_counter()
                try:
                    answer = (
                        client.get(path)
                        if path == "/healthz"
                        else client.post(path, content=FORECAST, headers=headers)
                    )
                except httpx.HTTPError as error:
                    found.wrong.append(f"{path}: {error!r}")
                    continue
                times.append(time.perf_counter() - started)
                if answer.status_code != 200:
                    found.wrong.append(f"{path}: {answer.status_code} {answer.text[:100]}")
            time.sleep(0.01)
    return found


def main(name: str, port: int) -> None:
    """Attack until the process is ended."""
    stop = threading.Event()
    while True:
        ATTACKS[name](port, stop)
        time.sleep(0.01)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
