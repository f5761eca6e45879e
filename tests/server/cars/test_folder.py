"""What a car's folder holds: no coordinates, no more days than asked for, and nothing after it is forgotten."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest
from tests.server.cars.messages import NOON_S, abrp_messages, measured
from tests.support.drives import example_trip
from tests.support.refusals import refusal, refuses

from tripwatt.errors import InvalidInput
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import CarFile
from tripwatt.server.cars.folder import create_car, digest_of, forget_car, is_car, issue_token, setting_of
from tripwatt.server.cars.live_trip import SILENCE_S
from tripwatt.server.cars.telemetry import sample_from_abrp

LATITUDE, LONGITUDE = 48.137154, 11.576124
DAY_S = 86_400.0


def content(folder: Path) -> bytes:
    return b"\n".join(
        path.read_bytes() + path.name.encode() for path in sorted(folder.rglob("*")) if path.is_file()
    )


def drive(folder: Path, start_s: float, *, ended: bool = True, keep_days: float = math.inf) -> None:
    table = measured(example_trip()).iloc[:400]
    with Car.follow(folder, keep_days=keep_days) as car:
        for message in abrp_messages(table, start_s):
            sample = sample_from_abrp({**message, "lat": LATITUDE, "lon": LONGITUDE})
            assert car.record(sample, now_s=sample.time_s) == "new"
        if ended:
            car._listening_s = start_s
            assert car.end_when_silent(start_s + 400.0 + SILENCE_S + 1.0)


@pytest.mark.parametrize("ended", [True, False])
def test_no_coordinate_is_written(tmp_path: Path, ended: bool) -> None:
    drive(tmp_path / "leaf", NOON_S, ended=ended)
    written = content(tmp_path)
    assert len(written) > 10_000
    for place in (LATITUDE, LONGITUDE):
        for digits in (6, 4, 3, 2):
            assert f"{place:.{digits}f}".encode() not in written
    assert b'"lat"' not in written
    assert b"position" not in written


def test_the_same_trip_is_found_without_coordinates(tmp_path: Path) -> None:
    found = []
    for name, more in (("with", {"lat": LATITUDE, "lon": LONGITUDE}), ("without", {})):
        with Car.follow(tmp_path / name) as car:
            for message in abrp_messages(measured(example_trip()).iloc[:400]):
                car.record(sample_from_abrp({**message, **more}), now_s=NOON_S + 500.0)
            found.append(car.observed())
    assert len(found[0]) > 300
    assert found[0].equals(found[1])


def test_trips_are_erased_after_the_days_that_were_asked_for(tmp_path: Path) -> None:
    folder = tmp_path / "leaf"
    for days in (0, 5, 9):
        drive(folder, NOON_S + days * DAY_S)
    with Car.follow(folder) as car:
        assert len(car.logs()) == 3
        assert car.erase_old(NOON_S + 1000.0 * DAY_S) == 0
    with Car.follow(folder) as car:
        car.keep_days = 7.0
        assert car.erase_old(NOON_S + 10.0 * DAY_S) == 1
        assert car.file.departures(math.inf) == [NOON_S + 5.0 * DAY_S, NOON_S + 9.0 * DAY_S]
        assert car.erase_old(NOON_S + 10.0 * DAY_S) == 0
        car.received_s = None
        car.end_when_silent(NOON_S + 13.0 * DAY_S)  # asked for every hour by those who follow a car
        assert len(car.logs()) == 1
    with Car.follow(folder, keep_days=30.0) as car:  # today is years later
        assert car.logs() == ()


def test_samples_of_a_silent_car_are_erased_and_those_of_a_trip_stay(tmp_path: Path) -> None:
    parked = {"utc": NOON_S, "speed": 0, "soc": 61.0, "is_parked": 1}
    with Car.follow(tmp_path / "parked", keep_days=7.0) as car:
        car.record(sample_from_abrp(parked), now_s=NOON_S)
        car.erase_old(NOON_S + 6.0 * DAY_S)
        assert b"displayed_soc" in content(tmp_path / "parked")
        car.erase_old(NOON_S + 8.0 * DAY_S)
        assert b"displayed_soc" not in content(tmp_path / "parked")
        assert car.record(sample_from_abrp(parked), now_s=NOON_S + 8.0 * DAY_S) != "new"
    drive(tmp_path / "leaf", NOON_S, ended=False)
    with Car.follow(tmp_path / "leaf") as car:
        assert car.trip is not None
        car.keep_days = 7.0
        car.erase_old(NOON_S + 3000.0 * DAY_S)
        assert len(car.observed()) > 300
    with Car.follow(tmp_path / "leaf") as car:
        assert len(car.observed()) > 300, "on disk, too"


@pytest.mark.parametrize("ended", [True, False])
def test_nothing_is_left_of_a_forgotten_car(tmp_path: Path, ended: bool) -> None:
    folder = tmp_path / "leaf"
    create_car(folder, "nissan_leaf_24")
    issue_token(folder)
    drive(folder, NOON_S, ended=ended)
    with Car.follow(folder) as car:
        car.set_plan({"points": [[LATITUDE, LONGITUDE]]}, NOON_S)
    assert f"{LATITUDE}".encode() in content(tmp_path)  # of the plan, while it is needed
    forget_car(folder)
    assert not folder.exists()
    assert f"{LATITUDE}".encode() not in content(tmp_path)
    assert content(tmp_path) == b""


def test_an_erasure_that_fails_says_what_is_left_and_is_repeated(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    create_car(folder, "nissan_leaf_24")
    (folder / "uploads" / "upload01").mkdir(parents=True)

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", refuse)
        refuses(r"cannot erase the car: .*uploads: got Permission denied", forget_car, folder)
    assert is_car(folder), "its name is erased last"
    forget_car(folder)
    assert not folder.exists()


@pytest.mark.parametrize("name", ["a b", ".hidden", "-x", "ü", "x" * 65])
def test_a_name_is_part_of_a_path_and_of_a_url(tmp_path: Path, name: str) -> None:
    refuses("name cannot be used", Car.follow, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_refused(folder: Path) -> None:
    folder.write_text("")
    refuses("cannot write the folder", Car.follow, folder)


def test_a_car_that_another_run_has_made_meanwhile_is_in_use(folder: Path, monkeypatch) -> None:
    monkeypatch.setattr(CarFile, "prepare", lambda *_: False)
    allowed = "a new or empty folder, or that of a car on the road"
    found = refusal(create_car, folder, "nissan_leaf_24")
    assert found == f"folder in use: {folder}: got not empty; allowed: {allowed}"


def test_a_car_that_is_followed_is_not_forgotten_beside_its_service(folder: Path) -> None:
    with Car.follow(folder), pytest.raises(InvalidInput, match="another run"):
        forget_car(folder)
    forget_car(folder)
    assert not folder.exists()


def test_a_token_is_that_of_one_car_and_is_not_stored(folder: Path) -> None:
    assert not (setting_of(folder, "token") is not None)
    token, other = issue_token(folder), issue_token(folder.with_name("other"))
    assert setting_of(folder, "token") is not None
    assert setting_of(folder, "token") == digest_of(token)
    assert setting_of(folder.with_name("other"), "token") == digest_of(other)
    again = issue_token(folder)
    assert setting_of(folder, "token") == digest_of(again)
    assert len({token, other, again}) == 3
    assert again.encode() not in content(folder)
    assert setting_of(folder.with_name("third"), "token") is None
