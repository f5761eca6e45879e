"""Folders of dirty logs as owners' loggers write them: python -m benchmarks.dirty_logs [--number N].

Each seeded folder of `tools.data.dirty_logs` is read without a mapping and beside its truth: rows kept of those that are sound,
columns that are not what they are called, folders that are refused. Read strictly, each folder has to be refused with its faults
listed. Drives with dirt that changes the meaning of numbers (`tools.data.dirty_kinds`) give their energy or are refused. The folder
of a Leaf Spy user (209 files, two years) is learned by one command.
"""

from __future__ import annotations

import contextlib
import io
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tools.command import run
from tools.data.dirty_kinds import READABLE, UNREADABLE, write_spoilt
from tools.data.dirty_logs import FORMATS, Truth, write_dirty_folder, write_leaf_spy_owner

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.errors import InvalidInput
from tripwatt.trips import COLUMNS, TripSet
from tripwatt.vehicles import load_vehicle

FOLDERS = 400
CAR = "nissan_leaf_40"
MOVING_M_S = 1.0
SMALLEST = dict.fromkeys(COLUMNS, 0.0) | {
    "elevation_m": 60.0,
    "speed_m_s": 1.5,
    "soc": 0.05,
    "displayed_soc": 0.05,
    **dict.fromkeys(("heating_power_w", "aircon_power_w", "climate_power_w"), 400.0),
    **dict.fromkeys([name for name in COLUMNS if name.endswith("_degc")], 6.0),
}
"""A column of another kind or unit is further from the truth than its range, and than this."""


HARMLESS = frozenset(
    ("temperature in °F", "speed in mph", "date and time apart", "day first", "month first", "ambiguous dates", "units row", "latin-1",
     "byte order mark", "utf-16", "crlf", "quoted cells", "blank lines", "trailing delimiters", "title line", "sep line", "xlsx",
     "newest first", "empty cells", "text note", "charging stop", "several drives", "drive over two files", "columns added later",
     "clock set forward", "decimal comma", "repeated header"),
)  # fmt: skip
"""Ways of writing that a strict reader may understand."""


class Outcome(NamedTuple):
    """What reading one folder gave."""

    refused: str
    rows: int
    sound: int
    wrong: tuple[str, ...]
    strict_faults: int
    is_harmless: bool
    seconds: float


def typical(values: np.ndarray) -> np.ndarray:
    """Quartiles of what is known."""
    known = values[np.isfinite(values)]
    return np.quantile(known, [0.25, 0.5, 0.75]) if len(known) else np.full(3, np.nan)


def wrong_columns(fleet: TripSet, truth: Truth) -> Iterator[str]:
    """Our columns whose values are not those of the drives, and the measured energy where it is another one."""
    for ours in COLUMNS:
        there = [log.array(ours) for log in fleet.logs if log.has(ours)]
        if ours in ("time_s", "current_a", "voltage_v") or not there:
            continue
        own = [d.samples[ours].to_numpy() for d in truth.drives if ours in d.samples]
        if not own:
            yield f"{ours} is none"
            continue
        moving = [d.samples["speed_m_s"].to_numpy() > MOVING_M_S for d in truth.drives if ours in d.samples]
        known = typical(np.concatenate([x[rows] for x, rows in zip(own, moving, strict=True)]))
        seen = [log.array("speed_m_s") > MOVING_M_S for log in fleet.logs if log.has(ours)]
        read = typical(np.concatenate([x[rows] for x, rows in zip(there, seen, strict=True)]))
        reach = max(known[2] - known[0], SMALLEST[ours], 0.1 * abs(known[1]))
        if float(np.min(np.abs(read - known))) > reach:
            yield f"{ours} {read} {known}"
    for ours in ("speed_m_s", *truth.columns):
        if ours in COLUMNS and ours not in ("time_s",) and not any(log.has(ours) for log in fleet.logs):
            yield f"{ours} is missing"
    own_wh = sum(d.energy_wh for d in truth.drives)
    took = sum(t.observed_energy_wh or 0.0 for t in tw.audit(fleet).trips)
    measured = {"current_a", "battery_power_w"} & set(truth.columns)
    if measured and not 0.75 < took / own_wh < 1.25:
        yield f"energy {took:.0f} {own_wh:.0f}"


def outcome(folder: Path, logger: str, seed: int) -> Outcome:
    """Write and read one folder."""
    truth = write_dirty_folder(folder, logger, seed)
    # positions beside the drives have no drive in TeslaMate's table
    sound = truth.sound_rows + (0 if logger == "teslamate" else truth.standing_rows)
    faults, harmless = (
        0,
        set(truth.faults) <= HARMLESS | ({"rows out of order"} if logger == "car_scanner" else set()),
    )
    try:
        tw.read_logs(folder, "table", logger if logger != "plain" else None, strict=True)
    except InvalidInput as error:
        faults = len(error.faults)
    start = time.perf_counter()
    try:
        fleet = tw.read_logs(folder, "table", car=load_vehicle(CAR))
    except InvalidInput as error:
        return Outcome(f"{error}"[:300], 0, sound, (), faults, harmless, 0.0)
    seconds = time.perf_counter() - start
    rows = sum(len(log) for log in fleet.logs)
    return Outcome("", min(rows, sound), sound, tuple(wrong_columns(fleet, truth)), faults, harmless, seconds)


def folders(number: int, first: int = 0) -> Iterator[tuple[str, int, Outcome]]:
    """Outcomes of so many folders, the formats in turn."""
    for k in range(first, first + number):
        logger = FORMATS[k % len(FORMATS)]
        with tempfile.TemporaryDirectory() as place:
            yield logger, k // len(FORMATS), outcome(Path(place) / "logs", logger, k // len(FORMATS))


def folder_rows(number: int, first: int = 0, *, verbose: bool = False) -> Iterator[Row]:
    """The bars over many folders."""
    kept: Counter[str] = Counter()
    sound: Counter[str] = Counter()
    wrong = refused = accepted = 0
    for logger, seed, its in folders(number, first):
        kept[logger] += its.rows
        sound[logger] += its.sound
        wrong += len(its.wrong)
        refused += bool(its.refused)
        accepted += its.strict_faults == 0 and not its.is_harmless
        if verbose and (
            its.wrong
            or its.refused
            or its.rows < 0.99 * its.sound
            or (its.strict_faults == 0 and not its.is_harmless)
        ):
            sys.stderr.write(f"{logger} {seed}: {its}\n")
    yield Row(f"{number} folders: sound rows kept", sum(kept.values()) / sum(sound.values()), "", least=0.99)
    for logger in kept:
        yield Row(f"{logger}: sound rows kept", kept[logger] / sound[logger], "", least=0.99)
    yield Row(f"{number} folders: wrong columns", wrong, "", most=0)
    yield Row(f"{number} folders: whole refusals", refused, "", most=0)
    yield Row(f"{number} folders: accepted strictly", accepted, "", most=0)


def verdict(file: Path, kind: str, seed: int) -> str:
    """What reading one drive with a kind of dirt gives: its energy is "read", it is "refused", or "wrong"."""
    vehicle = load_vehicle(CAR)
    drive = write_spoilt(file, kind, seed, vehicle)
    try:
        fleet = tw.read_logs(file, "table", car=vehicle)
    except InvalidInput:
        return "refused"
    trips = tw.audit(fleet).trips
    took = sum(trip.observed_energy_wh or 0.0 for trip in trips)
    # 0.05: largest error of an energy that counts as read
    if trips and abs(took / drive.energy_wh - 1.0) < 0.05:
        return "read"
    return "wrong" if trips else "refused"


def kind_rows(seeds: int, *, verbose: bool = False) -> Iterator[Row]:
    """The bars over drives with dirt that changes the meaning of numbers."""
    found: Counter[tuple[bool, str]] = Counter()
    for kind in (*READABLE, *UNREADABLE):
        for seed in range(seeds):
            with tempfile.TemporaryDirectory() as place:
                its = verdict(Path(place) / "logs" / "drive.csv", kind, seed)
            found[kind in READABLE, its] += 1
            if verbose and its != ("read" if kind in READABLE else "refused"):
                sys.stderr.write(f"{kind} {seed}: {its}\n")
    drives = seeds * (len(READABLE) + len(UNREADABLE))
    yield Row(f"{drives} drives: wrong energies", found[True, "wrong"] + found[False, "wrong"], "", most=0)
    read = found[True, "read"] / (seeds * len(READABLE))
    yield Row(f"{seeds * len(READABLE)} readable drives: energies read", read, "", least=0.99)


def owner_rows() -> Iterator[Row]:
    """The folder of a Leaf Spy user, by the command that its owner would type."""
    from typer.testing import CliRunner

    from tripwatt.command import app

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "logs"
        truth = write_leaf_spy_owner(folder)
        runner = CliRunner()
        runner.invoke(app, ["car", "new", f"{place}/leaf", "--car", CAR])
        start = time.perf_counter()
        with contextlib.redirect_stderr(io.StringIO()):
            result = runner.invoke(app, ["car", "add", f"{place}/leaf", f"{folder}"])
        seconds = time.perf_counter() - start
        own = tw.open_car(f"{place}/leaf")
        starts = [log.context.started_at for log in own.logs()]
        diary = own.diary.table
        sys.stderr.write(result.output[-3000:])
        kept = 0.0
        if len(diary):
            driven = float(diary["distance_m"].sum())
            kept = driven / sum(d.distance_m for d in truth.drives)
        yield Row(
            "owner's folder: share of the drives in the diary", len(diary) / len(truth.drives), "", least=0.95
        )
        yield Row("owner's folder: share of the way in the diary", kept, "", least=0.95)
        yield Row("owner's folder: logs", len(starts), "")
        yield Row("owner's folder: reading and learning", seconds, "s", most=60.0)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0**2
        yield Row("owner's folder: memory at its peak", peak, "GB", most=1.0)


def rows(number: int = FOLDERS) -> Iterator[Row]:
    """All rows."""
    yield from owner_rows()
    yield from folder_rows(number)
    yield from kind_rows(number // 16)


def main(number: int = FOLDERS, first: int = 0, owner: bool = True, verbose: bool = False) -> int:
    """Print the rows; 1 when a bound is missed."""
    mine = owner_rows() if owner else ()
    kinds = kind_rows(number // 16, verbose=verbose)
    return report([*mine, *folder_rows(number, first, verbose=verbose), *kinds])


if __name__ == "__main__":
    run(main)
