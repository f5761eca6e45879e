"""Reader of tables of samples through a mapping: CSV or Parquet, with one file per trip or a column that identifies trips.

Each file is first read in its own units. Then the order of day and month, units that differ from the mapping's and the sign of the
current are decided from all files together. Only then are the columns converted to logs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from tripwatt.arrays import BoolArray, FloatArray, by_key, changes, distance_driven, number_in, running_sum
from tripwatt.errors import Fault, InvalidInput, grouped, or_none, raise_faults
from tripwatt.sources.archives import unpacked
from tripwatt.sources.clocks import decide_format
from tripwatt.sources.columnar import TableFile, read_all
from tripwatt.sources.evidence import SPEED_UNITS
from tripwatt.sources.kinds import Kind, given_kind, proposed_kinds
from tripwatt.sources.mapping import POWER, ColumnMapping, MappedColumn
from tripwatt.sources.naming import unit_in, words
from tripwatt.sources.raw_drives import (
    RawDrive,
    drives_of,
    drop_copies,
    join_continued,
    log_of,
    name_uniquely,
)
from tripwatt.sources.raw_files import RawFile, convert_times, in_our_unit, open_raw_file, use_unit
from tripwatt.trips import Flag, Log, TripSet
from tripwatt.trips.energy import observed_cumulative_energy
from tripwatt.trips.gaps import LONGEST_GAP_S
from tripwatt.trips.inertia import WRONG_SIGN, apparent_mass
from tripwatt.trips.reading import FileReading, ReadingReport
from tripwatt.units import M_PER_MILE
from tripwatt.vehicles import Vehicle

Progress = Callable[[int, int], None]
Heights = Callable[[FloatArray, FloatArray], FloatArray]


def read_table(
    path: Path | str,
    mapping: Path | str | ColumnMapping | None = None,
    *,
    strict: bool = False,
    vehicle: Vehicle | None = None,
    progress: Progress | None = None,
    heights: Heights | None = None,
) -> TripSet:
    """Read trips from a CSV or Parquet file, a workbook, an archive, or a folder of them.

    Parameters
    ----------
    path : path
    mapping : path, str or ColumnMapping, optional
        A TOML file, the name of a shipped mapping, or a mapping. By default, columns with canonical names are used; for other
        files a mapping is proposed from header and values.
    strict : bool
        Refuse everything that cannot be read as it stands, and propose no mapping.
    vehicle : Vehicle, optional
        The car whose battery gives the energy of a state of charge, or the voltage, if a proposed mapping needs it.
    progress : callable, optional
        Called with (number of files read, number of all files).
    heights : callable, optional
        Latitudes and longitudes [°] -> heights [m], NaN if unknown. Gives the heights of files that have positions but no heights;
        the positions are not kept.

    Returns
    -------
    TripSet
        Raw trips. `notes` lists what was changed, is missing or was assumed; `report` lists what could not be read.

    Raises
    ------
    InvalidInput
        When nothing can be used; with `strict`, with every fault of the mapping and of all files: a missing column, a unit that
        the values contradict, a current of the wrong sign, two trips with the same id.
    """
    faults: list[Fault] = []
    with unpacked(path, faults) as place:
        kinds = proposed_kinds(place, vehicle) if mapping is None else [given_kind(place, mapping)]
        if strict:
            raise_faults(_proposal_faults(kinds))
        return read_kinds(Path(path), kinds, strict=strict, progress=progress, faults=faults, heights=heights)


def read_kinds(
    path: Path,
    kinds: Sequence[Kind],
    *,
    strict: bool = False,
    progress: Progress | None = None,
    faults: Sequence[Fault] = (),
    heights: Heights | None = None,
) -> TripSet:
    """Read files by the mappings of their kinds; `faults` are those of files that could not be unpacked. See `read_table`."""
    todo = [(n, kind, path, names) for n, kind in enumerate(kinds) for path, names in kind.files.items()]
    done: list[Path] = []

    def read_one(item: tuple[int, Kind, Path, tuple[str, ...]]) -> RawFile:
        number, kind, path, names = item
        if kind.mapping is None:
            file = RawFile(path, number, ColumnMapping("", {}), faults=[*kind.faults])
        else:
            file = open_raw_file(path, kind.mapping, names, number)
            _add_heights(file, heights)
        done.append(path)
        if progress is not None:
            progress(len(done), len(todo))
        return file

    files = read_all(read_one, todo)
    _decide_together([file for file in files if file.values])
    drives: list[RawDrive] = []
    for file in files:
        try:
            drives += drives_of(file) if file.values else []
        except InvalidInput as error:
            file.leave_out(error.faults)
    drives = join_continued(name_uniquely(drop_copies(drives)))
    logs = _logs(drives)
    packed = [FileReading(Path(fault.where).name, faults=(fault,)) for fault in faults]
    ordered = sorted(files, key=lambda file: file.path)
    report = ReadingReport((*packed, *(file.reading(path) for file in ordered)))
    if strict or not logs:
        raise_faults(grouped(report.faults))
    if not logs:
        got = f"{len(files)} files without a trip"
        raise InvalidInput.of("no trips", f"{path}", got, "at least one trip")
    notes = [note for file in files for note in file.notes]
    return TripSet("table", tuple(logs), (*_fleet_notes(logs, files), *notes), report=report)


def _add_heights(file: RawFile, heights: Heights | None) -> None:
    """Add heights at the positions of a file, if it has positions but neither heights nor grades."""
    known = file.values.keys()
    if heights is None or file.table is None or not known or {"elevation_m", "grade"} & known:
        return
    place = positions_of(file.table)
    elevation = None if place is None else heights(*place)
    if elevation is not None and np.isfinite(elevation).any():
        file.entries["elevation_m"] = MappedColumn("positions", "m")
        file.values["elevation_m"] = elevation


def _proposal_faults(kinds: Sequence[Kind]) -> Iterator[Fault]:
    """Yield a fault for each kind of files with a proposed mapping, which a strict reader does not use."""
    for kind in kinds:
        if kind.proposal is not None:
            got = f"columns {', '.join(map(repr, kind.names[:8]))}"
            allowed = (
                "a mapping, or columns with canonical names such as time_s, speed_m_s, voltage_v, current_a"
            )
            fix = f"run `tripwatt mapping suggest {next(iter(kind.files))}` to get a proposal"
            yield Fault("no mapping", "--mapping", got, allowed, fix)


def _decide_together(files: Sequence[RawFile]) -> None:
    """Decide from files with the same columns together the order of day and month, and the units of speed and temperature."""
    for group in _shared(files, "time_s"):
        entry = group[0].entries["time_s"]
        if entry.unit == "timestamp":
            form = decide_format([file.stamps for file in group], entry.format)
            if form != entry.format:
                group[0].notes.append(Flag("format_found", entry.column, form))
            for file in group:
                file.entries["time_s"] = replace(entry, format=form)
    for file in files:
        convert_times(file)
    by_column = [file for file in files if file.mapping.long_name is None]
    timed = [file for file in by_column if "speed_m_s" in file.values]
    for group in by_key(timed, lambda file: file.entries["speed_m_s"]).values():
        # 40: number of files, the largest ones, whose positions and odometer are used to find the unit of
        # speed
        largest = sorted(group, key=lambda file: -file.rows)[:40]
        column, mapped = group[0].entries["speed_m_s"].column, group[0].entries["speed_m_s"].unit
        unit = speed_unit_of(mapped, [_distances_of_file(file) for file in largest])
        if unit != mapped and unit_in("speed_m_s", column) is not None:
            for file in group:
                where, got = f"{file.path} column {column!r}", f"values in {unit} by positions or odometer"
                file.leave_out([Fault("speed contradicts distance", where, got, f"values in {mapped}")])
            continue
        use_unit(group, "speed_m_s", unit)
        for high in _shared(group, "elevation_m") if mapped != unit == "mph" else ():
            use_unit(high, "elevation_m", "ft")
    name = "battery_temperature_degc"
    for group in _shared(by_column, "ambient_temperature_degc"):
        beside = [file for file in group if name in file.values] or group
        air = [file.values["ambient_temperature_degc"] for file in beside]
        unit = group[0].entries["ambient_temperature_degc"].unit
        battery = [in_our_unit(file, name) for file in beside if name in file.values]
        use_unit(group, "ambient_temperature_degc", air_unit_of(unit, air, battery))


def _shared(files: Sequence[RawFile], ours: str) -> list[list[RawFile]]:
    """Files grouped by the column that they have for our column `ours`; columns whose name states a unit are left out, except time."""
    if ours != "time_s":
        files = [f for f in files if ours in f.values and unit_in(ours, f.entries[ours].column) is None]
    return [*by_key(files, lambda file: file.entries[ours]).values()]


def _distances_of_file(file: RawFile) -> Distances:
    if file.table is None:
        return Distances()
    before = len(file.faults)
    distances = distances_of(file.table, file.values["time_s"], in_our_unit(file, "speed_m_s"))
    del file.faults[before:]  # positions are only used for this check, so their faults do not matter
    return distances


def _logs(drives: Sequence[RawDrive]) -> list[Log]:
    """The logs of drives.

    The sign of a current or power is reversed if it would charge the battery while the car accelerates. A drive whose state of charge
    contradicts its energy, or whose grades contradict its heights, is left out.
    """
    logs = [log_of(drive) for drive in drives]
    for kind in sorted({drive.files[0].kind for drive in drives}):
        members = [k for k, drive in enumerate(drives) if drive.files[0].kind == kind]
        mapping = drives[members[0]].files[0].mapping
        correlations = [c for k in members if (c := _correlation(logs[k])) is not None]
        by_charge = {k: ratio for k in members if (ratio := _energy_by_charge(logs[k], mapping)) is not None}
        evidence = correlations or [*by_charge.values()]
        if evidence and float(np.median(evidence)) < (WRONG_SIGN if correlations else 0.0):
            name = (mapping.columns.get("current_a") or mapping.columns[POWER]).column
            stated, right = ("discharge", "charge") if mapping.discharge_sign > 0 else ("charge", "discharge")
            got = f"the car would charge while it accelerates in most of {len(correlations)} trips"
            got = got if correlations else "the battery would charge while its state of charge falls"
            allowed = f'[current] positive = "{right}" in place of "{stated}"'
            fix = f"change it in {mapping.source}"
            fault = Fault("current has the wrong sign", f"column {name!r}", got, allowed, fix)
            drives[members[0]].files[0].faults.append(fault)
            for k in members:
                drives[k].files[0].mapping = replace(mapping, discharge_sign=-mapping.discharge_sign)
                logs[k] = log_of(drives[k])
            by_charge = {k: -ratio for k, ratio in by_charge.items()}
        for k in members:
            for fault in _contradictions(logs[k], by_charge.get(k, 1.0)):
                for file in drives[k].files:
                    file.leave_out([replace(fault, where=f"{file.path}")])
    used = [all(file.values for file in drive.files) for drive in drives]
    for drive in (drive for drive, is_used in zip(drives, used, strict=True) if is_used):
        for file in drive.files:
            file.logs += 1
    return [log for log, is_used in zip(logs, used, strict=True) if is_used]


def _energy_by_charge(log: Log, mapping: ColumnMapping) -> float | None:
    """Measured energy over that of the change of the state of charge; None if they cannot be compared."""
    name = next((name for name in ("soc", "displayed_soc") if log.has(name)), "")
    energy = observed_cumulative_energy(log.samples) if log.has("voltage_v", "current_a") else None
    # 60.0: a log of less than a minute has a wrong unit of time, which the audit names
    if mapping.usable_capacity_kwh is None or not name or energy is None or log.duration_s < 60.0:
        return None
    time, charge = log.array("time_s"), log.array(name)
    # nobody knows what a battery gave and got in a gap
    piece = np.cumsum(changes(time) > LONGEST_GAP_S)
    known = np.flatnonzero(np.isfinite(charge))
    inside = np.diff(piece[known]) == 0
    taken, fall = (float(np.diff(values[known])[inside].sum()) for values in (energy, -charge))
    # 0.05: smallest change of the state of charge that is compared: five steps of a percent
    return taken / (1000.0 * mapping.usable_capacity_kwh * fall) if abs(fall) >= 0.05 else None


def _contradictions(log: Log, energy_by_charge: float) -> Iterator[Fault]:
    """A fault for each pair of signals of a log that contradict each other by more than their errors. O(samples)."""
    # 0.5, 2.0: no ageing of a battery and no reserve of its charge explains such a ratio
    if not 0.5 <= energy_by_charge <= 2.0:
        got = f"{energy_by_charge:.3g} of the energy of the change of the state of charge"
        fix = "check the unit of power or current in the mapping, and the car"
        yield Fault("energy contradicts state of charge", "", got, "0.5 to 2", fix)
    names = ("time_s", "speed_m_s", "grade", "elevation_m")
    columns = np.array([log.array(name) for name in names if log.has(name)])
    rows = np.isfinite(columns).all(axis=0)
    # 0.5: least share of rows with all of them; grades between rarer rows are unknown
    if len(columns) < len(names) or rows.mean() < 0.5:
        return
    time, speed, grade, height = columns[:, rows]
    driven = distance_driven(running_sum(np.clip(np.diff(time), 0.0, LONGEST_GAP_S)), speed)
    by_grade = distance_driven(driven, grade)  # the integral of the grade over the way
    at_m = np.arange(0.0, driven[-1], 1000.0)
    if len(at_m) < 6:  # five climbs of a kilometre
        return
    climbs = [np.diff(np.interp(at_m, driven, heights)) for heights in (by_grade, height)]
    # the middle 68 %: an offset of the grades changes all climbs alike, and few wrong heights are left to the audit
    sizes = [float(np.ptp(np.quantile(x, (0.16, 0.84)))) / 2.0 for x in (climbs[0] - climbs[1], *climbs)]
    # choices: 15 m for the errors of two heights by satellite, and 30 % for the scale of a sensor of inclination
    allowed = 15.0 + 0.3 * max(sizes[1:])
    if sizes[0] > allowed:
        got = f"{sizes[0]:.0f} m apart over a kilometre"
        fix = "check unit and sign of the grade in the mapping"
        yield Fault("grade contradicts heights", "", got, f"at most {allowed:.0f} m", fix)


def _correlation(log: Log) -> float | None:
    if not log.has("speed_m_s", "voltage_v", "current_a"):
        return None
    power = log.array("voltage_v") * log.array("current_a")
    mass = apparent_mass(log.array("time_s"), log.array("speed_m_s"), power)
    return None if mass is None else mass[1]


def _fleet_notes(logs: Sequence[Log], files: Sequence[RawFile]) -> Iterator[Flag]:
    if not any(log.has("elevation_m") or log.has("grade") for log in logs):
        yield Flag("no_elevation", "table")
    unread = [*dict.fromkeys(name for file in files for name in file.unread)]
    if unread:
        more = f" and {len(unread) - 12} more" if len(unread) > 12 else ""
        yield Flag("columns_unread", "table", ", ".join(unread[:12]) + more)
    if not any(log.observed_energy_wh is not None for log in logs):
        yield Flag("no_energy", "table")
    mappings = [file.mapping for file in files if file.logs]
    for volts in {m.nominal_voltage_v for m in mappings if {POWER, "current_a"} & set(m.columns)} - {None}:
        yield Flag("nominal_voltage", "table", volts, "V")
    shares = [
        log.observed_energy_std_wh / max(abs(log.observed_energy_wh or 0.0), log.observed_energy_std_wh, 1e-9)
        for log in logs
        if log.observed_energy_std_wh is not None and not log.has("voltage_v", "current_a")
    ]
    capacity = next((m.usable_capacity_kwh for m in mappings if m.usable_capacity_kwh is not None), None)
    if shares and capacity is not None:
        yield Flag("energy_from_soc", f"{capacity:g} kWh", float(np.median(shares)), "1")


PLACES: Final = (
    re.compile(r"^(gps |v p |position )?(lat|latitude)\b"),
    re.compile(r"^(gps |v p |position )?(lon|lng|long|longitude)\b"),
)
ODOMETER: Final = re.compile(r"^(odo|odometer|mileage|kilometerstand|v p odometer)\b")
M_PER_DEGREE: Final = 111_195.0
NEAR: Final = 0.15
"""Tolerance of the logarithm of a ratio of distances: units of speed differ by a factor of 1.6 or more, distances by a few percent."""


class Distances(NamedTuple):
    """Distances [m] of one file by its speed in the assumed unit, and over the same samples by positions and by the odometer."""

    speed_at_positions: float = 0.0
    positions: float = 0.0
    speed_at_odometer: float = 0.0
    odometer: float = 0.0


def distances_of(table: TableFile, time_s: FloatArray, speed_m_s: FloatArray) -> Distances:
    """Distances of a file by speed, positions and odometer. O(samples).

    Parameters
    ----------
    table : TableFile
    time_s, speed_m_s : ndarray, shape (rows,)
        NaN = missing value.
    """
    step = np.diff(time_s)
    mean = 0.5 * (speed_m_s[1:] + speed_m_s[:-1])
    # 30.0: over a longer step the mean of two speeds is no measurement
    # 90.0: speeds above this, in the assumed unit, count as wrong cells and are not used
    use = (step > 0.0) & (step <= 30.0) & (mean < 90.0)

    def compare(moved: FloatArray, use: BoolArray) -> tuple[float, float]:
        rows = use & np.isfinite(moved) & (moved >= 0.0)
        return float((mean * step)[rows].sum()), float(moved[rows].sum())

    speed_and_positions = speed_and_odometer = (0.0, 0.0)
    place, counter = positions_of(table), _named(table, ODOMETER)
    odometer = None if counter is None else _numbers_of(table, counter)
    if place is not None:
        latitude, longitude = place
        north = np.diff(latitude) * M_PER_DEGREE
        east = np.diff(longitude) * M_PER_DEGREE * np.cos(np.radians(latitude[1:]))
        # 3.0: below this speed the changes of position are mostly errors and are not used
        speed_and_positions = compare(np.hypot(north, east), use & (mean > 3.0))
    if odometer is not None:
        to_m = M_PER_MILE if "mi" in (counter or "").lower() else 1000.0
        speed_and_odometer = compare(to_m * np.diff(odometer), use)
    return Distances(*speed_and_positions, *speed_and_odometer)


def positions_of(table: TableFile) -> tuple[FloatArray, FloatArray] | None:
    """Latitude and longitude of each row [°], NaN if missing; None if the file has no such columns."""
    names = [_named(table, form) for form in PLACES]
    latitude, longitude = (None if name is None else _numbers_of(table, name) for name in names)
    return None if latitude is None or longitude is None else (latitude, longitude)


def _named(table: TableFile, form: re.Pattern[str]) -> str | None:
    return next((name for name in table.names if form.search(words(name))), None)


def speed_unit_of(assumed: str, distances: Iterable[Distances]) -> str:
    """Unit of the speed in files by their distances; the assumed unit if the distances do not show another one.

    Examples
    --------
    >>> speed_unit_of("km/h", [Distances(10_000.0, 16_200.0)]), speed_unit_of("km/h", [])
    ('mph', 'km/h')
    """
    total = Distances(*np.sum([Distances(), *distances], axis=0))
    # by positions, or else by the odometer, which counts whole kilometres
    pairs = ((*total[:2], 2000.0), (*total[2:], 20_000.0))
    ratio = next(
        (moved / by_speed for by_speed, moved, min_m in pairs if by_speed > 0.0 and moved >= min_m), 1.0
    )
    factor = SPEED_UNITS.get({"kmh": "km/h", "kph": "km/h"}.get(assumed, assumed))
    if factor is None or abs(np.log(ratio)) < NEAR:
        return assumed
    true = ratio * factor
    return next((unit for unit, other in SPEED_UNITS.items() if abs(np.log(true / other)) < NEAR), assumed)


def air_unit_of(assumed: str, air: Sequence[FloatArray], battery_degc: Sequence[FloatArray]) -> str:
    """Unit of the outside temperature in files: the one in which it is nearer to the battery temperature.

    Without a battery temperature, values that are too hot for air in °C are taken to be in °F.

    Examples
    --------
    >>> air_unit_of("degc", [np.array([68.0, 50.0])], [np.array([22.0, 15.0])]), air_unit_of("degc", [np.array([21.0])], [])
    ('degf', 'degc')
    """
    values = np.concatenate([*air, np.zeros(0)])
    known = np.isfinite(values)
    if assumed not in ("degc", "degf", "c", "f", "°c", "°f") or not known.any():
        return assumed
    battery = np.concatenate(battery_degc) if len(battery_degc) == len(air) else np.full(len(values), np.nan)
    comparable = known & np.isfinite(battery) & (np.abs(values) < 150.0)
    if comparable.any():
        as_c = float(np.median(np.abs(values[comparable] - battery[comparable])))
        as_f = float(np.median(np.abs((values[comparable] - 32.0) / 1.8 - battery[comparable])))
        is_clear = min(as_c, as_f) < 0.7 * max(as_c, as_f)
        unit = "f" if as_f < as_c else "c"
        return f"deg{unit}" if is_clear and not assumed.endswith(unit) else assumed
    # 57.0: the highest air temperature on record is 56.7 °C (WMO, Furnace Creek 1913)
    hot = float(np.quantile(values[known], 0.98)) > 57.0
    return "degf" if hot and assumed.endswith("c") else assumed


def _numbers_of(table: TableFile, name: str) -> FloatArray | None:
    """A column of numbers, which may be written as degrees and minutes as in "48 12.345"; None if it cannot be read."""
    texts = or_none(table.texts, name)
    if texts is None:
        return None
    if not any(" " in text.strip() for text in texts[:50]):
        return table.numbers([name])[0]
    values = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        parts = text.replace(",", ".").split()
        has_minutes = len(parts) == 2
        values[i] = abs(number_in(parts[0])) + number_in(parts[1]) / 60.0 if has_minutes else number_in(text)
    return values
