"""The project's own bars, each with its figure: `python -m benchmarks.bars [--results DIR] [--forecast DIR] [--links FILE]`.

Prints a table and ends with code 1 when a bar is missed. A bar whose data or extra is not at hand is listed as not
measured. Accuracy comes from the `results.json` of an evaluation of the TUM trips: one that is run here, or with
`--results` and `--forecast` one that was run before (its running time is then not measured); that of planned routes likewise from
`benchmarks.planned`, or with `--links` from its results.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from tools import CATALOGUE, DATA, REFERENCE, ROOT
from tools.command import run

from benchmarks import (
    absurd,
    accuracy,
    advice,
    anchors,
    argonne,
    batch,
    before,
    cars,
    clocks,
    coarse_speed,
    dirty_logs,
    edges,
    gam,
    half_known,
    hostile,
    installed,
    journeys,
    leave_with,
    live,
    own_way,
    physics_trips,
    pipeline,
    savings,
    service,
    six_numbers,
    speed_caps,
    steady,
    stops,
    stream,
    unknown_climb,
    ved_trips,
)
from benchmarks import forecast as forecast_speed
from benchmarks.measure import Row, not_measured


class Suite(NamedTuple):
    """Rows that are measured together: the command that does it, and the data that it needs."""

    command: str
    rows: Callable[[], Iterable[Row]]
    needs: tuple[Path, ...] = ()


def suites(results: Path | None, forecast: Path | None, links: Path | None) -> Iterator[Suite]:
    """All suites, with results of runs before where they are given."""
    tum, ved = DATA / "tum", DATA / "ved"
    evaluate, bench = "tripwatt evaluate DATA/tum --protocol", "python -m benchmarks."
    yield Suite(f"{evaluate} paper", partial(accuracy.paper, results), () if results else (tum,))
    yield Suite(f"{evaluate} forecast", partial(accuracy.forecast, forecast), () if forecast else (tum,))
    yield Suite(f"{bench}own_way", own_way.rows, (tum,))
    yield Suite(f"{bench}coverage", accuracy.synthetic_coverage)
    yield Suite(f"{bench}planned", partial(accuracy.planned_routes, links), () if links else (tum,))
    yield Suite(f"{bench}cars", cars.bounds, (tum, ved, DATA / "sedan", DATA / "twizy"))
    yield Suite(f"{bench}before", before.bounds, (tum, ved, DATA / "sedan", DATA / "twizy"))
    yield Suite(f"{bench}journeys", journeys.rows)
    yield Suite(f"{bench}stops", stops.rows)
    yield Suite(f"{bench}speed_caps", speed_caps.rows)
    yield Suite(f"{bench}live", live.rows, (tum,))
    yield Suite(f"{bench}clocks", clocks.rows, (tum,))
    yield Suite(f"{bench}half_known", half_known.rows, (tum,))
    yield Suite(f"{bench}coarse_speed", coarse_speed.rows, (tum,))
    yield Suite(f"{bench}dirty_logs", dirty_logs.rows)
    yield Suite(f"{bench}unknown_climb", unknown_climb.bounds, (tum,))
    yield Suite(f"{bench}steady", steady.bars)
    yield Suite(f"{bench}argonne", argonne.bars, (DATA / "cycles", REFERENCE / "anl_d3_i3.csv"))
    yield Suite(f"{bench}physics_trips", physics_trips.bars, (tum,))
    yield Suite(f"{bench}ved_trips", ved_trips.bars, (ved,))
    yield Suite(f"{bench}batch", batch.rows, (tum,))
    yield Suite("make bench", pipeline.run)
    yield Suite(f"OMP_NUM_THREADS=1 {bench}gam", gam.run, (REFERENCE / "mgcv",))
    yield Suite(f"{bench}forecast", forecast_speed.run)
    yield Suite(f"{bench}service", service.rows)
    yield Suite(f"{bench}stream", stream.rows)
    yield Suite(f"{bench}hostile", hostile.rows)
    yield Suite(f"{bench}installed --tests", partial(installed.rows, tests=True))
    yield Suite(f"{bench}leave_with", leave_with.rows)
    yield Suite(f"{bench}absurd", absurd.bars)
    yield Suite(f"{bench}advice", advice.rows)
    yield Suite(f"{bench}edges", edges.rows)
    yield Suite(f"{bench}anchors", anchors.bars)
    yield Suite(
        f"{bench}savings",
        savings.rows,
        (tum, ved, DATA / "sedan", DATA / "cycles", REFERENCE / "anl_d3_i3.csv"),
    )
    yield Suite(f"{bench}six_numbers", six_numbers.bars, (CATALOGUE / "wltp.csv",))
    for selection, every_car in TESTS.items():
        yield Suite(f"pytest {selection}", partial(tests, selection, every_car))


EVERY_CAR: Final = (
    "tests/vehicles tests/certification tests/forecasting/test_every_car.py tests/forecasting/test_possible.py "
    "tests/forecasting/test_storage.py tests/project/test_packaging.py"
)
TESTS: Final = {
    "gamm/tests": False,
    EVERY_CAR: True,
    "tests/server/cars/test_actors.py": True,
}
"""Tests that are bars -> whether they take every car of the library, or every run, of which the gate takes a sample."""


def tests(selection: str, every_car: bool) -> Iterator[Row]:
    """How many of some tests do not pass; of the GAMM's, those that are skipped count too."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *shlex.split(selection)],
        cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, **({"TRIPWATT_EVERY_CAR": "1"} if every_car else {})},
    )  # fmt: skip
    counts = {word: int(n) for n, word in re.findall(r"(\d+) (passed|failed|skipped|error)", done.stdout)}
    wrong = sum(n for word, n in counts.items() if word != "passed" and not (every_car and word == "skipped"))
    note = ", ".join(f"{n} {word}" for word, n in counts.items()) or f"code {done.returncode}"
    yield Row("tests that do not pass", max(wrong, int(done.returncode != 0)), most=0, note=note)


def measured(suite: Suite) -> Iterator[Row]:
    """The rows of a suite; one that is not measured where its data are not at hand."""
    missing = [str(path) for path in suite.needs if not path.exists()]
    if missing:
        yield not_measured(suite.command, f"no {', '.join(missing)}")
    else:
        yield from suite.rows()


def main(results: Path | None = None, forecast: Path | None = None, links: Path | None = None) -> int:
    """Print the bars; 1 when one is missed.

    `--results` and `--forecast` take the `results.json`, or its folder, of an evaluation of the TUM trips; `--links` those of
    `benchmarks.planned`.
    """
    rows: list[tuple[str, Row]] = []
    for suite in suites(results, forecast, links):
        for row in measured(suite):
            rows.append((suite.command, row))
            print(row.line, file=sys.stderr, flush=True)
    print("| bar | measure | figure | required | met |\n|---|---|---|---|---|")
    for command, row in rows:
        beside = "; ".join(filter(None, (row.bounds, row.note)))
        print(f"| {row.name} | `{command}` | {row.figure} | {beside} | {row.verdict} |")
    count = [sum(row.verdict == word for _, row in rows) for word in ("yes", "NO", "not measured")]
    print("\n{} bars met, {} missed, {} not measured".format(*count))
    return int(count[1] > 0)


if __name__ == "__main__":
    run(main)
