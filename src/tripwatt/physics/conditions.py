"""Conditions of a drive: surroundings, load, and state of the car at the start, and how warm it is at departure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from tripwatt.errors import Fault, raise_faults
from tripwatt.physics.cabin import UNKNOWN_SUN_W_M2, CabinStart
from tripwatt.trips import COLUMNS, FIELDS, QUANTITIES
from tripwatt.vehicles import Vehicle

UNKNOWN_AMBIENT_DEGC: Final = 10.0
"""Outside temperature assumed if a trip has none: the annual mean in central Europe, in Germany 9.3 °C from 1991 to 2020
(Deutscher Wetterdienst, normal values), and somewhat more by day."""

MILD_DEGC: Final = 20.0
"""Default outside temperature of a simulation: that of a laboratory."""


@dataclass(frozen=True, slots=True)
class DriveConditions:
    """Surroundings, load and state of the car at the start of a drive.

    `simulate` checks the values against the bounds of the schema.

    Attributes
    ----------
    ambient_temperature_degc : float
        Temperature of the outside air [°C].
    initial_soc : float
        State of charge of the battery management, 0 to 1.
    initial_battery_temperature_degc : float, optional
        Battery temperature [°C]; the ambient temperature if not given.
    payload_mass_kg : float
        Load on top of the car's test mass; may be negative for a lighter test.
    climate : {"auto", "off", "heat", "cool"}
        What climate control may do; no effect for a car without a climate model.
    initial_cabin_temperature_degc : float, optional
        Cabin temperature [°C]; the ambient temperature if not given.
    cabin_setpoint_degc : float, optional
        Set-point of the cabin [°C]; the car's usual one if not given.
    solar_irradiance_w_m2 : float
        Irradiance of a horizontal surface [W/m²].
    initial_warmth : float
        Warmth of tyres and driveline: 0 after a long stop, 1 after a long fast drive.
    air_density_kg_m3 : float, optional
        Air density [kg/m³], as on a dynamometer; that of the standard atmosphere if not given.
    rain_mm_h : float
        Rain on the road [mm/h].
    on_dynamometer : bool
        Whether the wheels turn on a drum; `Auxiliaries.moving_load_w` is then left out.

    Raises
    ------
    InvalidInput
        If the mode of climate control is unknown.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> car, conditions = load_vehicle("bmw_i3_60ah"), DriveConditions(ambient_temperature_degc=-5.0)
    >>> conditions.battery_start_degc, conditions.cabin_start(car).temperature_degc
    (-5.0, -5.0)
    >>> list(conditions.faults(car))
    []
    """

    ambient_temperature_degc: float = MILD_DEGC
    initial_soc: float = 0.8
    initial_battery_temperature_degc: float | None = None
    payload_mass_kg: float = 0.0
    climate: str = "auto"
    initial_cabin_temperature_degc: float | None = None
    cabin_setpoint_degc: float | None = None
    solar_irradiance_w_m2: float = UNKNOWN_SUN_W_M2
    initial_warmth: float = 0.0
    air_density_kg_m3: float | None = None
    rain_mm_h: float = 0.0
    on_dynamometer: bool = False

    def __post_init__(self) -> None:
        raise_faults(FIELDS["climate"].faults("climate", self.climate))

    @property
    def battery_start_degc(self) -> float:
        """Battery temperature at the start [°C]: the given one, or else that of the outside air."""
        if self.initial_battery_temperature_degc is None:
            return self.ambient_temperature_degc
        return self.initial_battery_temperature_degc

    def cabin_start(self, vehicle: Vehicle) -> CabinStart:
        """Collect the state of the cabin at the start, with the car's usual set-point if none is given.

        Parameters
        ----------
        vehicle : Vehicle
            The car.

        Returns
        -------
        CabinStart
            Its temperature is the ambient one if no cabin temperature is given.
        """
        temperature, setpoint = self.initial_cabin_temperature_degc, self.cabin_setpoint_degc
        if temperature is None:
            temperature = self.ambient_temperature_degc
        if setpoint is None:
            # the set-point of a car without a climate model has no effect
            setpoint = 22.0 if vehicle.climate is None else vehicle.climate.setpoint_degc
        sun, warmth = self.solar_irradiance_w_m2, self.initial_warmth
        return CabinStart(temperature, setpoint, sun, warmth, self.climate)

    def faults(self, vehicle: Vehicle) -> Iterator[Fault]:
        """Yield a fault for each number that is out of bounds.

        Parameters
        ----------
        vehicle : Vehicle
            The car, whose mass bounds the payload.

        Yields
        ------
        Fault
            With the name of the number, its value and its bounds.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> [fault.where for fault in DriveConditions(initial_warmth=2.0).faults(load_vehicle("vw_id3"))]
        ['initial_warmth']
        """
        bounds = {name: column.bounds for name, column in _BOUNDED.items()}
        lightest_kg = -0.5 * vehicle.body.curb_mass_kg  # a test may be lighter than the car with its driver
        bounds["payload_mass_kg"] = lightest_kg, QUANTITIES["payload_mass_kg"].maximum
        bounds |= {"initial_warmth": (0.0, 1.0), "air_density_kg_m3": (0.0, 10.0)}
        for name, (low, high) in bounds.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                yield Fault("value out of range", name, f"{value}", f"{low:g} to {high:g}")


_BOUNDED: Final = {
    name: column
    for name in DriveConditions.__dataclass_fields__
    if (column := {**COLUMNS, **QUANTITIES}.get(name.removeprefix("initial_"))) is not None
}
"""Values with the bounds of the column or quantity of their name without `initial_`."""

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
