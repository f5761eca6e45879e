"""What a worker answers to each kind of failure, and how it reads and writes frames."""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import asdict
from typing import Any

import orjson
import pytest

from tripwatt.errors import Fault, InvalidInput, RemoteError
from tripwatt.roads.journey import AtlasSettings
from tripwatt.server.http import worker
from tripwatt.server.http.frames import encode_frame, read_frame
from tripwatt.server.http.problems import Problem, invalid_input
from tripwatt.server.http.settings import Limits

FAULT = Fault("wrong", "there")


class Jobs:
    """Jobs that return or raise what they are told."""

    limits = Limits(memory_bytes=1000)

    def __init__(self, *results: Any) -> None:
        self.results = list(results)
        self.asked: list[tuple[Any, ...]] = []

    def run(self, job: dict[str, Any], body: bytes) -> Any:
        self.asked.append((job, body))
        found = self.results.pop(0)
        if isinstance(found, Exception):
            raise found
        return found


@pytest.mark.parametrize(
    ("result", "status", "content"),
    [
        ({"a": 1}, 200, b'{"a":1}'),
        (b"\x00tile", 200, b"\x00tile"),
        (Problem("not-json", "line 1"), 400, orjson.dumps(Problem("not-json", "line 1").document())),
        (InvalidInput(FAULT), 422, orjson.dumps(invalid_input([FAULT]).document())),
        (RemoteError(FAULT), 502, orjson.dumps(Problem("remote", faults=(FAULT,)).document())),
    ],
)
def test_a_result_or_what_was_wrong_is_answered(result: Any, status: int, content: bytes) -> None:
    assert worker.run_job(Jobs(result), {"kind": "x"}, b"") == (status, content)  # type: ignore[arg-type]


def test_a_bug_is_logged_and_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    found = worker.run_job(Jobs(ValueError("inside")), {"kind": "forecast"}, b"")  # type: ignore[arg-type]
    assert found == (500, orjson.dumps(Problem("internal").document()))
    record = orjson.loads(capsys.readouterr().err)
    assert (record["event"], record["kind"]) == ("bug", "forecast")
    assert record["traceback"].endswith("ValueError: inside\n")


def test_too_little_memory_is_a_fault_of_what_was_sent(capsys: pytest.CaptureFixture[str]) -> None:
    for body, kind in ((b"{}", "too-large"), (b"", "internal")):
        status, content = worker.run_job(Jobs(MemoryError()), {"kind": "x"}, body)  # type: ignore[arg-type]
        problem = Problem(kind, "it takes more than 1000 bytes of memory")
        assert (status, content) == (problem.status, orjson.dumps(problem.document()))
        assert orjson.loads(capsys.readouterr().err)["event"] == "out of memory"


def run_worker(given: bytes) -> tuple[list[tuple[dict[str, Any], bytes]], bytes]:
    """The frames and the log of a worker process with this input."""
    command = [sys.executable, "-m", "tripwatt.server.http.worker"]
    ended = subprocess.run(command, input=given, capture_output=True, timeout=120, check=True)
    written, found = io.BytesIO(ended.stdout), []
    while (frame := read_frame(written)) is not None:
        found.append(frame)
    return found, ended.stderr


def test_a_worker_says_that_it_is_ready_and_answers_until_its_input_ends() -> None:
    first = {"models": {}, "limits": asdict(Limits()), "atlas": asdict(AtlasSettings())}
    jobs = [({"kind": "forecast"}, b"{"), ({"kind": "unknown"}, b"")]
    frames, log = run_worker(b"".join(encode_frame(*frame) for frame in [(first, b""), *jobs]))
    assert frames[0] == ({"ready": True}, b"")
    assert [head["status"] for head, _ in frames[1:]] == [400, 500]
    assert all(0.0 <= head["seconds"] < 120.0 for head, _ in frames[1:])
    assert [orjson.loads(body)["type"] for _, body in frames[1:]] == [
        "/problems/not-json",
        "/problems/internal",
    ]
    assert orjson.loads(log.splitlines()[-1])["kind"] == "unknown"


def test_a_worker_without_input_ends() -> None:
    assert run_worker(b"") == ([], b"")
