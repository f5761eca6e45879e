"""The endpoints with a pool that only pretends: status, headers, packing, counts and bounds of parameters."""

from __future__ import annotations

import asyncio
import gzip
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import httpx
import orjson
import pytest

from tripwatt.server.http import app as app_module
from tripwatt.server.http import service as room
from tripwatt.server.http.app import create_app
from tripwatt.server.http.pool import JobResult
from tripwatt.server.http.settings import Limits, Settings
from tripwatt.server.http.sharing import Places

JSON = "application/json"


class Pool:
    """Answers every job with its content, and notes the jobs."""

    def __init__(self, settings: Settings, log_event: Callable[..., None]) -> None:
        self.settings, self.log_event = settings, log_event
        self.places = Places(settings.limits.waiting, "too many requests wait", {"Retry-After": "1"})
        self.ready, self.lost = 1, 0
        self.jobs: list[tuple[dict[str, Any], bytes]] = []
        self.result = JobResult(200, b'{"a":1}', 0.5)
        made.append(self)

    async def run(self, job: dict[str, Any], body: bytes, *, may_queue: bool = False) -> JobResult:
        self.jobs.append((job, body))
        return self.result


made: list[Pool] = []


class Served:
    """An application and its client."""

    def __init__(self, **limits: Any) -> None:
        self.app: Any = create_app(Settings(limits=Limits(**limits)))
        self.pool = made[-1]

    def __call__(self, path: str, method: str = "GET", **more: Any) -> httpx.Response:
        return asyncio.run(self.ask(path, method, **more))

    async def ask(self, path: str, method: str = "GET", **more: Any) -> httpx.Response:
        transport = httpx.ASGITransport(self.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.request(method, path, **more)

    def post(self, path: str, content: Any = b"{}", media_type: str = JSON, **more: Any) -> httpx.Response:
        return self(path, "POST", content=content, headers={"Content-Type": media_type}, **more)


@pytest.fixture(autouse=True)
def _pretending(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "WorkerPool", Pool)
    monkeypatch.setattr(
        room.Jobs, "from_folders", lambda *_: SimpleNamespace(fleets={})
    )  # a model takes a second
    made.clear()


def test_bodies_of_1000_bytes_are_packed_at_level_4() -> None:
    served = Served()
    for size, packed in ((999, None), (1000, "gzip")):
        served.pool.result = JobResult(200, b"x" * size, 0.5)
        found = served.post("/v1/forecast")
        assert (found.headers.get("content-encoding"), len(found.content)) == (packed, size)
    assert (served.app.app.minimum_size, served.app.app.compresslevel) == (1000, 4)
    assert gzip.compress(b"x" * 1000, 4) != gzip.compress(b"x" * 1000, 1)


def test_a_job_gets_its_body_whole() -> None:
    served = Served()

    async def parts() -> Any:
        for part in (b"[", b"1", b"]"):
            yield part

    assert served.post("/v1/forecast", b"[1]").json() == {"a": 1}
    assert served.post("/v1/forecast/update", parts()).status_code == 200
    assert served.post("/v1/vehicles", b"").status_code == 200
    assert served.pool.jobs == [
        ({"kind": "forecast", "fields": None}, b"[1]"),
        ({"kind": "update", "fields": None}, b"[1]"),
        ({"kind": "describe", "fields": None}, b""),
    ]


def test_the_time_of_a_job_is_counted_by_its_kind() -> None:
    served = Served()
    served.post("/v1/forecast")
    text = served("/metrics").text
    assert 'tripwatt_work_seconds_sum{kind="forecast"} 0.5' in text
    served.pool.places.add(4)
    served.pool.ready, served.pool.lost = 3, 2
    lines = served("/metrics").text.splitlines()
    for line in ("tripwatt_jobs_waiting 4.0", "tripwatt_workers_ready 3.0", "tripwatt_workers_lost 2.0"):
        assert line in lines


def test_a_problem_of_a_job_gets_the_id_of_its_request() -> None:
    served = Served()
    served.pool.result = JobResult(422, orjson.dumps({"status": 422}), 0.5)
    found = served("/v1/forecast", "POST", content=b"", headers={"Content-Type": JSON, "X-Request-ID": "me"})
    assert (found.status_code, found.headers["content-type"]) == (422, "application/problem+json")
    assert found.json() == {"status": 422, "instance": "me"}


def test_a_body_is_not_read_while_too_many_requests_wait() -> None:
    served = Served(waiting=2)
    served.pool.places.taken["another"] = 1
    assert served.post("/v1/forecast").status_code == 200
    served.pool.places.taken["another"] = 2
    found = served.post("/v1/forecast")
    assert (found.status_code, found.json()["detail"]) == (503, "too many requests wait")
    assert found.headers["retry-after"] == "1"


@pytest.mark.parametrize("path", ["/v1/models/", "/v1/cars/", "/healthz/", "/assets", "/v1/forecast/"])
def test_no_answer_leads_to_the_host_that_a_request_names(path: str) -> None:
    found = Served()(path, headers={"Host": "localhost:1"})
    assert found.status_code == 404
    assert "location" not in found.headers
    assert "localhost" not in found.text


def test_a_tile_is_kept_for_an_hour_and_a_forecast_is_not() -> None:
    served = Served()
    tile = served("/v1/tiles/3/2/1")
    assert tile.headers["cache-control"] == "private, max-age=3600"
    assert tile.headers["content-type"] == "application/vnd.mapbox-vector-tile"
    assert served.post("/v1/forecast").headers["cache-control"] == "no-store"


@pytest.mark.parametrize(("path", "kind"), [("/v1/map", "journeys.describe"), ("/v1/vehicles", "vehicles")])
def test_what_does_not_change_is_asked_once(path: str, kind: str) -> None:
    served = Served()
    assert [served(path).json() for _ in range(3)] == [{"a": 1}] * 3
    assert served.pool.jobs == [({"kind": kind}, b"")]


def test_a_document_that_fails_is_an_internal_error_and_is_not_kept() -> None:
    served = Served()
    served.pool.result = JobResult(422, b"{}", 0.5)
    assert served("/v1/map").status_code == 500
    served.pool.result = JobResult(200, b"{}", 0.5)
    assert served("/v1/map").status_code == 200


def test_health_and_readiness() -> None:
    served = Served()
    served.pool.ready = 2
    assert served("/healthz").json() == {"status": "alive", "workers": 2}
    assert served("/readyz").json() == {"status": "ready", "workers": 2}
    assert [served(path).status_code for path in ("/healthz", "/readyz")] == [200, 200]
    served.pool.ready = 0
    assert served("/healthz").json() == {"status": "alive", "workers": 0}
    busy = served("/readyz")
    assert (busy.status_code, busy.headers["retry-after"]) == (503, "1")


LINES = "application/x-ndjson"


@pytest.mark.parametrize("media_type", [LINES, "application/jsonl", "application/ndjson"])
def test_a_batch_is_answered_line_by_line(media_type: str) -> None:
    served = Served()
    found = served.post("/v1/forecast/batch", b"{}\n[]", media_type)
    assert (found.status_code, found.headers["content-type"]) == (200, LINES)
    assert found.content == b'{"a":1}\n' * 2
    assert [body for _, body in served.pool.jobs] == [b"{}", b"[]"]


def test_as_many_batches_as_the_limit_run() -> None:
    served = Served(batches=1)
    api_batch = served.post("/v1/forecast/batch", b"{}", LINES)
    assert api_batch.status_code == 200
    assert served.post("/v1/forecast/batch", b"{}", LINES).status_code == 200  # the place is free again

    async def run() -> list[httpx.Response]:
        runs, accept = asyncio.Event(), asyncio.Event()

        async def held(job: dict[str, Any], body: bytes, *, may_queue: bool = False) -> JobResult:
            runs.set()
            await accept.wait()
            return served.pool.result

        served.pool.run = held  # type: ignore[method-assign]
        more: dict[str, Any] = {"content": b"{}", "headers": {"Content-Type": LINES}}
        first = asyncio.create_task(served.ask("/v1/forecast/batch", "POST", **more))
        await runs.wait()
        second = await served.ask("/v1/forecast/batch", "POST", **more)
        accept.set()
        return [await first, second]

    first, second = asyncio.run(run())
    assert first.content == b'{"a":1}\n'
    assert (second.status_code, second.headers["retry-after"]) == (503, "5")
    assert second.json()["detail"] == "too many batches"


@pytest.mark.parametrize(
    ("method", "path", "status", "kind"),
    [
        ("GET", "/v1/nothing", 404, "not-found"),
        ("DELETE", "/v1/forecast", 405, "method-not-allowed"),
    ],
)
def test_errors_of_the_framework_are_problem_documents(
    method: str, path: str, status: int, kind: str
) -> None:
    found = Served()(path, method)
    assert (found.status_code, found.json()["type"]) == (status, f"/problems/{kind}")
    assert ("allow" in found.headers) == (status == 405)


def test_all_methods_of_a_path_are_allowed() -> None:
    served = Served()
    assert served("/v1/vehicles", "DELETE").headers["allow"] == "GET, HEAD, POST"


def test_what_is_wrong_with_a_parameter_is_cut_after_80_characters() -> None:
    fault = Served()("/v1/places", params={"q": "x", "limit": "y" * 100}).json()["faults"][0]
    assert (fault["where"], fault["got"]) == ("query.limit", "'" + "y" * 79)


def test_assets_never_change_and_the_page_may() -> None:
    served = Served()
    asset = next((app_module.PAGE / "assets").iterdir())
    found = served(f"/assets/{asset.name}")
    assert (found.status_code, found.headers["cache-control"]) == (
        200,
        "public, max-age=31536000, immutable",
    )
    page = served("/")
    assert (page.status_code, page.headers["cache-control"]) == (200, "no-cache")
    assert served("/index.html").status_code == 404


def test_the_page_and_foreign_documentation_are_not_in_the_document() -> None:
    served = Served()
    document = served("/openapi.json").json()
    assert "/" not in document["paths"]
    assert [served(path).status_code for path in ("/docs", "/redoc")] == [404, 404]
    assert "security" not in document


def test_pages_of_other_origins_read_answers_only_where_they_are_named() -> None:
    asked = {"Origin": "https://a.example", "Access-Control-Request-Method": "POST"}
    served = Served()
    for method, status in (("OPTIONS", 405), ("GET", 200)):
        found = served("/healthz", method, headers=asked)
        assert found.status_code == status
        assert not [name for name in found.headers if name.startswith("access-control")]
    served.app = create_app(Settings(token="x" * 16, cors_origins=("https://a.example",)))
    allowed = served("/v1/forecast", "OPTIONS", headers=asked)  # before the token is asked for
    assert allowed.status_code == 200
    assert allowed.headers["access-control-allow-origin"] == "https://a.example"
    assert "Authorization" in allowed.headers["access-control-allow-headers"]
    wanted = asked | {"Access-Control-Request-Headers": "if-none-match, authorization"}
    assert served("/v1/cars", "OPTIONS", headers=wanted).status_code == 200
    assert (
        served("/v1/forecast", "OPTIONS", headers={**asked, "Origin": "https://b.example"}).status_code == 400
    )
    answer = served("/v1/models", headers={"Origin": "https://a.example"})
    assert answer.status_code == 401
    assert answer.headers["access-control-allow-origin"] == "https://a.example"
    assert "access-control-allow-credentials" not in answer.headers
    exposed = set(answer.headers["access-control-expose-headers"].split(", "))
    assert {"ETag", "Location", "Retry-After"} <= exposed


def test_the_document_has_the_path_in_front() -> None:
    served = Served()
    assert "servers" not in served("/openapi.json").json()
    served.app = create_app(Settings(prefix="/tripwatt"))
    assert served("/tripwatt/openapi.json").json()["servers"] == [{"url": "/tripwatt"}]
