"""Comparison of two cars by their values, never by names, titles or sources."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from tripwatt.vehicles.parts import ROAD_LOADS
from tripwatt.vehicles.vehicle import SECTIONS, Value, Vehicle

ROUNDING: Final = 1e-9
"""Largest relative difference of two numbers that count as equal, as after writing and reading."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value in which a car differs from another car.

    Attributes
    ----------
    key : str
        "section.key"; the section alone if one of the cars lacks this part, with the values "given" and "none".
    value : float, str, tuple of float or None
        Value of the car, in `unit`; None if the car has no value.
    other : float, str, tuple of float or None
        Value of the other car.
    unit : str
        Unit of both values; empty for a whole part.

    Examples
    --------
    >>> print(Difference("body.curb_mass_kg", 2500.0, 1281.0, "kg").change)
    1281 -> 2500
    """

    key: str
    value: Value | None
    other: Value | None
    unit: str

    @property
    def change(self) -> str:
        """Text "other value -> value"."""
        return f"{_shown(self.other)} -> {_shown(self.value)}"


def differences(vehicle: Vehicle, other: Vehicle) -> tuple[Difference, ...]:
    """List the values in which a car differs from another car. O(values).

    If trips have changed a value of the other car, its published value also counts as equal: a car with published values is the
    same car before its trips. Names, titles, sources and `anchor` do not count.

    Parameters
    ----------
    vehicle : Vehicle
        The car that is compared.
    other : Vehicle
        The car of a model, with its entries.

    Returns
    -------
    tuple of Difference
        Differences in the order of the sections; empty for the same car.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> heavy = load_vehicle("bmw_i3_60ah", overrides={"mass": 2500.0})
    >>> [(d.key, d.change, d.unit) for d in differences(heavy, load_vehicle("bmw_i3_60ah"))]
    [('body.curb_mass_kg', '1281 -> 2500', 'kg')]
    """
    different = []
    for section, kind in SECTIONS.items():
        one, two = getattr(vehicle, section), getattr(other, section)
        if one is None or two is None:
            if one is not two:
                shown = ["none" if part is None else "given" for part in (one, two)]
                different.append(Difference(section, shown[0], shown[1], ""))
            continue
        others = ROAD_LOADS.keys() - {one.method} if section == "road_load" else ()
        unused = {name for method in others for name in ROAD_LOADS[method]}
        for field in dataclasses.fields(kind):
            key = f"{section}.{field.name}"
            value, known = getattr(one, field.name), getattr(two, field.name)
            if field.name not in unused and not (_same(value, known) or _is_published(value, key, other)):
                different.append(Difference(key, value, known, field.metadata.get("unit", "1")))
    return tuple(different)


def with_differences(vehicle: Vehicle, different: Iterable[Difference], source: Vehicle) -> Vehicle:
    """Copy into a car the values in which another car differs, with their sources.

    Parameters
    ----------
    vehicle : Vehicle
        The car that is changed.
    different : iterable of Difference
        Differences of the other car from this car.
    source : Vehicle
        The other car, which gives whole parts and the sources.

    Returns
    -------
    Vehicle
        The changed car, with name and title of `vehicle`.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car, heavy = load_vehicle("bmw_i3_60ah"), load_vehicle("bmw_i3_60ah", overrides={"mass": 2500.0})
    >>> with_differences(car, differences(heavy, car), heavy).body.curb_mass_kg
    2500.0
    """
    values = {d.key: d.value for d in different if "." in d.key}
    wholes = {d.key for d in different} - values.keys()
    taken = {k for k in {*vehicle.entries, *source.entries} if k in values or k.partition(".")[0] in wholes}
    kept = {key: entry for key, entry in vehicle.entries.items() if key not in taken}
    entries = kept | {key: source.entries[key] for key in source.entries if key in taken}
    parts: dict[str, Any] = {section: getattr(source, section) for section in wholes}
    return dataclasses.replace(vehicle.with_values(values), entries=MappingProxyType(entries), **parts)


def _is_published(value: Value | None, key: str, other: Vehicle) -> bool:
    """Return whether a value is the published one that trips of the other car have changed."""
    entry = other.entries.get(key)
    return entry is not None and entry.published is not None and _same(value, entry.published)


def _same(one: Value | None, two: Value | None) -> bool:
    if isinstance(one, tuple) and isinstance(two, tuple):
        return len(one) == len(two) and all(map(_same, one, two))
    if isinstance(one, int | float) and isinstance(two, int | float):
        return math.isclose(one, two, rel_tol=ROUNDING, abs_tol=0.0)
    return one == two


def _shown(value: Value | None) -> str:
    if isinstance(value, tuple):
        return f"{value[0]:g} to {value[-1]:g}" if value else "none"
    return "none" if value is None else value if isinstance(value, str) else f"{value:.6g}"
