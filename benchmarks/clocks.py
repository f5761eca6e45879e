"""Clocks and restarts of cars on the road: python -m benchmarks.clocks [--trips N] [--only FAULT] [--seed N].

For each fault of `FAULTS`, one car drives the TUM trips of the reference, one after the other, for 24 hours: it stands before and after each,
sends a message a second, and the fault happens in the middle of every trip. The service is killed and started again at a seeded
moment of every trip, and of every other one within four messages of the fault. What was acknowledged as counted is compared with the finished trips.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final
from unittest import mock

import numpy as np
import pandas as pd
from tests.server.cars.messages import NOON_S, abrp_messages, measured
from tools import DATA
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.errors import InvalidInput
from tripwatt.server.cars import sender
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.live_trip import MOVING_M_S
from tripwatt.server.cars.telemetry import sample_from_abrp
from tripwatt.sources.tum import REFERENCE_TRIPS
from tripwatt.units import SECONDS_PER_DAY

HOUR_S: Final = 3600.0
DAY_S: Final = SECONDS_PER_DAY
BEFORE_S, AFTER_S, SILENT_S = 150, 320, 900.0
"""A car sends for so long before and after a trip, and is then silent [s]."""
LOOK_S: Final = 30.0
"""The service looks for silent cars so often [s]."""
DELAY_S: Final = 1.5
"""Longest delay of a message on its way [s]."""
BACKLOG_S: Final = 480.0
"""Time without a network [s]; what was not sent is sent beside the new messages, `BACKLOG_RATE` for each."""
BACKLOG_RATE: Final = 4
DRIFT: Final = 200e-6
TAG: Final = "cabin_temp"
"""Field by which a message is known again in the table of a trip: a number of its own for each message of a trip."""
TAG_STEP: Final = 1e-3

FAULTS: Final = (
    "server an hour slow",
    "server an hour fast",
    "server set forward by an hour",
    "server set back by an hour",
    "sender an hour back (summer time ends)",
    "one stamp a day later",
    "one stamp half an hour earlier",
    "sender drifts by 200 ppm",
    "sender at 2000-01-01 after its start, then set",
    "backlog beside new messages",
    "milliseconds in place of seconds",
    "stamps in local time, over a border",
)


@dataclass
class Tally:
    """What became of the messages between the first and the last motion of all trips."""

    sent: int = 0
    answers: Counter[str] = field(default_factory=Counter)
    in_trips: int = 0
    lost: int = 0
    told: int = 0
    disordered: int = 0
    split: int = 0
    joined: int = 0
    two_senders: int = 0


@dataclass(frozen=True)
class Sent:
    """A message: when it is sent and when it comes, by a right clock, and its content; `tag` is -1 outside of the motion."""

    at_s: float
    comes_s: float
    message: Mapping[str, Any]
    tag: int


def stamp(fault: str, at_s: float, since_s: float, middle_s: float, tag: int) -> float:
    """What the sender's clock shows at a time, so long after the car was switched on; the fault is in the middle of the trip."""
    later = since_s >= middle_s
    match FAULTS.index(fault):
        case 4:
            return at_s - HOUR_S * later
        case 5:
            return at_s + DAY_S * (tag == int(middle_s))
        case 6:
            return at_s - 0.5 * HOUR_S * (tag == int(middle_s))
        case 7:
            return at_s + DRIFT * (at_s - NOON_S)
        case 8:
            return at_s if later else 946_684_800.0 + since_s
        case 10:
            return 1000.0 * at_s if later else at_s
        case 11:
            return at_s + HOUR_S * (1 + later)
    return at_s


def messages(table: pd.DataFrame, start_s: float, fault: str, draw: random.Random) -> list[Sent]:
    """All messages of a trip, with the standstill around it, in the order in which they come."""
    moving = np.flatnonzero(table["speed_m_s"].to_numpy() >= MOVING_M_S)
    first, last = int(moving[0]), int(moving[-1])
    content = list(abrp_messages(table, 0.0))
    still = {**content[0], "speed": 0.0, "power": 0.3}
    parts = [
        *((-float(k), still, -1) for k in range(BEFORE_S, 0, -1)),
        *((m["utc"], m, k if first <= k <= last else -1) for k, m in enumerate(content)),
        *(
            (content[-1]["utc"] + k, {**content[-1], "speed": 0.0, "power": 0.3}, -1)
            for k in range(1, AFTER_S)
        ),
    ]
    middle_s = 0.5 * (content[first]["utc"] + content[last]["utc"]) + BEFORE_S
    made, queue = [], []
    for since_s, message, tag in parts:
        at_s = start_s + since_s
        shown = {**message, "utc": stamp(fault, at_s, since_s + BEFORE_S, middle_s, tag), TAG: TAG_STEP * tag}
        comes_s = at_s + draw.uniform(0.0, DELAY_S)
        made.append(Sent(at_s, comes_s, shown, tag))
    if fault == FAULTS[9]:
        gone = [one for one in made if 0.0 <= one.at_s - start_s - middle_s + BEFORE_S < BACKLOG_S]
        after = [one for one in made if gone and one.at_s > gone[-1].at_s]
        slots = [one.comes_s for one in after for _ in range(BACKLOG_RATE)]
        slots += [slots[-1]] * max(0, len(gone) - len(slots)) if slots else []
        queue = [Sent(g.at_s, c, g.message, g.tag) for g, c in zip(gone, slots, strict=False)]
        made = [one for one in made if one not in gone]
    return sorted([*made, *queue], key=lambda one: one.comes_s)


def server_error_s(fault: str, since_s: float, middle_s: float) -> float:
    """How much the clock of the server is ahead."""
    return {
        FAULTS[0]: -HOUR_S,
        FAULTS[1]: HOUR_S,
        FAULTS[2]: HOUR_S * (since_s >= middle_s),
        FAULTS[3]: -HOUR_S * (since_s >= middle_s),
    }.get(fault, 0.0)


class Machine:
    """A machine with a service that follows one car: its clocks, and kills of its process."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.true_s, self.error_s = NOON_S, 0.0
        clocks = SimpleNamespace(time=lambda: self.true_s + self.error_s, monotonic=lambda: self.true_s)
        self._patch = mock.patch.object(sender, "time", clocks)
        self._patch.start()
        self.car = Car.follow(folder)

    def restart(self) -> None:
        """Kill the process and start it again; nothing is written by the one that ends."""
        self.car.close()
        self.car = Car.follow(self.folder)

    def wait_until(self, true_s: float) -> None:
        """Look for a silent car every `LOOK_S` meanwhile."""
        while true_s - self.true_s > LOOK_S:
            self.true_s += LOOK_S
            self.car.end_when_silent(self.car.now_s())
        self.true_s = max(self.true_s, true_s)

    def close(self) -> None:
        self.car.close()
        self._patch.stop()


def drive(
    machine: Machine, table: pd.DataFrame, start_s: float, fault: str, draw: random.Random, tally: Tally
) -> None:
    """Drive a trip, and compare what was acknowledged with what was finished."""
    sent = messages(table, start_s, fault, draw)
    known = {log.trip_id for log in machine.car.logs()}
    middle = len(sent) // 2
    restarts = {draw.randrange(len(sent)), middle + draw.randrange(4) if draw.random() < 0.5 else -1}
    middle_s = sent[middle].comes_s
    answers: dict[int, str] = {}
    for k, one in enumerate(sent):
        machine.wait_until(one.comes_s)
        machine.error_s = server_error_s(fault, one.comes_s, middle_s)
        if k in restarts:
            machine.restart()
        try:
            answer: str = machine.car.record(sample_from_abrp(one.message))
        except InvalidInput:
            answer = "refused"
        if one.tag >= 0:
            answers[one.tag] = answer
    tally.two_senders += bool(machine.car.mixed(machine.car.now_s()))
    machine.wait_until(sent[-1].comes_s + SILENT_S)
    machine.error_s = server_error_s(fault, 0.0, math.inf)
    tally.sent += len(answers)
    tally.answers.update(answers.values())
    new = [log for log in machine.car.logs() if log.trip_id not in known]
    tables = [np.rint(log.samples["cabin_temperature_degc"] / TAG_STEP).astype(int) for log in new]
    tally.split += max(len(new) - 1, 0)
    tally.joined += not new
    there = Counter(tag for tagged in tables for tag in tagged if tag >= 0)
    tally.in_trips += sum(there.values())
    speeds = table["speed_m_s"].to_numpy()
    counted = {tag for tag, answer in answers.items() if answer == "new" or there[tag]}
    # what follows the last motion that counted is no part of a trip
    last = max((tag for tag in counted if speeds[tag] >= MOVING_M_S), default=-1)
    tally.lost += sum(not there[tag] for tag in counted if tag <= last)
    tally.told += sum(not there[tag] for tag in answers if tag not in counted)
    tally.disordered += sum(int((np.diff(tagged[tagged >= 0]) < 0).sum()) for tagged in tables)
    tally.joined += sum(number > 1 for number in there.values())


def replayed(tables: Sequence[pd.DataFrame], fault: str, seed: int = 0) -> Tally:
    """A car that drives all trips with one fault."""
    draw, tally, start_s = random.Random(f"{seed} {fault}"), Tally(), NOON_S
    with tempfile.TemporaryDirectory() as place:
        machine = Machine(Path(place) / "car")
        try:
            for table in tables:
                start_s = max(start_s, machine.true_s) + BEFORE_S + 1.0
                drive(machine, table, start_s, fault, draw, tally)
        finally:
            machine.close()
    return tally


def tables_of(folder: Path, most: int) -> list[pd.DataFrame]:
    """What the trips send, once a second, timed from their start."""
    trips = [
        t
        for t in tw.read_trips(folder / "tum", "tum")
        if t.trip_id in REFERENCE_TRIPS and t.observed_energy_wh
    ]
    tables = [measured(trip.samples) for trip in trips[:most]]
    return [t.assign(time_s=t["time_s"] - t["time_s"].iloc[0]) for t in tables]


def rows(
    data: Path = DATA, trips: int = len(REFERENCE_TRIPS), only: str | None = None, seed: int = 0
) -> Iterator[Row]:
    """A row for what is wrong with each fault; the table of all figures goes to the error stream."""
    tables = tables_of(data, trips)
    for fault in FAULTS:
        if only is not None and only not in fault:
            continue
        t = replayed(tables, fault, seed)
        answers = ", ".join(f"{n} {name}" for name, n in sorted(t.answers.items()))
        print(
            f"{fault}: {t.sent} sent ({answers}), {t.in_trips} in {len(tables)} trips, {t.disordered} out of order",
            file=sys.stderr,
        )
        yield Row(f"{fault}: acknowledged messages in no trip, of {t.sent}", float(t.lost), most=0)
        yield Row(f"{fault}: messages that were answered as not counted", float(t.told))
        yield Row(f"{fault}: trips after which two senders are told", float(t.two_senders), most=0)
        yield Row(
            f"{fault}: trips that were split or joined, of {len(tables)}", float(t.split + t.joined), most=0
        )


def main(data: Path = DATA, trips: int = len(REFERENCE_TRIPS), only: str | None = None, seed: int = 0) -> int:
    """Print the rows; 1 when a bound is missed."""
    return report(rows(data, trips, only, seed))


if __name__ == "__main__":
    run(main)
