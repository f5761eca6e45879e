"""The README's quickstart runs as it stands, and prints what it shows."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest
from tests.support import ROOT
from tools.docs import write_cli
from tools.docs.pages import part, with_part

from tripwatt.command import main

README = (ROOT / "README.md").read_text("utf-8")


def blocks(language: str = "") -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.M | re.S)


def quickstart(folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Runs the commands of the forecast's block; gives what the last one prints."""
    commands = next(b for b in blocks() if b.startswith("tripwatt ")).splitlines()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "100")
    for command in commands:
        monkeypatch.setattr("sys.argv", shlex.split(command))
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
            main()
    return out.getvalue()


def test_the_quickstart_prints_what_the_readme_shows(tmp_path, monkeypatch):
    printed = quickstart(tmp_path, monkeypatch).rstrip().splitlines()
    shown = next(b for b in blocks() if b.startswith("trip, ")).rstrip().splitlines()
    # how wide the rule and a column of a table are differs by a sign between releases of rich
    same = [
        [re.sub(" +", " ", re.sub("─+", "─", line)).strip() for line in lines] for lines in (printed, shown)
    ]
    assert same[0] == same[1]


def test_the_python_of_the_readme_runs(tmp_path, monkeypatch):
    quickstart(tmp_path, monkeypatch)
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line and not line.startswith("import")]) <= 5
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(code, {})  # it is ours
    assert blocks("text") == [out.getvalue()]


def test_the_readme_is_a_screen_and_a_half():
    assert len(README.splitlines()) < 110
    assert sum(line.startswith("|") for line in README.splitlines()) <= 8


def test_the_example_is_written_by_the_script():
    shown = part(README, "example")
    assert with_part(README, "example", shown) == README
    assert all(command in shown for command in write_cli.EXAMPLE)


def test_contributing_is_two_screens() -> None:
    assert len((ROOT / "CONTRIBUTING.md").read_text("utf-8").splitlines()) <= 60
