"""A pytest plugin that writes how long each passed test took: ``-p tools.quality.durations`` and TRIPWATT_TEST_TIMES."""

from __future__ import annotations

import json
import os
from collections import defaultdict
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
    passed = {name: [t.get("setup", 0.0), t["call"]] for name, t in _seconds.items() if "call" in t}
    Path(os.environ["TRIPWATT_TEST_TIMES"]).write_text(json.dumps(passed))
