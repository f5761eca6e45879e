"""Plugin of pytest for an environment without all extras: `pytest -p tests.support.parts`.

A test that needs a package or an extra that is not installed is skipped with its name. The gate does not load this plugin: there a missing
package is a failure.
"""

from __future__ import annotations

from collections.abc import Generator

import pytest

OURS = ("tripwatt", "tests", "tools", "benchmarks")
"""Packages of this repository; `tripwatt_gamm` is another distribution."""


def missing(error: BaseException | None) -> str | None:
    """The reason to skip if an error, or one that caused it, says that a package or an extra is not installed."""
    while error is not None:
        if isinstance(error, ImportError) and (error.name or "").partition(".")[0] not in OURS:
            return f"needs {error.name or error}"
        if isinstance(error, ImportError) and (error.name or "").startswith("tests."):
            return f"needs what {error.name} needs"
        if "missing package" in str(error) or "No module named" in str(
            error
        ):  # said by a command or by a process
            return str(error)
        error = error.__cause__ or error.__context__
    return None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skip a module that cannot be imported for want of a package."""
    report = yield
    call = report.__dict__.get("call")
    reason = missing(call.excinfo.value) if call is not None and call.excinfo is not None else None
    if reason is not None:
        report.outcome, report.longrepr = "skipped", (f"{collector.path}", 0, f"Skipped: {reason}")
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip a test that needs a package which is not installed."""
    report = yield
    reason = missing(call.excinfo.value) if call.excinfo is not None else None
    if reason is not None:
        report.outcome, report.longrepr = "skipped", (f"{item.path}", 0, f"Skipped: {reason}")
    return report
