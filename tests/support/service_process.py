"""A real service in a process of its own, as `tripwatt serve` starts it: for its tests and its bars."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import orjson

TOKEN = "a-token-for-tests-only"


class Service:
    """A running `tripwatt serve`."""

    def __init__(self, process: subprocess.Popen[str], url: str, log: Path) -> None:
        self.process, self.url, self.log = process, url, log
        self.client = httpx.Client(base_url=url, timeout=120.0)

    @property
    def port(self) -> int:
        return int(self.url.rpartition(":")[2])

    def records(self) -> list[dict[str, Any]]:
        """Everything that it logged so far."""
        return [orjson.loads(line) for line in self.log.read_bytes().splitlines()]

    def workers(self) -> list[int]:
        """Process ids of its workers; the tracker of resources of the standard library is none."""
        children = [  # a thread of the pool may start a worker
            pid
            for task in Path(f"/proc/{self.process.pid}/task").iterdir()
            for pid in (task / "children").read_text().split()
        ]
        return sorted(
            int(pid) for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
        )

    def resident_bytes(self) -> int:
        """Memory of the service and its workers."""
        page = os.sysconf("SC_PAGE_SIZE")
        pids = [self.process.pid, *self.workers()]
        return sum(int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * page for pid in pids)

    def forecast(self, request: Mapping[str, Any]) -> httpx.Response:
        return self.client.post("/v1/forecast", json=request)


def wait_for(condition: Callable[[], Any], seconds: float = 60.0, every_s: float = 0.05) -> bool:
    """Whether a condition, looked at every `every_s` seconds, becomes true in time."""
    until = time.monotonic() + seconds
    while not (is_met := bool(condition())) and time.monotonic() < until:
        time.sleep(every_s)
    return is_met


def free_port() -> int:
    """A port of loopback that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def serving(folder: Path, *arguments: str, token: str = "", files: int | None = None) -> Iterator[Service]:
    """`tripwatt serve` on a free port, ended when the block is left; it may open so many `files`."""
    log = folder / f"log-{len(list(folder.iterdir()))}"
    environment = {k: v for k, v in os.environ.items() if k != "TRIPWATT_TOKEN"}
    environment |= {"TRIPWATT_TOKEN": token} if token else {}
    command = [sys.executable, "-m", "tripwatt.command", "serve", "--port", "0", *arguments]
    if files is not None:
        command = ["sh", "-c", f'ulimit -n {files}; exec "$@"', "sh", *command]
    with log.open("wb") as error:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=error, text=True, env=environment)
        try:
            assert process.stdout is not None
            first = process.stdout.readline()
            assert first.startswith("tripwatt: http"), log.read_text()
            service = Service(process, first.split()[1].replace("0.0.0.0", "127.0.0.1"), log)
            with service.client:
                yield service
        finally:
            if process.poll() is None:
                process.terminate()
            process.wait(60)
            if process.stdout is not None:
                process.stdout.close()
