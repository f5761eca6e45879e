"""The cost of a large map: a synthetic country is written, built, searched, routed in and served.

Run: ``python -m benchmarks.country [--size large] [--write]``. Needs TRIPWATT_VALHALLA (`.ci/run` prepares it) or pyvalhalla. With
``--write``, renews docs/results/country.json and the table of docs/decisions/page-03-large-maps.md.
"""

from __future__ import annotations

import json
import math
import os
import platform
import re
import resource
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from tests.support.router_server import valhalla_serving
from tools import DOCS
from tools.command import run
from tools.data.country import write_country
from tools.docs import pages

import tripwatt as tw
from benchmarks.measure import Row, not_measured, reference_loop, report
from tripwatt.roads.journey import Atlas, JourneyOptions, Place, RoadForecaster, journey_with, open_atlas
from tripwatt.roads.maps.engine import valhalla_folder
from tripwatt.roads.maps.folder import MapFolder, build_map

BYTES_PER_MB: Final = 1e6

PUBLISHED: Final = DOCS / "results" / "country.json"
LONG_KM: Final = (20.0, 100.0, 400.0)
RUNS: Final = 3
STEPS: Final = ("places", "elevation", "roads")


def rows(size: str) -> Iterator[Row]:
    """Everything that is measured, as it is measured."""
    if valhalla_folder() is None:
        yield not_measured("the cost of a country", "Valhalla is not prepared")
        return
    with tempfile.TemporaryDirectory() as kept:
        folder = Path(kept)
        began = time.perf_counter()
        extract, elevation, edges = write_country(folder / "source", size)
        millions = edges / 1e6
        yield Row("reference loop, for the speed of the machine", 1000.0 * reference_loop(), "ms")
        yield Row("edges, pieces of road between junctions", millions, "million")
        yield Row("writing the synthetic country", time.perf_counter() - began, "s")
        yield Row("extract", extract.stat().st_size / BYTES_PER_MB, "MB")
        starts: list[float] = []
        with largest_memory("valhalla_build_tiles") as valhalla_mb:
            built = build_map(
                extract,
                folder / "map",
                elevation=elevation,
                progress=lambda step: starts.append(time.perf_counter()),
            )
        ends = [*starts[1:], time.perf_counter()]
        for step, start, end in zip(STEPS, starts, ends, strict=True):
            yield Row(f"build: {step}", end - start, "s")
        yield Row("build, for a million edges", (ends[-1] - starts[0]) / millions, "s")
        own_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        yield Row("build: most memory, places and elevation", own_mb, "MB")
        yield Row("build: most memory, roads", max(valhalla_mb, default=math.nan), "MB")
        for name in ("tiles.tar", "places.sqlite", "elevation"):
            yield Row(f"on disk: {name}", _bytes(built.folder / name) / BYTES_PER_MB, "MB")
        roads = _bytes(built.folder / "tiles.tar") + _bytes(built.folder / "places.sqlite")
        yield Row("on disk without elevation, for a million edges", roads / BYTES_PER_MB / millions, "MB")
        yield from searches(built)
        with valhalla_serving(built) as address:
            yield from journeys(open_atlas(address))
            yield from served(built)


def searches(built: MapFolder) -> Iterator[Row]:
    """Processor time of a search: of words as they are typed, and with a letter left out."""
    names = [place.name for place in built.index.settlements(-90.0, -180.0, 90.0, 180.0, 400)][::20]
    begun = [name[:k] for name in names for k in range(1, len(name) + 1)]
    begun += [f"{name} haupts" for name in names]
    wrong = [name[:2] + name[3:] for name in names] + [f"Bahnhofstr {name[:3]}{name[4:]}" for name in names]
    for what, texts in (("as it is typed", begun), ("with a mistake", wrong)):
        took = sorted(
            1000.0 * _took(lambda text=text: built.index.search(text), time.process_time) for text in texts
        )
        yield Row(f"search {what}, p50", statistics.median(took), "ms", most=10.0)
        yield Row(f"search {what}, p99", took[int(0.99 * len(took))], "ms")
    found = [
        name in [place.name.partition(",")[0] for place in built.index.search(name[:2] + name[3:])]
        for name in names
    ]
    yield Row("settlements found with a letter left out", sum(found) / len(found), least=0.9)


def journeys(atlas: Atlas) -> Iterator[Row]:
    """Time of a road, and of a plan with its forecast, by the distance of its places."""
    drive = RoadForecaster(tw.load_model(), tw.Departure(soc=0.9, ambient_temperature_degc=5.0))
    options = JourneyOptions(answers=False)
    for km in LONG_KM:
        pairs = _pairs(atlas, 1000.0 * km)
        if not pairs:
            yield not_measured(f"road of about {km:g} km", "no such places")
            continue
        roads = [_took(lambda pair=pair: atlas.router.roads(pair)) for pair in pairs]
        yield Row(f"road of about {km:g} km, p50", 1000.0 * statistics.median(roads), "ms")
        plans = [_took(lambda pair=pair: journey_with(drive, pair, atlas, options)) for pair in pairs]
        yield Row(f"plan of about {km:g} km, p50", 1000.0 * statistics.median(plans), "ms")


def served(built: MapFolder) -> Iterator[Row]:
    """Memory of the router that answered the journeys: its own, and what it shares by mapped files."""
    for lines in _status(str(built.folder / "server.json")):
        for part, what in (("RssAnon", "its own"), ("RssFile", "mapped files")):
            yield Row(f"memory of the router after the journeys, {what}", _megabytes(lines[part]), "MB")


def _status(named: str) -> Iterator[dict[str, str]]:
    """What the system tells about running programs with a word in their command."""
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            if named.encode() in (status.parent / "cmdline").read_bytes():
                yield dict(line.partition(":")[::2] for line in status.read_text("utf-8").splitlines())
        except OSError:
            continue  # it has ended


def _megabytes(text: str) -> float:
    return int(text.split()[0]) / 1024.0


@contextmanager
def largest_memory(program: str) -> Iterator[list[float]]:
    """Memory of a program that runs meanwhile [MB], looked at again and again."""
    seen: list[float] = []
    ended = threading.Event()

    def look() -> None:
        while not ended.wait(0.2):
            seen.extend(_megabytes(lines["VmHWM"]) for lines in _status(program) if "VmHWM" in lines)

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    try:
        yield seen
    finally:
        ended.set()
        thread.join()


def _pairs(atlas: Atlas, distance_m: float) -> list[tuple[Place, Place]]:
    """Ten pairs of towns that lie about so far apart."""
    assert atlas.bounds_deg is not None
    towns = atlas.settlements(atlas.bounds_deg, 2000)
    pairs: list[tuple[Place, Place]] = []
    for start in towns[:: max(1, len(towns) // 12)]:
        near = min(towns, key=lambda place: abs(start.distance_m(place) - 0.85 * distance_m))
        if abs(start.distance_m(near) - 0.85 * distance_m) < 0.2 * distance_m:
            pairs.append((start, near))
    return pairs[:10]


def _took(job: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """The shortest of some runs [s]: the machine has other work."""
    times = []
    for _ in range(RUNS):
        began = clock()
        job()
        times.append(clock() - began)
    return min(times)


def _bytes(path: Path) -> int:
    return (
        path.stat().st_size
        if path.is_file()
        else sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    )


def machine() -> str:
    """The machine of the run: its times mean little without it."""
    about = dict(re.findall(r"^([\w ]+?)\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text("utf-8"), flags=re.M))
    memory_gb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
    cores = len(os.sched_getaffinity(0))
    return f"{about.get('model name', platform.machine())}, {cores} cores, {memory_gb:.0f} GB of memory, Python {platform.python_version()}"


def table(published: Mapping[str, Any]) -> str:
    """The rows as Markdown."""
    lines = [f"| {row['name']} | {row['value']:,.3g} {row['unit']} |" for row in published["rows"]]
    head = "| of the synthetic country | measured |"
    return "\n".join([head, "|---|---:|", *lines, "", f"The machine of the run: {published['machine']}."])


def main(size: str = "large", write: bool = False) -> int:
    """Print the rows; 1 when a bound is missed."""
    kept: list[Row] = []

    def keeping() -> Iterator[Row]:
        for row in rows(size):
            kept.append(row)
            yield row

    missed = report(keeping())
    if write:
        measured = [{"name": row.name, "value": float(f"{row.value:.4g}"), "unit": row.unit} for row in kept]
        published = {"size": size, "machine": machine(), "rows": measured}
        PUBLISHED.write_text(json.dumps(published, indent=1) + "\n", "utf-8")
        pages.renew("decisions/page-03-large-maps.md", "country", table(published))
    return missed


if __name__ == "__main__":
    run(main)
