"""Cars as frozen dataclasses, one TOML per car: value, unit and source for every entry."""

from tripwatt.vehicles.comparing import differences, with_differences, without_data
from tripwatt.vehicles.extras import with_extras
from tripwatt.vehicles.loading import (
    find_vehicles,
    load_vehicle,
    require_vehicle,
    vehicle_names,
    vehicle_titles,
)
from tripwatt.vehicles.parts import Battery, Climate, Drivetrain, Regeneration, Tyres
from tripwatt.vehicles.reading import ALIASES, vehicle_from_document
from tripwatt.vehicles.vehicle import LICENCES, Vehicle
from tripwatt.vehicles.writing import describe_vehicle, render_vehicle, vehicle_document

__all__ = [
    "ALIASES",
    "LICENCES",
    "Battery",
    "Climate",
    "Drivetrain",
    "Regeneration",
    "Tyres",
    "Vehicle",
    "describe_vehicle",
    "differences",
    "find_vehicles",
    "load_vehicle",
    "render_vehicle",
    "require_vehicle",
    "vehicle_document",
    "vehicle_from_document",
    "vehicle_names",
    "vehicle_titles",
    "with_differences",
    "with_extras",
    "without_data",
]
