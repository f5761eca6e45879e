"""Hostile inputs, clients and moments: `python -m benchmarks.hostile [--mutants N] [--models N] [--kills N] [--full N] [--seconds S]`.

Mutants of every input of `tests.support.hostile_files`, bombs of every kind of `tests.support.bombs`, every attack of `tests.support.service_attacks` while another client
asks, cars with extreme values, kills of and full disks under every command that writes, kills of workers under load, and drives over MQTT
through restarts.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, Literal

import orjson
from tests.server.cars.brokers import MOSQUITTO
from tests.server.cars.restarts import fuzzed
from tests.support.bombs import BOMBS, LONGEST_S, MAX_BYTES, too_dear
from tests.support.cars import LEVEL_ROAD, extreme_cars
from tests.support.hostile_files import TARGETS, forged_models, fuzz
from tests.support.service_attacks import ATTACKS, FORECAST, attacking, seen_by_another, used_once
from tests.support.service_process import serving, wait_for
from tests.support.writers import SLOW, WRITERS, tried_at_random
from tools.command import run

from benchmarks.measure import Row, not_measured, report

MUTANTS: Final = 4600
MODELS: Final = 500
BOMBS_IN_ALL: Final = 500
CARS: Final = 1550
KILLS: Final = 50
FULL: Final = 8
SECONDS: Final = 15.0
ROUNDS: Final = 2
MQTT_DRIVES: Final = 20


def inputs(mutants: int, models: int) -> Iterator[Row]:
    """Mutants of every input, and forged models."""
    fuzzed = {name: fuzz(name, mutants) for name in TARGETS}
    fuzzed["models"] = forged_models(models)
    for name, one in fuzzed.items():
        print(
            f"{name}: {one.mutants} mutants, {one.read} read, slowest {one.slowest_s:.2f} s", file=sys.stderr
        )
        print(*one.wrong[:5], sep="\n", end="\n" if one.wrong else "", file=sys.stderr)
    yield Row("mutants of every input", float(sum(one.mutants for one in fuzzed.values())), least=50_000)
    yield Row(
        "mutants of every input: tracebacks, hangs and absurd results",
        float(sum(len(one.wrong) for one in fuzzed.values())),
        most=0,
    )
    yield Row(
        "largest memory of the process that reads the mutants",
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "GB",
        most=0.6,
    )


def bombs(number: int) -> Iterator[Row]:
    """Bombs of every kind: what is not refused within a second and 64 MB."""
    wrong = [fault for kind in BOMBS for fault in too_dear(kind, number // len(BOMBS))]
    print(*wrong[:20], sep="\n", end="\n" if wrong else "", file=sys.stderr)
    yield Row(
        f"{number} bombs of {len(BOMBS)} kinds: not refused within {LONGEST_S:g} s and {MAX_BYTES / 1e6:g} MB",
        float(len(wrong)),
        most=0,
    )


def cars(number: int, seed: int = 11) -> Iterator[Row]:
    """Cars with extreme values inside of their bounds, on a level road."""
    from tripwatt import Departure, InvalidInput, load_model, load_vehicle, read_route
    from tripwatt.population.adapting import without_trips

    model, departure = load_model(), Departure(soc=0.9, ambient_temperature_degc=5.0)
    plan = read_route(LEVEL_ROAD)
    energies, refused = [], 0
    values: Any  # as a vehicle file has them: numbers, and tables of numbers
    for name, values in extreme_cars(number, seed):
        try:
            car = load_vehicle(name, overrides=values)
            energies.append(without_trips(model, car).forecast(plan, departure).energy_wh)
        except InvalidInput:
            refused += 1
    print(f"{number} cars with extreme values: {refused} refused", file=sys.stderr)
    yield Row(
        "cars with extreme values: energies below 0 or above 100 kWh for 33 km",
        float(sum(not 0.0 < energy < 100_000.0 for energy in energies)),
        most=0,
    )


def attacks(seconds: float, rest_s: float = 60.0) -> Iterator[Row]:
    """What another client sees under each attack, and what memory stays: of modules that are loaded at their first use, none counts.

    The base is what the service has after ordinary requests of the kinds that the attacks imitate. What grows again in a
    second round of the same attacks leaks.
    """
    seen = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        tempfile.TemporaryDirectory() as cars,
        serving(Path(folder), "--workers", "2", "--cars", cars) as service,
    ):
        memory = [used_once(service)]
        for number in range(ROUNDS):
            for name in ATTACKS:
                with attacking(name, service.port):
                    one = seen[number, name] = seen_by_another(service, seconds)
                print(
                    f"{name}: {len(one.health_s)} answers, median {1e3 * one.median_s:.0f} ms, p99 "
                    f"{1e3 * one.quantile_s(0.99):.0f} ms, forecast {1e3 * max(one.forecast_s):.0f} ms, "
                    f"{service.resident_bytes() / 1e6:.0f} MB, {one.wrong[:2]}",
                    file=sys.stderr,
                )
            time.sleep(rest_s)
            memory.append(service.resident_bytes())
    print(*(f"{one / 1e6:.0f} MB" for one in memory), file=sys.stderr)
    yield Row(
        "under each attack, /healthz of another client: largest median",
        1e3 * max(one.median_s for one in seen.values()),
        "ms",
        most=250,
    )
    yield Row(
        "under each attack, /healthz of another client: largest p99",
        1e3 * max(one.quantile_s(0.99) for one in seen.values()),
        "ms",
        most=50,
    )
    yield Row(
        "under each attack, a forecast of another client: longest",
        max(max(one.forecast_s) for one in seen.values()),
        "s",
        most=1,
    )
    yield Row(
        "under each attack, requests of another client without an answer",
        float(sum(len(one.wrong) for one in seen.values())),
        most=0,
    )
    yield Row(
        "memory of the service a minute after the attacks over that before, less 1",
        memory[1] / memory[0] - 1.0,
        most=0.10,
    )
    yield Row(
        "memory of the service a minute after the second round of attacks over that after the first, less 1",
        memory[2] / memory[1] - 1.0,
        most=0.05,
    )


def writers(kills: int, full: int) -> Iterator[Row]:
    """Kills of every command that writes, and full disks under it, at seeded moments."""
    ended = {name: tried_at_random(name, kills * (1 if name in SLOW else 4), full) for name in WRITERS}
    for name, one in ended.items():
        print(f"{name}: {one.killed} kills, {one.failed} full disks", file=sys.stderr)
        print(*one.wrong[:5], sep="\n", end="\n" if one.wrong else "", file=sys.stderr)
    yield Row("kills of commands that write", float(sum(one.killed for one in ended.values())), least=300)
    yield Row(
        "full disks under commands that write", float(sum(one.failed for one in ended.values())), least=50
    )
    yield Row(
        "kills and full disks: outputs lost, doubled or not whole, and later runs that fail or are stuck",
        float(sum(len(one.wrong) for one in ended.values())),
        most=0,
    )


def mqtt(drives: int = MQTT_DRIVES) -> Iterator[Row]:
    """Drives over MQTT through killed brokers and programs, lost sessions, kept, doubled and swapped messages."""
    if MOSQUITTO is None:
        yield not_measured("drives over MQTT through restarts", "no mosquitto")
        return
    done = []
    for seed in range(drives):
        with tempfile.TemporaryDirectory() as folder:
            done.append(fuzzed(Path(folder), seed))
    print(f"{drives} drives, {sum(one.messages for one in done)} messages", file=sys.stderr)
    yield Row(
        f"{drives} drives over MQTT through restarts: messages that are missing or twice in the one trip",
        float(sum(one.missing + one.twice + abs(one.trips - 1) + len(one.wrong) for one in done)),
        most=0,
    )


def workers(kills: int = 32, seconds: float = 45.0) -> Iterator[Row]:
    """Kill workers under load; a client repeats a request that gets 503 or 504 once."""
    import os
    import signal

    bad = 0
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder), "--workers", "2") as service:
        request, headers = FORECAST, {"Content-Type": "application/json"}
        started, killed = time.monotonic(), 0
        while time.monotonic() - started < seconds:
            if killed < kills and time.monotonic() - started > killed * seconds / kills and service.workers():
                os.kill(service.workers()[killed % len(service.workers())], signal.SIGKILL)
                killed += 1
            for attempt in range(2):
                answer = service.client.post("/v1/forecast", content=request, headers=headers)
                if answer.status_code == 200:
                    break
                bad += answer.status_code == 500 or attempt == 1
                time.sleep(float(answer.headers.get("Retry-After", "0")))
        wait_for(lambda: orjson.loads(service.client.get("/healthz").content)["workers"] == 2)
    print(f"{killed} kills", file=sys.stderr)
    yield Row(
        "32 kills of workers in 45 s: status 500, and requests that need more than one retry",
        float(bad),
        most=0,
    )


def main(
    mutants: int = MUTANTS,
    models: int = MODELS,
    kills: int = KILLS,
    full: int = FULL,
    seconds: float = SECONDS,
    only: Literal["inputs", "bombs", "cars", "attacks", "writers", "workers", "mqtt"] | None = None,
) -> int:
    """Print the rows; 1 when a bound is missed."""
    return report(rows(mutants, models, kills, full, seconds, only))


def rows(
    mutants: int = MUTANTS,
    models: int = MODELS,
    kills: int = KILLS,
    full: int = FULL,
    seconds: float = SECONDS,
    only: str | None = None,
) -> Iterator[Row]:
    """All rows, or those of one part."""
    parts: dict[str, Callable[[], Iterator[Row]]] = {
        "inputs": lambda: inputs(mutants, models),
        "bombs": lambda: bombs(BOMBS_IN_ALL),
        "cars": lambda: cars(CARS),
        "attacks": lambda: attacks(seconds),
        "writers": lambda: writers(kills, full),
        "workers": workers,
        "mqtt": mqtt,
    }
    for name, part in parts.items():
        if only in (None, name):
            yield from part()


if __name__ == "__main__":
    run(main)
