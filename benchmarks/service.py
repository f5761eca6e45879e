"""The service under load, on loopback: `python -m benchmarks.service [--seconds S] [--examples N] [--mutants N]`.

The generator shares the cores with what it measures. Beside the times stands what a request costs in processor time,
which a busy machine hardly changes, and the share of the machine that went to others while it was measured.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import orjson
from tests.support.service_load import Load, load, request
from tests.support.service_process import Service, serving
from tools.command import run

from benchmarks.measure import Row, report
from tripwatt.routes import links_of_trip
from tripwatt.study.synthetic import synthetic_fleet

SECONDS: Final = 60.0
SAMPLES: Final = 1300
LINKS: Final = 100
LINK_M: Final = 250.0
BATCH: Final = 1500
FLAT_FROM_S: Final = 10.0


@dataclass(frozen=True)
class Machine:
    """Time that all processors spent, and that they were idle [s]."""

    total: float
    idle: float

    @classmethod
    def now(cls) -> Machine:
        """From the kernel."""
        fields = [float(x) for x in Path("/proc/stat").read_text().split("\n")[0].split()[1:9]]
        tick = os.sysconf("SC_CLK_TCK")
        return cls(sum(fields) / tick, (fields[3] + fields[4]) / tick)


def trips(number: int) -> list[dict[str, Any]]:
    """Requests for driven trips of `SAMPLES` samples at 1 Hz, each with a departure of its own."""
    long = [t for t in synthetic_fleet(20).trips if len(t) >= SAMPLES]
    requests = []
    for k in range(number):
        table = long[k % len(long)].samples.iloc[:SAMPLES]
        columns = {c: table[c].tolist() for c in ("time_s", "speed_m_s", "elevation_m")}
        at_door = {
            "soc": 0.8,
            "ambient_temperature_degc": -10.0 + k % 40,
            "cabin_setpoint_degc": 20.0,
        }
        requests.append({"samples": columns, **at_door, "payload_mass_kg": float(k % 7) * 50.0})
    return requests


def links_request() -> dict[str, Any]:
    """A request for a planned road: the first links of a synthetic drive, as a router with links of 250 m sees it."""
    trip = max(synthetic_fleet(20).trips, key=lambda t: t.distance_m)
    route = links_of_trip(trip, LINK_M)
    height = route.elevation_at(np.concatenate(([0.0], np.cumsum(route.length_m))))
    assert height is not None
    rows = zip(route.length_m, route.travel_time_s, height, height[1:], strict=False)
    names = ("length_m", "travel_time_s", "start_elevation_m", "end_elevation_m")
    links = [dict(zip(names, map(float, row), strict=True)) for row in rows][:LINKS]
    assert len(links) == LINKS
    return {"links": links, "soc": 0.8, "ambient_temperature_degc": 5.0}


def planned_roads(number: int, links: int = 60) -> list[dict[str, Any]]:
    """Requests for planned roads of links of 100 m to 1 km, each with a departure of its own."""
    rng = np.random.default_rng(1)
    names = ("length_m", "speed_m_s", "grade")
    requests = []
    for k in range(number):
        columns = (
            rng.uniform(100.0, 1000.0, links),
            rng.uniform(7.0, 30.0, links),
            rng.normal(0.0, 0.01, links),
        )
        rows = [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]
        requests.append(
            {"trip": f"road {k}", "links": rows, "soc": 0.9, "ambient_temperature_degc": float(k % 25)}
        )
    return requests


def answers_of(service: Service, asked: list[dict[str, Any]]) -> list[bytes]:
    """What each request is answered with when nothing else goes on."""
    return [service.client.post("/v1/forecast", json=one).content for one in asked]


def cpu_s(service: Service) -> float:
    """Processor time of the service and its workers so far [s]."""
    tick = os.sysconf("SC_CLK_TCK")
    spent = 0.0
    for pid in (service.process.pid, *service.workers()):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        spent += (int(fields[11]) + int(fields[12])) / tick
    return spent


def under_load(
    service: Service, asked: list[dict[str, Any]], seconds: float, concurrency: int
) -> tuple[Load, list[int]]:
    """Load with memory measured twice a second."""
    right = answers_of(service, asked)
    bodies = [request("/v1/forecast", orjson.dumps(one)) for one in asked]
    sizes: list[int] = []

    async def run() -> Load:
        async def watch() -> None:
            while True:
                await asyncio.sleep(0.5)
                sizes.append(service.resident_bytes())

        watching = asyncio.ensure_future(watch())
        try:
            return await load(
                service.port,
                bodies,
                seconds=seconds,
                concurrency=concurrency,
                check=lambda k, body: body == right[k],
            )
        finally:
            watching.cancel()

    return asyncio.run(run()), sizes


def spread(sizes: list[int], seconds: float) -> float:
    """Largest over smallest memory, less 1, from the 10th second on; of a short run from its sixth part on."""
    first = int(2 * min(FLAT_FROM_S, seconds / 6))
    later = sizes[first:] or sizes
    return max(later) / min(later) - 1.0


def times(seconds: float) -> Iterator[Row]:
    """Load of driven trips, of planned roads, and a batch."""
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder), "--workers", "2") as service:
        asked = trips(20)
        before, spent, mine = Machine.now(), cpu_s(service), time.process_time()
        loaded, sizes = under_load(service, asked, seconds, 4)
        after, spent = Machine.now(), cpu_s(service) - spent
        own = spent + time.process_time() - mine
        total = after.total - before.total
        yield Row(
            "forecast of 1,300 samples, 4 at a time, 2 workers: p50", loaded.quantile_ms(0.5), "ms", most=15
        )
        yield Row(
            "forecast of 1,300 samples, 4 at a time, 2 workers: p99", loaded.quantile_ms(0.99), "ms", most=60
        )
        yield Row(
            "requests of the load that were not answered, or wrong",
            float(len(loaded.errors) + loaded.wrong),
            "requests",
            most=0,
        )
        yield Row(
            "memory from the 10th second of the load on: largest over smallest, less 1",
            spread(sizes, seconds),
            most=0.10,
        )
        yield Row("forecasts a second of this load", len(loaded.seconds) / seconds, "1/s")
        yield Row(
            "processor time of the service for each of them", 1000.0 * spent / len(loaded.seconds), "ms"
        )
        others = max(0.0, (total - (after.idle - before.idle) - own) / total)
        yield Row("share of the machine that went to others meanwhile", others, "")
        road = [links_request()]
        alone = [under_load(service, road, min(seconds, 3.0), 1)[0].quantile_ms(0.5) for _ in range(5)]
        yield Row("forecast of 100 links of 250 m, one at a time: p50, best of 5", min(alone), "ms", most=8)
        yield Row("forecast of 100 links of 250 m, one at a time: p50, worst of 5", max(alone), "ms")
        together, _ = under_load(service, road, min(seconds, 15.0), 4)
        yield Row("forecast of 100 links of 250 m, 4 at a time: p50", together.quantile_ms(0.5), "ms")
        many, _ = under_load(service, planned_roads(40), min(seconds, 15.0), 20)
        text = "forecast of 60 links, 20 at a time, 2 workers"
        yield Row(f"{text}: answered a second", len(many.seconds) / min(seconds, 15.0), "1/s", least=200)
        yield Row(f"{text}: p99", many.quantile_ms(0.99), "ms", most=120)
        yield Row(
            "batch of planned roads of 60 links",
            batch_rate(service, planned_roads(1000)),
            "trips/s",
            least=125,
        )
        yield Row("batch of trips of 1,300 samples", batch_rate(service, trips(BATCH)), "trips/s", least=200)


def batch_rate(service: Service, asked: list[dict[str, Any]]) -> float:
    """Trips a second of one batch, each of them answered with a forecast."""
    body = b"\n".join(orjson.dumps(one) for one in asked)
    started = time.perf_counter()
    answer = service.client.post(
        "/v1/forecast/batch",
        content=body,
        headers={"Content-Type": "application/x-ndjson", "Accept-Encoding": "identity"},
        timeout=600.0,
    )
    elapsed = time.perf_counter() - started
    lines = answer.content.splitlines()
    assert len(lines) == len(asked)
    assert all(b'"energy_wh"' in line for line in lines)
    return len(lines) / elapsed


def killed(seconds: float) -> Iterator[Row]:
    """Load while first one and then the other worker is killed."""
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder), "--workers", "2") as service:
        asked = trips(8)
        right = answers_of(service, asked)
        bodies = [request("/v1/forecast", orjson.dumps(one)) for one in asked]

        async def run() -> Load:
            running = asyncio.ensure_future(
                load(
                    service.port,
                    bodies,
                    seconds=seconds,
                    concurrency=4,
                    check=lambda k, body: body == right[k],
                )
            )
            for pid in service.workers():
                await asyncio.sleep(seconds / 3.0)
                os.kill(pid, signal.SIGKILL)
            return await running

        loaded = asyncio.run(run())
        lost = sum(r["event"] == "worker lost" for r in service.records())
        assert lost == 2
        yield Row(
            "requests without a right answer while a worker is killed under load",
            float(len(loaded.errors) + loaded.wrong),
            f"of {len(loaded.seconds)}",
            most=0,
        )


def robustness(examples: int, mutants: int) -> Iterator[Row]:
    """Schemathesis and damaged uploads."""
    from tests.support.service_fuzz import fuzz
    from tests.support.service_schema import PLAIN, conformance

    with tempfile.TemporaryDirectory() as folder, serving(Path(folder), "--workers", "2") as service:
        said = conformance(service.url, examples, only=PLAIN)
        if not said.clean:
            print(said.text, file=sys.stderr)
        failures = said.failures if said.clean else max(said.failures, 1)
        yield Row(
            "schemathesis, all checks: findings",
            float(failures),
            f"of {said.cases} cases, {examples} an operation",
            most=0,
        )
        sent = fuzz(service.url, mutants)
        for one in sent.wrong[:5]:
            print(one, file=sys.stderr)
        yield Row(
            "damaged uploads: answers that are no problem document",
            float(len(sent.wrong)),
            f"of {sent.mutants}, {mutants} of GPX, CSV and JSON each",
            most=0,
        )


def rows(seconds: float = SECONDS, examples: int = 500, mutants: int = 2000) -> Iterator[Row]:
    """All rows, as they are measured."""
    yield from times(seconds)
    yield from killed(min(seconds, 12.0))
    yield from robustness(examples, mutants)


def main(seconds: float = SECONDS, examples: int = 500, mutants: int = 2000) -> int:
    """Print the rows, 1 when a bound is missed: the load lasts so many seconds; examples of an operation; mutants of each kind of upload."""
    return report(rows(seconds, examples, mutants))


if __name__ == "__main__":
    run(main)
