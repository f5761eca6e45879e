"""The gate in one command, with what each part costs: ``python -m tools.quality.gate [PART ...]``; ``make check`` runs it.

Parts are run in their order until one fails. The seconds on the clock and of the processor are printed at the end, and those of the tests
of each room. The environment variable TEST_WORKERS is the number of processes that test.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
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
        env={**os.environ, "TRIPWATT_TEST_TIMES": f"{TIMES}"},
        check=False,
    )
    return done.returncode, time.perf_counter() - began, used() - before


def by_room(times: Path) -> Iterator[tuple[str, int, float]]:
    """Room, number and seconds of its tests, the longest first; doctests belong to the file that they are in.

    Examples
    --------
    >>> import tempfile
    >>> times = Path(tempfile.mkdtemp()) / "times.json"
    >>> _ = times.write_text('{"tests/roads/test_a.py::b": [0.5, 1.0], "tests/roads/maps/test_c.py::d": [0, 2]}')
    >>> list(by_room(times))
    [('tests/roads', 2, 3.5)]
    """
    seconds, number = Counter[str](), Counter[str]()
    for name, spent in json.loads(times.read_text("utf-8")).items():
        room = "/".join(Path(name.partition("::")[0]).parts[:2])
        seconds[room] += sum(spent)
        number[room] += 1
    for room, spent in seconds.most_common():
        yield room, number[room], spent


def main(parts: Annotated[list[str] | None, Argument(help="By default all.")] = None) -> int:
    """Run the gate, or some of its parts."""
    if unknown := set(parts or ()) - set(PARTS):
        raise BadParameter(f"{', '.join(sorted(unknown))}: none of {', '.join(PARTS)}")
    code, lines = 0, [f"{'part':24} {'tests':>6} {'seconds':>8} {'of the processor':>17}"]
    for part in parts or PARTS:
        TIMES.unlink(missing_ok=True)
        code, seconds, spent = run(part)
        lines.append(f"{part:24} {'':6} {seconds:8.1f} {spent:17.1f}")
        if TIMES.is_file():
            lines += [f"  {room:22} {n:6} {each:8.1f}" for room, n, each in by_room(TIMES)]
        if code:
            lines.append(f"{part} failed")
            break
    print("\n".join(lines))
    return code


if __name__ == "__main__":
    command.run(main)
