"""Messages of a car on the road, each as one sample in the units of the schema.

The format of A Better Routeplanner's live data is what most senders have: OVMS, TeslaMate, evcc and many adapters. Names,
units and signs: Iternio Telemetry API, https://documenter.getpostman.com/view/7396339/SWTK5a8w.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput, excerpt
from tripwatt.trips import COLUMNS
from tripwatt.units import M_S_PER_KM_H

SIGNALS: Final = tuple(name for name in COLUMNS if name != "time_s")
"""Columns that a sample may have."""

FIRST_TIME_S: Final = 946_684_800.0
LAST_TIME_S: Final = 4_102_444_800.0
"""Bounds of a time stamp: the years 2000 and 2100. Milliseconds since 1970 are far outside."""

NOMINAL_VOLTAGE_V: Final = 370.0
"""Stands in where a car sends its power without the voltage: only their quotient, the current, depends on it."""

MOST_POWER_W: Final = 2e6
"""Largest battery power; that of a lorry on a megawatt charger is below."""

LATITUDES_DEG: Final = (-90.0, 90.0)
LONGITUDES_DEG: Final = (-180.0, 180.0)


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
    position_deg : tuple of float, or None
        Latitude and longitude. They are not stored.
    faults : tuple of Fault
        What the message had beside, and cannot be: those values are left out.

    Raises
    ------
    InvalidInput
        When the time, a column or a value cannot be one.

    Examples
    --------
    >>> sample = Sample(1.7e9, {"speed_m_s": 20.0, "displayed_soc": 0.65})
    >>> sample.charging, sample.position_deg is None
    (False, True)
    """

    time_s: float
    values: Mapping[str, float] = field(default_factory=dict)
    charging: bool = False
    parked: bool = False
    position_deg: tuple[float, float] | None = None
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        faults = [*_time_faults(self.time_s)]
        for name, value in self.values.items():
            if name not in SIGNALS:
                faults.append(Fault("unknown column", name[:60], name[:60], ", ".join(SIGNALS)))
            elif not _inside(value, COLUMNS[name].bounds):
                faults.append(Fault("value out of range", name, f"{value:g}", COLUMNS[name].allowed))
        if faults:
            raise InvalidInput(faults)


def _inside(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


def _time_faults(time_s: float) -> list[Fault]:
    if FIRST_TIME_S <= time_s <= LAST_TIME_S:
        return []
    allowed = "seconds since 1970, of the years 2000 to 2100"
    fix = "the time looks like milliseconds" if FIRST_TIME_S <= time_s / 1000.0 <= LAST_TIME_S else ""
    return [Fault("time out of range", "utc", f"{time_s:g}", allowed, fix)]


_FACTORS: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "speed": ("speed_m_s", M_S_PER_KM_H),
        "soc": ("displayed_soc", 0.01),
        "elevation": ("elevation_m", 1.0),
        "ext_temp": ("ambient_temperature_degc", 1.0),
        "cabin_temp": ("cabin_temperature_degc", 1.0),
        "hvac_setpoint": ("cabin_setpoint_degc", 1.0),
        "batt_temp": ("battery_temperature_degc", 1.0),
        "hvac_power": ("climate_power_w", 1000.0),
    }
)
"""Parameter of the format -> our column, and the factor to its unit. `soc` is what the dashboard shows."""


class _Reading:
    """The numbers of one message, and the faults of those that are none."""

    def __init__(self, message: Mapping[str, Any]) -> None:
        self.message = message
        self.faults: list[Fault] = []

    def number(
        self, name: str, low: float = -math.inf, high: float = math.inf, factor: float = 1.0
    ) -> float | None:
        """A number of the message in our unit; None where it is missing or cannot be one."""
        given = self.message.get(name)
        if given is None or given == "":
            return None
        value = _float(given) * factor
        if math.isfinite(value) and low <= value <= high:
            return value
        allowed = "a number" if high == math.inf else f"{low / factor:g} to {high / factor:g}"
        self.faults.append(Fault("value out of range", name, excerpt(given), allowed))
        return None

    def flag(self, *names: str) -> bool:
        """Whether one of the flags is set: true, 1 or "1"."""
        return any(_is_set(self.message.get(name)) for name in names)


def _float(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return math.nan
    try:
        return float(value[:40] if isinstance(value, str) else value)
    except (ValueError, OverflowError):
        return math.nan


def _is_set(value: Any) -> bool:
    return value is True or (isinstance(value, int | float) and value == 1) or value in ("1", "true")


def sample_from_abrp(message: Mapping[str, Any]) -> Sample:
    """A sample of a message in the format of A Better Routeplanner's live data. O(fields).

    Parameters
    ----------
    message : mapping
        The object `tlm`: `utc` [s], `speed` [km/h], `power` [kW, output is positive], `voltage` [V], `current` [A], `soc`
        [%, as the dashboard shows it], `elevation` [m], `ext_temp`, `batt_temp`, `cabin_temp`, `hvac_setpoint` [°C],
        `hvac_power` [kW], `lat`, `lon` [°], `is_charging`, `is_dcfc`, `is_parked`. Numbers may be texts. Other fields have
        no meaning here.

    Returns
    -------
    Sample
        A value that cannot be one is left out, with its fault in `faults`. A parked car without a speed stands.

    Raises
    ------
    InvalidInput
        When the message is no object or its time is missing or cannot be one.

    Examples
    --------
    >>> sample = sample_from_abrp({"utc": 1700000000, "speed": 72, "power": 11.1, "soc": 65, "ext_temp": "4.5"})
    >>> sample.values["speed_m_s"], sample.values["current_a"], sample.values["displayed_soc"]
    (20.0, 30.0, 0.65)
    """
    if not isinstance(message, Mapping):
        raise InvalidInput(
            Fault("not an object", "tlm", excerpt(message), "an object with utc, speed, power, soc")
        )
    reading = _Reading(message)
    time_s = reading.number("utc")
    if time_s is None:
        raise InvalidInput(reading.faults or Fault("missing field", "utc", "", "seconds since 1970"))
    values = {}
    for name, (column, factor) in _FACTORS.items():
        value = reading.number(name, *COLUMNS[column].bounds, factor)
        if value is not None:
            values[column] = value
    values |= _electric(reading)
    parked = reading.flag("is_parked")
    if parked:
        values.setdefault("speed_m_s", 0.0)
    return Sample(
        time_s,
        values,
        charging=reading.flag("is_charging", "is_dcfc"),
        parked=parked,
        position_deg=_position(reading),
        faults=tuple(reading.faults),
    )


def _electric(reading: _Reading) -> dict[str, float]:
    """Voltage and current; where power is sent, their product is the power."""
    voltage = reading.number("voltage", *COLUMNS["voltage_v"].bounds)
    current = reading.number("current", *COLUMNS["current_a"].bounds)
    power = reading.number("power", -MOST_POWER_W, MOST_POWER_W, 1000.0)
    if power is not None:
        voltage = NOMINAL_VOLTAGE_V if voltage is None else voltage
        current = power / voltage
    found = {"voltage_v": voltage, "current_a": current}
    return {n: v for n, v in found.items() if v is not None and _inside(v, COLUMNS[n].bounds)}


def _position(reading: _Reading) -> tuple[float, float] | None:
    latitude, longitude = reading.number("lat", *LATITUDES_DEG), reading.number("lon", *LONGITUDES_DEG)
    return None if latitude is None or longitude is None else (latitude, longitude)
