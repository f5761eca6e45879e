"""Are two installations equally fast? `python -m benchmarks.paired_speed OLD/bin/python NEW/bin/python [--runs N]`.

Whole commands and requests to a service, of one installation and of the other in turn, on the same inputs. Prints the
medians and the ratio new / old of each pair's median, with its spread.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tools.command import run

RUNS = 5
REQUESTS = 60

Measured = dict[str, float]


@contextmanager
def served(python: str, folder: Path) -> Iterator[str]:
    """The address of a service with one worker."""
    command = [python, "-m", "tripwatt.command", "serve", "--port", "0", "--workers", "1"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=folder
    ) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().split()[1]
        finally:
            process.terminate()


def forecast_request(trip: Path) -> bytes:
    """The example trip as a request of the service."""
    head, *rows = (line.split(",") for line in trip.read_text("utf-8").splitlines())
    samples = {
        name: [float(row[head.index(name)]) for row in rows]
        for name in ("time_s", "speed_m_s", "elevation_m")
    }
    return json.dumps({"samples": samples, "ambient_temperature_degc": -5.0}).encode()


def measured(python: str, folder: Path) -> Measured:
    """Seconds of one installation: whole commands, and the median of its service's answers."""

    def seconds(*arguments: str) -> float:
        start = time.perf_counter()
        command = [python, "-m", "tripwatt.command", *arguments]
        subprocess.run(command, check=True, capture_output=True, cwd=folder)
        return time.perf_counter() - start

    times_s = {
        "tripwatt --help": seconds("--help"),
        "tripwatt forecast of the example trip": seconds("forecast", "trip.csv"),
        "tripwatt fit on the synthetic fleet": seconds("fit", "--out", f"model-{time.monotonic_ns()}"),
    }
    body = forecast_request(folder / "trip.csv")
    with served(python, folder) as url:
        request = urllib.request.Request(f"{url}/v1/forecast", body, {"Content-Type": "application/json"})

        def answered() -> float:
            start = time.perf_counter()
            with urllib.request.urlopen(request) as answer:
                answer.read()
            return time.perf_counter() - start

        times = [answered() for _ in range(REQUESTS)]
    return {**times_s, "a forecast of the service, median": statistics.median(times)}


def compared(old: str, new: str, runs: int, folder: Path, tell: Callable[[str], None] = print) -> None:
    """Measure both in turn and print a row for each measurement."""
    subprocess.run(
        [new, "-m", "tripwatt.command", "example-trip", "--out", "trip.csv"], check=True, cwd=folder
    )
    for python in (old, new):  # files are read and compiled once before anything counts
        measured(python, folder)
    pairs: list[tuple[Measured, Measured]] = []
    for number in range(runs):
        order = (old, new) if number % 2 == 0 else (new, old)
        both = {python: measured(python, folder) for python in order}
        pairs.append((both[old], both[new]))
    tell(f"{'seconds, median of ' + str(runs):<42} {'old':>8} {'new':>8} {'new/old':>8}   of the pairs")
    for name in pairs[0][0]:
        before, after = ([pair[k][name] for pair in pairs] for k in (0, 1))
        ratios = sorted(b / a for a, b in zip(before, after, strict=True))
        middle = statistics.median(before), statistics.median(after), statistics.median(ratios)
        tell(
            f"{name:<42} {middle[0]:8.3f} {middle[1]:8.3f} {middle[2]:8.2f}   {ratios[0]:.2f} to {ratios[-1]:.2f}"
        )


def main(old: Path, new: Path, runs: int = RUNS) -> None:
    """Compare two Pythons with tripwatt[service] by pairs of runs."""
    with tempfile.TemporaryDirectory() as place:
        compared(str(old.absolute()), str(new.absolute()), runs, Path(place))


if __name__ == "__main__":
    run(main)
