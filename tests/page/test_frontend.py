"""The gate of the front end, and a rebuild of the committed bundle, where Node is installed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

import tripwatt.service
from tripwatt.service.app import Api
from tripwatt.service.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
WEB = ROOT / "web"
PAGE = Path(tripwatt.service.__file__).with_name("page")
LEAST_NODE = 20
LONGEST_S = 240


def run(folder: Path, *command: str, given: str = "") -> subprocess.CompletedProcess[str]:
    """A command of Node, with its output; npm's cache and its messages of the day stay out of the way."""
    quiet = {"NO_COLOR": "1", "NPM_CONFIG_UPDATE_NOTIFIER": "false", "NPM_CONFIG_FUND": "false"}
    return subprocess.run(
        command,
        cwd=folder,
        input=given,
        env={**os.environ, **quiet},
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )


def node_version() -> int | None:
    """The main version of Node; None without Node or npm."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        return None
    found = run(ROOT, "node", "--version").stdout
    return int(found.lstrip("v").split(".")[0]) if found.startswith("v") else None


def packages(lock: Path) -> dict[str, str]:
    """Versions of the packages in a lock file; those of other systems are left out."""
    listed = json.loads(lock.read_text())["packages"]
    return {name: row["version"] for name, row in listed.items() if name and not row.get("optional")}


def is_installed() -> bool:
    """Whether `web/node_modules` holds what the lock file says."""
    installed = WEB / "node_modules" / ".package-lock.json"
    return installed.is_file() and packages(installed) == packages(WEB / "package-lock.json")


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources with their packages: as they are, or installed into a copy."""
    version = node_version()
    if version is None or version < LEAST_NODE:
        pytest.skip(f"needs Node {LEAST_NODE} or newer with npm, found {version}")
    if is_installed():
        return WEB
    copy = tmp_path_factory.mktemp("front-end")
    shutil.copytree(ROOT / "tests" / "vectors", copy / "tests" / "vectors")
    shutil.copytree(WEB, copy / "web", ignore=shutil.ignore_patterns("node_modules"))
    cache = f"--cache={copy / 'npm-cache'}"
    found = run(copy / "web", "npm", "ci", "--no-audit", "--prefer-offline", cache)
    if found.returncode != 0:
        pytest.skip(f"npm ci failed, is there a network? {found.stderr.strip()[-300:]}")
    return copy / "web"


def test_types_lint_format_and_unit_tests(web: Path) -> None:
    found = run(web, "npm", "run", "--silent", "gate")
    assert found.returncode == 0, found.stdout[-6000:] + found.stderr[-2000:]


def test_types_are_written_from_the_document_of_the_service(web: Path, tmp_path: Path) -> None:
    document = json.dumps(Api(Settings(), lambda **record: None).app.openapi())
    found = run(web, "node", "types.mjs", str(tmp_path), given=document)
    assert found.returncode == 0, found.stderr[-2000:]
    for name in ("types.ts", "fields.ts"):
        written, committed = ((folder / name).read_text() for folder in (tmp_path, WEB / "src" / "api"))
        assert written == committed, f"the service has changed {name}: run `make types`"


def test_rebuild_has_the_bytes_of_the_bundle(web: Path, tmp_path: Path) -> None:
    found = run(web, "node", "build.mjs", str(tmp_path / "page"))
    assert found.returncode == 0, found.stderr[-2000:]
    built = {
        file.relative_to(tmp_path / "page"): file for file in (tmp_path / "page").rglob("*") if file.is_file()
    }
    committed = {file.relative_to(PAGE): file for file in PAGE.rglob("*") if file.is_file()}
    assert built.keys() == committed.keys()
    assert [str(name) for name in built if built[name].read_bytes() != committed[name].read_bytes()] == []


def test_lock_file_names_no_host() -> None:
    listed = json.loads((WEB / "package-lock.json").read_text())["packages"]
    assert [name for name, row in listed.items() if "resolved" in row] == []
    assert all(row.get("integrity", "").startswith("sha512-") for name, row in listed.items() if name)
