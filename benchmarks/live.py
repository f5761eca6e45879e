"""Cars on the road: python -m benchmarks.live [--message] [--trips N] [--cars N] [--seconds S].

With `--message`: milliseconds that a message costs in this process after an hour of a trip, from its JSON to that of the answer.

TUM trips at 1 Hz are sent to a running service, each by a car of its own. Printed are the largest difference of the last
forecasts to `update` on the same samples, the same after the service was killed in the middle of all trips, the same over a broker
(MQTT) with lost, late and doubled messages and with a broker that is killed, the coverage of
90 % intervals on the way where a fifth of the messages each is lost, late or doubled (models that have not seen the trip), and
the lag of many cars that send every 2 s.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pandas as pd
from tests.server.cars.brokers import MOSQUITTO, Sent, replay
from tests.server.cars.messages import (
    NOON,
    NOON_S,
    abrp_messages,
    measured,
    over_a_bad_connection,
    samples_of,
)
from tests.support.drives import example_trip
from tests.support.service_process import Service, serving
from tools import DATA
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, not_measured, report
from tripwatt.forecasting import Forecast
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import issue_token
from tripwatt.server.cars.topics import TopicJoiner
from tripwatt.server.http.schemas import BMS_SOC
from tripwatt.sources.tum import REFERENCE_TRIPS
from tripwatt.trips import COLUMNS, Plan, Trip
from tripwatt.trips.samples import columns_of

FOLDS = 5
SHARES = (0.25, 0.5, 0.75)
AT_ONCE = 16
PERIOD_S = 2.0
HOUR_S = 3600
MESSAGES = 60
MAX_MS = 3.0


@dataclass(frozen=True)
class Drive:
    """A trip as a car sends it, once a second, with its time on the clock of its plan."""

    trip: Trip
    table: pd.DataFrame

    @classmethod
    def of(cls, trip: Trip) -> Drive:
        table = measured(trip.samples)
        return cls(trip, table.assign(time_s=table["time_s"] - trip.samples["time_s"].iloc[0]))

    @property
    def plan(self) -> dict[str, Any]:
        """The request with the whole speed trace, whose first samples are what is known of the departure."""
        samples = self.trip.samples
        step = max(1, round(len(samples) / 40_000))
        columns = {name: samples[name].iloc[::step] for name in samples.columns if name in COLUMNS}
        columns["time_s"] = columns["time_s"] - columns["time_s"].iloc[0]
        return {"samples": columns_of(pd.DataFrame(columns).rename(columns=BMS_SOC)), "departs_at": NOON}

    def at_departure(self) -> Forecast:
        """The forecast of the library at the departure."""
        return tw.forecast(
            Plan.from_samples(
                pd.DataFrame(self.plan["samples"], dtype=np.float64).rename(columns={"bms_soc": "soc"})
            )
        )

    def updated(self) -> Forecast:
        """The same, updated with all that was sent."""
        return self.at_departure().update(self.table)


async def each(work: Sequence[Any]) -> list[Any]:
    """All results, a few at once."""
    places = asyncio.Semaphore(AT_ONCE)

    async def one(task: Any) -> Any:
        async with places:
            return await task

    return list(await asyncio.gather(*map(one, work)))


def send(
    service: Service, tokens: Mapping[str, str], drives: Sequence[Drive], start: float, stop: float
) -> None:
    """Send a part of every drive."""

    async def drive_one(client: httpx.AsyncClient, drive: Drive) -> None:
        messages = list(abrp_messages(drive.table))
        for message in messages[int(start * len(messages)) : int(stop * len(messages))]:
            body = {"token": tokens[drive.trip.trip_id], "tlm": message}
            answer = await client.post("/v1/telemetry", json=body)
            assert answer.status_code == 200, answer.text

    async def run() -> None:
        async with httpx.AsyncClient(base_url=service.url, timeout=120.0) as client:
            await each([drive_one(client, drive) for drive in drives])

    asyncio.run(run())


def differences(service: Service, drives: Sequence[Drive]) -> list[float]:
    """Difference of the last forecast of each drive to that of the library [Wh]; infinite where samples are missing."""
    off = []
    for drive in drives:
        answer = service.client.get(f"/v1/live/{drive.trip.trip_id}").json()
        whole = answer["trip"] is not None and not answer["faults"]
        energy = answer["forecast"]["energy_wh"] if whole else np.inf
        off.append(abs(energy - drive.updated().energy_wh))
    return off


def replayed(drives: Sequence[Drive], *, killed: bool) -> list[float]:
    """Send all drives to a service, which is killed in the middle of them or not."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        tokens = {d.trip.trip_id: issue_token(folder / "cars" / d.trip.trip_id) for d in drives}
        more = ("--workers", "2", "--cars", f"{folder / 'cars'}", "--limit", "timeout_s=120")
        with serving(folder, *more) as service:
            for drive in drives:
                done = service.client.put(f"/v1/live/{drive.trip.trip_id}/plan", json=drive.plan)
                assert done.status_code == 200, done.text
            send(service, tokens, drives, 0.0, 0.5)
            if not killed:
                send(service, tokens, drives, 0.5, 1.0)
                return differences(service, drives)
            os.kill(service.process.pid, signal.SIGKILL)
            service.process.wait()
        with serving(folder, *more) as service:
            send(service, tokens, drives, 0.49, 1.0)  # what was sent last is sent again
            return differences(service, drives)


def over_mqtt(drives: Sequence[Drive]) -> Iterator[Row]:
    """Send all drives over a broker, with lost, late and doubled messages, and again with a broker that is killed in the middle."""
    if MOSQUITTO is None:
        yield not_measured("trips over MQTT", "no mosquitto")
        return
    sent = [Sent.from_table(d.trip.trip_id, d.table, len(d.table)) for d in drives]
    forecasts = {d.trip.trip_id: d.at_departure() for d in drives}
    for killed, text in ((False, "over MQTT"), (True, "over MQTT, broker killed")):
        with tempfile.TemporaryDirectory() as place:
            replays = replay(Path(place), sent, forecasts, killed=killed)
        worst = max(one.difference_wh for one in replays)
        yield Row(f"{text}: difference to update, largest of {len(replays)} trips", worst, "Wh", most=1e-6)
        for name in ("missing", "twice"):
            number = sum(getattr(one, name) for one in replays)
            yield Row(f"{text}: samples {name} in finished trips", float(number), most=0.0)


def covered(trips: Sequence[Trip], drives: Sequence[Drive]) -> tuple[float, float, int]:
    """Coverage on the way with a bad and with a sound connection, and the number of forecasts of each."""
    inside: dict[bool, list[bool]] = {True: [], False: []}
    order = np.random.default_rng(0).permutation(len(trips)) % FOLDS
    for fold in range(FOLDS):
        print(f"fold {fold + 1} of {FOLDS}", file=sys.stderr)
        seen = [trip for trip, f in zip(trips, order, strict=True) if f != fold]
        model = tw.fit(seen, "bmw_i3_60ah")
        for drive, f in zip(drives, order, strict=True):
            if f == fold:
                at_departure = model.forecast(drive.trip)
                for bad in (True, False):
                    inside[bad] += on_the_way(drive, at_departure, bad=bad)
    return float(np.mean(inside[True])), float(np.mean(inside[False])), len(inside[True])


def on_the_way(drive: Drive, at_departure: Forecast, *, bad: bool) -> list[bool]:
    """Whether the energy of a trip is inside of the 90 % interval, at parts of the way."""
    samples = samples_of(drive.table, NOON_S + float(drive.table["time_s"].iloc[0]))
    sent = over_a_bad_connection(samples, seed=len(samples)) if bad else samples
    took = drive.trip.observed_energy_wh
    assert took is not None
    inside = []
    with tempfile.TemporaryDirectory() as place, Car.follow(Path(place) / "car") as car:
        car.set_plan({}, NOON_S)
        marks = [int(share * len(sent)) for share in SHARES]
        for k, sample in enumerate(sent, start=1):
            car.record(sample)
            if k in marks:
                low, high = car.update(at_departure).interval(0.9)
                inside.append(low <= took <= high)
    return inside


def many_cars(cars: int, seconds: float) -> Iterator[Row]:
    """The lag of messages of many cars, each every 2 s, while four of them are listened to."""
    links = [{"length_m": 60_000.0, "speed_m_s": 20.0}]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        tokens = [issue_token(folder / "cars" / f"car{k}") for k in range(cars)]
        with serving(folder, "--workers", "1", "--cars", f"{folder / 'cars'}") as service:
            for k in range(cars):
                service.client.put(f"/v1/live/car{k}/plan", json={"links": links, "soc": 0.8})
            lags, memory = asyncio.run(_load(service, tokens, seconds))
            counted = sum(
                service.client.get(f"/v1/live/car{k}").json()["messages"]["new"] for k in range(cars)
            )
    yield Row(f"{cars} cars for {seconds:g} s: lag p99", float(np.percentile(lags, 99)), "s", most=1.0)
    yield Row(f"{cars} cars for {seconds:g} s: messages lost", float(len(lags) - counted), most=0.0)
    yield Row(
        f"{cars} cars for {seconds:g} s: memory, last fifth over second fifth",
        float(
            np.mean(memory[-len(memory) // 5 :]) / np.mean(memory[len(memory) // 5 : 2 * len(memory) // 5])
        ),
        most=1.1,
    )


async def _load(service: Service, tokens: Sequence[str], seconds: float) -> tuple[list[float], list[int]]:
    lags: list[float] = []
    memory: list[int] = []
    ends = time.monotonic() + seconds

    async def one(client: httpx.AsyncClient, token: str) -> None:
        draw = random.Random(token)
        due = time.monotonic() + draw.uniform(0.0, PERIOD_S)
        while due < ends:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            message = {
                "utc": round(time.time(), 3),
                "speed": 70.0,
                "power": draw.uniform(5.0, 20.0),
                "soc": 80.0,
            }
            done = await client.post("/v1/telemetry", json={"token": token, "tlm": message})
            assert done.status_code == 200, done.text
            lags.append(time.monotonic() - due)
            due += PERIOD_S

    async def listen(client: httpx.AsyncClient, car: int) -> None:
        async with client.stream("GET", f"/v1/live/car{car}/events") as stream:
            async for _ in stream.aiter_bytes():
                pass

    async def watch() -> None:
        while True:
            memory.append(service.resident_bytes())
            await asyncio.sleep(max(0.2, seconds / 100.0))

    limits = httpx.Limits(max_connections=len(tokens) + 10)
    async with httpx.AsyncClient(base_url=service.url, timeout=60.0, limits=limits) as client:
        beside = [
            asyncio.ensure_future(watch()),
            *(asyncio.ensure_future(listen(client, k)) for k in range(4)),
        ]
        await asyncio.gather(*(one(client, token) for token in tokens))
        for task in beside:
            task.cancel()
        await asyncio.gather(*beside, return_exceptions=True)
    return lags, memory


def one_message(links: list[dict[str, float]], text: str) -> Row:
    """Cost of one message after an hour of a trip, the best of many: read, ordered, forecast, and answered as JSON."""
    once = measured(example_trip())
    rounds = -(-(HOUR_S + MESSAGES) // len(once))
    parts = [once.assign(time_s=once["time_s"] + k * len(once)) for k in range(rounds)]
    table = pd.concat(parts, ignore_index=True).iloc[: HOUR_S + MESSAGES]
    table["displayed_soc"] = np.linspace(0.9, 0.55, len(table))
    messages = [json.dumps(message).encode() for message in abrp_messages(table)]
    joiner, model, times = TopicJoiner("abrp", "car"), tw.load_model(), []
    with tempfile.TemporaryDirectory() as place, Car.follow(Path(place) / "car", lambda _: model) as car:
        car.set_plan({"links": links})
        for k, message in enumerate(messages):
            start = time.thread_time()
            sample = joiner.take("car", message, NOON_S + k)
            assert sample is not None
            car.record(sample)
            if k >= HOUR_S:
                answer = json.dumps(car.document(NOON_S + k))
                times.append(time.thread_time() - start)
                assert json.loads(answer)["forecast"]["measured_until_s"] > HOUR_S / 2
    return Row(f"a message after 1 h, {text}: best of {MESSAGES}", 1000.0 * min(times), "ms", most=MAX_MS)


def message_rows() -> Iterator[Row]:
    """Costs of a message on a road of known and of unknown heights."""
    link = {"length_m": 250.0, "speed_m_s": 13.0}
    yield one_message([{**link, "grade": 0.0}] * 260, "heights known")
    yield one_message([link] * 260, "heights unknown")


def rows(most: int = len(REFERENCE_TRIPS), cars: int = 200, seconds: float = 600.0) -> Iterator[Row]:
    """All rows."""
    yield from message_rows()
    known = [
        t for t in tw.read_trips(DATA / "tum", "tum") if t.trip_id in REFERENCE_TRIPS and t.observed_energy_wh
    ]
    drives = [Drive.of(trip) for trip in known]
    for killed, text in ((False, "difference to update"), (True, "difference after kill -9")):
        off = replayed(drives[:most], killed=killed)
        yield Row(f"{text}, largest of {len(off)} trips", max(off), "Wh", most=1e-6)
    yield from over_mqtt(drives[:most])
    bad, sound, number = covered(known, drives)
    yield Row(f"coverage of 90 % with lost, late and doubled messages, {number} forecasts", bad, least=0.85)
    yield Row(f"coverage of 90 % with all messages, {number} forecasts", sound, least=0.85)
    yield from many_cars(cars, seconds)


def main(
    trips: int = len(REFERENCE_TRIPS), cars: int = 200, seconds: float = 600.0, message: bool = False
) -> int:
    """Send so many trips to a service; print the rows, 1 when a bound is missed. `--message`: the cost of one alone."""
    return report(message_rows() if message else rows(trips, cars, seconds))


if __name__ == "__main__":
    run(main)
