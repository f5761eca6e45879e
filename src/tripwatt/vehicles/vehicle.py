"""A car, and the origin of every value."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from tripwatt.files import shipped_toml
from tripwatt.vehicles.parts import (
    Auxiliaries,
    Battery,
    Body,
    Charging,
    Climate,
    Drivetrain,
    Regeneration,
    RoadLoad,
    Tyres,
)

Value = float | str | tuple[float, ...]

SECTIONS: Final[Mapping[str, type]] = {
    "body": Body,
    "road_load": RoadLoad,
    "tyres": Tyres,
    "drivetrain": Drivetrain,
    "regeneration": Regeneration,
    "battery": Battery,
    "auxiliaries": Auxiliaries,
    "climate": Climate,
    "charging": Charging,
}
"""Section of a car's TOML -> the class of the part that it describes."""

FIELDS: Final[Mapping[str, dataclasses.Field[Any]]] = {
    f"{section}.{f.name}": f for section, part in SECTIONS.items() for f in dataclasses.fields(part)
}
"""Key of an entry -> the field of its part."""

OPTIONAL_SECTIONS: Final[frozenset[str]] = frozenset({"tyres", "climate", "charging"})
"""Parts that a car may lack."""

ANCHORS: Final = ("published", "road_load", "certification", "class", "road")
"""Tests to which a car's values are anchored. "published": none. "road_load": certified consumption and a measured coast-down.
"certification": certified consumption without a coast-down. "class": none, because the values are those of a class. "road": the values
already hold for the road."""


LICENCES: Final[Mapping[str, str]] = shipped_toml("vehicles/data/table/licences.toml")
"""Licence of a source -> its meaning; SPDX names where there is one."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One value of a car with its unit, where it comes from, and the licence of that source.

    Attributes
    ----------
    value : float, str or tuple of float
        The value in `unit`.
    unit : str
        Unit as in the TOML; "1" for a number without a unit.
    source : str
        Where the value comes from.
    estimated : str
        How the value was estimated; empty if the source states it.
    scale : str
        Scale of the state of charge on which the value is given; empty if the value depends on none.
    licence : str
        Licence of the source, one of `tripwatt.vehicles.LICENCES`, or several joined by " AND ".
    published : float, str, tuple of float or None
        The value before trips changed it; None if `value` is the published one.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> entry = load_vehicle("bmw_i3_60ah").entries["body.curb_mass_kg"]
    >>> entry.unit, entry.estimated
    ('kg', "the test weight is a class of 125 lb; BMW's own figure is 1195 kg without options (EU) and 2799 lb (US)")
    """

    value: Value
    unit: str
    source: str
    estimated: str = ""
    scale: str = ""
    licence: str = "not-stated"
    published: Value | None = None


@dataclass(frozen=True, slots=True, repr=False)
class Vehicle:
    """A car: its parts, and the origin of every value.

    Attributes
    ----------
    name : str
        Name of the TOML without its ending.
    title : str
        Name of the car in texts.
    preset : str
        Preset of the TOML that was read.
    body : Body
        Masses.
    road_load : RoadLoad
        Resistance on a flat road.
    tyres : Tyres or None
        How rolling drag depends on weather and warmth; None if the preset leaves it out.
    drivetrain : Drivetrain
        Gear, motor and inverter.
    regeneration : Regeneration
        How much braking goes through the motor.
    battery : Battery
        High-voltage battery.
    auxiliaries : Auxiliaries
        Loads that neither drive nor heat.
    climate : Climate or None
        Cabin and climate control; None if the car or the preset has none.
    entries : mapping of str to Entry
        "section.key" -> value, unit and source.
    anchor : str
        Tests to which the values are anchored, one of `ANCHORS`.
    charging : Charging or None
        Charging power; None if unknown.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> car.body.test_mass_kg
    1356.0
    >>> car.entries["regeneration.fraction"].unit
    '1'
    """

    name: str
    title: str
    preset: str
    body: Body
    road_load: RoadLoad
    tyres: Tyres | None
    drivetrain: Drivetrain
    regeneration: Regeneration
    battery: Battery
    auxiliaries: Auxiliaries
    climate: Climate | None
    entries: Mapping[str, Entry] = dataclasses.field(compare=False, hash=False)
    anchor: str = "published"
    charging: Charging | None = None

    def value(self, key: str) -> Value | None:
        """Return a value of a part.

        Parameters
        ----------
        key : str
            "section.key", such as ``"auxiliaries.base_load_w"``.

        Returns
        -------
        float, str, tuple of float or None
            Value in the unit of the entry; None if the car lacks the part or the value.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> load_vehicle("bmw_i3_60ah").value("auxiliaries.base_load_w")
        300.0
        """
        section, _, name = key.partition(".")
        value: Value | None = getattr(getattr(self, section), name, None)
        return value

    def with_values(
        self, values: Mapping[str, Value | None], entries: Mapping[str, Entry] = types.MappingProxyType({})
    ) -> Vehicle:
        """Return the car with other values of its parts.

        Parameters
        ----------
        values : mapping of str to (float, str, tuple of float or None)
            "section.key" -> new value in the unit of the entry.
        entries : mapping of str to Entry
            "section.key" -> entry that replaces the one of the car.

        Returns
        -------
        Vehicle
            A changed copy; the values are not checked.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> load_vehicle("bmw_i3_60ah").with_values({"auxiliaries.base_load_w": 250.0}).auxiliaries.base_load_w
        250.0
        """
        by_section: dict[str, dict[str, Value | None]] = {}
        for key, value in values.items():
            section, _, name = key.partition(".")
            by_section.setdefault(section, {})[name] = value
        parts: dict[str, Any] = {s: replace(getattr(self, s), **own) for s, own in by_section.items()}
        return replace(self, entries=types.MappingProxyType({**self.entries, **entries}), **parts)

    def __repr__(self) -> str:
        return f"<Vehicle {self.name}: {self.title}, preset {self.preset}>"
