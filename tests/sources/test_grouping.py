"""Separators of thousands: the same numbers in every way of writing, or a refusal that names the column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.sources.columnar import csv_table
from tripwatt.sources.delimited import open_delimited
from tripwatt.vehicles import load_vehicle

TIME = np.arange(600.0)
SPEED = 14.0 + 9.0 * np.sin(TIME / 15.0)
POWER = (1700.0 * SPEED * np.gradient(SPEED, TIME) + 300.0 * SPEED + 800.0).round()
TRUE_WH = float(np.trapezoid(POWER, TIME)) / 3600.0


def number(value: float, digits: int, decimal: str, group: str) -> str:
    return f"{value:,.{digits}f}".translate(str.maketrans({",": group, ".": decimal}))


def text_of(
    delimiter: str, decimal: str, group: str, *, quoted: bool, speed_digits: int = 1, power_digits: int = 0
) -> str:
    quote = '"' if quoted else ""
    lines = [delimiter.join(("Time (s)", "Speed (km/h)", "Power (W)", "SoC (%)"))]
    for t, v, p in zip(TIME, SPEED, POWER, strict=True):
        power = f"{quote}{number(p, power_digits, decimal, group)}{quote}"
        lines.append(delimiter.join((f"{t:.0f}", number(3.6 * v, speed_digits, decimal, ""), power, "80")))
    return "\n".join(lines) + "\n"


def energy_wh(folder: Path, text: str) -> float:
    folder.mkdir(exist_ok=True)
    (folder / "drive.csv").write_text(text)
    (log,) = tw.read_logs(folder, "table", car=load_vehicle("bmw_i3_60ah")).logs
    assert log.observed_energy_wh is not None
    return log.observed_energy_wh


@pytest.mark.parametrize("digits", [(1, 0), (0, 0), (2, 1)])
@pytest.mark.parametrize(
    "writing", [(",", ".", ",", True), (";", ",", ".", False), (";", ".", ",", False), ("\t", ",", ".", True)]
)
def test_the_energy_is_that_of_plain_numbers(tmp_path: Path, writing, digits) -> None:
    delimiter, decimal, group, quoted = writing
    text = text_of(delimiter, decimal, group, quoted=quoted, speed_digits=digits[0], power_digits=digits[1])
    assert energy_wh(tmp_path / "logs", text) == pytest.approx(TRUE_WH, rel=0.005)


def test_numbers_that_shift_their_row_are_refused_with_it(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"wrong number of columns: .*row 2.*separators of thousands"):
        energy_wh(tmp_path / "logs", text_of(",", ".", ",", quoted=False))


def test_a_few_shifted_rows_are_named_and_not_used(tmp_path: Path) -> None:
    lines = text_of(",", ".", "", quoted=False).splitlines()
    for row in (100, 300):
        lines[row] = f"{row - 1},50.0,1,913,80"
    (tmp_path / "drive.csv").write_text("\n".join(lines) + "\n")
    fleet = tw.read_logs(tmp_path / "drive.csv", "table", car=load_vehicle("bmw_i3_60ah"))
    assert fleet.report is not None
    assert [fault.where.rpartition(" row ")[2] for fault in fleet.report.faults] == ["101", "301"]
    assert len(fleet.logs[0]) == len(TIME) - 2


@given(st.lists(st.integers(-999_999, 999_999), min_size=30, max_size=60), st.sampled_from(",."))
def test_whole_numbers_are_read_or_refused_and_never_a_thousandth(values: list[int], group: str) -> None:
    """Law: whatever the numbers and the separator, no grouped number is read as a decimal one."""
    cells = [f"{value:,}".replace(",", group) for value in values]
    content = "time_s;speed\n" + "\n".join(f"{i};{cell}" for i, cell in enumerate(cells)) + "\n"
    table = csv_table(open_delimited(Path("log.csv"), content.encode()), [])
    read = table.numbers(["speed"])[0]
    is_refused = bool(np.isnan(read).all()) and table.faults[0].what == "decimals or thousands"
    assert is_refused or read.tolist() == values


@given(st.lists(st.floats(-500.0, 500.0), min_size=30, max_size=60), st.integers(1, 4), st.sampled_from(",."))
def test_decimals_beside_other_decimals_stay_decimals(values: list[float], digits: int, mark: str) -> None:
    """Law: a column of decimals, beside one that shows the separator, is read as it was."""
    cells = [f"{value:.{digits}f}".replace(".", mark) for value in values]
    rows = [f"{i}{mark}5;{cell}" for i, cell in enumerate(cells)]
    content = "time_s;speed\n" + "\n".join(rows) + "\n"
    table = csv_table(open_delimited(Path("log.csv"), content.encode()), [], mark)
    assert table.numbers(["speed"])[0].tolist() == [float(f"{v:.{digits}f}") for v in values]


def test_a_column_that_nothing_decides_is_refused_by_name() -> None:
    cells = [f"{12 + i % 50},{345 + i}" for i in range(100)]
    content = "time_s;Power (W)\n" + "\n".join(f"{i};{cell}" for i, cell in enumerate(cells)) + "\n"
    table = csv_table(open_delimited(Path("log.csv"), content.encode()), [])
    assert np.isnan(table.numbers(["Power (W)"])[0]).all()
    (fault,) = table.faults
    assert f"{fault}".startswith("decimals or thousands: log.csv column 'Power (W)': got '12,345'")


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_cells_of_a_column_that_the_logger_added_later_shift_nothing(tmp_path: Path, delimiter: str) -> None:
    """From a row on, an odometer that passes 1,000 shifts the row, and one more column at the end does not."""
    lines = text_of(delimiter, ".", "", quoted=False).splitlines()
    added = lines[:300] + [f"{line}{delimiter}12" for line in lines[300:]]
    assert energy_wh(tmp_path / "added", "\n".join(added) + "\n") == pytest.approx(TRUE_WH, rel=0.005)
    cut = [line[:4] if i in (100, 400) else line for i, line in enumerate(added)]
    text = "\n".join(cut) + "\n" + added[-1][:4]  # rows that were cut off say nothing of the column
    assert energy_wh(tmp_path / "cut", text) == pytest.approx(TRUE_WH, rel=0.01)
    if delimiter == ",":
        shifted = [f"{line},{900 + i // 3:,}" for i, line in enumerate(lines[1:])]
        header = f"{lines[0]},Odometer (km)"
        with pytest.raises(InvalidInput, match="wrong number of columns"):
            energy_wh(tmp_path / "shifted", "\n".join([header, *shifted]) + "\n")
