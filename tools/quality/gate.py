"""The gate in one command, with what each part costs: ``python -m tools.quality.gate [PART ...]``; ``make check`` runs it.

Parts are run in their order, the tests only if no part before them failed, so that one run names all that the quick parts find. The seconds of each on the clock and of the processor are printed, those of the tests of each
room before the last line of pytest, which ends the output. The environment variable TEST_WORKERS is the number of processes that test.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated, Final

from typer import Argument, BadParameter

from tools import ROOT, command

PARTS: Final = {
    "format": "ruff format --check .",
    "lint": "ruff check .",
    "imports": "lint-imports",
    "types": "mypy",
    "tests": "python -m pytest -n {workers} --dist loadscope --no-loadscope-reorder -p tools.quality.durations",
}
"""In this order: what is quick comes first, and types before tests, one of which checks the types of a script with the same cache."""
TIMES: Final = ROOT / "out" / "test-times.json"


def used() -> float:
    """Seconds of the processor that finished processes took."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def run(part: str) -> tuple[int, float, float]:
    """Run one part; gives its exit code, and its seconds on the clock and of the processor."""
    program, *words = PARTS[part].format(workers=os.environ.get("TEST_WORKERS", "3")).split()
    print(f"{part}: {program} {' '.join(words)}", flush=True)
    TIMES.parent.mkdir(exist_ok=True)
    began, before = time.perf_counter(), used()
    done = subprocess.run(
        [Path(sys.executable).parent / program, *words],
        cwd=ROOT,
        # a process that keeps nothing of what it compiles takes twice as long to start
        env={k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        | {"TRIPWATT_TEST_TIMES": f"{TIMES}"},
        check=False,
    )
    return done.returncode, time.perf_counter() - began, used() - before


def main(parts: Annotated[list[str] | None, Argument(help="By default all.")] = None) -> int:
    """Run the gate, or some of its parts."""
    if unknown := set(parts or ()) - set(PARTS):
        raise BadParameter(f"{', '.join(sorted(unknown))}: none of {', '.join(PARTS)}")
    first_code, failed = 0, list[str]()
    for part in parts or PARTS:
        if part == "tests" and failed:
            print(f"tests: not run, because of {', '.join(failed)}", flush=True)
            continue
        code, seconds, spent = run(part)
        first_code, failed = first_code or code, failed + [part] * bool(code)
        if part != "tests":
            print(
                f"{part}: {seconds:.1f} s, {spent:.1f} s of the processor{', failed' if code else ''}",
                flush=True,
            )
    return first_code


if __name__ == "__main__":
    command.run(main)
