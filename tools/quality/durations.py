"""A pytest plugin that writes how long each passed test took into the file TRIPWATT_TEST_TIMES: ``-p tools.quality.durations``.

The seconds of the tests of each room are printed before the last line of pytest.
"""

from __future__ import annotations

import json
import os
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

_seconds: dict[str, dict[str, float]] = defaultdict(dict)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note the seconds of one phase of one test."""
    if report.passed:
        _seconds[report.nodeid][report.when or ""] = report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write set-up and call of the tests that passed."""
    if hasattr(session.config, "workerinput"):
        return
    Path(os.environ["TRIPWATT_TEST_TIMES"]).write_text(json.dumps(_passed()))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the seconds of the tests of each room."""
    for room, number, seconds in by_room(_passed()):
        terminalreporter.write_line(f"{room:28} {number:6} tests {seconds:8.1f} s")


def _passed() -> dict[str, list[float]]:
    return {name: [t.get("setup", 0.0), t["call"]] for name, t in _seconds.items() if "call" in t}


def by_room(times: Mapping[str, list[float]]) -> Iterator[tuple[str, int, float]]:
    """Room, number and seconds of its tests, the longest first; doctests belong to the file that they are in.

    Examples
    --------
    >>> list(by_room({"tests/roads/test_a.py::b": [0.5, 1.0], "tests/roads/maps/test_c.py::d": [0, 2]}))
    [('tests/roads', 2, 3.5)]
    """
    seconds, number = defaultdict[str, float](float), Counter[str]()
    for name, spent in times.items():
        room = "/".join(Path(name.partition("::")[0]).parts[:2])
        seconds[room] += sum(spent)
        number[room] += 1
    for room in sorted(seconds, key=lambda room: -seconds[room]):
        yield room, number[room], seconds[room]
