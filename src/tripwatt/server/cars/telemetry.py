"""Convert messages of a car on the road to samples in the units of the schema; `FORMATS` has the formats of senders.

Names, units and signs of a format are those of its mapping for tables (`tripwatt/sources/mappings`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput, each_fault, excerpt, raise_faults
from tripwatt.server.cars.documents import place_in
from tripwatt.sources.mapping import (
    POWER,
    TIME_STAMPS,
    UNITS,
    ColumnMapping,
    MappedColumn,
    load_mapping,
    shipped_mappings,
)
from tripwatt.trips import COLUMNS

SIGNALS: Final = tuple(name for name in COLUMNS if name != "time_s")
"""Columns that a sample may have."""

CHARGES: Final = {"soc": "displayed_soc", "bms_soc": "soc"}
"""Field of a departure -> column of its charge; the displayed charge comes before that of the battery management."""

FIRST_TIME_S: Final = 946_684_800.0
LAST_TIME_S: Final = 4_102_444_800.0
"""Bounds of a time stamp: the years 2000 and 2100. Milliseconds since 1970 are far outside."""

OWN_HOLD_S: Final = 10.0
"""How long values that change quickly are held if a sender has our columns [s]. A choice, as `HOLD_S` of trips."""

OWN_VOLTAGE_V: Final = 370.0
"""Assumed voltage if a sender has our columns and sends power without voltage [V]: only its product with the current counts."""

MAX_POWER_W: Final = 2e6
"""Largest battery power; that of a lorry on a megawatt charger is below."""

MISSING: Final = ("", "unknown", "unavailable", "none", "null")
"""Texts of senders for a value that they do not have; the second and third are those of Home Assistant."""

BOUNDS: Final = {name: column.bounds for name, column in COLUMNS.items()} | {
    POWER: (-MAX_POWER_W, MAX_POWER_W),
    "": (-1e300, 1e300),
}
"""Bounds of the values of a column; those of the empty name are of a time."""


@dataclass(frozen=True, slots=True)
class Sample:
    """What a car sent at one time.

    Attributes
    ----------
    time_s : float
        Seconds since 1970, UTC.
    values : mapping of str to float
        Finite values of columns of `tripwatt.trips.COLUMNS`, without `time_s`.
    charging, parked : bool
        Whether the car is being charged; whether its gear is in park.
    faults : tuple of Fault
        Faults of values that are out of range or not numbers; these values are left out.
    received_s : float or None
        Time of arrival by our clock [s since 1970]; None if it was not recorded.

    Raises
    ------
    InvalidInput
        When the time or a value is out of range, or a column is unknown.

    Examples
    --------
    >>> sample = Sample(1.7e9, {"speed_m_s": 20.0, "displayed_soc": 0.65})
    >>> sample.charging, sample.parked
    (False, False)
    """

    time_s: float
    values: Mapping[str, float] = field(default_factory=dict)
    charging: bool = False
    parked: bool = False
    faults: tuple[Fault, ...] = ()
    received_s: float | None = None

    def __post_init__(self) -> None:
        faults = list[Fault]()
        if not FIRST_TIME_S <= self.time_s <= LAST_TIME_S:
            allowed = "seconds since 1970, of the years 2000 to 2100"
            is_ms = FIRST_TIME_S <= self.time_s / 1000.0 <= LAST_TIME_S
            fix = "the time looks like milliseconds" if is_ms else ""
            faults.append(Fault("time out of range", "utc", f"{self.time_s:g}", allowed, fix))
        for name, value in self.values.items():
            if name not in SIGNALS:
                faults.append(Fault("unknown column", name[:60], name[:60], ", ".join(SIGNALS)))
            elif not is_sound(name, value):
                faults.append(Fault("value out of range", name, f"{value:g}", COLUMNS[name].allowed))
        raise_faults(faults)


def shifted(sample: Sample, by_s: float) -> Sample:
    """Return the sample with its time shifted by `by_s` [s], within the bounds of time stamps."""
    return replace(sample, time_s=min(max(sample.time_s + by_s, FIRST_TIME_S), LAST_TIME_S))


@dataclass(frozen=True)
class MessageFormat:
    """Format of a sender's messages: an entry of `FORMATS`.

    Attributes
    ----------
    mapping_name : str
        Shipped mapping, or mapping file, with names, units and signs of the fields; empty for our columns in our units. A time
        in seconds or milliseconds since 1970 is read from the messages; otherwise the time of arrival is used.
    charging, parked : mapping of str to tuple of str
        Field -> texts, in lower case, that mean that the car is charging or parked.
    kinds : mapping of str to tuple of str
        Field -> texts, in lower case, of the messages that count; empty if all do.
    more : mapping of str to str
        Fields that the mapping lacks -> our columns, in our units.
    """

    mapping_name: str = ""
    charging: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    parked: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    kinds: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    more: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def mapping(self) -> ColumnMapping:
        """The mapping of `mapping_name`; for an empty name, that of our columns."""
        if self.mapping_name:
            return load_mapping(self.mapping_name)
        columns = {name: MappedColumn(name, next(iter(units))) for name, units in UNITS.items()}
        columns["time_s"] = MappedColumn("time_s", "epoch_s")
        return ColumnMapping("", columns, nominal_voltage_v=OWN_VOLTAGE_V, hold_s=OWN_HOLD_S)

    @cached_property
    def time_field(self) -> str:
        """Field with the time since 1970; empty if the sender sends no such time."""
        return next((name for name, (ours, *_) in self.columns.items() if not ours), "")

    @cached_property
    def columns(self) -> Mapping[str, tuple[str, float, float]]:
        """Field -> our column, with factor and offset to its unit; the column of a time since 1970 has no name."""
        sources = {name: (ours, 1.0, 0.0) for name, ours in self.more.items()}
        for ours, entry in self.mapping.columns.items():
            if ours != "time_s":
                factor, offset = UNITS[ours][entry.unit]
                sign = self.mapping.discharge_sign if ours in ("current_a", POWER) else 1.0
                sources[entry.column] = ours, sign * factor, offset
            elif math.isfinite(TIME_STAMPS.get(entry.unit, math.nan)):
                sources[entry.column] = "", TIME_STAMPS[entry.unit], 0.0
        return sources

    def with_current(self, values: dict[str, float]) -> dict[str, float]:
        """Replace the power in `values` by a voltage and a current with this product; return `values`."""
        power = values.pop(POWER, None)
        if power is not None:
            voltage = values.setdefault("voltage_v", float(self.mapping.nominal_voltage_v or math.nan))
            values["current_a"] = power / voltage
            if not is_sound("current_a", values["current_a"]):
                del values["current_a"]
        return values

    def sample(self, message: Any, received_s: float | None = None) -> Sample:
        """Convert a whole message to a sample, with the time of arrival if the message has none. O(fields). See `sample_from_abrp`."""
        if not isinstance(message, Mapping):
            allowed = "an object with utc, speed, power, soc"
            raise InvalidInput.of("not an object", "tlm", excerpt(message), allowed)
        known, faults = (*self.columns, *self.charging, *self.parked), list[Fault]()
        if message.keys().isdisjoint(known):
            raise InvalidInput.of("no known field", "tlm", excerpt([*message]), ", ".join(known))
        numbers = {ours: self.number(message, name, faults) for name, (ours, *_) in self.columns.items()}
        time_s = numbers.pop("", None)
        if time_s is None and self.time_field not in {fault.where for fault in faults}:
            time_s = received_s
        if time_s is None:
            raise InvalidInput(faults or Fault("missing field", self.time_field, "", "seconds since 1970"))
        values = self.with_current({name: value for name, value in numbers.items() if value is not None})
        parked = is_set(self.parked, message)
        if parked:
            values.setdefault("speed_m_s", 0.0)
        return Sample(time_s, values, is_set(self.charging, message), parked, tuple(faults))

    def number(self, message: Mapping[str, Any], name: str, faults: list[Fault]) -> float | None:
        """Return a number of a message, which may be a text, in our unit; None if it is missing or, with a fault added to `faults`, not valid."""
        raw, (ours, factor, offset) = message.get(name), self.columns[name]
        if raw is None or (isinstance(raw, str) and raw.lower() in MISSING):
            return None
        try:
            value = float(raw[:40] if isinstance(raw, str) else raw) * factor + offset
            if not isinstance(raw, bool) and is_sound(ours, value):
                return value
        except (TypeError, ValueError, OverflowError):
            pass
        low, high = sorted((bound - offset) / factor for bound in BOUNDS[ours])
        allowed = f"{low:g} to {high:g}" if ours else "a number"
        faults.append(Fault("value out of range", name, excerpt(raw), allowed))
        return None


_TRUE: Final = ("1", "1.0", "true")
FORMATS: Final[Mapping[str, MessageFormat]] = {
    "ovms": MessageFormat("ovms", charging={"v.c.charging": ("yes",)}, parked={"v.e.on": ("no",)}),
    "teslamate": MessageFormat(
        "teslamate", charging={"state": ("charging",)}, parked={"shift_state": ("p",)}
    ),
    "abrp": MessageFormat(
        "abrp",
        charging={"is_charging": _TRUE, "is_dcfc": _TRUE},
        parked={"is_parked": _TRUE},
        more={"hvac_setpoint": "cabin_setpoint_degc", "current": "current_a"},
    ),
    "owntracks": MessageFormat("owntracks", kinds={"_type": ("location",)}),
    "plain": MessageFormat(charging={"charging": _TRUE}, parked={"parked": _TRUE}),
}
"""Name of a sender -> format of its messages. A new sender needs an entry, and a mapping if there is none for its tables.

`ovms`: the metrics of OVMS. `teslamate`: the values of TeslaMate (https://docs.teslamate.org/docs/integrations/mqtt), whose power
is in whole kilowatts. `abrp`: live data of A Better Routeplanner (https://documenter.getpostman.com/view/7396339/SWTK5a8w), which
OVMS, TeslaMate, evcc and many adapters send too. `owntracks`: location messages of a phone in the car, without its charge. `plain`: our own columns. For other senders, `format_of` takes a mapping."""


def format_of(source: str) -> MessageFormat:
    """Return the format of a sender: an entry of `FORMATS`, else one with a shipped mapping or a mapping file (`FILE.toml`).

    Raises
    ------
    InvalidInput
        For an unknown sender, or with the faults of a mapping.
    """
    if source not in (*FORMATS, *shipped_mappings()) and not source.endswith(".toml"):
        allowed = ", ".join(dict.fromkeys((*FORMATS, *shipped_mappings(), "or a file FILE.toml")))
        raise InvalidInput.of("unknown sender", "source", source[:60], allowed)
    message_format = FORMATS.get(source) or MessageFormat(source)
    message_format.mapping  # noqa: B018, it is checked
    return message_format


def is_sound(column: str, value: float) -> bool:
    """Whether a value is within the bounds of its column; NaN is not."""
    low, high = BOUNDS[column]
    return low <= value <= high


def is_set(flags: Mapping[str, tuple[str, ...]], values: Mapping[str, Any]) -> bool:
    """Whether `values` has, in a field of `flags`, one of the texts of this field."""
    candidates = ((values.get(name), texts) for name, texts in flags.items())
    return any(
        isinstance(value, str | int | float) and f"{value}".lower() in texts for value, texts in candidates
    )


def in_message(message: Any, fault: Fault, at: tuple[str, ...] = ()) -> Fault:
    """Return a fault of a message with its place: `at`, by default the field of the message, or of its `tlm`.

    Examples
    --------
    >>> in_message({"tlm": {"soc": 900}}, Fault("value out of range", "soc")).at
    ('tlm', 'soc')
    """
    return replace(
        fault, at=at or place_in(message, ("tlm", fault.where)) or place_in(message, (fault.where,))
    )


def with_places(read: Callable[[], Sample], place: Callable[[Fault], Fault]) -> Sample:
    """Return the sample that `read` returns, its faults and those that it raises changed by `place`."""
    with each_fault(place):
        sample = read()
    return replace(sample, faults=tuple(map(place, sample.faults)))


def sample_from_abrp(message: Mapping[str, Any]) -> Sample:
    """Convert a message in the format of A Better Routeplanner's live data to a sample. O(fields).

    Parameters
    ----------
    message : mapping
        The object `tlm`: `utc` [s], `speed` [km/h], `power` [kW, output is positive], `voltage` [V], `current` [A], `soc`
        [%, as the dashboard shows it], `elevation` [m], `ext_temp`, `batt_temp`, `cabin_temp`, `hvac_setpoint` [°C],
        `hvac_power` [kW], `is_charging`, `is_dcfc`, `is_parked`. Numbers may be texts. Other fields, such as the position,
        are not read.

    Returns
    -------
    Sample
        A value that is out of range or not a number is left out, and its fault is in `faults`. A parked car without a speed has
        speed 0.

    Raises
    ------
    InvalidInput
        When the message is not an object, or its time is missing or out of range.

    Examples
    --------
    >>> sample = sample_from_abrp({"utc": 1700000000, "speed": 72, "power": 11.1, "soc": 65, "ext_temp": "4.5"})
    >>> sample.values["speed_m_s"], sample.values["current_a"], sample.values["displayed_soc"]
    (20.0, 30.0, 0.65)
    """
    return FORMATS["abrp"].sample(message)
