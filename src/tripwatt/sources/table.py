"""Any table of samples, CSV or Parquet, one file a trip or one file with a column of trips, through a mapping."""

from __future__ import annotations

import datetime as dt
import difflib
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, running_sum
from tripwatt.errors import Fault, InvalidInput, and_more
from tripwatt.sources.columnar import TableFile, open_table, read_all, table_files
from tripwatt.sources.delimited import column_key
from tripwatt.sources.mapping import (
    POWER,
    TIME_STAMPS,
    UNITS,
    ColumnMapping,
    MappedColumn,
    load_mapping,
    parse_mapping,
)
from tripwatt.trips import COLUMNS, Context, Flag, Fleet, Log, raise_faults
from tripwatt.trips.coarse_speed import rebuild_speed
from tripwatt.trips.energy import resolution
from tripwatt.trips.inertia import WRONG_SIGN, apparent_mass
from tripwatt.units import SECONDS_PER_DAY
from tripwatt.vehicles import load_vehicle

WRONG_SHARE: Final = 0.01
"""Up to this share of impossible values are a sensor's dropouts and the audit's affair; more is a wrong unit."""

SHOWN_ALIKE: Final = 2
"""Faults named of one kind in one column; the others are counted."""

EARLIEST_YEAR, LATEST_YEAR = 1970, 2199
"""Years of a time stamp of a log."""
_ZONE: Final = re.compile(r"\d(?:Z|z|[+-]\d{2}:?\d{2})$")
"""The end of a time with a time zone, as in 08:15:00+02:00."""
GAP_S: Final = 60.0
REVERSING_M_S: Final = -10.0
WH_PER_KWH: Final = 1000.0
OCV_PARTS: Final = 1000
WHOLE_PERCENT: Final = 0.01
"""Step of a state of charge that does not change."""


def read_table(path: Path | str, mapping: Path | str | ColumnMapping | None = None) -> Fleet:
    """Read trips from a CSV or Parquet file, or a folder of them.

    Parameters
    ----------
    path : path
    mapping : path, str or ColumnMapping, optional
        A TOML file, the name of a shipped mapping, or a mapping; without one the columns must have our names.

    Returns
    -------
    Fleet
        Raw trips by id. `notes` names gaps of more than a minute, what is missing and what stands in for it.

    Raises
    ------
    InvalidInput
        With every fault of the mapping and of all files: a column that is not there, a unit that the values
        contradict, a current of the wrong sign, two trips with one id.
    """
    path = Path(path)
    files = table_files(path)
    checked = _mapping_for(mapping, files[0])

    def read_one(file: Path) -> tuple[list[Log], list[Flag]]:
        try:
            return _read_file(file, checked)
        except InvalidInput as error:
            fix = f'add [file] decimal = "," to {checked.source}'
            commas = (replace(f, fix=fix) if f.what == "decimal comma" else f for f in error.faults)
            raise InvalidInput(commas) from error

    read, errors = read_all(read_one, files)
    raise_faults(_merge_alike(path, [error.faults for error in errors]))
    trips = [trip for its_trips, _ in read for trip in its_trips]
    raise_faults([*_twice(path, files, [its for its, _ in read]), *_wrong_sign(trips, checked)])
    if not trips:
        got = f"{len(files)} files without a trip"
        raise InvalidInput.of("no trips", f"{path}", got, "at least one trip")
    notes = [note for _, its_notes in read for note in its_notes]
    return Fleet("table", tuple(trips), (*_fleet_notes(trips, checked), *notes))


def _merge_alike(path: Path, faults: Sequence[Sequence[Fault]]) -> Iterator[Fault]:
    """All faults of all files; of one that many files share in the same column the first ones and how many more."""
    seen: dict[tuple[str, str, str], list[Fault]] = {}
    for fault in (fault for its_faults in faults for fault in its_faults):
        column = fault.where.partition(" column ")[2]
        seen.setdefault((fault.what, column, fault.allowed), []).append(fault)
    for alike in seen.values():
        if len(alike) <= SHOWN_ALIKE + 1:
            yield from alike
            continue
        yield from alike[:SHOWN_ALIKE]
        column = alike[0].where.partition(" column ")[2]
        place = f"{path} column {column}" if column else f"{path}"
        yield replace(alike[0], where=place, got=f"{len(alike) - SHOWN_ALIKE} more of this kind")


def _mapping_for(mapping: Path | str | ColumnMapping | None, first: Path) -> ColumnMapping:
    if isinstance(mapping, ColumnMapping):
        return mapping
    if mapping is not None:
        return load_mapping(mapping)
    names = [n for n in open_table(first).names if n in COLUMNS]
    if not {"time_s", "speed_m_s"} <= set(names):
        got = f"columns {', '.join(map(repr, open_table(first).names[:8]))}"
        allowed = "a mapping, or columns with canonical names such as time_s, speed_m_s, voltage_v, current_a"
        fix = f"run `tripwatt mapping suggest {first}` to get a proposal"
        raise InvalidInput.of("no mapping", "--mapping", got, allowed, fix)
    return parse_mapping("[columns]\n" + "\n".join(f'{n} = {{ column = "{n}" }}' for n in names), f"{first}")


def _read_file(path: Path, mapping: ColumnMapping) -> tuple[list[Log], list[Flag]]:
    table = open_table(path, mapping.decimal)
    entries = _entries(table, mapping)
    if mapping.long_name is not None:
        return _read_long(table, entries, mapping)
    texts = _trip_names(table, mapping)
    by_number = {ours: e for ours, e in entries.items() if ours != "time_s" or e.unit != "timestamp"}
    values = dict(zip(by_number, table.numbers([e.column for e in by_number.values()]), strict=True))
    stamped = entries["time_s"].unit in TIME_STAMPS
    if "time_s" not in values:
        values["time_s"], stamped = _stamps(table, entries["time_s"])
    elif stamped:
        values["time_s"] = values["time_s"] * TIME_STAMPS[entries["time_s"].unit]
    return _trips_of(table, entries, mapping, values, texts, stamped=stamped)


def _trip_names(table: TableFile, mapping: ColumnMapping) -> list[str] | None:
    """The trip of each row, with its vehicle before it where both have a column; None where a file is one trip."""
    trips = table.texts(mapping.trip_column) if mapping.trip_column else None
    if mapping.vehicle_column is None or trips is None:
        return trips
    vehicles = table.texts(mapping.vehicle_column)
    return [f"{car}-{trip}" if trip else "" for car, trip in zip(vehicles, trips, strict=True)]


def _entries(table: TableFile, mapping: ColumnMapping) -> dict[str, MappedColumn]:
    """Entries with the file's own spelling of their columns. A name is matched exactly, else by `column_key`."""
    own = (mapping.trip_column, mapping.vehicle_column, mapping.long_name, mapping.long_value)
    needed: list[str] = [n for n in own if n]
    faults = [_missing(table, n, mapping) for n in needed if n not in table.names]
    keys: dict[str, list[str]] = {}
    for name in table.names:
        keys.setdefault(column_key(name), []).append(name)
    entries: dict[str, MappedColumn] = {}
    for ours, entry in mapping.columns.items():
        is_signal = mapping.long_name is not None and ours != "time_s"
        alike = keys.get(column_key(entry.column), [])
        if is_signal or entry.column in table.names:
            entries[ours] = entry
        elif len(alike) == 1:
            entries[ours] = replace(entry, column=alike[0])
        elif not entry.optional:
            faults.append(_missing(table, entry.column, mapping))
    raise_faults(faults)
    return entries


def _missing(table: TableFile, name: str, mapping: ColumnMapping) -> Fault:
    close = difflib.get_close_matches(name, table.names, n=1)
    got = ", ".join(repr(n[:40]) for n in table.names[:8]) + (" ..." if len(table.names) > 8 else "")
    fix = f"did you mean {close[0]!r}? " if close else ""
    return Fault("missing column", f"{table.path}", got, f"a column {name!r}", f"{fix}see {mapping.source}")


def _stamps(table: TableFile, entry: MappedColumn) -> tuple[FloatArray, bool]:
    """Seconds since 1970 of a column of time stamps; since the first sample, and False, where they have no day."""
    texts = pd.Series(table.texts(entry.column), dtype=object)
    stamps = pd.to_datetime(texts, format=entry.format or "ISO8601", utc=True, errors="coerce")
    clock_only = bool(entry.format) and not re.search("%[djUVxcs]", entry.format)
    if not clock_only:
        stamps = stamps.where((stamps.dt.year >= EARLIEST_YEAR) & (stamps.dt.year <= LATEST_YEAR))
        _require_one_kind_of_zone(table, entry, texts)
    bad = np.flatnonzero(stamps.isna() & (texts != ""))
    if len(bad):
        allowed = f"a time like {entry.format}" if entry.format else "a time such as 2024-05-31T08:15:00"
        allowed += "" if clock_only else f", from {EARLIEST_YEAR} to {LATEST_YEAR}"
        place = f"{table.path} row {table.row(int(bad[0]))} column {entry.column!r}"
        got = repr(texts[int(bad[0])][:40]) + and_more(bad)
        fix = "" if entry.format else 'give the format in the mapping: format = "%d.%m.%Y %H:%M:%S"'
        raise InvalidInput.of("invalid time", place, got, allowed, fix)
    seconds = (stamps - pd.Timestamp(0, tz="UTC")).dt.total_seconds()
    values = np.asarray(seconds, dtype=np.float64)
    if clock_only:
        midnight = running_sum(np.diff(values) < -0.5 * SECONDS_PER_DAY)
        return values - values[0] + SECONDS_PER_DAY * midnight, False
    return values, True


def _require_one_kind_of_zone(table: TableFile, entry: MappedColumn, texts: pd.Series) -> None:
    """Refuse a column in which some times have a time zone and some have none: an hour or more may lie between them."""
    given = texts[texts != ""]
    zoned = given.str.contains(_ZONE)
    if len(given) and bool(zoned.any()) and not bool(zoned.all()):
        first = int(zoned.index[zoned != bool(zoned.iloc[0])][0])
        place = f"{table.path} row {table.row(first)} column {entry.column!r}"
        allowed = "the same in every row"
        got = f"{texts[first][:40]!r}, {'with' if zoned[first] else 'without'} a time zone unlike the rows before"
        raise InvalidInput.of("times with and without time zone", place, got, allowed)


def _from_epoch(seconds: float) -> dt.datetime | None:
    try:
        return dt.datetime.fromtimestamp(float(seconds), tz=dt.UTC).replace(tzinfo=None)
    except (ValueError, OverflowError, OSError):
        return None


def _read_long(
    table: TableFile, entries: Mapping[str, MappedColumn], mapping: ColumnMapping
) -> tuple[list[Log], list[Flag]]:
    """A file with a row for each value: the signals side by side on the union of their times."""
    if mapping.long_name is None or mapping.long_value is None:  # the mapping's check saw to it
        raise InvalidInput.of("missing key", f"{mapping.source} [long]", "", "name and value")
    signals = np.array(table.texts(mapping.long_name), dtype=object)
    (raw_time,) = table.numbers([entries["time_s"].column])
    texts = table.texts(mapping.long_value)
    times, index = np.unique(raw_time, return_inverse=True)
    faults: list[Fault] = []
    values: dict[str, FloatArray] = {"time_s": times}
    for ours, entry in entries.items():
        if ours == "time_s":
            continue
        rows = np.flatnonzero(signals == entry.column)
        if not len(rows) and not entry.optional:
            seen = sorted(set(signals.tolist()))
            near = difflib.get_close_matches(entry.column, seen, n=1)
            fix = f"did you mean {near[0]!r}?" if near else ""
            got = ", ".join(map(repr, seen[:8]))
            faults.append(Fault("missing signal", f"{table.path}", got, f"a signal {entry.column!r}", fix))
        if len(rows):
            cells = pd.Series([texts[i].replace(mapping.decimal, ".") or "nan" for i in rows], dtype=object)
            values[ours] = np.full(len(times), np.nan)
            values[ours][index[rows]] = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=np.float64)
    raise_faults(faults)
    return _trips_of(table, entries, mapping, values, None, stamped=False)


def _trips_of(
    table: TableFile,
    entries: Mapping[str, MappedColumn],
    mapping: ColumnMapping,
    values: dict[str, FloatArray],
    texts: Sequence[str] | None,
    *,
    stamped: bool,
) -> tuple[list[Log], list[Flag]]:
    """Trips of one file from its raw columns, after every value that contradicts its unit was named."""
    ours = {name: _convert(name, entries[name], column) for name, column in values.items()}
    raise_faults(_range_faults(table, entries, values, ours, texts is None and mapping.long_name is None))
    frame = pd.DataFrame(ours)
    notes: list[Flag] = []
    trips: list[Log] = []
    faults: list[Fault] = []
    if texts is None:
        groups = [(table.path.stem, np.arange(len(frame)))]
    else:
        places = pd.Series(np.arange(len(frame))).groupby(np.array(texts, dtype=object), sort=False)
        groups = [(str(name), np.asarray(rows)) for name, rows in places if str(name)]
        outside = sum(not text for text in texts)
        if outside:
            notes.append(Flag("rows_without_trip", table.path.name, float(outside), "1"))
    timeless = ~np.isfinite(ours["time_s"])
    if timeless.any() and not timeless.all():
        notes.append(Flag("rows_without_time", table.path.name, float(timeless.sum()), "1"))
        groups = [(name, rows[~timeless[rows]]) for name, rows in groups]
    vehicles = None if mapping.vehicle_column is None else table.texts(mapping.vehicle_column)
    for name, rows in groups:
        car = None
        if vehicles is not None:
            cars = sorted({vehicles[int(i)] for i in rows})
            if cars == [""] or len(cars) != 1:
                where = f"{table.path} column {mapping.vehicle_column!r}, trip {name}"
                got = ", ".join(map(repr, cars[:4]))
                faults.append(Fault("no single vehicle", where, got, "one vehicle for each trip"))
                continue
            car = cars[0]
        samples = frame.iloc[rows].reset_index(drop=True)
        if stamped and bool((np.diff(samples["time_s"]) < 0).any()):
            samples = samples.sort_values("time_s", kind="stable", ignore_index=True)
            notes.append(Flag("rows_sorted", f"{table.path.name}, trip {name}"))
        time = np.asarray(samples["time_s"])
        place = partial(_place, table, name, rows)
        notes += _gap_notes(partial(place, table.path.name), time)
        if texts is not None:
            faults += _reused_id(partial(place, f"{table.path}"), time)
        if len(samples) < 2:
            where = f"{table.path}, trip {name}"
            faults.append(Fault("too few samples", where, f"{len(samples)}", "at least 2"))
            continue
        trip, its_notes = _trip(name, samples, mapping, stamped=stamped, car=car)
        trips.append(trip)
        notes += its_notes
    raise_faults(faults)
    return trips, notes


def _convert(ours: str, entry: MappedColumn, column: FloatArray) -> FloatArray:
    if ours == "time_s" and entry.unit in TIME_STAMPS:
        return column
    factor, offset = UNITS[ours][entry.unit]
    converted = column if factor == 1.0 and offset == 0.0 else column * factor + offset
    # a battery that is switched off reports 0 V: that is no measurement
    return np.where(converted == 0.0, np.nan, converted) if ours == "voltage_v" else converted


def _range_faults(
    table: TableFile,
    entries: Mapping[str, MappedColumn],
    raw: Mapping[str, FloatArray],
    ours: Mapping[str, FloatArray],
    by_row: bool,
) -> Iterator[Fault]:
    """Columns with too many values that are impossible with the mapping's unit."""
    for name, values in ours.items():
        if name not in COLUMNS or name == "time_s":
            continue
        column, entry = COLUMNS[name], entries[name]
        lowest = REVERSING_M_S if name == "speed_m_s" else column.minimum
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero((values < lowest) | (values > column.maximum))
        known = int(np.isfinite(values).sum())
        if not known:
            place = f"{table.path} column {entry.column!r}"
            if not entry.optional:
                yield Fault("empty column", place, "no value", f"{name} in {entry.unit}")
        elif len(bad) > WRONG_SHARE * known:
            factor, offset = UNITS[name][entry.unit]
            low, high = sorted(((lowest - offset) / factor, (column.maximum - offset) / factor))
            worst = int(bad[np.argmax(np.abs(values[bad]))])
            row = f" row {table.row(worst)}" if by_row else ""
            where = f"{table.path}{row} column {entry.column!r}"
            got = f"{raw[name][worst]:g} {entry.unit} (and {len(bad) - 1} more rows)"
            is_12_v = name == "voltage_v" and 9.0 <= float(np.nanmedian(values)) <= 16.0
            traction = "map the voltage of the traction battery, not of the 12 V on-board system"
            fix = traction if is_12_v else "check the unit in the mapping"
            yield Fault("value out of range", where, got, f"{low:g} to {high:g} {entry.unit}", fix)


def _place(table: TableFile, trip: str, rows: IntArray, file: str, sample: int) -> str:
    return f"{file} row {table.row(int(rows[sample]))}, trip {trip}"


def _gap_notes(where: Callable[[int], str], time: FloatArray) -> Iterator[Flag]:
    step = np.diff(time)
    for i in np.flatnonzero(step > GAP_S)[:3].tolist():
        yield Flag("samples_missing", where(i + 1), float(step[i]), "s")
    for i in np.flatnonzero(step < -GAP_S)[:1].tolist():
        yield Flag("time_goes_back", where(i + 1), float(-step[i]), "s")


def _reused_id(where: Callable[[int], str], time: FloatArray) -> Iterator[Fault]:
    """An id under which the time starts again."""
    for i in np.flatnonzero(np.diff(time) < -GAP_S)[:1].tolist():
        got = f"the time starts again, {time[i + 1]:g} s after {time[i]:g} s"
        yield Fault("duplicate trip id", where(i + 1), got, "one id per trip", "give each trip its own id")


def _trip(
    name: str, samples: pd.DataFrame, mapping: ColumnMapping, *, stamped: bool, car: str | None = None
) -> tuple[Log, list[Flag]]:
    time = np.asarray(samples["time_s"], dtype=np.float64)
    context = Context(car=car, started_at=_from_epoch(float(time[0])) if stamped else None)
    if stamped:
        time = time - time[0]
    signals = {c: np.asarray(samples[c], dtype=np.float64) for c in samples.columns if c != "time_s"}
    columns = {"time_s": time, **{c: _held(time, x, mapping.hold_s) for c, x in signals.items()}}
    rebuilt = rebuild_speed(time, signals["speed_m_s"], columns["speed_m_s"])
    columns["speed_m_s"] = rebuilt.speed_m_s
    steps = (rebuilt.held_s, "s"), (round(rebuilt.step_m_s, 3), "m_s")
    notes = [Flag("speed_rebuilt", f"trip {name}", value, unit) for value, unit in steps if value]
    energy_std: float | None = None
    common_std = 0.0
    nominal = mapping.nominal_voltage_v
    if nominal is not None and (POWER in columns or "current_a" in columns):
        voltage = columns.get("voltage_v", np.full(len(time), np.nan))
        columns["voltage_v"] = np.where(np.isnan(voltage), nominal, voltage)
    if POWER in columns:
        columns["current_a"] = columns.pop(POWER) * mapping.discharge_sign / columns["voltage_v"]
    elif "current_a" in columns:
        columns["current_a"] = columns["current_a"] * mapping.discharge_sign
    elif mapping.usable_capacity_kwh is not None:
        columns["observed_energy_wh"], energy_std = _energy_from_soc(columns, mapping)
        common_std = mapping.usable_capacity_uncertainty
    order = [*(c for c in COLUMNS if c in columns), *(c for c in columns if c not in COLUMNS)]
    log = Log.from_samples(name, pd.DataFrame({c: columns[c] for c in order}), context)
    if energy_std is None:
        return log, notes
    return replace(log, observed_energy_std_wh=energy_std, observed_energy_common_std=common_std), notes


def _held(time: FloatArray, values: FloatArray, hold_s: float) -> FloatArray:
    """Missing values replaced by the last one while it is not older than `hold_s`."""
    known = np.isfinite(values)
    if hold_s <= 0.0 or known.all() or not known.any():
        return values
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    fresh = (last >= 0) & (time - time[np.maximum(last, 0)] <= hold_s)
    return np.where(fresh, values[np.maximum(last, 0)], np.nan)


def _energy_from_soc(columns: Mapping[str, FloatArray], mapping: ColumnMapping) -> tuple[FloatArray, float]:
    """Cumulative energy [Wh] as the used share of the usable capacity, and the standard error of its last value.

    Both ends are rounded to a step r of the state of charge, an error of variance r^2/12 each; the capacity has the
    relative error of the mapping.
    """
    soc = columns["soc"] if "soc" in columns else columns["displayed_soc"]
    time = columns["time_s"]
    known = np.isfinite(soc)
    capacity_wh = WH_PER_KWH * (mapping.usable_capacity_kwh or math.nan)
    if not known.any():
        return np.full(len(soc), np.nan), math.nan
    filled = np.interp(time, time[known], soc[known])
    energy, slope = _share_of_energy(filled, mapping, displayed="soc" not in columns)
    energy = capacity_wh * (energy[0] - energy)
    step = resolution(soc[known]) if np.ptp(soc[known]) > 0.0 else WHOLE_PERCENT
    from_rounding = capacity_wh * step / math.sqrt(12.0) * math.hypot(slope[0], slope[-1])
    from_capacity = mapping.usable_capacity_uncertainty * float(abs(energy[-1]))
    return energy, math.hypot(from_rounding, from_capacity)


def _share_of_energy(
    soc: FloatArray, mapping: ColumnMapping, *, displayed: bool
) -> tuple[FloatArray, FloatArray]:
    """Share of the energy of a full battery in each charge, and its slope: the integral of the car's open-circuit voltage.

    A state of charge counts charge, and a full battery gives each part of it at a higher voltage. Without a car both count alike.
    """
    if mapping.battery_vehicle is None:
        return soc, np.ones(len(soc))
    battery = load_vehicle(mapping.battery_vehicle).battery
    low, high = (battery.displayed_zero_soc, battery.displayed_full_soc) if displayed else (0.0, 1.0)
    parts = np.linspace(0.0, 1.0, OCV_PARTS + 1)
    voltage = np.interp(low + (high - low) * parts, battery.ocv_soc, battery.ocv_v)
    held = np.append(0.0, np.cumsum(0.5 * (voltage[1:] + voltage[:-1]))) / OCV_PARTS
    return np.interp(soc, parts, held / held[-1]), np.interp(soc, parts, voltage / held[-1])


def _twice(path: Path, files: Sequence[Path], trips: Sequence[Sequence[Log]]) -> Iterator[Fault]:
    seen: dict[str, Path] = {}
    for file, its_trips in zip(files, trips, strict=True):
        for trip in its_trips:
            if trip.trip_id in seen:
                got = f"{seen[trip.trip_id].name} and {file.name}"
                yield Fault("duplicate trip id", f"{path}, trip {trip.trip_id}", got, "one id per trip")
            seen.setdefault(trip.trip_id, file)


def _wrong_sign(trips: Sequence[Log], mapping: ColumnMapping) -> Iterator[Fault]:
    """A current, or power, that would charge the battery while the car accelerates."""
    correlations = []
    for trip in trips:
        if trip.has("speed_m_s", "voltage_v", "current_a"):
            power = trip.array("voltage_v") * trip.array("current_a")
            mass = apparent_mass(trip.array("time_s"), trip.array("speed_m_s"), power)
            if mass is not None:
                correlations.append(mass[1])
    if correlations and float(np.median(correlations)) < WRONG_SIGN:
        name = (mapping.columns.get("current_a") or mapping.columns[POWER]).column
        now, right = ("discharge", "charge") if mapping.discharge_sign > 0 else ("charge", "discharge")
        got = f"the car would charge while it accelerates in most of {len(correlations)} trips"
        allowed, fix = f'[current] positive = "{right}" in place of "{now}"', f"change it in {mapping.source}"
        yield Fault("current has the wrong sign", f"column {name!r}", got, allowed, fix)


def _fleet_notes(trips: Sequence[Log], mapping: ColumnMapping) -> Iterator[Flag]:
    columns = set(mapping.columns)
    if not {"elevation_m", "grade"} & columns:
        yield Flag("no_elevation", "table")
    if not any(t.observed_energy_wh is not None for t in trips):
        yield Flag("no_energy", "table")
    if {POWER, "current_a"} & columns and mapping.nominal_voltage_v is not None:
        yield Flag("nominal_voltage", "table", mapping.nominal_voltage_v, "V")
    by_charge = [t for t in trips if not t.has("voltage_v", "current_a")]
    shares = [
        t.observed_energy_std_wh / max(abs(t.observed_energy_wh or 0.0), 1e-9)
        for t in by_charge
        if t.observed_energy_std_wh is not None
    ]
    if shares:
        share = float(np.median(shares))
        yield Flag("energy_from_soc", f"{mapping.usable_capacity_kwh:g} kWh", share, "1")
