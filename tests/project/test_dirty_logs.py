"""Folders of dirty logs: the same by their seed, dirty in all ways, and true."""

import csv
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tools.data import dirty_logs
from tools.data.dirty_logs import FAULTS, FORMATS, Truth, write_dirty_folder
from tools.data.dirty_tables import TABLES

SEEDS = range(4)
ROWS = ("impossible speed", "empty cells", "text in a cell", "cut rows", "last row cut", "same time twice")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def truths(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Truth]:
    base = tmp_path_factory.mktemp("dirty")
    return {
        (logger, seed): write_dirty_folder(base / f"{logger}{seed}", logger, seed)
        for logger in FORMATS
        for seed in SEEDS
    }


@pytest.mark.parametrize("logger", FORMATS)
def test_a_seed_gives_the_same_bytes(tmp_path: Path, logger: str) -> None:
    first, again, other = (
        write_dirty_folder(tmp_path / name, logger, seed) for name, seed in (("a", 3), ("b", 3), ("c", 4))
    )
    assert contents(tmp_path / "a") == contents(tmp_path / "b") != contents(tmp_path / "c")
    assert (first.sound_rows, first.faults) == (again.sound_rows, again.faults)
    assert other.logger == logger


def test_a_workbook_does_not_know_when_it_was_saved(tmp_path: Path) -> None:
    for name in "ab":
        truth = write_dirty_folder(tmp_path / name, "plain", 1, faults=["xlsx", "title line"])
    assert truth.faults == ("title line", "xlsx")
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    table = pd.read_excel(tmp_path / "a" / "drive1.xlsx", header=1)
    assert truth.columns["speed_m_s"][0] in table


@pytest.mark.parametrize("fault", FAULTS)
def test_each_kind_of_dirt_can_be_planted_alone(tmp_path: Path, fault: str) -> None:
    wanted = [fault, "month first"] if fault == "ambiguous dates" else [fault]
    loggers = ("plain", "leaf_spy", "teslamate")
    planted = (
        write_dirty_folder(tmp_path / f"{logger}{seed}", logger, seed, faults=wanted).faults
        for seed in SEEDS
        for logger in loggers
    )
    assert any(fault in faults for faults in planted)


def test_seeds_plant_many_kinds(truths: dict[tuple[str, int], Truth]) -> None:
    planted = [truth.faults for truth in truths.values()]
    assert len({name for faults in planted for name in faults}) > 0.85 * len(FAULTS)
    assert np.mean([len(faults) for faults in planted]) > 4.0


def test_drives_are_long_and_their_sums_are_those_of_their_samples(
    truths: dict[tuple[str, int], Truth],
) -> None:
    for (logger, _), truth in truths.items():
        table = TABLES[logger]
        for drive in truth.drives:
            time = drive.samples["time_s"].to_numpy()
            speed = drive.samples["speed_m_s"].to_numpy()
            assert drive.distance_m > 1000.0
            assert drive.duration_s == time[-1] > 120.0
            assert np.trapezoid(speed, time) == pytest.approx(drive.distance_m)
            assert set(table.needed) <= set(drive.samples)
            assert (np.diff(time) > 0.0).all()
        assert truth.sound_rows > 0.99 * sum(len(drive.samples) for drive in truth.drives)
        assert set(table.needed) | {"time_s"} <= set(truth.columns)


@pytest.mark.parametrize("logger", FORMATS)
def test_a_clean_folder_has_as_many_rows_as_its_truth(tmp_path: Path, logger: str) -> None:
    truth = write_dirty_folder(tmp_path, logger, 7, faults=[])
    assert truth.faults == truth.bad_files == ()
    lines = sum(len(content.splitlines()) - 1 for content in contents(tmp_path).values())
    signals = 9 if logger == "car_scanner" else 1
    assert lines == truth.sound_rows * signals
    assert truth.sound_rows == sum(len(drive.samples) for drive in truth.drives)


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


@pytest.mark.parametrize("seed", SEEDS)
def test_bad_rows_do_not_count(tmp_path: Path, seed: int) -> None:
    truth = write_dirty_folder(tmp_path, "teslamate", seed, faults=ROWS)
    sound = set()
    for path in tmp_path.iterdir():
        with path.open(newline="") as file:
            header, *rows = list(csv.reader(file))
        speed, power, time = (header.index(name) for name in ("speed", "power", "date"))
        whole = [row for row in rows if len(row) == len(header)]
        sound |= {row[time] for row in whole if number(row[speed]) < 300.0 and abs(number(row[power])) < 1e3}
    assert truth.sound_rows == len(sound)
    assert truth.sound_rows < sum(len(drive.samples) for drive in truth.drives)


def test_units_of_a_folder_are_those_of_the_truth(tmp_path: Path) -> None:
    truth = write_dirty_folder(tmp_path, "leaf_spy", 5, faults=["speed in mph", "temperature in °F"])
    assert truth.columns["speed_m_s"] == ("Speed", "mph")
    assert truth.columns["elevation_m"] == ("Elv", "ft")
    assert truth.columns["ambient_temperature_degc"] == ("Ambient", "degF")
    drive = truth.drives[0]
    table = pd.read_csv(tmp_path / drive.file)
    n = len(drive.samples)
    assert table["Speed"][:n].to_numpy() * 0.44704 == pytest.approx(
        drive.samples["speed_m_s"].to_numpy(), abs=0.3
    )
    assert table["Ambient"][0] == pytest.approx(
        drive.samples["ambient_temperature_degc"][0] * 1.8 + 32.0, abs=0.6
    )
    assert drive.departs_at == datetime.strptime(table["Date/Time"][0], truth.time_format)


def test_the_command_prints_the_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dirty_logs.main(tmp_path, "torque", 2)
    printed = capsys.readouterr().out
    assert "sound rows" in printed
    assert "time_s: Device Time [timestamp]" in printed
