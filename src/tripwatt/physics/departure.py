"""How warm the car is at departure, from what is known there."""

from __future__ import annotations

from typing import Final

from tripwatt.vehicles import Vehicle

SUN_HEATS_CABINS_FROM_DEGC: Final = 12.0
"""In outside air warmer than this a warm cabin may come from the sun and is no sign of an earlier drive."""


def cabin_at_departure(vehicle: Vehicle, logged_degc: float | None, ambient_degc: float) -> float:
    """Cabin temperature [°C] at departure: as logged, else that of the outside air.

    A sensor at the lower end of its range has no information; the cabin is then assumed to be as cold as the air
    outside.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> cabin_at_departure(car, 21.0, 3.0), cabin_at_departure(car, 10.0, 3.0), cabin_at_departure(car, None, 3.0)
    (21.0, 3.0, 3.0)
    """
    if logged_degc is None:
        return ambient_degc
    if vehicle.climate is not None and logged_degc <= vehicle.climate.sensor_minimum_degc:
        return min(logged_degc, ambient_degc)
    return logged_degc


def warmth_from_cabin(
    vehicle: Vehicle, logged_degc: float | None, setpoint_degc: float | None, ambient_degc: float
) -> float:
    """Warmth of tyres and driveline at departure, from a cabin that is still warm in cold weather, 0 to 1.

    Interior and tyres cool at a similar pace, in about half an hour, so the cabin's excess over the outside air,
    relative to that at the set-point, is the measure of the rest.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> warmth_from_cabin(car, 12.0, 22.0, 2.0), warmth_from_cabin(car, 10.0, 22.0, 2.0), warmth_from_cabin(car, 40.0, 22.0, 25.0)
    (0.5, 0.0, 0.0)
    """
    climate = vehicle.climate
    if logged_degc is None or climate is None or ambient_degc >= SUN_HEATS_CABINS_FROM_DEGC:
        return 0.0
    setpoint = climate.setpoint_degc if setpoint_degc is None else setpoint_degc
    if logged_degc <= climate.sensor_minimum_degc or setpoint <= ambient_degc:
        return 0.0
    return min(1.0, max(0.0, (logged_degc - ambient_degc) / (setpoint - ambient_degc)))
