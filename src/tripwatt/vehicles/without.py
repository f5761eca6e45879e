"""Cars without the values that come from the logs of a data set, so that forecasts can be scored on these logs."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from tripwatt.vehicles.inheriting import DATA
from tripwatt.vehicles.vehicle import SECTIONS, Entry, Vehicle


@cache
def _known_without() -> Mapping[str, tuple[str, Mapping[str, Entry]]]:
    """Return for each data set its name in sources, and the entries that replace its values."""
    known = {}
    for file in (DATA / "without").glob("*.toml"):
        document = tomllib.loads(file.read_text(encoding="utf-8"))
        entries = {
            f"{section}.{key}": Entry(**entry)
            for section in SECTIONS
            for key, entry in document.get(section, {}).items()
        }
        known[file.stem] = (str(document["name"]), MappingProxyType(entries))
    return MappingProxyType(known)


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
    name, _ = _known_without().get(dataset, ("", {}))
    return bool(name) and (name in entry.source or name in entry.estimated)


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
    _, other = _known_without()[dataset]
    entries = {key: dataclasses.replace(other[key], scale=vehicle.entries[key].scale) for key in named}
    return vehicle.with_values({key: entry.value for key, entry in entries.items()}, entries)
