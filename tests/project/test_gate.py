"""The gate: its parts in order, one that fails ends it, and what each part costs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from tools.quality import gate


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Two parts that run scripts of the test, the second of which fails."""
    (tmp_path / "good.py").write_text("")
    (tmp_path / "bad.py").write_text("raise SystemExit(3)")
    program = Path(sys.executable).name
    parts = {name: f"{program} {name}.py" for name in ("good", "bad", "never")}
    monkeypatch.setattr(gate, "ROOT", tmp_path)
    monkeypatch.setattr(gate, "TIMES", tmp_path / "out" / "times.json")
    monkeypatch.setattr(gate, "PARTS", parts)
    return parts


def test_a_part_that_fails_ends_the_gate_and_costs_are_shown(
    parts: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert gate.main() == 3
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [words[0] for words in shown] == ["good:", "good:", "bad:", "bad:"]
    assert shown[-1][-1] == "failed"
    assert [words[2] for words in shown if len(words) > 3] == ["s,", "s,"]
    assert gate.main(["good"]) == 0
