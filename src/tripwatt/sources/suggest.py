"""Proposal of a mapping for a table from its header and its values, with a reason for each guess.

The name of a column is a hint, its values decide: a voltage has to be that of a traction battery, a time has to increase.
If a name has no unit, physics gives the unit: in the wrong unit of speed the mass of the car would be impossible.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, number_in
from tripwatt.errors import Fault, InvalidInput, and_more, excerpt, or_none, percent
from tripwatt.sources.clocks import clock_only, decide_format
from tripwatt.sources.columnar import CsvTable, TableFile, open_table, stamp_texts, table_files
from tripwatt.sources.delimited import column_key
from tripwatt.sources.evidence import (
    FURTHEST_KG,
    SINCE_1970,
    STAND_IN_V,
    Flow,
    Guess,
    best_flow,
    fits,
    speed_unit,
    stamp_format,
    unit_of_values,
)
from tripwatt.sources.mapping import POWER, TIME_STAMPS, UNITS, ColumnMapping, load_mapping, shipped_mappings
from tripwatt.sources.naming import (
    candidates,
    column_names,
    is_excluded,
    is_something_else,
    may_hold,
    unit_in,
    unit_named,
    words,
)
from tripwatt.trips import COLUMNS

SPELLED: Final[Mapping[str, str]] = {
    unit.lower(): unit
    for unit in ("V", "mV", "kV", "A", "mA", "dA", "cA", "W", "kW", "PS", "degC", "degF", "K", "Nm")
} | {"c": "degC", "f": "degF", "kmh": "km/h", "kph": "km/h"}
"""Unit in lower case -> usual spelling."""


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A proposed mapping.

    Attributes
    ----------
    toml : str
        The mapping as a text to be saved, with the reason in each line.
    guesses : tuple of Guess
    missing : tuple of str
        What has to be added by hand before the mapping can be used.
    shipped : str or None
        Name of a shipped mapping whose columns the table has.
    unused : tuple of str
        Columns of the table that were not recognised.
    unfit : tuple of Fault
        Columns that by their names are time, speed, power, voltage or current, and whose cells are not.
    """

    toml: str
    guesses: tuple[Guess, ...]
    missing: tuple[str, ...]
    shipped: str | None
    unused: tuple[str, ...] = ()
    unfit: tuple[Fault, ...] = ()


def _missing_entries(guesses: Mapping[str, Guess]) -> list[str]:
    """What has to be added to a proposal by hand: a column or an entry of `[battery]`."""
    missing = [ours for ours in ("time_s", "speed_m_s") if ours not in guesses]
    if "current_a" in guesses and "voltage_v" not in guesses and POWER not in guesses:
        return [*missing, "[battery] nominal_voltage_v"]
    if "current_a" in guesses or POWER in guesses:
        return missing
    by_charge = "soc" in guesses or "displayed_soc" in guesses
    return [*missing, "[battery] usable_capacity_kwh" if by_charge else "voltage_v and current_a"]


def _sections_of(
    guesses: Mapping[str, Guess], flow: Flow, columns: Mapping[str, FloatArray], decimal: str
) -> dict[str, list[str]]:
    """The lines of each optional table of a proposal."""
    sections: dict[str, list[str]] = {name: [] for name in ("current", "trip", "battery", "file")}
    if flow.sign and {"current_a", POWER} & guesses.keys():
        sections["current"].append(f'positive = "{flow.sign}"  # {flow.why_sign}')
    if POWER in guesses and "voltage_v" not in guesses:
        note = "assumed, because no voltage is logged; only the power is measured"
        sections["battery"].append(f"nominal_voltage_v = {STAND_IN_V:g}  # {note}")
    if decimal == ",":
        sections["file"].append('decimal = ","  # the numbers have a decimal comma')
    missing = {
        guess.column: float(np.isnan(columns[guess.column]).mean())
        for ours, guess in guesses.items()
        if ours in ("speed_m_s", "voltage_v", "current_a", POWER) and guess.column in columns
    }
    column = max(missing, key=lambda name: missing[name], default="")
    # 0.2: if a larger share of a measured column is missing, the logger is taken to write a value only if
    # it changes
    if missing.get(column, 0.0) > 0.2:
        why = f"{percent(missing[column])} of {quoted(column)} is missing: the last value is held"
        sections["file"].append(f"hold_s = 10  # {why}")
    return sections


def _suggestion_of(
    path: Path,
    guesses: Mapping[str, Guess],
    sections: Mapping[str, Sequence[str]],
    missing: Sequence[str],
    unused: Sequence[str],
    shipped: str | None,
    *,
    always: Sequence[str] | None = None,
) -> Suggestion:
    """The proposal with its TOML; entries that are not in `always` are optional, by default none."""
    lines = [f"# Proposed for {_comment(path.name)} from its header and values. Check every line."]
    if shipped:
        lines.append(f"# The columns are those of the shipped mapping {shipped!r}: try --mapping {shipped}.")
    lines += [f"# TO DO: add {what}" for what in missing]
    if unused:
        shown = ", ".join(quoted(n) for n in unused[:12])
        lines.append(f"# Not used: {shown}" + (f" and {len(unused) - 12} more" if len(unused) > 12 else ""))
    lines.append("[columns]")
    for guess in guesses.values():
        entry = [f"column = {quoted(guess.column)}", f'unit = "{SPELLED.get(guess.unit, guess.unit)}"']
        more = {"date": guess.date, "format": guess.format}
        entry += [f"{key} = {quoted(text)}" for key, text in more.items() if text]
        entry += [] if always is None or guess.ours in always else ["optional = true"]
        lines.append(f"{guess.ours} = {{ {', '.join(entry)} }}  # {_comment(guess.why)}")
    for name, settings in sections.items():
        lines += ["", f"[{name}]", *settings] if settings else []
    toml = "\n".join(lines) + "\n"
    return Suggestion(toml, tuple(guesses.values()), tuple(missing), shipped, tuple(unused))


def _comment(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


def quoted(text: str) -> str:
    """A text as a basic string of TOML.

    Examples
    --------
    >>> quoted("speed [km/h]")
    '"speed [km/h]"'
    """
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


DAY_FORMATS: Final = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%d-%m-%Y", "%m-%d-%Y", "%d.%m.%y", "%m/%d/%y", "%d/%m/%y", "%Y%m%d", "%d-%b-%Y")  # fmt: skip

MEASURED_FLOW: Final = (POWER, "voltage_v", "current_a")
FITTING: Final[Mapping[str, str]] = {
    "time_s": "seconds that increase, or times such as 2024-05-31T08:15:00",
    "speed_m_s": "numbers of a speed",
}
"""Our column -> the cells that it can have."""

OWN_NAME: Final = "canonical name"
NAME_AND_UNIT: Final = "name and unit match"
NAME_ONLY: Final = "name matches"
AS_SHIPPED: Final = "as in the shipped mapping"

_TRIP_NAME: Final = re.compile(
    r"^(trip|drive|journey|fahrt|ride|route|session|segment|track)( ?(id|no|nr|num|number|name|uid|uuid|index|idx))?$"
)
_DATE_OF_NUMBER: Final = re.compile(r"\d{1,2}[. -]+[^\W\d]{3,}\.?|[^\W\d]{3,}[. -]+\d{1,2}")
_VEHICLE_NAME: Final = re.compile(
    r"^(vin|(vehicle|veh|car|fahrzeug|object|device|asset)( ?(id|no|nr|num|name|uid|vin))?)$"
)


def suggest_mapping(path: Path | str, names: Sequence[str] = (), beside: Sequence[Path] = ()) -> Suggestion:
    """Propose a mapping for a CSV or Parquet file, or for the largest one of a folder.

    Parameters
    ----------
    path : path
    names : sequence of str
        Header to use for a file without one.
    beside : sequence of Path
        Other files of the same logger, which show the order of day and month. The other files of a folder are added to them.

    Raises
    ------
    InvalidInput
        When there is no file, or none can be read as a table.
    """
    files = table_files(Path(path))
    files.sort(key=lambda file: -file.stat().st_size)
    readable = ((file, read) for file in files if (read := or_none(_readable, file, names)) is not None)
    path, (table, columns, decimal) = next(readable, None) or (files[0], _readable(files[0], names))
    beside = [*beside, *(file for file in files if file != path)]
    shipped = next((name for name in shipped_mappings() if _has_all(table, load_mapping(name))), None)
    if shipped is not None and load_mapping(shipped).long_name is not None:
        return _of_signals(path, table, load_mapping(shipped))
    trip, longest = _trip_column(table, columns)
    guesses = _by_name(table, columns, trip)
    if "time_s" not in guesses:
        guesses |= _rising(table, columns, {g.column for g in guesses.values()} | {trip or ""})
    if shipped is not None:
        guesses = _as_shipped(guesses, load_mapping(shipped), table, columns)
    vehicle = next((name for name in table.names if _VEHICLE_NAME.match(words(name))), None)
    keys = {trip or "", vehicle or ""}
    taken = {g.column for g in guesses.values()} | keys
    drive = {name: values[longest] for name, values in columns.items()}
    unknown = {n: values for n, values in drive.items() if n not in taken and not is_something_else(n)}
    labels = {name: _label(table, name) for name in unknown}
    clock = _clock(guesses, drive, int(longest.sum()))
    flow = best_flow(clock, _in_our_units(guesses, drive), unknown, labels)
    guesses |= {guess.ours: guess for guess in flow.guesses}
    if "time_s" in guesses and guesses["time_s"].unit == "timestamp":
        guesses["time_s"] = _with_day(guesses["time_s"], table, beside)
    if {"voltage_v", "current_a"} <= guesses.keys():
        guesses.pop(POWER, None)
    guesses = {ours: guesses[ours] for ours in column_names() if ours in guesses}
    guesses = _with_american_check(_with_speed_unit(guesses, flow))
    sections = _sections_of(guesses, flow, columns, decimal)
    if trip:
        sections["trip"].append(f"column = {quoted(trip)}")
    if vehicle:
        count = len(set(table.texts(vehicle)) - {""})
        sections["trip"].append(f"vehicle = {quoted(vehicle)}  # {count} in this file")
    used = {name for g in guesses.values() for name in (g.column, g.date)} | keys
    unused = [n for n in dict.fromkeys(table.names) if n and n not in used]
    suggestion = _suggestion_of(path, guesses, sections, _missing_entries(guesses), unused, shipped)
    return replace(suggestion, unfit=tuple(_unfit(path, table, columns, guesses)))


def _of_signals(path: Path, table: TableFile, mapping: ColumnMapping) -> Suggestion:
    """A proposal for a table with a row for each value, made from the shipped mapping of such a table."""
    column = next(n for n in table.names if column_key(n) == column_key(mapping.long_name or ""))
    names = table.texts(column)
    signals, missing = sorted(set(names) - {""}), []
    guesses: dict[str, Guess] = {}
    for ours, entry in mapping.columns.items():
        likely = candidates(ours, signals)
        why = f"of the shipped mapping {mapping.source!r}"
        if likely and entry.column not in signals and ours != "time_s":
            why = f"CHECK: similar name, in place of {entry.column!r}"
            guesses[ours] = Guess(ours, likely[0], entry.unit, why)
        elif ours == "time_s" or entry.column in signals or entry.optional:
            guesses[ours] = Guess(ours, entry.column, entry.unit, why)
        else:
            missing.append(f"the signal of {ours}, {entry.column!r} is not in the file")
    unit_column = next((n for n in table.names if column_key(n) in ("units", "unit")), None)
    units = dict(zip(names, table.texts(unit_column), strict=True)) if unit_column else {}
    for ours in (ours for ours in column_names() if ours not in mapping.columns and ours != POWER):
        taken = {guess.column for guess in guesses.values()}
        likely = candidates(ours, [signal for signal in signals if signal not in taken])
        unit = unit_named(ours, units.get(likely[0], "")) if likely else None
        if unit is not None:
            guesses[ours] = Guess(ours, likely[0], unit, NAME_AND_UNIT)
    sections = {
        "current": ['positive = "discharge"'],
        "long": [f"name = {quoted(mapping.long_name or '')}", f"value = {quoted(mapping.long_value or '')}"],
        "file": [f"hold_s = {mapping.hold_s:g}"],
    }
    unused = [signal for signal in signals if signal not in {guess.column for guess in guesses.values()}]
    always = [ours for ours, entry in mapping.columns.items() if not entry.optional]
    return _suggestion_of(path, guesses, sections, missing, unused, mapping.source, always=always)


def _readable(path: Path, names: Sequence[str]) -> tuple[TableFile, dict[str, FloatArray], str]:
    """The table of a file, its columns of numbers by name, and its decimal separator."""
    faults: list[Fault] = []
    table = open_table(path, names=names, faults=faults)
    columns: dict[str, FloatArray] = {}
    commas, cells = 0, 0
    for name in dict.fromkeys(n for n in table.names if n):
        faults.clear()
        read = or_none(table.numbers, [name])
        if read is None:
            continue
        (values,) = read
        known = int(np.isfinite(values).sum())
        by_comma = sum(fault.count for fault in faults if fault.what == "decimal comma")
        # 0.1: largest ratio of unreadable cells to numbers in a column of numbers
        if sum(fault.count for fault in faults) - by_comma <= 0.1 * known:
            columns[name] = values
            commas, cells = commas + by_comma, cells + known * (by_comma > 0)
    return table, columns, "," if commas > 0.5 * cells else "."


def _with_day(guess: Guess, table: TableFile, beside: Sequence[Path]) -> Guess:
    """The guess of a time stamp, completed with the column of the day and with the order of day and month from all files."""
    if clock_only(guess.format):
        day_name = re.compile(r"\b(date|day|datum|tag|fecha|jour)\b")
        for name in (n for n in table.names if n != guess.column and day_name.search(words(n))):
            form = next((f for f in DAY_FORMATS if fits(table.texts(name), f)), None)
            if form is not None:
                why = f"{guess.why}; the day is in {quoted(name)}"
                guess = replace(guess, date=name, format=f"{form} {guess.format}", why=why)
                break
    texts = [stamp_texts(table, guess.column, guess.date)]
    # 60: largest number of other files whose time stamps are read
    for file in beside[:60]:
        with contextlib.suppress(InvalidInput, ValueError):
            texts.append(stamp_texts(open_table(file), guess.column, guess.date))
    decided = decide_format(texts, guess.format)
    if decided == guess.format:
        return guess
    return replace(guess, format=decided, why=f"{guess.why.partition('; CHECK')[0]}; by all files {decided}")


def _trip_column(table: TableFile, columns: Mapping[str, FloatArray]) -> tuple[str | None, BoolArray]:
    """A column whose name says that it identifies trips, or None, and the rows of the longest trip."""
    for name in table.names:
        if _TRIP_NAME.match(words(name)):
            keys = pd.Series(columns[name] if name in columns else table.texts(name)).astype(str)
            return name, (keys == keys.value_counts().idxmax()).to_numpy(dtype=bool)
    return None, np.ones(len(next(iter(columns.values()), ())), dtype=bool)


def _by_name(table: TableFile, columns: Mapping[str, FloatArray], trip: str | None) -> dict[str, Guess]:
    """For each of our columns the guess of the likeliest column by name whose values are possible."""
    guesses: dict[str, Guess] = {}
    taken = {trip}
    for ours in column_names():
        free = [n for n in table.names if n and n not in taken]
        named = candidates(ours, free)
        named = [n for n in named if ours not in MEASURED_FLOW or may_hold(ours, _label(table, n))]
        if ours == POWER and not named:
            # the unit shows a power, and only that of a battery is negative at times
            named = [n for n in free if unit_in(POWER, _label(table, n)) and not is_excluded(POWER, n)]
            named = [n for n in named if np.nanmin(columns.get(n, np.zeros(1)), initial=0.0) < 0.0]
        for name in named:
            guess = _with_unit(ours, name, table, columns.get(name))
            if guess is not None:
                guesses[ours] = guess
                taken.add(name)
                break
    return guesses


def _unfit(
    path: Path, table: TableFile, columns: Mapping[str, FloatArray], guesses: Mapping[str, Guess]
) -> Iterator[Fault]:
    """A fault for each signal that is missing although columns have its name: the first cell of each that does not fit."""
    for ours in (ours for ours in ("time_s", "speed_m_s", *MEASURED_FLOW) if ours not in guesses):
        named = candidates(ours, [name for name in table.names if name])
        for name in named if ours in FITTING else [name for name in named if name not in columns]:
            cells = [text for text in table.texts(name) if text]
            wrong = [text for text in cells if np.isnan(number_in(text.replace(",", ".")))] or cells or [""]
            fix = "a spreadsheet made dates of the numbers: export them again, without opening them in it"
            fix = fix if any(_DATE_OF_NUMBER.fullmatch(text) for text in wrong) else ""
            where, got = f"{path} column {name!r}", excerpt(wrong[0]) + and_more(wrong)
            yield Fault("column does not fit", where, got, FITTING.get(ours, "numbers"), fix)


def _stamped(table: TableFile, name: str) -> Guess | None:
    texts = table.texts(name)
    form = stamp_format(texts) if any(":" in text for text in texts) else None  # a date alone is no time
    return None if form is None else Guess("time_s", name, "timestamp", form[1], form[0])


def _label(table: TableFile, name: str) -> str:
    """A column's name, with the unit of the line below the header."""
    head = table.parts[0] if isinstance(table, CsvTable) else None
    units = {} if head is None else dict(zip(head.names, head.units, strict=False))
    return f"{name} [{units[name]}]" if units.get(name) else name


def _with_unit(ours: str, name: str, table: TableFile, values: FloatArray | None) -> Guess | None:
    """The guess with its unit, from the name if it states one, else from the values; None if the values are impossible."""
    if values is None:
        return _stamped(table, name) if ours == "time_s" else None
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    is_own, our_unit = name == ours, COLUMNS[ours].unit.lower() if ours in COLUMNS else "w"
    stated = our_unit if is_own else unit_in(ours, _label(table, name))
    if stated is not None and not (ours == "time_s" and known[0] > SINCE_1970):
        if _possible(ours, stated, known):
            return Guess(ours, name, stated, OWN_NAME if is_own else NAME_AND_UNIT)
        if not is_own:
            return None
    unit, why = unit_of_values(ours, known)
    return Guess(ours, name, unit, f"{NAME_ONLY}; {why}") if _possible(ours, unit, known) else None


def _as_shipped(
    guesses: dict[str, Guess], mapping: ColumnMapping, table: TableFile, columns: Mapping[str, FloatArray]
) -> dict[str, Guess]:
    """The guesses, replaced by the entries of a shipped mapping if the table looks like one of the same logger.

    Names such as "date", "speed" and "power" are used by many loggers. So most of the optional columns have to be there as
    well, and the values have to be possible in the units of the mapping.
    """
    spelled = {column_key(n): n for n in table.names}
    optional = [e.column for e in mapping.columns.values() if e.optional]
    # 0.6: least share of a shipped mapping's optional columns in a table that is taken to be of the same
    # logger
    if sum(column_key(c) in spelled for c in optional) < 0.6 * len(optional):
        return guesses
    replaced: dict[str, Guess] = {}
    for ours, entry in mapping.columns.items():
        name = spelled.get(column_key(entry.column))
        if name is None:
            continue
        if entry.unit not in TIME_STAMPS:
            known = columns.get(name, np.zeros(0))
            known = known[np.isfinite(known)]
            if not len(known):
                continue
            if not _possible(ours, entry.unit, known):
                if not ours.endswith("_degc"):
                    return guesses
                entry = replace(entry, unit=unit_of_values(ours, known)[0])  # the app shows °F
        elif ours in guesses and guesses[ours].column == name:
            entry = replace(entry, unit=guesses[ours].unit, format=guesses[ours].format)
        replaced[ours] = Guess(ours, name, entry.unit, f"{AS_SHIPPED} {mapping.source!r}", entry.format)
    taken = {g.column for g in replaced.values()}
    return {ours: g for ours, g in guesses.items() if g.column not in taken} | replaced


def _rising(table: TableFile, columns: Mapping[str, FloatArray], taken: set[str]) -> dict[str, Guess]:
    """A guess of the time by values alone: the first column that holds time stamps or rises in even steps; empty if none does."""
    for name in (n for n in dict.fromkeys(table.names) if n and n not in taken):
        if name not in columns:
            guess = _stamped(table, name)
            if guess is not None:
                return {"time_s": guess}
        steps = np.diff(columns.get(name, np.zeros(0)))
        if len(steps) > 9 and (steps > 0).all() and np.quantile(steps, 0.9) <= 2.0 * np.median(steps):
            unit, why = unit_of_values("time_s", columns[name])
            why = f"no name matches; the values increase in even steps; {why}"
            return {"time_s": Guess("time_s", name, unit, why)}
    return {}


def _possible(ours: str, unit: str, known: FloatArray) -> bool:
    """Whether values in this unit are possible for our column: by their median; a time by its increase."""
    if ours == "time_s":
        # 0.9: least share of rows in which a column of time does not decrease; it may decrease where
        # another trip starts
        rises = len(known) > 1 and float(np.mean(np.diff(known) >= 0.0)) > 0.9
        # a temperature that hardly moves rises as well
        # 0.08: least number of distinct times per sample in a column of time: a logger of 10 Hz may write
        # whole seconds
        return rises and len(np.unique(known)) >= max(2, 0.08 * len(known))
    if ours not in COLUMNS:
        return True
    factor, offset = UNITS[ours][unit]
    middle = float(np.median(known)) * factor + offset
    column = COLUMNS[ours]
    if ours == "voltage_v" and middle == 0.0:  # parked most of the time
        middle = float(np.max(known)) * factor
    return column.minimum <= middle <= column.maximum


def _clock(guesses: Mapping[str, Guess], drive: Mapping[str, FloatArray], rows: int) -> FloatArray:
    time = guesses.get("time_s")
    if time is None or time.column not in drive:
        return np.arange(rows, dtype=np.float64)
    factor = (TIME_STAMPS | {unit: factor for unit, (factor, _) in UNITS["time_s"].items()})[time.unit]
    return np.asarray((drive[time.column] - drive[time.column][:1]) * factor)


def _in_our_units(guesses: Mapping[str, Guess], drive: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The columns guessed for speed, voltage, current and power, in our units."""
    wanted = {ours: guesses[ours] for ours in ("speed_m_s", *MEASURED_FLOW) if ours in guesses}
    known = {ours: guess for ours, guess in wanted.items() if guess.column in drive}
    units = {ours: UNITS[ours][guess.unit.lower()] for ours, guess in known.items()}
    return {ours: drive[known[ours].column] * factor + offset for ours, (factor, offset) in units.items()}


def _with_speed_unit(guesses: dict[str, Guess], flow: Flow) -> dict[str, Guess]:
    """The guesses with the unit of speed in which the car's mass is plausible; if a name states another unit, with a note to check."""
    speed = guesses.get("speed_m_s")
    if speed is None or flow.mass_kg is None or speed.why == OWN_NAME:
        return guesses
    unit, why = speed_unit(speed.unit, flow.mass_kg)
    if speed.why == NAME_AND_UNIT:
        if unit == speed.unit or FURTHEST_KG[0] <= flow.mass_kg <= FURTHEST_KG[1]:
            return guesses
        return {**guesses, "speed_m_s": replace(speed, why=f"{speed.why}; CHECK: {why}")}
    return {**guesses, "speed_m_s": replace(speed, unit=unit, why=f"{speed.why.split(':')[0]}; {why}")}


def _with_american_check(guesses: dict[str, Guess]) -> dict[str, Guess]:
    """The guesses with notes to check for °F and feet where no unit is stated, if another column is in miles or feet."""
    units = {guesses[ours].unit for ours in ("speed_m_s", "elevation_m") if ours in guesses}
    if not units & {"mph", "ft"}:
        return guesses
    doubts = {"ambient_temperature_degc": ("degc", "°F"), "elevation_m": ("m", "feet")}
    return guesses | {
        ours: replace(guess, why=f"{guess.why}; CHECK: may be {other}, because other units are miles or feet")
        for ours, (unit, other) in doubts.items()
        if (guess := guesses.get(ours)) is not None
        and guess.unit == unit
        and guess.why.startswith((NAME_ONLY, AS_SHIPPED))
    }


def _has_all(table: TableFile, mapping: ColumnMapping) -> bool:
    """Whether a table has the columns that a mapping needs."""
    keys = {column_key(n) for n in table.names}
    needed = [entry.column for entry in mapping.columns.values() if not entry.optional]
    if mapping.long_name is not None:
        needed = [mapping.long_name, mapping.long_value or ""]
    return {*map(column_key, needed)} <= keys
