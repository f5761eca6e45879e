"""Jobs of cars that learn, without HTTP."""

from __future__ import annotations

import datetime as dt
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tripwatt.auditing import audit
from tripwatt.errors import Fault
from tripwatt.server.cars.car_file import CarFile, Database
from tripwatt.server.cars.folder import is_car
from tripwatt.server.http.car_jobs import (
    PROGRESS,
    CarJobs,
    _diary_entry,
    _file_documents,
    preview_logs,
    read_progress,
    upload_tables,
)
from tripwatt.server.http.car_schemas import plain
from tripwatt.server.http.problems import Problem
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import TripSet


def test_without_a_folder_there_are_no_cars() -> None:
    jobs = CarJobs()
    assert jobs.folders() == []
    assert jobs.model("any") is None
    assert jobs.list() == {"cars": None, "damaged": {}}
    with pytest.raises(Problem) as caught:
        jobs.show("any")
    assert caught.value.kind == "no-live"


def test_an_upload_is_named_by_letters_and_digits(tmp_path: Path) -> None:
    for name in ("good0001", "empty001"):
        (tmp_path / "uploads" / name / "tables").mkdir(parents=True)
    (tmp_path / "uploads" / "good0001" / "tables" / "t00.csv").write_text("a\n1\n")
    assert upload_tables(tmp_path, "good0001").name == "tables"
    for name in ("..", "", "missing1", "empty001", "../uploads/good0001"):
        with pytest.raises(Problem):
            upload_tables(tmp_path, name)


def test_the_first_five_faults_of_a_file_are_shown_without_where_it_is_kept(tmp_path: Path) -> None:
    faults = [Fault("empty value", f"{tmp_path}/t00.csv, row {k}") for k in range(9)]
    kind = SimpleNamespace(files=[SimpleNamespace(name="t00.csv")], faults=faults, tables={})
    shown, ignored = _file_documents([kind], None, ["t01.csv"], tmp_path)  # type: ignore[list-item]
    assert [fault["where"] for fault in shown["faults"]] == [f"t00.csv, row {k}" for k in range(5)]
    assert (ignored["name"], ignored["state"], ignored["faults"]) == ("t01.csv", "ignored", [])


def test_what_is_not_finite_is_null() -> None:
    given = [1.5, -2.0, 0.0, math.nan, math.inf, -math.inf, 3, "a", None]
    assert [plain(value) for value in given] == [1.5, -2.0, 0.0, None, None, None, 3, "a", None]


def test_a_preview_has_the_sums_and_ends_of_its_drives() -> None:
    made = synthetic_fleet(3, seed=2)
    first, *others = made.logs
    bare = replace(first, samples=first.samples.drop(columns="ambient_temperature_degc"))
    three = TripSet("three", (bare, *others))
    found = preview_logs(three, audit(three))
    trips = made.trips
    assert (found["logs"], found["drives"]) == (3, 3)
    assert [(one["count"], one["consequence"]) for one in found["findings"]] == [(1, "noted")]
    assert found["distance_m"] == pytest.approx(sum(trip.distance_m for trip in trips))
    assert found["duration_s"] == pytest.approx(sum(trip.duration_s for trip in trips))
    assert found["energy_wh"] == pytest.approx(sum(trip.observed_energy_wh or 0.0 for trip in trips))
    days = sorted(log.context.started_at for log in made.logs if log.context.started_at)
    ends = [dt.datetime.fromisoformat(found[name]) for name in ("from_date", "to_date")]
    assert all(end.tzinfo is not None for end in ends)
    assert ends == [days[0].astimezone(), days[-1].astimezone()]
    air = [float(log.samples["ambient_temperature_degc"].iloc[0]) for log in others]
    assert found["ambient_degc"] == [min(air), max(air)]
    one = TripSet("one", (bare,))
    without = preview_logs(one, audit(one))
    assert (without["drives"], without["ambient_degc"]) == (1, None)


def test_a_departure_of_the_diary_has_its_zone_or_is_not_known() -> None:
    car: Any = SimpleNamespace(forecasts_of=lambda trip: ())
    rows = ({"trip_id": "a", "started_at": text} for text in ("2024-05-01T08:00:00", ""))
    dated, undated = (_diary_entry(row, car)["started_at"] for row in rows)
    assert dt.datetime.fromisoformat(dated) == dt.datetime(2024, 5, 1, 8).astimezone()
    assert dt.datetime.fromisoformat(dated).tzinfo is not None
    assert undated is None


@pytest.mark.parametrize(
    ("text", "progress"),
    [(b'{"done": 2, "total": 5}', (2, 5)), (b'{"done": 2}', (0, None)), (b"{", (0, None)), (None, (0, None))],
)
def test_progress_is_that_of_its_file(
    tmp_path: Path, text: bytes | None, progress: tuple[int, int | None]
) -> None:
    place = tmp_path / "uploads" / "good0001"
    place.mkdir(parents=True)
    if text is not None:
        (place / PROGRESS).write_bytes(text)
    assert read_progress(tmp_path, "good0001") == progress


def test_one_of_several_calls_at_once_makes_a_car(tmp_path: Path) -> None:
    def make(title: str) -> str:
        try:
            return f"{CarJobs(tmp_path).create('my leaf', title)['car']}"
        except Problem as problem:
            return problem.kind

    with ThreadPoolExecutor(6) as threads:
        found = sorted(threads.map(make, ["nissan_leaf_24", "vw_id3"] * 3))
    assert found[0:5] == ["name-taken"] * 5
    assert found[5] in ("nissan_leaf_24", "vw_id3")
    assert CarJobs(tmp_path).list()["cars"][0]["car"] == found[5]


@pytest.mark.parametrize("step", ["folder", "file", "tables"])
def test_a_car_can_be_made_where_a_killed_call_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    """Whatever it left, nothing of it is shown as a car, and the next call makes the car."""

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    jobs = CarJobs(tmp_path)
    owner, method = {
        "folder": (CarFile, "prepare"),
        "file": (CarFile, "read"),
        "tables": (Database, "put_settings"),
    }[step]
    with monkeypatch.context() as patch:
        patch.setattr(owner, method, killed)
        with pytest.raises(KeyboardInterrupt):
            jobs.create("my leaf", "nissan_leaf_24")
    assert (tmp_path / "my-leaf").is_dir()
    assert not is_car(tmp_path / "my-leaf")
    assert jobs.list()["cars"] == []
    assert jobs.create("my leaf", "nissan_leaf_24")["name"] == "my-leaf"
    with pytest.raises(Problem) as caught:
        jobs.create("my leaf", "nissan_leaf_24")
    assert caught.value.kind == "name-taken"


def test_the_name_of_a_damaged_car_is_taken(tmp_path: Path) -> None:
    jobs = CarJobs(tmp_path)
    (tmp_path / "leaf").mkdir()
    (tmp_path / "leaf" / "car.sqlite").write_bytes(b"no database" * 1000)
    with pytest.raises(Problem) as caught:
        jobs.create("leaf", "nissan_leaf_24")
    assert caught.value.kind == "name-taken"
