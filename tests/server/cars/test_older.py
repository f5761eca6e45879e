"""Folders that 0.2.0 and 0.3.0.dev0 wrote: trips, diary, model and token are kept, whatever is killed in between, and damage is told."""

from __future__ import annotations

import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pytest

pytest.importorskip("deltalake", reason="the extra tripwatt[fleet] is not installed")

from tripwatt.errors import InvalidInput
from tripwatt.server.cars import older
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import digest_of, forget_car, is_car, open_car, setting_of

FIXTURE = Path(__file__).parents[2] / "fixtures" / "car-0.3.0.dev0.zip"
"""A Leaf that learned two of three logs and a trip of the road, has finished a second one, and is on a third; as 0.3.0.dev0 wrote it."""

TOKEN = "lQXnsmSwhaBlsO9xrf1Eag2RUiIj6Sbe"
ROAD = ("leaf-20231114T221320Z", "leaf-20231115T221320Z")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    with zipfile.ZipFile(FIXTURE) as packed:
        packed.extractall(tmp_path / "leaf")
    return tmp_path / "leaf"


def all_is_there(place: Path) -> None:
    own = open_car(place)
    assert [path.name for path in place.iterdir()] == ["car.sqlite"]
    assert (own.label, own.vehicle.name, own.file.setting("base"), len(own.left_out)) == (
        "My Leaf",
        "nissan_leaf_24",
        None,
        1,
    )
    assert [log.trip_id for log in own.logs()] == ["S001", "S002", "S003", *ROAD]
    table = own.diary.table
    assert table["trip_id"].tolist() == ["S001", "S002", ROAD[0]]
    assert table["trips_learned"].tolist() == [0, 1, 2]
    assert table["energy_wh"].tolist() == [529.2244027777782, 1369.6607222222226, 642.1295013888886]
    assert table["cause_climate_wh"].tolist()[0] == 46.48295849257574
    assert len(own.model().trip_ids_) == 3
    assert own.has_news
    assert [made.energy_wh for made in own.forecasts_of(ROAD[1])] == [2000.0]
    assert setting_of(place, "token") == digest_of(TOKEN)


def test_a_folder_is_read_with_everything_and_goes_on(place: Path) -> None:
    assert is_car(place)
    all_is_there(place)
    with Car.follow(place) as car:
        assert (car.trip, car.plan) == (None, None)  # the trip under way is not read
        done = car.learn()
        assert (done.added, done.known, done.entries) == (1, 1, 1)
        assert not car.has_news
    assert len(open_car(place).logs()) == 5
    forget_car(place)
    assert not place.exists()


@pytest.mark.parametrize("killed", ["reading", "removing"])
def test_a_kill_leaves_the_older_folder_or_the_file(
    place: Path, monkeypatch: pytest.MonkeyPatch, killed: str
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(*((older, "_read_trips") if killed == "reading" else (older, "remove")), stop)
        with pytest.raises(KeyboardInterrupt):
            open_car(place)
    assert (place / "live").is_dir()
    all_is_there(place)


def test_processes_that_open_it_at_once_read_it_once(place: Path) -> None:
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: len(open_car(place).diary), range(4)))
    assert found == [3] * 4
    all_is_there(place)


def test_a_car_that_an_older_version_follows_is_left_alone(place: Path) -> None:
    with older.folder_lock(place / "live"), pytest.raises(InvalidInput, match="another run"):
        open_car(place)
    all_is_there(place)


def test_columns_and_the_anchor_of_0_2_are_renamed(place: Path) -> None:
    path = place / "learned" / "diary.parquet"
    names = {new: old for old, new in older.OLD_CAUSES.items()}
    pd.read_parquet(path).rename(columns=names).to_parquet(path)
    text = (place / "car.toml").read_text("utf-8").replace('anchor = "published"', 'anchor = "book"')
    (place / "car.toml").write_text(text, "utf-8")
    assert open_car(place).vehicle.anchor == "published"
    all_is_there(place)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("car.json", b"{"),
        ("car.json", b"[]"),
        ("learned/diary.parquet", b"PAR1"),
        ("live/token.json", b"[]"),
        ("left-out.json", b"[1]"),
    ],
)
def test_damage_is_told_and_nothing_is_removed(place: Path, name: str, content: bytes) -> None:
    whole = (place / name).read_bytes()
    (place / name).write_bytes(content)
    with pytest.raises(InvalidInput, match="damaged file"):
        open_car(place)
    (place / name).write_bytes(whole)
    all_is_there(place)


def test_a_trip_that_cannot_be_read_holds_up_no_other_and_its_text_is_kept(place: Path) -> None:
    trips = place / "live" / "trips"
    for name in ("20231116T221320Z", "20240231T080000Z", "99991231T235959Z", "notes"):
        (trips / f"{name}.csv").write_text("no,table\n1,2\n")
    (trips / "20231115T221320Z.forecasts.json").write_text("{")
    own = open_car(place)
    assert [log.trip_id for log in own.logs()][3:] == [*ROAD]
    assert own.forecasts_of(ROAD[1]) == ()
    assert len(own.file.setting("unread")) == 4
