"""Tables of the command line lose nothing in a narrow terminal."""

import io
import sys

import pytest
from rich.console import Console

from tripwatt.command import printing
from tripwatt.trips import Flag


@pytest.mark.parametrize("width", [20, 40, 200])
def test_a_narrow_terminal_cuts_no_number(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    shown = Console(file=io.StringIO(), width=width)
    monkeypatch.setattr(printing, "console", lambda stream=sys.stderr: shown)
    rows = [("elevation_m", "-500 to 9000", "words that may break"), ("speed_m_s", "0 to 90", "more words")]
    printing.print_table("Inputs", ("input", "allowed", "meaning"), rows, folding=("meaning",))
    lines = shown.file.getvalue().splitlines()
    assert lines[0] == "Inputs"
    (elevation,) = (line for line in lines if "elevation_m" in line)
    assert "-500 to 9000" in elevation
    for word in ["words", "that", "may", "break", "more"]:
        assert any(word in line for line in lines)


def test_a_space_that_does_not_break_is_a_space(capsys: pytest.CaptureFixture[str]) -> None:
    printing.print_table("Changes", ("cause",), [("road load (100\u00a0%)",)])
    assert "road load (100 %)" in capsys.readouterr().out


def test_notes_of_one_kind_are_one_line() -> None:
    many = [Flag("speed_rebuilt", f"drive{number}", 1.0, "s") for number in range(58)]
    other = Flag("battery_empty", "battery", 120.0, "wh")
    first, second = printing.grouped([*many, other])
    assert first.startswith("drive0")
    assert first.endswith(" (and 57 more like it)")
    assert "more like it" not in second
