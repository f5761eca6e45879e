"""Columns of logs, quantities of trips and fields of links: units, bounds and checks of their values.

This module does not import NumPy and pandas, so that the help of the command line is quick.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from tripwatt.errors import Fault, excerpt
from tripwatt.errors import raise_faults as raise_faults
from tripwatt.files import shipped_toml


@dataclass(frozen=True, slots=True)
class Column:
    """A canonical column or quantity: its meaning, unit and possible range.

    Attributes
    ----------
    unit : str
        SI unit of the values, "1" for a number without a unit, "degC" for temperatures.
    minimum : float
        Smallest possible value, in that unit.
    maximum : float
        Largest possible value, in that unit.
    meaning : str
        What the column holds, in a few words.

    Examples
    --------
    >>> COLUMNS["speed_m_s"].unit, COLUMNS["speed_m_s"].allowed
    ('m/s', '0 to 90 m/s')
    """

    unit: str
    minimum: float
    maximum: float
    meaning: str

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return self.minimum, self.maximum

    @property
    def allowed(self) -> str:
        """Text of range and unit for messages."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.minimum:g} to {self.maximum:g}{unit}"


_TABLES: Final = {
    table: {name: Column(*about) for name, about in entries.items()}
    for table, entries in shipped_toml("trips/columns.toml").items()
}

COLUMNS: Final = _TABLES["samples"]
"""Canonical sample columns in SI units; temperatures in °C, `soc` as a fraction."""

REQUIRED_COLUMNS: Final = ("time_s", "speed_m_s")

IN_KM_H: Final = "the unit appears to be km/h; convert it to m/s"
"""Advice for a speed that is too high."""

QUANTITIES: Final = _TABLES["quantities"]
"""Single numbers that belong to a whole trip."""

DEPARTURE_BOUNDS: Final = _TABLES["departure"]
"""Narrower bounds of values that a person gives for a departure."""

BOUNDS: Final[Mapping[str, Column]] = {**QUANTITIES, **COLUMNS, **DEPARTURE_BOUNDS}
"""Name of a number -> unit and bounds; those of `DEPARTURE_BOUNDS` come first."""

LINK_COLUMNS: Final = _TABLES["links"]
"""Fields of a link of a planned road."""

STEEPEST_GRADE: Final = LINK_COLUMNS["grade"].maximum
"""Rise over length that no street exceeds."""


def is_number(value: Any) -> bool:
    """Return whether a value is a single real number; truth values do not count.

    Examples
    --------
    >>> is_number(1), is_number(0.5), is_number(True), is_number("1"), is_number([1.0])
    (True, True, False, False, False)
    """
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def number_faults(name: str, value: Any, allowed: Column, *, whole: bool = False) -> Iterator[Fault]:
    """Yield a fault if a value of any type is not a finite number within bounds.

    Parameters
    ----------
    name : str
        Name of the argument in the message.
    value : object
        What was given.
    allowed : Column
        Unit and bounds. For a fraction, the message has a hint.
    whole : bool
        Whether only whole numbers are allowed.

    Yields
    ------
    Fault
        At most one.

    Examples
    --------
    >>> print(*number_faults("level", 90, Column("1", 0.0, 1.0, "")))
    value out of range: level: got 90; allowed: 0 to 1; give a fraction, 0.9 for 90 %
    """
    is_share = allowed.unit == "1" and 0.9 <= allowed.maximum <= 1.0
    fix = "give a fraction, 0.9 for 90 %" if is_share else ""
    if not is_number(value) or (whole and not isinstance(value, numbers.Integral)):
        what = "not a whole number" if whole else "not a number"
        yield Fault(what, name, excerpt(value), allowed.allowed, fix)
        return
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not (math.isfinite(number) and allowed.minimum <= number <= allowed.maximum):
        got = f"{number:g}" if number != math.inf else excerpt(value)
        yield Fault("value out of range", name, got, allowed.allowed, fix)


def require_number(name: str, value: Any, minimum: float = -math.inf, maximum: float = math.inf) -> float:
    """Check that an argument is a finite number within bounds, and return it as a float.

    Raises
    ------
    InvalidInput
        If the value is not a number, not finite, or out of bounds.

    Examples
    --------
    >>> require_number("energy_wh", float("nan"))
    Traceback (most recent call last):
        ...
    tripwatt.errors.InvalidInput: value out of range: energy_wh: got nan; allowed: -inf to inf
    """
    raise_faults(number_faults(name, value, Column("", minimum, maximum, "")))
    return float(value)


def require_fraction(name: str, value: Any, minimum: float = 0.0, maximum: float = 1.0) -> float:
    """Check that an argument is a fraction from `minimum` to `maximum`, such as a probability, and return it as a float.

    Raises
    ------
    InvalidInput
        If the value is anything else; the message has the hint that 0.9 stands for 90 %.

    Examples
    --------
    >>> require_fraction("level", 0.9)
    0.9
    >>> require_fraction("probability", 95)
    Traceback (most recent call last):
        ...
    tripwatt.errors.InvalidInput: value out of range: probability: got 95; allowed: 0 to 1; give a fraction, 0.9 for 90 %
    """
    raise_faults(number_faults(name, value, Column("1", minimum, maximum, "")))
    return float(value)


def scalar_faults(values: Mapping[str, Any]) -> Iterator[Fault]:
    """Yield a fault for every number outside the bounds of its name, a key of `BOUNDS`; None means unknown and is allowed.

    Parameters
    ----------
    values : mapping of str to (float or None)
        Name of a quantity -> its value in the unit of the name.

    Yields
    ------
    Fault
        One for each value that is not a number, not finite, or out of bounds.

    Examples
    --------
    >>> print(*scalar_faults({"ambient_temperature_degc": 99.0, "payload_mass_kg": None}))
    value out of range: ambient_temperature_degc: got 99; allowed: -60 to 57 °C
    """
    for name, value in values.items():
        if value is not None:
            yield from number_faults(name, value, BOUNDS[name])
