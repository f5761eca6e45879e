"""Uploads are unpacked in a process of their own: what it takes and how long is bounded, and nothing is left of a refused one."""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.support.bombs import BOMBS, book, zipped

from tripwatt.errors import InvalidInput
from tripwatt.service import unpacking
from tripwatt.service.problems import Problem
from tripwatt.service.unpacking import unpack_apart

CSV = b"time_s,speed_m_s\n0,0\n1,2\n"
ROWS = '<row><c t="inlineStr"><is><t>a</t></is></c><c t="inlineStr"><is><t>b</t></is></c></row>' + (
    "<row><c><v>1</v></c><c><v>2.5</v></c></row>"
)


def apart(
    folder: Path, name: str, content: bytes, most_bytes: int = 10**9, timeout_s: float = 60.0
) -> list[Path]:
    return asyncio.run(unpack_apart(name, folder, content, most_bytes, timeout_s))


def test_tables_are_those_of_unpacking_here(tmp_path: Path) -> None:
    made = apart(tmp_path, "a.zip", zipped({"a.csv": CSV, "b.xlsx": book(ROWS)}))
    assert [place.name for place in made] == ["a.csv", "b.csv"]
    assert made[0].read_bytes() == CSV
    assert made[1].read_text() == "a,b\n1,2.5\n"
    assert sorted(tmp_path.iterdir()) == sorted(made)


def test_more_than_there_is_room_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=f"archive too large: a.zip: .*at most {len(CSV) - 1} bytes"):
        apart(tmp_path, "a.zip", zipped({"a.csv": CSV}), len(CSV) - 1)
    assert len(apart(tmp_path, "a.zip", zipped({"a.csv": CSV}), len(CSV))) == 1


def test_the_file_is_named_in_what_is_wrong_with_it(tmp_path: Path) -> None:
    name, content = BOMBS["many_strings"](np.random.default_rng(1))
    with pytest.raises(InvalidInput, match=f"archive too large: {name}: got"):
        apart(tmp_path, name, content)
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_takes_too_long_is_ended_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    endless = (
        "import os, sys, time\nplace = f'{sys.argv[1]}/.{os.getpid()}-x'\nos.mkdir(place)\ntime.sleep(60)"
    )
    program = tmp_path / "program"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{endless}" {tmp_path / "tables"}\n')
    program.chmod(0o755)
    (tmp_path / "tables").mkdir()
    monkeypatch.setattr(unpacking.sys, "executable", str(program))
    started = time.monotonic()
    with pytest.raises(Problem, match="takes longer than 2 s"):
        apart(tmp_path / "tables", "a.zip", b"", timeout_s=2.0)
    assert time.monotonic() - started < 10.0
    assert list((tmp_path / "tables").iterdir()) == []


def test_a_process_that_takes_too_much_memory_is_a_fault_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "program"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -c "raise MemoryError"\n')
    program.chmod(0o755)
    monkeypatch.setattr(unpacking.sys, "executable", str(program))
    with pytest.raises(InvalidInput, match="at most 600000000 bytes of memory"):
        apart(tmp_path, "a.zip", b"")
