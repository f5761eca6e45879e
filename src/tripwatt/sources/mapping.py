"""Mappings from the columns of a table to ours: a small TOML that is read as a whole, or refused with every fault.

    [columns]
    time_s = { column = "Timestamp", unit = "timestamp" }
    speed_m_s = { column = "Speed", unit = "km/h" }
    current_a = { column = "Battery current", unit = "A" }
    voltage_v = { column = "Battery voltage", unit = "V" }

    [current]
    positive = "discharge"

    [trip]
    column = "drive_id"
    vehicle = "vin"

    [covariates]
    traffic = "Traffic index"

All tables but `[columns]` are optional; see `docs/reference/data.md`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tripwatt.errors import Fault, did_you_mean, excerpt
from tripwatt.files import MAX_TEXT_BYTES, parse_toml, read_text_file
from tripwatt.trips import COLUMNS, raise_faults
from tripwatt.trips.columns import is_number
from tripwatt.units import M_PER_FOOT, M_S_PER_KM_H, M_S_PER_MPH, SECONDS_PER_HOUR, ZERO_CELSIUS_K
from tripwatt.vehicles import vehicle_names

POWER: Final = "battery_power_w"
"""Name of the power at the battery terminals [W], for loggers that write power instead of voltage and current."""

ENERGY: Final = "observed_energy_wh"
"""Name of a counter of the energy at the battery terminals [Wh], for loggers without voltage and current."""


def _units(spellings: str, factor: float, offset: float = 0.0) -> dict[str, tuple[float, float]]:
    return dict.fromkeys(spellings.split(), (factor, offset))


_SPEED: Final = _units("m/s", 1.0) | _units("km/h kmh kph", M_S_PER_KM_H) | _units("mph", M_S_PER_MPH)
_TEMPERATURE: Final = (
    _units("degc °c c", 1.0)
    | _units("mdegc", 1e-3)
    | _units("k", 1.0, -ZERO_CELSIUS_K)
    | _units("degf °f f", 5.0 / 9.0, -160.0 / 9.0)
)
_FRACTION: Final = (
    _units("1 fraction", 1.0) | _units("% percent", 0.01) | _units("ppm", 1e-6) | _units("m%", 1e-5)
)
# some loggers write power as a number of steps of 50, 100 or 250 W
_WATT: Final = {"w": (1.0, 0.0), "kw": (1000.0, 0.0), "hp": (745.699872, 0.0), "ps": (735.49875, 0.0)} | {
    f"{step}w": (float(step), 0.0) for step in (50, 100, 250)
}

TIME_STAMPS: Final = {"timestamp": math.nan, "epoch_s": 1.0, "epoch_ms": 1e-3}
"""Units of a time that include the day: text, or seconds or milliseconds since 1970."""

UNITS: Final[Mapping[str, Mapping[str, tuple[float, float]]]] = {
    "time_s": {"s": (1.0, 0.0), "ms": (1e-3, 0.0), "min": (60.0, 0.0), "h": (SECONDS_PER_HOUR, 0.0)},
    "speed_m_s": _SPEED,
    "elevation_m": _units("m", 1.0) | _units("km", 1000.0) | _units("ft", M_PER_FOOT),
    "grade": _FRACTION,
    "speed_limit_m_s": _SPEED,
    "ambient_temperature_degc": _TEMPERATURE,
    "cabin_temperature_degc": _TEMPERATURE,
    "cabin_setpoint_degc": _TEMPERATURE,
    "battery_temperature_degc": _TEMPERATURE,
    "voltage_v": {"v": (1.0, 0.0), "mv": (1e-3, 0.0), "kv": (1000.0, 0.0)},
    "current_a": {"a": (1.0, 0.0), "ma": (1e-3, 0.0), "da": (0.1, 0.0), "ca": (0.01, 0.0)},
    "soc": _FRACTION,
    "displayed_soc": _FRACTION,
    "motor_torque_nm": {"nm": (1.0, 0.0)},
    "heating_power_w": _WATT,
    "requested_heating_power_w": _WATT,
    "aircon_power_w": _WATT,
    "climate_power_w": _WATT,
    POWER: _WATT,
    ENERGY: {"wh": (1.0, 0.0), "kwh": (1000.0, 0.0)},
}
"""Our column -> unit -> (factor, offset) for the conversion to our unit. The case of units is ignored."""

_OWN_UNIT: Final = {"time_s": "s", "grade": "1", POWER: "W", ENERGY: "Wh"}
_SETTINGS: Final[Mapping[str, Mapping[str, str]]] = {
    "current": {"positive": "positive"},
    "trip": {"column": "trip_column", "vehicle": "vehicle_column", "driver": "driver_column"},
    "battery": {
        "nominal_voltage_v": "nominal_voltage_v",
        "usable_capacity_kwh": "usable_capacity_kwh",
        "usable_capacity_uncertainty": "usable_capacity_uncertainty",
        "vehicle": "battery_vehicle",
    },
    "file": {"decimal": "decimal", "hold_s": "hold_s"},
    "long": {"name": "long_name", "value": "long_value"},
}
"""Optional table of a mapping -> its keys -> attribute of `ColumnMapping`."""
_ENTRY_KEYS: Final = ("column", "date", "unit", "format", "optional")


@dataclass(frozen=True, slots=True)
class MappedColumn:
    """An entry of a mapping: the column of the table that has the values of one of our columns, and their unit.

    Attributes
    ----------
    column : str
    unit : str
        As spelled in the TOML, in lower case.
    format : str
        `strptime` format of time stamps; empty for ISO 8601.
    optional : bool
        Whether a table may lack the column.
    date : str
        Column of the day if `column` has only the time of day, else empty.
    """

    column: str
    unit: str
    format: str = ""
    optional: bool = False
    date: str = ""

    def __str__(self) -> str:
        return f"{self.column!r} [{self.unit}]"


@dataclass(frozen=True, slots=True)
class ColumnMapping:
    """A mapping that was checked.

    Attributes
    ----------
    source : str
        File or name of the mapping.
    columns : mapping of str to MappedColumn
        Our names (of `COLUMNS`, `battery_power_w` or `observed_energy_wh`) -> entries.
    discharge_sign : float
        1 if discharge is positive in the table, -1 if charge is positive.
    trip_column : str or None
        Column that identifies the trips of one file; without one, each file is a trip.
    vehicle_column : str or None
        Column of the vehicle. Trips of different vehicles may then have the same id.
    nominal_voltage_v, usable_capacity_kwh, usable_capacity_uncertainty : float or None
    battery_vehicle : str or None
        Name of a car of the library whose open-circuit voltage is used to convert charge to energy.
    decimal : str
        Decimal separator of text files.
    hold_s : float
        Time [s] for which the last value replaces missing ones: for loggers that write a value only if it changes.
    driver_column : str or None
        Column of the driver.
    long_name, long_value : str or None
        Columns of the signal's name and of its value, if a file has a row for each value.
    covariates : mapping of str to str
        Name of a covariate -> its column, of numbers or words.
    """

    source: str
    columns: Mapping[str, MappedColumn]
    discharge_sign: float = 1.0
    trip_column: str | None = None
    nominal_voltage_v: float | None = None
    usable_capacity_kwh: float | None = None
    usable_capacity_uncertainty: float = 0.05
    decimal: str = "."
    hold_s: float = 0.0
    long_name: str | None = None
    long_value: str | None = None
    vehicle_column: str | None = None
    battery_vehicle: str | None = None
    driver_column: str | None = None
    covariates: Mapping[str, str] = field(default_factory=dict)


def shipped_mappings() -> tuple[str, ...]:
    """Names of the mappings that come with the package.

    Examples
    --------
    >>> "abrp" in shipped_mappings()
    True
    """
    folder = resources.files("tripwatt.sources") / "mappings"
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def shipped_text(name: str) -> str:
    """The TOML text of a shipped mapping; `name` is one of `shipped_mappings`.

    Examples
    --------
    >>> "[columns]" in shipped_text("abrp")
    True
    """
    return (resources.files("tripwatt.sources") / "mappings" / f"{name}.toml").read_text("utf-8")


def load_mapping(mapping: Path | str) -> ColumnMapping:
    """Load a mapping from a TOML file, or a shipped mapping by its name.

    Raises
    ------
    InvalidInput
        With every key that is unknown, missing or has an invalid value.
    """
    if isinstance(mapping, str) and mapping in shipped_mappings():
        return parse_mapping(shipped_text(mapping), mapping)
    path = Path(mapping)
    allowed = f"a TOML file, or one of {', '.join(shipped_mappings())}"
    text = read_text_file(path, MAX_TEXT_BYTES, what="cannot read the mapping", allowed=allowed)
    return parse_mapping(text, str(path))


def parse_mapping(text: str, source: str) -> ColumnMapping:
    r"""Make a mapping from the text of a TOML file. See `load_mapping`.

    Examples
    --------
    >>> parse_mapping('[columns]\ntime_s = {column = "t"}\nspeed_m_s = {column = "v", unit = "mph"}', "my.toml").columns["speed_m_s"]
    MappedColumn(column='v', unit='mph', format='', optional=False, date='')
    """
    return mapping_from_tables(parse_toml(text, source), source)


def mapping_from_tables(tables: Mapping[str, Any], source: str) -> ColumnMapping:
    """Check the tables of a TOML document and make a mapping from them.

    Parameters
    ----------
    tables : mapping
        The parsed TOML document.
    source : str
        File or name of the mapping.

    Raises
    ------
    InvalidInput
        As `load_mapping`.

    Examples
    --------
    >>> columns = {"time_s": {"column": "t"}, "speed_m_s": {"column": "v", "unit": "km/h"}}
    >>> mapping_from_tables({"columns": columns}, "page").columns["speed_m_s"].unit
    'km/h'
    """
    raise_faults(_structure_faults(tables, source))
    columns = {
        ours: MappedColumn(**{**entry, "unit": entry.get("unit", _own_unit(ours)).lower()})
        for ours, entry in tables["columns"].items()
    }
    settings = {
        attribute: tables[name][key]
        for name, keys in _SETTINGS.items()
        for key, attribute in keys.items()
        if key in tables.get(name, {})
    }
    sign = -1.0 if settings.pop("positive", None) == "charge" else 1.0
    covariates = MappingProxyType(tables.get("covariates", {}))
    return ColumnMapping(source, MappingProxyType(columns), sign, **settings, covariates=covariates)


def _own_unit(ours: str) -> str:
    return _OWN_UNIT.get(ours) or (COLUMNS[ours].unit if ours in COLUMNS else "")


def _structure_faults(tables: Mapping[str, Any], source: str) -> Iterator[Fault]:
    known = {"columns": UNITS, **_SETTINGS, "covariates": dict(tables.get("covariates") or {})}
    for name, table in tables.items():
        if name not in known:
            allowed = f"[{'], ['.join(known)}]"
            yield Fault("unknown table", f"{source} [{name}]", "", allowed, did_you_mean(name, known))
        elif not isinstance(table, dict):
            yield Fault("not a table", f"{source} [{name}]", excerpt(table), f"[{name}]")
        else:
            if name == "covariates":
                for key in (k for k, column in table.items() if k in COLUMNS or not isinstance(column, str)):
                    yield Fault("not a column", f"{source} [{name}] {key}", "", 'NAME = "column"')
            for key in (key for key in table if key not in known[name]):
                fix = did_you_mean(key, known[name])
                yield Fault("unknown key", f"{source} [{name}] {key}", "", ", ".join(known[name]), fix)
    columns = tables.get("columns", {})
    if not isinstance(columns, dict):
        return
    for ours in ("time_s", "speed_m_s"):
        if ours not in columns:
            yield Fault("missing key", f"{source} [columns] {ours}", "", '{ column = "...", unit = "..." }')
    for ours, entry in columns.items():
        if ours in UNITS:
            yield from _entry_faults(ours, entry, f"{source} [columns] {ours}")
    yield from _value_faults(tables, source)
    yield from _energy_faults(tables, source)


def _entry_faults(ours: str, entry: object, where: str) -> Iterator[Fault]:
    if not isinstance(entry, dict) or not isinstance(entry.get("column"), str) or not entry["column"]:
        yield Fault("not a column", where, excerpt(entry), '{ column = "...", unit = "..." }')
        return
    for key, value in entry.items():
        if key not in _ENTRY_KEYS:
            fix = did_you_mean(key, _ENTRY_KEYS)
            yield Fault("unknown key", f"{where}.{key}", "", ", ".join(_ENTRY_KEYS), fix)
        elif key == "optional" and not isinstance(value, bool):
            yield Fault("not true or false", f"{where}.{key}", excerpt(value), "true or false")
        elif key != "optional" and not isinstance(value, str):
            yield Fault("not a string", f"{where}.{key}", excerpt(value), "a string in quotes")
    unit = str(entry.get("unit", _own_unit(ours)))
    allowed = [*UNITS[ours], *(TIME_STAMPS if ours == "time_s" else ())]
    if unit.lower() not in allowed:
        yield Fault.unknown("unknown unit", f"{where}.unit", unit, allowed)


def _value_faults(tables: Mapping[str, Any], source: str) -> Iterator[Fault]:
    def fault(what: str, table: str, key: str, allowed: str) -> Fault:
        return Fault(what, f"{source} [{table}] {key}", excerpt(_get(tables, table, key)), allowed)

    for table, key, low, high in (
        ("battery", "nominal_voltage_v", 30.0, 1200.0),
        ("battery", "usable_capacity_kwh", 1.0, 1500.0),
        ("battery", "usable_capacity_uncertainty", 0.0, 0.5),
        ("file", "hold_s", 0.0, 600.0),
    ):
        value = _get(tables, table, key)
        if value is not None and not (is_number(value) and low <= value <= high):
            yield fault("value out of range", table, key, f"{low:g} to {high:g}")
    for table, key, allowed in (
        ("current", "positive", ("discharge", "charge")),
        ("file", "decimal", (".", ",")),
    ):
        if _get(tables, table, key) not in (None, *allowed):
            yield fault("unknown value", table, key, " or ".join(map(repr, allowed)))
    if _get(tables, "battery", "vehicle") not in (None, *vehicle_names()):
        yield fault("unknown vehicle", "battery", "vehicle", "a car of `tripwatt vehicles`")
    for table, key in [(name, key) for name in ("trip", "long") for key in _SETTINGS[name]]:
        section, value = tables.get(table), _get(tables, table, key)
        optional = table == "trip" and value is None and section
        if isinstance(section, dict) and not isinstance(value, str) and not optional:
            yield fault("missing key", table, key, "the name of a column")


def _energy_faults(tables: Mapping[str, Any], source: str) -> Iterator[Fault]:
    """The fault of a power or current without a voltage, if neither a column nor the nominal voltage is sure to give one."""
    columns = tables.get("columns", {})
    flow = next((c for c in (POWER, "current_a") if c in columns), None)
    voltage = columns.get("voltage_v")
    certain = isinstance(voltage, dict) and not voltage.get("optional", False)
    if flow is not None and not certain and _get(tables, "battery", "nominal_voltage_v") is None:
        where = f"{source} [battery] nominal_voltage_v"
        yield Fault("missing key", where, f"{flow} without voltage_v", "the battery's nominal voltage [V]")


def _get(tables: Mapping[str, Any], table: str, key: str) -> Any:
    section = tables.get(table)
    return section.get(key) if isinstance(section, dict) else None
