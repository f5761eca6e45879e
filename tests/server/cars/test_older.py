"""Folders that 0.2.0 and 0.3.0.dev0 wrote: nothing of them is lost, whatever is killed in between, and damage is told."""

from __future__ import annotations

import json
import math
import shutil
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pytest
from tests.server.cars.messages import NOON_S

pytest.importorskip("deltalake", reason="the extra tripwatt[fleet] is not installed")

from tripwatt.errors import InvalidInput
from tripwatt.server.cars import Car, Sample, forget_car, is_car, older, open_car
from tripwatt.server.cars.car_file import text_of
from tripwatt.server.cars.folder import digest_of, setting_of

FIXTURE = Path(__file__).parents[2] / "fixtures" / "car-0.3.0.dev0.zip"
"""A Leaf that learned two of three logs and a trip of the road, has finished a second one, and is on a third; as 0.3.0.dev0 wrote it."""

TOKEN = "lQXnsmSwhaBlsO9xrf1Eag2RUiIj6Sbe"
ROAD = ("leaf-20231114T221320Z", "leaf-20231115T221320Z")
SAMPLES = [Sample(NOON_S + k, {"speed_m_s": 15.0}) for k in range(3)]
LINES = [f"{text_of(sample)}\n".encode() for sample in SAMPLES]


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
        assert car.trip is not None
        assert (len(car.observed()), car.trip.start_s) == (300, NOON_S + 2.0 * 86_400.0)
        assert car.plan is not None
        assert (car.plan.departure_s, car.plan.request["soc"]) == (car.trip.start_s, 0.8)
        assert [made.energy_wh for made in car.forecasts] == [2500.0]
        assert (car.shown(0.0)["soc"], car.received_s) == (0.85, NOON_S + 2.0 * 86_400.0 + 299.0)
        done = car.learn()
        assert (done.added, done.known, done.entries) == (1, 1, 1)
        assert not car.has_news
        assert car.finish_trip()
    assert len(open_car(place).logs()) == 6
    forget_car(place)
    assert not place.exists()


@pytest.mark.parametrize("killed", ["reading", "removing"])
def test_a_kill_leaves_the_older_folder_or_the_file(
    place: Path, monkeypatch: pytest.MonkeyPatch, killed: str
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(*((older, "_read_trips") if killed == "reading" else (shutil, "rmtree")), stop)
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
        ("live/plan.json", b"{}"),
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


def journal(place: Path, content: bytes) -> list[Sample]:
    """The messages of a car of the road that had this journal; the last one came when it was written."""
    shutil.rmtree(place, ignore_errors=True)
    (place / "live").mkdir(parents=True)
    (place / "live" / "journal.ndjson").write_bytes(content)
    return Car(place).file.messages()


def test_damaged_lines_of_a_journal_cost_only_themselves(tmp_path: Path) -> None:
    endless = "1" + "0" * 400
    lines = [b"{]\n", b"[1]\n", b"null\n", b'{"time_s":"x"}\n', b'{"time_s":1.7e9,"soc":2}\n', b"\x00\xff\n"]
    lines += [f'{{"time_s":{bad}}}\n'.encode() for bad in (endless, "[" * 3000, "{}")]
    for content in (b"".join([LINES[0], *lines, *LINES[1:]]), b"".join([*LINES, LINES[0][:20]])):
        found = journal(tmp_path / "leaf", content)
        assert [sample.time_s for sample in found] == [sample.time_s for sample in SAMPLES]
        assert found[-1].received_s is not None


@pytest.mark.parametrize("after_s", ["1" + "0" * 400, "1e400", "1e18", "-5", "[" * 3000])
def test_a_damaged_first_line_makes_no_sample_late(tmp_path: Path, after_s: str) -> None:
    assert len(journal(tmp_path / "leaf", f'{{"after_s":{after_s}}}\n'.encode() + LINES[0])) == 1
    with Car.follow(tmp_path / "leaf") as car:
        assert car._ordered.released_s == -math.inf


@pytest.mark.parametrize(
    "charge", ["[1]", "null", '[1.7e9,"speed",0.5,true]', '[1.7e9,"soc",9,true]', '["x","soc",0.5,1]']
)
def test_a_damaged_charge_is_none(tmp_path: Path, charge: str) -> None:
    journal(tmp_path / "leaf", f'{{"after_s":{NOON_S},"offset_s":"x","charge":{charge}}}\n'.encode())
    with Car.follow(tmp_path / "leaf") as car:
        assert (car.shown(0.0)["soc"], car.departure().soc, car._sender.offset_s) == (None, None, None)


def test_a_charge_of_before_the_journal_is_kept(tmp_path: Path) -> None:
    known = {
        "after_s": NOON_S,
        "offset_s": 1.5,
        "charge": [NOON_S, "soc", 0.5, True],
        "air_s": NOON_S,
        "air_degc": 3.0,
    }
    journal(tmp_path / "leaf", f"{json.dumps(known)}\n".encode())
    with Car.follow(tmp_path / "leaf") as car:
        assert (car.shown(0.0)["soc"], car.departure().soc, car._sender.offset_s) == (0.5, 0.5, 1.5)
        assert car._air == (NOON_S, 3.0)
