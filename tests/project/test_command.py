"""A function as a command."""

import subprocess
import sys
from pathlib import Path

import pytest
from tests.support import ROOT

SCRIPT = '''"""A script."""
from tools.command import run
def main(path: str, number: int = 2, write: bool = False) -> int:
    """What it does."""
    print(path, number, write)
    return number
run(main)
'''


@pytest.mark.parametrize(
    ("words", "code", "printed"),
    [
        (("a",), 2, "a 2 False\n"),
        (("a", "--number", "0", "--write"), 0, "a 0 True\n"),
        (("a", "--number", "x"), 2, ""),
        ((), 2, ""),
    ],
)
def test_arguments_are_words_and_options_and_the_result_is_the_exit_code(
    tmp_path: Path, words: tuple[str, ...], code: int, printed: str
) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, str(tmp_path / "script.py"), *words]
    done = subprocess.run(command, capture_output=True, text=True, env={"PYTHONPATH": str(ROOT)}, check=False)
    assert (done.returncode, done.stdout) == (code, printed), done.stderr
