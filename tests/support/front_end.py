"""The front end's sources with their packages of Node, where Node is installed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from tests.support import ROOT

WEB = ROOT / "web"
MIN_NODE = 20
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


def with_packages(place: Path) -> Path:
    """The sources with their packages and what is written for them: as they are, or in a copy at a place."""
    version = node_version()
    if version is None or version < MIN_NODE:
        pytest.skip(f"needs Node {MIN_NODE} or newer with npm, found {version}")
    if is_installed():
        return with_inputs(WEB)
    if not (place / "web" / "generated" / "fields.ts").is_file():
        install(place)
        with_inputs(place / "web")
    return place / "web"


def install(place: Path) -> None:
    """Copy the sources to a place, with their packages."""
    shutil.copytree(ROOT / "tests" / "vectors", place / "tests" / "vectors", dirs_exist_ok=True)
    ignored = shutil.ignore_patterns("node_modules", "generated")
    shutil.copytree(WEB, place / "web", ignore=ignored, dirs_exist_ok=True)
    cache = f"--cache={place / 'npm-cache'}"
    found = run(place / "web", "npm", "ci", "--no-audit", "--prefer-offline", cache)
    if found.returncode != 0:
        pytest.skip(f"npm ci failed, is there a network? {found.stderr.strip()[-300:]}")


def with_inputs(web: Path) -> Path:
    """The sources, after the modules that come from the package are written, as `make types` does."""
    # here, because every run of pytest reads this module, and the server takes three seconds to import
    from tools.docs import write_page_flags

    from tripwatt.server.http.app import openapi_document

    write_page_flags.write(web / "generated")
    document = json.dumps(openapi_document())
    run(web, "node", "types.mjs", given=document).check_returncode()
    return web
