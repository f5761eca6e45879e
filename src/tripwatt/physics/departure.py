"""Temperature of the cabin and warmth of the tyres at departure, from what is known then."""

from __future__ import annotations

from typing import Final

from tripwatt.vehicles import Vehicle

SUN_HEATS_CABINS_DEGC: Final = (10.0, 14.0)
"""Outside temperatures between which a warm cabin stops being a sign of an earlier drive. Below the first one it is such a sign;
above the second one the sun may have heated the cabin. In between it counts in proportion."""


def warmth_from_cabin(
    vehicle: Vehicle, cabin_degc: float | None, setpoint_degc: float | None, ambient_degc: float
) -> float:
    """Warmth of tyres and driveline at departure, 0 to 1, inferred from a cabin that is still warm in cold weather.

    Interior and tyres cool at a similar pace, in about half an hour. The warmth is therefore the cabin's excess over the
    outside air, relative to the excess at the set-point. It is continuous in all temperatures, and 0 if the cabin is unknown.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("bmw_i3_60ah")
    >>> warmth_from_cabin(car, 12.0, 22.0, 2.0), warmth_from_cabin(car, None, 22.0, 2.0)
    (0.5, 0.0)
    >>> warmth_from_cabin(car, 40.0, 22.0, 25.0), warmth_from_cabin(car, 20.0, 22.0, 12.0)
    (0.0, 0.4)
    """
    climate = vehicle.climate
    if cabin_degc is None or climate is None:
        return 0.0
    setpoint = climate.setpoint_degc if setpoint_degc is None else setpoint_degc
    cold, warm = SUN_HEATS_CABINS_DEGC
    driven = min(1.0, max(0.0, (warm - ambient_degc) / (warm - cold)))
    # at least 5 K, for a set-point hardly above the outside air; a choice
    rise = max(setpoint - ambient_degc, 5.0)
    return driven * min(1.0, max(0.0, (cabin_degc - ambient_degc) / rise))
