"""Drives from the columns of files: split by trip id, join_continued over files, without copies; and the logs of these drives."""

from __future__ import annotations

import datetime as dt
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, hold_last
from tripwatt.errors import Fault, InvalidInput, and_more
from tripwatt.sources.clocks import GAP_S, steady_clock
from tripwatt.sources.mapping import ENERGY, POWER, UNITS, ColumnMapping
from tripwatt.sources.raw_files import NEEDED, RawFile, in_our_unit
from tripwatt.trips import COLUMNS, Context, Flag, Log
from tripwatt.trips.coarse_speed import rebuild_speed
from tripwatt.trips.columns import Column
from tripwatt.trips.energy import resolution
from tripwatt.vehicles import load_vehicle

CHANGED: Final = {
    "rows_sorted": ("rows out of order", "they were sorted by their times"),
    "clock_unset": ("clock was not set", "the first times follow from those after them"),
    "clock_daylight_saving": ("clock was set", "an hour was taken out"),
}
"""Code of a correction of times -> the texts `what` and `got` of its fault."""
LIMITS: Final = COLUMNS | {POWER: Column("W", -2e6, 2e6, "power at the battery terminals")}
"""Our columns with the range of their values; that of the power is a choice, above the power of any car or truck on the road."""
OCV_PARTS: Final = 1000


@dataclass(eq=False)
class RawDrive:
    """The samples of one drive in canonical columns and units, not yet a log; the time may count from 1970.

    Attributes
    ----------
    name : str
    files : list of RawFile
        The files that contain the drive, in order.
    samples : DataFrame
    car : str or None
    driver : str or None
        The driver of the whole drive.
    """

    name: str
    files: list[RawFile]
    samples: pd.DataFrame
    car: str | None = None
    driver: str | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """First and last time [s]."""
        time = self.samples["time_s"]
        return float(time.iloc[0]), float(time.iloc[-1])


def drives_of(file: RawFile) -> list[RawDrive]:
    """The drives of one file, without values that are impossible in their unit; these are faults of the file.

    Raises
    ------
    InvalidInput
        When nothing of the file can be used.
    """
    ours = {
        name: file.values["time_s"] if name == "time_s" else in_our_unit(file, name) for name in file.values
    }
    _blank_wrong(file, ours)
    frame = pd.DataFrame(ours | file.covariates)
    timeless = np.isnan(ours["time_s"])
    if timeless.all():
        got = f"{len(frame)} rows without a time"
        raise InvalidInput.of("no times", f"{file.path}", got, "a time in each row")
    lost = int(timeless.sum()) - len(frame) + file.rows  # without empty rows
    if lost > 0:
        file.notes.append(Flag("rows_without_time", file.path.name, float(lost), "1"))
    drives = []
    for name, rows in _groups(file, len(frame)):
        rows = rows[~timeless[rows]]
        cars, drivers = (
            {texts[row] for row in rows.tolist()} if texts else set()
            for texts in (file.vehicles, file.drivers)
        )
        if file.vehicles is not None and (len(cars) != 1 or "" in cars):
            where = f"{file.path} column {file.mapping.vehicle_column!r}, trip {name}"
            got = ", ".join(map(repr, sorted(cars)[:4]))
            allowed = "one vehicle for each trip"
            file.faults.append(Fault("no single vehicle", where, got, allowed, count=len(rows)))
        elif len(rows) < 2:
            where = f"{file.path}, trip {name}"
            file.faults.append(Fault("too few samples", where, f"{len(rows)}", "at least 2"))
        else:
            driver = (drivers.pop() or None) if len(drivers) == 1 else None
            car = cars.pop() if cars else None
            drives.append(RawDrive(name, [file], _in_order(file, frame, name, rows), car, driver))
            file.rows_used += len(rows)
    return drives


def _groups(file: RawFile, rows: int) -> list[tuple[str, IntArray]]:
    if file.trips is None:
        return [(file.path.stem, np.arange(rows))]
    outside = file.trips.count("")
    if outside:
        file.notes.append(Flag("rows_without_trip", file.path.name, float(outside), "1"))
    groups = pd.Series(np.arange(rows)).groupby(np.array(file.trips, dtype=object), sort=False)
    return [(str(name), group.to_numpy()) for name, group in groups if str(name)]


def _in_order(file: RawFile, frame: pd.DataFrame, name: str, rows: IntArray) -> pd.DataFrame:
    """The samples of one trip id with a corrected clock (`steady_clock`); faults and notes on gaps are added to the file."""
    samples = frame.iloc[rows].reset_index(drop=True)
    time = np.asarray(samples["time_s"], dtype=np.float64)
    codes: list[str] = []
    if file.stamped:
        time, codes = steady_clock(time, np.asarray(samples["speed_m_s"], dtype=np.float64))
        samples["time_s"] = time
    if "rows_sorted" in codes:
        samples = samples.sort_values("time_s", kind="stable", ignore_index=True)
        time = np.asarray(samples["time_s"])
    for code in codes:
        what, got = CHANGED[code]
        allowed = "times that increase by the same clock"
        file.faults.append(Fault(what, f"{file.path}, trip {name}", got, allowed))
    step = np.diff(time)

    def row(i: int) -> str:
        return f"row {file.row(int(rows[i + 1]))}, trip {name}"

    for i in np.flatnonzero(step > GAP_S)[:3].tolist():
        file.notes.append(Flag("samples_missing", f"{file.path.name} {row(i)}", float(step[i]), "s"))
    for i in np.flatnonzero(step < -GAP_S)[:1].tolist():
        file.notes.append(Flag("time_goes_back", f"{file.path.name} {row(i)}", float(-step[i]), "s"))
        if file.trips is not None:
            got = f"the time starts again, {time[i + 1]:g} s after {time[i]:g} s"
            where, fix = f"{file.path} {row(i)}", "give each trip its own id"
            file.faults.append(Fault("duplicate trip id", where, got, "one id per trip", fix))
    return samples


def _blank_wrong(file: RawFile, ours: dict[str, FloatArray]) -> None:
    """Replace values that are impossible in the mapping's unit by NaN; if they are many, remove their column.

    Raises
    ------
    InvalidInput
        When no value of the speed can be used, or many values of the power are impossible: a state of charge is no stand-in for it.
    """
    for name in [name for name in ours if name in LIMITS and name != "time_s"]:
        column, entry, values = LIMITS[name], file.entries[name], ours[name]
        lowest = -10.0 if name == "speed_m_s" else column.minimum  # m/s, of a car that reverses
        bad = np.flatnonzero((values < lowest) | (values > column.maximum))
        known = int(np.isfinite(values).sum())
        if known and not len(bad):
            continue
        where, allowed = f"{file.path} column {entry.column!r}", f"{name} in {entry.unit}"
        empty = Fault("empty column", where, "no value", allowed)
        fault = _range_fault(file, name, bad, lowest) if known else empty
        if (len(bad) > 0.2 * known and name == POWER) or (len(bad) == known and name in NEEDED):
            raise InvalidInput([fault])
        is_named = any(repr(entry.column) in other.where for other in file.faults)
        if known or not (entry.optional or is_named):
            file.faults.append(fault)
        # 0.2: if a larger share of a column is impossible, the column is something else or in another
        # unit, and is not used at all
        if known and len(bad) > 0.2 * known and name not in NEEDED:
            del ours[name]
        elif known:
            ours[name] = values.copy()
            ours[name][bad] = np.nan


def _range_fault(file: RawFile, name: str, bad: IntArray, lowest: float) -> Fault:
    column, entry, raw = LIMITS[name], file.entries[name], file.values[name]
    values = in_our_unit(file, name)
    factor, offset = UNITS[name][entry.unit]
    low, high = sorted(((lowest - offset) / factor, (column.maximum - offset) / factor))
    worst = int(bad[np.argmax(np.abs(values[bad]))])
    by_row = file.trips is None and file.mapping.long_name is None
    row = f" row {file.row(worst)}" if by_row else ""
    where = f"{file.path}{row} column {entry.column!r}"
    got = f"{raw[worst]:g} {entry.unit}" + and_more(bad)
    is_12_v = name == "voltage_v" and 9.0 <= float(np.nanmedian(values)) <= 16.0
    traction = "map the voltage of the traction battery, not of the 12 V on-board system"
    # 0.2: as for a column that is not used at all
    is_watts = (name, entry.unit) == (POWER, "kw") and len(bad) > 0.2 * len(values)
    usual = "the unit appears to be W; convert it to kW" if is_watts else "check the unit in the mapping"
    fix = traction if is_12_v else usual
    return Fault("value out of range", where, got, f"{low:g} to {high:g} {entry.unit}", fix, count=len(bad))


def name_uniquely(drives: Sequence[RawDrive]) -> list[RawDrive]:
    """The drives with unique names: before a name that is taken its folder's name is put, and if that is taken too, a number added."""
    taken: dict[str, RawFile] = {}
    for drive in drives:
        file, name, number = drive.files[0], drive.name, 2
        if name in taken:
            where, got = f"{file.path}, trip {name}", f"{taken[name].path.name} and {file.path.name}"
            file.faults.append(Fault("duplicate trip id", where, got, "one id per trip"))
            drive.name = f"{file.path.parent.name}-{name}"
        while drive.name in taken:
            drive.name, number = f"{name}-{number}", number + 1
        taken[drive.name] = file
    return [*drives]


def drop_copies(drives: Sequence[RawDrive]) -> list[RawDrive]:
    """The drives without copies: a drive with the same samples as an earlier one is left out, with a fault of its file."""
    seen: dict[bytes, RawDrive] = {}
    for drive in drives:
        earlier = seen.setdefault(drive.samples.select_dtypes("number").to_numpy(np.float64).tobytes(), drive)
        if earlier is not drive:
            (file,), rows = drive.files, len(drive.samples)
            where, got = f"{file.path}, trip {drive.name}", f"the samples of {earlier.name}"
            file.faults.append(Fault("copy of another drive", where, got, "each drive once", count=rows))
            file.rows_used -= rows
    return [*seen.values()]


def join_continued(drives: Sequence[RawDrive]) -> list[RawDrive]:
    """The drives in their order, in which a drive that goes on in another file without a break is one drive."""
    joinable = [d for d in drives if d.files[0].stamped and d.files[0].trips is None]
    ahead = sorted(joinable, key=lambda drive: drive.ends)
    gone = set()
    for drive, after in itertools.pairwise(ahead):
        step = np.diff(np.asarray(drive.samples["time_s"]))
        usual = float(np.median(step)) if len(step) else 0.0
        pause = after.ends[0] - drive.ends[1]
        # a file continues the drive of another one if it begins at most 5 s, or 3 usual steps, after its end
        if 0.0 < pause <= max(5.0, 3.0 * usual) and drive.car == after.car:
            after.samples = pd.concat([drive.samples, after.samples], ignore_index=True)
            after.files = [*drive.files, *after.files]
            after.name = drive.name
            after.files[-1].notes.append(Flag("drive_continued", after.files[-1].path.name, drive.name))
            gone.add(id(drive))
    return [drive for drive in drives if id(drive) not in gone]


def _from_epoch(seconds: float) -> dt.datetime | None:
    try:
        return dt.datetime.fromtimestamp(float(seconds), tz=dt.UTC).replace(tzinfo=None)
    except (ValueError, OverflowError, OSError):
        return None


def log_of(drive: RawDrive) -> Log:
    """Make the log of a drive: hold and rebuild values, convert power or state of charge, and count times from 0."""
    file, samples = drive.files[0], drive.samples
    mapping = file.mapping
    time = np.asarray(samples["time_s"], dtype=np.float64)
    started = _from_epoch(float(time[0])) if file.stamped else None
    context = Context(car=drive.car, driver=drive.driver, started_at=started)
    if file.stamped:
        time = time - time[0]
    covariates = samples[[c for c in mapping.covariates if c in samples]]
    names = samples.columns.difference(["time_s", *covariates], sort=False)
    signals = {c: np.asarray(samples[c], dtype=np.float64) for c in names}
    columns = {"time_s": time} | {
        c: hold_last(time, x, mapping.hold_s) if mapping.hold_s > 0.0 else x for c, x in signals.items()
    }
    rebuilt = rebuild_speed(time, signals["speed_m_s"], columns["speed_m_s"])
    columns["speed_m_s"] = rebuilt.speed_m_s
    steps = (rebuilt.held_s, "s"), (round(rebuilt.step_m_s, 3), "m_s")
    notes = [Flag("speed_rebuilt", f"trip {drive.name}", value, unit) for value, unit in steps if value]
    file.notes += [note for note in notes if note not in file.notes]
    nominal = mapping.nominal_voltage_v
    if nominal is not None and (POWER in columns or "current_a" in columns):
        voltage = columns.get("voltage_v", np.full(len(time), np.nan))
        columns["voltage_v"] = np.where(np.isnan(voltage), nominal, voltage)
    energy_std: float | None = None
    if POWER in columns:
        columns["current_a"] = columns.pop(POWER) * mapping.discharge_sign / columns["voltage_v"]
    elif "current_a" in columns:
        columns["current_a"] = columns["current_a"] * mapping.discharge_sign
    elif mapping.usable_capacity_kwh is not None and ENERGY not in columns:
        columns[ENERGY], energy_std = _energy_from_soc(columns, mapping)
    order = [*(c for c in COLUMNS if c in columns), *(c for c in columns if c not in COLUMNS)]
    table = pd.DataFrame({c: columns[c] for c in order}).assign(**covariates)
    log = Log.from_samples(drive.name, table, context)
    if energy_std is None:
        return log
    common_std = mapping.usable_capacity_uncertainty
    return replace(log, observed_energy_std_wh=energy_std, observed_energy_common_std=common_std)


def _energy_from_soc(columns: Mapping[str, FloatArray], mapping: ColumnMapping) -> tuple[FloatArray, float]:
    """Cumulative energy [Wh] as the used share of the usable capacity, and the standard error of its last value [Wh].

    The state of charge at both ends is rounded to a step r, which gives each an error of variance r^2/12. The capacity has the
    relative error that the mapping states.
    """
    soc = columns["soc"] if "soc" in columns else columns["displayed_soc"]
    time = columns["time_s"]
    known = np.isfinite(soc)
    capacity_wh = 1000.0 * (mapping.usable_capacity_kwh or math.nan)
    if not known.any():
        return np.full(len(soc), np.nan), math.nan
    filled = np.interp(time, time[known], soc[known])
    energy, slope = _share_of_energy(filled, mapping, displayed="soc" not in columns)
    energy = capacity_wh * (energy[0] - energy)
    # 0.01: assumed resolution of a state of charge that does not change
    step = resolution(soc[known]) if np.ptp(soc[known]) > 0.0 else 0.01
    from_rounding = capacity_wh * step / math.sqrt(12.0) * math.hypot(slope[0], slope[-1])
    from_capacity = mapping.usable_capacity_uncertainty * float(abs(energy[-1]))
    return energy, math.hypot(from_rounding, from_capacity)


def _share_of_energy(
    soc: FloatArray, mapping: ColumnMapping, *, displayed: bool
) -> tuple[FloatArray, FloatArray]:
    """Share of a full battery's energy at each state of charge, and the slope of this share over the state of charge.

    The share is the integral of the car's open-circuit voltage: a state of charge counts charge, and a fuller battery gives charge at
    a higher voltage. Without a car in the mapping the share is the state of charge itself.
    """
    if mapping.battery_vehicle is None:
        return soc, np.ones(len(soc))
    battery = load_vehicle(mapping.battery_vehicle).battery
    low, high = (battery.displayed_zero_soc, battery.displayed_full_soc) if displayed else (0.0, 1.0)
    parts = np.linspace(0.0, 1.0, OCV_PARTS + 1)
    voltage = np.interp(low + (high - low) * parts, battery.ocv_soc, battery.ocv_v)
    held = np.append(0.0, np.cumsum(0.5 * (voltage[1:] + voltage[:-1]))) / OCV_PARTS
    return np.interp(soc, parts, held / held[-1]), np.interp(soc, parts, voltage / held[-1])
