"""Whether two cars are the same: by their values, never by their names, titles or sources."""

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
"""Relative difference of two numbers that are one value, written and read again."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value in which a car differs from another one.

    Attributes
    ----------
    key : str
        "section.key"; the section alone where one of the cars has no such part.
    value : float, str, tuple of float or None
        Of the car, in `unit`; None where it has none.
    other : float, str, tuple of float or None
        Of the other car.
    unit : str
        Of both; empty for a part as a whole.

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
        """From the other car's value to the car's, for people."""
        return f"{_shown(self.other)} -> {_shown(self.value)}"


def differences(vehicle: Vehicle, other: Vehicle) -> tuple[Difference, ...]:
    """Compare a car with another one by value. O(values).

    A value of the other car that its trips have changed counts as the published one as well: the published car is the car that was
    identified. Names, titles, sources and `anchor` do not count.

    Parameters
    ----------
    vehicle : Vehicle
        The car in question.
    other : Vehicle
        The car of a model, with its entries.

    Returns
    -------
    tuple of Difference
        In the order of the sections; empty for the same car.

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
    """Put the values in which another car differs into a car, with their sources.

    Parameters
    ----------
    vehicle : Vehicle
        The car that is changed.
    different : iterable of Difference
        Of the other car from this one.
    source : Vehicle
        The other car, for parts as a whole and the sources.

    Returns
    -------
    Vehicle
        Of the name and title of `vehicle`.

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
    """Whether a value is the one from which the trips of the other car changed its own."""
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
