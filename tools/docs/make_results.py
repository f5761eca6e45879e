"""Make what is published anew: ``make results``, or ``python -m tools.docs.make_results [NAME ...] [--check] [--pages]``.

`RESULTS` lists every file and every generated part of a page that rests on a run: its command, what it writes, its data. Each has a
stamp in docs/results/stamps.json: the probe of the code that it was made with (`tools/quality/probe.py`), its command, the digests of
its data and of what it wrote. What is current by its stamp is kept, so an interrupted run goes on where it stopped. At the end
every page is written anew. `--check` lists what is stale, and why, and runs nothing; `--pages` writes the pages alone.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

from typer import Argument, BadParameter, Option

from tools import CATALOGUE, DATA, REFERENCE, ROOT, command
from tools.docs import gallery, pages
from tools.quality import probe

PROBE: Final = ROOT / "docs" / "results" / "probe.json"
STAMPS: Final = ROOT / "docs" / "results" / "stamps.json"
WORK: Final = ROOT / "out" / "results"
RENEW: Final = "run `make results`, which makes what is stale anew"
TABLES: Final = "src/tripwatt/vehicles/data/table"
MODEL: Final = "src/tripwatt/models/bmw_i3_tum"
POPULATION: Final = "src/tripwatt/population/data/population.json"
SAMPLE: Final = "src/tripwatt/sources/data"

Probe = Mapping[str, Sequence[Sequence[float]]]


class Result(NamedTuple):
    """One published result.

    `files` are paths from the root, or `PAGE#PART` for a generated part of a page (`tools/docs/pages.py`). `minutes` are those of an idle machine of two cores.
    A result that has no forecast of a car without trips or with a few does not rest on the parts `OTHER_CARS` of the probe, one without
    updates not on `probe.ON_THE_WAY`, and one of maps alone on no part.
    """

    name: str
    commands: tuple[str, ...]
    files: tuple[str, ...]
    data: tuple[str, ...]
    minutes: float
    other_cars: bool = False
    updates: bool = False
    maps_alone: bool = False


OTHER_CARS: Final = frozenset(
    ("forecast own trips", *(f"forecast {car}" for car in probe.CARS if car != "bmw_i3_60ah"))
)
"""Parts of the probe with forecasts of cars that have no trips, or a few."""


def resting(result: Result, found: Probe) -> Probe:
    """The parts of a probe that a result rests on."""
    kept = {} if result.maps_alone else found
    left_out = set() if result.other_cars else {*OTHER_CARS}
    left_out |= set() if result.updates else {probe.ON_THE_WAY}
    return {name: rows for name, rows in kept.items() if name not in left_out}


def evaluation(protocol: str, minutes: float, *more: str) -> Result:
    """A protocol on the reference trips."""
    out = f"{{work}}/{protocol}"
    return Result(
        protocol,
        (
            f"-m tripwatt evaluate {{data}}/tum --protocol {protocol} --resume --out {out}",
            f"-m tools.docs.publish_results {out}",
        ),
        (f"docs/results/{protocol}.json", *more),
        ("tum",),
        minutes,
        updates=protocol == "forecast",
    )


def part(
    name: str, module: str, place: str, *data: str, minutes: float = 1, other_cars: bool = False
) -> Result:
    """A part of a page by a benchmark, which `--write` tells to renew it."""
    return Result(name, (f"-m benchmarks.{module} --write",), (f"docs/{place}",), data, minutes, other_cars)


CARS: Final = ("bmw_i3_60ah", "bmw_i3_60ah-identified", "nissan_leaf_24")
RESULTS: Final = (
    Result(
        "anchors",
        ("-m benchmarks.anchors --write",),
        (f"{TABLES}/anchors.csv", "docs/reference/library.md#anchors"),
        ("catalogue",),
        1,
    ),
    part("six-numbers", "six_numbers", "reference/vehicles.md#six-numbers", "catalogue"),
    part("steady", "steady", "reference/library.md#steady"),
    part("cold-rows", "cold_rows", "reference/library.md#cold", "catalogue"),
    part("argonne", "argonne", "explanation/argonne.md#argonne", "argonne", "cycles"),
    Result(
        "stages",
        ("-m benchmarks.stages --docs",),
        ("docs/explanation/stages.md", *(f"docs/images/stages-{car}.png" for car in CARS)),
        ("tum", "ved"),
        1,
    ),
    part("ved", "ved_trips", "explanation/ved.md#tables", "ved"),
    evaluation("forecast", 20),
    Result(
        "model",
        ("-m tools.data.fit_default_model {data}/tum docs/results/forecast.json",),
        (MODEL,),
        ("tum", "docs/results/forecast.json"),
        1,
    ),
    Result("population", ("-m tools.data.population",), (POPULATION,), ("tum", "ved", "twizy"), 1),
    Result(
        "cars",
        ("-m benchmarks.cars --write",),
        (
            "docs/results/cars.json",
            "docs/images/cars-curves.png",
            "docs/explanation/cars.md#cars",
            "docs/explanation/cars.md#factors",
            "docs/explanation/cars.md#dynamometer",
        ),
        ("tum", "ved", "twizy", "sedan", POPULATION, MODEL),
        2,
        other_cars=True,
    ),
    Result(
        "transfer",
        ("-m benchmarks.transfer --write --resume",),
        ("docs/results/transfer.json", "docs/images/transfer.png", "docs/explanation/cars.md#transfer"),
        ("tum", "ved", "twizy", "sedan"),
        20,
        other_cars=True,
    ),
    Result(
        "before",
        ("-m benchmarks.before --write",),
        (
            "docs/results/before.json",
            "docs/explanation/results.md#before",
        ),
        ("tum", "ved", "twizy", "sedan", POPULATION, MODEL),
        2,
        other_cars=True,
    ),
    Result(
        "paper-claims",
        ("-m benchmarks.paper_claims --write",),
        ("docs/results/paper_claims.json",),
        ("tum", "docs/results/table2_mgcv.csv"),
        5,
    ),
    evaluation("paper", 4),
    Result(
        "links",
        ("-m benchmarks.planned --json {work}/links.json", "-m tools.docs.publish_results {work}/links.json"),
        ("docs/results/links.json",),
        ("tum",),
        6,
    ),
    part("routes", "links", "reference/routes.md#links", "tum", minutes=3),
    part(
        "few-trips",
        "few_trips --cars 12",
        "reference/synthetic.md#few-trips",
        "tum",
        "catalogue",
        MODEL,
        minutes=10,
        other_cars=True,
    ),
    part(
        "own-logs",
        "own_logs",
        "explanation/uncertainty.md#own-logs",
        "tum",
        "ved",
        "twizy",
        "sedan",
        minutes=1.5,
    ),
    part(
        "unknown-climb",
        "unknown_climb",
        "explanation/uncertainty.md#climb",
        "tum",
        "twizy",
        "sedan",
        MODEL,
        minutes=5,
    ),
    Result(
        "outside",
        ("-m benchmarks.outside --write",),
        (
            "docs/results/outside.json",
            "docs/images/accuracy.png",
            "docs/explanation/accuracy.md#accuracy",
            "docs/explanation/accuracy.md#line",
            "docs/index.md#line",
            "README.md#line",
        ),
        (
            "cycles",
            "argonne",
            "catalogue",
            "sedan",
            *(f"docs/results/{name}.json" for name in ("cars", "before", "links")),
        ),
        1,
    ),
    Result("peers", ("make peers",), ("docs/explanation/peers.md#peers",), ("tum", "ved"), 4),
    Result(
        "gallery",
        ("-m tools.docs.gallery",),
        ("docs/gallery/index.md", *(f"docs/images/gallery/{name}.png" for name in gallery.NAMES)),
        (MODEL, SAMPLE, *(f"docs/gallery/{name}.py" for name in gallery.NAMES)),
        2,
        other_cars=True,
        updates=True,
    ),
    part(
        "long-trips",
        "long_trips --cars 12",
        "reference/synthetic.md#long-trips",
        "catalogue",
        MODEL,
        minutes=8,
        other_cars=True,
    ),
    Result(
        "country",
        ("-m benchmarks.country --write",),
        ("docs/results/country.json", "docs/decisions/page-03-large-maps.md#country"),
        ("tools/data/country.py", "benchmarks/country.py", "src/tripwatt/roads/maps"),
        8,
        maps_alone=True,
    ),
)
"""In this order: what changes the cars comes first, and the model of the package before what starts from it."""

PAGES: Final = (
    "-m tools.docs.publish_results docs/results/forecast.json",
    "-m tools.docs.publish_results docs/results/paper.json",
    "-m tools.docs.publish_results docs/results/links.json",
    "-m tools.docs.write_parameters",
    "-m tools.docs.write_cli",
    "-m tools.docs.write_citation",
    "-m tools.docs.write_figures",
    "-m tools.docs.render_pages --write",
    "tests/vectors/write.py",
)
"""Writers of the pages and of what else follows from the published files."""


FOLDERS: Final = {
    **{name: DATA / name for name in ("tum", "ved", "twizy", "sedan", "cycles")},
    "catalogue": CATALOGUE,
    "argonne": REFERENCE / "anl_d3_i3.csv",
}


def source(name: str) -> Path:
    """A set of data, or a file of the project."""
    return FOLDERS.get(name, ROOT / name)


def digest(path: Path) -> str:
    """Of a file, or of all files of a folder and their names."""
    read = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file() and "__pycache__" not in file.parts:
            read.update(file.relative_to(path).as_posix().encode() + b"\0" + file.read_bytes())
    return read.hexdigest()[:16]


def digest_of_page(text: str) -> str:
    """Of a page or its part, whatever the folder is that it stands in, which its links depend on."""
    return hashlib.sha256(re.sub(r"\]\([\w./-]*/", "](", text).strip().encode()).hexdigest()[:16]


def written(place: str) -> str:
    """Digest of a file, or of the part of a page; a name for nothing where it is missing."""
    name, _, part = place.partition("#")
    path = ROOT / name
    if not path.exists():
        return "missing"
    if path.suffix != ".md":
        return digest(path)
    text = path.read_text("utf-8")
    try:
        return digest_of_page(pages.part(text, part) if part else text)
    except ValueError:
        return "missing"


def stamp(result: Result, probe_digest: str) -> dict[str, Any]:
    """What a result rests on, and what it wrote."""
    return {
        "probe": probe_digest,
        "settings": list(result.commands),
        "data": {name: digest(source(name)) for name in result.data},
        "files": {place: written(place) for place in result.files},
    }


def stale(result: Result, stamps: Mapping[str, Any], now: Probe, at: Probe) -> Iterator[str]:
    """Why a result is not current; nothing when it is. Data that are not at hand are not looked at."""
    stamp_of_result = stamps.get(result.name)
    if stamp_of_result is None:
        yield "it has no stamp"
        return
    at, now = resting(result, at), resting(result, now)
    changes = list(probe.differences(at, now))  # type: ignore[arg-type]
    if stamp_of_result["probe"] != probe.digest(at):  # type: ignore[arg-type]
        yield "it was made with another probe than docs/results/probe.json"
    elif changes:
        yield f"the code computes something else: {'; '.join(changes[:3])}"
    if stamp_of_result["settings"] != list(result.commands):
        yield "its command has changed"
    for name in result.data:
        if source(name).exists() and stamp_of_result["data"].get(name) != digest(source(name)):
            yield f"its data have changed: {name}"
    for place in result.files:
        if stamp_of_result["files"].get(place) != written(place):
            yield f"{place} is not what its command wrote"


def read(file: Path) -> Any:
    """A JSON file; an empty document where there is none."""
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def write_probe(new: Probe) -> None:
    """Keep a probe, a line for each drive."""
    parts = (
        f" {json.dumps(name)}: [\n" + ",\n".join(f"  {json.dumps(row)}" for row in rows) + "\n ]"
        for name, rows in new.items()
    )
    PROBE.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def computed() -> dict[str, Any]:
    """The probe of the files as they are now, which a command may have changed since this process read them."""
    command = [sys.executable, "-m", "tools.quality.probe"]
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, env=environment())
    return dict(json.loads(done.stdout))


def settled(now: dict[str, Any]) -> dict[str, Any]:
    """The kept probe where that of the code differs by no more than noise, which else replaces it."""
    kept = read(PROBE)
    if any(probe.differences(kept, now)):
        write_probe(now)
        return now
    return dict(kept)


def run(command: str) -> None:
    """One command in the project's folder: of Python, or of `make` where it needs an environment of its own."""
    filled = command.format(data=DATA, work=WORK)
    print(f"  {filled}", flush=True)
    words = filled.split()
    words = words if words[0] == "make" else [sys.executable, *words]
    subprocess.run(words, cwd=ROOT, check=True, env=environment())


def environment() -> dict[str, str]:
    """With the folders of the data, and the project's own packages first."""
    folders = (str(ROOT / "src"), str(ROOT / "gamm" / "src"), str(ROOT))
    path = os.pathsep.join(filter(None, (*folders, os.environ.get("PYTHONPATH", ""))))
    return {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        **os.environ,
        "PYTHONPATH": path,
        "TRIPWATT_DATA": str(DATA),
        "TRIPWATT_REFERENCE": str(REFERENCE),
        "TRIPWATT_CATALOGUE": str(CATALOGUE),
    }


def make(result: Result, now: dict[str, Any]) -> dict[str, Any]:
    """Run one result and stamp it; gives the probe after it. A code that changed meanwhile gives no stamp."""
    WORK.mkdir(parents=True, exist_ok=True)
    for line in result.commands:
        run(line)
    after = computed()
    if any(probe.differences(now, after)) and not any(TABLES in place for place in result.files):
        raise SystemExit(f"{result.name}: the code changed while it ran; run it again")
    kept = resting(result, settled(after))
    stamps = read(STAMPS) | {result.name: stamp(result, probe.digest(kept))}  # type: ignore[arg-type]
    STAMPS.write_text(json.dumps(stamps, indent=1) + "\n", encoding="utf-8")
    return after


def write_pages() -> None:
    """Every page from the published files; the pictures where there is a browser."""
    for line in PAGES:
        run(line)
    if any(map(shutil.which, ("chromium-headless-shell", "chromium"))):
        run("-m tools.docs.write_page_images")


def main(
    names: Annotated[list[str] | None, Argument()] = None,
    check: bool = False,
    only_pages: Annotated[bool, Option("--pages")] = False,
) -> int:
    """Make what is stale, or the results that are named, then all pages.

    `--check` lists what is stale, runs nothing and returns 1 for it; `--pages` writes the pages alone.
    """
    if unknown := set(names or ()) - {result.name for result in RESULTS}:
        raise BadParameter(f"{', '.join(sorted(unknown))}: none of {', '.join(r.name for r in RESULTS)}")
    chosen = [] if only_pages else [r for r in RESULTS if not names or r.name in names]
    any_stale, now = False, computed() if chosen else {}
    for k, result in enumerate(chosen):
        reasons = list(stale(result, read(STAMPS), now, read(PROBE))) or ["asked for"] * bool(names)
        any_stale |= bool(reasons)
        about = f"{'; '.join(reasons)}; {result.minutes:g} min" if reasons else "current"
        print(f"{time.strftime('%H:%M')} {k + 1} of {len(chosen)} {result.name}: {about}", flush=True)
        if reasons and not check:
            now = make(result, now)
    if not check:
        write_pages()
    return int(any_stale and check)


if __name__ == "__main__":
    command.run(main)
