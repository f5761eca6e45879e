"""Extras of a car, fitted or switched on: winter tyres, roof box, trailer, headlights, heated seats; and the pressure of its tyres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, Final

from tripwatt.files import shipped_toml
from tripwatt.trips import EXTRAS
from tripwatt.vehicles.catalogue import ROAD_LOAD_DENSITY_KG_M3
from tripwatt.vehicles.parts import ROLLING_ENTRIES
from tripwatt.vehicles.vehicle import Vehicle


@cache
def effects() -> Mapping[str, Mapping[str, Any]]:
    """Return the effect of each extra by its name, from `data/table/extras.toml`.

    It has a `source` and some of: `rolling`, a factor of the rolling resistance; `drag_area_m2` [m²], `mass_kg` [kg] and `load_w` [W],
    the drag area, mass and electric power that the extra adds.
    """
    return shipped_toml("vehicles/data/table/extras.toml")


TYRE_PRESSURE_EXPONENT: Final = -0.4
"""Exponent of the tyre pressure in the rolling resistance (Schuring 1980): 1.4 % more for each psi less between 24 and 36 psi, as in TRB
Special Report 286, https://nap.nationalacademies.org/catalog/11620."""


def with_extras(vehicle: Vehicle, extras: Iterable[str], tyre_pressure: float | None = None) -> Vehicle:
    """Return a car with extras, and with another tyre pressure.

    Parameters
    ----------
    vehicle : Vehicle
        The car without the extras.
    extras : iterable of str
        Names of `EXTRAS`; repeated names count once, unknown names are ignored.
    tyre_pressure : float, optional
        Tyre pressure over the recommended one [1]; None counts as the recommended pressure.

    Returns
    -------
    Vehicle
        A copy with other drag area, rolling resistance, mass and base load; the same object if nothing changes.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("vw_id3")
    >>> round(with_extras(car, ["roof_box"]).road_load.drag_area_m2 - car.road_load.drag_area_m2, 3)
    0.12
    """
    chosen = [effects()[name] for name in EXTRAS if name in set(extras)]
    if not chosen and tyre_pressure in (None, 1.0):
        return vehicle
    of_pressure = (tyre_pressure or 1.0) ** TYRE_PRESSURE_EXPONENT
    rolling = math.prod((extra.get("rolling", 1.0) for extra in chosen), start=of_pressure)
    area, mass, power = (
        sum(extra.get(n, 0.0) for extra in chosen) for n in ("drag_area_m2", "mass_kg", "load_w")
    )
    load = vehicle.road_load
    values = {
        "body.curb_mass_kg": vehicle.body.curb_mass_kg + mass,
        "auxiliaries.base_load_w": vehicle.auxiliaries.base_load_w + power,
    }
    coefficients = {name: getattr(load, name) for name in ROLLING_ENTRIES}
    values |= {f"road_load.{name}": c * rolling for name, c in coefficients.items() if c is not None}
    if load.coastdown_c_n_s2_m2 is not None:
        density = load.coastdown_air_density_kg_m3 or ROAD_LOAD_DENSITY_KG_M3
        values["road_load.coastdown_c_n_s2_m2"] = load.coastdown_c_n_s2_m2 + 0.5 * density * area
    if load.drag_coefficient is not None and load.frontal_area_m2 is not None:
        values["road_load.drag_coefficient"] = load.drag_coefficient + area / load.frontal_area_m2
    return vehicle.with_values(values)
