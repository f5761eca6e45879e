"""The gate of the front end, and a rebuild of the committed bundle, where Node is installed."""

from __future__ import annotations

import json
from pathlib import Path

from tests.support.front_end import WEB, run

import tripwatt.server.http
import tripwatt.study.report

PAGE = Path(tripwatt.server.http.__file__).with_name("page")
REPORT = Path(tripwatt.study.report.__file__).with_name("templates")


def test_types_lint_format_and_unit_tests(web: Path) -> None:
    found = run(web, "npm", "run", "--silent", "gate")
    assert found.returncode == 0, found.stdout[-6000:] + found.stderr[-2000:]


def test_rebuild_has_the_bytes_of_the_bundle(web: Path, tmp_path: Path) -> None:
    page, report = tmp_path / "page", tmp_path / "report"
    report.mkdir()
    found = run(web, "node", "build.mjs", str(page), str(report))
    assert found.returncode == 0, found.stderr[-2000:]
    built = {file.relative_to(page): file for file in page.rglob("*") if file.is_file()}
    committed = {file.relative_to(PAGE): file for file in PAGE.rglob("*") if file.is_file()}
    assert built.keys() == committed.keys()
    pairs = [(built[name], committed[name]) for name in built]
    pairs += [(file, REPORT / file.name) for file in report.iterdir()]
    assert len(pairs) == len(built) + 2
    assert [new.name for new, old in pairs if new.read_bytes() != old.read_bytes()] == []


def test_lock_file_names_no_host() -> None:
    listed = json.loads((WEB / "package-lock.json").read_text())["packages"]
    assert [name for name, row in listed.items() if "resolved" in row] == []
    assert all(row.get("integrity", "").startswith("sha512-") for name, row in listed.items() if name)
