"""A few physical parameters of a car whose published values may be wrong.

Each parameter has a width: the prior standard deviation of a car on the road from its published value. The widths come from
published sources, never from the trips of the car.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import cast

from tripwatt.files import shipped_toml
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.spreads import ROAD_GAIN
from tripwatt.vehicles.vehicle import Entry, Value


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a car, as a relative change of its published value.

    Attributes
    ----------
    name : str
    width : float
        Prior standard deviation of the relative change.
    source : str
        Source of the width.
    keys : tuple of str
        Entries of the car that the change multiplies; empty if no entry describes the parameter.
    """

    name: str
    width: float
    source: str
    keys: tuple[str, ...]


@cache
def parameters() -> tuple[Parameter, ...]:
    """Parameters of `parameters.toml`.

    Examples
    --------
    >>> [parameter.name for parameter in parameters()]
    ['mass', 'rolling', 'air', 'base_load', 'drivetrain', 'climate']
    """
    return tuple(
        Parameter(name, about["width"], about["source"], tuple(about["keys"]))
        for name, about in shipped_toml("hybrid/parameters.toml").items()
    )


def on_road(vehicle: Vehicle) -> Vehicle:
    """Return the car as expected on the road if its values are those of a test; otherwise return it unchanged.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("vw_id4_pro")
    >>> round(on_road(car).road_load.rolling_coefficients[0] / car.road_load.rolling_coefficients[0], 3)
    1.05
    """
    if vehicle.anchor == "road":
        return vehicle
    rolling = {"rolling": ROAD_GAIN}
    return replace(changed(vehicle, rolling, source="from the test to the road"), anchor="road")


def changed(vehicle: Vehicle, changes: Mapping[str, float], *, source: str = "") -> Vehicle:
    """Return a car with parameters changed by relative amounts; parameters without an entry of the car have no effect.

    Parameters
    ----------
    vehicle : Vehicle
    changes : mapping of str to float
        Name of a parameter -> relative change, e.g. ``{"mass": 0.03}``.
    source : str
        Source of every changed entry.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = changed(load_vehicle("bmw_i3_60ah"), {"base_load": 0.5})
    >>> car.auxiliaries.base_load_w, car.entries["auxiliaries.base_load_w"].value
    (450.0, 450.0)
    """
    values, sources = {}, {}
    for parameter in parameters():
        factor = 1.0 + changes.get(parameter.name, 0.0)
        for key in parameter.keys if factor != 1.0 else ():
            value = cast(float | None, vehicle.value(key))
            if value is not None:
                values[key], sources[key] = value * factor, source or f"published value times {factor:.3f}"
    return with_values(vehicle, values, sources)


def with_values(vehicle: Vehicle, values: Mapping[str, Value], sources: Mapping[str, str]) -> Vehicle:
    """Return a car with new values; its entries keep the published ones.

    Parameters
    ----------
    vehicle : Vehicle
    values : mapping of str to (float, str or tuple of float)
        New values by key of the entries, e.g. ``"auxiliaries.base_load_w"``.
    sources : mapping of str to str
        Source of each value.

    Returns
    -------
    Vehicle
        The changed car; the same object if there are no values.
    """
    entries = {}
    for key, value in values.items():
        before, old = vehicle.value(key), vehicle.entries.get(key)
        if old is None:  # a value that no source has
            section, _, name = key.partition(".")
            unit = next(f.metadata["unit"] for f in fields(getattr(vehicle, section)) if f.name == name)
            old = Entry(value, unit, "no source", licence="estimate")
        published = f"{before:g}" if isinstance(before, float) else "another curve"
        entries[key] = replace(
            old,
            value=value,
            source=f"{sources[key]}; published {published}: {old.source}",
            published=before if old.published is None else old.published,
        )
    return vehicle.with_values(values, entries) if values else vehicle
