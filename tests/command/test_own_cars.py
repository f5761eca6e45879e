"""`tripwatt car`: what adding trips prints."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.support.command import Run

from tripwatt.server.cars.car_file import FILE
from tripwatt.server.cars.folder import create_car, open_car
from tripwatt.study.synthetic import VEHICLE, synthetic_fleet

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_adding_trips_without_heights_says_what_these_would_bring(run: Run, tmp_path: Path) -> None:
    """With elevation tiles the heights come from the positions of the log."""
    log = synthetic_fleet(1).logs[0]
    samples = log.samples.drop(columns=["elevation_m", "grade"], errors="ignore")
    way_deg = np.cumsum(samples["speed_m_s"].to_numpy()) / 111_195.0
    samples.assign(latitude=47.3, longitude=9.2 + 0.5 * way_deg).to_csv(tmp_path / "drive.csv", index=False)
    tiles = tmp_path / "tiles"
    tiles.mkdir()
    (tiles / "N47E009.hgt").write_bytes(np.full((1201, 1201), 500).astype(">i2").tobytes())
    printed = []
    for name, more in (("flat", ()), ("hills", ("--elevation", tiles))):
        car = create_car(tmp_path / name, VEHICLE)
        printed.append(run("car", "add", car.folder, tmp_path / "drive.csv", *more).out)
        assert len(open_car(car.folder).diary) == 1
    assert "1 of 1 new trips have no heights. Heights narrow the forecasts most" in printed[0]
    assert "no heights" not in printed[1]
    (trip,) = open_car(tmp_path / "hills").logs()
    assert trip.array("elevation_m") == pytest.approx(np.full(len(trip.samples), 500.0))


def test_what_is_left_out_is_named_once_with_its_reason(run: Run, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    samples = synthetic_fleet(1).logs[0].samples
    samples.to_csv(logs / "drive.csv", index=False)
    for name in ("short", "stop"):
        samples[:30].assign(speed_m_s=len(name)).to_csv(logs / f"{name}.csv", index=False)
    for name in ("one", "two"):
        (logs / f"{name}.csv").write_text("a,b\n1,2\n3,4\n")
    added = run("car", "add", create_car(tmp_path / "car", VEHICLE).folder, logs)
    assert "trips added: 3, 1 of them in the diary; known: 0; left out: 2" in added.out
    notes = [line for line in added.err.splitlines() if line.startswith("note: left out: ")]
    assert [note.split(";")[0].split(":")[2].strip() for note in notes] == [
        "one.csv, two.csv",
        "short",
        "stop",
    ]
    assert "missing key" in notes[0]
    assert added.err.count("shorter than 1000 m") == 2


def test_a_folder_without_tiles_is_refused(run: Run, tmp_path: Path) -> None:
    car = create_car(tmp_path / "car", VEHICLE)
    refused = run("car", "add", car.folder, tmp_path, "--elevation", tmp_path)
    assert refused.code != 0
    assert "no elevation tiles" in refused.err


@pytest.mark.parametrize(("factor", "every"), [(1.0, 1), (3.0, 1), (1.0, 12), (0.3, 12)])
def test_an_energy_that_the_car_cannot_take_is_held_back(
    run: Run, tmp_path: Path, factor: float, every: int
) -> None:
    """Whole files in a wrong unit are not learned, also if rows are too rare for the audit, unless the user asks for it."""
    (tmp_path / "logs").mkdir()
    for log in synthetic_fleet(3).logs:
        samples = log.samples.drop(columns=["soc", "displayed_soc"], errors="ignore")
        samples = samples.assign(current_a=factor * samples["current_a"])[::every]
        samples.to_csv(tmp_path / "logs" / f"{log.trip_id}.csv", index=False)
    car = create_car(tmp_path / "car", VEHICLE)
    first = run("car", "add", car.folder, tmp_path / "logs")
    assert ("implausible energy" in first.err) == (factor != 1.0)
    assert len(open_car(car.folder).diary) == (3 if factor == 1.0 else 0)
    assert run("car", "add", car.folder, tmp_path / "logs", "--implausible").code == 0
    assert len(open_car(car.folder).diary) == 3


def test_a_car_learns_a_power_without_a_listed_name(run: Run, tmp_path: Path, data_dir: Path) -> None:
    logs = data_dir / "reports/01_power_column_unknown_name/hv_kw"
    assert run("car", "new", tmp_path / "car", "--car", "bmw_i3_60ah").code == 0
    assert run("car", "add", tmp_path / "car", logs).code == 0
    diary = open_car(tmp_path / "car").diary.table
    assert sorted(diary["energy_wh"]) == pytest.approx([1555.0, 2303.0, 5840.0], rel=0.001)


def test_a_damaged_car_is_listed_with_its_fault_beside_the_sound_ones(run: Run, tmp_path: Path) -> None:
    cars = tmp_path / "cars"
    for name in ("leaf", "zoe"):
        create_car(cars / name, VEHICLE)
    sound = run("car", "list", cars)
    assert (sound.code, sound.out.splitlines()) == (
        0,
        [f"{name}: BMW i3 60 Ah, 0 trips, 0 in the diary" for name in ("leaf", "zoe")],
    )
    shutil.copytree(cars / "leaf", cars / "leaf (copy)")
    (cars / "zoe" / FILE).write_bytes(b"no database" * 1000)
    (cars / "unfinished").mkdir()
    (cars / "unfinished" / FILE).touch()
    (cars / "empty").mkdir()
    (cars / "notes.txt").write_text("mine")
    found = run("car", "list", cars, "--json")
    document = json.loads(found.out)
    assert found.code == 1
    assert [car["car"] for car in document["cars"]] == ["leaf"]
    assert {name: faults[0]["what"] for name, faults in document["damaged"].items()} == {
        "leaf (copy)": "name cannot be used",
        "unfinished": "not a car",
        "zoe": "damaged file",
    }
    shown = run("car", "list", cars).out
    assert "leaf: BMW i3 60 Ah" in shown
    assert "zoe: damaged file" in shown
    missing = run("car", "list", tmp_path / "none")
    assert (missing.code, "cannot read the folder" in missing.err) == (2, True)
