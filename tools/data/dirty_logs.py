"""Folders of dirty logs as owners' loggers write them, with the truth: ``python -m tools.data.dirty_logs FOLDER --logger leaf_spy``.

A folder has drives of one car (`dirty_drives`) in the table of one logger (`dirty_tables`). A seed chooses how the app is
set, how the files are written, and what is wrong in them: cells, rows, headers, clocks, whole files. Nothing that is
planted takes away what a careful person needs: fewer than one row in a hundred is bad.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tools.command import run
from tools.data.dirty_drives import EPOCH, Car, Segment, TrueDrive, Truth, sample_times, true_drive, windows
from tools.data.dirty_files import LogFile, Look, Row, file_bytes
from tools.data.dirty_tables import FORMATS, TABLES, Format, Settings, plain_names
from tools.data.leaf_spy_owner import write_leaf_spy_owner
from tripwatt.arrays import FloatArray

__all__ = ["FAULTS", "FORMATS", "TrueDrive", "Truth", "main", "write_dirty_folder", "write_leaf_spy_owner"]

CHANCE: Final = 0.22
"""Probability of each kind of dirt in a folder."""

SETTING_CHANCE: Final = 0.4
"""Probability of a setting that only plain tables or apps have."""

WORST_SHARE: Final = 0.008
"""Most bad rows of a folder."""

MIN_HALF_S, MIN_HALF_M = 122.0, 1020.0
"""Bounds of each half of a drive that is cut in two, by a file's end or by the clock."""

HOUR_S: Final = 3600.0
UNSET_CLOCKS: Final = (0.0, 946_684_800.0)
"""Clocks begin in 1970 or 2000."""

BAD_TEXTS: Final = ("n/a?", "ERR", "#VALUE!")
NEW_COLUMNS: Final = ("Wiper", "Fan level", "Seat heat")
EDGE: Final = 3
"""So many samples at both ends of a drive stay as they are."""

OFTEN: Final = (
    "temperature in °F", "speed in mph", "date and time apart", "day first", "month first", "ambiguous dates", "newest first",
    "units row",
)  # fmt: skip
SETTINGS_DIRT: Final = (
    "temperature in °F", "speed in mph", "date and time apart", "day first", "month first", "ambiguous dates", "units row",
    "decimal comma", "latin-1", "byte order mark", "utf-16", "crlf", "quoted cells", "blank lines", "trailing delimiters",
    "title line", "sep line", "xlsx", "newest first",
)  # fmt: skip
DRIVES_DIRT: Final = (
    "clock set back",
    "clock set forward",
    "unset clock",
    "charging stop",
    "drive over two files",
)
FILES_DIRT: Final = ("same file twice", "empty file", "header only", "binary file", "text note")
STAMPS: Final = ("%Y-%m-%d %H:%M:%S", "", "%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S")


@dataclass
class Book:
    """A folder in the making."""

    rng: np.random.Generator
    table: Format
    settings: Settings
    look: Look
    wanted: frozenset[str]
    planted: set[str] = field(default_factory=set)
    files: list[LogFile] = field(default_factory=list)
    bad: set[tuple[int, int]] = field(default_factory=set)
    lengths: dict[int, int] = field(default_factory=dict)
    budget: int = 0

    def wants(self, fault: str) -> bool:
        """Whether the seed asks for a kind of dirt."""
        return fault in self.wanted

    def column(self, ours: str) -> str:
        """Name of one of our columns in the files."""
        return self.table.ours(self.settings)[ours][0]

    def a_file(self, fits: Callable[[LogFile], bool] = lambda file: True) -> LogFile | None:
        """Draw one of the files that fit."""
        fitting = [file for file in self.files if fits(file)]
        return fitting[int(self.rng.integers(len(fitting)))] if fitting else None

    def a_row(self, ours: str = "") -> tuple[LogFile, int, int] | None:
        """Draw a row inside of a drive that is still clean: its file, place, and the column of one of ours."""
        name = self.column(ours) if ours else ""
        for _ in range(60 if self.budget > 0 else 0):
            file = self.files[int(self.rng.integers(len(self.files)))]
            place = int(self.rng.integers(len(file.rows)))
            row = file.rows[place]
            drive, instant = row.key
            if drive < 0 or row.touched or not EDGE <= instant < self.lengths[drive] - EDGE:
                continue
            if self.table.long and name and row.cells[1] != name:
                continue
            row.touched = True
            self.budget -= 1
            return file, place, 2 if self.table.long else (file.header.index(name) if name else 0)
        return None


# Cells


def _put(book: Book, ours: str, text: str) -> bool:
    found = book.a_row(ours)
    if found is None:
        return False
    file, place, column = found
    file.rows[place].cells[column] = text
    if ours in book.table.needed:
        book.bad.add(file.rows[place].key)
    return True


def _some(book: Book, ours: Sequence[str], texts: Sequence[str]) -> bool:
    number = int(book.rng.integers(1, 4))
    done = [_put(book, str(book.rng.choice(ours)), str(book.rng.choice(texts))) for _ in range(number)]
    return any(done)


def _impossible_temperature(book: Book) -> bool:
    return _some(book, ["ambient_temperature_degc"], ["203"])


def _impossible_speed(book: Book) -> bool:
    return _some(book, ["speed_m_s"], ["65535"])


def _texts(book: Book) -> bool:
    return _some(book, [*book.table.needed, *book.table.spare], BAD_TEXTS)


def _empty_cells(book: Book) -> bool:
    return _some(book, [*book.table.needed, *book.table.spare], [""])


# Rows


def _cut(book: Book, row: Row) -> None:
    row.touched = True
    row.keep = int(book.rng.integers(1, len(row.cells)))
    book.bad.add(row.key)


def _cut_rows(book: Book) -> bool:
    found = [book.a_row() for _ in range(int(book.rng.integers(1, 3)))]
    for file, place, _ in (place for place in found if place):
        _cut(book, file.rows[place])
    return any(found)


def _last_row_cut(book: Book) -> bool:
    file = None if book.look.xlsx else book.a_file()
    if file is None or book.budget < 1 or file.rows[-1].touched:
        return False
    book.budget -= 1
    file.cut_end = True
    _cut(book, file.rows[-1])
    return True


def _same_time(book: Book) -> bool:
    found = book.a_row()
    if found:
        file, place, _ = found
        file.rows.insert(place, replace(file.rows[place], cells=list(file.rows[place].cells)))
    return bool(found)


def _out_of_order(book: Book) -> bool:
    file = book.a_file(lambda file: not file.shifted)
    if file is None or len(file.rows) < 60:
        return False
    size = int(book.rng.integers(4, 25))
    a = int(book.rng.integers(5, len(file.rows) - 2 * size - 5))
    b, c = a + size, a + 2 * size
    file.rows[a:c] = file.rows[b:c] + file.rows[a:b]
    return True


# Headers


def _wider(book: Book, rows: Sequence[Row], number: int) -> None:
    values = [str(int(value)) for value in book.rng.integers(0, 9, number)]
    for row in rows:
        row.cells.extend(values)


def _middle_place(book: Book, file: LogFile) -> int:
    return int(book.rng.integers(len(file.rows) // 4, 3 * len(file.rows) // 4))


def _cells_without_header(book: Book) -> bool:
    """The app is updated while it logs; the headers of later files know the new columns."""
    file = None if book.look.trailing else book.a_file()
    if file is None:
        return False
    number = int(book.rng.integers(1, len(NEW_COLUMNS) + 1))
    _wider(book, file.rows[_middle_place(book, file) :], number)
    file.last_header = None
    later = book.files[book.files.index(file) + 1 :]
    for other in later:
        _wider(book, other.rows, number)
        other.header = other.last_header = [*other.header, *NEW_COLUMNS[:number]]
    if later:
        book.planted.add("columns added later")
    return True


def _columns_added(book: Book) -> bool:
    if book.files[-1].last_header != book.files[0].header:
        return False
    for file in book.files[int(book.rng.integers(1, len(book.files))) :]:
        _wider(book, file.rows, 1)
        file.header = file.last_header = [*file.header, NEW_COLUMNS[0]]
    return True


def _new_header(book: Book) -> bool:
    file = book.a_file(lambda file: file.last_header == file.header)
    if file is None:
        return False
    place = _middle_place(book, file)
    header = [*file.header, f"{NEW_COLUMNS[-1]} 2"]
    _wider(book, file.rows[place:], 1)
    file.rows.insert(place, Row(header, (-3, 0), header=True))
    file.last_header = header
    return True


def _columns_reordered(book: Book) -> bool:
    file = book.a_file(lambda file: file.last_header == file.header)
    if file is None:
        return False
    place = _middle_place(book, file)
    order = [int(k) for k in book.rng.permutation(len(file.header))]
    header = [file.header[k] for k in order]
    for row in file.rows[place:]:
        row.cells = [row.cells[k] for k in order]
    file.rows.insert(place, Row(header, (-3, 0), header=True))
    file.last_header = header
    return True


def _repeated_header(book: Book) -> bool:
    file = book.a_file(lambda file: file.last_header == file.header)
    if file is None:
        return False
    for _ in range(int(book.rng.integers(1, 3))):
        file.rows.insert(_middle_place(book, file), Row(file.header, (-3, 0), header=True))
    return True


def _no_header(book: Book) -> bool:
    if book.look.xlsx:
        return False
    pairs = zip(book.files[:-1], book.files[1:], strict=True)
    fitting = [file for before, file in pairs if before.last_header == file.header]
    for file in fitting[: int(book.rng.integers(1, 3))]:
        file.headed = False
    return bool(fitting)


ROW_DIRT: Final[dict[str, Callable[[Book], bool]]] = {
    "impossible temperature": _impossible_temperature,
    "impossible speed": _impossible_speed,
    "text in a cell": _texts,
    "empty cells": _empty_cells,
    "cut rows": _cut_rows,
    "last row cut": _last_row_cut,
    "rows out of order": _out_of_order,
    "same time twice": _same_time,
    "cells without a header": _cells_without_header,
    "columns added later": _columns_added,
    "new header in the middle": _new_header,
    "columns reordered": _columns_reordered,
    "repeated header": _repeated_header,
    "no header": _no_header,
}

FAULTS: Final = (*SETTINGS_DIRT, *DRIVES_DIRT, *ROW_DIRT, *FILES_DIRT)
"""Kinds of dirt."""


# How the app is set and how files are written


def _settings(logger: str, rng: np.random.Generator, faults: frozenset[str]) -> Settings:
    variant = int(rng.integers(6))
    whole_numbers = bool(rng.integers(2)) and logger == "leaf_spy"
    fahrenheit = "degF" if "temperature in °F" in faults else "degC"
    mph = "mph" if "speed in mph" in faults else "km/h"
    base = Settings(whole=whole_numbers, variant=variant % 2)
    if logger in ("leaf_spy", "car_scanner"):
        return replace(
            base, temperature=fahrenheit, speed=mph, height="ft" if mph == "mph" else "m", whole=whole_numbers
        )
    if logger == "torque":
        return replace(base, temperature=fahrenheit, speed=mph)
    if logger != "plain":
        return base
    day, month = "day first" in faults, "month first" in faults
    dots = bool(rng.integers(2))
    stamp = STAMPS[3] if month else STAMPS[4 if dots else 2] if day else STAMPS[int(rng.integers(2))]
    return Settings(
        mph if mph == "mph" or rng.random() < 0.8 else "m/s",
        "ft" if mph == "mph" else "m",
        fahrenheit,
        variant=variant,
        stamp=stamp,
        split_stamp=bool(stamp) and "date and time apart" in faults,
        charge_positive=bool(rng.integers(2)),
        units_row="units row" in faults,
    )


def _settings_faults(settings: Settings, logger: str) -> set[str]:
    plain = logger == "plain"
    month = settings.stamp.startswith("%m")
    day = settings.stamp.startswith("%d")
    planted = {
        "temperature in °F": settings.temperature == "degF",
        "speed in mph": settings.speed == "mph",
        "date and time apart": settings.split_stamp,
        "day first": plain and day,
        "month first": plain and month,
        "units row": settings.units_row,
    }
    return {name for name, is_planted in planted.items() if is_planted}


def _look(logger: str, rng: np.random.Generator, faults: frozenset[str]) -> Look:
    """How the files are written. Words that exclude each other give way to the first of them."""
    xlsx = logger == "plain" and "xlsx" in faults
    comma = "decimal comma" in faults
    delimiter = ";" if logger == "car_scanner" or (comma and rng.random() < 0.6) else ","
    if logger == "plain":
        delimiter = str(rng.choice([",", ";", "\t"]))
    encoding = next((name for name in ("utf-16", "latin-1", "byte order mark") if name in faults), "utf-8")
    top = "title line" if "title line" in faults else ""
    if xlsx:
        return Look(top=top, wide_title=bool(rng.integers(2)), xlsx=True)
    if not top and "sep line" in faults and delimiter != "\t":
        top = "sep line"
    quoted = "quoted cells" in faults or (logger == "car_scanner" and rng.random() < 0.5)
    return Look(
        delimiter,
        "," if comma else ".",
        encoding,
        "\r\n" if "crlf" in faults else "\n",
        quoted,
        "trailing delimiters" in faults,
        "blank lines" in faults,
        top,
        bool(rng.integers(2)),
    )


def _look_faults(look: Look) -> set[str]:
    planted = {
        "decimal comma": look.decimal == ",",
        "crlf": look.newline == "\r\n",
        "quoted cells": look.quoted,
        "trailing delimiters": look.trailing,
        "blank lines": look.blank,
        "xlsx": look.xlsx,
    }
    return {name for name, is_planted in planted.items() if is_planted} | (
        {look.encoding, look.top} & set(FAULTS)
    )


# The drives of the files


def _days(rng: np.random.Generator, number: int, *, ambiguous: bool) -> list[dt.datetime]:
    """Days of the files; either one of them is after the 12th, or all are consecutive and none is."""
    month = dt.datetime(int(rng.integers(2021, 2025)), int(rng.integers(1, 13)), 1)
    if ambiguous:
        first = int(rng.integers(1, 14 - number))
        return [month.replace(day=first + k) for k in range(number)]
    steps = np.append(int(rng.integers(4, 20)), rng.integers(1, 3, number - 1))
    days = [month + dt.timedelta(days=int(k)) for k in np.cumsum(steps)]
    late = max(day.day for day in days) > 12
    return days if late else [day + dt.timedelta(days=10) for day in days]


def _middle(rows: pd.DataFrame) -> int | None:
    """Where a drive can be cut so that both halves are long enough, None where it cannot."""
    time = rows["t"].to_numpy() - float(rows["t"].iloc[0])
    way = 1000.0 * (rows["odometer"].to_numpy() - float(rows["odometer"].iloc[0]))
    fits = (time >= MIN_HALF_S) & (time[-1] - time >= MIN_HALF_S)
    fits &= (way >= MIN_HALF_M) & (way[-1] - way >= MIN_HALF_M)
    places = np.flatnonzero(fits)
    return int(places[len(places) // 2]) if len(places) else None


@dataclass
class Calendar:
    """Draws the drives of a folder, one file after the other."""

    book: Book
    car: Car
    drives: int = 0
    standing: int = 0
    shift_s: float = 0.0
    split: bool = False

    def file(self, day: dt.datetime) -> list[Segment]:
        """The segments of a day."""
        rng, book = self.book.rng, self.book
        hot = self.book.settings.temperature == "degF"  # so warm that the numbers cannot be °C
        self.car.ambient_degc = round(float(rng.uniform(21.0 if hot else -4.0, 29.0)), 1)
        if not 0.35 < self.car.soc < 0.65:
            self.car.soc = 0.6
        t = (day - EPOCH).total_seconds() + int(rng.integers(6 * 3600, 15 * 3600))
        segments: list[Segment] = []
        number = int(rng.integers(1, 4))
        for k in range(number):
            segments.append(self._drive(t))
            t = float(segments[-1].rows["t"].iloc[-1]) + 2.0
            charges = k + 1 < number and book.wants("charging stop") and rng.random() < 0.7
            if charges:
                current = -float(rng.choice([16.0, 60.0, 110.0]))
                times = sample_times(rng, float(rng.uniform(330.0, 700.0)), (5.0, 10.0))
                segments.append(self._stand(t, times, current))
                book.planted.add("charging stop")
                t += float(times[-1]) + 20.0
            else:
                t += float(rng.integers(1200, 3600))
        return segments

    def _drive(self, t: float) -> Segment:
        rng, table = self.book.rng, self.book.table
        found = windows()
        window = found[int(rng.integers(len(found)))]
        times = sample_times(rng, len(window.speed) - 1.0, table.steps, table.jitter_s)
        rows = self.car.drive(window, t, times, float(rng.uniform(0.0, 6.0)))
        number, self.drives = self.drives, self.drives + 1
        self.book.lengths[number] = len(rows)
        return Segment(rows.assign(drive=number, instant=np.arange(len(rows))), number)

    def _stand(self, t: float, times: FloatArray, current: float) -> Segment:
        rows = self.car.stand(t, times, current)
        first, self.standing = self.standing, self.standing + len(rows)
        return Segment(rows.assign(drive=-1, instant=first + np.arange(len(rows))), -1)

    def unset(self, segments: list[Segment]) -> list[Segment]:
        """The segments after a few rows of a clock that nobody has set yet."""
        first = float(segments[0].rows["t"].iloc[0])
        times = np.arange(float(self.book.rng.integers(2, 5)))
        rows = self._stand(first - 5.0, times, 1.0).rows
        clock = float(self.book.rng.choice(UNSET_CLOCKS)) + times
        rows = rows.assign(clock=clock, epoch=clock, drive=-2)
        return [Segment(rows, -2), *segments]


def _halves(segment: Segment) -> tuple[Segment, Segment] | None:
    middle = _middle(segment.rows)
    if middle is None:
        return None
    rows = segment.rows
    return replace(segment, rows=rows.iloc[:middle]), replace(segment, rows=rows.iloc[middle:], part=1)


def _shifted(segments: list[Segment], shift_s: float) -> bool:
    """Set the clock within the last drive, where it can be cut."""
    halves = _halves(segments[-1])
    if halves is None:
        return False
    rows = segments[-1].rows
    later = rows["t"] >= float(halves[1].rows["t"].iloc[0])
    segments[-1] = replace(segments[-1], rows=rows.assign(clock=rows["clock"] + shift_s * later))
    return True


def _planned(book: Book, days: Sequence[dt.datetime]) -> list[tuple[dt.datetime, list[Segment], bool]]:
    """Day and segments of each file, and whether its clock was set."""
    rng = book.rng
    car = Car(
        float(rng.uniform(46.0, 54.0)), float(rng.uniform(7.0, 15.0)), float(rng.uniform(2e4, 9e4)), 0.6, 15.0
    )
    calendar = Calendar(book, car)
    stamped = book.table.app and book.table.dated and bool(book.settings.stamp)
    local = stamped and book.column("time_s") not in ("utc", "m.time.utc")
    goes_on = bool(book.settings.stamp)  # seconds since the start of a file do not tell what comes before
    files: list[tuple[dt.datetime, list[Segment], bool]] = []
    open_faults = {name for name in DRIVES_DIRT if book.wants(name)}
    for day in days:
        segments = calendar.file(day)
        shifted = False
        for name, shift_s in (("clock set back", -HOUR_S), ("clock set forward", HOUR_S)):
            if local and name in open_faults and not shifted and _shifted(segments, shift_s):
                shifted = True
                open_faults.discard(name)
                book.planted.add(name)
        halves = _halves(segments[-1]) if goes_on and "drive over two files" in open_faults else None
        if halves is not None and not shifted:
            open_faults.discard("drive over two files")
            book.planted.add("drive over two files")
            files += [(day, [*segments[:-1], halves[0]], False), (day, [halves[1]], False)]
            continue
        if stamped and "unset clock" in open_faults and "ambiguous dates" not in book.planted:
            open_faults.discard("unset clock")
            book.planted.add("unset clock")
            segments = calendar.unset(segments)
        files.append((day, segments, shifted))
    return files


def _log_file(book: Book, name: str, segments: Sequence[Segment], *, shifted: bool) -> LogFile:
    d = pd.concat([segment.rows for segment in segments], ignore_index=True)
    if book.wants("newest first") and not book.table.app:
        d = d.iloc[::-1].reset_index(drop=True)
        book.planted.add("newest first")
    cells = book.table.cells(d, book.settings)
    header = list(cells)
    rows = [list(row) for row in zip(*cells.values(), strict=True)]
    each = len(rows) // len(d)
    keys = list(zip(d["drive"].tolist(), d["instant"].tolist(), strict=True))
    return LogFile(
        name,
        header,
        [Row(row, keys[k // each]) for k, row in enumerate(rows)],
        last_header=header,
        shifted=shifted,
    )


# The folder


def write_dirty_folder(
    folder: Path, logger: str, seed: int, *, faults: Collection[str] | None = None
) -> Truth:
    """Write a folder of dirty logs. O(rows x columns).

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    logger : str
        One of `FORMATS`.
    seed : int
        Folders of equal logger and seed are equal to the last byte.
    faults : collection of str, optional
        Kinds of dirt of `FAULTS` to plant where the format can have them, in place of those that the seed draws; none
        makes a clean folder.

    Returns
    -------
    Truth
        What is in it.
    """
    rng = np.random.default_rng([seed, FORMATS.index(logger)])
    drawn = rng.random(len(FAULTS))
    wanted = frozenset(
        name
        for name, chance in zip(FAULTS, drawn, strict=True)
        if chance < (SETTING_CHANCE if name in OFTEN else CHANCE)
    )
    wanted = wanted if faults is None else frozenset(faults)
    table, settings = TABLES[logger], _settings(logger, rng, wanted)
    book = Book(rng, table, settings, _look(logger, rng, wanted), wanted)
    book.planted |= _settings_faults(settings, logger) | _look_faults(book.look)
    number = int(rng.integers(3, 7))
    ambiguous = "ambiguous dates" in wanted and settings.stamp in STAMPS[2:]
    book.planted |= {"ambiguous dates"} if ambiguous else set()
    planned = _planned(book, _days(rng, number, ambiguous=ambiguous))
    extension = "xlsx" if book.look.xlsx else "csv"
    names = [
        f"{table.name.format(n=k + 1, date=f'{day:%Y%m%d}')}.{extension}"
        for k, (day, _, _) in enumerate(planned)
    ]
    book.files = [
        _log_file(book, name, segments, shifted=shifted)
        for name, (_, segments, shifted) in zip(names, planned, strict=True)
    ]
    keys = {row.key for file in book.files for row in file.rows}
    book.budget = int(WORST_SHARE * sum(len(file.rows) for file in book.files))
    for name, plant in ROW_DIRT.items():
        if book.wants(name) and plant(book):
            book.planted.add(name)
    folder.mkdir(parents=True, exist_ok=True)
    bad_files = _write(book, folder, f"{planned[-1][0]:%Y%m%d}")
    sound = sum(drive >= 0 for drive, _ in keys - book.bad)
    standing = sum(drive == -1 for drive, _ in keys)
    drives = _true_drives(book, names, [segments for _, segments, _ in planned])
    return _truth(book, logger, drives, (sound, standing), bad_files)


def _truth(
    book: Book,
    logger: str,
    drives: tuple[TrueDrive, ...],
    rows: tuple[int, int],
    bad_files: tuple[str, ...],
) -> Truth:
    form = book.settings.stamp if logger in ("plain", "ovms") else book.table.stamp
    if book.column("time_s") == "m.time.utc":
        form = ""
    return Truth(
        logger,
        drives,
        rows[0],
        tuple(name for name in FAULTS if name in book.planted),
        bad_files,
        book.table.ours(book.settings),
        book.table.also,
        rows[1],
        "charge" if book.settings.charge_positive else "discharge",
        form,
    )


def _true_drives(
    book: Book, names: Sequence[str], files: Sequence[Sequence[Segment]]
) -> tuple[TrueDrive, ...]:
    parts: dict[int, list[tuple[str, pd.DataFrame]]] = {}
    for name, segments in zip(names, files, strict=True):
        for segment in (segment for segment in segments if segment.drive >= 0):
            parts.setdefault(segment.drive, []).append((name, segment.rows))
    ours = list(book.table.ours(book.settings))
    dated = book.table.dated and bool(book.settings.stamp)
    return tuple(
        true_drive(
            [name for name, _ in parts_of_drive],
            pd.concat([rows for _, rows in parts_of_drive]),
            ours,
            dated=dated,
        )
        for parts_of_drive in parts.values()
    )


def _write(book: Book, folder: Path, date: str) -> tuple[str, ...]:
    """Write the files, the copies and what nobody can use; names of the latter."""
    units = _units_row(book)
    contents = {file.name: file_bytes(file, book.look, book.rng, units) for file in book.files}
    copied = book.a_file(lambda file: file.headed) if book.wants("same file twice") else None
    if copied is not None:
        stem, _, extension = copied.name.rpartition(".")
        contents[f"{stem} (1).{extension}"] = contents[copied.name]
        book.planted.add("same file twice")
    base = book.table.name
    later = [f"{base.format(n=len(book.files) + k, date=date)}.csv" for k in (1, 2)]
    empty = LogFile(later[1], book.files[0].header, [], last_header=None)
    bad = {
        "empty file": (later[0], b""),
        "header only": (later[1], file_bytes(empty, replace(book.look, xlsx=False), book.rng, [])),
        "binary file": ("backup.csv", b"\0\1" + book.rng.bytes(3000)),
        "text note": ("README.txt", b"Logs of my car.\nTyres changed in spring, please see the files.\n"),
    }
    bad_files = {name: entry for name, entry in bad.items() if book.wants(name)}
    book.planted |= set(bad_files)
    for name, content in [*contents.items(), *bad_files.values()]:
        (folder / name).write_bytes(content)
    return tuple(name for name, _ in bad_files.values())


def _units_row(book: Book) -> list[str]:
    return plain_names(book.settings)[1] if book.settings.units_row else []


def main(folder: Path, logger: str = "leaf_spy", seed: int = 0, owner: bool = False) -> None:
    """Write a folder of dirty logs of a logger, or with `--owner` the two years of a Leaf Spy user; print the truth."""
    truth = write_leaf_spy_owner(folder, seed) if owner else write_dirty_folder(folder, logger, seed)
    print(
        f"{len(truth.drives)} drives, {truth.sound_rows} sound rows, {truth.standing_rows} of a car that stands"
    )
    print(f"planted: {', '.join(truth.faults) or 'nothing'}")
    for ours, (name, unit) in truth.columns.items():
        print(f"{ours}: {name} [{unit}]")


if __name__ == "__main__":
    run(main)
