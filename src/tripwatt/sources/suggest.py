"""Proposes a mapping for a table from its header and from the range of its values, and explains each guess."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
import numpy.typing as npt

from tripwatt.errors import Fault, InvalidInput
from tripwatt.inertia import apparent_mass
from tripwatt.sources.columnar import Table, open_table
from tripwatt.sources.delimited import column_key
from tripwatt.sources.mapping import POWER, TIME_STAMPS, UNITS, load_mapping, shipped_mappings
from tripwatt.trips import COLUMNS

FloatArray = npt.NDArray[np.float64]

NAMES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "time_s": (
            r"^(unix ?)?time(stamp)?( ?utc)?\b",
            r"^utc$",
            r"\btime\b",
            r"timestamp",
            r"^t$",
            r"^date",
            r"seconds",
        ),
        "speed_m_s": (r"vehicle ?speed", r"^speed", r"velocity", r"speed", r"^v$"),
        "voltage_v": (r"(hv|pack|traction|battery|bms).*(voltage|volt)", r"voltage", r"^volt", r"^u$"),
        "current_a": (r"(hv|pack|traction|battery|bms).*(current|amp)", r"current", r"^amp", r"^i$"),
        POWER: (r"(hv|pack|traction|battery|bms).*power", r"^power"),
        "displayed_soc": (
            r"display.*(soc|state of charge)",
            r"usable.*(level|soc)",
            r"(soc|state of charge).*display",
        ),
        "soc": (r"\bsoc\b", r"state of charge", r"battery ?level", r"soc"),
        "elevation_m": (r"elevation", r"altitude", r"\balt\b", r"height"),
        "grade": (r"grade", r"slope", r"inclination"),
        "ambient_temperature_degc": (r"ambient", r"outside", r"\boat\b", r"ext(ernal)?[_ ]?temp", r"outdoor"),
        "cabin_temperature_degc": (r"cabin", r"inside[_ ]?temp", r"interior"),
        "battery_temperature_degc": (r"batt(ery)?[_ ]?temp", r"temp.*batt"),
        "motor_torque_nm": (r"torque",),
        "heating_power_w": (r"heat(er|ing)[_ ]?power",),
        "aircon_power_w": (r"(air ?con\w*|a/?c|climate|hvac)[_ ]?power",),
    }
)
"""What loggers call our columns, the likeliest first; matched on `column_key` with underscores as blanks."""

NOT_OF_THE_PACK: Final = re.compile(
    r"12 ?v|module|cell|min\b|max\b|charger|obd adapter|requested|target|set ?point"
)
"""Words of columns that share a name with the pack's but are something else."""

_UNIT_IN_NAME: Final = re.compile(
    r"[\[(]\s*([^\])]+?)\s*[\])]|_(kmh|kph|mph|ms|kw|w|v|a|degc|c|f|m|ft|s|pct|percent)$"
)
_UNIT_WORDS: Final = MappingProxyType(
    {
        "celsius": "degc",
        "deg c": "degc",
        "pct": "%",
        "meter": "m",
        "meters": "m",
        "watts": "w",
        "meters/second": "m/s",
    }
)
_SPELLED: Final = MappingProxyType(
    {
        "v": "V",
        "a": "A",
        "w": "W",
        "kw": "kW",
        "degc": "degC",
        "c": "degC",
        "degf": "degF",
        "f": "degF",
        "k": "K",
    }
    | {"nm": "Nm", "mv": "mV", "kv": "kV", "ma": "mA", "kmh": "km/h", "kph": "km/h"}
)


@dataclass(frozen=True, slots=True)
class Guess:
    """One of our columns, the column of the table that it may be, and why."""

    ours: str
    column: str
    unit: str
    why: str


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A proposed mapping.

    Attributes
    ----------
    toml : str
        The mapping, ready to be saved; each line says why.
    guesses : tuple of Guess
    missing : tuple of str
        What has to be added by hand before the mapping can be used.
    shipped : str or None
        A shipped mapping whose columns the table has.
    """

    toml: str
    guesses: tuple[Guess, ...]
    missing: tuple[str, ...]
    shipped: str | None


def suggest_mapping(path: Path | str) -> Suggestion:
    """Propose a mapping for a CSV or Parquet file.

    Raises
    ------
    InvalidInput
        When the file cannot be read as a table.
    """
    path = Path(path)
    if not path.is_file():
        raise InvalidInput(Fault("no such file", f"{path}", "", "a CSV or Parquet file"))
    table = open_table(path)
    columns = _readable(table)
    guesses: dict[str, Guess] = {}
    taken: set[str] = set()
    for ours, patterns in NAMES.items():
        found = _best_name(ours, patterns, [n for n in table.names if n not in taken])
        if found is None:
            continue
        guess = _with_unit(ours, found, columns.get(found))
        if guess is not None:
            guesses[ours] = guess
            taken.add(found)
    if {"voltage_v", "current_a"} <= guesses.keys():
        guesses.pop(POWER, None)
    sign, why_sign = _sign(guesses, columns)
    trip = next((n for n in table.names if re.search(r"^(trip|drive|journey)([ _]?id)?$", _words(n))), None)
    missing = tuple(_missing(guesses))
    shipped = next((name for name in shipped_mappings() if _has_all(table, name)), None)
    toml = _render(path, guesses, sign, why_sign, trip, missing, shipped)
    return Suggestion(toml, tuple(guesses.values()), missing, shipped)


def _words(name: str) -> str:
    return column_key(name).replace("_", " ").replace(".", " ")


def _readable(table: Table) -> dict[str, FloatArray]:
    """Every column that holds numbers."""
    columns: dict[str, FloatArray] = {}
    for name in dict.fromkeys(n for n in table.names if n):
        try:
            (columns[name],) = table.numbers([name])
        except InvalidInput:
            continue
    return columns


def _best_name(ours: str, patterns: Sequence[str], names: Sequence[str]) -> str | None:
    if ours in names:
        return ours
    for pattern in patterns:
        for name in names:
            words = _words(name)
            if re.search(pattern, words) and not NOT_OF_THE_PACK.search(words):
                return name
    return None


def _with_unit(ours: str, name: str, values: FloatArray | None) -> Guess | None:
    """The guess with its unit, from the name if it says one, else from the values; None for a column of text."""
    if values is None:
        return Guess(ours, name, "timestamp", "named like it, and no numbers") if ours == "time_s" else None
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    if name == ours:
        return Guess(ours, name, _own(ours), "our own name")
    match = _UNIT_IN_NAME.search(column_key(name))
    if match:
        said = (match[1] or match[2] or "").lower()
        said = _UNIT_WORDS.get(said, said)
        if said in UNITS[ours]:
            return Guess(ours, name, said, "named like it, and the name says the unit")
    unit, why = _unit_from_values(ours, known)
    return Guess(ours, name, unit, f"named like it; {why}")


def _own(ours: str) -> str:
    if ours == "time_s":
        return "s"
    return COLUMNS[ours].unit if ours in COLUMNS else "W"


def _unit_from_values(ours: str, known: FloatArray) -> tuple[str, str]:
    low, high = float(np.min(known)), float(np.max(known))
    seen = f"values of {low:g} to {high:g}"
    if ours == "time_s":
        if low > 1e11:
            return "epoch_ms", f"{seen} are milliseconds since 1970"
        if low > 1e8:
            return "epoch_s", f"{seen} are seconds since 1970"
        step = float(np.median(np.diff(known))) if len(known) > 1 else 1.0
        return ("ms", f"steps of {step:g} are milliseconds") if step >= 50.0 else ("s", f"steps of {step:g}")
    if ours == "speed_m_s":
        return (
            ("km/h", f"{seen} are km/h rather than m/s")
            if high > 45.0
            else ("m/s", f"{seen}: CHECK, m/s or km/h?")
        )
    if ours in ("soc", "displayed_soc", "grade"):
        return ("%", f"{seen} are percent") if high > 1.5 else ("1", f"{seen} are a fraction")
    if ours.endswith("_degc"):
        if low > 200.0:
            return "K", f"{seen} are kelvin"
        return ("degF", f"{seen} are °F") if high > 60.0 and "ambient" in ours else ("degC", f"{seen}")
    if ours.endswith("_w"):
        return ("kW", f"{seen} are kW") if max(abs(low), abs(high)) < 1000.0 else ("W", f"{seen} are W")
    if ours == "voltage_v":
        return ("mV", f"{seen} are mV") if high > 2000.0 else ("V", seen)
    return _own(ours), seen


def _sign(guesses: Mapping[str, Guess], columns: Mapping[str, FloatArray]) -> tuple[str, str]:
    """Which direction of the current is positive: while a car accelerates its battery discharges."""
    flow = guesses.get("current_a") or guesses.get(POWER)
    if flow is None:
        return "", ""
    time, speed = (_ours(guesses.get(n), columns) for n in ("time_s", "speed_m_s"))
    amount = _ours(flow, columns)
    if speed is not None and amount is not None:
        clock = time if time is not None else np.arange(len(speed), dtype=np.float64)
        found = apparent_mass(clock - clock[0], speed, amount)
        if found is not None and abs(found[1]) > 0.3:
            direction = "discharge" if found[1] > 0 else "charge"
            return direction, f"correlation with acceleration {found[1]:.2f}"
    return "discharge", "CHECK: too little driving to tell"


def _ours(guess: Guess | None, columns: Mapping[str, FloatArray]) -> FloatArray | None:
    if guess is None or guess.column not in columns:
        return None
    if guess.unit in TIME_STAMPS:
        return columns[guess.column] * TIME_STAMPS[guess.unit]
    factor, offset = UNITS[guess.ours][guess.unit.lower()]
    return columns[guess.column] * factor + offset


def _missing(guesses: Mapping[str, Guess]) -> list[str]:
    missing = [ours for ours in ("time_s", "speed_m_s") if ours not in guesses]
    if {"voltage_v", "current_a"} <= guesses.keys():
        return missing
    if POWER in guesses:
        return missing if "voltage_v" in guesses else [*missing, "[battery] nominal_voltage_v"]
    if "soc" in guesses or "displayed_soc" in guesses:
        return [*missing, "[battery] usable_capacity_kwh"]
    return [*missing, "voltage_v and current_a"]


def _has_all(table: Table, shipped: str) -> bool:
    mapping = load_mapping(shipped)
    keys = {column_key(n) for n in table.names}
    if mapping.long_name is not None:
        return {column_key(mapping.long_name), column_key(mapping.long_value or "")} <= keys
    return all(column_key(e.column) in keys for e in mapping.columns.values() if not e.optional)


def _render(
    path: Path,
    guesses: Mapping[str, Guess],
    sign: str,
    why_sign: str,
    trip: str | None,
    missing: Sequence[str],
    shipped: str | None,
) -> str:
    lines = [f"# Proposed for {path.name} from its header and values. Check every line."]
    if shipped:
        lines.append(
            f"# The columns are those of the shipped mapping {shipped!r}: --mapping {shipped} may do."
        )
    lines += [f"# TO DO: add {what}" for what in missing]
    lines.append("[columns]")
    for guess in guesses.values():
        name, unit = _quoted(guess.column), _SPELLED.get(guess.unit, guess.unit)
        lines.append(f'{guess.ours} = {{ column = {name}, unit = "{unit}" }}  # {guess.why}')
    if sign:
        lines += ["", "[current]", f'positive = "{sign}"  # {why_sign}']
    if trip:
        lines += ["", "[trip]", f"column = {_quoted(trip)}"]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
