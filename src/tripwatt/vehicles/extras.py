"""What is fitted to a car for a while, or switched on: winter tyres, a roof box, a trailer, headlights, heated seats; and the pressure of its tyres."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from tripwatt.trips import EXTRAS
from tripwatt.vehicles.catalogue import ROAD_LOAD_DENSITY_KG_M3
from tripwatt.vehicles.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Extra:
    """What an extra changes.

    Attributes
    ----------
    rolling : float
        Factor of the rolling resistance.
    drag_area_m2, mass_kg : float
        What it adds.
    load_w : float
        Power that it takes.
    source : str
    """

    rolling: float = 1.0
    drag_area_m2: float = 0.0
    mass_kg: float = 0.0
    load_w: float = 0.0
    source: str = ""


EFFECTS: Final[Mapping[str, Extra]] = {
    "winter_tyres": Extra(
        rolling=1.10,
        source="two thirds of a class of the EU tyre label (Regulation (EU) 2020/740: classes lie 15 % apart); winter tyres are "
        "mostly one class worse than summer tyres of their maker",
    ),
    "roof_box": Extra(
        drag_area_m2=0.12,
        mass_kg=20.0,
        source="a box of 0.8 m by 0.4 m with a drag coefficient near 0.4; its load counts as payload",
    ),
    "trailer": Extra(
        drag_area_m2=0.60,
        mass_kg=500.0,
        source="a laden single-axle trailer of 500 kg with a flat tarpaulin, partly in the wake of the car; more load counts as payload",
    ),
    "headlights": Extra(
        load_w=100.0,
        source="two dipped beams of 35 W (light-emitting diodes) to 55 W (H7, UN Regulation 37) and six lamps of 5 W for position and "
        "number plate, less the daytime lights",
    ),
    "heated_seats": Extra(
        load_w=100.0, source="two seats of 50 W, a usual value of a seat that was warmed up"
    ),
}
"""Effect of each extra. Estimates of the tripwatt authors from the figures that are named."""


TYRE_PRESSURE_EXPONENT: Final = -0.4
"""Of the rolling resistance over the tyre pressure (Schuring 1980): 1.4 % more for each psi less between 24 and 36 psi, as TRB Special
Report 286 has it, https://nap.nationalacademies.org/catalog/11620."""


def with_extras(vehicle: Vehicle, extras: Iterable[str], tyre_pressure: float | None = None) -> Vehicle:
    """A car with extras, and with tyres of another pressure.

    Parameters
    ----------
    vehicle : Vehicle
        The car without the extras.
    extras : iterable of str
        Of `EXTRAS`; one that comes twice counts once.
    tyre_pressure : float, optional
        Over the recommended one; None where it is not known, and taken as right.

    Returns
    -------
    Vehicle
        A copy with other drag area, rolling resistance, mass and base load; the car itself where nothing changes.

    Raises
    ------
    KeyError
        For an unknown extra; `Departure` refuses it before.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car = load_vehicle("vw_id3")
    >>> round(with_extras(car, ["roof_box"]).road_load.drag_area_m2 - car.road_load.drag_area_m2, 3)
    0.12
    """
    chosen = [EFFECTS[name] for name in EXTRAS if name in set(extras)]
    if not chosen and tyre_pressure in (None, 1.0):
        return vehicle
    rolling, area, mass, power = (tyre_pressure or 1.0) ** TYRE_PRESSURE_EXPONENT, 0.0, 0.0, 0.0
    for extra in chosen:
        rolling *= extra.rolling
        area += extra.drag_area_m2
        mass += extra.mass_kg
        power += extra.load_w
    load = vehicle.road_load
    values = {
        "body.curb_mass_kg": vehicle.body.curb_mass_kg + mass,
        "auxiliaries.base_load_w": vehicle.auxiliaries.base_load_w + power,
    }
    for name in ("coastdown_a_n", "coastdown_b_n_s_m", "rolling_resistance_coefficient"):
        value = getattr(load, name)
        if value is not None:
            values[f"road_load.{name}"] = value * rolling
    if load.coastdown_c_n_s2_m2 is not None:
        density = load.coastdown_air_density_kg_m3 or ROAD_LOAD_DENSITY_KG_M3
        values["road_load.coastdown_c_n_s2_m2"] = load.coastdown_c_n_s2_m2 + 0.5 * density * area
    if load.drag_coefficient is not None and load.frontal_area_m2 is not None:
        values["road_load.drag_coefficient"] = load.drag_coefficient + area / load.frontal_area_m2
    return vehicle.with_values(values)
