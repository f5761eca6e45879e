"""Trips that cars finish on the road are learned by the running service, once, also after it was killed."""

from __future__ import annotations

import asyncio
import signal
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.server.cars.messages import abrp_messages, measured
from tests.support.service_process import Service, serving, wait_for

from tripwatt.server.cars.folder import create_car, issue_token, open_car
from tripwatt.server.http import learning as module
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.learning import LearningCars
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.pool import JobResult
from tripwatt.server.http.settings import Settings
from tripwatt.study.synthetic import synthetic_fleet

HOUR_S = 3600.0
PARKED = {"speed": 0.0, "is_parked": 1}


def test_a_car_that_cannot_learn_is_tried_again_later_and_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it finishes meanwhile is learned as well; a car without news is not asked."""
    create_car(tmp_path / "zoe", "nissan_leaf_24")
    news, asked, slept = iter([True, True, True, False]), list[str](), list[float]()
    answers = iter([False, False, True])

    async def learn(car: str) -> bool:
        asked.append(car)
        answer = next(answers)
        if answer:
            learning.learn_soon(car)  # another trip ends
        return answer

    async def sleep(seconds: float) -> None:
        slept.append(seconds)

    async def run() -> None:
        learning.learn_soon("zoe")
        learning.learn_soon("leaf")
        learning.learn_soon("leaf")
        await asyncio.gather(*learning._teaching.values())

    learning = LearningCars(Settings(cars=tmp_path), print)
    monkeypatch.setattr(learning, "learn_finished", learn)
    monkeypatch.setattr(learning, "_has_news", lambda car: car == "leaf" and next(news))
    monkeypatch.setattr(module.asyncio, "sleep", sleep)
    asyncio.run(run())
    assert (asked, slept) == (["leaf"] * 3, [module.FIRST_DELAY_S, 2.0 * module.FIRST_DELAY_S])
    assert (learning._teaching, learning._news) == ({}, set())


@pytest.mark.parametrize("status", [200, 422])
def test_trips_are_learned_when_the_worker_has_learned_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    """Not before: the next trip of the car would be asked for at once again."""

    async def start() -> None:
        pass

    async def learn(*_: object, **__: object) -> JobResult:
        await asyncio.sleep(0.01)
        return JobResult(status, b"{}", 0.0)

    learning = LearningCars(Settings(cars=tmp_path), print)
    monkeypatch.setattr(learning.learners, "start", start)
    monkeypatch.setattr(learning.learners, "run", learn)
    assert asyncio.run(learning.learn_finished("leaf")) == (status == 200)


@pytest.fixture
def cars(tmp_path: Path) -> Path:
    folder = tmp_path / "cars"
    create_car(folder / "leaf", "nissan_leaf_24")
    return folder


def test_a_request_that_names_a_car_or_a_model_keeps_it(cars: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    issue_token(cars / "leaf")
    issue_token(cars / "zoe")
    asked: list[Any] = []
    monkeypatch.setattr(Jobs, "model_named", lambda _, document: asked.append(document))
    live = LiveCars(Settings(cars=cars), None, print)  # type: ignore[arg-type]

    def model_of(name: str, request: dict[str, Any]) -> dict[str, Any]:
        made = live.by_name(name).model_of
        assert made is not None
        made(request)
        return dict(asked.pop())

    assert model_of("leaf", {"soc": 0.5, "car": None}) == {"soc": 0.5, "car": "leaf"}
    for name in ("model", "car"):
        assert model_of("leaf", {name: "x"}) == {name: "x"}
    assert model_of("zoe", {"soc": 0.5}) == {"soc": 0.5}, "it has no description"
    live.close()


def followed(cars: Path, place: Path) -> Any:
    return serving(place, "--workers", "1", "--cars", f"{cars}")


def drive(service: Service, token: str, number: int, start_s: float) -> dict[str, Any]:
    """Send a whole trip and its end; what the service forecast of it half-way."""
    messages = list(abrp_messages(measured(synthetic_fleet(2, seed=5).logs[number].samples), start_s))
    end_s = messages[-1]["utc"]
    half = len(messages) // 2
    shown: dict[str, Any] = {}
    with httpx.Client(base_url=service.url) as client:
        for k, message in enumerate(
            [*messages, *({"utc": end_s + s, **PARKED} for s in (1.0, 90.0, 130.0, 170.0))]
        ):
            if k % 8 and k < len(messages):
                continue  # every eighth is enough for this car
            sent = client.post("/v1/telemetry", json={"token": token, "tlm": message})
            assert sent.status_code == 200, sent.text
            if k >= half and not shown:
                shown = client.get("/v1/live/leaf").json()
    return shown


def diary(service: Service) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = service.client.get("/v1/cars/leaf").json()["diary"]
    return found


def test_a_trip_of_the_road_enters_the_diary_and_teaches_without_a_restart(
    cars: Path, tmp_path: Path
) -> None:
    token, plan = (
        issue_token(cars / "leaf"),
        {"links": [{"length_m": 15_000.0, "speed_m_s": 14.0}], "soc": 0.8},
    )
    start_s = time.time() - 6.0 * HOUR_S
    (tmp_path / "logs").mkdir()
    with followed(cars, tmp_path / "logs") as service:
        (leaf,) = service.client.get("/v1/live").json()["cars"]
        assert (leaf["car"], leaf["seconds_since_message"], leaf["trip"]) == ("leaf", None, None)
        by_book = service.forecast({**plan, "car": "leaf"}).json()["energy_wh"]
        at_departure = service.client.put("/v1/live/leaf/plan", json=plan).json()["forecast"]
        assert at_departure["energy_wh"] == pytest.approx(by_book, rel=1e-9), "by the car's own model"
        assert at_departure["distance_m"] == pytest.approx(15_000.0, rel=1e-3)
        shown = drive(service, token, 0, start_s)
        assert shown["trip"]["distance_m"] > 0.0
        assert 0.0 < shown["soc"] <= 1.0
        assert wait_for(lambda: len(diary(service)) == 1)
        (row,) = diary(service)
        assert [row["trip"]] == [log.trip_id for log in open_car(cars / "leaf").logs()]
        first, *later = row["on_the_way"]
        assert (first["at_s"], first["energy_wh"]) == (0.0, pytest.approx(at_departure["energy_wh"]))
        assert later[0]["energy_wh"] == pytest.approx(shown["forecast"]["energy_wh"])
        assert later[0]["low_wh"] < later[0]["energy_wh"] < later[0]["high_wh"]
        assert service.client.get("/v1/cars/leaf").json()["learning"]["entries"] == 1
        learned = service.forecast({**plan, "car": "leaf"}).json()["energy_wh"]
        assert learned != by_book, "the posterior is that of the trip"
        assert learned == pytest.approx(
            service.client.put("/v1/live/leaf/plan", json=plan).json()["forecast"]["energy_wh"], rel=1e-9
        )


def test_a_service_that_is_killed_at_the_end_of_a_trip_counts_it_once(cars: Path, tmp_path: Path) -> None:
    token, start_s = issue_token(cars / "leaf"), time.time() - 6.0 * HOUR_S
    (tmp_path / "logs").mkdir()
    with followed(cars, tmp_path / "logs") as service:
        drive(service, token, 0, start_s)
        workers = service.workers()
        service.process.send_signal(signal.SIGKILL)
        service.process.wait(60)
    assert wait_for(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers))
    assert len(open_car(cars / "leaf").logs()) == 1
    with followed(cars, tmp_path / "logs") as service:
        assert wait_for(lambda: len(diary(service)) == 1)
        drive(service, token, 1, start_s + 2.0 * HOUR_S)
        assert wait_for(lambda: len(diary(service)) == 2)
    own = open_car(cars / "leaf")
    assert own.diary.table["trips_learned"].tolist() == [0, 1]
    assert (len(own.logs()), len(own.model().trip_ids_)) == (2, 2)
