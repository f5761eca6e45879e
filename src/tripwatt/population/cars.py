"""Putting a fitted model on a car. Cars are compared by their values, never by title or source."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from tripwatt.forecasting import ForecastModel, load_model
from tripwatt.trips import Flag
from tripwatt.vehicles import Vehicle, differences, load_vehicle, vehicle_names, with_differences
from tripwatt.vehicles.anchors import CLASS_ANCHORS
from tripwatt.vehicles.catalogue import beyond_classes, mass_range_kg

MAX_NAMED: Final = 5
"""Largest number of changed values that are named; the others are counted."""

_NO_ENERGY: Final = "charging"
"""Section of a car on which the energy of a trip does not depend."""


def for_car(
    model: ForecastModel | Path | str | None = None, car: Vehicle | str | None = None
) -> ForecastModel:
    """Put a model on a car: `ForecastModel.flags` of the result go into each of its forecasts.

    A car with another name and other values is another car. A car with the model's name and other values is the model's car, changed.
    It keeps the values identified from trips, except the changed ones. Its correction is as uncertain as that of another car, because
    the trips were of the unchanged car. Values that trips changed count as equal to the published ones.

    Parameters
    ----------
    model : ForecastModel or path, optional
        A fitted model, or the folder of a stored one; the model that comes with the package if not given.
    car : Vehicle or str, optional
        A car, or the name of a car of the library or of the model's car; the model's own car if not given.

    Returns
    -------
    ForecastModel
        Model for the car. Its flags state that the car has no trips, or name each value that differs from the model's car. For the
        model's own car the given model itself is returned, unless the charging power differs.

    Raises
    ------
    InvalidInput
        If there is no such model or car, or the model is not fitted.

    Examples
    --------
    >>> model, heavy = for_car(car="vw_id3"), load_vehicle("bmw_i3_60ah", overrides={"mass": 2500.0})
    >>> model.vehicle.name, model.flags[0].code, for_car(car=heavy).flags[0].value
    ('vw_id3', 'no_trips_of_car', '1281 -> 2500')
    """
    fitted = model if isinstance(model, ForecastModel) else load_model(model)
    own = fitted.vehicle
    if not isinstance(car, Vehicle | None):
        if f"{car}" == own.name and f"{car}" not in vehicle_names():
            return fitted
        car = load_vehicle(car, own.preset if f"{car}" == own.name else "default")
    if car is None or car is own:
        return fitted
    # the model's own car does not need them
    from tripwatt.population.adapting import population_of, without_trips

    changes = [d for d in differences(car, own) if d.key.partition(".")[0] != _NO_ENERGY]
    if not changes:
        same_charging = car.charging in (None, own.charging)
        return fitted if same_charging else replace(fitted, vehicle=replace(own, charging=car.charging))
    if car.name != own.name:
        flags = (Flag("no_trips_of_car", own.title), *_beyond_flags(car))
        return replace(without_trips(fitted, car), flags=flags)
    # the correction was fitted with the model's values, so these are not converted from a test to the road
    changed = replace(with_differences(own, changes, car), anchor="road")
    cars = population_of(fitted, of_car=True)
    flags = tuple(Flag("changed_car", d.key, d.change, d.unit) for d in changes[:MAX_NAMED])
    if len(changes) > MAX_NAMED:
        flags = (*flags, Flag("changed_car", "others", float(len(changes) - MAX_NAMED), "1"))
    return replace(without_trips(fitted, changed, cars), flags=flags)


def _beyond_flags(vehicle: Vehicle) -> tuple[Flag, ...]:
    """Flag for values of a class that are extrapolated to a car lighter or heavier than every car of the library."""
    mass = vehicle.body.curb_mass_kg
    if vehicle.anchor not in CLASS_ANCHORS or not beyond_classes(mass):
        return ()
    return (Flag("outside_classes", "lighter" if mass < mass_range_kg()[0] else "heavier", mass, "kg"),)
