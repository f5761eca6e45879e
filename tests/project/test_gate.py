"""The gate: its parts in order, all that fail, the tests after the others alone, and what each part costs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from tools.quality import gate


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Quick parts that run scripts of the test, the second of which fails, and tests."""
    (tmp_path / "good.py").write_text("")
    (tmp_path / "bad.py").write_text("raise SystemExit(3)")
    program = Path(sys.executable).name
    parts = {name: f"{program} {name}.py" for name in ("good", "bad")}
    parts |= {"last": f"{program} good.py", "tests": f"{program} bad.py"}
    monkeypatch.setattr(gate, "ROOT", tmp_path)
    monkeypatch.setattr(gate, "TIMES", tmp_path / "out" / "times.json")
    monkeypatch.setattr(gate, "PARTS", parts)
    return parts


def test_every_quick_part_is_run_and_the_tests_if_none_failed_and_costs_are_shown(
    parts: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert gate.main() == 3
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [words[0] for words in shown] == ["good:"] * 2 + ["bad:"] * 2 + ["last:"] * 2 + ["tests:"]
    assert [words[-1] for words in shown if words[-1] in ("failed", "bad")] == ["failed", "bad"]
    assert [words[2] for words in shown[:-1] if len(words) > 3] == ["s,", "s,", "s,"]
    assert gate.main(["good"]) == 0
    assert gate.main(["tests"]) == 3
