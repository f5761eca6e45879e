"""A few physical parameters of a car whose published values may be wrong, and what they do to the power of a trip.

Each has a width: how far a car on the road may be from its published value. The widths come from what is published, never
from the trips that they are used on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Final, cast

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.files import shipped_toml
from tripwatt.hybrid.segments import SegmentTable, resimulated
from tripwatt.trips import Plan
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.spreads import ROAD_GAIN
from tripwatt.vehicles.vehicle import Entry, Value

_STEP: Final = 0.02
"""Relative change of a parameter for its finite difference."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a car, as a relative change of its published value.

    Attributes
    ----------
    name : str
    width : float
        Prior standard deviation of the relative change.
    source : str
        Where the width comes from.
    keys : tuple of str
        Entries of the car that the change multiplies; empty for one that scales a cause of the simulated power.
    causes : tuple of str
        Causes of the simulated power that it multiplies, to first order.
    """

    name: str
    width: float
    source: str
    keys: tuple[str, ...]
    causes: tuple[str, ...]


@cache
def parameters() -> tuple[Parameter, ...]:
    """What is calibrated, from `parameters.toml`.

    Examples
    --------
    >>> [parameter.name for parameter in parameters()]
    ['mass', 'rolling', 'air', 'base_load', 'drivetrain', 'climate']
    """
    return tuple(
        Parameter(name, about["width"], about["source"], tuple(about["keys"]), tuple(about["causes"]))
        for name, about in shipped_toml("hybrid/parameters.toml").items()
    )


def on_road(vehicle: Vehicle) -> Vehicle:
    """A car as it is expected on the road, where its values are those of a test; another car as it is.

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
    """A car with parameters changed by a relative amount; those without an entry of their own change nothing.

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
    """A car with values in the place of the published ones, which its entries keep.

    Parameters
    ----------
    vehicle : Vehicle
    values : mapping of str to (float, str or tuple of float)
        By key of the entries, e.g. ``"auxiliaries.base_load_w"``.
    sources : mapping of str to str
        Where each value comes from.

    Returns
    -------
    Vehicle
        The same object where there are no values.
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


def sensitivities(plans: Sequence[Plan], vehicle: Vehicle, table: SegmentTable) -> FloatArray:
    """Power of each segment by a relative change of 1 of each parameter [W], shape (rows, parameters).

    A parameter with entries of its own is changed by 2 % and the trip is simulated again; the others multiply a
    cause. O(samples) for each.

    Parameters
    ----------
    plans : sequence of Trip
        In the order of the table.
    vehicle : Vehicle
    table : SegmentTable
        Their segments with the car as it is.
    """
    columns = []
    for parameter in parameters():
        if parameter.keys and parameter.name != "base_load":
            other = changed(vehicle, {parameter.name: _STEP})
            (again,) = resimulated(table, plans, [other])
            columns.append((again.simulated_w - table.simulated_w) / _STEP)
        else:
            causes = [f"{cause}_w" for cause in parameter.causes]
            columns.append(np.asarray(table.features[causes].to_numpy().sum(axis=1)))
    return np.column_stack(columns)
