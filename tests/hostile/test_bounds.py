"""Bombs, endless names and forged models: bounded before they cost anything."""

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.support.hostile_files import TARGETS, forge, forged_models, fuzz
from tests.support.refusals import refuses
from tests.support.service_fuzz import mutant
from tests.support.writers import NEEDS, SLOW, WRITERS, tried_at_random

import tripwatt as tw
from tripwatt import modelfile
from tripwatt.errors import Fault, InvalidInput, first_faults
from tripwatt.forecasting import load_model
from tripwatt.learners.treetable import TreeTable
from tripwatt.modelfile import read_model, write_model
from tripwatt.routes import parse_route
from tripwatt.sources.canonical import canonical_of_text, canonical_samples, read_canonical
from tripwatt.sources.columnar import open_table
from tripwatt.sources.tum import read_overview


@pytest.mark.parametrize("name", TARGETS)
def test_mutants_of_every_input_are_read_or_refused(name: str) -> None:
    found = fuzz(name, 25, seed=3)
    assert found.wrong == []
    assert found.mutants == 25


def test_every_target_reads_its_examples(tmp_path: Path) -> None:
    for name, target in TARGETS.items():
        for example in target.examples():
            target.read(example, tmp_path)
        assert target.examples(), name


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_forged_models_are_refused_or_forecast() -> None:
    found = forged_models(8, seed=5)
    assert found.wrong == []


@pytest.mark.parametrize("name", WRITERS)
def test_a_writer_that_is_killed_or_has_no_space_leaves_the_old_or_the_new(name: str) -> None:
    for module in NEEDS[name]:
        pytest.importorskip(module)
    tried = tried_at_random(name, 3 if name in SLOW else 8, 3, seed=1)
    assert tried.wrong == []
    assert tried.killed > 0 < tried.failed


# --- bombs


def test_a_long_header_and_many_columns_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"header too long: .*got a first line of 1000001 bytes"):
        canonical_of_text(b"," * 1_000_001 + b"\n1\n")
    with pytest.raises(InvalidInput, match=r"too many columns: .*got 10001 columns; allowed: at most 10000"):
        canonical_of_text(b"," * 10_000 + b"\n1\n")
    refuses("unknown column", canonical_of_text, b"a," * 9_999 + b"b\n1\n")


def bomb(path: Path, rows: int, columns: int = 1) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    zeros = np.zeros(rows)
    pq.write_table(pa.table({f"c{k}": zeros for k in range(columns)}), path, compression="zstd")
    return path


def test_a_parquet_file_is_measured_before_it_is_read(tmp_path: Path) -> None:
    place = bomb(tmp_path / "rows.parquet", 3_000_000)
    assert place.stat().st_size < 100_000
    refuses(r"Parquet file too large: .*got 3000000 rows of 1 columns in \d+ bytes", read_canonical, place)
    assert len(open_table(bomb(tmp_path / "few.parquet", 500_000)).numbers(["c0"])[0]) == 500_000
    refuses(r"too large.*got 500001 rows", open_table, bomb(tmp_path / "more.parquet", 500_001))


def test_a_column_of_long_texts_is_measured_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tripwatt.sources import columnar

    pd.DataFrame({"t": ["x" * 1000] * 50, "v": 1.0}).to_parquet(tmp_path / "a.parquet")
    table = open_table(tmp_path / "a.parquet")
    assert table.texts("t") == ["x" * 1000] * 50
    monkeypatch.setattr(columnar, "MAX_CONTENT_BYTES", 4000)
    refuses(r"column too large: .*'t': got \d+ bytes when inflated", table.texts, "t")
    assert table.numbers(["v"])[0].sum() == 50.0


def test_a_sheet_is_measured_before_it_is_inflated(tmp_path: Path) -> None:
    place = tmp_path / "Overview.xlsx"
    with zipfile.ZipFile(place, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", b" " * 70_000_000)
    assert place.stat().st_size < 100_000
    refuses(r"archive too large: .*got 70000000 bytes when inflated", read_overview, place, [])


def test_a_part_of_a_model_is_measured_before_it_is_inflated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_model(tmp_path / "m", {}, {"a.npz": {"x": np.zeros(100_000)}})
    assert (tmp_path / "m" / "a.npz").stat().st_size < 10_000
    monkeypatch.setattr(modelfile, "MAX_PART_BYTES", 700_000)
    refuses("archive too large", read_model, tmp_path / "m")


# --- many faults


def test_unknown_names_cost_a_time_that_grows_with_their_number() -> None:
    names = {f"speed_{k}": np.zeros(3) for k in range(20_000)}
    started = time.process_time()
    with pytest.raises(InvalidInput) as caught:
        canonical_samples(names)
    assert time.process_time() - started < 2.0, "32,000 names took 13.5 s"
    faults = caught.value.faults
    unknown = [fault for fault in faults if fault.what == "unknown column or unit"]
    assert len(unknown) == 51
    assert unknown[-1].got == "19950 more"
    assert sum("did you mean" in fault.fix for fault in unknown) == 10
    header = ",".join(f"speed_{k}" for k in range(9_000)).encode()
    started = time.process_time()
    with pytest.raises(InvalidInput) as caught:
        parse_route(b"length_m," + header + b"\n1\n")
    assert time.process_time() - started < 2.0
    assert [f.got for f in caught.value.faults if "more" in f.got] == ["8950 more"]
    with pytest.raises(InvalidInput) as caught:
        parse_route(
            json.dumps([{"length_m": 1, "speed_m_s": 1, **{f"k{k}": 1 for k in range(5_000)}}]).encode()
        )
    assert len(caught.value.faults) == 51
    assert (caught.value.faults[-1].what, caught.value.faults[-1].got) == ("unknown key", "4950 more")


def test_duplicate_names_are_counted_once_each() -> None:
    with pytest.raises(InvalidInput) as caught:
        canonical_of_text(b"time_s,speed_m_s,time_s,time_s\n0,0,0,0\n")
    twice = [f for f in caught.value.faults if f.what == "duplicate column"]
    assert [(f.where, f.got) for f in twice] == [("table, column 'time_s'", "3 times")]


def test_faults_are_capped_with_their_number() -> None:
    faults = [Fault("a", str(k)) for k in range(51)]
    assert first_faults(faults[:50], "x") == faults[:50]
    assert first_faults(faults, "x") == [*faults[:50], Fault("further faults", "x", "1 more")]


@pytest.mark.parametrize("text", [b'[{"length_m": %s}]', b"[%s]", b'{"links": [%s]}', b'{"code": %s}'])
def test_deeply_nested_values_are_faults(text: bytes) -> None:
    for depth in (900, 3000):
        with pytest.raises(InvalidInput):
            parse_route(text % (b"[" * depth + b"]" * depth))


def test_no_input_steers_a_terminal() -> None:
    with pytest.raises(InvalidInput) as caught:
        canonical_of_text(b"time_s,\x1b[2J\x1b]0;owned\x07\n0,0\n")
    assert str(caught.value).isprintable() or "\x1b" not in str(caught.value)
    assert "\\x1b[2J" in str(caught.value)
    assert "\n" not in str(Fault("a", "b\nerror: faked", "c\r", "d\u202e"))
    assert len(str(Fault("a", "b" * 5000))) == 2003


# --- models whose digests were computed again


def trees(**changed) -> dict:
    arrays = {
        "split_feature": np.zeros((2, 2), dtype=np.int64),
        "threshold": np.zeros((2, 2)),
        "decision": np.zeros((2, 2), dtype=np.int64),
        "left": np.array([[1, -1], [1, -1]]),
        "right": np.array([[-3, -2], [-3, -2]]),
        "leaf_value": np.arange(6.0).reshape(2, 3),
    }
    return arrays | changed


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"left": np.array([[1, -1], [0, -1]])}, "split leads back"),
        ({"right": np.array([[-3, 1], [-3, -2]])}, "split leads back"),
        ({"left": np.array([[2, -1], [1, -1]])}, "split leads back"),
        ({"right": np.array([[-4, -2], [-3, -2]])}, "split leads back"),
        ({"threshold": np.array([[np.nan, 0.0], [0.0, 0.0]])}, "not a finite number"),
        ({"leaf_value": np.full((2, 3), np.inf)}, "not a finite number"),
        ({"split_feature": np.array([[0, 0], [0, -1]])}, "wrong column of a split"),
        ({"left": np.zeros((2, 2))}, "wrong shape"),
        ({"leaf_value": np.zeros((2, 2))}, "wrong shape"),
        ({"split_feature": np.zeros((1, 20_001), dtype=np.int64)}, "wrong shape"),
    ],
)
def test_arrays_that_make_no_trees_are_refused(changed: dict, what: str) -> None:
    assert TreeTable(**trees()).sum(np.array([[1.0], [-1.0]])).tolist() == [2.0 + 5.0, 0.0 + 3.0]
    with pytest.raises(InvalidInput, match=what):
        TreeTable(**trees(**changed))


def test_a_pipe_in_place_of_a_part_does_not_hang(tmp_path: Path) -> None:
    model = forge(tmp_path, "model.json", lambda part: None)
    assert load_model(model).vehicle.name == "bmw_i3_60ah"
    (model / "model.json").unlink()
    os.mkfifo(model / "model.json")
    refuses(r"cannot read a part of the model.*no regular file", load_model, model)


@pytest.mark.parametrize(
    "parts",
    [
        None,
        [],
        {"a.npz": None},
        {"a.npz": {"sha256": 1, "bytes": 2}},
        {"a.npz": {"sha256": "x", "bytes": "y"}},
    ],
)
def test_metadata_without_a_list_of_parts_are_damaged(tmp_path: Path, parts: object) -> None:
    import hashlib

    document = {"format": "tripwatt model", "format_version": 2, "parts": parts, "sha256": "0" * 64}
    text = json.dumps(document)
    (tmp_path / "metadata.json").write_text(text.replace("0" * 64, hashlib.sha256(text.encode()).hexdigest()))
    refuses(r"damaged or altered: .*name, SHA-256 and bytes of each part", read_model, tmp_path)


def test_a_reader_sees_the_old_or_the_new_model(tmp_path: Path) -> None:
    """Another process replaces the model all the time."""
    program = (
        "import sys, time, numpy as np\nfrom tripwatt.modelfile import write_model\nprint('go', flush=True)\n"
        "for k in range(100_000):\n"
        "    parts = {f'{n}.npz': {'x': np.full(300, k)} for n in range(6)}\n"
        "    write_model(sys.argv[1], {'about': k}, parts)\n    time.sleep(0.003)"
    )
    place = tmp_path / "m"
    write_model(place, {"about": -1}, {f"{n}.npz": {"x": np.full(300, -1)} for n in range(6)})
    writer = subprocess.Popen([sys.executable, "-c", program, str(place)], stdout=subprocess.PIPE)
    assert writer.stdout is not None
    writer.stdout.readline()
    seen = set()
    until = time.monotonic() + 1.5
    try:
        while time.monotonic() < until + (0.0 if len(seen) > 3 else 60.0):
            found = read_model(place)
            assert {int(v) for part in found.parts.values() for v in part["x"]} == {found.metadata["about"]}
            seen.add(found.metadata["about"])
    finally:
        writer.kill()
        writer.wait()
        writer.stdout.close()
    assert len(seen) > 3, "the writer was at work"


def test_a_model_that_is_not_there_is_missed_at_once(tmp_path: Path) -> None:
    started = time.monotonic()
    refuses("no model", read_model, tmp_path / "m")
    assert time.monotonic() - started < 0.5
    threading.Timer(0.1, lambda: write_model(tmp_path / "m", {"about": 1}, {})).start()
    (tmp_path / ".m.1.writing").mkdir()  # as a writer on a system that cannot exchange two names
    assert read_model(tmp_path / "m").metadata["about"] == 1


def test_pipes_as_inputs_are_faults(tmp_path: Path) -> None:
    for name in ("trip.csv", "trip.parquet", "trip.gpx", "car.toml"):
        os.mkfifo(tmp_path / name)
        read = tw.load_vehicle if name == "car.toml" else tw.read_route
        refuses(r"cannot be read|cannot read", read, str(tmp_path / name))


# --- times


MAPPING = (
    '[columns]\ntime_s = {column = "t", unit = "timestamp"}\nspeed_m_s = {column = "v", unit = "km/h"}\n'
    'voltage_v = {column = "u"}\ncurrent_a = {column = "i"}\n'
)


def stamped(folder: Path, stamps: list[str]) -> tuple[Path, Path]:
    (folder / "m.toml").write_text(MAPPING)
    rows = "".join(f"{stamp},36,360,{10 + k}\n" for k, stamp in enumerate(stamps))
    (folder / "t.csv").write_text("t,v,u,i\n" + rows)
    return folder / "t.csv", folder / "m.toml"


@pytest.mark.parametrize(
    "day", ["0001-01-01 00:00:", "9999-12-31 23:59:", "1969-12-31 23:59:", "2200-01-01 00:00:"]
)
def test_years_of_no_log_are_faults(tmp_path: Path, day: str) -> None:
    table, mapping = stamped(tmp_path, [f"{day}{k:02d}" for k in range(20)])
    with pytest.raises(InvalidInput, match=r"invalid time: .*row 2 .*and 19 more rows.*from 1970 to 2199"):
        tw.read_logs(table, "table", mapping, strict=True)


@pytest.mark.parametrize("day", ["1970-01-01T00:00:", "2199-12-31T23:59:"])
def test_years_of_a_log_are_read(tmp_path: Path, day: str) -> None:
    table, mapping = stamped(tmp_path, [f"{day}{k:02d}" for k in range(20)])
    assert tw.read_logs(table, "table", mapping).logs[0].duration_s == pytest.approx(19.0, abs=1e-5)


def test_the_end_of_daylight_saving_time_is_no_gap_where_the_zone_is_given(tmp_path: Path) -> None:
    before = [f"2026-10-25T02:59:{k}+02:00" for k in range(50, 60)]
    after = [f"2026-10-25T02:00:0{k}+01:00" for k in range(10)]
    table, mapping = stamped(tmp_path, before + after)
    assert tw.read_logs(table, "table", mapping).logs[0].duration_s == pytest.approx(19.0, abs=1e-5)
    table, mapping = stamped(tmp_path, before + [stamp[:-6] for stamp in after])
    with pytest.raises(
        InvalidInput, match=r"times with and without time zone: .*row 12 .*without a time zone"
    ):
        tw.read_logs(table, "table", mapping, strict=True)
    local = [stamp[:-6] for stamp in before + after]
    table, mapping = stamped(tmp_path, local)
    read = tw.read_logs(table, "table", mapping)
    assert read.logs[0].duration_s == pytest.approx(19.0, abs=1e-5)
    assert read.report is not None
    assert [group.what for group in read.report.groups()] == ["clock was set"]


@pytest.mark.parametrize("year", ["0001", "9999"])
def test_years_of_no_track_are_faults(year: str) -> None:
    points = "".join(
        f'<trkpt lat="{48 + k / 1e4:.4f}" lon="11"><time>{year}-06-01T00:00:0{k}+14:00</time></trkpt>'
        for k in range(2)
    )
    with pytest.raises(
        InvalidInput, match=rf"invalid time: .*point 1: got year {int(year)}; allowed: 1970 to 2199"
    ):
        parse_route(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode())


def test_damaged_statistics_of_a_column_do_not_end_the_interpreter(tmp_path: Path) -> None:
    """A mutant of which Arrow cannot give the size of one column: asking for it aborted the process."""
    target, rng = TARGETS["samples as Parquet"], np.random.default_rng([0, 17])
    (example,) = target.examples()
    body = [mutant(example, rng) for _ in range(2051)][-1]
    assert body != example
    with contextlib.suppress(InvalidInput):
        target.read(body, tmp_path)


def test_a_column_of_broken_text_is_a_fault(tmp_path: Path) -> None:
    texts = pa.array([b"2026-01-12T0\xff:30", b"2026"], pa.binary()).view(pa.string())
    pq.write_table(pa.table({"t": texts}), tmp_path / "a.parquet")
    refuses("unreadable Parquet file", open_table(tmp_path / "a.parquet").texts, "t")
