"""The comparison of two installations' speed."""

from pathlib import Path

import pytest
from benchmarks import paired_speed
from tests.support.command import answered


def test_pairs_are_measured_in_turn_and_their_ratios_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = {"old": iter([9.0, 2.0, 4.0, 5.0]), "new": iter([9.0, 1.0, 1.0, 10.0])}
    order = []

    def measured(python: str, folder: Path) -> paired_speed.Measured:
        order.append(python)
        return {"a command": next(times[python])}

    monkeypatch.setattr(paired_speed, "measured", measured)
    monkeypatch.setattr("subprocess.run", lambda *arguments, **options: None)
    told: list[str] = []
    paired_speed.compared("old", "new", 3, tmp_path, told.append)
    assert order == ["old", "new", "old", "new", "new", "old", "old", "new"]
    head, row = told
    assert head.split()[-2:] == ["the", "pairs"]
    assert row.split() == ["a", "command", "4.000", "1.000", "0.50", "0.25", "to", "2.00"]


def test_a_request_holds_the_trip_that_the_command_line_writes(tmp_path: Path) -> None:
    assert answered("example-trip", "--out", tmp_path / "trip.csv").code == 0
    request = paired_speed.forecast_request(tmp_path / "trip.csv")
    assert request.startswith(b'{"samples": {"time_s": [0.0, ')
    assert request.endswith(b', "ambient_temperature_degc": -5.0}')
