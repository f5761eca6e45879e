"""What `tripwatt demo` serves: real trips, and a made-up map."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import subprocess
import sys
import time
import urllib.request
from email.message import Message
from http.client import BadStatusLine
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

import httpx
import numpy as np
import pytest
from tests.support.service_process import wait_for
from tools.data import country

from tripwatt.roads.maps.engine import valhalla_folder
from tripwatt.roads.maps.extract import read_objects
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import open_car
from tripwatt.server.http import demo
from tripwatt.server.http.settings import Settings


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tripwatt.server.http.demo.find_spec", lambda name: None)
        steps: list[str] = []
        settings = demo.make_demo(tmp_path_factory.mktemp("demo"), steps.append)[0]
        assert steps == ["car with the diary of 14 real trips"]
        return settings


def test_the_country_is_that_of_the_tool(tmp_path: Path) -> None:
    country.write_example(tmp_path)
    extract = "example-country.osm.pbf"
    assert [*read_objects(tmp_path / extract)] == [*read_objects(demo.HERE / extract)]
    assert np.array_equal(np.load(tmp_path / "heights.npy"), np.load(demo.HERE / "heights.npy"))
    assert sum(file.stat().st_size for file in demo.HERE.iterdir() if file.is_file()) < 100_000


def test_the_car_has_a_diary_and_a_drive_of_this_moment(made: Settings) -> None:
    assert made.cars is not None
    assert made.atlas.map == ""
    assert len(open_car(made.cars / demo.CAR).diary) == 14
    begins_s = time.time()
    rest = [*demo.depart(made)]
    assert all(begins_s < time_s < begins_s + 3600.0 for time_s, _ in rest)
    assert [later - time_s for (time_s, _), (later, _) in itertools.pairwise(rest)] == pytest.approx(
        [demo.EVERY_S] * (len(rest) - 1), abs=0.01
    )
    with Car.follow(made.cars / demo.CAR) as car:
        trip = car.shown(time.time())["trip"]
        assert trip is not None
        assert trip["duration_s"] == pytest.approx(
            len(rest) * demo.EVERY_S * demo.DRIVEN / (1.0 - demo.DRIVEN), rel=0.1
        )
        assert car.plan is not None


def test_the_drive_has_the_samples_of_its_example_from_its_beginning_on() -> None:
    times, speeds = [10.0 + 0.5 * k for k in range(41)], [float(k) for k in range(41)]
    trip = {"request": {"samples": {"time_s": times, "speed_m_s": speeds}}, "observed": {"bms_soc": speeds}}
    found = [*demo._samples(trip, 1000.0)]
    assert [time_s for time_s, _ in found] == [1000.0, 1005.0, 1010.0, 1015.0]
    assert [values for _, values in found] == [{"speed_m_s": k, "soc": k} for k in (0.0, 10.0, 20.0, 30.0)]


def test_samples_are_sent_at_their_times_as_those_of_a_route_planner(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, slept, sent = [100.0], list[float](), list[tuple[Any, ...]]()

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now_s[0] += seconds

    def urlopen(request: urllib.request.Request, timeout: float) -> contextlib.nullcontext[None]:
        sent.append((request.full_url, request.method, json.loads(request.data or b""), timeout))  # type: ignore[arg-type]
        return contextlib.nullcontext()

    monkeypatch.setattr(time, "time", lambda: now_s[0])
    monkeypatch.setattr(time, "sleep", sleep)
    monkeypatch.setattr(urllib.request, "urlopen", urlopen)
    values = {"speed_m_s": 10.0, "voltage_v": 360.0, "current_a": -20.0, "elevation_m": 5.0}
    demo.send(iter([(103.0, values), (101.0, values)]), "http://h", "secret")
    assert slept == [3.0, 0.0]
    message = {"utc": 103.0, "speed": 36.0, "voltage": 360.0, "current": -20.0}
    url = "http://h/v1/telemetry"
    assert sent[0] == (url, "POST", {"token": "secret", "tlm": message}, demo.EVERY_S)
    assert [document["tlm"]["utc"] for _, _, document, _ in sent] == [103.0, 101.0]


@pytest.mark.parametrize(
    "error", [HTTPError("", 503, "", Message(), None), ConnectionResetError(), BadStatusLine("")]
)
def test_a_message_that_does_not_arrive_does_not_end_the_drive(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    sent = list[urllib.request.Request]()

    def urlopen(request: urllib.request.Request, timeout: float) -> contextlib.nullcontext[None]:
        sent.append(request)
        if len(sent) == 1:
            raise error
        return contextlib.nullcontext()

    monkeypatch.setattr(urllib.request, "urlopen", urlopen)
    values = {"speed_m_s": 10.0, "voltage_v": 360.0, "current_a": -20.0}
    demo.send(iter([(1.0, values), (2.0, values)]), "http://h", "secret")
    assert len(sent) == 2


def test_what_is_there_is_used_again(made: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    assert made.cars is not None
    monkeypatch.setattr(demo, "create_car", lambda *_, **__: pytest.fail("it is made again"))
    monkeypatch.setattr("tripwatt.server.http.demo.find_spec", lambda name: None)
    assert demo.make_demo(made.cars.parent)[0] == made


def test_a_car_of_a_demo_that_was_killed_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tripwatt.server.http.demo.find_spec", lambda name: None)
    with monkeypatch.context() as killed:
        killed.setattr(Car, "add", lambda car, logs: (_ for _ in ()).throw(KeyboardInterrupt()))
        with pytest.raises(KeyboardInterrupt):
            demo.make_demo(tmp_path)
    assert not (tmp_path / "cars").exists()
    settings, _ = demo.make_demo(tmp_path)
    assert settings.cars is not None
    assert len(open_car(settings.cars / demo.CAR).diary) == 14
    assert [entry.name for entry in tmp_path.iterdir()] == ["cars"]


@pytest.mark.skipif(valhalla_folder() is None, reason="needs Valhalla's programs: TRIPWATT_VALHALLA")
def test_the_map_has_heights_stations_and_its_own_words(tmp_path: Path) -> None:
    place = demo.example_map(tmp_path)
    about = json.loads((place / "map.json").read_text())
    assert about["attribution"] == "made-up roads: no place of this map exists"
    assert (about["terrain"]["known"], about["terrain"]["tiles"], about["terrain"]["missing"]) == (
        True,
        1,
        [],
    )
    assert about["stations"] > 5
    tile = np.fromfile(tmp_path / "heights" / demo.TILE, ">i2").reshape(1201, 1201)
    step = np.linspace(0.0, 1.0, 1201)
    truth = country.Heights(country.EXAMPLE_SEED).grid_m(
        math.floor(country.SOUTH_DEG) + 1.0 - step, math.floor(country.WEST_DEG) + step
    )
    assert np.quantile(np.abs(tile - truth), 0.99) < 5.0, "the rest is the shore and the edges"


def test_the_command_serves_the_car_while_it_drives(tmp_path: Path, made: Settings) -> None:
    pytest.importorskip("osmium", reason="needs the extra tripwatt[routing]")
    assert made.cars is not None
    with (tmp_path / "log").open("wb") as log:
        command = [
            sys.executable,
            "-m",
            "tripwatt.command",
            "demo",
            "--port",
            "0",
            "--folder",
            f"{made.cars.parent}",
        ]
        environment = {name: value for name, value in os.environ.items() if name != "TRIPWATT_TOKEN"}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=environment)
        try:
            assert process.stdout is not None
            url = process.stdout.readline().split()[1].partition("/#")[0]

            def document() -> dict[str, object]:
                found: dict[str, object] = httpx.get(f"{url}/v1/live/{demo.CAR}", timeout=30.0).json()
                return found

            assert wait_for(lambda: document()["messages"]["new"] > 0)  # type: ignore[index]
            found = document()
            assert found["forecast"] is not None
            assert found["faults"] == []
        finally:
            process.terminate()
            assert process.wait(60) in (0, -15, 143)
