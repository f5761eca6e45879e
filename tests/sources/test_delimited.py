"""A text file without the extra `parquet`: line by line, with the same numbers, texts and faults."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from tripwatt.errors import Fault, InvalidInput
from tripwatt.sources.columnar import open_table
from tripwatt.sources.delimited import open_delimited, read_numbers, read_texts

FILES = {
    "sound": b"time_s,speed,name\n0,1.5,a\n1,,b\n2,-3e2,\xc3\xbc\n",
    "quoted": b'time_s;"speed; km/h";name\n0;"1.5";"a;b"\n\n1;NaN;"c"\n',
    "no number": b"time_s,speed,name\n0,fast,a\n1,2,b\n",
    "uneven": b"time_s,speed,name\n0,1,a\n1,2\n2,3,c\n3,4,d\n",
    "cut off": b"time_s,speed,name\n0,1,a\n1,2,b\n2,",
}


def read(content: bytes, *, keep: bool) -> tuple[list[list[float]], list[list[str]], list[str]]:
    source, faults = open_delimited(Path("log.csv"), content), list[Fault]()
    try:
        numbers = read_numbers(source, [0, 1], faults=faults if keep else None)
        texts = read_texts(source, [2])
    except InvalidInput as error:
        return [], [], [fault.what for fault in error.faults]
    return np.nan_to_num(numbers, nan=-1.0).tolist(), texts, [fault.what for fault in faults]


@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("name", FILES)
def test_it_reads_what_arrow_reads(name: str, keep: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = read(FILES[name], keep=keep)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert read(FILES[name], keep=keep) == expected


def test_a_parquet_file_says_what_installs_its_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InvalidInput, match=r"missing package: .*log\.parquet: got no pyarrow.*\[parquet\]"):
        open_table(tmp_path / "log.parquet")
