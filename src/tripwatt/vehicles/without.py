"""A car without the values that the logs of a data set gave, so that it can be scored on these logs."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from tripwatt.vehicles.inheriting import data_folder
from tripwatt.vehicles.vehicle import SECTIONS, Entry, Vehicle


@cache
def _known_without() -> Mapping[str, tuple[str, Mapping[str, Entry]]]:
    """Data set -> its name in sources, and the entries that replace its values."""
    known = {}
    for file in (data_folder() / "without").iterdir():
        document = tomllib.loads(file.read_text(encoding="utf-8"))
        entries = {
            f"{section}.{key}": Entry(**entry)
            for section in SECTIONS
            for key, entry in document.get(section, {}).items()
        }
        known[file.name.removesuffix(".toml")] = (str(document["name"]), MappingProxyType(entries))
    return MappingProxyType(known)


def names_data(entry: Entry, dataset: str) -> bool:
    """Whether a value comes from the logs of a data set, or was decided with them in sight.

    Parameters
    ----------
    entry : Entry
        A value of a car.
    dataset : str
        Name of the data set, such as ``"tum"``.

    Returns
    -------
    bool
        Whether source or estimate name the data set; False for a set from which no value came.

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
    """Replace the values that the logs of a data set gave by those that the library would have without it.

    Parameters
    ----------
    vehicle : Vehicle
        A car, with the origin of every value.
    dataset : str
        Name of the data set, such as ``"tum"``.

    Returns
    -------
    Vehicle
        The same object where no value comes from the data set.

    Raises
    ------
    KeyError
        When a value of the car comes from the data set and the library has no other.

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
