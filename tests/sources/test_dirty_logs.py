"""Folders of dirty logs with their truth: what is sound is kept, nothing is taken for something else, strict reading refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from benchmarks.dirty_logs import outcome, verdict
from tests.support.refusals import refuses
from tools.data.dirty_kinds import READABLE, UNREADABLE
from tools.data.dirty_logs import FORMATS, write_dirty_folder

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.sources.kinds import proposed_kinds
from tripwatt.sources.suggest import suggest_mapping
from tripwatt.sources.table import read_table
from tripwatt.vehicles import load_vehicle


@pytest.mark.parametrize("logger", FORMATS)
def test_what_is_sound_in_a_dirty_folder_is_kept(tmp_path: Path, logger: str) -> None:
    found = outcome(tmp_path / "logs", logger, 101)
    assert found.refused == ""
    assert found.rows >= 0.99 * found.sound
    assert found.wrong == ()
    assert found.strict_faults > 0 or found.is_harmless


@pytest.mark.parametrize("logger", FORMATS)
def test_a_clean_folder_has_nothing_to_tell(tmp_path: Path, logger: str) -> None:
    truth = write_dirty_folder(tmp_path / "logs", logger, 5, faults=())
    fleet = read_table(tmp_path / "logs", vehicle=load_vehicle("nissan_leaf_40"))
    assert fleet.report is not None
    assert {file.state for file in fleet.report.files} == {"read"}
    assert list(fleet.report.faults) == []
    assert len(tw.audit(fleet).trips) == len(truth.drives)


@pytest.mark.parametrize("kind", [*READABLE, *UNREADABLE])
@pytest.mark.parametrize("seed", [1001, 1002, 1003])
def test_numbers_of_another_meaning_are_read_right_or_refused(tmp_path: Path, kind: str, seed: int) -> None:
    """Law: whatever the names, units, separators and signs, no energy is wrong by more than five percent."""
    assert verdict(tmp_path / "drive.csv", kind, seed) == ("read" if kind in READABLE else "refused")


def drive(seconds: int = 300, start: str = "2024-05-31 08:00:00") -> pd.DataFrame:
    clock = pd.Timestamp(start) + pd.to_timedelta(np.arange(seconds), unit="s")
    speed = 50.0 + 20.0 * np.sin(np.arange(seconds) / 9.0)
    amps = 20.0 + 60.0 * np.cos(np.arange(seconds) / 9.0)
    return pd.DataFrame(
        {"Time": clock.strftime("%Y-%m-%d %H:%M:%S"), "Speed (km/h)": speed.round(1), "Volt (V)": 380.0, "Amp (A)": amps.round(1)}
    )  # fmt: skip


def written(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    return folder


def test_one_empty_file_among_four_good_ones_costs_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    for day in range(1, 5):
        written(folder, f"{day}.csv", drive(start=f"2024-05-0{day} 08:00:00").to_csv(index=False))
    written(folder, "empty.csv", "")
    fleet = tw.read_logs(folder, "table")
    assert [log.trip_id for log in fleet.logs] == ["1", "2", "3", "4"]
    assert fleet.report is not None
    assert f"{fleet.report}" == "5 files: 4 read, 1 left out; 1200 of 1200 rows are used"
    refuses("no mapping", tw.read_logs, folder, "table", strict=True)


def test_only_nothing_usable_is_an_error(tmp_path: Path) -> None:
    written(tmp_path / "logs", "a.csv", "")
    written(tmp_path / "logs", "b.csv", "\0\0\0binary")
    written(tmp_path / "logs", "c.csv", "\n<!DOCTYPE html>\n<html><body>Please, log in</body></html>\n")
    with pytest.raises(InvalidInput) as caught:
        tw.read_logs(tmp_path / "logs", "table")
    assert {fault.what for fault in caught.value.faults} == {"empty file", "not a text file"}
    assert "a web page (HTML)" in caught.value.faults[2].got


def test_a_drive_over_two_files_is_one_and_a_copy_counts_once(tmp_path: Path) -> None:
    whole, folder = drive(600), tmp_path / "logs"
    written(folder, "a.csv", whole[:300].to_csv(index=False))
    written(folder, "b.csv", whole[300:].to_csv(index=False))
    written(folder, "b (1).csv", whole[300:].to_csv(index=False))
    fleet = tw.read_logs(folder, "table")
    (log,) = fleet.logs
    assert len(log) == 600
    assert log.observed_energy_wh == pytest.approx(
        np.trapezoid(380.0 * whole["Amp (A)"], np.arange(600)) / 3600.0, rel=1e-9
    )
    assert fleet.report is not None
    assert [(group.what, group.count) for group in fleet.report.groups()] == [("copy of another drive", 300)]


def test_a_file_without_a_header_continues_the_one_before_it(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    written(folder, "log_2.csv", drive().to_csv(index=False))
    written(folder, "log_10.csv", drive(start="2024-06-01 08:00:00").to_csv(index=False, header=False))
    fleet = tw.read_logs(folder, "table")
    assert sorted(len(log) for log in fleet.logs) == [300, 300]
    assert fleet.report is not None
    assert [group.what for group in fleet.report.groups()] == ["no header"]


def test_rows_with_a_comma_for_the_decimals_are_not_cut(tmp_path: Path) -> None:
    """Cells cannot be told apart where every row is too long: the file is left out, and no column is shifted."""
    text = drive().to_csv(index=False).replace(".", ",")
    refuses("wrong number of columns", tw.read_logs, written(tmp_path / "logs", "a.csv", text), "table")


def test_rows_cut_in_quotes_are_seen(tmp_path: Path) -> None:
    """A decimal comma in quotes hides a missing cell from a count of commas."""
    lines = drive().to_csv(index=False).splitlines()
    lines[7] = '2024-05-31 08:00:06,"50,1",380.0'
    fleet = tw.read_logs(written(tmp_path / "logs", "a.csv", "\n".join(lines) + "\n"), "table")
    assert len(fleet.logs[0]) == 299


@pytest.mark.parametrize(
    "line", [",km/h,V,A", "-,km/h,V,A", "-,[km/h],[V],[A]", "-,(km/h),(V),(A)", "-,Tempo,Volt,-"]
)
def test_a_line_of_units_costs_no_other_row(tmp_path: Path, line: str) -> None:
    header, rows = drive().to_csv(index=False).split("\n", 1)
    fleet = tw.read_logs(written(tmp_path, "a.csv", f"{header}\n{line}\n{rows}"), "table")
    assert len(fleet.logs[0]) == 300


def test_impossible_cells_are_unknown_and_counted(tmp_path: Path) -> None:
    table = drive().assign(**{"Outside (C)": 12.0})
    table.loc[[5, 9], "Outside (C)"] = 203.0
    fleet = tw.read_logs(written(tmp_path / "logs", "a.csv", table.to_csv(index=False)), "table")
    assert int(np.isnan(fleet.logs[0].array("ambient_temperature_degc")).sum()) == 2
    assert fleet.report is not None
    (group,) = fleet.report.groups()
    assert (group.what, group.count) == ("value out of range", 2)


def test_a_current_that_counts_the_other_way_is_turned(tmp_path: Path) -> None:
    speed = drive(900)
    accelerates = np.gradient(speed["Speed (km/h)"] / 3.6)
    table = speed.assign(**{"Amp (A)": -(10.0 + 1700.0 * accelerates * speed["Speed (km/h)"] / 3.6 / 380.0)})
    folder = written(tmp_path / "logs", "a.csv", table.to_csv(index=False))
    mapping = written(tmp_path, "m.toml", '[columns]\ntime_s = {column = "Time", unit = "timestamp"}\n'
        'speed_m_s = {column = "Speed (km/h)", unit = "km/h"}\nvoltage_v = {column = "Volt (V)"}\n'
        'current_a = {column = "Amp (A)"}\n[current]\npositive = "discharge"\n') / "m.toml"  # fmt: skip
    (log,) = tw.read_logs(folder, "table", mapping).logs
    assert log.observed_energy_wh is not None
    assert log.observed_energy_wh > 0.0
    refuses("wrong sign", tw.read_logs, folder, "table", mapping, strict=True)


def test_kinds_are_files_with_the_same_columns_and_keep_their_numbers(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    for name in ("a", "b"):
        written(folder, f"{name}.csv", drive(400).to_csv(index=False))
    other = drive(200).rename(columns={"Speed (km/h)": "v", "Volt (V)": "u", "Amp (A)": "i", "Time": "stamp"})
    written(folder, "c.csv", other.to_csv(index=False))
    kinds = proposed_kinds(folder)
    assert [sorted(file.name for file in kind.files) for kind in kinds] == [["a.csv", "b.csv"], ["c.csv"]]
    again = proposed_kinds(folder, ignored=["a.csv", "b.csv"])
    assert [sorted(file.name for file in kind.files) for kind in again] == [[], ["c.csv"]]


@pytest.mark.parametrize(
    ("names", "form", "time"),
    [
        (("Datum", "Uhrzeit"), "%d.%m.%Y", "%H:%M:%S"),
        (("Datum", "Uhrzeit"), "%d.%m.%Y", "%H:%M:%S,%f"),
        (("Date", "Time"), "%m/%d/%Y", "%H:%M:%S.%f"),
        (("Tag", "Zeit"), "%Y-%m-%d", "%H:%M:%S"),
    ],
)
def test_day_and_time_in_two_columns_are_one_time(
    tmp_path: Path, names: tuple[str, str], form: str, time: str
) -> None:
    for day in (13, 14):
        table = drive(start=f"2024-05-{day} 08:00:00")
        clock = pd.to_datetime(table.pop("Time"))
        table.insert(0, names[1], clock.dt.strftime(time))
        table.insert(0, names[0], clock.dt.strftime(form))
        written(tmp_path / "logs", f"{day}.csv", table.to_csv(index=False, sep=";"))
    fleet = tw.read_logs(tmp_path / "logs", "table")
    assert [f"{log.context.started_at}" for log in fleet.logs] == [
        "2024-05-13 08:00:00",
        "2024-05-14 08:00:00",
    ]
    assert {log.duration_s for log in fleet.logs} == {299.0}
    assert suggest_mapping(tmp_path / "logs").unused == ()
