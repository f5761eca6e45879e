"""Two years of a Leaf Spy user: 209 files of a day each, about 66 MB, with the dirt that such folders have."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tools.data.dirty_drives import (
    EPOCH,
    Car,
    Segment,
    TrueDrive,
    Truth,
    Window,
    sample_times,
    true_drive,
    windows,
)
from tools.data.dirty_tables import TABLES, Settings, leaf_spy_cells, leaf_spy_ours, same

FILES: Final = 209
DAYS: Final = 730
CELLS: Final = 96
STEPS: Final = (4.0, 4.0, 5.0, 5.0, 4.0, 6.0)
SETTINGS: Final = Settings(speed="mph", height="ft", temperature="degF", whole=True)

WIDER_ROWS: Final = 476
"""Rows that have the columns of the updated app below the header of the old one."""

NEW_COLUMNS: Final = ("V2L Pwr", "HeatPump", "Cabin Flap")
HEADLESS, EMPTY, CUT = 4, 2, 2
IMPOSSIBLE: Final = "203"

MIN_M, MIN_S = 1000.0, 120.0
"""A shorter drive is none that a careful person keeps."""

FAULTS: Final = (
    "temperature in °F",
    "speed in mph",
    "impossible temperature",
    "last row cut",
    "cells without a header",
    "columns added later",
    "no header",
    "charging stop",
    "short drives",
    "empty file",
    "header only",
)


@dataclass(frozen=True)
class Plan:
    """Which of the files are what, by their numbers."""

    empty: frozenset[int]
    header_only: int
    headless: frozenset[int]
    cut: frozenset[int]
    update: int
    impossible: int

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Plan:
        """Draw them; a file without header follows one that was not updated on the way and has rows."""
        update = int(rng.integers(90, 130))
        places = [int(k) for k in rng.permutation(np.arange(2, FILES - 2, 2)) if abs(int(k) - update) > 2]
        return cls(
            frozenset(places[:EMPTY]),
            places[EMPTY],
            frozenset(places[EMPTY + 1 : EMPTY + 1 + HEADLESS]),
            frozenset(places[10 : 10 + CUT]),
            update,
            places[15],
        )


@dataclass
class Owner:
    """Draws the days of the owner, one after the other."""

    rng: np.random.Generator
    car: Car
    drives: int = 0
    standing: int = 0
    kept: list[int] = field(default_factory=list)

    def day(self, date: dt.datetime, *, long: bool = False) -> Iterator[Segment]:
        """Drives of a day and the car that stands or is charged between them."""
        rng = self.rng
        season = -np.cos(2.0 * np.pi * (date.timetuple().tm_yday - 20) / 365.25)
        self.car.ambient_degc = float(np.clip(12.0 + 13.0 * season + rng.normal(0.0, 5.0), -10.0, 35.0))
        if not 0.4 < self.car.soc < 0.7:
            self.car.soc = 0.65
        t = (date - EPOCH).total_seconds() + float(rng.integers(6 * 3600, 12 * 3600))
        number = 4 if long else int(rng.integers(1, 5))
        for k in range(number):
            if rng.random() < 0.5:
                yield (before := self._stand(t, float(rng.uniform(30.0, 180.0)), 1.0))
                t = _after(before)
            yield (drive := self._drive(t, short=not long and rng.random() < 0.15))
            t = _after(drive)
            if k + 1 < number and rng.random() < 0.3:
                yield (charge := self._stand(t, float(rng.uniform(330.0, 1200.0)), -16.0))
                t = _after(charge)
            else:
                t += float(rng.integers(900, 7200))

    def _drive(self, t: float, *, short: bool) -> Segment:
        found = _errands() if short else windows(240, 1350)
        window = found[int(self.rng.integers(len(found)))]
        times = sample_times(self.rng, len(window.speed) - 1.0, STEPS)
        rows = self.car.drive(window, t, times, float(self.rng.uniform(0.0, 6.0)))
        number, self.drives = self.drives, self.drives + 1
        return Segment(rows.assign(drive=number, instant=np.arange(len(rows))), number)

    def _stand(self, t: float, duration_s: float, current: float) -> Segment:
        rows = self.car.stand(t, sample_times(self.rng, duration_s, STEPS), current)
        return Segment(rows.assign(drive=-1, instant=np.arange(len(rows))), -1)


def _after(segment: Segment) -> float:
    return float(segment.rows["t"].iloc[-1]) + 5.0


@cache
def _errands() -> list[Window]:
    return [window for window in windows(40, 200, 200.0) if window.length_m < 0.9 * MIN_M]


@cache
def _voltages(level: int, pattern: int) -> str:
    """The voltages of all cells [mV], joined: they differ by a pattern."""
    return ",".join(str(level + (k * (7 + 2 * pattern)) % 17) for k in range(1, CELLS + 1))


def _lines(rng: np.random.Generator, segments: list[Segment]) -> tuple[list[str], list[str]]:
    """Header and lines of a file."""
    d = pd.concat([segment.rows for segment in segments], ignore_index=True)
    levels = (3500.0 + 600.0 * d["soc"] - 0.4 * d["i"]).astype(int).tolist()
    patterns = rng.integers(0, 4, len(d)).tolist()
    joined = [_voltages(level, pattern) for level, pattern in zip(levels, patterns, strict=True)]
    cells = leaf_spy_cells(d, SETTINGS, {"cells": joined}) | {"AHr": same(d, "601234")}
    header = [
        name
        for key in cells
        for name in ([f"CP{k}" for k in range(1, CELLS + 1)] if key == "cells" else [key])
    ]
    return header, list(map(",".join, zip(*cells.values(), strict=True)))


def _spoiled(lines: list[str], header: list[str], rng: np.random.Generator) -> None:
    """Write an impossible outside temperature into one cell."""
    place = int(rng.integers(10, len(lines) - 10))
    cells = lines[place].split(",")
    cells[header.index("Ambient")] = IMPOSSIBLE
    lines[place] = ",".join(cells)


def write_leaf_spy_owner(folder: Path, seed: int = 0) -> Truth:
    """Write the folder of a Leaf Spy user over two years. O(rows x columns).

    Whole °F, mph and feet; a file a day with one to four drives, standing and charging between; four files without a
    header; an update of the app in the middle of a day, whose three new columns are in the headers of later files; an
    impossible outside temperature; two empty files, one with only a header, and two that end in the middle of a line.

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    seed : int
        Folders of equal seed are equal to the last byte.

    Returns
    -------
    Truth
        Drives of more than a kilometre and two minutes, and what the columns are.
    """
    rng = np.random.default_rng([seed, FILES])
    plan = Plan.drawn(rng)
    owner = Owner(rng, Car(52.1, 5.2, 31_000.0, 0.65, 12.0))
    folder.mkdir(parents=True, exist_ok=True)
    ours, drives, bad_files = leaf_spy_ours(SETTINGS), [], []
    sound = standing = 0
    for number, day in enumerate(np.sort(rng.choice(DAYS, FILES, replace=False)).tolist()):
        date = dt.datetime(2022, 4, 1) + dt.timedelta(days=day)
        name = f"Log_U0000000_{date:%y%m%d}_0a1b2.csv"
        segments = list(owner.day(date, long=number == plan.update))
        content, usable = _content(plan, rng, number, segments)
        (folder / name).write_bytes(content)
        if not usable:
            bad_files.append(name)
            continue
        kept = [true_drive([name], s.rows, list(ours)) for s in segments if s.drive >= 0]
        kept = [drive for drive in kept if drive.distance_m > MIN_M and drive.duration_s > MIN_S]
        drives += kept
        in_drives = sum(len(drive.samples) for drive in kept)
        sound += in_drives
        standing += sum(len(segment.rows) for segment in segments) - in_drives
        if number in plan.cut:
            last = true_drive([name], segments[-1].rows, [])
            in_kept = last.distance_m > MIN_M and last.duration_s > MIN_S
            sound, standing = sound - in_kept, standing - (not in_kept)
    return _truth(drives, (sound, standing), bad_files)


def _truth(drives: list[TrueDrive], rows: tuple[int, int], bad_files: list[str]) -> Truth:
    table, ours = TABLES["leaf_spy"], leaf_spy_ours(SETTINGS)
    return Truth(
        "leaf_spy",
        tuple(drives),
        rows[0],
        FAULTS,
        tuple(bad_files),
        ours,
        table.also,
        rows[1],
        "discharge",
        table.stamp,
    )


def _content(
    plan: Plan, rng: np.random.Generator, number: int, segments: list[Segment]
) -> tuple[bytes, bool]:
    """What is in a file, and whether it has rows."""
    if number in plan.empty:
        return b"", False
    header, lines = _lines(rng, segments)
    if number == plan.impossible:
        _spoiled(lines, header, rng)
    more = ",0,1,0"
    if number == plan.update:
        lines = lines[:-WIDER_ROWS] + [line + more for line in lines[-WIDER_ROWS:]]
    elif number > plan.update:
        header, lines = [*header, *NEW_COLUMNS], [line + more for line in lines]
    head = ",".join(header) + "\n"
    if number == plan.header_only:
        return head.encode(), False
    text = ("" if number in plan.headless else head) + "\n".join(lines) + "\n"
    if number in plan.cut:
        text = text[: -int(rng.integers(200, 500))]
    return text.encode(), True
