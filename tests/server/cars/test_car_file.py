"""The file of a car: to the last bit as it was given, whole after kills and on a full disk, and nothing is left of what was erased."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import replace
from pathlib import Path
from threading import Thread
from time import sleep

import numpy as np
import pandas as pd
import pytest
from tests.support.full_disk import full_disk
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.server.cars import car_file
from tripwatt.server.cars.car_file import (
    FORMAT,
    CarFile,
    row_of_log,
    text_of,
)
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp
from tripwatt.study.synthetic import synthetic_fleet

T0 = 1_700_000_000.0
SAMPLES = [
    Sample(T0 + 0.1, {"speed_m_s": 1.0 / 3.0, "displayed_soc": 0.1 + 0.2}, parked=True),
    Sample(T0 + 1.0, charging=True, received_s=T0 + 1.7),
    Sample(T0 - 5.0, {"ambient_temperature_degc": -0.5}),
]


@pytest.fixture
def file(tmp_path: Path) -> CarFile:
    made = CarFile(tmp_path)
    made.prepare(lambda db: None)
    return made


def test_messages_and_settings_are_read_to_the_last_bit_in_the_order_of_their_arrival(file: CarFile) -> None:
    with file.write() as db:
        db.put_messages(SAMPLES)
        db.put_settings({"air": [0.1 + 0.2, float("-inf")], "plan": {"reserve": None}})
    assert file.messages() == SAMPLES
    assert file.setting("air") == [0.1 + 0.2, float("-inf")]
    with file.write() as db:
        db.put_settings({"plan": None})
    assert file.setting("plan") is None
    assert file.path.stat().st_mode & 0o777 == 0o600


def test_a_position_is_not_stored() -> None:
    sample = sample_from_abrp({"utc": T0, "speed": 3.6, "lat": 48.1, "lon": 11.5})
    assert text_of(sample) == text_of(Sample(T0, {"speed_m_s": 1.0}))


def test_a_log_comes_back_value_for_value_and_is_there_once(file: CarFile) -> None:
    given, other = synthetic_fleet(2, seed=5).logs
    gap = given.samples.assign(soc=given.samples["soc"].where(given.samples.index % 3 > 0, np.nan))
    log = replace(given, samples=gap, context=replace(given.context, driver="me", payload_mass_kg=80.0))
    undated = replace(other, context=replace(other.context, started_at=None))
    with file.write() as db:
        assert db.put_logs([row_of_log(undated), row_of_log(log)]) == 2
        assert db.put_logs([row_of_log(log), row_of_log(replace(log, trip_id="again"))]) == 0
    found, last = file.logs()
    pd.testing.assert_frame_equal(found.samples, log.samples, check_column_type=False)
    assert (found.trip_id, found.context) == (log.trip_id, log.context)
    assert found.observed_energy_wh == given.observed_energy_wh
    assert last.trip_id == undated.trip_id, "those without a departure come last"


def test_a_full_disk_leaves_the_file_as_it_was(file: CarFile) -> None:
    many = [Sample(T0 + k, {"speed_m_s": 1.0}) for k in range(5000)]
    with file.write() as db:
        db.put_messages(SAMPLES)
    with full_disk(65_536), pytest.raises(OSError, match="cannot write the car"), file.write() as db:
        db.put_messages(many)
    assert file.messages() == SAMPLES
    with file.write() as db:
        db.put_messages(many)
    assert len(file.messages()) == len(SAMPLES) + len(many)


def test_readers_see_a_transaction_as_a_whole_and_writers_wait_for_each_other(file: CarFile) -> None:
    def write() -> None:
        with file.write() as db:
            db.put_messages(SAMPLES[1:2])

    with file.write() as db:
        db.put_messages(SAMPLES[:1])
        other = Thread(target=write)
        other.start()
        assert file.messages() == []
    other.join()
    assert file.messages() == SAMPLES[:2]


def test_a_transaction_that_reads_first_waits_for_a_writer(file: CarFile) -> None:
    """Two that add to what they read: neither overwrites the other, and neither fails."""

    def add() -> None:
        with file.write() as db:
            row = db.execute("SELECT value FROM settings WHERE name = 'count'").fetchone()
            sleep(0.05)
            db.put_settings({"count": 1 if row is None else json.loads(row[0]) + 1})

    several = [Thread(target=add) for _ in range(4)]
    for one in several:
        one.start()
    for one in several:
        one.join()
    assert file.setting("count") == 4


def test_nothing_is_left_of_what_was_erased(file: CarFile) -> None:
    file.keep_open()
    with file.write() as db:
        db.put_settings({"plan": {"place": "48.137154"}})
    with file.write() as db:
        db.put_settings({"plan": None})
    file.checkpoint()
    written = b"".join(path.read_bytes() for path in file.path.parent.iterdir())
    assert b"48.137154" not in written
    file.close()


def test_a_file_of_a_newer_format_and_a_damaged_one_are_refused(file: CarFile) -> None:
    with file.write() as db:
        db.execute(f"PRAGMA user_version = {FORMAT + 1}")
    with pytest.raises(
        InvalidInput, match=rf"car of a newer format.*got format {FORMAT + 1}.*newer tripwatt"
    ):
        file.prepare(lambda db: None)
    file.path.write_bytes(b"no database" * 1000)
    refuses("damaged file", file.prepare, lambda db: None)
    refuses("damaged file", file.setting, "plan")


def test_a_file_that_a_killed_process_began_is_made_again(tmp_path: Path) -> None:
    def killed(db: sqlite3.Connection) -> None:
        raise KeyboardInterrupt

    file = CarFile(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        file.prepare(killed)
    assert file.setting("state") is None
    file.prepare(lambda db: db.put_settings({"state": "x"}))
    file.prepare(killed)  # not again
    assert file.setting("state") == "x"


def test_a_file_that_another_process_makes_at_the_same_time_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No process sees the file before it is in WAL mode, since SQLite does not wait for others to change the mode."""
    mine, other = CarFile(tmp_path), CarFile(tmp_path)
    move = car_file.move_new

    def second(new: Path, path: Path) -> None:
        assert not path.exists()
        with monkeypatch.context() as patch:
            patch.setattr(car_file, "move_new", move)
            assert other.prepare(lambda db: None, {"state": "x"})
        move(new, path)

    monkeypatch.setattr(car_file, "move_new", second)
    assert not mine.prepare(lambda db: None, {"state": "y"})
    assert mine.setting("state") == "x"
    assert mine.rows("PRAGMA journal_mode") == [("wal",)]
    assert [path.name for path in tmp_path.iterdir()] == [mine.path.name]


def test_nothing_is_written_for_a_car_that_was_erased(file: CarFile) -> None:
    file.keep_open()
    file.path.unlink()
    with pytest.raises(OSError, match="cannot write the car: the car was erased"), file.write() as db:
        db.put_messages(SAMPLES)
    file.close()
