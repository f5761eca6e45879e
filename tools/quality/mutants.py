"""Do the tests notice a wrong line? Seeded mutants of the package, each against the tests that run its line.

python -m tools.quality.mutants [--count 200] [--seed 0] [--since REVISION] [--named]

The tests run once with coverage, which tells which tests run which line, and how long each takes; ``--map FILE`` keeps
that and uses it again. Each mutant is planted in a copy of the project, and its tests run, the quickest files first,
up to ``--budget`` seconds; for a constant of a module, those that name it before all others. Tests of the page and of the project's own files take no part. A mutant that all of them
pass survives; it is printed with its file, line and change. ``--since`` takes the lines that differ from a revision;
``--named`` plants those of named_mutants.toml. Survivors that change nothing are listed, with the reason, in
equivalent_mutants.toml. ``--kinds statement,branch,slice`` takes mutants of these kinds alone. ``--near`` needs no map: the tests of the
file that mirrors the mutant's run, then those of its room. Exit code 1 when fewer than 90 % of the others are killed. Needs the extra `bench`.

mutmut changes no constants of a module and draws no seeded sample; Cosmic Ray runs one command for every mutant, here a gate of ten minutes.

Costs one run of the tests with coverage (about twice its usual time), then 5 to 40 s for each mutant on one core.
"""

from __future__ import annotations

import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated, Final

from typer import Option

from tools import ROOT
from tools.command import run
from tools.quality.mutating import Mutant, mutants_of

HERE: Final = Path(__file__).parent

ROOMS: Final = (
    "server/cars",
    "roads/journey",
    "forecasting",
    "uncertainty",
    "study/evaluation",
    "hybrid",
    "population",
    "routes",
    "physics",
    "auditing",
    "server/http",
)
NO_MUTANTS: Final = ("plots.py", "example_requests.py")
"""Sizes and places in figures, which people judge by looking, and numbers of examples, which are free."""
MIN_SHARE: Final = 0.9
NO_PART: Final = (
    "tests/server/page",
    "tests/project",
    "tests/study/report",
    "tests/command",
    "gamm",
)
"""Tests of the browser, of the project's files, of words and figures, and of rooms that no mutant is planted in."""
NEAR_S: Final = 60.0
"""Usual time of the tests of a room."""
PATIENCE_S: Final = 120.0
"""A mutant that takes this much longer than its tests does not end."""


@dataclass(frozen=True, slots=True)
class TestMap:
    """Which tests run which line, and how long they take.

    Attributes
    ----------
    by_line : mapping of str to mapping of int to set of str
        File below the root -> line -> tests; a test's set-up is under its file.
    seconds : mapping of str to (float, float)
        Test -> seconds of its set-up, and of itself.
    """

    by_line: Mapping[str, Mapping[int, frozenset[str]]]
    seconds: Mapping[str, tuple[float, float]]

    def of_lines(self, path: str, lines: Iterable[int]) -> set[str]:
        """Tests that run one of the lines of a file."""
        rows = self.by_line.get(path, {})
        return {test for line in lines for test in rows.get(line, ())}


def measure_map(project: Path, kept: Path, jobs: int) -> None:
    """Run the tests with coverage in a copy of the project, and keep lines and times in a file."""
    from coverage import CoverageData

    with tempfile.TemporaryDirectory() as folder:
        data, times = Path(folder) / "coverage", Path(folder) / "times.json"
        command = [sys.executable, "-m", "pytest", "-n", str(jobs), "-p", "tools.quality.durations"]
        command += ["--cov=src/tripwatt", "--cov-context=test", "--cov-report="]
        command += [f"--ignore={name}" for name in NO_PART]
        env = _environment(project) | {"COVERAGE_FILE": str(data), "TRIPWATT_TEST_TIMES": str(times)}
        subprocess.run(command, cwd=project, env=env, check=False)
        coverage = CoverageData(str(data))
        coverage.read()
        lines = {
            Path(name).relative_to(project).as_posix(): {
                line: sorted(context for context in contexts if context)
                for line, contexts in coverage.contexts_by_lineno(name).items()
            }
            for name in coverage.measured_files()
        }
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps({"lines": lines, "seconds": json.loads(times.read_text())}))


def read_map(kept: Path) -> TestMap:
    """The map of a file. Who depends on a fixture of a module is every test of its file."""
    document = json.loads(kept.read_text())
    seconds = {test: (times[0], times[1]) for test, times in document["seconds"].items()}
    by_file = defaultdict(set)
    for test in seconds:
        by_file[test.split("::")[0]].add(test)
    seen: dict[str, frozenset[str]] = {}

    def tests(contexts: Sequence[str]) -> frozenset[str]:
        chosen: set[str] = set()
        for context in contexts:
            test, _, phase = context.rpartition("|")
            if context not in seen:
                wide = by_file[test.split("::")[0]] if phase == "setup" else {test}
                seen[context] = frozenset(wide & seconds.keys())
            chosen |= seen[context]
        return frozenset(chosen)

    by_line = {
        path: {int(line): tests(contexts) for line, contexts in rows.items()}
        for path, rows in document["lines"].items()
    }
    return TestMap(by_line, seconds)


def tests_for(mutant: Mutant, test_map: TestMap, uses: Mapping[str, Mapping[str, Sequence[int]]]) -> set[str]:
    """Tests that run the mutant: its statement, else its function, else functions that use the name it assigns.

    What runs in processes of its own alone, such as the service, is left to the tests of its room.
    """
    path = mutant.path.relative_to(ROOT).as_posix()
    tests: set[str] = set()
    if mutant.function is not None:
        start, end = mutant.function
        if start <= mutant.first:
            tests = test_map.of_lines(path, range(mutant.first, mutant.last + 1))
        tests = tests or test_map.of_lines(path, range(start, end + 1))
    else:
        for name in mutant.names:
            for other, lines in uses.get(name, {}).items():
                tests |= test_map.of_lines(other, lines)
        tests = tests or test_map.of_lines(path, test_map.by_line.get(path, {}))
    room = mutant.path.relative_to(ROOT / "src" / "tripwatt").parent.as_posix()
    return tests or {test for test in test_map.seconds if test.startswith(f"tests/{room}/")}


def uses_of_names(package: Path) -> dict[str, dict[str, list[int]]]:
    """Name -> file -> lines inside of functions where it is read."""
    uses: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(list))
    for path in package.rglob("*.py"):
        place = path.relative_to(ROOT).as_posix()
        for function in ast.walk(ast.parse(path.read_bytes())):
            if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                continue
            for node in ast.walk(function):
                if isinstance(node, ast.Name):
                    uses[node.id][place].append(node.lineno)
                elif isinstance(node, ast.Attribute):
                    uses[node.attr][place].append(node.lineno)
    return uses


def tests_naming(mutant: Mutant, test_map: TestMap, texts: Mapping[str, str]) -> set[str]:
    """Tests of files that name the constant of a module that a mutant changes."""
    if mutant.function is not None or not mutant.names:
        return set()
    word = re.compile(rf"\b({'|'.join(map(re.escape, mutant.names))})\b")
    files = {name for name, text in texts.items() if word.search(text)}
    return {test for test in test_map.seconds if test.split("::")[0] in files}


def order_tests(tests: Iterable[str], test_map: TestMap, budget_s: float) -> tuple[list[str], float]:
    """Tests grouped by file, quick files first, up to a sum of seconds; and that sum."""
    by_file: dict[str, list[str]] = defaultdict(list)
    for test in tests:
        by_file[test.split("::")[0]].append(test)
    set_up = {
        name: max(test_map.seconds[t][0] for t in tests_of_file) for name, tests_of_file in by_file.items()
    }
    chosen: list[str] = []
    spent = 0.0
    for name, tests_of_file in sorted(
        by_file.items(), key=lambda item: set_up[item[0]] + _quickest(item[1], test_map)
    ):
        fits = spent + set_up[name] + _quickest(tests_of_file, test_map) <= budget_s
        if chosen and not fits:
            continue
        spent += set_up[name]
        for test in sorted(tests_of_file, key=lambda t: test_map.seconds[t][1]):
            if not chosen or spent + test_map.seconds[test][1] <= budget_s:
                chosen.append(test)
                spent += test_map.seconds[test][1]
    return chosen, spent


def _quickest(tests: Sequence[str], test_map: TestMap) -> float:
    return min(test_map.seconds[test][1] for test in tests)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the tests made of a mutant: killed or not, by how many tests that ran it."""

    mutant: Mutant
    killed: bool
    tests: int


def judge(mutant: Mutant, project: Path, tests: Sequence[str], expected_s: float) -> Verdict:
    """Plant a mutant in a copy of the project and run its tests."""
    if not tests:
        return Verdict(mutant, False, 0)
    path = project / mutant.path.relative_to(ROOT)
    sound = path.read_bytes()
    path.write_bytes(mutant.applied(sound))
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command,
            cwd=project,
            env=_environment(project),
            capture_output=True,
            timeout=3.0 * expected_s + PATIENCE_S,
            check=False,
        )
        killed = done.returncode != 0
    except subprocess.TimeoutExpired:
        killed = True
    finally:
        path.write_bytes(sound)
    return Verdict(mutant, killed, len(tests))


def judge_all(
    mutants: Sequence[Mutant], test_map: TestMap, projects: Sequence[Path], budget_s: float
) -> list[Verdict]:
    """Every mutant, as many at a time as there are copies of the project."""
    uses = uses_of_names(ROOT / "src" / "tripwatt")
    texts = {
        path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in (ROOT / "tests").rglob("*.py")
    }
    free: SimpleQueue[Path] = SimpleQueue()
    for project in projects:
        free.put(project)

    def one(mutant: Mutant) -> Verdict:
        likely, likely_s = order_tests(tests_naming(mutant, test_map, texts), test_map, budget_s)
        other_tests, other_s = order_tests(
            tests_for(mutant, test_map, uses) - set(likely), test_map, budget_s - likely_s
        )
        tests, expected_s = [*likely, *other_tests], likely_s + other_s
        project = free.get()
        try:
            verdict = judge(mutant, project, tests, expected_s)
        finally:
            free.put(project)
        word = "killed  " if verdict.killed else "SURVIVED"
        print(f"{word} {_where(mutant)}  {mutant.kind}  {mutant.change}  [{verdict.tests} tests]", flush=True)
        return verdict

    with ThreadPoolExecutor(len(projects)) as pool:
        return list(pool.map(one, mutants))


def copy_of_project(folder: Path) -> Path:
    """The files of the project, those of git and new ones, in a folder."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    for name in listed:
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, folder / name)
    return folder


def near_tests(mutant: Mutant, project: Path) -> list[list[str]]:
    """Tests of the file that mirrors the mutant's, then those of its room."""
    inside = mutant.path.relative_to(ROOT / "src" / "tripwatt")
    room = Path("tests") / inside.parent
    mirror = room / f"test_{inside.name}"
    return [[str(place)] for place in (mirror, room) if (project / place).exists()]


def judge_near(mutants: Sequence[Mutant], project: Path) -> list[Verdict]:
    """Every mutant against the tests near it."""
    verdicts = []
    for mutant in mutants:
        killed = any(judge(mutant, project, tests, NEAR_S).killed for tests in near_tests(mutant, project))
        verdicts.append(Verdict(mutant, killed, 0))
        print(
            f"{'killed  ' if killed else 'SURVIVED'} {_where(mutant)}  {mutant.kind}  {mutant.change}",
            flush=True,
        )
    return verdicts


def chosen_mutants(count: int, seed: int, since: str | None, kinds: Sequence[str] = ()) -> list[Mutant]:
    """Random mutants of the rooms, of all lines or of those that differ from a revision."""
    package = ROOT / "src" / "tripwatt"
    if since is None:
        files = [
            p for room in ROOMS for p in sorted((package / room).rglob("*.py")) if p.name not in NO_MUTANTS
        ]
        every = [m for path in files for m in mutants_of(path)]
    else:
        changed = _changed_lines(since)
        every = [
            m
            for name, lines in sorted(changed.items())
            for m in mutants_of(ROOT / name)
            if lines & set(range(m.first, m.last + 1))
        ]
    every = [mutant for mutant in every if not kinds or mutant.kind in kinds]
    print(f"{len(every)} mutants", flush=True)
    return random.Random(seed).sample(every, min(count, len(every)))


def _changed_lines(since: str) -> dict[str, set[int]]:
    """Lines of the package's files that a revision does not have."""
    text = subprocess.run(
        ["git", "diff", "--unified=0", "--no-color", since, "--", "src/tripwatt/*.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    changed: dict[str, set[int]] = defaultdict(set)
    name = ""
    for row in text.splitlines():
        if row.startswith("+++ b/"):
            name = row.removeprefix("+++ b/")
        elif row.startswith("@@"):
            start, _, count = row.split("+")[1].split(" ")[0].partition(",")
            changed[name].update(range(int(start), int(start) + int(count or 1)))
    return {name: lines for name, lines in changed.items() if lines}


def named_mutants() -> list[Mutant]:
    """Those of named_mutants.toml."""
    mutants = []
    for entry in tomllib.loads((HERE / "named_mutants.toml").read_text())["mutant"]:
        path = ROOT / entry["file"]
        source = path.read_bytes()
        old = entry["old"].encode()
        if source.count(old) != 1:
            raise SystemExit(f"{entry['file']} has {source.count(old)} places with {entry['old']!r}")
        start = source.index(old)
        line = source[:start].count(b"\n") + 1
        same = [m for m in mutants_of(path) if m.first <= line <= m.last]
        place = (
            (same[0].first, same[0].last, same[0].function, same[0].names) if same else (line, line, None, ())
        )
        mutants.append(
            Mutant(path, line, "named", entry["old"], entry["new"], start, start + len(old), *place)
        )
    return mutants


def equivalent() -> dict[tuple[str, str], str]:
    """Reasons why a change is none, by file and change."""
    path = HERE / "equivalent_mutants.toml"
    entries = tomllib.loads(path.read_text()).get("mutant", []) if path.exists() else []
    return {(entry["file"], entry["change"]): entry["reason"] for entry in entries}


def _where(mutant: Mutant) -> str:
    return f"{mutant.path.relative_to(ROOT).as_posix()}:{mutant.line}"


def _environment(project: Path) -> dict[str, str]:
    shared = ROOT.parent / "shared"
    return os.environ | {
        "PYTHONPATH": os.pathsep.join((str(project / "src"), str(project / "gamm" / "src"))),
        "TRIPWATT_DATA": os.environ.get("TRIPWATT_DATA", str(shared / "data")),
        "TRIPWATT_REFERENCE": os.environ.get("TRIPWATT_REFERENCE", str(shared / "reference")),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def report(verdicts: Sequence[Verdict]) -> int:
    """Print the survivors and the share that was killed."""
    reasons = equivalent()
    alive = [v for v in verdicts if not v.killed]
    print()
    equal = 0
    for verdict in alive:
        mutant = verdict.mutant
        reason = reasons.get((mutant.path.relative_to(ROOT).as_posix(), mutant.change))
        equal += reason is not None
        why = f"  equivalent: {reason}" if reason else ""
        print(f"survived: {_where(mutant)}  {mutant.change}{why}")
    killed, counted = len(verdicts) - len(alive), len(verdicts) - equal
    if not counted:
        print("no mutants")
        return 0
    print(f"{killed} of {counted} killed ({killed / counted:.1%}), {equal} more change nothing")
    return int(killed < MIN_SHARE * counted)


def main(
    count: int = 200,
    seed: int = 0,
    since: str | None = None,
    named: bool = False,
    jobs: int = os.cpu_count() or 1,
    budget: float = 40.0,
    map_file: Annotated[Path | None, Option("--map")] = None,
    kinds: str = "",
    near: bool = False,
) -> int:
    """Plant mutants and print the survivors; 1 when too many survive."""
    chosen = [kind for kind in kinds.split(",") if kind]
    mutants = named_mutants() if named else chosen_mutants(count, seed, since, chosen)
    with tempfile.TemporaryDirectory() as folder:
        if near:
            return report(judge_near(mutants, copy_of_project(Path(folder))))
        projects = [copy_of_project(Path(folder) / str(k)) for k in range(jobs)]
        kept = map_file or Path(folder) / "map.json"
        if not kept.exists():
            measure_map(projects[0], kept, jobs)
        return report(judge_all(mutants, read_map(kept), projects, budget))


if __name__ == "__main__":
    run(main)
