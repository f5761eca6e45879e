"""The processes of the service: start, shutdown without lost responses, and replacement of lost workers."""

from __future__ import annotations

import dataclasses
import os
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest
import typer.main
from tests.support.command import answered
from tests.support.refusals import refuses
from tests.support.service_fuzz import fuzz
from tests.support.service_process import TOKEN, Service, serving, wait_for
from tests.support.service_schema import PLAIN, conformance

from tripwatt.command import app
from tripwatt.command.serve import models_of, serve
from tripwatt.forecasting.storage import model_folder
from tripwatt.roads.journey import AtlasSettings
from tripwatt.server.http.problems import TITLES
from tripwatt.server.http.settings import Limits, Settings


def refused(*arguments: str, token: str = "") -> str:
    """The error output of `tripwatt serve` when it does not start."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("uvicorn.Server.run", lambda *_: pytest.fail("it starts"))
        patch.setenv("TRIPWATT_TOKEN", token)
        answer = answered("serve", "--port", "0", *arguments)
    assert answer.code == 2, answer.err
    return answer.err


def alive(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False


def test_it_does_not_start_with_unsafe_settings(tmp_path: Path) -> None:
    assert "token is missing" in refused("--host", "0.0.0.0")
    assert "token is too short" in refused("--host", "0.0.0.0", token="short")
    said = refused(str(tmp_path / "nothing"), "--limit", "colour=1", "--limit", "samples=x")
    assert "unknown limit" in said
    assert "limit samples" in said
    assert "nothing" in refused(str(tmp_path / "nothing"))


def test_every_option_has_a_variable(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given: list[Settings] = []
    monkeypatch.setattr(
        "tripwatt.server.http.serving.serve", lambda settings, on_start: given.append(settings)
    )
    options = {
        "MODEL": f"registry:{tmp_path / 'a'} {tmp_path / 'b'}",
        "HOST": "127.0.0.2",
        "PORT": "8123",
        "WORKERS": "3",
        "PLACES": "photon=http://localhost",
        "WEATHER": "http://localhost:1",
        "STATIONS": "stations.csv",
        "CARS": f"{tmp_path / 'cars'}",
        "KEEP_DAYS": "2.5",
        "LIMIT": "timeout_s=5 batch=7",
        "PREFIX": "/under/",
        "MQTT": "mqtt://localhost",
        "FOLLOW": "leaf=ovms:ovms/me/leaf/metric zoe=plain:zoe",
        "PUBLISH": "cars/",
        "DISCOVERY": "ha",
        "CORS_ORIGIN": "https://a.example https://b.example",
        "TOKEN": "x" * 16,
    }
    command = typer.main.get_command(app).commands["serve"]  # type: ignore[attr-defined]
    named = {p.name for p in command.params if p.param_type_name == "option"} - {"also"}
    assert {name.upper() for name in named} == {*options, "MAP_"} - {"MODEL", "TOKEN"}
    for name, value in options.items():
        monkeypatch.setenv(f"TRIPWATT_{name}", value)
    assert answered("serve", "--port", "8124").code == 0  # an option counts more than its variable
    (found,) = given
    assert (found.host, found.port, found.workers, found.token) == ("127.0.0.2", 8124, 3, "x" * 16)
    assert found.models == {name: (tmp_path / name).resolve() for name in "ab"}
    assert (found.limits.timeout_s, found.limits.batch, found.keep_days) == (5.0, 7, 2.5)
    atlas = AtlasSettings("", "photon=http://localhost", "http://localhost:1", "stations.csv")
    assert (found.atlas, found.cars) == (atlas, tmp_path / "cars")
    assert found.mqtt is not None
    assert found.mqtt.cars == {"leaf": ("ovms", "ovms/me/leaf/metric"), "zoe": ("plain", "zoe")}
    assert (found.mqtt.publish_to, found.mqtt.announce_below) == ("cars", "ha")
    assert (found.prefix, found.cors_origins) == ("/under", ("https://a.example", "https://b.example"))
    monkeypatch.setenv("TRIPWATT_PORT", "none")
    assert "'--port'" in answered("serve").err


def test_without_the_extra_the_error_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fastapi", None)
    refuses(r"\.\[service\]", serve)


def test_models_are_named_after_their_folders(tmp_path: Path) -> None:
    (tmp_path / "one").symlink_to(model_folder())
    (tmp_path / "two").symlink_to(model_folder())
    assert list(models_of([f"{tmp_path / 'two'}"])) == [model_folder().name]
    refuses("duplicate model name", models_of, [f"{tmp_path / 'one'}", f"{tmp_path / 'two'}"])


@pytest.fixture(scope="module")
def patient(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Two workers, no job of which times out on a busy machine; one batch at a time."""
    folder = tmp_path_factory.mktemp("patient")
    with serving(folder, "--workers", "2", "--limit", "timeout_s=120", "--limit", "batches=1") as found:
        yield found


@pytest.fixture(scope="module")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """One worker whose jobs time out soon."""
    with serving(tmp_path_factory.mktemp("hasty"), "--workers", "1", "--limit", "timeout_s=1") as found:
        yield found


def test_no_response_is_lost_with_a_killed_worker(patient: Service, drive: dict[str, Any]) -> None:
    """Two workers are killed under load, one after the other; every response is right."""
    service = patient
    with ThreadPoolExecutor(4) as pool:
        asked = [drive | {"payload_mass_kg": 10.0 * k} for k in range(5)]
        right = [service.forecast(request).json() for request in asked]

        def ask(number: int) -> list[bool]:
            with httpx.Client(base_url=service.url, timeout=120) as client:
                answers = [client.post("/v1/forecast", json=asked[(number + k) % 5]) for k in range(15)]
            return [
                a.status_code == 200 and a.json() == right[(number + k) % 5] for k, a in enumerate(answers)
            ]

        clients = [pool.submit(ask, number) for number in range(4)]
        time.sleep(0.1)
        killed = service.workers()
        for pid in killed:
            os.kill(pid, signal.SIGKILL)
            time.sleep(0.3)
        assert all(all(client.result()) for client in clients)
        assert wait_for(lambda: service.client.get("/readyz").json().get("workers") == 2)
        assert not set(killed) & set(service.workers())
        assert [r["pid"] for r in service.records() if r["event"] == "worker lost"] == killed


def test_an_aborted_batch_leaves_no_jobs(patient: Service) -> None:
    """The place of the batch and the workers are free again."""
    body = b"\n".join([b'{"links": [{"length_m": 9000, "speed_m_s": 15}]}'] * 5000)  # many seconds of work
    headers = {"Content-Type": "application/x-ndjson"}

    def short() -> httpx.Response:
        return patient.client.post("/v1/forecast/batch", content=b"{}", headers=headers)

    for _ in range(2):
        assert wait_for(lambda: short().status_code == 200)
        with patient.client.stream("POST", "/v1/forecast/batch", content=body, headers=headers) as answer:
            assert answer.status_code == 200
            lines = answer.iter_lines()  # kept: the stream ends with it
            assert orjson.loads(next(lines))["energy_wh"] > 0.0
            busy = short()
            assert (busy.status_code, busy.headers.get("retry-after")) == (503, "5")
        assert wait_for(lambda: b"tripwatt_jobs_waiting 0.0" in patient.client.get("/metrics").content)


def test_shutdown_finishes_running_requests(patient: Service, drive: dict[str, Any]) -> None:
    """The last test of this service."""
    service = patient
    with ThreadPoolExecutor(4) as pool:
        workers = service.workers()
        assert len(workers) == 2
        for pid in workers:
            os.kill(pid, signal.SIGSTOP)  # the requests run until the workers go on
        sent = [
            pool.submit(httpx.post, f"{service.url}/v1/forecast", json=drive, timeout=120) for _ in range(4)
        ]
        assert wait_for(lambda: b"tripwatt_requests_running 5.0" in service.client.get("/metrics").content)
        service.client.close()
        service.process.send_signal(signal.SIGTERM)
        for pid in workers:
            os.kill(pid, signal.SIGCONT)
        assert [answer.result().status_code for answer in sent] == [200] * 4
        assert service.process.wait(60) == 0
        assert wait_for(lambda: not any(map(alive, workers)))


def test_a_job_of_a_hung_worker_times_out(hasty: Service, drive: dict[str, Any]) -> None:
    (worker,) = hasty.workers()
    os.kill(worker, signal.SIGSTOP)  # it hangs
    answer = hasty.forecast(drive)
    assert (answer.status_code, answer.json()["type"]) == (504, "/problems/timeout")
    assert wait_for(lambda: hasty.forecast(drive).status_code == 200)
    assert not alive(worker)


def test_workers_do_not_outlive_the_service(hasty: Service) -> None:
    """The last test of this service."""
    workers = hasty.workers()
    hasty.process.kill()
    assert wait_for(lambda: not any(map(alive, workers)))


def test_workers_get_no_secret(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIPWATT_MQTT_PASSWORD", "of-the-broker")
    monkeypatch.setenv("TRIPWATT_MQTT", "mqtt://me:of-the-url@127.0.0.1:9")
    (tmp_path / "logs").mkdir()
    with serving(
        tmp_path / "logs", "--workers", "1", "--cars", f"{tmp_path / 'cars'}", token=TOKEN
    ) as service:
        found = b"".join(Path(f"/proc/{pid}/environ").read_bytes() for pid in service.workers())
    assert b"PATH=" in found
    for secret in (b"of-the-broker", b"of-the-url", TOKEN.encode()):
        assert secret not in found


def test_the_service_conforms_to_its_openapi_document(service: Service) -> None:
    """A small sample; `make bars` covers the schema and sends 500 examples per operation."""
    # tests/server/http/test_journeys.py has a map, test_live.py cars on the road
    found = conformance(
        service.url,
        4,
        seed=3,
        only=PLAIN,
        phases="examples,fuzzing",
        timeout_s=400,
    )
    assert found.clean, found.text
    document = service.client.get("/openapi.json").json()
    assert document["openapi"].startswith("3.1")
    for path in document["paths"].values():
        for operation in path.values():
            content = operation.get("requestBody", {}).get("content", {})
            assert all(
                "/octet" in kind or "nd" in kind or {"example", "examples"} & set(c)
                for kind, c in content.items()
            )


def test_damaged_uploads_are_problem_documents(service: Service) -> None:
    """A small sample; `make bars` sends thousands."""
    found = fuzz(service.url, 30, seed=5)
    assert found.mutants == 120
    assert not found.wrong, found.wrong[:3]
    assert found.statuses[422] > 25
    assert orjson.loads(service.client.get("/readyz").content)["workers"] == 1


def test_the_documentation_lists_every_limit_and_every_problem() -> None:
    page = (Path(__file__).parents[3] / "docs" / "reference" / "service.md").read_text(encoding="utf-8")
    for limit in dataclasses.fields(Limits):
        assert f"| `{limit.name}` | {limit.default:,} |" in page
    for kind in TITLES:
        assert f"`/problems/{kind}`" in page
