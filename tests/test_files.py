"""Files from outside within bounds, and outputs that are whole at every moment."""

import ast
import csv
import io
import os
import platform
import subprocess
import sys
import tracemalloc
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support import ROOT
from tests.support.refusals import refuses

from tripwatt import files
from tripwatt.errors import InvalidInput
from tripwatt.files import (
    csv_text,
    exchange,
    file_head,
    folder_lock,
    move_new,
    read_file,
    read_text_file,
    replace_folder,
    restore_folder,
    write_file,
)


def test_a_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    place = tmp_path / "a.csv"
    place.write_bytes(b"12345")
    assert read_file(place, 5) == b"12345"
    assert file_head(place, 2) == b"12"
    refuses(r"file too large: .*a.csv: got over 4 bytes; allowed: 4 bytes", read_file, place, 4)


def test_a_small_file_takes_little_memory(tmp_path: Path) -> None:
    place = tmp_path / "a.csv"
    place.write_bytes(bytes(200_000))
    tracemalloc.start()
    try:
        assert read_file(place) == bytes(200_000)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000, "not the memory of the largest file"
    finally:
        tracemalloc.stop()
    made_up = Path("/proc/self/cmdline")
    if made_up.exists():
        assert read_file(made_up) == made_up.read_bytes() != b"", "the system gives its size as 0"


def test_pipes_devices_and_folders_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", Path("/dev/zero")):
        refuses(r"no regular file; .*write its content into a file first", read_file, place)
        assert file_head(place) == b""
    refuses("Is a directory", read_file, tmp_path)
    refuses("No such file", read_file, tmp_path / "nothing")
    refuses("null", read_file, "a\0b")


def test_text_is_utf_8(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbfn = '\xc3\xbc'")
    assert read_text_file(tmp_path / "a.toml", 100) == "n = 'ü'"
    (tmp_path / "a.toml").write_bytes(b"\xff\xff")
    refuses("not a text file", read_text_file, tmp_path / "a.toml", 100)


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    place = tmp_path / "a.txt"
    place.write_text("old")

    def half(partial: Path) -> None:
        partial.write_text("ne")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        write_file(place, half)
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert place.read_text() == "old"
    write_file(place, lambda partial: partial.write_text("new") and None)
    assert place.read_text() == "new"


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "a.txt").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "there" / "a.txt")
    write_file(tmp_path / "link", lambda partial: partial.write_text("new") and None)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "there" / "a.txt").read_text() == "new"


def filled(text: str):
    return lambda made: (made / "a").write_text(text) and None


@pytest.mark.parametrize("can_exchange", [True, False])
def test_a_folder_is_replaced_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, can_exchange: bool
) -> None:
    if not can_exchange:
        monkeypatch.setattr(files, "exchange", lambda one, other: False)
    out = tmp_path / "deep" / "out"
    replace_folder(out, filled("one"))
    replace_folder(out, filled("two"))
    assert (out / "a").read_text() == "two"

    def fails(made: Path) -> None:
        filled("three")(made)
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        replace_folder(out, fails)
    assert (out / "a").read_text() == "two"
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_a_failed_move_brings_the_older_folder_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    replace_folder(out, filled("one"))
    monkeypatch.setattr(files, "exchange", lambda one, other: False)
    rename = Path.rename

    def full(self: Path, target: Path) -> Path:
        if self.name.endswith(".writing"):
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(OSError, match="No space"):
        replace_folder(out, filled("two"))
    assert (out / "a").read_text() == "one"


def test_what_a_killed_process_moved_away_comes_back(tmp_path: Path) -> None:
    out, older = tmp_path / "out", tmp_path / ".out.older"
    older.mkdir()
    (older / "a").write_text("one")
    restore_folder(out)
    assert (out / "a").read_text() == "one"
    older.mkdir()
    restore_folder(out)
    assert not older.exists(), "its successor is there"
    restore_folder(out)
    assert (out / "a").read_text() == "one"


def test_names_of_dead_processes_are_removed_and_those_of_the_living_stay(tmp_path: Path) -> None:
    dead = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True
    )
    left = tmp_path / f".out.{platform.node()}.0.{int(dead.stdout)}.writing"
    alive = tmp_path / f".out.{platform.node()}.0.{os.getppid()}.writing"
    others = [
        tmp_path / name for name in (f".out.elsewhere.0.{int(dead.stdout)}.writing", ".other.1.writing")
    ]
    for folder in (left, alive, *others):
        folder.mkdir()
    replace_folder(tmp_path / "out", filled("one"))
    assert not left.exists()
    assert alive.exists()
    assert all(folder.exists() for folder in others), "of another machine, and of another output"


def test_two_names_are_exchanged_in_one_step(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).write_text(name)
    if not exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system cannot exchange two names")
    assert ((tmp_path / "a").read_text(), (tmp_path / "b").read_text()) == ("b", "a")
    with pytest.raises(OSError, match="No such file"):
        exchange(tmp_path / "a", tmp_path / "nothing")


def test_a_lock_keeps_others_out_until_its_holder_ends(tmp_path: Path) -> None:
    program = (
        "import sys, pathlib, time\nfrom tripwatt.files import folder_lock\n"
        "with folder_lock(pathlib.Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(InvalidInput, match="another run writes this output"), folder_lock(tmp_path):
        pass
    holder.kill()
    holder.wait()
    holder.stdout.close()
    with folder_lock(tmp_path):
        pass
    with folder_lock(tmp_path):
        pass


@pytest.mark.parametrize("second_names", [True, False])
def test_a_new_file_takes_the_place_of_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, second_names: bool
) -> None:
    def refused(source: Path, target: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    if not second_names:
        monkeypatch.setattr(os, "link", refused)
    for name in ("first", "second"):
        (tmp_path / name).write_bytes(name.encode())
    move_new(tmp_path / "first", tmp_path / "a.csv")
    with pytest.raises(FileExistsError):
        move_new(tmp_path / "second", tmp_path / "a.csv")
    left = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.name != "first"}
    assert left == {"a.csv": b"first", "second": b"second"}


FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")


@given(
    texts=st.lists(
        st.text(st.sampled_from("=+-@'\t\r\n\"\uff1d, ;ab1"), max_size=6) | st.none(), min_size=1, max_size=8
    ),
    number=st.floats(allow_nan=False, allow_infinity=False),
    whole=st.integers(-(2**53), 2**53),
)
def test_no_cell_of_a_table_is_a_formula_and_all_come_back(
    texts: list[str | None], number: float, whole: int
) -> None:
    """Texts come back without their apostrophe, with one kind of line break, and numbers are those that were written."""
    table = pd.DataFrame({"=name": texts, "number": number, "whole": whole, "yes": True})
    for kind in (object, "string", "category"):
        written = csv_text(table.astype({"=name": kind}))
        head, *rows = csv.reader(io.StringIO(written, newline=""))
        assert head == ["'=name", "number", "whole", "yes"]
        for (cell, *others), text in zip(rows, texts, strict=True):
            assert not cell.startswith(FORMULA_STARTS)
            assert cell.removeprefix("'") == (text or "").replace("\r", "\n")
            assert (float(others[0]), int(others[1]), others[2]) == (number, whole, "True")


def test_one_function_writes_tables() -> None:
    folders = (ROOT / "src", ROOT / "gamm" / "src")
    writers = {
        file.name
        for folder in folders
        for file in folder.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.Attribute) and node.attr in ("to_csv", "to_excel", "to_clipboard")
    }
    assert writers == {"files.py"}
