"""Types as a user's checker sees them: a script with every name of the door passes, a misspelt name does not."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from tests.support import ROOT

import tripwatt as tw

SCRIPT = ROOT / "tests" / "project" / "user_script.py"
LONGEST_S = 400
MISSPELT = [f"tw.{name}{name[-1]}" for name in tw.__all__] + [
    "tw.load_model().forcast",
    "tw.Departure(soc=0.8, ambient=5.0)",
    "tw.forecast(b'').energy_kwh",
    "tw.simulate(tw.read_route(b''), 'vw_id3').energy_by_cause_wh",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The script, and beside it one with a fault in every line after the first."""
    folder = tmp_path_factory.mktemp("user")
    shutil.copy(SCRIPT, folder / "user_script.py")
    (folder / "misspelt.py").write_text("\n".join(["import tripwatt as tw", *MISSPELT, ""]))
    (folder / "pyrightconfig.json").write_text(
        json.dumps({"typeCheckingMode": "strict", "extraPaths": [str(ROOT / "src")]})
    )
    return folder


def run(*command: str) -> str:
    """What a checker prints; it ends with 1 where there are faults."""
    environment = {**os.environ, "MYPY_FORCE_COLOR": "0", "NO_COLOR": "1"}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LONGEST_S, check=False
    )
    assert done.returncode in (0, 1), done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def test_the_script_uses_every_name_of_the_door() -> None:
    used = {
        node.attr
        for node in ast.walk(ast.parse(SCRIPT.read_text("utf-8")))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "tw"
    }
    assert used == set(tw.__all__)


@pytest.mark.skipif(find_spec("mypy") is None, reason="no mypy: the extra `dev` has it")
def test_mypy_passes_the_script_and_refuses_each_misspelt_name(folder: Path) -> None:
    files = [str(folder / name) for name in ("user_script.py", "misspelt.py")]
    printed = run(sys.executable, "-m", "mypy", "--strict", "--no-error-summary", *files)
    faults = re.findall(r"^.*?(\w+\.py):(\d+): error", printed, re.MULTILINE)
    assert {name for name, _ in faults} == {"misspelt.py"}, printed
    assert {int(line) for _, line in faults} == set(range(2, len(MISSPELT) + 2)), printed


def test_pyright_passes_the_script_and_refuses_each_misspelt_name(web: Path, folder: Path) -> None:
    options = ("--project", str(folder), "--pythonpath", sys.executable, "--outputjson")
    found = json.loads(run("node", str(web / "node_modules" / "pyright" / "index.js"), *options))[
        "generalDiagnostics"
    ]
    faults = [
        (Path(fault["file"]).name, fault["range"]["start"]["line"] + 1)
        for fault in found
        if fault["severity"] == "error" and fault["rule"] != "reportUnusedExpression"
    ]
    assert {name for name, _ in faults} == {"misspelt.py"}, found
    assert {line for _, line in faults} == set(range(2, len(MISSPELT) + 2)), found
