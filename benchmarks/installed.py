"""What an installation takes and what works in it: `python -m benchmarks.installed [--tests]`.

Each distribution is installed by pip without extras into an environment of its own, and does there what it is for. With `--tests` the
tests of a part run with only its own extra and pytest installed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final

from tools import ROOT
from tools.command import run
from tools.release import TIMED
from typer import Option

from benchmarks.measure import Row, report

MAX_MB: Final = 330
MAX_IMPORT_S: Final = 0.15

CORE: Final = """
import subprocess, sys
import tripwatt as tw

command = [sys.executable, "-m", "tripwatt", "example-trip", "--out", "trip.csv"]
subprocess.run(command, check=True, capture_output=True)
(trip,) = tw.read_trips("trip.csv", "table", vehicle="bmw_i3_60ah")
model = tw.load_model("bmw_i3_tum")
adapted = tw.adapt(model, tw.sample_trips("ved").trips[:3], "nissan_leaf_24")
for each in (model, adapted):
    assert 1000 < each.forecast(trip).energy_wh < 6000
try:
    model.forecast(trip).plot()
except tw.InvalidInput as error:
    assert "[figures]" in str(error)
"""
"""Reads a log, forecasts its trip, adapts a model to another car; a picture says what installs it."""

GAMM: Final = f"""
import doctest, os

os.chdir({str(ROOT / "gamm")!r})
result = doctest.testfile({str(ROOT / "gamm" / "README.md")!r}, module_relative=False)
assert (result.failed, result.attempted > 6) == (0, True)
"""

TESTS: Final = {
    "core": (
        ".",
        "tests/auditing tests/certification tests/command tests/forecasting tests/hybrid tests/learners tests/physics tests/population "
        "tests/routes tests/sources tests/trips tests/uncertainty tests/vehicles",
    ),
    "roads": (".[routing]", "tests/roads"),
    "server": (".[service,live] httpx", "tests/server/http tests/server/cars"),
    "fleet": (".[fleet]", "tests/fleet"),
    "study": ("gamm .[study]", "tests/study"),
    "gamm": ("gamm[test]", "gamm/tests"),
}
"""Part -> what is installed for its tests beside hypothesis and pytest, and where they are."""


ENVIRONMENT: Final = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
"""In which only what is installed is found."""


def environment(folder: Path, *packages: str) -> Path:
    """A new environment with packages, without bytecode as uv leaves them; gives its Python."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", f"{folder}"], check=True)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", f"{python}", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--no-compile", *packages], check=True)
    return python


def size_mb(folder: Path) -> float:
    """Space on the disk [MB of 1024 KiB], as du counts it."""
    return sum(file.lstat().st_blocks * 512 for file in folder.rglob("*")) / 2**20


def works(python: Path, code: str, folder: Path) -> str:
    """Why a script fails in an environment; empty where it does not."""
    done = subprocess.run(
        [python, "-c", code], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    return done.stderr[-400:] if done.returncode else ""


def installed(name: str, source: Path, code: str, folder: Path) -> Iterator[Row]:
    """Size of an installation, and whether it does what it is for."""
    python = environment(folder / name, f"{source}")
    (packages,) = (folder / name / "lib").glob("python*/site-packages")
    size = size_mb(packages)
    subprocess.run([python, "-m", "compileall", "-q", packages], check=False, capture_output=True)
    note = f"{size_mb(packages):.0f} MB with the bytecode of every module"
    yield Row(f"{name} without extras", size, "MB", most=MAX_MB, note=note)
    fault = works(python, code, folder)
    yield Row(f"{name} does not work", float(bool(fault)), most=0, note=fault)


def tested(part: str, folder: Path) -> Row:
    """Whether the tests of a part fail with only its own packages; those that need others are skipped, with their names."""
    packages, selection = (text.split() for text in TESTS[part])
    ours = [f"{ROOT}/{name}" if name.startswith((".", "gamm")) else name for name in packages]
    python = environment(folder / f"tests of {part}", *ours, "hypothesis", "pytest")
    command = [
        f"{python}",
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        "-p",
        "tests.support.parts",
        *selection,
    ]
    done = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    note = done.stdout.strip().rpartition("\n")[2]
    return Row(f"tests of {part} with its own packages fail", float(done.returncode), most=0, note=note)


def rows(tests: bool = False) -> Iterator[Row]:
    """All figures; the tests of the parts on request."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        yield from installed("tripwatt", ROOT, CORE, folder)
        command = [f"{folder / 'tripwatt' / 'bin' / 'python'}", "-c", TIMED]
        timed = subprocess.run(command, env=ENVIRONMENT, check=True, capture_output=True, text=True)
        yield Row("import tripwatt, best of 5", float(timed.stdout), "s", most=MAX_IMPORT_S)
        yield from installed("tripwatt-gamm", ROOT / "gamm", GAMM, folder)
        for part in TESTS if tests else ():
            yield tested(part, folder)


def main(tests: Annotated[bool, Option(help="Run the tests of parts as well.")] = False) -> int:
    """Print the figures; 1 where a bound is missed."""
    return report(rows(tests))


if __name__ == "__main__":
    run(main)
