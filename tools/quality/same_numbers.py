"""Do two states of the code give the same numbers? Compares results files, and forecasts of two installations.

python -m tools.quality.same_numbers results OLD NEW
python -m tools.quality.same_numbers forecasts OLD/bin/python NEW/bin/python

OLD and NEW of `results` are JSON files, such as `results.json` of `tripwatt evaluate`, or two checkouts, of
which every file of `docs/results` is compared. Every number has to agree to 1e-9 relative. Running times and versions are left aside;
texts may change. A renamed place counts under its new name (`RENAMED`), and a new place is listed. Exit code 1 when a number differs
or is missing.
"""

from __future__ import annotations

import json
import math
import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from tools.command import run

TOLERANCE: Final = 1e-9
ASIDE: Final = frozenset(
    {"fit_s", "predict_ms", "seconds", "python", "packages", "tripwatt", "version", "created"}
)
"""Keys of running times and versions."""

RENAMED: Final[tuple[tuple[str, str], ...]] = ()
"""Old place -> new place, as regular expressions: for example (r"/hvac_wh$", "/climate_wh")."""

LINKS: Final = [
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


class Comparison(NamedTuple):
    """How many numbers have the same place, their largest relative difference, what disagrees, and the new places."""

    compared: int
    largest: float
    wrong: list[str]
    new: list[str]


def renamed(place: str, table: tuple[tuple[str, str], ...] = RENAMED) -> str:
    """A place as it is called now."""
    for old, new in table:
        place = re.sub(old, new, place)
    return place


def compared(old: Any, new: Any, table: tuple[tuple[str, str], ...] = RENAMED) -> Comparison:
    """All numbers of two documents."""
    before = {renamed(place, table): value for place, value in numbers(old)}
    after = dict(numbers(new))
    wrong = [f"missing: {place}" for place in before.keys() - after.keys()]
    largest = 0.0
    for place in before.keys() & after.keys():
        a, b = before[place], after[place]
        if a == b or (math.isnan(a) and math.isnan(b)):
            continue
        off = abs(a - b) / max(abs(a), abs(b))
        largest = max(largest, off)
        if not off <= TOLERANCE:
            wrong.append(f"{place}: {a!r} and {b!r}")
    same = len(before.keys() & after.keys())
    return Comparison(same, largest, sorted(wrong), sorted(after.keys() - before.keys()))


def results(path: Path) -> Any:
    """A results file, or all published ones of a checkout."""
    files = {"": path} if path.is_file() else {f.name: f for f in (path / "docs" / "results").glob("*.json")}
    return {
        name: json.loads(file.read_text("utf-8")) for name, file in files.items() if name != "stamps.json"
    }


def forecasts(python: Path) -> dict[str, Any]:
    """What an installation's command line forecasts with the model of the package."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)

        def said(*arguments: str) -> str:
            command = [str(python.absolute()), "-m", "tripwatt.command", *arguments]
            return subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder).stdout

        (folder / "links.json").write_text(json.dumps(LINKS), "utf-8")
        answers = {}
        for trip in ("TripA05", "TripB03", "TripB37"):
            said("example-trip", "--trip", trip, "--out", f"{trip}.csv")
            lines = (folder / f"{trip}.csv").read_text("utf-8").splitlines(keepends=True)
            (folder / "so-far.csv").write_text("".join(lines[:401]), "utf-8")
            departure, update = (
                ("--soc", "0.8", "--ambient", "-5", "--payload", "90"),
                ("--observed", "so-far.csv"),
            )
            for name, arguments in {
                "as logged": (),
                "departure": departure,
                "update": update,
                "update, departure": (*departure, *update),
            }.items():
                answers[f"{trip}, {name}"] = said("forecast", f"{trip}.csv", *arguments, "--json")
        answers["links"] = said(
            *("forecast", "links.json", "--soc", "0.7", "--ambient", "3", "--setpoint", "21", "--json")
        )
        answers["export"] = said("export", "here", "--ambient", "-5")
    return {name: json.loads(answer) for name, answer in answers.items()}


def main(what: Literal["results", "forecasts"], old: Path, new: Path) -> int:
    """Compare two results files or checkouts, or two Pythons with tripwatt; 1 when a number differs or is missing."""
    read = results if what == "results" else forecasts
    comparison = compared(read(old), read(new))
    for place in comparison.wrong[:40]:
        print(place)
    for place in comparison.new:
        print(f"new: {place}")
    print(
        f"{comparison.compared} numbers compared, {len(comparison.wrong)} differ by more than {TOLERANCE:g} or are missing, "
        f"{len(comparison.new)} are new; largest relative difference {comparison.largest:.2g}"
    )
    return int(bool(comparison.wrong) or not comparison.compared)


if __name__ == "__main__":
    run(main)
