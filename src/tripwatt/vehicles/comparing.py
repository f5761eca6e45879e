"""Comparison of two cars by their values, never by names or titles; cars without the values that the logs of a data set gave."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Final

from tripwatt.files import shipped_toml
from tripwatt.vehicles.inheriting import DATA
from tripwatt.vehicles.parts import ROAD_LOADS
from tripwatt.vehicles.vehicle import SECTIONS, Entry, Value, Vehicle

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
        if (one is None) != (two is None):
            shown = ["none" if part is None else "given" for part in (one, two)]
            different.append(Difference(section, shown[0], shown[1], ""))
        others = ROAD_LOADS.keys() - {one.method} if section == "road_load" else ()
        unused = {name for method in others for name in ROAD_LOADS[method]}
        for field in dataclasses.fields(kind) if one is not None and two is not None else ():
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


@cache
def _known_without(dataset: str) -> Mapping[str, Any]:
    """Return the document with the name of a data set in sources and the entries that replace its values; empty without one."""
    place = f"data/without/{dataset}.toml"
    return shipped_toml(f"vehicles/{place}") if (DATA.parent / place).is_file() else {}


def names_data(entry: Entry, dataset: str) -> bool:
    """Return whether a value comes from the logs of a data set, or was chosen by looking at them.

    Parameters
    ----------
    entry : Entry
        A value of a car.
    dataset : str
        Name of the data set, such as ``"tum"``.

    Returns
    -------
    bool
        True if source or estimate name the data set; False for a data set from which no value comes.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> entries = load_vehicle("vw_id3").entries
    >>> names_data(entries["climate.cooler_cop"], "tum"), names_data(entries["climate.cooler_cop"], "ved")
    (True, False)
    """
    name = _known_without(dataset).get("name")
    return name is not None and (name in entry.source or name in entry.estimated)


def without_data(vehicle: Vehicle, dataset: str) -> Vehicle:
    """Replace the values that come from the logs of a data set by those that the library would have without them.

    Parameters
    ----------
    vehicle : Vehicle
        A car, with the origin of every value.
    dataset : str
        Name of the data set, such as ``"tum"``.

    Returns
    -------
    Vehicle
        A copy with the replaced values; the same object if no value comes from the data set.

    Raises
    ------
    KeyError
        If a value of the car comes from the data set and the library has no replacement.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("nissan_leaf_24")
    >>> car.climate.cooler_cop, without_data(car, "tum").climate.cooler_cop
    (1.43, 2.2)
    """
    named = [key for key, entry in vehicle.entries.items() if names_data(entry, dataset)]
    if not named:
        return vehicle
    known, entries = _known_without(dataset), {}
    for key in named:
        section, _, name = key.partition(".")
        entries[key] = Entry(**known[section][name], scale=vehicle.entries[key].scale)
    return vehicle.with_values({key: entry.value for key, entry in entries.items()}, entries)
