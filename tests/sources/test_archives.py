"""Archives and workbooks become tables that readers read; nothing else, and nothing outside of the folder."""

from __future__ import annotations

import datetime as dt
import io
import random
import zipfile
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.sources import archives, read_logs
from tripwatt.sources.archives import is_packed, safe_name, unpack, unpacked

CSV = b"time_s,speed_m_s,voltage_v,current_a\n" + b"".join(b"%d,10,350,20\n" % k for k in range(60))


def zipped(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in files.items():
            made.writestr(name, content)
    return packed.getvalue()


def workbook(**sheets: list[list[Any]]) -> bytes:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    packed = io.BytesIO()
    book.save(packed)
    return packed.getvalue()


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_suffixes_tell_what_is_packed() -> None:
    found = {name: is_packed(name) for name in ("a.zip", "a.XLSX", "a.csv", "a.parquet", "zip")}
    assert found == {"a.zip": True, "a.XLSX": True, "a.csv": False, "a.parquet": False, "zip": False}


def test_an_archive_gives_its_tables_in_order(tmp_path: Path) -> None:
    files = {"b.csv": CSV, "a/b.csv": CSV + b"\n", "notes.pdf": b"%PDF", ".hidden.csv": CSV, "c.TXT": CSV}
    made = unpack("logs.zip", tmp_path, content=zipped(files))
    assert [file.name for file in made] == ["b.csv", "b 2.csv", "c.txt"]
    assert made[1].read_bytes() == CSV + b"\n"
    assert names(tmp_path) == ["b 2.csv", "b.csv", "c.txt"]


def test_a_workbook_gives_each_sheet_from_its_header_on(tmp_path: Path) -> None:
    when = dt.datetime(2026, 1, 2, 3, 4, 5)
    drive = [
        ["My car"],
        [],
        ["time", "speed", "on", None, "soc"],
        [when, 0, None, None, 80.5],
        [None] * 5,
        [when, 1.5, "x", "", 0],
    ]
    content = workbook(drive=drive, empty=[["one", "two"]], more=[["t", "v"], [0, 1]])
    made = unpack("log.xlsx", tmp_path, content=content)
    assert [file.name for file in made] == ["log drive.csv", "log more.csv"]
    assert made[0].read_text().splitlines() == [
        "time,speed,on,,soc",
        "2026-01-02T03:04:05,0,,,80.5",
        "2026-01-02T03:04:05,1.5,x,,0",
    ]
    only = unpack("single.xlsx", tmp_path, content=workbook(drive=[["t", "v"], [0, 0]]))
    assert [file.name for file in only] == ["single.csv"]
    assert only[0].read_text() == "t,v\n0,0\n"
    inside = unpack("both.zip", tmp_path, content=zipped({"in.xlsx": workbook(s=[["t", "v"], [1, 2]])}))
    assert [file.name for file in inside] == ["in.csv"]


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("a.exe", b"MZ", "no trips"),
        ("a.zip", zipped({"a.pdf": b"x"}), "no trips"),
        ("a.zip", b"PK\x03\x04", "unreadable archive"),
        ("a.xlsx", b"no workbook", "unreadable sheet"),
        ("a.xlsx", workbook(empty=[["one"]]), "no trips"),
    ],
)
def test_what_holds_no_table_is_refused(tmp_path: Path, name: str, content: bytes, what: str) -> None:
    with pytest.raises(InvalidInput, match=what):
        unpack(name, tmp_path, content=content)
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["a.zip", "a.xlsx"])
def test_a_damaged_file_is_one_clear_error_and_leaves_nothing(tmp_path: Path, name: str) -> None:
    sheet = [["t", "v"], *([k, 10.0 * k] for k in range(30))]
    whole = zipped({"a.csv": CSV, "b.xlsx": workbook(s=sheet)}) if name == "a.zip" else workbook(s=sheet)
    draw, refused = random.Random(5), 0
    for number in range(80):
        damaged = bytearray(whole)
        for _ in range(draw.choice((1, 2, 5, 20))):
            at, kind = draw.randrange(len(damaged)), draw.random()
            if kind < 0.6:
                damaged[at] = draw.randrange(256)
            elif kind < 0.8:
                del damaged[at : at + draw.randrange(1, 40)]
            else:
                damaged[at:at] = draw.randbytes(draw.randrange(1, 20))
        folder = tmp_path / f"{number}"
        folder.mkdir()
        made, faults = None, ()
        try:
            made = unpack(name, folder, content=bytes(damaged))
        except InvalidInput as error:
            faults = error.faults
        assert len(faults) == (made is None)
        assert names(folder) == sorted(file.name for file in made or ())
        refused += made is None
    assert refused > 45


def test_files_of_an_archive_are_counted_and_its_content_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archives, "MAX_FILES", 3)
    three = {f"{k}.csv": CSV for k in range(3)}
    assert len(unpack("a.zip", tmp_path, content=zipped(three))) == 3
    with pytest.raises(InvalidInput, match=r"too many files.*4 tables.*at most 3"):
        unpack("a.zip", tmp_path, content=zipped(three | {"3.csv": CSV}))
    with pytest.raises(InvalidInput, match="archive too large"):
        unpack("a.zip", tmp_path, content=zipped({"a.csv": bytes((1 << 28) + 1)}))


def test_readers_read_what_was_unpacked(tmp_path: Path) -> None:
    (tmp_path / "logs.zip").write_bytes(zipped({"a.csv": CSV, "b.csv": CSV.replace(b",10,", b",11,")}))
    with unpacked(tmp_path / "logs.zip", []) as tables:
        assert [log.trip_id for log in read_logs(tables, "table").logs] == ["a", "b"]
    assert not tables.exists()
    (tmp_path / "c.csv").write_bytes(CSV.replace(b",10,", b",12,"))
    with unpacked(tmp_path, []) as tables:
        assert len(read_logs(tables, "table").logs) == 3
    with unpacked(tmp_path / "c.csv", []) as tables:
        assert tables == tmp_path / "c.csv"
    with unpacked(tmp_path / "missing.csv", []) as tables:
        assert tables == tmp_path / "missing.csv"


@pytest.mark.parametrize(("source", "files"), [("", ["b.csv", "c.csv"]), ("logs.zip", ["logs.zip/b.csv"])])
def test_a_fault_names_what_the_user_gave(tmp_path: Path, source: str, files: list[str]) -> None:
    (tmp_path / "logs.zip").write_bytes(zipped({"a.csv": CSV, "b.csv": b"Time;Speed"}))
    (tmp_path / "c.csv").write_bytes(b"Time;Speed")
    report = read_logs(tmp_path / source, "table").report
    assert report is not None
    assert [fault.where for fault in report.faults] == [f"{tmp_path / file}" for file in files]
    (tmp_path / "bad.zip").write_bytes(b"PK")
    with pytest.raises(InvalidInput, match=f"unreadable archive: {tmp_path / 'bad.zip'}"):
        read_logs(tmp_path / "bad.zip", "table")


@given(st.text(max_size=200))
def test_a_safe_name_is_one_part_of_a_path(name: str) -> None:
    made = safe_name(name, ".csv")
    assert made == Path(made).name
    assert made.endswith(".csv")
    assert not made.startswith(".")
    assert len(made.encode()) <= 164
    assert not set(made) & set('/\\:*?"<>|\0\n')


@pytest.mark.parametrize("letter", ["a", "\u00fc", "\u4e00", "\U00020000"])
def test_names_have_a_largest_number_of_bytes(tmp_path: Path, letter: str) -> None:
    """80 letters of four bytes are no name of a file: as an upload, and as a member of an archive beside another one."""
    content = b"time_s,speed_m_s\n0,1\n"
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in (f"{letter * 80}.csv", f"{letter * 200}.csv", "b.csv"):
            archive.writestr(name, content + name.encode())
    made = [
        *unpack(f"{letter * 80}.csv", tmp_path, content=content),
        *unpack("a.zip", tmp_path, content=packed.getvalue()),
    ]
    assert len({*made}) == 4
    assert all(file.stem.startswith(letter * 40) for file in made[:3])
