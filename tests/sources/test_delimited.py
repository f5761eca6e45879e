"""Text files: sound and damaged cells and rows, with the line of each fault; and the extra that Parquet files need."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from tripwatt.errors import InvalidInput
from tripwatt.sources.columnar import csv_table, open_table
from tripwatt.sources.delimited import open_delimited


@pytest.mark.parametrize(
    ("content", "speed", "name", "faults"),
    [
        (b"time_s,speed,name\n0,1.5,a\n1,,b\n2,-3e2,\xc3\xbc\n", [1.5, -1, -300], ["a", "b", "ü"], []),
        (b'time_s;"speed; km/h";name\r\n0;"1.5";"a;b"\r\n\r\n1;NaN;"c', [1.5, -1], ["a;b", "c"], []),
        (b"time_s,speed,name\n0,fast,a\n\n1,2,\xfc\n", [-1, 2], ["a", "ü"], ["not a number: row 2"]),
        (
            b"time_s,speed,name\n0,1,a\n1,2\n\n2,3,c,x\n3,1e99,d\n",
            [1, 2, -1, -1],
            ["a", "", "", "d"],
            ["wrong number of columns: row 3", "wrong number of columns: row 5", "number out of range: row 6"],
        ),
        (b"time_s,speed,name\n0,1,a\n1,2,b\n2,", [1, 2, -1], ["a", "b", ""], ["wrong number of columns: row 4"]),
    ],
)  # fmt: skip
def test_a_table_is_read_with_its_faults(
    content: bytes, speed: list[float], name: list[str], faults: list[str]
) -> None:
    source = open_delimited(Path("log.csv"), content)
    table = csv_table(source, [])
    assert np.nan_to_num(table.numbers([source.names[1]])[0], nan=-1.0).tolist() == speed
    assert table.texts("name") == name
    assert [
        f"{f.what}: {f.where.removeprefix('log.csv ').partition(' column')[0]}" for f in table.faults
    ] == faults


def test_a_parquet_file_says_what_installs_its_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InvalidInput, match=r"missing package: .*log\.parquet: got no pyarrow.*\[parquet\]"):
        open_table(tmp_path / "log.parquet")
