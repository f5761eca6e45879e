"""Samples on disk: what was written is read, a torn end is cut, a full disk leaves the file as it was."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

from tripwatt.errors import InvalidInput
from tripwatt.server.cars import Sample, sample_from_abrp
from tripwatt.server.cars import journal as module
from tripwatt.server.cars.journal import Journal, line_of, sample_of
from tripwatt.server.cars.telemetry import FIRST_TIME_S, LAST_TIME_S

T0 = 1_700_000_000.0
SAMPLES = [
    Sample(T0 + 0.1, {"speed_m_s": 1.0 / 3.0, "displayed_soc": 0.1 + 0.2}, parked=True),
    Sample(T0 + 1.0, charging=True),
    Sample(T0 - 5.0, {"ambient_temperature_degc": -0.5}),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.ndjson"


def test_samples_are_read_to_the_last_bit_in_the_order_of_their_arrival(path: Path) -> None:
    journal = Journal(path)
    for sample in SAMPLES:
        journal.append(sample)
    assert journal.lines == 3
    again = Journal(path)
    assert list(again.read()) == SAMPLES
    assert (again.lines, again.after_s) == (3, -math.inf)
    again.append(SAMPLES[0])
    assert [*again.read()] == [*SAMPLES, SAMPLES[0]]
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_position_is_not_stored() -> None:
    sample = sample_from_abrp({"utc": T0, "speed": 3.6, "lat": 48.1, "lon": 11.5})
    assert line_of(sample) == line_of(Sample(T0, {"speed_m_s": 1.0}))


@pytest.mark.parametrize("kept", range(1, len(line_of(SAMPLES[2])), 7))
def test_a_line_that_a_killed_process_left_unfinished_is_cut(path: Path, kept: int) -> None:
    whole = line_of(SAMPLES[0])
    path.write_bytes(whole + line_of(SAMPLES[2])[:kept])
    journal = Journal(path)
    assert path.read_bytes() == whole
    journal.append(SAMPLES[1])
    assert list(journal.read()) == SAMPLES[:2]


def test_the_unfinished_end_of_a_long_journal_alone_is_cut(path: Path) -> None:
    whole = line_of(SAMPLES[0]) * 100
    path.write_bytes(whole + line_of(SAMPLES[2])[:20])
    assert list(Journal(path).read()) == SAMPLES[:1] * 100
    assert path.read_bytes() == whole


def test_a_damaged_line_costs_only_itself(path: Path) -> None:
    lines = [b"{]\n", b"[1]\n", b"null\n", b'{"time_s":"x"}\n', b'{"time_s":1.7e9,"soc":2}\n', b"\x00\xff\n"]
    path.write_bytes(line_of(SAMPLES[0]) + b"".join(lines) + line_of(SAMPLES[1]))
    assert list(Journal(path).read()) == SAMPLES[:2]
    assert [sample_of(line) for line in lines] == [None] * len(lines)


def test_rewriting_leaves_these_samples_and_the_time_of_those_before(path: Path) -> None:
    journal = Journal(path)
    for sample in SAMPLES:
        journal.append(sample)
    journal.rewrite(SAMPLES[1:2], T0 + 0.1)
    journal.append(SAMPLES[2])
    assert (list(journal.read()), journal.lines, journal.after_s) == (SAMPLES[1:], 2, T0 + 0.1)
    again = Journal(path)
    assert (again.after_s, list(again.read())) == (T0 + 0.1, SAMPLES[1:])
    again.rewrite([], -math.inf)
    assert (again.after_s, list(Journal(path).read())) == (-math.inf, [])


def test_a_full_disk_leaves_the_file_as_it_was(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(path)
    journal.append(SAMPLES[0])
    write = os.write
    with monkeypatch.context() as patch:
        patch.setattr(module.os, "write", lambda descriptor, line: write(descriptor, line[:10]))
        with pytest.raises(OSError, match="wrote 10 of"):
            journal.append(SAMPLES[1])
    assert path.read_bytes() == line_of(SAMPLES[0])
    journal.append(SAMPLES[1])
    journal.close()
    journal.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        journal.append(SAMPLES[2])
    assert list(Journal(path).read()) == SAMPLES[:2]


def test_a_folder_is_no_journal(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="cannot open the journal"):
        Journal(tmp_path)


@pytest.mark.parametrize("damaged", ["1" + "0" * 400, "[" * 3000, '"x"', "null", "{}"])
def test_an_endless_number_or_nesting_costs_only_its_line(path: Path, damaged: str) -> None:
    lines = [line_of(sample) for sample in SAMPLES]
    for bad in (f'{{"time_s":{damaged}}}', f'{{"time_s":{T0},"speed_m_s":{damaged}}}'):
        path.write_bytes(lines[0] + bad.encode() + b"\n" + lines[1])
        assert list(Journal(path).read()) == SAMPLES[:2]


@pytest.mark.parametrize("after_s", ["1" + "0" * 400, "1e400", "1e18", "-5", "[" * 3000])
def test_a_damaged_first_line_makes_no_sample_late(path: Path, after_s: str) -> None:
    path.write_bytes(f'{{"after_s":{after_s}}}\n'.encode() + line_of(SAMPLES[0]))
    journal = Journal(path)
    assert journal.after_s == -math.inf
    assert list(journal.read()) == SAMPLES[:1]


@pytest.mark.parametrize("after_s", [FIRST_TIME_S, LAST_TIME_S])
def test_the_first_line_has_a_time_of_the_years_that_a_stamp_may_have(path: Path, after_s: float) -> None:
    path.write_bytes(f'{{"after_s":{after_s}}}\n'.encode() + line_of(SAMPLES[0]))
    assert Journal(path).after_s == after_s
