"""Do two states of the code give the same numbers? Compares results files, and forecasts of two installations.

python -m benchmarks.same_numbers results OLD/results.json NEW/results.json
python -m benchmarks.same_numbers forecasts OLD/bin/python NEW/bin/python

Every number has to agree to 1e-9 relative. Running times and versions are left aside; texts may change. Exit code 1
when a number differs, is missing, or is new.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

TOLERANCE = 1e-9
ASIDE = frozenset({"fit_s", "predict_ms", "seconds", "python", "packages", "tripwatt", "version", "created"})
"""Keys of running times and versions."""

LINKS = [
    {"length_m": 400.0, "speed_m_s": 8.0, "stop_s": 12.0},
    {"length_m": 2500.0, "speed_m_s": 16.0, "grade": 0.02},
    {"length_m": 9000.0, "speed_m_s": 27.0, "speed_limit_m_s": 33.4},
    {"length_m": 700.0, "travel_time_s": 90.0, "grade": -0.03},
]


def numbers(document: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a document with its place."""
    if isinstance(document, dict):
        for key, value in document.items():
            if key not in ASIDE:
                yield from numbers(value, f"{path}/{key}")
    elif isinstance(document, list):
        for index, value in enumerate(document):
            yield from numbers(value, f"{path}/{index}")
    elif isinstance(document, int | float) and not isinstance(document, bool):
        yield path, float(document)


def differences(old: Any, new: Any) -> tuple[int, float, list[str]]:
    """How many numbers agree in place, the largest relative difference, and each place that disagrees."""
    before, after = dict(numbers(old)), dict(numbers(new))
    wrong = [f"missing: {place}" for place in before.keys() - after.keys()]
    wrong += [f"new: {place}" for place in after.keys() - before.keys()]
    largest = 0.0
    for place in before.keys() & after.keys():
        a, b = before[place], after[place]
        if a == b or (math.isnan(a) and math.isnan(b)):
            continue
        off = abs(a - b) / max(abs(a), abs(b))
        largest = max(largest, off)
        if not off <= TOLERANCE:
            wrong.append(f"{place}: {a!r} and {b!r}")
    return len(before.keys() & after.keys()), largest, sorted(wrong)


def forecasts(python: str, folder: Path) -> dict[str, Any]:
    """What an installation's command line forecasts with the model of the package."""

    def run(*arguments: str) -> str:
        command = [python, "-m", "tripwatt.cli", *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder).stdout

    (folder / "links.json").write_text(json.dumps(LINKS), "utf-8")
    found = {}
    for seed in ("0", "1", "2"):
        run("example-trip", "--seed", seed, "--out", f"trip{seed}.csv")
        lines = (folder / f"trip{seed}.csv").read_text("utf-8").splitlines(keepends=True)
        (folder / "so-far.csv").write_text("".join(lines[:401]), "utf-8")
        known = ("--soc", "0.8", "--ambient", "-5", "--payload", "90")
        for name, arguments in {
            "as logged": (),
            "departure": known,
            "update": ("--observed", "so-far.csv"),
            "update, departure": (*known, "--observed", "so-far.csv"),
        }.items():
            found[f"{seed}, {name}"] = json.loads(run("forecast", f"trip{seed}.csv", *arguments, "--json"))
    found["links"] = json.loads(
        run("forecast", "links.json", "--soc", "0.7", "--ambient", "3", "--setpoint", "21", "--json")
    )
    found["export"] = json.loads(run("export", "here", "--ambient", "-5"))
    for answer in found.values():  # flags are objects now and sentences before: their number is compared
        if "flags" in answer:
            answer["flags"] = len(answer["flags"])
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("results", "forecasts"))
    parser.add_argument("old", help="a results.json, or a Python with tripwatt")
    parser.add_argument("new")
    given = parser.parse_args(arguments)
    if given.what == "results":
        old, new = (json.loads(Path(p).read_text("utf-8")) for p in (given.old, given.new))
    else:
        with tempfile.TemporaryDirectory() as place:
            old, new = (forecasts(str(Path(p).absolute()), Path(place)) for p in (given.old, given.new))
    number, largest, wrong = differences(old, new)
    for place in wrong[:40]:
        print(place)
    print(
        f"{number} numbers compared, {len(wrong)} differ by more than {TOLERANCE:g}; "
        f"largest relative difference {largest:.2g}"
    )
    return 1 if wrong or not number else 0


if __name__ == "__main__":
    raise SystemExit(main())
