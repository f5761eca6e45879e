"""One stream of many cars, on loopback: `python -m benchmarks.stream [--cars N] [--per-second N] [--seconds S]`.

Each message carries its number as the charge. Its delay is the time from sending the message to the event that shows it, or a later one
of the same car.
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import httpx
import numpy as np
import orjson
from tests.support.service_process import serving
from tools.command import run

from benchmarks.measure import Row, report
from tripwatt.server.cars.folder import issue_token

MAX_P99_S: Final = 1.0
"""Bar of the delay at 200 cars and 50 messages a second [s]."""


async def _watch(
    client: httpx.AsyncClient, sent_s: dict[tuple[str, int], float], delays: list[float]
) -> None:
    shown: dict[str, int] = {}
    async with client.stream("GET", "/v1/events", timeout=None) as stream:
        async for line in stream.aiter_lines():
            if not line.startswith("data: "):
                continue
            car = orjson.loads(line[6:])
            name, number = car["car"], car["messages"]["new"]
            now_s = time.perf_counter()
            delays.extend(now_s - sent_s[name, k] for k in range(shown.get(name, 0) + 1, number + 1))
            shown[name] = number


async def _send(url: str, tokens: dict[str, str], per_second: float, seconds: float) -> list[float]:
    sent_s: dict[tuple[str, int], float] = {}
    delays: list[float] = []
    names, counts = [*tokens], dict.fromkeys(tokens, 0)
    async with httpx.AsyncClient(base_url=url, timeout=30.0) as client:
        watching = asyncio.ensure_future(_watch(client, sent_s, delays))
        await asyncio.sleep(2.0)
        begun, tasks, start_s = time.perf_counter(), [], time.time() - 3600.0
        for k in range(round(per_second * seconds)):
            await asyncio.sleep(max(begun + k / per_second - time.perf_counter(), 0.0))
            name = names[k % len(names)]
            counts[name] += 1
            message = {"utc": start_s + k / per_second, "speed": 50 + k % 7, "soc": 60.0, "power": 8.0}
            sent_s[name, counts[name]] = time.perf_counter()
            body = {"token": tokens[name], "tlm": message}
            tasks.append(asyncio.ensure_future(client.post("/v1/telemetry", json=body)))
        answers = await asyncio.gather(*tasks)
        assert {answer.status_code for answer in answers} == {200}
        await asyncio.sleep(3.0)
        watching.cancel()
    assert len(delays) == len(sent_s), f"{len(delays)} of {len(sent_s)} messages were shown"
    return delays


def rows(cars: int = 200, per_second: float = 50.0, seconds: float = 20.0) -> Iterator[Row]:
    """The delays of messages on one stream."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "cars")
        tokens = {f"van{k:03}": issue_token(folder / f"van{k:03}") for k in range(cars)}
        (Path(place) / "logs").mkdir()
        with serving(Path(place, "logs"), "--workers", "1", "--cars", f"{folder}") as service:
            delays = asyncio.run(_send(service.url, tokens, per_second, seconds))
    p50, p99 = np.quantile(delays, (0.5, 0.99)).tolist()
    shown = f"{len(delays)} messages of {cars} cars, {per_second:g} a second"
    yield Row("delay of an event, p50", p50, "s", note=shown)
    yield Row("delay of an event, p99", p99, "s", most=MAX_P99_S)


def main(cars: int = 200, per_second: float = 50.0, seconds: float = 20.0) -> int:
    """Print the rows; 1 where the bar is missed."""
    return report(rows(cars, per_second, seconds))


if __name__ == "__main__":
    run(main)
