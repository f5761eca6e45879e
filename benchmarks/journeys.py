"""Journeys: cutting a road, routers by annotation and by steps, and the speed of a real Valhalla.

Run: ``python -m benchmarks.journeys``. The rows of Valhalla need TRIPWATT_VALHALLA (`.ci/run` prepares it) or pyvalhalla, and
TRIPWATT_DATA with the extract. Planning and reach are measured in process where pyvalhalla is installed, else on a server on
loopback.
"""

from __future__ import annotations

import itertools
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.router_server import valhalla_serving
from tools import DATA
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, not_measured, report, seconds
from tripwatt.roads.journey import (
    Atlas,
    JourneyOptions,
    Place,
    RoadForecaster,
    find_reach,
    journey_with,
    open_atlas,
)
from tripwatt.roads.maps.engine import valhalla_folder
from tripwatt.roads.maps.folder import MapFolder, build_map
from tripwatt.roads.routers.road import Road
from tripwatt.roads.routers.servers import osrm_leg
from tripwatt.routes import route_from_links
from tripwatt.routes.documents import Node

RUNS = 5
PAIRS = (("Vaduz", "Ruggell"), ("Balzers", "Bendern"), ("Ruggell", "Balzers"), ("Nendeln", "Triesen"))
WORDS = ("vad", "tries", "landstr", "landstr 11 vad", "sch", "malb", "s", "im ", "gamprin", "haupt")


def cutting() -> Iterator[Row]:
    """Largest relative change of the energy of 20 km at 50 km/h as 1, 20 and 200 links."""
    model, departure = tw.load_model(), tw.Departure(soc=0.8, ambient_temperature_degc=10.0)
    energies = []
    for number in (1, 20, 200):
        links = [{"length_m": 20_000.0 / number, "speed_m_s": 50.0 / 3.6}] * number
        energies.append(model.forecast(route_from_links(links).plan(), departure).energy_wh)
    yield Row(
        "energy of 20 km as 1, 20, 200 links: largest change", max(energies) / min(energies) - 1.0, most=0.02
    )
    plans = []
    for answer in _osrm_answers():
        leg = osrm_leg(Node(answer, "benchmark"))
        stops = (Place(47.0, 9.0), Place(47.0, 9.3))
        plans.append(model.forecast(Road.from_legs([leg], stops).plan(), departure).energy_wh)
    yield Row(
        "OSRM by annotation against by steps: change of the energy", abs(plans[0] / plans[1] - 1.0), most=0.02
    )


def _osrm_answers() -> Iterator[dict[str, object]]:
    """A road of eight steps at town, country and motorway speeds with turns, by annotation and by steps."""
    steps = [(1500.0, 50.0), (900.0, 30.0), (4000.0, 80.0), (2500.0, 100.0), (8000.0, 120.0), (3000.0, 100.0)]
    steps += [(2000.0, 50.0), (872.0, 30.0)]
    turn_s, edges = 4.0, []
    for length, kmh in steps:
        number = round(length / 60.0)
        edges += [(length / number, kmh / 3.6)] * number
    total = sum(length for length, _ in steps)
    driven = [0.0, *itertools.accumulate(length for length, _ in edges)]
    line = {"coordinates": [[9.0 + 0.3 * at / total, 47.0] for at in driven]}
    seconds = [round(length / speed, 1) for length, speed in edges]
    annotation = {
        "distance": [length for length, _ in edges],
        "duration": seconds,
        "speed": [round(speed, 1) for _, speed in edges],
    }
    duration = sum(length / (kmh / 3.6) + turn_s for length, kmh in steps)
    yield {"legs": [{"duration": duration, "annotation": annotation}], "geometry": line}
    stepped = [
        {"distance": length, "duration": round(length / (kmh / 3.6) + turn_s, 1)} for length, kmh in steps
    ]
    yield {"legs": [{"duration": duration, "steps": stepped}], "geometry": line}


def _best(work: Callable[[], object]) -> float:
    """Best time of `RUNS` [ms]."""
    return 1000.0 * seconds(work, RUNS, of=min, warm_up=False)


def valhalla() -> Iterator[Row]:
    """Building a map, planning, finding places, reach."""
    names = ("build of the map", "plan of 20 km, p50", "search for places, p50", "area of reach")
    extract = DATA / "osm" / "liechtenstein.osm.pbf"
    why = "" if valhalla_folder() is not None else "Valhalla is not prepared"
    why = why or ("" if extract.is_file() else f"no extract at {extract}")
    if why:
        yield from (not_measured(name, why) for name in names)
        return
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        built = build_map(extract, Path(folder) / "map")
        yield Row(names[0], time.perf_counter() - began, "s", most=10.0)
        with _atlas(built) as (atlas, how):
            yield Row(f"{names[1]} ({how})", _plan_ms(atlas), "ms", most=40.0)
            assert atlas.places is not None
            times = [_best(lambda word=word: atlas.places.search(word)) for word in WORDS]
            yield Row(names[2], statistics.median(times), "ms", most=10.0)
            drive = RoadForecaster(tw.load_model(), tw.Departure(soc=0.1, ambient_temperature_degc=5.0))
            (start,) = atlas.places.search("Vaduz", limit=1)
            yield Row(
                f"{names[3]} ({how})", _best(lambda: find_reach(drive, start, atlas)), "ms", most=2000.0
            )


def _plan_ms(atlas: Atlas) -> float:
    drive = RoadForecaster(tw.load_model(), tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
    assert atlas.places is not None
    options, times = JourneyOptions(answers=False), []
    for names in PAIRS:
        stops = tuple(atlas.places.search(name, limit=1)[0] for name in names)
        times.append(_best(lambda stops=stops: journey_with(drive, stops, atlas, options)))
    return statistics.median(times)


@contextmanager
def _atlas(built: MapFolder) -> Iterator[tuple[Atlas, str]]:
    try:
        import valhalla  # noqa: F401
    except ImportError:
        pass
    else:
        yield open_atlas(built.folder), "in process"
        return
    with valhalla_serving(built) as address:
        yield open_atlas(address), "server on loopback"


def rows() -> Iterator[Row]:
    """All rows."""
    yield from cutting()
    yield from valhalla()


def main() -> int:
    """Print the rows; 1 when a bound is missed."""
    return report(rows())


if __name__ == "__main__":
    run(main)
