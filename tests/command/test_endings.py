"""Signals, full disks and strange outputs: a command ends with one message, and leaves nothing half done."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.support.command import Answer
from tests.support.full_disk import full_disk
from tests.support.refusals import refuses

from tripwatt.command import TRACEBACK, UNEXPECTED
from tripwatt.command.evaluate import unfinished_folder
from tripwatt.command.shared import write_text
from tripwatt.errors import InvalidInput
from tripwatt.files import folder_lock
from tripwatt.modelfile import require_place
from tripwatt.server.cars.folder import create_car, open_car
from tripwatt.study.synthetic import synthetic_fleet

WORKING = """
import pathlib, sys, time
import tripwatt.command as cli
from tripwatt.parallel import map_unordered

def work(seconds):
    (pathlib.Path(sys.argv[1]) / str(__import__("os").getpid())).touch()
    time.sleep(seconds)

def command():
    for _ in map_unordered(work, [60.0] * 3, n_jobs=2):
        pass

cli.app = lambda prog_name: command()
cli.main()
"""


def members(session: int) -> list[int]:
    """Living processes of a session."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are listed in /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_a_command(tmp_path: Path, number: signal.Signals) -> None:
    program = tmp_path / "program.py"
    program.write_text(WORKING)
    (tmp_path / "at-work").mkdir()
    process = subprocess.Popen(
        [sys.executable, str(program), str(tmp_path / "at-work")],
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60
    while len(list((tmp_path / "at-work").iterdir())) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.02)
    assert len(members(process.pid)) >= 3
    process.send_signal(number)
    assert process.wait(20) == (143 if number == signal.SIGTERM else -signal.SIGKILL)
    until = time.monotonic() + 20
    while members(process.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert members(process.pid) == []
    assert process.stderr is not None
    said = process.stderr.read()
    process.stderr.close()
    if number == signal.SIGTERM:
        assert "Traceback" not in said


def test_an_output_has_one_writer(tmp_path: Path) -> None:
    unfinished = unfinished_folder(tmp_path / "out")
    with (
        folder_lock(unfinished),
        pytest.raises(InvalidInput, match="another run writes this output"),
        folder_lock(unfinished),
    ):
        pass
    with folder_lock(unfinished):
        pass


def test_a_second_run_ends_at_its_start(run: Callable[..., Answer], tmp_path: Path) -> None:
    unfinished = unfinished_folder(tmp_path / "out")
    with folder_lock(unfinished):
        answer = run("evaluate", "--out", tmp_path / "out", "--models", "constant", "--jobs", "1")
    assert answer.code == 2
    assert "another run writes this output" in answer.err
    assert not (tmp_path / "out").exists()


def test_strange_outputs_are_refused(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    refuses(r"output is not a folder: --out: got .*link -> ", require_place, tmp_path / "link", None)
    for place in ("/", "/tmp/..", "."):
        refuses("output cannot be replaced", require_place, Path(place), None)
    (tmp_path / "there").mkdir()
    (tmp_path / "good").symlink_to(tmp_path / "there")
    require_place(tmp_path / "good", None)
    os.mkfifo(tmp_path / "pipe")
    refuses("output is not a folder", require_place, tmp_path / "pipe", None)
    refuses("no regular file", write_text, "x", tmp_path / "pipe")
    refuses(r"cannot write the file: --out: .*a folder", write_text, "x", tmp_path / "there")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_disk_is_one_message() -> None:
    program = "import sys; from tripwatt.command import main; sys.argv[1:] = ['mapping', 'list']; main()"
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-c", program], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "error: the system reports No space left on device\n"


def test_an_unexpected_error_has_a_code_and_a_sentence_of_its_own(
    run: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(prog_name: str) -> None:
        raise ZeroDivisionError("by \x1b[2J nothing")

    monkeypatch.setattr("tripwatt.command.app", fails)
    for shown in (False, True):
        monkeypatch.delenv(TRACEBACK, raising=False)
        if shown:
            monkeypatch.setenv(TRACEBACK, "1")
        answer = run()
        assert answer.code == UNEXPECTED
        last = answer.err.splitlines()[-1]
        assert last.startswith(
            r"error: an error of tripwatt, not of your input: ZeroDivisionError: by \x1b[2J"
        )
        assert ("Traceback" in answer.err) == shown


def test_a_full_disk_ends_car_add_with_one_message(run: Callable[..., Answer], tmp_path: Path) -> None:
    create_car(tmp_path / "leaf", "nissan_leaf_24")
    (log,) = synthetic_fleet(1).logs
    log.samples.iloc[:300].to_csv(tmp_path / "a.csv", index=False)
    for free, code in ((0, 2), (2000, 2), (1 << 24, 0)):
        with full_disk(free):
            answer = run("car", "add", tmp_path / "leaf", tmp_path / "a.csv")
        assert answer.code == code, answer.err
        assert "Traceback" not in answer.err
        if code:
            assert answer.err.splitlines()[-1].startswith("error: cannot use the car: ")
    assert len(open_car(tmp_path / "leaf").diary) == 1


def test_a_file_is_whole_or_not_there(
    run: Callable[..., Answer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "trip.csv"
    out.write_bytes(b"old")

    def full(self: Path, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        answer = run("example-trip", "--out", out)
    assert answer.code == 2
    assert "cannot write the file: --out" in answer.err
    assert out.read_bytes() == b"old"
    assert run("example-trip", "--out", out).code == 0
    assert [p.name for p in tmp_path.iterdir()] == ["trip.csv"]


def test_many_faults_are_capped(run: Callable[..., Answer], tmp_path: Path) -> None:
    trip = tmp_path / "trip.csv"
    trip.write_text(",".join(f"\x1b[31mc{k}" for k in range(5000)) + "\n1\n")
    answer = run("forecast", trip)
    assert answer.code == 2
    assert len(answer.err.splitlines()) < 70
    assert "4950 more" in answer.err
    assert "\x1b" not in answer.err
