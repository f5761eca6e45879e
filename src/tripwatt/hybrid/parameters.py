"""Values of a car other than the published ones: on the road in place of a test, or identified from trips."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.anchors import ROAD_GAIN
from tripwatt.vehicles.parts import ROLLING_ENTRIES
from tripwatt.vehicles.vehicle import FIELDS, Entry, Value


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
    published = {f"road_load.{name}": getattr(vehicle.road_load, name) for name in ROLLING_ENTRIES}
    values = {key: value * (1.0 + ROAD_GAIN) for key, value in published.items() if value is not None}
    sources = dict.fromkeys(values, "from the test to the road")
    return replace(with_values(vehicle, values, sources), anchor="road")


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
            old = Entry(value, FIELDS[key].metadata["unit"], "no source", licence="estimate")
        published = f"{before:g}" if isinstance(before, float) else "another curve"
        entries[key] = replace(
            old,
            value=value,
            source=f"{sources[key]}; published {published}: {old.source}",
            published=before if old.published is None else old.published,
        )
    return vehicle.with_values(values, entries) if values else vehicle
